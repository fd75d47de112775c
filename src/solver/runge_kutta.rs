//! The classical Runge–Kutta method of fourth order.
//!
//! u̇ = v, v̇ = a = force/ρ − c v, with four evaluations a step (Kutta 1901): k₁ at t, k₂ and k₃ at t + Δt/2, k₄ at t + Δt,
//! and (u, v) += Δt/6 (k₁ + 2 k₂ + 2 k₃ + k₄). The force at the end of a step is that of k₁ in the next, so a step
//! costs four sums over bonds where velocity Verlet costs one.
//!
//! Bonds break at the ends of whole steps only: the states within a step are trial states of first and second order, and a
//! bond that breaks for good on one of them would make the step depend on an error that the step itself takes out again.
//!
//! On the imaginary axis it is stable to ω Δt = 2√2, and there takes (ω Δt)⁶/72 of the energy of an oscillation in a step:
//! Δt⁵ in a given time. Velocity Verlet is stable to 2 and takes none.

use rayon::prelude::*;

use super::velocity_verlet::{CHUNK, slow, unless_below};
use super::{Clock, Staged};
use crate::field::Number;
use crate::unknown::{Numbers, Unknown, Vectors};
use crate::visit::Visitor;

/// The classical Runge–Kutta method with optional damping proportional to mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RungeKutta {
    /// c in ρ ü = force − ρ c u̇, 1/s; zero for none.
    pub damping: f64,
}

/// What a step remembers of its stages: four more vectors, kept from step to step.
#[derive(Debug, Clone, Default)]
pub struct Memory {
    double: Stages<f64>,
    single: Stages<f32>,
}

impl Memory {
    /// Shows what a step remembers while it goes on; every step begins it anew.
    pub fn visit(&mut self, visitor: &mut dyn Visitor) {
        let names = ["stage_displacement", "stage_velocity", "stage_displacement_sum", "stage_velocity_sum"];
        for (name, values) in names.into_iter().zip(self.double.start.iter_mut().chain(&mut self.double.sum)) {
            visitor.doubles(name, values);
        }
        for (name, values) in names.into_iter().zip(self.single.start.iter_mut().chain(&mut self.single.sum)) {
            visitor.singles(name, values);
        }
    }
}

/// The same in numbers of one kind.
#[derive(Debug, Clone, Default)]
struct Stages<T> {
    /// u and v at the start of the step.
    start: [Vec<T>; 2],
    /// k₁ + 2 k₂ + 2 k₃ + k₄ as far as it goes, of u and of v.
    sum: [Vec<T>; 2],
}

/// Calls a method with the vectors of an unknown and the memory in the same numbers.
macro_rules! remembering {
    ($unknown:expr, $memory:expr, |$vectors:ident, $stages:ident| $work:expr) => {
        match &mut $unknown.vectors {
            Numbers::Double($vectors) => {
                let $stages = &mut $memory.double;
                $work
            }
            Numbers::Single($vectors) => {
                let $stages = &mut $memory.single;
                $work
            }
        }
    };
}

/// The share of each stage in the step, and how far ahead of its start the next stage is, in steps.
const STAGES: [[f64; 2]; 3] = [[1.0 / 6.0, 0.5], [1.0 / 3.0, 0.5], [1.0 / 3.0, 1.0]];
const LAST_SHARE: f64 = 1.0 / 6.0;

impl RungeKutta {
    /// The largest stable step over that of velocity Verlet without damping: 2√2 to 2 on the imaginary axis.
    pub const STABILITY: f64 = std::f64::consts::SQRT_2;

    /// The largest stable step, s, where that of velocity Verlet without damping is `stable`.
    ///
    /// A motion of frequency ω ≤ 2/`stable` has λ = −c/2 ± √(c²/4 − ω²); |1 + z + z²/2 + z³/6 + z⁴/24| ≤ 1 at z = λ Δt for all of
    /// them. Strong damping, λ = −c, is stable to c Δt = 2.785; near the imaginary axis the bound of no damping holds.
    pub fn largest_step(&self, stable: f64) -> f64 {
        let undamped = Self::STABILITY * stable;
        if self.damping == 0.0 || !undamped.is_finite() {
            return undamped;
        }
        let half = 0.5 * self.damping;
        let of = |k: u32| {
            let omega = 2.0 / stable * f64::from(k) / f64::from(FREQUENCIES);
            let square = half * half - omega * omega;
            // Of two real roots the larger.
            if square > 0.0 { [-half - square.sqrt(), 0.0] } else { [-half, (-square).sqrt()] }
        };
        (0..=FREQUENCIES).map(|k| stable_along(of(k))).fold(undamped, f64::min)
    }

    /// The strongest damping that a step of `dt` (s) bears, 1/s; none where it bears no motion.
    pub fn strongest_damping(dt: f64, stable: f64) -> Option<f64> {
        let bears = |damping: f64| dt <= RungeKutta { damping }.largest_step(stable);
        if !bears(0.0) {
            return None;
        }
        // The first that it does not bear is below what the real axis allows.
        let (mut low, mut high) = (0.0, 3.0 / dt);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            *(if bears(middle) { &mut low } else { &mut high }) = middle;
        }
        Some(low)
    }

    /// Advances `system` by one step.
    pub fn step<S: Staged>(&self, system: &mut S, clock: &mut Clock, memory: &mut Memory) {
        let (t, dt) = (clock.time(), clock.dt);
        clock.step += 1;
        let end = clock.time();
        for (k, [share, ahead]) in STAGES.into_iter().enumerate() {
            system.book(share, end, dt);
            let mut unknown = system.unknown();
            if k == 0 {
                remembering!(unknown, memory, |vectors, stages| stages.begin(vectors));
            }
            self.stage(&mut unknown, memory, share, ahead * dt);
            system.stage(t + ahead * dt, end, dt);
        }
        system.book(LAST_SHARE, end, dt);
        self.finish(&mut system.unknown(), memory, dt);
        system.arrive(end, dt);
    }

    /// Adds the rates of change here to the sum, and goes `ahead` (s) with them from the start of the step.
    fn stage(&self, unknown: &mut Unknown<'_>, memory: &mut Memory, share: f64, ahead: f64) {
        let by = [1.0 / unknown.inertia, -self.damping, share, ahead];
        remembering!(unknown, memory, |vectors, stages| stages.stage(vectors, by));
    }

    /// Adds the last stage, and takes the step.
    fn finish(&self, unknown: &mut Unknown<'_>, memory: &mut Memory, dt: f64) {
        let by = [1.0 / unknown.inertia, -self.damping, LAST_SHARE, dt];
        let limits = [unknown.negligible, slow(unknown.negligible, dt)];
        remembering!(unknown, memory, |vectors, stages| stages.finish(vectors, by, limits));
    }
}

/// Frequencies at which a damped body is asked for its stable step.
const FREQUENCIES: u32 = 256;

/// The step to which the method is stable for an eigenvalue with this real and imaginary part, 1/s.
fn stable_along([real, imaginary]: [f64; 2]) -> f64 {
    let size = real.hypot(imaginary);
    let direction = [real / size, imaginary / size];
    let grows = |r: f64| {
        let [a, b] = direction.map(|x| r * x);
        // 1 + z (1 + z/2 (1 + z/3 (1 + z/4)))
        let [mut p, mut q] = [1.0, 0.0];
        for n in [4.0, 3.0, 2.0, 1.0] {
            [p, q] = [1.0 + (a * p - b * q) / n, (a * q + b * p) / n];
        }
        // On the imaginary axis it is 1 to rounding where |z| is small.
        p * p + q * q > 1.0 + 1e-14
    };
    // All rays leave the region once, between 2.6 and 3.
    let (mut low, mut high) = (2.5, 3.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        *(if grows(middle) { &mut high } else { &mut low }) = middle;
    }
    low / size
}

impl<T: Number> Stages<T> {
    fn begin(&mut self, vectors: &Vectors<'_, T>) {
        for (start, now) in self.start.iter_mut().zip([&*vectors.value, &*vectors.velocity]) {
            start.resize(now.len(), T::default());
            start.copy_from_slice(now);
        }
        for sum in &mut self.sum {
            sum.clear();
            sum.resize(vectors.rate.len(), T::default());
        }
    }

    fn stage(&mut self, vectors: &mut Vectors<'_, T>, by: [f64; 4]) {
        let [factor, drag, share, ahead] = by.map(T::from_f64);
        each(vectors, self, |[u, v], f, [u0, v0], [du, dv]| {
            let a = factor * f + drag * *v;
            *du = *du + share * *v;
            *dv = *dv + share * a;
            *u = u0 + ahead * *v;
            *v = v0 + ahead * a;
        });
    }

    fn finish(&mut self, vectors: &mut Vectors<'_, T>, by: [f64; 4], limits: [f64; 2]) {
        let [factor, drag, share, dt] = by.map(T::from_f64);
        let [still, slow] = limits.map(T::from_f64);
        each(vectors, self, |[u, v], f, [u0, v0], [du, dv]| {
            let a = factor * f + drag * *v;
            *u = unless_below(still, u0 + dt * (*du + share * *v));
            *v = unless_below(slow, v0 + dt * (*dv + share * a));
        });
    }
}

/// Calls `update` on u and v, the force (over ρ/ρ₀ where that differs), u and v at the start and the sums of every unknown.
fn each<T: Number>(
    vectors: &mut Vectors<'_, T>,
    stages: &mut Stages<T>,
    update: impl Fn([&mut T; 2], T, [T; 2], [&mut T; 2]) + Sync,
) {
    let ([u0, v0], [du, dv]) = (&stages.start, &mut stages.sum);
    let moving = vectors.value.par_chunks_mut(CHUNK).zip(vectors.velocity.par_chunks_mut(CHUNK));
    let fixed = vectors.rate.par_chunks(CHUNK).zip(u0.par_chunks(CHUNK)).zip(v0.par_chunks(CHUNK));
    let sums = du.par_chunks_mut(CHUNK).zip(dv.par_chunks_mut(CHUNK));
    let inverse = vectors.relative_inertia.map(|by_place| by_place.inverse);
    moving.zip(fixed).zip(sums).enumerate().for_each(|(chunk, (((u, v), ((f, u0), v0)), (du, dv)))| {
        let moving = u.iter_mut().zip(v);
        let fixed = f.iter().zip(u0).zip(v0);
        let all = moving.zip(fixed).zip(du.iter_mut().zip(dv));
        match inverse {
            None => {
                for (((u, v), ((f, u0), v0)), (du, dv)) in all {
                    update([u, v], *f, [*u0, *v0], [du, dv]);
                }
            }
            Some(inverse) => {
                for (k, (((u, v), ((f, u0), v0)), (du, dv))) in all.enumerate() {
                    let inverse = inverse[(chunk * CHUNK + k) % inverse.len()];
                    update([u, v], *f * inverse, [*u0, *v0], [du, dv]);
                }
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::super::{Stage, System};
    use super::*;

    /// ü = −u − c u̇ + cos(2t), and the work of the force cos(2t).
    struct Oscillator {
        state: [f64; 3],
        driven: f64,
        load: f64,
        work: f64,
    }

    impl Oscillator {
        fn new(driven: f64) -> Self {
            Oscillator { state: [1.0, 0.0, driven - 1.0], driven, load: driven, work: 0.0 }
        }
        fn force(&mut self, t: f64) {
            self.load = self.driven * (2.0 * t).cos();
            self.state[2] = self.load - self.state[0];
        }
        fn energy(&self) -> f64 {
            0.5 * (self.state[0].powi(2) + self.state[1].powi(2))
        }
    }

    impl System for Oscillator {
        fn unknown(&mut self) -> Unknown<'_> {
            let [u, v, f] = self.state.each_mut().map(std::slice::from_mut);
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
        fn evolve(&mut self, t: f64, _: f64) {
            self.force(t);
        }
        fn stable_step(&self) -> f64 {
            2.0
        }
    }

    impl Staged for Oscillator {
        fn stage(&mut self, t: f64, _: f64, _: f64) {
            self.force(t);
        }
        fn book(&mut self, share: f64, _: f64, dt: f64) {
            self.work += share * dt * self.load * self.state[1];
        }
        fn arrive(&mut self, t: f64, _: f64) {
            self.force(t);
        }
    }

    fn run(driven: f64, damping: f64, dt: f64, n: u64) -> Oscillator {
        let mut system = Oscillator::new(driven);
        let (mut clock, mut memory) = (Clock::new(dt), Memory::default());
        for _ in 0..n {
            RungeKutta { damping }.step(&mut system, &mut clock, &mut memory);
        }
        system
    }

    #[test]
    fn a_damped_oscillator_converges_at_fourth_order() {
        for damping in [0.0, 0.5] {
            let w = f64::sqrt(1.0 - 0.25 * damping * damping);
            let exact = (-0.5 * damping).exp() * (w.cos() + 0.5 * damping / w * w.sin());
            let error = |n: u64| (run(0.0, damping, 1.0 / n as f64, n).state[0] - exact).abs();
            let order = (error(32) / error(64)).log2();
            // Halving the step leaves terms of relative size Δt beside the leading one.
            assert!((order - 4.0).abs() < 0.1, "damping {damping}: order {order}");
        }
    }

    /// cos 2t drives it: the states within a step must see the force of their own time. The work is a further unknown of
    /// the same method; the energy is quadratic, and in the balance of both the errors of fourth order cancel.
    #[test]
    fn a_driven_oscillator_converges_at_fourth_order_and_its_balance_at_fifth() {
        let exact = (4.0 * 1f64.cos() - 2f64.cos()) / 3.0;
        let errors = |n: u64| {
            let system = run(1.0, 0.0, 1.0 / n as f64, n);
            [(system.state[0] - exact).abs(), (system.energy() - 0.5 - system.work).abs()]
        };
        let [coarse, fine] = [errors(32), errors(64)];
        for (k, expected) in [4.0, 5.0].into_iter().enumerate() {
            let order = (coarse[k] / fine[k]).log2();
            assert!((order - expected).abs() < 0.15, "{k}: order {order}");
        }
    }

    #[test]
    fn energy_falls_as_the_amplification_factor_says() {
        // |1 + z + z²/2 + z³/6 + z⁴/24|² = 1 − x⁶/72 + x⁸/576 at z = ix.
        for dt in [0.1, 0.5, 2.0] {
            let factor: f64 = 1.0 - f64::powi(dt, 6) / 72.0 + f64::powi(dt, 8) / 576.0;
            let energy = run(0.0, 0.0, dt, 10).energy();
            // A few roundings a step.
            assert!((energy / (0.5 * factor.powi(10)) - 1.0).abs() < 1e-13, "{dt}: {energy}");
        }
    }

    /// Every frequency at and below the largest, with damping from weak to strong: stable at the step that is given, and not at
    /// one that is longer.
    #[test]
    fn damped_oscillators_are_stable_to_the_largest_step() {
        for c in [1e-6, 1e-2, 0.3, 1.0, 1.5, 2.0, 3.0, 10.0, 1e3] {
            let dt = RungeKutta { damping: c }.largest_step(2.0);
            let largest = |dt: f64| {
                let mut worst = 0.0f64;
                for k in 0..=100 {
                    // ü = −ω² u − c u̇, the amplification by the two real unknowns.
                    let w = (0.01 * f64::from(k)).powi(2);
                    let rate = |[u, v]: [f64; 2]| [v, -w * u - c * v];
                    let mut x = [1.0, -0.3];
                    for _ in 0..3000 {
                        let ahead = |k: [f64; 2], h: f64| rate([x[0] + h * k[0], x[1] + h * k[1]]);
                        let k1 = rate(x);
                        let k2 = ahead(k1, 0.5 * dt);
                        let k3 = ahead(k2, 0.5 * dt);
                        let k4 = ahead(k3, dt);
                        x = std::array::from_fn(|d| x[d] + dt / 6.0 * (k1[d] + 2.0 * (k2[d] + k3[d]) + k4[d]));
                    }
                    worst = worst.max(x[1].abs());
                }
                worst
            };
            // Nothing grows: |v| ≤ the largest it can be from |x| = 1.05 at ω ≤ 1 and any c, some 2.
            assert!(largest(0.999 * dt) < 3.0, "{c}: {dt}");
            // Weak damping makes longer steps stable, which are not asked for.
            if dt < 2.0 * RungeKutta::STABILITY {
                assert!(largest(1.01 * dt) > 100.0, "{c}: {dt}");
            }
            let most = RungeKutta::strongest_damping(dt * (1.0 - 1e-9), 2.0).expect("a stable step");
            // Weak damping is no limit.
            assert!(most >= c * (1.0 - 1e-6), "{c}: {most}");
        }
        // The real root of 1 + z/2 + z²/6 + z³/24 = 0, by Cardano's formula.
        let exact = 2.785293563405282;
        let found = 1e6 * RungeKutta { damping: 1e6 }.largest_step(2.0);
        // What a frequency of 1 takes off 1e6: 1e-12.
        assert!((found - exact).abs() < 1e-10, "{found}");
    }

    #[test]
    fn it_is_stable_to_two_square_roots_of_two() {
        let limit = 2.0 * RungeKutta::STABILITY;
        assert!(run(0.0, 0.0, 0.999 * limit, 2000).energy() < 0.5);
        assert!(run(0.0, 0.0, 1.001 * limit, 2000).energy() > 0.5);
    }
}
