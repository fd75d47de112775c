//! Tables as CSV files: a header, then a row at a time, each on the disk before the next.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// A CSV file of numbers.
pub struct Table {
    path: PathBuf,
    file: BufWriter<File>,
}

impl Table {
    pub fn create(path: &Path, columns: &[String]) -> Result<Self> {
        let file = File::create(path).map_err(|e| Error::io(path, e))?;
        let mut table = Table { path: path.to_path_buf(), file: BufWriter::new(file) };
        table.line(&columns.join(","))?;
        Ok(table)
    }

    /// Numbers in the shortest form that reads back to the same bits; not-a-number as an empty cell.
    pub fn row(&mut self, values: &[f64]) -> Result<()> {
        let cells: Vec<String> =
            values.iter().map(|v| if v.is_nan() { String::new() } else { format!("{v:e}") }).collect();
        self.line(&cells.join(","))
    }

    fn line(&mut self, line: &str) -> Result<()> {
        writeln!(self.file, "{line}").and_then(|()| self.file.flush()).map_err(|e| Error::io(&self.path, e))
    }
}
