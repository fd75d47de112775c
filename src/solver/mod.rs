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

use crate::conditions::Stage;
use crate::unknown::Unknown;

/// How a problem is advanced by a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Solver {
    VelocityVerlet(VelocityVerlet),
    RungeKutta(RungeKutta),
    /// Of equations of first order.
    ForwardEuler(ForwardEuler),
    /// A step is a load step, and time only what conditions are given in.
    Statics(Statics),
}

impl Solver {
    /// Whether it brings the body to rest instead of moving it.
    pub fn is_static(&self) -> bool {
        matches!(self, Solver::Statics(_))
    }

    /// Its largest stable step, s, where that of [`System::stable_step`] is `stable`.
    pub fn largest_step(&self, stable: f64) -> f64 {
        match self {
            Solver::RungeKutta(method) => method.largest_step(stable),
            Solver::VelocityVerlet(_) | Solver::ForwardEuler(_) | Solver::Statics(_) => stable,
        }
    }
}

/// Where a run stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    pub step: u64,
    /// Δt, s
    pub dt: f64,
    /// The step from which on steps have this length, and its time (s).
    since: (u64, f64),
    /// The last step of this length, and the time (s) at which it ends, to the last bit.
    until: (u64, f64),
}

impl Clock {
    /// At step 0 and t = 0.
    pub fn new(dt: f64) -> Self {
        Clock::at(0, dt)
    }

    /// After so many steps of the same length.
    pub fn at(step: u64, dt: f64) -> Self {
        Clock { step, dt, since: (0, 0.0), until: (u64::MAX, f64::INFINITY) }
    }

    /// t, s: a product, not a sum, so that it does not drift.
    pub fn time(&self) -> f64 {
        if self.step == self.until.0 {
            return self.until.1;
        }
        let (step, time) = self.since;
        time + (self.step - step) as f64 * self.dt
    }

    /// From here on, steps of `dt` (s).
    pub fn change_step(&mut self, dt: f64) {
        *self = Clock { since: (self.step, self.time()), ..Clock::at(self.step, dt) };
    }

    /// When steps of this length end, s.
    pub fn end(&self) -> f64 {
        self.until.1
    }

    /// Steps of this length end with step number `step`, at `time` (s).
    pub fn run_to(&mut self, step: u64, time: f64) {
        self.until = (step, time);
    }

    /// The step that was begun ended early, at `time` (s).
    pub fn end_step_at(&mut self, time: f64) {
        *self = Clock { since: (self.step, time), ..Clock::at(self.step, self.dt) };
    }
}

/// What a solver advances.
pub trait System {
    fn unknown(&mut self) -> Unknown<'_>;
    /// Imposes prescribed values; `t` is the time at the start of the step for [`Stage::Drift`], at its end for
    /// [`Stage::Finish`].
    fn constrain(&mut self, stage: Stage, t: f64, dt: f64);
    /// Breaks what breaks at the values as they are and fills the rate at time `t`, `dt` after the last.
    fn evolve(&mut self, t: f64, dt: f64);
    /// Largest stable step, s: of velocity Verlet for equations of second order, of forward Euler for those of first.
    fn stable_step(&self) -> f64;
    /// Drifts, and evolves at time `t`, `dt` later, what has just drifted and is still at hand, and gives what the drift
    /// gives; None, with nothing done, where the system cannot, or imposes values in between.
    fn drift_and_evolve(&mut self, _drift: &Drift, _t: f64, _dt: f64) -> Option<f64> {
        None
    }
}

/// What a solver with several stages in a step advances.
pub trait Staged: System {
    /// Imposes the prescribed values of time `t`, in a step of `dt` that ends at `end`, and fills the rate there.
    /// Breaks nothing.
    fn stage(&mut self, t: f64, end: f64, dt: f64);
    /// Books what acts now for the given share of a step that ends at `end` and takes `dt`: work and impulse are
    /// advanced by the method of the step.
    fn book(&mut self, share: f64, end: f64, dt: f64);
    /// At the end of a step of `dt`: imposes the prescribed values of time `t`, breaks what breaks there, and fills the
    /// rate.
    fn arrive(&mut self, t: f64, dt: f64);
}
