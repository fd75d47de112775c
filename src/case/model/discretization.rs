//! Tables of the discretisation and of refinement.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::discretization::influence::each_influence;
use crate::discretization::{Influence, PartialVolume};

use super::{Collocation, Formula, Region};

/// How the integral over the family becomes a sum.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Discretization {
    /// m = δ/Δx. Either this or `horizon`.
    #[schemars(range(min = 1, max = 100))]
    pub horizon_ratio: Option<f64>,
    /// δ. Either this or `horizon_ratio`.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
    pub horizon: Option<f64>,
    /// ω: how much a bond counts, by its length.
    #[serde(default)]
    pub influence: InfluenceFunction,
    /// How much of a neighbour's cell counts where the horizon cuts it.
    #[serde(default)]
    pub partial_volumes: PartialVolumes,
    /// What is done about points near surfaces, which lack bonds. A lattice that is corrected is computed as a scattered
    /// cloud, at two to five times the time and 14 bytes a bond.
    #[serde(default)]
    pub surface_correction: SurfaceCorrection,
    #[serde(default)]
    pub scheme: Scheme,
    /// What fields are stored in and bonds are computed in.
    #[serde(default)]
    pub precision: Precision,
}

/// Cells that are split in halves, level by level; the horizon goes with the cell, the micromodulus and the critical
/// stretch with the horizon.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Refinement {
    /// The finest level; 0 is the lattice of `geometry.spacing`.
    #[schemars(range(min = 1, max = 8))]
    pub levels: u8,
    /// Where which level is wanted from the start to the end.
    #[serde(default)]
    pub zones: Vec<Zone>,
    /// Where the finest level is wanted: a formula in x, y, z, t and in `energy` (density, over the largest in the body),
    /// `jump` (largest difference of the displacement gradient to a neighbour), `stretch` (largest of a bond over the
    /// critical one), `damage`.
    #[schemars(extend("x-expression" = ["x", "y", "z", "t", "energy", "jump", "stretch", "damage"]))]
    pub refine_where: Option<Formula>,
    /// Where cells are not merged again, in the same names; `damage > 0` if not given.
    #[schemars(extend("x-expression" = ["x", "y", "z", "t", "energy", "jump", "stretch", "damage"]))]
    pub keep_where: Option<Formula>,
    /// Steps between two looks at `refine_where`.
    #[serde(default = "ten_steps")]
    #[schemars(range(min = 1))]
    pub every_steps: u64,
    /// No coarser point is within this many horizons of its own of a place where finer cells are wanted.
    #[serde(default = "six")]
    #[schemars(range(min = 0, max = 100))]
    pub buffer: f64,
    #[serde(default)]
    pub transition: GridTransition,
    #[serde(default)]
    pub rule: HorizonRule,
}

/// A region and the level wanted in it.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Zone {
    pub region: Region,
    #[schemars(range(min = 1, max = 8))]
    pub level: u8,
}

/// How cells and horizons change between zones.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GridTransition {
    /// At once, however many levels.
    Sudden,
    /// Cells that touch differ by one level at most.
    #[default]
    Stepwise,
    /// As stepwise, and the horizon falls off within the fine cells by `slope` times the way, instead of jumping.
    Smooth {
        #[schemars(range(min = 0.05, max = 10))]
        slope: f64,
    },
}

/// Whose horizon and micromodulus a bond has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HorizonRule {
    /// Those of the point whose force is summed; momentum is not kept where horizons differ.
    Source,
    /// The mean of both ends' micromoduli.
    Average,
    /// Dual horizons: half the force of either end's family, and its reaction.
    #[default]
    Dual,
}

fn ten_steps() -> u64 {
    10
}

fn six() -> f64 {
    6.0
}

macro_rules! define {
    ($(
        $(#[doc = $about:literal])* $name:ident $key:literal
        { $($parameter:ident: $default:expr, $least:literal, $most:literal)? },
    )*) => {
        /// Influence functions, t = |ξ|/δ.
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "snake_case", deny_unknown_fields)]
        pub enum InfluenceFunction {
            $($(#[doc = $about])* #[serde(rename = $key)] $name $({
                #[schemars(range(min = $least, max = $most))]
                $parameter: f64,
            })?,)*
        }

        impl From<InfluenceFunction> for Influence {
            fn from(function: InfluenceFunction) -> Self {
                match function {
                    $(InfluenceFunction::$name $({ $parameter })? => Influence::$name $({ $parameter })?,)*
                }
            }
        }
    };
}
each_influence!(define);

#[allow(clippy::derivable_impls)] // the list would have to mark one
impl Default for InfluenceFunction {
    fn default() -> Self {
        InfluenceFunction::Constant
    }
}

/// Rules for cells that the horizon cuts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PartialVolumes {
    /// Whole cells whose centre lies within δ (1 + 1e-9).
    None,
    /// A linear ramp from δ − Δx/2 to δ + Δx/2.
    #[default]
    Ramp,
    /// The exact part of the cell inside the horizon.
    Exact,
}

impl From<PartialVolumes> for PartialVolume {
    fn from(rule: PartialVolumes) -> Self {
        match rule {
            PartialVolumes::None => PartialVolume::None,
            PartialVolumes::Ramp => PartialVolume::Ramp,
            PartialVolumes::Exact => PartialVolume::Exact,
        }
    }
}

/// Surface corrections: factors of bonds that have an end near a surface.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SurfaceCorrection {
    /// None: points near surfaces are too soft.
    #[default]
    None,
    /// By the volume of a complete family over the mean of both ends'.
    Volume,
    /// By the energy of a complete family over that of both ends, for each direction.
    Energy,
}

/// Precisions of fields and bonds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// 64 bits for both.
    #[default]
    Double,
    /// 32 bits for both: half the memory.
    Single,
    /// Fields of 64 bits; displacements are subtracted in 64 bits, the rest of a bond is 32 bits.
    Mixed,
}

/// Schemes of discretisation.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Scheme {
    /// One-point quadrature over bonds.
    #[default]
    Standard,
    /// Elasticity: collocation where matter is whole, the standard scheme where it breaks and near boundaries. Lattices only.
    Hybrid(Hybrid),
    /// Diffusion: collocation everywhere. Values are prescribed wherever the ball of the horizon is not whole.
    Collocation(Collocation),
}

/// Parameters of the hybrid scheme.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hybrid {
    /// Largest degree of the polynomials of collocation, even.
    #[serde(default = "two")]
    #[schemars(range(min = 2, max = 12))]
    pub order: u32,
    /// Collocation points to aim at, the source among them; the fewest that the order can do with if not given.
    #[schemars(range(min = 3, max = 1000))]
    pub points: Option<usize>,
    /// α of the weight exp(−α |ξ|²/δ²) of collocation points.
    #[serde(default = "sixteen")]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 64))]
    pub exponent: f64,
    /// Sets whose points are of the standard scheme from the start, beside all that are near boundaries, pre-cracks, no-fail
    /// sets, prescribed and loaded layers.
    #[serde(default)]
    pub standard: Vec<String>,
    /// Horizons between a boundary, a pre-crack or such a set and the nearest point with a row. With 1 some per cent of the
    /// energy are lost or gained at boundaries.
    #[serde(default = "two")]
    #[schemars(range(min = 1, max = 10))]
    pub buffer: u32,
    /// Whether points go over to the standard scheme when they are strained; if not, bonds break in it only.
    #[serde(default = "yes")]
    pub adaptive: bool,
    /// Points go over when they are stretched by this share of the critical stretch.
    #[serde(default = "most")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub switch_at: f64,
    /// Points go over when the displacement gradient, that is strains and rotations, is larger: rows are linear. Not asked of
    /// linear laws.
    #[serde(default = "small_gradient")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub largest_gradient: f64,
    /// τ of the damping in proportion to stiffness, forces of u + τ v, in multiples of δ/√(E/ρ). Motion grows with less than
    /// about 0.03.
    #[serde(default = "little_damping")]
    #[schemars(range(min = 0, max = 1))]
    pub damping: f64,
    /// Whether bonds are damped too; if not, rows alone are, and motion grows slowly.
    #[serde(default = "yes")]
    pub damp_bonds: bool,
    /// Whether the micromodulus of the standard scheme is scaled so that its sum has the modulus of the integral.
    #[serde(default)]
    pub rescale: bool,
}

fn two() -> u32 {
    2
}

fn sixteen() -> f64 {
    16.0
}

fn yes() -> bool {
    true
}

fn most() -> f64 {
    0.7
}

fn small_gradient() -> f64 {
    0.02
}

fn little_damping() -> f64 {
    0.05
}
