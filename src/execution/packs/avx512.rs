//! Sixteen numbers in AVX-512 registers: two of `f64`, or one of `f32`.
//!
//! Everything here is inlined into functions that are compiled for AVX-512 and called only where the processor has it.

// SAFETY of every intrinsic of this file: `execution` detects the features before it enters code that uses these types.
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use super::{BondVectors, GUESS_DOUBLE, GUESS_SINGLE, LoadEnds, Pack};
use crate::lane::Lane;

const N: usize = 16;

#[derive(Clone, Copy)]
pub struct F64([__m512d; 2]);

#[derive(Clone, Copy)]
pub struct F32(__m512);

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
    Add add _mm512_add_pd _mm512_add_ps,
    Sub sub _mm512_sub_pd _mm512_sub_ps,
    Mul mul _mm512_mul_pd _mm512_mul_ps,
    Div div _mm512_div_pd _mm512_div_ps
);

impl Lane for F64 {
    const SINGLE: bool = false;
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self::broadcast(x)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        unsafe { F64([_mm512_sqrt_pd(self.0[0]), _mm512_sqrt_pd(self.0[1])]) }
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        let (a, b, c) = (self.0, factor.0, term.0);
        unsafe { F64([_mm512_fmadd_pd(a[0], b[0], c[0]), _mm512_fmadd_pd(a[1], b[1], c[1])]) }
    }
    #[inline(always)]
    fn select_above(self, limit: Self, above: Self, below: Self) -> Self {
        unsafe {
            let low = _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0[0], limit.0[0]);
            let high = _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0[1], limit.0[1]);
            let select = |mask, above, below| _mm512_mask_blend_pd(mask, below, above);
            F64([select(low, above.0[0], below.0[0]), select(high, above.0[1], below.0[1])])
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
        unsafe { F32(_mm512_sqrt_ps(self.0)) }
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        unsafe { F32(_mm512_fmadd_ps(self.0, factor.0, term.0)) }
    }
    #[inline(always)]
    fn select_above(self, limit: Self, above: Self, below: Self) -> Self {
        unsafe {
            let mask = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, limit.0);
            F32(_mm512_mask_blend_ps(mask, below.0, above.0))
        }
    }
}

/// Of two numbers the one of larger magnitude, without its sign.
const LARGER: i32 = 0b1011;

impl Pack<f64> for F64 {
    const LANES: usize = N;
    #[inline(always)]
    fn broadcast(x: f64) -> Self {
        unsafe { F64([_mm512_set1_pd(x); 2]) }
    }
    #[inline(always)]
    fn keep(self, mask: u16) -> Self {
        let [low, high] = halves(mask);
        unsafe { F64([_mm512_maskz_mov_pd(low, self.0[0]), _mm512_maskz_mov_pd(high, self.0[1])]) }
    }
    #[inline(always)]
    fn with(self, other: Self, mask: u16) -> Self {
        let [low, high] = halves(mask);
        let (a, b) = (self.0, other.0);
        unsafe { F64([_mm512_mask_mov_pd(a[0], low, b[0]), _mm512_mask_mov_pd(a[1], high, b[1])]) }
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        let (a, b) = (self.0, other.0);
        unsafe { F64([_mm512_range_pd::<LARGER>(a[0], b[0]), _mm512_range_pd::<LARGER>(a[1], b[1])]) }
    }
    #[inline(always)]
    fn clamped(self) -> Self {
        unsafe {
            let (zero, one) = (_mm512_setzero_pd(), _mm512_set1_pd(1.0));
            F64(self.0.map(|x| _mm512_min_pd(_mm512_max_pd(x, zero), one)))
        }
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        unsafe { _mm512_reduce_max_pd(_mm512_max_pd(self.0[0], self.0[1])) }
    }
    #[inline(always)]
    fn is_below(self, limit: Self, mask: u16) -> bool {
        let [low, high] = halves(mask);
        // Not less, unordered counts.
        unsafe {
            let a = _mm512_mask_cmp_pd_mask::<_CMP_NLT_UQ>(low, self.0[0], limit.0[0]);
            let b = _mm512_mask_cmp_pd_mask::<_CMP_NLT_UQ>(high, self.0[1], limit.0[1]);
            a | b == 0
        }
    }
    #[inline(always)]
    fn total(self) -> f64 {
        unsafe {
            let eight = _mm512_add_pd(self.0[0], self.0[1]);
            let four = _mm256_add_pd(_mm512_castpd512_pd256(eight), _mm512_extractf64x4_pd::<1>(eight));
            let two = _mm_add_pd(_mm256_castpd256_pd128(four), _mm256_extractf128_pd::<1>(four));
            _mm_cvtsd_f64(_mm_add_sd(two, _mm_unpackhi_pd(two, two)))
        }
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
            let magic = _mm512_set1_epi64(GUESS_DOUBLE.cast_signed());
            let guess =
                |x| _mm512_castsi512_pd(_mm512_sub_epi64(magic, _mm512_srli_epi64::<1>(_mm512_castpd_si512(x))));
            F64([guess(self.0[0]), guess(self.0[1])])
        }
    }
    #[inline(always)]
    fn lane(self, k: usize) -> f64 {
        let mut values = [0.0; N];
        unsafe { self.store(values.as_mut_ptr()) };
        values[k]
    }
}

impl Pack<f32> for F32 {
    const LANES: usize = N;
    #[inline(always)]
    fn broadcast(x: f32) -> Self {
        unsafe { F32(_mm512_set1_ps(x)) }
    }
    #[inline(always)]
    fn keep(self, mask: u16) -> Self {
        unsafe { F32(_mm512_maskz_mov_ps(mask, self.0)) }
    }
    #[inline(always)]
    fn with(self, other: Self, mask: u16) -> Self {
        unsafe { F32(_mm512_mask_mov_ps(self.0, mask, other.0)) }
    }
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        unsafe { F32(_mm512_range_ps::<LARGER>(self.0, other.0)) }
    }
    #[inline(always)]
    fn clamped(self) -> Self {
        unsafe { F32(_mm512_min_ps(_mm512_max_ps(self.0, _mm512_setzero_ps()), _mm512_set1_ps(1.0))) }
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        unsafe { f64::from(_mm512_reduce_max_ps(self.0)) }
    }
    #[inline(always)]
    fn is_below(self, limit: Self, mask: u16) -> bool {
        unsafe { _mm512_mask_cmp_ps_mask::<_CMP_NLT_UQ>(mask, self.0, limit.0) == 0 }
    }
    #[inline(always)]
    fn total(self) -> f32 {
        unsafe {
            let eight = _mm256_add_ps(_mm512_castps512_ps256(self.0), _mm512_extractf32x8_ps::<1>(self.0));
            let four = _mm_add_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps::<1>(eight));
            let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)))
        }
    }
    #[inline(always)]
    unsafe fn load(source: *const f32) -> Self {
        F32(unsafe { _mm512_loadu_ps(source) })
    }
    #[inline(always)]
    unsafe fn put(self, target: *mut f32) {
        unsafe { LoadEnds::<f32>::store(self, target) }
    }
    #[inline(always)]
    fn inverse_root_guess(self) -> Self {
        unsafe {
            let half = _mm512_srli_epi32::<1>(_mm512_castps_si512(self.0));
            let magic = _mm512_set1_epi32(GUESS_SINGLE.cast_signed());
            F32(_mm512_castsi512_ps(_mm512_sub_epi32(magic, half)))
        }
    }
    #[inline(always)]
    fn lane(self, k: usize) -> f64 {
        let mut values = [0.0_f32; N];
        unsafe { self.store(values.as_mut_ptr()) };
        f64::from(values[k])
    }
}

#[inline(always)]
fn halves(mask: u16) -> [__mmask8; 2] {
    [mask as u8, (mask >> 8) as u8]
}

#[inline(always)]
unsafe fn load(source: *const f64) -> [__m512d; 2] {
    unsafe { [_mm512_loadu_pd(source), _mm512_loadu_pd(source.add(8))] }
}

/// Sixteen records of four numbers, component by component.
#[inline(always)]
unsafe fn gather(records: *const [f64; 4], index: *const u32) -> [[__m512d; 2]; 4] {
    let [low, high] = unsafe { [gather_half(records, index), gather_half(records, index.add(8))] };
    [[low[0], high[0]], [low[1], high[1]], [low[2], high[2]], [low[3], high[3]]]
}

/// Eight records: each is loaded whole, and the four numbers of all are transposed in registers.
#[inline(always)]
unsafe fn gather_half(records: *const [f64; 4], index: *const u32) -> [__m512d; 4] {
    unsafe {
        let record = |k: usize| _mm256_loadu_pd(records.add(*index.add(k) as usize).cast());
        let pair = |k: usize| _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(record(k)), record(k + 4));
        let (a, b, c, d) = (pair(0), pair(1), pair(2), pair(3));
        // Even numbers (x and z) and odd ones (y and w) of records 0 1 4 5, and of 2 3 6 7.
        let (even, odd) = (_mm512_unpacklo_pd(a, b), _mm512_unpackhi_pd(a, b));
        let (even2, odd2) = (_mm512_unpacklo_pd(c, d), _mm512_unpackhi_pd(c, d));
        let first = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13);
        let second = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
        [
            _mm512_permutex2var_pd(even, first, even2),
            _mm512_permutex2var_pd(odd, first, odd2),
            _mm512_permutex2var_pd(even, second, even2),
            _mm512_permutex2var_pd(odd, second, odd2),
        ]
    }
}

/// As [`gather`], for records of four bytes a number.
#[inline(always)]
unsafe fn gather_single(records: *const [f32; 4], index: *const u32) -> [__m512; 4] {
    unsafe {
        let record = |k: usize| _mm_loadu_ps(records.add(*index.add(k) as usize).cast());
        let four = |k: usize| {
            let quads = _mm512_insertf32x4::<1>(_mm512_castps128_ps512(record(k)), record(k + 4));
            _mm512_insertf32x4::<3>(_mm512_insertf32x4::<2>(quads, record(k + 8)), record(k + 12))
        };
        let (a, b, c, d) = (four(0), four(1), four(2), four(3));
        // In each quarter: x x y y and z z w w of two records, then x x x x and so on of four.
        let (ab, ab2) = (_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
        let (cd, cd2) = (_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d));
        [
            _mm512_shuffle_ps::<0x44>(ab, cd),
            _mm512_shuffle_ps::<0xee>(ab, cd),
            _mm512_shuffle_ps::<0x44>(ab2, cd2),
            _mm512_shuffle_ps::<0xee>(ab2, cd2),
        ]
    }
}

impl BondVectors<[f64; 4]> for F64 {
    #[inline(always)]
    unsafe fn between(sites: *const [f64; 4], index: *const u32, here: [f64; 4], _unit: f64) -> ([Self; 3], Self) {
        let [x, y, z, volume] = unsafe { gather(sites, index) };
        let from = |there: [__m512d; 2], here: f64| F64(there) - F64::broadcast(here);
        ([from(x, here[0]), from(y, here[1]), from(z, here[2])], F64(volume))
    }
}

impl BondVectors<[i32; 4]> for F32 {
    #[inline(always)]
    unsafe fn between(sites: *const [i32; 4], index: *const u32, here: [i32; 4], unit: f64) -> ([Self; 3], Self) {
        unsafe {
            let [x, y, z, volume] = gather_single(sites.cast(), index);
            let from = |there: __m512, here: i32| {
                let units = _mm512_sub_epi32(_mm512_castps_si512(there), _mm512_set1_epi32(here));
                F32(_mm512_cvtepi32_ps(units)) * F32::splat(unit)
            };
            ([from(x, here[0]), from(y, here[1]), from(z, here[2])], F32(volume))
        }
    }
}

impl LoadEnds<f64> for F64 {
    type Held = [__m512d; 2];
    // SAFETY: zeros are numbers.
    const NOTHING: Self::Held = unsafe { std::mem::zeroed() };
    #[inline(always)]
    unsafe fn hold(source: *const f64) -> Self::Held {
        unsafe { load(source) }
    }
    #[inline(always)]
    fn same(value: f64) -> Self::Held {
        unsafe { [_mm512_set1_pd(value); 2] }
    }
    #[inline(always)]
    unsafe fn gather(records: *const [f64; 4], index: *const u32) -> [Self::Held; 4] {
        unsafe { gather(records, index) }
    }
    #[inline(always)]
    fn relative(there: Self::Held, here: Self::Held, mask: u16) -> Self {
        let [low, high] = halves(mask);
        unsafe { F64([_mm512_maskz_sub_pd(low, there[0], here[0]), _mm512_maskz_sub_pd(high, there[1], here[1])]) }
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
            _mm512_storeu_pd(target, self.0[0]);
            _mm512_storeu_pd(target.add(8), self.0[1]);
        }
    }
}

impl LoadEnds<f32> for F32 {
    type Held = __m512;
    // SAFETY: zeros are numbers.
    const NOTHING: Self::Held = unsafe { std::mem::zeroed() };
    #[inline(always)]
    unsafe fn hold(source: *const f32) -> Self::Held {
        unsafe { _mm512_loadu_ps(source) }
    }
    #[inline(always)]
    fn same(value: f32) -> Self::Held {
        unsafe { _mm512_set1_ps(value) }
    }
    #[inline(always)]
    unsafe fn gather(records: *const [f32; 4], index: *const u32) -> [Self::Held; 4] {
        unsafe { gather_single(records, index) }
    }
    #[inline(always)]
    fn relative(there: Self::Held, here: Self::Held, mask: u16) -> Self {
        unsafe { F32(_mm512_maskz_sub_ps(mask, there, here)) }
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
        unsafe { _mm512_storeu_ps(target, self.0) }
    }
}

impl LoadEnds<f64> for F32 {
    type Held = [__m512d; 2];
    // SAFETY: zeros are numbers.
    const NOTHING: Self::Held = unsafe { std::mem::zeroed() };
    #[inline(always)]
    unsafe fn hold(source: *const f64) -> Self::Held {
        unsafe { load(source) }
    }
    #[inline(always)]
    fn same(value: f64) -> Self::Held {
        unsafe { [_mm512_set1_pd(value); 2] }
    }
    #[inline(always)]
    unsafe fn gather(records: *const [f64; 4], index: *const u32) -> [Self::Held; 4] {
        unsafe { gather(records, index) }
    }
    #[inline(always)]
    fn relative(there: Self::Held, here: Self::Held, mask: u16) -> Self {
        narrow(F64(there) - F64(here)).keep(mask)
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
            _mm512_storeu_pd(target, _mm512_cvtps_pd(_mm512_castps512_ps256(self.0)));
            _mm512_storeu_pd(target.add(8), _mm512_cvtps_pd(_mm512_extractf32x8_ps::<1>(self.0)));
        }
    }
}

#[inline(always)]
fn narrow(F64([low, high]): F64) -> F32 {
    unsafe { F32(_mm512_insertf32x8::<1>(_mm512_castps256_ps512(_mm512_cvtpd_ps(low)), _mm512_cvtpd_ps(high))) }
}
