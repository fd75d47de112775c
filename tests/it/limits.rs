//! Solvers at their limits: strong damping, the last instant, `until`, steps above the estimate of the stable one.

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::field::Values;
use bondwise::simulation::Simulation;

fn try_text(text: &str) -> Result<Simulation, String> {
    let case = read_text::<Case>("limits", text, &[]).map_err(|e| e.to_string())?;
    build(&case, &Options::default()).map_err(|e| e.to_string())
}

fn finished(text: &str) -> Simulation {
    let mut simulation = try_text(text).unwrap();
    simulation.model.start();
    while simulation.clock.step < simulation.n_steps {
        assert!(simulation.step(&mut |_, _| true).unwrap());
    }
    let (solver, clock) = (simulation.solver, simulation.clock);
    simulation.model.conclude(&solver, &clock).unwrap();
    simulation
}

fn of_x(simulation: &mut Simulation, name: &str) -> Vec<f64> {
    match simulation.model.field(name).unwrap().values {
        Values::Vector(values) => values.iter().map(|x| x[0]).collect(),
        Values::Scalar(values) => values,
        _ => panic!("a vector or a number"),
    }
}

/// A body of 10 cells a side, what it is made of, what acts on it, and its solver.
struct Parts<'a> {
    dimension: i32,
    geometry: &'a str,
    discretization: &'a str,
    law: &'a str,
    conditions: &'a str,
    solver: String,
}

const LINEAR: &str = "law = { bond_based_linear = { young = \"1 GPa\", density = 1000 } }";
const MOVING: &str = "[[conditions]]\non = \"all\"\ninitial = { velocity = { component = 0, value = 1.0 } }\n";

impl Parts<'_> {
    fn new(solver: impl Into<String>) -> Self {
        let solver = solver.into();
        Parts { dimension: 1, geometry: "", discretization: "", law: LINEAR, conditions: "", solver }
    }

    fn text(&self) -> String {
        let Parts { dimension, geometry, discretization, law, conditions, solver } = self;
        let corner = |x: f64| format!("{:?}", vec![x; *dimension as usize]);
        format!(
            "[case]\ntitle = \"limits\"\ndimension = {dimension}\n[geometry]\n\
             shape = {{ box = {{ low = {}, high = {} }} }}\nspacing = 0.01\n{geometry}\n\
             [sets]\nleft = {{ where = \"x < 0.03\" }}\n[discretization]\nhorizon_ratio = 3\n{discretization}\n\
             [physics.elasticity]\n{law}\n{conditions}\n{solver}\n",
            corner(0.0),
            corner(0.1)
        )
    }
}

fn verlet(rest: &str) -> String {
    format!("[solver.velocity_verlet]\n{rest}")
}

fn runge_kutta(rest: &str) -> String {
    format!("[solver.runge_kutta]\n{rest}")
}

/// v = e^(−ct), u = (1 − e^(−ct))/c of a body that nothing strains, whatever c Δt; energy and momentum balance.
#[test]
fn velocities_decay_as_damping_says_however_strong_it_is() {
    let bodies = [
        (1, "", "", LINEAR),
        (2, "", "", "law = { bond_based = { young = \"1 GPa\", density = 1000 } }"),
        (2, "perturb = { amplitude = 0.2 }", "", LINEAR),
        (3, "", "", "law = { state_based = { young = \"1 GPa\", poisson = 0.2, density = 1000 } }"),
        (2, "", "precision = \"single\"", LINEAR),
        (2, "", "scheme = { hybrid = { buffer = 1 } }", LINEAR),
    ];
    for (dimension, geometry, discretization, law) in bodies {
        for damping in [1e3, 1e5, 1e6, 3e6, 1e7, 1e9, 1e13] {
            let solver = verlet(&format!("end_time = 1e-5\ntime_step = 1e-6\ndamping = {damping:e}"));
            let parts = Parts { dimension, geometry, discretization, law, conditions: MOVING, ..Parts::new(solver) };
            let mut body = finished(&parts.text());
            let exact = [f64::exp(-damping * 1e-5), -f64::exp_m1(-damping * 1e-5) / damping];
            let label = format!("{dimension}D {geometry} {discretization} {damping:e}");
            // Roundings of ten steps, in the numbers of the fields.
            let allowed = if discretization.contains("single") { 2e-6 } else { 1e-13 };
            for (name, exact) in [("velocity", exact[0]), ("displacement", exact[1])] {
                for value in of_x(&mut body, name) {
                    assert!((value - exact).abs() <= allowed * exact.max(1e-7), "{label}: {name} {value} {exact}");
                }
            }
            let balance = body.model.balance();
            assert!(balance.defect().abs() < 10.0 * allowed * balance.scale(), "{label}: {balance:?}");
            let initial = 1000.0 * 0.1f64.powi(dimension);
            assert!(balance.momentum_defect < 10.0 * allowed * initial, "{label}: {balance:?}");
        }
    }
}

/// A load of its own for each time, and strong damping: the books of momentum close whatever the weights of both ends.
#[test]
fn momentum_balances_with_damping_and_loads_that_vary() {
    let conditions = "[[conditions]]\non = \"left\"\nload = { body_force = { component = 0, value = \"1e6*sin(3e5*t)\" } }\n\
                      [[conditions]]\non = \"left\"\nprescribe = { displacement = { component = 0, value = \"1e-6*sin(2e5*t)\" } }\n";
    for conditions in [conditions, conditions.split_once("[[conditions]]\non = \"left\"\nprescribe").unwrap().0] {
        for damping in [0.0, 1e4, 1e6, 1e8] {
            let solver = verlet(&format!("end_time = 5e-5\ntime_step = 1e-6\ndamping = {damping:e}"));
            let mut body = finished(&Parts { conditions, ..Parts::new(solver) }.text());
            let balance = body.model.balance();
            // Impulses of up to 1e6 N/m³ over 5e-5 s in 3 cells of 0.01 m, in 50 roundings.
            assert!(balance.momentum_defect < 1e-12 * 1.5, "{damping:e}: {balance:?}");
        }
    }
}

/// Damping that Runge–Kutta cannot carry is refused, with the largest; up to it, and with a step chosen from it, v dies out.
#[test]
fn runge_kutta_is_given_no_damping_that_its_step_cannot_carry() {
    let text = |rest: &str| Parts { conditions: MOVING, ..Parts::new(runge_kutta(rest)) }.text();
    let Err(refused) = try_text(&text("end_time = 1e-4\ntime_step = 1e-6\ndamping = 1e7")) else { panic!("a refusal") };
    for part in ["solver.runge_kutta.damping: found 1e7", "bears up to 2.785", "velocity_verlet"] {
        assert!(refused.contains(part), "{part}: {refused}");
    }
    for rest in [
        "end_time = 1e-4\ntime_step = 1e-6\ndamping = 2.78e6",
        "end_time = 1e-4\nsafety = 1.0\ndamping = 1e7",
        "end_time = 1e-4\ndamping = 1e7",
        "end_time = 1e-4\nsafety = 1.0\ndamping = 1e5",
    ] {
        let mut body = finished(&text(rest));
        assert!(of_x(&mut body, "velocity").iter().all(|v| v.abs() <= 1.0), "{rest}");
    }
}

/// The last instant is `end_time`, whatever the step, and formulas that end there have a slope there.
#[test]
fn a_run_ends_at_its_end_and_formulas_are_not_asked_beyond() {
    for solver in ["velocity_verlet", "runge_kutta"] {
        for (dt, steps) in [("1e-6", 100), ("3e-6", 34), ("7e-6", 15), ("1e-5", 10)] {
            for (formula, end, slope) in [
                ("1e-3*(1 - (1 - t/1e-4)^1.5)", 1e-3, 0.0),
                ("1e-3*(1 - sqrt(max(0, 1 - t/1e-4)^3)) + 0*log(t + 1e-30) + 0*sqrt(1e-4 - t)", 1e-3, 0.0),
                ("1e-3*(t/1e-4)^1.5", 1e-3, 15.0),
            ] {
                let conditions = format!(
                    "[[conditions]]\non = \"left\"\nprescribe = {{ displacement = {{ component = 0, value = \"{formula}\" }} }}\n"
                );
                let text = format!("[solver.{solver}]\nend_time = 1e-4\ntime_step = {dt}");
                let mut body = finished(&Parts { conditions: &conditions, ..Parts::new(text) }.text());
                let label = format!("{solver} {dt} {formula}");
                assert_eq!((body.clock.time(), body.n_steps), (1e-4, steps), "{label}");
                let [u, v] = ["displacement", "velocity"].map(|name| of_x(&mut body, name)[0]);
                assert!((u - end).abs() < 1e-15, "{label}: {u}");
                // (1 − t/T)^1.5 has no second derivative at T: its difference over h is some √(h/T) of 10 m/s.
                let h: f64 = dt.parse().unwrap();
                assert!((v - slope).abs() < 10.0 * (h / 1e-4).sqrt(), "{label}: {v}");
            }
        }
    }
    // Of smooth formulas one side is as good as two: second order, and fourth.
    for (solver, order) in [("velocity_verlet", 2.0), ("runge_kutta", 4.0)] {
        let error = |dt: f64| {
            let conditions = "[[conditions]]\non = \"all\"\nprescribe = { displacement = { component = 0, value = \"1e-3*sin(2e4*t)\" } }\n";
            let text = format!("[solver.{solver}]\nend_time = 1e-4\ntime_step = {dt:e}");
            let mut body = finished(&Parts { conditions, ..Parts::new(text) }.text());
            (of_x(&mut body, "velocity")[0] - 20.0 * 2f64.cos()).abs()
        };
        let found = (error(5e-6) / error(2.5e-6)).log2();
        // The next term is of relative size Δt.
        assert!((found - order).abs() < 0.3, "{solver}: {found}");
    }
    // One step, shorter than asked.
    let body = finished(&Parts::new(verlet("end_time = 1e-7\ntime_step = 1e-6")).text());
    assert_eq!((body.clock.time(), body.n_steps), (1e-7, 1));
}

/// A constant force acts for as long as `until` says, on a step or between two, by every solver: its impulse is exact.
#[test]
fn until_is_an_instant() {
    for solver in ["velocity_verlet", "runge_kutta"] {
        for until in ["1e-7", "4e-7", "1e-6", "2.5e-6", "9e-6", "9.3e-6", "9.99e-6", "1e-5", "2e-5"] {
            let conditions = format!(
                "[[conditions]]\non = \"all\"\nload = {{ body_force = {{ component = 0, value = 1e9 }} }}\nuntil = {until}\n"
            );
            let text = format!("[solver.{solver}]\nend_time = 1e-5\ntime_step = 1e-6");
            let mut body = finished(&Parts { conditions: &conditions, ..Parts::new(text) }.text());
            let t: f64 = until.parse::<f64>().unwrap().min(1e-5);
            let exact = [1e6 * t, 0.5 * 1e6 * t * t + 1e6 * t * (1e-5 - t)];
            for (name, exact) in [("velocity", exact[0]), ("displacement", exact[1])] {
                for value in of_x(&mut body, name) {
                    assert!((value / exact - 1.0).abs() < 1e-12, "{solver} {until}: {name} {value} {exact}");
                }
            }
            assert_eq!(body.clock.time(), 1e-5, "{solver} {until}");
            assert!(body.model.balance().momentum_defect < 1e-10, "{solver} {until}");
        }
        // What is prescribed is let go at that instant.
        let conditions = "[[conditions]]\non = \"all\"\nprescribe = { velocity = { component = 0, value = \"1e6*t\" } }\nuntil = 3.4e-6\n";
        let text = format!("[solver.{solver}]\nend_time = 1e-5\ntime_step = 1e-6");
        let mut body = finished(&Parts { conditions, ..Parts::new(text) }.text());
        for v in of_x(&mut body, "velocity") {
            assert!((v - 3.4).abs() < 1e-12, "{solver}: {v}");
        }
    }
    for until in ["0.1", "0.45", "0.5"] {
        let text = format!(
            "[case]\ntitle = \"d\"\ndimension = 1\n[geometry]\nshape = {{ box = {{ low = [0.0], high = [1.0] }} }}\n\
             spacing = 0.1\n[discretization]\nhorizon_ratio = 3\n[physics.diffusion]\ndiffusivity = 1e-3\n\
             [[conditions]]\non = \"all\"\nload = {{ source = {{ value = 2.0 }} }}\nuntil = {until}\n\
             [solver.forward_euler]\nend_time = 1.0\ntime_step = 0.1\n"
        );
        let exact = 2.0 * until.parse::<f64>().unwrap();
        for c in of_x(&mut finished(&text), "concentration") {
            assert!((c - exact).abs() < 1e-14, "{until}: {c}");
        }
    }
}

/// Steps that are given, up to the one that is proven, are stable; above it they are refused.
#[test]
fn a_step_above_the_estimate_is_taken_when_it_is_proven_stable() {
    let bodies = [
        (1, "", "", LINEAR),
        (2, "", "", LINEAR),
        (2, "perturb = { amplitude = 0.2 }", "", "law = { bond_based = { young = \"1 GPa\", density = 1000 } }"),
        (2, "", "", "law = { state_based = { young = \"1 GPa\", poisson = 0.2, density = 1000 } }"),
    ];
    for (dimension, geometry, discretization, law) in bodies {
        let conditions = "[[conditions]]\non = \"all\"\ninitial = { displacement = { component = 0, value = \
                          \"1e-12*sin(1e5*x*x + 7e4*x*y)\" } }\n";
        let at = |step: f64| {
            let solver = verlet(&format!("end_time = {:e}\ntime_step = {step:e}", 200.0 * step));
            Parts { dimension, geometry, discretization, law, conditions, ..Parts::new(solver) }.text()
        };
        let refused = try_text(&at(1e-3)).err().unwrap();
        assert!(refused.contains("proven stable"), "{refused}");
        let number = |after: &str| -> f64 {
            let rest = refused.split_once(after).unwrap().1;
            rest.split_whitespace().next().unwrap().parse().unwrap()
        };
        let [proven, estimate] = [number("above the stable step "), number("without proof: ")];
        assert!(proven > 1.02 * estimate, "{refused}");
        let mut body = finished(&at(0.999 * proven));
        let largest = of_x(&mut body, "displacement").iter().fold(0.0, |most: f64, u| most.max(u.abs()));
        // Near the limit, amplitudes may grow to 1/√(1 − 0.999²) = 22, of unlike signs at 100 points at most.
        assert!(largest < 1e-9, "{law}: {largest}");
        assert!(try_text(&at(1.001 * proven)).is_err());
    }
}
