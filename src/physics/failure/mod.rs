//! When bonds break.

pub mod critical_stretch;

pub use critical_stretch::CriticalStretch;
