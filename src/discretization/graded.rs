//! The standard scheme where horizons differ: micromoduli that scale with the horizon, and bonds whose ends disagree.
//!
//! Bobaru et al. 2009, section 4: a horizon g times as small needs a micromodulus g^(D+1) times as large, so that the
//! moduli stay what they are (eqs. (35), (36): c(ξ; δ) = g^(D+1) c(gξ; gδ), g = δ₀/δ). With
//!
//! ```text
//! k(δ, h) = c₀ (δ₀/δ)^(D+1) ω(|ξ|/δ) β(ξ; h, δ)
//! ```
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
pub struct Scaling {
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
}

impl Grading {
    fn end(&self, slot: usize) -> End {
        End { size: self.sizes[slot], horizon: self.horizons[slot] }
    }
}

impl Scaling {
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
        self.rule.reach::<D>(largest(&grading.sizes), largest(&grading.horizons))
    }

    /// Whether the bond has any weight at one of its ends.
    fn touches<const D: usize>(&self, rule: Rule, here: End, there: End, xi: &Vector<D>) -> bool {
        let length = norm(xi);
        let touches = |horizon, size| match self.rule.radial(length, size, horizon) {
            Some(beta) => beta > 0.0,
            None => self.rule.touches(xi, size, horizon),
        };
        match rule {
            Rule::Source => touches(here.horizon, there.size),
            Rule::Average => touches(here.horizon.max(there.horizon), here.size.max(there.size)),
            Rule::Dual => touches(here.horizon, there.size) || touches(there.horizon, here.size),
        }
    }

    /// β and k of a bond, per unit of volume at its other end.
    pub(super) fn bond<const D: usize>(&self, rule: Rule, here: End, there: End, xi: &Vector<D>) -> [f64; 2] {
        let length = norm(xi);
        let part = |horizon: f64, size: f64| {
            let beta = self.rule.radial(length, size, horizon).unwrap_or_else(|| self.rule.fraction(xi, size, horizon));
            let scale = (self.horizon / horizon).powi(D as i32 + 1);
            [beta, self.strength * scale * self.influence.quadrature_value(length / horizon) * beta]
        };
        let mean = |a: [f64; 2], b: [f64; 2]| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        // Sums of two and of two pairs: the same bits seen from the other end.
        let both = |horizon| mean(part(horizon, here.size), part(horizon, there.size));
        match rule {
            Rule::Source => part(here.horizon, there.size),
            Rule::Average => mean(both(here.horizon), both(there.horizon)),
            Rule::Dual => mean(part(here.horizon, there.size), part(there.horizon, here.size)),
        }
    }

    /// β and k of the bonds of a point, with its neighbours.
    fn row<const D: usize>(
        &self,
        body: &Body<D>,
        point: usize,
        mut each: impl FnMut(usize, usize, &Vector<D>, [f64; 2]),
    ) {
        let uniform = End { size: body.cloud.spacing, horizon: body.horizon };
        let end = |slot| body.grading.as_ref().map_or(uniform, |grading| grading.end(slot));
        // Where all ends are alike, so are the rules.
        let rule = body.grading.as_ref().map_or(Rule::Source, |grading| grading.rule);
        // Padding stands behind the bonds of a point, so that these are numbered one by one.
        for (k, (bit, j)) in body.bonds_of(point).enumerate() {
            let xi = body.xi(bit, point, j);
            each(k, j, &xi, self.bond(rule, end(point), end(j), &xi));
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
