//! What is beyond the ends of a body: mirrors and periods of a case, as images of its points.

use super::super::model::{self, Parity, Side};
use super::Builder;
use super::conditions::rounded;
use crate::conditions::{MirrorForce, Term};
use crate::discretization::{PartialVolume, rim};
use crate::error::Result;
use crate::geometry::cloud::cells_of;
use crate::geometry::images::layers;
use crate::geometry::{self, Arrangement, Cloud, Ends, Shape, for_each_cell};

const AXES: [&str; 3] = ["x", "y", "z"];
/// A point so near to a mirror, in spacings, lies on it.
const ON_A_MIRROR: f64 = 1e-6;

impl<const D: usize> Builder<'_, D> {
    /// Mirrors of an axis, with the number of their condition.
    fn mirrors(&self, d: usize) -> impl Iterator<Item = (usize, &model::Mirror)> {
        let conditions = self.case.value.conditions.iter().enumerate();
        conditions.filter_map(move |(k, c)| Some((k, c.mirror.as_ref().filter(|m| m.axis as usize == d)?)))
    }

    /// What makes an axis periodic, with the number of its condition.
    fn periodic(&self, d: usize) -> Option<(usize, &model::Periodic)> {
        let mut conditions = self.case.value.conditions.iter().enumerate();
        conditions.find_map(|(k, c)| Some((k, c.periodic.as_ref().filter(|p| p.axis as usize == d)?)))
    }

    /// How many ends of an axis have images.
    pub(super) fn imaged_ends(&self, d: usize) -> usize {
        if self.periodic(d).is_some() { 2 } else { self.mirrors(d).count() }
    }

    /// Whether there are images beyond the lower and the upper end of an axis.
    pub(super) fn continued(&self, d: usize) -> [bool; 2] {
        let conditions = self.case.value.conditions.iter();
        let mirrored = |side| {
            let mut mirrors = conditions.clone().filter_map(|condition| condition.mirror.as_ref());
            self.periodic(d).is_some() || mirrors.any(|mirror| mirror.axis as usize == d && mirror.side == side)
        };
        [model::Side::Low, model::Side::High].map(mirrored)
    }

    /// The cloud with the images of its points.
    pub(super) fn with_images(
        &self,
        cloud: Cloud<D>,
        shape: Option<&Shape<D>>,
        rule: PartialVolume,
        horizon: f64,
    ) -> Result<Cloud<D>> {
        if (0..D).all(|d| self.imaged_ends(d) == 0) {
            return Ok(cloud);
        }
        let largest = cloud.slots.iter().map(|&slot| cloud.size(slot as usize)).fold(0.0, f64::max);
        let reach = rule.rim::<D>(largest, horizon).end;
        let mut ends = [Ends::Free; D];
        for (d, ends) in ends.iter_mut().enumerate() {
            if let Some((k, periodic)) = self.periodic(d) {
                let path = format!("conditions[{k}].periodic");
                *ends = Ends::Periodic(self.period(periodic, &cloud, shape, d, reach, &path)?);
            }
            let mut mirrors = [None; 2];
            for (k, mirror) in self.mirrors(d) {
                let at = self.plane(mirror, &cloud, shape, d, reach, &format!("conditions[{k}].mirror"))?;
                let parity = match mirror.parity {
                    Parity::Even => geometry::Parity::Even,
                    Parity::Odd => geometry::Parity::Odd,
                };
                mirrors[mirror.side as usize] = Some(geometry::Mirror { at, parity });
                *ends = Ends::Mirrors(mirrors);
            }
        }
        // Printed coordinates may leave a pair on the rim a little beyond it.
        let blur = if self.case.value.geometry.points.is_some() { 2.0 * rim::BLUR * cloud.spacing } else { 0.0 };
        Ok(cloud.with_images(&ends, reach + blur))
    }

    /// Lower face of the cells of a shape along an axis (m), and their number: whole cells from face to face.
    fn faces(&self, shape: &Shape<D>, spacing: f64, d: usize, path: &str) -> Result<[f64; 2]> {
        let (low, high) = shape.bounds();
        let (corner, counts) = cells_of(shape, spacing);
        let cells = (high[d] - low[d]) / spacing;
        if (cells - counts[d] as f64).abs() > 1e-6 * cells {
            let message = format!(
                "the spacing does not divide the body along {}: {cells:.3} cells of {spacing} m from {} to {} m, so that its \
                 ends are not those of its cells",
                AXES[d], low[d], high[d]
            );
            let help = format!(
                "a spacing of {} m does",
                rounded(&[(high[d] - low[d]) / counts[d] as f64]).trim_matches(['(', ')'])
            );
            return Err(self.refuse(path, message, &help));
        }
        Ok([corner[d], corner[d] + counts[d] as f64 * spacing])
    }

    fn period(
        &self,
        periodic: &model::Periodic,
        cloud: &Cloud<D>,
        shape: Option<&Shape<D>>,
        d: usize,
        reach: f64,
        path: &str,
    ) -> Result<f64> {
        let axis = AXES[d];
        let period = match (shape, periodic.period) {
            (Some(shape), _) => {
                let spacing = self.case.value.geometry.spacing.unwrap_or(cloud.spacing);
                let [low, high] = self.faces(shape, spacing, d, path)?;
                self.same_sides(cloud, d, path)?;
                high - low
            }
            (None, given) => {
                let (period, (low, high)) = (given.unwrap_or(f64::INFINITY), cloud.bounds());
                let extent = high[d] - low[d];
                if extent >= period * (1.0 - 1e-9) {
                    let message = format!("the points span {extent} m along {axis}: some would meet images of others");
                    let help = format!(
                        "the period is more than that: {} m, if the last gap is as the others",
                        extent + cloud.spacing
                    );
                    return Err(self.refuse(&format!("{path}.period"), message, &help));
                }
                period
            }
        };
        // A rounding of cells.
        if period < 2.0 * reach * (1.0 - 1e-6) && layers(cloud.spacing, period) < 2 * layers(cloud.spacing, reach) {
            let message = format!(
                "the period of {period} m along {axis} is shorter than a family, which is {} m wide: points would see \
                 others twice",
                2.0 * reach
            );
            return Err(self.refuse(path, message, "make the body longer or the horizon smaller"));
        }
        Ok(period)
    }

    /// Refuses a lattice whose first and last layer do not face each other.
    fn same_sides(&self, cloud: &Cloud<D>, d: usize, path: &str) -> Result<()> {
        let Arrangement::Lattice(lattice) = &cloud.arrangement else { return Ok(()) };
        let mut layer = lattice.counts;
        layer[d] = 1;
        let (mut counts, mut alone) = ([0usize; 2], 0usize);
        for_each_cell(layer, |mut cell| {
            let ends = [0, lattice.counts[d] - 1].map(|at| {
                cell[d] = at;
                cloud.slots.binary_search(&(lattice.slot(cell) as u32)).is_ok()
            });
            (0..2).for_each(|end| counts[end] += usize::from(ends[end]));
            alone += usize::from(ends[0] != ends[1]);
        });
        if alone == 0 {
            return Ok(());
        }
        let what = if counts[0] == counts[1] { "not opposite each other" } else { "of different length" };
        let message = format!(
            "the two sides along {} are {what}: {} cells at the low end and {} at the high end, {alone} of them with none \
             opposite",
            AXES[d], counts[0], counts[1]
        );
        Err(self.refuse(path, message, "a body that goes on periodically begins as it ends"))
    }

    fn plane(
        &self,
        mirror: &model::Mirror,
        cloud: &Cloud<D>,
        shape: Option<&Shape<D>>,
        d: usize,
        reach: f64,
        path: &str,
    ) -> Result<f64> {
        let (axis, (low, high)) = (AXES[d], cloud.bounds());
        let at = match (shape, mirror.at) {
            (Some(shape), _) => {
                let spacing = self.case.value.geometry.spacing.unwrap_or(cloud.spacing);
                self.faces(shape, spacing, d, path)?[mirror.side as usize]
            }
            (None, given) => given.unwrap_or_default(),
        };
        let inside = |x: f64| match mirror.side {
            Side::Low => x - at,
            Side::High => at - x,
        };
        let beyond = |slot: &&u32| inside(cloud.position(**slot as usize)[d]) <= ON_A_MIRROR * cloud.spacing;
        if let Some(first) = cloud.slots.iter().find(beyond) {
            let n = cloud.slots.iter().filter(beyond).count();
            let message = format!(
                "{n} points lie beyond the mirror at {axis} = {at} m or on it, the first at {} m; the body spans {} to {} m",
                rounded(&cloud.position(*first as usize)),
                low[d],
                high[d]
            );
            let help =
                "a point on a mirror would be its own image: let points stand for whole volumes on one side of it";
            return Err(self.refuse(path, message, help));
        }
        // From the plane to the far face of the last cells.
        let last = inside(if mirror.side == Side::Low { high[d] } else { low[d] });
        let is_last = |slot: &&u32| inside(cloud.position(**slot as usize)[d]) >= last;
        let cell = cloud.slots.iter().find(is_last).map_or(cloud.spacing, |&slot| cloud.size(slot as usize));
        let width = last + 0.5 * cell;
        // Images of images along one axis are not made.
        let both = self.mirrors(d).count() == 2;
        if (shape.is_some() || both) && layers(cloud.spacing, width) < layers(cloud.spacing, reach) {
            let message = format!("the body is {width:.3e} m wide along {axis}, and families reach {reach:.3e} m");
            return Err(self.refuse(path, message, "make the body wider or the horizon smaller"));
        }
        Ok(at)
    }

    /// What books the amount that enters through odd mirrors, through which something flows; none through even ones.
    pub(super) fn mirror_amount(&self, cloud: &Cloud<D>) -> Vec<Box<dyn Term>> {
        let odd = |d: usize| self.mirrors(d).filter(|(_, m)| m.parity == Parity::Odd).map(move |(_, m)| (d, m.side));
        let mut names: Vec<String> = (0..D)
            .flat_map(odd)
            .map(|(d, side)| format!("mirror_{}_{}", AXES[d], ["low", "high"][side as usize]))
            .collect();
        let name = match names.len() {
            0 => return Vec::new(),
            1 => names.remove(0),
            // Only their sum is known.
            _ => "mirrors".to_string(),
        };
        let all = cloud.sets.get("all").cloned().unwrap_or_default();
        vec![Box::new(MirrorForce::new(name, all, 0))]
    }

    /// What books the forces of mirrors: a term for each component in which they hold the body.
    pub(super) fn mirror_forces(&self, cloud: &Cloud<D>) -> Vec<Box<dyn Term>> {
        let all = || cloud.sets.get("all").cloned().unwrap_or_default();
        let mut terms: Vec<Box<dyn Term>> = Vec::new();
        for (component, letter) in AXES.iter().enumerate().take(D) {
            // An even mirror pulls across its plane, an odd one along it.
            let mut pulling = Vec::new();
            for d in 0..D {
                for (_, mirror) in self.mirrors(d).filter(|(_, m)| (m.parity == Parity::Even) == (d == component)) {
                    let side = ["low", "high"][mirror.side as usize];
                    let along = if d == component { String::new() } else { format!("_{letter}") };
                    pulling.push(format!("mirror_{}_{side}{along}", AXES[d]));
                }
            }
            let name = match pulling.len() {
                0 => continue,
                1 => pulling.remove(0),
                // Only their sum is known.
                _ => format!("mirrors_{letter}"),
            };
            terms.push(Box::new(MirrorForce::new(name, all(), component)));
        }
        terms
    }
}
