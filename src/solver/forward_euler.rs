//! Forward Euler: C(n+1) = C(n) + Δt Ċ(n); Shojaei et al. 2022, eq. (31).
//!
//! First order. Stable while |1 + λ Δt| ≤ 1 for all eigenvalues λ of the rates: Δt ≤ 2/|λ| of the most negative, and none
//! positive.

use rayon::prelude::*;

use super::Clock;
use super::velocity_verlet::CHUNK;
use crate::field::Number;

/// What solvers of first order advance: u̇ = rate(u, t).
pub trait Rated {
    /// What the vectors are stored in.
    type Number: Number;
    /// Fills the rates of change at time `t` (s).
    fn evaluate(&mut self, t: f64);
    /// The unknowns, and their rates of change (1/s of them) as last filled.
    fn unknowns(&mut self) -> (&mut [Self::Number], &[Self::Number]);
    /// Imposes the prescribed values of time `t` (s).
    fn constrain(&mut self, t: f64);
    /// Largest stable step, s.
    fn stable_step(&self) -> f64;
}

/// The explicit Euler method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ForwardEuler;

impl ForwardEuler {
    /// Advances `system` by one step.
    pub fn step<S: Rated>(self, system: &mut S, clock: &mut Clock) {
        system.evaluate(clock.time());
        let dt = S::Number::from_f64(clock.dt);
        let (unknowns, rates) = system.unknowns();
        unknowns.par_chunks_mut(CHUNK).zip(rates.par_chunks(CHUNK)).for_each(|(u, rate)| {
            for (u, rate) in u.iter_mut().zip(rate) {
                *u = *u + dt * *rate;
            }
        });
        clock.step += 1;
        system.constrain(clock.time());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// u̇ = −3 u + cos t, and a value that is prescribed: t.
    struct Decay {
        u: [f64; 2],
        rate: [f64; 2],
    }

    impl Rated for Decay {
        type Number = f64;
        fn evaluate(&mut self, t: f64) {
            self.rate = [t.cos() - 3.0 * self.u[0], 99.0];
        }
        fn unknowns(&mut self) -> (&mut [f64], &[f64]) {
            (&mut self.u, &self.rate)
        }
        fn constrain(&mut self, t: f64) {
            self.u[1] = t;
        }
        fn stable_step(&self) -> f64 {
            2.0 / 3.0
        }
    }

    fn at_one(steps: u64) -> [f64; 2] {
        let mut system = Decay { u: [1.0, 0.0], rate: [0.0; 2] };
        let mut clock = Clock::new(1.0 / steps as f64);
        (0..steps).for_each(|_| ForwardEuler.step(&mut system, &mut clock));
        system.u
    }

    #[test]
    fn decay_converges_at_first_order_and_prescribed_values_hold() {
        // u = 0.7 e^(−3t) + 0.3 cos t + 0.1 sin t
        let exact = 0.7 * (-3.0f64).exp() + 0.3 * 1f64.cos() + 0.1 * 1f64.sin();
        let error = |steps| (at_one(steps)[0] - exact).abs();
        let order = (error(1000) / error(2000)).log2();
        // The next term is of relative size Δt.
        assert!((order - 1.0).abs() < 0.01, "{order}");
        assert_eq!(at_one(10)[1], 1.0);
    }

    #[test]
    fn a_step_beyond_the_stable_one_grows() {
        let after = |dt: f64| {
            let mut system = Decay { u: [1.0, 0.0], rate: [0.0; 2] };
            let mut clock = Clock::new(dt);
            (0..400).for_each(|_| ForwardEuler.step(&mut system, &mut clock));
            system.u[0].abs()
        };
        assert!(after(0.66) < 1.0 && after(0.68) > 1e3);
    }
}
