//! The loop over families of scattered points: eight bonds of one point side by side.
//!
//! ξ is recomputed from positions and the weight from |ξ|, so that a bond keeps four bytes of neighbour and one bit of
//! state. Each point's bonds are added in a fixed order.

use std::ops::Range;

use super::{BreakRule, Broken, SharedSlice, StatesPointer};
use crate::discretization::standard::CloudWeights;
use crate::family::{Body, Bond, BondKernel, CloudFamilies};
use crate::field::{Vector, difference, norm};
use crate::geometry::Arrangement;
use crate::lane::{LANES, Lane, Pack};

/// Points in a chunk: the unit that threads share out, and of the ordered sums.
pub const CHUNK: usize = 512;

/// Sums the families of a range of points.
#[allow(clippy::too_many_arguments)]
pub fn pass<const D: usize, const I: usize, const O: usize, K: BondKernel<D, I, O>, R: BreakRule<D>>(
    body: &Body<D>,
    families: &CloudFamilies,
    weights: &CloudWeights,
    points: Range<usize>,
    states: StatesPointer,
    input: [&[f64]; I],
    output: [SharedSlice; O],
    kernel: &K,
    rule: &R,
) -> Broken {
    let StatesPointer::Cloud(bytes) = states else { unreachable!("a cloud has cloud states") };
    let Arrangement::Scattered { positions, volumes } = &body.cloud.arrangement else {
        unreachable!("cloud families belong to a scattered cloud")
    };
    let mut broken = Broken::default();
    for point in points {
        let here: [f64; I] = input.map(|f| f[point]);
        let mut sum = [Pack::splat(0.0); O];
        for group in families.starts[point] as usize..families.starts[point + 1] as usize {
            // SAFETY: one byte a group; the groups of a point belong to the chunk that owns the point.
            let byte = unsafe { &mut *bytes.add(group) };
            if *byte == 0 {
                continue;
            }
            let neighbours: &[u32; LANES] =
                families.neighbours[group * LANES..][..LANES].try_into().expect("families are padded to LANES");
            let bonds: [Bond<D, f64>; LANES] = std::array::from_fn(|k| {
                let other = neighbours[k] as usize;
                let xi: Vector<D> = difference(&positions[other], &positions[point]);
                let length = norm(&xi);
                // Padding is the point itself: any length but zero will do, its bit is never set.
                let length = if length > 0.0 { length } else { 1.0 };
                Bond { xi, length, weight: weights.weight(group * LANES + k, length, volumes[other]) }
            });
            let there: [[f64; LANES]; I] =
                std::array::from_fn(|c| std::array::from_fn(|k| input[c][neighbours[k] as usize]));
            let bond = Bond {
                xi: std::array::from_fn(|d| Pack(std::array::from_fn(|k| bonds[k].xi[d]))),
                length: Pack(std::array::from_fn(|k| bonds[k].length)),
                weight: Pack(std::array::from_fn(|k| bonds[k].weight)),
            };
            let (value, stretch) = kernel.evaluate(&bond, here.map(Pack::splat), there.map(Pack));
            if stretch.keep(*byte).largest() > rule.threshold() {
                for (k, bond) in bonds.iter().enumerate() {
                    let s = stretch.0[k];
                    let holds = *byte >> k & 1 == 1;
                    if holds && s > rule.threshold() && rule.breaks(point, neighbours[k] as usize, s) {
                        *byte &= !(1 << k);
                        broken.bonds += 1;
                        broken.energy += volumes[point] * rule.released(bond, point, neighbours[k] as usize);
                    }
                }
            }
            for c in 0..O {
                sum[c] = sum[c] + value[c].keep(*byte);
            }
        }
        for c in 0..O {
            // SAFETY: `point` belongs to this chunk alone and the field has the length of the cloud.
            unsafe { *output[c].0.add(point) = sum[c].sum() };
        }
    }
    broken
}
