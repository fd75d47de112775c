//! Bond-based elasticity for small displacements: each bond is a spring along its reference direction.
//!
//! Shojaei et al. 2022, eq. (16). The Poisson ratio is fixed as that of [`BondBased`](super::BondBased).

use super::spring_energy;
use crate::family::{Bond, BondLaw};
use crate::lane::Lane;

/// Small displacements: f = ω c (ξ ⊗ ξ)/|ξ|³ η, s = ξ·η/|ξ|²; eq. (16). The strain is s.
#[derive(Debug, Clone, Copy)]
pub struct BondBasedLinear;

impl<const D: usize> BondLaw<D> for BondBasedLinear {
    const LINEAR: bool = true;

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        let mut along = eta[0] * bond.xi[0];
        for d in 1..D {
            along = eta[d].mul_add(bond.xi[d], along);
        }
        along * bond.inverse_square
    }

    fn strain_at(&self, stretch: f64) -> f64 {
        stretch
    }

    fn stretch_at(&self, strain: f64) -> f64 {
        strain
    }

    #[inline(always)]
    fn force<L: Lane>(&self, bond: &Bond<D, L>, _eta: &[L; D], strain: L, mut sum: [L; D]) -> [L; D] {
        let factor = bond.spring * strain;
        for d in 0..D {
            sum[d] = factor.mul_add(bond.xi[d], sum[d]);
        }
        sum
    }

    #[inline(always)]
    fn energy<L: Lane>(&self, bond: &Bond<D, L>, strain: L) -> L {
        spring_energy(bond, strain)
    }

    /// weight/|ξ| e eᵀ, e = ξ/|ξ|.
    fn stiffness(&self, bond: &Bond<D, f64>, _eta: &[f64; D]) -> [[f64; D]; D] {
        let spring = bond.spring * bond.inverse_square;
        std::array::from_fn(|c| std::array::from_fn(|d| spring * bond.xi[c] * bond.xi[d]))
    }
}
