//! `bondwise bench`: how fast a bond is, on problems that others are timed on, beside what the machine can do.

mod counts;
mod problems;
mod row;

use std::process::ExitCode;
use std::time::Instant;

use bondwise::Result;
use bondwise::case::build::{Options, build};
use bondwise::case::{Case, read_text};
use bondwise::execution::machine::Limits;
use serde_json::Value;

use self::counts::{Sizes, Work};
pub use self::problems::PROBLEMS;
use self::problems::{Body, Problem};
use self::row::Row;
use crate::{on_threads, say};

#[derive(clap::Args)]
pub struct BenchArgs {
    /// Which problem; all of them if not given.
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(PROBLEMS.map(|p| p.name)))]
    problem: Option<String>,
    /// n, points along an edge of the cube. May be several: `--size 40 64`.
    #[arg(long, num_args = 1.., value_delimiter = ',', default_value = "40")]
    #[arg(value_parser = clap::value_parser!(u32).range(8..=400))]
    size: Vec<u32>,
    /// Steps to time, after some that are not.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
    steps: u32,
    /// Threads; all processors if not given. May be several.
    #[arg(long, num_args = 1.., value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..))]
    threads: Vec<u16>,
    /// What fields are stored in and bonds are computed in. May be several.
    #[arg(long, num_args = 1.., value_delimiter = ',', default_value = "double")]
    #[arg(value_parser = ["double", "single", "mixed"])]
    precision: Vec<String>,
    /// Print a JSON list of rows instead of a table.
    #[arg(long)]
    json: bool,
}

pub fn bench(args: &BenchArgs) -> Result<ExitCode> {
    let mut rows = Vec::new();
    let all = [None];
    let some: Vec<Option<u16>> = args.threads.iter().copied().map(Some).collect();
    for &threads in if some.is_empty() { &all[..] } else { &some } {
        rows.extend(on_threads(threads, || on_these_threads(args))??);
    }
    if args.json {
        say!("{:#}", Value::Array(rows.iter().map(Row::json).collect()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Measures the machine, then the problems; prints the table as it goes.
fn on_these_threads(args: &BenchArgs) -> Result<Vec<Row>> {
    let limits = Limits::measure();
    if !args.json {
        say!(
            "This machine on {} thread{}: {:.1} GB/s (STREAM triad), {:.1} GF/s in f64, {:.1} GF/s in f32.\n\
             Directed bonds; ns per bond of one thread: median and best of {} steps, whole steps; set-up in steps.\n{}",
            limits.threads,
            if limits.threads == 1 { "" } else { "s" },
            1e-9 * limits.bandwidth,
            1e-9 * limits.peak_double,
            1e-9 * limits.peak_single,
            args.steps,
            Row::heading()
        );
    }
    let mut rows = Vec::new();
    let one = args.problem.as_deref().and_then(Problem::named);
    for problem in PROBLEMS.iter().filter(|p| one.is_none_or(|one| one.name == p.name)) {
        // The plate has one size.
        let sizes = if problem.body == Body::Plate { &args.size[..1] } else { &args.size };
        for &size in sizes {
            for precision in &args.precision {
                let row = measure(problem, size, precision, args.steps, limits)?;
                if !args.json {
                    say!("{}", row.line());
                }
                rows.push(row);
            }
        }
    }
    Ok(rows)
}

fn measure(problem: &'static Problem, size: u32, precision: &str, steps: u32, limits: Limits) -> Result<Row> {
    let in_precision = [("discretization.precision".to_string(), precision.to_string())];
    let case = read_text::<Case>(problem.name, &problem.case(size), &in_precision).map_err(bondwise::Error::Case)?;
    let mut simulation = build(&case, &Options::default())?;
    let facts = simulation.model.facts().clone();
    simulation.model.start();
    for _ in 0..problem.warm_up() {
        simulation.model.step(&simulation.solver, &mut simulation.clock)?;
    }
    let broken = simulation.model.broken_pairs();
    let mut seconds = Vec::new();
    for _ in 0..steps {
        let begin = Instant::now();
        simulation.model.step(&simulation.solver, &mut simulation.clock)?;
        seconds.push(begin.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    let bonds = facts.bonds - facts.cut_bonds;
    Ok(Row {
        problem,
        precision: precision.to_string(),
        points: facts.points,
        bonds,
        broken_pairs: simulation.model.broken_pairs() - broken,
        setup_seconds: simulation.setup_seconds,
        step_seconds: seconds[seconds.len() / 2],
        best_step_seconds: seconds[0],
        bytes_per_point: facts.memory as f64 / facts.points as f64,
        work: Work::of_step(problem, precision, Sizes { dimension: facts.dimension, points: facts.points, bonds }),
        limits,
    })
}
