//! `delamination`: a laminate whose interface is weaker than its layers gives way there, and takes the energy of the interface.
//!
//! The strip of `fracture-work`, opened by a wedge that travels along it, of two layers of unlike stiffness that take four times
//! what their interface takes; any bond may break. And the bundled case, two arms that are bent apart in equilibrium: which bonds
//! are broken.

use super::fracture_work::{self, Way};
use super::{Measure, Outcome, Row, Study, bundled_simulation, simulation};
use bondwise::discretization::{Influence, PartialVolume};
use bondwise::error::Result;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::physics::elasticity::discrete::discrete_moduli;
use bondwise::physics::elasticity::moduli::Hypothesis;
use bondwise::simulation::Simulation;

pub const STUDY: Study = Study {
    name: "delamination",
    about: "a laminate of unlike layers delaminates at its interface, and takes the energy of the interface",
    heavy: false,
    run,
};

/// G₀ of the interface, J/m².
const FRACTURE_ENERGY: f64 = 3.8;
/// What stands for the glass of the strip.
const LAYERS: [(&str, &str); 3] = [
    (
        "law = { bond_based = { young = \"72 GPa\", density = \"2440 kg/m^3\", plane = \"stress\" } }",
        "law = { bond_based = {} }\nmaterials = { stiff = \"upper\", soft = \"lower\" }\n\
         interfaces = [{ between = [\"stiff\", \"soft\"], fracture_energy = \"between\" }]",
    ),
    (
        "[discretization]",
        "[materials.stiff]\nyoung = \"72 GPa\"\ndensity = \"2440 kg/m^3\"\nfracture_energy = \"4*between\"\n\
         [materials.soft]\nyoung = \"48 GPa\"\ndensity = \"2200 kg/m^3\"\nfracture_energy = \"4*between\"\n[discretization]",
    ),
    (
        "fracture_energy = \"between\"\npairs = [\n    { between = [\"upper\", \"upper\"], fracture_energy = \"within\" },\n    \
         { between = [\"lower\", \"lower\"], fracture_energy = \"within\" },\n]\n",
        "",
    ),
];

fn run(_: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let text = LAYERS.iter().fold(fracture_work::CASE.to_string(), |text, (glass, layers)| {
        assert!(text.contains(glass), "the strip is of glass: {glass}");
        text.replace(glass, layers)
    });
    let mut strip = simulation("delamination", &text, &[("discretization.partial_volumes", "ramp")])?;
    let whole = strip.model.bond_words().to_vec();
    let (way, _) = fracture_work::follow(&mut strip)?;
    let lattice =
        discrete_moduli(Hypothesis::PlaneStress, &Influence::Constant, PartialVolume::Ramp, 4.0).fracture_energy;
    let per_area = |energies: &[f64]| way.slope(energies) / FRACTURE_ENERGY;
    outcome.rows.extend([
        Row::new(
            "strip: energy of broken bonds per new area, over G₀ of the interface",
            1.0,
            per_area(&way.fracture),
            0.1,
            Measure::Absolute,
            "Griffith; 10 % for the finite spacing",
        ),
        Row::new(
            "strip: the same, by the energy of all bonds across a line",
            lattice,
            per_area(&way.fracture),
            0.02,
            Measure::Relative,
            "lattice sum; 2 % because the tip moves by whole cells and some bonds overshoot",
        ),
        Row::new(
            "strip: work of the wedge less what is stored and damped, per new area, over G₀",
            1.0,
            per_area(&way.external) - per_area(&way.damped) - per_area(&way.stored),
            0.1,
            Measure::Absolute,
            "Griffith; 10 % for the finite spacing",
        ),
        inside("strip", &whole, &strip),
    ]);
    let mut arms = bundled_simulation("laminate_delamination", &[])?;
    arms.model.start();
    let whole = arms.model.bond_words().to_vec();
    let mut curve = vec![(0.0, 0.0)];
    while arms.clock.step < arms.n_steps {
        arms.model.step(&arms.solver, &mut arms.clock)?;
        let load =
            arms.model.reactions().iter().find(|(name, _)| name == "top_y").map_or(f64::NAN, |(_, force)| *force);
        curve.push((2e-4 * arms.clock.time(), load));
    }
    outcome.rows.push(inside("bundled case", &whole, &arms));
    let balance = arms.model.balance();
    outcome.rows.push(Row::new(
        "bundled case: energy defect over external work",
        1e-9,
        balance.defect().abs() / balance.external,
        0.0,
        Measure::AtMost,
        "linear bonds: mean forces times ways are exact; equilibrium to 1e-6 of the reactions enters squared",
    ));
    outcome.plots.push(("energy".into(), draw_plot(&energy(&way), 1000, 650)));
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

fn energy(way: &Way) -> Plot {
    let measured = way.tip.iter().copied().zip(way.fracture.iter().copied()).collect();
    let ends = [-8e-3, 8e-3];
    let griffith = ends.iter().map(|x| (*x, FRACTURE_ENERGY * (x - ends[0]))).collect();
    Plot {
        title: "Energy that broken bonds took".into(),
        x_label: "position of the tip [m]".into(),
        y_label: "energy per thickness [J/m]".into(),
        series: vec![
            Series { name: "broken bonds".into(), points: measured, style: Style::Line },
            Series { name: "G₀ of the interface × length".into(), points: griffith, style: Style::Dashed },
        ],
        ..Plot::default()
    }
}

/// Of the bonds that have broken since `whole`, how many do not cross y = 0, over those that do.
fn inside(name: &str, whole: &[u16], simulation: &Simulation) -> Row {
    let (mut across, mut inside) = (0u32, 0u32);
    for (word, (before, after)) in whole.iter().zip(simulation.model.bond_words()).enumerate() {
        for bit in (0..16).filter(|bit| (before & !after) >> bit & 1 == 1) {
            let [a, b] = simulation.model.bond_ends(16 * word + bit);
            *if a[1] * b[1] < 0.0 { &mut across } else { &mut inside } += 1;
        }
    }
    Row::new(
        format!("{name}: bonds broken inside a layer, over those across the interface"),
        0.0,
        f64::from(inside) / f64::from(across),
        0.0,
        Measure::Absolute,
        "the layers take four times the energy of the interface",
    )
}
