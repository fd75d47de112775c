//! The laws, a file each, and the one list of them.
//!
//! A law is a file with a type that implements [`BondLaw`], and a line in the list below: its name in a case, what it is
//! made into, and the type in that file. The case language, `list`, the documentation, tests and benches follow the list.

use super::bonds::Bonds;
use super::linear_solid::{LinearSolid, Moduli};
use super::material::Material;
use crate::discretization::BondWeights;
use crate::execution::Packs;
use crate::family::{Body, Bond, BondLaw};
use crate::lane::Lane;

/// Calls a macro with the list of laws.
///
/// `bonds`: a material of these bonds alone; `solid`: a state-based solid with the stretches of this law.
macro_rules! each_law {
    ($with:ident) => {
        $with! {
            /// Bond-based, with large displacements (prototype microelastic brittle).
            BondBased "bond_based" bonds bond_based::BondBased,
            /// Bond-based, linearised: small displacements and rotations only.
            BondBasedLinear "bond_based_linear" bonds bond_based_linear::BondBasedLinear,
            /// State-based, with large displacements (linear peridynamic solid): any Poisson ratio.
            StateBased "state_based" solid bond_based::BondBased,
            /// State-based, linearised: small displacements and rotations only.
            StateBasedLinear "state_based_linear" solid bond_based_linear::BondBasedLinear,
        }
    };
}
pub(crate) use each_law;

pub mod bond_based;
pub mod bond_based_linear;

pub use bond_based::BondBased;
pub use bond_based_linear::BondBasedLinear;

macro_rules! define {
    ($($(#[doc = $about:literal])* $name:ident $key:literal $kind:ident $module:ident::$law:ident,)*) => {
        /// A law of elasticity, by its name in the list.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Law {
            $($(#[doc = $about])* $name,)*
        }

        impl Law {
            /// All of them.
            pub const ALL: &[Law] = &[$(Law::$name),*];

            /// In a case.
            pub fn name(self) -> &'static str {
                match self { $(Law::$name => $key,)* }
            }

            /// Whether it is a state-based solid, which has a Poisson ratio of its own.
            pub fn is_state_based(self) -> bool {
                match self { $(Law::$name => define!(@solid $kind),)* }
            }

            /// Whether forces are linear in displacements.
            pub fn is_linear(self) -> bool {
                match self { $(Law::$name => <$module::$law as BondLaw<1>>::LINEAR,)* }
            }

            /// Shows each law that is a material of bonds alone, with its name in the list.
            pub fn visit_bonds<const D: usize>(visitor: &mut impl LawVisitor<D>) {
                $(define!(@visit $kind $name $module $law visitor);)*
            }

            /// The bonds of the law.
            pub fn bonds<const D: usize, P: Packs>(self) -> Box<dyn Material<D, P>> {
                match self { $(Law::$name => Box::new(Bonds::new($module::$law)),)* }
            }

            /// The material on a body. `moduli`: of a state-based solid, one for all slots or one for each; `weights`: strength ×
            /// ω × β × V′.
            pub fn material<const D: usize, P: Packs>(
                self,
                moduli: &[Moduli],
                body: &Body<D>,
                weights: &BondWeights,
            ) -> Box<dyn Material<D, P>> {
                match self { $(Law::$name => define!(@$kind $module $law moduli body weights),)* }
            }
        }
    };
    (@visit bonds $name:ident $module:ident $law:ident $visitor:ident) => {
        $visitor.visit(Law::$name, $module::$law)
    };
    (@visit solid $name:ident $module:ident $law:ident $visitor:ident) => {};
    (@solid solid) => { true };
    (@solid bonds) => { false };
    (@solid $module:ident $law:ident $moduli:ident $body:ident $weights:ident) => {
        Box::new(LinearSolid::new($module::$law, $moduli, $body, $weights))
    };
    (@bonds $module:ident $law:ident $moduli:ident $body:ident $weights:ident) => {
        Box::new(Bonds::new($module::$law))
    };
}
each_law!(define);

/// Is shown laws by their types, which a list cannot hold.
pub trait LawVisitor<const D: usize> {
    fn visit<B: BondLaw<D>>(&mut self, name: Law, law: B);
}

/// ½ ω c s² |ξ|, without s², which single precision may not hold.
#[inline(always)]
pub(super) fn spring_energy<const D: usize, L: Lane>(bond: &Bond<D, L>, stretch: L) -> L {
    L::splat(0.5) * bond.weight * bond.length * stretch * stretch
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Force and energy of one bond, in both forms: `small` picks the second.
    pub(super) fn response<const D: usize>(
        law: impl BondLaw<D>,
        bond: &Bond<D, f64>,
        eta: [f64; D],
        small: bool,
    ) -> ([f64; D], f64) {
        let strain = law.strain(bond, &eta);
        if small {
            (law.small_force(bond, &eta, strain, [0.0; D]), law.small_energy(bond, strain))
        } else {
            (law.force(bond, &eta, strain, [0.0; D]), law.energy(bond, strain))
        }
    }

    #[test]
    fn force_is_the_derivative_of_energy_and_strain_keeps_its_digits() {
        fn check(law: impl BondLaw<3>, eta: [f64; 3], small: bool) {
            let bond = Bond::new([3.0e-3, -1.0e-3, 2.0e-3], 14f64.sqrt() * 1e-3, 7.0);
            let (force, _) = response(law, &bond, eta, small);
            for d in 0..3 {
                let h = 1e-9;
                let (mut plus, mut minus) = (eta, eta);
                plus[d] += h;
                minus[d] -= h;
                let energy = |eta| response(law, &bond, eta, small).1;
                let slope = (energy(plus) - energy(minus)) / (2.0 * h);
                // Truncation h²/|ξ|² ≈ 1e-13 and round-off 1e-16 |ξ|/h ≈ 4e-10 of the difference quotient.
                assert!((slope - force[d]).abs() < 1e-8 * force[0].abs(), "{d}: {slope} {}", force[d]);
            }
            let tiny = bond.xi.map(|x| 1e-14 * x);
            assert!((law.strain(&bond, &tiny) / law.strain_at(1e-14) - 1.0).abs() < 1e-12);
        }
        check(BondBased, [2.0e-4, 5.0e-5, -1.0e-4], false);
        check(BondBased, [1.0e-5, 5.0e-6, -4.0e-6], true);
        check(BondBasedLinear, [2.0e-4, 5.0e-5, -1.0e-4], false);
    }
}
