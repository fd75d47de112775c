//! What a user may write: nested data, one struct a table. Units are SI; see each key for its own.
//!
//! The JSON schema that editors use, the checks of the reader and the documentation of the keys are all made from
//! these types, so that a key stands in one place. `x-unit` names the unit of a number, `x-expression` the variables
//! that a formula may use.

use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

/// A case: one body, its physics, what acts on it, how time advances, what is written.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-smallest" = include_str!("smallest.toml")))]
pub struct Case {
    pub case: Header,
    pub geometry: Geometry,
    /// Named sets of points, by which conditions, failure rules and outputs reach them.
    #[serde(default)]
    pub sets: BTreeMap<String, Region>,
    pub discretization: Discretization,
    /// Cells of several sizes, from the start or as the solution wants them.
    pub refinement: Option<Refinement>,
    pub physics: Physics,
    /// What acts on the body.
    #[serde(default)]
    pub conditions: Vec<Condition>,
    pub solver: Chain,
    /// What is written into the output folder; a history and a report are always written.
    #[serde(default)]
    pub output: Vec<Output>,
}

/// What the case is about.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Stands over pictures and reports.
    pub title: String,
    /// Dimension of space.
    #[schemars(range(min = 1, max = 3))]
    pub dimension: usize,
}

/// Where matter is.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Geometry {
    /// The body's shape, filled with cubic cells of side `spacing`. Either this or `points`.
    pub shape: Option<Shape>,
    /// Grid spacing Δx. Required with `shape`.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
    pub spacing: Option<f64>,
    /// Moves each point of the lattice at random, which makes it a scattered cloud.
    pub perturb: Option<Perturb>,
    /// Points from a file. Either this or `shape`.
    pub points: Option<Points>,
    /// Pre-cracks: every bond that crosses one is broken at the start.
    #[serde(default)]
    pub cracks: Vec<Crack>,
}

/// A random shift of lattice points.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Perturb {
    /// Largest shift along each axis, as a fraction of the spacing.
    #[schemars(range(min = 0, max = 0.5))]
    pub amplitude: f64,
    /// The same seed gives the same points.
    #[serde(default)]
    pub seed: u64,
    /// Numbers the points in random order, as points from elsewhere may be.
    #[serde(default)]
    pub shuffle: bool,
}

/// Points from a file.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Points {
    /// A table with columns `x`, `y`, `z` (as many as the dimension), `volume` and optionally `sets` (names joined by
    /// `+`), in SI units.
    Csv {
        /// Path, relative to the case file.
        file: String,
    },
}

/// A body of matter.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// 1D, between two coordinates.
    Segment {
        #[schemars(extend("x-unit" = "m"))]
        low: f64,
        #[schemars(extend("x-unit" = "m"))]
        high: f64,
    },
    /// 2D, by its size, centred on `center` (the origin if not given).
    Rectangle {
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        size: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        center: Option<Vec<f64>>,
    },
    /// 3D, by its size, centred on `center` (the origin if not given).
    Block {
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        size: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        center: Option<Vec<f64>>,
    },
    /// Any dimension, by two opposite corners.
    Box {
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        low: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        high: Vec<f64>,
    },
    /// 2D.
    Disk {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        radius: f64,
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        center: Option<Vec<f64>>,
    },
    /// 3D.
    Sphere {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        radius: f64,
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        center: Option<Vec<f64>>,
    },
    /// 2D, between two circles.
    Ring {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        inner: f64,
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        outer: f64,
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        center: Option<Vec<f64>>,
    },
    /// 3D, solid, along an axis.
    Cylinder {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        radius: f64,
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        length: f64,
        #[serde(default)]
        axis: Axis,
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        center: Option<Vec<f64>>,
    },
    /// 3D, hollow, along an axis.
    Tube {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        inner: f64,
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        outer: f64,
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        length: f64,
        #[serde(default)]
        axis: Axis,
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        center: Option<Vec<f64>>,
    },
    /// 2D, simple, by its corners in either sense.
    Polygon {
        #[schemars(extend("x-unit" = "m"), length(min = 3))]
        vertices: Vec<Vec<f64>>,
    },
    /// 3D, a polygon in x and y between two heights.
    Extrusion {
        #[schemars(extend("x-unit" = "m"), length(min = 3))]
        vertices: Vec<Vec<f64>>,
        #[schemars(extend("x-unit" = "m"))]
        low: f64,
        #[schemars(extend("x-unit" = "m"))]
        high: f64,
    },
    /// All of these together.
    Union(#[schemars(length(min = 1))] Vec<Shape>),
    /// What all of these share.
    Intersection(#[schemars(length(min = 1))] Vec<Shape>),
    /// The first without the others.
    Difference {
        of: std::boxed::Box<Shape>,
        #[schemars(length(min = 1))]
        minus: Vec<Shape>,
    },
}

/// An axis of the coordinate system.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    X,
    Y,
    #[default]
    Z,
}

/// Which points belong to a set.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// Points between two corners, both included.
    Box {
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        low: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        high: Vec<f64>,
    },
    /// Points in a shape.
    Inside(Shape),
    /// Points where a formula of the reference position is true (not zero), such as `"y > 0.02 - h"`.
    Where(#[schemars(extend("x-expression" = ["x", "y", "z"]))] Formula),
    /// Points of the body within `thickness` of its surface.
    Layer {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        thickness: f64,
    },
    /// Points in all of these.
    All(#[schemars(length(min = 1))] Vec<Region>),
    /// Points in any of these.
    Any(#[schemars(length(min = 1))] Vec<Region>),
    /// All other points.
    Not(std::boxed::Box<Region>),
}

/// A pre-crack.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Crack {
    /// 1D: cuts every bond that spans this coordinate.
    Point(#[schemars(extend("x-unit" = "m"))] f64),
    /// 2D, straight.
    Segment {
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        from: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        to: Vec<f64>,
    },
    /// 2D, from corner to corner.
    Polyline {
        #[schemars(extend("x-unit" = "m"), length(min = 2))]
        vertices: Vec<Vec<f64>>,
    },
    /// 3D, a plane polygon by its corners.
    Polygon {
        #[schemars(extend("x-unit" = "m"), length(min = 3))]
        vertices: Vec<Vec<f64>>,
    },
    /// 3D, penny-shaped.
    Disc {
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        center: Vec<f64>,
        #[schemars(length(min = 3, max = 3))]
        normal: Vec<f64>,
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        radius: f64,
    },
}

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

/// Influence functions, t = |ξ|/δ.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum InfluenceFunction {
    /// 1
    #[default]
    Constant,
    /// 1 − t (conical)
    Linear,
    /// t
    Inverted,
    /// 1 − t²
    Parabolic,
    /// exp(−(t/width)²)
    Gaussian {
        #[schemars(range(min = 0.05, max = 10))]
        width: f64,
    },
    /// 1 − 3t² + 2t³
    Cubic,
    /// 1 − 10t³ + 15t⁴ − 6t⁵
    Quintic,
    /// 1 − 35t⁴ + 84t⁵ − 70t⁶ + 20t⁷
    Septic,
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
    /// Collocation where matter is whole, the standard scheme where it breaks and near boundaries. Lattices only.
    Hybrid(Hybrid),
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

/// What the body is made of.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Physics {
    pub elasticity: Elasticity,
}

/// An elastic solid that may break.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Elasticity {
    pub law: Law,
    /// Without it, bonds never break.
    pub failure: Option<Failure>,
}

/// Laws of elasticity.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Law {
    /// Bond-based, with large displacements (prototype microelastic brittle).
    BondBased(BondBased),
    /// Bond-based, linearised: small displacements and rotations only.
    BondBasedLinear(BondBased),
    /// State-based, with large displacements (linear peridynamic solid): any Poisson ratio.
    StateBased(StateBased),
    /// State-based, linearised: small displacements and rotations only.
    StateBasedLinear(StateBased),
}

impl Law {
    /// The name of the law in a case.
    pub fn name(&self) -> &'static str {
        match self {
            Law::BondBased(_) => "bond_based",
            Law::BondBasedLinear(_) => "bond_based_linear",
            Law::StateBased(_) => "state_based",
            Law::StateBasedLinear(_) => "state_based_linear",
        }
    }

    pub fn is_state_based(&self) -> bool {
        matches!(self, Law::StateBased(_) | Law::StateBasedLinear(_))
    }

    /// What all laws are given.
    pub fn parameters(&self) -> BondBased {
        match self {
            Law::BondBased(p) | Law::BondBasedLinear(p) => p.clone(),
            Law::StateBased(p) | Law::StateBasedLinear(p) => {
                BondBased { young: p.young, density: p.density, poisson: p.poisson, plane: p.plane }
            }
        }
    }
}

/// Parameters of the bond-based laws.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BondBased {
    /// Young's modulus E.
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0))]
    pub young: f64,
    /// Density ρ.
    #[schemars(extend("x-unit" = "kg/m^3", "exclusiveMinimum" = 0))]
    pub density: f64,
    /// May be given, but the theory fixes it: 1/3 in plane stress, 1/4 in plane strain and in 3D.
    pub poisson: Option<f64>,
    /// 2D only: plane stress (default) or plane strain.
    pub plane: Option<Plane>,
}

/// Parameters of the state-based laws. Their influence function ω̃ is that of the bond-based laws: bonds are weighted with
/// ω = ω̃ δ/|ξ| in the weighted volume, so that `constant` is the usual 1/|ξ| and `inverted` the usual 1.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StateBased {
    /// Young's modulus E.
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0))]
    pub young: f64,
    /// Density ρ.
    #[schemars(extend("x-unit" = "kg/m^3", "exclusiveMinimum" = 0))]
    pub density: f64,
    /// Poisson's ratio ν: above -1 and below 1/2, in plane stress below 1. Needed in 2D and 3D; in 1D there is none.
    #[schemars(extend("x-unit" = ""))]
    pub poisson: Option<f64>,
    /// 2D only: plane stress (default) or plane strain.
    pub plane: Option<Plane>,
}

/// Hypotheses of two-dimensional elasticity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Plane {
    Stress,
    Strain,
}

/// When bonds break.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Failure {
    /// A bond breaks, for good, when its stretch passes s₀.
    CriticalStretch(CriticalStretch),
}

/// The critical stretch, given or from the fracture energy.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CriticalStretch {
    /// G₀: energy to open a unit of crack area. Either this or `stretch`.
    #[schemars(extend("x-unit" = "J/m^2", "exclusiveMinimum" = 0))]
    pub fracture_energy: Option<f64>,
    /// s₀. Either this or `fracture_energy`.
    #[schemars(extend("x-unit" = "", "exclusiveMinimum" = 0))]
    pub stretch: Option<f64>,
    /// Bonds that touch a point of these sets never break.
    #[serde(default)]
    pub no_fail: Vec<String>,
    /// Other values inside a set or across two sets; later entries win.
    #[serde(default)]
    pub pairs: Vec<FailurePair>,
}

/// A critical stretch for the bonds between two sets.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FailurePair {
    /// Two set names; the same name twice for bonds within a set.
    #[schemars(length(min = 2, max = 2))]
    pub between: Vec<String>,
    #[schemars(extend("x-unit" = "J/m^2", "exclusiveMinimum" = 0))]
    pub fracture_energy: Option<f64>,
    #[schemars(extend("x-unit" = "", "exclusiveMinimum" = 0))]
    pub stretch: Option<f64>,
}

/// Something that acts on the points of a set: exactly one of `initial`, `prescribe`, `load`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Name of a set, or `all`.
    pub on: String,
    /// Values at t = 0.
    pub initial: Option<Motion>,
    /// Motion imposed while t ≤ until.
    pub prescribe: Option<Motion>,
    pub load: Option<Load>,
    /// When a prescribed motion is released or a load ends.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub until: Option<f64>,
}

/// One component of a motion.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Motion {
    Displacement {
        /// 0 for x, 1 for y, 2 for z.
        #[schemars(range(min = 0, max = 2))]
        component: usize,
        /// A number or a formula in x, y, z (reference position) and t.
        #[schemars(extend("x-unit" = "m", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
    },
    Velocity {
        /// 0 for x, 1 for y, 2 for z.
        #[schemars(range(min = 0, max = 2))]
        component: usize,
        /// A number or a formula in x, y, z (reference position) and t.
        #[schemars(extend("x-unit" = "m/s", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
    },
}

/// Forces from outside.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Load {
    /// Force per volume.
    BodyForce {
        /// 0 for x, 1 for y, 2 for z.
        #[schemars(range(min = 0, max = 2))]
        component: usize,
        #[schemars(extend("x-unit" = "N/m^3", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
    },
    /// Force per area of a face, spread over the set as a layer of the given thickness.
    Traction {
        /// 0 for x, 1 for y, 2 for z.
        #[schemars(range(min = 0, max = 2))]
        component: usize,
        #[schemars(extend("x-unit" = "Pa", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
        /// Thickness of the layer that the set is; the spacing if not given (one row of cells).
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        thickness: Option<f64>,
    },
    /// Pressure on the body's surface, against its outward normal, spread over the set as a layer.
    Pressure {
        #[schemars(extend("x-unit" = "Pa", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
        /// Thickness of the layer that the set is; the spacing if not given (one row of cells).
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        thickness: Option<f64>,
    },
}

/// One solver, or several that follow each other.
///
/// A list is `[{ static = { ... } }, { velocity_verlet = { ... } }]`, or several `[[solver]]` tables. Each begins with the
/// displacements and the bonds that the one before it left. Time goes on, so that `end_time` ascends.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Chain {
    One(Solver),
    Several(#[schemars(length(min = 1))] Vec<Solver>),
}

impl Chain {
    /// The solvers, each with its key path.
    pub fn stages(&self) -> impl Iterator<Item = (String, &Solver)> {
        let (list, single) = match self {
            Chain::One(solver) => (std::slice::from_ref(solver), true),
            Chain::Several(list) => (&list[..], false),
        };
        let path = move |(k, solver): (usize, &'_ Solver)| {
            let name = solver.name();
            if single { format!("solver.{name}") } else { format!("solver[{k}].{name}") }
        };
        list.iter().enumerate().map(move |(k, solver)| (path((k, solver)), solver))
    }
}

impl Solver {
    /// The key that chooses it.
    pub fn name(&self) -> &'static str {
        match self {
            Solver::VelocityVerlet(_) => "velocity_verlet",
            Solver::RungeKutta(_) => "runge_kutta",
            Solver::Static(_) => "static",
            Solver::Newton(_) => "newton",
            Solver::DynamicRelaxation(_) => "dynamic_relaxation",
            Solver::QuasiStatic(_) => "quasi_static",
        }
    }

    /// s
    pub fn end_time(&self) -> f64 {
        match self {
            Solver::VelocityVerlet(s) | Solver::RungeKutta(s) => s.end_time,
            Solver::Static(s) | Solver::Newton(s) | Solver::QuasiStatic(s) => s.end_time,
            Solver::DynamicRelaxation(s) => s.end_time,
        }
    }
}

/// How time advances, or how the body comes to rest. The static solvers take load steps: time is what conditions are
/// given in, and nothing moves by itself.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Solver {
    /// Explicit, second order; one sum over bonds a step.
    VelocityVerlet(Explicit),
    /// Explicit, fourth order; four sums over bonds a step, which may be √2 times as long.
    RungeKutta(Explicit),
    /// Equilibrium at small displacements: the law linearised at rest. No bond breaks.
    Static(Statics),
    /// Equilibrium of the law as it is, by Newton's method. No bond breaks.
    Newton(Statics),
    /// The same by motion that dies out: no linear system is solved.
    DynamicRelaxation(Relaxation),
    /// Newton's method, and overstrained bonds break, the worst first, until none is left; load steps are cut where no
    /// equilibrium is found.
    QuasiStatic(Statics),
}

/// Parameters of static solvers.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Statics {
    /// Time at the end of the last load step; 1 s if not given.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub end_time: f64,
    /// Load steps, of the same length.
    #[serde(default = "one_step")]
    #[schemars(range(min = 1))]
    pub steps: u64,
    /// At rest when forces out of balance are at most this share of loads or reactions.
    #[serde(default = "balanced")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.01))]
    pub tolerance: f64,
    /// Iterations of Newton's method in a load step.
    #[serde(default = "newton_iterations")]
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
    /// How the linear system in each of these is solved.
    #[serde(default)]
    pub linear: LinearSolver,
    /// Of the Krylov methods; `jacobi` if not given.
    pub preconditioner: Option<Preconditioner>,
    /// Iterations of the linear solver in each system.
    #[serde(default = "many_iterations")]
    #[schemars(range(min = 1))]
    pub max_linear: usize,
}

/// Solvers of linear systems.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinearSolver {
    /// Without a matrix; for stable bodies, whose tangent is symmetric and positive.
    #[default]
    ConjugateGradients,
    /// Sparse factors of the assembled tangent: 2D, or 3D below some 30 000 unknowns.
    Direct,
    /// For any tangent.
    Bicgstab,
    /// For any tangent; safer and in more memory.
    Gmres,
}

/// Preconditioners of linear systems.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preconditioner {
    /// The diagonal of the tangent.
    #[default]
    Jacobi,
    /// The block of each point on the diagonal.
    BlockJacobi,
    /// Incomplete factors of the assembled tangent: fewer iterations, at some hundred bytes a bond.
    IncompleteFactors,
    /// None.
    None,
}

/// Parameters of dynamic relaxation.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Relaxation {
    /// Time at the end of the last load step; 1 s if not given.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub end_time: f64,
    /// Load steps, of the same length.
    #[serde(default = "one_step")]
    #[schemars(range(min = 1))]
    pub steps: u64,
    /// At rest when forces out of balance are at most this share of loads or reactions.
    #[serde(default = "balanced")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.01))]
    pub tolerance: f64,
    /// Steps of the motion in a load step.
    #[serde(default = "many_iterations")]
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
}

fn one_step() -> u64 {
    1
}

fn balanced() -> f64 {
    1e-8
}

fn newton_iterations() -> usize {
    50
}

fn many_iterations() -> usize {
    100_000
}

/// Parameters of explicit solvers.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Explicit {
    /// The instant at which it ends.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub end_time: f64,
    /// Δt as a fraction of the stable step that is estimated from the discretisation (0.8 if not given). Either this or
    /// `time_step`.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub safety: Option<f64>,
    /// Δt. Must not pass the stable step.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub time_step: Option<f64>,
    /// c in ρ ü = force − ρ c u̇.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1/s", "minimum" = 0))]
    pub damping: f64,
}

/// Something to write.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Output {
    /// Files for ParaView, one a frame, and the collection that plays them.
    Vtu(Vtu),
    /// PNG pictures of a field.
    Picture(Picture),
    /// Rows of the table of energies, momenta and reactions; every 20 steps if not given.
    History(History),
    /// The fields at the point nearest to a place, as a table.
    Probe(Probe),
    /// The crack tip: the damaged point farthest along a direction.
    CrackTip(CrackTip),
}

/// VTU frames.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Vtu {
    /// Time between frames. Either this or `every_steps`; the first and the last instant are always written.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub every: Option<f64>,
    #[schemars(range(min = 1))]
    pub every_steps: Option<u64>,
    /// Fields; displacement and damage if not given.
    #[serde(default)]
    pub fields: Vec<FieldName>,
}

/// Names of fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FieldName {
    /// u, m
    Displacement,
    /// m/s
    Velocity,
    /// Internal force and load, N/m³
    Force,
    /// φ, 0 whole to 1 free of all bonds
    Damage,
    /// W, J/m³
    StrainEnergy,
    /// 1 where bonds are summed, 0 where a point has a row of collocation
    Scheme,
}

/// PNG pictures.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Picture {
    pub field: FieldName,
    /// Component of a vector field; its magnitude if not given.
    #[schemars(range(min = 0, max = 2))]
    pub component: Option<usize>,
    /// Time between pictures. At most one of `every`, `every_steps`, `at`; without any, the last instant alone.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub every: Option<f64>,
    #[schemars(range(min = 1))]
    pub every_steps: Option<u64>,
    /// Times of pictures.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub at: Vec<f64>,
    /// Displacements are drawn this many times as large; 1 if not given.
    #[serde(default = "one")]
    pub deform: f64,
    /// Ends of the colour bar; those of the field if not given.
    #[schemars(length(min = 2, max = 2))]
    pub range: Option<Vec<f64>>,
    /// Pixels.
    #[serde(default = "picture_width")]
    #[schemars(range(min = 200, max = 8000))]
    pub width: u32,
    /// 3D: azimuth and elevation of the eye, degrees.
    #[schemars(length(min = 2, max = 2))]
    pub view: Option<Vec<f64>>,
    /// 3D: draw only points where the field is at least this.
    pub above: Option<f64>,
}

fn one() -> f64 {
    1.0
}

fn picture_width() -> u32 {
    1200
}

/// The history table.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct History {
    #[schemars(range(min = 1))]
    pub every_steps: u64,
}

/// A probe.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// The table is written as `probe_<name>.csv`.
    pub name: String,
    /// A place; the nearest point is probed.
    #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
    pub at: Vec<f64>,
    /// Fields; displacement and velocity if not given.
    #[serde(default)]
    pub fields: Vec<FieldName>,
    #[schemars(range(min = 1))]
    pub every_steps: u64,
}

/// The crack tip.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CrackTip {
    /// The direction along which the farthest damaged point is the tip.
    #[schemars(length(min = 1, max = 3))]
    pub along: Vec<f64>,
    /// A point is damaged when φ passes this; 0.35 if not given.
    #[serde(default = "damaged")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub threshold: f64,
}

fn damaged() -> f64 {
    0.35
}

/// A number, or a formula of place and time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Formula {
    Number(f64),
    Text(String),
}

impl JsonSchema for Formula {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Formula".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["number", "string"], "x-expression": ["x", "y", "z", "t"] })
    }
}
