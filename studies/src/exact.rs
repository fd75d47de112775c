//! Closed forms of waves: what the studies compare with. Classical ones, and those of the nonlocal bar.

use bondwise::discretization::Influence;
use bondwise::discretization::quadrature::gauss_legendre;

/// Cin(z) = ∫₀^z (1 − cos t)/t dt = γ + ln z − Ci(z).
///
/// By Gauss–Legendre quadrature of 2 sin²(t/2)/t over pieces no longer than 1: nothing cancels at any z ≥ 0.
pub fn cin(z: f64) -> f64 {
    let pieces = z.ceil().max(1.0);
    let width = z / pieces;
    let rule = gauss_legendre(12);
    let integrand = |t: f64| if t > 0.0 { 2.0 * (0.5 * t).sin().powi(2) / t } else { 0.0 };
    (0..pieces as usize)
        .map(|i| rule.iter().map(|&(x, weight)| weight * width * integrand(width * (i as f64 + x))).sum::<f64>())
        .sum()
}

/// ρω²/(E k²) of the wave e^{i(kx − ωt)} in an infinite bar of the linear bond-based law; z = kδ. The classical bar
/// has 1. None for influence functions whose relation is not written down here.
///
/// ```text
/// ρω² = 2 c ∫₀^δ ω(ξ/δ) (1 − cos kξ)/ξ dξ
///     = (4E/δ²)  Cin(z)                       constant,       c = 2E/δ²
///     = (12E/δ²) [Cin(z) − 1 + sin z/z]       linear,         c = 6E/δ²
///     = (6E/δ²)  [1 − sin z/z]                inverted,       c = 3E/δ²
/// ```
///
/// The integral: Silling & Askari 2005 with the micromoduli of Bobaru et al. 2009, eqs. (14), (18), (21).
pub fn bar_dispersion(influence: &Influence, z: f64) -> Option<f64> {
    let bulge = 1.0 - z.sin() / z;
    match influence {
        Influence::Constant => Some(4.0 * cin(z) / (z * z)),
        Influence::Linear => Some(12.0 * (cin(z) - bulge) / (z * z)),
        Influence::Inverted => Some(6.0 * bulge / (z * z)),
        _ => None,
    }
}

/// Leading relative error of the one-point rule in [`bar_dispersion`], for an integer horizon ratio m = δ/h and cells
/// that count as far as they lie inside the horizon.
///
/// The rule is then the trapezoidal one on [0, δ], whose error is (h²/12) [F′(δ) − F′(0)] with F the integrand
/// (Euler and Maclaurin), so that the order in h at fixed δ is 2; what follows is of order h⁴.
pub fn bar_quadrature_error(influence: &Influence, z: f64, m: f64) -> Option<f64> {
    // F with ξ in units of δ; ∫₀¹ F = ratio z²/(2 c δ²/E).
    let (slopes, constant) = match influence {
        Influence::Constant => (z * z.sin() - (1.0 - z.cos()) - 0.5 * z * z, 4.0),
        Influence::Linear => (-(1.0 - z.cos()) - 0.5 * z * z, 12.0),
        Influence::Inverted => (z * z.sin(), 6.0),
        _ => return None,
    };
    let integral = bar_dispersion(influence, z)? * z * z / constant;
    Some(slopes / (12.0 * m * m) / integral)
}

/// Displacement of a bar from −`half` to `half` with free ends, released at rest from `shape`: d'Alembert's two
/// halves, ½ f(x − ct) + ½ f(x + ct), with f continued evenly over the ends.
pub fn dalembert(shape: impl Fn(f64) -> f64, half: f64, speed: f64, x: f64, t: f64) -> f64 {
    let folded = |x: f64| {
        let y = (x + half).rem_euclid(4.0 * half);
        shape(y.min(4.0 * half - y) - half)
    };
    0.5 * (folded(x - speed * t) + folded(x + speed * t))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cin_is_its_power_series() {
        // Σ (−1)^{n+1} z^{2n}/(2n (2n)!): its largest term is below e^z, which bounds the digits that it loses.
        for z in [1e-6, 0.1, 1.0, 2.5, 6.0, 12.0_f64] {
            let (mut term, mut sum) = (1.0, 0.0);
            for n in 1..60 {
                let k = 2.0 * f64::from(n);
                term *= -z * z / (k * (k - 1.0));
                sum -= term / k;
            }
            let tolerance = 1e-15 * (10.0 * sum + z.exp() * z.min(1.0));
            assert!((cin(z) - sum).abs() < tolerance, "{z}: {} {sum}", cin(z));
        }
        // γ + ln z − Ci(z); Ci(1) from Abramowitz & Stegun 1964, table 5.1.
        assert!((cin(1.0) - (0.577_215_664_9 - 0.337_403_922_9)).abs() < 2e-10);
    }

    #[test]
    fn long_waves_run_at_the_speed_of_the_classical_bar() {
        // The next term is z² times ¼ ∫ω t³ / (3 ∫ω t): 1/24, 1/40, 1/20.
        for (influence, next) in [(Influence::Constant, 24.0), (Influence::Linear, 40.0), (Influence::Inverted, 20.0)] {
            let z: f64 = 0.1;
            let ratio = bar_dispersion(&influence, z).unwrap();
            // z⁴/1080 and less is left out.
            assert!((ratio - (1.0 - z * z / next)).abs() < 2e-7, "{}: {ratio}", influence.name());
        }
        assert_eq!(bar_dispersion(&Influence::Cubic, 1.0), None);
    }

    #[test]
    fn a_pulse_is_doubled_at_a_free_end_and_comes_back() {
        let pulse = |x: f64| (-(x / 0.05).powi(2)).exp();
        let at = |x, t| dalembert(pulse, 0.5, 2.0, x, t);
        assert!((at(0.0, 0.0) - 1.0).abs() < 1e-15);
        assert!((at(0.25, 0.125) - 0.5).abs() < 1e-15);
        assert!((at(0.5, 0.25) - 1.0).abs() < 1e-15);
        assert!((at(0.25, 0.375) - 0.5).abs() < 1e-15);
        assert!((at(0.0, 0.5) - 1.0).abs() < 1e-15);
    }
}
