//! Linear systems A x = b: operators, preconditioners, Krylov methods, null spaces, direct factors.
//!
//! A solver sees flat vectors of `f64`. Every sum over unknowns runs over chunks of fixed size, added in order, and every
//! row of a matrix is summed in order: the same bits on any number of threads.
//!
//! | A | method |
//! |---|---|
//! | symmetric positive | [`conjugate_gradients()`]; 2D or below some 30 000 unknowns [`Direct::cholesky`] |
//! | general | [`bicgstab()`], [`gmres()`] (safer, more memory), [`Direct::lu`] |
//! | with rigid motions | any of the first with [`Projected`], or [`Bordered`] |
//! | small and dense, rank to be known | [`SingularValues`] |
//! | symmetric, its largest eigenvalue to be known | [`bound_of_largest_eigenvalue()`] |

mod bicgstab;
mod condensed;
mod conjugate_gradients;
mod direct;
mod gmres;
mod incomplete;
mod krylov;
mod lanczos;
mod null_space;
mod preconditioner;
mod singular_values;
mod sparse;
pub mod vector;

#[cfg(test)]
mod matrices;

pub use bicgstab::bicgstab;
pub use condensed::Condensed;
pub use conjugate_gradients::conjugate_gradients;
pub use direct::Direct;
pub use gmres::gmres;
pub use incomplete::{IncompleteCholesky, IncompleteLu};
pub use krylov::{Solved, Stop};
pub use lanczos::bound_of_largest_eigenvalue;
pub use null_space::{Bordered, NullSpace, Projected};
pub use preconditioner::{BlockJacobi, Jacobi, NoPreconditioner};
pub use singular_values::SingularValues;
pub use sparse::Sparse;

/// A square matrix, known by its product with a vector.
pub trait LinearOperator {
    /// Number of rows and of columns.
    fn size(&self) -> usize;
    /// y = A x; both of length `size`. Mutable, because operators without a matrix keep their scratch memory.
    fn apply(&mut self, x: &[f64], y: &mut [f64]);
}

/// An approximate inverse, linear and the same in every call. Conjugate gradients need it symmetric and positive.
pub trait Preconditioner {
    /// z = M⁻¹ r; both of the operator's size.
    fn apply(&mut self, r: &[f64], z: &mut [f64]);
}

impl<T: LinearOperator + ?Sized> LinearOperator for &mut T {
    fn size(&self) -> usize {
        T::size(self)
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        T::apply(self, x, y);
    }
}

impl<T: Preconditioner + ?Sized> Preconditioner for &mut T {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        T::apply(self, r, z);
    }
}

/// Where the components of a point stand in a flat vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// u_x of point 0, u_y of point 0, …, u_x of point 1, …
    Interleaved,
    /// u_x of all points, u_y of all points, …: the layout of the engine.
    ByComponent,
}

impl Layout {
    /// The unknown that is `component` of `point`, of `points` with `components` each.
    pub fn unknown(self, point: usize, component: usize, points: usize, components: usize) -> usize {
        match self {
            Layout::Interleaved => point * components + component,
            Layout::ByComponent => component * points + point,
        }
    }

    /// The point and the component of an unknown: the inverse of [`Layout::unknown`].
    pub fn place(self, unknown: usize, points: usize, components: usize) -> (usize, usize) {
        match self {
            Layout::Interleaved => (unknown / components, unknown % components),
            Layout::ByComponent => (unknown % points, unknown / points),
        }
    }
}

/// Why a linear system was not solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LinearError {
    /// A Krylov method gave up. The vector holds the last iterate.
    #[error("{method} stopped at iteration {iteration}, relative residual {residual:.3e}: {cause}")]
    Stopped {
        method: &'static str,
        iteration: usize,
        /// |b − A x|/|b|, as the method knows it.
        residual: f64,
        cause: Cause,
    },
    /// A preconditioner divides by something that cannot be divided by.
    #[error("{method}: the pivot of row {row} is {value:e}")]
    Pivot { method: &'static str, row: usize, value: f64 },
    /// A direct factor does not exist, or is worthless.
    #[error("{method}: {cause}")]
    Factor { method: &'static str, cause: String },
}

/// Why a Krylov method gave up.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Cause {
    #[error("no convergence within the {0} iterations allowed")]
    Iterations(usize),
    #[error("{0} is not a finite number")]
    NotFinite(&'static str),
    #[error("the squares of the right side are too small for a number")]
    Underflow,
    #[error("{what} = {value:e} is not positive: {whose} is not positive definite")]
    Indefinite { what: &'static str, value: f64, whose: &'static str },
    #[error("breakdown: {what} vanishes, also after {restarts} restarts")]
    Breakdown { what: &'static str, restarts: usize },
    #[error("the true residual falls no further")]
    Stagnation,
    #[error("interrupted")]
    Interrupted,
}
