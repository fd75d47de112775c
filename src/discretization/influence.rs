//! Influence functions: how much a bond of a given length counts.
//!
//! An influence function ω depends on the relative length t = |ξ|/δ alone, is 1 at its largest and
//! 0 outside the horizon. Laws multiply the force of a bond by ω; whatever then has to be
//! integrated over a family needs one more thing, the radial moment ∫₀¹ ω(t) tᵖ dt, which stands
//! here in closed form and feeds `moments.rs`.
//!
//! Deliberately absent: the singular factors 1/|ξ|^q of diffusion kernels. They belong to the law
//! and enter the moments through the exponent p.

use super::volume::RIM_TOLERANCE;

/// The list of influence functions ω(t), t = |ξ|/δ: variant, name in a case, and its parameter with default, least and
/// most, if it has one. The formulas stand below; the case language, `list`, documentation and tests follow the list.
///
/// | variant | ω(t) for t ≤ 1 | remark |
/// |---|---|---|
/// | `Constant` | 1 | Shojaei et al. 2022, eq. (13) |
/// | `Linear` | 1 − t | "conical"; Shojaei et al. 2022, eq. (14) |
/// | `Inverted` | t | "inverted triangle"; Bobaru et al. 2009 |
/// | `Parabolic` | 1 − t² | |
/// | `Gaussian` | exp(−(t/width)²) | width in units of δ, default [`Influence::GAUSSIAN_WIDTH`] |
/// | `Cubic` | 1 − 3t² + 2t³ | slope 0 at both ends |
/// | `Quintic` | 1 − 10t³ + 15t⁴ − 6t⁵ | two derivatives 0 at both ends |
/// | `Septic` | 1 − 35t⁴ + 84t⁵ − 70t⁶ + 20t⁷ | three derivatives 0 at both ends |
macro_rules! each_influence {
    ($with:ident) => {
        $with! {
            /// 1
            Constant "constant" {},
            /// 1 − t (conical)
            Linear "linear" {},
            /// t
            Inverted "inverted" {},
            /// 1 − t²
            Parabolic "parabolic" {},
            /// exp(−(t/width)²)
            Gaussian "gaussian" { width: 1.0 / 3.0, 0.05, 10 },
            /// 1 − 3t² + 2t³
            Cubic "cubic" {},
            /// 1 − 10t³ + 15t⁴ − 6t⁵
            Quintic "quintic" {},
            /// 1 − 35t⁴ + 84t⁵ − 70t⁶ + 20t⁷
            Septic "septic" {},
        }
    };
}
pub(crate) use each_influence;

macro_rules! define {
    ($(
        $(#[doc = $about:literal])* $name:ident $key:literal
        { $($parameter:ident: $default:expr, $least:literal, $most:literal)? },
    )*) => {
        #[doc = "Influence function ω(t), t = |ξ|/δ, without unit: one of the list."]
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Influence {
            $($(#[doc = $about])* $name $({
                /// In units of the horizon; must be positive.
                $parameter: f64,
            })?,)*
        }

        impl Influence {
            /// Every influence function once, each parameter at its default.
            pub const ALL: [Influence; [$($key),*].len()] = [$(Influence::$name $({ $parameter: $default })?,)*];

            /// Name in case files and lists.
            pub fn name(&self) -> &'static str {
                match self { $(Influence::$name { .. } => $key,)* }
            }
        }
    };
}
each_influence!(define);

impl Influence {
    /// Default width of the Gaussian: a third of the horizon, so that the cut at the rim (e⁻⁹ =
    /// 1.2e-4) is small while the bell still spans a full spacing at a horizon ratio of 3.
    pub const GAUSSIAN_WIDTH: f64 = 1.0 / 3.0;

    /// ω(t) with its support: zero for t > 1.
    ///
    /// A length that passes 1 by no more than [`RIM_TOLERANCE`] counts as 1, so that a point placed
    /// exactly on the horizon does not appear and vanish with rounding.
    pub fn value(&self, t: f64) -> f64 {
        if t > 1.0 + RIM_TOLERANCE { 0.0 } else { self.quadrature_value(t) }
    }

    /// ω(min(t, 1)): the value that belongs to a quadrature point whose cell reaches into the ball.
    ///
    /// Partial-volume rules keep points with δ < |ξ| < δ + h/2, because a part of their cell lies
    /// inside. The weight of that part is the business of the rule (`volume.rs`); the kernel is
    /// taken where the bond leaves the ball. It is therefore 1 there for `Constant` and `Inverted`,
    /// and 0 for every function that vanishes at the rim, as in Shojaei et al. 2022, eqs. (26) and
    /// (28), with eq. (14).
    pub fn quadrature_value(&self, t: f64) -> f64 {
        let t = t.min(1.0);
        // The smooth steps are written from the rim, y = 1 − t: no cancellation there, and never a
        // negative value.
        let y = 1.0 - t;
        match *self {
            Influence::Constant => 1.0,
            Influence::Linear => y,
            Influence::Inverted => t,
            Influence::Parabolic => y * (1.0 + t),
            Influence::Gaussian { width } => (-(t / width).powi(2)).exp(),
            Influence::Cubic => y.powi(2) * (3.0 - 2.0 * y),
            Influence::Quintic => y.powi(3) * (10.0 + y * (-15.0 + 6.0 * y)),
            Influence::Septic => y.powi(4) * (35.0 + y * (-84.0 + y * (70.0 - 20.0 * y))),
        }
    }

    /// Terms of [`Influence::polynomial`].
    pub const TERMS: usize = 8;

    /// ω as a polynomial in y = 1 − t, constant term first; None for the Gaussian, which is none.
    pub fn polynomial(&self) -> Option<[f64; Influence::TERMS]> {
        Some(match self {
            Influence::Constant => [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            Influence::Linear => [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            Influence::Inverted => [1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            Influence::Parabolic => [0.0, 2.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            Influence::Gaussian { .. } => return None,
            Influence::Cubic => [0.0, 0.0, 3.0, -2.0, 0.0, 0.0, 0.0, 0.0],
            Influence::Quintic => [0.0, 0.0, 0.0, 10.0, -15.0, 6.0, 0.0, 0.0],
            Influence::Septic => [0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0],
        })
    }

    /// Radial moment R(p) = ∫₀¹ ω(t) tᵖ dt, for any real p.
    ///
    /// With the horizon δ, ∫₀^δ ω rᵖ dr = δ^(p+1) R(p). Infinite where the integral diverges at
    /// t = 0, which is p ≤ −1, for `Inverted` p ≤ −2. The quotients are the integrals of the
    /// polynomials after one integration by parts, products only, so that nothing cancels.
    pub fn radial_moment(&self, p: f64) -> f64 {
        let lowest_power = if *self == Influence::Inverted { 1.0 } else { 0.0 };
        if p + lowest_power <= -1.0 {
            return f64::INFINITY;
        }
        match *self {
            Influence::Constant => 1.0 / (p + 1.0),
            Influence::Linear => 1.0 / ((p + 1.0) * (p + 2.0)),
            Influence::Inverted => 1.0 / (p + 2.0),
            Influence::Parabolic => 2.0 / ((p + 1.0) * (p + 3.0)),
            Influence::Gaussian { width } => gaussian_moment(width, p),
            Influence::Cubic => 6.0 / ((p + 1.0) * (p + 3.0) * (p + 4.0)),
            Influence::Quintic => 60.0 / ((p + 1.0) * (p + 4.0) * (p + 5.0) * (p + 6.0)),
            Influence::Septic => 840.0 / ((p + 1.0) * (p + 5.0) * (p + 6.0) * (p + 7.0) * (p + 8.0)),
        }
    }
}

/// ∫₀¹ exp(−(t/width)²) tᵖ dt by the series of the lower incomplete gamma function,
///
/// ```text
/// T^(p+1) e^(−x)/2 Σₙ xⁿ / (a (a+1) … (a+n)),   a = (p+1)/2,   x = (T/width)²
/// ```
///
/// All terms are positive, so nothing cancels. T is 1, or for narrow bells the place where x = 400:
/// what lies beyond is below e⁻⁴⁰⁰, and e⁻ˣ stays far from underflow.
fn gaussian_moment(width: f64, p: f64) -> f64 {
    assert!(width > 0.0, "the width of a Gaussian influence function must be positive, got {width}");
    let a = 0.5 * (p + 1.0);
    let end = (20.0 * width).min(1.0);
    let x = (end / width).powi(2);
    let mut term = 1.0 / a;
    let mut sum = term;
    let mut n = 1.0;
    // Terms grow until n = x; only after that does a small one mean that the series has converged.
    while n <= x || term > 1e-17 * sum {
        term *= x / (a + n);
        sum += term;
        n += 1.0;
    }
    0.5 * end.powf(p + 1.0) * (-x).exp() * sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::quadrature::integrate;
    use crate::lane::polynomial;

    #[test]
    fn values_are_the_printed_formulas_and_stay_between_zero_and_one() {
        let printed = |influence: &Influence, t: f64| match influence {
            Influence::Constant => 1.0,
            Influence::Linear => 1.0 - t,
            Influence::Inverted => t,
            Influence::Parabolic => 1.0 - t * t,
            Influence::Gaussian { width } => (-t * t / (width * width)).exp(),
            Influence::Cubic => 1.0 - 3.0 * t.powi(2) + 2.0 * t.powi(3),
            Influence::Quintic => 1.0 - 10.0 * t.powi(3) + 15.0 * t.powi(4) - 6.0 * t.powi(5),
            Influence::Septic => 1.0 - 35.0 * t.powi(4) + 84.0 * t.powi(5) - 70.0 * t.powi(6) + 20.0 * t.powi(7),
        };
        for influence in Influence::ALL {
            for step in 0..=1000 {
                let t = f64::from(step) / 1000.0;
                let omega = influence.value(t);
                assert!((omega - printed(&influence, t)).abs() < 1e-13, "{} at {t}", influence.name());
                assert!((0.0..=1.0).contains(&omega), "{} at {t} is {omega}", influence.name());
                if let Some(terms) = influence.polynomial() {
                    let sum = polynomial(terms, 1.0 - t);
                    assert!((omega - sum).abs() < 1e-14, "{} at {t}", influence.name());
                }
            }
        }
    }

    #[test]
    fn the_support_ends_at_the_rim_and_quadrature_points_beyond_it_see_the_rim() {
        for influence in Influence::ALL {
            let rim = influence.value(1.0);
            assert_eq!(influence.value(1.0 + 1e-12), rim, "{}", influence.name());
            assert_eq!(influence.value(1.0 + 1e-6), 0.0, "{}", influence.name());
            assert_eq!(influence.quadrature_value(1.15), rim, "{}", influence.name());
        }
        assert_eq!(Influence::Constant.quadrature_value(1.1), 1.0);
        assert_eq!(Influence::Inverted.quadrature_value(1.1), 1.0);
        assert_eq!(Influence::Linear.quadrature_value(1.1), 0.0);
    }

    #[test]
    fn radial_moments_are_the_integrals() {
        let narrow = [1.0, 0.5, 0.1, 0.04].map(|width| Influence::Gaussian { width });
        for influence in Influence::ALL.iter().chain(&narrow) {
            for p in [0.0, 1.0, 2.0, 3.0, 4.0, 7.0] {
                // Forty panels of 20 points resolve even the narrowest bell here.
                let expected: f64 = (0..40)
                    .map(|k| {
                        let panel = |k: i32| f64::from(k) / 40.0;
                        integrate(|t| influence.value(t) * t.powf(p), panel(k), panel(k + 1), 20)
                    })
                    .sum();
                let moment = influence.radial_moment(p);
                let error = (moment - expected).abs() / expected;
                assert!(error < 2e-14, "{} p={p}: {moment} against {expected}", influence.name());
            }
        }
    }

    #[test]
    fn singular_moments_are_exact_or_infinite() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-13 * b;
        assert!(near(Influence::Constant.radial_moment(-0.5), 2.0));
        assert!(near(Influence::Inverted.radial_moment(-1.0), 1.0));
        assert!(near(Influence::Gaussian { width: 1e3 }.radial_moment(-0.5), 2.0 - 2.0 / 5.0 * 1e-6));
        assert_eq!(Influence::Constant.radial_moment(-1.0), f64::INFINITY);
        assert_eq!(Influence::Linear.radial_moment(-1.5), f64::INFINITY);
        assert_eq!(Influence::Inverted.radial_moment(-2.0), f64::INFINITY);
        assert_eq!(Influence::Gaussian { width: 0.3 }.radial_moment(-1.0), f64::INFINITY);
    }

    #[test]
    fn a_narrow_gaussian_has_the_moments_of_the_whole_line() {
        // ∫₀^∞ exp(−(t/w)²) dt = w √π/2, and the first moment is w²/2.
        let width = 1e-4;
        let narrow = Influence::Gaussian { width };
        let area = 0.5 * width * std::f64::consts::PI.sqrt();
        assert!((narrow.radial_moment(0.0) - area).abs() < 1e-13 * area);
        assert!((narrow.radial_moment(1.0) - 0.5 * width * width).abs() < 1e-13 * width * width);
    }

    #[test]
    fn names_are_distinct() {
        for (i, a) in Influence::ALL.iter().enumerate() {
            assert!(Influence::ALL[..i].iter().all(|b| a.name() != b.name()), "{}", a.name());
        }
    }
}
