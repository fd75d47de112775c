//! Probes: the fields at one point, as a table.

use std::path::PathBuf;

use super::snapshot::{FieldRequest, Snapshot};
use super::table::Table;
use super::writer::Writer;
use crate::error::Result;
use crate::field::Kind;

/// Writes `probe_<name>.csv` with the fields of the point nearest to a place.
pub struct Probe {
    path: PathBuf,
    at: [f64; 3],
    fields: Vec<&'static str>,
    table: Option<Table>,
}

impl Probe {
    /// `at` in m.
    pub fn new(path: PathBuf, at: [f64; 3], fields: Vec<&'static str>) -> Self {
        Probe { path, at, fields, table: None }
    }
}

impl Writer for Probe {
    fn wants(&self) -> FieldRequest {
        FieldRequest::at(self.fields.clone(), self.at)
    }

    fn write(&mut self, snapshot: &Snapshot) -> Result<()> {
        let dimension = snapshot.points.facts.dimension;
        let table = self.table.get_or_insert_with(|| {
            let mut columns = vec!["step".to_string(), "time".into()];
            for field in &snapshot.fields {
                match field.values.kind() {
                    Kind::Scalar => columns.push(field.name.into()),
                    kind => columns.extend(kind.components(dimension).iter().map(|c| format!("{}_{c}", field.name))),
                }
            }
            Table::new(&self.path, columns)
        });
        let mut row = vec![snapshot.clock.step as f64, snapshot.clock.time()];
        for field in &snapshot.fields {
            // Components beyond the dimension stand last.
            let components = field.values.kind().components(dimension).len().max(1);
            row.extend(&field.values.of(0)[..components]);
        }
        table.row(&row)
    }
}
