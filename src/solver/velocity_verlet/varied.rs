//! Velocity Verlet where inertia differs from place to place. Runs of places that have the same are told so, and spare the
//! memory that as many numbers would have to be fetched from.

use rayon::prelude::*;

use super::{CHUNK, Drift, Kick, LANES, unless_below};
use crate::execution::{Sweep, wide};
use crate::field::Number;
use crate::unknown::RelativeInertia;

const RUN: usize = RelativeInertia::<f64>::RUN;
const _: () = assert!(CHUNK.is_multiple_of(RUN) && RUN.is_multiple_of(LANES));

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
        let inertia = inertia.zip(by_place.alike.chunks(CHUNK / RUN));
        velocity.chunks_mut(CHUNK).zip(rate.chunks(CHUNK)).zip(inertia)
    });
    let part = |((velocity, rate), ((relative, inverse), alike))| Part {
        velocity,
        rate,
        inertia: RelativeInertia { relative, inverse, alike },
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
        let mut squares = [0.0; LANES];
        let [relative, inverse] = [self.inertia.relative, self.inertia.inverse];
        for (k, (v, f)) in self.velocity.iter_mut().zip(self.rate).enumerate() {
            *v = kicked(&self.kick, *v, *f, relative[k], inverse[k], &mut squares[k % LANES]);
        }
        squares.iter().sum()
    }
}

struct Pass<'a, T, const PENDING: bool> {
    kick: Kick<T>,
    /// 1 − c Δt/2, Δt, and what counts as zero.
    by: [T; 3],
    part: Part<'a, T>,
    value: &'a mut [T],
}

impl<T: Number, const PENDING: bool> Sweep for Pass<'_, T, PENDING> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let Pass { kick, by, part: Part { velocity, rate, inertia }, value } = self;
        let mut squares = [0.0; LANES];
        let ((us, u), (vs, v)) = (value.as_chunks_mut::<RUN>(), velocity.as_chunks_mut::<RUN>());
        let ((fs, f), (ms, m)) = (rate.as_chunks::<RUN>(), inertia.relative.as_chunks::<RUN>());
        let (is, i) = inertia.inverse.as_chunks::<RUN>();
        for ((((u, v), f), (m, i)), alike) in us.iter_mut().zip(vs).zip(fs).zip(ms.iter().zip(is)).zip(inertia.alike) {
            if *alike {
                let (m, i) = (m[0], i[0]);
                for k in 0..RUN {
                    Self::one(&kick, by, &mut u[k], &mut v[k], f[k], [m, i], &mut squares[k % LANES]);
                }
            } else {
                for k in 0..RUN {
                    Self::one(&kick, by, &mut u[k], &mut v[k], f[k], [m[k], i[k]], &mut squares[k % LANES]);
                }
            }
        }
        for k in 0..u.len() {
            Self::one(&kick, by, &mut u[k], &mut v[k], f[k], [m[k], i[k]], &mut squares[k % LANES]);
        }
        squares.iter().sum()
    }
}

impl<T: Number, const PENDING: bool> Pass<'_, T, PENDING> {
    #[inline(always)]
    fn one(
        kick: &Kick<T>,
        [keep, dt, still]: [T; 3],
        u: &mut T,
        v: &mut T,
        f: T,
        [relative, inverse]: [T; 2],
        square: &mut f64,
    ) {
        if PENDING {
            *v = kicked(kick, *v, f, relative, inverse, square);
        }
        *v = unless_below(kick.slow, keep * *v + kick.factor * (f * inverse));
        *u = unless_below(still, *u + dt * *v);
    }
}

/// The last kick of a step at a place; adds v² ρ/ρ₀.
#[inline(always)]
fn kicked<T: Number>(kick: &Kick<T>, v: T, f: T, relative: T, inverse: T, square: &mut f64) -> T {
    let v = unless_below(kick.slow, (v + kick.factor * (f * inverse)) * kick.after);
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
        for n in [CHUNK + 3 * RUN + 5, 40] {
            // Powers of two, so that nothing is rounded; runs that are alike and runs that are not.
            let relative: Vec<f64> =
                (0..n).map(|k| if (k / RUN).is_multiple_of(2) { 2.0 } else { [1.0, 4.0][k % 2] }).collect();
            let inverse: Vec<f64> = relative.iter().map(|m| 1.0 / m).collect();
            let alike: Vec<bool> = relative.chunks(RUN).map(|run| run.iter().all(|m| *m == run[0])).collect();
            let by_place = RelativeInertia { relative: &relative, inverse: &inverse, alike: &alike };
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
