//! What is asked of a body now and then, bond by bond: gradients by least squares, and the largest of some value of bonds.
//! Not for the inside of a loop over time.

use crate::family::{Body, Bond, BondStates};
use crate::field::{Number, Vector, dot, norm};
use crate::parallel;

/// ∇f at `slots` for each of some fields: the g that minimises Σ V′ (g·ξ − Δf)²/|ξ|⁶ over the bonds that hold.
/// Exact for linear fields. Zero where the bonds that are left do not span space. The nearest points count for nearly all,
/// so that short waves keep their slope: a gradient over the whole family smooths them, and turns ramps into stairs.
pub fn gradients<const D: usize, const N: usize, T: Number>(
    body: &Body<D>,
    states: &BondStates,
    fields: [&[T]; N],
    slots: &[u32],
) -> Vec<[Vector<D>; N]> {
    let gradient = |k: usize| {
        let slot = slots[k] as usize;
        let (mut shape, mut right) = ([[0.0; D]; D], [[0.0; D]; N]);
        for (bit, there) in body.bonds_of(slot).filter(|(bit, _)| states.holds(*bit)) {
            let xi = body.xi(bit, slot, there);
            let weight = body.cloud.volume(there) / dot(&xi, &xi).powi(3);
            for a in 0..D {
                for b in 0..D {
                    shape[a][b] += weight * xi[a] * xi[b];
                }
                for (right, field) in right.iter_mut().zip(&fields) {
                    right[a] += weight * xi[a] * (field[there].to_f64() - field[slot].to_f64());
                }
            }
        }
        right.map(|right| solved(shape, right).unwrap_or([0.0; D]))
    };
    parallel::map(slots.len(), &gradient)
}

/// The largest `value(bond, relative values, x, x′)` of the bonds of each point that hold; zero where there is none.
pub fn largest<const D: usize, T: Number>(
    body: &Body<D>,
    states: &BondStates,
    fields: [&[T]; D],
    value: impl Fn(&Bond<D, f64>, &Vector<D>, usize, usize) -> f64 + Sync,
) -> Vec<f64> {
    let largest = |slot: usize| {
        let mut most = 0.0f64;
        for (bit, there) in body.bonds_of(slot).filter(|(bit, _)| states.holds(*bit)) {
            let xi = body.xi(bit, slot, there);
            let relative = std::array::from_fn(|d| fields[d][there].to_f64() - fields[d][slot].to_f64());
            most = most.max(value(&Bond::new(xi, norm(&xi), 1.0), &relative, slot, there));
        }
        most
    };
    parallel::map(body.cloud.n_slots(), &largest)
}

/// The smallest pivot, over the largest entry, of a shape that is told from a flat one.
const FLAT: f64 = 1e-6;

/// Solves a symmetric positive definite system by elimination; None if it is singular.
fn solved<const D: usize>(mut a: [[f64; D]; D], mut b: Vector<D>) -> Option<Vector<D>> {
    let largest = (0..D).map(|d| a[d][d]).fold(0.0, f64::max);
    for k in 0..D {
        if a[k][k].is_nan() || a[k][k] <= FLAT * largest {
            return None;
        }
        for row in k + 1..D {
            let factor = a[row][k] / a[k][k];
            for column in k..D {
                a[row][column] -= factor * a[k][column];
            }
            b[row] -= factor * b[k];
        }
    }
    for k in (0..D).rev() {
        for column in k + 1..D {
            b[k] -= a[k][column] * b[column];
        }
        b[k] /= a[k][k];
    }
    Some(b)
}
