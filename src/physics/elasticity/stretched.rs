//! How near whole bonds are to breaking: stretches over critical stretches.
//!
//! A bond breaks by the strain of its law, which for large displacements is q = s (2 + s): what is compared here are the
//! stretches s themselves, so that a ratio of one half is half of the critical stretch whatever the law.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use super::bond_forces::Pulled;
use crate::discretization::BondWeights;
use crate::execution::{BreakRule, Exec, Packs};
use crate::family::{Body, Bond, BondKernel, BondLaw, BondStates};
use crate::lane::Lane;
use crate::parallel;
use crate::physics::failure::CriticalStretch;

/// The whole bond whose stretch is the largest share of its critical stretch: see
/// [`Material::most_stretched`](super::Material::most_stretched). Of equal ones the first by the slots of its ends, whichever
/// thread meets it.
///
/// One pass that computes strains alone, many bonds side by side; a bond is looked at by itself only where its strain passes
/// that at the largest share so far.
pub(super) fn most_stretched<const D: usize, L: BondLaw<D>, P: Packs>(
    law: L,
    body: &Body<D>,
    weights: &BondWeights,
    states: &mut BondStates,
    u: [&[P::Field]; D],
    failure: &CriticalStretch,
) -> Option<(f64, [usize; 2])> {
    if !failure.smallest().is_finite() {
        return None;
    }
    let rule = Largest { law, failure, share: AtomicU64::new(0), bond: Mutex::new(None) };
    // Loops of its own, which no region of a scheme restricts.
    Exec::default().sum_bonds_and_break::<D, D, 0, P>(body, weights, states, u, [], &Strain(law), &rule);
    rule.bond.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner())
}

/// Breaks nothing, and keeps the most stretched bond of all that it is asked about.
struct Largest<'a, L> {
    law: L,
    failure: &'a CriticalStretch,
    /// Bits of the largest share so far: those of positive numbers ascend with them.
    share: AtomicU64,
    bond: Mutex<Option<(f64, [usize; 2])>>,
}

/// What is left of a share, so that bonds which have the same are asked about in spite of rounding.
const BELOW: f64 = 1.0 - 1e-14;

impl<const D: usize, L: BondLaw<D>> BreakRule<D> for Largest<'_, L> {
    fn threshold(&self) -> f64 {
        let share = f64::from_bits(self.share.load(Ordering::Relaxed));
        self.law.strain_at(BELOW * share * self.failure.smallest())
    }

    fn breaks(&self, here: usize, there: usize, strain: f64) -> bool {
        let share = self.law.stretch_at(strain) / self.failure.of(here, there);
        let bits = share.to_bits();
        if share > 0.0 && bits >= self.share.fetch_max(bits, Ordering::Relaxed) {
            let ends = [here.min(there), here.max(there)];
            let mut bond = self.bond.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            if bond.is_none_or(|(most, first)| share > most || share == most && ends < first) {
                *bond = Some((share, ends));
            }
        }
        false
    }

    fn released(&self, _: &Bond<D, f64>, _: usize, _: usize) -> f64 {
        0.0
    }
}

/// Nothing is summed; the strain is what the rule is asked about.
struct Strain<L>(L);

impl<const D: usize, B: BondLaw<D>> BondKernel<D, D, 0> for Strain<B> {
    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        self.0.strain(bond, eta)
    }
    #[inline(always)]
    fn add<L: Lane>(&self, _: &Bond<D, L>, _: &[L; D], _: &[L; 0], _: L, sum: [L; 0]) -> [L; 0] {
        sum
    }
}

/// The largest share of each point, 0 where none of its bonds is stretched.
pub(super) fn stretch_ratios<const D: usize>(
    pulled: &Pulled<'_, D>,
    failure: Option<&CriticalStretch>,
    slots: &[u32],
) -> Vec<f64> {
    let Some(failure) = failure else { return vec![0.0; slots.len()] };
    parallel::map(slots.len(), &|k| {
        let here = slots[k] as usize;
        let share = |bond: &super::bond_forces::BondForce<D>| bond.stretch / failure.of(here, bond.there);
        (pulled.bonds)(here).iter().map(share).fold(0.0, f64::max)
    })
}
