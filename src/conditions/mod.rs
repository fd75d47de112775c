//! What the world does to a body: initial values, prescribed motion, loads.
//!
//! A condition of the case is compiled against a body into one of two primitives: [`Prescribed`] values and [`Load`]s.

pub mod initial;
pub mod load;
pub mod prescribed;
pub mod profile;

pub use load::Load;
pub use prescribed::{Prescribed, Quantity};
pub use profile::Profile;
