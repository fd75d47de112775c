//! Diffusion along bonds: Ċ = ∫ J dV′ + S with the flux J = κ ω(|ξ|/δ) (C′ − C)/|ξ|^q of a bond.
//!
//! Shojaei et al. 2022, eqs. (22)-(25); by the standard sum, (27), or by collocation, (56)-(60). The sum gives L C;
//! sources S are added by who has them. [`Diffusing`] is a body with it, as a physics.

mod physics;

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::discretization::collocation::stability::Law;
use crate::discretization::moments::ball_moment;
use crate::discretization::volume::RIM_TOLERANCE;
use crate::discretization::{BondWeights, Collocation, Heterogeneity, Influence, Operator, PartialVolume};
use crate::error::{Error, Result};
use crate::execution::{Exec, PointRows};
use crate::family::{Body, Bond, BondKernel, BondStates, Families};
use crate::field::{Double, Vector, difference};
use crate::geometry::{Arrangement, Cloud};
use crate::lane::Lane;

/// The flux of a bond, J = κ ω(|ξ|/δ) (C′ − C)/|ξ|^q.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flux {
    pub influence: Influence,
    /// κ, m^(q−D)/s.
    pub micro_diffusivity: f64,
    /// 0, 1, 2 or 3.
    pub q: u32,
}

/// κ of the diffusivity K (m²/s), from ½ κ ∫ ω |ξ|^−q ξ₁² dV = K; m^(q−D)/s.
///
/// With ω = 1 and q = 2 in 2D 4K/(πδ²), (25). Any real q below D + 2.
///
/// # Errors
/// A q for which the integral does not exist: D + 2 and above, for `Inverted` D + 3.
pub fn micro_diffusivity<const D: usize>(influence: &Influence, q: f64, diffusivity: f64, horizon: f64) -> Result<f64> {
    let square = std::array::from_fn(|d| if d == 0 { 2 } else { 0 });
    let moment = ball_moment::<D>(influence, square, q, horizon);
    if !moment.is_finite() {
        return Err(Error::Refused(format!("ω/|ξ|^q with q = {q} has no integral over squares in {D}D")));
    }
    Ok(2.0 * diffusivity / moment)
}

impl Flux {
    /// Of a material with the diffusivity K (m²/s).
    ///
    /// # Errors
    /// A q above 3; as [`micro_diffusivity`].
    pub fn new<const D: usize>(influence: Influence, q: u32, diffusivity: f64, horizon: f64) -> Result<Self> {
        if q > 3 {
            return Err(Error::Refused(format!("the exponent q of the flux must be 0, 1, 2 or 3, got {q}")));
        }
        let micro_diffusivity = micro_diffusivity::<D>(&influence, f64::from(q), diffusivity, horizon)?;
        Ok(Flux { influence, micro_diffusivity, q })
    }

    /// The same for the rows of a fit.
    pub fn law(&self) -> Law {
        let Flux { influence, micro_diffusivity, q } = *self;
        Law::Diffusive { influence, micro_diffusivity, q: f64::from(q) }
    }
}

pub use physics::{Diffusing, fields};

/// L C on one body.
#[derive(Debug, Clone)]
pub struct Diffusion(Scheme);

#[derive(Debug, Clone)]
enum Scheme {
    /// Σ weight (C′ − C)/|ξ|^q over bonds.
    Sum {
        weights: BondWeights,
        q: u32,
    },
    Rows(PointRows),
}

impl Diffusion {
    /// The standard scheme, κ ω β V′ (C′ − C)/|ξ|^q over families, (27), (28); `body` as of
    /// [`standard::body`](crate::discretization::standard::body) with the same rule.
    pub fn standard<const D: usize>(body: &Body<D>, flux: &Flux, rule: PartialVolume) -> Self {
        let operator = Operator::standard(body, flux.micro_diffusivity, flux.influence, rule);
        Diffusion(Scheme::Sum { weights: operator.weights, q: flux.q })
    }

    /// Collocation on a lattice, and the body whose families are its supports. Right where the whole ball lies in the cloud.
    ///
    /// `bearable`: the largest eigenvalue (1/s) that may pass, see [`Collocation::marched`]; infinite for a body at rest.
    ///
    /// # Errors
    /// As [`Collocation::marched`]; a cloud without a lattice.
    pub fn collocated<const D: usize>(
        cloud: Cloud<D>,
        horizon: f64,
        flux: &Flux,
        collocation: &Collocation,
        bearable: f64,
    ) -> Result<(Body<D>, Self)> {
        if !matches!(cloud.arrangement, Arrangement::Lattice(_)) {
            return Err(Error::Refused("points share a row on lattices only".into()));
        }
        let spacing = cloud.spacing;
        let (fit, _) = collocation.marched::<D>(spacing, horizon, &flux.law(), bearable)?;
        let row = fit.diffusive(&flux.influence, flux.micro_diffusivity, f64::from(flux.q))?;
        let row: BTreeMap<[i32; D], f64> = fit.steps.into_iter().flatten().zip(row).collect();
        let step = |xi: &Vector<D>| xi.map(|x| (x / spacing).round() as i32);
        let body = Body::new(cloud, horizon, 0.0..horizon * (1.0 + RIM_TOLERANCE), |xi| row.contains_key(&step(xi)));
        let mut weights = Operator::standard(&body, 1.0, Influence::Constant, PartialVolume::None).weights;
        if let Families::Lattice(families) = &body.families {
            weights.by_offset = families.offsets.iter().map(|offset| row[&offset.step]).collect();
        }
        Ok((body, Diffusion(Scheme::Sum { weights, q: 0 })))
    }

    /// Collocation about points of any cloud: a row of its own for each of `slots`, and none elsewhere. `body` holds all
    /// points within δ in its families.
    ///
    /// Whether such rows may be marched is not known from a symbol.
    ///
    /// # Errors
    /// As [`Collocation::around`] and [`Fit::diffusive`](crate::discretization::collocation::Fit::diffusive).
    pub fn around<const D: usize>(
        body: &Body<D>,
        flux: &Flux,
        collocation: &Collocation,
        slots: &[u32],
    ) -> Result<Self> {
        let Families::Cloud(families) = &body.families else {
            return Err(Error::Refused("points of a lattice share their row".into()));
        };
        let row = |&slot: &u32| -> Result<Vec<(u32, f64)>> {
            let here = body.cloud.position(slot as usize);
            let others = families.neighbours[families.of(slot as usize)].iter().copied().filter(|other| *other != slot);
            let bonds = others.map(|other| (other, difference(&body.cloud.position(other as usize), &here)));
            let (others, bonds): (Vec<u32>, Vec<Vector<D>>) = bonds.unzip();
            let fit = collocation.around(&bonds, body.horizon)?;
            let weights = fit.diffusive(&flux.influence, flux.micro_diffusivity, f64::from(flux.q))?;
            Ok(fit.nodes.iter().map(|&j| others[j]).zip(weights).collect())
        };
        let fitted: Vec<Vec<(u32, f64)>> = slots.par_iter().map(row).collect::<Result<_>>()?;
        let mut rows = vec![Vec::new(); body.cloud.n_slots()];
        slots.iter().zip(fitted).for_each(|(&slot, row)| rows[slot as usize] = row);
        Ok(Diffusion(Scheme::Rows(PointRows::new(&rows))))
    }

    /// L C at every point, unit of C per second. Bonds that do not hold carry nothing; rows of their own know no bonds. Images have
    /// the values of their sources.
    pub fn rate<const D: usize>(
        &self,
        body: &Body<D>,
        bonds: &BondStates,
        exec: &mut Exec,
        concentration: &[f64],
        rate: &mut [f64],
    ) {
        match &self.0 {
            Scheme::Sum { weights, q } => {
                exec.sum_bonds::<D, 1, 1, Double>(body, weights, bonds, [concentration], [rate], &Conduction(*q));
            }
            Scheme::Rows(rows) => rows.sum(concentration, rate),
        }
    }

    /// A step of forward Euler that is stable if any is, s: Δt = 1/max Σ |w|, of the standard scheme w = κ ω β V′/|ξ|^q.
    ///
    /// By Gershgorin's bound on the spectral radius, 2 Σ |w|. The standard scheme has w > 0 and no eigenvalue above 0. With all
    /// bonds whole: without some of them the bound is lower.
    pub fn stable_step<const D: usize>(&self, body: &Body<D>) -> f64 {
        let largest = match (&self.0, &body.families) {
            (Scheme::Rows(rows), _) => rows.largest(),
            (Scheme::Sum { weights, q }, Families::Lattice(families)) if weights.heterogeneity.is_none() => {
                let sizes = families.offsets.iter().zip(&weights.by_offset);
                sizes.map(|(offset, w)| w.abs() / offset.length.powi(*q as i32)).sum()
            }
            (Scheme::Sum { weights, q }, _) => {
                let mut sums = vec![0.0; body.cloud.n_slots()];
                let whole = BondStates::whole(body);
                Exec::default().sum_bonds::<D, 0, 1, Double>(body, weights, &whole, [], [&mut sums], &Conductance(*q));
                sums.into_iter().fold(0.0, f64::max)
            }
        };
        1.0 / largest
    }

    /// From here on the diffusivity of each bond is that of the weights times what this says. Of the standard scheme.
    pub fn vary(&mut self, heterogeneity: Heterogeneity) {
        if let Scheme::Sum { weights, .. } = &mut self.0 {
            weights.heterogeneity = Some(heterogeneity.into());
        }
    }

    /// Bytes of weights by offset and of rows; those of bonds that differ in length follow from it.
    pub fn memory(&self) -> usize {
        match &self.0 {
            Scheme::Sum { weights, .. } => size_of_val(&weights.by_offset[..]),
            Scheme::Rows(rows) => rows.memory(),
        }
    }

    /// ½ Σ w ξ₁², m²/s: the diffusivity that long waves find on a lattice. None elsewhere.
    ///
    /// Of the standard scheme it is not K: 1 − 1/(2m) of it in 1D with q = 2 and partial volumes, however fine the lattice.
    pub fn diffusivity<const D: usize>(&self, body: &Body<D>) -> Option<f64> {
        let (Scheme::Sum { weights, q }, Families::Lattice(families)) = (&self.0, &body.families) else {
            return None;
        };
        let terms = families.offsets.iter().zip(&weights.by_offset);
        Some(terms.map(|(o, w)| 0.5 * w * o.xi[0] * o.xi[0] / o.length.powi(*q as i32)).sum())
    }

    /// The same with all weights multiplied so that [`Diffusion::diffusivity`] is that given (m²/s); on lattices.
    #[must_use]
    pub fn calibrated<const D: usize>(mut self, body: &Body<D>, diffusivity: f64) -> Self {
        let found = self.diffusivity(body);
        if let (Scheme::Sum { weights, .. }, Some(found)) = (&mut self.0, found) {
            weights.by_offset.iter_mut().for_each(|w| *w *= diffusivity / found);
        }
        self
    }
}

impl Diffusion {
    /// Rate (1/s) of the perturbation of the points `free` that grows fastest, values elsewhere being prescribed: the largest
    /// real part of the eigenvalues of L there. Negative where all perturbations decay.
    ///
    /// By so many steps of power iteration with I + Δt L, from noise. The digits that it has depend on how near the next
    /// eigenvalue is; of symmetric rows it comes from below.
    pub fn growth<const D: usize>(&self, body: &Body<D>, exec: &mut Exec, free: &[u32], steps: u32) -> f64 {
        // Half of the stable step: no factor 1 + Δt λ below zero, so that the largest λ has the largest.
        let dt = 0.5 * self.stable_step(body);
        let mut field = vec![0.0; body.cloud.n_slots()];
        let mut rate = field.clone();
        let whole = BondStates::whole(body);
        for (k, &slot) in free.iter().enumerate() {
            field[slot as usize] = ((k * 7919) % 1013) as f64 / 1013.0 - 0.5;
        }
        let (mut logarithm, mut half) = (0.0, 0.0);
        for step in 1..=steps {
            if let Some(images) = &body.cloud.images {
                images.fill_scalar(&mut field);
            }
            self.rate(body, &whole, exec, &field, &mut rate);
            let mut square = 0.0;
            for &slot in free {
                let value = &mut field[slot as usize];
                *value += dt * rate[slot as usize];
                square += *value * *value;
            }
            let norm = square.sqrt();
            logarithm += norm.ln();
            free.iter().for_each(|&slot| field[slot as usize] /= norm);
            if step == steps / 2 {
                half = logarithm;
            }
        }
        ((logarithm - half) / f64::from(steps - steps / 2)).exp_m1() / dt
    }
}

/// ∫ C dV over all points, Σ C V in their order: what the standard scheme conserves on a body that nothing enters.
pub fn mass<const D: usize>(cloud: &Cloud<D>, exec: &mut Exec, concentration: &[f64]) -> f64 {
    let slots = &cloud.slots;
    let partial = |points: std::ops::Range<usize>| {
        let masses = slots[points].iter().map(|&slot| concentration[slot as usize] * cloud.volume(slot as usize));
        [masses.sum(), 0.0, 0.0, 0.0]
    };
    exec.sum(slots.len(), &partial)[0]
}

/// Σ weight (C′ − C)/|ξ|^q
struct Conduction(u32);

impl<const D: usize> BondKernel<D, 1, 1> for Conduction {
    const EVERY_STEP: bool = true;
    const VARIED: bool = true;
    const LINEAR: bool = true;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, [relative]: &[L; 1], _: &[L; 0], _: L, [sum]: [L; 1]) -> [L; 1] {
        [conductance(bond, self.0).mul_add(*relative, sum)]
    }
}

/// Σ weight/|ξ|^q
struct Conductance(u32);

impl<const D: usize> BondKernel<D, 0, 1> for Conductance {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: &[L; 0], _: L, [sum]: [L; 1]) -> [L; 1] {
        [sum + conductance(bond, self.0)]
    }
}

#[inline(always)]
fn conductance<const D: usize, L: Lane>(bond: &Bond<D, L>, q: u32) -> L {
    match q {
        0 => bond.weight,
        1 => bond.spring,
        2 => bond.weight * bond.inverse_square,
        _ => bond.spring * bond.inverse_square,
    }
}

#[cfg(test)]
mod tests;
