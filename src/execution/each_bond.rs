//! The bonds of one point one by one, in double precision: for what is asked now and then and needs more of each bond than a
//! sum.

use super::Exec;
use crate::discretization::BondWeights;
use crate::family::{Body, Bond, BondStates};
use crate::field::norm;

impl Exec {
    /// What `of` makes of each bond of the point at `slot` that holds, in the order of the states. `of` is given the number of its
    /// bit, the slot of x′, the bond, and the values at x′ less those at x.
    pub fn each_bond<const D: usize, T>(
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        input: [&[f64]; D],
        slot: usize,
        of: impl Fn(usize, usize, Bond<D, f64>, [f64; D]) -> T,
    ) -> Vec<T> {
        let whole = body.bonds_of(slot).filter(|(bit, _)| states.holds(*bit));
        let seen = whole.map(|(bit, there)| {
            let xi = body.xi(bit, slot, there);
            let bond = Bond::new(xi, norm(&xi), weights.of(body, bit, [slot, there], &xi));
            of(bit, there, bond, std::array::from_fn(|d| input[d][there] - input[d][slot]))
        });
        seen.collect()
    }
}
