//! `energy-drift`: what velocity Verlet does to the energy over many steps, and its order.
//!
//! An elastic plate with large displacements and free edges, released from a pulse, keeps its energy for ever. Velocity
//! Verlet keeps, to all practical purposes for ever, another one that differs from it by O(Δt²) (Hairer, Lubich &
//! Wanner 2003, Acta Numerica 12): the energy swings about a mean, and the mean has no trend.

use super::wave::simulation;
use super::{Measure, Outcome, Row, Study};
use bondwise::error::Result;
use bondwise::field::Values;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::simulation::Simulation;

pub const ENERGY_DRIFT: Study = Study {
    name: "energy-drift",
    about: "energy of an elastic plate over 100,000 steps (5,000 in the quick form), and the order of the time step",
    heavy: false,
    run: energy_drift,
};

// The pulse strains the plate by about 1e-4. At a hundred times as much, what is nonlinear in the law carries motion to
// higher frequencies all the while, and with it the mean distance of the two energies, O(Δt²), moves by 2e-4 over
// 100,000 steps: no drift of the method, but no constant to measure a drift against either.

/// Steps in a window over which the energy is averaged.
const WINDOW: usize = 1000;
/// Steps between two samples of the energy.
const EVERY: usize = 5;

fn plate(time: &str) -> Result<Simulation> {
    simulation(&format!(
        r#"
[case]
title = "Pulse in a plate"
dimension = 2
[geometry]
shape = {{ rectangle = {{ size = [0.1, 0.06] }} }}
spacing = 2.5e-3
[discretization]
horizon_ratio = 3.0
influence = "linear"
partial_volumes = "ramp"
[physics.elasticity]
law = {{ bond_based = {{ young = 72e9, density = 2440.0 }} }}
[[conditions]]
on = "all"
initial = {{ displacement = {{ component = 0, value = "2e-6*exp(-((x+0.01)^2+(y-0.005)^2)/0.015^2)" }} }}
[[conditions]]
on = "all"
initial = {{ velocity = {{ component = 1, value = "0.2*exp(-((x-0.02)^2+y^2)/0.015^2)" }} }}
[solver.velocity_verlet]
{time}
"#
    ))
}

fn energy_drift(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    drift(if full { 100_000 } else { 5_000 }, &mut outcome)?;
    halving(&mut outcome)?;
    Ok(outcome)
}

fn drift(steps: usize, outcome: &mut Outcome) -> Result<()> {
    // The length of the run in steps is what counts: the time step comes from the stable one.
    let dt = 0.5 * plate("end_time = 1e-6")?.model.facts().stable_step;
    let mut plate = plate(&format!("end_time = {:?}\ntime_step = {dt:?}", dt * steps as f64))?;
    plate.model.start();
    let total = |plate: &mut Simulation| {
        let b = plate.model.balance();
        b.kinetic + b.strain
    };
    let initial = total(&mut plate);
    let mut samples = vec![(0.0, 0.0)];
    while plate.clock.step < plate.n_steps {
        plate.model.step(&plate.solver, &mut plate.clock)?;
        if plate.clock.step.is_multiple_of(EVERY as u64) {
            samples.push((plate.clock.step as f64, total(&mut plate) / initial - 1.0));
        }
    }
    let windows: Vec<(f64, f64)> = samples[1..].chunks_exact(WINDOW / EVERY).map(average).collect();
    let swing = samples.iter().map(|s| s.1.abs()).fold(0.0, f64::max);
    let (first, last) = (windows[0], windows[windows.len() - 1]);
    let trend = slope(&windows) * (last.0 - first.0);
    outcome.rows.push(Row::new(
        format!("|trend| of the mean energy over {steps} steps, fraction of the total"),
        1e-6,
        trend.abs(),
        0.0,
        Measure::AtMost,
        "line through the means of windows of 1,000 steps, times its length; a symplectic method has none, and what is \
         seen is what is left of the swing in the means",
    ));
    outcome.rows.push(Row::new(
        "largest swing of the energy, fraction of the total",
        1e-2,
        swing,
        0.0,
        Measure::AtMost,
        "bounded: (ωΔt)²/8 of the energy of each wave, at half the stable step",
    ));
    outcome.notes.push(format!(
        "trend {trend:.2e}, swing {swing:.2e}, largest difference of two windows {:.2e}",
        windows.iter().map(|w| w.1).fold(f64::MIN, f64::max) - windows.iter().map(|w| w.1).fold(f64::MAX, f64::min),
    ));
    let plot = Plot {
        title: "Energy of an elastic plate under velocity Verlet".into(),
        x_label: "step (-)".into(),
        y_label: "energy over the initial one, less 1 (-)".into(),
        series: vec![
            Series { name: "every 5th step".into(), points: samples, style: Style::Line },
            Series { name: "means of 1,000 steps".into(), points: windows, style: Style::LineDots },
        ],
        ..Plot::default()
    };
    outcome.plots.push(("energy-drift".into(), draw_plot(&plot, 1000, 640)));
    Ok(())
}

/// Mean of the samples of a window with the weights sin²: at the ends of a window, where a swing is cut off anywhere,
/// a sample counts nothing.
fn average(window: &[(f64, f64)]) -> (f64, f64) {
    let n = window.len() as f64;
    let (mut sum, mut weights, mut step) = (0.0, 0.0, 0.0);
    for (i, sample) in window.iter().enumerate() {
        let weight = (std::f64::consts::PI * (i as f64 + 0.5) / n).sin().powi(2);
        sum += weight * sample.1;
        weights += weight;
        step += sample.0 / n;
    }
    (step, sum / weights)
}

/// Slope of the line of least squares.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |a, p| (a.0 + p.0 / n, a.1 + p.1 / n));
    let (up, down) = points.iter().fold((0.0, 0.0), |a, p| (a.0 + (p.0 - x) * (p.1 - y), a.1 + (p.0 - x).powi(2)));
    up / down
}

fn halving(outcome: &mut Outcome) -> Result<()> {
    // The pulse crosses the plate twice.
    let end_time = 40e-6;
    let coarsest = 100;
    let mut states = Vec::new();
    for n in 0..5 {
        let steps = coarsest << n;
        let mut plate = plate(&format!("end_time = {end_time:?}\ntime_step = {:?}", end_time / f64::from(steps)))?;
        plate.model.start();
        while plate.clock.step < plate.n_steps {
            plate.model.step(&plate.solver, &mut plate.clock)?;
        }
        states.push((plate.clock.dt, [flat(&mut plate, "displacement"), flat(&mut plate, "velocity")]));
    }
    let mut series = Vec::new();
    for (k, field) in ["displacement", "velocity"].into_iter().enumerate() {
        let size = norm(&states[4].1[k]);
        let changes: Vec<(f64, f64)> = states
            .windows(2)
            .map(|w| {
                let difference: Vec<f64> = w[0].1[k].iter().zip(&w[1].1[k]).map(|(a, b)| a - b).collect();
                (w[0].0, norm(&difference) / size)
            })
            .collect();
        outcome.rows.push(Row::new(
            format!("observed order of the final {field} in Δt"),
            2.0,
            (changes[2].1 / changes[3].1).log2(),
            0.05,
            Measure::Absolute,
            "velocity Verlet; from the changes between runs with 400, 800 and 1,600 steps, whose next term is O(Δt²) of \
             the leading one",
        ));
        series.push(Series { name: field.into(), points: changes, style: Style::LineDots });
    }
    let (dt, change) = series[0].points[3];
    let line = series[0].points.iter().map(|p| (p.0, 0.5 * change * (p.0 / dt).powi(2))).collect();
    series.push(Series { name: "Δt²".into(), points: line, style: Style::Dashed });
    let plot = Plot {
        title: "Change of the state after 40 µs when the step is halved".into(),
        x_label: "time step [s]".into(),
        y_label: "relative change (-)".into(),
        log_x: true,
        log_y: true,
        series,
        ..Plot::default()
    };
    outcome.plots.push(("energy-drift_order".into(), draw_plot(&plot, 900, 640)));
    Ok(())
}

fn flat(simulation: &mut Simulation, field: &str) -> Vec<f64> {
    match simulation.model.field(field).map(|f| f.values) {
        Some(Values::Vector(v)) => v.into_iter().flatten().collect(),
        _ => unreachable!("every model has this field"),
    }
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}
