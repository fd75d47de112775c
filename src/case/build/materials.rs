//! What the points of an elastic body are made of: the materials of the case, and their values point by point.

use std::sync::Arc;

use super::super::library::LibraryMaterial;
use super::super::model::{self, Distribution, Formula, Material, Random};
use super::Builder;
use super::conditions::rounded;
use crate::conditions::random::RandomField;
use crate::discretization::Heterogeneity;
use crate::discretization::heterogeneity::PairTable;
use crate::error::{Error, Result};
use crate::execution::Packs;
use crate::family::Body;
use crate::geometry::Cloud;
use crate::output::source::{DiffusiveMaterial, MaterialSummary};
use crate::physics::elasticity::Elasticity;
use crate::physics::elasticity::moduli::{self, Hypothesis, Stiffness};
use crate::physics::failure::CriticalStretch;
use crate::physics::failure::critical_stretch::PairRule;

/// The values of one material.
#[derive(Debug, Clone, Copy)]
pub(super) struct Values {
    /// E, Pa; ρ, kg/m³; ν, zero where nobody asks.
    pub young: f64,
    pub density: f64,
    pub poisson: f64,
}

/// Which points are of which material.
struct Parts {
    /// In the order of their numbers.
    names: Vec<String>,
    slots: Vec<Arc<[u32]>>,
    /// By slot.
    material: Vec<u8>,
}

/// What a body of several materials is made of, by slot; zero where there is no point.
pub(super) struct Composition {
    /// In the order of their numbers.
    pub names: Vec<String>,
    /// Of each a typical point: the first of its set.
    pub typical: Vec<Values>,
    pub slots: Vec<Arc<[u32]>>,
    pub material: Vec<u8>,
    pub young: Vec<f64>,
    pub density: Vec<f64>,
    /// s₀, infinite where bonds never break.
    pub stretch: Vec<f64>,
}

/// s₀ of a fracture energy (J/m²) in a material.
pub(super) type Critical<'a> = &'a dyn Fn(&Values, f64) -> f64;

impl Composition {
    /// ν at a slot.
    pub fn poisson(&self, slot: usize) -> f64 {
        self.typical.get(self.material[slot] as usize).map_or(0.0, |values| values.poisson)
    }
}

/// A key of a table, or else what the library says.
fn value(key: &Option<Formula>, material: Option<LibraryMaterial>, of: fn(LibraryMaterial) -> f64) -> Option<Formula> {
    key.clone().or(material.map(|material| Formula::Number(of(material))))
}

impl<const D: usize> Builder<'_, D> {
    /// The values of the only material, or typical ones of the first of several: what weights are made for.
    pub(super) fn reference(&self, cloud: &Cloud<D>) -> Result<Values> {
        let elasticity = self.case.value.physics.elastic();
        let law = elasticity.law.parameters();
        let library = law.material.map(LibraryMaterial::values);
        let Some(name) = elasticity.materials.keys().next() else {
            // `check` has seen to it that both are given.
            return Ok(Values {
                young: law.young.or(library.map(|v| v.young)).unwrap_or(1.0),
                density: law.density.or(library.map(|v| v.density)).unwrap_or(1.0),
                poisson: law.poisson.or(library.map(|v| v.poisson)).unwrap_or(0.0),
            });
        };
        let material = &self.case.value.materials[name];
        let at_first = |formula: Option<Formula>| -> Result<f64> {
            let x = crate::field::embed(&cloud.position(cloud.slots[0] as usize));
            let value = match &formula {
                None => 1.0,
                Some(formula) => self.expression(formula)?.evaluate(&[x[0], x[1], x[2], 0.0]),
            };
            // Any number will do: what a formula gives at its own points is asked for later.
            Ok(if value.is_finite() && value > 0.0 { value } else { 1.0 })
        };
        Ok(Values {
            young: at_first(value(&material.young, material.material, |m| m.values().young))?,
            density: at_first(value(&material.density, material.material, |m| m.values().density))?,
            poisson: self.poisson(material),
        })
    }

    fn poisson(&self, material: &Material) -> f64 {
        let law = self.case.value.physics.elastic().law.parameters().poisson;
        let library = material.material.map(|material| material.values().poisson);
        material.poisson.or(law).or(library).unwrap_or(0.0)
    }

    /// Which points are of which material; None where the physics says it all. Materials become sets of the cloud.
    fn parts(&self, cloud: &mut Cloud<D>) -> Result<Option<Parts>> {
        let (path, where_) = self.case.value.physics.materials();
        if where_.is_empty() {
            return Ok(None);
        }
        let names: Vec<String> = where_.keys().cloned().collect();
        let mut found = Parts { names, slots: Vec::new(), material: vec![u8::MAX; cloud.n_slots()] };
        for (k, (name, set)) in where_.iter().enumerate() {
            let slots = self.slots(set, cloud, &format!("{path}.{name}"))?;
            for &slot in slots.iter() {
                let of = &mut found.material[slot as usize];
                if *of != u8::MAX {
                    let (other, point) = (&found.names[*of as usize], self.place(cloud, slot));
                    let message = format!("{point} is of `{other}` (set `{}`) as well", where_[other]);
                    let help = "every point is of one material: take it out of one of the sets, as with `not`";
                    return Err(self.refuse(&format!("{path}.{name}"), message, help));
                }
                *of = k as u8;
            }
            found.slots.push(slots);
        }
        if let Some(&slot) = cloud.slots.iter().find(|&&slot| found.material[slot as usize] == u8::MAX) {
            let message = format!("{} is of no material", self.place(cloud, slot));
            let help = "every point is of one: a set such as `{ not = … }` takes the rest";
            return Err(self.refuse(path, message, help));
        }
        for (name, slots) in found.names.iter().zip(&found.slots) {
            if cloud.sets.get(name).is_none() {
                cloud.sets.insert(name.clone(), slots.to_vec());
            }
        }
        Ok(Some(found))
    }

    /// What an elastic body of several materials is made of; None where the law says it all.
    pub(super) fn composition(&self, cloud: &mut Cloud<D>, critical: Critical<'_>) -> Result<Option<Composition>> {
        let Some(Parts { names, slots, material }) = self.parts(cloud)? else { return Ok(None) };
        let n = cloud.n_slots();
        let mut found = Composition {
            names,
            typical: Vec::new(),
            slots,
            material,
            young: vec![0.0; n],
            density: vec![0.0; n],
            stretch: vec![f64::INFINITY; n],
        };
        for (k, name) in found.names.clone().iter().enumerate() {
            self.fill(&mut found, k, &self.case.value.materials[name], cloud, critical)?;
        }
        if let Some(images) = &cloud.images {
            images.copy(&mut found.material);
            [&mut found.young, &mut found.density, &mut found.stretch]
                .into_iter()
                .for_each(|values| images.copy(values));
        }
        Ok(Some(found))
    }

    /// K by slot of a body of several materials, zero where there is no point, and what is known of each; None where
    /// the physics says it all.
    pub(super) fn diffusivities(&self, cloud: &mut Cloud<D>) -> Result<Option<(Vec<f64>, Vec<DiffusiveMaterial>)>> {
        let Some(parts) = self.parts(cloud)? else { return Ok(None) };
        let (mut found, mut list) = (vec![0.0; cloud.n_slots()], Vec::new());
        for (name, slots) in parts.names.into_iter().zip(parts.slots) {
            let material = &self.case.value.materials[&name];
            let deviation = material.random.as_ref().map_or(0.0, |random| random.diffusivity);
            let path = format!("materials.{name}");
            let values =
                self.values(&material.diffusivity, "diffusivity", deviation, (material, cloud, &slots, &path))?;
            // `check` has seen to it that it is given.
            let values = values.ok_or_else(|| Error::Refused(format!("{path} lacks `diffusivity`")))?;
            slots.iter().zip(&values).for_each(|(&slot, value)| found[slot as usize] = *value);
            list.push(DiffusiveMaterial {
                name,
                points: slots.len(),
                volume: slots.iter().map(|&slot| cloud.volume(slot as usize)).sum(),
                diffusivity: values.iter().copied().fold(0.0, f64::max),
            });
        }
        if let Some(images) = &cloud.images {
            images.copy(&mut found);
        }
        Ok(Some((found, list)))
    }

    /// A value of a material at its points, if it is given: positive at each.
    #[allow(clippy::type_complexity)] // what, and where
    fn values(
        &self,
        formula: &Option<Formula>,
        key: &str,
        deviation: f64,
        (material, cloud, slots, path): (&Material, &Cloud<D>, &Arc<[u32]>, &str),
    ) -> Result<Option<Vec<f64>>> {
        let Some(formula) = formula else { return Ok(None) };
        let random = material.random.as_ref().filter(|_| deviation > 0.0);
        let mut values = self.profile(formula, cloud, slots, &format!("{path}.{key}"))?.at(0.0).to_vec();
        if let Some(random) = random {
            self.scatter(&mut values, random, deviation, cloud, slots, path)?;
        }
        if let Some(bad) = values.iter().position(|value| *value <= 0.0) {
            let message = format!("`{key}` is {:e} at {}", values[bad], self.place(cloud, slots[bad]));
            let help = match random {
                Some(_) => "take `distribution = \"log_normal\"`, which stays positive, or a smaller deviation",
                None => "it must be above 0 at every point of the material",
            };
            return Err(self.refuse(&format!("{path}.{key}"), message, help));
        }
        Ok(Some(values))
    }

    /// The values of material number `k` at its points.
    fn fill(
        &self,
        found: &mut Composition,
        k: usize,
        material: &Material,
        cloud: &Cloud<D>,
        critical: Critical<'_>,
    ) -> Result<()> {
        let (slots, path) = (found.slots[k].clone(), format!("materials.{}", found.names[k]));
        let library = material.material;
        let random = material.random.as_ref();
        let at = |formula: &Option<Formula>, key: &str, deviation: f64| {
            self.values(formula, key, deviation, (material, cloud, &slots, &path))
        };
        let scatter = |of: fn(&Random) -> f64| random.map_or(0.0, of);
        let young = value(&material.young, library, |m| m.values().young);
        let density = value(&material.density, library, |m| m.values().density);
        let (young, density) =
            (at(&young, "young", scatter(|r| r.young))?, at(&density, "density", scatter(|r| r.density))?);
        // `check` has seen to it that both are given.
        let (Some(young), Some(density)) = (young, density) else {
            return Err(Error::Refused(format!("{path} lacks `young` or `density`")));
        };
        let failure = self.case.value.physics.elastic().failure.as_ref();
        let failure = failure.map(|model::Failure::CriticalStretch(failure)| failure);
        let own = material.fracture_energy.is_some() || material.critical_stretch.is_some();
        let energy = if own {
            material.fracture_energy.clone()
        } else {
            let general = failure.and_then(|failure| failure.fracture_energy);
            let general = general.or(library.and_then(|library| library.values().fracture_energy));
            general.filter(|_| failure.is_none_or(|failure| failure.stretch.is_none())).map(Formula::Number)
        };
        let stretch = if own {
            material.critical_stretch.clone()
        } else {
            failure.and_then(|failure| failure.stretch).map(Formula::Number)
        };
        let energy = at(&energy, "fracture_energy", scatter(|r| r.fracture_energy))?;
        let stretch = at(&stretch, "critical_stretch", scatter(|r| r.critical_stretch))?;
        let poisson = self.poisson(material);
        for (i, &slot) in slots.iter().enumerate() {
            let values = Values { young: young[i], density: density[i], poisson };
            if i == 0 {
                found.typical.push(values);
            }
            let slot = slot as usize;
            (found.young[slot], found.density[slot]) = (values.young, values.density);
            found.stretch[slot] = match (&energy, &stretch) {
                (Some(energy), _) => critical(&values, energy[i]),
                (None, Some(stretch)) => stretch[i],
                (None, None) => f64::INFINITY,
            };
        }
        Ok(())
    }

    /// Multiplies values by a random field of mean 1.
    fn scatter(
        &self,
        values: &mut [f64],
        random: &Random,
        deviation: f64,
        cloud: &Cloud<D>,
        slots: &[u32],
        path: &str,
    ) -> Result<()> {
        let field = RandomField { seed: random.seed, length: random.length.unwrap_or(0.0) };
        let Some(numbers) = field.at(cloud) else {
            let message = "so short a length beside the size of the body needs too fine a grid";
            return Err(self.refuse(&format!("{path}.random.length"), message, "leave it out: each point by itself"));
        };
        // Of a log-normal distribution with mean 1: the deviation of the logarithm.
        let spread = (1.0 + deviation * deviation).ln().sqrt();
        for (value, &slot) in values.iter_mut().zip(slots) {
            let number = numbers[slot as usize];
            *value *= match random.distribution {
                Distribution::LogNormal => (spread * number - 0.5 * spread * spread).exp(),
                Distribution::Normal => 1.0 + deviation * number,
            };
        }
        Ok(())
    }

    /// `point 17 at (0.0015, 0.002) m`
    fn place(&self, cloud: &Cloud<D>, slot: u32) -> String {
        let point = cloud.slots.iter().position(|other| *other == slot).unwrap_or(0);
        format!("point {point} at {} m", rounded(&cloud.position(slot as usize)))
    }

    /// How the constants of bonds differ from those of `reference`; None where they do not.
    pub(super) fn heterogeneity(
        &self,
        body: &Body<D>,
        composition: &Composition,
        reference: &Values,
    ) -> Option<Arc<Heterogeneity>> {
        let n = composition.names.len();
        let mut table = PairTable { materials: composition.material.clone(), factors: vec![1.0; n * n], n };
        // Slots without a point are of no material; their bonds do not exist.
        table.materials.iter_mut().for_each(|material| *material = (*material).min(n as u8 - 1));
        for interface in &self.case.value.physics.elastic().interfaces {
            let [a, b] = self.pair(composition, &interface.between);
            if let Some(young) = interface.young {
                let factor = young / harmonic_mean(composition, a, b);
                (table.factors[a * n + b], table.factors[b * n + a]) = (factor, factor);
            }
        }
        let relative: Vec<f64> = composition.young.iter().map(|young| young / reference.young).collect();
        let pairs = table.factors.iter().any(|factor| *factor != 1.0).then_some(table);
        if pairs.is_none() && relative.iter().all(|&c| c == 1.0 || c == 0.0) {
            return None;
        }
        Some(Arc::new(Heterogeneity::new(body, &relative, pairs)))
    }

    /// What is known of each material before the first step: of its points, the fastest waves and the smallest step and
    /// critical stretch.
    pub(super) fn summaries<P: Packs>(
        &self,
        elasticity: &mut Elasticity<D, P>,
        composition: Option<&Composition>,
        reference: &Values,
        hypothesis: Hypothesis,
    ) -> Vec<MaterialSummary> {
        let state_based = self.law().is_state_based();
        let speeds = |values: &Values| {
            let Stiffness { c11, c12 } = match state_based {
                true => hypothesis.stiffness_with(values.young, values.poisson),
                false => hypothesis.stiffness(values.young),
            };
            let speed = |modulus: f64| (modulus / values.density).sqrt();
            let [longitudinal, shear] = [c11, 0.5 * (c11 - c12)].map(speed);
            let rayleigh = (D > 1).then(|| moduli::rayleigh_speed_between(longitudinal, shear));
            (speed(values.young), longitudinal, (D > 1).then_some(shear), rayleigh)
        };
        let all = Arc::from(&elasticity.body.cloud.slots[..]);
        let parts: Vec<(String, Arc<[u32]>)> = match composition {
            None => vec![(String::new(), all)],
            Some(composition) => composition.names.iter().cloned().zip(composition.slots.iter().cloned()).collect(),
        };
        let number = |(k, (name, slots)): (usize, (String, Arc<[u32]>))| {
            let values = |slot: &u32| match composition {
                None => *reference,
                Some(found) => {
                    let slot = *slot as usize;
                    Values { young: found.young[slot], density: found.density[slot], poisson: found.poisson(slot) }
                }
            };
            let fastest = slots.iter().map(values).max_by(|a, b| {
                let [a, b] = [a, b].map(|values| values.young / values.density);
                a.total_cmp(&b)
            });
            let (bar_speed, longitudinal_speed, shear_speed, rayleigh_speed) = speeds(&fastest.unwrap_or(*reference));
            // Of the rows of its points: all others as if they could not move.
            let density = match composition.filter(|found| found.names.len() > 1) {
                None => elasticity.density.clone(),
                Some(found) => elasticity.density.only(found.material.len(), |slot| found.material[slot] == k as u8),
            };
            let (material, mut on, _) = elasticity.parts();
            let stable_step = material.stable_step(&mut on, &density);
            let failure = on.failure;
            let stretch =
                |slot: &u32| failure.map_or(f64::INFINITY, |failure| failure.of(*slot as usize, *slot as usize));
            let critical = slots.iter().map(stretch).fold(f64::INFINITY, f64::min);
            let cloud = &on.body.cloud;
            MaterialSummary {
                name,
                points: slots.len(),
                volume: slots.iter().map(|&slot| cloud.volume(slot as usize)).sum(),
                bar_speed,
                longitudinal_speed,
                shear_speed,
                rayleigh_speed,
                stable_step,
                critical_stretch: critical.is_finite().then_some(critical),
            }
        };
        parts.into_iter().enumerate().map(number).collect()
    }

    /// The numbers of two materials; `check` knows their names.
    fn pair(&self, composition: &Composition, names: &[String]) -> [usize; 2] {
        [0, 1].map(|k| composition.names.iter().position(|name| *name == names[k]).unwrap_or(0))
    }

    /// The rule of a body of several materials. `critical` as of [`composition`](Self::composition).
    pub(super) fn failure_by_material(
        &self,
        cloud: &Cloud<D>,
        composition: &Composition,
        critical: Critical<'_>,
    ) -> Result<Option<CriticalStretch>> {
        let elasticity = self.case.value.physics.elastic();
        let Some(model::Failure::CriticalStretch(failure)) = &elasticity.failure else { return Ok(None) };
        let mut rules = Vec::new();
        for interface in &elasticity.interfaces {
            let [a, b] = self.pair(composition, &interface.between);
            let stretch = match (interface.fracture_energy, interface.stretch) {
                (Some(energy), _) => self.critical_between(composition, [a, b], interface.young, energy, critical),
                (None, Some(stretch)) => stretch,
                (None, None) => continue,
            };
            rules.push(PairRule { between: (interface.between[0].clone(), interface.between[1].clone()), stretch });
        }
        for pair in &failure.pairs {
            let between = (pair.between[0].clone(), pair.between[1].clone());
            let material = |name: &String| composition.names.iter().position(|other| other == name);
            let stretch = match (pair.fracture_energy, material(&between.0).zip(material(&between.1))) {
                (Some(energy), Some((a, b))) => self.critical_between(composition, [a, b], None, energy, critical),
                // Of other sets, as if they were of the first material.
                (Some(energy), None) => critical(&composition.typical[0], energy),
                (None, _) => pair.stretch.unwrap_or(f64::INFINITY),
            };
            rules.push(PairRule { between, stretch });
        }
        let path = "physics.elasticity.failure.critical_stretch";
        CriticalStretch::by_material(cloud, composition.stretch.clone(), &rules, &failure.no_fail)
            .map(Some)
            .map_err(|e| self.refuse(path, format!("failure rules: {e}"), ""))
    }

    /// s₀ of a fracture energy (J/m²) of the bonds between two materials: s₀² is the energy over that of a unit stretch, which of
    /// springs goes with their constant, and is the mean of both where each end pulls with its own.
    fn critical_between(
        &self,
        composition: &Composition,
        [a, b]: [usize; 2],
        young: Option<f64>,
        energy: f64,
        critical: Critical<'_>,
    ) -> f64 {
        let [here, there] = [a, b].map(|k| &composition.typical[k]);
        if self.law().is_state_based() {
            let [s, t] = [here, there].map(|values| critical(values, energy));
            return (2.0 / (s.powi(-2) + t.powi(-2))).sqrt();
        }
        let young = young.unwrap_or(harmonic_mean(composition, a, b));
        critical(&Values { young, ..*here }, energy)
    }
}

/// Of the Young's moduli of two materials at a typical point.
fn harmonic_mean(composition: &Composition, a: usize, b: usize) -> f64 {
    let [a, b] = [a, b].map(|k| composition.typical[k].young);
    2.0 / (1.0 / a + 1.0 / b)
}
