//! Neighbour search in scattered clouds, by a tree of boxes over points that lie along a space-filling curve.
//!
//! Candidates are collected for a block of 64 points at once, narrowed down for each eight of them, and then compared with
//! one point after the other. The tree is walked in the order of the points, so that every list is ascending and nothing
//! is sorted. No grid is laid over the cloud: emptiness costs nothing. Points in another order give the same families,
//! only slower.

use std::ops::Range;

use super::families::{CloudFamilies, GROUP, PIECE, Sites};
use super::tree::{Bounds, FAN, Tree};
use crate::field::{Vector, difference, norm};
use crate::parallel;

/// Points whose candidates are collected together.
const BLOCK: usize = FAN * FAN;
/// Points whose families are kept twice for a moment.
const WAVE: usize = 256 * PIECE;

/// Whether x′ belongs to the family of x, given both slots and ξ.
pub type Accept<'a, const D: usize> = dyn Fn(usize, usize, &Vector<D>) -> bool + Sync + 'a;

/// The families of a scattered cloud: x′ ≠ x with |ξ| ≤ `rim.start`, or with |ξ| ≤ `rim.end` and `accept(x, x′, ξ)`, the
/// first two by their places in `positions`; ascending.
pub fn families<const D: usize>(positions: &[Vector<D>], rim: Range<f64>, accept: &Accept<'_, D>) -> CloudFamilies {
    let search = Search { positions, tree: Tree::new(positions), rim, accept };
    let n = positions.len();
    let (mut starts, mut neighbours) = (Vec::with_capacity(n + 1), Vec::new());
    starts.push(0);
    for wave in (0..n).step_by(WAVE) {
        let end = (wave + WAVE).min(n);
        let pieces = parallel::map_each((end - wave).div_ceil(PIECE), &|k| {
            let first = wave + k * PIECE;
            search.piece(first..(first + PIECE).min(end), &mut Scratch::default())
        });
        let found: usize = pieces.iter().map(|piece| piece.neighbours.len()).sum();
        if neighbours.capacity() < neighbours.len() + found {
            // Room for all that the points so far let expect, so that a list of gigabytes is not doubled.
            let mean = (neighbours.len() + found) as f64 / end as f64;
            neighbours.reserve_exact(found + (1.05 * mean * (n - end) as f64) as usize);
        }
        for piece in pieces {
            starts.extend(piece.ends.iter().map(|end| (neighbours.len() / GROUP) as u64 + end));
            neighbours.extend_from_slice(&piece.neighbours);
        }
    }
    neighbours.shrink_to_fit();
    CloudFamilies { starts, neighbours, sites: Sites::default() }
}

/// The families of some points only, as [`families`] has them: of ranges of consecutive ones.
pub fn pieces<const D: usize>(
    positions: &[Vector<D>],
    ranges: Vec<Range<usize>>,
    rim: Range<f64>,
    accept: &Accept<'_, D>,
) -> Vec<Piece> {
    let search = Search { positions, tree: Tree::new(positions), rim, accept };
    parallel::map(ranges.len(), &|k| search.piece(ranges[k].clone(), &mut Scratch::default()))
}

/// The families of some consecutive points.
pub struct Piece {
    /// One past the last group of each point, counted from the first of the piece.
    pub ends: Vec<u64>,
    pub neighbours: Vec<u32>,
}

/// What is searched, and for whom.
struct Search<'a, const D: usize> {
    positions: &'a [Vector<D>],
    tree: Tree<D>,
    rim: Range<f64>,
    accept: &'a Accept<'a, D>,
}

/// Lists that grow once and are used again.
struct Scratch<const D: usize> {
    /// Points near a block, and of those the points near a part of it.
    wide: Candidates<D>,
    narrow: Candidates<D>,
    /// Distance² to each candidate.
    squares: Vec<f64>,
    row: Vec<u32>,
}

impl<const D: usize> Search<'_, D> {
    /// The families of `points`.
    fn piece(&self, points: Range<usize>, scratch: &mut Scratch<D>) -> Piece {
        let mut piece = Piece { ends: Vec::with_capacity(points.len()), neighbours: Vec::new() };
        for first in points.clone().step_by(BLOCK) {
            self.block(first..(first + BLOCK).min(points.end), scratch, &mut piece);
        }
        piece
    }

    /// Adds the families of at most [`BLOCK`] points.
    fn block(&self, points: Range<usize>, scratch: &mut Scratch<D>, piece: &mut Piece) {
        let positions = &self.positions[points.clone()];
        let bounds = Bounds::of_points(positions);
        if points.len() > 1 && bounds.widest() > 2.0 * self.rim.end {
            // The curve jumps here, or the points are far apart: nothing is gained by searching together.
            let part = if points.len() > FAN { FAN } else { 1 };
            for first in points.clone().step_by(part) {
                self.block(first..(first + part).min(points.end), scratch, piece);
            }
            return;
        }
        let limit = self.limit();
        scratch.wide.n = 0;
        self.tree.near(&bounds, limit, &mut |group| {
            let first = group * FAN;
            let few = &self.positions[first..(first + FAN).min(self.positions.len())];
            scratch.wide.extend(few, first, |x| bounds.gap_to(x) <= limit);
        });
        for (k, few) in positions.chunks(FAN).enumerate() {
            scratch.narrow_down(&Bounds::of_points(few), limit);
            for i in 0..few.len() {
                let i = points.start + k * FAN + i;
                piece.neighbours.extend_from_slice(self.row(i, scratch));
                piece.neighbours.resize(piece.neighbours.len().next_multiple_of(GROUP), i as u32);
                piece.ends.push((piece.neighbours.len() / GROUP) as u64);
            }
        }
    }

    /// The neighbours of point `i`, which is near the narrowed candidates.
    fn row<'s>(&self, i: usize, scratch: &'s mut Scratch<D>) -> &'s [u32] {
        let Scratch { narrow, squares, row, .. } = scratch;
        let (x, n, limit, sure) = (&self.positions[i], narrow.n, self.limit(), self.sure());
        grow(squares, n);
        grow(row, n);
        let there: [&[f64]; D] = std::array::from_fn(|d| &narrow.x[d][..n]);
        let squares = &mut squares[..n];
        let mut n_sure = 0u64;
        for k in 0..n {
            let mut square = 0.0;
            for d in 0..D {
                let xi = there[d][k] - x[d];
                square += xi * xi;
            }
            squares[k] = square;
            n_sure += u64::from(square <= sure);
        }
        squares[narrow.place(i)] = f64::INFINITY;
        let mut found = 0;
        for (&j, &square) in narrow.slots.iter().zip(&*squares) {
            row[found] = j;
            found += usize::from(square <= limit);
        }
        // The point itself was counted too.
        if found as u64 + 1 != n_sure {
            found = 0;
            for (&j, &square) in narrow.slots.iter().zip(&*squares) {
                let accepted = || {
                    let xi = difference(&self.positions[j as usize], x);
                    norm(&xi) <= self.rim.end && (self.accept)(i, j as usize, &xi)
                };
                if square <= sure || square <= limit && accepted() {
                    row[found] = j;
                    found += 1;
                }
            }
        }
        &row[..found]
    }

    /// Distance² up to which all points are neighbours.
    fn sure(&self) -> f64 {
        self.rim.start * self.rim.start
    }

    /// Distance² beyond which none is, however it was rounded.
    fn limit(&self) -> f64 {
        self.rim.end * self.rim.end * (1.0 + 1e-12)
    }
}

impl<const D: usize> Default for Scratch<D> {
    fn default() -> Self {
        Scratch { wide: Candidates::new(), narrow: Candidates::new(), squares: Vec::new(), row: Vec::new() }
    }
}

impl<const D: usize> Scratch<D> {
    /// Keeps, of the points near a block, those near a part of it.
    fn narrow_down(&mut self, bounds: &Bounds<D>, limit: f64) {
        let Scratch { wide, narrow, squares, .. } = self;
        let n = wide.n;
        grow(squares, n);
        let there: [&[f64]; D] = std::array::from_fn(|d| &wide.x[d][..n]);
        let squares = &mut squares[..n];
        for k in 0..n {
            let mut square = 0.0;
            for d in 0..D {
                let gap = bounds.gap_along(d, there[d][k], there[d][k]);
                square += gap * gap;
            }
            squares[k] = square;
        }
        narrow.make_room(n);
        let mut kept = 0;
        for k in 0..n {
            narrow.put(kept, wide.slots[k], &std::array::from_fn(|d| there[d][k]));
            kept += usize::from(squares[k] <= limit);
        }
        narrow.n = kept;
    }
}

/// Points, coordinate by coordinate.
struct Candidates<const D: usize> {
    n: usize,
    slots: Vec<u32>,
    x: [Vec<f64>; D],
}

impl<const D: usize> Candidates<D> {
    fn new() -> Self {
        Candidates { n: 0, slots: Vec::new(), x: [const { Vec::new() }; D] }
    }

    fn make_room(&mut self, n: usize) {
        grow(&mut self.slots, n);
        for x in &mut self.x {
            grow(x, n);
        }
    }

    #[inline(always)]
    fn put(&mut self, k: usize, slot: u32, position: &Vector<D>) {
        self.slots[k] = slot;
        for d in 0..D {
            self.x[d][k] = position[d];
        }
    }

    /// Adds those of consecutive points that `is_near` keeps; without a branch, which could not be foreseen.
    #[inline(always)]
    fn extend(&mut self, points: &[Vector<D>], first: usize, is_near: impl Fn(&Vector<D>) -> bool) {
        self.make_room(self.n + points.len());
        for (k, x) in points.iter().enumerate() {
            self.put(self.n, (first + k) as u32, x);
            self.n += usize::from(is_near(x));
        }
    }

    /// Where point `i` stands.
    fn place(&self, i: usize) -> usize {
        self.slots[..self.n].partition_point(|&slot| (slot as usize) < i)
    }
}

/// Makes a list at least `n` long.
fn grow<T: Copy + Default>(list: &mut Vec<T>, n: usize) {
    if list.len() < n {
        list.resize(n, T::default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Arrangement, Cloud};

    /// A linear congruential sequence between 0 and 1: the tests need scatter, not randomness.
    struct Scatter(u64);

    impl Scatter {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 33) as f64 / (1u64 << 31) as f64
        }
    }

    /// Rows of the search against all pairs, in the order given and along the curve.
    fn compare<const D: usize>(label: &str, positions: Vec<Vector<D>>, rim: Range<f64>) {
        // Some rule that is alike from both ends.
        let accept = |xi: &Vector<D>| xi.iter().map(|x| x.abs()).sum::<f64>() > 1.2 * norm(xi);
        let n = positions.len();
        let Arrangement::Scattered { positions: along, .. } =
            Cloud::scattered(positions.clone(), vec![1.0; n]).arrangement
        else {
            panic!("a scattered cloud")
        };
        for (order, positions) in [("as given", positions), ("along the curve", along)] {
            let found = families(&positions, rim.clone(), &|_, _, xi| accept(xi));
            assert_eq!(found.starts.len(), n + 1);
            for (i, x) in positions.iter().enumerate() {
                let is_neighbour = |&j: &u32| {
                    let xi = difference(&positions[j as usize], x);
                    let length = norm(&xi);
                    j as usize != i && (length <= rim.start || length <= rim.end && accept(&xi))
                };
                let expected: Vec<u32> = (0..n as u32).filter(is_neighbour).collect();
                let row = &found.neighbours[found.of(i)];
                assert_eq!(row[..expected.len()], expected, "{D}D, {label}, {order}, point {i}");
                assert_eq!(row.len(), expected.len().next_multiple_of(GROUP), "{D}D, {label}, {order}, point {i}");
                assert!(row[expected.len()..].iter().all(|&j| j as usize == i), "padding is the point itself");
            }
        }
    }

    fn every_kind_of_cloud<const D: usize>() {
        let mut scatter = Scatter(1);
        let mut cloud = |n: usize, size: Vector<D>| -> Vec<Vector<D>> {
            (0..n).map(|_| std::array::from_fn(|d| size[d] * scatter.next())).collect()
        };
        // Sizes about the edges of boxes, blocks and pieces.
        for n in [0, 1, 2, 7, 8, 9, 63, 64, 65, 511, 513, 1100] {
            compare("a cube", cloud(n, [1.0; D]), 0.17..0.2);
        }
        compare("all see all", cloud(70, [1.0; D]), 9.0..10.0);
        compare("none sees any", cloud(70, [1.0; D]), 0.0..1e-9);
        let mut size = [1.0; D];
        size[D - 1] = 1e4;
        compare("a needle", cloud(700, size), 20.0..30.0);
        compare("a sparse cloud", cloud(700, [1e6; D]), 0.5..1e4);
        let clusters: Vec<Vector<D>> = (0..9)
            .flat_map(|k| cloud(70, [1.0; D]).into_iter().map(move |x| x.map(|x| x + 1e9 * f64::from(k * k))))
            .collect();
        compare("clusters in the void", clusters, 0.2..0.25);
        let mut outlier = cloud(600, [1.0; D]);
        outlier[300] = [1e15; D];
        compare("a point that got lost", outlier, 0.1..0.2);
        // Distances that are the reach exactly, places on the edges of all boxes, both to be treated alike.
        let side = [600, 24, 9][D - 1];
        let lattice: Vec<Vector<D>> = (0..side_to(side, D))
            .map(|k| std::array::from_fn(|d| 0.125 * (k / side_to(side, d) % side) as f64))
            .collect();
        compare("a lattice", lattice.clone(), 0.375..0.375);
        compare("a lattice, asked", lattice, 0.25..0.375);
        compare("points in one place", [[0.5; D]; 20].to_vec(), 0.1..0.2);
    }

    fn side_to(side: usize, power: usize) -> usize {
        side.pow(power as u32)
    }

    #[test]
    fn the_tree_finds_what_a_search_over_all_pairs_finds() {
        every_kind_of_cloud::<1>();
        every_kind_of_cloud::<2>();
        every_kind_of_cloud::<3>();
    }

    #[test]
    fn families_are_the_same_on_any_number_of_threads() {
        let mut scatter = Scatter(2);
        // More than a wave of points.
        let positions: Vec<Vector<2>> = (0..WAVE + 3000).map(|_| [scatter.next(), scatter.next()]).collect();
        let found = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let Arrangement::Scattered { positions, .. } =
                pool.install(|| Cloud::scattered(positions.clone(), vec![1.0; positions.len()])).arrangement
            else {
                panic!("a scattered cloud")
            };
            let found = pool.install(|| families(&positions, 0.004..0.005, &|_, _, xi| xi[0] * xi[1] > 0.0));
            (found.starts, found.neighbours)
        };
        let one = found(1);
        for threads in [2, 3] {
            assert!(found(threads) == one, "{threads} threads");
        }
    }
}
