//! What a state-based solid is made of: its moduli, the strength of its bonds, the energy that cracks take.

use crate::discretization::Influence;
use crate::discretization::quadrature::integrate;
use crate::physics::elasticity::moduli::{Hypothesis, Stiffness, rayleigh_speed_between};

/// The two moduli of a state-based solid, in Pa.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moduli {
    hypothesis: Hypothesis,
    /// D² k − A G: 9K − 15G, 4K₂ − 8G, 0.
    pub volumetric: f64,
    /// A G: 15 G, 8 G, E.
    pub deviatoric: f64,
}

impl Moduli {
    /// From Young's modulus (Pa) and Poisson's ratio, which a bar has no use for.
    pub fn new(hypothesis: Hypothesis, young: f64, poisson: f64) -> Self {
        let Stiffness { c11, c12 } = hypothesis.stiffness_with(young, poisson);
        let d = hypothesis.dimension() as f64;
        let shear = 0.5 * (c11 - c12);
        let deviatoric = if hypothesis == Hypothesis::Bar { young } else { d * (d + 2.0) * shear };
        // D k = C₁₁ + (D − 1) C₁₂
        Moduli { hypothesis, volumetric: d * (c11 + (d - 1.0) * c12) - deviatoric, deviatoric }
    }

    /// The constant c that the bonds are weighted with, 2 A G/∫ ω̃ |ξ| dV: q of a complete family is then ½, and the law
    /// that of bonds with the micromodulus c where nothing is volumetric. N/m⁶ in 3D; `horizon` in m.
    pub fn strength(&self, influence: &Influence, horizon: f64) -> f64 {
        2.0 * self.deviatoric / self.hypothesis.stretch_moment(influence, horizon)
    }

    /// Energy that a crack takes when each of its bonds breaks at `critical_stretch`, J/m²: that of a body in which all
    /// bonds across a plane have this stretch and all others none,
    ///
    /// ```text
    /// G₀ = s₀² [(c/4) ∫ ω̃ |ξ| |ξ₁| dV + (D² k − A G) ∫₀^δ φ² dz],   φ(z) = ∫ over ξ₁ > z of ω̃ |ξ| dV/∫ ω̃ |ξ| dV
    /// ```
    ///
    /// with φ the part of S that a point at the distance z from the plane has from beyond it, on both sides of the plane.
    /// Exact where nothing is volumetric; else bonds that break one after another take somewhat more or less, as the
    /// others let θ go.
    pub fn fracture_energy(&self, influence: &Influence, critical_stretch: f64, horizon: f64) -> f64 {
        let crossing = self.hypothesis.crossing_moment(influence, horizon);
        let bonds = 0.25 * self.strength(influence, horizon) * crossing;
        critical_stretch.powi(2) * (bonds + self.volumetric * horizon * self.squared_share(influence))
    }

    /// The critical stretch of a fracture energy (J/m²): inverse of [`Moduli::fracture_energy`].
    pub fn critical_stretch(&self, influence: &Influence, fracture_energy: f64, horizon: f64) -> f64 {
        (fracture_energy / self.fracture_energy(influence, 1.0, horizon)).sqrt()
    }

    /// Speed of Rayleigh waves, m/s; none in a bar. `density` in kg/m³.
    pub fn rayleigh_speed(&self, density: f64) -> Option<f64> {
        let d = self.hypothesis.dimension() as f64;
        let shear = self.deviatoric / (d * (d + 2.0));
        // C₁₁ = k + 2 (D − 1) G/D
        let longitudinal = (self.volumetric + self.deviatoric) / (d * d) + 2.0 * (d - 1.0) / d * shear;
        let speed = |modulus: f64| (modulus / density).sqrt();
        (self.hypothesis != Hypothesis::Bar).then(|| rayleigh_speed_between(speed(longitudinal), speed(shear)))
    }

    /// W of a point with M, S and Σ c ω̃ |ξ| s² β V′.
    pub(in crate::physics::elasticity) fn energy(&self, moment: f64, sum: f64, squares: f64) -> f64 {
        0.5 * (self.volumetric * (sum / moment).powi(2) + self.deviatoric * squares / moment)
    }

    /// ∫₀¹ φ² dt, t = z/δ.
    fn squared_share(&self, influence: &Influence) -> f64 {
        let d = self.hypothesis.dimension();
        // The part of a sphere of radius 1 beyond a plane at the distance z.
        let beyond = |z: f64| match d {
            1 => 0.5,
            2 => z.min(1.0).acos() / std::f64::consts::PI,
            _ => 0.5 * (1.0 - z),
        };
        let radial = |t: f64| influence.value(t) * t.powi(d as i32);
        // With r = t + (1 − t) v² the root of the arc at r = t is smooth.
        let cap = |t: f64| {
            let at = |v: f64| {
                let r = t + (1.0 - t) * v * v;
                2.0 * (1.0 - t) * v * radial(r) * beyond(t / r)
            };
            integrate(at, 0.0, 1.0, 40)
        };
        integrate(|t| cap(t).powi(2), 0.0, 1.0, 40) / influence.radial_moment(d as f64).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::elasticity::moduli;

    const YOUNG: f64 = 72e9;
    const HORIZON: f64 = 1e-3;

    fn near(value: f64, expected: f64, tolerance: f64) {
        assert!((value - expected).abs() < tolerance * expected.abs(), "{value} against {expected}");
    }

    #[test]
    fn the_moduli_are_the_printed_ones() {
        for poisson in [-0.4, 0.0, 0.2, 0.3, 0.45] {
            let bulk = YOUNG / (3.0 * (1.0 - 2.0 * poisson));
            let shear = YOUNG / (2.0 * (1.0 + poisson));
            let solid = Moduli::new(Hypothesis::Solid, YOUNG, poisson);
            near(solid.deviatoric, 15.0 * shear, 1e-14);
            near(solid.volumetric + 15.0 * shear, 9.0 * bulk, 1e-14);
            let stress = YOUNG / (2.0 * (1.0 - poisson));
            let strain = YOUNG / (2.0 * (1.0 + poisson) * (1.0 - 2.0 * poisson));
            for (hypothesis, bulk) in [(Hypothesis::PlaneStress, stress), (Hypothesis::PlaneStrain, strain)] {
                let plane = Moduli::new(hypothesis, YOUNG, poisson);
                near(plane.deviatoric, 8.0 * shear, 1e-14);
                near(plane.volumetric + 8.0 * shear, 4.0 * bulk, 1e-14);
            }
        }
        assert_eq!(Moduli::new(Hypothesis::Bar, YOUNG, 0.0).volumetric, 0.0);
    }

    #[test]
    fn at_the_ratio_of_bonds_the_constants_are_those_of_bonds() {
        for hypothesis in Hypothesis::ALL {
            let solid = Moduli::new(hypothesis, YOUNG, hypothesis.poisson().unwrap_or(0.0));
            assert!(solid.volumetric.abs() < 1e-14 * solid.deviatoric);
            for influence in Influence::ALL {
                let c = moduli::micromodulus(hypothesis, &influence, YOUNG, HORIZON);
                near(solid.strength(&influence, HORIZON), c, 1e-14);
                let s0 = moduli::critical_stretch(hypothesis, &influence, c, 3.8, HORIZON);
                near(solid.critical_stretch(&influence, 3.8, HORIZON), s0, 1e-14);
            }
            let expected = moduli::rayleigh_speed(hypothesis, YOUNG, 2440.0);
            assert_eq!(solid.rayleigh_speed(2440.0).is_some(), expected.is_some());
            if let (Some(found), Some(expected)) = (solid.rayleigh_speed(2440.0), expected) {
                near(found, expected, 1e-12);
            }
        }
        // The constants of CabanaPD, with influence functions 1/|ξ| and 1.
        let solid = Moduli::new(Hypothesis::Solid, YOUNG, 0.25);
        let s0 = |influence| solid.critical_stretch(&influence, 3.8, HORIZON).powi(2);
        near(s0(Influence::Constant), 5.0 * 3.8 / (9.0 * 48e9 * HORIZON), 1e-14);
        near(s0(Influence::Inverted), 8.0 * 3.8 / (15.0 * 48e9 * HORIZON), 1e-14);
    }

    #[test]
    fn shares_of_families_beyond_a_plane_are_the_integrals() {
        // In 3D φ = 1/2 − 2t/3 + t⁴/6 for ω̃ = 1.
        let solid = Moduli::new(Hypothesis::Solid, YOUNG, 0.3);
        let exact = 1.0 / 4.0 + 4.0 / 27.0 + 1.0 / 324.0 - 1.0 / 3.0 + 1.0 / 30.0 - 1.0 / 27.0;
        near(solid.squared_share(&Influence::Constant), exact, 1e-13);
        // In 2D in Cartesian coordinates: x beyond the plane, y on a half chord.
        let plane = Moduli::new(Hypothesis::PlaneStress, YOUNG, 0.3);
        for influence in [Influence::Constant, Influence::Parabolic] {
            let whole = 2.0 * std::f64::consts::PI * influence.radial_moment(2.0);
            let cap = |t: f64| {
                let chord = |x: f64| {
                    let half = (1.0 - x * x).sqrt();
                    2.0 * integrate(|y| influence.value(x.hypot(y)) * x.hypot(y), 0.0, half, 40)
                };
                // With x = 1 − (1 − t) v² the half chord is smooth at the rim.
                integrate(|v| 2.0 * (1.0 - t) * v * chord(1.0 - (1.0 - t) * v * v), 0.0, 1.0, 40) / whole
            };
            near(plane.squared_share(&influence), integrate(|t| cap(t).powi(2), 0.0, 1.0, 40), 1e-6);
        }
    }
}
