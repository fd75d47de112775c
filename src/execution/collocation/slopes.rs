//! Slopes on lattices: divergences and gradients by one row that all points share, for the two passes of a state-based solid.

use super::{BondSlope, Limits, SharedSlice, Sum};
use crate::discretization::Regions;
use crate::discretization::collocation::{RowClass, SharedSlope, SlopePair};
use crate::execution::Exec;
use crate::execution::packs::{Instructions, LoadEnds, Pack, Packs};
use crate::family::Body;
use crate::field::Number;
use crate::geometry::lattice::BLOCK;

impl Exec {
    /// output(x) = scale × Σ g_j · (input_j − input)(x), and what is strained too far, as [`Exec::collocate`].
    #[allow(clippy::too_many_arguments)] // as above
    pub fn collocate_divergence<const D: usize, P: Packs>(
        &mut self,
        body: &Body<D>,
        (slope, scale): (&SharedSlope<D>, f64),
        regions: &Regions,
        blocks: &[u32],
        input: [&[P::Field]; D],
        output: &mut [P::Field],
        limits: &Limits,
    ) -> Vec<u32> {
        let (input, output) = self.shared(body, input, [output]);
        let sum = Sum::<D, P>::new(self.instructions, body, regions, input, &output, limits).along(slope, scale);
        // SAFETY: as above.
        sum.each(blocks, |slot| unsafe { sum.divergence(slot) })
    }

    /// output(x) += scale × Σ g_j (scalar_j − scalar)(x) at the points that have a row.
    pub fn collocate_gradient<const D: usize, P: Packs>(
        &mut self,
        body: &Body<D>,
        (slope, scale): (&SharedSlope<D>, f64),
        regions: &Regions,
        scalar: &[P::Field],
        output: [&mut [P::Field]; D],
    ) {
        let (input, output) = self.shared(body, [scalar; D], output);
        let mut sum =
            Sum::<D, P>::new(self.instructions, body, regions, input, &output, &Limits::NONE).along(slope, scale);
        sum.scalar = input[0];
        // SAFETY: as above.
        sum.each(&regions.collocated, |slot| unsafe {
            sum.gradient(slot);
            0
        });
    }
}

impl<'a, const D: usize, P: Packs> Sum<'a, D, P> {
    fn along(self, slope: &'a SharedSlope<D>, scale: f64) -> Self {
        let pair = |pair: &SlopePair<D>| BondSlope {
            shift: pair.shift,
            weight: pair.weight.map(|w| P::Bond::from_f64(scale * w)),
        };
        Sum { slopes: slope.pairs.iter().map(pair).collect(), classes: &slope.classes, ..self }
    }

    compiled!(divergence, divergence_on, divergence_avx2, divergence_avx512 if true, [], (slot: usize), u16);
    compiled!(gradient, gradient_on, gradient_avx2, gradient_avx512 if true, [], (slot: usize), ());

    /// The slope's Σ g · (u_j − u) at the points of one block; gives the bits of those that are strained too far.
    #[inline(always)]
    unsafe fn divergence_on<V: Pack<P::Bond> + LoadEnds<P::Field>>(&self, slot: usize) -> u16 {
        let keep = self.regions.rows(slot);
        let mut beyond = 0;
        for part in 0..BLOCK / V::LANES {
            let first = slot + part * V::LANES;
            let mask = keep >> (part * V::LANES);
            // SAFETY: as of `force_on`.
            unsafe {
                let mut total = [V::splat(0.0); D];
                let mut begin = 0;
                for class in self.classes {
                    for k in begin..begin + class.members {
                        for i in 0..D {
                            if class.axes >> i & 1 == 1 {
                                let step = self.across::<V>(self.input[i], k, class, i, first);
                                let weight = V::broadcast(self.slopes.get_unchecked(k).weight[i]);
                                total[i] = weight.mul_add(step, total[i]);
                            }
                        }
                    }
                    begin += class.members * class.images;
                }
                let here = self.hold::<V>(first);
                beyond |= self.beyond::<V>(first, &here, mask) << (part * V::LANES);
                let mut sum = total[0];
                for i in 1..D {
                    sum = sum + total[i];
                }
                self.store(sum, 0, first, mask);
            }
        }
        beyond
    }

    /// Adds the slope's Σ g (p_j − p) at the points of one block.
    #[inline(always)]
    unsafe fn gradient_on<V: Pack<P::Bond> + LoadEnds<P::Field>>(&self, slot: usize) {
        let keep = self.regions.rows(slot);
        for part in 0..BLOCK / V::LANES {
            let first = slot + part * V::LANES;
            // SAFETY: as of `force_on`.
            unsafe {
                let mut total = [V::splat(0.0); D];
                for o in 0..D {
                    let output = self.output[o].0.add(first);
                    total[o] = V::relative(V::hold(output), V::NOTHING, u16::MAX);
                }
                let mut begin = 0;
                for class in self.classes {
                    for k in begin..begin + class.members {
                        for o in 0..D {
                            if class.axes >> o & 1 == 1 {
                                let step = self.across::<V>(self.scalar, k, class, o, first);
                                let weight = V::broadcast(self.slopes.get_unchecked(k).weight[o]);
                                total[o] = weight.mul_add(step, total[o]);
                            }
                        }
                    }
                    begin += class.members * class.images;
                }
                for o in 0..D {
                    self.store(total[o], o, first, keep >> (part * V::LANES));
                }
            }
        }
    }

    /// Σ over the images of a member of a class of a(x + ξ) − a(x − ξ), with the sign of ξ along an axis of the class.
    #[inline(always)]
    unsafe fn across<V: Pack<P::Bond> + LoadEnds<P::Field>>(
        &self,
        field: SharedSlice<P::Field>,
        k: usize,
        class: &RowClass,
        axis: usize,
        first: usize,
    ) -> V {
        let place = (class.axes & ((1 << axis) - 1)).count_ones();
        // SAFETY: pairs are of the slope, whose reach is inside the field.
        unsafe {
            let at = field.0.add(first);
            let n = class.members;
            match (class.images, place) {
                (1, _) => self.step::<V>(at, k),
                (2, 0) => self.step::<V>(at, k) - self.step::<V>(at, k + n),
                (2, _) => self.step::<V>(at, k) + self.step::<V>(at, k + n),
                (_, place) => {
                    let (a, b) = (self.step::<V>(at, k), self.step::<V>(at, k + n));
                    let (c, d) = (self.step::<V>(at, k + 2 * n), self.step::<V>(at, k + 3 * n));
                    match place {
                        0 => (a - b) + (c - d),
                        1 => (a + b) - (c + d),
                        _ => (a + b) + (c + d),
                    }
                }
            }
        }
    }

    /// a(x + ξ) − a(x − ξ)
    #[inline(always)]
    unsafe fn step<V: Pack<P::Bond> + LoadEnds<P::Field>>(&self, here: *const P::Field, k: usize) -> V {
        unsafe {
            let shift = self.slopes.get_unchecked(k).shift;
            V::relative(V::hold(here.offset(shift)), V::hold(here.offset(-shift)), u16::MAX)
        }
    }
}
