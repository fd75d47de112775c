//! The loops over bonds, written once: lattice or cloud, on all threads, with the same bits on any number of them.
//!
//! Every point gathers its own family in a fixed order; nothing is scattered, so there are no races and no atomics.
//! Reductions run over chunks of fixed size that are added in order. The only `unsafe` code of the library is here.

/// Compiles `$generic::<Pack, …>`, a method that is inlined, for each set of instructions, and defines `$name`, which
/// calls the one that the machine has.
macro_rules! compiled {
    (
        $name:ident, $generic:ident, $avx2:ident, $avx512:ident if $widest:expr,
        [$(with $($n:ident: $type:ident),*)? $(rule $t:ident: $bound:path)?], ($($argument:ident: $of:ty),*), $returns:ty
    ) => {
        /// # Safety
        /// As of the method for all packs; `self.instructions` must be on this machine.
        #[inline(never)]
        pub unsafe fn $name<$($(const $n: $type),*)? $($t: $bound)?>(&self, $($argument: $of),*) -> $returns {
            // SAFETY: `Instructions` are given out for this machine alone.
            unsafe {
                if D == 1 {
                    // Bars are small: a third of the kernels need not be compiled.
                    return self.$generic::<P::Baseline, $($($n),*)? $($t)?>($($argument),*);
                }
                match self.instructions {
                    #[cfg(target_arch = "x86_64")]
                    Instructions::Avx512 if $widest => self.$avx512::<$($($n),*)? $($t)?>($($argument),*),
                    // Whatever has AVX-512 has AVX2, which fuses alike: the bits are the same.
                    #[cfg(target_arch = "x86_64")]
                    Instructions::Avx512 | Instructions::Avx2 => self.$avx2::<$($($n),*)? $($t)?>($($argument),*),
                    Instructions::Baseline => self.$generic::<P::Baseline, $($($n),*)? $($t)?>($($argument),*),
                }
            }
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,fma")]
        #[inline(never)]
        unsafe fn $avx512<$($(const $n: $type),*)? $($t: $bound)?>(&self, $($argument: $of),*) -> $returns {
            unsafe { self.$generic::<P::Avx512, $($($n),*)? $($t)?>($($argument),*) }
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma")]
        #[inline(never)]
        unsafe fn $avx2<$($(const $n: $type),*)? $($t: $bound)?>(&self, $($argument: $of),*) -> $returns {
            unsafe { self.$generic::<P::Avx2, $($($n),*)? $($t)?>($($argument),*) }
        }
    };
}

mod blocks;
mod cloud;
mod collocation;
mod each_bond;
pub mod gradients;
mod lattice;
pub mod machine;
mod packs;
mod point_rows;
mod rows;

use std::ops::Range;

use rayon::prelude::*;

use crate::discretization::BondWeights;
use crate::family::{Body, Bond, BondKernel, BondStates, Families};
use crate::field::Number;
use crate::geometry::lattice::BLOCK;
use crate::lane::Lane;
use crate::visit::Visitor;
pub use blocks::BlockRow;
pub use collocation::{Limits, Motion};
pub use packs::{Instructions, Packs};
pub use point_rows::PointRows;

/// A loop over plain vectors, for [`wide`]. `run` must be `#[inline(always)]`, and all that it calls: only what is inlined is
/// compiled for wide registers.
pub trait Sweep {
    type Output;
    fn run(self) -> Self::Output;
}

/// Runs a loop, compiled for the registers of AVX-512 or AVX2 where the machine has them: more numbers at once than the
/// baseline's two. Nothing is fused, so the bits are those of the baseline.
#[inline(always)]
pub fn wide<S: Sweep>(sweep: S) -> S::Output {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx512f,avx512vl,avx512dq")]
        fn on_avx512<S: Sweep>(sweep: S) -> S::Output {
            sweep.run()
        }
        #[target_feature(enable = "avx2")]
        fn on_avx2<S: Sweep>(sweep: S) -> S::Output {
            sweep.run()
        }
        if is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512dq")
        {
            // SAFETY: the machine has them.
            return unsafe { on_avx512(sweep) };
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has it.
            return unsafe { on_avx2(sweep) };
        }
    }
    sweep.run()
}

/// Which bonds break: asked only about bonds strained beyond `threshold`, in the strain of the kernel.
pub trait BreakRule<const D: usize>: Sync {
    /// Whether no bond ever breaks, so that nothing need be compiled for it.
    const NEVER: bool = false;
    /// No bond whose strain is at most this can break.
    fn threshold(&self) -> f64;
    /// Whether the bond between two slots breaks at this strain. Must be symmetric in the slots.
    fn breaks(&self, here: usize, there: usize, strain: f64) -> bool;
    /// Energy that a breaking bond takes with it on this side, J per unit of the point's volume.
    fn released(&self, bond: &Bond<D, f64>, here: usize, there: usize) -> f64;
}

/// Nothing breaks.
pub struct Unbreakable;

impl<const D: usize> BreakRule<D> for Unbreakable {
    const NEVER: bool = true;
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
#[derive(Debug)]
pub struct Exec {
    instructions: Instructions,
    broken: Vec<Broken>,
    partial: Vec<[f64; 4]>,
    /// Input values of a cloud, a record a point.
    double: Vec<[f64; 4]>,
    single: Vec<[f32; 4]>,
    /// Blocks of a lattice that sums run over; all if None.
    within: Option<Vec<u32>>,
}

impl Default for Exec {
    /// On the widest instructions that this machine has.
    fn default() -> Self {
        Exec::on(*Instructions::available().last().unwrap_or(&Instructions::Baseline))
    }
}

/// Points in a chunk of a reduction. Fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 4096;

impl Exec {
    /// On a set of instructions that [`Instructions::available`] has.
    ///
    /// # Panics
    /// If this machine does not have it.
    pub fn on(instructions: Instructions) -> Self {
        assert!(Instructions::available().contains(&instructions), "{instructions:?} is not on this machine");
        let (double, single) = (Vec::new(), Vec::new());
        Exec { instructions, broken: Vec::new(), partial: Vec::new(), double, single, within: None }
    }

    /// From here on, sums over bonds of a lattice leave out all but these blocks, and do not write there.
    pub fn within(&mut self, blocks: &[u32]) {
        let within = self.within.get_or_insert_default();
        within.clear();
        within.extend_from_slice(blocks);
    }

    /// Shows what [`Exec::within`] has set.
    pub fn visit(&mut self, visitor: &mut dyn Visitor) {
        if let Some(within) = &mut self.within {
            visitor.indices("blocks_summed", within);
        }
    }

    /// output(x) = Σ kernel(bond, input(x), input(x′)) over the bonds of x that hold. Linear kernels are summed as rows
    /// on lattices, where the bonds of a block all hold.
    ///
    /// Every slot of a present point is written; slots without a point are left alone.
    pub fn sum_bonds<const D: usize, const I: usize, const O: usize, P: Packs>(
        &mut self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        input: [&[P::Field]; I],
        output: [&mut [P::Field]; O],
        kernel: &impl BondKernel<D, I, O>,
    ) {
        // SAFETY of the cast: with `Unbreakable` the loops never write to the states.
        let states = StatesPointer::shared(states);
        let memory = Memory::none();
        self.each_path::<D, I, 0, O, P, _, _>(body, weights, states, (input, []), memory, output, kernel, &Unbreakable);
    }

    /// The same with values that are added instead of subtracted.
    #[allow(clippy::too_many_arguments)] // as below
    pub fn sum_bonds_adding<const D: usize, const I: usize, const A: usize, const O: usize, P: Packs>(
        &mut self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        input: [&[P::Field]; I],
        added: [&[P::Field]; A],
        output: [&mut [P::Field]; O],
        kernel: &impl BondKernel<D, I, O, A>,
    ) {
        // SAFETY of the cast: as above.
        let states = StatesPointer::shared(states);
        let (input, memory) = ((input, added), Memory::none());
        self.each_path::<D, I, A, O, P, _, _>(body, weights, states, input, memory, output, kernel, &Unbreakable);
    }

    /// As [`Exec::sum_bonds`], but bonds that `rule` breaks at these input values are broken first, at both ends.
    #[allow(clippy::too_many_arguments)] // the summand, its data and the rule: nothing that belongs in one struct
    pub fn sum_bonds_and_break<const D: usize, const I: usize, const O: usize, P: Packs>(
        &mut self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &mut BondStates,
        input: [&[P::Field]; I],
        output: [&mut [P::Field]; O],
        kernel: &impl BondKernel<D, I, O>,
        rule: &impl BreakRule<D>,
    ) -> Broken {
        let states = StatesPointer::exclusive(states);
        self.each_path::<D, I, 0, O, P, _, _>(body, weights, states, (input, []), Memory::none(), output, kernel, rule)
    }

    /// The same of a kernel that keeps a number of each bond: `memory` has one for each bit of the states, and gets what
    /// the kernel makes of it if `keeps`.
    ///
    /// # Panics
    /// If there are fewer numbers.
    #[allow(clippy::too_many_arguments)] // as above
    pub fn sum_bonds_remembering<const D: usize, const I: usize, const O: usize, P: Packs>(
        &mut self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &mut BondStates,
        input: [&[P::Field]; I],
        (memory, keeps): (&mut [P::Bond], bool),
        output: [&mut [P::Field]; O],
        kernel: &impl BondKernel<D, I, O>,
        rule: &impl BreakRule<D>,
    ) -> Broken {
        assert_eq!(memory.len(), BLOCK * body.n_words(), "a number for each bit");
        let memory = Memory { numbers: SharedSlice(memory.as_mut_ptr()), keeps };
        let states = StatesPointer::exclusive(states);
        self.each_path::<D, I, 0, O, P, _, _>(body, weights, states, (input, []), memory, output, kernel, rule)
    }

    #[allow(clippy::too_many_arguments, clippy::type_complexity)] // as above; two lists of fields
    fn each_path<const D: usize, const I: usize, const A: usize, const O: usize, P, K, R>(
        &mut self,
        body: &Body<D>,
        weights: &BondWeights,
        states: StatesPointer,
        (input, added): ([&[P::Field]; I], [&[P::Field]; A]),
        memory: Memory<P::Bond>,
        output: [&mut [P::Field]; O],
        kernel: &K,
        rule: &R,
    ) -> Broken
    where
        P: Packs,
        K: BondKernel<D, I, O, A>,
        R: BreakRule<D>,
    {
        let n = body.cloud.n_slots();
        assert!(input.iter().chain(&added).all(|f| f.len() == n), "input fields have the length of the cloud");
        assert!(output.iter().all(|f| f.len() == n), "output fields have the length of the cloud");
        assert!(!K::MEMORY || !memory.numbers.0.is_null(), "a kernel with memory is given it");
        let output = output.map(|f| SharedSlice(f.as_mut_ptr()));
        let instructions = self.instructions;
        match &body.families {
            Families::Lattice(families) => {
                let within = self.within.take();
                let view = &lattice::View::new(families, weights, within.as_deref());
                let sum = lattice::Sum::<D, I, A, O, P, _> {
                    instructions,
                    view,
                    states,
                    input,
                    added,
                    memory,
                    output,
                    kernel,
                };
                let broken = if K::LINEAR && R::NEVER {
                    let sum = rows::Sum::new(&sum);
                    self.each_chunk(view.n_chunks(), &|chunk| {
                        sum.run(chunk);
                        Broken::default()
                    })
                } else {
                    self.each_chunk(view.n_chunks(), &|chunk| sum.run(chunk, rule))
                };
                self.within = within;
                broken
            }
            Families::Cloud(families) => {
                let (weights, heterogeneity) = (&weights.by_length, weights.heterogeneity.as_deref());
                let mut records = std::mem::take(P::records(&mut self.double, &mut self.single));
                let values: Vec<&[P::Field]> = input.iter().chain(&added).copied().collect();
                cloud::gather_input(&values, &mut records);
                let (sites, input) = (P::sites(&families.sites), &records[..]);
                let sum = cloud::Sum::<D, I, A, O, P, _> {
                    instructions,
                    families,
                    weights,
                    heterogeneity,
                    profile: weights.profile(sites.volume_unit, <P::Baseline as Lane>::SINGLE),
                    sites,
                    states,
                    input,
                    memory,
                    output,
                    kernel,
                };
                let broken = self.each_chunk(n.div_ceil(cloud::CHUNK), &|chunk| {
                    sum.run(chunk * cloud::CHUNK..((chunk + 1) * cloud::CHUNK).min(n), rule)
                });
                *P::records(&mut self.double, &mut self.single) = records;
                broken
            }
        }
    }

    /// Runs `work` on every chunk, and adds what broke in their order. Not generic, so that it is compiled once.
    fn each_chunk(&mut self, n_chunks: usize, work: &(dyn Fn(usize) -> Broken + Sync)) -> Broken {
        self.broken.resize(n_chunks, Broken::default());
        self.broken.par_iter_mut().enumerate().for_each(|(chunk, broken)| *broken = work(chunk));
        self.broken
            .iter()
            .fold(Broken::default(), |sum, b| Broken { bonds: sum.bonds + b.bonds, energy: sum.energy + b.energy })
    }

    /// Σ over 0..n of four numbers at a time, in chunks of fixed size added in order.
    pub fn sum(&mut self, n: usize, partial: &(dyn Fn(Range<usize>) -> [f64; 4] + Sync)) -> [f64; 4] {
        self.partial.resize(n.div_ceil(CHUNK), [0.0; 4]);
        self.partial.par_iter_mut().enumerate().for_each(|(chunk, sum)| {
            *sum = partial(chunk * CHUNK..((chunk + 1) * CHUNK).min(n));
        });
        self.partial.iter().fold([0.0; 4], |a, b| std::array::from_fn(|k| a[k] + b[k]))
    }
}

/// A component of a field that chunks write at disjoint places, and read where none writes.
#[derive(Clone, Copy)]
struct SharedSlice<T>(*mut T);
// SAFETY: what uses it gives each chunk its own slots to write, no slot to two chunks, and lets none be read meanwhile.
unsafe impl<T: Number> Send for SharedSlice<T> {}
unsafe impl<T: Number> Sync for SharedSlice<T> {}

/// The numbers that a kernel keeps of bonds, one for each bit of the states.
#[derive(Clone, Copy)]
struct Memory<T> {
    numbers: SharedSlice<T>,
    /// Whether they change.
    keeps: bool,
}

impl<T> Memory<T> {
    /// Of kernels that keep nothing, which never look.
    fn none() -> Self {
        Memory { numbers: SharedSlice(std::ptr::null_mut()), keeps: false }
    }
}

/// The words of the bond states, read by all chunks; each chunk writes only those of its own points.
#[derive(Clone, Copy)]
struct StatesPointer(*mut u16);
// SAFETY: as above; a point's words are read and written by the chunk that owns the point alone.
unsafe impl Send for StatesPointer {}
unsafe impl Sync for StatesPointer {}

impl StatesPointer {
    fn shared(states: &BondStates) -> Self {
        StatesPointer(states.words().as_ptr().cast_mut())
    }

    fn exclusive(states: &mut BondStates) -> Self {
        StatesPointer(states.words_mut().as_mut_ptr())
    }
}
