//! The house keeps its order: who imports whom, and what every case and study must have.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules by level; a module may import its own and lower levels only (see ARCHITECTURE.md).
const LEVELS: [&[&str]; 10] = [
    &["field", "lane", "expression", "parallel", "unknown", "visit"],
    &["geometry"],
    &["family", "refinement"],
    &["discretization"],
    &["execution", "conditions"],
    &["physics", "solver"],
    &["problem"],
    &["output"],
    &["simulation"],
    &["case"],
];

/// Imports that the levels would allow and the table forbids.
const FORBIDDEN: [(&str, &str); 3] = [("physics", "conditions"), ("conditions", "execution"), ("solver", "physics")];

fn level(module: &str) -> Option<usize> {
    LEVELS.iter().position(|modules| modules.contains(&module))
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found
}

/// The code of a file without its comments and the tests at its foot.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
    text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// The module of the library that a file belongs to.
fn module(path: &Path) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let first = path.strip_prefix(root).unwrap().components().next().unwrap();
    Path::new(first.as_os_str()).file_stem().unwrap().to_string_lossy().into_owned()
}

fn library() -> Vec<PathBuf> {
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"))
}

#[test]
fn a_module_imports_lower_levels_only() {
    let mut wrong = Vec::new();
    for path in library() {
        let from = module(&path);
        let Some(own) = level(&from) else {
            assert!(["lib", "error"].contains(&from.as_str()), "{from} has no level");
            continue;
        };
        for part in code(&path).split("crate::").skip(1) {
            let to: String = part.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            let Some(other) = level(&to) else { continue };
            if other > own || FORBIDDEN.contains(&(from.as_str(), to.as_str())) {
                wrong.push(format!("{}: {from} imports {to}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn only_execution_is_unsafe_and_only_the_program_prints() {
    for path in library() {
        let (from, code) = (module(&path), code(&path));
        assert!(from == "execution" || !code.contains("unsafe "), "unsafe code in {}", path.display());
        for word in ["println!(", "print!(", "eprintln!(", "dbg!("] {
            assert!(!code.contains(word), "{word} in {}", path.display());
        }
    }
}

#[test]
fn fused_operations_belong_to_lanes_and_no_parallel_float_sum() {
    // Outside the loops over packs a fused operation is a call of a function, or other bits on another machine.
    let lanes = ["lane", "execution", "physics", "family"];
    for path in library() {
        let code = code(&path);
        assert!(!code.contains(".mul_add(") || lanes.contains(&&*module(&path)), "{}", path.display());
        let parallel_sum = code.contains("par_iter") && code.contains(".sum::<f64>()");
        assert!(module(&path) != "execution" || !parallel_sum, "{}", path.display());
    }
}

#[test]
fn packages_beside_the_library_know_nothing_of_it_and_are_safe_and_silent() {
    for package in ["linear", "picture"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(package);
        let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let (_, dependencies) = manifest.split_once("dependencies]").unwrap();
        assert!(!dependencies.contains("bondwise"), "{package} depends on a package of the workspace");
        // Comments too: examples in them are compiled.
        for path in sources(&folder.join("src")) {
            let text = fs::read_to_string(&path).unwrap().to_lowercase();
            for word in ["bondwise::", "peridynamic"] {
                assert!(!text.contains(word), "{word} in {}", path.display());
            }
            for word in ["unsafe ", "println!(", "print!(", "eprintln!(", "dbg!("] {
                assert!(!code(&path).contains(word), "{word} in {}", path.display());
            }
        }
    }
}

#[test]
fn every_case_explains_itself_and_is_bundled() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases");
    for entry in fs::read_dir(cases).unwrap() {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        for file in ["case.toml", "README.md"] {
            assert!(folder.join(file).is_file(), "{name} has no {file}");
        }
        let bundled = bondwise::case::bundled::CASES.iter().any(|case| case.name == name);
        assert!(bundled, "{name} is not in src/case/bundled.rs");
    }
}
