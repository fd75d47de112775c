//! Preconditioned conjugate gradients, for symmetric positive matrices.

use super::krylov::Monitor;
use super::{Cause, LinearError, LinearOperator, Preconditioner, Solved, Stop, vector};

/// A residual that the recurrence calls small and the true one contradicts is taken up anew this often.
const RESTARTS: usize = 3;

/// Solves A x = b for symmetric positive A and M (Hestenes & Stiefel 1952; Saad 2003, algorithm 9.1):
/// α = r·z / p·A p, x += α p, r −= α A p, z = M⁻¹ r, p = z + (r·z)new/(r·z)old p.
///
/// `x` holds the first guess and then the solution, or the last iterate when there is none. `observe` is told
/// every iteration with its relative residual |r|/|b|, and stops the method by answering false.
///
/// # Errors
/// No convergence, numbers that are not finite, p·A p ≤ 0 or r·z ≤ 0 (A or M is not positive), an interruption, or a
/// tolerance that rounding puts out of reach.
pub fn conjugate_gradients(
    a: &mut (impl LinearOperator + ?Sized),
    m: &mut (impl Preconditioner + ?Sized),
    b: &[f64],
    x: &mut [f64],
    stop: &Stop,
    observe: impl FnMut(usize, f64) -> bool,
) -> Result<Solved, LinearError> {
    let Some(mut monitor) = Monitor::start("conjugate gradients", a.size(), b, x, stop, observe)? else {
        return Ok(Solved::at_rest(x));
    };
    let [mut r, mut z, mut p, mut q] = std::array::from_fn(|_| vec![0.0; b.len()]);
    for _ in 0..=RESTARTS {
        let (size, done) = monitor.residual(a, b, x, &mut r)?;
        if done {
            return Ok(monitor.solved(size));
        }
        let mut rz_old = 0.0;
        loop {
            monitor.begin()?;
            m.apply(&r, &mut z);
            let rz = monitor.finite("r·z", vector::dot(&r, &z))?;
            if rz <= 0.0 {
                return Err(monitor.fail(Cause::Indefinite { what: "r·z", value: rz, whose: "the preconditioner" }));
            }
            let beta = if rz_old == 0.0 { 0.0 } else { rz / rz_old };
            vector::scale_and_add(beta, &z, &mut p);
            a.apply(&p, &mut q);
            let pq = monitor.finite("p·A p", vector::dot(&p, &q))?;
            if pq <= 0.0 {
                return Err(monitor.fail(Cause::Indefinite { what: "p·A p", value: pq, whose: "the matrix" }));
            }
            vector::add(rz / pq, &p, x);
            vector::add(-rz / pq, &q, &mut r);
            rz_old = rz;
            if monitor.end(vector::norm(&r))? {
                break;
            }
        }
    }
    match monitor.residual(a, b, x, &mut r)? {
        (size, true) => Ok(monitor.solved(size)),
        (_, false) => Err(monitor.fail(Cause::Stagnation)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Direct, NoPreconditioner, Sparse, matrices};
    use super::*;

    fn solve(matrix: &Sparse, b: &[f64], stop: Stop) -> Result<(Vec<f64>, Solved), LinearError> {
        let mut x = vec![0.0; b.len()];
        let solved = conjugate_gradients(&mut &*matrix, &mut NoPreconditioner, b, &mut x, &stop, |_, _| true)?;
        Ok((x, solved))
    }

    #[test]
    fn laplacians_agree_with_the_direct_solution() {
        for matrix in [matrices::laplacian_1d(100), matrices::laplacian_2d(30, 20, 1.0)] {
            let b: Vec<f64> = (0..matrix.size()).map(vector::scattered).collect();
            let stop = Stop { tolerance: 1e-12, max_iterations: 1000 };
            let (x, solved) = solve(&matrix, &b, stop).unwrap();
            let mut exact = b.clone();
            Direct::cholesky(&matrix).unwrap().solve(&mut exact).unwrap();
            // The error is at most κ times the residual; κ = 4/(π/101)² = 4,134 in 1D, and less in 2D.
            assert!(matrices::difference(&x, &exact) < 4200.0 * 1e-12);
            assert!(solved.residual <= 1e-12 && solved.history.len() == solved.iterations + 1);
        }
    }

    #[test]
    fn as_many_steps_as_unknowns_are_enough() {
        let n = 12;
        let matrix = matrices::laplacian_1d(n);
        let (b, exact) = matrices::with_solution(&matrix);
        // κ = 4/(π/13)² = 68: twelve steps lose less than 100 κ ε = 1.5e-12 by rounding.
        let tolerance = 1.5e-12;
        let (x, solved) = solve(&matrix, &b, Stop { tolerance, max_iterations: n }).unwrap();
        assert!(matrices::difference(&x, &exact) < 70.0 * tolerance);
        // A vector without a pattern has a part in all n eigenvectors: no fewer steps do.
        assert_eq!(solved.iterations, n);
        let stopped = solve(&matrix, &b, Stop { tolerance, max_iterations: n - 1 }).unwrap_err();
        assert!(
            matches!(stopped, LinearError::Stopped { iteration: 11, cause: Cause::Iterations(11), .. }),
            "{stopped}"
        );
    }

    #[test]
    fn a_source_in_the_middle_of_a_string_gives_a_tent() {
        let matrix = matrices::laplacian_1d(9);
        let mut b = vec![0.0; 9];
        b[4] = 1.0;
        let (x, _) = solve(&matrix, &b, Stop { tolerance: 1e-14, max_iterations: 20 }).unwrap();
        for i in 0..9 {
            // Half the distance to the nearer end, in spacings; κ ε = 40 × 2e-16.
            assert!((x[i] - 0.5 * (i + 1).min(9 - i) as f64).abs() < 1e-13);
        }
    }

    #[test]
    fn bad_matrices_and_numbers_are_named() {
        let stop = Stop { tolerance: 1e-10, max_iterations: 50 };
        let cause = |matrix: &Sparse, b: &[f64], stop| match solve(matrix, b, stop).unwrap_err() {
            LinearError::Stopped { cause, .. } => cause,
            other => panic!("{other}"),
        };
        let signs = Sparse::from_triplets(2, &[(0, 0, 1.0), (1, 1, -2.0)]);
        let indefinite = cause(&signs, &[1.0, 1.0], stop);
        assert_eq!(indefinite, Cause::Indefinite { what: "p·A p", value: -1.0, whose: "the matrix" });
        let good = matrices::laplacian_1d(2);
        assert!(matches!(cause(&good, &[1.0, f64::NAN], stop), Cause::NotFinite(what) if what.contains("right side")));
        assert_eq!(cause(&good, &[1e-200, 0.0], stop), Cause::Underflow);
        let hole = Sparse::from_triplets(2, &[(0, 0, 1.0), (1, 1, f64::NAN)]);
        assert!(matches!(cause(&hole, &[1.0, 1.0], stop), Cause::NotFinite(_)));
        // Below the rounding of b − A x.
        let large = matrices::laplacian_2d(20, 20, 1.0);
        let b: Vec<f64> = (0..400).map(vector::scattered).collect();
        let strict = Stop { tolerance: 1e-18, max_iterations: 10_000 };
        assert_eq!(cause(&large, &b, strict), Cause::Stagnation);
    }

    #[test]
    fn no_load_needs_no_iteration_and_an_observer_can_stop() {
        let matrix = matrices::laplacian_1d(50);
        let stop = Stop { tolerance: 1e-10, max_iterations: 100 };
        let mut x = vec![3.0; 50];
        let none = vec![0.0; 50];
        let solved =
            conjugate_gradients(&mut &matrix, &mut NoPreconditioner, &none, &mut x, &stop, |_, _| true).unwrap();
        assert_eq!((x, solved.iterations, solved.residual), (none.clone(), 0, 0.0));
        let (b, _) = matrices::with_solution(&matrix);
        let mut seen = Vec::new();
        let mut x = none;
        let stopped = conjugate_gradients(&mut &matrix, &mut NoPreconditioner, &b, &mut x, &stop, |k, residual| {
            seen.push(residual);
            k < 5
        });
        let expected = LinearError::Stopped {
            method: "conjugate gradients",
            iteration: 5,
            residual: seen[4],
            cause: Cause::Interrupted,
        };
        assert_eq!(stopped.unwrap_err(), expected);
        assert_eq!(seen.len(), 5);
    }

    #[test]
    fn threads_change_no_bit() {
        let matrix = matrices::laplacian_2d(200, 200, 1.0);
        let (b, _) = matrices::with_solution(&matrix);
        let runs = matrices::on_threads(|| solve(&matrix, &b, Stop { tolerance: 1e-4, max_iterations: 1000 }).unwrap());
        for run in &runs[1..] {
            assert_eq!(*run, runs[0]);
        }
    }
}
