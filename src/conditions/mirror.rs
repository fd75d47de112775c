//! What mirrors do to a body: the net force by which it pulls at its own image, which is an impulse from outside.
//!
//! Bonds between points of a body take nothing from its momentum, and of a bond to an image the other half is the bond of the
//! source to the image of the point: across an even mirror their forces on the body are the same across the plane, and
//! opposite along it; across an odd one it is the other way round; across periodic ends they cancel. So the net internal force
//! is that of the mirrors.

use std::sync::Arc;

use super::{Booked, Moment, Scale, Term, Volumes};
use crate::field::Number;
use crate::parallel;
use crate::refinement::Remap;
use crate::unknown::{Unknown, Vectors, with};
use crate::visit::Visitor;

/// Points that are summed by one thread: fixed, so that sums do not depend on threads.
const CHUNK: usize = 4096;

/// The net internal force on a body in one component. It must be the first of the terms of a problem: what it finds in the
/// rate is taken for internal. It adds nothing.
#[derive(Debug, Clone)]
pub struct MirrorForce {
    /// Of the column of the history: `mirror_x_low`.
    name: String,
    /// Of all points.
    slots: Arc<[u32]>,
    component: usize,
    volume: Scale,
    /// At the last evaluation, N; of what diffuses, the amount that comes in a second.
    force: f64,
    /// Whether there was one.
    known: bool,
}

impl MirrorForce {
    /// `slots`: those of all points.
    pub fn new(name: String, slots: Arc<[u32]>, component: usize) -> Self {
        MirrorForce { name, slots, component, volume: Scale::Same(1.0), force: 0.0, known: false }
    }

    /// Σ value V over all points.
    fn sum<T: Number>(&self, values: &[T]) -> f64 {
        let chunk = |k: usize| -> f64 {
            let points = k * CHUNK..((k + 1) * CHUNK).min(self.slots.len());
            points.map(|k| values[self.slots[k] as usize].to_f64() * self.volume.of(k)).sum()
        };
        parallel::map(self.slots.len().div_ceil(CHUNK), &chunk).iter().sum()
    }

    /// Impulse over the last step, as the solver has it: velocity Verlet of both its ends, forward Euler of the start.
    fn note<T: Number>(&mut self, at: &Moment, vectors: &Vectors<'_, T>, components: usize) -> Booked {
        let n = vectors.rate.len() / components;
        let now = self.sum(&vectors.rate[self.component * n..][..n]);
        let [start, end] = at.weights;
        let mean = if vectors.velocity.is_empty() { self.force } else { start * self.force + end * now };
        let impulse = if self.known { mean * at.dt } else { 0.0 };
        (self.force, self.known) = (now, true);
        Booked { work: 0.0, impulse, component: self.component }
    }
}

impl Term for MirrorForce {
    fn add(&mut self, at: &Moment, to: &mut Unknown<'_>) -> Booked {
        let components = to.components;
        with!(to, vectors => self.note(at, vectors, components))
    }

    fn book(&self, weight: f64, _: &mut Unknown<'_>) -> Booked {
        Booked { work: 0.0, impulse: weight * self.force, component: self.component }
    }

    fn restart(&mut self) {
        self.known = false;
    }

    fn force(&mut self, _: f64, _: &mut [f64], _: usize) {}

    fn settle(&mut self, internal: &[f64], n: usize) {
        self.force = self.slots.iter().map(|&slot| internal[self.component * n + slot as usize]).sum();
    }

    fn reaction(&self) -> Option<(&str, f64)> {
        Some((&self.name, self.force))
    }

    fn measure(&mut self, volumes: Volumes<'_>) {
        self.volume = volumes(&self.slots);
    }

    /// Bodies with images keep their points.
    fn remap(&mut self, _: &Remap) {}

    fn first_bad(&self) -> Option<(String, f64)> {
        None
    }

    fn visit(&mut self, visitor: &mut dyn Visitor) {
        visitor.number("mirror_force", &mut self.force);
        visitor.flag("mirror_force_is_known", &mut self.known);
    }
}
