//! Velocity Verlet: half kick, drift, new force, half kick.
//!
//! v(n+½) = v(n) + Δt/2 a(n); u(n+1) = u(n) + Δt v(n+½); v(n+1) = v(n+½) + Δt/2 a(n+1); Shojaei et al. 2022, eq. (29).
//! Second order, symplectic, energy without drift. Bonds break between the drift and the new force.
//!
//! Damping proportional to mass is exact for forces that stay the same over a step, with y = c Δt and φ₁, φ₂ of
//! [`DampedStep`]: v(n+½) = φ₁ v(n) + φ₂ Δt a(n), the mean velocity of the step, and
//! v(n+1) = (e^(−y) v(n+½) + (φ₁ − φ₂) Δt a(n+1))/φ₁. An oscillation is stable to ω Δt = 2 √(½y coth ½y), which is 2 without
//! damping and never less: no damping is too strong for a step.

mod varied;

use rayon::prelude::*;

use super::{Clock, Stage, System};
use crate::conditions::damping::DampedStep;
use crate::execution::{Sweep, wide};
use crate::field::Number;
use crate::unknown::{Unknown, Vectors, with};

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
    /// for it in its own pass over memory if one is `pending`, and then gives Σ v² at the end of the step before. The bits are those
    /// of whole steps.
    pub fn stride<S: System>(&self, system: &mut S, clock: &mut Clock, pending: bool) -> f64 {
        let drift = Drift::new(self, &system.unknown(), clock.dt, pending);
        let (t, dt) = (clock.time(), clock.dt);
        clock.step += 1;
        if let Some(squares) = system.drift_and_evolve(&drift, clock.time(), dt) {
            return squares;
        }
        let squares = drift.everywhere(&mut system.unknown());
        system.constrain(Stage::Drift, t, dt);
        system.evolve(clock.time(), dt);
        squares
    }

    /// The last kick of a step of `dt` (s). Gives Σ v² after it.
    pub fn finish<S: System>(&self, system: &mut S, dt: f64) -> f64 {
        let mut unknown = system.unknown();
        let drift = Drift::new(self, &unknown, dt, true);
        with!(unknown, vectors => {
            let kick = Kick::new(&drift);
            if let Some(relative) = vectors.relative_inertia {
                return varied::finish(kick, vectors.velocity, vectors.rate, relative);
            }
            let chunks = vectors.velocity.par_chunks_mut(CHUNK).zip(vectors.rate.par_chunks(CHUNK));
            let squares = chunks.map(|(velocity, force)| wide(Chunk { kick, velocity, force }));
            squares.collect::<Vec<f64>>().iter().sum()
        })
    }
}

/// One pass over the vectors: the last kick of the step before, if it is pending, the first of this step, and the drift.
#[derive(Debug, Clone, Copy)]
pub struct Drift {
    pending: bool,
    /// What the kicks leave of the velocity, by damping proportional to mass: the first, the last.
    keep: f64,
    after: f64,
    /// By which they take the force; Δt/2ρ without damping.
    factor: f64,
    last: f64,
    dt: f64,
    /// τ
    tau: f64,
    /// Below these, displacements and velocities are zero.
    still: f64,
    slow: f64,
}

impl Drift {
    fn new(method: &VelocityVerlet, unknown: &Unknown<'_>, dt: f64, pending: bool) -> Self {
        let damped = DampedStep::new(method.damping, dt);
        let [first, second] = damped.phi;
        Drift {
            pending,
            keep: first,
            after: (-damped.y).exp() / first,
            factor: second * dt / unknown.inertia,
            last: (first - second) / first * dt / unknown.inertia,
            dt,
            tau: unknown.tau(),
            still: unknown.negligible,
            slow: slow(unknown.negligible, dt),
        }
    }

    /// The pass over all numbers. Gives Σ v² (times ρ/ρ₀ where that differs) after the kick that was pending, and zero if none
    /// was.
    pub fn everywhere(&self, unknown: &mut Unknown<'_>) -> f64 {
        with!(unknown, vectors => {
            let Vectors { value, velocity, rate, damped, relative_inertia } = vectors;
            if let Some(relative) = *relative_inertia {
                let damped = damped.as_mut().map_or(&mut [][..], |(_, damped)| &mut **damped);
                return varied::everywhere(self, value, velocity, rate, damped, relative);
            }
            let chunks = value.par_chunks_mut(CHUNK).zip(velocity.par_chunks_mut(CHUNK)).zip(rate.par_chunks(CHUNK));
            let squares: Vec<f64> = match damped {
                Some((_, damped)) => {
                    let chunks = chunks.zip(damped.par_chunks_mut(CHUNK));
                    chunks.map(|(((u, v), f), damped)| self.pass(u, v, f, damped)).collect()
                }
                None => chunks.map(|((u, v), f)| self.pass(u, v, f, &mut [])).collect(),
            };
            squares.iter().sum()
        })
    }

    /// The pass over some numbers; `damped` is empty or gets u + τ v.
    pub fn pass<T: Number>(&self, displacement: &mut [T], velocity: &mut [T], force: &[T], damped: &mut [T]) -> f64 {
        let [keep, dt, tau, still] = [self.keep, self.dt, self.tau, self.still].map(T::from_f64);
        let pass = Pass { kick: Kick::new(self), keep, dt, tau, still, displacement, velocity, force, damped };
        match (self.pending, pass.damped.is_empty()) {
            (false, true) => wide(Only::<_, false, false>(pass)),
            (false, false) => wide(Only::<_, false, true>(pass)),
            (true, true) => wide(Only::<_, true, false>(pass)),
            (true, false) => wide(Only::<_, true, true>(pass)),
        }
    }
}

/// A kick in the numbers of the fields.
#[derive(Debug, Clone, Copy)]
struct Kick<T> {
    after: T,
    last: T,
    factor: T,
    slow: T,
}

impl<T: Number> Kick<T> {
    fn new(drift: &Drift) -> Self {
        let [after, last, factor, slow] = [drift.after, drift.last, drift.factor, drift.slow].map(T::from_f64);
        Kick { after, last, factor, slow }
    }

    /// The last kick of a step; adds v².
    #[inline(always)]
    fn kicked(&self, v: T, f: T, square: &mut f64) -> T {
        let v = unless_below(self.slow, self.after * v + self.last * f);
        *square += v.to_f64() * v.to_f64();
        v
    }
}

/// Sums side by side, so that loops are vectors.
const LANES: usize = 8;

/// What [`Drift::pass`] passes over.
struct Pass<'a, T> {
    kick: Kick<T>,
    keep: T,
    dt: T,
    tau: T,
    still: T,
    displacement: &'a mut [T],
    velocity: &'a mut [T],
    force: &'a [T],
    damped: &'a mut [T],
}

/// A pass that makes up for a kick or does not, and fills u + τ v or does not.
struct Only<P, const PENDING: bool, const DAMPED: bool>(P);

impl<T: Number, const PENDING: bool, const DAMPED: bool> Sweep for Only<Pass<'_, T>, PENDING, DAMPED> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let Pass { kick, keep, dt, tau, still, displacement, velocity, force, damped } = self.0;
        let by = [keep, dt, tau, still];
        let mut squares = [0.0; LANES];
        let ((us, u), (vs, v)) = (displacement.as_chunks_mut::<LANES>(), velocity.as_chunks_mut::<LANES>());
        let ((fs, f), (damps, damped)) = (force.as_chunks::<LANES>(), damped.as_chunks_mut::<LANES>());
        if DAMPED {
            for (((u, v), f), damped) in us.iter_mut().zip(vs).zip(fs).zip(damps) {
                Self::some(&kick, by, u, v, f, damped, &mut squares);
            }
        } else {
            for ((u, v), f) in us.iter_mut().zip(vs).zip(fs) {
                Self::some(&kick, by, u, v, f, &mut [], &mut squares);
            }
        }
        Self::some(&kick, by, u, v, f, damped, &mut squares);
        squares.iter().sum()
    }
}

impl<T: Number, const PENDING: bool, const DAMPED: bool> Only<Pass<'_, T>, PENDING, DAMPED> {
    #[inline(always)]
    fn some(
        kick: &Kick<T>,
        [keep, dt, tau, still]: [T; 4],
        u: &mut [T],
        v: &mut [T],
        f: &[T],
        damped: &mut [T],
        squares: &mut [f64; LANES],
    ) {
        for k in 0..u.len() {
            if PENDING {
                v[k] = kick.kicked(v[k], f[k], &mut squares[k]);
            }
            v[k] = unless_below(kick.slow, keep * v[k] + kick.factor * f[k]);
            u[k] = unless_below(still, u[k] + dt * v[k]);
            if DAMPED {
                damped[k] = u[k] + tau * v[k];
            }
        }
    }
}

/// The last kick of a step alone, of some numbers.
struct Chunk<'a, T> {
    kick: Kick<T>,
    velocity: &'a mut [T],
    force: &'a [T],
}

impl<T: Number> Sweep for Chunk<'_, T> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let mut squares = [0.0; LANES];
        let ((vs, v), (fs, f)) = (self.velocity.as_chunks_mut::<LANES>(), self.force.as_chunks::<LANES>());
        for (v, f) in vs.iter_mut().zip(fs) {
            for k in 0..LANES {
                v[k] = self.kick.kicked(v[k], f[k], &mut squares[k]);
            }
        }
        for k in 0..v.len() {
            v[k] = self.kick.kicked(v[k], f[k], &mut squares[k]);
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
    use crate::unknown::Numbers;

    /// u¨ = −u − c u̇
    struct Oscillator([f64; 3]);

    impl System for Oscillator {
        fn unknown(&mut self) -> Unknown<'_> {
            let [u, v, f] = self.0.each_mut().map(std::slice::from_mut);
            Unknown {
                vectors: Numbers::Double(Vectors {
                    value: u,
                    velocity: v,
                    rate: f,
                    damped: None,
                    relative_inertia: None,
                }),
                components: 1,
                inertia: 1.0,
                negligible: 0.0,
            }
        }
        fn constrain(&mut self, _: Stage, _: f64, _: f64) {}
        fn evolve(&mut self, _: f64, _: f64) {
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
    fn kicks_that_are_pending_are_those_of_whole_steps() {
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

    /// A point without force, and one that is pulled: both as their equations say, however long the step.
    #[test]
    fn decay_and_terminal_velocity_are_exact_at_any_damping() {
        struct Pulled([f64; 3]);
        impl System for Pulled {
            fn unknown(&mut self) -> Unknown<'_> {
                let [value, velocity, rate] = self.0.each_mut().map(std::slice::from_mut);
                let vectors = Vectors { value, velocity, rate, damped: None, relative_inertia: None };
                Unknown { vectors: Numbers::Double(vectors), components: 1, inertia: 2.0, negligible: 0.0 }
            }
            fn constrain(&mut self, _: Stage, _: f64, _: f64) {}
            fn evolve(&mut self, _: f64, _: f64) {}
            fn stable_step(&self) -> f64 {
                f64::INFINITY
            }
        }
        for c in [1e-6, 0.01, 0.7, 1.0, 2.0, 30.0, 1e6] {
            for force in [0.0, 3.0] {
                let mut system = Pulled([0.0, 1.0, force]);
                let mut clock = Clock::new(1.0);
                for _ in 0..10 {
                    VelocityVerlet { damping: c }.step(&mut system, &mut clock);
                }
                let (t, a) = (clock.time(), 0.5 * force);
                let decayed = f64::exp_m1(-c * t);
                let exact = [-decayed / c + (t + decayed / c) * a / c, 1.0 + decayed - decayed * a / c];
                // A few roundings a step of numbers as large as 1/c, for (t + …)/c.
                let allowed = 1e-14 * (1.0 + a * (1.0 + 1.0 / c / c));
                for k in 0..2 {
                    assert!((system.0[k] - exact[k]).abs() < allowed, "c {c}, force {force}: {:?} {exact:?}", system.0);
                }
            }
        }
    }

    /// At the stable step without damping, with damping of any strength.
    #[test]
    fn no_damping_makes_a_stable_step_unstable() {
        for c in [0.0, 1e-3, 0.1, 1.0, 5.0, 100.0, 1e8] {
            let mut system = Oscillator([1.0, 0.0, -1.0]);
            let mut clock = Clock::new(1.999);
            let mut largest = 0.0f64;
            for _ in 0..2000 {
                VelocityVerlet { damping: c }.step(&mut system, &mut clock);
                largest = largest.max(system.0[0].abs());
            }
            // ω Δt = 1.999 lets the amplitude grow to 1/√(1 − (ω Δt/2)²) = 31.6 without damping.
            assert!(largest < 32.0, "{c}: {largest}");
        }
    }

    #[test]
    fn a_damped_oscillator_converges_at_second_order() {
        for damping in [0.0, 0.5, 1.5] {
            let order = (error_at_one(damping, 64) / error_at_one(damping, 128)).log2();
            // Halving the step leaves terms of relative size Δt beside the leading one.
            assert!((order - 2.0).abs() < 0.05, "damping {damping}: order {order}");
        }
    }
}
