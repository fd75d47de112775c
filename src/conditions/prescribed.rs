//! Prescribed motion of a set, one component at a time, and the reaction that it takes.

use std::sync::Arc;

use super::profile::{FOURTH_ORDER, SECOND_ORDER};
use super::{Booked, Constraint, FormulaAtPoints, Instant, Scale, Stage, Volumes, acts_from, acts_to};
use crate::field::Number;
use crate::refinement::Remap;
use crate::unknown::{Component, Unknown, with};
use crate::visit::Visitor;

/// What is prescribed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// u(x, t)
    Value,
    /// v(x, t), per second; of equations of second order.
    Velocity,
}

/// One component of the motion of a set, given as a formula, until it is released.
#[derive(Debug, Clone)]
pub struct Prescribed {
    /// Name of the set and component, for the history: `impact_x`.
    pub name: String,
    pub slots: Arc<[u32]>,
    pub component: usize,
    pub quantity: Quantity,
    pub profile: FormulaAtPoints,
    /// Holds while t ≤ until, s.
    pub until: f64,
    /// Force that the constraint exerts on the body, mean over the last step, N.
    reaction: f64,
    /// Of the points of the set.
    volume: Scale,
    /// u (m), v (m/s) and force density (N/m³) of each point at the end of the last step.
    last: [Vec<f64>; 3],
    /// u of each point before it is rounded to the numbers of the field, m: roundings of thousands of equal steps would
    /// all go the same way.
    path: Vec<f64>,
    /// Impulse over the stages of a step so far, N·s.
    so_far: f64,
}

impl Prescribed {
    /// Holds for ever.
    pub fn new(
        name: String,
        slots: Arc<[u32]>,
        component: usize,
        quantity: Quantity,
        profile: FormulaAtPoints,
    ) -> Self {
        Prescribed {
            name,
            slots,
            component,
            quantity,
            profile,
            until: f64::INFINITY,
            reaction: 0.0,
            volume: Scale::Same(1.0),
            last: Default::default(),
            path: Vec::new(),
            so_far: 0.0,
        }
    }

    fn at<T: Number>(&mut self, at: &Instant, inertia: f64, on: &mut Component<'_, T>) -> Booked {
        let mut booked = match at.stage {
            Stage::Start => {
                if acts_from(self.until, at.t) {
                    self.start(at.t, on);
                }
                Booked::default()
            }
            Stage::Evaluated => {
                for (&slot, last) in self.slots.iter().zip(&mut self.last[2]) {
                    *last = on.rate[slot as usize].to_f64();
                }
                Booked::default()
            }
            Stage::Replaced => {
                if !self.last[0].is_empty() {
                    self.note(on);
                    self.path.clone_from(&self.last[0]);
                }
                Booked::default()
            }
            Stage::Drift if on.velocity.is_empty() => self.arrive_at_first_order(at, on.value),
            Stage::Drift => {
                self.drift(at.t, at.dt, on);
                Booked::default()
            }
            Stage::Finish => self.finish(at, inertia, on),
            Stage::Within { end } => {
                self.stage(at.t, end, at.dt, on);
                Booked::default()
            }
            Stage::Arrive => self.arrive(at, inertia, on),
        };
        booked.component = self.component;
        booked
    }

    /// Takes note of values, velocities and rates.
    fn note<T: Number>(&mut self, on: &Component<'_, T>) {
        for (last, field) in self.last.iter_mut().zip([&*on.value, &*on.velocity, &*on.rate]) {
            last.clear();
            last.extend(self.slots.iter().map(|&slot| field.get(slot as usize).map_or(0.0, |x| x.to_f64())));
        }
    }

    /// Puts the set on its prescribed motion at the start of a run.
    fn start<T: Number>(&mut self, t: f64, on: &mut Component<'_, T>) {
        for (&slot, value) in self.slots.iter().zip(self.profile.at(t)) {
            let slot = slot as usize;
            match self.quantity {
                Quantity::Value => on.value[slot] = T::from_f64(*value),
                Quantity::Velocity => on.velocity[slot] = T::from_f64(*value),
            }
        }
        self.note(on);
        self.path.clone_from(&self.last[0]);
    }

    /// Sets the values at the end of a step of first order. What came in is what they lack.
    fn arrive_at_first_order<T: Number>(&mut self, at: &Instant, value: &mut [T]) -> Booked {
        let (mut booked, end) = (Booked::default(), at.t + at.dt);
        if self.quantity == Quantity::Value && acts_to(self.until, end) {
            for (k, (&slot, g)) in self.slots.iter().zip(self.profile.at(end)).enumerate() {
                let value = &mut value[slot as usize];
                booked.impulse += (g - value.to_f64()) * self.volume.of(k);
                *value = T::from_f64(*g);
            }
        }
        self.reaction = booked.impulse / at.dt;
        booked
    }

    /// Sets the velocities with which the set drifts over the step from `t` to `t + dt`, and where they lead from the
    /// displacements at its start.
    fn drift<T: Number>(&mut self, t: f64, dt: f64, on: &mut Component<'_, T>) {
        if !acts_to(self.until, t + dt) {
            return;
        }
        let at = match self.quantity {
            Quantity::Velocity => t + 0.5 * dt,
            Quantity::Value => t + dt,
        };
        for ((&slot, &value), u) in self.slots.iter().zip(self.profile.at(at)).zip(&mut self.path) {
            let v = match self.quantity {
                Quantity::Velocity => value,
                Quantity::Value => (value - *u) / dt,
            };
            *u += dt * v;
            on.velocity[slot as usize] = T::from_f64(v);
            on.value[slot as usize] = T::from_f64(*u);
        }
    }

    /// Sets the velocities at the end of the step and accounts for the reaction over the step: its impulse is the change
    /// of momentum less the impulse of all other forces, its work the change of kinetic energy less theirs. Damping, an
    /// inner force −ρ c v, counts among the others as velocity Verlet applies it: it takes the momentum ρ c Δu.
    fn finish<T: Number>(&mut self, at: &Instant, inertia: f64, on: &mut Component<'_, T>) -> Booked {
        let Instant { t, dt, damping, .. } = *at;
        let mut booked = Booked::default();
        if !acts_to(self.until, t) {
            self.reaction = 0.0;
            return booked;
        }
        match self.quantity {
            Quantity::Velocity => {
                for (&slot, v) in self.slots.iter().zip(self.profile.at(t)) {
                    on.velocity[slot as usize] = T::from_f64(*v);
                }
            }
            Quantity::Value => {
                // The slope of the formula at t, by a central difference over the step where it goes on.
                for (&slot, v) in self.slots.iter().zip(self.profile.slope(t, 0.5 * dt, &SECOND_ORDER)) {
                    on.velocity[slot as usize] = T::from_f64(v);
                }
            }
        }
        let damped = at.damped();
        let ([start, end], [ends, middle]) = (damped.weights(), damped.energy());
        let [us, vs, fs] = &mut self.last;
        for (k, ((&slot, u_last), (v_last, f_last))) in self.slots.iter().zip(us).zip(vs.iter_mut().zip(fs)).enumerate()
        {
            let (slot, volume) = (slot as usize, self.volume.of(k));
            let [u, v, f] = [on.value[slot], on.velocity[slot], on.rate[slot]].map(T::to_f64);
            let (inertia, way) = (on.inertia(inertia, slot), u - *u_last);
            let others = (start * *f_last + end * f) * dt - inertia * damping * way;
            booked.impulse += (inertia * (v - *v_last) - others) * volume;
            let kinetic = 0.5 * inertia * (v * v - *v_last * *v_last);
            let lost = 0.5 * inertia * (ends * (v * v + *v_last * *v_last) + 2.0 * middle * (way / dt).powi(2));
            booked.work += (kinetic + lost - 0.5 * (f + *f_last) * way) * volume;
            (*u_last, *v_last, *f_last) = (u, v, f);
        }
        self.reaction = booked.impulse / dt;
        booked
    }

    /// Sets the values of time `t` at a stage of a step of `dt` that ends at `end`, where other stages lead from it. A
    /// prescribed velocity is integrated by the solver, as any other.
    fn stage<T: Number>(&mut self, t: f64, end: f64, dt: f64, on: &mut Component<'_, T>) {
        if !acts_to(self.until, end) {
            return;
        }
        match self.quantity {
            Quantity::Velocity => {
                for (&slot, v) in self.slots.iter().zip(self.profile.at(t)) {
                    on.velocity[slot as usize] = T::from_f64(*v);
                }
            }
            Quantity::Value => {
                // The slope of the formula at t, of fourth order as the method.
                let slope = self.profile.slope(t, 0.5 * dt, &FOURTH_ORDER);
                for ((&slot, v), u) in self.slots.iter().zip(slope).zip(self.profile.at(t)) {
                    on.value[slot as usize] = T::from_f64(*u);
                    on.velocity[slot as usize] = T::from_f64(v);
                }
            }
        }
    }

    /// At the end of a step with stages: sets the values there, and accounts for the change of momentum and kinetic
    /// energy, which with what [`Constraint::book`] took off is what the constraint did.
    fn arrive<T: Number>(&mut self, at: &Instant, inertia: f64, on: &mut Component<'_, T>) -> Booked {
        let mut booked = Booked::default();
        let so_far = std::mem::take(&mut self.so_far);
        let Instant { t, dt, .. } = *at;
        if !acts_to(self.until, t) {
            self.reaction = 0.0;
            return booked;
        }
        self.stage(t, t, dt, on);
        if self.quantity == Quantity::Velocity {
            // What the four stages make of it.
            for (at, weight) in [(1.0, 1.0), (0.5, 4.0), (0.0, 1.0)] {
                for (u, v) in self.path.iter_mut().zip(self.profile.at(t - at * dt)) {
                    *u += weight / 6.0 * dt * v;
                }
            }
            for (&slot, u) in self.slots.iter().zip(&self.path) {
                on.value[slot as usize] = T::from_f64(*u);
            }
        }
        let [us, vs, _] = &mut self.last;
        for (k, ((&slot, u_last), v_last)) in self.slots.iter().zip(us).zip(vs).enumerate() {
            let (slot, volume) = (slot as usize, self.volume.of(k));
            let [u, v] = [on.value[slot], on.velocity[slot]].map(T::to_f64);
            let inertia = on.inertia(inertia, slot);
            booked.impulse += inertia * (v - *v_last) * volume;
            booked.work += 0.5 * inertia * (v * v - *v_last * *v_last) * volume;
            (*u_last, *v_last) = (u, v);
        }
        self.reaction = (booked.impulse + so_far) / dt;
        booked
    }

    fn take_off<T: Number>(&mut self, weight: f64, at: &Instant, inertia: f64, on: &Component<'_, T>) -> Booked {
        let mut booked = Booked { component: self.component, ..Booked::default() };
        if !acts_to(self.until, at.t) {
            return booked;
        }
        for (k, &slot) in self.slots.iter().enumerate() {
            let slot = slot as usize;
            let [v, f] = [on.velocity[slot], on.rate[slot]].map(T::to_f64);
            let impulse = weight * (on.inertia(inertia, slot) * at.damping * v - f) * self.volume.of(k);
            booked.impulse += impulse;
            booked.work += impulse * v;
        }
        self.so_far += booked.impulse;
        booked
    }
}

impl Constraint for Prescribed {
    fn name(&self) -> &str {
        &self.name
    }

    fn on(&self) -> (usize, &[u32]) {
        (self.component, &self.slots)
    }

    fn impose(&mut self, at: &Instant, on: &mut Unknown<'_>) -> Booked {
        with!(on, vectors => self.at(at, on.inertia, &mut vectors.component(self.component, on.components)))
    }

    fn book(&mut self, weight: f64, at: &Instant, on: &mut Unknown<'_>) -> Booked {
        with!(on, vectors => {
            self.take_off(weight, at, on.inertia, &vectors.component(self.component, on.components))
        })
    }

    fn holds(&self, t: f64) -> bool {
        acts_to(self.until, t)
    }

    fn way(&mut self, [from, t]: [f64; 2], u: &[f64], way: &mut [f64], n: usize) {
        // A velocity is the rate of a displacement, whatever time stands for.
        let (at, step) = match self.quantity {
            Quantity::Value => (t, None),
            Quantity::Velocity => (0.5 * (from + t), Some(t - from)),
        };
        for (&slot, value) in self.slots.iter().zip(self.profile.at(at)) {
            let k = self.component * n + slot as usize;
            way[k] = step.map_or(value - u[k], |step| step * value);
        }
    }

    fn react(&mut self, reaction: f64) {
        self.reaction = reaction;
    }

    fn reaction(&self) -> f64 {
        self.reaction
    }

    fn measure(&mut self, volumes: Volumes<'_>) {
        self.volume = volumes(&self.slots);
    }

    fn remap(&mut self, remap: &Remap) {
        self.slots = remap.members(&self.slots).into();
        self.profile = self.profile.on(&remap.positions, &self.slots);
    }

    fn first_bad(&self) -> Option<(String, f64)> {
        self.profile.first_bad().map(|(_, value)| (self.profile.source().to_string(), value))
    }

    fn visit(&mut self, visitor: &mut dyn Visitor) {
        let names = ["held_displacement", "held_velocity", "held_force"];
        names.into_iter().zip(&mut self.last).for_each(|(name, last)| visitor.doubles(name, last));
        visitor.doubles("held_path", &mut self.path);
        visitor.number("held_impulse", &mut self.so_far);
        visitor.number("reaction", &mut self.reaction);
    }
}
