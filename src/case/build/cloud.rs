//! Whether the points of a body and their cells make sense: volumes that fit the distances, no two points nearly in one place,
//! and neighbours for each.

use super::super::import;
use super::super::model;
use super::Builder;
use super::conditions::rounded;
use crate::error::Result;
use crate::family::{Body, BondStates, Families, nearest};
use crate::geometry::{Arrangement, Cloud, Lattice};

/// Of the side of the smaller cell: points nearer than that are nearly in one place.
const ONE_PLACE: f64 = 1e-3;
/// Side of a cell over the distance of the nearest other point: of half the points, beyond what volumes do not fit, and beyond
/// what that is said. 1 on a lattice, 2 to 3 of points anywhere.
const MISFIT: f64 = 10.0;
const ODD: f64 = 4.0;
/// The same of one point, over that of half of them.
const ALONE_MISFIT: f64 = 100.0;
/// Coordinates in cells beyond which differences of coordinates have lost their digits.
const FAR: f64 = 1e12;

/// Horizon over side of the cell, below which a point is said to see too few.
const LEAST_RATIO: f64 = 1.5;

const FILE: &str = "geometry.points.csv.file";

impl<const D: usize> Builder<'_, D> {
    /// Refuses points from a file whose volumes or places cannot be meant.
    pub(super) fn cells_fit(&self, cloud: &Cloud<D>) -> Result<()> {
        let Arrangement::Scattered { positions, volumes } = &cloud.arrangement else { return Ok(()) };
        if positions.len() < 2 {
            return Ok(());
        }
        let mut numbers = vec![0; positions.len()];
        cloud.slots.iter().enumerate().for_each(|(point, &slot)| numbers[slot as usize] = point);
        let name = |slot: usize| self.named(numbers[slot], &positions[slot]);
        // The first in point order, not in the order of slots.
        let first = |odd: &dyn Fn(usize) -> bool| {
            let mut odd = cloud.slots.iter().map(|&slot| slot as usize).filter(|&slot| odd(slot));
            odd.next().map(|slot| (slot, 1 + odd.count()))
        };
        let smallest = volumes.iter().copied().fold(f64::INFINITY, f64::min).powf(1.0 / D as f64);
        let is_far = |slot: usize| positions[slot].iter().any(|x| x.abs() > FAR * smallest);
        if let Some((slot, n)) = first(&is_far) {
            let message = format!(
                "{n} points are too far from the origin for cells of {} m, the first {}: rounding takes the digits of their \
                 distances",
                short(smallest),
                name(slot)
            );
            return Err(self.refuse(FILE, message, "is the unit right?"));
        }
        let size = |slot: usize| volumes[slot].powf(1.0 / D as f64);
        let found = nearest(positions);
        let ratios: Vec<f64> = found.iter().enumerate().map(|(slot, (distance, _))| size(slot) / distance).collect();
        let mut sorted = ratios.clone();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted[sorted.len() / 2];
        let here = cloud.slots[0] as usize;
        let fits = |slot: usize| {
            let (distance, there) = found[slot];
            format!(
                "{} has a volume of {}, a cell of side {} m, and the nearest other, {}, is {} m away",
                name(slot),
                short(volumes[slot]),
                short(size(slot)),
                name(there as usize),
                short(distance)
            )
        };
        let unit = ["m", "m^2", "m^3"][D - 1];
        let help = format!("volumes are in {unit} and coordinates in m; volumes add up to that of the body");
        if !(1.0 / MISFIT..=MISFIT).contains(&usual) {
            let message = format!(
                "the volumes do not fit the distances: {}; of half the points the ratio is {} or more",
                fits(here),
                short(usual)
            );
            return Err(self.refuse(FILE, message, &help));
        }
        let near = |slot: usize| {
            let (distance, there) = found[slot];
            distance < ONE_PLACE * size(slot).min(size(there as usize))
        };
        if let Some((slot, n)) = first(&near) {
            let (distance, there) = found[slot];
            let message = format!(
                "{} and {} are nearly in one place, {} m apart, where cells are {} m wide; {n} points have such another",
                name(slot),
                name(there as usize),
                short(distance),
                short(size(slot).min(size(there as usize))),
            );
            let help = "leave one of them out, with the volume of both: where parts share a face it has points once";
            return Err(self.refuse(FILE, message, help));
        }
        let limit = ALONE_MISFIT * usual.max(1.0);
        if let Some((slot, n)) = first(&|slot| ratios[slot] > limit) {
            let message = format!("the volume of {n} of the points does not fit the distances: {}", fits(slot));
            return Err(self.refuse(FILE, message, &help));
        }
        if !(1.0 / ODD..=ODD).contains(&usual) {
            let message = format!("the volumes hardly fit the distances: {}; so it is of half the points", fits(here));
            log::warn!("{}", self.source().warning(FILE, message).help(help));
        } else if let Some((slot, n)) = first(&|slot| ratios[slot] > MISFIT * usual.max(1.0)) {
            let message = format!("the volume of {n} of the points hardly fits the distances: {}", fits(slot));
            log::warn!("{}", self.source().warning(FILE, message).help(help));
        }
        Ok(())
    }

    /// Warns of points whose own cells are so large that the horizon holds hardly a neighbour of their size.
    pub(super) fn cells_are_seen(&self, cloud: &Cloud<D>, horizon: f64) {
        let is_large = |point: &usize| horizon < LEAST_RATIO * cloud.size(cloud.slots[*point] as usize);
        let mut large = (0..cloud.n_points()).filter(is_large);
        let Some(first) = large.next().filter(|_| !cloud.is_uniform()) else { return };
        let slot = cloud.slots[first] as usize;
        let message = format!(
            "the horizon of {} m is less than {LEAST_RATIO} sides of the cells of {} points, the first {} with a cell of {} m",
            short(horizon),
            1 + large.count(),
            self.named(first, &cloud.position(slot)),
            short(cloud.size(slot))
        );
        let help = "one horizon is for all: give a `horizon` of two or three of the largest cells";
        log::warn!("{}", self.source().warning("discretization", message).help(help));
    }

    /// Refuses a body in which nobody has a neighbour, and says who has none.
    pub(super) fn neighbours(&self, body: &Body<D>) -> Result<()> {
        let alone = alone(body);
        let Some(&first) = alone.first() else { return Ok(()) };
        let (cloud, geometry) = (&body.cloud, &self.case.value.geometry);
        let place = |point: usize| cloud.position(cloud.slots[point] as usize);
        let name = self.named(first, &place(first));
        let (path, help) = match geometry.points {
            Some(_) => (FILE, "check places and volumes, or give a larger `horizon`"),
            None => ("geometry.spacing", "a smaller spacing gives the body more cells"),
        };
        if alone.len() == cloud.n_points() {
            let message = match alone.len() {
                1 => format!("there is one point, {name}, and it sees nobody"),
                _ => format!(
                    "no point has a neighbour within the horizon of {} m: {name} sees nobody, and so do all others",
                    short(body.horizon)
                ),
            };
            return Err(self.refuse(path, message, help));
        }
        let message = format!(
            "{} of the points have no neighbour within the horizon of {} m, the first {name}: nothing holds them",
            alone.len(),
            short(body.horizon)
        );
        // What is at rest has to be held.
        let rests = self.case.value.solver.stages().any(|(_, solver)| {
            !matches!(
                solver,
                model::Solver::VelocityVerlet(_) | model::Solver::RungeKutta(_) | model::Solver::ForwardEuler(_)
            )
        });
        let acts = |load: bool| {
            self.case.value.conditions.iter().enumerate().filter(move |(_, condition)| {
                if load { condition.load.is_some() } else { condition.prescribe.is_some() }
            })
        };
        let is_in = |set: &Option<String>, point: usize| {
            let members = set.as_ref().and_then(|name| cloud.sets.get(name));
            members.is_some_and(|slots| slots.binary_search(&cloud.slots[point]).is_ok())
        };
        let held = |point: usize| acts(false).any(|(_, condition)| is_in(&condition.on, point));
        if let Some((point, k)) =
            alone.iter().filter(|_| rests).filter(|&&point| !held(point)).find_map(|&point| {
                acts(true).find(|(_, condition)| is_in(&condition.on, point)).map(|(k, _)| (point, k))
            })
        {
            let message = format!(
                "{} is loaded and has no neighbour within the horizon of {} m: nothing holds it at rest",
                self.named(point, &place(point)),
                short(body.horizon)
            );
            return Err(self.refuse(&format!("conditions[{k}].on"), message, help));
        }
        log::warn!("{}", self.source().warning(path, message).help(help));
        Ok(())
    }

    /// A point as `point 3 (line 5) at (0.1, 0.2) m`; numbers as elsewhere from 0.
    fn named(&self, point: usize, x: &[f64; D]) -> String {
        let line = match &self.case.value.geometry.points {
            Some(model::Points::Csv { file }) => import::csv::line_of(&self.options.base.join(file), point),
            None => None,
        };
        let line = line.map_or(String::new(), |line| format!(" (line {line})"));
        let is_short = x.iter().all(|x| x.abs() < 1e9);
        let place = if is_short { rounded(x) } else { format!("({})", x.map(|x| format!("{x:e}")).join(", ")) };
        format!("point {point}{line} at {place} m")
    }
}

/// The points that see nobody, ascending.
fn alone<const D: usize>(body: &Body<D>) -> Vec<usize> {
    let cloud = &body.cloud;
    match (&body.families, &cloud.arrangement) {
        (Families::Cloud(families), _) => {
            let sees = |slot: usize| families.of(slot).any(|bond| families.neighbours[bond] as usize != slot);
            (0..cloud.n_points()).filter(|&point| !sees(cloud.slots[point] as usize)).collect()
        }
        (Families::Lattice(_), Arrangement::Lattice(lattice)) => {
            let candidates = (0..cloud.n_points()).filter(|&point| !has_beside(cloud, lattice, point));
            let candidates: Vec<usize> = candidates.collect();
            if candidates.is_empty() {
                return candidates;
            }
            let states = BondStates::whole(body);
            let sees = |slot: usize| body.bonds_of(slot).any(|(bit, _)| states.holds(bit));
            candidates.into_iter().filter(|&point| !sees(cloud.slots[point] as usize)).collect()
        }
        _ => Vec::new(),
    }
}

/// Whether a cell has another one beside it, which is in its family: horizons are a spacing or more.
fn has_beside<const D: usize>(cloud: &Cloud<D>, lattice: &Lattice<D>, point: usize) -> bool {
    let slot = cloud.slots[point];
    let next = |k: usize| cloud.slots.get(k).is_some_and(|&other| other.abs_diff(slot) == 1);
    let shift = |stride: usize| [slot.checked_sub(stride as u32), slot.checked_add(stride as u32)];
    // Along x the rows are padded, if a row does not end with its block.
    let padded = lattice.counts[0] < lattice.strides.get(1).copied().unwrap_or(usize::MAX);
    (padded && (next(point + 1) || next(point.wrapping_sub(1))))
        || (1..D).any(|d| {
            let beside = shift(lattice.strides[d]).into_iter().flatten();
            beside.into_iter().any(|other| cloud.slots.binary_search(&other).is_ok())
        })
}

/// A number as `1.5e-5`, to four digits.
fn short(x: f64) -> String {
    let rounded: f64 = format!("{x:.3e}").parse().unwrap_or(x);
    if (1e-3..1e5).contains(&rounded.abs()) { rounded.to_string() } else { format!("{rounded:e}") }
}
