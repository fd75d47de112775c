//! Motion, ü = L u (ρ = 1), by the classical Runge-Kutta method.

use super::model::Bonds;

/// Displacements and velocities.
#[derive(Debug, Clone, Default)]
pub struct Motion {
    pub u: Vec<f64>,
    pub v: Vec<f64>,
}

impl Motion {
    /// At rest.
    pub fn released(u: Vec<f64>) -> Self {
        Self { v: vec![0.0; u.len()], u }
    }

    /// Energy density of every node: ½ v² and the strain energy.
    pub fn energy(&self, bonds: &Bonds) -> Vec<f64> {
        bonds.energy(&self.u).iter().zip(&self.v).map(|(w, v)| w + 0.5 * v * v).collect()
    }

    /// Σ V v
    pub fn momentum(&self, bonds: &Bonds) -> f64 {
        self.v.iter().zip(&bonds.volume).map(|(v, volume)| v * volume).sum()
    }

    /// Σ V (½ v² + W)
    pub fn total_energy(&self, bonds: &Bonds) -> f64 {
        self.energy(bonds).iter().zip(&bonds.volume).map(|(e, volume)| e * volume).sum()
    }
}

/// The classical Runge-Kutta method of order 4 with its working space. Stable for Δt ω ≤ 2.83.
#[derive(Debug, Clone)]
pub struct RungeKutta {
    pub dt: f64,
    /// Acceleration and displacement of a stage, sums of the stages.
    a: Vec<f64>,
    u: Vec<f64>,
    v: Vec<f64>,
    sum_u: Vec<f64>,
    sum_v: Vec<f64>,
}

impl RungeKutta {
    pub fn new(dt: f64) -> Self {
        Self { dt, a: vec![], u: vec![], v: vec![], sum_u: vec![], sum_v: vec![] }
    }

    pub fn step(&mut self, bonds: &Bonds, motion: &mut Motion) {
        let n = bonds.count();
        self.u.clone_from(&motion.u);
        self.v.clone_from(&motion.v);
        for work in [&mut self.a, &mut self.sum_u, &mut self.sum_v] {
            work.clear();
            work.resize(n, 0.0);
        }
        // Weight of a stage, and how far the next one lies ahead.
        for (weight, ahead) in [(1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0)] {
            bonds.force(&self.u, &mut self.a);
            for i in 0..n {
                self.sum_u[i] += weight * self.v[i];
                self.sum_v[i] += weight * self.a[i];
                self.u[i] = motion.u[i] + ahead * self.dt * self.v[i];
                self.v[i] = motion.v[i] + ahead * self.dt * self.a[i];
            }
        }
        for i in 0..n {
            motion.u[i] += self.dt / 6.0 * self.sum_u[i];
            motion.v[i] += self.dt / 6.0 * self.sum_v[i];
        }
    }
}
