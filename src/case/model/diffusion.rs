//! Tables of diffusion: what diffuses, its solver, and collocation in place of bonds.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A body in which something diffuses, Ċ = ∫ κ ω(|ξ|/δ) (C′ − C)/|ξ|^q dV′ + S. C is in whatever unit its user has.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Diffusion {
    /// Diffusivity K, from which κ follows. Here or in `[materials]`.
    #[schemars(extend("x-unit" = "m^2/s", "exclusiveMinimum" = 0))]
    pub diffusivity: Option<f64>,
    /// q of the flux of a bond, 2 if not given.
    #[serde(default = "two")]
    #[schemars(range(min = 0, max = 3))]
    pub exponent: u32,
    /// Whether the weights of a lattice are scaled so that long waves find exactly K there; if not, κ is that of the
    /// integral, and they find what a finite spacing makes of it. Scattered points and rows of collocation are not scaled.
    #[serde(default = "yes")]
    pub calibrated: bool,
    /// Where each of `[materials]` is: its name and a set. Every point is in exactly one of these sets.
    #[serde(default)]
    pub materials: BTreeMap<String, String>,
}

/// Parameters of collocation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Collocation {
    /// Largest degree of the polynomials, even.
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
}

/// Parameters of the solver of equations of first order.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FirstOrder {
    /// The instant at which it ends: the last step is shorter where it has to be.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub end_time: f64,
    /// Δt as a fraction of the stable step that is estimated from the discretisation (0.8 if not given). Either this or
    /// `time_step`.
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 1))]
    pub safety: Option<f64>,
    /// Δt. Above the estimate of the stable step it is taken where it is proven stable.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0))]
    pub time_step: Option<f64>,
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
