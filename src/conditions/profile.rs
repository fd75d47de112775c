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
}

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
        FormulaAtPoints { expression, columns, values: vec![0.0; count], moves, ready: false }
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
        FormulaAtPoints::with(self.expression.clone(), columns, slots)
    }

    /// The values at time `t`, in the order of the set.
    pub fn at(&mut self, t: f64) -> &[f64] {
        if self.moves || !self.ready {
            let [x, y, z] = &self.columns;
            self.expression.evaluate_batch(&[x, y, z, &[t]], &mut self.values);
            self.ready = true;
        }
        &self.values
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
