//! `double-cantilever`: a crack that grows in equilibrium takes the fracture energy for each new area.
//!
//! The bundled case, its horizon kept, its spacing halved with `--full`. Bonds are linear: unloading is a straight line to
//! zero, and the opening over the load is the compliance C of a plate cut as far as the crack is long. Plates that are cut,
//! of the same lattice, say how C grows with the length a; so a run at rest has a length and a driving force,
//!
//! ```text
//! G = −dΠ/da = ½ P² dC/da
//! ```
//!
//! without a look at bonds. These count too much: near the tip some break that do not cross the crack, the more the finer
//! the lattice.

use super::{Measure, Outcome, Row, Study, bundled_simulation};
use bondwise::discretization::{Influence, PartialVolume};
use bondwise::error::Result;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::physics::elasticity::discrete::discrete_moduli;
use bondwise::physics::elasticity::moduli::Hypothesis;
use bondwise::problem::Balance;
use bondwise::simulation::Stepper;

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
/// Half the length of the plate, m.
const HALF: f64 = 0.05;
/// Lengths of the plates that are cut, m: multiples of both spacings.
const LENGTHS: [f64; 7] = [0.03, 0.035, 0.04, 0.045, 0.05, 0.055, 0.06];

/// C by length of cut. In a beam its cube root is linear in a; here its slope falls by half a percent between lengths, and
/// is taken as constant there.
struct Compliance {
    /// a in m, ∛C in (m²/N)^⅓
    roots: Vec<(f64, f64)>,
}

impl Compliance {
    fn of_cut_plates(spacing: &str) -> Result<Self> {
        let roots = LENGTHS.iter().map(|&a| {
            let tip = format!("{:e}", a - HALF);
            let mut simulation = bundled_simulation(
                "double_cantilever",
                &[
                    ("constants.h", spacing),
                    ("geometry.cracks.0.segment.to.0", &tip),
                    // Far from breaking anything.
                    ("conditions.0.prescribe.displacement.value", "1e-9*t"),
                    ("conditions.1.prescribe.displacement.value", "-1e-9*t"),
                    ("solver.quasi_static.steps", "1"),
                ],
            )?;
            simulation.model.start();
            simulation.model.step(&simulation.solver, &mut simulation.clock)?;
            Ok((a, (2e-9 / reactions(&*simulation.model)[0]).cbrt()))
        });
        Ok(Compliance { roots: roots.collect::<Result<_>>()? })
    }

    /// Length (m) and driving force (J/m²) at an opening (m) and a load (N/m).
    fn at(&self, opening: f64, load: f64) -> (f64, f64) {
        let root = (opening / load).cbrt();
        let pairs = self.roots.windows(2);
        let pair = pairs.clone().find(|pair| root <= pair[1].1).or(pairs.last());
        let Some(&[(a, low), (b, high)]) = pair else { unreachable!("several plates are cut") };
        let slope = (high - low) / (b - a);
        (a + (root - low) / slope, 1.5 * (load * root).powi(2) * slope)
    }
}

/// On the upper and the lower arm along y, N/m.
fn reactions(model: &dyn Stepper) -> [f64; 2] {
    let forces = model.reactions();
    ["top_y", "bottom_y"].map(|name| forces.iter().find(|(set, _)| set == name).map_or(f64::NAN, |(_, force)| *force))
}

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
        let compliance = Compliance::of_cut_plates(spacing)?;
        let (mut curve, mut steady, mut forces) = (vec![(0.0, 0.0)], Vec::new(), Vec::new());
        let mut held = [0.0, 0.0];
        while simulation.clock.step < simulation.n_steps {
            model.step(&simulation.solver, &mut simulation.clock)?;
            held = reactions(model);
            let opening = 2.0 * OPENED * simulation.clock.time();
            curve.push((opening, held[0]));
            let (length, force) = compliance.at(opening, held[0]);
            if (STEADY[0]..=STEADY[1]).contains(&simulation.clock.step) {
                forces.push(force / FRACTURE_ENERGY);
            }
            if STEADY.contains(&simulation.clock.step) {
                steady.push((model.balance(), model.broken_pairs() as f64, length));
            }
        }
        series.push(Series { name: format!("h = {spacing}, m = {m:.0}"), points: curve, style: Style::LineDots });
        let [(before, pairs, from), (after, more, to)] = steady[..] else {
            unreachable!("two load steps are looked at")
        };
        let area = (more - pairs) * h / crossing(m);
        let gained = |energy: fn(&Balance) -> f64| (energy(&after) - energy(&before)) / FRACTURE_ENERGY;
        let broken = gained(|b| b.fracture) / area;
        let taken = gained(|b| b.fracture + b.damped) / (to - from);
        let force = forces.iter().sum::<f64>() / forces.len() as f64;
        let lattice =
            discrete_moduli(Hypothesis::PlaneStress, &Influence::Constant, PartialVolume::Ramp, m).fracture_energy;
        outcome.rows.extend([
            Row::new(
                format!("h = {spacing}: energy of broken bonds per area that they would cross in line, over G₀"),
                lattice,
                broken,
                0.1,
                Measure::Relative,
                "energy of all bonds across a line at the critical stretch, lattice sum; bonds of one column that follow \
                 the first one break above it",
            ),
            Row::new(
                format!("h = {spacing}: that area over new length by compliance"),
                1.0,
                area / (to - from),
                0.0,
                Measure::Information,
                "bonds that break without crossing the crack count as area",
            ),
            Row::new(
                format!("h = {spacing}: energy of broken bonds and lost in settling, per new length by compliance, over G₀"),
                1.0,
                taken,
                0.0,
                Measure::Information,
                "Griffith; the body is held by the lattice until a whole column can go, which falls with h/δ",
            ),
            Row::new(
                format!("h = {spacing}: the same over the mean of ½ P² dC/da at rest"),
                1.0,
                taken / force,
                2.0 * h / from,
                Measure::Absolute,
                "the books of bonds against load and opening alone; the force falls by 4h/a while a column breaks, and rest \
                 is somewhere on that way",
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
                ((held[0] + held[1]) / held[0]).abs(),
                0.0,
                Measure::AtMost,
                "equilibrium to 1e-6 of the reactions, by point and squared; points add up",
            ),
        ]);
        excess.push(taken - 1.0);
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
pub(super) fn crossing(m: f64) -> f64 {
    let n = m.ceil() as i32 + 1;
    let reach = |dx: i32, dy: i32| f64::from(dx * dx + dy * dy).sqrt() < m + 0.5 - 1e-9;
    (1..=n).map(|dy| dy * (-n..=n).filter(|dx| reach(*dx, dy)).count() as i32).sum::<i32>().into()
}
