//! `kirsch`: a plate with a round hole in tension, at rest, against Kirsch's solution for an endless plate.
//!
//! Traction on two opposite edges, nothing held: the static solver has to leave rigid motion out by itself. The strain along
//! the pull, beside the hole, from displacements of the two rows next to the axis; and the stress along the pull there, around
//! the hole, which is the field `stress` of these rows.

use super::{Measure, Outcome, Row, Study, simulation};
use bondwise::discretization::{Influence, PartialVolume};
use bondwise::error::Result;
use bondwise::field::Values;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::physics::elasticity::discrete::discrete_moduli;
use bondwise::physics::elasticity::moduli::Hypothesis;

pub const STUDY: Study = Study {
    name: "kirsch",
    about: "a plate with a hole at rest against Kirsch's solution, with growing plate (a larger one with --full)",
    heavy: false,
    run,
};

const CASE: &str = r#"
[case]
title = "Plate with a hole, at rest"
dimension = 2
[constants]
h = "0.25 mm"
width = "30 mm"
[geometry]
shape = { difference = { of = { rectangle = { size = ["width", "width"] } }, minus = [{ disk = { radius = "2.5 mm" } }] } }
spacing = "h"
[sets]
top = { where = "y > width/2 - h" }
bottom = { where = "y < h - width/2" }
[discretization]
horizon_ratio = 3
[physics.elasticity]
law = { bond_based_linear = { young = "191 GPa", density = "8000 kg/m^3" } }
[[conditions]]
on = "top"
load = { traction = { component = 1, value = "1e7 * t" } }
[[conditions]]
on = "bottom"
load = { traction = { component = 1, value = "-1e7 * t" } }
[solver.static]
"#;
/// σ/E of the case.
const STRAIN: f64 = 10e6 / 191e9;
/// σ of the case, Pa.
const STRESS: f64 = 10e6;
/// Radius of the hole and spacing, m.
const RADIUS: f64 = 2.5e-3;
const SPACING: f64 = 0.25e-3;
/// Where stresses of points are compared from, m: two horizons from the hole, whose families and those of their neighbours are
/// complete.
const WHOLE: f64 = RADIUS + 6.0 * SPACING;

/// Young's modulus over that of the law, and the Poisson ratio, that the scheme has at its spacing.
#[derive(Clone, Copy)]
struct Elastic {
    young: f64,
    poisson: f64,
}

impl Elastic {
    /// Along the axes of the lattice, in plane stress: C11 = E/(1 − ν²), C12 = ν C11 with ν = 1/3 in the law.
    fn of_lattice() -> Self {
        let found = discrete_moduli(Hypothesis::PlaneStress, &Influence::Constant, PartialVolume::Ramp, 3.0);
        let (c11, c12) = (found.c11 * 9.0 / 8.0, found.c12.unwrap_or(f64::NAN) * 3.0 / 8.0);
        Elastic { young: c11 - c12 * c12 / c11, poisson: c12 / c11 }
    }

    /// ε_yy E/σ on the axis across the pull, E that of the law: (σ_yy − ν σ_xx)/σ with σ_yy = σ (2 + q² + 3 q⁴)/2 and
    /// σ_xx = 3 σ (q² − q⁴)/2, q = a/r.
    fn strain(&self, r: f64) -> f64 {
        let q = (RADIUS / r).powi(2);
        (0.5 * (2.0 + q + 3.0 * q * q) - self.poisson * 1.5 * (q - q * q)) / self.young
    }
}

/// σ_tt/σ on the axis across the pull, the largest around the hole.
fn hoop(r: f64) -> f64 {
    let q = (RADIUS / r).powi(2);
    0.5 * (2.0 + q + 3.0 * q * q)
}

fn run(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let (mut series, mut stress_series) = (Vec::new(), Vec::new());
    let mut errors = Vec::new();
    let elastic = Elastic::of_lattice();
    let widths: &[&str] = if full { &["30 mm", "60 mm", "120 mm"] } else { &["30 mm", "60 mm"] };
    for width in widths {
        let Beside { strains, stresses } = beside(width)?;
        let (mut sum, mut count) = (0.0, 0.0);
        for &(r, strain) in strains.iter().filter(|(r, _)| (2.0 * RADIUS..4.0 * RADIUS).contains(r)) {
            sum += (strain / elastic.strain(r) - 1.0).abs();
            count += 1.0;
        }
        errors.push(sum / count);
        outcome.rows.push(Row::new(
            format!("plate of {width}: mean difference of strain from 2 to 4 radii"),
            0.05,
            sum / count,
            0.0,
            Measure::AtMost,
            "Kirsch with the moduli that the lattice has at m = 3; free edges are softer by a horizon's width, a finite plate \
             by some (2a/width)²",
        ));
        series.push(Series { name: format!("plate of {width}"), points: strains, style: Style::Dots });
        let far = |(r, _): &&(f64, f64)| (WHOLE..4.0 * RADIUS).contains(r);
        let off: Vec<f64> = stresses.iter().filter(far).map(|(r, stress)| (stress / hoop(*r) - 1.0).abs()).collect();
        let what = format!(
            "plate of {width}: mean difference of the hoop stress from two horizons beyond the hole to 4 radii"
        );
        let why = "Kirsch's, which depends on no modulus. A finite plate bears more by (2a/width)²; rims lack a quarter of a \
                   horizon, which the others bear: δ over the ligament, with 3σ at the hole and σ at the edge; so the hole \
                   acts as one a little larger, some 1 % of the stress";
        let half: f64 = 0.5e-3 * width.trim_end_matches(" mm").parse().unwrap_or(f64::NAN);
        let most = (RADIUS / half).powi(2) + 3.0 * SPACING / (half - RADIUS) + 0.01;
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        outcome.rows.push(Row::new(what, most, mean, 0.0, Measure::AtMost, why));
        stress_series.push(Series { name: format!("plate of {width}"), points: stresses, style: Style::Dots });
    }
    for (pair, names) in errors.windows(2).zip(widths.windows(2)) {
        outcome.rows.push(Row::new(
            format!("difference at {} over that at {}", names[1], names[0]),
            1.0,
            pair[1] / pair[0],
            0.0,
            Measure::AtMost,
            "the larger plate is the nearer to an endless one",
        ));
    }
    let line = (100..=600).map(|k| 1e-2 * f64::from(k) * RADIUS).map(|r| (r, elastic.strain(r))).collect();
    series.push(Series { name: "Kirsch".into(), points: line, style: Style::Line });
    let plot = Plot {
        title: "Strain beside a hole, over that far away".into(),
        x_label: "distance from the middle [m]".into(),
        y_label: "ε E/σ (-)".into(),
        x_range: Some((0.0, 6.0 * RADIUS)),
        series,
        ..Plot::default()
    };
    outcome.plots.push(("strain".into(), draw_plot(&plot, 1000, 650)));
    let line = (100..=600).map(|k| 1e-2 * f64::from(k) * RADIUS).map(|r| (r, hoop(r))).collect();
    stress_series.push(Series { name: "Kirsch".into(), points: line, style: Style::Line });
    let plot = Plot {
        title: "Stress around a hole, over that far away".into(),
        y_label: "σ_tt/σ (-)".into(),
        series: stress_series,
        ..plot
    };
    outcome.plots.push(("stress".into(), draw_plot(&plot, 1000, 650)));
    Ok(outcome)
}

/// Distance from the middle (m), and ε_yy E/σ and σ_yy/σ there, on the axis across the pull.
#[derive(Default)]
struct Beside {
    strains: Vec<(f64, f64)>,
    stresses: Vec<(f64, f64)>,
}

fn beside(width: &str) -> Result<Beside> {
    let mut simulation = simulation("kirsch", CASE, &[("constants.width", width)])?;
    let model = &mut *simulation.model;
    model.start();
    model.step(&simulation.solver, &mut simulation.clock)?;
    let [u, stress] = ["displacement", "stress"].map(|name| model.field(name).map(|field| field.values));
    let (Some(Values::Vector(u)), Some(Values::Tensor(stress))) = (u, stress) else { return Ok(Beside::default()) };
    let row = |sign: f64, values: &[f64]| {
        let mut row: Vec<(f64, f64)> = model
            .positions()
            .iter()
            .zip(values)
            .filter(|(x, _)| x[0] > RADIUS && (x[1] - sign * 0.5 * SPACING).abs() < 0.1 * SPACING)
            .map(|(x, value)| (x[0], *value))
            .collect();
        row.sort_by(|a, b| a.0.total_cmp(&b.0));
        row
    };
    let u: Vec<f64> = u.iter().map(|u| u[1]).collect();
    let stress: Vec<f64> = stress.iter().map(|stress| stress[1]).collect();
    let both = |values: &[f64], of: &dyn Fn(f64, f64) -> f64| {
        row(1.0, values).into_iter().zip(row(-1.0, values)).map(|(a, b)| (a.0, of(a.1, b.1))).collect()
    };
    Ok(Beside {
        strains: both(&u, &|above, below| (above - below) / SPACING / STRAIN),
        stresses: both(&stress, &|above, below| 0.5 * (above + below) / STRESS),
    })
}
