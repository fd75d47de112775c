//! The surface of a shape in pieces: where they are, where they face, how large they are.
//!
//! What acts on a surface is a sum over pieces. Flat faces are cut into pieces of half a cell, each with one place in its
//! middle; round ones into pieces of a cell or a tenth of a radian, each with four by four places of Gauss's rule, on the true
//! surface. So area, ∫ N dA and ∫ x ⊗ N dA of whole faces are those of the closed forms, to rounding.
//!
//! Where a part of the surface ends within a piece, or another shape covers some of it, the piece is halved again and again:
//! in 2D until nothing is left, in 3D to a 64th of its length.

use std::array::from_fn;
use std::f64::consts::{PI, TAU};

use super::Shape;
use super::polygon::{distance, edges, signed_area};
use crate::field::Vector;

/// A place of a surface with what it stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece<const D: usize> {
    /// x, m
    pub place: Vector<D>,
    /// N, outward.
    pub normal: Vector<D>,
    /// m² (3D), m (2D: unit thickness), 1 (1D: unit cross-section).
    pub area: f64,
    /// Which smooth part of the boundary it is of: a side of a box, the round of a cylinder.
    pub face: u32,
}

/// The largest angle of a round piece: four places of Gauss's rule integrate the sines of three times as much to 1e-15.
const ANGLE: f64 = 0.1;
/// How far samples of a piece are from its edges, as a share of its length.
const INSET: f64 = 1e-3;
/// How far beside the surface, as a share of a cell, another shape is asked about.
const BESIDE: f64 = 1e-9;
/// How often a piece is halved.
const HALVINGS: [u32; 3] = [0, 45, 6];

/// x, N and dA/(du dv) of a face at parameters in its rectangle.
type Chart<const D: usize> = Box<dyn Fn([f64; 2]) -> (Vector<D>, Vector<D>, f64)>;

/// A face of a primitive.
enum Face<const D: usize> {
    /// A rectangle of parameters, into how many pieces it is cut along each, and along which of them it is round.
    Chart { ends: [[f64; 2]; 2], counts: [usize; 2], round: [bool; 2], chart: Chart<D> },
    /// A flat polygon across z.
    Cap { vertices: Vec<[f64; 2]>, z: f64, up: f64 },
}

impl<const D: usize> Shape<D> {
    /// The pieces of the boundary for which `wanted` holds, of a body of cells of this `size`, m.
    pub fn surface(&self, size: f64, wanted: &dyn Fn(&Piece<D>) -> bool) -> Vec<Piece<D>> {
        let mut primitives = Vec::new();
        self.collect_primitives(1.0, &mut primitives);
        let mut cut = Cutter { body: self, primitives: &primitives, size, wanted, pieces: Vec::new(), face: 0, of: 0 };
        for (k, (primitive, sign)) in primitives.iter().enumerate() {
            cut.of = k;
            for face in primitive.faces(size, *sign) {
                match face {
                    Face::Chart { ends, counts, round, chart } => cut.chart(ends, counts, round, &chart),
                    Face::Cap { vertices, z, up } => cut.cap(&vertices, z, up),
                }
                cut.face += 1;
            }
        }
        cut.pieces
    }

    fn collect_primitives<'a>(&'a self, sign: f64, found: &mut Vec<(&'a Shape<D>, f64)>) {
        match self {
            Shape::Union(members) | Shape::Intersection(members) => {
                members.iter().for_each(|member| member.collect_primitives(sign, found));
            }
            Shape::Difference(base, cutters) => {
                base.collect_primitives(sign, found);
                cutters.iter().for_each(|cutter| cutter.collect_primitives(-sign, found));
            }
            primitive => found.push((primitive, sign)),
        }
    }

    /// The faces of a primitive; `sign` is −1 where it is what was cut away.
    fn faces(&self, size: f64, sign: f64) -> Vec<Face<D>> {
        match self {
            Shape::Box { low, high } => {
                let sides = (0..D).flat_map(|axis| [(axis, -1.0), (axis, 1.0)]);
                sides.map(|(axis, side)| side_of_box(*low, *high, axis, side, sign, size)).collect()
            }
            Shape::Ball { center, radius } => round(*center, *radius, sign, size),
            Shape::Ring { center, inner, outer } => {
                let mut faces = round(*center, *outer, sign, size);
                faces.extend(round(*center, *inner, -sign, size));
                faces
            }
            Shape::Cylinder { center, axis, radius, inner, length } => {
                let (center, axis, half) = (*center, *axis, 0.5 * length);
                let mut faces = vec![mantle(center, axis, *radius, half, sign, size)];
                if *inner > 0.0 {
                    faces.push(mantle(center, axis, *inner, half, -sign, size));
                }
                for end in [-1.0, 1.0] {
                    faces.push(end_of_cylinder(center, axis, [*inner, *radius], end * half, end * sign, size));
                }
                faces
            }
            Shape::Polygon { vertices } => {
                let turn = sign * signed_area(vertices).signum();
                edges(vertices).map(|(a, b)| edge(a, b, None, turn, size)).collect()
            }
            Shape::Extrusion { vertices, low, high } => {
                let turn = sign * signed_area(vertices).signum();
                let sides = edges(vertices).map(|(a, b)| edge(a, b, Some([*low, *high]), turn, size));
                let cap = |z, up| Face::Cap { vertices: vertices.clone(), z, up: sign * up };
                sides.chain([cap(*low, -1.0), cap(*high, 1.0)]).collect()
            }
            Shape::Union(_) | Shape::Difference(..) | Shape::Intersection(_) => Vec::new(),
        }
    }
}

/// Pieces of a length.
fn flat(length: f64, size: f64) -> usize {
    (2.0 * length / size).ceil().max(1.0) as usize
}

/// Pieces of an arc.
fn bent(angle: f64, radius: f64, size: f64) -> usize {
    (angle / ANGLE.min(size / radius)).ceil().max(1.0) as usize
}

fn side_of_box<const D: usize>(
    low: Vector<D>,
    high: Vector<D>,
    axis: usize,
    side: f64,
    sign: f64,
    size: f64,
) -> Face<D> {
    let along: Vec<usize> = (0..D).filter(|&d| d != axis).collect();
    let mut ends = [[0.0, 1.0]; 2];
    let mut counts = [1; 2];
    for (k, &d) in along.iter().enumerate() {
        ends[k] = [low[d], high[d]];
        counts[k] = flat(high[d] - low[d], size);
    }
    let chart = move |u: [f64; 2]| {
        let mut place = low;
        place[axis] = if side > 0.0 { high[axis] } else { low[axis] };
        along.iter().zip(u).for_each(|(&d, u)| place[d] = u);
        (place, from_fn(|d| if d == axis { side * sign } else { 0.0 }), 1.0)
    };
    Face::Chart { ends, counts, round: [false; 2], chart: Box::new(chart) }
}

/// The circle or sphere; in 1D its two ends.
fn round<const D: usize>(center: Vector<D>, radius: f64, sign: f64, size: f64) -> Vec<Face<D>> {
    let on = move |normal: Vector<D>| from_fn(|d| center[d] + radius * normal[d]);
    match D {
        1 => [-1.0, 1.0]
            .map(|side| {
                let chart = move |_: [f64; 2]| (on([side; D]), [side * sign; D], 1.0);
                Face::Chart { ends: [[0.0, 1.0]; 2], counts: [1; 2], round: [false; 2], chart: Box::new(chart) }
            })
            .into(),
        2 => {
            let chart = move |[angle, _]: [f64; 2]| {
                let normal = [angle.cos(), angle.sin()];
                let normal = from_fn(|d| normal[d]);
                (on(normal), normal.map(|n| sign * n), radius)
            };
            let counts = [bent(TAU, radius, size).next_multiple_of(8), 1];
            vec![Face::Chart { ends: [[0.0, TAU], [0.0, 1.0]], counts, round: [true, false], chart: Box::new(chart) }]
        }
        _ => {
            let chart = move |[polar, angle]: [f64; 2]| {
                let normal = [polar.sin() * angle.cos(), polar.sin() * angle.sin(), polar.cos()];
                let normal = from_fn(|d| normal[d]);
                (on(normal), normal.map(|n| sign * n), radius * radius * polar.sin())
            };
            let counts = [PI, TAU].map(|angle| bent(angle, radius, size).next_multiple_of(8));
            vec![Face::Chart { ends: [[0.0, PI], [0.0, TAU]], counts, round: [true; 2], chart: Box::new(chart) }]
        }
    }
}

/// The round of a cylinder.
fn mantle<const D: usize>(center: Vector<D>, axis: usize, radius: f64, half: f64, sign: f64, size: f64) -> Face<D> {
    let chart = move |[angle, along]: [f64; 2]| {
        let normal: Vector<D> = across(axis, angle);
        let place = from_fn(|d| center[d] + if d == axis { along } else { radius * normal[d] });
        (place, normal.map(|n| sign * n), radius)
    };
    let counts = [bent(TAU, radius, size).next_multiple_of(8), flat(2.0 * half, size)];
    Face::Chart { ends: [[0.0, TAU], [-half, half]], counts, round: [true, false], chart: Box::new(chart) }
}

/// The flat end of a cylinder or tube.
fn end_of_cylinder<const D: usize>(
    center: Vector<D>,
    axis: usize,
    [inner, outer]: [f64; 2],
    at: f64,
    facing: f64,
    size: f64,
) -> Face<D> {
    let chart = move |[radius, angle]: [f64; 2]| {
        let out: Vector<D> = across(axis, angle);
        let place = from_fn(|d| center[d] + if d == axis { at } else { radius * out[d] });
        (place, from_fn(|d| if d == axis { facing.signum() } else { 0.0 }), radius)
    };
    let counts = [flat(outer - inner, size), bent(TAU, outer, size).next_multiple_of(8)];
    Face::Chart { ends: [[inner, outer], [0.0, TAU]], counts, round: [true; 2], chart: Box::new(chart) }
}

/// The unit vector across an axis in 3D.
fn across<const D: usize>(axis: usize, angle: f64) -> Vector<D> {
    let mut out = [0.0; D];
    (out[(axis + 1) % D], out[(axis + 2) % D]) = (angle.cos(), angle.sin());
    out
}

/// The straight edge of a polygon, over a height in 3D.
fn edge<const D: usize>(a: [f64; 2], b: [f64; 2], height: Option<[f64; 2]>, turn: f64, size: f64) -> Face<D> {
    let length = distance(&a, &b);
    let normal = [turn * (b[1] - a[1]) / length, turn * (a[0] - b[0]) / length];
    let chart = move |[s, z]: [f64; 2]| {
        let place = from_fn(|d| if d < 2 { a[d] + s * (b[d] - a[d]) } else { z });
        (place, from_fn(|d| if d < 2 { normal[d] } else { 0.0 }), length)
    };
    let tall = height.map_or(1, |[low, high]| flat(high - low, size));
    let (ends, counts) = ([[0.0, 1.0], height.unwrap_or([0.0, 1.0])], [flat(length, size), tall]);
    Face::Chart { ends, counts, round: [false; 2], chart: Box::new(chart) }
}

struct Cutter<'a, const D: usize> {
    body: &'a Shape<D>,
    primitives: &'a [(&'a Shape<D>, f64)],
    size: f64,
    wanted: &'a dyn Fn(&Piece<D>) -> bool,
    pieces: Vec<Piece<D>>,
    /// Which face of all, and of which primitive.
    face: u32,
    of: usize,
}

impl<const D: usize> Cutter<'_, D> {
    /// Whether a piece is wanted, and of the boundary of the whole.
    fn takes(&self, piece: &Piece<D>) -> bool {
        (self.primitives.len() == 1 || self.on_the_whole(piece)) && (self.wanted)(piece)
    }

    fn on_the_whole(&self, Piece { place, normal, .. }: &Piece<D>) -> bool {
        let step = BESIDE * self.size;
        let beside = |by: f64| self.body.signed_distance(&from_fn(|d| place[d] + by * normal[d]));
        // Of faces that lie on each other the first counts.
        let before = |(shape, sign): &(&Shape<D>, f64)| {
            let other = shape.normal(place);
            let same = (0..D).map(|d| sign * other[d] * normal[d]).sum::<f64>() > 1.0 - 1e-6;
            same && shape.signed_distance(place).abs() < 0.5 * step
        };
        beside(step) > 0.0 && beside(-step) <= 0.0 && !self.primitives[..self.of].iter().any(before)
    }

    fn chart(&mut self, ends: [[f64; 2]; 2], counts: [usize; 2], round: [bool; 2], chart: &Chart<D>) {
        let part = |axis: usize, k: usize| {
            let [from, to] = ends[axis];
            let at = |k: usize| from + (to - from) * (k as f64 / counts[axis] as f64);
            [at(k), at(k + 1)]
        };
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                self.rectangle([part(0, i), part(1, j)], round, chart, HALVINGS[D - 1]);
            }
        }
    }

    fn rectangle(&mut self, ends: [[f64; 2]; 2], round: [bool; 2], chart: &Chart<D>, halvings: u32) {
        let parameters = D - 1;
        let at = |shares: [f64; 2]| {
            let u = from_fn(|k| ends[k][0] + shares[k] * (ends[k][1] - ends[k][0]));
            let (place, normal, jacobian) = chart(u);
            (Piece { place, normal, area: jacobian, face: self.face }, u)
        };
        let corners = [[INSET, INSET], [1.0 - INSET, INSET], [INSET, 1.0 - INSET], [1.0 - INSET; 2]];
        let middle = self.takes(&at([0.5; 2]).0);
        let alike = corners[..1 << parameters].iter().all(|&corner| self.takes(&at(corner).0) == middle);
        if !alike && halvings > 0 {
            let halves = |k: usize| {
                let [from, to] = ends[k];
                let mid = 0.5 * (from + to);
                if k < parameters { vec![[from, mid], [mid, to]] } else { vec![[from, to]] }
            };
            for v in halves(1) {
                for u in halves(0) {
                    self.rectangle([u, v], round, chart, halvings - 1);
                }
            }
            return;
        }
        if !middle {
            return;
        }
        // Gauss's rule of four places, or the middle.
        let outer = 0.5 * (3.0 / 7.0 + 2.0 / 7.0 * 1.2f64.sqrt()).sqrt();
        let inner = 0.5 * (3.0 / 7.0 - 2.0 / 7.0 * 1.2f64.sqrt()).sqrt();
        let weight = 0.25 - 30f64.sqrt() / 72.0;
        let rule = |k: usize| {
            if !round[k] {
                return vec![(0.5, 1.0)];
            }
            [(-outer, weight), (-inner, 0.5 - weight), (inner, 0.5 - weight), (outer, weight)]
                .map(|(x, w)| (0.5 + x, w))
                .into()
        };
        let length: f64 = (0..parameters).map(|k| ends[k][1] - ends[k][0]).product();
        let mut found = Vec::new();
        for (v, weight_v) in rule(1) {
            for (u, weight_u) in rule(0) {
                let (piece, _) = at([u, v]);
                found.push(Piece { area: piece.area * weight_u * weight_v * length, ..piece });
            }
        }
        self.pieces.extend(found);
    }

    /// A flat polygon, cut by a grid of half cells about its middle.
    fn cap(&mut self, vertices: &[[f64; 2]], z: f64, up: f64) {
        let (low, high) = super::polygon::bounds_of(vertices);
        let counts: [usize; 2] = from_fn(|d| flat(high[d] - low[d], self.size));
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                let cell = |d: usize, k: usize| {
                    let at = |k: usize| low[d] + (high[d] - low[d]) * (k as f64 / counts[d] as f64);
                    [at(k), at(k + 1)]
                };
                self.tile(vertices, [cell(0, i), cell(1, j)], z, up, HALVINGS[2]);
            }
        }
    }

    fn tile(&mut self, polygon: &[[f64; 2]], cell: [[f64; 2]; 2], z: f64, up: f64, halvings: u32) {
        let inside = clipped(polygon, cell);
        let Some((area, middle)) = centroid(&inside) else { return };
        let piece = |x: [f64; 2], area: f64| Piece {
            place: from_fn(|d| if d < 2 { x[d] } else { z }),
            normal: from_fn(|d| if d == 2 { up } else { 0.0 }),
            area,
            face: self.face,
        };
        let taken = self.takes(&piece(middle, area));
        let inset = |x: &[f64; 2]| from_fn(|d| x[d] + INSET * (middle[d] - x[d]));
        let alike = inside.iter().all(|x| self.takes(&piece(inset(x), 0.0)) == taken);
        if !alike && halvings > 0 {
            let [x, y] = cell.map(|[from, to]| [[from, 0.5 * (from + to)], [0.5 * (from + to), to]]);
            for y in y {
                for x in x {
                    self.tile(&inside, [x, y], z, up, halvings - 1);
                }
            }
        } else if taken {
            let piece = piece(middle, area);
            self.pieces.push(piece);
        }
    }
}

/// What of a polygon lies in a rectangle (Sutherland and Hodgman, Commun. ACM 17 (1974) 32-42). Parts of it may be joined by
/// edges that run there and back, which add nothing to area or centroid.
fn clipped(polygon: &[[f64; 2]], cell: [[f64; 2]; 2]) -> Vec<[f64; 2]> {
    let mut left = polygon.to_vec();
    for (axis, ends) in cell.into_iter().enumerate() {
        for (bound, side) in ends.into_iter().zip([1.0, -1.0]) {
            let depth = |x: &[f64; 2]| side * (x[axis] - bound);
            let mut kept = Vec::with_capacity(left.len() + 2);
            for (a, b) in edges(&left) {
                let (from, to) = (depth(&a), depth(&b));
                if from >= 0.0 {
                    kept.push(a);
                }
                if (from < 0.0) != (to < 0.0) {
                    let mut crossing: [f64; 2] = from_fn(|d| a[d] + from / (from - to) * (b[d] - a[d]));
                    crossing[axis] = bound;
                    kept.push(crossing);
                }
            }
            left = kept;
        }
    }
    left
}

/// Area and centroid; None of what has none.
fn centroid(polygon: &[[f64; 2]]) -> Option<(f64, [f64; 2])> {
    let origin = *polygon.first()?;
    let (mut doubled, mut moment) = (0.0, [0.0; 2]);
    for (a, b) in edges(polygon) {
        let [a, b]: [[f64; 2]; 2] = [a, b].map(|x| from_fn(|d| x[d] - origin[d]));
        let cross = a[0] * b[1] - a[1] * b[0];
        doubled += cross;
        moment = from_fn(|d| moment[d] + cross * (a[d] + b[d]));
    }
    let extent = polygon.iter().map(|x| distance(x, &origin)).fold(0.0, f64::max);
    // Below rounding of what is left where a corner touches the cell.
    (doubled.abs() > 1e-14 * extent * extent)
        .then(|| (0.5 * doubled.abs(), from_fn(|d| origin[d] + moment[d] / (3.0 * doubled))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Area, ∫ N dA, and ∫ x ⊗ N dA.
    fn sums<const D: usize>(pieces: &[Piece<D>]) -> (f64, Vector<D>, [Vector<D>; D]) {
        let area = pieces.iter().map(|piece| piece.area).sum();
        let vector = from_fn(|d| pieces.iter().map(|piece| piece.area * piece.normal[d]).sum());
        let moment =
            from_fn(|c| from_fn(|d| pieces.iter().map(|piece| piece.area * piece.place[c] * piece.normal[d]).sum()));
        (area, vector, moment)
    }

    /// The whole surface: ∫ N dA = 0 and ∫ x ⊗ N dA = V I.
    fn is_closed<const D: usize>(shape: &Shape<D>, size: f64, volume: f64, area: f64) {
        // Sums of some thousand terms.
        is_closed_within(1e-12, shape, size, volume, area);
    }

    fn is_closed_within<const D: usize>(tolerance: f64, shape: &Shape<D>, size: f64, volume: f64, area: f64) {
        let (found, vector, moment) = sums(&shape.surface(size, &|_| true));
        assert!((found / area - 1.0).abs() < tolerance, "{shape:?}: {found} for {area}");
        for c in 0..D {
            assert!(vector[c].abs() < tolerance * area, "{shape:?}: {vector:?}");
            for d in 0..D {
                let expected = if c == d { volume } else { 0.0 };
                assert!(
                    (moment[c][d] - expected).abs() < 2.0 * tolerance * volume,
                    "{shape:?}: {moment:?} for {volume}"
                );
            }
        }
    }

    #[test]
    fn whole_surfaces_are_closed_and_have_their_areas() {
        is_closed(&Shape::Box { low: [-1.0], high: [2.0] }, 0.1, 3.0, 2.0);
        is_closed(&Shape::Box { low: [-1.0, 0.3], high: [2.0, 0.7] }, 0.1, 1.2, 6.8);
        is_closed(&Shape::Box { low: [-1.0, 0.3, 0.0], high: [2.0, 0.7, 0.5] }, 0.1, 0.6, 2.0 * (1.2 + 1.5 + 0.2));
        is_closed(&Shape::Ball { center: [0.1, -0.2], radius: 0.7 }, 0.1, PI * 0.49, TAU * 0.7);
        is_closed(&Shape::Ball { center: [0.1, -0.2, 3.0], radius: 0.7 }, 0.1, 4.0 / 3.0 * PI * 0.343, 4.0 * PI * 0.49);
        let ring = Shape::Ring { center: [0.0, 0.0], inner: 0.5, outer: 1.25 };
        is_closed(&ring, 0.1, PI * (1.5625 - 0.25), TAU * 1.75);
        let shell = Shape::Ring { center: [0.0; 3], inner: 0.5, outer: 1.0 };
        is_closed(&shell, 0.1, 4.0 / 3.0 * PI * 0.875, 4.0 * PI * 1.25);
        for axis in 0..3 {
            let tube = Shape::Cylinder { center: [0.2; 3], axis, radius: 1.0, inner: 0.4, length: 0.7 };
            is_closed(&tube, 0.1, PI * 0.84 * 0.7, TAU * 1.4 * 0.7 + TAU * 0.84);
        }
        // Corners at any angle, in either sense, and one that looks inwards.
        let mut vertices = vec![[0.0, 0.0], [2.1, 0.3], [1.2, 0.9], [1.7, 2.2], [-0.4, 1.3]];
        for _ in 0..2 {
            let area = signed_area(&vertices).abs();
            let around: f64 = edges(&vertices).map(|(a, b)| distance(&a, &b)).sum();
            is_closed(&Shape::<2>::Polygon { vertices: vertices.clone() }, 0.1, area, around);
            let solid = Shape::<3>::Extrusion { vertices: vertices.clone(), low: -0.2, high: 0.3 };
            is_closed(&solid, 0.1, 0.5 * area, 0.5 * around + 2.0 * area);
            vertices.reverse();
        }
    }

    #[test]
    fn shapes_that_cover_each_other_leave_the_surface_of_the_whole() {
        // Where two shapes meet, the surface is asked about a billionth of a cell beside it.
        let tolerance = 10.0 * BESIDE;
        let square = |low: f64, high: f64| Shape::Box { low: [low, 0.0], high: [high, 1.0] };
        // They share a part and two faces.
        is_closed_within(tolerance, &Shape::Union(vec![square(0.0, 1.0), square(0.37, 2.0)]), 0.1, 2.0, 6.0);
        // They touch.
        is_closed_within(tolerance, &Shape::Union(vec![square(0.0, 1.0), square(1.0, 2.0)]), 0.1, 2.0, 6.0);
        let hole = Shape::Ball { center: [0.5, 0.5], radius: 0.25 };
        is_closed_within(
            tolerance,
            &Shape::Difference(Box::new(square(0.0, 1.0)), vec![hole]),
            0.1,
            1.0 - PI / 16.0,
            4.0 + PI / 2.0,
        );
        // A corner cut off by a circle about it.
        let corner = Shape::Ball { center: [0.0, 0.0], radius: 0.333 };
        let area = 1.0 - PI * 0.333 * 0.333 / 4.0;
        is_closed_within(
            tolerance,
            &Shape::Difference(Box::new(square(0.0, 1.0)), vec![corner]),
            0.1,
            area,
            4.0 - 0.666 + PI * 0.333 / 2.0,
        );
        let lens = [-0.3, 0.3].map(|x| Shape::Ball { center: [x, 0.0], radius: 1.0 });
        let half = 0.3f64.acos();
        let area = 2.0 * (half - 0.3 * half.sin());
        is_closed_within(tolerance, &Shape::Intersection(lens.to_vec()), 0.1, area, 4.0 * half);
    }

    #[test]
    fn a_part_of_a_surface_has_its_own_area() {
        let disk = Shape::Ball { center: [0.0, 0.0], radius: 1.0 };
        let part = disk.surface(0.1, &|piece| piece.place[0] > 0.2);
        let expected = 2.0 * 0.2f64.acos();
        let (area, vector, _) = sums(&part);
        assert!(
            (area - expected).abs() < 1e-12 && (vector[0] - 2.0 * 0.96f64.sqrt()).abs() < 1e-12,
            "{area} {vector:?}"
        );
        let block = Shape::Box { low: [0.0; 3], high: [1.0; 3] };
        let punch = block.surface(0.1, &|piece| piece.normal[2] > 0.5 && piece.place[0].hypot(piece.place[1]) < 0.5);
        // A quarter of a disc on 64ths of half cells.
        let area = sums(&punch).0;
        assert!((area - PI / 16.0).abs() < 1e-4, "{area}");
    }
}
