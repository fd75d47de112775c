//! Bodies of several materials, from their cases: what is the same as one material is the same to the bit, what differs is
//! what the closed forms say.

use bondwise::case::{Case, Options, build, read_text};
use bondwise::field::Values;
use bondwise::simulation::Simulation;

/// A box of two halves, or of one material; `law` and `materials` are the tables of the physics.
fn text(dimension: usize, perturb: bool, materials: &str, physics: &str) -> String {
    let size = &["0.064", "0.064, 0.02", "0.032, 0.02, 0.016"][dimension - 1];
    let counts = size.split(", ").map(|l| format!("{:?}", -0.5 * l.parse::<f64>().unwrap())).collect::<Vec<_>>();
    let high = size.split(", ").map(|l| format!("{:?}", 0.5 * l.parse::<f64>().unwrap())).collect::<Vec<_>>();
    let perturb = if perturb { "perturb = { amplitude = 0.2, seed = 3 }" } else { "" };
    format!(
        r#"
[case]
title = "Two halves"
dimension = {dimension}
[geometry]
shape = {{ box = {{ low = [{}], high = [{}] }} }}
spacing = 1e-3
{perturb}
[sets]
left = {{ where = "x < 0" }}
right = {{ not = {{ where = "x < 0" }} }}
[discretization]
horizon_ratio = 3
{materials}
[physics.elasticity]
{physics}
[[conditions]]
on = "left"
initial = {{ velocity = {{ component = 0, value = "-1 + 100*x" }} }}
[[conditions]]
on = "right"
initial = {{ velocity = {{ component = 0, value = "1" }} }}
[solver.velocity_verlet]
end_time = 4e-6
time_step = 4e-8
"#,
        counts.join(", "),
        high.join(", ")
    )
}

fn simulation(text: &str, overrides: &[(&str, &str)]) -> Simulation {
    let overrides: Vec<_> = overrides.iter().map(|(k, v)| ((*k).to_string(), (*v).to_string())).collect();
    let case = read_text::<Case>("case.toml", text, &overrides).unwrap_or_else(|e| panic!("{e}\n{text}"));
    build(&case, &Options::default()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn run(simulation: &mut Simulation) {
    let Simulation { model, solver, clock, n_steps, .. } = simulation;
    model.start();
    while clock.step < *n_steps {
        model.step(solver, clock).unwrap();
    }
    model.conclude(solver, clock).unwrap();
}

const ONE: &str = "young = 72e9\ndensity = 2440\nfracture_energy = 3.8\n";
const LAWS: [(&str, &str); 4] = [
    ("bond_based", ""),
    ("bond_based_linear", ""),
    ("state_based", "poisson = 0.2"),
    ("state_based_linear", "poisson = 0.2"),
];

#[test]
fn two_materials_of_the_same_values_are_one_to_the_bit() {
    for (law, poisson) in LAWS {
        for dimension in 1..=3 {
            for perturb in [false, true] {
                for precision in ["double", "single", "mixed"] {
                    let poisson = if dimension == 1 { "" } else { poisson };
                    let separator = if poisson.is_empty() { "" } else { ", " };
                    let failure = "failure = { critical_stretch = { fracture_energy = 3.8 } }";
                    let law_of = |values: &str| format!("law = {{ {law} = {{ {values} }} }}\n");
                    let one = text(
                        dimension,
                        perturb,
                        "",
                        &(law_of(&format!("young = 72e9, density = 2440{separator}{poisson}")) + failure),
                    );
                    let two = text(
                        dimension,
                        perturb,
                        &format!("[materials.a]\n{ONE}[materials.b]\n{ONE}"),
                        &(law_of(poisson)
                            + "materials = { a = \"left\", b = \"right\" }\nfailure = { critical_stretch = {} }"),
                    );
                    let hash = |text: &str| {
                        let mut simulation = simulation(text, &[("discretization.precision", precision)]);
                        run(&mut simulation);
                        (simulation.model.hash(), simulation.model.broken_pairs())
                    };
                    let (one, two) = (hash(&one), hash(&two));
                    assert!(one == two && one.1 > 0, "{law} {dimension}D {precision} {perturb}: {one:?} {two:?}");
                }
            }
        }
    }
}

#[test]
fn energy_and_momentum_of_unlike_halves_balance() {
    for (law, poisson) in LAWS {
        for perturb in [false, true] {
            for solver in ["velocity_verlet", "runge_kutta"] {
                let materials = format!(
                    "[materials.a]\n{ONE}\n[materials.b]\nyoung = 10e9\ndensity = 1000\ncritical_stretch = 1e-3\n\
                     random = {{ seed = 3, length = 5e-3, young = 0.2, density = 0.1, critical_stretch = 0.3 }}\n"
                );
                let physics = format!(
                    "law = {{ {law} = {{ {poisson} }} }}\nmaterials = {{ a = \"left\", b = \"right\" }}\n\
                     interfaces = [{{ between = [\"a\", \"b\"], fracture_energy = 1.0 }}]\n\
                     failure = {{ critical_stretch = {{}} }}"
                );
                let mut text = text(2, perturb, &materials, &physics).replace("velocity_verlet", solver);
                text = text.replace("time_step = 4e-8", "time_step = 2e-8");
                let mut simulation = simulation(&text, &[]);
                run(&mut simulation);
                let balance = simulation.model.balance();
                let label = format!("{law} {perturb} {solver}: {balance:?}");
                assert!(simulation.model.broken_pairs() > 100, "{label}");
                // What is kept is kept to the rounding of sums of some thousand numbers.
                assert!(balance.momentum_defect < 1e-12 * balance.momentum_scale, "{label}");
                // Bonds that break within a step of a tenth of the stable one: velocity Verlet books them of second order,
                // Runge-Kutta of first.
                assert!(balance.defect().abs() < 2e-2 * balance.scale(), "{label}");
            }
        }
    }
}

/// Largest difference of a field from a formula of the position.
fn difference(simulation: &mut Simulation, component: usize, exact: impl Fn(&[f64; 3]) -> f64) -> f64 {
    let Some(Values::Vector(u)) = simulation.model.field("displacement").map(|field| field.values) else {
        panic!("displacements are vectors")
    };
    let pairs = simulation.model.positions().iter().zip(&u);
    pairs.map(|(x, u)| (u[component] - exact(x)).abs()).fold(0.0, f64::max)
}

#[test]
fn a_bar_of_two_materials_at_rest_is_that_of_two_springs_to_first_order() {
    // u = ε₁ x left of the joint and ε₂ x right of it, E₁ ε₁ = E₂ ε₂; prescribed beyond x = ±1.
    let errors: Vec<f64> = [50, 100, 200]
        .iter()
        .map(|n| {
            let h = 1.0 / f64::from(*n);
            let edge = 1.0 + 3.0 * h;
            let text = format!(
                r#"
[case]
title = "A bar of two materials"
dimension = 1
[geometry]
shape = {{ segment = {{ low = -{edge}, high = {edge} }} }}
spacing = {h}
[sets]
left = {{ where = "x < 0" }}
right = {{ where = "x > 0" }}
ends = {{ where = "abs(x) > 1" }}
[discretization]
horizon_ratio = 3
[materials.stiff]
young = 3.0
density = 1.0
[materials.soft]
young = 1.0
density = 1.0
[physics.elasticity]
law = {{ bond_based_linear = {{}} }}
materials = {{ stiff = "left", soft = "right" }}
[[conditions]]
on = "ends"
prescribe = {{ displacement = {{ component = 0, value = "1e-3*if(x < 0, x, 3*x)" }} }}
[solver.static]
tolerance = 1e-12
"#
            );
            let mut simulation = simulation(&text, &[]);
            run(&mut simulation);
            difference(&mut simulation, 0, |x| 1e-3 * if x[0] < 0.0 { x[0] } else { 3.0 * x[0] })
        })
        .collect();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        // Bonds across the joint are not of its two springs: an error of the order of the horizon, in a layer of one.
        assert!((order - 1.0).abs() < 0.1, "{errors:?}");
    }
    assert!(errors[2] < 5e-3 * 3e-3, "{errors:?}");
}

#[test]
fn three_materials_meet_at_a_point_and_a_body_of_an_interface_stiffness_is_softer() {
    let materials = "[materials.a]\nyoung = 1e9\ndensity = 1000\n[materials.b]\nyoung = 2e9\ndensity = 1500\n\
                     [materials.c]\nyoung = 4e9\ndensity = 2000\n";
    let physics = "law = { bond_based = {} }\nmaterials = { a = \"left\", b = \"above\", c = \"below\" }\n";
    let text = text(2, false, materials, physics).replace(
        "[discretization]",
        "above = { where = \"x > 0 and y > 0\" }\nbelow = { where = \"x > 0 and y < 0\" }\n[discretization]",
    );
    let mut plain = simulation(&text, &[]);
    let facts = plain.model.facts().clone();
    let materials = facts.physics.elastic().unwrap().materials.clone();
    assert_eq!(materials.iter().map(|m| m.points).collect::<Vec<_>>(), [640, 320, 320]);
    let speeds: Vec<f64> = materials.iter().map(|m| m.bar_speed).collect();
    for (speed, (young, density)) in speeds.iter().zip([(1e9, 1e3), (2e9, 1.5e3), (4e9, 2e3)]) {
        assert!((speed / f64::sqrt(young / density) - 1.0).abs() < 1e-14);
    }
    let least = materials.iter().map(|m| m.stable_step).fold(f64::INFINITY, f64::min);
    // The same sums, in another order.
    assert!((facts.stable_step / least - 1.0).abs() < 1e-12);
    run(&mut plain);
    let soft =
        text.replace("materials = { a", "interfaces = [{ between = [\"a\", \"b\"], young = 1e7 }]\nmaterials = { a");
    let mut soft = simulation(&soft, &[]);
    run(&mut soft);
    let [plain, soft] = [&mut plain, &mut soft].map(|simulation| simulation.model.balance().strain);
    assert!(soft < 0.9 * plain, "{soft} {plain}: less is held across a soft interface");
}

#[test]
fn a_run_of_unlike_halves_has_the_same_bits_on_any_number_of_threads() {
    let materials = "[materials.a]\nyoung = 1e9\ndensity = 1000\nfracture_energy = 0.1\n[materials.b]\n\
                     young = \"2e9*(1 + 10*x)\"\ndensity = 1500\ncritical_stretch = 1e-3\n";
    for law in ["bond_based", "state_based"] {
        let poisson = if law == "state_based" { "poisson = 0.3" } else { "" };
        let physics = format!(
            "law = {{ {law} = {{ {poisson} }} }}\nmaterials = {{ a = \"left\", b = \"right\" }}\n\
             failure = {{ critical_stretch = {{}} }}"
        );
        let text = text(2, false, materials, &physics);
        let hash = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut simulation = simulation(&text, &[]);
                run(&mut simulation);
                assert!(simulation.model.broken_pairs() > 0, "{law}");
                simulation.model.hash()
            })
        };
        assert_eq!(hash(1), hash(3), "{law}");
    }
}

/// Values of a field of numbers.
fn numbers(simulation: &mut Simulation, name: &str) -> Vec<f64> {
    match simulation.model.field(name).unwrap().values {
        Values::Scalar(values) => values,
        _ => panic!("{name} is a number"),
    }
}

const HALVES: &str = "[materials.a]\nyoung = 1e9\ndensity = 1000\n[materials.b]\nyoung = 4e9\ndensity = 2000\n";

#[test]
fn rows_of_the_hybrid_scheme_are_of_one_material_and_move_as_bonds_do() {
    for law in ["bond_based", "bond_based_linear"] {
        let physics = format!("law = {{ {law} = {{}} }}\nmaterials = {{ a = \"left\", b = \"right\" }}\n");
        let text = text(2, false, HALVES, &physics)
            .replace("high = [0.032, 0.01]", "high = [0.032, 0.03]")
            .replace("low = [-0.032, -0.01]", "low = [-0.032, -0.03]")
            .replace("value = \"-1 + 100*x\"", "value = \"exp(-((x + 0.012)/0.005)^2)\"")
            .replace("value = \"1\"", "value = \"exp(-((x + 0.012)/0.005)^2)\"")
            .replace("end_time = 4e-6\ntime_step = 4e-8", "end_time = 1.5e-5\ntime_step = 1e-7");
        let found: Vec<(Vec<f64>, f64)> = ["\"standard\"", "{ hybrid = { standard = [\"left_end\"] } }"]
            .iter()
            .map(|scheme| {
                let text = text
                    .replace("horizon_ratio = 3", &format!("horizon_ratio = 3\nscheme = {scheme}"))
                    .replace("[sets]", "[sets]\nleft_end = { where = \"x < -0.03\" }");
                let mut simulation = simulation(&text, &[]);
                run(&mut simulation);
                let positions = simulation.model.positions().to_vec();
                let schemes = numbers(&mut simulation, "scheme");
                let rows = schemes.iter().filter(|scheme| **scheme == 0.0).count();
                let across = positions.iter().zip(&schemes).filter(|(x, scheme)| x[0].abs() < 3e-3 && **scheme == 0.0);
                assert_eq!(across.count(), 0, "{law}: points that see both materials sum their bonds");
                assert!(
                    scheme.contains("standard\"") && !scheme.contains("hybrid") || rows > 1000,
                    "{law}: {rows} rows"
                );
                let Some(Values::Vector(u)) = simulation.model.field("displacement").map(|field| field.values) else {
                    panic!("displacements are vectors")
                };
                let balance = simulation.model.balance();
                (u.iter().map(|u| u[0]).collect(), balance.kinetic + balance.strain + balance.damped)
            })
            .collect();
        let [(bonds, energy), (mixed, other)] = &found[..] else { panic!("two runs") };
        let largest = bonds.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
        let error = bonds.iter().zip(mixed).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest;
        // Rows have the moduli of the integral, bonds those of the lattice, some per cent apart at m = 3: so are the speeds of
        // a pulse that has run two of its widths.
        assert!(error < 0.1, "{law}: {error}");
        // With what the damping of rows takes from so short a pulse, booked every 20 steps.
        assert!((energy / other - 1.0).abs() < 0.02, "{law}: {energy} {other}");
    }
}

#[test]
fn cells_that_follow_the_solution_keep_their_material_and_its_mass() {
    let physics = "law = { bond_based = {} }\nmaterials = { a = \"left\", b = \"right\" }\n\
                   failure = { critical_stretch = { stretch = 0.01 } }\n";
    let text = text(2, false, HALVES, physics).replace(
        "[discretization]",
        "[refinement]\nlevels = 1\nbuffer = 1\nevery_steps = 10\nrefine_where = \"abs(x - 3000*t) < 4e-3\"\n\
         keep_where = \"0\"\n[discretization]",
    );
    let mut simulation = simulation(&text, &[]);
    simulation.model.start();
    let before = simulation.model.balance().momentum[0];
    let (mut least, mut most) = (usize::MAX, 0);
    while simulation.clock.step < simulation.n_steps {
        simulation.model.step(&simulation.solver, &mut simulation.clock).unwrap();
        let (positions, materials) = (simulation.model.positions().to_vec(), numbers(&mut simulation, "material"));
        let densities = numbers(&mut simulation, "density");
        for ((x, material), density) in positions.iter().zip(&materials).zip(&densities) {
            let expected = if x[0] < 0.0 { (0.0, 1000.0) } else { (1.0, 2000.0) };
            assert_eq!((*material, *density), expected, "{x:?}");
        }
        (least, most) = (least.min(positions.len()), most.max(positions.len()));
    }
    assert!(least > 1280 && most > least, "{least} {most}: cells are split and merged");
    let balance = simulation.model.balance();
    // Inner forces keep momentum, and so do splitting and merging, to the rounding of a thousand masses.
    assert!((balance.momentum[0] - before).abs() < 1e-12 * balance.momentum_scale, "{balance:?}");
}
