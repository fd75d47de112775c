//! Prescribed motion of a set, one component at a time, and the reaction that it takes.

use std::sync::Arc;

use super::Profile;
use super::load::Done;
use crate::field::Number;

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
    /// u (m), v (m/s) and force density (N/m³) of each point at the end of the last step.
    pub last: Vec<[f64; 3]>,
    /// u of each point before it is rounded to the numbers of the field, m: roundings of thousands of equal steps would
    /// all go the same way.
    pub path: Vec<f64>,
}

impl Prescribed {
    /// Sets the velocities with which the set drifts over the step from `t` to `t + dt`, and where they lead from the
    /// displacements at its start.
    pub fn drift<T: Number>(&mut self, t: f64, dt: f64, displacement: &mut [T], velocity: &mut [T]) {
        if t + dt > self.until {
            return;
        }
        let at = match self.quantity {
            Quantity::Velocity => t + 0.5 * dt,
            Quantity::Displacement => t + dt,
        };
        for ((&slot, &value), u) in self.slots.iter().zip(self.profile.at(at)).zip(&mut self.path) {
            let v = match self.quantity {
                Quantity::Velocity => value,
                Quantity::Displacement => (value - *u) / dt,
            };
            *u += dt * v;
            velocity[slot as usize] = T::from_f64(v);
            displacement[slot as usize] = T::from_f64(*u);
        }
    }

    /// Sets the velocities at the end of the step and accounts for the reaction over the step: its impulse is the change
    /// of momentum less the impulse of all other forces, its work the change of kinetic energy less theirs. Damping, an
    /// inner force −ρ c v, counts among the others by the trapezoidal rule, as velocity Verlet applies it.
    pub fn finish<T: Number>(
        &mut self,
        step: &Step,
        displacement: &[T],
        velocity: &mut [T],
        force: &[T],
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
                    velocity[slot as usize] = T::from_f64(*v);
                }
            }
            Quantity::Displacement => {
                // The slope of the formula at t, by a central difference over the step.
                let after = self.profile.at(t + 0.5 * dt).to_vec();
                for ((&slot, before), after) in self.slots.iter().zip(self.profile.at(t - 0.5 * dt)).zip(&after) {
                    velocity[slot as usize] = T::from_f64((after - before) / dt);
                }
            }
        }
        for (&slot, last) in self.slots.iter().zip(&mut self.last) {
            let slot = slot as usize;
            let [u, v, f] = [displacement[slot], velocity[slot], force[slot]].map(T::to_f64);
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
    pub fn start<T: Number>(&mut self, t: f64, displacement: &mut [T], velocity: &mut [T], force: &[T]) {
        let values = self.profile.at(t);
        self.last.clear();
        self.path.clear();
        for (&slot, value) in self.slots.iter().zip(values) {
            let slot = slot as usize;
            match self.quantity {
                Quantity::Displacement => displacement[slot] = T::from_f64(*value),
                Quantity::Velocity => velocity[slot] = T::from_f64(*value),
            }
            self.last.push([displacement[slot], velocity[slot], force[slot]].map(T::to_f64));
            self.path.push(displacement[slot].to_f64());
        }
    }
}
