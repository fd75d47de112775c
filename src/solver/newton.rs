//! Bodies at rest: Newton's method, a linear solver inside, a search along each step.
//!
//! A solver sees flat vectors, the imbalance of their forces and its tangent; never a point, a bond or a material.

use super::linear::{Cause, LinearError, NullSpace, Preconditioner, Sparse, vector};
use super::linear_solver::LinearSolver;

/// What a static solver brings to rest.
pub trait Equilibrium {
    /// Unknowns, those that are held or have no point included.
    fn size(&self) -> usize;
    /// u, m.
    fn displacement(&mut self) -> &mut [f64];
    /// Turns loads and prescribed displacements to those of time `t`. Gives the way from the displacements now to the
    /// prescribed ones, zero where none is prescribed, m.
    fn pose(&mut self, t: f64) -> Vec<f64>;
    /// r: the force on each free unknown, zero on the others, N. Gives |loads| or |reactions|, whichever is larger, N:
    /// what r is measured against.
    fn imbalance(&mut self, r: &mut [f64]) -> f64;
    /// y = −∂r/∂u x, N; x may move held unknowns too.
    fn tangent(&mut self, x: &[f64], y: &mut [f64]);
    /// The diagonal of the tangent, N/m; positive, 1 where an unknown is not free.
    fn diagonal(&mut self) -> Vec<f64>;
    /// The inverse of the block of each point on the diagonal of the tangent, at rest; 1 where an unknown is not free.
    ///
    /// # Errors
    /// A block that has no inverse.
    fn block_diagonal(&mut self) -> Result<Box<dyn Preconditioner>, LinearError>;
    /// The tangent as a matrix, N/m: rows and columns of free unknowns, and 1 on the diagonal of the others.
    fn assemble(&mut self) -> Sparse;
    /// The rigid motions that nothing holds.
    fn floating(&self) -> NullSpace;
    /// Whether the tangent is the same at all displacements.
    fn is_linear(&self) -> bool;
}

/// Newton's method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Newton {
    /// At rest when |r| ≤ tolerance × the larger of |loads| and |reactions|.
    pub tolerance: f64,
    /// Of Newton's method.
    pub max_iterations: usize,
    pub linear: LinearSolver,
}

/// How a body came to rest.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Convergence {
    /// |r| over what it is measured against, before each iteration and at the end.
    pub history: Vec<f64>,
    /// Iterations of Newton's method, or of dynamic relaxation.
    pub iterations: usize,
    /// Iterations of the linear solver, all together.
    pub linear: usize,
}

/// Why a body did not come to rest.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotConverged {
    /// The share of |loads| along rigid motions.
    #[error("the body can move as a whole, and nothing balances what the loads add up to: hold it, or balance them")]
    Unbalanced(f64),
    #[error(
        "no equilibrium was found in {iterations} iterations; forces are out of balance by {residual:.3e} of the loads"
    )]
    Iterations { iterations: usize, residual: f64 },
    #[error(
        "no step along Newton's direction brings the body nearer to rest; forces are out of balance by {0:.3e} of the loads"
    )]
    Search(f64),
    #[error("forces are not finite numbers")]
    NotFinite,
    #[error("interrupted")]
    Interrupted,
    #[error("{0}")]
    Linear(LinearError),
}

impl From<LinearError> for NotConverged {
    fn from(error: LinearError) -> Self {
        match error {
            LinearError::Stopped { cause: Cause::Interrupted, .. } => NotConverged::Interrupted,
            other => NotConverged::Linear(other),
        }
    }
}

impl NotConverged {
    /// Whether smaller load steps cannot help. Loads that nothing balances are found before the first step, where
    /// they are compared with rigid motions alone: they are the same at the end of the load step on whatever way it is
    /// reached, and bonds that break on it only free more motions.
    pub fn stays(&self) -> bool {
        matches!(self, NotConverged::Unbalanced(_) | NotConverged::Interrupted)
    }

    /// What was left of the loads, as far as it is known.
    pub fn imbalance(&self) -> f64 {
        match self {
            NotConverged::Unbalanced(share) => *share,
            NotConverged::Iterations { residual, .. } | NotConverged::Search(residual) => *residual,
            NotConverged::Linear(LinearError::Stopped { residual, .. }) => *residual,
            NotConverged::NotFinite | NotConverged::Interrupted | NotConverged::Linear(_) => f64::NAN,
        }
    }
}

/// Share of the loads that may be balanced by nothing: rounding of sums over a body leaves less.
pub const UNBALANCED: f64 = 1e-8;
/// What the linear solver may leave of the imbalance at first; less as Newton's method closes in.
const FORCING: f64 = 0.1;
const HALVINGS: usize = 12;

impl Newton {
    /// Brings `system` to rest at time `t`. `observe` is told the iterations of the linear solver and the relative
    /// imbalance, and stops the method by answering false.
    ///
    /// The first step carries the prescribed displacements into the body by the tangent; each step is halved until the
    /// imbalance falls. The linear systems are solved as tightly as they need be (Eisenstat & Walker 1996, choice 2).
    ///
    /// # Errors
    /// [`NotConverged`]; the displacements are then those of the last step.
    pub fn solve(
        &self,
        system: &mut (impl Equilibrium + ?Sized),
        t: f64,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<Convergence, NotConverged> {
        let n = system.size();
        let (mut r, mut step, mut rested) = (vec![0.0; n], vec![0.0; n], Convergence::default());
        let mut way = Some(system.pose(t)).filter(|way| way.iter().any(|w| *w != 0.0));
        let mut scale = system.imbalance(&mut r);
        let space = system.floating();
        let mut prepared = None;
        let mut last: Option<f64> = None;
        loop {
            if let Some(way) = &way {
                system.tangent(way, &mut step);
                vector::add(-1.0, &step, &mut r);
            }
            let share = space.balance(&mut r);
            let size = vector::norm(&r);
            // Later, loads on a body that has turned have a part that turns it further; at first order there is none.
            if rested.history.is_empty() && share > UNBALANCED {
                return Err(NotConverged::Unbalanced(share));
            }
            if !size.is_finite() {
                return Err(NotConverged::NotFinite);
            }
            rested.history.push(if size == 0.0 { 0.0 } else { size / scale });
            if size <= self.tolerance * scale && way.is_none() {
                return Ok(rested);
            }
            if rested.history.len() > self.max_iterations {
                return Err(NotConverged::Iterations { iterations: self.max_iterations, residual: size / scale });
            }
            // Reactions to prescribed displacements are not known before the first step; r is of their size.
            let known = if way.is_some() { scale.max(size) } else { scale };
            let enough = (0.2 * self.tolerance * known / size).min(FORCING);
            let tolerance = match last {
                _ if system.is_linear() => enough,
                None => FORCING,
                Some(last) => (0.9 * f64::powi(size / last, 2)).clamp(enough, FORCING),
            };
            last = Some(size);
            let done = rested.linear;
            let mut told = |k, residual: f64| observe(done + k, residual * size / known);
            let mut ready = self.linear.prepare(system, &space, prepared.take())?;
            let solved = self.linear.solve(system, &mut ready, &space, &r, &mut step, tolerance, &mut told)?;
            prepared = Some(ready);
            rested.linear += solved.iterations;
            rested.iterations += 1;
            if let Some(way) = way.take() {
                vector::add(1.0, &way, &mut step);
                vector::add(1.0, &step, system.displacement());
                scale = system.imbalance(&mut r);
                continue;
            }
            let mut share = 1.0;
            vector::add(1.0, &step, system.displacement());
            for halving in 0.. {
                scale = system.imbalance(&mut r);
                if space_free_norm(&space, &mut r) < (1.0 - 1e-4 * share) * size {
                    break;
                }
                if halving == HALVINGS {
                    return Err(NotConverged::Search(size / scale));
                }
                share *= 0.5;
                vector::add(-share, &step, system.displacement());
            }
        }
    }
}

/// |r| without its part along rigid motions, which is taken off.
fn space_free_norm(space: &NullSpace, r: &mut [f64]) -> f64 {
    space.balance(r);
    vector::norm(r)
}
