//! Work on all threads, compiled once: what is done comes as a trait object, so that a loop over points is not made anew for
//! each dimension, precision and caller. For loops over bonds, which are, see `execution`.

use rayon::prelude::*;

/// The values of 0..n, in order.
pub fn map<T: Send>(n: usize, value: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    (0..n).into_par_iter().map(value).collect()
}

/// The same where each value takes long enough to be handed out alone.
pub fn map_each<T: Send>(n: usize, value: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    (0..n).into_par_iter().with_max_len(1).map(value).collect()
}

/// Fills chunks of `size` values, the last one shorter; `fill` gets the number of the first value and the chunk.
pub fn fill<T: Send>(values: &mut [T], size: usize, fill: &(dyn Fn(usize, &mut [T]) + Sync)) {
    values.par_chunks_mut(size.max(1)).enumerate().for_each(|(k, chunk)| fill(k * size, chunk));
}
