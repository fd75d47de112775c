//! `delamination`: a laminate whose interface is weaker than its layers gives way there, and takes the energy of the interface.
//!
//! The bundled case: a plate of two layers of unlike stiffness, wedged open in equilibrium. Which bonds are broken says where;
//! the energy that they took, over the area that they would cross in line, what it cost.

use super::double_cantilever::crossing;
use super::{Measure, Outcome, Row, Study, bundled_simulation};
use bondwise::discretization::{Influence, PartialVolume};
use bondwise::error::Result;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::physics::elasticity::discrete::discrete_moduli;
use bondwise::physics::elasticity::moduli::Hypothesis;

pub const STUDY: Study = Study {
    name: "delamination",
    about: "a laminate of unlike layers delaminates at its interface, and takes the energy of the interface",
    heavy: false,
    run,
};

/// G₀ of the interface in the case, J/m².
const FRACTURE_ENERGY: f64 = 50.0;
/// m of the case.
const RATIO: f64 = 3.015;
const SPACING: f64 = 1e-3;

fn run(_: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut simulation = bundled_simulation("laminate_delamination", &[])?;
    let model = &mut *simulation.model;
    model.start();
    let whole = model.bond_words().to_vec();
    let mut curve = vec![(0.0, 0.0)];
    while simulation.clock.step < simulation.n_steps {
        model.step(&simulation.solver, &mut simulation.clock)?;
        let load = model.reactions().iter().find(|(name, _)| name == "top_y").map_or(f64::NAN, |(_, force)| *force);
        curve.push((2e-4 * simulation.clock.time(), load));
    }
    let (mut across, mut inside, mut tip) = (0usize, 0usize, f64::NEG_INFINITY);
    let now = model.bond_words().to_vec();
    for (word, (before, after)) in whole.iter().zip(&now).enumerate() {
        for bit in (0..16).filter(|bit| (before & !after) >> bit & 1 == 1) {
            let [a, b] = model.bond_ends(16 * word + bit);
            if a[1] * b[1] < 0.0 {
                across += 1;
                tip = tip.max(0.5 * (a[0] + b[0]));
            } else {
                inside += 1;
            }
        }
    }
    let balance = model.balance();
    // Each pair has two bits.
    let area = 0.5 * across as f64 * SPACING / crossing(RATIO);
    let lattice =
        discrete_moduli(Hypothesis::PlaneStress, &Influence::Constant, PartialVolume::Ramp, RATIO).fracture_energy;
    outcome.rows.extend([
        Row::new(
            "broken bonds inside a layer, over those across the interface",
            0.0,
            inside as f64 / across as f64,
            0.0,
            Measure::Absolute,
            "the layers take four times the energy of the interface",
        ),
        Row::new(
            "energy of broken bonds per area, over G₀ of the interface",
            lattice,
            balance.fracture / area / FRACTURE_ENERGY,
            0.1,
            Measure::Relative,
            "energy of all bonds across a line at the critical stretch, lattice sum; bonds of one column that follow the first \
             one break above it",
        ),
        Row::new(
            "distance that the tip has run, m",
            0.02,
            tip + 0.02,
            0.0,
            Measure::AtLeast,
            "a third of the ligament at least",
        ),
        Row::new(
            "energy defect over external work",
            1e-9,
            balance.defect().abs() / balance.external,
            0.0,
            Measure::AtMost,
            "linear bonds: mean forces times ways are exact; equilibrium to 1e-6 of the reactions enters squared",
        ),
    ]);
    let plot = Plot {
        title: "Laminate: load and opening".into(),
        x_label: "opening [m]".into(),
        y_label: "reaction [N/m]".into(),
        series: vec![Series { name: "upper arm".into(), points: curve, style: Style::LineDots }],
        ..Plot::default()
    };
    outcome.plots.push(("load".into(), draw_plot(&plot, 1000, 650)));
    Ok(outcome)
}
