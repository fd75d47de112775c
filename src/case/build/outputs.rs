//! What a case writes, and when.

use super::super::model::{self, FieldName};
use super::{Builder, DAMAGED, MANY_FILES};
use crate::error::Result;
use crate::output::crack_tip::CrackTip;
use crate::output::picture::{ColorMap, Picture, View};
use crate::output::schedule::Schedule;
use crate::output::source::BodySummary;

impl<const D: usize> Builder<'_, D> {
    pub(super) fn files(&self, schedule: &Schedule, n_steps: u64, dt: f64, path: &str) -> Result<()> {
        let count = schedule.count(n_steps, dt);
        if count > MANY_FILES && !self.options.many_files {
            let message = format!("this would write {count} files; at most {MANY_FILES} are written unasked");
            return Err(self.refuse(path, message, "write less often, or pass --many-files"));
        }
        Ok(())
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
