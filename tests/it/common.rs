//! What several tests share.

use std::sync::Mutex;

use bondwise::discretization::Operator;
use bondwise::execution::Packs;
use bondwise::family::Body;
use bondwise::field::Double;
use bondwise::geometry::{Cloud, Shape};
use bondwise::physics::Physics;
use bondwise::physics::elasticity::{Elasticity, Material, State};
use bondwise::physics::failure::CriticalStretch;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

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

/// Distance between the points of these bodies.
pub const SPACING: f64 = 1e-3;

/// A box of cells that is not centred on the origin, so that positions are rounded.
pub fn lattice<const D: usize>(counts: [usize; 3]) -> Cloud<D> {
    let low = std::array::from_fn(|d| SPACING * [0.3, -4.1, 0.7][d]);
    let high = std::array::from_fn(|d| low[d] + SPACING * counts[d] as f64);
    Cloud::lattice(&Shape::Box { low, high }, SPACING, 5)
}

/// The same points moved by up to 0.2 spacings, with volumes that differ.
pub fn perturbed<const D: usize>(counts: [usize; 3]) -> Cloud<D> {
    let cloud = lattice::<D>(counts);
    let mut random = Random::new(1);
    let positions =
        cloud.slots.iter().map(|&s| cloud.position(s as usize).map(|x| x + 0.2 * SPACING * random.next())).collect();
    let volumes = cloud.slots.iter().map(|_| SPACING.powi(D as i32) * (1.0 + 0.3 * random.next())).collect();
    Cloud::scattered(positions, volumes)
}

/// Numbers between −1 and 1.
pub struct Random(ChaCha8Rng);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(ChaCha8Rng::seed_from_u64(seed))
    }
    pub fn next(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    pub fn vector<const D: usize>(&mut self, size: f64) -> [f64; D] {
        std::array::from_fn(|_| size * self.next())
    }
}
