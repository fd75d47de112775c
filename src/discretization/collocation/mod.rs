//! Collocation: where nothing can break, a short linear row replaces the sum over a family.
//!
//! About each point x the unknown is fitted by a polynomial through few points of its family, its support, by weighted
//! least squares; the integral of the linear law over the whole ball is then known in closed form for each monomial
//! ([`rows`]), and what results is one weight for each point of the support,
//!
//! ```text
//! (L u)(x) = Σ_j w_j (u(x + ξ_j) − u(x)),
//! ```
//!
//! equal to the integral for every polynomial up to the order. Shojaei et al. 2022, eqs. (32)-(60).
//!
//! Whether a row may be marched in time is known before the first step from its [`symbol`]; [`stability`] refuses those that may not.
//!
//! Deliberately absent: incomplete balls, for which the closed forms do not hold, and which points have rows.

pub mod rows;
mod shared_row;
pub mod stability;
mod state_based;
mod support;
pub mod symbol;
mod symmetry;
#[cfg(test)]
mod tests;

use bondwise_linear::SingularValues;
pub use shared_row::{Pair, RowClass, SharedRow, SharedSlope, SlopePair};

pub use symbol::Symbol;

use super::Influence;
use crate::error::{Error, Result};
use crate::field::{Vector, norm};

/// The weight is zero where α t² reaches this; (36).
const CUT: f64 = 64.0;

/// Rows of a fit with a larger condition number have lost half their digits or more.
const LARGEST_CONDITION: f64 = 1e8;

/// How polynomials are fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Collocation {
    /// All monomials up to this degree, even and at least 2: an odd one more changes no row of a symmetric support.
    pub order: u32,
    /// Number of collocation points to aim at, the source among them.
    pub points: usize,
    /// α of the [`weight`].
    pub exponent: f64,
}

/// Weight of a point in the fit, at t = |ξ|/δ,
///
/// ```text
/// w = (e^(−α t²) − e^−64)/(1 − e^−64)
/// ```
///
/// Shojaei et al. 2022, eq. (36), for α = 16; there as (1 − e^(64 − 16 t²))/(1 − e^64), which cannot be evaluated
/// where the weight is small. A Gaussian: 1.1e-7 at the rim. α = 0 weighs all alike.
pub fn weight(exponent: f64, t: f64) -> f64 {
    let floor = (-CUT).exp();
    ((-exponent * t * t).exp() - floor) / (1.0 - floor)
}

impl Collocation {
    /// α of the paper.
    pub const EXPONENT: f64 = 16.0;

    /// Monomials up to `order` through about `points` points, weighted as in the paper.
    pub fn new(order: u32, points: usize) -> Self {
        Collocation { order, points, exponent: Self::EXPONENT }
    }

    /// Points of the smallest auxiliary grid that has more points than a polynomial of this order has monomials.
    pub fn fewest<const D: usize>(order: u32) -> usize {
        let monomials = rows::monomials::<D>(order).len();
        let sizes = (1..).map(|k| support::ball::<D>(f64::from(k)).len());
        sizes.into_iter().find(|&size| size > monomials).unwrap_or(monomials)
    }

    /// The fit that all points of a lattice share. Lengths in m.
    ///
    /// Its rows are symmetric to the last bit under mirroring and exchange of axes.
    ///
    /// # Errors
    /// As [`Collocation::around`].
    pub fn on_lattice<const D: usize>(&self, spacing: f64, horizon: f64) -> Result<Fit<D>> {
        let steps: Vec<[i32; D]> = support::ball(horizon / spacing);
        let steps: Vec<_> = steps.into_iter().filter(|step| *step != [0; D]).collect();
        let family: Vec<Vector<D>> = steps.iter().map(|step| step.map(|i| f64::from(i) * spacing)).collect();
        let mut fit = self.around(&family, horizon)?;
        fit.steps = Some(fit.nodes.iter().map(|&j| steps[j]).collect());
        Ok(fit)
    }

    /// The fit about a point of any cloud, from the bonds ξ (m) of its family without the source.
    ///
    /// # Errors
    /// An order that is odd or 0; an α that is negative or 64 and more; fewer points found than there are monomials;
    /// points that do not determine the polynomial, to 8 digits.
    pub fn around<const D: usize>(&self, family: &[Vector<D>], horizon: f64) -> Result<Fit<D>> {
        if self.order == 0 || self.order % 2 == 1 {
            return Err(Error::Refused(format!("the order of collocation must be 2, 4, 6, …, got {}", self.order)));
        }
        if !(0.0..CUT).contains(&self.exponent) {
            let exponent = self.exponent;
            return Err(Error::Refused(format!(
                "the exponent of the weight must be from 0 to below 64, got {exponent}"
            )));
        }
        let scaled: Vec<Vector<D>> = family.iter().map(|xi| xi.map(|x| x / horizon)).collect();
        let grid = support::auxiliary_grid(self.points);
        let nodes = support::nearest(&scaled, &grid);
        let monomials = rows::monomials::<D>(self.order);
        let (asked, found) = (grid.len() + 1, nodes.len() + 1);
        let few = || {
            let (order, n) = (self.order, monomials.len());
            format!(
                "collocation of order {order} fits {n} monomials in {D}D; of {asked} points asked for {found} were found"
            )
        };
        if found < monomials.len() {
            return Err(Error::Refused(few()));
        }
        let at: Vec<Vector<D>> = std::iter::once([0.0; D]).chain(nodes.iter().map(|&j| scaled[j])).collect();
        let roots: Vec<f64> = at.iter().map(|xi| weight(self.exponent, norm(xi)).sqrt()).collect();
        let factors = SingularValues::new(found, monomials.len(), |j, k| roots[j] * monomial(monomials[k], &at[j]))
            .map_err(|error| Error::Refused(format!("{}: {error}", few())))?;
        let condition = factors.condition();
        if condition.is_nan() || condition > LARGEST_CONDITION {
            return Err(Error::Refused(format!(
                "{}, but they do not fix a polynomial: condition {condition:.1e}",
                few()
            )));
        }
        let xi = nodes.iter().map(|&j| family[j]).collect();
        Ok(Fit { nodes, xi, asked, found, condition, steps: None, horizon, monomials, roots, factors })
    }
}

/// ξ₁^a ξ₂^b ξ₃^c
fn monomial<const D: usize>(exponents: [u32; D], xi: &Vector<D>) -> f64 {
    (0..D).map(|d| xi[d].powi(exponents[d] as i32)).product()
}

/// A polynomial fitted about a point, p(ξ/δ) Q G of (41) with Q = (Mᵀ W M)⁻¹ Mᵀ W of (38)-(40).
///
/// Q is never formed. A row L Q is the vector r with Mᵀ r = L and the least Σ r²/w, the shortest solution y = r/√w of
/// (√w M)ᵀ y = L, which singular values give with the condition of √w M rather than its square.
#[derive(Debug, Clone)]
pub struct Fit<const D: usize> {
    /// Collocation points but the source: places in the family, ascending.
    pub nodes: Vec<usize>,
    /// Their bonds, m.
    pub xi: Vec<Vector<D>>,
    /// The same in spacings, on a lattice.
    pub steps: Option<Vec<[i32; D]>>,
    /// Points of the auxiliary grid, with the source.
    pub asked: usize,
    /// Collocation points, with the source: fewer than asked for where two have the same nearest point, more where ties are
    /// taken together.
    pub found: usize,
    /// Condition number of √w M; that of the moment matrix (38) is its square.
    pub condition: f64,
    horizon: f64,
    monomials: Vec<[u32; D]>,
    roots: Vec<f64>,
    factors: SingularValues,
}

impl<const D: usize> Fit<D> {
    /// Weights of bond-based elasticity: (L u)(x) = Σ_j K_j (u_j − u), force density, N/m³ for u in m.
    ///
    /// `micromodulus` c in N/m^(2D), with unit cross-section or thickness in 1D and 2D: the hypothesis is in c.
    /// Shojaei et al. 2022, eqs. (46)-(52).
    pub fn elastic(&self, influence: &Influence, micromodulus: f64) -> Vec<[[f64; D]; D]> {
        let moments: Vec<[[f64; D]; D]> =
            self.monomials.iter().map(|p| rows::elastic(*p, influence, micromodulus, self.horizon)).collect();
        let mut weights = vec![[[0.0; D]; D]; self.nodes.len()];
        for (a, b) in (0..D * D).map(|k| (k / D, k % D)) {
            let row = self.row(&moments.iter().map(|m| m[a][b]).collect::<Vec<_>>());
            weights.iter_mut().zip(&row[1..]).for_each(|(weight, w)| weight[a][b] = *w);
        }
        if let Some(steps) = &self.steps {
            symmetry::symmetrise::<D, 2>(steps, weights.as_flattened_mut().as_flattened_mut());
        }
        weights
    }

    /// Weights of diffusion with the kernel κ ω/|ξ|^q: (L C)(x) = Σ_j w_j (C_j − C), 1/s.
    ///
    /// `micro_diffusivity` κ in m^(q−D)/s. Shojaei et al. 2022, eqs. (56)-(60).
    ///
    /// # Errors
    /// A q for which the integral over squares does not exist: D + 2 and above, for `Inverted` D + 3.
    pub fn diffusive(&self, influence: &Influence, micro_diffusivity: f64, q: f64) -> Result<Vec<f64>> {
        let moment = |p: &[u32; D]| rows::diffusive(*p, influence, micro_diffusivity, q, self.horizon);
        let moments: Vec<f64> = self.monomials.iter().map(moment).collect();
        if moments.iter().any(|m| !m.is_finite()) {
            return Err(Error::Refused(format!("ω/|ξ|^q with q = {q} has no integral over squares in {D}D")));
        }
        let mut weights = self.row(&moments).split_off(1);
        if let Some(steps) = &self.steps {
            symmetry::symmetrise::<D, 0>(steps, &mut weights);
        }
        Ok(weights)
    }

    /// Shape functions N_j(ξ) of (41), that of the source first: the fitted polynomial at x + ξ is Σ N_j g_j.
    pub fn shape_functions(&self, xi: &Vector<D>) -> Vec<f64> {
        let at = xi.map(|x| x / self.horizon);
        self.row(&self.monomials.iter().map(|p| monomial(*p, &at)).collect::<Vec<_>>())
    }

    /// L Q for a functional given by its values on the monomials of ξ/δ; the source first.
    fn row(&self, functional: &[f64]) -> Vec<f64> {
        self.factors.least_norm(functional).iter().zip(&self.roots).map(|(y, root)| y * root).collect()
    }
}
