//! The loops over bonds, written once: lattice or cloud, on all threads, with the same bits on any number of them.
//!
//! Every point gathers its own family in a fixed order; nothing is scattered, so there are no races and no atomics.
//! Reductions run over chunks of fixed size that are added in order. The only `unsafe` code of the library is here.

mod cloud;
mod lattice;

use std::ops::Range;

use rayon::prelude::*;

use crate::discretization::BondWeights;
use crate::family::{Body, Bond, BondKernel, BondStates, Families};

/// Which bonds break: asked only about bonds stretched beyond `threshold`.
pub trait BreakRule<const D: usize>: Sync {
    /// No bond whose stretch is at most this can break.
    fn threshold(&self) -> f64;
    /// Whether the bond between two slots breaks at this stretch. Must be symmetric in the slots.
    fn breaks(&self, here: usize, there: usize, stretch: f64) -> bool;
    /// Energy that a breaking bond takes with it on this side, J per unit of the point's volume.
    fn released(&self, bond: &Bond<D, f64>, here: usize, there: usize) -> f64;
}

/// Nothing breaks.
pub struct Unbreakable;

impl<const D: usize> BreakRule<D> for Unbreakable {
    fn threshold(&self) -> f64 {
        f64::INFINITY
    }
    fn breaks(&self, _: usize, _: usize, _: f64) -> bool {
        false
    }
    fn released(&self, _: &Bond<D, f64>, _: usize, _: usize) -> f64 {
        0.0
    }
}

/// What one pass over the bonds broke.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Broken {
    /// Directed bonds: each broken pair counts at both ends.
    pub bonds: u64,
    /// J
    pub energy: f64,
}

/// The loops and their scratch memory. Threads are those of the rayon pool in which it is called.
#[derive(Debug, Default)]
pub struct Exec {
    broken: Vec<Broken>,
    partial: Vec<[f64; 4]>,
}

/// Points in a chunk of a reduction. Fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 4096;

impl Exec {
    /// output(x) = Σ kernel(bond, input(x), input(x′)) over the bonds of x that hold.
    ///
    /// Every slot of a present point is written; slots without a point are left alone.
    pub fn sum_bonds<const D: usize, const I: usize, const O: usize>(
        &mut self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        input: [&[f64]; I],
        output: [&mut [f64]; O],
        kernel: &impl BondKernel<D, I, O>,
    ) {
        // SAFETY of the cast: with `Unbreakable` the loops never write to the states.
        let states = StatesPointer::shared(states);
        self.pass(body, weights, states, input, output, kernel, &Unbreakable);
    }

    /// As [`Exec::sum_bonds`], but bonds that `rule` breaks at these input values are broken first, at both ends.
    #[allow(clippy::too_many_arguments)] // the summand, its data and the rule: nothing that belongs in one struct
    pub fn sum_bonds_and_break<const D: usize, const I: usize, const O: usize>(
        &mut self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &mut BondStates,
        input: [&[f64]; I],
        output: [&mut [f64]; O],
        kernel: &impl BondKernel<D, I, O>,
        rule: &impl BreakRule<D>,
    ) -> Broken {
        self.pass(body, weights, StatesPointer::exclusive(states), input, output, kernel, rule)
    }

    #[allow(clippy::too_many_arguments)]
    fn pass<const D: usize, const I: usize, const O: usize>(
        &mut self,
        body: &Body<D>,
        weights: &BondWeights,
        states: StatesPointer,
        input: [&[f64]; I],
        output: [&mut [f64]; O],
        kernel: &impl BondKernel<D, I, O>,
        rule: &impl BreakRule<D>,
    ) -> Broken {
        let n = body.cloud.n_slots();
        assert!(input.iter().all(|f| f.len() == n), "input fields have the length of the cloud");
        assert!(output.iter().all(|f| f.len() == n), "output fields have the length of the cloud");
        let output = output.map(|f| SharedSlice(f.as_mut_ptr()));
        match (&body.families, weights) {
            (Families::Lattice(families), BondWeights::Lattice(weights)) => {
                let geometry = lattice::View::new(body, families, weights);
                let chunks = geometry.n_chunks();
                self.broken.resize(chunks, Broken::default());
                self.broken.par_iter_mut().enumerate().for_each(|(chunk, broken)| {
                    *broken = lattice::pass(&geometry, chunk, states, input, output, kernel, rule);
                });
            }
            (Families::Cloud(families), BondWeights::Cloud(weights)) => {
                let chunks = n.div_ceil(cloud::CHUNK);
                self.broken.resize(chunks, Broken::default());
                self.broken.par_iter_mut().enumerate().for_each(|(chunk, broken)| {
                    let points = chunk * cloud::CHUNK..((chunk + 1) * cloud::CHUNK).min(n);
                    *broken = cloud::pass(body, families, weights, points, states, input, output, kernel, rule);
                });
            }
            _ => unreachable!("weights are built on the families of their body"),
        }
        self.broken
            .iter()
            .fold(Broken::default(), |sum, b| Broken { bonds: sum.bonds + b.bonds, energy: sum.energy + b.energy })
    }

    /// Σ over 0..n of four numbers at a time, in chunks of fixed size added in order.
    pub fn sum(&mut self, n: usize, partial: impl Fn(Range<usize>) -> [f64; 4] + Sync) -> [f64; 4] {
        self.partial.resize(n.div_ceil(CHUNK), [0.0; 4]);
        self.partial.par_iter_mut().enumerate().for_each(|(chunk, sum)| {
            *sum = partial(chunk * CHUNK..((chunk + 1) * CHUNK).min(n));
        });
        self.partial.iter().fold([0.0; 4], |a, b| std::array::from_fn(|k| a[k] + b[k]))
    }
}

/// An output component that chunks write at disjoint places.
#[derive(Clone, Copy)]
struct SharedSlice(*mut f64);
// SAFETY: `pass` gives each chunk its own slots, and no slot to two chunks.
unsafe impl Send for SharedSlice {}
unsafe impl Sync for SharedSlice {}

/// The bond states, read by all chunks; each chunk writes only the words of its own points.
#[derive(Clone, Copy)]
enum StatesPointer {
    Lattice(*mut u16),
    Cloud(*mut u8),
}
// SAFETY: as above; a point's words are read and written by the chunk that owns the point alone.
unsafe impl Send for StatesPointer {}
unsafe impl Sync for StatesPointer {}

impl StatesPointer {
    fn shared(states: &BondStates) -> Self {
        match states {
            BondStates::Lattice(words) => StatesPointer::Lattice(words.as_ptr().cast_mut()),
            BondStates::Cloud(bytes) => StatesPointer::Cloud(bytes.as_ptr().cast_mut()),
        }
    }

    fn exclusive(states: &mut BondStates) -> Self {
        match states {
            BondStates::Lattice(words) => StatesPointer::Lattice(words.as_mut_ptr()),
            BondStates::Cloud(bytes) => StatesPointer::Cloud(bytes.as_mut_ptr()),
        }
    }
}
