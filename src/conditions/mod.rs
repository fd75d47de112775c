//! What the world does to a body: initial values, prescribed motion, loads.
//!
//! A condition of the case is compiled against a body into one of two things: a [`Constraint`] sets values, a [`Term`] adds
//! to the rate. Both speak one dialect whatever solver asks, and say what they did: that is booked.

pub mod damping;
pub mod initial;
pub mod load;
pub mod mirror;
pub mod prescribed;
pub mod profile;
pub mod random;
pub mod spread;

pub use load::Load;
pub use mirror::MirrorForce;
pub use prescribed::{Prescribed, Quantity};
pub use profile::FormulaAtPoints;
pub use spread::{Loaded, Spread};

use crate::refinement::Remap;
use crate::unknown::Unknown;
use crate::visit::Visitor;

/// When, within a step of a solver, a constraint is asked to act.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stage {
    /// A solver in time begins: set what holds from time `t` on.
    Start,
    /// The rate of what was set at the start is there.
    Evaluated,
    /// Points have been replaced, and their rate is there.
    Replaced,
    /// After a drift from `t` over `dt`: set the velocities of the step, and the values to which they lead.
    Drift,
    /// After the last kick of a step of `dt` that ends at `t`: set the velocities there, and book the step.
    Finish,
    /// At a stage at time `t` of a step of `dt` that ends at `end`, from which other stages lead.
    Within { end: f64 },
    /// At the end `t` of a step of `dt` that had such stages: set the values there, and book the change of motion.
    Arrive,
}

/// A stage of a step.
#[derive(Debug, Clone, Copy)]
pub struct Instant {
    pub stage: Stage,
    /// s
    pub t: f64,
    pub dt: f64,
    /// c, 1/s, of damping proportional to mass.
    pub damping: f64,
}

impl Instant {
    /// What damping does in the step.
    pub fn damped(&self) -> damping::DampedStep {
        damping::DampedStep::new(self.damping, self.dt)
    }
}

/// For what a term is asked for its part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// s
    pub t: f64,
    /// The step that led here from where it was last asked, s; zero where none did.
    pub dt: f64,
    /// What the method of the step counts of the force at its start and at its end.
    pub weights: [f64; 2],
    pub use_of: Use,
}

/// What a rate is used for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Use {
    /// The step that ends at this time, s.
    Step(f64),
    /// What comes next.
    Next,
}

impl Moment {
    /// What comes after time `t`.
    pub fn next(t: f64) -> Self {
        Moment { t, dt: 0.0, weights: [0.5; 2], use_of: Use::Next }
    }

    /// Whether a condition that ends at `until` acts.
    fn acts(&self, until: f64) -> bool {
        match self.use_of {
            Use::Step(end) => acts_to(until, end),
            Use::Next => acts_from(until, self.t),
        }
    }
}

/// Of `until`: times that are sums of steps reach it to rounding only.
const SLACK: f64 = 1e-9;

/// Whether a condition that ends at `until` acts in all of a step that ends at `end`. A step ends at every `until`, so that it
/// acts in all of a step or not at all.
fn acts_to(until: f64, end: f64) -> bool {
    end <= until * (1.0 + SLACK)
}

/// Whether it acts after `t`.
fn acts_from(until: f64, t: f64) -> bool {
    t < until * (1.0 - SLACK)
}

/// Work (J) and impulse (N·s) of what a condition did; of what diffuses, the impulse is the amount that came in.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Booked {
    pub work: f64,
    pub impulse: f64,
    /// Of the impulse.
    pub component: usize,
}

/// A number for each point of a set, often the same.
#[derive(Debug, Clone, PartialEq)]
pub enum Scale {
    Same(f64),
    ByPoint(Vec<f64>),
}

impl Scale {
    /// Of point `k` of the set.
    pub fn of(&self, k: usize) -> f64 {
        match self {
            Scale::Same(s) => *s,
            Scale::ByPoint(s) => s[k],
        }
    }
}

/// The volumes of the points of a set, by its slots.
pub type Volumes<'a> = &'a dyn Fn(&[u32]) -> Scale;

/// Sets values at the points of a set, in one component, and knows what that takes.
///
/// u_p = g(x, t); later u_p = Σ c_q u_q + g(x, t).
pub trait Constraint: Send {
    /// Of the column of its reaction.
    fn name(&self) -> &str;
    /// Component and slots.
    fn on(&self) -> (usize, &[u32]);
    /// Does what a stage asks for.
    fn impose(&mut self, at: &Instant, on: &mut Unknown<'_>) -> Booked;
    /// Takes off what all other forces do over `weight` (s) of what acts now, in a step that ends at `at.t`.
    fn book(&mut self, weight: f64, at: &Instant, on: &mut Unknown<'_>) -> Booked;

    /// Whether it holds in a load step that ends at `t`.
    fn holds(&self, t: f64) -> bool;
    /// Of a body at rest: how far its unknowns still have to go over a load step, from `u`; `n` slots.
    fn way(&mut self, over: [f64; 2], u: &[f64], way: &mut [f64], n: usize);
    /// Takes note of the force that it takes, N.
    fn react(&mut self, reaction: f64);
    /// Force that it exerts on the body, mean over the last step, N.
    fn reaction(&self) -> f64;

    /// Takes note of the volumes of its points.
    fn measure(&mut self, volumes: Volumes<'_>);
    /// Points have been replaced.
    fn remap(&mut self, remap: &Remap);
    /// A formula that gave something that is not finite, and what.
    fn first_bad(&self) -> Option<(String, f64)>;
    /// Shows everything that changes in a run.
    fn visit(&mut self, visitor: &mut dyn Visitor);
}

/// Adds to the rate: a load, a source.
pub trait Term: Send {
    /// Adds its part. Gives work and impulse of the step that led there: the impulse by the weights of its method, as velocity
    /// Verlet does to momentum, the work by the trapezoidal rule, which is what it does to energy to second order.
    fn add(&mut self, at: &Moment, to: &mut Unknown<'_>) -> Booked;
    /// Whether it ends at `t`.
    fn ends_at(&self, _t: f64) -> bool {
        false
    }
    /// Takes what it added last away again.
    fn take_away(&mut self, _from: &mut Unknown<'_>) {}
    /// Work and impulse of what was last added, over `weight` (s) of the motion as it is.
    fn book(&self, weight: f64, of: &mut Unknown<'_>) -> Booked;
    /// What it added before does not lead to what it adds next.
    fn restart(&mut self);
    /// Adds its force density at time `t` to those of a body at rest; `n` slots.
    fn force(&mut self, t: f64, load: &mut [f64], n: usize);
    /// A body has come to rest with these internal forces on its points, N; `n` slots.
    fn settle(&mut self, _internal: &[f64], _n: usize) {}
    /// The force by which something holds the body, N, and the name of its column; None of what is given.
    fn reaction(&self) -> Option<(&str, f64)> {
        None
    }

    /// Takes note of the volumes of its points.
    fn measure(&mut self, volumes: Volumes<'_>);
    /// Points have been replaced.
    fn remap(&mut self, remap: &Remap);
    /// A formula that gave something that is not finite, and what.
    fn first_bad(&self) -> Option<(String, f64)>;
    /// Shows everything that changes in a run.
    fn visit(&mut self, visitor: &mut dyn Visitor);
}
