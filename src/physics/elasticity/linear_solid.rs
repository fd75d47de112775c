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

mod moduli;

use std::sync::Mutex;

pub use moduli::Moduli;

use super::State;
use super::bond_forces::{BondForce, BondForces};
use super::breaking::Breaking;
use super::density::Density;
use super::kernels::Energy;
use super::laws::bond_based::{FORCE_SINGLE, STRETCH_SINGLE};
use super::laws::{BondBased, BondBasedLinear};
use super::material::{Material, On, RowBoundary};
use super::stretched::most_stretched;
use super::surface::{Shares, shares_of_solid};
use crate::discretization::{BondWeighting, BondWeights};
use crate::execution::{BreakRule, Exec, Packs};
use crate::family::{Body, Bond, BondKernel, BondLaw, BondStates};
use crate::field::{Double, Number, components, components_mut, dot};
use crate::geometry::Arrangement;
use crate::geometry::lattice::BLOCK;
use crate::lane::{Lane, polynomial};
use crate::parallel;
use crate::physics::failure::CriticalStretch;
use crate::visit::Visitor;

/// A state-based solid on one body, with the stretches of the law `L`.
#[derive(Debug, Clone)]
pub struct LinearSolid<L, F: Number> {
    law: L,
    /// One for all slots, or one for each.
    moduli: Vec<Moduli>,
    /// q by slot.
    stiffness: Vec<f64>,
    /// h by slot, 1/Pa.
    bulk: Vec<f64>,
    /// q where fields are of single precision, else empty.
    single: Vec<f32>,
    /// The bound of the largest eigenvalue, N/m⁴ in 3D, and how many times that of bonds without dilatation it is.
    bound: [f64; 2],
    /// p now and one evaluation before, by slot.
    dilatation_force: [Vec<F>; 2],
}

impl<L, F: Number> LinearSolid<L, F> {
    /// With c = [`Moduli::strength`], of any of the moduli where there are several: it cancels. `moduli`: one for all slots, or
    /// one for each; each end of a bond then pulls with its own. `weights` are the c ω̃ β V′ of the body.
    pub fn new<const D: usize>(law: L, moduli: &[Moduli], body: &Body<D>, weights: &BondWeights) -> Self {
        let (mut exec, whole, n) = (Exec::default(), BondStates::whole(body), body.cloud.n_slots());
        let mut stiffness = vec![0.0; n];
        exec.sum_bonds::<D, 0, 1, Double>(body, weights, &whole, [], [&mut stiffness], &Moment);
        // Images have the families of their sources.
        if let Some(images) = &body.cloud.images {
            images.copy(&mut stiffness);
        }
        // A point without a family has neither.
        let over = |numerator: f64, moment: f64| if moment > 0.0 { numerator / moment } else { 0.0 };
        let of = |slot: usize| moduli[slot.min(moduli.len() - 1)];
        let bulk = stiffness.iter().enumerate().map(|(slot, &m)| over(of(slot).volumetric, m * m)).collect::<Vec<_>>();
        stiffness.iter_mut().enumerate().for_each(|(slot, m)| *m = over(of(slot).deviatoric, *m));
        let bound = bound(body, weights, &stiffness, &bulk);
        let rounded = F::NEGLIGIBLE > f64::NEGLIGIBLE;
        let single = if rounded { stiffness.iter().map(|&q| q as f32).collect() } else { Vec::new() };
        LinearSolid {
            law,
            moduli: moduli.to_vec(),
            stiffness,
            bulk,
            single,
            bound,
            dilatation_force: Default::default(),
        }
    }

    /// Of the point in a slot.
    fn moduli(&self, slot: usize) -> &Moduli {
        self.moduli.get(slot).unwrap_or(&self.moduli[0])
    }

    /// S by slot.
    fn sum<const D: usize, P: Packs>(
        &self,
        on: &mut On<'_, D>,
        states: &BondStates,
        u: [&[P::Field]; D],
        sums: &mut [P::Field],
    ) where
        L: Stretch<D>,
    {
        let kernel = Extension(self.law);
        on.exec.sum_bonds::<D, D, 1, P>(on.body, &on.operator.weights, states, u, [sums], &kernel);
    }

    /// S → p = h S
    fn scale<T: Number>(&self, sums: &mut [T]) {
        let bulk = &self.bulk;
        parallel::fill(sums, 4096, &|first, sums| {
            sums.iter_mut().zip(&bulk[first..]).for_each(|(s, h)| *s = T::from_f64(s.to_f64() * h));
        });
    }

    /// f from u, p and q.
    fn pull<const D: usize, P: Packs>(
        &self,
        on: &mut On<'_, D>,
        states: &BondStates,
        u: [&[P::Field]; D],
        p: &[P::Field],
        force: [&mut [P::Field]; D],
    ) where
        L: Stretch<D>,
    {
        let q = P::Field::choose(&self.stiffness, &self.single);
        let (weights, kernel) = (&on.operator.weights, Pull(self.law));
        on.exec.sum_bonds_adding::<D, D, 2, D, P>(on.body, weights, states, u, [p, q], force, &kernel);
    }

    /// θ by slot: D S/M.
    pub fn dilatation<const D: usize>(&self, on: &mut On<'_, D>, states: &BondStates, u: [&[f64]; D]) -> Vec<f64>
    where
        L: Stretch<D>,
    {
        let mut sums = vec![0.0; on.body.cloud.n_slots()];
        self.sum::<D, Double>(on, states, u, &mut sums);
        for (slot, (s, q)) in sums.iter_mut().zip(&self.stiffness).enumerate() {
            *s *= D as f64 / self.moduli(slot).deviatoric * q;
        }
        sums
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
    fn released<const D: usize>(&self, body: &Body<D>, mut lost: Vec<Lost>, before: Option<&[F]>, now: &[F]) -> f64 {
        // Threads have added them in any order.
        lost.sort_unstable_by_key(|bond| (bond.here, bond.there));
        let at = |bonds: &[Lost]| {
            let slot = bonds[0].here as usize;
            let [start, end, square] =
                bonds.iter().fold([0.0; 3], |[a, b, c], bond| [a + bond.start, b + bond.end, c + bond.square]);
            let now = now[slot].to_f64();
            let p = before.map_or(now + self.bulk[slot] * start, |before| before[slot].to_f64());
            let density = 0.5 * (p * end + start * now + self.stiffness[slot] * square);
            density * body.cloud.volume(slot)
        };
        lost.chunk_by(|a, b| a.here == b.here).map(at).sum()
    }
}

impl<const D: usize, L: Stretch<D>, P: Packs> Material<D, P> for LinearSolid<L, P::Field> {
    fn is_linear(&self) -> bool {
        L::LINEAR
    }

    /// √(4/λ), with a bound λ of the spectral radius of the operator over ρ: its norm of the
    /// largest row sum. The bonds alone give 2 Σ k (q + q′), k = c ω̃ β V′/|ξ|, because |s ξ| ≤ |η|. What is volumetric gives
    ///
    /// ```text
    /// Σ (c ω̃ β V′) P′ + C P,   P = h (N + C),   N = Σ c ω̃ β V′,   C = |Σ c ω̃ ξ/|ξ| β V′|
    /// ```
    ///
    /// because |S| ≤ (N + C) max |u|; and nothing where h < 0, since it then takes from an energy that stays positive.
    /// N + C of a family that has lost bonds is no more than before.
    fn stable_step(&self, on: &mut On<'_, D>, density: &Density<P::Field>) -> f64 {
        let softest = if density.is_same() {
            density.unit / self.bound[0]
        } else {
            density.least_over(&row_sums(on.body, &on.operator.weights, &self.stiffness, &self.bulk)[0])
        };
        (4.0 * softest).sqrt()
    }

    fn begin(&mut self) {
        self.dilatation_force.swap(0, 1);
    }

    /// S, and p of it.
    fn first_pass(
        &mut self,
        on: &mut On<'_, D>,
        state: &mut State<P>,
        step: Option<f64>,
        edge: Option<&RowBoundary<'_, D>>,
    ) {
        let [u, v] = [&state.displacement, &state.velocity].map(|flat| components::<D, _>(flat));
        let n = on.body.cloud.n_slots();
        let [mut now, mut before] = std::mem::take(&mut self.dilatation_force);
        [&mut now, &mut before].into_iter().for_each(|p| p.resize(n, P::Field::default()));
        let (mut lost, dt) = (Vec::new(), step.unwrap_or(0.0));
        match on.failure.filter(|_| step.is_some()) {
            None => self.sum::<D, P>(on, &state.states, u, &mut now),
            Some(failure) => {
                let breaking = Breaking { failure, law: self.law, displacement: u, velocity: v, dt, edge };
                let rule = Listing { breaking, lost: Mutex::default() };
                let (weights, kernel, states) = (&on.operator.weights, Extension(self.law), &mut state.states);
                let broken =
                    on.exec.sum_bonds_and_break::<D, D, 1, P>(on.body, weights, states, u, [&mut now], &kernel, &rule);
                lost = rule.lost.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
                state.broken.bonds += broken.bonds;
            }
        }
        match (edge, &on.body.cloud.arrangement) {
            // The others keep what their rows have given.
            (Some(edge), Arrangement::Lattice(lattice)) => {
                for &block in &edge.regions.standard {
                    let slots = lattice.guard + block as usize * BLOCK..lattice.guard + (block as usize + 1) * BLOCK;
                    let sums = now[slots.clone()].iter_mut().zip(&self.bulk[slots]);
                    sums.for_each(|(s, h)| *s = P::Field::from_f64(s.to_f64() * h));
                }
            }
            _ => self.scale(&mut now),
        }
        state.broken.energy += self.released(on.body, lost, (dt != 0.0).then_some(&before[..]), &now);
        self.dilatation_force = [now, before];
    }

    fn second_pass(&mut self, on: &mut On<'_, D>, state: &mut State<P>) {
        // Dilatation is a scalar; those of images are known when those of all points are.
        if let Some(images) = &on.body.cloud.images {
            images.fill_scalar(&mut self.dilatation_force[0]);
        }
        let State { displacement, force, states, .. } = state;
        let (u, force) = (components::<D, _>(displacement), components_mut::<D, _>(force));
        self.pull::<D, P>(on, states, u, &self.dilatation_force[0], force);
    }

    fn relative_stiffness(&self, _: &BondWeights, slot: usize) -> f64 {
        self.moduli(slot).deviatoric / self.moduli[0].deviatoric
    }

    fn dilatation_force(&mut self) -> Option<&mut Vec<P::Field>> {
        Some(&mut self.dilatation_force[0])
    }

    fn dilatation_scales(&self, slot: usize) -> Option<[f64; 2]> {
        Some([self.stiffness[slot], self.bulk[slot]])
    }

    fn force_in_double(&self, on: &mut On<'_, D>, states: &BondStates, u: [&[f64]; D], force: [&mut [f64]; D]) {
        let mut p = vec![0.0; on.body.cloud.n_slots()];
        self.sum::<D, Double>(on, states, u, &mut p);
        self.scale(&mut p);
        if let Some(images) = &on.body.cloud.images {
            images.fill_scalar(&mut p);
        }
        self.pull::<D, Double>(on, states, u, &p, force);
    }

    fn energy_density(&self, on: &mut On<'_, D>, states: &BondStates, u: [&[P::Field]; D], density: &mut [P::Field]) {
        let mut sums = vec![P::Field::default(); density.len()];
        self.sum::<D, P>(on, states, u, &mut sums);
        // ½ Σ of the energies of bonds, ½ c ω̃ |ξ| s² β V′ each.
        on.exec.sum_bonds::<D, D, 1, P>(on.body, &on.operator.weights, states, u, [density], &Energy(self.law));
        for (slot, (w, s)) in density.iter_mut().zip(sums).enumerate() {
            let s = s.to_f64();
            *w = P::Field::from_f64(2.0 * self.stiffness[slot] * w.to_f64() + 0.5 * self.bulk[slot] * s * s);
        }
    }

    /// Of the bonds, made larger by as much as dilatation makes the bound of the largest eigenvalue larger: the masses of
    /// dynamic relaxation.
    fn diagonal(&self, on: &mut On<'_, D>, states: &BondStates, mut diagonal: [&mut [f64]; D]) {
        let output = diagonal.each_mut().map(|d| &mut **d);
        let (weights, q) = (&on.operator.weights, [&self.stiffness[..]]);
        on.exec.sum_bonds_adding::<D, 0, 1, D, Double>(on.body, weights, states, [], q, output, &Diagonal);
        diagonal.iter_mut().flat_map(|d| d.iter_mut()).for_each(|d| *d *= self.bound[1]);
    }

    fn energy_at(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &BondStates,
        u: [&[f64]; D],
        slot: usize,
    ) -> f64 {
        let parts = Exec::each_bond(body, weights, states, u, slot, |_, _, bond, eta| {
            let s = self.law.stretch_at(self.law.strain(&bond, &eta));
            [bond.weight * bond.length * s, bond.weight * bond.length * s * s]
        });
        let [sum, squares] = parts.iter().fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
        0.5 * (self.stiffness[slot] * squares + self.bulk[slot] * sum * sum)
    }

    /// T⟨ξ⟩ V′ = c ω̃ (p + q s) M β V′ with p and q of the point itself.
    fn bond_forces<'a>(
        &'a self,
        body: &'a Body<D>,
        weights: &'a BondWeights,
        states: &'a BondStates,
        u: [&'a [f64]; D],
    ) -> BondForces<'a, D> {
        let law = self.law;
        let mut p = vec![0.0; body.cloud.n_slots()];
        // Sums of its own: of points with a row too.
        let kernel = Extension(law);
        Exec::default().sum_bonds::<D, D, 1, Double>(body, weights, states, u, [&mut p], &kernel);
        self.scale(&mut p);
        if let Some(images) = &body.cloud.images {
            images.fill_scalar(&mut p);
        }
        let bonds = move |slot: usize| {
            let [p_here, q_here] = [p[slot], self.stiffness[slot]];
            Exec::each_bond(body, weights, states, u, slot, |_, there, bond, eta| {
                let strain = law.strain(&bond, &eta);
                let pull = |p, q| L::pull(&bond, &eta, strain, p, q, false, [0.0; D]);
                let (own, pair) = (pull(p_here, q_here), pull(p_here + p[there], q_here + self.stiffness[there]));
                BondForce { there, xi: bond.xi, eta, weight: bond.weight, own, pair, stretch: law.stretch_at(strain) }
            })
        };
        Box::new(bonds)
    }

    fn most_stretched(
        &self,
        body: &Body<D>,
        weights: &BondWeights,
        states: &mut BondStates,
        u: [&[P::Field]; D],
        failure: &CriticalStretch,
    ) -> Option<(f64, [usize; 2])> {
        most_stretched::<D, L, P>(self.law, body, weights, states, u, failure)
    }

    fn strain_ratio(&self, bond: &Bond<D, f64>, eta: &[f64; D], critical: f64) -> f64 {
        self.law.strain(bond, eta) / self.law.strain_at(critical)
    }

    fn shares(&self, on: &mut On<'_, D>, scaling: &BondWeighting) -> Shares {
        shares_of_solid(&self.moduli[0], on, scaling)
    }

    fn memory(&self) -> usize {
        2 * (size_of_val(&self.stiffness[..]) + size_of::<P::Field>() * self.stiffness.len())
            + size_of_val(&self.single[..])
    }

    fn visit(&mut self, visitor: &mut dyn Visitor) {
        let [now, before] = &mut self.dilatation_force;
        P::Field::visit(now, "dilatation_force", visitor);
        P::Field::visit(before, "dilatation_force_before", visitor);
    }
}

/// A bond that broke, seen from one end: c ω̃ |ξ| β V′ times s at the start of the step, at its end, and their product.
struct Lost {
    here: u32,
    there: u32,
    start: f64,
    end: f64,
    square: f64,
}

/// λ of [`Material::stable_step`], and λ over that of the bonds alone.
fn bound<const D: usize>(body: &Body<D>, weights: &BondWeights, stiffness: &[f64], bulk: &[f64]) -> [f64; 2] {
    let [with, without] = row_sums(body, weights, stiffness, bulk).map(|sums| sums.into_iter().fold(0.0, f64::max));
    [with, if without > 0.0 { with / without } else { 1.0 }]
}

/// Bounds of the sums of all |entries| of a row, by slot: with dilatation, and of the bonds alone.
fn row_sums<const D: usize>(body: &Body<D>, weights: &BondWeights, stiffness: &[f64], bulk: &[f64]) -> [Vec<f64>; 2] {
    let (n, whole, mut exec) = (body.cloud.n_slots(), BondStates::whole(body), Exec::default());
    let mut sums = |values: &[f64]| {
        let mut sums: [Vec<f64>; 5] = std::array::from_fn(|_| vec![0.0; n]);
        let output = sums.each_mut().map(|s| &mut s[..]);
        exec.sum_bonds_adding::<D, 0, 1, 5, Double>(body, weights, &whole, [], [values], output, &Row);
        sums
    };
    let [bonds, ..] = sums(stiffness);
    let [_, length, directions @ ..] = sums(&vec![0.5; n]);
    let lean: Vec<f64> = (0..n).map(|i| directions[..D].iter().map(|d| d[i] * d[i]).sum::<f64>().sqrt()).collect();
    let mut push: Vec<f64> = (0..n).map(|i| bulk[i].max(0.0) * (length[i] + lean[i])).collect();
    if let Some(images) = &body.cloud.images {
        images.copy(&mut push);
    }
    let [_, pushed, ..] = sums(&push);
    let with = (0..n).map(|i| 2.0 * bonds[i] + pushed[i] + push[i] * (lean[i] - length[i])).collect();
    [with, (0..n).map(|i| 2.0 * bonds[i]).collect()]
}

/// A bond law whose stretch a state-based solid uses.
pub trait Stretch<const D: usize>: BondLaw<D> {
    /// |strain| up to which the small forms of this trait serve.
    const RANGE: f64;
    /// s from the strain of the law; `small` as [`BondLaw::small_energy`].
    fn stretch<L: Lane>(strain: L, small: bool) -> L;
    /// sum + spring (p + q s) |ξ| M, with spring = c ω̃ β V′/|ξ|.
    fn pull<L: Lane>(bond: &Bond<D, L>, eta: &[L; D], strain: L, p: L, q: L, small: bool, sum: [L; D]) -> [L; D];
    /// s at η, and how much that changes with η by Δη, to first order.
    fn change(&self, bond: &Bond<D, f64>, eta: &[f64; D], change: &[f64; D]) -> [f64; 2];
}

/// (1 − 1/√(1 + q))/q on |q| ≤ 0.004, stretches of 0.2 %: interpolated at the zeros of the Chebyshev polynomial T₆, relative
/// error 1.1e-16. A range narrower than that of the bond-based law, for a term less in each of two passes.
const FORCE: [f64; 6] =
    [0.5, -0.375, 0.3124999999698353, -0.2734374999717206, 0.24609877742387448, -0.22559065071088388];
/// (√(1 + q) − 1)/q, as [`FORCE`]: relative error 8e-18.
const STRETCH: [f64; 6] =
    [0.5, -0.125, 0.06249999999767965, -0.039062499998114716, 0.02734413672346319, -0.020508126712990588];

impl<const D: usize> Stretch<D> for BondBased {
    const RANGE: f64 = 0.004;

    #[inline(always)]
    fn stretch<L: Lane>(strain: L, small: bool) -> L {
        let one = L::splat(1.0);
        match (small, L::SINGLE) {
            (true, false) => strain * polynomial(STRETCH, strain),
            (true, true) => strain * polynomial(STRETCH_SINGLE, strain),
            (false, _) => strain / (one + (one + strain).sqrt()),
        }
    }

    /// With g = s |ξ|/|y| = 1 − |ξ|/|y|, |ξ| M = (1 − g) y.
    #[inline(always)]
    fn pull<L: Lane>(bond: &Bond<D, L>, eta: &[L; D], strain: L, p: L, q: L, small: bool, mut sum: [L; D]) -> [L; D] {
        let g = match (small, L::SINGLE) {
            (true, false) => strain * polynomial(FORCE, strain),
            (true, true) => strain * polynomial(FORCE_SINGLE, strain),
            (false, _) => {
                let square = L::splat(1.0) + strain;
                strain / (square + square.sqrt())
            }
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
    const RANGE: f64 = f64::INFINITY;

    #[inline(always)]
    fn stretch<L: Lane>(strain: L, _small: bool) -> L {
        strain
    }

    #[inline(always)]
    fn pull<L: Lane>(bond: &Bond<D, L>, _: &[L; D], strain: L, p: L, q: L, _small: bool, mut sum: [L; D]) -> [L; D] {
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
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], _: &[L; 0], _: L, [sum]: [L; 1]) -> [L; 1] {
        [bond.weight.mul_add(bond.length, sum)]
    }
}

/// Σ c ω̃ |ξ| s β V′
struct Extension<B>(B);

impl<const D: usize, B: Stretch<D>> BondKernel<D, D, 1> for Extension<B> {
    const SMALL: f64 = B::RANGE;
    const EVERY_STEP: bool = true;

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        self.0.strain(bond, eta)
    }
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; D], _: &[L; 0], strain: L, [sum]: [L; 1]) -> [L; 1] {
        [bond.moment.mul_add(B::stretch(strain, false), sum)]
    }
    #[inline(always)]
    fn add_small<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; D], _: &[L; 0], strain: L, [sum]: [L; 1]) -> [L; 1] {
        [bond.moment.mul_add(B::stretch(strain, true), sum)]
    }
}

/// The force, from η, p + p′ and q + q′.
struct Pull<B>(B);

impl<const D: usize, B: Stretch<D>> BondKernel<D, D, D, 2> for Pull<B> {
    const SMALL: f64 = B::RANGE;
    const EVERY_STEP: bool = true;

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        self.0.strain(bond, eta)
    }
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], [p, q]: &[L; 2], strain: L, sum: [L; D]) -> [L; D] {
        B::pull(bond, eta, strain, *p, *q, false, sum)
    }
    #[inline(always)]
    fn add_small<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], [p, q]: &[L; 2], strain: L, sum: [L; D]) -> [L; D] {
        B::pull(bond, eta, strain, *p, *q, true, sum)
    }
}

/// Σ k x, Σ k |ξ| x and Σ k ξ (zeros behind), with x a value of both ends added and k = c ω̃ β V′/|ξ|.
struct Row;

impl<const D: usize> BondKernel<D, 0, 5, 1> for Row {
    const RELATIVE: bool = false;

    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], [x]: &[L; 1], _: L, mut sum: [L; 5]) -> [L; 5] {
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

impl<const D: usize> BondKernel<D, 0, D, 1> for Diagonal {
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; 0], [q]: &[L; 1], _: L, mut sum: [L; D]) -> [L; D] {
        let spring = bond.spring * bond.inverse_square * *q;
        for d in 0..D {
            sum[d] = (bond.xi[d] * bond.xi[d]).mul_add(spring, sum[d]);
        }
        sum
    }
}

/// What a step breaks, and a list of it.
struct Listing<'a, const D: usize, B, F> {
    breaking: Breaking<'a, D, B, F>,
    lost: Mutex<Vec<Lost>>,
}

impl<const D: usize, B: Stretch<D>, F: Number> BreakRule<D> for Listing<'_, D, B, F> {
    fn threshold(&self) -> f64 {
        self.breaking.threshold()
    }

    fn breaks(&self, here: usize, there: usize, strain: f64) -> bool {
        self.breaking.breaks(here, there, strain)
    }

    /// Nothing yet: what a bond takes depends on all that its ends have lost, [`LinearSolid::released`].
    fn released(&self, bond: &Bond<D, f64>, here: usize, there: usize) -> f64 {
        let [start, change] = self.breaking.step(here, there);
        let [stretch, grown] = self.breaking.law.change(bond, &start, &change);
        let weight = bond.weight * bond.length;
        let [start, end] = [stretch, stretch + grown].map(|s| weight * s);
        let lost = Lost { here: here as u32, there: there as u32, start, end, square: stretch * end };
        self.lost.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push(lost);
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_forms_are_the_exact_ones_to_rounding() {
        for k in (-1000..=1000).filter(|k| *k != 0) {
            let q = 4e-6 * f64::from(k);
            let root = (1.0 + q).sqrt();
            let [stretch, force] = [1.0 / (1.0 + root), 1.0 / (1.0 + q + root)];
            // Four roundings of each form, and 1.1e-16 of the polynomial.
            assert!((polynomial(STRETCH, q) / stretch - 1.0).abs() < 4.5 * f64::EPSILON, "{q}");
            assert!((polynomial(FORCE, q) / force - 1.0).abs() < 4.5 * f64::EPSILON, "{q}");
        }
    }
}
