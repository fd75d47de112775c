//! Cases of diffusion: closed forms, books, pre-cracks that insulate, the same parts by hand.

use std::f64::consts::PI;
use std::sync::Arc;

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::{bundled, read_text};
use bondwise::conditions::{FormulaAtPoints, Load, Prescribed, Quantity};
use bondwise::discretization::{Influence, PartialVolume, standard};
use bondwise::expression::Expression;
use bondwise::field::Values;
use bondwise::geometry::{Cloud, Crack, Shape};
use bondwise::physics::Diffusion;
use bondwise::physics::diffusion::{Diffusing, Flux};
use bondwise::problem::Problem;
use bondwise::simulation::{Control, Simulation};
use bondwise::solver::{Clock, ForwardEuler, Solver};

/// What a case is made of; the diffusivity is 1.
#[derive(Clone)]
pub struct Parts {
    pub dimension: usize,
    pub spacing: f64,
    /// Largest shift of a coordinate, in spacings; on the lattice if None.
    pub perturb: Option<f64>,
    pub cracks: &'static str,
    pub discretization: &'static str,
    pub diffusion: &'static str,
    pub conditions: String,
    /// Keys of the solver.
    pub solver: String,
}

impl Parts {
    /// A box of side 1 about the origin with δ = 3 spacings.
    pub fn new(dimension: usize, spacing: f64) -> Self {
        Parts {
            dimension,
            spacing,
            perturb: None,
            cracks: "",
            discretization: "horizon_ratio = 3",
            diffusion: "diffusivity = 1.0",
            conditions: String::new(),
            solver: String::new(),
        }
    }

    pub fn text(&self) -> String {
        let Parts { dimension, spacing, perturb, cracks, discretization, diffusion, conditions, solver } = self;
        let corner = |x: f64| format!("{:?}", vec![x; *dimension]);
        let perturb = perturb.map_or(String::new(), |size| format!("perturb = {{ amplitude = {size}, seed = 3 }}"));
        format!(
            r#"
[case]
title = "Diffusion"
dimension = {dimension}
[geometry]
shape = {{ box = {{ low = {}, high = {} }} }}
spacing = {spacing}
{perturb}
{cracks}
[discretization]
{discretization}
[physics.diffusion]
{diffusion}
{conditions}
[solver.forward_euler]
{solver}
"#,
            corner(-0.5),
            corner(0.5)
        )
    }

    fn simulation(&self) -> Simulation {
        from_text(&self.text())
    }
}

pub fn from_text(text: &str) -> Simulation {
    let case = read_text::<Case>("case", text, &[]).unwrap_or_else(|e| panic!("{e}\n{text}"));
    build(&case, &Options::default()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn finished(mut simulation: Simulation) -> Simulation {
    simulation.model.start();
    while simulation.clock.step < simulation.n_steps {
        assert!(simulation.step(&mut |_, _| true).unwrap());
    }
    simulation
}

fn concentration(simulation: &mut Simulation) -> Vec<f64> {
    match simulation.model.field("concentration").unwrap().values {
        Values::Scalar(values) => values,
        _ => panic!("a number a point"),
    }
}

/// Amount, supplied, imbalance.
fn books(simulation: &mut Simulation) -> [f64; 3] {
    let balance = simulation.model.balance();
    let columns = simulation.model.columns(&balance);
    assert_eq!(columns.iter().map(|c| &*c.name).collect::<Vec<_>>(), ["amount", "supplied", "imbalance"]);
    std::array::from_fn(|k| columns[k].value)
}

/// cos πx cos πy cos πz e^(−Dπ²t), prescribed in a layer of this width.
fn wave(dimension: usize, spacing: f64, width: f64) -> Parts {
    let formula = ["cos(pi*x)", "cos(pi*y)", "cos(pi*z)"][..dimension].join("*");
    let far =
        ["abs(x)", "abs(y)", "abs(z)"][..dimension].iter().fold("0".into(), |m: String, x| format!("max({m}, {x})"));
    let conditions = format!(
        r#"
[sets]
layer = {{ where = "{far} > 0.5 - {width}" }}
[[conditions]]
on = "all"
initial = {{ concentration = {{ value = "{formula}" }} }}
[[conditions]]
on = "layer"
prescribe = {{ concentration = {{ value = "{formula}*exp(-{dimension}*pi^2*t)" }} }}
"#
    );
    Parts { conditions, solver: "end_time = 0.02\nsafety = 0.1".into(), ..Parts::new(dimension, spacing) }
}

/// Root of the mean square of the error of that wave, over all points.
fn error_of_wave(parts: &Parts) -> f64 {
    let mut simulation = finished(parts.simulation());
    let size = (-(parts.dimension as f64) * PI * PI * simulation.clock.time()).exp();
    let found = concentration(&mut simulation);
    let positions = simulation.model.positions();
    let exact = positions.iter().map(|x| size * x.iter().map(|x| (PI * x).cos()).product::<f64>());
    let square: f64 = found.iter().zip(exact).map(|(found, exact)| (found - exact).powi(2)).sum();
    (square / found.len() as f64).sqrt()
}

/// Δt goes with h², so that a scheme of second order in space and first in time is of second order in h; it is small, so that the
/// error of the step does not make up for that in space.
#[test]
fn a_wave_decays_at_the_known_rate_with_the_order_of_the_scheme() {
    let rows = "horizon_ratio = 3\nscheme = { collocation = { order = 2 } }";
    let mut found = Vec::new();
    for (dimension, spacing) in [(1, 1.0 / 60.0), (2, 1.0 / 30.0), (3, 1.0 / 18.0)] {
        for (discretization, perturb, least) in [
            ("horizon_ratio = 3", None, 1.8),
            ("horizon_ratio = 3\ninfluence = \"linear\"\npartial_volumes = \"none\"", None, 1.8),
            (rows, None, 1.8),
            // Of points that are moved the third derivative is left, with signs that vary: between first and second order
            // on the mean, and here there is one seed.
            (rows, Some(0.15), 0.5),
        ] {
            let error = |h| error_of_wave(&Parts { discretization, perturb, ..wave(dimension, h, 3.0 * spacing) });
            let errors = [error(spacing), error(0.5 * spacing)];
            found.push((dimension, discretization, perturb, errors, (errors[0] / errors[1]).log2(), least));
        }
    }
    let is_off = |order: f64, least: f64| order < least || order > 2.5;
    assert!(!found.iter().any(|(.., order, least)| is_off(*order, *least)), "{found:#?}");
}

#[test]
fn the_error_of_the_step_is_of_first_order_for_every_exponent() {
    for exponent in ["exponent = 0", "exponent = 1", "exponent = 2", "exponent = 3"] {
        let value = |steps: u32| {
            let solver = format!("end_time = 0.02\ntime_step = {:?}", 0.02 / f64::from(steps));
            let diffusion = format!("diffusivity = 1.0\n{exponent}").leak();
            let parts = Parts { solver, diffusion, ..wave(2, 1.0 / 20.0, 0.15) };
            let mut simulation = finished(parts.simulation());
            concentration(&mut simulation)[210]
        };
        let [a, b, c] = [100, 200, 400].map(value);
        let order = ((a - b) / (b - c)).log2();
        // The next term is of relative size λΔt, half a hundredth.
        assert!((order - 1.0).abs() < 0.02, "{exponent}: {order}");
    }
}

/// What long waves find is K: a bar without calibration is slower by 1/(2m), here a sixth.
#[test]
fn weights_are_calibrated_unless_the_case_says_otherwise() {
    for (diffusion, found) in [("diffusivity = 2.0", 2.0), ("diffusivity = 2.0\ncalibrated = false", 2.0 * 5.0 / 6.0)] {
        let parts = Parts { diffusion, solver: "end_time = 0.01".into(), ..Parts::new(1, 0.02) };
        let simulation = parts.simulation();
        let facts = simulation.model.facts().physics.diffusive().cloned().unwrap();
        assert!((facts.found_diffusivity.unwrap() - found).abs() < 1e-12, "{facts:?}");
        assert_eq!(facts.diffusivity, 2.0);
        assert!(simulation.model.facts().physics.elastic().is_none());
    }
}

/// A body cut in two, and a gradient across: each part comes to its own mean, and nothing passes.
#[test]
fn a_pre_crack_insulates() {
    let cracks = [
        "cracks = [{ point = 0.1 }]",
        "cracks = [{ segment = { from = [0.1, -0.6], to = [0.1, 0.6] } }]",
        "cracks = [{ polygon = { vertices = [[0.1, -0.6, -0.6], [0.1, 0.6, -0.6], [0.1, 0.6, 0.6], [0.1, -0.6, 0.6]] } }]",
    ];
    for (dimension, spacing) in [(1, 0.02), (2, 0.05), (3, 0.1)] {
        for perturb in [None, Some(0.2)] {
            let parts = Parts {
                perturb,
                cracks: cracks[dimension - 1],
                conditions: "[[conditions]]\non = \"all\"\ninitial = { concentration = { value = \"1 + x\" } }".into(),
                solver: "end_time = 4.0\nsafety = 0.9".into(),
                ..Parts::new(dimension, spacing)
            };
            let mut simulation = parts.simulation();
            let facts = simulation.model.facts();
            assert!(facts.cut_bonds > 0 && facts.cut_bonds < facts.bonds);
            let side: Vec<bool> = simulation.model.positions().iter().map(|x| x[0] > 0.1).collect();
            // Cells are alike: amounts are sums of concentrations.
            let amounts = |c: &[f64]| {
                [false, true]
                    .map(|there| c.iter().zip(&side).filter(|(_, s)| **s == there).map(|(c, _)| c).sum::<f64>())
            };
            let sizes = [false, true].map(|there| side.iter().filter(|s| **s == there).count() as f64);
            let before = amounts(&concentration(&mut simulation));
            simulation = finished(simulation);
            let now = concentration(&mut simulation);
            let after = amounts(&now);
            for part in 0..2 {
                let moved = (after[part] / before[part] - 1.0).abs();
                // Each of some thousand steps rounds the values once.
                assert!(moved < 1e-12, "{dimension}D {perturb:?}: {moved:e}");
                // The slowest wave of the larger part decays by e^(−π²t/0.6²), e^−110; with ten cells along a side, and
                // surfaces that lack bonds, by e^−42 at least.
                let mean = before[part] / sizes[part];
                let off =
                    now.iter().zip(&side).filter(|(_, s)| usize::from(**s) == part).map(|(c, _)| (c - mean).abs());
                let off = off.fold(0.0, f64::max);
                assert!(off < 1e-10, "{dimension}D {perturb:?}: {off:e}");
            }
            assert_eq!(simulation.model.broken_pairs(), 0);
        }
    }
}

/// A source all over, and what enters through a face until it is shut.
#[test]
fn what_enters_is_booked_and_nothing_is_lost() {
    for (dimension, spacing) in [(1, 0.02), (2, 0.05), (3, 0.1)] {
        for perturb in [None, Some(0.2)] {
            let conditions = format!(
                r#"
[sets]
face = {{ where = "x > 0.5 - {spacing}" }}
left = {{ where = "x < 0" }}
[[conditions]]
on = "all"
initial = {{ concentration = {{ value = "sin(40*x)" }} }}
[[conditions]]
on = "left"
load = {{ source = {{ value = "3*cos(30*t)" }} }}
[[conditions]]
on = "face"
load = {{ flux = {{ value = 2.0 }} }}
until = 0.05
"#
            );
            let solver = "end_time = 0.1\nsafety = 0.8".into();
            let mut simulation =
                finished(Parts { perturb, conditions, solver, ..Parts::new(dimension, spacing) }.simulation());
            let [amount, supplied, imbalance] = books(&mut simulation);
            // Some hundred steps round some thousand values.
            assert!(imbalance.abs() < 1e-12, "{dimension}D {perturb:?}: {imbalance:e}");
            if perturb.is_none() {
                // sin 40x is odd: all that is there came in. A face of area 1 and half a volume of 1; the sums of forward
                // Euler are off by Δt times the rates at the ends, at most 3/2 and 2.
                assert!((amount - supplied).abs() < 1e-12);
                let exact = 0.5 * 3.0 * (30.0f64 * 0.1).sin() / 30.0 + 2.0 * 0.05;
                let dt = simulation.clock.dt;
                assert!((supplied - exact).abs() < 3.5 * dt, "{dimension}D: {supplied} {exact} {dt}");
            }
        }
    }
}

/// Held layers bring a bar to a straight line; one of them is let go, and the bar takes the value of the other.
#[test]
fn prescribed_layers_are_held_until_they_are_let_go() {
    let conditions = |until: &str| {
        format!(
            r#"
[sets]
left = {{ where = "x < -0.5 + 0.06" }}
right = {{ where = "x > 0.5 - 0.06" }}
[[conditions]]
on = "left"
prescribe = {{ concentration = {{ value = "1 + x" }} }}
[[conditions]]
on = "right"
prescribe = {{ concentration = {{ value = "1 + x" }} }}
{until}
"#
        )
    };
    let parts = Parts { conditions: conditions(""), solver: "end_time = 4.0".into(), ..Parts::new(1, 0.02) };
    let mut simulation = finished(parts.simulation());
    let x: Vec<f64> = simulation.model.positions().iter().map(|x| x[0]).collect();
    for (c, x) in concentration(&mut simulation).iter().zip(x) {
        // e^(−π² t) of the slowest wave, e^−39; then rounding.
        assert!((c - 1.0 - x).abs() < 1e-12, "{c} {x}");
    }
    // In the last step as much leaves on the left as enters on the right: K times the slope.
    let reactions = simulation.model.reactions();
    assert_eq!(reactions.iter().map(|(name, _)| &**name).collect::<Vec<_>>(), ["left", "right"]);
    assert!((reactions[0].1 + reactions[1].1).abs() < 1e-9, "{reactions:?}");
    assert!((reactions[1].1 - 1.0).abs() < 1e-9, "{reactions:?}");

    // A chain of two solvers, with another step in the second.
    let text = Parts { conditions: conditions("until = 1.0"), ..parts }.text();
    let (head, _) = text.split_once("[solver").unwrap();
    let chain = format!(
        "{head}[[solver]]\nforward_euler = {{ end_time = 1.0 }}\n[[solver]]\nforward_euler = {{ end_time = 12.0, safety = \
         0.5 }}\n"
    );
    let mut simulation = finished(from_text(&chain));
    let [.., imbalance] = books(&mut simulation);
    assert!(imbalance.abs() < 1e-12, "{imbalance:e}");
    let last = *concentration(&mut simulation).last().unwrap();
    // The left layer holds 1 + x, whose last point is at −0.45; beside it the bar sees values that go on to −0.49.
    assert!(last > 0.5 && last < 0.56, "{last}");
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let square = bundled::CASES.iter().find(|case| case.name == "diffusion_in_a_square").unwrap().case;
    let moved = |keys: &[(&str, &str)]| {
        let keys: Vec<_> = keys.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
        build(&read_text::<Case>("square", square, &keys).unwrap(), &Options::default()).unwrap()
    };
    let end = ("solver.forward_euler.end_time", "0.05");
    let scattered = [end, ("geometry.perturb", "{ amplitude = 0.17 }"), ("solver.forward_euler.time_step", "5e-5")];
    let bonds = [&scattered[..], &[("discretization.scheme", "standard")]].concat();
    for keys in [&[end][..], &[end, ("discretization.scheme", "standard")], &scattered, &bonds] {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut simulation = finished(moved(keys));
                (simulation.model.hash(), books(&mut simulation).map(f64::to_bits))
            })
        };
        assert_eq!(on(1), on(3), "{keys:?}");
    }
}

/// The same plate by hand: a crack, a source that falls off, a layer that is held, what enters on the left.
#[test]
fn a_case_is_what_the_library_makes_of_the_same_parts() {
    let conditions = r#"
[sets]
held = { where = "y > 0.35" }
face = { where = "x < -0.45" }
[[conditions]]
on = "all"
initial = { concentration = { value = "x*y" } }
[[conditions]]
on = "all"
load = { source = { value = "exp(-t)*(1 + x)" } }
[[conditions]]
on = "face"
load = { flux = { value = "t", thickness = 0.1 } }
[[conditions]]
on = "held"
prescribe = { concentration = { value = "x + t" } }
"#;
    let parts = Parts {
        cracks: "cracks = [{ segment = { from = [-0.2, -0.3], to = [0.1, 0.2] } }]",
        discretization: "horizon_ratio = 4\ninfluence = \"linear\"",
        diffusion: "diffusivity = 0.5\nexponent = 1",
        conditions: conditions.into(),
        solver: "end_time = 0.05\ntime_step = 1e-3".into(),
        ..Parts::new(2, 0.05)
    };
    let mut simulation = finished(parts.simulation());

    let cloud = Cloud::lattice(&Shape::Box { low: [-0.5; 2], high: [0.5; 2] }, 0.05, 5);
    let horizon = 4.0 * cloud.spacing;
    let flux = Flux::new::<2>(Influence::Linear, 1, 0.5, horizon).unwrap();
    let body = standard::body(cloud, horizon, PartialVolume::Ramp);
    let diffusion = Diffusion::standard(&body, &flux, PartialVolume::Ramp).calibrated(&body, 0.5);
    let mut body = Diffusing::new(body, diffusion);
    body.cut(&[Crack::Polyline(vec![[-0.2, -0.3], [0.1, 0.2]])], 1e-9 * 0.05);
    let set = |inside: fn(&[f64; 2]) -> bool| -> Arc<[u32]> { body.body.cloud.select(inside).into() };
    let [all, held, face] = [set(|_| true), set(|x| x[1] > 0.35), set(|x| x[0] < -0.45)];
    let profile = |formula: &str, slots: &Arc<[u32]>| {
        FormulaAtPoints::new(Expression::compile(formula, &["x", "y", "z", "t"], &[]).unwrap(), &body.body.cloud, slots)
    };
    let initial: Vec<f64> = profile("x*y", &all).at(0.0).to_vec();
    let source = Load::new(all.clone(), 0, profile("exp(-t)*(1 + x)", &all));
    let mut enters = Load::new(face.clone(), 0, profile("t", &face));
    enters.scale = bondwise::conditions::Scale::Same(1.0 / 0.1);
    let held = Prescribed::new("held".into(), held.clone(), 0, Quantity::Value, profile("x + t", &held));
    for (&slot, value) in all.iter().zip(initial) {
        body.concentration[slot as usize] = value;
    }
    let mut problem = Problem::new(Box::new(body), vec![Box::new(held)], vec![Box::new(source), Box::new(enters)]);
    problem.start();
    let mut clock = Clock::new(1e-3);
    for _ in 0..50 {
        problem.step(&Solver::ForwardEuler(ForwardEuler), &mut clock, &mut |_, _| true).unwrap();
    }
    assert_eq!(simulation.model.hash(), problem.hash());
    assert!(books(&mut simulation)[2].abs() < 1e-12);
}

#[test]
fn a_run_writes_the_columns_and_the_report_of_diffusion() {
    let folder = std::env::temp_dir().join(format!("bondwise-diffusion-{}", std::process::id()));
    let conditions = "[[conditions]]\non = \"all\"\ninitial = { concentration = { value = \"1 + x\" } }".to_string();
    let outputs = "[[output]]\nvtu = { every_steps = 100 }\n[[output]]\npicture = { field = \"rate\" }\n[[output]]\n\
                   probe = { name = \"a\", at = [0.4, 0.0], every_steps = 10 }\n[[output]]\nhistory = { every_steps = 5 }\n";
    // A straight pre-crack of its own makes no crack tip.
    let cracks = "cracks = [{ segment = { from = [0.1, -0.6], to = [0.1, 0.2] } }]";
    let parts = Parts { conditions, cracks, solver: "end_time = 0.02".into(), ..Parts::new(2, 0.05) };
    let case = read_text::<Case>("case", &(parts.text() + outputs), &[]).unwrap();
    std::fs::create_dir_all(&folder).unwrap();
    let mut simulation = build(&case, &Options { folder: folder.clone(), ..Options::default() }).unwrap();
    let report = simulation.run(|progress| {
        assert_eq!(progress.broken_bonds, None);
        Control::Continue
    });
    let report = serde_json::to_value(report.unwrap()).unwrap();
    for key in ["micromodulus", "critical_stretch", "surface", "energy", "energy_imbalance", "crack_tip"] {
        assert!(report[key].is_null(), "{key}: {report:#}");
    }
    assert_eq!(report["diffusion"]["exponent"], 2);
    assert!(report["diffusion"]["imbalance"].as_f64().unwrap() < 1e-12, "{report:#}");
    assert!((report["books"]["amount"].as_f64().unwrap() - 1.0).abs() < 1e-12, "{report:#}");
    let text = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    assert!(text("history.csv").starts_with("step,time,amount,supplied,imbalance\n"), "{}", text("history.csv"));
    assert!(text("probe_a.csv").starts_with("step,time,concentration\n"), "{}", text("probe_a.csv"));
    let frame = std::fs::read(folder.join("frames/frame_00000000.vtu")).unwrap();
    assert!(String::from_utf8_lossy(&frame).contains("concentration"));
    let drawn: Vec<_> = std::fs::read_dir(folder.join("pictures")).unwrap().collect();
    assert_eq!(drawn.len(), 1);
    std::fs::remove_dir_all(&folder).unwrap();
}
