//! The order of scattered points along a Hilbert curve: points that are near in space are mostly near in memory too.
//!
//! The curve runs through all cells of a grid of 2^bits cells a side over the bounding cube, from each cell to one that
//! shares a face with it. The number of a cell on it comes from the bits of the cell's coordinates, the coarsest first: each
//! tells a corner of the cube found so far, and how the curve runs through that cube tells the corner's turn (Hamilton &
//! Rau-Chaplin, "Compact Hilbert indices", Information Processing Letters 105 (2008) 155–163).

use rayon::prelude::*;

use crate::field::Vector;

/// Points in one cell of the grid that need no order of their own.
const CROWD: usize = 8;

/// The points in their order along the curve. A function of the positions alone; the numbers of points decide only among
/// the few in one cell.
pub fn order<const D: usize>(positions: &[Vector<D>]) -> Vec<u32> {
    // As many bits as an index of 64 has, and no more than a coordinate has digits.
    let bits = (64 / D as u32).min(52);
    let (mut low, mut side) = ([f64::INFINITY; D], 0.0);
    for d in 0..D {
        let x = || positions.iter().map(|x| x[d]);
        low[d] = x().fold(f64::INFINITY, f64::min);
        side = f64::max(side, x().fold(f64::NEG_INFINITY, f64::max) - low[d]);
    }
    let cells = (1u64 << bits) as f64;
    let coordinate = |x: f64| if side > 0.0 { ((x / side * cells) as u64).min((1 << bits) - 1) } else { 0 };
    let courses = Courses::<D>::new();
    let mut order: Vec<(u64, u32)> = positions
        .par_iter()
        .enumerate()
        .map(|(i, x)| (courses.index(std::array::from_fn(|d| coordinate(x[d] - low[d])), bits), i as u32))
        .collect();
    order.par_sort_unstable();
    let mut points: Vec<u32> = order.iter().map(|&(_, i)| i).collect();
    // Many in one cell of so fine a grid: a body beside a point that got lost, say. They have a curve of their own.
    let mut first = 0;
    for cell in order.chunk_by(|a, b| a.0 == b.0) {
        let here = &mut points[first..first + cell.len()];
        first += cell.len();
        if here.len() > CROWD && here.len() < positions.len() {
            let inside: Vec<Vector<D>> = here.iter().map(|&i| positions[i as usize]).collect();
            let along: Vec<u32> = self::order(&inside).into_iter().map(|k| here[k as usize]).collect();
            here.copy_from_slice(&along);
        }
    }
    points
}

/// A curve through the cells of a grid and of all coarser ones: all cells within a coarser cell follow each other.
#[derive(Debug, Clone)]
pub struct Curve<const D: usize> {
    courses: Courses<D>,
    bits: u32,
}

impl<const D: usize> Curve<D> {
    /// Through 2^`bits` cells a side.
    pub fn new(bits: u32) -> Self {
        assert!(bits * D as u32 <= 64, "numbers on the curve have 64 bits");
        Curve { courses: Courses::new(), bits }
    }

    /// The number of the first cell within a cell of the grid that is 2^`coarser` times as coarse.
    pub fn index(&self, cell: [u64; D], coarser: u32) -> u64 {
        self.courses.index(cell, self.bits - coarser) << (D as u32 * coarser)
    }
}

/// The ways in which the curve can run through a cube, each given by the corner where it enters and an axis.
#[derive(Debug, Clone)]
struct Courses<const D: usize> {
    /// By course and corner: the corner's turn, and the course through the smaller cube there.
    turns: Vec<[u8; 2]>,
}

impl<const D: usize> Courses<D> {
    fn new() -> Self {
        let n = D as u32;
        let corners = 1u32 << n;
        let left = |x: u32, by: u32| (x << by | x >> (n - by)) & (corners - 1);
        let gray = |x: u32| x ^ x >> 1;
        let turn = |course: u32, corner: u32| {
            let (entry, axis) = (course % corners, course / corners);
            // As seen from the entry, along the axis; then the inverse of the Gray code of at most three bits.
            let seen = left(corner ^ entry, n - (axis + 1) % n);
            let turn = seen ^ seen >> 1 ^ seen >> 2;
            let (enters, along) = match turn {
                0 => (0, 0),
                t if t % 2 == 1 => (gray(t - 1), t.trailing_ones()),
                t => (gray(t - 2), (t - 1).trailing_ones()),
            };
            let (entry, axis) = (entry ^ left(enters, (axis + 1) % n), (axis + along + 1) % n);
            [turn as u8, (axis * corners + entry) as u8]
        };
        Courses { turns: (0..n * corners * corners).map(|k| turn(k / corners, k % corners)).collect() }
    }

    /// The number of a cell on the curve.
    fn index(&self, cell: [u64; D], bits: u32) -> u64 {
        let (mut index, mut course) = (0, 0);
        for bit in (0..bits).rev() {
            let corner = (0..D).fold(0, |corner, d| corner | (cell[d] >> bit & 1) << d);
            let [turn, next] = self.turns[course << D | corner as usize];
            index = index << D | u64::from(turn);
            course = usize::from(next);
        }
        index
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cloud::for_each_cell;

    /// The curve goes through all cells, each once, from neighbour to neighbour.
    fn walks<const D: usize>(bits: u32) {
        let (side, courses) = (1usize << bits, Courses::<D>::new());
        let mut at = vec![None; side.pow(D as u32)];
        for_each_cell([side; D], |cell| {
            let place = &mut at[courses.index(cell.map(|c| c as u64), bits) as usize];
            assert!(place.replace(cell).is_none(), "{D}D: one cell in one place");
        });
        for pair in at.windows(2) {
            let (a, b) = (pair[0].unwrap(), pair[1].unwrap());
            let steps: usize = (0..D).map(|d| a[d].abs_diff(b[d])).sum();
            assert_eq!(steps, 1, "{D}D, {bits} bits: {a:?} to {b:?}");
        }
    }

    #[test]
    fn the_curve_goes_through_every_cell_from_neighbour_to_neighbour() {
        for bits in 1..5 {
            walks::<1>(bits);
            walks::<2>(bits);
            walks::<3>(bits);
        }
        walks::<2>(7);
    }

    #[test]
    fn a_line_is_ordered_by_its_coordinate_and_equal_points_by_their_number() {
        let line = [3.0, -1.0, 0.5, 3.0, 1e9, 0.25].map(|x| [x]);
        assert_eq!(order(&line), [1, 5, 2, 0, 3, 4]);
        assert_eq!(order(&[[1.0, 2.0]; 3]), [0, 1, 2]);
        assert_eq!(order(&[[1.0, 2.0]; 30]), std::array::from_fn::<u32, 30, _>(|i| i as u32));
        assert_eq!(order::<3>(&[]), [] as [u32; 0]);
    }

    #[test]
    fn a_point_that_got_lost_does_not_upset_the_others() {
        let body: Vec<Vector<3>> = (0..512).map(|i| [i % 8, i / 8 % 8, i / 64].map(|c| f64::from(c) * 1e-3)).collect();
        let alone = order(&body);
        let mut with_lost = body;
        with_lost.push([1e30, 0.0, 0.0]);
        assert_eq!(order(&with_lost)[..512], alone);
        let far = alone
            .windows(2)
            .any(|p| (0..3).any(|d| (with_lost[p[0] as usize][d] - with_lost[p[1] as usize][d]).abs() > 1.5e-3));
        assert!(!far, "a cube of points is walked from neighbour to neighbour");
    }
}
