//! Bond-based elasticity: each bond is a spring of its own.
//!
//! The prototype microelastic brittle material of Silling & Askari (2005) with an influence function (Shojaei et al.
//! 2022, eqs. (7)–(16)), with large displacements and linearised. The Poisson ratio is fixed by the theory: 1/3 in
//! plane stress, 1/4 in plane strain and in 3D.

use crate::family::{Bond, BondLaw};
use crate::lane::Lane;

/// Large displacements: f = ω c s (ξ + η)/|ξ + η|, s = (|ξ + η| − |ξ|)/|ξ|; eqs. (11), (15).
///
/// s is computed as (2ξ + η)·η / (|ξ| (|ξ + η| + |ξ|)), which keeps its digits however small η is.
#[derive(Debug, Clone, Copy)]
pub struct BondBased;

/// Small displacements: f = ω c (ξ ⊗ ξ)/|ξ|³ η, s = ξ·η/|ξ|²; eq. (16).
#[derive(Debug, Clone, Copy)]
pub struct BondBasedLinear;

impl<const D: usize> BondLaw<D> for BondBased {
    #[inline(always)]
    fn force<L: Lane>(&self, bond: &Bond<D, L>, eta: [L; D]) -> ([L; D], L) {
        let q = elongation(bond, eta);
        let length = bond.length;
        let r = (length * length + q).sqrt();
        let inverse = L::splat(1.0) / (length * (r + length) * r);
        let stretch = q * inverse * r;
        let g = bond.weight * q * inverse;
        let mut force = eta;
        for d in 0..D {
            force[d] = g * (bond.xi[d] + eta[d]);
        }
        (force, stretch)
    }

    #[inline(always)]
    fn energy<L: Lane>(&self, bond: &Bond<D, L>, eta: [L; D]) -> L {
        let q = elongation(bond, eta);
        let length = bond.length;
        let r = (length * length + q).sqrt();
        let stretch = q / (length * (r + length));
        L::splat(0.5) * bond.weight * stretch * stretch * length
    }

    fn tangent(&self, length: f64, weight: f64) -> f64 {
        weight / length
    }
}

impl<const D: usize> BondLaw<D> for BondBasedLinear {
    #[inline(always)]
    fn force<L: Lane>(&self, bond: &Bond<D, L>, eta: [L; D]) -> ([L; D], L) {
        let stretch = along(bond, eta) / (bond.length * bond.length);
        let g = bond.weight * stretch / bond.length;
        let mut force = bond.xi;
        for d in 0..D {
            force[d] = g * bond.xi[d];
        }
        (force, stretch)
    }

    #[inline(always)]
    fn energy<L: Lane>(&self, bond: &Bond<D, L>, eta: [L; D]) -> L {
        let stretch = along(bond, eta) / (bond.length * bond.length);
        L::splat(0.5) * bond.weight * stretch * stretch * bond.length
    }

    fn tangent(&self, length: f64, weight: f64) -> f64 {
        weight / length
    }
}

/// |ξ + η|² − |ξ|² = (2ξ + η)·η
#[inline(always)]
fn elongation<const D: usize, L: Lane>(bond: &Bond<D, L>, eta: [L; D]) -> L {
    let mut q = eta[0] * (bond.xi[0] + (bond.xi[0] + eta[0]));
    for d in 1..D {
        q = q + eta[d] * (bond.xi[d] + (bond.xi[d] + eta[d]));
    }
    q
}

/// ξ·η
#[inline(always)]
fn along<const D: usize, L: Lane>(bond: &Bond<D, L>, eta: [L; D]) -> L {
    let mut q = eta[0] * bond.xi[0];
    for d in 1..D {
        q = q + eta[d] * bond.xi[d];
    }
    q
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_is_the_derivative_of_energy_and_stretch_keeps_its_digits() {
        let bond = Bond { xi: [3.0e-3, -1.0e-3, 2.0e-3], length: 14f64.sqrt() * 1e-3, weight: 7.0 };
        let eta = [2.0e-4, 5.0e-5, -1.0e-4];
        let check = |force: [f64; 3], energy: &dyn Fn([f64; 3]) -> f64| {
            for d in 0..3 {
                let h = 1e-9;
                let (mut plus, mut minus) = (eta, eta);
                plus[d] += h;
                minus[d] -= h;
                let slope = (energy(plus) - energy(minus)) / (2.0 * h);
                // Truncation h²/|ξ|² ≈ 1e-13 and round-off 1e-16 |ξ|/h ≈ 4e-10 of the difference quotient.
                assert!((slope - force[d]).abs() < 1e-8 * force[0].abs(), "{d}: {slope} {}", force[d]);
            }
        };
        check(BondBased.force(&bond, eta).0, &|e| BondBased.energy(&bond, e));
        check(BondBasedLinear.force(&bond, eta).0, &|e| BondBasedLinear.energy(&bond, e));
        let tiny = bond.xi.map(|x| 1e-14 * x);
        let (_, stretch): ([f64; 3], f64) = BondBased.force(&bond, tiny);
        assert!((stretch / 1e-14 - 1.0).abs() < 1e-12);
    }
}
