//! From a checked case to a simulation: the only place where dimension and law become types.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::bundled;
use super::check::check;
use super::diagnostics::{Diagnostic, Severity};
use super::import;
use super::model::{
    self, Axis, BondBased, Case, FieldName, Formula, InfluenceFunction, Law, Motion, Output, PartialVolumes, Plane,
    Precision, Region,
};
use super::read::{Located, Source};
use crate::conditions::load::Scale;
use crate::conditions::profile::VARIABLES;
use crate::conditions::{Load, Prescribed, Profile, Quantity, initial};
use crate::discretization::{Influence, Operator, PartialVolume, standard};
use crate::error::{Error, Result};
use crate::execution::Packs;
use crate::expression::{Expression, nearest};
use crate::family::BondLaw;
use crate::field::{Double, Mixed, Single, Vector, components_mut};
use crate::geometry::{Arrangement, Cloud, Crack, Shape};
use crate::output::crack_tip::CrackTip;
use crate::output::frames::Frames;
use crate::output::history::History;
use crate::output::picture::{ColorMap, Picture, View};
use crate::output::pictures::Pictures;
use crate::output::probe::Probe;
use crate::output::schedule::Schedule;
use crate::output::source::Facts;
use crate::output::writer::Output as Written;
use crate::physics::Elasticity;
use crate::physics::elasticity::bond_based;
use crate::physics::elasticity::moduli::{self, Hypothesis};
use crate::physics::failure::CriticalStretch;
use crate::physics::failure::critical_stretch::PairRule;
use crate::problem::Problem;
use crate::simulation::{Model, Simulation, Stepper};
use crate::solver::dynamic_relaxation::DynamicRelaxation;
use crate::solver::newton::Newton;
use crate::solver::statics::Method;
use crate::solver::{Clock, Solver, Statics, VelocityVerlet};

/// How a case is to be run, beside what it says itself.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Where results go; nothing is written there before the run starts.
    pub folder: PathBuf,
    /// Folder that paths in the case are relative to.
    pub base: PathBuf,
    /// Lifts the limit on the number of files.
    pub many_files: bool,
}

/// Largest number of files that one output may write without being asked twice.
const MANY_FILES: u64 = 100_000;
/// Largest number of steps: more would take this machine longer than anybody waits.
const MANY_STEPS: f64 = 1e15;
/// Damage above which a point counts as damaged, where the case says nothing.
const DAMAGED: f64 = 0.35;
/// Steps between history rows, where the case says nothing.
const HISTORY_EVERY: u64 = 20;
/// Fraction of the stable step, where the case says nothing.
const SAFETY: f64 = 0.8;

/// Builds a simulation, or returns everything that is wrong with the case. Warnings go to the log.
pub fn build(case: &Located<Case>, options: &Options) -> Result<Simulation> {
    let begin = Instant::now();
    let remarks = check(case);
    let (errors, warnings): (Vec<_>, Vec<_>) = remarks.into_iter().partition(|d| d.severity == Severity::Error);
    for warning in &warnings {
        log::warn!("{warning}");
    }
    if !errors.is_empty() {
        return Err(refuse(case, errors));
    }
    let mut simulation = match case.value.case.dimension {
        1 => Builder::<1> { case, options }.simulation(),
        2 => Builder::<2> { case, options }.simulation(),
        _ => Builder::<3> { case, options }.simulation(),
    }?;
    simulation.setup_seconds = begin.elapsed().as_secs_f64();
    Ok(simulation)
}

fn refuse(case: &Located<Case>, list: Vec<Diagnostic>) -> Error {
    Error::Case(case.source.refuse(list))
}

struct Builder<'a, const D: usize> {
    case: &'a Located<Case>,
    options: &'a Options,
}

impl<const D: usize> Builder<'_, D> {
    fn simulation(&self) -> Result<Simulation> {
        match &self.case.value.physics.elasticity.law {
            Law::BondBased(p) => self.with_law(bond_based::BondBased, p),
            Law::BondBasedLinear(p) => self.with_law(bond_based::BondBasedLinear, p),
        }
    }

    fn with_law<L: BondLaw<D> + 'static>(&self, law: L, parameters: &BondBased) -> Result<Simulation> {
        match self.case.value.discretization.precision {
            Precision::Double => self.in_precision::<L, Double>(law, parameters),
            Precision::Single => self.in_precision::<L, Single>(law, parameters),
            Precision::Mixed => self.in_precision::<L, Mixed>(law, parameters),
        }
    }

    fn source(&self) -> &Source {
        &self.case.source
    }

    fn refuse(&self, path: &str, message: impl Into<String>, help: &str) -> Error {
        let diagnostic = self.source().error(path, message);
        refuse(self.case, vec![if help.is_empty() { diagnostic } else { diagnostic.help(help) }])
    }

    fn in_precision<L, P>(&self, law: L, parameters: &BondBased) -> Result<Simulation>
    where
        L: BondLaw<D> + 'static,
        P: Packs,
    {
        let case = &self.case.value;
        let shape = self.shape()?;
        let cracks = self.cracks()?;
        let rule = match case.discretization.partial_volumes {
            PartialVolumes::None => PartialVolume::None,
            PartialVolumes::Ramp => PartialVolume::Ramp,
            PartialVolumes::Exact => PartialVolume::Exact,
        };
        let influence = influence(&case.discretization.influence);
        let mut cloud = self.cloud(shape.as_ref(), rule)?;
        let horizon = self.horizon(&cloud)?;
        self.sets(&mut cloud, shape.as_ref())?;
        let hypothesis = match (D, parameters.plane) {
            (1, _) => Hypothesis::Bar,
            (2, Some(Plane::Strain)) => Hypothesis::PlaneStrain,
            (2, _) => Hypothesis::PlaneStress,
            _ => Hypothesis::Solid,
        };
        let strength = moduli::micromodulus(hypothesis, &influence, parameters.young, horizon);
        let failure = self.failure(&cloud, hypothesis, &influence, strength, horizon)?;
        let tolerance = 1e-9 * cloud.spacing;
        let body = standard::body(cloud, horizon, rule);
        let operator = Operator::standard(&body, strength, influence, rule);
        let physics = Elasticity { law, density: parameters.density, operator, failure };
        let mut state = physics.initial_state::<D, P>(&body);
        let mut n_cut = 0;
        for crack in &cracks {
            n_cut += state.states.cut(&body, crack, tolerance);
        }
        let (mut prescribed, mut loads) = (Vec::new(), Vec::new());
        for (k, condition) in case.conditions.iter().enumerate() {
            let slots = self.slots(&condition.on, &body.cloud, &format!("conditions[{k}].on"))?;
            if let Some(motion) = &condition.initial {
                let (flat, component, value) = match motion {
                    Motion::Displacement { component, value } => (&mut state.displacement, *component, value),
                    Motion::Velocity { component, value } => (&mut state.velocity, *component, value),
                };
                let path = format!("conditions[{k}].initial.{}.value", motion_name(motion));
                let mut profile = self.profile(value, &body.cloud, &slots, &path)?;
                initial::apply(components_mut::<D, _>(flat)[component], &slots, &mut profile);
            }
            if let Some(motion) = &condition.prescribe {
                prescribed.push(self.prescribed(k, motion, &body.cloud, slots.clone())?);
            }
            if let Some(load) = &condition.load {
                self.load(k, load, &body.cloud, shape.as_ref(), &slots, &mut loads)?;
            }
        }
        let stable_step = physics.stable_step(&body);
        let smallest = physics.failure.as_ref().map(CriticalStretch::smallest).filter(|s| s.is_finite());
        let facts = Facts {
            dimension: D,
            points: 0,
            bonds: 0,
            cut_bonds: 0,
            horizon,
            spacing: 0.0,
            stable_step,
            bar_speed: (parameters.young / parameters.density).sqrt(),
            rayleigh_speed: moduli::rayleigh_speed(hypothesis, parameters.young, parameters.density),
            micromodulus: strength,
            critical_stretch: smallest,
            memory: 0,
        };
        let mut problem = Problem::new(body, physics, state, prescribed, loads, n_cut);
        problem.is_static = !matches!(self.case.value.solver, model::Solver::VelocityVerlet(_));
        let model = Model::new(problem, facts);
        self.finish(Box::new(model))
    }

    /// Time step, outputs, and the simulation that holds them.
    fn finish(&self, model: Box<dyn Stepper>) -> Result<Simulation> {
        let case = &self.case.value;
        let facts = model.facts().clone();
        let (solver, dt, n_steps) = self.solver(facts.stable_step)?;
        let folder = &self.options.folder;
        let mut outputs = Vec::new();
        let mut every = HISTORY_EVERY;
        let mut tip = self.default_tip(&facts);
        for (k, output) in case.output.iter().enumerate() {
            match output {
                Output::Vtu(vtu) => {
                    let schedule = schedule(vtu.every, vtu.every_steps, &[]);
                    self.files(&schedule, n_steps, dt, &format!("output[{k}].vtu"))?;
                    let fields = names(&vtu.fields, &[FieldName::Displacement, FieldName::Damage]);
                    outputs.push(Written { schedule, writer: Box::new(Frames::new(folder, fields)) });
                }
                Output::Picture(picture) => {
                    // One that does not say when is drawn at the end only.
                    let schedule = match schedule(picture.every, picture.every_steps, &picture.at) {
                        Schedule::Ends => Schedule::End,
                        other => other,
                    };
                    self.files(&schedule, n_steps, dt, &format!("output[{k}].picture"))?;
                    let pictures = Pictures {
                        folder: folder.clone(),
                        field: name(picture.field),
                        component: picture.component,
                        deform: picture.deform,
                        above: picture.above,
                        style: style(picture, &case.case.title),
                    };
                    outputs.push(Written { schedule, writer: Box::new(pictures) });
                }
                Output::History(history) => every = history.every_steps,
                Output::Probe(probe) => {
                    let fields = names(&probe.fields, &[FieldName::Displacement, FieldName::Velocity]);
                    let path = folder.join(format!("probe_{}.csv", probe.name));
                    let mut at = [0.0; 3];
                    at[..D].copy_from_slice(&probe.at);
                    let schedule = Schedule::Steps(probe.every_steps);
                    outputs
                        .push(Written { schedule, writer: Box::new(Probe::new(path, model.positions(), at, fields)) });
                }
                Output::CrackTip(t) => {
                    let mut along = [0.0; 3];
                    along[..D].copy_from_slice(&t.along);
                    tip = Some(CrackTip::new(along, t.threshold, tip_window(&facts)));
                }
            }
        }
        Ok(Simulation {
            title: case.case.title.clone(),
            model,
            solver,
            clock: Clock { step: 0, dt },
            n_steps,
            history: History::new(folder.join("history.csv"), every, tip),
            outputs,
            folder: folder.clone(),
            threads: rayon::current_num_threads(),
            setup_seconds: 0.0,
        })
    }

    /// The solver, its step (s), and how many it takes.
    fn solver(&self, stable_step: f64) -> Result<(Solver, f64, u64)> {
        let newton = |s: &model::Statics| {
            let (tolerance, max_iterations, max_linear) = (s.tolerance, s.max_iterations, s.max_linear);
            Method::Newton(Newton { tolerance, max_iterations, max_linear })
        };
        let statics = |method, linearised, breaking, end_time: f64, steps: u64| {
            let solver = Solver::Statics(Statics { method, linearised, breaking });
            Ok((solver, end_time / steps as f64, steps))
        };
        match &self.case.value.solver {
            model::Solver::VelocityVerlet(solver) => {
                let (dt, n_steps) = self.time_steps(solver, stable_step)?;
                Ok((Solver::VelocityVerlet(VelocityVerlet { damping: solver.damping }), dt, n_steps))
            }
            model::Solver::Static(s) => statics(newton(s), true, false, s.end_time, s.steps),
            model::Solver::Newton(s) => statics(newton(s), false, false, s.end_time, s.steps),
            model::Solver::QuasiStatic(s) => statics(newton(s), false, true, s.end_time, s.steps),
            model::Solver::DynamicRelaxation(s) => {
                let method = DynamicRelaxation { tolerance: s.tolerance, max_iterations: s.max_iterations };
                statics(Method::DynamicRelaxation(method), false, false, s.end_time, s.steps)
            }
        }
    }

    fn time_steps(&self, solver: &model::VelocityVerlet, stable_step: f64) -> Result<(f64, u64)> {
        let (dt, n_steps) = match solver.time_step {
            Some(dt) => {
                if dt > stable_step {
                    let message =
                        format!("the time step is above the stable step {stable_step:.4e} s of this discretisation");
                    let help = "give a smaller one, or `safety = 0.8` instead of `time_step`";
                    return Err(self.refuse("solver.velocity_verlet.time_step", message, help));
                }
                (dt, (solver.end_time / dt - 1e-9).ceil().max(1.0))
            }
            None => {
                let n = (solver.end_time / (stable_step * solver.safety.unwrap_or(SAFETY))).ceil().max(1.0);
                (solver.end_time / n, n)
            }
        };
        if n_steps > MANY_STEPS {
            let message =
                format!("this would take {n_steps:.3e} steps of {dt:.3e} s; at most {MANY_STEPS:.0e} are taken");
            return Err(self.refuse("solver.velocity_verlet.end_time", message, "is the unit right?"));
        }
        Ok((dt, n_steps as u64))
    }

    fn files(&self, schedule: &Schedule, n_steps: u64, dt: f64, path: &str) -> Result<()> {
        let count = schedule.count(n_steps, dt);
        if count > MANY_FILES && !self.options.many_files {
            let message = format!("this would write {count} files; at most {MANY_FILES} are written unasked");
            return Err(self.refuse(path, message, "write less often, or pass --many-files"));
        }
        Ok(())
    }

    /// With one straight pre-crack in 2D, its own direction is the one to follow.
    fn default_tip(&self, facts: &Facts) -> Option<CrackTip> {
        match &self.case.value.geometry.cracks[..] {
            [model::Crack::Segment { from, to }] => {
                let along = [to[0] - from[0], to[1] - from[1], 0.0];
                Some(CrackTip::new(along, DAMAGED, tip_window(facts)))
            }
            _ => None,
        }
    }

    fn shape(&self) -> Result<Option<Shape<D>>> {
        let Some(shape) = &self.case.value.geometry.shape else { return Ok(None) };
        let shape = shape_of::<D>(shape);
        shape.validate().map_err(|e| self.refuse("geometry.shape", e, ""))?;
        Ok(Some(shape))
    }

    fn cracks(&self) -> Result<Vec<Crack<D>>> {
        let mut cracks = Vec::new();
        for (k, crack) in self.case.value.geometry.cracks.iter().enumerate() {
            let pair = |v: &Vec<f64>| [v[0], v[1]];
            let triple = |v: &Vec<f64>| [v[0], v[1], v[2]];
            let crack = match crack {
                model::Crack::Point(x) => Crack::Point(*x),
                model::Crack::Segment { from, to } => Crack::Polyline(vec![pair(from), pair(to)]),
                model::Crack::Polyline { vertices } => Crack::Polyline(vertices.iter().map(pair).collect()),
                model::Crack::Polygon { vertices } => Crack::Polygon(vertices.iter().map(triple).collect()),
                model::Crack::Disc { center, normal, radius } => {
                    Crack::Disc { center: triple(center), normal: triple(normal), radius: *radius }
                }
            };
            crack.validate().map_err(|e| self.refuse(&format!("geometry.cracks[{k}]"), e, ""))?;
            cracks.push(crack);
        }
        Ok(cracks)
    }

    fn cloud(&self, shape: Option<&Shape<D>>, rule: PartialVolume) -> Result<Cloud<D>> {
        let geometry = &self.case.value.geometry;
        if let (Some(shape), Some(spacing)) = (shape, geometry.spacing) {
            let reach = self.reach(spacing, rule)?;
            self.fits_into_memory(shape, spacing, reach)?;
            let cloud = Cloud::lattice(shape, spacing, reach.ceil() as usize);
            if cloud.n_points() == 0 {
                let message = format!("no cell of side {spacing} m has its centre inside the shape");
                return Err(self.refuse("geometry.spacing", message, "a smaller spacing fills it"));
            }
            let (low, high) = shape.bounds();
            let Arrangement::Lattice(lattice) = &cloud.arrangement else { return Ok(cloud) };
            for d in 0..D {
                let cells = (high[d] - low[d]) / spacing;
                let axis = ["x", "y", "z"][d];
                if matches!(shape, Shape::Box { .. }) && (cells - lattice.counts[d] as f64).abs() > 1e-6 * cells {
                    log::warn!(
                        "the spacing does not divide the body along {axis}: {} cells of {spacing} m stand for {} m",
                        lattice.counts[d],
                        high[d] - low[d]
                    );
                }
            }
            return Ok(match &geometry.perturb {
                None => cloud,
                Some(perturb) => {
                    let mut random = ChaCha8Rng::seed_from_u64(perturb.seed);
                    let volume = lattice.cell_volume();
                    let mut positions: Vec<Vector<D>> = cloud
                        .slots
                        .iter()
                        .map(|&slot| {
                            cloud.position(slot as usize).map(|x| {
                                let unit = (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
                                x + perturb.amplitude * spacing * (2.0 * unit - 1.0)
                            })
                        })
                        .collect();
                    if perturb.shuffle {
                        for k in (1..positions.len()).rev() {
                            positions.swap(k, (random.next_u64() % (k as u64 + 1)) as usize);
                        }
                    }
                    let volumes = vec![volume; positions.len()];
                    Cloud::scattered(positions, volumes)
                }
            });
        }
        let Some(model::Points::Csv { file }) = &geometry.points else {
            return Err(Error::Refused("a case has a shape or points".into()));
        };
        let path = self.options.base.join(file);
        if !path.exists() {
            let help = "the path is relative to the folder of the case file";
            return Err(self.refuse("geometry.points.csv.file", format!("there is no file {}", path.display()), help));
        }
        let points = import::csv::read::<D>(&path)?;
        let mut cloud = Cloud::scattered(points.positions, points.volumes);
        for (name, members) in points.sets {
            let slots = cloud.slots_of(&members);
            cloud.sets.insert(name, slots);
        }
        Ok(cloud)
    }

    /// Largest distance of a neighbour in cells, known before any point is made.
    fn reach(&self, spacing: f64, rule: PartialVolume) -> Result<f64> {
        let d = &self.case.value.discretization;
        let ratio = d.horizon_ratio.or(d.horizon.map(|h| h / spacing)).unwrap_or(1.0);
        if ratio > 100.0 {
            let message = format!("the horizon is {ratio:.1} spacings; at most 100 are allowed");
            return Err(self.refuse("discretization.horizon", message, "a ratio of 3 to 5 is usual"));
        }
        Ok(rule.reach::<D>(spacing, ratio * spacing) / spacing + 1.0)
    }

    fn horizon(&self, cloud: &Cloud<D>) -> Result<f64> {
        let d = &self.case.value.discretization;
        let horizon = d.horizon.unwrap_or_else(|| d.horizon_ratio.unwrap_or(3.0) * cloud.spacing);
        if horizon < cloud.spacing * (1.0 - 1e-9) {
            let message = format!("the horizon {horizon} m is smaller than the mean spacing {} m", cloud.spacing);
            return Err(self.refuse("discretization.horizon", message, "a ratio of 3 to 5 is usual"));
        }
        let (low, high) = cloud.bounds();
        let smallest = (0..D).map(|d| high[d] - low[d] + cloud.spacing).fold(f64::INFINITY, f64::min);
        if horizon > 0.5 * smallest {
            log::warn!("the horizon {horizon} m is more than half the smallest extent {smallest} m of the body");
        }
        Ok(horizon)
    }

    /// Refuses what cannot fit before anything is allocated.
    fn fits_into_memory(&self, shape: &Shape<D>, spacing: f64, reach: f64) -> Result<()> {
        let (low, high) = shape.bounds();
        let mut points = 1.0;
        for d in 0..D {
            points *= ((high[d] - low[d]) / spacing).round().max(1.0);
        }
        let ball = [2.0, std::f64::consts::PI, 4.0 / 3.0 * std::f64::consts::PI][D - 1];
        let family = ball * (reach - 1.0).powi(D as i32);
        let number = if self.case.value.discretization.precision == Precision::Single { 4.0 } else { 8.0 };
        // Fields, slots and bonds, and what set-up and the books need for a while; for a cloud its records too.
        let fields = (3 * D + 1) as f64 * number + 4.0 + 16.0;
        let per_point = if self.case.value.geometry.perturb.is_some() {
            fields + (D + 1) as f64 * 8.0 + 48.0 + 4.0 * number + 5.0 * family
        } else {
            fields + family / 8.0
        };
        let bytes = points * per_point;
        let available = available_memory().unwrap_or(u64::MAX) as f64;
        if points >= f64::from(u32::MAX) || bytes > available {
            let fit = (available / per_point).min(f64::from(u32::MAX));
            let coarser = spacing * (points / fit).powf(1.0 / D as f64);
            let message = format!(
                "{points:.3e} points with {:.3e} bonds would take {:.3e} GiB; {:.1} GiB are free here",
                points * family,
                bytes / 1073741824.0,
                available / 1073741824.0,
            );
            let help = format!("about {fit:.2e} points fit: a spacing of {:.3e} m", coarser * 1.05);
            let diagnostic = self.source().error("geometry.spacing", message).help(help);
            return Err(Error::TooLarge(diagnostic.to_string()));
        }
        Ok(())
    }

    fn sets(&self, cloud: &mut Cloud<D>, shape: Option<&Shape<D>>) -> Result<()> {
        let all = cloud.select(|_| true);
        let mut found = BTreeMap::new();
        for (name, region) in &self.case.value.sets {
            let path = format!("sets.{name}");
            if cloud.sets.get(name).is_some() {
                return Err(self.refuse(&path, "the points' file has a set of this name too", "rename one of them"));
            }
            let inside = self.region(region, shape, &path)?;
            let slots = cloud.select(|x| inside(x));
            if slots.is_empty() {
                let (low, high) = cloud.bounds();
                let message = format!(
                    "no point is in this set; the points of the body span {} to {} m",
                    rounded(&low),
                    rounded(&high)
                );
                return Err(self.refuse(&path, message, "move or enlarge the region"));
            }
            found.insert(name.clone(), slots);
        }
        for (name, slots) in found {
            cloud.sets.insert(name, slots);
        }
        cloud.sets.insert("all", all);
        Ok(())
    }

    #[allow(clippy::type_complexity)] // a predicate over points
    fn region<'s>(
        &self,
        region: &Region,
        shape: Option<&'s Shape<D>>,
        path: &str,
    ) -> Result<Box<dyn Fn(&Vector<D>) -> bool + 's>> {
        Ok(match region {
            Region::Box { low, high } => {
                let (low, high) = (vector::<D>(low), vector::<D>(high));
                Box::new(move |x| (0..D).all(|d| x[d] >= low[d] && x[d] <= high[d]))
            }
            Region::Inside(shape) => {
                let shape = shape_of::<D>(shape);
                shape.validate().map_err(|e| self.refuse(&format!("{path}.inside"), e, ""))?;
                Box::new(move |x| shape.contains(x))
            }
            Region::Where(formula) => {
                let expression = self.expression(formula)?;
                Box::new(move |x| {
                    let x = crate::field::embed(x);
                    expression.evaluate(&[x[0], x[1], x[2], 0.0]) != 0.0
                })
            }
            Region::Layer { thickness } => {
                let Some(shape) = shape else {
                    return Err(self.refuse(path, "a layer needs the surface of `geometry.shape`", "use `where`"));
                };
                let thickness = *thickness;
                Box::new(move |x| shape.signed_distance(x) >= -thickness)
            }
            Region::All(regions) => {
                let all = regions.iter().map(|r| self.region(r, shape, path)).collect::<Result<Vec<_>>>()?;
                Box::new(move |x| all.iter().all(|inside| inside(x)))
            }
            Region::Any(regions) => {
                let any = regions.iter().map(|r| self.region(r, shape, path)).collect::<Result<Vec<_>>>()?;
                Box::new(move |x| any.iter().any(|inside| inside(x)))
            }
            Region::Not(region) => {
                let inside = self.region(region, shape, path)?;
                Box::new(move |x| !inside(x))
            }
        })
    }

    fn slots(&self, name: &str, cloud: &Cloud<D>, path: &str) -> Result<Arc<[u32]>> {
        cloud.sets.get(name).cloned().ok_or_else(|| {
            let names: Vec<&str> = cloud.sets.iter().map(|(n, _)| n).collect();
            let help = nearest(name, names.iter().copied()).map_or(String::new(), |n| format!("did you mean `{n}`?"));
            self.refuse(path, format!("no set has this name; sets: {}", names.join(", ")), &help)
        })
    }

    fn expression(&self, formula: &Formula) -> Result<Expression> {
        match formula {
            Formula::Number(x) => Ok(Expression::constant(*x)),
            Formula::Text(text) => Expression::compile(text, &VARIABLES, &self.case.constants)
                .map_err(|e| Error::Refused(format!("{text}: {e}"))),
        }
    }

    /// The formula on the points of a set, refused if it has no finite value at one of them at t = 0.
    fn profile(&self, formula: &Formula, cloud: &Cloud<D>, slots: &Arc<[u32]>, path: &str) -> Result<Profile> {
        let mut profile = Profile::new(self.expression(formula)?, cloud, slots);
        let values = profile.at(0.0);
        if values.iter().any(|v| !v.is_finite()) {
            // The first bad point in point order, which is not the order of slots.
            let bad = |slot: &u32| slots.binary_search(slot).ok().map(|k| values[k]).filter(|v| !v.is_finite());
            let first = cloud.slots.iter().enumerate().find_map(|(point, slot)| Some((point, *slot, bad(slot)?)));
            let (point, slot, value) = first.expect("a set holds slots of points");
            let position = rounded(&cloud.position(slot as usize));
            let message = format!("the formula is {value} at t = 0 at point {point}, position {position} m");
            let help = "keep it finite everywhere in the set, as in `sqrt(max(x, 0))` or `if(x > 0, 1/x, 0)`";
            return Err(self.refuse(path, message, help));
        }
        Ok(profile)
    }

    /// The motion of `conditions[k]`.
    fn prescribed(&self, k: usize, motion: &Motion, cloud: &Cloud<D>, slots: Arc<[u32]>) -> Result<Prescribed> {
        let condition = &self.case.value.conditions[k];
        let path = format!("conditions[{k}].prescribe.{}.value", motion_name(motion));
        let (quantity, component, value) = match motion {
            Motion::Displacement { component, value } => (Quantity::Displacement, *component, value),
            Motion::Velocity { component, value } => (Quantity::Velocity, *component, value),
        };
        Ok(Prescribed {
            name: format!("{}_{}", condition.on, ["x", "y", "z"][component]),
            profile: self.profile(value, cloud, &slots, &path)?,
            slots,
            component,
            quantity,
            until: condition.until.unwrap_or(f64::INFINITY),
            reaction: 0.0,
            last: Vec::new(),
            path: Vec::new(),
        })
    }

    /// The load of `conditions[k]`.
    fn load(
        &self,
        k: usize,
        load: &model::Load,
        cloud: &Cloud<D>,
        shape: Option<&Shape<D>>,
        slots: &Arc<[u32]>,
        loads: &mut Vec<Load>,
    ) -> Result<()> {
        let until = self.case.value.conditions[k].until.unwrap_or(f64::INFINITY);
        let kind = match load {
            model::Load::BodyForce { .. } => "body_force",
            model::Load::Traction { .. } => "traction",
            model::Load::Pressure { .. } => "pressure",
        };
        let path = format!("conditions[{k}].load.{kind}.value");
        let mut push = |component, value: &Formula, scale| -> Result<()> {
            let profile = self.profile(value, cloud, slots, &path)?;
            loads.push(Load { slots: slots.clone(), component, profile, scale, until, last: None });
            Ok(())
        };
        match load {
            model::Load::BodyForce { component, value } => push(*component, value, Scale::Same(1.0)),
            model::Load::Traction { component, value, thickness } => {
                push(*component, value, Scale::Same(1.0 / thickness.unwrap_or(cloud.spacing)))
            }
            model::Load::Pressure { value, thickness } => {
                let thickness = thickness.unwrap_or(cloud.spacing);
                let Some(shape) = shape else { return Ok(()) };
                let normals: Vec<Vector<D>> =
                    slots.iter().map(|&slot| shape.normal(&cloud.position(slot as usize))).collect();
                for d in 0..D {
                    let scale = Scale::ByPoint(normals.iter().map(|n| -n[d] / thickness).collect());
                    push(d, value, scale)?;
                }
                Ok(())
            }
        }
    }

    fn failure(
        &self,
        cloud: &Cloud<D>,
        hypothesis: Hypothesis,
        influence: &Influence,
        strength: f64,
        horizon: f64,
    ) -> Result<Option<CriticalStretch>> {
        let Some(model::Failure::CriticalStretch(failure)) = &self.case.value.physics.elasticity.failure else {
            return Ok(None);
        };
        let stretch = |energy: Option<f64>, stretch: Option<f64>| match energy {
            Some(energy) => moduli::critical_stretch(hypothesis, influence, strength, energy, horizon),
            None => stretch.unwrap_or(f64::INFINITY),
        };
        let rules: Vec<PairRule> = failure
            .pairs
            .iter()
            .map(|pair| PairRule {
                between: (pair.between[0].clone(), pair.between[1].clone()),
                stretch: stretch(pair.fracture_energy, pair.stretch),
            })
            .collect();
        let path = "physics.elasticity.failure.critical_stretch";
        CriticalStretch::new(cloud, stretch(failure.fracture_energy, failure.stretch), &rules, &failure.no_fail)
            .map(Some)
            .map_err(|e| self.refuse(path, format!("failure rules: {e}"), ""))
    }
}

fn motion_name(motion: &Motion) -> &'static str {
    match motion {
        Motion::Displacement { .. } => "displacement",
        Motion::Velocity { .. } => "velocity",
    }
}

/// A position as `(-0.0095, 0.0045)`, without the digits that rounding left behind.
fn rounded(x: &[f64]) -> String {
    let parts: Vec<String> =
        x.iter().map(|x| format!("{x:.6e}").parse::<f64>().map_or(String::new(), |x| x.to_string())).collect();
    format!("({})", parts.join(", "))
}

fn tip_window(facts: &Facts) -> f64 {
    20.0 * facts.horizon / facts.bar_speed
}

fn influence(influence: &InfluenceFunction) -> Influence {
    match *influence {
        InfluenceFunction::Constant => Influence::Constant,
        InfluenceFunction::Linear => Influence::Linear,
        InfluenceFunction::Inverted => Influence::Inverted,
        InfluenceFunction::Parabolic => Influence::Parabolic,
        InfluenceFunction::Gaussian { width } => Influence::Gaussian { width },
        InfluenceFunction::Cubic => Influence::Cubic,
        InfluenceFunction::Quintic => Influence::Quintic,
        InfluenceFunction::Septic => Influence::Septic,
    }
}

fn vector<const D: usize>(v: &[f64]) -> Vector<D> {
    std::array::from_fn(|d| v.get(d).copied().unwrap_or(0.0))
}

/// A shape of the case as geometry. `check` has made sure that it fits the dimension.
fn shape_of<const D: usize>(shape: &model::Shape) -> Shape<D> {
    let center = |c: &Option<Vec<f64>>| c.as_deref().map_or([0.0; D], vector::<D>);
    let sized = |size: &[f64], c: &Option<Vec<f64>>| {
        let (c, size) = (center(c), vector::<D>(size));
        Shape::Box {
            low: std::array::from_fn(|d| c[d] - 0.5 * size[d]),
            high: std::array::from_fn(|d| c[d] + 0.5 * size[d]),
        }
    };
    let axis = |axis: &Axis| match axis {
        Axis::X => 0,
        Axis::Y => 1,
        Axis::Z => 2,
    };
    let pairs = |vertices: &[Vec<f64>]| vertices.iter().map(|v| vector::<2>(v)).collect::<Vec<_>>();
    let shapes = |shapes: &[model::Shape]| shapes.iter().map(shape_of::<D>).collect::<Vec<_>>();
    match shape {
        model::Shape::Segment { low, high } => Shape::Box { low: [*low; D], high: [*high; D] },
        model::Shape::Rectangle { size, center } | model::Shape::Block { size, center } => sized(size, center),
        model::Shape::Box { low, high } => Shape::Box { low: vector(low), high: vector(high) },
        model::Shape::Disk { radius, center: c } | model::Shape::Sphere { radius, center: c } => {
            Shape::Ball { center: center(c), radius: *radius }
        }
        model::Shape::Ring { inner, outer, center: c } => {
            Shape::Ring { center: center(c), inner: *inner, outer: *outer }
        }
        model::Shape::Cylinder { radius, length, axis: a, center: c } => {
            Shape::Cylinder { center: center(c), axis: axis(a), radius: *radius, inner: 0.0, length: *length }
        }
        model::Shape::Tube { inner, outer, length, axis: a, center: c } => {
            Shape::Cylinder { center: center(c), axis: axis(a), radius: *outer, inner: *inner, length: *length }
        }
        model::Shape::Polygon { vertices } => Shape::Polygon { vertices: pairs(vertices) },
        model::Shape::Extrusion { vertices, low, high } => {
            Shape::Extrusion { vertices: pairs(vertices), low: *low, high: *high }
        }
        model::Shape::Union(members) => Shape::Union(shapes(members)),
        model::Shape::Intersection(members) => Shape::Intersection(shapes(members)),
        model::Shape::Difference { of, minus } => Shape::Difference(Box::new(shape_of(of)), shapes(minus)),
    }
}

fn schedule(every: Option<f64>, every_steps: Option<u64>, at: &[f64]) -> Schedule {
    match (every, every_steps, at) {
        (Some(period), ..) => Schedule::Every(period),
        (None, Some(n), _) => Schedule::Steps(n),
        (None, None, []) => Schedule::Ends,
        (None, None, at) => Schedule::At(at.to_vec()),
    }
}

fn style(picture: &model::Picture, title: &str) -> Picture {
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

fn name(field: FieldName) -> &'static str {
    match field {
        FieldName::Displacement => "displacement",
        FieldName::Velocity => "velocity",
        FieldName::Force => "force",
        FieldName::Damage => "damage",
        FieldName::StrainEnergy => "strain_energy",
    }
}

fn names(fields: &[FieldName], default: &[FieldName]) -> Vec<&'static str> {
    let fields = if fields.is_empty() { default } else { fields };
    fields.iter().map(|&f| name(f)).collect()
}

/// Bytes that the system can still give, if it tells.
pub fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find(|l| l.starts_with("MemAvailable:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

/// Reads and builds a case file, or the `case.toml` of a folder.
pub fn load(path: &Path, overrides: &[(String, String)], options: &Options) -> Result<Simulation> {
    let file = if path.is_dir() { path.join("case.toml") } else { path.to_path_buf() };
    let mut case = super::read_file::<Case>(&file, overrides, check);
    if let (Err(mistakes), Some(name)) = (&mut case, path.to_str())
        && !path.exists()
        && bundled::CASES.iter().any(|case| case.name == name)
    {
        mistakes.list[0].help = Some(format!("`bondwise new {name}` makes this case here"));
    }
    let case = case.map_err(Error::Case)?;
    let base = file.parent().map(Path::to_path_buf).unwrap_or_default();
    build(&case, &Options { base, ..options.clone() })
}
