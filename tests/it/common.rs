//! What several tests share.

use std::sync::Mutex;

use bondwise::discretization::Operator;
use bondwise::execution::Packs;
use bondwise::family::Body;
use bondwise::field::Double;
use bondwise::physics::Physics;
use bondwise::physics::elasticity::{Elasticity, Material, State};
use bondwise::physics::failure::CriticalStretch;

/// An elastic body whose states the test keeps itself.
pub struct Held<const D: usize, P: Packs = Double>(pub Mutex<Elasticity<D, P>>);

impl<const D: usize, P: Packs> Held<D, P> {
    pub fn new(
        body: &Body<D>,
        operator: Operator,
        material: Box<dyn Material<D, P>>,
        density: f64,
        failure: Option<CriticalStretch>,
    ) -> Self {
        Held(Mutex::new(Elasticity::new(body.clone(), operator, material, density, failure)))
    }

    /// At rest, all bonds whole.
    pub fn initial_state(&self) -> State<P> {
        State::new(&self.0.lock().unwrap().body)
    }

    /// Does something with the body in a state, and takes the state out again.
    pub fn with<T>(&self, state: &mut State<P>, work: impl FnOnce(&mut Elasticity<D, P>) -> T) -> T {
        let mut elasticity = self.0.lock().unwrap();
        std::mem::swap(&mut elasticity.state, state);
        let done = work(&mut elasticity);
        std::mem::swap(&mut elasticity.state, state);
        done
    }

    /// Breaks what breaks, and fills the forces.
    pub fn evolve(&self, state: &mut State<P>, dt: f64) {
        self.with(state, |elasticity| elasticity.evolve(dt));
    }

    /// W by slot.
    pub fn energy_density(&self, state: &State<P>) -> Vec<P::Field> {
        self.with(&mut state.clone(), Elasticity::energy_density)
    }

    pub fn stable_step(&self) -> f64 {
        self.0.lock().unwrap().stable_step()
    }
}
