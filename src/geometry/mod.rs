//! Where matter is: shapes, the clouds of points that fill them, named sets, pre-cracks.

pub mod cloud;
pub mod cracks;
pub mod curve;
pub mod images;
pub mod joints;
pub mod lattice;
mod polygon;
mod quadrature;
pub mod sets;
pub mod shapes;

pub use cloud::{Arrangement, Cloud, for_each_cell};
pub use cracks::Crack;
pub use images::{Ends, Images, Mirror, Parity};
pub use joints::Cracks;
pub use lattice::Lattice;
pub use sets::PointSets;
pub use shapes::Shape;
