//! Initial displacement and velocity.

use std::sync::Arc;

use super::Profile;

/// Adds the profile at t = 0 to one component of a field at the slots of a set.
pub fn apply(component: &mut [f64], slots: &Arc<[u32]>, profile: &mut Profile) {
    for (&slot, value) in slots.iter().zip(profile.at(0.0)) {
        component[slot as usize] += value;
    }
}
