//! One-dimensional peridynamics by itself: convergence, refinement and scaling as in Bobaru, Yang, Alves, Silling,
//! Askari & Xu 2009, Int. J. Numer. Meth. Engng 77, 852-877.
//!
//! Nodes with cells of any size and a horizon at each; E = A = ρ = 1 as in the paper, lengths and times have no unit.
//!
//! `grid`, `micromodulus` and `model` say what a bar is, `engine` computes it with the engine, `adaptive` and
//! `relaxation` are methods of the paper. The studies: `seven_nodes`, `convergence`, `placement` (Tables I, II), `pulse`
//! (Tables III, IV), `following` (Table V). In tests, `oracle` computes the same bars and studies by a plain model of its
//! own, and the figures are compared.

mod adaptive;
mod convergence;
mod engine;
mod following;
mod grid;
mod micromodulus;
mod model;
#[cfg(test)]
mod oracle;
mod placement;
mod pulse;
mod relaxation;
mod seven_nodes;
mod singular_values;

pub use micromodulus::Micromodulus;

pub(super) use convergence::CONVERGENCE;
pub(super) use following::TABLE_5;
pub(super) use placement::{TABLE_1, TABLE_2};
pub(super) use pulse::{TABLE_3, TABLE_4};
pub(super) use seven_nodes::SEVEN_NODES;

use super::{Measure, Outcome, Row};
use bondwise::error::Result;

/// Studies that run for one micromodulus alone, if asked to.
#[expect(clippy::type_complexity, reason = "a table of names and functions")]
pub(super) const WITH_INFLUENCE: &[(&str, fn(bool, Micromodulus) -> Result<Outcome>)] =
    &[(CONVERGENCE.name, convergence::with_influence), (TABLE_4.name, pulse::table_4_with_influence)];

/// A printed value that is not judged.
fn published(what: impl Into<String>, expected: f64, obtained: f64, origin: &str) -> Row {
    Row::new(what, expected, obtained, 0.0, Measure::Information, origin)
}

/// −d log y/d log x, the line of least squares.
pub(crate) fn rate(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs = || points.iter().map(|(x, y)| (x.ln(), y.ln()));
    let (mean_x, mean_y) = (logs().map(|p| p.0).sum::<f64>() / n, logs().map(|p| p.1).sum::<f64>() / n);
    let (mut above, mut below) = (0.0, 0.0);
    for (x, y) in logs() {
        above += (x - mean_x) * (y - mean_y);
        below += (x - mean_x).powi(2);
    }
    -above / below
}

#[cfg(test)]
mod tests {
    use super::rate;

    /// V-S4-3: the rates that the paper prints are those of its tables.
    #[test]
    fn printed_rates_follow_from_printed_tables() {
        let n = [201.0, 401.0, 601.0, 801.0];
        let table_1: [([f64; 4], f64); 4] = [
            ([0.903, 0.378, 0.253, 0.175], 1.175),
            ([1.003, 0.309, 0.158, 0.079], 1.800),
            ([0.428, 0.159, 0.123, 0.079], 1.179),
            ([0.380, 0.072, 0.047, 0.020], 2.040),
        ];
        for (errors, printed) in table_1 {
            let points: Vec<_> = n.into_iter().zip(errors).collect();
            assert!((rate(&points) - printed).abs() < 0.01, "{}", rate(&points));
        }
        let uniform = [(201.0, 3.375), (401.0, 1.025), (601.0, 0.516), (801.0, 0.259)];
        assert!((rate(&uniform) - 1.822).abs() < 0.01);
        let arrivals = [(451.0, 6.65), (901.0, 2.49), (1351.0, 1.70), (2701.0, 0.80), (3001.0, 0.53)];
        assert!((rate(&arrivals) - 1.245).abs() < 0.01);
    }
}
