//! Where matter is: shapes, the clouds of points that fill them, named sets, pre-cracks.

pub mod cloud;
pub mod cracks;
pub mod curve;
pub mod lattice;
mod polygon;
pub mod sets;
pub mod shapes;

pub use cloud::{Arrangement, Cloud};
pub use cracks::Crack;
pub use lattice::Lattice;
pub use sets::PointSets;
pub use shapes::Shape;
