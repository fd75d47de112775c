//! `joint`: a plane wave at the joint of two materials is thrown back and let through as impedances say, in 1D, 2D and 3D.
//!
//! A pulse f(x − c₁t) runs along x, periodic across, into a material of impedance Z₂ = ρ₂ c₂. With Z₁ = ρ₁ c₁
//!
//! ```text
//! u = f(x − c₁t) + R f(−x − c₁t)  before the joint,   R = (Z₁ − Z₂)/(Z₁ + Z₂)
//! u = T f(c₁ x/c₂ − c₁t)          behind it,          T = 2 Z₁/(Z₁ + Z₂)
//! ```
//!
//! with c = √(C₁₁/ρ) and the C₁₁ that the lattice has at its horizon ratio, by which both impedances are multiplied alike. R and T
//! are found as the parts of f that fit the displacements best on either side.

use super::{Measure, Outcome, Row, Study, simulation};
use bondwise::discretization::{Influence, PartialVolume};
use bondwise::error::Result;
use bondwise::field::Values;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::physics::elasticity::discrete::discrete_moduli;
use bondwise::physics::elasticity::moduli::Hypothesis;

pub const STUDY: Study = Study {
    name: "joint",
    about: "a wave at the joint of two materials: reflection and transmission by impedances, 1D to 3D, order by spacing",
    heavy: false,
    run,
};

/// E and ρ before the joint and behind it.
const MATERIALS: [[f64; 2]; 2] = [[1.0, 1.0], [4.0, 2.0]];
/// a of f = exp(−(x/a)²), and where it starts; the body reaches from −1 to 1.
const WIDTH: f64 = 0.08;
const START: f64 = -0.5;
const RATIO: f64 = 3.0;

struct Found {
    /// R, T, and the relative l² error of the displacements.
    reflected: f64,
    transmitted: f64,
    error: f64,
    /// (x, u) along a row.
    profile: Vec<(f64, f64)>,
}

fn pulse(x: f64) -> f64 {
    (-(x / WIDTH).powi(2)).exp()
}

/// c₁ and c₂.
fn speeds(dimension: usize) -> [f64; 2] {
    let hypothesis = [Hypothesis::Bar, Hypothesis::PlaneStress, Hypothesis::Solid][dimension - 1];
    let found = discrete_moduli(hypothesis, &Influence::Constant, PartialVolume::Ramp, RATIO);
    MATERIALS.map(|[young, density]| (found.c11 * hypothesis.stiffness(young).c11 / density).sqrt())
}

fn exact() -> [f64; 2] {
    let [a, b] = MATERIALS.map(|[young, density]| f64::sqrt(young * density));
    [(a - b) / (a + b), 2.0 * a / (a + b)]
}

/// `cells`: of the body along x.
fn march(dimension: usize, cells: usize) -> Result<Found> {
    let h = 2.0 / cells as f64;
    let [c, behind] = speeds(dimension);
    // Across, eight cells that go on for ever.
    let across = vec![4.0 * h; dimension - 1];
    let list = |sign: f64| {
        let across = across.iter().map(|half| (sign * half).to_string());
        std::iter::once((sign * 1.0).to_string()).chain(across).collect::<Vec<_>>().join(", ")
    };
    let periodic: String = ["y", "z"][..dimension - 1]
        .iter()
        .map(|axis| format!("[[conditions]]\nperiodic = {{ axis = \"{axis}\" }}\n"))
        .collect();
    let [[e1, r1], [e2, r2]] = MATERIALS;
    let f = format!("exp(-((x - {START})/{WIDTH})^2)");
    let text = format!(
        r#"
[case]
title = "Joint"
dimension = {dimension}
[geometry]
shape = {{ box = {{ low = [{}], high = [{}] }} }}
spacing = {h}
[sets]
before = {{ where = "x < 0" }}
behind = {{ where = "x > 0" }}
[discretization]
horizon_ratio = {RATIO}
[materials.a]
young = {e1}
density = {r1}
[materials.b]
young = {e2}
density = {r2}
[physics.elasticity]
law = {{ bond_based_linear = {{}} }}
materials = {{ a = "before", b = "behind" }}
[[conditions]]
on = "all"
initial = {{ displacement = {{ component = 0, value = "{f}" }} }}
[[conditions]]
on = "all"
initial = {{ velocity = {{ component = 0, value = "{c}*2*(x - {START})/{WIDTH}^2*{f}" }} }}
{periodic}
[solver.velocity_verlet]
end_time = {}
safety = 0.5
"#,
        list(-1.0),
        list(1.0),
        -2.0 * START / c
    );
    let mut simulation = simulation("joint", &text, &[])?;
    let model = &mut *simulation.model;
    model.start();
    while simulation.clock.step < simulation.n_steps {
        model.step(&simulation.solver, &mut simulation.clock)?;
    }
    model.conclude(&simulation.solver, &simulation.clock)?;
    let t = simulation.clock.time();
    let [reflection, transmission] = exact();
    let Some(Values::Vector(u)) = model.field("displacement").map(|field| field.values) else {
        unreachable!("it moves")
    };
    let (mut fits, mut sizes, mut squares, mut all) = ([0.0; 2], [0.0; 2], 0.0, 0.0);
    for (x, u) in model.positions().iter().zip(&u) {
        let side = usize::from(x[0] > 0.0);
        let shape = if side == 0 { pulse(-x[0] - c * t - START) } else { pulse(c * x[0] / behind - c * t - START) };
        let expected = [reflection, transmission][side] * shape;
        fits[side] += shape * u[0];
        sizes[side] += shape * shape;
        squares += (u[0] - expected).powi(2);
        all += expected * expected;
    }
    let row = |x: &[f64; 3]| x[1..].iter().all(|x| x.abs() < h);
    let profile = model.positions().iter().zip(&u).filter(|(x, _)| row(x)).map(|(x, u)| (x[0], u[0])).collect();
    let [reflected, transmitted] = [fits[0] / sizes[0], fits[1] / sizes[1]];
    Ok(Found { reflected, transmitted, error: (squares / all).sqrt(), profile })
}

fn run(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let [reflection, transmission] = exact();
    let mut series = Vec::new();
    for dimension in 1..=3 {
        let grids: &[usize] = match (dimension, full) {
            (1, _) | (2, true) => &[200, 400, 800],
            (_, false) => &[200, 400],
            _ => &[100, 200, 400],
        };
        let found = grids.iter().map(|&cells| march(dimension, cells)).collect::<Result<Vec<_>>>()?;
        let [.., coarse, fine] = &found[..] else { unreachable!("there are two grids") };
        let h = 2.0 / grids[grids.len() - 1] as f64;
        // What dispersion takes from the fit of a pulse is of the order of (δ/a)², of the joint itself δ/a at most.
        let tolerance = RATIO * h / WIDTH / 4.0;
        for (name, expected, value) in
            [("reflected", reflection, fine.reflected), ("let through", transmission, fine.transmitted)]
        {
            outcome.rows.push(Row::new(
                format!("{dimension}D: part of the amplitude that is {name}"),
                expected,
                value,
                tolerance,
                Measure::Absolute,
                "impedances; a quarter of δ/a for the joint, whose bonds are of neither material, and for dispersion",
            ));
        }
        outcome.rows.push(Row::new(
            format!("{dimension}D: order of the l² error by spacing"),
            1.5,
            (coarse.error / fine.error).log2(),
            0.0,
            Measure::AtLeast,
            "dispersion is of second order, the place of the joint of first with a small factor",
        ));
        let points = fine.profile.clone();
        series.push(Series {
            name: format!("{dimension}D"),
            points,
            style: if dimension == 1 { Style::Line } else { Style::Dots },
        });
    }
    let plot = Plot {
        title: "A pulse that has met a joint at x = 0".into(),
        x_label: "x (-)".into(),
        y_label: "displacement (-)".into(),
        series,
        ..Plot::default()
    };
    outcome.plots.push(("profile".into(), draw_plot(&plot, 1000, 650)));
    Ok(outcome)
}
