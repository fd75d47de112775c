//! What forces on sets and through cuts must be: reactions at rest, the rate of momentum at any instant, the change of momentum
//! over a step; and how near bonds are to breaking.

use crate::common::{Random, SPACING, lattice, perturbed};
use crate::stress::{body, displace};
use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::execution::Packs;
use bondwise::field::{Double, Mixed, Values, components};
use bondwise::geometry::Cloud;
use bondwise::physics::elasticity::Elasticity;
use bondwise::physics::elasticity::laws::Law;
use bondwise::physics::failure::CriticalStretch;
use bondwise::physics::failure::critical_stretch::PairRule;
use bondwise::physics::{ForceAndMoment, Physics, Resultant};
use bondwise::simulation::{Control, Simulation};

fn case(text: &str) -> Simulation {
    build(&read_text::<Case>("body", text, &[]).unwrap(), &Options::default()).unwrap()
}

fn cut(point: [f64; 3], normal: [f64; 3]) -> Resultant {
    Resultant::ThroughCut { point, normal, about: point }
}

/// Σ over the components of |a − b|.
fn far(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|d| (a[d] - b[d]).abs()).sum()
}

#[test]
fn every_cut_between_the_grips_of_a_strip_at_rest_carries_the_reaction() {
    for (law, solver) in [
        ("bond_based_linear = { young = 70e9, density = 2700.0 }", "static"),
        ("state_based_linear = { young = 70e9, density = 2700.0, poisson = 0.3 }", "dynamic_relaxation"),
        ("bond_based = { young = 70e9, density = 2700.0 }", "newton"),
        ("state_based = { young = 70e9, density = 2700.0, poisson = 0.3 }", "dynamic_relaxation"),
    ] {
        let mut strip = case(&format!(
            r#"
[case]
title = "Strip"
dimension = 2
[geometry]
shape = {{ rectangle = {{ size = [0.04, 0.012] }} }}
spacing = 1e-3
cracks = [{{ segment = {{ from = [0.0, 0.0], to = [0.0, 0.01] }} }}]
[sets]
left = {{ where = "x < -0.0169" }}
right = {{ where = "x > 0.0169" }}
[discretization]
horizon_ratio = 3.0
[physics.elasticity]
law = {{ {law} }}
[[conditions]]
on = "left"
prescribe = {{ displacement = {{ component = 0, value = 0.0 }} }}
[[conditions]]
on = "left"
prescribe = {{ displacement = {{ component = 1, value = 0.0 }} }}
[[conditions]]
on = "right"
prescribe = {{ displacement = {{ component = 0, value = "2e-5*t" }} }}
[[conditions]]
on = "right"
prescribe = {{ displacement = {{ component = 1, value = "1e-5*t" }} }}
[solver]
{solver} = {{ tolerance = 1e-12, max_iterations = 100000 }}
"#
        ));
        strip.model.start();
        strip.model.step(&strip.solver, &mut strip.clock).unwrap();
        let reactions: Vec<f64> = strip.model.reactions().into_iter().map(|(_, value)| value).collect();
        let right = [reactions[2], reactions[3], 0.0];
        let size = right[0].hypot(right[1]);
        for x in [-0.0165, -0.01, -0.0031, 0.0, 0.0005, 0.004, 0.0137] {
            // Upright, tilted, and of another length.
            for normal in [[1.0, 0.0, 0.0], [3.0, 0.4, 0.0]] {
                let through = strip.model.resultant(&cut([x, 0.0, 0.0], normal)).unwrap();
                // Forces balance to 1e-12 of the loads, some hundred points.
                assert!(far(through.force, right) < 1e-10 * size, "{law} at {x}: {through:?} {right:?}");
                let back = strip.model.resultant(&cut([x, 0.0, 0.0], normal.map(|n| -n))).unwrap();
                assert!(far(back.force, right.map(|f| -f)) < 1e-10 * size, "{law} at {x}: {back:?}");
            }
        }
        // On the grip itself acts what the reaction holds.
        let set = Resultant::OnSet { set: "right".into(), about: None };
        let held = strip.model.resultant(&set).unwrap();
        assert!(far(held.force, right.map(|f| -f)) < 1e-10 * size, "{law}: {held:?} {right:?}");
        // Moments about one place: of the cut behind, and of the whole grip beyond it.
        let about = Some([0.0; 3]);
        let held = strip.model.resultant(&Resultant::OnSet { set: "right".into(), about }).unwrap();
        let through = strip
            .model
            .resultant(&Resultant::ThroughCut { point: [0.01, 0.0, 0.0], normal: [1.0, 0.0, 0.0], about: [0.0; 3] })
            .unwrap();
        let lever = 0.02 * size;
        assert!((held.moment[2] + through.moment[2]).abs() < 1e-9 * lever, "{law}: {held:?} {through:?}");
    }
}

/// Points behind a plane, as a set; one in front of it stays out.
fn behind<const D: usize, P: Packs>(body: &mut Elasticity<D, P>, point: [f64; 3], normal: [f64; 3]) {
    let cloud = &body.body.cloud;
    let height = |x: &[f64; D]| (0..D).map(|d| (x[d] - point[d]) * normal[d]).sum::<f64>();
    let slots = cloud.select(|x| height(x) <= 1e-9 * SPACING);
    assert!(!slots.is_empty() && slots.len() < cloud.n_points());
    body.body.cloud.sets.insert("behind", slots);
}

/// Newton's laws for the part behind a cut, at one instant: forces on its points add to the force through it.
#[test]
fn forces_and_moments_behind_a_cut_are_those_through_it() {
    fn check<const D: usize, P: Packs>(cloud: Cloud<D>, tolerance: f64) {
        let about = [2e-3, 1e-3, -1e-3].map(|x| if D == 1 { 0.0 } else { x });
        for &law in Law::ALL {
            let mut body = body::<D, P>(law, cloud.clone(), Some(CriticalStretch::uniform(4e-3)));
            let mut random = Random::new(3);
            displace(&mut body, |_| random.vector(5e-3 * SPACING));
            body.evolve(0.0);
            assert!(body.state.broken.bonds > 0);
            // Through points of the lattice, between them, and askew.
            let positions: Vec<[f64; D]> = cloud.slots.iter().map(|&slot| cloud.position(slot as usize)).collect();
            let mean: [f64; D] =
                std::array::from_fn(|d| positions.iter().map(|x| x[d]).sum::<f64>() / positions.len() as f64);
            let off = |x: &[f64; D]| (0..D).map(|d| (x[d] - mean[d]).powi(2)).sum::<f64>();
            let mid = positions.iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
            let mid: [f64; 3] = std::array::from_fn(|d| if d < D { mid[d] } else { 0.0 });
            for normal in [[1.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [0.5, 1.0, -0.3]] {
                let normal = std::array::from_fn(|d| if d < D { normal[d] } else { 0.0 });
                behind(&mut body, mid, normal);
                let on = body.resultant(&Resultant::OnSet { set: "behind".into(), about: Some(about) }).unwrap();
                let cut = body.resultant(&Resultant::ThroughCut { point: mid, normal, about }).unwrap();
                // Σ |f| V of all points, and with levers.
                let scale: f64 = body
                    .body
                    .cloud
                    .slots
                    .iter()
                    .map(|&slot| {
                        let force = components::<D, _>(&body.state.force);
                        let volume = body.body.cloud.volume(slot as usize);
                        force.iter().map(|f| bondwise::field::Number::to_f64(f[slot as usize]).abs()).sum::<f64>()
                            * volume
                    })
                    .sum();
                let size = 20.0 * SPACING * scale;
                assert!(far(on.force, cut.force) < tolerance * scale, "{law:?}: {on:?} {cut:?}");
                assert!(far(on.moment, cut.moment) < tolerance * size, "{law:?}: {on:?} {cut:?}");
                assert!(far(cut.force, [0.0; 3]) > 1e-3 * scale / cloud.n_points() as f64);
            }
        }
    }
    check::<1, Double>(lattice([30, 1, 1]), 1e-13);
    check::<2, Double>(lattice([13, 11, 1]), 1e-13);
    check::<2, Double>(perturbed([13, 11, 1]), 1e-13);
    check::<3, Double>(lattice([7, 6, 5]), 1e-13);
    check::<3, Double>(perturbed([6, 5, 5]), 1e-13);
    // Forces of points are those of single precision.
    check::<2, Mixed>(lattice([13, 11, 1]), 1e-5);
}

/// Weights that belong to single bonds: cells of two sizes, corrected surfaces.
#[test]
fn cuts_balance_in_refined_and_corrected_bodies() {
    let zones = "[refinement]\nlevels = 1\nzones = [{ level = 1, region = { where = \"x < 0.001\" } }]";
    for (more, correction) in [(zones, "none"), ("", "energy"), ("", "volume"), (zones, "energy")] {
        let mut bar = case(&format!(
            r#"
[case]
title = "Struck"
dimension = 2
[geometry]
shape = {{ rectangle = {{ size = [0.04, 0.012] }} }}
spacing = 1e-3
[sets]
behind = {{ where = "x < 0.0021" }}
[discretization]
horizon_ratio = 3.0
surface_correction = "{correction}"
{more}
[physics.elasticity]
law = {{ bond_based = {{ young = 70e9, density = 2700.0 }} }}
[[conditions]]
on = "all"
initial = {{ velocity = {{ component = 0, value = "10*x/0.02" }} }}
[[conditions]]
on = "all"
initial = {{ velocity = {{ component = 1, value = "20*sin(x/0.003)" }} }}
[solver.velocity_verlet]
end_time = 3e-6
"#
        ));
        bar.model.start();
        while bar.clock.step < bar.n_steps {
            bar.model.step(&bar.solver, &mut bar.clock).unwrap();
        }
        let about = [0.001, 0.0, 0.0];
        let set = Resultant::OnSet { set: "behind".into(), about: Some(about) };
        let through = Resultant::ThroughCut { point: [0.0021, 0.0, 0.0], normal: [1.0, 0.0, 0.0], about };
        let [on, cut] = [set, through].map(|of| bar.model.resultant(&of).unwrap());
        // Stored weights of the two directions of a bond are rounded apart.
        assert!(far(on.force, cut.force) < 1e-10 * far(cut.force, [0.0; 3]), "{more} {correction}: {on:?} {cut:?}");
        assert!(far(on.moment, cut.moment) < 1e-10 * 0.02 * far(cut.force, [0.0; 3]), "{more} {correction}");
    }
}

/// Velocity Verlet changes a momentum by the mean of the forces at both ends of a step, exactly.
#[test]
fn momentum_behind_a_cut_changes_by_the_force_through_it_and_the_loads_behind() {
    let mut bar = case(
        r#"
[case]
title = "Struck"
dimension = 2
[geometry]
shape = { rectangle = { size = [0.04, 0.012] } }
spacing = 1e-3
[sets]
left = { where = "x < -0.0169" }
behind = { where = "x < 0.0021" }
[discretization]
horizon_ratio = 3.0
[physics.elasticity]
law = { state_based = { young = 70e9, density = 2700.0, poisson = 0.3 } }
[[conditions]]
on = "left"
load = { body_force = { component = 0, value = "1e10*sin(t/1e-6)" } }
[[conditions]]
on = "all"
initial = { velocity = { component = 1, value = "10*x/0.02" } }
[solver.velocity_verlet]
end_time = 10e-6
"#,
    );
    let dt = bar.clock.dt;
    let through = cut([0.0021, 0.0, 0.0], [1.0, 0.0, 0.0]);
    let volume = SPACING * SPACING;
    let loaded = 36.0 * volume;
    let momentum = |bar: &mut Simulation| {
        let Values::Vector(v) = bar.model.field("velocity").unwrap().values else { panic!("vectors") };
        let positions = bar.model.positions();
        let behind = positions.iter().zip(&v).filter(|(x, _)| x[0] < 0.0021);
        behind.fold([0.0; 2], |sum, (_, v)| [0, 1].map(|d| sum[d] + 2700.0 * volume * v[d]))
    };
    let force = |bar: &mut Simulation| {
        let ForceAndMoment { force, .. } = bar.model.resultant(&through).unwrap();
        let t = bar.clock.time();
        [force[0] + 1e10 * (t / 1e-6).sin() * loaded, force[1]]
    };
    bar.model.start();
    assert_eq!(bar.model.positions().iter().filter(|x| x[0] < -0.0169).count(), 36);
    let (mut before, mut pull, mut moved) = (momentum(&mut bar), force(&mut bar), 0.0f64);
    while bar.clock.step < bar.n_steps {
        bar.model.step(&bar.solver, &mut bar.clock).unwrap();
        let (now, next) = (momentum(&mut bar), force(&mut bar));
        moved = moved.max(next[0].abs());
        for d in 0..2 {
            let expected = 0.5 * dt * (pull[d] + next[d]);
            // Velocities are rounded, 1e-16 of some 100 m/s.
            let scale = 2700.0 * 0.04 * 0.012 * 100.0;
            assert!((now[d] - before[d] - expected).abs() < 1e-14 * scale, "{d}: {now:?} {before:?} {expected}");
        }
        (before, pull) = (now, next);
    }
    assert!(moved > 1e5, "{moved}");
}

#[test]
fn the_most_stretched_bond_has_the_ratio_of_stretches_whatever_the_law() {
    fn check<const D: usize, P: Packs>(cloud: Cloud<D>, tolerance: f64) {
        for &law in Law::ALL {
            let mut body = body::<D, P>(law, cloud.clone(), Some(CriticalStretch::uniform(0.1)));
            assert_eq!(body.most_stretched(), None);
            displace(&mut body, |x| x.map(|x| -0.01 * x));
            assert_eq!(body.most_stretched(), None, "bonds are shorter");
            displace(&mut body, |x| x.map(|x| 0.05 * x));
            let most = body.most_stretched().unwrap();
            assert!((most.ratio - 0.5).abs() < tolerance, "{law:?}: {most:?}");
            // One bond more than others; in the middle of its ends.
            let (a, n) = (body.body.cloud.slots[0] as usize, body.body.cloud.n_slots());
            for d in 0..D {
                let u = bondwise::field::Number::to_f64(body.state.displacement[d * n + a]);
                body.state.displacement[d * n + a] = bondwise::field::Number::from_f64(u - 0.02 * SPACING);
            }
            let most = body.most_stretched().unwrap();
            let ratios = |body: &mut Elasticity<D, P>| {
                let points = body.body.cloud.n_points();
                match body.field("stretch_ratio", 0..points).unwrap().values {
                    Values::Scalar(values) => values,
                    other => panic!("{other:?}"),
                }
            };
            let largest = ratios(&mut body).into_iter().fold(0.0, f64::max);
            assert!((most.ratio / largest - 1.0).abs() < tolerance && largest > 0.6, "{law:?}: {most:?} {largest}");
            let corner = body.body.cloud.position(a);
            let away = (0..D).map(|d| (most.position[d] - corner[d]).powi(2)).sum::<f64>().sqrt();
            assert!(away < 2.0 * SPACING, "{law:?}: {most:?} {corner:?}");
            // Nothing has changed, and a broken bond no longer counts.
            assert_eq!(body.state.broken.bonds, 0);
            body.failure = Some(CriticalStretch::uniform(0.05 * 1.0001));
            body.evolve(0.0);
            assert!(body.state.broken.bonds > 0);
            assert!(body.most_stretched().is_none_or(|most| most.ratio <= 1.0), "{law:?}");
        }
    }
    check::<1, Double>(lattice([30, 1, 1]), 1e-12);
    check::<2, Double>(lattice([13, 11, 1]), 1e-12);
    check::<2, Double>(perturbed([13, 11, 1]), 1e-12);
    check::<3, Double>(perturbed([6, 5, 5]), 1e-12);
    check::<2, Mixed>(perturbed([13, 11, 1]), 1e-5);
}

/// A weaker interface decides, though its bonds are stretched as all others.
#[test]
fn bonds_are_measured_by_their_own_critical_stretch() {
    let mut cloud = lattice::<2>([14, 10, 1]);
    let middle = cloud.position(cloud.slots[7] as usize)[0] - 0.5 * SPACING;
    let halves = [cloud.select(|x| x[0] < middle), cloud.select(|x| x[0] > middle)];
    cloud.sets.insert("left", halves[0].clone());
    cloud.sets.insert("right", halves[1].clone());
    let rule = PairRule { between: ("left".into(), "right".into()), stretch: 0.02 };
    let failure = CriticalStretch::new(&cloud, 0.1, &[rule], &[]).unwrap();
    for &law in Law::ALL {
        let mut body = body::<2, Double>(law, cloud.clone(), Some(failure.clone()));
        displace(&mut body, |x| [0.01 * x[0], 0.0]);
        let most = body.most_stretched().unwrap();
        assert!((most.ratio - 0.5).abs() < 1e-12, "{law:?} {most:?}");
        assert!((most.position[0] - middle).abs() < 1.6 * SPACING, "{law:?} {most:?}");
    }
}

#[test]
fn a_run_in_which_nothing_breaks_says_how_near_it_came_and_writes_its_tables() {
    let folder = std::env::temp_dir().join(format!("bondwise-forces-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let text = r#"
[case]
title = "Pulled"
dimension = 2
[geometry]
shape = { rectangle = { size = [0.02, 0.01] } }
spacing = 1e-3
[sets]
right = { where = "x > 0.009" }
[discretization]
horizon_ratio = 3.0
[physics.elasticity]
law = { bond_based = { young = 70e9, density = 2700.0 } }
failure = { critical_stretch = { stretch = 0.01 } }
[[conditions]]
on = "right"
prescribe = { velocity = { component = 0, value = 2.0 } }
[solver.velocity_verlet]
end_time = 4e-6
[[output]]
history = { every_steps = 5 }
[[output]]
force = { name = "grip", on = "right", every_steps = 5 }
[[output]]
cut = { name = "middle", point = [0, 0], normal = [1, 0], every_steps = 5 }
[[output]]
probe = { name = "a", at = [0, 0], fields = ["stress", "principal_stress", "von_mises"], every_steps = 5 }
[[output]]
picture = { field = "stress", component = 3 }
[[output]]
vtu = { every_steps = 100, fields = ["stress", "strain", "stretch_ratio"] }
"#;
    let options = Options { folder: folder.clone(), ..Options::default() };
    let mut run = build(&read_text::<Case>("pulled", text, &[]).unwrap(), &options).unwrap();
    let mut shown = None;
    let report = run
        .run(|progress| {
            shown = progress.stretch_ratio;
            Control::Continue
        })
        .unwrap();
    let read = |name: &str| {
        let text = std::fs::read_to_string(folder.join(name)).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_string).collect::<Vec<_>>());
        let head = lines.next().unwrap();
        (head, lines.map(|row| row.iter().map(|x| x.parse::<f64>().unwrap()).collect::<Vec<_>>()).collect::<Vec<_>>())
    };
    let (head, rows) = read("history.csv");
    assert_eq!(head.last().unwrap(), "largest_stretch_ratio");
    let ratios: Vec<f64> = rows.iter().map(|row| *row.last().unwrap()).collect();
    let most = report.largest_stretch_ratio.unwrap();
    assert_eq!(most.value, ratios.iter().copied().fold(0.0, f64::max));
    assert!(report.broken_bonds == Some(0) && most.value > 0.01 && most.value < 1.0, "{most:?}");
    assert!(shown.is_some() && most.position.len() == 2 && most.time > 0.0);
    let (head, rows) = read("force_grip.csv");
    assert_eq!(head.join(","), "step,time,force_x,force_y,moment_z");
    assert!(rows.len() == ratios.len() && rows.last().unwrap()[2] < 0.0);
    let (head, rows) = read("cut_middle.csv");
    assert_eq!(head.join(","), "step,time,force_x,force_y,moment_z");
    assert!(rows.last().unwrap()[2] > 0.0);
    let (head, _) = read("probe_a.csv");
    assert_eq!(
        head[2..].join(","),
        "stress_xx,stress_yy,stress_zz,stress_xy,principal_stress_1,principal_stress_2,principal_stress_3,von_mises"
    );
    let picture = std::fs::read_dir(folder.join("pictures")).unwrap().next().unwrap().unwrap();
    assert!(picture.file_name().to_string_lossy().starts_with("stress_xy_"));
    std::fs::remove_dir_all(folder).unwrap();
}
