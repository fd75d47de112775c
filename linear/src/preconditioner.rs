//! Preconditioners from the diagonal: none, one number a row, one small block a point.

use super::{Layout, LinearError, Preconditioner, Sparse, vector};

/// z = r
#[derive(Debug, Clone, Copy, Default)]
pub struct NoPreconditioner;

impl Preconditioner for NoPreconditioner {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.copy_from_slice(r);
    }
}

/// z_i = r_i / a_ii
#[derive(Debug, Clone, PartialEq)]
pub struct Jacobi {
    inverse: Vec<f64>,
}

impl Jacobi {
    /// From the diagonal of A.
    ///
    /// # Errors
    /// An entry that is zero or not finite.
    pub fn new(diagonal: &[f64]) -> Result<Self, LinearError> {
        let bad = |a: &f64| *a == 0.0 || !a.is_finite();
        if let Some(row) = diagonal.iter().position(bad) {
            return Err(LinearError::Pivot { method: "Jacobi", row, value: diagonal[row] });
        }
        Ok(Jacobi { inverse: diagonal.iter().map(|a| 1.0 / a).collect() })
    }
}

impl Preconditioner for Jacobi {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        assert!(r.len() == self.inverse.len() && z.len() == r.len(), "a vector of another length");
        vector::fill(z, |start, z| {
            for (k, z) in z.iter_mut().enumerate() {
                *z = self.inverse[start + k] * r[start + k];
            }
        });
    }
}

/// z_p = A_pp⁻¹ r_p for the D × D block of every point p: D = 1, 2, 3 components.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockJacobi<const D: usize> {
    inverses: Vec<[[f64; D]; D]>,
    layout: Layout,
}

impl<const D: usize> BlockJacobi<D> {
    /// From the blocks of A, one a point: `blocks[p][c][d]` is the force in c by the displacement in d.
    ///
    /// # Errors
    /// A block that has no inverse, named by the row of its pivot.
    pub fn new(blocks: &[[[f64; D]; D]], layout: Layout) -> Result<Self, LinearError> {
        let points = blocks.len();
        let inverses = blocks.iter().enumerate().map(|(point, block)| {
            inverse(block).map_err(|(component, value)| {
                let row = layout.unknown(point, component, points, D);
                LinearError::Pivot { method: "block Jacobi", row, value }
            })
        });
        Ok(BlockJacobi { inverses: inverses.collect::<Result<_, _>>()?, layout })
    }

    /// From an assembled matrix.
    ///
    /// # Errors
    /// As [`BlockJacobi::new`].
    pub fn from_sparse(a: &Sparse, layout: Layout) -> Result<Self, LinearError> {
        assert!(a.size().is_multiple_of(D), "{} rows are no points of {D} components", a.size());
        let points = a.size() / D;
        let at = |p, c| layout.unknown(p, c, points, D);
        let block = |p| std::array::from_fn(|c| std::array::from_fn(|d| a.get(at(p, c), at(p, d))));
        let blocks: Vec<_> = (0..points).map(block).collect();
        Self::new(&blocks, layout)
    }
}

impl<const D: usize> Preconditioner for BlockJacobi<D> {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let points = self.inverses.len();
        assert!(r.len() == D * points && z.len() == r.len(), "a vector of another length");
        vector::fill(z, |start, z| {
            for (k, z) in z.iter_mut().enumerate() {
                let (point, component) = self.layout.place(start + k, points, D);
                let row = &self.inverses[point][component];
                *z = (0..D).map(|d| row[d] * r[self.layout.unknown(point, d, points, D)]).sum();
            }
        });
    }
}

/// The inverse by Gauss and Jordan with the largest pivot of each column, or the column without one and its pivot.
fn inverse<const D: usize>(block: &[[f64; D]; D]) -> Result<[[f64; D]; D], (usize, f64)> {
    let mut a = *block;
    let mut b = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    let largest = block.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
    for column in 0..D {
        let best = (column..D).max_by(|&i, &j| a[i][column].abs().total_cmp(&a[j][column].abs())).unwrap_or(column);
        a.swap(column, best);
        b.swap(column, best);
        let pivot = a[column][column];
        // What the elimination leaves of a singular block is rounding.
        if !pivot.is_finite() || pivot.abs() <= 4.0 * f64::EPSILON * largest {
            return Err((column, pivot));
        }
        for j in 0..D {
            a[column][j] /= pivot;
            b[column][j] /= pivot;
        }
        for i in (0..D).filter(|&i| i != column) {
            let factor = a[i][column];
            for j in 0..D {
                a[i][j] -= factor * a[column][j];
                b[i][j] -= factor * b[column][j];
            }
        }
    }
    Ok(b)
}

#[cfg(test)]
mod tests {
    use super::super::{Stop, conjugate_gradients, matrices};
    use super::*;

    fn iterations(a: &Sparse, m: &mut impl Preconditioner) -> usize {
        let (b, _) = matrices::with_solution(a);
        let stop = Stop { tolerance: 1e-8, max_iterations: 10_000 };
        conjugate_gradients(&mut &*a, m, &b, &mut vec![0.0; b.len()], &stop, |_, _| true).unwrap().iterations
    }

    /// L ⊗ C: two fields, of which every point couples its two numbers by C = [1 c; c 1].
    fn coupled(field: &Sparse, c: f64, layout: Layout) -> Sparse {
        let n = field.size();
        let mut triplets = Vec::new();
        for row in 0..n {
            for (&column, &value) in field.row(row).0.iter().zip(field.row(row).1) {
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let at = |p, component| layout.unknown(p, component, n, 2) as u32;
                    triplets.push((at(row, i), at(column as usize, j), value * if i == j { 1.0 } else { c }));
                }
            }
        }
        Sparse::from_triplets(2 * n, &triplets)
    }

    #[test]
    fn each_step_towards_the_diagonal_blocks_lowers_the_iterations() {
        // Weights between 1 and 10 spread the diagonal over two decades.
        let field = matrices::uneven_laplacian(20, 20, 100.0, |i| 10f64.powf(0.5 + 0.5 * vector::scattered(i)), true);
        for layout in [Layout::Interleaved, Layout::ByComponent] {
            let a = coupled(&field, 0.95, layout);
            let none = iterations(&a, &mut NoPreconditioner);
            let points = iterations(&a, &mut Jacobi::new(&a.diagonal()).unwrap());
            let blocks = iterations(&a, &mut BlockJacobi::<2>::from_sparse(&a, layout).unwrap());
            assert!(points < none && blocks < points, "{layout:?}: {none}, {points}, {blocks}");
        }
    }

    #[test]
    fn blocks_are_inverted_in_every_dimension() {
        fn check<const D: usize>(layout: Layout) {
            let points = 4;
            let n = points * D;
            let blocks: Vec<[[f64; D]; D]> = (0..points)
                .map(|p| std::array::from_fn(|i| std::array::from_fn(|j| vector::scattered(9 * p + 3 * i + j))))
                .collect();
            let mut triplets = Vec::new();
            for (p, block) in blocks.iter().enumerate() {
                for c in 0..D {
                    for d in 0..D {
                        let [row, column] = [c, d].map(|c| layout.unknown(p, c, points, D) as u32);
                        triplets.push((row, column, block[c][d]));
                    }
                }
            }
            let a = Sparse::from_triplets(n, &triplets);
            let (b, x) = matrices::with_solution(&a);
            let mut z = vec![0.0; n];
            let mut from_matrix = BlockJacobi::<D>::from_sparse(&a, layout).unwrap();
            assert_eq!(from_matrix, BlockJacobi::new(&blocks, layout).unwrap());
            from_matrix.apply(&b, &mut z);
            // Blocks of condition below 1000, some ten roundings.
            assert!(matrices::difference(&z, &x) < 1e4 * f64::EPSILON, "{D}: {z:?} {x:?}");
        }
        for layout in [Layout::Interleaved, Layout::ByComponent] {
            check::<1>(layout);
            check::<2>(layout);
            check::<3>(layout);
        }
    }

    #[test]
    fn pivots_that_cannot_divide_are_named() {
        let zero = Jacobi::new(&[1.0, 0.0]).unwrap_err();
        assert_eq!(zero, LinearError::Pivot { method: "Jacobi", row: 1, value: 0.0 });
        assert!(Jacobi::new(&[f64::NAN]).is_err());
        let blocks = [[[1.0, 0.0], [0.0, 1.0]], [[1.0, 2.0], [2.0, 4.0]]];
        let singular = BlockJacobi::new(&blocks, Layout::ByComponent).unwrap_err();
        // Component 1 of point 1, of two points.
        assert_eq!(singular, LinearError::Pivot { method: "block Jacobi", row: 3, value: 0.0 });
        assert!(BlockJacobi::new(&[[[f64::NAN; 3]; 3]], Layout::Interleaved).is_err());
    }

    #[test]
    fn threads_change_no_bit() {
        let r: Vec<f64> = (0..30_000).map(vector::scattered).collect();
        let blocks: Vec<[[f64; 3]; 3]> = (0..10_000)
            .map(|p| std::array::from_fn(|i| std::array::from_fn(|j| vector::scattered(9 * p + 3 * i + j))))
            .collect();
        let m = BlockJacobi::new(&blocks, Layout::ByComponent).unwrap();
        let runs = matrices::on_threads(|| {
            let mut z = vec![0.0; r.len()];
            m.clone().apply(&r, &mut z);
            z
        });
        assert!(runs.iter().all(|run| *run == runs[0]));
    }
}
