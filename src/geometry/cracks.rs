//! Cracks that exist before loading, and which bonds they cut.
//!
//! A bond is cut when it crosses the crack. What counts when it only touches follows from one
//! picture: the crack lies an infinitesimal way to its **negative side**, and its ends are drawn in
//! by as much. The positive side is the left of a polyline, seen along its vertices; the side from
//! which a polygon's vertices run counter-clockwise; the side of a disc's normal; and the larger
//! coordinate in 1D. A corner of a polyline that a bond only grazes does not cut it. Hence
//!
//! | the bond                                              | is                             |
//! |-------------------------------------------------------|--------------------------------|
//! | crosses the crack between its ends                    | cut                            |
//! | touches an end of a polyline or the edge of a 3D crack| kept                           |
//! | ends on the crack, comes from the negative side       | cut                            |
//! | ends on the crack, comes from the positive side       | kept                           |
//! | lies in the crack                                     | kept                           |
//! | passes through an inner vertex of a polyline          | cut if it changes sides there  |
//!
//! A material point on the crack thus belongs to the positive side, and the crack separates. The
//! answer does not depend on the order of the bond's ends. Mirrored inputs give mirrored answers;
//! to mirror a crack that has points on it, reverse its vertices too, or the sides are exchanged.
//!
//! Coordinates carry rounding errors, so touching needs a length, `tolerance`: what is closer
//! touches. It must be far above rounding and far below the spacing of points and the features of
//! the crack; 1e-9 of the spacing is a good value. Signs beyond it come from exact predicates.
//!
//! Cracks may start outside the body, and should where they open at its surface: then no bond meets
//! their end. Bodies do not know of cracks, and cracks not of bodies.
//!
//! All of this is said of one piece by itself. What pieces do that meet, such as the facets of a
//! surface, is in [`joints`](super::joints).

use super::polygon::{
    bounds_of, check_polygon, closest_on_segment, dimension, distance, doubles_back, edges, finite, norm, orientation,
    polygon_side, positive,
};
use crate::field::Vector;
use robust::{Coord3D, orient3d};
use std::array::from_fn;
use std::borrow::Cow;

/// A crack in `D` dimensions; lengths in metres. See the [module](self) for its two sides.
#[derive(Clone, Debug, PartialEq)]
pub enum Crack<const D: usize> {
    /// Point that cuts every bond which spans it (1D).
    Point(f64),
    /// Two or more vertices in order (2D); closed, without ends, if the last equals the first.
    Polyline(Vec<[f64; 2]>),
    /// Plane, simple polygon (3D).
    Polygon(Vec<[f64; 3]>),
    /// Plane disc (3D).
    Disc {
        /// Midpoint.
        center: [f64; 3],
        /// Direction to the positive side, of any length.
        normal: [f64; 3],
        /// Radius.
        radius: f64,
    },
}

impl<const D: usize> Crack<D> {
    /// Whether the crack cuts the bond from `a` to `b`.
    ///
    /// `tolerance` is the length below which things touch, 1e-9 of the point spacing, say. For
    /// points and polylines it may be zero: then touching is decided exactly.
    ///
    /// Expects a crack that has passed [`validate`](Self::validate).
    pub fn cuts(&self, a: &Vector<D>, b: &Vector<D>, tolerance: f64) -> bool {
        self.blade(tolerance).cuts(a, b)
    }

    /// Whether a point lies on the crack, its ends and edges included. `tolerance` as of [`cuts`](Self::cuts).
    pub fn holds(&self, x: &Vector<D>, tolerance: f64) -> bool {
        match self {
            Crack::Point(at) => (x[0] - at).abs() <= tolerance,
            Crack::Polyline(vertices) => {
                let x = [x[0], x[1]];
                vertices.windows(2).any(|e| distance(&x, &closest_on_segment(&e[0], &e[1], &x)) <= tolerance)
            }
            Crack::Polygon(vertices) => {
                let (x, plane) = ([x[0], x[1], x[2]], Plane::through(vertices));
                let flat = edges(vertices).map(|(p, q)| (plane.flatten(p), plane.flatten(q)));
                let on_edge = |(p, q): ([f64; 3], [f64; 3])| distance(&x, &closest_on_segment(&p, &q, &x)) <= tolerance;
                plane.height(x).abs() <= tolerance
                    && (polygon_side(flat, plane.flatten(x)) < 0.0 || edges(vertices).any(on_edge))
            }
            Crack::Disc { center, normal, radius } => {
                let away = difference(&[x[0], x[1], x[2]], center);
                (dot(normal, &away) / norm(normal)).abs() <= tolerance && norm(&away) <= radius + tolerance
            }
        }
    }

    /// What asks many bonds whether this crack cuts them. `tolerance` as of [`cuts`](Self::cuts).
    pub fn blade(&self, tolerance: f64) -> Blade<'_, D> {
        let (mut low, mut high) = self.bounds();
        for d in 0..D {
            // Twice: what is that far off is not even touched.
            low[d] -= 2.0 * tolerance;
            high[d] += 2.0 * tolerance;
        }
        let plane = match self {
            Crack::Polygon(vertices) => Some(Plane::through(vertices)),
            _ => None,
        };
        Blade { crack: Cow::Borrowed(self), plane, low, high, tolerance }
    }

    /// The same crack with its two sides exchanged.
    pub(super) fn turned(&self) -> Self {
        let mut turned = self.clone();
        match &mut turned {
            Crack::Point(_) => {}
            Crack::Polyline(vertices) => vertices.reverse(),
            Crack::Polygon(vertices) => vertices.reverse(),
            Crack::Disc { normal, .. } => *normal = normal.map(|n| -n),
        }
        turned
    }

    /// Checks sizes, coordinates and whether the crack exists in `D` dimensions.
    ///
    /// Polygons must be plane to 1e-9 of their size, and simple. The message names the value.
    pub fn validate(&self) -> Result<(), String> {
        match self {
            Crack::Point(x) => {
                dimension("a point crack", D, &[1])?;
                finite("point crack", &[*x])
            }
            Crack::Polyline(vertices) => {
                dimension("a polyline crack", D, &[2])?;
                check_polyline(vertices)
            }
            Crack::Polygon(vertices) => {
                dimension("a polygon crack", D, &[3])?;
                check_plane_polygon(vertices)
            }
            Crack::Disc { center, normal, radius } => {
                dimension("a disc crack", D, &[3])?;
                finite("disc crack", center)?;
                finite("disc crack's normal", normal)?;
                positive("length of the disc crack's normal", norm(normal))?;
                positive("radius of the disc crack", *radius)
            }
        }
    }

    /// Smallest and largest coordinates of a box, parallel to the axes, that holds the crack.
    ///
    /// A bond that stays outside is not cut. To skip bonds by this, widen the box by the tolerance of
    /// [`cuts`](Self::cuts): a point on the crack may lie outside by rounding.
    pub fn bounds(&self) -> (Vector<D>, Vector<D>) {
        match self {
            Crack::Point(x) => ([*x; D], [*x; D]),
            Crack::Polyline(vertices) => {
                let (low, high) = bounds_of(vertices);
                (from_fn(|k| low[k]), from_fn(|k| high[k]))
            }
            Crack::Polygon(vertices) => {
                let (low, high) = bounds_of(vertices);
                (from_fn(|k| low[k]), from_fn(|k| high[k]))
            }
            Crack::Disc { center, normal, radius } => {
                let length = norm(normal);
                // √(1 - nₖ²) from the other two components, which does not cancel.
                let reach: [f64; 3] =
                    from_fn(|k| radius * (normal[(k + 1) % 3] / length).hypot(normal[(k + 2) % 3] / length));
                (from_fn(|k| center[k] - reach[k]), from_fn(|k| center[k] + reach[k]))
            }
        }
    }
}

/// A crack made ready to be asked about many bonds.
pub struct Blade<'a, const D: usize> {
    pub(super) crack: Cow<'a, Crack<D>>,
    /// Of a polygon.
    pub(super) plane: Option<Plane>,
    /// A box that holds the crack: bonds beside it are not cut.
    pub(super) low: Vector<D>,
    pub(super) high: Vector<D>,
    pub(super) tolerance: f64,
}

impl<const D: usize> Blade<'_, D> {
    /// Whether both ends of a bond lie `margin` or more beyond one side of the box.
    pub(super) fn beside(&self, a: &Vector<D>, b: &Vector<D>, margin: f64) -> bool {
        let (low, high) = (&self.low, &self.high);
        (0..D).any(|d| {
            (a[d] < low[d] - margin && b[d] < low[d] - margin) || (a[d] > high[d] + margin && b[d] > high[d] + margin)
        })
    }

    /// It with a crack of its own.
    pub(super) fn owned(self) -> Blade<'static, D> {
        let Blade { crack, plane, low, high, tolerance } = self;
        Blade { crack: Cow::Owned(crack.into_owned()), plane, low, high, tolerance }
    }

    /// As [`Crack::cuts`].
    pub fn cuts(&self, a: &Vector<D>, b: &Vector<D>) -> bool {
        let tolerance = self.tolerance;
        if self.beside(a, b, 0.0) {
            return false;
        }
        // One order for both directions: rounded values could depend on it.
        let (a, b) = if b < a { (b, a) } else { (a, b) };
        match &*self.crack {
            Crack::Point(x) => (a[0] - x >= -tolerance) != (b[0] - x >= -tolerance),
            Crack::Polyline(vertices) => {
                let bond = [[a[0], a[1]], [b[0], b[1]]];
                polyline_cuts(vertices, bond, tolerance)
            }
            Crack::Polygon(vertices) => {
                let bond = [[a[0], a[1], a[2]], [b[0], b[1], b[2]]];
                self.plane.as_ref().is_some_and(|plane| polygon_cuts(vertices, plane, bond, tolerance))
            }
            Crack::Disc { center, normal, radius } => {
                let bond = [[a[0], a[1], a[2]], [b[0], b[1], b[2]]];
                let length = norm(normal);
                let heights = bond.map(|x| dot(normal, &difference(&x, center)) / length);
                crossing(bond, heights, tolerance).is_some_and(|point| distance(&point, center) < radius - tolerance)
            }
        }
    }
}

/// A bond is cut between two vertices where it touches neither, or at an inner vertex.
fn polyline_cuts(vertices: &[[f64; 2]], bond: [[f64; 2]; 2], tolerance: f64) -> bool {
    let [a, b] = bond;
    let changes = |is_left: &dyn Fn([f64; 2]) -> bool| is_left(a) != is_left(b);
    let cut_between = |p: [f64; 2], q: [f64; 2]| {
        let (p_side, q_side) = (orientation(a, b, p), orientation(a, b, q));
        ((p_side > 0.0 && q_side < 0.0) || (p_side < 0.0 && q_side > 0.0))
            && changes(&|x| left_of_line(p, q, x, tolerance))
            && !touches(bond, p, tolerance)
            && !touches(bond, q, tolerance)
    };
    let cut_at = |before: [f64; 2], vertex: [f64; 2], after: [f64; 2]| {
        touches(bond, vertex, tolerance) && changes(&|x| left_of_corner(before, vertex, after, x, tolerance))
    };

    let count = vertices.len();
    let closed = vertices[0] == vertices[count - 1];
    vertices.windows(2).any(|edge| cut_between(edge[0], edge[1]))
        || vertices.windows(3).any(|corner| cut_at(corner[0], corner[1], corner[2]))
        || (closed && cut_at(vertices[count - 2], vertices[0], vertices[1]))
}

/// Whether `x` is left of the line from `p` to `q`, or on it.
pub(super) fn left_of_line(p: [f64; 2], q: [f64; 2], x: [f64; 2], tolerance: f64) -> bool {
    orientation(p, q, x) >= -tolerance * distance(&p, &q)
}

/// Whether `x` is left of two edges that meet in a vertex, or on them: left of both where the path
/// turns left, left of one where it turns right.
fn left_of_corner(before: [f64; 2], vertex: [f64; 2], after: [f64; 2], x: [f64; 2], tolerance: f64) -> bool {
    let first = left_of_line(before, vertex, x, tolerance);
    let second = left_of_line(vertex, after, x, tolerance);
    if orientation(before, vertex, after) > 0.0 { first && second } else { first || second }
}

/// Whether a point lies on a bond: on its line, and in its bounding box.
fn touches(bond: [[f64; 2]; 2], point: [f64; 2], tolerance: f64) -> bool {
    let [a, b] = bond;
    let in_box = (0..2).all(|k| a[k].min(b[k]) - tolerance <= point[k] && point[k] <= a[k].max(b[k]) + tolerance);
    in_box && orientation(a, b, point).abs() <= tolerance * distance(&a, &b)
}

fn polygon_cuts(vertices: &[[f64; 3]], plane: &Plane, bond: [[f64; 3]; 2], tolerance: f64) -> bool {
    let Some(point) = crossing(bond, bond.map(|x| plane.height(x)), tolerance) else {
        return false;
    };
    let on_edge = |(p, q): ([f64; 3], [f64; 3])| distance(&point, &closest_on_segment(&p, &q, &point)) <= tolerance;
    let flat = edges(vertices).map(|(p, q)| (plane.flatten(p), plane.flatten(q)));
    polygon_side(flat, plane.flatten(point)) < 0.0 && !edges(vertices).any(on_edge)
}

/// Where a bond passes from one side of a plane to the other, with the heights of its ends above
/// the plane. Ends on the plane belong to the positive side.
pub(super) fn crossing(bond: [[f64; 3]; 2], heights: [f64; 2], tolerance: f64) -> Option<[f64; 3]> {
    let [above_a, above_b] = heights.map(|height| height >= -tolerance);
    if above_a == above_b {
        return None;
    }
    let [a, b] = bond;
    // An end that touches may lie slightly below, like the other one; then it is the crossing.
    let share = (heights[0] / (heights[0] - heights[1])).clamp(0.0, 1.0);
    Some(from_fn(|k| a[k] + share * (b[k] - a[k])))
}

/// Plane of a polygon, through three of its vertices that span it well.
pub(super) struct Plane {
    corners: [[f64; 3]; 3],
    pub(super) normal: [f64; 3],
}

impl Plane {
    fn through(vertices: &[[f64; 3]]) -> Plane {
        let farthest = |measure: &dyn Fn(&[f64; 3]) -> f64| {
            let larger = |a: &&[f64; 3], b: &&[f64; 3]| measure(a).total_cmp(&measure(b));
            *vertices.iter().max_by(larger).expect("3 or more vertices")
        };
        let p = vertices[0];
        let q = farthest(&|x| distance(&p, x));
        let r = farthest(&|x| norm(&cross(&difference(&q, &p), &difference(x, &p))));
        let normal = cross(&difference(&q, &p), &difference(&r, &p));
        // The three corners may run the other way round than the polygon.
        if dot(&normal, &area_vector(vertices)) < 0.0 {
            return Plane { corners: [p, r, q], normal: normal.map(|n| -n) };
        }
        Plane { corners: [p, q, r], normal }
    }

    /// Distance from the plane, positive on the positive side; the sign is exact.
    pub(super) fn height(&self, x: [f64; 3]) -> f64 {
        let coord = |p: [f64; 3]| Coord3D { x: p[0], y: p[1], z: p[2] };
        let [p, q, r] = self.corners.map(coord);
        // `orient3d` is positive below the plane.
        -orient3d(p, q, r, coord(x)) / norm(&self.normal)
    }

    /// Coordinates without the one in which the plane faces most.
    pub(super) fn flatten(&self, x: [f64; 3]) -> [f64; 2] {
        let [along_x, along_y, along_z] = self.normal.map(f64::abs);
        if along_z >= along_x && along_z >= along_y {
            [x[0], x[1]]
        } else if along_y >= along_x {
            [x[0], x[2]]
        } else {
            [x[1], x[2]]
        }
    }
}

fn check_polyline(vertices: &[[f64; 2]]) -> Result<(), String> {
    if vertices.len() < 2 {
        return Err(format!("the polyline crack has {} vertices, but needs at least 2", vertices.len()));
    }
    for vertex in vertices {
        finite("polyline crack", vertex)?;
    }
    if let Some(i) = vertices.windows(2).position(|edge| edge[0] == edge[1]) {
        return Err(format!("the polyline crack has vertex {i} twice in a row: {:?}", vertices[i]));
    }
    let last = vertices.len() - 1;
    if vertices[0] == vertices[last] && doubles_back(vertices[last - 1], vertices[0], vertices[1]) {
        return Err("the closed polyline crack doubles back on itself where it closes".into());
    }
    let back = |corner: &[[f64; 2]]| doubles_back(corner[0], corner[1], corner[2]);
    if let Some(i) = vertices.windows(3).position(back) {
        return Err(format!("the polyline crack doubles back on itself at vertex {}: {:?}", i + 1, vertices[i + 1]));
    }
    Ok(())
}

fn check_plane_polygon(vertices: &[[f64; 3]]) -> Result<(), String> {
    if vertices.len() < 3 {
        return Err(format!("the polygon crack has {} vertices, but needs at least 3", vertices.len()));
    }
    for vertex in vertices {
        finite("polygon crack", vertex)?;
    }
    let plane = Plane::through(vertices);
    let (low, high) = bounds_of(vertices);
    let size = distance(&low, &high);
    // Also refuses vertices on one line: a triangle far thinner than it is long has no plane.
    if norm(&plane.normal) <= 1e-12 * size * size {
        return Err("the vertices of the polygon crack lie on one line".into());
    }
    for (i, vertex) in vertices.iter().enumerate() {
        let height = plane.height(*vertex).abs();
        if height > 1e-9 * size {
            return Err(format!("vertex {i} of the polygon crack lies {height:e} off the plane of the others"));
        }
    }
    let flat: Vec<[f64; 2]> = vertices.iter().map(|v| plane.flatten(*v)).collect();
    check_polygon(&flat)
}

/// Twice the area of a polygon, times its unit normal.
fn area_vector(vertices: &[[f64; 3]]) -> [f64; 3] {
    let origin = vertices[0];
    edges(vertices).fold([0.0; 3], |sum, (p, q)| {
        let part = cross(&difference(&p, &origin), &difference(&q, &origin));
        from_fn(|k| sum[k] + part[k])
    })
}

pub(super) fn difference(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    from_fn(|k| a[k] - b[k])
}

pub(super) fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    type Whole = i128;

    /// Uniform numbers from a 64-bit linear congruential generator (Knuth's constants).
    struct Random(u64);

    impl Random {
        fn below(&mut self, limit: u64) -> Whole {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((self.0 >> 33) % limit) as Whole
        }

        fn point<const N: usize>(&mut self, limit: u64) -> [Whole; N] {
            from_fn(|_| self.below(limit))
        }
    }

    fn float<const N: usize>(x: [Whole; N]) -> [f64; N] {
        x.map(|c| c as f64)
    }

    fn turn(a: [Whole; 2], b: [Whole; 2], c: [Whole; 2]) -> Whole {
        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).signum()
    }

    fn on(p: [Whole; 2], q: [Whole; 2], x: [Whole; 2]) -> bool {
        let between = |k: usize| p[k].min(q[k]) <= x[k] && x[k] <= p[k].max(q[k]);
        turn(p, q, x) == 0 && between(0) && between(1)
    }

    fn cross_properly(a: [Whole; 2], b: [Whole; 2], p: [Whole; 2], q: [Whole; 2]) -> bool {
        turn(a, b, p) * turn(a, b, q) < 0 && turn(p, q, a) * turn(p, q, b) < 0
    }

    /// Random open polyline with corners on a small grid that does not double back.
    fn path(random: &mut Random, count: usize, limit: u64) -> Vec<[Whole; 2]> {
        loop {
            let vertices: Vec<[Whole; 2]> = (0..count).map(|_| random.point(limit)).collect();
            let floats = vertices.iter().map(|v| float(*v)).collect();
            let open = vertices[0] != vertices[count - 1];
            if open && Crack::<2>::Polyline(floats).validate().is_ok() {
                return vertices;
            }
        }
    }

    /// The picture of the module header, taken literally in whole numbers: vertices moved to the
    /// right of the path by about 1e-6 of the grid's unit, ends drawn in by 1e-3, and then only proper
    /// crossings counted.
    ///
    /// On a grid of 7 x 7, directions differ by an angle with a sine of 1/72 or more, so 1e-6 to the
    /// side is below 1e-4 along the path, and crossings that miss an end miss it by 1/72 or more.
    fn displaced(vertices: &[[Whole; 2]]) -> Vec<[Whole; 2]> {
        const UNIT: f64 = 1e12;
        let direction = |i: usize| {
            let (p, q) = (float(vertices[i]), float(vertices[i + 1]));
            let length = distance(&p, &q);
            [(q[0] - p[0]) / length, (q[1] - p[1]) / length]
        };
        let last = vertices.len() - 1;
        let right = |d: [f64; 2]| [d[1], -d[0]];
        // Unequal and irrational, or a bond could meet a displaced vertex.
        let offset = |edge: usize| 1e-6 * (1.0 + 0.1 * 2.0_f64.sqrt() * edge as f64);
        (0..=last)
            .map(|i| {
                let v = float(vertices[i]);
                let shift: [f64; 2] = if i == 0 || i == last {
                    let (d, inward) = if i == 0 { (direction(0), 1e-3) } else { (direction(last - 1), -1e-3) };
                    from_fn(|k| offset(i.min(last - 1)) * right(d)[k] + inward * d[k])
                } else {
                    let [n, m] = [i - 1, i].map(|edge| right(direction(edge)));
                    let [s, t] = [i - 1, i].map(offset);
                    let sine = n[0] * m[1] - n[1] * m[0];
                    if sine.abs() < 1e-9 {
                        let along = direction(i);
                        from_fn(|k| s * (n[k] + 0.1 * 3.0_f64.sqrt() * along[k]))
                    } else {
                        // Where the displaced lines of both edges meet.
                        [(s * m[1] - t * n[1]) / sine, (t * n[0] - s * m[0]) / sine]
                    }
                };
                from_fn(|k| ((v[k] + shift[k]) * UNIT).round() as Whole)
            })
            .collect()
    }

    fn grid_unit(x: [Whole; 2]) -> [Whole; 2] {
        x.map(|c| c * 1_000_000_000_000)
    }

    #[test]
    fn polylines_cut_what_crosses_them_displaced_to_their_negative_side() {
        let mut random = Random(1);
        let (mut cut, mut grazed, mut checked) = (0, 0, 0);
        for _ in 0..3000 {
            let count = 2 + random.below(3) as usize;
            let vertices = path(&mut random, count, 7);
            let moved = displaced(&vertices);
            let crack = Crack::<2>::Polyline(vertices.iter().map(|v| float(*v)).collect());
            for _ in 0..100 {
                let (a, b) = (random.point::<2>(7), random.point::<2>(7));
                let mut crossed: Vec<bool> =
                    moved.windows(2).map(|s| cross_properly(grid_unit(a), grid_unit(b), s[0], s[1])).collect();
                for i in 1..vertices.len() - 1 {
                    // A corner that the bond only grazes: in on one edge, out on the next.
                    if on(a, b, vertices[i]) && crossed[i - 1] && crossed[i] {
                        (crossed[i - 1], crossed[i]) = (false, false);
                        grazed += 1;
                    }
                }
                let expected = crossed.contains(&true);
                for tolerance in [0.0, 1e-9] {
                    let found = crack.cuts(&float(a), &float(b), tolerance);
                    assert_eq!(found, expected, "{vertices:?} {a:?} {b:?} {tolerance}");
                }
                cut += usize::from(expected);
                checked += 1;
            }
        }
        assert!(cut > checked / 10 && cut < checked / 2 && grazed > 100);
    }

    #[test]
    fn polylines_answer_alike_for_reversed_bonds_and_mirrored_inputs() {
        let mut random = Random(2);
        for _ in 0..3000 {
            // 0.1 is no binary fraction, so points on the crack are so up to rounding.
            let scale = |v: &[Whole; 2]| v.map(|c| 0.1 * c as f64 - 0.3);
            let mirror = |v: [f64; 2]| [v[0], -v[1]];
            let vertices: Vec<[f64; 2]> = path(&mut random, 3, 9).iter().map(scale).collect();
            let mut mirrored: Vec<[f64; 2]> = vertices.iter().map(|v| mirror(*v)).collect();
            mirrored.reverse();
            let crack = Crack::<2>::Polyline(vertices);
            let mirrored = Crack::<2>::Polyline(mirrored);
            for _ in 0..50 {
                let (a, b) = (scale(&random.point(9)), scale(&random.point(9)));
                let cut = crack.cuts(&a, &b, 1e-10);
                assert_eq!(crack.cuts(&b, &a, 1e-10), cut);
                assert_eq!(mirrored.cuts(&mirror(a), &mirror(b), 1e-10), cut);
            }
        }
    }

    #[test]
    fn touching_bonds_follow_the_table() {
        let crack = Crack::<2>::Polyline(vec![[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]]);
        let noise = 1e-12;
        for y in [-noise, 0.0, noise] {
            let cuts = |a: [f64; 2], b: [f64; 2]| crack.cuts(&a, &b, 1e-9);
            assert!(cuts([1.0, -1.0], [1.5, 1.0]));
            // Ends of the crack.
            assert!(!cuts([-1.0, -1.0], [1.0, 1.0 + y]));
            assert!(!cuts([0.0, y], [0.0, -1.0]));
            assert!(!cuts([4.0 + y, -1.0], [4.0, 1.0]));
            // Ends of the bond.
            assert!(cuts([1.0, y], [1.5, -1.0]));
            assert!(!cuts([1.0, y], [1.5, 1.0]));
            assert!(!cuts([1.0, y], [3.0, 0.0]));
            assert!(!cuts([-1.0, y], [5.0, 0.0]));
            // The inner vertex.
            assert!(cuts([1.0, -1.0], [3.0, 1.0 + y]));
            assert!(cuts([2.0, y], [2.0, -1.0]));
            assert!(!cuts([2.0, y], [2.0, 1.0]));
        }
        let tent = Crack::<2>::Polyline(vec![[0.0, 0.0], [2.0, 1.0], [4.0, 0.0]]);
        assert!(!tent.cuts(&[1.0, 1.0], &[3.0, 1.0], 1e-9));
        assert!(tent.cuts(&[2.0, 0.0], &[2.0, 2.0], 1e-9));
    }

    #[test]
    fn closed_polylines_cut_at_their_seam_like_elsewhere() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        for start in 0..4 {
            let mut vertices: Vec<[f64; 2]> = (0..5).map(|i| square[(start + i) % 4]).collect();
            assert!(Crack::<2>::Polyline(vertices.clone()).validate().is_ok());
            let inward = Crack::<2>::Polyline(vertices.clone());
            vertices.reverse();
            let outward = Crack::<2>::Polyline(vertices);
            for corner in square {
                let [x, y] = corner;
                let (inside, outside) = ([0.5, 0.5], [2.0 * x - 0.5, 2.0 * y - 0.5]);
                assert!(inward.cuts(&inside, &outside, 1e-9));
                assert!(!inward.cuts(&inside, &corner, 1e-9));
                assert!(inward.cuts(&outside, &corner, 1e-9));
                assert!(outward.cuts(&inside, &corner, 1e-9));
                assert!(!outward.cuts(&outside, &corner, 1e-9));
            }
        }
    }

    /// 300 x 120 points at the centres of cells of size h = 0.1 / 300, in [-0.05, 0.05] x
    /// [-0.02, 0.02], and a crack from the left edge to the middle.
    ///
    /// In half cells from the tip all coordinates are whole, and so is the sign of the crossing's x.
    #[test]
    fn edge_crack_in_a_plate_cuts_2688_bonds_symmetrically() {
        let h = 0.1 / 300.0;
        let at = |i: i64, j: i64| [-0.05 + (i as f64 + 0.5) * h, -0.02 + (j as f64 + 0.5) * h];
        let crack = Crack::<2>::Polyline(vec![[-0.05, 0.0], [0.0, 0.0]]);
        crack.validate().unwrap();
        let from_outside = Crack::<2>::Polyline(vec![[-0.07, 0.0], [-0.05, 0.0], [0.0, 0.0]]);
        let reversed = Crack::<2>::Polyline(vec![[0.0, 0.0], [-0.05, 0.0]]);
        let tolerance = 1e-9 * h;

        let (mut bonds, mut through_tip) = (0, 0);
        let mut cut = HashSet::new();
        for (i, j) in (0..300 * 120).map(|point| (point % 300, point / 300)) {
            for (di, dj) in (0..49).map(|n| (n % 7 - 3, n / 7 - 3)) {
                let (k, l) = (i + di, j + dj);
                let half = dj > 0 || (dj == 0 && di > 0);
                let in_plate = (0..300).contains(&k) && (0..120).contains(&l);
                if !half || !in_plate || di * di + dj * dj > 9 {
                    continue;
                }
                bonds += 1;
                let (a, b) = (at(i, j), at(k, l));
                let is_cut = crack.cuts(&a, &b, tolerance);
                assert_eq!(crack.cuts(&b, &a, tolerance), is_cut);
                assert_eq!(from_outside.cuts(&a, &b, tolerance), is_cut);
                assert_eq!(reversed.cuts(&a, &b, tolerance), is_cut);
                let (x, y) = (2 * i - 299, 2 * j - 119);
                let spans = y < 0 && y + 2 * dj > 0;
                let crossing = x * dj - y * di;
                assert_eq!(is_cut, spans && crossing < 0);
                through_tip += usize::from(spans && crossing == 0);
                if is_cut {
                    cut.insert(((i, j), (k, l)));
                }
            }
        }
        assert_eq!((bonds, cut.len(), through_tip), (496_458, 2688, 6));
        for &((i, j), (k, l)) in &cut {
            assert!(cut.contains(&((k, 119 - l), (i, 119 - j))));
        }
    }

    #[test]
    fn rectangle_in_a_block_cuts_by_count_and_symmetrically() {
        let (n, h) = ([12, 8, 6], 0.1 / 12.0);
        let low = [-0.05, -4.0 * h, -3.0 * h];
        let at = |i: [i64; 3]| -> [f64; 3] { from_fn(|k| low[k] + (i[k] as f64 + 0.5) * h) };
        // Through the whole block, and as far as its middle; both start outside.
        let rectangle = |end: f64| {
            let vertices = vec![[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [end, 0.0, 1.0], [end, 0.0, -1.0]];
            let crack = Crack::<3>::Polygon(vertices);
            crack.validate().unwrap();
            crack
        };
        let (whole, half) = (rectangle(1.0), rectangle(0.0));
        let flat_half = Crack::<2>::Polyline(vec![[-1.0, 0.0], [0.0, 0.0]]);

        let tolerance = 1e-9 * h;
        let (mut cut, mut expected, mut cut_half) = (0, 0, HashSet::new());
        for offset in (0..343).map(|c: i64| [c % 7 - 3, c / 7 % 7 - 3, c / 49 - 3]) {
            if offset[1] <= 0 || offset.iter().map(|d| d * d).sum::<i64>() > 9 {
                continue;
            }
            // The bond starts in the rows below the middle, as many as it climbs.
            expected += offset[1] * (n[0] - offset[0].abs()) * (n[2] - offset[2].abs());
            for i in (0..n[0] * n[1] * n[2]).map(|p| [p % 12, p / 12 % 8, p / 96]) {
                let j: [i64; 3] = from_fn(|k| i[k] + offset[k]);
                if (0..3).any(|k| j[k] < 0 || j[k] >= n[k]) {
                    continue;
                }
                let (a, b) = (at(i), at(j));
                cut += i64::from(whole.cuts(&a, &b, tolerance));
                let is_cut = half.cuts(&a, &b, tolerance);
                assert_eq!(half.cuts(&b, &a, tolerance), is_cut);
                let flat = flat_half.cuts(&[a[0], a[1]], &[b[0], b[1]], tolerance);
                assert_eq!(flat, is_cut);
                if is_cut {
                    cut_half.insert((i, j));
                }
            }
        }
        assert_eq!(cut, expected);
        assert!(!cut_half.is_empty());
        let mirror = |i: [i64; 3]| [i[0], n[1] - 1 - i[1], i[2]];
        for &(i, j) in &cut_half {
            assert!(cut_half.contains(&(mirror(j), mirror(i))));
        }
    }

    /// A polygon with whole coordinates in the plane z = x + y. The bond's crossing is rational,
    /// and its place in the polygon is decided in whole numbers.
    #[test]
    fn polygons_agree_with_rational_arithmetic() {
        let lift = |p: [Whole; 2]| [p[0], p[1], p[0] + p[1]];
        let mut random = Random(3);
        let (mut cut, mut kept_on_edge, mut from_plane) = (0, 0, 0);
        for _ in 0..4000 {
            let count = 3 + random.below(4) as usize;
            let flat: Vec<[Whole; 2]> = (0..count).map(|_| random.point(7)).collect();
            let solid = flat.iter().map(|p| float(lift(*p))).collect();
            let crack = Crack::<3>::Polygon(solid);
            if crack.validate().is_err() {
                continue;
            }
            let area: Whole = edges(&flat).map(|(p, q)| p[0] * q[1] - p[1] * q[0]).sum();
            for _ in 0..100 {
                let (a, b) = (random.point::<3>(13), random.point::<3>(13));
                let height = |x: [Whole; 3]| (x[2] - x[0] - x[1]) * area.signum();
                let (up, down) = (height(a), height(b));
                let expected = (up >= 0) != (down >= 0) && {
                    // Everything times the denominator of the crossing.
                    let scale = (up - down).abs();
                    let sign = (up - down).signum();
                    let c: [Whole; 2] = from_fn(|k| sign * (b[k] * up - a[k] * down));
                    let big: Vec<[Whole; 2]> = flat.iter().map(|p| p.map(|x| x * scale)).collect();
                    let on_edge = edges(&big).any(|(p, q)| on(p, q, c));
                    let crossings = edges(&big)
                        .filter(|(p, q)| (p[1] > c[1]) != (q[1] > c[1]) && (turn(*p, *q, c) > 0) == (q[1] > p[1]))
                        .count();
                    kept_on_edge += usize::from(on_edge);
                    !on_edge && crossings % 2 == 1
                };
                for (a, b) in [(a, b), (b, a)] {
                    let found = crack.cuts(&float(a), &float(b), 1e-9);
                    assert_eq!(found, expected, "{flat:?} {a:?} {b:?}");
                }
                cut += usize::from(expected);
                from_plane += usize::from(expected && up * down == 0);
            }
        }
        assert!(cut > 1000 && kept_on_edge > 1000 && from_plane > 100);
    }

    #[test]
    fn discs_cut_inside_their_radius_and_keep_at_their_rim() {
        let disc = Crack::<3>::Disc { center: [0.0, 0.0, 1.0], normal: [0.0, 0.0, 2.0], radius: 5.0 };
        disc.validate().unwrap();
        let cuts = |a: [f64; 3], b: [f64; 3]| {
            assert_eq!(disc.cuts(&a, &b, 1e-9), disc.cuts(&b, &a, 1e-9));
            disc.cuts(&a, &b, 1e-9)
        };
        assert!(cuts([1.0, 1.0, 0.0], [2.0, 2.0, 3.0]));
        assert!(cuts([2.99, 4.0, 0.0], [2.99, 4.0, 3.0]));
        assert!(!cuts([3.0, 4.0, 0.0], [3.0, 4.0, 3.0]));
        assert!(!cuts([4.0, 4.0, 0.0], [4.0, 4.0, 3.0]));
        assert!(cuts([1.0, 1.0, 1.0], [1.0, 1.0, 0.0]));
        assert!(!cuts([1.0, 1.0, 1.0], [1.0, 1.0, 2.0]));
        assert!(!cuts([1.0, 1.0, 1.0], [1.0, 2.0, 1.0]));
        assert_eq!(disc.bounds(), ([-5.0, -5.0, 1.0], [5.0, 5.0, 1.0]));
    }

    #[test]
    fn points_on_a_crack_are_those_on_it_and_on_its_ends() {
        let on = |crack: &Crack<2>, x: [f64; 2]| crack.holds(&x, 1e-9);
        let path = Crack::Polyline(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
        assert!(on(&path, [0.0, 0.0]) && on(&path, [0.5, 0.0]) && on(&path, [1.0, 0.7]) && on(&path, [1.0, 1.0]));
        assert!(!on(&path, [-1e-8, 0.0]) && !on(&path, [0.5, 1e-8]) && !on(&path, [1.0, 1.1]));
        let square = [[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [1.0, 1.0, 0.5], [0.0, 1.0, 0.5]].to_vec();
        let disc = Crack::<3>::Disc { center: [0.5, 0.5, 0.5], normal: [0.0, 0.0, 2.0], radius: 0.5 };
        for crack in [Crack::<3>::Polygon(square), disc] {
            for (x, expected) in [([0.5, 0.5, 0.5], true), ([0.5, 0.0, 0.5], true), ([0.5, 0.5, 0.6], false)] {
                assert_eq!(crack.holds(&x, 1e-9), expected, "{crack:?} {x:?}");
            }
            assert!(!crack.holds(&[1.5, 0.5, 0.5], 1e-9));
        }
        assert!(Crack::<1>::Point(0.5).holds(&[0.5], 0.0) && !Crack::<1>::Point(0.5).holds(&[0.6], 1e-9));
    }

    #[test]
    fn points_cut_the_bonds_that_span_them() {
        let crack = Crack::<1>::Point(0.3);
        crack.validate().unwrap();
        let on = 0.1 + 0.2;
        assert!(crack.cuts(&[0.0], &[1.0], 1e-9) && crack.cuts(&[1.0], &[0.0], 1e-9));
        assert!(!crack.cuts(&[0.4], &[1.0], 1e-9));
        assert!(crack.cuts(&[on], &[0.0], 1e-9));
        assert!(!crack.cuts(&[on], &[1.0], 1e-9));
        assert_eq!(crack.bounds(), ([0.3], [0.3]));
    }

    #[test]
    fn bonds_outside_the_bounds_are_not_cut() {
        let normal = [1.0, 2.0, -0.5];
        let disc = Crack::<3>::Disc { center: [3.0; 3], normal, radius: 2.0 };
        let (low, high) = disc.bounds();
        let mut random = Random(4);
        let mut cut = 0;
        for _ in 0..20_000 {
            let (a, b) = (float(random.point::<3>(7)), float(random.point::<3>(7)));
            if disc.cuts(&a, &b, 1e-9) {
                cut += 1;
                assert!((0..3).all(|k| a[k].min(b[k]) <= high[k] && a[k].max(b[k]) >= low[k]));
            }
        }
        assert!(cut > 1000);
        // The rim's highest point attains the bound: the centre plus the radius along the part of
        // the axis that lies in the plane.
        let axis = [1.0, 0.0, 0.0];
        let share = dot(&axis, &normal) / dot(&normal, &normal);
        let in_plane: [f64; 3] = from_fn(|k| axis[k] - share * normal[k]);
        assert!((3.0 + 2.0 * in_plane[0] / norm(&in_plane) - high[0]).abs() < 1e-14);
    }

    #[test]
    fn wrong_cracks_are_refused_in_plain_words() {
        let polyline = |vertices: &[[f64; 2]]| {
            let crack = Crack::<2>::Polyline(vertices.to_vec());
            crack.validate().unwrap_err()
        };
        assert!(polyline(&[[0.0, 0.0]]).contains("at least 2"));
        assert!(polyline(&[[0.0, 0.0], [0.0, 0.0]]).contains("twice in a row"));
        assert!(polyline(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0]]).contains("doubles back"));
        assert!(polyline(&[[0.0, f64::NAN], [2.0, 0.0]]).contains("finite"));

        let polygon = |vertices: &[[f64; 3]]| {
            let crack = Crack::<3>::Polygon(vertices.to_vec());
            crack.validate().unwrap_err()
        };
        let line = [[0.0; 3], [1.0; 3], [2.0; 3]];
        assert!(polygon(&line).contains("on one line"));
        let bent = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.1], [0.0, 1.0, 0.0]];
        assert!(polygon(&bent).contains("off the plane"));
        let bow_tie = [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(polygon(&bow_tie).contains("intersects itself"));

        let flat = Crack::<2>::Disc { center: [0.0; 3], normal: [0.0; 3], radius: 1.0 };
        assert!(flat.validate().unwrap_err().contains("3 dimensions"));
        let no_normal = Crack::<3>::Disc { center: [0.0; 3], normal: [0.0; 3], radius: 1.0 };
        assert!(no_normal.validate().unwrap_err().contains("normal"));
    }
}
