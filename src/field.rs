//! Values at points: small vectors, flat component-major fields, and the borrowed views that writers see.
//!
//! A field of vectors is one flat slice, component after component (`[u_x of all slots, u_y of all slots, …]`), so
//! that solvers see plain numbers and the bond loops see structure-of-arrays. Deliberately absent: any owner of
//! fields by name. Names exist for output only.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul};

use crate::unknown::{Numbers, Vectors};
use crate::visit::Visitor;

/// A number that a field is stored in, or that the arithmetic along a bond is done in: `f64` or `f32`.
pub trait Number:
    Copy
    + Default
    + PartialOrd
    + Debug
    + Send
    + Sync
    + Add<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + 'static
{
    fn from_f64(x: f64) -> Self;
    fn to_f64(self) -> f64;
    /// |x| < limit
    fn is_below(self, limit: Self) -> bool;
    /// Its bytes, the lowest first.
    fn bytes(self) -> impl AsRef<[u8]>;
    /// The vectors of a body, as solvers see them.
    fn numbers(vectors: Vectors<'_, Self>) -> Numbers<'_>;
    /// Of two copies of the same values, that of these numbers.
    fn choose<'a>(double: &'a [f64], single: &'a [f32]) -> &'a [Self];
    /// Hands a vector over in the numbers that it is stored in.
    fn visit(values: &mut Vec<Self>, name: &str, visitor: &mut dyn Visitor);
    /// A fraction of a length that is nothing: far below rounding, far above the smallest numbers, which are slow.
    const NEGLIGIBLE: f64;
}

impl Number for f64 {
    fn numbers(vectors: Vectors<'_, Self>) -> Numbers<'_> {
        Numbers::Double(vectors)
    }
    fn choose<'a>(double: &'a [f64], _: &'a [f32]) -> &'a [Self] {
        double
    }
    fn visit(values: &mut Vec<Self>, name: &str, visitor: &mut dyn Visitor) {
        visitor.doubles(name, values);
    }
    const NEGLIGIBLE: f64 = 1e-150;
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
    #[inline(always)]
    fn is_below(self, limit: Self) -> bool {
        self.abs() < limit
    }
    fn bytes(self) -> impl AsRef<[u8]> {
        self.to_le_bytes()
    }
}

impl Number for f32 {
    fn numbers(vectors: Vectors<'_, Self>) -> Numbers<'_> {
        Numbers::Single(vectors)
    }
    fn choose<'a>(_: &'a [f64], single: &'a [f32]) -> &'a [Self] {
        single
    }
    fn visit(values: &mut Vec<Self>, name: &str, visitor: &mut dyn Visitor) {
        visitor.singles(name, values);
    }
    const NEGLIGIBLE: f64 = 1e-20;
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x as f32
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn is_below(self, limit: Self) -> bool {
        self.abs() < limit
    }
    fn bytes(self) -> impl AsRef<[u8]> {
        self.to_le_bytes()
    }
}

/// What a run stores its fields in, and what it computes bonds in.
pub trait Precision: Copy + Debug + Default + Send + Sync + 'static {
    type Field: Number;
    type Bond: Number;
    const NAME: &str;
}

/// Fields and bonds in `f64`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Double;
/// Fields and bonds in `f32`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Single;
/// Fields in `f64`; the displacements of the ends of a bond are subtracted in `f64`, the rest of a bond is `f32`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Mixed;

impl Precision for Double {
    type Field = f64;
    type Bond = f64;
    const NAME: &str = "double";
}
impl Precision for Single {
    type Field = f32;
    type Bond = f32;
    const NAME: &str = "single";
}
impl Precision for Mixed {
    type Field = f64;
    type Bond = f32;
    const NAME: &str = "mixed";
}

/// A vector of the space: position, displacement, force. The unit stands where it is used.
pub type Vector<const D: usize> = [f64; D];

/// a · b
#[inline]
pub fn dot<const D: usize>(a: &Vector<D>, b: &Vector<D>) -> f64 {
    let mut sum = 0.0;
    for d in 0..D {
        sum += a[d] * b[d];
    }
    sum
}

/// |a|
#[inline]
pub fn norm<const D: usize>(a: &Vector<D>) -> f64 {
    dot(a, a).sqrt()
}

/// a − b
#[inline]
pub fn difference<const D: usize>(a: &Vector<D>, b: &Vector<D>) -> Vector<D> {
    let mut c = *a;
    for d in 0..D {
        c[d] -= b[d];
    }
    c
}

/// The components of a flat field of `N` components.
#[inline]
pub fn components<const N: usize, T>(flat: &[T]) -> [&[T]; N] {
    let n = flat.len() / N;
    std::array::from_fn(|k| &flat[k * n..(k + 1) * n])
}

/// The components of a flat field of `N` components, to be written.
#[inline]
pub fn components_mut<const N: usize, T>(flat: &mut [T]) -> [&mut [T]; N] {
    let n = flat.len() / N;
    let mut rest = flat;
    std::array::from_fn(|_| {
        let (head, tail) = std::mem::take(&mut rest).split_at_mut(n);
        rest = tail;
        head
    })
}

/// A vector of dimension `D` as one of three components, zeros behind.
#[inline]
pub fn embed<const D: usize>(a: &Vector<D>) -> [f64; 3] {
    std::array::from_fn(|k| if k < D { a[k] } else { 0.0 })
}

/// What a field holds, which decides how writers store it and what pictures show of it.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// One number a point.
    Scalar(Vec<f64>),
    /// Three components a point, zeros beyond the dimension.
    Vector(Vec<[f64; 3]>),
    /// A symmetric tensor a point: xx yy zz xy yz xz, the order of VTK.
    Tensor(Vec<[f64; 6]>),
    /// The three principal values of a tensor, the largest first.
    Principal(Vec<[f64; 3]>),
}

/// Which of the [`Values`] a field has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Scalar,
    Vector,
    Tensor,
    Principal,
}

/// The components of a symmetric tensor, in the order that they are stored in.
pub const TENSOR: [&str; 6] = ["xx", "yy", "zz", "xy", "yz", "xz"];

impl Kind {
    /// The names of the components that there are in a dimension, by their number; none of a number. A tensor has zz in 2D
    /// too.
    pub fn components(self, dimension: usize) -> &'static [&'static str] {
        match self {
            Kind::Scalar => &[],
            Kind::Vector => &["x", "y", "z"][..dimension],
            Kind::Tensor => &TENSOR[..[1, 4, 6][dimension - 1]],
            Kind::Principal => &["1", "2", "3"],
        }
    }
}

impl Values {
    pub fn kind(&self) -> Kind {
        match self {
            Values::Scalar(_) => Kind::Scalar,
            Values::Vector(_) => Kind::Vector,
            Values::Tensor(_) => Kind::Tensor,
            Values::Principal(_) => Kind::Principal,
        }
    }

    /// How many numbers they are.
    pub fn numbers(&self) -> usize {
        match self {
            Values::Scalar(values) => values.len(),
            Values::Vector(values) | Values::Principal(values) => 3 * values.len(),
            Values::Tensor(values) => 6 * values.len(),
        }
    }

    /// The numbers of one point, one of each component that is stored.
    pub fn of(&self, point: usize) -> &[f64] {
        match self {
            Values::Scalar(values) => std::slice::from_ref(&values[point]),
            Values::Vector(values) | Values::Principal(values) => &values[point],
            Values::Tensor(values) => &values[point],
        }
    }
}

/// A named field at the points of a body, in point order, with its SI unit (`""` for none).
#[derive(Debug, Clone)]
pub struct Field {
    pub name: &'static str,
    pub unit: &'static str,
    pub values: Values,
}

impl Field {
    /// The value at one point: a field of one value.
    pub fn at(&self, point: usize) -> Field {
        let values = match &self.values {
            Values::Scalar(values) => Values::Scalar(vec![values[point]]),
            Values::Vector(values) => Values::Vector(vec![values[point]]),
            Values::Tensor(values) => Values::Tensor(vec![values[point]]),
            Values::Principal(values) => Values::Principal(vec![values[point]]),
        };
        Field { values, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_split_a_flat_field_without_overlap() {
        let mut flat = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let [x, y, z] = components::<3, _>(&flat);
        assert_eq!((x, y, z), (&[1.0, 2.0][..], &[3.0, 4.0][..], &[5.0, 6.0][..]));
        let [_, y] = components_mut::<2, _>(&mut flat);
        y[0] = 9.0;
        assert_eq!(flat, [1.0, 2.0, 3.0, 9.0, 5.0, 6.0]);
    }
}
