//! The straight way of a load step: from the conditions at its start to those at its end, in proportion to time, with the body at
//! rest all along.
//!
//! Between two breaks u(t) = u(t₀) + (t − t₀) v, where v = du/dt balances the rates of loads and prescribed displacements. It is
//! exact for linear forces, and along the tangent for others. Where everything given is proportional to time itself, u = t v.

use super::{Books, Kind, StaticSystem};
use crate::solver::linear::{NullSpace, vector};
use crate::solver::linear_solver::{LinearSolver, Prepared};
use crate::solver::newton::{Equilibrium, NotConverged, UNBALANCED};

/// A way to solve A x = r with the tangent of a body as it is.
pub(super) trait Inverse {
    /// r → x, to about `share` of |r|.
    fn apply(
        &mut self,
        rest: &mut StaticSystem<'_>,
        r: &mut [f64],
        share: f64,
        told: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<(), NotConverged>;
}

/// A load step, and where on its way the body is.
pub(super) struct Walk {
    /// s
    pub start: f64,
    pub end: f64,
    pub now: f64,
    /// When the displacements of the body are those at rest, s: at the last look.
    pub placed: f64,
    /// Loads at the start (N), and how fast they and prescribed displacements change, N/s and m/s.
    load: Vec<f64>,
    pub load_rate: Vec<f64>,
    pub drift: Vec<f64>,
    /// v, m/s.
    pub velocity: Vec<f64>,
    /// Everything given is proportional to time, and forces are linear.
    pub proportional: bool,
    /// The diagonal of the tangent at the start, N/m: what forces are rounded at.
    stiffness: Vec<f64>,
    /// Corrections of displacements so far.
    pub corrections: usize,
    /// |r| over loads or reactions after the last correction.
    pub imbalance: f64,
    checked: bool,
    /// The last state at rest.
    kept: Option<Kept>,
}

/// A state at rest, to which a walk that fails goes back.
struct Kept {
    displacement: Vec<f64>,
    velocity: Vec<f64>,
    time: f64,
    words: Vec<u16>,
    books: Books,
}

/// Of values that should be proportional to time: what rounding leaves.
const ROUNDED: f64 = 1e-12;
/// Of the products of the diagonal of the tangent and displacements: roundings that a sum of forces may have.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// The same of a tangent that is a difference quotient.
const QUOTIENT: f64 = 1e-10;
/// Corrections in one place, each of which must make what is left smaller by a half.
const CORRECTIONS: usize = 60;
/// What a linear solver leaves of what is out of balance where forces are not linear.
const FORCING: f64 = 1e-4;
/// A rigid motion is looked for in what is out of balance only where that is a share of the loads.
const SEEN: f64 = 1e-6;

impl Walk {
    /// From the body as it is at time `start`; afterwards its conditions are those of that time, except that what has ended by
    /// the end of the step holds no more.
    pub fn begin(rest: &mut StaticSystem<'_>, start: f64, end: f64) -> Self {
        rest.time = start;
        rest.pose(start);
        let load = rest.load.clone();
        let mut drift = rest.pose(end);
        let per_second = 1.0 / (end - start);
        vector::scale(per_second, &mut drift);
        let load_rate: Vec<f64> = rest.load.iter().zip(&load).map(|(to, from)| per_second * (to - from)).collect();
        rest.load.copy_from_slice(&load);
        let alike = |now: f64, rate: f64| (now - start * rate).abs() <= ROUNDED * now.abs().max((end * rate).abs());
        let given = rest.kind.iter().enumerate().all(|(k, kind)| match kind {
            Kind::Free => alike(load[k], load_rate[k]),
            Kind::Held => alike(rest.displacement[k], drift[k]),
            Kind::Absent => true,
        });
        let (n, stiffness) = (rest.displacement.len(), rest.diagonal());
        Walk {
            start,
            end,
            now: start,
            placed: start,
            load,
            load_rate,
            drift,
            velocity: vec![0.0; n],
            proportional: given && rest.is_linear(),
            stiffness,
            corrections: 0,
            imbalance: 0.0,
            checked: false,
            kept: None,
        }
    }

    /// Goes along v to time `t`.
    pub fn go(&mut self, rest: &mut StaticSystem<'_>, t: f64) {
        if self.proportional {
            rest.displacement.iter_mut().zip(&self.velocity).for_each(|(u, v)| *u = t * v);
        } else {
            vector::add(t - self.placed, &self.velocity, &mut rest.displacement);
        }
        (self.now, self.placed) = (t, t);
        self.apply_loads(rest);
    }

    /// Keeps the state, which is at rest and booked.
    pub fn keep(&mut self, rest: &StaticSystem<'_>, books: &Books) {
        self.kept = Some(Kept {
            displacement: rest.displacement.clone(),
            velocity: self.velocity.clone(),
            time: self.now,
            words: rest.body.words().to_vec(),
            books: books.clone(),
        });
    }

    /// Goes back to the state that was kept.
    pub fn restore(&mut self, rest: &mut StaticSystem<'_>, books: &mut Books) {
        let Some(kept) = &self.kept else { return };
        rest.displacement.copy_from_slice(&kept.displacement);
        rest.body.words_mut().copy_from_slice(&kept.words);
        self.velocity.copy_from_slice(&kept.velocity);
        books.clone_from(&kept.books);
        (self.now, self.placed) = (kept.time, kept.time);
        self.apply_loads(rest);
    }

    /// Power of prescribed displacements less that of loads which change where the body stands, J/s, and how it changes along v,
    /// J/s².
    pub fn power(&self, rest: &mut StaticSystem<'_>) -> [f64; 2] {
        let n = rest.displacement.len();
        let (mut force, mut change) = (vec![0.0; n], vec![0.0; n]);
        rest.internal(&mut force);
        rest.change(&self.velocity, &mut change);
        let [mut power, mut slope] = [0.0; 2];
        for (k, kind) in rest.kind.iter().enumerate() {
            match kind {
                Kind::Held => {
                    power -= force[k] * self.drift[k];
                    slope -= change[k] * self.drift[k];
                }
                Kind::Free => {
                    power -= self.load_rate[k] * rest.displacement[k];
                    slope -= self.load_rate[k] * self.velocity[k];
                }
                Kind::Absent => {}
            }
        }
        [power, slope]
    }

    fn apply_loads(&self, rest: &mut StaticSystem<'_>) {
        rest.time = self.now;
        rest.load.copy_from_slice(&self.load);
        vector::add(self.now - self.start, &self.load_rate, &mut rest.load);
    }

    /// Brings u to rest where it is, and turns v to the tangent there; to `goal`, or to `tolerance` where rounding is in the way.
    ///
    /// # Errors
    /// As of `inverse`; no balance; loads that nothing balances.
    pub fn look(
        &mut self,
        rest: &mut StaticSystem<'_>,
        inverse: &mut dyn Inverse,
        [goal, tolerance]: [f64; 2],
        told: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<(), NotConverged> {
        if !self.proportional {
            self.settle(rest, inverse, [goal, tolerance], told)?;
        }
        for (k, kind) in rest.kind.iter().enumerate().filter(|(_, kind)| **kind != Kind::Free) {
            self.velocity[k] = if *kind == Kind::Held { self.drift[k] } else { 0.0 };
        }
        self.balance(rest, inverse, [goal, tolerance], true, told)?;
        if self.proportional {
            let now = self.now;
            self.go(rest, now);
        }
        Ok(())
    }

    /// Brings u to rest where it is.
    ///
    /// # Errors
    /// As [`look`](Self::look).
    pub fn settle(
        &mut self,
        rest: &mut StaticSystem<'_>,
        inverse: &mut dyn Inverse,
        tolerances: [f64; 2],
        told: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<(), NotConverged> {
        self.balance(rest, inverse, tolerances, false, told)
    }

    fn balance(
        &mut self,
        rest: &mut StaticSystem<'_>,
        inverse: &mut dyn Inverse,
        [goal, tolerance]: [f64; 2],
        rates: bool,
        told: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<(), NotConverged> {
        let mut r = vec![0.0; rest.displacement.len()];
        let rounding = if rates && !rest.body.is_linear() { QUOTIENT } else { ROUNDING };
        let mut last = f64::INFINITY;
        for iteration in 0.. {
            let scale = if rates { self.rate_of_imbalance(rest, &mut r) } else { rest.imbalance(&mut r) };
            let vector = if rates { &mut self.velocity } else { &mut rest.displacement };
            let forces = self.stiffness.iter().zip(&*vector).map(|(k, x)| (k * x).powi(2)).sum::<f64>().sqrt();
            let (size, floor) = (vector::norm(&r), rounding * forces);
            if !size.is_finite() {
                return Err(NotConverged::NotFinite);
            }
            let left = if size <= floor { 0.0 } else { size / scale };
            if !rates || self.proportional {
                self.imbalance = left;
            }
            if size <= goal * scale + floor {
                return Ok(());
            }
            let known = scale.max(size);
            if !self.checked && size > SEEN * known {
                self.checked = true;
                let share = rest.floating().balance(&mut r);
                if share > UNBALANCED {
                    return Err(NotConverged::Unbalanced(share));
                }
            }
            if iteration > 0 && (size > 0.5 * last || iteration == CORRECTIONS) {
                // What a tangent is off by does not change where the body rests.
                let enough = if rates && !rest.body.is_linear() { tolerance.max(SEEN) } else { tolerance };
                let residual = size / scale;
                return if residual <= enough {
                    Ok(())
                } else {
                    Err(NotConverged::Iterations { iterations: iteration, residual })
                };
            }
            last = size;
            let share = (0.2 * (goal * scale).max(floor) / size).clamp(1e-15, 0.1);
            // A tangent that is a difference quotient knows no more digits, and the next correction makes up for it.
            let share = if rest.body.is_linear() { share } else { share.max(FORCING) };
            inverse.apply(rest, &mut r, share, told)?;
            vector::add(1.0, &r, if rates { &mut self.velocity } else { &mut rest.displacement });
            self.corrections += 1;
        }
        Ok(())
    }

    /// d(r)/dt along v, N/s, and what it is measured against.
    fn rate_of_imbalance(&self, rest: &mut StaticSystem<'_>, r: &mut [f64]) -> f64 {
        rest.change(&self.velocity, r);
        let (mut reactions, mut loads) = (0.0, 0.0);
        for (k, kind) in rest.kind.iter().enumerate() {
            match kind {
                Kind::Free => {
                    r[k] += self.load_rate[k];
                    loads += self.load_rate[k] * self.load_rate[k];
                }
                Kind::Held => {
                    reactions += r[k] * r[k];
                    r[k] = 0.0;
                }
                Kind::Absent => r[k] = 0.0,
            }
        }
        f64::sqrt(reactions).max(f64::sqrt(loads))
    }
}

/// By a linear solver of the case.
pub(super) struct BySolver<'a> {
    solver: &'a LinearSolver,
    space: NullSpace,
    prepared: Option<Prepared>,
    /// Iterations so far.
    pub iterations: usize,
}

/// An approximate inverse that was made before bonds broke serves while the linear solver takes no more iterations than this.
const STALE: usize = 30;

impl<'a> BySolver<'a> {
    pub fn new(solver: &'a LinearSolver, rest: &StaticSystem<'_>) -> Self {
        BySolver { solver, space: rest.floating(), prepared: None, iterations: 0 }
    }
}

impl Inverse for BySolver<'_> {
    fn apply(
        &mut self,
        rest: &mut StaticSystem<'_>,
        r: &mut [f64],
        share: f64,
        told: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<(), NotConverged> {
        let mut x = vec![0.0; r.len()];
        self.space.balance(r);
        let mut solve = |prepared: &mut Prepared, r: &[f64]| {
            let done = self.iterations;
            let mut told = |k, residual| told(done + k, residual);
            self.solver.solve(rest, prepared, &self.space, r, &mut x, share, &mut told)
        };
        // With the product of now, whatever the preconditioner was made for.
        if let Some(mut prepared) = self.prepared.take() {
            match solve(&mut prepared, r) {
                Ok(solved) => {
                    self.iterations += solved.iterations;
                    if !(self.solver.assembles() && solved.iterations > STALE) {
                        self.prepared = Some(prepared);
                    }
                    r.copy_from_slice(&x);
                    return Ok(());
                }
                Err(error) => match NotConverged::from(error) {
                    NotConverged::Interrupted => return Err(NotConverged::Interrupted),
                    other if !self.solver.assembles() => return Err(other),
                    _ => {}
                },
            }
        }
        let mut prepared = self.solver.prepare(rest, &self.space, None)?;
        prepared.forget_matrix();
        let mut told = |k, residual| told(self.iterations + k, residual);
        let solved = self.solver.solve(rest, &mut prepared, &self.space, r, &mut x, share, &mut told)?;
        self.iterations += solved.iterations;
        self.prepared = Some(prepared);
        r.copy_from_slice(&x);
        Ok(())
    }
}
