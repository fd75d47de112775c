//! Two conditions on one component of one point: equal values hold and are counted once, different ones are a mistake.

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::simulation::Simulation;

use crate::common::Random;

fn text(sets: &str, conditions: &str, solver: &str) -> String {
    format!(
        r#"
[case]
title = "Overlaps"
dimension = 2
[geometry]
shape = {{ rectangle = {{ size = ["12 mm", "8 mm"] }} }}
spacing = "1 mm"
[sets]
{sets}
[discretization]
horizon_ratio = 3
[physics.elasticity]
law = {{ bond_based = {{ young = "72 GPa", density = 2440.0 }} }}
{conditions}
[solver.{solver}]
"#
    )
}

fn built(text: &str) -> Result<Simulation, String> {
    let case = read_text::<Case>("overlaps", text, &[]).map_err(|e| format!("{:?}", e.list))?;
    build(&case, &Options::default()).map_err(|e| e.to_string())
}

fn run(text: &str) -> Simulation {
    let mut simulation = built(text).unwrap();
    simulation.model.start();
    while simulation.clock.step < simulation.n_steps {
        assert!(simulation.step(&mut |_, _| true).unwrap());
    }
    simulation
}

fn reaction(simulation: &Simulation, name: &str) -> f64 {
    simulation.model.reactions().into_iter().find(|(known, _)| known == name).expect("a support").1
}

/// Boxes that overlap at random, moved alike: what enters by them is what the body has.
#[test]
fn shared_points_are_counted_once() {
    let mut random = Random::new(3);
    for round in 0..12 {
        let mut edges = || {
            let [a, b] = [6.0 * random.next(), 4.0 * random.next()];
            [a - 2.5, b - 2.5, a + 2.5, b + 2.5].map(|x| x * 1e-3)
        };
        let [a, b] = [edges(), edges()];
        let set = |[x, y, z, w]: [f64; 4]| format!("{{ box = {{ low = [{x}, {y}], high = [{z}, {w}] }} }}");
        let values = [["2e-6*sin(1e6*t)", "2e-6*sin(1e6*t)"], ["3*x + 1e-3*t", "x + 2*x + t/1000"]][round % 2];
        let condition = |on: &str, value: &str| {
            format!(
                "[[conditions]]\non = \"{on}\"\nprescribe = {{ displacement = {{ component = 0, value = \"{value}\" }} }}\n"
            )
        };
        let values = values.map(|value| value.replace("3*x", "1e-3*x").replace("x + 2*x", "4e-4*x + 6e-4*x"));
        let conditions = condition("a", &values[0]) + &condition("b", &values[1]);
        let solver = ["velocity_verlet", "runge_kutta"][round / 2 % 2];
        let sets = format!("a = {}\nb = {}", set(a), set(b));
        let case =
            text(&sets, &conditions, &format!("{solver}]\nend_time = \"2 us\"\ntime_step = \"0.1 us\"\n[constants"));
        let mut simulation = run(&case);
        let balance = simulation.model.balance();
        // Rounding of 20 steps.
        assert!(balance.momentum_defect < 1e-12 * balance.momentum_scale, "round {round}: {balance:?}");
    }
}

#[test]
fn reactions_of_overlapping_supports_add_up_to_the_load() {
    let sets = "left = { where = \"x < -4e-3\" }\nbottom = { where = \"y < -2e-3\" }";
    let mut conditions: String = ["left", "bottom"]
        .iter()
        .flat_map(|on| [0, 1].map(|component| (on, component)))
        .map(|(on, component)| {
            format!(
                "[[conditions]]\non = \"{on}\"\nprescribe = {{ displacement = {{ component = {component}, value = 0.0 }} }}\n"
            )
        })
        .collect();
    conditions += "[surfaces]\ntop = { where = \"ny > 0.5\" }\n[[conditions]]\non = \"top\"\nload = { traction = { component = 1, value = 1e6 } }\n";
    for solver in ["static]\ntolerance = 1e-12\n[constants", "newton]\ntolerance = 1e-12\n[constants"] {
        let simulation = run(&text(sets, &conditions, solver));
        let sum = |axis: &str| {
            ["left", "bottom"].iter().map(|on| reaction(&simulation, &format!("{on}_{axis}"))).sum::<f64>()
        };
        // Forces are in balance to 1e-12 of the load.
        assert!((sum("y") / -1.2e4 - 1.0).abs() < 1e-9);
        assert!(sum("x").abs() < 1e-9 * 1.2e4);
    }
}

#[test]
fn contradictions_name_both_tables_a_point_and_the_values() {
    let sets = "left = { where = \"x < 0\" }";
    let condition = |on: &str, what: &str| format!("[[conditions]]\non = \"{on}\"\n{what}\n");
    let velocity = |key: &str, value: &str| format!("{key} = {{ velocity = {{ component = 1, value = {value} }} }}");
    let end = "velocity_verlet]\nend_time = \"1 us\"\n[constants";
    for (first, second, expected) in [
        (velocity("initial", "10.0"), velocity("initial", "3.0"), "it is 10 and here 3"),
        (velocity("prescribe", "10.0"), velocity("prescribe", "3.0"), "it is 10 and here 3"),
        (velocity("prescribe", "\"t\""), velocity("prescribe", "\"if(t < 9e-7, t, 0)\""), "and here 0"),
        (
            velocity("prescribe", "0.0"),
            "prescribe = { displacement = { component = 1, value = 0.0 } }".to_owned(),
            "it prescribes the velocity, this one the displacement",
        ),
    ] {
        let conditions = condition("all", &first) + &condition("left", &second);
        let error = built(&text(sets, &conditions, end)).err().expect("a mistake");
        for part in ["conditions[1]", "conditions[0] on `all`", "48 points", "position (", expected, "override = true"]
        {
            assert!(error.contains(part), "no `{part}` in {error}");
        }
        let excepted = condition("all", &first) + &condition("left", &(second.clone() + "\noverride = true"));
        let mut simulation = built(&text(sets, &excepted, end)).unwrap();
        if expected == "it is 10 and here 3" {
            simulation.model.start();
            let balance = simulation.model.balance();
            // Half of 96 cells of 1 mm² at either velocity.
            assert!((balance.momentum[1] / (48e-6 * 2440.0 * 13.0) - 1.0).abs() < 1e-12, "{:?}", balance.momentum);
        }
    }
    // One that ends first leaves the points to the other, whichever stands first.
    let moved = velocity("prescribe", "10.0");
    let conditions = condition("left", &(moved.clone() + "\nuntil = \"0.5 us\"")) + &condition("all", &moved);
    let simulation = run(&text(sets, &conditions, end));
    drop(simulation);
    let early = condition("all", &moved)
        + &condition("left", &(velocity("prescribe", "1.0") + "\nuntil = 5e-7\noverride = true"));
    assert!(
        built(&text(sets, &early, end))
            .err()
            .expect("a mistake")
            .contains("ends at t = 0.0000005 s, before conditions[0]")
    );
}
