//! Bodies as shapes: which points lie inside, how far the boundary is and where it faces.
//!
//! Every primitive answers one question, its closest boundary point with signed distance and
//! outward normal; inside, distance, projection and normal all follow from that answer. Boxes,
//! cylinders and extrusions are products of lower-dimensional shapes, and `product` joins their
//! factors. The side of a polygon is decided with exact predicates, so a point is never lost
//! between two shapes that share an edge.
//!
//! Unions, differences and intersections combine signed distances by minimum and maximum. That
//! gives the right side of the boundary and a distance that is never too large, but not always the
//! distance itself. Let a cutter of a difference reach past the face that it opens: where the two
//! faces coincide, a film without thickness stays behind.
//!
//! Absent on purpose: rotated boxes and cylinders, meshes, smooth blends.

use super::polygon::{
    bounds_of, check_polygon, closest_on_segment, dimension, distance, edges, finite, norm, polygon_side, positive,
    signed_area,
};
use crate::field::Vector;
use std::array::from_fn;
use std::f64::consts::PI;

/// A body, or a part of one, in `D` dimensions; lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape<const D: usize> {
    /// Segment (1D), rectangle (2D) or box (3D) with faces normal to the axes.
    Box {
        /// Corner with the smallest coordinates.
        low: Vector<D>,
        /// Corner with the largest coordinates.
        high: Vector<D>,
    },
    /// Segment (1D), disk (2D) or sphere (3D).
    Ball {
        /// Midpoint.
        center: Vector<D>,
        /// Radius.
        radius: f64,
    },
    /// Ring (2D) or spherical shell (3D).
    Ring {
        /// Midpoint.
        center: Vector<D>,
        /// Radius of the hollow, greater than zero.
        inner: f64,
        /// Radius of the outside.
        outer: f64,
    },
    /// Cylinder or tube along a coordinate axis (3D).
    Cylinder {
        /// Midpoint of the axis, halfway between the end faces.
        center: Vector<D>,
        /// Coordinate axis along which the cylinder lies, counted from zero.
        axis: usize,
        /// Radius of the outside.
        radius: f64,
        /// Radius of the bore; zero for a solid cylinder.
        inner: f64,
        /// Distance between the end faces.
        length: f64,
    },
    /// Simple polygon in either orientation (2D).
    Polygon {
        /// Corners in order; the last is joined to the first.
        vertices: Vec<[f64; 2]>,
    },
    /// Simple polygon in the x-y plane, extruded along z (3D).
    Extrusion {
        /// Corners in order; the last is joined to the first.
        vertices: Vec<[f64; 2]>,
        /// Lower end in z.
        low: f64,
        /// Upper end in z.
        high: f64,
    },
    /// What lies in any of the members.
    Union(Vec<Shape<D>>),
    /// What lies in the first shape and strictly inside none of the cutters.
    Difference(std::boxed::Box<Shape<D>>, Vec<Shape<D>>),
    /// What lies in all of the members.
    Intersection(Vec<Shape<D>>),
}

impl<const D: usize> Shape<D> {
    /// Checks sizes, polygons and whether the shape exists in `D` dimensions.
    ///
    /// The other methods expect a shape that has passed; the message of an error names the size
    /// and its value. Polygons are checked for self-intersection exactly.
    pub fn validate(&self) -> Result<(), String> {
        match self {
            Shape::Box { low, high } => {
                for k in 0..D {
                    interval("box", low[k], high[k]).map_err(|message| format!("{message} (axis {k})"))?;
                }
                Ok(())
            }
            Shape::Ball { center, radius } => {
                finite("ball", center)?;
                positive("radius of the ball", *radius)
            }
            Shape::Ring { center, inner, outer } => {
                dimension("a ring", D, &[2, 3])?;
                finite("ring", center)?;
                positive("inner radius of the ring", *inner)?;
                positive("outer radius of the ring", *outer)?;
                hollow("ring", *inner, *outer)
            }
            Shape::Cylinder { center, axis, radius, inner, length } => {
                dimension("a cylinder", D, &[3])?;
                finite("cylinder", center)?;
                if *axis >= D {
                    return Err(format!("the axis of the cylinder is {axis}, but must be 0, 1 or 2"));
                }
                positive("radius of the cylinder", *radius)?;
                positive("length of the cylinder", *length)?;
                if *inner != 0.0 {
                    positive("inner radius of the cylinder", *inner)?;
                }
                hollow("cylinder", *inner, *radius)
            }
            Shape::Polygon { vertices } => {
                dimension("a polygon", D, &[2])?;
                check_polygon(vertices)
            }
            Shape::Extrusion { vertices, low, high } => {
                dimension("an extrusion", D, &[3])?;
                interval("extrusion", *low, *high)?;
                check_polygon(vertices)
            }
            Shape::Union(members) => check_members("union", members),
            Shape::Difference(base, cutters) => {
                base.validate().map_err(|message| format!("shape to cut from: {message}"))?;
                if cutters.is_empty() {
                    return Ok(());
                }
                check_members("difference", cutters)
            }
            Shape::Intersection(members) => {
                check_members("intersection", members)?;
                let (low, high) = self.bounds();
                if (0..D).any(|k| low[k] >= high[k]) {
                    return Err("the members of the intersection do not overlap".into());
                }
                Ok(())
            }
        }
    }

    /// Whether the point lies inside the shape or on its boundary.
    pub fn contains(&self, x: &Vector<D>) -> bool {
        self.holds(x, 0.0)
    }

    /// The same, and whether it lies outside by less than a `tie`, m.
    pub fn holds(&self, x: &Vector<D>, tie: f64) -> bool {
        self.signed_distance(x) <= tie
    }

    /// Distance to the boundary, negative inside.
    ///
    /// Exact for primitives. For combined shapes
    ///
    /// ```text
    /// union: min dᵢ     intersection: max dᵢ     difference: max(d, -dᵢ)
    /// ```
    ///
    /// whose magnitude is at most the distance. Where members of a union touch without overlap, it
    /// is zero on the seam.
    pub fn signed_distance(&self, x: &Vector<D>) -> f64 {
        let distance = |shape: &Shape<D>| shape.signed_distance(x);
        match self {
            Shape::Union(members) => members.iter().map(distance).fold(f64::INFINITY, f64::min),
            Shape::Intersection(members) => members.iter().map(distance).fold(f64::NEG_INFINITY, f64::max),
            Shape::Difference(base, cutters) => {
                cutters.iter().map(distance).fold(distance(base), |d, cutter| d.max(-cutter))
            }
            primitive => primitive.nearest(x).distance,
        }
    }

    /// Point of the boundary that lies closest.
    ///
    /// Exact for primitives. For combined shapes the best of the primitives' closest points that lie
    /// on the combined boundary. Another boundary point may be closer where the members' closest
    /// points are cut away or covered.
    pub fn closest_point(&self, x: &Vector<D>) -> Vector<D> {
        self.nearest(x).point
    }

    /// Outward unit normal of the boundary at [`closest_point`](Self::closest_point).
    ///
    /// It is the gradient of the signed distance, on the surface too. On an edge or a corner it is
    /// the direction from there to `x`, and the mean of the adjacent normals when `x` lies on it.
    pub fn normal(&self, x: &Vector<D>) -> Vector<D> {
        self.nearest(x).normal
    }

    /// Smallest and largest coordinates of a box, parallel to the axes, that holds the shape.
    ///
    /// Tight for primitives and unions.
    pub fn bounds(&self) -> (Vector<D>, Vector<D>) {
        let around = |center: &Vector<D>, reach: f64| (center.map(|c| c - reach), center.map(|c| c + reach));
        match self {
            Shape::Box { low, high } => (*low, *high),
            Shape::Ball { center, radius } => around(center, *radius),
            Shape::Ring { center, outer, .. } => around(center, *outer),
            Shape::Cylinder { center, axis, radius, length, .. } => {
                let reach: Vector<D> = from_fn(|k| if k == *axis { 0.5 * length } else { *radius });
                (from_fn(|k| center[k] - reach[k]), from_fn(|k| center[k] + reach[k]))
            }
            Shape::Polygon { vertices } => {
                let (low, high) = bounds_of(vertices);
                (from_fn(|k| low[k]), from_fn(|k| high[k]))
            }
            Shape::Extrusion { vertices, low: bottom, high: top } => {
                let (low, high) = bounds_of(vertices);
                let (low, high) = ([low[0], low[1], *bottom], [high[0], high[1], *top]);
                (from_fn(|k| low[k]), from_fn(|k| high[k]))
            }
            Shape::Union(members) => {
                members.iter().fold(([f64::INFINITY; D], [f64::NEG_INFINITY; D]), |(low, high), member| {
                    let (l, h) = member.bounds();
                    (from_fn(|k| low[k].min(l[k])), from_fn(|k| high[k].max(h[k])))
                })
            }
            Shape::Difference(base, _) => base.bounds(),
            Shape::Intersection(members) => {
                members.iter().fold(([f64::NEG_INFINITY; D], [f64::INFINITY; D]), |(low, high), member| {
                    let (l, h) = member.bounds();
                    (from_fn(|k| low[k].max(l[k])), from_fn(|k| high[k].min(h[k])))
                })
            }
        }
    }

    /// Length (1D), area (2D) or volume (3D) in closed form; `None` for combined shapes.
    pub fn measure(&self) -> Option<f64> {
        let ball = |radius: f64| match D {
            1 => 2.0 * radius,
            2 => PI * radius.powi(2),
            _ => 4.0 / 3.0 * PI * radius.powi(3),
        };
        match self {
            Shape::Box { low, high } => Some((0..D).map(|k| high[k] - low[k]).product()),
            Shape::Ball { radius, .. } => Some(ball(*radius)),
            Shape::Ring { inner, outer, .. } => Some(ball(*outer) - ball(*inner)),
            Shape::Cylinder { radius, inner, length, .. } => Some(PI * (radius.powi(2) - inner.powi(2)) * length),
            Shape::Polygon { vertices } => Some(signed_area(vertices).abs()),
            Shape::Extrusion { vertices, low, high } => Some(signed_area(vertices).abs() * (high - low)),
            Shape::Union(_) | Shape::Difference(..) | Shape::Intersection(_) => None,
        }
    }

    fn nearest(&self, x: &Vector<D>) -> Nearest<D> {
        match self {
            Shape::Box { low, high } => {
                let factors: [Nearest<1>; D] = from_fn(|k| end_of(low[k], high[k], x[k]));
                let (distance, share): (f64, Vector<D>) = product(from_fn(|k| factors[k].distance));
                Nearest {
                    distance,
                    point: from_fn(|k| pick(share[k], factors[k].point[0], x[k])),
                    normal: from_fn(|k| share[k] * factors[k].normal[0]),
                }
            }
            Shape::Ball { center, radius } => shell(x, from_fn(|k| x[k] - center[k]), 0.0, *radius, 0),
            Shape::Ring { center, inner, outer } => shell(x, from_fn(|k| x[k] - center[k]), *inner, *outer, 0),
            Shape::Cylinder { center, axis, radius, inner, length } => {
                let mut across: Vector<D> = from_fn(|k| x[k] - center[k]);
                across[*axis] = 0.0;
                let round = shell(x, across, *inner, *radius, (axis + 1) % D);
                let (low, high) = (center[*axis] - 0.5 * length, center[*axis] + 0.5 * length);
                let end = end_of(low, high, x[*axis]);
                join(x, *axis, &round, &end)
            }
            Shape::Polygon { vertices } => {
                let flat = nearest_on_polygon(vertices, [x[0], x[1]]);
                Nearest {
                    distance: flat.distance,
                    point: from_fn(|k| flat.point[k]),
                    normal: from_fn(|k| flat.normal[k]),
                }
            }
            Shape::Extrusion { vertices, low, high } => {
                let flat = nearest_on_polygon(vertices, [x[0], x[1]]);
                let side = Nearest {
                    distance: flat.distance,
                    point: from_fn(|k| if k < 2 { flat.point[k] } else { x[k] }),
                    normal: from_fn(|k| if k < 2 { flat.normal[k] } else { 0.0 }),
                };
                join(x, 2, &side, &end_of(*low, *high, x[2]))
            }
            Shape::Union(_) | Shape::Difference(..) | Shape::Intersection(_) => self.nearest_of_members(x),
        }
    }

    /// Every boundary point of a combined shape lies on the boundary of a primitive, so the
    /// primitives' closest points are the candidates. Where none of them is on the combined
    /// boundary, an edge between primitives is closest, and a walk reaches it.
    fn nearest_of_members(&self, x: &Vector<D>) -> Nearest<D> {
        let (low, high) = self.bounds();
        let size = (0..D).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        // Far above the rounding of coordinates, far below any feature of a body.
        let near = 1e-9 * size;

        let mut candidates = Vec::new();
        self.collect_nearest(x, 1.0, &mut candidates);
        candidates.push(self.walk_to_boundary(x, near));

        let best = candidates
            .into_iter()
            .min_by(|a, b| {
                let off = |c: &Nearest<D>| self.signed_distance(&c.point).abs() > near;
                let far = |c: &Nearest<D>| distance(x, &c.point);
                off(a).cmp(&off(b)).then(far(a).total_cmp(&far(b)))
            })
            .expect("the walk is always a candidate");
        Nearest { distance: self.signed_distance(x), ..best }
    }

    /// Closest points of all primitives; `sign` is -1 where the primitive is cut away.
    fn collect_nearest(&self, x: &Vector<D>, sign: f64, found: &mut Vec<Nearest<D>>) {
        match self {
            Shape::Union(members) | Shape::Intersection(members) => {
                for member in members {
                    member.collect_nearest(x, sign, found);
                }
            }
            Shape::Difference(base, cutters) => {
                base.collect_nearest(x, sign, found);
                for cutter in cutters {
                    cutter.collect_nearest(x, -sign, found);
                }
            }
            primitive => found.push(primitive.nearest(x).facing(sign)),
        }
    }

    /// Projects onto the primitive that decides the signed distance, until that distance is zero.
    fn walk_to_boundary(&self, x: &Vector<D>, near: f64) -> Nearest<D> {
        // Projections onto two planes in turn converge by cos² of their angle: 200 suffice to 1e-9
        // for angles above 20 degrees. Sharper edges end close to the boundary, but not on it.
        const STEPS: usize = 200;
        let mut here = self.deciding(x, 1.0);
        for _ in 0..STEPS {
            if self.signed_distance(&here.point).abs() <= near {
                break;
            }
            here = self.deciding(&here.point, 1.0);
        }
        here
    }

    /// Closest point of the primitive whose distance is the combined signed distance at `x`.
    fn deciding(&self, x: &Vector<D>, sign: f64) -> Nearest<D> {
        let by_distance = |a: &&Shape<D>, b: &&Shape<D>| a.signed_distance(x).total_cmp(&b.signed_distance(x));
        let expected = "checked by `validate`: at least one member";
        match self {
            Shape::Union(members) => {
                let member = members.iter().min_by(by_distance).expect(expected);
                member.deciding(x, sign)
            }
            Shape::Intersection(members) => {
                let member = members.iter().max_by(by_distance).expect(expected);
                member.deciding(x, sign)
            }
            Shape::Difference(base, cutters) => match cutters.iter().min_by(by_distance) {
                Some(cutter) if -cutter.signed_distance(x) > base.signed_distance(x) => cutter.deciding(x, -sign),
                _ => base.deciding(x, sign),
            },
            primitive => primitive.nearest(x).facing(sign),
        }
    }
}

/// Closest point of a boundary, with signed distance and outward unit normal.
#[derive(Clone, Copy)]
struct Nearest<const D: usize> {
    distance: f64,
    point: Vector<D>,
    normal: Vector<D>,
}

impl<const D: usize> Nearest<D> {
    /// The same boundary seen from the shape (`sign` 1) or from what it was cut out of (-1).
    fn facing(mut self, sign: f64) -> Self {
        self.normal = self.normal.map(|n| sign * n);
        self
    }
}

/// Signed distance to a product of shapes, such as a box from intervals, and the share of each
/// factor in the unit normal.
///
/// Outside, the positive distances are the legs of a right triangle; inside, the nearest factor
/// counts alone; on an edge, all factors whose boundary holds the point.
fn product<const N: usize>(distances: [f64; N]) -> (f64, [f64; N]) {
    let largest = distances.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let legs = if largest > 0.0 {
        distances.map(|d| d.max(0.0))
    } else if largest == 0.0 {
        distances.map(|d| if d == 0.0 { 1.0 } else { 0.0 })
    } else {
        let first = distances.iter().position(|&d| d == largest);
        from_fn(|k| if Some(k) == first { 1.0 } else { 0.0 })
    };
    let length = norm(&legs);
    let distance = if largest > 0.0 { length } else { largest };
    (distance, legs.map(|leg| leg / length))
}

/// Product of a shape across `axis` with an interval along it.
fn join<const D: usize>(x: &Vector<D>, axis: usize, across: &Nearest<D>, along: &Nearest<1>) -> Nearest<D> {
    let (distance, share) = product([across.distance, along.distance]);
    let mut point = from_fn(|k| pick(share[0], across.point[k], x[k]));
    let mut normal = across.normal.map(|n| share[0] * n);
    point[axis] = pick(share[1], along.point[0], x[axis]);
    normal[axis] = share[1] * along.normal[0];
    Nearest { distance, point, normal }
}

/// Coordinate of the closest point: the factor's own where it takes part, else that of the query.
fn pick(share: f64, closest: f64, own: f64) -> f64 {
    if share > 0.0 { closest } else { own }
}

/// Closest end of an interval.
fn end_of(low: f64, high: f64, x: f64) -> Nearest<1> {
    let (below, above) = (low - x, x - high);
    let (distance, point, normal) = if below > above { (below, low, -1.0) } else { (above, high, 1.0) };
    Nearest { distance, point: [point], normal: [normal] }
}

/// Closest point of the shell `inner <= |offset| <= outer`, solid for `inner` zero.
///
/// In the middle, where all directions are equally close, it is `axis`.
fn shell<const D: usize>(x: &Vector<D>, offset: Vector<D>, inner: f64, outer: f64, axis: usize) -> Nearest<D> {
    let length = norm(&offset);
    let direction =
        if length > 0.0 { offset.map(|c| c / length) } else { from_fn(|k| if k == axis { 1.0 } else { 0.0 }) };
    let (distance, radius, sign) = if inner > 0.0 && inner - length > length - outer {
        (inner - length, inner, -1.0)
    } else {
        (length - outer, outer, 1.0)
    };
    Nearest {
        distance,
        point: from_fn(|k| x[k] + direction[k] * (radius - length)),
        normal: direction.map(|c| sign * c),
    }
}

fn nearest_on_polygon(vertices: &[[f64; 2]], x: [f64; 2]) -> Nearest<2> {
    let side = polygon_side(edges(vertices), x);
    let turn = signed_area(vertices).signum();
    let outward = |(a, b): ([f64; 2], [f64; 2])| {
        let length = distance(&a, &b);
        [turn * (b[1] - a[1]) / length, turn * (a[0] - b[0]) / length]
    };

    let mut best = (f64::INFINITY, 0, [0.0; 2]);
    for (i, (a, b)) in edges(vertices).enumerate() {
        let point = closest_on_segment(&a, &b, &x);
        let length = distance(&x, &point);
        if length < best.0 {
            best = (length, i, point);
        }
    }
    let (length, i, point) = best;

    let count = vertices.len();
    let edge = |i: usize| (vertices[i % count], vertices[(i + 1) % count]);
    let (a, b) = edge(i);
    let normal = if point != a && point != b {
        outward((a, b))
    } else if side != 0.0 && length > 1e-12 * distance(&a, &b) {
        // Above rounding, the direction from the corner is known.
        [0, 1].map(|k| side * (x[k] - point[k]) / length)
    } else {
        let (before, after) = if point == a {
            (outward(edge(i + count - 1)), outward((a, b)))
        } else {
            (outward((a, b)), outward(edge(i + 1)))
        };
        let sum = [before[0] + after[0], before[1] + after[1]];
        let length = norm(&sum);
        sum.map(|c| c / length)
    };
    Nearest {
        // The exact side wins over a distance that was rounded to zero.
        distance: if side == 0.0 { 0.0 } else { side * length.max(f64::MIN_POSITIVE) },
        point,
        normal,
    }
}

fn interval(what: &str, low: f64, high: f64) -> Result<(), String> {
    if low.is_finite() && high.is_finite() && low < high {
        return Ok(());
    }
    Err(format!("the {what} reaches from {low} to {high}, but the first must be smaller and both finite"))
}

fn hollow(what: &str, inner: f64, outer: f64) -> Result<(), String> {
    if inner < outer {
        return Ok(());
    }
    Err(format!("the inner radius of the {what} is {inner}, but must be smaller than the outer, {outer}"))
}

fn check_members<const D: usize>(what: &str, members: &[Shape<D>]) -> Result<(), String> {
    if members.is_empty() {
        return Err(format!("the {what} has no members"));
    }
    for (i, member) in members.iter().enumerate() {
        member.validate().map_err(|message| format!("member {i} of the {what}: {message}"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform numbers in [0, 1) from a 64-bit linear congruential generator (Knuth's constants).
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }

        /// Point in the bounds of the shape, widened by half their size on each side.
        fn around<const D: usize>(&mut self, shape: &Shape<D>) -> Vector<D> {
            let (low, high) = shape.bounds();
            from_fn(|k| low[k] + (2.0 * self.next() - 0.5) * (high[k] - low[k]))
        }

        /// Point in a ball.
        fn within<const D: usize>(&mut self, center: &Vector<D>, radius: f64) -> Vector<D> {
            loop {
                let offset: Vector<D> = from_fn(|_| 2.0 * self.next() - 1.0);
                if norm(&offset) < 1.0 {
                    return from_fn(|k| center[k] + radius * offset[k]);
                }
            }
        }
    }

    /// An L with one slanted edge, clockwise.
    fn bracket() -> Vec<[f64; 2]> {
        let mut vertices = vec![[0.0, 0.0], [3.0, 0.2], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        vertices.reverse();
        vertices
    }

    fn segments() -> Vec<Shape<1>> {
        vec![Shape::Box { low: [-0.3], high: [1.1] }, Shape::Ball { center: [0.4], radius: 0.7 }]
    }

    fn flat() -> Vec<Shape<2>> {
        vec![
            Shape::Box { low: [-1.0, 0.5], high: [2.0, 1.4] },
            Shape::Ball { center: [0.3, -0.2], radius: 1.3 },
            Shape::Ring { center: [0.3, -0.2], inner: 0.6, outer: 1.3 },
            Shape::Polygon { vertices: bracket() },
        ]
    }

    fn solid() -> Vec<Shape<3>> {
        let mut shapes = vec![
            Shape::Box { low: [-1.0, 0.5, 0.0], high: [2.0, 1.4, 1.0] },
            Shape::Ball { center: [0.3, -0.2, 0.1], radius: 1.3 },
            Shape::Ring { center: [0.3, -0.2, 0.1], inner: 0.6, outer: 1.3 },
            Shape::Extrusion { vertices: bracket(), low: -0.4, high: 0.5 },
        ];
        for axis in 0..3 {
            for inner in [0.0, 0.5] {
                shapes.push(Shape::Cylinder { center: [0.3, -0.2, 0.1], axis, radius: 0.9, inner, length: 1.7 });
            }
        }
        shapes
    }

    fn plates() -> Vec<Shape<2>> {
        let plate = Shape::Box { low: [-1.0, -1.0], high: [1.0, 1.0] };
        let hole = Shape::Ball { center: [0.2, 0.1], radius: 0.4 };
        let notch = Shape::Polygon { vertices: vec![[-1.5, -0.5], [-0.6, -0.4], [-1.5, -0.3]] };
        let beside = Shape::Box { low: [0.5, 0.5], high: [2.0, 1.5] };
        vec![
            Shape::Difference(std::boxed::Box::new(plate.clone()), vec![hole, notch]),
            Shape::Union(vec![plate.clone(), beside.clone()]),
            Shape::Intersection(vec![plate, beside]),
        ]
    }

    #[test]
    fn distance_is_attained_and_the_ball_of_that_radius_stays_on_one_side() {
        fn check<const D: usize>(shapes: Vec<Shape<D>>) {
            let mut random = Random(7);
            for shape in shapes {
                shape.validate().unwrap();
                for _ in 0..300 {
                    let x = random.around(&shape);
                    let d = shape.signed_distance(&x);
                    let point = shape.closest_point(&x);
                    assert_eq!(shape.contains(&x), d <= 0.0);
                    assert!((distance(&x, &point) - d.abs()).abs() < 1e-14, "{shape:?}");
                    assert!(shape.signed_distance(&point).abs() < 1e-14, "{shape:?}");
                    for _ in 0..60 {
                        let y = random.within(&x, d.abs());
                        assert_eq!(shape.contains(&y), d <= 0.0, "{shape:?} {x:?} {y:?}");
                    }
                }
            }
        }
        check(segments());
        check(flat());
        check(solid());
    }

    #[test]
    fn distance_of_a_combined_shape_is_a_lower_bound_and_its_closest_point_on_the_boundary() {
        let mut random = Random(8);
        for shape in plates() {
            shape.validate().unwrap();
            for _ in 0..2000 {
                let x = random.around(&shape);
                let d = shape.signed_distance(&x);
                let point = shape.closest_point(&x);
                assert!(d.abs() <= distance(&x, &point) + 1e-9);
                assert!(shape.signed_distance(&point).abs() < 1e-8, "{shape:?} {x:?}");
                for _ in 0..20 {
                    let y = random.within(&x, d.abs());
                    assert_eq!(shape.contains(&y), d <= 0.0, "{shape:?} {x:?} {y:?}");
                }
            }
        }
    }

    #[test]
    fn normal_is_the_gradient_of_the_distance() {
        fn check<const D: usize>(shapes: Vec<Shape<D>>) {
            let mut random = Random(9);
            // Central differences: h² times curvature, 1e-12, and rounding, 1e-16 / h = 1e-10.
            let h = 1e-6;
            for shape in shapes {
                let mut checked = 0;
                for _ in 0..300 {
                    let x = random.around(&shape);
                    let gradient: Vector<D> = from_fn(|k| {
                        let (mut below, mut above) = (x, x);
                        below[k] -= h;
                        above[k] += h;
                        (shape.signed_distance(&above) - shape.signed_distance(&below)) / (2.0 * h)
                    });
                    // Shorter than one where two boundary points are equally close.
                    if (norm(&gradient) - 1.0).abs() > 1e-6 {
                        continue;
                    }
                    checked += 1;
                    assert!(distance(&gradient, &shape.normal(&x)) < 1e-6, "{shape:?} {x:?}");
                }
                assert!(checked > 290);
            }
        }
        check(segments());
        check(flat());
        check(solid());
    }

    #[test]
    fn normal_on_the_surface_has_length_one_and_leaves_the_shape() {
        fn check<const D: usize>(shapes: Vec<Shape<D>>) {
            let mut random = Random(10);
            for shape in shapes {
                for _ in 0..300 {
                    let point = shape.closest_point(&random.around(&shape));
                    let normal = shape.normal(&point);
                    assert!((norm(&normal) - 1.0).abs() < 1e-14);
                    let step = |s: f64| from_fn(|k| point[k] + s * normal[k]);
                    assert!(!shape.contains(&step(1e-6)), "{shape:?} {point:?}");
                    assert!(shape.contains(&step(-1e-6)), "{shape:?} {point:?}");
                }
            }
        }
        check(segments());
        check(flat());
        check(solid());
    }

    #[test]
    fn normal_on_a_corner_is_the_mean_of_its_faces() {
        let half = 0.5_f64.sqrt();
        let box_normal = flat()[0].normal(&[2.0, 1.4]);
        assert!(distance(&box_normal, &[half, half]) < 1e-15);
        let polygon_normal = flat()[3].normal(&[0.0, 2.0]);
        assert!(distance(&polygon_normal, &[-half, half]) < 1e-15);
        let reentrant = flat()[3].normal(&[1.0, 1.0]);
        assert!(distance(&reentrant, &[half, half]) < 1e-15);
    }

    /// A cell whose centre is farther from the boundary than half its diagonal lies on one side as
    /// a whole, so the count errs by no more than the cells that are closer.
    #[test]
    fn measure_agrees_with_counted_cells() {
        fn check<const D: usize>(shapes: Vec<Shape<D>>, cells: usize) {
            for shape in shapes {
                let (low, high) = shape.bounds();
                let h: Vector<D> = from_fn(|k| (high[k] - low[k]) / cells as f64);
                let (mut inside, mut unsure) = (0usize, 0usize);
                for cell in 0..cells.pow(D as u32) {
                    let x = from_fn(|k| {
                        let i = cell / cells.pow(k as u32) % cells;
                        low[k] + (i as f64 + 0.5) * h[k]
                    });
                    let d = shape.signed_distance(&x);
                    inside += usize::from(d <= 0.0);
                    unsure += usize::from(d.abs() <= 0.5 * norm(&h));
                }
                let volume: f64 = h.iter().product();
                let error = (inside as f64 * volume - shape.measure().unwrap()).abs();
                assert!(error <= unsure as f64 * volume, "{shape:?}: {error}");
            }
        }
        check(segments(), 1000);
        check(flat(), 300);
        check(solid(), 40);
        assert!(plates().iter().all(|shape| shape.measure().is_none()));
    }

    #[test]
    fn bounds_hold_the_shape_and_touch_it() {
        for shape in solid() {
            let mut random = Random(11);
            let (low, high) = shape.bounds();
            for _ in 0..2000 {
                let x = random.around(&shape);
                let inside = (0..3).all(|k| low[k] <= x[k] && x[k] <= high[k]);
                assert!(inside || !shape.contains(&x));
            }
            // The closest point to a far point on an axis attains the bound, but for slants.
            for k in 0..3 {
                let mut far: [f64; 3] = from_fn(|k| 0.5 * (low[k] + high[k]));
                far[k] += 1e4;
                assert!((shape.closest_point(&far)[k] - high[k]).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn polygon_sides_are_exact_on_a_slanted_edge() {
        // 0.1 and 0.3 are not binary fractions: a rounded determinant calls some neighbours of
        // the edge's points collinear. Neighbours in y must switch from one side to the other.
        let vertices = vec![[0.1, 0.1], [12.3, 12.3], [0.1, 12.3]];
        let shape = Shape::<2>::Polygon { vertices };
        for i in 1..200 {
            let x = 0.1 + 0.06 * i as f64;
            assert!(shape.contains(&[x, x]));
            assert_eq!(shape.signed_distance(&[x, x]), 0.0);
            assert!(shape.contains(&[x, x.next_up()]));
            assert!(!shape.contains(&[x, x.next_down()]));
        }
    }

    #[test]
    fn normal_of_a_hole_points_to_its_centre() {
        let plate = &plates()[0];
        let wall = [0.2, 0.1 + 0.4];
        assert_eq!(plate.closest_point(&[0.2, 0.55]), wall);
        assert_eq!(plate.normal(&[0.2, 0.55]), [0.0, -1.0]);
        assert_eq!(plate.normal(&[0.2, 0.4]), [0.0, -1.0]);
        assert_eq!(plate.normal(&wall), [0.0, -1.0]);
    }

    #[test]
    fn wrong_shapes_are_refused_in_plain_words() {
        let polygon = |vertices: &[[f64; 2]]| {
            let vertices = vertices.to_vec();
            Shape::<2>::Polygon { vertices }.validate().unwrap_err()
        };
        assert!(polygon(&[[0.0, 0.0], [1.0, 0.0]]).contains("at least 3"));
        assert!(polygon(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]).contains("doubles back"));
        assert!(polygon(&[[0.0, 0.0], [0.0, 0.0], [2.0, 1.0]]).contains("twice in a row"));
        let bow_tie = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        assert!(polygon(&bow_tie).contains("edges 0 and 2"));
        let pinched = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 0.0], [0.0, 2.0]];
        assert!(polygon(&pinched).contains("intersects itself"));

        let ball = Shape::Ball { center: [0.0], radius: -1.0 };
        assert!(ball.validate().unwrap_err().contains("radius of the ball is -1"));
        let ring = Shape::Ring { center: [0.0], inner: 1.0, outer: 2.0 };
        assert!(ring.validate().unwrap_err().contains("2 or 3 dimensions"));
        let ring = Shape::Ring { center: [0.0; 2], inner: 2.0, outer: 2.0 };
        assert!(ring.validate().unwrap_err().contains("smaller than the outer"));
        let nan = Shape::Box { low: [f64::NAN], high: [1.0] };
        assert!(nan.validate().is_err());
        let apart = [0.0, 5.0].map(|x| Shape::Ball { center: [x], radius: 1.0 });
        let apart = Shape::Intersection(apart.to_vec());
        assert!(apart.validate().unwrap_err().contains("do not overlap"));
        assert!(Shape::<2>::Union(vec![]).validate().is_err());
    }
}
