//! Probes: the fields at one point, as a table.

use std::path::PathBuf;

use super::source::{Source, Writer};
use super::table::Table;
use crate::error::Result;
use crate::field::{Values, difference, norm};
use crate::solver::Clock;

/// Writes `probe_<name>.csv` with the fields of the point nearest to a place.
pub struct Probe {
    path: PathBuf,
    at: [f64; 3],
    every: u64,
    fields: Vec<&'static str>,
    open: Option<(Table, usize)>,
    last_step: Option<u64>,
}

impl Probe {
    pub fn new(path: PathBuf, at: [f64; 3], every: u64, fields: Vec<&'static str>) -> Self {
        Probe { path, at, every, fields, open: None, last_step: None }
    }
}

impl Writer for Probe {
    fn write(&mut self, source: &mut dyn Source, clock: &Clock, last: bool) -> Result<()> {
        if self.last_step == Some(clock.step) || !(last || clock.step.is_multiple_of(self.every)) {
            return Ok(());
        }
        self.last_step = Some(clock.step);
        let axes = &["x", "y", "z"][..source.facts().dimension];
        let fields: Vec<_> = self.fields.iter().filter_map(|f| source.field(f)).collect();
        if self.open.is_none() {
            let far = |x: &[f64; 3]| norm(&difference(x, &self.at));
            let positions = source.positions();
            let nearest = (0..positions.len()).min_by(|&a, &b| far(&positions[a]).total_cmp(&far(&positions[b])));
            let Some(nearest) = nearest else { return Ok(()) };
            let mut columns = vec!["step".to_string(), "time".into()];
            for field in &fields {
                match field.values {
                    Values::Scalar(_) => columns.push(field.name.into()),
                    Values::Vector(_) => columns.extend(axes.iter().map(|a| format!("{}_{a}", field.name))),
                }
            }
            self.open = Some((Table::create(&self.path, &columns)?, nearest));
        }
        let Some((table, point)) = &mut self.open else { return Ok(()) };
        let mut row = vec![clock.step as f64, clock.time()];
        for field in &fields {
            match &field.values {
                Values::Scalar(v) => row.push(v[*point]),
                Values::Vector(v) => row.extend(&v[*point][..axes.len()]),
            }
        }
        table.row(&row)
    }
}
