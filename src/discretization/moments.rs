//! Moments of a kernel over the ball: the one formula from which every continuous constant follows.
//!
//! In D dimensions an integral of ω |ξ|^−q times a monomial of ξ over the ball |ξ| < δ splits into
//! a radial part, known to the influence function, and an angular part, known in Gamma functions.
//! Micromoduli, fracture energies, micro-diffusivities, weighted volumes and the right-hand sides
//! of collocation rows are all such integrals.
//!
//! Deliberately absent: sums over the points of a family, which approximate these integrals
//! (`standard.rs`).

use super::influence::Influence;

/// Moment of a kernel over the ball of radius δ,
///
/// ```text
/// ∫ ω(|ξ|/δ) |ξ|^−q ξ₁^a ξ₂^b ξ₃^c dV  =  S(a, b, c) δ^(p+1) R(p),    p = a + b + c + D − 1 − q
/// ```
///
/// with S the sphere moment ([`sphere_moment`]) and R the radial moment of ω. Zero if any exponent
/// is odd. Infinite where the integral diverges at ξ = 0. Unit: m^(p+1).
pub fn ball_moment<const D: usize>(influence: &Influence, exponents: [u32; D], q: f64, horizon: f64) -> f64 {
    if exponents.iter().any(|a| a % 2 == 1) { 0.0 } else { absolute_ball_moment(influence, exponents, q, horizon) }
}

/// The same with |ξ₁|^a |ξ₂|^b |ξ₃|^c in place of the monomial, so that odd exponents count too.
///
/// ∫ ω |ξ| |ξ₁| dV is what all bonds that cross a plane hold together, the integral behind the
/// fracture energy.
pub fn absolute_ball_moment<const D: usize>(influence: &Influence, exponents: [u32; D], q: f64, horizon: f64) -> f64 {
    let p = f64::from(exponents.iter().sum::<u32>()) + D as f64 - 1.0 - q;
    sphere_moment(exponents) * horizon.powf(p + 1.0) * influence.radial_moment(p)
}

/// Moment of the unit sphere, ∫ |n₁|^a |n₂|^b |n₃|^c dS = 2 Π Γ((aᵢ+1)/2) / Γ(Σ (aᵢ+1)/2).
///
/// In 1D the "sphere" is the two points ±1, in 2D the circle.
pub fn sphere_moment<const D: usize>(exponents: [u32; D]) -> f64 {
    let product: f64 = exponents.iter().map(|a| gamma_of_half(a + 1)).product();
    2.0 * product / gamma_of_half(exponents.iter().map(|a| a + 1).sum())
}

/// Γ(n/2) for n ≥ 1, from Γ(1/2) = √π, Γ(1) = 1 and Γ(x + 1) = x Γ(x).
fn gamma_of_half(n: u32) -> f64 {
    let (start, first) = if n % 2 == 1 { (std::f64::consts::PI.sqrt(), 1) } else { (1.0, 2) };
    (first..n).step_by(2).fold(start, |gamma, k| gamma * 0.5 * f64::from(k))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::quadrature::integrate;
    use std::f64::consts::PI;

    const HORIZON: f64 = 1.7;

    /// ∫ over the ball in polar coordinates; `f` gets |ξ| and ξ padded with zeros.
    fn brute_force(dimension: usize, f: impl Fn(f64, [f64; 3]) -> f64) -> f64 {
        // Angles in quarter circles, where |cos| and |sin| are smooth.
        let quarters = |g: &dyn Fn(f64) -> f64, n: i32| -> f64 {
            (0..n).map(|k| integrate(g, 0.5 * PI * f64::from(k), 0.5 * PI * f64::from(k + 1), 12)).sum()
        };
        let at_radius = |r: f64| match dimension {
            1 => f(r, [r, 0.0, 0.0]) + f(r, [-r, 0.0, 0.0]),
            2 => quarters(&|a| r * f(r, [r * a.cos(), r * a.sin(), 0.0]), 4),
            _ => quarters(
                &|polar| {
                    let (z, rho) = (r * polar.cos(), r * polar.sin());
                    quarters(&|a| r * rho * f(r, [rho * a.cos(), rho * a.sin(), z]), 4)
                },
                2,
            ),
        };
        integrate(at_radius, 0.0, HORIZON, 24)
    }

    fn compare<const D: usize>(exponents: &[[u32; D]]) {
        for influence in Influence::ALL {
            for exponents in exponents {
                for q in [-1.0, 0.0, 1.0, 2.0, 3.0] {
                    // Gauss–Legendre needs a bounded integrand.
                    if f64::from(exponents.iter().sum::<u32>()) + (D as f64) - 1.0 < q {
                        continue;
                    }
                    let kernel = |r: f64| influence.value(r / HORIZON) * r.powf(-q);
                    let monomial = |xi: [f64; 3]| (0..D).map(|i| xi[i].powi(exponents[i] as i32)).product::<f64>();
                    let signed = brute_force(D, |r, xi| kernel(r) * monomial(xi));
                    let absolute = brute_force(D, |r, xi| kernel(r) * monomial(xi).abs());
                    let tolerance = 1e-12 * absolute;
                    let label = format!("{} {exponents:?} q={q}", influence.name());
                    let moment = ball_moment(&influence, *exponents, q, HORIZON);
                    assert!((moment - signed).abs() < tolerance, "{label}: {moment} against {signed}");
                    let moment = absolute_ball_moment(&influence, *exponents, q, HORIZON);
                    assert!((moment - absolute).abs() < tolerance, "{label}: {moment} against {absolute}");
                }
            }
        }
    }

    #[test]
    fn moments_in_one_dimension_are_the_integrals() {
        compare(&[[0], [1], [2], [3], [4], [6]]);
    }

    #[test]
    fn moments_in_two_dimensions_are_the_integrals() {
        compare(&[[0, 0], [1, 0], [1, 1], [2, 0], [0, 2], [2, 2], [4, 0], [3, 1], [6, 2]]);
    }

    #[test]
    fn moments_in_three_dimensions_are_the_integrals() {
        compare(&[[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 2, 2], [2, 1, 1], [4, 0, 2], [2, 2, 2]]);
    }

    #[test]
    fn divergent_moments_are_infinite() {
        assert_eq!(ball_moment(&Influence::Constant, [2], 3.0, HORIZON), f64::INFINITY);
        let finite = ball_moment(&Influence::Inverted, [2], 3.0, HORIZON);
        assert!((finite - 2.0).abs() < 1e-14, "{finite}");
    }
}
