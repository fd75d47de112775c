//! The standard scheme where horizons differ: micromoduli that scale with the horizon, and bonds whose ends disagree.
//!
//! Bobaru et al. 2009, section 4: a horizon g times as small needs a micromodulus g^(D+1) times as large, so that the
//! moduli stay what they are (eqs. (35), (36): c(ξ; δ) = g^(D+1) c(gξ; gδ), g = δ₀/δ). With
//!
//! ```text
//! k(δ, h) = c₀ (δ₀/δ)^(D+1) ω(|ξ|/δ) β(ξ; h, δ)
//! ```
//!
//! and β the part of the cell within the horizon, wherever in its cell the point is,
//!
//! the weight of a bond from x (h, δ, V) to x′ (h′, δ′, V′) is V′ times
//!
//! ```text
//! source    k(δ, h′)
//! average   ¼ (k(δ, h) + k(δ, h′) + k(δ′, h) + k(δ′, h′))
//! dual      ½ (k(δ, h′) + k(δ′, h))
//! ```
//!
//! Average and dual are symmetric, so that momentum is kept. A surface correction multiplies the weight by λ(x, x′); a
//! body of one horizon then has a weight for each bond too, and is the case of equal ends.

use super::standard::{BondWeights, CloudWeights, Operator};
use super::{Correction, Influence, PartialVolume};
use crate::family::{Body, Families, GROUP, Grading, Rule, Update};
use crate::field::{Vector, norm};
use crate::geometry::Cloud;

/// How bonds are weighted on a body whose horizons differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BondWeighting {
    /// c₀, the micromodulus constant at the horizon δ₀ (m).
    pub strength: f64,
    pub horizon: f64,
    pub influence: Influence,
    pub rule: PartialVolume,
}

/// The cell and the horizon of one end of a bond, m.
#[derive(Debug, Clone, Copy)]
pub(super) struct End {
    pub size: f64,
    pub horizon: f64,
    /// From the point to the centre of its cell.
    pub shift: [f64; 3],
}

impl Grading {
    fn end(&self, slot: usize) -> End {
        let shift = self.shifts.get(slot).copied().unwrap_or_default();
        End { size: self.sizes[slot], horizon: self.horizons[slot], shift }
    }
}

impl BondWeighting {
    /// A body with these horizons.
    pub fn body<const D: usize>(&self, cloud: Cloud<D>, grading: Grading) -> Body<D> {
        let (reach, ends) = (self.reach::<D>(&grading), grading.clone());
        Body::graded(cloud, grading, reach, &|i, j, xi| self.touches(ends.rule, ends.end(i), ends.end(j), xi))
    }

    /// The body with other points; see [`Body::replaced`].
    pub fn replaced<const D: usize>(
        &self,
        body: &Body<D>,
        cloud: Cloud<D>,
        grading: Grading,
        same: &[u32],
    ) -> (Body<D>, Update) {
        let before = body.grading.as_ref().map_or(0.0, |grading| self.reach::<D>(grading));
        let (reach, ends) = (self.reach::<D>(&grading).max(before), grading.clone());
        let touches = |i: usize, j: usize, xi: &Vector<D>| self.touches(ends.rule, ends.end(i), ends.end(j), xi);
        body.replaced(cloud, grading, same, reach, &touches)
    }

    /// The largest distance of any two neighbours, m.
    fn reach<const D: usize>(&self, grading: &Grading) -> f64 {
        let largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let shift = grading.shifts.iter().map(norm).fold(0.0, f64::max);
        self.rule.reach::<D>(largest(&grading.sizes), largest(&grading.horizons)) + shift
    }

    /// From one end, `xi` away, to the place that decides how much of the cell of the other counts: its centre, or the point
    /// itself where cells count whole or not at all.
    fn place<const D: usize>(&self, xi: &Vector<D>, there: End) -> Vector<D> {
        match self.rule {
            PartialVolume::None => *xi,
            PartialVolume::Ramp | PartialVolume::Exact => std::array::from_fn(|d| xi[d] + there.shift[d]),
        }
    }

    /// Whether the bond has any weight at one of its ends.
    fn touches<const D: usize>(&self, rule: Rule, here: End, there: End, xi: &Vector<D>) -> bool {
        let (to, back) = (self.place(xi, there), self.place(&xi.map(|x| -x), here));
        let touches = |place: &Vector<D>, size, horizon| match self.rule.radial(norm(place), size, horizon) {
            Some(beta) => beta > 0.0,
            None => self.rule.touches(place, size, horizon),
        };
        match rule {
            Rule::Source => touches(&to, there.size, here.horizon),
            Rule::Average => {
                let [size, horizon] = [here.size.max(there.size), here.horizon.max(there.horizon)];
                touches(&to, size, horizon) || touches(&back, size, horizon)
            }
            Rule::Dual => touches(&to, there.size, here.horizon) || touches(&back, here.size, there.horizon),
        }
    }

    /// β and k of a bond, per unit of volume at its other end.
    pub(super) fn bond<const D: usize>(&self, rule: Rule, here: End, there: End, xi: &Vector<D>) -> [f64; 2] {
        let length = norm(xi);
        let (to, back) = (self.place(xi, there), self.place(&xi.map(|x| -x), here));
        let part = |horizon: f64, place: &Vector<D>, size: f64| {
            let radial = self.rule.radial(norm(place), size, horizon);
            let beta = radial.unwrap_or_else(|| self.rule.fraction(place, size, horizon));
            let scale = (self.horizon / horizon).powi(D as i32 + 1);
            [beta, self.strength * scale * self.influence.quadrature_value(length / horizon) * beta]
        };
        let mean = |a: [f64; 2], b: [f64; 2]| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        // Sums of two and of two pairs: the same bits seen from the other end.
        let both = |horizon| mean(part(horizon, &back, here.size), part(horizon, &to, there.size));
        match rule {
            Rule::Source => part(here.horizon, &to, there.size),
            Rule::Average => mean(both(here.horizon), both(there.horizon)),
            Rule::Dual => mean(part(here.horizon, &to, there.size), part(there.horizon, &back, here.size)),
        }
    }

    /// β and k of the bonds of a point, with its neighbours.
    fn row<const D: usize>(
        &self,
        body: &Body<D>,
        point: usize,
        mut each: impl FnMut(usize, usize, &Vector<D>, [f64; 2]),
    ) {
        let uniform = End { size: body.cloud.spacing, horizon: body.horizon, shift: [0.0; 3] };
        let end = |slot| body.grading.as_ref().map_or(uniform, |grading| grading.end(slot));
        // Where all ends are alike, so are the rules.
        let rule = body.grading.as_ref().map_or(Rule::Source, |grading| grading.rule);
        // Padding stands behind the bonds of a point, so that these are numbered one by one.
        for (k, (bit, j)) in body.bonds_of(point).enumerate() {
            let xi = body.xi(bit, point, j);
            let (here, there) = (end(point), end(j));
            let values = if self.rule == PartialVolume::None && here.horizon == there.horizon {
                // Whole cells, and the family says which.
                let scale = (self.horizon / here.horizon).powi(D as i32 + 1);
                let influence = self.influence.quadrature_value(norm(&xi) / here.horizon);
                [1.0, self.strength * scale * influence]
            } else {
                self.bond(rule, here, there, &xi)
            };
            each(k, j, &xi, values);
        }
    }

    /// The weights of all bonds, corrected if asked. `old`: an operator and its body, whose weights are taken over where
    /// families are.
    pub fn operator<const D: usize>(
        &self,
        body: &Body<D>,
        update: &Update,
        old: Option<(&Operator, &Body<D>)>,
        correction: Option<&Correction<D>>,
    ) -> Operator {
        let Families::Cloud(families) = &body.families else {
            // All points of a lattice have one horizon, and share what they have.
            return Operator::standard(body, self.strength, self.influence, self.rule);
        };
        let old = old.and_then(|(operator, body)| match &body.families {
            Families::Cloud(families) => operator.stored().map(|stored| (families, stored)),
            Families::Lattice(_) => None,
        });
        let weights = update.carry(old.map(|(f, (weights, _))| (f, weights)), families, GROUP, |point, row| {
            self.row(body, point, |k, other, xi, [_, weight]| {
                row[k] = correction.map_or(weight, |correction| weight * correction.factor(point, other, xi));
            });
        });
        let fractions = update.carry(old.map(|(f, (_, fractions))| (f, fractions)), families, GROUP, |point, row| {
            self.row(body, point, |k, _, _, [beta, _]| row[k] = (beta * 65535.0).round() as u16);
        });
        let horizons = body.grading.iter().flat_map(|grading| &grading.horizons);
        let smallest = horizons.copied().fold(body.horizon, f64::min);
        Operator {
            weights: BondWeights::stored(CloudWeights::by_bond(weights.into(), smallest)),
            volumes: BondWeights::stored(CloudWeights::by_fraction(fractions.into(), smallest)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_of_a_cell_within_the_horizon_counts_wherever_its_point_is() {
        let scaling =
            BondWeighting { strength: 1.0, horizon: 3.0, influence: Influence::Linear, rule: PartialVolume::Exact };
        let here = End { size: 1.0, horizon: 3.0, shift: [0.1, -0.2, 0.0] };
        let there = End { size: 0.7, horizon: 2.4, shift: [-0.3, 0.15, 0.0] };
        let xi = [2.5, 1.2];
        let [beta, _] = scaling.bond(Rule::Source, here, there, &xi);
        let expected = PartialVolume::Exact.fraction(&[2.5 - 0.3, 1.2 + 0.15], 0.7, 3.0);
        assert!(beta == expected && beta > 0.0 && beta < 1.0, "{beta} {expected}");
        for rule in [Rule::Average, Rule::Dual] {
            let back = scaling.bond(rule, there, here, &xi.map(|x| -x));
            assert_eq!(scaling.bond(rule, here, there, &xi), back, "{rule:?}: both ends see the same bits");
        }
        // Whole or not at all: the point decides.
        let whole = BondWeighting { rule: PartialVolume::None, ..scaling };
        assert_eq!(whole.bond(Rule::Source, here, there, &[2.9, 0.0])[0], 1.0);
        assert_eq!(whole.bond(Rule::Source, here, there, &[3.1, 0.0])[0], 0.0);
    }
}
