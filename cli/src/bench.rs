//! `bondwise bench`: how fast a bond is, on problems that other codes have been timed on.

use std::process::ExitCode;
use std::time::Instant;

use bondwise::Result;
use bondwise::case::build::{Options, build};
use bondwise::case::{Case, bundled, read_text};

use crate::{on_threads, say};

/// Names of the problems, in the order of the table.
pub const PROBLEMS: [(&str, &str); 4] = [
    ("block3d", "cube of n³ points on a lattice, horizon 3.015 spacings, no bond breaks"),
    ("block3d-breaking", "the same cube with a critical stretch that some bonds pass at every step"),
    ("cloud3d", "the same cube as a perturbed, scattered cloud"),
    ("plate2d", "the bundled case crack_branching"),
];

#[derive(clap::Args)]
pub struct BenchArgs {
    /// Which problem; all of them if not given.
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(PROBLEMS.map(|p| p.0)))]
    problem: Option<String>,
    /// n, points along an edge of the cube.
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(8..=400))]
    size: u32,
    /// Steps to time, after two that are not.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
    steps: u32,
    /// Threads; all processors if not given.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Print a JSON list of rows instead of a table.
    #[arg(long)]
    json: bool,
}

/// One measurement.
struct Row {
    problem: &'static str,
    path: &'static str,
    points: usize,
    bonds: u64,
    threads: usize,
    setup_seconds: f64,
    /// Median over the steps.
    step_seconds: f64,
    bytes_per_point: f64,
}

impl Row {
    fn bond_updates_per_second(&self) -> f64 {
        self.bonds as f64 / self.step_seconds
    }
    /// Of one thread: a step's time × threads over its bonds.
    fn ns_per_bond(&self) -> f64 {
        1e9 * self.step_seconds * self.threads as f64 / self.bonds as f64
    }
}

pub fn bench(args: &BenchArgs) -> Result<ExitCode> {
    let rows = on_threads(args.threads, || -> Result<Vec<Row>> {
        let wanted = |name: &str| args.problem.as_deref().is_none_or(|p| p == name);
        PROBLEMS.iter().filter(|(name, _)| wanted(name)).map(|(name, _)| measure(name, args)).collect()
    })??;
    if args.json {
        let list: Vec<serde_json::Value> = rows
            .iter()
            .map(|row| {
                serde_json::json!({
                    "problem": row.problem,
                    "path": row.path,
                    "precision": "double",
                    "points": row.points,
                    "bonds": row.bonds,
                    "threads": row.threads,
                    "setup_seconds": row.setup_seconds,
                    "step_seconds": row.step_seconds,
                    "ns_per_bond": row.ns_per_bond(),
                    "bond_updates_per_second": row.bond_updates_per_second(),
                    "points_per_second": row.points as f64 / row.step_seconds,
                    "bytes_per_point": row.bytes_per_point,
                })
            })
            .collect();
        say!("{:#}", serde_json::Value::Array(list));
        return Ok(ExitCode::SUCCESS);
    }
    say!("directed bonds; ns per bond of one thread; median of {} steps, whole step included", args.steps);
    say!(
        "{:<17} {:<8} {:>9} {:>11} {:>7} {:>9} {:>9} {:>10} {:>11}",
        "problem",
        "path",
        "points",
        "bonds",
        "threads",
        "setup s",
        "ns/bond",
        "bonds/s",
        "bytes/point"
    );
    for row in &rows {
        say!(
            "{:<17} {:<8} {:>9} {:>11} {:>7} {:>9.3} {:>9.3} {:>10.3e} {:>11.0}",
            row.problem,
            row.path,
            row.points,
            row.bonds,
            row.threads,
            row.setup_seconds,
            row.ns_per_bond(),
            row.bond_updates_per_second(),
            row.bytes_per_point
        );
    }
    Ok(ExitCode::SUCCESS)
}

fn measure(problem: &'static str, args: &BenchArgs) -> Result<Row> {
    let text = match problem {
        "plate2d" => bundled::CASES[0].case.to_string(),
        _ => block(args.size, problem),
    };
    let case = read_text::<Case>(problem, &text, &[]).map_err(bondwise::Error::Case)?;
    let mut simulation = build(&case, &Options::default())?;
    let facts = simulation.model.facts().clone();
    simulation.model.start();
    let mut seconds = Vec::new();
    for step in 0..args.steps + 2 {
        let begin = Instant::now();
        simulation.model.step(&simulation.solver, &mut simulation.clock)?;
        if step >= 2 {
            seconds.push(begin.elapsed().as_secs_f64());
        }
    }
    seconds.sort_by(f64::total_cmp);
    Ok(Row {
        problem,
        path: if problem == "cloud3d" { "cloud" } else { "lattice" },
        points: facts.points,
        bonds: facts.bonds - facts.cut_bonds,
        threads: rayon::current_num_threads(),
        setup_seconds: simulation.setup_seconds,
        step_seconds: seconds[seconds.len() / 2],
        bytes_per_point: facts.memory as f64 / facts.points as f64,
    })
}

/// A cube in uniaxial stretching motion: Δx = 0.5 mm, E = 72 GPa, ρ = 2440 kg/m³, v_x = 2x/x_max − 1 m/s.
fn block(n: u32, problem: &str) -> String {
    let perturb = if problem == "cloud3d" { "perturb = { amplitude = 0.05, seed = 1 }" } else { "" };
    // The rate of stretching is 4/x_max a second: after k steps of 20 ns the mean stretch along x is 8e-8 k / x_max.
    let stretch = if problem == "block3d-breaking" { "1e-7 / (n * 5e-4)" } else { "0.01" };
    format!(
        r#"
        [case]
        title = "{problem}"
        dimension = 3
        [constants]
        n = {n}
        [geometry]
        shape = {{ box = {{ low = [0, 0, 0], high = ["n*5e-4", "n*5e-4", "n*5e-4"] }} }}
        spacing = 5e-4
        {perturb}
        [discretization]
        horizon_ratio = 3.015
        partial_volumes = "none"
        [physics.elasticity]
        law = {{ bond_based = {{ young = 72e9, density = 2440 }} }}
        failure = {{ critical_stretch = {{ stretch = "{stretch}" }} }}
        [[conditions]]
        on = "all"
        initial = {{ velocity = {{ component = 0, value = "2*x/(n*5e-4) - 1" }} }}
        [solver.velocity_verlet]
        end_time = 1
        time_step = 2e-8
        "#
    )
}
