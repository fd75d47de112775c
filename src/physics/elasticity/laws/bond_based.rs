//! Bond-based elasticity: each bond is a spring of its own.
//!
//! The prototype microelastic brittle material of Silling & Askari (2005) with an influence function (Shojaei et al.
//! 2022, eqs. (7)–(15)), with large displacements. The Poisson ratio is fixed by the theory: 1/3 in plane stress, 1/4 in
//! plane strain and in 3D.

use super::spring_energy;
use crate::family::{Bond, BondLaw};
use crate::field::dot;
use crate::lane::{Lane, polynomial};

/// Large displacements: f = ω c s (ξ + η)/|ξ + η|, s = (|ξ + η| − |ξ|)/|ξ|; eqs. (11), (15).
///
/// The strain is q = (|ξ + η|² − |ξ|²)/|ξ|² = (2ξ + η)·η/|ξ|², which keeps its digits however small η is. With it
/// s = √(1 + q) − 1 and f = ω c/|ξ| (1 − 1/√(1 + q)) (ξ + η): smooth functions of q, for which polynomials serve where
/// |q| ≤ 0.01, that is stretches of half a percent.
#[derive(Debug, Clone, Copy)]
pub struct BondBased;

impl<const D: usize> BondLaw<D> for BondBased {
    const SMALL: f64 = 0.01;

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        let mut square = eta[0] * (bond.xi[0] + (bond.xi[0] + eta[0]));
        for d in 1..D {
            square = eta[d].mul_add(bond.xi[d] + (bond.xi[d] + eta[d]), square);
        }
        square * bond.inverse_square
    }

    fn strain_at(&self, stretch: f64) -> f64 {
        stretch * (2.0 + stretch)
    }

    /// √(1 + q) − 1, without its cancellation.
    fn stretch_at(&self, strain: f64) -> f64 {
        strain / (1.0 + (1.0 + strain).sqrt())
    }

    #[inline(always)]
    fn force<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], strain: L, sum: [L; D]) -> [L; D] {
        let square = L::splat(1.0) + strain;
        along_deformed(bond, eta, bond.spring * strain / (square + square.sqrt()), sum)
    }

    #[inline(always)]
    fn small_force<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], strain: L, sum: [L; D]) -> [L; D] {
        let series = if L::SINGLE { polynomial(FORCE_SINGLE, strain) } else { polynomial(FORCE, strain) };
        along_deformed(bond, eta, bond.spring * strain * series, sum)
    }

    #[inline(always)]
    fn energy<L: Lane>(&self, bond: &Bond<D, L>, strain: L) -> L {
        let one = L::splat(1.0);
        spring_energy(bond, strain / (one + (one + strain).sqrt()))
    }

    #[inline(always)]
    fn small_energy<L: Lane>(&self, bond: &Bond<D, L>, strain: L) -> L {
        let series = if L::SINGLE { polynomial(STRETCH_SINGLE, strain) } else { polynomial(STRETCH, strain) };
        spring_energy(bond, strain * series)
    }

    /// Of f = weight (1 − |ξ|/|y|) y/|ξ|, y = ξ + η: weight/|ξ| [e eᵀ + (1 − |ξ|/|y|) (1 − e eᵀ)], e = y/|y|.
    fn stiffness(&self, bond: &Bond<D, f64>, eta: &[f64; D]) -> [[f64; D]; D] {
        let y: [f64; D] = std::array::from_fn(|d| bond.xi[d] + eta[d]);
        let (strain, square) = (self.strain(bond, eta), dot(&y, &y));
        let across = strain / (1.0 + strain + (1.0 + strain).sqrt());
        std::array::from_fn(|c| {
            std::array::from_fn(|d| {
                let along = y[c] * y[d] / square;
                bond.spring * (along + across * (f64::from(u8::from(c == d)) - along))
            })
        })
    }
}

/// (1 − 1/√(1 + q))/q on |q| ≤ 0.01: interpolated at the zeros of the Chebyshev polynomial T₇, relative error 6e-17.
pub(crate) const FORCE: [f64; 7] = [
    0.5,
    -0.3750000000000215,
    0.31250000000002026,
    -0.27343749828141906,
    0.24609374837689324,
    -0.2256203079623644,
    0.2095051172811721,
];
/// The same for single precision: the first terms of Taylor's series, relative error 5e-9.
pub(crate) const FORCE_SINGLE: [f64; 4] = [1.0 / 2.0, -3.0 / 8.0, 5.0 / 16.0, -35.0 / 128.0];

/// (√(1 + q) − 1)/q on |q| ≤ 0.01, as [`FORCE`]: relative error 4e-18.
pub(crate) const STRETCH: [f64; 7] = [
    0.5,
    -0.12500000000000144,
    0.0625000000000012,
    -0.03906249988543145,
    0.027343749904525812,
    -0.020510103810053047,
    0.016115190681192295,
];
/// The same for single precision: relative error 5e-10.
pub(crate) const STRETCH_SINGLE: [f64; 4] = [1.0 / 2.0, -1.0 / 8.0, 1.0 / 16.0, -5.0 / 128.0];

/// sum + factor (ξ + η)
#[inline(always)]
fn along_deformed<const D: usize, L: Lane>(bond: &Bond<D, L>, eta: &[L; D], factor: L, mut sum: [L; D]) -> [L; D] {
    for d in 0..D {
        sum[d] = factor.mul_add(bond.xi[d] + eta[d], sum[d]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::tests::response;
    use super::*;

    #[test]
    fn small_forms_are_the_exact_ones_to_rounding() {
        let bond = Bond::new([1.0], 1.0, 1.0);
        for k in -1000..=1000 {
            let q = 1e-5 * f64::from(k);
            // η along ξ that gives the strain q; the exact form in a way that does not cancel.
            let eta = [q / (1.0 + (1.0 + q).sqrt())];
            let strain = BondBased.strain(&bond, &eta);
            let ([f], e) = response(BondBased, &bond, eta, true);
            let ([exact_f], exact_e) = response(BondBased, &bond, eta, false);
            assert!((strain - q).abs() <= 2.0 * f64::EPSILON * q.abs(), "{strain} {q}");
            // Four roundings of each form, and 6e-17 of the polynomial.
            assert!((f - exact_f).abs() <= 4.0 * f64::EPSILON * exact_f.abs(), "q {q}: {f} {exact_f}");
            assert!((e - exact_e).abs() <= 4.0 * f64::EPSILON * exact_e.abs(), "q {q}: {e} {exact_e}");
            let single = (polynomial(FORCE_SINGLE, q) / polynomial(FORCE, q) - 1.0).abs();
            assert!(single < 0.1 * f64::from(f32::EPSILON), "q {q}: {single}");
            let single = (polynomial(STRETCH_SINGLE, q) / polynomial(STRETCH, q) - 1.0).abs();
            assert!(single < 0.1 * f64::from(f32::EPSILON), "q {q}: {single}");
        }
    }
}
