//! How time advances, and how bodies come to rest. A solver sees flat vectors and a right-hand side, never a point, a bond or a material.

pub mod dynamic_relaxation;
pub mod forward_euler;
pub mod linear_solver;
pub mod newton;
pub mod runge_kutta;
pub mod statics;
pub mod velocity_verlet;

pub use bondwise_linear as linear;
pub use forward_euler::ForwardEuler;
pub use runge_kutta::RungeKutta;
pub use statics::Statics;
pub use velocity_verlet::{Drift, VelocityVerlet};

use crate::field::Number;

/// How a problem is advanced by a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Solver {
    VelocityVerlet(VelocityVerlet),
    RungeKutta(RungeKutta),
    /// A step is a load step, and time only what conditions are given in.
    Statics(Statics),
}

impl Solver {
    /// Whether it brings the body to rest instead of moving it.
    pub fn is_static(&self) -> bool {
        matches!(self, Solver::Statics(_))
    }

    /// Its largest stable step over that of velocity Verlet, for which [`System::stable_step`] is estimated.
    pub fn stability(&self) -> f64 {
        match self {
            Solver::RungeKutta(_) => RungeKutta::STABILITY,
            Solver::VelocityVerlet(_) | Solver::Statics(_) => 1.0,
        }
    }
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
    /// τ (s) and where u + τ v is wanted after a drift, if it is.
    pub ahead: Option<(f64, &'a mut [T])>,
}

/// Where a run stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    pub step: u64,
    /// Δt, s
    pub dt: f64,
    /// The step from which on steps have this length, and its time (s).
    since: (u64, f64),
}

impl Clock {
    /// At step 0 and t = 0.
    pub fn new(dt: f64) -> Self {
        Clock::at(0, dt)
    }

    /// After so many steps of the same length.
    pub fn at(step: u64, dt: f64) -> Self {
        Clock { step, dt, since: (0, 0.0) }
    }

    /// t, s: a product, not a sum, so that it does not drift.
    pub fn time(&self) -> f64 {
        let (step, time) = self.since;
        time + (self.step - step) as f64 * self.dt
    }

    /// From here on, steps of `dt` (s).
    pub fn turn(&mut self, dt: f64) {
        *self = Clock { dt, since: (self.step, self.time()), ..*self };
    }

    /// The step that was begun ended early, at `time` (s).
    pub fn halt(&mut self, time: f64) {
        self.since = (self.step, time);
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
    /// Largest stable step of velocity Verlet, s.
    fn stable_step(&self) -> f64;
    /// Drifts, and evaluates at time `t`, `dt` later, what has just drifted and is still at hand, and gives what the drift
    /// gives; None, with nothing done, where the system cannot, or imposes values in between.
    fn evaluate_behind(&mut self, _drift: &Drift<Self::Number>, _t: f64, _dt: f64) -> Option<f64> {
        None
    }
}

/// What a solver with several stages in a step advances.
pub trait Staged: System {
    /// Imposes the prescribed values of time `t`, in a step of `dt` that ends at `end`, and fills the force density there.
    /// Breaks nothing.
    fn stage(&mut self, t: f64, end: f64, dt: f64);
    /// Books what acts now for the given share of a step that ends at `end` and takes `dt`: work and impulse are
    /// advanced by the method of the step.
    fn book(&mut self, share: f64, end: f64, dt: f64);
    /// At the end of a step of `dt`: imposes the prescribed values of time `t`, breaks what breaks there, and fills the
    /// force density.
    fn arrive(&mut self, t: f64, dt: f64);
}
