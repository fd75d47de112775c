//! Moduli and densities that no solid has: most often numbers in other units than SI.

use super::super::model::{Case, Formula, Units};
use super::Checker;

/// Of elastic waves in solids, m/s: from soft rubber to diamond.
const SPEEDS: [f64; 2] = [50.0, 20_000.0];
/// E of solids, Pa, and ρ, kg/m³: what other units have to lead to.
const MODULI: [f64; 2] = [1e5, 2e12];
const DENSITIES: [f64; 2] = [50.0, 25_000.0];
/// Softer than this, in Pa, is no solid that breaks.
const SOFTEST: f64 = 1e3;

/// Units in which a modulus and a density may have been given, the likeliest first.
const OF_MODULI: [(&str, f64); 4] = [("Pa", 1.0), ("GPa", 1e9), ("MPa", 1e6), ("kPa", 1e3)];
const OF_DENSITIES: [(&str, f64); 4] = [("kg/m^3", 1.0), ("g/cm^3", 1e3), ("Mg/mm^3", 1e12), ("kg/mm^3", 1e9)];

fn is_in([low, high]: [f64; 2], x: f64) -> bool {
    (low..=high).contains(&x)
}

impl Checker<'_> {
    pub(super) fn plausible(&mut self, case: &Case) {
        let Some(elasticity) = case.physics.elasticity.as_ref().filter(|_| case.case.units == Units::Si) else {
            return;
        };
        let law = elasticity.law.parameters();
        let library = law.material.map(|material| material.values());
        let young = law.young.or(library.map(|values| values.young));
        let density = law.density.or(library.map(|values| values.density));
        self.solid(&format!("physics.elasticity.law.{}", elasticity.law.of().name()), young, density);
        for (name, material) in &case.materials {
            let number = |formula: &Option<Formula>| match formula {
                Some(Formula::Number(x)) => Some(*x),
                _ => None,
            };
            let library = material.material.map(|material| material.values());
            let young = number(&material.young).or(library.map(|values| values.young));
            let density = number(&material.density).or(library.map(|values| values.density));
            self.solid(&format!("materials.{name}"), young, density);
        }
    }

    /// E and ρ of a solid, as far as they are numbers.
    fn solid(&mut self, path: &str, young: Option<f64>, density: Option<f64>) {
        let (Some(young), Some(density)) = (young, density) else { return };
        let speed = (young / density).sqrt();
        let message = if !is_in(SPEEDS, speed) {
            format!(
                "E = {young:e} Pa and ρ = {density:e} kg/m³ make waves of {speed:.3e} m/s; in solids they have 50 to 20,000"
            )
        } else if young < SOFTEST {
            format!("E = {young:e} Pa is softer than any solid that breaks")
        } else {
            return;
        };
        let silent = "numbers without a unit are in SI units; `[case] units = \"none\"` says that these have none";
        let pairs = OF_MODULI.iter().flat_map(|modulus| OF_DENSITIES.iter().map(move |density| (modulus, density)));
        let meant = pairs.map(|pair| (pair, [young * pair.0.1, density * pair.1.1])).find(|(_, [young, density])| {
            is_in(MODULI, *young) && is_in(DENSITIES, *density) && is_in(SPEEDS, (young / density).sqrt())
        });
        let changed = |key: &str, value: f64, (unit, times): &(&str, f64)| match *times {
            1.0 => None,
            _ => Some(format!("`{key} = \"{value} {unit}\"`")),
        };
        let meant = meant.map(|((a, b), _)| [changed("young", young, a), changed("density", density, b)]);
        let meant: Vec<String> = meant.into_iter().flatten().flatten().collect();
        let help = match meant.is_empty() {
            false => format!("did you mean {}? {silent}", meant.join(" and ")),
            true => silent.to_owned(),
        };
        let key = if young < SOFTEST || young / density < SPEEDS[0].powi(2) { "young" } else { "density" };
        let warning = self.source.warning(&format!("{path}.{key}"), message).help(help);
        self.list.push(warning);
    }
}
