//! Tables of what is written.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::json;

use crate::field::Kind;
use crate::physics::all_fields;

/// Something to write.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Output {
    /// Files for ParaView, one a frame, and the collection that plays them.
    Vtu(Vtu),
    /// PNG pictures of a field.
    Picture(Picture),
    /// Rows of the table of energies and momenta, or amounts, and of reactions; every 20 steps if not given.
    History(History),
    /// The fields at the point nearest to a place, as a table.
    Probe(Probe),
    /// The crack tip: the damaged point farthest along a direction.
    CrackTip(CrackTip),
    /// The force on a set, internal forces and loads, and its moment, as a table.
    Force(Force),
    /// The force that bonds transmit through a plane, and its moment, as a table.
    Cut(Cut),
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
    /// Fields; displacement and damage if not given, of diffusion the concentration.
    #[serde(default)]
    pub fields: Vec<FieldName>,
}

/// The name of a field that a physics has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct FieldName(&'static str);

impl FieldName {
    pub fn name(&self) -> &'static str {
        self.0
    }

    /// What a value of the field is.
    pub fn kind(&self) -> Kind {
        all_fields().find(|field| field.name == self.0).map_or(Kind::Scalar, |field| field.kind)
    }
}

impl<'de> Deserialize<'de> for FieldName {
    fn deserialize<T: Deserializer<'de>>(from: T) -> Result<Self, T::Error> {
        let text = String::deserialize(from)?;
        let known = all_fields().find(|field| field.name == text);
        known.map(|field| FieldName(field.name)).ok_or_else(|| T::Error::custom(format!("unknown field `{text}`")))
    }
}

/// One variant for each field of the list, as if it were an enum.
impl JsonSchema for FieldName {
    fn schema_name() -> Cow<'static, str> {
        "FieldName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let variants: Vec<_> = all_fields()
            .map(|field| {
                let unit = if field.unit.is_empty() { String::new() } else { format!(", {}", field.unit) };
                json!({ "type": "string", "const": field.name, "description": format!("{}{unit}", field.about) })
            })
            .collect();
        json_schema!({ "description": "Names of fields.", "oneOf": variants })
    }
}

/// PNG pictures.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Picture {
    pub field: FieldName,
    /// Component of a vector field, or of a tensor (xx yy zz xy yz xz) or its principal values; its magnitude if not given.
    #[schemars(range(min = 0, max = 5))]
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
    #[serde(default = "super::one")]
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
    /// A place; the nearest point is probed, the lowest of several. `report.json` says which.
    #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
    pub at: Vec<f64>,
    /// Fields; displacement and velocity if not given, of diffusion the concentration.
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

/// The force on a set.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Force {
    /// The table is written as `force_<name>.csv`.
    pub name: String,
    /// The set.
    pub on: String,
    /// The place that moments are about; the centroid of the set if not given. Not in 1D.
    #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
    pub about: Option<Vec<f64>>,
    #[schemars(range(min = 1))]
    pub every_steps: u64,
}

/// The force through a cut: that of the side of the normal on the other side.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// The table is written as `cut_<name>.csv`.
    pub name: String,
    /// A place on the plane, in the undeformed body.
    #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
    pub point: Vec<f64>,
    /// The direction across it, of any length.
    #[schemars(length(min = 1, max = 3))]
    pub normal: Vec<f64>,
    /// The place that moments are about; `point` if not given. Not in 1D.
    #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
    pub about: Option<Vec<f64>>,
    #[schemars(range(min = 1))]
    pub every_steps: u64,
}

fn damaged() -> f64 {
    0.35
}
