//! Point clouds from files.

pub mod csv;
