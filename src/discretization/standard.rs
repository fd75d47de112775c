//! The standard scheme: one-point quadrature, each bond weighted by strength × ω(|ξ|/δ) × β(ξ) × V′.
//!
//! Shojaei et al. 2022, eqs. (26)–(28). On a lattice the weights are one list, shared by all points. On a cloud they
//! are recomputed from the bond's length whenever it is visited; only the exact partial volumes, which are dear, are
//! stored, as 16-bit fractions (resolution 1.5e-5, the same number at both ends of a bond). Where every bond has a weight
//! of its own, it is stored.

use std::sync::Arc;

use rayon::prelude::*;

use super::rim::moved_edge;
use super::{BondWeighting, Heterogeneity, Influence, PartialVolume};
use crate::family::{Body, CloudFamilies, Families, GROUP, Grading, Offset, Rule, Update};
use crate::field::{Vector, difference, norm};
use crate::geometry::Arrangement;
use crate::geometry::lattice::BLOCK;

/// The weights of one law on one body.
#[derive(Debug, Clone)]
pub struct Operator {
    /// Strength × ω × β × V′: what the law's bond sum is weighted with.
    pub weights: BondWeights,
    /// β × V′ alone: what damage and family volumes are weighted with.
    pub volumes: BondWeights,
}

/// The weight of each bond.
#[derive(Debug, Clone)]
pub struct BondWeights {
    /// By offset, where all points share their family.
    pub by_offset: Vec<f64>,
    /// By length, where each point has its own.
    pub by_length: CloudWeights,
    /// What they are multiplied by, bond by bond; None in a body of one constant.
    pub heterogeneity: Option<Arc<Heterogeneity>>,
}

/// The weight of a bond of a scattered cloud, from its length and the volume at its other end.
#[derive(Debug, Clone)]
pub struct CloudWeights {
    strength: f64,
    influence: Influence,
    horizon: f64,
    spacing: f64,
    fractions: Fractions,
}

/// How the weights of a cloud follow from |ξ|, in a form for many bonds side by side.
#[derive(Debug, Clone)]
pub struct WeightPolynomial<'a> {
    /// Whether they do not: the weight is the volume times `influence[0]`.
    pub plain: bool,
    /// Whether there is no such form.
    pub singly: bool,
    /// strength × ω, per unit of volume, as a polynomial in 1 − |ξ|/δ.
    pub influence: [f64; Influence::TERMS],
    /// 1/δ, 1/m
    pub inverse_horizon: f64,
    /// β = (a − |ξ|) b between zero and one: a, m, and b, 1/m.
    pub ramp: Option<[f64; 2]>,
    /// β × 65535 by bond.
    pub fractions: Option<&'a [u16]>,
    /// Instead of all of the above: the weight by bond and unit of volume, and the unit in which volumes are given.
    pub stored: Option<(&'a [f64], f64)>,
    /// A square of length that vanishes beside |ξ|² in the numbers of the precision, m².
    pub negligible_square: f64,
}

#[derive(Debug, Clone)]
enum Fractions {
    Full,
    Ramp,
    /// β × 65535 by bond.
    Stored(Arc<[u16]>),
    /// Strength × ω × β by bond.
    Weights(Arc<[f64]>),
}

/// A body for the standard scheme: families that hold every x′ whose cell reaches into the horizon of x. In a cloud of cells of
/// several sizes each has its own, and a bond is there if it is for either end.
pub fn body<const D: usize>(cloud: crate::geometry::Cloud<D>, horizon: f64, rule: PartialVolume) -> Body<D> {
    let spacing = cloud.spacing;
    let Arrangement::Scattered { positions, .. } = &cloud.arrangement else {
        return Body::new(cloud, horizon, rule.rim::<D>(spacing, horizon), |xi| rule.touches(xi, spacing, horizon));
    };
    let closed = rule == PartialVolume::None;
    let edge = rule.edge::<D>(spacing, horizon);
    if cloud.is_uniform() {
        let reach = rule.reach::<D>(spacing, horizon);
        let beyond = |_: usize, _: usize, xi: &Vector<D>| rule.beyond(xi, spacing, horizon);
        return match moved_edge(positions, cloud.n_points(), spacing, reach, &beyond, edge, closed) {
            None => Body::new(cloud, horizon, rule.rim::<D>(spacing, horizon), |xi| rule.touches(xi, spacing, horizon)),
            Some(edge) => {
                let rim = 0.0..reach + edge.max(0.0);
                Body::new(cloud, horizon, rim, |xi| rule.beyond(xi, spacing, horizon) <= edge)
            }
        };
    }
    // Each point by its own cell, seen alike from both ends.
    let sizes: Vec<f64> = (0..cloud.n_slots()).map(|slot| cloud.size(slot)).collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let reach = rule.reach::<D>(largest, horizon);
    let beyond =
        |i: usize, j: usize, xi: &Vector<D>| rule.beyond(xi, sizes[i], horizon).min(rule.beyond(xi, sizes[j], horizon));
    let edge = moved_edge(positions, cloud.n_points(), spacing, reach, &beyond, edge, closed).unwrap_or(edge);
    let rim = 0.0..reach + edge.max(0.0);
    let mut body = Body::seeing(cloud, horizon, rim, &|i, j, xi| beyond(i, j, xi) <= edge);
    let horizons = vec![horizon; sizes.len()];
    body.grading = Some(Grading { rule: Rule::Dual, horizons, sizes, shifts: Vec::new() });
    body
}

impl Operator {
    /// `strength`: the law's micromodulus constant, in its own unit (N/m⁶ in 3D elasticity).
    pub fn standard<const D: usize>(
        body: &Body<D>,
        strength: f64,
        influence: Influence,
        rule: PartialVolume,
    ) -> Operator {
        let (horizon, spacing) = (body.horizon, body.cloud.spacing);
        if let (Families::Cloud(_), Some(_)) = (&body.families, &body.grading) {
            let weighting = BondWeighting { strength, horizon, influence, rule };
            return weighting.operator(body, &Update::default(), None, None);
        }
        let mut by_offset = [Vec::new(), Vec::new()];
        let mut fractions = match rule {
            PartialVolume::Ramp => Fractions::Ramp,
            _ => Fractions::Full,
        };
        match &body.families {
            Families::Lattice(families) => {
                let volume = |o: &Offset<D>| rule.fraction(&o.xi, spacing, horizon) * families.lattice.cell_volume();
                let volumes: Vec<f64> = families.offsets.iter().map(volume).collect();
                let weight = |(o, v): (&Offset<D>, &f64)| strength * influence.quadrature_value(o.length / horizon) * v;
                by_offset = [families.offsets.iter().zip(&volumes).map(weight).collect(), volumes];
            }
            Families::Cloud(families) if rule == PartialVolume::Exact => {
                let fraction = |i: usize, j: u32| {
                    let xi: Vector<D> = difference(&body.cloud.position(j as usize), &body.cloud.position(i));
                    (rule.fraction(&xi, spacing, horizon) * 65535.0).round() as u16
                };
                let mut stored: Arc<[u16]> = std::iter::repeat_n(0, families.neighbours.len()).collect();
                let values = Arc::get_mut(&mut stored).expect("nobody else has it yet");
                let pieces = CloudFamilies::pieces(&families.starts, values, GROUP);
                pieces.into_par_iter().for_each(|(points, values)| {
                    let mut values = values.iter_mut();
                    for i in points {
                        for (&j, value) in families.neighbours[families.of(i)].iter().zip(&mut values) {
                            *value = fraction(i, j);
                        }
                    }
                });
                fractions = Fractions::Stored(stored);
            }
            Families::Cloud(_) => {}
        }
        let weights = CloudWeights { strength, influence, horizon, spacing, fractions };
        let volumes = CloudWeights { strength: 1.0, influence: Influence::Constant, ..weights.clone() };
        let [offset_weights, offset_volumes] = by_offset;
        Operator {
            weights: BondWeights { by_offset: offset_weights, by_length: weights, heterogeneity: None },
            volumes: BondWeights { by_offset: offset_volumes, by_length: volumes, heterogeneity: None },
        }
    }

    /// Bytes that the operator keeps for its bonds.
    pub fn memory(&self) -> usize {
        let by_bond = match &self.weights.by_length.fractions {
            Fractions::Stored(f) => 2 * f.len(),
            Fractions::Weights(w) => (2 + 8) * w.len(),
            Fractions::Full | Fractions::Ramp => 0,
        };
        let varied = self.weights.heterogeneity.as_ref().map_or(0, |varied| varied.memory());
        2 * size_of_val(&self.weights.by_offset[..]) + by_bond + varied
    }

    /// The weights by bond, and the fractions of the volumes, where these are stored.
    pub(crate) fn stored(&self) -> Option<(&[f64], &[u16])> {
        match (&self.weights.by_length.fractions, &self.volumes.by_length.fractions) {
            (Fractions::Weights(weights), Fractions::Stored(fractions)) => Some((weights, fractions)),
            _ => None,
        }
    }
}

impl BondWeights {
    /// Of a cloud, by bond.
    pub(super) fn stored(by_length: CloudWeights) -> Self {
        BondWeights { by_offset: Vec::new(), by_length, heterogeneity: None }
    }

    /// The weight of a bond of a body: bit number `bit` of its states, between two slots, with ξ.
    pub fn of<const D: usize>(&self, body: &Body<D>, bit: usize, [here, there]: [usize; 2], xi: &Vector<D>) -> f64 {
        let alike = match &body.families {
            Families::Lattice(families) => self.by_offset[bit / BLOCK % families.offsets.len()],
            Families::Cloud(_) => self.by_length.weight(bit, norm(xi), body.cloud.volume(there)),
        };
        self.heterogeneity.as_ref().map_or(alike, |varied| alike * varied.factor(here, there))
    }
}

impl CloudWeights {
    /// A weight of its own for each bond, per unit of the volume at its other end; `horizon`: the smallest, m.
    pub(super) fn by_bond(weights: Arc<[f64]>, horizon: f64) -> Self {
        Self::alone(Fractions::Weights(weights), horizon)
    }

    /// β × 65535 by bond, and no influence.
    pub(super) fn by_fraction(fractions: Arc<[u16]>, horizon: f64) -> Self {
        Self::alone(Fractions::Stored(fractions), horizon)
    }

    fn alone(fractions: Fractions, horizon: f64) -> Self {
        CloudWeights { strength: 1.0, influence: Influence::Constant, horizon, spacing: horizon, fractions }
    }

    /// The same weights for many bonds side by side, with volumes in multiples of `volume_unit` (m³ in 3D) and numbers
    /// of `single` or double precision.
    pub fn profile(&self, volume_unit: f64, single: bool) -> WeightPolynomial<'_> {
        let terms = self.influence.polynomial();
        let ramp =
            matches!(self.fractions, Fractions::Ramp).then(|| [self.horizon + 0.5 * self.spacing, 1.0 / self.spacing]);
        let fractions = match &self.fractions {
            Fractions::Stored(fractions) => Some(&fractions[..]),
            _ => None,
        };
        let stored = match &self.fractions {
            Fractions::Weights(weights) => Some((&weights[..], volume_unit)),
            _ => None,
        };
        WeightPolynomial {
            plain: matches!((self.influence, &self.fractions), (Influence::Constant, Fractions::Full)),
            singly: terms.is_none(),
            influence: terms.unwrap_or_default().map(|c| c * self.strength * volume_unit),
            inverse_horizon: 1.0 / self.horizon,
            ramp,
            fractions,
            stored,
            negligible_square: self.horizon * self.horizon * if single { 1e-12 } else { 1e-25 },
        }
    }

    /// The weight of bond number `bond`, of length |ξ| (m), to a point of volume V′.
    #[inline]
    pub fn weight(&self, bond: usize, length: f64, volume: f64) -> f64 {
        let fraction = match &self.fractions {
            Fractions::Full => 1.0,
            Fractions::Ramp => super::volume::ramp(length, self.spacing, self.horizon),
            Fractions::Stored(fractions) => f64::from(fractions[bond]) / 65535.0,
            Fractions::Weights(weights) => return weights[bond] * volume,
        };
        self.strength * self.influence.quadrature_value(length / self.horizon) * fraction * volume
    }
}
