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

use rayon::prelude::*;

use super::Problem;
use crate::conditions::Prescribed;
use crate::discretization::Regions;
use crate::discretization::collocation::{SharedRow, SharedSlope};
use crate::execution::{Exec, Limits, Motion, Packs};
use crate::family::{Body, BondLaw, Families};
use crate::field::{Double, Number, Precision, components, components_mut};
use crate::physics::elasticity::state_based::Changing;
use crate::physics::elasticity::{Edge, Elasticity, Overstretched, State, doubles, doubles_mut};
use crate::solver::Drift;

/// Numbers that a thread updates at a time.
const CHUNK: usize = 16 * 1024;

/// Evaluations between two looks at the power of the damping.
const LOOKS: u64 = 20;

/// What rows of a state-based solid need beside that of its bonds: the slope that gives dilatation from displacements and
/// force from dilatation, see `collocation::state_based`. In p of [`StateBased`](crate::physics::elasticity::state_based),
/// p = (D² k − A G)/(D M) θ and the force is (M/D) ∇p.
pub struct Dilatation<const D: usize> {
    pub slope: SharedSlope<D>,
    /// (D² k − A G)/(D M) and M/D.
    pub scales: [f64; 2],
    /// h, 1/Pa: the energy is p²/2h.
    pub bulk: f64,
}

/// Which points have rows, the row, and when points switch.
pub struct Hybrid<const D: usize, P: Precision> {
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
    ahead: Vec<P::Field>,
    is_ahead: bool,
    warned: bool,
    /// Of the damping at the last look, W.
    power: f64,
    pub work: Work,
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
    /// `radius` in N/m⁴ (3D).
    pub fn new(regions: Regions, row: SharedRow<D>, radius: f64, limits: Limits) -> Self {
        Hybrid {
            regions,
            row,
            dilatation: None,
            radius,
            damping: 0.0,
            damps_bonds: true,
            limits,
            adaptive: true,
            ahead: Vec::new(),
            is_ahead: false,
            warned: false,
            power: 0.0,
            work: Work::default(),
        }
    }

    /// Largest stable step of velocity Verlet, s, where that of the bonds is `bonds`: Δt = √(τ² + 4/ω²) − τ, for rows with
    /// ω² = Λ/ρ.
    ///
    /// With u(n+1) = u(n) + Δt v(n+½) and v(n+3/2) = v(n+½) − Δt ω² (u(n+1) + τ v(n+½)) the larger root leaves the unit circle
    /// where ω² Δt² + 2 ω² τ Δt = 4.
    pub fn stable_step(&self, density: f64, bonds: f64) -> f64 {
        let damped = |square: f64| (self.damping.powi(2) + square).sqrt() - self.damping;
        let rows = damped(4.0 * density / self.radius);
        rows.min(if self.damps_bonds { damped(bonds * bonds) } else { bonds })
    }

    /// As [`Elasticity::evaluate`].
    fn evaluate<L: BondLaw<D>>(
        &mut self,
        physics: &Elasticity<L>,
        body: &Body<D>,
        exec: &mut Exec,
        state: &mut State<P>,
        dt: f64,
    ) {
        self.look_ahead(&state.displacement, &state.velocity);
        if self.dilatation.is_some() {
            state.changing().turn();
        }
        let strained = self.first_rows(body, exec, state);
        self.go_on(&strained, physics, body, exec, state, dt);
    }

    /// Whether rows can be summed in the pass that drifts: those of a solid of bonds, where u + τ v is kept.
    pub(super) fn evaluates_behind(&self) -> bool {
        self.dilatation.is_none() && self.looks_ahead()
    }

    /// Drifts, slab by slab, with the first rows behind, and evaluates. Gives what the drift gives.
    pub(super) fn evaluate_behind<L: BondLaw<D>>(
        &mut self,
        drift: &Drift<P::Field>,
        physics: &Elasticity<L>,
        body: &Body<D>,
        exec: &mut Exec,
        state: &mut State<P>,
        dt: f64,
    ) -> f64 {
        let State { displacement, velocity, force, .. } = state;
        let motion = Motion { displacement, velocity, force, ahead: &mut self.ahead };
        let pass = |m: Motion<'_, P::Field>| drift.pass(m.displacement, m.velocity, m.force, m.ahead);
        let (row, regions, limits) = (&self.row, &self.regions, &self.limits);
        let (strained, squares) = exec.collocate_behind::<D, P>(body, row, regions, motion, limits, &pass);
        self.go_on(&strained, physics, body, exec, state, dt);
        squares
    }

    /// What follows when rows have said which points are strained too far.
    fn go_on<L: BondLaw<D>>(
        &mut self,
        strained: &[u32],
        physics: &Elasticity<L>,
        body: &Body<D>,
        exec: &mut Exec,
        state: &mut State<P>,
        dt: f64,
    ) {
        if self.adaptive {
            self.switch(body, exec, strained);
        } else if let Some(&slot) = strained.iter().min() {
            self.warn(body, slot as usize);
        }
        let tau = if self.damps_bonds { self.damping } else { 0.0 };
        loop {
            let edge = Edge { regions: &self.regions, overstretched: Mutex::default() };
            Self::at(&mut self.ahead, tau, state, |state| {
                // So that what a bond holds is that of the displacements before the step.
                let since = if dt > 0.0 { dt + tau } else { 0.0 };
                if self.dilatation.is_some() {
                    physics.extend(body, exec, state, since, physics.failure.as_ref(), Some(&edge));
                } else {
                    physics.evaluate(body, exec, state, since, Some(&edge));
                }
            });
            let list = edge.overstretched.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
            let Overstretched { broken, held } = list;
            if !self.adaptive {
                if let Some(&slot) = held.iter().min() {
                    self.warn(body, slot as usize);
                }
                break;
            }
            let mut ends = [broken, held.clone()].concat();
            ends.sort_unstable();
            ends.dedup();
            self.switch(body, exec, &ends);
            if held.is_empty() {
                break;
            }
        }
        self.last_rows(physics, body, exec, state);
        self.count(body);
    }

    /// As [`Elasticity::force_density`]; nothing switches.
    fn force_density<L: BondLaw<D>>(
        &mut self,
        physics: &Elasticity<L>,
        body: &Body<D>,
        exec: &mut Exec,
        state: &mut State<P>,
    ) {
        self.look_ahead(&state.displacement, &state.velocity);
        self.first_rows(body, exec, state);
        let tau = if self.damps_bonds { self.damping } else { 0.0 };
        Self::at(&mut self.ahead, tau, state, |state| {
            if self.dilatation.is_some() {
                let edge = Edge { regions: &self.regions, overstretched: Mutex::default() };
                return physics.extend(body, exec, state, 0.0, None, Some(&edge));
            }
            let State { displacement, force, states, .. } = state;
            let (input, output) = (components::<D, _>(displacement), components_mut::<D, _>(force));
            physics.force_density::<D, P>(body, exec, states, input, output);
        });
        self.last_rows(physics, body, exec, state);
        self.count(body);
    }

    /// What rows give before bonds are summed: their force, or the dilatation of a state-based solid. Gives the slots that
    /// are strained too far.
    fn first_rows(&self, body: &Body<D>, exec: &mut Exec, state: &mut State<P>) -> Vec<u32> {
        let (blocks, limits) = (&self.regions.collocated, &self.limits);
        match &self.dilatation {
            Some(dilatation) => self.dilate(dilatation, body, exec, blocks, limits, state),
            None => self.rows(body, exec, blocks, limits, state),
        }
    }

    /// What rows give after that: the same again in the blocks that the bonds have written to, and the forces of a
    /// state-based solid.
    fn last_rows<L: BondLaw<D>>(
        &mut self,
        physics: &Elasticity<L>,
        body: &Body<D>,
        exec: &mut Exec,
        state: &mut State<P>,
    ) {
        let limits = &Limits::NONE;
        let Some(dilatation) = &self.dilatation else {
            self.rows(body, exec, &self.regions.mixed, limits, state);
            return;
        };
        self.dilate(dilatation, body, exec, &self.regions.mixed, limits, state);
        let tau = if self.damps_bonds { self.damping } else { 0.0 };
        Self::at(&mut self.ahead, tau, state, |state| physics.pull(body, exec, state));
        self.rows(body, exec, &self.regions.collocated, limits, state);
        let Changing { force, tension, .. } = state.changing();
        let slope = (&dilatation.slope, dilatation.scales[1]);
        let force = components_mut::<D, _>(force);
        exec.collocate_gradient::<D, Double>(body, slope, &self.regions, &tension[0], force);
    }

    /// Does something with u + τ v in the place of the displacements.
    fn at(ahead: &mut Vec<P::Field>, tau: f64, state: &mut State<P>, mut work: impl FnMut(&mut State<P>)) {
        if tau == 0.0 {
            return work(state);
        }
        std::mem::swap(ahead, &mut state.displacement);
        work(state);
        std::mem::swap(ahead, &mut state.displacement);
    }

    /// τ and where a solver that drifts may put u + τ v in passing.
    pub(super) fn ahead(&mut self) -> Option<(f64, &mut [P::Field])> {
        self.looks_ahead().then_some((self.damping, &mut self.ahead[..]))
    }

    fn looks_ahead(&self) -> bool {
        self.damping > 0.0 && !self.ahead.is_empty()
    }

    /// A solver has drifted, and prescribed values have been set behind it.
    pub(super) fn drifted(&mut self, prescribed: &[Prescribed], state: &State<P>) {
        let tau = P::Field::from_f64(self.damping);
        let Some((_, ahead)) = self.ahead() else { return };
        for p in prescribed {
            let [u, v] = [&state.displacement, &state.velocity].map(|flat| components::<D, _>(flat)[p.component]);
            let ahead = &mut *components_mut::<D, _>(ahead)[p.component];
            for &slot in p.slots.iter() {
                ahead[slot as usize] = u[slot as usize] + tau * v[slot as usize];
            }
        }
        self.is_ahead = true;
    }

    /// u + τ v
    fn look_ahead(&mut self, displacement: &[P::Field], velocity: &[P::Field]) {
        if self.damping == 0.0 || std::mem::take(&mut self.is_ahead) {
            return;
        }
        self.ahead.resize(displacement.len(), P::Field::default());
        let tau = P::Field::from_f64(self.damping);
        let ahead = self.ahead.par_chunks_mut(CHUNK);
        ahead.zip(displacement.par_chunks(CHUNK)).zip(velocity.par_chunks(CHUNK)).for_each(|((ahead, u), v)| {
            for ((ahead, u), v) in ahead.iter_mut().zip(u).zip(v) {
                *ahead = *u + tau * *v;
            }
        });
    }

    /// What rows act on: u + τ v.
    fn input<'a>(&'a self, state: &'a State<P>) -> &'a [P::Field] {
        if self.damping == 0.0 { &state.displacement } else { &self.ahead }
    }

    /// Applies the rows of bonds.
    fn rows(&self, body: &Body<D>, exec: &mut Exec, blocks: &[u32], limits: &Limits, state: &mut State<P>) -> Vec<u32> {
        let mut force = std::mem::take(&mut state.force);
        let (input, output) = (components::<D, _>(self.input(state)), components_mut::<D, _>(&mut force));
        let strained = exec.collocate::<D, P>(body, &self.row, &self.regions, blocks, input, output, limits);
        state.force = force;
        strained
    }

    /// p of a state-based solid by rows.
    fn dilate(
        &self,
        dilatation: &Dilatation<D>,
        body: &Body<D>,
        exec: &mut Exec,
        blocks: &[u32],
        limits: &Limits,
        state: &mut State<P>,
    ) -> Vec<u32> {
        let [now, _] = &mut state.tension;
        let mut tension = std::mem::take(now);
        tension.resize(body.cloud.n_slots(), 0.0);
        let input = components::<D, _>(doubles(self.input(state)));
        let slope = (&dilatation.slope, dilatation.scales[0]);
        let strained =
            exec.collocate_divergence::<D, Double>(body, slope, &self.regions, blocks, input, &mut tension, limits);
        state.tension[0] = tension;
        strained
    }

    fn switch(&mut self, body: &Body<D>, exec: &mut Exec, slots: &[u32]) {
        if self.regions.switch(body, slots) > 0 {
            exec.within(&self.regions.standard);
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

    fn memory(&self) -> usize {
        self.regions.memory() + size_of_val(&self.ahead[..])
    }
}

impl<const D: usize, L: BondLaw<D>, P: Packs> Problem<D, L, P> {
    /// From here on points have rows as `hybrid` says. Before the start.
    pub fn hybridise(&mut self, mut hybrid: Hybrid<D, P>) {
        self.exec.within(&hybrid.regions.standard);
        hybrid.count(&self.body);
        hybrid.work = Work { standard: [hybrid.work.standard[0]; 2], ..Work::default() };
        self.hybrid = Some(Box::new(hybrid));
    }

    /// What the hybrid scheme has to do; None in the standard scheme.
    pub fn hybrid(&self) -> Option<Work> {
        self.hybrid.as_ref().map(|hybrid| hybrid.work)
    }

    /// Bonds that overstretch break, and the internal force density is that of the displacements.
    pub(super) fn evaluate_bonds(&mut self, dt: f64) {
        let Problem { body, physics, state, exec, hybrid, .. } = self;
        match hybrid {
            Some(hybrid) => hybrid.evaluate(physics, body, exec, state, dt),
            None => physics.evaluate(body, exec, state, dt, None),
        }
    }

    /// The internal force density, without anything breaking.
    pub(super) fn force_of_bonds(&mut self) {
        let Problem { body, physics, state, exec, hybrid, .. } = self;
        if let Some(hybrid) = hybrid {
            return hybrid.force_density(physics, body, exec, state);
        }
        let State { displacement, force, states, .. } = state;
        let (input, output) = (components::<D, _>(displacement), components_mut::<D, _>(force));
        physics.force_density::<D, P>(body, exec, states, input, output);
    }

    /// W by slot, J/m³.
    pub(super) fn strain_energy(&mut self) -> Vec<P::Field> {
        let mut density = vec![P::Field::default(); self.body.cloud.n_slots()];
        self.physics.strain_energy_density(&self.body, &mut self.exec, &self.state, &mut density);
        if let Some(hybrid) = &self.hybrid {
            let input = components::<D, _>(&self.state.displacement);
            self.exec.row_energy::<D, P>(&self.body, &hybrid.row, &hybrid.regions, input, &mut density);
            if let Some(dilatation) = &hybrid.dilatation {
                let (slope, mut tension) = ((&dilatation.slope, dilatation.scales[0]), vec![0.0; density.len()]);
                let (regions, input) = (&hybrid.regions, input.map(doubles));
                let (body, exec, limits) = (&self.body, &mut self.exec, &Limits::NONE);
                let blocks = &regions.collocated;
                exec.collocate_divergence::<D, Double>(body, slope, regions, blocks, input, &mut tension, limits);
                for (w, p) in doubles_mut(&mut density).iter_mut().zip(tension).filter(|(_, p)| *p != 0.0) {
                    *w += 0.5 * p * p / dilatation.bulk;
                }
            }
        }
        density
    }

    /// What damping takes, W: −τ Σ v·L v V = 2 Σ W(τ v) V/τ.
    fn power_of_damping(&mut self) -> f64 {
        let Some(hybrid) = &mut self.hybrid else { return 0.0 };
        let tau = P::Field::from_f64(hybrid.damping);
        let velocity = &self.state.velocity;
        hybrid.ahead.par_chunks_mut(CHUNK).zip(velocity.par_chunks(CHUNK)).for_each(|(ahead, v)| {
            ahead.iter_mut().zip(v).for_each(|(ahead, v)| *ahead = tau * *v);
        });
        std::mem::swap(&mut hybrid.ahead, &mut self.state.displacement);
        let density = self.strain_energy();
        let cloud = &self.body.cloud;
        let hybrid = self.hybrid.as_mut().expect("it was there above");
        let (regions, all) = (&hybrid.regions, hybrid.damps_bonds);
        let [energy, ..] = self.exec.sum(density.len(), &|slots| {
            let counts = |slot: &usize| all || regions.has_row(*slot);
            [slots.filter(counts).map(|slot| density[slot].to_f64()).sum(), 0.0, 0.0, 0.0]
        });
        std::mem::swap(&mut hybrid.ahead, &mut self.state.displacement);
        2.0 * energy * cloud.spacing.powi(D as i32) / hybrid.damping
    }

    /// Books what the damping has taken since the last look, every so many steps; `first` opens the books.
    pub(super) fn book_stiffness_damping(&mut self, step: u64, dt: f64, first: bool) {
        let due = first || step.is_multiple_of(LOOKS);
        if !due || self.hybrid.as_ref().is_none_or(|hybrid| hybrid.damping == 0.0) {
            return;
        }
        self.catch_up();
        let power = self.power_of_damping();
        let hybrid = self.hybrid.as_mut().expect("it is damped");
        if !first {
            // Trapezoidal in time.
            self.ledger.damped += 0.5 * (hybrid.power + power) * LOOKS as f64 * dt;
        }
        hybrid.power = power;
    }

    /// Where points sum their bonds, by slot: 1, and 0 where they have a row.
    pub(super) fn scheme(&self, slot: usize) -> f64 {
        let row = self.hybrid.as_ref().is_some_and(|hybrid| hybrid.regions.has_row(slot));
        if row { 0.0 } else { 1.0 }
    }

    pub(super) fn memory_of_hybrid(&self) -> usize {
        self.hybrid.as_ref().map_or(0, |hybrid| hybrid.memory())
    }
}
