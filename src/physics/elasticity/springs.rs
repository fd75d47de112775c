//! The bonds of a body at rest one by one: as springs, by how far they are from breaking, and broken by name.
//!
//! A bond is strained by its stretch s, for linear laws ξ·η/|ξ|², for the others (|ξ + η| − |ξ|)/|ξ|. A bond that is a
//! spring of its own holds ½ w s², w = c ω̃ β V′ V |ξ| (J), and pulls its ends with w s along the slope of s.

use super::Elasticity;
use crate::execution::{Broken, Packs};
use crate::family::BondStates;
use crate::field::{components, embed};
use crate::geometry::lattice::BLOCK;
use crate::parallel;
use crate::physics::{Spring, Stretched};

/// s at η, and how much it changes with η by Δη, to first order; m.
fn stretch(is_linear: bool, xi: &[f64], eta: &[f64], change: &[f64]) -> [f64; 2] {
    let sum = |term: &dyn Fn(usize) -> f64| (0..xi.len()).map(term).sum::<f64>();
    let square = sum(&|d| xi[d] * xi[d]);
    if is_linear {
        return [sum(&|d| eta[d] * xi[d]) / square, sum(&|d| change[d] * xi[d]) / square];
    }
    // As the laws: (2ξ + η)·η keeps its digits however small η is.
    let strain = sum(&|d| eta[d] * (xi[d] + (xi[d] + eta[d]))) / square;
    let length = (1.0 + strain).sqrt();
    [strain / (1.0 + length), sum(&|d| change[d] * (xi[d] + eta[d])) / (square * length)]
}

impl Spring {
    /// s at displacements `u` by slot, component after component over `n` slots, of `dimension` components, and how much it changes along `v`.
    pub fn stretch(&self, is_linear: bool, dimension: usize, n: usize, [u, v]: [&[f64]; 2]) -> [f64; 2] {
        let [eta, change] = [u, v].map(|flat| self.relative(dimension, n, flat));
        stretch(is_linear, &self.xi[..dimension], &eta[..dimension], &change[..dimension])
    }

    /// Displacement of the second end less that of the first, m.
    fn relative(&self, dimension: usize, n: usize, flat: &[f64]) -> [f64; 3] {
        let [a, b] = self.ends.map(|slot| slot as usize);
        let mut relative = [0.0; 3];
        for d in 0..dimension {
            relative[d] = self.signs[d] * flat[d * n + b] - flat[d * n + a];
        }
        relative
    }

    /// ∂s/∂η at displacements `u`, 1/m, and w s/(|y| |ξ|): the stiffness across the bond, N/m, y = ξ + η; none where the law is
    /// linear.
    pub fn slope(&self, is_linear: bool, dimension: usize, n: usize, u: &[f64]) -> ([f64; 3], f64) {
        let square = self.xi.iter().map(|x| x * x).sum::<f64>();
        if is_linear {
            return (self.xi.map(|x| x / square), 0.0);
        }
        let eta = self.relative(dimension, n, u);
        let y: [f64; 3] = std::array::from_fn(|d| self.xi[d] + eta[d]);
        let product = (square * y.iter().map(|y| y * y).sum::<f64>()).sqrt();
        let [s, _] = stretch(false, &self.xi, &eta, &eta);
        (y.map(|y| y / product), self.weight * s / product)
    }
}

impl<const D: usize, P: Packs> Elasticity<D, P> {
    /// See [`Tangent::springs`](crate::physics::Tangent::springs).
    pub(super) fn all_springs(&self) -> Option<Vec<Spring>> {
        if !self.material.has_springs() {
            return None;
        }
        let Elasticity { body, operator, failure, .. } = self;
        let whole = BondStates::whole(body);
        let weight = |bit: usize, here: usize, there: usize| {
            let xi = body.xi(bit, here, there);
            let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
            0.5 * operator.weights.of(body, bit, [here, there], &xi) * body.cloud.volume(here) * length
        };
        let of_slot = |here: usize| -> Vec<Spring> {
            let bonds = body.bonds_of(here).filter(|(bit, _)| whole.holds(*bit));
            let spring = |(bit, there): (usize, usize)| {
                let image = body.cloud.images.as_ref().map(|images| images.source(there)).filter(|of| of.0 != there);
                let back = body.bonds_of(there).find(|(back, other)| *other == here && whole.holds(*back));
                let (mut bits, mut own) = ([bit, bit], weight(bit, here, there));
                if let Some((back, _)) = back.filter(|_| image.is_none()) {
                    // Once, from the end that comes first.
                    if there < here {
                        return None;
                    }
                    own += weight(back, there, here);
                    bits[1] = back;
                }
                let (source, signs) = image.unwrap_or((there, [1.0; D]));
                Some(Spring {
                    bits,
                    ends: [here as u32, source as u32],
                    xi: embed::<D>(&body.xi(bit, here, there)),
                    signs: embed::<D>(&signs),
                    weight: own,
                    critical: failure.as_ref().map_or(f64::INFINITY, |failure| failure.of(here, there)),
                })
            };
            bonds.filter_map(spring).collect()
        };
        Some(parallel::map(body.cloud.n_slots(), &of_slot).into_iter().flatten().collect())
    }

    /// See [`Tangent::stretched`](crate::physics::Tangent::stretched).
    pub(super) fn bonds_where(
        &self,
        u: &[f64],
        v: &[f64],
        keep: &(dyn Fn(f64, f64, f64) -> bool + Sync),
    ) -> Vec<Stretched> {
        let Some(failure) = &self.failure else { return Vec::new() };
        let imaged = [u, v].map(|flat| self.imaged(flat));
        let [u, v] = [imaged[0].as_deref().unwrap_or(u), imaged[1].as_deref().unwrap_or(v)];
        let [u, v] = [u, v].map(components::<D, _>);
        let (body, states, is_linear) = (&self.body, &self.state.states, self.material.is_linear());
        let of_slot = |here: usize| -> Vec<Stretched> {
            let holding = body.bonds_of(here).filter(|(bit, _)| states.holds(*bit));
            let look = |(bit, there): (usize, usize)| {
                let critical = failure.of(here, there);
                let xi = body.xi(bit, here, there);
                let relative =
                    |flat: &[&[f64]; D]| -> [f64; D] { std::array::from_fn(|d| flat[d][there] - flat[d][here]) };
                let [stretch, rate] = stretch(is_linear, &xi, &relative(&u), &relative(&v));
                keep(stretch, rate, critical).then_some(Stretched { bit, stretch, rate, critical })
            };
            holding.filter_map(look).collect()
        };
        parallel::map(body.cloud.n_slots(), &of_slot).into_iter().flatten().collect()
    }

    /// See [`Tangent::break_bonds`](crate::physics::Tangent::break_bonds).
    pub(super) fn break_these(&mut self, u: &[f64], bits: &[usize]) -> Broken {
        let imaged = self.imaged(u);
        let u = components::<D, _>(imaged.as_deref().unwrap_or(u));
        let Elasticity { body, operator, material, state, .. } = self;
        let mut ends: Vec<usize> = bits.iter().map(|&bit| body.ends_of(bit)[0]).collect();
        ends.sort_unstable();
        ends.dedup();
        // A bond is in the energy of both its ends, and in that of no other point.
        let energy = |states: &BondStates| -> Vec<f64> {
            let of =
                |&slot: &usize| material.energy_at(body, &operator.weights, states, u, slot) * body.cloud.volume(slot);
            ends.iter().map(of).collect()
        };
        let before = energy(&state.states);
        bits.iter().for_each(|&bit| state.states.words_mut()[bit / BLOCK] &= !(1 << (bit % BLOCK)));
        let after = energy(&state.states);
        Broken { bonds: bits.len() as u64, energy: before.iter().zip(&after).map(|(a, b)| a - b).sum() }
    }
}
