//! Which physics a case has, and that nothing in it belongs to the other one: what diffuses is neither pulled nor cracked, and
//! what is elastic has no concentration.

use super::super::model::{Case, Diffusion, Load, Motion, Output, Precision, Probe, Scheme, SurfaceCorrection, Vtu};
use super::Checker;
use crate::discretization::Influence;
use crate::physics::diffusion::{self, micro_diffusivity};
use crate::physics::elasticity;

impl Checker<'_> {
    /// Exactly one physics, and what it can be given.
    pub(super) fn physics(&mut self, case: &Case) {
        let (elastic, diffusive) = (case.physics.elasticity.is_some(), case.physics.diffusion.is_some());
        let example = "diffusion = { diffusivity = \"1 mm^2/s\" }";
        self.either("physics", ("elasticity", elastic), ("diffusion", diffusive), example);
        match (&case.physics.elasticity, &case.physics.diffusion) {
            (Some(_), None) => self.elastic_only(case),
            (None, Some(diffusion)) => self.diffusion(diffusion, case),
            _ => return,
        }
        self.fields(case, diffusive);
    }

    /// What an elastic body is not given.
    fn elastic_only(&mut self, case: &Case) {
        if let Scheme::Collocation(_) = case.discretization.scheme {
            let message =
                "collocation everywhere is for diffusion: elastic bodies have bonds near boundaries and cracks";
            self.error("discretization.scheme", message, "use `hybrid`, which has both, or `standard`");
        }
        for (path, solver) in case.solver.stages().filter(|(_, solver)| solver.is_of_first_order()) {
            let message = format!("`{}` is for diffusion: motion is of second order in time", solver.name());
            let help = "use `velocity_verlet` or `runge_kutta`; for a body at rest `newton` and its like";
            self.error(&path, message, help);
        }
        for (k, condition) in case.conditions.iter().enumerate() {
            for (key, motion) in [("initial", &condition.initial), ("prescribe", &condition.prescribe)] {
                if let Some(Motion::Concentration { .. }) = motion {
                    let message = "an elastic body has no concentration";
                    let help = "use `displacement` or `velocity`, or give `[physics.diffusion]` instead of elasticity";
                    self.error(&format!("conditions[{k}].{key}.concentration"), message, help);
                }
            }
            if let Some(load @ (Load::Source { .. } | Load::Flux { .. })) = &condition.load {
                let message = format!("a `{}` is for diffusion: elastic bodies are loaded by forces", load.name());
                let help = "use `body_force`, `traction` or `pressure`";
                self.error(&format!("conditions[{k}].load.{}", load.name()), message, help);
            }
        }
    }

    /// Diffusion, and what it is not given.
    fn diffusion(&mut self, diffusion: &Diffusion, case: &Case) {
        let several = !diffusion.materials.is_empty();
        if several && diffusion.diffusivity.is_some() {
            let message = "each of the materials has its own `diffusivity`";
            self.error("physics.diffusion.diffusivity", message, "give it in `[materials.<name>]`");
        }
        if several && matches!(case.discretization.scheme, Scheme::Collocation(_)) {
            let message = "rows of collocation are of one diffusivity";
            self.error("discretization.scheme", message, "use `standard`");
        }
        if diffusion.diffusivity.is_none() && !several {
            let message = "missing key `diffusivity`: how fast it spreads";
            self.error("physics.diffusion", message, "add `diffusivity = <number, m^2/s>`, such as \"1 mm^2/s\"");
        }
        let influence = Influence::from(case.discretization.influence);
        if case.case.dimension == 1 && micro_diffusivity::<1>(&influence, diffusion.exponent.into(), 1.0, 1.0).is_err()
        {
            let message = format!(
                "with the influence `{}` ω/|ξ|^{} has no integral over squares in 1D, and no κ follows from the diffusivity",
                influence.name(),
                diffusion.exponent
            );
            self.error("physics.diffusion.exponent", message, "take 0, 1 or 2, or `influence = \"inverted\"`");
        }
        self.diffusive_discretization(case);
        for (path, solver) in case.solver.stages().filter(|(_, solver)| !solver.is_of_first_order()) {
            let message = format!("`{}` is for elasticity: diffusion is of first order in time", solver.name());
            self.error(&path, message, "use `solver.forward_euler`");
        }
        for (k, condition) in case.conditions.iter().enumerate() {
            for (key, motion) in [("initial", &condition.initial), ("prescribe", &condition.prescribe)] {
                if let Some(motion @ (Motion::Displacement { .. } | Motion::Velocity { .. })) = motion {
                    let message = format!("what diffuses has no {}", motion.name());
                    let help = format!("write `{key} = {{ concentration = {{ value = ... }} }}`");
                    self.error(&format!("conditions[{k}].{key}.{}", motion.name()), message, &help);
                }
            }
            if let Some(load) =
                condition.load.as_ref().filter(|load| !matches!(load, Load::Source { .. } | Load::Flux { .. }))
            {
                let message = format!("a `{}` is for elasticity: what diffuses is not moved by forces", load.name());
                let help = "use `source` (per volume and second) or `flux` (per area and second)";
                self.error(&format!("conditions[{k}].load.{}", load.name()), message, help);
            }
        }
        for (k, output) in case.output.iter().enumerate() {
            match output {
                Output::CrackTip(_) => {
                    let message = "nothing breaks in diffusion: there is no crack tip to follow";
                    self.error(&format!("output[{k}].crack_tip"), message, "remove it");
                }
                Output::Picture(picture) if picture.component.is_some() => {
                    let message = "a concentration is a number, and has no components";
                    self.error(&format!("output[{k}].picture.component"), message, "remove it");
                }
                _ => {}
            }
        }
    }

    /// Schemes of diffusion, and keys that are for elasticity.
    fn diffusive_discretization(&mut self, case: &Case) {
        let d = &case.discretization;
        if case.refinement.is_some() {
            self.error(
                "refinement",
                "cells are refined in elasticity only: diffusion has cells of one size",
                "remove it",
            );
        }
        if d.surface_correction != SurfaceCorrection::None {
            let message =
                "surface corrections are those of a stiffness: surfaces that lack bonds insulate as they should";
            self.error("discretization.surface_correction", message, "remove it");
        }
        if d.precision != Precision::Double {
            let message = "diffusion is computed in double precision";
            self.error("discretization.precision", message, "remove it, or take `double`");
        }
        match &d.scheme {
            Scheme::Standard => {}
            Scheme::Hybrid(_) => {
                let message =
                    "the hybrid scheme is for elasticity: it has bonds where they may break, and here none does";
                self.error("discretization.scheme", message, "use `standard` or `{ collocation = { order = 2 } }`");
            }
            Scheme::Collocation(collocation) => {
                if collocation.order % 2 == 1 {
                    let message = "the order of collocation is even";
                    let help = "an odd degree more changes nothing: take one less or more";
                    self.error("discretization.scheme.collocation.order", message, help);
                }
                if !case.geometry.cracks.is_empty() {
                    let message = "rows of collocation have no bonds that a pre-crack could cut";
                    self.error("geometry.cracks", message, "remove them, or take `scheme = \"standard\"`");
                }
            }
        }
    }

    /// Fields that outputs ask for are those of the physics.
    fn fields(&mut self, case: &Case, diffusive: bool) {
        let (name, known): (_, Vec<&str>) = match diffusive {
            true => ("diffusion", diffusion::fields().map(|field| field.name).collect()),
            false => ("elasticity", elasticity::fields().map(|field| field.name).collect()),
        };
        for (k, output) in case.output.iter().enumerate() {
            let asked: Vec<(String, &str)> = match output {
                Output::Picture(picture) => vec![(format!("output[{k}].picture.field"), picture.field.name())],
                Output::Vtu(Vtu { fields, .. }) | Output::Probe(Probe { fields, .. }) => {
                    let kind = if matches!(output, Output::Vtu(_)) { "vtu" } else { "probe" };
                    let path = |i: usize| format!("output[{k}].{kind}.fields[{i}]");
                    fields.iter().enumerate().map(|(i, field)| (path(i), field.name())).collect()
                }
                Output::Force(_) | Output::Cut(_) if diffusive => {
                    let kind = if matches!(output, Output::Force(_)) { "force" } else { "cut" };
                    let message = "what diffuses has no forces";
                    self.error(
                        &format!("output[{k}].{kind}"),
                        message,
                        "remove it; `reaction_<set>` of the history says what flows",
                    );
                    continue;
                }
                Output::History(_) | Output::CrackTip(_) | Output::Force(_) | Output::Cut(_) => Vec::new(),
            };
            for (path, field) in asked.into_iter().filter(|(_, field)| !known.contains(field)) {
                let message = format!("{name} has no field `{field}`; its fields: {}", known.join(", "));
                self.error(&path, message, "");
            }
        }
    }
}
