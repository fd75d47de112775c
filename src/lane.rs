//! The number a bond law is written on: one `f64`, or several numbers side by side.
//!
//! A law is one generic formula over [`Lane`]; the loops of `execution` evaluate it on packs of the registers that the
//! machine has, in double or single precision, and on `f64` where one bond is asked about. Deliberately absent: the
//! packs themselves, which belong to the loops.

use std::ops::{Add, Div, Mul, Sub};

/// A number, or several side by side.
pub trait Lane: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// Whether the numbers are of single precision: a series may then be shorter.
    const SINGLE: bool;
    /// The same number everywhere.
    fn splat(x: f64) -> Self;
    fn sqrt(self) -> Self;
    /// self × factor + term; rounded once where the loops run on fused instructions, twice elsewhere.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// In each lane `above` where self > limit, else `below`: a law has no `if` on numbers. A NaN is not above.
    fn select_above(self, limit: Self, above: Self, below: Self) -> Self;
    /// The larger of two numbers in each lane.
    #[inline(always)]
    fn or_larger(self, other: Self) -> Self {
        self.select_above(other, self, other)
    }
}

impl Lane for f64 {
    const SINGLE: bool = false;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }
    #[inline(always)]
    fn select_above(self, limit: Self, above: Self, below: Self) -> Self {
        if self > limit { above } else { below }
    }
}

/// c₀ + c₁ x + c₂ x² + …, by Horner's rule.
#[inline(always)]
pub fn polynomial<L: Lane, const N: usize>(coefficients: [f64; N], x: L) -> L {
    let mut sum = L::splat(coefficients[N - 1]);
    for k in (0..N - 1).rev() {
        sum = sum.mul_add(x, L::splat(coefficients[k]));
    }
    sum
}
