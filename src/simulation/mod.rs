//! The event loop: step, look, write, until the end. The first file to read.

mod imbalance;
mod model;

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

pub use model::Model;

use crate::error::{Error, Result};
use crate::output::history::History;
use crate::output::report::{
    Diffusion, Energy, Hybrid, Probed, Refinement, Report, StretchRatio, Tip, WallSeconds, peak_memory,
};
use crate::output::snapshot::FieldCache;
use crate::output::source::{LoadSummary, Points, Source};
use crate::output::writer::{Output, ScheduledRequest};
use crate::output::writer_thread::{Batch, WriterThread};
use crate::solver::statics::LoadStep;
use crate::solver::{Clock, Solver};
use crate::visit::Visitor;

/// A model that can be stepped and looked at: a [`Model`], or what stands for one.
pub trait Stepper: Source + Send {
    fn start(&mut self);
    /// Takes a step. Within a load step of a static solver, `observe` is told iterations and relative imbalance, and
    /// interrupts it by answering false; the state is then the last one at rest, and this gives false.
    fn step_observed(
        &mut self,
        solver: &Solver,
        clock: &mut Clock,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<bool>;
    /// Hands the body over to another solver at time `t`, s.
    fn hand_over(&mut self, solver: &Solver, t: f64);
    /// Ends a run, or a solver's part of it: whether the numbers of the last step are sound.
    fn conclude(&mut self, _solver: &Solver, _clock: &Clock) -> Result<()> {
        Ok(())
    }
    /// The largest step that is proven stable, s, of velocity Verlet or forward Euler; it is then that of the facts too. None
    /// where none is.
    fn prove_step(&mut self) -> Option<f64> {
        None
    }
    /// Names of two prescribed sets that share a point and a component, if there are any.
    fn contested(&self) -> Option<[String; 2]> {
        None
    }
    /// How long it takes to sum a rate, s, by trying it before the start; None where nobody can tell.
    fn seconds_per_rate(&mut self) -> Option<f64> {
        None
    }
    /// Shows everything that changes in a run but the clock.
    fn visit(&mut self, visitor: &mut dyn Visitor);
    /// What the load steps of static solvers took.
    fn load_steps(&self) -> &[LoadStep];
    /// Takes a step that nobody observes.
    fn step(&mut self, solver: &Solver, clock: &mut Clock) -> Result<()> {
        self.step_observed(solver, clock, &mut |_, _| true).map(|_| ())
    }
}

/// A solver of a chain, and steps of one length that it takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverStage {
    pub solver: Solver,
    /// s
    pub dt: f64,
    pub n_steps: u64,
    /// Steps before it.
    pub first: u64,
    /// Time at its end, s.
    pub ends: f64,
    /// Whether the same solver took the steps before it.
    pub continues: bool,
}

/// A case that is ready to run.
pub struct Simulation {
    pub title: String,
    pub model: Box<dyn Stepper>,
    /// The one at work.
    pub solver: Solver,
    pub clock: Clock,
    /// The longest step that the solver at work has taken so far, s: others are shorter to end on an instant.
    pub longest_step: f64,
    /// Of all solvers.
    pub n_steps: u64,
    /// The solvers that follow.
    pub stages_to_come: VecDeque<SolverStage>,
    pub history: History,
    /// Until the run starts, which hands their writers to the writer thread.
    pub outputs: Vec<Output>,
    pub folder: PathBuf,
    /// Threads of the pool that the run takes place in.
    pub threads: usize,
    pub setup_seconds: f64,
    /// What each load adds up to.
    pub loads: Vec<LoadSummary>,
}

/// Where a run stands: what a progress line shows.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    pub step: u64,
    pub n_steps: u64,
    /// s
    pub time: f64,
    pub imbalance: f64,
    /// None where nothing can break.
    pub broken_bonds: Option<u64>,
    /// The largest stretch over critical stretch of a whole bond, at the last row of the history; None where none can break.
    pub stretch_ratio: Option<f64>,
    pub seconds: f64,
    /// Iterations within a load step, and how far forces are out of balance there.
    pub within: Option<(usize, f64)>,
}

/// What an observer of a run asks for after each step, and each iteration of a static solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    Continue,
    /// Finish this step, or leave this load step at the last state at rest, write the last frame, history and report, and
    /// stop.
    Stop,
}

impl Simulation {
    /// Runs to the end, or until `observe` wishes to stop, or until the numbers do. Whatever ends it, the last frame,
    /// the history and the report are written; a stop on numbers is then returned as the error it is.
    pub fn run(&mut self, mut observe: impl FnMut(&Progress) -> Control) -> Result<Report> {
        let begin = Instant::now();
        self.model.start();
        let mut desk = self.desk()?;
        self.write(&mut desk, false)?;
        let mut stop = None;
        let mut interrupted = false;
        while self.clock.step < self.n_steps {
            let before = self.progress(begin);
            let stepped = self.step(&mut |iterations, imbalance| {
                let (seconds, within) = (begin.elapsed().as_secs_f64(), Some((iterations, imbalance)));
                observe(&Progress { seconds, within, ..before }) == Control::Continue
            });
            match stepped {
                Ok(true) => {}
                Ok(false) => {
                    interrupted = true;
                    break;
                }
                Err(error) => {
                    stop = Some(error);
                    break;
                }
            }
            self.write(&mut desk, false)?;
            if observe(&self.progress(begin)) == Control::Stop {
                interrupted = self.clock.step < self.n_steps;
                break;
            }
        }
        if stop.is_none() {
            stop = self.model.conclude(&self.solver, &self.clock).err();
        }
        self.write(&mut desk, true)?;
        let status = match (&stop, interrupted) {
            (Some(_), _) => "stopped",
            (None, true) => "interrupted",
            (None, false) => "done",
        };
        let dimension = self.model.facts().dimension;
        let probed = desk.orders.iter().filter_map(|order| order.wants.found()).map(|(at, point)| Probed {
            at: at[..dimension].to_vec(),
            point,
            position: self.model.positions()[point][..dimension].to_vec(),
        });
        let probes = probed.collect();
        let (output, writing) = desk.close()?;
        let stepping = begin.elapsed().as_secs_f64() - output;
        let wall = WallSeconds { setup: self.setup_seconds, stepping, output, writing };
        let report = Report { probes, ..self.report(status, wall) };
        report.write(&self.folder.join("report.json"))?;
        match stop {
            Some(error) => Err(error),
            None => Ok(report),
        }
    }

    /// Takes the next step, by the next solver where it is its turn. `observe`: see [`Stepper::step_observed`].
    pub fn step(&mut self, observe: &mut dyn FnMut(usize, f64) -> bool) -> Result<bool> {
        if let Some(leg) = self.stages_to_come.front().copied().filter(|leg| leg.first == self.clock.step) {
            if !leg.continues {
                self.model.conclude(&self.solver, &self.clock)?;
            }
            self.stages_to_come.pop_front();
            self.clock.change_step(leg.dt);
            self.clock.run_to(leg.first + leg.n_steps, leg.ends);
            if leg.continues {
                self.longest_step = self.longest_step.max(leg.dt);
            } else {
                (self.solver, self.longest_step) = (leg.solver, leg.dt);
                self.model.hand_over(&self.solver, self.clock.time());
            }
        }
        self.model.step_observed(&self.solver, &mut self.clock, observe)
    }

    /// Starts the writer thread.
    fn desk(&mut self) -> Result<OutputQueue> {
        let begin = Instant::now();
        let outputs = std::mem::take(&mut self.outputs).into_iter().map(Output::split);
        let (orders, writers): (Vec<_>, Vec<_>) = outputs.unzip();
        let history = self.history.table(&mut *self.model);
        let thread = WriterThread::start(history, writers, self.threads, &self.folder)?;
        Ok(OutputQueue { orders, points: None, thread, seconds: begin.elapsed().as_secs_f64() })
    }

    /// Takes what is due of this instant and hands it to the writer thread.
    fn write(&mut self, desk: &mut OutputQueue, last: bool) -> Result<()> {
        let begin = Instant::now();
        let clock = self.clock;
        let places = desk.orders.iter().any(|order| order.wants.at.is_some());
        if places && desk.points.as_ref().is_none_or(|known| !Arc::ptr_eq(known, self.model.points())) {
            desk.points = Some(self.model.points().clone());
            desk.orders.iter_mut().for_each(|order| order.wants.find(self.model.points()));
        }
        let mut look = FieldCache::new(&mut *self.model, clock);
        let row = self.history.row(&mut look, &clock, last);
        let due = desk
            .orders
            .iter_mut()
            .enumerate()
            .filter_map(|(k, order)| order.is_due(&clock, last).then_some((k, order)));
        let snapshots = due.map(|(k, order)| (k, look.snapshot(&order.wants))).collect();
        let batch = Batch { row, snapshots };
        if batch.is_empty() {
            desk.thread.check()?
        } else {
            desk.thread.hand(batch)?
        }
        desk.seconds += begin.elapsed().as_secs_f64();
        Ok(())
    }

    fn progress(&self, begin: Instant) -> Progress {
        Progress {
            step: self.clock.step,
            n_steps: self.n_steps,
            time: self.clock.time(),
            imbalance: self.history.imbalance(),
            broken_bonds: self.model.facts().physics.elastic().map(|_| self.model.broken_pairs()),
            stretch_ratio: self.history.stretch_ratio,
            seconds: begin.elapsed().as_secs_f64(),
            within: None,
        }
    }

    fn report(&mut self, status: &str, wall: WallSeconds) -> Report {
        let facts = self.model.facts().clone();
        let b = self.history.balance;
        let books = self.model.columns(&b).into_iter().map(|column| (column.name, column.value.into())).collect();
        let damage = self.model.field("damage").map_or(Vec::new(), |f| crate::output::source::scalar(f, None));
        let bonds = facts.bonds - facts.cut_bonds;
        let elastic = facts.physics.elastic();
        let imbalance = self.history.imbalance();
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
            volume: facts.volume,
            shape_volume: facts.shape_volume,
            mass: facts.mass,
            materials: elastic.map_or(Vec::new(), |e| e.materials.clone()),
            micromodulus: elastic.map(|e| e.micromodulus),
            critical_stretch: elastic.and_then(|e| e.critical_stretch),
            surface: elastic.map(|e| e.surface),
            diffusion: facts.physics.diffusive().map(|d| Diffusion {
                diffusivity: d.diffusivity,
                found_diffusivity: d.found_diffusivity,
                micro_diffusivity: d.micro_diffusivity,
                exponent: d.exponent,
                imbalance,
            }),
            steps: self.clock.step,
            time_step: self.longest_step,
            stable_time_step: self.solver.largest_step(facts.stable_step),
            end_time: self.clock.time(),
            threads: self.threads,
            wall_seconds: wall,
            bond_updates_per_second: bonds as f64 * self.clock.step as f64 / wall.stepping.max(1e-9),
            peak_memory_bytes: peak_memory(),
            energy: elastic.map(|_| Energy {
                kinetic: b.kinetic,
                strain: b.strain,
                fracture: b.fracture,
                external: b.external,
                damped: b.damped,
                refined: b.refined,
                initial: b.initial,
            }),
            hybrid: self.model.hybrid().map(|work| Hybrid {
                standard_fraction_at_start: work.standard[1],
                standard_fraction: work.standard[0],
                bond_evaluations: work.all_bonds,
                row_evaluations: work.all_nodes,
            }),
            refinement: self.model.adapted().map(|adapted| Refinement {
                events: adapted.events,
                most_points: adapted.points[0],
                mean_points: adapted.points[1] as f64 / (adapted.looks as f64 + 1.0),
                energy: b.refined,
                energy_turnover: adapted.energy,
                families_found_anew: adapted.bonds[0] as f64 / (adapted.bonds[1] as f64).max(1.0),
                points_seen_by_coarser: adapted.seen,
            }),
            books,
            energy_imbalance: elastic.map(|_| imbalance),
            momentum_error: elastic.map(|_| self.history.momentum_error()),
            broken_bonds: elastic.map(|_| self.model.broken_pairs()),
            largest_stretch_ratio: self.history.most_stretched.map(|(bond, time)| StretchRatio {
                value: bond.ratio,
                position: bond.position[..facts.dimension].to_vec(),
                time,
            }),
            damaged_points: elastic.map(|_| damage.iter().filter(|&&d| d > 0.35).count()),
            crack_tip: self.history.tip.as_ref().map(|tip| Tip {
                position: tip.position.map(|x| x[..facts.dimension].to_vec()),
                largest_speed: tip.largest_speed,
                rayleigh_speed: elastic.and_then(|e| e.rayleigh_speed),
            }),
            load_steps: self.model.load_steps().to_vec(),
            probes: Vec::new(),
            state_hash: self.model.hash(),
        }
    }
}

/// Where the stepping thread and the writer thread meet.
struct OutputQueue {
    orders: Vec<ScheduledRequest>,
    /// Among which the places that orders want have been found.
    points: Option<Arc<Points>>,
    thread: WriterThread,
    /// That the stepping thread has spent here.
    seconds: f64,
}

impl OutputQueue {
    /// Waits for the writer thread; seconds that the stepping thread spent on output, and that the writers were busy.
    fn close(self) -> Result<(f64, f64)> {
        let begin = Instant::now();
        let writing = self.thread.finish()?;
        Ok((self.seconds + begin.elapsed().as_secs_f64(), writing))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::NumericalStop;
    use crate::field::{Field, Values};
    use crate::output::schedule::Schedule;
    use crate::output::snapshot::{FieldRequest, Snapshot};
    use crate::output::source::{BodySummary, ElasticSummary, PhysicsSummary};
    use crate::output::writer::Writer;
    use crate::physics::elasticity::surface::SurfaceEffect;
    use crate::physics::{Balance, Column};
    use crate::solver::VelocityVerlet;
    use std::sync::Mutex;

    /// A model that does nothing until it stops on numbers, and counts how often its field is computed.
    struct Still {
        points: Arc<Points>,
        stops_at: u64,
        computed: u64,
    }

    impl Source for Still {
        fn facts(&self) -> &BodySummary {
            &self.points().facts
        }
        fn points(&self) -> &Arc<Points> {
            &self.points
        }
        fn field(&mut self, name: &str) -> Option<Field> {
            self.computed += 1;
            let values = Values::Scalar(vec![self.computed as f64; 1 << 17]);
            (name == "damage").then_some(Field { name: "damage", unit: "", values })
        }
        fn field_at(&mut self, name: &str, point: usize) -> Option<Field> {
            self.field(name).map(|field| field.at(point))
        }
        fn balance(&mut self) -> Balance {
            Balance::default()
        }
        fn defect(&mut self, balance: &Balance) -> [f64; 2] {
            [balance.defect(), balance.scale()]
        }
        fn columns(&mut self, _: &Balance) -> Vec<Column> {
            vec![Column::new("kinetic", 0.0)]
        }
        fn broken_pairs(&self) -> u64 {
            0
        }
        fn reactions(&self) -> Vec<(String, f64)> {
            Vec::new()
        }
        fn hash(&mut self) -> String {
            String::new()
        }
        fn family_sizes(&self) -> Vec<u32> {
            Vec::new()
        }
        fn bond_words(&self) -> &[u16] {
            &[]
        }
        fn bond_ends(&self, _: usize) -> [[f64; 3]; 2] {
            [[0.0; 3]; 2]
        }
    }

    impl Stepper for Still {
        fn start(&mut self) {}
        fn hand_over(&mut self, _: &Solver, _: f64) {}
        fn visit(&mut self, _: &mut dyn Visitor) {}
        fn load_steps(&self) -> &[LoadStep] {
            &[]
        }
        fn step_observed(
            &mut self,
            _: &Solver,
            clock: &mut Clock,
            _: &mut dyn FnMut(usize, f64) -> bool,
        ) -> Result<bool> {
            clock.step += 1;
            let (step, time) = (clock.step, clock.time());
            let stop = NumericalStop { step, time, field: "velocity", value: f64::NAN, point: None, cause: "".into() };
            if step == self.stops_at { Err(Error::Numbers(Box::new(stop))) } else { Ok(true) }
        }
    }

    /// Steps at which it wrote, and the value of the field then; slow, and fails at one of the steps.
    struct Slow {
        seen: Arc<Mutex<Vec<(u64, f64)>>>,
        fails_at: u64,
        folder: PathBuf,
    }

    impl Writer for Slow {
        fn wants(&self) -> FieldRequest {
            FieldRequest::everywhere(vec!["damage"])
        }
        fn write(&mut self, snapshot: &Snapshot) -> Result<()> {
            std::thread::sleep(std::time::Duration::from_millis(3));
            let Some(Values::Scalar(values)) = snapshot.field("damage").map(|field| &field.values) else {
                panic!("the snapshot holds what was wanted")
            };
            if let Ok(mut seen) = self.seen.lock() {
                seen.push((snapshot.clock.step, values[0]));
            }
            if snapshot.clock.step == self.fails_at {
                return Err(Error::io(&self.folder, std::io::Error::other("disk full")));
            }
            Ok(())
        }
    }

    type Seen = Arc<Mutex<Vec<(u64, f64)>>>;

    /// Two writers of the same field, every 2 and every 3 of 20 steps.
    fn simulation(name: &str, stops_at: u64, fails_at: u64) -> (Simulation, [Seen; 2]) {
        let folder = std::env::temp_dir().join(format!("bondwise-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let facts = BodySummary {
            dimension: 1,
            points: 1,
            bonds: 0,
            cut_bonds: 0,
            horizon: 1.0,
            spacing: 1.0,
            volume: 1.0,
            shape_volume: None,
            mass: None,
            stable_step: 1.0,
            physics: PhysicsSummary::Elastic(ElasticSummary {
                bar_speed: 1.0,
                rayleigh_speed: None,
                materials: Vec::new(),
                micromodulus: 1.0,
                critical_stretch: None,
                surface: SurfaceEffect::default(),
            }),
            memory: 0,
        };
        let points = Arc::new(Points { positions: vec![[0.0; 3]], sizes: Vec::new(), facts });
        let seen = [Seen::default(), Seen::default()];
        let output = |every: u64, seen: &Seen| Output {
            schedule: Schedule::Steps(every),
            writer: Box::new(Slow { seen: seen.clone(), fails_at, folder: folder.clone() }),
        };
        let simulation = Simulation {
            title: String::new(),
            model: Box::new(Still { points, stops_at, computed: 0 }),
            solver: Solver::VelocityVerlet(VelocityVerlet { damping: 0.0 }),
            clock: Clock::new(1.0),
            longest_step: 1.0,
            n_steps: 20,
            stages_to_come: VecDeque::new(),
            history: History::new(folder.join("history.csv"), 5, None),
            outputs: vec![output(2, &seen[0]), output(3, &seen[1])],
            folder,
            threads: 1,
            setup_seconds: 0.0,
            loads: Vec::new(),
        };
        (simulation, seen)
    }

    fn steps(seen: &Seen) -> Vec<u64> {
        seen.lock().unwrap().iter().map(|(step, _)| *step).collect()
    }

    #[test]
    fn every_due_instant_is_written_in_order_and_its_field_computed_once() {
        let (mut simulation, seen) = simulation("order", 0, u64::MAX);
        let report = simulation.run(|_| Control::Continue).unwrap();
        assert_eq!(steps(&seen[0]), (0..=10).map(|k| 2 * k).collect::<Vec<_>>());
        assert_eq!(steps(&seen[1]), [0, 3, 6, 9, 12, 15, 18, 20]);
        let mut all: Vec<_> = seen.iter().flat_map(|seen| seen.lock().unwrap().clone()).collect();
        all.sort_by_key(|entry| entry.0);
        all.dedup();
        // Equal instants gave equal values, and the values count the computations.
        assert_eq!(
            all.iter().map(|(_, value)| *value).collect::<Vec<_>>(),
            (1..=15).map(f64::from).collect::<Vec<_>>()
        );
        assert!(report.wall_seconds.writing >= 19.0 * 3e-3, "{:?}", report.wall_seconds);
    }

    #[test]
    fn a_stop_on_numbers_and_a_wish_to_stop_still_write_the_last_instant_and_the_report() {
        for (name, stops_at, wish) in [("numbers", 7, Control::Continue), ("wish", 0, Control::Stop)] {
            let (mut simulation, seen) = simulation(name, stops_at, u64::MAX);
            let ended = simulation.run(|progress| if progress.step == 7 { wish } else { Control::Continue });
            assert_eq!(steps(&seen[0]), [0, 2, 4, 6, 7], "{name}");
            assert_eq!(steps(&seen[1]), [0, 3, 6, 7], "{name}");
            assert!(simulation.folder.join("report.json").is_file());
            let history = std::fs::read_to_string(simulation.folder.join("history.csv")).unwrap();
            assert_eq!(history.lines().count(), 1 + 3, "{history}");
            assert_eq!(ended.is_err(), stops_at > 0);
        }
    }

    #[test]
    fn the_error_of_a_writer_ends_the_run() {
        // Of a writer in the middle of the run, and of one that fails on the last frame of a run that the numbers end.
        for (name, stops_at, fails_at, before) in [("middle", 0, 6, 3), ("last", 7, 7, 6)] {
            let (mut simulation, seen) = simulation(name, stops_at, fails_at);
            let error = simulation.run(|_| Control::Continue).unwrap_err();
            assert!(matches!(error, Error::Io { .. }) && error.to_string().ends_with(": disk full"), "{error}");
            assert_eq!(steps(&seen[0]).last(), Some(&fails_at));
            assert_eq!(steps(&seen[1]).last(), Some(&before), "what comes after the error is not written");
            assert!(!simulation.folder.join("report.json").exists());
        }
    }
}
