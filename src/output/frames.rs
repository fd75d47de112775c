//! VTU frames and the PVD collection that plays them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::snapshot::{FieldRequest, Snapshot};
use super::source::Points;
use super::vtu::{FieldData, Grid, Precision, write_pvd, write_vtu};
use super::writer::Writer;
use crate::error::{Error, Result};
use crate::field::Values;

/// Writes `frames/frame_<step>.vtu` and `fields.pvd`.
pub struct Frames {
    folder: PathBuf,
    fields: Vec<&'static str>,
    /// What frames of the same points share, packed for the first of them.
    grid: Option<(Arc<Points>, Grid)>,
    written: Vec<(f64, String)>,
}

impl Frames {
    pub fn new(folder: &Path, fields: Vec<&'static str>) -> Self {
        Frames { folder: folder.to_path_buf(), fields, grid: None, written: Vec::new() }
    }
}

impl Writer for Frames {
    fn wants(&self) -> FieldRequest {
        FieldRequest::everywhere(self.fields.clone())
    }

    fn write(&mut self, snapshot: &Snapshot) -> Result<()> {
        let name = format!("frames/frame_{:08}.vtu", snapshot.clock.step);
        let data: Vec<_> = snapshot
            .fields
            .iter()
            .map(|field| match &field.values {
                Values::Scalar(v) => (field.name, FieldData::Scalar(v)),
                Values::Vector(v) => (field.name, FieldData::Vector(v)),
                Values::Tensor(v) => (field.name, FieldData::Tensor(v)),
                Values::Principal(v) => (field.name, FieldData::Principal(v)),
            })
            .collect();
        let path = self.folder.join(&name);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        }
        let time = snapshot.clock.time();
        let points = &snapshot.points;
        let grid = match &mut self.grid {
            Some((of, grid)) if Arc::ptr_eq(of, points) => grid,
            other => &mut other.insert((points.clone(), Grid::new(&points.positions, Precision::Float64))).1,
        };
        write_vtu(&path, grid, &data, time).map_err(|e| Error::io(&path, e))?;
        self.written.push((time, name));
        let pvd = self.folder.join("fields.pvd");
        write_pvd(&pvd, &self.written).map_err(|e| Error::io(&pvd, e))
    }
}
