//! The oracle: the plain model that the studies' figures from the engine are compared with, in tests only.
//!
//! Independent of the engine and written to be read: equation (25) as it stands, with the cells' limits. [`statics`] and
//! [`dynamics`] solve it; `beside` compares.

mod beside;
mod dynamics;
mod statics;

use super::grid::Grid;
use super::micromodulus::Micromodulus;
use super::model::{Bar, Cover, Model, Motion, Rule};

/// c(r) for the horizon δ with E = A = 1: the function of the unit horizon, scaled by (36). Beyond the horizon it
/// is the value at the rim, for cells whose node lies outside and a part of them inside.
fn value(micromodulus: Micromodulus, r: f64, horizon: f64) -> f64 {
    let ratio = (r / horizon).min(1.0);
    let unit = match micromodulus {
        Micromodulus::Constant => 2.0,
        Micromodulus::Triangular => 6.0 * (1.0 - ratio),
        Micromodulus::Inverted => 3.0 * ratio,
    };
    unit * scaling(1, 1.0 / horizon)
}

/// c_ε(ξ)/c_δ(γξ) = γ^(d+1), γ = δ/ε, in d dimensions: what the scaling of the micropotential,
/// w_ε(η, ξ) = γ^d w_δ(γη, γξ), equations (35) for d = 3 and (36) for d = 1, means for c = 2w/(s² |ξ|).
pub fn scaling(dimension: i32, gamma: f64) -> f64 {
    gamma.powi(dimension + 1)
}

impl Grid {
    /// The part of cell p within the distance d of the node i.
    fn covered(&self, p: usize, i: usize, d: f64) -> f64 {
        (self.high[p].min(self.at[i] + d) - self.low[p].max(self.at[i] - d)).max(0.0)
    }
}

impl Bar {
    /// V_ip within the distance d.
    fn covered(&self, p: usize, i: usize, d: f64) -> f64 {
        match self.cover {
            Cover::Exact => self.grid.covered(p, i, d),
            Cover::Whole if (self.grid.at[p] - self.grid.at[i]).abs() <= d * (1.0 + 1e-9) => self.grid.volume(p),
            Cover::Whole => 0.0,
        }
    }

    /// Force on node i per volume and displacement of p against i.
    fn stiffness(&self, i: usize, p: usize) -> f64 {
        let grid = &self.grid;
        let r = (grid.at[p] - grid.at[i]).abs();
        let c = |horizon: f64| value(self.micromodulus, r, horizon) / r;
        let (of_i, of_p) = (self.horizon[i], self.horizon[p]);
        match self.rule {
            Rule::Source => c(of_i) * self.covered(p, i, of_i),
            Rule::Average => {
                let (v_i, v_p) = (grid.volume(i), grid.volume(p));
                let part = |d| 0.5 * (self.covered(p, i, d) / v_p + self.covered(i, p, d) / v_i);
                0.5 * v_p * (c(of_i) * part(of_i) + c(of_p) * part(of_p))
            }
            Rule::Dual => {
                let reaction = self.covered(i, p, of_p) * grid.volume(p) / grid.volume(i);
                0.5 * (c(of_i) * self.covered(p, i, of_i) + c(of_p) * reaction)
            }
        }
    }

    /// All bonds.
    pub fn bonds(&self) -> Bonds {
        let grid = &self.grid;
        let n = grid.count();
        let widest = self.horizon.iter().copied().fold(0.0, f64::max);
        let mut bonds = Bonds {
            first: Vec::with_capacity(n),
            start: vec![0],
            stiffness: Vec::new(),
            volume: (0..n).map(|i| grid.volume(i)).collect(),
        };
        for i in 0..n {
            // As far as i sees, and as far as others see some of its cell.
            let beyond = (grid.high[i] - grid.at[i]).max(grid.at[i] - grid.low[i]);
            let reach = match self.rule {
                Rule::Source => self.horizon[i],
                Rule::Average | Rule::Dual => widest + beyond,
            };
            let first = grid.high.partition_point(|&high| high <= grid.at[i] - reach);
            let end = grid.low.partition_point(|&low| low < grid.at[i] + reach);
            bonds.first.push(first);
            bonds.stiffness.extend((first..end).map(|p| if p == i { 0.0 } else { self.stiffness(i, p) }));
            bonds.start.push(bonds.stiffness.len());
        }
        bonds
    }
}

/// The sums of all nodes, row by row: the family of a node on a line is one range.
#[derive(Debug, Clone)]
pub(super) struct Bonds {
    /// First neighbour of each node.
    first: Vec<usize>,
    /// Where the row of each node begins in `stiffness`.
    start: Vec<usize>,
    stiffness: Vec<f64>,
    pub volume: Vec<f64>,
}

impl Bonds {
    /// Number of nodes.
    pub fn count(&self) -> usize {
        self.volume.len()
    }

    /// First neighbour and stiffness k_ip of it and those after it; that of i itself is 0.
    pub fn row(&self, i: usize) -> (usize, &[f64]) {
        (self.first[i], &self.stiffness[self.start[i]..self.start[i + 1]])
    }
}

impl Model for Bonds {
    fn new(bar: &Bar) -> Self {
        bar.bonds()
    }

    fn replaced(&self, bar: &Bar) -> Self {
        bar.bonds()
    }

    fn force(&mut self, u: &[f64], force: &mut [f64]) {
        for i in 0..self.count() {
            let (first, row) = self.row(i);
            let neighbours = &u[first..first + row.len()];
            force[i] = row.iter().zip(neighbours).map(|(k, up)| k * (up - u[i])).sum();
        }
    }

    fn energy(&mut self, u: &[f64], energy: &mut [f64]) {
        for i in 0..self.count() {
            let (first, row) = self.row(i);
            energy[i] = 0.25 * row.iter().enumerate().map(|(k, s)| s * (u[first + k] - u[i]).powi(2)).sum::<f64>();
        }
    }

    fn matrix(&self) -> Vec<Vec<f64>> {
        (0..self.count())
            .map(|i| {
                let (first, stiffness) = self.row(i);
                let mut row = vec![0.0; self.count()];
                row[first..first + stiffness.len()].copy_from_slice(stiffness);
                row[i] = -stiffness.iter().sum::<f64>();
                row
            })
            .collect()
    }

    fn solve(&self, load: &[f64]) -> Vec<f64> {
        statics::solve(self, load, statics::Translation::MeanZero)
    }

    fn step(&mut self, motion: &mut Motion, dt: f64) {
        dynamics::step(self, motion, dt);
    }
}

mod tests {
    use super::scaling;

    /// V-S4-7, closed form in d dimensions: W = ¼ s² ∫ c |ξ| dV = ¼ s² c S_d δ^(d+1) ∫ shape(t) t^d dt.
    #[test]
    fn scaling_keeps_the_energy_density_in_one_two_and_three_dimensions() {
        use std::f64::consts::PI;
        let (delta, epsilon, strain) = (0.7_f64, 0.2_f64, 1e-3_f64);
        for (dimension, sphere) in [(1, 2.0), (2, 2.0 * PI), (3, 4.0 * PI)] {
            let d = f64::from(dimension);
            let moments = [1.0 / (d + 1.0), 1.0 / (d + 1.0) - 1.0 / (d + 2.0), 1.0 / (d + 2.0)];
            for moment in moments {
                let density = |c: f64, h: f64| 0.25 * strain * strain * c * sphere * h.powi(dimension + 1) * moment;
                let (wide, narrow) = (density(3.0, delta), density(3.0 * scaling(dimension, delta / epsilon), epsilon));
                assert!((narrow / wide - 1.0).abs() < 1e-12, "{dimension}: {wide} {narrow}");
            }
        }
    }
}
