//! Where results go. Outputs only look: nothing here changes a run.
//!
//! At a due time the stepping thread takes snapshots of the fields that the due writers want ([`snapshot`]) and hands
//! them to one writer thread ([`writer_thread`]), where everything is formatted, compressed, drawn and written.

mod axes;
mod canvas;
pub mod crack_tip;
mod cubes;
mod files;
pub mod frames;
pub mod history;
pub mod picture;
pub mod pictures;
pub mod plot;
pub mod probe;
mod relief;
pub mod report;
pub mod schedule;
pub mod snapshot;
mod solid;
pub mod source;
pub mod table;
mod ticks;
pub mod vtu;
pub mod writer;
pub mod writer_thread;
