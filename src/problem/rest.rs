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
use crate::solver::linear::{NullSpace, vector};
use crate::solver::newton::{Equilibrium, Unrest};
use crate::solver::{Clock, Statics};

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
        for p in self.prescribed.iter().filter(|p| t <= p.until) {
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
    /// # Errors
    /// [`Error::Numbers`] when no smaller step succeeds either; the state is then the last one at rest.
    pub(super) fn settle(&mut self, statics: &Statics, clock: &mut Clock) -> Result<()> {
        let start = clock.time();
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
        while rest.time < end && failed.is_none() {
            let next = if rest.time + 1.001 * step < end { rest.time + step } else { end };
            let (saved, before) = (rest.saved(), books.clone());
            let divisible = 0.5 * (next - rest.time) >= SMALLEST_STEP * (end - start);
            match books.advance(&mut rest, statics, failure, next, divisible) {
                Ok(true) => step *= 2.0,
                // Too far, or not at all: once more, half as far.
                Ok(false) | Err(_) if divisible => {
                    rest.restore(saved);
                    books = before;
                    step = 0.5 * (next - rest.time);
                }
                Err(unrest) => {
                    rest.restore(saved);
                    books = before;
                    failed = Some((rest.time, unrest));
                }
                Ok(false) => unreachable!("only a step that can be divided goes too far"),
            }
        }
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
        match failed {
            None => Ok(()),
            Some((time, unrest)) => {
                let cause = format!("{unrest} (load steps down to 1/{:.0} did no better)", 1.0 / SMALLEST_STEP);
                let (field, value, step) = ("the imbalance of forces over loads", unrest.imbalance(), clock.step);
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
    fn advance<const D: usize, L: BondLaw<D>>(
        &mut self,
        rest: &mut Rest<'_, D, L>,
        statics: &Statics,
        failure: Option<&CriticalStretch>,
        t: f64,
        divisible: bool,
    ) -> Result<bool, Unrest> {
        let mut first = true;
        loop {
            statics.solve(rest, t)?;
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
        for p in self.prescribed.iter_mut().filter(|p| t <= p.until) {
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
