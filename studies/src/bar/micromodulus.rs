//! The micromodulus of a bond, and how it scales with the horizon.

/// Shape of c(|ξ|) within the horizon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Micromodulus {
    /// c = 2E/(A δ²), Bobaru et al. 2009, equation (15).
    Constant,
    /// c = 6E/(A δ²) (1 − |ξ|/δ), equations (16), (18).
    Triangular,
    /// c = 3E/(A δ²) |ξ|/δ, equations (19), (21).
    Inverted,
}

impl Micromodulus {
    pub const ALL: [Self; 3] = [Self::Constant, Self::Triangular, Self::Inverted];

    pub fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Triangular => "triangular",
            Self::Inverted => "inverted",
        }
    }

    /// c(r) for the horizon δ with E = A = 1: the function of the unit horizon, scaled by (36). Beyond the horizon it
    /// is the value at the rim, for cells whose node lies outside and a part of them inside.
    pub fn value(self, r: f64, horizon: f64) -> f64 {
        let ratio = (r / horizon).min(1.0);
        let unit = match self {
            Self::Constant => 2.0,
            Self::Triangular => 6.0 * (1.0 - ratio),
            Self::Inverted => 3.0 * ratio,
        };
        unit * scaling(1, 1.0 / horizon)
    }

    /// Discrete over exact Young's modulus on a uniform grid with δ = m h and the exact parts of cells: 1,
    /// 1 − 1/m², 1 + 1/(2m²). The rule is a trapezoidal sum for ∫ c |ξ| dξ.
    pub fn discrete_modulus(self, m: f64) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Triangular => 1.0 - 1.0 / (m * m),
            Self::Inverted => 1.0 + 0.5 / (m * m),
        }
    }
}

/// c_ε(ξ)/c_δ(γξ) = γ^(d+1), γ = δ/ε, in d dimensions: what the scaling of the micropotential,
/// w_ε(η, ξ) = γ^d w_δ(γη, γξ), equations (35) for d = 3 and (36) for d = 1, means for c = 2w/(s² |ξ|).
pub fn scaling(dimension: i32, gamma: f64) -> f64 {
    gamma.powi(dimension + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bar::grid::{Grid, Layout};
    use crate::bar::model::{Bar, Rule};

    /// V-S4-7, on the grid: at equal m both horizons store the same energy; it is E s²/2 times the discrete modulus.
    #[test]
    fn a_homogeneous_strain_stores_the_same_energy_at_both_horizons() {
        let strain = 1e-3;
        for micromodulus in Micromodulus::ALL {
            let density = |cells: usize, horizon: f64| {
                let grid = Grid::uniform(Layout::Vertex, 0.0, 10.0, cells);
                let u: Vec<f64> = grid.at.iter().map(|x| strain * x).collect();
                Bar::uniform(grid, horizon, micromodulus, Rule::Source).bonds().energy(&u)[cells / 2]
            };
            let (coarse, fine) = (density(50, 1.0), density(150, 1.0 / 3.0));
            assert!((fine / coarse - 1.0).abs() < 1e-12, "{micromodulus:?}: {coarse} {fine}");
            let exact = 0.5 * strain * strain * micromodulus.discrete_modulus(5.0);
            assert!((coarse / exact - 1.0).abs() < 1e-12, "{micromodulus:?}: {coarse} {exact}");
        }
    }

    /// V-S4-7, closed form in d dimensions: W = ¼ s² ∫ c |ξ| dV = ¼ s² c S_d δ^(d+1) ∫ shape(t) t^d dt.
    #[test]
    fn scaling_keeps_the_energy_density_in_one_two_and_three_dimensions() {
        use std::f64::consts::PI;
        let (delta, epsilon, strain) = (0.7_f64, 0.2_f64, 1e-3_f64);
        for (dimension, sphere) in [(1, 2.0), (2, 2.0 * PI), (3, 4.0 * PI)] {
            let d = f64::from(dimension);
            let moments = [1.0 / (d + 1.0), 1.0 / (d + 1.0) - 1.0 / (d + 2.0), 1.0 / (d + 2.0)];
            for moment in moments {
                let density = |c: f64, h: f64| 0.25 * strain * strain * c * sphere * h.powi(dimension + 1) * moment;
                let (wide, narrow) = (density(3.0, delta), density(3.0 * scaling(dimension, delta / epsilon), epsilon));
                assert!((narrow / wide - 1.0).abs() < 1e-12, "{dimension}: {wide} {narrow}");
            }
        }
    }
}
