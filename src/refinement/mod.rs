//! Cells that are split and merged, so that points are near each other only where that is needed.

pub mod cells;
pub mod zones;

pub use cells::{Cell, Cells, Origin};
pub use zones::{Transition, Zones, horizons};
