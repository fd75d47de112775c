//! What the operators make of monomials: integrals over the whole ball in closed form.
//!
//! One formula gives every row, for any influence function, dimension, order and exponent (Shojaei et al. 2022,
//! eqs. (47)-(52), (56)-(60)). Monomials are of ξ/δ; the one of degree 0 gives 0, because p(ξ) − p(0) does.

use crate::discretization::influence::Influence;
use crate::discretization::moments::ball_moment;

/// Exponents of all monomials of `D` coordinates up to a degree: by degree, then x before y before z, as in (33).
pub fn monomials<const D: usize>(degree: u32) -> Vec<[u32; D]> {
    let side = degree + 1;
    let mut all: Vec<[u32; D]> = (0..side.pow(D as u32))
        .map(|k| std::array::from_fn(|d| k / side.pow(d as u32) % side))
        .filter(|exponents: &[u32; D]| exponents.iter().sum::<u32>() <= degree)
        .collect();
    all.sort_by_key(|exponents| (exponents.iter().sum::<u32>(), std::cmp::Reverse(*exponents)));
    all
}

/// Linearised bond-based elasticity on the monomial p(ξ/δ) in each component,
///
/// ```text
/// L_ab = c ∫ ω ξ_a ξ_b/|ξ|³ [p(ξ/δ) − p(0)] dV = c δ^(D−1) S(p + e_a + e_b) R(|p| + D − 2)
/// ```
///
/// the force density in direction a from a displacement in direction b; (49), (51), (52). `micromodulus` c in
/// N/m^(2D), N/m³ per m of displacement is returned.
pub fn elastic<const D: usize>(
    exponents: [u32; D],
    influence: &Influence,
    micromodulus: f64,
    horizon: f64,
) -> [[f64; D]; D] {
    let scale = micromodulus * horizon.powi(D as i32 - 1);
    std::array::from_fn(|a| {
        std::array::from_fn(|b| {
            if exponents == [0; D] {
                return 0.0;
            }
            let mut raised = exponents;
            raised[a] += 1;
            raised[b] += 1;
            scale * ball_moment(influence, raised, 3.0, 1.0)
        })
    })
}

/// Mean derivatives of the monomial p(ξ/δ), with ω = ω̃ δ/|ξ|,
///
/// ```text
/// g_a = (D/m) ∫ ω ξ_a p(ξ/δ) dV = (D/δ) ∫ ω̃ ξ_a/|ξ| p(ξ) dV / ∫ ω̃ |ξ| dV     (unit ball)
/// ```
///
/// what dilatation and its gradient are sums of; 1/m. `influence` is ω̃.
pub fn dilatation<const D: usize>(exponents: [u32; D], influence: &Influence, horizon: f64) -> [f64; D] {
    let scale = D as f64 / (horizon * ball_moment(influence, [0; D], -1.0, 1.0));
    std::array::from_fn(|a| {
        let mut raised = exponents;
        raised[a] += 1;
        scale * ball_moment(influence, raised, 1.0, 1.0)
    })
}

/// Diffusion on the monomial p(ξ/δ),
///
/// ```text
/// L = κ ∫ ω |ξ|^−q [p(ξ/δ) − p(0)] dV = κ δ^(D−q) S(p) R(|p| + D − 1 − q)
/// ```
///
/// (57), (59), (60). Finite for q < D + 2 (`Inverted`: D + 3). `micro_diffusivity` κ in m^(q−D)/s, 1/s is returned.
pub fn diffusive<const D: usize>(
    exponents: [u32; D],
    influence: &Influence,
    micro_diffusivity: f64,
    q: f64,
    horizon: f64,
) -> f64 {
    if exponents == [0; D] {
        return 0.0;
    }
    micro_diffusivity * horizon.powf(D as f64 - q) * ball_moment(influence, exponents, q, 1.0)
}
