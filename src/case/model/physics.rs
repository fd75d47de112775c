//! Tables of the physics: laws and failure.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Diffusion, Interface};
use crate::case::library::LibraryMaterial;
use crate::physics::elasticity::laws;

/// What happens in the body: exactly one of these.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Physics {
    pub elasticity: Option<Elasticity>,
    pub diffusion: Option<Diffusion>,
}

impl Physics {
    /// That of a case in which nothing diffuses.
    ///
    /// # Panics
    /// Of a case without elasticity, which the rules across keys refuse.
    pub fn elastic(&self) -> &Elasticity {
        self.elasticity.as_ref().expect("a checked case without diffusion has elasticity")
    }
}

impl Physics {
    /// Where each material is, and the key that says so.
    pub fn materials(&self) -> (&'static str, &BTreeMap<String, String>) {
        static NONE: BTreeMap<String, String> = BTreeMap::new();
        match (&self.elasticity, &self.diffusion) {
            (Some(elasticity), _) => ("physics.elasticity.materials", &elasticity.materials),
            (None, Some(diffusion)) => ("physics.diffusion.materials", &diffusion.materials),
            (None, None) => ("physics", &NONE),
        }
    }
}

/// An elastic solid that may break.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Elasticity {
    pub law: Law,
    /// Where each of `[materials]` is: its name and a set. Every point is in exactly one of these sets.
    #[serde(default)]
    pub materials: BTreeMap<String, String>,
    /// What lies between two of them.
    #[serde(default)]
    pub interfaces: Vec<Interface>,
    /// Without it, bonds never break.
    pub failure: Option<Failure>,
}

macro_rules! define {
    ($($(#[doc = $about:literal])* $name:ident $key:literal $kind:ident $module:ident::$law:ident,)*) => {
        /// Laws of elasticity.
        #[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub enum Law {
            $($(#[doc = $about])* #[serde(rename = $key)] $name(define!(@$kind)),)*
        }

        impl Law {
            /// Which of the list it is.
            pub fn of(&self) -> laws::Law {
                match self { $(Law::$name(_) => laws::Law::$name,)* }
            }

            /// What all laws are given.
            pub fn parameters(&self) -> Parameters {
                match self { $(Law::$name(p) => p.clone().into(),)* }
            }
        }
    };
    (@bonds) => { BondBased };
    (@solid) => { StateBased };
}
laws::each_law!(define);

/// What all laws are given.
#[derive(Debug, Clone)]
pub struct Parameters {
    pub material: Option<LibraryMaterial>,
    pub young: Option<f64>,
    pub density: Option<f64>,
    pub poisson: Option<f64>,
    pub plane: Option<Plane>,
}

impl From<BondBased> for Parameters {
    fn from(BondBased { material, young, density, poisson, plane }: BondBased) -> Self {
        Parameters { material, young, density, poisson, plane }
    }
}

impl From<StateBased> for Parameters {
    fn from(StateBased { material, young, density, poisson, plane }: StateBased) -> Self {
        Parameters { material, young, density, poisson, plane }
    }
}

/// Parameters of the bond-based laws.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BondBased {
    /// Of the library: its values stand where this table gives none.
    pub material: Option<LibraryMaterial>,
    /// Young's modulus E. Here or in `[materials]`.
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0))]
    pub young: Option<f64>,
    /// Density ρ. Here or in `[materials]`.
    #[schemars(extend("x-unit" = "kg/m^3", "exclusiveMinimum" = 0))]
    pub density: Option<f64>,
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
    /// Of the library: its values stand where this table gives none.
    pub material: Option<LibraryMaterial>,
    /// Young's modulus E. Here or in `[materials]`.
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0))]
    pub young: Option<f64>,
    /// Density ρ. Here or in `[materials]`.
    #[schemars(extend("x-unit" = "kg/m^3", "exclusiveMinimum" = 0))]
    pub density: Option<f64>,
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
    /// G₀: energy to open a unit of crack area. Either this or `stretch`; neither where `[materials]` say it.
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
