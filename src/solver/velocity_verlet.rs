//! Velocity Verlet: half kick, drift, new force, half kick.
//!
//! v(n+½) = v(n) + Δt/2 a(n); u(n+1) = u(n) + Δt v(n+½); v(n+1) = v(n+½) + Δt/2 a(n+1); Shojaei et al. 2022, eq. (29).
//! Second order, symplectic, energy without drift. Bonds break between the drift and the new force.

use rayon::prelude::*;

use super::{Clock, Stage, System, Unknowns};
use crate::execution::wide;
use crate::field::Number;

/// Numbers that a thread updates at a time.
pub(super) const CHUNK: usize = 16 * 1024;

/// Velocity Verlet with optional damping proportional to mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityVerlet {
    /// c in ρ ü = force − ρ c u̇, 1/s; zero for none.
    pub damping: f64,
}

impl VelocityVerlet {
    /// Advances `system` by one step. Gives Σ v² over all numbers at its end, before values are prescribed.
    pub fn step<S: System>(&self, system: &mut S, clock: &mut Clock) -> f64 {
        let (t, dt) = (clock.time(), clock.dt);
        let half = 0.5 * self.damping * dt;
        kick_and_drift(&mut system.unknowns(), dt, 1.0 - half);
        system.constrain(Stage::Drift, t, dt);
        clock.step += 1;
        system.evaluate(clock.time(), dt);
        let squares = kick(&mut system.unknowns(), dt, 1.0 / (1.0 + half));
        system.constrain(Stage::Finish, clock.time(), dt);
        squares
    }
}

/// v = keep v + Δt/2 force/ρ; u = u + Δt v, and u + τ v if wanted: in one pass over memory.
fn kick_and_drift<T: Number>(unknowns: &mut Unknowns<'_, T>, dt: f64, keep: f64) {
    let [keep, factor] = [keep, 0.5 * dt / unknowns.inertia].map(T::from_f64);
    let [still, slow] = [unknowns.negligible, slow(unknowns.negligible, dt)].map(T::from_f64);
    let dt = T::from_f64(dt);
    let Unknowns { displacement, velocity, force, ahead, .. } = unknowns;
    let vectors = displacement.par_chunks_mut(CHUNK).zip(velocity.par_chunks_mut(CHUNK)).zip(force.par_chunks(CHUNK));
    if let Some((tau, ahead)) = ahead {
        let tau = T::from_f64(*tau);
        return vectors.zip(ahead.par_chunks_mut(CHUNK)).for_each(|(((u, v), f), ahead)| {
            wide(|| {
                for (((u, v), f), ahead) in u.iter_mut().zip(v).zip(f).zip(ahead) {
                    *v = unless_below(slow, keep * *v + factor * *f);
                    *u = unless_below(still, *u + dt * *v);
                    *ahead = *u + tau * *v;
                }
            });
        });
    }
    vectors.for_each(|((u, v), f)| {
        wide(|| {
            for ((u, v), f) in u.iter_mut().zip(v).zip(f) {
                *v = unless_below(slow, keep * *v + factor * *f);
                *u = unless_below(still, *u + dt * *v);
            }
        });
    });
}

/// v = (v + Δt/2 force/ρ) × after; gives Σ v².
fn kick<T: Number>(unknowns: &mut Unknowns<'_, T>, dt: f64, after: f64) -> f64 {
    let [factor, after] = [0.5 * dt / unknowns.inertia, after].map(T::from_f64);
    let slow = T::from_f64(slow(unknowns.negligible, dt));
    let chunks = unknowns.velocity.par_chunks_mut(CHUNK).zip(unknowns.force.par_chunks(CHUNK));
    let squares = chunks.map(|(v, f)| wide(|| kick_chunk(v, f, factor, after, slow)));
    squares.collect::<Vec<f64>>().iter().sum()
}

// A function, because a closure of this size is not inlined into code for wider registers.
#[inline(always)]
fn kick_chunk<T: Number>(v: &mut [T], f: &[T], factor: T, after: T, slow: T) -> f64 {
    // Eight sums side by side, so that the loop is vectors.
    let mut squares = [0.0; 8];
    let (mut vs, mut fs) = (v.chunks_exact_mut(8), f.chunks_exact(8));
    for (v, f) in (&mut vs).zip(&mut fs) {
        for k in 0..8 {
            v[k] = unless_below(slow, (v[k] + factor * f[k]) * after);
            squares[k] += v[k].to_f64() * v[k].to_f64();
        }
    }
    for (k, (v, f)) in vs.into_remainder().iter_mut().zip(fs.remainder()).enumerate() {
        *v = unless_below(slow, (*v + factor * *f) * after);
        squares[k] += v.to_f64() * v.to_f64();
    }
    squares.iter().sum()
}

/// The velocity that takes 10⁵ steps over a negligible displacement.
pub(super) fn slow(negligible: f64, dt: f64) -> f64 {
    1e-5 * negligible / dt
}

#[inline(always)]
pub(super) fn unless_below<T: Number>(limit: T, x: T) -> T {
    if x < limit && limit + x > T::default() { T::default() } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// u¨ = −u − c u̇
    struct Oscillator([f64; 3]);

    impl System for Oscillator {
        type Number = f64;
        fn unknowns(&mut self) -> Unknowns<'_, f64> {
            let [u, v, f] = &mut self.0;
            Unknowns {
                displacement: std::slice::from_mut(u),
                velocity: std::slice::from_mut(v),
                force: std::slice::from_ref(f),
                inertia: 1.0,
                negligible: 0.0,
                ahead: None,
            }
        }
        fn constrain(&mut self, _: Stage, _: f64, _: f64) {}
        fn evaluate(&mut self, _: f64, _: f64) {
            self.0[2] = -self.0[0];
        }
        fn stable_step(&self) -> f64 {
            2.0
        }
    }

    fn error_at_one(damping: f64, n: u64) -> f64 {
        let mut system = Oscillator([1.0, 0.0, -1.0]);
        let mut clock = Clock::new(1.0 / n as f64);
        for _ in 0..n {
            VelocityVerlet { damping }.step(&mut system, &mut clock);
        }
        let w = (1.0 - 0.25 * damping * damping).sqrt();
        let exact = (-0.5 * damping).exp() * (w.cos() + 0.5 * damping / w * w.sin());
        (system.0[0] - exact).abs()
    }

    #[test]
    fn a_damped_oscillator_converges_at_second_order() {
        for damping in [0.0, 0.5] {
            let order = (error_at_one(damping, 64) / error_at_one(damping, 128)).log2();
            // Halving the step leaves terms of relative size Δt beside the leading one.
            assert!((order - 2.0).abs() < 0.05, "damping {damping}: order {order}");
        }
    }
}
