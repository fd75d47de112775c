//! Elastic constants: from Young's modulus and fracture energy to the constants of a bond, and to
//! wave speeds.
//!
//! A bond-based law has one elastic constant a material, the micromodulus c, so that Poisson's
//! ratio is fixed by the hypothesis under which space is reduced. Everything here follows from the
//! moment formula in [`crate::discretization::moments`]: c by giving the body the strain energy of
//! the classical one, the critical stretch by letting all bonds across a plane hold the fracture
//! energy. No table of constants is kept; the tests keep it.
//!
//! Deliberately absent: the constants of a finite spacing. The sums of the standard scheme differ
//! from these integrals by a few percent (`verify/discrete.rs` prints by how much).

use crate::discretization::influence::Influence;
use crate::discretization::moments::{absolute_ball_moment, ball_moment};

/// How three-dimensional elasticity is reduced to the dimension of the model.
///
/// In 1D cross-section and in 2D thickness are 1, so energies are per unit of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hypothesis {
    /// 1D, uniaxial stress.
    Bar,
    /// 2D, a thin plate: no stress across it.
    PlaneStress,
    /// 2D, a slice of a long body: no strain along it.
    PlaneStrain,
    /// 3D.
    Solid,
}

/// Stiffness of an isotropic body in the model's dimension, in Pa: σ₁₁ = C₁₁ ε₁₁ + C₁₂ ε₂₂ + …
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness {
    /// C₁₁₁₁
    pub c11: f64,
    /// C₁₁₂₂; 0 in a bar, which has no second direction
    pub c12: f64,
}

impl Hypothesis {
    /// Every hypothesis once.
    pub const ALL: [Hypothesis; 4] =
        [Hypothesis::Bar, Hypothesis::PlaneStress, Hypothesis::PlaneStrain, Hypothesis::Solid];

    /// Name in case files and lists.
    pub fn name(&self) -> &'static str {
        match self {
            Hypothesis::Bar => "bar",
            Hypothesis::PlaneStress => "plane_stress",
            Hypothesis::PlaneStrain => "plane_strain",
            Hypothesis::Solid => "solid",
        }
    }

    /// Dimension of the model.
    pub fn dimension(&self) -> usize {
        match self {
            Hypothesis::Bar => 1,
            Hypothesis::PlaneStress | Hypothesis::PlaneStrain => 2,
            Hypothesis::Solid => 3,
        }
    }

    /// Poisson's ratio that a bond-based law can have: 1/3 in plane stress, 1/4 in plane strain and
    /// 3D, none in a bar.
    ///
    /// Pair forces make the stiffness totally symmetric, C₁₁₂₂ = C₁₂₁₂, one constant instead of
    /// two.
    pub fn poisson(&self) -> Option<f64> {
        match self {
            Hypothesis::Bar => None,
            Hypothesis::PlaneStress => Some(1.0 / 3.0),
            Hypothesis::PlaneStrain | Hypothesis::Solid => Some(0.25),
        }
    }

    /// Stiffness of the bond-based body with Young's modulus `young`, in Pa.
    pub fn stiffness(&self, young: f64) -> Stiffness {
        self.stiffness_with(young, self.poisson().unwrap_or(0.0))
    }

    /// Stiffness for any Poisson's ratio, for laws that are free to choose it. A bar ignores
    /// `poisson`.
    ///
    /// ```text
    /// plane stress        C₁₁ = E/(1 − ν²)                     C₁₂ = ν C₁₁
    /// plane strain, 3D    C₁₁ = E (1 − ν)/((1 + ν)(1 − 2ν))    C₁₂ = ν/(1 − ν) C₁₁
    /// ```
    pub fn stiffness_with(&self, young: f64, poisson: f64) -> Stiffness {
        match self {
            Hypothesis::Bar => Stiffness { c11: young, c12: 0.0 },
            Hypothesis::PlaneStress => {
                let c11 = young / (1.0 - poisson * poisson);
                Stiffness { c11, c12: poisson * c11 }
            }
            Hypothesis::PlaneStrain | Hypothesis::Solid => {
                let common = young / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
                Stiffness { c11: (1.0 - poisson) * common, c12: poisson * common }
            }
        }
    }

    /// ∫ ω |ξ| dV, in m^(D+1).
    pub(super) fn stretch_moment(&self, influence: &Influence, horizon: f64) -> f64 {
        match self.dimension() {
            1 => ball_moment(influence, [0], -1.0, horizon),
            2 => ball_moment(influence, [0, 0], -1.0, horizon),
            _ => ball_moment(influence, [0, 0, 0], -1.0, horizon),
        }
    }

    /// ∫ ω |ξ| |ξ₁| dV, in m^(D+2).
    pub(super) fn crossing_moment(&self, influence: &Influence, horizon: f64) -> f64 {
        match self.dimension() {
            1 => absolute_ball_moment(influence, [1], -1.0, horizon),
            2 => absolute_ball_moment(influence, [1, 0], -1.0, horizon),
            _ => absolute_ball_moment(influence, [1, 0, 0], -1.0, horizon),
        }
    }
}

/// Micromodulus c of the bond force f = ω c s.
///
/// Equal stretch s in all directions costs W = (c s²/4) ∫ ω |ξ| dV in the bonds and D (C₁₁ + (D−1)
/// C₁₂) s²/2 in the classical body, so
///
/// ```text
/// c = 2 D (C₁₁ + (D − 1) C₁₂) / ∫ ω |ξ| dV
/// ```
///
/// `young` in Pa, `horizon` in m; the result in N/m⁶ in 3D, per unit thickness or cross-section
/// below that.
/// Shojaei et al. 2022, eq. (17); Bobaru et al. 2009, eqs. (14), (18), (21), for the bar; Silling &
/// Askari 2005 in 3D.
///
/// ```
/// # use bondwise::discretization::influence::Influence;
/// # use bondwise::physics::elasticity::moduli::{Hypothesis, micromodulus};
/// let c = micromodulus(Hypothesis::PlaneStress, &Influence::Constant, 72e9, 1e-3);
/// assert!((c - 9.0 * 72e9 / (std::f64::consts::PI * 1e-9)).abs() < 1e-12 * c);
/// ```
pub fn micromodulus(hypothesis: Hypothesis, influence: &Influence, young: f64, horizon: f64) -> f64 {
    let d = hypothesis.dimension() as f64;
    let Stiffness { c11, c12 } = hypothesis.stiffness(young);
    2.0 * d * (c11 + (d - 1.0) * c12) / hypothesis.stretch_moment(influence, horizon)
}

/// Energy that breaking all bonds across a unit area takes, when each breaks at `critical_stretch`,
/// in J/m².
///
/// A bond ξ crosses a unit of plane |ξ₁| times per unit volume of its ends, counted from both of
/// them, and holds ω c s₀² |ξ|/2:
///
/// ```text
/// G₀ = (c s₀²/4) ∫ ω |ξ| |ξ₁| dV
/// ```
///
/// Inverse of [`critical_stretch`].
pub fn fracture_energy(
    hypothesis: Hypothesis,
    influence: &Influence,
    micromodulus: f64,
    critical_stretch: f64,
    horizon: f64,
) -> f64 {
    0.25 * micromodulus * critical_stretch.powi(2) * hypothesis.crossing_moment(influence, horizon)
}

/// Stretch s₀ at which a bond breaks so that a crack costs `fracture_energy`, without unit.
///
/// ```text
/// s₀² = 4 G₀ / (c ∫ ω |ξ| |ξ₁| dV)
/// ```
///
/// `micromodulus` from [`micromodulus`], `fracture_energy` in J/m², `horizon` in m. Shojaei et al.
/// 2022, eq. (20);
/// Silling & Askari 2005 in 3D.
pub fn critical_stretch(
    hypothesis: Hypothesis,
    influence: &Influence,
    micromodulus: f64,
    fracture_energy: f64,
    horizon: f64,
) -> f64 {
    (4.0 * fracture_energy / (micromodulus * hypothesis.crossing_moment(influence, horizon))).sqrt()
}

/// Speed of waves in a bar, √(E/ρ), in m/s. `young` in Pa, `density` in kg/m³.
pub fn bar_speed(young: f64, density: f64) -> f64 {
    (young / density).sqrt()
}

/// Speed of longitudinal waves, √(C₁₁/ρ), in m/s; in plane stress the plate speed.
pub fn longitudinal_speed(hypothesis: Hypothesis, young: f64, density: f64) -> f64 {
    (hypothesis.stiffness(young).c11 / density).sqrt()
}

/// Speed of shear waves, √(G/ρ) with G = (C₁₁ − C₁₂)/2, in m/s; none in a bar.
pub fn shear_speed(hypothesis: Hypothesis, young: f64, density: f64) -> Option<f64> {
    let Stiffness { c11, c12 } = hypothesis.stiffness(young);
    (hypothesis != Hypothesis::Bar).then(|| (0.5 * (c11 - c12) / density).sqrt())
}

/// Speed of Rayleigh waves along a free surface, in m/s, the limit speed of a crack in mode I; none
/// in a bar.
///
/// With the speeds of the hypothesis, hence the plate speed in plane stress.
pub fn rayleigh_speed(hypothesis: Hypothesis, young: f64, density: f64) -> Option<f64> {
    let longitudinal = longitudinal_speed(hypothesis, young, density);
    shear_speed(hypothesis, young, density).map(|shear| rayleigh_speed_between(longitudinal, shear))
}

/// Speed of Rayleigh waves v for given longitudinal and shear speeds: the root in (0, c_s) of
///
/// ```text
/// (2 − v²/c_s²)² = 4 √(1 − v²/c_l²) √(1 − v²/c_s²)
/// ```
pub fn rayleigh_speed_between(longitudinal: f64, shear: f64) -> f64 {
    assert!(
        longitudinal > shear,
        "Rayleigh waves need a longitudinal speed above the shear speed, \
         got {longitudinal} and {shear}"
    );
    let ratio = (shear / longitudinal).powi(2);
    // p = v²/c_s². The trivial root p = 0 is left out: the residual is negative just above it and 1
    // at p = 1.
    let residual = |p: f64| (2.0 - p).powi(2) - 4.0 * ((1.0 - p * ratio) * (1.0 - p)).sqrt();
    let (mut low, mut high) = (1e-6, 1.0);
    // Sixty halvings of the unit interval reach the spacing of f64.
    for _ in 0..60 {
        let p = 0.5 * (low + high);
        if residual(p) < 0.0 {
            low = p;
        } else {
            high = p;
        }
    }
    shear * (0.5 * (low + high)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::quadrature::integrate;
    use std::f64::consts::PI;

    const YOUNG: f64 = 72e9;
    const FRACTURE_ENERGY: f64 = 3.8;
    const HORIZON: f64 = 1e-3;

    fn assert_near(value: f64, expected: f64, tolerance: f64, label: &str) {
        let error = (value - expected).abs() / expected.abs();
        assert!(error < tolerance, "{label}: {value} against {expected}, relative {error:.1e}");
    }

    /// Printed closed forms as (influence, c δ^(D+1)/E, s₀² E δ/G₀). Bar, constant and linear rows
    /// of plane stress also in Bobaru et al. 2009, eqs. (14), (18), (21), and Shojaei et al. 2022,
    /// eqs. (17), (20).
    fn table(hypothesis: Hypothesis) -> Vec<(Influence, f64, f64)> {
        use Influence::{Constant, Cubic, Inverted, Linear, Parabolic, Quintic, Septic};
        match hypothesis {
            Hypothesis::Bar => vec![
                (Constant, 2.0, 3.0),
                (Linear, 6.0, 4.0),
                (Inverted, 3.0, 8.0 / 3.0),
                (Parabolic, 4.0, 15.0 / 4.0),
                (Cubic, 20.0 / 3.0, 9.0 / 2.0),
                (Quintic, 7.0, 24.0 / 5.0),
                (Septic, 36.0 / 5.0, 5.0),
            ],
            Hypothesis::PlaneStress => vec![
                (Constant, 9.0 / PI, 4.0 * PI / 9.0),
                (Linear, 36.0 / PI, 5.0 * PI / 9.0),
                (Inverted, 12.0 / PI, 5.0 * PI / 12.0),
                (Parabolic, 45.0 / (2.0 * PI), 8.0 * PI / 15.0),
                (Cubic, 45.0 / PI, 28.0 * PI / 45.0),
                (Quintic, 252.0 / (5.0 * PI), 2.0 * PI / 3.0),
                (Septic, 54.0 / PI, 44.0 * PI / 63.0),
            ],
            Hypothesis::PlaneStrain => vec![
                (Constant, 48.0 / (5.0 * PI), 5.0 * PI / 12.0),
                (Linear, 192.0 / (5.0 * PI), 25.0 * PI / 48.0),
                (Inverted, 64.0 / (5.0 * PI), 25.0 * PI / 64.0),
                (Parabolic, 24.0 / PI, PI / 2.0),
                (Cubic, 48.0 / PI, 7.0 * PI / 12.0),
                (Quintic, 1344.0 / (25.0 * PI), 5.0 * PI / 8.0),
                (Septic, 288.0 / (5.0 * PI), 55.0 * PI / 84.0),
            ],
            Hypothesis::Solid => vec![
                (Constant, 12.0 / PI, 5.0 / 6.0),
                (Linear, 60.0 / PI, 1.0),
                (Inverted, 15.0 / PI, 4.0 / 5.0),
                (Parabolic, 36.0 / PI, 35.0 / 36.0),
                (Cubic, 84.0 / PI, 10.0 / 9.0),
                (Quintic, 504.0 / (5.0 * PI), 25.0 / 21.0),
                (Septic, 792.0 / (7.0 * PI), 5.0 / 4.0),
            ],
        }
    }

    #[test]
    fn constants_are_the_printed_closed_forms() {
        for hypothesis in Hypothesis::ALL {
            for (influence, modulus, stretch_squared) in table(hypothesis) {
                let label = format!("{} {}", hypothesis.name(), influence.name());
                let c = micromodulus(hypothesis, &influence, YOUNG, HORIZON);
                let power = hypothesis.dimension() as i32 + 1;
                assert_near(c, modulus * YOUNG / HORIZON.powi(power), 1e-12, &label);
                let s0 = critical_stretch(hypothesis, &influence, c, FRACTURE_ENERGY, HORIZON);
                assert_near(s0 * s0, stretch_squared * FRACTURE_ENERGY / (YOUNG * HORIZON), 1e-12, &label);
            }
        }
    }

    #[test]
    fn constants_of_the_crack_branching_benchmark_are_the_published_ones() {
        // Soda-lime glass, E = 72 GPa, G₀ = 3.8 J/m², horizon 1 mm, plane stress, constant
        // influence.
        let (hypothesis, influence) = (Hypothesis::PlaneStress, Influence::Constant);
        let c = micromodulus(hypothesis, &influence, YOUNG, HORIZON);
        assert_near(c, 2.062648e20, 3e-7, "c");
        assert_near(critical_stretch(hypothesis, &influence, c, FRACTURE_ENERGY, HORIZON), 2.714621e-4, 2e-7, "s0");
    }

    /// Energy density of the bonds for the diagonal strain ε, (c/4) ∫ ω s² |ξ| dV with s = n·ε·n,
    /// in polar coordinates.
    fn bond_energy(hypothesis: Hypothesis, influence: &Influence, c: f64, strain: [f64; 3]) -> f64 {
        let stretch = |n: [f64; 3]| (0..3).map(|i| strain[i] * n[i] * n[i]).sum::<f64>();
        let angular = match hypothesis.dimension() {
            1 => 2.0 * stretch([1.0, 0.0, 0.0]).powi(2),
            2 => integrate(|a| stretch([a.cos(), a.sin(), 0.0]).powi(2), 0.0, 2.0 * PI, 40),
            _ => integrate(
                |z: f64| {
                    let rho = (1.0 - z * z).sqrt();
                    integrate(|a| stretch([rho * a.cos(), rho * a.sin(), z]).powi(2), 0.0, 2.0 * PI, 40)
                },
                -1.0,
                1.0,
                40,
            ),
        };
        let radial = |r: f64| influence.value(r / HORIZON) * r.powi(hypothesis.dimension() as i32);
        0.25 * c * angular * integrate(radial, 0.0, HORIZON, 40)
    }

    #[test]
    fn bonds_hold_the_classical_energy_in_every_strain() {
        for hypothesis in Hypothesis::ALL {
            for influence in Influence::ALL {
                let c = micromodulus(hypothesis, &influence, YOUNG, HORIZON);
                let Stiffness { c11, c12 } = hypothesis.stiffness(YOUNG);
                // Uniaxial, isotropic, pure shear in principal axes, and one of no symmetry; energy
                // by quadrature.
                for strain in [[1.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, -1.0, 0.0], [0.3, -0.7, 1.1]] {
                    let mut strain = strain;
                    strain[hypothesis.dimension()..].fill(0.0);
                    let [x, y, z] = strain;
                    let classical = 0.5 * c11 * (x * x + y * y + z * z) + c12 * (x * y + y * z + z * x);
                    let bonds = bond_energy(hypothesis, &influence, c, strain);
                    let label = format!("{} {} {strain:?}", hypothesis.name(), influence.name());
                    assert_near(bonds, classical, 1e-12, &label);
                }
            }
        }
    }

    /// Energy of all bonds across a unit of plane by the classical integral: points at depth z
    /// below it, bonds of length r > z, directions within arccos(z/r) of the normal. With z = r cos
    /// α.
    fn plane_energy(hypothesis: Hypothesis, influence: &Influence, c: f64, s0: f64) -> f64 {
        let over_depth = |r: f64| -> f64 {
            integrate(
                |alpha: f64| {
                    let directions = match hypothesis.dimension() {
                        1 => 1.0,
                        2 => 2.0 * alpha * r,
                        _ => integrate(|polar| 2.0 * PI * r * r * polar.sin(), 0.0, alpha, 20),
                    };
                    directions * r * alpha.sin()
                },
                0.0,
                0.5 * PI,
                30,
            )
        };
        let density = |r: f64| 0.5 * c * s0 * s0 * influence.value(r / HORIZON) * r * over_depth(r);
        integrate(density, 0.0, HORIZON, 40)
    }

    #[test]
    fn all_bonds_across_a_plane_hold_the_fracture_energy() {
        for hypothesis in Hypothesis::ALL {
            for influence in Influence::ALL {
                let label = format!("{} {}", hypothesis.name(), influence.name());
                let c = micromodulus(hypothesis, &influence, YOUNG, HORIZON);
                let s0 = critical_stretch(hypothesis, &influence, c, FRACTURE_ENERGY, HORIZON);
                assert_near(plane_energy(hypothesis, &influence, c, s0), FRACTURE_ENERGY, 1e-12, &label);
                let inverse = fracture_energy(hypothesis, &influence, c, s0, HORIZON);
                assert_near(inverse, FRACTURE_ENERGY, 1e-14, &label);
            }
        }
    }

    /// Bond operator c ∫ ω ξ ξ·(u′ − u)/|ξ|³ dV, component i, at the origin for u = xₖ xₗ e_j,
    /// against the Navier operator (λ + μ) grad div u + μ lap u.
    fn compare_with_navier<const D: usize>(hypothesis: Hypothesis) {
        // Poisson's ratios and Lamé constants typed in, not asked from the code under test.
        let (lambda, mu) = match hypothesis {
            Hypothesis::Bar => (YOUNG / 3.0, YOUNG / 3.0),
            Hypothesis::PlaneStress => (YOUNG * 3.0 / 8.0, YOUNG * 3.0 / 8.0),
            Hypothesis::PlaneStrain | Hypothesis::Solid => (YOUNG * 2.0 / 5.0, YOUNG * 2.0 / 5.0),
        };
        let delta = |a: usize, b: usize| if a == b { 1.0 } else { 0.0 };
        for influence in Influence::ALL {
            let c = micromodulus(hypothesis, &influence, YOUNG, HORIZON);
            for (i, j) in (0..D * D).map(|n| (n / D, n % D)) {
                for (k, l) in (0..D * D).map(|n| (n / D, n % D)) {
                    let mut exponents = [0; D];
                    for axis in [i, j, k, l] {
                        exponents[axis] += 1;
                    }
                    let bonds = c * ball_moment(&influence, exponents, 3.0, HORIZON);
                    // ∂ₐ∂_b of xₖ xₗ is δₐₖ δ_bₗ + δₐₗ δ_bₖ.
                    let second = |a: usize, b: usize| delta(a, k) * delta(b, l) + delta(a, l) * delta(b, k);
                    let laplacian: f64 = (0..D).map(|a| second(a, a)).sum();
                    let navier = (lambda + mu) * second(i, j) + mu * delta(i, j) * laplacian;
                    assert!(
                        (bonds - navier).abs() < 1e-12 * YOUNG,
                        "{} {} row {i}, u{j} = x{k} x{l}: {bonds} against {navier}",
                        hypothesis.name(),
                        influence.name()
                    );
                }
            }
        }
    }

    #[test]
    fn the_bond_operator_on_quadratics_is_the_navier_operator() {
        compare_with_navier::<1>(Hypothesis::Bar);
        compare_with_navier::<2>(Hypothesis::PlaneStress);
        compare_with_navier::<2>(Hypothesis::PlaneStrain);
        compare_with_navier::<3>(Hypothesis::Solid);
    }

    #[test]
    fn wave_speeds_of_glass_are_the_known_ones() {
        let density = 2440.0;
        // 3159 m/s is the quoted Rayleigh speed of this glass.
        let rayleigh = rayleigh_speed(Hypothesis::Solid, YOUNG, density).unwrap();
        assert!((rayleigh - 3159.0).abs() < 0.5, "{rayleigh}");
        for hypothesis in [Hypothesis::PlaneStress, Hypothesis::PlaneStrain, Hypothesis::Solid] {
            // C₁₁ = 3 C₁₂ and G = C₁₂ without exception, and then v² = (2 − 2/√3) c_s² in closed
            // form.
            let shear = shear_speed(hypothesis, YOUNG, density).unwrap();
            assert_near(longitudinal_speed(hypothesis, YOUNG, density), 3f64.sqrt() * shear, 1e-14, "longitudinal");
            let closed = (2.0 - 2.0 / 3f64.sqrt()).sqrt() * shear;
            assert_near(rayleigh_speed(hypothesis, YOUNG, density).unwrap(), closed, 1e-14, "Rayleigh");
        }
        assert_near(bar_speed(YOUNG, density), 5432.144, 1e-6, "bar");
        assert_eq!(longitudinal_speed(Hypothesis::Bar, YOUNG, density), bar_speed(YOUNG, density));
        assert_eq!(rayleigh_speed(Hypothesis::Bar, YOUNG, density), None);
        // An incompressible solid: v = 0.955313 c_s.
        assert_near(rayleigh_speed_between(1e9, 1.0), 0.955_312_5, 1e-6, "incompressible");
    }
}
