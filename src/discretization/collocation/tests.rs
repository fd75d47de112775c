use std::f64::consts::PI;

use super::*;
use crate::discretization::quadrature::gauss_legendre;

const HORIZON: f64 = 1.3e-3;

/// Directions and weights on the unit sphere, exact for polynomials of degree below 24.
fn directions<const D: usize>() -> Vec<([f64; D], f64)> {
    let n = 24;
    let circle = || (0..n).map(|k| 2.0 * PI * (f64::from(k) + 0.5) / f64::from(n));
    let vector = |x: [f64; 3]| std::array::from_fn(|d| x[d]);
    let around = 2.0 * PI / f64::from(n);
    match D {
        1 => vec![([1.0; D], 1.0), ([-1.0; D], 1.0)],
        2 => circle().map(|a| (vector([a.cos(), a.sin(), 0.0]), around)).collect(),
        _ => gauss_legendre(12)
            .into_iter()
            .flat_map(|(s, weight)| {
                let z = 2.0 * s - 1.0;
                let rho = (1.0 - z * z).sqrt();
                circle().map(move |a| (vector([rho * a.cos(), rho * a.sin(), z]), 2.0 * weight * around))
            })
            .collect(),
    }
}

/// ∫ f dV and ∫ |f| dV over the ball, f of |ξ| and ξ in m.
fn integrals<const D: usize>(f: impl Fn(f64, &[f64; D]) -> f64) -> (f64, f64) {
    let (mut sum, mut size) = (0.0, 0.0);
    let directions = directions::<D>();
    for (t, radial) in gauss_legendre(12) {
        let r = t * HORIZON;
        for (n, angular) in &directions {
            let term = radial * HORIZON * r.powi(D as i32 - 1) * angular * f(r, &n.map(|n| n * r));
            sum += term;
            size += term.abs();
        }
    }
    (sum, size)
}

const INFLUENCES: [Influence; 3] = [Influence::Constant, Influence::Linear, Influence::Inverted];

fn omega(influence: Influence, t: f64) -> f64 {
    match influence {
        Influence::Constant => 1.0,
        Influence::Linear => 1.0 - t,
        _ => t,
    }
}

/// A lattice of m cells a horizon about the source, each point but the source moved by up to 0.2 spacings a direction.
fn perturbed<const D: usize>(m: f64) -> Vec<Vector<D>> {
    let mut state = 12345_u32;
    let mut jitter = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        0.4 * (f64::from(state >> 8) / f64::from(1 << 24) - 0.5)
    };
    let points = support::ball::<D>(m).into_iter().filter(|step| *step != [0; D]);
    let moved = points.map(|step| step.map(|i| (f64::from(i) + jitter()) * HORIZON / m));
    moved.filter(|xi| norm(xi) <= HORIZON).collect()
}

fn consistent<const D: usize>(order: u32, points: usize, m: f64) {
    let collocation = Collocation::new(order, points);
    let lattice = collocation.on_lattice::<D>(HORIZON / m, HORIZON).unwrap();
    let cloud = collocation.around(&perturbed::<D>(m), HORIZON).unwrap();
    for (name, fit) in [("lattice", lattice), ("cloud", cloud)] {
        // Rounding, at most 2e-13 where this was written; far below κ ε, κ up to 3e4, because the rows solve Mᵀ r = L.
        let check = |what: String, found: f64, (expected, size): (f64, f64)| {
            assert!(
                (found - expected).abs() <= 1e-12 * size,
                "{D}D, order {order}, {name}, {what}: {found} {expected} {size}"
            );
        };
        for influence in INFLUENCES {
            let kernel = |r: f64, q: f64| 2.5 * omega(influence, r / HORIZON) * r.powf(-q);
            let elastic = fit.elastic(&influence, 2.5);
            for p in rows::monomials::<D>(order) {
                let value = |xi: &[f64; D]| monomial(p, xi);
                let less = |xi: &[f64; D]| value(xi) - if p == [0; D] { 1.0 } else { 0.0 };
                for (a, b) in (0..D * D).map(|k| (k / D, k % D)) {
                    let found = fit.xi.iter().zip(&elastic).map(|(xi, w)| w[a][b] * less(xi)).sum();
                    let expected = integrals(|r, xi: &[f64; D]| kernel(r, 3.0) * xi[a] * xi[b] * less(xi));
                    check(format!("{} {p:?} {a}{b}", influence.name()), found, expected);
                }
                for q in 0..=D as u32 {
                    let q = f64::from(q);
                    let diffusive = fit.diffusive(&influence, 2.5, q).unwrap();
                    let found = fit.xi.iter().zip(&diffusive).map(|(xi, w)| w * less(xi)).sum();
                    check(
                        format!("{} {p:?} q = {q}", influence.name()),
                        found,
                        integrals(|r, xi| kernel(r, q) * less(xi)),
                    );
                }
            }
        }
    }
}

#[test]
fn polynomials_on_a_line_are_exact() {
    consistent::<1>(2, 5, 4.0);
    consistent::<1>(4, 11, 12.0);
    consistent::<1>(6, 13, 8.0);
}

#[test]
fn polynomials_in_the_plane_are_exact() {
    consistent::<2>(2, 13, 4.0);
    consistent::<2>(4, 49, 4.0);
    consistent::<2>(6, 81, 6.0);
}

#[test]
fn polynomials_in_space_are_exact() {
    consistent::<3>(2, 33, 4.0);
    consistent::<3>(4, 123, 4.0);
    consistent::<3>(6, 257, 5.0);
}

#[test]
fn the_weight_is_the_printed_one() {
    assert_eq!(weight(16.0, 0.0), 1.0);
    // e⁻⁴ and e⁻¹⁶; e⁻⁶⁴ is below rounding.
    assert!((weight(16.0, 0.5) / 0.018315638888734 - 1.0).abs() < 1e-13);
    assert!((weight(16.0, 1.0) / 1.12535174719e-7 - 1.0).abs() < 1e-11);
    assert_eq!(weight(0.0, 0.7), 1.0);
    // The printed form, (1 − e^(64 − 16 t²))/(1 − e^64), where it can be evaluated.
    for t in [0.1f64, 0.6, 1.0, 1.9] {
        let printed = (1.0 - (64.0 - 16.0 * t * t).exp()) / (1.0 - 64f64.exp());
        assert!((weight(16.0, t) / printed - 1.0).abs() < 1e-12, "{t}");
    }
}

#[test]
fn monomials_stand_in_the_printed_order() {
    let expected =
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 0, 0], [1, 1, 0], [1, 0, 1], [0, 2, 0], [0, 1, 1], [0, 0, 2]];
    assert_eq!(rows::monomials::<3>(2), expected);
    assert_eq!([2, 4, 6].map(|order| rows::monomials::<1>(order).len()), [3, 5, 7]);
    assert_eq!([2, 4, 6].map(|order| rows::monomials::<2>(order).len()), [6, 15, 28]);
    assert_eq!([2, 4, 6].map(|order| rows::monomials::<3>(order).len()), [10, 35, 84]);
}

/// V-C3: the closed forms (51), (52), (59), (60), and their twins in 1D and 2D. Monomials are of ξ/δ: δ² less.
#[test]
fn rows_of_order_two_are_the_printed_ones() {
    let (c, d) = (2.5, HORIZON);
    let near =
        |found: f64, expected: f64| assert!((found - expected).abs() <= 1e-14 * expected.abs(), "{found} {expected}");
    let third = 1.0 / 3.0;
    for (influence, line, plane, space) in [
        (Influence::Constant, 1.0, 4.0, 5.0),
        (Influence::Linear, 3.0, 16.0, 25.0),
        (Influence::Inverted, 1.5, 16.0 / 3.0, 25.0 / 4.0),
    ] {
        near(rows::elastic([2], &influence, c, d)[0][0], c / line);
        let alpha = PI * c * d / plane;
        let printed = [
            ([2, 0], [[1.0, 0.0], [0.0, third]]),
            ([1, 1], [[0.0, third], [third, 0.0]]),
            ([0, 2], [[third, 0.0], [0.0, 1.0]]),
        ];
        for (p, row) in printed {
            let found = rows::elastic(p, &influence, c, d);
            (0..4).for_each(|k| near(found[k / 2][k % 2], alpha * row[k / 2][k % 2]));
        }
        let alpha = PI * c * d.powi(2) / space;
        let printed = [
            ([2, 0, 0], [[1.0, 0.0, 0.0], [0.0, third, 0.0], [0.0, 0.0, third]]),
            ([1, 1, 0], [[0.0, third, 0.0], [third, 0.0, 0.0], [0.0; 3]]),
            ([0, 1, 1], [[0.0; 3], [0.0, 0.0, third], [0.0, third, 0.0]]),
            ([0, 0, 1], [[0.0; 3]; 3]),
        ];
        for (p, row) in printed {
            let found = rows::elastic(p, &influence, c, d);
            (0..9).for_each(|k| near(found[k / 3][k % 3], alpha * row[k / 3][k % 3]));
        }
    }
    for q in [0.0, 0.5, 1.0, 2.0, 3.0] {
        let plane = PI * c * d.powf(2.0 - q) / (4.0 - q);
        let space = 4.0 * PI * c * d.powf(3.0 - q) / (3.0 * (5.0 - q));
        for p in [[2, 0], [0, 2]] {
            near(rows::diffusive(p, &Influence::Constant, c, q, d), plane);
            near(rows::diffusive(p, &Influence::Linear, c, q, d), plane / (5.0 - q));
        }
        for p in [[2, 0, 0], [0, 2, 0], [0, 0, 2]] {
            near(rows::diffusive(p, &Influence::Constant, c, q, d), space);
            near(
                rows::diffusive(p, &Influence::Linear, c, q, d),
                4.0 * PI * c * d.powf(3.0 - q) / (3.0 * q * q - 33.0 * q + 90.0),
            );
        }
    }
    assert_eq!(rows::diffusive([1, 1], &Influence::Constant, c, 1.0, d), 0.0);
}

/// Order 2 with five points is almost a difference over half the horizon.
#[test]
fn five_points_on_a_line_have_the_known_weights() {
    let fit = Collocation::new(2, 5).on_lattice::<1>(0.125, 1.0).unwrap();
    assert_eq!(fit.steps, Some(vec![[-8], [-4], [4], [8]]));
    let weights = fit.elastic(&Influence::Constant, 2.0);
    // An independent script, as printed: E = δ = 1.
    for (weight, (expected, digit)) in
        weights.iter().zip([(1.01e-4, 5e-7), (3.9996, 5e-5), (3.9996, 5e-5), (1.01e-4, 5e-7)])
    {
        assert!((weight[0][0] - expected).abs() <= digit, "{weights:?}");
    }
}

/// Of a lattice, to the last bit: point symmetry, mirroring, exchange of axes and of indices.
#[test]
fn weights_of_a_lattice_are_symmetric_to_the_last_bit() {
    let fit = Collocation::new(4, 123).on_lattice::<3>(HORIZON / 4.0, HORIZON).unwrap();
    let steps = fit.steps.clone().unwrap();
    let elastic = fit.elastic(&Influence::Linear, 1.0);
    let diffusive = fit.diffusive(&Influence::Linear, 1.0, 1.0).unwrap();
    let at = |step: [i32; 3]| steps.iter().position(|s| *s == step).unwrap();
    for (j, &[x, y, z]) in steps.iter().enumerate() {
        let (mirrored, turned, opposite) = (at([-x, y, z]), at([y, z, x]), at([-x, -y, -z]));
        assert!([mirrored, turned, opposite].iter().all(|&k| diffusive[k] == diffusive[j]));
        assert_eq!(elastic[j], elastic[opposite]);
        for (a, b) in (0..9).map(|k| (k / 3, k % 3)) {
            let sign = if (a == 0) == (b == 0) { 1.0 } else { -1.0 };
            assert_eq!(elastic[mirrored][a][b], sign * elastic[j][a][b]);
            assert_eq!(elastic[turned][(a + 2) % 3][(b + 2) % 3], elastic[j][a][b]);
            assert_eq!(elastic[j][a][b], elastic[j][b][a]);
        }
    }
}

#[test]
fn fitted_polynomials_are_themselves_everywhere() {
    let fit = Collocation::new(4, 49).around(&perturbed::<2>(4.0), HORIZON).unwrap();
    for place in [[0.0, 0.0], [0.3, -0.8], [-0.6, 0.1]] {
        let xi = place.map(|x: f64| x * HORIZON);
        let shapes = fit.shape_functions(&xi);
        for p in rows::monomials::<2>(4) {
            let scaled = |xi: &Vector<2>| monomial(p, &xi.map(|x| x / HORIZON));
            let at = std::iter::once([0.0; 2]).chain(fit.xi.iter().copied());
            let sum: f64 = at.zip(&shapes).map(|(xi, n)| n * scaled(&xi)).sum();
            // Rounding of some fifty terms near 1.
            assert!((sum - scaled(&xi)).abs() < 1e-12, "{place:?} {p:?}: {sum}");
        }
    }
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let error = |fit: Result<Fit<2>>| fit.unwrap_err().to_string();
    let lattice = |order, points| Collocation::new(order, points).on_lattice::<2>(1.0, 4.0);
    assert!(error(lattice(3, 13)).contains("got 3"));
    assert!(error(lattice(4, 13)).contains("fits 15 monomials in 2D; of 13 points asked for 13"));
    assert!(error(Collocation { exponent: -1.0, ..Collocation::new(2, 13) }.on_lattice(1.0, 4.0)).contains("got -1"));
    // All on one line.
    let line: Vec<[f64; 2]> = (-8..=8).filter(|i| *i != 0).map(|i| [f64::from(i) / 8.0, 0.0]).collect();
    assert!(error(Collocation::new(2, 29).around(&line, 1.0)).contains("do not fix a polynomial"));
    let fit = lattice(2, 13).unwrap();
    assert!(fit.diffusive(&Influence::Constant, 1.0, 3.9).is_ok());
    assert!(fit.diffusive(&Influence::Constant, 1.0, 4.0).unwrap_err().to_string().contains("q = 4"));
}

/// Sets of points that ties make larger than asked for.
#[test]
fn ties_on_a_lattice_are_taken_together() {
    // An independent script.
    assert_eq!(Collocation::new(2, 29).on_lattice::<2>(1.0, 4.0).unwrap().found, 33);
    assert_eq!(Collocation::new(2, 33).on_lattice::<3>(1.0, 3.0).unwrap().found, 49);
    assert_eq!(Collocation::new(2, 33).on_lattice::<3>(1.0, 4.0).unwrap().found, 33);
}
