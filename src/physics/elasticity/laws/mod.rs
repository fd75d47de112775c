//! The laws of bonds, a file each.

pub mod bond_based;

pub use bond_based::{BondBased, BondBasedLinear};
