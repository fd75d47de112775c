//! Case files: what a user wrote, checked and built. The only place that knows TOML and holds defaults.

pub mod build;
pub mod bundled;
mod check;
mod constants;
pub mod diagnostics;
pub mod import;
pub mod library;
pub mod model;
pub mod read;
mod schema;
mod tree;
pub mod units;
mod validate;

#[cfg(test)]
mod tests;

pub use build::{Options, build};
pub use diagnostics::Diagnostics;
pub use model::Case;
pub use read::{Located, read_file, read_text, schema_of};
