//! Surface corrections: the bonds that points near a surface have are made stiffer, for those that they lack.
//!
//! The factor λ of a bond depends on its two ends alike, so that momentum is kept, and is one where both have complete
//! families. Both methods are in the review of Le & Bobaru 2018.

use super::BondWeighting;
use super::graded::End;
use crate::family::{Bond, Rule};
use crate::field::norm;
use crate::geometry::Cloud;
use crate::geometry::cloud::for_each_cell;

/// How bonds are corrected, by what their ends have of what a complete family has.
#[derive(Debug, Clone)]
pub enum Correction<const D: usize> {
    /// λ = 2/(v(x) + v(x′)); by slot v = Σ β V′ over that of a complete family (Bobaru et al. 2016, chapter 2).
    Volume(Vec<f64>),
    /// λ = 1/√(Σ (n_d/ḡ_d)²) with n = ξ/|ξ| and ḡ the mean of both ends' g: an ellipsoid of factors. By slot and axis
    /// g_d = W₀/W_d, W_d the energy density of unit strain along axis d, W₀ that of a complete family (Madenci &
    /// Oterkus 2014, chapter 4).
    Energy(Vec<[f64; D]>),
}

impl<const D: usize> Correction<D> {
    /// The same for points that are stored in other slots.
    pub fn moved(&self, from: &Cloud<D>, to: &Cloud<D>) -> Self {
        fn moved<T: Copy>(values: &[T], from: &[u32], to: &[u32]) -> Vec<T> {
            let mut moved = vec![values[from[0] as usize]; to.len()];
            for (&from, &to) in from.iter().zip(to) {
                moved[to as usize] = values[from as usize];
            }
            moved
        }
        match self {
            Correction::Volume(shares) => Correction::Volume(moved(shares, &from.slots, &to.slots)),
            Correction::Energy(factors) => Correction::Energy(moved(factors, &from.slots, &to.slots)),
        }
    }

    /// λ of the bond ξ (m) between two slots.
    pub fn factor(&self, here: usize, there: usize, xi: &[f64; D]) -> f64 {
        match self {
            Correction::Volume(shares) => 2.0 / (shares[here] + shares[there]),
            Correction::Energy(factors) => {
                let (g, other) = (&factors[here], &factors[there]);
                let square: f64 = (0..D).map(|d| (2.0 * xi[d] / (g[d] + other[d])).powi(2)).sum();
                norm(xi) / square.sqrt()
            }
        }
    }
}

impl BondWeighting {
    /// The bonds of a point on an endless lattice of cells of side `size` (m) with this horizon (m): a complete family.
    /// Weighted, and with β V′ behind.
    pub fn complete<const D: usize>(&self, size: f64, horizon: f64, mut each: impl FnMut(&Bond<D, f64>, f64)) {
        let reach = (self.rule.reach::<D>(size, horizon) / size).ceil() as usize;
        let (end, volume) = (End { size, horizon, shift: [0.0; 3] }, size.powi(D as i32));
        for_each_cell([2 * reach + 1; D], |cell| {
            let xi = cell.map(|c| (c as f64 - reach as f64) * size);
            if cell != [reach; D] && self.rule.touches(&xi, size, horizon) {
                let [beta, k] = self.bond(Rule::Source, end, end, &xi);
                each(&Bond::new(xi, norm(&xi), k * volume), beta * volume);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::{Influence, PartialVolume};

    #[test]
    fn factors_are_the_same_from_both_ends_and_one_inside() {
        let energy = Correction::<3>::Energy(vec![[1.0; 3], [2.0, 1.0, 1.5], [3.0, 1.0, f64::INFINITY]]);
        let volume = Correction::<3>::Volume(vec![1.0, 0.5, 0.25]);
        let xi = [0.3, -0.7, 0.2];
        for (a, b) in [(0, 1), (1, 2), (0, 2)] {
            let back = xi.map(|x| -x);
            assert_eq!(energy.factor(a, b, &xi).to_bits(), energy.factor(b, a, &back).to_bits());
            assert_eq!(volume.factor(a, b, &xi).to_bits(), volume.factor(b, a, &back).to_bits());
        }
        assert_eq!(volume.factor(0, 0, &xi), 1.0);
        // Two roots and their quotient.
        assert!((energy.factor(0, 0, &xi) - 1.0).abs() < 4.0 * f64::EPSILON);
        // Along an axis the factor is the mean of both ends' along it, whatever they lack across.
        assert_eq!(energy.factor(1, 2, &[0.1, 0.0, 0.0]), 2.5);
        assert_eq!(volume.factor(1, 2, &xi), 2.0 / 0.75);
    }

    #[test]
    fn a_complete_family_with_exact_volumes_is_the_ball() {
        let rule = PartialVolume::Exact;
        let scaling = BondWeighting { strength: 1.0, horizon: 3.0, influence: Influence::Constant, rule };
        let mut sum = 0.0;
        scaling.complete::<2>(0.5, 1.7, |_, volume| sum += volume);
        // The point's own cell is no neighbour.
        assert!((sum + 0.25 - std::f64::consts::PI * 1.7 * 1.7).abs() < 1e-12, "{sum}");
    }
}
