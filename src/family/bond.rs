//! One bond, and what may be computed along it.

use crate::lane::Lane;

/// A bond as a law sees it: a view made inside the loops, on one bond or on several side by side.
#[derive(Debug, Clone, Copy)]
pub struct Bond<const D: usize, L> {
    /// ξ = x′ − x, m.
    pub xi: [L; D],
    /// |ξ|, m.
    pub length: L,
    /// The quadrature weight that the discretisation gives the bond: strength × ω × β × V′.
    pub weight: L,
}

/// A formula along a bond, summed over families by `execution`: the force of a law, its energy, a dilatation.
///
/// `I` values are known at the two ends (displacement, and whatever a later pass of a law adds), `O` are summed.
/// A kernel allocates nothing and indexes nothing; it is the same source for one bond and for eight side by side.
pub trait BondKernel<const D: usize, const I: usize, const O: usize>: Sync {
    /// Whether the sum is taken every step, so that it is worth compiling for each set of instructions.
    const HOT: bool = false;

    /// The summand of x, given the values here (x) and there (x′), and the stretch of the bond.
    fn evaluate<L: Lane>(&self, bond: &Bond<D, L>, here: [L; I], there: [L; I]) -> ([L; O], L);
}

/// A bond law of elasticity: what a bond does when its ends move apart.
pub trait BondLaw<const D: usize>: Copy + Send + Sync {
    /// Force density on x from x′ (N/m³ in 3D, weighted), and the stretch of the bond; η = u′ − u, m.
    fn force<L: Lane>(&self, bond: &Bond<D, L>, eta: [L; D]) -> ([L; D], L);
    /// Elastic energy density of the bond, weighted: half of it belongs to each end.
    fn energy<L: Lane>(&self, bond: &Bond<D, L>, eta: [L; D]) -> L;
    /// Spring constant of the bond at rest, weighted: derivative of the force along ξ by η along ξ.
    fn tangent(&self, length: f64, weight: f64) -> f64;
}
