//! VTU frames and the PVD collection that plays them.

use std::path::{Path, PathBuf};

use super::schedule::Schedule;
use super::source::{Source, Writer};
use super::vtu::{FieldData, Precision, write_pvd, write_vtu};
use crate::error::{Error, Result};
use crate::field::Values;
use crate::solver::Clock;

/// Writes `frames/frame_<step>.vtu` and `fields.pvd`.
pub struct Frames {
    folder: PathBuf,
    schedule: Schedule,
    fields: Vec<&'static str>,
    written: Vec<(f64, String)>,
}

impl Frames {
    pub fn new(folder: &Path, schedule: Schedule, fields: Vec<&'static str>) -> Self {
        Frames { folder: folder.to_path_buf(), schedule, fields, written: Vec::new() }
    }
}

impl Writer for Frames {
    fn write(&mut self, source: &mut dyn Source, clock: &Clock, last: bool) -> Result<()> {
        let name = format!("frames/frame_{:08}.vtu", clock.step);
        let already = self.written.last().is_some_and(|(_, n)| *n == name);
        if already || !(last || self.schedule.is_due(clock)) {
            return Ok(());
        }
        let values: Vec<_> = self.fields.iter().filter_map(|f| source.field(f)).collect();
        let data: Vec<_> = values
            .iter()
            .map(|field| match &field.values {
                Values::Scalar(v) => (field.name, FieldData::Scalar(v)),
                Values::Vector(v) => (field.name, FieldData::Vector(v)),
            })
            .collect();
        let path = self.folder.join(&name);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        }
        write_vtu(&path, source.positions(), &data, clock.time(), Precision::Float64)
            .map_err(|e| Error::io(&path, e))?;
        self.written.push((clock.time(), name));
        let pvd = self.folder.join("fields.pvd");
        write_pvd(&pvd, &self.written).map_err(|e| Error::io(&pvd, e))
    }
}
