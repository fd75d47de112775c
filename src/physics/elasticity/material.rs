//! What is inside an elastic body, behind one face: bonds, a state-based solid, the hybrid scheme over either.

use std::sync::Mutex;

use super::State;
use super::bond_forces::BondForces;
use super::density::Density;
use super::hybrid::Work;
use super::surface::Shares;
use crate::discretization::{BondWeighting, BondWeights, Operator, Regions};
use crate::execution::{BlockRow, Exec, Packs};
use crate::family::{Body, Bond, BondStates};
use crate::geometry::Images;
use crate::physics::failure::CriticalStretch;
use crate::solver::Drift;
use crate::visit::Visitor;

/// What the passes of a material run over.
pub struct On<'a, const D: usize> {
    pub body: &'a Body<D>,
    pub operator: &'a Operator,
    /// None: bonds never break.
    pub failure: Option<&'a CriticalStretch>,
    pub exec: &'a mut Exec,
}

/// A material: its passes over the bonds of one body, and the arrays that only it knows.
///
/// The type of the law ends here. A material may take two passes over the bonds, where forces need what all bonds of the
/// ends have said; whoever stands between the passes, as the hybrid scheme does, calls them one by one.
pub trait Material<const D: usize, P: Packs>: Send + Sync {
    /// Whether forces are linear in displacements.
    fn is_linear(&self) -> bool;
    /// Largest stable step of velocity Verlet, s.
    fn stable_step(&self, on: &mut On<'_, D>, density: &Density<P::Field>) -> f64;

    /// Breaks the bonds that the displacements overstretch, then fills the internal force density. `dt`: see
    /// [`Physics::evolve`](crate::physics::Physics::evolve).
    fn evolve(&mut self, on: &mut On<'_, D>, state: &mut State<P>, dt: f64) {
        self.begin();
        self.first_pass(on, state, Some(dt), None);
        self.second_pass(on, state);
    }
    /// Fills the internal force density; nothing breaks.
    fn evaluate(&mut self, on: &mut On<'_, D>, state: &mut State<P>) {
        self.first_pass(on, state, None, None);
        self.second_pass(on, state);
    }
    /// Before the first pass of a step: what was now is what was before.
    fn begin(&mut self) {}
    /// Breaks what breaks, unless there is no step, and sums what the second pass needs, or the force density if there is
    /// none. `edge`: the points whose bonds are not asked, if any.
    fn first_pass(
        &mut self,
        on: &mut On<'_, D>,
        state: &mut State<P>,
        step: Option<f64>,
        edge: Option<&RowBoundary<'_, D>>,
    );
    /// Fills the force density from what the first pass left.
    fn second_pass(&mut self, _on: &mut On<'_, D>, _state: &mut State<P>) {}
    /// What dilatation pulls with at each slot, which the first pass fills and others may; None where there is none.
    fn dilatation_force(&mut self) -> Option<&mut Vec<P::Field>> {
        None
    }
    /// q and h of a point of a state-based solid (1, and 1/Pa); None for others.
    fn dilatation_scales(&self, _slot: usize) -> Option<[f64; 2]> {
        None
    }

    /// Internal force density (N/m³ in 3D) at given displacements, in double precision whatever the fields.
    fn force_in_double(&self, on: &mut On<'_, D>, states: &BondStates, u: [&[f64]; D], force: [&mut [f64]; D]);
    /// Strain energy density by slot, J/m³.
    fn energy_density(&self, on: &mut On<'_, D>, states: &BondStates, u: [&[P::Field]; D], density: &mut [P::Field]);
    /// Diagonal of the stiffness at rest, N/m⁴ in 3D, by slot and component.
    fn diagonal(&self, on: &mut On<'_, D>, states: &BondStates, diagonal: [&mut [f64]; D]);
    /// Row `row` of the block of each point on that diagonal; false where there is none.
    fn diagonal_row(&self, _row: usize, _on: &mut On<'_, D>, _states: &BondStates, _sums: [&mut [f64]; D]) -> bool {
        false
    }
    /// ∂f/∂η of every whole bond at these displacements, weighted, by the slot of x; None where points feel more than their
    /// families.
    fn stiffness(
        &self,
        _body: &Body<D>,
        _weights: &BondWeights,
        _states: &BondStates,
        _u: [&[f64]; D],
    ) -> Option<Vec<BlockRow<D>>> {
        None
    }
    /// Whether each bond is a spring of its own, whose force is c ω̃ β V′ times its stretch.
    fn has_springs(&self) -> bool {
        false
    }
    /// Strain energy density at a slot, J/m³, bond by bond in double precision.
    fn energy_at(&self, body: &Body<D>, weights: &BondWeights, states: &BondStates, u: [&[f64]; D], slot: usize)
    -> f64;
    /// The whole bonds of each point and how they pull at displacements `u`.
    fn bond_forces<'a>(
        &'a self,
        body: &'a Body<D>,
        weights: &'a BondWeights,
        states: &'a BondStates,
        u: [&'a [f64]; D],
    ) -> BondForces<'a, D>;
    /// The whole bond whose stretch is the largest share of its critical stretch: that share, and the slots of its ends. None
    /// where no bond is stretched, or none can break. Nothing changes.
    fn most_stretched(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &mut BondStates,
        u: [&[P::Field]; D],
        failure: &CriticalStretch,
    ) -> Option<(f64, [usize; 2])>;
    /// Strain of a bond over its critical strain, in the measure of the law. `critical`: its critical stretch.
    fn strain_ratio(&self, bond: &Bond<D, f64>, eta: &[f64; D], critical: f64) -> f64;
    /// Energy densities of unit strain over those of a complete family.
    fn shares(&self, on: &mut On<'_, D>, scaling: &BondWeighting) -> Shares;

    /// c/c₀ of the bonds inside the material of a slot over those that the weights are made for.
    fn relative_stiffness(&self, weights: &BondWeights, slot: usize) -> f64 {
        weights.heterogeneity.as_ref().map_or(1.0, |varied| varied.relative(slot))
    }
    /// Where points sum their bonds, by slot: 1, and 0 where they have a row.
    fn scheme(&self, _slot: usize) -> f64 {
        1.0
    }
    /// What the hybrid scheme has to do; None in the standard scheme.
    fn work(&self) -> Option<Work> {
        None
    }
    /// τ and where a solver that drifts may put u + τ v in passing.
    fn damped(&mut self) -> Option<(f64, &mut [P::Field])> {
        None
    }
    /// Values of these slots have been set behind a drift.
    fn was_set(&mut self, _state: &State<P>, _component: usize, _slots: &[u32]) {}
    /// A drift has ended, and what it puts in passing is there.
    fn has_drifted(&mut self) {}
    /// As [`Physics::drift_and_evolve`](crate::physics::Physics::drift_and_evolve).
    fn drift_and_evolve(
        &mut self,
        _on: &mut On<'_, D>,
        _state: &mut State<P>,
        _drift: &Drift,
        _dt: f64,
    ) -> Option<f64> {
        None
    }
    /// Whether it damps in proportion to stiffness.
    fn dissipates(&self) -> bool {
        false
    }
    /// What that takes now, W; None where nothing is damped.
    fn dissipation(&mut self, _on: &mut On<'_, D>, _state: &mut State<P>) -> Option<f64> {
        None
    }

    /// Bytes that it keeps for its points.
    fn memory(&self) -> usize {
        0
    }
    /// Shows the arrays that change.
    fn visit(&mut self, _visitor: &mut dyn Visitor) {}
}

/// Where bonds end at points with a row, which stands for unbroken bonds: such bonds do not break, and are told of.
pub struct RowBoundary<'a, const D: usize> {
    pub regions: &'a Regions,
    /// An image is what its source is.
    pub images: Option<&'a Images<D>>,
    pub overstretched: Mutex<Overstretched>,
}

/// Bonds beyond their critical stretch, by the slots of both ends, in no order.
#[derive(Debug, Default)]
pub struct Overstretched {
    /// Broken.
    pub broken: Vec<u32>,
    /// With an end that has a row, and whole.
    pub held: Vec<u32>,
}

impl<const D: usize> RowBoundary<'_, D> {
    /// Takes note of a bond; whether it may break.
    pub(super) fn may_break(&self, here: usize, there: usize) -> bool {
        let source = self.images.map_or(there, |images| images.source(there).0);
        let free = !self.regions.has_row(here) && !self.regions.has_row(source);
        let mut list = self.overstretched.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let list = if free { &mut list.broken } else { &mut list.held };
        list.extend([here as u32, there as u32]);
        free
    }
}
