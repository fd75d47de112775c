//! Forces on a surface, spread over the points beside it.

use std::fmt;
use std::sync::Arc;

use crate::field::Vector;
use crate::geometry::{Crack, Fits, Piece, Shape, sum_of_shares};

/// Which force acts on each point of a load, by the values of its formula at pieces of a surface.
///
/// F_i = Σ_q φ_i(x_q) c_q f(x_q), with φ of [`Fits`] and c_q what the piece makes of a unit of f, N: so the sum of forces and their
/// moments are those of the surface.
#[derive(Clone)]
pub struct Spread {
    /// Of each point, from where to where its entries stand.
    starts: Vec<usize>,
    /// Pieces and φ_i c_q, N.
    entries: Vec<(u32, f64)>,
    /// Their sums: a formula that is the same everywhere is multiplied by these, which do not depend on the order of pieces.
    totals: Option<Vec<f64>>,
    again: Again,
}

/// Does it anew for points that have been replaced: positions and volumes by slot.
type Again = Arc<dyn Fn(&[[f64; 3]], &[f64]) -> (Vec<u32>, Spread) + Send + Sync>;

impl fmt::Debug for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Spread").field("points", &(self.starts.len() - 1)).finish_non_exhaustive()
    }
}

/// A surface and the body below it.
#[derive(Debug, Clone)]
pub struct Loaded<const D: usize> {
    pub pieces: Vec<Piece<D>>,
    /// c_q
    pub coefficients: Vec<f64>,
    pub shape: Option<Shape<D>>,
    pub cracks: Vec<Crack<D>>,
    /// Whether the formula is the same everywhere.
    pub uniform: bool,
}

impl<const D: usize> Loaded<D> {
    /// Slots of the points that are loaded, ascending, and how; `slots` are those of all points, with their positions (m) and sides
    /// of cells.
    pub fn spread(self: Arc<Self>, slots: &[u32], positions: &[Vector<D>], sides: &[f64]) -> (Vec<u32>, Spread) {
        let fits = Fits::new(positions, sides, self.shape.as_ref(), &self.cracks);
        // Entries by point; of each point the pieces are in their order.
        let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); positions.len()];
        for (q, (piece, coefficient)) in self.pieces.iter().zip(&self.coefficients).enumerate() {
            if *coefficient != 0.0 {
                fits.at(piece).into_iter().for_each(|(k, share)| rows[k].push((q as u32, share * coefficient)));
            }
        }
        let mut loaded: Vec<(u32, Vec<(u32, f64)>)> = slots.iter().copied().zip(rows).collect();
        loaded.retain(|(_, row)| !row.is_empty());
        loaded.sort_unstable_by_key(|(slot, _)| *slot);
        let largest = self.coefficients.iter().fold(f64::MIN_POSITIVE, |most, c| c.abs().max(most));
        let total = |row: &[(u32, f64)]| largest * sum_of_shares(row.iter().map(|(_, force)| force / largest));
        let totals = self.uniform.then(|| loaded.iter().map(|(_, row)| total(row)).collect());
        let mut starts = vec![0];
        let (mut found, mut entries) = (Vec::new(), Vec::new());
        for (slot, row) in loaded {
            found.push(slot);
            entries.extend(row);
            starts.push(entries.len());
        }
        let again: Again = Arc::new(move |positions, volumes| {
            let slots: Vec<u32> = (0..positions.len() as u32).collect();
            let places: Vec<Vector<D>> = positions.iter().map(|x| std::array::from_fn(|d| x[d])).collect();
            let sides: Vec<f64> = volumes.iter().map(|volume| volume.powf(1.0 / D as f64)).collect();
            self.clone().spread(&slots, &places, &sides)
        });
        (found, Spread { starts, entries, totals, again })
    }
}

impl Spread {
    /// The force on point `k` of the load, N, from the values at all pieces.
    #[inline]
    pub fn force(&self, k: usize, values: &[f64]) -> f64 {
        if let Some(totals) = &self.totals {
            return totals[k] * values[0];
        }
        let entries = &self.entries[self.starts[k]..self.starts[k + 1]];
        entries.iter().map(|&(piece, force)| force * values[piece as usize]).sum()
    }

    /// The same over points that have been replaced, with their slots.
    pub fn again(&self, positions: &[[f64; 3]], volumes: &[f64]) -> (Vec<u32>, Spread) {
        (self.again)(positions, volumes)
    }
}
