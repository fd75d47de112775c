//! Motion, ü = L u (ρ = 1), by the classical Runge-Kutta method.

use super::{Bonds, Model, Motion};

/// A step of Δt. Stable for Δt ω ≤ 2.83.
pub fn step(bonds: &mut Bonds, motion: &mut Motion, dt: f64) {
    let n = bonds.count();
    // Displacement, velocity and acceleration of a stage, sums of the stages.
    let (mut u, mut v, mut a) = (motion.u.clone(), motion.v.clone(), vec![0.0; n]);
    let (mut sum_u, mut sum_v) = (vec![0.0; n], vec![0.0; n]);
    // Weight of a stage, and how far the next one lies ahead.
    for (weight, ahead) in [(1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0)] {
        bonds.force(&u, &mut a);
        for i in 0..n {
            sum_u[i] += weight * v[i];
            sum_v[i] += weight * a[i];
            u[i] = motion.u[i] + ahead * dt * v[i];
            v[i] = motion.v[i] + ahead * dt * a[i];
        }
    }
    for i in 0..n {
        motion.u[i] += dt / 6.0 * sum_u[i];
        motion.v[i] += dt / 6.0 * sum_v[i];
    }
}
