//! Singular values of a small matrix.

/// Descending, by one-sided Jacobi rotations (Demmel & Veselić 1992): small ones are as accurate as large ones.
pub(super) fn singular_values(rows: &[Vec<f64>]) -> Vec<f64> {
    let n = rows[0].len();
    let mut columns: Vec<Vec<f64>> = (0..n).map(|j| rows.iter().map(|row| row[j]).collect()).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // Sweeps until all columns are orthogonal; a matrix of this size needs fewer than ten.
    for _ in 0..60 {
        let mut turned = false;
        for p in 0..n {
            for q in p + 1..n {
                let (pp, qq, pq) =
                    (dot(&columns[p], &columns[p]), dot(&columns[q], &columns[q]), dot(&columns[p], &columns[q]));
                if pq.abs() <= 1e-15 * (pp * qq).sqrt() {
                    continue;
                }
                turned = true;
                let zeta = (qq - pp) / (2.0 * pq);
                let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let c = 1.0 / (1.0 + t * t).sqrt();
                for i in 0..rows.len() {
                    let (a, b) = (columns[p][i], columns[q][i]);
                    columns[p][i] = c * (a - t * b);
                    columns[q][i] = c * (b + t * a);
                }
            }
        }
        if !turned {
            break;
        }
    }
    let mut values: Vec<f64> = columns.iter().map(|column| dot(column, column).sqrt()).collect();
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

#[cfg(test)]
mod tests {
    use super::singular_values;

    #[test]
    fn singular_values_of_a_scaled_rotation() {
        let (s, c) = 0.3_f64.sin_cos();
        let values = singular_values(&[vec![3.0 * c, -s], vec![3.0 * s, c]]);
        assert!((values[0] - 3.0).abs() < 1e-14 && (values[1] - 1.0).abs() < 1e-14, "{values:?}");
    }
}
