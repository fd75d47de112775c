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
//! own. Points that see one constant only are summed as in a body of one, blocks of a lattice by rows of their own, points of
//! a cloud by a factor of their sum. Blocks that see two, as where two materials meet, choose among three factors by a bit of
//! each end; all others look d up point by point.

use crate::family::{Body, BondStates, Families};
use crate::geometry::lattice::BLOCK;
use crate::parallel;

/// Constants that points may share; further ones are looked up point by point.
const LEVELS: usize = 8;
const NO_POINT: u8 = u8::MAX;
const MANY: u8 = u8::MAX - 1;

/// What the bonds of a block of a lattice, or of a point of a cloud, have to do with the levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// All are of one.
    One(usize),
    /// Both ends are of these two.
    Two([usize; 2]),
    Many,
}

/// What the constants of bonds are beside that of the weights.
#[derive(Debug, Clone)]
pub struct Heterogeneity {
    /// d by slot; ½ where there is no point.
    compliance: Vec<f64>,
    single: Vec<f32>,
    pairs: Option<PairTable>,
    /// c/c₀ of the constants that points share, and a slot of each.
    levels: Vec<(f64, usize)>,
    /// Which of them are seen by each block of a lattice, or by each point of a cloud: twice the same, two, or `MANY` first.
    seen: Vec<[u8; 2]>,
    /// Of each level and slot of a lattice, a bit: whether the slot is of the level; and a word behind.
    bits: Vec<Vec<u16>>,
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
        let mut keys: Vec<(u64, u8)> = Vec::new();
        let mut levels = Vec::new();
        let mut level = |slot: usize| {
            let key = (compliance[slot].to_bits(), pairs.as_ref().map_or(0, |pairs| pairs.materials[slot]));
            match keys.iter().position(|level| *level == key) {
                Some(level) => level as u8,
                None if keys.len() < LEVELS => {
                    keys.push(key);
                    levels.push((relative[slot], slot));
                    keys.len() as u8 - 1
                }
                None => MANY,
            }
        };
        let of_slot: Vec<u8> =
            (0..relative.len()).map(|slot| if relative[slot] > 0.0 { level(slot) } else { NO_POINT }).collect();
        let see = |seen: &mut [u8; 2], slot: usize| match (of_slot[slot], *seen) {
            (NO_POINT, _) | (_, [MANY, _]) => {}
            (MANY, _) => seen[0] = MANY,
            (level, [NO_POINT, _]) => *seen = [level; 2],
            (level, [a, b]) if level == a || level == b => {}
            (level, [a, b]) if a == b => *seen = [a.min(level), a.max(level)],
            _ => seen[0] = MANY,
        };
        let seen = match &body.families {
            Families::Cloud(families) => {
                let of_point = |point: usize| {
                    let mut seen = [NO_POINT; 2];
                    see(&mut seen, point);
                    families.neighbours[families.of(point)].iter().for_each(|&there| see(&mut seen, there as usize));
                    seen
                };
                parallel::map(relative.len(), &of_point)
            }
            Families::Lattice(families) => {
                let (lattice, n) = (&families.lattice, families.offsets.len());
                // What lies behind the end of a row is no neighbour.
                let whole = BondStates::whole(body);
                let of_block = |block: usize| {
                    let first = lattice.guard + block * BLOCK;
                    let mut seen = [NO_POINT; 2];
                    (first..first + BLOCK).for_each(|slot| see(&mut seen, slot));
                    for (offset, word) in families.offsets.iter().zip(&whole.words()[block * n..(block + 1) * n]) {
                        for lane in (0..BLOCK).filter(|lane| word >> lane & 1 == 1) {
                            see(&mut seen, (first + lane).wrapping_add_signed(offset.shift));
                        }
                    }
                    if seen[0] == NO_POINT { [0; 2] } else { seen }
                };
                parallel::map(lattice.n_blocks(), &of_block)
            }
        };
        let bits = match &body.families {
            Families::Cloud(_) => Vec::new(),
            Families::Lattice(_) => {
                let word = |level: usize, word: usize| {
                    let bit = |bit: usize| u16::from(of_slot[BLOCK * word + bit] == level as u8) << bit;
                    (0..BLOCK).map(bit).fold(0, |a, b| a | b)
                };
                let n = of_slot.len() / BLOCK;
                // And a word behind, which is read beside the last.
                let words = |level| [parallel::map(n, &|k| word(level, k)), vec![0]].concat();
                (0..levels.len()).map(words).collect()
            }
        };
        Heterogeneity { compliance, single, pairs, levels, seen, bits }
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

    /// c/c₀ of the constants that points share.
    pub fn levels(&self) -> impl Iterator<Item = f64> + Clone + '_ {
        self.levels.iter().map(|(factor, _)| *factor)
    }

    pub fn n_levels(&self) -> usize {
        self.levels.len()
    }

    /// c/c₀ of the bonds between points of two levels.
    pub fn between(&self, levels: [usize; 2]) -> f64 {
        let [here, there] = levels.map(|level| self.levels[level].1);
        self.factor(here, there)
    }

    /// What the bonds of a block of a lattice, or of a point of a cloud, see.
    #[inline]
    pub fn seen(&self, of: usize) -> Seen {
        match self.seen[of] {
            [MANY, _] => Seen::Many,
            [a, b] if a == b => Seen::One(a as usize),
            [a, b] => Seen::Two([a as usize, b as usize]),
        }
    }

    /// Of each slot of a lattice, whether it is of this level: sixteen bits a word.
    pub fn bits(&self, level: usize) -> &[u16] {
        &self.bits[level]
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
        let bits: usize = self.bits.iter().map(|bits| size_of_val(&bits[..])).sum();
        size_of_val(&self.compliance[..]) + size_of_val(&self.single[..]) + size_of_val(&self.seen[..]) + bits + pairs
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
        assert!(found.levels().eq([1.0, 3.0]));
        let Families::Lattice(families) = &body.families else { panic!("a lattice") };
        let blocks: Vec<_> = families.blocks[..6].iter().map(|&block| found.seen(block as usize)).collect();
        // The joint lies between the third block of a row and the fourth; both see across.
        let (one, two) = (Seen::One, Seen::Two([0, 1]));
        assert_eq!(blocks, [one(0), one(0), two, two, one(1), one(1)]);
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
        assert!(families.blocks[1..].iter().all(|&block| found.seen(block as usize) == Seen::Many));
    }
}
