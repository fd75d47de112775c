//! Bonds of a body whose stiffness (or diffusivity) differs from point to point: by material, or within one.
//!
//! A summand is linear in the weight of its bond, so that a bond between c(x) and c(x′) is one of c₀, which the weights are
//! of, times
//!
//! ```text
//! c(x, x′)/c₀ = 1/(d(x) + d(x′)) · t,   d = c₀/(2c)
//! ```
//!
//! the harmonic mean, as of two springs in a row, each half of the bond; t ≠ 1 where a pair of materials has a constant of its
//! own. On a lattice a block of points that sees one constant only keeps shared rows, one set for each constant; mixed blocks
//! look d up point by point.

use crate::family::{Body, BondStates, Families};
use crate::geometry::lattice::BLOCK;
use crate::parallel;

/// Constants that blocks of a lattice may share; further ones are looked up point by point.
const LEVELS: usize = 8;
const NO_POINT: u8 = u8::MAX;
const MANY: u8 = u8::MAX - 1;

/// What the constants of bonds are beside that of the weights.
#[derive(Debug, Clone)]
pub struct Heterogeneity {
    /// d by slot; ½ where there is no point.
    compliance: Vec<f64>,
    single: Vec<f32>,
    pairs: Option<PairTable>,
    /// c/c₀ of blocks that see one constant only.
    levels: Vec<f64>,
    /// Of each block of a lattice which of them; `MANY` for mixed ones.
    of_block: Vec<u8>,
}

/// Factors of the bonds between materials whose pair has a constant of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct PairTable {
    /// By slot.
    pub materials: Vec<u8>,
    /// t over the harmonic mean, row by row of materials; symmetric, 1 on the diagonal.
    pub factors: Vec<f64>,
    /// Of materials.
    pub n: usize,
}

impl PairTable {
    #[inline]
    pub fn of(&self, here: usize, there: usize) -> f64 {
        self.factors[self.materials[here] as usize * self.n + self.materials[there] as usize]
    }
}

impl Heterogeneity {
    /// `relative`: c/c₀ by slot, zero where there is no point.
    pub fn new<const D: usize>(body: &Body<D>, relative: &[f64], pairs: Option<PairTable>) -> Self {
        let compliance: Vec<f64> = relative.iter().map(|&c| if c > 0.0 { 0.5 / c } else { 0.5 }).collect();
        let single = compliance.iter().map(|&d| d as f32).collect();
        let mut levels: Vec<(u64, u8)> = Vec::new();
        let level = |slot: usize, levels: &mut Vec<(u64, u8)>| {
            let key = (compliance[slot].to_bits(), pairs.as_ref().map_or(0, |pairs| pairs.materials[slot]));
            match levels.iter().position(|level| *level == key) {
                Some(level) => level as u8,
                None if levels.len() < LEVELS => {
                    levels.push(key);
                    levels.len() as u8 - 1
                }
                None => MANY,
            }
        };
        let of_slot: Vec<u8> = (0..relative.len())
            .map(|slot| if relative[slot] > 0.0 { level(slot, &mut levels) } else { NO_POINT })
            .collect();
        let of_block = match &body.families {
            Families::Cloud(_) => Vec::new(),
            Families::Lattice(families) => {
                let lattice = &families.lattice;
                let of_block = |block: usize| {
                    let first = lattice.guard + block * BLOCK;
                    let mut found = NO_POINT;
                    for slot in (first..first + BLOCK).filter(|&slot| of_slot[slot] != NO_POINT) {
                        let there = families.offsets.iter().map(|offset| slot.wrapping_add_signed(offset.shift));
                        for slot in std::iter::once(slot).chain(there) {
                            match of_slot[slot] {
                                NO_POINT => {}
                                MANY => return MANY,
                                level if found == NO_POINT => found = level,
                                level if found != level => return MANY,
                                _ => {}
                            }
                        }
                    }
                    if found == NO_POINT { 0 } else { found }
                };
                parallel::map(lattice.n_blocks(), &of_block)
            }
        };
        let levels = levels.iter().map(|(bits, _)| 0.5 / f64::from_bits(*bits)).collect();
        Heterogeneity { compliance, single, pairs, levels, of_block }
    }

    /// c(x, x′)/c₀ of the bond between two slots; the same from both ends.
    #[inline]
    pub fn factor(&self, here: usize, there: usize) -> f64 {
        let mean = 1.0 / (self.compliance[here] + self.compliance[there]);
        self.pairs.as_ref().map_or(mean, |pairs| mean * pairs.of(here, there))
    }

    /// c/c₀ at a slot.
    pub fn relative(&self, slot: usize) -> f64 {
        0.5 / self.compliance[slot]
    }

    /// d by slot in both kinds of numbers.
    pub fn compliance(&self) -> (&[f64], &[f32]) {
        (&self.compliance, &self.single)
    }

    pub fn pairs(&self) -> Option<&PairTable> {
        self.pairs.as_ref()
    }

    /// c/c₀ of blocks that see one constant only.
    pub fn levels(&self) -> &[f64] {
        &self.levels
    }

    /// Which of the levels all bonds of the points of a block have; None where they differ.
    #[inline]
    pub fn level(&self, block: u32) -> Option<usize> {
        let level = self.of_block[block as usize];
        (level != MANY).then_some(level as usize)
    }

    /// Slots of the points that have a bond in `states` to another constant.
    pub fn mixed<const D: usize>(&self, body: &Body<D>, states: &BondStates) -> Vec<u32> {
        let is_mixed = |slot: usize| {
            let differs = |there: usize| {
                self.compliance[there] != self.compliance[slot]
                    || self.pairs.as_ref().is_some_and(|pairs| pairs.of(slot, there) != 1.0)
            };
            body.bonds_of(slot).any(|(bit, there)| states.holds(bit) && differs(there))
        };
        let slots = &body.cloud.slots;
        let mixed = parallel::map(slots.len(), &|k| is_mixed(slots[k] as usize));
        slots.iter().zip(mixed).filter(|(_, mixed)| *mixed).map(|(slot, _)| *slot).collect()
    }

    /// The same for points of which each is of the material of one before: `from` by slot.
    pub fn inherited<const D: usize>(&self, body: &Body<D>, from: &[usize]) -> Self {
        let relative: Vec<f64> = from.iter().map(|&old| self.relative(old)).collect();
        let pairs = self.pairs.as_ref().map(|pairs| PairTable {
            materials: from.iter().map(|&old| pairs.materials[old]).collect(),
            ..pairs.clone()
        });
        Heterogeneity::new(body, &relative, pairs)
    }

    /// Bytes.
    pub fn memory(&self) -> usize {
        let pairs = self.pairs.as_ref().map_or(0, |pairs| pairs.materials.len());
        size_of_val(&self.compliance[..]) + size_of_val(&self.single[..]) + self.of_block.len() + pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cloud, Shape};

    #[test]
    fn blocks_that_see_one_constant_share_rows_and_others_do_not() {
        let cloud = Cloud::lattice(&Shape::Box { low: [0.0; 2], high: [9.6, 0.8] }, 0.1, 4);
        let body = Body::new(cloud, 0.3, 0.3..0.3 * (1.0 + 1e-9), |_| true);
        let mut relative = vec![0.0; body.cloud.n_slots()];
        for &slot in &body.cloud.slots {
            relative[slot as usize] = if body.cloud.position(slot as usize)[0] < 4.8 { 1.0 } else { 3.0 };
        }
        let found = Heterogeneity::new(&body, &relative, None);
        assert_eq!(found.levels(), [1.0, 3.0]);
        let Families::Lattice(families) = &body.families else { panic!("a lattice") };
        let blocks: Vec<_> = families.blocks[..6].iter().map(|&block| found.level(block)).collect();
        // The joint lies between the third block of a row and the fourth; both see across.
        assert_eq!(blocks, [Some(0), Some(0), None, None, Some(1), Some(1)]);
        // Three columns of points on either side.
        assert_eq!(found.mixed(&body, &BondStates::whole(&body)).len(), 6 * 8);
        let [a, b] = [families.blocks[0], families.blocks[5]].map(|block| families.lattice.guard + 16 * block as usize);
        assert_eq!(found.factor(a, b), 1.5, "1/(1/2 + 1/6)");
        assert_eq!(found.factor(a, b), found.factor(b, a));
        assert_eq!(found.factor(b, b), 3.0);
        let table = PairTable {
            materials: relative.iter().map(|&c| u8::from(c == 3.0)).collect(),
            factors: vec![1.0, 0.5, 0.5, 1.0],
            n: 2,
        };
        assert_eq!(Heterogeneity::new(&body, &relative, Some(table)).factor(a, b), 0.75);
    }

    #[test]
    fn a_constant_that_changes_everywhere_has_no_shared_rows() {
        let cloud = Cloud::lattice(&Shape::Box { low: [0.0], high: [6.4] }, 0.1, 4);
        let body = Body::new(cloud, 0.3, 0.3..0.3 * (1.0 + 1e-9), |_| true);
        let mut relative = vec![0.0; body.cloud.n_slots()];
        body.cloud.slots.iter().for_each(|&slot| relative[slot as usize] = 1.0 + f64::from(slot));
        let found = Heterogeneity::new(&body, &relative, None);
        let Families::Lattice(families) = &body.families else { panic!("a lattice") };
        assert!(families.blocks.iter().all(|&block| found.level(block).is_none()));
    }
}
