//! Collocation points: those of the family that are nearest to the points of an auxiliary grid.
//!
//! Shojaei et al. 2022, Remark 2. The auxiliary grid is Cartesian and centred at the source; its points within k spacings
//! of δ/k are asked for. Ties are broken by what mirroring leaves alone, so that a symmetric family has a symmetric
//! support: an asymmetric one costs an order of magnitude (1D) and makes motion grow (2D).

use crate::discretization::volume::RIM_TOLERANCE;
use crate::field::{Vector, difference, norm};

/// All integer points with |k| ≤ radius, in lexicographic order.
pub fn ball<const D: usize>(radius: f64) -> Vec<[i32; D]> {
    let limit = radius * (1.0 + RIM_TOLERANCE);
    let most = limit as i32;
    let side = (2 * most + 1) as usize;
    (0..side.pow(D as u32))
        .map(|k| std::array::from_fn(|d| (k / side.pow((D - 1 - d) as u32) % side) as i32 - most))
        .filter(|point: &[i32; D]| norm(&point.map(f64::from)) <= limit)
        .collect()
}

/// The auxiliary grid whose number of points, with the source, is nearest to `asked`, the larger of two: its points but
/// the source, in units of δ.
///
/// | D | numbers |
/// |---|---|
/// | 1 | 3, 5, 7, 9, 11, 13, … |
/// | 2 | 5, 13, 29, 49, 81, … |
/// | 3 | 7, 33, 123, 257, … |
pub fn auxiliary_grid<const D: usize>(asked: usize) -> Vec<Vector<D>> {
    let k = radius::<D>(asked);
    let spacing = 1.0 / f64::from(k);
    let away = ball::<D>(f64::from(k)).into_iter().filter(|point| *point != [0; D]);
    away.map(|point| point.map(|i| f64::from(i) * spacing)).collect()
}

/// Numbers of points of that grid and of the grids with one spacing to the rim less and more.
pub fn neighbouring_grids<const D: usize>(asked: usize) -> Vec<usize> {
    let k = radius::<D>(asked);
    (k.saturating_sub(1).max(1)..=k + 1).map(|k| ball::<D>(f64::from(k)).len()).collect()
}

/// Spacings from the source to the rim.
fn radius<const D: usize>(asked: usize) -> u32 {
    let off = |k: u32| ball::<D>(f64::from(k)).len().abs_diff(asked);
    let mut k = 1;
    while off(k + 1) <= off(k) {
        k += 1;
    }
    k
}

/// Indices, ascending, of the points of the family nearest to those of the grid. Both in units of δ.
///
/// The source is a candidate too, and not listed. Of several that are nearest, the farthest from the source is taken;
/// of several such, all.
pub fn nearest<const D: usize>(family: &[Vector<D>], grid: &[Vector<D>]) -> Vec<usize> {
    let mut chosen = vec![false; family.len()];
    let mut distances = vec![0.0; family.len()];
    for point in grid {
        let mut least = norm(point);
        for (distance, xi) in distances.iter_mut().zip(family) {
            *distance = norm(&difference(xi, point));
            least = least.min(*distance);
        }
        let ties = || (0..family.len()).filter(|&j| distances[j] <= least + RIM_TOLERANCE);
        let farthest = ties().fold(0.0, |most: f64, j| most.max(norm(&family[j])));
        for j in ties().filter(|&j| norm(&family[j]) >= farthest - RIM_TOLERANCE) {
            chosen[j] = true;
        }
    }
    (0..family.len()).filter(|&j| chosen[j]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_have_the_published_sizes() {
        for asked in [3, 5, 11, 13] {
            assert_eq!(auxiliary_grid::<1>(asked).len() + 1, asked);
        }
        for asked in [5, 13, 29, 49] {
            assert_eq!(auxiliary_grid::<2>(asked).len() + 1, asked);
        }
        for asked in [7, 33, 123, 257] {
            assert_eq!(auxiliary_grid::<3>(asked).len() + 1, asked);
        }
        assert_eq!(auxiliary_grid::<2>(30).len() + 1, 29);
        assert_eq!(auxiliary_grid::<2>(21).len() + 1, 29, "the larger of two");
    }

    #[test]
    fn ties_on_a_line_are_rounded_away_from_the_source() {
        // m = 33, five points: ±16.5 h becomes ±17 h.
        let family: Vec<[f64; 1]> = (-33..=33).filter(|i| *i != 0).map(|i| [f64::from(i) / 33.0]).collect();
        let steps: Vec<f64> = nearest(&family, &auxiliary_grid::<1>(5)).iter().map(|&j| 33.0 * family[j][0]).collect();
        let expected = [-33.0, -17.0, 17.0, 33.0];
        assert!(steps.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{steps:?}");
    }

    #[test]
    fn what_lies_equally_near_and_far_is_taken_together() {
        let family = [[0.5, 0.1], [0.5, -0.1], [0.0, 0.9], [-0.1, -0.1]];
        assert_eq!(nearest(&family, &[[0.5, 0.0]]), [0, 1]);
        // The source is nearest: nothing is added.
        assert!(nearest(&family, &[[0.05, 0.0]]).is_empty());
    }
}
