//! The force and its moment on a set of points or through a cut, as a table.

use std::path::PathBuf;

use super::snapshot::{FieldRequest, Snapshot};
use super::table::Table;
use super::writer::Writer;
use crate::error::Result;
use crate::physics::Resultant;

/// Writes a table with the components of the force (N) and of its moment (N·m): about z in 2D, none in 1D.
pub struct Resultants {
    path: PathBuf,
    of: Resultant,
    table: Option<Table>,
}

impl Resultants {
    pub fn new(path: PathBuf, of: Resultant) -> Self {
        Resultants { path, of, table: None }
    }
}

impl Writer for Resultants {
    fn wants(&self) -> FieldRequest {
        FieldRequest::resultant(self.of.clone())
    }

    fn write(&mut self, snapshot: &Snapshot) -> Result<()> {
        let Some(sum) = &snapshot.resultant else { return Ok(()) };
        let axes = ["x", "y", "z"];
        let dimension = snapshot.points.facts.dimension;
        let turns = [0..0, 2..3, 0..3][dimension - 1].clone();
        let table = self.table.get_or_insert_with(|| {
            let mut columns = vec!["step".to_string(), "time".into()];
            columns.extend(axes[..dimension].iter().map(|axis| format!("force_{axis}")));
            columns.extend(axes[turns.clone()].iter().map(|axis| format!("moment_{axis}")));
            Table::new(&self.path, columns)
        });
        let mut row = vec![snapshot.clock.step as f64, snapshot.clock.time()];
        row.extend(&sum.force[..dimension]);
        row.extend(&sum.moment[turns]);
        table.row(&row)
    }
}
