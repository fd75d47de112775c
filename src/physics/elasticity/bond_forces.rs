//! How each whole bond pulls: what stresses, forces through cuts and stretches of points are made of.
//!
//! A force state T gives the force density between two points as f(x, x′) = T\[x\]⟨ξ⟩ − T\[x′\]⟨−ξ⟩ (Silling et al.
//! 2007). Bond by bond, in double precision whatever the fields, and of all whole bonds: also of points that have a row in the
//! hybrid scheme, whose force is another.

use super::Elasticity;
use crate::execution::Packs;
use crate::family::Body;
use crate::field::{Number, components};

/// A whole bond of a point x.
#[derive(Debug, Clone, Copy)]
pub struct BondForce<const D: usize> {
    /// The slot of x′.
    pub there: usize,
    /// ξ and η, m.
    pub xi: [f64; D],
    pub eta: [f64; D],
    /// ω β V′ times the strength of the law.
    pub weight: f64,
    /// T\[x\]⟨ξ⟩ V′, N/m³ in 3D: of a bond-based law half the force.
    pub own: [f64; D],
    /// f(x, x′) V′, N/m³ in 3D.
    pub pair: [f64; D],
    /// s, as the law measures it.
    pub stretch: f64,
}

impl<const D: usize> BondForce<D> {
    /// The vector that forces act along, which is the lever of their moment too: ξ where the law is linear, else ξ + η.
    pub fn arm(&self, is_linear: bool) -> [f64; D] {
        if is_linear { self.xi } else { std::array::from_fn(|d| self.xi[d] + self.eta[d]) }
    }
}

/// The whole bonds of the point at a slot.
pub type BondForces<'a, const D: usize> = Box<dyn Fn(usize) -> Vec<BondForce<D>> + Sync + 'a>;

/// A body as it is, and how its bonds pull.
pub(super) struct Pulled<'a, const D: usize> {
    pub body: &'a Body<D>,
    pub bonds: BondForces<'a, D>,
    pub is_linear: bool,
    /// u, m.
    pub displacement: [&'a [f64]; D],
}

impl<const D: usize, P: Packs> Elasticity<D, P> {
    /// Looks at the bonds as they pull now.
    pub(super) fn pulled<T>(&mut self, look: impl FnOnce(&Pulled<'_, D>) -> T) -> T {
        let mut displacement: Vec<f64> = self.state.displacement.iter().map(|u| u.to_f64()).collect();
        if let Some(images) = &self.body.cloud.images {
            images.fill(&mut displacement);
        }
        let displacement = components::<D, _>(&displacement);
        let (material, on, state) = self.parts();
        let material = &*material;
        let bonds = material.bond_forces(on.body, &on.operator.weights, &state.states, displacement);
        look(&Pulled { body: on.body, bonds, is_linear: material.is_linear(), displacement })
    }
}
