//! Tables of materials: what parts of a body are made of, and what lies between them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Formula;
use crate::case::library::LibraryMaterial;

/// What a part of a body is made of. Values may be formulas of the reference position x, y, z.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Of the library: its values stand where this table gives none.
    pub material: Option<LibraryMaterial>,
    /// Young's modulus E.
    #[schemars(extend("x-unit" = "Pa", "x-expression" = ["x", "y", "z"], "exclusiveMinimum" = 0))]
    pub young: Option<Formula>,
    /// Density ρ.
    #[schemars(extend("x-unit" = "kg/m^3", "x-expression" = ["x", "y", "z"], "exclusiveMinimum" = 0))]
    pub density: Option<Formula>,
    /// Poisson's ratio ν, of state-based laws.
    #[schemars(extend("x-unit" = ""))]
    pub poisson: Option<f64>,
    /// G₀: energy to open a unit of crack area inside. Either this or `critical_stretch`; without both, bonds inside never
    /// break.
    #[schemars(extend("x-unit" = "J/m^2", "x-expression" = ["x", "y", "z"], "exclusiveMinimum" = 0))]
    pub fracture_energy: Option<Formula>,
    /// s₀ inside. Either this or `fracture_energy`.
    #[schemars(extend("x-unit" = "", "x-expression" = ["x", "y", "z"], "exclusiveMinimum" = 0))]
    pub critical_stretch: Option<Formula>,
    /// K, of what diffuses.
    #[schemars(extend("x-unit" = "m^2/s", "x-expression" = ["x", "y", "z"], "exclusiveMinimum" = 0))]
    pub diffusivity: Option<Formula>,
    /// Scatter of these values from point to point.
    pub random: Option<Random>,
}

/// Values that scatter: each is multiplied by a random field with mean 1. A seed makes it the same in every run.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Random {
    /// Fields of other seeds are independent.
    pub seed: u64,
    /// Distance over which the field forgets itself: its correlation is exp(-r²/length²). Without it, every point is by
    /// itself.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
    pub length: Option<f64>,
    #[serde(default)]
    pub distribution: Distribution,
    /// Standard deviation of Young's modulus over its mean.
    #[serde(default)]
    #[schemars(extend("x-unit" = "", "minimum" = 0))]
    pub young: f64,
    /// The same of the density.
    #[serde(default)]
    #[schemars(extend("x-unit" = "", "minimum" = 0))]
    pub density: f64,
    /// The same of the fracture energy.
    #[serde(default)]
    #[schemars(extend("x-unit" = "", "minimum" = 0))]
    pub fracture_energy: f64,
    /// The same of the critical stretch.
    #[serde(default)]
    #[schemars(extend("x-unit" = "", "minimum" = 0))]
    pub critical_stretch: f64,
    /// The same of the diffusivity.
    #[serde(default)]
    #[schemars(extend("x-unit" = "", "minimum" = 0))]
    pub diffusivity: f64,
}

/// How values scatter about their mean.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// Positive whatever the deviation.
    #[default]
    LogNormal,
    /// Gaussian; a value that is not positive is a mistake.
    Normal,
}

/// What the bonds between two materials are, where that does not follow from both.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Interface {
    /// Names of two materials.
    #[schemars(length(min = 2, max = 2))]
    pub between: Vec<String>,
    /// Young's modulus that their micromodulus stands for; without it, the harmonic mean of both. Of bond-based laws.
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0))]
    pub young: Option<f64>,
    /// G₀ of the interface. Either this or `stretch`; without both, the smaller critical stretch of both materials.
    #[schemars(extend("x-unit" = "J/m^2", "exclusiveMinimum" = 0))]
    pub fracture_energy: Option<f64>,
    /// s₀ of the interface.
    #[schemars(extend("x-unit" = "", "exclusiveMinimum" = 0))]
    pub stretch: Option<f64>,
}
