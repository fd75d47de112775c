//! Equilibrium, Σ_p k_ip (u_p − u_i) + b_i = 0, by Gaussian elimination.
//!
//! A free bar may be shifted: the matrix of (26) is singular. What fixes the shift is named.

use super::{Bonds, Model};

/// What fixes the translation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Translation {
    /// Σ V u = 0 as a further row, and a uniform body force as the further unknown: it takes up the total force that
    /// loads and unequal reactions leave, and is 0 where they leave none.
    MeanZero,
    /// The equation of this node is replaced by u = 0. Its load is lost, so the node must have none.
    Pinned(usize),
}

/// Displacements under the load density `load`.
pub fn solve(bonds: &Bonds, load: &[f64], translation: Translation) -> Vec<f64> {
    let n = bonds.count();
    let mut matrix = bonds.matrix();
    let mut right: Vec<f64> = load.iter().map(|b| -b).collect();
    match translation {
        Translation::MeanZero => {
            for row in &mut matrix {
                row.push(1.0);
            }
            let mean = bonds.volume.iter().copied().chain([0.0]).collect();
            matrix.push(mean);
            right.push(0.0);
        }
        Translation::Pinned(node) => {
            matrix[node].fill(0.0);
            matrix[node][node] = 1.0;
            right[node] = 0.0;
        }
    }
    eliminate(matrix, &mut right);
    right.truncate(n);
    right
}

/// Gaussian elimination with partial pivoting, the solution in place of the right side. Rows that have nothing in the
/// column are left alone, which is what makes it cheap for a band.
fn eliminate(mut matrix: Vec<Vec<f64>>, right: &mut [f64]) {
    let n = right.len();
    // One past the last entry of each row that may not be 0, but for the last column.
    let mut reach: Vec<usize> = matrix.iter().map(|row| last_entry(&row[..n - 1])).collect();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| matrix[a][k].abs().total_cmp(&matrix[b][k].abs())).unwrap_or(k);
        matrix.swap(k, pivot);
        reach.swap(k, pivot);
        right.swap(k, pivot);
        let (above, below) = matrix.split_at_mut(k + 1);
        let top = &above[k];
        for (i, row) in (k + 1..).zip(below) {
            if row[k] == 0.0 {
                continue;
            }
            let factor = row[k] / top[k];
            for j in (k..reach[k]).chain([n - 1]) {
                row[j] -= factor * top[j];
            }
            reach[i] = reach[i].max(reach[k]);
            right[i] -= factor * right[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| matrix[k][j] * right[j]).sum();
        right[k] = (right[k] - known) / matrix[k][k];
    }
}

fn last_entry(row: &[f64]) -> usize {
    row.iter().rposition(|&v| v != 0.0).map_or(0, |last| last + 1)
}

mod tests {
    use super::super::super::grid::{Grid, Layout};
    use super::super::super::micromodulus::Micromodulus;
    use super::super::super::model::{Bar, Rule};
    use super::*;

    #[test]
    fn what_fixes_the_translation_changes_nothing_else() {
        for micromodulus in Micromodulus::ALL {
            let grid = Grid::zones(Layout::Centred, -2.0, &[(-1.0, 10), (1.0, 40), (2.0, 10)]);
            let mut bonds = Bar::uniform(grid, 0.3, micromodulus, Rule::Dual).bonds();
            let mut load = vec![0.0; 60];
            (load[20], load[39]) = (-20.0, 20.0);
            let [mean_zero, pinned] = [Translation::MeanZero, Translation::Pinned(30)].map(|t| solve(&bonds, &load, t));
            let shift = mean_zero[30];
            assert!(mean_zero.iter().zip(&pinned).all(|(a, b)| (a - b - shift).abs() < 1e-10), "{micromodulus:?}");
            let mut force = vec![0.0; 60];
            bonds.force(&mean_zero, &mut force);
            assert!(force.iter().zip(&load).all(|(f, b)| (f + b).abs() < 1e-9), "{micromodulus:?}");
        }
    }
}
