//! One row for all points of a lattice, in the order in which it is summed.

use std::sync::Arc;

use super::Fit;
use crate::discretization::Heterogeneity;
use crate::error::{Error, Result};
use crate::family::{Class, mirror_sequences};
use crate::geometry::Lattice;

/// The weights K_j of (L u)(x) = Σ_j K_j (u(x + ξ_j) − u(x)) that all points of a lattice share.
///
/// Points at x + ξ and x − ξ carry the same weight and are taken together: b(ξ) = u(x + ξ) + u(x − ξ) − 2 u(x). Where ξ is
/// mirrored in an axis, the weights of K that couple this axis to another change sign and all others are the same. So are
/// sums and differences of b of all mirror images, which are weighed once; a mirrored body has mirrored bits.
#[derive(Debug, Clone)]
pub struct SharedRow<const D: usize> {
    /// Class by class. Those of a class: all with the signs of ξ as they are, then all with ξ mirrored in the first of its
    /// axes, in the second of three, in both.
    pub pairs: Vec<Pair<D>>,
    pub classes: Vec<RowClass>,
    /// What the row is multiplied by, point by point, where families of one constant have not all the same; None in a body
    /// of one.
    pub heterogeneity: Option<Arc<Heterogeneity>>,
}

/// Pairs whose ξ lie along the same axes.
#[derive(Debug, Clone, Copy)]
pub struct RowClass {
    /// How many, mirror images not counted.
    pub members: usize,
    /// The axes along which ξ is not zero, a bit each.
    pub axes: u32,
    /// Pairs of each member: 2^(axes − 1).
    pub images: usize,
}

impl RowClass {
    /// −1 if ξ of this image is mirrored in the axis, 1 if not, 0 if ξ is not along it.
    fn sign(&self, image: usize, axis: usize) -> f64 {
        if self.axes >> axis & 1 == 0 {
            return 0.0;
        }
        let place = (self.axes & ((1 << axis) - 1)).count_ones();
        if image >> place & 1 == 1 { -1.0 } else { 1.0 }
    }
}

/// The points at x + ξ and x − ξ.
#[derive(Debug, Clone)]
pub struct Pair<const D: usize> {
    /// From x to x + ξ, in slots.
    pub shift: isize,
    /// K, N/m⁴ (3D elasticity).
    pub weight: [[f64; D]; D],
}

impl<const D: usize> SharedRow<D> {
    /// The row of `weights` at the nodes of a fit on this lattice.
    ///
    /// # Errors
    /// A fit that is not of a lattice, or that reaches farther than the lattice is padded for; weights that are not mirror
    /// images of one another to the last bit.
    pub fn new(lattice: &Lattice<D>, fit: &Fit<D>, weights: &[[[f64; D]; D]]) -> Result<Self> {
        let (nodes, classes) = halves(lattice, fit)?;
        let pairs = nodes.iter().map(|&(shift, node)| Pair { shift, weight: weights[node] }).collect();
        let row = SharedRow { pairs, classes, heterogeneity: None };
        if !row.is_mirrored() {
            return Err(Error::Refused("mirrored nodes of a shared row have mirrored weights".into()));
        }
        Ok(row)
    }

    /// Whether the weights of images differ by their signs alone.
    fn is_mirrored(&self) -> bool {
        let mut first = 0;
        self.classes.iter().all(|class| {
            let pairs = &self.pairs[first..first + class.members * class.images];
            first += pairs.len();
            (0..pairs.len()).all(|k| {
                let (member, image) = (&pairs[k % class.members], k / class.members);
                let sign = |o, i| if o == i { 1.0 } else { class.sign(image, o) * class.sign(image, i) };
                (0..D).all(|o| (0..D).all(|i| pairs[k].weight[o][i] == sign(o, i) * member.weight[o][i]))
            })
        })
    }

    /// Points of the row but the source.
    pub fn n_nodes(&self) -> usize {
        2 * self.pairs.len()
    }
}

/// The weights g_j of a gradient Σ_j g_j (a(x + ξ_j) − a(x)) or divergence Σ_j g_j · (u(x + ξ_j) − u(x)) that all points of a
/// lattice share. They change sign with ξ, so that what stands at x itself drops out: Σ over pairs of g (a(x + ξ) − a(x − ξ)).
#[derive(Debug, Clone)]
pub struct SharedSlope<const D: usize> {
    /// In the order of [`SharedRow::pairs`].
    pub pairs: Vec<SlopePair<D>>,
    pub classes: Vec<RowClass>,
}

/// The points at x + ξ and x − ξ.
#[derive(Debug, Clone)]
pub struct SlopePair<const D: usize> {
    /// From x to x + ξ, in slots.
    pub shift: isize,
    /// g, 1/m. Mirrored in an axis, its component along this axis changes sign.
    pub weight: [f64; D],
}

impl<const D: usize> SharedSlope<D> {
    /// The slope of `weights` at the nodes of a fit on this lattice.
    ///
    /// # Errors
    /// As [`SharedRow::new`].
    pub fn new(lattice: &Lattice<D>, fit: &Fit<D>, weights: &[[f64; D]]) -> Result<Self> {
        let (nodes, classes) = halves(lattice, fit)?;
        let pairs = nodes.iter().map(|&(shift, node)| SlopePair { shift, weight: weights[node] }).collect();
        let slope = SharedSlope { pairs, classes };
        let opposite = nodes.iter().all(|&(shift, node)| {
            let steps = fit.steps.as_deref().unwrap_or_default();
            let other = steps.iter().position(|step| lattice.shift(*step) == -shift);
            other.is_some_and(|other| weights[other] == weights[node].map(|w| -w))
        });
        if !opposite || !slope.is_mirrored() {
            return Err(Error::Refused("mirrored nodes of a shared slope have mirrored weights".into()));
        }
        Ok(slope)
    }

    /// Whether the weights of images differ by their signs alone.
    fn is_mirrored(&self) -> bool {
        let mut first = 0;
        self.classes.iter().all(|class| {
            let pairs = &self.pairs[first..first + class.members * class.images];
            first += pairs.len();
            (0..pairs.len()).all(|k| {
                let (member, image) = (&pairs[k % class.members], k / class.members);
                (0..D).all(|d| pairs[k].weight[d] == class.sign(image, d) * member.weight[d])
            })
        })
    }
}

/// A node by its shift, in slots, and its number in a fit.
type Node = (isize, usize);

/// One of each two opposite nodes of a fit, class by class.
fn halves<const D: usize>(lattice: &Lattice<D>, fit: &Fit<D>) -> Result<(Vec<Node>, Vec<RowClass>)> {
    let Some(steps) = &fit.steps else {
        return Err(Error::Refused("points off a lattice have rows of their own".into()));
    };
    let reach = steps.iter().map(|step| lattice.shift(step.map(i32::abs))).max().unwrap_or(0);
    if reach > lattice.guard as isize {
        return Err(Error::Refused("the row reaches farther than the families of the lattice".into()));
    }
    let quadrant = steps.iter().copied().filter(|step| step.iter().all(|&c| c >= 0)).collect();
    let (images, classes) = mirror_sequences(quadrant);
    // The second half are the images of the first through the point.
    let halves = classes.iter().flat_map(|class: &Class| {
        let half = class.members << (class.axes - 1);
        class.first as usize..(class.first + half) as usize
    });
    let node = |k: usize| {
        let node = steps.iter().position(|step| *step == images[k]).expect("a node's mirror images are nodes");
        (lattice.shift(images[k]), node)
    };
    let along = |class: &Class| {
        let step = images[class.first as usize];
        let axes = (0..D).filter(|&d| step[d] != 0).fold(0, |bits, d| bits | 1 << d);
        RowClass { members: class.members as usize, axes, images: 1 << (class.axes - 1) }
    };
    Ok((halves.map(node).collect(), classes.iter().map(along).collect()))
}
