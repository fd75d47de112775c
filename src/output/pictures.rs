//! Pictures of a run: one field, drawn at chosen times.

use std::path::{Path, PathBuf};

use super::picture::{CloudView, Picture, Sizes, draw, write_png};
use super::schedule::Schedule;
use super::source::{Source, Writer, deformed, scalar};
use crate::error::{Error, Result};
use crate::solver::Clock;

/// Writes `pictures/<field>_<step>.png`.
pub struct Pictures {
    pub folder: PathBuf,
    pub schedule: Schedule,
    pub field: &'static str,
    pub component: Option<usize>,
    /// Displacements are drawn this many times as large.
    pub deform: f64,
    /// 3D: draw only points where the value is at least this.
    pub above: Option<f64>,
    pub style: Picture,
    pub last_step: Option<u64>,
}

impl Pictures {
    fn path(&self, step: u64) -> PathBuf {
        let component = self.component.map_or("", |c| ["_x", "_y", "_z"][c]);
        self.folder.join("pictures").join(format!("{}{component}_{step:08}.png", self.field))
    }

    /// Draws the field as it is now into `path`.
    pub fn draw_into(&self, source: &mut dyn Source, time: f64, path: &Path) -> Result<()> {
        let Some(field) = source.field(self.field) else { return Ok(()) };
        let unit = if field.unit.is_empty() { "-" } else { field.unit };
        let axis = self.component.map_or(String::new(), |c| format!(" {}", ["x", "y", "z"][c]));
        let label = format!("{}{axis} [{unit}]", field.name.replace('_', " "));
        let values = scalar(field, self.component);
        let mut positions = deformed(source, self.deform);
        let mut kept = values.clone();
        let sizes: Vec<f64> = match source.sizes() {
            Sizes::Same(size) => vec![size; positions.len()],
            Sizes::Each(sizes) => sizes.to_vec(),
        };
        let mut sizes_kept = sizes.clone();
        if let Some(above) = self.above {
            let keep: Vec<usize> = (0..values.len()).filter(|&i| values[i] >= above).collect();
            positions = keep.iter().map(|&i| positions[i]).collect();
            kept = keep.iter().map(|&i| values[i]).collect();
            sizes_kept = keep.iter().map(|&i| sizes[i]).collect();
        }
        let dimension = source.facts().dimension;
        let cloud = CloudView { positions: &positions, sizes: Sizes::Each(&sizes_kept), values: &kept, dimension };
        let image = draw(&Picture { label, ..self.style.clone() }, &cloud, Some(time));
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        }
        write_png(&image, path).map_err(|e| Error::io(path, e))
    }
}

impl Writer for Pictures {
    fn write(&mut self, source: &mut dyn Source, clock: &Clock, last: bool) -> Result<()> {
        let due = match &self.schedule {
            Schedule::Ends => last,
            schedule => last || schedule.is_due(clock),
        };
        if !due || self.last_step == Some(clock.step) {
            return Ok(());
        }
        self.last_step = Some(clock.step);
        let path = self.path(clock.step);
        self.draw_into(source, clock.time(), &path)
    }
}
