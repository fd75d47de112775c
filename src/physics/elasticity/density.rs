//! ρ of a body: one number, or one by point where materials differ.

use crate::discretization::Heterogeneity;
use crate::field::Number;
use crate::unknown::RelativeInertia;

/// Densities, in the numbers of the fields that they divide.
#[derive(Debug, Clone)]
pub struct Density<F> {
    /// ρ₀, kg/m³ (2D: unit thickness; 1D: unit cross-section): of all points, or what theirs are multiples of.
    pub unit: f64,
    /// ρ/ρ₀ by slot, and ρ₀/ρ; empty where all points have ρ₀.
    relative: Vec<F>,
    inverse: Vec<F>,
}

impl<F: Number> Density<F> {
    /// Of all points, kg/m³.
    pub fn same(density: f64) -> Self {
        Density { unit: density, relative: Vec::new(), inverse: Vec::new() }
    }

    /// ρ by slot, kg/m³; zero where there is no point.
    pub fn by_slot(densities: &[f64]) -> Self {
        let unit = densities.iter().copied().find(|&density| density > 0.0).unwrap_or(1.0);
        if densities.iter().all(|&density| density == unit || density == 0.0) {
            return Density::same(unit);
        }
        // A slot without a point is at rest whatever it weighs.
        let relative = densities.iter().map(|&density| if density > 0.0 { density / unit } else { 1.0 });
        Density::of(unit, relative.collect())
    }

    fn of(unit: f64, relative: Vec<f64>) -> Self {
        let inverse = relative.iter().map(|m| F::from_f64(1.0 / m)).collect();
        Density { unit, relative: relative.into_iter().map(F::from_f64).collect(), inverse }
    }

    /// ρ/ρ₀ by slot, as solvers ask for it; None where all points have ρ₀.
    pub fn by_place(&self) -> Option<RelativeInertia<'_, F>> {
        let Density { relative, inverse, .. } = self;
        (!self.is_same()).then_some(RelativeInertia { relative, inverse })
    }

    /// The same, but so inert that nothing moves it where `moves` does not hold.
    pub fn only(&self, n_slots: usize, moves: impl Fn(usize) -> bool) -> Self {
        let relative = |slot: usize| if moves(slot) { self.at(slot) / self.unit } else { 1e30 };
        Density::of(self.unit, (0..n_slots).map(relative).collect())
    }

    /// Bytes.
    pub fn memory(&self) -> usize {
        size_of_val(&self.relative[..]) + size_of_val(&self.inverse[..])
    }

    /// kg/m³
    #[inline]
    pub fn at(&self, slot: usize) -> f64 {
        self.relative.get(slot).map_or(self.unit, |relative| self.unit * relative.to_f64())
    }

    pub fn is_same(&self) -> bool {
        self.relative.is_empty()
    }

    /// The smallest of ρ over a number of each slot, or with the largest number where ρ is one: what bounds a step.
    pub fn least_over(&self, numbers: &[f64]) -> f64 {
        if self.is_same() {
            return self.unit / numbers.iter().copied().fold(0.0, f64::max);
        }
        let ratio = |(slot, &number): (usize, &f64)| if number > 0.0 { self.at(slot) / number } else { f64::INFINITY };
        numbers.iter().enumerate().map(ratio).fold(f64::INFINITY, f64::min)
    }

    /// The smallest of ρ over c/c₀ at these slots: what is slowest to follow.
    pub fn least_per_constant(&self, varied: Option<&Heterogeneity>, slots: &[u32]) -> f64 {
        let Some(varied) = varied else {
            return slots.iter().map(|&slot| self.at(slot as usize)).fold(f64::INFINITY, f64::min);
        };
        let ratio = |&slot: &u32| self.at(slot as usize) / varied.relative(slot as usize);
        slots.iter().map(ratio).fold(f64::INFINITY, f64::min)
    }

    /// For points of which each is of the material of one before: `from` by slot.
    pub fn inherited(&self, from: &[usize]) -> Self {
        if self.is_same() {
            return self.clone();
        }
        Density::of(self.unit, from.iter().map(|&old| self.relative[old].to_f64()).collect())
    }
}
