//! What is asked of a body as a whole: the force on a part of it, and the bond that is nearest to breaking.

/// A part of a body, whose force is asked for.
#[derive(Debug, Clone, PartialEq)]
pub enum Resultant {
    /// Internal forces and loads on the points of a set, Σ (f + b) V.
    OnSet {
        set: String,
        /// Of the moment, m; the centroid of the set (reference positions) if None.
        about: Option<[f64; 3]>,
    },
    /// What the bonds that cross a plane transmit from the side of the normal onto the other side, Σ Σ f(x, x′) V V′ over x
    /// behind the plane and x′ before it.
    ThroughCut {
        /// Of the plane, m.
        point: [f64; 3],
        /// Of any length but zero.
        normal: [f64; 3],
        /// Of the moment, m.
        about: [f64; 3],
    },
}

/// A force and its moment; N and N·m, per metre of thickness in 2D, of a unit cross-section in 1D.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ForceAndMoment {
    pub force: [f64; 3],
    pub moment: [f64; 3],
}

/// A whole bond, and how near it is to breaking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StretchedBond {
    /// Its stretch over its critical stretch.
    pub ratio: f64,
    /// The middle between its ends (reference positions), m.
    pub position: [f64; 3],
}
