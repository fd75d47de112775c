//! Rows of a lattice, symmetric to the last bit.
//!
//! A factorisation leaves mirrored weights equal to rounding only, and a symmetric problem would lose its symmetry.

use std::collections::BTreeMap;

/// Replaces every entry by the mean over all that mirroring, exchange of axes and exchange of indices make equal.
///
/// `values` holds D^R entries a step, the components of a tensor of rank R: weights of scalars (0) or of vectors (2).
/// The steps are those of a whole orbit each. An entry that mirroring makes its own opposite is 0.
pub fn symmetrise<const D: usize, const R: usize>(steps: &[[i32; D]], values: &mut [f64]) {
    let components = D.pow(R as u32);
    assert_eq!(values.len(), components * steps.len(), "{components} entries for each step");
    // Each axis is known by how far the step goes along it and by how many indices it has.
    let class = |k: usize| {
        let step = steps[k / components];
        let mut indices = [0; D];
        for place in 0..R {
            indices[k % components / D.pow(place as u32) % D] += 1;
        }
        let odd = |d: usize| indices[d] % 2 == 1;
        let vanishes = (0..D).any(|d| step[d] == 0 && odd(d));
        let negative = (0..D).filter(|&d| step[d] < 0 && odd(d)).count() % 2 == 1;
        let mut axes: [(u32, u32); D] = std::array::from_fn(|d| (step[d].unsigned_abs(), indices[d]));
        axes.sort_unstable();
        let sign = if vanishes {
            0.0
        } else if negative {
            -1.0
        } else {
            1.0
        };
        (axes, sign)
    };
    let mut sums = BTreeMap::new();
    for (k, value) in values.iter().enumerate() {
        let (axes, sign) = class(k);
        let (sum, count) = sums.entry(axes).or_insert((0.0, 0));
        *sum += sign * value;
        *count += 1;
    }
    for (k, value) in values.iter_mut().enumerate() {
        let (axes, sign) = class(k);
        let (sum, count) = sums[&axes];
        *value = if sign == 0.0 { 0.0 } else { sign * (sum / f64::from(count)) };
    }
}
