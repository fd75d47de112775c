//! Values on a surface from points beside it: a linear fit by weighted least squares.
//!
//! The value at a place is Σ φ_i u_i over the points near it, with Σ φ_i = 1 and Σ φ_i x_i the place itself. So a force that acts
//! on the value there is spread over the points as φ_i, with the same sum and the same moments.

use std::array::from_fn;
use std::collections::HashMap;

use super::{Crack, Piece, Shape, TIE, tie};
use crate::field::Vector;

/// How far a point of a fit is from the place, in sides of cells.
const REACH: f64 = 2.0;
/// What it may be where points within that distance lie in a line or a plane.
const FARTHEST: f64 = 4.0;
/// Pivots below this share of the weights mean that all points lie in a line or a plane.
const FLAT: f64 = 1e-6;
/// Sums are taken in whole multiples of these: their order does not matter, and mirrored points have mirrored fits.
const PLACES: f64 = (1u64 << 44) as f64;
const WEIGHTS: f64 = (1u64 << 20) as f64;
const SHARES: f64 = (1u64 << 50) as f64;

/// Finds fits among the points of a body.
pub struct Fits<'a, const D: usize> {
    positions: &'a [Vector<D>],
    /// Of the cell of each, m.
    sides: &'a [f64],
    shape: Option<&'a Shape<D>>,
    cracks: &'a [Crack<D>],
    /// Side of the boxes in which points are looked up, m, and what is in them.
    pitch: f64,
    boxes: HashMap<[i64; D], Vec<u32>>,
}

impl<'a, const D: usize> Fits<'a, D> {
    /// Points of a body that fills `shape`, if it is known, and is cut by cracks.
    pub fn new(
        positions: &'a [Vector<D>],
        sides: &'a [f64],
        shape: Option<&'a Shape<D>>,
        cracks: &'a [Crack<D>],
    ) -> Self {
        let pitch = 2.0 * sides.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let mut boxes: HashMap<[i64; D], Vec<u32>> = HashMap::new();
        for (k, x) in positions.iter().enumerate() {
            boxes.entry(x.map(|x| (x / pitch).floor() as i64)).or_default().push(k as u32);
        }
        Fits { positions, sides, shape, cracks, pitch, boxes }
    }

    /// Points within a distance of a place, with their distances, ascending by index.
    pub fn near(&self, place: &Vector<D>, distance: f64) -> Vec<(usize, f64)> {
        let cells = (distance / self.pitch).ceil() as i64;
        let middle = place.map(|x| (x / self.pitch).floor() as i64);
        let mut found = Vec::new();
        let width = 2 * cells + 1;
        for k in 0..width.pow(D as u32) {
            let cell = from_fn(|d| middle[d] - cells + k / width.pow(d as u32) % width);
            for &point in self.boxes.get(&cell).map_or(&[][..], |list| list) {
                let far = gap(place, &self.positions[point as usize]);
                if far <= distance {
                    found.push((point as usize, far));
                }
            }
        }
        found.sort_unstable_by_key(|(point, _)| *point);
        found
    }

    /// The point that is nearest to a place, by the rule of ties; None of an empty cloud.
    pub fn nearest(&self, place: &Vector<D>) -> Option<usize> {
        let mut distance = self.pitch;
        // Places beside a body have a point within some cells; farther ones ask all.
        let mut near = self.near(place, distance);
        while near.is_empty() && distance < 8.0 * self.pitch {
            distance *= 2.0;
            near = self.near(place, distance);
        }
        if near.is_empty() {
            near = self.positions.iter().enumerate().map(|(k, x)| (k, gap(place, x))).collect();
        }
        let (closest, _) = *near.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let all = near.iter().map(|&(k, far)| (k, far, self.positions[k]));
        tie::nearest(all, TIE * self.sides[closest])
    }

    /// The fit at a piece of the surface: points and φ. Points beyond a crack or a notch are not in it.
    pub fn at(&self, piece: &Piece<D>) -> Vec<(usize, f64)> {
        let Some(nearest) = self.nearest(&piece.place) else { return Vec::new() };
        let side = self.sides[nearest];
        let mut reach = REACH;
        loop {
            let near: Vec<(usize, f64)> = self
                .near(&piece.place, (reach + 0.5) * side)
                .into_iter()
                .filter(|(point, _)| self.sees(piece, *point, side))
                .map(|(point, far)| (point, (reach + 0.5 - far / side).min(1.0)))
                .collect();
            let (fit, whole) = self.fit(&piece.place, side, &near);
            if whole || reach >= FARTHEST {
                return if fit.is_empty() { vec![(nearest, 1.0)] } else { fit };
            }
            reach += 1.0;
        }
    }

    /// Whether the way from the surface to a point is inside the body and crosses no crack.
    fn sees(&self, piece: &Piece<D>, point: usize, side: f64) -> bool {
        let there = &self.positions[point];
        let along = |s: f64| from_fn(|d| piece.place[d] + s * (there[d] - piece.place[d]));
        let within = |shape: &Shape<D>| [0.25, 0.5, 0.75].iter().all(|&s| shape.holds(&along(s), TIE * side));
        // A crack may begin at the surface: it is asked about from within.
        let from = from_fn(|d| piece.place[d] - TIE * side * piece.normal[d]);
        self.shape.is_none_or(within) && !self.cracks.iter().any(|crack| crack.cuts(&from, there, 1e-9 * side))
    }

    /// φ of weighted points about a place, and whether they span all directions. Where they do not, values are taken to be the same
    /// along those that are left.
    fn fit(&self, place: &Vector<D>, side: f64, near: &[(usize, f64)]) -> (Vec<(usize, f64)>, bool) {
        let whole = |x: f64, unit: f64| (x * unit).round() as i128;
        let terms: Vec<(usize, i128, [i128; D])> = near
            .iter()
            .filter(|(_, weight)| *weight > 0.0)
            .map(|&(point, weight)| {
                let x = &self.positions[point];
                (point, whole(weight, WEIGHTS), from_fn(|d| whole((x[d] - place[d]) / side, PLACES)))
            })
            .collect();
        // Σ w (1, r) ⊗ (1, r), with rows and columns for 1 and each axis.
        let power = |c: usize, r: &[i128; D]| if c == 0 { 1 } else { r[c - 1] };
        let unit = |c: usize| if c == 0 { 1.0 } else { PLACES };
        let mut matrix = [[0.0; 4]; 4];
        for a in 0..=D {
            for b in 0..=a {
                let sum: i128 = terms.iter().map(|(_, w, r)| w * power(a, r) * power(b, r)).sum();
                matrix[a][b] = sum as f64 / (WEIGHTS * unit(a) * unit(b));
                matrix[b][a] = matrix[a][b];
            }
        }
        let Some((coefficients, spans)) = first_column_of_inverse::<D>(matrix) else { return (Vec::new(), false) };
        let share = |(point, w, r): &(usize, i128, [i128; D])| {
            let slope: f64 = (0..D).map(|d| coefficients[d + 1] * (r[d] as f64 / PLACES)).sum();
            (*point, *w as f64 / WEIGHTS * (coefficients[0] + slope))
        };
        (terms.iter().map(share).collect(), spans)
    }
}

/// Solves M c = (1, 0, …) by elimination, leaving out axes along which the points do not spread; None without weights. The
/// constant is eliminated first, so that pivots are spreads about the mean.
fn first_column_of_inverse<const D: usize>(mut matrix: [[f64; 4]; 4]) -> Option<([f64; 4], bool)> {
    let total = matrix[0][0];
    if total <= 0.0 {
        return None;
    }
    let (mut right, mut kept) = ([1.0, 0.0, 0.0, 0.0], [true; 4]);
    for k in 0..=D {
        kept[k] = matrix[k][k] > FLAT * total;
        for a in if kept[k] { k + 1..D + 1 } else { 0..0 } {
            let factor = matrix[a][k] / matrix[k][k];
            for b in k + 1..=D {
                matrix[a][b] -= factor * matrix[k][b];
            }
            right[a] -= factor * right[k];
        }
    }
    let mut solution = [0.0; 4];
    for k in (0..=D).rev().filter(|&k| kept[k]) {
        let known: f64 = (k + 1..=D).map(|b| matrix[k][b] * solution[b]).sum();
        solution[k] = (right[k] - known) / matrix[k][k];
    }
    Some((solution, kept[..=D].iter().all(|kept| *kept)))
}

/// Adds numbers whatever their order: a sum of shares of something of order one.
pub fn sum_of_shares(terms: impl Iterator<Item = f64>) -> f64 {
    let sum: i128 = terms.map(|x| (x * SHARES).round() as i128).sum();
    sum as f64 / SHARES
}

fn gap<const D: usize>(a: &Vector<D>, b: &Vector<D>) -> f64 {
    (0..D).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Cloud;

    fn points<const D: usize>(cloud: &Cloud<D>) -> (Vec<Vector<D>>, Vec<f64>) {
        cloud.slots.iter().map(|&s| (cloud.position(s as usize), cloud.size(s as usize))).unzip()
    }

    /// Σ φ = 1 and Σ φ x = place, at each piece of the surface.
    fn fits_are_linear<const D: usize>(shape: &Shape<D>, h: f64) {
        let cloud = Cloud::lattice(shape, h, 3);
        let (positions, sides) = points(&cloud);
        let fits = Fits::new(&positions, &sides, Some(shape), &[]);
        for piece in shape.surface(h, &|_| true) {
            let fit = fits.at(&piece);
            let one: f64 = fit.iter().map(|(_, share)| share).sum();
            assert!((one - 1.0).abs() < 1e-12, "{shape:?} {piece:?}: {one}");
            for d in 0..D {
                let x: f64 = fit.iter().map(|(k, share)| share * positions[*k][d]).sum();
                // Positions are taken in multiples of 6e-14 cells.
                assert!((x - piece.place[d]).abs() < 1e-11 * h, "{shape:?} {piece:?}: {x}");
            }
        }
    }

    #[test]
    fn fits_give_the_place_itself_on_every_kind_of_face() {
        fits_are_linear(&Shape::Box { low: [0.0], high: [1.0] }, 0.1);
        fits_are_linear(&Shape::Box { low: [0.0; 2], high: [1.0, 0.5] }, 0.1);
        fits_are_linear(&Shape::Ball { center: [0.03, 0.0], radius: 0.77 }, 0.1);
        fits_are_linear(&Shape::Ring { center: [0.0; 2], inner: 0.5, outer: 1.0 }, 0.1);
        fits_are_linear(&Shape::Ball { center: [0.0; 3], radius: 0.5 }, 0.1);
        let vertices = vec![[0.0, 0.0], [2.1, 0.3], [1.2, 0.9], [1.7, 2.2], [-0.4, 1.3]];
        fits_are_linear(&Shape::<2>::Polygon { vertices }, 0.1);
    }

    #[test]
    fn a_fit_stays_on_its_side_of_a_crack_and_of_a_notch() {
        let plate = Shape::Box { low: [0.0; 2], high: [1.0; 2] };
        let cloud = Cloud::lattice(&plate, 0.1, 3);
        let (positions, sides) = points(&cloud);
        let crack = [Crack::Polyline(vec![[0.5, 0.5], [0.5, 1.0]])];
        let fits = Fits::new(&positions, &sides, Some(&plate), &crack);
        for piece in plate.surface(0.1, &|piece| piece.normal[1] > 0.5) {
            let left = piece.place[0] < 0.5;
            assert!(fits.at(&piece).iter().all(|(k, _)| (positions[*k][0] < 0.5) == left), "{piece:?}");
        }
        let slot = Shape::Box { low: [0.4, 0.5], high: [0.6, 1.1] };
        let notched = Shape::Difference(Box::new(plate), vec![slot]);
        let cloud = Cloud::lattice(&notched, 0.1, 3);
        let (positions, sides) = points(&cloud);
        let fits = Fits::new(&positions, &sides, Some(&notched), &[]);
        let flank = |piece: &Piece<2>| piece.normal[0] > 0.5 && piece.place[0] < 0.45 && piece.place[1] > 0.6;
        let pieces = notched.surface(0.1, &flank);
        assert!(!pieces.is_empty());
        for piece in pieces {
            assert!(fits.at(&piece).iter().all(|(k, _)| positions[*k][0] < 0.5), "{piece:?}");
        }
    }

    #[test]
    fn mirrored_places_have_mirrored_fits_to_the_bit() {
        let h = 0.1 / 3.0;
        let plate = Shape::Box { low: [-0.5, -0.2], high: [0.5, 0.2] };
        let cloud = Cloud::lattice(&plate, h, 3);
        let (positions, sides) = points(&cloud);
        let fits = Fits::new(&positions, &sides, Some(&plate), &[]);
        let pieces = plate.surface(h, &|piece| piece.normal[1].abs() > 0.5);
        let counts = [30, 12];
        for piece in &pieces {
            for axis in 0..2 {
                let mirrored = |mut x: Vector<2>| {
                    x[axis] = -x[axis];
                    x
                };
                let image = Piece { place: mirrored(piece.place), normal: mirrored(piece.normal), ..*piece };
                let mut found: Vec<(usize, f64)> = fits.at(piece);
                // Points are in rows along x.
                for (k, _) in &mut found {
                    let (i, j) = (*k % counts[0], *k / counts[0]);
                    *k =
                        if axis == 0 { j * counts[0] + counts[0] - 1 - i } else { (counts[1] - 1 - j) * counts[0] + i };
                }
                found.sort_unstable_by_key(|(k, _)| *k);
                assert_eq!(found, fits.at(&image), "{piece:?}");
            }
        }
    }
}
