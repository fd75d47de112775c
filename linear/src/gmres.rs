//! GMRES with restarts and right preconditioning, for general matrices.

use super::krylov::Monitor;
use super::{Cause, LinearError, LinearOperator, Preconditioner, Solved, Stop, vector};

/// What is left of A v after its parts along the basis are taken off is rounding below this share.
const VANISHES: f64 = 4.0 * f64::EPSILON;

/// Solves A x = b for a general A by the smallest residual over x₀ + M⁻¹ span{r, A M⁻¹ r, …}, which starts anew after
/// `restart` iterations (Saad & Schultz 1986; Saad 2003, algorithms 6.9 and 9.5): modified Gram-Schmidt, Givens
/// rotations. Memory: `restart` + 3 vectors.
///
/// `x` and `observe`: as in [`super::conjugate_gradients()`]; `x` changes at the ends of cycles only.
///
/// # Errors
/// No convergence, numbers that are not finite, a singular matrix (breakdown), an interruption, or a cycle that does
/// not lower the true residual: `restart` is too small, or rounding puts the tolerance out of reach.
pub fn gmres(
    a: &mut (impl LinearOperator + ?Sized),
    m: &mut (impl Preconditioner + ?Sized),
    b: &[f64],
    x: &mut [f64],
    restart: usize,
    stop: &Stop,
    observe: impl FnMut(usize, f64) -> bool,
) -> Result<Solved, LinearError> {
    assert!(restart > 0, "a cycle has at least one iteration");
    let Some(mut monitor) = Monitor::start("GMRES", a.size(), b, x, stop, observe)? else {
        return Ok(Solved::at_rest(x));
    };
    let [mut r, mut z] = std::array::from_fn(|_| vec![0.0; b.len()]);
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut before = f64::INFINITY;
    loop {
        let (size, done) = monitor.residual(a, b, x, &mut r)?;
        if done {
            return Ok(monitor.solved(size));
        }
        if size >= before {
            return Err(monitor.fail(Cause::Stagnation));
        }
        before = size;
        let mut least = LeastSquares::new(size);
        let mut failed = None;
        for j in 0..restart {
            if let Err(error) = monitor.begin() {
                failed = Some(error);
                break;
            }
            let share = if j == 0 { size } else { least.left };
            vector::scale(1.0 / share, &mut r);
            set(&mut basis, j, &r);
            m.apply(&basis[j], &mut z);
            a.apply(&z, &mut r);
            let whole = monitor.finite("|A v|", vector::norm(&r))?;
            let mut column = Vec::with_capacity(j + 2);
            for v in &basis[..=j] {
                let h = vector::dot(&r, v);
                vector::add(-h, v, &mut r);
                column.push(h);
            }
            let left = vector::norm(&r);
            let left = if left <= VANISHES * whole { 0.0 } else { left };
            if !least.add(column, left) {
                failed = Some(
                    monitor.fail(Cause::Breakdown { what: "the last pivot of the projected matrix", restarts: 0 }),
                );
                break;
            }
            match monitor.end(least.residual()) {
                Ok(small) if small || left == 0.0 => break,
                Ok(_) => {}
                Err(error) => {
                    failed = Some(error);
                    break;
                }
            }
        }
        // x += M⁻¹ V y
        r.fill(0.0);
        for (y, v) in least.solution().iter().zip(&basis) {
            vector::add(*y, v, &mut r);
        }
        m.apply(&r, &mut z);
        vector::add(1.0, &z, x);
        if let Some(error) = failed {
            return Err(error);
        }
    }
}

/// basis[j] = v, in memory of an earlier cycle where there is some.
fn set(basis: &mut Vec<Vec<f64>>, j: usize, v: &[f64]) {
    match basis.get_mut(j) {
        Some(old) => old.copy_from_slice(v),
        None => basis.push(v.to_vec()),
    }
}

/// min |size e₁ − H y| for a Hessenberg matrix H that grows by columns, by Givens rotations.
struct LeastSquares {
    /// Columns of the triangular matrix.
    columns: Vec<Vec<f64>>,
    /// Cosine and sine of each rotation.
    rotations: Vec<[f64; 2]>,
    /// The rotated right side; the size of its last number is the residual.
    right: Vec<f64>,
    /// The entry below the diagonal of the last column.
    left: f64,
}

impl LeastSquares {
    fn new(size: f64) -> Self {
        LeastSquares { columns: Vec::new(), rotations: Vec::new(), right: vec![size], left: 0.0 }
    }

    /// Adds a column with `left` below it; false, and nothing added, when it makes the matrix singular.
    fn add(&mut self, mut column: Vec<f64>, left: f64) -> bool {
        let scale = column.iter().fold(left, |m, h| m.max(h.abs()));
        for (k, [c, s]) in self.rotations.iter().enumerate() {
            [column[k], column[k + 1]] = [c * column[k] + s * column[k + 1], c * column[k + 1] - s * column[k]];
        }
        let j = column.len() - 1;
        let pivot = column[j].hypot(left);
        if pivot <= VANISHES * scale {
            return false;
        }
        let [c, s] = [column[j] / pivot, left / pivot];
        column[j] = pivot;
        let last = self.right[j];
        self.right[j] = c * last;
        self.right.push(-s * last);
        self.rotations.push([c, s]);
        self.columns.push(column);
        self.left = left;
        true
    }

    fn residual(&self) -> f64 {
        self.right[self.columns.len()].abs()
    }

    fn solution(&self) -> Vec<f64> {
        let n = self.columns.len();
        let mut y = self.right[..n].to_vec();
        for j in (0..n).rev() {
            y[j] /= self.columns[j][j];
            for i in 0..j {
                y[i] -= self.columns[j][i] * y[j];
            }
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Direct, NoPreconditioner, Sparse, matrices};
    use super::*;

    fn solve(matrix: &Sparse, b: &[f64], restart: usize, tolerance: f64) -> Result<(Vec<f64>, Solved), LinearError> {
        let mut x = vec![0.0; b.len()];
        let stop = Stop { tolerance, max_iterations: 3000 };
        let solved = gmres(&mut &*matrix, &mut NoPreconditioner, b, &mut x, restart, &stop, |_, _| true)?;
        Ok((x, solved))
    }

    #[test]
    fn a_matrix_without_symmetry_and_laplacians_agree_with_the_direct_solution() {
        // Bounds of κ: as for BiCGSTAB.
        let list = [(matrices::dominant(500), 18.0, 10), (matrices::laplacian_1d(100), 4200.0, 100)];
        for (matrix, condition, restart) in list.into_iter().chain([(matrices::laplacian_2d(30, 20, 1.0), 4200.0, 40)])
        {
            let b: Vec<f64> = (0..matrix.size()).map(vector::scattered).collect();
            let (x, solved) = solve(&matrix, &b, restart, 1e-11).unwrap();
            let mut exact = b.clone();
            Direct::lu(&matrix).unwrap().solve(&mut exact).unwrap();
            assert!(matrices::difference(&x, &exact) < condition * 500f64.sqrt() * 1e-11);
            assert!(solved.residual <= 1e-11);
        }
    }

    #[test]
    fn a_rotation_is_solved_in_two_steps_and_not_in_cycles_of_one() {
        let rotation = Sparse::from_triplets(2, &[(0, 1, 1.0), (1, 0, -1.0)]);
        let (x, solved) = solve(&rotation, &[1.0, 3.0], 5, 1e-14).unwrap();
        // A few roundings: κ = 1.
        assert!(matrices::difference(&x, &[-3.0, 1.0]) < 1e-14);
        assert_eq!(solved.iterations, 2);
        let error = solve(&rotation, &[1.0, 3.0], 1, 1e-14).unwrap_err();
        assert!(matches!(error, LinearError::Stopped { cause: Cause::Stagnation, .. }), "{error}");
    }

    #[test]
    fn residuals_never_rise() {
        let matrix = matrices::laplacian_2d(20, 20, 10.0);
        let (b, _) = matrices::with_solution(&matrix);
        let (_, solved) = solve(&matrix, &b, 7, 1e-8).unwrap();
        // The rounding of one residual to the next.
        assert!(solved.history.windows(2).all(|r| r[1] <= r[0] * (1.0 + 1e-12)));
    }

    #[test]
    fn bad_matrices_and_numbers_are_named() {
        let error = solve(&matrices::laplacian_1d(3), &[1.0, f64::NAN, 0.0], 3, 1e-8).unwrap_err();
        assert!(error.to_string().contains("right side"), "{error}");
        let hole = Sparse::from_triplets(2, &[(0, 0, 1.0), (0, 1, f64::INFINITY), (1, 1, 1.0)]);
        let error = solve(&hole, &[1.0, 1.0], 3, 1e-8).unwrap_err();
        assert!(error.to_string().contains("not a finite number"), "{error}");
        // b is not in the range of A.
        let singular = Sparse::from_triplets(2, &[(0, 1, 1.0)]);
        let error = solve(&singular, &[1.0, 1.0], 3, 1e-8).unwrap_err();
        assert!(matches!(error, LinearError::Stopped { cause: Cause::Breakdown { .. }, .. }), "{error}");
    }

    #[test]
    fn threads_change_no_bit() {
        let matrix = matrices::laplacian_2d(200, 200, 1.0);
        let (b, _) = matrices::with_solution(&matrix);
        let runs = matrices::on_threads(|| solve(&matrix, &b, 20, 1e-3).unwrap());
        for run in &runs[1..] {
            assert_eq!(*run, runs[0]);
        }
    }
}
