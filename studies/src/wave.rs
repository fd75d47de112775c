//! `wave-in-bar`: a pulse in an elastic bar against d'Alembert's solution, under refinement at a fixed horizon ratio.
//!
//! A bar of the linear bond-based law with constant influence and the ramp of partial volumes has the classical wave
//! speed c₀ = √(E/ρ) for long waves whatever m, since the trapezoidal rule is exact for ∫ξ dξ. What is left is
//! dispersion,
//!
//! ```text
//! ω = c₀ k (1 − β k² + …),   β = (δ² + h²)/48 − (c₀ Δt)²/24
//! ```
//!
//! the first part from the operator, the second from velocity Verlet. With δ and Δt in proportion to h the error of a
//! smooth pulse is therefore of order 2, and its size is known beforehand: the correction to f(x − c₀t) is −c₀ t β f‴.
//! For f = exp(−(x/a)²) its l² norm is √15 c₀ t β/a³ of that of f, and the crest comes later by the fraction 6 β/a² of
//! its time.

use super::exact::dalembert;
use super::{Measure, Outcome, Row, Study};
use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::error::{Error, Result};
use bondwise::field::Values;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::simulation::Simulation;

pub const WAVE_IN_BAR: Study = Study {
    name: "wave-in-bar",
    about: "a pulse in a bar against d'Alembert: arrival, shape, reflection at a free end, order under refinement",
    heavy: false,
    run: wave_in_bar,
};

const YOUNG: f64 = 200e9;
const DENSITY: f64 = 8000.0;
/// √(E/ρ), m/s
const SPEED: f64 = 5000.0;
/// The bar reaches from −HALF to HALF, m.
const HALF: f64 = 0.5;
/// a of the pulse exp(−(x/a)²), m: its halves are 0 to round-off at each other's place and at the ends when measured.
const WIDTH: f64 = 0.04;
const AMPLITUDE: f64 = 1e-6;
/// δ/h
const RATIO: f64 = 3.0;
/// Where the arrival is timed, m.
const STATION: f64 = 0.25;

fn pulse(x: f64) -> f64 {
    AMPLITUDE * (-(x / WIDTH).powi(2)).exp()
}

/// c₀ Δt/h. Of the stable step it is a half; the time of measurement is a whole number of such steps.
const COURANT: f64 = 5.0 / 6.0;

/// What one spacing gives.
struct Run {
    spacing: f64,
    /// Relative l² error of the displacements at the time when the halves are at ±STATION.
    profile_error: f64,
    /// Relative l² error of the displacement of the last point over the time of the reflection.
    end_error: f64,
    /// Centroid of the right half at that time over the time, m/s.
    centroid_speed: f64,
    /// Arrival of the crest at the point next to STATION, over that of d'Alembert, less one.
    lag: f64,
    /// β, m²
    dispersion: f64,
    /// (t, u) of the last point.
    end: Vec<(f64, f64)>,
    /// Place of the last point, m.
    end_at: f64,
    profile: Vec<(f64, f64)>,
}

fn wave_in_bar(full: bool) -> Result<Outcome> {
    let halvings = if full { 5 } else { 4 };
    let runs = (0..=halvings).map(|n| run(200 << n)).collect::<Result<Vec<_>>>()?;
    let [.., coarse, fine] = &runs[..] else { unreachable!("there are two runs at least") };
    let order = |error: fn(&Run) -> f64| (error(coarse) / error(fine)).log2();
    let mut rows = vec![
        Row::new(
            "speed of the centroid of a half (m/s)",
            SPEED,
            fine.centroid_speed,
            1e-9,
            Measure::Relative,
            "√(E/ρ): dispersion that is odd in k moves no centroid, and the long-wave speed of this scheme is exact; the \
             tolerance is the round-off of sums over thousands of steps and points",
        ),
        Row::new(
            format!("lag of the crest at x = {STATION} m, fraction of its time, h = {:.3e} m", fine.spacing),
            6.0 * fine.dispersion / (WIDTH * WIDTH),
            fine.lag,
            5e-3,
            Measure::Relative,
            "6 β/a², the leading term of dispersion; the next one is (δ/a)² of it, and the parabola through three \
             instants adds as little",
        ),
        Row::new(
            "observed order of the shape at 50 µs",
            2.0,
            order(|r| r.profile_error),
            0.02,
            Measure::Absolute,
            "δ-convergence at m = 3: dispersion is O(δ²); the tolerance is what the terms of fourth order leave at \
             these spacings",
        ),
        Row::new(
            "observed order of the displacement at the free end, 75 to 125 µs",
            2.0,
            order(|r| r.end_error),
            0.05,
            Measure::Absolute,
            "dispersion, O(δ²); the soft layer at the free end, of depth δ and with strains of order δ, adds O(δ³), \
             which the tolerance covers",
        ),
    ];
    rows.extend(runs.iter().map(|r| {
        Row::new(
            format!("relative l² error of the shape at 50 µs, h = {:.3e} m", r.spacing),
            15_f64.sqrt() * STATION * r.dispersion / WIDTH.powi(3),
            r.profile_error,
            0.05,
            Measure::Relative,
            "√15 c₀ t β/a³, the leading term of dispersion; the next one is of the order (δ/a)² of it, 0.14 at \
             h = 5 mm",
        )
    }));
    let plots = vec![
        ("wave-in-bar_end".to_string(), draw_plot(&end_plot(&runs), 1000, 640)),
        ("wave-in-bar_profile".to_string(), draw_plot(&profile_plot(&runs), 1000, 640)),
        ("wave-in-bar_order".to_string(), draw_plot(&order_plot(&runs), 900, 640)),
    ];
    let notes = vec![
        "The free end doubles the pulse and sends it back. Its error is twice that of the shape at 50 µs because the \
         pulse has run twice as far."
            .to_string(),
    ];
    Ok(Outcome { rows, plots, notes, ..Outcome::default() })
}

fn run(cells: u32) -> Result<Run> {
    let spacing = 2.0 * HALF / f64::from(cells);
    let end_time = 1.25 * HALF / SPEED;
    let dt = COURANT * spacing / SPEED;
    let mut simulation = simulation(&format!(
        r#"
[case]
title = "Pulse in a bar"
dimension = 1
[geometry]
shape = {{ segment = {{ low = {low:?}, high = {HALF:?} }} }}
spacing = {spacing:?}
[discretization]
horizon_ratio = {RATIO:?}
influence = "constant"
partial_volumes = "ramp"
[physics.elasticity]
law = {{ bond_based_linear = {{ young = {YOUNG:?}, density = {DENSITY:?} }} }}
[[conditions]]
on = "all"
initial = {{ displacement = {{ component = 0, value = "{AMPLITUDE:?}*exp(-(x/{WIDTH:?})^2)" }} }}
[solver.velocity_verlet]
end_time = {end_time:?}
time_step = {dt:?}
"#,
        low = -HALF,
    ))?;
    let xs: Vec<f64> = simulation.model.positions().iter().map(|x| x[0]).collect();
    let station = xs.partition_point(|&x| x < STATION);
    let exact = |x: f64, t: f64| dalembert(pulse, HALF, SPEED, x, t);
    let measured_at = (STATION / SPEED / dt).round() as u64;
    let (mut at_station, mut end, mut shape) = (Vec::new(), Vec::new(), None);
    simulation.model.start();
    while simulation.clock.step < simulation.n_steps {
        simulation.model.step(&simulation.solver, &mut simulation.clock)?;
        let (u, t) = (displacement(&mut simulation), simulation.clock.time());
        at_station.push((t, u[station]));
        end.push((t, u[u.len() - 1]));
        if simulation.clock.step == measured_at {
            shape = Some((t, u));
        }
    }
    let (t, u) = shape.expect("the run passes the time of measurement");
    let profile_error = relative_error(xs.iter().zip(&u).map(|(&x, &u)| (u, exact(x, t))));
    let right = || xs.iter().zip(&u).filter(|(x, _)| **x > 0.0);
    let centroid = right().map(|(x, u)| x * u).sum::<f64>() / right().map(|(_, u)| u).sum::<f64>();
    // The first crest: the pulse comes back from the end later than this run looks.
    let arrival = crest(&at_station);
    let dispersion = (RATIO * RATIO + 1.0) * spacing * spacing / 48.0 - (SPEED * dt).powi(2) / 24.0;
    let last = xs[xs.len() - 1];
    let window = end.iter().filter(|(t, _)| *t > 0.75 * HALF / SPEED);
    Ok(Run {
        spacing,
        profile_error,
        end_error: relative_error(window.map(|&(t, u)| (u, exact(last, t)))),
        centroid_speed: centroid / t,
        lag: arrival * SPEED / xs[station] - 1.0,
        dispersion,
        profile: xs.iter().copied().zip(u).collect(),
        end,
        end_at: last,
    })
}

/// A simulation from the text of a case: the whole road that a user's file takes.
pub(super) fn simulation(text: &str) -> Result<Simulation> {
    let case = read_text::<Case>("study", text, &[]).map_err(Error::Case)?;
    build(&case, &Options::default())
}

/// Displacement along x, by point.
pub(super) fn displacement(simulation: &mut Simulation) -> Vec<f64> {
    match simulation.model.field("displacement").map(|f| f.values) {
        Some(Values::Vector(u)) => u.iter().map(|u| u[0]).collect(),
        _ => unreachable!("every model has displacements"),
    }
}

/// √(Σ (obtained − exact)²/Σ exact²)
fn relative_error(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (difference, size) = pairs.fold((0.0, 0.0), |(d, s), (u, exact)| (d + (u - exact).powi(2), s + exact * exact));
    f64::sqrt(difference / size)
}

/// The time of the largest value, from the parabola through it and its neighbours.
fn crest(signal: &[(f64, f64)]) -> f64 {
    let largest = (1..signal.len() - 1).max_by(|&a, &b| signal[a].1.total_cmp(&signal[b].1)).unwrap_or(1);
    let [a, b, c] = [largest - 1, largest, largest + 1].map(|i| signal[i].1);
    let dt = signal[largest].0 - signal[largest - 1].0;
    signal[largest].0 + 0.5 * dt * (a - c) / (a - 2.0 * b + c)
}

fn end_plot(runs: &[Run]) -> Plot {
    let last = &runs[runs.len() - 1];
    let exact = last.end.iter().map(|&(t, _)| (t, dalembert(pulse, HALF, SPEED, last.end_at, t))).collect();
    let mut series = vec![Series { name: "d'Alembert".into(), points: exact, style: Style::Line }];
    for (run, style) in [(&runs[0], Style::Dots), (&runs[1], Style::Dots), (last, Style::Dashed)] {
        let name = format!("h = {:.3} mm", 1e3 * run.spacing);
        series.push(Series { name, points: run.end.clone(), style });
    }
    Plot {
        title: "Displacement of the free end of a bar that a pulse reaches".into(),
        x_label: "time [s]".into(),
        y_label: "displacement [m]".into(),
        x_range: Some((0.75 * HALF / SPEED, 1.25 * HALF / SPEED)),
        series,
        notes: vec!["δ = 3 h, constant influence; the free end doubles the pulse of 0.5 µm.".into()],
        ..Plot::default()
    }
}

fn profile_plot(runs: &[Run]) -> Plot {
    let last = &runs[runs.len() - 1];
    let t = STATION / SPEED;
    let exact = last.profile.iter().map(|&(x, _)| (x, dalembert(pulse, HALF, SPEED, x, t))).collect();
    let mut series = vec![Series { name: "d'Alembert".into(), points: exact, style: Style::Line }];
    for (run, style) in [(&runs[0], Style::Dots), (&runs[1], Style::Dots), (last, Style::Dashed)] {
        let name = format!("h = {:.3} mm", 1e3 * run.spacing);
        series.push(Series { name, points: run.profile.clone(), style });
    }
    Plot {
        title: "The right half of the pulse after 50 µs".into(),
        x_label: "x [m]".into(),
        y_label: "displacement [m]".into(),
        x_range: Some((0.1, 0.4)),
        series,
        ..Plot::default()
    }
}

fn order_plot(runs: &[Run]) -> Plot {
    let of = |error: fn(&Run) -> f64| runs.iter().map(|r| (r.spacing, error(r))).collect::<Vec<_>>();
    let finest = &runs[runs.len() - 1];
    let slope = runs.iter().map(|r| (r.spacing, 0.5 * finest.profile_error * (r.spacing / finest.spacing).powi(2)));
    Plot {
        title: "Refinement at δ = 3 h: pulse in a bar".into(),
        x_label: "spacing h (m)".into(),
        y_label: "relative error (-)".into(),
        log_x: true,
        log_y: true,
        series: vec![
            Series { name: "shape at 50 µs".into(), points: of(|r| r.profile_error), style: Style::LineDots },
            Series { name: "free end, 75 to 125 µs".into(), points: of(|r| r.end_error), style: Style::LineDots },
            Series { name: "lag of the crest".into(), points: of(|r| r.lag), style: Style::LineDots },
            Series { name: "h²".into(), points: slope.collect(), style: Style::Dashed },
        ],
        ..Plot::default()
    }
}
