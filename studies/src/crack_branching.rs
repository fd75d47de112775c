//! The bundled case `crack_branching` against a reference run: soda-lime glass, 300 × 120 points, 642 steps.
//!
//! Input data are public; published figures show the same path, but no numbers to compare with. The numbers here come
//! from an independent program of our own, written for this purpose from the equations alone, run once on the same
//! input.

use super::{Measure, Outcome, Row, bundled_simulation};
use bondwise::error::Result;
use bondwise::output::picture::{CloudView, Picture, Sizes, draw};
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::output::source::{Source, deformed, scalar};

/// One instant of the reference run.
struct Instant {
    broken: f64,
    /// Position of the tip, mm.
    tip: f64,
    /// Largest distance of a damaged point from the middle, mm.
    width: f64,
    /// J/m
    kinetic: f64,
}

const fn instant(broken: f64, tip: f64, width: f64, kinetic: f64) -> Instant {
    Instant { broken, tip, width, kinetic }
}

/// The reference run, every 64 steps of 67 ns; a point is damaged when φ > 0.35.
const REFERENCE: [Instant; 10] = [
    instant(0.0, -0.5, 0.17, 0.1213),
    instant(78.0, 0.833, 0.17, 0.2960),
    instant(384.0, 6.167, 0.17, 0.5796),
    instant(662.0, 10.500, 0.17, 1.0196),
    instant(1454.0, 16.833, 1.50, 1.6051),
    instant(2456.0, 22.500, 5.17, 2.4203),
    instant(3142.0, 27.167, 7.50, 3.4176),
    instant(4084.0, 33.167, 9.50, 4.7032),
    instant(5164.0, 39.833, 12.17, 6.2797),
    instant(6146.0, 44.833, 15.50, 8.1694),
];
const STEPS_BETWEEN: u64 = 64;
const DAMAGED: f64 = 0.35;
/// Steps between looks at energies and tip, as in the case.
const LOOK_EVERY: u64 = 4;

const RUN: &str = "own independent reference run";
const INPUT: &str = "pairs within the horizon on 300 × 120 points, by an independent script";

/// What is plotted, over time in s.
#[derive(Default)]
struct Curves {
    broken: Vec<(f64, f64)>,
    tip: Vec<(f64, f64)>,
    speed: Vec<(f64, f64)>,
    kinetic: Vec<(f64, f64)>,
    strain: Vec<(f64, f64)>,
    fracture: Vec<(f64, f64)>,
    external: Vec<(f64, f64)>,
    sum: Vec<(f64, f64)>,
}

pub fn run(_full: bool) -> Result<Outcome> {
    let mut simulation = bundled_simulation("crack_branching", &[])?;
    let mut outcome = Outcome::default();
    let facts = simulation.model.facts().clone();
    outcome.rows.extend([
        Row::new(
            "critical stretch s₀",
            2.714621e-4,
            facts.physics.elastic().and_then(|e| e.critical_stretch).unwrap_or(f64::NAN),
            1e-6,
            Measure::Relative,
            "s₀² = 4π G₀/(9 E δ), Shojaei et al. 2022, eq. (20); seven digits printed",
        ),
        Row::new(
            "largest stable step, ns",
            68.44,
            1e9 * facts.stable_step,
            0.005,
            Measure::Absolute,
            "√(2ρ / Σ c V/|ξ|), Silling & Askari 2005, by an independent script; the last digit printed",
        ),
        count("unique pairs before the notch", 496_458, facts.bonds / 2),
        count("pairs that the notch cuts, those through its tip not", 2_688, facts.cut_bonds / 2),
    ]);

    let mut tip = simulation.history.tip.take();
    let mut curves = Curves::default();
    let (mut largest_defect, mut largest_work) = (0.0f64, 0.0f64);
    let model = &mut *simulation.model;
    model.start();
    let mut asymmetry = 0.0;
    loop {
        let (step, t) = (simulation.clock.step, simulation.clock.time());
        if step.is_multiple_of(LOOK_EVERY) {
            let energy = model.balance();
            largest_defect = largest_defect.max(energy.defect().abs());
            largest_work = largest_work.max(energy.external);
            curves.broken.push((t, model.broken_pairs() as f64));
            curves.kinetic.push((t, energy.kinetic));
            curves.strain.push((t, energy.strain));
            curves.fracture.push((t, energy.fracture));
            curves.external.push((t, energy.external));
            curves.sum.push((t, energy.kinetic + energy.strain + energy.fracture));
            if let Some(tip) = &mut tip {
                tip.follow(model, t);
                curves.tip.push((t, tip.position.map_or(f64::NAN, |x| x[0])));
                curves.speed.push((t, tip.speed));
            }
        }
        if step > 0 && step.is_multiple_of(STEPS_BETWEEN) {
            let expected = &REFERENCE[(step / STEPS_BETWEEN) as usize - 1];
            compare(model, t, expected, &mut outcome.rows);
            asymmetry = largest_asymmetry(model, asymmetry);
        }
        if step >= simulation.n_steps {
            break;
        }
        model.step(&simulation.solver, &mut simulation.clock)?;
    }

    let rayleigh = facts.physics.elastic().and_then(|e| e.rayleigh_speed).unwrap_or(f64::NAN);
    let split = 1e3 * split_column(model, facts.horizon, facts.spacing);
    outcome.rows.extend([
        Row::new("x where the crack has split, mm", 16.5, split, 1.0, Measure::Absolute, format!("{RUN}; one horizon")),
        Row::new(
            "largest |φ(x, y) − φ(x, −y)| at the ten instants and at the end",
            0.0,
            largest_asymmetry(model, asymmetry),
            0.0,
            Measure::Absolute,
            "input and scheme are symmetric in y, and sums are taken in an order that keeps every bit of it",
        ),
        Row::new(
            "largest speed of the tip, m/s",
            rayleigh,
            tip.as_ref().map_or(f64::NAN, |tip| tip.largest_speed),
            0.0,
            Measure::AtMost,
            "Rayleigh speed of the plate, the limit of a crack in mode I",
        ),
        Row::new(
            "largest energy defect over largest external work",
            0.01,
            largest_defect / largest_work,
            0.0,
            Measure::AtMost,
            "velocity Verlet keeps energy to second order in the step, which is at 98 % of the stable one",
        ),
    ]);
    outcome.notes.push(format!(
        "reference: {RUN} of the public input of PDMATLAB2D (ORNL), after Bobaru & Zhang 2015; the tolerances, 2 % of \
         the broken bonds and one horizon (1 mm) in positions, allow another order of summation, after which single \
         bonds break a step earlier or later"
    ));
    plots(&curves, rayleigh, &mut outcome);
    let values = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
    let positions = deformed(model, 20.0);
    let cloud = CloudView { positions: &positions, sizes: Sizes::Same(facts.spacing), values: &values, dimension: 2 };
    let picture = Picture {
        title: "Crack branching, displacements × 20".into(),
        label: "damage [-]".into(),
        range: Some((0.0, 1.0)),
        width: 1200,
        ..Picture::default()
    };
    outcome.plots.push(("damage".into(), draw(&picture, &cloud, Some(simulation.clock.time()))));
    Ok(outcome)
}

fn count(what: &str, expected: u64, obtained: u64) -> Row {
    Row::new(what, expected as f64, obtained as f64, 0.0, Measure::Absolute, format!("{INPUT}; a count is exact"))
}

/// Adds the rows of one instant.
fn compare(model: &mut dyn Source, t: f64, expected: &Instant, rows: &mut Vec<Row>) {
    let damage = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
    let (mut tip, mut width) = (f64::NAN, f64::NAN);
    for (x, _) in model.positions().iter().zip(&damage).filter(|(_, d)| **d > DAMAGED) {
        // `max` of NaN and a number is the number.
        tip = tip.max(1e3 * x[0]);
        width = width.max(1e3 * x[1].abs());
    }
    let at = format!("t = {:.2} µs", 1e6 * t);
    let broken = model.broken_pairs() as f64;
    let (tolerance, measure) = if expected.broken > 0.0 { (0.02, Measure::Relative) } else { (0.0, Measure::Absolute) };
    rows.extend([
        Row::new(format!("{at}: broken bonds"), expected.broken, broken, tolerance, measure, RUN),
        Row::new(format!("{at}: tip x, mm"), expected.tip, tip, 1.0, Measure::Absolute, RUN),
        Row::new(format!("{at}: largest |y| of damage, mm"), expected.width, width, 1.0, Measure::Absolute, RUN),
        Row::new(
            format!("{at}: kinetic energy, J/m"),
            expected.kinetic,
            model.balance().kinetic,
            0.02,
            Measure::Relative,
            RUN,
        ),
    ]);
}

/// The first x > 0 whose column of cells holds two groups of damaged points, more than two horizons apart.
fn split_column(model: &mut dyn Source, horizon: f64, spacing: f64) -> f64 {
    let damage = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
    let positions = model.positions();
    let mut damaged: Vec<(i64, f64)> = positions
        .iter()
        .zip(&damage)
        .filter(|(x, d)| x[0] > 0.0 && **d > DAMAGED)
        .map(|(x, _)| ((x[0] / spacing).floor() as i64, x[1]))
        .collect();
    damaged.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    // Distances are whole numbers of cells: half a cell decides for sure.
    let far = 2.0 * horizon + 0.5 * spacing;
    let split = damaged.windows(2).find(|pair| pair[0].0 == pair[1].0 && pair[1].1 - pair[0].1 > far);
    split.map_or(f64::NAN, |pair| (pair[0].0 as f64 + 0.5) * spacing)
}

/// Largest difference of damage between mirrored points, or `before` if that is larger.
fn largest_asymmetry(model: &mut dyn Source, before: f64) -> f64 {
    let damage = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
    let positions = model.positions();
    // Points are in rows of equal y, x fastest, and the plate is whole: mirrored rows have the same place from the
    // other end.
    let row = positions.iter().take_while(|x| x[1] == positions[0][1]).count();
    let rows = positions.len() / row;
    assert_eq!(rows * row, positions.len(), "a rectangle has equal rows");
    let difference = |i: usize| (damage[i] - damage[(rows - 1 - i / row) * row + i % row]).abs();
    (0..damage.len()).map(difference).fold(before, f64::max)
}

fn plots(curves: &Curves, rayleigh: f64, outcome: &mut Outcome) {
    let line =
        |name: &str, points: &[(f64, f64)]| Series { name: name.into(), points: points.to_vec(), style: Style::Line };
    let reference = |value: fn(&Instant) -> f64| Series {
        name: "reference run".into(),
        points: REFERENCE
            .iter()
            .enumerate()
            .map(|(k, at)| ((k as u64 + 1) as f64 * STEPS_BETWEEN as f64 * 67e-9, value(at)))
            .collect(),
        style: Style::Dots,
    };
    let mut plot = |name: &str, title: &str, y_label: &str, series: Vec<Series>| {
        let plot = Plot {
            title: title.into(),
            x_label: "time [s]".into(),
            y_label: y_label.into(),
            series,
            ..Plot::default()
        };
        outcome.plots.push((name.into(), draw_plot(&plot, 1000, 650)));
    };
    let broken = vec![line("bondwise", &curves.broken), reference(|at| at.broken)];
    plot("broken_bonds", "Broken bonds", "broken bonds [-]", broken);
    let tip = vec![line("bondwise", &curves.tip), reference(|at| 1e-3 * at.tip)];
    plot("tip", "Position of the crack tip", "x [m]", tip);
    let end = curves.speed.last().map_or(0.0, |(t, _)| *t);
    let limit =
        Series { name: "Rayleigh speed".into(), points: vec![(0.0, rayleigh), (end, rayleigh)], style: Style::Dashed };
    let speed = vec![line("tip", &curves.speed), limit];
    plot("tip_speed", "Speed of the crack tip", "speed [m/s]", speed);
    let energies = vec![
        line("kinetic", &curves.kinetic),
        line("strain", &curves.strain),
        line("fracture", &curves.fracture),
        line("external work", &curves.external),
        Series { style: Style::Dashed, ..line("kinetic + strain + fracture", &curves.sum) },
        reference(|at| at.kinetic),
    ];
    plot("energies", "Energies", "energy per thickness [J/m]", energies);
}
