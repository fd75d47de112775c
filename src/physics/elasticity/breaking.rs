//! Bonds that a step of motion overstretches, and the energy that they take.

use super::material::RowBoundary;
use crate::execution::BreakRule;
use crate::family::{Bond, BondLaw};
use crate::field::{Number, dot};
use crate::physics::failure::CriticalStretch;

/// The critical stretch in a step that ends at `displacement` (m) and in which it changes by `dt` (s) · `velocity` (m/s).
pub struct Breaking<'a, const D: usize, L, F> {
    pub failure: &'a CriticalStretch,
    pub law: L,
    pub displacement: [&'a [F]; D],
    pub velocity: [&'a [F]; D],
    pub dt: f64,
    /// The points whose bonds are not asked, if any.
    pub edge: Option<&'a RowBoundary<'a, D>>,
}

impl<const D: usize, L: BondLaw<D>, F: Number> Breaking<'_, D, L, F> {
    /// η at the start of the step and its change Δη in the step, m.
    pub fn step(&self, here: usize, there: usize) -> [[f64; D]; 2] {
        let difference = |f: &[&[F]; D], d: usize| f[d][there].to_f64() - f[d][here].to_f64();
        let change: [f64; D] = std::array::from_fn(|d| self.dt * difference(&self.velocity, d));
        [std::array::from_fn(|d| difference(&self.displacement, d) - change[d]), change]
    }
}

impl<const D: usize, L: BondLaw<D>, F: Number> BreakRule<D> for Breaking<'_, D, L, F> {
    fn threshold(&self) -> f64 {
        self.law.strain_at(self.failure.smallest())
    }

    fn breaks(&self, here: usize, there: usize, strain: f64) -> bool {
        strain > self.law.strain_at(self.failure.of(here, there))
            && self.edge.is_none_or(|edge| edge.may_break(here, there))
    }

    /// Half of w(η) + ½ f(η)·Δη, with η at the start of the step in which the bond breaks and Δη its change in the
    /// step: what the bond held, and what it still took from the motion, since velocity Verlet kicks with its force at
    /// the start of the step and no longer with that at the end. So the books balance whatever the step.
    fn released(&self, bond: &Bond<D, f64>, here: usize, there: usize) -> f64 {
        let [start, change] = self.step(here, there);
        let strain = self.law.strain(bond, &start);
        let force = self.law.force(bond, &start, strain, [0.0; D]);
        0.5 * (self.law.energy(bond, strain) + 0.5 * dot(&force, &change))
    }
}
