//! Pictures of a run: one field, drawn at chosen times.

use std::path::PathBuf;

use super::picture::{CloudView, Picture, Sizes, draw, write_png};
use super::snapshot::{FieldRequest, Snapshot};
use super::source::{component_of, moved};
use super::writer::Writer;
use crate::error::{Error, Result};
use crate::field::Values;

/// Writes `pictures/<field>_<step>.png`.
pub struct Pictures {
    pub folder: PathBuf,
    pub field: &'static str,
    pub component: Option<usize>,
    /// Displacements are drawn this many times as large.
    pub deform: f64,
    /// 3D: draw only points where the value is at least this.
    pub above: Option<f64>,
    pub style: Picture,
}

impl Pictures {
    fn path(&self, component: Option<&str>, step: u64) -> PathBuf {
        let component = component.map_or(String::new(), |name| format!("_{name}"));
        self.folder.join("pictures").join(format!("{}{component}_{step:08}.png", self.field))
    }
}

impl Writer for Pictures {
    fn wants(&self) -> FieldRequest {
        let mut fields = vec![self.field];
        if self.deform != 0.0 && self.field != "displacement" {
            fields.push("displacement");
        }
        FieldRequest::everywhere(fields)
    }

    fn write(&mut self, snapshot: &Snapshot) -> Result<()> {
        let Some(field) = snapshot.field(self.field) else { return Ok(()) };
        let unit = if field.unit.is_empty() { "-" } else { field.unit };
        let names = field.values.kind().components(snapshot.points.facts.dimension);
        let component = self.component.and_then(|c| names.get(c).copied());
        let axis = component.map_or(String::new(), |name| format!(" {name}"));
        let label = format!("{}{axis} [{unit}]", field.name.replace('_', " "));
        let of_components;
        let mut values: &[f64] = match &field.values {
            Values::Scalar(values) => values,
            others => {
                of_components = component_of(others, self.component);
                &of_components
            }
        };
        let points = &*snapshot.points;
        let mut positions = moved(&points.positions, snapshot.field("displacement"), self.deform);
        let mut sizes = points.sizes();
        let (kept_values, kept_sizes): (Vec<f64>, Vec<f64>);
        if let Some(above) = self.above {
            let keep: Vec<usize> = (0..values.len()).filter(|&i| values[i] >= above).collect();
            positions = keep.iter().map(|&i| positions[i]).collect();
            kept_values = keep.iter().map(|&i| values[i]).collect();
            values = &kept_values;
            if let Sizes::Each(each) = sizes {
                kept_sizes = keep.iter().map(|&i| each[i]).collect();
                sizes = Sizes::Each(&kept_sizes);
            }
        }
        let cloud = CloudView { positions: &positions, sizes, values, dimension: points.facts.dimension };
        let picture = Picture { label, ..self.style.clone() };
        let image = draw(&picture, &cloud, Some(snapshot.clock.time()));
        let path = self.path(component, snapshot.clock.step);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        }
        write_png(&image, &path).map_err(|e| Error::io(&path, e))
    }
}
