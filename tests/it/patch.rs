//! What every bond-based law must do on every body: nothing under rigid motion and, inside a lattice, under uniform
//! strain; equal and opposite pair forces; force as the slope of energy; mirrored answers to mirrored questions.
//!
//! Tolerances come from one number: K = max Σ c ω β V′/|ξ|, the spring constant of all bonds of a point together. An
//! error ε of displacements changes no force density by more than 2 K ε, and displacements u of a body of size X are
//! known to ε = 2⁻⁵³ (|u| + X |∇u|), the second part because positions are rounded too.

use crate::common::{Held, Random, SPACING, lattice, perturbed};
use bondwise::discretization::{Influence, Operator, PartialVolume, standard};
use bondwise::family::{Body, Bond, BondLaw, Families};
use bondwise::field::{components, components_mut};
use bondwise::geometry::{Arrangement, Cloud, Shape};
use bondwise::physics::elasticity::State;
use bondwise::physics::elasticity::discrete::discrete_moduli;
use bondwise::physics::elasticity::laws::{Law, LawVisitor};
use bondwise::physics::elasticity::moduli::{Hypothesis, micromodulus};

const YOUNG: f64 = 72e9;
const DENSITY: f64 = 2440.0;
/// 2⁻⁵³
const ROUNDING: f64 = 0.5 * f64::EPSILON;

/// A body with its law, ready to be displaced.
struct Specimen<const D: usize> {
    label: String,
    body: Body<D>,
    physics: Held<D>,
    law: Law,
    influence: Influence,
    rule: PartialVolume,
    hypothesis: Hypothesis,
}

impl<const D: usize> Specimen<D> {
    fn new(cloud: Cloud<D>, law: Law, influence: Influence, rule: PartialVolume, ratio: f64) -> Self {
        let hypothesis = [Hypothesis::Bar, Hypothesis::PlaneStress, Hypothesis::Solid][D - 1];
        let kind = if matches!(cloud.arrangement, Arrangement::Lattice(_)) { "lattice" } else { "cloud" };
        let label = format!("{D}D {kind} {} {} {}", law.name(), influence.name(), rule.name());
        let horizon = ratio * SPACING;
        let body = standard::body(cloud, horizon, rule);
        let strength = micromodulus(hypothesis, &influence, YOUNG, horizon);
        let operator = Operator::standard(&body, strength, influence, rule);
        let physics = Held::new(&body, operator, law.bonds(), DENSITY, None);
        Specimen { label, body, law, physics, influence, rule, hypothesis }
    }

    /// K, N/m⁴ in 3D: the stable step is √(2ρ/K).
    fn spring(&self) -> f64 {
        2.0 * DENSITY / self.physics.stable_step().powi(2)
    }

    /// The state at displacements u(point, x), with its forces.
    fn displaced(&self, u: impl FnMut(usize, [f64; D]) -> [f64; D]) -> State {
        let mut state = self.placed(u);
        self.physics.evolve(&mut state, 0.0);
        state
    }

    /// The same without forces.
    fn placed(&self, mut u: impl FnMut(usize, [f64; D]) -> [f64; D]) -> State {
        let mut state = self.physics.initial_state();
        for (point, &slot) in self.body.cloud.slots.iter().enumerate() {
            let value = u(point, self.body.cloud.position(slot as usize));
            for (c, value) in components_mut::<D, _>(&mut state.displacement).into_iter().zip(value) {
                c[slot as usize] = value;
            }
        }
        state
    }

    fn force(&self, state: &State, point: usize) -> [f64; D] {
        let slot = self.body.cloud.slots[point] as usize;
        components::<D, _>(&state.force).map(|c| c[slot])
    }

    fn volume(&self, point: usize) -> f64 {
        self.body.cloud.volume(self.body.cloud.slots[point] as usize)
    }

    /// W by slot.
    fn energy_density(&self, state: &State) -> Vec<f64> {
        self.physics.energy_density(state)
    }

    fn n_points(&self) -> usize {
        self.body.cloud.n_points()
    }

    /// Largest |x|, m.
    fn size(&self) -> f64 {
        let (low, high) = self.body.cloud.bounds();
        low.iter().chain(&high).fold(0.0, |a, x| a.max(x.abs()))
    }

    fn largest_force(&self, state: &State) -> f64 {
        (0..self.n_points()).flat_map(|p| self.force(state, p)).fold(0.0, |a, f| a.max(f.abs()))
    }

    /// Points whose family is complete.
    fn inner(&self) -> Vec<usize> {
        let state: State = self.physics.initial_state();
        let counts = state.states.per_point(&self.body);
        let Families::Lattice(families) = &self.body.families else { panic!("asked of lattices only") };
        (0..counts.len()).filter(|&p| counts[p] as usize == families.offsets.len()).collect()
    }
}

/// A check that can be made of any law in any dimension.
trait Check {
    fn check<const D: usize>(&mut self, specimen: &Specimen<D>);
}

/// What bodies a check is made on.
#[derive(Clone, Copy, PartialEq)]
enum Bodies {
    Lattices,
    LatticesAndClouds,
}

/// The laws that are materials of bonds alone. State-based solids have a test of their own.
fn bond_based() -> impl Iterator<Item = Law> {
    Law::ALL.iter().copied().filter(|law| !law.is_state_based())
}

/// Law × dimension × influence × partial volumes × lattice and cloud.
fn everywhere(bodies: Bodies, check: &mut impl Check) {
    one_dimension::<1>([23, 0, 0], 3.0, bodies, check);
    one_dimension::<2>([19, 14, 0], 3.0, bodies, check);
    // m = 2 keeps the 3D families at some tens.
    one_dimension::<3>([9, 8, 7], 2.0, bodies, check);
}

fn one_dimension<const D: usize>(counts: [usize; 3], ratio: f64, bodies: Bodies, check: &mut impl Check) {
    for influence in Influence::ALL {
        for rule in PartialVolume::ALL {
            // Exact volumes in 3D take some hundred slices a bond: one influence function will do.
            if D == 3 && rule == PartialVolume::Exact && influence != Influence::Linear {
                continue;
            }
            let mut clouds = vec![lattice::<D>(counts)];
            if bodies == Bodies::LatticesAndClouds {
                clouds.push(perturbed::<D>(counts));
            }
            for cloud in clouds {
                for law in bond_based() {
                    check.check(&Specimen::new(cloud.clone(), law, influence, rule, ratio));
                }
            }
        }
    }
}

struct Translation;

impl Check for Translation {
    fn check<const D: usize>(&mut self, s: &Specimen<D>) {
        let shift = std::array::from_fn(|d| [0.7, -1.3, 0.1][d]);
        let state = s.displaced(|_, _| shift);
        // u′ − u is 0 exactly.
        assert_eq!(s.largest_force(&state), 0.0, "{}", s.label);
        assert!(s.energy_density(&state).iter().all(|w| *w == 0.0), "{}", s.label);
    }
}

#[test]
fn rigid_translation_gives_no_force_to_the_last_bit() {
    everywhere(Bodies::LatticesAndClouds, &mut Translation);
}

struct Rotation;

impl Check for Rotation {
    fn check<const D: usize>(&mut self, s: &Specimen<D>) {
        if D == 1 {
            return;
        }
        // Finite for the law that knows rotations, infinitesimal (u = W x with W antisymmetric) for the linear one.
        let angle: f64 = 0.6;
        let (sine, cosine) = if s.law.is_linear() { (angle, 1.0) } else { angle.sin_cos() };
        let mut largest = 0.0_f64;
        let state = s.displaced(|_, x| {
            let mut u = [0.0; D];
            // About the first axis in 3D, about the origin in 2D.
            let (a, b) = (D - 2, D - 1);
            u[a] = (cosine - 1.0) * x[a] - sine * x[b];
            u[b] = sine * x[a] + (cosine - 1.0) * x[b];
            largest = u.iter().fold(largest, |m, u| m.max(u.abs()));
            u
        });
        // 2 K ε with ε of the header; 4 for the operations that make u and the elongation.
        let tolerance = 2.0 * s.spring() * 4.0 * ROUNDING * (largest + s.size());
        let found = s.largest_force(&state);
        assert!(found <= tolerance, "{}: {found:.3e} above {tolerance:.3e}", s.label);
    }
}

#[test]
fn rigid_rotation_gives_no_force() {
    everywhere(Bodies::LatticesAndClouds, &mut Rotation);
}

/// ∇u of a uniform deformation with strains and a rotation.
fn gradient<const D: usize>() -> [[f64; D]; D] {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| [[2.0e-3, -1.1e-3, 0.4e-3], [0.9e-3, -1.0e-3, 0.3e-3], [-0.5e-3, 0.6e-3, 1.5e-3]][i][j])
    })
}

fn times<const D: usize>(a: &[[f64; D]; D], x: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|i| (0..D).map(|j| a[i][j] * x[j]).sum())
}

struct UniformStrain;

impl Check for UniformStrain {
    fn check<const D: usize>(&mut self, s: &Specimen<D>) {
        let a = gradient::<D>();
        let state = s.displaced(|_, x| times(&a, &x));
        let inner = s.inner();
        assert!(!inner.is_empty(), "{}: the body has an inside", s.label);
        // Rounding of u, which is 2e-3 x, and of positions times 2e-3; 4 for the sum of D products.
        let tolerance = 2.0 * s.spring() * 4.0 * ROUNDING * 4e-3 * s.size();
        for point in inner {
            for f in s.force(&state, point) {
                assert!(f.abs() <= tolerance, "{}, point {point}: {f:.3e} above {tolerance:.3e}", s.label);
            }
        }
    }
}

#[test]
fn uniform_strain_gives_no_force_inside_a_lattice() {
    everywhere(Bodies::Lattices, &mut UniformStrain);
}

struct Moduli;

impl Check for Moduli {
    fn check<const D: usize>(&mut self, s: &Specimen<D>) {
        let strain = 1e-7;
        let point = s.inner()[0];
        let slot = s.body.cloud.slots[point] as usize;
        let stiffness = s.hypothesis.stiffness(YOUNG);
        let ratios = discrete_moduli(s.hypothesis, &s.influence, s.rule, s.body.horizon / SPACING);
        // The energy of the nonlinear law differs by the strain itself, and a strain of 1e-7 of a body of some ten
        // spacings has 1e-8 of rounding at worst.
        let tolerance = 1e-6;
        for axis in 0..D {
            let state = s.displaced(|_, x| std::array::from_fn(|d| if d == axis { strain * x[d] } else { 0.0 }));
            let expected = 0.5 * stiffness.c11 * ratios.c11 * strain * strain;
            let found = s.energy_density(&state)[slot];
            assert!((found / expected - 1.0).abs() < tolerance, "{}: {found:e} {expected:e}", s.label);
            if D == 1 {
                continue;
            }
            // Pair forces make C₁₂₁₂ = C₁₁₂₂, so that W of a shear γ is ½ C₁₁₂₂ γ².
            let across = (axis + 1) % D;
            let state = s.displaced(|_, x| std::array::from_fn(|d| if d == axis { strain * x[across] } else { 0.0 }));
            let expected = 0.5 * stiffness.c12 * ratios.c12.unwrap() * strain * strain;
            let found = s.energy_density(&state)[slot];
            assert!((found / expected - 1.0).abs() < tolerance, "{}: {found:e} {expected:e}", s.label);
        }
    }
}

#[test]
fn uniform_strain_has_the_energy_of_the_discrete_moduli() {
    everywhere(Bodies::Lattices, &mut Moduli);
}

struct Momentum;

impl Check for Momentum {
    fn check<const D: usize>(&mut self, s: &Specimen<D>) {
        let mut random = Random::new(2);
        let state = s.displaced(|_, _| std::array::from_fn(|_| 1e-2 * SPACING * random.next()));
        let (mut sum, mut size) = ([0.0; D], 0.0);
        for point in 0..s.n_points() {
            let f = s.force(&state, point);
            for d in 0..D {
                sum[d] += f[d] * s.volume(point);
                size += f[d].abs() * s.volume(point);
            }
        }
        // Each point adds some tens of pair forces that largely cancel, with a rounding of 2⁻⁵³ of their sizes: a few
        // times |f|; errors of points are independent, so that their sum is √N of one, and `size` is N.
        for total in sum {
            assert!(total.abs() < 100.0 * ROUNDING * size, "{}: {total:.3e} of {size:.3e}", s.label);
        }
    }
}

#[test]
fn internal_forces_keep_the_momentum() {
    everywhere(Bodies::LatticesAndClouds, &mut Momentum);
}

struct Slope;

impl Check for Slope {
    fn check<const D: usize>(&mut self, s: &Specimen<D>) {
        let mut random = Random::new(3);
        let field: Vec<[f64; D]> =
            (0..s.n_points()).map(|_| std::array::from_fn(|_| 1e-2 * SPACING * random.next())).collect();
        let moved = |moved: usize, axis: usize, by: f64| {
            s.placed(|point, _| {
                let mut u = field[point];
                if point == moved {
                    u[axis] += by;
                }
                u
            })
        };
        let step = 1e-6 * SPACING;
        let state = s.displaced(|point, _| field[point]);
        let scale = s.largest_force(&state);
        // A corner and a point inside, one axis each.
        for (point, axis) in [(0, 0), (s.n_points() / 2, D - 1)] {
            let plus = s.energy_density(&moved(point, axis, step));
            let minus = s.energy_density(&moved(point, axis, -step));
            // Energies of the points out of reach do not change by a bit.
            let change: f64 = s
                .body
                .cloud
                .slots
                .iter()
                .map(|&i| i as usize)
                .map(|i| (plus[i] - minus[i]) * s.body.cloud.volume(i))
                .sum();
            let slope = -change / (2.0 * step) / s.volume(point);
            let force = s.force(&state, point)[axis];
            // Rounding of energies, 2⁻⁵³ W/(f step) ≈ 1e-16 × 1e-2/1e-6 some tens of times, and truncation,
            // (step/h)²/1e-2 = 1e-10; the larger of the two with room.
            assert!((slope - force).abs() < 1e-9 * scale, "{}, {point} {axis}: {slope:e} {force:e}", s.label);
        }
    }
}

#[test]
fn force_is_the_slope_of_the_strain_energy() {
    everywhere(Bodies::LatticesAndClouds, &mut Slope);
}

struct Mirror;

impl Check for Mirror {
    fn check<const D: usize>(&mut self, s: &Specimen<D>) {
        mirrored(s);
    }
}

fn mirrored<const D: usize>(s: &Specimen<D>) {
    let Arrangement::Lattice(lattice) = &s.body.cloud.arrangement else { panic!("asked of lattices only") };
    let mut random = Random::new(4);
    let field: Vec<[f64; D]> =
        (0..s.n_points()).map(|_| std::array::from_fn(|_| 1e-2 * SPACING * random.next())).collect();
    let state = s.displaced(|point, _| field[point]);
    for axis in 0..D {
        let image = |point: usize| {
            let mut cell = lattice.cell(s.body.cloud.slots[point] as usize);
            cell[axis] = lattice.counts[axis] - 1 - cell[axis];
            s.body.cloud.slots.binary_search(&(lattice.slot(cell) as u32)).expect("the body is symmetric")
        };
        let flip = |mut v: [f64; D]| {
            v[axis] = -v[axis];
            v
        };
        let other = s.displaced(|point, _| flip(field[image(point)]));
        for point in 0..s.n_points() {
            let (here, there) = (s.force(&other, point), flip(s.force(&state, image(point))));
            assert_eq!(here.map(f64::to_bits), there.map(f64::to_bits), "{}, axis {axis}, point {point}", s.label);
        }
    }
}

#[test]
fn mirrored_displacements_give_mirrored_forces_to_the_last_bit() {
    everywhere(Bodies::Lattices, &mut Mirror);
    // A disk and a ball: points are missing from blocks, on both sides alike.
    let disk = Cloud::lattice(&Shape::Ball { center: [0.0; 2], radius: 12.3 * SPACING }, SPACING, 5);
    mirrored(&Specimen::new(disk, Law::BondBased, Influence::Constant, PartialVolume::Ramp, 3.0));
    let ball = Cloud::lattice(&Shape::Ball { center: [0.0; 3], radius: 5.3 * SPACING }, SPACING, 5);
    mirrored(&Specimen::new(ball, Law::BondBased, Influence::Linear, PartialVolume::None, 3.0));
}

#[test]
fn a_law_called_from_both_ends_gives_opposite_forces_to_the_last_bit() {
    struct BothEnds(Random);
    impl<const D: usize> LawVisitor<D> for BothEnds {
        fn visit<B: BondLaw<D>>(&mut self, name: Law, law: B) {
            let random = &mut self.0;
            for _ in 0..1000 {
                let xi: [f64; D] = std::array::from_fn(|_| SPACING * random.next());
                let eta: [f64; D] = std::array::from_fn(|_| 0.3 * SPACING * random.next());
                let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
                let here = Bond::new(xi, length, 3.7e15);
                let there = Bond { xi: xi.map(|x| -x), ..here };
                let back = eta.map(|x| -x);
                let (s, t) = (law.strain(&here, &eta), law.strain(&there, &back));
                assert_eq!(s.to_bits(), t.to_bits(), "{}", name.name());
                // Both forms: the small one has a value beyond its range too.
                for small in [false, true] {
                    let force = |bond: &Bond<D, f64>, eta: &[f64; D]| match small {
                        true => law.small_force(bond, eta, s, [0.0; D]),
                        false => law.force(bond, eta, s, [0.0; D]),
                    };
                    assert_eq!(force(&here, &eta).map(f64::to_bits), force(&there, &back).map(|f| (-f).to_bits()));
                    let energy = |bond: &Bond<D, f64>| match small {
                        true => law.small_energy(bond, s),
                        false => law.energy(bond, s),
                    };
                    assert_eq!(energy(&here).to_bits(), energy(&there).to_bits());
                }
            }
        }
    }
    let mut both_ends = BothEnds(Random::new(5));
    Law::visit_bonds::<1>(&mut both_ends);
    Law::visit_bonds::<2>(&mut both_ends);
    Law::visit_bonds::<3>(&mut both_ends);
}

#[test]
fn two_points_pull_each_other_with_opposite_forces_to_the_last_bit() {
    fn check<const D: usize>(random: &mut Random, law: Law) {
        for influence in Influence::ALL {
            for rule in PartialVolume::ALL {
                let a: [f64; D] = std::array::from_fn(|_| SPACING * random.next());
                let b: [f64; D] = std::array::from_fn(|d| a[d] + SPACING * [1.1, 0.4, -0.3][d]);
                let cloud = Cloud::scattered(vec![a, b], vec![SPACING.powi(D as i32); 2]);
                let s = Specimen::new(cloud, law, influence, rule, 2.0);
                let state = s.displaced(|_, _| std::array::from_fn(|_| 0.1 * SPACING * random.next()));
                let (f, g) = (s.force(&state, 0), s.force(&state, 1));
                assert_ne!(f, [0.0; D], "{}", s.label);
                assert_eq!(f, g.map(|g| -g), "{}", s.label);
                // In bits but for the sign of a zero, which a sum with padding may lose.
                assert_eq!(f.map(f64::abs).map(f64::to_bits), g.map(f64::abs).map(f64::to_bits), "{}", s.label);
            }
        }
    }
    let mut random = Random::new(6);
    for law in bond_based() {
        check::<1>(&mut random, law);
        check::<2>(&mut random, law);
        check::<3>(&mut random, law);
    }
}

#[test]
fn weights_of_a_cloud_are_those_of_the_lattice_where_points_agree() {
    // One number ties the two paths together before any force does; what is stored of exact volumes has 16 bits.
    for influence in Influence::ALL {
        for rule in PartialVolume::ALL {
            let cloud = lattice::<2>([9, 9, 0]);
            let positions = cloud.slots.iter().map(|&s| cloud.position(s as usize)).collect();
            let volumes = vec![SPACING * SPACING; cloud.n_points()];
            let same = Specimen::new(Cloud::scattered(positions, volumes), Law::BondBased, influence, rule, 3.0);
            let s = Specimen::new(cloud, Law::BondBased, influence, rule, 3.0);
            let tolerance = if rule == PartialVolume::Exact { 1e-5 } else { 1e-12 };
            assert!((same.spring() / s.spring() - 1.0).abs() < tolerance, "{}", s.label);
            assert!(same.physics.0.lock().unwrap().operator.weights.by_offset.is_empty());
        }
    }
}
