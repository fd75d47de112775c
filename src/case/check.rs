//! Rules across keys: what one key alone cannot tell. Each mistake is located at the key that has to change.

mod diffusion;
mod elasticity;
mod images;
mod materials;
mod plausible;
mod surfaces;

use std::collections::BTreeSet;

use super::diagnostics::Diagnostic;
use super::model::{
    Axis, Case, Control, Crack, FieldName, Hybrid, LinearSolver, Load, Motion, Output, Region, Scheme, Shape, Solver,
    SurfaceCorrection, Together,
};
use super::read::{Located, Source};
use crate::expression::nearest;

/// Everything that is wrong with a case whose keys are all right by themselves, and what is odd.
pub fn check(case: &Located<Case>) -> Vec<Diagnostic> {
    let mut checker = Checker { source: &case.source, list: Vec::new() };
    checker.case(&case.value);
    checker.list
}

struct Checker<'a> {
    source: &'a Source,
    list: Vec<Diagnostic>,
}

impl Checker<'_> {
    fn error(&mut self, path: &str, message: impl Into<String>, help: &str) {
        let diagnostic = self.source.error(path, message);
        self.list.push(if help.is_empty() { diagnostic } else { diagnostic.help(help) });
    }

    fn warning(&mut self, path: &str, message: impl Into<String>) {
        self.list.push(self.source.warning(path, message));
    }

    /// Exactly one of two keys of a table.
    fn either(&mut self, path: &str, a: (&str, bool), b: (&str, bool), example: &str) {
        match (a.1, b.1) {
            (true, true) => {
                let message = format!("`{}` and `{}` are both given; only one may be", a.0, b.0);
                self.error(&format!("{path}.{}", b.0), message, "remove one of them");
            }
            (false, false) => {
                let message = format!("neither `{}` nor `{}` is given; one must be", a.0, b.0);
                self.error(path, message, &format!("add one of them, such as `{example}`"));
            }
            _ => {}
        }
    }

    fn case(&mut self, case: &Case) {
        let dimension = case.case.dimension;
        self.geometry(case);
        for (name, region) in &case.sets {
            let path = format!("sets.{name}");
            if name == "all" {
                self.error(&path, "the name `all` is taken: it stands for every point", "choose another name");
            }
            self.region(region, dimension, &path);
        }
        self.surfaces(case);
        self.discretization(case);
        self.physics(case);
        if case.physics.elasticity.is_some() {
            self.refinement(case);
            self.correction(case);
        }
        let imported = case.geometry.points.is_some();
        let mut used = BTreeSet::new();
        if let Scheme::Hybrid(hybrid) = &case.discretization.scheme {
            if case.physics.elasticity.is_some() {
                self.hybrid(hybrid, case);
            }
            for (k, name) in hybrid.standard.iter().enumerate() {
                let path = format!("discretization.scheme.hybrid.standard[{k}]");
                self.set_name(name, case, imported, &path, &mut used);
            }
        }
        if let Some(elasticity) = &case.physics.elasticity {
            let path = format!("physics.elasticity.law.{}", elasticity.law.of().name());
            self.law(&elasticity.law, dimension, &path, !elasticity.materials.is_empty());
            if elasticity.law.of().is_state_based() {
                self.state_based(case);
            }
            if let Some(super::model::Failure::CriticalStretch(failure)) = &elasticity.failure {
                self.failure(failure, case, imported, &mut used);
            }
        }
        materials::check(self, case, &mut used);
        for (k, condition) in case.conditions.iter().enumerate() {
            let path = format!("conditions[{k}]");
            let acts = [condition.initial.is_some(), condition.prescribe.is_some(), condition.load.is_some()];
            let given = acts.into_iter().chain([condition.mirror.is_some(), condition.periodic.is_some()]);
            let load = condition.load.as_ref();
            match &condition.on {
                Some(_) if load.is_some_and(Load::is_placed) => {
                    let message = format!("a `{}` load says itself where it acts", load.map_or("", Load::name));
                    self.error(&format!("{path}.on"), message, "remove `on`");
                }
                Some(on) if case.surfaces.contains_key(on) => {
                    used.insert(on);
                    if !load.is_some_and(Load::is_by_area) {
                        let message =
                            format!("`{on}` is a surface: tractions, pressures, fluxes and moments act on it");
                        self.error(&format!("{path}.on"), message, "name a set of points");
                    } else if load.is_some_and(|load| load.layer() != (None, None)) {
                        let message = "a surface has its own area: `thickness` and `area` are for sets of points";
                        self.error(&format!("{path}.load"), message, "remove the key");
                    }
                }
                Some(on) => self.set_name(on, case, imported, &format!("{path}.on"), &mut used),
                None if load.is_some_and(Load::is_placed) => {}
                None if acts.contains(&true) => {
                    let message = "missing key `on`: the set of points that this condition acts on";
                    self.error(&path, message, "add `on = \"<set>\"`, such as `on = \"all\"`");
                }
                None => {}
            }
            match given.filter(|g| *g).count() {
                0 => {
                    let message = "this condition does nothing: `initial`, `prescribe`, `load`, `mirror` or `periodic` is missing";
                    let help = "add one, such as `initial = { velocity = { component = 0, value = 1.0 } }`";
                    self.error(&path, message, help);
                }
                1 => {}
                _ => {
                    let message = "a condition has exactly one of `initial`, `prescribe`, `load`, `mirror`, `periodic`";
                    self.error(&path, message, "give each its own [[conditions]] table");
                }
            }
            if condition.overrides && condition.initial.is_none() && condition.prescribe.is_none() {
                let message = "`override` is for `initial` and `prescribe`: loads on the same points add up";
                self.error(&format!("{path}.override"), message, "remove it");
            }
            if condition.initial.is_some() && condition.until.is_some() {
                let message = "an initial value has no end: `until` belongs to `prescribe` and `load`";
                self.error(&format!("{path}.until"), message, "remove it");
            }
            for (key, motion) in [("initial", &condition.initial), ("prescribe", &condition.prescribe)] {
                if let Some(motion @ (Motion::Displacement { component, .. } | Motion::Velocity { component, .. })) =
                    motion
                {
                    self.component(*component, dimension, &format!("{path}.{key}.{}.component", motion.name()));
                }
            }
            match &condition.load {
                Some(Load::BodyForce { component, .. }) => {
                    self.component(*component, dimension, &format!("{path}.load.body_force.component"));
                }
                Some(Load::Traction { component, .. }) => {
                    self.component(*component, dimension, &format!("{path}.load.traction.component"));
                }
                Some(load @ Load::Point { at, component, .. }) => {
                    let path = format!("{path}.load.{}", load.name());
                    self.vector(at, dimension, &format!("{path}.at"));
                    self.component(*component, dimension, &format!("{path}.component"));
                }
                Some(load @ Load::Line { from, to, component, .. }) => {
                    let path = format!("{path}.load.{}", load.name());
                    self.vector(from, dimension, &format!("{path}.from"));
                    self.vector(to, dimension, &format!("{path}.to"));
                    self.component(*component, dimension, &format!("{path}.component"));
                }
                Some(Load::Moment { axis, .. })
                    if dimension == 1 || (dimension == 2 && *axis != Some(Axis::Z) && axis.is_some()) =>
                {
                    let message = format!("there is no moment about this axis in {dimension}D");
                    self.error(&format!("{path}.load.moment"), message, "in 2D moments are about z");
                }
                Some(Load::Pressure { .. }) if case.geometry.shape.is_none() => {
                    let message = "a pressure needs the normals of `geometry.shape`, and this body comes from a file";
                    self.error(&format!("{path}.load.pressure"), message, "use a traction by component");
                }
                _ => {}
            }
        }
        self.plausible(case);
        self.images(case);
        self.solvers(case);
        self.outputs(case, imported, &mut used);
        // Next to a mistake, such as a misspelt name, it would be an echo.
        for name in case.sets.keys().filter(|_| self.list.is_empty()).cloned().collect::<Vec<_>>() {
            if !used.contains(name.as_str()) {
                self.warning(&format!("sets.{name}"), "this set is defined but never used");
            }
        }
        for name in case.surfaces.keys().filter(|_| self.list.is_empty()).cloned().collect::<Vec<_>>() {
            if !used.contains(name.as_str()) {
                self.warning(&format!("surfaces.{name}"), "this surface is defined but never used");
            }
        }
    }

    fn refinement(&mut self, case: &Case) {
        let Some(refinement) = &case.refinement else { return };
        if case.geometry.points.is_some() || case.geometry.perturb.is_some() {
            let (key, help) = match case.geometry.points {
                Some(_) => ("points", "give the body as `geometry.shape`, or the points as fine as they are wanted"),
                None => ("perturb", "remove one of them"),
            };
            let message = "refinement splits the cells of a lattice, and these points are none";
            self.error(&format!("geometry.{key}"), message, help);
        }
        for (k, zone) in refinement.zones.iter().enumerate() {
            self.region(&zone.region, case.case.dimension, &format!("refinement.zones[{k}].region"));
            if zone.level > refinement.levels {
                let message = format!("the zone wants level {}, beyond the finest, {}", zone.level, refinement.levels);
                self.error(&format!("refinement.zones[{k}].level"), message, "raise `refinement.levels`");
            }
        }
        if refinement.zones.is_empty() && refinement.refine_where.is_none() {
            let message = "this refines nothing: neither `zones` nor `refine_where` is given";
            self.error("refinement", message, "add one, such as `refine_where = \"stretch > 0.5 or damage > 0\"`");
        }
        if refinement.keep_where.is_some() && refinement.refine_where.is_none() {
            let message = "without `refine_where` cells are never merged";
            self.error("refinement.keep_where", message, "remove it, or add `refine_where`");
        }
        let moves = |solver: &Solver| matches!(solver, Solver::VelocityVerlet(_) | Solver::RungeKutta(_));
        if refinement.refine_where.is_some() && !case.solver.stages().any(|(_, solver)| moves(solver)) {
            let message = "cells follow the solution in motion only; this solver brings the body to rest";
            self.error("refinement.refine_where", message, "use `zones`, or `solver.velocity_verlet`");
        }
    }

    fn solvers(&mut self, case: &Case) {
        let mut begins = 0.0;
        let breaks = |solver: &Solver| {
            matches!(solver, Solver::VelocityVerlet(_) | Solver::RungeKutta(_) | Solver::QuasiStatic(_))
        };
        let any = case.solver.stages().any(|(_, solver)| breaks(solver));
        for (path, solver) in case.solver.stages() {
            match solver {
                Solver::VelocityVerlet(s) | Solver::RungeKutta(s) if s.safety.is_some() && s.time_step.is_some() => {
                    let message = "`safety` and `time_step` are both given; only one may be";
                    self.error(&format!("{path}.time_step"), message, "remove one of them");
                }
                Solver::ForwardEuler(s) if s.safety.is_some() && s.time_step.is_some() => {
                    let message = "`safety` and `time_step` are both given; only one may be";
                    self.error(&format!("{path}.time_step"), message, "remove one of them");
                }
                Solver::Static(s) | Solver::Newton(s)
                    if s.linear == LinearSolver::Direct && s.preconditioner.is_some() =>
                {
                    self.preconditioned(&path);
                }
                Solver::QuasiStatic(s) => {
                    if s.linear == Some(LinearSolver::Direct) && s.preconditioner.is_some() {
                        self.preconditioned(&path);
                    }
                    if s.control == Control::Equilibrium && matches!(s.together, Together::Share(_)) {
                        let message =
                            "with `control = \"equilibrium\"` each bond breaks where it just does: none has an excess";
                        self.error(&format!("{path}.break"), message, "remove it, or use `control = \"load\"`");
                    }
                }
                _ => {}
            }
            if !any && case.physics.elasticity.as_ref().is_some_and(|elasticity| elasticity.failure.is_some()) {
                let message = format!(
                    "no bond breaks in `{path}`; they do in `quasi_static`, `velocity_verlet` and `runge_kutta`"
                );
                self.warning(&path, message);
            }
            if solver.end_time() <= begins {
                let message =
                    format!("ends at {} s, when the solver before it has reached {begins} s", solver.end_time());
                let help = "time goes on from one solver of a chain to the next: give a later `end_time`";
                self.error(&format!("{path}.end_time"), message, help);
            }
            begins = solver.end_time();
        }
    }

    fn preconditioned(&mut self, path: &str) {
        let message = "a direct solver has no preconditioner";
        self.error(&format!("{path}.preconditioner"), message, "remove it, or choose another `linear`");
    }

    fn geometry(&mut self, case: &Case) {
        let (geometry, dimension) = (&case.geometry, case.case.dimension);
        self.either(
            "geometry",
            ("shape", geometry.shape.is_some()),
            ("points", geometry.points.is_some()),
            "shape = { rectangle = { size = [0.1, 0.04] } }",
        );
        if let Some(shape) = &geometry.shape {
            if geometry.spacing.is_none() {
                self.error(
                    "geometry",
                    "`spacing` is missing: a shape is filled with cells of this side",
                    "add `spacing = <number, m>`",
                );
            }
            self.shape(shape, dimension, "geometry.shape");
        } else {
            if geometry.spacing.is_some() {
                self.error(
                    "geometry.spacing",
                    "`spacing` belongs to `shape`; points from a file have volumes instead",
                    "remove it",
                );
            }
            if geometry.perturb.is_some() {
                self.error("geometry.perturb", "only the lattice of a `shape` can be perturbed", "remove it");
            }
        }
        for (k, crack) in geometry.cracks.iter().enumerate() {
            let (name, wanted, vertices) = match crack {
                Crack::Point(_) => ("point", 1, None),
                Crack::Segment { .. } => ("segment", 2, None),
                Crack::Polyline { vertices } => ("polyline", 2, Some(vertices)),
                Crack::Polygon { vertices } => ("polygon", 3, Some(vertices)),
                Crack::Disc { .. } => ("disc", 3, None),
            };
            let path = format!("geometry.cracks[{k}].{name}");
            self.fits(name, wanted, dimension, &path);
            for (i, vertex) in vertices.into_iter().flatten().enumerate() {
                self.vector(vertex, wanted, &format!("{path}.vertices[{i}]"));
            }
        }
    }

    fn fits(&mut self, name: &str, wanted: usize, dimension: usize, path: &str) {
        if wanted != dimension {
            let help = match dimension {
                1 => "in 1D: segment, box; crack point",
                2 => "in 2D: rectangle, box, disk, ring, polygon; cracks segment, polyline",
                _ => "in 3D: block, box, sphere, cylinder, tube, extrusion; cracks polygon, disc",
            };
            self.error(path, format!("`{name}` is for {wanted}D, and this case is {dimension}D"), help);
        }
    }

    fn vector(&mut self, vector: &[f64], dimension: usize, path: &str) {
        if vector.len() != dimension {
            let message = format!("{} components, where {dimension} are wanted in {dimension}D", vector.len());
            self.error(path, message, "");
        }
    }

    fn component(&mut self, component: usize, dimension: usize, path: &str) {
        if component >= dimension {
            let known = ["0 is x", "1 is y", "2 is z"][..dimension].join(", ");
            self.error(path, format!("there is no component {component} in {dimension}D"), &known);
        }
    }

    fn size(&mut self, size: &[f64], path: &str) {
        for (d, _) in size.iter().enumerate().filter(|(_, length)| **length <= 0.0) {
            self.error(&format!("{path}[{d}]"), "a size must be above 0", "");
        }
    }

    fn shape(&mut self, shape: &Shape, dimension: usize, path: &str) {
        match shape {
            Shape::Segment { .. } => self.fits("segment", 1, dimension, path),
            Shape::Rectangle { size, .. } => {
                self.fits("rectangle", 2, dimension, path);
                self.size(size, &format!("{path}.rectangle.size"));
            }
            Shape::Disk { .. } => self.fits("disk", 2, dimension, path),
            Shape::Ring { .. } => self.fits("ring", 2, dimension, path),
            Shape::Polygon { vertices } => {
                self.fits("polygon", 2, dimension, path);
                for (i, vertex) in vertices.iter().enumerate() {
                    self.vector(vertex, 2, &format!("{path}.polygon.vertices[{i}]"));
                }
            }
            Shape::Block { size, .. } => {
                self.fits("block", 3, dimension, path);
                self.size(size, &format!("{path}.block.size"));
            }
            Shape::Sphere { .. } => self.fits("sphere", 3, dimension, path),
            Shape::Cylinder { .. } => self.fits("cylinder", 3, dimension, path),
            Shape::Tube { .. } => self.fits("tube", 3, dimension, path),
            Shape::Extrusion { vertices, .. } => {
                self.fits("extrusion", 3, dimension, path);
                for (i, vertex) in vertices.iter().enumerate() {
                    self.vector(vertex, 2, &format!("{path}.extrusion.vertices[{i}]"));
                }
            }
            Shape::Box { low, high } => {
                self.vector(low, dimension, &format!("{path}.box.low"));
                self.vector(high, dimension, &format!("{path}.box.high"));
            }
            Shape::Union(members) | Shape::Intersection(members) => {
                let name = if matches!(shape, Shape::Union(_)) { "union" } else { "intersection" };
                for (i, member) in members.iter().enumerate() {
                    self.shape(member, dimension, &format!("{path}.{name}[{i}]"));
                }
            }
            Shape::Difference { of, minus } => {
                self.shape(of, dimension, &format!("{path}.difference.of"));
                for (i, member) in minus.iter().enumerate() {
                    self.shape(member, dimension, &format!("{path}.difference.minus[{i}]"));
                }
            }
        }
    }

    fn region(&mut self, region: &Region, dimension: usize, path: &str) {
        match region {
            Region::Box { low, high } => {
                self.vector(low, dimension, &format!("{path}.box.low"));
                self.vector(high, dimension, &format!("{path}.box.high"));
                for (d, (a, b)) in low.iter().zip(high).enumerate() {
                    if a > b {
                        self.error(&format!("{path}.box"), format!("low[{d}] = {a} is above high[{d}] = {b}"), "");
                    }
                }
            }
            Region::Inside(shape) => self.shape(shape, dimension, &format!("{path}.inside")),
            Region::Where(_) | Region::Layer { .. } => {}
            Region::All(regions) | Region::Any(regions) => {
                for region in regions {
                    self.region(region, dimension, path);
                }
            }
            Region::Not(region) => self.region(region, dimension, path),
        }
    }

    fn discretization(&mut self, case: &Case) {
        let d = &case.discretization;
        self.either(
            "discretization",
            ("horizon_ratio", d.horizon_ratio.is_some()),
            ("horizon", d.horizon.is_some()),
            "horizon_ratio = 3",
        );
        if let (Some(horizon), Some(spacing)) = (d.horizon, case.geometry.spacing)
            && horizon < spacing
        {
            let message = format!(
                "the horizon {horizon} m is smaller than the spacing {spacing} m (ratio {:.3}): points see nobody",
                horizon / spacing
            );
            self.error("discretization.horizon", message, "a ratio of 3 to 5 is usual");
        }
    }

    /// Corrections of bodies whose cells have several sizes.
    fn correction(&mut self, case: &Case) {
        let (path, correction) = ("discretization.surface_correction", case.discretization.surface_correction);
        let Some(refinement) = &case.refinement else { return };
        if correction == SurfaceCorrection::None {
            return;
        }
        if refinement.refine_where.is_some() {
            let message = "bodies whose cells follow the solution are not corrected: families change as it runs";
            self.error(path, message, "remove it, or refine by `zones` instead of `refine_where`");
        } else if correction == SurfaceCorrection::Volume {
            let message = "where horizons differ the volume of a family does not tell what it lacks";
            self.error(path, message, "use `energy`");
        }
    }

    fn hybrid(&mut self, hybrid: &Hybrid, case: &Case) {
        let path = "discretization.scheme.hybrid";
        if hybrid.order % 2 == 1 {
            let message = "the order of collocation is even";
            self.error(&format!("{path}.order"), message, "an odd degree more changes nothing: take one less or more");
        }
        let off_lattice = [
            (case.geometry.points.is_some(), "geometry.points"),
            (case.geometry.perturb.is_some(), "geometry.perturb"),
            (case.refinement.is_some(), "refinement"),
            (case.discretization.surface_correction != SurfaceCorrection::None, "discretization.surface_correction"),
        ];
        for (_, key) in off_lattice.iter().filter(|(given, _)| *given) {
            let message = format!("the hybrid scheme is for lattices, and with `{key}` the points are none");
            self.error(path, message, &format!("remove `{key}`, or take `scheme = \"standard\"`"));
        }
        for (path, solver) in case.solver.stages() {
            if !matches!(solver, Solver::VelocityVerlet(_) | Solver::RungeKutta(_)) {
                let message =
                    "the hybrid scheme is for motion: its operator is not symmetric, and this solver needs one";
                let help = "use `solver.velocity_verlet` or `solver.runge_kutta`, or `scheme = \"standard\"`";
                self.error(&path, message, help);
            }
        }
    }

    /// Sets of imported points are known only when the file is read: `build` asks for them.
    fn set_name<'a>(
        &mut self,
        name: &'a str,
        case: &'a Case,
        imported: bool,
        path: &str,
        used: &mut BTreeSet<&'a str>,
    ) {
        used.insert(name);
        let (_, materials) = case.physics.materials();
        let known = case.sets.contains_key(name) || case.surfaces.contains_key(name);
        if name == "all" || known || materials.contains_key(name) || imported {
            return;
        }
        let names = case.sets.keys().chain(materials.keys().filter(|name| !case.sets.contains_key(*name)));
        let names: Vec<&str> = names.map(String::as_str).chain(["all"]).collect();
        let help = nearest(name, names.iter().copied()).map_or(String::new(), |n| format!("did you mean `{n}`?"));
        self.error(path, format!("no set has this name; sets: {}", names.join(", ")), &help);
    }

    /// The number of a component of a field.
    fn component_of(&mut self, field: &FieldName, component: usize, dimension: usize, path: &str) {
        let (path, name) = (format!("{path}.component"), field.name());
        let known = field.kind().components(dimension);
        if known.is_empty() {
            self.error(&path, format!("`{name}` is a number, which has no components"), "remove the key");
        } else if component >= known.len() {
            let list: Vec<String> = known.iter().enumerate().map(|(k, name)| format!("{k} is {name}")).collect();
            let message = format!("there is no component {component} of `{name}` in {dimension}D");
            self.error(&path, message, &list.join(", "));
        }
    }

    /// The place that moments are about.
    fn about(&mut self, about: Option<&[f64]>, dimension: usize, path: &str) {
        let Some(about) = about else { return };
        let path = format!("{path}.about");
        if dimension == 1 {
            self.error(&path, "in 1D forces have no moments", "remove the key");
        } else {
            self.vector(about, dimension, &path);
        }
    }

    /// The name of a table, which becomes part of that of its file. `tables`: kind, name and place of those before.
    fn table_name<'a>(&mut self, kind: &'a str, name: &str, k: usize, tables: &mut Vec<(&'a str, String, usize)>) {
        let path = format!("output[{k}].{kind}.name");
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
            let message = format!("a {kind}'s name becomes a file name: letters, digits, `_` and `-` only");
            self.error(&path, message, "");
        }
        let folded = name.to_lowercase();
        if let Some((.., first)) = tables.iter().find(|(other, taken, _)| *other == kind && *taken == folded) {
            self.error(&path, format!("output[{first}] has this name already (capitals do not count)"), "");
        }
        tables.push((kind, folded, k));
    }

    fn outputs<'a>(&mut self, case: &'a Case, imported: bool, used: &mut BTreeSet<&'a str>) {
        let mut tables: Vec<(&str, String, usize)> = Vec::new();
        let (mut histories, mut tips) = (0, 0);
        let mut frames: Option<usize> = None;
        let mut drawn: Vec<(usize, &FieldName, Option<usize>)> = Vec::new();
        for (k, output) in case.output.iter().enumerate() {
            let path = format!("output[{k}]");
            match output {
                Output::Vtu(vtu) => {
                    let path = format!("{path}.vtu");
                    self.either(
                        &path,
                        ("every", vtu.every.is_some()),
                        ("every_steps", vtu.every_steps.is_some()),
                        "every_steps = 100",
                    );
                    if let Some(first) = frames {
                        let message = format!("output[{first}] writes `fields.pvd` and its frames already");
                        self.error(&path, message, "name all fields in one of them");
                    }
                    frames = frames.or(Some(k));
                }
                Output::Picture(picture) => {
                    let path = format!("{path}.picture");
                    let same = |(_, field, component): &&(usize, &FieldName, Option<usize>)| {
                        field.name() == picture.field.name() && *component == picture.component
                    };
                    if let Some((first, ..)) = drawn.iter().find(same) {
                        let message = format!(
                            "output[{first}] draws this field too, and both would write the same files `pictures/{}...`",
                            picture.field.name()
                        );
                        self.error(&path, message, "keep one of them, or draw another component");
                    }
                    drawn.push((k, &picture.field, picture.component));
                    let given = [picture.every.is_some(), picture.every_steps.is_some(), !picture.at.is_empty()];
                    if given.iter().filter(|g| **g).count() > 1 {
                        self.error(&path, "at most one of `every`, `every_steps`, `at` may be given", "");
                    }
                    if let Some(range) = &picture.range
                        && range[0] >= range[1]
                    {
                        self.error(&format!("{path}.range"), "the first end must be below the second", "");
                    }
                    if let Some(component) = picture.component {
                        self.component_of(&picture.field, component, case.case.dimension, &path);
                    }
                }
                Output::History(_) => {
                    histories += 1;
                    if histories > 1 {
                        self.error(&path, "a second history; one table is written", "remove it");
                    }
                }
                Output::Probe(probe) => {
                    self.vector(&probe.at, case.case.dimension, &format!("{path}.probe.at"));
                    self.table_name("probe", &probe.name, k, &mut tables);
                }
                Output::Force(force) => {
                    let path = format!("{path}.force");
                    self.set_name(&force.on, case, imported, &format!("{path}.on"), used);
                    self.about(force.about.as_deref(), case.case.dimension, &path);
                    self.table_name("force", &force.name, k, &mut tables);
                }
                Output::Cut(cut) => {
                    let path = format!("{path}.cut");
                    self.vector(&cut.point, case.case.dimension, &format!("{path}.point"));
                    self.vector(&cut.normal, case.case.dimension, &format!("{path}.normal"));
                    if cut.normal.iter().all(|&n| n == 0.0) {
                        let message = "the zero vector is no direction";
                        self.error(
                            &format!("{path}.normal"),
                            message,
                            "give the direction across the cut, of any length",
                        );
                    }
                    self.about(cut.about.as_deref(), case.case.dimension, &path);
                    self.table_name("cut", &cut.name, k, &mut tables);
                }
                Output::CrackTip(tip) => {
                    tips += 1;
                    if tips > 1 {
                        self.error(&path, "a second crack tip; one is followed", "remove it");
                    }
                    self.vector(&tip.along, case.case.dimension, &format!("{path}.crack_tip.along"));
                    if tip.along.iter().all(|&a| a == 0.0) {
                        self.error(&format!("{path}.crack_tip.along"), "the zero vector is no direction", "");
                    }
                }
            }
        }
    }
}
