//! Elastic bodies that break: ρ ü = Σ μ f(ξ, η) β V′ + b.
//!
//! The equation of motion of Silling & Askari (2005), discretised as in Shojaei et al. 2022, eq. (26).

pub mod bond_based;
pub mod moduli;
pub mod state_based;
pub mod surface;

use std::sync::Mutex;

use crate::discretization::{BondWeights, Operator, Regions};
use crate::execution::{BlockRow, BreakRule, Broken, Exec, Packs};
use crate::family::{Body, Bond, BondKernel, BondLaw, BondStates, Families};
use crate::field::{Double, Number, Precision, components, components_mut, dot};
use crate::lane::Lane;
use crate::physics::failure::CriticalStretch;
use state_based::{Changing, StateBased};

/// A law, its discretisation and its failure on one body.
#[derive(Debug, Clone)]
pub struct Elasticity<L> {
    pub law: L,
    /// ρ, kg/m³ (2D: unit thickness; 1D: unit cross-section).
    pub density: f64,
    pub operator: Operator,
    /// None: bonds never break.
    pub failure: Option<CriticalStretch>,
    /// The state-based solid that `law` gives the stretches of, in double precision; None: `law` is the whole law.
    pub state_based: Option<StateBased>,
}

/// Everything that changes in a run of an elastic body.
#[derive(Debug, Clone)]
pub struct State<P: Precision = Double> {
    /// Displacement, m; component after component over all slots.
    pub displacement: Vec<P::Field>,
    /// m/s
    pub velocity: Vec<P::Field>,
    /// Force density: internal, and after the loads are added total; N/m³.
    pub force: Vec<P::Field>,
    /// μ: one bit a directed bond.
    pub states: BondStates,
    /// Broken since the start, pre-cracks not counted.
    pub broken: Broken,
    /// Of a state-based solid: p, what dilatation pulls with, now and one evaluation before, by slot; else empty.
    pub tension: [Vec<f64>; 2],
}

impl<L> Elasticity<L> {
    /// At rest, all bonds whole.
    pub fn initial_state<const D: usize, P: Precision>(&self, body: &Body<D>) -> State<P> {
        let zeros = || vec![P::Field::default(); D * body.cloud.n_slots()];
        State {
            displacement: zeros(),
            velocity: zeros(),
            force: zeros(),
            states: BondStates::whole(body),
            broken: Broken::default(),
            tension: Default::default(),
        }
    }

    /// Breaks the bonds that the displacements overstretch, then fills `state.force` with the internal force density.
    ///
    /// `dt`: the step that led to these displacements with the velocities as they are now, for the books of the
    /// energy that broken bonds take; zero at the start. `hybrid`: the points whose bonds are not asked, if any.
    pub fn evaluate<const D: usize, P: Packs>(
        &self,
        body: &Body<D>,
        exec: &mut Exec,
        state: &mut State<P>,
        dt: f64,
        hybrid: Option<&Edge<'_>>,
    ) where
        L: BondLaw<D>,
    {
        if self.state_based.is_some() {
            state.changing().turn();
            self.extend(body, exec, state, dt, self.failure.as_ref(), hybrid);
            return self.pull(body, exec, state);
        }
        let (input, output) = (components::<D, _>(&state.displacement), components_mut::<D, _>(&mut state.force));
        let Some(failure) = &self.failure else {
            return self.force_density::<D, P>(body, exec, &state.states, input, output);
        };
        let (law, velocity) = (self.law, components::<D, _>(&state.velocity));
        let rule = Breaking::<D, L, P::Field> { failure, law, displacement: input, velocity, dt, hybrid };
        let now = self.break_by::<D, P>(body, exec, &mut state.states, input, output, &rule);
        state.broken.bonds += now.bonds;
        state.broken.energy += now.energy;
    }

    /// The first pass of a state-based solid: [`StateBased::extend`].
    ///
    /// # Panics
    /// If it is of bonds.
    pub fn extend<const D: usize, P: Packs>(
        &self,
        body: &Body<D>,
        exec: &mut Exec,
        state: &mut State<P>,
        dt: f64,
        failure: Option<&CriticalStretch>,
        hybrid: Option<&Edge<'_>>,
    ) {
        let solid = self.state_based.as_ref().expect(TWO_PASSES);
        solid.extend(body, &self.operator.weights, failure, exec, &mut state.changing(), dt, hybrid);
    }

    /// The second: [`StateBased::pull`].
    ///
    /// # Panics
    /// If it is of bonds.
    pub fn pull<const D: usize, P: Packs>(&self, body: &Body<D>, exec: &mut Exec, state: &mut State<P>) {
        let solid = self.state_based.as_ref().expect(TWO_PASSES);
        solid.pull(body, &self.operator.weights, exec, &mut state.changing());
    }

    /// Internal force density (N/m³) at given displacements; no bond breaks.
    pub fn force_density<const D: usize, P: Packs>(
        &self,
        body: &Body<D>,
        exec: &mut Exec,
        states: &BondStates,
        displacement: [&[P::Field]; D],
        force: [&mut [P::Field]; D],
    ) where
        L: BondLaw<D>,
    {
        let weights = &self.operator.weights;
        if let Some(solid) = &self.state_based {
            let (displacement, mut force) = (displacement.map(doubles), force.map(doubles_mut));
            return solid.force_density(body, weights, exec, states, &displacement, &mut force);
        }
        exec.sum_bonds::<D, D, D, P>(body, weights, states, displacement, force, &Force(self.law));
    }

    /// The same, after the bonds that `rule` breaks at these displacements are broken.
    pub fn break_by<const D: usize, P: Packs>(
        &self,
        body: &Body<D>,
        exec: &mut Exec,
        states: &mut BondStates,
        displacement: [&[P::Field]; D],
        force: [&mut [P::Field]; D],
        rule: &impl BreakRule<D>,
    ) -> Broken
    where
        L: BondLaw<D>,
    {
        assert!(self.state_based.is_none(), "bonds of a state-based solid break in `evaluate` only");
        let (weights, kernel) = (&self.operator.weights, Force(self.law));
        exec.sum_bonds_and_break::<D, D, D, P>(body, weights, states, displacement, force, &kernel, rule)
    }

    /// Diagonal of the stiffness at rest, Σ k e_d² β V′ with e = ξ/|ξ| (N/m⁴), by slot and component.
    pub fn diagonal<const D: usize>(
        &self,
        body: &Body<D>,
        exec: &mut Exec,
        states: &BondStates,
        mut diagonal: [&mut [f64]; D],
    ) where
        L: BondLaw<D>,
    {
        if let Some(solid) = &self.state_based {
            return solid.diagonal(body, &self.operator.weights, exec, states, &mut diagonal);
        }
        let (weights, kernel) = (&self.operator.weights, Diagonal(self.law));
        exec.sum_bonds::<D, 0, D, Double>(body, weights, states, [], diagonal, &kernel);
    }

    /// Row `row` of the block of each point on the diagonal of −∂force/∂u at rest: Σ e_row e_d k β V′ over whole bonds,
    /// N/m⁴ in 3D.
    pub fn diagonal_row<const D: usize>(
        &self,
        row: usize,
        body: &Body<D>,
        exec: &mut Exec,
        states: &BondStates,
        sums: [&mut [f64]; D],
    ) where
        L: BondLaw<D>,
    {
        let (weights, kernel) = (&self.operator.weights, DiagonalRow(self.law, row));
        exec.sum_bonds::<D, 0, D, Double>(body, weights, states, [], sums, &kernel);
    }

    /// ∂f/∂η of every whole bond at these displacements (m), weighted, by the slot of x.
    pub fn stiffness<const D: usize>(
        &self,
        body: &Body<D>,
        states: &BondStates,
        displacement: [&[f64]; D],
    ) -> Vec<BlockRow<D>>
    where
        L: BondLaw<D>,
    {
        assert!(self.state_based.is_none(), "points of a state-based solid feel more than their families");
        let law = self.law;
        Exec::blocks(body, &self.operator.weights, states, displacement, |bond, eta| law.stiffness(bond, eta))
    }

    /// Strain energy density at each slot, W = ½ Σ w β V′ (J/m³); eq. (9).
    pub fn strain_energy_density<const D: usize, P: Packs>(
        &self,
        body: &Body<D>,
        exec: &mut Exec,
        state: &State<P>,
        density: &mut [P::Field],
    ) where
        L: BondLaw<D>,
    {
        let input = components::<D, _>(&state.displacement);
        if let Some(solid) = &self.state_based {
            let (input, density) = (input.map(doubles), doubles_mut(density));
            return solid.strain_energy_density(body, &self.operator.weights, exec, &state.states, &input, density);
        }
        let (weights, kernel) = (&self.operator.weights, Energy(self.law));
        exec.sum_bonds::<D, D, 1, P>(body, weights, &state.states, input, [density], &kernel);
    }

    /// Σ β V′ over the bonds that `states` holds, at each slot.
    pub fn bonded_volume<const D: usize>(
        &self,
        body: &Body<D>,
        exec: &mut Exec,
        states: &BondStates,
        volume: &mut [f64],
    ) {
        exec.sum_bonds::<D, 0, 1, Double>(body, &self.operator.volumes, states, [], [volume], &Weight);
    }

    /// Largest stable step of velocity Verlet, s: Δt = √(2ρ / max Σ k β V′), k the spring constant of a bond.
    ///
    /// Silling & Askari (2005), by a Gershgorin bound on the spectral radius: never too large for a linear body, and
    /// for stretches far below one not too large for a nonlinear one either.
    pub fn stable_step<const D: usize>(&self, body: &Body<D>) -> f64
    where
        L: BondLaw<D>,
    {
        if let Some(solid) = &self.state_based {
            return solid.stable_step(self.density);
        }
        let stiffest = match (&body.families, &self.operator.weights) {
            (Families::Lattice(families), BondWeights::Lattice(weights)) => {
                families.offsets.iter().zip(weights).map(|(o, w)| self.law.tangent(o.length, *w)).sum::<f64>()
            }
            (Families::Cloud(_), weights) => {
                let mut spring = vec![0.0; body.cloud.n_slots()];
                let whole = BondStates::whole(body);
                let kernel = Tangent(self.law);
                Exec::default().sum_bonds::<D, 0, 1, Double>(body, weights, &whole, [], [&mut spring], &kernel);
                spring.into_iter().fold(0.0, f64::max)
            }
            _ => unreachable!("weights are built on the families of their body"),
        };
        (2.0 * self.density / stiffest).sqrt()
    }
}

impl<P: Precision> State<P> {
    pub fn changing(&mut self) -> Changing<'_> {
        Changing {
            displacement: doubles(&self.displacement),
            velocity: doubles(&self.velocity),
            force: doubles_mut(&mut self.force),
            states: &mut self.states,
            broken: &mut self.broken,
            tension: &mut self.tension,
        }
    }
}

const TWO_PASSES: &str = "only state-based solids have two passes";
const DOUBLE_ONLY: &str = "state-based solids are of double precision";

pub(crate) fn doubles<F: Number>(field: &[F]) -> &[f64] {
    F::doubles(field).expect(DOUBLE_ONLY)
}

pub(crate) fn doubles_mut<F: Number>(field: &mut [F]) -> &mut [f64] {
    F::doubles_mut(field).expect(DOUBLE_ONLY)
}

/// Σ f
struct Force<L>(L);

impl<const D: usize, B: BondLaw<D>> BondKernel<D, D, D> for Force<B> {
    const SMALL: f64 = B::SMALL;
    const LINEAR: bool = B::LINEAR;

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        self.0.strain(bond, eta)
    }
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], strain: L, sum: [L; D]) -> [L; D] {
        self.0.force(bond, eta, strain, sum)
    }
    #[inline(always)]
    fn add_small<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], strain: L, sum: [L; D]) -> [L; D] {
        self.0.small_force(bond, eta, strain, sum)
    }
}

/// ½ Σ w
struct Energy<L>(L);

impl<const D: usize, B: BondLaw<D>> BondKernel<D, D, 1> for Energy<B> {
    const SMALL: f64 = B::SMALL;

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        self.0.strain(bond, eta)
    }
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; D], strain: L, [sum]: [L; 1]) -> [L; 1] {
        [L::splat(0.5).mul_add(self.0.energy(bond, strain), sum)]
    }
    #[inline(always)]
    fn add_small<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; D], strain: L, [sum]: [L; 1]) -> [L; 1] {
        [L::splat(0.5).mul_add(self.0.small_energy(bond, strain), sum)]
    }
}

/// Σ k
struct Tangent<L>(L);

impl<const D: usize, B: BondLaw<D>> BondKernel<D, 0, 1> for Tangent<B> {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: L, [sum]: [L; 1]) -> [L; 1] {
        [sum + self.0.tangent(bond.length, bond.weight)]
    }
}

/// Σ k e_d²
struct Diagonal<L>(L);

impl<const D: usize, B: BondLaw<D>> BondKernel<D, 0, D> for Diagonal<B> {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: L, mut sum: [L; D]) -> [L; D] {
        let spring = self.0.tangent(bond.length, bond.weight) * bond.inverse_square;
        for d in 0..D {
            sum[d] = (bond.xi[d] * bond.xi[d]).mul_add(spring, sum[d]);
        }
        sum
    }
}

/// One row of Σ k e eᵀ at rest.
struct DiagonalRow<L>(L, usize);

impl<const D: usize, B: BondLaw<D>> BondKernel<D, 0, D> for DiagonalRow<B> {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: L, mut sum: [L; D]) -> [L; D] {
        let spring = self.0.tangent(bond.length, bond.weight) * bond.inverse_square * bond.xi[self.1];
        for d in 0..D {
            sum[d] = bond.xi[d].mul_add(spring, sum[d]);
        }
        sum
    }
}

/// Σ of the weights themselves.
struct Weight;

impl<const D: usize> BondKernel<D, 0, 1> for Weight {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: L, [sum]: [L; 1]) -> [L; 1] {
        [sum + bond.weight]
    }
}

/// Where bonds end at points with a row, which stands for unbroken bonds: such bonds do not break, and are told of.
pub struct Edge<'a> {
    pub regions: &'a Regions,
    pub overstretched: Mutex<Overstretched>,
}

/// Bonds beyond their critical stretch, by the slots of both ends, in no order.
#[derive(Debug, Default)]
pub struct Overstretched {
    /// Broken.
    pub broken: Vec<u32>,
    /// With an end that has a row, and whole.
    pub held: Vec<u32>,
}

impl Edge<'_> {
    /// Takes note of a bond; whether it may break.
    fn may_break(&self, here: usize, there: usize) -> bool {
        let free = !self.regions.has_row(here) && !self.regions.has_row(there);
        let mut list = self.overstretched.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let list = if free { &mut list.broken } else { &mut list.held };
        list.extend([here as u32, there as u32]);
        free
    }
}

/// The critical stretch, and what is needed to know the energy that a broken bond takes.
struct Breaking<'a, const D: usize, L: BondLaw<D>, F> {
    failure: &'a CriticalStretch,
    law: L,
    displacement: [&'a [F]; D],
    velocity: [&'a [F]; D],
    dt: f64,
    hybrid: Option<&'a Edge<'a>>,
}

impl<const D: usize, L: BondLaw<D>, F: Number> BreakRule<D> for Breaking<'_, D, L, F> {
    fn threshold(&self) -> f64 {
        self.law.strain_at(self.failure.smallest())
    }

    fn breaks(&self, here: usize, there: usize, strain: f64) -> bool {
        strain > self.law.strain_at(self.failure.of(here, there))
            && self.hybrid.is_none_or(|edge| edge.may_break(here, there))
    }

    /// Half of w(η) + ½ f(η)·Δη, with η at the start of the step in which the bond breaks and Δη its change in the
    /// step: what the bond held, and what it still took from the motion, since velocity Verlet kicks with its force at
    /// the start of the step and no longer with that at the end. So the books balance whatever the step.
    fn released(&self, bond: &Bond<D, f64>, here: usize, there: usize) -> f64 {
        let difference = |f: &[&[F]; D], d: usize| f[d][there].to_f64() - f[d][here].to_f64();
        let change: [f64; D] = std::array::from_fn(|d| self.dt * difference(&self.velocity, d));
        let before: [f64; D] = std::array::from_fn(|d| difference(&self.displacement, d) - change[d]);
        let strain = self.law.strain(bond, &before);
        let force = self.law.force(bond, &before, strain, [0.0; D]);
        0.5 * (self.law.energy(bond, strain) + 0.5 * dot(&force, &change))
    }
}
