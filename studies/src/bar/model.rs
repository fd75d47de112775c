//! The bar: a grid, a horizon at every node, a micromodulus, and the rule for bonds whose ends disagree; and what a model
//! of it has to know.
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
}

/// Displacements and velocities.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    pub u: Vec<f64>,
    pub v: Vec<f64>,
}

impl Motion {
    /// At rest.
    pub fn released(u: Vec<f64>) -> Self {
        Self { v: vec![0.0; u.len()], u }
    }
}

/// What computes a bar. The studies run on [the engine](super::engine); tests run them on a plain model beside it.
pub trait Model: Sized {
    fn new(bar: &Bar) -> Self;

    /// The model of a bar that shares nodes with this one.
    fn replaced(&self, bar: &Bar) -> Self;

    /// Σ_p k_ip (u_p − u_i), equation (25) without the load: force density at every node.
    fn force(&mut self, u: &[f64], force: &mut [f64]);

    /// Strain energy density of every node, ¼ Σ_p k_ip (u_p − u_i)², equation (10).
    fn energy(&mut self, u: &[f64], energy: &mut [f64]);

    /// The matrix A of (26), row by row.
    fn matrix(&self) -> Vec<Vec<f64>>;

    /// Displacements under the load density `load` with Σ V u = 0. A uniform body force takes up the total force that
    /// loads and unequal reactions leave; it is 0 where they leave none.
    fn solve(&self, load: &[f64]) -> Vec<f64>;

    /// A step of ü = L u by the classical Runge-Kutta method of order 4. Stable for Δt ω ≤ 2.83.
    fn step(&mut self, motion: &mut Motion, dt: f64);
}

#[cfg(test)]
mod tests {
    use super::super::engine::EngineBar;
    use super::super::grid::Layout;
    use super::super::oracle::Bonds;
    use super::*;

    /// Half the bar twice as fine, with half the horizon.
    fn two_to_one(layout: Layout, micromodulus: Micromodulus, rule: Rule) -> Bar {
        let grid = Grid::zones(layout, 0.0, &[(2.0, 80), (4.0, 160)]);
        let horizon = grid.at.iter().map(|&x| if x < 2.0 { 0.125 } else { 0.0625 }).collect();
        Bar { grid, horizon, micromodulus, rule, cover: Cover::Exact }
    }

    fn force<M: Model>(bar: &Bar, u: &[f64]) -> Vec<f64> {
        let mut force = vec![0.0; u.len()];
        M::new(bar).force(u, &mut force);
        force
    }

    /// V-S4-8. Constant micromodulus: every bond of u = x pulls with c, so the sum is c times the difference of the
    /// covered lengths on both sides, which is 0 unless the node is off the centre of its own cell.
    fn patch_test<M: Model>() {
        let patch = |layout| {
            let bar = two_to_one(layout, Micromodulus::Constant, Rule::Source);
            let force = force::<M>(&bar, &bar.grid.at);
            let inside = force.iter().zip(&bar.grid.at).filter(|(_, x)| (0.5..3.5).contains(*x));
            inside.fold(0.0, |most: f64, (f, _)| most.max(f.abs()))
        };
        assert!(patch(Layout::Centred) < 1e-11, "{}", patch(Layout::Centred));
        // The node between the zones has δ = 0.0625 and cells of 0.0125 on its right, 0.025 on its left.
        let expected = 2.0 / (0.0625_f64 * 0.0625) * 0.5 * (0.025 - 0.0125);
        assert!((patch(Layout::Vertex) / expected - 1.0).abs() < 1e-9, "{}", patch(Layout::Vertex));
    }

    #[test]
    fn the_source_rule_passes_the_patch_test_where_nodes_are_centred_and_the_micromodulus_is_constant() {
        patch_test::<EngineBar>();
        patch_test::<Bonds>();
    }

    fn momentum<M: Model>() {
        for micromodulus in Micromodulus::ALL {
            for rule in Rule::ALL {
                let bar = two_to_one(Layout::Vertex, micromodulus, rule);
                let u: Vec<f64> = bar.grid.at.iter().map(|x| (3.0 * x).sin()).collect();
                let total = bar.grid.sum(&force::<M>(&bar, &u)).abs();
                assert_eq!(total < 1e-11, rule != Rule::Source, "{micromodulus:?}, {rule:?}: {total}");
            }
        }
    }

    #[test]
    fn average_and_dual_conserve_momentum_and_source_does_not() {
        momentum::<EngineBar>();
        momentum::<Bonds>();
    }

    fn rules_agree<M: Model>() {
        let u: Vec<f64> = (0..40).map(|i| f64::from(i).sin()).collect();
        let force = |rule| {
            let grid = Grid::uniform(Layout::Centred, 0.0, 1.0, 40);
            force::<M>(&Bar::uniform(grid, 0.081, Micromodulus::Triangular, rule), &u)
        };
        let source = force(Rule::Source);
        for rule in [Rule::Average, Rule::Dual] {
            for (a, b) in source.iter().zip(force(rule)) {
                assert!((a - b).abs() < 1e-9 * a.abs().max(1.0), "{rule:?}: {a} {b}");
            }
        }
    }

    #[test]
    fn rules_agree_on_a_uniform_bar() {
        rules_agree::<EngineBar>();
        rules_agree::<Bonds>();
    }

    /// V-S4-7, on the grid: at equal m both horizons store the same energy; it is E s²/2 times the discrete modulus.
    fn energies<M: Model>() {
        let strain = 1e-3;
        for micromodulus in Micromodulus::ALL {
            let density = |cells: usize, horizon: f64| {
                let grid = Grid::uniform(Layout::Vertex, 0.0, 10.0, cells);
                let u: Vec<f64> = grid.at.iter().map(|x| strain * x).collect();
                let mut energy = vec![0.0; u.len()];
                M::new(&Bar::uniform(grid, horizon, micromodulus, Rule::Source)).energy(&u, &mut energy);
                energy[cells / 2]
            };
            let (coarse, fine) = (density(50, 1.0), density(150, 1.0 / 3.0));
            assert!((fine / coarse - 1.0).abs() < 1e-12, "{micromodulus:?}: {coarse} {fine}");
            let exact = 0.5 * strain * strain * micromodulus.discrete_modulus(5.0);
            assert!((coarse / exact - 1.0).abs() < 1e-12, "{micromodulus:?}: {coarse} {exact}");
        }
    }

    #[test]
    fn a_homogeneous_strain_stores_the_same_energy_at_both_horizons() {
        energies::<EngineBar>();
        energies::<Bonds>();
    }
}
