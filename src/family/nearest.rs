//! The nearest other point of each point of a scattered cloud.

use super::families::PIECE;
use super::tree::{Bounds, FAN, Tree};
use crate::field::{Vector, difference, norm};
use crate::parallel;

/// Distance (m) and place in `positions` of the nearest other point of each; infinite of a point alone. Of several as near the
/// first. Quick where consecutive points are near each other, as along a curve.
pub fn nearest<const D: usize>(positions: &[Vector<D>]) -> Vec<(f64, u32)> {
    let tree = Tree::new(positions);
    let of = |i: usize| {
        let x = &positions[i];
        let distance = |j: usize| norm(&difference(&positions[j], x));
        let beside = [i.wrapping_sub(1), i + 1].into_iter().filter(|&j| j < positions.len());
        let bound = beside.map(distance).fold(f64::INFINITY, f64::min);
        let mut best = (f64::INFINITY, u32::MAX);
        tree.near(&Bounds::of_points(&[*x]), bound * bound * (1.0 + 1e-12), &mut |group| {
            for j in (group * FAN..(group + 1) * FAN).filter(|&j| j < positions.len() && j != i) {
                if distance(j) < best.0 {
                    best = (distance(j), j as u32);
                }
            }
        });
        best
    };
    let n = positions.len();
    let pieces =
        parallel::map_each(n.div_ceil(PIECE), &|k| (k * PIECE..((k + 1) * PIECE).min(n)).map(of).collect::<Vec<_>>());
    pieces.concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_of_all_pairs_is_found() {
        let scattered = |k: usize| ((k * 7919) % 1013) as f64 / 1013.0;
        for n in [1, 2, 9, 300] {
            let positions: Vec<Vector<2>> = (0..n).map(|i| [scattered(2 * i), scattered(3 * i + 1)]).collect();
            for (i, (distance, there)) in nearest(&positions).into_iter().enumerate() {
                let all = (0..n).filter(|&j| j != i).map(|j| norm(&difference(&positions[j], &positions[i])));
                assert_eq!(distance, all.fold(f64::INFINITY, f64::min));
                assert!(n == 1 || norm(&difference(&positions[there as usize], &positions[i])) == distance);
            }
        }
        let far = nearest(&[[0.0], [1e100], [-1e100]]);
        assert_eq!(far.iter().map(|(distance, _)| *distance).collect::<Vec<_>>(), [1e100; 3]);
    }
}
