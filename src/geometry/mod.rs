//! Where matter is: shapes, the clouds of points that fill them, named sets, pre-cracks.

pub mod cloud;
pub mod cracks;
pub mod curve;
mod fit;
pub mod images;
pub mod joints;
pub mod lattice;
mod polygon;
mod quadrature;
pub mod sets;
pub mod shapes;
pub mod surface;
pub mod tie;

pub use cloud::{Arrangement, Cloud, for_each_cell};
pub use cracks::Crack;
pub use fit::{Fits, sum_of_shares};
pub use images::{Ends, Images, Mirror, Parity};
pub use joints::Cracks;
pub use lattice::Lattice;
pub use sets::PointSets;
pub use shapes::Shape;
pub use surface::Piece;
pub use tie::TIE;
