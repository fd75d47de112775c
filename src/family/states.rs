//! The state of each bond: one bit, set while the bond holds.
//!
//! On a lattice the bits of [`BLOCK`] consecutive slots and one offset are one word, so that a vector's mask is one
//! load; on a cloud so are the bits of [`GROUP`] consecutive bonds of one point. A bond has two bits, one at each end, which
//! each end's own sum reads and clears; both ends see the same stretch to the last bit and so decide alike.

use rayon::prelude::*;

use super::{Body, CloudFamilies, Families, GROUP};
use crate::geometry::lattice::BLOCK;
use crate::geometry::{Crack, Cracks};
use crate::parallel;

/// One bit for each directed bond: of a lattice in `words[block * offsets + offset]`, of a cloud in `words[group of bonds]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BondStates {
    words: Vec<u16>,
}

impl BondStates {
    /// Of words in the order of the families.
    pub fn new(words: Vec<u16>) -> Self {
        BondStates { words }
    }

    /// All bonds of a body, whole. On a lattice, bonds to absent points never exist.
    pub fn whole<const D: usize>(body: &Body<D>) -> Self {
        let mut words = vec![0u16; body.n_words()];
        match &body.families {
            Families::Lattice(families) => {
                let lattice = &families.lattice;
                let mut present = vec![0u16; lattice.n_slots / BLOCK];
                for &slot in &body.cloud.slots {
                    present[slot as usize / BLOCK] |= 1 << (slot as usize % BLOCK);
                }
                let own = present.clone();
                // Images are seen, and see nobody.
                for (slot, ..) in body.cloud.images.iter().flat_map(|images| images.iter()) {
                    present[slot / BLOCK] |= 1 << (slot % BLOCK);
                }
                let first = lattice.guard / BLOCK;
                let row_blocks = lattice.counts[0].div_ceil(BLOCK);
                words.par_chunks_mut(families.offsets.len().max(1)).enumerate().for_each(|(block, words)| {
                    let here = own[first + block];
                    if here == 0 {
                        return;
                    }
                    let cell = lattice.cell(lattice.guard + (block / row_blocks) * row_blocks * BLOCK);
                    let x = (block % row_blocks) as i64 * BLOCK as i64;
                    for (word, offset) in words.iter_mut().zip(&families.offsets) {
                        let mut along = offset.step;
                        along[0] = 0;
                        let Some(row) = lattice.neighbour(cell, along) else { continue };
                        let row_first = lattice.slot(row) / BLOCK;
                        // The sixteen presence bits that start at cell x + step along the row; none outside it.
                        let start = x + i64::from(offset.step[0]);
                        let (q, r) = (start.div_euclid(BLOCK as i64), start.rem_euclid(BLOCK as i64));
                        let at = |q: i64| {
                            if (0..row_blocks as i64).contains(&q) { present[row_first + q as usize] } else { 0 }
                        };
                        let window = (u32::from(at(q)) | u32::from(at(q + 1)) << BLOCK) >> r;
                        *word = here & window as u16;
                    }
                });
            }
            Families::Cloud(families) => {
                let pieces = CloudFamilies::pieces(&families.starts, &mut words, 1);
                pieces.into_par_iter().for_each(|(points, words)| {
                    words.fill(u16::MAX);
                    let first = families.starts[points.start];
                    for point in points {
                        // Padding stands at the end of a family.
                        let Some(last) = families.neighbours[families.of(point)].last_chunk::<GROUP>() else {
                            continue;
                        };
                        let bonds = last.iter().filter(|&&other| other as usize != point).count();
                        words[(families.starts[point + 1] - first) as usize - 1] = u16::MAX >> (GROUP - bonds);
                    }
                });
            }
        }
        BondStates { words }
    }

    /// Directed bonds that hold.
    pub fn count(&self) -> u64 {
        self.words.iter().map(|w| u64::from(w.count_ones())).sum()
    }

    /// Whether the bond holds whose state is bit `bit % 16` of word `bit / 16`.
    pub fn holds(&self, bit: usize) -> bool {
        self.words[bit / BLOCK] >> (bit % BLOCK) & 1 == 1
    }

    /// Bonds of each point that hold, in point order.
    pub fn per_point<const D: usize>(&self, body: &Body<D>) -> Vec<u32> {
        let slots = &body.cloud.slots;
        let holds = |(bit, _): &(usize, usize)| self.holds(*bit);
        parallel::map(slots.len(), &|k| body.bonds_of(slots[k] as usize).filter(holds).count() as u32)
    }

    /// The words.
    pub fn words(&self) -> &[u16] {
        &self.words
    }

    pub fn words_mut(&mut self) -> &mut [u16] {
        &mut self.words
    }

    /// The same, to be shown and replaced.
    pub fn vector(&mut self) -> &mut Vec<u16> {
        &mut self.words
    }

    /// The words as bytes, for hashing and saving.
    pub fn bytes(&self) -> Vec<u8> {
        self.words.iter().flat_map(|w| w.to_le_bytes()).collect()
    }

    /// Breaks every bond that cracks or their images cut; returns how many directed bonds it broke. `tolerance` in m: what
    /// counts as touching (see [`Crack`]).
    pub fn cut<const D: usize>(&mut self, body: &Body<D>, cracks: &[Crack<D>], tolerance: f64) -> u64 {
        let mut cracks = cracks.to_vec();
        if let Some(images) = &body.cloud.images {
            let beyond: Vec<Crack<D>> = cracks.iter().flat_map(|crack| images.of_crack(crack)).collect();
            cracks.extend(beyond);
        }
        let reach = match &body.families {
            Families::Lattice(families) => families.longest(),
            Families::Cloud(_) => 2.0 * body.horizon,
        };
        let cracks = Cracks::new(&cracks, tolerance);
        let mut cut = 0;
        let slots: Vec<usize> = body.cloud.stored(0..body.cloud.n_points()).collect();
        // Consecutive slots are near each other.
        for slots in slots.chunks(BLOCK) {
            let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
            for &slot in slots {
                let x = body.cloud.position(slot);
                for d in 0..D {
                    low[d] = low[d].min(x[d] - reach);
                    high[d] = high[d].max(x[d] + reach);
                }
            }
            let near = cracks.near(&low, &high);
            if near.is_empty() {
                continue;
            }
            for &slot in slots {
                let a = body.cloud.position(slot);
                for (bit, there) in body.bonds_of(slot) {
                    if self.holds(bit) && cracks.cut_by(&near, &a, &body.cloud.position(there)) {
                        self.words[bit / BLOCK] &= !(1 << (bit % BLOCK));
                        cut += 1;
                    }
                }
            }
        }
        cut
    }
}

/// A bit of a word is a slot of a block on a lattice, and a bond of a group on a cloud.
const _: () = assert!(BLOCK == GROUP);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cloud, Shape};

    #[test]
    fn bonds_of_a_disk_join_present_points_only_and_come_in_pairs() {
        let disk = Shape::Ball { center: [0.0, 0.0], radius: 1.0 };
        let body = Body::new(Cloud::lattice(&disk, 0.07, 3), 0.21, 0.21..0.21 * (1.0 + 1e-9), |_| true);
        let scattered = Cloud::scattered(
            body.cloud.slots.iter().map(|&s| body.cloud.position(s as usize)).collect(),
            vec![0.07 * 0.07; body.cloud.n_points()],
        );
        let same = Body::new(scattered, 0.21, 0.21..0.21 * (1.0 + 1e-9), |_| true);
        let whole = BondStates::whole(&body);
        assert_eq!(whole.count(), BondStates::whole(&same).count());
        assert_eq!(whole.count() % 2, 0);
    }

    #[test]
    fn a_bit_is_the_same_bond_at_both_ends_and_on_a_lattice_and_its_cloud() {
        let ball = Shape::Ball { center: [0.0; 3], radius: 1.0 };
        let body = Body::new(Cloud::lattice(&ball, 0.2, 3), 0.5, 0.5..0.5 * (1.0 + 1e-9), |_| true);
        let positions: Vec<[f64; 3]> = body.cloud.slots.iter().map(|&s| body.cloud.position(s as usize)).collect();
        let volumes = vec![0.2f64.powi(3); positions.len()];
        let same = Body::new(Cloud::scattered(positions, volumes), 0.5, 0.5..0.5 * (1.0 + 1e-9), |_| true);
        let bonds = |body: &Body<3>, swapped: bool| {
            let whole = BondStates::whole(body);
            let set = (0..16 * whole.words().len()).filter(|bit| whole.words()[bit / 16] >> (bit % 16) & 1 == 1);
            let ends = |bit| {
                let [a, b] = body.ends_of(bit).map(|slot| body.cloud.position(slot).map(f64::to_bits));
                if swapped { [b, a] } else { [a, b] }
            };
            let mut bonds: Vec<_> = set.map(ends).collect();
            bonds.sort_unstable();
            bonds
        };
        let all = bonds(&body, false);
        assert_eq!(all, bonds(&body, true));
        assert_eq!(all, bonds(&same, false));
        assert!(all.windows(2).all(|pair| pair[0] != pair[1]), "a bond has one bit at each end");
    }
}
