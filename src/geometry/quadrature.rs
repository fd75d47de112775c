//! Volumes of shapes: in closed form where there is one, else by cells that are halved where the boundary is.

use super::Shape;
use super::cloud::for_each_cell;
use crate::field::Vector;
use std::array::from_fn;

/// Cells along the longest side of a combined shape at first.
const CELLS: f64 = 16.0;
/// Cells at the boundary that are looked at.
const MOST: usize = 60_000;

impl<const D: usize> Shape<D> {
    /// Length (1D), area (2D) or volume (3D), of combined shapes to about a thousandth.
    ///
    /// A cell is inside or outside if its centre is farther from the boundary than its corners are from the centre; signed
    /// distances are never too large. The others are halved along each axis, as long as there are not too many. What then
    /// remains counts as a plane at the distance of its centre would cut it.
    pub fn volume(&self) -> f64 {
        self.measure().unwrap_or_else(|| self.measure_by_halving())
    }

    fn measure_by_halving(&self) -> f64 {
        let (low, high) = self.bounds();
        let longest = (0..D).map(|d| high[d] - low[d]).fold(0.0, f64::max);
        let mut size = longest / CELLS;
        let counts: [usize; D] = from_fn(|d| ((high[d] - low[d]) / size).ceil().max(1.0) as usize);
        let mut open: Vec<Vector<D>> = Vec::new();
        for_each_cell(counts, |cell| open.push(from_fn(|d| low[d] + (cell[d] as f64 + 0.5) * size)));
        let mut volume = 0.0;
        loop {
            let corner = 0.5 * size * (D as f64).sqrt();
            let cell = size.powi(D as i32);
            let distances: Vec<f64> = open.iter().map(|x| self.signed_distance(x)).collect();
            volume += distances.iter().filter(|distance| **distance <= -corner).count() as f64 * cell;
            let cut = || open.iter().zip(&distances).filter(|(_, distance)| distance.abs() < corner);
            let n = cut().count();
            if n == 0 || n << D > MOST || size < 1e-9 * longest {
                let inside: f64 = cut().map(|(_, distance)| (0.5 - distance / size).clamp(0.0, 1.0)).sum();
                return volume + inside * cell;
            }
            let halves = cut().flat_map(|(x, _)| {
                let x = *x;
                (0..1usize << D).map(move |k| from_fn(|d| x[d] + size * if k >> d & 1 == 1 { 0.25 } else { -0.25 }))
            });
            open = halves.collect();
            size *= 0.5;
        }
    }

    /// The axes across which it has flat faces at both ends of its bounds.
    pub fn axes_of_faces(&self) -> Vec<usize> {
        match self {
            Shape::Box { .. } => (0..D).collect(),
            Shape::Cylinder { axis, .. } => vec![*axis],
            Shape::Extrusion { .. } => vec![2],
            _ => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn combined_shapes_have_the_volume_of_their_parts() {
        let ball = |at: f64, radius| Shape::Ball { center: [at, 0.1, -0.2], radius };
        let slab = |low: f64, high: f64| Shape::Box { low: [-2.0, -2.0, low], high: [2.0, 2.0, high] };
        let sphere = |r: f64| 4.0 / 3.0 * PI * r * r * r;
        for (label, shape, expected) in [
            ("apart", Shape::Union(vec![ball(0.0, 1.0), ball(3.0, 0.7)]), sphere(1.0) + sphere(0.7)),
            ("a hollow", Shape::Difference(Box::new(ball(0.0, 1.0)), vec![ball(0.0, 0.5)]), sphere(1.0) - sphere(0.5)),
            ("a half", Shape::Intersection(vec![ball(0.0, 1.0), slab(-0.2, 2.0)]), 0.5 * sphere(1.0)),
            ("overlapping", Shape::Union(vec![slab(0.0, 1.0), slab(0.5, 1.5)]), 24.0),
            ("thin", Shape::Union(vec![slab(0.0, 0.01), slab(0.5, 0.51)]), 0.32),
        ] {
            // Cells that the boundary goes through are 60 000 at most: some 1e-3 of the volume, of which half is known.
            let volume = shape.volume();
            assert!((volume / expected - 1.0).abs() < 2e-3, "{label}: {volume} {expected}");
        }
        let flat = Shape::<2>::Difference(
            Box::new(Shape::Box { low: [0.0; 2], high: [3.0, 1.0] }),
            vec![Shape::Ball { center: [1.0, 0.5], radius: 0.25 }],
        );
        assert!((flat.volume() / (3.0 - PI / 16.0) - 1.0).abs() < 1e-4);
        assert_eq!(Shape::Ball { center: [0.0; 2], radius: 2.0 }.volume(), 4.0 * PI);
    }
}
