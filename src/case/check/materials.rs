//! Rules of materials and of what lies between them.

use std::collections::{BTreeMap, BTreeSet};

use super::super::model::{Case, Elasticity, Scheme};
use super::Checker;
use crate::expression::nearest;

/// Everything that is wrong with the materials of a case by its text alone; whether every point has one is seen by the points.
pub(super) fn check<'a>(checker: &mut Checker<'_>, case: &'a Case, used: &mut BTreeSet<&'a str>) {
    let imported = case.geometry.points.is_some();
    let (key, materials) = case.physics.materials();
    for (name, set) in materials {
        let path = format!("{key}.{name}");
        if !case.materials.contains_key(name) {
            unknown(checker, case, name, &path);
        }
        if name == "all" || case.sets.contains_key(name) && set != name {
            let message = "a material is a set of this name, and there is one of other points";
            checker.error(&path, message, "rename one of them, or let the material be that set");
        }
        if materials.contains_key(set) && set != name {
            let message = format!("`{set}` is a material, and a point is of one material only");
            checker.error(&path, message, "name a set");
        } else if set == name && !case.sets.contains_key(set) && !imported {
            checker.error(&path, format!("there is no set `{set}`"), "add it to `[sets]`");
        } else {
            checker.set_name(set, case, imported, &path, used);
        }
    }
    if materials.len() > 200 {
        checker.error(key, "a body has at most 200 materials", "");
    }
    for name in case.materials.keys().filter(|name| !materials.contains_key(*name)) {
        let message = format!("this material is defined but is nowhere: `{key}` does not name it");
        checker.warning(&format!("materials.{name}"), message);
    }
    if let Some(elasticity) = &case.physics.elasticity {
        elastic(checker, case, elasticity);
        interfaces(checker, case, elasticity);
    }
    if case.physics.diffusion.is_some() {
        for (name, material) in case.materials.iter().filter(|(name, _)| materials.contains_key(*name)) {
            if material.diffusivity.is_none() {
                let help = "add `diffusivity = <number or formula, m^2/s>`";
                checker.error(&format!("materials.{name}"), "missing key `diffusivity`: how fast it spreads", help);
            }
        }
    }
}

/// A name that no material has.
fn unknown(checker: &mut Checker<'_>, case: &Case, name: &str, path: &str) {
    let names = || case.materials.keys().map(String::as_str);
    let help = nearest(name, names()).map_or(String::new(), |n| format!("did you mean `{n}`?"));
    let message = format!("no material has this name; materials: {}", names().collect::<Vec<_>>().join(", "));
    checker.error(path, message, &help);
}

/// The values of the materials of an elastic body.
fn elastic(checker: &mut Checker<'_>, case: &Case, elasticity: &Elasticity) {
    let (dimension, law) = (case.case.dimension, elasticity.law.of());
    for (name, material) in &case.materials {
        let path = format!("materials.{name}");
        if !elasticity.materials.contains_key(name) {
            continue;
        }
        for (key, unit, given) in
            [("young", "Pa", material.young.is_some()), ("density", "kg/m^3", material.density.is_some())]
        {
            if !given && material.material.is_none() {
                let help = format!(
                    "add `{key} = <number or formula, {unit}>`, or take both from the library: `material = \"PMMA\"`"
                );
                checker.error(&path, format!("missing key `{key}`"), &help);
            }
        }
        if material.fracture_energy.is_some() && material.critical_stretch.is_some() {
            let message = "`fracture_energy` and `critical_stretch` are both given; only one may be";
            checker.error(&format!("{path}.critical_stretch"), message, "remove one of them");
        }
        let breaks = material.fracture_energy.is_some() || material.critical_stretch.is_some();
        if breaks && elasticity.failure.is_none() {
            let message = "bonds never break: `physics.elasticity.failure` is missing";
            checker.error(&path, message, "add `failure = { critical_stretch = {} }` to `[physics.elasticity]`");
        }
        let parameters = elasticity.law.parameters();
        let library = material.material.filter(|_| dimension > 1).map(|material| material.values().poisson);
        if law.is_state_based() {
            let poisson = material.poisson.or(parameters.poisson).or(library);
            checker.poisson(poisson, parameters.plane, dimension, &path);
        } else {
            checker.fixed_poisson(material.poisson, parameters.plane, dimension, &path);
        }
    }
    let several = elasticity.materials.len() > 1;
    if several && law.is_state_based() && matches!(case.discretization.scheme, Scheme::Hybrid(_)) {
        let message = "rows of the state-based law are of one material: its dilatation is carried from row to row";
        checker.error("discretization.scheme.hybrid", message, "use a bond-based law, or `scheme = \"standard\"`");
    }
}

/// What lies between two of them.
fn interfaces(checker: &mut Checker<'_>, case: &Case, elasticity: &Elasticity) {
    let law = elasticity.law.of();
    let mut pairs: BTreeMap<[&str; 2], usize> = BTreeMap::new();
    for (k, interface) in elasticity.interfaces.iter().enumerate() {
        let path = format!("physics.elasticity.interfaces[{k}]");
        for (i, name) in interface.between.iter().enumerate() {
            if !elasticity.materials.contains_key(name) {
                unknown(checker, case, name, &format!("{path}.between[{i}]"));
            }
        }
        let [Some(a), Some(b)] = [interface.between.first(), interface.between.get(1)] else { continue };
        if a == b {
            let message = "an interface lies between two materials";
            checker.error(
                &format!("{path}.between"),
                message,
                &format!("give what is inside `{a}` in `[materials.{a}]`"),
            );
        }
        let pair = if a < b { [a.as_str(), b] } else { [b.as_str(), a] };
        if let Some(first) = pairs.insert(pair, k) {
            let message = format!("interfaces[{first}] is of these two materials too");
            checker.error(&format!("{path}.between"), message, "say it once");
        }
        let [energy, stretch] = [interface.fracture_energy.is_some(), interface.stretch.is_some()];
        if energy && stretch {
            let message = "`fracture_energy` and `stretch` are both given; only one may be";
            checker.error(&format!("{path}.stretch"), message, "remove one of them");
        }
        if (energy || stretch) && elasticity.failure.is_none() {
            let message = "bonds never break: `physics.elasticity.failure` is missing";
            checker.error(&path, message, "add `failure = { critical_stretch = {} }` to `[physics.elasticity]`");
        }
        if interface.young.is_some() && law.is_state_based() {
            let message = "each end of a bond of a state-based solid pulls with its own moduli: there are none between";
            checker.error(&format!("{path}.young"), message, "remove it, or use a bond-based law");
        }
        if !energy && !stretch && interface.young.is_none() {
            checker.error(&path, "this interface says nothing", "add `fracture_energy`, `stretch` or `young`");
        }
    }
}
