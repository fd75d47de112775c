//! What outputs may see of a run: numbers about the body, and fields by name at one instant.

use std::sync::Arc;

use rayon::prelude::*;
use serde::Serialize;

use crate::field::{Field, Values, norm};
use crate::physics::elasticity::Work;
use crate::physics::elasticity::surface::SurfaceEffect;
use crate::physics::{Adapted, Balance, Column, ForceAndMoment, Resultant, StretchedBond};

/// A model that outputs look at. Asking for a field may compute it, hence the `&mut`.
pub trait Source {
    /// The points as they are now, shared with whoever looks at them later.
    fn points(&self) -> &Arc<Points>;
    /// Reference positions in point order, m; zeros beyond the dimension.
    fn positions(&self) -> &[[f64; 3]] {
        &self.points().positions
    }
    /// Facts that change with the points only.
    fn facts(&self) -> &BodySummary;
    /// A field by name, in point order; None if the model has no such field.
    fn field(&mut self, name: &str) -> Option<Field>;
    /// The same at one point only: a field of one value.
    fn field_at(&mut self, name: &str, point: usize) -> Option<Field>;
    fn balance(&mut self) -> Balance;
    /// By how much what is kept is off, and what that is measured against.
    fn defect(&mut self, balance: &Balance) -> [f64; 2];
    /// The books as columns of the history.
    fn columns(&mut self, balance: &Balance) -> Vec<Column>;
    fn broken_pairs(&self) -> u64;
    /// Name and value (N) of the reaction of each prescribed set.
    fn reactions(&self) -> Vec<(String, f64)>;
    /// What refinement has done; None where cells do not follow the solution.
    fn adapted(&self) -> Option<Adapted> {
        None
    }
    /// What the hybrid scheme has to do; None in the standard scheme.
    fn hybrid(&self) -> Option<Work> {
        None
    }
    /// A force on a part of the body; None where the physics has none.
    fn resultant(&mut self, _of: &Resultant) -> Option<ForceAndMoment> {
        None
    }
    /// The whole bond that is nearest to breaking; None where no bond is stretched, or none can break.
    fn most_stretched(&mut self) -> Option<StretchedBond> {
        None
    }
    fn hash(&mut self) -> String;
    /// Bonds of each point that hold now, in point order.
    fn family_sizes(&self) -> Vec<u32>;
    /// The state of every bond: bits, set while it holds, one at each of its ends. Their order follows from the points,
    /// the horizon and the rule of partial volumes alone, so that cases which share these have the same bond at the same
    /// bit, whatever their precision.
    fn bond_words(&self) -> &[u16];
    /// x and x′ (m) of the bond whose state is bit `bit % 16` of word `bit / 16`.
    fn bond_ends(&self, bit: usize) -> [[f64; 3]; 2];
}

pub use super::picture::Sizes;

/// The points of a body. They stay until refinement replaces them, so that snapshots share them instead of copying.
#[derive(Debug)]
pub struct Points {
    /// Reference positions in point order, m; zeros beyond the dimension.
    pub positions: Vec<[f64; 3]>,
    /// Side of the cell of each point, m; empty on a lattice, where it is the spacing.
    pub sizes: Vec<f64>,
    pub facts: BodySummary,
}

impl Points {
    /// Side of the cell of each point, m: one for all on a lattice.
    pub fn sizes(&self) -> Sizes<'_> {
        if self.sizes.is_empty() { Sizes::Same(self.facts.spacing) } else { Sizes::Each(&self.sizes) }
    }
}

/// What is known of a body before the first step.
#[derive(Debug, Clone, PartialEq)]
pub struct BodySummary {
    pub dimension: usize,
    pub points: usize,
    /// Directed bonds of the whole body, before pre-cracks.
    pub bonds: u64,
    /// Directed bonds that the pre-cracks cut.
    pub cut_bonds: u64,
    /// δ and Δx, m.
    pub horizon: f64,
    pub spacing: f64,
    /// Of all cells, m³ (m² in 2D, m in 1D), and of the shape that they fill; None of points from a file.
    pub volume: f64,
    pub shape_volume: Option<f64>,
    /// kg (per metre of thickness in 2D, per unit of cross-section in 1D); None where nothing has a mass.
    pub mass: Option<f64>,
    /// Largest stable step, s.
    pub stable_step: f64,
    pub physics: PhysicsSummary,
    /// Bytes that fields and bonds take.
    pub memory: u64,
}

/// What a load adds up to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoadSummary {
    /// Which of the conditions, from zero.
    pub condition: usize,
    /// What it is: `traction`.
    pub kind: &'static str,
    /// A set or a surface.
    pub on: String,
    /// Of the surface that it acts on, m² (2D: m); None where that is not known.
    pub area: Option<f64>,
    /// s: the start, or the end where it is nothing at the start.
    pub time: f64,
    /// N (2D: N/m); of what diffuses the first is the amount that enters in a second.
    pub force: [f64; 3],
    /// About the origin, N m.
    pub moment: [f64; 3],
}

/// What is known of its physics.
#[derive(Debug, Clone, PartialEq)]
pub enum PhysicsSummary {
    Elastic(ElasticSummary),
    Diffusive(DiffusiveSummary),
}

/// Of an elastic body.
#[derive(Debug, Clone, PartialEq)]
pub struct ElasticSummary {
    /// √(E/ρ), m/s
    pub bar_speed: f64,
    /// m/s; None in 1D.
    pub rayleigh_speed: Option<f64>,
    /// Where there are several.
    pub materials: Vec<MaterialSummary>,
    /// Micromodulus (of the first of several materials) and smallest critical stretch.
    pub micromodulus: f64,
    pub critical_stretch: Option<f64>,
    /// How incomplete families are at the start, corrected if asked.
    pub surface: SurfaceEffect,
}

/// Of a body in which something diffuses.
#[derive(Debug, Clone, PartialEq)]
pub struct DiffusiveSummary {
    /// K, m²/s; of several materials that of the first point.
    pub diffusivity: f64,
    /// That which long waves find, m²/s; None of scattered points.
    pub found_diffusivity: Option<f64>,
    /// κ, m^(q−D)/s, of the integral.
    pub micro_diffusivity: f64,
    /// q
    pub exponent: u32,
    /// Where there are several.
    pub materials: Vec<DiffusiveMaterial>,
}

/// What is known of a material in which something diffuses.
#[derive(Debug, Clone, PartialEq)]
pub struct DiffusiveMaterial {
    pub name: String,
    pub points: usize,
    /// m³; m² in 2D, m in 1D.
    pub volume: f64,
    /// K, m²/s; the largest where it varies.
    pub diffusivity: f64,
}

impl PhysicsSummary {
    /// None of other physics.
    pub fn elastic(&self) -> Option<&ElasticSummary> {
        match self {
            PhysicsSummary::Elastic(elastic) => Some(elastic),
            PhysicsSummary::Diffusive(_) => None,
        }
    }

    /// None of other physics.
    pub fn diffusive(&self) -> Option<&DiffusiveSummary> {
        match self {
            PhysicsSummary::Elastic(_) => None,
            PhysicsSummary::Diffusive(diffusive) => Some(diffusive),
        }
    }

    /// Fields of frames, where nothing else is asked for.
    pub fn fields_of_frames(&self) -> &'static [&'static str] {
        match self {
            PhysicsSummary::Elastic(_) => &["displacement", "damage"],
            PhysicsSummary::Diffusive(_) => &["concentration"],
        }
    }

    /// Fields of probes, where nothing else is asked for.
    pub fn fields_of_probes(&self) -> &'static [&'static str] {
        match self {
            PhysicsSummary::Elastic(_) => &["displacement", "velocity"],
            PhysicsSummary::Diffusive(_) => &["concentration"],
        }
    }
}

/// What is known of a material before the first step; where its values vary, the fastest waves and the smallest step and critical
/// stretch.
#[derive(Debug, Clone, Serialize, PartialEq)]
pub struct MaterialSummary {
    pub name: String,
    pub points: usize,
    /// m³; m² in 2D, m in 1D.
    pub volume: f64,
    /// √(E/ρ), m/s; then of longitudinal, shear and Rayleigh waves, the last two None in 1D.
    pub bar_speed: f64,
    pub longitudinal_speed: f64,
    pub shear_speed: Option<f64>,
    pub rayleigh_speed: Option<f64>,
    /// s
    pub stable_step: f64,
    /// None: bonds inside never break.
    pub critical_stretch: Option<f64>,
}

/// Where the material points are now: reference positions plus `factor` times the displacement, m.
pub fn deformed(source: &mut dyn Source, factor: f64) -> Vec<[f64; 3]> {
    let displacement = if factor == 0.0 { None } else { source.field("displacement") };
    moved(source.positions(), displacement.as_ref(), factor)
}

/// Positions plus `factor` times a displacement, m; the positions if there is none.
pub fn moved(positions: &[[f64; 3]], displacement: Option<&Field>, factor: f64) -> Vec<[f64; 3]> {
    match displacement {
        Some(Field { values: Values::Vector(u), .. }) if factor != 0.0 => {
            let moved = |(x, u): (&[f64; 3], &[f64; 3])| std::array::from_fn(|d| x[d] + factor * u[d]);
            positions.par_iter().zip(u).map(moved).collect()
        }
        _ => positions.to_vec(),
    }
}

/// One component of a field, or its magnitude when none is named.
pub fn scalar(field: Field, component: Option<usize>) -> Vec<f64> {
    match field.values {
        Values::Scalar(values) => values,
        values => component_of(&values, component),
    }
}

/// One component, or the magnitudes when none is named: |v| of vectors, √(a : a) of tensors.
pub fn component_of(values: &Values, component: Option<usize>) -> Vec<f64> {
    match (values, component) {
        (Values::Scalar(values), _) => values.clone(),
        (Values::Vector(values) | Values::Principal(values), Some(c)) => values.par_iter().map(|v| v[c]).collect(),
        (Values::Vector(values) | Values::Principal(values), None) => values.par_iter().map(norm).collect(),
        (Values::Tensor(values), Some(c)) => values.par_iter().map(|v| v[c]).collect(),
        // Those off the diagonal stand for two each.
        (Values::Tensor(values), None) => values
            .par_iter()
            .map(|[a, b, c, d, e, f]| norm(&[norm(&[*a, *b, *c]), 2f64.sqrt() * norm(&[*d, *e, *f])]))
            .collect(),
    }
}
