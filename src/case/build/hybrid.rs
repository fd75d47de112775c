//! Which points of a case have rows, and the row.

use super::super::model;
use super::Builder;
use crate::discretization::collocation::stability::{Law, bearable_in_motion};
use crate::discretization::collocation::{SharedRow, SharedSlope};
use crate::discretization::moments::ball_moment;
use crate::discretization::{BondWeighting, Collocation, Operator, Regions};
use crate::error::{Error, Result};
use crate::execution::{Limits, Packs};
use crate::family::{Body, Families};
use crate::geometry::Arrangement;
use crate::physics::elasticity::hybrid::Dilatation;
use crate::physics::elasticity::linear_solid::Moduli;
use crate::physics::elasticity::{Elasticity, Hybrid};
use crate::physics::failure::CriticalStretch;

const PATH: &str = "discretization.scheme.hybrid";

impl<const D: usize> Builder<'_, D> {
    /// Puts rows over the material of a body. `unit`: δ/√(E/ρ), s.
    pub(super) fn hybridise<P: Packs>(
        &self,
        settings: &model::Hybrid,
        elasticity: Elasticity<D, P>,
        solid: Option<Moduli>,
        scaling: &BondWeighting,
        unit: f64,
    ) -> Result<Elasticity<D, P>> {
        let (body, failure) = (&elasticity.body, &elasticity.failure);
        let Arrangement::Lattice(lattice) = &body.cloud.arrangement else {
            return Err(self.refuse(PATH, "the hybrid scheme is for lattices", ""));
        };
        let points = settings.points.unwrap_or_else(|| Collocation::fewest::<D>(settings.order));
        let collocation = Collocation { order: settings.order, points, exponent: settings.exponent };
        let refuse = |error: Error| self.refuse(PATH, error.to_string(), "");
        let (influence, micromodulus) = (scaling.influence, scaling.strength);
        let kernel = match solid {
            None => Law::Elastic { influence, micromodulus },
            Some(solid) => {
                let volumetric = solid.volumetric / (D * D) as f64;
                Law::StateBased { influence, micromodulus, volumetric }
            }
        };
        let varied = elasticity.operator.weights.heterogeneity.as_deref();
        let softest = elasticity.density.least_per_constant(varied, &body.cloud.slots);
        // Noise may grow tenfold in the run.
        let end_time = self.case.value.solver.stages().map(|(_, solver)| solver.end_time()).fold(0.0, f64::max);
        let bearable = bearable_in_motion(end_time, softest);
        let (fit, symbol) = collocation
            .marched::<D>(lattice.spacing, scaling.horizon, &kernel, bearable)
            .map_err(|error| self.refuse(PATH, error.to_string(), "leave out `order`, `points` and `exponent`"))?;
        let weights = fit.elastic(&scaling.influence, scaling.strength);
        let mut row = SharedRow::new(lattice, &fit, &weights).map_err(refuse)?;
        let standard = self.standard_from_the_start(settings, body)?;
        // Rows are of one constant: where materials meet, bonds are summed.
        row.heterogeneity.clone_from(&elasticity.operator.weights.heterogeneity);
        let mixed = row.heterogeneity.as_ref().map(|varied| varied.mixed(body, &elasticity.state.states));
        let standard = standard.chain(mixed.unwrap_or_default());
        let regions = Regions::new(body, &elasticity.state.states, standard, settings.buffer);
        if regions.collocated_points() == 0 {
            let message = "every point is near a boundary, a pre-crack or a named set: all sum their bonds";
            log::warn!("{}", self.source().warning(PATH, message));
        }
        let smallest = failure.as_ref().map_or(f64::INFINITY, CriticalStretch::smallest);
        let at = if settings.adaptive { settings.switch_at * smallest } else { smallest };
        let linear = elasticity.material.is_linear();
        let limits = Limits {
            // The measure of both laws: ½ (|y|²/|ξ|² − 1), or s.
            strain: if linear { at } else { at + 0.5 * at * at },
            linear,
            gradient: if linear { f64::INFINITY } else { settings.largest_gradient },
        };
        // A point whose family is whole; without one there are no rows.
        let inside = body.cloud.slots.iter().copied().find(|&slot| regions.has_row(slot as usize));
        let scales = inside.and_then(|slot| elasticity.material.dilatation_scales(slot as usize));
        let mut dilatation = None;
        if let (Some(solid), Some([stiffness, bulk])) = (solid, scales) {
            let moment = solid.deviatoric / stiffness;
            let per = moment / D as f64;
            let slope = SharedSlope::new(lattice, &fit, &fit.dilatation(&influence)).map_err(refuse)?;
            let scales = [solid.volumetric / (moment * D as f64), per];
            dilatation = Some(Dilatation { slope, scales, bulk });
        }
        Ok(elasticity.hybridised(|inner| {
            let mut hybrid = Hybrid::new(inner, regions, row, symbol.radius, limits);
            (hybrid.dilatation, hybrid.damping) = (dilatation, settings.damping * unit);
            (hybrid.damps_bonds, hybrid.adaptive) = (settings.damp_bonds, settings.adaptive);
            hybrid
        }))
    }

    /// Slots of the sets that are named, of no-fail sets, and of what is prescribed or loaded on its surface.
    fn standard_from_the_start(&self, settings: &model::Hybrid, body: &Body<D>) -> Result<impl Iterator<Item = u32>> {
        let case = &self.case.value;
        let mut names: Vec<(&String, String)> = Vec::new();
        for (k, name) in settings.standard.iter().enumerate() {
            names.push((name, format!("{PATH}.standard[{k}]")));
        }
        if let Some(model::Failure::CriticalStretch(failure)) = &case.physics.elastic().failure {
            for (k, name) in failure.no_fail.iter().enumerate() {
                names.push((name, format!("physics.elasticity.failure.critical_stretch.no_fail[{k}]")));
            }
        }
        for (k, condition) in case.conditions.iter().enumerate() {
            // A body force may act on all of the body.
            let surface = matches!(condition.load, Some(model::Load::Traction { .. } | model::Load::Pressure { .. }));
            if let (true, Some(on)) = (surface || condition.prescribe.is_some(), &condition.on) {
                names.push((on, format!("conditions[{k}].on")));
            }
        }
        let mut sets = Vec::new();
        for (name, path) in names {
            sets.push(self.slots(name, &body.cloud, &path)?);
        }
        Ok(sets.into_iter().flat_map(|slots| slots.to_vec()))
    }
}

/// Scales the weights of a lattice so that Σ w |ξ| is the integral ∫ c ω |ξ| dV, to which the energy of expansion and the mean
/// stiffness over all directions are proportional.
pub(super) fn rescale<const D: usize>(body: &Body<D>, operator: &mut Operator, scaling: &BondWeighting) {
    let Families::Lattice(families) = &body.families else { return };
    let weights = &mut operator.weights.by_offset;
    let sum: f64 = families.offsets.iter().zip(&*weights).map(|(offset, weight)| weight * offset.length).sum();
    let integral = scaling.strength * ball_moment(&scaling.influence, [0; D], -1.0, scaling.horizon);
    weights.iter_mut().for_each(|weight| *weight *= integral / sum);
}
