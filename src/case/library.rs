//! The library of materials: values that a case takes by name, each with its source. Any key of a case overrides its value.
//!
//! A material here is a line in the list; the case language, `bondwise list materials` and the documentation follow.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the library knows of a material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Values {
    /// E, Pa.
    pub young: f64,
    /// ρ, kg/m³.
    pub density: f64,
    /// ν
    pub poisson: f64,
    /// G₀, J/m²; None where brittle fracture says nothing of it.
    pub fracture_energy: Option<f64>,
    pub source: &'static str,
}

macro_rules! library {
    ($($(#[doc = $about:literal])* $name:ident $key:literal $young:literal $density:literal $poisson:literal $energy:expr, $source:literal;)*) => {
        /// A material of the library.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
        pub enum LibraryMaterial {
            $($(#[doc = $about])* #[serde(rename = $key)] $name,)*
        }

        impl LibraryMaterial {
            /// All of them.
            pub const ALL: &[LibraryMaterial] = &[$(LibraryMaterial::$name),*];

            /// In a case.
            pub fn name(self) -> &'static str {
                match self { $(LibraryMaterial::$name => $key,)* }
            }

            pub fn values(self) -> Values {
                match self {
                    $(LibraryMaterial::$name => Values {
                        young: $young,
                        density: $density,
                        poisson: $poisson,
                        fracture_energy: $energy,
                        source: $source,
                    },)*
                }
            }
        }
    };
}

// G₀ from a fracture toughness: K²(1 − ν²)/E, plane strain.
library! {
    /// Soda-lime glass: 72 GPa, 2440 kg/m³, 3.8 J/m².
    SodaLimeGlass "soda-lime glass" 72e9 2440.0 0.22 Some(3.8),
        "E, ρ, G₀: Bobaru & Zhang, Int. J. Fract. 196 (2015) 59; ν: a usual value";
    /// Acrylic glass (PMMA): 3.24 GPa, 1190 kg/m³, 352.3 J/m².
    Pmma "PMMA" 3.24e9 1190.0 0.35 Some(352.3),
        "Xu & Needleman, J. Mech. Phys. Solids 42 (1994) 1397";
    /// Concrete: 25.85 GPa, 2400 kg/m³, 90 J/m².
    Concrete "concrete" 25.85e9 2400.0 0.18 Some(90.0),
        "E, ν, G₀: Winkler, Traglastuntersuchungen (Innsbruck 2001), the L-shaped panel; ρ: EN 1991-1-1, plain concrete";
    /// Maraging steel 18Ni(300), once 18Ni1900: 190 GPa, 8000 kg/m³, 22.1 kJ/m².
    Steel18Ni1900 "steel 18Ni1900" 190e9 8000.0 0.3 Some(22130.0),
        "Borden et al., Comput. Methods Appl. Mech. Engrg 217 (2012) 77, for the plate of Kalthoff & Winkler 1987";
    /// Aluminium alloy 6061-T6: 68.9 GPa, 2700 kg/m³, 10.9 kJ/m².
    Aluminium6061 "aluminium 6061" 68.9e9 2700.0 0.33 Some(10877.0),
        "T6, K = 29 MPa√m: data sheet of Aerospace Specification Metals";
    /// Titanium alloy Ti-6Al-4V, annealed: 113.8 GPa, 4430 kg/m³, 43.6 kJ/m².
    Ti6Al4V "Ti-6Al-4V" 113.8e9 4430.0 0.342 Some(43647.0),
        "grade 5, annealed, K = 75 MPa√m: data sheet of Aerospace Specification Metals";
    /// Alumina, 99.5 %: 370 GPa, 3980 kg/m³, 24.3 J/m².
    Alumina "alumina" 370e9 3980.0 0.22 Some(24.32),
        "E, ρ, G₀: the thermal-crack example of CabanaPD (Oak Ridge National Laboratory); ν: a usual value";
    /// Stainless steel 304: 193 GPa, 8000 kg/m³; it tears in a ductile manner, and has no fracture energy here.
    Ss304 "SS304" 193e9 8000.0 0.29 None,
        "annealed: data sheet of Aerospace Specification Metals";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fracture_energies_from_toughness_are_those_of_plane_strain() {
        for (material, toughness) in [(LibraryMaterial::Aluminium6061, 29e6), (LibraryMaterial::Ti6Al4V, 75e6)] {
            let Values { young, poisson, fracture_energy, .. } = material.values();
            let expected: f64 = f64::powi(toughness, 2) * (1.0 - poisson * poisson) / young;
            // Printed to the unit.
            assert!((fracture_energy.unwrap() - expected).abs() < 1.0, "{}: {expected}", material.name());
        }
    }
}
