//! Where results go. Outputs only look: nothing here changes a run.
//!
//! At a due time the stepping thread takes snapshots of the fields that the due writers want ([`snapshot`]) and hands
//! them to one writer thread ([`writer_thread`]), where everything is formatted, compressed, drawn and written.

pub mod crack_tip;
pub mod frames;
pub mod history;
pub mod pictures;
pub mod probe;
pub mod report;
pub mod resultants;
pub mod schedule;
pub mod snapshot;
pub mod source;
pub mod table;
pub mod vtu;
pub mod writer;
pub mod writer_thread;

pub use bondwise_picture::{picture, plot};

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    /// A fresh folder for one test.
    pub fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("bondwise-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }
}
