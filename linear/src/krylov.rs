//! What the Krylov methods share: when to stop, the books, the answers to bad numbers.

use super::{Cause, LinearError, LinearOperator, vector};

/// When a Krylov method stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// Converged when |b − A x| ≤ tolerance |b|.
    pub tolerance: f64,
    pub max_iterations: usize,
}

/// How a system was solved.
#[derive(Debug, Clone, PartialEq)]
pub struct Solved {
    pub iterations: usize,
    /// |b − A x|/|b| at the start and after every iteration, as the recurrences know it.
    pub history: Vec<f64>,
    /// The same at the end, computed anew from x.
    pub residual: f64,
}

/// The books of one solution: relative residuals, iterations, and whether to go on.
pub(super) struct Monitor<'a, F> {
    method: &'static str,
    stop: &'a Stop,
    observe: F,
    b_norm: f64,
    history: Vec<f64>,
}

impl<'a, F: FnMut(usize, f64) -> bool> Monitor<'a, F> {
    /// `None` when b = 0: then x = 0.
    pub fn start(
        method: &'static str,
        size: usize,
        b: &[f64],
        x: &[f64],
        stop: &'a Stop,
        observe: F,
    ) -> Result<Option<Self>, LinearError> {
        assert!(b.len() == size && x.len() == size, "{method}: vectors of {} and {} for {size} rows", b.len(), x.len());
        let monitor = Monitor { method, stop, observe, b_norm: vector::norm(b), history: Vec::new() };
        if !monitor.b_norm.is_finite() {
            return Err(monitor.fail(Cause::NotFinite("the right side, or its norm,")));
        }
        if monitor.b_norm == 0.0 {
            let none = b.iter().all(|b| *b == 0.0);
            return if none { Ok(None) } else { Err(monitor.fail(Cause::Underflow)) };
        }
        Ok(Some(monitor))
    }

    /// Iterations done.
    pub fn iterations(&self) -> usize {
        self.history.len().saturating_sub(1)
    }

    /// r = b − A x, and whether its size is small enough.
    pub fn residual(
        &mut self,
        a: &mut (impl LinearOperator + ?Sized),
        b: &[f64],
        x: &[f64],
        r: &mut [f64],
    ) -> Result<(f64, bool), LinearError> {
        a.apply(x, r);
        vector::scale_and_add(-1.0, b, r);
        let size = vector::norm(r);
        if self.history.is_empty() {
            self.history.push(size / self.b_norm);
        }
        if !size.is_finite() {
            return Err(self.fail(Cause::NotFinite("the residual b − A x")));
        }
        Ok((size, self.small(size)))
    }

    /// Before an iteration: is another one allowed?
    pub fn begin(&self) -> Result<(), LinearError> {
        let max = self.stop.max_iterations;
        if self.iterations() < max { Ok(()) } else { Err(self.fail(Cause::Iterations(max))) }
    }

    /// Books an iteration that left a residual of `size`; true when it is small enough.
    pub fn end(&mut self, size: f64) -> Result<bool, LinearError> {
        self.history.push(size / self.b_norm);
        if !size.is_finite() {
            return Err(self.fail(Cause::NotFinite("the residual")));
        }
        let iteration = self.iterations();
        let go_on = (self.observe)(iteration, size / self.b_norm);
        if self.small(size) {
            return Ok(true);
        }
        if go_on { Ok(false) } else { Err(self.fail(Cause::Interrupted)) }
    }

    /// Is a residual of `size` small enough?
    pub fn small(&self, size: f64) -> bool {
        size <= self.stop.tolerance * self.b_norm
    }

    /// An error unless `value` is finite.
    pub fn finite(&self, what: &'static str, value: f64) -> Result<f64, LinearError> {
        if value.is_finite() { Ok(value) } else { Err(self.fail(Cause::NotFinite(what))) }
    }

    pub fn fail(&self, cause: Cause) -> LinearError {
        let residual = self.history.last().copied().unwrap_or(f64::NAN);
        LinearError::Stopped { method: self.method, iteration: self.iterations(), residual, cause }
    }

    pub fn solved(self, size: f64) -> Solved {
        Solved { iterations: self.iterations(), residual: size / self.b_norm, history: self.history }
    }
}

impl Solved {
    /// x = 0 for b = 0.
    pub(super) fn at_rest(x: &mut [f64]) -> Self {
        x.fill(0.0);
        Solved { iterations: 0, history: vec![0.0], residual: 0.0 }
    }
}
