//! Bodies that float: systems that are solvable up to rigid motions, for balanced loads.

use super::{Direct, Layout, LinearError, LinearOperator, Preconditioner, Sparse, vector};

/// What is left of a vector after its parts along others are taken off is rounding below this share.
const DEPENDENT: f64 = 1e-10;

/// Orthonormal vectors Z with A Z = 0 and Aᵀ Z = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct NullSpace {
    basis: Vec<Vec<f64>>,
}

impl NullSpace {
    /// Makes the vectors orthonormal, in order, by modified Gram-Schmidt run twice (Giraud et al. 2005). A vector that
    /// depends on those before it is left out.
    pub fn new(vectors: Vec<Vec<f64>>) -> Self {
        let mut space = NullSpace { basis: Vec::new() };
        for mut vector in vectors {
            let whole = vector::norm(&vector);
            assert!(whole.is_finite(), "a null space of numbers that are not finite");
            space.remove(&mut vector);
            if vector::norm(&vector) > DEPENDENT * whole {
                space.remove(&mut vector);
                vector::scale(1.0 / vector::norm(&vector), &mut vector);
                space.basis.push(vector);
            }
        }
        space
    }

    /// The motions of `points` (m) that strain nothing at first order: D translations, and rotations
    /// u = e_a (x_b − x̄_b) − e_b (x_a − x̄_a) in the plane of each pair of axes. 1, 3, 6 for D = 1, 2, 3; fewer where
    /// points lie on a line of 3D (5) or at one place (D).
    pub fn rigid_motions<const D: usize>(points: &[[f64; D]], layout: Layout) -> Self {
        let n = points.len();
        let centre: [f64; D] = std::array::from_fn(|d| points.iter().map(|x| x[d]).sum::<f64>() / n as f64);
        let mut motions = Vec::new();
        let mut motion = |u: &dyn Fn(&[f64; D]) -> [f64; D]| {
            let mut field = vec![0.0; D * n];
            for (p, x) in points.iter().enumerate() {
                for (d, u) in u(x).into_iter().enumerate() {
                    field[layout.unknown(p, d, n, D)] = u;
                }
            }
            motions.push(field);
        };
        for d in 0..D {
            motion(&|_| std::array::from_fn(|e| f64::from(u8::from(e == d))));
        }
        let radius = points.iter().flat_map(|x| (0..D).map(|d| (x[d] - centre[d]).abs())).fold(0.0, f64::max);
        for a in 0..D {
            for b in a + 1..D {
                motion(&|x| {
                    let mut u = [0.0; D];
                    // Of the size of a translation, so that one limit tells rounding from motion for both.
                    if radius > 0.0 {
                        u[a] = (x[b] - centre[b]) / radius;
                        u[b] = -(x[a] - centre[a]) / radius;
                    }
                    u
                });
            }
        }
        Self::new(motions)
    }

    /// The vectors of Z.
    pub fn basis(&self) -> &[Vec<f64>] {
        &self.basis
    }

    /// For each vector of Z one unknown, so that no combination of the vectors is small at all of them: the unknown
    /// where what the earlier ones leave of the row of Z is largest (Gram-Schmidt with pivots).
    fn largest(&self) -> Vec<u32> {
        let mut rows = self.basis.clone();
        let mut held = Vec::new();
        for _ in 0..rows.len() {
            let size = |i: &usize| rows.iter().map(|z| z[*i] * z[*i]).sum::<f64>();
            let best = (0..rows[0].len()).rev().max_by(|i, j| size(i).total_cmp(&size(j))).unwrap_or(0);
            let length = size(&best).sqrt();
            let direction: Vec<f64> = rows.iter().map(|z| z[best] / length).collect();
            for i in 0..rows[0].len() {
                let part: f64 = rows.iter().zip(&direction).map(|(z, d)| z[i] * d).sum();
                rows.iter_mut().zip(&direction).for_each(|(z, d)| z[i] -= part * d);
            }
            held.push(best as u32);
        }
        held
    }

    /// v = (I − Z Zᵀ) v, one vector after the other. Gives Zᵀ v.
    pub fn remove(&self, v: &mut [f64]) -> Vec<f64> {
        let take = |z: &Vec<f64>| {
            let part = vector::dot(z, v);
            vector::add(-part, z, v);
            part
        };
        self.basis.iter().map(take).collect()
    }

    /// Balances a load: b = (I − Z Zᵀ) b. Gives |Zᵀ b|/|b|: zero for a load that a floating body can bear, 1 for one
    /// that only moves it. Rounding leaves about ε; the caller decides what to refuse.
    pub fn balance(&self, b: &mut [f64]) -> f64 {
        let whole = vector::norm(b);
        let taken = self.remove(b);
        if whole == 0.0 { 0.0 } else { vector::norm(&taken) / whole }
    }
}

/// P A P, or P M⁻¹ P, with P = I − Z Zᵀ: what a Krylov method sees of a floating body. With a balanced b and a first guess
/// of zero, the solution has no rigid motion in it.
pub struct Projected<'a, T> {
    inner: T,
    space: &'a NullSpace,
    scratch: Vec<f64>,
}

impl<'a, T> Projected<'a, T> {
    /// Wraps an operator or a preconditioner.
    pub fn new(inner: T, space: &'a NullSpace) -> Self {
        Projected { inner, space, scratch: Vec::new() }
    }

    fn between(&mut self, x: &[f64], y: &mut [f64], apply: impl Fn(&mut T, &[f64], &mut [f64])) {
        self.scratch.clear();
        self.scratch.extend_from_slice(x);
        self.space.remove(&mut self.scratch);
        apply(&mut self.inner, &self.scratch, y);
        self.space.remove(y);
    }
}

impl<T: LinearOperator> LinearOperator for Projected<'_, T> {
    fn size(&self) -> usize {
        self.inner.size()
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        self.between(x, y, T::apply);
    }
}

impl<T: Preconditioner> Preconditioner for Projected<'_, T> {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        self.between(r, z, T::apply);
    }
}

/// The bordered system [A Z; Zᵀ 0] [x; λ] = [b; 0] of a floating body, factored.
///
/// Without its dense border, which would fill the factor: with E the unknowns where Z is largest, one for each of its
/// vectors, x = P (A + s E Eᵀ)⁻¹ P b and λ = Zᵀ b. Indeed Zᵀ times (A + s E Eᵀ) y = P b is s Zᵀ E Eᵀ y = 0, so the
/// springs s at E bear nothing, Eᵀ y = 0, and A y = P b. Here s is the mean |a_ii|.
#[derive(Debug)]
pub struct Bordered {
    direct: Direct,
    space: NullSpace,
    held: Vec<u32>,
}

impl Bordered {
    /// For symmetric A that is positive but for Z.
    ///
    /// # Errors
    /// As [`Direct::cholesky`]: A has a null space beyond Z, too.
    pub fn cholesky(a: &Sparse, space: NullSpace) -> Result<Self, LinearError> {
        Self::new(a, space, Direct::cholesky)
    }

    /// For general A with A Z = 0 and Aᵀ Z = 0.
    ///
    /// # Errors
    /// As [`Direct::lu`]: A has a null space beyond Z, too.
    pub fn lu(a: &Sparse, space: NullSpace) -> Result<Self, LinearError> {
        Self::new(a, space, Direct::lu)
    }

    fn new(
        a: &Sparse,
        space: NullSpace,
        factor: fn(&Sparse) -> Result<Direct, LinearError>,
    ) -> Result<Self, LinearError> {
        let held = space.largest();
        Ok(Bordered { direct: factor(&with_springs(a, &held))?, space, held })
    }

    /// Factors other values on the same pattern.
    ///
    /// # Errors
    /// As the constructor. The old factor is gone.
    pub fn refactor(&mut self, a: &Sparse) -> Result<(), LinearError> {
        self.direct.refactor(&with_springs(a, &self.held))
    }

    /// Solves A x = P b with Zᵀ x = 0, in place of b. Gives λ = Zᵀ b, the load that is not balanced.
    ///
    /// # Errors
    /// As [`Direct::solve`].
    pub fn solve(&self, b: &mut [f64]) -> Result<Vec<f64>, LinearError> {
        let load = self.space.remove(b);
        self.direct.solve(b)?;
        self.space.remove(b);
        Ok(load)
    }
}

/// A + s E Eᵀ
fn with_springs(a: &Sparse, held: &[u32]) -> Sparse {
    let mean = a.diagonal().iter().map(|v| v.abs()).sum::<f64>() / a.size() as f64;
    let mut triplets = Vec::with_capacity(a.entries() + held.len());
    for row in 0..a.size() {
        let (columns, values) = a.row(row);
        triplets.extend(columns.iter().zip(values).map(|(&column, &value)| (row as u32, column, value)));
    }
    triplets.extend(held.iter().map(|&unknown| (unknown, unknown, mean)));
    Sparse::from_triplets(a.size(), &triplets)
}

#[cfg(test)]
mod tests {
    use super::super::{IncompleteCholesky, NoPreconditioner, Stop, conjugate_gradients, gmres, matrices};
    use super::*;

    const STOP: Stop = Stop { tolerance: 1e-12, max_iterations: 1000 };

    #[test]
    fn a_floating_body_under_a_balanced_load_is_solved_by_all_three() {
        let a = matrices::neumann_2d(25, 15);
        let n = a.size();
        let space = NullSpace::new(vec![vec![1.0; n]]);
        let (b, mut exact) = matrices::with_solution(&a);
        space.remove(&mut exact);
        let mut balanced = b.clone();
        // A x is balanced up to the rounding of its sums.
        assert!(space.balance(&mut balanced) < 1e-14);
        // κ = 8/(π/25)² = 507 between the largest and the smallest eigenvalue that is not zero.
        let tolerance = 510.0 * STOP.tolerance;
        let mut operator = Projected::new(&a, &space);
        let mut x = vec![0.0; n];
        let plain = conjugate_gradients(&mut operator, &mut NoPreconditioner, &balanced, &mut x, &STOP, |_, _| true);
        assert!(matrices::difference(&x, &exact) < tolerance);
        let mut factor = IncompleteCholesky::new(&a).unwrap();
        let mut m = Projected::new(&mut factor, &space);
        x.fill(0.0);
        let factored = conjugate_gradients(&mut operator, &mut m, &balanced, &mut x, &STOP, |_, _| true);
        assert!(matrices::difference(&x, &exact) < tolerance);
        assert!(2 * factored.unwrap().iterations < plain.unwrap().iterations);
        x.fill(0.0);
        gmres(&mut operator, &mut m, &balanced, &mut x, 60, &STOP, |_, _| true).unwrap();
        assert!(matrices::difference(&x, &exact) < tolerance);
        for method in [Bordered::cholesky, Bordered::lu] {
            let mut direct = b.clone();
            let mut bordered = method(&a, space.clone()).unwrap();
            let load = bordered.solve(&mut direct).unwrap();
            // Ten roundings of size κ ε, and κ grows by the logarithm of n when one point is held.
            assert!(matrices::difference(&direct, &exact) < 10.0 * 510.0 * 6.0 * f64::EPSILON);
            assert!(load.len() == 1 && load[0].abs() < 1e-13 * vector::norm(&b));
            let mut stiffer = a.clone();
            stiffer.values_mut().iter_mut().for_each(|v| *v *= 4.0);
            bordered.refactor(&stiffer).unwrap();
            let mut quarter = b.clone();
            bordered.solve(&mut quarter).unwrap();
            vector::scale(4.0, &mut quarter);
            assert!(matrices::difference(&quarter, &direct) < 1e-12);
        }
    }

    #[test]
    fn a_load_that_is_not_balanced_is_measured() {
        let a = matrices::neumann_2d(10, 10);
        let space = NullSpace::new(vec![vec![7.0; 100]]);
        // One loaded point: Zᵀ b = 1/√100.
        let mut b = vec![0.0; 100];
        b[3] = 2.0;
        let mut direct = b.clone();
        let load = Bordered::cholesky(&a, space.clone()).unwrap().solve(&mut direct).unwrap();
        // Rounding of sums of 100 numbers.
        assert!((load[0] - 0.2).abs() < 1e-13);
        // The bordered matrix itself says the same.
        let mut triplets = Vec::new();
        for row in 0..100u32 {
            triplets.extend([(row, 100, 0.1), (100, row, 0.1)]);
            triplets.extend((0..100).map(|column| (row, column, a.get(row as usize, column as usize))));
        }
        let mut extended = b.clone();
        extended.push(0.0);
        Direct::lu(&Sparse::from_triplets(101, &triplets)).unwrap().solve(&mut extended).unwrap();
        // Rounding of size κ ε, κ = 81 below, times ten.
        assert!((extended.pop().unwrap() - 0.2).abs() < 1e-13);
        assert!(matrices::difference(&direct, &extended) < 2e-13);
        assert!((space.balance(&mut b) - 0.1).abs() < 1e-14);
        let mut x = vec![0.0; 100];
        conjugate_gradients(&mut Projected::new(&a, &space), &mut NoPreconditioner, &b, &mut x, &STOP, |_, _| true)
            .unwrap();
        // κ = 8/(π/10)² = 81.
        assert!(matrices::difference(&x, &direct) < 81.0 * STOP.tolerance);
    }

    /// Springs between all points nearer than `reach`: Σ k n nᵀ, interleaved or by component.
    fn springs<const D: usize>(points: &[[f64; D]], reach: f64, layout: Layout) -> Sparse {
        let n = points.len();
        let mut triplets = Vec::new();
        for p in 0..n {
            for q in (0..n).filter(|&q| q != p) {
                let bond: [f64; D] = std::array::from_fn(|d| points[q][d] - points[p][d]);
                let length = vector::norm(&bond);
                for c in 0..D {
                    for d in 0..D {
                        let k = if length < reach { bond[c] * bond[d] / (length * length) } else { 0.0 };
                        let [pc, pd, qd] = [(p, c), (p, d), (q, d)].map(|(p, c)| layout.unknown(p, c, n, D) as u32);
                        triplets.extend([(pc, pd, k), (pc, qd, -k)]);
                    }
                }
            }
        }
        Sparse::from_triplets(D * n, &triplets)
    }

    fn check_motions<const D: usize>(count: usize) {
        let points: Vec<[f64; D]> =
            (0..30).map(|p| std::array::from_fn(|d| 100.0 + vector::scattered(3 * p + d))).collect();
        for layout in [Layout::Interleaved, Layout::ByComponent] {
            let space = NullSpace::rigid_motions(&points, layout);
            assert_eq!(space.basis().len(), count);
            for (i, y) in space.basis().iter().enumerate() {
                for (j, z) in space.basis().iter().enumerate() {
                    // Orthonormal to a few roundings.
                    assert!((vector::dot(y, z) - f64::from(u8::from(i == j))).abs() < 1e-14);
                }
            }
            let a = springs(&points, 1.5, layout);
            let scale = a.diagonal().iter().fold(0.0f64, |m, v| m.max(*v));
            let mut az = vec![0.0; a.size()];
            for z in space.basis() {
                a.multiply(z, &mut az);
                // Positions near 100 lose two digits.
                assert!(vector::norm(&az) < 1e-13 * scale);
            }
            // Nothing else is in the null space: the bordered system has a factor.
            let (mut b, mut exact) = matrices::with_solution(&a);
            space.remove(&mut exact);
            Bordered::cholesky(&a, space.clone()).unwrap().solve(&mut b).unwrap();
            // κ of a cloud of 30 points without order is below 10⁴, some hundred roundings.
            assert!(matrices::difference(&b, &exact) < 1e6 * f64::EPSILON);
            // And none of the motions can be spared.
            let fewer = NullSpace { basis: space.basis()[1..].to_vec() };
            assert!(Bordered::lu(&a, fewer).is_err());
        }
    }

    #[test]
    fn rigid_motions_are_all_that_springs_do_not_feel() {
        check_motions::<1>(1);
        check_motions::<2>(3);
        check_motions::<3>(6);
    }

    #[test]
    fn motions_that_points_cannot_tell_are_left_out() {
        let line: Vec<[f64; 3]> = (0..5).map(|i| [f64::from(i), 2.0 * f64::from(i), 0.0]).collect();
        assert_eq!(NullSpace::rigid_motions(&line, Layout::ByComponent).basis().len(), 5);
        assert_eq!(NullSpace::rigid_motions(&[[1.0, 2.0]], Layout::ByComponent).basis().len(), 2);
    }

    #[test]
    fn threads_change_no_bit() {
        let a = matrices::neumann_2d(200, 200);
        let (mut b, _) = matrices::with_solution(&a);
        let space = NullSpace::new(vec![vec![1.0; b.len()]]);
        space.balance(&mut b);
        let stop = Stop { tolerance: 1e-4, max_iterations: 2000 };
        let runs = matrices::on_threads(|| {
            let mut x = vec![0.0; b.len()];
            let mut operator = Projected::new(&a, &space);
            conjugate_gradients(&mut operator, &mut NoPreconditioner, &b, &mut x, &stop, |_, _| true).unwrap();
            x
        });
        assert!(runs.iter().all(|run| *run == runs[0]));
    }
}
