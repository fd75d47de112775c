//! The fast loops against the plain one: every set of instructions, precision, form and path gives the sum that a scalar
//! loop over bonds gives, and breaks the bonds that it breaks.

use bondwise::discretization::heterogeneity::PairTable;
use bondwise::discretization::{Heterogeneity, Influence, Operator, PartialVolume, standard};
use bondwise::execution::{BreakRule, Broken, Exec, Instructions, Packs, Unbreakable};
use bondwise::family::{Body, Bond, BondKernel, BondLaw, BondStates, Families, GROUP};
use bondwise::field::{Double, Mixed, Number, Single};
use bondwise::geometry::lattice::BLOCK;
use bondwise::geometry::{Cloud, Shape};
use bondwise::lane::Lane;
use bondwise::physics::elasticity::laws::{BondBased, BondBasedLinear};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

const SPACING: f64 = 1e-3;

/// Which form of the law a kernel is given as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// As the program chooses: small where every bond of the block is.
    Chosen,
    Small,
    Exact,
}

/// The force of a law, in a form.
struct Force<L, const SMALL: bool, const EXACT: bool>(L);

impl<const D: usize, B: BondLaw<D>, const SMALL: bool, const EXACT: bool> BondKernel<D, D, D>
    for Force<B, SMALL, EXACT>
{
    const SMALL: f64 = match (SMALL, EXACT) {
        (true, false) => f64::INFINITY,
        (false, true) => -1.0,
        _ => B::SMALL,
    };
    // As the program compiles it, in one of the forms.
    const EVERY_STEP: bool = SMALL == EXACT;
    const VARIED: bool = SMALL == EXACT;
    #[inline(always)]
    fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
        self.0.strain(bond, eta)
    }
    #[inline(always)]
    fn add<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], _: &[L; 0], strain: L, sum: [L; D]) -> [L; D] {
        self.0.force(bond, eta, strain, sum)
    }
    #[inline(always)]
    fn add_small<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], _: &[L; 0], strain: L, sum: [L; D]) -> [L; D] {
        self.0.small_force(bond, eta, strain, sum)
    }
}

/// Bonds break beyond one strain.
struct Limit(f64);

impl<const D: usize> BreakRule<D> for Limit {
    fn threshold(&self) -> f64 {
        self.0
    }
    fn breaks(&self, _: usize, _: usize, strain: f64) -> bool {
        strain > self.0
    }
    fn released(&self, bond: &Bond<D, f64>, _: usize, _: usize) -> f64 {
        bond.weight
    }
}

/// Numbers from −1 to 1.
struct Random(ChaCha8Rng);

impl Random {
    fn next(&mut self) -> f64 {
        f64::from(self.0.next_u32().cast_signed()) / f64::from(1u32 << 31)
    }
}

/// A body with random displacements and random broken bonds.
struct Specimen<const D: usize> {
    body: Body<D>,
    operator: Operator,
    states: BondStates,
    /// By slot, component by component.
    displacement: [Vec<f64>; D],
}

impl<const D: usize> Specimen<D> {
    /// `scale`: of the relative displacements of neighbours, in spacings. Displacements are those of single precision,
    /// so that all precisions start from the same numbers.
    fn new(cloud: Cloud<D>, scale: f64, seed: u64) -> Self {
        let mut random = Random(ChaCha8Rng::seed_from_u64(seed));
        let body = standard::body(cloud, 3.0 * SPACING, PartialVolume::Ramp);
        let operator = Operator::standard(&body, 1e25, Influence::Linear, PartialVolume::Ramp);
        let mut displacement = std::array::from_fn(|_| vec![0.0; body.cloud.n_slots()]);
        for &slot in &body.cloud.slots {
            for component in &mut displacement {
                component[slot as usize] = f64::from((scale * SPACING * random.next()) as f32);
            }
        }
        let mut states = BondStates::whole(&body);
        for word in states.words_mut() {
            if random.next() > 0.5 {
                *word &= random.0.next_u32() as u16;
            }
        }
        Specimen { body, operator, states, displacement }
    }

    /// Of bonds whose constants differ: c/c₀ by place, and what the bonds between both sides of x = 0 have more of it.
    fn of(mut self, relative: impl Fn(&[f64; D]) -> f64, across: Option<f64>) -> Self {
        let (mut by_slot, mut side) = (vec![0.0; self.body.cloud.n_slots()], vec![0; self.body.cloud.n_slots()]);
        for &slot in &self.body.cloud.slots {
            let x = self.body.cloud.position(slot as usize);
            (by_slot[slot as usize], side[slot as usize]) = (relative(&x), u8::from(x[0] > 0.0));
        }
        let pairs = across.map(|t| PairTable { materials: side, factors: vec![1.0, t, t, 1.0], n: 2 });
        self.operator.weights.heterogeneity = Some(Heterogeneity::new(&self.body, &by_slot, pairs).into());
        self
    }

    /// Calls `visit` with each bond that holds: its ends and the bond.
    fn bonds(&self, states: &BondStates, mut visit: impl FnMut(usize, usize, Bond<D, f64>)) {
        let weights = &self.operator.weights;
        let varied = weights.heterogeneity.as_deref();
        let factor = |here, there| varied.map_or(1.0, |varied| varied.factor(here, there));
        match &self.body.families {
            Families::Lattice(families) => {
                let (lattice, weights) = (&families.lattice, &weights.by_offset);
                let n = families.offsets.len();
                for &block in &families.blocks {
                    for (k, offset) in families.offsets.iter().enumerate() {
                        for bit in (0..BLOCK).filter(|b| states.words()[block as usize * n + k] >> b & 1 == 1) {
                            let here = lattice.guard + block as usize * BLOCK + bit;
                            let there = here.wrapping_add_signed(offset.shift);
                            visit(here, there, Bond::new(offset.xi, offset.length, weights[k] * factor(here, there)));
                        }
                    }
                }
            }
            Families::Cloud(families) => {
                let (positions, volumes) = self.body.cloud.places();
                let weights = &weights.by_length;
                for here in 0..positions.len() {
                    for bond in families.of(here).filter(|b| states.words()[b / GROUP] >> (b % GROUP) & 1 == 1) {
                        let there = families.neighbours[bond] as usize;
                        let xi: [f64; D] = std::array::from_fn(|d| positions[there][d] - positions[here][d]);
                        let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
                        let weight = weights.weight(bond, length, volumes[there]) * factor(here, there);
                        visit(here, there, Bond::new(xi, length, weight));
                    }
                }
            }
        }
    }

    fn eta(&self, here: usize, there: usize) -> [f64; D] {
        std::array::from_fn(|d| self.displacement[d][there] - self.displacement[d][here])
    }

    /// The sums of the plain loop in the exact form, and Σ |f| beside each: what its rounding is measured against.
    fn plain(&self, law: impl BondLaw<D>, states: &BondStates) -> ([Vec<f64>; D], Vec<f64>) {
        let n = self.body.cloud.n_slots();
        let (mut sums, mut scale) = (std::array::from_fn(|_| vec![0.0; n]), vec![0.0; n]);
        self.bonds(states, |here, there, bond| {
            let eta = self.eta(here, there);
            let force = law.force(&bond, &eta, law.strain(&bond, &eta), [0.0; D]);
            for d in 0..D {
                sums[d][here] += force[d];
            }
            // |f| if ξ and η were parallel, so that a strain that cancels does not hide the rounding of its parts.
            let size = eta.iter().map(|x| x * x).sum::<f64>().sqrt();
            scale[here] += bond.spring * (size / bond.length) * (2.0 + size / bond.length) * (bond.length + size);
        });
        (sums, scale)
    }

    /// The sums of the fast loop, the states that it leaves and what it broke.
    fn fast<P: Packs>(
        &self,
        instructions: Instructions,
        kernel: &impl BondKernel<D, D, D>,
        rule: &impl BreakRule<D>,
    ) -> ([Vec<P::Field>; D], BondStates, Broken) {
        let mut exec = Exec::on(instructions);
        let mut states = self.states.clone();
        let input: [Vec<P::Field>; D] =
            std::array::from_fn(|d| self.displacement[d].iter().map(|&x| P::Field::from_f64(x)).collect());
        let mut output = std::array::from_fn(|_| vec![P::Field::default(); self.body.cloud.n_slots()]);
        let broken = exec.sum_bonds_and_break::<D, D, D, P>(
            &self.body,
            &self.operator.weights,
            &mut states,
            input.each_ref().map(|v| &v[..]),
            output.each_mut().map(|v| &mut v[..]),
            kernel,
            rule,
        );
        (output, states, broken)
    }

    fn fast_in_form<P: Packs>(
        &self,
        instructions: Instructions,
        law: impl BondLaw<D>,
        form: Form,
        rule: &impl BreakRule<D>,
    ) -> ([Vec<P::Field>; D], BondStates, Broken) {
        match form {
            Form::Chosen => self.fast::<P>(instructions, &Force::<_, false, false>(law), rule),
            Form::Small => self.fast::<P>(instructions, &Force::<_, true, false>(law), rule),
            Form::Exact => self.fast::<P>(instructions, &Force::<_, false, true>(law), rule),
        }
    }
}

/// Lattices with points missing from blocks, and scattered clouds, some ten thousand bonds each.
fn specimens<const D: usize>(scale: f64) -> Vec<Specimen<D>> {
    let radius = [60.0, 12.3, 5.4][D - 1] * SPACING;
    let lattice = || Cloud::lattice(&Shape::Ball { center: [0.31 * SPACING; D], radius }, SPACING, 5);
    let mut random = Random(ChaCha8Rng::seed_from_u64(7));
    let regular = lattice();
    let positions = regular
        .slots
        .iter()
        .map(|&s| regular.position(s as usize).map(|x| x + 0.2 * SPACING * random.next()))
        .collect();
    let volumes = (0..regular.n_points()).map(|_| SPACING.powi(D as i32) * (1.0 + 0.3 * random.next())).collect();
    let cloud = Cloud::scattered(positions, volumes);
    vec![
        Specimen::new(lattice(), scale, 1),
        Specimen::new(cloud.clone(), scale, 2),
        Specimen::new(lattice(), scale, 1).of(|x| if x[0] < 0.2 * SPACING { 1.0 } else { 7.0 }, None),
        Specimen::new(lattice(), scale, 1).of(|x| (300.0 * x[0]).exp(), Some(0.3)),
        Specimen::new(cloud, scale, 2).of(|x| (300.0 * x[0]).exp(), Some(0.3)),
    ]
}

/// Unit round-off of bonds in this precision.
fn round_off<P: Packs>() -> f64 {
    if size_of::<P::Bond>() == 4 { 0.5 * f64::from(f32::EPSILON) } else { 0.5 * f64::EPSILON }
}

#[test]
fn every_loop_gives_the_sums_of_the_plain_one() {
    fn check<const D: usize, P: Packs>(law: impl BondLaw<D>, scale: f64) {
        for (k, specimen) in specimens::<D>(scale).iter().enumerate() {
            let (plain, size) = specimen.plain(law, &specimen.states);
            for instructions in Instructions::available() {
                let (fast, states, broken) = specimen.fast_in_form::<P>(instructions, law, Form::Chosen, &Unbreakable);
                assert_eq!((states == specimen.states, broken), (true, Broken::default()));
                for &slot in &specimen.body.cloud.slots {
                    let slot = slot as usize;
                    // Each summand: some twenty roundings of ξ, |ξ|, weight, strain and force; sums of some hundred in
                    // up to sixteen parts: twenty more.
                    let tolerance = 40.0 * round_off::<P>() * size[slot];
                    for d in 0..D {
                        let (a, b) = (fast[d][slot].to_f64(), plain[d][slot]);
                        assert!(
                            (a - b).abs() <= tolerance,
                            "{D}D {} {instructions:?} specimen {k} slot {slot}: {a} {b} ± {tolerance:e}",
                            P::NAME
                        );
                    }
                }
            }
        }
    }
    fn precisions<const D: usize>(law: impl BondLaw<D>, scale: f64) {
        check::<D, Double>(law, scale);
        check::<D, Single>(law, scale);
        check::<D, Mixed>(law, scale);
    }
    // Strains of 1e-4, all small; of about 1 %, some blocks small and some not; of 20 %.
    for scale in [1e-4, 5e-3, 0.1] {
        precisions::<1>(BondBased, scale);
        precisions::<2>(BondBased, scale);
        precisions::<3>(BondBased, scale);
        precisions::<2>(BondBasedLinear, scale);
        precisions::<3>(BondBasedLinear, scale);
    }
}

#[test]
fn the_form_that_ran_never_changes_which_bond_breaks() {
    fn check<const D: usize, P: Packs>(law: impl BondLaw<D>, scale: f64, limit: f64) {
        for (k, specimen) in specimens::<D>(scale).iter().enumerate() {
            for instructions in Instructions::available() {
                let label = format!("{D}D {} {instructions:?} specimen {k}", P::NAME);
                let run = |form| specimen.fast_in_form::<P>(instructions, law, form, &Limit(law.strain_at(limit)));
                let (_, states, broken) = run(Form::Chosen);
                for form in [Form::Small, Form::Exact] {
                    let (_, same_states, same) = run(form);
                    assert!(states == same_states, "{label} {form:?}: which bonds hold");
                    assert_eq!(broken, same, "{label} {form:?}");
                }
                // The plain loop breaks the same but for strains within the rounding of the limit.
                let margin = 32.0 * round_off::<P>() * (1.0 + scale);
                let (mut sure, mut doubtful) = (0, 0);
                specimen.bonds(&specimen.states, |here, there, bond| {
                    let excess = law.strain(&bond, &specimen.eta(here, there)) - law.strain_at(limit);
                    sure += u64::from(excess > margin);
                    doubtful += u64::from(excess.abs() <= margin);
                });
                assert!(sure > 10, "{label}: {sure} broken bonds, the test asks nothing");
                assert!((sure..=sure + doubtful).contains(&broken.bonds), "{label}: {broken:?}, {sure} + {doubtful}");
                assert_eq!(states.count() + broken.bonds, specimen.states.count(), "{label}");
            }
        }
    }
    fn precisions<const D: usize>(law: impl BondLaw<D>, scale: f64, limit: f64) {
        check::<D, Double>(law, scale, limit);
        check::<D, Single>(law, scale, limit);
        check::<D, Mixed>(law, scale, limit);
    }
    // Limits below, at and beyond the strains for which the small form is right.
    for (scale, limit) in [(1e-3, 8e-4), (8e-3, 5e-3), (4e-2, 3e-2)] {
        precisions::<1>(BondBased, scale, limit);
        precisions::<2>(BondBased, scale, limit);
        precisions::<3>(BondBased, scale, limit);
        precisions::<3>(BondBasedLinear, scale, limit);
    }
}

#[test]
fn instructions_that_fuse_agree_to_the_last_bit() {
    fn check<const D: usize, P: Packs>(law: impl BondLaw<D>, scale: f64) {
        for specimen in specimens::<D>(scale) {
            let run = |instructions| {
                let limit = Limit(law.strain_at(0.7 * scale));
                let (force, states, broken) = specimen.fast_in_form::<P>(instructions, law, Form::Chosen, &limit);
                let bits = force.map(|f| f.iter().map(|x| x.to_f64().to_bits()).collect::<Vec<_>>());
                (bits, states, broken.bonds, broken.energy.to_bits())
            };
            // The baseline of x86-64 does not fuse.
            let fused: Vec<_> =
                Instructions::available().into_iter().filter(|i| *i != Instructions::Baseline).map(run).collect();
            for pair in fused.windows(2) {
                assert!(pair[0] == pair[1], "{D}D {}", P::NAME);
            }
        }
    }
    for scale in [1e-3, 1e-2] {
        check::<1, Double>(BondBased, scale);
        check::<2, Double>(BondBased, scale);
        check::<3, Double>(BondBased, scale);
        check::<3, Single>(BondBased, scale);
        check::<3, Mixed>(BondBased, scale);
        check::<3, Double>(BondBasedLinear, scale);
    }
}

#[test]
fn rows_give_the_sums_of_their_bonds() {
    /// The linear law, as a kernel that is summed as rows.
    struct Linear;
    impl<const D: usize> BondKernel<D, D, D> for Linear {
        const LINEAR: bool = true;
        #[inline(always)]
        fn strain<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D]) -> L {
            BondBasedLinear.strain(bond, eta)
        }
        #[inline(always)]
        fn add<L: Lane>(&self, bond: &Bond<D, L>, eta: &[L; D], _: &[L; 0], strain: L, sum: [L; D]) -> [L; D] {
            BondBasedLinear.force(bond, eta, strain, sum)
        }
    }
    fn check<const D: usize, P: Packs>(cells: f64) {
        let shape = Shape::Box { low: [0.0; D], high: [cells * SPACING; D] };
        let mut specimen = Specimen::new(Cloud::lattice(&shape, SPACING, 5), 1e-3, 3);
        specimen.states = BondStates::whole(&specimen.body);
        check_rows::<D, P>(&specimen);
        let half = 0.5 * cells * SPACING;
        check_rows::<D, P>(&specimen.of(|x| if x[0] < half { 0.4 } else { 5.0 }, None));
    }
    fn check_rows<const D: usize, P: Packs>(specimen: &Specimen<D>) {
        let (plain, size) = specimen.plain(BondBasedLinear, &specimen.states);
        for instructions in Instructions::available() {
            let (fast, ..) = specimen.fast::<P>(instructions, &Linear, &Unbreakable);
            for &slot in &specimen.body.cloud.slots {
                let slot = slot as usize;
                for d in 0..D {
                    let difference = (fast[d][slot].to_f64() - plain[d][slot]).abs();
                    assert!(difference <= 40.0 * round_off::<P>() * size[slot], "{D}D {} {instructions:?}", P::NAME);
                }
            }
        }
    }
    // Wide enough that blocks of sixteen points have all their bonds.
    check::<1, Double>(200.0);
    check::<2, Double>(64.0);
    check::<3, Double>(50.0);
    check::<3, Single>(50.0);
    check::<3, Mixed>(50.0);
}
