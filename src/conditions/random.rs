//! A random field: a number for each place that has mean 0 and variance 1, the same for the same seed on any machine and any
//! number of threads.
//!
//! With a length ℓ it is smooth: Gaussian numbers on the nodes of a grid of ℓ/2, weighed with exp(−2 r²/ℓ²) and divided by
//! the root of the sum of the squares of the weights. Its correlation is exp(−r²/ℓ²), to what the grid leaves of it. Without,
//! each point has a number of its own.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::geometry::Cloud;
use crate::parallel;

/// Nodes on either side that a place feels: exp(−2 (REACH/2)²) = 3e-4 of the nearest.
const REACH: i64 = 4;
/// Most nodes of a grid: 400 MB.
const MOST_NODES: f64 = 5e7;

/// What a random field is made from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RandomField {
    pub seed: u64,
    /// ℓ, m; zero: each point by itself.
    pub length: f64,
}

impl RandomField {
    /// Its values at the points of a cloud, by slot; zero where there is no point. None if the grid of its length would be too
    /// large.
    pub fn at<const D: usize>(&self, cloud: &Cloud<D>) -> Option<Vec<f64>> {
        let mut values = vec![0.0; cloud.n_slots()];
        let slots = &cloud.slots;
        let found = if self.length > 0.0 {
            let grid = Grid::new(self, cloud)?;
            parallel::map(slots.len(), &|point| grid.at(&cloud.position(slots[point] as usize)))
        } else {
            parallel::map(slots.len(), &|point| gaussian(self.seed, point as u64))
        };
        slots.iter().zip(found).for_each(|(&slot, value)| values[slot as usize] = value);
        Some(values)
    }
}

/// A Gaussian number for each number, by the method of Box & Muller (1958).
fn gaussian(seed: u64, index: u64) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(index);
    let mut unit = || ((random.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
    let [radius, angle] = [unit(), unit()];
    (-2.0 * radius.ln()).sqrt() * (2.0 * std::f64::consts::PI * angle).cos()
}

/// Gaussian numbers on the nodes of a grid over the cloud and what lies in reach.
struct Grid<const D: usize> {
    low: [f64; D],
    step: f64,
    counts: [usize; D],
    nodes: Vec<f64>,
}

impl<const D: usize> Grid<D> {
    fn new(field: &RandomField, cloud: &Cloud<D>) -> Option<Self> {
        let step = 0.5 * field.length;
        let (low, high) = cloud.bounds();
        let sizes: [f64; D] = std::array::from_fn(|d| ((high[d] - low[d]) / step).ceil() + (2 * REACH + 1) as f64);
        if sizes.iter().product::<f64>() > MOST_NODES {
            return None;
        }
        let counts = sizes.map(|size| size as usize);
        let nodes = parallel::map(counts.iter().product(), &|node| gaussian(field.seed, node as u64));
        let low = low.map(|x| x - REACH as f64 * step);
        Some(Grid { low, step, counts, nodes })
    }

    fn at(&self, x: &[f64; D]) -> f64 {
        let place: [f64; D] = std::array::from_fn(|d| (x[d] - self.low[d]) / self.step);
        let first = place.map(|p| p.round() as i64 - REACH);
        let (mut sum, mut squares) = (0.0, 0.0);
        crate::geometry::cloud::for_each_cell([2 * REACH as usize + 1; D], |cell| {
            let (mut node, mut stride, mut square) = (0, 1, 0.0);
            for d in 0..D {
                let index = first[d] + cell[d] as i64;
                if index < 0 || index >= self.counts[d] as i64 {
                    return;
                }
                square += (place[d] - index as f64).powi(2);
                node += index as usize * stride;
                stride *= self.counts[d];
            }
            // 2 r²/ℓ² with r in steps of ℓ/2.
            let weight = (-0.5 * square).exp();
            sum += weight * self.nodes[node];
            squares += weight * weight;
        });
        sum / squares.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Shape;

    #[test]
    fn it_has_mean_zero_variance_one_and_the_correlation_of_its_length() {
        let cloud = Cloud::lattice(&Shape::Box { low: [0.0; 2], high: [60.0, 60.0] }, 0.25, 1);
        let value = |field: RandomField| {
            let values = field.at(&cloud).unwrap();
            cloud.slots.iter().map(|&slot| values[slot as usize]).collect::<Vec<f64>>()
        };
        let moments = |values: &[f64]| {
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n)
        };
        let rough = value(RandomField { seed: 5, length: 0.0 });
        let (mean, variance) = moments(&rough);
        // 57,600 independent numbers: three standard deviations of mean and variance are 0.0125 and 0.018.
        assert!(mean.abs() < 0.0125 && (variance - 1.0).abs() < 0.018, "{mean} {variance}");
        let smooth = value(RandomField { seed: 5, length: 1.0 });
        let (mean, variance) = moments(&smooth);
        // About 60² independent patches of area π ℓ²/2 and more: a twentieth is three standard deviations.
        assert!(mean.abs() < 0.06 && (variance - 1.0).abs() < 0.09, "{mean} {variance}");
        for (steps, distance) in [(2usize, 0.5f64), (4, 1.0), (8, 2.0)] {
            let pairs = (0..240 * 240).filter(|k| k % 240 + steps < 240);
            let products: Vec<f64> = pairs.map(|k| smooth[k] * smooth[k + steps]).collect();
            let correlation = products.iter().sum::<f64>() / products.len() as f64 / variance;
            assert!((correlation - (-distance * distance).exp()).abs() < 0.06, "{distance}: {correlation}");
        }
        assert_eq!(smooth, value(RandomField { seed: 5, length: 1.0 }));
        assert_ne!(smooth, value(RandomField { seed: 6, length: 1.0 }));
    }
}
