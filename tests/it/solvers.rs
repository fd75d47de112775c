//! Solvers beside each other: the Runge–Kutta method in time, the linear solvers at rest, chains of solvers.

use std::cell::Cell;

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::{bundled, read_text};
use bondwise::field::Values;
use bondwise::simulation::{Control, Simulation};

fn from_text(text: &str) -> Simulation {
    build(&read_text::<Case>("solvers", text, &[]).unwrap(), &Options::default()).unwrap()
}

fn finished(mut simulation: Simulation) -> Simulation {
    simulation.model.start();
    while simulation.clock.step < simulation.n_steps {
        assert!(simulation.step(&mut |_, _| true).unwrap());
    }
    simulation
}

fn vectors(simulation: &mut Simulation, name: &str) -> Vec<[f64; 3]> {
    match simulation.model.field(name).unwrap().values {
        Values::Vector(values) => values,
        _ => panic!("a vector"),
    }
}

fn largest_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A bar of 0.2 m with a pulse, the left end moved, the right one loaded: 40 µs in so many steps.
fn bar(steps: u64, extra: &str, failure: &str) -> Simulation {
    from_text(&format!(
        r#"
[case]
title = "A bar"
dimension = 1
[geometry]
shape = {{ segment = {{ low = 0.0, high = 0.2 }} }}
spacing = 1e-3
[sets]
left = {{ where = "x < 3e-3" }}
right = {{ where = "x > 0.19" }}
[discretization]
horizon_ratio = 3
[physics.elasticity]
law = {{ bond_based_linear = {{ young = "200 GPa", density = 8000.0 }} }}
{failure}
[[conditions]]
on = "all"
initial = {{ displacement = {{ component = 0, value = "1e-6*exp(-((x-0.1)/0.01)^2)" }} }}
{extra}
[solver.runge_kutta]
end_time = 40e-6
time_step = {}
damping = {}
"#,
        40e-6 / steps as f64,
        if extra.is_empty() { 0.0 } else { 5e3 }
    ))
}

const DRIVEN: &str = r#"
[[conditions]]
on = "left"
prescribe = { displacement = { component = 0, value = "1e-6*sin(1e5*t)^3" } }
[[conditions]]
on = "right"
load = { body_force = { component = 0, value = "1e9*sin(2e5*t)^3" } }
"#;

/// Each halving of the step leaves terms of relative size Δt beside the leading one. The coarsest steps are half the
/// stable one.
#[test]
fn runge_kutta_is_of_fourth_order_in_a_bar_and_so_are_its_books() {
    for extra in ["", DRIVEN, &DRIVEN.replace("displacement =", "velocity =").replace("\"1e-6", "\"1e-1")] {
        let mut runs: Vec<Simulation> = [200, 400, 800].map(|n| finished(bar(n, extra, ""))).into();
        let u: Vec<_> = runs.iter_mut().map(|run| vectors(run, "displacement")).collect();
        let order = (largest_difference(&u[0], &u[1]) / largest_difference(&u[1], &u[2])).log2();
        assert!((order - 4.0).abs() < 0.3, "{extra}: order {order}");
        let balances: Vec<_> = runs.iter_mut().map(|run| run.model.balance()).collect();
        let order = (balances[0].defect() / balances[1].defect()).log2();
        // Energy falls by (ω Δt)⁶/72 a step, at fifth order in a given time; work is summed as well as that.
        assert!((order - 5.0).abs() < 0.3, "{extra}: order {order} of the balance");
        for b in &balances {
            // Momentum is a linear invariant, which the method keeps to rounding: 800 steps of 200 points.
            assert!(b.momentum_defect <= 1e-11 * b.momentum_scale, "{extra}: {b:?}");
        }
    }
}

/// A bond that breaks takes what it holds at the end of the step, so breaking adds no error to the energy.
#[test]
fn bonds_break_at_the_ends_of_whole_steps_and_the_books_say_what_they_took() {
    let stretched =
        "[[conditions]]\non = \"all\"\ninitial = { velocity = { component = 0, value = \"2e3*(x-0.1)\" } }\n";
    let failure = "failure = { critical_stretch = { stretch = 0.02 } }";
    let mut run = finished(bar(800, stretched, failure));
    let balance = run.model.balance();
    assert!(run.model.broken_pairs() > 0 && balance.fracture > 0.0, "{balance:?}");
    // What the damping of the shortest waves takes in 800 steps: (ω Δt)⁶/72 each, ω Δt < 0.35, were all energy in them.
    assert!(balance.defect().abs() < 800.0 * 0.35f64.powi(6) / 72.0 * balance.scale(), "{balance:?}");
}

#[test]
fn runge_kutta_gives_the_same_bits_on_any_number_of_threads() {
    let plate = |threads: usize| {
        let text = r#"
[case]
title = "A plate"
dimension = 2
[geometry]
shape = { rectangle = { size = [0.3, 0.1] } }
spacing = 1e-3
[discretization]
horizon_ratio = 3
[physics.elasticity]
law = { bond_based = { young = "70 GPa", density = 2700.0 } }
failure = { critical_stretch = { stretch = 1e-3 } }
[[conditions]]
on = "all"
initial = { velocity = { component = 0, value = "300*x*cos(40*y)" } }
[solver.runge_kutta]
end_time = 6e-6
"#;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| finished(from_text(text)).model.hash())
    };
    let one = plate(1);
    assert_eq!((plate(2), plate(3)), (one.clone(), one));
}

/// A plate under `load`, a body force in x, with these solvers one after the other.
fn pushed(load: &str, solvers: &str) -> Simulation {
    from_text(&format!(
        r#"
[case]
title = "A plate that is pushed"
dimension = 2
[geometry]
shape = {{ rectangle = {{ size = [0.03, 0.02] }} }}
spacing = 1e-3
[discretization]
horizon_ratio = 3
[physics.elasticity]
law = {{ bond_based = {{ young = "70 GPa", density = 2700.0 }} }}
[[conditions]]
on = "all"
load = {{ body_force = {{ component = 0, value = "{load}" }} }}
{solvers}
"#
    ))
}

const VERLET: &str = "[[solver]]\nvelocity_verlet = { end_time = \"5 us\", time_step = \"0.1 us\" }\n";

/// On a lattice velocity Verlet leaves its last kick to the next step, which the next solver does not know.
#[test]
fn a_kick_that_is_owed_is_given_before_the_next_solver_begins() {
    let solvers = format!("{VERLET}[[solver]]\nrunge_kutta = {{ end_time = \"8 us\" }}\n");
    let hashes = [true, false].map(|looks| {
        let mut plate = pushed("1e9*x", &solvers);
        plate.model.start();
        while plate.clock.step < plate.n_steps {
            assert!(plate.step(&mut |_, _| true).unwrap());
            if looks {
                plate.model.field("velocity").unwrap();
            }
        }
        plate.model.hash()
    });
    assert_eq!(hashes[0], hashes[1]);
}

#[test]
fn a_body_that_is_braked_to_rest_is_no_runaway() {
    // As much forth as back, and a step of nothing between: all of the work comes out again when the body rests.
    let mut plate = pushed("if(t < 2.45e-6, 1e9, if(t < 2.55e-6, 0, -1e9))", VERLET);
    plate.model.start();
    for _ in 0..50 {
        assert!(plate.step(&mut |_, _| true).unwrap());
    }
    let (balance, fastest) = (plate.model.balance(), 1e9 / 2700.0 * 2.45e-6);
    let whole = 0.5 * 2700.0 * fastest * fastest * 0.03 * 0.02;
    assert!(balance.kinetic < 1e-12 * whole, "{} of {whole}", balance.kinetic);
}

#[test]
fn a_solver_whose_last_step_runs_away_does_not_hand_over() {
    let solvers = "[[solver]]\nvelocity_verlet = { end_time = \"0.4 us\", time_step = \"0.1 us\" }\n\
        [[solver]]\nrunge_kutta = { end_time = \"1 us\" }\n";
    let mut plate = pushed("if(t > 0.35e-6, 1e300, 1e9)", solvers);
    plate.model.start();
    let ends: Vec<_> = (0..5).map(|_| plate.step(&mut |_, _| true)).take_while(|step| step.is_ok()).collect();
    assert_eq!((ends.len(), plate.clock.step), (4, 4), "stopped where the last step of the first ended");
}

const PULLED: &str = r#"
[[conditions]]
on = "left"
load = { traction = { component = 0, value = "-2e9 * t" } }
"#;
const HELD: &str = r#"
[[conditions]]
on = "left"
prescribe = { displacement = { component = 0, value = 0.0 } }
[[conditions]]
on = "left"
prescribe = { displacement = { component = 1, value = 0.0 } }
"#;
const HELD_IN_DEPTH: &str = r#"
[[conditions]]
on = "left"
prescribe = { displacement = { component = 2, value = 0.0 } }
"#;

fn body(dimension: usize, held: bool, law: &str, solver: &str) -> Simulation {
    let shape = match dimension {
        2 => "rectangle = { size = [0.02, 0.01] }",
        _ => "block = { size = [0.01, 0.006, 0.005] }",
    };
    let edge = if dimension == 2 { 0.008 } else { 0.003 };
    let support = match (held, dimension) {
        (false, _) => PULLED.to_string(),
        (true, 2) => HELD.to_string(),
        (true, _) => format!("{HELD}{HELD_IN_DEPTH}"),
    };
    from_text(&format!(
        r#"
[case]
title = "A body at rest"
dimension = {dimension}
[geometry]
shape = {{ {shape} }}
spacing = 1e-3
[sets]
left = {{ where = "x < -{edge}" }}
right = {{ where = "x > {edge}" }}
[discretization]
horizon_ratio = 3.0
[physics.elasticity]
law = {{ {law} = {{ young = "70 GPa", density = 2700.0 }} }}
{support}
[[conditions]]
on = "right"
load = {{ traction = {{ component = 0, value = "2e9 * t" }} }}
[solver]
{solver}
"#
    ))
}

/// Strains of a per cent and more.
#[test]
fn all_linear_solvers_bring_a_body_to_the_same_rest() {
    let choices = [
        ("conjugate_gradients", "block_jacobi"),
        ("conjugate_gradients", "incomplete_factors"),
        ("conjugate_gradients", "none"),
        ("direct", ""),
        ("bicgstab", "jacobi"),
        ("bicgstab", "incomplete_factors"),
        ("gmres", "block_jacobi"),
        ("gmres", "incomplete_factors"),
    ];
    for (dimension, held) in [(2, true), (2, false), (3, true), (3, false)] {
        for (solver, law) in [("static", "bond_based_linear"), ("static", "bond_based"), ("newton", "bond_based")] {
            let solve = |choice: &str| {
                let text = format!("{solver} = {{ tolerance = 1e-11{choice} }}");
                let mut body = finished(body(dimension, held, law, &text));
                let log = body.model.load_steps()[0].clone();
                (vectors(&mut body, "displacement"), log)
            };
            let (expected, log) = solve("");
            let size = expected.iter().flatten().fold(0.0f64, |size, u| size.max(u.abs()));
            assert!(log.imbalance <= 1e-11 && log.linear_iterations > 0, "{log:?}");
            for (linear, preconditioner) in choices {
                let second = if preconditioner.is_empty() {
                    String::new()
                } else {
                    format!(", preconditioner = \"{preconditioner}\"")
                };
                let (u, log) = solve(&format!(", linear = \"{linear}\"{second}"));
                let difference = largest_difference(&u, &expected) / size;
                // Forces balance to 1e-11, and the softest mode is some hundred times softer than the stiffest.
                assert!(difference < 1e-8, "{dimension}D, held {held}, {solver}, {law}: {linear} {preconditioner}");
                if linear == "direct" {
                    // One for each system, and one where rounding or stress leaves more than the tolerance.
                    assert!(log.linear_iterations <= 3 * log.iterations, "{log:?}");
                }
            }
        }
    }
}

#[test]
fn a_load_step_is_left_at_the_last_state_at_rest() {
    let two = "newton = { steps = 2, tolerance = 1e-10 }";
    let mut whole = body(2, true, "bond_based", two);
    whole.model.start();
    assert!(whole.step(&mut |_, _| true).unwrap());
    let (hash, clock) = (whole.model.hash(), whole.clock);
    assert!(!whole.step(&mut |k, _| k < 3).unwrap());
    assert_eq!((whole.model.hash(), whole.clock), (hash.clone(), clock));
    let [first, second] = whole.model.load_steps() else { panic!("two load steps, one of them left") };
    assert!(first.imbalance <= 1e-10 && first.time == 0.5 && first.history.len() == first.iterations + 1, "{first:?}");
    assert_eq!((second.time, second.linear_iterations), (0.5, 3));

    let folder = std::env::temp_dir().join(format!("bondwise-{}-left", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut run = body(2, true, "bond_based", two);
    run.folder.clone_from(&folder);
    run.history = bondwise::output::history::History::new(folder.join("history.csv"), 1, None);
    let within = Cell::new(0);
    let report = run
        .run(|progress| {
            within.set(within.get() + usize::from(progress.within.is_some()));
            if progress.step == 1 && progress.within.is_some() { Control::Stop } else { Control::Continue }
        })
        .unwrap();
    assert_eq!((report.status.as_str(), report.steps, report.end_time), ("interrupted", 1, 0.5));
    assert_eq!((report.state_hash, report.load_steps.len()), (hash, 2));
    assert_eq!(within.get(), first.linear_iterations + 1);
    std::fs::remove_dir_all(folder).unwrap();
}

/// The bar at rest under tension, let go at x = L: a front runs back at c, behind it ε = 0 and v = −ε₀ c.
#[test]
fn an_end_of_a_prestressed_bar_let_go_sends_a_wave_at_the_speed_of_the_bar() {
    let case = bundled::CASES.iter().find(|case| case.name == "prestressed_bar").unwrap();
    let mut bar = from_text(case.case);
    let (strain, c, young, settled) = (1e-3, 5000.0, 200e9, 1e-6);
    bar.model.start();
    assert!(bar.step(&mut |_, _| true).unwrap());
    let positions = bar.model.positions().to_vec();
    for (x, u) in positions.iter().zip(vectors(&mut bar, "displacement")) {
        // Forces balance to 1e-8 of the reactions; the softest mode of 1000 points is 1e5 times softer than the stiffest,
        // and a direct solution is far better than asked for.
        assert!((u[0] - strain * x[0]).abs() < 1e-9 * strain, "{x:?} {u:?}");
    }
    let at_rest = bar.model.balance();
    while bar.clock.time() < settled + 100e-6 {
        assert!(bar.step(&mut |_, _| true).unwrap());
    }
    let since = bar.clock.time() - settled;
    let v = vectors(&mut bar, "velocity");
    let front = positions.iter().zip(&v).find(|(_, v)| v[0] < -strain * c / 3.0).map_or(f64::NAN, |(x, _)| x[0]);
    // Dispersion makes the front an integral of Airy's function, which has a third of its height at c t (and half of it
    // 3 mm behind). One spacing of the grid, and one for the end, whose points lack bonds.
    assert!((front - (1.0 - c * since)).abs() < 2e-3, "{front}, and not {}", 1.0 - c * since);
    let balance = bar.model.balance();
    // What still pulls at the left end gives the momentum: −E ε₀ t. Until the wave is there nothing but the balance of
    // forces at rest, to 1e-8, and the modulus of the grid, exact with a ramp in 1D, are between the two.
    assert!((balance.momentum[0] / (-young * strain * since) - 1.0).abs() < 1e-6, "{balance:?}");
    // Behind the front all energy is motion. The ends lack bonds on three of a thousand spacings.
    assert!((balance.kinetic / (at_rest.strain * c * since) - 1.0).abs() < 3e-3, "{balance:?} {at_rest:?}");
    // Books go on over the change of solver: work of the static step, then none. Velocity Verlet's energy swings by
    // (ω Δt/2)² of what waves at the front hold, which are as short as its 6 mm or shorter: ω Δt < 0.1 for most.
    assert!(balance.defect().abs() < 1e-3 * balance.scale() && balance.external == at_rest.external, "{balance:?}");
}
