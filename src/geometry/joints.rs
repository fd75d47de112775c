//! Cracks of several pieces: what pieces that meet cut together.
//!
//! [One piece](super::cracks) keeps the bonds that touch its rim: its ends in 2D, its edge in 3D. Where pieces meet, rims are
//! inside a crack. Three rules make pieces that meet cut what one piece would cut:
//!
//! - **Sides.** Pieces that continue each other have their positive sides on the same side: that of the piece that was given
//!   first. Pieces continue each other where two of them share an end (2D) or a part of an edge (3D) and no third one does,
//!   and where they overlap on a line or in a plane.
//! - **Rims.** A bond that touches rims at one place is cut if the pieces there surround it: if, seen along the bond, they
//!   leave no direction free. An edge covers half of all directions, a corner its angle; in 2D an end covers one of two sides.
//! - **Points on a crack.** Where a bond with an end on one piece touches the rim of another one there, at an angle, that end is
//!   taken 2 `join` to the positive side of what it lies on.
//!
//! Ends and edges meet when they are closer than `join`, a million times the tolerance of touching: 1e-3 spacings, which is
//! far above the rounding of printed coordinates, and too near for a ligament between two cracks to mean anything.

use super::Crack;
use super::cracks::{Blade, cross, crossing, difference, dot, left_of_line};
use super::polygon::{closest_on_segment, distance, edges, norm, orientation, polygon_side};
use crate::field::{Vector, embed};
use std::array::from_fn;
use std::f64::consts::PI;

/// Distance within which rims meet, in tolerances of touching.
const JOIN: f64 = 1e6;
/// How far points on a crack are taken to its positive side, in distances within which rims meet.
const ASIDE: f64 = 2.0;
/// Angle that may stay free between rims that meet in a place, and between those that nearly do, rad.
const FREE: [f64; 2] = [1e-6, 0.05];

type Place = [f64; 3];

/// All pre-cracks of a body, made ready to be asked which bonds they cut.
pub struct Cracks<const D: usize> {
    blades: Vec<Blade<'static, D>>,
    tolerance: f64,
}

/// A rim that a bond touches: where, and the angles that its piece covers about the bond.
struct Rim {
    at: Place,
    from: f64,
    width: f64,
}

impl<const D: usize> Cracks<D> {
    /// `tolerance`: the length below which things touch, 1e-9 of the spacing (m).
    pub fn new(cracks: &[Crack<D>], tolerance: f64) -> Self {
        let blades: Vec<_> = cracks.iter().map(|crack| crack.blade(tolerance)).collect();
        let turned = turned(&blades, JOIN * tolerance);
        let side = |(crack, turned): (&Crack<D>, bool)| if turned { crack.turned() } else { crack.clone() };
        let sided: Vec<Crack<D>> = cracks.iter().zip(turned).map(side).collect();
        Cracks { blades: sided.iter().map(|crack| crack.blade(tolerance).owned()).collect(), tolerance }
    }

    /// The numbers of the pieces that bonds within a box may meet.
    pub fn near(&self, low: &Vector<D>, high: &Vector<D>) -> Vec<usize> {
        let margin = (1.0 + ASIDE) * JOIN * self.tolerance;
        (0..self.blades.len()).filter(|&k| !self.blades[k].apart(low, high, margin)).collect()
    }

    /// Whether the cracks cut the bond between two points.
    pub fn cut(&self, a: &Vector<D>, b: &Vector<D>) -> bool {
        let all: Vec<usize> = (0..self.blades.len()).collect();
        self.cut_by(&all, a, b)
    }

    /// The same, if only the pieces with these numbers are near.
    pub fn cut_by(&self, near: &[usize], a: &Vector<D>, b: &Vector<D>) -> bool {
        if near.iter().any(|&k| self.blades[k].cuts(a, b)) {
            return true;
        }
        if D == 1 || near.len() < 2 && !near.iter().any(|&k| self.blades[k].is_open_polyline()) {
            return false;
        }
        // One order for both directions: rounded values could depend on it.
        let (a, b) = if b < a { (b, a) } else { (a, b) };
        let join = JOIN * self.tolerance;
        let near: Vec<&Blade<'_, D>> =
            near.iter().map(|&k| &self.blades[k]).filter(|blade| !blade.beside(a, b, (1.0 + ASIDE) * join)).collect();
        if self.surrounded(&near, a, b) {
            return true;
        }
        self.aside(&near, a, b).is_some_and(|[a, b]| {
            let (a, b) = if b < a { (b, a) } else { (a, b) };
            near.iter().any(|blade| blade.cuts(&a, &b)) || self.surrounded(&near, &a, &b)
        })
    }

    /// Whether the rims that a bond touches at one place leave no direction free.
    fn surrounded(&self, near: &[&Blade<'_, D>], a: &Vector<D>, b: &Vector<D>) -> bool {
        let join = JOIN * self.tolerance;
        [self.tolerance, join].into_iter().zip(FREE).any(|(within, free)| {
            let mut rims = Vec::new();
            near.iter().for_each(|blade| blade.touched(a, b, within, &mut rims));
            rims.len() > 1
                && rims.iter().any(|rim| {
                    let here = rims.iter().filter(|other| distance(&other.at, &rim.at) <= 2.0 * join);
                    closed(here.map(|rim| [rim.from, rim.width]).collect(), free)
                })
        })
    }

    /// The ends of a bond, those on a crack taken to its positive side; if an end is on a piece where the bond touches the rim
    /// of another one.
    fn aside(&self, near: &[&Blade<'_, D>], a: &Vector<D>, b: &Vector<D>) -> Option<[Vector<D>; 2]> {
        let join = JOIN * self.tolerance;
        let normals = |x: &Vector<D>| -> Vec<(usize, Place)> {
            let on = |(k, blade): (usize, &&Blade<'_, D>)| blade.normal_at(&embed(x), self.tolerance).map(|n| (k, n));
            near.iter().enumerate().filter_map(on).collect()
        };
        let on = [normals(a), normals(b)];
        // Where pieces meet at an angle: what continues straight on has its positive side where the other has it.
        let corners = (0..near.len()).flat_map(|k| near[k].rims(a, b, join).into_iter().map(move |rim| (k, rim)));
        let is_corner = |k: usize, rim: &Place| {
            let Some(normal) = near[k].normal_at(rim, join) else { return false };
            let others =
                (0..near.len()).filter(|&other| other != k).filter_map(|other| near[other].normal_at(rim, join));
            others.into_iter().any(|other| norm(&cross(&normal, &other)) > 1e-6)
        };
        let corners: Vec<Place> = corners.filter(|(k, rim)| is_corner(*k, rim)).map(|(_, rim)| rim).collect();
        // On the way that leads there along the crack.
        let leads = |x: &Vector<D>, on: &[(usize, Place)]| {
            let along = |n: &Place, rim: &Place| dot(n, &difference(rim, &embed(x))).abs() <= join;
            on.iter().any(|(_, n)| corners.iter().any(|rim| along(n, rim)))
        };
        if !leads(a, &on[0]) && !leads(b, &on[1]) {
            return None;
        }
        let moved = |x: &Vector<D>, on: &[(usize, Place)]| {
            let sum = on.iter().fold([0.0; 3], |sum, (_, n)| from_fn(|d| sum[d] + n[d]));
            let length = norm(&sum);
            // Sides that face each other have none in common.
            if length > 1e-6 { from_fn(|d| x[d] + ASIDE * join * sum[d] / length) } else { *x }
        };
        Some([moved(a, &on[0]), moved(b, &on[1])])
    }
}

/// Whether arcs, each from an angle on and of a width, leave no more than `free` of the circle free anywhere.
fn closed(mut arcs: Vec<[f64; 2]>, free: f64) -> bool {
    arcs.iter_mut().for_each(|arc| arc[0] = arc[0].rem_euclid(2.0 * PI));
    arcs.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let Some(first) = arcs.first() else { return false };
    let (begin, mut end) = (first[0], first[0]);
    for [from, width] in &arcs {
        if *from > end + free {
            return false;
        }
        end = end.max(from + width);
    }
    end >= begin + 2.0 * PI - free
}

impl<const D: usize> Blade<'_, D> {
    /// Whether a box lies `margin` or more beyond one side of that of the crack.
    fn apart(&self, low: &Vector<D>, high: &Vector<D>, margin: f64) -> bool {
        (0..D).any(|d| high[d] < self.low[d] - margin || low[d] > self.high[d] + margin)
    }

    /// Whether it has two ends, which may meet each other.
    fn is_open_polyline(&self) -> bool {
        matches!(&*self.crack, Crack::Polyline(vertices) if vertices.first() != vertices.last())
    }

    /// The ends of a polyline, each with the vertex before it.
    fn ends(&self) -> Vec<[[f64; 2]; 2]> {
        match &*self.crack {
            Crack::Polyline(vertices) if self.is_open_polyline() => {
                let last = vertices.len() - 1;
                vec![[vertices[0], vertices[1]], [vertices[last], vertices[last - 1]]]
            }
            _ => Vec::new(),
        }
    }

    /// The edges of its rim in 3D, and all of a polyline in 2D.
    fn edges(&self) -> Vec<[Place; 2]> {
        let flat = |x: &[f64; 2]| [x[0], x[1], 0.0];
        match &*self.crack {
            Crack::Polyline(vertices) => vertices.windows(2).map(|edge| [flat(&edge[0]), flat(&edge[1])]).collect(),
            Crack::Polygon(vertices) => edges(vertices).map(|(p, q)| [p, q]).collect(),
            Crack::Point(_) | Crack::Disc { .. } => Vec::new(),
        }
    }

    /// The unit normal of a plane piece.
    fn plane_normal(&self) -> Option<Place> {
        let normal = match &*self.crack {
            Crack::Disc { normal, .. } => *normal,
            _ => self.plane.as_ref()?.normal,
        };
        let length = norm(&normal);
        Some(normal.map(|n| n / length))
    }

    /// Height above the plane of a plane piece.
    fn height(&self, x: &Place) -> Option<f64> {
        match &*self.crack {
            Crack::Polygon(_) => Some(self.plane.as_ref()?.height(*x)),
            Crack::Disc { center, .. } => Some(dot(&self.plane_normal()?, &difference(x, center))),
            Crack::Point(_) | Crack::Polyline(_) => None,
        }
    }

    /// Whether a place is on a plane piece.
    fn holds(&self, x: &Place, within: f64) -> bool {
        self.height(x).is_some_and(|height| height.abs() <= within)
            && match (&*self.crack, &self.plane) {
                (Crack::Polygon(vertices), Some(plane)) => {
                    let flat = edges(vertices).map(|(p, q)| (plane.flatten(p), plane.flatten(q)));
                    polygon_side(flat, plane.flatten(*x)) <= 0.0
                        || edges(vertices).any(|(p, q)| off(&p, &q, x) <= within)
                }
                (Crack::Disc { center, radius, .. }, _) => distance(x, center) <= radius + within,
                _ => false,
            }
    }

    /// The direction to the positive side, if the place is on the crack.
    fn normal_at(&self, x: &Place, within: f64) -> Option<Place> {
        if let Crack::Polyline(_) = &*self.crack {
            let here = self.edges().into_iter().filter(|[p, q]| off(p, q, x) <= within);
            let left = |[p, q]: [Place; 2]| {
                let length = distance(&p, &q);
                [(p[1] - q[1]) / length, (q[0] - p[0]) / length, 0.0]
            };
            let sum = here.map(left).reduce(|sum, n| from_fn(|d| sum[d] + n[d]))?;
            let length = norm(&sum);
            return (length > 1e-6).then(|| sum.map(|n| n / length));
        }
        if self.holds(x, within) { self.plane_normal() } else { None }
    }

    /// Places of its rim that a bond touches, one of each end or edge.
    fn rims(&self, a: &Vector<D>, b: &Vector<D>, within: f64) -> Vec<Place> {
        let (a, b) = (embed(a), embed(b));
        if D == 2 {
            let ends = self.ends().into_iter().map(|[end, _]| [end[0], end[1], 0.0]);
            return ends.filter(|end| off(&a, &b, end) <= within).collect();
        }
        let nearest = |[p, q]: [Place; 2]| {
            let [on_bond, on_edge] = nearest_of_segments([&a, &b], [&p, &q]);
            (distance(&on_bond, &on_edge) <= within).then_some(on_edge)
        };
        self.edges().into_iter().filter_map(nearest).collect()
    }

    /// Adds the rims that a bond touches, with what the piece covers there.
    fn touched(&self, a: &Vector<D>, b: &Vector<D>, within: f64, rims: &mut Vec<Rim>) {
        if D == 2 {
            let [from, to] = [[a[0], a[1]], [b[0], b[1]]];
            for (k, [end, before]) in self.ends().into_iter().enumerate() {
                let at = [end[0], end[1], 0.0];
                let side = orientation(from, to, before);
                let [p, q] = if k == 0 { [end, before] } else { [before, end] };
                let [is_left, was_left] = [from, to].map(|x| left_of_line(p, q, x, self.tolerance));
                if side != 0.0 && is_left != was_left && off(&embed(a), &embed(b), &at) <= within {
                    rims.push(Rim { at, from: if side > 0.0 { 0.0 } else { PI }, width: PI });
                }
            }
            return;
        }
        let bond = [embed(a), embed(b)];
        let [Some(from), Some(to)] = bond.map(|x| self.height(&x)) else { return };
        let (Some(normal), Some(at)) = (self.plane_normal(), crossing(bond, [from, to], self.tolerance)) else {
            return;
        };
        let along = difference(&bond[1], &bond[0]);
        // Angles seen along the bond.
        let least = (0..3).min_by(|&i, &j| along[i].abs().total_cmp(&along[j].abs())).unwrap_or(0);
        let first = cross(&along, &from_fn(|d| if d == least { 1.0 } else { 0.0 }));
        let (first, second) = (first.map(|x| x / norm(&first)), cross(&along, &first));
        let second = second.map(|x| x / norm(&second));
        let angle = |way: &Place| dot(&second, way).atan2(dot(&first, way));
        let is_left_about = dot(&normal, &along) > 0.0;
        match &*self.crack {
            Crack::Polygon(vertices) => {
                let n = vertices.len();
                let nearest = |far: &dyn Fn(usize) -> f64| {
                    (0..n).min_by(|&i, &j| far(i).total_cmp(&far(j))).filter(|&k| far(k) <= within)
                };
                let next = |k: usize| vertices[(k + 1) % n];
                if let Some(k) = nearest(&|k| distance(&vertices[k], &at)) {
                    let to_next = angle(&difference(&next(k), &vertices[k]));
                    let to_last = angle(&difference(&vertices[(k + n - 1) % n], &vertices[k]));
                    let [from, to] = if is_left_about { [to_next, to_last] } else { [to_last, to_next] };
                    rims.push(Rim { at, from, width: (to - from).rem_euclid(2.0 * PI) });
                } else if let Some(k) = nearest(&|k| off(&vertices[k], &next(k), &at)) {
                    let along = angle(&difference(&next(k), &vertices[k]));
                    rims.push(Rim { at, from: if is_left_about { along } else { along - PI }, width: PI });
                }
            }
            Crack::Disc { center, radius, .. } if (distance(&at, center) - radius).abs() <= within => {
                rims.push(Rim { at, from: angle(&difference(center, &at)) - 0.5 * PI, width: PI });
            }
            _ => {}
        }
    }

    /// Whether the rim or the inside of either piece has a place of the other.
    fn meets(&self, other: &Self, join: f64) -> bool {
        let corners = |blade: &Self| -> Vec<Place> {
            match &*blade.crack {
                Crack::Disc { center, .. } => vec![*center],
                _ => blade.edges().into_iter().map(|[p, _]| p).collect(),
            }
        };
        let near = |[p, q]: &[Place; 2], [r, s]: &[Place; 2]| {
            let [x, y] = nearest_of_segments([p, q], [r, s]);
            distance(&x, &y) <= join
        };
        corners(other).iter().any(|x| self.holds(x, join))
            || corners(self).iter().any(|x| other.holds(x, join))
            || self.edges().iter().any(|edge| other.edges().iter().any(|across| near(edge, across)))
    }
}

/// Distance of a place from a segment.
fn off(p: &Place, q: &Place, x: &Place) -> f64 {
    distance(x, &closest_on_segment(p, q, x))
}

/// The nearest places of two segments, one on each.
fn nearest_of_segments([a, b]: [&Place; 2], [p, q]: [&Place; 2]) -> [Place; 2] {
    let (along, across, between) = (difference(b, a), difference(q, p), difference(p, a));
    let (u, v, w) = (dot(&along, &along), dot(&across, &across), dot(&along, &across));
    let (s, t) = (dot(&along, &between), dot(&across, &between));
    let square = u * v - w * w;
    // Of parallel segments an end is nearest.
    let mut candidates = vec![
        [closest_on_segment(a, b, p), *p],
        [closest_on_segment(a, b, q), *q],
        [*a, closest_on_segment(p, q, a)],
        [*b, closest_on_segment(p, q, b)],
    ];
    if square > 1e-12 * u * v {
        let on_bond = (s * v - w * t) / square;
        let on_edge = (s * w - u * t) / square;
        if (0.0..=1.0).contains(&on_bond) && (0.0..=1.0).contains(&on_edge) {
            candidates.push([from_fn(|d| a[d] + on_bond * along[d]), from_fn(|d| p[d] + on_edge * across[d])]);
        }
    }
    let far = |pair: &[Place; 2]| distance(&pair[0], &pair[1]);
    candidates.into_iter().min_by(|x, y| far(x).total_cmp(&far(y))).expect("four or five")
}

/// Which pieces have to exchange their sides, so that those that continue each other have the same.
fn turned<const D: usize>(blades: &[Blade<'_, D>], join: f64) -> Vec<bool> {
    let n = blades.len();
    let mut relations: Vec<Vec<(usize, bool)>> = vec![Vec::new(); n];
    for i in 0..n {
        for j in i + 1..n {
            if blades[i].apart(&blades[j].low, &blades[j].high, join) {
                continue;
            }
            if let Some(against) = opposed(blades, i, j, join) {
                relations[i].push((j, against));
                relations[j].push((i, against));
            }
        }
    }
    let mut turned: Vec<Option<bool>> = vec![None; n];
    for first in 0..n {
        if turned[first].is_some() {
            continue;
        }
        turned[first] = Some(false);
        let mut open = vec![first];
        while let Some(i) = open.pop() {
            for &(j, against) in &relations[i] {
                if turned[j].is_none() {
                    turned[j] = turned[i].map(|turned| turned != against);
                    open.push(j);
                }
            }
        }
    }
    turned.into_iter().map(|turned| turned == Some(true)).collect()
}

/// Whether two pieces that continue each other have their sides exchanged; None if they do not.
fn opposed<const D: usize>(blades: &[Blade<'_, D>], i: usize, j: usize, join: f64) -> Option<bool> {
    let (here, there) = (&blades[i], &blades[j]);
    if let (Some(n), Some(m)) = (here.plane_normal(), there.plane_normal()) {
        let size = |blade: &Blade<'_, D>| distance(&embed(&blade.low), &embed(&blade.high));
        // Two planes that part by less than the rims are apart.
        let is_coplanar = norm(&cross(&n, &m)) * size(here).max(size(there)) <= 2.0 * join;
        if is_coplanar && here.meets(there, join) {
            return Some(dot(&n, &m) < 0.0);
        }
    }
    let shared =
        here.edges().into_iter().find_map(|edge| there.edges().into_iter().find_map(|other| shared(edge, other, join)));
    match (D, shared) {
        // Two of a line that overlap, and facets that share an edge, which each goes round in its own direction.
        (2, Some((_, is_same_way))) => Some(!is_same_way),
        (3, Some((at, is_same_way))) => {
            let others = |blade: &Blade<'_, D>| blade.edges().iter().any(|[p, q]| off(p, q, &at) <= join);
            (blades.iter().filter(|blade| others(blade)).count() == 2).then_some(is_same_way)
        }
        (2, None) => {
            let ends =
                |blade: &Blade<'_, D>| blade.ends().into_iter().map(|[end, _]| [end[0], end[1], 0.0]).enumerate();
            let meeting = ends(here).flat_map(|e| ends(there).map(move |f| (e, f)));
            meeting.into_iter().find_map(|((e, x), (f, y))| {
                let pass = |blade: &Blade<'_, D>| blade.edges().iter().any(|[p, q]| off(p, q, &x) <= join);
                let is_pair = distance(&x, &y) <= join && blades.iter().filter(|blade| pass(blade)).count() == 2;
                is_pair.then_some(e == f)
            })
        }
        _ => None,
    }
}

/// The middle of what two segments share, if they lie on one line and overlap, and whether they go the same way.
fn shared([p, q]: [Place; 2], [r, s]: [Place; 2], join: f64) -> Option<(Place, bool)> {
    let length = distance(&p, &q);
    let way = difference(&q, &p).map(|x| x / length);
    let at = |x: &Place| dot(&way, &difference(x, &p));
    let (low, high) = (at(&r).min(at(&s)).max(0.0), at(&r).max(at(&s)).min(length));
    let middle: Place = from_fn(|d| p[d] + 0.5 * (low + high) * way[d]);
    let both = [low, high].map(|t| -> Place { from_fn(|d| p[d] + t * way[d]) });
    let is_shared = high - low > join && both.iter().all(|x| off(&r, &s, x) <= join);
    is_shared.then(|| (middle, at(&s) > at(&r)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear congruential sequence between 0 and 1: the tests need scatter, not randomness.
    struct Scatter(u64);

    impl Scatter {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 33) as f64 / (1u64 << 31) as f64
        }

        fn below(&mut self, n: usize) -> usize {
            (self.next() * n as f64) as usize
        }

        fn shuffle<T>(&mut self, list: &mut [T]) {
            for k in (1..list.len()).rev() {
                list.swap(k, self.below(k + 1));
            }
        }
    }

    /// Pairs of points of a lattice of spacing 1 about the origin that are at most three apart, and which of them are cut.
    fn cut<const D: usize>(cracks: &[Crack<D>], half: [i32; D], offset: f64) -> Vec<bool> {
        cracks.iter().for_each(|crack| crack.validate().unwrap());
        let joined = Cracks::new(cracks, 1e-9);
        let mut cut = Vec::new();
        bonds(half, |a, b| {
            let [a, b] = [a, b].map(|x| x.map(|c| f64::from(c) + offset));
            cut.push(joined.cut(&a, &b));
            assert_eq!(joined.cut(&b, &a), cut[cut.len() - 1], "{a:?} {b:?} from the other end");
        });
        cut
    }

    fn same<const D: usize>(whole: &[bool], pieces: &[bool], half: [i32; D], label: &str) {
        let mut k = 0;
        bonds(half, |a, b| {
            assert_eq!(whole[k], pieces[k], "{a:?} {b:?}: {label}");
            k += 1;
        });
    }

    fn bonds<const D: usize>(half: [i32; D], mut each: impl FnMut([i32; D], [i32; D])) {
        let box_of = |half: [i32; D], each: &mut dyn FnMut([i32; D])| {
            crate::geometry::for_each_cell(half.map(|n| 2 * n as usize + 1), |cell| {
                each(from_fn(|d| cell[d] as i32 - half[d]));
            });
        };
        let mut offsets = Vec::new();
        box_of([3; D], &mut |xi| {
            if xi > [0; D] && xi.iter().map(|c| c * c).sum::<i32>() <= 9 {
                offsets.push(xi);
            }
        });
        box_of(half, &mut |a| {
            for xi in &offsets {
                let b: [i32; D] = from_fn(|d| a[d] + xi[d]);
                if (0..D).all(|d| b[d].abs() <= half[d]) {
                    each(a, b);
                }
            }
        });
    }

    fn segment(p: [f64; 2], q: [f64; 2]) -> Crack<2> {
        Crack::Polyline(vec![p, q])
    }

    /// The pieces in any order and each in any sense, but the first, which says where the positive side is.
    fn mixed<const D: usize>(scatter: &mut Scatter, pieces: Vec<Crack<D>>) -> Vec<Crack<D>> {
        let mut pieces: Vec<Crack<D>> = pieces;
        scatter.shuffle(&mut pieces);
        let turn =
            |(k, crack): (usize, &Crack<D>)| if k > 0 && scatter.next() < 0.5 { crack.turned() } else { crack.clone() };
        pieces.iter().enumerate().map(turn).collect()
    }

    #[test]
    fn a_polyline_in_pieces_cuts_what_it_cuts_in_one() {
        let mut scatter = Scatter(1);
        let (mut total, mut pieces_of_all) = (0, 0);
        for round in 0..300 {
            // Vertices in points, between them, and anywhere.
            let grid = [1.0, 2.0, 1e6][round % 3];
            let vertices: Vec<[f64; 2]> = loop {
                let place = |scatter: &mut Scatter| ((scatter.next() - 0.5) * 13.0 * grid).round() / grid;
                let found: Vec<[f64; 2]> =
                    (0..2 + scatter.below(3)).map(|_| from_fn(|_| place(&mut scatter))).collect();
                let corners = || found.windows(3).map(|c| orientation(c[0], c[1], c[2]).abs());
                let crosses = found.len() > 3 && corners().count() > 0;
                if Crack::<2>::Polyline(found.clone()).validate().is_ok() && corners().all(|c| c > 0.1) && !crosses {
                    break found;
                }
            };
            let mut pieces = Vec::new();
            for edge in vertices.windows(2) {
                let mut places: Vec<f64> = (0..scatter.below(5)).map(|_| scatter.below(64) as f64 / 64.0).collect();
                places.extend([0.0, 1.0]);
                places.sort_by(f64::total_cmp);
                places.dedup();
                let at = |t: f64| -> [f64; 2] {
                    if t == 1.0 { edge[1] } else { from_fn(|d| edge[0][d] + t * (edge[1][d] - edge[0][d])) }
                };
                pieces.extend(places.windows(2).map(|t| segment(at(t[0]), at(t[1]))));
            }
            pieces_of_all += pieces.len();
            let pieces = mixed(&mut scatter, pieces);
            let whole = cut(&[Crack::Polyline(vertices.clone())], [5; 2], 0.0);
            same(&whole, &cut(&pieces, [5; 2], 0.0), [5; 2], &format!("{vertices:?} {pieces:?}"));
            total += whole.iter().filter(|cut| **cut).count();
        }
        assert!(total > 10_000 && pieces_of_all > 1000, "{total} {pieces_of_all}");
    }

    #[test]
    fn a_plane_polygon_in_triangles_cuts_what_it_cuts_in_one() {
        let mut scatter = Scatter(2);
        // Flat, in a diagonal plane, and in a plane that no point lies in.
        let lifts: [fn([f64; 2]) -> [f64; 3]; 4] = [
            |[x, y]| [x, y, 0.0],
            |[x, y]| [x, y, x + y],
            |[x, y]| [x, 0.5, y],
            |[x, y]| [x, 0.3 * x - 0.7 * y + 0.1, y],
        ];
        let mut total = 0;
        for round in 0..12 {
            let lift = lifts[round % 4];
            let low = [-4.0 + scatter.below(3) as f64, -4.0 + 0.5 * scatter.below(5) as f64];
            let high = [4.0 - 0.5 * scatter.below(5) as f64, 2.0 + scatter.below(5) as f64 / 3.0];
            let inside: Vec<[f64; 2]> = (0..scatter.below(5))
                .map(|_| from_fn(|d| low[d] + (1 + scatter.below(7)) as f64 / 8.0 * (high[d] - low[d])))
                .collect();
            let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
            let mut triangles = vec![[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]];
            for x in inside {
                // Each triangle that holds the place becomes three or, on an edge, two.
                for triangle in std::mem::take(&mut triangles) {
                    let [p, q, r] = triangle;
                    let turns = [orientation(p, q, x), orientation(q, r, x), orientation(r, p, x)];
                    if turns.iter().any(|turn| *turn < -1e-9) {
                        triangles.push(triangle);
                        continue;
                    }
                    let parts = [[p, q, x], [q, r, x], [r, p, x]];
                    triangles.extend(parts.into_iter().zip(turns).filter(|(_, turn)| *turn > 1e-9).map(|(t, _)| t));
                }
            }
            let pieces = triangles.iter().map(|t| Crack::<3>::Polygon(t.map(lift).to_vec())).collect();
            let pieces = mixed(&mut scatter, pieces);
            let whole = cut(&[Crack::<3>::Polygon(corners.map(lift).to_vec())], [4; 3], 0.0);
            same(&whole, &cut(&pieces, [4; 3], 0.0), [4; 3], &format!("{corners:?} {pieces:?}"));
            total += whole.iter().filter(|cut| **cut).count();
        }
        assert!(total > 5_000, "{total}");
    }

    /// A bond is cut if its ends lie in different parts of space.
    fn separates<const D: usize>(label: &str, cracks: &[Crack<D>], half: [i32; D], part: impl Fn(&[f64; D]) -> u32) {
        for offset in [0.0, 0.25, 0.5] {
            let found = cut(cracks, half, offset);
            let (mut k, mut n) = (0, 0);
            bonds(half, |a, b| {
                let [a, b] = [a, b].map(|x| x.map(|c| f64::from(c) + offset));
                let parts = || (1..64).map(|t| part(&from_fn(|d| a[d] + f64::from(t) / 64.0 * (b[d] - a[d]))));
                let expected = part(&a) != part(&b);
                if !expected && parts().any(|other| other != part(&a)) {
                    // Out of one part and into it again.
                    k += 1;
                    return;
                }
                assert_eq!(found[k], expected, "{label}: {a:?} {b:?}, moved by {offset}");
                k += 1;
                n += usize::from(expected);
            });
            assert!(n > 0, "{label}");
        }
    }

    #[test]
    fn junctions_separate_all_parts_between_their_arms() {
        let mut scatter = Scatter(3);
        let (far, o) = (20.0, [0.0, 0.0]);
        let [east, north, west, south] = [[far, 0.0], [0.0, far], [-far, 0.0], [0.0, -far]];
        // Points on arms are on the left of the bar and of the stem, which goes up.
        let t = |x: &[f64; 2]| {
            if x[1] < 0.0 {
                0
            } else if x[0] <= 0.0 {
                1
            } else {
                2
            }
        };
        separates("a stem on a bar", &[segment(west, east), segment(o, north)], [5; 2], t);
        separates("a bar of two", &[segment(west, o), segment(o, east), segment(o, north)], [5; 2], t);
        let near = [0.0, 5e-4];
        separates("a stem that nearly touches", &[segment(west, east), segment(near, north)], [5; 2], t);
        let x = |x: &[f64; 2]| u32::from(x[0] > 0.0) + 2 * u32::from(x[1] < 0.0);
        separates("two that cross", &[segment(west, east), segment(south, north)], [5; 2], x);
        let four = [segment(west, o), segment(o, east), segment(south, o), segment(o, north)];
        separates("four that meet", &four, [5; 2], x);
        let l = |x: &[f64; 2]| u32::from(x[0] > 0.0 || x[1] < 0.0);
        for _ in 0..10 {
            // Its left is the upper left quarter.
            let corner = vec![
                segment(west, [-2.3, 0.0]),
                segment([-2.3, 0.0], o),
                segment(o, [0.0, 2.0]),
                segment([0.0, 2.0], north),
            ];
            separates("a corner", &mixed(&mut scatter, corner), [5; 2], l);
        }
        let overlapping = [segment(west, [1.5, 0.0]), segment(east, [-1.5, 0.0]), segment([-3.0, 0.0], [3.0, 0.0])];
        separates("pieces that overlap", &overlapping, [5; 2], |x| u32::from(x[1] >= 0.0));
    }

    fn rectangle(p: [f64; 3], u: [f64; 3], v: [f64; 3]) -> Crack<3> {
        let sum = |list: &[[f64; 3]]| from_fn(|d| list.iter().map(|x| x[d]).sum());
        Crack::Polygon(vec![p, sum(&[p, u]), sum(&[p, u, v]), sum(&[p, v])])
    }

    #[test]
    fn facets_that_share_edges_separate_all_parts_between_them() {
        let mut scatter = Scatter(4);
        let (far, half) = (20.0, [3; 3]);
        let [x, y, z] = [[far, 0.0, 0.0], [0.0, far, 0.0], [0.0, 0.0, far]];
        let minus = |v: [f64; 3]| v.map(|c| -c);
        let at = |a: [f64; 3], t: f64| a.map(|c| c * t);
        // Floor z = 0 in two parts, its positive side up; a wall on it at x = 0, of two parts, positive towards -x.
        let floor = [rectangle(at(y, -0.5), x, y), rectangle(from_fn(|d| minus(x)[d] - 0.5 * y[d]), x, y)];
        let wall = [rectangle(at(y, -0.5), z, at(y, 0.5)), rectangle([0.0; 3], z, at(y, 0.5))];
        let flat = |x: &[f64; 3]| u32::from(x[2] >= 0.0);
        for _ in 0..4 {
            separates("a floor of two", &mixed(&mut scatter, floor.to_vec()), half, flat);
        }
        let angle = |x: &[f64; 3]| u32::from(x[0] > 0.0 || x[2] < 0.0);
        let corner = [floor[1].clone(), wall[0].clone(), wall[1].clone()];
        for _ in 0..6 {
            separates("a floor and a wall", &mixed(&mut scatter, corner.to_vec()), half, angle);
        }
        let t = |x: &[f64; 3]| {
            if x[2] < 0.0 {
                0
            } else if x[0] <= 0.0 {
                1
            } else {
                2
            }
        };
        separates("a wall on a floor", &[&floor[..], &wall[..]].concat(), half, t);
        let whole = [rectangle(from_fn(|d| minus(x)[d] - 0.5 * y[d]), at(x, 2.0), y), wall[0].clone(), wall[1].clone()];
        separates("a wall on a whole floor", &whole, half, t);
    }

    #[test]
    fn a_triangulated_roof_cuts_where_it_is_crossed() {
        // A pyramid without ground over a square, of four triangles about its top or of sixteen; far beyond the points.
        let (top, side) = ([0.0, 0.0, 1.0], 30.0);
        let corner = |k: usize| [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][k % 4];
        let down = |[x, y]: [f64; 2]| [side * x, side * y, 1.0 - side];
        let four: Vec<Crack<3>> =
            (0..4).map(|k| Crack::Polygon(vec![top, down(corner(k)), down(corner(k + 1))])).collect();
        let mut sixteen = Vec::new();
        for k in 0..4 {
            let mix = |s: f64, t: f64| -> [f64; 3] {
                let [a, b] = [down(corner(k)), down(corner(k + 1))];
                from_fn(|d| top[d] + s * (a[d] - top[d]) + t * (b[d] - top[d]))
            };
            let (h, i) = (2.0 / side, 1.0);
            sixteen.push(Crack::Polygon(vec![top, mix(h, 0.0), mix(0.0, h)]));
            sixteen.push(Crack::Polygon(vec![mix(h, 0.0), mix(i, 0.0), mix(0.0, h)]));
            sixteen.push(Crack::Polygon(vec![mix(0.0, i), mix(0.0, h), mix(i, 0.0)]));
        }
        let outside = |x: &[f64; 3]| u32::from(x[2] >= 1.0 - x[0].abs() - x[1].abs() - 1e-9);
        separates("four triangles", &four, [3; 3], outside);
        let mut scatter = Scatter(5);
        separates("twelve triangles", &mixed(&mut scatter, sixteen), [3; 3], |x| outside(x));
    }

    #[test]
    fn rims_of_one_piece_and_of_pieces_apart_are_kept() {
        // Two in a row with a ligament that a bond goes through.
        let pair = [segment([-9.0, 0.5], [-0.1, 0.5]), segment([0.1, 0.5], [9.0, 0.5])];
        let joined = Cracks::new(&pair, 1e-9);
        assert!(!joined.cut(&[0.0, 0.0], &[0.0, 1.0]) && joined.cut(&[1.0, 0.0], &[1.0, 1.0]));
        // A corner that a bond grazes.
        let roof = [segment([-2.0, 0.0], [0.0, 1.0]), segment([0.0, 1.0], [2.0, 0.0])];
        let roof = Cracks::new(&roof, 1e-9);
        assert!(!roof.cut(&[-1.0, 1.0], &[1.0, 1.0]) && roof.cut(&[0.0, 0.0], &[0.0, 2.0]));
        // A polygon beside a disc: their common chord is inside both.
        let disc = Crack::Disc { center: [0.0; 3], normal: [0.0, 0.0, 1.0], radius: 2.5 };
        let wing = Crack::Polygon(vec![[2.0, -1.5, 0.0], [9.0, -1.5, 0.0], [9.0, 1.5, 0.0], [2.0, 1.5, 0.0]]);
        let both = Cracks::new(&[disc, wing.turned()], 1e-9);
        for (x, y) in [(2.0, 0.0), (2.5, 0.0), (2.0, 1.0), (4.0, 0.0), (0.0, 2.0)] {
            assert!(both.cut(&[x, y, -1.0], &[x, y, 1.0]), "{x} {y}");
            assert!(both.cut(&[x, y, 0.0], &[x, y, -1.0]) && !both.cut(&[x, y, 0.0], &[x, y, 1.0]), "{x} {y}");
        }
        assert!(!both.cut(&[0.0, 2.5, -1.0], &[0.0, 2.5, 1.0]) && !both.cut(&[3.0, 1.5, -1.0], &[3.0, 1.5, 1.0]));
    }
}
