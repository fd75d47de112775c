//! Brittle failure: a bond breaks, for good, when its stretch passes the critical stretch.
//!
//! μ(ξ, t) = 1 while s(t′) ≤ s₀ for all t′ ≤ t, else 0 (Shojaei et al. 2022, eqs. (18)–(20)). The critical stretch may
//! differ from set to set and across sets; bonds that touch a no-fail set never break.

use crate::geometry::Cloud;

/// The critical stretch of every pair of points, by classes of points.
#[derive(Debug, Clone)]
pub struct CriticalStretch {
    /// Class of each slot; empty when all points are alike.
    classes: Vec<u8>,
    n_classes: usize,
    /// s₀ of a bond between two classes, row by row; infinite where bonds never break, NaN where that is the smaller of what
    /// both ends have.
    table: Vec<f64>,
    /// s₀ by slot, of the material there; empty where no pair of classes leaves it to the ends.
    own: Vec<f64>,
    smallest: f64,
    /// √(δ₀/δ) of each slot; empty when horizons are alike.
    scales: Vec<f64>,
}

/// A critical stretch for the bonds between two sets, or within one when both names are the same.
#[derive(Debug, Clone)]
pub struct PairRule {
    pub between: (String, String),
    /// s₀, infinite for bonds that never break.
    pub stretch: f64,
}

impl CriticalStretch {
    /// The same s₀ for every bond.
    pub fn uniform(stretch: f64) -> Self {
        CriticalStretch {
            classes: Vec::new(),
            n_classes: 1,
            table: vec![stretch],
            own: Vec::new(),
            smallest: stretch,
            scales: Vec::new(),
        }
    }

    /// `stretch` everywhere, except where a rule speaks (a later rule wins), and no failure at the points of `no_fail`.
    ///
    /// Returns the name of a set that the cloud does not have, or the number of classes when it passes 256.
    pub fn new<const D: usize>(
        cloud: &Cloud<D>,
        stretch: f64,
        rules: &[PairRule],
        no_fail: &[String],
    ) -> Result<Self, String> {
        if rules.is_empty() && no_fail.is_empty() {
            return Ok(Self::uniform(stretch));
        }
        let mut names: Vec<&str> = rules.iter().flat_map(|r| [r.between.0.as_str(), r.between.1.as_str()]).collect();
        names.extend(no_fail.iter().map(String::as_str));
        names.sort_unstable();
        names.dedup();
        // Each distinct combination of memberships is a class.
        let mut members = vec![0u64; cloud.n_slots()];
        if names.len() > 64 {
            return Err(format!("{} sets in failure rules; at most 64", names.len()));
        }
        for (k, name) in names.iter().enumerate() {
            let set = cloud.sets.get(name).ok_or_else(|| (*name).to_string())?;
            for &slot in set.iter() {
                members[slot as usize] |= 1 << k;
            }
        }
        if let Some(images) = &cloud.images {
            images.copy(&mut members);
        }
        let mut combinations = members.clone();
        combinations.sort_unstable();
        combinations.dedup();
        if combinations.len() > 256 {
            return Err(format!("{} combinations of sets in failure rules; at most 256", combinations.len()));
        }
        let classes = members.iter().map(|m| combinations.binary_search(m).unwrap_or(0) as u8).collect();
        let bit = |name: &str| 1u64 << names.iter().position(|n| *n == name).unwrap_or(0);
        let spared: u64 = no_fail.iter().map(|name| bit(name)).fold(0, |a, b| a | b);
        let mut table = Vec::with_capacity(combinations.len().pow(2));
        for &here in &combinations {
            for &there in &combinations {
                let mut value = stretch;
                for rule in rules {
                    let (a, b) = (bit(&rule.between.0), bit(&rule.between.1));
                    if (here & a != 0 && there & b != 0) || (here & b != 0 && there & a != 0) {
                        value = rule.stretch;
                    }
                }
                table.push(if (here | there) & spared != 0 { f64::INFINITY } else { value });
            }
        }
        let smallest = table.iter().copied().fold(f64::INFINITY, f64::min);
        let (n_classes, own, scales) = (combinations.len(), Vec::new(), Vec::new());
        Ok(CriticalStretch { classes, n_classes, table, own, smallest, scales })
    }

    /// As [`CriticalStretch::new`] for a body of several materials: where no rule speaks, s₀ of a bond is the smaller of `own` of
    /// its ends, by slot; infinite where bonds never break.
    pub fn by_material<const D: usize>(
        cloud: &Cloud<D>,
        own: Vec<f64>,
        rules: &[PairRule],
        no_fail: &[String],
    ) -> Result<Self, String> {
        let mut found = Self::new(cloud, f64::NAN, rules, no_fail)?;
        // `min` passes over what is not a number.
        let least = cloud.slots.iter().map(|&slot| own[slot as usize]).fold(f64::INFINITY, f64::min);
        found.smallest = found.table.iter().copied().fold(least, f64::min);
        found.own = own;
        Ok(found)
    }

    /// The same fracture energy where horizons differ: s₀ goes with 1/√δ, and a bond takes the mean of its ends. `horizons`
    /// by slot; `horizon`: that for which s₀ was given.
    pub fn scaled(mut self, horizons: &[f64], horizon: f64) -> Self {
        self.scales = horizons.iter().map(|delta| (horizon / delta).sqrt()).collect();
        let least = self.scales.iter().copied().fold(f64::INFINITY, f64::min);
        self.smallest *= least;
        self
    }

    /// The rule for other points, each of the class of one before: `from` by slot.
    pub fn inherited(&self, from: &[usize]) -> Self {
        let classes =
            if self.classes.is_empty() { Vec::new() } else { from.iter().map(|&k| self.classes[k]).collect() };
        let own = if self.own.is_empty() { Vec::new() } else { from.iter().map(|&k| self.own[k]).collect() };
        // Without scales again.
        let least = own.iter().copied().fold(f64::INFINITY, f64::min);
        let smallest = self.table.iter().copied().fold(least, f64::min);
        let (table, n_classes) = (self.table.clone(), self.n_classes);
        CriticalStretch { classes, n_classes, table, own, smallest, scales: Vec::new() }
    }

    /// Which rule speaks at a slot.
    pub fn class(&self, slot: usize) -> u8 {
        self.classes.get(slot).copied().unwrap_or(0)
    }

    /// The smallest s₀ of any bond.
    pub fn smallest(&self) -> f64 {
        self.smallest
    }

    /// s₀ of the bond between two slots.
    #[inline]
    pub fn of(&self, here: usize, there: usize) -> f64 {
        let mut stretch = if self.classes.is_empty() {
            self.table[0]
        } else {
            self.table[self.classes[here] as usize * self.n_classes + self.classes[there] as usize]
        };
        if stretch.is_nan() {
            stretch = self.own[here].min(self.own[there]);
        }
        if self.scales.is_empty() { stretch } else { stretch * (0.5 * (self.scales[here] + self.scales[there])) }
    }

    /// Bytes that the classes take.
    pub fn memory(&self) -> usize {
        self.classes.len() + size_of_val(&self.scales[..]) + size_of_val(&self.own[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_hold_both_ways_later_ones_win_and_no_fail_beats_all() {
        let mut cloud = Cloud::scattered((0..4).map(|i| [f64::from(i)]).collect(), vec![1.0; 4]);
        cloud.sets.insert("left", vec![0, 1]);
        cloud.sets.insert("right", vec![2, 3]);
        cloud.sets.insert("grip", vec![3]);
        let rule = |a: &str, b: &str, stretch| PairRule { between: (a.into(), b.into()), stretch };
        let rules = [rule("left", "left", 0.2), rule("left", "right", 0.05)];
        let s = CriticalStretch::new(&cloud, 0.1, &rules, &["grip".into()]).unwrap();
        assert_eq!((s.of(0, 1), s.of(1, 2), s.of(2, 1), s.of(2, 2)), (0.2, 0.05, 0.05, 0.1));
        assert_eq!((s.of(3, 2), s.of(0, 3)), (f64::INFINITY, f64::INFINITY));
        assert_eq!(s.smallest(), 0.05);
        let own = vec![0.3, 0.4, 0.02, f64::INFINITY];
        let s = CriticalStretch::by_material(&cloud, own, &[rule("left", "right", 0.05)], &[]).unwrap();
        assert_eq!((s.of(0, 1), s.of(1, 0), s.of(1, 2), s.of(2, 3), s.of(3, 3)), (0.3, 0.3, 0.05, 0.02, f64::INFINITY));
        assert_eq!(s.smallest(), 0.02);
        assert_eq!(CriticalStretch::new(&cloud, 0.1, &[], &["gripp".into()]).unwrap_err(), "gripp");
    }
}
