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
//! (and 1e-4 h) of the edge, or, where they are all off by the same, within what their printed digits leave open, they are on it, and are what a pair exactly on it is: bonds if whole cells count, else not, since
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
/// Of the spacing: how far from the edge the mean of printed distances may be, beside their blur, to be on it; ten units of their
/// last digit if that is less.
const NEAR: f64 = 1e-4;
/// Of the spacing: the largest unit of the last digit, half of which rounding takes.
const ROUGHEST: f64 = 0.02;
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

/// The unit of the last digit of printed coordinates, m: of so many decimals or so many significant digits as any has. 0 where
/// the spacing is a multiple of it, so that nothing had to be rounded.
fn printed_unit<'a>(coordinates: impl Iterator<Item = &'a f64>, spacing: f64) -> f64 {
    let (mut last, mut first, mut digits) = (i32::MAX, i32::MIN, 1);
    for x in coordinates.filter(|x| **x != 0.0) {
        // As few digits as tell it from all other numbers.
        let text = format!("{x:e}");
        let (mantissa, exponent) = text.split_once('e').expect("a mantissa and an exponent");
        let exponent: i32 = exponent.parse().expect("a whole number");
        let n = mantissa.bytes().filter(u8::is_ascii_digit).count() as i32;
        (last, first, digits) = (last.min(exponent - n + 1), first.max(exponent), digits.max(n));
    }
    if first == i32::MIN {
        return 0.0;
    }
    // Few round numbers tell too few significant digits.
    let units = [last.max(first - digits + 1), last].map(|digit| 10f64.powi(digit));
    let Some(unit) = units.into_iter().find(|unit| *unit <= ROUGHEST * spacing) else { return 0.0 };
    let steps = spacing / unit;
    if (steps - steps.round()).abs() <= 1e-3 { 0.0 } else { unit }
}

/// By how much the edge of all families has to move, m, so that pairs on it are bonds all or none; None where it may stay.
///
/// `n`: of the positions, those of points; the others, of images, see nobody. `edge`: up to which e pairs are bonds where it stays. `closed`: whether pairs exactly on the edge are. `reach`: the largest
/// length of a pair on the edge, m.
pub fn moved_edge<const D: usize>(
    positions: &[Vector<D>],
    n: usize,
    spacing: f64,
    reach: f64,
    beyond: &Beyond<'_, D>,
    edge: f64,
    closed: bool,
) -> Option<f64> {
    let window = 2.0 * BLUR * spacing;
    let (row, rows) = SAMPLE;
    let mut sample: Vec<Range<usize>> = std::iter::once(0..n).collect();
    if n > row * rows {
        sample = (0..rows).map(|k| k * (n - row) / (rows - 1)).map(|first| first..first + row).collect();
        let bins = Distances::of(positions, sample.clone(), reach, window, beyond).cluster(spacing)?.bins;
        if bins.high - bins.low <= EXACT * spacing {
            return None;
        }
    }
    let all = (0..n).step_by(512).map(|first| first..(first + 512).min(n)).collect();
    let Cluster { bins, middles } = Distances::of(positions, all, reach, window, beyond).cluster(spacing)?;
    let mean = bins.sum / bins.count as f64;
    let deviation = (bins.squares / bins.count as f64 - mean * mean).max(0.0).sqrt();
    let unit = printed_unit(sample.into_iter().flat_map(|range| &positions[range]).flatten(), spacing);
    // In a small body all pairs may be off by the same.
    let blur = if bins.high - bins.low < 0.5 * unit { unit * (D as f64).sqrt() } else { deviation };
    let is_on_edge = mean.abs() <= blur + edge.abs() + f64::min(NEAR * spacing, 10.0 * unit);
    let are_bonds = if is_on_edge { closed } else { mean < 0.0 };
    let stays = if are_bonds { bins.high <= edge } else { bins.low > edge };
    (!stays).then_some(middles[usize::from(are_bonds)])
}

#[cfg(test)]
mod tests {
    use super::super::{PartialVolume, standard};
    use super::*;
    use crate::family::{Body, BondStates};
    use crate::geometry::{Cloud, Shape};

    /// A number as it is read again after it was printed: with so many significant digits, or so many decimals.
    fn printed(x: f64, digits: usize, significant: bool) -> f64 {
        if significant { format!("{x:.*e}", digits - 1) } else { format!("{x:.digits$}") }.parse().unwrap()
    }

    /// Neighbours of each point of the lattice of a box from `low`, in point order.
    fn families<const D: usize>(body: &Body<D>) -> Vec<Vec<u32>> {
        let mut points = vec![0; body.cloud.n_slots()];
        body.cloud.slots.iter().enumerate().for_each(|(point, &slot)| points[slot as usize] = point as u32);
        let states = BondStates::whole(body);
        let of = |&slot: &u32| {
            let bonds = body.bonds_of(slot as usize).filter(|(bit, _)| states.holds(*bit));
            let mut row: Vec<u32> = bonds.map(|(_, there)| points[there]).collect();
            row.sort_unstable();
            row
        };
        body.cloud.slots.iter().map(of).collect()
    }

    fn rims<const D: usize>(cells: usize, ratios: &[f64]) {
        for h in [1.0 / 3.0, 0.01 / 7.0] {
            for low in [0.0, 0.01] {
                let shape = Shape::Box { low: [low; D], high: [low + cells as f64 * h; D] };
                for (&ratio, rule) in ratios.iter().flat_map(|ratio| PartialVolume::ALL.map(|rule| (ratio, rule))) {
                    let lattice = Cloud::lattice(&shape, h, ratio as usize + 3);
                    let places: Vec<Vector<D>> =
                        lattice.slots.iter().map(|&slot| lattice.position(slot as usize)).collect();
                    let volume = lattice.volume(lattice.slots[0] as usize);
                    let expected = families(&standard::body(lattice, ratio * h, rule));
                    for (digits, significant) in [(4, true), (6, true), (9, true), (17, true), (5, false), (9, false)] {
                        let read = |x: &Vector<D>| x.map(|x| printed(x, digits, significant));
                        let moved = |x: &Vector<D>| (0..D).map(|d| (x[d] - read(x)[d]).abs()).fold(0.0, f64::max);
                        if places.iter().map(moved).fold(0.0, f64::max) > 0.01 * h {
                            continue;
                        }
                        let cloud = Cloud::scattered(places.iter().map(read).collect(), vec![volume; places.len()]);
                        let found = families(&standard::body(cloud, ratio * h, rule));
                        assert!(
                            found == expected,
                            "{D}D, h = {h}, from {low}, δ = {ratio} h, {rule:?}, {digits} digits, {significant}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn a_lattice_in_printed_digits_has_the_families_of_the_lattice() {
        rims::<1>(40, &[1.0, 2.0, 2.5, 3.0, 3.015, 4.5]);
        rims::<2>(14, &[2f64.sqrt(), 2.0, 2.5, 3.0, 3.015, 3.15, 4.0]);
        rims::<3>(7, &[1.5, 2.0, 3.0]);
    }

    #[test]
    fn points_that_stand_anywhere_keep_the_edge() {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        for n in [400, 3000] {
            let side = (n as f64).sqrt();
            let positions: Vec<Vector<2>> = (0..n).map(|_| [side * next(), side * next()]).collect();
            for rule in PartialVolume::ALL {
                let beyond = |_: usize, _: usize, xi: &Vector<2>| rule.beyond(xi, 1.0, 3.0);
                let edge = rule.edge::<2>(1.0, 3.0);
                assert_eq!(moved_edge(&positions, n, 1.0, rule.reach::<2>(1.0, 3.0), &beyond, edge, true), None);
            }
        }
    }

    #[test]
    fn mirrored_clouds_have_mirrored_families_in_any_unit() {
        let place = |k: usize| [printed(0.1 + (k % 15) as f64 / 3.0, 4, true), printed((k / 15) as f64 / 3.0, 4, true)];
        let positions: Vec<Vector<2>> = (0..225).map(place).collect();
        for rule in PartialVolume::ALL {
            let of = |map: &dyn Fn(&Vector<2>) -> Vector<2>, unit: f64| {
                let cloud = Cloud::scattered(positions.iter().map(map).collect(), vec![(unit / 3.0).powi(2); 225]);
                families(&standard::body(cloud, unit * 2.5 / 3.0, rule))
            };
            let here = of(&|x| *x, 1.0);
            assert!(here == of(&|x| [-x[0], x[1]], 1.0) && here == of(&|x| [x[1], x[0]], 1.0), "{rule:?}");
            assert!(
                here == of(&|x| x.map(|x| 1e-3 * x), 1e-3) && here == of(&|x| x.map(|x| 39.37 * x), 39.37),
                "{rule:?}"
            );
        }
    }
}
