//! `bar-7-nodes`: the system of seven nodes that the paper prints, and how it is conditioned.

use super::engine::EngineBar;
use super::grid::{Grid, Layout};
use super::micromodulus::Micromodulus;
use super::model::{Bar, Model, Rule};
use super::published;
use super::relaxation::{Damping, relax};
use super::singular_values::singular_values;
use crate::{Measure, Outcome, Row, Study};
use bondwise::error::Result;

pub const SEVEN_NODES: Study = Study {
    name: "bar-7-nodes",
    about: "the printed system of seven nodes: matrix, rank, condition; relaxation against the direct solve",
    heavy: false,
    run,
};

/// Section 2.3, constant micromodulus, δ = 2 Δx; the printed system is (26) times 2.
const PRINTED: [[f64; 7]; 7] = [
    [-1.25, 1.0, 0.25, 0.0, 0.0, 0.0, 0.0],
    [0.5, -1.75, 1.0, 0.25, 0.0, 0.0, 0.0],
    [0.25, 1.0, -2.5, 1.0, 0.25, 0.0, 0.0],
    [0.0, 0.25, 1.0, -2.5, 1.0, 0.25, 0.0],
    [0.0, 0.0, 0.25, 1.0, -2.5, 1.0, 0.25],
    [0.0, 0.0, 0.0, 0.25, 1.0, -1.75, 0.5],
    [0.0, 0.0, 0.0, 0.0, 0.25, 1.0, -1.25],
];

/// σ₁/σ₆ of the free matrix; condition number without row and column 4; with row 4 replaced by u₄ = 0.
fn expected(micromodulus: Micromodulus) -> [f64; 3] {
    match micromodulus {
        Micromodulus::Constant => [8.938, 9.382, 12.667],
        Micromodulus::Triangular => [15.049, 11.872, 17.240],
        Micromodulus::Inverted => [6.798, 8.599, 11.451],
    }
}

fn bar(micromodulus: Micromodulus) -> Bar {
    Bar::uniform(Grid::uniform(Layout::Vertex, 0.0, 6.0, 6), 2.0, micromodulus, Rule::Source)
}

fn run(_full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let matrix = doubled(Micromodulus::Constant);
    let off = (0..49).map(|k| (matrix[k / 7][k % 7] - PRINTED[k / 7][k % 7]).abs()).fold(0.0, f64::max);
    outcome.rows.push(Row::new(
        "largest difference of an entry from the printed matrix",
        0.0,
        off,
        1e-14,
        Measure::Absolute,
        "section 2.3, printed system; half cells at the ends, and of a cell whose node is at δ the half counts",
    ));
    for micromodulus in Micromodulus::ALL {
        conditioning(micromodulus, &mut outcome);
    }
    outcome.rows.extend([
        published("published condition number, constant", 2.8e4, condition(Micromodulus::Constant), CONDITION),
        published("published condition number, triangular", 0.7e4, condition(Micromodulus::Triangular), CONDITION),
        published("published condition number, inverted", 1e17, condition(Micromodulus::Inverted), CONDITION),
    ]);
    relaxation(&mut outcome);
    outcome.notes.push(
        "The published condition numbers cannot be reproduced. Rows sum to 0, so the matrix is singular for all three \
         micromoduli alike, and a finite condition number is round-off. Once the translation is fixed all three are \
         well conditioned, the inverted one best: it needs no dynamic relaxation."
            .into(),
    );
    Ok(outcome)
}

const CONDITION: &str = "section 2.3; obtained: σ₁/σ₇ of the singular matrix as computed, round-off only (1e300 for 0)";

fn doubled(micromodulus: Micromodulus) -> Vec<Vec<f64>> {
    let matrix = EngineBar::new(&bar(micromodulus)).matrix();
    matrix.iter().map(|row| row.iter().map(|a| 2.0 * a).collect()).collect()
}

fn condition(micromodulus: Micromodulus) -> f64 {
    let values = singular_values(&EngineBar::new(&bar(micromodulus)).matrix());
    values[0] / values[6].max(1e-300 * values[0])
}

fn conditioning(micromodulus: Micromodulus, outcome: &mut Outcome) {
    let name = micromodulus.name();
    let matrix = doubled(micromodulus);
    let values = singular_values(&matrix);
    let rank = values.iter().filter(|&&v| v > 1e-12 * values[0]).count();
    let of_ones = matrix.iter().map(|row| row.iter().sum::<f64>().abs()).fold(0.0, f64::max);
    let without: Vec<Vec<f64>> =
        (0..7).filter(|&i| i != 3).map(|i| (0..7).filter(|&j| j != 3).map(|j| matrix[i][j]).collect()).collect();
    let mut replaced = matrix;
    replaced[3] = vec![0.0; 7];
    replaced[3][3] = 1.0;
    let ratio = |values: Vec<f64>| values[0] / values[values.len() - 1];
    let [free, deleted, pinned] = expected(micromodulus);
    let own = "no published value; singular values by an independent computation (LAPACK), rounded to three decimals";
    let near = |what: &str, expected, obtained| {
        Row::new(format!("{what}, {name}"), expected, obtained, 1e-3, Measure::Absolute, own)
    };
    outcome.rows.extend([
        Row::new(format!("rank, {name}"), 6.0, rank as f64, 0.0, Measure::Absolute, "a free bar may be shifted"),
        Row::new(
            format!("|A (1, …, 1)|, {name}"),
            0.0,
            of_ones,
            1e-14,
            Measure::Absolute,
            "the shift is the null vector",
        ),
        near("σ₁/σ₆", free, values[0] / values[5]),
        near("condition, node 4 removed", deleted, ratio(singular_values(&without))),
        near("condition, row 4 replaced by u₄ = 0", pinned, ratio(singular_values(&replaced))),
    ]);
}

/// V-S4-9, for all micromoduli and both dampings.
fn relaxation(outcome: &mut Outcome) {
    let load = [0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0];
    for micromodulus in Micromodulus::ALL {
        let bar = bar(micromodulus);
        let solved = EngineBar::new(&bar).solve(&load);
        for damping in [Damping::Kinetic, Damping::Rayleigh] {
            let relaxed = relax::<EngineBar>(&bar, &load, damping, 1e-10, 10_000);
            let (difference, steps) = relaxed.map_or((f64::NAN, 0), |(u, n)| {
                (u.iter().zip(&solved).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max), n)
            });
            outcome.rows.push(Row::new(
                format!("relaxed less direct displacement, {}, {damping:?} ({steps} steps)", micromodulus.name()),
                0.0,
                difference,
                1e-6,
                Measure::Absolute,
                "the same equations; residual 1e-10 of the load, σ₆ is near 1",
            ));
        }
    }
}
