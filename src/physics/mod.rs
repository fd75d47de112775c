//! The physics that a body can have: laws, their states, and what is irreversible in them.

pub mod diffusion;
pub mod elasticity;
pub mod failure;

pub use diffusion::Diffusion;
pub use elasticity::Elasticity;
