//! Elastic bodies beside mirrors and periodic ends: when images have which values.
//!
//! Images have the displacements and velocities of their sources while bonds are summed, and otherwise neither velocity nor
//! force: sums over all slots are those over points, and solvers leave images where they are.

use super::{Elasticity, State};
use crate::execution::Packs;
use crate::family::Body;

impl<const D: usize, P: Packs> Elasticity<D, P> {
    /// Does a pass over bonds while images have the values of their sources.
    pub(super) fn with_images<T>(&mut self, pass: impl FnOnce(&mut Self) -> T) -> T {
        fill(&self.body, &mut self.state);
        let done = pass(self);
        if let Some(images) = &self.body.cloud.images {
            images.clear(&mut self.state.velocity);
        }
        done
    }

    /// Displacements with those of images.
    pub(super) fn imaged(&self, u: &[f64]) -> Option<Vec<f64>> {
        let images = self.body.cloud.images.as_ref()?;
        let mut u = u.to_vec();
        images.fill(&mut u);
        Some(u)
    }
}

fn fill<const D: usize, P: Packs>(body: &Body<D>, state: &mut State<P>) {
    if let Some(images) = &body.cloud.images {
        images.fill(&mut state.displacement);
        images.fill(&mut state.velocity);
    }
}
