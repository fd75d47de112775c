//! `two-layers`: a slab of a good and a poor conductor against closed forms, at rest and as its slowest mode decays.
//!
//! Layers from −1 to 0 and from 0 to 1 of diffusivities K₁ and K₂, with C = 0 at both ends (odd mirrors). The slowest mode
//!
//! ```text
//! C = e^(−λt) sin(a (1 + x))/sin a,   e^(−λt) sin(b (1 − x))/sin b,   K₁ a² = K₂ b² = λ,   K₁ a cot a + K₂ b cot b = 0
//! ```
//!
//! and at rest between C = 1 and C = 0 two straight lines that meet at K₁/(K₁ + K₂): the bundled case `diffusion_two_layers`.

use super::{Measure, Outcome, Row, Study, bundled_simulation, simulation};
use bondwise::error::Result;
use bondwise::field::Values;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::simulation::Simulation;

pub const STUDY: Study = Study {
    name: "two-layers",
    about: "diffusion in a slab of two layers: a decaying mode with its order, and the state at rest",
    heavy: false,
    run,
};

const K: [f64; 2] = [4.0, 1.0];

/// λ by bisection: b between π/2 and π has the first sign of the slower layer turned.
fn rate() -> f64 {
    let defect = |lambda: f64| {
        let [a, b] = K.map(|k| (lambda / k).sqrt());
        K[0] * a / a.tan() + K[1] * b / b.tan()
    };
    let [mut low, mut high] = [0.5, 0.999].map(|part| K[1] * (part * std::f64::consts::PI).powi(2));
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if defect(middle) > 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The mode at t = 0.
fn mode(lambda: f64, x: f64) -> f64 {
    let [a, b] = K.map(|k| (lambda / k).sqrt());
    if x < 0.0 { (a * (1.0 + x)).sin() / a.sin() } else { (b * (1.0 - x)).sin() / b.sin() }
}

fn march(simulation: &mut Simulation) -> Result<Vec<(f64, f64)>> {
    let model = &mut *simulation.model;
    model.start();
    while simulation.clock.step < simulation.n_steps {
        model.step(&simulation.solver, &mut simulation.clock)?;
    }
    let Some(Values::Scalar(values)) = model.field("concentration").map(|field| field.values) else {
        unreachable!("something diffuses")
    };
    Ok(model.positions().iter().map(|x| x[0]).zip(values).collect())
}

/// The largest error of the mode at t = 1/λ over its amplitude there, and the profile; `cells` along x.
fn decay(dimension: usize, cells: usize) -> Result<(f64, Vec<(f64, f64)>)> {
    let (h, lambda) = (2.0 / cells as f64, rate());
    let [a, b] = K.map(|k| (lambda / k).sqrt());
    let half = 4.0 * h;
    let (low, high) =
        if dimension == 1 { ("-1".into(), "1".into()) } else { (format!("-1, -{half}"), format!("1, {half}")) };
    let across = if dimension == 1 { "" } else { "[[conditions]]\nperiodic = { axis = \"y\" }\n" };
    let text = format!(
        r#"
[case]
title = "Two layers"
dimension = {dimension}
[geometry]
shape = {{ box = {{ low = [{low}], high = [{high}] }} }}
spacing = {h}
[sets]
left = {{ where = "x < 0" }}
right = {{ where = "x > 0" }}
[discretization]
horizon_ratio = 3
[materials.good]
diffusivity = {}
[materials.poor]
diffusivity = {}
[physics.diffusion]
materials = {{ good = "left", poor = "right" }}
[[conditions]]
mirror = {{ axis = "x", side = "low", parity = "odd" }}
[[conditions]]
mirror = {{ axis = "x", side = "high", parity = "odd" }}
{across}
[[conditions]]
on = "all"
initial = {{ concentration = {{ value = "if(x < 0, sin({a}*(1 + x))/{}, sin({b}*(1 - x))/{})" }} }}
[solver.forward_euler]
end_time = {}
"#,
        K[0],
        K[1],
        a.sin(),
        b.sin(),
        1.0 / lambda
    );
    let profile = march(&mut simulation("two-layers", &text, &[])?)?;
    let amplitude = (-1f64).exp();
    let largest = (0..1000).map(|k| mode(lambda, f64::from(k) * 2e-3 - 1.0)).fold(0.0, f64::max);
    let error = profile.iter().map(|(x, c)| (c - amplitude * mode(lambda, *x)).abs()).fold(0.0, f64::max);
    Ok((error / (amplitude * largest), profile))
}

fn run(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut series = Vec::new();
    for dimension in 1..=2 {
        let grids: &[usize] = if full { &[40, 80, 160, 320] } else { &[40, 80, 160] };
        let found = grids.iter().map(|&cells| decay(dimension, cells)).collect::<Result<Vec<_>>>()?;
        let [.., (coarse, _), (fine, profile)] = &found[..] else { unreachable!("there are several grids") };
        outcome.rows.push(Row::new(
            format!("{dimension}D: error of the mode at t = 1/λ over its amplitude, {} cells", grids[grids.len() - 1]),
            0.02,
            *fine,
            0.0,
            Measure::AtMost,
            "bonds across the joint are of neither layer: of the order of the horizon, here 3/80 of a layer",
        ));
        outcome.rows.push(Row::new(
            format!("{dimension}D: order of this error by spacing"),
            1.0,
            (coarse / fine).log2(),
            0.25,
            Measure::Absolute,
            "first order by the joint; dispersion and forward Euler are of second in the spacing",
        ));
        if dimension == 1 {
            series.push(Series { name: "bonds".into(), points: profile.clone(), style: Style::Dots });
        }
    }
    let lambda = rate();
    let line = (0..=400).map(|k| f64::from(k) / 200.0 - 1.0).map(|x| (x, (-1f64).exp() * mode(lambda, x))).collect();
    series.push(Series { name: "closed form".into(), points: line, style: Style::Line });
    let mut wall = bundled_simulation("diffusion_two_layers", &[])?;
    let profile = march(&mut wall)?;
    let half = 10e-3;
    let at_rest = |x: f64| {
        let joint = K[0] / (K[0] + K[1]);
        (if x < 0.0 { joint - (1.0 - joint) * x / half } else { joint * (1.0 - x / half) }).clamp(0.0, 1.0)
    };
    let error = profile.iter().map(|(x, c)| (c - at_rest(*x)).abs()).fold(0.0, f64::max);
    outcome.rows.push(Row::new(
        "bundled case: largest error at rest",
        0.01,
        error,
        0.0,
        Measure::AtMost,
        "bonds across the joint, and values that begin a spacing beyond the wall: some hundredths of the horizon over a layer",
    ));
    let balance = wall.model.balance();
    outcome.rows.push(Row::new(
        "bundled case: defect of the amount over the amount",
        1e-12,
        balance.momentum_defect / balance.momentum_scale,
        0.0,
        Measure::AtMost,
        "pairs give and take the same: rounding of 200,000 steps",
    ));
    let plot = Plot {
        title: "The slowest mode of two layers at t = 1/λ".into(),
        x_label: "x (-)".into(),
        y_label: "C (-)".into(),
        series,
        ..Plot::default()
    };
    outcome.plots.push(("mode".into(), draw_plot(&plot, 1000, 650)));
    Ok(outcome)
}
