//! Which weights at which points: influence functions, partial volumes, schemes.

pub mod influence;
pub mod moments;
pub(crate) mod quadrature;
pub mod standard;
pub mod volume;

pub use influence::Influence;
pub use standard::{BondWeights, Operator};
pub use volume::PartialVolume;
