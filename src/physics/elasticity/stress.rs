//! Stress and strain of points, from the forces and the shape of their families.
//!
//! With the force state T of a point (of a bond-based law half the force of each bond), ξ and y = ξ + η,
//!
//! ```text
//! P = Σ μ T⟨ξ⟩ ⊗ ξ β V′                                    collapsed stress, on the undeformed body
//! K = Σ μ ω ξ ⊗ ξ β V′,  H = (Σ μ ω η ⊗ ξ β V′) K⁻¹,  F = 1 + H
//! σ = P                                                     linear laws
//! σ = Σ μ T⟨ξ⟩ ⊗ y β V′ / det F                             the others: P Fᵀ/det F where y = F ξ
//! ε = ½ (H + Hᵀ)                                            linear laws
//! E = ½ (H + Hᵀ + Hᵀ H)                                     the others: ½ (Fᵀ F − 1)
//! ```
//!
//! P is the collapsed stress of Silling & Lehoucq (2008, "Convergence of peridynamics to classical elasticity theory"), which
//! for a uniform deformation is the peridynamic stress of Lehoucq & Silling (2008, "Force flux and the peridynamic stress
//! tensor"); K and F are the shape tensor and the deformation gradient of Silling et al. (2007). T is along ξ or y, so that σ is
//! symmetric. See `docs/theory/stress.md` for what they mean at surfaces and beside cracks.

use super::Elasticity;
use super::bond_forces::{BondForce, Pulled};
use crate::execution::Packs;
use crate::field::dot;
use crate::parallel;

/// A matrix of the dimension.
type Matrix<const D: usize> = [[f64; D]; D];

/// A family whose det K is less than this share of (tr K/D)^D does not span the space: it says nothing of F.
const FLAT: f64 = 1e-9;

impl<const D: usize, P: Packs> Elasticity<D, P> {
    /// σ (Pa) at some slots, xx yy zz xy yz xz; see [`stress`](self).
    pub(super) fn stress(&mut self, slots: &[u32]) -> Vec<[f64; 6]> {
        let (of_material, materials) = (self.out_of_plane.clone(), self.materials.clone());
        let out_of_plane = |slot: u32| {
            let material = materials.get(slot as usize).map_or(0, |material| usize::from(*material));
            of_material.get(material).copied().unwrap_or(0.0)
        };
        self.pulled(|pulled| {
            parallel::map(slots.len(), &|k| {
                let mut stress = symmetric(&stress_of(pulled, &(pulled.bonds)(slots[k] as usize)));
                if D == 2 {
                    stress[2] = out_of_plane(slots[k]) * (stress[0] + stress[1]);
                }
                stress
            })
        })
    }

    /// ε or E at some slots, as [`Elasticity::stress`]; of the plane alone in 2D.
    pub(super) fn strain(&mut self, slots: &[u32]) -> Vec<[f64; 6]> {
        self.pulled(|pulled| {
            parallel::map(slots.len(), &|k| {
                let h = gradient(&(pulled.bonds)(slots[k] as usize)).unwrap_or([[0.0; D]; D]);
                symmetric(&strain_of(&h, pulled.is_linear))
            })
        })
    }

    /// A number made of the stress at each of some slots.
    pub(super) fn of_stress<T: Send>(&mut self, slots: &[u32], of: fn(&[f64; 6]) -> T) -> Vec<T> {
        self.stress(slots).iter().map(of).collect()
    }
}

fn stress_of<const D: usize>(pulled: &Pulled<'_, D>, bonds: &[BondForce<D>]) -> Matrix<D> {
    let mut sum = [[0.0; D]; D];
    for bond in bonds {
        let arm = bond.arm(pulled.is_linear);
        for c in 0..D {
            for d in 0..D {
                sum[c][d] += bond.own[c] * arm[d];
            }
        }
    }
    if pulled.is_linear {
        return sum;
    }
    // A family that says nothing of F counts as of the volume that it had.
    let volume = gradient(bonds).map_or(1.0, |mut h| {
        (0..D).for_each(|d| h[d][d] += 1.0);
        determinant(&h)
    });
    sum.map(|row| row.map(|entry| entry / volume))
}

fn strain_of<const D: usize>(h: &Matrix<D>, is_linear: bool) -> Matrix<D> {
    let column = |c: usize| -> [f64; D] { std::array::from_fn(|k| h[k][c]) };
    std::array::from_fn(|c| {
        std::array::from_fn(|d| {
            let square = if is_linear { 0.0 } else { dot(&column(c), &column(d)) };
            0.5 * (h[c][d] + h[d][c] + square)
        })
    })
}

/// H of a family; None where its bonds do not span the space.
fn gradient<const D: usize>(bonds: &[BondForce<D>]) -> Option<Matrix<D>> {
    let (mut k, mut n) = ([[0.0; D]; D], [[0.0; D]; D]);
    for bond in bonds {
        for c in 0..D {
            for d in 0..D {
                k[c][d] += bond.weight * bond.xi[c] * bond.xi[d];
                n[c][d] += bond.weight * bond.eta[c] * bond.xi[d];
            }
        }
    }
    let size = (0..D).map(|d| k[d][d]).sum::<f64>() / D as f64;
    if size <= 0.0 || determinant(&k) <= FLAT * size.powi(D as i32) {
        return None;
    }
    // Row by row: K is symmetric, so that Hᵀ = K⁻¹ Nᵀ.
    Some(n.map(|row| solve(&k, row)))
}

fn determinant<const D: usize>(a: &Matrix<D>) -> f64 {
    match D {
        1 => a[0][0],
        2 => a[0][0] * a[1][1] - a[0][1] * a[1][0],
        _ => (0..3).map(|c| a[0][c] * minor(a, c)).sum(),
    }
}

/// Of the first row, with its sign.
fn minor<const D: usize>(a: &Matrix<D>, c: usize) -> f64 {
    let (p, q) = ((c + 1) % 3, (c + 2) % 3);
    a[1][p] * a[2][q] - a[1][q] * a[2][p]
}

/// K⁻¹ b of a positive definite K, by elimination without exchanges.
fn solve<const D: usize>(k: &Matrix<D>, b: [f64; D]) -> [f64; D] {
    let (mut k, mut x) = (*k, b);
    for pivot in 0..D {
        for row in pivot + 1..D {
            let share = k[row][pivot] / k[pivot][pivot];
            for d in pivot..D {
                k[row][d] -= share * k[pivot][d];
            }
            x[row] -= share * x[pivot];
        }
    }
    for row in (0..D).rev() {
        for d in row + 1..D {
            x[row] -= k[row][d] * x[d];
        }
        x[row] /= k[row][row];
    }
    x
}

/// xx yy zz xy yz xz of a matrix that is symmetric but for rounding.
fn symmetric<const D: usize>(a: &Matrix<D>) -> [f64; 6] {
    let at = |c: usize, d: usize| if c.max(d) < D { 0.5 * (a[c][d] + a[d][c]) } else { 0.0 };
    [at(0, 0), at(1, 1), at(2, 2), at(0, 1), at(1, 2), at(0, 2)]
}

/// −tr σ/3
pub(super) fn pressure([xx, yy, zz, ..]: &[f64; 6]) -> f64 {
    -(xx + yy + zz) / 3.0
}

/// √(3/2 s : s) of the deviator s.
pub(super) fn von_mises([xx, yy, zz, xy, yz, xz]: &[f64; 6]) -> f64 {
    let normal = (xx - yy).powi(2) + (yy - zz).powi(2) + (zz - xx).powi(2);
    (0.5 * normal + 3.0 * (xy * xy + yz * yz + xz * xz)).sqrt()
}

/// Turns after which what is off the diagonal is rounding: Jacobi's method squares it from turn to turn.
const SWEEPS: usize = 12;

/// The eigenvalues, the largest first, by Jacobi's rotations (Golub & Van Loan, Matrix Computations, section 8.5).
pub(super) fn principal([xx, yy, zz, xy, yz, xz]: &[f64; 6]) -> [f64; 3] {
    let mut a = [[*xx, *xy, *xz], [*xy, *yy, *yz], [*xz, *yz, *zz]];
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let tau = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let tangent = tau.signum() / (tau.abs() + tau.hypot(1.0));
            let cosine = 1.0 / tangent.hypot(1.0);
            let sine = tangent * cosine;
            for row in &mut a {
                (row[p], row[q]) = (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
            }
            let [above, below] = [a[p], a[q]];
            for d in 0..3 {
                (a[p][d], a[q][d]) = (cosine * above[d] - sine * below[d], sine * above[d] + cosine * below[d]);
            }
            // What rounding leaves there.
            (a[p][q], a[q][p]) = (0.0, 0.0);
        }
    }
    let mut values = [a[0][0], a[1][1], a[2][2]];
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_values_have_the_invariants_of_the_tensor_and_von_mises_follows_from_them() {
        for tensor in [
            [1.0, 2.0, 3.0, 0.5, -0.25, 4.0],
            [7.0, 7.0, 7.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 2.0, 0.0, 0.0],
            [3e8, -1e8, 2e-3, 5e7, -4e7, 1e8],
        ] {
            let [a, b, c] = principal(&tensor);
            let [xx, yy, zz, xy, yz, xz] = tensor;
            assert!(a >= b && b >= c);
            let size = tensor.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            // Some ten rotations, a few roundings each.
            let near = |x: f64, y: f64, power: i32| assert!((x - y).abs() < 1e-14 * size.powi(power), "{x} {y}");
            near(a + b + c, xx + yy + zz, 1);
            near(a * b + b * c + c * a, xx * yy + yy * zz + zz * xx - xy * xy - yz * yz - xz * xz, 2);
            let determinant = determinant(&[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
            near(0.1 * a * b * c, 0.1 * determinant, 3);
            let mises = (0.5 * ((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2))).sqrt();
            near(mises, von_mises(&tensor), 1);
        }
    }
}
