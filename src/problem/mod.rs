//! A problem: one physics on one body, what the world does to it, and its books. A [`System`] for the solvers.
//!
//! It knows neither dimension nor material nor precision: those end at [`Physics`]. The books hold work and impulse of
//! everything from outside, energy lost to broken bonds and damping, so that a wrong run is seen at once.

mod books;
mod rest;
mod stability;
mod watch;

use std::ops::Range;

pub use crate::physics::{Adapted, Balance};
use books::Ledger;

use crate::conditions::damping::DampedStep;
use crate::conditions::{Booked, Constraint, Instant, Moment, Scale, Stage, Term, Use};
use crate::error::Result;
use crate::field::Field;
use crate::physics::{Physics, Points};
use crate::solver::runge_kutta::Memory;
use crate::solver::statics::LoadStep;
use crate::solver::{Clock, Drift, Solver, Staged, System, VelocityVerlet};
use crate::unknown::{Unknown, with};
use crate::visit::Visitor;

/// Steps between two looks at the power of the damping inside a body.
const LOOKS: u64 = 20;

/// One body, what acts on it, and where it stands.
pub struct Problem {
    pub physics: Box<dyn Physics>,
    pub constraints: Vec<Box<dyn Constraint>>,
    pub terms: Vec<Box<dyn Term>>,
    /// The solver and the step (s) whose last kick velocities have not had yet.
    pending_kick: Option<(VelocityVerlet, f64)>,
    ledger: Ledger,
    /// c of the solver in use, 1/s: the books need it.
    damping: f64,
    /// What dissipation inside the body took at the last look, W, and when that was, s.
    dissipation: [f64; 2],
    stages: Memory,
    /// What the load steps took, of static solvers.
    pub load_steps: Vec<LoadStep>,
    /// Its crack, as a static solver left it.
    crack: Option<Box<rest::Crack>>,
    /// Whether a static solver advances it: the body starts without motion, and prescribed values are the solver's to
    /// impose.
    pub is_static: bool,
    /// The largest step that has been proven stable, s, where somebody asked.
    pub stable_step: Option<f64>,
}

impl Problem {
    /// `physics` holds initial values and broken pre-cracks.
    pub fn new(physics: Box<dyn Physics>, constraints: Vec<Box<dyn Constraint>>, terms: Vec<Box<dyn Term>>) -> Self {
        let mut problem = Problem {
            physics,
            constraints,
            terms,
            pending_kick: None,
            ledger: Ledger::default(),
            damping: 0.0,
            dissipation: [0.0; 2],
            stages: Memory::default(),
            load_steps: Vec::new(),
            crack: None,
            is_static: false,
            stable_step: None,
        };
        problem.measure();
        problem
    }

    /// Tells the conditions the volumes of their points.
    fn measure(&mut self) {
        let points = self.physics.points();
        let volumes = |slots: &[u32]| match points.same_volume() {
            Some(volume) => Scale::Same(volume),
            None => Scale::ByPoint(slots.iter().map(|&slot| points.volume(slot as usize)).collect()),
        };
        self.constraints.iter_mut().for_each(|constraint| constraint.measure(&volumes));
        self.terms.iter_mut().for_each(|term| term.measure(&volumes));
    }

    /// Evaluates the rates at the start and opens the books.
    pub fn start(&mut self) {
        if self.is_static {
            self.stop();
            self.ledger.initial = self.balance().strain;
            return;
        }
        self.adapt(0.0, true);
        // What the first cells bring in is part of the initial energy.
        self.ledger.refined = 0.0;
        self.set_in_motion(0.0);
        let now = self.balance();
        self.ledger.open(&now);
        self.book_dissipation(0, 0.0, true);
    }

    /// Takes the velocities away.
    fn stop(&mut self) {
        with!(self.physics.unknown(), vectors => vectors.velocity.fill(Default::default()));
    }

    /// Puts what is prescribed in motion at time `t` and evaluates the rates there.
    fn set_in_motion(&mut self, t: f64) {
        self.impose(Stage::Start, t, 0.0);
        self.terms.iter_mut().for_each(|term| term.restart());
        self.evolve(t, 0.0);
        self.impose(Stage::Evaluated, t, 0.0);
    }

    /// Hands the body over to another solver at time `t`: displacements, broken bonds and books go on.
    ///
    /// Motion that begins at once, by a prescribed velocity, is work and impulse from outside; motion that a static solver
    /// stops is booked as taken by damping, its momentum as an impulse.
    pub fn hand_over(&mut self, solver: &Solver, t: f64) {
        self.catch_up();
        self.is_static = solver.is_static();
        self.crack = None;
        let before = self.physics.motion();
        if self.is_static {
            self.stop();
        } else {
            self.set_in_motion(t);
        }
        let after = self.physics.motion();
        let ledger = &mut self.ledger;
        if self.is_static {
            ledger.damped += before.0;
        } else {
            ledger.external += after.0 - before.0;
        }
        for d in 0..3 {
            ledger.impulse[d] += after.1[d] - before.1[d];
        }
        (ledger.kinetic, ledger.momentum) = after;
    }

    /// One step of a solver in time, then the watch over its result; or a load step of a static solver, of which `observe`
    /// is told: see [`Statics::solve`](crate::solver::Statics::solve). False when it was interrupted.
    ///
    /// Where a step of velocity Verlet can leave its last kick to the next, velocities lack it until
    /// [`catch_up`](Self::catch_up), which all that asks for velocities and energies here does; the watch then begins with
    /// the motion at the end of the step before.
    pub fn step(
        &mut self,
        solver: &Solver,
        clock: &mut Clock,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<bool> {
        if self.pending_kick.is_some_and(|(last, dt)| (Solver::VelocityVerlet(last), dt) != (*solver, clock.dt)) {
            self.catch_up();
        }
        match solver {
            Solver::Statics(statics) => return self.settle(statics, clock, observe),
            Solver::VelocityVerlet(verlet) => {
                self.damping = verlet.damping;
                let is_known = self.physics.motion_of(0.0).is_some();
                if is_known && verlet.damping == 0.0 && self.constraints.is_empty() {
                    let pending = self.pending_kick.is_some();
                    let squares = verlet.stride(self, clock, pending);
                    if pending {
                        self.book_motion(squares);
                    }
                    self.pending_kick = Some((*verlet, clock.dt));
                } else if verlet.damping == 0.0 {
                    verlet.step(self, clock);
                    (self.ledger.kinetic, self.ledger.momentum) = self.physics.motion();
                } else {
                    verlet.stride(self, clock, false);
                    let mean = self.physics.motion();
                    verlet.finish(self, clock.dt);
                    self.constrain(Stage::Finish, clock.time(), clock.dt);
                    let end = self.physics.motion();
                    self.ledger.damp(&DampedStep::new(verlet.damping, clock.dt), mean, end);
                }
            }
            Solver::RungeKutta(method) => {
                self.damping = method.damping;
                let mut memory = std::mem::take(&mut self.stages);
                method.step(self, clock, &mut memory);
                self.stages = memory;
                (self.ledger.kinetic, self.ledger.momentum) = self.physics.motion();
            }
            Solver::ForwardEuler(method) => {
                self.damping = 0.0;
                self.book_what_acts(clock.dt);
                method.step(self, clock);
                (self.ledger.kinetic, self.ledger.momentum) = self.physics.motion();
            }
        }
        if self.watch(solver, clock).is_err() {
            // What was kept of the step before and what came in since are of two instants: this one decides.
            self.catch_up();
            self.watch(solver, clock)?;
        }
        self.book_dissipation(clock.step, clock.time(), false);
        self.end_terms(clock.time());
        if self.physics.adapts_every().is_some_and(|every| clock.step.is_multiple_of(every)) {
            self.adapt(clock.time(), false);
        }
        Ok(true)
    }

    /// Gives velocities the last kick of the last step, which the next would make up for in passing.
    pub fn catch_up(&mut self) {
        if let Some((verlet, dt)) = self.pending_kick.take() {
            let squares = verlet.finish(self, dt);
            self.book_motion(squares);
        }
    }

    /// At the end of a run, or of a solver's part of it: catches up, and watches over the result of its last step.
    pub fn conclude(&mut self, solver: &Solver, clock: &Clock) -> Result<()> {
        self.catch_up();
        self.watch(solver, clock)
    }

    /// Asks all constraints for what a stage wants of them, and books it.
    fn impose(&mut self, stage: Stage, t: f64, dt: f64) {
        let at = Instant { stage, t, dt, damping: self.damping };
        for constraint in &mut self.constraints {
            let booked = constraint.impose(&at, &mut self.physics.unknown());
            self.ledger.book(booked);
        }
    }

    /// Adds the loads to the rate. Gives the work and impulse of each over the last step.
    fn load(&mut self, at: &Moment) -> Vec<Booked> {
        let Problem { physics, terms, .. } = self;
        terms.iter_mut().map(|term| term.add(at, &mut physics.unknown())).collect()
    }

    /// The same at time `t`, `dt` after the last, by velocity Verlet, booked.
    fn load_and_book(&mut self, t: f64, dt: f64) {
        let weights = DampedStep::new(self.damping, dt).weights();
        let at = if dt > 0.0 { Moment { t, dt, weights, use_of: Use::Step(t) } } else { Moment::next(t) };
        self.load(&at).into_iter().for_each(|booked| self.ledger.book(booked));
    }

    /// Takes the loads away that end at `t`, the end of a step: the next begins without them.
    fn end_terms(&mut self, t: f64) {
        if self.terms.iter().any(|term| term.ends_at(t)) {
            self.catch_up();
            let Problem { physics, terms, .. } = self;
            let ending = terms.iter_mut().filter(|term| term.ends_at(t));
            ending.for_each(|term| term.take_away(&mut physics.unknown()));
        }
    }

    /// Books what the loads as they are bring in over `dt`, s: all that a step of forward Euler adds.
    fn book_what_acts(&mut self, dt: f64) {
        let Problem { physics, terms, ledger, .. } = self;
        terms.iter().for_each(|term| ledger.book(term.book(dt, &mut physics.unknown())));
    }

    /// Replaces points where the solution asks for it; all levels at once when `thoroughly`.
    fn adapt(&mut self, t: f64, thoroughly: bool) {
        if self.physics.adapts_every().is_none() {
            return;
        }
        self.catch_up();
        let Some(replaced) = self.physics.adapt(t, thoroughly) else { return };
        for remap in &replaced.remaps {
            self.constraints.iter_mut().for_each(|constraint| constraint.remap(remap));
            self.terms.iter_mut().for_each(|term| term.remap(remap));
        }
        self.measure();
        self.load(&Moment::next(t));
        self.impose(Stage::Replaced, t, 0.0);
        self.ledger.refined += replaced.energy;
        (self.ledger.kinetic, self.ledger.momentum) = self.physics.motion();
    }

    /// The points as they are now.
    pub fn points(&self) -> &dyn Points {
        self.physics.points()
    }

    /// A field by name, in point order; None if there is no such field.
    pub fn field(&mut self, name: &str) -> Option<Field> {
        let n = self.physics.points().n_points();
        self.field_of(name, 0..n)
    }

    /// The same at one point only: a field of one value.
    pub fn field_at(&mut self, name: &str, point: usize) -> Option<Field> {
        self.field_of(name, point..point + 1)
    }

    fn field_of(&mut self, name: &str, points: Range<usize>) -> Option<Field> {
        // Nothing else lacks the kick that is pending.
        if name == "velocity" {
            self.catch_up();
        }
        self.physics.field(name, points)
    }

    /// Shows everything that changes in a run, velocities with the kick that was pending.
    pub fn visit(&mut self, visitor: &mut dyn Visitor) {
        self.catch_up();
        self.physics.visit(visitor);
        self.constraints.iter_mut().for_each(|constraint| constraint.visit(visitor));
        self.terms.iter_mut().for_each(|term| term.visit(visitor));
        self.stages.visit(visitor);
        self.ledger.visit(visitor);
        let [power, time] = &mut self.dissipation;
        visitor.number("dissipation", power);
        visitor.number("dissipation_time", time);
    }

    /// BLAKE3 of values, velocities and bonds: equal exactly when two runs have the same bits.
    pub fn hash(&mut self) -> String {
        self.catch_up();
        let mut hasher = blake3::Hasher::new();
        self.physics.hash(&mut hasher);
        hasher.finalize().to_hex().to_string()
    }

    /// Names of two constraints on the same component of a slot, if there are any.
    pub fn contested(&self) -> Option<[&str; 2]> {
        let held: Vec<_> = self.constraints.iter().map(|constraint| (constraint.on(), constraint.name())).collect();
        held.iter().enumerate().find_map(|(k, ((component, slots), one))| {
            let mut others = held[k + 1..].iter().filter(|((other, _), _)| other == component);
            let shared = others.find(|((_, held), _)| slots.iter().any(|slot| held.binary_search(slot).is_ok()));
            shared.map(|(_, other)| [*one, *other])
        })
    }

    /// Broken pairs, pre-cracks not counted.
    pub fn broken_pairs(&self) -> u64 {
        self.physics.broken().bonds / 2
    }
}

impl System for Problem {
    fn unknown(&mut self) -> Unknown<'_> {
        self.physics.unknown()
    }

    fn constrain(&mut self, stage: Stage, t: f64, dt: f64) {
        self.impose(stage, t, dt);
        if stage == Stage::Drift {
            for constraint in &self.constraints {
                let (component, slots) = constraint.on();
                self.physics.was_set(component, slots);
            }
            self.physics.has_drifted();
        }
    }

    fn evolve(&mut self, t: f64, dt: f64) {
        self.physics.evolve(dt);
        // Of first order the next step is what adds these loads, and books them.
        let first_order = with!(self.physics.unknown(), vectors => vectors.velocity.is_empty());
        if first_order { drop(self.load(&Moment::next(t))) } else { self.load_and_book(t, dt) }
    }

    fn drift_and_evolve(&mut self, drift: &Drift, t: f64, dt: f64) -> Option<f64> {
        if !self.constraints.is_empty() {
            return None;
        }
        let squares = self.physics.drift_and_evolve(drift, dt)?;
        self.load_and_book(t, dt);
        Some(squares)
    }

    fn stable_step(&self) -> f64 {
        self.physics.stable_step()
    }
}

impl Staged for Problem {
    fn stage(&mut self, t: f64, end: f64, dt: f64) {
        self.impose(Stage::Within { end }, t, dt);
        self.physics.evaluate();
        self.load(&Moment { use_of: Use::Step(end), ..Moment::next(t) });
    }

    fn book(&mut self, share: f64, end: f64, dt: f64) {
        let weight = share * dt;
        if self.damping > 0.0 {
            let (kinetic, momentum) = self.physics.motion();
            self.ledger.damped += 2.0 * self.damping * weight * kinetic;
            for d in 0..3 {
                self.ledger.impulse[d] -= self.damping * weight * momentum[d];
            }
        }
        let at = Instant { stage: Stage::Finish, t: end, dt, damping: self.damping };
        let Problem { physics, terms, constraints, ledger, .. } = self;
        for term in terms {
            ledger.book(term.book(weight, &mut physics.unknown()));
        }
        for constraint in constraints {
            ledger.book(constraint.book(weight, &at, &mut physics.unknown()));
        }
    }

    fn arrive(&mut self, t: f64, dt: f64) {
        self.impose(Stage::Arrive, t, dt);
        // A bond that breaks has acted all through the step, and takes what it holds at its end.
        self.physics.evolve(0.0);
        self.load(&Moment::next(t));
    }
}
