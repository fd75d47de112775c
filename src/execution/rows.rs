//! Linear sums as rows: where all bonds of a block hold, a linear kernel is one row of numbers that all points share.
//!
//! The bonds along ξ and −ξ carry the same matrix C, so that their two summands are C (u(x + ξ) + u(x − ξ) − 2 u(x)):
//! half the products, no masks, nothing to watch. Blocks that lack a bond are summed bond by bond.

use super::lattice::{self, Weights};
use super::packs::{Instructions, LoadEnds, Pack, Packs};
use crate::discretization::Heterogeneity;
use crate::family::{Bond, BondKernel};
use crate::field::Number;
use crate::geometry::lattice::BLOCK;

/// A sum of a linear kernel over the blocks of a lattice.
pub struct Sum<'a, const D: usize, const I: usize, const A: usize, const O: usize, P: Packs, K> {
    pub bonds: &'a lattice::Sum<'a, D, I, A, O, P, K>,
    /// Once for each level of the heterogeneity, as the rows of the view.
    pub pairs: Vec<Pair<I, O, P::Bond>>,
    /// In each level.
    n: usize,
    pub instructions: Instructions,
}

/// The bonds along ξ and −ξ.
pub struct Pair<const I: usize, const O: usize, B> {
    /// From x to x + ξ, in slots.
    shift: isize,
    matrix: [[B; I]; O],
}

impl<'a, const D: usize, const I: usize, const A: usize, const O: usize, P: Packs, K: BondKernel<D, I, O, A>>
    Sum<'a, D, I, A, O, P, K>
{
    /// Reads the matrices off the kernel: column by column, its values at unit vectors.
    pub fn new(bonds: &'a lattice::Sum<'a, D, I, A, O, P, K>) -> Self {
        let view = bonds.view;
        let pair = |(factor, k): (f64, usize)| {
            let offset = &view.families.offsets[k];
            let bond = Bond::new(offset.xi, offset.length, view.weights[k] * factor);
            let mut matrix = [[P::Bond::default(); I]; O];
            for i in 0..I {
                let mut unit = [0.0; I];
                unit[i] = 1.0;
                let column = bonds.kernel.add(&bond, &unit, &[0.0; A], bonds.kernel.strain(&bond, &unit), [0.0; O]);
                for o in 0..O {
                    matrix[o][i] = P::Bond::from_f64(column[o]);
                }
            }
            Pair { shift: offset.shift, matrix }
        };
        // The second half of the sequences of a class are the images of the first through the point.
        let halves = view.families.classes.iter().flat_map(|class| {
            let half = class.members << (class.axes - 1);
            class.first as usize..(class.first + half) as usize
        });
        let levels = view.heterogeneity.into_iter().flat_map(Heterogeneity::levels);
        let factors = std::iter::once(1.0).chain(levels);
        let n_levels = 1 + view.heterogeneity.map_or(0, Heterogeneity::n_levels);
        let pairs: Vec<_> = factors.flat_map(|factor| halves.clone().map(move |k| (factor, k))).map(pair).collect();
        Sum { bonds, n: pairs.len() / n_levels, pairs, instructions: bonds.instructions }
    }

    /// Sums the blocks of one chunk.
    pub fn run(&self, chunk: usize) {
        let view = self.bonds.view;
        let n = view.families.offsets.len();
        for &block in view.blocks(chunk) {
            let slot = view.slot(block);
            // SAFETY: as in `lattice::Sum::run`.
            unsafe {
                let words = std::slice::from_raw_parts(self.bonds.states.0.add(block as usize * n), n);
                match view.weights_of(block) {
                    Weights::Rows(first) if words.iter().fold(u16::MAX, |all, word| all & word) == u16::MAX => {
                        self.sum(slot, first / n);
                    }
                    weights => {
                        self.bonds.bonds::<true>(words, slot, weights);
                    }
                }
            }
        }
    }

    compiled!(sum, sum_on, sum_avx2, sum_avx512 if K::EVERY_STEP, [], (slot: usize, level: usize), ());

    /// Applies the row of a level at the points of one block; mirror images are added as in the sum over bonds.
    #[inline(always)]
    unsafe fn sum_on<V: Pack<P::Bond> + LoadEnds<P::Field>>(&self, slot: usize, level: usize) {
        let input = &self.bonds.input;
        for part in 0..BLOCK / V::LANES {
            let first = slot + part * V::LANES;
            let mut twice = [V::NOTHING; I];
            for i in 0..I {
                // SAFETY: the slots of a block, and those that its families reach, are inside the input.
                twice[i] = unsafe { V::twice(V::hold(input[i].as_ptr().add(first))) };
            }
            let mut total = [V::splat(0.0); O];
            let mut waiting = [[V::splat(0.0); O]; 3];
            let mut pairs = self.pairs[level * self.n..].iter();
            for class in &self.bonds.view.families.classes {
                for sequence in 0..1 << (class.axes - 1) {
                    let mut sum = [V::splat(0.0); O];
                    for pair in pairs.by_ref().take(class.members as usize) {
                        let mut bend = [V::splat(0.0); I];
                        for i in 0..I {
                            unsafe {
                                let here = input[i].as_ptr().add(first);
                                let (after, before) = (here.offset(pair.shift), here.offset(-pair.shift));
                                bend[i] = V::bend(V::hold(after), V::hold(before), twice[i]);
                            }
                        }
                        for o in 0..O {
                            for i in 0..I {
                                sum[o] = V::broadcast(pair.matrix[o][i]).mul_add(bend[i], sum[o]);
                            }
                        }
                    }
                    let mut level = 0;
                    while sequence >> level & 1 == 1 {
                        sum = lattice::add(waiting[level], sum);
                        level += 1;
                    }
                    waiting[level] = sum;
                }
                total = lattice::add(total, waiting[class.axes as usize - 1]);
            }
            for o in 0..O {
                // SAFETY: the slots of a block are inside the output.
                unsafe { total[o].store(self.bonds.output[o].0.add(first)) };
            }
        }
    }
}
