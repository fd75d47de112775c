//! A problem together with what its writers ask for again and again.

use std::sync::{Arc, OnceLock};

use super::Stepper;
use crate::error::Result;
use crate::field::Field;
use crate::output::source::{BodySummary, Points, Source};
use crate::physics::elasticity::Work;
use crate::physics::{Adapted, Balance, Column, ForceAndMoment, Resultant, StretchedBond};
use crate::problem::Problem;
use crate::solver::statics::LoadStep;
use crate::solver::{Clock, Solver};
use crate::visit::Visitor;

/// A problem, and facts and points of it that are shared with writers.
pub struct Model {
    pub problem: Problem,
    facts: BodySummary,
    /// Made when a writer first asks, and again when points have been replaced.
    points: OnceLock<Arc<Points>>,
    generation: u64,
}

impl Model {
    /// `facts` as far as the case knows them; counts and sizes are filled in from the problem.
    pub fn new(problem: Problem, facts: BodySummary) -> Self {
        let points = problem.points();
        let (dimension, horizon, spacing) = (points.dimension(), points.horizon(), points.spacing());
        let volume = points.slots().iter().map(|&slot| points.volume(slot as usize)).sum();
        let facts = BodySummary { dimension, horizon, spacing, volume, ..facts };
        let mut model = Model { problem, facts, points: OnceLock::new(), generation: 0 };
        model.count();
        model
    }

    /// Takes note of the points as they are now.
    fn count(&mut self) {
        let physics = &self.problem.physics;
        self.facts.points = physics.points().n_points();
        [self.facts.bonds, self.facts.cut_bonds] = physics.n_bonds();
        self.facts.memory = physics.memory() as u64;
        self.generation = physics.generation();
        self.points = OnceLock::new();
    }

    fn follow_points(&mut self) {
        if self.generation != self.problem.physics.generation() {
            self.count();
        }
    }
}

impl Source for Model {
    fn facts(&self) -> &BodySummary {
        &self.facts
    }
    fn points(&self) -> &Arc<Points> {
        self.points.get_or_init(|| {
            let points = self.problem.points();
            let slots = points.slots();
            let positions = slots.iter().map(|&slot| points.position(slot as usize)).collect();
            let size = |&slot: &u32| points.volume(slot as usize).powf(1.0 / points.dimension() as f64);
            let sizes = if points.same_volume().is_some() { Vec::new() } else { slots.iter().map(size).collect() };
            Arc::new(Points { positions, sizes, facts: self.facts.clone() })
        })
    }
    fn field(&mut self, name: &str) -> Option<Field> {
        self.problem.field(name)
    }
    fn field_at(&mut self, name: &str, point: usize) -> Option<Field> {
        self.problem.field_at(name, point)
    }
    fn balance(&mut self) -> Balance {
        self.problem.balance()
    }
    fn defect(&mut self, balance: &Balance) -> [f64; 2] {
        self.problem.physics.defect(balance)
    }
    fn columns(&mut self, balance: &Balance) -> Vec<Column> {
        self.problem.physics.columns(balance)
    }
    fn broken_pairs(&self) -> u64 {
        self.problem.broken_pairs()
    }
    fn reactions(&self) -> Vec<(String, f64)> {
        let held = self.problem.constraints.iter().map(|c| (c.name(), c.reaction()));
        held.chain(self.problem.terms.iter().filter_map(|t| t.reaction()))
            .map(|(name, f)| (name.to_string(), f))
            .collect()
    }
    fn adapted(&self) -> Option<Adapted> {
        self.problem.physics.adapted()
    }
    fn hybrid(&self) -> Option<Work> {
        self.problem.physics.hybrid()
    }
    fn resultant(&mut self, of: &Resultant) -> Option<ForceAndMoment> {
        self.problem.physics.resultant(of)
    }
    fn most_stretched(&mut self) -> Option<StretchedBond> {
        self.problem.physics.most_stretched()
    }
    fn hash(&mut self) -> String {
        self.problem.hash()
    }
    fn family_sizes(&self) -> Vec<u32> {
        self.problem.points().bonds_that_hold(self.problem.physics.states())
    }
    fn bond_words(&self) -> &[u16] {
        self.problem.physics.states().words()
    }
    fn bond_ends(&self, bit: usize) -> [[f64; 3]; 2] {
        self.problem.points().ends(bit)
    }
}

impl Stepper for Model {
    fn start(&mut self) {
        self.problem.start();
        self.follow_points();
    }
    fn step_observed(
        &mut self,
        solver: &Solver,
        clock: &mut Clock,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<bool> {
        let done = self.problem.step(solver, clock, observe);
        self.follow_points();
        done
    }
    fn hand_over(&mut self, solver: &Solver, t: f64) {
        self.problem.hand_over(solver, t);
    }
    fn conclude(&mut self, solver: &Solver, clock: &Clock) -> Result<()> {
        self.problem.conclude(solver, clock)
    }
    fn prove_step(&mut self) -> Option<f64> {
        let proven = self.problem.prove_step();
        self.facts.stable_step = self.facts.stable_step.max(proven.unwrap_or(0.0));
        proven
    }
    fn contested(&self) -> Option<[String; 2]> {
        self.problem.contested().map(|pair| pair.map(String::from))
    }
    fn seconds_per_rate(&mut self) -> Option<f64> {
        self.problem.seconds_per_rate()
    }
    fn visit(&mut self, visitor: &mut dyn Visitor) {
        self.problem.visit(visitor);
    }
    fn load_steps(&self) -> &[LoadStep] {
        &self.problem.load_steps
    }
}
