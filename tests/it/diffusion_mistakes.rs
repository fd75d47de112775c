//! What a case of diffusion with a mistake is told, and where; and what a case of elasticity is told that asks for diffusion.

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;

use super::diffusion_cases::{Parts, from_text};

fn refusal(text: &str) -> String {
    match read_text::<Case>("case.toml", text, &[]) {
        Err(mistakes) => mistakes.to_string(),
        Ok(case) => build(&case, &Options::default()).map(|_| ()).expect_err(text).to_string(),
    }
}

/// Rows with waves that grow, by the symbol and by power iteration.
const GROWS: &str = "scheme = { collocation = { order = 4, points = 49 } }";

/// What is changed in a sound case, and what is said about it.
#[test]
fn mistakes_are_answered_where_they_are() {
    let conditions = r#"
[sets]
layer = { where = "max(abs(x), abs(y)) > 0.3" }
[[conditions]]
on = "all"
load = { source = { value = "x + t" } }
[[conditions]]
on = "layer"
prescribe = { concentration = { value = 1.0 } }
"#;
    let good = Parts { conditions: conditions.into(), solver: "end_time = 0.01".into(), ..Parts::new(2, 0.05) }.text();
    let elastic = good
        .replace(
            "[physics.diffusion]\ndiffusivity = 1.0",
            "[physics.elasticity]\nlaw = { bond_based = { young = 1e9, density = 1e3 } }",
        )
        .replace("load = { source = { value = \"x + t\" } }", "load = { body_force = { component = 0, value = 1.0 } }")
        .replace("concentration = { value", "displacement = { component = 0, value")
        .replace("forward_euler", "velocity_verlet");
    for sound in [&good, &elastic] {
        from_text(sound);
    }
    let line = "[physics.diffusion]\ndiffusivity = 1.0";
    let source = "source = { value = \"x + t\" }";
    let held = "concentration = { value = 1.0 }";
    let solver = "[solver.forward_euler]";
    let ratio = "horizon_ratio = 3";
    let rows = "horizon_ratio = 3\nscheme = { collocation = { order = 2 } }";
    let output = |output: &str| format!("[[output]]\n{output}\n[solver.forward_euler]");
    type Table<'a> = Vec<(&'a str, String, &'a [&'a str])>;
    let table: Table = vec![
        (line, "[physics]".into(), &["error: physics: neither `elasticity` nor `diffusion` is given; one must be"]),
        (
            line,
            format!("{line}\n[physics.elasticity]\nlaw = {{ bond_based = {{ young = 1.0, density = 1.0 }} }}"),
            &["error: physics.diffusion: `elasticity` and `diffusion` are both given; only one may be"],
        ),
        (line, "[physics.diffusion]".into(), &["error: physics.diffusion: missing key `diffusivity`", "<number, m^2/s>"]),
        (line, "[physics.diffusion]\ndiffusivity = 0".into(), &["physics.diffusion.diffusivity: found 0", "above 0"]),
        (
            line,
            "[physics.diffusion]\ndiffusivity = \"1 m/s\"".into(),
            &["this is a velocity where a diffusivity is wanted"],
        ),
        (line, format!("{line}\nexponent = 4"), &["physics.diffusion.exponent: found 4", "between 0 and 3"]),
        (ratio, format!("{ratio}\nprecision = \"single\""), &["discretization.precision: found \"single\"", "double"]),
        (ratio, format!("{ratio}\nsurface_correction = \"energy\""), &["discretization.surface_correction: found \"energy\""]),
        (ratio, format!("{ratio}\nscheme = {{ hybrid = {{}} }}"), &["discretization.scheme: ", "is for elasticity", "collocation"]),
        (
            ratio,
            format!("{ratio}\nscheme = {{ collocation = {{ order = 3 }} }}"),
            &["discretization.scheme.collocation.order: found 3\n    the order of collocation is even"],
        ),
        (
            ratio,
            format!("horizon_ratio = 4\n{GROWS}"),
            &["discretization.scheme.collocation: ", "would grow in time: an eigenvalue of +32.08 K/δ²", "`standard`"],
        ),
        (
            "\n\n\n[discretization]\nhorizon_ratio = 3",
            format!("\nperturb = {{ amplitude = 0.05 }}\n[discretization]\nhorizon_ratio = 4\n{GROWS}"),
            &["discretization.scheme.collocation: ", "rows of these points would grow in time", "t = 0.01 s bears 2.303e2 1/s"],
        ),
        (
            "[discretization]\nhorizon_ratio = 3",
            format!("cracks = [{{ segment = {{ from = [0, 0], to = [0.1, 0] }} }}]\n[discretization]\n{rows}"),
            &["geometry.cracks: ", "no bonds that a pre-crack could cut"],
        ),
        (
            held,
            "concentration = { value = 1.0 } }\nuntil = 0.005\n[[conditions]]\non = \"all\"\ninitial = { concentration = { value = 1.0 }".into(),
            &[],
        ),
        (
            solver,
            format!("[refinement]\nlevels = 1\nzones = [{{ region = {{ where = \"x > 0\" }}, level = 1 }}]\n{solver}"),
            &["error: refinement: cells are refined in elasticity only"],
        ),
        (solver, "[solver.velocity_verlet]".into(), &["solver.velocity_verlet: ", "use `solver.forward_euler`"]),
        (solver, format!("{solver}\nsafety = 0.5\ntime_step = 1e-9"), &["`safety` and `time_step` are both given"]),
        (
            solver,
            format!("{solver}\ntime_step = 0.01"),
            &["solver.forward_euler.time_step: found 0.01", "above the stable step"],
        ),
        (source, "traction = { component = 0, value = 1.0 }".into(), &["conditions[0].load.traction: ", "`flux`"]),
        (source, "pressure = { value = 1.0 }".into(), &["conditions[0].load.pressure: ", "`source`"]),
        (source, "source = { value = \"1 Pa\" }".into(), &["conditions[0].load.source.value: found \"1 Pa\"", "a frequency"]),
        (source, "source = { value = \"log(x - 2)\" }".into(), &["conditions[0].load.source.value: ", "NaN at t = 0"]),
        (
            held,
            "displacement = { component = 0, value = 1.0 }".into(),
            &["conditions[1].prescribe.displacement: ", "write `prescribe = { concentration = { value = ... } }`"],
        ),
        (
            solver,
            output("vtu = { every_steps = 5, fields = [\"rate\", \"damage\"] }"),
            &["output[0].vtu.fields[1]: found \"damage\"", "diffusion has no field `damage`; its fields: concentration, rate"],
        ),
        (solver, output("picture = { field = \"displacement\" }"), &["output[0].picture.field: found \"displacement\""]),
        (
            solver,
            output("picture = { field = \"concentration\", component = 0 }"),
            &["output[0].picture.component: found 0"],
        ),
        (
            solver,
            output("probe = { name = \"a\", at = [0, 0], fields = [\"velocity\"], every_steps = 1 }"),
            &["output[0].probe.fields[0]: found \"velocity\""],
        ),
        (solver, output("crack_tip = { along = [1, 0] }"), &["output[0].crack_tip: nothing breaks in diffusion"]),
    ];
    for (old, new, expected) in &table {
        assert!(good.contains(old), "{old}");
        let text = good.replacen(old, new, 1);
        if expected.is_empty() {
            // The same layer is let go: sound with bonds, not with rows.
            from_text(&text);
            let error = refusal(&text.replacen(ratio, rows, 1));
            assert!(error.contains("need the whole ball"), "{error}");
            continue;
        }
        let error = refusal(&text);
        for part in *expected {
            assert!(error.contains(part), "{new}: no `{part}` in\n{error}");
        }
    }
    let of_motion: Table = vec![
        (ratio, rows.into(), &["discretization.scheme: ", "is for diffusion", "`hybrid`"]),
        ("[solver.velocity_verlet]", solver.into(), &["solver.forward_euler: ", "motion is of second order in time"]),
        (
            "prescribe = { displacement = { component = 0, value = 1.0 } }",
            format!("prescribe = {{ {held} }}"),
            &["conditions[1].prescribe.concentration: ", "an elastic body has no concentration"],
        ),
        (
            "body_force = { component = 0, value = 1.0 }",
            source.into(),
            &["conditions[0].load.source: ", "`body_force`"],
        ),
        (
            "[solver.velocity_verlet]",
            "[[output]]\npicture = { field = \"concentration\" }\n[solver.velocity_verlet]".into(),
            &["elasticity has no field `concentration`; its fields: displacement, velocity"],
        ),
    ];
    for (old, new, expected) in &of_motion {
        assert!(elastic.contains(old), "{old}");
        let error = refusal(&elastic.replacen(old, new, 1));
        for part in *expected {
            assert!(error.contains(part), "{new}: no `{part}` in\n{error}");
        }
    }
    // In 1D the integral of ω/|ξ|³ times a square diverges at the source unless ω vanishes there.
    for (influence, fits) in [("constant", false), ("linear", false), ("inverted", true)] {
        let discretization = format!("horizon_ratio = 3\ninfluence = \"{influence}\"").leak();
        let diffusion = "diffusivity = 1.0\nexponent = 3";
        let text = Parts { discretization, diffusion, solver: "end_time = 0.01".into(), ..Parts::new(1, 0.02) }.text();
        if fits {
            from_text(&text);
        } else {
            let error = refusal(&text);
            let part = "physics.diffusion.exponent: found 3";
            assert!(error.contains(part) && error.contains("no integral over squares in 1D"), "{error}");
        }
    }
}
