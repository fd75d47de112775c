//! Sums and updates of flat vectors, in parallel, with the same bits on any number of threads.

use rayon::prelude::*;

/// Numbers that are summed, or updated, at a time.
const CHUNK: usize = 2048;
/// Shorter vectors are not worth waking threads for.
const PARALLEL_FROM: usize = 5000;
/// Partial sums within a chunk, so that the processor can add side by side.
const LANES: usize = 8;

/// x · y: chunks of fixed size, added in order.
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    assert_eq!(x.len(), y.len(), "a product of vectors of two lengths");
    if x.len() < PARALLEL_FROM {
        return x.chunks(CHUNK).zip(y.chunks(CHUNK)).map(|(x, y)| dot_chunk(x, y)).sum();
    }
    let parts: Vec<f64> = x.par_chunks(CHUNK).zip(y.par_chunks(CHUNK)).map(|(x, y)| dot_chunk(x, y)).collect();
    parts.iter().sum()
}

fn dot_chunk(x: &[f64], y: &[f64]) -> f64 {
    let (x, x_tail) = x.as_chunks::<LANES>();
    let (y, y_tail) = y.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (x, y) in x.iter().zip(y) {
        for k in 0..LANES {
            sums[k] += x[k] * y[k];
        }
    }
    let tail: f64 = x_tail.iter().zip(y_tail).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + tail
}

/// |x| = √(x · x)
pub fn norm(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

/// y = y + a x
pub fn add(a: f64, x: &[f64], y: &mut [f64]) {
    assert_eq!(x.len(), y.len(), "a sum of vectors of two lengths");
    fill(y, |start, y| {
        for (y, x) in y.iter_mut().zip(&x[start..]) {
            *y += a * x;
        }
    });
}

/// y = x + a y
pub fn scale_and_add(a: f64, x: &[f64], y: &mut [f64]) {
    assert_eq!(x.len(), y.len(), "a sum of vectors of two lengths");
    fill(y, |start, y| {
        for (y, x) in y.iter_mut().zip(&x[start..]) {
            *y = x + a * *y;
        }
    });
}

/// y = a y
pub fn scale(a: f64, y: &mut [f64]) {
    fill(y, |_, y| y.iter_mut().for_each(|y| *y *= a));
}

/// Hands `y` out in chunks, each with the index of its first number; in parallel when it is long.
pub fn fill(y: &mut [f64], set: impl Fn(usize, &mut [f64]) + Sync) {
    if y.len() < PARALLEL_FROM {
        set(0, y);
    } else {
        y.par_chunks_mut(CHUNK).enumerate().for_each(|(k, y)| set(k * CHUNK, y));
    }
}

/// A number in [−1, 1) without a pattern: the same for the same index on every machine (Steele et al. 2014, SplitMix64).
pub fn scattered(index: usize) -> f64 {
    let mut z = (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_is_right_at_every_length_around_a_chunk() {
        for n in [0, 1, 7, 8, 9, CHUNK - 1, CHUNK, CHUNK + 1, PARALLEL_FROM - 1, PARALLEL_FROM, 3 * CHUNK + 5] {
            let x: Vec<f64> = (0..n).map(|i| i as f64).collect();
            let n = n as f64;
            // Whole numbers below 2⁵³ are added without rounding.
            assert_eq!(dot(&x, &vec![1.0; x.len()]), 0.5 * n * (n - 1.0));
        }
    }

    #[test]
    fn scattered_numbers_fill_their_range() {
        let x: Vec<f64> = (0..10_000).map(scattered).collect();
        assert!(x.iter().all(|x| (-1.0..1.0).contains(x)));
        // Uniform: mean 0 ± 5/√(3n), mean square 1/3 ± 5 √(4/45/n).
        assert!(x.iter().sum::<f64>().abs() / 1e4 < 0.029);
        assert!((dot(&x, &x) / 1e4 - 1.0 / 3.0).abs() < 0.015);
    }
}
