//! Direct solution by faer's sparse factors.
//!
//! faer runs on one thread here: its blocks, and so its sums, would follow the number of threads.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::{cholesky, lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};

use super::{LinearError, Sparse, vector};

/// A factor is refused when it returns a known solution with a larger relative error: three digits must be left.
const PROBE_ERROR: f64 = 1e-3;

/// Factors of a sparse matrix, in an order that keeps them sparse (approximate minimum degree).
#[derive(Debug)]
pub struct Direct {
    /// Of Aᵀ: the rows of A are its columns.
    pattern: SymbolicSparseColMat<usize>,
    factor: Factor,
}

#[derive(Debug)]
enum Factor {
    Cholesky { symbolic: cholesky::SymbolicCholesky<usize>, values: Vec<f64> },
    Lu { symbolic: lu::SymbolicLu<usize>, numeric: lu::NumericLu<usize, f64> },
}

impl Direct {
    /// A = Pᵀ L Lᵀ P for symmetric positive A. Only one half of A is read: see [`Sparse::is_symmetric`].
    ///
    /// # Errors
    /// A pivot that is not positive, a matrix that is singular within rounding, numbers that are not finite.
    pub fn cholesky(a: &Sparse) -> Result<Self, LinearError> {
        let pattern = pattern(a);
        let symbolic = cholesky::factorize_symbolic_cholesky(
            pattern.as_ref(),
            Side::Lower,
            Default::default(),
            Default::default(),
        )
        .map_err(|error| failed("Cholesky", error))?;
        let mut direct = Direct { pattern, factor: Factor::Cholesky { symbolic, values: Vec::new() } };
        direct.refactor(a)?;
        Ok(direct)
    }

    /// A = P L U Q for general A, with partial pivoting.
    ///
    /// # Errors
    /// A matrix that is singular within rounding, numbers that are not finite.
    pub fn lu(a: &Sparse) -> Result<Self, LinearError> {
        let pattern = pattern(a);
        let symbolic =
            lu::factorize_symbolic_lu(pattern.as_ref(), Default::default()).map_err(|error| failed("LU", error))?;
        let mut direct = Direct { pattern, factor: Factor::Lu { symbolic, numeric: lu::NumericLu::new() } };
        direct.refactor(a)?;
        Ok(direct)
    }

    /// Factors other values on the same pattern: spares the search for a good order.
    ///
    /// # Errors
    /// As the constructor. The old factor is gone.
    pub fn refactor(&mut self, a: &Sparse) -> Result<(), LinearError> {
        let same = a.starts().iter().map(|s| *s as usize).eq(self.pattern.col_ptr().iter().copied())
            && a.columns().iter().map(|c| *c as usize).eq(self.pattern.row_idx().iter().copied());
        assert!(same, "a factor is reused on another pattern");
        if a.values().iter().any(|v| !v.is_finite()) {
            return Err(failed(self.method(), "the matrix has entries that are not finite"));
        }
        let method = self.method();
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), a.values());
        match &mut self.factor {
            Factor::Cholesky { symbolic, values } => {
                values.resize(symbolic.len_val(), 0.0);
                let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
                let mut memory = MemBuffer::try_new(scratch).map_err(|error| failed(method, error))?;
                symbolic
                    .factorize_numeric_llt(
                        values,
                        matrix,
                        Side::Lower,
                        LltRegularization::default(),
                        Par::Seq,
                        MemStack::new(&mut memory),
                        Default::default(),
                    )
                    .map_err(|error| failed(method, error))?;
            }
            Factor::Lu { symbolic, numeric } => {
                let scratch = symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default());
                let mut memory = MemBuffer::try_new(scratch).map_err(|error| failed(method, error))?;
                let stack = MemStack::new(&mut memory);
                symbolic
                    .factorize_numeric_lu(numeric, matrix, Par::Seq, stack, Default::default())
                    .map_err(|error| failed(method, error))?;
            }
        }
        self.probe(a)
    }

    /// Solves A x = b in place of b.
    ///
    /// # Errors
    /// A solution that is not finite.
    pub fn solve(&self, b: &mut [f64]) -> Result<(), LinearError> {
        assert_eq!(b.len(), self.pattern.ncols(), "a right side of another length");
        let right = MatMut::from_column_major_slice_mut(b, self.pattern.ncols(), 1);
        match &self.factor {
            Factor::Cholesky { symbolic, values } => {
                let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
                let stack = MemStack::new(&mut memory);
                cholesky::LltRef::new(symbolic, values).solve_in_place_with_conj(Conj::No, right, Par::Seq, stack);
            }
            Factor::Lu { symbolic, numeric } => {
                let mut memory = MemBuffer::new(symbolic.solve_transpose_in_place_scratch::<f64>(1, Par::Seq));
                let stack = MemStack::new(&mut memory);
                let factor = lu::LuRef::new_unchecked(symbolic, numeric);
                factor.solve_transpose_in_place_with_conj(Conj::No, right, Par::Seq, stack);
            }
        }
        if b.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(failed(self.method(), "the solution is not finite")) }
    }

    /// Solves for a known solution without a pattern: its relative error is about κ ε.
    fn probe(&self, a: &Sparse) -> Result<(), LinearError> {
        let exact: Vec<f64> = (0..a.size()).map(vector::scattered).collect();
        let mut x = vec![0.0; a.size()];
        a.multiply(&exact, &mut x);
        self.solve(&mut x)?;
        vector::add(-1.0, &exact, &mut x);
        let error = vector::norm(&x);
        if error <= PROBE_ERROR * vector::norm(&exact) {
            return Ok(());
        }
        let error = error / vector::norm(&exact);
        let cause = format!("a known solution comes back with relative error {error:.1e}: singular within rounding");
        Err(failed(self.method(), cause))
    }

    fn method(&self) -> &'static str {
        match self.factor {
            Factor::Cholesky { .. } => "Cholesky",
            Factor::Lu { .. } => "LU",
        }
    }
}

/// The pattern of Aᵀ by columns, which is that of A by rows.
pub(super) fn pattern(a: &Sparse) -> SymbolicSparseColMat<usize> {
    let starts = a.starts().iter().map(|s| *s as usize).collect();
    let columns = a.columns().iter().map(|c| *c as usize).collect();
    SymbolicSparseColMat::new_checked(a.size(), a.size(), starts, None, columns)
}

pub(super) fn failed(method: &'static str, cause: impl std::fmt::Display) -> LinearError {
    LinearError::Factor { method, cause: cause.to_string() }
}

#[cfg(test)]
mod tests {
    use super::super::matrices;
    use super::*;

    #[test]
    fn known_solutions_come_back() {
        let mut list = vec![(Direct::lu as fn(&Sparse) -> _, matrices::dominant(300), 1e3)];
        for method in [Direct::cholesky, Direct::lu] {
            list.push((method, matrices::laplacian_1d(100), 4.2e3));
            list.push((method, matrices::laplacian_2d(40, 30, 5.0), 4.2e3));
        }
        for (method, matrix, condition) in list {
            let (mut b, exact) = matrices::with_solution(&matrix);
            method(&matrix).unwrap().solve(&mut b).unwrap();
            // Ten roundings of size κ ε.
            assert!(matrices::difference(&b, &exact) < 10.0 * condition * f64::EPSILON);
        }
    }

    #[test]
    fn other_values_on_the_same_pattern_are_factored_anew() {
        let first = matrices::laplacian_2d(20, 20, 1.0);
        let mut second = first.clone();
        second.values_mut().iter_mut().for_each(|v| *v *= 3.0);
        for method in [Direct::cholesky, Direct::lu] {
            let mut direct = method(&first).unwrap();
            direct.refactor(&second).unwrap();
            let (mut b, exact) = matrices::with_solution(&second);
            direct.solve(&mut b).unwrap();
            // Ten roundings of size κ ε, κ = 178.
            assert!(matrices::difference(&b, &exact) < 4e-13);
        }
    }

    #[test]
    fn matrices_without_a_factor_are_refused() {
        let error = |result: Result<Direct, LinearError>| result.unwrap_err().to_string();
        let signs = Sparse::from_triplets(2, &[(0, 0, 1.0), (1, 1, -2.0)]);
        assert!(error(Direct::cholesky(&signs)).contains("NonPositivePivot"));
        assert!(Direct::lu(&signs).is_ok());
        // Free edges: constants are solutions of A x = 0.
        let free = matrices::neumann_2d(12, 9);
        for method in [Direct::cholesky, Direct::lu] {
            error(method(&free));
            error(method(&Sparse::from_triplets(2, &[(0, 0, 1.0)])));
            let hole = Sparse::from_triplets(2, &[(0, 0, 1.0), (1, 1, f64::NAN)]);
            assert!(error(method(&hole)).contains("not finite"));
        }
        // A row that is the sum of two others.
        let rows = [(0, 0, 1.0), (0, 1, 2.0), (1, 1, 1.0), (1, 2, -1.0), (2, 0, 1.0), (2, 1, 3.0), (2, 2, -1.0)];
        error(Direct::lu(&Sparse::from_triplets(3, &rows)));
    }

    #[test]
    fn threads_change_no_bit() {
        let matrix = matrices::laplacian_2d(200, 200, 1.0);
        let (b, _) = matrices::with_solution(&matrix);
        for method in [Direct::cholesky, Direct::lu] {
            let runs = matrices::on_threads(|| {
                let mut x = b.clone();
                method(&matrix).unwrap().solve(&mut x).unwrap();
                x
            });
            assert!(runs.iter().all(|run| *run == runs[0]));
        }
    }
}
