//! The solvers of a case and their steps: how long, how many, and where they end.

use std::collections::VecDeque;

use super::super::model;
use super::{Builder, SAFETY};
use crate::error::Result;
use crate::simulation::SolverStage;
use crate::solver::dynamic_relaxation::DynamicRelaxation;
use crate::solver::linear_solver::{self, LinearSolver, Preconditioning};
use crate::solver::newton::Newton;
use crate::solver::statics::{Breaking, Control, Method, Together};
use crate::solver::{ForwardEuler, RungeKutta, Solver, Statics, VelocityVerlet};

/// Largest number of steps: more would take this machine longer than anybody waits.
const MANY_STEPS: f64 = 1e15;
/// Of a number of steps: what rounding of a product of steps makes of a whole number.
const WHOLE: f64 = 1e-9;

/// The stable step of a body, s.
pub(super) struct StableStep<'a> {
    /// An estimate that is never too large.
    pub estimate: f64,
    /// Gives the largest step that is proven stable, which takes a while; None where none is.
    pub prove: &'a mut dyn FnMut() -> Option<f64>,
}

/// What a case says of the steps of a solver in time.
struct Chosen {
    safety: Option<f64>,
    /// s
    time_step: Option<f64>,
}

/// Steps of one length.
type Steps = (f64, f64);

impl<const D: usize> Builder<'_, D> {
    /// The solvers of the case, one after another, each in parts of steps of one length.
    pub(super) fn stages(&self, mut stable: StableStep<'_>) -> Result<VecDeque<SolverStage>> {
        let (mut stages, mut first, mut time) = (VecDeque::new(), 0, 0.0);
        for (path, model) in self.case.value.solver.stages() {
            let newton = |s: &model::Statics| {
                let linear = linear_solver(s.linear, s.preconditioner, s.max_linear);
                Method::Newton(Newton { tolerance: s.tolerance, max_iterations: s.max_iterations, linear })
            };
            let statics = |method, linearised| Solver::Statics(Statics { method, linearised, breaking: None });
            let moving = |s: &model::Explicit| Chosen { safety: s.safety, time_step: s.time_step };
            let (solver, chosen) = match model {
                model::Solver::VelocityVerlet(s) => {
                    (Solver::VelocityVerlet(VelocityVerlet { damping: s.damping }), Ok(moving(s)))
                }
                model::Solver::RungeKutta(s) => (Solver::RungeKutta(RungeKutta { damping: s.damping }), Ok(moving(s))),
                model::Solver::ForwardEuler(s) => {
                    (Solver::ForwardEuler(ForwardEuler), Ok(Chosen { safety: s.safety, time_step: s.time_step }))
                }
                model::Solver::Static(s) => (statics(newton(s), true), Err(s.steps)),
                model::Solver::Newton(s) => (statics(newton(s), false), Err(s.steps)),
                model::Solver::QuasiStatic(s) => (Solver::Statics(quasi_static(s)), Err(s.steps)),
                model::Solver::DynamicRelaxation(s) => {
                    let method = DynamicRelaxation { tolerance: s.tolerance, max_iterations: s.max_iterations };
                    (statics(Method::DynamicRelaxation(method), false), Err(s.steps))
                }
            };
            let end = model.end_time();
            let parts = match chosen {
                Err(steps) => vec![((end - time) / steps as f64, steps as f64, end)],
                Ok(chosen) => self.parts_of_time(&solver, &chosen, &path, [time, end], &mut stable)?,
            };
            for (k, (dt, n_steps, ends)) in parts.into_iter().enumerate() {
                let n_steps = n_steps as u64;
                stages.push_back(SolverStage { solver, dt, n_steps, first, ends, continues: k > 0 });
                first += n_steps;
            }
            time = end;
        }
        Ok(stages)
    }

    /// Δt, number of steps and end of each part of a solver's time: a step ends at every `until` and at `end_time`.
    fn parts_of_time(
        &self,
        solver: &Solver,
        chosen: &Chosen,
        path: &str,
        [begin, end]: [f64; 2],
        stable: &mut StableStep<'_>,
    ) -> Result<Vec<(f64, f64, f64)>> {
        let longest = match chosen.time_step {
            Some(dt) => self.bearable(solver, dt, path, stable)?,
            None => solver.largest_step(stable.estimate) * chosen.safety.unwrap_or(SAFETY),
        };
        let mut ends: Vec<f64> = self.case.value.conditions.iter().filter_map(|condition| condition.until).collect();
        ends.retain(|&t| t > begin * (1.0 + WHOLE) && t < end * (1.0 - WHOLE));
        ends.push(end);
        ends.sort_by(f64::total_cmp);
        ends.dedup_by(|b, a| *b <= *a * (1.0 + WHOLE));
        let (mut parts, mut from, mut n) = (Vec::new(), begin, 0.0);
        for to in ends {
            let steps = if chosen.time_step.is_some() { whole_steps } else { equal_steps };
            let mut t = from;
            let list = steps(to - from, longest);
            let last = list.len() - 1;
            for (k, (dt, count)) in list.into_iter().enumerate() {
                t += dt * count;
                n += count;
                parts.push((dt, count, if k == last { to } else { t }));
            }
            from = to;
        }
        if n > MANY_STEPS {
            let message =
                format!("this would take {n:.3e} steps of {longest:.3e} s; at most {MANY_STEPS:.0e} are taken");
            return Err(self.refuse(&format!("{path}.end_time"), message, "is the unit right?"));
        }
        Ok(parts)
    }

    /// The step that a case asks for, refused where the solver is not stable with it.
    fn bearable(&self, solver: &Solver, dt: f64, path: &str, stable: &mut StableStep<'_>) -> Result<f64> {
        if dt <= solver.largest_step(stable.estimate) {
            return Ok(dt);
        }
        let proven = (stable.prove)();
        let body = proven.unwrap_or(0.0).max(stable.estimate);
        let largest = solver.largest_step(body);
        if dt <= largest {
            return Ok(dt);
        }
        if let Solver::RungeKutta(_) = solver
            && let Some(most) = RungeKutta::strongest_damping(dt, body)
        {
            let message = format!(
                "damping is too strong for the time step {dt:.4e} s, which bears up to {most:.4e} 1/s: runge_kutta is stable \
                 to a damping times step of 2.785 at most"
            );
            let help = format!(
                "give a `time_step` of {largest:.4e} s or less, or `safety = 0.8` instead of it, or take \
                 `velocity_verlet`, for which no damping is too strong"
            );
            return Err(self.refuse(&format!("{path}.damping"), message, &help));
        }
        let estimate = solver.largest_step(stable.estimate);
        let message = match proven {
            Some(_) => format!(
                "the time step is above the stable step {largest:.4e} s of this discretisation, the largest that is proven \
                 stable (estimated without proof: {estimate:.4e} s)"
            ),
            None => format!("the time step is above the stable step {estimate:.4e} s of this discretisation"),
        };
        let help = "give a smaller one, or `safety = 0.8` instead of `time_step`";
        Err(self.refuse(&format!("{path}.time_step"), message, help))
    }
}

/// As few steps of the same length as reach over `length` without being longer than `longest`.
fn equal_steps(length: f64, longest: f64) -> Vec<Steps> {
    let n = (length / longest).ceil().max(1.0);
    vec![(length / n, n)]
}

/// Steps of `dt` over `length`; where they do not fit, the last is shorter, or the last two where it would be shorter than
/// half a step.
fn whole_steps(length: f64, dt: f64) -> Vec<Steps> {
    let (exact, nearest) = (length / dt, (length / dt).round());
    if nearest >= 1.0 && (exact - nearest).abs() <= WHOLE * nearest {
        return vec![(dt, nearest)];
    }
    let n = exact.floor();
    let rest = length - n * dt;
    let list = match n {
        0.0 => [(length, 1.0), (0.0, 0.0)],
        _ if rest < 0.5 * dt => [(dt, n - 1.0), (0.5 * (dt + rest), 2.0)],
        _ => [(dt, n), (rest, 1.0)],
    };
    list.into_iter().filter(|(_, n)| *n > 0.0).collect()
}

fn quasi_static(s: &model::QuasiStatic) -> Statics {
    let linear = linear_solver(s.linear.unwrap_or_default(), s.preconditioner, s.max_linear);
    let newton = Newton { tolerance: s.tolerance, max_iterations: s.max_iterations, linear };
    let breaking = Breaking {
        control: match s.control {
            model::Control::Load => Control::Load,
            model::Control::Equilibrium => Control::Equilibrium,
        },
        together: match s.together {
            model::Together::One => Together::One,
            model::Together::Share(share) => Together::Share(share),
        },
        factored: match s.linear {
            None => s.preconditioner.is_none(),
            Some(linear) => linear == model::LinearSolver::Direct,
        },
    };
    Statics { method: Method::Newton(newton), linearised: false, breaking: Some(breaking) }
}

fn linear_solver(
    linear: model::LinearSolver,
    preconditioner: Option<model::Preconditioner>,
    max_iterations: usize,
) -> LinearSolver {
    let method = match linear {
        model::LinearSolver::ConjugateGradients => linear_solver::Method::ConjugateGradients,
        model::LinearSolver::Direct => linear_solver::Method::Direct,
        model::LinearSolver::Bicgstab => linear_solver::Method::Bicgstab,
        model::LinearSolver::Gmres => linear_solver::Method::Gmres,
    };
    let preconditioner = match preconditioner.unwrap_or_default() {
        model::Preconditioner::Jacobi => Preconditioning::Jacobi,
        model::Preconditioner::BlockJacobi => Preconditioning::BlockJacobi,
        model::Preconditioner::IncompleteFactors => Preconditioning::Incomplete,
        model::Preconditioner::None => Preconditioning::None,
    };
    LinearSolver { method, preconditioner, max_iterations }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the length: steps reach its end, none is longer than asked, and none shorter than half of that, if there are
    /// two.
    #[test]
    fn steps_end_where_they_are_to_end() {
        for length in [1e-7, 1.0, 3.0, 100.0, 99.99999, 100.00001, 1e6 + 0.3, 2.0000001, 0.3] {
            for dt in [1.0, 0.1, 3.0, 1e-3, 0.7] {
                for list in [whole_steps(length, dt), equal_steps(length, dt)] {
                    let reached: f64 = list.iter().map(|(dt, n)| dt * n).sum();
                    // What counts as a whole number of steps.
                    assert!((reached / length - 1.0).abs() < 2.0 * WHOLE, "{length} {dt}: {list:?}");
                    let several = list.iter().map(|(_, n)| n).sum::<f64>() > 1.0;
                    for (step, _) in &list {
                        assert!(*step <= dt * (1.0 + WHOLE), "{length} {dt}: {list:?}");
                        assert!(!several || *step >= dt * (0.5 - WHOLE), "{length} {dt}: {list:?}");
                    }
                }
            }
        }
        // 100 times 1e-6 is not 1e-4 to the last bit, nor is it another number of steps.
        assert_eq!(whole_steps(1e-4, 1e-6), [(1e-6, 100.0)]);
    }
}
