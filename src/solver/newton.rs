//! Bodies at rest: Newton's method, conjugate gradients inside, a search along each step.
//!
//! A solver sees flat vectors, the imbalance of their forces and its tangent; never a point, a bond or a material.

use super::linear::{
    Jacobi, LinearError, LinearOperator, NullSpace, Preconditioner, Projected, Solved, Stop, conjugate_gradients,
    vector,
};

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
    /// Of conjugate gradients, in each of these.
    pub max_linear: usize,
}

/// How a body came to rest.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rested {
    /// |r| over what it is measured against, before each iteration and at the end.
    pub history: Vec<f64>,
    /// Iterations of conjugate gradients, all together.
    pub linear: usize,
}

/// Why a body did not come to rest.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unrest {
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
    #[error("{0}")]
    Linear(#[from] LinearError),
}

impl Unrest {
    /// What was left of the loads, as far as it is known.
    pub fn imbalance(&self) -> f64 {
        match self {
            Unrest::Unbalanced(share) => *share,
            Unrest::Iterations { residual, .. } | Unrest::Search(residual) => *residual,
            Unrest::Linear(LinearError::Stopped { residual, .. }) => *residual,
            Unrest::NotFinite | Unrest::Linear(_) => f64::NAN,
        }
    }
}

/// Share of the loads that may be balanced by nothing: rounding of sums over a body leaves less.
pub(super) const UNBALANCED: f64 = 1e-8;
/// Conjugate gradients first ask for this share of the imbalance, then for less as Newton's method closes in.
const FORCING: f64 = 0.1;
const HALVINGS: usize = 12;

impl Newton {
    /// Brings `system` to rest at time `t`. `observe` is told the iterations of conjugate gradients and the relative
    /// imbalance, and stops the solver by answering false.
    ///
    /// The first step carries the prescribed displacements into the body by the tangent; each step is halved until the
    /// imbalance falls. The linear systems are solved as tightly as they need be (Eisenstat & Walker 1996, choice 2).
    ///
    /// # Errors
    /// [`Unrest`]; the displacements are then those of the last step.
    pub fn solve(
        &self,
        system: &mut (impl Equilibrium + ?Sized),
        t: f64,
        mut observe: impl FnMut(usize, f64) -> bool,
    ) -> Result<Rested, Unrest> {
        let n = system.size();
        let (mut r, mut step, mut rested) = (vec![0.0; n], vec![0.0; n], Rested::default());
        let mut way = Some(system.pose(t)).filter(|way| way.iter().any(|w| *w != 0.0));
        let mut scale = system.imbalance(&mut r);
        let space = system.floating();
        let mut diagonal = Jacobi::new(&system.diagonal())?;
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
                return Err(Unrest::Unbalanced(share));
            }
            if !size.is_finite() {
                return Err(Unrest::NotFinite);
            }
            rested.history.push(if size == 0.0 { 0.0 } else { size / scale });
            if size <= self.tolerance * scale && way.is_none() {
                return Ok(rested);
            }
            if rested.history.len() > self.max_iterations {
                return Err(Unrest::Iterations { iterations: self.max_iterations, residual: size / scale });
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
            step.fill(0.0);
            let stop = Stop { tolerance, max_iterations: self.max_linear };
            let done = rested.linear;
            let told = |k, residual: f64| observe(done + k, residual * size / scale);
            rested.linear += solve_linear(system, &mut diagonal, &space, &r, &mut step, &stop, told)?.iterations;
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
                    return Err(Unrest::Search(size / scale));
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

fn solve_linear(
    system: &mut (impl Equilibrium + ?Sized),
    diagonal: &mut Jacobi,
    space: &NullSpace,
    r: &[f64],
    step: &mut [f64],
    stop: &Stop,
    observe: impl FnMut(usize, f64) -> bool,
) -> Result<Solved, LinearError> {
    let mut tangent = Tangent(system);
    if space.basis().is_empty() {
        return conjugate_gradients(&mut tangent, diagonal, r, step, stop, observe);
    }
    let (mut tangent, mut diagonal) = (Projected::new(tangent, space), Projected::new(ByRef(diagonal), space));
    conjugate_gradients(&mut tangent, &mut diagonal, r, step, stop, observe)
}

struct Tangent<'a, S: ?Sized>(&'a mut S);

impl<S: Equilibrium + ?Sized> LinearOperator for Tangent<'_, S> {
    fn size(&self) -> usize {
        self.0.size()
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        self.0.tangent(x, y);
    }
}

struct ByRef<'a, M>(&'a mut M);

impl<M: Preconditioner> Preconditioner for ByRef<'_, M> {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        self.0.apply(r, z);
    }
}
