//! `refined-branching`: the bundled case `crack_branching_refined`, whose fine cells follow the crack's tips, against the
//! same plate on the finest cells everywhere.

use super::{Measure, Outcome, Row, Study, simulation};
use bondwise::error::Result;
use bondwise::output::picture::{CloudView, Image, Picture, draw};
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::output::source::{Source, deformed, scalar};
use bondwise::simulation::Simulation;

pub const STUDY: Study = Study {
    name: "refined-branching",
    about: "a branching crack on cells that follow its tips against fine cells everywhere: points, path, energy, pictures",
    heavy: false,
    run,
};

const CASE: &str = include_str!("../../cases/crack_branching_refined/case.toml");
const DAMAGED: f64 = 0.35;
/// Levels of the case: what the spacing of the plate that is fine everywhere is divided by.
const FINER: f64 = 4.0;
/// Pictures of the animation.
const FRAMES: u64 = 60;

/// What is compared of a run.
struct Run {
    simulation: Simulation,
    /// x of the foremost damaged point by time, m.
    tip: Vec<(f64, f64)>,
    points: Vec<(f64, f64)>,
    frames: Vec<Image>,
    seconds: f64,
}

fn march(mut simulation: Simulation, film: bool) -> Result<Run> {
    let begin = std::time::Instant::now();
    let (mut tip, mut points, mut frames) = (Vec::new(), Vec::new(), Vec::new());
    let model = &mut *simulation.model;
    model.start();
    let every = (simulation.n_steps / FRAMES).max(1);
    while simulation.clock.step < simulation.n_steps {
        model.step(&simulation.solver, &mut simulation.clock)?;
        if simulation.clock.step.is_multiple_of(every) {
            let t = simulation.clock.time();
            let x = damaged(model).iter().map(|x| x[0]).fold(f64::NAN, f64::max);
            tip.push((t, x));
            points.push((t, model.facts().points as f64));
            if film {
                frames.push(cells(model, t));
            }
        }
    }
    Ok(Run { simulation, tip, points, frames, seconds: begin.elapsed().as_secs_f64() })
}

/// Where points are damaged, m.
fn damaged(model: &mut dyn Source) -> Vec<[f64; 3]> {
    let damage = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
    let both = model.positions().iter().zip(&damage);
    both.filter(|(_, damage)| **damage > DAMAGED).map(|(x, _)| *x).collect()
}

/// The first x > 0 where two groups of damaged points stand over each other, `far` apart and nothing between; by columns of
/// width `h`.
fn split(model: &mut dyn Source, h: f64, far: f64) -> f64 {
    let mut columns: Vec<(i64, f64)> =
        damaged(model).iter().filter(|x| x[0] > 0.0).map(|x| ((x[0] / h).floor() as i64, x[1])).collect();
    columns.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let split = columns.windows(2).find(|pair| pair[0].0 == pair[1].0 && pair[1].1 - pair[0].1 > far);
    split.map_or(f64::NAN, |pair| (pair[0].0 as f64 + 0.5) * h)
}

fn picture(title: &str, label: &str, range: Option<(f64, f64)>) -> Picture {
    Picture { title: title.into(), label: label.into(), range, width: 1000, ..Picture::default() }
}

/// The damage, displacements × 20.
fn damage(model: &mut dyn Source, title: &str, t: f64) -> Image {
    let values = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
    let positions = deformed(model, 20.0);
    let points = model.points();
    let cloud = CloudView { positions: &positions, sizes: points.sizes(), values: &values, dimension: 2 };
    draw(&picture(title, "damage [-]", Some((0.0, 1.0))), &cloud, Some(t))
}

/// The size of the cells, damaged ones grey.
fn cells(model: &mut dyn Source, t: f64) -> Image {
    let largest = 1e3 * model.facts().spacing;
    let damage = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
    let points = model.points();
    let values: Vec<f64> =
        points.sizes.iter().zip(&damage).map(|(size, d)| if *d > DAMAGED { f64::NAN } else { 1e3 * size }).collect();
    let cloud = CloudView { positions: &points.positions, sizes: points.sizes(), values: &values, dimension: 2 };
    draw(&picture("Cells that follow the crack", "cell [mm]", Some((largest / FINER, largest))), &cloud, Some(t))
}

fn run(_full: bool) -> Result<Outcome> {
    let coarse = simulation("crack_branching_refined", CASE, &[])?;
    let (h, horizon) = (coarse.model.facts().spacing, coarse.model.facts().horizon);
    // The same loads on the same layer, and the same grips.
    let fine = h / FINER;
    let layer = format!("{h:e}");
    let (before, rest) = CASE.split_once("[refinement]").expect("the case has this table");
    let (_, after) = rest.split_once("[physics").expect("and this one after it");
    let overrides = [
        ("geometry.spacing", format!("{fine:e}")),
        ("conditions.0.load.traction.thickness", layer.clone()),
        ("conditions.1.load.traction.thickness", layer),
    ];
    let overrides: Vec<(&str, &str)> = overrides.iter().map(|(key, value)| (*key, value.as_str())).collect();
    let uniform = simulation("fine everywhere", &format!("{before}[physics{after}"), &overrides)?;
    let mut refined = march(coarse, true)?;
    let mut uniform = march(uniform, false)?;
    let report = refined.simulation.model.adapted().expect("cells follow the solution");
    let balance = refined.simulation.model.balance();
    let other = uniform.simulation.model.balance();
    let all = uniform.simulation.model.facts().points as f64;
    let mean = report.points[1] as f64 / (report.looks as f64 + 1.0);
    // A gap of two fine horizons, as in the study of the uniform plate.
    let far = 2.0 * horizon / FINER + 0.5 * fine;
    let [here, there] = [&mut refined, &mut uniform].map(|run| 1e3 * split(&mut *run.simulation.model, fine, far));
    let [tip, fine_tip] = [&refined, &uniform].map(|run| 1e3 * run.tip.last().map_or(f64::NAN, |(_, x)| *x));
    let mut outcome = Outcome {
        rows: vec![
            Row::new(
                "points of the fine plate over the most of the refined one",
                5.0,
                all / report.points[0] as f64,
                0.0,
                Measure::AtLeast,
                "asked for",
            ),
            Row::new(
                "points of the fine plate over the mean of the refined one",
                5.0,
                all / mean,
                0.0,
                Measure::AtLeast,
                "asked for",
            ),
            Row::new(
                "x where the crack has split, mm",
                there,
                here,
                1e3 * horizon,
                Measure::Absolute,
                "fine cells everywhere; one coarse horizon",
            ),
            Row::new(
                "x of the foremost damaged point at the end, mm",
                fine_tip,
                tip,
                1e3 * horizon,
                Measure::Absolute,
                "fine cells everywhere; one coarse horizon",
            ),
            Row::new(
                "energy that broken bonds took, J/m",
                other.fracture,
                balance.fracture,
                0.05,
                Measure::Relative,
                "fine cells everywhere; some per cent of the bonds break in another order",
            ),
            Row::new(
                "Σ |energy that came in at refinement| over external work",
                0.02,
                report.energy / balance.external,
                0.0,
                Measure::AtMost,
                "asked for; interpolation of second order",
            ),
            Row::new(
                "energy defect over external work, less that energy",
                0.01,
                balance.defect().abs() / balance.external,
                0.0,
                Measure::AtMost,
                "velocity Verlet at 80 % of the stable step",
            ),
            Row::new(
                "|momentum defect| over Σ ρ |v| V",
                1e-10,
                balance.momentum_defect / balance.momentum_scale,
                0.0,
                Measure::AtMost,
                "dual horizons and both transfers keep it to rounding",
            ),
            Row::new(
                "families found anew, of all at refinement",
                f64::NAN,
                report.bonds[0] as f64 / report.bonds[1] as f64,
                0.0,
                Measure::Information,
                "only where points came or went",
            ),
        ],
        ..Outcome::default()
    };
    outcome.notes.push(format!(
        "{} points at most, {mean:.0} in the mean, {} times replaced, in {:.1} s; {all} fine points in {:.1} s, as a lattice",
        report.points[0], report.events, refined.seconds, uniform.seconds
    ));
    let t = refined.simulation.clock.time();
    let [above, below] = [
        damage(&mut *refined.simulation.model, "Cells that follow the crack", t),
        damage(&mut *uniform.simulation.model, "Fine cells everywhere", t),
    ];
    outcome.plots.push(("damage".into(), above.above(below)));
    let line =
        |name: &str, points: &[(f64, f64)]| Series { name: name.into(), points: points.to_vec(), style: Style::Line };
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
    let tips = vec![line("refined", &refined.tip), line("fine everywhere", &uniform.tip)];
    outcome.plots.push(("tip".into(), plot("The foremost damaged point", "x [m]", tips)));
    let points = vec![line("refined", &refined.points), line("fine everywhere", &uniform.points)];
    outcome.plots.push(("points".into(), plot("Points", "points [-]", points)));
    outcome.animations.push(("cells".into(), std::mem::take(&mut refined.frames)));
    Ok(outcome)
}
