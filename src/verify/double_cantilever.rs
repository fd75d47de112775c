//! `double-cantilever`: a crack that grows in equilibrium takes the fracture energy for each new area.
//!
//! The bundled case, its horizon kept, its spacing halved with `--full`. The crack runs straight, so that its length is the
//! number of broken bonds over those that cross a line per length.

use super::discrete::discrete_moduli;
use super::{Measure, Outcome, Row, Study, bundled_simulation};
use crate::discretization::{Influence, PartialVolume};
use crate::error::Result;
use crate::output::plot::{Plot, Series, Style, draw_plot};
use crate::physics::elasticity::moduli::Hypothesis;
use crate::problem::Balance;

pub const STUDY: Study = Study {
    name: "double-cantilever",
    about: "a crack that grows in equilibrium takes G₀ for each new area (half the spacing with --full)",
    heavy: false,
    run,
};

/// G₀ of the case, J/m².
const FRACTURE_ENERGY: f64 = 100.0;
/// Load steps between which the crack grows steadily.
const STEADY: [u64; 2] = [12, 20];
/// Half the opening at the end, m.
const OPENED: f64 = 1e-4;

fn run(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut series = Vec::new();
    let mut excess = Vec::new();
    let spacings: &[(&str, f64)] = if full { &[("1 mm", 1e-3), ("0.5 mm", 5e-4)] } else { &[("1 mm", 1e-3)] };
    for &(spacing, h) in spacings {
        let mut simulation = bundled_simulation("double_cantilever", &[("constants.h", spacing)])?;
        let model = &mut *simulation.model;
        let m = model.facts().horizon / h;
        model.start();
        let (mut curve, mut steady) = (vec![(0.0, 0.0)], Vec::new());
        let mut reactions = [0.0, 0.0];
        while simulation.clock.step < simulation.n_steps {
            model.step(&simulation.solver, &mut simulation.clock)?;
            let forces = model.reactions();
            reactions = ["top_y", "bottom_y"]
                .map(|name| forces.iter().find(|(set, _)| set == name).map_or(f64::NAN, |(_, force)| *force));
            curve.push((2.0 * OPENED * simulation.clock.time(), reactions[0]));
            if STEADY.contains(&simulation.clock.step) {
                steady.push((model.balance(), model.broken_pairs() as f64));
            }
        }
        series.push(Series { name: format!("h = {spacing}, m = {m:.0}"), points: curve, style: Style::LineDots });
        let [(before, pairs), (after, more)] = steady[..] else { unreachable!("two load steps are looked at") };
        let area = (more - pairs) * h / crossing(m);
        let per_area = |energy: fn(&Balance) -> f64| (energy(&after) - energy(&before)) / area / FRACTURE_ENERGY;
        let (broken, lost) = (per_area(|b| b.fracture), per_area(|b| b.damped));
        let lattice =
            discrete_moduli(Hypothesis::PlaneStress, &Influence::Constant, PartialVolume::Ramp, m).fracture_energy;
        outcome.rows.extend([
            Row::new(
                format!("h = {spacing}: energy of broken bonds per new area, over G₀"),
                lattice,
                broken,
                0.1,
                Measure::Relative,
                "energy of all bonds across a line at the critical stretch, lattice sum; bonds of one column that follow \
                 the first one break above it",
            ),
            Row::new(
                format!("h = {spacing}: the same with what was lost in settling, over G₀"),
                1.0,
                broken + lost,
                0.0,
                Measure::Information,
                "Griffith; the body is held by the lattice until a whole column can go, which falls with h/δ",
            ),
            Row::new(
                format!("h = {spacing}: energy defect over external work"),
                1e-9,
                after.defect().abs() / after.external,
                0.0,
                Measure::AtMost,
                "linear bonds: mean forces times ways are exact; equilibrium to 1e-6 of the reactions enters squared",
            ),
            Row::new(
                format!("h = {spacing}: |sum of the reactions| over one"),
                1e-4,
                ((reactions[0] + reactions[1]) / reactions[0]).abs(),
                0.0,
                Measure::AtMost,
                "equilibrium to 1e-6 of the reactions, by point and squared; points add up",
            ),
        ]);
        excess.push(broken + lost - 1.0);
    }
    if let [coarse, fine] = excess[..] {
        outcome.rows.push(Row::new(
            "excess over G₀ at half the spacing, over that of the whole",
            0.5,
            fine / coarse,
            0.0,
            Measure::AtMost,
            "what the lattice adds falls at least as h/δ",
        ));
    }
    let plot = Plot {
        title: "Double cantilever: load and opening".into(),
        x_label: "opening [m]".into(),
        y_label: "reaction [N/m]".into(),
        series,
        ..Plot::default()
    };
    outcome.plots.push(("load".into(), draw_plot(&plot, 1000, 650)));
    Ok(outcome)
}

/// Bonds that cross a line along an axis of the lattice, per spacing: each of those with a part of their volume within the
/// horizon, by the rows that it reaches across.
fn crossing(m: f64) -> f64 {
    let n = m.ceil() as i32 + 1;
    let reach = |dx: i32, dy: i32| f64::from(dx * dx + dy * dy).sqrt() < m + 0.5 - 1e-9;
    (1..=n).map(|dy| dy * (-n..=n).filter(|dx| reach(*dx, dy)).count() as i32).sum::<i32>().into()
}
