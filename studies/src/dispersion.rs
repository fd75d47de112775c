//! `dispersion`: frequencies of plane waves in a bar against the exact relation of the nonlocal continuum.
//!
//! In space: a wave cos kx is put on a bar as initial displacement, and the frequency follows from one evaluation of
//! the force at the middle, whose family is complete: ρω² = −f/u. At fixed horizon this converges with the order of the
//! one-point rule, and the error itself is the leading term of Euler and Maclaurin.
//!
//! In time: the same wave is marched; away from the ends the middle then moves as cos ω′t, with
//! ω′Δt = 2 arcsin(ωΔt/2) for velocity Verlet, which is ω (1 + ω²Δt²/24 + …).

use super::exact::{bar_dispersion, bar_quadrature_error};
use super::wave::{displacement, simulation};
use super::{Measure, Outcome, Row, Study};
use bondwise::discretization::Influence;
use bondwise::error::Result;
use bondwise::field::Values;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::simulation::Simulation;

pub const DISPERSION: Study = Study {
    name: "dispersion",
    about: "frequencies of plane waves in a bar against the exact nonlocal relation, in space and in time",
    heavy: false,
    run: dispersion,
};

const INFLUENCES: [Influence; 3] = [Influence::Constant, Influence::Linear, Influence::Inverted];
const RATIOS: [u32; 4] = [4, 8, 16, 32];

/// E = ρ = δ = 1, so that ω and k have no units, c₀ = 1 and z = k.
fn bar(influence: &Influence, m: u32, half: u32, z: f64, time: &str) -> Result<Simulation> {
    let spacing = 1.0 / f64::from(m);
    simulation(&format!(
        r#"
[case]
title = "Plane wave in a bar"
dimension = 1
[geometry]
shape = {{ segment = {{ low = {low:?}, high = {high:?} }} }}
spacing = {spacing:?}
[discretization]
horizon = 1.0
influence = "{name}"
partial_volumes = "exact"
[physics.elasticity]
law = {{ bond_based_linear = {{ young = 1.0, density = 1.0 }} }}
[[conditions]]
on = "all"
initial = {{ displacement = {{ component = 0, value = "cos({z:?}*x)" }} }}
[solver.velocity_verlet]
{time}
"#,
        // An odd number of cells: one point sits at the crest x = 0.
        low = -(f64::from(half) + 0.5) * spacing,
        high = (f64::from(half) + 0.5) * spacing,
        name = influence.name(),
    ))
}

/// ρω²/(E k²) from the force at the middle of a bar of four horizons.
fn obtained(influence: &Influence, m: u32, z: f64) -> Result<f64> {
    let mut simulation = bar(influence, m, 2 * m, z, "end_time = 1.0")?;
    simulation.model.start();
    let middle = 2 * m as usize;
    match simulation.model.field("force").map(|f| f.values) {
        Some(Values::Vector(force)) => Ok(-force[middle][0] / (displacement(&mut simulation)[middle] * z * z)),
        _ => unreachable!("every model has forces"),
    }
}

fn dispersion(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let n = if full { 120 } else { 24 };
    let zs: Vec<f64> = (0..n).map(|i| 0.1 + 5.9 * f64::from(i) / f64::from(n - 1)).collect();
    let mut curves = Vec::new();
    let mut errors = Vec::new();
    for influence in &INFLUENCES {
        let exact = |z: f64| bar_dispersion(influence, z).expect("all three have closed forms");
        let mut largest = Vec::new();
        for m in RATIOS {
            let mut worst = 0.0_f64;
            for &z in &zs {
                worst = worst.max((obtained(influence, m, z)? / exact(z) - 1.0).abs());
            }
            largest.push((f64::from(m), worst));
        }
        let name = influence.name();
        let m = f64::from(RATIOS[3]);
        let predicted = zs
            .iter()
            .map(|&z| bar_quadrature_error(influence, z, m).expect("all three have closed forms").abs())
            .fold(0.0, f64::max);
        outcome.rows.push(Row::new(
            format!("{name}: observed order of ρω² in h at fixed δ, m = 16 to 32"),
            2.0,
            (largest[2].1 / largest[3].1).log2(),
            0.02,
            Measure::Absolute,
            "the one-point rule with exact volumes is the trapezoidal rule; what it leaves is of order h⁴, z²/(60 m²) \
             of the error at most",
        ));
        outcome.rows.push(Row::new(
            format!("{name}: largest relative error of ρω² over 0.1 ≤ kδ ≤ 6, m = {m}"),
            predicted,
            largest[3].1,
            0.02,
            Measure::Relative,
            "leading term of Euler and Maclaurin, (h²/12)[F′(δ) − F′(0)], about the exact relation; the next term is \
             z²/(60 m²) of it at most",
        ));
        let line = (1..=300).map(|i| 0.02 * f64::from(i)).map(|z| (z, z * exact(z).sqrt())).collect();
        curves.push(Series { name: format!("{name}, exact"), points: line, style: Style::Line });
        let mut dots = Vec::new();
        for &z in &zs {
            dots.push((z, z * obtained(influence, RATIOS[3], z)?.sqrt()));
        }
        curves.push(Series { name: format!("{name}, m = {m}"), points: dots, style: Style::Dots });
        errors.push(Series { name: name.to_string(), points: largest, style: Style::LineDots });
    }
    curves.push(Series { name: "classical".into(), points: vec![(0.0, 0.0), (6.0, 6.0)], style: Style::Dashed });
    let slope = RATIOS.map(|m| (f64::from(m), 0.25 / f64::from(m * m))).to_vec();
    errors.push(Series { name: "1/m²".into(), points: slope, style: Style::Dashed });
    let marched = march(full, &mut outcome)?;
    let plot = Plot {
        title: "Plane waves in a bar: frequency over wave number".into(),
        x_label: "wave number kδ (-)".into(),
        y_label: "frequency ωδ/c₀ (-)".into(),
        x_range: Some((0.0, 6.2)),
        y_range: Some((0.0, 6.2)),
        series: curves,
        ..Plot::default()
    };
    outcome.plots.push(("dispersion".into(), draw_plot(&plot, 1000, 760)));
    let plot = Plot {
        title: "Largest error of ρω² over 0.1 ≤ kδ ≤ 6 at fixed δ".into(),
        x_label: "horizon ratio m = δ/h (-)".into(),
        y_label: "relative error (-)".into(),
        log_x: true,
        log_y: true,
        series: errors,
        ..Plot::default()
    };
    outcome.plots.push(("dispersion_order".into(), draw_plot(&plot, 900, 640)));
    outcome.plots.push(("dispersion_time".into(), draw_plot(&marched, 900, 640)));
    Ok(outcome)
}

/// The frequency of a time signal, for steps that are halved.
fn march(full: bool, outcome: &mut Outcome) -> Result<Plot> {
    let (influence, m, z) = (Influence::Constant, 8, 2.0);
    let periods = if full { 40.0 } else { 10.0 };
    let omega = z * obtained(&influence, m, z)?.sqrt();
    let duration = periods * std::f64::consts::TAU / omega;
    // What the ends do runs inwards at c₀ = 1 at most; a few horizons more for the faint waves ahead of it.
    let half = (1.3 * duration + 20.0).ceil() as u32 * m;
    let mut shifts = Vec::new();
    for safety in [0.8, 0.4, 0.2, 0.1] {
        let mut bar = bar(&influence, m, half, z, &format!("end_time = {duration:?}\nsafety = {safety:?}"))?;
        let middle = half as usize;
        let mut signal = vec![displacement(&mut bar)[middle]];
        bar.model.start();
        while bar.clock.step < bar.n_steps {
            bar.model.step(&bar.solver, &mut bar.clock)?;
            signal.push(displacement(&mut bar)[middle]);
        }
        let dt = bar.clock.dt;
        shifts.push((omega * dt, frequency(&signal, dt) / omega - 1.0));
    }
    for &(step, shift) in &shifts {
        outcome.rows.push(Row::new(
            format!("frequency of the marched wave over ω, ω Δt = {step:.4}"),
            2.0 * (0.5 * step).asin() / step,
            1.0 + shift,
            1e-10,
            Measure::Relative,
            "velocity Verlet on a harmonic oscillator: 2 arcsin(ωΔt/2)/(ωΔt), with ω of the discrete operator; the \
             tolerance is round-off of ω²Δt² and what is felt of the ends",
        ));
    }
    let [.., (_, coarse), (step, fine)] = shifts[..] else { unreachable!("four steps") };
    outcome.rows.push(Row::new(
        "observed order of the frequency in Δt",
        2.0,
        (coarse / fine).log2(),
        0.01,
        Measure::Absolute,
        "velocity Verlet is of second order; the next term is 9/80 of ω²Δt² of the shift",
    ));
    outcome.rows.push(Row::new(
        format!("shift of the frequency over ω²Δt²/24, ω Δt = {step:.4}"),
        1.0,
        fine / (step * step / 24.0),
        0.01,
        Measure::Relative,
        "leading term; the next one is 9/80 of ω²Δt²",
    ));
    let line = shifts.iter().map(|&(step, _)| (step, step * step / 24.0)).collect();
    Ok(Plot {
        title: "Shift of the frequency by velocity Verlet, kδ = 2".into(),
        x_label: "time step ωΔt (-)".into(),
        y_label: "ω′/ω − 1 (-)".into(),
        log_x: true,
        log_y: true,
        series: vec![
            Series { name: "(ωΔt)²/24".into(), points: line, style: Style::Line },
            Series { name: "obtained".into(), points: shifts, style: Style::Dots },
        ],
        ..Plot::default()
    })
}

/// ω of a signal cos ωnΔt: from u(n+1) + u(n−1) = 2 cos(ωΔt) u(n) in the least-squares sense, written with the second
/// difference so that small steps lose no digits.
fn frequency(signal: &[f64], dt: f64) -> f64 {
    let (mut bent, mut size) = (0.0, 0.0);
    for w in signal.windows(3) {
        bent -= (w[2] - w[1] - (w[1] - w[0])) * w[1];
        size += w[1] * w[1];
    }
    // 2 − 2 cos ωΔt = 4 sin²(ωΔt/2)
    2.0 * (0.5 * (bent / size).sqrt()).asin() / dt
}
