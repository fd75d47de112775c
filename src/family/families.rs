//! Families: on a lattice one list of offsets shared by all points, elsewhere a compressed list for each point.

use std::ops::Range;
use std::sync::OnceLock;

use super::graded::Grading;
use super::search;
use crate::field::{Vector, difference, norm};
use crate::geometry::lattice::BLOCK;
use crate::geometry::{Arrangement, Cloud, Lattice};

/// A cloud and its families: what every operator is built on.
#[derive(Debug, Clone)]
pub struct Body<const D: usize> {
    pub cloud: Cloud<D>,
    pub families: Families<D>,
    /// δ, m; the largest where they differ.
    pub horizon: f64,
    /// Where horizons differ from point to point.
    pub grading: Option<Grading>,
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

/// The shared family of a lattice: offsets in sequences, one for each direction among the octants, faces and axes.
///
/// The sequences of a class are mirror images of each other. Each is summed by itself and their sums are added as a
/// balanced tree, so that a sum is unchanged, to the last bit, when the body is mirrored along an axis: a problem that is
/// symmetric stays symmetric.
#[derive(Debug, Clone)]
pub struct LatticeFamilies<const D: usize> {
    pub lattice: Lattice<D>,
    pub offsets: Vec<Offset<D>>,
    pub classes: Vec<Class>,
    /// Blocks of slots that hold a point, in the order in which they are visited: a sparse body does not pay for its box.
    pub blocks: Vec<u32>,
}

/// Offsets that point along the same axes: 2^axes sequences, one for each choice of signs, bit by bit from the lowest
/// axis up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Class {
    /// The first offset of the first sequence.
    pub first: u32,
    /// Offsets in each sequence.
    pub members: u32,
    /// 1 to D.
    pub axes: u32,
}

/// Neighbours of a point of a cloud that are visited together, and whose bits are one word of states.
pub const GROUP: usize = 16;

/// Families of a scattered cloud, each padded to a multiple of [`GROUP`] with the point itself (a bond that never
/// exists), so that a vector of bonds needs no remainder.
#[derive(Debug, Clone)]
pub struct CloudFamilies {
    /// First group of [`GROUP`] neighbours of each point, and one past the last.
    pub starts: Vec<u64>,
    /// Ascending in each family, the padding behind.
    pub neighbours: Vec<u32>,
    pub sites: Sites,
}

/// Where the points of a cloud are, as the loops read them: a record a point, fetched whole.
#[derive(Debug, Clone, Default)]
pub struct Sites {
    /// x, y, z (zero beyond the dimension; m) and the volume of the point.
    pub records: Vec<[f64; 4]>,
    fixed: OnceLock<FixedSites>,
}

/// The same for single precision. Coordinates are whole multiples of `unit`, so that ξ, a difference of integers, has the
/// full precision of its numbers wherever the cloud lies.
#[derive(Debug, Clone)]
pub struct FixedSites {
    /// x, y, z in units, and the bits of the volume in its unit as an `f32`.
    pub records: Vec<[i32; 4]>,
    /// m
    pub unit: f64,
    /// The largest volume, m³.
    pub volume_unit: f64,
}

impl Sites {
    pub(super) fn new<const D: usize>(positions: &[Vector<D>], volumes: &[f64]) -> Self {
        let record = |(x, v): (&Vector<D>, &f64)| {
            let mut record = [0.0, 0.0, 0.0, *v];
            record[..D].copy_from_slice(x);
            record
        };
        Sites { records: positions.iter().zip(volumes).map(record).collect(), fixed: OnceLock::new() }
    }

    /// In whole units, made when first asked for.
    pub fn fixed(&self) -> &FixedSites {
        self.fixed.get_or_init(|| {
            let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for record in &self.records {
                for d in 0..3 {
                    low[d] = low[d].min(record[d]);
                    high[d] = high[d].max(record[d]);
                }
            }
            let size = (0..3).map(|d| high[d] - low[d]).fold(f64::MIN_POSITIVE, f64::max);
            let unit = size / f64::from(1 << 30);
            let volume_unit = self.records.iter().map(|r| r[3]).fold(f64::MIN_POSITIVE, f64::max);
            let fix = |record: &[f64; 4]| {
                let [x, y, z] = std::array::from_fn(|d| ((record[d] - low[d]) / unit).round() as i32);
                [x, y, z, ((record[3] / volume_unit) as f32).to_bits().cast_signed()]
            };
            FixedSites { records: self.records.iter().map(fix).collect(), unit, volume_unit }
        })
    }
}

/// Points that a thread takes at once when families, and what is stored for their bonds, are set up.
pub(super) const PIECE: usize = 512;

impl<const D: usize> Body<D> {
    /// Finds the families of `cloud`: all x′ ≠ x with |ξ| ≤ `rim.start`, and those with |ξ| ≤ `rim.end` for which
    /// `accept(ξ)` holds.
    ///
    /// `rim` and `accept` come from the partial-volume rule, which knows how far beyond δ a cell still matters.
    pub fn new(cloud: Cloud<D>, horizon: f64, rim: Range<f64>, accept: impl Fn(&Vector<D>) -> bool + Sync) -> Self {
        let families = match &cloud.arrangement {
            Arrangement::Lattice(lattice) => {
                Families::Lattice(LatticeFamilies::new(lattice, &cloud.slots, rim, accept))
            }
            Arrangement::Scattered { .. } => return Body::seeing(cloud, horizon, rim, &|_, _, xi| accept(xi)),
        };
        Body { cloud, families, horizon, grading: None }
    }

    /// The same of a scattered cloud, where `accept` may depend on both points.
    pub fn seeing(cloud: Cloud<D>, horizon: f64, rim: Range<f64>, accept: &search::Accept<'_, D>) -> Self {
        let cloud = cloud.scattered_already();
        let Arrangement::Scattered { positions, volumes } = &cloud.arrangement else {
            unreachable!("no lattice any more")
        };
        let mut families = search::families(positions, rim, accept);
        families.sites = Sites::new(positions, volumes);
        families.keep(cloud.n_points());
        Body { cloud, families: Families::Cloud(families), horizon, grading: None }
    }
}

/// What of a lattice and what of a cloud: whoever goes from bond to bond outside the loops of `execution` asks here.
impl<const D: usize> Body<D> {
    /// The bonds of a point that are in its family: the number of the bit of each, and the slot of x′.
    pub fn bonds_of(&self, slot: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        // One of two, the other empty: without a pointer to either.
        let (shared, own) = match &self.families {
            Families::Lattice(families) => {
                let (n, lattice) = (families.offsets.len(), &families.lattice);
                let block = slot.checked_sub(lattice.guard).map_or(usize::MAX, |inside| inside / BLOCK);
                let offsets = if block < lattice.n_blocks() { &families.offsets[..] } else { &[] };
                let bond = move |(k, offset): (usize, &Offset<D>)| {
                    ((block * n + k) * BLOCK + slot % BLOCK, slot.wrapping_add_signed(offset.shift))
                };
                (Some(offsets.iter().enumerate().map(bond)), None)
            }
            Families::Cloud(families) => {
                let bonds = families.of(slot).map(|bond| (bond, families.neighbours[bond] as usize));
                (None, Some(bonds.filter(move |(_, there)| *there != slot)))
            }
        };
        shared.into_iter().flatten().chain(own.into_iter().flatten())
    }

    /// ξ of the bond with the state `bit` between two slots, m: on a lattice that which all points share.
    pub fn xi(&self, bit: usize, here: usize, there: usize) -> Vector<D> {
        match &self.families {
            Families::Lattice(families) => families.offsets[bit / BLOCK % families.offsets.len()].xi,
            Families::Cloud(_) => difference(&self.cloud.position(there), &self.cloud.position(here)),
        }
    }

    /// The slots of x and x′ of the bond whose state is bit `bit % 16` of word `bit / 16`.
    pub fn ends_of(&self, bit: usize) -> [usize; 2] {
        match &self.families {
            Families::Lattice(families) => {
                let (word, n) = (bit / BLOCK, families.offsets.len());
                let slot = families.lattice.guard + word / n * BLOCK + bit % BLOCK;
                [slot, slot.wrapping_add_signed(families.offsets[word % n].shift)]
            }
            Families::Cloud(families) => {
                let group = (bit / GROUP) as u64;
                let point = families.starts.partition_point(|&start| start <= group) - 1;
                [point, families.neighbours[bit] as usize]
            }
        }
    }

    /// How many words the states of all bonds are.
    pub fn n_words(&self) -> usize {
        match &self.families {
            Families::Lattice(families) => families.lattice.n_blocks() * families.offsets.len(),
            Families::Cloud(families) => families.neighbours.len() / GROUP,
        }
    }
}

impl<const D: usize> LatticeFamilies<D> {
    fn new(lattice: &Lattice<D>, slots: &[u32], rim: Range<f64>, accept: impl Fn(&Vector<D>) -> bool) -> Self {
        let h = lattice.spacing;
        let n = (rim.end / h).ceil() as i32;
        // Steps with no negative component: each stands for its mirror images.
        let mut steps: Vec<[i32; D]> = Vec::new();
        crate::geometry::cloud::for_each_cell([n as usize + 1; D], |cell| {
            let step = cell.map(|c| c as i32);
            let xi = step.map(|c| f64::from(c) * h);
            if step != [0; D] && (norm(&xi) <= rim.start || norm(&xi) <= rim.end && accept(&xi)) {
                steps.push(step);
            }
        });
        let (steps, classes) = mirror_sequences(steps);
        let offset = |step: [i32; D]| {
            let xi = step.map(|c| f64::from(c) * h);
            Offset { step, shift: lattice.shift(step), xi, length: norm(&xi) }
        };
        let offsets = steps.into_iter().map(offset).collect();
        let mut blocks: Vec<u32> = slots.iter().map(|&s| ((s as usize - lattice.guard) / BLOCK) as u32).collect();
        blocks.dedup();
        tile(lattice, n as usize, &mut blocks);
        LatticeFamilies { lattice: lattice.clone(), offsets, classes, blocks }
    }
}

/// All mirror images of steps without negative components, in the sequences of a [`LatticeFamilies`].
pub fn mirror_sequences<const D: usize>(mut steps: Vec<[i32; D]>) -> (Vec<[i32; D]>, Vec<Class>) {
    let axes_of = |step: &[i32; D]| (0..D).filter(|&d| step[d] != 0).fold(0u32, |bits, d| bits | 1 << d);
    steps.sort_by_key(|step| (axes_of(step), step.iter().map(|c| c * c).sum::<i32>(), *step));
    let (mut images, mut classes) = (Vec::new(), Vec::new());
    for members in steps.chunk_by(|a, b| axes_of(a) == axes_of(b)) {
        let axes: Vec<usize> = (0..D).filter(|&d| members[0][d] != 0).collect();
        let first = images.len() as u32;
        for signs in 0..1u32 << axes.len() {
            for member in members {
                let mut step = *member;
                for (k, &d) in axes.iter().enumerate() {
                    if signs >> k & 1 == 1 {
                        step[d] = -step[d];
                    }
                }
                images.push(step);
            }
        }
        classes.push(Class { first, members: members.len() as u32, axes: axes.len() as u32 });
    }
    (images, classes)
}

/// Bytes of a field that the rows of a tile may take in all planes that its families reach: half of a small second-level
/// cache, for three components of eight bytes.
const TILE_BYTES: usize = 512 * 1024;

/// Puts the blocks of a solid in the order of tiles of rows, each tile plane by plane, so that the planes that its
/// families reach stay in the cache while it is swept.
fn tile<const D: usize>(lattice: &Lattice<D>, reach: usize, blocks: &mut [u32]) {
    if D < 3 {
        return;
    }
    let row = lattice.strides[1];
    let planes = 2 * reach + 1;
    let rows = (TILE_BYTES / (planes * row * 3 * size_of::<f64>())).saturating_sub(2 * reach).max(8);
    let (row_blocks, n_rows) = ((row / BLOCK) as u32, lattice.counts[1] as u32);
    blocks.sort_by_cached_key(|block| {
        let (y, z) = (block / row_blocks % n_rows, block / row_blocks / n_rows);
        (y / rows as u32, z, *block)
    });
}

impl<const D: usize> LatticeFamilies<D> {
    /// |ξ| of the longest bond, m.
    pub fn longest(&self) -> f64 {
        self.offsets.iter().map(|o| o.length).fold(0.0, f64::max)
    }
}

impl CloudFamilies {
    /// Empties the families of all but the first `n` slots: images are seen, and see nobody.
    fn keep(&mut self, n: usize) {
        let groups = self.starts[n];
        self.starts[n..].fill(groups);
        self.neighbours.truncate(groups as usize * GROUP);
    }

    /// The neighbours of a point with the index of their bond, padding included.
    #[inline]
    pub fn of(&self, point: usize) -> Range<usize> {
        self.starts[point] as usize * GROUP..self.starts[point + 1] as usize * GROUP
    }

    /// Splits what is stored with `size` values a group of [`GROUP`] bonds into the shares of consecutive points.
    pub fn pieces<'a, T>(starts: &[u64], mut values: &'a mut [T], size: usize) -> Vec<(Range<usize>, &'a mut [T])> {
        let n_points = starts.len() - 1;
        let piece = |first: usize| {
            let points = first..(first + PIECE).min(n_points);
            let groups = (starts[points.end] - starts[points.start]) as usize;
            let (share, rest) = std::mem::take(&mut values).split_at_mut(groups * size);
            values = rest;
            (points, share)
        };
        (0..n_points).step_by(PIECE).map(piece).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Shape;

    #[test]
    fn offsets_of_a_lattice_are_the_points_of_a_ball_in_mirror_sequences() {
        let cube = Shape::Box { low: [0.0; 3], high: [1.0; 3] };
        let body = Body::new(Cloud::lattice(&cube, 0.1, 3), 0.3, 0.3..0.3 * (1.0 + 1e-9), |_| true);
        let Families::Lattice(families) = &body.families else { panic!("a lattice") };
        assert_eq!(families.offsets.len(), 122);
        let mut next = 0;
        for class in &families.classes {
            assert_eq!(class.first, next);
            let members = class.members as usize;
            for sequence in 0..1 << class.axes {
                for k in 0..members {
                    let [image, original] = [sequence * members + k, k].map(|k| &families.offsets[next as usize + k]);
                    assert_eq!(image.step.map(i32::abs), original.step);
                }
            }
            next += class.members << class.axes;
        }
        assert_eq!(next, 122);
    }
}
