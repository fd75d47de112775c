//! Which weights at which points: influence functions, partial volumes, schemes, surface corrections.

pub mod collocation;
pub mod graded;
pub mod heterogeneity;
pub mod hybrid;
pub mod influence;
pub mod moments;
pub mod quadrature;
pub mod rim;
pub mod standard;
pub mod surface;
pub mod volume;

pub use collocation::Collocation;
pub use graded::BondWeighting;
pub use heterogeneity::Heterogeneity;
pub use hybrid::Regions;
pub use influence::Influence;
pub use standard::{BondWeights, Operator};
pub use surface::Correction;
pub use volume::PartialVolume;
