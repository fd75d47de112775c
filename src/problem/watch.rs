//! The watch over a run: values that are not finite, and energy that nothing can have put in.

use super::Problem;
use crate::error::{Error, NumericalStop, Result};
use crate::solver::{Clock, Solver};

impl Problem {
    /// Stops on values that are not finite, and on kinetic energy that nothing can have put in.
    pub(super) fn watch(&mut self, solver: &Solver, clock: &Clock) -> Result<()> {
        let (kinetic, [amount, ..]) = (self.ledger.kinetic, self.ledger.momentum);
        if !kinetic.is_finite() || !amount.is_finite() {
            let (field, value, point) = match self.physics.first_bad() {
                Some((field, value, point)) => (field, value, Some(point)),
                None => ("kinetic energy", kinetic, None),
            };
            return Err(self.stop_on(solver, clock, field, value, point));
        }
        // Kinetic energy cannot pass what came in; a factor of ten leaves room for the error of a coarse step.
        let available = self.ledger.initial + self.ledger.external.abs() + self.physics.broken().energy;
        if kinetic > 10.0 * available && clock.step > 2 {
            let worst = self.physics.fastest();
            return Err(self.stop_on(solver, clock, "kinetic energy (J, runaway)", kinetic, worst));
        }
        Ok(())
    }

    fn stop_on(&self, solver: &Solver, clock: &Clock, field: &'static str, value: f64, point: Option<usize>) -> Error {
        let points = self.physics.points();
        let point = point.map(|i| {
            let x = points.position(points.slots()[i] as usize);
            (i, x[..points.dimension()].to_vec())
        });
        let cause = self.cause(solver, clock);
        Error::Numbers(Box::new(NumericalStop { step: clock.step, time: clock.time(), field, value, point, cause }))
    }

    /// Why numbers have gone bad.
    fn cause(&self, solver: &Solver, clock: &Clock) -> String {
        let stable = solver.largest_step(self.stable_step.unwrap_or_else(|| self.physics.stable_step()));
        let loads = self.terms.iter().filter_map(|term| term.first_bad());
        let bad = loads.chain(self.constraints.iter().filter_map(|constraint| constraint.first_bad())).next();
        if let Some((formula, value)) = bad {
            return format!("the formula `{formula}` of a condition gave {value}");
        }
        if clock.dt > stable {
            format!("the time step {:.3e} s is above the stable step {stable:.3e} s", clock.dt)
        } else if let Solver::ForwardEuler(_) = solver {
            "rows of collocation with waves that grow, or sources and prescribed values too large for a number"
                .to_string()
        } else {
            "bonds turned inside out, by loads or prescribed values too large for this step; try a smaller step"
                .to_string()
        }
    }
}
