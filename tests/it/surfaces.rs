//! Loads on surfaces: force and moment are those of the surface, whatever it is and however the cells lie in it.

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::simulation::Simulation;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

fn case(dimension: usize, shape: &str, spacing: f64, rest: &str) -> String {
    format!(
        r#"
[case]
title = "Loaded"
dimension = {dimension}
[geometry]
shape = {shape}
spacing = {spacing}
{rest}
[discretization]
horizon_ratio = 3
[physics.elasticity]
law = {{ bond_based = {{ young = 72e9, density = 2440.0 }} }}
[solver.velocity_verlet]
end_time = 1e-6
"#
    )
}

fn built(text: &str) -> Simulation {
    build(&read_text::<Case>("surfaces", text, &[]).unwrap(), &Options::default()).unwrap()
}

/// Pressure and traction on the whole surface, and a traction on a set of rows of the given depth below a face.
const LOADS: &str = r#"
[surfaces]
whole = { where = "1" }
[[conditions]]
on = "whole"
load = { pressure = { value = 1e6 } }
[[conditions]]
on = "whole"
load = { traction = { component = 1, value = 2e6 } }
"#;

fn close(found: [f64; 3], expected: [f64; 3], scale: f64, what: &str) {
    for d in 0..3 {
        // Sums over some hundred to some thousand pieces.
        assert!((found[d] - expected[d]).abs() < 1e-12 * scale, "{what}: {found:?}, and {expected:?} is right");
    }
}

/// Area and first moment of the surface: of corners joined by straight edges.
fn outline(corners: &[[f64; 2]]) -> (f64, [f64; 2]) {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).fold((0.0, [0.0; 2]), |(length, moment), (a, b)| {
        let l = (b[0] - a[0]).hypot(b[1] - a[1]);
        (length + l, [0, 1].map(|d| moment[d] + l * 0.5 * (a[d] + b[d])))
    })
}

#[test]
fn turned_plates_and_blocks_are_loaded_by_area_times_traction() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut share = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    for round in 0..60 {
        let unit = [1.0, 1e-3, 1e3][round % 3];
        let (angle, shift) = (6.3 * share(), [share() * unit, share() * unit]);
        let half = [unit * (0.5 + share()), unit * (0.3 + 0.3 * share())];
        let turned = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[a, b]: [f64; 2]| {
            let (x, y) = (a * half[0], b * half[1]);
            [shift[0] + x * angle.cos() - y * angle.sin(), shift[1] + x * angle.sin() + y * angle.cos()]
        });
        let spacing = unit * (0.07 + 0.05 * share());
        let (length, moment) = outline(&turned);
        let text = case(2, &format!("{{ polygon = {{ vertices = {turned:?} }} }}"), spacing, LOADS);
        let loads = built(&text).loads;
        let scale = 2e6 * length;
        assert!((loads[0].area.unwrap() / length - 1.0).abs() < 1e-12);
        close(loads[0].force, [0.0; 3], scale, &text);
        close(loads[0].moment, [0.0; 3], scale * 2.0 * unit, &text);
        close(loads[1].force, [0.0, 2e6 * length, 0.0], scale, &text);
        close(loads[1].moment, [0.0, 0.0, 2e6 * moment[0]], scale * 2.0 * unit, &text);
        if round % 6 != 0 {
            continue;
        }
        // The same, six cells high.
        let high = 6.0 * spacing;
        let area: f64 = 4.0 * half[0] * half[1];
        let shape = format!("{{ extrusion = {{ vertices = {turned:?}, low = 0.0, high = {high} }} }}");
        let text = case(3, &shape, spacing, LOADS);
        let loads = built(&text).loads;
        let whole = length * high + 2.0 * area;
        let scale = 2e6 * whole;
        assert!((loads[0].area.unwrap() / whole - 1.0).abs() < 1e-12);
        close(loads[0].force, [0.0; 3], scale, &text);
        close(loads[0].moment, [0.0; 3], scale * 2.0 * unit, &text);
        close(loads[1].force, [0.0, 2e6 * whole, 0.0], scale, &text);
        let about = |d: usize| 2e6 * (moment[d] * high + 2.0 * area * shift[d]);
        close(loads[1].moment, [-2e6 * whole * 0.5 * high, 0.0, about(0)], scale * 2.0 * unit, &text);
    }
}

#[test]
fn round_bodies_are_pressed_in_balance() {
    for (dimension, shape, area) in [
        (2, "{ disk = { radius = 1.03 } }", 2.0 * 1.03 * std::f64::consts::PI),
        (2, "{ ring = { inner = 0.4, outer = 1.0 } }", 2.8 * std::f64::consts::PI),
        (3, "{ sphere = { radius = 0.5 } }", std::f64::consts::PI),
        (3, "{ tube = { inner = 0.3, outer = 0.6, length = 0.5, axis = \"y\" } }", std::f64::consts::PI * (0.9 + 0.54)),
    ] {
        let loads = built(&case(dimension, shape, 0.1, LOADS)).loads;
        assert!((loads[0].area.unwrap() / area - 1.0).abs() < 1e-12, "{shape}");
        close(loads[0].force, [0.0; 3], 1e6 * area, shape);
        close(loads[0].moment, [0.0; 3], 1e6 * area, shape);
        close(loads[1].force, [0.0, 2e6 * area, 0.0], 2e6 * area, shape);
    }
}

#[test]
fn a_set_stands_for_the_surface_above_it_however_deep_it_is() {
    for rows in [1, 2, 3, 5] {
        let rest = format!(
            r#"
[sets]
top = {{ where = "y > 0.5 - {rows}*0.05" }}
layer = {{ layer = {{ thickness = "{rows}*0.05" }} }}
[[conditions]]
on = "top"
load = {{ traction = {{ component = 1, value = 1e6 }} }}
[[conditions]]
on = "layer"
load = {{ pressure = {{ value = 1e6 }} }}
[[conditions]]
on = "all"
load = {{ pressure = {{ value = 1e6 }} }}
"#
        );
        let loads = built(&case(2, "{ box = { low = [0.0, 0.0], high = [2.0, 0.5] } }", 0.05, &rest)).loads;
        close(loads[0].force, [0.0, 2e6, 0.0], 2e6, "the upper edge");
        close(loads[0].moment, [0.0, 0.0, 2e6], 2e6, "the upper edge");
        assert!((loads[1].area.unwrap() - 5.0).abs() < 1e-12 && (loads[2].area.unwrap() - 5.0).abs() < 1e-12);
    }
}

#[test]
fn points_lines_and_moments_have_their_force_and_moment() {
    let rest = r#"
[surfaces]
right = { where = "nx > 0.5" }
[[conditions]]
load = { point = { at = [1.0, 0.13, 0.27], component = 2, value = 7.0 } }
[[conditions]]
load = { line = { from = [0.2, 0.0, 0.5], to = [0.8, 0.3, 0.5], component = 0, value = "10*x" } }
[[conditions]]
on = "right"
load = { moment = { axis = "y", value = "3*t" } }
"#;
    let loads = built(&case(3, "{ box = { low = [0.0, 0.0, 0.0], high = [1.0, 0.5, 0.5] } }", 0.1, rest)).loads;
    close(loads[0].force, [0.0, 0.0, 7.0], 7.0, "point");
    close(loads[0].moment, [0.13 * 7.0, -7.0, 0.0], 7.0, "point");
    let length = 0.45f64.sqrt();
    close(loads[1].force, [5.0 * length, 0.0, 0.0], 7.0, "line");
    // The formula is taken in the middle of each of 14 pieces: y varies by 0.3/14 within one.
    let error = 10.0 * length * 0.6 * 0.3 / 12.0 / 14.0f64.powi(2);
    assert!((loads[1].moment[2] + 10.0 * length * 0.09).abs() < 1.001 * error, "{:?}", loads[1]);
    close(loads[2].force, [0.0; 3], 1e-5, "moment");
    close(loads[2].moment, [0.0, 3e-6, 0.0], 3e-6, "moment");
    assert_eq!(loads[2].time, 1e-6);
}

/// What a load does in a run: momentum is force times time, in both methods, and on cells that are replaced.
#[test]
fn a_pulled_face_gives_the_body_its_momentum() {
    for solver in ["velocity_verlet", "runge_kutta"] {
        let rest = r#"
[surfaces]
right = { where = "nx > 0.5" }
[[conditions]]
on = "right"
load = { traction = { component = 0, value = "1e6*(1 + y)" } }
"#;
        let text = case(2, "{ box = { low = [0.0, -0.2], high = [1.0, 0.2] } }", 0.05, rest);
        let mut simulation = built(&text.replace("velocity_verlet]", &format!("{solver}]\ntime_step = 5e-8")));
        simulation.model.start();
        while simulation.clock.step < simulation.n_steps {
            simulation.step(&mut |_, _| true).unwrap();
        }
        let balance = simulation.model.balance();
        let expected = 0.4e6 * simulation.clock.time();
        // Rounding of 20 steps.
        assert!(
            (balance.momentum[0] / expected - 1.0).abs() < 1e-12,
            "{solver}: {:?} for {expected}",
            balance.momentum
        );
        assert!(balance.momentum[1].abs() < 1e-12 * expected);
    }
}
