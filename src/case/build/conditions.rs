//! What acts on the sets of a case, and what breaks.

use std::sync::Arc;

use super::super::model::{self, Formula, Motion};
use super::Builder;
use crate::conditions::profile::VARIABLES;
use crate::conditions::{Constraint, FormulaAtPoints, Load, Prescribed, Quantity, Scale, Term};
use crate::error::{Error, Result};
use crate::expression::{Expression, nearest};
use crate::field::Vector;
use crate::geometry::{Cloud, Piece, Shape};
use crate::physics::failure::CriticalStretch;
use crate::physics::failure::critical_stretch::PairRule;

impl<const D: usize> Builder<'_, D> {
    pub(super) fn slots(&self, name: &str, cloud: &Cloud<D>, path: &str) -> Result<Arc<[u32]>> {
        cloud.sets.get(name).cloned().ok_or_else(|| {
            let names: Vec<&str> = cloud.sets.iter().map(|(n, _)| n).collect();
            let help = nearest(name, names.iter().copied()).map_or(String::new(), |n| format!("did you mean `{n}`?"));
            self.refuse(path, format!("no set has this name; sets: {}", names.join(", ")), &help)
        })
    }

    pub(super) fn expression(&self, formula: &Formula) -> Result<Expression> {
        match formula {
            Formula::Number(x) => Ok(Expression::constant(*x)),
            Formula::Text(text) => Expression::compile(text, &VARIABLES, &self.case.constants)
                .map_err(|e| Error::Refused(format!("{text}: {e}"))),
        }
    }

    /// The formula on the points of a set, refused if it has no finite value at one of them at t = 0.
    pub(super) fn profile(
        &self,
        formula: &Formula,
        cloud: &Cloud<D>,
        slots: &Arc<[u32]>,
        path: &str,
    ) -> Result<FormulaAtPoints> {
        let mut profile = FormulaAtPoints::new(self.expression(formula)?, cloud, slots);
        let values = profile.at(0.0);
        if values.iter().any(|v| !v.is_finite()) {
            // The first bad point in point order, which is not the order of slots.
            let bad = |slot: &u32| slots.binary_search(slot).ok().map(|k| values[k]).filter(|v| !v.is_finite());
            let first = cloud.slots.iter().enumerate().find_map(|(point, slot)| Some((point, *slot, bad(slot)?)));
            let (point, slot, value) = first.expect("a set holds slots of points");
            let position = rounded(&cloud.position(slot as usize));
            let message = format!("the formula is {value} at t = 0 at point {point}, position {position} m");
            let help = "keep it finite everywhere in the set, as in `sqrt(max(x, 0))` or `if(x > 0, 1/x, 0)`";
            return Err(self.refuse(path, message, help));
        }
        Ok(profile)
    }

    /// The end of `conditions[k]`, or of the run, s: its formulas need no value after it.
    pub(super) fn last_instant(&self, k: usize) -> f64 {
        let end = self.case.value.solver.stages().map(|(_, solver)| solver.end_time()).fold(0.0, f64::max);
        self.case.value.conditions[k].until.map_or(end, |until| until.min(end))
    }

    /// The motion of `conditions[k]`.
    pub(super) fn prescribed(
        &self,
        k: usize,
        motion: &Motion,
        cloud: &Cloud<D>,
        slots: Arc<[u32]>,
    ) -> Result<Box<dyn Constraint>> {
        let condition = &self.case.value.conditions[k];
        let path = format!("conditions[{k}].prescribe.{}.value", motion.name());
        let (quantity, component, value) = match motion {
            Motion::Displacement { component, value } => (Quantity::Value, *component, value),
            Motion::Velocity { component, value } => (Quantity::Velocity, *component, value),
            Motion::Concentration { value } => (Quantity::Value, 0, value),
        };
        let name = match motion {
            Motion::Concentration { .. } => condition.on.clone().unwrap_or_default(),
            _ => format!("{}_{}", condition.on.as_deref().unwrap_or_default(), ["x", "y", "z"][component]),
        };
        let profile = self.profile(value, cloud, &slots, &path)?.until(self.last_instant(k));
        let mut prescribed = Prescribed::new(name, slots, component, quantity, profile);
        prescribed.until = condition.until.unwrap_or(f64::INFINITY);
        Ok(Box::new(prescribed))
    }

    /// The load of `conditions[k]`; `slots` are those of the set that it is on, or of the points that carry its surface.
    pub(super) fn load(
        &self,
        k: usize,
        load: &model::Load,
        cloud: &Cloud<D>,
        shape: Option<&Shape<D>>,
        slots: &Arc<[u32]>,
        terms: &mut Vec<Box<dyn Term>>,
    ) -> Result<()> {
        let (before, mut area) = (terms.len(), None);
        match load {
            model::Load::BodyForce { component, value } => {
                self.in_volume(k, *component, value, Scale::Same(1.0), cloud, slots, terms)?;
            }
            model::Load::Source { value } => self.in_volume(k, 0, value, Scale::Same(1.0), cloud, slots, terms)?,
            model::Load::Point { .. } | model::Load::Line { .. } | model::Load::Moment { .. } => {
                self.apart_from_area(k, load, cloud, shape, slots, terms)?;
            }
            model::Load::Traction { component, value, .. } => {
                area = self.by_area(k, *component, value, cloud, shape, slots, terms)?;
            }
            model::Load::Flux { value, .. } => area = self.by_area(k, 0, value, cloud, shape, slots, terms)?,
            model::Load::Pressure { value, thickness } => match self.pieces_of(k, cloud, shape, slots)? {
                Some(pieces) => {
                    area = Some(pieces.iter().map(|piece| piece.area).sum());
                    let inward = |piece: &Piece<D>| piece.normal.map(|n| -n * piece.area);
                    self.on_pieces(k, value, cloud, shape, &pieces, &inward, terms)?;
                }
                None => {
                    let Some((thickness, shape)) = thickness.zip(shape) else { return Ok(()) };
                    let normals: Vec<Vector<D>> =
                        slots.iter().map(|&slot| shape.normal(&cloud.position(slot as usize))).collect();
                    for d in 0..D {
                        let scale = Scale::ByPoint(normals.iter().map(|n| -n[d] / thickness).collect());
                        self.in_volume(k, d, value, scale, cloud, slots, terms)?;
                    }
                }
            },
        }
        self.summarise(k, cloud, area, &mut terms[before..]);
        Ok(())
    }

    /// A density at the points of a set.
    #[allow(clippy::too_many_arguments)] // what, where, onto what
    fn in_volume(
        &self,
        k: usize,
        component: usize,
        value: &Formula,
        scale: Scale,
        cloud: &Cloud<D>,
        slots: &Arc<[u32]>,
        terms: &mut Vec<Box<dyn Term>>,
    ) -> Result<()> {
        let condition = &self.case.value.conditions[k];
        let name = condition.load.as_ref().map_or("", model::Load::name);
        let path = format!("conditions[{k}].load.{name}.value");
        let profile = self.profile(value, cloud, slots, &path)?.until(self.last_instant(k));
        let mut load = Load::new(slots.clone(), component, profile);
        (load.scale, load.until) = (scale, condition.until.unwrap_or(f64::INFINITY));
        terms.push(Box::new(load));
        Ok(())
    }

    /// What acts by area along a component, or enters by area; gives the area if it is known.
    #[allow(clippy::too_many_arguments)] // what, where, onto what
    fn by_area(
        &self,
        k: usize,
        component: usize,
        value: &Formula,
        cloud: &Cloud<D>,
        shape: Option<&Shape<D>>,
        slots: &Arc<[u32]>,
        terms: &mut Vec<Box<dyn Term>>,
    ) -> Result<Option<f64>> {
        if let Some(pieces) = self.pieces_of(k, cloud, shape, slots)? {
            let along = |piece: &Piece<D>| std::array::from_fn(|d| if d == component { piece.area } else { 0.0 });
            self.on_pieces(k, value, cloud, shape, &pieces, &along, terms)?;
            return Ok(Some(pieces.iter().map(|piece| piece.area).sum()));
        }
        let (thickness, area) = self.case.value.conditions[k].load.as_ref().map_or((None, None), model::Load::layer);
        let scale = match area {
            Some(area) => Scale::Same(area / slots.iter().map(|&slot| cloud.volume(slot as usize)).sum::<f64>()),
            // Without a thickness, one row of cells, each as thick as it is itself.
            None => layer(thickness, cloud, slots),
        };
        self.in_volume(k, component, value, scale, cloud, slots, terms)?;
        Ok(area)
    }

    /// `critical`: the critical stretch of a fracture energy, J/m².
    pub(super) fn failure(&self, cloud: &Cloud<D>, critical: &dyn Fn(f64) -> f64) -> Result<Option<CriticalStretch>> {
        let Some(model::Failure::CriticalStretch(failure)) = &self.case.value.physics.elastic().failure else {
            return Ok(None);
        };
        let stretch = |energy: Option<f64>, stretch: Option<f64>| match energy {
            Some(energy) => critical(energy),
            None => stretch.unwrap_or(f64::INFINITY),
        };
        let rules: Vec<PairRule> = failure
            .pairs
            .iter()
            .map(|pair| PairRule {
                between: (pair.between[0].clone(), pair.between[1].clone()),
                stretch: stretch(pair.fracture_energy, pair.stretch),
            })
            .collect();
        let path = "physics.elasticity.failure.critical_stretch";
        let library = self.case.value.physics.elastic().law.parameters().material;
        let library = library.and_then(|material| material.values().fracture_energy);
        let energy = failure.fracture_energy.or(library.filter(|_| failure.stretch.is_none()));
        CriticalStretch::new(cloud, stretch(energy, failure.stretch), &rules, &failure.no_fail)
            .map(Some)
            .map_err(|e| self.refuse(path, format!("failure rules: {e}"), ""))
    }
}

/// What makes a load per area one per volume: 1/thickness, or if none is given one over the side of each point's cell, 1/m.
fn layer<const D: usize>(thickness: Option<f64>, cloud: &Cloud<D>, slots: &[u32]) -> Scale {
    match thickness {
        Some(thickness) => Scale::Same(1.0 / thickness),
        None if cloud.is_uniform() => Scale::Same(1.0 / cloud.spacing),
        None => Scale::ByPoint(slots.iter().map(|&slot| 1.0 / cloud.size(slot as usize)).collect()),
    }
}

/// A position as `(-0.0095, 0.0045)`, without the digits that rounding left behind.
pub(super) fn rounded(x: &[f64]) -> String {
    let parts: Vec<String> =
        x.iter().map(|x| format!("{x:.6e}").parse::<f64>().map_or(String::new(), |x| x.to_string())).collect();
    format!("({})", parts.join(", "))
}
