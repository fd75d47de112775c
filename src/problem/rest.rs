//! A problem at rest: what the static solvers see of it, and the books of their steps.
//!
//! Always in double precision, whatever the fields are stored in. Unknowns are the displacements by slot, component
//! after component; forces are those on a point, N: force density times volume.

use std::sync::atomic::{AtomicU64, Ordering};

use super::Problem;
use crate::conditions::{Load, Prescribed, Quantity};
use crate::error::{Error, NumericalStop, Result};
use crate::execution::{BreakRule, Broken, Exec, Packs};
use crate::family::{Body, Bond, BondLaw, BondStates};
use crate::field::{Double, Number, components, components_mut};
use crate::physics::elasticity::Elasticity;
use crate::physics::failure::CriticalStretch;
use crate::solver::Clock;
use crate::solver::linear::{BlockJacobi, Layout, LinearError, NullSpace, Preconditioner, Sparse, vector};
use crate::solver::newton::{Equilibrium, Unrest};
use crate::solver::statics::{LoadStep, Statics};

/// A body that a static solver brings to rest.
struct Rest<'a, const D: usize, L> {
    body: &'a Body<D>,
    physics: &'a Elasticity<L>,
    states: &'a mut BondStates,
    prescribed: &'a mut [Prescribed],
    loads: &'a mut [Load],
    exec: &'a mut Exec,
    /// Whether forces are those of the tangent at u = 0.
    linearised: bool,
    displacement: Vec<f64>,
    /// Loads, N.
    load: Vec<f64>,
    kind: Vec<Kind>,
    scratch: [Vec<f64>; 2],
    /// Of the displacements now, s.
    pub time: f64,
}

/// What an unknown is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Free,
    /// Its displacement is prescribed.
    Held,
    /// There is no point, or one without bonds or load.
    Absent,
}

/// Forces and displacements at rest: what the work of a step is computed from.
#[derive(Debug, Clone)]
struct Resting {
    displacement: Vec<f64>,
    /// Internal force and load on each unknown, N.
    total: Vec<f64>,
    load: Vec<f64>,
}

/// J
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Work {
    /// Of loads and prescribed displacements.
    pub external: f64,
    /// Of forces that nothing balanced when a step began, after bonds had broken: a body let go would move with it.
    pub lost: f64,
}

/// Below this share of a motion, what is left of it on the held unknowns is rounding.
const DEPENDENT: f64 = 1e-9;
/// The step of a difference quotient, in spacings: bonds are strained by 1e-5, so that the curvature of the law is seen
/// to 1e-10, and rounding to 1e-11.
const DIFFERENCE: f64 = 1e-5;
/// What preconditioning by blocks keeps of their off-diagonals: the block of a point whose bonds are all in one plane or on
/// one line is singular, and so is not.
const COUPLED: f64 = 0.999;

impl<'a, const D: usize, L: BondLaw<D>> Rest<'a, D, L> {
    #[allow(clippy::too_many_arguments)] // the parts of a problem that it borrows
    pub fn new(
        body: &'a Body<D>,
        physics: &'a Elasticity<L>,
        states: &'a mut BondStates,
        prescribed: &'a mut [Prescribed],
        loads: &'a mut [Load],
        exec: &'a mut Exec,
        displacement: Vec<f64>,
        linearised: bool,
    ) -> Self {
        let n = displacement.len();
        Rest {
            body,
            physics,
            states,
            prescribed,
            loads,
            exec,
            linearised,
            displacement,
            load: vec![0.0; n],
            kind: vec![Kind::Absent; n],
            scratch: [vec![0.0; n], vec![0.0; n]],
            time: 0.0,
        }
    }

    /// What a failed step changes.
    fn saved(&self) -> (Vec<f64>, Vec<u16>, f64) {
        (self.displacement.clone(), self.states.words().to_vec(), self.time)
    }

    fn restore(&mut self, (displacement, words, time): (Vec<f64>, Vec<u16>, f64)) {
        self.displacement = displacement;
        self.states.words_mut().copy_from_slice(&words);
        self.time = time;
    }

    /// Force density × volume → force, by slot.
    fn times_volume(&self, force: &mut [f64]) {
        let cloud = &self.body.cloud;
        for component in components_mut::<D, _>(force) {
            vector::fill(component, |start, values| {
                for (k, value) in values.iter_mut().enumerate() {
                    *value *= cloud.volume(start + k);
                }
            });
        }
    }

    /// Internal force of the law at displacements `u`, N.
    fn forces(&mut self, u: &[f64], force: &mut [f64]) {
        let (input, output) = (components::<D, _>(u), components_mut::<D, _>(&mut *force));
        self.physics.force_density::<D, Double>(self.body, self.exec, self.states, input, output);
        self.times_volume(force);
    }

    /// Change of the internal force by displacements `x` from those now, or from zero, to first order, N.
    fn change(&mut self, x: &[f64], change: &mut [f64]) {
        if L::LINEAR {
            return self.forces(x, change);
        }
        let largest = x.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
        if largest == 0.0 {
            return change.fill(0.0);
        }
        let h = DIFFERENCE * self.body.cloud.spacing / largest;
        let [mut u, mut before] = std::mem::take(&mut self.scratch);
        for (sign, force) in [(1.0, &mut *change), (-1.0, &mut before)] {
            if self.linearised {
                u.fill(0.0);
            } else {
                u.copy_from_slice(&self.displacement);
            }
            vector::add(sign * h, x, &mut u);
            self.forces(&u, force);
        }
        vector::add(-1.0, &before, change);
        vector::scale(0.5 / h, change);
        self.scratch = [u, before];
    }

    /// Internal force now, N.
    fn internal(&mut self, force: &mut [f64]) {
        let u = std::mem::take(&mut self.displacement);
        if self.linearised {
            self.change(&u, force)
        } else {
            self.forces(&u, force)
        }
        self.displacement = u;
    }

    /// Which unknowns are free at time `t`.
    fn classify(&mut self, t: f64) {
        let n = self.body.cloud.n_slots();
        let mut springs = vec![0.0; D * n];
        self.physics.diagonal(self.body, self.exec, self.states, components_mut::<D, _>(&mut springs));
        self.kind.fill(Kind::Absent);
        for &slot in &self.body.cloud.slots {
            for d in 0..D {
                let k = d * n + slot as usize;
                if springs[k] > 0.0 || self.load[k] != 0.0 {
                    self.kind[k] = Kind::Free;
                }
            }
        }
        for p in self.prescribed.iter().filter(|p| p.holds(t)) {
            for &slot in p.slots.iter() {
                self.kind[p.component * n + slot as usize] = Kind::Held;
            }
        }
    }

    /// Zeroes what is not free.
    fn keep_free(&self, r: &mut [f64]) {
        let kind = &self.kind;
        vector::fill(r, |start, r| {
            for (r, kind) in r.iter_mut().zip(&kind[start..]) {
                if *kind != Kind::Free {
                    *r = 0.0;
                }
            }
        });
    }

    /// Forces and displacements as they are.
    pub fn resting(&mut self) -> Resting {
        let mut total = vec![0.0; self.displacement.len()];
        self.internal(&mut total);
        vector::add(1.0, &self.load, &mut total);
        Resting { displacement: self.displacement.clone(), total, load: self.load.clone() }
    }

    /// Work from one state to another: mean forces along the way, exact for a linear law.
    pub fn work(&self, from: &Resting, to: &Resting) -> Work {
        let mut work = Work::default();
        for (k, kind) in self.kind.iter().enumerate() {
            let way = to.displacement[k] - from.displacement[k];
            let [mean, load] = [[&from.total, &to.total], [&from.load, &to.load]].map(|[a, b]| 0.5 * (a[k] + b[k]));
            match kind {
                Kind::Free => {
                    work.external += load * way;
                    work.lost += mean * way;
                }
                // The reaction is what balances the total.
                Kind::Held => work.external += (load - mean) * way,
                Kind::Absent => {}
            }
        }
        work
    }

    /// Sets the reactions of prescribed sets: what holds them against the forces of `state`, N.
    pub fn react(&mut self, state: &Resting) {
        let n = self.body.cloud.n_slots();
        for p in self.prescribed.iter_mut() {
            p.reaction = -p.slots.iter().map(|&slot| state.total[p.component * n + slot as usize]).sum::<f64>();
        }
    }

    /// The largest strain of a bond over its critical strain; 0 where all are below it.
    fn worst(&mut self, failure: &CriticalStretch) -> f64 {
        let largest = AtomicU64::new(0);
        self.break_where(failure, f64::INFINITY, &largest);
        f64::from_bits(largest.into_inner())
    }

    /// Breaks the bonds that are strained beyond `limit` times their critical strain.
    fn break_beyond(&mut self, failure: &CriticalStretch, limit: f64) -> Broken {
        self.break_where(failure, limit, &AtomicU64::new(0))
    }

    fn break_where(&mut self, failure: &CriticalStretch, limit: f64, largest: &AtomicU64) -> Broken {
        let mut force = std::mem::take(&mut self.scratch[0]);
        let (input, output) = (components::<D, _>(&self.displacement), components_mut::<D, _>(&mut force));
        let rule = Overstrained { failure, law: self.physics.law, displacement: input, limit, largest };
        let broken = self.physics.break_by::<D, Double>(self.body, self.exec, self.states, input, output, &rule);
        self.scratch[0] = force;
        broken
    }
}

impl<const D: usize, L: BondLaw<D>, P: Packs> Problem<D, L, P> {
    /// Takes a load step: brings the body to rest at its end, by smaller steps where that fails.
    ///
    /// `observe` as in [`Statics::solve`]; when it answers false, the state stays the last one at rest, and this gives
    /// false.
    ///
    /// # Errors
    /// [`Error::Numbers`] when no smaller step succeeds either; the state is then the last one at rest.
    pub(super) fn settle(
        &mut self,
        statics: &Statics,
        clock: &mut Clock,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<bool> {
        let (start, began) = (clock.time(), *clock);
        clock.step += 1;
        let end = clock.time();
        let displacement = self.state.displacement.iter().map(|u| u.to_f64()).collect();
        let Problem { body, physics, state, prescribed, loads, exec, .. } = self;
        let failure = physics.failure.as_ref().filter(|_| statics.breaking);
        let mut rest =
            Rest::new(body, physics, &mut state.states, prescribed, loads, exec, displacement, statics.linearised);
        rest.time = start;
        rest.pose(start);
        let (mut books, mut step, mut failed) = (Books::new(&mut rest), end - start, None);
        let mut log = LoadStep { step: clock.step, ..LoadStep::default() };
        while rest.time < end && failed.is_none() {
            let next = if rest.time + 1.001 * step < end { rest.time + step } else { end };
            let (saved, before) = (rest.saved(), books.clone());
            let divisible = 0.5 * (next - rest.time) >= SMALLEST_STEP * (end - start);
            match books.advance(&mut rest, statics, failure, next, divisible, &mut log, observe) {
                Ok(true) => step *= 2.0,
                Err(unrest) if !divisible || unrest.stays() => {
                    rest.restore(saved);
                    books = before;
                    failed = Some(unrest);
                }
                // Too far, or not at all: once more, half as far.
                Ok(false) | Err(_) => {
                    rest.restore(saved);
                    books = before;
                    step = 0.5 * (next - rest.time);
                    log.halvings += 1;
                }
            }
        }
        let reached = rest.time;
        rest.react(&books.state);
        let Books { state: at_rest, work, broken } = books;
        self.state.broken.bonds += broken.bonds;
        self.state.broken.energy += broken.energy;
        self.ledger.external += work.external;
        self.ledger.damped += work.lost;
        for (u, value) in self.state.displacement.iter_mut().zip(&at_rest.displacement) {
            *u = P::Field::from_f64(*value);
        }
        let cloud = &self.body.cloud;
        let forces = components_mut::<D, _>(&mut self.state.force).into_iter().zip(components::<D, _>(&at_rest.total));
        for (force, total) in forces {
            for &slot in &cloud.slots {
                force[slot as usize] = P::Field::from_f64(total[slot as usize] / cloud.volume(slot as usize));
            }
        }
        log.time = reached;
        let halvings = log.halvings;
        self.load_steps.push(log);
        match failed {
            None => Ok(true),
            Some(Unrest::Interrupted) if reached == start => {
                *clock = began;
                Ok(false)
            }
            Some(unrest) => {
                clock.halt(reached);
                if unrest == Unrest::Interrupted {
                    return Ok(false);
                }
                let tried = format!(" (load steps down to 1/{:.0} did no better)", 1.0 / SMALLEST_STEP);
                let cause = format!("{unrest}{}", if unrest.stays() || halvings == 0 { "" } else { &tried });
                let (field, value, step) = ("the imbalance of forces over loads", unrest.imbalance(), clock.step);
                let time = reached;
                Err(Error::Numbers(Box::new(NumericalStop { step, time, field, value, point: None, cause })))
            }
        }
    }
}

/// Of a load step: smaller ones are not tried.
const SMALLEST_STEP: f64 = 1.0 / 1024.0;
/// By how much a load step may strain bonds beyond their critical strain before the first of them breaks: they hold twice
/// this share of energy too much.
const EXCESS: f64 = 0.005;
/// Bonds break together whose excess is more than this share of the largest.
const WORST: f64 = 0.5;

/// The books of a load step.
#[derive(Clone)]
struct Books {
    state: Resting,
    work: Work,
    broken: Broken,
}

impl Books {
    fn new<const D: usize, L: BondLaw<D>>(rest: &mut Rest<'_, D, L>) -> Self {
        Books { state: rest.resting(), work: Work::default(), broken: Broken::default() }
    }

    /// Brings the body to rest at time `t`, bonds broken until none is overstrained. False when the step is
    /// `divisible`, and went so far that bonds are strained well beyond where they should have broken.
    #[allow(clippy::too_many_arguments)] // a step, how it is taken, and who is told of it
    fn advance<const D: usize, L: BondLaw<D>>(
        &mut self,
        rest: &mut Rest<'_, D, L>,
        statics: &Statics,
        failure: Option<&CriticalStretch>,
        t: f64,
        divisible: bool,
        log: &mut LoadStep,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<bool, Unrest> {
        let mut first = true;
        loop {
            statics.solve(rest, t, log, observe)?;
            rest.time = t;
            let state = rest.resting();
            let work = rest.work(&self.state, &state);
            self.state = state;
            self.work.external += work.external;
            self.work.lost += work.lost;
            let Some(failure) = failure else { return Ok(true) };
            let worst = rest.worst(failure);
            if worst <= 1.0 {
                return Ok(true);
            }
            if first && divisible && worst > 1.0 + EXCESS {
                return Ok(false);
            }
            first = false;
            let broken = rest.break_beyond(failure, 1.0 + WORST * (worst - 1.0));
            self.broken.bonds += broken.bonds;
            self.broken.energy += broken.energy;
            self.state = rest.resting();
        }
    }
}

/// Bonds whose strain passes `limit` times the critical one.
struct Overstrained<'a, const D: usize, L> {
    failure: &'a CriticalStretch,
    law: L,
    displacement: [&'a [f64]; D],
    limit: f64,
    /// Bits of the largest strain over the critical one: those of positive numbers ascend with them.
    largest: &'a AtomicU64,
}

impl<const D: usize, L: BondLaw<D>> BreakRule<D> for Overstrained<'_, D, L> {
    fn threshold(&self) -> f64 {
        self.law.strain_at(self.failure.smallest())
    }

    fn breaks(&self, here: usize, there: usize, strain: f64) -> bool {
        let ratio = strain / self.law.strain_at(self.failure.of(here, there));
        self.largest.fetch_max(ratio.to_bits(), Ordering::Relaxed);
        ratio > self.limit
    }

    /// Half of what the bond holds.
    fn released(&self, bond: &Bond<D, f64>, here: usize, there: usize) -> f64 {
        let eta = std::array::from_fn(|d| self.displacement[d][there] - self.displacement[d][here]);
        0.5 * self.law.energy(bond, self.law.strain(bond, &eta))
    }
}

impl<const D: usize, L: BondLaw<D>> Equilibrium for Rest<'_, D, L> {
    fn size(&self) -> usize {
        self.displacement.len()
    }

    fn displacement(&mut self) -> &mut [f64] {
        &mut self.displacement
    }

    fn pose(&mut self, t: f64) -> Vec<f64> {
        let n = self.body.cloud.n_slots();
        self.load.fill(0.0);
        for load in self.loads.iter_mut() {
            let component = &mut self.load[load.component * n..][..n];
            load.each(t, |slot, b| component[slot] += b);
        }
        let mut load = std::mem::take(&mut self.load);
        self.times_volume(&mut load);
        self.load = load;
        self.classify(t);
        let mut way = vec![0.0; self.displacement.len()];
        for p in self.prescribed.iter_mut().filter(|p| p.holds(t)) {
            // A velocity is the rate of a displacement, whatever time stands for.
            let (at, step) = match p.quantity {
                Quantity::Displacement => (t, None),
                Quantity::Velocity => (0.5 * (self.time + t), Some(t - self.time)),
            };
            for (&slot, value) in p.slots.iter().zip(p.profile.at(at)) {
                let k = p.component * n + slot as usize;
                way[k] = step.map_or(value - self.displacement[k], |step| step * value);
            }
        }
        way
    }

    fn imbalance(&mut self, r: &mut [f64]) -> f64 {
        self.internal(r);
        vector::add(1.0, &self.load, r);
        let sizes = self.kind.iter().zip(&*r).zip(&self.load);
        let [reactions, loads] = sizes.fold([0.0, 0.0], |[reactions, loads], ((kind, r), load)| match kind {
            Kind::Free => [reactions, loads + load * load],
            Kind::Held => [reactions + r * r, loads],
            Kind::Absent => [reactions, loads],
        });
        self.keep_free(r);
        f64::sqrt(reactions).max(f64::sqrt(loads))
    }

    fn tangent(&mut self, x: &[f64], y: &mut [f64]) {
        self.change(x, y);
        vector::scale(-1.0, y);
        self.keep_free(y);
    }

    fn diagonal(&mut self) -> Vec<f64> {
        let mut diagonal = vec![0.0; self.displacement.len()];
        self.physics.diagonal(self.body, self.exec, self.states, components_mut::<D, _>(&mut diagonal));
        self.times_volume(&mut diagonal);
        for (value, kind) in diagonal.iter_mut().zip(&self.kind) {
            if *kind != Kind::Free || *value <= 0.0 {
                *value = 1.0;
            }
        }
        diagonal
    }

    fn block_diagonal(&mut self) -> Result<Box<dyn Preconditioner>, LinearError> {
        let n = self.body.cloud.n_slots();
        let rows: [Vec<f64>; D] = std::array::from_fn(|row| {
            let mut sums = vec![0.0; D * n];
            let parts = components_mut::<D, _>(&mut sums);
            self.physics.diagonal_row(row, self.body, self.exec, self.states, parts);
            sums
        });
        let entry = |slot: usize, c: usize, d: usize| {
            let [here, there] = [c, d].map(|c| self.kind[c * n + slot] == Kind::Free && rows[c][c * n + slot] > 0.0);
            match (here && there, c == d) {
                (true, true) => rows[c][c * n + slot] * self.body.cloud.volume(slot),
                (true, false) => COUPLED * rows[c][d * n + slot] * self.body.cloud.volume(slot),
                (false, same) => f64::from(u8::from(same)),
            }
        };
        let block = |slot| std::array::from_fn(|c| std::array::from_fn(|d| entry(slot, c, d)));
        let blocks: Vec<[[f64; D]; D]> = (0..n).map(block).collect();
        Ok(Box::new(BlockJacobi::new(&blocks, Layout::ByComponent)?))
    }

    fn assemble(&mut self) -> Sparse {
        let (cloud, n) = (&self.body.cloud, self.body.cloud.n_slots());
        let rest = vec![0.0; if self.linearised { D * n } else { 0 }];
        let u = if self.linearised { &rest } else { &self.displacement };
        let bonds = self.physics.stiffness(self.body, self.states, components::<D, _>(u));
        let free = |d: usize, slot: usize| self.kind[d * n + slot] == Kind::Free;
        let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for c in 0..D {
            for (here, bonds) in bonds.iter().enumerate() {
                if free(c, here) {
                    let volume = cloud.volume(here);
                    for d in 0..D {
                        // The point itself stands among its neighbours, by its slot.
                        let own = bonds.iter().map(|(_, block)| block[c][d]).sum::<f64>();
                        let before = bonds.partition_point(|(there, _)| (*there as usize) < here);
                        let entry = |(there, block): &(u32, [[f64; D]; D])| (*there as usize, -block[c][d]);
                        let others = bonds[..before].iter().map(entry);
                        for (there, value) in others.chain([(here, own)]).chain(bonds[before..].iter().map(entry)) {
                            if free(d, there) {
                                columns.push((d * n + there) as u32);
                                values.push(volume * value);
                            }
                        }
                    }
                } else {
                    columns.push((c * n + here) as u32);
                    values.push(1.0);
                }
                starts.push(columns.len() as u64);
            }
        }
        Sparse::from_rows(starts, columns, values)
    }

    fn floating(&self) -> NullSpace {
        let cloud = &self.body.cloud;
        let (low, high) = cloud.bounds();
        let centre: [f64; D] = std::array::from_fn(|d| 0.5 * (low[d] + high[d]));
        let size = (0..D).map(|d| high[d] - low[d]).fold(cloud.spacing, f64::max);
        let planes: Vec<[usize; 2]> = (0..D).flat_map(|a| (a + 1..D).map(move |b| [a, b])).collect();
        // Component d of motion m at x: a translation, or a rotation in a plane of two axes.
        let motion = |m: usize, d: usize, x: &[f64; D]| match m.checked_sub(D) {
            None => f64::from(u8::from(m == d)),
            Some(plane) => {
                let [a, b] = planes[plane];
                let arm = |axis: usize| (x[axis] - centre[axis]) / size;
                if d == a {
                    arm(b)
                } else if d == b {
                    -arm(a)
                } else {
                    0.0
                }
            }
        };
        let n = cloud.n_slots();
        let mut held = Vec::new();
        for d in 0..D {
            let of_axis = |kind: Kind| cloud.slots.iter().filter(move |&&s| self.kind[d * n + s as usize] == kind);
            held.extend(of_axis(Kind::Held).map(|&slot| (d, cloud.position(slot as usize))));
        }
        // The combinations of motions that leave every held unknown where it is: motions are made independent on the
        // held unknowns, one after the other; what is left of one that depends on those before it is such a combination.
        let count = D + planes.len();
        let mut independent: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
        let mut free = Vec::new();
        for m in 0..count {
            let mut weights = vec![0.0; count];
            weights[m] = 1.0;
            let mut there: Vec<f64> = held.iter().map(|(d, x)| motion(m, *d, x)).collect();
            let whole = vector::norm(&there);
            for _ in 0..2 {
                for (unit, of) in &independent {
                    let share = vector::dot(unit, &there);
                    vector::add(-share, unit, &mut there);
                    vector::add(-share, of, &mut weights);
                }
            }
            let left = vector::norm(&there);
            if left > DEPENDENT * whole {
                vector::scale(1.0 / left, &mut there);
                vector::scale(1.0 / left, &mut weights);
                independent.push((there, weights));
            } else {
                free.push(weights);
            }
        }
        let field = |weights: Vec<f64>| {
            let mut field = vec![0.0; self.displacement.len()];
            for &slot in &cloud.slots {
                let x = cloud.position(slot as usize);
                for d in 0..D {
                    let k = d * n + slot as usize;
                    if self.kind[k] == Kind::Free {
                        field[k] = (0..count).map(|m| weights[m] * motion(m, d, &x)).sum();
                    }
                }
            }
            field
        };
        NullSpace::new(free.into_iter().map(field).collect())
    }

    fn is_linear(&self) -> bool {
        L::LINEAR || self.linearised
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::{Influence, Operator, PartialVolume, standard};
    use crate::geometry::{Arrangement, Cloud, Crack, Shape};
    use crate::physics::elasticity::bond_based::{BondBased, BondBasedLinear};
    use crate::solver::linear::LinearOperator;

    /// Random displacements of a fiftieth of a spacing on a cracked body with held unknowns; the share by which the products
    /// of the assembled tangent differ from those without a matrix, and its asymmetry.
    fn difference<const D: usize, L: BondLaw<D>>(law: L, scattered: bool) -> f64 {
        let shape = Shape::Box { low: [0.0; D], high: [if D == 3 { 7.0 } else { 20.0 }; D] };
        let rule = PartialVolume::Ramp;
        let mut cloud = Cloud::lattice(&shape, 1.0, 3);
        if scattered {
            let places = (0..cloud.n_points()).map(|i| cloud.position(cloud.slots[i] as usize));
            let moved =
                places.enumerate().map(|(i, x)| std::array::from_fn(|d| x[d] + 0.2 * vector::scattered(3 * i + d)));
            cloud = Cloud::scattered(moved.collect(), vec![1.0; cloud.n_points()]);
        }
        let body = standard::body(cloud, 2.6, rule);
        let operator = Operator::standard(&body, 1.0, Influence::Linear, rule);
        let physics = Elasticity { law, density: 1.0, operator, failure: None, state_based: None };
        let mut states = BondStates::whole(&body);
        if let Some(crack) = (D == 2).then(|| Crack::Polyline(vec![[0.0, 5.2], [9.1, 5.2]])) {
            assert!(states.cut(&body, &crack, 1e-9) > 0);
        }
        let n = D * body.cloud.n_slots();
        assert!(matches!(body.cloud.arrangement, Arrangement::Lattice(_)) != scattered);
        let u = (0..n).map(|k| 0.02 * vector::scattered(k)).collect();
        let mut exec = Exec::default();
        let mut rest = Rest::new(&body, &physics, &mut states, &mut [], &mut [], &mut exec, u, false);
        rest.pose(0.0);
        for k in (0..n).step_by(7) {
            if rest.kind[k] == Kind::Free {
                rest.kind[k] = Kind::Held;
            }
        }
        let mut x: Vec<f64> = (0..n).map(|k| vector::scattered(n + k)).collect();
        rest.keep_free(&mut x);
        let [mut free, mut assembled] = [vec![0.0; n], vec![0.0; n]];
        rest.tangent(&x, &mut free);
        let mut matrix = rest.assemble();
        matrix.apply(&x, &mut assembled);
        let size = vector::norm(&free);
        vector::add(-1.0, &free, &mut assembled);
        // Both ends of a bond compute the same numbers.
        assert!(matrix.is_symmetric(1e-15));
        let share = vector::norm(&assembled) / size;
        println!("{D}D, scattered {scattered}, linear {}: {share:e}", L::LINEAR);
        share
    }

    #[test]
    fn the_assembled_tangent_is_the_one_without_a_matrix() {
        for scattered in [false, true] {
            // Some hundred roundings a sum.
            assert!(difference::<1, _>(BondBasedLinear, scattered) < 1e-14);
            assert!(difference::<2, _>(BondBasedLinear, scattered) < 1e-14);
            assert!(difference::<3, _>(BondBasedLinear, scattered) < 1e-14);
            // The products without a matrix are difference quotients: ends of a bond of one spacing move apart by twice
            // `DIFFERENCE`, which bends the law by the square of that.
            let bent = f64::powi(2.0 * DIFFERENCE, 2);
            assert!(difference::<1, _>(BondBased, scattered) < bent);
            assert!(difference::<2, _>(BondBased, scattered) < bent);
            assert!(difference::<3, _>(BondBased, scattered) < bent);
        }
    }
}
