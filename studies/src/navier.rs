//! The local limit: on quadratic displacements the bond-based operator is the Navier operator.
//!
//! ∫ ω c (ξ ⊗ ξ)/|ξ|³ (u(x + ξ) − u(x)) dV = (λ + μ) ∇(∇·u) + μ Δu for every quadratic u, whatever the horizon, with the
//! Poisson ratio that the theory fixes. The linear law of the program is integrated over the ball, bond by bond, for
//! every quadratic monomial in every component.

use std::f64::consts::PI;

use super::{Measure, Outcome, Row};
use bondwise::discretization::influence::Influence;
use bondwise::discretization::quadrature::gauss_legendre;
use bondwise::error::Result;
use bondwise::family::{Bond, BondLaw};
use bondwise::physics::elasticity::laws::BondBasedLinear;
use bondwise::physics::elasticity::moduli::{Hypothesis, micromodulus};

const YOUNG: f64 = 72e9;
const HORIZON: f64 = 1e-3;

const ORIGIN: &str = "Navier operator with ν = 1/3 in plane stress, 1/4 in plane strain and 3D (Shojaei et al. 2022, \
    eqs. (16), (17)); the tolerance is the round-off of a sum over some ten thousand bonds";

pub fn run(_full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    rows::<1>(Hypothesis::Bar, &mut outcome);
    rows::<2>(Hypothesis::PlaneStress, &mut outcome);
    rows::<2>(Hypothesis::PlaneStrain, &mut outcome);
    rows::<3>(Hypothesis::Solid, &mut outcome);
    Ok(outcome)
}

/// u = x_a x_b e_j, and the component i of L u.
#[derive(Clone, Copy)]
struct Entry {
    i: usize,
    a: usize,
    b: usize,
    j: usize,
}

fn rows<const D: usize>(hypothesis: Hypothesis, outcome: &mut Outcome) {
    let tolerance = 1e-12;
    let named = [
        ("L₁(x² e₁)/E", Entry { i: 0, a: 0, b: 0, j: 0 }),
        ("L₁(y² e₁)/E", Entry { i: 0, a: 1, b: 1, j: 0 }),
        ("L₁(x y e₂)/E", Entry { i: 0, a: 0, b: 1, j: 1 }),
    ];
    for (name, entry) in named.into_iter().filter(|(_, e)| e.b < D) {
        let what = format!("{}: {name}", hypothesis.name());
        let found = integrated::<D>(hypothesis, &Influence::Constant, entry);
        outcome.rows.push(Row::new(what, navier::<D>(hypothesis, entry), found, tolerance, Measure::Absolute, ORIGIN));
    }
    let (mut largest, mut count) = (0.0f64, 0);
    for influence in Influence::ALL {
        for (i, j) in (0..D * D).map(|k| (k / D, k % D)) {
            for (a, b) in (0..D).flat_map(|a| (a..D).map(move |b| (a, b))) {
                let entry = Entry { i, a, b, j };
                let difference = integrated::<D>(hypothesis, &influence, entry) - navier::<D>(hypothesis, entry);
                // Not `max`, which would lose a NaN.
                if difference.abs() > largest || difference.is_nan() {
                    largest = difference.abs();
                }
                count += 1;
            }
        }
    }
    let what = format!(
        "{}: largest difference over E of {count} entries ({} influence functions)",
        hypothesis.name(),
        Influence::ALL.len()
    );
    outcome.rows.push(Row::new(what, 0.0, largest, tolerance, Measure::Absolute, ORIGIN));
}

/// The exact entry over E: (λ + μ) ∂ᵢ∂ⱼ(x_a x_b) + μ δᵢⱼ Δ(x_a x_b).
fn navier<const D: usize>(hypothesis: Hypothesis, Entry { i, a, b, j }: Entry) -> f64 {
    let (lambda, mu) = match hypothesis {
        Hypothesis::Bar => (1.0, 0.0),
        Hypothesis::PlaneStress => ((1.0 / 3.0) / (1.0 - 1.0 / 9.0), 1.0 / (2.0 * (1.0 + 1.0 / 3.0))),
        Hypothesis::PlaneStrain | Hypothesis::Solid => (0.25 / (1.25 * 0.5), 1.0 / (2.0 * 1.25)),
    };
    let is = |p: bool| if p { 1.0 } else { 0.0 };
    let second = |p: usize, q: usize| is(p == a && q == b) + is(p == b && q == a);
    let laplacian: f64 = (0..D).map(|d| second(d, d)).sum();
    (lambda + mu) * second(i, j) + is(i == j) * mu * laplacian
}

/// The same entry from the program's linear law, integrated over the ball.
fn integrated<const D: usize>(hypothesis: Hypothesis, influence: &Influence, entry: Entry) -> f64 {
    let c = micromodulus(hypothesis, influence, YOUNG, HORIZON);
    let directions = directions::<D>(12);
    let mut sum = 0.0;
    // The integrand is ω times a polynomial; the Gaussian needs the most points.
    for (t, radial) in gauss_legendre(24) {
        let shell = radial * HORIZON * (t * HORIZON).powi(D as i32 - 1);
        for (n, angular) in &directions {
            let xi = n.map(|n| n * t * HORIZON);
            let weight = c * influence.value(t) * shell * angular;
            let bond = Bond::new(xi, t * HORIZON, weight);
            let mut eta = [0.0; D];
            eta[entry.j] = xi[entry.a] * xi[entry.b];
            let strain = BondBasedLinear.strain(&bond, &eta);
            let force = BondBasedLinear.force(&bond, &eta, strain, [0.0; D]);
            sum += force[entry.i];
        }
    }
    sum / YOUNG
}

/// Directions and weights of a rule on the unit sphere that is exact for powers below `around`, even.
pub(super) fn directions<const D: usize>(around: usize) -> Vec<([f64; D], f64)> {
    let circle = (0..around).map(|k| 2.0 * PI * (k as f64 + 0.5) / around as f64);
    let vector = |x: [f64; 3]| std::array::from_fn(|d| x[d]);
    match D {
        1 => vec![(vector([1.0, 0.0, 0.0]), 1.0), (vector([-1.0, 0.0, 0.0]), 1.0)],
        2 => circle.map(|a| (vector([a.cos(), a.sin(), 0.0]), 2.0 * PI / around as f64)).collect(),
        _ => gauss_legendre(around / 2)
            .into_iter()
            .flat_map(|(s, weight)| {
                let z = 2.0 * s - 1.0;
                let rho = (1.0 - z * z).sqrt();
                let ring = circle.clone();
                ring.map(move |a| (vector([rho * a.cos(), rho * a.sin(), z]), 2.0 * weight * 2.0 * PI / around as f64))
            })
            .collect(),
    }
}
