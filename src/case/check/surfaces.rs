//! Named parts of the surface of a body.

use super::super::model::{Case, Region, SurfacePart};
use super::Checker;

impl Checker<'_> {
    /// Names of surfaces, which are sets too, and what they are made of.
    pub(super) fn surfaces(&mut self, case: &Case) {
        for (name, part) in &case.surfaces {
            let path = format!("surfaces.{name}");
            if case.geometry.shape.is_none() {
                let message = "nobody knows where the surface of points from a file is";
                self.error(&path, message, "load a set of points, with `area` or `thickness`");
            }
            if name == "all" || case.sets.contains_key(name) {
                self.error(&path, format!("`{name}` is a set of points already"), "choose another name");
            }
            self.part(part, case.case.dimension, &path);
        }
    }

    fn part(&mut self, part: &SurfacePart, dimension: usize, path: &str) {
        match part {
            SurfacePart::Where(_) => {}
            SurfacePart::Box { low, high } => {
                let region = Region::Box { low: low.clone(), high: high.clone() };
                self.region(&region, dimension, path);
            }
            SurfacePart::Inside(shape) => self.shape(shape, dimension, &format!("{path}.inside")),
            SurfacePart::All(parts) | SurfacePart::Any(parts) => {
                parts.iter().for_each(|part| self.part(part, dimension, path));
            }
            SurfacePart::Not(part) => self.part(part, dimension, path),
        }
    }
}
