//! From a checked case to a simulation: the only place where dimension and law become types.

mod cloud;
mod conditions;
mod diffusion;
mod filling;
mod geometry;
mod hybrid;
mod images;
mod materials;
mod outputs;
mod overlaps;
mod remarks;
mod steps;
mod surfaces;
#[cfg(test)]
mod ties;

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use super::bundled;
use super::check::check;
use super::diagnostics::{Diagnostic, Severity};
use super::model::{self, Case, Motion, Output, Plane, Precision, Scheme, SurfaceCorrection};
use super::read::{Located, Source};
use crate::conditions::initial;
use crate::discretization::{BondWeighting, Correction, Influence, Operator, PartialVolume, standard};
use crate::error::{Error, Result};
use crate::execution::{Exec, Packs};
use crate::family::{Body, Update};
use crate::field::{Double, Mixed, Single, components_mut};
use crate::geometry::{Arrangement, Shape};
use crate::output::crack_tip::CrackTip;
use crate::output::frames::Frames;
use crate::output::history::History;
use crate::output::pictures::Pictures;
use crate::output::probe::Probe;
use crate::output::schedule::Schedule;
use crate::output::source::{BodySummary, ElasticSummary, LoadSummary, PhysicsSummary};
use crate::output::writer::Output as Written;
use crate::physics::Physics;
use crate::physics::elasticity::laws::Law;
use crate::physics::elasticity::linear_solid::Moduli;
use crate::physics::elasticity::moduli::{self, Hypothesis};
use crate::physics::elasticity::surface::{correction_by_energy, correction_by_volume, surface_effect};
use crate::physics::elasticity::{Density, Elasticity, On};
use crate::physics::failure::CriticalStretch;
use crate::problem::Problem;
use crate::simulation::{Model, Simulation, Stepper};
use crate::solver::Clock;
pub use geometry::available_memory;
use materials::Values;
use outputs::{force_on_set, force_through_cut, names, schedule, style, tip_window};
use steps::StableStep;

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
        1 => Builder::<1> { case, options, loads: RefCell::default() }.simulation(),
        2 => Builder::<2> { case, options, loads: RefCell::default() }.simulation(),
        _ => Builder::<3> { case, options, loads: RefCell::default() }.simulation(),
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
    /// What loads add up to, as they are built.
    loads: RefCell<Vec<LoadSummary>>,
}

impl<const D: usize> Builder<'_, D> {
    fn simulation(&self) -> Result<Simulation> {
        if let Some(diffusion) = &self.case.value.physics.diffusion {
            return self.diffusing(diffusion);
        }
        match self.case.value.discretization.precision {
            Precision::Double => self.in_precision::<Double>(),
            Precision::Single => self.in_precision::<Single>(),
            Precision::Mixed => self.in_precision::<Mixed>(),
        }
    }

    fn law(&self) -> Law {
        self.case.value.physics.elastic().law.of()
    }

    fn source(&self) -> &Source {
        &self.case.source
    }

    fn refuse(&self, path: &str, message: impl Into<String>, help: &str) -> Error {
        let diagnostic = self.source().error(path, message);
        refuse(self.case, vec![if help.is_empty() { diagnostic } else { diagnostic.help(help) }])
    }

    fn in_precision<P: Packs>(&self) -> Result<Simulation> {
        let parameters = &self.case.value.physics.elastic().law.parameters();
        let case = &self.case.value;
        let shape = self.shape()?;
        let cracks = self.cracks()?;
        let rule = PartialVolume::from(case.discretization.partial_volumes);
        let influence = Influence::from(case.discretization.influence);
        let mut cloud = self.cloud(shape.as_ref(), rule)?;
        let horizon = self.horizon(&cloud)?;
        let hypothesis = match (D, parameters.plane) {
            (1, _) => Hypothesis::Bar,
            (2, Some(Plane::Strain)) => Hypothesis::PlaneStrain,
            (2, _) => Hypothesis::PlaneStress,
            _ => Hypothesis::Solid,
        };
        // What the weights are made for; where materials differ, the first of them.
        let reference = self.reference(&cloud)?;
        let moduli_of = |values: &Values| Moduli::new(hypothesis, values.young, values.poisson);
        let moduli = moduli_of(&reference);
        let solid = self.law().is_state_based().then_some(moduli);
        let strength_of = |values: &Values| match &solid {
            Some(_) => moduli_of(values).strength(&influence, horizon),
            None => moduli::micromodulus(hypothesis, &influence, values.young, horizon),
        };
        let strength = strength_of(&reference);
        let tolerance = 1e-9 * cloud.spacing;
        let scaling = BondWeighting { strength, horizon, influence, rule };
        let adaptation = match &case.refinement {
            Some(refinement) => Some(self.adaptation(refinement, &cloud, shape.as_ref(), scaling, &cracks)?),
            None => None,
        };
        // What the step would have to be if all cells were as fine as they may become: it goes with the spacing.
        let mut finest_step = f64::INFINITY;
        if let Some(adaptation) = &adaptation {
            let lattice = standard::body(std::mem::replace(&mut cloud, adaptation.cells.cloud()), horizon, rule);
            if adaptation.criteria.is_some() {
                let operator = Operator::standard(&lattice, strength, influence, rule);
                let mut on = On { body: &lattice, operator: &operator, failure: None, exec: &mut Exec::default() };
                let step = self.law().bonds::<D, P>().stable_step(&mut on, &Density::same(reference.density));
                finest_step = step / f64::from(1u32 << adaptation.cells.levels);
            }
        }
        let mut correction = None;
        if adaptation.is_none() && case.discretization.surface_correction != SurfaceCorrection::None {
            let body = standard::body(cloud, horizon, rule);
            let operator = Operator::standard(&body, strength, influence, rule);
            correction = self.correction::<P>(&body, &operator, &scaling);
            cloud = body.cloud;
            // Every bond has a weight of its own now, as on a cloud.
            if let Arrangement::Lattice(_) = cloud.arrangement {
                let scattered = cloud.scatter();
                correction = correction.map(|correction| correction.moved(&cloud, &scattered));
                cloud = scattered;
            }
        }
        cloud = self.with_images(cloud, shape.as_ref(), rule, horizon)?;
        self.sets(&mut cloud, shape.as_ref())?;
        let critical = |values: &Values, energy: f64| match &solid {
            Some(_) => moduli_of(values).critical_stretch(&influence, energy, horizon),
            None => moduli::critical_stretch(hypothesis, &influence, strength_of(values), energy, horizon),
        };
        let composition = self.composition(&mut cloud, &critical)?;
        let mut failure = match &composition {
            None => self.failure(&cloud, &|energy| critical(&reference, energy))?,
            Some(composition) => self.failure_by_material(&cloud, composition, &critical)?,
        };
        let (body, mut operator) = match &adaptation {
            None => {
                let body = standard::body(cloud, horizon, rule);
                let operator = match &correction {
                    None => Operator::standard(&body, strength, influence, rule),
                    correction => scaling.operator(&body, &Update::default(), None, correction.as_ref()),
                };
                (body, operator)
            }
            Some(adaptation) => {
                let grading = adaptation.grading();
                failure = failure.map(|failure| failure.scaled(&grading.horizons, horizon));
                let body = scaling.body(cloud, grading);
                let seen = adaptation.seen(&body, &adaptation.floor);
                if seen > 0 {
                    let message = format!(
                        "{seen} points see, with horizons larger than asked for there, places where finer cells are \
                         wanted: the solution there is not that of the finer horizon"
                    );
                    let help = "a `buffer` of one horizon or more keeps them away";
                    log::warn!("{}", self.source().warning("refinement.buffer", message).help(help));
                }
                let operator = scaling.operator(&body, &Update::default(), None, None);
                let operator = match self.correction::<P>(&body, &operator, &scaling) {
                    None => operator,
                    correction => scaling.operator(&body, &Update::default(), None, correction.as_ref()),
                };
                (body, operator)
            }
        };
        let settings = match &case.discretization.scheme {
            Scheme::Hybrid(settings) => Some(settings),
            Scheme::Standard | Scheme::Collocation(_) => None,
        };
        if settings.is_some_and(|settings| settings.rescale) {
            hybrid::rescale(&body, &mut operator, &scaling);
        }
        let mut material = self.law().material::<D, P>(&[moduli], &body, &operator.weights);
        // How incomplete families are says nothing of what they are made of.
        let mut on = On { body: &body, operator: &operator, failure: None, exec: &mut Exec::default() };
        let surface = surface_effect(&*material, &mut on, &scaling);
        let mut density = Density::same(reference.density);
        if let Some(composition) = &composition {
            density = Density::by_slot(&composition.density);
            if solid.is_none() {
                operator.weights.heterogeneity = self.heterogeneity(&body, composition, &reference);
            } else {
                let of = |slot: usize| {
                    let young = composition.young[slot];
                    if young > 0.0 { Moduli::new(hypothesis, young, composition.poisson(slot)) } else { moduli }
                };
                let by_slot: Vec<Moduli> = (0..body.cloud.n_slots()).map(of).collect();
                if by_slot.iter().any(|other| *other != moduli) {
                    material = self.law().material::<D, P>(&by_slot, &body, &operator.weights);
                }
            }
        }
        let mut elasticity = Elasticity::new(body, operator, material, reference.density, failure);
        elasticity.density = density;
        if hypothesis == Hypothesis::PlaneStrain {
            let typical = composition.as_ref().map_or(std::slice::from_ref(&reference), |found| &found.typical[..]);
            let ratio = |values: &Values| solid.map(|_| values.poisson).or(hypothesis.poisson()).unwrap_or(0.0);
            elasticity.out_of_plane = typical.iter().map(ratio).collect();
        }
        if let Some(composition) = &composition {
            elasticity.materials.clone_from(&composition.material);
        }
        self.neighbours(&elasticity.body)?;
        let cut = elasticity.cut(&cracks, tolerance);
        self.remark_size(&elasticity.body);
        self.remark_cracks(&elasticity.body, &cracks, cut, tolerance);
        self.remark_parts(&elasticity.body, &elasticity.state.states);
        let (mut constraints, mut terms) = (Vec::new(), self.mirror_forces(&elasticity.body.cloud));
        let owned = self.owned(&elasticity.body.cloud)?;
        for (k, condition) in case.conditions.iter().enumerate() {
            let Elasticity { body, state, .. } = &mut elasticity;
            if let Some(load) = condition.load.as_ref().filter(|load| load.is_placed()) {
                self.load(k, load, &body.cloud, shape.as_ref(), &Arc::default(), &mut terms)?;
                continue;
            }
            let Some(on) = &condition.on else { continue };
            let slots = match owned.get(&k) {
                Some(owned) => owned.clone(),
                None => self.slots(on, &body.cloud, &format!("conditions[{k}].on"))?,
            };
            if let Some(motion) = &condition.initial {
                let (flat, component, value) = match motion {
                    Motion::Displacement { component, value } => (&mut state.displacement, *component, value),
                    Motion::Velocity { component, value } => (&mut state.velocity, *component, value),
                    // Refused of elastic bodies.
                    Motion::Concentration { .. } => continue,
                };
                let path = format!("conditions[{k}].initial.{}.value", motion.name());
                let mut profile = self.profile(value, &body.cloud, &slots, &path)?;
                initial::apply(components_mut::<D, _>(flat)[component], &slots, &mut profile);
            }
            if let Some(motion) = &condition.prescribe {
                constraints.push(self.prescribed(k, motion, &body.cloud, slots.clone())?);
            }
            if let Some(load) = &condition.load {
                self.load(k, load, &body.cloud, shape.as_ref(), &slots, &mut terms)?;
            }
        }
        self.parts_of_outputs(&elasticity.body.cloud)?;
        let materials = self.summaries(&mut elasticity, composition.as_ref(), &reference, hypothesis);
        // A crack is no faster than in the fastest material, and the slowest needs the longest τ.
        let speeds = || materials.iter().map(|material| material.bar_speed);
        let (bar_speed, slowest) = (speeds().fold(0.0, f64::max), speeds().fold(f64::INFINITY, f64::min));
        if let Some(settings) = settings {
            elasticity = self.hybridise(settings, elasticity, solid, &scaling, horizon / slowest)?;
            self.remark_hybrid(elasticity.hybrid().map_or(0.0, |work| work.standard[1]));
        }
        let stable_step = elasticity.stable_step().min(finest_step);
        let smallest = elasticity.failure.as_ref().map(CriticalStretch::smallest).filter(|s| s.is_finite());
        let cloud = &elasticity.body.cloud;
        let mass = cloud.slots.iter().map(|&slot| elasticity.density.at(slot as usize) * cloud.volume(slot as usize));
        let facts = BodySummary {
            dimension: D,
            points: 0,
            bonds: 0,
            cut_bonds: 0,
            horizon,
            spacing: 0.0,
            volume: 0.0,
            shape_volume: shape.as_ref().map(Shape::volume),
            mass: Some(mass.sum()),
            stable_step,
            physics: PhysicsSummary::Elastic(ElasticSummary {
                bar_speed,
                rayleigh_speed: materials.iter().filter_map(|m| m.rayleigh_speed).reduce(f64::max),
                micromodulus: strength,
                materials: if composition.is_some() { materials } else { Vec::new() },
                critical_stretch: smallest,
                surface,
            }),
            memory: 0,
        };
        if let Some(adaptation) = adaptation {
            elasticity.adapting(adaptation);
        }
        let mut problem = Problem::new(Box::new(elasticity), constraints, terms);
        problem.is_static = self.case.value.solver.stages().next().is_some_and(|(_, first)| !moves(first));
        self.finish(Box::new(Model::new(problem, facts)))
    }

    /// What corrects the surfaces of this body, if asked.
    fn correction<P: Packs>(
        &self,
        body: &Body<D>,
        operator: &Operator,
        scaling: &BondWeighting,
    ) -> Option<Correction<D>> {
        let mut on = On { body, operator, failure: None, exec: &mut Exec::default() };
        match self.case.value.discretization.surface_correction {
            SurfaceCorrection::None => None,
            SurfaceCorrection::Volume => Some(correction_by_volume(&mut on, scaling)),
            SurfaceCorrection::Energy => Some(correction_by_energy(&*self.law().bonds::<D, P>(), &mut on, scaling)),
        }
    }

    /// Time step, outputs, and the simulation that holds them.
    fn finish(&self, mut model: Box<dyn Stepper>) -> Result<Simulation> {
        let case = &self.case.value;
        let estimate = model.facts().stable_step;
        let mut stages = self.stages(StableStep { estimate, prove: &mut || model.prove_step() })?;
        let facts = model.facts().clone();
        let first = stages.pop_front().expect("a case has a solver");
        let last = stages.back().unwrap_or(&first);
        let n_steps = last.first + last.n_steps;
        let dt = last.ends / n_steps as f64;
        let folder = &self.options.folder;
        let mut outputs = Vec::new();
        let mut every = HISTORY_EVERY;
        let mut tip = self.default_tip(&facts);
        for (k, output) in case.output.iter().enumerate() {
            match output {
                Output::Vtu(vtu) => {
                    let schedule = schedule(vtu.every, vtu.every_steps, &[]);
                    self.files(&schedule, n_steps, dt, &format!("output[{k}].vtu"))?;
                    let fields = names(&vtu.fields, facts.physics.fields_of_frames());
                    outputs.push(Written { schedule, writer: Box::new(Frames::new(folder, fields)) });
                }
                Output::Picture(picture) => {
                    // One that does not say when is drawn at the end only.
                    let schedule = match schedule(picture.every, picture.every_steps, &picture.at) {
                        Schedule::LoadEnds => Schedule::End,
                        other => other,
                    };
                    self.files(&schedule, n_steps, dt, &format!("output[{k}].picture"))?;
                    let pictures = Pictures {
                        folder: folder.clone(),
                        field: picture.field.name(),
                        component: picture.component,
                        deform: picture.deform,
                        above: picture.above,
                        style: style(picture, &case.case.title),
                    };
                    outputs.push(Written { schedule, writer: Box::new(pictures) });
                }
                Output::History(history) => every = history.every_steps,
                Output::Probe(probe) => {
                    let fields = names(&probe.fields, facts.physics.fields_of_probes());
                    let path = folder.join(format!("probe_{}.csv", probe.name));
                    let mut at = [0.0; 3];
                    at[..D].copy_from_slice(&probe.at);
                    let schedule = Schedule::Steps(probe.every_steps);
                    outputs.push(Written { schedule, writer: Box::new(Probe::new(path, at, fields)) });
                }
                Output::Force(force) => outputs.push(force_on_set(force, folder)),
                Output::Cut(cut) => outputs.push(force_through_cut(cut, folder)),
                Output::CrackTip(t) => {
                    let mut along = [0.0; 3];
                    along[..D].copy_from_slice(&t.along);
                    tip = tip_window(&facts).map(|window| CrackTip::new(along, t.threshold, window));
                }
            }
        }
        // Last, since it takes a while: nothing is wrong with the case.
        self.remark_steps(&mut *model, &std::iter::once(&first).chain(&stages).collect::<Vec<_>>());
        let mut clock = Clock::new(first.dt);
        clock.run_to(first.n_steps, first.ends);
        Ok(Simulation {
            title: case.case.title.clone(),
            model,
            solver: first.solver,
            clock,
            longest_step: first.dt,
            n_steps,
            stages_to_come: stages,
            history: History::new(folder.join("history.csv"), every, tip),
            outputs,
            folder: folder.clone(),
            threads: rayon::current_num_threads(),
            setup_seconds: 0.0,
            loads: self.loads.take(),
        })
    }
}

fn moves(solver: &model::Solver) -> bool {
    matches!(solver, model::Solver::VelocityVerlet(_) | model::Solver::RungeKutta(_))
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
