//! Rows of numbers, one for each point: sums whose weights follow from no formula, such as collocation on clouds.

use rayon::prelude::*;

/// Rows that a thread takes at least.
const PIECE: usize = 256;

/// For each slot the weights of its differences to other slots; slots without a row sum to zero.
#[derive(Debug, Clone)]
pub struct PointRows {
    /// First entry of each slot, and one past the last.
    starts: Vec<usize>,
    others: Vec<u32>,
    weights: Vec<f64>,
}

impl PointRows {
    /// From the entries (x′, w) of each slot, of which there are none where there is no row.
    pub fn new(rows: &[Vec<(u32, f64)>]) -> Self {
        let ends = rows.iter().scan(0, |end, row| {
            *end += row.len();
            Some(*end)
        });
        let starts = std::iter::once(0).chain(ends).collect();
        let (others, weights) = rows.iter().flatten().copied().unzip();
        PointRows { starts, others, weights }
    }

    /// The entries of a slot.
    pub fn row(&self, slot: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.starts[slot]..self.starts[slot + 1];
        self.others[range.clone()].iter().map(|other| *other as usize).zip(self.weights[range].iter().copied())
    }

    /// output(x) = Σ w (input(x′) − input(x)), each row in order: the same bits on any number of threads.
    ///
    /// # Panics
    /// If a field has another length than there are slots.
    pub fn sum(&self, input: &[f64], output: &mut [f64]) {
        assert!(
            [input.len(), output.len()] == [self.starts.len() - 1; 2],
            "fields have as many slots as there are rows"
        );
        output.par_iter_mut().with_min_len(PIECE).enumerate().for_each(|(slot, sum)| {
            let here = input[slot];
            *sum = self.row(slot).fold(0.0, |sum, (other, weight)| sum + weight * (input[other] - here));
        });
    }

    /// Σ |w| of the row where it is largest: eigenvalues are within twice that (Gershgorin).
    pub fn largest(&self) -> f64 {
        let sums = (0..self.starts.len() - 1).map(|slot| self.row(slot).fold(0.0, |sum, (_, w)| sum + w.abs()));
        sums.fold(0.0, f64::max)
    }

    /// Bytes of the entries.
    pub fn memory(&self) -> usize {
        size_of_val(&self.starts[..]) + size_of_val(&self.others[..]) + size_of_val(&self.weights[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_summed_and_points_without_one_are_zero() {
        let rows = PointRows::new(&[vec![(1, 2.0), (2, -1.0)], vec![], vec![(0, 0.5)]]);
        let mut sums = [9.0; 3];
        rows.sum(&[1.0, 4.0, 3.0], &mut sums);
        assert_eq!(sums, [2.0 * 3.0 - 2.0, 0.0, 0.5 * -2.0]);
        assert_eq!(rows.largest(), 3.0);
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let n = 5000;
        let value = |k: usize| ((k * 7919) % 1013) as f64 / 1013.0 - 0.3;
        let row = |i: usize| (1..40).map(|k| (((i * 31 + k * k) % n) as u32, value(i + k))).collect();
        let rows = PointRows::new(&(0..n).map(row).collect::<Vec<_>>());
        let input: Vec<f64> = (0..n).map(|i| value(3 * i)).collect();
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut output = vec![0.0; n];
            pool.install(|| rows.sum(&input, &mut output));
            output
        };
        assert_eq!(on(1), on(7));
    }
}
