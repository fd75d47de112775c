//! The hybrid scheme: which points of a lattice sum their bonds, and which have a row.
//!
//! Shojaei et al. 2022, section 4: Ω = Ω_st ∪ Ω_pr. A row stands for the integral over a whole ball of unbroken bonds, so
//! that points near boundaries, cracks and whatever is about to break sum their bonds. A point goes from its row to its
//! bonds, never back.
//!
//! Deliberately absent: the rows themselves (`collocation`), and what makes a point go over (`physics::elasticity::hybrid`).

use crate::family::{Body, BondStates, Families, LatticeFamilies};
use crate::geometry::Lattice;
use crate::geometry::lattice::BLOCK;
use crate::visit::Visitor;

/// Which scheme holds at which point.
#[derive(Debug, Clone)]
pub struct Regions {
    /// Sixteen slots a word: those with a point, and those of them that have a row.
    present: Vec<u16>,
    rows: Vec<u16>,
    /// Those whose families have been switched: cracks ask for the same again and again.
    settled: Vec<u16>,
    /// Blocks with a point that sums its bonds, in the order of the families.
    pub standard: Vec<u32>,
    /// Blocks with a point that has a row.
    pub collocated: Vec<u32>,
    /// Blocks that are in both.
    pub mixed: Vec<u32>,
    /// Points, and those of them that have a row.
    points: usize,
    collocated_points: usize,
}

impl Regions {
    /// Rows at all points, but those that lack a bond, those among `standard` (slots), and what these see, what that sees,
    /// and so on, `buffer` − 1 times: the rows begin `buffer` horizons from boundaries and pre-cracks.
    ///
    /// With a buffer of one, rows reach into the layer along a boundary where the field is not smooth, because families there
    /// are not complete: a few per cent of the energy of a wave are lost or gained there. With two they do not.
    ///
    /// # Panics
    /// If the body is not a lattice.
    pub fn new<const D: usize>(
        body: &Body<D>,
        states: &BondStates,
        standard: impl Iterator<Item = u32>,
        buffer: u32,
    ) -> Self {
        let (lattice, families) = parts(body);
        let n = families.offsets.len();
        let mut present = vec![0u16; lattice.n_slots / BLOCK];
        for &slot in &body.cloud.slots {
            present[slot as usize / BLOCK] |= 1 << (slot as usize % BLOCK);
        }
        let mut rows = vec![0u16; present.len()];
        let first = lattice.guard / BLOCK;
        for &block in &families.blocks {
            let words = &states.words()[block as usize * n..(block as usize + 1) * n];
            rows[first + block as usize] = words.iter().fold(u16::MAX, |all, word| all & word);
        }
        for slot in standard {
            rows[slot as usize / BLOCK] &= !(1 << (slot as usize % BLOCK));
        }
        let mut regions = Regions {
            settled: vec![0; present.len()],
            present,
            rows,
            standard: Vec::new(),
            collocated: Vec::new(),
            mixed: Vec::new(),
            points: body.cloud.n_points(),
            collocated_points: 0,
        };
        for _ in 1..buffer {
            let bonds = |slot: &u32| !regions.has_row(*slot as usize);
            let standard: Vec<u32> = body.cloud.slots.iter().copied().filter(bonds).collect();
            regions.clear_families(body, &standard);
        }
        regions.list(body);
        regions
    }

    /// Whether the point in `slot` has a row.
    #[inline]
    pub fn has_row(&self, slot: usize) -> bool {
        self.rows[slot / BLOCK] >> (slot % BLOCK) & 1 == 1
    }

    /// The points with a row among the sixteen slots from `first`, a multiple of sixteen.
    #[inline]
    pub fn rows(&self, first: usize) -> u16 {
        self.rows[first / BLOCK]
    }

    /// From here on these points (slots) and all in their families sum their bonds. Gives how many had a row.
    pub fn switch<const D: usize>(&mut self, body: &Body<D>, slots: &[u32]) -> usize {
        let before = self.collocated_points;
        if self.clear_families(body, slots) {
            self.list(body);
        }
        before - self.collocated_points
    }

    fn clear_families<const D: usize>(&mut self, body: &Body<D>, slots: &[u32]) -> bool {
        let (lattice, families) = parts(body);
        // Where the image of a point is seen, the point itself is seen by the image of who sees it.
        let images = body.cloud.images.as_ref();
        let mut changed = false;
        let mut clear = |slot: usize| {
            let (word, bit) = (&mut self.rows[slot / BLOCK], 1 << (slot % BLOCK));
            changed |= *word & bit != 0;
            *word &= !bit;
        };
        for &slot in slots {
            let (settled, bit) = (&mut self.settled[slot as usize / BLOCK], 1 << (slot as usize % BLOCK));
            if *settled & bit != 0 {
                continue;
            }
            *settled |= bit;
            let cell = lattice.cell(slot as usize);
            clear(slot as usize);
            for offset in &families.offsets {
                if let Some(there) = lattice.neighbour(cell, offset.step) {
                    let there = lattice.slot(there);
                    clear(images.map_or(there, |images| images.source(there).0));
                }
            }
        }
        changed
    }

    /// Renews the lists of blocks.
    fn list<const D: usize>(&mut self, body: &Body<D>) {
        let (lattice, families) = parts(body);
        let first = lattice.guard / BLOCK;
        self.standard.clear();
        self.collocated.clear();
        self.mixed.clear();
        self.collocated_points = 0;
        for &block in &families.blocks {
            let (rows, present) = (self.rows[first + block as usize], self.present[first + block as usize]);
            self.collocated_points += rows.count_ones() as usize;
            if present != rows {
                self.standard.push(block);
            }
            if rows != 0 {
                self.collocated.push(block);
            }
            if rows != 0 && present != rows {
                self.mixed.push(block);
            }
        }
    }

    /// Points that sum their bonds.
    pub fn standard_points(&self) -> usize {
        self.points - self.collocated_points
    }

    /// Points that have a row.
    pub fn collocated_points(&self) -> usize {
        self.collocated_points
    }

    /// Shows everything but which points there are.
    pub fn visit(&mut self, visitor: &mut dyn Visitor) {
        visitor.words("points_with_rows", &mut self.rows);
        visitor.words("points_whose_families_were_switched", &mut self.settled);
        visitor.indices("blocks_with_bonds", &mut self.standard);
        visitor.indices("blocks_with_rows", &mut self.collocated);
        visitor.indices("blocks_with_both", &mut self.mixed);
        let mut points = self.collocated_points as u64;
        visitor.count("points_with_rows", &mut points);
        self.collocated_points = points as usize;
    }

    /// Bytes that it takes.
    pub fn memory(&self) -> usize {
        let blocks = self.standard.capacity() + self.collocated.capacity() + self.mixed.capacity();
        3 * size_of_val(&self.rows[..]) + 4 * blocks
    }
}

fn parts<const D: usize>(body: &Body<D>) -> (&Lattice<D>, &LatticeFamilies<D>) {
    let Families::Lattice(families) = &body.families else { panic!("the hybrid scheme is for lattices") };
    (&families.lattice, families)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{difference, norm};
    use crate::geometry::{Cloud, Crack, Shape};

    /// 20 × 20 points, δ = 3 spacings, cut from the left to the middle.
    fn plate() -> (Body<2>, BondStates) {
        let square = Shape::Box { low: [0.0; 2], high: [20.0; 2] };
        let body = Body::new(Cloud::lattice(&square, 1.0, 3), 3.0, 3.0..3.0 * (1.0 + 1e-9), |_| true);
        let mut states = BondStates::whole(&body);
        states.cut(&body, &[Crack::Polyline(vec![[-1.0, 10.0], [8.0, 10.0]])], 1e-9);
        (body, states)
    }

    #[test]
    fn rows_keep_as_many_horizons_from_boundaries_and_cracks_as_the_buffer_has() {
        let (body, states) = plate();
        let corner = body.cloud.slots[5 * 20 + 15];
        for (buffer, reach) in [(1, 3.0), (2, 6.0)] {
            let regions = Regions::new(&body, &states, std::iter::once(corner), buffer);
            for &slot in &body.cloud.slots {
                let [x, y] = body.cloud.position(slot as usize);
                let edge = x.min(20.0 - x).min(y).min(20.0 - y);
                let tip = norm(&[(x - 8.0).max(0.0), y - 10.0]);
                let named = norm(&difference(&[x, y], &body.cloud.position(corner as usize)));
                // The points of a family are up to 3 away along an axis, and as far as that lets them be across.
                if edge < reach || x < 8.0 && (y - 10.0).abs() < reach || named <= reach - 3.0 {
                    assert!(!regions.has_row(slot as usize), "{buffer}: {x} {y}");
                } else if tip > reach && named > reach {
                    assert!(regions.has_row(slot as usize), "{buffer}: {x} {y}");
                }
            }
            let counted = body.cloud.slots.iter().filter(|&&slot| regions.has_row(slot as usize)).count();
            assert_eq!(regions.collocated_points(), counted);
            // Two horizons are too many for most of so small a plate.
            assert!(counted > 20 || buffer == 2);
        }
    }

    #[test]
    fn a_point_that_switches_takes_its_family_along_and_nothing_switches_back() {
        let (body, states) = plate();
        let mut regions = Regions::new(&body, &states, std::iter::empty(), 1);
        let centre = *body.cloud.slots.iter().find(|&&s| body.cloud.position(s as usize) == [15.5, 15.5]).unwrap();
        let before = regions.clone();
        // Of the 29 points of the disk, 11 are within a horizon of a boundary.
        assert_eq!(regions.switch(&body, &[centre]), 18);
        assert_eq!(regions.switch(&body, &[centre]), 0);
        for &slot in &body.cloud.slots {
            let near = norm(&difference(&body.cloud.position(slot as usize), &[15.5, 15.5])) <= 3.0;
            assert_eq!(regions.has_row(slot as usize), before.has_row(slot as usize) && !near);
        }
        let blocks = |list: &[u32]| list.iter().copied().collect::<std::collections::BTreeSet<u32>>();
        let (standard, collocated) = (blocks(&regions.standard), blocks(&regions.collocated));
        assert_eq!(blocks(&regions.mixed), standard.intersection(&collocated).copied().collect());
        // A point at the edge whose family would wrap around to the next line.
        let edge = body.cloud.slots[19 + 5 * 20];
        let before = regions.clone();
        regions.switch(&body, &[edge]);
        for &slot in &body.cloud.slots {
            let [x, _] = body.cloud.position(slot as usize);
            assert!(x > 15.0 || regions.has_row(slot as usize) == before.has_row(slot as usize));
        }
    }
}
