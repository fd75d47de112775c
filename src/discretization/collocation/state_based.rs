//! Rows of the state-based solid: its part that comes from dilatation, in two passes.
//!
//! With complete balls and one weighted volume m the linear peridynamic solid is
//!
//! ```text
//! θ(x) = (D/m) ∫ ω ξ · (u(x + ξ) − u(x)) dV
//! f(x) = (k − A G/D²) (D/m) ∫ ω ξ (θ(x + ξ) − θ(x)) dV + (2 A G/m) ∫ ω (ξ ⊗ ξ/|ξ|²) (u(x + ξ) − u(x)) dV
//! ```
//!
//! because ∫ ω ξ dV = 0. The last part is the bond-based law, whose rows are [`Fit::elastic`] with the influence function
//! ω̃ = ω |ξ|/δ and the micromodulus 2 A G/∫ ω̃ |ξ| dV. The first needs one row more, which takes the dilatation from
//! displacements and then the force from dilatations.

use super::{Fit, rows, symmetry};
use crate::discretization::influence::Influence;

impl<const D: usize> Fit<D> {
    /// Weights g_j of θ(x) = Σ_j g_j · (u_j − u) and of ∇θ(x) = Σ_j g_j (θ_j − θ), 1/m.
    ///
    /// `influence` is ω̃. Both are means over the ball, (D/m) ∫ ω ξ p dV: of a polynomial of degree 2 the derivatives at x.
    pub fn dilatation(&self, influence: &Influence) -> Vec<[f64; D]> {
        let moments: Vec<[f64; D]> =
            self.monomials.iter().map(|p| rows::dilatation(*p, influence, self.horizon)).collect();
        let mut weights = vec![[0.0; D]; self.nodes.len()];
        for d in 0..D {
            let row = self.row(&moments.iter().map(|m| m[d]).collect::<Vec<_>>());
            weights.iter_mut().zip(&row[1..]).for_each(|(weight, w)| weight[d] = *w);
        }
        if let Some(steps) = &self.steps {
            symmetry::symmetrise::<D, 1>(steps, weights.as_flattened_mut());
        }
        weights
    }
}

#[cfg(test)]
mod tests {
    use crate::discretization::Collocation;
    use crate::discretization::collocation::Fit;
    use crate::discretization::influence::Influence;
    use crate::discretization::moments::ball_moment;
    use crate::field::Vector;

    const SPACING: f64 = 1e-3;
    const HORIZON: f64 = 3.0 * SPACING;

    /// The two passes at the origin, for u anywhere; k, G in Pa.
    fn force<const D: usize>(
        fit: &Fit<D>,
        influence: &Influence,
        [bulk, shear]: [f64; 2],
        u: &dyn Fn(&Vector<D>) -> Vector<D>,
    ) -> Vector<D> {
        let d = D as f64;
        let stiff = d * (d + 2.0) * shear;
        let moment = ball_moment(influence, [0; D], -1.0, HORIZON);
        let bonds = fit.elastic(influence, 2.0 * stiff / moment);
        let rows = fit.dilatation(influence);
        let theta = |x: &Vector<D>| -> f64 {
            let at = |xi: &Vector<D>| u(&std::array::from_fn(|d| x[d] + xi[d]));
            let here = u(x);
            let bond = |(row, xi): (&[f64; D], &Vector<D>)| (0..D).map(|d| row[d] * (at(xi)[d] - here[d])).sum::<f64>();
            rows.iter().zip(&fit.xi).map(bond).sum()
        };
        let (origin, volumetric) = ([0.0; D], bulk - stiff / (d * d));
        let (here, theta_here) = (u(&origin), theta(&origin));
        let mut force = [0.0; D];
        for ((xi, row), bond) in fit.xi.iter().zip(&rows).zip(&bonds) {
            let (there, theta) = (u(xi), theta(xi));
            for a in 0..D {
                force[a] += volumetric * row[a] * (theta - theta_here);
                force[a] += (0..D).map(|b| bond[a][b] * (there[b] - here[b])).sum::<f64>();
            }
        }
        force
    }

    fn compare<const D: usize>(order: u32, points: usize) {
        let fit = Collocation::new(order, points).on_lattice::<D>(SPACING, HORIZON).unwrap();
        // 2D: k = K₂ = λ + G; 3D: K.
        for poisson in [-0.3, 0.0, 0.2, 0.3, 0.45] {
            let shear = 72e9 / (2.0 * (1.0 + poisson));
            let lambda = 72e9 * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
            let bulk = lambda + 2.0 * shear / D as f64;
            for influence in [Influence::Constant, Influence::Linear, Influence::Inverted] {
                for (j, k, l) in (0..D * D * D).map(|n| (n / D / D, n / D % D, n % D)) {
                    let u = |x: &Vector<D>| -> Vector<D> {
                        std::array::from_fn(|i| if i == j { x[k] * x[l] + 3e-3 * x[l] + 1e-5 } else { 0.0 })
                    };
                    let found = force(&fit, &influence, [bulk, shear], &u);
                    let second =
                        |a: usize, b: usize| f64::from(u8::from(a == k && b == l) + u8::from(a == l && b == k));
                    let laplacian: f64 = (0..D).map(|a| second(a, a)).sum();
                    for i in 0..D {
                        // (λ + G) grad div u + G lap u: K + G/3 in 3D, K₂ in 2D.
                        let exact = (lambda + shear) * second(i, j) + if i == j { shear * laplacian } else { 0.0 };
                        assert!(
                            (found[i] - exact).abs() < 1e-11 * (lambda + 2.0 * shear),
                            "{D}D order {order} {} ν = {poisson}, row {i}, u{j} = x{k} x{l}: {} against {exact}",
                            influence.name(),
                            found[i]
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn two_passes_on_quadratics_are_the_navier_operator_of_any_ratio() {
        compare::<2>(2, 13);
        compare::<2>(4, 29);
        compare::<3>(2, 33);
    }

    #[test]
    fn dilatation_of_a_uniform_gradient_is_its_trace_and_rows_are_opposite_along_opposite_bonds() {
        let fit = Collocation::new(2, 33).on_lattice::<3>(SPACING, HORIZON).unwrap();
        let rows = fit.dilatation(&Influence::Constant);
        let trace: f64 = rows.iter().zip(&fit.xi).map(|(row, xi)| (0..3).map(|d| row[d] * xi[d]).sum::<f64>()).sum();
        assert!((trace - 3.0).abs() < 1e-12, "{trace}");
        let steps = fit.steps.as_ref().unwrap();
        for (row, step) in rows.iter().zip(steps) {
            let opposite = steps.iter().position(|other| *other == step.map(|c| -c)).unwrap();
            assert_eq!(rows[opposite].map(|w| -w), *row);
        }
    }
}
