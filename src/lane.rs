//! The number a bond law is written on: one `f64`, or eight side by side.
//!
//! A law is one generic formula over [`Lane`]; the loops evaluate it on [`Pack`] where a vector of bonds is at hand
//! and on `f64` where one bond decides (breaking, tests). Both do the same operations in the same order, without
//! fused multiply-add, so that a bond has the same bits whichever way it was evaluated.

use std::ops::{Add, Div, Mul, Sub};

/// Bonds evaluated side by side.
pub const LANES: usize = 8;

/// A number, or [`LANES`] numbers side by side.
pub trait Lane: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// The same number everywhere.
    fn splat(x: f64) -> Self;
    fn sqrt(self) -> Self;
    fn max(self, other: Self) -> Self;
}

impl Lane for f64 {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
}

/// [`LANES`] numbers; plain arrays, which the compiler turns into whatever registers the target has.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Pack(pub [f64; LANES]);

impl Pack {
    #[inline(always)]
    pub fn load(source: &[f64; LANES]) -> Self {
        Pack(*source)
    }

    /// Keeps the lanes whose bit is set, zeroes the others.
    #[inline(always)]
    pub fn keep(self, mask: u8) -> Self {
        let bits = &KEEP[mask as usize];
        let mut out = self;
        for k in 0..LANES {
            out.0[k] = f64::from_bits(self.0[k].to_bits() & bits[k]);
        }
        out
    }

    /// Sum of the lanes as a balanced tree: the order is fixed.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let [a, b, c, d, e, f, g, h] = self.0;
        ((a + b) + (c + d)) + ((e + f) + (g + h))
    }

    /// Largest lane.
    #[inline(always)]
    pub fn largest(self) -> f64 {
        let mut m = self.0[0];
        for k in 1..LANES {
            m = Lane::max(m, self.0[k]);
        }
        m
    }
}

/// All-ones or all-zeros words for each pattern of eight bits.
static KEEP: [[u64; LANES]; 256] = {
    let mut table = [[0; LANES]; 256];
    let mut mask = 0;
    while mask < 256 {
        let mut k = 0;
        while k < LANES {
            if mask >> k & 1 == 1 {
                table[mask][k] = u64::MAX;
            }
            k += 1;
        }
        mask += 1;
    }
    table
};

impl Add for Pack {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        for k in 0..LANES {
            self.0[k] += other.0[k];
        }
        self
    }
}
impl Sub for Pack {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        for k in 0..LANES {
            self.0[k] -= other.0[k];
        }
        self
    }
}
impl Mul for Pack {
    type Output = Self;
    #[inline(always)]
    fn mul(mut self, other: Self) -> Self {
        for k in 0..LANES {
            self.0[k] *= other.0[k];
        }
        self
    }
}
impl Div for Pack {
    type Output = Self;
    #[inline(always)]
    fn div(mut self, other: Self) -> Self {
        for k in 0..LANES {
            self.0[k] /= other.0[k];
        }
        self
    }
}

impl Lane for Pack {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Pack([x; LANES])
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let mut out = self;
        for k in 0..LANES {
            out.0[k] = self.0[k].sqrt();
        }
        out
    }
    #[inline(always)]
    fn max(mut self, other: Self) -> Self {
        for k in 0..LANES {
            self.0[k] = Lane::max(self.0[k], other.0[k]);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keep_zeroes_exactly_the_lanes_without_a_bit() {
        let pack = Pack([1.0, -2.0, 3.0, 4.0, 5.0, f64::NAN, 7.0, 8.0]);
        assert_eq!(pack.keep(0b1001_0010).0, [0.0, -2.0, 0.0, 0.0, 5.0, 0.0, 0.0, 8.0]);
        assert_eq!(pack.keep(0).sum(), 0.0);
    }
}
