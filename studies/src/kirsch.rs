//! `kirsch`: a plate with a round hole in tension, at rest, against Kirsch's solution for an endless plate.
//!
//! Traction on two opposite edges, nothing held: the static solver has to leave rigid motion out by itself. The strain along
//! the pull, beside the hole, from displacements of the two rows next to the axis.

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
/// Radius of the hole and spacing, m.
const RADIUS: f64 = 2.5e-3;
const SPACING: f64 = 0.25e-3;

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

fn run(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut series = Vec::new();
    let mut errors = Vec::new();
    let elastic = Elastic::of_lattice();
    let widths: &[&str] = if full { &["30 mm", "60 mm", "120 mm"] } else { &["30 mm", "60 mm"] };
    for width in widths {
        let strains = strains(width)?;
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
    Ok(outcome)
}

/// Distance from the middle (m) and ε_yy E/σ there, on the axis across the pull.
fn strains(width: &str) -> Result<Vec<(f64, f64)>> {
    let mut simulation = simulation("kirsch", CASE, &[("constants.width", width)])?;
    let model = &mut *simulation.model;
    model.start();
    model.step(&simulation.solver, &mut simulation.clock)?;
    let Some(Values::Vector(u)) = model.field("displacement").map(|field| field.values) else { return Ok(Vec::new()) };
    let row = |sign: f64| {
        let mut row: Vec<(f64, f64)> = model
            .positions()
            .iter()
            .zip(&u)
            .filter(|(x, _)| x[0] > RADIUS && (x[1] - sign * 0.5 * SPACING).abs() < 0.1 * SPACING)
            .map(|(x, u)| (x[0], u[1]))
            .collect();
        row.sort_by(|a, b| a.0.total_cmp(&b.0));
        row
    };
    let (above, below) = (row(1.0), row(-1.0));
    Ok(above.iter().zip(&below).map(|(a, b)| (a.0, (a.1 - b.1) / SPACING / STRAIN)).collect())
}
