//! Ties: points that lie on the border of what selects them, but for rounding.

/// Lengths below this share of the side of a point's cell count as none wherever geometry is asked about points: the borders of
/// shapes, boxes and layers belong to them, and of places that are equally far the lowest is the nearest.
///
/// Positions and bounds may be written with few digits. Where rounding is below 1 % of the side in each coordinate of both, they
/// are apart by less than √3/100 in 3D, and by less than 2 % along an axis. The share is above that, and far below the half
/// side by which points of cells lie off anything that was meant to pass between them.
pub const TIE: f64 = 1.0 / 40.0;

/// The nearest of some places: their indices and distances, with their coordinates. Of those that are equally far but for a
/// `tie` (m), the lowest in x, then in y, then in z.
pub fn nearest<const D: usize>(
    candidates: impl Iterator<Item = (usize, f64, [f64; D])> + Clone,
    tie: f64,
) -> Option<usize> {
    let least = candidates.clone().map(|(_, distance, _)| distance).fold(f64::INFINITY, f64::min);
    let mut left: Vec<_> = candidates.filter(|(_, distance, _)| *distance <= least + tie).collect();
    for d in 0..D {
        let lowest = left.iter().map(|(_, _, x)| x[d]).fold(f64::INFINITY, f64::min);
        left.retain(|(_, _, x)| x[d] <= lowest + tie);
    }
    left.first().map(|(index, ..)| *index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_equally_near_places_the_lowest_is_taken() {
        let h = 1e-3;
        for shift in [-1e-3 * h, 0.0, 1e-3 * h] {
            let at = [0.0 + shift, 0.0 - shift];
            let places = [[0.5, 0.5], [0.5, -0.5], [-0.5, 0.5], [-0.5, -0.5]].map(|x| x.map(|x| x * h));
            let far = |x: &[f64; 2]| (x[0] - at[0]).hypot(x[1] - at[1]);
            let all = places.iter().enumerate().map(|(k, x)| (k, far(x), *x));
            assert_eq!(nearest(all, TIE * h), Some(3));
        }
        assert_eq!(nearest(std::iter::empty::<(usize, f64, [f64; 1])>(), 1.0), None);
    }
}
