//! Numbers side by side: the registers that laws are evaluated on, by set of instructions and precision.
//!
//! [`Array`] is plain arrays, which the compiler turns into whatever registers the target has (SSE2, NEON). For AVX2 and
//! AVX-512, which are chosen at run time, there are types of their own: the compiler takes long to find wide registers
//! in plain arrays, and mask registers make broken bonds free. A number goes through the same operations whichever pack
//! it sits in, so all sets of instructions with fused multiply-add agree to the last bit.

mod array;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

use crate::family::Sites;
use crate::field::{Double, Mixed, Number, Precision, Single};
use crate::lane::{Lane, polynomial};
use array::Array;

/// The sets of instructions that loops are compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instructions {
    Baseline,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Instructions {
    /// Those that this machine has, the widest last.
    pub fn available() -> Vec<Instructions> {
        let mut list = vec![Instructions::Baseline];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                list.push(Instructions::Avx2);
            }
            if list.len() == 2
                && is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512bw")
            {
                list.push(Instructions::Avx512);
            }
        }
        list
    }
}

/// All-ones or all-zeros words for each pattern of eight bits.
#[cfg(target_arch = "x86_64")]
static KEEP: [[u32; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let mut k = 0;
        while k < 8 {
            if mask >> k & 1 == 1 {
                table[mask][k] = u32::MAX;
            }
            k += 1;
        }
        mask += 1;
    }
    table
};

/// Half of these less half of a positive number, both as integers, is near 1/√ of the number: the logarithm of a number
/// is about its bits.
const GUESS_DOUBLE: u64 = 0x5fe6_eb50_c7b5_37a9;
const GUESS_SINGLE: u32 = 0x5f37_59df;

/// Bonds side by side, computed in numbers `B`.
pub trait Pack<B: Number>: Lane {
    /// How many: 4, 8 or 16.
    const LANES: usize;
    fn broadcast(x: B) -> Self;
    /// Keeps the lanes whose bit is set, zeroes the others. Bits beyond the lanes are ignored.
    fn keep(self, mask: u16) -> Self;
    /// `other` in the lanes whose bit is set.
    #[inline(always)]
    fn with(self, other: Self, mask: u16) -> Self {
        // One of both is zero in each lane: exactly the other.
        self.keep(!mask) + other.keep(mask)
    }
    /// The larger of |self| and |other| in each lane; of a number and a NaN, the number.
    fn larger(self, other: Self) -> Self;
    /// Between zero and one: what lies outside is drawn to the nearer of them.
    fn clamped(self) -> Self;
    /// The largest lane.
    fn largest(self) -> f64;
    /// Whether all lanes whose bit is set are below those of `limit`; a NaN is not.
    fn is_below(self, limit: Self, mask: u16) -> bool;
    /// The sum of the lanes: each of the lower half and its fellow of the upper half, and so on with the halves.
    fn total(self) -> B;
    fn lane(self, k: usize) -> f64;
    /// The numbers at `source`.
    ///
    /// # Safety
    /// As many as there are lanes must stand there.
    unsafe fn load(source: *const B) -> Self;
    /// # Safety
    /// There must be room for as many numbers as there are lanes.
    unsafe fn put(self, target: *mut B);
    /// 1/√self within 4 % for positive numbers, from their bits.
    fn inverse_root_guess(self) -> Self;

    /// 1/√self for positive numbers, to a few units of the last place: quicker than a root and a division.
    #[inline(always)]
    fn inverse_root(self) -> Self {
        // With e = 1 − x y²: 1/√x = y (1 − e)^(−1/2) = y (1 + e/2 + 3e²/8 + …). The guess leaves |e| < 0.07, the first
        // round 4e-7 (double: 35 e⁴/128 kept) or 2e-5, the second less than the last place.
        let one = Self::splat(1.0);
        let minus = Self::splat(0.0) - self;
        let y = self.inverse_root_guess();
        let e = (minus * y).mul_add(y, one);
        let y = if Self::SINGLE {
            (y * e).mul_add(polynomial([1.0 / 2.0, 3.0 / 8.0, 5.0 / 16.0], e), y)
        } else {
            (y * e).mul_add(polynomial([1.0 / 2.0, 3.0 / 8.0, 5.0 / 16.0, 35.0 / 128.0], e), y)
        };
        let e = (minus * y).mul_add(y, one);
        (y * e).mul_add(if Self::SINGLE { Self::splat(0.5) } else { polynomial([0.5, 3.0 / 8.0], e) }, y)
    }
}

/// Packs that are filled from fields of numbers `F`.
pub trait LoadEnds<F: Number>: Sized {
    /// Values as they stand in the field.
    type Held: Copy;
    const NOTHING: Self::Held;
    /// The same value everywhere.
    fn same(value: F) -> Self::Held;
    /// The values at `source`.
    ///
    /// # Safety
    /// As many numbers as there are lanes must stand there.
    unsafe fn hold(source: *const F) -> Self::Held;
    /// The members of the records that `index` names, component by component.
    ///
    /// # Safety
    /// As many indices as there are lanes must stand at `index`, each of a record.
    unsafe fn gather(records: *const [F; 4], index: *const u32) -> [Self::Held; 4];
    /// Values there less values here, zero in lanes without a bit.
    fn relative(there: Self::Held, here: Self::Held, mask: u16) -> Self;
    /// Values with the other sign: what [`LoadEnds::relative`] takes them from is added to them.
    fn opposite(here: Self::Held) -> Self::Held;
    /// Twice the values.
    fn twice(here: Self::Held) -> Self::Held;
    /// Values on two sides, added, less twice the values between.
    fn bend(after: Self::Held, before: Self::Held, twice: Self::Held) -> Self;
    /// # Safety
    /// There must be room for as many numbers as there are lanes.
    unsafe fn store(self, target: *mut F);
}

/// Packs that find the ξ of bonds between points of a cloud.
pub trait BondVectors<S>: Sized {
    /// ξ of the bonds from `here` to the sites that `index` names (m; coordinates are multiples of `unit`), and the
    /// volumes there.
    ///
    /// # Safety
    /// As [`LoadEnds::gather`].
    unsafe fn between(sites: *const S, index: *const u32, here: S, unit: f64) -> ([Self; 3], Self);
}

/// The packs of a precision, by set of instructions: what makes a precision one that the loops can run in.
pub trait Packs: Precision {
    /// Where a point of a cloud is, and its volume.
    type Site: Copy + Send + Sync;
    fn sites(sites: &Sites) -> SiteView<'_, Self::Site>;
    /// Of two memories for records of input values, the one of this precision.
    fn records<'a>(double: &'a mut Vec<[f64; 4]>, single: &'a mut Vec<[f32; 4]>) -> &'a mut Vec<[Self::Field; 4]>;
    /// Of what every processor of the architecture has. x86-64 has no fused multiply-add there, so that results differ
    /// from those of wider instructions in the last bits.
    type Baseline: Pack<Self::Bond> + LoadEnds<Self::Field> + BondVectors<Self::Site>;
    /// Of AVX2 with fused multiply-add.
    #[cfg(target_arch = "x86_64")]
    type Avx2: Pack<Self::Bond> + LoadEnds<Self::Field> + BondVectors<Self::Site>;
    /// Of AVX-512 (F, DQ, BW, VL).
    #[cfg(target_arch = "x86_64")]
    type Avx512: Pack<Self::Bond> + LoadEnds<Self::Field> + BondVectors<Self::Site>;
}

/// Whether the baseline of the target fuses multiplications with additions, as NEON does.
const BASELINE_FUSES: bool = cfg!(any(target_feature = "fma", target_arch = "aarch64"));

macro_rules! choose {
    (double $double:ident $single:ident) => {
        $double
    };
    (single $double:ident $single:ident) => {
        $single
    };
}

macro_rules! packs {
    ($($precision:ident: fields $fields:ident, bonds $number:ident $wide:ident, sites $sites:ident $site:ty;)*) => {$(
        impl Packs for $precision {
            type Site = $site;
            fn sites(sites: &Sites) -> SiteView<'_, $site> {
                SiteView::$sites(sites)
            }
            fn records<'a>(
                _double: &'a mut Vec<[f64; 4]>,
                _single: &'a mut Vec<[f32; 4]>,
            ) -> &'a mut Vec<[Self::Field; 4]> {
                choose!($fields _double _single)
            }
            type Baseline = Array<$number, BASELINE_FUSES>;
            #[cfg(target_arch = "x86_64")]
            type Avx2 = avx2::$wide;
            #[cfg(target_arch = "x86_64")]
            type Avx512 = avx512::$wide;
        }
    )*};
}
packs!(
    Double: fields double, bonds f64 F64, sites floating [f64; 4];
    Single: fields single, bonds f32 F32, sites fixed [i32; 4];
    Mixed: fields double, bonds f32 F32, sites fixed [i32; 4];
);

/// The sites of a cloud as one precision reads them.
pub struct SiteView<'a, S> {
    pub records: &'a [S],
    /// Of the coordinates, m.
    pub unit: f64,
    /// Of the volumes, m³.
    pub volume_unit: f64,
}

impl<'a> SiteView<'a, [f64; 4]> {
    fn floating(sites: &'a Sites) -> Self {
        SiteView { records: &sites.records, unit: 1.0, volume_unit: 1.0 }
    }
}

impl<'a> SiteView<'a, [i32; 4]> {
    fn fixed(sites: &'a Sites) -> Self {
        let fixed = sites.fixed();
        SiteView { records: &fixed.records, unit: fixed.unit, volume_unit: fixed.volume_unit }
    }
}
