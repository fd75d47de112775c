//! Cells that follow the solution: Algorithm 1 of Bobaru et al. 2009 for bodies of any dimension that break.
//!
//! Now and then a formula says where the finest cells are wanted. Cells there are split level by level, with a buffer about
//! them; cells that nobody wants any more are merged again, never beyond the lattice they came from. Horizons go with the
//! cells, micromoduli and critical stretches with the horizons. Values are carried over so that momentum is kept: a child
//! takes u and v of its parent and the change of both to its centre (second order; the children's shares cancel), a parent
//! the means of its parts. A bond between new points is broken if on the way from one to the other it passes between two
//! old cells whose bond was broken, or through a pre-crack.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::{Elasticity, Physics, Replaced};
use crate::discretization::BondWeighting;
use crate::execution::Packs;
use crate::execution::gradients::{gradients, largest};
use crate::expression::Expression;
use crate::family::{Body, Bond, BondStates, CloudFamilies, Families, GROUP, Grading, Rule};
use crate::field::{Number, Vector, components, difference, dot, embed, norm};
use crate::geometry::{Crack, Cracks};
use crate::parallel;
use crate::physics::Remap;
use crate::refinement::{Cells, Origin, Transition, Zones, horizons};

/// What formulas about refinement may use beside x, y, z (m) and t (s): the energy density over its largest in the body;
/// the largest difference (Frobenius) of the displacement gradient to that of a neighbour; the largest stretch of a bond
/// over its critical one; the damage.
pub const INDICATORS: [&str; 4] = ["energy", "jump", "stretch", "damage"];

/// How the cells of a body are refined.
pub struct Adaptation<const D: usize> {
    pub cells: Cells<D>,
    pub scaling: BondWeighting,
    pub rule: Rule,
    /// m = δ/Δx
    pub ratio: f64,
    pub transition: Transition,
    /// Between what is asked for and the nearest coarser point, in horizons of that point.
    pub buffer: f64,
    /// The level that is asked for at each cell, whatever the solution does.
    pub floor: Vec<u8>,
    /// Where the finest cells are wanted, and where cells are not merged: formulas in x, y, z, t and [`INDICATORS`].
    pub criteria: Option<[Expression; 2]>,
    /// Steps between two looks.
    pub every: u64,
    pub cracks: Vec<Crack<D>>,
    /// What counts as touching a crack, m.
    pub tolerance: f64,
}

impl<const D: usize> Adaptation<D> {
    /// Splits cells until what `floor` and the buffer ask for is there; before any point is made.
    pub fn prepare(&mut self, asked: impl Fn(&Vector<D>) -> u8) {
        loop {
            self.floor = self.cells.list().iter().map(|cell| asked(&self.cells.center(cell))).collect();
            let zones = self.zones(&self.floor, &[]);
            if self.cells.change(|_, cell| zones.splits(cell), |_, _| false).is_none() {
                return;
            }
        }
    }

    fn zones(&self, asked: &[u8], kept: &[u8]) -> Zones<D> {
        Zones::new(&self.cells, asked, kept, self.buffer * self.ratio, self.transition)
    }

    /// Horizons and sizes of the cells.
    pub fn grading(&self) -> Grading {
        let sizes = self.cells.list().iter().map(|cell| self.cells.size(cell.level)).collect();
        let horizons = horizons(&self.cells, self.ratio, self.transition);
        Grading { rule: self.rule, horizons, sizes, shifts: Vec::new() }
    }

    /// Points that a coarser one sees although finer cells are asked for there (the visibility criterion of Bobaru et al.
    /// 2009, section 5.1).
    pub fn seen(&self, body: &Body<D>, asked: &[u8]) -> usize {
        let list = self.cells.list();
        let sees = |k: usize| {
            body.bonds_of(k).any(|(bit, j)| {
                let far = norm(&body.xi(bit, k, j));
                asked[j] > list[k].level && far <= self.ratio * self.cells.size(list[k].level)
            })
        };
        parallel::map(list.len(), &sees).into_iter().filter(|sees| *sees).count()
    }
}

impl<const D: usize, P: Packs> Elasticity<D, P> {
    /// Splits and merges cells as the criteria want it at time `t`; all levels at once when `thoroughly`, which is before the
    /// books are opened.
    pub(super) fn follow(&mut self, t: f64, thoroughly: bool) -> Option<Replaced> {
        let mut adaptation = self.adaptation.take()?;
        let replaced = match &adaptation.criteria {
            Some(criteria) => {
                let indicated = self.indicate(criteria, t);
                self.replace(&mut adaptation, indicated, t, thoroughly)
            }
            None => None,
        };
        self.adaptation = Some(adaptation);
        replaced
    }

    /// The same, where the criteria have values at all points: where the finest cells are wanted, and cells kept.
    fn replace(
        &mut self,
        adaptation: &mut Adaptation<D>,
        [wanted, kept]: [Vec<f64>; 2],
        t: f64,
        thoroughly: bool,
    ) -> Option<Replaced> {
        let levels = adaptation.cells.levels;
        let mut asked: Vec<u8> = adaptation.floor.clone();
        for (asked, wanted) in asked.iter_mut().zip(&wanted) {
            *asked = if *wanted != 0.0 { levels } else { *asked };
        }
        let mut kept: Vec<u8> = kept
            .iter()
            .zip(adaptation.cells.list())
            .map(|(kept, cell)| if *kept != 0.0 { cell.level } else { 0 })
            .collect();
        let before = self.motion().0 + self.content().stored;
        let mut remaps = Vec::new();
        for _ in 0..if thoroughly { levels } else { 1 } {
            let zones = adaptation.zones(&asked, &kept);
            let Some(remap) = self.change(adaptation, &zones) else { break };
            let largest = |origin: &Origin, values: &[u8]| match origin {
                Origin::Same(k) | Origin::Child(k) => values[*k as usize],
                Origin::Merged(k) => values[*k as usize..][..1 << D].iter().copied().max().unwrap_or(0),
            };
            for values in [&mut asked, &mut kept, &mut adaptation.floor] {
                *values = remap.origins.iter().map(|origin| largest(origin, values)).collect();
            }
            remaps.push(remap);
        }
        let replaced = (!remaps.is_empty()).then(|| {
            self.measure_families();
            self.evaluate();
            let energy = self.motion().0 + self.content().stored - before;
            self.adapted.energy += energy.abs();
            self.adapted.events += 1;
            Replaced { remaps, energy }
        });
        if thoroughly {
            // What the first cells bring in is part of the initial energy.
            self.adapted.energy = 0.0;
        }
        let seen = adaptation.seen(&self.body, &asked);
        if seen > 0 && self.adapted.seen == 0 {
            log::warn!(
                "t = {t:.3e} s: {seen} points see, with horizons larger than asked for there, places where finer cells \
                 are wanted; the report has the largest number"
            );
        }
        self.adapted.seen = self.adapted.seen.max(seen);
        let n = self.body.cloud.n_points() as u64;
        self.adapted.looks += 1;
        self.adapted.points = [self.adapted.points[0].max(n), self.adapted.points[1] + n];
        replaced
    }

    /// The values of both formulas at all points.
    fn indicate(&mut self, criteria: &[Expression; 2], t: f64) -> [Vec<f64>; 2] {
        let uses = |name: &str| criteria.iter().any(|formula| formula.uses(name));
        let n = self.body.cloud.n_slots();
        let mut columns: Vec<Vec<f64>> =
            (0..3).map(|d| (0..n).map(|slot| embed(&self.body.cloud.position(slot))[d]).collect()).collect();
        columns.push(vec![t]);
        for name in INDICATORS {
            columns.push(match name {
                _ if !uses(name) => vec![0.0],
                "energy" => self.energies(),
                "jump" => self.jumps(),
                "stretch" => self.stretches(),
                _ => self.damage(),
            });
        }
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        criteria.each_ref().map(|formula| {
            let mut values = vec![0.0; n];
            formula.evaluate_batch(&columns, &mut values);
            values
        })
    }

    /// Kinetic and strain energy density over the largest of both together.
    fn energies(&mut self) -> Vec<f64> {
        let density = self.energy_density();
        let v = components::<D, _>(&self.state.velocity);
        let kinetic = |slot: usize| v.iter().map(|v| v[slot].to_f64().powi(2)).sum::<f64>();
        let mut energies: Vec<f64> = density
            .iter()
            .enumerate()
            .map(|(slot, w)| w.to_f64() + 0.5 * self.density.at(slot) * kinetic(slot))
            .collect();
        let largest = energies.iter().copied().fold(0.0, f64::max);
        if largest > 0.0 {
            energies.iter_mut().for_each(|energy| *energy /= largest);
        }
        energies
    }

    /// Largest |∇u′ − ∇u| over the bonds of each point.
    fn jumps(&self) -> Vec<f64> {
        let (body, states) = (&self.body, &self.state.states);
        let fields = components::<D, _>(&self.state.displacement);
        let all: Vec<u32> = (0..body.cloud.n_slots() as u32).collect();
        let gradient = gradients(body, states, fields, &all);
        let jump = |here: usize, there: usize| {
            let rows = gradient[there].iter().zip(&gradient[here]);
            rows.map(|(there, here)| norm(&difference(there, here)).powi(2)).sum::<f64>().sqrt()
        };
        largest(body, states, fields, |_, _, here, there| jump(here, there))
    }

    /// Largest strain of a bond over its critical one.
    fn stretches(&self) -> Vec<f64> {
        let (body, material) = (&self.body, &self.material);
        let Some(failure) = &self.failure else { return vec![0.0; body.cloud.n_slots()] };
        let ratio = |bond: &Bond<D, f64>, eta: &Vector<D>, here: usize, there: usize| {
            material.strain_ratio(bond, eta, failure.of(here, there))
        };
        largest(body, &self.state.states, components::<D, _>(&self.state.displacement), ratio)
    }

    /// Replaces the points where the zones want other cells; None if nothing changed.
    fn change(&mut self, adaptation: &mut Adaptation<D>, zones: &Zones<D>) -> Option<Remap> {
        let old = adaptation.cells.clone();
        let class = &self.merge_class;
        let alike = |k: usize| class[k..k + (1 << D)].iter().all(|other| *other == class[k]);
        let origins =
            adaptation.cells.change(|_, cell| zones.splits(cell), |k, cell| zones.merges(cell) && alike(k))?;
        let cells = &adaptation.cells;
        let moved = self.moved(&old, cells, &origins);
        let grading = adaptation.grading();
        let before = self.body.grading.as_ref().map_or(&[][..], |grading| &grading.horizons);
        let same: Vec<u32> = origins
            .iter()
            .zip(&grading.horizons)
            .map(|(origin, horizon)| match origin {
                Origin::Same(k) if before[*k as usize] == *horizon => *k,
                _ => u32::MAX,
            })
            .collect();
        let horizons = grading.horizons.clone();
        let (mut body, update) = adaptation.scaling.replaced(&self.body, cells.cloud(), grading, &same);
        let (Families::Cloud(families), Families::Cloud(old_families)) = (&body.families, &self.body.families) else {
            // The cells of a lattice are what they are.
            return None;
        };
        let cuts = Cuts {
            body: &self.body,
            families: old_families,
            words: self.state.states.words(),
            cells: &old,
            cracks: Cracks::new(&adaptation.cracks, adaptation.tolerance),
        };
        let [damaged, near] = cuts.damaged();
        let fresh = AtomicU64::new(0);
        let was = |k: usize| if let Origin::Same(k) = origins[k] { Some(k as usize) } else { None };
        let words = update.carry(Some((old_families, cuts.words)), families, 1, |point, row| {
            for (k, &there) in families.neighbours[families.of(point)].iter().enumerate() {
                // Seen from the same end whoever asks.
                let [a, b] = [point.min(there as usize), point.max(there as usize)];
                let same = was(a).and_then(|a| Some([a, was(b)?]));
                let damaged =
                    if [a, b].iter().any(|&k| near.get(origins[k].cell()) == Some(&true)) { &damaged[..] } else { &[] };
                let [x, y] = [a, b].map(|k| body.cloud.position(k));
                if a != b && cuts.holds(damaged, same, &x, &y) {
                    row[k / GROUP] |= 1 << (k % GROUP);
                }
            }
            fresh.fetch_add((row.len() * GROUP) as u64, Ordering::Relaxed);
        });
        self.adapted.bonds[0] += fresh.into_inner();
        self.adapted.bonds[1] += families.neighbours.len() as u64;
        let mut operator = adaptation.scaling.operator(&body, &update, Some((&self.operator, &self.body)), None);
        let from: Vec<usize> = origins.iter().map(|origin| origin.cell()).collect();
        if let Some(failure) = &self.failure {
            self.failure = Some(failure.inherited(&from).scaled(&horizons, adaptation.scaling.horizon));
        }
        let varied = self.operator.weights.heterogeneity.as_ref();
        operator.weights.heterogeneity = varied.map(|varied| Arc::new(varied.inherited(&body, &from)));
        self.density = self.density.inherited(&from);
        if !self.materials.is_empty() {
            self.materials = from.iter().map(|&old| self.materials[old]).collect();
        }
        let cloud = &mut body.cloud;
        let n = origins.len();
        let remap = Remap {
            positions: (0..n).map(|slot| embed(&cloud.position(slot))).collect(),
            volumes: (0..n).map(|slot| cloud.volume(slot)).collect(),
            n_before: self.body.cloud.n_slots(),
            origins,
        };
        for (name, slots) in self.body.cloud.sets.iter() {
            cloud.sets.insert(name, remap.members(slots));
        }
        self.merge_class = remap.origins.iter().map(|origin| self.merge_class[origin.cell()]).collect();
        self.operator = operator;
        self.body = body;
        self.state.states = BondStates::new(words);
        [self.state.displacement, self.state.velocity] = moved;
        self.state.force = vec![P::Field::default(); self.state.displacement.len()];
        self.generation += 1;
        Some(remap)
    }

    /// Displacements and velocities of the new cells.
    fn moved(&self, old: &Cells<D>, cells: &Cells<D>, origins: &[Origin]) -> [Vec<P::Field>; 2] {
        let parent = |origin: &Origin| if let Origin::Child(k) = origin { Some(*k) } else { None };
        let mut parents: Vec<u32> = origins.iter().filter_map(parent).collect();
        parents.dedup();
        [&self.state.displacement, &self.state.velocity].map(|flat| {
            let fields = components::<D, _>(flat);
            let slopes = gradients(&self.body, &self.state.states, fields, &parents);
            let value = |k: usize, d: usize| match origins[k] {
                Origin::Same(old) => fields[d][old as usize],
                Origin::Child(parent) => {
                    let slope = &slopes[parents.partition_point(|&p| p < parent)][d];
                    let center = old.center(&old.list()[parent as usize]);
                    let step = difference(&cells.center(&cells.list()[k]), &center);
                    P::Field::from_f64(fields[d][parent as usize].to_f64() + dot(slope, &step))
                }
                Origin::Merged(first) => {
                    let parts = &fields[d][first as usize..][..1 << D];
                    P::Field::from_f64(parts.iter().map(|x| x.to_f64()).sum::<f64>() / f64::from(1u32 << D))
                }
            };
            (0..D * origins.len()).map(|k| value(k % origins.len(), k / origins.len())).collect()
        })
    }

    /// Lets cells follow the solution from now on.
    pub fn adapting(&mut self, adaptation: Adaptation<D>) {
        let n = self.body.cloud.n_slots();
        // Points are of one class that belong to the same sets and break by the same rule.
        let mut members = vec![(0u64, 0u8); n];
        for (bit, (_, slots)) in self.body.cloud.sets.iter().enumerate() {
            slots.iter().for_each(|&slot| members[slot as usize].0 |= 1 << (bit % 64));
        }
        if let Some(failure) = &self.failure {
            members.iter_mut().enumerate().for_each(|(slot, member)| member.1 = failure.class(slot));
        }
        let mut classes = members.clone();
        classes.sort_unstable();
        classes.dedup();
        let class = |member: &(u64, u8)| classes.partition_point(|class| class < member) as u32;
        self.merge_class = members.iter().map(class).collect();
        self.adapted.points = [n as u64; 2];
        self.adaptation = Some(Box::new(adaptation));
    }
}

/// Where bonds between new points are broken, as the old ones tell.
struct Cuts<'a, const D: usize> {
    body: &'a Body<D>,
    families: &'a CloudFamilies,
    words: &'a [u16],
    cells: &'a Cells<D>,
    cracks: Cracks<D>,
}

impl<const D: usize> Cuts<'_, D> {
    /// Old points that have a broken bond, and those that have one or see one that has; none if there are none.
    fn damaged(&self) -> [Vec<bool>; 2] {
        let n = self.body.cloud.n_slots();
        let is_damaged = |point: usize| {
            let broken = |bond: usize| {
                self.families.neighbours[bond] as usize != point && self.words[bond / GROUP] >> (bond % GROUP) & 1 == 0
            };
            self.families.of(point).any(broken)
        };
        let damaged = parallel::map(n, &is_damaged);
        if !damaged.contains(&true) {
            return [Vec::new(), Vec::new()];
        }
        let is_near = |point: usize| {
            damaged[point] || self.families.neighbours[self.families.of(point)].iter().any(|&j| damaged[j as usize])
        };
        let near = parallel::map(n, &is_near);
        [damaged, near]
    }

    /// Whether an old bond is there, and holds.
    fn old(&self, a: usize, b: usize) -> Option<bool> {
        self.families.bond(a, b).map(|bond| self.words[bond / GROUP] >> (bond % GROUP) & 1 == 1)
    }

    /// Whether the bond between two places holds; `same`: both were points before, of these numbers.
    fn holds(&self, damaged: &[bool], same: Option<[usize; 2]>, a: &Vector<D>, b: &Vector<D>) -> bool {
        if let Some(holds) = same.and_then(|[a, b]| self.old(a, b)) {
            return holds;
        }
        if self.cracks.cut(a, b) {
            return false;
        }
        if damaged.is_empty() {
            return true;
        }
        // From cell to cell, each entered a little behind its border.
        let (way, finest) = (difference(b, a), self.cells.size(self.cells.levels));
        let (step, nudge) = (0.5 * finest / norm(&way), 1e-6 * finest / norm(&way));
        let (mut t, mut last) = (0.0, None);
        while t <= 1.0 {
            let here = self.cells.holding(&std::array::from_fn(|d| a[d] + t * way[d]));
            if let (Some(from), Some(to)) = (last, here)
                && from != to
                && damaged[from]
                && self.old(from, to) == Some(false)
                // What a pre-crack broke it breaks itself, where it is and not along the borders of cells.
                && !self.cracks.cut(&self.body.cloud.position(from), &self.body.cloud.position(to))
            {
                return false;
            }
            last = here.or(last);
            let leaves = |k: usize| {
                let (x, half) = (self.body.cloud.position(k), 0.5 * self.cells.size(self.cells.list()[k].level));
                let along = |d: usize| (x[d] + half.copysign(way[d]) - a[d]) / way[d];
                (0..D).filter(|&d| way[d] != 0.0).map(along).fold(f64::INFINITY, f64::min)
            };
            t = here.map_or(t + step, |k| leaves(k).max(t) + nudge);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::{Influence, PartialVolume};
    use crate::family::Update;
    use crate::field::{Double, components_mut};
    use crate::geometry::{Arrangement, Cloud, Shape};
    use crate::physics::elasticity::Bonds;
    use crate::physics::elasticity::laws::BondBasedLinear;
    use crate::physics::failure::CriticalStretch;

    const H: f64 = 0.1;

    /// A box whose finest cells are where a formula says, with buffers of one horizon.
    fn problem<const D: usize>(
        high: Vector<D>,
        wanted: &str,
        keep: &str,
        cracks: Vec<Crack<D>>,
    ) -> Elasticity<D, Double> {
        let cloud = Cloud::lattice(&Shape::Box { low: [0.0; D], high }, H, 4);
        let Arrangement::Lattice(lattice) = &cloud.arrangement else { panic!("a lattice") };
        let scaling =
            BondWeighting { strength: 1.0, horizon: 3.0 * H, influence: Influence::Linear, rule: PartialVolume::Ramp };
        let names = ["x", "y", "z", "t", "energy", "jump", "stretch", "damage"];
        let mut adaptation = Adaptation {
            cells: Cells::new(lattice, &cloud.slots, 2),
            scaling,
            rule: Rule::Dual,
            ratio: 3.0,
            transition: Transition::Stepwise,
            buffer: 1.0,
            floor: Vec::new(),
            criteria: Some([wanted, keep].map(|formula| Expression::compile(formula, &names, &[]).unwrap())),
            every: 1,
            cracks: cracks.clone(),
            tolerance: 1e-9 * H,
        };
        adaptation.prepare(|_| 0);
        let mut cloud = adaptation.cells.cloud();
        cloud.sets.insert("left", cloud.select(|x| x[0] < 0.55));
        let grading = adaptation.grading();
        let failure = Some(CriticalStretch::uniform(1e-3).scaled(&grading.horizons, scaling.horizon));
        let body = scaling.body(cloud, grading);
        let operator = scaling.operator(&body, &Update::default(), None, None);
        let mut problem = Elasticity::new(body, operator, Box::new(Bonds::new(BondBasedLinear)), 1.0, failure);
        problem.cut(&cracks, 1e-9 * H);
        problem.adapting(adaptation);
        problem
    }

    fn set<const D: usize>(problem: &mut Elasticity<D, Double>, u: impl Fn(&Vector<D>) -> Vector<D>) {
        let cloud = &problem.body.cloud;
        let values: Vec<Vector<D>> = (0..cloud.n_slots()).map(|slot| u(&cloud.position(slot))).collect();
        for d in 0..D {
            for flat in [&mut problem.state.displacement, &mut problem.state.velocity] {
                components_mut::<D, _>(flat)[d].iter_mut().zip(&values).for_each(|(u, value)| *u = value[d]);
            }
        }
    }

    /// The finest zone runs through the body, and what is kept from event to event is what is found from scratch.
    fn families_carried_are_families_found<const D: usize>(high: Vector<D>) {
        let mut problem = problem::<D>(high, "abs(x - t) < 0.06", "0", Vec::new());
        for k in 0..6 {
            problem.follow(0.2 + 0.2 * f64::from(k), k == 0);
            let adaptation = problem.adaptation.as_ref().unwrap();
            let body = adaptation.scaling.body(adaptation.cells.cloud(), adaptation.grading());
            let operator = adaptation.scaling.operator(&body, &Update::default(), None, None);
            let (Families::Cloud(kept), Families::Cloud(found)) = (&problem.body.families, &body.families) else {
                panic!("clouds")
            };
            assert_eq!(kept.starts, found.starts);
            assert_eq!(kept.neighbours, found.neighbours);
            let [kept, found] = [&problem.operator, &operator].map(|operator| operator.stored().unwrap());
            assert!(kept == found, "weights of event {k}");
            assert_eq!(problem.state.states, BondStates::whole(&body));
            let left = body.cloud.select(|x| x[0] < 0.5);
            assert!(problem.body.cloud.sets.get("left").unwrap().iter().eq(&left), "sets go with the cells");
        }
        let adapted = problem.adapted;
        assert!(adapted.events >= 5 && adapted.bonds[0] < adapted.bonds[1], "{adapted:?}");
    }

    #[test]
    fn families_weights_bonds_and_sets_that_are_carried_over_are_those_found_from_scratch() {
        families_carried_are_families_found::<1>([3.0]);
        families_carried_are_families_found::<2>([2.4, 1.0]);
        families_carried_are_families_found::<3>([1.6, 0.5, 0.5]);
    }

    #[test]
    fn affine_fields_stay_what_they_are_and_momentum_is_kept_to_rounding() {
        let mut problem = problem::<2>([2.4, 1.0], "abs(x - t) < 0.06", "0", Vec::new());
        let affine = |x: &Vector<2>| [0.3 + 0.2 * x[0] - 0.1 * x[1], -0.1 + 0.05 * x[0] + 0.4 * x[1]];
        set(&mut problem, affine);
        for k in 0..8 {
            problem.follow(0.3 * f64::from(k), false);
            for slot in 0..problem.body.cloud.n_slots() {
                let expected = affine(&problem.body.cloud.position(slot));
                for (d, u) in components::<2, _>(&problem.state.displacement).iter().enumerate() {
                    // Gradients of least squares are exact for affine fields, means too; rounding alone is left.
                    assert!((u[slot] - expected[d]).abs() < 1e-14, "{} {}", u[slot], expected[d]);
                }
            }
        }
        // A field with every wave length of the lattice.
        set(&mut problem, |x| [(37.0 * x[0]).sin() + (91.0 * x[1]).cos(), (53.0 * x[0] * x[1]).sin()]);
        let ((_, before), scale) = (problem.motion(), problem.content().scale);
        problem.follow(0.0, false);
        let (_, after) = problem.motion();
        assert!(problem.adapted.events > 7);
        for d in 0..2 {
            assert!((after[d] - before[d]).abs() < 1e-13 * scale);
        }
    }

    /// Broken bonds that join points on both sides of a line, and whole ones, split by splitting and merging.
    fn crossing(problem: &Elasticity<2, Double>, x: impl Fn(&Vector<2>) -> f64) -> [usize; 4] {
        let Families::Cloud(families) = &problem.body.families else { panic!("a cloud") };
        let words = problem.state.states.words();
        let mut counts = [0; 4];
        for a in 0..problem.body.cloud.n_slots() {
            for bond in families.of(a).filter(|&bond| families.neighbours[bond] as usize != a) {
                let b = families.neighbours[bond] as usize;
                let crosses = x(&problem.body.cloud.position(a)) * x(&problem.body.cloud.position(b)) < 0.0;
                let holds = words[bond / GROUP] >> (bond % GROUP) & 1 == 1;
                counts[2 * usize::from(crosses) + usize::from(holds)] += 1;
            }
        }
        counts
    }

    #[test]
    fn finer_and_coarser_bonds_inherit_the_surface_that_broken_ones_leave() {
        // A surface between the lattice's rows that nobody knows as a crack: through all of the body at x = 1.2.
        for (wanted, label) in
            [("abs(x - 1.2) < 0.3 and t < 1", "split, then merged"), ("x < 1.2 and t < 1", "split on one side")]
        {
            let mut problem = problem::<2>([2.4, 1.0], wanted, "0", Vec::new());
            let surface = Crack::Polyline(vec![[1.2, -1.0], [1.2, 2.0]]);
            problem.state.states.cut(&problem.body, &[surface], 1e-9);
            let side = |x: &Vector<2>| x[0] - 1.2;
            let start = crossing(&problem, side);
            assert!(start[0] == 0 && start[3] == 0 && start[2] > 0);
            for t in [0.0, 0.0, 2.0, 2.0] {
                problem.follow(t, false);
                let [lost, _, broken, healed] = crossing(&problem, side);
                assert!(lost == 0 && healed == 0 && broken > 0, "{label}, t = {t}: {lost} lost, {healed} healed");
            }
            assert_eq!(crossing(&problem, side), start, "{label}: the same lattice, the same bonds");
        }
    }

    #[test]
    fn a_pre_crack_cuts_finer_bonds_where_it_is() {
        // It runs within a row of cells, so that the broken bonds of the lattice alone do not tell where.
        let crack = Crack::Polyline(vec![[-1.0, 0.53], [1.15, 0.53]]);
        let mut problem = problem::<2>([2.4, 1.0], "x < 1.5", "0", vec![crack.clone()]);
        problem.follow(0.0, true);
        let adaptation = problem.adaptation.as_ref().unwrap();
        let body = adaptation.scaling.body(adaptation.cells.cloud(), adaptation.grading());
        let mut expected = BondStates::whole(&body);
        expected.cut(&body, &[crack], 1e-9 * H);
        assert_eq!(problem.state.states, expected);
    }
}
