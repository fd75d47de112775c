//! Forward Euler: C(n+1) = C(n) + Δt Ċ(n); Shojaei et al. 2022, eq. (31).
//!
//! First order. Stable while |1 + λ Δt| ≤ 1 for all eigenvalues λ of the rates: Δt ≤ 2/|λ| of the most negative, and none
//! positive.

use rayon::prelude::*;

use super::velocity_verlet::CHUNK;
use super::{Clock, Stage, System};
use crate::field::Number;
use crate::unknown::with;

/// The explicit Euler method, of equations of first order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ForwardEuler;

impl ForwardEuler {
    /// Advances `system`, whose rates are those of its values as they are, by one step.
    pub fn step<S: System>(self, system: &mut S, clock: &mut Clock) {
        let (t, dt) = (clock.time(), clock.dt);
        let mut unknown = system.unknown();
        let by = dt / unknown.inertia;
        with!(unknown, vectors => go(vectors.value, vectors.rate, by, vectors.relative_inertia.map(|by_place| by_place.inverse)));
        clock.step += 1;
        system.constrain(Stage::Drift, t, dt);
        system.evolve(clock.time(), dt);
    }
}

/// u + Δt Ċ
fn go<T: Number>(value: &mut [T], rate: &[T], by: f64, inverse: Option<&[T]>) {
    let by = T::from_f64(by);
    let chunks = value.par_chunks_mut(CHUNK).zip(rate.par_chunks(CHUNK)).enumerate();
    chunks.for_each(|(chunk, (u, rate))| match inverse {
        None => {
            for (u, rate) in u.iter_mut().zip(rate) {
                *u = *u + by * *rate;
            }
        }
        Some(inverse) => {
            for (k, (u, rate)) in u.iter_mut().zip(rate).enumerate() {
                *u = *u + by * (*rate * inverse[(chunk * CHUNK + k) % inverse.len()]);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unknown::{Numbers, Unknown, Vectors};

    /// u̇ = −3 u + cos t, and a value that is prescribed: t.
    struct Decay {
        u: [f64; 2],
        rate: [f64; 2],
    }

    impl System for Decay {
        fn unknown(&mut self) -> Unknown<'_> {
            let (value, rate) = (&mut self.u[..], &mut self.rate[..]);
            Unknown {
                vectors: Numbers::Double(Vectors {
                    value,
                    velocity: &mut [],
                    rate,
                    damped: None,
                    relative_inertia: None,
                }),
                components: 1,
                inertia: 1.0,
                negligible: 0.0,
            }
        }
        fn constrain(&mut self, _: Stage, t: f64, dt: f64) {
            self.u[1] = t + dt;
        }
        fn evolve(&mut self, t: f64, _: f64) {
            self.rate = [t.cos() - 3.0 * self.u[0], 99.0];
        }
        fn stable_step(&self) -> f64 {
            2.0 / 3.0
        }
    }

    fn decay() -> Decay {
        let mut system = Decay { u: [1.0, 0.0], rate: [0.0; 2] };
        system.evolve(0.0, 0.0);
        system
    }

    fn at_one(steps: u64) -> [f64; 2] {
        let mut system = decay();
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
            let mut system = decay();
            let mut clock = Clock::new(dt);
            (0..400).for_each(|_| ForwardEuler.step(&mut system, &mut clock));
            system.u[0].abs()
        };
        assert!(after(0.66) < 1.0 && after(0.68) > 1e3);
    }
}
