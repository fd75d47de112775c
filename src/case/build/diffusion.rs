//! A case of diffusion: its body, the scheme, what enters, what is prescribed.

use std::sync::Arc;

use super::super::model::{self, Motion, Scheme};
use super::Builder;
use super::conditions::rounded;
use crate::conditions::{Constraint, Term, initial};
use crate::discretization::collocation::stability::bearable_in_diffusion;
use crate::discretization::volume::RIM_TOLERANCE;
use crate::discretization::{Collocation, Heterogeneity, Influence, PartialVolume, standard};
use crate::error::{Error, Result};
use crate::execution::Exec;
use crate::family::{Body, BondStates, Families};
use crate::geometry::{Arrangement, Cloud, Shape};
use crate::output::source::{BodySummary, DiffusiveSummary, PhysicsSummary};
use crate::physics::diffusion::{Diffusing, Flux};
use crate::physics::{Diffusion, Physics};
use crate::problem::Problem;
use crate::simulation::{Model, Simulation};

const SCHEME: &str = "discretization.scheme";

/// Steps of power iteration that look for waves which grow, where points have rows of their own.
const LOOKS: u32 = 300;

impl<const D: usize> Builder<'_, D> {
    /// The simulation of a case in which something diffuses.
    pub(super) fn diffusing(&self, parameters: &model::Diffusion) -> Result<Simulation> {
        let case = &self.case.value;
        let shape = self.shape()?;
        let cracks = self.cracks()?;
        let influence = Influence::from(case.discretization.influence);
        let rule = match case.discretization.scheme {
            // A row is the integral over the whole ball: no cell is cut.
            Scheme::Collocation(_) => PartialVolume::None,
            _ => PartialVolume::from(case.discretization.partial_volumes),
        };
        let mut cloud = self.cloud(shape.as_ref(), rule)?;
        let horizon = self.horizon(&cloud)?;
        let tolerance = 1e-9 * cloud.spacing;
        cloud = self.with_images(cloud, shape.as_ref(), rule, horizon)?;
        self.sets(&mut cloud, shape.as_ref())?;
        let several = self.diffusivities(&mut cloud)?;
        // What the weights are made for; where materials differ, that of the first point.
        let first = several.as_ref().map(|(values, _)| values[cloud.slots[0] as usize]);
        let diffusivity = first.or(parameters.diffusivity).expect("the rules across keys ask for it");
        let flux = Flux::new::<D>(influence, parameters.exponent, diffusivity, horizon)
            .map_err(|error| self.refuse("physics.diffusion.exponent", error.to_string(), ""))?;
        let (body, diffusion) = match &case.discretization.scheme {
            Scheme::Collocation(settings) => self.rows(settings, cloud, shape.as_ref(), horizon, &flux)?,
            _ => {
                let body = standard::body(cloud, horizon, rule);
                let mut diffusion = Diffusion::standard(&body, &flux, rule);
                if parameters.calibrated {
                    diffusion = diffusion.calibrated(&body, diffusivity);
                }
                if let Some((values, _)) = &several {
                    let relative: Vec<f64> = values.iter().map(|k| k / diffusivity).collect();
                    diffusion.vary(Heterogeneity::new(&body, &relative, None));
                }
                (body, diffusion)
            }
        };
        let mut diffusing = Diffusing::new(body, diffusion);
        self.neighbours(&diffusing.body)?;
        let cut = diffusing.cut(&cracks, tolerance);
        self.remark_size(&diffusing.body);
        self.remark_cracks(&diffusing.body, &cracks, cut, tolerance);
        self.remark_parts(&diffusing.body, diffusing.states());
        let (constraints, terms) = self.what_acts(&mut diffusing, shape.as_ref())?;
        let facts = BodySummary {
            dimension: D,
            points: 0,
            bonds: 0,
            cut_bonds: 0,
            horizon,
            spacing: 0.0,
            volume: 0.0,
            shape_volume: shape.as_ref().map(Shape::volume),
            mass: None,
            stable_step: diffusing.stable_step(),
            physics: PhysicsSummary::Diffusive(DiffusiveSummary {
                diffusivity,
                found_diffusivity: diffusing.diffusion.diffusivity(&diffusing.body),
                micro_diffusivity: flux.micro_diffusivity,
                exponent: parameters.exponent,
                materials: several.map_or(Vec::new(), |(_, list)| list),
            }),
            memory: 0,
        };
        self.finish(Box::new(Model::new(Problem::new(Box::new(diffusing), constraints, terms), facts)))
    }

    /// Applies initial values; what prescribes values, and what enters.
    #[allow(clippy::type_complexity)] // two lists
    fn what_acts(
        &self,
        diffusing: &mut Diffusing<D>,
        shape: Option<&Shape<D>>,
    ) -> Result<(Vec<Box<dyn Constraint>>, Vec<Box<dyn Term>>)> {
        let (mut constraints, mut terms) = (Vec::new(), self.mirror_amount(&diffusing.body.cloud));
        let owned = self.owned(&diffusing.body.cloud)?;
        for (k, condition) in self.case.value.conditions.iter().enumerate() {
            let Diffusing { body, concentration, .. } = &mut *diffusing;
            let Some(on) = &condition.on else { continue };
            let slots = match owned.get(&k) {
                Some(owned) => owned.clone(),
                None => self.slots(on, &body.cloud, &format!("conditions[{k}].on"))?,
            };
            if let Some(Motion::Concentration { value }) = &condition.initial {
                let path = format!("conditions[{k}].initial.concentration.value");
                let mut profile = self.profile(value, &body.cloud, &slots, &path)?;
                initial::apply(concentration, &slots, &mut profile);
            }
            if let Some(motion) = &condition.prescribe {
                constraints.push(self.prescribed(k, motion, &body.cloud, slots.clone())?);
            }
            if let Some(load) = &condition.load {
                self.load(k, load, &body.cloud, shape, &slots, &mut terms)?;
            }
        }
        Ok((constraints, terms))
    }

    /// Rows of collocation: one that all points of a lattice share, or one for each free point of a cloud.
    fn rows(
        &self,
        settings: &model::Collocation,
        cloud: Cloud<D>,
        shape: Option<&Shape<D>>,
        horizon: f64,
        flux: &Flux,
    ) -> Result<(Body<D>, Diffusion)> {
        let points = settings.points.unwrap_or_else(|| Collocation::fewest::<D>(settings.order));
        let collocation = Collocation { order: settings.order, points, exponent: settings.exponent };
        let end_time = self.case.value.solver.stages().map(|(_, solver)| solver.end_time()).fold(0.0, f64::max);
        // Noise may grow tenfold in the run.
        let bearable = bearable_in_diffusion(end_time);
        let path = format!("{SCHEME}.collocation");
        let refuse = |error: Error| {
            self.refuse(&path, error.to_string(), "leave out `order`, `points` and `exponent`, or take `standard`")
        };
        let free = self.free_points(&cloud)?;
        if let Arrangement::Lattice(_) = cloud.arrangement {
            let body = Body::new(cloud, horizon, 0.0..horizon * (1.0 + RIM_TOLERANCE), |_| true);
            let Families::Lattice(families) = &body.families else { unreachable!("a lattice has families of one") };
            let whole = families.offsets.len() as u32;
            let sizes = BondStates::whole(&body).per_point(&body);
            let found = sizes.iter().zip(&body.cloud.slots).filter(|(size, _)| **size < whole);
            self.balls_are_whole(&body.cloud, &free, found.map(|(_, slot)| *slot))?;
            return Diffusion::collocated(body.cloud, horizon, flux, &collocation, bearable).map_err(refuse);
        }
        // Of imported points nobody knows where the surface is.
        if let Some(shape) = shape {
            let cut = |slot: &&u32| -shape.signed_distance(&cloud.position(**slot as usize)) < horizon * (1.0 - 1e-9);
            let found: Vec<u32> = cloud.slots.iter().filter(cut).copied().collect();
            self.balls_are_whole(&cloud, &free, found.into_iter())?;
        }
        let body = standard::body(cloud, horizon, PartialVolume::None);
        let diffusion = Diffusion::around(&body, flux, &collocation, &free).map_err(refuse)?;
        let growth = diffusion.growth(&body, &mut Exec::default(), &free, LOOKS);
        if growth > bearable {
            let message = format!(
                "rows of these points would grow in time: an eigenvalue of +{growth:.3e} 1/s, where a run to t = {end_time} \
                 s bears {bearable:.3e} 1/s"
            );
            return Err(refuse(Error::Refused(message)));
        }
        Ok((body, diffusion))
    }

    /// Slots of the points at which nothing is prescribed for ever, ascending.
    fn free_points(&self, cloud: &Cloud<D>) -> Result<Vec<u32>> {
        let mut held: Vec<Arc<[u32]>> = Vec::new();
        for (k, condition) in self.case.value.conditions.iter().enumerate() {
            if let Some(on) =
                condition.on.as_ref().filter(|_| condition.prescribe.is_some() && condition.until.is_none())
            {
                held.push(self.slots(on, cloud, &format!("conditions[{k}].on"))?);
            }
        }
        Ok(cloud
            .select(|_| true)
            .into_iter()
            .filter(|slot| held.iter().all(|set| set.binary_search(slot).is_err()))
            .collect())
    }

    /// Refuses a row where the ball of the horizon is cut: its closed form is the integral over all of it.
    fn balls_are_whole(&self, cloud: &Cloud<D>, free: &[u32], cut: impl Iterator<Item = u32>) -> Result<()> {
        let mut found = cut.filter(|slot| free.binary_search(slot).is_ok());
        let Some(first) = found.next() else { return Ok(()) };
        let message = format!(
            "rows of collocation need the whole ball of the horizon, and {} points near a boundary, the first at {} m, have \
             it not",
            1 + found.count(),
            rounded(&cloud.position(first as usize))
        );
        let help = "prescribe a concentration there without `until`, in a layer of one horizon, or take `scheme = \"standard\"`";
        Err(self.refuse(SCHEME, message, help))
    }
}
