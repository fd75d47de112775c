//! Algorithm 1 of Bobaru et al. 2009: nodes come where the energy is and go when it has left.
//!
//! One level of refinement. Nodes of level 1 stay for ever; nodes of level 2 are the midpoints between them.

use super::grid::Grid;
use super::micromodulus::Micromodulus;
use super::model::{Bar, Cover, Model, Motion, Rule};

/// The horizons in a refined zone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HorizonRule {
    /// All nodes with an inserted neighbour, and the inserted ones, have this share of the horizon of level 1. With ½,
    /// δ/h is the same everywhere.
    Zone(f64),
    /// The inserted ones have half the horizon of level 1, "update volume and horizon of the new node" by the letter.
    /// A node of level 1 in the zone keeps its own and sees twice as many nodes as before.
    Inserted,
}

/// How a grid is adapted.
#[derive(Debug, Clone, Copy)]
pub struct Adaptation {
    /// Level-1 nodes with this fraction of the largest energy density, or more, are refined.
    pub threshold: f64,
    /// And so are nodes this near to them, in horizons of level 1.
    pub buffer: f64,
    pub horizons: HorizonRule,
    pub micromodulus: Micromodulus,
    pub rule: Rule,
}

/// What all changes of the grid did.
#[derive(Debug, Clone, Copy, Default)]
pub struct Books {
    pub changes: usize,
    /// Σ of the changes of energy, and Σ of their amounts.
    pub energy: f64,
    pub energy_amounts: f64,
    pub momentum: f64,
    pub momentum_amounts: f64,
    /// Fewest and most nodes, from the first change on.
    pub nodes: Option<(usize, usize)>,
    /// Σ over all calls of the number of nodes, and the number of calls.
    pub nodes_called: (usize, usize),
}

/// A bar in motion on a grid that follows it.
pub struct Adaptive<M> {
    how: Adaptation,
    /// Nodes and horizon of level 1.
    base: Vec<f64>,
    horizon: f64,
    /// Of each interval between nodes of level 1: whether its midpoint is a node.
    split: Vec<bool>,
    pub grid: Grid,
    pub model: M,
    pub motion: Motion,
    pub books: Books,
}

impl<M: Model> Adaptive<M> {
    /// At rest on vertex nodes `base` with the displacements u.
    pub fn new(how: Adaptation, base: Vec<f64>, horizon: f64, u: impl Fn(f64) -> f64) -> Self {
        let split = vec![false; base.len() - 1];
        let bar = bar(&how, &base, horizon, &split);
        let motion = Motion::released(bar.grid.at.iter().map(|&x| u(x)).collect());
        let books = Books::default();
        Self { how, base, horizon, split, model: M::new(&bar), grid: bar.grid, motion, books }
    }

    /// Refines and coarsens, once.
    pub fn adapt(&mut self) {
        let energy = self.energy();
        let wanted = self.wanted(&energy);
        if wanted != self.split {
            self.change(wanted, self.grid.sum(&energy));
        }
        let (sum, calls) = self.books.nodes_called;
        self.books.nodes_called = (sum + self.grid.count(), calls + 1);
    }

    /// `energy`: in all, before.
    fn change(&mut self, wanted: Vec<bool>, energy: f64) {
        let momentum = self.grid.sum(&self.motion.v);
        let bar = bar(&self.how, &self.base, self.horizon, &wanted);
        let carry = |values: &[f64]| bar.grid.at.iter().map(|&x| quadratic(&self.grid.at, values, x)).collect();
        self.motion = Motion { u: carry(&self.motion.u), v: carry(&self.motion.v) };
        self.model = self.model.replaced(&bar);
        self.grid = bar.grid;
        self.split = wanted;
        let energy = self.total_energy() - energy;
        let momentum = self.grid.sum(&self.motion.v) - momentum;
        let books = &mut self.books;
        books.changes += 1;
        books.energy += energy;
        books.energy_amounts += energy.abs();
        books.momentum += momentum;
        books.momentum_amounts += momentum.abs();
        let n = self.grid.count();
        let (fewest, most) = books.nodes.unwrap_or((n, n));
        books.nodes = Some((fewest.min(n), most.max(n)));
    }

    /// Energy density of every node: ½ v² and the strain energy.
    fn energy(&mut self) -> Vec<f64> {
        let mut energy = vec![0.0; self.grid.count()];
        self.model.energy(&self.motion.u, &mut energy);
        energy.iter_mut().zip(&self.motion.v).for_each(|(energy, v)| *energy += 0.5 * v * v);
        energy
    }

    /// Σ V (½ v² + W)
    pub fn total_energy(&mut self) -> f64 {
        let energy = self.energy();
        self.grid.sum(&energy)
    }

    /// The intervals next to a level-1 node that is to be refined.
    fn wanted(&self, energy: &[f64]) -> Vec<bool> {
        let trigger = self.how.threshold * energy.iter().copied().fold(0.0, f64::max);
        let reach = self.how.buffer * self.horizon * (1.0 + 1e-9);
        let hot: Vec<f64> = (0..energy.len()).filter(|&i| energy[i] >= trigger).map(|i| self.grid.at[i]).collect();
        let refined = |x: f64| {
            let after = hot.partition_point(|&at| at < x - reach);
            hot.get(after).is_some_and(|&at| at <= x + reach)
        };
        let refined: Vec<bool> = self.base.iter().map(|&x| refined(x)).collect();
        refined.windows(2).map(|ends| ends[0] || ends[1]).collect()
    }
}

/// The bar with the midpoints of the intervals that are split.
fn bar(how: &Adaptation, base: &[f64], horizon: f64, split: &[bool]) -> Bar {
    // Shares of the horizon that nodes of level 1 and 2 have in a refined zone.
    let (old, new) = match how.horizons {
        HorizonRule::Zone(share) => (share, share),
        HorizonRule::Inserted => (1.0, 0.5),
    };
    let (mut at, mut horizons) = (Vec::new(), Vec::new());
    for (k, &x) in base.iter().enumerate() {
        let fine = (k > 0 && split[k - 1]) || split.get(k) == Some(&true);
        at.push(x);
        horizons.push(if fine { old * horizon } else { horizon });
        if split.get(k) == Some(&true) {
            at.push(0.5 * (x + base[k + 1]));
            horizons.push(new * horizon);
        }
    }
    Bar {
        grid: Grid::vertices(at),
        horizon: horizons,
        micromodulus: how.micromodulus,
        rule: how.rule,
        cover: Cover::Exact,
    }
}

/// The value at x: that of a node there, or the mean of the parabolas through both neighbours and one more node to the
/// left or the right.
fn quadratic(at: &[f64], values: &[f64], x: f64) -> f64 {
    let after = at.partition_point(|&at| at < x);
    if at.get(after) == Some(&x) {
        return values[after];
    }
    let parabolas: Vec<f64> = [after.checked_sub(2), after.checked_sub(1)]
        .into_iter()
        .flatten()
        .filter(|first| first + 2 < at.len())
        .map(|first| {
            let term = |k: usize| {
                let others = (0..3).filter(|&j| j != k);
                let weight: f64 = others.map(|j| (x - at[first + j]) / (at[first + k] - at[first + j])).product();
                weight * values[first + k]
            };
            (0..3).map(term).sum()
        })
        .collect();
    parabolas.iter().sum::<f64>() / parabolas.len() as f64
}

#[cfg(test)]
mod tests {
    use super::super::engine::EngineBar;
    use super::*;

    #[test]
    fn quadratics_are_carried_exactly() {
        let at = [0.0, 1.0, 1.5, 2.0, 4.0];
        let f = |x: f64| 1.0 - 2.0 * x + 3.0 * x * x;
        let values = at.map(f);
        for x in [0.5, 1.0, 1.25, 1.75, 3.0, 4.0] {
            assert!((quadratic(&at, &values, x) - f(x)).abs() < 1e-12, "{x}");
        }
    }

    /// The refined zone follows the energy, level 1 stays, and the books count what changed.
    #[test]
    fn midpoints_come_with_the_energy_and_go() {
        let how = Adaptation {
            threshold: 0.75,
            buffer: 2.0,
            horizons: HorizonRule::Zone(0.5),
            micromodulus: Micromodulus::Triangular,
            rule: Rule::Source,
        };
        let base: Vec<f64> = (0..=40).map(f64::from).collect();
        let mut bar = Adaptive::<EngineBar>::new(how, base.clone(), 3.0, |x| (-0.1 * (x - 10.0).powi(2)).exp());
        bar.adapt();
        assert!(bar.grid.count() > 41 && bar.grid.at.contains(&10.5) && !bar.grid.at.contains(&30.5));
        bar.motion.u = bar.grid.at.iter().map(|x| (-0.1 * (x - 30.0).powi(2)).exp()).collect();
        bar.adapt();
        assert!(!bar.grid.at.contains(&5.5) && bar.grid.at.contains(&30.5));
        bar.motion.u.fill(0.0);
        bar.motion.v.fill(0.0);
        bar.motion.v[20] = 1.0;
        bar.adapt();
        assert!(base.iter().all(|x| bar.grid.at.contains(x)));
        assert_eq!(bar.books.changes, 3);
        assert!(bar.books.energy_amounts > 0.0 && bar.books.nodes.is_some_and(|(low, _)| low >= 41));
    }
}
