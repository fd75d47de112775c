//! What is summed over the bonds of a law: one small type for each sum.

use crate::discretization::BondWeights;
use crate::execution::Exec;
use crate::family::{Body, Bond, BondKernel, BondLaw, BondStates};
use crate::field::Double;
use crate::lane::Lane;

/// Σ β V′ over the bonds that `states` holds, at each slot. `volumes`: β V′.
pub(super) fn bonded_volume<const D: usize>(
    exec: &mut Exec,
    body: &Body<D>,
    volumes: &BondWeights,
    states: &BondStates,
    sums: &mut [f64],
) {
    exec.sum_bonds::<D, 0, 1, Double>(body, volumes, states, [], [sums], &Weight);
}

/// Σ f
pub(super) struct Force<L>(pub L);

impl<const D: usize, B: BondLaw<D>> BondKernel<D, D, D> for Force<B> {
    const SMALL: f64 = B::SMALL;
    const EVERY_STEP: bool = true;
    const VARIED: bool = true;
    const LINEAR: bool = B::LINEAR;
    const MEMORY: bool = B::MEMORY;

    #[inline(always)]
    fn remember<L: Lane>(&self, bond: &Bond<D, L>, strain: L) -> L {
        self.0.remember(bond, strain)
    }

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        self.0.strain(bond, eta)
    }
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], _: &[L; 0], strain: L, sum: [L; D]) -> [L; D] {
        self.0.force(bond, eta, strain, sum)
    }
    #[inline(always)]
    fn add_small<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], _: &[L; 0], strain: L, sum: [L; D]) -> [L; D] {
        self.0.small_force(bond, eta, strain, sum)
    }
}

/// ½ Σ w
pub(super) struct Energy<L>(pub L);

impl<const D: usize, B: BondLaw<D>> BondKernel<D, D, 1> for Energy<B> {
    const SMALL: f64 = B::SMALL;
    const MEMORY: bool = B::MEMORY;

    #[inline(always)]
    fn remember<L: Lane>(&self, bond: &Bond<D, L>, strain: L) -> L {
        self.0.remember(bond, strain)
    }

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        self.0.strain(bond, eta)
    }
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; D], _: &[L; 0], strain: L, [sum]: [L; 1]) -> [L; 1] {
        [L::splat(0.5).mul_add(self.0.energy(bond, strain), sum)]
    }
    #[inline(always)]
    fn add_small<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; D], _: &[L; 0], strain: L, [sum]: [L; 1]) -> [L; 1] {
        [L::splat(0.5).mul_add(self.0.small_energy(bond, strain), sum)]
    }
}

/// The spring constant of a bond at rest, weighted.
#[inline(always)]
pub(super) fn spring<const D: usize, L: Lane>(bond: &Bond<D, L>) -> L {
    bond.weight / bond.length
}

/// Σ k
pub(super) struct Spring;

impl<const D: usize> BondKernel<D, 0, 1> for Spring {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: &[L; 0], _: L, [sum]: [L; 1]) -> [L; 1] {
        [sum + spring(bond)]
    }
}

/// Σ k e_d²
pub(super) struct Diagonal;

impl<const D: usize> BondKernel<D, 0, D> for Diagonal {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: &[L; 0], _: L, mut sum: [L; D]) -> [L; D] {
        let spring = spring(bond) * bond.inverse_square;
        for d in 0..D {
            sum[d] = (bond.xi[d] * bond.xi[d]).mul_add(spring, sum[d]);
        }
        sum
    }
}

/// One row of Σ k e eᵀ at rest.
pub(super) struct DiagonalRow(pub usize);

impl<const D: usize> BondKernel<D, 0, D> for DiagonalRow {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: &[L; 0], _: L, mut sum: [L; D]) -> [L; D] {
        let spring = spring(bond) * bond.inverse_square * bond.xi[self.0];
        for d in 0..D {
            sum[d] = bond.xi[d].mul_add(spring, sum[d]);
        }
        sum
    }
}

/// Σ of the weights themselves.
pub(super) struct Weight;

impl<const D: usize> BondKernel<D, 0, 1> for Weight {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: &[L; 0], _: L, [sum]: [L; 1]) -> [L; 1] {
        [sum + bond.weight]
    }
}
