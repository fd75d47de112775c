//! A law that keeps a number of each bond: bilinear softening, whose bonds unload to where they came from with the spring
//! that the largest stretch so far has left them. Nothing in the library is of this law; it is what a law with memory and
//! with cases needs: compare, select, remember.

use bondwise::discretization::{Influence, Operator, PartialVolume, standard};
use bondwise::execution::{Exec, Instructions, Packs};
use bondwise::family::{Body, Bond, BondLaw};
use bondwise::field::{Double, Mixed, Number, Precision, Single, components, components_mut};
use bondwise::geometry::{Cloud, Shape};
use bondwise::lane::Lane;
use bondwise::physics::Physics;
use bondwise::physics::elasticity::{Bonds, Elasticity};
use bondwise::visit::Visitor;

const SPACING: f64 = 1e-3;
/// Stretches at which a bond begins to soften, and where nothing is left.
const YIELD: f64 = 1e-3;
const END: f64 = 5e-3;

/// f = weight g(κ) s e, κ the largest stretch so far: g = 1 up to `YIELD`, then what makes the force fall in a straight line
/// to zero at `END`.
#[derive(Debug, Clone, Copy)]
struct Softening;

impl Softening {
    fn left<L: Lane>(memory: L) -> L {
        let [start, end] = [YIELD, END].map(L::splat);
        let falling = start * (end - memory) / (memory.or_larger(start) * (end - start));
        memory.select_above(start, falling.or_larger(L::splat(0.0)), L::splat(1.0))
    }
}

impl<const D: usize> BondLaw<D> for Softening {
    const MEMORY: bool = true;

    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        let mut along = eta[0] * bond.xi[0];
        for d in 1..D {
            along = eta[d].mul_add(bond.xi[d], along);
        }
        along * bond.inverse_square
    }
    fn strain_at(&self, stretch: f64) -> f64 {
        stretch
    }
    fn stretch_at(&self, strain: f64) -> f64 {
        strain
    }
    #[inline(always)]
    fn remember<L: Lane>(&self, bond: &Bond<D, L>, strain: L) -> L {
        bond.memory.or_larger(strain)
    }
    #[inline(always)]
    fn force<L: Lane>(&self, bond: &Bond<D, L>, _: &[L; D], strain: L, mut sum: [L; D]) -> [L; D] {
        let factor = bond.spring * Self::left(bond.memory) * strain;
        for d in 0..D {
            sum[d] = factor.mul_add(bond.xi[d], sum[d]);
        }
        sum
    }
    #[inline(always)]
    fn energy<L: Lane>(&self, bond: &Bond<D, L>, strain: L) -> L {
        L::splat(0.5) * bond.weight * bond.length * Self::left(bond.memory) * strain * strain
    }
    fn stiffness(&self, bond: &Bond<D, f64>, _: &[f64; D]) -> [[f64; D]; D] {
        let spring = bond.spring * bond.inverse_square * Self::left(bond.memory);
        std::array::from_fn(|c| std::array::from_fn(|d| spring * bond.xi[c] * bond.xi[d]))
    }
}

fn body<const D: usize>(scattered: bool) -> Body<D> {
    let high = std::array::from_fn(|d| [25.0, 12.0, 9.0][d] * SPACING);
    let mut cloud = Cloud::lattice(&Shape::Box { low: [0.0; D], high }, SPACING, 4);
    if scattered {
        cloud = cloud.scatter();
    }
    standard::body(cloud, 3.0 * SPACING, PartialVolume::Ramp)
}

fn specimen<const D: usize, P: Packs>(scattered: bool) -> Elasticity<D, P> {
    let body = body::<D>(scattered);
    let operator = Operator::standard(&body, 1.0, Influence::Linear, PartialVolume::Ramp);
    Elasticity::new(body, operator, Box::new(Bonds::new(Softening)), 1.0, None)
}

/// A field of displacements that strains some bonds beyond the yield and others not.
fn displace<const D: usize, P: Packs>(elasticity: &mut Elasticity<D, P>, size: f64) {
    let Elasticity { body, state, .. } = elasticity;
    for &slot in &body.cloud.slots {
        let x = body.cloud.position(slot as usize);
        for (d, u) in components_mut::<D, _>(&mut state.displacement).into_iter().enumerate() {
            let wave = (300.0 * x[0] + 170.0 * x[D - 1] + d as f64).sin();
            u[slot as usize] = P::Field::from_f64(size * (x[d] + SPACING * wave));
        }
    }
}

/// The plain form: the same sums bond by bond with a list of memories, and what the sizes of the terms add up to.
fn plain<const D: usize, P: Packs>(elasticity: &Elasticity<D, P>, memory: &mut [f64]) -> (Vec<[f64; D]>, Vec<f64>) {
    let Elasticity { body, state, operator, .. } = elasticity;
    let u = components::<D, _>(&state.displacement);
    let (mut forces, mut sizes) = (Vec::new(), Vec::new());
    for slot in body.cloud.slots.iter().map(|&slot| slot as usize) {
        let (mut force, mut size) = ([0.0; D], 0.0);
        for (bit, there) in body.bonds_of(slot).filter(|(bit, _)| state.states.holds(*bit)) {
            let xi = body.xi(bit, slot, there);
            let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
            let mut bond = Bond::new(xi, length, operator.weights.of(body, bit, [slot, there], &xi));
            let eta = std::array::from_fn(|d| u[d][there].to_f64() - u[d][slot].to_f64());
            let strain = Softening.strain(&bond, &eta);
            bond.memory = memory[bit];
            bond.memory = BondLaw::<D>::remember(&Softening, &bond, strain);
            memory[bit] = bond.memory;
            force = Softening.force(&bond, &eta, strain, force);
            size += bond.weight * strain.abs().max(1e-4);
        }
        forces.push(force);
        sizes.push(size);
    }
    (forces, sizes)
}

/// The largest difference to the plain form over a history of loads, over what its terms add up to.
fn difference<const D: usize, P: Packs>(scattered: bool, instructions: Instructions) -> f64 {
    let mut elasticity = specimen::<D, P>(scattered);
    elasticity.exec = Exec::on(instructions);
    let mut memory = vec![0.0; 16 * elasticity.body.n_words()];
    let mut worst = 0.0f64;
    // Up beyond the yield, down, up again, further, and to rest.
    for size in [5e-4, 2e-3, 1e-3, -1e-3, 2e-3, 4e-3, 1e-3] {
        displace(&mut elasticity, size);
        elasticity.evolve(0.0);
        let (forces, sizes) = plain(&elasticity, &mut memory);
        let found = components::<D, _>(&elasticity.state.force);
        for ((&slot, force), size) in elasticity.body.cloud.slots.iter().zip(forces).zip(sizes) {
            for d in 0..D {
                worst = worst.max((found[d][slot as usize].to_f64() - force[d]).abs() / size);
            }
        }
    }
    worst
}

#[test]
fn memories_are_those_of_the_plain_form_in_every_precision_on_every_path() {
    fn check<P: Packs>() {
        // Some tens of roundings of bonds; the strain of single fields is known to 1e-7 of |u|/|ξ|, a few times itself.
        let tolerance = if size_of::<<P as Precision>::Bond>() == 4 { 3e-5 } else { 1e-13 };
        for instructions in Instructions::available() {
            for scattered in [false, true] {
                let found = [
                    difference::<1, P>(scattered, instructions),
                    difference::<2, P>(scattered, instructions),
                    difference::<3, P>(scattered, instructions),
                ];
                assert!(found.iter().all(|x| *x < tolerance), "{} {instructions:?} {scattered}: {found:?}", P::NAME);
            }
        }
    }
    check::<Double>();
    check::<Single>();
    check::<Mixed>();
}

#[test]
fn bonds_unload_along_what_is_left_and_an_evaluation_remembers_nothing() {
    let mut elasticity = specimen::<2, Double>(false);
    let energy = |elasticity: &mut Elasticity<2>| elasticity.energy_density().iter().sum::<f64>();
    let fresh = |size: f64| {
        let mut other = specimen::<2, Double>(false);
        displace(&mut other, size);
        other.evolve(0.0);
        other
    };
    displace(&mut elasticity, 1e-3);
    elasticity.evolve(0.0);
    let before = elasticity.state.force.clone();
    // To look at a larger strain is not to go there.
    displace(&mut elasticity, 4e-3);
    elasticity.evaluate();
    assert_eq!(elasticity.state.force, fresh(4e-3).state.force);
    displace(&mut elasticity, 1e-3);
    elasticity.evaluate();
    assert_eq!(elasticity.state.force, before);
    // To have been there is.
    displace(&mut elasticity, 4e-3);
    elasticity.evolve(0.0);
    displace(&mut elasticity, 1e-3);
    elasticity.evolve(0.0);
    let (kept, whole) = (energy(&mut elasticity), energy(&mut fresh(1e-3)));
    assert!(kept < 0.5 * whole, "{kept:e} {whole:e}");
}

/// Sums what it is shown.
#[derive(Default)]
struct Sizes(Vec<(String, usize)>);

impl Visitor for Sizes {
    fn doubles(&mut self, name: &str, values: &mut Vec<f64>) {
        self.0.push((name.into(), values.len()));
    }
    fn singles(&mut self, name: &str, values: &mut Vec<f32>) {
        self.0.push((name.into(), values.len()));
    }
    fn words(&mut self, _: &str, _: &mut Vec<u16>) {}
    fn indices(&mut self, _: &str, _: &mut Vec<u32>) {}
    fn number(&mut self, _: &str, _: &mut f64) {}
    fn count(&mut self, _: &str, _: &mut u64) {}
}

#[test]
fn the_memory_of_bonds_is_part_of_what_changes() {
    let mut elasticity = specimen::<3, Single>(true);
    elasticity.evolve(0.0);
    let mut sizes = Sizes::default();
    elasticity.visit(&mut sizes);
    let n = 16 * elasticity.body.n_words();
    assert!(sizes.0.contains(&("memory_of_bonds".into(), n)), "{:?}", sizes.0);
}
