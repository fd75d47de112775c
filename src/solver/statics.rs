//! How a body comes to rest, load step by load step: by which method, and whether bonds break.

use super::dynamic_relaxation::DynamicRelaxation;
use super::newton::{Equilibrium, Newton, Rested, Unrest};

/// A static solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Statics {
    pub method: Method,
    /// Forces are those of the tangent at u = 0: small displacements.
    pub linearised: bool,
    /// Overstrained bonds break, the worst first, and the body is brought to rest again until none does.
    pub breaking: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    Newton(Newton),
    DynamicRelaxation(DynamicRelaxation),
}

impl Statics {
    /// Brings `system` to rest at time `t`.
    pub fn solve(&self, system: &mut (impl Equilibrium + ?Sized), t: f64) -> Result<Rested, Unrest> {
        match &self.method {
            Method::Newton(newton) => newton.solve(system, t, |_, _| true),
            Method::DynamicRelaxation(relaxation) => relaxation.solve(system, t, |_, _| true),
        }
    }
}
