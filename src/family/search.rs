//! Neighbour search in scattered clouds by cell lists.

use rayon::prelude::*;

use super::{CloudFamilies, GROUP, Sites};
use crate::field::{Vector, difference, dot, norm};

/// Points sorted into cubic cells of side `reach`: the candidates of a point lie in the 3^D cells around it.
pub struct Cells<const D: usize> {
    low: Vector<D>,
    side: f64,
    counts: [usize; D],
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl<const D: usize> Cells<D> {
    pub fn new(positions: &[Vector<D>], reach: f64) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
        for x in positions {
            for d in 0..D {
                low[d] = low[d].min(x[d]);
                high[d] = high[d].max(x[d]);
            }
        }
        // Never more cells than a few per point: a sparse cloud must not allocate its bounding box.
        let mut side = reach;
        let counts = loop {
            let counts: [usize; D] =
                std::array::from_fn(|d| (((high[d] - low[d]) / side).floor().max(0.0) as usize).saturating_add(1));
            let total = counts.iter().try_fold(1usize, |a, &b| a.checked_mul(b));
            if total.is_some_and(|n| n <= 4 * positions.len() + 64) {
                break counts;
            }
            side *= 1.5;
        };
        let n_cells: usize = counts.iter().product();
        let mut cells = Cells { low, side, counts, starts: vec![0; n_cells + 1], order: vec![0; positions.len()] };
        for x in positions {
            let c = cells.index(cells.cell(x));
            cells.starts[c + 1] += 1;
        }
        for c in 0..n_cells {
            cells.starts[c + 1] += cells.starts[c];
        }
        let mut next = cells.starts.clone();
        for (i, x) in positions.iter().enumerate() {
            let c = cells.index(cells.cell(x));
            cells.order[next[c] as usize] = i as u32;
            next[c] += 1;
        }
        cells
    }

    fn cell(&self, x: &Vector<D>) -> [usize; D] {
        std::array::from_fn(|d| (((x[d] - self.low[d]) / self.side).floor().max(0.0) as usize).min(self.counts[d] - 1))
    }

    fn index(&self, cell: [usize; D]) -> usize {
        (0..D).rev().fold(0, |index, d| index * self.counts[d] + cell[d])
    }

    /// Calls `visit` with every point in the cells around x: all points within the reach, and some beyond.
    pub fn around(&self, x: &Vector<D>, mut visit: impl FnMut(u32)) {
        let centre = self.cell(x);
        let low = centre.map(|c| c.saturating_sub(1));
        let span: [usize; D] = std::array::from_fn(|d| (centre[d] + 2).min(self.counts[d]) - low[d]);
        crate::geometry::cloud::for_each_cell(span, |step| {
            let c = self.index(std::array::from_fn(|d| low[d] + step[d]));
            for &j in &self.order[self.starts[c] as usize..self.starts[c + 1] as usize] {
                visit(j);
            }
        });
    }
}

/// The families of a scattered cloud: x′ ≠ x with |ξ| ≤ `reach` and `accept(ξ)`, ascending.
pub fn families<const D: usize>(
    positions: &[Vector<D>],
    reach: f64,
    accept: impl Fn(&Vector<D>) -> bool + Sync,
) -> CloudFamilies {
    let cells = Cells::new(positions, reach);
    let is_neighbour = |i: usize, j: u32| {
        let xi = difference(&positions[j as usize], &positions[i]);
        // The square root is left to the few that are near enough.
        dot(&xi, &xi) <= reach * reach * (1.0 + 1e-12) && j as usize != i && norm(&xi) <= reach && accept(&xi)
    };
    let counts: Vec<u64> = (0..positions.len())
        .into_par_iter()
        .map(|i| {
            let mut n = 0;
            cells.around(&positions[i], |j| n += u64::from(is_neighbour(i, j)));
            n
        })
        .collect();
    let mut starts = Vec::with_capacity(positions.len() + 1);
    let mut total = 0;
    starts.push(0);
    for n in counts {
        total += n.div_ceil(GROUP as u64);
        starts.push(total);
    }
    let mut neighbours = vec![0; total as usize * GROUP];
    let mut rest = neighbours.as_mut_slice();
    let mut rows = Vec::with_capacity(positions.len());
    for i in 0..positions.len() {
        let (row, tail) = rest.split_at_mut((starts[i + 1] - starts[i]) as usize * GROUP);
        rows.push(row);
        rest = tail;
    }
    rows.into_par_iter().enumerate().for_each(|(i, row)| {
        let mut n = 0;
        cells.around(&positions[i], |j| {
            if is_neighbour(i, j) {
                row[n] = j;
                n += 1;
            }
        });
        row[..n].sort_unstable();
        row[n..].fill(i as u32);
    });
    CloudFamilies { starts, neighbours, sites: Sites::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cell_lists_find_what_a_search_over_all_pairs_finds() {
        // A linear congruential sequence: the test needs scatter, not randomness.
        let mut seed = 1u64;
        let mut next = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 33) as f64 / (1u64 << 31) as f64
        };
        let positions: Vec<Vector<3>> = (0..300).map(|_| [next(), 3.0 * next(), next()]).collect();
        let found = families(&positions, 0.3, |_| true);
        for (i, x) in positions.iter().enumerate() {
            let expected: Vec<u32> = (0..300u32)
                .filter(|&j| j as usize != i && norm(&difference(&positions[j as usize], x)) <= 0.3)
                .collect();
            let row: Vec<u32> = found.neighbours[found.of(i)].iter().copied().filter(|&j| j as usize != i).collect();
            assert_eq!(row, expected);
        }
    }
}
