//! BiCGSTAB with right preconditioning, for general matrices in little memory.

use super::krylov::Monitor;
use super::{Cause, LinearError, LinearOperator, Preconditioner, Solved, Stop, vector};

/// Breakdowns, and residuals that prove larger than the recurrence knew, that are answered by a restart.
const RESTARTS: usize = 5;

/// A product of vectors below ε times their sizes is rounding only.
const VANISHES: f64 = f64::EPSILON;

/// Solves A x = b for a general A (van der Vorst 1992; Madenci et al. 2019, Appendix B, from k = 1 on):
/// ρ = r̃·r, p = r + β (p − ω v) with β = ρ/ρ_old α/ω, v = A M⁻¹ p, α = ρ/r̃·v, s = r − α v, t = A M⁻¹ s,
/// ω = t·s/t·t, x += M⁻¹ (α p + ω s), r = s − ω t. Two products an iteration.
///
/// When ρ, r̃·v or ω vanishes against its factors, the method starts anew from the current residual: first with r̃ = r,
/// then with a shadow r̃ that leans from r in a fixed direction without a pattern, since r̃ = r may meet the
/// same zero again (r·A r = 0 for a rotation). A rotation by 90° makes ω = 0 for every r̃: use [`super::gmres()`].
///
/// `x` and `observe`: as in [`super::conjugate_gradients()`].
///
/// # Errors
/// No convergence, numbers that are not finite, a breakdown that restarts do not mend (named), an interruption, or a
/// tolerance that rounding puts out of reach.
pub fn bicgstab(
    a: &mut (impl LinearOperator + ?Sized),
    m: &mut (impl Preconditioner + ?Sized),
    b: &[f64],
    x: &mut [f64],
    stop: &Stop,
    observe: impl FnMut(usize, f64) -> bool,
) -> Result<Solved, LinearError> {
    let Some(mut monitor) = Monitor::start("BiCGSTAB", a.size(), b, x, stop, observe)? else {
        return Ok(Solved::at_rest(x));
    };
    let [mut r, mut shadow, mut p, mut p_hat, mut v, mut s_hat, mut t] = std::array::from_fn(|_| vec![0.0; b.len()]);
    let mut why = None;
    for restart in 0..=RESTARTS {
        let (size, done) = monitor.residual(a, b, x, &mut r)?;
        if done {
            return Ok(monitor.solved(size));
        }
        shadow.copy_from_slice(&r);
        if restart > 1 {
            lean(&mut shadow, size, restart);
        }
        let shadow_size = vector::norm(&shadow);
        let mut r_size = size;
        let (mut rho_old, mut alpha, mut omega) = (1.0, 1.0, 1.0);
        p.fill(0.0);
        v.fill(0.0);
        why = loop {
            monitor.begin()?;
            let rho = monitor.finite("ρ = r̃·r", vector::dot(&shadow, &r))?;
            if rho.abs() <= VANISHES * shadow_size * r_size {
                break Some("ρ = r̃·r");
            }
            let beta = rho / rho_old * (alpha / omega);
            vector::add(-omega, &v, &mut p);
            vector::scale_and_add(beta, &r, &mut p);
            m.apply(&p, &mut p_hat);
            a.apply(&p_hat, &mut v);
            let shadow_v = monitor.finite("r̃·v", vector::dot(&shadow, &v))?;
            if shadow_v.abs() <= VANISHES * shadow_size * vector::norm(&v) {
                break Some("r̃·v");
            }
            alpha = rho / shadow_v;
            // From here r is s, the residual of half the iteration.
            vector::add(-alpha, &v, &mut r);
            let s_size = vector::norm(&r);
            if monitor.small(s_size) {
                vector::add(alpha, &p_hat, x);
                monitor.end(s_size)?;
                break None;
            }
            m.apply(&r, &mut s_hat);
            a.apply(&s_hat, &mut t);
            let ts = monitor.finite("t·s", vector::dot(&t, &r))?;
            let t_size = vector::norm(&t);
            if ts.abs() <= VANISHES * t_size * s_size {
                if s_size < r_size {
                    vector::add(alpha, &p_hat, x);
                }
                break Some("ω = t·s/t·t");
            }
            omega = ts / (t_size * t_size);
            vector::add(alpha, &p_hat, x);
            vector::add(omega, &s_hat, x);
            vector::add(-omega, &t, &mut r);
            rho_old = rho;
            r_size = vector::norm(&r);
            if monitor.end(r_size)? {
                break None;
            }
        };
    }
    match monitor.residual(a, b, x, &mut r)? {
        (size, true) => Ok(monitor.solved(size)),
        (_, false) => Err(monitor.fail(match why {
            Some(what) => Cause::Breakdown { what, restarts: RESTARTS },
            None => Cause::Stagnation,
        })),
    }
}

/// Adds a vector of about the same size that has no pattern, another one for each restart.
fn lean(shadow: &mut [f64], size: f64, restart: usize) {
    let n = shadow.len();
    let share = size / (n as f64 / 3.0).sqrt();
    vector::fill(shadow, |start, shadow| {
        for (k, shadow) in shadow.iter_mut().enumerate() {
            *shadow += share * vector::scattered(restart * n + start + k);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::{Direct, NoPreconditioner, Sparse, matrices};
    use super::*;

    fn solve(matrix: &Sparse, b: &[f64], tolerance: f64) -> Result<(Vec<f64>, Solved), LinearError> {
        let mut x = vec![0.0; b.len()];
        let stop = Stop { tolerance, max_iterations: 1000 };
        let solved = bicgstab(&mut &*matrix, &mut NoPreconditioner, b, &mut x, &stop, |_, _| true)?;
        Ok((x, solved))
    }

    #[test]
    fn a_matrix_without_symmetry_and_laplacians_agree_with_the_direct_solution() {
        // The error is at most κ times the residual: 4,134 in 1D, less in 2D. A dominant matrix has |A⁻¹| ≤ 1 and
        // |A| ≤ 2 max a_ii < 18.
        let list = [(matrices::dominant(500), 18.0), (matrices::laplacian_1d(100), 4200.0)];
        for (matrix, condition) in list.into_iter().chain([(matrices::laplacian_2d(30, 20, 1.0), 4200.0)]) {
            let b: Vec<f64> = (0..matrix.size()).map(vector::scattered).collect();
            let (x, solved) = solve(&matrix, &b, 1e-11).unwrap();
            let mut exact = b.clone();
            Direct::lu(&matrix).unwrap().solve(&mut exact).unwrap();
            // √n more, since the bound of the dominant matrix is in the largest component.
            assert!(matrices::difference(&x, &exact) < condition * 500f64.sqrt() * 1e-11);
            assert!(solved.residual <= 1e-11);
        }
    }

    fn full<const N: usize>(rows: &[[f64; N]; N]) -> Sparse {
        let entries = rows
            .iter()
            .enumerate()
            .flat_map(|(i, row)| row.iter().enumerate().map(move |(j, value)| (i as u32, j as u32, *value)));
        Sparse::from_triplets(N, &entries.collect::<Vec<_>>())
    }

    #[test]
    fn breakdowns_are_mended_or_named() {
        // ω = 0 in the first iteration: s is along (−1, 2), s·A s = 0.
        let signs = Sparse::from_triplets(2, &[(0, 0, 4.0), (1, 1, -1.0)]);
        let (x, solved) = solve(&signs, &[2.0, 1.0], 1e-12).unwrap();
        // κ = 4.
        assert!(matrices::difference(&x, &[0.5, -1.0]) < 4e-12, "{x:?}");
        assert!(solved.iterations > 0);
        // ρ = 0 after the first iteration, exactly, but r̃·A r = −0.6: r = (0, −0.4, 0.2) is orthogonal to b.
        let steps = [[1.0, 1.0, -1.0], [1.0, 2.0, 0.0], [1.0, 1.0, 3.0]];
        let (x, _) = solve(&full(&steps), &[1.0, 0.0, 0.0], 1e-12).unwrap();
        // |A| |A⁻¹| in the Frobenius norm: 4.4 × 2.3.
        assert!(matrices::difference(&x, &[1.5, -0.75, -0.25]) < 1.1e-11, "{x:?}");
        // r·A r = 0: breakdown of r̃·v with r̃ = r, mended by another shadow, for a permutation that is not skew.
        let cycle = Sparse::from_triplets(3, &[(0, 1, 1.0), (1, 2, 1.0), (2, 0, 1.0)]);
        let (x, _) = solve(&cycle, &[1.0, 0.0, 0.0], 1e-12).unwrap();
        // κ = 1, and a few roundings.
        assert!(matrices::difference(&x, &[0.0, 1.0, 0.0]) < 2e-12, "{x:?}");
        // A rotation: s·A s = 0 for every s.
        let rotation = Sparse::from_triplets(2, &[(0, 1, 1.0), (1, 0, -1.0)]);
        match solve(&rotation, &[1.0, 0.0], 1e-12).unwrap_err() {
            LinearError::Stopped { cause: Cause::Breakdown { what, restarts }, .. } => {
                assert_eq!((what, restarts), ("ω = t·s/t·t", RESTARTS));
            }
            other => panic!("{other}"),
        }
    }

    #[test]
    fn bad_numbers_are_named() {
        let matrix = matrices::laplacian_1d(3);
        let error = solve(&matrix, &[1.0, f64::NAN, 0.0], 1e-8).unwrap_err();
        assert!(error.to_string().contains("right side"), "{error}");
        let hole = Sparse::from_triplets(2, &[(0, 0, 1.0), (0, 1, f64::INFINITY), (1, 1, 1.0)]);
        let error = solve(&hole, &[1.0, 1.0], 1e-8).unwrap_err();
        assert!(error.to_string().contains("not a finite number"), "{error}");
    }

    #[test]
    fn threads_change_no_bit() {
        let matrix = matrices::laplacian_2d(200, 200, 1.0);
        let (b, _) = matrices::with_solution(&matrix);
        let runs = matrices::on_threads(|| solve(&matrix, &b, 1e-4).unwrap());
        for run in &runs[1..] {
            assert_eq!(*run, runs[0]);
        }
    }
}
