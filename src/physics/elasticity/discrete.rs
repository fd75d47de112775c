//! Discrete constants of the standard scheme: what a finite spacing makes of the moduli and of the
//! fracture energy.
//!
//! The sums of one-point quadrature on an infinite lattice, divided by the integrals they stand
//! for. They depend on the hypothesis, the influence function, the partial-volume rule and the
//! horizon ratio m = δ/h, and on nothing else, so `bondwise verify` can print them as tables. A
//! ratio of 1.03 means a body 3 % too stiff: waves run 1.5 % too fast, and a wave meets that
//! difference as an interface where the scheme changes.

use super::moduli::{Hypothesis, Stiffness, critical_stretch, micromodulus};
use crate::discretization::influence::Influence;
use crate::discretization::volume::PartialVolume;

/// Constants of the standard scheme as ratios to those of the continuous body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscreteModuli {
    /// C₁₁₁₁, along a lattice axis
    pub c11: f64,
    /// C₁₁₂₂; none in a bar
    pub c12: Option<f64>,
    /// Energy of all bonds across a lattice plane, all at the critical stretch, over G₀
    pub fracture_energy: f64,
}

/// Hypothesis, m, then C₁₁, C₁₂, W/G₀ with full volumes and the same with the ramp; constant
/// influence.
pub type Tabulated = (Hypothesis, f64, [f64; 3], [f64; 3]);

/// Own numbers from an independent script, to the four digits kept; 1e-4 is their last digit.
pub const TABLE: [Tabulated; 8] = [
    (Hypothesis::PlaneStress, 2.0, [1.1800, 0.6752, 0.9786], [1.1172, 1.0359, 1.1712]),
    (Hypothesis::PlaneStress, 3.0, [1.0528, 1.0051, 1.0261], [1.0327, 0.9825, 1.0342]),
    (Hypothesis::PlaneStress, 4.0, [0.9743, 0.9266, 0.9290], [1.0158, 1.0037, 1.0210]),
    (Hypothesis::PlaneStress, 5.0, [1.0271, 1.1164, 1.0696], [1.0176, 1.0121, 1.0239]),
    (Hypothesis::PlaneStress, 6.0, [0.9905, 1.0239, 0.9960], [1.0080, 0.9996, 1.0091]),
    (Hypothesis::PlaneStress, 8.0, [0.9648, 0.9858, 0.9590], [1.0009, 0.9941, 0.9988]),
    (Hypothesis::Solid, 3.0, [1.0564, 1.2175, 1.1477], [1.0703, 1.0500, 1.0712]),
    (Hypothesis::Solid, 4.0, [0.9343, 0.9566, 0.9133], [1.0274, 1.0256, 1.0300]),
];

/// Discrete moduli and fracture energy for the horizon ratio `m` = δ/h.
///
/// ```text
/// C₁₁ = ½ Σ ω c ξ₁⁴/|ξ|³ β V
/// C₁₂ = ½ Σ ω c ξ₁² ξ₂²/|ξ|³ β V
/// W   = ¼ Σ ω c s₀² |ξ| |ξ₁| β V
/// ```
///
/// with c and s₀ of the continuous body. W counts the bonds that cross the plane between two
/// columns of points: the point k − ½ spacings to the left of the plane holds those with ξ₁ ≥ k h,
/// so a bond of ξ₁ = i h > 0 is held by i points. Shojaei et al. 2022, eq. (26), with β of eq. (28)
/// for [`PartialVolume::Ramp`].
pub fn discrete_moduli(hypothesis: Hypothesis, influence: &Influence, rule: PartialVolume, m: f64) -> DiscreteModuli {
    match hypothesis.dimension() {
        1 => lattice_moduli::<1>(hypothesis, influence, rule, m),
        2 => lattice_moduli::<2>(hypothesis, influence, rule, m),
        _ => lattice_moduli::<3>(hypothesis, influence, rule, m),
    }
}

/// Number of lattice points in the ball of the horizon ratio `m`, those cut by the rim and the
/// source itself included.
pub fn neighbour_count<const D: usize>(rule: PartialVolume, m: f64) -> usize {
    lattice_points::<D>(rule, m).count()
}

fn lattice_moduli<const D: usize>(
    hypothesis: Hypothesis,
    influence: &Influence,
    rule: PartialVolume,
    m: f64,
) -> DiscreteModuli {
    // h = 1, E = 1, G₀ = 1: ratios have no units.
    let c = micromodulus(hypothesis, influence, 1.0, m);
    let s0 = critical_stretch(hypothesis, influence, c, 1.0, m);
    let Stiffness { c11, c12 } = hypothesis.stiffness(1.0);
    let (mut sum11, mut sum12, mut sum_plane) = (0.0, 0.0, 0.0);
    for (xi, beta) in lattice_points::<D>(rule, m) {
        let r = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
        if r == 0.0 {
            continue;
        }
        let weight = influence.quadrature_value(r / m) * c * beta;
        sum11 += 0.5 * weight * xi[0].powi(4) / r.powi(3);
        if D > 1 {
            sum12 += 0.5 * weight * (xi[0] * xi[1]).powi(2) / r.powi(3);
        }
        sum_plane += 0.25 * weight * s0 * s0 * r * xi[0].abs();
    }
    DiscreteModuli { c11: sum11 / c11, c12: (D > 1).then(|| sum12 / c12), fracture_energy: sum_plane }
}

/// Points of the unit lattice with β > 0 about a source at the origin, as (ξ, β).
pub fn lattice_points<const D: usize>(rule: PartialVolume, m: f64) -> impl Iterator<Item = ([f64; D], f64)> {
    let range = rule.reach::<D>(1.0, m).ceil() as i64;
    let side = 2 * range + 1;
    (0..side.pow(D as u32)).filter_map(move |index| {
        let xi = std::array::from_fn(|axis| (index / side.pow(axis as u32) % side - range) as f64);
        let beta = rule.fraction(&xi, 1.0, m);
        (beta > 0.0).then_some((xi, beta))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discrete_moduli_and_fracture_energies_are_the_tabulated_ones() {
        for (hypothesis, m, full, ramp) in TABLE {
            for (rule, expected) in [(PartialVolume::None, full), (PartialVolume::Ramp, ramp)] {
                let found = discrete_moduli(hypothesis, &Influence::Constant, rule, m);
                let found = [found.c11, found.c12.unwrap(), found.fracture_energy];
                for (found, expected) in found.iter().zip(expected) {
                    let label = format!("{} m={m} {}", hypothesis.name(), rule.name());
                    assert!((found - expected).abs() < 1e-4, "{label}: {found} against {expected}");
                }
            }
        }
    }

    #[test]
    fn plane_strain_has_the_ratios_of_plane_stress() {
        // Both are the same sum with a different c, and c cancels.
        for rule in PartialVolume::ALL {
            let stress = discrete_moduli(Hypothesis::PlaneStress, &Influence::Linear, rule, 3.0);
            let strain = discrete_moduli(Hypothesis::PlaneStrain, &Influence::Linear, rule, 3.0);
            assert!((stress.c11 - strain.c11).abs() < 1e-13);
            assert!((stress.c12.unwrap() - strain.c12.unwrap()).abs() < 1e-13);
            assert!((stress.fracture_energy - strain.fracture_energy).abs() < 1e-13);
        }
    }

    #[test]
    fn a_bar_has_the_closed_forms_of_the_trapezoid_rule() {
        for m in [1.0, 2.0, 3.0, 4.0, 12.0, 33.0] {
            let closed = [
                (Influence::Constant, PartialVolume::Ramp, 1.0),
                (Influence::Linear, PartialVolume::Ramp, 1.0 - 1.0 / (m * m)),
                (Influence::Inverted, PartialVolume::Ramp, 1.0 + 0.5 / (m * m)),
                (Influence::Constant, PartialVolume::None, 1.0 + 1.0 / m),
            ];
            for (influence, rule, expected) in closed {
                let found = discrete_moduli(Hypothesis::Bar, &influence, rule, m);
                assert!((found.c11 - expected).abs() < 1e-13, "{} m={m}: {}", influence.name(), found.c11);
                assert_eq!(found.c12, None);
            }
        }
    }

    #[test]
    fn the_sum_over_columns_counts_the_bonds_across_a_plane() {
        // The definition, column by column: points at (k − ½) h to the left of the plane, bonds
        // that end to its right.
        let (hypothesis, influence, rule, m) =
            (Hypothesis::PlaneStress, Influence::Parabolic, PartialVolume::Ramp, 4.0);
        let c = micromodulus(hypothesis, &influence, 1.0, m);
        let s0 = critical_stretch(hypothesis, &influence, c, 1.0, m);
        let mut energy = 0.0;
        for k in 1..10 {
            let x = 0.5 - f64::from(k);
            for (xi, beta) in lattice_points::<2>(rule, m).filter(|(xi, _)| x + xi[0] > 0.0) {
                let r = xi[0].hypot(xi[1]);
                energy += 0.5 * influence.quadrature_value(r / m) * c * s0 * s0 * r * beta;
            }
        }
        let found = discrete_moduli(hypothesis, &influence, rule, m).fracture_energy;
        assert!((found - energy).abs() < 1e-13, "{found} against {energy}");
    }

    #[test]
    fn ratios_tend_to_one_with_exact_volumes() {
        for hypothesis in Hypothesis::ALL {
            for influence in Influence::ALL {
                let m = if hypothesis == Hypothesis::Solid { 12.0 } else { 40.0 };
                let found = discrete_moduli(hypothesis, &influence, PartialVolume::Exact, m);
                for ratio in [Some(found.c11), found.c12, Some(found.fracture_energy)].into_iter().flatten() {
                    let label = format!("{} {}", hypothesis.name(), influence.name());
                    assert!((ratio - 1.0).abs() < 0.02, "{label}: {ratio}");
                }
            }
        }
    }

    #[test]
    fn families_have_the_known_sizes() {
        let ramp = [3.0, 4.0, 5.0, 6.0].map(|m| neighbour_count::<2>(PartialVolume::Ramp, m));
        assert_eq!(ramp, [37, 69, 97, 137]);
        let ramp = [3.0, 4.0].map(|m| neighbour_count::<3>(PartialVolume::Ramp, m));
        assert_eq!(ramp, [179, 389]);
        let full = [2.0, 3.0, 4.0, 5.0, 6.0].map(|m| neighbour_count::<2>(PartialVolume::None, m));
        assert_eq!(full, [13, 29, 49, 81, 113]);
        let full = [1.0, 2.0, 3.0, 4.0, 5.0].map(|m| neighbour_count::<3>(PartialVolume::None, m));
        assert_eq!(full, [7, 33, 123, 257, 515]);
        assert_eq!(neighbour_count::<1>(PartialVolume::None, 3.0), 7);
        assert_eq!(neighbour_count::<1>(PartialVolume::Ramp, 3.0), 7);
    }
}
