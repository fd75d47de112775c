//! `surface-effect`: bars in tension, at rest, in one, two and three dimensions: how much longer they get than F L/(E A)
//! because points near surfaces lack bonds, and what the corrections leave of that.
//!
//! E is that of the lattice. The load is spread over layers of one horizon at both ends, and nothing is held. Errors are
//! compared with δ S/V: as if at each face of the bar a layer of so much of a horizon had no stiffness, or twice of it.

use super::{Measure, Outcome, Row, Study, simulation};
use bondwise::discretization::{BondWeighting, Influence, PartialVolume};
use bondwise::error::Result;
use bondwise::field::Values;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::output::source::scalar;
use bondwise::physics::elasticity::discrete::discrete_moduli;
use bondwise::physics::elasticity::moduli::Hypothesis;
use bondwise::physics::elasticity::surface::SurfaceEffect;

pub const STUDY: Study = Study {
    name: "surface-effect",
    about: "bars in tension are too long for their incomplete families; what surface corrections leave of that",
    heavy: false,
    run,
};

/// Corrections; what they leave of the stiffness of a layer of one horizon along each face, at most; the same of the energy
/// of a stretch along it, in the points next to it.
const CORRECTIONS: [(&str, f64, f64); 3] = [("none", 0.14, 0.3), ("volume", 0.14, 0.12), ("energy", 0.05, 0.04)];
/// Of the elongation, in horizons at each end: the load is spread over one, and a nonlocal bar takes it differently.
const END: f64 = 0.15;
/// Length, width and largest spacing of a bar, m; the largest horizon is three spacings.
const LENGTH: f64 = 36e-3;
const WIDTH: f64 = 12e-3;
const SPACING: f64 = 1e-3;
/// σ/E
const STRAIN: f64 = 1e-4;

/// A bar of so many dimensions.
struct Bar {
    dimension: usize,
    shape: &'static str,
    hypothesis: Hypothesis,
    /// Halvings of the spacing: in the quick form, in full.
    halvings: [u32; 2],
}

const BARS: [Bar; 3] = [
    Bar {
        dimension: 1,
        shape: "segment = { low = \"-18 mm\", high = \"18 mm\" }",
        hypothesis: Hypothesis::Bar,
        halvings: [2, 2],
    },
    Bar {
        dimension: 2,
        shape: "rectangle = { size = [\"36 mm\", \"12 mm\"] }",
        hypothesis: Hypothesis::PlaneStress,
        halvings: [2, 3],
    },
    Bar {
        dimension: 3,
        shape: "block = { size = [\"36 mm\", \"12 mm\", \"12 mm\"] }",
        hypothesis: Hypothesis::Solid,
        halvings: [1, 1],
    },
];

/// What a bar does, over what the local theory says.
struct Pulled {
    elongation: f64,
    /// In the half of the length that is in the middle.
    strain: f64,
    effect: SurfaceEffect,
}

/// What a body has under given displacements.
struct Patch {
    /// Strain energy density in the middle of the body, J/m³, and next to a lateral face over that.
    middle: f64,
    face: f64,
    /// |Σ f V| over Σ |f| V of a rough displacement.
    momentum: f64,
}

impl Bar {
    fn case(&self, spacing: f64, ratio: f64, correction: &str, rest: &str) -> String {
        let (dimension, shape) = (self.dimension, self.shape);
        format!(
            r#"
[case]
title = "Bar"
dimension = {dimension}
[constants]
h = {spacing:e}
delta = "{ratio}*h"
[geometry]
shape = {{ {shape} }}
spacing = "h"
[sets]
left = {{ where = "x < delta - 0.018" }}
right = {{ where = "x > 0.018 - delta" }}
[discretization]
horizon_ratio = {ratio}
surface_correction = "{correction}"
{rest}"#
        )
    }

    /// Young's modulus that the lattice has along its axes, over that of the law.
    fn young(&self, ratio: f64) -> f64 {
        let found = discrete_moduli(self.hypothesis, &Influence::Constant, PartialVolume::Ramp, ratio);
        let law = self.hypothesis.stiffness(1.0);
        let (a, b) = (found.c11 * law.c11, found.c12.unwrap_or(0.0) * law.c12);
        a - (self.dimension as f64 - 1.0) * b * b / (a + (self.dimension as f64 - 2.0).max(0.0) * b)
    }

    /// S/V of the lateral faces, 1/m.
    fn faces(&self) -> f64 {
        2.0 * (self.dimension as f64 - 1.0) / WIDTH
    }

    /// What the box lacks of its energy: of the bonds ξ the share Π (1 − |ξ_d|/L_d) stays inside.
    fn lacking<const D: usize>() -> f64 {
        let (influence, rule) = (Influence::Constant, PartialVolume::Ramp);
        let scaling = BondWeighting { strength: 1.0, horizon: 3.0 * SPACING, influence, rule };
        let (mut inside, mut all) = (0.0, 0.0);
        scaling.complete::<D>(SPACING, 3.0 * SPACING, |bond, _| {
            let stays = |(d, xi): (usize, &f64)| 1.0 - xi.abs() / if d == 0 { LENGTH } else { WIDTH };
            let energy = bond.spring * bond.length * bond.length;
            inside += energy * bond.xi.iter().enumerate().map(stays).product::<f64>();
            all += energy;
        });
        1.0 - inside / all
    }

    fn pull(&self, spacing: f64, ratio: f64, correction: &str) -> Result<Pulled> {
        let rest = r#"
[physics.elasticity]
law = { bond_based_linear = { young = "100 GPa", density = 1000.0 } }
[[conditions]]
on = "left"
load = { traction = { component = 0, value = -1e7, thickness = "delta" } }
[[conditions]]
on = "right"
load = { traction = { component = 0, value = 1e7, thickness = "delta" } }
[solver.static]
tolerance = 1e-8
"#;
        let mut simulation = simulation("bar", &self.case(spacing, ratio, correction, rest), &[])?;
        let model = &mut *simulation.model;
        model.start();
        model.step(&simulation.solver, &mut simulation.clock)?;
        let positions = model.positions().to_vec();
        let Some(Values::Vector(u)) = model.field("displacement").map(|field| field.values) else {
            unreachable!("every model has this field")
        };
        // Mean displacement of the column of points that is `depth` away from the end, at both ends.
        let apart = |depth: f64| {
            let at = |side: f64| {
                let place = side * (0.5 * LENGTH - depth);
                let column = positions.iter().zip(&u).filter(|(x, _)| (x[0] - place).abs() < 0.1 * spacing);
                let (sum, count) = column.fold((0.0, 0.0), |(sum, count), (_, u)| (sum + u[0], count + 1.0));
                sum / count
            };
            at(1.0) - at(-1.0)
        };
        let (delta, local) = (ratio * spacing, STRAIN / self.young(ratio));
        // In the layers the axial force falls linearly to zero at the end; the last points are half a cell from it.
        let whole = local * (LENGTH - delta - spacing * spacing / (4.0 * delta));
        let quarter = 0.25 * LENGTH + 0.5 * spacing;
        Ok(Pulled {
            elongation: apart(0.5 * spacing) / whole,
            strain: apart(quarter) / (local * (LENGTH - 2.0 * quarter)),
            effect: model.facts().physics.elastic().map_or(SurfaceEffect::default(), |e| e.surface),
        })
    }

    /// Elongation and strain; what is `left` of each face, in horizons.
    fn judge(&self, label: &str, delta: f64, correction: &str, left: f64, pulled: &Pulled, rows: &mut Vec<Row>) {
        // Forces out of balance, 1e-8 of the loads, over the softest mode.
        let tolerance = left * delta * self.faces() + 1e-5;
        let measure = if correction == "none" { Measure::Information } else { Measure::Relative };
        let ends = 2.0 * END * delta / LENGTH;
        let origin =
            "F L/(E A), E of the lattice; what is left: so much of a horizon's layer at each face, and at the ends";
        rows.push(Row::new(format!("{label}: elongation"), 1.0, pulled.elongation, tolerance + ends, measure, origin));
        // A bar without lateral faces is strained evenly, corrected or not.
        let measure = if self.dimension == 1 { Measure::Relative } else { measure };
        let origin =
            "σ/E in the middle half, E of the lattice; what is left: so much of a horizon's layer at each face";
        rows.push(Row::new(format!("{label}: strain"), 1.0, pulled.strain, tolerance, measure, origin));
    }

    /// What the body lacks of its energy, where that is known.
    fn judge_effect(&self, name: &str, correction: &str, effect: &SurfaceEffect, rows: &mut Vec<Row>) {
        let lacking = match (correction, self.dimension) {
            ("none", 1) => Self::lacking::<1>(),
            ("none", 2) => Self::lacking::<2>(),
            ("none", _) => Self::lacking::<3>(),
            ("energy", 1) => 0.0,
            _ => return,
        };
        let origin =
            "none: of the bonds ξ the share Π (1 − |ξ_d|/L_d) stays in a box; `energy` makes a bar whole; rounding";
        let what = format!("{name}, {correction}: what the body lacks of its energy");
        rows.push(Row::new(what, lacking, effect.mean_deficit, 1e-12, Measure::Absolute, origin));
    }

    fn patch(&self, correction: &str) -> Result<Patch> {
        // The horizon is an eighth of the width: in the middle neighbours have complete families too.
        let spacing = 0.5 * SPACING;
        let built = |terms: [&str; 3]| {
            let mut rest = "[physics.elasticity]\nlaw = { bond_based = { young = \"100 GPa\", density = 1000.0 } }\n\
                            [solver.velocity_verlet]\nend_time = \"1 us\"\n"
                .to_string();
            for (component, value) in terms.iter().enumerate().take(self.dimension) {
                rest += &format!(
                    "[[conditions]]\non = \"all\"\ninitial = {{ displacement = {{ component = {component}, value = \
                     \"{value}\" }} }}\n"
                );
            }
            simulation("bar", &self.case(spacing, 3.0, correction, &rest), &[])
        };
        let mut stretched = built(["1e-6*x", "0", "0"])?;
        let energies = stretched.model.field("strain_energy").map_or(Vec::new(), |field| scalar(field, None));
        let energy_at = |place: [f64; 3]| {
            let near = |x: &[f64; 3]| (0..self.dimension).all(|d| (x[d] - place[d]).abs() < 0.1 * spacing);
            stretched.model.positions().iter().position(near).map_or(f64::NAN, |k| energies[k])
        };
        let centre = [0.5 * spacing; 3];
        let middle = energy_at(centre);
        let face = energy_at([centre[0], 0.5 * (WIDTH - spacing), centre[2]]) / middle;
        let rough = ["1e-6*sin(9e5*x + 7e5*y*y + 3*z)", "1e-6*cos(8e5*y + 5e7*x*x)", "1e-6*sin(7e5*z + 6e7*x*y)"];
        let mut shaken = built(rough)?;
        shaken.model.start();
        let Some(Values::Vector(force)) = shaken.model.field("force").map(|field| field.values) else {
            unreachable!("every model has this field")
        };
        let largest =
            |of: fn(f64) -> f64| (0..3).map(|d| force.iter().map(|f| of(f[d])).sum::<f64>().abs()).fold(0.0, f64::max);
        Ok(Patch { middle, face, momentum: largest(|f| f) / largest(f64::abs) })
    }
}

fn run(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut series = Vec::new();
    for bar in &BARS {
        let name = format!("{}D", bar.dimension);
        let mut uncorrected = Vec::new();
        let mut middle = f64::NAN;
        for (correction, left, left_of_energy) in CORRECTIONS {
            let mut errors: Vec<(f64, f64)> = Vec::new();
            for k in 0..=bar.halvings[usize::from(full)] {
                let spacing = SPACING / f64::from(1u32 << k);
                let pulled = bar.pull(spacing, 3.0, correction)?;
                let delta = 3.0 * spacing;
                let label = format!("{name}, {correction}, spacing {:.3} mm", 1e3 * spacing);
                bar.judge(&label, delta, correction, left, &pulled, &mut outcome.rows);
                errors.push((delta, pulled.strain - 1.0));
                if k == 0 {
                    bar.judge_effect(&name, correction, &pulled.effect, &mut outcome.rows);
                }
            }
            if bar.dimension == 2 {
                let pulled = bar.pull(0.5 * SPACING, 6.0, correction)?;
                let label = format!("{name}, {correction}, spacing 0.500 mm and six of them to the horizon");
                bar.judge(&label, 3.0 * SPACING, correction, left, &pulled, &mut outcome.rows);
            }
            if bar.dimension > 1 {
                for pair in errors.windows(2) {
                    let at = 1e3 * pair[1].0;
                    let what =
                        format!("{name}, {correction}: error of the strain at δ = {at:.3} mm over that at twice it");
                    let origin =
                        "what is wrong is so in layers as deep as the horizon; those of neighbouring faces meet";
                    let ratio = pair[1].1 / pair[0].1;
                    outcome.rows.push(Row::new(what, 0.5, ratio, 0.03, Measure::Absolute, origin));
                }
                if correction == "none" {
                    uncorrected.clone_from(&errors);
                } else if correction == "energy" {
                    let worst = errors.iter().zip(&uncorrected).map(|(a, b)| (a.1 / b.1).abs()).fold(0.0, f64::max);
                    let what = format!("{name}: error of the strain by `energy` over that without correction, largest");
                    let origin = "a correction by the energies of stretches along the faces takes away most of it";
                    outcome.rows.push(Row::new(what, 0.5, worst, 0.0, Measure::AtMost, origin));
                }
                let points = errors.iter().map(|(delta, error)| (delta / WIDTH, error.abs())).collect();
                series.push(Series { name: format!("{name}, {correction}"), points, style: Style::LineDots });
            }
            let patch = bar.patch(correction)?;
            if bar.dimension > 1 {
                outcome.rows.push(Row::new(
                    format!("{name}, {correction}: energy of a stretch along a face, in the points next to it"),
                    1.0,
                    patch.face,
                    left_of_energy,
                    Measure::Relative,
                    "complete families; the tolerance is what one pass of the correction leaves there",
                ));
            }
            if correction == "none" {
                middle = patch.middle;
            } else {
                outcome.rows.push(Row::new(
                    format!("{name}, {correction}: energy of a stretch in the middle of the body, over that without"),
                    1.0,
                    patch.middle / middle,
                    1e-12,
                    Measure::Absolute,
                    "families there and of all neighbours are complete; rounding of ξ, a difference of positions",
                ));
            }
            outcome.rows.push(Row::new(
                format!("{name}, {correction}: |Σ f| over Σ |f| for a rough displacement"),
                0.0,
                patch.momentum,
                1e-13,
                Measure::Absolute,
                "action is reaction; rounding of some thousand forces",
            ));
        }
    }
    let plot = Plot {
        title: "Bars in tension: error of the strain".into(),
        x_label: "horizon over width [-]".into(),
        y_label: "|strain E/σ − 1| [-]".into(),
        log_x: true,
        log_y: true,
        series,
        ..Plot::default()
    };
    outcome.plots.push(("strain".into(), draw_plot(&plot, 1000, 650)));
    Ok(outcome)
}
