//! Rows of collocation on lattices: a vector of consecutive points, all with the same short row.
//!
//! Beside the force, the displacements at the nearest points tell how far the family is strained, without a look at its
//! bonds.

mod fused;
mod slopes;

pub use fused::Motion;

use super::packs::{Instructions, LoadEnds, Pack, Packs};
use super::{Exec, SharedSlice};
use crate::discretization::Regions;
use crate::discretization::collocation::{Pair, RowClass, SharedRow};
use crate::family::Body;
use crate::field::Number;
use crate::geometry::lattice::BLOCK;
use crate::geometry::{Arrangement, Lattice};
use crate::lane::Lane;
use crate::parallel;

/// How far a point with a row may be strained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest strain: of E = ½(∇u + ∇uᵀ + ∇uᵀ∇u), or without the last term if `linear`.
    pub strain: f64,
    pub linear: bool,
    /// Largest |∇u| (Frobenius).
    pub gradient: f64,
}

impl Limits {
    /// Nothing is too far.
    pub const NONE: Limits = Limits { strain: f64::INFINITY, linear: true, gradient: f64::INFINITY };

    /// Below this, the root n of the sum of the squares of all one-sided derivatives keeps both: the gradient is at most n,
    /// and the strain, as [`Exec::collocate`] judges it, at most n + n²/2.
    fn calm(&self) -> f64 {
        // tr E/D + √((D − 1)/D) |dev E| ≤ |E|. Its linear part: larger ones of two normal strains, and shear strains from
        // means of two, both at most n together; GᵀG: |G|² at most. A thousandth for the rounding of single precision.
        let strain = if self.linear || self.strain.is_infinite() {
            self.strain
        } else {
            2.0 * self.strain / ((1.0 + 2.0 * self.strain).sqrt() + 1.0)
        };
        0.999 * strain.min(self.gradient)
    }
}

/// Blocks in a chunk.
const CHUNK: usize = 64;

/// Rows over the blocks of a lattice.
struct Sum<'a, const D: usize, P: Packs> {
    instructions: Instructions,
    lattice: &'a Lattice<D>,
    regions: &'a Regions,
    pairs: Vec<BondPair<D, P::Bond>>,
    slopes: Vec<BondSlope<D, P::Bond>>,
    classes: &'a [RowClass],
    /// d of the row's heterogeneity by slot; empty without one.
    compliance: &'a [P::Bond],
    input: [SharedSlice<P::Field>; D],
    /// What slopes take the gradient of.
    scalar: SharedSlice<P::Field>,
    output: &'a [SharedSlice<P::Field>],
    /// 1/limits, 1/Δx, and what the products of gradients count.
    strain: P::Bond,
    gradient: P::Bond,
    inverse_spacing: P::Bond,
    products: P::Bond,
    /// Where the squares of all differences to the nearest points add up to less than this, `limits` are kept.
    calm: P::Bond,
}

/// A pair in the numbers of the bond arithmetic.
struct BondPair<const D: usize, B> {
    shift: isize,
    weight: [[B; D]; D],
}

/// The same of a slope.
struct BondSlope<const D: usize, B> {
    shift: isize,
    weight: [B; D],
}

impl Exec {
    /// output(x) = (L input)(x) at the points of `blocks` that have a row; other slots are left alone. Gives the slots of those
    /// where `limits` are passed, ascending within each block.
    ///
    /// How far a family is strained is judged by E from the differences to the nearest points: its normal strains are the
    /// larger of those on either side, so that the bonds to these points count exactly, its shear strains central. What is
    /// compared is tr E/D + √((D − 1)/D) |dev E|, in 1D and 2D the largest principal strain, in 3D a bound of it. The nearest
    /// points are asked, and not the row, because a row with a node at every second point does not see waves of four
    /// spacings.
    ///
    /// # Panics
    /// If the body is no lattice.
    #[allow(clippy::too_many_arguments)] // the row, where, its data and limits: nothing that belongs in one struct
    pub fn collocate<const D: usize, P: Packs>(
        &mut self,
        body: &Body<D>,
        row: &SharedRow<D>,
        regions: &Regions,
        blocks: &[u32],
        input: [&[P::Field]; D],
        output: [&mut [P::Field]; D],
        limits: &Limits,
    ) -> Vec<u32> {
        let (input, output) = self.shared(body, input, output);
        let sum = Sum::<D, P>::new(self.instructions, body, regions, input, &output, limits).of(row);
        // SAFETY: the slots of a block belong to its chunk alone, and what its row reaches lies between the guards: `shared`
        // and `SharedRow::new` have seen to it.
        sum.each(blocks, |slot| unsafe { sum.force(slot) })
    }

    /// density(x) = ¼ Σ_j (u_j − u)·K_j (u_j − u), J/m³, at the points that have a row: −½ Σ u·L u V where all points have
    /// the same row, which is what their motion keeps.
    pub fn row_energy<const D: usize, P: Packs>(
        &mut self,
        body: &Body<D>,
        row: &SharedRow<D>,
        regions: &Regions,
        input: [&[P::Field]; D],
        density: &mut [P::Field],
    ) {
        let (input, output) = self.shared(body, input, [density]);
        let sum = Sum::<D, P>::new(self.instructions, body, regions, input, &output, &Limits::NONE).of(row);
        // SAFETY: as above.
        sum.each(&regions.collocated, |slot| unsafe {
            sum.energy(slot);
            0
        });
    }

    fn shared<const D: usize, const O: usize, T: Number>(
        &self,
        body: &Body<D>,
        input: [&[T]; D],
        output: [&mut [T]; O],
    ) -> ([SharedSlice<T>; D], [SharedSlice<T>; O]) {
        let n = body.cloud.n_slots();
        assert!(input.iter().all(|f| f.len() == n), "input fields have the length of the cloud");
        assert!(output.iter().all(|f| f.len() == n), "output fields have the length of the cloud");
        // What is cast is only read.
        (input.map(|f| SharedSlice(f.as_ptr().cast_mut())), output.map(|f| SharedSlice(f.as_mut_ptr())))
    }
}

impl<'a, const D: usize, P: Packs> Sum<'a, D, P> {
    fn new(
        instructions: Instructions,
        body: &'a Body<D>,
        regions: &'a Regions,
        input: [SharedSlice<P::Field>; D],
        output: &'a [SharedSlice<P::Field>],
        limits: &Limits,
    ) -> Self {
        let Arrangement::Lattice(lattice) = &body.cloud.arrangement else { panic!("shared rows are of lattices") };
        Sum {
            instructions,
            lattice,
            regions,
            pairs: Vec::new(),
            slopes: Vec::new(),
            classes: &[],
            compliance: &[],
            input,
            scalar: SharedSlice(std::ptr::null_mut()),
            output,
            strain: P::Bond::from_f64(1.0 / limits.strain),
            gradient: P::Bond::from_f64(limits.gradient.powi(-2)),
            inverse_spacing: P::Bond::from_f64(1.0 / lattice.spacing),
            products: P::Bond::from_f64(if limits.linear { 0.0 } else { 1.0 }),
            calm: P::Bond::from_f64((limits.calm() * lattice.spacing).powi(2)),
        }
    }

    fn of(self, row: &'a SharedRow<D>) -> Self {
        let pair =
            |pair: &Pair<D>| BondPair { shift: pair.shift, weight: pair.weight.map(|w| w.map(P::Bond::from_f64)) };
        let compliance = row.heterogeneity.as_ref().map_or(&[][..], |varied| {
            let (double, single) = varied.compliance();
            P::Bond::choose(double, single)
        });
        assert!(compliance.is_empty() || compliance.len() == self.lattice.n_slots, "a number for each slot");
        Sum { pairs: row.pairs.iter().map(pair).collect(), classes: &row.classes, compliance, ..self }
    }

    /// Does something with the first slot of each block; gives the slots whose bits it returns.
    fn each(&self, blocks: &[u32], work: impl Fn(usize) -> u16 + Sync) -> Vec<u32> {
        let chunk = |k: usize| {
            let mut found = Vec::new();
            for &block in &blocks[k * CHUNK..((k + 1) * CHUNK).min(blocks.len())] {
                let slot = self.lattice.guard + block as usize * BLOCK;
                fused::note(&mut found, slot, work(slot));
            }
            found
        };
        parallel::map(blocks.len().div_ceil(CHUNK), &chunk).concat()
    }

    compiled!(force, force_on, force_avx2, force_avx512 if true, [], (slot: usize), u16);
    compiled!(energy, energy_on, energy_avx2, energy_avx512 if true, [], (slot: usize), ());

    /// The row at the points of one block; gives the bits of those that are strained too far.
    #[inline(always)]
    unsafe fn force_on<V: Pack<P::Bond> + LoadEnds<P::Field>>(&self, slot: usize) -> u16 {
        let keep = self.regions.rows(slot);
        let mut beyond = 0;
        for part in 0..BLOCK / V::LANES {
            let first = slot + part * V::LANES;
            let mask = keep >> (part * V::LANES);
            // SAFETY: the slots of a block, and those that its rows reach, are inside the input.
            unsafe {
                let here = self.hold::<V>(first);
                let mut twice = [V::NOTHING; D];
                for i in 0..D {
                    twice[i] = V::twice(here[i]);
                }
                let (mut total, mut across) = ([V::splat(0.0); D], [V::splat(0.0); D]);
                let mut begin = 0;
                for class in self.classes {
                    let n = class.members;
                    for k in begin..begin + n {
                        let weight = &self.pairs.get_unchecked(k).weight;
                        // Σ of b over mirror images, and for each two axes Σ of b with the sign that their weight has.
                        let (even, odd) = match class.images {
                            1 => (self.bend::<V>(k, first, &twice), [[V::splat(0.0); D]; 3]),
                            2 => {
                                let (a, b) = (self.bend::<V>(k, first, &twice), self.bend::<V>(k + n, first, &twice));
                                let difference = less(a, b);
                                (super::lattice::add(a, b), [difference; 3])
                            }
                            _ => {
                                let (a, b) = (self.bend::<V>(k, first, &twice), self.bend::<V>(k + n, first, &twice));
                                let c = self.bend::<V>(k + 2 * n, first, &twice);
                                let d = self.bend::<V>(k + 3 * n, first, &twice);
                                let (ab, cd) = (super::lattice::add(a, b), super::lattice::add(c, d));
                                let (a_b, c_d) = (less(a, b), less(c, d));
                                // Images mirrored in the first axis, in the second, in both: axes 0 1, 0 2, 1 2.
                                (
                                    super::lattice::add(ab, cd),
                                    [less(a_b, c_d), super::lattice::add(a_b, c_d), less(ab, cd)],
                                )
                            }
                        };
                        for o in 0..D {
                            total[o] = V::broadcast(weight[o][o]).mul_add(even[o], total[o]);
                            for i in 0..D {
                                if o != i && class.axes >> o & class.axes >> i & 1 == 1 {
                                    across[o] = V::broadcast(weight[o][i]).mul_add(odd[o + i - 1][i], across[o]);
                                }
                            }
                        }
                    }
                    begin += n * class.images;
                }
                beyond |= self.beyond::<V>(first, &here, mask) << (part * V::LANES);
                for o in 0..D {
                    self.store(self.scaled(total[o] + across[o], first), o, first, mask);
                }
            }
        }
        beyond
    }

    /// The bits of the points that are strained too far.
    #[inline(always)]
    unsafe fn beyond<V: Pack<P::Bond> + LoadEnds<P::Field>>(
        &self,
        first: usize,
        here: &[V::Held; D],
        mask: u16,
    ) -> u16 {
        let mut beyond = 0;
        // SAFETY: as of the row.
        if !unsafe { self.is_calm::<V>(first, here, mask) } {
            for strained in unsafe { self.strained::<V>(first, here) } {
                let strained = strained.keep(mask);
                for lane in 0..V::LANES {
                    if strained.lane(lane) > 0.0 {
                        beyond |= 1 << lane;
                    }
                }
            }
        }
        beyond
    }

    /// b of a pair: the values on both sides, less twice the value between.
    #[inline(always)]
    unsafe fn bend<V: Pack<P::Bond> + LoadEnds<P::Field>>(
        &self,
        k: usize,
        first: usize,
        twice: &[V::Held; D],
    ) -> [V; D] {
        let mut bend = [V::splat(0.0); D];
        for i in 0..D {
            // SAFETY: pairs are of the row, whose reach is inside the input.
            let [after, before] = unsafe { self.ends::<V>(i, first, self.pairs.get_unchecked(k).shift) };
            bend[i] = V::bend(after, before, twice[i]);
        }
        bend
    }

    /// Whether all points are strained so little that no limit is near: true nearly everywhere, and quickly seen.
    #[inline(always)]
    unsafe fn is_calm<V: Pack<P::Bond> + LoadEnds<P::Field>>(
        &self,
        first: usize,
        here: &[V::Held; D],
        mask: u16,
    ) -> bool {
        let mut squares = V::splat(0.0);
        for d in 0..D {
            for i in 0..D {
                // SAFETY: as of the row, which reaches at least as far.
                let ends = unsafe { self.ends::<V>(i, first, self.lattice.strides[d] as isize) };
                for end in ends {
                    let difference = V::relative(end, here[i], u16::MAX);
                    squares = difference.mul_add(difference, squares);
                }
            }
        }
        squares.is_below(V::broadcast(self.calm), mask)
    }

    /// How far the nearest points are strained, and how large the gradient is: positive where that is more than is allowed.
    #[inline(always)]
    unsafe fn strained<V: Pack<P::Bond> + LoadEnds<P::Field>>(&self, first: usize, here: &[V::Held; D]) -> [V; 2] {
        let half = V::splat(0.5);
        let (zero, per, products) = (V::splat(0.0), V::broadcast(self.inverse_spacing), V::broadcast(self.products));
        // ∂u_i/∂x_d ahead of and behind the point.
        let (mut ahead, mut behind) = ([[zero; D]; D], [[zero; D]; D]);
        for d in 0..D {
            for i in 0..D {
                // SAFETY: as of the row, which reaches at least as far.
                let [after, before] = unsafe { self.ends::<V>(i, first, self.lattice.strides[d] as isize) };
                ahead[i][d] = V::relative(after, here[i], u16::MAX) * per;
                behind[i][d] = V::relative(here[i], before, u16::MAX) * per;
            }
        }
        let mut gradient = [[zero; D]; D];
        let mut size = zero;
        for i in 0..D {
            for d in 0..D {
                gradient[i][d] = half * (ahead[i][d] + behind[i][d]);
                size = gradient[i][d].mul_add(gradient[i][d], size);
            }
        }
        let (mut normal, mut mean, mut shear) = ([zero; D], zero, zero);
        for a in 0..D {
            let (mut before, mut after) = (behind[a][a], ahead[a][a]);
            for i in 0..D {
                let share = half * products;
                before = (share * behind[i][a]).mul_add(behind[i][a], before);
                after = (share * ahead[i][a]).mul_add(ahead[i][a], after);
            }
            // The larger of both.
            normal[a] = half * ((before + after) + zero.larger(after - before));
            mean = mean + normal[a];
            for b in 0..a {
                let mut twice = gradient[a][b] + gradient[b][a];
                for i in 0..D {
                    twice = (products * gradient[i][a]).mul_add(gradient[i][b], twice);
                }
                shear = (half * twice).mul_add(twice, shear);
            }
        }
        mean = mean * V::splat(1.0 / D as f64);
        let mut deviation = shear;
        for a in 0..D {
            let part = normal[a] - mean;
            deviation = part.mul_add(part, deviation);
        }
        // mean + root > limit without the root: root² > (limit − mean) |limit − mean|, over limit².
        let one = V::splat(1.0);
        let per_limit = V::broadcast(self.strain);
        let root = V::splat((D as f64 - 1.0) / D as f64) * deviation * per_limit * per_limit;
        let left = one - mean * per_limit;
        [root - left * zero.larger(left), size * V::broadcast(self.gradient) - one]
    }

    /// The row's energy at the points of one block.
    #[inline(always)]
    unsafe fn energy_on<V: Pack<P::Bond> + LoadEnds<P::Field>>(&self, slot: usize) {
        let keep = self.regions.rows(slot);
        for part in 0..BLOCK / V::LANES {
            let first = slot + part * V::LANES;
            // SAFETY: as of `force_on`.
            unsafe {
                let here = self.hold::<V>(first);
                let mut sum = V::splat(0.0);
                for pair in &self.pairs {
                    let (mut after, mut before) = ([V::splat(0.0); D], [V::splat(0.0); D]);
                    for i in 0..D {
                        let ends = self.ends::<V>(i, first, pair.shift);
                        after[i] = V::relative(ends[0], here[i], u16::MAX);
                        before[i] = V::relative(ends[1], here[i], u16::MAX);
                    }
                    for o in 0..D {
                        let (mut there, mut back) = (V::splat(0.0), V::splat(0.0));
                        for i in 0..D {
                            let weight = V::broadcast(pair.weight[o][i]);
                            there = weight.mul_add(after[i], there);
                            back = weight.mul_add(before[i], back);
                        }
                        sum = sum + (after[o] * there + before[o] * back);
                    }
                }
                self.store(self.scaled(V::splat(0.25) * sum, first), 0, first, keep >> (part * V::LANES));
            }
        }
    }

    /// What a row gives, in the constant of each point.
    #[inline(always)]
    fn scaled<V: Pack<P::Bond>>(&self, value: V, first: usize) -> V {
        if self.compliance.is_empty() {
            return value;
        }
        // SAFETY: there is a number for each slot.
        value * (V::splat(0.5) / unsafe { V::load(self.compliance.as_ptr().add(first)) })
    }

    #[inline(always)]
    unsafe fn hold<V: LoadEnds<P::Field>>(&self, first: usize) -> [V::Held; D] {
        let mut held = [V::NOTHING; D];
        for i in 0..D {
            held[i] = unsafe { V::hold(self.input[i].0.add(first)) };
        }
        held
    }

    /// Values `shift` slots ahead and behind.
    #[inline(always)]
    unsafe fn ends<V: LoadEnds<P::Field>>(&self, component: usize, first: usize, shift: isize) -> [V::Held; 2] {
        unsafe {
            let here = self.input[component].0.add(first);
            [V::hold(here.offset(shift)), V::hold(here.offset(-shift))]
        }
    }

    /// Writes the lanes whose bit is set.
    #[inline(always)]
    unsafe fn store<V: Pack<P::Bond> + LoadEnds<P::Field>>(&self, value: V, component: usize, first: usize, mask: u16) {
        let all = u16::MAX >> (BLOCK - V::LANES);
        // SAFETY: the slots of a block are inside the output.
        unsafe {
            let target = self.output[component].0.add(first);
            if mask & all == all {
                return value.store(target);
            }
            let mut values = [P::Field::default(); BLOCK];
            value.store(values.as_mut_ptr());
            for lane in (0..V::LANES).filter(|lane| mask >> lane & 1 == 1) {
                *target.add(lane) = values[lane];
            }
        }
    }
}

#[inline(always)]
fn less<V: Lane, const D: usize>(mut a: [V; D], b: [V; D]) -> [V; D] {
    for d in 0..D {
        a[d] = a[d] - b[d];
    }
    a
}
