//! Probes: the fields at one point, as a table.

use std::path::PathBuf;

use super::snapshot::{FieldRequest, Snapshot};
use super::table::Table;
use super::writer::Writer;
use crate::error::Result;
use crate::field::Values;

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
        let axes = &["x", "y", "z"][..snapshot.points.facts.dimension];
        let table = self.table.get_or_insert_with(|| {
            let mut columns = vec!["step".to_string(), "time".into()];
            for field in &snapshot.fields {
                match field.values {
                    Values::Scalar(_) => columns.push(field.name.into()),
                    Values::Vector(_) => columns.extend(axes.iter().map(|a| format!("{}_{a}", field.name))),
                }
            }
            Table::new(&self.path, columns)
        });
        let mut row = vec![snapshot.clock.step as f64, snapshot.clock.time()];
        for field in &snapshot.fields {
            match &field.values {
                Values::Scalar(v) => row.extend(v),
                Values::Vector(v) => row.extend(v.iter().flat_map(|v| &v[..axes.len()])),
            }
        }
        table.row(&row)
    }
}
