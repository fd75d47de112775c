//! A square sparse matrix in compressed rows.

use super::{LinearOperator, vector};

/// A square matrix in compressed rows: 64-bit row starts, 32-bit columns that ascend within a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Sparse {
    starts: Vec<u64>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl Sparse {
    /// The matrix of `size` rows with the entries (row, column, value), in any order. Entries at one place are added,
    /// the smallest first, so that the order of the list changes no bit. Zeros are kept: they belong to the pattern.
    pub fn from_triplets(size: usize, triplets: &[(u32, u32, f64)]) -> Self {
        assert!(u32::try_from(size).is_ok(), "columns have 32 bits");
        let mut next = vec![0usize; size + 1];
        for &(row, column, _) in triplets {
            assert!((row as usize) < size && (column as usize) < size, "entry ({row}, {column}) in {size} rows");
            next[row as usize + 1] += 1;
        }
        for row in 0..size {
            next[row + 1] += next[row];
        }
        let mut sorted = vec![(0u32, 0.0f64); triplets.len()];
        for &(row, column, value) in triplets {
            sorted[next[row as usize]] = (column, value);
            next[row as usize] += 1;
        }
        // Now `next[row]` is where the row ends.
        let mut matrix = Sparse { starts: vec![0], columns: Vec::new(), values: Vec::new() };
        let mut start = 0;
        for &end in &next[..size] {
            let row = &mut sorted[start..end];
            row.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            for same in row.chunk_by(|a, b| a.0 == b.0) {
                matrix.columns.push(same[0].0);
                matrix.values.push(same.iter().map(|entry| entry.1).sum());
            }
            matrix.starts.push(matrix.columns.len() as u64);
            start = end;
        }
        matrix
    }

    /// The matrix whose row `i` holds the entries `starts[i]..starts[i + 1]`, columns ascending.
    pub fn from_rows(starts: Vec<u64>, columns: Vec<u32>, values: Vec<f64>) -> Self {
        let size = starts.len().saturating_sub(1);
        let whole = starts.first() == Some(&0) && starts.last() == Some(&(columns.len() as u64));
        assert!(whole && columns.len() == values.len(), "{size} rows of {} columns", columns.len());
        for row in starts.windows(2) {
            let columns = &columns[row[0] as usize..row[1] as usize];
            let last = columns.last().is_none_or(|last| (*last as usize) < size);
            assert!(last && columns.windows(2).all(|pair| pair[0] < pair[1]), "columns ascend within {size}");
        }
        Sparse { starts, columns, values }
    }

    /// Number of rows and of columns.
    pub fn size(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of stored entries.
    pub fn entries(&self) -> usize {
        self.values.len()
    }

    /// Where each row starts among the entries, and the end of the last.
    pub fn starts(&self) -> &[u64] {
        &self.starts
    }

    /// The columns of all entries, row after row.
    pub fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// The values of all entries, row after row.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The same, to be set anew on the same pattern.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Columns, ascending, and values of a row.
    pub fn row(&self, row: usize) -> (&[u32], &[f64]) {
        let range = self.starts[row] as usize..self.starts[row + 1] as usize;
        (&self.columns[range.clone()], &self.values[range])
    }

    /// The entry at a place; zero where none is stored.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        let (columns, values) = self.row(row);
        columns.binary_search(&(column as u32)).map_or(0.0, |k| values[k])
    }

    /// a_ii of every row.
    pub fn diagonal(&self) -> Vec<f64> {
        (0..self.size()).map(|row| self.get(row, row)).collect()
    }

    /// Aᵀ
    pub fn transpose(&self) -> Self {
        let size = self.size();
        let mut starts = vec![0u64; size + 1];
        for &column in &self.columns {
            starts[column as usize + 1] += 1;
        }
        for row in 0..size {
            starts[row + 1] += starts[row];
        }
        let mut next = starts.clone();
        let mut columns = vec![0; self.entries()];
        let mut values = vec![0.0; self.entries()];
        for row in 0..size {
            for (&column, &value) in self.row(row).0.iter().zip(self.row(row).1) {
                let place = next[column as usize] as usize;
                columns[place] = row as u32;
                values[place] = value;
                next[column as usize] += 1;
            }
        }
        Sparse { starts, columns, values }
    }

    /// Whether |a_ij − a_ji| ≤ `tolerance` · max |a| everywhere. A matrix with a number that is not finite is not symmetric.
    pub fn is_symmetric(&self, tolerance: f64) -> bool {
        let largest = self.values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let limit = tolerance * largest;
        (0..self.size()).all(|row| {
            let (columns, values) = self.row(row);
            columns.iter().zip(values).all(|(&column, value)| (value - self.get(column as usize, row)).abs() <= limit)
        })
    }

    /// y = A x, rows in parallel, each summed in order.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        assert!(x.len() == self.size() && y.len() == self.size(), "a product with a vector of another length");
        vector::fill(y, |start, y| {
            for (k, y) in y.iter_mut().enumerate() {
                let (columns, values) = self.row(start + k);
                *y = row_times(columns, values, x);
            }
        });
    }
}

/// Four sums side by side, added in order: a single one would wait for each addition.
fn row_times(columns: &[u32], values: &[f64], x: &[f64]) -> f64 {
    let (columns, columns_tail) = columns.as_chunks::<4>();
    let (values, values_tail) = values.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (columns, values) in columns.iter().zip(values) {
        for k in 0..4 {
            sums[k] += values[k] * x[columns[k] as usize];
        }
    }
    let tail: f64 = columns_tail.iter().zip(values_tail).map(|(&column, value)| value * x[column as usize]).sum();
    sums.iter().sum::<f64>() + tail
}

impl LinearOperator for Sparse {
    fn size(&self) -> usize {
        Sparse::size(self)
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        self.multiply(x, y);
    }
}

impl LinearOperator for &Sparse {
    fn size(&self) -> usize {
        Sparse::size(self)
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        self.multiply(x, y);
    }
}

#[cfg(test)]
mod tests {
    use super::super::matrices;
    use super::*;

    #[test]
    fn the_order_of_the_triplets_changes_no_bit() {
        // A sum that depends on its order: 0 from below, 1 in the order of the list.
        let mut triplets = [(1, 0, 1e16), (0, 1, 2.0), (1, 0, -1e16), (1, 1, 5.0), (1, 0, 1.0), (0, 0, 1.0)];
        let matrix = Sparse::from_triplets(3, &triplets);
        assert_eq!(matrix.starts(), [0, 2, 4, 4]);
        assert_eq!(matrix.columns(), [0, 1, 0, 1]);
        assert_eq!(matrix.values(), [1.0, 2.0, 0.0, 5.0]);
        triplets.reverse();
        assert_eq!(Sparse::from_triplets(3, &triplets), matrix);
        triplets.swap(1, 3);
        assert_eq!(Sparse::from_triplets(3, &triplets), matrix);
    }

    #[test]
    fn symmetry_is_told_from_its_lack() {
        assert!(matrices::laplacian_2d(7, 5, 3.0).is_symmetric(0.0));
        assert!(!matrices::dominant(20).is_symmetric(0.01));
        let skew = |a12| Sparse::from_triplets(2, &[(0, 0, 4.0), (0, 1, a12), (1, 0, 1.0)]);
        assert!(skew(1.003).is_symmetric(0.001));
        assert!(!skew(1.005).is_symmetric(0.001));
        // An entry whose mirror is not in the pattern, above and below the diagonal.
        assert!(!Sparse::from_triplets(2, &[(0, 1, 1.0)]).is_symmetric(0.5));
        assert!(!Sparse::from_triplets(2, &[(1, 0, 1.0)]).is_symmetric(0.5));
        assert!(!Sparse::from_triplets(1, &[(0, 0, f64::NAN)]).is_symmetric(1.0));
    }

    #[test]
    fn a_transpose_turns_products_around() {
        let matrix = matrices::dominant(50);
        let [x, y] = [0, 50].map(|shift| (0..50).map(|i| vector::scattered(i + shift)).collect::<Vec<_>>());
        let [mut ax, mut aty] = [vec![0.0; 50], vec![0.0; 50]];
        matrix.multiply(&x, &mut ax);
        matrix.transpose().multiply(&y, &mut aty);
        // Two sums of some 400 products, whose rounding is far below 400 ε |y| |A x|.
        let bound = 400.0 * f64::EPSILON * vector::norm(&y) * vector::norm(&ax);
        assert!((vector::dot(&y, &ax) - vector::dot(&aty, &x)).abs() < bound);
        assert_eq!(matrix.transpose().transpose(), matrix);
    }
}
