//! Families: on a lattice one list of offsets shared by all points, elsewhere a compressed list for each point.

use std::ops::Range;

use super::search;
use crate::field::{Vector, norm};
use crate::geometry::lattice::BLOCK;
use crate::geometry::{Arrangement, Cloud, Lattice};
use crate::lane::LANES;

/// A cloud and its families: what every operator is built on.
#[derive(Debug, Clone)]
pub struct Body<const D: usize> {
    pub cloud: Cloud<D>,
    pub families: Families<D>,
    /// δ, m.
    pub horizon: f64,
}

/// Who sees whom.
#[derive(Debug, Clone)]
pub enum Families<const D: usize> {
    Lattice(LatticeFamilies<D>),
    Cloud(CloudFamilies),
}

/// One neighbour of every point of a lattice.
#[derive(Debug, Clone)]
pub struct Offset<const D: usize> {
    /// In cells.
    pub step: [i32; D],
    /// In slots.
    pub shift: isize,
    /// ξ, m.
    pub xi: Vector<D>,
    /// |ξ|, m.
    pub length: f64,
}

/// The shared family of a lattice: offsets, grouped so that each group holds all sign changes of one step.
///
/// A sum over a group as a balanced tree is unchanged, to the last bit, when the body is mirrored along an axis; so a
/// problem that is symmetric stays symmetric.
#[derive(Debug, Clone)]
pub struct LatticeFamilies<const D: usize> {
    pub offsets: Vec<Offset<D>>,
    /// Ranges of `offsets` of 2, 4 or 8 members; those of 2 stand first.
    pub groups: Vec<Range<u32>>,
    /// How many groups have 2 members.
    pub n_pairs: usize,
    /// Blocks of slots that hold a point, ascending: a sparse body does not pay for its box.
    pub blocks: Vec<u32>,
}

/// Families of a scattered cloud, each padded to a multiple of [`LANES`] with the point itself (a bond that never
/// exists), so that a vector of bonds needs no remainder.
#[derive(Debug, Clone)]
pub struct CloudFamilies {
    /// First group of [`LANES`] neighbours of each point, and one past the last.
    pub starts: Vec<u64>,
    pub neighbours: Vec<u32>,
}

impl<const D: usize> Body<D> {
    /// Finds the families of `cloud`: all x′ with 0 < |ξ| ≤ `reach` for which `accept(ξ)` holds.
    ///
    /// `reach` and `accept` come from the partial-volume rule, which knows how far beyond δ a cell still matters.
    pub fn new(cloud: Cloud<D>, horizon: f64, reach: f64, accept: impl Fn(&Vector<D>) -> bool + Sync) -> Self {
        let families = match &cloud.arrangement {
            Arrangement::Lattice(lattice) => {
                Families::Lattice(LatticeFamilies::new(lattice, &cloud.slots, reach, accept))
            }
            Arrangement::Scattered { positions, .. } => Families::Cloud(search::families(positions, reach, accept)),
        };
        Body { cloud, families, horizon }
    }
}

impl<const D: usize> LatticeFamilies<D> {
    fn new(lattice: &Lattice<D>, slots: &[u32], reach: f64, accept: impl Fn(&Vector<D>) -> bool) -> Self {
        let h = lattice.spacing;
        let n = (reach / h).ceil() as i32;
        let mut classes: Vec<[i32; D]> = Vec::new();
        crate::geometry::cloud::for_each_cell([n as usize + 1; D], |cell| {
            let step = cell.map(|c| c as i32);
            let xi = step.map(|c| f64::from(c) * h);
            if step != [0; D] && norm(&xi) <= reach && accept(&xi) {
                classes.push(step);
            }
        });
        let axes_of = |step: &[i32; D]| step.iter().filter(|c| **c != 0).count();
        classes.sort_by_key(|step| (axes_of(step) > 1, step.iter().map(|c| c * c).sum::<i32>(), *step));
        let n_pairs = classes.iter().filter(|step| axes_of(step) == 1).count();
        let (mut offsets, mut groups) = (Vec::new(), Vec::new());
        for class in classes {
            let first = offsets.len() as u32;
            let axes: Vec<usize> = (0..D).filter(|&d| class[d] != 0).collect();
            for signs in 0..1u32 << axes.len() {
                let mut step = class;
                for (k, &d) in axes.iter().enumerate() {
                    if signs >> k & 1 == 1 {
                        step[d] = -step[d];
                    }
                }
                let xi = step.map(|c| f64::from(c) * h);
                let shift = (0..D).map(|d| step[d] as isize * lattice.strides[d] as isize).sum();
                offsets.push(Offset { step, shift, xi, length: norm(&xi) });
            }
            groups.push(first..offsets.len() as u32);
        }
        let mut blocks: Vec<u32> = slots.iter().map(|&s| ((s as usize - lattice.guard) / BLOCK) as u32).collect();
        blocks.dedup();
        LatticeFamilies { offsets, groups, n_pairs, blocks }
    }
}

impl<const D: usize> LatticeFamilies<D> {
    /// The groups of two members, and the larger ones.
    #[inline(always)]
    pub fn groups_by_size(&self) -> [&[Range<u32>]; 2] {
        let (pairs, larger) = self.groups.split_at(self.n_pairs);
        [pairs, larger]
    }

    /// |ξ| of the longest bond, m.
    pub fn longest(&self) -> f64 {
        self.offsets.iter().map(|o| o.length).fold(0.0, f64::max)
    }
}

impl CloudFamilies {
    /// The neighbours of a point with the index of their bond, padding included.
    #[inline]
    pub fn of(&self, point: usize) -> Range<usize> {
        self.starts[point] as usize * LANES..self.starts[point + 1] as usize * LANES
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Shape;

    #[test]
    fn offsets_of_a_lattice_are_the_points_of_a_ball_in_mirror_groups() {
        let cube = Shape::Box { low: [0.0; 3], high: [1.0; 3] };
        let body = Body::new(Cloud::lattice(&cube, 0.1, 3), 0.3, 0.3 * (1.0 + 1e-9), |_| true);
        let Families::Lattice(families) = &body.families else { panic!("a lattice") };
        assert_eq!(families.offsets.len(), 122);
        for group in &families.groups {
            let members = &families.offsets[group.start as usize..group.end as usize];
            assert!([2, 4, 8].contains(&members.len()));
            for other in members {
                assert_eq!(other.step.map(i32::abs), members[0].step.map(i32::abs));
            }
        }
    }
}
