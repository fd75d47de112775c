//! The bar on the engine: every call of these studies into the engine stands here.
//!
//! A [`Bar`] becomes a graded body of the engine: a cloud on a line, cells that may lie off their nodes, families and
//! bond weights by [`BondWeighting`], the linear law, sums over bonds by [`Exec`]. Its equilibria are solved with the engine's
//! sparse factors, its motion is marched by the engine's Runge-Kutta method.
//!
//! Nothing breaks and the law is linear, so that the stiffness of each bond is a number: it is kept in the engine's rows
//! of points, as collocation is, and motion sums these. Sums over bonds give the same forces to rounding at fifteen times
//! the price: on a line they run on the narrowest registers, and families are filled up to sixteens.

use super::micromodulus::Micromodulus;
use super::model::{Bar, Cover, Model, Motion, Rule};
use bondwise::conditions::Stage;
use bondwise::discretization::{BondWeighting, Influence, Operator, PartialVolume};
use bondwise::execution::{Exec, PointRows};
use bondwise::family::{self, Body, Bond, BondKernel, BondLaw, BondStates, Grading, Update};
use bondwise::field::{Double, Number};
use bondwise::geometry::Cloud;
use bondwise::lane::Lane;
use bondwise::physics::elasticity::laws::BondBasedLinear;
use bondwise::physics::elasticity::moduli::{Hypothesis, micromodulus};
use bondwise::solver::linear::{Direct, Sparse};
use bondwise::solver::runge_kutta::{Memory, RungeKutta};
use bondwise::solver::{Clock, Staged, System};
use bondwise::unknown::{Numbers, Unknown, Vectors};

/// A bar as a body of the engine.
pub struct EngineBar {
    scaling: BondWeighting,
    body: Body<1>,
    operator: Operator,
    states: BondStates,
    /// k_ip of all bonds.
    rows: PointRows,
    exec: Exec,
    /// Of the stages of a step.
    memory: Memory,
}

impl EngineBar {
    fn on(scaling: BondWeighting, body: Body<1>, update: &Update, old: Option<(&Operator, &Body<1>)>) -> Self {
        let operator = scaling.operator(&body, update, old, None);
        let states = BondStates::whole(&body);
        let rest = vec![0.0; body.cloud.n_slots()];
        let stiffness = |_, bond: &Bond<1, f64>, eta: &[f64; 1]| BondBasedLinear.stiffness(bond, eta);
        let blocks = Exec::blocks(&body, &operator.weights, &states, [&rest], stiffness);
        let rows: Vec<Vec<(u32, f64)>> =
            blocks.into_iter().map(|row| row.into_iter().map(|(p, [[k]])| (p, k)).collect()).collect();
        let (rows, exec) = (PointRows::new(&rows), Exec::default());
        Self { scaling, body, operator, states, rows, exec, memory: Memory::default() }
    }

    fn count(&self) -> usize {
        self.body.cloud.n_points()
    }

    /// The number of each new node in this bar, `u32::MAX` of a node whose place, cell or horizon is another.
    fn same(&self, cloud: &Cloud<1>, grading: &Grading) -> Vec<u32> {
        let (before, old) = (&self.body.cloud, self.body.grading.as_ref().expect("a bar is graded"));
        let mut k = 0;
        let stays = |i: usize| {
            while k < self.count() && before.position(k) < cloud.position(i) {
                k += 1;
            }
            let alike = k < self.count()
                && before.position(k) == cloud.position(i)
                && (old.sizes[k], old.shifts[k], old.horizons[k])
                    == (grading.sizes[i], grading.shifts[i], grading.horizons[i]);
            if alike { k as u32 } else { u32::MAX }
        };
        (0..cloud.n_points()).map(stays).collect()
    }
}

impl Model for EngineBar {
    fn new(bar: &Bar) -> Self {
        let scaling = scaling(bar);
        let body = scaling.body(cloud(bar), grading(bar));
        Self::on(scaling, body, &Update::default(), None)
    }

    /// Families and weights of nodes far from every change are kept.
    fn replaced(&self, bar: &Bar) -> Self {
        let (cloud, grading) = (cloud(bar), grading(bar));
        let same = self.same(&cloud, &grading);
        let (body, update) = self.scaling.replaced(&self.body, cloud, grading, &same);
        Self::on(self.scaling, body, &update, Some((&self.operator, &self.body)))
    }

    fn force(&mut self, u: &[f64], force: &mut [f64]) {
        let weights = &self.operator.weights;
        self.exec.sum_bonds::<1, 1, 1, Double>(&self.body, weights, &self.states, [u], [force], &Force);
    }

    /// With Σ k (u′ − u)² = Σ k (u′² − u²) − 2 u Σ k (u′ − u): u is the displacement of a pulse, and what cancels 1e-12 of
    /// its energy.
    fn energy(&mut self, u: &[f64], energy: &mut [f64]) {
        let (squares, mut force) = (u.iter().map(|u| u * u).collect::<Vec<_>>(), vec![0.0; u.len()]);
        self.rows.sum(&squares, energy);
        self.rows.sum(u, &mut force);
        for ((energy, force), u) in energy.iter_mut().zip(&force).zip(u) {
            *energy = 0.25 * (*energy - 2.0 * u * force);
        }
    }

    fn matrix(&self) -> Vec<Vec<f64>> {
        let dense = |i: usize| {
            let mut row = vec![0.0; self.count()];
            for (p, k) in self.rows.row(i) {
                row[p] += k;
                row[i] -= k;
            }
            row
        };
        (0..self.count()).map(dense).collect()
    }

    /// K u = b − λ, where the uniform force λ takes up what is not balanced: with a spring s at the first node e,
    /// u = (K + s e eᵀ)⁻¹ (b − λ), and λ is such that the spring bears nothing.
    fn solve(&self, load: &[f64]) -> Vec<f64> {
        let mut entries = Vec::new();
        for i in 0..self.count() {
            let mut own = 0.0;
            for (p, k) in self.rows.row(i) {
                entries.push((i as u32, p as u32, -k));
                own += k;
            }
            entries.push((i as u32, i as u32, if i == 0 { 2.0 * own } else { own }));
        }
        let factors = Direct::lu(&Sparse::from_triplets(self.count(), &entries)).expect("the bar hangs together");
        let [mut u, mut uniform] = [load.to_vec(), vec![1.0; load.len()]];
        for right in [&mut u, &mut uniform] {
            factors.solve(right).expect("loads are finite");
        }
        let lambda = u[0] / uniform[0];
        let (mut moment, mut volume) = (0.0, 0.0);
        for (i, (u, uniform)) in u.iter_mut().zip(uniform).enumerate() {
            *u -= lambda * uniform;
            moment += self.body.cloud.volume(i) * *u;
            volume += self.body.cloud.volume(i);
        }
        u.iter_mut().for_each(|u| *u -= moment / volume);
        u
    }

    fn step(&mut self, motion: &mut Motion, dt: f64) {
        let mut memory = std::mem::take(&mut self.memory);
        let mut moving = Moving { rows: &self.rows, force: vec![0.0; motion.u.len()], motion };
        moving.evolve(0.0, dt);
        // Nothing depends on time.
        RungeKutta { damping: 0.0 }.step(&mut moving, &mut Clock::new(dt), &mut memory);
        self.memory = memory;
    }
}

/// The nodes. On a line, ascending places lie along a curve.
fn cloud(bar: &Bar) -> Cloud<1> {
    let grid = &bar.grid;
    let volumes = (0..grid.count()).map(|i| grid.volume(i)).collect();
    Cloud::along_curve(grid.at.iter().map(|&x| [x]).collect(), volumes)
}

fn grading(bar: &Bar) -> Grading {
    let grid = &bar.grid;
    let rule = match bar.rule {
        Rule::Source => family::Rule::Source,
        Rule::Average => family::Rule::Average,
        Rule::Dual => family::Rule::Dual,
    };
    let shift = |i: usize| [0.5 * (grid.low[i] + grid.high[i]) - grid.at[i], 0.0, 0.0];
    Grading {
        rule,
        horizons: bar.horizon.clone(),
        sizes: (0..grid.count()).map(|i| grid.volume(i)).collect(),
        shifts: (0..grid.count()).map(shift).collect(),
    }
}

fn scaling(bar: &Bar) -> BondWeighting {
    let influence = match bar.micromodulus {
        Micromodulus::Constant => Influence::Constant,
        Micromodulus::Triangular => Influence::Linear,
        Micromodulus::Inverted => Influence::Inverted,
    };
    let rule = match bar.cover {
        Cover::Exact => PartialVolume::Exact,
        Cover::Whole => PartialVolume::None,
    };
    let horizon = bar.horizon.iter().copied().fold(0.0, f64::max);
    BondWeighting { strength: micromodulus(Hypothesis::Bar, &influence, 1.0, horizon), horizon, influence, rule }
}

/// Σ f
struct Force;

impl BondKernel<1, 1, 1> for Force {
    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<1, L>, eta: &[L; 1]) -> L {
        BondBasedLinear.strain(bond, eta)
    }
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<1, L>, eta: &[L; 1], _: &[L; 0], strain: L, sum: [L; 1]) -> [L; 1] {
        BondBasedLinear.force(bond, eta, strain, sum)
    }
}

/// A bar on which nothing acts, as the engine's solvers see it.
struct Moving<'a> {
    rows: &'a PointRows,
    motion: &'a mut Motion,
    force: Vec<f64>,
}

impl System for Moving<'_> {
    fn unknown(&mut self) -> Unknown<'_> {
        let (value, velocity) = (&mut self.motion.u[..], &mut self.motion.v[..]);
        let vectors = Vectors { value, velocity, rate: &mut self.force, damped: None, relative_inertia: None };
        Unknown { vectors: Numbers::Double(vectors), components: 1, inertia: 1.0, negligible: f64::NEGLIGIBLE }
    }

    fn constrain(&mut self, _: Stage, _: f64, _: f64) {}

    fn evolve(&mut self, _: f64, _: f64) {
        self.rows.sum(&self.motion.u, &mut self.force);
    }

    /// By Gershgorin: no eigenvalue is more than twice the largest Σ_p k_ip.
    fn stable_step(&self) -> f64 {
        (2.0 / self.rows.largest()).sqrt()
    }
}

impl Staged for Moving<'_> {
    fn stage(&mut self, t: f64, _: f64, dt: f64) {
        self.evolve(t, dt);
    }

    fn book(&mut self, _: f64, _: f64, _: f64) {}

    /// The next step evaluates for itself: its nodes may be others.
    fn arrive(&mut self, _: f64, _: f64) {}
}

#[cfg(test)]
mod tests {
    use super::super::grid::{Grid, Layout};
    use super::*;

    /// Three spacings and three horizons, the middle of them moved along by `step` intervals.
    fn bar(step: usize, micromodulus: Micromodulus, rule: Rule, cover: Cover) -> Bar {
        let [a, b] = [10 + step, 20 + step].map(|k| (0.1 * k as f64, k));
        let grid = Grid::zones(Layout::Vertex, 0.0, &[a, (b.0, 20), (4.0, 40 - b.1)]);
        let zone = |x: f64| usize::from(x >= a.0) + usize::from(x >= b.0);
        let horizon = grid.at.iter().map(|&x| [0.33, 0.17, 0.25][zone(x)]).collect();
        Bar { grid, horizon, micromodulus, rule, cover }
    }

    fn each(mut check: impl FnMut(Micromodulus, Rule, Cover)) {
        for micromodulus in Micromodulus::ALL {
            for rule in Rule::ALL {
                for cover in [Cover::Exact, Cover::Whole] {
                    check(micromodulus, rule, cover);
                }
            }
        }
    }

    /// ½ Σ w
    struct Energy;

    impl BondKernel<1, 1, 1> for Energy {
        #[inline(always)]
        fn strain<L: Lane>(&self, bond: &Bond<1, L>, eta: &[L; 1]) -> L {
            BondBasedLinear.strain(bond, eta)
        }
        #[inline(always)]
        fn add<L: Lane>(&self, bond: &Bond<1, L>, _: &[L; 1], _: &[L; 0], strain: L, [sum]: [L; 1]) -> [L; 1] {
            [L::splat(0.5).mul_add(BondLaw::<1>::energy(&BondBasedLinear, bond, strain), sum)]
        }
    }

    #[test]
    fn rows_of_points_give_the_forces_and_energies_of_sums_over_bonds() {
        each(|micromodulus, rule, cover| {
            let bar = bar(0, micromodulus, rule, cover);
            let mut model = EngineBar::new(&bar);
            let u: Vec<f64> = bar.grid.at.iter().map(|x| (3.0 * x).sin()).collect();
            let [mut sums, mut rows] = [vec![0.0; u.len()], vec![0.0; u.len()]];
            // Some ten roundings of terms of up to Σ k |u|, |u| ≤ 1.
            let enough = 1e-14 * model.rows.largest();
            model.force(&u, &mut sums);
            model.rows.sum(&u, &mut rows);
            let near = |sums: &[f64], rows: &[f64]| sums.iter().zip(rows).all(|(a, b)| (a - b).abs() < enough);
            assert!(near(&sums, &rows), "{micromodulus:?} {rule:?} {cover:?}");
            let EngineBar { body, operator, states, exec, .. } = &mut model;
            exec.sum_bonds::<1, 1, 1, Double>(body, &operator.weights, states, [&u], [&mut sums], &Energy);
            model.energy(&u, &mut rows);
            assert!(near(&sums, &rows), "energies, {micromodulus:?} {rule:?} {cover:?}");
        });
    }

    #[test]
    fn a_bar_with_replaced_nodes_is_the_bar_made_anew() {
        each(|micromodulus, rule, cover| {
            let [before, after] = [0, 3].map(|step| bar(step, micromodulus, rule, cover));
            let (kept, anew) = (EngineBar::new(&before).replaced(&after), EngineBar::new(&after));
            assert_eq!(kept.matrix(), anew.matrix(), "{micromodulus:?} {rule:?} {cover:?}");
        });
    }
}
