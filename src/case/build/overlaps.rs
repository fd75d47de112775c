//! Two conditions on one component of one point: who acts there, or that nobody can tell.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use super::super::model::Motion;
use super::Builder;
use super::conditions::rounded;
use crate::error::Result;
use crate::geometry::Cloud;

/// Instants at which formulas of time are compared, beside the first.
const INSTANTS: u32 = 64;
/// What may be between equal values, relative to the larger: some roundings of one formula written in two ways.
const ROUNDING: f64 = 1e-12;

/// What two conditions may both want to set: `initial` or `prescribe`, and the component of what.
type Wanted = (&'static str, &'static str, usize);

impl<const D: usize> Builder<'_, D> {
    /// Slots of the points at which each condition sets values, of those that do. Where several conditions want the same value of
    /// a point it belongs to the one that holds longest, of these the first; where they want different ones to that which has
    /// `override`, if it is the later one.
    pub(super) fn owned(&self, cloud: &Cloud<D>) -> Result<BTreeMap<usize, Arc<[u32]>>> {
        let mut owners: HashMap<(Wanted, u32), usize> = HashMap::new();
        let mut sets: BTreeMap<usize, Arc<[u32]>> = BTreeMap::new();
        let mut shared = false;
        for k in 0..self.case.value.conditions.len() {
            let (Some((wanted, _)), Some(on)) = (self.wanted(k), &self.case.value.conditions[k].on) else { continue };
            let slots = self.slots(on, cloud, &format!("conditions[{k}].on"))?;
            let mut met: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
            for &slot in slots.iter() {
                match owners.get(&(wanted, slot)) {
                    Some(&other) => met.entry(other).or_default().push(slot),
                    None => {
                        owners.insert((wanted, slot), k);
                    }
                }
            }
            for (other, both) in met {
                shared = true;
                if self.prevails(k, other, both.clone().into(), cloud)? {
                    both.into_iter().for_each(|slot| {
                        owners.insert((wanted, slot), k);
                    });
                }
            }
            sets.insert(k, slots);
        }
        if !shared {
            return Ok(sets);
        }
        let mine = |(k, slots): (usize, Arc<[u32]>)| {
            let Some((wanted, _)) = self.wanted(k) else { return (k, slots) };
            (k, slots.iter().copied().filter(|slot| owners.get(&(wanted, *slot)) == Some(&k)).collect())
        };
        Ok(sets.into_iter().map(mine).collect())
    }

    /// What condition `k` sets, and by which formula.
    fn wanted(&self, k: usize) -> Option<(Wanted, &Motion)> {
        let condition = &self.case.value.conditions[k];
        let (key, motion) = match (&condition.initial, &condition.prescribe) {
            (Some(motion), _) => ("initial", motion),
            (None, Some(motion)) => ("prescribe", motion),
            (None, None) => return None,
        };
        // A prescribed displacement and a prescribed velocity are both a motion; initial ones are two things.
        let what = if key == "prescribe" { "motion" } else { motion.name() };
        Some(((key, what, motion.component()), motion))
    }

    /// Whether condition `k` and not the `other` before it sets the values at points that `both` are on.
    fn prevails(&self, k: usize, other: usize, both: Arc<[u32]>, cloud: &Cloud<D>) -> Result<bool> {
        let conditions = &self.case.value.conditions;
        let (Some(((key, ..), mine)), Some((_, theirs))) = (self.wanted(k), self.wanted(other)) else {
            return Ok(false);
        };
        let until = [k, other].map(|k| conditions[k].until.unwrap_or(f64::INFINITY));
        let path = format!("conditions[{k}].{key}");
        let contradiction = self.contradiction([(k, mine), (other, theirs)], &both, cloud)?;
        let Some(contradiction) = contradiction else { return Ok(until[0] > until[1]) };
        if !conditions[k].overrides {
            let message = format!(
                "conditions[{other}] on `{}` wants another value of {} points: {contradiction}",
                conditions[other].on.as_deref().unwrap_or_default(),
                both.len()
            );
            let help = format!(
                "take the points out of one of the sets, or write `override = true` into `conditions[{k}]`, if it is an exception to \
                 conditions[{other}]"
            );
            return Err(self.refuse(&path, message, &help));
        }
        if until[0] < until[1] {
            let message = format!(
                "this exception ends at t = {} s, before conditions[{other}] that it overrides, and what holds then is not said",
                until[0]
            );
            return Err(self.refuse(
                &path,
                message,
                "let both end together, or write one formula with `if(t < ..., ..., ...)`",
            ));
        }
        Ok(true)
    }

    /// Where and how two conditions differ, as long as both hold.
    fn contradiction(&self, of: [(usize, &Motion); 2], both: &Arc<[u32]>, cloud: &Cloud<D>) -> Result<Option<String>> {
        let [a, b] = of.map(|(_, motion)| motion);
        let at = |slot: u32| {
            let point = cloud.slots.iter().position(|s| *s == slot).unwrap_or(0);
            format!("at point {point}, position {} m", rounded(&cloud.position(slot as usize)))
        };
        if a.name() != b.name() {
            return Ok(Some(format!("{} it prescribes the {}, this one the {}", at(both[0]), b.name(), a.name())));
        }
        if a.value() == b.value() {
            return Ok(None);
        }
        let profile = |(k, motion): (usize, &Motion)| {
            let key = if self.case.value.conditions[k].initial.is_some() { "initial" } else { "prescribe" };
            let path = format!("conditions[{k}].{key}.{}.value", motion.name());
            Ok(self.profile(motion.value(), cloud, both, &path)?.until(self.last_instant(k)))
        };
        let [mut mine, mut theirs] = [profile(of[0])?, profile(of[1])?];
        let end = if self.case.value.conditions[of[0].0].initial.is_some() {
            0.0
        } else {
            self.last_instant(of[0].0).min(self.last_instant(of[1].0))
        };
        for instant in 0..=INSTANTS {
            // Not in equal steps, which whole periods of a formula would meet at the same phase.
            let share = f64::from(instant) / f64::from(INSTANTS);
            let t = end * share * (0.7 + 0.3 * share);
            let (mine, theirs) = (mine.at(t), theirs.at(t));
            let differ = |(x, y): (&f64, &f64)| (x - y).abs() > ROUNDING * x.abs().max(y.abs());
            if let Some(k) = mine.iter().zip(theirs).position(differ) {
                return Ok(Some(format!("{}, at t = {t} s it is {} and here {}", at(both[k]), theirs[k], mine[k])));
            }
        }
        Ok(None)
    }
}
