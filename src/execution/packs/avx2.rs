//! Eight numbers in AVX2 registers: two of `f64`, or one of `f32`.
//!
//! Everything here is inlined into functions that are compiled for AVX2 and called only where the processor has it.

// SAFETY of every intrinsic of this file: `execution` detects the features before it enters code that uses these types.
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use super::{BondVectors, GUESS_DOUBLE, GUESS_SINGLE, KEEP, LoadEnds, Pack};
use crate::lane::Lane;

const N: usize = 8;

#[derive(Clone, Copy)]
pub struct F64([__m256d; 2]);

#[derive(Clone, Copy)]
pub struct F32(__m256);

macro_rules! operators {
    ($($trait:ident $method:ident $double:ident $single:ident),*) => {$(
        impl $trait for F64 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                unsafe { F64([$double(self.0[0], other.0[0]), $double(self.0[1], other.0[1])]) }
            }
        }
        impl $trait for F32 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                unsafe { F32($single(self.0, other.0)) }
            }
        }
    )*};
}
operators!(
    Add add _mm256_add_pd _mm256_add_ps,
    Sub sub _mm256_sub_pd _mm256_sub_ps,
    Mul mul _mm256_mul_pd _mm256_mul_ps,
    Div div _mm256_div_pd _mm256_div_ps
);

impl Lane for F64 {
    const SINGLE: bool = false;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self::broadcast(x)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        unsafe { F64([_mm256_sqrt_pd(self.0[0]), _mm256_sqrt_pd(self.0[1])]) }
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        let (a, b, c) = (self.0, factor.0, term.0);
        unsafe { F64([_mm256_fmadd_pd(a[0], b[0], c[0]), _mm256_fmadd_pd(a[1], b[1], c[1])]) }
    }
    #[inline(always)]
    fn select_above(self, limit: Self, above: Self, below: Self) -> Self {
        unsafe {
            let low = _mm256_cmp_pd::<_CMP_GT_OQ>(self.0[0], limit.0[0]);
            let high = _mm256_cmp_pd::<_CMP_GT_OQ>(self.0[1], limit.0[1]);
            F64([_mm256_blendv_pd(below.0[0], above.0[0], low), _mm256_blendv_pd(below.0[1], above.0[1], high)])
        }
    }
}

impl Lane for F32 {
    const SINGLE: bool = true;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self::broadcast(x as f32)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        unsafe { F32(_mm256_sqrt_ps(self.0)) }
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        unsafe { F32(_mm256_fmadd_ps(self.0, factor.0, term.0)) }
    }
    #[inline(always)]
    fn select_above(self, limit: Self, above: Self, below: Self) -> Self {
        unsafe { F32(_mm256_blendv_ps(below.0, above.0, _mm256_cmp_ps::<_CMP_GT_OQ>(self.0, limit.0))) }
    }
}

impl Pack<f64> for F64 {
    const LANES: usize = N;
    #[inline(always)]
    fn broadcast(x: f64) -> Self {
        unsafe { F64([_mm256_set1_pd(x); 2]) }
    }
    #[inline(always)]
    fn keep(self, mask: u16) -> Self {
        let words = &KEEP[usize::from(mask & 0xff)];
        unsafe {
            let [low, high] = [0, 4].map(|k| _mm256_castsi256_pd(widened(words[k..k + 4].as_ptr())));
            F64([_mm256_and_pd(self.0[0], low), _mm256_and_pd(self.0[1], high)])
        }
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        unsafe {
            let sign = _mm256_set1_pd(-0.0);
            // Of a NaN and a number, `max` takes the second.
            let larger = |a, b| _mm256_max_pd(_mm256_andnot_pd(sign, b), a);
            F64([larger(self.0[0], other.0[0]), larger(self.0[1], other.0[1])])
        }
    }
    #[inline(always)]
    fn clamped(self) -> Self {
        unsafe {
            let (zero, one) = (_mm256_setzero_pd(), _mm256_set1_pd(1.0));
            F64(self.0.map(|x| _mm256_min_pd(_mm256_max_pd(x, zero), one)))
        }
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        (1..N).fold(self.lane(0), |largest, k| f64::max(largest, self.lane(k)))
    }
    #[inline(always)]
    fn is_below(self, limit: Self, mask: u16) -> bool {
        // Not less, unordered counts.
        let (a, b) = unsafe {
            let a = _mm256_cmp_pd::<_CMP_NLT_UQ>(self.0[0], limit.0[0]);
            let b = _mm256_cmp_pd::<_CMP_NLT_UQ>(self.0[1], limit.0[1]);
            (_mm256_movemask_pd(a), _mm256_movemask_pd(b))
        };
        (a | b << 4) & i32::from(mask) == 0
    }
    #[inline(always)]
    fn total(self) -> f64 {
        unsafe {
            let four = _mm256_add_pd(self.0[0], self.0[1]);
            let two = _mm_add_pd(_mm256_castpd256_pd128(four), _mm256_extractf128_pd::<1>(four));
            _mm_cvtsd_f64(_mm_add_sd(two, _mm_unpackhi_pd(two, two)))
        }
    }
    #[inline(always)]
    fn lane(self, k: usize) -> f64 {
        let mut values = [0.0; N];
        unsafe { self.store(values.as_mut_ptr()) };
        values[k]
    }
    #[inline(always)]
    unsafe fn load(source: *const f64) -> Self {
        F64(unsafe { load(source) })
    }
    #[inline(always)]
    unsafe fn put(self, target: *mut f64) {
        unsafe { LoadEnds::<f64>::store(self, target) }
    }
    #[inline(always)]
    fn inverse_root_guess(self) -> Self {
        unsafe {
            let magic = _mm256_set1_epi64x(GUESS_DOUBLE.cast_signed());
            let guess =
                |x| _mm256_castsi256_pd(_mm256_sub_epi64(magic, _mm256_srli_epi64::<1>(_mm256_castpd_si256(x))));
            F64([guess(self.0[0]), guess(self.0[1])])
        }
    }
}

impl Pack<f32> for F32 {
    const LANES: usize = N;
    #[inline(always)]
    fn broadcast(x: f32) -> Self {
        unsafe { F32(_mm256_set1_ps(x)) }
    }
    #[inline(always)]
    fn keep(self, mask: u16) -> Self {
        let words = &KEEP[usize::from(mask & 0xff)];
        unsafe { F32(_mm256_and_ps(self.0, _mm256_loadu_ps(words.as_ptr().cast()))) }
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        unsafe { F32(_mm256_max_ps(_mm256_andnot_ps(_mm256_set1_ps(-0.0), other.0), self.0)) }
    }
    #[inline(always)]
    fn clamped(self) -> Self {
        unsafe { F32(_mm256_min_ps(_mm256_max_ps(self.0, _mm256_setzero_ps()), _mm256_set1_ps(1.0))) }
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        (1..N).fold(self.lane(0), |largest, k| f64::max(largest, self.lane(k)))
    }
    #[inline(always)]
    fn is_below(self, limit: Self, mask: u16) -> bool {
        let beyond = unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_NLT_UQ>(self.0, limit.0)) };
        beyond & i32::from(mask) == 0
    }
    #[inline(always)]
    fn total(self) -> f32 {
        unsafe {
            let four = _mm_add_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)))
        }
    }
    #[inline(always)]
    fn lane(self, k: usize) -> f64 {
        let mut values = [0.0_f32; N];
        unsafe { self.store(values.as_mut_ptr()) };
        f64::from(values[k])
    }
    #[inline(always)]
    unsafe fn load(source: *const f32) -> Self {
        F32(unsafe { _mm256_loadu_ps(source) })
    }
    #[inline(always)]
    unsafe fn put(self, target: *mut f32) {
        unsafe { LoadEnds::<f32>::store(self, target) }
    }
    #[inline(always)]
    fn inverse_root_guess(self) -> Self {
        unsafe {
            let half = _mm256_srli_epi32::<1>(_mm256_castps_si256(self.0));
            let magic = _mm256_set1_epi32(GUESS_SINGLE.cast_signed());
            F32(_mm256_castsi256_ps(_mm256_sub_epi32(magic, half)))
        }
    }
}

/// Four words of 32 bits as four of 64, all ones or all zeros as they were.
#[inline(always)]
unsafe fn widened(words: *const u32) -> __m256i {
    unsafe { _mm256_cvtepi32_epi64(_mm_loadu_si128(words.cast())) }
}

#[inline(always)]
unsafe fn load(source: *const f64) -> [__m256d; 2] {
    unsafe { [_mm256_loadu_pd(source), _mm256_loadu_pd(source.add(4))] }
}

/// Eight records of four numbers, component by component.
#[inline(always)]
unsafe fn gather(records: *const [f64; 4], index: *const u32) -> [[__m256d; 2]; 4] {
    let [low, high] = unsafe { [gather_half(records, index), gather_half(records, index.add(4))] };
    [[low[0], high[0]], [low[1], high[1]], [low[2], high[2]], [low[3], high[3]]]
}

/// Four records, transposed.
#[inline(always)]
unsafe fn gather_half(records: *const [f64; 4], index: *const u32) -> [__m256d; 4] {
    unsafe {
        let record = |k: usize| _mm256_loadu_pd(records.add(*index.add(k) as usize).cast());
        let (a, b, c, d) = (record(0), record(1), record(2), record(3));
        let (even, odd) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
        let (even2, odd2) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
        [
            _mm256_permute2f128_pd::<0x20>(even, even2),
            _mm256_permute2f128_pd::<0x20>(odd, odd2),
            _mm256_permute2f128_pd::<0x31>(even, even2),
            _mm256_permute2f128_pd::<0x31>(odd, odd2),
        ]
    }
}

/// As [`gather`], for records of four bytes a number.
#[inline(always)]
unsafe fn gather_single(records: *const [f32; 4], index: *const u32) -> [__m256; 4] {
    unsafe {
        let record = |k: usize| _mm_loadu_ps(records.add(*index.add(k) as usize).cast());
        let pair = |k: usize| _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(record(k)), record(k + 4));
        let (a, b, c, d) = (pair(0), pair(1), pair(2), pair(3));
        let (ab, ab2) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let (cd, cd2) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0x44>(ab, cd),
            _mm256_shuffle_ps::<0xee>(ab, cd),
            _mm256_shuffle_ps::<0x44>(ab2, cd2),
            _mm256_shuffle_ps::<0xee>(ab2, cd2),
        ]
    }
}

impl BondVectors<[f64; 4]> for F64 {
    #[inline(always)]
    unsafe fn between(sites: *const [f64; 4], index: *const u32, here: [f64; 4], _unit: f64) -> ([Self; 3], Self) {
        let [x, y, z, volume] = unsafe { gather(sites, index) };
        let from = |there: [__m256d; 2], here: f64| F64(there) - F64::broadcast(here);
        ([from(x, here[0]), from(y, here[1]), from(z, here[2])], F64(volume))
    }
}

impl BondVectors<[i32; 4]> for F32 {
    #[inline(always)]
    unsafe fn between(sites: *const [i32; 4], index: *const u32, here: [i32; 4], unit: f64) -> ([Self; 3], Self) {
        unsafe {
            let [x, y, z, volume] = gather_single(sites.cast(), index);
            let from = |there: __m256, here: i32| {
                let units = _mm256_sub_epi32(_mm256_castps_si256(there), _mm256_set1_epi32(here));
                F32(_mm256_cvtepi32_ps(units)) * F32::splat(unit)
            };
            ([from(x, here[0]), from(y, here[1]), from(z, here[2])], F32(volume))
        }
    }
}

impl LoadEnds<f64> for F64 {
    type Held = [__m256d; 2];
    // SAFETY: zeros are numbers.
    const NOTHING: Self::Held = unsafe { std::mem::zeroed() };
    #[inline(always)]
    fn same(value: f64) -> Self::Held {
        unsafe { [_mm256_set1_pd(value); 2] }
    }
    #[inline(always)]
    unsafe fn hold(source: *const f64) -> Self::Held {
        unsafe { load(source) }
    }
    #[inline(always)]
    unsafe fn gather(records: *const [f64; 4], index: *const u32) -> [Self::Held; 4] {
        unsafe { gather(records, index) }
    }
    #[inline(always)]
    fn relative(there: Self::Held, here: Self::Held, mask: u16) -> Self {
        kept(F64(there) - F64(here), mask)
    }
    #[inline(always)]
    fn opposite(here: Self::Held) -> Self::Held {
        (F64::splat(0.0) - F64(here)).0
    }
    #[inline(always)]
    fn twice(here: Self::Held) -> Self::Held {
        (F64(here) + F64(here)).0
    }
    #[inline(always)]
    fn bend(after: Self::Held, before: Self::Held, twice: Self::Held) -> Self {
        F64(after) + F64(before) - F64(twice)
    }
    #[inline(always)]
    unsafe fn store(self, target: *mut f64) {
        unsafe {
            _mm256_storeu_pd(target, self.0[0]);
            _mm256_storeu_pd(target.add(4), self.0[1]);
        }
    }
}

impl LoadEnds<f32> for F32 {
    type Held = __m256;
    // SAFETY: zeros are numbers.
    const NOTHING: Self::Held = unsafe { std::mem::zeroed() };
    #[inline(always)]
    fn same(value: f32) -> Self::Held {
        unsafe { _mm256_set1_ps(value) }
    }
    #[inline(always)]
    unsafe fn hold(source: *const f32) -> Self::Held {
        unsafe { _mm256_loadu_ps(source) }
    }
    #[inline(always)]
    unsafe fn gather(records: *const [f32; 4], index: *const u32) -> [Self::Held; 4] {
        unsafe { gather_single(records, index) }
    }
    #[inline(always)]
    fn relative(there: Self::Held, here: Self::Held, mask: u16) -> Self {
        kept(F32(there) - F32(here), mask)
    }
    #[inline(always)]
    fn opposite(here: Self::Held) -> Self::Held {
        (F32::splat(0.0) - F32(here)).0
    }
    #[inline(always)]
    fn twice(here: Self::Held) -> Self::Held {
        (F32(here) + F32(here)).0
    }
    #[inline(always)]
    fn bend(after: Self::Held, before: Self::Held, twice: Self::Held) -> Self {
        F32(after) + F32(before) - F32(twice)
    }
    #[inline(always)]
    unsafe fn store(self, target: *mut f32) {
        unsafe { _mm256_storeu_ps(target, self.0) }
    }
}

impl LoadEnds<f64> for F32 {
    type Held = [__m256d; 2];
    // SAFETY: zeros are numbers.
    const NOTHING: Self::Held = unsafe { std::mem::zeroed() };
    #[inline(always)]
    fn same(value: f64) -> Self::Held {
        unsafe { [_mm256_set1_pd(value); 2] }
    }
    #[inline(always)]
    unsafe fn hold(source: *const f64) -> Self::Held {
        unsafe { load(source) }
    }
    #[inline(always)]
    unsafe fn gather(records: *const [f64; 4], index: *const u32) -> [Self::Held; 4] {
        unsafe { gather(records, index) }
    }
    #[inline(always)]
    fn relative(there: Self::Held, here: Self::Held, mask: u16) -> Self {
        kept(narrow(F64(there) - F64(here)), mask)
    }
    #[inline(always)]
    fn opposite(here: Self::Held) -> Self::Held {
        <F64 as LoadEnds<f64>>::opposite(here)
    }
    #[inline(always)]
    fn twice(here: Self::Held) -> Self::Held {
        <F64 as LoadEnds<f64>>::twice(here)
    }
    #[inline(always)]
    fn bend(after: Self::Held, before: Self::Held, twice: Self::Held) -> Self {
        narrow(<F64 as LoadEnds<f64>>::bend(after, before, twice))
    }
    #[inline(always)]
    unsafe fn store(self, target: *mut f64) {
        unsafe {
            _mm256_storeu_pd(target, _mm256_cvtps_pd(_mm256_castps256_ps128(self.0)));
            _mm256_storeu_pd(target.add(4), _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(self.0)));
        }
    }
}

/// `keep`, skipped where every bit is set: there are no mask registers, and most bonds hold.
#[inline(always)]
fn kept<B: crate::field::Number, V: Pack<B>>(pack: V, mask: u16) -> V {
    if mask & 0xff == 0xff { pack } else { pack.keep(mask) }
}

#[inline(always)]
fn narrow(F64([low, high]): F64) -> F32 {
    unsafe { F32(_mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low))) }
}
