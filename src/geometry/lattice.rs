//! Regular clouds: a box of cubic cells, of which a body fills all or some, and the indexing of its storage.
//!
//! Fields of a lattice are stored over the whole box, row after row along x, each row padded to whole blocks of
//! [`BLOCK`] slots, with a guard before and behind. A neighbour is then a constant distance in memory for every
//! point, so that no neighbour is stored and a vector of consecutive points can walk through all offsets together.
//! Slots without a point hold zeros and have no bond. Point `i` is the `i`-th present slot in storage order.

use crate::field::Vector;

/// Slots in a block: one 16-bit word of bond states for each offset.
pub const BLOCK: usize = 16;

/// The indexing of a box of cubic cells.
#[derive(Debug, Clone)]
pub struct Lattice<const D: usize> {
    /// Lower corner of the box, m, without cells of images. The point of cell `i` sits at `low + (i - before + 1/2) spacing`.
    pub low: Vector<D>,
    /// Δx, m.
    pub spacing: f64,
    /// Cells along each axis, those of images included.
    pub counts: [usize; D],
    /// Of these, cells of images before the first of the body, along each axis.
    pub before: [usize; D],
    /// Distance in slots to the next cell along each axis.
    pub strides: [usize; D],
    /// Slots before the first row and behind the last: at least the largest distance of a neighbour.
    pub guard: usize,
    /// Length of every field on this lattice.
    pub n_slots: usize,
}

impl<const D: usize> Lattice<D> {
    /// `reach`: the largest distance of a neighbour in cells, along an axis.
    pub fn new(low: Vector<D>, spacing: f64, counts: [usize; D], reach: usize) -> Self {
        let mut strides = [1; D];
        let mut length = counts[0].next_multiple_of(BLOCK);
        for d in 1..D {
            strides[d] = length;
            length *= counts[d];
        }
        let guard = strides.iter().map(|s| s * reach).sum::<usize>().next_multiple_of(BLOCK);
        Lattice { low, spacing, counts, before: [0; D], strides, guard, n_slots: guard + length + guard }
    }

    /// With layers of cells of images before and after its own, along each axis; `reach` as of [`Lattice::new`].
    pub fn with_layers(&self, before: [usize; D], after: [usize; D], reach: usize) -> Self {
        let counts = std::array::from_fn(|d| before[d] + self.counts[d] + after[d]);
        Lattice { before, ..Lattice::new(self.low, self.spacing, counts, reach) }
    }

    /// Blocks of [`BLOCK`] slots between the guards.
    pub fn n_blocks(&self) -> usize {
        (self.n_slots - 2 * self.guard) / BLOCK
    }

    /// The slot of a cell.
    #[inline]
    pub fn slot(&self, cell: [usize; D]) -> usize {
        self.guard + cell.iter().zip(&self.strides).map(|(c, s)| c * s).sum::<usize>()
    }

    /// The cell of a slot that lies between the guards and not in the padding of a row.
    #[inline]
    pub fn cell(&self, slot: usize) -> [usize; D] {
        let mut rest = slot - self.guard;
        let mut cell = [0; D];
        for d in (0..D).rev() {
            cell[d] = rest / self.strides[d];
            rest %= self.strides[d];
        }
        cell
    }

    /// From a slot to that of the cell `step` away, in slots.
    pub fn shift(&self, step: [i32; D]) -> isize {
        (0..D).map(|d| step[d] as isize * self.strides[d] as isize).sum()
    }

    /// x of a cell, m.
    #[inline]
    pub fn position(&self, cell: [usize; D]) -> Vector<D> {
        std::array::from_fn(|d| self.low[d] + (cell[d] as f64 - self.before[d] as f64 + 0.5) * self.spacing)
    }

    /// Volume (3D, m³), area (2D, m²) or length (1D, m) of a cell.
    pub fn cell_volume(&self) -> f64 {
        self.spacing.powi(D as i32)
    }

    /// The cell reached from `cell` by `step`, if it is in the box.
    #[inline]
    pub fn neighbour(&self, cell: [usize; D], step: [i32; D]) -> Option<[usize; D]> {
        let mut there = cell;
        for d in 0..D {
            let c = cell[d] as i64 + i64::from(step[d]);
            if c < 0 || c >= self.counts[d] as i64 {
                return None;
            }
            there[d] = c as usize;
        }
        Some(there)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_and_cells_are_inverse_and_neighbours_stay_in_storage() {
        let lattice = Lattice::<3>::new([0.0; 3], 0.5, [5, 4, 3], 2);
        for z in 0..3 {
            for y in 0..4 {
                for x in 0..5 {
                    let slot = lattice.slot([x, y, z]);
                    assert_eq!(lattice.cell(slot), [x, y, z]);
                    let far = 2 * lattice.strides.iter().sum::<usize>();
                    assert!(slot >= far && slot + far < lattice.n_slots);
                }
            }
        }
        assert_eq!(lattice.position([0, 1, 2]), [0.25, 0.75, 1.25]);
        assert_eq!(lattice.neighbour([0, 0, 0], [-1, 0, 0]), None);
    }
}
