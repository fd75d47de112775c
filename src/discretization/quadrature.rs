//! Gauss–Legendre rules: the integrals that have no closed form, and the independent check of those
//! that have one.

use std::f64::consts::PI;

/// Points and weights of the rule with `n` points on [0, 1], exact for polynomials up to degree 2n
/// − 1.
///
/// The roots of the Legendre polynomial Pₙ by Newton's method from Tricomi's estimate; w = 1/((1 −
/// x²) P′ₙ(x)²) on the unit interval.
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let mut rule = vec![(0.5, 0.0); n];
    for i in 0..n.div_ceil(2) {
        let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 1.0;
        // Newton doubles the digits of an estimate that is good to three: five steps are one or two
        // too many.
        for _ in 0..5 {
            let (value, derivative) = legendre(n, x);
            slope = derivative;
            x -= value / derivative;
        }
        let weight = 1.0 / ((1.0 - x * x) * slope * slope);
        rule[i] = (0.5 * (1.0 - x), weight);
        rule[n - 1 - i] = (0.5 * (1.0 + x), weight);
    }
    rule
}

/// Pₙ(x) and its derivative by the three-term recurrence.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut previous, mut current) = (1.0, x);
    for k in 2..=n {
        let k = k as f64;
        (previous, current) = (current, ((2.0 * k - 1.0) * x * current - (k - 1.0) * previous) / k);
    }
    (current, n as f64 * (x * current - previous) / (x * x - 1.0))
}

/// ∫ f from `low` to `high` with `n` points, at most 40.
pub fn integrate(f: impl Fn(f64) -> f64, low: f64, high: f64, n: usize) -> f64 {
    use std::sync::OnceLock;
    // Kept, because nested integrals ask for the same rule at every point.
    static RULES: [OnceLock<Vec<(f64, f64)>>; 41] = [const { OnceLock::new() }; 41];
    let width = high - low;
    RULES[n].get_or_init(|| gauss_legendre(n)).iter().map(|&(x, weight)| weight * width * f(low + width * x)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_up_to_twice_the_points_are_exact() {
        for n in [1, 2, 3, 5, 16, 20, 40] {
            for degree in 0..2 * n as i32 {
                let exact = 1.0 / f64::from(degree + 1);
                let value = integrate(|x| x.powi(degree), 0.0, 1.0, n);
                assert!((value - exact).abs() < 2e-15, "{n} points, degree {degree}: {value}");
            }
        }
    }
}
