//! Damping proportional to mass over a step, exact for any c Δt.
//!
//! ρ v̇ = f − ρ c v has, where f stays the same over a step, the solution
//! v(Δt) = e^(−y) v + φ₁ Δt f/ρ, u(Δt) = u + Δt (φ₁ v + φ₂ Δt f/ρ), with y = c Δt, φ₁ = (1 − e^(−y))/y and
//! φ₂ = (1 − φ₁)/y: the functions of exponential integrators (Hochbruck & Ostermann 2010, eq. (2.10)).

/// What damping proportional to mass does in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DampedStep {
    /// y = c Δt
    pub y: f64,
    /// φ₁(−y), φ₂(−y): 1 and ½ without damping.
    pub phi: [f64; 2],
}

/// Below this y, differences of nearly equal numbers are taken from their series.
const SERIES: f64 = 1.0;
/// Terms of series at y ≤ 1: the last is below 1/18!, a rounding.
const TERMS: i32 = 18;

impl DampedStep {
    /// Of damping `c` (1/s) over `dt` (s).
    pub fn new(c: f64, dt: f64) -> Self {
        // Beyond it nothing is left of a velocity, and 1/y is still a number.
        let y = (c * dt).min(1e300);
        if y == 0.0 {
            return DampedStep { y, phi: [1.0, 0.5] };
        }
        let first = -f64::exp_m1(-y) / y;
        // φ₂ = Σ (−y)^k/(k + 2)!
        let second = if y < SERIES {
            let mut term = 0.5;
            (1..TERMS).fold(term, |sum, k| {
                term *= -y / f64::from(k + 2);
                sum + term
            })
        } else {
            (1.0 - first) / y
        };
        DampedStep { y, phi: [first, second] }
    }

    /// What the forces at its start and at its end count of the impulse over it: each a half without damping.
    pub fn weights(&self) -> [f64; 2] {
        let [first, second] = self.phi;
        [second / first, (first - second) / first]
    }

    /// What the kinetic energy of its start and of its end, and that of its mean velocity, count of the energy that damping
    /// takes: exact where velocities decay, and where force and damping are in balance.
    ///
    /// E = a (K₀ + K₁) + 2 b K½ with a + b = y and a (1 + e^(−2y)) + 2 b φ₁² = 1 − e^(−2y).
    pub fn energy(&self) -> [f64; 2] {
        let y = self.y;
        if y == 0.0 {
            return [0.0, 0.0];
        }
        if y >= SERIES {
            let (decayed, square) = ((-2.0 * y).exp(), self.phi[0].powi(2));
            let b = (y * (1.0 + decayed) - (1.0 - decayed)) / (1.0 + decayed - 2.0 * square);
            return [(1.0 - decayed - 2.0 * b * square) / (1.0 + decayed), b];
        }
        // b is (y cosh y − sinh y) over (cosh y − 2 (cosh y − 1)/y²), here both over y².
        let (mut above, mut below, mut power) = (0.0, 0.0, 1.0);
        for k in (2..TERMS).step_by(2) {
            let of = |n: i32| (1..=n).map(f64::from).product::<f64>();
            above += y * power * f64::from(k) / of(k + 1);
            below += power * (1.0 / of(k) - 2.0 / of(k + 2));
            power *= y * y;
        }
        let b = above / below;
        [y - b, b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both forms, and the equations that they solve, at steps from none to far beyond the time of decay.
    #[test]
    fn energy_and_impulse_are_exact_in_decay_and_in_balance() {
        for y in [1e-12, 1e-6, 1e-3, 0.1, 0.5, 0.999, 1.0, 1.001, 2.0, 10.0, 1e3, 1e9] {
            let step = DampedStep::new(y, 1.0);
            let [first, second] = step.phi;
            let decayed = f64::exp(-y);
            // 1 = e^(−y) + y φ₁ and φ₁ + y φ₂ = 1, to a rounding of 1.
            assert!((decayed + y * first - 1.0).abs() < 4e-16, "{y}");
            assert!((first + y * second - 1.0).abs() < 4e-16, "{y}");
            let [a, b] = step.energy();
            let [from_decay, exact] = [a * (1.0 + decayed * decayed) + 2.0 * b * first * first, -f64::exp_m1(-2.0 * y)];
            // Roundings of the two sides, and at y = 1 of the closed form, which subtracts numbers five times as large.
            assert!((from_decay / exact - 1.0).abs() < 1e-14, "{y}: {from_decay} {exact}");
            assert!(((a + b) / y - 1.0).abs() < 4e-16 && a >= 0.0 && b >= 0.0, "{y}: {a} {b}");
            let [start, end] = step.weights();
            assert!((start + end - 1.0).abs() < 4e-16 && end >= 0.0, "{y}");
        }
    }
}
