//! Who interacts with whom: families, the state of each bond, and the vocabulary of one bond.

pub mod bond;
pub mod families;
pub mod graded;
pub mod nearest;
pub mod search;
pub mod states;
mod tree;

pub use bond::{Bond, BondKernel, BondLaw};
pub use families::{
    Body, Class, CloudFamilies, Families, FixedSites, GROUP, LatticeFamilies, Offset, Sites, mirror_sequences,
};
pub use graded::{Grading, Rule, Update};
pub use nearest::nearest;
pub use states::BondStates;
