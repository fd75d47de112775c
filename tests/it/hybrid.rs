//! The hybrid scheme: rows against a plain loop, the switch, what it may never miss, and bits.

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::discretization::collocation::{SharedRow, SharedSlope};
use bondwise::discretization::{Collocation, Influence, PartialVolume, Regions, standard};
use bondwise::execution::{Exec, Instructions, Limits, Motion, Packs};
use bondwise::family::BondStates;
use bondwise::field::{Double, Field, Mixed, Number, Single, Values, components, components_mut};
use bondwise::geometry::{Arrangement, Cloud, Shape};
use bondwise::simulation::Simulation;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

const H: f64 = 1e-3;

/// Rows of a block of cells, applied to random displacements on every set of instructions, beside a plain loop.
fn compare_rows<const D: usize, P: Packs>(cells: [f64; D], points: usize, tolerance: f64) {
    let shape = Shape::Box { low: [0.0; D], high: cells.map(|n| n * H) };
    let body = standard::body(Cloud::lattice(&shape, H, 5), 4.0 * H, PartialVolume::Ramp);
    let Arrangement::Lattice(lattice) = &body.cloud.arrangement else { unreachable!() };
    let collocation = Collocation { order: 2, points, exponent: 9.0 };
    let fit = collocation.on_lattice::<D>(H, 4.0 * H).unwrap();
    let weights = fit.elastic(&Influence::Constant, 1e20);
    let row = SharedRow::new(lattice, &fit, &weights).unwrap();
    assert_eq!(row.n_nodes(), fit.nodes.len());
    // Some points in the middle sum their bonds, so that blocks are mixed.
    let few = body.cloud.slots.iter().copied().filter(|slot| slot % 7 == 3);
    let regions = Regions::new(&body, &BondStates::whole(&body), few, 1);
    assert!(!regions.mixed.is_empty() && regions.collocated_points() > 20);
    let n = body.cloud.n_slots();
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut displacement = vec![P::Field::default(); D * n];
    for component in components_mut::<D, _>(&mut displacement) {
        for &slot in &body.cloud.slots {
            let unit = (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
            component[slot as usize] = P::Field::from_f64(2e-2 * H * (unit - 0.5));
        }
    }
    let u = components::<D, _>(&displacement);
    let at = |d: usize, slot: usize, shift: isize| u[d][slot.wrapping_add_signed(shift)].to_f64();
    let limits = Limits { strain: 0.012, linear: false, gradient: 0.035 };
    let mut reference: Option<(Vec<P::Field>, Vec<u32>)> = None;
    for instructions in Instructions::available() {
        let untouched = P::Field::from_f64(-7.0);
        let mut force = vec![untouched; D * n];
        let mut density = vec![untouched; n];
        let mut exec = Exec::on(instructions);
        let output = components_mut::<D, _>(&mut force);
        let beyond = exec.collocate::<D, P>(&body, &row, &regions, &regions.collocated, u, output, &limits);
        exec.row_energy::<D, P>(&body, &row, &regions, u, &mut density);
        let [mut asked, mut passed] = [0; 2];
        for slot in 0..n {
            if !regions.has_row(slot) {
                assert!((0..D).all(|d| force[d * n + slot] == untouched) && density[slot] == untouched);
                continue;
            }
            let (mut sum, mut size, mut energy) = ([0.0; D], 0.0, [0.0; 2]);
            for (step, weight) in fit.steps.as_ref().unwrap().iter().zip(&weights) {
                let shift = lattice.shift(*step);
                let eta: [f64; D] = std::array::from_fn(|d| at(d, slot, shift) - at(d, slot, 0));
                for a in 0..D {
                    for b in 0..D {
                        sum[a] += weight[a][b] * eta[b];
                        size += (weight[a][b] * eta[b]).abs();
                        energy[0] += 0.25 * eta[a] * weight[a][b] * eta[b];
                        energy[1] += (0.25 * eta[a] * weight[a][b] * eta[b]).abs();
                    }
                }
            }
            for d in 0..D {
                let defect = (force[d * n + slot].to_f64() - sum[d]).abs();
                assert!(defect <= tolerance * size, "{D}D {instructions:?} {d}: {defect:e} of {size:e}");
            }
            assert!((density[slot].to_f64() - energy[0]).abs() <= tolerance * energy[1]);
            // How far it is strained, in the words of `Exec::collocate`.
            let one_sided = |sign: isize| -> [[f64; D]; D] {
                std::array::from_fn(|i| {
                    std::array::from_fn(|d| {
                        let shift = sign * lattice.strides[d] as isize;
                        sign as f64 * (at(i, slot, shift) - at(i, slot, 0)) / H
                    })
                })
            };
            let (ahead, behind) = (one_sided(1), one_sided(-1));
            let mean = |i: usize, d: usize| 0.5 * (ahead[i][d] + behind[i][d]);
            let normal = |g: &[[f64; D]; D], a: usize| g[a][a] + 0.5 * (0..D).map(|i| g[i][a].powi(2)).sum::<f64>();
            let e: [f64; D] = std::array::from_fn(|a| normal(&ahead, a).max(normal(&behind, a)));
            let average = e.iter().sum::<f64>() / D as f64;
            let mut square: f64 = e.iter().map(|e| (e - average).powi(2)).sum();
            for (a, b) in (0..D).flat_map(|a| (0..a).map(move |b| (a, b))) {
                let products: f64 = (0..D).map(|i| mean(i, a) * mean(i, b)).sum();
                square += 0.5 * (mean(a, b) + mean(b, a) + products).powi(2);
            }
            let strain = average + ((D as f64 - 1.0) / D as f64 * square).sqrt();
            let gradient = (0..D * D).map(|k| mean(k / D, k % D).powi(2)).sum::<f64>().sqrt();
            let most = (strain / limits.strain).max((gradient / limits.gradient).powi(2));
            asked += 1;
            passed += usize::from(most > 1.0);
            if (most - 1.0).abs() > 1e-4 {
                assert_eq!(most > 1.0, beyond.contains(&(slot as u32)), "{D}D {instructions:?}: {most}");
            }
        }
        assert!(passed > 0 && passed < asked, "{D}D: {passed} of {asked}");
        // Wider instructions agree to the last bit: those of the baseline may round twice.
        if instructions != Instructions::Baseline {
            let this = (force, beyond);
            if let Some(reference) = &reference {
                assert!(this == *reference, "{instructions:?}");
            }
            reference = Some(this);
        }
    }
}

#[test]
fn rows_are_the_plain_sums_on_every_set_of_instructions() {
    // A row of up to 32 terms of either sign, in numbers of 53 and of 24 bits.
    compare_rows::<1, Double>([70.0], 5, 1e-14);
    compare_rows::<2, Double>([45.0, 20.0], 13, 1e-14);
    compare_rows::<2, Single>([45.0, 20.0], 13, 5e-6);
    compare_rows::<2, Mixed>([45.0, 20.0], 13, 5e-6);
    compare_rows::<3, Double>([35.0, 14.0, 13.0], 33, 1e-14);
}

/// Rows that follow a motion slab by slab, beside all motion and then all rows.
fn compare_behind<const D: usize, P: Packs>(cells: [f64; D], points: usize) {
    let shape = Shape::Box { low: [0.0; D], high: cells.map(|n| n * H) };
    let body = standard::body(Cloud::lattice(&shape, H, 5), 4.0 * H, PartialVolume::Ramp);
    let Arrangement::Lattice(lattice) = &body.cloud.arrangement else { unreachable!() };
    let fit = Collocation { order: 2, points, exponent: 9.0 }.on_lattice::<D>(H, 4.0 * H).unwrap();
    let row = SharedRow::new(lattice, &fit, &fit.elastic(&Influence::Constant, 1e20)).unwrap();
    let few = body.cloud.slots.iter().copied().filter(|slot| slot % 997 == 3);
    let regions = Regions::new(&body, &BondStates::whole(&body), few, 1);
    let n = body.cloud.n_slots();
    assert!(n > 4 * 4096 && !regions.mixed.is_empty());
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let mut field = || -> Vec<P::Field> {
        let unit = |_| (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        (0..D * n).map(unit).map(|unit| P::Field::from_f64(2e-2 * H * (unit - 0.5))).collect()
    };
    let (before, old) = ([field(), field()], field());
    let limits = Limits { strain: 0.012, linear: false, gradient: 0.035 };
    // The velocity takes up the force, and the displacement a part of both.
    let pass = |u: &mut [P::Field], v: &mut [P::Field], f: &[P::Field], ahead: &mut [P::Field]| -> f64 {
        let part = P::Field::from_f64(0.25);
        let mut sum = 0.0;
        for (((u, v), f), ahead) in u.iter_mut().zip(v).zip(f).zip(ahead) {
            *v = *v + part * *f;
            *u = *u + part * *v;
            *ahead = *u + part * *v;
            sum += v.to_f64().powi(2);
        }
        sum
    };
    let [mut u, mut v] = before.clone();
    let (mut force, mut ahead) = (old.clone(), vec![P::Field::default(); D * n]);
    let squares = pass(&mut u, &mut v, &force, &mut ahead);
    let (input, output) = (components::<D, _>(&ahead), components_mut::<D, _>(&mut force));
    let mut beyond =
        Exec::default().collocate::<D, P>(&body, &row, &regions, &regions.collocated, input, output, &limits);
    beyond.sort_unstable();
    assert!(!beyond.is_empty());
    let mut reference = None;
    for threads in [1, 2, 3, 64] {
        let [mut u_behind, mut v_behind] = before.clone();
        let (mut force_behind, mut ahead_behind) = (old.clone(), vec![P::Field::default(); D * n]);
        let motion = Motion {
            displacement: &mut u_behind,
            velocity: &mut v_behind,
            force: &mut force_behind,
            damped: &mut ahead_behind,
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
        let (mut found, sum) = pool.install(|| {
            let pass = |m: Motion<'_, P::Field>| pass(m.displacement, m.velocity, m.force, m.damped);
            Exec::default().collocate_fused::<D, P>(&body, &row, &regions, motion, &limits, &pass)
        });
        found.sort_unstable();
        assert!((u_behind, v_behind, ahead_behind) == (u.clone(), v.clone(), ahead.clone()), "{D}D: motion");
        assert!(force_behind == force && found == beyond, "{D}D on {threads} threads: rows");
        // Sums of as many squares, in another order.
        assert!((sum / squares - 1.0).abs() < 1e-12, "{sum} {squares}");
        assert_eq!(sum, *reference.get_or_insert(sum));
    }
}

#[test]
fn rows_behind_a_motion_are_those_after_it() {
    compare_behind::<1, Double>([30e3], 5);
    compare_behind::<2, Double>([180.0, 110.0], 29);
    compare_behind::<2, Single>([110.0, 180.0], 29);
    compare_behind::<3, Double>([40.0, 30.0, 24.0], 33);
    // High enough for several tiles.
    compare_behind::<3, Double>([40.0, 70.0, 24.0], 33);
}

/// Slopes of a block of cells on every set of instructions, beside a plain loop.
fn compare_slopes<const D: usize>(cells: [f64; D], points: usize) {
    let shape = Shape::Box { low: [0.0; D], high: cells.map(|n| n * H) };
    let body = standard::body(Cloud::lattice(&shape, H, 5), 4.0 * H, PartialVolume::Ramp);
    let Arrangement::Lattice(lattice) = &body.cloud.arrangement else { unreachable!() };
    let fit = Collocation::new(2, points).on_lattice::<D>(H, 4.0 * H).unwrap();
    let weights = fit.dilatation(&Influence::Linear);
    let slope = SharedSlope::new(lattice, &fit, &weights).unwrap();
    let few = body.cloud.slots.iter().copied().filter(|slot| slot % 7 == 3);
    let regions = Regions::new(&body, &BondStates::whole(&body), few, 1);
    let n = body.cloud.n_slots();
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut values = vec![0.0; D * n];
    values.iter_mut().for_each(|value| *value = (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64 - 0.5);
    let u = components::<D, _>(&values);
    let mut reference: Option<(Vec<f64>, Vec<f64>)> = None;
    for instructions in Instructions::available() {
        let mut exec = Exec::on(instructions);
        let (mut divergence, mut gradient) = (vec![-7.0; n], vec![2.0; D * n]);
        let (blocks, limits) = (&regions.collocated, &Limits::NONE);
        exec.collocate_divergence::<D, Double>(&body, (&slope, 3.0), &regions, blocks, u, &mut divergence, limits);
        let output = components_mut::<D, _>(&mut gradient);
        exec.collocate_gradient::<D, Double>(&body, (&slope, 0.5), &regions, u[D - 1], output);
        for slot in 0..n {
            if !regions.has_row(slot) {
                assert!(divergence[slot] == -7.0 && (0..D).all(|d| gradient[d * n + slot] == 2.0));
                continue;
            }
            let (mut sum, mut size, mut slopes) = (0.0, 0.0, [2.0; D]);
            for (step, weight) in fit.steps.as_ref().unwrap().iter().zip(&weights) {
                let there = slot.wrapping_add_signed(lattice.shift(*step));
                for d in 0..D {
                    sum += 3.0 * weight[d] * (u[d][there] - u[d][slot]);
                    slopes[d] += 0.5 * weight[d] * (u[D - 1][there] - u[D - 1][slot]);
                    size += weight[d].abs();
                }
            }
            // Some thirty terms of either sign, the largest as large as all weights together.
            assert!((divergence[slot] - sum).abs() < 1e-14 * 3.0 * size, "{D}D {instructions:?}");
            assert!((0..D).all(|d| (gradient[d * n + slot] - slopes[d]).abs() < 1e-14 * (2.0 + size)));
        }
        if instructions != Instructions::Baseline {
            let this = (divergence, gradient);
            if let Some(reference) = &reference {
                assert!(this == *reference, "{instructions:?}");
            }
            reference = Some(this);
        }
    }
}

#[test]
fn slopes_are_the_plain_sums_on_every_set_of_instructions() {
    compare_slopes::<1>([70.0], 5);
    compare_slopes::<2>([45.0, 20.0], 13);
    compare_slopes::<3>([35.0, 14.0, 13.0], 33);
}

const BRANCHING: &str = "scheme = { hybrid = { rescale = true } }";

/// A plate of glass with a notch, pulled apart: 120 × 80 cells.
fn plate(discretization: &str, traction: &str, notch: &str) -> Simulation {
    let text = plate_text(discretization, traction, notch);
    build(&read_text::<Case>("plate", &text, &[]).unwrap(), &Options::default()).unwrap()
}

/// The same of a state-based solid, whose ratio is not that of bonds.
fn solid_plate(discretization: &str, law: &str) -> Simulation {
    let text = plate_text(discretization, "6e6", NOTCH)
        .replace("bond_based = {", &format!("{law} = {{ poisson = 0.2,"))
        .replace("50 ns", "40 ns");
    build(&read_text::<Case>("plate", &text, &[]).unwrap(), &Options::default()).unwrap()
}

fn plate_text(discretization: &str, traction: &str, notch: &str) -> String {
    format!(
        r#"
[case]
title = "A plate that tears"
dimension = 2
[geometry]
shape = {{ rectangle = {{ size = [0.03, 0.02] }} }}
spacing = 2.5e-4
{notch}
[sets]
top = {{ where = "y > 0.01 - 2.5e-4" }}
bottom = {{ where = "y < -0.01 + 2.5e-4" }}
grips = {{ where = "abs(y) > 0.009" }}
middle = {{ where = "abs(y) < 0.003" }}
[discretization]
horizon_ratio = 4.0
{discretization}
[physics.elasticity]
law = {{ bond_based = {{ young = "72 GPa", density = 2440.0 }} }}
failure = {{ critical_stretch = {{ fracture_energy = 3.8, no_fail = ["grips"] }} }}
[[conditions]]
on = "top"
load = {{ traction = {{ component = 1, value = "{traction}" }} }}
[[conditions]]
on = "bottom"
load = {{ traction = {{ component = 1, value = "-({traction})" }} }}
[[conditions]]
on = "middle"
initial = {{ velocity = {{ component = 0, value = 0.0 }} }}
[solver.velocity_verlet]
end_time = "18 us"
time_step = "50 ns"
"#
    )
}

const NOTCH: &str = "cracks = [{ segment = { from = [-0.015, 0.0], to = [-0.005, 0.0] } }]";
const CELLS: [usize; 2] = [120, 80];

fn run(simulation: &mut Simulation, mut look: impl FnMut(&mut Simulation)) {
    simulation.model.start();
    look(simulation);
    while simulation.clock.step < simulation.n_steps {
        simulation.model.step(&simulation.solver, &mut simulation.clock).unwrap();
        look(simulation);
    }
}

fn scalars(simulation: &mut Simulation, name: &str) -> Vec<f64> {
    match simulation.model.field(name) {
        Some(Field { values: Values::Scalar(values), .. }) => values,
        _ => panic!("{name} is a scalar"),
    }
}

/// The largest stretch of the bonds of each point, whole or not.
fn stretches(simulation: &mut Simulation) -> Vec<f64> {
    let Some(Field { values: Values::Vector(u), .. }) = simulation.model.field("displacement") else { panic!() };
    let reach = 4i64;
    let [nx, ny] = CELLS.map(|n| n as i64);
    let stretch = |x: i64, y: i64| {
        let mut most = 0.0f64;
        for (a, b) in (-reach..=reach).flat_map(|a| (-reach..=reach).map(move |b| (a, b))) {
            let length = ((a * a + b * b) as f64).sqrt();
            if length == 0.0 || length >= 4.5 || !(0..nx).contains(&(x + a)) || !(0..ny).contains(&(y + b)) {
                continue;
            }
            let [here, there] = [u[(x + nx * y) as usize], u[(x + a + nx * (y + b)) as usize]];
            let eta = [(there[0] - here[0]) / 2.5e-4, (there[1] - here[1]) / 2.5e-4];
            most = most.max((a as f64 + eta[0]).hypot(b as f64 + eta[1]) / length - 1.0);
        }
        most
    };
    (0..nx * ny).map(|k| stretch(k % nx, k / nx)).collect()
}

/// The full criterion (65), bond by bond, beside the cheap one.
#[test]
fn no_bond_of_a_row_passes_the_critical_stretch_unseen() {
    let mut torn = plate(BRANCHING, "6e6", NOTCH);
    let critical = torn.model.facts().physics.elastic().and_then(|e| e.critical_stretch).unwrap();
    let (mut most, mut before) = (0.0f64, Vec::new());
    run(&mut torn, |torn| {
        let (scheme, damage, stretch) = (scalars(torn, "scheme"), scalars(torn, "damage"), stretches(torn));
        for (point, stretch) in stretch.iter().enumerate() {
            if scheme[point] == 0.0 {
                assert!(damage[point] == 0.0, "no row at damaged points");
                most = most.max(stretch / critical);
            }
            assert!(before.is_empty() || scheme[point] >= before[point], "nothing switches back");
        }
        before = scheme;
    });
    let work = torn.model.hybrid().unwrap();
    assert!(torn.model.broken_pairs() > 1000 && work.standard[0] > work.standard[1] + 0.05, "{work:?}");
    println!("largest stretch of a bond of a point with a row: {most:.3} of the critical one, asked to switch at 0.7");
    // None passes; those that are longer than a spacing may be ahead of the share at which the nearest points are asked.
    assert!(most < 1.0, "{most}");
}

/// Runs both and compares their cracks, the work of the loads and the balance of energy.
fn compare_cracks([mut hybrid, mut bonds]: [Simulation; 2]) {
    run(&mut hybrid, |_| ());
    run(&mut bonds, |_| ());
    let [one, other] = [scalars(&mut hybrid, "damage"), scalars(&mut bonds, "damage")];
    // Points of either crack that are farther than a horizon from the other.
    let cracked = |damage: &[f64]| -> Vec<[i64; 2]> {
        let [nx, ny] = CELLS;
        (0..nx * ny).filter(|&k| damage[k] > 0.35).map(|k| [(k % nx) as i64, (k / nx) as i64]).collect()
    };
    let [one, other] = [cracked(&one), cracked(&other)];
    let astray = |a: &[[i64; 2]], b: &[[i64; 2]]| {
        let near = |p: &[i64; 2]| b.iter().any(|q| (p[0] - q[0]).pow(2) + (p[1] - q[1]).pow(2) <= 16);
        a.iter().filter(|p| !near(p)).count()
    };
    let count = astray(&one, &other) + astray(&other, &one);
    println!("{} and {} damaged points, {count} of them astray", one.len(), other.len());
    assert!(one.len() > 150 && count * 20 < one.len() + other.len());
    let [hybrid, bonds] = [hybrid, bonds].map(|mut simulation| simulation.model.balance());
    println!("{hybrid:?}\n{bonds:?}");
    // Where the crack is after the same time changes what the loads have done.
    assert!((hybrid.external / bonds.external - 1.0).abs() < 0.02);
    assert!(hybrid.defect().abs() < 0.01 * hybrid.scale(), "{}", hybrid.defect() / hybrid.scale());
}

#[test]
fn rows_and_bonds_give_the_crack_of_bonds_alone() {
    compare_cracks([plate(BRANCHING, "6e6", NOTCH), plate("", "6e6", NOTCH)]);
}

#[test]
fn rows_of_a_state_based_solid_give_the_crack_of_its_bonds_alone() {
    let hybrid = "scheme = { hybrid = {} }";
    compare_cracks([solid_plate(hybrid, "state_based"), solid_plate("", "state_based")]);
}

/// Uniform strain of a state-based solid: energy by the moduli, and no force, in rows, in bonds and between.
#[test]
fn a_uniformly_strained_state_based_solid_is_at_rest_across_the_schemes() {
    let (e, poisson, strains) = (72e9, 0.2, [3e-5, -1e-5, 4e-5]);
    let text = plate_text("scheme = { hybrid = {} }", "0", "")
        .replace("bond_based = {", "state_based_linear = { poisson = 0.2,")
        .replace("50 ns", "40 ns")
        .replace("[solver.velocity_verlet]", &format!(
            "[[conditions]]\non = \"all\"\ninitial = {{ displacement = {{ component = 0, value = \"{:e} * x + {:e} * y\" }} }}\n\
             [[conditions]]\non = \"all\"\ninitial = {{ displacement = {{ component = 1, value = \"{:e} * y\" }} }}\n\
             [solver.velocity_verlet]",
            strains[0], strains[2], strains[1]
        ));
    let mut body = build(&read_text::<Case>("plate", &text, &[]).unwrap(), &Options::default()).unwrap();
    body.model.start();
    let (scheme, energy) = (scalars(&mut body, "scheme"), scalars(&mut body, "strain_energy"));
    let Some(Field { values: Values::Vector(force), .. }) = body.model.field("force") else { panic!() };
    let [x, y, xy] = strains;
    let exact = 0.5 * e / (1.0 - poisson * poisson) * (x * x + y * y + 2.0 * poisson * x * y)
        + 0.25 * e / (1.0 + poisson) * xy * xy;
    let [nx, ny] = CELLS;
    let mut rows = 0;
    for k in 0..nx * ny {
        if scheme[k] == 0.0 {
            rows += 1;
            assert!((energy[k] / exact - 1.0).abs() < 1e-10, "{} against {exact}", energy[k]);
        }
        // What bonds pull with is the stress over the spacing; two passes reach two horizons of four spacings.
        let [i, j] = [k % nx, k / nx];
        if i.min(nx - 1 - i).min(j).min(ny - 1 - j) >= 8 {
            assert!(force[k].iter().all(|f| f.abs() < 1e-10 * e * xy / 2.5e-4), "{i} {j}: {:?}", force[k]);
        }
    }
    assert!(rows > 3000);
}

#[test]
fn the_same_bits_on_any_number_of_threads_and_in_mirrored_halves() {
    let bits = |make: &(dyn Fn() -> Simulation + Sync)| {
        let run_on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
            pool.install(|| {
                let mut torn = make();
                run(&mut torn, |_| ());
                (torn.model.hash(), scalars(&mut torn, "damage"), scalars(&mut torn, "scheme"))
            })
        };
        let (hash, damage, scheme) = run_on(1);
        for threads in [2, 3] {
            assert_eq!(run_on(threads).0, hash);
        }
        let [nx, ny] = CELLS;
        for field in [damage, scheme] {
            for k in 0..nx * ny {
                assert_eq!(field[k], field[k % nx + nx * (ny - 1 - k / nx)]);
            }
        }
    };
    bits(&|| plate(BRANCHING, "6e6", NOTCH));
    bits(&|| solid_plate("scheme = { hybrid = {} }", "state_based"));
}

#[test]
fn kicks_that_are_left_to_the_next_step_are_those_of_whole_steps() {
    let bits = |make: &dyn Fn() -> Simulation| {
        let hashes = [1, 7, u64::MAX].map(|every| {
            let mut torn = make();
            // What looks at velocities gives them the kick.
            run(&mut torn, |torn| {
                if torn.clock.step.is_multiple_of(every) {
                    torn.model.field("velocity").expect("a field");
                }
            });
            torn.model.hash()
        });
        assert!(hashes.iter().all(|hash| *hash == hashes[0]));
    };
    bits(&|| plate(BRANCHING, "6e6", NOTCH));
    bits(&|| plate("", "6e6", NOTCH));
    bits(&|| solid_plate("scheme = { hybrid = {} }", "state_based"));
}

#[test]
fn where_all_points_sum_their_bonds_it_is_the_standard_scheme() {
    let all = "scheme = { hybrid = { standard = [\"all\"], damping = 0.0 } }";
    let hashes = [all, ""].map(|discretization| {
        let mut torn = plate(discretization, "6e6", NOTCH);
        run(&mut torn, |_| ());
        torn.model.hash()
    });
    assert_eq!(hashes[0], hashes[1]);
    let hashes = [all, ""].map(|discretization| {
        let mut torn = solid_plate(discretization, "state_based");
        run(&mut torn, |_| ());
        torn.model.hash()
    });
    assert_eq!(hashes[0], hashes[1]);
}

#[test]
fn fixed_regions_stay_and_break_in_the_zone_only() {
    let fixed = "scheme = { hybrid = { adaptive = false, standard = [\"middle\"], rescale = true } }";
    let mut torn = plate(fixed, "6e6", NOTCH);
    let mut first = Vec::new();
    run(&mut torn, |torn| {
        let scheme = scalars(torn, "scheme");
        if first.is_empty() {
            first = scheme.clone();
        }
        assert!(first == scheme);
    });
    let damage = scalars(&mut torn, "damage");
    let rows = |k: &usize| first[*k] == 0.0;
    assert!((0..damage.len()).filter(rows).all(|k| damage[k] == 0.0));
    assert!(torn.model.broken_pairs() > 1000 && first.contains(&0.0));
}

/// A body that turns as a whole leaves the range in which rows, which are linear, are right.
#[test]
fn points_that_turn_far_sum_their_bonds() {
    let text = r#"
[case]
title = "A block that turns"
dimension = 2
[geometry]
shape = { rectangle = { size = [0.03, 0.02] } }
spacing = 5e-4
[discretization]
horizon_ratio = 4.0
scheme = { hybrid = { largest_gradient = 0.01 } }
[physics.elasticity]
law = { bond_based = { young = "72 GPa", density = 2440.0 } }
[[conditions]]
on = "all"
initial = { velocity = { component = 0, value = "-100 * y" } }
[[conditions]]
on = "all"
initial = { velocity = { component = 1, value = "100 * x" } }
[solver.velocity_verlet]
end_time = "200 us"
"#;
    let mut block = build(&read_text::<Case>("block", text, &[]).unwrap(), &Options::default()).unwrap();
    let mut standard = Vec::new();
    run(&mut block, |block| standard.push(block.model.hybrid().unwrap().standard[0]));
    // |∇u| = √2 ω t.
    let switched = standard.iter().position(|&share| share == 1.0).expect("it turns by 0.02");
    let time = switched as f64 * block.clock.dt;
    assert!(standard[0] < 0.9 && (time / (0.01 / 2f64.sqrt() / 100.0) - 1.0).abs() < 0.05, "{time}");
}

/// Rows and bonds are no symmetric operator, whose motion grows; damped as a whole it does not.
#[test]
fn energy_does_not_grow_after_a_pulse() {
    let pulse = |law: &str, damping: &str, step: f64| {
        let text = format!(
            r#"
[case]
title = "A pulse"
dimension = 2
[geometry]
shape = {{ rectangle = {{ size = [40.0, 30.0] }} }}
spacing = 1.0
[discretization]
horizon_ratio = 4.0
scheme = {{ hybrid = {{ {damping} }} }}
[physics.elasticity]
law = {{ {law}, young = 1.0, density = 1.0 }} }}
[[conditions]]
on = "all"
initial = {{ displacement = {{ component = 0, value = "1e-3 * exp(-((x - 3)^2 + y^2) / 25)" }} }}
[solver.velocity_verlet]
end_time = 2000.0
time_step = {step}
"#
        );
        let mut body = build(&read_text::<Case>("pulse", &text, &[]).unwrap(), &Options::default()).unwrap();
        let mut energies = Vec::new();
        body.model.start();
        while body.clock.step < body.n_steps {
            if body.clock.step.is_multiple_of(20) {
                let balance = body.model.balance();
                energies.push(balance.kinetic + balance.strain);
            }
            if body.model.step(&body.solver, &mut body.clock).is_err() {
                energies.push(f64::INFINITY);
                break;
            }
        }
        energies
    };
    let bonds = "bond_based_linear = { plane = \"stress\"";
    let solids = [-0.3, 0.2, 0.45].map(|poisson| format!("state_based_linear = {{ poisson = {poisson}"));
    let solids = solids.iter().map(|law| (&law[..], "", 0.5));
    for (law, damping, step) in std::iter::once((bonds, "rescale = true, damping = 0.05", 1.0)).chain(solids) {
        let damped = pulse(law, damping, step);
        // A hundredth: what rows and bonds exchange may be of either sign as long as waves are short.
        assert!(damped.windows(2).all(|pair| pair[1] <= 1.01 * pair[0]), "{law}: {damped:?}");
        assert!(damped[damped.len() - 1] < 0.1 * damped[0], "{law}: {damped:?}");
    }
    for growing in ["rescale = true, damping = 0.0", "rescale = true, damp_bonds = false"] {
        let energies = pulse(bonds, growing, 1.0);
        assert!(energies[energies.len() - 1] > 10.0 * energies[0], "{growing}: {energies:?}");
    }
}
