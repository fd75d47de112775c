//! Families of points whose horizons differ, and what becomes of them when some points are replaced.

use std::ops::Range;

use rayon::prelude::*;

use super::families::{Body, CloudFamilies, Families, GROUP, PIECE, Sites};
use super::search::{self, Accept};
use crate::field::{Vector, difference, norm};
use crate::geometry::Cloud;

/// Whose horizon and micromodulus a bond has. All agree where the horizon and the cells are uniform.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Rule {
    /// In the sum of x every bond has the horizon and the micromodulus of x (Bobaru et al. 2009, section 4.2). Where
    /// horizons differ action is not reaction, against eqs. (38) to (41) of the paper: momentum is not kept.
    Source,
    /// The mean of both ends' micromoduli.
    Average,
    /// Dual horizon: x is pulled by those within its own horizon, and takes the reactions of those that have x in theirs
    /// (Ren et al. 2016). Momentum is kept.
    #[default]
    Dual,
}

impl Rule {
    pub const ALL: [Rule; 3] = [Rule::Source, Rule::Average, Rule::Dual];

    pub fn name(self) -> &'static str {
        match self {
            Rule::Source => "source",
            Rule::Average => "average",
            Rule::Dual => "dual",
        }
    }
}

/// Horizons and cells that differ from point to point, by slot.
#[derive(Debug, Clone)]
pub struct Grading {
    pub rule: Rule,
    /// δ, m.
    pub horizons: Vec<f64>,
    /// Side of the point's cell, m.
    pub sizes: Vec<f64>,
    /// From the point to the centre of its cell, m; empty where every point is in the centre of its own. What follows from
    /// whole families, such as surface corrections, takes points as centred.
    pub shifts: Vec<[f64; 3]>,
}

/// What was done to the families of a body when some of its points were replaced. The default: all are new.
#[derive(Debug, Default)]
pub struct Update {
    /// The old point whose family a new point still has; `NEW` where it was found anew.
    from: Vec<u32>,
}

/// In [`Update`]: no such point.
const NEW: u32 = u32::MAX;

impl<const D: usize> Body<D> {
    /// A body whose horizons differ: the families hold every x′ within `reach` (m) for which `touches(x, x′, ξ)` holds.
    pub fn graded(cloud: Cloud<D>, grading: Grading, reach: f64, touches: &Accept<'_, D>) -> Self {
        let cloud = cloud.scattered_already();
        let (positions, volumes) = cloud.places();
        let mut families = search::families(&positions, 0.0..reach, touches);
        families.sites = Sites::new(&positions, &volumes);
        let horizon = grading.horizons.iter().copied().fold(0.0, f64::max);
        Body { cloud, families: Families::Cloud(families), horizon, grading: Some(grading) }
    }

    /// The body with the points of `cloud` instead. `same`: the old slot of each point that is as it was, in ascending
    /// order, [`u32::MAX`] for the others. Families are found anew within `reach` of a change only.
    pub fn replaced(
        &self,
        cloud: Cloud<D>,
        grading: Grading,
        same: &[u32],
        reach: f64,
        touches: &Accept<'_, D>,
    ) -> (Self, Update) {
        let Families::Cloud(old) = &self.families else {
            // Nothing of a lattice can be kept.
            return (Body::graded(cloud, grading, reach, touches), Update::default());
        };
        let cloud = cloud.scattered_already();
        let ((positions, volumes), (before, _)) = (cloud.places(), self.cloud.places());
        let mut into = vec![NEW; before.len()];
        for (new, &old) in same.iter().enumerate().filter(|(_, old)| **old != NEW) {
            into[old as usize] = new as u32;
        }
        // Places where a point came or went.
        let gone = (0..into.len()).filter(|&k| into[k] == NEW).map(|k| before[k]);
        let come = (0..same.len()).filter(|&k| same[k] == NEW).map(|k| positions[k]);
        let changes: Vec<Vector<D>> = gone.chain(come).collect();
        let near = Near::new(&changes, reach);
        let from: Vec<u32> = (0..same.len())
            .into_par_iter()
            .map(|k| if same[k] == NEW || near.has(&positions[k]) { NEW } else { same[k] })
            .collect();
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for k in (0..from.len()).filter(|&k| from[k] == NEW) {
            match ranges.last_mut() {
                Some(last) if last.end == k && last.len() < PIECE => last.end = k + 1,
                _ => ranges.push(k..k + 1),
            }
        }
        let pieces = search::pieces(&positions, ranges.clone(), 0.0..reach, touches);
        let mut starts = Vec::with_capacity(same.len() + 1);
        starts.push(0);
        let mut neighbours = Vec::with_capacity(old.neighbours.len());
        let (mut k, mut found) = (0, ranges.iter().zip(&pieces));
        while k < from.len() {
            if from[k] == NEW {
                let (range, piece) = found.next().expect("a piece for each range");
                starts.extend(piece.ends.iter().map(|end| (neighbours.len() / GROUP) as u64 + end));
                neighbours.extend_from_slice(&piece.neighbours);
                k = range.end;
            } else {
                neighbours.extend(old.neighbours[old.of(from[k] as usize)].iter().map(|&j| into[j as usize]));
                starts.push((neighbours.len() / GROUP) as u64);
                k += 1;
            }
        }
        let families = CloudFamilies { starts, neighbours, sites: Sites::new(&positions, &volumes) };
        let horizon = grading.horizons.iter().copied().fold(0.0, f64::max);
        (Body { cloud, families: Families::Cloud(families), horizon, grading: Some(grading) }, Update { from })
    }
}

impl CloudFamilies {
    /// The index of the bond from `point` to `other`, if there is one.
    pub fn bond(&self, point: usize, other: usize) -> Option<usize> {
        let (all, row) = (self.of(point), &self.neighbours[self.of(point)]);
        let padding = row.iter().rev().take_while(|&&j| j as usize == point).count();
        row[..row.len() - padding].binary_search(&(other as u32)).ok().map(|k| all.start + k)
    }
}

impl Update {
    /// What is kept with `size` values a group of bonds: of the `old` families where they still are, and `compute`d in the
    /// others.
    pub fn carry<T: Copy + Default + Send + Sync>(
        &self,
        old: Option<(&CloudFamilies, &[T])>,
        families: &CloudFamilies,
        size: usize,
        compute: impl Fn(usize, &mut [T]) + Sync,
    ) -> Vec<T> {
        let mut values = vec![T::default(); families.neighbours.len() / GROUP * size];
        let pieces = CloudFamilies::pieces(&families.starts, &mut values, size);
        pieces.into_par_iter().for_each(|(points, mut values)| {
            for point in points {
                let groups = (families.starts[point + 1] - families.starts[point]) as usize;
                let (row, rest) = std::mem::take(&mut values).split_at_mut(groups * size);
                values = rest;
                match (old, self.from.get(point)) {
                    (Some((old, values)), Some(&from)) if from != NEW => {
                        let first = old.starts[from as usize] as usize * size;
                        row.copy_from_slice(&values[first..first + row.len()]);
                    }
                    _ => compute(point, row),
                }
            }
        });
        values
    }
}

/// Which places are near some others: by the cells of a grid.
struct Near<'a, const D: usize> {
    reach: f64,
    /// Sorted.
    cells: Vec<([i64; D], &'a Vector<D>)>,
}

impl<'a, const D: usize> Near<'a, D> {
    fn new(places: &'a [Vector<D>], reach: f64) -> Self {
        let mut cells: Vec<_> = places.iter().map(|x| (Self::cell(x, reach), x)).collect();
        cells.sort_unstable_by_key(|(cell, _)| *cell);
        Near { reach, cells }
    }

    fn cell(x: &Vector<D>, reach: f64) -> [i64; D] {
        x.map(|x| (x / reach).floor() as i64)
    }

    /// Whether one of them is within the reach of `x`.
    fn has(&self, x: &Vector<D>) -> bool {
        let here = Self::cell(x, self.reach);
        // Cells that differ along the last axis follow each other.
        (0..3usize.pow(D as u32 - 1)).any(|k| {
            let mut low = here;
            let mut rest = k;
            for c in &mut low[..D - 1] {
                *c += rest as i64 % 3 - 1;
                rest /= 3;
            }
            let mut high = low;
            (low[D - 1], high[D - 1]) = (here[D - 1] - 1, here[D - 1] + 1);
            let first = self.cells.partition_point(|(cell, _)| *cell < low);
            let near = self.cells[first..].iter().take_while(|(cell, _)| *cell <= high);
            near.into_iter().any(|(_, place)| norm(&difference(place, x)) <= self.reach)
        })
    }
}
