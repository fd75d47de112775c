//! Body forces, and tractions and pressures, which are spread over the points beside a surface or over a layer.

use std::sync::Arc;

use super::{Booked, FormulaAtPoints, Moment, Scale, Spread, Term, Volumes, acts_from, acts_to};
use crate::field::Number;
use crate::refinement::Remap;
use crate::unknown::{Component, Unknown, with};
use crate::visit::Visitor;

/// A force density on one component at the points of a set, b(x, t) in N/m³.
///
/// What acts on a surface is [spread](Spread) over the points beside it. In a layer of thickness ℓ a traction t is the body force
/// t/ℓ (Shojaei et al. 2022, section 2.1).
#[derive(Debug, Clone)]
pub struct Load {
    pub slots: Arc<[u32]>,
    pub component: usize,
    pub profile: FormulaAtPoints,
    /// Multiplies the profile: 1 for body forces, 1/ℓ in layers.
    pub scale: Scale,
    /// Instead of that: the profile is at pieces of a surface, and says forces.
    pub spread: Option<Spread>,
    /// Acts while t ≤ until, s.
    pub until: f64,
    /// Of the points of the set.
    volume: Scale,
    /// Force density and displacement at the last evaluation: what the work of the load is computed from. Empty before the
    /// first.
    force: Vec<f64>,
    displacement: Vec<f64>,
}

impl Load {
    /// Acts for ever, with `scale` 1.
    pub fn new(slots: Arc<[u32]>, component: usize, profile: FormulaAtPoints) -> Self {
        let (scale, volume) = (Scale::Same(1.0), Scale::Same(1.0));
        let (force, displacement) = (Vec::new(), Vec::new());
        Load { slots, component, profile, scale, spread: None, until: f64::INFINITY, volume, force, displacement }
    }

    /// On a surface; the profile is at its pieces.
    pub fn spread(slots: Vec<u32>, component: usize, profile: FormulaAtPoints, spread: Spread) -> Self {
        Load { spread: Some(spread), ..Load::new(slots.into(), component, profile) }
    }

    fn apply<T: Number>(&mut self, at: &Moment, displacement: &[T], force: &mut [T]) -> Booked {
        let active = at.acts(self.until);
        let values = self.profile.at(at.t);
        let density = density(&self.scale, self.spread.as_ref(), &self.volume);
        let [start, end] = at.weights;
        let mut booked = Booked { component: self.component, ..Booked::default() };
        let first = self.force.is_empty();
        self.force.resize(self.slots.len(), 0.0);
        self.displacement.resize(self.slots.len(), 0.0);
        for (k, &slot) in self.slots.iter().enumerate() {
            let slot = slot as usize;
            let b = if active { density(k, values) } else { 0.0 };
            let u = displacement[slot].to_f64();
            if !first {
                let volume = self.volume.of(k);
                booked.work += 0.5 * (self.force[k] + b) * volume * (u - self.displacement[k]);
                booked.impulse += (start * self.force[k] + end * b) * volume * at.dt;
            }
            force[slot] = T::from_f64(force[slot].to_f64() + b);
            self.force[k] = b;
            self.displacement[k] = u;
        }
        booked
    }

    fn act<T: Number>(&self, weight: f64, velocity: &[T]) -> Booked {
        let mut booked = Booked { component: self.component, ..Booked::default() };
        for (k, (&slot, b)) in self.slots.iter().zip(&self.force).enumerate() {
            let impulse = weight * b * self.volume.of(k);
            booked.impulse += impulse;
            if let Some(v) = velocity.get(slot as usize) {
                booked.work += impulse * v.to_f64();
            }
        }
        booked
    }
}

/// The force density on point `k` of a load, from the values of its profile.
#[inline]
fn density<'a>(scale: &'a Scale, spread: Option<&'a Spread>, volume: &'a Scale) -> impl Fn(usize, &[f64]) -> f64 + 'a {
    move |k, values| match spread {
        None => scale.of(k) * values[k],
        Some(spread) => spread.force(k, values) / volume.of(k),
    }
}

impl Term for Load {
    fn add(&mut self, at: &Moment, to: &mut Unknown<'_>) -> Booked {
        with!(to, vectors => {
            let Component { value, rate, .. } = vectors.component(self.component, to.components);
            self.apply(at, value, rate)
        })
    }

    fn ends_at(&self, t: f64) -> bool {
        acts_to(self.until, t) && !acts_from(self.until, t)
    }

    fn take_away(&mut self, from: &mut Unknown<'_>) {
        with!(from, vectors => {
            let rate = vectors.component(self.component, from.components).rate;
            for (&slot, b) in self.slots.iter().zip(&mut self.force) {
                let rate = &mut rate[slot as usize];
                *rate = Number::from_f64(rate.to_f64() - std::mem::take(b));
            }
        });
    }

    fn book(&self, weight: f64, of: &mut Unknown<'_>) -> Booked {
        with!(of, vectors => self.act(weight, vectors.component(self.component, of.components).velocity))
    }

    fn restart(&mut self) {
        self.force.clear();
        self.displacement.clear();
    }

    fn force(&mut self, t: f64, load: &mut [f64], n: usize) {
        if !acts_to(self.until, t) {
            return;
        }
        let component = &mut load[self.component * n..][..n];
        let values = self.profile.at(t);
        let density = density(&self.scale, self.spread.as_ref(), &self.volume);
        for (k, &slot) in self.slots.iter().enumerate() {
            component[slot as usize] += density(k, values);
        }
    }

    fn measure(&mut self, volumes: Volumes<'_>) {
        self.volume = volumes(&self.slots);
    }

    fn remap(&mut self, remap: &Remap) {
        if let Some(spread) = &self.spread {
            let (slots, spread) = spread.again(&remap.positions, &remap.volumes);
            (self.slots, self.spread) = (slots.into(), Some(spread));
            self.restart();
            return;
        }
        let slots = remap.members(&self.slots);
        if let Scale::ByPoint(factors) = &mut self.scale {
            let cell = |k: &u32| remap.origins[*k as usize].cell();
            let place = |k: &u32| self.slots.partition_point(|&slot| (slot as usize) < cell(k));
            *factors = slots.iter().map(|k| factors[place(k)]).collect();
        }
        self.slots = slots.into();
        self.profile = self.profile.on(&remap.positions, &self.slots);
        self.restart();
    }

    fn first_bad(&self) -> Option<(String, f64)> {
        self.profile.first_bad().map(|(_, value)| (self.profile.source().to_string(), value))
    }

    fn visit(&mut self, visitor: &mut dyn Visitor) {
        visitor.doubles("load", &mut self.force);
        visitor.doubles("load_displacement", &mut self.displacement);
    }
}
