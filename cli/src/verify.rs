//! `bondwise verify`

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use bondwise::expression::nearest;
use bondwise::output::picture::{write_animation, write_png};
use bondwise::{Error, Result};
use bondwise_studies::bar::Micromodulus;
use bondwise_studies::{self as verify, Measure, Outcome, Row, STUDIES, Study};
use indicatif::ProgressBar;
use serde_json::{Value, json};

use crate::say;

#[derive(clap::Args)]
pub struct VerifyArgs {
    /// A study (see `bondwise list studies`); all quick ones if not given.
    study: Option<String>,
    /// The whole extent of each study, heavy ones included.
    #[arg(long)]
    full: bool,
    /// One influence function instead of the study's own choice, for `convergence-1d` and `table-4`: constant,
    /// triangular or inverted.
    #[arg(long, value_name = "NAME", requires = "study")]
    influence: Option<String>,
    /// Print one JSON array and nothing else.
    #[arg(long)]
    json: bool,
    /// Folder for the plots.
    #[arg(long, default_value = "out/verify")]
    out: PathBuf,
}

pub fn verify(args: &VerifyArgs) -> Result<ExitCode> {
    let studies: Vec<&Study> = match &args.study {
        None => STUDIES.iter().filter(|study| args.full || !study.heavy).collect(),
        Some(name) => match verify::find(name) {
            Some(study) => vec![study],
            None => return Ok(unknown(name)),
        },
    };
    let influence = match &args.influence {
        None => None,
        Some(name) => match influence(name, &studies) {
            Ok(influence) => Some(influence),
            Err(message) => {
                eprintln!("{message}");
                return Ok(ExitCode::from(2));
            }
        },
    };
    let mut found = Vec::new();
    for study in studies {
        let begin = Instant::now();
        let outcome = {
            let _line = Line::new(study);
            match influence.zip(study.with_influence()) {
                Some((influence, run)) => run(args.full, influence)?,
                None => (study.run)(args.full)?,
            }
        };
        let plots = write_plots(study, &outcome, &args.out)?;
        if !args.json {
            show(study, &outcome, &plots, begin.elapsed());
        }
        found.push((study, outcome, plots));
    }
    let failed: Vec<&str> = found.iter().filter(|(_, o, _)| !o.passes()).map(|(study, ..)| study.name).collect();
    if args.json {
        let all: Vec<Value> = found.iter().map(|(study, outcome, plots)| as_json(study, outcome, plots)).collect();
        say!("{:#}", Value::Array(all));
    } else {
        say!("{}", conclusion(found.len(), &failed));
    }
    Ok(if failed.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// The influence function of that name, if every one of the studies knows how to take one.
fn influence(name: &str, studies: &[&Study]) -> Result<Micromodulus, String> {
    if let Some(study) = studies.iter().find(|study| study.with_influence().is_none()) {
        let able = STUDIES.iter().filter(|s| s.with_influence().is_some()).map(|s| s.name).collect::<Vec<_>>();
        return Err(format!("`{}` takes no --influence; these do: {}", study.name, able.join(", ")));
    }
    Micromodulus::ALL.into_iter().find(|m| m.name() == name).ok_or_else(|| {
        let names = Micromodulus::ALL.map(Micromodulus::name);
        let help = nearest(name, names).map_or(String::new(), |n| format!("; did you mean `{n}`?"));
        format!("no influence function of these studies is called `{name}`{help}\nthere are: {}", names.join(", "))
    })
}

/// A wrong name is a mistake of usage.
fn unknown(name: &str) -> ExitCode {
    let help =
        nearest(name, STUDIES.iter().map(|s| s.name)).map_or(String::new(), |n| format!("; did you mean `{n}`?"));
    eprintln!("no study is called `{name}`{help}\nthere are:");
    for study in STUDIES {
        eprintln!("    {:<18} {}{}", study.name, study.about, if study.heavy { " (heavy)" } else { "" });
    }
    ExitCode::from(2)
}

fn conclusion(n: usize, failed: &[&str]) -> String {
    let studies = if n == 1 { "study" } else { "studies" };
    if failed.is_empty() {
        format!("{n} {studies}: all passed")
    } else {
        format!("{n} {studies}: {} FAILED: {}", failed.len(), failed.join(", "))
    }
}

fn write_plots(study: &Study, outcome: &Outcome, folder: &Path) -> Result<Vec<PathBuf>> {
    let mut written = Vec::new();
    if !outcome.plots.is_empty() || !outcome.animations.is_empty() {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    }
    for (name, image) in &outcome.plots {
        let path = folder.join(format!("{}_{name}.png", study.name));
        write_png(image, &path).map_err(|e| Error::io(&path, e))?;
        written.push(path);
    }
    for (name, images) in &outcome.animations {
        let path = folder.join(format!("{}_{name}.png", study.name));
        write_animation(images, &path).map_err(|e| Error::io(&path, e))?;
        written.push(path);
    }
    Ok(written)
}

/// A heavy study says on the standard error that it runs; a quick one has no time to.
struct Line(Option<ProgressBar>);

impl Line {
    fn new(study: &Study) -> Self {
        if !study.heavy {
            return Line(None);
        }
        if !std::io::stderr().is_terminal() {
            eprintln!("{}: runs; this takes minutes", study.name);
            return Line(None);
        }
        let bar = ProgressBar::new_spinner().with_message(format!("{}: runs; this takes minutes", study.name));
        if let Ok(style) = indicatif::ProgressStyle::with_template("[{elapsed_precise}] {spinner} {msg}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        Line(Some(bar))
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}

/// The table of a study; origins stand below it, once each, with the numbers that the rows refer to.
fn show(study: &Study, outcome: &Outcome, plots: &[PathBuf], took: Duration) {
    say!("{}: {}\n", study.name, study.about);
    let mut origins: Vec<&str> = Vec::new();
    let head = ["what", "expected", "obtained", "difference", "tolerance", "pass", "origin"].map(String::from);
    let mut lines = vec![head];
    for row in &outcome.rows {
        let origin = origins.iter().position(|o| *o == row.origin).unwrap_or_else(|| {
            origins.push(&row.origin);
            origins.len() - 1
        });
        let [expected, difference, tolerance] = compared(row);
        let pass = match (row.passes(), row.measure) {
            (false, _) => "NO",
            (true, Measure::Information) => "-",
            (true, _) => "yes",
        };
        let origin = format!("[{}]", origin + 1);
        lines.push([row.what.clone(), expected, number(row.obtained), difference, tolerance, pass.into(), origin]);
    }
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; 7] = std::array::from_fn(width);
    for line in &lines {
        let cells: Vec<String> = (0..7)
            .map(|c| match c {
                0 | 5 | 6 => format!("{:<1$}", line[c], widths[c]),
                _ => format!("{:>1$}", line[c], widths[c]),
            })
            .collect();
        say!("  {}", cells.join("  ").trim_end());
    }
    say!("");
    for (k, origin) in origins.iter().enumerate() {
        say!("  [{}] {origin}", k + 1);
    }
    for note in &outcome.notes {
        say!("  note: {note}");
    }
    for path in plots {
        say!("  plot: {}", path.display());
    }
    let result = if outcome.passes() { "passed" } else { "FAILED" };
    say!("  {result}: {} comparisons in {:.1} s\n", outcome.rows.len(), took.as_secs_f64());
}

/// Expected value, difference and tolerance as they stand in the table.
fn compared(row: &Row) -> [String; 3] {
    let (expected, difference) = (number(row.expected), row.difference());
    match row.measure {
        Measure::Absolute => [expected, signed(difference), number(row.tolerance)],
        Measure::Relative => [expected, relative(difference), relative(row.tolerance)],
        Measure::AtMost => [format!("≤ {expected}"), signed(difference), "-".into()],
        Measure::AtLeast => [format!("≥ {expected}"), signed(difference), "-".into()],
        Measure::Information => [expected, signed(difference), "-".into()],
    }
}

fn signed(difference: f64) -> String {
    if difference == 0.0 { "0".into() } else { format!("{difference:+.2e}") }
}

/// In percent where that is readable.
fn relative(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        small if small < 1e-4 => format!("{value:.0e}"),
        _ => format!("{:.2} %", 100.0 * value),
    }
}

/// Seven digits, without trailing zeros.
fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if !value.is_finite() || !(1e-3..1e7).contains(&value.abs()) {
        return format!("{value:.6e}").replace("000000e", "e").replace(".e", "e");
    }
    let digits = (6 - value.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

fn as_json(study: &Study, outcome: &Outcome, plots: &[PathBuf]) -> Value {
    let rows: Vec<Value> = outcome
        .rows
        .iter()
        .map(|row| {
            json!({
                "what": row.what,
                "expected": row.expected,
                "obtained": row.obtained,
                "difference": row.difference(),
                "tolerance": row.tolerance,
                "measure": row.measure,
                "origin": row.origin,
                "passed": row.passes(),
            })
        })
        .collect();
    json!({
        "study": study.name,
        "about": study.about,
        "passed": outcome.passes(),
        "rows": rows,
        "notes": outcome.notes,
        "plots": plots,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_seven_digits_and_no_tails() {
        for (value, text) in [
            (0.0, "0"),
            (2688.0, "2688"),
            (496458.0, "496458"),
            (2.714621e-4, "2.714621e-4"),
            (1.0 / 3.0, "0.3333333"),
            (1e-12, "1e-12"),
            (-0.5, "-0.5"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
