//! Where results go. Writers only look: nothing here changes a run.

mod axes;
mod canvas;
pub mod crack_tip;
mod files;
pub mod frames;
pub mod history;
pub mod picture;
pub mod pictures;
pub mod plot;
pub mod probe;
pub mod report;
pub mod schedule;
mod solid;
pub mod source;
pub mod table;
mod ticks;
pub mod vtu;
