//! The largest eigenvalue of a symmetric operator that is known by its product with a vector, and a bound of it.
//!
//! The method of Lanczos (Golub & Van Loan 2013, section 10.1) gives a value θ from below. From a start without a direction of
//! its own, the largest eigenvalue λ of a positive operator of n unknowns passes θ/(1 − ε) after k steps with a probability of at
//! most 1.648 √n e^(−√ε (2k − 1)) (Kuczyński & Woźniakowski 1992, theorem 4.2).

use super::{LinearOperator, vector};

/// Probability with which a bound may fail.
const FAILS: f64 = 1e-9;
/// Two products that should be the same may differ by this share: roundings, and those of operators that are differences.
const SYMMETRIC: f64 = 1e-6;
/// Below this share of the others, what a step adds is rounding: the eigenvalue is that of all unknowns.
const EXHAUSTED: f64 = 1e-12;

/// A bound from above of the largest eigenvalue of a symmetric operator without negative ones, from this many products; none
/// where it proves not to be symmetric, or gives numbers that are not finite.
pub fn bound_of_largest_eigenvalue(a: &mut impl LinearOperator, steps: usize) -> Option<f64> {
    let n = a.size();
    let [mut v, mut w, mut before] = [gaussian(n, 0), vec![0.0; n], vec![0.0; n]];
    let other = gaussian(n, 1);
    a.apply(&v, &mut w);
    a.apply(&other, &mut before);
    let [one, two] = [vector::dot(&other, &w), vector::dot(&v, &before)];
    let size = vector::norm(&v) * vector::norm(&before);
    if !size.is_finite() || (one - two).abs() > SYMMETRIC * size {
        return None;
    }
    before.fill(0.0);
    vector::scale(1.0 / vector::norm(&v), &mut v);
    let (mut diagonal, mut beside) = (Vec::new(), Vec::new());
    for _ in 0..steps {
        a.apply(&v, &mut w);
        let alpha = vector::dot(&v, &w);
        diagonal.push(alpha);
        vector::add(-alpha, &v, &mut w);
        vector::add(-beside.last().copied().unwrap_or(0.0), &before, &mut w);
        let beta = vector::norm(&w);
        if !beta.is_finite() {
            return None;
        }
        if beta <= EXHAUSTED * diagonal.iter().fold(0.0, |most: f64, a| most.max(a.abs())) {
            break;
        }
        beside.push(beta);
        std::mem::swap(&mut before, &mut v);
        v.copy_from_slice(&w);
        vector::scale(1.0 / beta, &mut v);
    }
    let k = diagonal.len() as f64;
    let root = (1.648 * (n as f64).sqrt() / FAILS).ln() / (2.0 * k - 1.0);
    (root < 1.0).then(|| largest_of_tridiagonal(&diagonal, &beside) / (1.0 - root * root))
}

/// The largest eigenvalue of a symmetric matrix with three diagonals, from above, by bisection: x is above all where the pivots
/// of x − T are positive (Sturm).
fn largest_of_tridiagonal(diagonal: &[f64], beside: &[f64]) -> f64 {
    let off = |k: usize| beside.get(k).filter(|_| k + 1 < diagonal.len()).map_or(0.0, |b| b.abs());
    let row = |k: usize| diagonal[k] + off(k) + if k > 0 { off(k - 1) } else { 0.0 };
    let (mut low, mut high) = (diagonal.iter().copied().fold(f64::NEG_INFINITY, f64::max), f64::NEG_INFINITY);
    (0..diagonal.len()).for_each(|k| high = high.max(row(k)));
    let is_above = |x: f64| {
        let mut pivot = f64::INFINITY;
        diagonal.iter().enumerate().all(|(k, a)| {
            pivot = x - a - if k > 0 { off(k - 1).powi(2) / pivot } else { 0.0 };
            pivot > 0.0
        })
    };
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        *(if is_above(middle) { &mut high } else { &mut low }) = middle;
    }
    high
}

/// Numbers as good as of a normal distribution: sums of twelve uniform ones.
fn gaussian(n: usize, which: usize) -> Vec<f64> {
    let number = |k: usize| (0..12).map(|i| vector::scattered(12 * (which * n + k) + i)).sum::<f64>();
    (0..n).map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Chain {
        n: usize,
        skew: f64,
    }

    impl LinearOperator for Chain {
        fn size(&self) -> usize {
            self.n
        }
        /// −1, 2, −1: eigenvalues 4 sin²(kπ/(2(n + 1))).
        fn apply(&mut self, x: &[f64], y: &mut [f64]) {
            for k in 0..self.n {
                let [left, right] = [k.checked_sub(1), Some(k + 1)].map(|j| j.and_then(|j| x.get(j)).unwrap_or(&0.0));
                y[k] = 2.0 * x[k] - left - (1.0 + self.skew) * right;
            }
        }
    }

    #[test]
    fn the_bound_is_above_the_largest_eigenvalue_and_near_it() {
        for n in [1, 2, 3, 10, 100, 3000] {
            let exact = 4.0 * (n as f64 * std::f64::consts::FRAC_PI_2 / (n as f64 + 1.0)).sin().powi(2);
            let Some(bound) = bound_of_largest_eigenvalue(&mut Chain { n, skew: 0.0 }, 150) else {
                // Fewer unknowns than steps that the theorem asks for.
                assert!(n < 13, "{n}");
                continue;
            };
            // ε = (ln(1.648 √n 1e9)/(2k − 1))², with k = 150, or the steps that n unknowns allow.
            let k = n.min(150) as f64;
            let epsilon = ((1.648 * (n as f64).sqrt() * 1e9).ln() / (2.0 * k - 1.0)).powi(2);
            assert!(bound >= exact && bound <= exact / (1.0 - epsilon) * (1.0 + 1e-12), "{n}: {bound} {exact}");
        }
        assert!(bound_of_largest_eigenvalue(&mut Chain { n: 50, skew: 0.1 }, 100).is_none());
    }
}
