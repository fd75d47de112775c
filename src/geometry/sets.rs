//! Named point sets: the handles by which conditions and failure rules reach points.

use std::collections::BTreeMap;
use std::sync::Arc;

/// Slots of points by set name, each list ascending.
#[derive(Debug, Clone, Default)]
pub struct PointSets {
    sets: BTreeMap<String, Arc<[u32]>>,
}

impl PointSets {
    /// Adds a set; `slots` ascending.
    pub fn insert(&mut self, name: impl Into<String>, slots: Vec<u32>) {
        debug_assert!(slots.is_sorted_by(|a, b| a < b), "slots of a set are ascending, each once");
        self.sets.insert(name.into(), slots.into());
    }

    pub fn get(&self, name: &str) -> Option<&Arc<[u32]>> {
        self.sets.get(name)
    }

    pub fn iter(&self) -> impl Iterator<Item = (&str, &Arc<[u32]>)> {
        self.sets.iter().map(|(name, slots)| (name.as_str(), slots))
    }
}
