//! How time advances, and how bodies come to rest. A solver sees flat vectors and a right-hand side, never a point, a bond or a material.

pub mod dynamic_relaxation;
pub mod newton;
pub mod statics;
pub mod velocity_verlet;

pub use bondwise_linear as linear;
pub use statics::Statics;
pub use velocity_verlet::VelocityVerlet;

use crate::field::Number;

/// How a problem is advanced by a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Solver {
    VelocityVerlet(VelocityVerlet),
    /// A step is a load step, and time only what conditions are given in.
    Statics(Statics),
}

/// The vectors that a solver of second order advances: ρ ü = force − ρ c u̇.
pub struct Unknowns<'a, T> {
    pub displacement: &'a mut [T],
    pub velocity: &'a mut [T],
    /// Force density at the current displacements.
    pub force: &'a [T],
    /// ρ
    pub inertia: f64,
    /// Displacements below this count as zero. Ahead of a wave they fall off without end, and processors are
    /// slow with numbers near the smallest that they know.
    pub negligible: f64,
}

/// Where a run stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    pub step: u64,
    /// Δt, s
    pub dt: f64,
}

impl Clock {
    /// t, s: a product, not a sum, so that it does not drift.
    pub fn time(&self) -> f64 {
        self.step as f64 * self.dt
    }
}

/// When constraints are asked to act within a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// After the drift: set the velocities of the step, and the displacements to which they lead.
    Drift,
    /// After the last kick: set the velocities at the end of the step.
    Finish,
}

/// What a solver advances.
pub trait System {
    /// What the vectors are stored in.
    type Number: Number;
    fn unknowns(&mut self) -> Unknowns<'_, Self::Number>;
    /// Imposes prescribed values; `t` is the time at the start of the step for `Drift`, at its end for `Finish`.
    fn constrain(&mut self, stage: Stage, t: f64, dt: f64);
    /// Breaks what breaks at the current displacements and fills the force density at time `t`, `dt` after the last.
    fn evaluate(&mut self, t: f64, dt: f64);
    /// Largest stable step of an explicit solver, s.
    fn stable_step(&self) -> f64;
}
