//! Rules of mirrors and periodic ends: what the case alone tells of them. What the points tell, the builder asks.

use super::super::model::{Axis, Case, Condition, Parity, Side, SurfaceCorrection};
use super::Checker;

/// What is beyond one end of an axis, or beyond both.
#[derive(PartialEq)]
enum End {
    Mirror(Side),
    Periodic,
}

impl Checker<'_> {
    pub(super) fn images(&mut self, case: &Case) {
        let mut before: Vec<(usize, Axis, End)> = Vec::new();
        for (k, condition) in case.conditions.iter().enumerate() {
            let (name, axis, end) = match (&condition.mirror, &condition.periodic) {
                (Some(mirror), _) => ("mirror", mirror.axis, End::Mirror(mirror.side)),
                (None, Some(periodic)) => ("periodic", periodic.axis, End::Periodic),
                (None, None) => continue,
            };
            let path = format!("conditions[{k}].{name}");
            self.whole_body(condition, name, k);
            self.place(condition, case, &path);
            let axes = &["x", "y", "z"][..case.case.dimension];
            if axis as usize >= axes.len() {
                let message = format!("there is no such axis in {}D; allowed: {}", axes.len(), axes.join(", "));
                self.error(&format!("{path}.axis"), message, "");
            }
            if let Some((other, _, theirs)) = before.iter().find(|(_, of, theirs)| {
                *of == axis && (*theirs == end || *theirs == End::Periodic || end == End::Periodic)
            }) {
                let message = match (theirs, &end) {
                    (End::Periodic, End::Periodic) => format!("conditions[{other}] makes this axis periodic already"),
                    (End::Mirror(_), End::Mirror(_)) => format!("conditions[{other}] has a mirror at this end already"),
                    (End::Periodic, _) => format!("conditions[{other}] makes this axis periodic: it has no mirrors"),
                    (_, End::Periodic) => format!("conditions[{other}] has a mirror: this axis is not periodic"),
                };
                self.error(&format!("{path}.axis"), message, "remove one of them");
            }
            before.push((k, axis, end));
            if condition.mirror.as_ref().is_some_and(|mirror| mirror.parity == Parity::Odd) {
                self.odd(case, &path);
            }
            if case.refinement.is_some() {
                let message = format!("cells are split in bodies without images, and conditions[{k}] makes some");
                self.error("refinement", message, "remove one of them");
            }
            if case.discretization.surface_correction != SurfaceCorrection::None {
                let message =
                    format!("surfaces are corrected on bodies without images, and conditions[{k}] makes some");
                self.error("discretization.surface_correction", message, "remove one of them");
            }
        }
    }

    /// Neither `on` nor `until`.
    fn whole_body(&mut self, condition: &Condition, name: &str, k: usize) {
        if condition.on.is_some() {
            let message = format!("`{name}` is about an end of the body and not about a set");
            self.error(&format!("conditions[{k}].on"), message, "remove it");
        }
        if condition.until.is_some() {
            let message = format!("`{name}` holds from the start to the end");
            self.error(&format!("conditions[{k}].until"), message, "remove it");
        }
    }

    /// Planes and periods of a shape follow from its cells; those of points from a file are given.
    fn place(&mut self, condition: &Condition, case: &Case, path: &str) {
        let (key, given, example) = match (&condition.mirror, &condition.periodic) {
            (Some(mirror), _) => ("at", mirror.at.is_some(), "at = 0.0"),
            (_, periodic) => ("period", periodic.as_ref().is_some_and(|p| p.period.is_some()), "period = \"10 mm\""),
        };
        if case.geometry.points.is_some() && !given {
            let message = format!("missing key `{key}`: where points from a file end is not known");
            self.error(path, message, &format!("add `{key} = <number, m>`, such as `{example}`"));
        }
        if case.geometry.shape.is_some() && given {
            let message = format!("`{key}` is for points from a file; of a shape it follows from its outermost cells");
            self.error(&format!("{path}.{key}"), message, "remove it");
        }
    }

    /// Motion stays antisymmetric only where forces are linear and no bond breaks: of two bonds that are images of each other
    /// one is stretched as much as the other is shortened.
    fn odd(&mut self, case: &Case, path: &str) {
        let path = format!("{path}.parity");
        // What diffuses is linear, and breaks nothing.
        let Some(elasticity) = &case.physics.elasticity else { return };
        let law = elasticity.law.of();
        if !law.is_linear() {
            let message = format!(
                "an odd mirror needs forces that are linear in displacements; those of `{}` are not",
                law.name()
            );
            let help = if law.is_state_based() { "use `state_based_linear`" } else { "use `bond_based_linear`" };
            self.error(&path, message, help);
        }
        if elasticity.failure.is_some() {
            let message = "an odd mirror shows a shortened bond where one is stretched: they would not break alike";
            self.error(&path, message, "use `parity = \"even\"`, or remove `failure`");
        }
    }
}
