//! All points of a body: where they are, how much matter each stands for, which sets they belong to.
//!
//! Points are numbered in point order (what files and reports show); fields are stored in slots, which are places along
//! a space-filling curve for a scattered cloud and the cells of a padded box for a lattice.

use std::ops::Range;

use super::{Images, Lattice, PointSets, Shape, TIE, curve};
use crate::field::Vector;
use crate::parallel;

/// How the points of a cloud lie.
#[derive(Debug, Clone)]
pub enum Arrangement<const D: usize> {
    /// Cells of a box; a point's place follows from its slot.
    Lattice(Lattice<D>),
    /// Anywhere, slot by slot along a curve, images behind all points. Positions in m; volumes in m³ (3D), m² (2D), m (1D).
    Scattered { positions: Vec<Vector<D>>, volumes: Vec<f64> },
}

/// The points of a body.
#[derive(Debug, Clone)]
pub struct Cloud<const D: usize> {
    pub arrangement: Arrangement<D>,
    /// Slot of each point; ascending on a lattice.
    pub slots: Vec<u32>,
    /// Δx, m: the lattice spacing, or the mean of volume^(1/D) of a scattered cloud.
    pub spacing: f64,
    /// Whether the volumes of a scattered cloud are one, but for the rounding of printed ones.
    pub same_size: bool,
    pub sets: PointSets,
    /// What points see beyond mirrors and periodic ends; none of these is a point.
    pub images: Option<Images<D>>,
}

impl<const D: usize> Cloud<D> {
    /// Fills `shape` with cubic cells whose centres lie inside it or on its border. The box of cells is centred on the shape's bounds;
    /// `reach` is the largest distance of a neighbour in cells.
    ///
    /// A [`Shape::Box`] is filled whole, without asking each centre, so that rounding cannot lose a row.
    pub fn lattice(shape: &Shape<D>, spacing: f64, reach: usize) -> Self {
        let (corner, counts) = cells_of(shape, spacing);
        let lattice = Lattice::new(corner, spacing, counts, reach);
        let whole = matches!(shape, Shape::Box { .. });
        let mut slots = Vec::new();
        for_each_cell(counts, |cell| {
            if whole || shape.holds(&lattice.position(cell), TIE * spacing) {
                slots.push(lattice.slot(cell) as u32);
            }
        });
        Cloud {
            arrangement: Arrangement::Lattice(lattice),
            slots,
            spacing,
            same_size: true,
            sets: PointSets::default(),
            images: None,
        }
    }

    /// Points anywhere, with their volumes, stored along a Hilbert curve.
    pub fn scattered(positions: Vec<Vector<D>>, volumes: Vec<f64>) -> Self {
        assert_eq!(positions.len(), volumes.len(), "each point has a volume");
        let mean = volumes.iter().sum::<f64>() / volumes.len().max(1) as f64;
        let same_size = are_same(&volumes);
        let order = curve::order(&positions);
        let mut slots = vec![0; order.len()];
        for (slot, &point) in order.iter().enumerate() {
            slots[point as usize] = slot as u32;
        }
        let positions = parallel::map(order.len(), &|k| positions[order[k] as usize]);
        let volumes = parallel::map(order.len(), &|k| volumes[order[k] as usize]);
        Cloud {
            arrangement: Arrangement::Scattered { positions, volumes },
            slots,
            spacing: mean.powf(1.0 / D as f64),
            same_size,
            sets: PointSets::default(),
            images: None,
        }
    }

    /// The same points, cells of no lattice any more; sets are left behind.
    pub fn scatter(&self) -> Self {
        let slots = self.slots.iter().map(|&slot| slot as usize);
        let positions = slots.clone().map(|slot| self.position(slot)).collect();
        Cloud { spacing: self.spacing, ..Cloud::scattered(positions, slots.map(|slot| self.volume(slot)).collect()) }
    }

    /// Itself, or if it is a lattice the same points as no lattice any more.
    pub fn scattered_already(self) -> Self {
        match self.arrangement {
            Arrangement::Lattice(_) => self.scatter(),
            Arrangement::Scattered { .. } => self,
        }
    }

    /// Positions (m) and volumes by slot.
    pub fn places(&self) -> (Vec<Vector<D>>, Vec<f64>) {
        let slots = 0..self.n_slots();
        (slots.clone().map(|slot| self.position(slot)).collect(), slots.map(|slot| self.volume(slot)).collect())
    }

    /// Points that lie along a curve already, so that slots are in point order.
    pub fn along_curve(positions: Vec<Vector<D>>, volumes: Vec<f64>) -> Self {
        let slots = (0..positions.len() as u32).collect();
        let mean = volumes.iter().sum::<f64>() / volumes.len().max(1) as f64;
        let (spacing, same_size) = (mean.powf(1.0 / D as f64), are_same(&volumes));
        let arrangement = Arrangement::Scattered { positions, volumes };
        Cloud { arrangement, slots, spacing, same_size, sets: PointSets::default(), images: None }
    }

    pub fn n_points(&self) -> usize {
        self.slots.len()
    }

    /// Length of one component of every field on this cloud.
    pub fn n_slots(&self) -> usize {
        match &self.arrangement {
            Arrangement::Lattice(lattice) => lattice.n_slots,
            Arrangement::Scattered { positions, .. } => positions.len(),
        }
    }

    /// x of the point in `slot`, m.
    #[inline]
    pub fn position(&self, slot: usize) -> Vector<D> {
        match &self.arrangement {
            Arrangement::Lattice(lattice) => lattice.position(lattice.cell(slot)),
            Arrangement::Scattered { positions, .. } => positions[slot],
        }
    }

    /// V of the point in `slot`, m³ (3D), m² (2D, unit thickness), m (1D, unit cross-section).
    #[inline]
    pub fn volume(&self, slot: usize) -> f64 {
        match &self.arrangement {
            Arrangement::Lattice(lattice) => lattice.cell_volume(),
            Arrangement::Scattered { volumes, .. } => volumes[slot],
        }
    }

    /// Side of the cell of the point in `slot`, m: the spacing, or where volumes differ the root of its own.
    pub fn size(&self, slot: usize) -> f64 {
        if self.is_uniform() { self.spacing } else { self.volume(slot).powf(1.0 / D as f64) }
    }

    /// Whether all cells are of one size, but for the rounding of printed volumes.
    pub fn is_uniform(&self) -> bool {
        match &self.arrangement {
            Arrangement::Lattice(_) => true,
            Arrangement::Scattered { .. } => self.same_size,
        }
    }

    /// Lowest and highest coordinates of all points, m.
    pub fn bounds(&self) -> (Vector<D>, Vector<D>) {
        let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
        for &slot in &self.slots {
            let x = self.position(slot as usize);
            for d in 0..D {
                low[d] = low[d].min(x[d]);
                high[d] = high[d].max(x[d]);
            }
        }
        (low, high)
    }

    /// The slots that hold a point, from the `range.start`-th on, ascending: the order in which memory is walked.
    #[inline]
    pub fn stored(&self, range: Range<usize>) -> impl Iterator<Item = usize> {
        let lattice = matches!(self.arrangement, Arrangement::Lattice(_));
        range.map(move |k| if lattice { self.slots[k] as usize } else { k })
    }

    /// Length below which things touch the point in `slot`, m: [`TIE`] of the side of its cell.
    pub fn tie(&self, slot: usize) -> f64 {
        TIE * self.size(slot)
    }

    /// Slots of the points for which `inside` holds, ascending.
    pub fn select(&self, mut inside: impl FnMut(&Vector<D>) -> bool) -> Vec<u32> {
        self.select_with_ties(|x, _| inside(x))
    }

    /// The same, of a question that needs to know the [tie](Self::tie) of a point.
    pub fn select_with_ties(&self, mut inside: impl FnMut(&Vector<D>, f64) -> bool) -> Vec<u32> {
        let holds = |slot: &usize| inside(&self.position(*slot), self.tie(*slot));
        self.stored(0..self.n_points()).filter(holds).map(|slot| slot as u32).collect()
    }

    /// Slots of points, ascending, each once.
    pub fn slots_of(&self, points: &[u32]) -> Vec<u32> {
        let mut slots: Vec<u32> = points.iter().map(|&point| self.slots[point as usize]).collect();
        slots.sort_unstable();
        slots.dedup();
        slots
    }
}

/// Whether volumes are one, but for the rounding of six printed digits.
fn are_same(volumes: &[f64]) -> bool {
    let (low, high) = volumes.iter().fold((f64::INFINITY, 0.0), |(low, high), v| (v.min(low), v.max(high)));
    high <= low * (1.0 + 1e-5)
}

/// Lower corner (m) and number of the cells of the box that [`Cloud::lattice`] fills.
pub fn cells_of<const D: usize>(shape: &Shape<D>, spacing: f64) -> (Vector<D>, [usize; D]) {
    let (low, high) = shape.bounds();
    // Half a cell more is a tie as well.
    let whole = |d: usize| ((high[d] - low[d]) / spacing + 0.5 + TIE).floor().max(1.0) as usize;
    let counts: [usize; D] = std::array::from_fn(whole);
    let corner = std::array::from_fn(|d| {
        let centre = 0.5 * (low[d] + high[d]);
        // An exact fit keeps the shape's own corner: no rounding from the centre.
        let exact = ((high[d] - low[d]) / spacing - counts[d] as f64).abs() < 1e-6;
        if exact { low[d] } else { centre - 0.5 * counts[d] as f64 * spacing }
    });
    (corner, counts)
}

/// Calls `visit` for each cell of a box, in storage order (x fastest).
pub fn for_each_cell<const D: usize>(counts: [usize; D], mut visit: impl FnMut([usize; D])) {
    let mut cell = [0; D];
    if counts.contains(&0) {
        return;
    }
    loop {
        visit(cell);
        let mut d = 0;
        loop {
            cell[d] += 1;
            if cell[d] < counts[d] {
                break;
            }
            cell[d] = 0;
            d += 1;
            if d == D {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_on_a_lattice_holds_the_cells_whose_centres_are_inside() {
        let disk = Shape::Ball { center: [0.0, 0.0], radius: 1.0 };
        let cloud = Cloud::lattice(&disk, 0.05, 3);
        assert!(cloud.slots.iter().all(|&s| disk.holds(&cloud.position(s as usize), TIE * 0.05)));
        let area = cloud.n_points() as f64 * 0.05 * 0.05;
        // The staircase misses or adds cells along the rim: a fraction of perimeter × spacing.
        assert!((area - std::f64::consts::PI).abs() < 0.05 * 2.0 * std::f64::consts::PI * 0.25, "{area}");
    }

    #[test]
    fn a_scattered_cloud_keeps_every_point_with_its_volume_and_answers_in_ascending_slots() {
        let positions: Vec<Vector<2>> = (0..500).map(|i| [f64::from(i * 17 % 101), f64::from(i * 29 % 97)]).collect();
        let volumes: Vec<f64> = (1..=500).map(f64::from).collect();
        let cloud = Cloud::scattered(positions.clone(), volumes.clone());
        for (point, &slot) in cloud.slots.iter().enumerate() {
            assert_eq!(cloud.position(slot as usize), positions[point]);
            assert_eq!(cloud.volume(slot as usize), volumes[point]);
        }
        let mut slots = cloud.slots.clone();
        slots.sort_unstable();
        assert!(slots.iter().copied().eq(0..500), "slots are a permutation");
        assert!(!cloud.slots.is_sorted(), "this one is no identity");
        let left = cloud.select(|x| x[0] < 50.0);
        assert!(left.is_sorted() && left.len() == positions.iter().filter(|x| x[0] < 50.0).count());
        let members: Vec<u32> = (0..500).filter(|&i| positions[i as usize][0] < 50.0).collect();
        assert_eq!(cloud.slots_of(&members), left);
    }

    #[test]
    fn a_box_that_fits_keeps_its_corner_to_the_last_bit() {
        let plate = Shape::Box { low: [-0.05, -0.02], high: [0.05, 0.02] };
        let h = 0.1 / 300.0;
        let cloud = Cloud::<2>::lattice(&plate, h, 3);
        assert_eq!(cloud.n_points(), 300 * 120);
        assert_eq!(cloud.position(cloud.slots[0] as usize), [-0.05 + 0.5 * h, -0.02 + 0.5 * h]);
    }
}
