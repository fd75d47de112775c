//! The shared-stencil loop: a vector of consecutive points walks through all offsets of the family.
//!
//! Each block of sixteen points is summed in the small form of the kernel with its states as masks, while the largest
//! |strain| is watched. Only where that passes what the form serves for, or what could break a bond, is the block
//! looked at again: bonds whose strain passes their limit are broken, and the block is summed anew, exactly if need be.
//! The strain is computed by the same operations whichever form follows, so that the form can never change which bond
//! breaks. The body of the loop is compiled for AVX-512, AVX2 and the baseline and chosen at run time.

use super::packs::{Instructions, LoadEnds, Pack, Packs};
use super::{BreakRule, Broken, Memory, SharedSlice, StatesPointer};
use crate::discretization::heterogeneity::Seen;
use crate::discretization::{BondWeights, Heterogeneity};
use crate::family::{Bond, BondKernel, LatticeFamilies, Offset};
use crate::field::{Number, Precision};
use crate::geometry::Lattice;
use crate::geometry::lattice::BLOCK;
use crate::lane::Lane;

/// Blocks in a chunk: the unit that threads share out, and of the ordered sums. Fixed, whatever the threads.
const CHUNK: usize = 64;

/// Which weights the bonds of a block have: those of rows, from this one on, or in multiples of the first rows.
#[derive(Debug, Clone, Copy)]
pub enum Weights {
    Rows(usize),
    /// By the levels of both ends.
    Two([usize; 2]),
    /// By the compliance of both.
    Many,
}

/// What the loop reads of a body.
pub struct View<'a, const D: usize, B> {
    lattice: &'a Lattice<D>,
    pub families: &'a LatticeFamilies<D>,
    pub weights: &'a [f64],
    pub heterogeneity: Option<&'a Heterogeneity>,
    /// d of [`Heterogeneity`] by slot, if there is one.
    compliance: &'a [B],
    blocks: &'a [u32],
    /// Of all offsets, once for each level of the heterogeneity; of the weights themselves if there is none.
    rows: Vec<Row<D, B>>,
}

/// One offset in the numbers of the bond arithmetic.
struct Row<const D: usize, B> {
    shift: isize,
    xi: [B; D],
    length: B,
    inverse_square: B,
    weight: B,
    spring: B,
    moment: B,
}

impl<'a, const D: usize, B: Number> View<'a, D, B> {
    /// Over all blocks of the families, or over those in `within`.
    pub fn new(families: &'a LatticeFamilies<D>, weights: &'a BondWeights, within: Option<&'a [u32]>) -> Self {
        let heterogeneity = weights.heterogeneity.as_deref();
        let weights = &weights.by_offset[..];
        assert_eq!(weights.len(), families.offsets.len(), "one weight an offset");
        let row = |(offset, weight): (&Offset<D>, f64)| {
            let Bond { xi, length, inverse_square, weight, spring, moment, .. } =
                Bond::new(offset.xi, offset.length, weight);
            Row {
                shift: offset.shift,
                xi: xi.map(B::from_f64),
                length: B::from_f64(length),
                inverse_square: B::from_f64(inverse_square),
                weight: B::from_f64(weight),
                spring: B::from_f64(spring),
                moment: B::from_f64(moment),
            }
        };
        // Mixed blocks begin with the first row, and need one of the weights themselves.
        let levels = heterogeneity.into_iter().flat_map(Heterogeneity::levels);
        let factors = std::iter::once(1.0).chain(levels);
        let all = factors.flat_map(|factor| families.offsets.iter().zip(weights.iter().map(move |w| w * factor)));
        let compliance = heterogeneity.map_or(&[][..], |varied| {
            let (double, single) = varied.compliance();
            B::choose(double, single)
        });
        View {
            lattice: &families.lattice,
            families,
            weights,
            heterogeneity,
            compliance,
            blocks: within.unwrap_or(&families.blocks),
            rows: all.map(row).collect(),
        }
    }

    /// Which weights the bonds of a block have.
    #[inline(always)]
    pub fn weights_of(&self, block: u32) -> Weights {
        let Some(varied) = self.heterogeneity else { return Weights::Rows(0) };
        match varied.seen(block as usize) {
            // The first rows are those of the weights themselves.
            Seen::One(level) => Weights::Rows((level + 1) * self.families.offsets.len()),
            Seen::Two(levels) => Weights::Two(levels),
            Seen::Many => Weights::Many,
        }
    }

    pub fn n_chunks(&self) -> usize {
        self.blocks.len().div_ceil(CHUNK)
    }

    /// The blocks of a chunk.
    pub fn blocks(&self, chunk: usize) -> &[u32] {
        &self.blocks[chunk * CHUNK..((chunk + 1) * CHUNK).min(self.blocks.len())]
    }

    /// The first slot of a block.
    pub fn slot(&self, block: u32) -> usize {
        self.lattice.guard + block as usize * BLOCK
    }
}

/// Of a block whose bonds differ: which of its slots are of the second of two levels, and the factors of the bonds within
/// the first, between, and within the second. Nothing if there are more levels.
struct Choice<'a, V> {
    bits: Option<&'a [u16]>,
    factors: [V; 3],
}

impl<V: Lane> Default for Choice<'_, V> {
    #[inline(always)]
    fn default() -> Self {
        Choice { bits: None, factors: [V::splat(0.0); 3] }
    }
}

/// A sum over the blocks of a lattice.
pub struct Sum<'a, const D: usize, const I: usize, const A: usize, const O: usize, P: Precision, K> {
    pub instructions: Instructions,
    pub view: &'a View<'a, D, P::Bond>,
    pub states: StatesPointer,
    pub input: [&'a [P::Field]; I],
    pub added: [&'a [P::Field]; A],
    pub memory: Memory<P::Bond>,
    pub output: [SharedSlice<P::Field>; O],
    pub kernel: &'a K,
}

impl<const D: usize, const I: usize, const A: usize, const O: usize, P: Packs, K: BondKernel<D, I, O, A>>
    Sum<'_, D, I, A, O, P, K>
{
    /// Sums the blocks of one chunk.
    pub fn run<R: BreakRule<D>>(&self, chunk: usize, rule: &R) -> Broken {
        let StatesPointer(words) = self.states;
        let n = self.view.families.offsets.len();
        let threshold = rule.threshold();
        let mut broken = Broken::default();
        for &block in self.view.blocks(chunk) {
            let slot = self.view.slot(block);
            // SAFETY: `block` lies between the guards, so each slot plus each shift is inside the fields, whose length
            // `Exec::pass` has checked; the words of a block and its slots belong to this chunk alone.
            unsafe {
                let words = std::slice::from_raw_parts_mut(words.add(block as usize * n), n);
                let weights = self.view.weights_of(block);
                let mut largest = self.bonds::<true>(words, slot, weights);
                if !R::NEVER && largest > threshold {
                    let here = self.break_bonds(words, slot, rule);
                    if here.bonds > 0 {
                        broken.bonds += here.bonds;
                        broken.energy += here.energy;
                        largest = self.bonds::<true>(words, slot, weights);
                    }
                }
                if K::TWO_FORMS && largest > K::SMALL {
                    self.bonds::<false>(words, slot, weights);
                }
            }
        }
        broken
    }

    /// Sums one block whose bonds have the weights of rows, or each its own. What is summed in every step is compiled for
    /// both apart.
    ///
    /// # Safety
    /// As of `sum_on`; `weights` is what [`View::weights_of`] says of the block.
    pub unsafe fn bonds<const SMALL: bool>(&self, words: &[u16], slot: usize, weights: Weights) -> f64 {
        unsafe {
            if !K::EVERY_STEP || (K::VARIED && !matches!(weights, Weights::Rows(_))) {
                self.sum::<SMALL, true>(words, slot, weights)
            } else {
                self.sum::<SMALL, false>(words, slot, weights)
            }
        }
    }

    compiled!(
        sum, sum_on, sum_avx2, sum_avx512 if K::EVERY_STEP,
        [with SMALL: bool, VARIED: bool], (words: &[u16], slot: usize, weights: Weights), f64
    );
    compiled!(
        break_bonds, break_on, break_avx2, break_avx512 if false,
        [rule R: BreakRule<D>], (words: &mut [u16], slot: usize, rule: &R), Broken
    );

    /// Sums one block into the output, in the small or the exact form; returns the largest |strain| of its whole bonds.
    /// Unless they may be `VARIED`, the weights are those of rows.
    ///
    /// Mirror images of an offset stand in sequences of their own, which are added as a balanced tree: a mirrored body
    /// has mirrored bits.
    #[inline(always)]
    unsafe fn sum_on<V: Pack<P::Bond> + LoadEnds<P::Field>, const SMALL: bool, const VARIED: bool>(
        &self,
        words: &[u16],
        slot: usize,
        weights: Weights,
    ) -> f64 {
        let mut watch = V::splat(0.0);
        // One pointer for all that is read of an offset: a second one costs an instruction a pack.
        let rows = self.view.rows.as_ptr().wrapping_add(if let Weights::Rows(first) = weights { first } else { 0 });
        let mixed = VARIED && !matches!(weights, Weights::Rows(_));
        let choice = if mixed { self.choice::<V>(weights) } else { Choice::default() };
        for part in 0..BLOCK / V::LANES {
            let first = slot + part * V::LANES;
            // SAFETY: the slots of a block are inside the input.
            let (here, own) = unsafe { (self.hold::<V, I>(&self.input, first), self.hold_own::<V>(first)) };
            let mut total = [V::splat(0.0); O];
            // Partial sums that wait for their mirror image, by the number of sequences in them.
            let mut waiting = [[V::splat(0.0); O]; 4];
            for class in &self.view.families.classes {
                let mut k = class.first as usize;
                for sequence in 0..1 << class.axes {
                    let mut sum = [V::splat(0.0); O];
                    for _ in 0..class.members {
                        // SAFETY: classes are ranges of offsets, and words and rows have one entry an offset.
                        unsafe {
                            let row = &*rows.add(k);
                            let mut bond = if mixed { self.varied(&choice, row, first) } else { plain(row) };
                            let mask = *words.get_unchecked(k) >> (part * V::LANES);
                            let relative = self.relative::<V, I>(&self.input, row.shift, first, &here, mask);
                            let added = self.relative::<V, A>(&self.added, row.shift, first, &own, mask);
                            let strain = self.kernel.strain(&bond, &relative);
                            watch = watch.larger(strain);
                            if K::MEMORY {
                                let at = self.memory_of(k, first);
                                bond.memory = V::load(at);
                                bond.memory = self.kernel.remember(&bond, strain);
                                if self.memory.keeps {
                                    bond.memory.put(at);
                                }
                            }
                            let start = if K::RELATIVE { sum } else { [V::splat(0.0); O] };
                            let mut value = if SMALL {
                                self.kernel.add_small(&bond, &relative, &added, strain, start)
                            } else {
                                self.kernel.add(&bond, &relative, &added, strain, start)
                            };
                            if !K::RELATIVE {
                                for c in 0..O {
                                    value[c] = sum[c] + value[c].keep(mask);
                                }
                            }
                            sum = value;
                        }
                        k += 1;
                    }
                    let mut level = 0;
                    while sequence >> level & 1 == 1 {
                        sum = add(waiting[level], sum);
                        level += 1;
                    }
                    waiting[level] = sum;
                }
                total = add(total, waiting[class.axes as usize]);
            }
            for c in 0..O {
                // SAFETY: the slots of a block are inside the output.
                unsafe { total[c].store(self.output[c].0.add(first)) };
            }
        }
        watch.largest()
    }

    /// Asks each whole bond of a block that is strained beyond the threshold whether it breaks, and clears its bit if so.
    #[inline(always)]
    unsafe fn break_on<V: Pack<P::Bond> + LoadEnds<P::Field>, R: BreakRule<D>>(
        &self,
        words: &mut [u16],
        slot: usize,
        rule: &R,
    ) -> Broken {
        let volume = self.view.lattice.cell_volume();
        let threshold = rule.threshold();
        let mut broken = Broken::default();
        // Offset by offset, so that energies are added in the same order whatever the lanes of a pack.
        for (k, word) in words.iter_mut().enumerate() {
            for part in 0..BLOCK / V::LANES {
                let first = slot + part * V::LANES;
                let mask = *word >> (part * V::LANES);
                // SAFETY: as in `sum_on`.
                let strain = unsafe {
                    let row = self.view.rows.get_unchecked(k);
                    let here = self.hold::<V, I>(&self.input, first);
                    let relative = self.relative::<V, I>(&self.input, row.shift, first, &here, mask);
                    self.kernel.strain(&plain(row), &relative)
                };
                if strain.largest() <= threshold {
                    continue;
                }
                for lane in 0..V::LANES {
                    let (here, strain) = (first + lane, strain.lane(lane));
                    let offset = &self.view.families.offsets[k];
                    let there = here.wrapping_add_signed(offset.shift);
                    let bit = 1 << (part * V::LANES + lane);
                    if *word & bit != 0 && strain > threshold && rule.breaks(here, there, strain) {
                        *word &= !bit;
                        broken.bonds += 1;
                        let varied = self.view.heterogeneity.map_or(1.0, |varied| varied.factor(here, there));
                        let mut bond = Bond::new(offset.xi, offset.length, self.view.weights[k] * varied);
                        if K::MEMORY {
                            // SAFETY: as of the slots of the block.
                            bond.memory = unsafe { *self.memory_of(k, here) }.to_f64();
                        }
                        broken.energy += volume * rule.released(&bond, here, there);
                    }
                }
            }
        }
        broken
    }

    #[inline(always)]
    unsafe fn hold<V: LoadEnds<P::Field>, const N: usize>(
        &self,
        values: &[&[P::Field]; N],
        first: usize,
    ) -> [V::Held; N] {
        let mut held = [V::NOTHING; N];
        for c in 0..N {
            held[c] = unsafe { V::hold(values[c].as_ptr().add(first)) };
        }
        held
    }

    /// The values that are added, with the other sign: what is relative to them is the sum.
    #[inline(always)]
    unsafe fn hold_own<V: LoadEnds<P::Field>>(&self, first: usize) -> [V::Held; A] {
        let mut held = unsafe { self.hold::<V, A>(&self.added, first) };
        for c in 0..A {
            held[c] = V::opposite(held[c]);
        }
        held
    }

    #[inline(always)]
    unsafe fn relative<V: Pack<P::Bond> + LoadEnds<P::Field>, const N: usize>(
        &self,
        values: &[&[P::Field]; N],
        shift: isize,
        first: usize,
        here: &[V::Held; N],
        mask: u16,
    ) -> [V; N] {
        let mut relative = [V::splat(0.0); N];
        for c in 0..N {
            unsafe {
                let there = values[c].as_ptr().add(first).offset(shift);
                relative[c] = V::relative(V::hold(there), here[c], mask);
            }
        }
        relative
    }

    /// Where the number of the bond along offset `k` of a slot stands: in the order of the states, a number for each bit.
    #[inline(always)]
    unsafe fn memory_of(&self, k: usize, slot: usize) -> *mut P::Bond {
        let block = (slot - self.view.lattice.guard) / BLOCK;
        let bit = (block * self.view.families.offsets.len() + k) * BLOCK + slot % BLOCK;
        // SAFETY: `Exec` has checked that there is a number for each bit.
        unsafe { self.memory.numbers.0.add(bit) }
    }

    /// What [`varied`](Self::varied) needs of a block.
    #[inline(always)]
    fn choice<V: Pack<P::Bond>>(&self, weights: Weights) -> Choice<'_, V> {
        let (Some(varied), Weights::Two([a, b])) = (self.view.heterogeneity, weights) else { return Choice::default() };
        let factor = |levels| V::splat(varied.between(levels));
        Choice { bits: Some(varied.bits(b)), factors: [factor([a, a]), factor([a, b]), factor([b, b])] }
    }

    /// The bonds along an offset of consecutive slots, each with its own constant.
    #[inline(always)]
    unsafe fn varied<V: Pack<P::Bond>>(
        &self,
        choice: &Choice<'_, V>,
        row: &Row<D, P::Bond>,
        first: usize,
    ) -> Bond<D, V> {
        let shift = row.shift;
        if let Some(bits) = choice.bits {
            let window = |slot: usize| {
                // SAFETY: the slots that an offset reaches lie between the guards, and so does the word behind.
                let [low, high] = unsafe { [*bits.get_unchecked(slot / BLOCK), *bits.get_unchecked(slot / BLOCK + 1)] };
                ((u32::from(low) | u32::from(high) << BLOCK) >> (slot % BLOCK)) as u16
            };
            let (here, there) = (window(first), window(first.wrapping_add_signed(shift)));
            // Beside a joint most offsets lead to one side only. To ask for that costs more than it saves: nobody can predict
            // the answer.
            let [aa, ab, bb] = choice.factors;
            return scaled(plain(row), aa.with(ab, here ^ there).with(bb, here & there));
        }
        // SAFETY: there is a number for each slot, and those that an offset reaches are slots.
        let mut factor = unsafe {
            let here = self.view.compliance.as_ptr().add(first);
            V::splat(1.0) / (V::load(here) + V::load(here.offset(shift)))
        };
        if let Some(pairs) = self.view.heterogeneity.and_then(Heterogeneity::pairs) {
            let mut factors = [P::Bond::default(); BLOCK];
            for (lane, factor) in factors[..V::LANES].iter_mut().enumerate() {
                *factor = P::Bond::from_f64(pairs.of(first + lane, (first + lane).wrapping_add_signed(shift)));
            }
            // SAFETY: a pack has at most as many lanes as a block has slots.
            factor = factor * unsafe { V::load(factors.as_ptr()) };
        }
        scaled(plain(row), factor)
    }
}

/// The bonds along an offset, with the weight of its row.
#[inline(always)]
fn plain<const D: usize, B: Number, V: Pack<B>>(row: &Row<D, B>) -> Bond<D, V> {
    let mut xi = [V::splat(0.0); D];
    for d in 0..D {
        xi[d] = V::broadcast(row.xi[d]);
    }
    Bond {
        xi,
        length: V::broadcast(row.length),
        inverse_square: V::broadcast(row.inverse_square),
        weight: V::broadcast(row.weight),
        spring: V::broadcast(row.spring),
        moment: V::broadcast(row.moment),
        memory: V::splat(0.0),
    }
}

/// Bonds with weights that are multiplied.
#[inline(always)]
fn scaled<const D: usize, V: Lane>(bond: Bond<D, V>, factor: V) -> Bond<D, V> {
    let [weight, spring, moment] = [bond.weight * factor, bond.spring * factor, bond.moment * factor];
    Bond { weight, spring, moment, ..bond }
}

// A plain loop: the closures of `array::map` and `from_fn` are functions of their own, which the compiler does not
// always inline into code for wider instructions.
#[inline(always)]
pub fn add<V: Lane, const O: usize>(mut a: [V; O], b: [V; O]) -> [V; O] {
    for c in 0..O {
        a[c] = a[c] + b[c];
    }
    a
}
