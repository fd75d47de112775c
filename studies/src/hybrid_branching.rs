//! `hybrid-branching`: the plate of `crack-branching` at m = 4 by the standard scheme and by the hybrid scheme, its regions
//! fixed and adaptive; with `--full` a plate four times as large besides, most of which stays whole, and a notched block of a
//! million points.
//!
//! Two cracks are compared by the sets of points with φ > 0.35: the distance of each of them to the nearest of the other set,
//! both ways.

use std::time::Instant;

use super::{Measure, Outcome, Row, Study, simulation};
use bondwise::error::Result;
use bondwise::field::{difference, norm};
use bondwise::output::picture::{CloudView, Image, Picture, draw};
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::output::source::{Source, scalar};
use bondwise::physics::elasticity::Work;
use bondwise::problem::Balance;

pub const STUDY: Study = Study {
    name: "hybrid-branching",
    about: "a branching crack by rows and bonds against bonds alone: pattern, arrival, work, pictures (a larger plate and a block with --full)",
    heavy: false,
    run,
};

const DAMAGED: f64 = 0.35;
/// Instants at which the tip is asked for.
const LOOKS: u64 = 60;

/// A plate of length × height, or a block of length × height × thickness (m), notched over the left half.
#[derive(Clone, Copy)]
struct Body {
    name: &'static str,
    /// For files.
    suffix: &'static str,
    size: [f64; 3],
    dimension: usize,
    spacing: f64,
    step: f64,
    steps: u64,
}

/// The data of PDMATLAB2D at m = 4, with partial volumes.
const SMALL: Body = Body {
    name: "0.1 m × 0.04 m",
    suffix: "",
    size: [0.1, 0.04, 0.0],
    dimension: 2,
    spacing: 2.5e-4,
    step: 5e-8,
    steps: 860,
};
/// The waves have twice as far to go.
const LARGE: Body = Body { name: "0.2 m × 0.08 m", suffix: "_large", size: [0.2, 0.08, 0.0], ..SMALL };
/// 160 × 96 × 72 points.
const BLOCK: Body = Body {
    name: "80 × 48 × 36 mm",
    suffix: "_block",
    size: [0.08, 0.048, 0.036],
    dimension: 3,
    spacing: 5e-4,
    step: 9e-8,
    steps: 300,
};

/// m = δ/Δx
const RATIO: f64 = 4.0;

/// What a run has left.
struct Run {
    name: &'static str,
    damaged: Vec<[f64; 3]>,
    /// By time: x of the foremost damaged point, and the fraction of points that sum their bonds.
    tip: Vec<(f64, f64)>,
    standard: Vec<(f64, f64)>,
    balance: Balance,
    broken: u64,
    work: Work,
    seconds: f64,
    pictures: [Image; 2],
    spacing: f64,
    steps: u64,
}

impl Body {
    fn horizon(&self) -> f64 {
        RATIO * self.spacing
    }

    fn run(&self, name: &'static str, scheme: &str) -> Result<Run> {
        let Body { size: [length, height, thickness], dimension, spacing, step, .. } = *self;
        let (back, side) = (-0.5 * length, 0.5 * thickness + spacing);
        let (shape, crack) = if dimension == 2 {
            let shape = format!("rectangle = {{ size = [{length}, {height}] }}");
            (shape, format!("segment = {{ from = [{back}, 0.0], to = [0.0, 0.0] }}"))
        } else {
            let shape = format!("block = {{ size = [{length}, {height}, {thickness}] }}");
            let back = back - spacing;
            let corners =
                format!("[[{back}, 0.0, {}], [0.0, 0.0, {}], [0.0, 0.0, {side}], [{back}, 0.0, {side}]]", -side, -side);
            (shape, format!("polygon = {{ vertices = {corners} }}"))
        };
        let text = format!(
            r#"
[case]
title = "Crack branching"
dimension = {dimension}
[constants]
h = {spacing}
delta = {}
top = {}
[geometry]
shape = {{ {shape} }}
spacing = "h"
cracks = [{{ {crack} }}]
[sets]
above = {{ where = "y > top - h" }}
below = {{ where = "y < h - top" }}
grips = {{ where = "abs(y) > top - delta" }}
path = {{ where = "x > -4*delta and abs(y) < 5*delta + 0.4*max(x, 0)" }}
[discretization]
horizon = "delta"
partial_volumes = "ramp"
scheme = {scheme}
[physics.elasticity]
law = {{ bond_based = {{ young = "72 GPa", density = 2440.0 }} }}
failure = {{ critical_stretch = {{ fracture_energy = 3.8, no_fail = ["grips"] }} }}
[[conditions]]
on = "above"
load = {{ traction = {{ component = 1, value = "2 MPa" }} }}
[[conditions]]
on = "below"
load = {{ traction = {{ component = 1, value = "-2 MPa" }} }}
[[conditions]]
on = "path"
initial = {{ velocity = {{ component = 0, value = 0.0 }} }}
[solver.velocity_verlet]
end_time = {}
time_step = {step}
"#,
            self.horizon(),
            0.5 * height,
            self.steps as f64 * step,
        );
        let mut simulation = simulation(name, &text, &[])?;
        let model = &mut *simulation.model;
        let (mut tip, mut standard, mut seconds) = (Vec::new(), Vec::new(), 0.0);
        model.start();
        while simulation.clock.step < simulation.n_steps {
            let begin = Instant::now();
            model.step(&simulation.solver, &mut simulation.clock)?;
            seconds += begin.elapsed().as_secs_f64();
            if simulation.clock.step.is_multiple_of(self.steps / LOOKS) {
                let t = simulation.clock.time();
                tip.push((t, damaged(model).iter().map(|x| x[0]).fold(0.0, f64::max)));
                standard.push((t, model.hybrid().map_or(1.0, |work| work.standard[0])));
            }
        }
        let t = simulation.clock.time();
        let pictures = [
            picture(model, &format!("Damage, {name}"), "damage", "damage [-]", t),
            picture(model, &format!("Where bonds are summed, {name}"), "scheme", "1: bonds, 0: rows", t),
        ];
        Ok(Run {
            name,
            damaged: damaged(model),
            tip,
            standard,
            balance: model.balance(),
            broken: model.broken_pairs(),
            work: model.hybrid().unwrap_or_default(),
            seconds,
            pictures,
            spacing,
            steps: self.steps,
        })
    }
}

/// Where points are damaged, m.
fn damaged(model: &mut dyn Source) -> Vec<[f64; 3]> {
    let damage = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
    let both = model.positions().iter().zip(&damage);
    both.filter(|(_, damage)| **damage > DAMAGED).map(|(x, _)| *x).collect()
}

/// A field, of a block the layer behind its middle; damaged points are grey where it is not the damage itself.
fn picture(model: &mut dyn Source, title: &str, field: &str, label: &str, t: f64) -> Image {
    let mut values = model.field(field).map_or(Vec::new(), |field| scalar(field, None));
    if field != "damage" {
        let damage = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
        values.iter_mut().zip(&damage).filter(|(_, d)| **d > DAMAGED).for_each(|(value, _)| *value = f64::NAN);
    }
    let points = model.points();
    let in_layer = |x: &[f64; 3]| points.facts.dimension == 2 || (0.0..points.facts.spacing).contains(&x[2]);
    let both = points.positions.iter().zip(values).filter(|(x, _)| in_layer(x));
    let (positions, values): (Vec<[f64; 3]>, Vec<f64>) = both.map(|(x, value)| (*x, value)).unzip();
    let cloud = CloudView { positions: &positions, sizes: points.sizes(), values: &values, dimension: 2 };
    let range = Some((0.0, 1.0));
    draw(
        &Picture { title: title.into(), label: label.into(), range, width: 800, ..Picture::default() },
        &cloud,
        Some(t),
    )
}

impl Run {
    /// The first x > 0 where two groups of damaged points of the middle stand over each other, more than two horizons apart and
    /// nothing between, m.
    fn split(&self) -> f64 {
        let h = self.spacing;
        let middle = self.damaged.iter().filter(|x| x[0] > 0.0 && (0.0..h).contains(&x[2]));
        let mut columns: Vec<(i64, f64)> = middle.map(|x| ((x[0] / h).floor() as i64, x[1])).collect();
        columns.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let far = (2.0 * RATIO + 0.5) * h;
        let split = columns.windows(2).find(|pair| pair[0].0 == pair[1].0 && pair[1].1 - pair[0].1 > far);
        split.map_or(f64::NAN, |pair| (pair[0].0 as f64 + 0.5) * h)
    }

    /// Mean and largest distance between the damaged points of two runs, m.
    fn apart(&self, other: &Run) -> [f64; 2] {
        let nearest =
            |a: &[f64; 3], to: &[[f64; 3]]| to.iter().map(|b| norm(&difference(a, b))).fold(f64::INFINITY, f64::min);
        let one = self.damaged.iter().map(|a| nearest(a, &other.damaged));
        let both: Vec<f64> = one.chain(other.damaged.iter().map(|a| nearest(a, &self.damaged))).collect();
        [both.iter().sum::<f64>() / both.len() as f64, both.iter().fold(0.0, |most, d| most.max(*d))]
    }

    /// The largest lag between the arrivals of two tips at the same place ahead of the notch, s.
    fn lag(&self, other: &Run) -> f64 {
        let arrival = |run: &Run, x: f64| run.tip.iter().find(|(_, tip)| *tip >= x).map(|(t, _)| *t);
        let places = (1..40).map(|k| f64::from(k) * RATIO * self.spacing);
        let lags = places.filter_map(|x| Some((arrival(self, x)? - arrival(other, x)?).abs()));
        lags.fold(0.0, f64::max)
    }

    fn tip(&self) -> f64 {
        self.tip.last().map_or(f64::NAN, |(_, x)| *x)
    }

    /// Bonds and nodes of rows that were visited.
    fn evaluations(&self) -> f64 {
        if self.work == Work::default() {
            return 1.0;
        }
        // Of the standard scheme: every bond in every evaluation, one a step and one at the start.
        let all = self.work.bonds as f64 / self.work.standard[0] * (self.steps + 1) as f64;
        (self.work.all_bonds + self.work.all_nodes) as f64 / all
    }
}

fn compare(outcome: &mut Outcome, body: &Body, standard: &Run, run: &Run) {
    let name = format!("{}, {}", body.name, run.name);
    // The narrow buffer is shown beside the other.
    let narrow = run.name.contains("buffer 1");
    let mut row = |what: &str, expected: f64, obtained: f64, tolerance: f64, measure: Measure, origin: &str| {
        let measure = if narrow { Measure::Information } else { measure };
        outcome.rows.push(Row::new(format!("{name}: {what}"), expected, obtained, tolerance, measure, origin));
    };
    let horizon = 1e3 * body.horizon();
    let two = 2.0 * horizon;
    if standard.split().is_finite() {
        row(
            "x where the crack has split, mm",
            1e3 * standard.split(),
            1e3 * run.split(),
            two,
            Measure::Absolute,
            "the standard scheme; two horizons",
        );
    }
    row(
        "x of the foremost damaged point, mm",
        1e3 * standard.tip(),
        1e3 * run.tip(),
        two,
        Measure::Absolute,
        "the standard scheme; two horizons",
    );
    let [mean, most] = run.apart(standard).map(|d| 1e3 * d);
    row(
        "damaged points of both: mean distance to the nearest of the other, mm",
        0.5 * horizon,
        mean,
        0.0,
        Measure::AtMost,
        "half a horizon: cracks are a horizon wide",
    );
    row(
        "the same: largest distance, mm",
        f64::NAN,
        most,
        0.0,
        Measure::Information,
        "single points between the branches may or may not be damaged",
    );
    row(
        "largest lag of the tip, µs",
        two / 1.4,
        1e6 * run.lag(standard),
        0.0,
        Measure::AtMost,
        "two horizons at the tip's speed, 1.4 km/s",
    );
    row(
        "broken pairs",
        standard.broken as f64,
        run.broken as f64,
        0.08,
        Measure::Relative,
        "an own run of an independent program is off by 5 %; single bonds between branches",
    );
    row(
        "evaluations of bonds and rows over those of bonds alone",
        if body.dimension == 2 { 0.4 } else { 0.6 },
        run.evaluations(),
        0.0,
        if run.name.starts_with("adaptive") { Measure::AtMost } else { Measure::Information },
        "V-S0-6, which has 0.3 with a buffer of one horizon; in the block the buffer alone is four tenths of the points",
    );
    row(
        "fraction of points that sum their bonds, at the end",
        f64::NAN,
        run.work.standard[0],
        0.0,
        Measure::Information,
        "an own run of an independent program, buffer 1: 0.17 to 0.27 on the small plate",
    );
    row(
        "|energy defect| over external work",
        0.02,
        run.balance.defect().abs() / run.balance.external,
        0.0,
        Measure::AtMost,
        "rows and bonds are no symmetric operator: of sudden loads some short waves are lost between them",
    );
    row(
        "momentum from nothing over Σ ρ |v| V",
        5e-3,
        run.balance.momentum_defect / run.balance.momentum_scale,
        0.0,
        Measure::AtMost,
        "the same",
    );
    row(
        "seconds of bonds alone over seconds",
        f64::NAN,
        standard.seconds / run.seconds,
        0.0,
        Measure::Information,
        "one run each, not judged here: depends on the machine and on who else is on it",
    );
}

fn run(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let bodies = if full { &[SMALL, LARGE, BLOCK][..] } else { &[SMALL] };
    for body in bodies {
        let (label, suffix) = (body.name, body.suffix);
        let mut schemes =
            vec![("bonds alone", "\"standard\""), ("adaptive, rescaled", "{ hybrid = { rescale = true } }")];
        if body.dimension == 2 {
            schemes.extend([
                ("adaptive", "{ hybrid = {} }"),
                ("fixed, rescaled", "{ hybrid = { rescale = true, adaptive = false, standard = [\"path\"] } }"),
            ]);
        }
        if full {
            schemes.push(("adaptive, rescaled, buffer 1", "{ hybrid = { rescale = true, buffer = 1 } }"));
        }
        if full && body.dimension == 2 {
            schemes.push(("adaptive, rescaled, undamped", "{ hybrid = { rescale = true, damping = 0.0 } }"));
        }
        let mut runs = Vec::new();
        for (name, scheme) in schemes {
            runs.push(body.run(name, scheme)?);
        }
        let (standard, hybrids) = runs.split_first_mut().expect("there are schemes");
        for run in hybrids.iter() {
            // What happens without damping is shown, not judged.
            if !run.name.contains("undamped") {
                compare(&mut outcome, body, standard, run);
            }
        }
        for run in std::iter::once(&*standard).chain(&*hybrids) {
            outcome.notes.push(format!(
                "{label}, {}: {} broken pairs, tip {:.1} mm, split {:.1} mm, {:.3} of the points in the standard scheme at \
                 the end ({:.3} at first), kinetic {:.3}, external work {:.3}, damped {:.3} J/m, {:.2} s",
                run.name,
                run.broken,
                1e3 * run.tip(),
                1e3 * run.split(),
                run.standard.last().map_or(1.0, |(_, f)| *f),
                run.standard.first().map_or(1.0, |(_, f)| *f),
                run.balance.kinetic,
                run.balance.external,
                run.balance.damped,
                run.seconds,
            ));
        }
        let line = |name: &str, points: &[(f64, f64)]| Series {
            name: name.into(),
            points: points.to_vec(),
            style: Style::Line,
        };
        let plot = |title: &str, y_label: &str, series| {
            let plot = Plot {
                title: title.into(),
                x_label: "time [s]".into(),
                y_label: y_label.into(),
                series,
                ..Plot::default()
            };
            draw_plot(&plot, 1000, 650)
        };
        let fractions = hybrids.iter().map(|run| line(run.name, &run.standard)).collect();
        outcome
            .plots
            .push((format!("standard{suffix}"), plot("Points that sum their bonds", "fraction [-]", fractions)));
        let tips = std::iter::once(&*standard).chain(&*hybrids).map(|run| line(run.name, &run.tip)).collect();
        outcome.plots.push((format!("tip{suffix}"), plot("The foremost damaged point", "x [m]", tips)));
        let [above, _] = standard.pictures.clone();
        let [below, scheme] = hybrids[0].pictures.clone();
        outcome.plots.push((format!("damage{suffix}"), above.above(below)));
        outcome.plots.push((format!("scheme{suffix}"), scheme));
    }
    Ok(outcome)
}
