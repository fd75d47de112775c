//! What the program says about mistakes: each entry of the table is one mistake in a copy of
//! `tests/mistakes/good.toml`, and the message is the text of `tests/mistakes/<name>.txt`, to the letter.
//!
//! `BLESS=1 cargo test --test mistakes` writes the texts anew; read them before they are committed.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// No refusal takes longer than this, whatever the file; most take a hundredth of it.
const LONGEST: Duration = Duration::from_secs(20);

/// A bar, whose force has a moment.
const BAR: &str = r#"[case]
title = "Bar"
dimension = 1
[geometry]
shape = { segment = { low = 0.0, high = 0.02 } }
spacing = 1e-3
[discretization]
horizon_ratio = 3
[physics.elasticity]
law = { bond_based = { young = 72e9, density = 2440.0 } }
[solver.velocity_verlet]
end_time = 1e-6
[[output]]
force = { name = "a", on = "all", about = [0.0], every_steps = 10 }
"#;

/// Words of the program's own language, which a user does not speak.
const JARGON: [&str; 12] =
    ["f64", "f32", "u64", "u32", "i64", "usize", "struct", "variant", "enum", "serde", "panicked", "unwrap"];

/// One mistake: the case it is made in, the files beside it, how the program is called, how it answers.
struct Mistake {
    name: &'static str,
    case: Vec<u8>,
    beside: Option<(&'static str, Vec<u8>)>,
    command: &'static str,
    target: &'static str,
    args: Vec<&'static str>,
    exit: i32,
    prepare: fn(&Path),
}

impl Mistake {
    /// The whole case is given.
    fn whole(name: &'static str, case: impl Into<Vec<u8>>) -> Self {
        Mistake {
            name,
            case: case.into(),
            beside: None,
            command: "run",
            target: "case.toml",
            args: Vec::new(),
            exit: 3,
            prepare: |_| (),
        }
    }

    /// Parts of the good case are replaced.
    fn patch(name: &'static str, changes: &[(&str, &str)]) -> Self {
        Mistake::whole(name, changed(good(), name, changes))
    }

    /// A case whose points come from this table.
    fn table(name: &'static str, table: impl Into<Vec<u8>>) -> Self {
        Mistake { beside: Some(("points.csv", table.into())), ..Mistake::whole(name, CLOUD) }
    }

    /// The good case is called with these arguments.
    fn called(name: &'static str, args: &[&'static str]) -> Self {
        Mistake::patch(name, &[]).with(args)
    }

    fn with(self, args: &[&'static str]) -> Self {
        Mistake { args: args.to_vec(), ..self }
    }

    /// Another file than the case is given.
    fn target(self, target: &'static str) -> Self {
        Mistake { target, ..self }
    }

    fn exits(self, exit: i32) -> Self {
        Mistake { exit, ..self }
    }

    /// The folder is changed before the program is called.
    fn prepare(self, prepare: fn(&Path)) -> Self {
        Mistake { prepare, ..self }
    }
}

const SHAPE: &str = "shape = { rectangle = { size = [\"20 mm\", \"10 mm\"] } }\nspacing = \"h\"";
const POINTS: &str = "points = { csv = { file = \"points.csv\" } }";
const CRACKS: &str = "cracks = [{ segment = { from = [\"-1 cm\", 0.0], to = [\"-5 mm\", 0.0] } }]";
const YOUNG: &str = "young = \"72 GPa\"";
const SOLVER: &str = "[solver.velocity_verlet]\nend_time = \"5 us\"\nsafety = 0.8\n";
const SAFETY: &str = "safety = 0.8";
const VALUE: &str = "value = \"1 MPa\"";
const PROBE: &str = "probe = { name = \"tip\", at = [\"-5 mm\", 0.0], every_steps = 5 }";
const TOP: &str = "top = { where = \"y > 5*h - h\" }";

/// The good case in three dimensions.
const SOLID: [(&str, &str); 5] = [
    ("dimension = 2", "dimension = 3"),
    ("rectangle = { size = [\"20 mm\", \"10 mm\"]", "block = { size = [\"20 mm\", \"10 mm\", \"6 mm\"]"),
    (CRACKS, ""),
    (", plane = \"stress\"", ""),
    ("at = [\"-5 mm\", 0.0]", "at = [\"-5 mm\", 0.0, 0.0]"),
];

/// The good case of two materials.
const TWO: [(&str, &str); 4] = [
    ("[sets]", "[sets]\nleft = { where = \"x < 0\" }\nright = { where = \"x > 0\" }"),
    (
        "[physics.elasticity]",
        "[materials.glass]\nmaterial = \"soda-lime glass\"\n\n[materials.steel]\nyoung = \"190 GPa\"\n\
         density = \"8000 kg/m^3\"\nfracture_energy = \"20 kJ/m^2\"\n\n[physics.elasticity]\n\
         materials = { glass = \"left\", steel = \"right\" }\n\
         interfaces = [{ between = [\"glass\", \"steel\"], fracture_energy = \"1 J/m^2\" }]",
    ),
    ("young = \"72 GPa\", density = \"2440 kg/m^3\", ", ""),
    ("fracture_energy = \"3.8 J/m^2\", ", ""),
];

fn mistakes() -> Vec<Mistake> {
    let patch = |name, old, new| Mistake::patch(name, &[(old, new)]);
    let load = |name, value: &str| Mistake::patch(name, &[(VALUE, &format!("value = {value}"))]);
    let solid = |name, more: &[(&str, &str)]| Mistake::patch(name, &[&SOLID, more].concat());
    let two = |name, old, new| Mistake::patch(name, &[&TWO[..], &[(old, new)]].concat());
    let mut list = vec![
        // Keys and tables.
        patch("unknown_key", "young =", "youngs ="),
        patch("unknown_table", "[solver.", "[solvr."),
        patch("unknown_key_far", "[discretization]", "[discretization]\nmeshless = true"),
        patch("unknown_output", "vtu = {", "vtk = {"),
        patch("unknown_correction", "[discretization]", "[discretization]\nsurface_correction = \"energie\""),
        patch(
            "correction_of_moving_cells",
            "[discretization]",
            "[refinement]\nlevels = 1\nrefine_where = \"damage > 0\"\n\n[discretization]\nsurface_correction = \"energy\"",
        ),
        patch(
            "correction_by_volume_of_zones",
            "[discretization]",
            "[refinement]\nlevels = 1\nzones = [{ region = { where = \"x > 0\" }, level = 1 }]\n\n[discretization]\n\
             surface_correction = \"volume\"",
        ),
        patch("unknown_law", "bond_based = {", "bond_base = {"),
        patch("unknown_influence", "\"constant\"", "\"gausian\""),
        patch("influence_without_data", "\"constant\"", "\"gaussian\""),
        patch("missing_key", "end_time = \"5 us\"\n", ""),
        patch("missing_table", SOLVER, ""),
        patch("unknown_solver", "solver.velocity_verlet", "solver.velocty_verlet"),
        patch(
            "unknown_solver_in_chain",
            SOLVER,
            "[[solver]]\nnewton = {}\n[[solver]]\nrunge_cutta = { end_time = 2.0 }\n",
        ),
        patch(
            "chain_that_goes_back",
            SOLVER,
            "[[solver]]\nnewton = { end_time = \"5 us\" }\n[[solver]]\nvelocity_verlet = { end_time = \"5 us\" }\n",
        ),
        patch(
            "direct_with_preconditioner",
            SOLVER,
            "[solver.newton]\nlinear = \"direct\"\npreconditioner = \"jacobi\"\n",
        ),
        patch("missing_table_without_variants", "[discretization]\nhorizon = \"3*h\"\ninfluence = \"constant\"\n", ""),
        patch("duplicate_key", SAFETY, "safety = 0.8\nsafety = 0.7"),
        patch("refinement_of_nothing", "[solver.", "[refinement]\nlevels = 2\n\n[solver."),
        patch(
            "refinement_unknown_name",
            "[solver.",
            "[refinement]\nlevels = 2\nrefine_where = \"strech > 0.5\"\n\n[solver.",
        ),
        patch(
            "refinement_beyond_the_finest",
            "[solver.",
            "[refinement]\nlevels = 1\nzones = [{ region = { where = \"x > 0\" }, level = 3 }]\n\n[solver.",
        ),
        patch("hybrid_of_odd_order", "influence =", "scheme = { hybrid = { order = 3 } }\ninfluence ="),
        patch("hybrid_unknown_key", "influence =", "scheme = { hybrid = { switchat = 0.5 } }\ninfluence ="),
        patch("hybrid_undefined_set", "influence =", "scheme = { hybrid = { standard = [\"grip\"] } }\ninfluence ="),
        patch(
            "hybrid_that_would_grow",
            "horizon = \"3*h\"\n",
            "horizon = \"4*h\"\nscheme = { hybrid = { order = 4, points = 49 } }\n",
        ),
        Mistake::patch(
            "hybrid_of_scattered_points_at_rest",
            &[
                ("spacing = \"h\"\n", "spacing = \"h\"\nperturb = { amplitude = 0.1 }\n"),
                ("influence =", "scheme = { hybrid = {} }\ninfluence ="),
                (SOLVER, "[solver.quasi_static]\n"),
            ],
        ),
        patch("unknown_control", SOLVER, "[solver.quasi_static]\ncontrol = \"loads\"\n"),
        patch("share_beyond_one", SOLVER, "[solver.quasi_static]\nbreak = { share = 1.5 }\n"),
        patch(
            "share_of_no_excess",
            SOLVER,
            "[solver.quasi_static]\ncontrol = \"equilibrium\"\nbreak = { share = 0.5 }\n",
        ),
        patch(
            "refinement_at_rest",
            SOLVER,
            "[refinement]\nlevels = 1\nrefine_where = \"damage > 0\"\n\n[solver.quasi_static]\n",
        ),
        Mistake::patch(
            "refinement_of_scattered_points",
            &[
                ("spacing = \"h\"\n", "spacing = \"h\"\nperturb = { amplitude = 0.1 }\n"),
                (
                    "[solver.",
                    "[refinement]\nlevels = 1\nkeep_where = \"1\"\nzones = [{ region = { where = \"x > 0\" }, level = 1 }]\n\n[solver.",
                ),
            ],
        ),
        patch("duplicate_table", "[solver.", "[discretization]\nhorizon = \"4*h\"\n\n[solver."),
        patch("dotted_key_clashes", "[sets]", "[case.title]\nshort = \"strip\"\n\n[sets]"),
        patch("list_is_table", "[[conditions]]\non = \"top\"", "[conditions]\non = \"top\""),
        patch("table_is_list", "[discretization]", "[[discretization]]"),
        // Kinds of values.
        patch("title_is_number", "title = \"Strip\"", "title = 5"),
        patch("text_without_quotes", "title = \"Strip\"", "title = Strip"),
        patch("unit_without_quotes", "end_time = \"5 us\"", "end_time = 5 us"),
        patch("text_not_closed", "title = \"Strip\"", "title = \"Strip"),
        patch("list_not_closed", "no_fail = [\"grips\"]", "no_fail = [\"grips\""),
        patch("value_missing", SAFETY, "safety ="),
        patch("steps_negative", "every_steps = 10", "every_steps = -10"),
        patch("steps_broken", "every_steps = 10", "every_steps = 2.5"),
        patch("steps_too_many", "every_steps = 10", "every_steps = 99999999999999999999"),
        patch("dimension_four", "dimension = 2", "dimension = 4"),
        patch("size_of_three", "[\"20 mm\", \"10 mm\"]", "[\"20 mm\", \"10 mm\", \"5 mm\"]"),
        // Numbers and units.
        patch("wrong_unit", YOUNG, "young = \"72 GPA\""),
        patch("unknown_unit", "spacing = \"h\"", "spacing = \"3 furlong\""),
        patch("wrong_dimension_of_unit", YOUNG, "young = \"72 mm\""),
        patch("unit_of_plain_number", SAFETY, "safety = \"0.8 m\""),
        patch("unit_alone", YOUNG, "young = \"GPa\""),
        patch("decimal_comma", "h = \"1 mm\"", "h = \"0,5 mm\""),
        patch("negative_modulus", YOUNG, "young = \"-72 GPa\""),
        patch("zero_density", "density = \"2440 kg/m^3\"", "density = 0"),
        patch("zero_spacing", "spacing = \"h\"", "spacing = \"h - h\""),
        patch("safety_above_one", SAFETY, "safety = 1.5"),
        patch("nan", YOUNG, "young = nan"),
        patch("infinite", YOUNG, "young = inf"),
        patch("infinite_negative", YOUNG, "young = -inf"),
        patch("infinite_by_size", YOUNG, "young = \"1e400 Pa\""),
        patch("poisson_plane_stress", "plane = \"stress\"", "plane = \"stress\", poisson = 0.3"),
        patch("poisson_plane_strain", "plane = \"stress\"", "plane = \"strain\", poisson = 0.3"),
        solid("poisson_solid", &[(YOUNG, "young = \"72 GPa\", poisson = 0.3")]),
        patch("poisson_of_state_based", "bond_based = { young", "state_based = { poisson = 1.0, young"),
        solid("poisson_incompressible", &[("bond_based = { young", "state_based = { poisson = 0.5, young")]),
        patch("state_based_without_poisson", "bond_based = { young", "state_based_linear = { young"),
        Mistake::patch(
            "state_based_cannot",
            &[
                ("bond_based = { young", "state_based = { poisson = 0.3, young"),
                (
                    "[discretization]",
                    "[refinement]\nlevels = 1\nzones = [{ region = { where = \"x > 0\" }, level = 1 }]\n\n\
                     [discretization]\nprecision = \"single\"\nsurface_correction = \"energy\"",
                ),
                (
                    "[solver.velocity_verlet]\nend_time = \"5 us\"\nsafety = 0.8",
                    "[solver.newton]\nend_time = 1\nlinear = \"direct\"",
                ),
            ],
        ),
        // Materials.
        two("point_of_two_materials", "left = { where = \"x < 0\" }", "left = { where = \"x < 1e-3\" }"),
        two("point_of_no_material", "left = { where = \"x < 0\" }", "left = { where = \"x < -1e-3\" }"),
        two("material_without_points", "left = { where = \"x < 0\" }", "left = { where = \"x < -1\" }"),
        two("material_of_an_unknown_set", "glass = \"left\"", "glass = \"lift\""),
        two("unknown_material", "glass = \"left\", steel", "glas = \"left\", steel"),
        two("unknown_library_material", "\"soda-lime glass\"", "\"soda lime glass\""),
        two("material_without_density", "density = \"8000 kg/m^3\"\n", ""),
        two("material_nowhere", "steel = \"right\" }", "\"all\" = \"right\" }"),
        two("material_with_a_negative_modulus", "young = \"190 GPa\"", "young = \"1e11*(x - 5e-3)\""),
        two(
            "material_with_a_wild_scatter",
            "young = \"190 GPa\"",
            "young = \"190 GPa\"\nrandom = { seed = 1, distribution = \"normal\", young = 0.9 }",
        ),
        two("material_with_two_toughnesses", "young = \"190 GPa\"", "young = \"190 GPa\"\ncritical_stretch = 0.1"),
        two("material_named_like_another_set", "[sets]", "[sets]\nsteel = { where = \"y > 0\" }"),
        two("law_with_the_values_of_materials", "bond_based = { ", "bond_based = { young = \"72 GPa\", "),
        two("interface_of_an_unknown_material", "[\"glass\", \"steel\"]", "[\"glass\", \"stel\"]"),
        two("interface_within_a_material", "[\"glass\", \"steel\"]", "[\"glass\", \"glass\"]"),
        two(
            "contradictory_interfaces",
            "interfaces = [",
            "interfaces = [{ between = [\"steel\", \"glass\"], stretch = 0.1 }, ",
        ),
        two("interface_of_two_toughnesses", "fracture_energy = \"1 J/m^2\"", "fracture_energy = 1, stretch = 0.1"),
        two("interface_that_says_nothing", ", fracture_energy = \"1 J/m^2\"", ""),
        Mistake::patch(
            "law_that_cannot_be_hybrid",
            &[
                &TWO[..],
                &[
                    ("bond_based = {", "state_based = { poisson = 0.2,"),
                    ("[discretization]", "[discretization]\nscheme = { hybrid = {} }"),
                ],
            ]
            .concat(),
        ),
        patch("law_without_values", "young = \"72 GPa\", ", ""),
        // Constants.
        patch("constants_in_a_circle", "h = \"1 mm\"", "h = \"delta/3\"\ndelta = \"3*h\""),
        patch("constant_with_a_taken_name", "h = \"1 mm\"", "h = \"1 mm\"\nt = 3"),
        // Files.
        Mistake::whole("ten_mistakes", TEN),
        // A rule across keys is asked beside a mistake of one key, about what the mistake does not touch.
        Mistake::patch("rules_beside_a_mistake", &[(YOUNG, "young = \"72 GPA\""), ("on = \"top\"", "on = \"tpo\"")]),
        Mistake::whole("not_utf8", b"# A strip.\n[case]\ntitle = \"Stri\xFFp\"\n".to_vec()),
        Mistake::whole("empty", ""),
        Mistake::whole("only_comments", "# A strip.\n\n# To be done.\n"),
        Mistake::whole("nested_lists", format!("a = {}", "[".repeat(20_000))),
        Mistake::whole("nested_tables", format!("a = {}", "{a=".repeat(20_000))),
        Mistake::whole("dotted_key", format!("a{} = 1", ".a".repeat(200_000))),
        Mistake::whole("many_keys", (0..100_000).map(|i| format!("a{i} = 1\n")).collect::<String>()),
        Mistake::whole("large_file", "# strip\n".repeat(17 << 17)),
        Mistake::whole("not_toml", "{ \"case\": { \"title\": \"Strip\", \"dimension\": 2 } }\n"),
        Mistake::called("no_such_file", &[]).target("cse.toml"),
        Mistake::called("bundled_case_not_made", &[]).target("crack_branching"),
        Mistake::called("folder_without_case", &[])
            .target("empty")
            .prepare(|at| fs::create_dir(at.join("empty")).unwrap()),
        Mistake::called("folder_as_case", &[])
            .target("a")
            .prepare(|at| fs::create_dir_all(at.join("a/case.toml")).unwrap()),
        // Geometry.
        patch(
            "initial_value_not_finite",
            "load = { traction = { component = 1, value = \"1 MPa\" } }",
            "initial = { displacement = { component = 0, value = \"1e-9*log(x)\" } }",
        ),
        patch("shape_and_points", SHAPE, &format!("{SHAPE}\n{POINTS}")),
        patch("neither_shape_nor_points", SHAPE, ""),
        patch("spacing_missing", "spacing = \"h\"", ""),
        patch("wrong_shape", "rectangle = { size = [\"20 mm\", \"10 mm\"] }", "sphere = { radius = \"5 mm\" }"),
        patch("size_negative", "[\"20 mm\", \"10 mm\"]", "[\"20 mm\", \"-10 mm\"]"),
        patch(
            "ring_inside_out",
            "rectangle = { size = [\"20 mm\", \"10 mm\"] }",
            "ring = { inner = \"5 mm\", outer = \"2 mm\" }",
        ),
        patch(
            "polygon_crosses_itself",
            "rectangle = { size = [\"20 mm\", \"10 mm\"] }",
            "polygon = { vertices = [[0, 0], [1, 1], [1, 0], [0, 1]] }",
        ),
        patch(
            "polygon_corner_of_three",
            "rectangle = { size = [\"20 mm\", \"10 mm\"] }",
            "polygon = { vertices = [[0, 0], [1, 1, 0], [1, 0]] }",
        ),
        patch(
            "no_cell_in_the_body",
            "rectangle = { size = [\"20 mm\", \"10 mm\"] }",
            "ring = { inner = \"0.4 mm\", outer = \"0.45 mm\" }",
        ),
        solid("crack_of_2d_in_3d", &[("spacing = \"h\"", &format!("spacing = \"h\"\n{CRACKS}"))]),
        patch("crack_without_length", "to = [\"-5 mm\", 0.0]", "to = [\"-1 cm\", 0.0]"),
        solid("too_many_points", &[("\"20 mm\", \"10 mm\", \"6 mm\"", "10, 10, 10")]).exits(6),
        solid("points_beyond_counting", &[("\"20 mm\", \"10 mm\", \"6 mm\"", "1e30, 1e30, 1e30")]).exits(6),
        // Sets.
        patch("undefined_set", "on = \"top\"", "on = \"topp\""),
        patch("undefined_set_far", "on = \"top\"", "on = \"roof\""),
        patch("undefined_set_of_failure", "no_fail = [\"grips\"]", "no_fail = [\"gripps\"]"),
        patch("empty_set", TOP, "top = { where = \"y > 1\" }"),
        patch("set_box_inside_out", TOP, "top = { box = { low = [0, 0.005], high = [0, 0.004] } }"),
        patch("set_box_of_three", TOP, "top = { box = { low = [0, 0, 0], high = [0, 0, 0] } }"),
        patch("set_named_all", "grips =", "all = { where = \"x > 0\" }\ngrips ="),
        patch(
            "set_in_nested_region",
            TOP,
            "top = { any = [{ where = \"y > 5*h - h\" }, { layer = { thickness = \"-1 mm\" } }] }",
        ),
        // Discretization and time.
        patch("horizon_below_spacing", "horizon = \"3*h\"", "horizon = \"h/2\""),
        patch("horizon_ratio_below_one", "horizon = \"3*h\"", "horizon_ratio = 0.5"),
        patch("horizon_of_many_spacings", "horizon = \"3*h\"", "horizon = \"200*h\""),
        patch("horizon_and_ratio", "horizon = \"3*h\"", "horizon = \"3*h\"\nhorizon_ratio = 3"),
        patch("neither_horizon_nor_ratio", "horizon = \"3*h\"\n", ""),
        patch("time_step_above_stable", SAFETY, "time_step = \"1 us\""),
        patch("constant_named_like_a_unit", "h = \"1 mm\"", "h = \"1 mm\"\nL = \"20 h\""),
        patch("time_in_a_constant", "end_time = \"5 us\"", "end_time = \"2 h\""),
        Mistake::patch(
            "damping_beyond_the_step",
            &[
                ("[solver.velocity_verlet]", "[solver.runge_kutta]"),
                (SAFETY, "time_step = \"10 ns\"\ndamping = \"1 1/ns\""),
            ],
        ),
        patch("safety_and_time_step", SAFETY, "safety = 0.8\ntime_step = \"10 ns\""),
        patch("end_time_of_ages", "end_time = \"5 us\"", "end_time = 1e12"),
        patch(
            "energy_and_stretch",
            "fracture_energy = \"3.8 J/m^2\"",
            "fracture_energy = \"3.8 J/m^2\", stretch = 0.01",
        ),
        // Conditions.
        patch("two_actions", "on = \"top\"", "on = \"top\"\ninitial = { velocity = { component = 1, value = 1 } }"),
        patch("no_action", "load = { traction = { component = 1, value = \"1 MPa\" } }\n", ""),
        patch("component_of_3d_in_2d", "component = 1, value = \"1 MPa\"", "component = 2, value = \"1 MPa\""),
        patch("component_by_name", "component = 1, value = \"1 MPa\"", "component = \"y\", value = \"1 MPa\""),
        // Outputs.
        patch("probe_outside_the_folder", "name = \"tip\"", "name = \"../../x\""),
        patch("probe_absolute", "name = \"tip\"", "name = \"/tmp/x\""),
        patch("probe_with_line_break", "name = \"tip\"", "name = \"a\\nb\""),
        patch("probe_twice", PROBE, &format!("{PROBE}\n\n[[output]]\n{}", PROBE.replace("tip", "Tip"))),
        patch("probe_of_3d_in_2d", "at = [\"-5 mm\", 0.0]", "at = [\"-5 mm\", 0.0, 0.0]"),
        Mistake::patch(
            "many_files",
            &[("end_time = \"5 us\"", "end_time = \"60 s\""), ("every_steps = 10", "every_steps = 1")],
        ),
        patch("every_and_every_steps", "every_steps = 10", "every_steps = 10, every = \"1 us\""),
        patch("unknown_field", "vtu = { every_steps = 10", "vtu = { every_steps = 10, fields = [\"stresses\"]"),
        patch("component_of_a_tensor", "vtu = { every_steps = 10 }", "picture = { field = \"stress\", component = 4 }"),
        patch("component_of_a_number", "vtu = { every_steps = 10 }", "picture = { field = \"damage\", component = 0 }"),
        patch(
            "component_beyond_tensors",
            "vtu = { every_steps = 10 }",
            "picture = { field = \"stress\", component = 6 }",
        ),
        patch(
            "force_on_undefined_set",
            "vtu = { every_steps = 10 }",
            "force = { name = \"a\", on = \"topp\", every_steps = 10 }",
        ),
        patch(
            "force_about_three",
            "vtu = { every_steps = 10 }",
            "force = { name = \"a\", on = \"top\", about = [0, 0, 0], every_steps = 10 }",
        ),
        Mistake::whole("force_about_in_1d", BAR),
        patch(
            "force_outside_the_folder",
            "vtu = { every_steps = 10 }",
            "force = { name = \"../a\", on = \"top\", every_steps = 10 }",
        ),
        patch(
            "cut_along_nothing",
            "vtu = { every_steps = 10 }",
            "cut = { name = \"a\", point = [0, 0], normal = [0, 0], every_steps = 10 }",
        ),
        patch(
            "cut_beside_the_body",
            "vtu = { every_steps = 10 }",
            "cut = { name = \"a\", point = [\"20 mm\", 0], normal = [1, 0], every_steps = 10 }",
        ),
        patch(
            "cut_of_3d_in_2d",
            "vtu = { every_steps = 10 }",
            "cut = { name = \"a\", point = [0, 0], normal = [0, 0, 1], every_steps = 10 }",
        ),
        patch(
            "cut_twice",
            "vtu = { every_steps = 10 }",
            "cut = { name = \"a\", point = [0, 0], normal = [1, 0], every_steps = 10 }\n\n[[output]]\ncut = { name = \"A\", \
             point = [0.001, 0], normal = [1, 0], every_steps = 10 }",
        ),
        patch(
            "picture_range_reversed",
            "vtu = { every_steps = 10 }",
            "picture = { field = \"damage\", range = [1.0, 0.0] }",
        ),
        patch(
            "two_histories",
            "vtu = { every_steps = 10 }",
            "history = { every_steps = 10 }\n\n[[output]]\nhistory = { every_steps = 5 }",
        ),
        patch("crack_tip_along_nothing", "vtu = { every_steps = 10 }", "crack_tip = { along = [0.0, 0.0] }"),
        // Expressions.
        load("expression_unknown_name", "\"1e6*X\""),
        load("expression_unknown_function", "\"1e6*sine(t)\""),
        load("expression_nested", &format!("\"{}\"", "(".repeat(4_000))),
        load("expression_nested_far", &format!("\"{}\"", "(".repeat(200_000))),
        load("expression_signs", &format!("\"{}t\"", "-".repeat(200_000))),
        load("expression_long", &format!("\"{}\"", "x".repeat(4_097))),
        load("expression_division_by_zero", "\"1/0\""),
        load("expression_zero_to_zero", "\"1e6*0^0\""),
        load("expression_root_on_part_of_body", "\"1e6*sqrt(x - 0.002)\""),
        load("expression_calls_system", "\"system(\\\"rm\\\")\""),
        load("expression_in_back_ticks", "\"`ls`\""),
        load("expression_imports", "\"import os\""),
        load("expression_argument_count", "\"1e6*atan2(x)\""),
        load("expression_operator_missing", "\"2x\""),
        load("expression_python_power", "\"1e6*x**2\""),
        load("expression_unit_inside", "\"1 MPa*t\""),
        load("expression_constant_like_a_unit", "\"x + 2 h\""),
        load("expression_unit_of_time_inside", "\"1e6*sin(2*pi*t/1 us)\""),
        load("expression_unit_times_constant", "\"2 MPa*h\""),
        patch("expression_unit_in_set", TOP, "top = { where = \"y > 4 mm\" }"),
        load("expression_empty", "\"\""),
        patch("expression_of_time_in_set", TOP, "top = { where = \"y > t\" }"),
        patch("expression_assigns_in_set", TOP, "top = { where = \"y = 0.005\" }"),
        // Arguments.
        Mistake::called("set_unknown_key", &["--set", "solver.velocity_verlet.savety=0.5"]),
        Mistake::called("set_wrong_value", &["--set", "geometry.spacing=2 kg"]),
        Mistake::called("set_below_a_value", &["--set", "geometry.spacing.x=2"]),
        Mistake::called("set_beyond_the_list", &["--set", "conditions.7.on=top"]),
        Mistake::called("set_without_value", &["--set", "geometry.spacing"]).exits(2),
        Mistake::called("no_threads", &["--threads", "0"]).exits(2),
        Mistake::called("unknown_option", &["--thread", "2"]).exits(2),
        // Points from a table.
        Mistake::whole("csv_missing", CLOUD),
        Mistake::table("csv_empty", ""),
        Mistake::table("csv_without_points", "x,y,volume\n"),
        Mistake::table("csv_without_header", "0.0,0.0,1e-6\n1e-3,0.0,1e-6\n"),
        Mistake::table("csv_column_missing", "x,y\n0,0\n"),
        Mistake::table("csv_column_twice", "x,y,x,volume\n0,0,0,1\n"),
        Mistake::table("csv_column_unknown", "x,y,mass,volume\n0,0,0,1\n"),
        Mistake::table("csv_semicolons", "x;y;volume\n0;0;1\n"),
        Mistake::table("csv_ragged", "x,y,volume\n0,0,1e-6\n1e-3,0\n"),
        Mistake::table("csv_text_for_number", "x,y,volume\n0,0,1e-6\n1e-3,here,1e-6\n"),
        Mistake::table("csv_decimal_comma", "x,y,volume\n0,0,1e-6\n\"0,001\",0,1e-6\n"),
        Mistake::table("csv_quote_not_closed", "x,y,volume\n0,0,1e-6\n\"1e-3,0,1e-6\n2e-3,0,1e-6\n"),
        Mistake::table("csv_not_a_number", "x,y,volume\n0,0,1e-6\nnan,0,1e-6\n"),
        Mistake::table("csv_volume_zero", "x,y,volume\n0,0,1e-6\n1e-3,0,0\n"),
        Mistake::table("csv_two_points_in_one_place", "x,y,volume\n0,0,1e-6\n1e-3,0,1e-6\n0,0,1e-6\n"),
        Mistake::table("csv_volumes_in_another_unit", "x,y,volume\n0,0,1\n1e-3,0,1\n2e-3,0,1\n"),
        Mistake::table(
            "csv_one_volume_too_large",
            "x,y,volume\n0,0,1e-6\n1e-3,0,1e-6\n# far too large\n2e-3,0,1e300\n",
        ),
        Mistake::table("csv_point_too_far", "x,y,volume\n0,0,1e-6\n1e-3,0,1e-6\n2e-3,1e300,1e-6\n"),
        Mistake::table(
            "csv_nearly_in_one_place",
            "x,y,volume\n0,0,1e-6\n1e-3,0,1e-6\n1.0000001e-3,0,1e-6\n2e-3,0,1e-6\n3e-3,0,1e-6\n",
        ),
        Mistake::table("csv_nobody_sees_anybody", "x,y,volume\n0,0,1e-6\n5e-3,0,1e-6\n10e-3,0,1e-6\n"),
        Mistake::table("csv_one_point", "x,y,volume\n0,0,1e-6\n"),
        Mistake::whole(
            "one_cell",
            CLOUD.replace(POINTS, "shape = { rectangle = { size = [\"1 mm\", \"1 mm\"] } }\nspacing = \"1 mm\""),
        ),
        Mistake {
            beside: Some(("points.csv", "x,y,volume\n0,0,1e-6\n1e-3,0,1e-6\n2e-3,0,1e-6\n9e-3,0,1e-6\n".into())),
            ..Mistake::whole(
                "csv_loaded_alone",
                CLOUD
                    .replace(
                        "initial = { velocity = { component = 0, value = \"x\" } }",
                        "load = { body_force = { component = 0, value = 1.0 } }",
                    )
                    .replace("[solver.velocity_verlet]", "[solver.dynamic_relaxation]"),
            )
        },
        Mistake::table("csv_not_utf8", b"x,y,volume\n0,0,1e-6\n1e-3,\xFF,1e-6\n"),
        Mistake::table("csv_set_undefined", "x,y,volume,sets\n0,0,1e-6,high\n0,1e-3,1e-6,low\n")
            .with(&["--set", "conditions.0.on=hihg"]),
        // Mirrors and periodic ends.
        patch("condition_without_set", "[[conditions]]\non = \"top\"\n", "[[conditions]]\n"),
        images("mirror_on_a_set", "on = \"top\"\nuntil = \"1 us\"\nmirror = { axis = \"x\", side = \"low\" }"),
        images("mirror_across_no_axis", "mirror = { axis = \"z\", side = \"low\" }"),
        images("mirror_without_side", "mirror = { axis = \"x\" }"),
        images("mirror_with_plane", "mirror = { axis = \"x\", side = \"low\", at = 0.0 }"),
        images("mirror_odd", "mirror = { axis = \"x\", side = \"low\", parity = \"odd\" }"),
        images(
            "mirror_twice",
            "mirror = { axis = \"x\", side = \"low\" }\n[[conditions]]\nmirror = { axis = \"x\", side = \"low\" }",
        ),
        images(
            "mirror_of_periodic",
            "periodic = { axis = \"x\" }\n[[conditions]]\nmirror = { axis = \"x\", side = \"low\" }",
        ),
        images("periodic_twice", "periodic = { axis = \"x\" }\n[[conditions]]\nperiodic = { axis = \"x\" }"),
        images(
            "periodic_of_refined_cells",
            "periodic = { axis = \"x\" }\n[refinement]\nlevels = 1\nzones = [{ region = { where = \"x > 0\" }, level = 1 }]",
        ),
        Mistake::patch(
            "periodic_of_corrected_surfaces",
            &[("influence =", "surface_correction = \"volume\"\ninfluence ="), ("[solver.", PERIODIC)],
        ),
        Mistake::patch("periodic_of_broken_cells", &[("h = \"1 mm\"", "h = \"0.7 mm\""), ("[solver.", PERIODIC)]),
        Mistake::patch(
            "periodic_sides_of_different_length",
            &[
                (
                    "{ rectangle = { size = [\"20 mm\", \"10 mm\"] } }",
                    "{ polygon = { vertices = [[-0.01, -0.005], [0.01, -0.005], [0.01, 0.0], [-0.01, 0.005]] } }",
                ),
                ("[solver.", PERIODIC),
            ],
        ),
        Mistake::patch(
            "periodic_shorter_than_a_family",
            &[("horizon = \"3*h\"", "horizon = \"11*h\""), ("[solver.", PERIODIC)],
        ),
        Mistake::patch(
            "mirror_nearer_than_families_reach",
            &[
                ("horizon = \"3*h\"", "horizon = \"11*h\""),
                ("[solver.", "[[conditions]]\nmirror = { axis = \"y\", side = \"low\" }\n\n[solver."),
            ],
        ),
        table_with_images("csv_mirror_without_plane", "mirror = { axis = \"x\", side = \"low\" }"),
        table_with_images("csv_points_beyond_a_mirror", "mirror = { axis = \"x\", side = \"high\", at = 0.001 }"),
        table_with_images("csv_period_below_extent", "periodic = { axis = \"x\", period = 0.002 }"),
        // Where results go.
        Mistake::called("out_is_a_file", &[]).prepare(|at| fs::write(at.join("out"), "mine").unwrap()),
        Mistake::called("out_is_not_empty", &[]).prepare(|at| {
            fs::create_dir(at.join("out")).unwrap();
            fs::write(at.join("out/notes.txt"), "mine").unwrap();
        }),
    ];
    if cfg!(unix) {
        let fifo = |at: &Path| assert!(Command::new("mkfifo").arg(at.join("pipe")).status().unwrap().success());
        list.push(Mistake::called("pipe_as_case", &[]).target("pipe").prepare(fifo));
        list.push(Mistake::called("device_as_case", &[]).target("/dev/zero"));
    }
    list
}

const PERIODIC: &str = "[[conditions]]\nperiodic = { axis = \"x\" }\n\n[solver.";

/// A condition before the solver of the good case.
fn images(name: &'static str, condition: &str) -> Mistake {
    Mistake::patch(name, &[("[solver.", &format!("[[conditions]]\n{condition}\n\n[solver."))])
}

/// Three points in a row, and a condition.
fn table_with_images(name: &'static str, condition: &str) -> Mistake {
    let table = "x,y,volume\n0,0,1e-6\n1e-3,0,1e-6\n2e-3,0,1e-6\n";
    let case = format!("{CLOUD}\n[[conditions]]\n{condition}\n");
    Mistake { beside: Some(("points.csv", table.into())), ..Mistake::whole(name, case) }
}

/// A case of points from a table.
const CLOUD: &str = r#"[case]
title = "Cloud"
dimension = 2

[geometry]
points = { csv = { file = "points.csv" } }

[discretization]
horizon_ratio = 1.5

[physics.elasticity]
law = { bond_based = { young = "72 GPa", density = "2440 kg/m^3" } }

[[conditions]]
on = "all"
initial = { velocity = { component = 0, value = "x" } }

[solver.velocity_verlet]
end_time = "1 us"
"#;

/// Ten mistakes that have nothing to do with each other, and as many remarks in the order of the file.
const TEN: &str = r#"[case]
titel = "Strip"
dimension = 5

[constants]
h = "1 mmm"

[geometry]
shape = { rectangle = { size = ["20 mm"] } }
spacing = "-1 mm"

[discretization]
horizon_ratio = "three"
influence = "conic"

[physics.elasticity]
law = { bond_based = { young = "72 GPA", density = 0 } }

[[conditions]]
on = "all"
load = { body_force = { component = 0, value = "9.81*" } }

[solver.velocity_verlet]
end_time = nan
"#;

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/mistakes").join(path)
}

fn good() -> String {
    fs::read_to_string(here("good.toml")).unwrap()
}

fn changed(mut text: String, name: &str, changes: &[(&str, &str)]) -> String {
    for (old, new) in changes {
        assert_eq!(text.matches(old).count(), 1, "{name}: `{old}` must stand once in the good case");
        text = text.replace(old, new);
    }
    text
}

/// Everything in a folder with its content, to see whether it was changed.
fn content(folder: &Path) -> BTreeSet<(PathBuf, Vec<u8>)> {
    let mut found = BTreeSet::new();
    let Ok(entries) = fs::read_dir(folder) else {
        return fs::read(folder).map(|bytes| BTreeSet::from([(folder.to_path_buf(), bytes)])).unwrap_or_default();
    };
    for entry in entries {
        let path = entry.unwrap().path();
        found.insert((path.clone(), Vec::new()));
        found.extend(content(&path));
    }
    found
}

/// Exit code, standard output and standard error; a program that hangs is ended.
fn call(folder: &Path, mistake: &Mistake) -> (Option<i32>, String, String) {
    let file = |name| fs::File::create(folder.with_extension(name)).unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_bondwise"))
        .args([mistake.command, mistake.target, "--out", "out"])
        .args(&mistake.args)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .env("COLUMNS", "100")
        .stdin(Stdio::null())
        .stdout(file("stdout"))
        .stderr(file("stderr"))
        .spawn()
        .unwrap();
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if begin.elapsed() > LONGEST {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{}: no answer after {LONGEST:?}", mistake.name);
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let text = |name| String::from_utf8(fs::read(folder.with_extension(name)).unwrap()).unwrap();
    (status.code(), text("stdout"), text("stderr"))
}

/// What depends on the machine is left out: how much memory is free, and what would fit into it.
fn masked(text: &str) -> String {
    let mut shown = String::new();
    for line in text.lines() {
        let line = match line.split_once(" GiB; ") {
            Some((before, _)) => format!("{before} GiB; ... GiB are free here"),
            None if line.contains("points fit") => "    help: about ... points fit: a spacing of ... m".into(),
            None => line.into(),
        };
        shown.push_str(&line);
        shown.push('\n');
    }
    shown
}

#[test]
fn every_mistake_is_explained_and_nothing_is_written() {
    let bless = std::env::var_os("BLESS").is_some();
    let root = std::env::temp_dir().join(format!("bondwise_mistakes_{}", std::process::id()));
    let mut wrong = Vec::new();
    for mistake in mistakes() {
        let name = mistake.name;
        let folder = root.join(name);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("case.toml"), &mistake.case).unwrap();
        if let Some((file, text)) = &mistake.beside {
            fs::write(folder.join(file), text).unwrap();
        }
        (mistake.prepare)(&folder);
        let before = content(&folder.join("out"));
        let begin = Instant::now();
        let (exit, out, error) = call(&folder, &mistake);
        if std::env::var_os("TIMES").is_some() {
            eprintln!("{:>8.1} ms  {name}", 1e3 * begin.elapsed().as_secs_f64());
        }
        let said = masked(&error);
        let stored = here(&format!("{name}.txt"));
        if bless {
            fs::write(&stored, &said).unwrap();
        } else {
            let expected = fs::read_to_string(&stored).unwrap_or_default();
            if said != expected {
                wrong.push(format!("{name}: says\n{said}\ninstead of\n{expected}"));
            }
        }
        if exit != Some(mistake.exit) {
            wrong.push(format!("{name}: exit code {exit:?}, not {}:\n{said}", mistake.exit));
        }
        if !out.is_empty() {
            wrong.push(format!("{name}: a refusal belongs to the standard error:\n{out}"));
        }
        if content(&folder.join("out")) != before {
            wrong.push(format!("{name}: the output folder was touched"));
        }
        let words = || said.split(|c: char| !c.is_ascii_alphanumeric());
        for word in JARGON.iter().filter(|word| words().any(|w| w == **word)) {
            wrong.push(format!("{name}: `{word}` means nothing to a user:\n{said}"));
        }
        if said.len() > 20_000 {
            wrong.push(format!("{name}: {} bytes are too long to be read", said.len()));
        }
    }
    fs::remove_dir_all(&root).unwrap();
    assert!(wrong.is_empty(), "{} of the messages are wrong\n\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn the_names_of_the_mistakes_and_of_the_stored_texts_are_the_same() {
    let table = mistakes();
    let names: BTreeSet<String> = table.iter().map(|m| format!("{}.txt", m.name)).collect();
    assert_eq!(names.len(), table.len(), "two mistakes have one name");
    let stored = fs::read_dir(here("")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let stored: BTreeSet<String> = stored.filter(|n| n.ends_with(".txt")).collect();
    if cfg!(unix) {
        assert_eq!(names, stored);
    }
}

#[test]
fn the_case_in_which_the_mistakes_are_made_is_good() {
    let output = Command::new(env!("CARGO_BIN_EXE_bondwise")).arg("check").arg(here("good.toml")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}
