//! Rows in the pass that makes what they act on: slab by slab, so that what the motion leaves is read again, and the force that
//! it has read is written again, while they are in the cache. In 3D, where a row reaches planes, the cache is too small for that,
//! and rows follow when all is made.

use std::ops::Range;

use super::{Limits, SharedSlice, Sum};
use crate::discretization::Regions;
use crate::discretization::collocation::SharedRow;
use crate::execution::Exec;
use crate::execution::packs::Packs;
use crate::family::Body;
use crate::geometry::lattice::BLOCK;
use crate::parallel;

/// Slots in a slab: the second-level cache holds a few slabs of four vectors in 2D.
const SLAB: usize = 4096;

/// The vectors of a step, or the same part of each.
pub struct Motion<'a, T> {
    pub displacement: &'a mut [T],
    pub velocity: &'a mut [T],
    pub force: &'a mut [T],
    /// What rows act on.
    pub damped: &'a mut [T],
}

/// What a strip of slabs has found, with the rows near its ends left to do.
struct Strip {
    found: Vec<u32>,
    sums: Vec<f64>,
    left: [Range<usize>; 2],
}

impl Exec {
    /// As [`Exec::collocate`] from `damped` to `force` over all rows, but `pass` first makes `damped` of the other vectors, called
    /// once for each part. Gives the sum of what it returns, too: in parts of fixed size added in order.
    ///
    /// # Panics
    /// If the body is no lattice, or a vector has not the length of the cloud.
    pub fn collocate_fused<const D: usize, P: Packs>(
        &mut self,
        body: &Body<D>,
        row: &SharedRow<D>,
        regions: &Regions,
        motion: Motion<'_, P::Field>,
        limits: &Limits,
        pass: &(dyn Fn(Motion<'_, P::Field>) -> f64 + Sync),
    ) -> (Vec<u32>, f64) {
        let n = body.cloud.n_slots();
        let parts = |flat: &mut [P::Field]| -> [SharedSlice<P::Field>; D] {
            assert_eq!(flat.len(), D * n, "vectors have the length of the cloud");
            // SAFETY: all D parts are inside.
            std::array::from_fn(|d| SharedSlice(unsafe { flat.as_mut_ptr().add(d * n) }))
        };
        let Motion { displacement, velocity, force, damped } = motion;
        let [u, v, f, damped] = [displacement, velocity, force, damped].map(parts);
        let make = |slots: Range<usize>| -> f64 {
            // SAFETY: slots between 0 and n, each in one call; rows touch only those that were made before in their own strip,
            // or by any when all are made.
            let part = |of: &[SharedSlice<P::Field>; D], d: usize| unsafe {
                std::slice::from_raw_parts_mut(of[d].0.add(slots.start), slots.len())
            };
            let motion = |d| Motion {
                displacement: part(&u, d),
                velocity: part(&v, d),
                force: part(&f, d),
                damped: part(&damped, d),
            };
            (0..D).map(|d| pass(motion(d))).sum()
        };
        let sum = Sum::<D, P>::new(self.instructions, body, regions, damped, &f, limits).of(row);
        // SAFETY: as of `collocate`, and what a row reads has been made.
        sum.each_fused(&make, |slot| unsafe { sum.force(slot) })
    }
}

impl<const D: usize, P: Packs> Sum<'_, D, P> {
    /// As [`each`](Self::each) over all blocks with a row, but `make` is called for all slots, slab by slab, and work on a
    /// block is done once all is made that its row reaches. Where blocks are not in the order of slots, as in the tiles of 3D,
    /// that is when all is made.
    fn each_fused(
        &self,
        make: &(impl Fn(Range<usize>) -> f64 + Sync),
        work: impl Fn(usize) -> u16 + Sync,
    ) -> (Vec<u32>, f64) {
        let (n, blocks) = (self.lattice.n_slots, &self.regions.collocated[..]);
        let first = |block: u32| self.lattice.guard + block as usize * BLOCK;
        let reaches = self.pairs.iter().map(|pair| pair.shift.unsigned_abs());
        let reach = reaches.chain(self.lattice.strides).max().unwrap_or(0);
        let n_slabs = n.div_ceil(SLAB);
        if !blocks.is_sorted() {
            let sums = parallel::map(n_slabs, &|slab| make(slab * SLAB..((slab + 1) * SLAB).min(n)));
            return (self.each(blocks, work), sums.iter().sum());
        }
        let strip = |slabs: Range<usize>| {
            let (begin, end) = (slabs.start * SLAB, (slabs.end * SLAB).min(n));
            let from = |slot: usize| blocks.partition_point(|&block| first(block) < slot);
            let mine = from(begin)..from(end);
            // Other strips make what rows near the ends of this one reach.
            let low = from(if begin == 0 { 0 } else { begin + reach }).min(mine.end);
            let high = if end == n { mine.end } else { from((end + 1).saturating_sub(reach + BLOCK)) };
            let inner = low..high.max(low);
            let (mut found, mut next) = (Vec::new(), inner.start);
            let make_and_follow = |slab: usize| {
                let made = ((slab + 1) * SLAB).min(n);
                let sum = make(slab * SLAB..made);
                while next < inner.end && (made == n || first(blocks[next]) + BLOCK + reach <= made) {
                    note(&mut found, first(blocks[next]), work(first(blocks[next])));
                    next += 1;
                }
                sum
            };
            let sums = slabs.map(make_and_follow).collect();
            assert_eq!(next, inner.end, "all is made that rows of a strip reach");
            Strip { found, sums, left: [mine.start..inner.start, inner.end..mine.end] }
        };
        let wide = n_slabs.div_ceil(rayon::current_num_threads());
        let starts: Vec<usize> = (0..n_slabs).step_by(wide).collect();
        let strips = parallel::map(starts.len(), &|k| strip(starts[k]..(starts[k] + wide).min(n_slabs)));
        let left: Vec<u32> = strips.iter().flat_map(|s| s.left.clone()).flat_map(|r| &blocks[r]).copied().collect();
        let mut found = self.each(&left, work);
        found.extend(strips.iter().flat_map(|strip| &strip.found));
        (found, strips.iter().flat_map(|strip| &strip.sums).sum())
    }
}

/// Adds the slots of a block, from `first`, whose bit is set.
pub(super) fn note(found: &mut Vec<u32>, first: usize, bits: u16) {
    if bits != 0 {
        found.extend((0..BLOCK).filter(|k| bits >> k & 1 == 1).map(|k| (first + k) as u32));
    }
}
