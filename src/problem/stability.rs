//! A stable step that is proven, where the estimate of a physics is too careful: from a bound of the largest eigenvalue of the
//! body itself.

use super::Problem;
use crate::physics::{Physics, Tangent};
use crate::solver::linear::{LinearOperator, bound_of_largest_eigenvalue};
use crate::unknown::with;

/// Products of the operator with a vector: the bound is then within some 1 % of the eigenvalue.
const PRODUCTS: usize = 150;
/// The step of a difference quotient, in spacings: bonds are strained by 1e-5, so that the curvature of the law is seen to
/// 1e-10, and rounding to 1e-11.
const DIFFERENCE: f64 = 1e-5;

impl Problem {
    /// The largest step (s) that is stable for small motion about the body as it was made, of velocity Verlet for equations of
    /// second order, of forward Euler for those of first; None where that is not to be had: of rows of collocation, whose
    /// operator is not symmetric, and where frequencies may rise, as points are replaced or families lose what their
    /// dilatation is made of.
    ///
    /// M^(−½) K M^(−½), which prescribed values can only lower, and bonds that break.
    pub fn prove_step(&mut self) -> Option<f64> {
        if self.physics.hybrid().is_some() || self.physics.adapts_every().is_some() || !self.physics.only_softens() {
            return None;
        }
        let first_order = with!(self.physics.unknown(), vectors => vectors.velocity.is_empty());
        let largest = Scaled::new(&mut *self.physics).largest()?;
        let step = if first_order { 2.0 / largest } else { 2.0 / largest.sqrt() };
        let step = Some(step).filter(|step| step.is_finite() && *step > 0.0);
        self.stable_step = step.or(self.stable_step);
        step
    }
}

impl Problem {
    /// How long it takes to sum a rate, s: the second of two, when memory is there.
    pub fn seconds_per_rate(&mut self) -> Option<f64> {
        let n = self.physics.points().n_slots() * self.physics.unknown().components;
        let [u, mut force] = [vec![0.0; n], vec![0.0; n]];
        let mut once = || {
            let begin = std::time::Instant::now();
            match self.physics.tangent() {
                Some(body) => body.forces(&u, &mut force),
                None => diffuse(&mut *self.physics, &u, &mut force),
            }
            begin.elapsed().as_secs_f64()
        };
        once();
        Some(once())
    }
}

/// M^(−½) K M^(−½)
struct Scaled<'a> {
    physics: &'a mut dyn Physics,
    /// M^(−½) by slot; zero where there is no point.
    scale: Vec<f64>,
    components: usize,
    scratch: [Vec<f64>; 3],
}

impl<'a> Scaled<'a> {
    fn new(physics: &'a mut dyn Physics) -> Self {
        let (n, unknown) = (physics.points().n_slots(), physics.unknown());
        let components = unknown.components;
        let inertia = |slot: usize| match &unknown.vectors {
            crate::unknown::Numbers::Double(vectors) => vectors.relative_inertia.map(|by| by.relative[slot]),
            crate::unknown::Numbers::Single(vectors) => vectors.relative_inertia.map(|by| f64::from(by.relative[slot])),
        };
        let inertia: Vec<f64> = (0..n).map(|slot| unknown.inertia * inertia(slot).unwrap_or(1.0)).collect();
        let points = physics.points();
        let mut scale = vec![0.0; n];
        for slot in points.slots().iter().map(|&slot| slot as usize) {
            scale[slot] = 1.0 / (inertia[slot] * points.volume(slot)).sqrt();
        }
        let scratch = std::array::from_fn(|_| vec![0.0; n * components]);
        Scaled { physics, scale, components, scratch }
    }

    fn largest(&mut self) -> Option<f64> {
        bound_of_largest_eigenvalue(self, PRODUCTS)
    }
}

impl LinearOperator for Scaled<'_> {
    fn size(&self) -> usize {
        self.scale.len() * self.components
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        let Scaled { physics, scale, scratch, .. } = self;
        let [u, force, before] = scratch;
        let by_slot = |k: usize| scale[k % scale.len()];
        u.iter_mut().zip(x).enumerate().for_each(|(k, (u, x))| *u = by_slot(k) * x);
        match physics.tangent() {
            Some(body) => change(body, u, [force, before]),
            None => diffuse(&mut **physics, u, force),
        }
        y.iter_mut().zip(&*force).enumerate().for_each(|(k, (y, force))| *y = -by_slot(k) * force);
    }
}

/// Change of the force (N) of a body by small displacements `u` from rest, scaled back to `u`.
fn change(body: &mut dyn Tangent, u: &mut [f64], [force, before]: [&mut [f64]; 2]) {
    if body.is_linear() {
        return body.forces(u, force);
    }
    let largest = u.iter().fold(0.0f64, |largest, u| largest.max(u.abs()));
    if largest == 0.0 {
        return force.fill(0.0);
    }
    let h = DIFFERENCE * body.points().spacing() / largest;
    u.iter_mut().for_each(|u| *u *= h);
    body.forces(u, force);
    u.iter_mut().for_each(|u| *u = -*u);
    body.forces(u, before);
    force.iter_mut().zip(&*before).for_each(|(force, before)| *force = (*force - before) * (0.5 / h));
}

/// Rate times volume of values `u`, of what has no tangent.
fn diffuse(physics: &mut dyn Physics, u: &[f64], rate: &mut [f64]) {
    let exchange = |physics: &mut dyn Physics, values: &[f64]| {
        with!(physics.unknown(), vectors => {
            for (value, new) in vectors.value.iter_mut().zip(values) {
                *value = crate::field::Number::from_f64(*new);
            }
        });
    };
    let kept: Vec<f64> = with!(physics.unknown(), vectors => {
        vectors.value.iter().map(|value| crate::field::Number::to_f64(*value)).collect()
    });
    exchange(physics, u);
    physics.evaluate();
    with!(physics.unknown(), vectors => {
        for (rate, found) in rate.iter_mut().zip(&*vectors.rate) {
            *rate = crate::field::Number::to_f64(*found);
        }
    });
    exchange(physics, &kept);
    let points = physics.points();
    let n = points.n_slots();
    rate.iter_mut().enumerate().for_each(|(k, rate)| *rate *= points.volume(k % n));
}
