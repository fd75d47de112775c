//! Peridynamics: the mechanics of bodies that break, as sums over a neighbourhood.
//!
//! ```text
//! (L u)(x) = Σ over x′ in the family of x:  μ · w · f(ξ, u(x), u(x′))
//! ```
//!
//! Every part of the library owns one symbol of that line. Read the modules in this order:
//!
//! - [`simulation`]: the event loop; [`problem`]: one body, its physics, its books.
//! - [`geometry`] and [`family`] own x, x′ and ξ; [`discretization`] owns w; [`physics`] owns f and μ.
//! - [`refinement`] splits and merges the cells of x where the solution asks for it.
//! - [`execution`] owns Σ: the only loops over bonds. [`lane`] is the number that a law is written on.
//! - [`conditions`] own values and loads from outside; [`solver`] owns t; [`output`] only looks.
//! - [`case`] turns a file into a [`simulation::Simulation`]; the package `bondwise-studies` proves that all of it is right.

pub mod case;
pub mod conditions;
pub mod discretization;
pub mod error;
pub mod execution;
pub mod expression;
pub mod family;
pub mod field;
pub mod geometry;
pub mod lane;
pub mod output;
pub mod parallel;
pub mod physics;
pub mod problem;
pub mod refinement;
pub mod simulation;
pub mod solver;
pub mod unknown;
pub mod visit;

pub use error::{Error, Result};
