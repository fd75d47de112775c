//! Four numbers in a plain array: what the compiler makes of it on any processor.

use std::ops::{Add, Div, Mul, Sub};

use super::{BondVectors, GUESS_DOUBLE, GUESS_SINGLE, LoadEnds, Pack};
use crate::field::Number;
use crate::lane::Lane;

const N: usize = 4;

/// Four numbers; `FUSED` says whether [`Lane::mul_add`] rounds once.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub struct Array<B, const FUSED: bool>([B; N]);

// Plain loops throughout: the closures of `array::map` and `from_fn` are functions of their own, which the compiler does
// not always inline into code for wider instructions.

macro_rules! operators {
    ($($trait:ident $method:ident $operator:tt),*) => {$(
        impl<B: Copy + $trait<Output = B>, const FUSED: bool> $trait for Array<B, FUSED> {
            type Output = Self;
            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for k in 0..N {
                    self.0[k] = self.0[k] $operator other.0[k];
                }
                self
            }
        }
    )*};
}
operators!(Add add +, Sub sub -, Mul mul *, Div div /);

macro_rules! numbers {
    ($number:ty, $bits:ty, $single:literal, $magic:expr) => {
        impl<const FUSED: bool> Lane for Array<$number, FUSED> {
            const SINGLE: bool = $single;
            #[inline(always)]
            fn splat(x: f64) -> Self {
                Array([x as $number; N])
            }
            #[inline(always)]
            fn sqrt(mut self) -> Self {
                for k in 0..N {
                    self.0[k] = self.0[k].sqrt();
                }
                self
            }
            #[inline(always)]
            fn mul_add(mut self, factor: Self, term: Self) -> Self {
                for k in 0..N {
                    self.0[k] = if FUSED {
                        self.0[k].mul_add(factor.0[k], term.0[k])
                    } else {
                        self.0[k] * factor.0[k] + term.0[k]
                    };
                }
                self
            }
            #[inline(always)]
            fn select_above(self, limit: Self, mut above: Self, below: Self) -> Self {
                for k in 0..N {
                    above.0[k] = if self.0[k] > limit.0[k] { above.0[k] } else { below.0[k] };
                }
                above
            }
        }

        impl<const FUSED: bool> Pack<$number> for Array<$number, FUSED> {
            const LANES: usize = N;
            #[inline(always)]
            fn broadcast(x: $number) -> Self {
                Array([x; N])
            }
            #[inline(always)]
            fn keep(mut self, mask: u16) -> Self {
                for k in 0..N {
                    // A word of ones or zeros: a broken bond may hold anything, even what is not a number.
                    let word = (mask >> k & 1) as $bits;
                    self.0[k] = <$number>::from_bits(self.0[k].to_bits() & word.wrapping_neg());
                }
                self
            }
            #[inline(always)]
            fn larger(mut self, other: Self) -> Self {
                for k in 0..N {
                    let other = other.0[k].abs();
                    self.0[k] = if other > self.0[k] { other } else { self.0[k] };
                }
                self
            }
            #[inline(always)]
            fn clamped(mut self) -> Self {
                for k in 0..N {
                    self.0[k] = self.0[k].clamp(0.0, 1.0);
                }
                self
            }
            #[inline(always)]
            fn total(self) -> $number {
                (self.0[0] + self.0[2]) + (self.0[1] + self.0[3])
            }
            #[inline(always)]
            fn largest(self) -> f64 {
                let mut largest = self.0[0];
                for k in 1..N {
                    largest = if self.0[k] > largest { self.0[k] } else { largest };
                }
                largest.to_f64()
            }
            #[inline(always)]
            fn is_below(self, limit: Self, mask: u16) -> bool {
                (0..N).all(|k| mask >> k & 1 == 0 || self.0[k] < limit.0[k])
            }
            #[inline(always)]
            fn lane(self, k: usize) -> f64 {
                self.0[k].to_f64()
            }
            #[inline(always)]
            unsafe fn load(source: *const $number) -> Self {
                Array(unsafe { source.cast::<[$number; N]>().read_unaligned() })
            }
            #[inline(always)]
            unsafe fn put(self, target: *mut $number) {
                unsafe { target.cast::<[$number; N]>().write_unaligned(self.0) }
            }
            #[inline(always)]
            fn inverse_root_guess(mut self) -> Self {
                for k in 0..N {
                    self.0[k] = <$number>::from_bits($magic - (self.0[k].to_bits() >> 1));
                }
                self
            }
        }
    };
}
numbers!(f64, u64, false, GUESS_DOUBLE);
numbers!(f32, u32, true, GUESS_SINGLE);

macro_rules! ends {
    ($bond:ty, $field:ty) => {
        impl<const FUSED: bool> LoadEnds<$field> for Array<$bond, FUSED> {
            type Held = [$field; N];
            const NOTHING: Self::Held = [0.0; N];
            #[inline(always)]
            unsafe fn hold(source: *const $field) -> Self::Held {
                unsafe { source.cast::<[$field; N]>().read_unaligned() }
            }
            #[inline(always)]
            fn same(value: $field) -> Self::Held {
                [value; N]
            }
            #[inline(always)]
            unsafe fn gather(records: *const [$field; 4], index: *const u32) -> [Self::Held; 4] {
                let mut values = [[0.0; N]; 4];
                for k in 0..N {
                    let record = unsafe { *records.add(*index.add(k) as usize) };
                    for c in 0..4 {
                        values[c][k] = record[c];
                    }
                }
                values
            }
            #[inline(always)]
            fn relative(there: Self::Held, here: Self::Held, mask: u16) -> Self {
                let mut relative = Array([0.0; N]);
                for k in 0..N {
                    relative.0[k] = (there[k] - here[k]) as $bond;
                }
                if mask & 0xf == 0xf { relative } else { relative.keep(mask) }
            }
            #[inline(always)]
            fn opposite(mut here: Self::Held) -> Self::Held {
                for k in 0..N {
                    here[k] = -here[k];
                }
                here
            }
            #[inline(always)]
            fn twice(mut here: Self::Held) -> Self::Held {
                for k in 0..N {
                    here[k] += here[k];
                }
                here
            }
            #[inline(always)]
            fn bend(after: Self::Held, before: Self::Held, twice: Self::Held) -> Self {
                let mut bend = Array([0.0; N]);
                for k in 0..N {
                    bend.0[k] = ((after[k] + before[k]) - twice[k]) as $bond;
                }
                bend
            }
            #[inline(always)]
            unsafe fn store(self, target: *mut $field) {
                let mut values = [0.0; N];
                for k in 0..N {
                    values[k] = self.0[k] as $field;
                }
                unsafe { target.cast::<[$field; N]>().write_unaligned(values) }
            }
        }
    };
}
ends!(f64, f64);
ends!(f32, f32);
ends!(f32, f64);

impl<const FUSED: bool> BondVectors<[f64; 4]> for Array<f64, FUSED> {
    #[inline(always)]
    unsafe fn between(sites: *const [f64; 4], index: *const u32, here: [f64; 4], _unit: f64) -> ([Self; 3], Self) {
        let [x, y, z, volume] = unsafe { <Self as LoadEnds<f64>>::gather(sites, index) };
        let mut xi = [Array(x), Array(y), Array(z)];
        for d in 0..3 {
            for k in 0..N {
                xi[d].0[k] -= here[d];
            }
        }
        (xi, Array(volume))
    }
}

impl<const FUSED: bool> BondVectors<[i32; 4]> for Array<f32, FUSED> {
    #[inline(always)]
    unsafe fn between(sites: *const [i32; 4], index: *const u32, here: [i32; 4], unit: f64) -> ([Self; 3], Self) {
        let (mut xi, mut volume) = ([Array([0.0; N]); 3], Array([0.0; N]));
        for k in 0..N {
            let site = unsafe { *sites.add(*index.add(k) as usize) };
            for d in 0..3 {
                xi[d].0[k] = (site[d] - here[d]) as f32 * unit as f32;
            }
            volume.0[k] = f32::from_bits(site[3].cast_unsigned());
        }
        (xi, volume)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_without_a_bit_need_not_be_below() {
        let lanes = Array::<f64, false>([1.0, 3.0, f64::NAN, 2.0]);
        let limit = Array([2.0; 4]);
        for (mask, below) in
            [(0b0001, true), (0b0011, false), (0b0101, false), (0b1001, false), (0b11_0001, true), (0, true)]
        {
            assert_eq!(lanes.is_below(limit, mask), below, "{mask:b}");
        }
    }

    #[test]
    fn keep_zeroes_exactly_the_lanes_without_a_bit() {
        assert_eq!(Array::<f64, false>([1.0, -2.0, f64::NAN, 4.0]).keep(0b11_1010).0, [0.0, -2.0, 0.0, 4.0]);
        assert_eq!(Array::<f32, true>([1.0, -2.0, f32::NAN, 4.0]).keep(0b11_1010).0, [0.0, -2.0, 0.0, 4.0]);
    }
}
