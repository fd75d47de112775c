//! Equilibrium by dynamic relaxation, which the paper finds necessary for the inverted micromodulus.

use super::model::{Bar, Model};

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
pub fn relax<M: Model>(
    bar: &Bar,
    load: &[f64],
    damping: Damping,
    tolerance: f64,
    most: usize,
) -> Option<(Vec<f64>, usize)> {
    let (mut model, n) = (M::new(bar), bar.grid.count());
    let mass: Vec<f64> = model.matrix().iter().enumerate().map(|(i, row)| -row[i]).collect();
    let enough = tolerance * load.iter().fold(0.0, |most: f64, b| most.max(b.abs()));
    let (mut u, mut v) = (vec![0.0; n], vec![0.0; n]);
    let (mut force, mut before) = (vec![0.0; n], vec![0.0; n]);
    let mut kinetic = 0.0;
    for step in 0..most {
        before.copy_from_slice(&force);
        model.force(&u, &mut force);
        for (f, b) in force.iter_mut().zip(load) {
            *f += b;
        }
        if force.iter().all(|f| f.abs() <= enough) {
            let mean = bar.grid.mean(&u);
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
    use super::super::engine::EngineBar;
    use super::super::grid::{Grid, Layout};
    use super::super::micromodulus::Micromodulus;
    use super::super::model::{Cover, Rule};
    use super::*;

    /// The solve is checked by the equation itself, relaxation by the solve.
    #[test]
    fn ways_to_equilibrium_agree() {
        for micromodulus in Micromodulus::ALL {
            let grid = Grid::zones(Layout::Centred, -2.0, &[(-1.0, 10), (1.0, 40), (2.0, 10)]);
            let horizon = grid.at.iter().map(|x| if x.abs() < 1.0 { 0.15 } else { 0.3 }).collect();
            let bar = Bar { grid, horizon, micromodulus, rule: Rule::Dual, cover: Cover::Exact };
            let mut model = EngineBar::new(&bar);
            let mut load = vec![0.0; 60];
            (load[20], load[39]) = (-20.0, 20.0);
            let solved = model.solve(&load);
            let mut force = vec![0.0; 60];
            model.force(&solved, &mut force);
            assert!(force.iter().zip(&load).all(|(f, b)| (f + b).abs() < 1e-9), "{micromodulus:?}");
            for damping in [Damping::Kinetic, Damping::Rayleigh] {
                let (relaxed, _) = relax::<EngineBar>(&bar, &load, damping, 1e-9, 100_000).expect("it relaxes");
                let worst = relaxed.iter().zip(&solved).fold(0.0, |w: f64, (a, b)| w.max((a - b).abs()));
                assert!(worst < 1e-6, "{micromodulus:?}, {damping:?}: {worst}");
            }
        }
    }
}
