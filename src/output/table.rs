//! Tables as CSV files: a header, then a row at a time, each on the disk before the next.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// A CSV file of numbers.
pub struct Table {
    path: PathBuf,
    columns: Vec<String>,
    /// Opened when the first row comes.
    file: Option<BufWriter<File>>,
}

impl Table {
    pub fn new(path: &Path, columns: Vec<String>) -> Self {
        Table { path: path.to_path_buf(), columns, file: None }
    }

    /// Numbers in the shortest form that reads back to the same bits; not-a-number as an empty cell.
    pub fn row(&mut self, values: &[f64]) -> Result<()> {
        let cells: Vec<String> =
            values.iter().map(|v| if v.is_nan() { String::new() } else { format!("{v:e}") }).collect();
        let write = |file: &mut BufWriter<File>, cells: &[String]| writeln!(file, "{}", cells.join(","));
        let written = match &mut self.file {
            Some(file) => write(file, &cells).and_then(|()| file.flush()),
            None => File::create(&self.path).map(BufWriter::new).and_then(|mut file| {
                write(&mut file, &self.columns)?;
                write(&mut file, &cells)?;
                file.flush()?;
                self.file = Some(file);
                Ok(())
            }),
        };
        written.map_err(|e| Error::io(&self.path, e))
    }
}
