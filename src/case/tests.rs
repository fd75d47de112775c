//! Every mistake a case can have is said where it is, in words, and all at once.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::Instant;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use super::diagnostics::Place;
use super::read::{Located, read_file, read_text, schema_of};

/// A number or a formula.
#[derive(Debug, PartialEq, Deserialize, Serialize)]
#[serde(untagged)]
enum Formula {
    Number(f64),
    Text(String),
}

impl JsonSchema for Formula {
    fn schema_name() -> Cow<'static, str> {
        "Formula".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["number", "string"] })
    }
}

#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Case {
    title: Option<String>,
    material: Material,
    #[serde(default)]
    bodies: BTreeMap<String, Body>,
    time: Time,
    #[serde(default)]
    conditions: Vec<Condition>,
}

#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Material {
    /// Young's modulus.
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0.0))]
    young: f64,
    #[schemars(extend("x-unit" = "kg/m^3", "exclusiveMinimum" = 0.0))]
    density: Option<f64>,
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    horizon: Option<f64>,
    #[schemars(range(min = -1.0, max = 0.5))]
    poisson: Option<f64>,
    #[serde(default)]
    influence: Influence,
    law: Option<Law>,
}

#[derive(Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Influence {
    #[default]
    Constant,
    /// Falls linearly.
    Linear,
    Gaussian {
        #[schemars(extend("x-unit" = "m"))]
        width: f64,
    },
}

#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Law {
    BondBased(BondBased),
}

#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BondBased {
    #[schemars(extend("x-unit" = "J/m^2"))]
    fracture_energy: f64,
}

#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Body {
    #[schemars(extend("x-unit" = "m"))]
    size: [f64; 3],
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"), length(max = 2))]
    cracks: Vec<[f64; 2]>,
}

#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Time {
    #[schemars(range(min = 1))]
    steps: usize,
    step: Option<Step>,
    #[serde(default)]
    restart: bool,
}

#[derive(Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
enum Step {
    Automatic(Automatic),
    Fixed(#[schemars(extend("x-unit" = "s"))] f64),
}

#[derive(Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Automatic {
    Automatic,
}

#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Condition {
    on: String,
    #[schemars(extend("x-unit" = "m", "x-expression" = ["x", "y", "z", "t"]))]
    value: Formula,
    #[schemars(extend("x-unit" = "m/s", "x-expression" = ["x", "y", "z", "t"]))]
    velocity: Option<[Formula; 2]>,
}

const GOOD: &str = r#"title = "plate"
[constants]
delta = "3*h"
h = "0.5 mm"
[material]
young = "72 GPa"
density = 2440
horizon = "delta"
poisson = "1/4"
influence = { gaussian = { width = "delta/2" } }
[material.law.bond_based]
fracture_energy = "135 J/m^2"
[bodies.plate]
size = ["100 mm", "80*h", 1e-3]
cracks = [[0, "1 in"]]
[time]
steps = 1e3
step = "90 us"
[[conditions]]
on = "left"
value = "0.5 mm"
[[conditions]]
on = "right"
value = "h*sin(2*pi*t)"
velocity = ["1 km/h", 2]
"#;

fn read(text: &str) -> Result<Located<Case>, String> {
    set(text, &[])
}

fn set(text: &str, overrides: &[(&str, &str)]) -> Result<Located<Case>, String> {
    let own = |(path, value): &(&str, &str)| ((*path).to_owned(), (*value).to_owned());
    let overrides: Vec<_> = overrides.iter().map(own).collect();
    read_text("case.toml", text, &overrides).map_err(|e| e.to_string())
}

/// The good case with one line replaced.
fn with(old: &str, new: &str) -> String {
    assert!(GOOD.contains(old), "{old}");
    GOOD.replacen(old, new, 1)
}

#[test]
fn a_good_case_is_read_in_si() {
    let case = read(GOOD).unwrap();
    assert_eq!(case.constants, [("h".to_owned(), 0.5e-3), ("delta".to_owned(), 1.5e-3)]);
    let Case { material, bodies, time, conditions, .. } = case.value;
    assert_eq!(material.young, 72e9);
    assert_eq!(material.density, Some(2440.0));
    assert_eq!(material.horizon, Some(1.5e-3));
    assert_eq!(material.poisson, Some(0.25));
    assert_eq!(material.influence, Influence::Gaussian { width: 0.75e-3 });
    assert_eq!(bodies["plate"].size, [0.1, 0.04, 1e-3]);
    assert_eq!(bodies["plate"].cracks, [[0.0, 0.0254]]);
    assert_eq!(time.steps, 1000);
    assert_eq!(time.step, Some(Step::Fixed(90e-6)));
    assert_eq!(conditions[0].value, Formula::Number(0.5e-3));
    assert_eq!(conditions[1].value, Formula::Text("h*sin(2*pi*t)".into()));
    let velocity = conditions[1].velocity.as_ref().unwrap();
    assert_eq!(*velocity, [Formula::Number(1.0 / 3.6), Formula::Number(2.0)]);
}

#[test]
fn a_byte_order_mark_and_dos_line_ends_are_accepted() {
    let text = format!("\u{FEFF}{}", GOOD.replace('\n', "\r\n"));
    read(&text).unwrap();
    let error = read(&text.replace("young =", "youngs =")).unwrap_err();
    assert!(error.starts_with("case.toml:6:1: error: material.youngs"));
}

#[test]
fn each_mistake_is_said_where_it_is() {
    let young = "young = \"72 GPa\"";
    let table: &[(&str, &str, &[&str])] = &[
        // Keys.
        (
            young,
            "youngs = 1e9",
            &[
                "case.toml:6:1: error: material.youngs: unknown key `youngs`\n    allowed: young, density, horizon, ",
                "help: did you mean `young`?",
                "\n1 mistake in case.toml; nothing was run",
            ],
        ),
        (
            young,
            "",
            &[
                "case.toml:5:1: error: material.young: missing key `young`",
                "help: add `young = <number, Pa>`: Young's modulus",
            ],
        ),
        (
            "[time]\nsteps = 1e3",
            "[tim]\nsteps = 1e3",
            &["case.toml:16:2: error: tim: unknown key `tim`", "did you mean `time`?"],
        ),
        (
            "{ gaussian = { width = \"delta/2\" } }",
            "{ gaussian = { } }",
            &["case.toml:10:26: error: material.influence.gaussian.width: missing key `width`", "<number, m>"],
        ),
        // Units.
        (
            young,
            "young = \"210 GPA\"",
            &[
                "case.toml:6:9: error: material.young: found \"210 GPA\"\n    unknown unit `GPA`; allowed: a pressure in Pa, kPa, MPa, GPa, psi, bar, above 0\n    help: did you mean `GPa`?",
            ],
        ),
        (
            "\"0.5 mm\"\n[[",
            "\"3 furlong\"\n[[",
            &["conditions[0].value: found \"3 furlong\"\n    unknown unit `furlong`; allowed: a length in m, mm,"],
        ),
        (young, "young = \"3 mm\"", &["this is a length where a pressure is wanted"]),
        ("\"1/4\"", "\"1 m\"", &["this is a length where a plain number is wanted"]),
        (young, "young = \"3 h\"", &["this is a time where"]),
        (young, "young = \"3 delta\"", &["an operator is missing", "help: write `3*delta`"]),
        // Kinds of values.
        (
            young,
            "young = true",
            &[
                "6:9: error: material.young: found true\n    must be a number with a unit of pressure (Pa) above 0, e.g. 2.5 or \"2.5 kPa\"",
            ],
        ),
        (young, "young = [1, 2]", &["found [1, 2]\n    must be a number"]),
        (young, "young = 1979-05-27", &["found 1979-05-27\n    must be a number"]),
        ("steps = 1e3", "steps = \"many\"", &["found \"many\"\n    must be a whole number 1 or more"]),
        ("steps = 1e3", "steps = 1.5", &["found 1.5\n    must be a whole number; allowed: 1 or more"]),
        ("step = \"90 us\"", "restart = 1", &["found 1\n    must be true or false"]),
        ("title = \"plate\"", "title = 5", &["1:9: error: title: found 5\n    must be a text in quotes"]),
        ("[bodies.plate]", "[[bodies]]", &["must be a table"]),
        ("step = \"90 us\"", "step = true", &["must be \"automatic\", or a number with a unit of time (s)"]),
        (
            "step = \"90 us\"",
            "step = \"automatik\"",
            &["18:8: error: time.step: found \"automatik\"", "help: did you mean `automatic`?"],
        ),
        ("step = \"90 us\"", "step = \"90 uss\"", &["unknown unit `uss`"]),
        // Ranges.
        ("steps = 1e3", "steps = -10", &["found -10\n    must be 1 or more"]),
        ("steps = 1e3", "steps = 99999999999999999999", &["the number is too large"]),
        (young, "young = nan", &["found nan\n    must be finite and above 0"]),
        (young, "young = -inf", &["must be finite and above 0"]),
        (young, "young = 1e999", &["must be finite and above 0"]),
        (young, "young = \"-2 MPa\"", &["found \"-2 MPa\"\n    must be above 0; allowed: a pressure"]),
        ("\"1/4\"", "\"3/4\"", &["must be between -1 and 0.5"]),
        ("[[0, \"1 in\"]]", "[[0,1],[0,2],[0,3]]", &["the list must have at most 2 entries, not 3"]),
        ("[\"100 mm\",", "[", &["bodies.plate.size: found [ \"80*h\", 1e-3]\n    the list must have 3 entries, not 2"]),
        ("[[0, \"1 in\"]]", "[[0, \"1 inn\"]]", &["15:15: error: bodies.plate.cracks[0][1]", "did you mean `in`?"]),
        // Choices.
        (
            "{ gaussian = { width = \"delta/2\" } }",
            "\"linaer\"",
            &[
                "10:13: error: material.influence: found \"linaer\"\n    there is no such choice; allowed: \"constant\", \"linear\", { gaussian = ... }",
                "did you mean `linear`?",
            ],
        ),
        ("{ gaussian =", "{ gausian =", &["10:15: error", "no choice `gausian`", "did you mean `gaussian`?"]),
        (
            "{ gaussian = { width = \"delta/2\" } }",
            "\"gaussian\"",
            &["`gaussian` needs data", "write `{ gaussian = { width = ... } }`"],
        ),
        (
            "{ gaussian = { width = \"delta/2\" } }",
            "{ linear = 1 }",
            &["`linear` has no keys", "write it as the text `\"linear\"`"],
        ),
        ("{ gaussian = { width = \"delta/2\" } }", "3", &["must be one of \"constant\", \"linear\", { gaussian"]),
        // Expressions.
        ("\"h*sin(2*pi*t)\"", "\"h*sin(2*pi*T)\"", &["24:21: error: conditions[1].value", "character 12 of the text"]),
        ("\"h*sin(2*pi*t)\"", "\"2t\"", &["help: write `2*t`"]),
        ("\"h*sin(2*pi*t)\"", "\"system('rm')\"", &["24:"]),
        ("horizon = \"delta\"", "horizon = \"delt\"", &["8:12: error: material.horizon: found \"delt\"", "delta"]),
        ("horizon = \"delta\"", "horizon = \"3*x\"", &["8:14: error: material.horizon"]),
        ("horizon = \"delta\"", "horizon = \"1/0\"", &["material.horizon: found \"1/0\""]),
        // Constants.
        (
            "delta = \"3*h\"",
            "delta = \"3*a\"\na = \"delta\"",
            &["constants.delta: the constants need each other: delta -> a -> delta", "\n1 mistake"],
        ),
        ("delta = \"3*h\"", "delta = \"3*hh\"", &["3:12: error: constants.delta", "\n1 mistake"]),
        (
            "delta = \"3*h\"",
            "delta = true",
            &["constants.delta: found true\n    must be a number, a number with a unit"],
        ),
        (
            "h = \"0.5 mm\"",
            "h = \"0.5 mm\"\nx = 1\nsin = 2\n\"a b\" = 3",
            &["5:1: error: constants.x", "6:1: error: constants.sin", "constants.\"a b\": the name"],
        ),
        // Syntax.
        (young, "young = [1, 2", &["7:1: error: this is not TOML", "not closed with `]`?", "\n1 mistake"]),
        (young, "young = 1\nyoung = 2", &["7:1: error: `young` is given twice, first in line 6"]),
        ("[time]", "[material]\n[time]", &["16:2: error: `material` is given twice, first in line 5"]),
        ("title = \"plate\"", "title = \"plate\"\ntime.steps = 1", &["given twice, first in line 2"]),
        (young, "young = ", &["6:9: error: a value is missing", "\n1 mistake"]),
        ("title = \"plate\"", "title = \"plate", &["1:", "this is not TOML"]),
    ];
    for (old, new, expected) in table {
        let error = read(&with(old, new)).map(|_| ()).expect_err(new);
        for part in *expected {
            assert!(error.contains(part), "{new}: no `{part}` in\n{error}");
        }
    }
}

#[test]
fn ten_independent_mistakes_are_shown_in_the_order_of_the_file() {
    let text = r#"titel = "plate"
[constants]
h = "0.5 mmm"
[material]
young = "72 GPA"
density = 0
horizon = "2*h"
horizon = 2
poisson = nan
influence = "gauss"
[bodies.plate]
size = [1, 2]
[time]
steps = 0
[[conditions]]
value = "x +"
on = 3
"#;
    let error = read_text::<Case>("case.toml", text, &[]).unwrap_err();
    let line = |place: &Place| match place {
        Place::Text { line, .. } => *line,
        _ => 0,
    };
    let lines: Vec<_> = error.list.iter().map(|d| line(&d.place)).collect();
    assert_eq!(lines, [1, 3, 5, 6, 8, 9, 10, 12, 14, 16, 17], "{error}");
    assert!(error.to_string().ends_with("11 mistakes in case.toml; nothing was run"));
}

#[test]
fn overrides_replace_add_and_are_named_when_wrong() {
    let case = set(
        GOOD,
        &[
            ("material.young", "1 MPa"),
            ("constants.h", "1 mm"),
            ("conditions.0.value", "2*h"),
            ("conditions[1].on", "5"),
            ("material.influence", "linear"),
            ("bodies.plate.size", "[1, 2, \"3 mm\"]"),
            ("bodies.other.size", "[1, 2, 3]"),
            ("time.restart", "true"),
        ],
    )
    .unwrap();
    assert_eq!(case.value.material.young, 1e6);
    assert_eq!(case.value.material.horizon, Some(3e-3));
    assert_eq!(case.value.conditions[0].value, Formula::Text("2*h".into()));
    assert_eq!(case.value.conditions[1].on, "5");
    assert_eq!(case.value.material.influence, Influence::Linear);
    assert_eq!(case.value.bodies["plate"].size, [1.0, 2.0, 3e-3]);
    assert_eq!(case.value.bodies["other"].size, [1.0, 2.0, 3.0]);
    assert!(case.value.time.restart);
    assert_eq!(case.source.locate("material.young").to_string(), "--set material.young=1 MPa");

    let table = [
        ("material.yong", "1", "--set material.yong=1: error: material.yong: unknown key `yong`"),
        ("material.young", "1 kg", "--set material.young=1 kg: error: material.young: found 1 kg\n    this is a mass"),
        ("conditions.7.value", "1", "`conditions` is a list and has no entry `7`\n    help: its entries are 0 to 1"),
        ("time.steps.more", "1", "`time.steps` is a number in the case, not a table"),
        ("time..steps", "1", "is not a key path"),
        ("material.influence.linear", "1", "`linear` has no keys"),
        ("bodies.other.cracks", "[]", "--set bodies.other.cracks=[]: error: bodies.other.size: missing key"),
    ];
    for (path, value, expected) in table {
        let error = set(GOOD, &[(path, value)]).map(|_| ()).expect_err(path);
        assert!(error.contains(expected), "no `{expected}` in\n{error}");
    }
}

#[test]
fn a_key_path_leads_back_to_the_text() {
    let source = read(GOOD).unwrap().source;
    let at = |path: &str| source.locate(path).to_string();
    assert_eq!(at("material.young"), "case.toml:6:9");
    assert_eq!(at("material.law.bond_based.fracture_energy"), "case.toml:12:19");
    assert_eq!(at("material.law.bond_based"), "case.toml:11:1");
    assert_eq!(at("conditions[1]"), "case.toml:22:1");
    assert_eq!(at("conditions[1].velocity[1]"), "case.toml:25:23");
    // What is not written is found at the table it belongs to.
    assert_eq!(at("time.restart"), "case.toml:16:1");
    assert_eq!(source.written("material.young"), Some("\"72 GPa\""));
    let error = source.error("material.young", "too stiff").to_string();
    assert_eq!(error, "case.toml:6:9: error: material.young: found \"72 GPa\"\n    too stiff");
}

#[test]
fn an_empty_case_says_what_is_needed() {
    for text in ["", "# nothing\n\n"] {
        let error = read(text).map(|_| ()).unwrap_err();
        assert!(error.contains("nothing to run"), "{error}");
        assert!(error.contains("`material`, `time`"), "{error}");
    }
}

#[test]
fn hostile_texts_are_refused_quickly() {
    let many_keys: String = (0..100_000).map(|i| format!("a{i}=1\n")).collect();
    let table = [
        (format!("a = {}", "[".repeat(20_000)), "nested deeper than"),
        (format!("a = {}", "{a=".repeat(20_000)), "nested deeper than"),
        (format!("a{} = 1", ".a".repeat(200_000)), "nested deeper than"),
        (format!("[a{}]", ".a".repeat(200_000)), "nested deeper than"),
        (many_keys, "only 100 mistakes are shown"),
        ("a=1\n".repeat(100_000), "given twice"),
        ("]\n".repeat(100_000), "not TOML"),
        (format!("{} = 1", "a".repeat(1_000_000)), "unknown key"),
        (with("\"72 GPa\"", &format!("\"{}\"", "(".repeat(200_000))), "material.young"),
        (with("\"72 GPa\"", &format!("\"1 {}\"", "(".repeat(200_000))), "material.young"),
        (with("\"72 GPa\"", &format!("\"1 m{}\"", "(m".repeat(200_000))), "longer than 64"),
        ("a=1\n".repeat(5 << 20), "is larger than 16 MiB"),
    ];
    for (text, expected) in table {
        let start = Instant::now();
        let error = read(&text).map(|_| ()).unwrap_err();
        let shown: String = text.chars().take(20).collect();
        assert!(error.contains(expected), "{shown}: {error}");
        assert!(error.len() < 100_000, "{shown}: {} bytes", error.len());
        // 0.1 s in a release build; ten times that without optimisation.
        assert!(start.elapsed().as_secs_f64() < 1.0, "{shown}: {:?}", start.elapsed());
    }
}

#[test]
fn only_regular_files_of_utf8_are_read() {
    let folder = std::env::temp_dir().join(format!("bondwise-read-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("bad.toml");
    std::fs::write(&file, b"title = 1\nname = \"\xFF\"\n").unwrap();
    let error = |path: &std::path::Path| read_file::<Case>(path, &[], |_| Vec::new()).unwrap_err().to_string();
    let text = error(&file);
    assert!(text.contains(":2:9: error: byte 0xFF at offset 18 is not UTF-8"), "{text}");
    assert!(error(&folder).contains("is not a regular file"));
    assert!(error(&folder.join("none")).contains("there is no such file"));
    std::fs::write(&file, GOOD).unwrap();
    assert!(read_file::<Case>(&file, &[], |_| Vec::new()).is_ok());
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn the_schema_for_editors_allows_texts_for_numbers_and_constants() {
    let schema = schema_of::<Case>();
    let at = |pointer: &str| schema.pointer(pointer).cloned().unwrap_or_default();
    let both = serde_json::json!(["number", "string"]);
    assert_eq!(at("/$defs/Material/properties/young/type"), both);
    assert_eq!(at("/$defs/Body/properties/size/items/type"), both);
    assert_eq!(at("/properties/constants/additionalProperties/type"), both);
    assert!(at("/$schema").is_string());
}
