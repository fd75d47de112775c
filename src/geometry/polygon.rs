//! Polygons and segments: which side a point lies on, decided exactly, and how far away it is.
//!
//! Shared by [shapes](super::shapes) and [cracks](super::cracks). Sides come from adaptive exact
//! predicates (Shewchuk, Discrete Comput. Geom. 18 (1997) 305-363); points and distances are
//! rounded as usual.

use robust::{Coord, orient2d};
use std::array::from_fn;

/// Exact side of a polygon: -1 inside, 0 on the boundary, 1 outside.
pub(super) fn polygon_side(edges: impl Iterator<Item = ([f64; 2], [f64; 2])>, x: [f64; 2]) -> f64 {
    let mut inside = false;
    for (a, b) in edges {
        let turn = orientation(a, b, x);
        if turn == 0.0 && in_box(a, b, x) {
            return 0.0;
        }
        // Half-open in y, so that a ray through a corner counts it once.
        if (a[1] > x[1]) != (b[1] > x[1]) && (turn > 0.0) == (b[1] > a[1]) {
            inside = !inside;
        }
    }
    if inside { -1.0 } else { 1.0 }
}

/// Whether a polygon has 3 or more finite vertices and edges that meet in shared corners only.
pub(super) fn check_polygon(vertices: &[[f64; 2]]) -> Result<(), String> {
    let count = vertices.len();
    if count < 3 {
        return Err(format!("the polygon has {count} vertices, but needs at least 3"));
    }
    for vertex in vertices {
        finite("polygon", vertex)?;
    }
    let all: Vec<_> = edges(vertices).collect();
    for (i, &(a, b)) in all.iter().enumerate() {
        if a == b {
            return Err(format!("the polygon has vertex {i} twice in a row"));
        }
        if doubles_back(a, b, all[(i + 1) % count].1) {
            return Err(format!("the polygon doubles back on itself at vertex {}", (i + 1) % count));
        }
        for (j, &(c, d)) in all.iter().enumerate().skip(i + 2) {
            let adjacent = (j + 1) % count == i;
            if !adjacent && segments_meet(a, b, c, d) {
                return Err(format!(
                    "the polygon intersects itself: edges {i} and {j} (from vertices {i} and {j}) \
                     touch or cross"
                ));
            }
        }
    }
    Ok(())
}

/// Whether the path from `a` over `b` to `c` returns along the line that it came.
pub(super) fn doubles_back(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> bool {
    orientation(a, b, c) == 0.0 && (0..2).any(|k| (b[k] > a[k] && c[k] < b[k]) || (b[k] < a[k] && c[k] > b[k]))
}

fn segments_meet(a: [f64; 2], b: [f64; 2], c: [f64; 2], d: [f64; 2]) -> bool {
    let opposite = |s: f64, t: f64| (s > 0.0 && t < 0.0) || (s < 0.0 && t > 0.0);
    let (c_side, d_side) = (orientation(a, b, c), orientation(a, b, d));
    let (a_side, b_side) = (orientation(c, d, a), orientation(c, d, b));
    (opposite(a_side, b_side) && opposite(c_side, d_side))
        || (c_side == 0.0 && in_box(a, b, c))
        || (d_side == 0.0 && in_box(a, b, d))
        || (a_side == 0.0 && in_box(c, d, a))
        || (b_side == 0.0 && in_box(c, d, b))
}

/// Twice the area of the triangle `a b c`, positive counter-clockwise; the sign is exact.
pub(super) fn orientation(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let coord = |p: [f64; 2]| Coord { x: p[0], y: p[1] };
    orient2d(coord(a), coord(b), coord(c))
}

fn in_box(a: [f64; 2], b: [f64; 2], x: [f64; 2]) -> bool {
    (0..2).all(|k| a[k].min(b[k]) <= x[k] && x[k] <= a[k].max(b[k]))
}

/// Edges of a closed polygon.
pub(super) fn edges<P: Copy>(vertices: &[P]) -> impl Iterator<Item = (P, P)> {
    let next = vertices.iter().cycle().skip(1);
    vertices.iter().zip(next).map(|(&a, &b)| (a, b))
}

pub(super) fn closest_on_segment<const N: usize>(a: &[f64; N], b: &[f64; N], x: &[f64; N]) -> [f64; N] {
    let (mut along, mut square) = (0.0, 0.0);
    for k in 0..N {
        along += (x[k] - a[k]) * (b[k] - a[k]);
        square += (b[k] - a[k]).powi(2);
    }
    if along <= 0.0 {
        *a
    } else if along >= square {
        *b
    } else {
        from_fn(|k| a[k] + along / square * (b[k] - a[k]))
    }
}

/// Area of a polygon, positive counter-clockwise.
pub(super) fn signed_area(vertices: &[[f64; 2]]) -> f64 {
    // Relative to a vertex: a polygon far from the origin loses no digits.
    let origin = vertices[0];
    let doubled: f64 = edges(vertices)
        .map(|(a, b)| (a[0] - origin[0]) * (b[1] - origin[1]) - (a[1] - origin[1]) * (b[0] - origin[0]))
        .sum();
    0.5 * doubled
}

/// Smallest and largest coordinates of points.
pub(super) fn bounds_of<const N: usize>(points: &[[f64; N]]) -> ([f64; N], [f64; N]) {
    points.iter().fold(([f64::INFINITY; N], [f64::NEG_INFINITY; N]), |(low, high), point| {
        (from_fn(|k| low[k].min(point[k])), from_fn(|k| high[k].max(point[k])))
    })
}

pub(super) fn norm<const N: usize>(v: &[f64; N]) -> f64 {
    // `hypot` does not underflow: a point off the boundary never gets distance zero.
    v.iter().fold(0.0, |length: f64, c| length.hypot(*c))
}

pub(super) fn distance<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    norm(&from_fn::<f64, N, _>(|k| b[k] - a[k]))
}

pub(super) fn finite<const N: usize>(what: &str, point: &[f64; N]) -> Result<(), String> {
    if point.iter().all(|c| c.is_finite()) {
        return Ok(());
    }
    Err(format!("a point of the {what} is {point:?}, but coordinates must be finite"))
}

/// Whether `what` exists in `d` dimensions.
pub(super) fn dimension(what: &str, d: usize, allowed: &[usize]) -> Result<(), String> {
    if allowed.contains(&d) {
        return Ok(());
    }
    let allowed: Vec<String> = allowed.iter().map(usize::to_string).collect();
    Err(format!("{what} exists in {} dimensions, but the problem has {d}", allowed.join(" or ")))
}

pub(super) fn positive(what: &str, value: f64) -> Result<(), String> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(format!("the {what} is {value}, but must be positive"))
}
