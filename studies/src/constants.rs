//! The constants of a bond, c and s₀, against the integrals that define them.
//!
//! The library has both from one moment formula. Here the energy of a uniformly stretched body and the energy of all
//! bonds across a plane are integrated numerically, from influence functions written down a second time.

use std::f64::consts::PI;

use super::{Measure, Outcome, Row};
use bondwise::discretization::influence::Influence;
use bondwise::discretization::quadrature::gauss_legendre;
use bondwise::error::Result;
use bondwise::physics::elasticity::moduli::{Hypothesis, critical_stretch, micromodulus};

/// E, δ and G₀ of a plate of glass: numbers far from one, so that a wrong power cannot hide.
const YOUNG: f64 = 72e9;
const HORIZON: f64 = 1e-3;
const FRACTURE_ENERGY: f64 = 3.8;

/// Round-off of quadratures with a hundred terms, with room for one that adds up badly.
const TOLERANCE: f64 = 1e-12;

const QUADRATURE: &str = "numerical integral of the bond energies, W = (c s²/4) ∫ ω |ξ| dV and \
    G₀ = ∫₀^δ dz ∫ w over the bonds that pass the plane at distance z; the tolerance is round-off";

pub fn run(_full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for (hypothesis, influence, modulus, stretch, origin) in printed() {
        let (c, s) = scaled(hypothesis, &influence);
        let label = format!("{}, {}", hypothesis.name(), influence.name());
        let origin = format!("closed form: {origin}; the tolerance is round-off");
        outcome.rows.push(row(format!("{label}: c δ^(D+1)/E"), modulus, c, &origin));
        outcome.rows.push(row(format!("{label}: s₀² E δ/G₀"), stretch, s, &origin));
    }
    for hypothesis in Hypothesis::ALL {
        for influence in Influence::ALL {
            let (c, s) = scaled(hypothesis, &influence);
            let (modulus, stretch) = integrated(hypothesis, &influence);
            let label = format!("{}, {}", hypothesis.name(), influence.name());
            outcome.rows.push(row(format!("{label}: c δ^(D+1)/E"), modulus, c, QUADRATURE));
            outcome.rows.push(row(format!("{label}: s₀² E δ/G₀"), stretch, s, QUADRATURE));
        }
    }
    outcome.notes.push(
        "cross-section (1D) and thickness (2D) are 1; the Gaussian has a third of the horizon as its width".into(),
    );
    Ok(outcome)
}

fn row(what: String, expected: f64, obtained: f64, origin: &str) -> Row {
    Row::new(what, expected, obtained, TOLERANCE, Measure::Relative, origin)
}

/// c δ^(D+1)/E and s₀² E δ/G₀ of the library.
fn scaled(hypothesis: Hypothesis, influence: &Influence) -> (f64, f64) {
    let c = micromodulus(hypothesis, influence, YOUNG, HORIZON);
    let s0 = critical_stretch(hypothesis, influence, c, FRACTURE_ENERGY, HORIZON);
    let power = hypothesis.dimension() as i32 + 1;
    (c * HORIZON.powi(power) / YOUNG, s0 * s0 * YOUNG * HORIZON / FRACTURE_ENERGY)
}

/// Published closed forms of c δ^(D+1)/E and s₀² E δ/G₀.
fn printed() -> [(Hypothesis, Influence, f64, f64, &'static str); 5] {
    use Hypothesis::{Bar, PlaneStress, Solid};
    let shojaei = "Shojaei et al. 2022, eqs. (17), (20)";
    let bobaru = "Bobaru et al. 2009, eqs. (14), (18), (21)";
    [
        (Bar, Influence::Constant, 2.0, 3.0, bobaru),
        (Bar, Influence::Linear, 6.0, 4.0, bobaru),
        (PlaneStress, Influence::Constant, 9.0 / PI, 4.0 * PI / 9.0, shojaei),
        (PlaneStress, Influence::Linear, 36.0 / PI, 5.0 * PI / 9.0, shojaei),
        (
            Solid,
            Influence::Constant,
            12.0 / PI,
            5.0 / 6.0,
            "Silling & Askari 2005, c = 18 K/(π δ⁴), s₀² = 5 G₀/(9 K δ)",
        ),
    ]
}

/// c and s₀² by quadrature, with E = δ = G₀ = 1.
fn integrated(hypothesis: Hypothesis, influence: &Influence) -> (f64, f64) {
    let dimension = hypothesis.dimension();
    // The sphere of radius r, and ∫₀^r of its part beyond a plane at distance z = r cos α.
    let sphere = |r: f64| [2.0, 2.0 * PI * r, 4.0 * PI * r * r][dimension - 1];
    let beyond = |r: f64| {
        integral(0.0, 0.5 * PI, |alpha| {
            let cap = [1.0, 2.0 * r * alpha, 2.0 * PI * r * r * (1.0 - alpha.cos())][dimension - 1];
            cap * r * alpha.sin()
        })
    };
    // Energy density of the classical body whose strain is 1 in all directions.
    let classical = match hypothesis {
        Hypothesis::Bar => 0.5,
        Hypothesis::PlaneStress => 1.0 / (1.0 - 1.0 / 3.0),
        Hypothesis::PlaneStrain => 1.0 / ((1.0 + 0.25) * (1.0 - 2.0 * 0.25)),
        Hypothesis::Solid => 4.5 / (3.0 * (1.0 - 2.0 * 0.25)),
    };
    // W = ½ ∫ w dV and G₀ = ∫ w over pairs, w = ½ ω c s² |ξ|.
    let stretched = 0.5 * integral(0.0, 1.0, |r| 0.5 * omega(influence, r) * r * sphere(r));
    let crossing = integral(0.0, 1.0, |r| 0.5 * omega(influence, r) * r * beyond(r));
    let c = classical / stretched;
    (c, 1.0 / (c * crossing))
}

/// ω(t) as printed.
fn omega(influence: &Influence, t: f64) -> f64 {
    match influence {
        Influence::Constant => 1.0,
        Influence::Linear => 1.0 - t,
        Influence::Inverted => t,
        Influence::Parabolic => 1.0 - t * t,
        Influence::Gaussian { width } => (-t * t / (width * width)).exp(),
        Influence::Cubic => 1.0 - 3.0 * t.powi(2) + 2.0 * t.powi(3),
        Influence::Quintic => 1.0 - 10.0 * t.powi(3) + 15.0 * t.powi(4) - 6.0 * t.powi(5),
        Influence::Septic => 1.0 - 35.0 * t.powi(4) + 84.0 * t.powi(5) - 70.0 * t.powi(6) + 20.0 * t.powi(7),
    }
}

/// ∫ f by Gauss–Legendre with 32 points: exact for the polynomials here, and to round-off for the bell and the sines.
fn integral(low: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let width = high - low;
    gauss_legendre(32).into_iter().map(|(x, weight)| weight * width * f(low + width * x)).sum()
}
