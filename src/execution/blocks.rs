//! The bonds one by one, as blocks of a matrix: what a tangent is assembled from.

use super::Exec;
use crate::discretization::BondWeights;
use crate::family::{Body, Bond, BondStates};
use crate::field::norm;
use crate::parallel;

/// The bonds of a point that hold: the slots of x′, ascending, and a matrix for each.
pub type BlockRow<const D: usize> = Vec<(u32, [[f64; D]; D])>;

impl Exec {
    /// `block` of every bond that holds, given the number of its bit, the bond and the relative values of its ends, by the slot of x. In double
    /// precision, one bond at a time: 8 + 8 D² bytes each.
    pub fn blocks<const D: usize>(
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        input: [&[f64]; D],
        block: impl Fn(usize, &Bond<D, f64>, &[f64; D]) -> [[f64; D]; D] + Sync,
    ) -> Vec<BlockRow<D>> {
        let row = |slot: usize| -> BlockRow<D> {
            let mut row = BlockRow::new();
            for (bit, there) in body.bonds_of(slot).filter(|(bit, _)| states.holds(*bit)) {
                let xi = body.xi(bit, slot, there);
                let bond = Bond::new(xi, norm(&xi), weights.of(body, bit, [slot, there], &xi));
                let relative = std::array::from_fn(|d| input[d][there] - input[d][slot]);
                row.push((there as u32, block(bit, &bond, &relative)));
            }
            row.sort_unstable_by_key(|(there, _)| *there);
            row
        };
        parallel::map(body.cloud.n_slots(), &row)
    }
}
