//! A user's formula at the points of a set.

use std::sync::Arc;

use crate::expression::Expression;
use crate::field::{Vector, embed};
use crate::geometry::Cloud;

/// The names that a formula may use, in the order in which they are given: reference position (m) and time (s).
pub const VARIABLES: [&str; 4] = ["x", "y", "z", "t"];

/// A formula in x, y, z, t, evaluated at the points of a set; again only when the time matters.
#[derive(Debug, Clone)]
pub struct FormulaAtPoints {
    expression: Expression,
    columns: [Vec<f64>; 3],
    values: Vec<f64>,
    moves: bool,
    ready: bool,
    /// It is not asked for values after this time, s.
    last: f64,
}

/// Weights of the values at t + k h for k from the second of each on, which are this many h times the slope at t: central
/// first, then farther and farther to one side.
pub struct Slope {
    times: f64,
    weights: &'static [(i32, &'static [f64])],
}

/// Of second order, from two or three values.
pub const SECOND_ORDER: Slope =
    Slope { times: 2.0, weights: &[(-1, &[-1.0, 0.0, 1.0]), (-2, &[1.0, -4.0, 3.0]), (0, &[-3.0, 4.0, -1.0])] };

/// Of fourth order, from four or five values (Abramowitz & Stegun, table 25.2).
pub const FOURTH_ORDER: Slope = Slope {
    times: 12.0,
    weights: &[
        (-2, &[1.0, -8.0, 0.0, 8.0, -1.0]),
        (-3, &[-1.0, 6.0, -18.0, 10.0, 3.0]),
        (-1, &[-3.0, -10.0, 18.0, -6.0, 1.0]),
        (-4, &[3.0, -16.0, 36.0, -48.0, 25.0]),
        (0, &[-25.0, 48.0, -36.0, 16.0, -3.0]),
    ],
};

/// In h: how far beyond its first and last instant a formula is taken to be asked because of roundings of the time.
const ROUNDING: f64 = 1e-6;
/// Of the last instant: as far behind it, a time is that instant but for the rounding of sums of steps.
const BEYOND: f64 = 1e-9;

impl FormulaAtPoints {
    pub fn new<const D: usize>(expression: Expression, cloud: &Cloud<D>, slots: &Arc<[u32]>) -> Self {
        let columns = std::array::from_fn(|axis| {
            if !expression.uses(VARIABLES[axis]) {
                return vec![0.0];
            }
            slots.iter().map(|&slot| embed(&cloud.position(slot as usize))[axis]).collect()
        });
        FormulaAtPoints::with(expression, columns, slots)
    }

    /// At places that are no points, m.
    pub fn at_places<const D: usize>(expression: Expression, places: impl Iterator<Item = Vector<D>> + Clone) -> Self {
        let columns = std::array::from_fn(|axis| places.clone().map(|x| embed(&x)[axis]).collect());
        FormulaAtPoints::of(expression, columns, places.count())
    }

    fn with(expression: Expression, columns: [Vec<f64>; 3], slots: &Arc<[u32]>) -> Self {
        FormulaAtPoints::of(expression, columns, slots.len())
    }

    fn of(expression: Expression, columns: [Vec<f64>; 3], count: usize) -> Self {
        let moves = expression.uses("t");
        FormulaAtPoints { expression, columns, values: vec![0.0; count], moves, ready: false, last: f64::INFINITY }
    }

    /// Whether it has the same value everywhere.
    pub fn is_uniform(&self) -> bool {
        !VARIABLES[..3].iter().any(|axis| self.expression.uses(axis))
    }

    /// The same formula at the points of another set. `positions` by slot, m.
    pub fn on(&self, positions: &[[f64; 3]], slots: &Arc<[u32]>) -> Self {
        let columns = std::array::from_fn(|axis| {
            if !self.expression.uses(VARIABLES[axis]) {
                return vec![0.0];
            }
            slots.iter().map(|&slot| positions[slot as usize][axis]).collect()
        });
        FormulaAtPoints { last: self.last, ..FormulaAtPoints::with(self.expression.clone(), columns, slots) }
    }

    /// The same, which may have no value before t = 0 or after `last`, s.
    pub fn until(self, last: f64) -> Self {
        FormulaAtPoints { last, ..self }
    }

    /// The time of the last value, s.
    pub fn last(&self) -> f64 {
        self.last
    }

    /// The values at time `t`, in the order of the set.
    pub fn at(&mut self, t: f64) -> &[f64] {
        if self.moves || !self.ready {
            let [x, y, z] = &self.columns;
            // But for rounding: whoever marches on beyond the end of a run gets what the formula says there.
            let t = if t <= self.last * (1.0 + BEYOND) { t.min(self.last) } else { t };
            self.expression.evaluate_batch(&[x, y, z, &[t]], &mut self.values);
            self.ready = true;
        }
        &self.values
    }

    /// The slopes at time `t`, in the order of the set, from values `h` (s) apart: to one side of `t` where others would be
    /// before t = 0 or after the last.
    pub fn slope(&mut self, t: f64, h: f64, slope: &Slope) -> Vec<f64> {
        let n = slope.weights[0].1.len();
        // All of its time may be shorter than the values are apart.
        let h = h.min(self.last / (n - 1) as f64);
        let at = |k: i32| t + f64::from(k) * h;
        let inside = |&&(first, weights): &&(i32, &[f64])| {
            at(first) >= -ROUNDING * h && at(first + weights.len() as i32 - 1) <= self.last + ROUNDING * h
        };
        let (first, weights) = *slope.weights.iter().find(inside).unwrap_or(&slope.weights[0]);
        let mut sum = vec![0.0; self.values.len()];
        for (k, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            for (sum, value) in sum.iter_mut().zip(self.at(at(first + k as i32).max(0.0))) {
                *sum += weight * value;
            }
        }
        sum.iter_mut().for_each(|sum| *sum /= slope.times * h);
        sum
    }

    /// The place in the set of the first value of the last evaluation that is not finite, and the value.
    pub fn first_bad(&self) -> Option<(usize, f64)> {
        self.values.iter().copied().enumerate().find(|(_, v)| !v.is_finite())
    }

    /// The formula as the user wrote it.
    pub fn source(&self) -> &str {
        self.expression.source()
    }
}
