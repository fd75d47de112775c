//! Bodies beside mirrors and periodic ends are parts of bodies that are symmetric or periodic.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::PathBuf;

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::conditions::{MirrorForce, Term};
use bondwise::discretization::{Influence, Operator, PartialVolume, standard};
use bondwise::family::Families;
use bondwise::field::Values;
use bondwise::geometry::{Cloud, Ends, Mirror, Parity, Shape};
use bondwise::physics::Diffusion;
use bondwise::physics::diffusion::{Diffusing, Flux};
use bondwise::problem::Problem;
use bondwise::simulation::Simulation;
use bondwise::solver::{Clock, ForwardEuler, Solver};

/// A power of two, so that places and planes are numbers without rounding.
const H: f64 = 1.0 / 1024.0;
const AXES: [&str; 3] = ["x", "y", "z"];

fn simulation(text: &str) -> Simulation {
    let case = read_text::<Case>("body", text, &[]).unwrap_or_else(|mistakes| panic!("{mistakes}\n{text}"));
    let options = Options { base: PathBuf::from(env!("CARGO_TARGET_TMPDIR")), ..Options::default() };
    build(&case, &options).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn run(mut simulation: Simulation) -> Simulation {
    simulation.model.start();
    while simulation.clock.step < simulation.n_steps {
        simulation.model.step(&simulation.solver, &mut simulation.clock).expect("a sound step");
    }
    simulation
}

fn vectors(simulation: &mut Simulation, name: &str) -> Vec<[f64; 3]> {
    match simulation.model.field(name).unwrap().values {
        Values::Vector(values) => values,
        Values::Scalar(values) => values.into_iter().map(|value| [value, 0.0, 0.0]).collect(),
        _ => panic!("{name} is a tensor"),
    }
}

/// Displacement, velocity and damage of each point, by its place in halves of a spacing.
type Found = BTreeMap<[i64; 3], [[f64; 3]; 3]>;

fn found(simulation: &mut Simulation) -> Found {
    let fields = ["displacement", "velocity", "damage"].map(|name| vectors(simulation, name));
    let places = simulation.model.positions().to_vec();
    let key = |x: [f64; 3]| x.map(|x| (2.0 * x / H).round() as i64);
    let one = |k: usize| std::array::from_fn(|field| fields[field][k]);
    places.into_iter().enumerate().map(|(k, x)| (key(x), one(k))).collect()
}

/// The largest difference of a part to the whole at the same points, for displacements and velocities each over the largest
/// of the whole; of damage as it is.
fn difference(part: &Found, whole: &Found) -> f64 {
    let mut largest = 0.0f64;
    for field in 0..3 {
        let size =
            |found: &Found| found.values().flat_map(|values| values[field]).fold(0.0, |a: f64, b| a.max(b.abs()));
        let per = if field == 2 { 1.0 } else { size(whole) };
        assert!(field == 2 || per > 0.0, "something moves");
        for (place, values) in part {
            let theirs = whole[place][field];
            largest = (0..3).fold(largest, |largest, d| largest.max((values[field][d] - theirs[d]).abs() / per));
        }
    }
    largest
}

/// A body of so many cells to either side of the origin along each axis, and which of its halves mirrors leave.
#[derive(Clone, Copy)]
struct Symmetric<'a> {
    dimension: usize,
    law: &'a str,
    discretization: &'a str,
    solver: &'a str,
    /// Whether bonds break.
    breaks: bool,
    /// Axis, and whether it is the lower end that is a mirror.
    mirrors: &'a [(usize, bool)],
    odd: bool,
    /// How many times as many cells.
    times: i32,
    /// The largest difference to the whole body.
    within: f64,
}

const CELLS: [[i32; 3]; 3] = [[24, 1, 1], [16, 12, 1], [9, 8, 7]];
const VERLET: &str = "velocity_verlet = { end_time = \"6 us\", time_step = \"100 ns\" }";

const BASE: Symmetric<'static> = Symmetric {
    dimension: 2,
    law: "bond_based",
    discretization: "",
    solver: VERLET,
    breaks: true,
    mirrors: &[(0, true)],
    odd: false,
    times: 1,
    within: 0.0,
};

impl Symmetric<'_> {
    fn mirrored(&self, axis: usize) -> Option<bool> {
        self.mirrors.iter().find(|(of, _)| *of == axis).map(|(_, low)| *low)
    }

    /// Symmetric motion in as many axes as there are mirrors, or antisymmetric; the same formulas for both bodies.
    fn motion(&self, c: usize) -> String {
        // A larger body is torn at its ends only.
        let mut value = if self.times > 1 { "0.6" } else { "6" }.to_string();
        for (d, x) in AXES.iter().enumerate().take(self.dimension) {
            value += &match self.mirrored(d) {
                None => format!("*(1 + 30*{x} - 2e3*{x}*{x})"),
                Some(_) if (d == c) != self.odd => format!("*{x}*(1 + 1e3*{x}*{x})*90"),
                Some(_) => format!("*(1 - 2e3*{x}*{x})"),
            };
        }
        value
    }

    fn case(&self, part: bool) -> String {
        let d = self.dimension;
        let ends = |axis: usize| {
            let n = f64::from(self.times * CELLS[d - 1][axis]) * H;
            match self.mirrored(axis).filter(|_| part) {
                None => [-n, n],
                Some(true) => [0.0, n],
                Some(false) => [-n, 0.0],
            }
        };
        let [low, high]: [Vec<f64>; 2] = [0, 1].map(|k| (0..d).map(|axis| ends(axis)[k]).collect());
        // One in the plane of a mirror across y, one that crosses that across x, and begins beyond it.
        let at = |x: f64| x * H;
        let cracks = match (d, self.breaks, part) {
            (2, true, false) => {
                vec![[-30.0, 0.0, -7.0, 0.0], [30.0, 0.0, 7.0, 0.0], [-5.0, 4.0, 5.0, 4.0], [-5.0, -4.0, 5.0, -4.0]]
            }
            (2, true, true) => {
                let mut cracks = Vec::new();
                let side = |axis| if self.mirrored(axis) == Some(false) { -1.0 } else { 1.0 };
                let (x, y) = (side(0), side(1));
                cracks.push([30.0 * x, 0.0, 7.0 * x, 0.0]);
                cracks.push([-x, 4.0 * y, 5.0 * x, 4.0 * y]);
                if self.mirrored(0).is_none() {
                    cracks.push([-30.0, 0.0, -7.0, 0.0]);
                    cracks.push([1.0, 4.0 * y, -5.0, 4.0 * y]);
                }
                if self.mirrored(1).is_none() {
                    cracks.push([-x, -4.0 * y, 5.0 * x, -4.0 * y]);
                }
                cracks
            }
            _ => Vec::new(),
        };
        let cracks: Vec<String> = cracks
            .iter()
            .map(|[a, b, c, e]| {
                format!("{{ segment = {{ from = [{}, {}], to = [{}, {}] }} }}", at(*a), at(*b), at(*c), at(*e))
            })
            .collect();
        let mut text = format!(
            "[case]\ntitle = \"body\"\ndimension = {d}\n[geometry]\nshape = {{ box = {{ low = {low:?}, high = {high:?} }} }}\n\
             spacing = {H}\ncracks = [{}]\n[discretization]\nhorizon_ratio = 3\n{}\n[physics.elasticity]\n\
             law = {{ {} = {{ young = 72e9, density = 2440{} }} }}\n{}\n[solver]\n{}\n",
            cracks.join(", "),
            self.discretization,
            self.law,
            if self.law.starts_with("state") && d > 1 { ", poisson = 0.2" } else { "" },
            if self.breaks { "failure = { critical_stretch = { stretch = 6e-4 } }" } else { "" },
            self.solver,
        );
        for c in 0..d {
            let value = self.motion(c);
            text += &format!(
                "[[conditions]]\non = \"all\"\ninitial = {{ velocity = {{ component = {c}, value = \"{value}\" }} }}\n"
            );
        }
        for (axis, low) in self.mirrors.iter().filter(|_| part) {
            let side = if *low { "low" } else { "high" };
            let parity = if self.odd { ", parity = \"odd\"" } else { "" };
            text += &format!("[[conditions]]\nmirror = {{ axis = \"{}\", side = \"{side}\"{parity} }}\n", AXES[*axis]);
        }
        text
    }

    /// Runs the body and its part and compares them, books included.
    fn compare(&self) {
        let [mut whole, mut part] = [false, true].map(|part| run(simulation(&self.case(part))));
        let name = format!("{}\n{:?} steps", self.case(true), part.n_steps);
        let apart = difference(&found(&mut part), &found(&mut whole));
        println!("{}D {} {} {:?}: {apart:e}", self.dimension, self.law, self.discretization, self.mirrors);
        assert!(apart <= self.within, "{name}: apart by {apart:e}");
        assert_eq!(part.model.broken_pairs() > 0, self.breaks, "{name}: {} broken", part.model.broken_pairs());
        if let Some(work) = part.model.hybrid().filter(|_| self.times > 1) {
            let [now, start] = work.standard;
            assert!(start <= now && now < 1.0, "{name}: some points have rows to the end: {start}, {now}");
        }
        let [whole, part] = [whole, part].map(|mut simulation| simulation.model.balance());
        let share = f64::from(1 << self.mirrors.len());
        for (part, whole) in
            [(part.kinetic, whole.kinetic), (part.strain, whole.strain), (part.fracture, whole.fracture)]
        {
            // Sums of thousands of numbers, of 24 digits in single precision.
            let rounding = if self.discretization.contains("single") { 1e-5 } else { 1e-11 };
            assert!((share * part - whole).abs() <= rounding * whole.abs(), "{name}: {part:e} of {whole:e}");
        }
        // Momentum comes in through mirrors only, and that is booked: each of 60 steps adds rounded numbers.
        let rounding =
            if self.discretization.contains("double") || self.discretization.is_empty() { 1e-13 } else { 1e-4 };
        let hybrid = self.discretization.contains("hybrid");
        assert!(hybrid || part.momentum_defect <= rounding * part.momentum_scale, "{name}: {part:?}");
        assert!(part.momentum.iter().any(|p| p.abs() > 1e-3 * part.momentum_scale), "momentum came in");
    }
}

#[test]
fn part_of_a_symmetric_body_has_its_bits() {
    const SIDES: [&[(usize, bool)]; 5] =
        [&[(0, true)], &[(0, false)], &[(1, true)], &[(1, false)], &[(0, true), (1, true)]];
    for mirrors in SIDES {
        for law in ["bond_based", "bond_based_linear", "state_based", "state_based_linear"] {
            Symmetric { law, mirrors, ..BASE }.compare();
        }
        // Of the bond-based law with one product for two bonds where a block of points lacks none.
        Symmetric { law: "bond_based_linear", breaks: false, mirrors, within: 1e-12, ..BASE }.compare();
    }
    for precision in ["single", "mixed"] {
        let discretization = &format!("precision = \"{precision}\"");
        for law in ["bond_based", "state_based"] {
            Symmetric { law, discretization, ..BASE }.compare();
        }
    }
    for (buffer, law) in [(1, "bond_based"), (2, "state_based")] {
        let discretization = &format!("scheme = {{ hybrid = {{ buffer = {buffer} }} }}");
        for mirrors in SIDES {
            Symmetric { law, discretization, mirrors, times: 2, ..BASE }.compare();
        }
        // So small that no point has a row.
        Symmetric { law, discretization, mirrors: &[(0, true)], ..BASE }.compare();
    }
    for discretization in ["partial_volumes = \"ramp\"", "influence = \"linear\"\npartial_volumes = \"exact\""] {
        Symmetric { discretization, ..BASE }.compare();
    }
    let solver = "runge_kutta = { end_time = \"6 us\", time_step = \"100 ns\" }";
    for law in ["bond_based", "state_based"] {
        Symmetric { law, solver, ..BASE }.compare();
    }
}

#[test]
fn part_of_a_symmetric_bar_or_solid_has_its_bits() {
    for law in ["bond_based", "state_based"] {
        for low in [true, false] {
            Symmetric { dimension: 1, law, mirrors: &[(0, low)], ..BASE }.compare();
        }
        for mirrors in [&[(0, true)][..], &[(2, false)], &[(0, false), (1, true), (2, true)]] {
            Symmetric { dimension: 3, law, mirrors, ..BASE }.compare();
        }
    }
}

#[test]
fn part_of_an_antisymmetric_body_is_as_the_whole() {
    let base = Symmetric { odd: true, breaks: false, within: 1e-12, ..BASE };
    for law in ["bond_based_linear", "state_based_linear"] {
        for mirrors in [&[(0, true)][..], &[(1, false)], &[(0, true), (1, true)]] {
            Symmetric { law, mirrors, ..base }.compare();
        }
        Symmetric { dimension: 3, law, mirrors: &[(1, true)], ..base }.compare();
    }
}

/// A periodic strip of so many cells along x, with motion that is moved along by some cells.
fn strip(cells: usize, period: usize, shift: usize, law: &str, rest: &str, solver: &str) -> String {
    let column = format!("(floor(x/{H}) + {shift} - {period}*floor((floor(x/{H}) + {shift})/{period}))");
    let mut text = format!(
        "[case]\ntitle = \"strip\"\ndimension = 2\n[geometry]\n\
         shape = {{ box = {{ low = [0.0, 0.0], high = [{}, {}] }} }}\nspacing = {H}\n[discretization]\nhorizon_ratio = 3\n\
         [physics.elasticity]\nlaw = {{ {law} = {{ young = 72e9, density = 2440 {} }} }}\n\
         failure = {{ critical_stretch = {{ stretch = 6e-4 }} }}\n[solver]\n{solver}\n\
         [[conditions]]\nperiodic = {{ axis = \"x\" }}\n{rest}\n",
        cells as f64 * H,
        14.0 * H,
        if law.starts_with("state") { ", poisson = 0.2" } else { "" },
    );
    for c in 0..2 {
        text += &format!(
            "[[conditions]]\non = \"all\"\n\
             initial = {{ velocity = {{ component = {c}, value = \"2*sin(12.9*{column} + {c} + 40*y/{H})\" }} }}\n"
        );
    }
    text
}

#[test]
fn periodic_motion_that_is_moved_along_stays_so_and_is_that_of_a_larger_body() {
    const N: usize = 21;
    for law in ["bond_based", "state_based"] {
        let strip = |cells, shift| strip(cells, N, shift, law, "", VERLET);
        let mut here = run(simulation(&strip(N, 0)));
        assert!(here.model.broken_pairs() > 0, "bonds break");
        let balance = here.model.balance();
        // Nothing comes in.
        assert!(
            balance.momentum_defect <= 1e-13 * balance.momentum_scale && balance.impulse == [0.0; 3],
            "{balance:?}"
        );
        let found = [(N, 5), (2 * N, 0)].map(|(cells, shift)| found(&mut run(simulation(&strip(cells, shift)))));
        for (place, values) in super::images::found(&mut here) {
            let x = (place[0] - 1) / 2;
            let moved = (x - 5).rem_euclid(N as i64);
            assert_eq!(found[0][&[2 * moved + 1, place[1], place[2]]], values, "{law}: {place:?} moved along");
            for copy in [x, x + N as i64] {
                assert_eq!(found[1][&[2 * copy + 1, place[1], place[2]]], values, "{law}: {place:?} twice");
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mirrored = Symmetric { mirrors: &[(0, true), (1, true)], law: "state_based", ..BASE }.case(true);
    let mirror = "[[conditions]]\nmirror = { axis = \"y\", side = \"low\" }";
    for text in [mirrored, strip(40, 40, 0, "bond_based", mirror, VERLET)] {
        let bits = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut simulation = run(simulation(&text));
                let reactions = simulation.model.reactions();
                (simulation.model.hash(), reactions, simulation.model.balance().impulse)
            })
        };
        assert_eq!(bits(1), bits(3));
    }
}

/// Waves of so many cells on a periodic lattice for so many periods, beside the exact solution of the lattice in space and
/// time: the largest difference over the amplitude, and the steps.
///
/// With ω² = Σ (w/|ξ|) (ξ₁/|ξ|)² (1 − cos k ξ₁)/ρ, u = cos(k x − ω′ t) is a solution of velocity Verlet for
/// sin(ω′ Δt/2) = ω Δt/2, if it begins with v = sin(k x) sin(ω′ Δt)/Δt.
fn wave(dimension: usize, counts: [usize; 2], length: usize, periods: f64) -> (f64, u64) {
    let (young, density, k) = (72e9, 2440.0, TAU / (length as f64 * H));
    let high: Vec<f64> = counts[..dimension].iter().map(|n| *n as f64 * H).collect();
    let periodic = AXES[..dimension].iter().map(|axis| format!("[[conditions]]\nperiodic = {{ axis = \"{axis}\" }}\n"));
    let periodic: String = periodic.collect();
    let text = |dt: f64, end: f64, initial: &str| {
        format!(
            "[case]\ntitle = \"wave\"\ndimension = {dimension}\n[geometry]\n\
             shape = {{ box = {{ low = {:?}, high = {high:?} }} }}\nspacing = {H}\n[discretization]\nhorizon_ratio = 3\npartial_volumes = \"none\"\n\
             [physics.elasticity]\nlaw = {{ bond_based_linear = {{ young = {young}, density = {density} }} }}\n{periodic}\
             {initial}[solver.velocity_verlet]\ntime_step = {dt:e}\nend_time = {end:e}\n",
            vec![0.0; dimension]
        )
    };
    let dt = 60e-9;
    let strength = simulation(&text(dt, dt, "")).model.facts().physics.elastic().unwrap().micromodulus;
    let mut square = 0.0;
    for i in -3..=3 {
        for j in if dimension == 2 { -3..=3 } else { 0..=0 } {
            let [x, y] = [i, j].map(|n| f64::from(n) * H);
            let length = x.hypot(y);
            if length > 0.0 && length < 3.0 * H * (1.0 + 1e-9) {
                let weight = strength * H.powi(dimension as i32);
                square += weight / length * (x / length).powi(2) * (1.0 - (k * x).cos()) / density;
            }
        }
    }
    let frequency = 2.0 / dt * (0.5 * square.sqrt() * dt).asin();
    let steps = (periods * TAU / frequency / dt).ceil();
    // Small beside a spacing, so that numbers are; the law is linear.
    let amplitude = 1e-6;
    let speed = amplitude * (frequency * dt).sin() / dt;
    let initial = format!(
        "[[conditions]]\non = \"all\"\ninitial = {{ displacement = {{ component = 0, value = \"{amplitude:e}*cos({k:e}*x)\" }} }}\n\
         [[conditions]]\non = \"all\"\ninitial = {{ velocity = {{ component = 0, value = \"{speed:e}*sin({k:e}*x)\" }} }}\n"
    );
    let mut wave = run(simulation(&text(dt, steps * dt, &initial)));
    let (dt, t) = (wave.clock.dt, wave.clock.time());
    assert!((dt / 60e-9 - 1.0).abs() < 1e-12, "{dt}");
    let places = wave.model.positions().to_vec();
    let moved = vectors(&mut wave, "displacement");
    let apart = places.iter().zip(&moved).map(|(x, u)| (u[0] / amplitude - (k * x[0] - frequency * t).cos()).abs());
    (apart.fold(0.0, f64::max), steps as u64)
}

#[test]
fn plane_waves_keep_amplitude_and_phase_on_a_periodic_lattice() {
    for (dimension, counts, length, periods) in
        [(1, [64, 1], 16, 1000.0), (1, [64, 1], 64, 20.0), (2, [32, 6], 16, 50.0)]
    {
        let (apart, steps) = wave(dimension, counts, length, periods);
        println!("{dimension}D, waves of {length} cells, {periods} periods, {steps} steps: apart by {apart:e}");
        // The phase ω′ t is known to a rounding of Δt and of ω′, with that of the micromodulus: some 10 of t ω′, in all
        // 10 ε 2π n. Roundings of a step add up as a random walk of velocities does: ε N^1.5 at most.
        let tolerance = f64::EPSILON * (10.0 * TAU * periods + (steps as f64).powf(1.5));
        assert!(apart < tolerance, "{apart:e}, {tolerance:e}");
    }
}

/// Stretched by tractions, the plane y = 0 in the middle.
fn tension(part: bool, law: &str, solver: &str) -> String {
    let low = if part { 0.0 } else { -10.0 * H };
    let mut text = format!(
        "[case]\ntitle = \"plate\"\ndimension = 2\n[geometry]\n\
         shape = {{ box = {{ low = [{}, {low}], high = [{}, {}] }} }}\nspacing = {H}\n\
         cracks = [{{ segment = {{ from = [{}, 0.0], to = [{}, 0.0] }} }}]\n\
         [sets]\ntop = {{ where = \"y > {}\" }}\nbottom = {{ where = \"y < 0 - {}\" }}\n\
         [discretization]\nhorizon_ratio = 3\n[physics.elasticity]\n\
         law = {{ {law} = {{ young = 72e9, density = 2440 {} }} }}\n[solver]\n{solver}\n\
         [[conditions]]\non = \"top\"\nload = {{ traction = {{ component = 1, value = \"1e7*t*(1 + 20*x)\" }} }}\n",
        -8.0 * H,
        8.0 * H,
        10.0 * H,
        -20.0 * H,
        -3.0 * H,
        9.0 * H,
        9.0 * H,
        if law.starts_with("state") { ", poisson = 0.2" } else { "" },
    );
    text += if part {
        "[[conditions]]\nmirror = { axis = \"y\", side = \"low\" }\n"
    } else {
        "[[conditions]]\non = \"bottom\"\nload = { traction = { component = 1, value = \"0 - 1e7*t*(1 + 20*x)\" } }\n"
    };
    text.replace("bottom = { where", if part { "# bottom = { where" } else { "bottom = { where" })
}

#[test]
fn half_a_plate_under_tension_rests_as_the_whole() {
    let solvers = [
        ("bond_based_linear", "static = { tolerance = 1e-12, linear = \"conjugate_gradients\" }"),
        ("bond_based_linear", "static = { tolerance = 1e-12, preconditioner = \"block_jacobi\" }"),
        ("bond_based_linear", "static = { tolerance = 1e-12, preconditioner = \"incomplete_factors\" }"),
        ("bond_based_linear", "static = { tolerance = 1e-12, linear = \"direct\" }"),
        ("bond_based", "newton = { tolerance = 1e-12 }"),
        ("bond_based", "newton = { tolerance = 1e-12, linear = \"bicgstab\" }"),
        ("bond_based_linear", "dynamic_relaxation = { tolerance = 1e-12 }"),
        ("state_based_linear", "dynamic_relaxation = { tolerance = 1e-12 }"),
    ];
    for (law, solver) in solvers {
        let [mut whole, mut half] = [false, true].map(|part| run(simulation(&tension(part, law, solver))));
        // Turned and moved along as loads leave free: what is symmetric about the plane, but for u_x.
        let [whole, mut part] = [&mut whole, &mut half].map(|simulation| {
            let mut found = found(simulation);
            let mean = found.values().map(|values| values[0][0]).sum::<f64>() / found.len() as f64;
            found.values_mut().for_each(|values| (values[0][0], values[1]) = (values[0][0] - mean, values[0]));
            found
        });
        part.values_mut().for_each(|values| values[2] = [0.0; 3]);
        let whole: Found = whole.into_iter().map(|(place, [u, v, _])| (place, [u, v, [0.0; 3]])).collect();
        let apart = difference(&part, &whole);
        println!("{law} {solver}: apart by {apart:e}");
        // Forces balance to 1e-12 of the loads; the softest mode of so small a plate is some ten thousand times softer than
        // the stiffest.
        assert!(apart < 1e-8, "{law} {solver}: {apart:e}");
        // The mirror holds what the load pulls with.
        let reactions = half.model.reactions();
        let [(name, force)] = &reactions[..] else { panic!("{reactions:?}") };
        assert_eq!(name, "mirror_y_low");
        assert!((force / (-1e7 * 16.0 * H) - 1.0).abs() < 1e-9, "{force:e}");
    }
}

/// Points from a table: those given, their images across x = 0 too if there are to be no mirrors, copies along x if there is
/// to be no period.
fn scattered(
    name: &str,
    points: &[[f64; 3]],
    dimension: usize,
    rest: &str,
    law: &str,
    motion: [&str; 3],
) -> Simulation {
    let axes = &AXES[..dimension];
    let mut table = format!("{},volume\n", axes.join(","));
    for x in points {
        let x: Vec<String> = x[..dimension].iter().map(|x| format!("{x:e}")).collect();
        table += &format!("{},{:e}\n", x.join(","), H.powi(dimension as i32));
    }
    std::fs::write(PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name), table).unwrap();
    let mut text = format!(
        "[case]\ntitle = \"points\"\ndimension = {dimension}\n[geometry]\npoints = {{ csv = {{ file = \"{name}\" }} }}\n\
         [discretization]\nhorizon = {}\n[physics.elasticity]\nlaw = {{ {law} = {{ young = 72e9, density = 2440 {} }} }}\n\
         failure = {{ critical_stretch = {{ stretch = 6e-4 }} }}\n{rest}\n[solver]\n{VERLET}\n",
        3.1 * H,
        if law.starts_with("state") && dimension > 1 { ", poisson = 0.2" } else { "" },
    );
    for (c, value) in motion.iter().enumerate().take(dimension) {
        text += &format!(
            "[[conditions]]\non = \"all\"\ninitial = {{ velocity = {{ component = {c}, value = \"{value}\" }} }}\n"
        );
    }
    run(simulation(&text))
}

#[test]
fn scattered_points_beside_mirrors_and_periodic_ends_are_as_in_the_whole() {
    let mut random = super::common::Random::new(7);
    for dimension in 1..=3 {
        let counts = [[20, 1, 1], [12, 10, 1], [7, 7, 7]][dimension - 1];
        let mut points = Vec::new();
        for k in 0..counts.iter().product::<usize>() {
            let cell = [k % counts[0], k / counts[0] % counts[1], k / counts[0] / counts[1]];
            let moved = random.vector::<3>(0.2);
            points
                .push(std::array::from_fn(|d| if d < dimension { (cell[d] as f64 + 0.5 + moved[d]) * H } else { 0.0 }));
        }
        let length = counts[0] as f64 * H;
        let k = TAU / length;
        let law = ["bond_based", "state_based", "bond_based"][dimension - 1];
        // Bonds that are images of each other have the same strain to rounding: none is so near to breaking.
        let motion = ["3000*x*(1 + 20*y)*(1 - 10*z)", "3*(1 - 3e3*x*x)*(1 + 100*y)", "2*(1 - 1e3*x*x)"];
        let reflected = |x: &[f64; 3]| [-x[0], x[1], x[2]];
        let both: Vec<[f64; 3]> = points.iter().copied().chain(points.iter().map(reflected)).collect();
        let mirror = "[[conditions]]\nmirror = { axis = \"x\", side = \"low\", at = 0.0 }";
        let waves = format!("3*sin({k:e}*x)*(1 + 20*y)");
        let waves = [&waves[..], &format!("3*cos({k:e}*x)*(1 + 100*y)"), "2*(1 + 30*z)"];
        let copies: Vec<[f64; 3]> = points.iter().flat_map(|x| [*x, [x[0] + length, x[1], x[2]]]).collect();
        let periodic = |period: f64| format!("[[conditions]]\nperiodic = {{ axis = \"x\", period = {period:e} }}");
        let name = |which: &str| format!("images_{dimension}_{which}.csv");
        let one = |which: &str, points: &[[f64; 3]], rest: &str, motion| {
            scattered(&name(which), points, dimension, rest, law, motion)
        };
        let pairs = [
            [one("half", &points, mirror, motion), one("whole", &both, "", motion)],
            [one("once", &points, &periodic(length), waves), one("twice", &copies, &periodic(2.0 * length), waves)],
        ];
        for [mut part, mut whole] in pairs {
            let [ours, theirs] = [&mut part, &mut whole].map(|simulation| {
                let places = simulation.model.positions().to_vec();
                let moved = vectors(simulation, "displacement");
                places.into_iter().zip(moved).collect::<Vec<_>>()
            });
            let size = ours.iter().flat_map(|(_, u)| *u).fold(0.0, |a: f64, b| a.max(b.abs()));
            let mut largest = 0.0f64;
            for (x, u) in &ours {
                let (_, there) = theirs.iter().find(|(place, _)| place == x).unwrap();
                largest = (0..3).fold(largest, |largest, d| largest.max((u[d] - there[d]).abs() / size));
            }
            let [ours, theirs] = [&part, &whole].map(|simulation| simulation.model.broken_pairs());
            println!("{dimension}D {law}: apart by {largest:e}, {ours} of {theirs} pairs broken");
            // 60 steps with rounded places of images, strains of which are differences a thousand times smaller.
            assert!(largest < 1e-9, "{dimension}D: {largest:e}");
            assert!(ours > 0 && theirs > 0);
            let balance = part.model.balance();
            assert!(balance.momentum_defect < 1e-12 * balance.momentum_scale, "{balance:?}");
        }
    }
}

#[test]
fn modes_between_mirrors_decay_at_the_rate_of_the_lattice() {
    const N: usize = 40;
    let h = 1.0 / N as f64;
    let rule = PartialVolume::Ramp;
    let flux = Flux::new::<1>(Influence::Constant, 2, 1.0, 3.0 * h).unwrap();
    for scattered in [false, true] {
        for parity in [Parity::Even, Parity::Odd] {
            let mut cloud = Cloud::lattice(&Shape::Box { low: [0.0], high: [1.0] }, h, 4);
            let whole = standard::body(cloud.clone(), 3.0 * h, rule);
            if scattered {
                cloud = cloud.scattered_already();
            }
            let ends = Ends::Mirrors([0.0, 1.0].map(|at| Some(Mirror { at, parity })));
            let reach = rule.rim::<1>(h, 3.0 * h).end;
            let body = standard::body(cloud.with_images(&[ends], reach), 3.0 * h, rule);
            // ½ Σ w (1 − cos k ξ)/|ξ|^q is half of the rate; three half waves.
            let k = 1.5 * TAU;
            let weights = Operator::standard(&whole, flux.micro_diffusivity, flux.influence, rule).weights.by_offset;
            let Families::Lattice(families) = &whole.families else { panic!("a lattice") };
            let terms = families.offsets.iter().zip(weights);
            let decay: f64 = terms.map(|(o, w)| w * (1.0 - (k * o.xi[0]).cos()) / o.length.powi(2)).sum();
            let diffusion = Diffusion::standard(&body, &flux, rule);
            let all: std::sync::Arc<[u32]> = body.cloud.select(|_| true).into();
            let mode = |x: f64| if parity == Parity::Even { (k * x).cos() } else { (k * x).sin() };
            let mut body = Diffusing::new(body, diffusion);
            for &slot in body.body.cloud.slots.clone().iter() {
                body.concentration[slot as usize] = mode(body.body.cloud.position(slot as usize)[0]);
            }
            let dt = 0.9 * bondwise::physics::Physics::stable_step(&body);
            let force: Box<dyn Term> = Box::new(MirrorForce::new("mirrors".into(), all, 0));
            let mut problem = Problem::new(Box::new(body), Vec::new(), vec![force]);
            problem.start();
            let mut clock = Clock::new(dt);
            let steps = 50;
            for _ in 0..steps {
                problem.step(&Solver::ForwardEuler(ForwardEuler), &mut clock, &mut |_, _| true).expect("a sound step");
            }
            let left = (1.0 - dt * decay).powi(steps);
            let Values::Scalar(values) = problem.field("concentration").unwrap().values else { panic!("a scalar") };
            assert!(left > 1e-3 && left < 0.5, "something has decayed: {left}");
            for (i, value) in values.iter().enumerate() {
                let expected = left * mode((i as f64 + 0.5) * h);
                // Each step rounds a few times, places of images of a cloud once; a digit in reserve.
                assert!((value - expected).abs() < 2000.0 * f64::EPSILON, "{i}: {value} {expected}");
            }
            // What three half waves of the sine hold has left through the mirrors, and is booked.
            let balance = problem.balance();
            assert!(balance.momentum_defect < 1e-13 * N as f64, "{balance:?}");
            assert_eq!(balance.impulse[0].abs() > 1e-3, parity == Parity::Odd);
        }
    }
}
