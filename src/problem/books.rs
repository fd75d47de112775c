//! The books: what came in and what was lost, and whether that is what is found.

use super::{LOOKS, Problem};
use crate::conditions::Booked;
use crate::conditions::damping::DampedStep;
use crate::physics::{Balance, Content};
use crate::visit::Visitor;

/// What came in and what was lost since the start.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ledger {
    pub initial: f64,
    pub external: f64,
    pub damped: f64,
    pub refined: f64,
    pub impulse: [f64; 3],
    pub initial_momentum: [f64; 3],
    /// At the end of the last step that was booked.
    pub kinetic: f64,
    pub momentum: [f64; 3],
}

impl Ledger {
    /// Begins with what there is.
    pub fn open(&mut self, now: &Balance) {
        self.initial = now.kinetic + now.strain + now.fracture;
        self.initial_momentum = now.momentum;
        self.impulse = [0.0; 3];
        self.external = 0.0;
        self.kinetic = now.kinetic;
        self.momentum = now.momentum;
    }

    pub fn book(&mut self, booked: Booked) {
        self.external += booked.work;
        self.impulse[booked.component] += booked.impulse;
    }

    /// Books what damping proportional to mass took over a step, from the motion at its mean velocities and at its end: ρ c Δu
    /// of momentum.
    pub fn damp(&mut self, damped: &DampedStep, mean: (f64, [f64; 3]), end: (f64, [f64; 3])) {
        let [ends, middle] = damped.energy();
        self.damped += ends * (self.kinetic + end.0) + 2.0 * middle * mean.0;
        for d in 0..3 {
            self.impulse[d] -= damped.y * mean.1[d];
        }
        (self.kinetic, self.momentum) = end;
    }

    pub fn visit(&mut self, visitor: &mut dyn Visitor) {
        let Ledger { initial, external, damped, refined, impulse, initial_momentum, kinetic, momentum } = self;
        for (name, value) in [
            ("initial_energy", initial),
            ("external_work", external),
            ("damped", damped),
            ("refined", refined),
            ("kinetic", kinetic),
        ] {
            visitor.number(name, value);
        }
        for (name, values) in [("impulse", impulse), ("initial_momentum", initial_momentum), ("momentum", momentum)] {
            values.iter_mut().for_each(|value| visitor.number(name, value));
        }
    }
}

impl Problem {
    /// The kinetic energy that belongs to Σ v².
    pub(super) fn book_motion(&mut self, squares: f64) {
        if let Some(kinetic) = self.physics.motion_of(squares) {
            self.ledger.kinetic = kinetic;
        }
    }

    /// Books what dissipation inside the body has taken since the last look, every so many steps; `first` opens the books.
    pub(super) fn book_dissipation(&mut self, step: u64, t: f64, first: bool) {
        let due = first || step.is_multiple_of(LOOKS);
        if !due || !self.physics.dissipates() {
            return;
        }
        self.catch_up();
        let Some(power) = self.physics.dissipation() else { return };
        if !first {
            // Trapezoidal in time.
            let [before, since] = self.dissipation;
            self.ledger.damped += 0.5 * (before + power) * (t - since);
        }
        self.dissipation = [power, t];
    }

    /// The energies and momenta now.
    pub fn balance(&mut self) -> Balance {
        self.catch_up();
        let Content { stored, scale, angular_momentum } = self.physics.content();
        let (kinetic, momentum) = self.physics.motion();
        let ledger = &self.ledger;
        let defect: f64 = (0..3).map(|d| (momentum[d] - ledger.initial_momentum[d] - ledger.impulse[d]).powi(2)).sum();
        Balance {
            kinetic,
            strain: stored,
            fracture: self.physics.broken().energy,
            external: ledger.external,
            damped: ledger.damped,
            refined: ledger.refined,
            initial: ledger.initial,
            momentum,
            impulse: ledger.impulse,
            angular_momentum,
            momentum_defect: defect.sqrt(),
            momentum_scale: scale,
        }
    }
}
