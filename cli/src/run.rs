//! `bondwise run`

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bondwise::Result;
use bondwise::case::build::{Options, load};
use bondwise::output::report::Report;
use bondwise::output::source::ElasticSummary;
use bondwise::simulation::{Control, prepare_folder};
use bondwise::solver::statics::LoadStep;

use crate::progress::Line;
use crate::{RunArgs, on_threads, say};

/// Imbalance above which a run is not to be trusted: crack growth at the stable step stays well below.
const IMBALANCE: f64 = 0.01;

pub fn run(args: &RunArgs) -> Result<ExitCode> {
    let folder = args.out.clone().unwrap_or_else(|| free_folder(&args.case.case));
    let (report, causes) = on_threads(args.case.threads, || -> Result<(Report, Vec<String>)> {
        let options = Options { folder: folder.clone(), many_files: args.many_files, ..Options::default() };
        let mut simulation = load(&args.case.case, &args.case.overrides, &options)?;
        prepare_folder(&folder, args.overwrite)?;
        if !args.quiet {
            let facts = simulation.model.facts();
            say!("{}", simulation.title);
            say!(
                "{} points, {} bonds, horizon {:.4e} m, {} steps of {:.4e} s, {} threads, results in {}",
                facts.points,
                facts.bonds - facts.cut_bonds,
                facts.horizon,
                simulation.n_steps,
                simulation.clock.dt,
                simulation.threads,
                folder.display()
            );
            if let Some(ElasticSummary { surface, .. }) = facts.physics.elastic() {
                say!(
                    "surface effect: {:.1} % of the points are off, the softest has {:.2} of its stiffness",
                    100.0 * surface.points_affected,
                    surface.softest
                );
            }
        }
        let stop = Arc::new(AtomicBool::new(false));
        let asked = stop.clone();
        // The second Ctrl-C ends the program at once.
        let _ = ctrlc::set_handler(move || {
            if asked.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
            eprintln!(
                "\ninterrupted: finishing this step, or leaving this load step, and writing the last frame (again to end at once)"
            );
        });
        let mut line = Line::new(args.quiet);
        let report = simulation.run(|progress| {
            line.show(progress);
            if stop.load(Ordering::Relaxed) { Control::Stop } else { Control::Continue }
        });
        line.finish();
        let report = report?;
        let causes = simulation.causes_of_imbalance(&report);
        Ok((report, causes))
    })??;
    if !args.quiet {
        summary(&report, &folder);
    }
    if let Some(imbalance) = report.energy_imbalance.filter(|imbalance| *imbalance > IMBALANCE) {
        eprintln!(
            "warning: the energy balance is off by {:.1} % of what came in; see the column `imbalance` of history.csv",
            100.0 * imbalance
        );
        causes.iter().for_each(|cause| eprintln!("    possible cause: {cause}"));
    }
    Ok(if report.status == "interrupted" { ExitCode::from(130) } else { ExitCode::SUCCESS })
}

/// `out/<case>`, or `out/<case>-2` and so on when that is taken: nothing is overwritten.
fn free_folder(case: &Path) -> PathBuf {
    let absolute = std::path::absolute(case).unwrap_or_else(|_| case.to_path_buf());
    let named = if absolute.is_dir() || absolute.file_stem().is_none_or(|s| s != "case") {
        absolute.file_stem()
    } else {
        absolute.parent().and_then(Path::file_name)
    };
    let name = named.map_or("case".into(), |n| n.to_string_lossy().into_owned());
    let numbered = (2..).map(|k| format!("{name}-{k}"));
    let mut folders = std::iter::once(name.clone()).chain(numbered).map(|name| Path::new("out").join(name));
    folders.find(|folder| !folder.exists()).unwrap_or_default()
}

fn millimetres(position: &[f64]) -> String {
    position.iter().map(|x| format!("{:.3}", 1e3 * x)).collect::<Vec<_>>().join(", ")
}

fn summary(report: &Report, folder: &Path) {
    say!("{} after {} steps, t = {:.6e} s", report.status, report.steps, report.end_time);
    if let (Some(e), Some(imbalance)) = (&report.energy, report.energy_imbalance) {
        say!(
            "energy: kinetic {:.6e}, strain {:.6e}, fracture {:.6e}, external work {:.6e} J; largest imbalance {imbalance:.2e}",
            e.kinetic,
            e.strain,
            e.fracture,
            e.external
        );
    }
    if let (Some(broken), Some(damaged)) = (report.broken_bonds, report.damaged_points) {
        say!("broken bonds: {broken}; damaged points: {damaged}");
    }
    if let Some(most) = &report.largest_stretch_ratio {
        say!(
            "largest stretch of a whole bond: {:.3} of its critical stretch, at ({}) mm and t = {:.4e} s",
            most.value,
            millimetres(&most.position),
            most.time
        );
    }
    if let Some(diffusion) = &report.diffusion {
        let book = |name: &str| report.books.get(name).and_then(|value| value.as_f64()).unwrap_or(f64::NAN);
        say!(
            "amount: {:.6e}, of which supplied {:.6e}; largest imbalance {:.2e}",
            book("amount"),
            book("supplied"),
            diffusion.imbalance
        );
    }
    if let Some(tip) = &report.crack_tip {
        let place = tip.position.as_ref().map_or("none".into(), |x| millimetres(x));
        say!(
            "crack tip: ({place}) mm; largest speed {:.0} m/s (Rayleigh speed {:.0} m/s)",
            tip.largest_speed,
            tip.rayleigh_speed.unwrap_or(f64::NAN)
        );
    }
    if !report.load_steps.is_empty() {
        let steps = &report.load_steps;
        let sum = |of: fn(&LoadStep) -> usize| steps.iter().map(of).sum::<usize>();
        say!(
            "load steps: {}; {} iterations, {} of the linear solver, {} halvings; largest imbalance of forces {:.2e}",
            steps.len(),
            sum(|s| s.iterations),
            sum(|s| s.linear_iterations),
            sum(|s| s.halvings),
            steps.iter().map(|s| s.imbalance).fold(0.0, f64::max)
        );
    }
    let w = &report.wall_seconds;
    say!(
        "time: setup {:.2} s, stepping {:.2} s, output {:.2} s (beside them, writing {:.2} s); {:.3e} bond updates per \
         second",
        w.setup,
        w.stepping,
        w.output,
        w.writing,
        report.bond_updates_per_second
    );
    say!("state hash: {}", report.state_hash);
    say!("report: {}", folder.join("report.json").display());
}
