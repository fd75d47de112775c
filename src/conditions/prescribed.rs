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
    /// Impulse over the stages of a step so far, N·s.
    pub so_far: f64,
}

/// Of `until`: times that are sums of steps reach it to rounding only.
const SLACK: f64 = 1e-9;

impl Prescribed {
    /// Whether it holds in a load step that ends at `t`.
    pub fn holds(&self, t: f64) -> bool {
        t <= self.until * (1.0 + SLACK)
    }

    /// Whether it goes on holding after `t`.
    pub fn goes_on(&self, t: f64) -> bool {
        t < self.until * (1.0 - SLACK)
    }

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

    /// Sets the values of time `t` at a stage of a step of `dt` that ends at `end`, where other stages lead from it. A
    /// prescribed velocity is integrated by the solver, as any other.
    pub fn stage<T: Number>(&mut self, t: f64, end: f64, dt: f64, displacement: &mut [T], velocity: &mut [T]) {
        if end > self.until {
            return;
        }
        match self.quantity {
            Quantity::Velocity => {
                for (&slot, v) in self.slots.iter().zip(self.profile.at(t)) {
                    velocity[slot as usize] = T::from_f64(*v);
                }
            }
            Quantity::Displacement => {
                // The slope of the formula at t, of fourth order as the method.
                let mut slope = vec![0.0; self.slots.len()];
                for (at, weight) in [(-1.0, 1.0), (-0.5, -8.0), (0.5, 8.0), (1.0, -1.0)] {
                    for (slope, u) in slope.iter_mut().zip(self.profile.at(t + at * dt)) {
                        *slope += weight * u / (6.0 * dt);
                    }
                }
                for ((&slot, v), u) in self.slots.iter().zip(&slope).zip(self.profile.at(t)) {
                    displacement[slot as usize] = T::from_f64(*u);
                    velocity[slot as usize] = T::from_f64(*v);
                }
            }
        }
    }

    /// Takes the work and impulse of all other forces, over `weight` (s) of what acts now, off those of the constraint.
    /// `step` is the one that goes on.
    pub fn book<T: Number>(
        &mut self,
        weight: f64,
        step: &Step,
        velocity: &[T],
        force: &[T],
        volume: impl Fn(usize) -> f64,
    ) -> Done {
        let mut done = Done::default();
        if step.t > self.until {
            return done;
        }
        for &slot in self.slots.iter() {
            let slot = slot as usize;
            let [v, f] = [velocity[slot], force[slot]].map(T::to_f64);
            let impulse = weight * (step.inertia * step.damping * v - f) * volume(slot);
            done.impulse += impulse;
            done.work += impulse * v;
        }
        self.so_far += done.impulse;
        done
    }

    /// At the end of a step with stages: sets the values there, and accounts for the change of momentum and kinetic
    /// energy, which with what [`Prescribed::book`] took off is what the constraint did.
    pub fn arrive<T: Number>(
        &mut self,
        step: &Step,
        displacement: &mut [T],
        velocity: &mut [T],
        volume: impl Fn(usize) -> f64,
    ) -> Done {
        let mut done = Done::default();
        let so_far = std::mem::take(&mut self.so_far);
        let Step { t, dt, inertia, .. } = *step;
        if t > self.until {
            self.reaction = 0.0;
            return done;
        }
        self.stage(t, t, dt, displacement, velocity);
        if self.quantity == Quantity::Velocity {
            // What the four stages make of it.
            for (at, weight) in [(1.0, 1.0), (0.5, 4.0), (0.0, 1.0)] {
                for (u, v) in self.path.iter_mut().zip(self.profile.at(t - at * dt)) {
                    *u += weight / 6.0 * dt * v;
                }
            }
            for (&slot, u) in self.slots.iter().zip(&self.path) {
                displacement[slot as usize] = T::from_f64(*u);
            }
        }
        for (&slot, last) in self.slots.iter().zip(&mut self.last) {
            let slot = slot as usize;
            let [u, v] = [displacement[slot], velocity[slot]].map(T::to_f64);
            done.impulse += inertia * (v - last[1]) * volume(slot);
            done.work += 0.5 * inertia * (v * v - last[1] * last[1]) * volume(slot);
            *last = [u, v, last[2]];
        }
        self.reaction = (done.impulse + so_far) / dt;
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
