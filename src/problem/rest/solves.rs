//! Bonds that break one by one where no factor of a zone serves: by a linear solver, the whole body each time.

use std::sync::atomic::{AtomicU64, Ordering};

use super::walk::{BySolver, Walk};
use super::zone::{Order, TIE, breaks_with};
use super::{Books, StaticSystem};
use crate::solver::linear_solver::LinearSolver;
use crate::solver::newton::NotConverged;
use crate::solver::statics::{Breaking, LoadStep};

/// Of the tolerance of forces: bonds strained alike to this multiple break together, since each strain has the error of a
/// solution.
const ERRORS: f64 = 10.0;
/// Where forces are not linear, by how much the strain of the bond that breaks may miss the critical one.
const MISSED: f64 = 1e-5;
/// Ways to the next break that are tried before it is given up to be nearer.
const TRIES: usize = 40;

/// Takes the body along its way to the end of the load step, and books it.
///
/// # Errors
/// As of the linear solver; no balance. The walk keeps the last state at rest.
#[allow(clippy::too_many_arguments)] // a body, its way, how it is solved and breaks, and who is told of it
pub(super) fn follow(
    rest: &mut StaticSystem<'_>,
    walk: &mut Walk,
    (solver, breaking): (&LinearSolver, &Breaking),
    tolerance: f64,
    books: &mut Books,
    log: &mut LoadStep,
    observe: &mut dyn FnMut(usize, f64) -> bool,
) -> Result<(), NotConverged> {
    let mut inverse = BySolver::new(solver, rest);
    let result = grow(rest, walk, &mut inverse, breaking, tolerance, books, log, observe);
    log.linear_iterations += inverse.iterations;
    log.iterations += std::mem::take(&mut walk.corrections);
    log.imbalance = walk.imbalance;
    result
}

#[allow(clippy::too_many_arguments)]
fn grow(
    rest: &mut StaticSystem<'_>,
    walk: &mut Walk,
    inverse: &mut BySolver<'_>,
    breaking: &Breaking,
    tolerance: f64,
    books: &mut Books,
    log: &mut LoadStep,
    observe: &mut dyn FnMut(usize, f64) -> bool,
) -> Result<(), NotConverged> {
    let (tie, linear, goals) = (TIE.max(ERRORS * tolerance), rest.body.is_linear(), [tolerance; 2]);
    books.state = rest.resting();
    walk.look(rest, inverse, goals, observe)?;
    books.go_on(rest);
    walk.keep(rest, books);
    let (mut limit, mut tries) = (walk.end, 0);
    loop {
        let order = Order { control: breaking.control, now: walk.now, length: walk.end - walk.start };
        let next = {
            let (u, v) = (&rest.displacement, &walk.velocity);
            let ahead = rest.body.stretched(u, v, &|s, rate, critical| order.of(s, rate, critical).is_some());
            order.first(ahead.iter().enumerate().map(|(k, bond)| (k, [bond.stretch, bond.rate], bond.critical)))
        };
        let (before, time) = (walk.now, next.map_or(limit, |next| next.time.min(limit)));
        let ratio = worst(rest, walk);
        let mut reached = ratio;
        if time != before {
            walk.go(rest, time);
            let moved = if linear { Ok(()) } else { walk.look(rest, inverse, goals, observe) };
            let share = match moved {
                Ok(()) => {
                    reached = worst(rest, walk);
                    let too_far = !linear && time > before && reached > 1.0 + MISSED;
                    // Where a straight line between both ends has the break; half of the way where that has led nowhere.
                    too_far.then(|| if tries < 3 { (1.0 - ratio) / (reached - ratio) } else { 0.5 })
                }
                Err(NotConverged::Interrupted) => return Err(NotConverged::Interrupted),
                Err(unrest) if time <= before || tries >= TRIES || unrest.stays() => return Err(unrest),
                Err(_) => Some(0.5),
            };
            if let Some(share) = share.filter(|_| tries < TRIES) {
                walk.restore(rest, books);
                limit = before + share.clamp(0.0, 1.0) * (time - before);
                tries += 1;
                continue;
            }
            books.go_on(rest);
            walk.keep(rest, books);
        }
        let due = if linear { next.is_some_and(|next| next.time <= time) } else { reached > 1.0 - MISSED };
        // Loads that follow have not fallen as far as the tangent has said.
        let above = !linear && time < before && reached > 1.0 + MISSED && tries < TRIES;
        if !due || above {
            if !due && time >= walk.end {
                return Ok(());
            }
            tries += usize::from(above);
            limit = walk.end;
            continue;
        }
        let worst = reached;
        (limit, tries) = (walk.end, 0);
        let with = |s: f64, _: f64, critical: f64| breaks_with(breaking.together, tie, worst, s / critical);
        let group = rest.body.stretched(&rest.displacement, &walk.velocity, &with);
        let group: Vec<usize> = group.iter().map(|bond| bond.bit).collect();
        log.note([walk.now, walk.power(rest)[0], 0.5 * books.broken.bonds as f64]);
        let broken = rest.body.break_bonds(&rest.displacement, &group);
        books.broken.bonds += broken.bonds;
        books.broken.energy += broken.energy;
        books.state = rest.resting();
        walk.look(rest, inverse, goals, observe)?;
        books.go_on(rest);
        walk.keep(rest, books);
    }
}

/// The largest stretch of a bond over its critical stretch.
fn worst(rest: &mut StaticSystem<'_>, walk: &Walk) -> f64 {
    let largest = AtomicU64::new(0);
    let note = |s: f64, _: f64, critical: f64| {
        // Bits of positive numbers ascend with them.
        if s > 0.0 {
            largest.fetch_max((s / critical).to_bits(), Ordering::Relaxed);
        }
        false
    };
    rest.body.stretched(&rest.displacement, &walk.velocity, &note);
    f64::from_bits(largest.into_inner())
}
