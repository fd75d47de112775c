//! A body as cells of different sizes: the cells of a lattice, each whole or split into halves again and again.
//!
//! A point sits in the centre of its own cell (Bobaru et al. 2009 leave that open; on cells that are off the centre even
//! the patch test fails). Cells are kept along a Hilbert curve that runs through all children of a cell before it leaves
//! it: a split puts 2^D cells in the place of one, a merger one in the place of 2^D, and all others keep their order.

use crate::field::Vector;
use crate::geometry::cloud::for_each_cell;
use crate::geometry::curve::Curve;
use crate::geometry::{Cloud, Lattice};

/// A cell that is not split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell<const D: usize> {
    /// 0 on the lattice; each level is half as large.
    pub level: u8,
    /// Which cell of the lattice of its level.
    pub at: [u32; D],
    /// The first of its finest cells on the curve.
    pub(super) key: u64,
}

/// The cells of a body, along the curve.
#[derive(Debug, Clone)]
pub struct Cells<const D: usize> {
    low: Vector<D>,
    /// Of level 0, m.
    pub spacing: f64,
    /// Of level 0, along each axis of the box.
    pub counts: [usize; D],
    /// The finest level.
    pub levels: u8,
    curve: Curve<D>,
    list: Vec<Cell<D>>,
}

/// Where a cell comes from: numbers of cells before the change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    Same(u32),
    Child(u32),
    /// The first of the 2^D that it consists of.
    Merged(u32),
}

impl Origin {
    /// The cell, its parent, or the first of its parts.
    pub fn cell(self) -> usize {
        let (Origin::Same(old) | Origin::Child(old) | Origin::Merged(old)) = self;
        old as usize
    }
}

impl<const D: usize> Cells<D> {
    /// The cells of a lattice that hold a point, none of them split.
    pub fn new(lattice: &Lattice<D>, slots: &[u32], levels: u8) -> Self {
        let widest = lattice.counts.iter().copied().max().unwrap_or(1);
        let bits = widest.next_power_of_two().trailing_zeros() + u32::from(levels);
        let mut cells = Cells {
            low: lattice.low,
            spacing: lattice.spacing,
            counts: lattice.counts,
            levels,
            curve: Curve::new(bits),
            list: Vec::new(),
        };
        cells.list = slots.iter().map(|&slot| cells.cell(0, lattice.cell(slot as usize).map(|c| c as u32))).collect();
        cells.list.sort_unstable_by_key(|cell| cell.key);
        cells
    }

    fn cell(&self, level: u8, at: [u32; D]) -> Cell<D> {
        let finer = u32::from(self.levels - level);
        Cell { level, at, key: self.curve.index(at.map(u64::from), finer) }
    }

    pub fn list(&self) -> &[Cell<D>] {
        &self.list
    }

    /// Side of a cell, m.
    pub fn size(&self, level: u8) -> f64 {
        self.spacing / f64::from(1u32 << level)
    }

    /// Centre of a cell, m.
    pub fn center(&self, cell: &Cell<D>) -> Vector<D> {
        let h = self.size(cell.level);
        std::array::from_fn(|d| self.low[d] + (f64::from(cell.at[d]) + 0.5) * h)
    }

    /// The number of the cell that holds a place, m.
    pub fn holding(&self, x: &Vector<D>) -> Option<usize> {
        let h = self.size(self.levels);
        let mut at = [0; D];
        for d in 0..D {
            let c = ((x[d] - self.low[d]) / h).floor();
            if c < 0.0 || c >= (self.counts[d] << self.levels) as f64 {
                return None;
            }
            at[d] = c as u64;
        }
        let key = self.curve.index(at, 0);
        let k = self.list.partition_point(|cell| cell.key <= key).checked_sub(1)?;
        let finest = 1u64 << (D as u32 * u32::from(self.levels - self.list[k].level));
        (key < self.list[k].key + finest).then_some(k)
    }

    /// The points of the cells, in their order.
    pub fn cloud(&self) -> Cloud<D> {
        let positions = self.list.iter().map(|cell| self.center(cell)).collect();
        let volumes = self.list.iter().map(|cell| self.size(cell.level).powi(D as i32)).collect();
        Cloud { spacing: self.spacing, ..Cloud::along_curve(positions, volumes) }
    }

    /// Splits the cells for which `split` holds, and merges those 2^D cells of one parent for which `merge` holds together
    /// (asked with the number of the first). Returns where each cell comes from; nothing if nothing changed.
    pub fn change(
        &mut self,
        split: impl Fn(usize, &Cell<D>) -> bool,
        merge: impl Fn(usize, &Cell<D>) -> bool,
    ) -> Option<Vec<Origin>> {
        let parts = 1usize << D;
        let old = std::mem::take(&mut self.list);
        let mut list = Vec::with_capacity(old.len());
        let mut origins = Vec::with_capacity(old.len());
        let mut k = 0;
        while k < old.len() {
            let cell = old[k];
            let parent = cell.at.map(|c| c / 2);
            let together = |other: &Cell<D>| other.level == cell.level && other.at.map(|c| c / 2) == parent;
            if cell.level < self.levels && split(k, &cell) {
                let first = list.len();
                for_each_cell([2; D], |part| {
                    let at = std::array::from_fn(|d| 2 * cell.at[d] + part[d] as u32);
                    list.push(self.cell(cell.level + 1, at));
                });
                list[first..].sort_unstable_by_key(|cell| cell.key);
                origins.extend(std::iter::repeat_n(Origin::Child(k as u32), parts));
                k += 1;
            } else if cell.level > 0
                && k + parts <= old.len()
                && old[k..k + parts].iter().all(together)
                && merge(k, &cell)
            {
                list.push(self.cell(cell.level - 1, parent));
                origins.push(Origin::Merged(k as u32));
                k += parts;
            } else {
                list.push(cell);
                origins.push(Origin::Same(k as u32));
                k += 1;
            }
        }
        let changed = origins.iter().any(|origin| !matches!(origin, Origin::Same(_)));
        self.list = list;
        changed.then_some(origins)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Arrangement, Shape};

    fn disk() -> Cells<2> {
        let cloud = Cloud::lattice(&Shape::Ball { center: [0.3, 0.1], radius: 1.0 }, 0.1, 3);
        let Arrangement::Lattice(lattice) = &cloud.arrangement else { panic!("a lattice") };
        Cells::new(lattice, &cloud.slots, 3)
    }

    fn volume(cells: &Cells<2>) -> f64 {
        cells.list().iter().map(|cell| cells.size(cell.level).powi(2)).sum()
    }

    #[test]
    fn splits_and_mergers_keep_the_body_the_order_and_each_place_in_its_cell() {
        let mut cells = disk();
        let (start, all) = (cells.list().to_vec(), volume(&cells));
        for round in 0..3 {
            let centers: Vec<_> = cells.list().iter().map(|cell| cells.center(cell)).collect();
            let origins = cells.change(|k, _| centers[k][0] > 0.1 * f64::from(round), |_, _| false).unwrap();
            assert!(cells.list().is_sorted_by_key(|cell| cell.key));
            assert!(origins.is_sorted_by_key(|origin| origin.cell()));
            assert!((volume(&cells) - all).abs() < 1e-12 * all);
            for (k, cell) in cells.list().iter().enumerate() {
                assert_eq!(cells.holding(&cells.center(cell)), Some(k));
            }
            for (cell, origin) in cells.list().iter().zip(&origins) {
                let distance = crate::field::difference(&cells.center(cell), &centers[origin.cell()]);
                let expected =
                    if *origin == Origin::Same(origin.cell() as u32) { 0.0 } else { 0.5 * cells.size(cell.level) };
                assert!(distance.iter().all(|x| (x.abs() - expected).abs() < 1e-12));
            }
        }
        assert_eq!(cells.holding(&[5.0, 0.0]), None);
        assert_eq!(cells.holding(&[-0.65, 1.05]), None, "in the box, not in the body");
        while cells.change(|_, _| false, |_, _| true).is_some() {}
        assert_eq!(cells.list(), start);
    }
}
