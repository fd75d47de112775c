//! Forces and moments on sets of points, and those that bonds transmit through a plane.
//!
//! Of a set Σ (f + b) V, which is the rate of its momentum; through a plane Σ Σ f(x, x′) V V′ over the whole bonds from x behind
//! it to x′ before it (Lehoucq & Silling 2008, "Force flux and the peridynamic stress tensor"). Pairs within a part
//! cancel, so that
//!
//! ```text
//! rate of the momentum behind a plane = force through the plane + loads behind it
//! ```
//!
//! at any instant, to rounding. Moments have the levers that the law balances: positions x where it is linear, else x + u.

use super::Elasticity;
use super::bond_forces::Pulled;
use crate::execution::Packs;
use crate::family::Families;
use crate::field::{Number, Vector, components, difference, dot, embed, norm};
use crate::parallel;
use crate::physics::{ForceAndMoment, Resultant};

/// Points whose forces are added to each other before they are added to others: fixed, so that sums are the same on any number
/// of threads.
const CHUNK: usize = 4096;
/// Points this near to a plane, in spacings, are on it: as near as rounding may put those that should be.
const ON_THE_PLANE: f64 = 1e-9;

impl<const D: usize, P: Packs> Elasticity<D, P> {
    pub(super) fn force_and_moment(&mut self, of: &Resultant) -> Option<ForceAndMoment> {
        match of {
            Resultant::OnSet { set, about } => self.on_set(set, *about),
            Resultant::ThroughCut { point, normal, about } => {
                let [point, normal, about] = [point, normal, about].map(shortened::<D>);
                Some(self.pulled(|pulled| through_cut(pulled, &point, &normal, &about)))
            }
        }
    }

    /// None where there is no such set.
    fn on_set(&self, set: &str, about: Option<[f64; 3]>) -> Option<ForceAndMoment> {
        let cloud = &self.body.cloud;
        let slots = cloud.sets.get(set)?;
        let about = about.map_or_else(|| self.centroid(slots), |about| shortened::<D>(&about));
        let [u, force] = [&self.state.displacement, &self.state.force].map(|flat| components::<D, _>(flat));
        let is_linear = self.material.is_linear();
        Some(sum(slots.len(), &|k| {
            let slot = slots[k] as usize;
            let place = |d: usize| if is_linear { 0.0 } else { u[d][slot].to_f64() };
            let (x, volume) = (cloud.position(slot), cloud.volume(slot));
            let lever: Vector<D> = std::array::from_fn(|d| x[d] + place(d) - about[d]);
            ForceAndMoment::at(&lever, &std::array::from_fn(|d| volume * force[d][slot].to_f64()))
        }))
    }

    /// Σ x V/Σ V of reference positions.
    fn centroid(&self, slots: &[u32]) -> Vector<D> {
        let (mut sum, mut volume) = ([0.0; D], 0.0);
        for slot in slots.iter().map(|&slot| slot as usize) {
            let (x, v) = (self.body.cloud.position(slot), self.body.cloud.volume(slot));
            (0..D).for_each(|d| sum[d] += v * x[d]);
            volume += v;
        }
        sum.map(|x| if volume > 0.0 { x / volume } else { 0.0 })
    }
}

/// A point on the plane is behind it.
fn through_cut<const D: usize>(
    pulled: &Pulled<'_, D>,
    point: &Vector<D>,
    normal: &Vector<D>,
    about: &Vector<D>,
) -> ForceAndMoment {
    let cloud = &pulled.body.cloud;
    let reach = match &pulled.body.families {
        Families::Lattice(families) => families.longest(),
        Families::Cloud(_) => 2.0 * pulled.body.horizon,
    };
    let normal = unit(normal);
    let height = |slot: usize| dot(&difference(&cloud.position(slot), point), &normal);
    let on_the_plane = ON_THE_PLANE * cloud.spacing;
    sum(cloud.slots.len(), &|k| {
        let here = cloud.slots[k] as usize;
        let above = height(here);
        if above > on_the_plane || above < -(reach + on_the_plane) {
            return ForceAndMoment::default();
        }
        let mut force = [0.0; D];
        for bond in (pulled.bonds)(here).iter().filter(|bond| height(bond.there) > on_the_plane) {
            (0..D).for_each(|d| force[d] += bond.pair[d]);
        }
        let (x, volume) = (cloud.position(here), cloud.volume(here));
        let moved = |d: usize| if pulled.is_linear { 0.0 } else { pulled.displacement[d][here] };
        let lever: Vector<D> = std::array::from_fn(|d| x[d] + moved(d) - about[d]);
        ForceAndMoment::at(&lever, &force.map(|f| volume * f))
    })
}

/// Σ over 0..n, in chunks of fixed size added in order.
fn sum(n: usize, of: &(dyn Fn(usize) -> ForceAndMoment + Sync)) -> ForceAndMoment {
    let chunk = |chunk: usize| {
        let points = chunk * CHUNK..((chunk + 1) * CHUNK).min(n);
        points.map(of).fold(ForceAndMoment::default(), ForceAndMoment::plus)
    };
    parallel::map(n.div_ceil(CHUNK), &chunk).into_iter().fold(ForceAndMoment::default(), ForceAndMoment::plus)
}

impl ForceAndMoment {
    /// Of a force (N) that acts at the end of a lever (m).
    fn at<const D: usize>(lever: &Vector<D>, force: &Vector<D>) -> Self {
        let (lever, force) = (embed(lever), embed(force));
        let moment = std::array::from_fn(|d| {
            let (a, b) = ((d + 1) % 3, (d + 2) % 3);
            lever[a] * force[b] - lever[b] * force[a]
        });
        ForceAndMoment { force, moment }
    }

    fn plus(self, other: Self) -> Self {
        let add = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|d| a[d] + b[d]);
        ForceAndMoment { force: add(self.force, other.force), moment: add(self.moment, other.moment) }
    }
}

/// Of length one, whatever the length was: squares of very small or large numbers would not do.
fn unit<const D: usize>(a: &Vector<D>) -> Vector<D> {
    let largest = a.iter().fold(0.0f64, |largest, a| largest.max(a.abs()));
    let scaled = a.map(|a| a / largest);
    scaled.map(|a| a / norm(&scaled))
}

/// The components that there are.
fn shortened<const D: usize>(a: &[f64; 3]) -> Vector<D> {
    std::array::from_fn(|d| a[d])
}
