//! Velocity Verlet where inertia differs from place to place.

use rayon::prelude::*;

use super::{CHUNK, Drift, Kick, LANES, unless_below};
use crate::execution::{Sweep, wide};
use crate::field::Number;
use crate::unknown::RelativeInertia;

/// Part of a component.
struct Part<'a, T> {
    velocity: &'a mut [T],
    rate: &'a [T],
    inertia: RelativeInertia<'a, T>,
}

/// The parts of the components of flat vectors, each with what `beside` has of it.
fn parts<'a, T, B>(
    velocity: &'a mut [T],
    rate: &'a [T],
    by_place: RelativeInertia<'a, T>,
    beside: impl Iterator<Item = B>,
) -> Vec<(Part<'a, T>, B)> {
    let n = by_place.relative.len();
    let components = velocity.chunks_mut(n).zip(rate.chunks(n));
    let all = components.flat_map(|(velocity, rate)| {
        let inertia = by_place.relative.chunks(CHUNK).zip(by_place.inverse.chunks(CHUNK));
        velocity.chunks_mut(CHUNK).zip(rate.chunks(CHUNK)).zip(inertia)
    });
    let part = |((velocity, rate), (relative, inverse))| Part {
        velocity,
        rate,
        inertia: RelativeInertia { relative, inverse },
    };
    all.map(part).zip(beside).collect()
}

/// The last half kick of a step: Σ v² ρ/ρ₀.
pub(super) fn finish<T: Number>(
    kick: Kick<T>,
    velocity: &mut [T],
    rate: &[T],
    by_place: RelativeInertia<'_, T>,
) -> f64 {
    let parts = parts(velocity, rate, by_place, std::iter::repeat(()));
    let sum = |(Part { velocity, rate, inertia }, ())| wide(LastKick { kick, velocity, rate, inertia });
    parts.into_par_iter().map(sum).collect::<Vec<f64>>().iter().sum()
}

/// As [`Drift::everywhere`]; `damped` is empty or gets u + τ v.
pub(super) fn everywhere<T: Number>(
    drift: &Drift,
    value: &mut [T],
    velocity: &mut [T],
    rate: &[T],
    damped: &mut [T],
    by_place: RelativeInertia<'_, T>,
) -> f64 {
    let n = by_place.relative.len();
    let values = value.chunks_mut(n).flat_map(|component| component.chunks_mut(CHUNK));
    let [keep, dt, still] = [drift.keep, drift.dt, drift.still].map(T::from_f64);
    let kick = Kick::new(drift);
    let parts = parts(velocity, rate, by_place, values);
    let sums: Vec<f64> = if drift.pending {
        let sum = |(part, value)| wide(Pass::<_, true> { kick, by: [keep, dt, still], part, value });
        parts.into_par_iter().map(sum).collect()
    } else {
        let sum = |(part, value)| wide(Pass::<_, false> { kick, by: [keep, dt, still], part, value });
        parts.into_par_iter().map(sum).collect()
    };
    let tau = T::from_f64(drift.tau);
    for ((damped, u), v) in damped.iter_mut().zip(value).zip(velocity) {
        *damped = *u + tau * *v;
    }
    sums.iter().sum()
}

struct LastKick<'a, T> {
    kick: Kick<T>,
    velocity: &'a mut [T],
    rate: &'a [T],
    inertia: RelativeInertia<'a, T>,
}

impl<T: Number> Sweep for LastKick<'_, T> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let LastKick { kick, velocity, rate, inertia: RelativeInertia { relative, inverse } } = self;
        let mut squares = [0.0; LANES];
        let ((vs, v), (fs, f)) = (velocity.as_chunks_mut::<LANES>(), rate.as_chunks::<LANES>());
        let ((ms, m), (is, i)) = (relative.as_chunks::<LANES>(), inverse.as_chunks::<LANES>());
        for (((v, f), m), i) in vs.iter_mut().zip(fs).zip(ms).zip(is) {
            for k in 0..LANES {
                v[k] = kicked(&kick, v[k], f[k], [m[k], i[k]], &mut squares[k]);
            }
        }
        for k in 0..v.len() {
            v[k] = kicked(&kick, v[k], f[k], [m[k], i[k]], &mut squares[k]);
        }
        squares.iter().sum()
    }
}

struct Pass<'a, T, const PENDING: bool> {
    kick: Kick<T>,
    /// What damping leaves, Δt, and what counts as zero.
    by: [T; 3],
    part: Part<'a, T>,
    value: &'a mut [T],
}

impl<T: Number, const PENDING: bool> Sweep for Pass<'_, T, PENDING> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let Pass { kick, by, part: Part { velocity, rate, inertia: RelativeInertia { relative, inverse } }, value } =
            self;
        let mut squares = [0.0; LANES];
        let ((us, u), (vs, v)) = (value.as_chunks_mut::<LANES>(), velocity.as_chunks_mut::<LANES>());
        let (fs, f) = rate.as_chunks::<LANES>();
        let ((ms, m), (is, i)) = (relative.as_chunks::<LANES>(), inverse.as_chunks::<LANES>());
        for ((((u, v), f), m), i) in us.iter_mut().zip(vs).zip(fs).zip(ms).zip(is) {
            Self::some(&kick, by, u, v, [f, m, i], &mut squares);
        }
        Self::some(&kick, by, u, v, [f, m, i], &mut squares);
        squares.iter().sum()
    }
}

impl<T: Number, const PENDING: bool> Pass<'_, T, PENDING> {
    /// Of at most as many places as there are lanes. That nothing else is where `u` and `v` are is known of arguments alone;
    /// without it the compiler makes no vectors of this.
    #[inline(always)]
    fn some(
        kick: &Kick<T>,
        [keep, dt, still]: [T; 3],
        u: &mut [T],
        v: &mut [T],
        [f, relative, inverse]: [&[T]; 3],
        squares: &mut [f64; LANES],
    ) {
        for k in 0..u.len() {
            if PENDING {
                v[k] = kicked(kick, v[k], f[k], [relative[k], inverse[k]], &mut squares[k]);
            }
            v[k] = unless_below(kick.slow, keep * v[k] + kick.factor * (f[k] * inverse[k]));
            u[k] = unless_below(still, u[k] + dt * v[k]);
        }
    }
}

/// The last kick of a step at a place; adds v² ρ/ρ₀.
#[inline(always)]
fn kicked<T: Number>(kick: &Kick<T>, v: T, f: T, [relative, inverse]: [T; 2], square: &mut f64) -> T {
    let v = unless_below(kick.slow, kick.after * v + kick.last * (f * inverse));
    *square += v.to_f64() * v.to_f64() * relative.to_f64();
    v
}

#[cfg(test)]
mod tests {
    use super::super::*;
    use super::*;
    use crate::unknown::Vectors;

    /// Places of unlike inertia under a constant force move as places of one inertia under the force over theirs.
    #[test]
    fn unlike_inertia_is_a_force_over_it() {
        for n in [CHUNK + 3 * LANES + 5, 40] {
            // Powers of two, so that nothing is rounded.
            let relative: Vec<f64> = (0..n).map(|k| [1.0, 2.0, 4.0][k % 3]).collect();
            let inverse: Vec<f64> = relative.iter().map(|m| 1.0 / m).collect();
            let by_place = RelativeInertia { relative: &relative, inverse: &inverse };
            let flat = |of: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..2 * n).map(of).collect() };
            let force = flat(&|k| ((k * 7919) % 101) as f64 - 50.0);
            let over = flat(&|k| force[k] * inverse[k % n]);
            let start = [flat(&|k| ((k * 31) % 17) as f64), flat(&|k| ((k * 13) % 29) as f64)];
            for (pending, damped) in [(false, false), (true, false), (true, true)] {
                let run = |force: &[f64], by_place| {
                    let ([mut u, mut v], mut force) = (start.clone(), force.to_vec());
                    let mut other = vec![0.0; if damped { 2 * n } else { 0 }];
                    let mut unknown = Unknown {
                        vectors: crate::unknown::Numbers::Double(Vectors {
                            value: &mut u,
                            velocity: &mut v,
                            rate: &mut force,
                            damped: damped.then_some((0.5, &mut other[..])),
                            relative_inertia: by_place,
                        }),
                        components: 2,
                        inertia: 1.0,
                        negligible: 0.0,
                    };
                    let drift = Drift::new(&VelocityVerlet { damping: 0.25 }, &unknown, 0.125, pending);
                    let squares = drift.everywhere(&mut unknown);
                    (u, v, other, squares)
                };
                let (plain, varied) = (run(&over, None), run(&force, Some(by_place)));
                assert!(plain.0 == varied.0 && plain.1 == varied.1 && plain.2 == varied.2, "{n} {pending} {damped}");
                // Kinetic energies: of one inertia at a time.
                assert_eq!(pending, varied.3 > plain.3);
            }
        }
    }
}
