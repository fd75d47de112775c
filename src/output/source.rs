//! What writers may see of a run: numbers about the body, and fields by name at one instant.

use crate::field::{Field, Values};
use crate::problem::Balance;
use crate::solver::Clock;

/// A model that writers look at. Asking for a field may compute it, hence the `&mut`.
pub trait Source {
    /// Reference positions in point order, m; zeros beyond the dimension.
    fn positions(&self) -> &[[f64; 3]];
    /// Side of the cell of each point, m: one for all on a lattice.
    fn sizes(&self) -> Sizes<'_>;
    /// Facts that do not change.
    fn facts(&self) -> &Facts;
    /// A field by name, in point order; None if the model has no such field.
    fn field(&mut self, name: &str) -> Option<Field>;
    fn balance(&mut self) -> Balance;
    fn broken_pairs(&self) -> u64;
    /// Name and value (N) of the reaction of each prescribed set.
    fn reactions(&self) -> Vec<(String, f64)>;
    fn hash(&self) -> String;
    /// Bonds of each point that hold now, in point order.
    fn family_sizes(&self) -> Vec<u32>;
}

pub use super::picture::Sizes;

/// What is known of a body before the first step.
#[derive(Debug, Clone, PartialEq)]
pub struct Facts {
    pub dimension: usize,
    pub points: usize,
    /// Directed bonds of the whole body, before pre-cracks.
    pub bonds: u64,
    /// Directed bonds that the pre-cracks cut.
    pub cut_bonds: u64,
    /// δ and Δx, m.
    pub horizon: f64,
    pub spacing: f64,
    /// Largest stable step, s.
    pub stable_step: f64,
    /// √(E/ρ), m/s
    pub bar_speed: f64,
    /// m/s; None in 1D.
    pub rayleigh_speed: Option<f64>,
    /// Micromodulus and smallest critical stretch.
    pub micromodulus: f64,
    pub critical_stretch: Option<f64>,
    /// Bytes that fields and bonds take.
    pub memory: u64,
}

/// Writes something at its own times.
pub trait Writer: Send {
    /// Called after every step, and before the first; `last` at the end of the run.
    fn write(&mut self, source: &mut dyn Source, clock: &Clock, last: bool) -> crate::Result<()>;
}

/// Where the material points are now: reference positions plus `factor` times the displacement, m.
pub fn deformed(source: &mut dyn Source, factor: f64) -> Vec<[f64; 3]> {
    let mut positions = source.positions().to_vec();
    if factor != 0.0
        && let Some(Field { values: Values::Vector(u), .. }) = source.field("displacement")
    {
        for (x, u) in positions.iter_mut().zip(u) {
            for d in 0..3 {
                x[d] += factor * u[d];
            }
        }
    }
    positions
}

/// One component of a field, or the magnitude of a vector when none is named.
pub fn scalar(field: Field, component: Option<usize>) -> Vec<f64> {
    match (field.values, component) {
        (Values::Scalar(values), _) => values,
        (Values::Vector(values), Some(c)) => values.iter().map(|v| v[c]).collect(),
        (Values::Vector(values), None) => values.iter().map(crate::field::norm).collect(),
    }
}
