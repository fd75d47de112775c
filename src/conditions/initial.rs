//! Initial displacement and velocity.

use std::sync::Arc;

use super::FormulaAtPoints;
use crate::field::Number;

/// Puts the profile at t = 0 into one component of a field at the slots of a set.
pub fn apply<T: Number>(component: &mut [T], slots: &Arc<[u32]>, profile: &mut FormulaAtPoints) {
    for (&slot, value) in slots.iter().zip(profile.at(0.0)) {
        component[slot as usize] = T::from_f64(*value);
    }
}
