//! The program `bondwise`: reads the command line, calls the library, prints what it answers.

mod bench;
mod check;
mod list;
mod new;
mod progress;
mod run;
mod verify;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

/// Peridynamics: cracks that start, run and branch, from one case file.
#[derive(Parser)]
#[command(name = "bondwise", version, arg_required_else_help = true, propagate_version = true)]
#[command(
    after_help = "Exit codes: 0 done, 1 a verification failed, 2 usage, 3 input refused, 4 stopped on numbers,\n\
    5 I/O, 6 too large for this machine, 130 interrupted.\n\n\
    Example:\n  bondwise new crack_branching\n  bondwise run crack_branching"
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a case: march it to its end, write frames, pictures, history and report.
    #[command(
        after_help = "Example:\n  bondwise run cases/crack_branching --out results --set geometry.spacing=\"0.5 mm\""
    )]
    Run(RunArgs),
    /// Say what a case would do: points, bonds, neighbours, steps, memory. Changes nothing.
    #[command(after_help = "Example:\n  bondwise check cases/crack_branching")]
    Check(CaseArgs),
    /// Copy a bundled case here, to be changed.
    #[command(after_help = "Example:\n  bondwise new crack_branching my_plate")]
    New {
        /// Name of a bundled case (see `bondwise list cases`).
        name: String,
        /// Folder to make; the name of the case if not given.
        folder: Option<PathBuf>,
    },
    /// List what there is: cases, laws, influence functions, conditions, solvers, outputs, studies; or the JSON schema.
    #[command(after_help = "Example:\n  bondwise list laws\n  bondwise list schema > case.schema.json")]
    List {
        /// What to list; everything if not given.
        #[arg(value_parser = list::TOPICS)]
        topic: Option<String>,
    },
    /// Prove it: run verification studies and compare with closed forms and published figures.
    #[command(after_help = "Example:\n  bondwise verify                     (all quick studies)\n  \
        bondwise verify crack-branching --out proof --json")]
    Verify(verify::VerifyArgs),
    /// Measure it: time per bond, bytes per point, and the fraction of what this machine can do.
    #[command(after_help = "Example:\n  bondwise bench block3d --size 40 64 --precision double single --json")]
    Bench(bench::BenchArgs),
}

#[derive(Args)]
struct CaseArgs {
    /// A case file, or a folder with a `case.toml`.
    case: PathBuf,
    /// Override a key of the case: `--set discretization.horizon_ratio=4`. May be given more than once.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_value)]
    overrides: Vec<(String, String)>,
    /// Threads; all processors if not given. The results do not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

#[derive(Args)]
struct RunArgs {
    #[command(flatten)]
    case: CaseArgs,
    /// Folder for the results; a new one under `out/` if not given.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Allow an output folder that is not empty.
    #[arg(long)]
    overwrite: bool,
    /// Allow outputs of more than 100,000 files.
    #[arg(long)]
    many_files: bool,
    /// Print nothing but errors.
    #[arg(long, short)]
    quiet: bool,
}

fn key_value(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => Ok((key.trim().to_string(), value.trim().to_string())),
        _ => Err("expected KEY=VALUE, such as geometry.spacing=0.001".into()),
    }
}

/// Warnings of the library go to the standard error, plainly.
struct Warnings;

impl log::Log for Warnings {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }
    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            let text = record.args().to_string();
            let mark = if text.contains("warning: ") { "" } else { "warning: " };
            eprintln!("{mark}{text}");
        }
    }
    fn flush(&self) {}
}

fn main() -> ExitCode {
    // Fails only if a logger is set already.
    let _ = log::set_logger(&Warnings).map(|()| log::set_max_level(log::LevelFilter::Warn));
    let cli = Cli::parse();
    let result = match cli.command {
        Command::Run(args) => run::run(&args),
        Command::Check(args) => check::check(&args),
        Command::New { name, folder } => new::new(&name, folder),
        Command::List { topic } => list::list(topic.as_deref()),
        Command::Verify(args) => verify::verify(&args),
        Command::Bench(args) => bench::bench(&args),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// Runs `work` on a pool of the asked number of threads.
fn on_threads<T: Send>(threads: Option<u16>, work: impl FnOnce() -> T + Send) -> bondwise::Result<T> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(n) = threads {
        pool = pool.num_threads(n.into());
    }
    let pool = pool.build().map_err(|e| bondwise::Error::Refused(format!("threads: {e}")))?;
    Ok(pool.install(work))
}

/// Prints a line; a reader that has gone away is no error of ours.
macro_rules! say {
    ($($argument:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stdout(), $($argument)*);
    }};
}
pub(crate) use say;
