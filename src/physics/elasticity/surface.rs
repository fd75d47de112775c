//! The surface effect: how much softer a body is where families are incomplete, and what corrects it.
//!
//! A point near a surface lacks the bonds that would lead out of the body, and the energy that these would hold (Le &
//! Bobaru 2018). Its energy density under unit strain, over that of a point with a complete family, says by how much.
//! Bonds that pre-cracks cut are counted: a crack is no surface here.

use std::collections::BTreeMap;

use serde::Serialize;

use super::kernels::{bonded_volume, spring};
use super::linear_solid::Moduli;
use super::material::{Material, On};
use crate::discretization::{BondWeighting, Correction};
use crate::execution::Packs;
use crate::family::{Body, Bond, BondKernel, BondStates};
use crate::field::Double;
use crate::lane::Lane;

/// How far the strain energy of points is off, under unit strain along each axis and in all directions alike.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct SurfaceEffect {
    /// Fraction of the points that are off by more than 1 % in one of these.
    pub points_affected: f64,
    /// The smallest energy density over that of a complete family.
    pub softest: f64,
    /// 1 − energy of the body over that with complete families, at unit strain in all directions.
    pub mean_deficit: f64,
}

/// Off by less counts as complete.
const AFFECTED: f64 = 0.01;

/// By slot: Σ k ξ_d⁴/|ξ|² along each axis and Σ k |ξ|² behind, four times the energy densities of unit strain, over the same
/// of a complete family. Where axes are fewer than three, the others are not numbers.
pub type Shares = [Vec<f64>; 4];

/// How complete the families of a body are. `scaling`: what its weights come from.
pub fn surface_effect<const D: usize, P: Packs>(
    material: &dyn Material<D, P>,
    on: &mut On<'_, D>,
    scaling: &BondWeighting,
) -> SurfaceEffect {
    let shares = material.shares(on, scaling);
    let cloud = &on.body.cloud;
    let (mut affected, mut softest, mut energy, mut complete) = (0, f64::INFINITY, 0.0, 0.0);
    for slot in cloud.stored(0..cloud.n_points()) {
        let along = || shares[..D].iter().chain(&shares[3..]).map(|share| share[slot]);
        affected += usize::from(along().any(|share| (share - 1.0).abs() > AFFECTED));
        softest = along().fold(softest, f64::min);
        energy += shares[3][slot] * cloud.volume(slot);
        complete += cloud.volume(slot);
    }
    let points_affected = affected as f64 / cloud.n_points() as f64;
    SurfaceEffect { points_affected, softest, mean_deficit: 1.0 - energy / complete }
}

/// The energy method's correction of a body.
pub fn correction_by_energy<const D: usize, P: Packs>(
    material: &dyn Material<D, P>,
    on: &mut On<'_, D>,
    scaling: &BondWeighting,
) -> Correction<D> {
    let shares = material.shares(on, scaling);
    let factors = |slot: usize| std::array::from_fn(|d| 1.0 / shares[d][slot]);
    Correction::Energy((0..on.body.cloud.n_slots()).map(factors).collect())
}

/// The volume method's correction of a body that has one horizon.
pub fn correction_by_volume<const D: usize>(on: &mut On<'_, D>, scaling: &BondWeighting) -> Correction<D> {
    let body = on.body;
    let mut shares = vec![0.0; body.cloud.n_slots()];
    bonded_volume(on.exec, body, &on.operator.volumes, &BondStates::whole(body), &mut shares);
    let complete = |size, horizon| {
        let mut sum = 0.0;
        scaling.complete::<D>(size, horizon, |_, volume| sum += volume);
        sum
    };
    // The volume of a family is that of the horizon, and goes with it.
    by_cell(body, &complete, &mut |slot, complete| shares[slot] /= complete);
    Correction::Volume(shares)
}

/// The sums of the energies of bonds, not yet over those of a complete family.
fn energies<const D: usize>(on: &mut On<'_, D>) -> Shares {
    let body = on.body;
    let mut sums: Shares = std::array::from_fn(|_| vec![0.0; body.cloud.n_slots()]);
    let (weights, whole, kernel) = (&on.operator.weights, BondStates::whole(body), UnitStrain);
    let output = sums.each_mut().map(|sum| &mut sum[..]);
    on.exec.sum_bonds::<D, 0, 4, Double>(body, weights, &whole, [], output, &kernel);
    sums
}

/// [`Shares`] of a material of bonds.
pub(super) fn shares_of_bonds<const D: usize>(on: &mut On<'_, D>, scaling: &BondWeighting) -> Shares {
    let mut shares = energies(on);
    let (body, kernel) = (on.body, UnitStrain);
    let complete = |size, horizon| {
        let mut sum = [0.0; 4];
        scaling.complete::<D>(size, horizon, |bond, _| sum = kernel.add(bond, &[], &[], 0.0, sum));
        sum
    };
    // Micromoduli scale so that the ratio δ/Δx alone matters.
    by_cell(body, &complete, &mut |slot, complete| {
        for (share, complete) in shares.iter_mut().zip(complete) {
            share[slot] /= complete;
        }
    });
    shares
}

/// Hands out, for each slot, a sum over the complete family of a point with its cell and its horizon.
fn by_cell<const D: usize, T: Copy>(body: &Body<D>, complete: &dyn Fn(f64, f64) -> T, each: &mut dyn FnMut(usize, T)) {
    let Some(grading) = &body.grading else {
        let complete = complete(body.cloud.spacing, body.horizon);
        return (0..body.cloud.n_slots()).for_each(|slot| each(slot, complete));
    };
    // By the ratio δ/Δx; in clouds, which may have a size for each point, to a quarter of a percent.
    let is_cloud = grading.horizons.windows(2).all(|pair| pair[0] == pair[1]);
    let mut known = BTreeMap::new();
    for (slot, (&size, &horizon)) in grading.sizes.iter().zip(&grading.horizons).enumerate() {
        let ratio: f64 = horizon / size;
        let key = if is_cloud { (256.0 * ratio.log2()).round().to_bits() } else { ratio.to_bits() };
        each(slot, *known.entry(key).or_insert_with(|| complete(size, horizon)));
    }
}

/// [`Shares`] of a body whose points have a weighted volume of their own, from the sums of the energies of bonds. Unit
/// strain in all directions has the energy of a complete family everywhere.
pub(super) fn shares_of_solid<const D: usize>(moduli: &Moduli, on: &mut On<'_, D>, scaling: &BondWeighting) -> Shares {
    let mut shares = energies(on);
    let body = on.body;
    let mut squares: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; body.cloud.n_slots()]);
    let (weights, whole, kernel) = (&on.operator.weights, BondStates::whole(body), Squares);
    let output = squares.each_mut().map(|sum| &mut sum[..]);
    on.exec.sum_bonds::<D, 0, 3, Double>(body, weights, &whole, [], output, &kernel);
    let complete = |size, horizon| {
        let (mut energies, mut sums) = ([0.0; 4], [0.0; 3]);
        scaling.complete::<D>(size, horizon, |bond, _| {
            energies = UnitStrain.add(bond, &[], &[], 0.0, energies);
            sums = kernel.add(bond, &[], &[], 0.0, sums);
        });
        let of_axis: [f64; D] = std::array::from_fn(|d| moduli.energy(energies[3], sums[d], energies[d]));
        of_axis
    };
    let [axes @ .., moments] = &mut shares;
    by_cell(body, &complete, &mut |slot, complete| {
        for d in (0..D).filter(|_| moments[slot] > 0.0) {
            axes[d][slot] = moduli.energy(moments[slot], squares[d][slot], axes[d][slot]) / complete[d];
        }
    });
    moments.iter_mut().for_each(|moment| *moment = if *moment > 0.0 { 1.0 } else { 0.0 });
    shares
}

/// Σ k ξ_d²
struct Squares;

impl<const D: usize> BondKernel<D, 0, 3> for Squares {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: &[L; 0], _: L, mut sum: [L; 3]) -> [L; 3] {
        let spring = spring(bond);
        for d in 0..D {
            sum[d] = (bond.xi[d] * bond.xi[d]).mul_add(spring, sum[d]);
        }
        sum
    }
}

/// Σ k ξ_d⁴/|ξ|² and Σ k |ξ|²
struct UnitStrain;

impl<const D: usize> BondKernel<D, 0, 4> for UnitStrain {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: &[L; 0], _: L, mut sum: [L; 4]) -> [L; 4] {
        let spring = spring(bond);
        for d in 0..D {
            let square = bond.xi[d] * bond.xi[d];
            sum[d] = (square * square * bond.inverse_square).mul_add(spring, sum[d]);
        }
        sum[3] = (bond.length * bond.length).mul_add(spring, sum[3]);
        sum
    }
}
