//! State-based elasticity: a bond pulls by its own stretch and by how much the families of its ends have grown.
//!
//! The linear peridynamic solid of Silling et al. (2007), which has any Poisson ratio. With the extension e = |y| − |ξ| of a
//! bond, y = ξ + η, and M = y/|y|, at each point
//!
//! ```text
//! m = Σ ω |ξ|² β V′                       weighted volume of the family before any bond broke
//! θ = (D/m) Σ μ ω |ξ| e β V′              dilatation
//! W = ½ (k − A G/D²) θ² + (A G/2m) Σ μ ω e² β V′
//! t = ω [(k − A G/D²) (D θ/m) |ξ| + (A G/m) e]
//! f = Σ μ (t + t′) M β V′
//! ```
//!
//! with k the bulk modulus of the dimension and A = D (D + 2): in 3D K and 15, so that t = ω [(3K − 5G) θ |ξ| + 15 G e]/m; in
//! 2D K₂ and 8, so that t = ω [(2K₂ − 4G) θ |ξ| + 8 G e]/m; in 1D only E matters, A G = k = E, and nothing of θ is left.
//! Each end has its own m, the sum over its own family rather than the integral over the ball: equal stretch in all
//! directions then has θ = D s and W = ½ k θ² exactly, at surfaces too. f is the slope of the energy Σ W V.
//!
//! A bond has the weight of the bond-based law, c ω̃ β V′ with ω̃ = ω |ξ|/δ, because ω e = (δ ω̃) s: the influence function of
//! a case is ω̃. Where 3K = 5G (ν = 1/4; in 2D K₂ = 2G: ν = 1/3 in plane stress, 1/4 in plane strain) only the second part is
//! left, which is the bond-based law but for m. In these weights
//!
//! ```text
//! M = Σ c ω̃ |ξ| β V′,   S = Σ μ c ω̃ |ξ| s β V′,   q = A G/M,   h = (D² k − A G)/M²,   p = h S
//! W = ½ p S + ½ q Σ μ c ω̃ |ξ| s² β V′,   f = Σ μ c ω̃ [p + p′ + (q + q′) s] M β V′
//! ```
//!
//! Two passes a step: the bonds that overstretch break, and S is summed; then the forces, from u, p and q of both ends.
//! In double precision only.

mod moduli;

use std::any::Any;
use std::sync::Mutex;

use rayon::prelude::*;

pub use moduli::Moduli;

use super::bond_based::{BondBased, BondBasedLinear, FORCE, STRETCH};
use super::{Edge, Energy};
use crate::discretization::BondWeights;
use crate::execution::{BreakRule, Broken, Exec};
use crate::family::{Body, Bond, BondKernel, BondLaw, BondStates};
use crate::field::{Double, components, components_mut, dot};
use crate::geometry::Arrangement;
use crate::geometry::lattice::BLOCK;
use crate::lane::{Lane, polynomial};
use crate::physics::failure::CriticalStretch;

/// A state-based solid on one body.
#[derive(Debug, Clone)]
pub struct StateBased {
    pub moduli: Moduli,
    /// Whether displacements are small.
    linear: bool,
    /// q by slot.
    stiffness: Vec<f64>,
    /// h by slot, 1/Pa.
    bulk: Vec<f64>,
    /// The bound of the largest eigenvalue, N/m⁴ in 3D, and how many times that of bonds without dilatation it is.
    bound: [f64; 2],
}

/// What changes in a step, of a [`State`](super::State) in double precision.
pub struct Changing<'a> {
    pub displacement: &'a [f64],
    pub velocity: &'a [f64],
    pub force: &'a mut [f64],
    pub states: &'a mut BondStates,
    pub broken: &'a mut Broken,
    /// p now and one evaluation before, by slot.
    pub tension: &'a mut [Vec<f64>; 2],
}

impl Changing<'_> {
    /// Before the first pass of an evaluation: what was p now is p before.
    pub fn turn(&mut self) {
        self.tension.swap(0, 1);
    }
}

/// Calls a method for the dimension of a body, with the number of values that its second pass has at each end, which stable Rust
/// cannot derive from D. All that is compiled for the solid is compiled here: once for each dimension and form, whatever
/// is generic above.
macro_rules! by_dimension {
    ($body:ident, $of:ident $(.$method:ident)? $(::$function:ident)?, $($argument:expr),*) => {{
        if let Some(body) = $body.downcast_ref::<Body<1>>() {
            $of$(.$method)?$(::$function)?::<1, 3>(body, $($argument),*)
        } else if let Some(body) = $body.downcast_ref::<Body<2>>() {
            $of$(.$method)?$(::$function)?::<2, 4>(body, $($argument),*)
        } else {
            let body = $body.downcast_ref::<Body<3>>().expect("a body has one, two or three dimensions");
            $of$(.$method)?$(::$function)?::<3, 5>(body, $($argument),*)
        }
    }};
}

/// In all methods, `body` is a [`Body`] and `weights` are its c ω̃ β V′.
impl StateBased {
    /// With c = [`Moduli::strength`]. `linear`: small displacements.
    pub fn new(moduli: Moduli, linear: bool, body: &dyn Any, weights: &BondWeights) -> Self {
        by_dimension!(body, StateBased::on, moduli, linear, weights)
    }

    /// The first pass: breaks the bonds that overstretch, then fills `tension[0]` with p. `hybrid`: the points whose bonds are
    /// not asked, if any, and which keep their p. What was p before is that of `tension[1]`, see [`Changing::turn`].
    #[allow(clippy::too_many_arguments)] // a sum over bonds, and what may break
    pub fn extend(
        &self,
        body: &dyn Any,
        weights: &BondWeights,
        failure: Option<&CriticalStretch>,
        exec: &mut Exec,
        now: &mut Changing<'_>,
        dt: f64,
        hybrid: Option<&Edge<'_>>,
    ) {
        by_dimension!(body, self.extend_in, weights, failure, exec, now, dt, hybrid);
    }

    /// The second pass: fills the force density from displacements and p.
    pub fn pull(&self, body: &dyn Any, weights: &BondWeights, exec: &mut Exec, now: &mut Changing<'_>) {
        by_dimension!(body, self.pull_in, weights, exec, now);
    }

    /// Force density (N/m³ in 3D) at given displacements; no bond breaks.
    pub fn force_density(
        &self,
        body: &dyn Any,
        weights: &BondWeights,
        exec: &mut Exec,
        states: &BondStates,
        displacement: &[&[f64]],
        force: &mut [&mut [f64]],
    ) {
        by_dimension!(body, self.force_density_in, weights, exec, states, displacement, force);
    }

    /// W by slot, J/m³.
    pub fn strain_energy_density(
        &self,
        body: &dyn Any,
        weights: &BondWeights,
        exec: &mut Exec,
        states: &BondStates,
        displacement: &[&[f64]],
        density: &mut [f64],
    ) {
        by_dimension!(body, self.energy_in, weights, exec, states, displacement, density);
    }

    /// θ by slot: D S/M.
    pub fn dilatation(
        &self,
        body: &dyn Any,
        weights: &BondWeights,
        exec: &mut Exec,
        states: &BondStates,
        displacement: &[&[f64]],
    ) -> Vec<f64> {
        by_dimension!(body, self.dilatation_in, weights, exec, states, displacement)
    }

    /// Diagonal of the stiffness of the bonds at rest, N/m⁴ in 3D, made larger by as much as dilatation makes the bound of
    /// the largest eigenvalue larger: the masses of dynamic relaxation.
    pub fn diagonal(
        &self,
        body: &dyn Any,
        weights: &BondWeights,
        exec: &mut Exec,
        states: &BondStates,
        diagonal: &mut [&mut [f64]],
    ) {
        by_dimension!(body, self.diagonal_in, weights, exec, states, diagonal);
    }

    fn on<const D: usize, const I: usize>(body: &Body<D>, moduli: Moduli, linear: bool, weights: &BondWeights) -> Self {
        let (mut exec, whole, n) = (Exec::default(), BondStates::whole(body), body.cloud.n_slots());
        let mut stiffness = vec![0.0; n];
        exec.sum_bonds::<D, 0, 1, Double>(body, weights, &whole, [], [&mut stiffness], &Moment);
        // A point without a family has neither.
        let over = |numerator: f64, moment: f64| if moment > 0.0 { numerator / moment } else { 0.0 };
        let bulk: Vec<f64> = stiffness.iter().map(|&m| over(moduli.volumetric, m * m)).collect();
        stiffness.iter_mut().for_each(|m| *m = over(moduli.deviatoric, *m));
        let bound = bound(body, weights, &stiffness, &bulk);
        StateBased { moduli, linear, stiffness, bulk, bound }
    }

    #[allow(clippy::too_many_arguments)] // a sum over bonds, and what may break
    fn extend_in<const D: usize, const I: usize>(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        failure: Option<&CriticalStretch>,
        exec: &mut Exec,
        now: &mut Changing<'_>,
        dt: f64,
        hybrid: Option<&Edge<'_>>,
    ) {
        let Changing { displacement, velocity, states, broken, tension, .. } = now;
        let motion = [components::<D, _>(displacement), components::<D, _>(velocity)];
        tension.iter_mut().for_each(|p| p.resize(body.cloud.n_slots(), 0.0));
        let [now, before] = &mut **tension;
        let mut lost = Vec::new();
        match (failure, self.linear) {
            (None, _) => self.sum(body, weights, exec, states, motion[0], now),
            (Some(failure), false) => {
                let rule = Breaking::new(BondBased, failure, motion, dt, hybrid);
                broken.bonds += extend(rule, body, weights, exec, states, now, &mut lost);
            }
            (Some(failure), true) => {
                let rule = Breaking::new(BondBasedLinear, failure, motion, dt, hybrid);
                broken.bonds += extend(rule, body, weights, exec, states, now, &mut lost);
            }
        }
        match (hybrid, &body.cloud.arrangement) {
            (Some(edge), Arrangement::Lattice(lattice)) => {
                for &block in &edge.regions.standard {
                    let slots = lattice.guard + block as usize * BLOCK..lattice.guard + (block as usize + 1) * BLOCK;
                    now[slots.clone()].iter_mut().zip(&self.bulk[slots]).for_each(|(s, h)| *s *= h);
                }
            }
            _ => self.to_tension(now),
        }
        broken.energy += self.released(body, lost, (dt != 0.0).then_some(&before[..]), now);
    }

    fn pull_in<const D: usize, const I: usize>(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        exec: &mut Exec,
        now: &mut Changing<'_>,
    ) {
        let Changing { displacement, force, states, tension, .. } = now;
        let (u, mut force) = (components::<D, _>(displacement), components_mut::<D, _>(force));
        self.act::<D, I>(body, weights, exec, states, &u, &tension[0], &mut force);
    }

    fn force_density_in<const D: usize, const I: usize>(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        exec: &mut Exec,
        states: &BondStates,
        displacement: &[&[f64]],
        force: &mut [&mut [f64]],
    ) {
        let mut tension = vec![0.0; body.cloud.n_slots()];
        self.sum(body, weights, exec, states, axes(displacement), &mut tension);
        self.to_tension(&mut tension);
        self.act::<D, I>(body, weights, exec, states, displacement, &tension, force);
    }

    fn energy_in<const D: usize, const I: usize>(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        exec: &mut Exec,
        states: &BondStates,
        displacement: &[&[f64]],
        density: &mut [f64],
    ) {
        let displacement: [&[f64]; D] = axes(displacement);
        let mut sums = vec![0.0; density.len()];
        self.sum(body, weights, exec, states, displacement, &mut sums);
        // ½ Σ of the energies of bonds, ½ c ω̃ |ξ| s² β V′ each.
        if self.linear {
            let kernel = Energy(BondBasedLinear);
            exec.sum_bonds::<D, D, 1, Double>(body, weights, states, displacement, [density], &kernel);
        } else {
            exec.sum_bonds::<D, D, 1, Double>(body, weights, states, displacement, [density], &Energy(BondBased));
        }
        for (slot, (w, s)) in density.iter_mut().zip(sums).enumerate() {
            *w = 2.0 * self.stiffness[slot] * *w + 0.5 * self.bulk[slot] * s * s;
        }
    }

    fn dilatation_in<const D: usize, const I: usize>(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        exec: &mut Exec,
        states: &BondStates,
        displacement: &[&[f64]],
    ) -> Vec<f64> {
        let mut sums = vec![0.0; body.cloud.n_slots()];
        self.sum(body, weights, exec, states, axes(displacement), &mut sums);
        let share = D as f64 / self.moduli.deviatoric;
        sums.iter_mut().zip(&self.stiffness).for_each(|(s, q)| *s *= share * q);
        sums
    }

    /// Largest stable step of velocity Verlet, s, √(4ρ/λ), with a bound λ of the operator's spectral radius: its norm of the
    /// largest row sum. The bonds alone give 2 Σ k (q + q′), k = c ω̃ β V′/|ξ|, because |s ξ| ≤ |η|. What is volumetric gives
    ///
    /// ```text
    /// Σ (c ω̃ β V′) P′ + C P,   P = h (N + C),   N = Σ c ω̃ β V′,   C = |Σ c ω̃ ξ/|ξ| β V′|
    /// ```
    ///
    /// because |S| ≤ (N + C) max |u|; and nothing where h < 0, since it then takes from an energy that stays positive.
    /// N + C of a family that has lost bonds is no more than before.
    pub fn stable_step(&self, density: f64) -> f64 {
        (4.0 * density / self.bound[0]).sqrt()
    }

    fn diagonal_in<const D: usize, const I: usize>(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        exec: &mut Exec,
        states: &BondStates,
        diagonal: &mut [&mut [f64]],
    ) {
        let output = axes_mut::<D>(diagonal);
        exec.sum_bonds::<D, 1, D, Double>(body, weights, states, [&self.stiffness], output, &Diagonal);
        diagonal.iter_mut().flat_map(|d| d.iter_mut()).for_each(|d| *d *= self.bound[1]);
    }

    /// q and h of the point in a slot: 1, and 1/Pa.
    pub fn of(&self, slot: usize) -> [f64; 2] {
        [self.stiffness[slot], self.bulk[slot]]
    }

    /// Bytes that it keeps for its points.
    pub fn memory(&self) -> usize {
        4 * size_of_val(&self.stiffness[..])
    }

    /// S by slot.
    fn sum<const D: usize>(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        exec: &mut Exec,
        states: &BondStates,
        u: [&[f64]; D],
        sum: &mut [f64],
    ) {
        if self.linear {
            exec.sum_bonds::<D, D, 1, Double>(body, weights, states, u, [sum], &Extension(BondBasedLinear));
        } else {
            exec.sum_bonds::<D, D, 1, Double>(body, weights, states, u, [sum], &Extension(BondBased));
        }
    }

    /// S → p = h S
    fn to_tension(&self, sums: &mut [f64]) {
        let scale = |(sums, bulk): (&mut [f64], &[f64])| sums.iter_mut().zip(bulk).for_each(|(s, h)| *s *= h);
        sums.par_chunks_mut(4096).zip(self.bulk.par_chunks(4096)).for_each(scale);
    }

    /// f from u, p and q.
    #[allow(clippy::too_many_arguments)] // a sum over bonds, what it reads and what it writes
    fn act<const D: usize, const I: usize>(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        exec: &mut Exec,
        states: &BondStates,
        u: &[&[f64]],
        p: &[f64],
        force: &mut [&mut [f64]],
    ) {
        let input: [&[f64]; I] = std::array::from_fn(|c| match c {
            c if c < D => u[c],
            c if c == D => p,
            _ => &self.stiffness,
        });
        let output = axes_mut::<D>(force);
        if self.linear {
            exec.sum_bonds::<D, I, D, Double>(body, weights, states, input, output, &Pull(BondBasedLinear));
        } else {
            exec.sum_bonds::<D, I, D, Double>(body, weights, states, input, output, &Pull(BondBased));
        }
    }

    /// Energy that bonds took with them, J; `before`: p at the start of the step, with them whole; none if it had no
    /// length. p now is without them.
    ///
    /// What is lost is E(μ) − E(μ′), the energies at the start of the step with and without the bonds, and the work that
    /// their forces still did, ½ of these times Δu, since velocity Verlet kicks with their force at the start of the step
    /// and no longer with that at the end: see [`BreakRule::released`]. Of energies that are squares it is the product of
    /// the two factors at the start and the end of the step, here
    ///
    /// ```text
    /// ½ [p S* − (p − h B) S] + ½ q Σ c ω̃ |ξ| s s* β V′ = ½ [p B* + B p′] + …,   B = Σ c ω̃ |ξ| s β V′ over the lost bonds
    /// ```
    ///
    /// with * at the end of the step and p′ = h S without the lost bonds there.
    fn released<const D: usize>(
        &self,
        body: &Body<D>,
        mut lost: Vec<Lost>,
        before: Option<&[f64]>,
        now: &[f64],
    ) -> f64 {
        // Threads have added them in any order.
        lost.sort_unstable_by_key(|bond| (bond.here, bond.there));
        let at = |bonds: &[Lost]| {
            let slot = bonds[0].here as usize;
            let [start, end, square] =
                bonds.iter().fold([0.0; 3], |[a, b, c], bond| [a + bond.start, b + bond.end, c + bond.square]);
            let p = before.map_or(now[slot] + self.bulk[slot] * start, |before| before[slot]);
            let density = 0.5 * (p * end + start * now[slot] + self.stiffness[slot] * square);
            density * body.cloud.volume(slot)
        };
        lost.chunk_by(|a, b| a.here == b.here).map(at).sum()
    }
}

/// The components of a vector field.
fn axes<'a, const D: usize>(field: &[&'a [f64]]) -> [&'a [f64]; D] {
    std::array::from_fn(|d| field[d])
}

/// The same, to be written.
fn axes_mut<'a, const D: usize>(field: &'a mut [&mut [f64]]) -> [&'a mut [f64]; D] {
    let mut field = field.iter_mut();
    std::array::from_fn(|_| &mut **field.next().expect("a component for each axis"))
}

/// A bond that broke, seen from one end: c ω̃ |ξ| β V′ times s at the start of the step, at its end, and their product.
struct Lost {
    here: u32,
    there: u32,
    start: f64,
    end: f64,
    square: f64,
}

/// S by slot, after the bonds that overstretch are broken: how many, and which.
fn extend<const D: usize, B: Stretch<D>>(
    rule: Breaking<'_, D, B>,
    body: &Body<D>,
    weights: &BondWeights,
    exec: &mut Exec,
    states: &mut BondStates,
    sums: &mut [f64],
    lost: &mut Vec<Lost>,
) -> u64 {
    let (kernel, u) = (Extension(rule.law), rule.displacement);
    let broken = exec.sum_bonds_and_break::<D, D, 1, Double>(body, weights, states, u, [sums], &kernel, &rule);
    *lost = rule.lost.into_inner().expect("no thread has panicked");
    broken.bonds
}

/// λ of [`StateBased::stable_step`], and λ over that of the bonds alone.
fn bound<const D: usize>(body: &Body<D>, weights: &BondWeights, stiffness: &[f64], bulk: &[f64]) -> [f64; 2] {
    let (n, whole, mut exec) = (body.cloud.n_slots(), BondStates::whole(body), Exec::default());
    let mut sums = |values: &[f64]| {
        let mut sums: [Vec<f64>; 5] = std::array::from_fn(|_| vec![0.0; n]);
        let output = sums.each_mut().map(|s| &mut s[..]);
        exec.sum_bonds::<D, 1, 5, Double>(body, weights, &whole, [values], output, &Row);
        sums
    };
    let [bonds, ..] = sums(stiffness);
    let [_, length, directions @ ..] = sums(&vec![0.5; n]);
    let lean: Vec<f64> = (0..n).map(|i| directions[..D].iter().map(|d| d[i] * d[i]).sum::<f64>().sqrt()).collect();
    let push: Vec<f64> = (0..n).map(|i| bulk[i].max(0.0) * (length[i] + lean[i])).collect();
    let [_, pushed, ..] = sums(&push);
    let largest = |row: &dyn Fn(usize) -> f64| (0..n).map(row).fold(0.0, f64::max);
    let without = largest(&|i| 2.0 * bonds[i]);
    let with = largest(&|i| 2.0 * bonds[i] + pushed[i] + push[i] * (lean[i] - length[i]));
    [with, if without > 0.0 { with / without } else { 1.0 }]
}

/// A bond law whose stretch a state-based solid uses.
trait Stretch<const D: usize>: BondLaw<D> {
    /// s from the strain of the law; `small` as [`BondLaw::small_energy`].
    fn stretch<L: Lane>(strain: L, small: bool) -> L;
    /// sum + spring (p + q s) |ξ| M, with spring = c ω̃ β V′/|ξ|.
    fn pull<L: Lane>(bond: &Bond<D, L>, eta: [L; D], strain: L, p: L, q: L, small: bool, sum: [L; D]) -> [L; D];
    /// s at η, and how much that changes with η by Δη, to first order.
    fn change(&self, bond: &Bond<D, f64>, eta: &[f64; D], change: &[f64; D]) -> [f64; 2];
}

impl<const D: usize> Stretch<D> for BondBased {
    #[inline(always)]
    fn stretch<L: Lane>(strain: L, small: bool) -> L {
        let one = L::splat(1.0);
        if small { strain * polynomial(STRETCH, strain) } else { strain / (one + (one + strain).sqrt()) }
    }

    /// With g = s |ξ|/|y| = 1 − |ξ|/|y|, |ξ| M = (1 − g) y.
    #[inline(always)]
    fn pull<L: Lane>(bond: &Bond<D, L>, eta: [L; D], strain: L, p: L, q: L, small: bool, mut sum: [L; D]) -> [L; D] {
        let g = if small {
            strain * polynomial(FORCE, strain)
        } else {
            let square = L::splat(1.0) + strain;
            strain / (square + square.sqrt())
        };
        let factor = bond.spring * (q - p).mul_add(g, p);
        for d in 0..D {
            sum[d] = factor.mul_add(bond.xi[d] + eta[d], sum[d]);
        }
        sum
    }

    fn change(&self, bond: &Bond<D, f64>, eta: &[f64; D], change: &[f64; D]) -> [f64; 2] {
        let strain = self.strain(bond, eta);
        let stretch = <Self as Stretch<D>>::stretch(strain, false);
        let y: [f64; D] = std::array::from_fn(|d| bond.xi[d] + eta[d]);
        [stretch, dot(&y, change) * bond.inverse_square / (1.0 + stretch)]
    }
}

impl<const D: usize> Stretch<D> for BondBasedLinear {
    #[inline(always)]
    fn stretch<L: Lane>(strain: L, _small: bool) -> L {
        strain
    }

    #[inline(always)]
    fn pull<L: Lane>(bond: &Bond<D, L>, _: [L; D], strain: L, p: L, q: L, _small: bool, mut sum: [L; D]) -> [L; D] {
        let factor = bond.spring * q.mul_add(strain, p);
        for d in 0..D {
            sum[d] = factor.mul_add(bond.xi[d], sum[d]);
        }
        sum
    }

    fn change(&self, bond: &Bond<D, f64>, eta: &[f64; D], change: &[f64; D]) -> [f64; 2] {
        [self.strain(bond, eta), self.strain(bond, change)]
    }
}

/// Σ c ω̃ |ξ| β V′
struct Moment;

impl<const D: usize> BondKernel<D, 0, 1> for Moment {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: L, [sum]: [L; 1]) -> [L; 1] {
        [bond.weight.mul_add(bond.length, sum)]
    }
}

/// Σ c ω̃ |ξ| s β V′
struct Extension<B>(B);

impl<const D: usize, B: Stretch<D>> BondKernel<D, D, 1> for Extension<B> {
    const SMALL: f64 = B::SMALL;

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        self.0.strain(bond, eta)
    }
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; D], strain: L, [sum]: [L; 1]) -> [L; 1] {
        [(bond.weight * bond.length).mul_add(B::stretch(strain, false), sum)]
    }
    #[inline(always)]
    fn add_small<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; D], strain: L, [sum]: [L; 1]) -> [L; 1] {
        [(bond.weight * bond.length).mul_add(B::stretch(strain, true), sum)]
    }
}

/// The force, from η, p + p′ and q + q′.
struct Pull<B>(B);

impl<const D: usize, const I: usize, B: Stretch<D>> BondKernel<D, I, D> for Pull<B> {
    const SMALL: f64 = B::SMALL;
    const ADDED: usize = 2;

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, relative: &[L; I]) -> L {
        self.0.strain(bond, &first(relative))
    }
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, relative: &[L; I], strain: L, sum: [L; D]) -> [L; D] {
        B::pull(bond, first(relative), strain, relative[D], relative[D + 1], false, sum)
    }
    #[inline(always)]
    fn add_small<L: Lane>(&self, bond: &Bond<D, L>, relative: &[L; I], strain: L, sum: [L; D]) -> [L; D] {
        B::pull(bond, first(relative), strain, relative[D], relative[D + 1], true, sum)
    }
}

/// η
#[inline(always)]
#[allow(clippy::manual_memcpy)] // a plain loop is inlined into every set of instructions
fn first<const D: usize, const I: usize, L: Lane>(values: &[L; I]) -> [L; D] {
    let mut eta = [L::splat(0.0); D];
    for d in 0..D {
        eta[d] = values[d];
    }
    eta
}

/// Σ k x, Σ k |ξ| x and Σ k ξ (zeros behind), with x a value of both ends added and k = c ω̃ β V′/|ξ|.
struct Row;

impl<const D: usize> BondKernel<D, 1, 5> for Row {
    const RELATIVE: bool = false;
    const ADDED: usize = 1;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, [x]: &[L; 1], _: L, mut sum: [L; 5]) -> [L; 5] {
        sum[0] = bond.spring.mul_add(*x, sum[0]);
        sum[1] = bond.weight.mul_add(*x, sum[1]);
        for d in 0..D {
            sum[d + 2] = bond.spring.mul_add(bond.xi[d], sum[d + 2]);
        }
        sum
    }
}

/// Σ k (q + q′) ξ_d²/|ξ|²
struct Diagonal;

impl<const D: usize> BondKernel<D, 1, D> for Diagonal {
    const ADDED: usize = 1;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, [q]: &[L; 1], _: L, mut sum: [L; D]) -> [L; D] {
        let spring = bond.spring * bond.inverse_square * *q;
        for d in 0..D {
            sum[d] = (bond.xi[d] * bond.xi[d]).mul_add(spring, sum[d]);
        }
        sum
    }
}

/// The critical stretch, and a list of what broke.
struct Breaking<'a, const D: usize, B> {
    failure: &'a CriticalStretch,
    law: B,
    displacement: [&'a [f64]; D],
    velocity: [&'a [f64]; D],
    dt: f64,
    hybrid: Option<&'a Edge<'a>>,
    lost: Mutex<Vec<Lost>>,
}

impl<'a, const D: usize, B> Breaking<'a, D, B> {
    fn new(
        law: B,
        failure: &'a CriticalStretch,
        [displacement, velocity]: [[&'a [f64]; D]; 2],
        dt: f64,
        hybrid: Option<&'a Edge<'a>>,
    ) -> Self {
        Breaking { failure, law, displacement, velocity, dt, hybrid, lost: Mutex::default() }
    }
}

impl<const D: usize, B: Stretch<D>> BreakRule<D> for Breaking<'_, D, B> {
    fn threshold(&self) -> f64 {
        self.law.strain_at(self.failure.smallest())
    }

    fn breaks(&self, here: usize, there: usize, strain: f64) -> bool {
        strain > self.law.strain_at(self.failure.of(here, there))
            && self.hybrid.is_none_or(|edge| edge.may_break(here, there))
    }

    /// Nothing yet: what a bond takes depends on all that its ends have lost, [`StateBased::released`].
    fn released(&self, bond: &Bond<D, f64>, here: usize, there: usize) -> f64 {
        let difference = |f: &[&[f64]; D], d: usize| f[d][there] - f[d][here];
        let change: [f64; D] = std::array::from_fn(|d| self.dt * difference(&self.velocity, d));
        let start: [f64; D] = std::array::from_fn(|d| difference(&self.displacement, d) - change[d]);
        let [stretch, grown] = self.law.change(bond, &start, &change);
        let weight = bond.weight * bond.length;
        let [start, end] = [stretch, stretch + grown].map(|s| weight * s);
        let lost = Lost { here: here as u32, there: there as u32, start, end, square: stretch * end };
        self.lost.lock().expect("no thread has panicked").push(lost);
        0.0
    }
}
