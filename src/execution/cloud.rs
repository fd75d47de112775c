//! The loop over families of scattered points: eight bonds of one point side by side.
//!
//! ξ is recomputed from positions and the weight from |ξ|, so that a bond keeps four bytes of neighbour and one bit of
//! state. Each point's bonds are added in a fixed order.

use std::ops::Range;

use super::{BreakRule, Broken, SharedSlice, StatesPointer};
use crate::discretization::standard::CloudWeights;
use crate::family::{Body, Bond, BondKernel, CloudFamilies};
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
        let x = &positions[point];
        let mut here = [Pack::splat(0.0); I];
        for c in 0..I {
            here[c] = Pack::splat(input[c][point]);
        }
        let mut sum = [Pack::splat(0.0); O];
        for group in families.starts[point] as usize..families.starts[point + 1] as usize {
            // SAFETY: one byte a group; the groups of a point belong to the chunk that owns the point.
            let byte = unsafe { &mut *bytes.add(group) };
            if *byte == 0 {
                continue;
            }
            let neighbours = &families.neighbours[group * LANES..(group + 1) * LANES];
            let mut bond = Bond { xi: [Pack::splat(0.0); D], length: Pack::splat(0.0), weight: Pack::splat(0.0) };
            let mut there = here;
            for k in 0..LANES {
                let other = neighbours[k] as usize;
                let mut square = 0.0;
                for d in 0..D {
                    let xi = positions[other][d] - x[d];
                    bond.xi[d].0[k] = xi;
                    square += xi * xi;
                }
                // Padding is the point itself: any length but zero will do, its bit is never set.
                bond.length.0[k] = if square > 0.0 { square.sqrt() } else { 1.0 };
                bond.weight.0[k] = volumes[other];
                for c in 0..I {
                    there[c].0[k] = input[c][other];
                }
            }
            weights.weigh(group * LANES, &bond.length.0, &mut bond.weight.0);
            let (value, stretch) = kernel.evaluate(&bond, here, there);
            if stretch.keep(*byte).largest() > rule.threshold() {
                for k in 0..LANES {
                    let (s, other) = (stretch.0[k], neighbours[k] as usize);
                    let holds = *byte >> k & 1 == 1;
                    if holds && s > rule.threshold() && rule.breaks(point, other, s) {
                        let mut xi = [0.0; D];
                        for d in 0..D {
                            xi[d] = bond.xi[d].0[k];
                        }
                        let bond = Bond { xi, length: bond.length.0[k], weight: bond.weight.0[k] };
                        *byte &= !(1 << k);
                        broken.bonds += 1;
                        broken.energy += volumes[point] * rule.released(&bond, point, other);
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
