//! Velocity Verlet: half kick, drift, new force, half kick.
//!
//! v(n+½) = v(n) + Δt/2 a(n); u(n+1) = u(n) + Δt v(n+½); v(n+1) = v(n+½) + Δt/2 a(n+1); Shojaei et al. 2022, eq. (29).
//! Second order, symplectic, energy without drift. Bonds break between the drift and the new force.

use rayon::prelude::*;

use super::{Clock, Stage, System, Unknowns};
use crate::execution::{Sweep, wide};
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
    /// Advances `system` by one step.
    pub fn step<S: System>(&self, system: &mut S, clock: &mut Clock) {
        self.stride(system, clock, false);
        self.finish(system, clock.dt);
        system.constrain(Stage::Finish, clock.time(), clock.dt);
    }

    /// The same without its end: a system that prescribes no values may leave its last kick to the next stride, which makes up
    /// for it in its own pass over memory if it is `owed`, and then gives Σ v² at the end of the step before. The bits are those
    /// of whole steps.
    pub fn stride<S: System>(&self, system: &mut S, clock: &mut Clock, owed: bool) -> f64 {
        let drift = Drift::new(self, &system.unknowns(), clock.dt, owed);
        let (t, dt) = (clock.time(), clock.dt);
        clock.step += 1;
        if let Some(squares) = system.evaluate_behind(&drift, clock.time(), dt) {
            return squares;
        }
        let squares = drift.everywhere(system.unknowns());
        system.constrain(Stage::Drift, t, dt);
        system.evaluate(clock.time(), dt);
        squares
    }

    /// The last kick of a step of `dt` (s). Gives Σ v² after it.
    pub fn finish<S: System>(&self, system: &mut S, dt: f64) -> f64 {
        let unknowns = system.unknowns();
        let drift = Drift::new(self, &unknowns, dt, true);
        let chunks = unknowns.velocity.par_chunks_mut(CHUNK).zip(unknowns.force.par_chunks(CHUNK));
        let squares = chunks.map(|(velocity, force)| wide(Kick { drift: &drift, velocity, force }));
        squares.collect::<Vec<f64>>().iter().sum()
    }
}

/// One pass over the vectors: the last kick of the step before, if it is owed, the first of this step, and the drift.
#[derive(Debug, Clone, Copy)]
pub struct Drift<T> {
    owed: bool,
    /// What the kicks leave of the velocity, by damping proportional to mass: the first, the last.
    keep: T,
    after: T,
    /// Δt/2ρ
    factor: T,
    dt: T,
    /// τ
    tau: T,
    /// Below these, displacements and velocities are zero.
    still: T,
    slow: T,
}

impl<T: Number> Drift<T> {
    fn new(method: &VelocityVerlet, unknowns: &Unknowns<'_, T>, dt: f64, owed: bool) -> Self {
        let half = 0.5 * method.damping * dt;
        Drift {
            owed,
            keep: T::from_f64(1.0 - half),
            after: T::from_f64(1.0 / (1.0 + half)),
            factor: T::from_f64(0.5 * dt / unknowns.inertia),
            dt: T::from_f64(dt),
            tau: T::from_f64(unknowns.ahead.as_ref().map_or(0.0, |(tau, _)| *tau)),
            still: T::from_f64(unknowns.negligible),
            slow: T::from_f64(slow(unknowns.negligible, dt)),
        }
    }

    /// The pass over all numbers. Gives Σ v² after the kick that was owed, and zero if none was.
    pub fn everywhere(&self, unknowns: Unknowns<'_, T>) -> f64 {
        let Unknowns { displacement, velocity, force, ahead, .. } = unknowns;
        let vectors =
            displacement.par_chunks_mut(CHUNK).zip(velocity.par_chunks_mut(CHUNK)).zip(force.par_chunks(CHUNK));
        let squares: Vec<f64> = match ahead {
            Some((_, ahead)) => {
                let vectors = vectors.zip(ahead.par_chunks_mut(CHUNK));
                vectors.map(|(((u, v), f), ahead)| self.pass(u, v, f, ahead)).collect()
            }
            None => vectors.map(|((u, v), f)| self.pass(u, v, f, &mut [])).collect(),
        };
        squares.iter().sum()
    }

    /// The pass over some numbers; `ahead` is empty or gets u + τ v.
    pub fn pass(&self, displacement: &mut [T], velocity: &mut [T], force: &[T], ahead: &mut [T]) -> f64 {
        let pass = Pass { drift: self, displacement, velocity, force, ahead };
        match (self.owed, pass.ahead.is_empty()) {
            (false, true) => wide(Only::<_, false, false>(pass)),
            (false, false) => wide(Only::<_, false, true>(pass)),
            (true, true) => wide(Only::<_, true, false>(pass)),
            (true, false) => wide(Only::<_, true, true>(pass)),
        }
    }

    /// The last kick of a step; adds v².
    #[inline(always)]
    fn kicked(&self, v: T, f: T, square: &mut f64) -> T {
        let v = unless_below(self.slow, (v + self.factor * f) * self.after);
        *square += v.to_f64() * v.to_f64();
        v
    }
}

/// Sums side by side, so that loops are vectors.
const LANES: usize = 8;

/// What [`Drift::pass`] passes over.
struct Pass<'a, T> {
    drift: &'a Drift<T>,
    displacement: &'a mut [T],
    velocity: &'a mut [T],
    force: &'a [T],
    ahead: &'a mut [T],
}

/// A pass that makes up for a kick or does not, and looks ahead or does not.
struct Only<P, const OWED: bool, const AHEAD: bool>(P);

impl<T: Number, const OWED: bool, const AHEAD: bool> Sweep for Only<Pass<'_, T>, OWED, AHEAD> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let Pass { drift, displacement, velocity, force, ahead } = self.0;
        let mut squares = [0.0; LANES];
        let ((us, u), (vs, v)) = (displacement.as_chunks_mut::<LANES>(), velocity.as_chunks_mut::<LANES>());
        let ((fs, f), (aheads, ahead)) = (force.as_chunks::<LANES>(), ahead.as_chunks_mut::<LANES>());
        if AHEAD {
            for (((u, v), f), ahead) in us.iter_mut().zip(vs).zip(fs).zip(aheads) {
                Self::some(drift, u, v, f, ahead, &mut squares);
            }
        } else {
            for ((u, v), f) in us.iter_mut().zip(vs).zip(fs) {
                Self::some(drift, u, v, f, &mut [], &mut squares);
            }
        }
        Self::some(drift, u, v, f, ahead, &mut squares);
        squares.iter().sum()
    }
}

impl<T: Number, const OWED: bool, const AHEAD: bool> Only<Pass<'_, T>, OWED, AHEAD> {
    #[inline(always)]
    fn some(drift: &Drift<T>, u: &mut [T], v: &mut [T], f: &[T], ahead: &mut [T], squares: &mut [f64; LANES]) {
        for k in 0..u.len() {
            if OWED {
                v[k] = drift.kicked(v[k], f[k], &mut squares[k]);
            }
            v[k] = unless_below(drift.slow, drift.keep * v[k] + drift.factor * f[k]);
            u[k] = unless_below(drift.still, u[k] + drift.dt * v[k]);
            if AHEAD {
                ahead[k] = u[k] + drift.tau * v[k];
            }
        }
    }
}

/// The last kick of a step alone.
struct Kick<'a, T> {
    drift: &'a Drift<T>,
    velocity: &'a mut [T],
    force: &'a [T],
}

impl<T: Number> Sweep for Kick<'_, T> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let mut squares = [0.0; LANES];
        let ((vs, v), (fs, f)) = (self.velocity.as_chunks_mut::<LANES>(), self.force.as_chunks::<LANES>());
        for (v, f) in vs.iter_mut().zip(fs) {
            for k in 0..LANES {
                v[k] = self.drift.kicked(v[k], f[k], &mut squares[k]);
            }
        }
        for k in 0..v.len() {
            v[k] = self.drift.kicked(v[k], f[k], &mut squares[k]);
        }
        squares.iter().sum()
    }
}

/// The velocity that takes 10⁵ steps over a negligible displacement.
pub(super) fn slow(negligible: f64, dt: f64) -> f64 {
    1e-5 * negligible / dt
}

#[inline(always)]
pub(super) fn unless_below<T: Number>(limit: T, x: T) -> T {
    if x.is_below(limit) { T::default() } else { x }
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
    fn kicks_that_are_owed_are_those_of_whole_steps() {
        let method = VelocityVerlet { damping: 0.3 };
        let (mut whole, mut owing) = (Oscillator([1.0, 0.2, -1.0]), Oscillator([1.0, 0.2, -1.0]));
        let (mut clock, mut other) = (Clock::new(0.1), Clock::new(0.1));
        let mut before = 0.0;
        for k in 0..50 {
            let squares = method.stride(&mut owing, &mut other, k > 0);
            assert_eq!(squares, before);
            method.step(&mut whole, &mut clock);
            before = whole.0[1] * whole.0[1];
        }
        assert_eq!(method.finish(&mut owing, 0.1), before);
        assert_eq!((whole.0, clock), (owing.0, other));
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
