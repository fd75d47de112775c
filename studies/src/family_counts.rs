//! How many neighbours a point has: families as the program builds them, at the middle of a block.

use super::{Measure, Outcome, Row};
use bondwise::discretization::standard;
use bondwise::discretization::volume::PartialVolume;
use bondwise::error::Result;
use bondwise::family::{Body, BondStates};
use bondwise::geometry::{Cloud, Shape};

const ORIGIN: &str = "lattice points in the ball, counted by an independent script: |ξ| ≤ δ with whole cells, |ξ| < δ + h/2 with the ramp \
    of Shojaei et al. 2022, eq. (28); a count is exact";

pub fn run(_full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let (none, ramp) = (PartialVolume::None, PartialVolume::Ramp);
    let cases: [(PartialVolume, u32, usize, f64); 15] = [
        (none, 13, 2, 2.0),
        (none, 29, 2, 3.0),
        (none, 49, 2, 4.0),
        (none, 81, 2, 5.0),
        (none, 113, 2, 6.0),
        (none, 7, 3, 1.0),
        (none, 33, 3, 2.0),
        (none, 123, 3, 3.0),
        (none, 257, 3, 4.0),
        (ramp, 37, 2, 3.0),
        (ramp, 69, 2, 4.0),
        (ramp, 97, 2, 5.0),
        (ramp, 137, 2, 6.0),
        (ramp, 179, 3, 3.0),
        (ramp, 389, 3, 4.0),
    ];
    for (rule, expected, dimension, m) in cases {
        let found = if dimension == 2 { family_size::<2>(rule, m) } else { family_size::<3>(rule, m) };
        let what =
            format!("{dimension}D, partial volumes {}, m = {m}: points of a family, its source included", rule.name());
        outcome.rows.push(Row::new(what, f64::from(expected), f64::from(found), 0.0, Measure::Absolute, ORIGIN));
    }
    Ok(outcome)
}

fn family_size<const D: usize>(rule: PartialVolume, m: f64) -> u32 {
    let (body, middle) = block::<D>(rule, m);
    BondStates::whole(&body).per_point(&body)[middle] + 1
}

/// A block of unit cells whose middle point sees no surface, and the number of that point in point order.
pub(super) fn block<const D: usize>(rule: PartialVolume, m: f64) -> (Body<D>, usize) {
    let reach = rule.reach::<D>(1.0, m).ceil();
    let half = reach + 0.5;
    let cloud = Cloud::lattice(&Shape::Box { low: [-half; D], high: [half; D] }, 1.0, reach as usize + 1);
    let middle = cloud.n_points() / 2;
    (standard::body(cloud, m, rule), middle)
}
