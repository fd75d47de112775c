//! What is odd about a body or a run, though nothing is wrong with it: warnings that need the body.

use super::super::model::{Solver, Units};
use super::Builder;
use super::conditions::rounded;
use crate::family::{Body, BondStates};
use crate::geometry::Crack;
use crate::simulation::{SolverStage, Stepper};

/// Lengths (m) beyond which bodies are rather in other units than of that size.
const LENGTHS: [f64; 2] = [1e-9, 1e3];
/// Fraction of points that sum their bonds, above which the hybrid scheme costs more than it saves.
const TOO_MANY_BONDS: f64 = 0.6;
/// Steps that are worth a word.
const MANY: u64 = 1_000_000;
/// Bonds of a point that are looked at before all are: almost always enough to find that a body is in one piece.
const FIRST_BONDS: usize = 8;

impl<const D: usize> Builder<'_, D> {
    fn remark(&self, path: &str, message: String, help: &str) {
        log::warn!("{}", self.source().warning(path, message).help(help));
    }

    /// A body that is too large or too small to be of its units.
    pub(super) fn remark_size(&self, body: &Body<D>) {
        if self.case.value.case.units == Units::None {
            return;
        }
        let cloud = &body.cloud;
        let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
        for x in cloud.slots.iter().map(|&slot| cloud.position(slot as usize)) {
            for d in 0..D {
                (low[d], high[d]) = (low[d].min(x[d]), high[d].max(x[d]));
            }
        }
        let length = (0..D).map(|d| high[d] - low[d] + cloud.spacing).fold(0.0, f64::max);
        let shape = self.case.value.geometry.shape.is_some();
        let path = if shape { "geometry.shape" } else { "geometry.points" };
        let silent = "`[case] units = \"none\"` says that numbers have no unit";
        if length > LENGTHS[1] {
            let meant =
                [("mm", 1e-3), ("um", 1e-6), ("nm", 1e-9)].into_iter().find(|(_, unit)| length * unit <= LENGTHS[1]);
            let (unit, size) = meant.map_or(("mm", 1e-3), |found| found);
            let help = format!(
                "numbers are in metres: in {unit} it would be {:.4} m; write lengths with their unit, such as `\"100 {unit}\"`; {silent}",
                length * size
            );
            self.remark(path, format!("the body is {length:.4e} m long"), &help);
        } else if length < LENGTHS[0] {
            let help = format!("that is less than a few atoms: is the unit right? {silent}");
            self.remark(path, format!("the body is only {length:.4e} m long"), &help);
        }
    }

    /// Pre-cracks that cut nothing, and points that lie on one. `cut`: bonds that each has cut.
    pub(super) fn remark_cracks(&self, body: &Body<D>, cracks: &[Crack<D>], cut: u64, tolerance: f64) {
        let ends = body.cloud.bounds();
        for (k, crack) in cracks.iter().enumerate() {
            let path = format!("geometry.cracks[{k}]");
            let (low, high) = crack.bounds();
            // Twice: what is that far off is not even touched.
            let within =
                |x: &[f64; D]| (0..D).all(|d| low[d] - 2.0 * tolerance <= x[d] && x[d] <= high[d] + 2.0 * tolerance);
            let all = body.cloud.slots.iter().map(|&slot| body.cloud.position(slot as usize));
            let on: Vec<_> = all.filter(|x| within(x) && crack.holds(x, tolerance)).collect();
            // One of several may cut nothing that others have not cut; but one that nobody reaches is meant to be elsewhere.
            let apart = (0..D).any(|d| low[d] > ends.1[d] + body.horizon || high[d] < ends.0[d] - body.horizon);
            if cut == 0 || apart {
                let message = "this pre-crack cuts no bond: nothing is changed by it".to_owned();
                let help = "is it inside the body, at least one spacing long, and in metres or with a unit? A bond through its \
                            end is kept";
                self.remark(&path, message, help);
            }
            if let Some(first) = on.first() {
                let [side, which] = match D {
                    1 => ["right", "they keep their bonds to the right"],
                    2 => ["left", "seen along the pre-crack they keep their bonds to the left"],
                    _ => ["positive", "they keep their bonds on the side of its normal"],
                };
                let message = format!(
                    "{} points lie on this pre-crack, the first at {} m: they belong to its {side} side, so that a body that is \
                     symmetric about it is not any more",
                    on.len(),
                    rounded(first)
                );
                let help = format!(
                    "{which} and lose those across; move the pre-crack by half a spacing, or choose the spacing so that it runs \
                     between rows of points"
                );
                self.remark(&path, message, &help);
            }
        }
    }

    /// Parts of the body that no bond joins.
    pub(super) fn remark_parts(&self, body: &Body<D>, states: &BondStates) {
        let parts = Parts::of(body, states);
        let [first, second, ..] = &parts.0[..] else { return };
        let at = |slot: usize| rounded(&body.cloud.position(slot));
        let message = format!(
            "the body is in {} parts without a bond between them: {} points, {} points{}; the second has one at {} m",
            parts.0.len(),
            first.points,
            second.points,
            if parts.0.len() > 2 { " and fewer" } else { "" },
            at(second.slot)
        );
        let help = if self.case.value.physics.diffusion.is_some() {
            "nothing goes from one to the other; a larger horizon, or a shape without the gap, joins them"
        } else {
            "there is no contact: they would pass through each other; a larger horizon, or a shape or pre-cracks without \
             the gap, joins them"
        };
        self.remark("geometry", message, help);
    }

    /// The hybrid scheme where it cannot pay. `standard`: the fraction of points that sum their bonds from the start.
    pub(super) fn remark_hybrid(&self, standard: f64) {
        // Where all do, that is said already.
        if standard > TOO_MANY_BONDS && standard < 1.0 {
            let message = format!(
                "{:.0} % of the points sum their bonds from the start: the hybrid scheme saves nothing here",
                100.0 * standard
            );
            let help = "take `scheme = \"standard\"`, a body of more points across, a smaller horizon or `buffer`, or fewer \
                        points in `standard` and in sets with conditions";
            self.remark("discretization.scheme.hybrid", message, help);
        }
    }

    /// Runs of millions of steps, and how long they take.
    pub(super) fn remark_steps(&self, model: &mut dyn Stepper, stages: &[&SolverStage]) {
        for (k, (path, solver)) in self.case.value.solver.stages().enumerate() {
            let starts = stages.iter().scan(0, |of, stage| {
                *of += usize::from(!stage.continues);
                Some((*of - 1, *stage))
            });
            let own: Vec<&SolverStage> = starts.filter(|(of, _)| *of == k).map(|(_, stage)| stage).collect();
            let steps: u64 = own.iter().map(|stage| stage.n_steps).sum();
            let passes = match solver {
                Solver::VelocityVerlet(_) | Solver::ForwardEuler(_) => 1.0,
                Solver::RungeKutta(_) => 4.0,
                _ => continue,
            };
            let Some(first) = own.first().filter(|_| steps >= MANY) else { continue };
            let time = match model.seconds_per_rate() {
                Some(seconds) => format!(", some {} on this machine", duration(seconds * passes * steps as f64)),
                None => String::new(),
            };
            let message = format!("{steps:.2e} steps of {:.3e} s{time}", first.dt, steps = steps as f64);
            let help = if solver.is_of_first_order() {
                "is the unit of `end_time` right? The stable step grows with the square of the spacing"
            } else {
                "is the unit of `end_time` right? A body at rest, or one that is moved slowly, is found by `quasi_static` or \
                 `newton` without these steps; the stable step grows with the spacing"
            };
            self.remark(&format!("{path}.end_time"), message, help);
        }
    }
}

/// Seconds in words.
fn duration(seconds: f64) -> String {
    let units = [("years", 31_557_600.0), ("days", 86_400.0), ("hours", 3600.0), ("minutes", 60.0)];
    match units.into_iter().find(|(_, unit)| seconds >= 2.0 * unit) {
        Some((name, unit)) => format!("{:.0} {name}", seconds / unit),
        None => format!("{seconds:.0} seconds"),
    }
}

/// A part of a body.
struct Part {
    points: usize,
    /// Of its first point.
    slot: usize,
}

/// The parts of a body that bonds hold together, the largest first.
struct Parts(Vec<Part>);

impl Parts {
    fn of<const D: usize>(body: &Body<D>, states: &BondStates) -> Self {
        let mut forest = Forest((0..body.cloud.n_slots() as u32).collect());
        let mut trees = body.cloud.slots.len();
        let own = |slot: usize| match &body.cloud.images {
            Some(images) => images.source(slot).0,
            None => slot,
        };
        for most in [FIRST_BONDS, usize::MAX] {
            for &slot in &body.cloud.slots {
                if trees == 1 {
                    return Parts(Vec::new());
                }
                let whole = body.bonds_of(slot as usize).filter(|(bit, _)| states.holds(*bit));
                for (_, there) in whole.take(most) {
                    trees -= usize::from(forest.join(slot as usize, own(there)));
                }
            }
        }
        let mut parts = std::collections::BTreeMap::new();
        for &slot in &body.cloud.slots {
            let root = forest.root(slot as usize);
            parts.entry(root).or_insert(Part { points: 0, slot: slot as usize }).points += 1;
        }
        let mut parts: Vec<Part> = parts.into_values().collect();
        parts.sort_by_key(|part| (std::cmp::Reverse(part.points), part.slot));
        Parts(parts)
    }
}

/// Trees of slots: each knows one nearer to its root.
struct Forest(Vec<u32>);

impl Forest {
    fn root(&mut self, mut slot: usize) -> usize {
        while self.0[slot] as usize != slot {
            // Halves the way for the next who asks.
            self.0[slot] = self.0[self.0[slot] as usize];
            slot = self.0[slot] as usize;
        }
        slot
    }

    /// Whether they were two trees.
    fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        let (low, high) = (a.min(b), a.max(b));
        self.0[high] = low as u32;
        low != high
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::Body;
    use crate::geometry::{Cloud, Shape};

    #[test]
    fn parts_are_counted_whatever_holds_them_together() {
        let block = |low: f64, high: f64| Shape::Box { low: [low, 0.0], high: [high, 1.0] };
        let body = |shape: &Shape<2>| Body::new(Cloud::lattice(shape, 0.1, 3), 0.3, 0.3..0.3 * (1.0 + 1e-9), |_| true);
        let points = |body: &Body<2>, states: &BondStates| -> Vec<usize> {
            Parts::of(body, states).0.iter().map(|part| part.points).collect()
        };
        let whole = body(&block(0.0, 2.0));
        let mut states = BondStates::whole(&whole);
        assert!(points(&whole, &states).is_empty());
        states.cut(&whole, &[Crack::Polyline(vec![[0.5, -1.0], [0.5, 2.0]])], 1e-10);
        assert_eq!(points(&whole, &states), [150, 50]);
        states.cut(&whole, &[Crack::Polyline(vec![[-1.0, 0.3], [3.0, 0.3]])], 1e-10);
        assert_eq!(points(&whole, &states), [105, 45, 35, 15]);
        // A gap of three cells is as wide as the horizon, and one cell more.
        let apart = body(&Shape::Union(vec![block(0.0, 0.5), block(0.8, 2.0)]));
        assert_eq!(points(&apart, &BondStates::whole(&apart)), [120, 50]);
        let near = body(&Shape::Union(vec![block(0.0, 0.5), block(0.7, 2.0)]));
        assert!(points(&near, &BondStates::whole(&near)).is_empty());
    }
}
