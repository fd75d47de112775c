//! Bodies at rest by motion that dies out: adaptive dynamic relaxation.
//!
//! M ü + c M u̇ = r by central differences with steps of 1 and M the diagonal of the tangent; c follows the lowest
//! frequency that the motion shows, c = 2 √(uᵀ K u / uᵀ M u), K = −Δr/Δu by unknown (Kilic & Madenci 2010, after
//! Underwood 1983). No linear system is solved, so it goes on where tangents are singular.

use super::linear::vector;
use super::newton::{Convergence, Equilibrium, NotConverged};

/// Adaptive dynamic relaxation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DynamicRelaxation {
    /// At rest when |r| ≤ tolerance × the larger of |loads| and |reactions|.
    pub tolerance: f64,
    pub max_iterations: usize,
}

/// Steps of 1 are stable to M⁻¹ K = 4; the symbol of a bond sum is at most twice its diagonal, and that is doubled once
/// more for points at surfaces, whose families are not the same in all directions.
const MASS: f64 = 1.0;
/// c stays below 2, where central differences end.
const MOST_DAMPING: f64 = 1.9;

impl DynamicRelaxation {
    /// Brings `system` to rest at time `t`. `observe` is told the iteration and the relative imbalance, and stops the
    /// solver by answering false.
    ///
    /// # Errors
    /// [`NotConverged`]; the displacements are then those of the last step.
    pub fn solve(
        &self,
        system: &mut (impl Equilibrium + ?Sized),
        t: f64,
        observe: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Result<Convergence, NotConverged> {
        let n = system.size();
        let way = system.pose(t);
        vector::add(1.0, &way, system.displacement());
        let mass: Vec<f64> = system.diagonal().into_iter().map(|k| MASS * k).collect();
        let [mut r, mut before, mut velocity, mut moved] = std::array::from_fn(|_| vec![0.0; n]);
        let space = system.floating();
        let mut rested = Convergence::default();
        for iteration in 0..=self.max_iterations {
            let scale = system.imbalance(&mut r);
            let share = space.balance(&mut r);
            if iteration == 0 && share > super::newton::UNBALANCED {
                return Err(NotConverged::Unbalanced(share));
            }
            let size = vector::norm(&r);
            if !size.is_finite() {
                return Err(NotConverged::NotFinite);
            }
            let relative = if size == 0.0 { 0.0 } else { size / scale };
            rested.history.push(relative);
            if relative <= self.tolerance {
                return Ok(rested);
            }
            if !observe(iteration, relative) {
                return Err(NotConverged::Interrupted);
            }
            rested.iterations += 1;
            let damping = if iteration == 0 { 0.0 } else { damping(&mass, &r, &before, &velocity, &moved) };
            let (keep, push) = ((2.0 - damping) / (2.0 + damping), 2.0 / (2.0 + damping));
            // The first half step starts from rest.
            let push = if iteration == 0 { 0.5 } else { push };
            for (v, (r, m)) in velocity.iter_mut().zip(r.iter().zip(&mass)) {
                *v = keep * *v + push * r / m;
            }
            before.copy_from_slice(&r);
            vector::add(1.0, &velocity, &mut moved);
            vector::add(1.0, &velocity, system.displacement());
        }
        let residual = rested.history.last().copied().unwrap_or(f64::NAN);
        Err(NotConverged::Iterations { iterations: self.max_iterations, residual })
    }
}

/// c of the last step, from what the forces did when the unknowns moved by `velocity`.
fn damping(mass: &[f64], r: &[f64], before: &[f64], velocity: &[f64], moved: &[f64]) -> f64 {
    let parts = moved.iter().zip(velocity).zip(r.iter().zip(before)).zip(mass);
    let (stiff, heavy) = parts.fold((0.0, 0.0), |(stiff, heavy), (((u, v), (r, before)), m)| {
        let spring = if *v == 0.0 { 0.0 } else { (before - r) / v };
        (stiff + u * u * spring, heavy + u * u * m)
    });
    if stiff > 0.0 && heavy > 0.0 { (2.0 * (stiff / heavy).sqrt()).min(MOST_DAMPING) } else { 0.0 }
}
