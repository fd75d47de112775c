//! The linear systems of Newton's method, A Δu = r: by which method, with which preconditioner, with a matrix or without.

use super::linear::{
    Bordered, Direct, IncompleteCholesky, IncompleteLu, Jacobi, LinearError, LinearOperator, NoPreconditioner,
    NullSpace, Preconditioner, Projected, Solved, Sparse, Stop, bicgstab, conjugate_gradients, gmres,
};
use super::newton::Equilibrium;

/// How linear systems are solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearSolver {
    pub method: Method,
    pub preconditioner: Preconditioning,
    /// In each system.
    pub max_iterations: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// For stable bodies, whose tangent is positive.
    ConjugateGradients,
    Bicgstab,
    /// Anew after [`RESTART`] iterations.
    Gmres,
    /// Sparse factors of the assembled tangent: those of Cholesky, or of LU where the tangent is not positive. They are
    /// applied as the preconditioner of GMRES, which is done after one iteration, or after one more when rounding or
    /// the turning of a floating body leave something.
    Direct,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preconditioning {
    None,
    /// The diagonal of the tangent at rest.
    Jacobi,
    /// The block of each point of the tangent at rest.
    BlockJacobi,
    /// Incomplete factors of the assembled tangent, on its pattern: of Cholesky for conjugate gradients, of LU otherwise.
    Incomplete,
}

/// Iterations of GMRES after which it starts anew; it keeps as many vectors and three.
pub const RESTART: usize = 60;

/// What a method needs of the tangent beside its products.
pub struct Prepared {
    /// The assembled tangent, where factors are made of it; its products then spare the bond sums.
    matrix: Option<Sparse>,
    preconditioner: Box<dyn Preconditioner>,
}

impl Prepared {
    /// From now on products are those of the tangent as it is, and only the preconditioner is of the one that it was made for.
    pub fn forget_matrix(&mut self) {
        self.matrix = None;
    }
}

impl LinearSolver {
    /// Whether the tangent is assembled, so that it has to be prepared again when it changes.
    pub fn assembles(&self) -> bool {
        self.method == Method::Direct || self.preconditioner == Preconditioning::Incomplete
    }

    /// Prepares for the tangent of `system` now; `before` is what was prepared for another one.
    ///
    /// # Errors
    /// [`LinearError`]: something that cannot be divided by, or a tangent without an inverse.
    pub fn prepare(
        &self,
        system: &mut (impl Equilibrium + ?Sized),
        space: &NullSpace,
        before: Option<Prepared>,
    ) -> Result<Prepared, LinearError> {
        if let Some(before) = before
            && (system.is_linear() || !self.assembles())
        {
            return Ok(before);
        }
        let matrix = self.assembles().then(|| system.assemble());
        let preconditioner: Box<dyn Preconditioner> = match (&matrix, self.method, self.preconditioner) {
            (Some(a), Method::Direct, _) if space.basis().is_empty() => {
                Box::new(Factors(Direct::cholesky(a).or_else(|_| Direct::lu(a))?))
            }
            (Some(a), Method::Direct, _) => Box::new(FloatingFactors(
                Bordered::cholesky(a, space.clone()).or_else(|_| Bordered::lu(a, space.clone()))?,
            )),
            (Some(a), Method::ConjugateGradients, _) => Box::new(IncompleteCholesky::new(a)?),
            (Some(a), ..) => Box::new(IncompleteLu::new(a)?),
            (None, _, Preconditioning::BlockJacobi) => system.block_diagonal()?,
            (None, _, Preconditioning::Jacobi) => Box::new(Jacobi::new(&system.diagonal())?),
            (None, ..) => Box::new(NoPreconditioner),
        };
        Ok(Prepared { matrix, preconditioner })
    }

    /// Solves A x = r to |r − A x| ≤ `tolerance` |r|, from x = 0 and without rigid motions of `space`. `observe` as in
    /// [`conjugate_gradients()`].
    ///
    /// # Errors
    /// As of the method.
    #[allow(clippy::too_many_arguments)] // the system, what was prepared for it, and how well it is to be solved
    pub fn solve(
        &self,
        system: &mut (impl Equilibrium + ?Sized),
        prepared: &mut Prepared,
        space: &NullSpace,
        r: &[f64],
        x: &mut [f64],
        tolerance: f64,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<Solved, LinearError> {
        x.fill(0.0);
        let Prepared { matrix, preconditioner } = prepared;
        let mut tangent = Tangent(system);
        let (product, approximate): (&mut dyn LinearOperator, &mut dyn Preconditioner) = match matrix {
            Some(matrix) => (matrix, preconditioner.as_mut()),
            None => (&mut tangent, preconditioner.as_mut()),
        };
        let stop = Stop { tolerance, max_iterations: self.max_iterations };
        if space.basis().is_empty() {
            return self.run(product, approximate, r, x, &stop, observe);
        }
        let (mut product, mut approximate) = (Projected::new(product, space), Projected::new(approximate, space));
        self.run(&mut product, &mut approximate, r, x, &stop, observe)
    }

    fn run(
        &self,
        a: &mut dyn LinearOperator,
        m: &mut dyn Preconditioner,
        r: &[f64],
        x: &mut [f64],
        stop: &Stop,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<Solved, LinearError> {
        match self.method {
            Method::ConjugateGradients => conjugate_gradients(a, m, r, x, stop, observe),
            Method::Bicgstab => bicgstab(a, m, r, x, stop, observe),
            Method::Gmres | Method::Direct => gmres(a, m, r, x, RESTART, stop, observe),
        }
    }
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

struct Factors(Direct);

impl Preconditioner for Factors {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.copy_from_slice(r);
        // A solution that is not finite is found out, and named, by the method that asked for it.
        if self.0.solve(z).is_err() {
            z.fill(f64::NAN);
        }
    }
}

struct FloatingFactors(Bordered);

impl Preconditioner for FloatingFactors {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.copy_from_slice(r);
        if self.0.solve(z).is_err() {
            z.fill(f64::NAN);
        }
    }
}
