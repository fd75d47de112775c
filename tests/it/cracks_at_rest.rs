//! Cracks that grow at rest, against a reference that factors the tangent anew for each bond, and against themselves.

use std::collections::BTreeSet;

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::simulation::Simulation;
use bondwise::solver::linear::{Direct, Sparse};

/// An L-shaped panel that is pushed up at its arm (Winkler 2001), of cells of 31 mm.
const PANEL: &str = r#"
[case]
title = "Panel"
dimension = 2
[constants]
h = "31.25 mm"
[geometry]
spacing = "h"
shape = { polygon = { vertices = [[0,0],["250 mm",0],["250 mm","250 mm"],["500 mm","250 mm"],["500 mm","500 mm"],[0,"500 mm"]] } }
[sets]
base = { where = "y < 3*h" }
pusher = { box = { low = ["450 mm","250 mm"], high = ["480 mm","275 mm"] } }
[discretization]
horizon_ratio = 3
influence = "constant"
partial_volumes = "ramp"
[physics.elasticity]
law = { bond_based_linear = { young = "25.85 GPa", density = "2400 kg/m^3", plane = "stress" } }
failure = { critical_stretch = { fracture_energy = "90 J/m^2", no_fail = ["base", "pusher"] } }
[[conditions]]
on = "base"
prescribe = { displacement = { component = 0, value = 0 } }
[[conditions]]
on = "base"
prescribe = { displacement = { component = 1, value = 0 } }
[[conditions]]
on = "pusher"
prescribe = { displacement = { component = 1, value = "0.9e-3*t" } }
[solver.quasi_static]
steps = 10
"#;

/// The same, changed.
fn panel(changes: &[(&str, &str)]) -> Simulation {
    let mut text = PANEL.to_string();
    for (old, new) in changes {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    build(&read_text::<Case>("panel", &text, &[]).unwrap(), &Options::default()).unwrap()
}

fn settled(mut simulation: Simulation) -> Simulation {
    simulation.model.start();
    while simulation.clock.step < simulation.n_steps {
        simulation.model.step(&simulation.solver, &mut simulation.clock).unwrap();
    }
    simulation
}

/// Breaks of all load steps: time, power, bonds broken before.
fn path(simulation: &Simulation) -> Vec<[f64; 3]> {
    let (mut path, mut before) = (Vec::new(), 0.0);
    for step in simulation.model.load_steps() {
        path.extend(step.path.iter().map(|[t, power, broken]| [*t, *power, before + broken]));
        assert_eq!(step.breaks, step.path.len(), "all of them are kept");
        before += step.broken as f64;
    }
    path
}

/// Pairs of points whose bonds hold, rounded to micrometres, the first one first.
fn whole(simulation: &Simulation, mirrored: bool) -> BTreeSet<[[i64; 2]; 2]> {
    let words = simulation.model.bond_words();
    let set = (0..16 * words.len()).filter(|bit| words[bit / 16] >> (bit % 16) & 1 == 1);
    let ends = set.map(|bit| {
        let round =
            |x: [f64; 3]| [(1e6 * x[0]).round() as i64, (1e6 * x[1]).round() as i64 * if mirrored { -1 } else { 1 }];
        let mut ends = simulation.model.bond_ends(bit).map(round);
        ends.sort_unstable();
        ends
    });
    ends.collect()
}

/// Linear springs, and what is prescribed: u = u_f + t u₁ by two solutions with a new factor.
struct Reference {
    /// Points, ξ, w and whether it may break, of each bond.
    bonds: Vec<([usize; 2], [f64; 2], f64, bool)>,
    holds: Vec<bool>,
    critical: f64,
    /// Prescribed displacements over t, by unknown, x and y in turn.
    held: Vec<Option<f64>>,
    /// Loads that stay, and over t, N.
    load: [Vec<f64>; 2],
}

impl Reference {
    fn of_panel(simulation: &Simulation, u_max: f64, load: [[f64; 2]; 2]) -> Self {
        let (h, young, energy) = (31.25e-3, 25.85e9, 90.0);
        let x = simulation.model.positions().to_vec();
        let delta = 3.0 * h;
        let near = |x: &[f64; 3]| x[0] > 0.45 && x[0] < 0.48 && x[1] > 0.25 && x[1] < 0.275;
        let spared: Vec<bool> = x.iter().map(|x| x[1] < 3.0 * h || near(x)).collect();
        let mut bonds = Vec::new();
        for i in 0..x.len() {
            for j in i + 1..x.len() {
                let xi = [x[j][0] - x[i][0], x[j][1] - x[i][1]];
                let r = xi[0].hypot(xi[1]);
                let beta = ((delta + 0.5 * h - r) / h).clamp(0.0, 1.0);
                if beta > 1e-9 {
                    let weight = 9.0 * young / (std::f64::consts::PI * delta.powi(3)) * beta * h.powi(4) * r;
                    bonds.push(([i, j], xi, weight, !(spared[i] || spared[j])));
                }
            }
        }
        let mut held = vec![None; 2 * x.len()];
        let mut loads = [vec![0.0; 2 * x.len()], vec![0.0; 2 * x.len()]];
        for (k, x) in x.iter().enumerate() {
            if x[1] < 3.0 * h {
                (held[2 * k], held[2 * k + 1]) = (Some(0.0), Some(0.0));
            } else if near(x) {
                held[2 * k + 1] = Some(u_max);
            }
            // On the left edge above the base.
            if x[0] < h {
                for (loads, load) in loads.iter_mut().zip(load) {
                    loads[2 * k] = load[0] * h * h;
                    loads[2 * k + 1] = load[1] * h * h;
                }
            }
        }
        let critical = (4.0 * std::f64::consts::PI * energy / (9.0 * young * delta)).sqrt();
        Reference { holds: vec![true; bonds.len()], bonds, critical, held, load: loads }
    }

    fn slope(&self, bond: usize) -> [(usize, f64); 4] {
        let ([i, j], xi, ..) = self.bonds[bond];
        let square = xi[0] * xi[0] + xi[1] * xi[1];
        let g = xi.map(|x| x / square);
        [(2 * i, -g[0]), (2 * i + 1, -g[1]), (2 * j, g[0]), (2 * j + 1, g[1])]
    }

    /// Strains at t = 0 and over t, and dQ/dt at t = 0 and over t.
    fn solve(&self) -> (Vec<[f64; 2]>, [f64; 2]) {
        let n = self.held.len();
        let (mut triplets, mut right) = (Vec::new(), [self.load[0].clone(), self.load[1].clone()]);
        for k in 0..n {
            if self.held[k].is_some() {
                triplets.push((k as u32, k as u32, 1.0));
                (right[0][k], right[1][k]) = (0.0, self.held[k].unwrap_or(0.0));
            }
        }
        for bond in 0..self.bonds.len() {
            let weight = self.bonds[bond].2 * if self.holds[bond] { 1.0 } else { 1e-10 };
            let g = self.slope(bond);
            for (a, x) in g.into_iter().filter(|(a, _)| self.held[*a].is_none()) {
                for (b, y) in g {
                    match self.held[b] {
                        None => triplets.push((a as u32, b as u32, weight * x * y)),
                        Some(u) => right[1][a] -= weight * x * y * u,
                    }
                }
            }
        }
        let factor = Direct::cholesky(&Sparse::from_triplets(n, &triplets)).unwrap();
        right.iter_mut().for_each(|right| factor.solve(right).unwrap());
        let strain = |bond| right.each_ref().map(|u| self.slope(bond).iter().map(|(k, g)| g * u[*k]).sum::<f64>());
        let strains: Vec<[f64; 2]> = (0..self.bonds.len()).map(strain).collect();
        // Forces of held unknowns times the rates of their displacements, less rates of loads times displacements.
        let mut power = [0.0; 2];
        for (bond, strain) in strains.iter().enumerate().filter(|(bond, _)| self.holds[*bond]) {
            let rate: f64 = self.slope(bond).iter().map(|(k, g)| g * self.held[*k].unwrap_or(0.0)).sum();
            (0..2).for_each(|c| power[c] += self.bonds[bond].2 * strain[c] * rate);
        }
        for k in (0..n).filter(|k| self.held[*k].is_none()) {
            (0..2).for_each(|c| power[c] -= self.load[1][k] * right[c][k]);
        }
        (strains, power)
    }

    /// Breaks to t = `end`; loads stay, or follow down.
    fn grow(&mut self, end: f64, follow: bool) -> Vec<[f64; 3]> {
        let (mut t, mut broken, mut path) = (0.0f64, 0.0, Vec::new());
        loop {
            let (strains, power) = self.solve();
            let may = |k: &usize| self.holds[*k] && self.bonds[*k].3;
            let time = |[s, rate]: [f64; 2]| if rate > 0.0 { (self.critical - s) / rate } else { f64::INFINITY };
            let all: Vec<usize> = (0..strains.len()).filter(may).collect();
            let over = |k: &usize| (strains[*k][0] + t * strains[*k][1]) / self.critical;
            let worst = all.iter().map(over).fold(0.0, f64::max);
            if follow || worst <= 1.0 {
                t = all.iter().map(|k| time(strains[*k])).fold(f64::INFINITY, f64::min);
            }
            if t > end {
                return path;
            }
            path.push([t, power[0] + t * power[1], broken]);
            let over = |k: &usize| (strains[*k][0] + t * strains[*k][1]) / self.critical;
            let worst = all.iter().map(over).fold(0.0, f64::max);
            for k in all.iter().filter(|k| over(k) >= worst * (1.0 - 1e-7)).copied().collect::<Vec<_>>() {
                self.holds[k] = false;
                broken += 1.0;
            }
        }
    }
}

/// `bound`: of the relative difference of times and powers.
fn assert_same(found: &[[f64; 3]], expected: &[[f64; 3]], bound: f64, what: &str) {
    assert!(expected.len() > 20, "{what}: {} breaks", expected.len());
    let largest = expected.iter().map(|event| event[1].abs()).fold(0.0, f64::max);
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        let near = (a[0] - b[0]).abs() < bound * b[0].abs() && (a[1] - b[1]).abs() < bound * largest && a[2] == b[2];
        assert!(near, "{what}: break {k} of {}: {a:?} {b:?}", expected.len());
    }
    assert_eq!(found.len(), expected.len(), "{what}");
}

fn assert_booked(simulation: &mut Simulation, what: &str) {
    let balance = simulation.model.balance();
    let defect = balance.defect().abs() / balance.external;
    println!("{what}: energy defect {defect:e}, {balance:?}");
    // Ways are straight and forces linear: what is left are roundings of sums, and of factors.
    assert!(defect < 1e-9, "{what}: {defect:e}");
    assert!(balance.damped >= 0.0 && balance.fracture > 0.0);
}

#[test]
fn bonds_break_in_the_order_that_new_factors_give() {
    for (control, follow) in [("load", false), ("equilibrium", true)] {
        let steps = format!("steps = 10\ncontrol = \"{control}\"");
        let mut found = settled(panel(&[("steps = 10", &steps)]));
        let expected = Reference::of_panel(&found, 0.9e-3, [[0.0; 2]; 2]).grow(1.0, follow);
        // The reference leaves broken bonds 1e-10 of their stiffness, of an opening of some hundred critical stretches.
        assert_same(&path(&found), &expected, 1e-6, control);
        assert_booked(&mut found, control);
    }
}

/// A load that stays, one that grows, and a prescribed displacement, by factors and by conjugate gradients.
#[test]
fn loads_beside_prescribed_displacements_are_exact_too() {
    let loads = "[[conditions]]\non = \"left\"\nload = { body_force = { component = 0, value = \"-2e5 - 3e5*t\" } }\n\
                 [[conditions]]\non = \"left\"\nload = { body_force = { component = 1, value = \"-1e5\" } }\n[solver";
    for linear in ["linear = \"direct\"", "linear = \"conjugate_gradients\"\ntolerance = 1e-12"] {
        let mut found = settled(panel(&[
            ("[solver", loads),
            ("base = {", "left = { where = \"x < h\" }\nbase = {"),
            ("steps = 10", &format!("steps = 10\n{linear}")),
        ]));
        let load = [[-2e5, -1e5], [-3e5, 0.0]];
        let expected = Reference::of_panel(&found, 0.9e-3, load).grow(1.0, false);
        assert_same(&path(&found), &expected, 1e-6, linear);
        assert_booked(&mut found, linear);
    }
}

#[test]
fn linear_solvers_and_factors_break_the_same_bonds() {
    let direct = settled(panel(&[]));
    for linear in [
        "linear = \"conjugate_gradients\"\ntolerance = 1e-11",
        "preconditioner = \"incomplete_factors\"\ntolerance = 1e-11",
        "linear = \"gmres\"\ntolerance = 1e-11",
    ] {
        let mut found = settled(panel(&[("steps = 10", &format!("steps = 10\n{linear}"))]));
        assert_same(&path(&found), &path(&direct), 1e-7, linear);
        assert_eq!(whole(&found, false), whole(&direct, false));
        assert_booked(&mut found, linear);
    }
}

/// Both ends of a strip are pulled apart until nothing holds them together: a state at rest, without forces.
#[test]
#[ignore = "not reached: after the last bond a load step may end without equilibrium"]
fn a_strip_pulled_in_two_ends_at_rest() {
    for (dimension, shape, linear) in [
        (1, "segment = { low = 0.0, high = 0.02 }", ""),
        (2, "rectangle = { size = [0.04, 0.012] }", ""),
        (2, "rectangle = { size = [0.04, 0.012] }", "linear = \"conjugate_gradients\""),
        (3, "block = { size = [0.012, 0.004, 0.004] }", ""),
    ] {
        for law in ["bond_based_linear", "bond_based"] {
            let mut text = format!(
                r#"
[case]
title = "Strip"
dimension = {dimension}
[geometry]
shape = {{ {shape} }}
spacing = 1e-3
[sets]
left = {{ where = "x < low" }}
right = {{ where = "x > high" }}
[constants]
low = {low}
high = {high}
[discretization]
horizon_ratio = 3
[physics.elasticity]
law = {{ {law} = {{ young = "70 GPa", density = 2700.0 }} }}
failure = {{ critical_stretch = {{ stretch = 1e-3, no_fail = ["left", "right"] }} }}
[solver.quasi_static]
steps = 3
{linear}
"#,
                low = if dimension == 1 { 0.0029 } else { [0.0, 0.0, -0.0171, -0.0031][dimension] },
                high = if dimension == 1 { 0.0171 } else { [0.0, 0.0, 0.0171, 0.0031][dimension] },
            );
            for component in 0..dimension {
                for (set, value) in [("left", "0"), ("right", if component == 0 { "1e-3*t" } else { "0" })] {
                    text += &format!(
                        "[[conditions]]\non = \"{set}\"\nprescribe = {{ displacement = {{ component = {component}, value = \"{value}\" }} }}\n"
                    );
                }
            }
            let body = build(&read_text::<Case>("strip", &text, &[]).unwrap(), &Options::default()).unwrap();
            let mut body = settled(body);
            let what = format!("{dimension}D {law} {linear}");
            assert_eq!(body.clock.time(), 1.0, "{what}");
            let forces: f64 = body.model.reactions().iter().map(|(_, force)| force.abs()).sum();
            let first = body.model.load_steps().iter().flat_map(|step| &step.path).next().unwrap()[1] / 1e-3;
            assert!(forces < 1e-6 * first, "{what}: {forces:e} of {first:e}");
            let balance = body.model.balance();
            assert!(balance.strain < 1e-9 * balance.external, "{what}: {balance:?}");
            assert!(
                balance.defect().abs() < if law == "bond_based" { 1e-3 } else { 1e-9 } * balance.external,
                "{what}: {balance:?}"
            );
        }
    }
}

/// What is alike above and below breaks alike, by either control.
#[test]
fn a_crack_in_the_middle_stays_there() {
    let bundled = bondwise::case::bundled::CASES.iter().find(|case| case.name == "double_cantilever").unwrap();
    for (control, linear) in [("load", "direct"), ("equilibrium", "direct")] {
        let changes = [
            ("geometry.shape.rectangle.size", "[0.04, 0.02]"),
            ("geometry.cracks.0.segment.from.0", "-0.021"),
            ("geometry.cracks.0.segment.to.0", "-0.004"),
            ("sets.top.where", "x < -0.017 and y > 0.008"),
            ("sets.bottom.where", "x < -0.017 and y < -0.008"),
            ("sets.right.where", "x > 0.017"),
            ("solver.quasi_static.steps", "4"),
            ("solver.quasi_static.control", control),
            ("solver.quasi_static.linear", linear),
            ("output", "[]"),
        ];
        let changes: Vec<(String, String)> = changes.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
        let case = read_text::<Case>("cantilever", bundled.case, &changes).unwrap();
        let mut body = settled(build(&case, &Options::default()).unwrap());
        assert!(body.model.broken_pairs() > 40, "{}", body.model.broken_pairs());
        assert_eq!(whole(&body, false), whole(&body, true), "{control}");
        assert_booked(&mut body, control);
    }
}

/// Between breaks and among them the panel of large displacements is at rest, too.
#[test]
fn large_displacements_break_what_the_full_equations_say() {
    let large = ("bond_based_linear", "bond_based");
    let factored = settled(panel(&[large]));
    let exact = settled(panel(&[large, ("steps = 10", "steps = 10\nlinear = \"conjugate_gradients\"")]));
    let (a, b) = (path(&factored), path(&exact));
    // To the first look the factor knows the tangent of the whole panel; strains are 1e-3 here.
    let first = (a[0][0] - b[0][0]).abs() / b[0][0];
    assert!(first < 1e-4, "{first:e}");
    let [broken, others] = [&factored, &exact].map(|body| body.model.broken_pairs() as f64);
    assert!((broken / others - 1.0).abs() < 0.03, "{broken} {others}");
    let linear = settled(panel(&[]));
    // Rotations of the arm are some 1e-3.
    assert!((b[0][0] / path(&linear)[0][0] - 1.0).abs() < 0.01);
}

/// A state-based solid breaks at the load that a solution without breaking gives, and is booked.
#[test]
fn state_based_solids_break_at_rest() {
    let solid = ("bond_based_linear = { young", "state_based_linear = { poisson = 0.2, young");
    let mut body = settled(panel(&[solid]));
    assert!(body.model.broken_pairs() > 50);
    assert_booked(&mut body, "state-based");
    let first = path(&body)[0][0];
    for (factor, broken) in [(0.999, false), (1.001, true)] {
        let value = format!("0.9e-3*{:e}*t", factor * first);
        let body = settled(panel(&[solid, ("0.9e-3*t", &value), ("steps = 10", "steps = 1")]));
        assert_eq!(body.model.broken_pairs() > 0, broken);
    }
    let large = ("bond_based_linear = { young", "state_based = { poisson = 0.2, young");
    let body = settled(panel(&[large]));
    assert!((path(&body)[0][0] / first - 1.0).abs() < 0.01);
}

/// Bonds of a larger excess break together: fewer states at rest.
#[test]
fn shares_break_together() {
    let one = settled(panel(&[]));
    for linear in ["direct", "conjugate_gradients"] {
        let half = format!("steps = 10\nbreak = {{ share = 0.5 }}\nlinear = \"{linear}\"");
        let mut half = settled(panel(&[("steps = 10", &half)]));
        assert!(path(&half).len() < path(&one).len());
        assert_booked(&mut half, linear);
    }
}

/// A wish to stop is heard between two breaks of a load step, which is left at rest.
#[test]
fn a_load_step_is_left_at_rest_when_it_is_interrupted() {
    for linear in ["direct", "conjugate_gradients"] {
        let mut body = panel(&[("steps = 10", &format!("steps = 1\nlinear = \"{linear}\""))]);
        body.model.start();
        let mut asked = 0;
        let mut observe = |_: usize, _: f64| {
            asked += 1;
            asked < if linear == "direct" { 20 } else { 2000 }
        };
        let went_on = body.model.step_observed(&body.solver, &mut body.clock, &mut observe).unwrap();
        assert!(!went_on, "{linear}");
        let broken = body.model.broken_pairs();
        assert!(
            broken > 0 && body.clock.time() > 0.0 && body.clock.time() < 1.0,
            "{linear}: {broken} {:?}",
            body.clock
        );
        assert_booked(&mut body, linear);
    }
}
