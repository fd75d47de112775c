//! Surfaces of a case: which pieces a name stands for, and what acts on them.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::super::model::{self, Formula, SurfacePart};
use super::Builder;
use super::conditions::rounded;
use super::geometry::{shape_of, vector};
use crate::conditions::{FormulaAtPoints, Load, Loaded, Scale, Term};
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::field::{Vector, embed};
use crate::geometry::{Cloud, Fits, Piece, Shape, TIE};
use crate::output::source::LoadSummary;

/// What a formula of a part of a surface may use: the place and the outward normal.
const VARIABLES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
/// A face of which a set reaches this share is meant.
const WHOLE: f64 = 0.99;
/// In how many cells around what is loaded, points are looked for.
const AROUND: f64 = 6.0;
/// How far the force of a layer may be from that on the surface before it is said.
const LAYER: f64 = 0.1;

#[allow(clippy::type_complexity)] // a predicate over pieces
type Part<const D: usize> = Box<dyn Fn(&Piece<D>) -> bool>;

/// The points of a body, as those who look for neighbours want them.
struct Points<const D: usize> {
    slots: Vec<u32>,
    positions: Vec<Vector<D>>,
    sides: Vec<f64>,
}

impl<const D: usize> Points<D> {
    /// Those within some cells of a box.
    fn around(cloud: &Cloud<D>, (low, high): (Vector<D>, Vector<D>)) -> Self {
        let margin = AROUND * cloud.spacing;
        let slots = cloud.select(|x| (0..D).all(|d| x[d] >= low[d] - margin && x[d] <= high[d] + margin));
        let positions = slots.iter().map(|&slot| cloud.position(slot as usize)).collect();
        let sides = slots.iter().map(|&slot| cloud.size(slot as usize)).collect();
        Points { slots, positions, sides }
    }
}

impl<const D: usize> Builder<'_, D> {
    /// Names of surfaces become sets too: of the points that carry what acts on them.
    pub(super) fn surfaces(&self, cloud: &mut Cloud<D>, shape: Option<&Shape<D>>) -> Result<()> {
        let mut found = Vec::new();
        for name in self.case.value.surfaces.keys() {
            let path = format!("surfaces.{name}");
            if cloud.sets.get(name).is_some() {
                let message = "a set of points has this name too";
                return Err(self.refuse(&path, message, "rename one of them"));
            }
            let pieces = self.pieces_named(name, cloud, shape)?;
            let coefficients = vec![1.0; pieces.len()];
            let (slots, _) = self.loaded(pieces, coefficients, true, shape)?.spread_over(cloud);
            found.push((name.clone(), slots));
        }
        found.into_iter().for_each(|(name, slots)| cloud.sets.insert(name, slots));
        Ok(())
    }

    /// The pieces that a name of `[surfaces]` stands for.
    fn pieces_named(&self, name: &str, cloud: &Cloud<D>, shape: Option<&Shape<D>>) -> Result<Vec<Piece<D>>> {
        let path = format!("surfaces.{name}");
        let Some(shape) = shape else {
            let message = "nobody knows where the surface of points from a file is";
            return Err(self.refuse(&path, message, "load a set of points, with `area` or `thickness`"));
        };
        let part = self.part(&self.case.value.surfaces[name], TIE * cloud.spacing, &path)?;
        let pieces = self.boundary(shape, cloud.spacing, &*part);
        if pieces.is_empty() {
            let (low, high) = shape.bounds();
            let message =
                format!("no part of the surface is here; the body spans {} to {} m", rounded(&low), rounded(&high));
            return Err(self.refuse(&path, message, "nx, ny, nz are the outward normal, as in `where = \"ny > 0.5\"`"));
        }
        Ok(pieces)
    }

    /// Pieces of the boundary, but for what lies in a mirror or where a body goes on.
    fn boundary(&self, shape: &Shape<D>, size: f64, wanted: &dyn Fn(&Piece<D>) -> bool) -> Vec<Piece<D>> {
        let (low, high) = shape.bounds();
        let goes_on = |piece: &Piece<D>| {
            (0..D).any(|d| {
                let [before, after] = self.continued(d);
                let lies =
                    |at: f64, side: f64| (piece.place[d] - at).abs() < TIE * size && side * piece.normal[d] > 0.5;
                (before && lies(low[d], -1.0)) || (after && lies(high[d], 1.0))
            })
        };
        shape.surface(size, &|piece| wanted(piece) && !goes_on(piece))
    }

    /// Whether a piece is in a part of the surface, but for a tie, m.
    fn part(&self, part: &SurfacePart, tie: f64, path: &str) -> Result<Part<D>> {
        let list =
            |parts: &[SurfacePart]| parts.iter().map(|part| self.part(part, tie, path)).collect::<Result<Vec<_>>>();
        Ok(match part {
            SurfacePart::Where(formula) => {
                let expression = match formula {
                    Formula::Number(x) => Expression::constant(*x),
                    Formula::Text(text) => Expression::compile(text, &VARIABLES, &self.case.constants)
                        .map_err(|e| Error::Refused(format!("{text}: {e}")))?,
                };
                Box::new(move |piece| {
                    let [[x, y, z], [nx, ny, nz]] = [embed(&piece.place), embed(&piece.normal)];
                    expression.evaluate(&[x, y, z, nx, ny, nz]) != 0.0
                })
            }
            SurfacePart::Box { low, high } => {
                let (low, high) = (vector::<D>(low), vector::<D>(high));
                Box::new(move |Piece { place: x, .. }| (0..D).all(|d| x[d] >= low[d] - tie && x[d] <= high[d] + tie))
            }
            SurfacePart::Inside(shape) => {
                let shape = shape_of::<D>(shape);
                shape.validate().map_err(|e| self.refuse(&format!("{path}.inside"), e, ""))?;
                Box::new(move |piece| shape.holds(&piece.place, tie))
            }
            SurfacePart::All(parts) => {
                let all = list(parts)?;
                Box::new(move |piece| all.iter().all(|inside| inside(piece)))
            }
            SurfacePart::Any(parts) => {
                let any = list(parts)?;
                Box::new(move |piece| any.iter().any(|inside| inside(piece)))
            }
            SurfacePart::Not(part) => {
                let inside = self.part(part, tie, path)?;
                Box::new(move |piece| !inside(piece))
            }
        })
    }

    /// The surface that a set of points stands for: below which they lie. Of an edge of a deep set, the strips of the faces beside it
    /// are not meant: they lie within the depth of the set below a larger face, and the set does not reach all of them.
    fn below(&self, members: &[u32], cloud: &Cloud<D>, shape: &Shape<D>) -> Vec<Piece<D>> {
        let (low, high) = bounds(members.iter().map(|&slot| cloud.position(slot as usize)));
        let points = Points::around(cloud, (low, high));
        let fits = Fits::new(&points.positions, &points.sides, Some(shape), &[]);
        let beside = |x: &Vector<D>| (0..D).all(|d| (low[d] - cloud.spacing..high[d] + cloud.spacing).contains(&x[d]));
        let in_set = |k: usize| members.binary_search(&points.slots[k]).is_ok();
        // The point whose cell a piece is a side of.
        let under = |piece: &Piece<D>, depth: f64| {
            let inner = std::array::from_fn(|d| piece.place[d] - depth * cloud.spacing * piece.normal[d]);
            fits.nearest(&inner)
        };
        let reached = |piece: &Piece<D>| under(piece, 0.5).is_some_and(in_set);
        let all = self.boundary(shape, cloud.spacing, &|_| true);
        let mut faces: BTreeMap<u32, (f64, Vec<Piece<D>>)> = BTreeMap::new();
        for piece in all {
            let (whole, found) = faces.entry(piece.face).or_default();
            *whole += piece.area;
            if beside(&piece.place) && reached(&piece) {
                found.push(piece);
            }
        }
        faces.retain(|_, (_, found)| !found.is_empty());
        let area = |pieces: &[Piece<D>]| pieces.iter().map(|piece| piece.area).sum::<f64>();
        // How many cells the set goes down, in the middle of all pieces of a face.
        let deep = |pieces: &[Piece<D>]| {
            let down =
                |piece: &Piece<D>| (1..64).find(|k| !under(piece, *k as f64 + 0.5).is_some_and(in_set)).unwrap_or(64);
            let mut depths: Vec<u32> = pieces.iter().map(down).collect();
            depths.sort_unstable();
            f64::from(depths[depths.len() / 2]) * cloud.spacing
        };
        let strips: Vec<u32> = faces
            .iter()
            .filter(|(_, (whole, found))| area(found) < WHOLE * whole)
            .filter(|(face, (_, found))| {
                faces.iter().any(|(other, (_, larger))| {
                    if other == *face || area(larger) <= area(found) {
                        return false;
                    }
                    let places: Vec<Vector<D>> = larger.iter().map(|piece| piece.place).collect();
                    let sizes = vec![cloud.spacing; places.len()];
                    let near = Fits::new(&places, &sizes, None, &[]);
                    let depth = deep(larger) + 0.75 * cloud.spacing;
                    found.iter().all(|piece| !near.near(&piece.place, depth).is_empty())
                })
            })
            .map(|(face, _)| *face)
            .collect();
        faces.into_iter().filter(|(face, _)| !strips.contains(face)).flat_map(|(_, (_, found))| found).collect()
    }

    fn loaded(
        &self,
        pieces: Vec<Piece<D>>,
        coefficients: Vec<f64>,
        uniform: bool,
        shape: Option<&Shape<D>>,
    ) -> Result<Loaded<D>> {
        Ok(Loaded { pieces, coefficients, shape: shape.cloned(), cracks: self.cracks()?, uniform })
    }

    /// The pieces that something acts on by area: of a surface, or those above a set of points. None where a set is a layer of its
    /// own thickness, or no surface is known.
    pub(super) fn pieces_of(
        &self,
        k: usize,
        cloud: &Cloud<D>,
        shape: Option<&Shape<D>>,
        slots: &[u32],
    ) -> Result<Option<Vec<Piece<D>>>> {
        let condition = &self.case.value.conditions[k];
        let on = condition.on.as_deref().unwrap_or_default();
        if self.case.value.surfaces.contains_key(on) {
            return self.pieces_named(on, cloud, shape).map(Some);
        }
        let Some(shape) = shape else { return Ok(None) };
        let pieces = self.below(slots, cloud, shape);
        let (thickness, area) = condition.load.as_ref().map_or((None, None), model::Load::layer);
        if let Some(thickness) = thickness {
            let layer = slots.iter().map(|&slot| cloud.volume(slot as usize)).sum::<f64>() / thickness;
            let surface: f64 = pieces.iter().map(|piece| piece.area).sum();
            if surface > 0.0 && (layer / surface - 1.0).abs() > LAYER {
                let message = format!(
                    "the set's volume over this thickness is {layer:.4e}, and the surface above the set {surface:.4e} \
                     (m² in 3D): forces differ by as much"
                );
                let path = format!("conditions[{k}].load");
                let help = "without `thickness` the load is that on the surface";
                log::warn!("{}", self.source().warning(&path, message).help(help));
            }
            return Ok(None);
        }
        if area.is_some() {
            return Ok(None);
        }
        if pieces.is_empty() {
            let message = "no point of this set lies at the surface";
            let help = "choose points at the surface, name it in `[surfaces]`, or give `thickness`: of the layer that the set is";
            return Err(self.refuse(&format!("conditions[{k}].on"), message, help));
        }
        Ok(Some(pieces))
    }

    /// Adds what acts on pieces: `coefficient` of each and of each component, N for a unit of the formula.
    #[allow(clippy::too_many_arguments)] // what, where, onto what
    pub(super) fn on_pieces(
        &self,
        k: usize,
        value: &Formula,
        cloud: &Cloud<D>,
        shape: Option<&Shape<D>>,
        pieces: &[Piece<D>],
        coefficient: &dyn Fn(&Piece<D>) -> Vector<D>,
        terms: &mut Vec<Box<dyn Term>>,
    ) -> Result<()> {
        let condition = &self.case.value.conditions[k];
        let load = condition.load.as_ref().map_or("", model::Load::name);
        let path = format!("conditions[{k}].load.{load}.value");
        for d in 0..D {
            let coefficients: Vec<f64> = pieces.iter().map(|piece| coefficient(piece)[d]).collect();
            if coefficients.iter().all(|c| *c == 0.0) {
                continue;
            }
            let places = pieces.iter().map(|piece| piece.place);
            let mut profile = FormulaAtPoints::at_places(self.expression(value)?, places).until(self.last_instant(k));
            if let Some((bad, value)) = profile.at(0.0).iter().copied().enumerate().find(|(_, v)| !v.is_finite()) {
                let position = rounded(&pieces[bad].place);
                let message = format!("the formula is {value} at t = 0 on the surface at {position} m");
                let help = "keep it finite everywhere, as in `sqrt(max(x, 0))` or `if(x > 0, 1/x, 0)`";
                return Err(self.refuse(&path, message, help));
            }
            let loaded = self.loaded(pieces.to_vec(), coefficients, profile.is_uniform(), shape)?;
            let (slots, spread) = loaded.spread_over(cloud);
            let mut load = Load::spread(slots, d, profile, spread);
            load.until = condition.until.unwrap_or(f64::INFINITY);
            terms.push(Box::new(load));
        }
        Ok(())
    }

    /// A force at a place, along a line, or a moment about an axis; units of the formula by what they are.
    pub(super) fn apart_from_area(
        &self,
        k: usize,
        load: &model::Load,
        cloud: &Cloud<D>,
        shape: Option<&Shape<D>>,
        slots: &[u32],
        terms: &mut Vec<Box<dyn Term>>,
    ) -> Result<()> {
        let along = |component: usize| {
            move |piece: &Piece<D>| std::array::from_fn(|d| if d == component { piece.area } else { 0.0 })
        };
        let place = |place: Vector<D>, area: f64| Piece { place, normal: [0.0; D], area, face: 0 };
        let path = format!("conditions[{k}].load.{}", load.name());
        let inside = |pieces: &[Piece<D>]| {
            let Some(shape) = shape else { return Ok(()) };
            match pieces.iter().find(|piece| !shape.holds(&piece.place, TIE * cloud.spacing)) {
                None => Ok(()),
                Some(out) => {
                    let message = format!("{} m is outside the body", rounded(&out.place));
                    Err(self.refuse(&path, message, "a force acts in the body or on its surface"))
                }
            }
        };
        match load {
            model::Load::Point { at, component, value } => {
                let pieces = [place(vector(at), 1.0)];
                inside(&pieces)?;
                self.on_pieces(k, value, cloud, shape, &pieces, &along(*component), terms)
            }
            model::Load::Line { from, to, component, value } => {
                let (from, to): (Vector<D>, Vector<D>) = (vector(from), vector(to));
                let length = (0..D).map(|d| (to[d] - from[d]).powi(2)).sum::<f64>().sqrt();
                if length == 0.0 {
                    return Err(self.refuse(&path, "the line begins where it ends", "use `point`"));
                }
                let n = (2.0 * length / cloud.spacing).ceil().max(1.0);
                let at = |j: usize| std::array::from_fn(|d| from[d] + (to[d] - from[d]) * (j as f64 + 0.5) / n);
                let pieces: Vec<_> = (0..n as usize).map(|j| place(at(j), length / n)).collect();
                inside(&pieces)?;
                self.on_pieces(k, value, cloud, shape, &pieces, &along(*component), terms)
            }
            model::Load::Moment { axis, value } => {
                let Some(pieces) = self.pieces_of(k, cloud, shape, slots)? else {
                    let message = "a moment acts on a surface, and that of points from a file is not known";
                    return Err(self.refuse(&path, message, "use two forces"));
                };
                let Some(turn) = turning(&pieces, axis.map_or(2, |axis| axis as usize)) else {
                    let message = "no forces on this surface have a moment about this axis alone: it is a line";
                    return Err(self.refuse(&path, message, "choose another axis, or a larger surface"));
                };
                self.on_pieces(k, value, cloud, shape, &pieces, &turn, terms)
            }
            _ => Ok(()),
        }
    }

    /// Takes note of what `terms` of condition `k` do at the start, or at the end if that is nothing.
    pub(super) fn summarise(&self, k: usize, cloud: &Cloud<D>, area: Option<f64>, terms: &mut [Box<dyn Term>]) {
        let case = &self.case.value;
        let condition = &case.conditions[k];
        let end = case.solver.stages().map(|(_, solver)| solver.end_time()).fold(0.0, f64::max);
        let n = cloud.n_slots();
        let components = if case.physics.diffusion.is_some() { 1 } else { D };
        for time in [0.0, end] {
            let mut densities = vec![0.0; components * n];
            for term in terms.iter_mut() {
                term.measure(&|slots| Scale::ByPoint(slots.iter().map(|&slot| cloud.volume(slot as usize)).collect()));
                term.force(time, &mut densities, n);
            }
            let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
            for slot in cloud.stored(0..cloud.n_points()) {
                let x = embed(&cloud.position(slot));
                let f: [f64; 3] = std::array::from_fn(|d| {
                    if d < components { densities[d * n + slot] * cloud.volume(slot) } else { 0.0 }
                });
                for d in 0..3 {
                    let (e, g) = ((d + 1) % 3, (d + 2) % 3);
                    force[d] += f[d];
                    moment[d] += x[e] * f[g] - x[g] * f[e];
                }
            }
            if time == end || force.iter().chain(&moment).any(|x| *x != 0.0) {
                let on = condition.on.clone().unwrap_or_default();
                let kind = condition.load.as_ref().map_or("", model::Load::name);
                self.loads.borrow_mut().push(LoadSummary { condition: k, kind, on, area, time, force, moment });
                return;
            }
        }
    }
}

fn bounds<const D: usize>(places: impl Iterator<Item = Vector<D>>) -> (Vector<D>, Vector<D>) {
    places.fold(([f64::INFINITY; D], [f64::NEG_INFINITY; D]), |(low, high), x| {
        (std::array::from_fn(|d| low[d].min(x[d])), std::array::from_fn(|d| high[d].max(x[d])))
    })
}

impl<const D: usize> Loaded<D> {
    fn spread_over(self, cloud: &Cloud<D>) -> (Vec<u32>, crate::conditions::Spread) {
        let points = Points::around(cloud, bounds(self.pieces.iter().map(|piece| piece.place)));
        Arc::new(self).spread(&points.slots, &points.positions, &points.sides)
    }
}

/// Tractions ω × (x − c), c the centroid, whose moment about an axis is one and which have no other; None where pieces lie in a
/// line along the axis.
fn turning<const D: usize>(pieces: &[Piece<D>], axis: usize) -> Option<impl Fn(&Piece<D>) -> Vector<D> + 'static> {
    let area: f64 = pieces.iter().map(|piece| piece.area).sum();
    let centre: [f64; 3] =
        std::array::from_fn(|d| pieces.iter().map(|piece| piece.area * embed(&piece.place)[d]).sum::<f64>() / area);
    let arm = move |piece: &Piece<D>| -> [f64; 3] {
        let x = embed(&piece.place);
        std::array::from_fn(|d| x[d] - centre[d])
    };
    // J = Σ a (|r|² I − r ⊗ r), J ω = e; in 2D about z alone.
    let mut matrix = [[0.0; 3]; 3];
    for piece in pieces {
        let r = arm(piece);
        let square: f64 = r.iter().map(|r| r * r).sum();
        for c in 0..3 {
            for d in 0..3 {
                matrix[c][d] += piece.area * (if c == d { square } else { 0.0 } - r[c] * r[d]);
            }
        }
    }
    if D == 2 {
        matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, matrix[2][2]]];
    }
    let spin = solved(matrix, axis)?;
    Some(move |piece: &Piece<D>| {
        let r = arm(piece);
        std::array::from_fn(|d| {
            let (e, g) = ((d + 1) % 3, (d + 2) % 3);
            piece.area * (spin[e] * r[g] - spin[g] * r[e])
        })
    })
}

/// A column of the inverse, by Cramer's rule; None of a singular matrix.
fn solved(m: [[f64; 3]; 3], column: usize) -> Option<[f64; 3]> {
    let minor = |r: usize, c: usize| {
        let [r0, r1, c0, c1] = [(r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3];
        m[r0][c0] * m[r1][c1] - m[r0][c1] * m[r1][c0]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    let scale: f64 = (0..3).map(|d| m[d][d]).product();
    (determinant.abs() > 1e-9 * scale.abs()).then(|| std::array::from_fn(|d| minor(column, d) / determinant))
}
