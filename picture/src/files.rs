//! How a file gets onto the disk: whole, or not at all.
//!
//! A viewer may look at a folder while the run still writes to it, and a run may
//! be killed at any moment. So every file is written under a temporary name in
//! its own folder and then renamed, which the file system does in one step.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::process;
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes a file through `write`, under a temporary name that is renamed to `path` at the end.
///
/// If anything fails the temporary file is removed, a file that stood at `path`
/// before is left as it was, and the error names `path`.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    // Two threads may write the same file: the number keeps their temporary files apart.
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let Some(name) = path.file_name() else {
        return Err(named(path, io::ErrorKind::InvalidInput, "not a file name"));
    };
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let temporary = path.with_file_name(format!(".{}.{}-{number}.part", name.to_string_lossy(), process::id()));
    let written = File::create(&temporary)
        .and_then(|file| {
            let mut buffer = BufWriter::with_capacity(1 << 20, file);
            write(&mut buffer)?;
            buffer.flush()
        })
        .and_then(|()| fs::rename(&temporary, path));
    written.map_err(|error| {
        // It may never have been created; the first error is the one to tell.
        let _ = fs::remove_file(&temporary);
        named(path, error.kind(), error)
    })
}

/// An error whose words begin with the path it is about.
pub fn named(path: &Path, kind: io::ErrorKind, reason: impl std::fmt::Display) -> io::Error {
    io::Error::new(kind, format!("{}: {reason}", path.display()))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use std::path::PathBuf;

    /// A fresh folder for one test.
    pub fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("bondwise-{}-{name}", process::id()));
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = folder("files");
        let path = folder.join("kept.txt");
        write_whole(&path, |file| file.write_all(b"old")).unwrap();
        let error = write_whole(&path, |file| {
            file.write_all(b"half of the new")?;
            Err(io::Error::other("disk full"))
        })
        .unwrap_err();
        assert!(error.to_string().contains("kept.txt: disk full"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_missing_folder_is_an_error_that_names_the_file() {
        let error = write_whole(Path::new("/no/such/folder/a.vtu"), |_| Ok(())).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
        assert!(error.to_string().contains("/no/such/folder/a.vtu"));
        assert!(write_whole(Path::new("/"), |_| Ok(())).is_err());
    }
}
