//! Where which level is wanted: what was asked for, a buffer about it, and steps of one level between.

use super::{Cell, Cells};
use crate::field::{difference, norm};
use crate::geometry::cloud::for_each_cell;

/// How the size of cells changes between a fine zone and a coarse one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Transition {
    /// At once, however many levels.
    Sudden,
    /// Level by level: cells that touch differ by one at most.
    Stepwise,
    /// As stepwise, and the horizon falls off linearly within the fine cells instead of jumping: it is as large as the
    /// largest m Δx′ − |ξ| × slope of any point.
    Smooth { slope: f64 },
}

/// What is wanted of the cells of a body: for each level from 1 on, the cells of the level above that are to be split.
pub struct Zones<const D: usize> {
    levels: Vec<Raster<D>>,
}

/// Marks on the whole lattice of a level.
#[derive(Clone)]
struct Raster<const D: usize> {
    counts: [usize; D],
    marks: Vec<bool>,
}

impl<const D: usize> Raster<D> {
    fn new(counts: [usize; D]) -> Self {
        Raster { counts, marks: vec![false; counts.iter().product()] }
    }

    fn place(&self, at: [usize; D]) -> usize {
        (0..D).rev().fold(0, |place, d| place * self.counts[d] + at[d])
    }

    fn has(&self, at: [usize; D]) -> bool {
        self.marks[self.place(at)]
    }

    fn mark(&mut self, at: [usize; D]) {
        let place = self.place(at);
        self.marks[place] = true;
    }

    /// Marks the cells of this lattice in which `wish` is at least `level`.
    fn mark_cells(&mut self, cells: &Cells<D>, level: u8, wish: &[u8]) {
        let ratio = self.counts[0] / cells.counts[0];
        let own = ratio.trailing_zeros() as u8;
        for (cell, _) in cells.list().iter().zip(wish).filter(|(_, wish)| **wish >= level) {
            let at = cell.at.map(|c| c as usize);
            if cell.level >= own {
                self.mark(at.map(|c| c >> (cell.level - own)));
            } else {
                let finer = own - cell.level;
                for_each_cell([1 << finer; D], |part| {
                    self.mark(std::array::from_fn(|d| (at[d] << finer) + part[d]));
                });
            }
        }
    }

    /// Marks everything within `radius` cells of a mark: centre to centre, and `square` wide along each axis.
    fn widen(&mut self, radius: f64, square: usize) {
        let reach = (radius.floor() as i64).max(square as i64);
        if reach == 0 {
            return;
        }
        let mut offsets = Vec::new();
        for_each_cell([2 * reach as usize + 1; D], |cell| {
            let step: [i64; D] = cell.map(|c| c as i64 - reach);
            let square_reach = step.iter().all(|s| s.unsigned_abs() as usize <= square);
            if square_reach || step.iter().map(|s| (s * s) as f64).sum::<f64>() <= radius * radius {
                offsets.push(step);
            }
        });
        let old = self.marks.clone();
        let neighbour = |at: [usize; D], step: &[i64; D]| -> Option<[usize; D]> {
            let mut there = at;
            for d in 0..D {
                let c = at[d] as i64 + step[d];
                if c < 0 || c >= self.counts[d] as i64 {
                    return None;
                }
                there[d] = c as usize;
            }
            Some(there)
        };
        // Marks inside others reach nothing that these do not.
        let mut rim = Vec::new();
        for_each_cell(self.counts, |at| {
            if !old[self.place(at)] {
                return;
            }
            let inside = (0..2 * D).all(|k| {
                let mut step = [0; D];
                step[k / 2] = if k % 2 == 0 { 1 } else { -1 };
                neighbour(at, &step).is_none_or(|there| old[self.place(there)])
            });
            if !inside {
                rim.push(at);
            }
        });
        let mut marks = old;
        for at in rim {
            for step in &offsets {
                if let Some(there) = neighbour(at, step) {
                    marks[self.place(there)] = true;
                }
            }
        }
        self.marks = marks;
    }
}

impl<const D: usize> Zones<D> {
    /// `asked`, `kept`: the level that is asked for in each cell, and the one that it keeps if it has it. About what is
    /// asked for lies a buffer: no point of a coarser level is within `buffer` cells of its own level of it.
    pub fn new(cells: &Cells<D>, asked: &[u8], kept: &[u8], buffer: f64, transition: Transition) -> Self {
        let reach = if buffer > 0.0 { buffer + 0.5 * (D as f64).sqrt() } else { 0.0 };
        let raster = |level: u8| Raster::new(cells.counts.map(|n| n << level));
        let mut levels: Vec<Raster<D>> = (0..cells.levels).map(raster).collect();
        for level in (1..=cells.levels).rev() {
            let sudden = transition == Transition::Sudden;
            let mut wanted = raster(if sudden { 0 } else { level - 1 });
            wanted.mark_cells(cells, level, asked);
            wanted.widen(reach, 0);
            wanted.mark_cells(cells, level, kept);
            let this = &mut levels[level as usize - 1];
            if sudden {
                let counts = this.counts;
                for_each_cell(counts, |at| {
                    if wanted.has(at.map(|c| c >> (level - 1))) {
                        this.mark(at);
                    }
                });
                continue;
            }
            *this = wanted;
            if level < cells.levels {
                let mut finer = levels[level as usize].clone();
                finer.widen(0.0, 1);
                let this = &mut levels[level as usize - 1];
                for_each_cell(finer.counts, |at| {
                    if finer.has(at) {
                        this.mark(at.map(|c| c / 2));
                    }
                });
            }
        }
        Zones { levels }
    }

    /// Whether a cell is to be split.
    pub fn splits(&self, cell: &Cell<D>) -> bool {
        self.levels.get(cell.level as usize).is_some_and(|raster| raster.has(cell.at.map(|c| c as usize)))
    }

    /// Whether a cell and its fellows are to be merged.
    pub fn merges(&self, cell: &Cell<D>) -> bool {
        cell.level > 0 && !self.levels[cell.level as usize - 1].has(cell.at.map(|c| c as usize / 2))
    }
}

/// The horizon of each cell, m: `ratio` times its side, and by more within the fine cells of a smooth transition.
pub fn horizons<const D: usize>(cells: &Cells<D>, ratio: f64, transition: Transition) -> Vec<f64> {
    let own = |level: u8| ratio * cells.size(level);
    let mut horizons: Vec<f64> = cells.list().iter().map(|cell| own(cell.level)).collect();
    let Transition::Smooth { slope } = transition else { return horizons };
    for level in 0..cells.levels {
        let mut here = Raster::new(cells.counts.map(|n| n << level));
        for cell in cells.list().iter().filter(|cell| cell.level == level) {
            here.mark(cell.at.map(|c| c as usize));
        }
        let h = cells.size(level);
        let reach = (ratio / slope).ceil() as i64;
        for (cell, horizon) in cells.list().iter().zip(&mut horizons).filter(|(cell, _)| cell.level > level) {
            let x = cells.center(cell);
            let around = cell.at.map(|c| (c >> (cell.level - level)) as i64);
            for_each_cell([2 * reach as usize + 1; D], |step| {
                let mut at = [0; D];
                for d in 0..D {
                    let c = around[d] + step[d] as i64 - reach;
                    if c < 0 || c >= here.counts[d] as i64 {
                        return;
                    }
                    at[d] = c as usize;
                }
                if here.has(at) {
                    let coarse = Cell { level, at: at.map(|c| c as u32), ..*cell };
                    let far = norm(&difference(&cells.center(&coarse), &x));
                    *horizon = horizon.max(ratio * h - slope * far);
                }
            });
        }
    }
    horizons
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Arrangement, Cloud, Shape};

    fn plate(levels: u8) -> Cells<2> {
        let cloud = Cloud::lattice(&Shape::Box { low: [0.0; 2], high: [3.2, 1.6] }, 0.1, 3);
        let Arrangement::Lattice(lattice) = &cloud.arrangement else { panic!("a lattice") };
        Cells::new(lattice, &cloud.slots, levels)
    }

    /// Refines about a place until nothing changes.
    fn refined(buffer: f64, transition: Transition) -> Cells<2> {
        let mut cells = plate(2);
        loop {
            let is_there = |cell: &Cell<2>| {
                let x = cells.center(cell);
                u8::from((x[0] - 1.6).abs() < 0.15 && (x[1] - 0.8).abs() < 0.15) * 2
            };
            let asked: Vec<u8> = cells.list().iter().map(is_there).collect();
            let zones = Zones::new(&cells, &asked, &vec![0; asked.len()], buffer, transition);
            if cells.change(|_, cell| zones.splits(cell), |_, cell| zones.merges(cell)).is_none() {
                return cells;
            }
        }
    }

    /// Pairs of levels of cells that touch.
    fn steps(cells: &Cells<2>) -> u8 {
        let mut largest = 0;
        for cell in cells.list() {
            let (x, h) = (cells.center(cell), cells.size(cell.level));
            for step in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                let beside = std::array::from_fn(|d| x[d] + step[d] * 0.51 * h);
                if let Some(k) = cells.holding(&beside) {
                    largest = largest.max(cells.list()[k].level.abs_diff(cell.level));
                }
            }
        }
        largest
    }

    #[test]
    fn stepwise_zones_differ_by_one_level_sudden_ones_by_all() {
        assert_eq!(steps(&refined(0.0, Transition::Stepwise)), 1);
        assert_eq!(steps(&refined(3.0, Transition::Stepwise)), 1);
        assert_eq!(steps(&refined(3.0, Transition::Sudden)), 2);
    }

    #[test]
    fn coarser_points_keep_their_distance_and_what_is_not_asked_for_is_merged_again() {
        for transition in [Transition::Stepwise, Transition::Sudden] {
            let mut cells = refined(3.0, transition);
            let mut seen = [0; 3];
            for cell in cells.list() {
                let (x, h) = (cells.center(cell), cells.size(cell.level));
                let gap: [f64; 2] = std::array::from_fn(|d| ((x[d] - [1.6, 0.8][d]).abs() - 0.15).max(0.0));
                assert!(cell.level == 2 || norm(&gap) > 3.0 * h * (1.0 - 1e-9), "{cell:?}");
                seen[cell.level as usize] += 1;
            }
            assert!(seen[0] > 0 && seen[2] >= 144 && (seen[1] > 0) == (transition == Transition::Stepwise), "{seen:?}");
            let nothing = vec![0; cells.list().len()];
            let zones = Zones::new(&cells, &nothing, &nothing, 3.0, transition);
            cells.change(|_, cell| zones.splits(cell), |_, cell| zones.merges(cell));
            assert_eq!(cells.list().iter().map(|cell| cell.level).max(), Some(1));
        }
    }

    #[test]
    fn smooth_horizons_change_by_the_slope_at_most_and_are_their_own_far_away() {
        let transition = Transition::Smooth { slope: 0.5 };
        let cells = refined(9.0, transition);
        let delta = horizons(&cells, 3.0, transition);
        let (list, mut own, mut more) = (cells.list(), 0, 0);
        for (a, da) in list.iter().zip(&delta) {
            let expected = 3.0 * cells.size(a.level);
            if *da > expected {
                more += 1
            } else {
                own += 1
            }
            for (b, db) in list.iter().zip(&delta) {
                let far = norm(&difference(&cells.center(a), &cells.center(b)));
                assert!(db - da <= 0.5 * far + 1e-12, "{a:?}, {b:?}");
            }
        }
        assert!(own > 50 && more > 50, "{own}, {more}");
        assert!(
            horizons(&cells, 3.0, Transition::Stepwise).iter().zip(list).all(|(d, c)| *d == 3.0 * cells.size(c.level))
        );
    }
}
