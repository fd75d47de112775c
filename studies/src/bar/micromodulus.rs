//! The micromodulus of a bond.

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
