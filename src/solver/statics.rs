//! How a body comes to rest, load step by load step: by which method, and whether bonds break.

use serde::Serialize;

use super::dynamic_relaxation::DynamicRelaxation;
use super::newton::{Equilibrium, Newton, NotConverged};

/// A static solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Statics {
    pub method: Method,
    /// Forces are those of the tangent at u = 0: small displacements.
    pub linearised: bool,
    /// How bonds break; None where they do not.
    pub breaking: Option<Breaking>,
}

/// How bonds break while a body is brought to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Breaking {
    pub control: Control,
    pub together: Together,
    /// Whether the tangent is factored once for many breaks, where that can be done.
    pub factored: bool,
}

/// What the loads do while bonds break.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// They stay, and rise when no bond is left that breaks.
    Load,
    /// They fall, so that each bond breaks where it just does.
    Equilibrium,
}

/// Which bonds break before the body is brought to rest again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Together {
    /// The one that breaks first, with those that are strained alike.
    One,
    /// Those, too, whose excess over the critical stretch is more than this share of the largest.
    Share(f64),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    Newton(Newton),
    DynamicRelaxation(DynamicRelaxation),
}

/// What a load step took; the same in `report.json`.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct LoadStep {
    pub step: u64,
    /// At rest at this time, s.
    pub time: f64,
    /// Iterations of Newton's method, or of dynamic relaxation, in all equilibria of the load step.
    pub iterations: usize,
    /// Iterations of the linear solver.
    pub linear_iterations: usize,
    /// How often it was taken back and divided.
    pub halvings: usize,
    /// Bonds that broke.
    pub broken: u64,
    /// How often bonds broke, one or several alike.
    pub breaks: usize,
    /// Times that the tangent was factored for the bonds about a crack.
    pub factors: usize,
    /// Before each break, or every so many: time (s), work that the conditions do a second (J/s, of loads and prescribed
    /// displacements that change in proportion to time), bonds broken in the load step so far.
    pub path: Vec<[f64; 3]>,
    /// |r| over loads or reactions at the end.
    pub imbalance: f64,
    /// The same before each iteration on the way to the last equilibrium; of long ways every so many only.
    pub history: Vec<f64>,
}

/// Numbers of a history that are kept.
const KEPT: usize = 100;
/// Of breaks.
const KEPT_BREAKS: usize = 2000;

impl LoadStep {
    /// Takes note of a break.
    pub fn note(&mut self, at: [f64; 3]) {
        self.breaks += 1;
        let every = (self.breaks / KEPT_BREAKS + 1).next_power_of_two();
        if self.path.len() >= KEPT_BREAKS {
            let mut k = 0;
            self.path.retain(|_| {
                k += 1;
                k % 2 == 1
            });
        }
        if (self.breaks - 1).is_multiple_of(every) {
            self.path.push(at);
        }
    }
}

impl Statics {
    /// Brings `system` to rest at time `t`, and adds to `log` what it took. `observe` is told the iterations of the
    /// linear solver, or of dynamic relaxation, since the load step began, and the relative imbalance; it stops the method by
    /// answering false.
    ///
    /// # Errors
    /// [`NotConverged`]; the displacements are then those of the last step.
    pub fn solve(
        &self,
        system: &mut (impl Equilibrium + ?Sized),
        t: f64,
        log: &mut LoadStep,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<(), NotConverged> {
        let linear = matches!(self.method, Method::Newton(_));
        let before = if linear { log.linear_iterations } else { log.iterations };
        let mut seen = 0;
        let mut told = |k, imbalance| {
            seen = k;
            observe(before + k, imbalance)
        };
        let rested = match &self.method {
            Method::Newton(newton) => newton.solve(system, t, &mut told),
            Method::DynamicRelaxation(relaxation) => relaxation.solve(system, t, &mut told),
        };
        match rested {
            Ok(rested) => {
                log.iterations += rested.iterations;
                log.linear_iterations += rested.linear;
                log.imbalance = rested.history.last().copied().unwrap_or(0.0);
                let every = rested.history.len().div_ceil(KEPT).max(1);
                log.history = rested.history.into_iter().step_by(every).collect();
                Ok(())
            }
            Err(unrest) => {
                *(if linear { &mut log.linear_iterations } else { &mut log.iterations }) += seen;
                Err(unrest)
            }
        }
    }
}
