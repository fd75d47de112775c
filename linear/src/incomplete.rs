//! Incomplete factors on the pattern of the matrix: ILU(0) and IC(0). Their solves are sequential.

use super::{LinearError, Preconditioner, Sparse};

/// L U on the pattern of A: equal to A where A has entries, and dropped elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct IncompleteLu {
    /// U with its diagonal, and L below without its unit diagonal.
    factors: Sparse,
    /// Place of the diagonal entry of every row among the entries.
    diagonal: Vec<usize>,
}

impl IncompleteLu {
    /// ILU(0), row by row (Saad 2003, algorithm 10.4).
    ///
    /// # Errors
    /// A row without a diagonal entry, a pivot that is zero, numbers that are not finite.
    pub fn new(a: &Sparse) -> Result<Self, LinearError> {
        let method = "ILU(0)";
        let mut factors = a.clone();
        let mut diagonal = Vec::with_capacity(a.size());
        // Place of each column in the row at hand, or nowhere.
        let mut place = vec![usize::MAX; a.size()];
        for row in 0..a.size() {
            let range = a.starts()[row] as usize..a.starts()[row + 1] as usize;
            for k in range.clone() {
                place[a.columns()[k] as usize] = k;
            }
            for k in range.clone() {
                let above = a.columns()[k] as usize;
                if above >= row {
                    break;
                }
                let values = factors.values_mut();
                let factor = values[k] / values[diagonal[above]];
                values[k] = factor;
                for l in diagonal[above] + 1..a.starts()[above + 1] as usize {
                    let target = place[a.columns()[l] as usize];
                    if target != usize::MAX {
                        values[target] -= factor * values[l];
                    }
                }
            }
            let Some(&pivot) = factors.values().get(place[row]) else {
                return Err(LinearError::Pivot { method, row, value: 0.0 });
            };
            if pivot == 0.0 {
                return Err(LinearError::Pivot { method, row, value: pivot });
            }
            diagonal.push(place[row]);
            if let Some(&value) = factors.values()[range.clone()].iter().find(|v| !v.is_finite()) {
                return Err(LinearError::Pivot { method, row, value });
            }
            for k in range {
                place[a.columns()[k] as usize] = usize::MAX;
            }
        }
        Ok(IncompleteLu { factors, diagonal })
    }
}

impl Preconditioner for IncompleteLu {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let (starts, columns, values) = (self.factors.starts(), self.factors.columns(), self.factors.values());
        for row in 0..r.len() {
            let mut sum = r[row];
            for k in starts[row] as usize..self.diagonal[row] {
                sum -= values[k] * z[columns[k] as usize];
            }
            z[row] = sum;
        }
        for row in (0..r.len()).rev() {
            let mut sum = z[row];
            for k in self.diagonal[row] + 1..starts[row + 1] as usize {
                sum -= values[k] * z[columns[k] as usize];
            }
            z[row] = sum / values[self.diagonal[row]];
        }
    }
}

/// The first share of the diagonal that is added when a pivot is not positive; doubled until all are.
const FIRST_SHIFT: f64 = 1e-3;
/// At a shift of 1000 any matrix with a positive diagonal and rows of moderate length is dominated by its diagonal.
const LAST_SHIFT: f64 = 1e3;

/// L Lᵀ on the pattern of A, for symmetric positive A.
#[derive(Debug, Clone, PartialEq)]
pub struct IncompleteCholesky {
    starts: Vec<usize>,
    columns: Vec<u32>,
    /// L, row after row; the diagonal is the last entry of a row.
    values: Vec<f64>,
    shift: f64,
}

impl IncompleteCholesky {
    /// IC(0) of A + shift · diag A, with the first shift among 0, 0.001, 0.002, 0.004, … that leaves all pivots
    /// positive (Manteuffel 1980; Lin & Moré 1999, algorithm 2.3). Only entries on and below the diagonal are read.
    ///
    /// # Errors
    /// A diagonal entry that is missing or not positive, numbers that are not finite.
    pub fn new(a: &Sparse) -> Result<Self, LinearError> {
        let method = "IC(0)";
        let mut lower = IncompleteCholesky { starts: vec![0], columns: Vec::new(), values: Vec::new(), shift: 0.0 };
        let mut original = Vec::new();
        for row in 0..a.size() {
            let pivot = a.get(row, row);
            if !(pivot > 0.0 && pivot.is_finite()) {
                return Err(LinearError::Pivot { method, row, value: pivot });
            }
            let (columns, values) = a.row(row);
            let here = columns.iter().take_while(|c| **c as usize <= row).count();
            lower.columns.extend(&columns[..here]);
            original.extend(&values[..here]);
            lower.starts.push(lower.columns.len());
        }
        loop {
            lower.values.clone_from(&original);
            match lower.factor() {
                Ok(()) => return Ok(lower),
                Err((row, value)) if !value.is_finite() || lower.shift >= LAST_SHIFT => {
                    return Err(LinearError::Pivot { method, row, value });
                }
                Err(_) => lower.shift = (2.0 * lower.shift).max(FIRST_SHIFT),
            }
        }
    }

    /// The share of the diagonal that had to be added; zero for most matrices.
    pub fn shift(&self) -> f64 {
        self.shift
    }

    /// l_ij = (a_ij − Σ_k l_ik l_jk)/l_jj, over the k < j that rows i and j share; or the bad pivot and its row.
    fn factor(&mut self) -> Result<(), (usize, f64)> {
        let (columns, values) = (&self.columns, &mut self.values);
        for row in 0..self.starts.len() - 1 {
            let (start, end) = (self.starts[row], self.starts[row + 1] - 1);
            for k in start..end {
                let above = columns[k] as usize;
                let last = self.starts[above + 1] - 1;
                let (mut i, mut j, mut sum) = (start, self.starts[above], values[k]);
                while i < k && j < last {
                    let [here, there] = [columns[i], columns[j]];
                    if here == there {
                        sum -= values[i] * values[j];
                    }
                    i += usize::from(here <= there);
                    j += usize::from(there <= here);
                }
                values[k] = sum / values[last];
            }
            let taken: f64 = values[start..end].iter().map(|l| l * l).sum();
            let pivot = values[end] * (1.0 + self.shift) - taken;
            // A pivot that is nothing but rounding is not positive either.
            if pivot.is_nan() || pivot <= f64::EPSILON * values[end] {
                return Err((row, pivot));
            }
            values[end] = pivot.sqrt();
        }
        Ok(())
    }
}

impl Preconditioner for IncompleteCholesky {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        for row in 0..r.len() {
            let end = self.starts[row + 1] - 1;
            let mut sum = r[row];
            for k in self.starts[row]..end {
                sum -= self.values[k] * z[self.columns[k] as usize];
            }
            z[row] = sum / self.values[end];
        }
        for row in (0..r.len()).rev() {
            let end = self.starts[row + 1] - 1;
            z[row] /= self.values[end];
            for k in self.starts[row]..end {
                z[self.columns[k] as usize] -= self.values[k] * z[row];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{NoPreconditioner, Stop, bicgstab, conjugate_gradients, gmres, matrices, vector};
    use super::*;

    const STOP: Stop = Stop { tolerance: 1e-8, max_iterations: 10_000 };

    #[test]
    fn each_factor_lowers_the_iterations_on_an_anisotropic_laplacian() {
        let a = matrices::laplacian_2d(30, 30, 100.0);
        let (b, _) = matrices::with_solution(&a);
        let cg = |m: &mut dyn Preconditioner| {
            conjugate_gradients(&mut &a, m, &b, &mut vec![0.0; b.len()], &STOP, |_, _| true).unwrap().iterations
        };
        let stab = |m: &mut dyn Preconditioner| {
            bicgstab(&mut &a, m, &b, &mut vec![0.0; b.len()], &STOP, |_, _| true).unwrap().iterations
        };
        let minimal = |m: &mut dyn Preconditioner| {
            gmres(&mut &a, m, &b, &mut vec![0.0; b.len()], 50, &STOP, |_, _| true).unwrap().iterations
        };
        let mut ic = IncompleteCholesky::new(&a).unwrap();
        let mut ilu = IncompleteLu::new(&a).unwrap();
        assert_eq!(ic.shift(), 0.0, "an M-matrix needs no shift (Meijerink & van der Vorst 1977)");
        let none = [cg(&mut NoPreconditioner), stab(&mut NoPreconditioner), minimal(&mut NoPreconditioner)];
        let with = [cg(&mut ic), stab(&mut ilu), minimal(&mut ilu)];
        for k in 0..3 {
            assert!(2 * with[k] < none[k], "{none:?}, {with:?}");
        }
    }

    #[test]
    fn factors_of_a_matrix_without_fill_are_exact() {
        let a = matrices::laplacian_1d(200);
        let (b, x) = matrices::with_solution(&a);
        let mut z = vec![0.0; 200];
        // κ ε = 1.6e4 × 2.2e-16 = 4e-12.
        IncompleteCholesky::new(&a).unwrap().apply(&b, &mut z);
        assert!(matrices::difference(&z, &x) < 4e-12);
        IncompleteLu::new(&a).unwrap().apply(&b, &mut z);
        assert!(matrices::difference(&z, &x) < 4e-12);
        // A full pattern has no fill to drop.
        let full = |value: &dyn Fn(u32, u32) -> f64| {
            let places = (0..15).flat_map(|i| (0..15).map(move |j| (i, j)));
            let entry = |(i, j)| (i, j, value(i, j) + if i == j { 8.0 } else { 0.0 });
            Sparse::from_triplets(15, &places.map(entry).collect::<Vec<_>>())
        };
        let general = full(&|i, j| vector::scattered((15 * i + j) as usize));
        let symmetric = full(&|i, j| vector::scattered((15 * i.max(j) + i.min(j)) as usize));
        let (b, x) = matrices::with_solution(&general);
        let mut z = vec![0.0; 15];
        IncompleteLu::new(&general).unwrap().apply(&b, &mut z);
        // κ below 100, a few roundings.
        assert!(matrices::difference(&z, &x) < 1e-13);
        let (b, x) = matrices::with_solution(&symmetric);
        IncompleteCholesky::new(&symmetric).unwrap().apply(&b, &mut z);
        assert!(matrices::difference(&z, &x) < 1e-13);
    }

    #[test]
    fn a_positive_matrix_whose_incomplete_factor_does_not_exist_is_shifted() {
        // Kershaw 1978: positive, smallest eigenvalue 0.17, but the last pivot of IC(0) is −5.
        let rows = [[3.0, -2.0, 0.0, 2.0], [-2.0, 3.0, -2.0, 0.0], [0.0, -2.0, 3.0, -2.0], [2.0, 0.0, -2.0, 3.0]];
        let entry = |(i, j): (usize, usize)| (i as u32, j as u32, rows[i][j]);
        let places = (0..4).flat_map(|i| (0..4).map(move |j| (i, j))).filter(|&(i, j)| rows[i][j] != 0.0);
        let a = Sparse::from_triplets(4, &places.map(entry).collect::<Vec<_>>());
        let mut m = IncompleteCholesky::new(&a).unwrap();
        assert!(m.shift() > 0.1 && m.shift() < 2.0, "{}", m.shift());
        let (b, exact) = matrices::with_solution(&a);
        let mut x = vec![0.0; 4];
        conjugate_gradients(&mut &a, &mut m, &b, &mut x, &STOP, |_, _| true).unwrap();
        // κ = 5.83/0.17 = 34.
        assert!(matrices::difference(&x, &exact) < 34.0 * STOP.tolerance);
    }

    #[test]
    fn bad_pivots_are_named() {
        let a = Sparse::from_triplets(2, &[(0, 0, 1.0), (0, 1, 1.0), (1, 0, 1.0), (1, 1, 1.0)]);
        assert_eq!(IncompleteLu::new(&a), Err(LinearError::Pivot { method: "ILU(0)", row: 1, value: 0.0 }));
        let rotation = Sparse::from_triplets(2, &[(0, 1, 1.0), (1, 0, -1.0)]);
        assert_eq!(IncompleteLu::new(&rotation), Err(LinearError::Pivot { method: "ILU(0)", row: 0, value: 0.0 }));
        assert!(IncompleteCholesky::new(&rotation).is_err());
        let hole = Sparse::from_triplets(2, &[(0, 0, 1.0), (1, 0, f64::NAN), (1, 1, 1.0)]);
        assert!(IncompleteLu::new(&hole).is_err() && IncompleteCholesky::new(&hole).is_err());
        // Singular, and mended by a shift.
        assert_eq!(IncompleteCholesky::new(&a).unwrap().shift(), FIRST_SHIFT);
    }
}
