//! The gate before time: rows with waves that grow are refused, and what would do is named.
//!
//! An eigenvalue λ > 0 of the [`Symbol`] makes noise of any size, rounding or the error of a discretisation, grow by e^(λt) in
//! diffusion and e^(√(λ/ρ) t) in motion. Nothing else stops it, however short the step. For runs of any length no λ above
//! rounding may pass; for one run, λ may pass with which noise grows tenfold at most. Bodies are bounded from above by the
//! endless lattice, so that the gate is on the safe side: a small body may bear rows that it refuses, which only the
//! eigenvalues of the body itself can tell (`Diffusion::growth`).

use super::{Collocation, Fit, Symbol, support};
use crate::discretization::Influence;
use crate::error::{Error, Result};

/// Factor by which noise may grow over a run: one digit.
const GROWTH: f64 = 10.0;

/// Exponents that are tried in place of a refused one.
const EXPONENTS: [f64; 3] = [16.0, 9.0, 4.0];

/// What rows are of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// [`Fit::elastic`], micromodulus in N/m^(2D).
    Elastic { influence: Influence, micromodulus: f64 },
    /// The same, and [`Fit::dilatation`] with k − A G/D² in Pa.
    StateBased { influence: Influence, micromodulus: f64, volumetric: f64 },
    /// [`Fit::diffusive`], micro-diffusivity in m^(q−D)/s.
    Diffusive { influence: Influence, micro_diffusivity: f64, q: f64 },
}

/// A support and weight that may be marched, and what it does to waves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alternative<const D: usize> {
    pub collocation: Collocation,
    pub symbol: Symbol<D>,
}

/// The largest eigenvalue (1/s) with which noise grows no more than tenfold in a run of this time (s): e^(λt) ≤ 10.
pub fn bearable_in_diffusion(time: f64) -> f64 {
    GROWTH.ln() / time
}

/// The same in motion, e^(√(λ/ρ) t) ≤ 10; ρ in kg/m³, N/m⁴ is returned.
pub fn bearable_in_motion(time: f64, density: f64) -> f64 {
    density * (GROWTH.ln() / time).powi(2)
}

/// A positive number to four digits.
fn digits(x: f64) -> String {
    let places = (3.0 - x.log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{x:.places$}")
}

impl<const D: usize> Fit<D> {
    /// The symbol of the rows of a lattice.
    ///
    /// # Errors
    /// As [`Fit::diffusive`]; a fit that is not on a lattice.
    pub fn symbol(&self, law: &Law) -> Result<Symbol<D>> {
        let Some(steps) = &self.steps else {
            return Err(Error::Refused("only rows that all points of a lattice share have a symbol".into()));
        };
        Ok(match law {
            Law::Elastic { influence, micromodulus } => Symbol::elastic(steps, &self.elastic(influence, *micromodulus)),
            Law::StateBased { influence, micromodulus, volumetric } => Symbol::state_based(
                steps,
                &self.elastic(influence, *micromodulus),
                &self.dilatation(influence),
                *volumetric,
            ),
            Law::Diffusive { influence, micro_diffusivity, q } => {
                Symbol::diffusive(steps, &self.diffusive(influence, *micro_diffusivity, *q)?)
            }
        })
    }
}

impl Collocation {
    /// Fit on a lattice (lengths in m) and symbol of its rows, if no eigenvalue is above `bearable`.
    ///
    /// `bearable` is 0 for runs of any length, or that of one run: [`bearable_in_diffusion`], [`bearable_in_motion`].
    ///
    /// # Errors
    /// As [`Collocation::on_lattice`] and [`Fit::symbol`]; waves that would grow, with what could be used instead.
    pub fn marched<const D: usize>(
        &self,
        spacing: f64,
        horizon: f64,
        law: &Law,
        bearable: f64,
    ) -> Result<(Fit<D>, Symbol<D>)> {
        let fit = self.on_lattice::<D>(spacing, horizon)?;
        let symbol = fit.symbol(law)?;
        if symbol.is_bearable(bearable) {
            return Ok((fit, symbol));
        }
        let name = match law {
            Law::Elastic { .. } | Law::StateBased { .. } if D == 1 => "E",
            Law::Elastic { .. } | Law::StateBased { .. } => "C11",
            Law::Diffusive { .. } => "K",
        };
        let scale = |symbol: &Symbol<D>| (horizon / spacing).powi(2) / symbol.stiffness;
        let Collocation { order, points, exponent } = self;
        let mut message = format!(
            "collocation of order {order} with {points} points and exponent {exponent} would grow in time: an eigenvalue of \
             +{} {name}/δ²",
            digits(symbol.highest * scale(&symbol))
        );
        let alternatives = self.stable_alternatives(spacing, horizon, law, bearable);
        message += if alternatives.is_empty() { "; of its neighbours none is stable here" } else { "; stable here: " };
        let listed: Vec<String> = alternatives
            .iter()
            .map(|Alternative { collocation, symbol }| {
                let (points, exponent) = (collocation.points, collocation.exponent);
                format!(
                    "{points} points with exponent {exponent} (radius {:.1} {name}/δ²)",
                    symbol.radius * scale(symbol)
                )
            })
            .collect();
        Err(Error::Refused(message + &listed.join(", ")))
    }

    /// Which supports and weights near this one, of the same order, have no eigenvalue above `bearable` on this lattice:
    /// the auxiliary grid and its two neighbours, with the exponents 16, 9 and 4. Those that allow the longest step first.
    pub fn stable_alternatives<const D: usize>(
        &self,
        spacing: f64,
        horizon: f64,
        law: &Law,
        bearable: f64,
    ) -> Vec<Alternative<D>> {
        let mut found: Vec<Alternative<D>> = Vec::new();
        for points in support::neighbouring_grids::<D>(self.points) {
            for exponent in EXPONENTS {
                let collocation = Collocation { order: self.order, points, exponent };
                let Ok(fit) = collocation.on_lattice::<D>(spacing, horizon) else { continue };
                let Ok(symbol) = fit.symbol(law) else { continue };
                if symbol.is_bearable(bearable) && found.iter().all(|other| other.symbol != symbol) {
                    found.push(Alternative { collocation, symbol });
                }
            }
        }
        found.sort_by(|a, b| a.symbol.radius.total_cmp(&b.symbol.radius));
        found
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// K = δ = 1.
    const DIFFUSION: Law = Law::Diffusive { influence: Influence::Constant, micro_diffusivity: 4.0 / PI, q: 2.0 };

    fn plane(order: u32, points: usize, exponent: f64, bearable: f64) -> Result<(Fit<2>, Symbol<2>)> {
        Collocation { order, points, exponent }.marched::<2>(0.25, 1.0, &DIFFUSION, bearable)
    }

    /// The schemes of Example 2 of Shojaei et al. 2022.
    #[test]
    fn order_four_grows_with_the_published_weight_and_hardly_with_a_flatter_one() {
        assert!(plane(2, 29, 16.0, 0.0).is_ok());
        let refused = plane(4, 49, 16.0, 0.0).unwrap_err().to_string();
        // An independent script: +32, and +0.12 with the exponent 9.
        let eigenvalue =
            "collocation of order 4 with 49 points and exponent 16 would grow in time: an eigenvalue of +32.08 K/δ²";
        assert!(refused.starts_with(eigenvalue), "{refused}");
        assert!(refused.ends_with("; of its neighbours none is stable here"), "{refused}");
        let refused = plane(4, 49, 9.0, 0.0).unwrap_err().to_string();
        assert!(refused.contains("exponent 9 would grow in time: an eigenvalue of +0.1245 K/δ²"), "{refused}");

        // In 10 δ²/K noise grows by e^1.24 = 3.5, in 20 by 12.
        let (_, symbol) = plane(4, 49, 9.0, bearable_in_diffusion(10.0)).unwrap();
        assert!((symbol.highest - 0.12).abs() < 0.005 && !symbol.is_stable(), "{symbol:?}");
        assert!(plane(4, 49, 9.0, bearable_in_diffusion(20.0)).is_err());
        let refused = plane(4, 49, 16.0, bearable_in_diffusion(10.0)).unwrap_err().to_string();
        assert!(refused.ends_with("; stable here: 49 points with exponent 9 (radius 11.5 K/δ²)"), "{refused}");
    }

    /// In the units of the row, whatever they are.
    #[test]
    fn what_is_refused_does_not_depend_on_units() {
        let (spacing, diffusivity) = (2.5e-3_f64, 3e-7);
        let micro_diffusivity = 4.0 * diffusivity / (PI * (4.0 * spacing).powi(2));
        let law = Law::Diffusive { influence: Influence::Constant, micro_diffusivity, q: 2.0 };
        let message = |law: &Law, spacing: f64| {
            Collocation::new(4, 49).marched::<2>(spacing, 4.0 * spacing, law, 0.0).unwrap_err().to_string()
        };
        assert_eq!(message(&law, spacing), message(&DIFFUSION, 0.25));
    }

    #[test]
    fn bars_of_order_four_have_stable_neighbours() {
        let law = Law::Elastic { influence: Influence::Constant, micromodulus: 2.0 };
        let collocation = Collocation::new(4, 11);
        let refused = collocation.marched::<1>(1.0 / 12.0, 1.0, &law, 0.0).unwrap_err().to_string();
        assert!(refused.contains("an eigenvalue of +74.43 E/δ²; stable here: "), "{refused}");
        let found = collocation.stable_alternatives::<1>(1.0 / 12.0, 1.0, &law, 0.0);
        assert!(!found.is_empty() && found.is_sorted_by(|a, b| a.symbol.radius <= b.symbol.radius), "{found:?}");
        for Alternative { collocation, symbol } in found {
            assert!(symbol.is_stable() && collocation.marched::<1>(1.0 / 12.0, 1.0, &law, 0.0).is_ok());
        }
    }

    #[test]
    fn only_lattices_have_a_symbol() {
        let around: Vec<[f64; 1]> = [-1.0, -0.5, 0.5, 1.0].map(|x| [x]).to_vec();
        let law = Law::Elastic { influence: Influence::Constant, micromodulus: 2.0 };
        let error = Collocation::new(2, 5).around(&around, 1.0).unwrap().symbol(&law).unwrap_err();
        assert!(error.to_string().contains("all points of a lattice share"), "{error}");
    }

    #[test]
    fn noise_grows_tenfold_in_the_time_given() {
        assert!(((bearable_in_diffusion(3.0) * 3.0).exp() - 10.0).abs() < 1e-12);
        assert!((((bearable_in_motion(3.0, 7.0) / 7.0).sqrt() * 3.0).exp() - 10.0).abs() < 1e-12);
    }
}
