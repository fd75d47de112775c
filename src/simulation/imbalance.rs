//! Why the energy of a run does not balance: what of it can have done that.

use super::Simulation;
use crate::output::report::Report;
use crate::solver::Solver;

/// c Δt above which a velocity changes much within a step.
const STRONG: f64 = 0.5;
/// Share of the stable step above which its error is seen.
const COARSE: f64 = 0.5;
/// Share of the imbalance that is worth to be named.
const SHARE: f64 = 0.1;

impl Simulation {
    /// What may have put the energy of this run out of balance, the likeliest first, each with what to do about it.
    pub fn causes_of_imbalance(&self, report: &Report) -> Vec<String> {
        let mut causes = Vec::new();
        if let Some([one, other]) = self.model.contested() {
            causes.push(format!(
                "`{one}` and `{other}` prescribe the same component of points that are in both: the work of each is \
                 booked, and one of them moves the points; prescribe each component once"
            ));
        }
        let off = report.energy_imbalance.unwrap_or(0.0);
        let scale = report.energy.map_or(0.0, |e| e.initial.max(e.external.abs()));
        if let Some(refinement) = report.refinement.filter(|r| r.energy_turnover > SHARE * off * scale) {
            causes.push(format!(
                "{} times cells were split or merged, which changed the energy by {:.2e} J in all: a wider `buffer`, or \
                 criteria that ask less often, replace fewer",
                refinement.events, refinement.energy_turnover
            ));
        }
        if report.hybrid.is_some() {
            causes.push(
                "where rows of collocation meet bonds, forces are not those of an energy: `rescale = true`, more \
                 `damping` of the scheme, or `scheme = \"standard\"`"
                    .into(),
            );
        }
        let damping = match self.solver {
            Solver::VelocityVerlet(method) => method.damping,
            Solver::RungeKutta(method) => method.damping,
            Solver::ForwardEuler(_) | Solver::Statics(_) => 0.0,
        };
        let product = damping * report.time_step;
        if product > STRONG {
            causes.push(format!(
                "`damping` times step is {product:.2}, so that velocities change much within a step: a smaller \
                 `time_step`, or less damping"
            ));
        }
        let share = report.time_step / report.stable_time_step;
        if !self.solver.is_static() && share > COARSE {
            causes.push(format!(
                "the step is {:.0} % of the stable one: half of it leaves a quarter of the error",
                100.0 * share
            ));
        }
        if report.broken_bonds.is_some_and(|broken| broken > 0) {
            let shorter = if self.solver.is_static() { "shorter load steps" } else { "a smaller step" };
            causes.push(format!("bonds that break within a step have been stretched beyond their limit: {shorter}"));
        }
        if causes.is_empty() {
            causes.push("loads, prescribed motion or initial values that jump: let them start more gently".into());
        }
        causes
    }
}
