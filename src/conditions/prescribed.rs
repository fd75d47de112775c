//! Prescribed motion of a set, one component at a time, and the reaction that it takes.

use std::sync::Arc;

use super::Profile;
use super::load::Done;

/// What is prescribed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// u(x, t), m
    Displacement,
    /// v(x, t), m/s
    Velocity,
}

/// The step that a constraint looks back on.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// Time at its end, s.
    pub t: f64,
    pub dt: f64,
    /// ρ, kg/m³
    pub inertia: f64,
    /// c, 1/s
    pub damping: f64,
}

/// One component of the motion of a set, given as a formula, until it is released.
#[derive(Debug, Clone)]
pub struct Prescribed {
    /// Name of the set and component, for the history: `impact_x`.
    pub name: String,
    pub slots: Arc<[u32]>,
    pub component: usize,
    pub quantity: Quantity,
    pub profile: Profile,
    /// Holds while t ≤ until, s.
    pub until: f64,
    /// Force that the constraint exerts on the body, mean over the last step, N.
    pub reaction: f64,
    pub last: Vec<[f64; 3]>,
}

impl Prescribed {
    /// Sets the velocities with which the set drifts over the step from `t` to `t + dt`.
    pub fn drift(&mut self, t: f64, dt: f64, displacement: &[f64], velocity: &mut [f64]) {
        if t + dt > self.until {
            return;
        }
        match self.quantity {
            Quantity::Velocity => {
                for (&slot, v) in self.slots.iter().zip(self.profile.at(t + 0.5 * dt)) {
                    velocity[slot as usize] = *v;
                }
            }
            Quantity::Displacement => {
                for (&slot, u) in self.slots.iter().zip(self.profile.at(t + dt)) {
                    velocity[slot as usize] = (u - displacement[slot as usize]) / dt;
                }
            }
        }
    }

    /// Sets the velocities at the end of the step and accounts for the reaction over the step: its impulse is the change
    /// of momentum less the impulse of all other forces, its work the change of kinetic energy less theirs. Damping, an
    /// inner force −ρ c v, counts among the others by the trapezoidal rule, as velocity Verlet applies it.
    pub fn finish(
        &mut self,
        step: &Step,
        displacement: &[f64],
        velocity: &mut [f64],
        force: &[f64],
        volume: impl Fn(usize) -> f64,
    ) -> Done {
        let Step { t, dt, inertia, damping } = *step;
        let mut done = Done::default();
        if t > self.until {
            self.reaction = 0.0;
            return done;
        }
        match self.quantity {
            Quantity::Velocity => {
                for (&slot, v) in self.slots.iter().zip(self.profile.at(t)) {
                    velocity[slot as usize] = *v;
                }
            }
            Quantity::Displacement => {
                // The slope of the formula at t, by a central difference over the step.
                let after = self.profile.at(t + 0.5 * dt).to_vec();
                for ((&slot, before), after) in self.slots.iter().zip(self.profile.at(t - 0.5 * dt)).zip(&after) {
                    velocity[slot as usize] = (after - before) / dt;
                }
            }
        }
        for (&slot, last) in self.slots.iter().zip(&mut self.last) {
            let slot = slot as usize;
            let (u, v, f) = (displacement[slot], velocity[slot], force[slot]);
            let [u_last, v_last, f_last] = *last;
            let mean = 0.5 * (f + f_last);
            let damped = 0.5 * inertia * damping * dt;
            done.impulse += (inertia * (v - v_last) + damped * (v + v_last) - mean * dt) * volume(slot);
            let kinetic = 0.5 * inertia * (v * v - v_last * v_last);
            done.work += (kinetic + damped * (v * v + v_last * v_last) - mean * (u - u_last)) * volume(slot);
            *last = [u, v, f];
        }
        self.reaction = done.impulse / dt;
        done
    }

    /// Puts the set on its prescribed motion at the start of a run.
    pub fn start(&mut self, t: f64, displacement: &mut [f64], velocity: &mut [f64], force: &[f64]) {
        let values = self.profile.at(t);
        self.last.clear();
        for (&slot, value) in self.slots.iter().zip(values) {
            let slot = slot as usize;
            match self.quantity {
                Quantity::Displacement => displacement[slot] = *value,
                Quantity::Velocity => velocity[slot] = *value,
            }
            self.last.push([displacement[slot], velocity[slot], force[slot]]);
        }
    }
}
