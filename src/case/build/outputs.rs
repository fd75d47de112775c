//! What a case writes, and when.

use std::path::{Path, PathBuf};

use super::super::model::{self, FieldName, Output};
use super::conditions::rounded;
use super::{Builder, DAMAGED, MANY_FILES};
use crate::error::Result;
use crate::geometry::Cloud;
use crate::output::crack_tip::CrackTip;
use crate::output::picture::{ColorMap, Picture, View};
use crate::output::resultants::Resultants;
use crate::output::schedule::Schedule;
use crate::output::source::BodySummary;
use crate::output::writer::Output as Written;
use crate::physics::Resultant;

impl<const D: usize> Builder<'_, D> {
    pub(super) fn files(&self, schedule: &Schedule, n_steps: u64, dt: f64, path: &str) -> Result<()> {
        let count = schedule.count(n_steps, dt);
        if count > MANY_FILES && !self.options.many_files {
            let message = format!("this would write {count} files; at most {MANY_FILES} are written unasked");
            return Err(self.refuse(path, message, "write less often, or pass --many-files"));
        }
        Ok(())
    }

    /// Refuses outputs on sets that the body does not have, and cuts that miss it.
    pub(super) fn parts_of_outputs(&self, cloud: &Cloud<D>) -> Result<()> {
        for (k, output) in self.case.value.output.iter().enumerate() {
            match output {
                Output::Force(force) => {
                    self.slots(&force.on, cloud, &format!("output[{k}].force.on"))?;
                }
                Output::Cut(cut) => self.meets(cut, cloud, &format!("output[{k}].cut.point"))?,
                _ => {}
            }
        }
        Ok(())
    }

    /// Whether points are on both sides of a cut.
    fn meets(&self, cut: &model::Cut, cloud: &Cloud<D>, path: &str) -> Result<()> {
        let height = |x: &[f64; D]| (0..D).map(|d| (x[d] - cut.point[d]) * cut.normal[d]).sum::<f64>();
        let ahead = cloud.select(|x| height(x) > 0.0).len();
        if ahead > 0 && ahead < cloud.n_points() {
            return Ok(());
        }
        let (low, high) = cloud.bounds();
        let side = if ahead == 0 { "before" } else { "behind" };
        let message = format!(
            "no point is {side} this plane; the points of the body span {} to {} m",
            rounded(&low),
            rounded(&high)
        );
        Err(self.refuse(path, message, "move the plane into the body"))
    }

    /// With one straight pre-crack in 2D, its own direction is the one to follow.
    pub(super) fn default_tip(&self, facts: &BodySummary) -> Option<CrackTip> {
        match &self.case.value.geometry.cracks[..] {
            [model::Crack::Segment { from, to }] => {
                let along = [to[0] - from[0], to[1] - from[1], 0.0];
                tip_window(facts).map(|window| CrackTip::new(along, DAMAGED, window))
            }
            _ => None,
        }
    }
}

/// s; None where nothing breaks.
pub(super) fn tip_window(facts: &BodySummary) -> Option<f64> {
    facts.physics.elastic().map(|elastic| 20.0 * facts.horizon / elastic.bar_speed)
}

pub(super) fn force_on_set(force: &model::Force, folder: &Path) -> Written {
    let of = Resultant::OnSet { set: force.on.clone(), about: force.about.as_deref().map(place) };
    table_of(of, folder.join(format!("force_{}.csv", force.name)), force.every_steps)
}

pub(super) fn force_through_cut(cut: &model::Cut, folder: &Path) -> Written {
    let (point, normal) = (place(&cut.point), place(&cut.normal));
    let of = Resultant::ThroughCut { point, normal, about: cut.about.as_deref().map_or(point, place) };
    table_of(of, folder.join(format!("cut_{}.csv", cut.name)), cut.every_steps)
}

fn table_of(of: Resultant, path: PathBuf, every_steps: u64) -> Written {
    Written { schedule: Schedule::Steps(every_steps), writer: Box::new(Resultants::new(path, of)) }
}

/// With zeros beyond the dimension.
fn place(x: &[f64]) -> [f64; 3] {
    std::array::from_fn(|d| x.get(d).copied().unwrap_or(0.0))
}

pub(super) fn schedule(every: Option<f64>, every_steps: Option<u64>, at: &[f64]) -> Schedule {
    match (every, every_steps, at) {
        (Some(period), ..) => Schedule::Every(period),
        (None, Some(n), _) => Schedule::Steps(n),
        (None, None, []) => Schedule::LoadEnds,
        (None, None, at) => Schedule::At(at.to_vec()),
    }
}

pub(super) fn style(picture: &model::Picture, title: &str) -> Picture {
    let view = picture.view.as_ref().map_or(View::default(), |v| View { azimuth: v[0], elevation: v[1] });
    Picture {
        width: picture.width,
        title: title.to_string(),
        range: picture.range.as_ref().map(|r| (r[0], r[1])),
        color_map: if picture.component.is_some() { ColorMap::Diverging } else { ColorMap::Viridis },
        view,
        ..Picture::default()
    }
}

pub(super) fn names(fields: &[FieldName], default: &[&'static str]) -> Vec<&'static str> {
    if fields.is_empty() { default.to_vec() } else { fields.iter().map(FieldName::name).collect() }
}
