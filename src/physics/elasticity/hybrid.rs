//! Rows where matter is whole, bonds where it breaks, and the switch between them at run time.
//!
//! Shojaei et al. 2022, section 4. In each evaluation rows are summed first and say where a family is strained beyond a
//! share of the critical stretch, (65); these points and their families sum their bonds from this evaluation on. Bonds that
//! are about to break and end at a point with a row do not, but make both families switch, and the bonds are summed again:
//! no bond that a point of the standard region sees passes its critical stretch unbroken. The families of broken bonds
//! switch too, so that no row reaches across a crack.
//!
//! Rows and bonds together are no symmetric operator, and their motion grows. All forces are therefore those of u + τ v, which
//! damps a wave in proportion to its frequency squared and takes next to nothing from those that are long beside the horizon.

use std::sync::Mutex;

use super::State;
use super::bond_forces::BondForces;
use super::density::Density;
use super::material::{Material, On, Overstretched, RowBoundary};
use super::surface::Shares;
use crate::discretization::collocation::{SharedRow, SharedSlope};
use crate::discretization::{BondWeighting, BondWeights, Regions};
use crate::execution::{BlockRow, Exec, Limits, Motion, Packs};
use crate::family::{Body, Bond, BondStates, Families};
use crate::field::{Number, components, components_mut};
use crate::parallel;
use crate::physics::failure::CriticalStretch;
use crate::solver::Drift;
use crate::visit::Visitor;

/// Numbers that a thread updates at a time.
const CHUNK: usize = 16 * 1024;

/// What rows of a state-based solid need beside that of its bonds: the slope that gives dilatation from displacements and
/// force from dilatation, see `collocation::state_based`. In p of [`linear_solid`](super::linear_solid),
/// p = (D² k − A G)/(D M) θ and the force is (M/D) ∇p.
pub struct Dilatation<const D: usize> {
    pub slope: SharedSlope<D>,
    /// (D² k − A G)/(D M) and M/D.
    pub scales: [f64; 2],
    /// h, 1/Pa: the energy is p²/2h.
    pub bulk: f64,
}

/// Which points have rows, the row, and when points switch; a material over another, which has the bonds.
pub struct Hybrid<const D: usize, P: Packs> {
    /// Of the points that sum their bonds.
    pub inner: Box<dyn Material<D, P>>,
    pub regions: Regions,
    pub row: SharedRow<D>,
    /// None for a solid of bonds.
    pub dilatation: Option<Dilatation<D>>,
    /// Largest |eigenvalue| of the row on an infinite lattice, N/m⁴ (3D).
    pub radius: f64,
    /// τ, s
    pub damping: f64,
    /// Whether bonds are damped too, or rows alone.
    pub damps_bonds: bool,
    /// Beyond these, points switch; or warn, once, where the regions are fixed.
    pub limits: Limits,
    pub adaptive: bool,
    /// u + τ v, and whether it is that of the displacements and velocities as they are.
    damped_displacement: Vec<P::Field>,
    is_damped: bool,
    warned: bool,
    work: Work,
}

/// What the hybrid scheme has to do.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Fraction of the points that sum their bonds: now and at the start.
    pub standard: [f64; 2],
    /// In the last evaluation: bonds, and points of rows, that were visited.
    pub bonds: u64,
    pub nodes: u64,
    /// The same of all evaluations.
    pub all_bonds: u64,
    pub all_nodes: u64,
}

impl<const D: usize, P: Packs> Hybrid<D, P> {
    /// Over `inner`, on a lattice. `radius` in N/m⁴ (3D).
    pub fn new(
        inner: Box<dyn Material<D, P>>,
        regions: Regions,
        row: SharedRow<D>,
        radius: f64,
        limits: Limits,
    ) -> Self {
        Hybrid {
            inner,
            regions,
            row,
            dilatation: None,
            radius,
            damping: 0.0,
            damps_bonds: true,
            limits,
            adaptive: true,
            damped_displacement: Vec::new(),
            is_damped: false,
            warned: false,
            work: Work::default(),
        }
    }

    /// Before the first step: from here on, sums over bonds leave out the points with rows.
    pub(super) fn begin(&mut self, body: &Body<D>, exec: &mut Exec) {
        exec.within(&self.regions.standard);
        self.count(body);
        self.work = Work { standard: [self.work.standard[0]; 2], ..Work::default() };
    }

    /// Whether rows can be summed in the pass that drifts: those of a solid of bonds, where u + τ v is kept.
    fn fuses(&self) -> bool {
        self.dilatation.is_none() && self.keeps_damped()
    }

    fn keeps_damped(&self) -> bool {
        self.damping > 0.0 && !self.damped_displacement.is_empty()
    }

    /// What follows when rows have said which points are strained too far: points switch, bonds are summed, and again
    /// until none that was held has to break; then rows where bonds have written. `step`: see
    /// [`Material::first_pass`].
    fn sum_bonds_and_switch(&mut self, strained: &[u32], on: &mut On<'_, D>, state: &mut State<P>, dt: f64) {
        if self.adaptive {
            self.switch(on, strained);
        } else if let Some(&slot) = strained.iter().min() {
            self.warn(on.body, slot as usize);
        }
        loop {
            // So that what a bond holds is that of the displacements before the step.
            let since = if dt > 0.0 { dt + self.tau_of_bonds() } else { 0.0 };
            let Overstretched { broken, held } = self.first_pass_of_bonds(on, state, Some(since));
            if !self.adaptive {
                if let Some(&slot) = held.iter().min() {
                    self.warn(on.body, slot as usize);
                }
                break;
            }
            let mut ends = [broken, held.clone()].concat();
            ends.sort_unstable();
            ends.dedup();
            self.switch(on, &ends);
            if held.is_empty() {
                break;
            }
        }
        self.last_rows(on, state);
        self.count(on.body);
    }

    fn tau_of_bonds(&self) -> f64 {
        if self.damps_bonds { self.damping } else { 0.0 }
    }

    /// The first pass of the points that sum their bonds, and which bonds are beyond their critical stretch.
    fn first_pass_of_bonds(&mut self, on: &mut On<'_, D>, state: &mut State<P>, step: Option<f64>) -> Overstretched {
        let images = on.body.cloud.images.as_ref();
        let edge = RowBoundary { regions: &self.regions, images, overstretched: Mutex::default() };
        let (inner, damped) = (&mut self.inner, &mut self.damped_displacement);
        with_damped_displacement(damped, if self.damps_bonds { self.damping } else { 0.0 }, state, |state| {
            inner.first_pass(on, state, step, Some(&edge));
        });
        edge.overstretched.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// What rows give before bonds are summed: their force, or the dilatation of a state-based solid. Gives the slots that
    /// are strained too far.
    fn first_rows(&mut self, on: &mut On<'_, D>, state: &mut State<P>) -> Vec<u32> {
        if self.dilatation.is_some() {
            self.dilate(on, state, false)
        } else {
            self.rows(on, state, &self.regions.collocated, &self.limits)
        }
    }

    /// What rows give after that: the same again in the blocks that the bonds have written to, and the forces of a
    /// state-based solid.
    fn last_rows(&mut self, on: &mut On<'_, D>, state: &mut State<P>) {
        let limits = &Limits::NONE;
        if self.dilatation.is_some() {
            self.dilate(on, state, true);
        }
        let tau = self.tau_of_bonds();
        let (inner, damped) = (&mut self.inner, &mut self.damped_displacement);
        with_damped_displacement(damped, tau, state, |state| inner.second_pass(on, state));
        if self.dilatation.is_none() {
            self.rows(on, state, &self.regions.mixed, limits);
            return;
        }
        self.rows(on, state, &self.regions.collocated, limits);
        let (Some(dilatation), Some(p)) = (&self.dilatation, self.inner.dilatation_force()) else { return };
        let slope = (&dilatation.slope, dilatation.scales[1]);
        let force = components_mut::<D, _>(&mut state.force);
        on.exec.collocate_gradient::<D, P>(on.body, slope, &self.regions, p, force);
    }

    /// u + τ v, of images too.
    fn damp(&mut self, body: &Body<D>, displacement: &[P::Field], velocity: &[P::Field]) {
        if self.damping == 0.0 {
            return;
        }
        if std::mem::take(&mut self.is_damped) {
            // By a drift, in which images take no part.
            if let Some(images) = &body.cloud.images {
                images.fill(&mut self.damped_displacement);
            }
            return;
        }
        self.damped_displacement.resize(displacement.len(), P::Field::default());
        let tau = P::Field::from_f64(self.damping);
        parallel::fill(&mut self.damped_displacement, CHUNK, &|first, damped| {
            for ((damped, u), v) in damped.iter_mut().zip(&displacement[first..]).zip(&velocity[first..]) {
                *damped = *u + tau * *v;
            }
        });
    }

    /// What rows act on: u + τ v.
    fn input<'a>(&'a self, state: &'a State<P>) -> &'a [P::Field] {
        if self.damping == 0.0 { &state.displacement } else { &self.damped_displacement }
    }

    /// Applies the rows of bonds.
    fn rows(&self, on: &mut On<'_, D>, state: &mut State<P>, blocks: &[u32], limits: &Limits) -> Vec<u32> {
        let mut force = std::mem::take(&mut state.force);
        let (input, output) = (components::<D, _>(self.input(state)), components_mut::<D, _>(&mut force));
        let strained = on.exec.collocate::<D, P>(on.body, &self.row, &self.regions, blocks, input, output, limits);
        state.force = force;
        strained
    }

    /// p of a state-based solid by rows: in all blocks that have some, or again in those that bonds have written to.
    fn dilate(&mut self, on: &mut On<'_, D>, state: &State<P>, again: bool) -> Vec<u32> {
        let Hybrid { inner, regions, dilatation, damping, damped_displacement, limits, .. } = self;
        let (Some(dilatation), Some(p)) = (dilatation, inner.dilatation_force()) else { return Vec::new() };
        p.resize(on.body.cloud.n_slots(), P::Field::default());
        let input = components::<D, _>(if *damping == 0.0 { &state.displacement } else { damped_displacement });
        let slope = (&dilatation.slope, dilatation.scales[0]);
        let (blocks, limits) = if again { (&regions.mixed, &Limits::NONE) } else { (&regions.collocated, &*limits) };
        on.exec.collocate_divergence::<D, P>(on.body, slope, regions, blocks, input, p, limits)
    }

    fn switch(&mut self, on: &mut On<'_, D>, slots: &[u32]) {
        if self.regions.switch(on.body, slots) > 0 {
            on.exec.within(&self.regions.standard);
        }
    }

    fn warn(&mut self, body: &Body<D>, slot: usize) {
        if !std::mem::replace(&mut self.warned, true) {
            let x = body.cloud.position(slot);
            log::warn!(
                "the body is strained beyond what collocation is for, first at {x:?}: bonds do not break there; name the \
                 place in `standard`, or let the regions be `adaptive`"
            );
        }
    }

    fn count(&mut self, body: &Body<D>) {
        let Families::Lattice(families) = &body.families else { return };
        let [standard, rows] = [self.regions.standard_points(), self.regions.collocated_points()];
        let work = &mut self.work;
        work.standard[0] = standard as f64 / (standard + rows) as f64;
        (work.bonds, work.nodes) = ((standard * families.offsets.len()) as u64, (rows * self.row.n_nodes()) as u64);
        work.all_bonds += work.bonds;
        work.all_nodes += work.nodes;
    }
}

/// Does something with u + τ v in the place of the displacements.
fn with_damped_displacement<P: Packs>(
    damped: &mut Vec<P::Field>,
    tau: f64,
    state: &mut State<P>,
    work: impl FnOnce(&mut State<P>),
) {
    if tau == 0.0 {
        return work(state);
    }
    std::mem::swap(damped, &mut state.displacement);
    work(state);
    std::mem::swap(damped, &mut state.displacement);
}

impl<const D: usize, P: Packs> Material<D, P> for Hybrid<D, P> {
    fn is_linear(&self) -> bool {
        self.inner.is_linear()
    }

    /// Δt = √(τ² + 4/ω²) − τ, for rows with ω² = max Λ c/(c₀ ρ), and for bonds.
    ///
    /// With u(n+1) = u(n) + Δt v(n+½) and v(n+3/2) = v(n+½) − Δt ω² (u(n+1) + τ v(n+½)) the larger root leaves the unit circle
    /// where ω² Δt² + 2 ω² τ Δt = 4.
    fn stable_step(&self, on: &mut On<'_, D>, density: &Density<P::Field>) -> f64 {
        let bonds = self.inner.stable_step(on, density);
        let damped = |square: f64| (self.damping.powi(2) + square).sqrt() - self.damping;
        let softest = density.least_per_constant(self.row.heterogeneity.as_deref(), &on.body.cloud.slots);
        let rows = damped(4.0 * softest / self.radius);
        rows.min(if self.damps_bonds { damped(bonds * bonds) } else { bonds })
    }

    fn evolve(&mut self, on: &mut On<'_, D>, state: &mut State<P>, dt: f64) {
        self.damp(on.body, &state.displacement, &state.velocity);
        self.inner.begin();
        let strained = self.first_rows(on, state);
        self.sum_bonds_and_switch(&strained, on, state, dt);
    }

    /// Nothing switches.
    fn evaluate(&mut self, on: &mut On<'_, D>, state: &mut State<P>) {
        self.damp(on.body, &state.displacement, &state.velocity);
        self.first_rows(on, state);
        self.first_pass_of_bonds(on, state, None);
        self.last_rows(on, state);
        self.count(on.body);
    }

    /// The regions are its own: it is asked to [`evolve`](Material::evolve) and [`evaluate`](Material::evaluate) only.
    fn first_pass(
        &mut self,
        on: &mut On<'_, D>,
        state: &mut State<P>,
        step: Option<f64>,
        _: Option<&RowBoundary<'_, D>>,
    ) {
        match step {
            Some(dt) => self.evolve(on, state, dt),
            None => self.evaluate(on, state),
        }
    }

    fn force_in_double(&self, on: &mut On<'_, D>, states: &BondStates, u: [&[f64]; D], force: [&mut [f64]; D]) {
        self.inner.force_in_double(on, states, u, force);
    }

    fn energy_density(&self, on: &mut On<'_, D>, states: &BondStates, u: [&[P::Field]; D], density: &mut [P::Field]) {
        self.inner.energy_density(on, states, u, density);
        on.exec.row_energy::<D, P>(on.body, &self.row, &self.regions, u, density);
        if let Some(dilatation) = &self.dilatation {
            let mut p = vec![P::Field::default(); density.len()];
            let (slope, regions) = ((&dilatation.slope, dilatation.scales[0]), &self.regions);
            let (blocks, limits) = (&regions.collocated, &Limits::NONE);
            on.exec.collocate_divergence::<D, P>(on.body, slope, regions, blocks, u, &mut p, limits);
            for (w, p) in density.iter_mut().zip(p) {
                let p = p.to_f64();
                if p != 0.0 {
                    *w = P::Field::from_f64(w.to_f64() + 0.5 * p * p / dilatation.bulk);
                }
            }
        }
    }

    fn diagonal(&self, on: &mut On<'_, D>, states: &BondStates, diagonal: [&mut [f64]; D]) {
        self.inner.diagonal(on, states, diagonal);
    }

    fn diagonal_row(&self, row: usize, on: &mut On<'_, D>, states: &BondStates, sums: [&mut [f64]; D]) -> bool {
        self.inner.diagonal_row(row, on, states, sums)
    }

    fn stiffness(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        u: [&[f64]; D],
    ) -> Option<Vec<BlockRow<D>>> {
        self.inner.stiffness(body, weights, states, u)
    }

    fn energy_at(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        u: [&[f64]; D],
        slot: usize,
    ) -> f64 {
        self.inner.energy_at(body, weights, states, u, slot)
    }

    fn bond_forces<'a>(
        &'a self,
        body: &'a Body<D>,
        weights: &'a BondWeights,
        states: &'a BondStates,
        u: [&'a [f64]; D],
    ) -> BondForces<'a, D> {
        self.inner.bond_forces(body, weights, states, u)
    }

    fn most_stretched(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &mut BondStates,
        u: [&[P::Field]; D],
        failure: &CriticalStretch,
    ) -> Option<(f64, [usize; 2])> {
        self.inner.most_stretched(body, weights, states, u, failure)
    }

    fn strain_ratio(&self, bond: &Bond<D, f64>, eta: &[f64; D], critical: f64) -> f64 {
        self.inner.strain_ratio(bond, eta, critical)
    }

    fn shares(&self, on: &mut On<'_, D>, scaling: &BondWeighting) -> Shares {
        self.inner.shares(on, scaling)
    }

    fn scheme(&self, slot: usize) -> f64 {
        if self.regions.has_row(slot) { 0.0 } else { 1.0 }
    }

    fn work(&self) -> Option<Work> {
        Some(self.work)
    }

    fn damped(&mut self) -> Option<(f64, &mut [P::Field])> {
        self.keeps_damped().then_some((self.damping, &mut self.damped_displacement[..]))
    }

    fn was_set(&mut self, state: &State<P>, component: usize, slots: &[u32]) {
        let tau = P::Field::from_f64(self.damping);
        let Some((_, damped)) = Material::<D, P>::damped(self) else { return };
        let [u, v] = [&state.displacement, &state.velocity].map(|flat| components::<D, _>(flat)[component]);
        let damped = &mut *components_mut::<D, _>(damped)[component];
        for &slot in slots {
            damped[slot as usize] = u[slot as usize] + tau * v[slot as usize];
        }
    }

    fn has_drifted(&mut self) {
        self.is_damped |= self.keeps_damped();
    }

    /// Drifts, slab by slab, with the first rows behind.
    fn drift_and_evolve(&mut self, on: &mut On<'_, D>, state: &mut State<P>, drift: &Drift, dt: f64) -> Option<f64> {
        if !self.fuses() {
            return None;
        }
        // A state-based solid of which no point has a row.
        self.inner.begin();
        let State { displacement, velocity, force, .. } = state;
        let motion = Motion { displacement, velocity, force, damped: &mut self.damped_displacement };
        let pass = |m: Motion<'_, P::Field>| drift.pass(m.displacement, m.velocity, m.force, m.damped);
        let (row, regions, limits) = (&self.row, &self.regions, &self.limits);
        let (strained, squares) = on.exec.collocate_fused::<D, P>(on.body, row, regions, motion, limits, &pass);
        self.sum_bonds_and_switch(&strained, on, state, dt);
        Some(squares)
    }

    fn dissipates(&self) -> bool {
        self.damping != 0.0
    }

    /// −τ Σ v·L v V = 2 Σ W(τ v) V/τ.
    fn dissipation(&mut self, on: &mut On<'_, D>, state: &mut State<P>) -> Option<f64> {
        if self.damping == 0.0 {
            return None;
        }
        let tau = P::Field::from_f64(self.damping);
        parallel::fill(&mut self.damped_displacement, CHUNK, &|first, damped| {
            damped.iter_mut().zip(&state.velocity[first..]).for_each(|(damped, v)| *damped = tau * *v);
        });
        if let Some(images) = &on.body.cloud.images {
            images.fill(&mut self.damped_displacement);
        }
        let mut density = vec![P::Field::default(); on.body.cloud.n_slots()];
        let input = components::<D, _>(&self.damped_displacement);
        self.energy_density(on, &state.states, input, &mut density);
        let (regions, all) = (&self.regions, self.damps_bonds);
        let [energy, ..] = on.exec.sum(density.len(), &|slots| {
            let counts = |slot: &usize| all || regions.has_row(*slot);
            [slots.filter(counts).map(|slot| density[slot].to_f64()).sum(), 0.0, 0.0, 0.0]
        });
        Some(2.0 * energy * on.body.cloud.spacing.powi(D as i32) / self.damping)
    }

    fn memory(&self) -> usize {
        self.inner.memory() + self.regions.memory() + size_of_val(&self.damped_displacement[..])
    }

    fn visit(&mut self, visitor: &mut dyn Visitor) {
        self.inner.visit(visitor);
        self.regions.visit(visitor);
        P::Field::visit(&mut self.damped_displacement, "damped_displacement", visitor);
        visitor.flag("is_damped", &mut self.is_damped);
        visitor.flag("warned", &mut self.warned);
        let Work { standard, bonds, nodes, all_bonds, all_nodes } = &mut self.work;
        for (name, value) in [("standard_fraction", 0), ("standard_fraction_at_start", 1)] {
            visitor.number(name, &mut standard[value]);
        }
        for (name, count) in [
            ("bond_evaluations", bonds),
            ("row_evaluations", nodes),
            ("all_bond_evaluations", all_bonds),
            ("all_row_evaluations", all_nodes),
        ] {
            visitor.count(name, count);
        }
    }
}
