//! The shared-stencil loop: a vector of consecutive points walks through all offsets of the family.
//!
//! Each block of sixteen points is summed with its states as masks, while the largest stretch is watched. Only where
//! that passes the threshold of the break rule is the block asked bond by bond, and summed again if one broke: blocks
//! away from a crack never are. The body of the loop is compiled for AVX-512, AVX2 and the baseline and chosen at run
//! time; the three give the same bits, since none fuses multiplications with additions.

use super::{BreakRule, Broken, SharedSlice, StatesPointer};
use crate::family::{Body, Bond, BondKernel, LatticeFamilies};
use crate::geometry::lattice::BLOCK;
use crate::geometry::{Arrangement, Lattice};
use crate::lane::{LANES, Lane, Pack};

/// Blocks in a chunk: the unit that threads share out, and of the ordered sums. Fixed, whatever the threads.
const CHUNK: usize = 64;

/// What the loop reads of a body.
pub struct View<'a, const D: usize> {
    lattice: &'a Lattice<D>,
    families: &'a LatticeFamilies<D>,
    weights: &'a [f64],
}

impl<'a, const D: usize> View<'a, D> {
    pub fn new(body: &'a Body<D>, families: &'a LatticeFamilies<D>, weights: &'a [f64]) -> Self {
        let Arrangement::Lattice(lattice) = &body.cloud.arrangement else {
            unreachable!("lattice families belong to a lattice")
        };
        assert_eq!(weights.len(), families.offsets.len(), "one weight an offset");
        View { lattice, families, weights }
    }

    pub fn n_chunks(&self) -> usize {
        self.families.blocks.len().div_ceil(CHUNK)
    }
}

/// Sums the blocks of one chunk, on the widest instructions that this machine has.
pub fn pass<const D: usize, const I: usize, const O: usize, K: BondKernel<D, I, O>, R: BreakRule<D>>(
    view: &View<'_, D>,
    chunk: usize,
    states: StatesPointer,
    input: [&[f64]; I],
    output: [SharedSlice; O],
    kernel: &K,
    rule: &R,
) -> Broken {
    #[cfg(target_arch = "x86_64")]
    if K::HOT {
        if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
            // SAFETY: the features were just detected.
            return unsafe { pass_avx512(view, chunk, states, input, output, kernel, rule) };
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the feature was just detected.
            return unsafe { pass_avx2(view, chunk, states, input, output, kernel, rule) };
        }
    }
    pass_plain(view, chunk, states, input, output, kernel, rule)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw")]
fn pass_avx512<const D: usize, const I: usize, const O: usize, K: BondKernel<D, I, O>, R: BreakRule<D>>(
    view: &View<'_, D>,
    chunk: usize,
    states: StatesPointer,
    input: [&[f64]; I],
    output: [SharedSlice; O],
    kernel: &K,
    rule: &R,
) -> Broken {
    pass_plain(view, chunk, states, input, output, kernel, rule)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn pass_avx2<const D: usize, const I: usize, const O: usize, K: BondKernel<D, I, O>, R: BreakRule<D>>(
    view: &View<'_, D>,
    chunk: usize,
    states: StatesPointer,
    input: [&[f64]; I],
    output: [SharedSlice; O],
    kernel: &K,
    rule: &R,
) -> Broken {
    pass_plain(view, chunk, states, input, output, kernel, rule)
}

#[inline(always)]
fn pass_plain<const D: usize, const I: usize, const O: usize, K: BondKernel<D, I, O>, R: BreakRule<D>>(
    view: &View<'_, D>,
    chunk: usize,
    states: StatesPointer,
    input: [&[f64]; I],
    output: [SharedSlice; O],
    kernel: &K,
    rule: &R,
) -> Broken {
    let StatesPointer::Lattice(words) = states else { unreachable!("a lattice has lattice states") };
    let n = view.families.offsets.len();
    let threshold = rule.threshold();
    let mut broken = Broken::default();
    let blocks = &view.families.blocks[chunk * CHUNK..((chunk + 1) * CHUNK).min(view.families.blocks.len())];
    for &block in blocks {
        let slot = view.lattice.guard + block as usize * BLOCK;
        // SAFETY: `block` lies between the guards, so each slot plus each shift is inside the fields, whose length
        // `Exec::pass` has checked; the words of a block and its slots belong to this chunk alone.
        unsafe {
            let words = std::slice::from_raw_parts_mut(words.add(block as usize * n), n);
            // At most twice: the second sum is of the bonds that the first one showed to break.
            for again in [true, false] {
                let stretch = sum_block(view, words, slot, input, output, kernel);
                if !again || stretch <= threshold {
                    break;
                }
                let here = break_block(view, words, slot, input, kernel, rule);
                if here.bonds == 0 {
                    break;
                }
                broken.bonds += here.bonds;
                broken.energy += here.energy;
            }
        }
    }
    broken
}

/// Sums one block into the output; returns the largest stretch of its whole bonds (0 if none is positive).
#[inline(always)]
unsafe fn sum_block<const D: usize, const I: usize, const O: usize, K: BondKernel<D, I, O>>(
    view: &View<'_, D>,
    words: &[u16],
    slot: usize,
    input: [&[f64]; I],
    output: [SharedSlice; O],
    kernel: &K,
) -> f64 {
    let mut watch = Pack::splat(0.0);
    for half in 0..BLOCK / LANES {
        let first = slot + half * LANES;
        // SAFETY: the slots of a block are inside the input.
        let here = unsafe { load_all(input, first) };
        let mut sum = [Pack::splat(0.0); O];
        let run = Run { view, words, half, first, input, here, kernel };
        // SAFETY of all four: groups are ranges of offsets.
        let [pairs, larger] = view.families.groups_by_size();
        for group in pairs {
            sum = add(sum, unsafe { run.two(group.start as usize, &mut watch) });
        }
        for group in larger {
            let mut part = [Pack::splat(0.0); O];
            for k in (group.start as usize..group.end as usize).step_by(4) {
                let four = unsafe { add(run.two(k, &mut watch), run.two(k + 2, &mut watch)) };
                part = add(part, four);
            }
            sum = add(sum, part);
        }
        for c in 0..O {
            // SAFETY: the slots of a block are inside the output.
            unsafe { output[c].0.add(first).cast::<[f64; LANES]>().write_unaligned(sum[c].0) };
        }
    }
    watch.largest()
}

/// One half of a block on its way through the offsets.
struct Run<'a, const D: usize, const I: usize, K> {
    view: &'a View<'a, D>,
    words: &'a [u16],
    half: usize,
    first: usize,
    input: [&'a [f64]; I],
    here: [Pack; I],
    kernel: &'a K,
}

impl<const D: usize, const I: usize, K> Run<'_, D, I, K> {
    #[inline(always)]
    unsafe fn one<const O: usize>(&self, k: usize, watch: &mut Pack) -> [Pack; O]
    where
        K: BondKernel<D, I, O>,
    {
        unsafe {
            let offset = self.view.families.offsets.get_unchecked(k);
            let mask = (*self.words.get_unchecked(k) >> (self.half * LANES)) as u8;
            let there_slot = self.first.wrapping_add_signed(offset.shift);
            let there = load_all(self.input, there_slot);
            let mut xi = [Pack::splat(0.0); D];
            for d in 0..D {
                xi[d] = Pack::splat(offset.xi[d]);
            }
            let bond = Bond {
                xi,
                length: Pack::splat(offset.length),
                weight: Pack::splat(*self.view.weights.get_unchecked(k)),
            };
            let (mut value, mut stretch) = self.kernel.evaluate(&bond, self.here, there);
            if mask != u8::MAX {
                stretch = stretch.keep(mask);
                for v in &mut value {
                    *v = v.keep(mask);
                }
            }
            *watch = watch.max(stretch);
            value
        }
    }

    /// The two members of a mirror pair, added.
    #[inline(always)]
    unsafe fn two<const O: usize>(&self, k: usize, watch: &mut Pack) -> [Pack; O]
    where
        K: BondKernel<D, I, O>,
    {
        unsafe { add(self.one(k, watch), self.one(k + 1, watch)) }
    }
}

// Plain loops from here to the law: the closures of `array::map` and `from_fn` are functions of their own, which the
// compiler does not always inline into code for wider instructions.

#[inline(always)]
fn add<const O: usize>(mut a: [Pack; O], b: [Pack; O]) -> [Pack; O] {
    for c in 0..O {
        a[c] = a[c] + b[c];
    }
    a
}

#[inline(always)]
unsafe fn load_all<const I: usize>(fields: [&[f64]; I], slot: usize) -> [Pack; I] {
    let mut packs = [Pack::splat(0.0); I];
    for c in 0..I {
        packs[c] = Pack(unsafe { fields[c].as_ptr().add(slot).cast::<[f64; LANES]>().read_unaligned() });
    }
    packs
}

/// Asks each whole bond of a block whether it breaks, and clears its bit if so.
#[cold]
#[inline(never)]
fn break_block<const D: usize, const I: usize, const O: usize, K: BondKernel<D, I, O>, R: BreakRule<D>>(
    view: &View<'_, D>,
    words: &mut [u16],
    slot: usize,
    input: [&[f64]; I],
    kernel: &K,
    rule: &R,
) -> Broken {
    let volume = view.lattice.cell_volume();
    let mut broken = Broken::default();
    for (k, word) in words.iter_mut().enumerate() {
        let offset = &view.families.offsets[k];
        let bond = Bond { xi: offset.xi, length: offset.length, weight: view.weights[k] };
        let mut bits = *word;
        while bits != 0 {
            let bit = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let (here, there) = (slot + bit, (slot + bit).wrapping_add_signed(offset.shift));
            let (_, stretch) = kernel.evaluate::<f64>(&bond, input.map(|f| f[here]), input.map(|f| f[there]));
            if stretch > rule.threshold() && rule.breaks(here, there, stretch) {
                *word &= !(1 << bit);
                broken.bonds += 1;
                broken.energy += volume * rule.released(&bond, here, there);
            }
        }
    }
    broken
}
