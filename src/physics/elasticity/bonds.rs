//! Bond-based bodies: each bond is a spring of its own, by any [`BondLaw`].
//!
//! f = Σ μ f(ξ, η) β V′; Shojaei et al. 2022, eq. (26). One pass over the bonds, in which those that overstretch break first.

use super::State;
use super::bond_forces::{BondForce, BondForces};
use super::breaking::Breaking;
use super::density::Density;
use super::kernels::{Diagonal, DiagonalRow, Energy, Force, Spring};
use super::material::{Material, On, RowBoundary};
use super::stretched::most_stretched;
use super::surface::{Shares, shares_of_bonds};
use crate::discretization::{BondWeighting, BondWeights};
use crate::execution::{BlockRow, BreakRule, Broken, Exec, Packs, Unbreakable};
use crate::family::{Body, Bond, BondKernel, BondLaw, BondStates, Families};
use crate::field::{Double, Number, components, components_mut};
use crate::geometry::lattice::BLOCK;
use crate::physics::failure::CriticalStretch;
use crate::visit::Visitor;

/// A material of bonds alone.
#[derive(Debug, Clone)]
pub struct Bonds<L, P: Packs> {
    law: L,
    /// What the law keeps of each bond, in the order of the states; empty where it keeps nothing.
    memory: Vec<P::Bond>,
}

impl<L, P: Packs> Bonds<L, P> {
    pub fn new(law: L) -> Self {
        Bonds { law, memory: Vec::new() }
    }

    /// Sums a kernel of a law with memory, after `rule` has broken bonds; the memory changes if `keeps`.
    fn remember<const D: usize, const O: usize, R: BreakRule<D>>(
        &mut self,
        on: &mut On<'_, D>,
        states: &mut BondStates,
        u: [&[P::Field]; D],
        output: [&mut [P::Field]; O],
        kernel: &impl BondKernel<D, D, O>,
        (rule, keeps): (&R, bool),
    ) -> Broken {
        self.memory.resize(BLOCK * on.body.n_words(), P::Bond::default());
        let (weights, memory) = (&on.operator.weights, (&mut self.memory[..], keeps));
        on.exec.sum_bonds_remembering::<D, D, O, P>(on.body, weights, states, u, memory, output, kernel, rule)
    }
}

impl<const D: usize, L: BondLaw<D>, P: Packs> Material<D, P> for Bonds<L, P> {
    fn is_linear(&self) -> bool {
        L::LINEAR
    }

    /// Δt = √(2 min ρ / Σ k β V′), k the spring constant of a bond.
    ///
    /// Silling & Askari (2005), by a Gershgorin bound on the spectral radius: never too large for a linear body, and
    /// for stretches far below one not too large for a nonlinear one either.
    fn stable_step(&self, on: &mut On<'_, D>, density: &Density<P::Field>) -> f64 {
        let weights = &on.operator.weights;
        let softest = match &on.body.families {
            Families::Lattice(families) if weights.heterogeneity.is_none() && density.is_same() => {
                let all = families.offsets.iter().zip(&weights.by_offset).map(|(o, w)| w / o.length).sum::<f64>();
                density.unit / all
            }
            _ => {
                let mut spring = vec![0.0; on.body.cloud.n_slots()];
                let whole = BondStates::whole(on.body);
                on.exec.sum_bonds::<D, 0, 1, Double>(on.body, weights, &whole, [], [&mut spring], &Spring);
                density.least_over(&spring)
            }
        };
        (2.0 * softest).sqrt()
    }

    fn first_pass(
        &mut self,
        on: &mut On<'_, D>,
        state: &mut State<P>,
        step: Option<f64>,
        edge: Option<&RowBoundary<'_, D>>,
    ) {
        let State { displacement, velocity, force, states, broken } = state;
        let (u, force, kernel) = (components::<D, _>(displacement), components_mut::<D, _>(force), Force(self.law));
        let weights = &on.operator.weights;
        let rule = on.failure.zip(step).map(|(failure, dt)| {
            let velocity = components::<D, _>(velocity);
            Breaking::<D, L, P::Field> { failure, law: self.law, displacement: u, velocity, dt, edge }
        });
        let now = match rule {
            Some(rule) if L::MEMORY => self.remember(on, states, u, force, &kernel, (&rule, true)),
            None if L::MEMORY => self.remember(on, states, u, force, &kernel, (&Unbreakable, step.is_some())),
            Some(rule) => on.exec.sum_bonds_and_break::<D, D, D, P>(on.body, weights, states, u, force, &kernel, &rule),
            None => {
                on.exec.sum_bonds::<D, D, D, P>(on.body, weights, states, u, force, &kernel);
                Broken::default()
            }
        };
        broken.bonds += now.bonds;
        broken.energy += now.energy;
    }

    fn force_in_double(&self, on: &mut On<'_, D>, states: &BondStates, u: [&[f64]; D], force: [&mut [f64]; D]) {
        if L::MEMORY {
            // A copy: nothing is kept.
            let memory = self.memory.iter().map(|m| m.to_f64()).collect();
            let mut bonds = Bonds::<L, Double> { law: self.law, memory };
            bonds.remember(on, &mut states.clone(), u, force, &Force(self.law), (&Unbreakable, false));
            return;
        }
        on.exec.sum_bonds::<D, D, D, Double>(on.body, &on.operator.weights, states, u, force, &Force(self.law));
    }

    /// W = ½ Σ w β V′; eq. (9).
    fn energy_density(&self, on: &mut On<'_, D>, states: &BondStates, u: [&[P::Field]; D], density: &mut [P::Field]) {
        if L::MEMORY {
            // A copy: to look at the energy is not to go there.
            let rule = (&Unbreakable, false);
            self.clone().remember(on, &mut states.clone(), u, [density], &Energy(self.law), rule);
            return;
        }
        on.exec.sum_bonds::<D, D, 1, P>(on.body, &on.operator.weights, states, u, [density], &Energy(self.law));
    }

    /// Σ k e_d² β V′ with e = ξ/|ξ|.
    fn diagonal(&self, on: &mut On<'_, D>, states: &BondStates, diagonal: [&mut [f64]; D]) {
        on.exec.sum_bonds::<D, 0, D, Double>(on.body, &on.operator.weights, states, [], diagonal, &Diagonal);
    }

    /// Σ e_row e_d k β V′ over whole bonds.
    fn diagonal_row(&self, row: usize, on: &mut On<'_, D>, states: &BondStates, sums: [&mut [f64]; D]) -> bool {
        let (weights, kernel) = (&on.operator.weights, DiagonalRow(row));
        on.exec.sum_bonds::<D, 0, D, Double>(on.body, weights, states, [], sums, &kernel);
        true
    }

    fn stiffness(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        u: [&[f64]; D],
    ) -> Option<Vec<BlockRow<D>>> {
        let law = self.law;
        let stiffness = |bit: usize, bond: &Bond<D, f64>, eta: &[f64; D]| {
            let memory = self.memory.get(bit).map_or(0.0, |memory| memory.to_f64());
            law.stiffness(&Bond { memory, ..*bond }, eta)
        };
        Some(Exec::blocks(body, weights, states, u, stiffness))
    }

    fn has_springs(&self) -> bool {
        !L::MEMORY
    }

    fn energy_at(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        u: [&[f64]; D],
        slot: usize,
    ) -> f64 {
        let energy = |bit: usize, _, mut bond: Bond<D, f64>, eta: [f64; D]| {
            let strain = self.law.strain(&bond, &eta);
            bond.memory = self.memory.get(bit).map_or(0.0, |memory| memory.to_f64());
            bond.memory = self.law.remember(&bond, strain);
            self.law.energy(&bond, strain)
        };
        0.5 * Exec::each_bond(body, weights, states, u, slot, energy).iter().sum::<f64>()
    }

    fn bond_forces<'a>(
        &'a self,
        body: &'a Body<D>,
        weights: &'a BondWeights,
        states: &'a BondStates,
        u: [&'a [f64]; D],
    ) -> BondForces<'a, D> {
        let law = self.law;
        let force = move |bit: usize, there: usize, mut bond: Bond<D, f64>, eta: [f64; D]| {
            let strain = law.strain(&bond, &eta);
            bond.memory = self.memory.get(bit).map_or(0.0, |memory| memory.to_f64());
            bond.memory = law.remember(&bond, strain);
            let pair = law.force(&bond, &eta, strain, [0.0; D]);
            let (own, stretch) = (pair.map(|f| 0.5 * f), law.stretch_at(strain));
            BondForce { there, xi: bond.xi, eta, weight: bond.weight, own, pair, stretch }
        };
        Box::new(move |slot| Exec::each_bond(body, weights, states, u, slot, force))
    }

    fn most_stretched(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &mut BondStates,
        u: [&[P::Field]; D],
        failure: &CriticalStretch,
    ) -> Option<(f64, [usize; 2])> {
        most_stretched::<D, L, P>(self.law, body, weights, states, u, failure)
    }

    fn strain_ratio(&self, bond: &Bond<D, f64>, eta: &[f64; D], critical: f64) -> f64 {
        self.law.strain(bond, eta) / self.law.strain_at(critical)
    }

    fn memory(&self) -> usize {
        size_of_val(&self.memory[..])
    }

    fn visit(&mut self, visitor: &mut dyn Visitor) {
        P::Bond::visit(&mut self.memory, "memory_of_bonds", visitor);
    }

    fn shares(&self, on: &mut On<'_, D>, scaling: &BondWeighting) -> Shares {
        shares_of_bonds(on, scaling)
    }
}
