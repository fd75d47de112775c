//! What the machine can do at most, measured by the program itself: what a measured speed is a fraction of.
//!
//! Both limits are taken on the threads of the rayon pool in which they are asked for, as the fastest of several short
//! repetitions, so that neighbours on a shared machine disturb them little.

use std::hint::black_box;
use std::marker::PhantomData;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::packs::{Instructions, Pack, Packs};
use crate::field::{Double, Precision, Single};

/// Which loops [`compiled!`] compiles for wide registers: all but those of bars.
const D: usize = 3;

/// The limits of the machine on some number of threads.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    pub threads: usize,
    /// Memory bandwidth, bytes a second: the triad of STREAM.
    pub bandwidth: f64,
    /// Floating-point operations a second in `f64`, on the widest instructions that the loops run on.
    pub peak_double: f64,
    /// The same in `f32`.
    pub peak_single: f64,
}

impl Limits {
    /// Measures for about a second.
    pub fn measure() -> Self {
        Limits {
            threads: rayon::current_num_threads(),
            bandwidth: bandwidth(),
            peak_double: peak::<Double>(),
            peak_single: peak::<Single>(),
        }
    }
}

/// Time that is spent on repetitions of one measurement.
const BUDGET: Duration = Duration::from_millis(250);

/// `amount` a second, by the fastest of some calls of `work`.
fn rate(amount: f64, mut work: impl FnMut()) -> f64 {
    let begin = Instant::now();
    let mut fastest = f64::INFINITY;
    for call in 0.. {
        if call > 2 && begin.elapsed() > BUDGET {
            break;
        }
        let start = Instant::now();
        work();
        fastest = fastest.min(start.elapsed().as_secs_f64());
    }
    amount / fastest
}

/// The triad of McCalpin's STREAM, a = b + s c: bytes a second.
///
/// Counted as STREAM counts: 24 bytes an element, two numbers read and one written. That the line of `a` is read before
/// it is written, where the processor does so, is not counted. An array has 128 MiB, and 16 MiB a thread where that is
/// more: beyond the caches.
fn bandwidth() -> f64 {
    const CHUNK: usize = 1 << 16;
    let n = (16 << 20).max((2 << 20) * rayon::current_num_threads());
    // Each thread is the first to touch its part, as far as the pool shares out alike.
    let filled = |value: f64| (0..n).into_par_iter().with_min_len(CHUNK).map(|_| value).collect::<Vec<f64>>();
    let (mut a, b, c) = (filled(0.0), filled(1.0), filled(2.0));
    let scale = black_box(3.0);
    rate(24.0 * n as f64, || {
        let chunks = a.par_chunks_mut(CHUNK).zip(b.par_chunks(CHUNK)).zip(c.par_chunks(CHUNK));
        chunks.for_each(|((a, b), c)| {
            for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
                *a = b + scale * c;
            }
        });
        black_box(&a);
    })
}

/// Multiplications and additions a second in the arithmetic of bonds, each counted as one, on all threads.
fn peak<P: Packs>() -> f64 {
    const ROUNDS: usize = 1 << 21;
    let instructions = *Instructions::available().last().unwrap_or(&Instructions::Baseline);
    let chains = Chains::<P> { instructions, precision: PhantomData };
    // SAFETY: these instructions are on this machine.
    let operations = || unsafe { chains.run(ROUNDS) };
    let total = rayon::broadcast(|_| operations()).into_iter().sum();
    rate(total, || {
        rayon::broadcast(|_| operations());
    })
}

/// Chains of multiply-adds that do not wait for each other.
struct Chains<P: Precision> {
    instructions: Instructions,
    precision: PhantomData<P>,
}

/// Registers that take part: more than latency × throughput of any processor, few enough for sixteen registers.
const REGISTERS: usize = 12;

impl<P: Packs> Chains<P> {
    compiled!(run, run_on, run_avx2, run_avx512 if true, [], (rounds: usize), f64);

    /// Runs `rounds` multiply-adds in each register; returns how many operations that were.
    #[inline(always)]
    unsafe fn run_on<V: Pack<P::Bond>>(&self, rounds: usize) -> f64 {
        // A pack of `f64` is two registers, one of `f32` is one.
        let packs = if V::SINGLE { REGISTERS } else { REGISTERS / 2 };
        let (factor, term) = (V::splat(black_box(0.5)), V::splat(black_box(1.0)));
        let mut chains = [V::splat(0.0); REGISTERS];
        for k in 0..packs {
            chains[k] = V::splat(black_box(k as f64));
        }
        for _ in 0..rounds {
            for k in 0..packs {
                chains[k] = chains[k].mul_add(factor, term);
            }
        }
        let mut sum = term;
        for chain in chains {
            sum = sum + chain;
        }
        black_box(sum.largest());
        2.0 * (rounds * packs * V::LANES) as f64
    }
}
