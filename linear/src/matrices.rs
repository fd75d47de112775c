//! Matrices that the tests share.

use super::{Sparse, vector};

/// Tridiagonal (−1, 2, −1): the exact inverse of a source at both fixed ends.
pub fn laplacian_1d(n: usize) -> Sparse {
    laplacian_2d(n, 1, 0.0)
}

/// −∂²/∂x² − `ratio` ∂²/∂y² on `nx` × `ny` points between fixed edges, five points each.
pub fn laplacian_2d(nx: usize, ny: usize, ratio: f64) -> Sparse {
    uneven_laplacian(nx, ny, ratio, |_| 1.0, true)
}

/// −∂²/∂x² − ∂²/∂y² on `nx` × `ny` points with free edges: constants are its null space.
pub fn neumann_2d(nx: usize, ny: usize) -> Sparse {
    uneven_laplacian(nx, ny, 1.0, |_| 1.0, false)
}

/// S (−∂²/∂x² − `ratio` ∂²/∂y²) S with the diagonal S of `weight`, so that the diagonal varies.
pub fn uneven_laplacian(nx: usize, ny: usize, ratio: f64, weight: impl Fn(usize) -> f64, fixed: bool) -> Sparse {
    let mut triplets = Vec::new();
    for j in 0..ny {
        for i in 0..nx {
            let here = j * nx + i;
            let mut join = |inside: bool, there: usize, k: f64| {
                if inside {
                    triplets.push((here as u32, there as u32, -k * (weight(here) * weight(there))));
                }
                if inside || fixed {
                    triplets.push((here as u32, here as u32, k * weight(here) * weight(here)));
                }
            };
            join(i > 0, here.wrapping_sub(1), 1.0);
            join(i + 1 < nx, here + 1, 1.0);
            join(j > 0, here.wrapping_sub(nx), ratio);
            join(j + 1 < ny, here + nx, ratio);
        }
    }
    Sparse::from_triplets(nx * ny, &triplets)
}

/// Eight entries a row without order or symmetry, and a diagonal above the sum of their sizes.
pub fn dominant(n: usize) -> Sparse {
    let mut triplets = Vec::new();
    for row in 0..n {
        let mut sum = 1.0;
        for k in 0..8 {
            let place = vector::scattered(16 * row + 2 * k);
            let value = vector::scattered(16 * row + 2 * k + 1);
            let column = ((0.5 + 0.5 * place) * n as f64) as u32;
            triplets.push((row as u32, column, value));
            sum += value.abs();
        }
        triplets.push((row as u32, row as u32, sum));
    }
    Sparse::from_triplets(n, &triplets)
}

/// b = A x for an x without a pattern, and that x.
pub fn with_solution(matrix: &Sparse) -> (Vec<f64>, Vec<f64>) {
    let x: Vec<f64> = (0..matrix.size()).map(vector::scattered).collect();
    let mut b = vec![0.0; x.len()];
    matrix.multiply(&x, &mut b);
    (b, x)
}

/// |x − y|/|y|
pub fn difference(x: &[f64], y: &[f64]) -> f64 {
    let mut d = x.to_vec();
    vector::add(-1.0, y, &mut d);
    vector::norm(&d) / vector::norm(y)
}

/// What `work` gives on 1, 2, 3 and 7 threads.
pub fn on_threads<T: Send>(work: impl Fn() -> T + Sync) -> Vec<T> {
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    [1, 2, 3, 7].iter().map(|&n| pool(n).install(&work)).collect()
}
