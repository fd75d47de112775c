//! One bond, and what may be computed along it.

use crate::lane::Lane;

/// A bond as a law sees it: a view made inside the loops, on one bond or on several side by side.
#[derive(Debug, Clone, Copy)]
pub struct Bond<const D: usize, L> {
    /// ξ = x′ − x, m.
    pub xi: [L; D],
    /// |ξ|, m.
    pub length: L,
    /// 1/|ξ|², 1/m².
    pub inverse_square: L,
    /// The quadrature weight that the discretisation gives the bond: strength × ω × β × V′.
    pub weight: L,
    /// weight/|ξ|
    pub spring: L,
    /// weight × |ξ|
    pub moment: L,
    /// What the law has noted of this bond, see [`BondLaw::MEMORY`]; zero where it notes nothing.
    pub memory: L,
}

impl<const D: usize> Bond<D, f64> {
    /// One bond, from ξ (m), |ξ| (m) and its weight.
    pub fn new(xi: [f64; D], length: f64, weight: f64) -> Self {
        let [inverse_square, spring, moment] = [1.0 / (length * length), weight / length, weight * length];
        Bond { xi, length, inverse_square, weight, spring, moment, memory: 0.0 }
    }
}

/// A formula along a bond, summed over families by `execution`: the force of a law, its energy, a dilatation.
///
/// `I` values are known at the two ends by their difference (displacement), `A` by their sum (what an earlier pass has left
/// there), and `O` are summed. The summand is linear in the weight of the bond, so that whatever scales a weight (volumes,
/// surfaces, interfaces) scales the bond.
/// A kernel allocates nothing and indexes nothing; it is the same source for one bond and for many side by side, in
/// double and in single precision.
pub trait BondKernel<const D: usize, const I: usize, const O: usize, const A: usize = 0>: Sync {
    /// |strain| up to which [`BondKernel::add_small`] may stand for [`BondKernel::add`].
    const SMALL: f64 = f64::INFINITY;
    /// Whether there are two forms: where there is one, the other is not compiled.
    const TWO_FORMS: bool = Self::SMALL < f64::INFINITY;
    /// Whether it is summed in every step: then it is compiled for every set of instructions, and for plain weights apart.
    /// What is summed now and then gets along without, with the same bits.
    const EVERY_STEP: bool = false;
    /// Of a sum in every step: whether bodies of several materials may be asked for it, for which its weights are looked up
    /// point by point where materials meet.
    const VARIED: bool = false;
    /// Whether the summand is linear in the relative values and the same along −ξ as along ξ.
    const LINEAR: bool = false;
    /// Whether the summand is zero where the ends have the same values. Broken bonds are given as such, which saves
    /// a mask; the summands of other kernels are masked.
    const RELATIVE: bool = true;
    /// Whether a number of each bond is kept from step to step.
    const MEMORY: bool = false;

    /// That number at the strain that the bond has now, from what it was (in `bond`): zero at the start. Again at the same
    /// strain it must stay what it is.
    #[inline(always)]
    fn remember<L: Lane>(&self, bond: &Bond<D, L>, _strain: L) -> L {
        bond.memory
    }

    /// What decides about breaking and about the form: computed once, whichever form follows. `relative`: values at
    /// x′ less values at x. Nothing, unless the kernel says otherwise.
    #[inline(always)]
    fn strain<L: Lane>(&self, _bond: &Bond<D, L>, _relative: &[L; I]) -> L {
        L::splat(0.0)
    }

    /// `sum` and the summand of x, exactly. `added`: values at x′ and x added; zero along a broken bond.
    fn add<L: Lane>(&self, bond: &Bond<D, L>, relative: &[L; I], added: &[L; A], strain: L, sum: [L; O]) -> [L; O];

    /// `sum` and the summand of x where |strain| ≤ `SMALL`, to the precision of the numbers.
    #[inline(always)]
    fn add_small<L: Lane>(
        &self,
        bond: &Bond<D, L>,
        relative: &[L; I],
        added: &[L; A],
        strain: L,
        sum: [L; O],
    ) -> [L; O] {
        self.add(bond, relative, added, strain, sum)
    }
}

/// A bond law of elasticity: what a bond does when its ends move apart. η = u′ − u, m.
///
/// At rest its spring constant, the derivative of the force along ξ by η along ξ, is weight/|ξ|: that is what makes the
/// strength in the weight a micromodulus. Everything is linear in the weight.
pub trait BondLaw<const D: usize>: Copy + Send + Sync + 'static {
    /// |strain| up to which the small forms serve; infinite where there is one form only.
    const SMALL: f64 = f64::INFINITY;
    /// Whether the force is linear in η.
    const LINEAR: bool = false;

    /// Whether the law keeps a number of each bond, such as the largest strain that it has had: it is then `bond.memory`
    /// of whatever the law is asked.
    const MEMORY: bool = false;

    /// That number at the strain that the bond has now, from what it was: zero at the start. Again at the same strain it
    /// must stay what it is; and the same from both ends.
    #[inline(always)]
    fn remember<L: Lane>(&self, bond: &Bond<D, L>, _strain: L) -> L {
        bond.memory
    }
    /// How far the bond is strained, in the measure of this law: grows with the stretch, without rounding of its own
    /// where η is small. A bond breaks when this passes [`BondLaw::strain_at`] its critical stretch.
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L;
    /// The strain of a bond at stretch s.
    fn strain_at(&self, stretch: f64) -> f64;
    /// The stretch of a bond at a strain: the inverse of [`BondLaw::strain_at`].
    fn stretch_at(&self, strain: f64) -> f64;
    /// `sum` and the force density on x from x′ (N/m³ in 3D, weighted).
    fn force<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], strain: L, sum: [L; D]) -> [L; D];
    /// Elastic energy density of the bond, weighted: half of it belongs to each end.
    fn energy<L: Lane>(&self, bond: &Bond<D, L>, strain: L) -> L;
    /// [`BondLaw::force`] where |strain| ≤ `SMALL`, to the precision of the numbers.
    #[inline(always)]
    fn small_force<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], strain: L, sum: [L; D]) -> [L; D] {
        self.force(bond, eta, strain, sum)
    }
    /// [`BondLaw::energy`] where |strain| ≤ `SMALL`, to the precision of the numbers.
    #[inline(always)]
    fn small_energy<L: Lane>(&self, bond: &Bond<D, L>, strain: L) -> L {
        self.energy(bond, strain)
    }
    /// ∂force/∂η, exactly: row by row the change of each component of the force, weighted.
    fn stiffness(&self, bond: &Bond<D, f64>, eta: &[f64; D]) -> [[f64; D]; D];
}
