//! `table-3` and `table-4`: half a Gaussian at the free end of a bar, and its arrival elsewhere.
//!
//! u₀ = 0.02 exp(−0.01 x²), x ≥ 0, at rest: the half that runs to the left comes back from the free end at once, so
//! that a pulse of half the height, 0.01, runs to the right with the speed 1. Runge-Kutta, Δt = 0.15, vertex nodes with
//! half cells at the ends, exact parts of cells.

use rayon::prelude::*;

use super::engine::EngineBar;
use super::grid::{Grid, Layout};
use super::micromodulus::Micromodulus;
use super::model::{Bar, Model, Motion, Rule};
use super::{published, rate};
use crate::{Measure, Outcome, Row, Study};
use bondwise::error::Result;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};

pub const TABLE_3: Study = Study {
    name: "table-3",
    about: "a pulse reflected where the spacing of a 1D bar changes and its horizon does not",
    heavy: false,
    run: |_| Ok(table_3::<EngineBar>()),
};

pub const TABLE_4: Study = Study {
    name: "table-4",
    about: "arrival and height of a pulse on uniform 1D grids, to the printed digits",
    heavy: false,
    run: |_| Ok(table_4::<EngineBar>(Micromodulus::Triangular)),
};

pub(super) const STEP: f64 = 0.15;
/// Height of the travelling pulse.
pub(super) const HEIGHT: f64 = 0.01;

pub(super) fn half_gaussian(x: f64) -> f64 {
    2.0 * HEIGHT * (-0.01 * x * x).exp()
}

/// What the node next to a place sees.
#[derive(Debug, Clone, Default)]
pub(super) struct Record {
    /// (t, u) after every step.
    pub signal: Vec<(f64, f64)>,
}

impl Record {
    /// Time and value of the largest u between two times.
    pub fn peak(&self, from: f64, to: f64) -> (f64, f64) {
        let within = self.signal.iter().filter(|(t, _)| (from..to).contains(t));
        within.fold((0.0, 0.0), |most: (f64, f64), &(t, u)| if u > most.1 { (t, u) } else { most })
    }
}

fn march<M: Model>(bar: &Bar, probe: f64, until: f64) -> Record {
    let (mut model, node) = (M::new(bar), bar.grid.nearest(probe));
    let mut motion = Motion::released(bar.grid.at.iter().map(|&x| half_gaussian(x)).collect());
    let mut record = Record::default();
    for step in 1..=(until / STEP) as u32 {
        model.step(&mut motion, STEP);
        record.signal.push((f64::from(step) * STEP, motion.u[node]));
    }
    record
}

/// Arrival and height at x = 400 on a uniform grid of the bar of length 450.
pub(super) fn uniform<M: Model>(intervals: usize, horizon: f64, micromodulus: Micromodulus) -> (f64, f64) {
    let grid = Grid::uniform(Layout::Vertex, 0.0, 450.0, intervals);
    let bar = Bar::uniform(grid, horizon, micromodulus, Rule::Source);
    march::<M>(&bar, 400.0, 440.0).peak(0.0, 440.0)
}

/// Nodes, horizon; published arrival and height.
const UNIFORM: [(usize, f64, f64, f64); 5] = [
    (451, 3.0, 426.60, 0.00970),
    (901, 2.5, 409.95, 0.00982),
    (1351, 2.0, 406.80, 0.00991),
    (2701, 1.5, 403.20, 0.00997),
    (3001, 1.4, 402.15, 0.00998),
];

pub fn table_4_with_influence(_full: bool, micromodulus: Micromodulus) -> Result<Outcome> {
    Ok(table_4::<EngineBar>(micromodulus))
}

pub(super) fn table_4<M: Model>(micromodulus: Micromodulus) -> Outcome {
    let mut outcome = Outcome::default();
    let (mut times, mut heights, mut foreseen) = (Vec::new(), Vec::new(), Vec::new());
    let judged = micromodulus == Micromodulus::Triangular;
    let found: Vec<(f64, f64)> =
        UNIFORM.par_iter().map(|(n, horizon, ..)| uniform::<M>(n - 1, *horizon, micromodulus)).collect();
    for ((n, horizon, arrival, height), (t, u)) in UNIFORM.into_iter().zip(found) {
        let label = format!("N = {n}, δ = {horizon}");
        let measure = if judged { Measure::Absolute } else { Measure::Information };
        outcome.rows.extend([
            Row::new(
                format!("arrival at x = 400, {label}"),
                arrival,
                t,
                1e-9,
                measure,
                "Table IV, triangular; printed arrivals are whole steps of 0.15",
            ),
            Row::new(
                format!("height there, {label}"),
                height,
                u,
                1e-5,
                measure,
                "Table IV, triangular; one unit of the last printed digit: the paper cuts some digits and rounds others",
            ),
        ]);
        let slower = micromodulus.discrete_modulus(horizon * (n - 1) as f64 / 450.0).powf(-0.5);
        if horizon == 1.4 {
            outcome.rows.push(Row::new(
                format!("arrival, against that by the discrete modulus, {label}"),
                400.0 * slower,
                t,
                5e-3,
                Measure::Relative,
                "dispersion of a pulse 10 wide at a horizon of 1.4, and δ/h = 9.33, which is not whole",
            ));
        }
        foreseen.push((n as f64, (slower - 1.0).abs()));
        times.push((n as f64, (t / 400.0 - 1.0).abs()));
        heights.push((n as f64, (1.0 - u / HEIGHT).abs()));
    }
    if judged {
        let origin = "section 6.2.2, line through the logarithms";
        outcome.rows.extend([
            Row::new("rate in N of the error of arrival", 1.245, rate(&times), 0.01, Measure::Absolute, origin),
            Row::new("rate in N of the error of height", 1.371, rate(&heights), 0.01, Measure::Absolute, origin),
        ]);
    }
    outcome.notes.push(
        "Most of the error of arrival is the modulus of the quadrature (dashed line), 1 − 1/m² if triangular; the rest is \
         dispersion. The printed horizons are used: 21 and 23 nodes \"inside the horizon\" are not 2δ/h + 1, which is 19 and 19.7."
            .into(),
    );
    let line = |name: &str, points, style| Series { name: name.into(), points, style };
    let plot = Plot {
        title: format!("Table IV: a pulse on uniform grids, {}", micromodulus.name()),
        x_label: "nodes (-)".into(),
        y_label: "relative error at x = 400 (-)".into(),
        log_x: true,
        log_y: true,
        series: vec![
            line("arrival", times, Style::LineDots),
            line("height", heights, Style::LineDots),
            line("arrival by the discrete modulus", foreseen, Style::Dashed),
        ],
        ..Plot::default()
    };
    outcome.plots.push(("errors".into(), draw_plot(&plot, 900, 640)));
    outcome
}

/// Micromodulus, refinement of the middle third; published arrival and height of the reflection.
const REFLECTIONS: [(&str, Micromodulus, usize, f64, f64); 4] = [
    ("a", Micromodulus::Constant, 2, 252.15, 1.169e-4),
    ("a", Micromodulus::Triangular, 2, 249.15, 0.0844e-4),
    ("b", Micromodulus::Constant, 4, 252.30, 3.3557e-4),
    ("b", Micromodulus::Triangular, 4, 252.30, 1.4945e-4),
];

pub(super) fn table_3<M: Model>() -> Outcome {
    let mut outcome = Outcome::default();
    let mut series = Vec::new();
    let records: Vec<Record> = REFLECTIONS
        .par_iter()
        .map(|(_, micromodulus, factor, ..)| {
            let grid = Grid::zones(Layout::Vertex, 0.0, &[(100.0, 500), (200.0, 500 * factor), (300.0, 500)]);
            let bar = Bar::uniform(grid, 0.5, *micromodulus, Rule::Source);
            // The pulse passes at 150 and reaches the far end at 300; between them only what is reflected comes by.
            march::<M>(&bar, 150.0, 270.0)
        })
        .collect();
    for ((case, micromodulus, _, arrival, height), record) in REFLECTIONS.into_iter().zip(records) {
        let (t, u) = record.peak(225.0, 268.0);
        let label = format!("({case}) {}", micromodulus.name());
        outcome.rows.extend([
            Row::new(
                format!("log2 of the reflected height over the published one, {label}"),
                0.0,
                (u / height).log2(),
                1.0,
                Measure::Absolute,
                "Table III, a factor 2: how the cells at the change of spacing are cut is not published",
            ),
            published(format!("reflected height at x = 150 (1e-4), {label}"), 1e4 * height, 1e4 * u, "Table III"),
            Row::new(
                format!("its arrival, {label}"),
                arrival,
                t,
                2.0 * STEP + 1e-9,
                Measure::Absolute,
                "Table III, two steps of 0.15; 250 would be that of the crest of the pulse",
            ),
        ]);
        let late = record.signal.into_iter().filter(|(t, _)| (225.0..270.0).contains(t)).collect();
        series.push(Series { name: label, points: late, style: Style::Line });
    }
    outcome.notes.push(
        "Not reproduced to the digit: reflected heights are 1e-4 of the displacement and depend on how the cells at the \
         change of spacing are cut. With the dual rule they are 1.02, 0.085, 1.02 and 0.80 (1e-4). (a) triangular is the \
         nearest, since there the source rule changes nothing; what comes back has the shape of the derivative of the \
         pulse, as deep as high. The fifth printed column, in percent of the main pulse of 0.01, repeats the height."
            .into(),
    );
    let plot = Plot {
        title: "Table III: what comes back from x = 200, seen at x = 150".into(),
        x_label: "time (-)".into(),
        y_label: "displacement (-)".into(),
        series,
        notes: vec!["Horizon 0.5 everywhere; (a) middle third twice, (b) four times as dense.".into()],
        ..Plot::default()
    };
    outcome.plots.push(("reflection".into(), draw_plot(&plot, 1000, 640)));
    outcome
}
