//! The program as a user meets it: what it prints, what it writes, what it leaves alone, how it ends.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;

/// A notched strip that tears within a hundred steps.
const STRIP: &str = r#"
[case]
title = "Strip"
dimension = 2

[geometry]
shape = { rectangle = { size = [0.04, 0.02] } }
spacing = "1 mm"
cracks = [{ segment = { from = [-0.02, 0.0], to = [-0.005, 0.0] } }]

[sets]
top = { where = "y > 0.007" }
low = { where = "y < -0.007" }

[discretization]
horizon_ratio = 3

[physics.elasticity]
law = { bond_based = { young = "72 GPa", density = "2440 kg/m^3" } }
failure = { critical_stretch = { fracture_energy = "3.8 J/m^2", no_fail = ["top", "low"] } }

[[conditions]]
on = "top"
prescribe = { velocity = { component = 1, value = 2.0 } }

[[conditions]]
on = "low"
prescribe = { velocity = { component = 1, value = -2.0 } }

[solver.velocity_verlet]
end_time = "10 us"

[[output]]
vtu = { every_steps = 30 }

[[output]]
picture = { field = "damage", every_steps = 60, width = 300 }

[[output]]
history = { every_steps = 10 }

[[output]]
probe = { name = "ahead", at = [0.0, 0.0], every_steps = 10 }
"#;

/// A folder for one test, removed at its end, with the strip as `case.toml`.
struct Place(PathBuf);

impl Place {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("bondwise_program_{}_{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("case.toml"), STRIP).unwrap();
        Place(folder)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_bondwise"));
        command.args(args).current_dir(&self.0).env("NO_COLOR", "1").stdin(Stdio::null());
        command
    }

    /// Exit code, standard output, standard error.
    fn call(&self, args: &[&str]) -> (i32, String, String) {
        answer(&self.command(args).output().unwrap())
    }

    fn report(&self, folder: &str) -> Value {
        let text = fs::read_to_string(self.0.join(folder).join("report.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    }

    /// The files below a folder and what is in them.
    fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        fn walk(root: &Path, folder: &Path, found: &mut BTreeMap<String, Vec<u8>>) {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    walk(root, &path, found);
                } else {
                    let name = path.strip_prefix(root).unwrap().to_string_lossy().into_owned();
                    found.insert(name, fs::read(&path).unwrap());
                }
            }
        }
        let (root, mut found) = (self.0.join(folder), BTreeMap::new());
        walk(&root, &root, &mut found);
        found
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn answer(output: &Output) -> (i32, String, String) {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

/// The keys that `docs/report.md` explains, as JSON pointers: others read them, so that none may go without a word.
fn documented_keys() -> Vec<String> {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/report.md")).unwrap();
    let mut keys = Vec::new();
    for row in text.lines().filter(|line| line.starts_with("| `")) {
        let mut table = "";
        for key in row.split('|').nth(1).unwrap().split('`').skip(1).step_by(2) {
            // `energy.kinetic`, `.strain`: the second is in the table of the first.
            let (parent, name) = key.rsplit_once('.').unwrap_or(("", key));
            table = if key.starts_with('.') { table } else { parent };
            let slash = if table.is_empty() { "" } else { "/" };
            keys.push(format!("{slash}{table}/{name}"));
        }
    }
    assert!(keys.len() > 25 && keys.contains(&"/energy/strain".to_string()), "{keys:?}");
    keys
}

/// The number after a word of a text.
fn number_after(text: &str, word: &str) -> f64 {
    let rest = &text[text.find(word).unwrap_or_else(|| panic!("no `{word}` in\n{text}")) + word.len()..];
    let number: String = rest.trim_start().chars().take_while(|c| "0123456789.eE+-".contains(*c)).collect();
    number.parse().unwrap_or_else(|_| panic!("no number after `{word}` in\n{text}"))
}

#[test]
fn a_run_writes_report_history_frames_pictures_and_probe() {
    let place = Place::new("run");
    let (code, out, error) = place.call(&["run", "case.toml", "--out", "results"]);
    assert_eq!((code, error.as_str()), (0, ""), "{out}");
    for part in ["Strip\n", " points, ", " bonds, ", "done after", "energy: kinetic", "state hash: ", "results"] {
        assert!(out.contains(part), "no `{part}` in\n{out}");
    }
    let report = place.report("results");
    let documented = documented_keys();
    for key in &documented {
        assert!(report.pointer(key).is_some(), "docs/report.md has `{key}`, which is not in {report:#}");
    }
    for key in report.as_object().unwrap().keys() {
        let inside = format!("/{key}/");
        let known = documented.iter().any(|known| *known == format!("/{key}") || known.starts_with(&inside));
        assert!(known, "`{key}` is not in docs/report.md");
    }
    let number = |key: &str| report.pointer(key).and_then(Value::as_f64).unwrap_or_else(|| panic!("{key}: {report:#}"));
    assert_eq!(report["status"], "done");
    assert_eq!(number("/points"), 800.0);
    assert_eq!(number("/spacing"), 1e-3);
    assert!((number("/horizon") - 3e-3).abs() < 1e-15);
    assert!(number("/cut_bonds") > 0.0 && number("/broken_bonds") > 0.0 && number("/damaged_points") > 0.0);
    assert!((number("/end_time") - 1e-5).abs() < 1e-12);
    assert!(number("/energy/fracture") > 0.0 && number("/energy_imbalance") < 1e-2);
    assert!(number("/wall_seconds/setup") >= 0.0 && number("/bond_updates_per_second") > 0.0);
    assert_eq!(report["state_hash"].as_str().unwrap().len(), 64);
    assert!(out.contains(report["state_hash"].as_str().unwrap()));

    let steps = report["steps"].as_u64().unwrap();
    let files = place.files("results");
    let history = String::from_utf8(files["history.csv"].clone()).unwrap();
    let mut rows = history.lines();
    let columns: Vec<&str> = rows.next().unwrap().split(',').collect();
    for name in ["step", "time", "kinetic", "strain", "fracture", "external", "broken_bonds", "reaction_top_y"] {
        assert!(columns.contains(&name), "{columns:?}");
    }
    let steps_written: Vec<u64> =
        rows.map(|row| row.split(',').next().unwrap().parse::<f64>().unwrap() as u64).collect();
    let expected: Vec<u64> = (0..steps).filter(|step| step % 10 == 0).chain([steps]).collect();
    assert_eq!(steps_written, expected);

    let collection = String::from_utf8(files["fields.pvd"].clone()).unwrap();
    let frames: Vec<&String> = files.keys().filter(|name| name.starts_with("frames/")).collect();
    let expected: Vec<u64> = (0..steps).filter(|step| step % 30 == 0).chain([steps]).collect();
    assert_eq!(
        frames,
        expected
            .iter()
            .map(|step| format!("frames/frame_{step:08}.vtu"))
            .collect::<Vec<_>>()
            .iter()
            .collect::<Vec<_>>()
    );
    assert!(frames.iter().all(|name| collection.contains(name.as_str())), "{collection}");
    let pictures: Vec<_> = files.iter().filter(|(name, _)| name.starts_with("pictures/damage_")).collect();
    assert_eq!(pictures.len() as u64, 1 + (steps - 1) / 60 + 1);
    assert!(pictures.iter().all(|(_, bytes)| bytes.starts_with(b"\x89PNG\r\n")));
    assert!(files["probe_ahead.csv"].starts_with(b"step,time,displacement_x,displacement_y,velocity_x"));
    assert!(files.keys().all(|name| !name.ends_with(".part")), "{:?}", files.keys());
}

#[test]
fn the_state_does_not_depend_on_the_number_of_threads() {
    let place = Place::new("threads");
    let hashes: Vec<Value> = ["1", "2", "3"]
        .iter()
        .map(|threads| {
            let (code, _, error) = place.call(&["run", "case.toml", "--out", threads, "--threads", threads, "--quiet"]);
            assert_eq!((code, error.as_str()), (0, ""));
            let report = place.report(threads);
            assert_eq!(report["threads"].to_string(), *threads);
            report["state_hash"].clone()
        })
        .collect();
    assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");
}

#[test]
fn quiet_prints_nothing() {
    let place = Place::new("quiet");
    let short = ["run", "case.toml", "--out", "a", "--quiet", "--set", "solver.velocity_verlet.end_time=1 us"];
    assert_eq!(place.call(&short), (0, String::new(), String::new()));
    assert!(place.0.join("a/report.json").is_file());
}

#[test]
fn results_are_not_overwritten_unless_asked() {
    let place = Place::new("overwrite");
    let run = ["run", "case.toml", "--out", "results", "--set", "solver.velocity_verlet.end_time=6 us"];
    assert_eq!(place.call(&run).0, 0);
    fs::write(place.0.join("results/notes.txt"), "mine").unwrap();
    let before = place.files("results");

    let (code, out, error) = place.call(&run);
    assert_eq!((code, out.as_str()), (3, ""));
    assert!(error.contains("results: the output folder is not empty") && error.contains("--overwrite"), "{error}");
    assert_eq!(place.files("results"), before);

    // A shorter run leaves no frame of the longer one behind, and nothing of the user's is removed.
    let shorter =
        ["run", "case.toml", "--out", "results", "--overwrite", "--set", "solver.velocity_verlet.end_time=3 us"];
    assert_eq!(place.call(&shorter).0, 0);
    let after = place.files("results");
    assert_eq!(after["notes.txt"], b"mine");
    let last = format!("frames/frame_{:08}.vtu", place.report("results")["steps"].as_u64().unwrap());
    assert_eq!(after.keys().rfind(|name| name.starts_with("frames/")), Some(&last));
    assert!(before.keys().any(|name| name.starts_with("frames/") && *name > last));

    // An empty folder is as good as none.
    fs::create_dir(place.0.join("empty")).unwrap();
    let (code, ..) =
        place.call(&["run", "case.toml", "--out", "empty", "--set", "solver.velocity_verlet.end_time=1 us"]);
    assert_eq!(code, 0);
}

#[test]
fn without_out_each_run_finds_a_new_folder() {
    let place = Place::new("folders");
    fs::create_dir(place.0.join("plate")).unwrap();
    fs::rename(place.0.join("case.toml"), place.0.join("plate/case.toml")).unwrap();
    for (target, folder) in [("plate", "out/plate"), ("plate/case.toml", "out/plate-2")] {
        let (code, out, error) = place.call(&["run", target, "--set", "solver.velocity_verlet.end_time=1 us"]);
        assert_eq!((code, error.as_str()), (0, ""));
        assert!(out.contains(folder), "{out}");
        assert!(place.0.join(folder).join("report.json").is_file());
    }
}

#[test]
fn check_says_what_a_run_would_do_and_changes_nothing() {
    let place = Place::new("check");
    let before = place.files("");
    let (code, out, error) = place.call(&["check", "case.toml"]);
    assert_eq!((code, error.as_str()), (0, ""));
    for part in ["Strip", "stable step", "memory", "neighbours of a point", "horizon"] {
        assert!(out.contains(part), "no `{part}` in\n{out}");
    }
    assert_eq!(place.files(""), before);
    let (points, bonds) = (number_after(&out, "points"), number_after(&out, "bonds (directed)"));
    assert_eq!(points, 800.0);

    assert_eq!(place.call(&["run", "case.toml", "--out", "results", "--quiet"]).0, 0);
    let report = place.report("results");
    assert_eq!(report["points"].as_f64(), Some(points));
    assert_eq!(report["bonds"].as_f64().unwrap() + report["cut_bonds"].as_f64().unwrap(), bonds);
    assert_eq!(report["steps"].as_f64(), Some(number_after(&out, "\nsteps")));

    let (code, out, error) = place.call(&["check", "case.toml", "--set", "discretization.horizon_ratio=0.1"]);
    assert_eq!((code, out.as_str()), (3, ""));
    assert!(error.contains("--set discretization.horizon_ratio=0.1"), "{error}");
}

#[test]
fn diffusion_is_spoken_of_in_its_own_words() {
    let place = Place::new("diffusion");
    assert_eq!(place.call(&["new", "diffusion_in_a_square"]).0, 0);
    let (code, checked, error) = place.call(&["check", "diffusion_in_a_square"]);
    assert_eq!((code, error.as_str()), (0, ""));
    for part in ["diffusivity       1.000000e0 m^2/s", "found by waves    1.000000e0 m^2/s", "micro-diffusivity"] {
        assert!(checked.contains(part), "no `{part}` in\n{checked}");
    }
    let short = "solver.forward_euler.end_time=0.02";
    let (code, ran, error) = place.call(&["run", "diffusion_in_a_square", "--out", "results", "--set", short]);
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(ran.contains("amount: "), "{ran}");
    for word in
        ["micromodulus", "Rayleigh", "bar wave", "stretch", "surface effect", "energy", "broken", "damaged", "tip"]
    {
        assert!(!checked.contains(word) && !ran.contains(word), "`{word}` in\n{checked}\n{ran}");
    }
    let report = place.report("results");
    assert!(report["energy"].is_null() && report["micromodulus"].is_null(), "{report:#}");
    assert_eq!(report["diffusion"]["diffusivity"], 1.0);
}

#[test]
fn a_run_whose_numbers_explode_stops_and_says_where_and_why() {
    let place = Place::new("explodes");
    let args = ["run", "case.toml", "--out", "results", "--set", "conditions.0.prescribe.velocity.value=1e160"];
    let (code, _, error) = place.call(&args);
    assert_eq!(code, 4, "{error}");
    for part in ["stopped at step ", ", time ", " s: ", " at point ", "position (", "likely cause: "] {
        assert!(error.contains(part), "no `{part}` in\n{error}");
    }
    assert!(["velocity", "displacement", "force", "energy"].iter().any(|field| error.contains(field)), "{error}");
    let step = number_after(&error, "at step ");
    let report = place.report("results");
    assert_eq!(report["status"], "stopped");
    assert_eq!(report["steps"].as_f64(), Some(step));
    let files = place.files("results");
    assert!(files.contains_key(&format!("frames/frame_{:08}.vtu", step as u64)), "{:?}", files.keys());
    let history = String::from_utf8(files["history.csv"].clone()).unwrap();
    assert_eq!(history.lines().last().unwrap().split(',').next().unwrap().parse::<f64>().unwrap(), step);
}

#[test]
fn a_formula_that_fails_on_the_way_is_named_as_the_cause() {
    let place = Place::new("formula");
    let value = "conditions.0.prescribe.velocity.value=sqrt(2e-6 - t)";
    let (code, _, error) = place.call(&["run", "case.toml", "--out", "results", "--set", value]);
    assert_eq!(code, 4, "{error}");
    assert!(error.contains("likely cause: the formula `sqrt(2e-6 - t)` of a condition gave NaN"), "{error}");
    assert_eq!(place.report("results")["status"], "stopped");
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_ends_well() {
    use std::io::{BufRead, BufReader};

    let place = Place::new("interrupted");
    let args = ["run", "case.toml", "--out", "results", "--set", "solver.velocity_verlet.end_time=10 ms"];
    let mut child = place.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // The first row of the history says that the run is on its way.
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    out.read_line(&mut line).unwrap();
    let history = place.0.join("results/history.csv");
    let begin = std::time::Instant::now();
    while fs::read_to_string(&history).map_or(0, |text| text.lines().count()) < 3 {
        assert!(begin.elapsed().as_secs() < 30, "the run does not start");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    std::io::Read::read_to_string(&mut out, &mut line).unwrap();
    let (code, _, error) = answer(&child.wait_with_output().unwrap());
    assert_eq!(code, 130, "{error}");
    assert!(error.contains("interrupted"), "{error}");
    assert!(line.contains("interrupted after"), "{line}");
    let report = place.report("results");
    assert_eq!(report["status"], "interrupted");
    let steps = report["steps"].as_u64().unwrap();
    assert!(place.0.join(format!("results/frames/frame_{steps:08}.vtu")).is_file());
}

/// A tolerance that rounding puts out of reach: the load step would go on for hours.
#[cfg(unix)]
#[test]
fn a_load_step_is_interrupted_on_its_way() {
    use std::io::{BufRead, BufReader};

    let place = Place::new("load_step");
    let solver = "[solver.dynamic_relaxation]\ntolerance = 1e-30\nmax_iterations = 1000000000\n";
    let text = STRIP.replace("[solver.velocity_verlet]\nend_time = \"10 us\"\n", solver);
    assert!(text.contains(solver));
    fs::write(place.0.join("rest.toml"), text).unwrap();
    let args = ["run", "rest.toml", "--out", "results"];
    let mut child = place.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    // The heading is two lines; what answers Ctrl-C is there right after it.
    out.read_line(&mut line).unwrap();
    out.read_line(&mut line).unwrap();
    std::thread::sleep(std::time::Duration::from_millis(500));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    std::io::Read::read_to_string(&mut out, &mut line).unwrap();
    let (code, _, error) = answer(&child.wait_with_output().unwrap());
    assert_eq!(code, 130, "{error}");
    assert!(line.contains("interrupted after 0 steps") && line.contains("load steps: 1;"), "{line}");
    let report = place.report("results");
    assert_eq!((report["status"].as_str(), report["steps"].as_u64()), (Some("interrupted"), Some(0)));
    assert!(report["load_steps"][0]["iterations"].as_u64().unwrap() > 0);
}

#[test]
fn a_reader_that_goes_away_does_not_end_a_run() {
    let place = Place::new("pipe");
    let args = ["run", "case.toml", "--out", "results", "--set", "solver.velocity_verlet.end_time=2 us"];
    let mut child = place.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let (code, _, error) = answer(&child.wait_with_output().unwrap());
    assert_eq!((code, error.as_str()), (0, ""));
    assert_eq!(place.report("results")["status"], "done");
}

#[test]
fn the_smallest_case_that_is_shown_for_an_empty_one_runs() {
    let place = Place::new("smallest");
    fs::write(place.0.join("empty.toml"), "").unwrap();
    let (code, _, error) = place.call(&["check", "empty.toml"]);
    assert_eq!(code, 3);
    let shown: Vec<&str> = error.lines().skip_while(|line| !line.contains("smallest case")).skip(1).collect();
    fs::write(place.0.join("smallest.toml"), shown[..shown.len() - 1].join("\n")).unwrap();
    let (code, _, error) = place.call(&["run", "smallest.toml", "--out", "results"]);
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(place.report("results")["energy_imbalance"].as_f64().unwrap() < 1e-2);
}

#[test]
fn new_makes_a_case_that_can_be_checked() {
    let place = Place::new("new");
    let (code, out, error) = place.call(&["new", "crack_branching"]);
    assert_eq!((code, error.as_str()), (0, ""));
    assert!(out.contains("bondwise run crack_branching"), "{out}");
    let coarse = [
        "check",
        "crack_branching",
        "--set",
        "constants.h=0.1/100",
        "--set",
        "solver.velocity_verlet.time_step=100 ns",
    ];
    let (code, out, error) = place.call(&coarse);
    assert_eq!((code, error.as_str()), (0, ""));
    assert_eq!(number_after(&out, "points"), 4000.0);

    fs::write(place.0.join("crack_branching/case.toml"), "mine").unwrap();
    let (code, out, error) = place.call(&["new", "crack_branching"]);
    assert_eq!((code, out.as_str()), (3, ""));
    assert!(error.contains("exists already"), "{error}");
    assert_eq!(place.files("crack_branching")["case.toml"], b"mine");

    assert_eq!(place.call(&["new", "crack_branching", "a/b"]).0, 0);
    assert!(place.0.join("a/b/case.toml").is_file());

    let (code, _, error) = place.call(&["new", "crack_branch"]);
    assert_eq!(code, 3);
    assert!(error.contains("did you mean `crack_branching`?"), "{error}");
    assert!(!place.0.join("crack_branch").exists());
}

#[test]
fn help_shows_the_commands_and_an_example_of_each() {
    let place = Place::new("help");
    let (code, out, error) = place.call(&["--help"]);
    assert_eq!((code, error.as_str()), (0, ""));
    for part in ["run", "check", "new", "list", "verify", "bench", "Exit codes", "Example"] {
        assert!(out.contains(part), "no `{part}` in\n{out}");
    }
    for command in ["run", "check", "new"] {
        let (code, out, error) = place.call(&[command, "--help"]);
        assert_eq!((code, error.as_str()), (0, ""));
        assert!(out.contains("Example") && out.contains(&format!("bondwise {command} ")), "{out}");
    }
    let (code, out, _) = place.call(&["--version"]);
    assert_eq!((code, out.trim()), (0, concat!("bondwise ", env!("CARGO_PKG_VERSION"))));
}

#[test]
fn a_wrong_command_line_is_a_matter_of_usage() {
    let place = Place::new("usage");
    for args in
        [&["fly"][..], &["run"], &["run", "case.toml", "--outt", "x"], &["check", "case.toml", "--threads", "0"], &[]]
    {
        let (code, out, error) = place.call(args);
        assert_eq!(code, 2, "{args:?}: {error}");
        assert_eq!(out, "", "{args:?}");
        assert!(error.contains("--help") || error.contains("Usage"), "{args:?}: {error}");
    }
}

#[test]
fn an_influence_function_is_for_studies_that_take_one() {
    let place = Place::new("influence");
    for (study, name, answer) in
        [("navier", "constant", "these do: convergence-1d"), ("table-4", "constnt", "did you mean `constant`?")]
    {
        let (code, out, error) = place.call(&["verify", study, "--influence", name]);
        assert_eq!((code, out.as_str()), (2, ""), "{error}");
        assert!(error.contains(answer), "{error}");
    }
}

/// Rows of a quick benchmark.
fn benchmark(place: &Place, args: &[&str]) -> Vec<Value> {
    let (code, out, error) = place.call(&[&["bench"], args, &["--size", "12", "--json"]].concat());
    assert_eq!(code, 0, "{error}");
    serde_json::from_str(&out).unwrap()
}

#[test]
fn a_benchmark_measures_bonds_and_what_they_are_a_fraction_of() {
    let place = Place::new("bench");
    let rows = benchmark(&place, &["block3d", "--steps", "2", "--threads", "1", "2", "--precision", "double,single"]);
    let what = |row: &Value| (row["threads"].clone(), row["precision"].clone());
    let expected = [(1, "double"), (1, "single"), (2, "double"), (2, "single")];
    assert_eq!(rows.iter().map(what).collect::<Vec<_>>(), expected.map(|(t, p)| (t.into(), p.into())));
    for row in &rows {
        assert_eq!((&row["problem"], &row["path"]), (&"block3d".into(), &"lattice".into()));
        assert_eq!(row["points"], 1728);
        for key in [
            "bonds",
            "setup_seconds",
            "setup_steps",
            "ns_per_bond",
            "best_ns_per_bond",
            "bond_updates_per_second",
            "points_per_second",
            "bytes_per_point",
            "gigabytes_per_second",
            "gigaflops",
        ] {
            assert!(row[key].as_f64().is_some_and(|x| x > 0.0), "{key} in {row:#}");
        }
        assert!(row["best_ns_per_bond"].as_f64() <= row["ns_per_bond"].as_f64());
        for key in ["fraction_of_peak_flops", "fraction_of_bandwidth"] {
            // Above one only where a small body stays in the cache, or where the machine was disturbed in between.
            assert!(row[key].as_f64().is_some_and(|x| 0.0 < x && x < 1.5), "{key} in {row:#}");
        }
    }
}

#[test]
fn bonds_break_in_the_problems_that_say_so_and_in_no_others() {
    let place = Place::new("bench_breaking");
    for row in benchmark(&place, &["--steps", "10"]) {
        let broken = row["broken_pairs"].as_u64().unwrap();
        let says_so = row["problem"].as_str().unwrap().ends_with("-breaking");
        assert_eq!(broken > 0, says_so, "{row:#}");
        assert!(broken < row["bonds"].as_u64().unwrap() / 20, "{row:#}");
    }
}

#[test]
fn a_benchmark_of_no_problem_is_a_matter_of_usage() {
    let place = Place::new("bench_unknown");
    let (code, out, error) = place.call(&["bench", "block4d"]);
    assert_eq!((code, out.as_str()), (2, ""));
    assert!(error.contains("'block4d'") && error.contains("block3d-breaking") && error.contains("--help"), "{error}");
    assert_eq!(place.call(&["bench", "block3d", "--precision", "half"]).0, 2);
    assert_eq!(place.call(&["bench", "block3d", "--size", "2"]).0, 2);
}

/// What is odd is said and done all the same; what is not, is not.
#[test]
fn odd_things_are_said_and_the_case_is_taken() {
    let place = Place::new("odd");
    let law = "physics.elasticity.law.bond_based";
    let young = |value: &str| format!("{law}.young={value}");
    let density = |value: &str| format!("{law}.density={value}");
    let cracks = |list: &str| format!("geometry.cracks=[{list}]");
    let large = || vec!["geometry.shape.rectangle.size=[4e4, 2e4]".to_string(), "geometry.spacing=1e3".into()];
    let none = "case.units=none".to_string();
    let with = |mut list: Vec<String>, more: &str| {
        list.push(more.into());
        list
    };
    let table: Vec<(Vec<String>, &[&str])> = vec![
        (vec![], &[]),
        (
            vec![young("72")],
            &["bond_based.young: found 72", "50 to 20,000", "did you mean `young = \"72 GPa\"`?", "units = \"none\""],
        ),
        (vec![density("2.44")], &["waves of 1.7", "did you mean `density = \"2.44 g/cm^3\"`?"]),
        (
            vec![young("72e3"), density("2.44e-9")],
            &["`young = \"72000 MPa\"` and `density = \"0.00000000244 Mg/mm^3\"`"],
        ),
        (vec![young("500"), density("0.1")], &["softer than any solid"]),
        (vec![young("1"), density("1"), none.clone()], &[]),
        (large(), &["the body is 4.0000e4 m long", "in mm it would be 40.0000 m", "cuts no bond"]),
        (with(with(large(), "geometry.cracks=[]"), &none), &[]),
        (
            vec![cracks("{ segment = { from = [-20, 0], to = [-5, 0] } }")],
            &["cracks[0]: ", "this pre-crack cuts no bond"],
        ),
        (
            vec![cracks("{ segment = { from = [-0.02, 5e-4], to = [-0.005, 5e-4] } }")],
            &["15 points lie on this pre-crack, the first at (-0.0195, 0.0005) m", "half a spacing"],
        ),
        (
            vec![cracks("{ segment = { from = [-0.03, 0], to = [0.03, 0] } }")],
            &["in 2 parts without a bond between them: 400 points, 400 points", "pass through each other"],
        ),
        (vec!["discretization.scheme={ hybrid = {} }".into()], &["of the points sum their bonds from the start"]),
        (
            vec!["solver.velocity_verlet.end_time=1 s".into(), "output=[]".into()],
            &["e6 steps of", "on this machine", "quasi_static"],
        ),
    ];
    for (sets, expected) in table {
        let mut args = vec!["check", "case.toml"];
        sets.iter().for_each(|set| args.extend(["--set", set]));
        let (code, _, error) = place.call(&args);
        assert_eq!(code, 0, "{sets:?}: {error}");
        assert!(!expected.is_empty() || !error.contains("warning"), "{sets:?}: {error}");
        for part in expected {
            assert!(error.contains(part), "{sets:?}: {part}\n{error}");
        }
    }
}

/// What is blamed for an imbalance of energy is something that the run has.
#[test]
fn an_imbalance_of_energy_is_blamed_on_what_the_run_has() {
    let place = Place::new("imbalance");
    let set = |k: usize, v: f64| format!("conditions.{k}.prescribe.velocity.value={v}");
    let [up, down] = [set(0, 300.0), set(1, -300.0)];
    let sets = [&*up, &down, "solver.velocity_verlet.safety=1.0", "output=[]"];
    let args = sets.iter().flat_map(|set| ["--set", set]);
    let args: Vec<&str> = ["run", "case.toml", "--out", "results", "--quiet"].into_iter().chain(args).collect();
    let (code, _, error) = place.call(&args);
    assert_eq!(code, 0, "{error}");
    for part in ["energy balance is off", "possible cause: the step is 98 % of the stable one", "bonds that break"] {
        assert!(error.contains(part), "{part}: {error}");
    }
    for part in ["loads", "damping", "rows", "cells"] {
        assert!(!error.contains(part), "{part}: {error}");
    }
}
