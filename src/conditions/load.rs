//! Body forces, and tractions and pressures spread over a layer.

use std::sync::Arc;

use super::Profile;
use crate::field::Number;

/// A force density on one component at the points of a set, b(x, t) in N/m³.
///
/// A traction t on a face becomes the body force t/ℓ in a layer of thickness ℓ (Shojaei et al. 2022, section 2.1); a
/// pressure acts against the outward normal of the shape.
#[derive(Debug, Clone)]
pub struct Load {
    pub slots: Arc<[u32]>,
    pub component: usize,
    pub profile: Profile,
    /// Multiplies the profile: 1 for body forces, 1/ℓ for tractions, −n/ℓ by point for pressures.
    pub scale: Scale,
    /// Acts while t ≤ until, s.
    pub until: f64,
    /// Force density and displacement at the last evaluation: what the work of the load is computed from.
    pub last: Option<Last>,
}

/// What the profile of a load is multiplied with.
#[derive(Debug, Clone)]
pub enum Scale {
    Same(f64),
    /// One factor a point of the set.
    ByPoint(Vec<f64>),
}

impl Scale {
    /// Of point `k` of the set.
    fn of(&self, k: usize) -> f64 {
        match self {
            Scale::Same(s) => *s,
            Scale::ByPoint(s) => s[k],
        }
    }
}

/// The state of a load at the last evaluation.
#[derive(Debug, Clone)]
pub struct Last {
    pub force: Vec<f64>,
    pub displacement: Vec<f64>,
}

/// Work (J) and impulse (N·s) that a load did over a step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Done {
    pub work: f64,
    pub impulse: f64,
}

impl Load {
    /// Calls `visit` with each slot of the set and b(x, t) there, N/m³.
    pub fn each(&mut self, t: f64, mut visit: impl FnMut(usize, f64)) {
        if t > self.until {
            return;
        }
        let (scale, slots) = (&self.scale, &self.slots);
        for (k, (&slot, value)) in slots.iter().zip(self.profile.at(t)).enumerate() {
            visit(slot as usize, scale.of(k) * value);
        }
    }

    /// Adds b(x, t) to one component of the force density, and returns the work and impulse since the last call, by
    /// the trapezoidal rule in time, which is what velocity Verlet does to momentum and, to second order, to energy.
    pub fn apply<T: Number>(
        &mut self,
        t: f64,
        dt: f64,
        displacement: &[T],
        force: &mut [T],
        volume: impl Fn(usize) -> f64,
    ) -> Done {
        let active = t <= self.until;
        let values = self.profile.at(t);
        let mut done = Done::default();
        let first = self.last.is_none();
        let last = self.last.get_or_insert_with(|| Last {
            force: vec![0.0; self.slots.len()],
            displacement: vec![0.0; self.slots.len()],
        });
        for (k, &slot) in self.slots.iter().enumerate() {
            let slot = slot as usize;
            let b = if active { self.scale.of(k) * values[k] } else { 0.0 };
            let u = displacement[slot].to_f64();
            if !first {
                let mean = 0.5 * (last.force[k] + b) * volume(slot);
                done.work += mean * (u - last.displacement[k]);
                done.impulse += mean * dt;
            }
            force[slot] = T::from_f64(force[slot].to_f64() + b);
            last.force[k] = b;
            last.displacement[k] = u;
        }
        done
    }

    /// Work and impulse of the force that was last added, over `weight` (s) of the motion with these velocities.
    pub fn book<T: Number>(&self, weight: f64, velocity: &[T], volume: impl Fn(usize) -> f64) -> Done {
        let mut done = Done::default();
        for (&slot, b) in self.slots.iter().zip(self.last.iter().flat_map(|last| &last.force)) {
            let impulse = weight * b * volume(slot as usize);
            done.impulse += impulse;
            done.work += impulse * velocity[slot as usize].to_f64();
        }
        done
    }
}
