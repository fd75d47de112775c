//! What a user may write: nested data, one struct a table. Units are SI; see each key for its own.
//!
//! The JSON schema that editors use, the checks of the reader and the documentation of the keys are all made from
//! these types, so that a key stands in one place. `x-unit` names the unit of a number, `x-expression` the variables
//! that a formula may use.

mod diffusion;
mod discretization;
mod geometry;
mod materials;
mod output;
mod physics;
mod solver;

use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

pub use diffusion::*;
pub use discretization::*;
pub use geometry::*;
pub use materials::*;
pub use output::*;
pub use physics::*;
pub use solver::*;

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
    /// Named parts of the surface of `geometry.shape`, on which tractions, pressures, fluxes and moments act.
    #[serde(default)]
    pub surfaces: BTreeMap<String, SurfacePart>,
    pub discretization: Discretization,
    /// Cells of several sizes, from the start or as the solution wants them.
    pub refinement: Option<Refinement>,
    /// What parts of the body are made of, by name; the physics says where.
    #[serde(default)]
    pub materials: BTreeMap<String, Material>,
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
    /// Whether numbers are in SI units, or in none: then nobody wonders at their size.
    #[serde(default)]
    pub units: Units,
}

/// What numbers of a case are in.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Units {
    /// SI units.
    #[default]
    Si,
    /// None: they are ratios to quantities that the user knows, or of a consistent system of other units.
    None,
}

/// Something that acts on the points of a set, exactly one of `initial`, `prescribe`, `load`; or what is beyond an end of the
/// body, `mirror` or `periodic`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Name of a set, or `all`; of a load by area, of a surface too. Needed but by `mirror` and `periodic`, which are about the whole
    /// body, and by loads that say where they act.
    pub on: Option<String>,
    /// Values at t = 0.
    pub initial: Option<Motion>,
    /// Values imposed up to `until`.
    pub prescribe: Option<Motion>,
    pub load: Option<Load>,
    /// The body goes on as its own image beyond a plane.
    pub mirror: Option<Mirror>,
    /// The body goes on beyond its end as it begins.
    pub periodic: Option<Periodic>,
    /// Of `initial` and `prescribe`: an exception to a condition before it, which wants other values of the same points.
    #[serde(default, rename = "override")]
    pub overrides: bool,
    /// When a prescribed value is released or a load ends: a step ends there.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub until: Option<f64>,
}

/// One component of a motion, or a concentration.
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
    /// Of diffusion.
    Concentration {
        /// C, in whatever unit its user has: a number or a formula in x, y, z and t.
        #[schemars(extend("x-unit" = "", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
    },
}

impl Motion {
    /// Which component.
    pub fn component(&self) -> usize {
        match self {
            Motion::Displacement { component, .. } | Motion::Velocity { component, .. } => *component,
            Motion::Concentration { .. } => 0,
        }
    }

    /// Its value.
    pub fn value(&self) -> &Formula {
        match self {
            Motion::Displacement { value, .. } | Motion::Velocity { value, .. } | Motion::Concentration { value } => {
                value
            }
        }
    }

    /// The key that chooses it.
    pub fn name(&self) -> &'static str {
        match self {
            Motion::Displacement { .. } => "displacement",
            Motion::Velocity { .. } => "velocity",
            Motion::Concentration { .. } => "concentration",
        }
    }
}

/// What acts on the body or enters it from outside.
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
    /// Force per area of a surface, or of the surface above a set of points.
    Traction {
        /// 0 for x, 1 for y, 2 for z.
        #[schemars(range(min = 0, max = 2))]
        component: usize,
        #[schemars(extend("x-unit" = "Pa", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
        /// Instead of looking for the surface: the set is a layer this thick, and the force a body force in it.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        thickness: Option<f64>,
        /// Or: the set stands for so much of the surface, which its points share by volume. m² (2D: m; 1D: 1).
        #[schemars(extend("x-unit" = "", "exclusiveMinimum" = 0))]
        area: Option<f64>,
    },
    /// Pressure on a surface, or on the surface above a set of points, against the outward normal.
    Pressure {
        #[schemars(extend("x-unit" = "Pa", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
        /// Instead of looking for the surface: the set is a layer this thick, and the force a body force in it.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        thickness: Option<f64>,
    },
    /// A force at a place, N (2D: of unit thickness).
    Point {
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        at: Vec<f64>,
        /// 0 for x, 1 for y, 2 for z.
        #[schemars(range(min = 0, max = 2))]
        component: usize,
        #[schemars(extend("x-unit" = "N", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
    },
    /// A force per length along a straight line.
    Line {
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 3))]
        from: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 3))]
        to: Vec<f64>,
        /// 0 for x, 1 for y, 2 for z.
        #[schemars(range(min = 0, max = 2))]
        component: usize,
        #[schemars(extend("x-unit" = "N/m", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
    },
    /// A moment on a surface, or on the surface above a set: tractions that grow with the distance from its centroid and have no sum.
    Moment {
        /// About which; in 2D there is z alone.
        axis: Option<Axis>,
        #[schemars(extend("x-unit" = "N*m", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
    },
    /// Of diffusion: what is set free, per volume and second.
    Source {
        /// S, unit of C per second.
        #[schemars(extend("x-unit" = "1/s", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
    },
    /// Of diffusion: what enters through a surface, or the surface above a set of points, per area and second.
    Flux {
        /// Inward, unit of C times m/s.
        #[schemars(extend("x-unit" = "m/s", "x-expression" = ["x", "y", "z", "t"]))]
        value: Formula,
        /// Instead of looking for the surface: the set is a layer this thick, and the flux a source in it.
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        thickness: Option<f64>,
        /// Or: the set stands for so much of the surface, which its points share by volume. m² (2D: m; 1D: 1).
        #[schemars(extend("x-unit" = "", "exclusiveMinimum" = 0))]
        area: Option<f64>,
    },
}

impl Load {
    /// The key that chooses it.
    pub fn name(&self) -> &'static str {
        match self {
            Load::BodyForce { .. } => "body_force",
            Load::Traction { .. } => "traction",
            Load::Pressure { .. } => "pressure",
            Load::Source { .. } => "source",
            Load::Flux { .. } => "flux",
            Load::Point { .. } => "point",
            Load::Line { .. } => "line",
            Load::Moment { .. } => "moment",
        }
    }

    /// `thickness` and `area`.
    pub fn layer(&self) -> (Option<f64>, Option<f64>) {
        match self {
            Load::Traction { thickness, area, .. } | Load::Flux { thickness, area, .. } => (*thickness, *area),
            Load::Pressure { thickness, .. } => (*thickness, None),
            _ => (None, None),
        }
    }

    /// Whether it acts by area, so that it can be on a surface.
    pub fn is_by_area(&self) -> bool {
        matches!(self, Load::Traction { .. } | Load::Pressure { .. } | Load::Flux { .. } | Load::Moment { .. })
    }

    /// Whether it says itself where it acts.
    pub fn is_placed(&self) -> bool {
        matches!(self, Load::Point { .. } | Load::Line { .. })
    }
}

/// A plane across an axis, at which the body goes on as its own image: the face of its outermost cells.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mirror {
    /// Across which the plane stands.
    pub axis: Axis,
    /// Which end of the body.
    pub side: Side,
    #[serde(default)]
    pub parity: Parity,
    /// Coordinate of the plane, for points from a file; none may lie on it or beyond.
    #[schemars(extend("x-unit" = "m"))]
    pub at: Option<f64>,
}

/// An axis along which the body goes on beyond its end as it begins: its period is the length of its cells.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Periodic {
    /// Along which it goes on.
    pub axis: Axis,
    /// For points from a file, which span less.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
    pub period: Option<f64>,
}

/// An end of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Side {
    Low,
    High,
}

/// How motion is mirrored.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Parity {
    /// Symmetric: displacements across the plane change their sign, those along it do not.
    #[default]
    Even,
    /// Antisymmetric: the other way round. For linear laws without failure.
    Odd,
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

fn one() -> f64 {
    1.0
}
