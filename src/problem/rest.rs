//! A problem at rest: what the static solvers see of it, and the books of their steps.
//!
//! Always in double precision, whatever the fields are stored in. Unknowns are the displacements by slot, component
//! after component; forces are those on a point, N: force density times volume.

mod solves;
mod walk;
mod zone;

use walk::Walk;
pub(super) use zone::Crack;

use super::Problem;
use crate::conditions::{Constraint, Term};
use crate::error::{Error, NumericalStop, Result};
use crate::execution::Broken;
use crate::physics::Tangent;
use crate::solver::Clock;
use crate::solver::linear::{LinearError, NullSpace, Preconditioner, Sparse, vector};
use crate::solver::linear_solver;
use crate::solver::newton::{Equilibrium, Newton, NotConverged};
use crate::solver::statics::{Breaking, LoadStep, Method, Statics};

/// A body that a static solver brings to rest.
struct StaticSystem<'a> {
    body: &'a mut dyn Tangent,
    constraints: &'a mut [Box<dyn Constraint>],
    terms: &'a mut [Box<dyn Term>],
    /// Slots.
    n: usize,
    components: usize,
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
struct StaticState {
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

impl<'a> StaticSystem<'a> {
    fn new(
        body: &'a mut dyn Tangent,
        constraints: &'a mut [Box<dyn Constraint>],
        terms: &'a mut [Box<dyn Term>],
        linearised: bool,
    ) -> Self {
        let (displacement, components, slots) = (body.displacement(), body.components(), body.points().n_slots());
        let n = displacement.len();
        StaticSystem {
            body,
            constraints,
            terms,
            n: slots,
            components,
            linearised,
            displacement,
            load: vec![0.0; n],
            kind: vec![Kind::Absent; n],
            scratch: [vec![0.0; n], vec![0.0; n]],
            time: 0.0,
        }
    }

    /// What a failed step changes.
    fn saved(&self) -> (Vec<f64>, f64) {
        (self.displacement.clone(), self.time)
    }

    fn restore(&mut self, (displacement, time): (Vec<f64>, f64)) {
        self.displacement = displacement;
        self.time = time;
    }

    /// Change of the internal force by displacements `x` from those now, or from zero, to first order, N.
    fn change(&mut self, x: &[f64], change: &mut [f64]) {
        if self.body.is_linear() {
            return self.body.forces(x, change);
        }
        let largest = x.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
        if largest == 0.0 {
            return change.fill(0.0);
        }
        let h = DIFFERENCE * self.body.points().spacing() / largest;
        let [mut u, mut before] = std::mem::take(&mut self.scratch);
        for (sign, force) in [(1.0, &mut *change), (-1.0, &mut before)] {
            if self.linearised {
                u.fill(0.0);
            } else {
                u.copy_from_slice(&self.displacement);
            }
            vector::add(sign * h, x, &mut u);
            self.body.forces(&u, force);
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
            self.body.forces(&u, force)
        }
        self.displacement = u;
    }

    /// Which unknowns are free at time `t`.
    fn classify(&mut self, t: f64) {
        let (n, springs) = (self.n, self.body.diagonal());
        self.kind.fill(Kind::Absent);
        for &slot in self.body.points().slots() {
            for d in 0..self.components {
                let k = d * n + slot as usize;
                if springs[k] > 0.0 || self.load[k] != 0.0 {
                    self.kind[k] = Kind::Free;
                }
            }
        }
        for constraint in self.constraints.iter().filter(|constraint| constraint.holds(t)) {
            let (component, slots) = constraint.on();
            for &slot in slots {
                self.kind[component * n + slot as usize] = Kind::Held;
            }
        }
    }

    fn is_free(kind: &[Kind]) -> impl Fn(usize) -> bool {
        move |k| kind[k] == Kind::Free
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
    pub fn resting(&mut self) -> StaticState {
        let mut total = vec![0.0; self.displacement.len()];
        self.internal(&mut total);
        vector::add(1.0, &self.load, &mut total);
        StaticState { displacement: self.displacement.clone(), total, load: self.load.clone() }
    }

    /// Work from one state to another: mean forces along the way, exact for a linear law.
    pub fn work(&self, from: &StaticState, to: &StaticState) -> Work {
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
    pub fn react(&mut self, state: &StaticState) {
        let n = self.n;
        for constraint in self.constraints.iter_mut() {
            let (component, slots) = constraint.on();
            let reaction = -slots.iter().map(|&slot| state.total[component * n + slot as usize]).sum::<f64>();
            constraint.react(reaction);
        }
        let mut internal = state.total.clone();
        vector::add(-1.0, &state.load, &mut internal);
        self.terms.iter_mut().for_each(|term| term.settle(&internal, n));
    }
}

impl Problem {
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
        let Problem { physics, constraints, terms, crack, .. } = self;
        let body = physics.tangent().expect("checks have refused static solvers of what cannot rest");
        let mut rest = StaticSystem::new(body, constraints, terms, statics.linearised);
        let mut log = LoadStep { step: clock.step, ..LoadStep::default() };
        let (books, failed) = match (&statics.breaking, &statics.method) {
            (Some(breaking), Method::Newton(newton)) if rest.body.can_break() => {
                rest.crack(crack, (newton, breaking), [start, end], &mut log, observe)
            }
            _ => rest.advance(statics, [start, end], &mut log, observe),
        };
        let reached = rest.time;
        rest.react(&books.state);
        let Books { state: at_rest, work, broken } = books;
        self.physics.settle(&at_rest.displacement, &at_rest.total, broken);
        self.ledger.external += work.external;
        self.ledger.damped += work.lost;
        log.time = reached;
        log.broken = broken.bonds / 2;
        let halvings = log.halvings;
        self.load_steps.push(log);
        match failed {
            None => Ok(true),
            Some(NotConverged::Interrupted) if reached == start => {
                *clock = began;
                Ok(false)
            }
            Some(unrest) => {
                clock.end_step_at(reached);
                if unrest == NotConverged::Interrupted {
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
/// Unknowns up to which a factor is made where nobody has asked for one, in 1D and 2D.
const MANY: usize = 200_000;

/// The books of a load step.
#[derive(Debug, Clone)]
struct Books {
    state: StaticState,
    work: Work,
    broken: Broken,
}

impl Books {
    fn new(rest: &mut StaticSystem<'_>) -> Self {
        Books { state: rest.resting(), work: Work::default(), broken: Broken::default() }
    }

    /// Books the way from the state before to that of now.
    fn go_on(&mut self, rest: &mut StaticSystem<'_>) {
        let state = rest.resting();
        let work = rest.work(&self.state, &state);
        self.state = state;
        self.work.external += work.external;
        self.work.lost += work.lost;
    }
}

impl StaticSystem<'_> {
    /// Brings the body to rest at the end of a load step, by smaller steps where that fails; no bond breaks.
    fn advance(
        &mut self,
        statics: &Statics,
        [start, end]: [f64; 2],
        log: &mut LoadStep,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> (Books, Option<NotConverged>) {
        self.time = start;
        self.pose(start);
        let (mut books, mut step) = (Books::new(self), end - start);
        while self.time < end {
            let next = if self.time + 1.001 * step < end { self.time + step } else { end };
            let saved = self.saved();
            match statics.solve(self, next, log, observe) {
                Ok(()) => {
                    self.time = next;
                    books.go_on(self);
                    step *= 2.0;
                }
                Err(unrest) => {
                    let divisible = 0.5 * (next - self.time) >= SMALLEST_STEP * (end - start);
                    self.restore(saved);
                    if !divisible || unrest.stays() {
                        return (books, Some(unrest));
                    }
                    step = 0.5 * (next - self.time);
                    log.halvings += 1;
                }
            }
        }
        (books, None)
    }

    /// Brings the body to rest at the end of a load step, and all along the way; bonds break.
    fn crack(
        &mut self,
        crack: &mut Option<Box<Crack>>,
        (newton, breaking): (&Newton, &Breaking),
        [start, end]: [f64; 2],
        log: &mut LoadStep,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> (Books, Option<NotConverged>) {
        let mut walk = Walk::begin(self, start, end);
        let mut books = Books::new(self);
        walk.keep(self, &books);
        let mut result = Err(None);
        let zone = breaking.factored && self.components < 3 && self.floating().basis().is_empty();
        if zone && (newton.linear.method == linear_solver::Method::Direct || self.displacement.len() <= MANY) {
            let known = crack.take().and_then(|mut crack| {
                crack.free(self);
                crack.fits(self).then_some(crack)
            });
            if let Some(mut following) = known.or_else(|| Crack::new(self).map(Box::new)) {
                following.free(self);
                let followed = following.follow(self, &mut walk, breaking, newton.tolerance, &mut books, log, observe);
                result = followed.map_err(Some);
                *crack = Some(following);
            }
        }
        if matches!(&result, Err(unrest) if unrest.as_ref().is_none_or(|unrest| !unrest.stays())) {
            // No factor, or one that leads nowhere any more: from the last state at rest.
            *crack = None;
            self.classify(end);
            walk.restore(self, &mut books);
            let how = (&newton.linear, breaking);
            result = solves::follow(self, &mut walk, how, newton.tolerance, &mut books, log, observe).map_err(Some);
        }
        let failed = result.err().flatten();
        if failed.is_some() {
            *crack = None;
            walk.restore(self, &mut books);
        }
        books.state = self.resting();
        (books, failed)
    }
}

impl Equilibrium for StaticSystem<'_> {
    fn size(&self) -> usize {
        self.displacement.len()
    }

    fn displacement(&mut self) -> &mut [f64] {
        &mut self.displacement
    }

    fn pose(&mut self, t: f64) -> Vec<f64> {
        self.load.fill(0.0);
        for term in self.terms.iter_mut() {
            term.force(t, &mut self.load, self.n);
        }
        // Force densities so far: their sum times the volume of the point.
        let points = self.body.points();
        for (k, load) in self.load.iter_mut().enumerate().filter(|(_, load)| **load != 0.0) {
            *load *= points.volume(k % self.n);
        }
        self.classify(t);
        let mut way = vec![0.0; self.displacement.len()];
        for constraint in self.constraints.iter_mut().filter(|constraint| constraint.holds(t)) {
            constraint.way([self.time, t], &self.displacement, &mut way, self.n);
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
        let mut diagonal = self.body.diagonal();
        let (points, n) = (self.body.points(), self.n);
        for (k, (value, kind)) in diagonal.iter_mut().zip(&self.kind).enumerate() {
            *value *= points.volume(k % n);
            if *kind != Kind::Free || *value <= 0.0 {
                *value = 1.0;
            }
        }
        diagonal
    }

    fn block_diagonal(&mut self) -> Result<Box<dyn Preconditioner>, LinearError> {
        self.body.block_diagonal(&Self::is_free(&self.kind))
    }

    fn assemble(&mut self) -> Sparse {
        let rest = vec![0.0; if self.linearised { self.displacement.len() } else { 0 }];
        let u = if self.linearised { &rest } else { &self.displacement };
        self.body.assemble(u, &Self::is_free(&self.kind))
    }

    fn floating(&self) -> NullSpace {
        let (points, n, axes) = (self.body.points(), self.n, self.components);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for &slot in points.slots() {
            for (d, x) in points.position(slot as usize).into_iter().enumerate() {
                (low[d], high[d]) = (low[d].min(x), high[d].max(x));
            }
        }
        let centre: [f64; 3] = std::array::from_fn(|d| 0.5 * (low[d] + high[d]));
        let size = (0..axes).map(|d| high[d] - low[d]).fold(points.spacing(), f64::max);
        let planes: Vec<[usize; 2]> = (0..axes).flat_map(|a| (a + 1..axes).map(move |b| [a, b])).collect();
        // Component d of motion m at x: a translation, or a rotation in a plane of two axes.
        let motion = |m: usize, d: usize, x: &[f64; 3]| match m.checked_sub(axes) {
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
        let mut held = Vec::new();
        for d in 0..axes {
            let of_axis = |kind: Kind| points.slots().iter().filter(move |&&s| self.kind[d * n + s as usize] == kind);
            held.extend(of_axis(Kind::Held).map(|&slot| (d, points.position(slot as usize))));
        }
        // What motions of images would differ from the images of motions: mirrors and periods hold a body too.
        let mut beyond = Vec::new();
        points.visit_images(&mut |image, source, signs| {
            beyond.push((points.position(image), points.position(source), signs));
        });
        // The combinations of motions that leave every held unknown where it is: motions are made independent on the
        // held unknowns, one after the other; what is left of one that depends on those before it is such a combination.
        let count = axes + planes.len();
        let mut independent: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
        let mut free = Vec::new();
        for m in 0..count {
            let mut weights = vec![0.0; count];
            weights[m] = 1.0;
            let mut there: Vec<f64> = held.iter().map(|(d, x)| motion(m, *d, x)).collect();
            let apart = |(image, source, signs): &([f64; 3], [f64; 3], [f64; 3])| {
                (0..axes).map(|d| motion(m, d, image) - signs[d] * motion(m, d, source)).collect::<Vec<f64>>()
            };
            there.extend(beyond.iter().flat_map(apart));
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
            for &slot in points.slots() {
                let x = points.position(slot as usize);
                for d in 0..axes {
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
        self.body.is_linear() || self.linearised
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::{Influence, Operator, PartialVolume, standard};
    use crate::family::BondLaw;
    use crate::field::Double;
    use crate::geometry::{Arrangement, Cloud, Crack, Shape};
    use crate::physics::elasticity::laws::{BondBased, BondBasedLinear};
    use crate::physics::elasticity::{Bonds, Elasticity};
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
        let mut body = Elasticity::<D, Double>::new(body, operator, Box::new(Bonds::new(law)), 1.0, None);
        if let Some(crack) = (D == 2).then(|| Crack::Polyline(vec![[0.0, 5.2], [9.1, 5.2]])) {
            assert!(body.cut(&[crack], 1e-9) > 0);
        }
        let n = D * body.body.cloud.n_slots();
        assert!(matches!(body.body.cloud.arrangement, Arrangement::Lattice(_)) != scattered);
        body.state.displacement = (0..n).map(|k| 0.02 * vector::scattered(k)).collect();
        let mut rest = StaticSystem::new(&mut body, &mut [], &mut [], false);
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
