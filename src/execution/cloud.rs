//! The loop over families of scattered points: sixteen bonds of one point side by side.
//!
//! Positions and input values are fetched as whole records of a neighbour and transposed in registers; ξ is recomputed
//! from positions and the weight from |ξ|, so that a bond keeps four bytes of neighbour and one bit of state. Each
//! point's bonds are added in a fixed order: lane by lane, then the lanes. Forms and breaking are as on lattices, point
//! by point.

use std::ops::Range;

use rayon::prelude::*;

use super::packs::{BondVectors, Instructions, LoadEnds, Pack, Packs, SiteView};
use super::{BreakRule, Broken, Memory, SharedSlice, StatesPointer};
use crate::discretization::Heterogeneity;
use crate::discretization::heterogeneity::Seen;
use crate::discretization::standard::{CloudWeights, WeightPolynomial};
use crate::family::{Bond, BondKernel, CloudFamilies, GROUP};
use crate::field::Number;
use crate::lane::polynomial;

/// Points in a chunk: the unit that threads share out, and of the ordered sums.
pub const CHUNK: usize = 512;

/// Puts the input values of each point side by side, four of them and zeros behind; those beyond four stand in records of
/// their own, behind the records of all points.
pub fn gather_input<T: Number>(input: &[&[T]], records: &mut Vec<[T; 4]>) {
    let Some(first) = input.first() else { return };
    let n = first.len();
    records.resize(n * input.len().div_ceil(4), [T::default(); 4]);
    for (part, records) in records.chunks_mut(n.max(1)).enumerate() {
        records.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, records)| {
            for (k, record) in records.iter_mut().enumerate() {
                for c in 4 * part..input.len().min(4 * part + 4) {
                    record[c - 4 * part] = input[c][chunk * CHUNK + k];
                }
            }
        });
    }
}

/// The values of a point whose family is summed, the same in every lane.
struct Here<H, const I: usize, const A: usize> {
    input: [H; I],
    added: [H; A],
}

/// A sum over the families of a cloud.
pub struct Sum<'a, const D: usize, const I: usize, const A: usize, const O: usize, P: Packs, K> {
    pub instructions: Instructions,
    pub families: &'a CloudFamilies,
    pub weights: &'a CloudWeights,
    pub heterogeneity: Option<&'a Heterogeneity>,
    pub profile: WeightPolynomial<'a>,
    pub sites: SiteView<'a, P::Site>,
    pub states: StatesPointer,
    /// The input values of a point side by side, and behind them those that are added, as [`gather_input`] puts them.
    pub input: &'a [[P::Field; 4]],
    pub memory: Memory<P::Bond>,
    pub output: [SharedSlice<P::Field>; O],
    pub kernel: &'a K,
}

impl<const D: usize, const I: usize, const A: usize, const O: usize, P: Packs, K: BondKernel<D, I, O, A>>
    Sum<'_, D, I, A, O, P, K>
{
    /// Sums the families of a range of points.
    pub fn run<R: BreakRule<D>>(&self, points: Range<usize>, rule: &R) -> Broken {
        let threshold = rule.threshold();
        let mut broken = Broken::default();
        for point in points {
            // SAFETY: `Exec::pass` has checked the lengths of all fields; neighbours are points of the cloud; the words
            // of a point and its slot belong to the chunk that owns the point.
            unsafe {
                let scale = self.scale(point);
                let varied = scale.is_none();
                let mut largest = self.small(point, varied);
                if !R::NEVER && largest > threshold {
                    let here = self.break_bonds(point, rule);
                    if here.bonds > 0 {
                        broken.bonds += here.bonds;
                        broken.energy += here.energy;
                        largest = self.small(point, varied);
                    }
                }
                if K::TWO_FORMS && largest > K::SMALL {
                    self.sum::<false, false>(point, varied);
                }
                // Behind the loops, so that those of one material hold no number more.
                if let Some(scale) = scale.filter(|&scale| scale != 1.0) {
                    for output in &self.output {
                        let sum = &mut *output.0.add(point);
                        *sum = P::Field::from_f64(sum.to_f64() * scale);
                    }
                }
            }
        }
        broken
    }

    /// What the sum of a point is multiplied by; None where its bonds are not all of one constant.
    #[inline(always)]
    fn scale(&self, point: usize) -> Option<f64> {
        match self.heterogeneity {
            None => Some(1.0),
            Some(varied) => matches!(varied.seen(point), Seen::One(_)).then(|| varied.relative(point)),
        }
    }

    /// # Safety
    /// As of [`Sum::sum`].
    unsafe fn small(&self, point: usize, varied: bool) -> f64 {
        unsafe {
            if K::EVERY_STEP && self.profile.plain && !varied {
                self.sum::<true, true>(point, varied)
            } else {
                self.sum::<true, false>(point, varied)
            }
        }
    }

    compiled!(
        sum, sum_on, sum_avx2, sum_avx512 if K::EVERY_STEP,
        [with SMALL: bool, PLAIN: bool], (point: usize, varied: bool), f64
    );
    compiled!(break_bonds, break_on, break_avx2, break_avx512 if false, [rule R: BreakRule<D>], (point: usize, rule: &R), Broken);

    /// Sums one family into the output, in the small or the exact form, with `PLAIN` weights or any, which differ by more
    /// than volumes if they are `varied`; returns the largest |strain| of its whole bonds.
    #[inline(always)]
    unsafe fn sum_on<V, const SMALL: bool, const PLAIN: bool>(&self, point: usize, varied: bool) -> f64
    where
        V: Pack<P::Bond> + LoadEnds<P::Field> + BondVectors<P::Site>,
    {
        let here = unsafe { self.here::<V>(point) };
        let mut watch = V::splat(0.0);
        let mut sums = [[V::splat(0.0); O]; GROUP / 4];
        for group in self.groups(point) {
            let word = unsafe { *self.words().add(group) };
            if word == 0 {
                continue;
            }
            for part in 0..GROUP / V::LANES {
                let mask = word >> (part * V::LANES);
                let (mut bond, relative, added) =
                    unsafe { self.bond::<V, PLAIN>(point, group, part, &here, mask, varied) };
                let strain = self.kernel.strain(&bond, &relative);
                watch = watch.larger(strain);
                if K::MEMORY {
                    // SAFETY: `Exec` has checked that there is a number for each bit; those of a point are its own.
                    unsafe {
                        let at = self.memory.numbers.0.add(group * GROUP + part * V::LANES);
                        bond.memory = V::load(at);
                        bond.memory = self.kernel.remember(&bond, strain);
                        if self.memory.keeps {
                            bond.memory.put(at);
                        }
                    }
                }
                let sum = &mut sums[part];
                let start = if K::RELATIVE { *sum } else { [V::splat(0.0); O] };
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
                *sum = value;
            }
        }
        for c in 0..O {
            // Lane k is added to lane k + 8, then to k + 4, k + 2, k + 1, however many lanes a pack has.
            let mut parts = GROUP / V::LANES;
            while parts > 1 {
                parts /= 2;
                for part in 0..parts {
                    sums[part][c] = sums[part][c] + sums[part + parts][c];
                }
            }
            let total = sums[0][c].total().to_f64();
            // SAFETY: `point` belongs to this chunk alone and the field has the length of the cloud.
            unsafe { *self.output[c].0.add(point) = P::Field::from_f64(total) };
        }
        watch.largest()
    }

    /// Asks each whole bond of a point that is strained beyond the threshold whether it breaks, and clears its bit if so.
    #[inline(always)]
    unsafe fn break_on<V, R: BreakRule<D>>(&self, point: usize, rule: &R) -> Broken
    where
        V: Pack<P::Bond> + LoadEnds<P::Field> + BondVectors<P::Site>,
    {
        let threshold = rule.threshold();
        let here = unsafe { self.here::<V>(point) };
        let mut broken = Broken::default();
        for group in self.groups(point) {
            let word = unsafe { &mut *self.words().add(group) };
            for part in 0..GROUP / V::LANES {
                let (bond, relative, _) =
                    unsafe { self.bond::<V, false>(point, group, part, &here, *word >> (part * V::LANES), true) };
                let strain = self.kernel.strain(&bond, &relative);
                if strain.largest() <= threshold {
                    continue;
                }
                for lane in 0..V::LANES {
                    let k = part * V::LANES + lane;
                    let (strain, there) = (strain.lane(lane), self.families.neighbours[group * GROUP + k] as usize);
                    if *word >> k & 1 == 1 && strain > threshold && rule.breaks(point, there, strain) {
                        *word &= !(1 << k);
                        let xi = std::array::from_fn(|d| bond.xi[d].lane(lane));
                        let mut bond = Bond::new(xi, bond.length.lane(lane), bond.weight.lane(lane));
                        if K::MEMORY {
                            // SAFETY: as above.
                            bond.memory = unsafe { *self.memory.numbers.0.add(group * GROUP + k) }.to_f64();
                        }
                        broken.bonds += 1;
                        broken.energy += self.families.sites.records[point][3] * rule.released(&bond, point, there);
                    }
                }
            }
        }
        broken
    }

    fn groups(&self, point: usize) -> Range<usize> {
        self.families.starts[point] as usize..self.families.starts[point + 1] as usize
    }

    fn n_points(&self) -> usize {
        self.families.starts.len() - 1
    }

    fn words(&self) -> *mut u16 {
        self.states.0
    }

    /// The weights of consecutive bonds of a point, from their lengths and the volumes at their other ends.
    #[inline(always)]
    fn weigh<V: Pack<P::Bond>, const PLAIN: bool>(
        &self,
        point: usize,
        first: usize,
        length: V,
        volume: V,
        varied: bool,
    ) -> V {
        if PLAIN {
            return volume * V::splat(self.profile.influence[0]);
        }
        let weight = self.weigh_alike(first, length, volume);
        match self.heterogeneity.filter(|_| varied) {
            None => weight,
            Some(varied) => weight * self.factors(varied, point, first),
        }
    }

    /// What the weights of consecutive bonds of a point are multiplied by where materials differ.
    #[inline(always)]
    fn factors<V: Pack<P::Bond>>(&self, varied: &Heterogeneity, point: usize, first: usize) -> V {
        let (double, single) = varied.compliance();
        let (compliance, neighbours) = (P::Bond::choose(double, single), &self.families.neighbours[first..]);
        let mut there = [P::Bond::default(); GROUP];
        for (there, &slot) in there[..V::LANES].iter_mut().zip(neighbours) {
            *there = compliance[slot as usize];
        }
        // SAFETY: a pack has at most `GROUP` lanes.
        let factor = V::splat(1.0) / (V::broadcast(compliance[point]) + unsafe { V::load(there.as_ptr()) });
        let Some(pairs) = varied.pairs() else { return factor };
        for (there, &slot) in there[..V::LANES].iter_mut().zip(neighbours) {
            *there = P::Bond::from_f64(pairs.of(point, slot as usize));
        }
        // SAFETY: as above.
        factor * unsafe { V::load(there.as_ptr()) }
    }

    /// The weights of bonds of one material.
    #[inline(always)]
    fn weigh_alike<V: Pack<P::Bond>>(&self, first: usize, length: V, volume: V) -> V {
        let profile = &self.profile;
        if let Some((stored, unit)) = profile.stored {
            let mut weights = [P::Bond::default(); GROUP];
            for (weight, stored) in weights[..V::LANES].iter_mut().zip(&stored[first..]) {
                *weight = P::Bond::from_f64(stored * unit);
            }
            // SAFETY: a pack has at most `GROUP` lanes.
            return volume * unsafe { V::load(weights.as_ptr()) };
        }
        if profile.singly {
            return self.weigh_singly(first, length, volume);
        }
        let one = V::splat(1.0);
        let rim = length.mul_add(V::splat(-profile.inverse_horizon), one).clamped();
        let mut weight = polynomial(profile.influence, rim) * volume;
        if let Some([end, inverse_width]) = profile.ramp {
            weight = weight * ((V::splat(end) - length) * V::splat(inverse_width)).clamped();
        }
        if let Some(fractions) = profile.fractions {
            let mut betas = [P::Bond::default(); GROUP];
            for (beta, fraction) in betas[..V::LANES].iter_mut().zip(&fractions[first..]) {
                *beta = P::Bond::from_f64(f64::from(*fraction) / 65535.0);
            }
            // SAFETY: a pack has at most `GROUP` lanes.
            weight = weight * unsafe { V::load(betas.as_ptr()) };
        }
        weight
    }

    /// The same, bond by bond, for what has no form for many.
    #[inline(never)]
    fn weigh_singly<V: Pack<P::Bond>>(&self, first: usize, length: V, volume: V) -> V {
        let mut weights = [P::Bond::default(); GROUP];
        for k in 0..V::LANES {
            let volume = volume.lane(k) * self.sites.volume_unit;
            weights[k] = P::Bond::from_f64(self.weights.weight(first + k, length.lane(k), volume));
        }
        // SAFETY: a pack has at most `GROUP` lanes.
        unsafe { V::load(weights.as_ptr()) }
    }

    #[inline(always)]
    unsafe fn here<V: LoadEnds<P::Field>>(&self, point: usize) -> Here<V::Held, I, A> {
        let value = |c: usize| {
            let record = point + c / 4 * self.n_points();
            // SAFETY: `gather_input` has made records for all values.
            let values = unsafe { self.input.get_unchecked(record) };
            values[c % 4]
        };
        let mut here = Here { input: [V::NOTHING; I], added: [V::NOTHING; A] };
        for c in 0..I {
            here.input[c] = V::same(value(c));
        }
        for c in 0..A {
            // What is relative to the opposite is the sum.
            here.added[c] = V::opposite(V::same(value(I + c)));
        }
        here
    }

    /// One part of a group of bonds, and the relative values of their ends. `varied`: with the constant of each, where these
    /// differ.
    #[inline(always)]
    unsafe fn bond<V, const PLAIN: bool>(
        &self,
        point: usize,
        group: usize,
        part: usize,
        here: &Here<V::Held, I, A>,
        mask: u16,
        varied: bool,
    ) -> (Bond<D, V>, [V; I], [V; A])
    where
        V: Pack<P::Bond> + LoadEnds<P::Field> + BondVectors<P::Site>,
    {
        let first = group * GROUP + part * V::LANES;
        let sites = &self.sites;
        // SAFETY: groups have `GROUP` neighbours, all of them points of the cloud.
        let (index, between) = unsafe {
            let index = self.families.neighbours.as_ptr().add(first);
            let here = *sites.records.get_unchecked(point);
            (index, V::between(sites.records.as_ptr(), index, here, sites.unit))
        };
        let (vector, volume) = between;
        let mut xi = [V::splat(0.0); D];
        // Padding is the point itself: any length but zero will do, its bit is never set.
        let mut square = V::splat(self.profile.negligible_square);
        for d in 0..D {
            xi[d] = vector[d];
            square = xi[d].mul_add(xi[d], square);
        }
        let inverse = square.inverse_root();
        let length = square * inverse;
        let weight = self.weigh::<V, PLAIN>(point, first, length, volume, varied);
        let (spring, moment, memory) = (weight * inverse, weight * length, V::splat(0.0));
        const { assert!(I <= 4 && I + A <= 8, "values of a point stand in two records, differences in the first") };
        let bond = Bond { xi, length, inverse_square: inverse * inverse, weight, spring, moment, memory };
        let (mut relative, mut added) = ([V::splat(0.0); I], [V::splat(0.0); A]);
        // Two records at most, written out: a loop over them would go through memory.
        if I + A > 0 {
            // SAFETY: `gather_input` has made a record for each point, and `index` names points.
            let there = unsafe { V::gather(self.input.as_ptr(), index) };
            for c in 0..I.min(4) {
                relative[c] = V::relative(there[c], here.input[c], mask);
            }
            for c in I..(I + A).min(4) {
                added[c - I] = V::relative(there[c], here.added[c - I], mask);
            }
        }
        if I + A > 4 {
            // SAFETY: as above, for the second record of each.
            let there = unsafe { V::gather(self.input.as_ptr().add(self.n_points()), index) };
            for c in 4.max(I)..I + A {
                added[c - I] = V::relative(there[c - 4], here.added[c - I], mask);
            }
        }
        (bond, relative, added)
    }
}
