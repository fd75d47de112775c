//! The same numbers whichever way they are computed: on a lattice or on the same points as a scattered cloud, on any
//! number of threads.

use std::ops::Range;

use crate::common::Held;
use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::discretization::{Influence, Operator, PartialVolume, standard};
use bondwise::execution::Exec;
use bondwise::family::{Body, BondLaw};
use bondwise::field::{Values, components, components_mut};
use bondwise::geometry::{Cloud, Crack, Shape};
use bondwise::output::source::Sizes;
use bondwise::physics::elasticity::laws::{BondBased, BondBasedLinear};
use bondwise::physics::elasticity::{Bonds, State};
use bondwise::physics::failure::CriticalStretch;
use bondwise::simulation::Simulation;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

const SPACING: f64 = 1e-3;
/// Whatever pools the machine has: fewer, as many, and more threads than its cores, and a number that divides nothing.
const THREADS: [usize; 4] = [1, 2, 3, 7];

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads").install(work)
}

/// The points of a lattice as a scattered cloud.
fn scattered<const D: usize>(cloud: &Cloud<D>) -> Cloud<D> {
    let positions = cloud.slots.iter().map(|&s| cloud.position(s as usize)).collect();
    Cloud::scattered(positions, vec![SPACING.powi(D as i32); cloud.n_points()])
}

fn model<const D: usize, L: BondLaw<D>>(
    cloud: Cloud<D>,
    law: L,
    influence: Influence,
    rule: PartialVolume,
    failure: Option<CriticalStretch>,
) -> (Body<D>, Held<D>) {
    let body = standard::body(cloud, 3.0 * SPACING, rule);
    // E = 1 in units that do not matter: forces are compared with each other.
    let operator = Operator::standard(&body, 1.0, influence, rule);
    let held = Held::new(&body, operator, Box::new(Bonds::new(law)), 1.0, failure);
    (body, held)
}

/// A smooth field with strains up to about 2 % and a different value at every point.
fn displacement<const D: usize>(x: [f64; D]) -> [f64; D] {
    let phase = x.iter().zip([310.0, 170.0, 230.0]).map(|(x, k)| k * x).sum::<f64>();
    std::array::from_fn(|d| 4e-5 * (phase + d as f64).sin() + 5e-5 * (x[d] * 120.0).cos())
}

fn evaluated<const D: usize>(body: &Body<D>, physics: &Held<D>, crack: Option<&Crack<D>>) -> State {
    let mut state = physics.initial_state();
    for &slot in &body.cloud.slots {
        let u = displacement(body.cloud.position(slot as usize));
        for (c, u) in components_mut::<D, _>(&mut state.displacement).into_iter().zip(u) {
            c[slot as usize] = u;
        }
    }
    if let Some(crack) = crack {
        state.states.cut(body, std::slice::from_ref(crack), 1e-9 * SPACING);
    }
    physics.evolve(&mut state, 0.0);
    state
}

fn forces<const D: usize>(body: &Body<D>, state: &State) -> Vec<[f64; D]> {
    let parts = components::<D, _>(&state.force);
    body.cloud.slots.iter().map(|&s| parts.map(|c| c[s as usize])).collect()
}

/// Compares a lattice with its points as a cloud: forces, and bonds of each point that hold.
fn compare<const D: usize, L: BondLaw<D>>(
    shape: &Shape<D>,
    law: L,
    influence: Influence,
    rule: PartialVolume,
    stretch: Option<f64>,
    crack: Option<&Crack<D>>,
) {
    let label = format!("{D}D {} {} {stretch:?}", influence.name(), rule.name());
    let failure = stretch.map(CriticalStretch::uniform);
    let cloud = Cloud::lattice(shape, SPACING, 5);
    let (same_body, same) = model(scattered(&cloud), law, influence, rule, failure.clone());
    let (body, physics) = model(cloud, law, influence, rule, failure);
    let (state, same_state) = (evaluated(&body, &physics, crack), evaluated(&same_body, &same, crack));
    assert_eq!(state.states.per_point(&body), same_state.states.per_point(&same_body), "{label}: bonds that hold");
    assert_eq!(state.broken.bonds, same_state.broken.bonds, "{label}: broken bonds");
    if stretch.is_some() {
        assert!(state.broken.bonds > 100 && state.broken.bonds.is_multiple_of(2), "{label}: {}", state.broken.bonds);
        let energies = (state.broken.energy, same_state.broken.energy);
        let tolerance = if rule == PartialVolume::Exact { 1e-5 } else { 1e-11 };
        assert!((energies.0 / energies.1 - 1.0).abs() < tolerance, "{label}: {energies:?}");
    }
    let (low, high) = body.cloud.bounds();
    let size = low.iter().chain(&high).fold(0.0_f64, |a, x| a.max(x.abs()));
    // K, the spring constant of all bonds of a point: the stable step is √(2ρ/K).
    let spring = 2.0 / physics.stable_step().powi(2);
    // ξ is a multiple of the spacing on a lattice and a difference of rounded positions in a cloud: with displacements
    // of 9e-5 and strains of 2 % that is an error of displacements of 2⁻⁵³ (size × 2 % + 9e-5); of weights that depend
    // on |ξ| a fraction of 2⁻⁵² size/h, times the forces K × 2 % δ that they multiply; the order of some tens of
    // summands less than either. 16 bits of exact volumes: 2⁻¹⁷ of each such force.
    let strained = 0.02 * 3.0 * SPACING;
    let mut tolerance = spring * f64::EPSILON * (size * 0.02 + 9e-5 + 4.0 * strained * size / SPACING);
    if rule == PartialVolume::Exact {
        tolerance += spring * strained * 2f64.powi(-17);
    }
    for (point, (a, b)) in forces(&body, &state).iter().zip(forces(&same_body, &same_state)).enumerate() {
        for d in 0..D {
            assert!((a[d] - b[d]).abs() <= tolerance, "{label}, point {point}: {a:?} {b:?} ± {tolerance:e}");
        }
    }
}

/// A box that does not sit on the origin.
fn block<const D: usize>(cells: [f64; 3]) -> Shape<D> {
    let low = std::array::from_fn(|d| SPACING * [0.3, -7.1, 0.7][d]);
    Shape::Box { low, high: std::array::from_fn(|d| low[d] + SPACING * cells[d]) }
}

#[test]
fn a_lattice_and_the_same_points_as_a_cloud_have_the_same_forces() {
    for influence in Influence::ALL {
        for rule in PartialVolume::ALL {
            compare::<1, _>(&block([70.0, 0.0, 0.0]), BondBased, influence, rule, None, None);
            compare::<1, _>(&block([70.0, 0.0, 0.0]), BondBasedLinear, influence, rule, None, None);
            compare::<2, _>(&block([37.0, 22.0, 0.0]), BondBased, influence, rule, None, None);
            compare::<2, _>(&block([37.0, 22.0, 0.0]), BondBasedLinear, influence, rule, None, None);
        }
        compare::<3, _>(&block([12.0, 9.0, 8.0]), BondBased, influence, PartialVolume::Ramp, None, None);
        compare::<3, _>(&block([12.0, 9.0, 8.0]), BondBasedLinear, influence, PartialVolume::None, None, None);
    }
    compare::<3, _>(&block([9.0, 8.0, 7.0]), BondBased, Influence::Linear, PartialVolume::Exact, None, None);
}

#[test]
fn a_disk_and_a_ball_on_a_lattice_are_the_same_points_as_a_cloud() {
    let disk = Shape::Ball { center: [1.2 * SPACING, -0.4 * SPACING], radius: 20.6 * SPACING };
    let ball = Shape::Ball { center: [0.0, 0.1 * SPACING, 0.0], radius: 6.2 * SPACING };
    for rule in PartialVolume::ALL {
        compare::<2, _>(&disk, BondBased, Influence::Constant, rule, None, None);
        compare::<2, _>(&disk, BondBasedLinear, Influence::Parabolic, rule, None, None);
    }
    compare::<3, _>(&ball, BondBased, Influence::Constant, PartialVolume::Ramp, None, None);
}

#[test]
fn a_lattice_and_a_cloud_are_cut_and_break_alike() {
    let crack = Crack::Polyline(vec![[0.0, 0.0], [0.02, 0.003]]);
    for rule in PartialVolume::ALL {
        compare::<2, _>(&block([37.0, 22.0, 0.0]), BondBased, Influence::Constant, rule, Some(0.004), Some(&crack));
    }
    let disk = Shape::Ball { center: [1.2 * SPACING, -0.4 * SPACING], radius: 20.6 * SPACING };
    compare::<2, _>(&disk, BondBased, Influence::Linear, PartialVolume::Ramp, Some(0.004), Some(&crack));
    let penny = Crack::Disc { center: [0.005, -0.003, 0.0043], normal: [0.1, 0.2, 1.0], radius: 0.003 };
    let cube = block([12.0, 9.0, 8.0]);
    compare::<3, _>(&cube, BondBased, Influence::Constant, PartialVolume::Ramp, Some(0.004), Some(&penny));
    compare::<1, _>(&block([400.0, 0.0, 0.0]), BondBased, Influence::Constant, PartialVolume::None, Some(0.004), None);
}

#[test]
fn forces_and_broken_bonds_have_the_same_bits_on_any_number_of_threads() {
    fn check<const D: usize>(cloud: Cloud<D>, failure: Option<CriticalStretch>) {
        let (body, physics) = model(cloud, BondBased, Influence::Constant, PartialVolume::Ramp, failure);
        let bits = |threads| {
            on_threads(threads, || {
                let state = evaluated(&body, &physics, None);
                let force: Vec<[u64; D]> = forces(&body, &state).iter().map(|f| f.map(f64::to_bits)).collect();
                let density = physics.energy_density(&state);
                let slots = &body.cloud.slots;
                let sum = Exec::default().sum(slots.len(), &|points: Range<usize>| {
                    [slots[points].iter().map(|&s| density[s as usize]).sum(), 0.0, 0.0, 0.0]
                })[0];
                (force, state.states.bytes(), state.broken.bonds, state.broken.energy.to_bits(), sum.to_bits())
            })
        };
        let one = bits(1);
        for threads in THREADS {
            assert!(one == bits(threads), "{threads} threads");
        }
    }
    // Some ten chunks each, of 1,024 slots on a lattice and 512 points in a cloud.
    let plate = Cloud::lattice(&block::<2>([131.0, 77.0, 0.0]), SPACING, 5);
    let solid = Cloud::lattice(&block::<3>([25.0, 20.0, 17.0]), SPACING, 5);
    for failure in [None, Some(CriticalStretch::uniform(0.004))] {
        check(scattered(&plate), failure.clone());
        check(plate.clone(), failure.clone());
        check(solid.clone(), failure);
    }
}

/// A plate with a crack from one side, drawn apart until it runs.
fn cracked_plate(energy: f64, cloud: bool, precision: &str) -> Simulation {
    let perturb = if cloud { "perturb = { amplitude = 0.0 }" } else { "" };
    let text = format!(
        r#"
[case]
title = "A small plate with a crack"
dimension = 2
[geometry]
shape = {{ rectangle = {{ size = [0.04, 0.0203] }} }}
spacing = 7e-4
cracks = [{{ segment = {{ from = [-0.021, 0.0004], to = [-0.007, 0.0011] }} }}]
{perturb}
[sets]
top = {{ where = "y > 0.0203/2 - 0.0007" }}
bottom = {{ where = "y < -0.0203/2 + 0.0007" }}
[discretization]
horizon_ratio = 3.0
precision = "{precision}"
[physics.elasticity]
law = {{ bond_based = {{ young = "72 GPa", density = 2440.0 }} }}
failure = {{ critical_stretch = {{ fracture_energy = {energy:?}, no_fail = ["top", "bottom"] }} }}
[[conditions]]
on = "top"
load = {{ traction = {{ component = 1, value = "8 MPa" }} }}
[[conditions]]
on = "bottom"
load = {{ traction = {{ component = 1, value = "-8 MPa" }} }}
[solver.velocity_verlet]
end_time = 2e-5
safety = 0.8
"#
    );
    build(&read_text::<Case>("plate", &text, &[]).unwrap(), &Options::default()).unwrap()
}

fn marched(mut simulation: Simulation) -> Simulation {
    simulation.model.start();
    while simulation.clock.step < simulation.n_steps {
        simulation.model.step(&simulation.solver, &mut simulation.clock).unwrap();
    }
    simulation
}

#[test]
fn a_run_ends_in_the_same_bits_on_any_number_of_threads() {
    for (cloud, precision) in [false, true].into_iter().flat_map(|c| ["double", "single", "mixed"].map(|p| (c, p))) {
        let run = |threads| {
            on_threads(threads, || {
                let mut s = marched(cracked_plate(3.8, cloud, precision));
                let balance = s.model.balance();
                (s.model.hash(), s.model.broken_pairs(), balance)
            })
        };
        let one = run(1);
        assert!(one.1 > 200, "the crack runs: {} broken bonds", one.1);
        for threads in &THREADS[1..] {
            assert!(one == run(*threads), "{threads} threads, cloud: {cloud}, {precision}");
        }
    }
}

#[test]
fn a_run_on_a_cloud_breaks_the_bonds_that_the_lattice_breaks() {
    let lattice = marched(cracked_plate(3.8, false, "double")).model.broken_pairs();
    // No bond is near a tie: a hundred-millionth more or less of the critical stretch, far above what rounding does to
    // stretches in some hundred steps, breaks as many.
    for factor in [1.0 - 2e-8, 1.0 + 2e-8] {
        assert_eq!(
            marched(cracked_plate(3.8 * factor, false, "double")).model.broken_pairs(),
            lattice,
            "a tie at {factor}"
        );
    }
    let (mut lattice, mut cloud) =
        (marched(cracked_plate(3.8, false, "double")), marched(cracked_plate(3.8, true, "double")));
    assert_eq!(lattice.model.broken_pairs(), cloud.model.broken_pairs());
    assert_eq!(lattice.model.family_sizes(), cloud.model.family_sizes());
    let (a, b) = (lattice.model.balance(), cloud.model.balance());
    // Rounding of 1e-16 grows with the steps and with the stretches of broken bonds' ends, by no more than this.
    assert!((a.fracture / b.fracture - 1.0).abs() < 1e-9, "{} {}", a.fracture, b.fracture);
    assert!((a.kinetic / b.kinetic - 1.0).abs() < 1e-9, "{} {}", a.kinetic, b.kinetic);
}

/// A notched block of points from a table, in the order of `order`, pulled at its ends until it tears.
fn imported_block(order: &[usize], label: &str) -> Simulation {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut next = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
    let mut rows = Vec::new();
    for k in 0..order.len() {
        let cell = [k % 20, k / 20 % 12, k / 240];
        let x = cell.map(|c| SPACING * (c as f64 + 0.3 * next()));
        let volume = SPACING.powi(3) * (1.0 + 0.2 * next());
        let set = match cell[0] {
            0 | 1 => "left",
            18 | 19 => "right+grip",
            _ => "",
        };
        rows.push(format!("{},{},{},{volume},{set}\n", x[0], x[1], x[2]));
    }
    let table: String = order.iter().map(|&k| rows[k].as_str()).collect();
    let folder = std::env::temp_dir().join(format!("bondwise_parity_{}_{label}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("points.csv"), format!("x,y,z,volume,sets\n{table}")).unwrap();
    let text = r#"
[case]
title = "A block of points from a table"
dimension = 3
[geometry]
points = { csv = { file = "points.csv" } }
cracks = [{ disc = { center = [0.0095, 0.0, 0.003], normal = [1.0, 0.1, 0.0], radius = 0.004 } }]
[sets]
middle = { where = "abs(x - 0.0095) < 0.002" }
[discretization]
horizon_ratio = 3.0
partial_volumes = "ramp"
[physics.elasticity]
law = { bond_based = { young = "72 GPa", density = 2440.0 } }
failure = { critical_stretch = { stretch = 2e-3, no_fail = ["left", "grip"] } }
[[conditions]]
on = "right"
prescribe = { velocity = { component = 0, value = "5 * (1 + 100 * y)" } }
[[conditions]]
on = "left"
prescribe = { displacement = { component = 0, value = 0.0 } }
[[conditions]]
on = "middle"
load = { body_force = { component = 1, value = "1e9 * x" } }
[solver.velocity_verlet]
end_time = 1.2e-5
safety = 0.8
"#;
    let options = Options { base: folder.clone(), ..Options::default() };
    let simulation = build(&read_text::<Case>("block", text, &[]).unwrap(), &options).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    simulation
}

#[test]
fn a_run_does_not_depend_on_the_order_of_the_points() {
    let in_rows: Vec<usize> = (0..20 * 12 * 7).collect();
    let mut shuffled = in_rows.clone();
    let mut random = ChaCha8Rng::seed_from_u64(4);
    for k in (1..shuffled.len()).rev() {
        shuffled.swap(k, (random.next_u64() % (k as u64 + 1)) as usize);
    }
    let mut a = marched(imported_block(&in_rows, "in_rows"));
    let mut b = marched(imported_block(&shuffled, "shuffled"));
    assert!(a.model.broken_pairs() > 50, "the block tears: {} broken bonds", a.model.broken_pairs());
    assert_eq!(a.model.broken_pairs(), b.model.broken_pairs());
    assert_eq!((a.model.facts().bonds, a.model.facts().cut_bonds), (b.model.facts().bonds, b.model.facts().cut_bonds));
    let (bonds_a, bonds_b) = (a.model.family_sizes(), b.model.family_sizes());
    let (Sizes::Each(sizes_a), Sizes::Each(sizes_b)) = (a.model.points().sizes(), b.model.points().sizes()) else {
        panic!("a cloud")
    };
    for (k, &point) in shuffled.iter().enumerate() {
        assert_eq!(a.model.positions()[point], b.model.positions()[k]);
        assert_eq!(sizes_a[point], sizes_b[k]);
        assert_eq!(bonds_a[point], bonds_b[k]);
    }
    // The mean volume, and with it horizon and weights, is rounded in another order: some 1e-16 that the steps carry on.
    let tolerance = 1e-12;
    for name in ["displacement", "velocity", "damage"] {
        let values = |model: &mut Simulation| match model.model.field(name).unwrap().values {
            Values::Scalar(values) => values.into_iter().map(|v| [v, 0.0, 0.0]).collect(),
            Values::Vector(values) => values,
            others => panic!("{name}: {others:?}"),
        };
        let (a, b): (Vec<[f64; 3]>, _) = (values(&mut a), values(&mut b));
        let largest = a.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
        for (k, &point) in shuffled.iter().enumerate() {
            for d in 0..3 {
                let (a, b) = (a[point][d], b[k][d]);
                assert!((a - b).abs() <= tolerance * largest, "{name} of point {point}: {a:e} {b:e} of {largest:e}");
            }
        }
    }
    let (a, b) = (a.model.balance(), b.model.balance());
    assert!((a.kinetic / b.kinetic - 1.0).abs() < tolerance, "{} {}", a.kinetic, b.kinetic);
    assert!((a.external / b.external - 1.0).abs() < tolerance, "{} {}", a.external, b.external);
}
