//! The bar: a grid, a horizon at every node, a micromodulus, and the rule for bonds whose ends disagree.
//!
//! E = A = ρ = 1 throughout, as in the paper.

use super::grid::Grid;
use super::micromodulus::Micromodulus;

/// Whose horizon and micromodulus a bond has. All three agree where the horizon and the grid are uniform.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// Every bond in the sum of node i has the micromodulus and the horizon of i, as in Bobaru et al. 2009,
    /// section 4.2: k_ip = c(r; δ_i) V_ip/r. Against (38) to (41) of the paper, action is not reaction where
    /// horizons differ.
    Source,
    /// The mean of both ends' micromoduli: k_ip = V_p ½ Σ_δ c(r; δ) β(δ)/r over δ = δ_i, δ_p, where β is the part of
    /// either cell that the other node sees within δ, in the mean of both views. Symmetric.
    Average,
    /// Dual horizon: i is pulled within its own horizon and takes the reactions of those that have i in theirs,
    /// k_ip = ½ (c(r; δ_i) V_ip + c(r; δ_p) V_pi V_p/V_i)/r (Ren et al. 2016). Momentum is conserved.
    Dual,
}

impl Rule {
    pub const ALL: [Self; 3] = [Self::Source, Self::Average, Self::Dual];
}

/// How much of a cell at the rim of a horizon counts: V_ip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cover {
    /// The part inside the horizon.
    Exact,
    /// All of it if its node is inside, nothing otherwise.
    Whole,
}

#[derive(Debug, Clone)]
pub struct Bar {
    pub grid: Grid,
    /// δ_i
    pub horizon: Vec<f64>,
    pub micromodulus: Micromodulus,
    pub rule: Rule,
    pub cover: Cover,
}

impl Bar {
    /// One horizon for all nodes, exact parts of cells.
    pub fn uniform(grid: Grid, horizon: f64, micromodulus: Micromodulus, rule: Rule) -> Self {
        Self { horizon: vec![horizon; grid.count()], grid, micromodulus, rule, cover: Cover::Exact }
    }

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
        let c = |horizon: f64| self.micromodulus.value(r, horizon) / r;
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
pub struct Bonds {
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

    /// Σ_p k_ip (u_p − u_i), equation (25) without the load: force density at every node.
    pub fn force(&self, u: &[f64], force: &mut [f64]) {
        for i in 0..self.count() {
            let (first, row) = self.row(i);
            let neighbours = &u[first..first + row.len()];
            force[i] = row.iter().zip(neighbours).map(|(k, up)| k * (up - u[i])).sum();
        }
    }

    /// Σ_i V_i (L u)_i: 0 where every action has its reaction.
    pub fn total_force(&self, u: &[f64]) -> f64 {
        let mut force = vec![0.0; self.count()];
        self.force(u, &mut force);
        force.iter().zip(&self.volume).map(|(f, v)| f * v).sum()
    }

    /// Strain energy density of every node, ¼ Σ_p k_ip (u_p − u_i)², equation (10).
    pub fn energy(&self, u: &[f64]) -> Vec<f64> {
        let of = |i| {
            let (first, row) = self.row(i);
            0.25 * row.iter().enumerate().map(|(k, s)| s * (u[first + k] - u[i]).powi(2)).sum::<f64>()
        };
        (0..self.count()).map(of).collect()
    }

    /// The largest Σ_p k_ip: no eigenvalue is more than twice that.
    pub fn stiffest(&self) -> f64 {
        (0..self.count()).map(|i| self.row(i).1.iter().sum::<f64>()).fold(0.0, f64::max)
    }

    /// The matrix A of (26), row by row.
    pub fn matrix(&self) -> Vec<Vec<f64>> {
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
}

#[cfg(test)]
mod tests {
    use super::super::grid::Layout;
    use super::*;

    /// Half the bar twice as fine, with half the horizon.
    fn two_to_one(layout: Layout, micromodulus: Micromodulus, rule: Rule) -> Bar {
        let grid = Grid::zones(layout, 0.0, &[(2.0, 80), (4.0, 160)]);
        let horizon = grid.at.iter().map(|&x| if x < 2.0 { 0.125 } else { 0.0625 }).collect();
        Bar { grid, horizon, micromodulus, rule, cover: Cover::Exact }
    }

    fn residual(bar: &Bar) -> f64 {
        let mut force = vec![0.0; bar.grid.count()];
        bar.bonds().force(&bar.grid.at, &mut force);
        let inside = force.iter().zip(&bar.grid.at).filter(|(_, x)| (0.5..3.5).contains(*x));
        inside.fold(0.0, |most: f64, (f, _)| most.max(f.abs()))
    }

    /// V-S4-8. Constant micromodulus: every bond of u = x pulls with c, so the sum is c times the difference of the
    /// covered lengths on both sides, which is 0 unless the node is off the centre of its own cell.
    #[test]
    fn the_source_rule_passes_the_patch_test_where_nodes_are_centred_and_the_micromodulus_is_constant() {
        let patch = |layout| residual(&two_to_one(layout, Micromodulus::Constant, Rule::Source));
        assert!(patch(Layout::Centred) < 1e-11, "{}", patch(Layout::Centred));
        // The node between the zones has δ = 0.0625 and cells of 0.0125 on its right, 0.025 on its left.
        let expected = 2.0 / (0.0625_f64 * 0.0625) * 0.5 * (0.025 - 0.0125);
        assert!((patch(Layout::Vertex) / expected - 1.0).abs() < 1e-9, "{}", patch(Layout::Vertex));
    }

    #[test]
    fn average_and_dual_conserve_momentum_and_source_does_not() {
        for micromodulus in Micromodulus::ALL {
            for rule in Rule::ALL {
                let bar = two_to_one(Layout::Vertex, micromodulus, rule);
                let u: Vec<f64> = bar.grid.at.iter().map(|x| (3.0 * x).sin()).collect();
                let total = bar.bonds().total_force(&u).abs();
                assert_eq!(total < 1e-11, rule != Rule::Source, "{micromodulus:?}, {rule:?}: {total}");
            }
        }
    }

    #[test]
    fn rules_agree_on_a_uniform_bar() {
        let bar = |rule| {
            Bar::uniform(Grid::uniform(Layout::Centred, 0.0, 1.0, 40), 0.081, Micromodulus::Triangular, rule).bonds()
        };
        let u: Vec<f64> = (0..40).map(|i| f64::from(i).sin()).collect();
        let force = |rule| {
            let mut force = vec![0.0; 40];
            bar(rule).force(&u, &mut force);
            force
        };
        let source = force(Rule::Source);
        for rule in [Rule::Average, Rule::Dual] {
            for (a, b) in source.iter().zip(force(rule)) {
                assert!((a - b).abs() < 1e-9 * a.abs().max(1.0), "{rule:?}: {a} {b}");
            }
        }
    }
}
