//! `convergence-1d`: the three kinds of convergence of section 3 on the self-equilibrated bar, and the jumps of the
//! singular solution.
//!
//! Unit forces at ±a, a = 1, pull a free bar. Classically u = x between them and a beyond, equation (23); at any
//! horizon u = a far away, (24). On a grid of spacing h = δ/m the far displacement is a over the discrete modulus,
//! 1 − 1/m² (triangular), 1 (constant), 1 + 1/(2m²) (inverted), because the sum Σ k ξ² is all that long waves see.

use super::engine::EngineBar;
use super::grid::{Grid, Layout};
use super::micromodulus::Micromodulus;
use super::model::{Bar, Model, Rule};
use super::rate;
use crate::{Measure, Outcome, Row, Study};
use bondwise::error::Result;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};

pub const CONVERGENCE: Study = Study {
    name: "convergence-1d",
    about: "a bar pulled by two point forces: δ-, m- and (δm)-convergence, jumps of the singular solution",
    heavy: false,
    run: |_| study(&Micromodulus::ALL),
};

pub fn with_influence(_full: bool, micromodulus: Micromodulus) -> Result<Outcome> {
    study(&[micromodulus])
}

/// The equilibrium of a bar from −half to half with unit forces at ±1, `n` nodes per unit length and δ = m/n.
pub struct Pulled {
    pub grid: Grid,
    pub u: Vec<f64>,
    horizon: f64,
    m: f64,
}

impl Pulled {
    pub fn new<M: Model>(half: f64, n: f64, m: f64, micromodulus: Micromodulus) -> Self {
        let grid = Grid::uniform(Layout::Vertex, -half, half, (2.0 * half * n).round() as usize);
        let horizon = m / n;
        let model = M::new(&Bar::uniform(grid.clone(), horizon, micromodulus, Rule::Source));
        let mut load = vec![0.0; grid.count()];
        for side in [-1.0, 1.0] {
            let node = grid.nearest(side);
            load[node] = side / grid.volume(node);
        }
        let u = model.solve(&load);
        Self { grid, u, horizon, m }
    }

    /// The displacement at x.
    pub fn at(&self, x: f64) -> f64 {
        self.grid.interpolate(&self.u, x)
    }

    /// Displacement half way between the load and the end, less that of (24).
    fn far(&self) -> f64 {
        let half = self.grid.at[self.grid.count() - 1];
        self.at(0.5 * (1.0 + half)) - 1.0
    }

    /// Root mean square of u − reference over 0 ≤ x ≤ ½, over that of x.
    fn inside(&self, reference: impl Fn(f64) -> f64) -> f64 {
        let (mut off, mut size) = (0.0, 0.0);
        for (&x, &u) in self.grid.at.iter().zip(&self.u).filter(|(x, _)| (0.0..=0.5 + 1e-9).contains(*x)) {
            off += (u - reference(x)).powi(2);
            size += x * x;
        }
        (off / size).sqrt()
    }

    /// u at the loaded node over the mean of its neighbours.
    fn peak(&self) -> f64 {
        let node = self.grid.nearest(1.0);
        self.u[node] - 0.5 * (self.u[node - 1] + self.u[node + 1])
    }

    /// The jump of u across the node at x, from lines through the two nodes on either side of it.
    fn jump(&self, x: f64) -> f64 {
        let (node, u) = (self.grid.nearest(x), &self.u);
        (2.0 * u[node + 1] - u[node + 2]) - (2.0 * u[node - 1] - u[node - 2])
    }
}

fn study(which: &[Micromodulus]) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for &micromodulus in which {
        far_displacement(micromodulus, &mut outcome);
    }
    at_fixed_horizon(which, &mut outcome);
    at_fixed_ratio(which, &mut outcome);
    both(which, &mut outcome);
    if which.contains(&Micromodulus::Inverted) {
        jumps(&mut outcome);
    }
    outcome.notes.push(
        "The figures of section 3 give no numbers: everything here is compared with closed forms. At fixed m the \
         continuous micromodulus does not converge to the classical solution but to one with the modulus 1 − 1/m²; \
         the constant one does, because the rule happens to be exact for it."
            .into(),
    );
    Ok(outcome)
}

/// V-S4-2b
fn far_displacement(micromodulus: Micromodulus, outcome: &mut Outcome) {
    for (n, m) in [(10.0, 10.0), (20.0, 15.0), (30.0, 20.0), (40.0, 25.0)] {
        let bar = Pulled::new::<EngineBar>(10.0, n, m, micromodulus);
        outcome.rows.push(Row::new(
            format!("u(5) − a (%), {}, L = 20, N = {}, m = {m}", micromodulus.name(), bar.grid.count()),
            100.0 / micromodulus.discrete_modulus(m) - 100.0,
            100.0 * (bar.at(5.0) - 1.0),
            1e-4,
            Measure::Absolute,
            "a over the discrete modulus; what is left at x = 5 is the tail of the load, below 1e-6",
        ));
    }
}

const HALF: f64 = 3.0;

/// δ fixed, m → ∞: the non-local solution, here that of the finest grid.
fn at_fixed_horizon(which: &[Micromodulus], outcome: &mut Outcome) {
    let horizon = 0.4;
    let mut series = Vec::new();
    for &micromodulus in which {
        let run = |m: f64| Pulled::new::<EngineBar>(HALF, m / horizon, m, micromodulus);
        let finest = run(128.0);
        let errors: Vec<(f64, f64)> = [4.0, 8.0, 16.0, 32.0].map(|m| (m, run(m).inside(|x| finest.at(x)))).to_vec();
        let name = micromodulus.name();
        outcome.rows.push(Row::new(
            format!("m-convergence, rate in m, {name}"),
            2.0,
            rate(&errors),
            0.1,
            Measure::Absolute,
            "the midpoint rule over whole and cut cells; inside |x| ≤ ½ against m = 128, δ = 0.4; that grid's own \
             error is a sixteenth of that of m = 32",
        ));
        series.push(Series { name: name.into(), points: errors, style: Style::LineDots });
    }
    let slope = [4.0, 8.0, 16.0, 32.0].map(|m: f64| (m, 0.3 / (m * m))).to_vec();
    series.push(Series { name: "1/m²".into(), points: slope, style: Style::Dashed });
    plot(outcome, "m-convergence", "m-convergence at δ = 0.4: to the non-local solution", "m = δ/h (-)", series);
}

/// m fixed, δ → 0: the solution of a classical bar with the discrete modulus.
fn at_fixed_ratio(which: &[Micromodulus], outcome: &mut Outcome) {
    let m = 4.0;
    let mut series = Vec::new();
    for &micromodulus in which {
        let name = micromodulus.name();
        let modulus = micromodulus.discrete_modulus(m);
        let runs: Vec<Pulled> =
            [5.0, 10.0, 20.0, 40.0, 80.0].map(|n| Pulled::new::<EngineBar>(HALF, n, m, micromodulus)).into();
        let finest = &runs[runs.len() - 1];
        outcome.rows.push(Row::new(
            format!("δ-convergence at m = 4, {name}: relative error inside at δ = {}", finest.horizon),
            (1.0 / modulus - 1.0).abs(),
            finest.inside(|x| x),
            1e-5,
            Measure::Absolute,
            "that of the discrete modulus; the non-local part decays with δ",
        ));
        outcome.rows.push(Row::new(
            format!("δ-convergence at m = 4, {name}: peak at the load over δ, δ = {}", finest.horizon),
            runs[0].peak() / runs[0].horizon,
            finest.peak() / finest.horizon,
            1e-3,
            Measure::Relative,
            "(34): at fixed m the peak is δ m times a constant and is erased with δ",
        ));
        let points = runs.iter().map(|r| (r.horizon, r.inside(|x| x))).collect();
        series.push(Series { name: name.into(), points, style: Style::LineDots });
    }
    plot(outcome, "delta-convergence", "δ-convergence at m = 4: to a bar with the discrete modulus", "δ (-)", series);
}

/// δ → 0 and m → ∞, m faster than δ: δ m grows.
fn both(which: &[Micromodulus], outcome: &mut Outcome) {
    let path = [(4.0, 5.0), (9.0, 16.0), (16.0, 40.0), (36.0, 135.0), (64.0, 320.0)];
    let mut series = Vec::new();
    for &micromodulus in which {
        let name = micromodulus.name();
        let runs = path.map(|(m, n)| Pulled::new::<EngineBar>(HALF, n, m, micromodulus));
        let errors: Vec<_> = runs.iter().map(|r| (r.horizon, r.inside(|x| x))).collect();
        let far = runs.iter().map(|r| (r.m, r.far().abs())).collect::<Vec<_>>();
        if micromodulus != Micromodulus::Constant {
            outcome.rows.push(Row::new(
                format!("(δm)-convergence, rate of the far displacement in m, {name}"),
                2.0,
                rate(&far),
                0.05,
                Measure::Absolute,
                "discrete modulus, 1 − 1/m² or 1 + 1/(2m²)",
            ));
        }
        let last = &runs[runs.len() - 1];
        outcome.rows.push(Row::new(
            format!("(δm)-convergence, {name}: relative error inside at δ = 0.2, m = 64"),
            1e-3,
            last.inside(|x| x),
            0.0,
            Measure::AtMost,
            "converges to (23) inside; δm grows from 3.2 to 12.8 on the way",
        ));
        series.push(Series { name: name.into(), points: errors, style: Style::LineDots });
    }
    plot(
        outcome,
        "delta-m-convergence",
        "(δm)-convergence: m from 4 to 64, to the classical solution",
        "δ (-)",
        series,
    );
}

/// (29) to (34), inverted micromodulus: P = 6E/δ², C = 3E/δ³.
fn jumps(outcome: &mut Outcome) {
    let horizon = 0.4;
    for m in [16.0, 32.0, 64.0] {
        let bar = Pulled::new::<EngineBar>(HALF, m / horizon, m, Micromodulus::Inverted);
        let origin = "the paper's analysis of jumps; on the grid they are seen through cells of finite size, O(1/m²)";
        let tolerance = 1.0 / (m * m);
        let row = |what: &str, expected, obtained| {
            Row::new(format!("{what}, m = {m}"), expected, obtained, tolerance, Measure::Relative, origin)
        };
        outcome.rows.extend([
            row("(31), (34): peak at the load, δ m/6", horizon * m / 6.0, bar.peak()),
            row("(32): jump at x = δ − a", horizon / 12.0, bar.jump(horizon - 1.0)),
            row("(33): jump at x = δ + a", -horizon / 12.0, bar.jump(horizon + 1.0)),
        ]);
    }
}

fn plot(outcome: &mut Outcome, name: &str, title: &str, x_label: &str, series: Vec<Series>) {
    let plot = Plot {
        title: title.into(),
        x_label: x_label.into(),
        y_label: "relative error, |x| ≤ ½ (-)".into(),
        log_x: true,
        log_y: true,
        series,
        notes: vec!["Free bar of length 6, unit forces at ±1.".into()],
        ..Plot::default()
    };
    outcome.plots.push((name.into(), draw_plot(&plot, 900, 640)));
}
