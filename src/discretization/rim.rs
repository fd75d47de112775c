//! Bonds on the edge of the horizon, in clouds whose coordinates are rounded.
//!
//! A lattice that went through a file has coordinates of a few printed digits. The pairs that lie exactly on the edge of a
//! family, at 3 Δx say, are then a little within it and a little beyond, and rounding would choose which of them are bonds.
//! So here: let e be by how much a pair lies beyond the edge of the [rule](super::PartialVolume). If the e of all pairs that
//! are near zero stand apart from the others,
//!
//! ```text
//! |e| ≤ 0.035 h, and no pair for a gap on either side, wide 0.01 h and half of what they span or more,
//! ```
//!
//! they are one distance, blurred, and all of them are bonds or none is. Where their mean is within their standard deviation
//! (and 1e-4 h) of the edge they are on it, and are what a pair exactly on it is: bonds if whole cells count, else not, since
//! the part of the cell within the horizon is zero there. Otherwise they are where their mean is. Points that stand anywhere have no
//! gaps, and keep the edge as it is; so do lattices that are exact.

use std::ops::Range;

use crate::family::search;
use crate::field::Vector;

/// Of the spacing: half of what blurred distances may span. Coordinates that are off by 1 % of the spacing leave distances
/// along a diagonal of a cube off by 3.46 %.
pub const BLUR: f64 = 0.035;
/// Of the spacing: the least gap.
const GAP: f64 = 0.01;
/// Of the spacing: how far from the edge distances without any blur may be, to be on it.
const NEAR: f64 = 1e-4;
/// Of the spacing: what of a distance rounding in binary may have taken, on coordinates of some thousand spacings.
const EXACT: f64 = 1e-11;
/// Bins of the window of distances.
const BINS: usize = 4096;
/// Consecutive points whose distances are looked at first, and how many such rows of points.
const SAMPLE: (usize, usize) = (64, 16);

/// How far a pair (slots, ξ) lies beyond the edge of a family, m.
pub type Beyond<'a, const D: usize> = dyn Fn(usize, usize, &Vector<D>) -> f64 + Sync + 'a;

/// Numbers near zero that were met, by bin.
struct Distances {
    window: f64,
    bins: Vec<Bin>,
}

#[derive(Clone, Copy)]
struct Bin {
    count: u64,
    low: f64,
    high: f64,
    sum: f64,
    squares: f64,
}

/// Numbers about zero that stand apart: between what they lie, and the middles of the gaps.
struct Cluster {
    bins: Bin,
    middles: [f64; 2],
}

impl Distances {
    fn of<const D: usize>(
        positions: &[Vector<D>],
        ranges: Vec<Range<usize>>,
        reach: f64,
        window: f64,
        beyond: &Beyond<'_, D>,
    ) -> Self {
        let near = |i: usize, j: usize, xi: &Vector<D>| beyond(i, j, xi).abs() <= window;
        let pieces = search::pieces(positions, ranges.clone(), 0.0..reach + window, &near);
        let nothing = Bin { count: 0, low: f64::INFINITY, high: f64::NEG_INFINITY, sum: 0.0, squares: 0.0 };
        let mut distances = Distances { window, bins: vec![nothing; BINS] };
        for (range, piece) in ranges.into_iter().zip(pieces) {
            let mut first = 0;
            for (i, end) in range.zip(piece.ends) {
                let end = end as usize * crate::family::GROUP;
                for &j in piece.neighbours[first..end].iter().filter(|&&j| j as usize != i) {
                    let xi = crate::field::difference(&positions[j as usize], &positions[i]);
                    distances.add(beyond(i, j as usize, &xi));
                }
                first = end;
            }
        }
        distances
    }

    fn add(&mut self, e: f64) {
        let place = (0.5 * (e / self.window + 1.0) * BINS as f64) as usize;
        let bin = &mut self.bins[place.min(BINS - 1)];
        *bin = bin.with(&Bin { count: 1, low: e, high: e, sum: e, squares: e * e });
    }

    /// The numbers about zero, if they stand apart.
    fn cluster(&self, spacing: f64) -> Option<Cluster> {
        let found = || self.bins.iter().filter(|bin| bin.count > 0);
        // The widest gap that begins within the blur on either side of zero.
        let gap = |sign: f64, ends: &mut dyn Iterator<Item = [f64; 2]>| {
            let (mut last, mut widest) = (0.0, [0.0, 0.0]);
            for [near, far] in ends.map(|ends| ends.map(|e| sign * e)).chain([[self.window, self.window]]) {
                if last <= BLUR * spacing && near - last > widest[1] - widest[0] {
                    widest = [last, near];
                }
                last = f64::max(last, far);
            }
            widest
        };
        let above = gap(1.0, &mut found().map(|bin| [bin.low, bin.high]).filter(|[_, high]| *high > 0.0));
        let below = gap(-1.0, &mut found().rev().map(|bin| [bin.high, bin.low]).filter(|[_, low]| *low < 0.0));
        let least = f64::max(GAP * spacing, 0.5 * (above[0] + below[0]));
        if [above, below].iter().any(|[from, to]| to - from < least) {
            return None;
        }
        let inside = found().filter(|bin| bin.high <= above[0] && bin.low >= -below[0]);
        let bins = inside.copied().reduce(|all, bin| all.with(&bin))?;
        Some(Cluster { bins, middles: [-0.5 * (below[0] + below[1]), 0.5 * (above[0] + above[1])] })
    }
}

impl Bin {
    fn with(&self, other: &Bin) -> Bin {
        Bin {
            count: self.count + other.count,
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            sum: self.sum + other.sum,
            squares: self.squares + other.squares,
        }
    }
}

/// By how much the edge of all families has to move, m, so that pairs on it are bonds all or none; None where it may stay.
///
/// `edge`: up to which e pairs are bonds where it stays. `closed`: whether pairs exactly on the edge are. `reach`: the largest
/// length of a pair on the edge, m.
pub fn moved_edge<const D: usize>(
    positions: &[Vector<D>],
    spacing: f64,
    reach: f64,
    beyond: &Beyond<'_, D>,
    edge: f64,
    closed: bool,
) -> Option<f64> {
    let n = positions.len();
    let window = 2.0 * BLUR * spacing;
    let (row, rows) = SAMPLE;
    if n > row * rows {
        let sample = (0..rows).map(|k| k * (n - row) / (rows - 1)).map(|first| first..first + row).collect();
        let bins = Distances::of(positions, sample, reach, window, beyond).cluster(spacing)?.bins;
        if bins.high - bins.low <= EXACT * spacing {
            return None;
        }
    }
    let all = (0..n).step_by(512).map(|first| first..(first + 512).min(n)).collect();
    let Cluster { bins, middles } = Distances::of(positions, all, reach, window, beyond).cluster(spacing)?;
    if bins.high <= edge || bins.low > edge {
        return None;
    }
    let mean = bins.sum / bins.count as f64;
    let deviation = (bins.squares / bins.count as f64 - mean * mean).max(0.0).sqrt();
    let is_on_edge = mean.abs() <= deviation + NEAR * spacing;
    let are_bonds = if is_on_edge { closed } else { mean < 0.0 };
    Some(middles[usize::from(are_bonds)])
}
