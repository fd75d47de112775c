//! Bodies at rest: patches, a floating bar, and the static solvers against each other.

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::error::{Error, Result};
use bondwise::field::Values;
use bondwise::simulation::Simulation;

const SOLVERS: [&str; 3] =
    ["static = { tolerance = 1e-11 }", "newton = { tolerance = 1e-11 }", "dynamic_relaxation = { tolerance = 1e-11 }"];

fn simulation(dimension: usize, shape: &str, law: &str, rest: &str, solver: &str) -> Simulation {
    let text = format!(
        r#"
[case]
title = "A body at rest"
dimension = {dimension}
[geometry]
shape = {{ {shape} }}
spacing = 1e-3
{rest}
[discretization]
horizon_ratio = 3.0
[physics.elasticity]
law = {{ {law} = {{ young = "70 GPa", density = 2700.0 }} }}
[solver]
{solver}
"#
    );
    build(&read_text::<Case>("body", &text, &[]).unwrap(), &Options::default()).unwrap()
}

fn settled(mut simulation: Simulation) -> Result<Simulation> {
    simulation.model.start();
    while simulation.clock.step < simulation.n_steps {
        simulation.model.step(&simulation.solver, &mut simulation.clock)?;
    }
    Ok(simulation)
}

fn displacement(simulation: &mut Simulation) -> Vec<[f64; 3]> {
    match simulation.model.field("displacement").unwrap().values {
        Values::Vector(values) => values,
        _ => panic!("a vector"),
    }
}

/// A rim of three cells, as wide as the horizon, is moved affinely; what is inside must follow.
#[test]
fn a_patch_is_strained_evenly() {
    let cases = [
        (1, "segment = { low = 0.0, high = 0.03 }", "abs(x - 0.015) > 0.0119", 1),
        (2, "rectangle = { size = [0.024, 0.02] }", "max(abs(x) + 0.003, 0.005 + abs(y)) > 0.0119", 2),
        (3, "block = { size = [0.012, 0.012, 0.012] }", "max(max(abs(x), abs(y)), abs(z)) > 0.0029", 3),
    ];
    let affine = [[1e-3, 4e-4, -2e-4], [-3e-4, -5e-4, 6e-4], [1e-4, 3e-4, 8e-4]];
    for (dimension, shape, rim, components) in cases {
        let mut rest = format!("[sets]\nrim = {{ where = \"{rim}\" }}\n");
        for (c, row) in affine.iter().enumerate().take(components) {
            let terms = row.iter().zip(["x", "y", "z"]).take(dimension).map(|(a, x)| format!("({a:e}) * {x}"));
            let value = terms.collect::<Vec<_>>().join(" + ");
            rest += &format!(
                "[[conditions]]\non = \"rim\"\nprescribe = {{ displacement = {{ component = {c}, value = \"t * ({value})\" }} }}\n"
            );
        }
        for solver in SOLVERS {
            let mut body = settled(simulation(dimension, shape, "bond_based_linear", &rest, solver)).unwrap();
            let u = displacement(&mut body);
            for (x, u) in body.model.positions().to_vec().iter().zip(&u) {
                for c in 0..dimension {
                    let expected: f64 = (0..dimension).map(|d| affine[c][d] * x[d]).sum();
                    // Forces balance to 1e-11 of the reactions; the softest mode of so small a body is some hundred
                    // times softer than the stiffest.
                    assert!((u[c] - expected).abs() < 1e-9 * 2.4e-5, "{dimension}D {solver}: {x:?} {u:?}");
                }
            }
        }
    }
}

const PULLED: &str = r#"
[sets]
left = { where = "x < -0.029" }
right = { where = "x > 0.029" }
[[conditions]]
on = "left"
load = { traction = { component = 0, value = "-70e6 * t" } }
[[conditions]]
on = "right"
load = { traction = { component = 0, value = "70e6 * t" } }
"#;

/// Pulled at both ends and held nowhere: rigid motion is not the solver's to choose.
#[test]
fn a_floating_bar_stretches_and_stays_where_it_is() {
    let shape = "rectangle = { size = [0.06, 0.012] }";
    for solver in SOLVERS {
        let mut body = settled(simulation(2, shape, "bond_based_linear", PULLED, solver)).unwrap();
        let u = displacement(&mut body);
        let positions = body.model.positions().to_vec();
        for c in 0..2 {
            let mean = u.iter().map(|u| u[c]).sum::<f64>() / u.len() as f64;
            assert!(mean.abs() < 1e-12, "{solver}: the body has moved by {mean:e}");
        }
        let spin: f64 = positions.iter().zip(&u).map(|(x, u)| x[0] * u[1] - x[1] * u[0]).sum();
        assert!(spin.abs() < 1e-9 * 0.06 * 3e-5 * u.len() as f64, "{solver}: {spin:e}");
        // Strain in the middle: σ/E, softened by the two free edges, whose points have half their bonds at most. A bar of
        // twelve cells with a horizon of three is softer by some ten per cent: less than the share of rim points.
        let at = |place: f64| {
            let near = |x: &[f64; 3]| (x[0] - place).abs() < 6e-4;
            let values: Vec<f64> = positions.iter().zip(&u).filter(|(x, _)| near(x)).map(|(_, u)| u[0]).collect();
            values.iter().sum::<f64>() / values.len() as f64
        };
        let strain = (at(0.0105) - at(-0.0105)) / 0.021;
        assert!((1.0e-3..1.3e-3).contains(&strain), "{solver}: {strain:e}");
        let balance = body.model.balance();
        // Clapeyron: the work of loads that grow with the displacements is the energy that they store.
        assert!((balance.external / balance.strain - 1.0).abs() < 1e-8, "{solver}: {balance:?}");
    }
}

/// The work is summed by the trapezoidal rule, whose error falls with the square of the load steps.
#[test]
fn newton_and_dynamic_relaxation_agree_at_large_strains() {
    let rest = r#"
[sets]
left = { where = "x < -0.009" }
right = { where = "x > 0.009" }
[[conditions]]
on = "left"
prescribe = { displacement = { component = 0, value = 0.0 } }
[[conditions]]
on = "left"
prescribe = { displacement = { component = 1, value = 0.0 } }
[[conditions]]
on = "right"
prescribe = { displacement = { component = 0, value = "2e-3 * t" } }
[[conditions]]
on = "right"
prescribe = { displacement = { component = 1, value = "4e-3 * t" } }
"#;
    let shape = "rectangle = { size = [0.024, 0.012] }";
    let solve = |solver: &str| {
        let mut body = settled(simulation(2, shape, "bond_based", rest, solver)).unwrap();
        let balance = body.model.balance();
        (displacement(&mut body), balance, body.model.reactions())
    };
    let (newton, coarse, reactions) = solve("newton = { steps = 4, tolerance = 1e-10 }");
    let (relaxed, ..) = solve("dynamic_relaxation = { steps = 4, tolerance = 1e-10 }");
    for (a, b) in newton.iter().zip(&relaxed) {
        for c in 0..2 {
            // Both balance forces to 1e-10 of the reactions.
            assert!((a[c] - b[c]).abs() < 1e-7 * 4e-3, "{a:?} {b:?}");
        }
    }
    // What holds the left end holds the right one back.
    for c in 0..2 {
        let [left, right] = [&reactions[c], &reactions[c + 2]].map(|(_, force)| force);
        assert!((left + right).abs() < 1e-8 * right.abs(), "{reactions:?}");
    }
    let (_, fine, _) = solve("newton = { steps = 8, tolerance = 1e-10 }");
    let error = |balance: &bondwise::problem::Balance| (balance.external / balance.strain - 1.0).abs();
    assert!(error(&coarse) < 0.02 && (3.0..5.0).contains(&(error(&coarse) / error(&fine))), "{coarse:?} {fine:?}");
}

#[test]
fn a_load_that_nothing_balances_is_refused() {
    let rest = "[sets]\nright = { where = \"x > 0.029\" }\n[[conditions]]\non = \"right\"\n\
                load = { traction = { component = 0, value = 7e7 } }\n";
    for solver in SOLVERS {
        let body = simulation(2, "rectangle = { size = [0.06, 0.012] }", "bond_based_linear", rest, solver);
        let Err(Error::Numbers(stop)) = settled(body) else { panic!("{solver}: a push with nothing behind the body") };
        assert!(stop.cause.contains("the body can move as a whole"), "{}", stop.cause);
        // Said at once: smaller load steps end at the same loads.
        assert!(!stop.cause.contains("load steps down to") && stop.time == 0.0, "{stop:?}");
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let shape = "rectangle = { size = [0.06, 0.05] }";
    let hash = |threads: usize, solver: &str| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| settled(simulation(2, shape, "bond_based", PULLED, solver)).unwrap().model.hash())
    };
    for solver in ["newton = {}", "dynamic_relaxation = { tolerance = 1e-3 }"] {
        let one = hash(1, solver);
        for threads in [2, 3, 7] {
            assert_eq!(one, hash(threads, solver), "{solver}, {threads} threads");
        }
    }
}
