//! A tree of boxes over consecutive points: eight points fill a small box, eight such boxes a larger one, and so on.
//!
//! Boxes are small where consecutive points are near each other, as along a space-filling curve. No box loses a neighbour to
//! rounding: the distance² of two boxes is computed as that of two points is, from differences that are smaller or equal,
//! and rounding is monotone.

use std::ops::Range;

use rayon::prelude::*;

use crate::field::Vector;

/// Points in the smallest boxes, and boxes in a larger one.
pub const FAN: usize = 8;

/// Lowest and highest coordinates of some points.
#[derive(Clone, Copy)]
pub struct Bounds<const D: usize> {
    low: Vector<D>,
    high: Vector<D>,
}

impl<const D: usize> Bounds<D> {
    const NONE: Self = Bounds { low: [f64::INFINITY; D], high: [f64::NEG_INFINITY; D] };

    pub fn of_points(points: &[Vector<D>]) -> Self {
        points.iter().fold(Self::NONE, |all, x| all.with(&Bounds { low: *x, high: *x }))
    }

    fn with(mut self, other: &Self) -> Self {
        for d in 0..D {
            self.low[d] = self.low[d].min(other.low[d]);
            self.high[d] = self.high[d].max(other.high[d]);
        }
        self
    }

    /// The longest side.
    pub fn widest(&self) -> f64 {
        (0..D).map(|d| self.high[d] - self.low[d]).fold(0.0, f64::max)
    }

    /// Distance along one axis to what lies between `low` and `high`.
    #[inline(always)]
    pub fn gap_along(&self, axis: usize, low: f64, high: f64) -> f64 {
        larger(larger(low - self.high[axis], self.low[axis] - high), 0.0)
    }

    /// Distance² between the boxes, 0 where they overlap.
    pub fn gap(&self, other: &Self) -> f64 {
        let mut square = 0.0;
        for d in 0..D {
            let gap = self.gap_along(d, other.low[d], other.high[d]);
            square += gap * gap;
        }
        square
    }

    /// Distance² to a point, 0 inside.
    pub fn gap_to(&self, x: &Vector<D>) -> f64 {
        self.gap(&Bounds { low: *x, high: *x })
    }
}

/// The larger of two numbers that are numbers: one instruction, where `f64::max` is several.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Boxes of [`FAN`] consecutive points each, boxes of [`FAN`] of those, and so on until few are left.
pub struct Tree<const D: usize> {
    levels: Vec<Vec<Bounds<D>>>,
}

impl<const D: usize> Tree<D> {
    pub fn new(positions: &[Vector<D>]) -> Self {
        let mut boxes: Vec<Bounds<D>> = positions.par_chunks(FAN).map(Bounds::of_points).collect();
        let mut levels = Vec::new();
        while boxes.len() > FAN {
            let next = boxes.chunks(FAN).map(|few| few.iter().fold(Bounds::NONE, Bounds::with)).collect();
            levels.push(std::mem::replace(&mut boxes, next));
        }
        levels.push(boxes);
        Tree { levels }
    }

    /// Calls `visit` with the number of each smallest box within the distance², ascending.
    pub fn near(&self, bounds: &Bounds<D>, limit: f64, visit: &mut impl FnMut(usize)) {
        let top = self.levels.len() - 1;
        self.descend(top, 0..self.levels[top].len(), bounds, limit, visit);
    }

    fn descend(
        &self,
        level: usize,
        boxes: Range<usize>,
        bounds: &Bounds<D>,
        limit: f64,
        visit: &mut impl FnMut(usize),
    ) {
        for k in boxes {
            if self.levels[level][k].gap(bounds) <= limit {
                if level == 0 {
                    visit(k);
                } else {
                    let end = ((k + 1) * FAN).min(self.levels[level - 1].len());
                    self.descend(level - 1, k * FAN..end, bounds, limit, visit);
                }
            }
        }
    }
}
