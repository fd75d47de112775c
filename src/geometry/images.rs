//! What is beyond a side that is a mirror or goes on periodically: images of points, which the points of a body see.
//!
//! An image has a slot of its own and is no point of the body: `Cloud::slots`, sets, outputs and sums over points do not know
//! it. It has the values of the point that it copies, its source, up to signs: of each component of a vector, and of scalars.
//! Whoever sums over bonds fills the values of images first.
//!
//! On a lattice images are cells of layers around the box of the body; on a scattered cloud they stand behind all points.
//! Axes are taken one after the other, so that a corner has images of images; a source is always a point.

use super::cloud::for_each_cell;
use super::{Arrangement, Cloud, Crack, Lattice, curve};
use crate::field::{Number, Vector};
use crate::parallel;

/// How values are mirrored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parity {
    /// Vectors are mirrored: the component across the plane changes its sign. Scalars are the same on both sides.
    Even,
    /// The opposite of that: the components along the plane change their signs, and scalars do.
    Odd,
}

/// A plane across an axis, at which the body goes on as its own image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mirror {
    /// Coordinate of the plane, m.
    pub at: f64,
    pub parity: Parity,
}

/// What is beyond the two ends of a body along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Ends {
    /// Nothing.
    #[default]
    Free,
    /// A mirror at the lower end, at the upper end.
    Mirrors([Option<Mirror>; 2]),
    /// The body again, so far away, m.
    Periodic(f64),
}

/// Bit of a sign for each component, and this one for scalars.
const SCALAR: u8 = 1 << 7;

/// Where a point goes on its way to one of its images: signs of components, and x → ±x + shift.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Map<const D: usize> {
    signs: u8,
    flips: [bool; D],
    shift: Vector<D>,
}

/// The images of the points of a cloud.
#[derive(Debug, Clone)]
pub struct Images<const D: usize> {
    /// Ascending.
    slots: Vec<u32>,
    /// The slot of the point that each is an image of.
    sources: Vec<u32>,
    /// Bit d: component d changes its sign; [`SCALAR`]: scalars do.
    signs: Vec<u8>,
    /// To the images beyond each end, edge and corner.
    maps: Vec<Map<D>>,
    n_slots: usize,
}

impl<const D: usize> Images<D> {
    /// From (slot, source, signs) of each.
    fn new(mut images: Vec<(u32, u32, u8)>, ends: &[Ends; D], n_slots: usize) -> Self {
        images.sort_unstable();
        let slots = images.iter().map(|image| image.0).collect();
        let sources = images.iter().map(|image| image.1).collect();
        let signs = images.iter().map(|image| image.2).collect();
        let mut maps = vec![Map { signs: 0, flips: [false; D], shift: [0.0; D] }];
        for (d, ends) in ends.iter().enumerate() {
            for before in maps.clone() {
                maps.extend(across::<D>(d, ends).into_iter().flatten().map(|map| map.after(&before, d)));
            }
        }
        maps.remove(0);
        Images { slots, sources, signs, maps, n_slots }
    }

    pub fn len(&self) -> usize {
        self.slots.len()
    }

    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Slot and source of each image, and the sign of each component of its vectors.
    pub fn iter(&self) -> impl Iterator<Item = (usize, usize, [f64; D])> {
        let sign = |signs: u8| std::array::from_fn(|d| if signs >> d & 1 == 1 { -1.0 } else { 1.0 });
        (0..self.len()).map(move |k| (self.slots[k] as usize, self.sources[k] as usize, sign(self.signs[k])))
    }

    /// The point that a slot is an image of, and the sign of each component of its vectors; itself if it is none.
    pub fn source(&self, slot: usize) -> (usize, [f64; D]) {
        match self.slots.binary_search(&(slot as u32)) {
            Ok(k) => {
                let sign = |d| if self.signs[k] >> d & 1 == 1 { -1.0 } else { 1.0 };
                (self.sources[k] as usize, std::array::from_fn(sign))
            }
            Err(_) => (slot, [1.0; D]),
        }
    }

    /// Gives images the vectors of their sources, component after component. Nothing where there is no field.
    pub fn fill<T: Number>(&self, flat: &mut [T]) {
        parallel::fill(flat, self.n_slots, &|first, values| self.signed(values, 1 << (first / self.n_slots)));
    }

    /// Gives images the scalars of their sources, which an odd mirror gives the other sign.
    pub fn fill_scalar<T: Number>(&self, values: &mut [T]) {
        self.signed(values, SCALAR);
    }

    fn signed<T: Number>(&self, values: &mut [T], bit: u8) {
        let sign = [1.0, -1.0].map(T::from_f64);
        for ((&slot, &source), signs) in self.slots.iter().zip(&self.sources).zip(&self.signs) {
            values[slot as usize] = sign[usize::from(signs & bit != 0)] * values[source as usize];
        }
    }

    /// Gives images what their sources are: a class, a modulus, a density.
    pub fn copy<T: Copy>(&self, values: &mut [T]) {
        for (&slot, &source) in self.slots.iter().zip(&self.sources) {
            values[slot as usize] = values[source as usize];
        }
    }

    /// Zero at images, in all components.
    pub fn clear<T: Number>(&self, flat: &mut [T]) {
        parallel::fill(flat, self.n_slots, &|_, values| {
            self.slots.iter().for_each(|&slot| values[slot as usize] = T::default());
        });
    }

    /// The images of a crack: what cuts the images of the bonds that it cuts.
    pub fn of_crack(&self, crack: &Crack<D>) -> Vec<Crack<D>> {
        self.maps.iter().map(|map| map.crack(crack)).collect()
    }

    /// Bytes that it takes.
    pub fn memory(&self) -> usize {
        9 * self.len()
    }
}

/// The ways across the lower and the upper end of an axis.
fn across<const D: usize>(d: usize, ends: &Ends) -> [Option<Map<D>>; 2] {
    let still = Map { signs: 0, flips: [false; D], shift: [0.0; D] };
    let (mut flips, mut shift) = (still.flips, still.shift);
    match ends {
        Ends::Free => [None; 2],
        Ends::Mirrors(mirrors) => mirrors.map(|mirror| {
            let Mirror { at, parity } = mirror?;
            flips[d] = true;
            shift[d] = 2.0 * at;
            let normal = 1u8 << d;
            let signs = match parity {
                Parity::Even => normal,
                Parity::Odd => !normal & ((1 << D) - 1) | SCALAR,
            };
            Some(Map { signs, flips, shift })
        }),
        Ends::Periodic(period) => [-period, *period].map(|by| {
            shift[d] = by;
            Some(Map { shift, ..still })
        }),
    }
}

impl<const D: usize> Map<D> {
    /// This way along axis `d`, and `before` along those before it.
    fn after(&self, before: &Map<D>, d: usize) -> Map<D> {
        let mut map = *before;
        map.signs ^= self.signs;
        map.flips[d] = self.flips[d];
        map.shift[d] = self.shift[d];
        map
    }

    fn coordinate(&self, d: usize, x: f64) -> f64 {
        if self.flips[d] { self.shift[d] - x } else { x + self.shift[d] }
    }

    fn point<const N: usize>(&self, x: &[f64; N]) -> [f64; N] {
        std::array::from_fn(|d| self.coordinate(d, x[d]))
    }

    /// A crack keeps its positive side on the image of that side: a reflection turns the sense of its vertices around.
    fn crack(&self, crack: &Crack<D>) -> Crack<D> {
        let turned = self.flips.iter().filter(|flip| **flip).count() % 2 == 1;
        match crack {
            Crack::Point(x) => Crack::Point(self.coordinate(0, *x)),
            Crack::Polyline(vertices) => Crack::Polyline(self.vertices(vertices, turned)),
            Crack::Polygon(vertices) => Crack::Polygon(self.vertices(vertices, turned)),
            Crack::Disc { center, normal, radius } => {
                let normal = std::array::from_fn(|d| if self.flips[d] { -normal[d] } else { normal[d] });
                Crack::Disc { center: self.point(center), normal, radius: *radius }
            }
        }
    }

    fn vertices<const N: usize>(&self, vertices: &[[f64; N]], turned: bool) -> Vec<[f64; N]> {
        let mut images: Vec<[f64; N]> = vertices.iter().map(|x| self.point(x)).collect();
        if turned {
            images.reverse();
        }
        images
    }
}

impl<const D: usize> Cloud<D> {
    /// The same cloud with the images of the points within `reach` (m) of ends that are not free. Of a lattice the planes
    /// are the faces of its box, and its period is the length of that. Before there are sets, if it is a lattice.
    ///
    /// # Panics
    /// If the body has images already; if a lattice has fewer layers of cells than families reach.
    #[must_use]
    pub fn with_images(self, ends: &[Ends; D], reach: f64) -> Self {
        assert!(self.images.is_none(), "images are made once");
        if ends.iter().all(|ends| *ends == Ends::Free) {
            return self;
        }
        match &self.arrangement {
            Arrangement::Lattice(lattice) => {
                let layers = layers(lattice.spacing, reach);
                let of_layers = |d: usize, end: usize| if across::<D>(d, &ends[d])[end].is_some() { layers } else { 0 };
                let [before, after] = [0, 1].map(|end| std::array::from_fn(|d| of_layers(d, end)));
                let wider = lattice.with_layers(before, after, layers + 1);
                let moved = |slot: &u32| wider.slot(add(lattice.cell(*slot as usize), before)) as u32;
                let slots: Vec<u32> = self.slots.iter().map(moved).collect();
                let images = of_lattice(lattice, &wider, &slots, ends, layers);
                let images = Some(Images::new(images, ends, wider.n_slots));
                Cloud { arrangement: Arrangement::Lattice(wider), slots, images, ..self }
            }
            Arrangement::Scattered { positions, volumes } => {
                let (mut positions, mut volumes) = (positions.clone(), volumes.clone());
                let found = of_scattered(&positions, ends, reach);
                let places: Vec<Vector<D>> = found.iter().map(|(place, ..)| *place).collect();
                let first = positions.len() as u32;
                // Along a curve of their own: families are found faster.
                let images = curve::order(&places).into_iter().zip(first..).map(|(k, slot)| {
                    let (place, source, signs) = found[k as usize];
                    positions.push(place);
                    volumes.push(volumes[source as usize]);
                    (slot, source, signs)
                });
                let images = images.collect();
                let images = Some(Images::new(images, ends, positions.len()));
                Cloud { arrangement: Arrangement::Scattered { positions, volumes }, images, ..self }
            }
        }
    }
}

/// Layers of cells that families reach.
pub fn layers(spacing: f64, reach: f64) -> usize {
    // A reach of whole cells may be a rounding less.
    (reach / spacing + 1e-6).floor() as usize
}

fn add<const D: usize>(a: [usize; D], b: [usize; D]) -> [usize; D] {
    std::array::from_fn(|d| a[d] + b[d])
}

/// (slot, source, signs) of the images of a lattice, in the cells of layers around its box.
fn of_lattice<const D: usize>(
    lattice: &Lattice<D>,
    wider: &Lattice<D>,
    slots: &[u32],
    ends: &[Ends; D],
    layers: usize,
) -> Vec<(u32, u32, u8)> {
    // Source, counted from one, and signs of each cell: 0 where there is nothing.
    let mut source = vec![(0u32, 0u8); wider.n_slots];
    for &slot in slots {
        source[slot as usize] = (slot + 1, 0);
    }
    let mut images = Vec::new();
    for d in 0..D {
        let (n, before) = (lattice.counts[d], wider.before[d]);
        for (end, map) in across::<D>(d, &ends[d]).into_iter().enumerate() {
            let Some(map) = map else { continue };
            assert!(layers <= n, "a body is at least as wide as its families reach");
            let mut layer_counts = wider.counts;
            layer_counts[d] = layers;
            for_each_cell(layer_counts, |mut cell| {
                // The layer, counted from the plane.
                let k = cell[d];
                let [there, here] = match (end, map.flips[d]) {
                    (0, true) => [before - 1 - k, before + k],
                    (0, false) => [before - 1 - k, before + n - 1 - k],
                    (_, true) => [before + n + k, before + n - 1 - k],
                    (_, false) => [before + n + k, before + k],
                };
                cell[d] = here;
                let (from, signs) = source[wider.slot(cell)];
                if from != 0 {
                    cell[d] = there;
                    let slot = wider.slot(cell);
                    source[slot] = (from, signs ^ map.signs);
                    images.push((slot as u32, from - 1, signs ^ map.signs));
                }
            });
        }
    }
    images
}

/// (place, source, signs) of the images of scattered points.
fn of_scattered<const D: usize>(positions: &[Vector<D>], ends: &[Ends; D], reach: f64) -> Vec<(Vector<D>, u32, u8)> {
    let mut images: Vec<(Vector<D>, u32, u8)> = Vec::new();
    for d in 0..D {
        let own = || positions.iter().zip(0..).map(|(x, slot)| (*x, slot, 0));
        let (low, high) =
            positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x[d]), high.max(x[d])));
        let mut found = Vec::new();
        for map in across::<D>(d, &ends[d]).into_iter().flatten() {
            for (x, source, signs) in own().chain(images.iter().copied()) {
                let mut image = x;
                image[d] = map.coordinate(d, x[d]);
                // Nobody sees what is further from all points.
                if image[d] >= low - reach && image[d] <= high + reach {
                    found.push((image, source, signs ^ map.signs));
                }
            }
        }
        images.extend(found);
    }
    images
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Shape;

    const EVEN: Ends = Ends::Mirrors([Some(Mirror { at: 0.0, parity: Parity::Even }), None]);
    const BOTH: Ends =
        Ends::Mirrors([Some(Mirror { at: 0.0, parity: Parity::Odd }), Some(Mirror { at: 5.0, parity: Parity::Even })]);

    /// A box of 6 × 5 cells without a corner.
    fn notched() -> Cloud<2> {
        let square = |low, high| Shape::Box { low, high };
        let shape = Shape::Difference(Box::new(square([0.0, 0.0], [6.0, 5.0])), vec![square([4.5, 3.5], [7.0, 7.0])]);
        Cloud::lattice(&shape, 1.0, 3)
    }

    /// Where an image is, where its source is, and signs: of both components and of scalars.
    fn listed(cloud: &Cloud<2>) -> Vec<([f64; 2], [f64; 2], [f64; 3])> {
        let images = cloud.images.as_ref().unwrap();
        let n = cloud.n_slots();
        let (mut vectors, mut scalars) = (vec![1.0; 2 * n], vec![1.0; n]);
        images.fill(&mut vectors);
        images.fill_scalar(&mut scalars);
        let one = |(slot, source, signs): (usize, usize, [f64; 2])| {
            assert_eq!(signs, [vectors[slot], vectors[n + slot]]);
            assert_eq!(images.source(slot), (source, signs));
            (cloud.position(slot), cloud.position(source), [signs[0], signs[1], scalars[slot]])
        };
        let mut list: Vec<_> = images.iter().map(one).collect();
        list.sort_by(|a, b| a.partial_cmp(b).unwrap());
        list
    }

    #[test]
    fn images_of_a_lattice_are_those_of_its_points() {
        for ends in
            [[EVEN, Ends::Free], [EVEN, BOTH], [Ends::Periodic(6.0), BOTH], [Ends::Periodic(6.0), Ends::Periodic(5.0)]]
        {
            let cloud = notched();
            let before: Vec<[f64; 2]> = cloud.slots.iter().map(|&slot| cloud.position(slot as usize)).collect();
            let scattered = cloud.scatter().with_images(&ends, 2.0);
            let lattice = cloud.with_images(&ends, 2.0);
            let after: Vec<[f64; 2]> = lattice.slots.iter().map(|&slot| lattice.position(slot as usize)).collect();
            assert_eq!(before, after, "points stay where they are");
            // Centres of cells within two layers are within two spacings of the outermost points; all here are numbers
            // without rounding.
            assert_eq!(listed(&lattice), listed(&scattered), "{ends:?}");
        }
    }

    #[test]
    fn a_corner_has_images_of_images() {
        let cloud = notched().with_images(&[EVEN, BOTH], 2.0);
        let at = |x: [f64; 2]| listed(&cloud).into_iter().find(|(place, ..)| *place == x).unwrap();
        assert_eq!(at([-0.5, 2.5]), ([-0.5, 2.5], [0.5, 2.5], [-1.0, 1.0, 1.0]));
        // Odd: along the plane, and scalars.
        assert_eq!(at([1.5, -1.5]), ([1.5, -1.5], [1.5, 1.5], [-1.0, 1.0, -1.0]));
        assert_eq!(at([-0.5, -1.5]), ([-0.5, -1.5], [0.5, 1.5], [1.0, 1.0, -1.0]));
        assert_eq!(at([-1.5, 6.5]), ([-1.5, 6.5], [1.5, 3.5], [-1.0, -1.0, 1.0]));
    }

    #[test]
    fn images_of_a_crack_cut_the_images_of_bonds() {
        let cloud = notched().with_images(&[Ends::Periodic(6.0), BOTH], 2.0);
        let images = cloud.images.as_ref().unwrap();
        // Ends in a point, so that its side counts.
        let crack = Crack::Polyline(vec![[0.5, 0.2], [2.5, 2.5], [4.0, 2.5]]);
        let cracks = images.of_crack(&crack);
        assert_eq!(cracks.len(), 8);
        let points: Vec<[f64; 2]> = cloud.slots.iter().map(|&slot| cloud.position(slot as usize)).collect();
        for (map, image) in images.maps.iter().zip(&cracks) {
            for a in &points {
                for b in &points {
                    assert_eq!(crack.cuts(a, b, 1e-9), image.cuts(&map.point(a), &map.point(b), 1e-9), "{map:?}");
                }
            }
        }
    }
}
