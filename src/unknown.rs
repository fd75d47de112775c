//! The vectors that solvers advance, in whichever numbers they are stored: asked for once a pass, so that neither a solver
//! nor a condition has the numbers among its types.

use crate::field::Number;

/// The vectors of a body: ρ ü = rate − ρ c u̇, or ρ u̇ = rate where there is no velocity. All are flat, component after
/// component.
pub struct Vectors<'a, T> {
    /// u
    pub value: &'a mut [T],
    /// u̇ of an equation of second order; empty of one of first order.
    pub velocity: &'a mut [T],
    /// What changes it, at the values as they are: a force density, a rate of concentration.
    pub rate: &'a mut [T],
    /// τ (s) and where u + τ v is wanted after a drift, if it is.
    pub damped: Option<(f64, &'a mut [T])>,
    /// ρ over the inertia of the unknown, by place in a component; None where that is the inertia of all.
    pub relative_inertia: Option<RelativeInertia<'a, T>>,
}

/// ρ over the inertia of an unknown where it differs from place to place.
#[derive(Debug, Clone, Copy)]
pub struct RelativeInertia<'a, T> {
    pub relative: &'a [T],
    /// 1/relative
    pub inverse: &'a [T],
}

/// The same in the numbers that they are stored in, and what solvers need to know of them.
pub struct Unknown<'a> {
    pub vectors: Numbers<'a>,
    /// Components of a value.
    pub components: usize,
    /// ρ; 1 where values are what changes. Where it differs from place to place, what that is a multiple of.
    pub inertia: f64,
    /// Values below this count as zero. Ahead of a wave they fall off without end, and processors are slow with numbers
    /// near the smallest that they know.
    pub negligible: f64,
}

impl Unknown<'_> {
    /// τ of u + τ v, s; zero where that is not wanted.
    pub fn tau(&self) -> f64 {
        match &self.vectors {
            Numbers::Double(Vectors { damped: Some((tau, _)), .. }) => *tau,
            Numbers::Single(Vectors { damped: Some((tau, _)), .. }) => *tau,
            _ => 0.0,
        }
    }
}

/// In which numbers.
pub enum Numbers<'a> {
    Double(Vectors<'a, f64>),
    Single(Vectors<'a, f32>),
}

/// Does something with the vectors of an unknown, whatever its numbers: `with!(unknown, vectors => …)`.
macro_rules! with {
    ($unknown:expr, $vectors:ident => $work:expr) => {
        match &mut $unknown.vectors {
            $crate::unknown::Numbers::Double($vectors) => $work,
            $crate::unknown::Numbers::Single($vectors) => $work,
        }
    };
}
pub(crate) use with;

/// One component of the vectors of a body.
pub struct Component<'a, T> {
    pub value: &'a mut [T],
    /// Empty of an equation of first order.
    pub velocity: &'a mut [T],
    pub rate: &'a mut [T],
    pub relative_inertia: Option<RelativeInertia<'a, T>>,
}

impl<T: Number> Component<'_, T> {
    /// ρ at a place, of an unknown with this inertia.
    pub fn inertia(&self, unit: f64, slot: usize) -> f64 {
        self.relative_inertia.map_or(unit, |by_place| unit * by_place.relative[slot].to_f64())
    }
}

impl<T: Copy> Vectors<'_, T> {
    /// Component `c` of `n`.
    pub fn component(&mut self, c: usize, n: usize) -> Component<'_, T> {
        let [value, velocity, rate] = [&mut *self.value, &mut *self.velocity, &mut *self.rate].map(|flat| {
            let size = flat.len() / n;
            &mut flat[c * size..(c + 1) * size]
        });
        Component { value, velocity, rate, relative_inertia: self.relative_inertia }
    }
}
