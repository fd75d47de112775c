//! Equilibrium, Σ_p k_ip (u_p − u_i) + b_i = 0: by a direct solve and by dynamic relaxation.
//!
//! A free bar may be shifted: the matrix of (26) is singular. What fixes the shift is named.

use super::model::Bonds;

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

/// How motion is taken out of a relaxation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Damping {
    /// All velocities are set to 0 whenever the kinetic energy has passed a maximum (Cundall 1982).
    Kinetic,
    /// Viscous, critical for the frequency of the present motion, √(uᵀ K u/uᵀ M u) with the local diagonal stiffness
    /// ΔF/Δu of each node (Underwood 1983; Kilic & Madenci 2010).
    Rayleigh,
}

/// Adaptive dynamic relaxation until no node's force is more than `tolerance` of the largest load: displacements with
/// Σ V u = 0 and the number of steps, or nothing after `most` steps.
///
/// Fictitious masses by Gershgorin, m_i ≥ ¼ Σ_p |K_ip|, make the step 1 stable (Underwood 1983); twice as much keeps
/// the fastest motions, and with them the kinetic energy, smooth from step to step.
pub fn relax(bonds: &Bonds, load: &[f64], damping: Damping, tolerance: f64, most: usize) -> Option<(Vec<f64>, usize)> {
    let n = bonds.count();
    let mass: Vec<f64> = (0..n).map(|i| bonds.row(i).1.iter().sum::<f64>()).collect();
    let enough = tolerance * load.iter().fold(0.0, |most: f64, b| most.max(b.abs()));
    let (mut u, mut v) = (vec![0.0; n], vec![0.0; n]);
    let (mut force, mut before) = (vec![0.0; n], vec![0.0; n]);
    let mut kinetic = 0.0;
    for step in 0..most {
        before.copy_from_slice(&force);
        bonds.force(&u, &mut force);
        for (f, b) in force.iter_mut().zip(load) {
            *f += b;
        }
        if force.iter().all(|f| f.abs() <= enough) {
            let mean = u.iter().zip(&bonds.volume).map(|(u, v)| u * v).sum::<f64>() / bonds.volume.iter().sum::<f64>();
            return Some((u.iter().map(|u| u - mean).collect(), step));
        }
        let c = match damping {
            Damping::Kinetic => 0.0,
            Damping::Rayleigh => rayleigh(&u, &v, &force, &before, &mass),
        };
        for i in 0..n {
            v[i] = ((2.0 - c) * v[i] + 2.0 * force[i] / mass[i]) / (2.0 + c);
        }
        let mut now: f64 = v.iter().zip(&mass).map(|(v, m)| m * v * v).sum();
        if damping == Damping::Kinetic && now < kinetic {
            // Velocities stand between the steps: from rest there is half a step to the next.
            for i in 0..n {
                v[i] = 0.5 * force[i] / mass[i];
            }
            now = 0.0;
        }
        kinetic = now;
        for (u, v) in u.iter_mut().zip(&v) {
            *u += v;
        }
    }
    None
}

/// Damping 2√(uᵀ K u/uᵀ M u), K from the change of force over the last step; at most just below critical for step 1.
fn rayleigh(u: &[f64], v: &[f64], force: &[f64], before: &[f64], mass: &[f64]) -> f64 {
    let (mut stiffness, mut inertia) = (0.0, 0.0);
    for i in 0..u.len() {
        if v[i] != 0.0 {
            stiffness += u[i] * u[i] * (before[i] - force[i]) / v[i];
        }
        inertia += u[i] * u[i] * mass[i];
    }
    if stiffness > 0.0 && inertia > 0.0 { (2.0 * (stiffness / inertia).sqrt()).min(1.9) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::grid::{Grid, Layout};
    use super::super::micromodulus::Micromodulus;
    use super::super::model::{Bar, Cover, Rule};
    use super::*;

    /// The solve is checked by the equation itself, relaxation and the pin by the solve.
    #[test]
    fn ways_to_equilibrium_agree() {
        for micromodulus in Micromodulus::ALL {
            let grid = Grid::zones(Layout::Centred, -2.0, &[(-1.0, 10), (1.0, 40), (2.0, 10)]);
            let horizon = grid.at.iter().map(|x| if x.abs() < 1.0 { 0.15 } else { 0.3 }).collect();
            let bonds = Bar { grid, horizon, micromodulus, rule: Rule::Dual, cover: Cover::Exact }.bonds();
            let mut load = vec![0.0; 60];
            (load[20], load[39]) = (-20.0, 20.0);
            let mean_zero = solve(&bonds, &load, Translation::MeanZero);
            let mut force = vec![0.0; 60];
            bonds.force(&mean_zero, &mut force);
            assert!(force.iter().zip(&load).all(|(f, b)| (f + b).abs() < 1e-9), "{micromodulus:?}");
            let pinned = solve(&bonds, &load, Translation::Pinned(30));
            let shift = mean_zero[30];
            assert!(mean_zero.iter().zip(&pinned).all(|(a, b)| (a - b - shift).abs() < 1e-10), "{micromodulus:?}");
            for damping in [Damping::Kinetic, Damping::Rayleigh] {
                let (relaxed, _) = relax(&bonds, &load, damping, 1e-9, 100_000).expect("it relaxes");
                let worst = relaxed.iter().zip(&mean_zero).fold(0.0, |w: f64, (a, b)| w.max((a - b).abs()));
                assert!(worst < 1e-6, "{micromodulus:?}, {damping:?}: {worst}");
            }
        }
    }
}
