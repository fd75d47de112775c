//! Diffusion as a physics of a problem: the same conditions, solver, books and watch as elastic bodies have.

use std::sync::Arc;

use bondwise::conditions::{FormulaAtPoints, Load, Prescribed, Quantity};
use bondwise::discretization::{Influence, PartialVolume, standard};
use bondwise::expression::Expression;
use bondwise::field::Values;
use bondwise::geometry::{Cloud, Shape};
use bondwise::physics::Diffusion;
use bondwise::physics::diffusion::{Diffusing, Flux};
use bondwise::problem::Problem;
use bondwise::solver::{Clock, ForwardEuler, Solver, System};

/// A bar of length 1 with δ = 3 spacings, the diffusivity that it has along the lattice made 1.
fn bar(n: usize, scattered: bool) -> (Diffusing<1>, Arc<[u32]>) {
    let h = 1.0 / n as f64;
    let mut cloud = Cloud::lattice(&Shape::Box { low: [0.0], high: [1.0] }, h, 4);
    if scattered {
        cloud = cloud.scattered_already();
    }
    let flux = Flux::new::<1>(Influence::Constant, 2, 1.0, 3.0 * h).unwrap();
    let body = standard::body(cloud, 3.0 * h, PartialVolume::Ramp);
    let diffusion = Diffusion::standard(&body, &flux, PartialVolume::Ramp).calibrated(&body, 1.0);
    let all: Vec<u32> = body.cloud.select(|_| true);
    (Diffusing::new(body, diffusion), all.into())
}

fn profile(formula: &str, body: &Diffusing<1>, slots: &Arc<[u32]>) -> FormulaAtPoints {
    FormulaAtPoints::new(Expression::compile(formula, &["x", "y", "z", "t"], &[]).unwrap(), &body.body.cloud, slots)
}

fn march(problem: &mut Problem, dt: f64, steps: u64) {
    problem.start();
    let mut clock = Clock::new(dt);
    for _ in 0..steps {
        problem.step(&Solver::ForwardEuler(ForwardEuler), &mut clock, &mut |_, _| true).expect("a sound step");
    }
}

#[test]
fn what_nothing_enters_keeps_its_amount_and_what_a_source_adds_is_booked() {
    for scattered in [false, true] {
        let (mut body, all) = bar(40, scattered);
        for (slot, c) in all.iter().zip(0..) {
            body.concentration[*slot as usize] = f64::from(c * 7919 % 101) / 101.0;
        }
        let dt = 0.9 * bondwise::physics::Physics::stable_step(&body);
        let mut alone = Problem::new(Box::new(body), Vec::new(), Vec::new());
        march(&mut alone, dt, 200);
        let balance = alone.balance();
        // Each step adds 40 numbers to rounding.
        assert!(balance.momentum_defect < 200.0 * 40.0 * f64::EPSILON * balance.momentum_scale, "{balance:?}");

        let (body, all) = bar(40, scattered);
        let source = Load::new(all.clone(), 0, profile("2 + x", &body, &all));
        let mut fed = Problem::new(Box::new(body), Vec::new(), vec![Box::new(source)]);
        march(&mut fed, dt, 200);
        let balance = fed.balance();
        let supplied = 2.5 * 200.0 * dt;
        assert!((balance.impulse[0] / supplied - 1.0).abs() < 1e-12, "{balance:?}");
        assert!(balance.momentum_defect < 1e-12 * supplied, "{balance:?}");
        let names: Vec<String> = fed.physics.columns(&balance).into_iter().map(|column| column.name).collect();
        assert_eq!(names, ["amount", "supplied", "imbalance"]);
    }
}

#[test]
fn held_ends_bring_the_bar_to_a_straight_line_and_what_they_supply_is_booked() {
    let (body, _) = bar(50, false);
    let (n, h) = (50, 1.0 / 50.0);
    let ends = |low: bool| -> Arc<[u32]> {
        let near = |x: f64| if low { x < 3.0 * h } else { x > 1.0 - 3.0 * h };
        body.body.cloud.select(|x| near(x[0])).into()
    };
    // A layer of one horizon at each end, on the line.
    let held = [true, false].map(ends).map(|slots| {
        let profile = profile("1 + 2*x", &body, &slots);
        Box::new(Prescribed::new("end".into(), slots, 0, Quantity::Value, profile)) as Box<_>
    });
    let dt = 0.9 * bondwise::physics::Physics::stable_step(&body);
    let mut problem = Problem::new(Box::new(body), held.into(), Vec::new());
    // The slowest mode decays as exp(−π² t): e^−40 by t = 4.
    march(&mut problem, dt, (4.0 / dt) as u64);
    let Values::Scalar(values) = problem.field("concentration").unwrap().values else { panic!("one number a point") };
    for (k, c) in values.iter().enumerate() {
        let exact = 1.0 + 2.0 * (k as f64 + 0.5) / f64::from(n);
        // Linear fields have no flux divergence inside: rounding of some thousand steps is left.
        assert!((c - exact).abs() < 1e-12, "{k}: {c} {exact}");
    }
    let balance = problem.balance();
    assert!((balance.momentum[0] - 2.0).abs() < 1e-12, "{balance:?}");
    // In the last step as much leaves at one end as enters at the other.
    let reactions: f64 = problem.constraints.iter().map(|held| held.reaction()).sum();
    assert!(reactions.abs() < 1e-9, "{reactions}");
    assert!(problem.stable_step() >= dt);
}

#[test]
fn a_mode_decays_at_first_order_in_time() {
    // cos(πx) has no flux through the ends; what forward Euler lacks at e^(−λt) falls with the step.
    let end = 0.05;
    let run = |steps: u64| {
        let (mut body, all) = bar(20, false);
        for &slot in all.iter() {
            let x = body.body.cloud.position(slot as usize)[0];
            body.concentration[slot as usize] = (std::f64::consts::PI * x).cos();
        }
        let mut problem = Problem::new(Box::new(body), Vec::new(), Vec::new());
        march(&mut problem, end / steps as f64, steps);
        let Values::Scalar(values) = problem.field("concentration").unwrap().values else { panic!("numbers") };
        values[0]
    };
    let [a, b, c] = [800, 1600, 3200].map(run);
    let order = ((a - b) / (b - c)).log2();
    // The next term is of relative size λ Δt, below a hundredth.
    assert!((order - 1.0).abs() < 0.01, "{order}");
}

#[test]
fn a_step_beyond_the_stable_one_is_stopped_with_its_cause() {
    let (mut body, _) = bar(30, false);
    body.concentration[40] = 1.0;
    let dt = 3.0 * bondwise::physics::Physics::stable_step(&body);
    let mut problem = Problem::new(Box::new(body), Vec::new(), Vec::new());
    problem.start();
    let mut clock = Clock::new(dt);
    let stop = (0..100_000)
        .find_map(|_| problem.step(&Solver::ForwardEuler(ForwardEuler), &mut clock, &mut |_, _| true).err());
    let text = stop.expect("it grows").to_string();
    assert!(text.contains("above the stable step") && text.contains("concentration"), "{text}");
}
