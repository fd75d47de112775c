//! Singular values of small dense matrices, by faer on one thread.

use faer::{Mat, linalg::solvers};

use super::LinearError;

/// A = U Σ Vᵀ of a dense matrix with at least as many rows as columns, singular values in descending order.
#[derive(Debug, Clone)]
pub struct SingularValues {
    pub values: Vec<f64>,
    u: Mat<f64>,
    v: Mat<f64>,
}

impl SingularValues {
    /// Of the matrix with these entries, given by row and column.
    ///
    /// # Errors
    /// Entries that are not finite; no convergence.
    pub fn new(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Result<Self, LinearError> {
        assert!(rows >= columns && columns > 0, "{rows} rows for {columns} columns");
        let failed = |cause: &str| LinearError::Factor { method: "SVD", cause: cause.to_string() };
        let matrix = Mat::from_fn(rows, columns, entry);
        if !matrix.col_iter().all(|column| column.iter().all(|v| v.is_finite())) {
            return Err(failed("the matrix has entries that are not finite"));
        }
        let svd = solvers::Svd::new_thin(matrix.as_ref()).map_err(|_| failed("no convergence"))?;
        let values = svd.S().column_vector().iter().copied().collect();
        Ok(Self { values, u: svd.U().to_owned(), v: svd.V().to_owned() })
    }

    /// σ₁/σₙ, infinite without full rank.
    pub fn condition(&self) -> f64 {
        self.values[0] / self.values[self.values.len() - 1]
    }

    /// The shortest y with Aᵀ y = b, y = U Σ⁻¹ Vᵀ b, for full rank.
    pub fn least_norm(&self, b: &[f64]) -> Vec<f64> {
        assert_eq!(b.len(), self.values.len(), "a right side of another length");
        let (u, v) = (&self.u, &self.v);
        let inner: Vec<f64> = self
            .values
            .iter()
            .enumerate()
            .map(|(k, s)| b.iter().enumerate().map(|(j, b)| v[(j, k)] * b).sum::<f64>() / s)
            .collect();
        (0..u.nrows()).map(|i| inner.iter().enumerate().map(|(k, z)| u[(i, k)] * z).sum()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_solution_is_that_of_two_points() {
        // Aᵀ y = b with A = (1 1 1; −1 0 2)ᵀ: y = α + β x at x = −1, 0, 2.
        let x = [-1.0, 0.0, 2.0];
        let svd = SingularValues::new(3, 2, |i, j| if j == 0 { 1.0 } else { x[i] }).unwrap();
        let y = svd.least_norm(&[3.0, 1.0]);
        // AᵀA = (3 1; 1 5): α = 1, β = 0; its eigenvalues are 4 ± √2.
        assert!(y.iter().all(|y| (y - 1.0).abs() < 1e-14), "{y:?}");
        let two = 2f64.sqrt();
        // A few roundings.
        assert!((svd.condition().powi(2) - (4.0 + two) / (4.0 - two)).abs() < 1e-14);
    }

    #[test]
    fn rank_and_numbers_are_seen() {
        assert!(SingularValues::new(3, 2, |_, _| 1.0).unwrap().condition() > 1e15);
        assert!(SingularValues::new(3, 2, |i, _| if i == 1 { f64::NAN } else { 1.0 }).is_err());
    }
}
