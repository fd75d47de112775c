//! A problem: one body, its physics and conditions, and the state that they change. A [`System`] for the solvers.
//!
//! It also keeps the books: work and impulse of everything from outside, energy lost to broken bonds and damping, so
//! that a wrong run is seen at once.

pub mod adapt;
pub mod hybrid;
mod rest;

use std::ops::Range;

use rayon::prelude::*;

pub use adapt::{Adaptation, Adapted};
pub use hybrid::Hybrid;

use crate::conditions::load::Done;
use crate::conditions::prescribed::Step;
use crate::conditions::{Load, Prescribed};
use crate::error::{Error, NumericalStop, Result};
use crate::execution::{Exec, Packs};
use crate::family::{Body, BondLaw, BondStates, Families};
use crate::field::{Double, Field, Number, Precision, Values, components, components_mut, embed};
use crate::geometry::Arrangement;
use crate::physics::elasticity::state_based::StateBased;
use crate::physics::elasticity::{Elasticity, State};
use crate::physics::failure::CriticalStretch;
use crate::solver::runge_kutta::Memory;
use crate::solver::statics::LoadStep;
use crate::solver::{Clock, Drift, Solver, Stage, Staged, System, Unknowns, VelocityVerlet};

/// One body, what it is made of, what acts on it, and where it stands.
pub struct Problem<const D: usize, L, P: Precision = Double> {
    pub body: Body<D>,
    pub physics: Elasticity<L>,
    pub state: State<P>,
    pub prescribed: Vec<Prescribed>,
    pub loads: Vec<Load>,
    /// Σ β V′ over the family before any bond broke, by slot: what damage is measured against.
    family_volume: Vec<P::Field>,
    /// Directed bonds of the body, and how many of them the pre-cracks cut.
    pub n_bonds: u64,
    pub n_cut: u64,
    exec: Exec,
    /// The solver and the step (s) whose last kick velocities have not had yet.
    owed: Option<(VelocityVerlet, f64)>,
    ledger: Ledger,
    /// c of the solver in use, 1/s: the books need it.
    damping: f64,
    stages: Memory<P::Field>,
    /// What the load steps took, of static solvers.
    pub load_steps: Vec<LoadStep>,
    /// Whether a static solver advances it: the body starts without motion, and prescribed values are the solver's to
    /// impose.
    pub is_static: bool,
    /// How cells follow the solution; None if they do not.
    adaptation: Option<Box<Adaptation<D>>>,
    /// Which points have rows instead of bonds; None if none has.
    hybrid: Option<Box<Hybrid<D, P>>>,
    /// What each point belongs to: only points of one kind are merged.
    kinds: Vec<u32>,
    pub adapted: Adapted,
    /// How often the points have been replaced.
    pub generation: u64,
}

/// What came in and what was lost since the start.
#[derive(Debug, Clone, Copy, Default)]
struct Ledger {
    initial: f64,
    external: f64,
    damped: f64,
    refined: f64,
    impulse: [f64; 3],
    initial_momentum: [f64; 3],
    kinetic: f64,
    momentum: [f64; 3],
}

/// The energies (J; J/m of thickness in 2D, J of a unit cross-section in 1D) and momenta of a body at one instant.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Balance {
    pub kinetic: f64,
    pub strain: f64,
    /// Energy that broken bonds took with them.
    pub fracture: f64,
    /// Work of loads and prescribed motion.
    pub external: f64,
    /// Energy taken by damping.
    pub damped: f64,
    /// Energy that came in when points were split and merged.
    pub refined: f64,
    /// Kinetic and strain energy at the start.
    pub initial: f64,
    /// N·s
    pub momentum: [f64; 3],
    /// About the origin, N·m·s.
    pub angular_momentum: [f64; 3],
    /// |momentum − initial momentum − impulse from outside|, N·s.
    pub momentum_defect: f64,
    /// Σ ρ |v| V: what the momentum defect is measured against, N·s.
    pub momentum_scale: f64,
}

impl Balance {
    /// What is found less what should be there, J.
    pub fn defect(&self) -> f64 {
        self.kinetic + self.strain + self.fracture + self.damped - self.initial - self.external - self.refined
    }

    /// What a defect is measured against: the larger of the initial energy and the external work, J.
    pub fn scale(&self) -> f64 {
        self.initial.max(self.external.abs())
    }
}

impl<const D: usize, L: BondLaw<D>, P: Packs> Problem<D, L, P> {
    /// `state` holds initial values and broken pre-cracks; `n_cut` directed bonds of these.
    pub fn new(
        body: Body<D>,
        physics: Elasticity<L>,
        state: State<P>,
        prescribed: Vec<Prescribed>,
        loads: Vec<Load>,
        n_cut: u64,
    ) -> Self {
        let mut exec = Exec::default();
        let mut family_volume = vec![0.0; body.cloud.n_slots()];
        let n_bonds = state.states.count() + n_cut;
        physics.bonded_volume(&body, &mut exec, &BondStates::whole(&body), &mut family_volume);
        let family_volume = family_volume.into_iter().map(P::Field::from_f64).collect();
        let ledger = Ledger::default();
        Problem {
            body,
            physics,
            state,
            prescribed,
            loads,
            family_volume,
            n_bonds,
            n_cut,
            exec,
            owed: None,
            ledger,
            damping: 0.0,
            stages: Memory::default(),
            load_steps: Vec::new(),
            is_static: false,
            adaptation: None,
            hybrid: None,
            kinds: Vec::new(),
            adapted: Adapted::default(),
            generation: 0,
        }
    }

    /// Evaluates the forces at the start and opens the books.
    pub fn start(&mut self) {
        if self.is_static {
            self.state.velocity.fill(P::Field::default());
            self.ledger.initial = self.balance().strain;
            return;
        }
        self.adapt(0.0, true);
        // What the first cells bring in is part of the initial energy.
        (self.ledger.refined, self.adapted.energy) = (0.0, 0.0);
        self.set_in_motion(0.0);
        let now = self.balance();
        self.ledger.initial = now.kinetic + now.strain + now.fracture;
        self.ledger.initial_momentum = now.momentum;
        self.ledger.impulse = [0.0; 3];
        self.ledger.external = 0.0;
        self.ledger.kinetic = now.kinetic;
        self.ledger.momentum = now.momentum;
        self.book_stiffness_damping(0, 0.0, true);
    }

    /// Puts what is prescribed in motion at time `t` and evaluates the forces there.
    fn set_in_motion(&mut self, t: f64) {
        for p in self.prescribed.iter_mut().filter(|p| p.goes_on(t)) {
            let c = p.component;
            let [u, v] = [&mut self.state.displacement, &mut self.state.velocity];
            p.start(
                t,
                components_mut::<D, _>(u)[c],
                components_mut::<D, _>(v)[c],
                components::<D, _>(&self.state.force)[c],
            );
        }
        self.loads.iter_mut().for_each(|load| load.last = None);
        self.evaluate(t, 0.0);
        for p in &mut self.prescribed {
            let c = p.component;
            let force = components::<D, _>(&self.state.force)[c];
            for (&slot, last) in p.slots.iter().zip(&mut p.last) {
                last[2] = force[slot as usize].to_f64();
            }
        }
    }

    /// Hands the body over to another solver at time `t`: displacements, broken bonds and books go on.
    ///
    /// Motion that begins at once, by a prescribed velocity, is work and impulse from outside; motion that a static solver
    /// stops is booked as taken by damping, its momentum as an impulse.
    pub fn hand_over(&mut self, solver: &Solver, t: f64) {
        self.catch_up();
        self.is_static = solver.is_static();
        let before = self.motion();
        if self.is_static {
            self.state.velocity.fill(P::Field::default());
        } else {
            self.set_in_motion(t);
        }
        let after = self.motion();
        let ledger = &mut self.ledger;
        if self.is_static {
            ledger.damped += before.0;
        } else {
            ledger.external += after.0 - before.0;
        }
        for d in 0..3 {
            ledger.impulse[d] += after.1[d] - before.1[d];
        }
        (ledger.kinetic, ledger.momentum) = after;
    }

    /// One step of a solver in time, then the watch over its result; or a load step of a static solver, of which `observe`
    /// is told: see [`Statics::solve`](crate::solver::Statics::solve). False when it was interrupted.
    ///
    /// Where a step of velocity Verlet can leave its last kick to the next, velocities in `state` lack it until
    /// [`catch_up`](Self::catch_up), which all that asks for velocities and energies here does; the watch then begins with
    /// the motion at the end of the step before.
    pub fn step(
        &mut self,
        solver: &Solver,
        clock: &mut Clock,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<bool> {
        if self.owed.is_some_and(|(last, dt)| (Solver::VelocityVerlet(last), dt) != (*solver, clock.dt)) {
            self.catch_up();
        }
        match solver {
            Solver::Statics(statics) => return self.settle(statics, clock, observe),
            Solver::VelocityVerlet(verlet) => {
                self.damping = verlet.damping;
                let on_lattice = matches!(self.body.cloud.arrangement, Arrangement::Lattice(_));
                if on_lattice && verlet.damping == 0.0 && self.prescribed.is_empty() {
                    let owed = self.owed.is_some();
                    let squares = verlet.stride(self, clock, owed);
                    if owed {
                        self.book_motion(squares);
                    }
                    self.owed = Some((*verlet, clock.dt));
                } else {
                    verlet.step(self, clock);
                    let last = (self.ledger.kinetic, self.ledger.momentum);
                    let (kinetic, momentum) = self.motion();
                    let ledger = &mut self.ledger;
                    // Damping takes ρ c v² a second, and ρ c v of momentum: trapezoidal in time, as the forces.
                    ledger.damped += verlet.damping * clock.dt * (last.0 + kinetic);
                    for d in 0..3 {
                        ledger.impulse[d] -= 0.5 * verlet.damping * clock.dt * (last.1[d] + momentum[d]);
                    }
                    (ledger.kinetic, ledger.momentum) = (kinetic, momentum);
                }
            }
            Solver::RungeKutta(method) => {
                self.damping = method.damping;
                let mut memory = std::mem::take(&mut self.stages);
                method.step(self, clock, &mut memory);
                self.stages = memory;
                (self.ledger.kinetic, self.ledger.momentum) = self.motion();
            }
        }
        if self.watch(solver, clock).is_err() {
            // What was kept of the step before and what came in since are of two instants: this one decides.
            self.catch_up();
            self.watch(solver, clock)?;
        }
        self.book_stiffness_damping(clock.step, clock.dt, false);
        if self.adaptation.as_ref().is_some_and(|adaptation| clock.step.is_multiple_of(adaptation.every)) {
            self.adapt(clock.time(), false);
        }
        Ok(true)
    }

    /// Gives velocities the last kick of the last step, which the next would make up for in passing.
    pub fn catch_up(&mut self) {
        if let Some((verlet, dt)) = self.owed.take() {
            let squares = verlet.finish(self, dt);
            self.book_motion(squares);
        }
    }

    /// The kinetic energy that belongs to Σ v² on a lattice.
    fn book_motion(&mut self, squares: f64) {
        let volume = self.body.cloud.spacing.powi(D as i32);
        self.ledger.kinetic = 0.5 * self.physics.density * volume * squares;
    }

    /// At the end of a run, or of a solver's part of it: catches up, and watches over the result of its last step.
    pub fn conclude(&mut self, solver: &Solver, clock: &Clock) -> Result<()> {
        self.catch_up();
        self.watch(solver, clock)
    }

    /// Adds the loads of time `t` to the force density. Gives the work and impulse of each over the last `dt`, by the
    /// trapezoidal rule.
    fn load(&mut self, t: f64, dt: f64) -> Vec<Done> {
        let (cloud, State { displacement, force, .. }) = (&self.body.cloud, &mut self.state);
        let apply = |load: &mut Load| {
            let u = components::<D, _>(displacement)[load.component];
            let force = &mut *components_mut::<D, _>(force)[load.component];
            load.apply(t, dt, u, force, |slot| cloud.volume(slot))
        };
        self.loads.iter_mut().map(apply).collect()
    }

    /// The same, booked.
    fn load_and_book(&mut self, t: f64, dt: f64) {
        let done = self.load(t, dt);
        for (load, done) in self.loads.iter().zip(done) {
            self.ledger.external += done.work;
            self.ledger.impulse[load.component] += done.impulse;
        }
    }

    /// Kinetic energy and momentum.
    fn motion(&mut self) -> (f64, [f64; 3]) {
        let (cloud, density) = (&self.body.cloud, self.physics.density);
        let velocity = components::<D, _>(&self.state.velocity);
        let (volumes, volume) = match &cloud.arrangement {
            // Slots without a point are at rest.
            Arrangement::Lattice(lattice) => (None, lattice.cell_volume()),
            Arrangement::Scattered { volumes, .. } => (Some(volumes), 1.0),
        };
        let [square, momentum @ ..] = self.exec.sum(cloud.n_slots(), &|slots| {
            let volumes = volumes.map(|v| &v[slots.clone()]);
            let mut sum = [0.0; 4];
            for d in 0..D {
                let [square, momentum] = squares_and_sum(&velocity[d][slots.clone()], volumes);
                sum[0] += square;
                sum[d + 1] = momentum;
            }
            sum
        });
        let mass = density * volume;
        (0.5 * mass * square, momentum.map(|p| mass * p))
    }

    /// Stops on values that are not finite, and on kinetic energy that nothing can have put in.
    fn watch(&self, solver: &Solver, clock: &Clock) -> Result<()> {
        let kinetic = self.ledger.kinetic;
        let cause = || {
            let stable = solver.stability() * self.stable_step();
            let profiles = self.loads.iter().map(|l| &l.profile).chain(self.prescribed.iter().map(|p| &p.profile));
            if let Some((formula, value)) = profiles.filter_map(|p| p.first_bad().map(|b| (p.source(), b.1))).next() {
                return format!("the formula `{formula}` of a condition gave {value}");
            }
            if clock.dt > stable {
                format!("the time step {:.3e} s is above the stable step {stable:.3e} s", clock.dt)
            } else {
                "bonds turned inside out, by loads or prescribed values too large for this step; try a smaller step"
                    .to_string()
            }
        };
        let stop = |field, value, point: Option<usize>| {
            let point = point.map(|i| {
                let x = self.body.cloud.position(self.body.cloud.slots[i] as usize);
                (i, x.to_vec())
            });
            Error::Numbers(Box::new(NumericalStop {
                step: clock.step,
                time: clock.time(),
                field,
                value,
                point,
                cause: cause(),
            }))
        };
        if !kinetic.is_finite() {
            for (field, flat) in [
                ("displacement", &self.state.displacement),
                ("force density", &self.state.force),
                ("velocity", &self.state.velocity),
            ] {
                for component in components::<D, _>(flat) {
                    let bad = self.body.cloud.slots.iter().position(|&s| !component[s as usize].to_f64().is_finite());
                    if let Some(point) = bad {
                        let value = component[self.body.cloud.slots[point] as usize].to_f64();
                        return Err(stop(field, value, Some(point)));
                    }
                }
            }
            return Err(stop("kinetic energy", kinetic, None));
        }
        // Kinetic energy cannot pass what came in; a factor of ten leaves room for the error of a coarse step.
        let available = self.ledger.initial + self.ledger.external.abs() + self.state.broken.energy;
        if kinetic > 10.0 * available && clock.step > 2 {
            let velocity = components::<D, _>(&self.state.velocity);
            let speed = |&slot: &u32| velocity.iter().map(|v| v[slot as usize].to_f64().powi(2)).sum::<f64>();
            let worst = (0..self.body.cloud.n_points())
                .max_by(|&a, &b| speed(&self.body.cloud.slots[a]).total_cmp(&speed(&self.body.cloud.slots[b])));
            return Err(stop("kinetic energy (J, runaway)", kinetic, worst));
        }
        Ok(())
    }

    /// The energies and momenta now.
    pub fn balance(&mut self) -> Balance {
        self.catch_up();
        let density = self.strain_energy();
        let (cloud, rho) = (&self.body.cloud, self.physics.density);
        let v = components::<D, _>(&self.state.velocity);
        let n = cloud.n_points();
        let [strain, scale, ..] = self.exec.sum(n, &|points| {
            let (mut strain, mut scale) = (0.0, 0.0);
            for slot in cloud.stored(points) {
                let volume = cloud.volume(slot);
                strain += density[slot].to_f64() * volume;
                scale += rho * volume * v.iter().map(|v| v[slot].to_f64().powi(2)).sum::<f64>().sqrt();
            }
            [strain, scale, 0.0, 0.0]
        });
        let (kinetic, momentum) = self.motion();
        let (cloud, u) = (&self.body.cloud, components::<D, _>(&self.state.displacement));
        let v = components::<D, _>(&self.state.velocity);
        let momentum_of = |slot: usize| -> [f64; 3] {
            let mass = rho * cloud.volume(slot);
            embed::<D>(&std::array::from_fn(|d| mass * v[d][slot].to_f64()))
        };
        let angular = self.exec.sum(n, &|points| {
            let mut sum = [0.0; 4];
            for slot in cloud.stored(points) {
                let x = cloud.position(slot);
                let y = embed::<D>(&std::array::from_fn(|d| x[d] + u[d][slot].to_f64()));
                let p = momentum_of(slot);
                for d in 0..3 {
                    let (a, b) = ((d + 1) % 3, (d + 2) % 3);
                    sum[d] += y[a] * p[b] - y[b] * p[a];
                }
            }
            sum
        });
        let ledger = &self.ledger;
        let defect: f64 = (0..3).map(|d| (momentum[d] - ledger.initial_momentum[d] - ledger.impulse[d]).powi(2)).sum();
        Balance {
            kinetic,
            strain,
            fracture: self.state.broken.energy,
            external: ledger.external,
            damped: ledger.damped,
            refined: ledger.refined,
            initial: ledger.initial,
            momentum,
            angular_momentum: [angular[0], angular[1], angular[2]],
            momentum_defect: defect.sqrt(),
            momentum_scale: scale,
        }
    }

    /// A field by name, in point order; None if there is no such field.
    pub fn field(&mut self, name: &str) -> Option<Field> {
        self.field_of(name, 0..self.body.cloud.n_points())
    }

    /// The same at one point only: a field of one value.
    pub fn field_at(&mut self, name: &str, point: usize) -> Option<Field> {
        self.field_of(name, point..point + 1)
    }

    fn field_of(&mut self, name: &str, points: Range<usize>) -> Option<Field> {
        if name == "velocity" {
            self.catch_up();
        }
        let damage = if name == "damage" { self.damage() } else { Vec::new() };
        let density = if name == "strain_energy" { self.strain_energy() } else { Vec::new() };
        let slots = &self.body.cloud.slots[points];
        let vector = |flat: &[P::Field]| {
            let parts = components::<D, _>(flat);
            Values::Vector(gather(slots, &|slot| embed::<D>(&std::array::from_fn(|d| parts[d][slot].to_f64()))))
        };
        let scalar = |value: &(dyn Fn(usize) -> f64 + Sync)| Values::Scalar(gather(slots, value));
        let (name, unit, values) = match name {
            "displacement" => ("displacement", "m", vector(&self.state.displacement)),
            "velocity" => ("velocity", "m/s", vector(&self.state.velocity)),
            "force" => ("force", "N/m³", vector(&self.state.force)),
            "damage" => ("damage", "", scalar(&|slot| damage[slot])),
            "strain_energy" => ("strain_energy", "J/m³", scalar(&|slot| density[slot].to_f64())),
            "scheme" => ("scheme", "", scalar(&|slot| self.scheme(slot))),
            _ => return None,
        };
        Some(Field { name, unit, values })
    }

    /// φ = 1 − Σ μ β V′ / Σ β V′ by slot; Shojaei et al. 2022, eq. (21).
    fn damage(&mut self) -> Vec<f64> {
        // Points with a row have lost no bond.
        let mut now: Vec<f64> = self.family_volume.iter().map(|whole| whole.to_f64()).collect();
        self.physics.bonded_volume(&self.body, &mut self.exec, &self.state.states, &mut now);
        let damage = |(now, whole): (&f64, &P::Field)| {
            let [now, whole] = [P::Field::from_f64(*now), *whole].map(P::Field::to_f64);
            if whole > 0.0 { 1.0 - now / whole } else { 0.0 }
        };
        now.par_iter().zip(&self.family_volume).map(damage).collect()
    }

    /// BLAKE3 of displacements, velocities and bond states: equal exactly when two runs have the same bits.
    pub fn hash(&mut self) -> String {
        self.catch_up();
        let mut hasher = blake3::Hasher::new();
        for flat in [&self.state.displacement, &self.state.velocity] {
            for component in components::<D, _>(flat) {
                for &slot in &self.body.cloud.slots {
                    hasher.update(component[slot as usize].bytes().as_ref());
                }
            }
        }
        hasher.update(&self.state.states.bytes());
        hasher.finalize().to_hex().to_string()
    }

    /// Bytes that points, fields, bonds and the scratch of the loops take.
    pub fn memory(&self) -> usize {
        let cloud = &self.body.cloud;
        let fields = (3 * D + 1) * size_of::<P::Field>() * cloud.n_slots() + size_of_val(&cloud.slots[..]);
        let classes = self.physics.failure.as_ref().map_or(0, CriticalStretch::memory);
        let classes = classes + self.physics.state_based.as_ref().map_or(0, StateBased::memory);
        let points = match &cloud.arrangement {
            Arrangement::Lattice(_) => 0,
            Arrangement::Scattered { positions, volumes } => size_of_val(&positions[..]) + size_of_val(&volumes[..]),
        };
        let families = match &self.body.families {
            Families::Lattice(families) => size_of_val(&families.blocks[..]),
            // Sites in the precision of the loops, and the records of input values.
            Families::Cloud(families) => {
                let records = size_of_val(&families.sites.records[..]);
                let fixed = if size_of::<P::Bond>() == 4 { records / 2 } else { 0 };
                let input = 4 * size_of::<P::Field>() * cloud.n_slots();
                size_of_val(&families.starts[..]) + size_of_val(&families.neighbours[..]) + records + fixed + input
            }
        };
        let bonds = size_of_val(self.state.states.words()) + self.physics.operator.memory();
        fields + classes + points + families + bonds + self.memory_of_hybrid()
    }

    /// Whether cells follow the solution.
    pub fn is_adapting(&self) -> bool {
        self.adaptation.as_ref().is_some_and(|adaptation| adaptation.criteria.is_some())
    }

    /// Broken pairs, pre-cracks not counted.
    pub fn broken_pairs(&self) -> u64 {
        self.state.broken.bonds / 2
    }
}

/// A value for each slot. Compiled for each type of value only.
fn gather<T: Send>(slots: &[u32], value: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    slots.par_iter().map(|&slot| value(slot as usize)).collect()
}

/// Σ v² V and Σ v V; V = 1 where none is given. Eight sums side by side, so that the loop is vectors.
fn squares_and_sum<T: Number>(values: &[T], volumes: Option<&[f64]>) -> [f64; 2] {
    let (mut squares, mut sums) = ([0.0; 8], [0.0; 8]);
    let mut chunks = values.chunks_exact(8);
    match volumes {
        None => {
            for chunk in &mut chunks {
                for k in 0..8 {
                    let v = chunk[k].to_f64();
                    squares[k] += v * v;
                    sums[k] += v;
                }
            }
            for (k, v) in chunks.remainder().iter().enumerate() {
                squares[k] += v.to_f64() * v.to_f64();
                sums[k] += v.to_f64();
            }
        }
        Some(volumes) => {
            for (k, (v, volume)) in values.iter().zip(volumes).enumerate() {
                let v = v.to_f64();
                squares[k % 8] += v * v * volume;
                sums[k % 8] += v * volume;
            }
        }
    }
    [squares, sums].map(|[a, b, c, d, e, f, g, h]| ((a + e) + (c + g)) + ((b + f) + (d + h)))
}

/// The fields that [`Problem::field`] knows.
pub const FIELDS: [&str; 6] = ["displacement", "velocity", "force", "damage", "strain_energy", "scheme"];

impl<const D: usize, L: BondLaw<D>, P: Packs> System for Problem<D, L, P> {
    type Number = P::Field;

    fn unknowns(&mut self) -> Unknowns<'_, P::Field> {
        Unknowns {
            displacement: &mut self.state.displacement,
            velocity: &mut self.state.velocity,
            force: &self.state.force,
            inertia: self.physics.density,
            negligible: P::Bond::NEGLIGIBLE * self.body.cloud.spacing,
            ahead: self.hybrid.as_mut().and_then(|hybrid| hybrid.ahead()),
        }
    }

    fn constrain(&mut self, stage: Stage, t: f64, dt: f64) {
        let State { displacement, velocity, force, .. } = &mut self.state;
        for p in &mut self.prescribed {
            let c = p.component;
            let u = &mut *components_mut::<D, _>(displacement)[c];
            let v = &mut *components_mut::<D, _>(velocity)[c];
            match stage {
                Stage::Drift => p.drift(t, dt, u, v),
                Stage::Finish => {
                    let force = components::<D, _>(force)[c];
                    let cloud = &self.body.cloud;
                    let step = Step { t, dt, inertia: self.physics.density, damping: self.damping };
                    let done = p.finish(&step, u, v, force, |slot| cloud.volume(slot));
                    self.ledger.external += done.work;
                    self.ledger.impulse[c] += done.impulse;
                }
            }
        }
        if let (Stage::Drift, Some(hybrid)) = (stage, &mut self.hybrid) {
            hybrid.drifted(&self.prescribed, &self.state);
        }
    }

    fn evaluate(&mut self, t: f64, dt: f64) {
        self.evaluate_bonds(dt);
        self.load_and_book(t, dt);
    }

    fn evaluate_behind(&mut self, drift: &Drift<P::Field>, t: f64, dt: f64) -> Option<f64> {
        let Problem { body, physics, state, exec, hybrid, prescribed, .. } = self;
        let hybrid = hybrid.as_mut().filter(|hybrid| prescribed.is_empty() && hybrid.evaluates_behind())?;
        let squares = hybrid.evaluate_behind(drift, physics, body, exec, state, dt);
        self.load_and_book(t, dt);
        Some(squares)
    }

    fn stable_step(&self) -> f64 {
        let bonds = self.physics.stable_step(&self.body);
        self.hybrid.as_ref().map_or(bonds, |hybrid| hybrid.stable_step(self.physics.density, bonds))
    }
}

impl<const D: usize, L: BondLaw<D>, P: Packs> Staged for Problem<D, L, P> {
    fn stage(&mut self, t: f64, end: f64, dt: f64) {
        let State { displacement, velocity, .. } = &mut self.state;
        for p in &mut self.prescribed {
            let u = &mut *components_mut::<D, _>(displacement)[p.component];
            let v = &mut *components_mut::<D, _>(velocity)[p.component];
            p.stage(t, end, dt, u, v);
        }
        self.force_of_bonds();
        self.load(t, 0.0);
    }

    fn book(&mut self, share: f64, end: f64, dt: f64) {
        let weight = share * dt;
        if self.damping > 0.0 {
            let (kinetic, momentum) = self.motion();
            self.ledger.damped += 2.0 * self.damping * weight * kinetic;
            for d in 0..3 {
                self.ledger.impulse[d] -= self.damping * weight * momentum[d];
            }
        }
        let (cloud, inertia) = (&self.body.cloud, self.physics.density);
        let velocity = components::<D, _>(&self.state.velocity);
        let force = components::<D, _>(&self.state.force);
        let loads = self.loads.iter().map(|load| {
            let c = load.component;
            (c, load.book(weight, velocity[c], |slot| cloud.volume(slot)))
        });
        let step = Step { t: end, dt, inertia, damping: self.damping };
        let prescribed = self.prescribed.iter_mut().map(|p| {
            let c = p.component;
            (c, p.book(weight, &step, velocity[c], force[c], |slot| cloud.volume(slot)))
        });
        for (c, done) in loads.chain(prescribed) {
            self.ledger.external += done.work;
            self.ledger.impulse[c] += done.impulse;
        }
    }

    fn arrive(&mut self, t: f64, dt: f64) {
        let step = Step { t, dt, inertia: self.physics.density, damping: self.damping };
        let State { displacement, velocity, .. } = &mut self.state;
        for p in &mut self.prescribed {
            let c = p.component;
            let u = &mut *components_mut::<D, _>(displacement)[c];
            let v = &mut *components_mut::<D, _>(velocity)[c];
            let cloud = &self.body.cloud;
            let done = p.arrive(&step, u, v, |slot| cloud.volume(slot));
            self.ledger.external += done.work;
            self.ledger.impulse[c] += done.impulse;
        }
        // A bond that breaks has acted all through the step, and takes what it holds at its end.
        self.evaluate_bonds(0.0);
        self.load(t, 0.0);
    }
}
