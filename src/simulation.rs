//! The event loop: step, look, write, until the end. The first file to read.

use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::conditions::prescribed::Prescribed;
use crate::error::{Error, Result};
use crate::execution::Packs;
use crate::family::{BondLaw, BondStates};
use crate::field::{Double, Field, Precision, embed};
use crate::geometry::Arrangement;
use crate::output::history::History;
use crate::output::report::{Energy, Report, Tip, WallSeconds, peak_memory};
use crate::output::source::{Facts, Sizes, Source, Writer};
use crate::problem::{Balance, Problem};
use crate::solver::{Clock, VelocityVerlet};

/// A model that can be stepped and looked at: a [`Problem`] whose dimension and law are no longer types.
pub trait Stepper: Source + Send {
    fn start(&mut self);
    fn step(&mut self, solver: &VelocityVerlet, clock: &mut Clock) -> Result<()>;
}

/// A case that is ready to run.
pub struct Simulation {
    pub title: String,
    pub model: Box<dyn Stepper>,
    pub solver: VelocityVerlet,
    pub clock: Clock,
    pub n_steps: u64,
    pub history: History,
    pub writers: Vec<Box<dyn Writer>>,
    pub folder: PathBuf,
    /// Threads of the pool that the run takes place in.
    pub threads: usize,
    pub setup_seconds: f64,
}

/// Where a run stands: what a progress line shows.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    pub step: u64,
    pub n_steps: u64,
    /// s
    pub time: f64,
    pub imbalance: f64,
    pub broken_bonds: u64,
    pub seconds: f64,
}

/// What an observer of a run asks for after each step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wish {
    Continue,
    /// Finish this step, write the last frame, history and report, and stop.
    Stop,
}

impl Simulation {
    /// Runs to the end, or until `observe` wishes to stop, or until the numbers do. Whatever ends it, the last frame,
    /// the history and the report are written; a stop on numbers is then returned as the error it is.
    pub fn run(&mut self, mut observe: impl FnMut(&Progress) -> Wish) -> Result<Report> {
        let begin = Instant::now();
        let mut output_seconds = 0.0;
        self.model.start();
        self.write(false, &mut output_seconds)?;
        let mut stop = None;
        let mut interrupted = false;
        while self.clock.step < self.n_steps {
            if let Err(error) = self.model.step(&self.solver, &mut self.clock) {
                stop = Some(error);
                break;
            }
            self.write(false, &mut output_seconds)?;
            if observe(&self.progress(begin)) == Wish::Stop {
                interrupted = self.clock.step < self.n_steps;
                break;
            }
        }
        self.write(true, &mut output_seconds)?;
        let status = match (&stop, interrupted) {
            (Some(_), _) => "stopped",
            (None, true) => "interrupted",
            (None, false) => "done",
        };
        let stepping = begin.elapsed().as_secs_f64() - output_seconds;
        let wall = WallSeconds { setup: self.setup_seconds, stepping, output: output_seconds };
        let report = self.report(status, wall);
        report.write(&self.folder.join("report.json"))?;
        match stop {
            Some(error) => Err(error),
            None => Ok(report),
        }
    }

    fn write(&mut self, last: bool, seconds: &mut f64) -> Result<()> {
        let begin = Instant::now();
        let model: &mut dyn Source = &mut *self.model;
        self.history.write(model, &self.clock, last)?;
        for writer in &mut self.writers {
            writer.write(model, &self.clock, last)?;
        }
        *seconds += begin.elapsed().as_secs_f64();
        Ok(())
    }

    fn progress(&self, begin: Instant) -> Progress {
        Progress {
            step: self.clock.step,
            n_steps: self.n_steps,
            time: self.clock.time(),
            imbalance: self.history.imbalance(),
            broken_bonds: self.model.broken_pairs(),
            seconds: begin.elapsed().as_secs_f64(),
        }
    }

    fn report(&mut self, status: &str, wall: WallSeconds) -> Report {
        let facts = self.model.facts().clone();
        let b = self.history.balance;
        let damage = self.model.field("damage").map_or(Vec::new(), |f| crate::output::source::scalar(f, None));
        let bonds = facts.bonds - facts.cut_bonds;
        Report {
            title: self.title.clone(),
            version: env!("CARGO_PKG_VERSION").into(),
            status: status.into(),
            dimension: facts.dimension,
            points: facts.points,
            bonds,
            cut_bonds: facts.cut_bonds,
            horizon: facts.horizon,
            spacing: facts.spacing,
            micromodulus: facts.micromodulus,
            critical_stretch: facts.critical_stretch,
            steps: self.clock.step,
            time_step: self.clock.dt,
            stable_time_step: facts.stable_step,
            end_time: self.clock.time(),
            threads: self.threads,
            wall_seconds: wall,
            bond_updates_per_second: bonds as f64 * self.clock.step as f64 / wall.stepping.max(1e-9),
            peak_memory_bytes: peak_memory(),
            energy: Energy {
                kinetic: b.kinetic,
                strain: b.strain,
                fracture: b.fracture,
                external: b.external,
                damped: b.damped,
                initial: b.initial,
            },
            energy_imbalance: self.history.imbalance(),
            momentum_error: self.history.momentum_error(),
            broken_bonds: self.model.broken_pairs(),
            damaged_points: damage.iter().filter(|&&d| d > 0.35).count(),
            crack_tip: self.history.tip.as_ref().map(|tip| Tip {
                position: tip.position.map(|x| x[..facts.dimension].to_vec()),
                largest_speed: tip.largest_speed,
                rayleigh_speed: facts.rayleigh_speed,
            }),
            state_hash: self.model.hash(),
        }
    }
}

/// Makes an output folder, refusing one that holds anything unless `overwrite`, which removes what a run writes.
pub fn prepare_folder(folder: &Path, overwrite: bool) -> Result<()> {
    if let Ok(mut entries) = std::fs::read_dir(folder)
        && entries.next().is_some()
    {
        if !overwrite {
            return Err(Error::Refused(format!(
                "{}: the output folder is not empty; nothing was overwritten\n    help: name another with --out, or \
                 pass --overwrite",
                folder.display()
            )));
        }
        for name in ["frames", "pictures"] {
            let old = folder.join(name);
            if old.is_dir() {
                std::fs::remove_dir_all(&old).map_err(|e| Error::io(&old, e))?;
            }
        }
    }
    if folder.exists() && !folder.is_dir() {
        return Err(Error::Refused(format!(
            "{}: is a file, where a folder for the results is wanted\n    help: name another with --out",
            folder.display()
        )));
    }
    std::fs::create_dir_all(folder)
        .map_err(|e| Error::Refused(format!("{}: the folder for the results cannot be made: {e}", folder.display())))
}

/// A problem together with what its writers ask for again and again.
pub struct Model<const D: usize, L, P: Precision = Double> {
    pub problem: Problem<D, L, P>,
    facts: Facts,
    positions: Vec<[f64; 3]>,
    sizes: Vec<f64>,
}

impl<const D: usize, L: BondLaw<D>, P: Packs> Model<D, L, P> {
    /// `facts` as far as the case knows them; counts and sizes are filled in from the problem.
    pub fn new(problem: Problem<D, L, P>, facts: Facts) -> Self {
        let cloud = &problem.body.cloud;
        let positions: Vec<[f64; 3]> = cloud.slots.iter().map(|&s| embed(&cloud.position(s as usize))).collect();
        let sizes = match &cloud.arrangement {
            Arrangement::Lattice(_) => Vec::new(),
            Arrangement::Scattered { volumes, .. } => {
                cloud.slots.iter().map(|&s| volumes[s as usize].powf(1.0 / D as f64)).collect()
            }
        };
        let state_bytes = match &problem.state.states {
            BondStates::Lattice(words) => 2 * words.len(),
            BondStates::Cloud(bytes) => (2 + 4 * crate::family::GROUP) * bytes.len(),
        };
        let fields = (3 * D + 1) * 8 * cloud.n_slots() + 28 * cloud.n_points();
        let memory = (state_bytes + fields + problem.physics.operator.memory()) as u64;
        let facts = Facts {
            dimension: D,
            points: cloud.n_points(),
            bonds: problem.n_bonds,
            cut_bonds: problem.n_cut,
            horizon: problem.body.horizon,
            spacing: cloud.spacing,
            memory,
            ..facts
        };
        Model { problem, facts, positions, sizes }
    }
}

impl<const D: usize, L: BondLaw<D>, P: Packs> Source for Model<D, L, P> {
    fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }
    fn sizes(&self) -> Sizes<'_> {
        if self.sizes.is_empty() { Sizes::Same(self.facts.spacing) } else { Sizes::Each(&self.sizes) }
    }
    fn facts(&self) -> &Facts {
        &self.facts
    }
    fn field(&mut self, name: &str) -> Option<Field> {
        self.problem.field(name)
    }
    fn balance(&mut self) -> Balance {
        self.problem.balance()
    }
    fn broken_pairs(&self) -> u64 {
        self.problem.broken_pairs()
    }
    fn reactions(&self) -> Vec<(String, f64)> {
        self.problem.prescribed.iter().map(|p: &Prescribed| (p.name.clone(), p.reaction)).collect()
    }
    fn hash(&self) -> String {
        self.problem.hash()
    }
    fn family_sizes(&self) -> Vec<u32> {
        self.problem.state.states.per_point(&self.problem.body)
    }
}

impl<const D: usize, L: BondLaw<D>, P: Packs> Stepper for Model<D, L, P> {
    fn start(&mut self) {
        self.problem.start();
    }
    fn step(&mut self, solver: &VelocityVerlet, clock: &mut Clock) -> Result<()> {
        self.problem.step(solver, clock)
    }
}
