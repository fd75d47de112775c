//! Cells that are split and merged, so that points are near each other only where that is needed.

pub mod cells;
pub mod zones;

pub use cells::{Cell, Cells, Origin};
pub use zones::{Transition, Zones, horizons};

/// How points follow from those that they replace.
pub struct Remap {
    /// Of each new point, by slot.
    pub origins: Vec<Origin>,
    /// m
    pub positions: Vec<[f64; 3]>,
    pub volumes: Vec<f64>,
    /// How many slots there were before.
    pub n_before: usize,
}

impl Remap {
    /// The new members of a set: each point belongs to what its parent or its parts belong to.
    pub fn members(&self, slots: &[u32]) -> Vec<u32> {
        let mut member = vec![false; self.n_before];
        slots.iter().for_each(|&slot| member[slot as usize] = true);
        (0..self.origins.len() as u32).filter(|&k| member[self.origins[k as usize].cell()]).collect()
    }
}
