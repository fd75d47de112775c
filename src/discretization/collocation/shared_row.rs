//! One row for all points of a lattice, in the order in which it is summed.

use super::Fit;
use crate::error::{Error, Result};
use crate::family::{Class, mirror_sequences};
use crate::geometry::Lattice;

/// The weights K_j of (L u)(x) = Σ_j K_j (u(x + ξ_j) − u(x)) that all points of a lattice share.
///
/// Points at x + ξ and x − ξ carry the same weight and are taken together, K (u(x + ξ) + u(x − ξ) − 2 u(x)). Mirror images
/// stand in sequences of their own, whose sums are added as a balanced tree: a mirrored body has mirrored bits.
#[derive(Debug, Clone)]
pub struct SharedRow<const D: usize> {
    /// One for each of the first halves of the sequences; the second are their images through the point.
    pub pairs: Vec<Pair<D>>,
    pub classes: Vec<Class>,
}

/// The points at x + ξ and x − ξ.
#[derive(Debug, Clone)]
pub struct Pair<const D: usize> {
    /// From x to x + ξ, in slots.
    pub shift: isize,
    /// K, N/m⁴ (3D elasticity).
    pub weight: [[f64; D]; D],
}

impl<const D: usize> SharedRow<D> {
    /// The row of `weights` at the nodes of a fit on this lattice.
    ///
    /// # Errors
    /// A fit that is not of a lattice, or that reaches farther than the lattice is padded for.
    pub fn new(lattice: &Lattice<D>, fit: &Fit<D>, weights: &[[[f64; D]; D]]) -> Result<Self> {
        let Some(steps) = &fit.steps else {
            return Err(Error::Refused("points off a lattice have rows of their own".into()));
        };
        let reach = steps.iter().map(|step| lattice.shift(step.map(i32::abs))).max().unwrap_or(0);
        if reach > lattice.guard as isize {
            return Err(Error::Refused("the row reaches farther than the families of the lattice".into()));
        }
        let quadrant = steps.iter().copied().filter(|step| step.iter().all(|&c| c >= 0)).collect();
        let (images, classes) = mirror_sequences(quadrant);
        let halves = classes.iter().flat_map(|class: &Class| {
            let half = class.members << (class.axes - 1);
            class.first as usize..(class.first + half) as usize
        });
        let pair = |k: usize| {
            let node = steps.iter().position(|step| *step == images[k]).expect("a node's mirror images are nodes");
            Pair { shift: lattice.shift(images[k]), weight: weights[node] }
        };
        Ok(SharedRow { pairs: halves.map(pair).collect(), classes })
    }

    /// Points of the row but the source.
    pub fn n_nodes(&self) -> usize {
        2 * self.pairs.len()
    }
}
