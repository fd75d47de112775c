//! The bonds one by one, as blocks of a matrix: what a tangent is assembled from.

use rayon::prelude::*;

use super::Exec;
use crate::discretization::BondWeights;
use crate::family::{Body, Bond, BondStates, Families, GROUP};
use crate::field::{difference, norm};
use crate::geometry::Arrangement;
use crate::geometry::lattice::BLOCK;

/// The bonds of a point that hold: the slots of x′, ascending, and a matrix for each.
pub type BlockRow<const D: usize> = Vec<(u32, [[f64; D]; D])>;

impl Exec {
    /// `block` of every bond that holds, given the bond and the relative values of its ends, by the slot of x. In double
    /// precision, one bond at a time: 8 + 8 D² bytes each.
    pub fn blocks<const D: usize>(
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        input: [&[f64]; D],
        block: impl Fn(&Bond<D, f64>, &[f64; D]) -> [[f64; D]; D] + Sync,
    ) -> Vec<BlockRow<D>> {
        let words = states.words();
        let row = |slot: usize| -> BlockRow<D> {
            let mut row = Vec::new();
            let mut add = |there: usize, bond: &Bond<D, f64>| {
                let relative = std::array::from_fn(|d| input[d][there] - input[d][slot]);
                row.push((there as u32, block(bond, &relative)));
            };
            match (&body.families, weights, &body.cloud.arrangement) {
                (Families::Lattice(families), BondWeights::Lattice(weights), Arrangement::Lattice(lattice)) => {
                    let n = families.offsets.len();
                    let block = slot.checked_sub(lattice.guard).map_or(usize::MAX, |inside| inside / BLOCK);
                    if block < lattice.n_blocks() {
                        let words = &words[block * n..(block + 1) * n];
                        for ((word, offset), weight) in words.iter().zip(&families.offsets).zip(weights) {
                            if word >> (slot % BLOCK) & 1 == 1 {
                                let there = slot.wrapping_add_signed(offset.shift);
                                add(there, &Bond::new(offset.xi, offset.length, *weight));
                            }
                        }
                    }
                }
                (Families::Cloud(families), BondWeights::Cloud(weights), _) => {
                    let x = body.cloud.position(slot);
                    for bond in families.of(slot) {
                        if words[bond / GROUP] >> (bond % GROUP) & 1 == 1 {
                            let there = families.neighbours[bond] as usize;
                            let xi = difference(&body.cloud.position(there), &x);
                            let length = norm(&xi);
                            let weight = weights.weight(bond, length, body.cloud.volume(there));
                            add(there, &Bond::new(xi, length, weight));
                        }
                    }
                }
                _ => unreachable!("weights are built on the families of their body"),
            }
            row.sort_unstable_by_key(|(there, _)| *there);
            row
        };
        (0..body.cloud.n_slots()).into_par_iter().map(row).collect()
    }
}
