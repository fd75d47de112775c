//! The tests of the library from outside: one program, so that what they are generic over is compiled once.

mod architecture;
mod clouds;
mod common;
mod cracks_at_rest;
mod diffusion;
mod diffusion_cases;
mod diffusion_mistakes;
mod engine;
mod forces;
mod hybrid;
mod images;
mod limits;
mod materials;
mod memory;
mod overlaps;
mod parity;
mod patch;
mod refinement;
mod regressions;
mod setup;
mod solvers;
mod state;
mod state_based;
mod statics;
mod stress;
mod surfaces;
