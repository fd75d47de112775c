//! Cholesky factors with chosen unknowns last, onto which the system is condensed.
//!
//! With the unknowns r first and z last, the trailing block of the factor is that of the Schur complement of r,
//!
//! ```text
//! L_zz L_zzᵀ = S = A_zz − A_zr A_rr⁻¹ A_rz,   (A⁻¹)_zz = S⁻¹ = F
//! ```
//!
//! so that a change A − w g gᵀ with g in z alone is one of the dense F (Sherman & Morrison 1950): F + w/(1 − w gᵀF g) F g (F g)ᵀ.
//! Nothing is factored anew, and systems of the changed A are solved with the old factor and F between its halves.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::linalg::cholesky::llt::inverse;
use faer::linalg::matmul::matmul;
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
    supernodal,
};
use faer::sparse::linalg::{SupernodalThreshold, amd};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Accum, Conj, MatMut, MatRef, Par, Side};

use super::direct::{failed, pattern};
use super::{LinearError, Sparse, vector};

/// Changes of F that are kept apart before they are added to it: one by one they cost a pass over its memory each.
const APART: usize = 256;

/// Factors of a sparse symmetric positive matrix, some of whose unknowns are last.
#[derive(Debug)]
pub struct Condensed {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    /// The unknown at each place.
    order: Vec<usize>,
    /// L_zz and F, columns one after another, of as many rows as there are unknowns in z.
    low: Vec<f64>,
    inverse: Vec<f64>,
    size: usize,
    /// F is what `inverse` holds and Σ c f fᵀ of these.
    changes: Vec<(f64, Vec<f64>)>,
    changed: bool,
}

impl Condensed {
    /// Of a symmetric positive matrix, of which the entries right of the diagonal and on it are read; `last`: the unknowns of z,
    /// in their order.
    ///
    /// # Errors
    /// A pivot that is not positive, numbers that are not finite, too little memory.
    pub fn new(a: &Sparse, last: &[u32]) -> Result<Self, LinearError> {
        const METHOD: &str = "Cholesky";
        if a.values().iter().any(|v| !v.is_finite()) {
            return Err(failed(METHOD, "the matrix has entries that are not finite"));
        }
        let (n, size) = (a.size(), last.len());
        let order = order(a, last)?;
        let mut places = vec![0; n];
        order.iter().enumerate().for_each(|(place, &unknown)| places[unknown] = place);
        let pattern = pattern(a);
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let given = SymmetricOrdering::Custom(PermRef::new_checked(&order, &places, n));
        let symbolic = factorize_symbolic_cholesky(pattern.as_ref(), Side::Lower, given, parameters)
            .map_err(|error| failed(METHOD, error))?;
        let mut values = Vec::new();
        values.try_reserve_exact(symbolic.len_val()).map_err(|error| failed(METHOD, error))?;
        values.resize(symbolic.len_val(), 0.0);
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|error| failed(METHOD, error))?;
        symbolic
            .factorize_numeric_llt(
                &mut values,
                SparseColMatRef::new(pattern.as_ref(), a.values()),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|error| failed(METHOD, error))?;
        let mut condensed = Condensed {
            symbolic,
            values,
            order,
            low: vec![0.0; size * size],
            inverse: vec![0.0; size * size],
            size,
            changes: Vec::new(),
            changed: false,
        };
        condensed.condense()?;
        Ok(condensed)
    }

    fn supernodal(&self) -> &supernodal::SymbolicSupernodalCholesky<usize> {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(symbolic) => symbolic,
            SymbolicCholeskyRaw::Simplicial(_) => unreachable!("supernodes were asked for"),
        }
    }

    /// Takes L_zz out of the factor, and inverts S.
    fn condense(&mut self) -> Result<(), LinearError> {
        let (size, first) = (self.size, self.order.len() - self.size);
        let mut low = std::mem::take(&mut self.low);
        let symbolic = self.supernodal();
        let factor = supernodal::SupernodalLltRef::new(symbolic, &self.values);
        for s in 0..symbolic.n_supernodes() {
            let node = factor.supernode(s);
            let (block, start, below) = (node.val(), node.start(), node.pattern());
            let columns = block.ncols();
            for j in first.saturating_sub(start)..columns {
                let column = &mut low[(start + j - first) * size..][..size];
                for i in j..columns {
                    column[start + i - first] = block[(i, j)];
                }
                for (i, &row) in below.iter().enumerate() {
                    column[row - first] = block[(columns + i, j)];
                }
            }
        }
        self.low = low;
        if size == 0 {
            return Ok(());
        }
        let mut memory = MemBuffer::try_new(inverse::inverse_scratch::<f64>(size, Par::Seq))
            .map_err(|error| failed("Cholesky", error))?;
        inverse::inverse(
            MatMut::from_column_major_slice_mut(&mut self.inverse, size, size),
            MatRef::from_column_major_slice(&self.low, size, size),
            Par::Seq,
            MemStack::new(&mut memory),
        );
        // What is right of the diagonal is what is below it.
        for j in 0..size {
            for i in j + 1..size {
                self.inverse[i * size + j] = self.inverse[j * size + i];
            }
        }
        Ok(())
    }

    /// F g: `g` by places in z.
    pub fn column(&self, g: &[(u32, f64)]) -> Vec<f64> {
        let mut column = vec![0.0; self.size];
        for &(place, value) in g {
            let of = &self.inverse[place as usize * self.size..][..self.size];
            column.iter_mut().zip(of).for_each(|(c, f)| *c += value * f);
        }
        for (share, change) in &self.changes {
            let along = share * g.iter().map(|&(place, value)| value * change[place as usize]).sum::<f64>();
            column.iter_mut().zip(change).for_each(|(c, f)| *c += along * f);
        }
        column
    }

    /// A − w g gᵀ from now on: `column` is F g, `share` w/(1 − w gᵀF g).
    pub fn change(&mut self, share: f64, column: Vec<f64>) {
        self.changed = true;
        self.changes.push((share, column));
        if self.changes.len() == APART {
            self.gather();
        }
    }

    /// Adds the changes to F.
    fn gather(&mut self) {
        let (size, count) = (self.size, self.changes.len());
        let plain: Vec<f64> = self.changes.iter().flat_map(|(_, change)| change.iter().copied()).collect();
        let scaled: Vec<f64> =
            self.changes.iter().flat_map(|(share, change)| change.iter().map(move |f| share * f)).collect();
        matmul(
            MatMut::from_column_major_slice_mut(&mut self.inverse, size, size),
            Accum::Add,
            MatRef::from_column_major_slice(&scaled, size, count),
            MatRef::from_column_major_slice(&plain, size, count).transpose(),
            1.0,
            Par::Seq,
        );
        self.changes.clear();
    }

    /// Solves A x = b, A with all its changes, in place of b.
    pub fn solve(&self, b: &mut [f64]) {
        let n = self.order.len();
        assert_eq!(b.len(), n, "a right side of another length");
        let mut x: Vec<f64> = self.order.iter().map(|&unknown| b[unknown]).collect();
        let symbolic = self.supernodal();
        let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let stack = MemStack::new(&mut memory);
        let factor = supernodal::SupernodalLltRef::new(symbolic, &self.values);
        factor.l_solve_with_conj(Conj::No, MatMut::from_column_major_slice_mut(&mut x, n, 1), Par::Seq, stack);
        if self.changed {
            self.between(&mut x[n - self.size..]);
        }
        factor.l_transpose_solve_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(&mut x, n, 1),
            Par::Seq,
            stack,
        );
        self.order.iter().zip(&x).for_each(|(&unknown, x)| b[unknown] = *x);
    }

    /// y → L_zzᵀ F L_zz y
    fn between(&self, y: &mut [f64]) {
        let size = self.size;
        let mut right = vec![0.0; size];
        for (j, y) in y.iter().enumerate() {
            vector::add(*y, &self.low[j * size + j..(j + 1) * size], &mut right[j..]);
        }
        let mut x = vec![0.0; size];
        for (j, right) in right.iter().enumerate() {
            vector::add(*right, &self.inverse[j * size..(j + 1) * size], &mut x);
        }
        for (share, change) in &self.changes {
            vector::add(share * vector::dot(change, &right), change, &mut x);
        }
        for (j, y) in y.iter_mut().enumerate() {
            *y = vector::dot(&self.low[j * size + j..(j + 1) * size], &x[j..]);
        }
    }
}

/// The unknowns by place: an order that keeps the factor of the others sparse (approximate minimum degree), then `last`.
fn order(a: &Sparse, last: &[u32]) -> Result<Vec<usize>, LinearError> {
    let n = a.size();
    let mut number = vec![0; n];
    last.iter().for_each(|&unknown| number[unknown as usize] = usize::MAX);
    let rest: Vec<usize> = (0..n).filter(|&unknown| number[unknown] == 0).collect();
    rest.iter().enumerate().for_each(|(k, &unknown)| number[unknown] = k);
    let (mut starts, mut columns) = (vec![0], Vec::new());
    for &row in &rest {
        let others = a.row(row).0.iter().map(|&column| number[column as usize]);
        columns.extend(others.filter(|&column| column != usize::MAX));
        starts.push(columns.len());
    }
    let count = columns.len();
    let graph = SymbolicSparseColMat::new_checked(rest.len(), rest.len(), starts, None, columns);
    let mut memory = MemBuffer::try_new(amd::order_maybe_unsorted_scratch::<usize>(rest.len(), count))
        .map_err(|error| failed("Cholesky", error))?;
    let (mut order, mut places) = (vec![0; rest.len()], vec![0; rest.len()]);
    let control = amd::Control::default();
    amd::order_maybe_unsorted(&mut order, &mut places, graph.as_ref(), control, MemStack::new(&mut memory))
        .map_err(|error| failed("Cholesky", error))?;
    Ok(order.into_iter().map(|k| rest[k]).chain(last.iter().map(|&unknown| unknown as usize)).collect())
}

#[cfg(test)]
mod tests {
    use super::super::{Direct, matrices};
    use super::*;

    /// Right of the diagonal and on it.
    fn half(a: &Sparse) -> Sparse {
        let mut triplets = Vec::new();
        for row in 0..a.size() {
            let (columns, values) = a.row(row);
            let right = columns.iter().zip(values).filter(|(column, _)| **column as usize >= row);
            triplets.extend(right.map(|(column, value)| (row as u32, *column, *value)));
        }
        Sparse::from_triplets(a.size(), &triplets)
    }

    #[test]
    fn changes_among_the_last_unknowns_are_those_of_new_factors() {
        let (nx, ny) = (24, 17);
        let a = matrices::laplacian_2d(nx, ny, 3.0);
        let last: Vec<u32> = (0..(nx * ny) as u32).filter(|k| k % 24 > 5 && k % 24 < 16 && k / 24 > 4).collect();
        let mut condensed = Condensed::new(&half(&a), &last).unwrap();
        let mut triplets = Vec::new();
        for row in 0..a.size() {
            let (columns, values) = a.row(row);
            triplets.extend(columns.iter().zip(values).map(|(column, value)| (row as u32, *column, *value)));
        }
        let b: Vec<f64> = (0..a.size()).map(vector::scattered).collect();
        // More of them than are kept apart: half of the springs between neighbours along x is taken away, in two parts.
        let pairs: Vec<usize> = (0..last.len() - 1).filter(|k| last[k + 1] == last[*k] + 1).collect();
        for round in 0..4 {
            for &k in &pairs {
                let w = 0.25 * 0.5;
                let g = [(k as u32, 1.0), (k as u32 + 1, -1.0)];
                let column = condensed.column(&g);
                let along = column[k] - column[k + 1];
                condensed.change(w / (1.0 - w * along), column);
                for (i, j, sign) in [(0, 0, -1.0), (1, 1, -1.0), (0, 1, 1.0), (1, 0, 1.0)] {
                    triplets.push((last[k + i], last[k + j], sign * w));
                }
            }
            let (mut x, mut exact) = (b.clone(), b.clone());
            condensed.solve(&mut x);
            Direct::cholesky(&Sparse::from_triplets(a.size(), &triplets)).unwrap().solve(&mut exact).unwrap();
            // κ < 500, times the rounding of a hundred changes.
            assert!(matrices::difference(&x, &exact) < 1e-11, "{round}: {:e}", matrices::difference(&x, &exact));
        }
        assert!(4 * pairs.len() > APART);
    }

    #[test]
    fn any_choice_of_last_unknowns_gives_the_same_solution() {
        let a = matrices::laplacian_2d(12, 9, 1.0);
        let (b, exact) = matrices::with_solution(&a);
        let all: Vec<u32> = (0..a.size() as u32).collect();
        for last in [&[][..], &[40], &all[3..80], &all] {
            let mut x = b.clone();
            Condensed::new(&half(&a), last).unwrap().solve(&mut x);
            // Ten roundings of size κ ε, κ < 120.
            assert!(matrices::difference(&x, &exact) < 3e-13);
        }
        let signs = Sparse::from_triplets(2, &[(0, 0, 1.0), (1, 1, -2.0)]);
        assert!(Condensed::new(&signs, &[1]).is_err());
        assert!(Condensed::new(&Sparse::from_triplets(1, &[(0, 0, f64::NAN)]), &[]).is_err());
    }
}
