//! What is shown to a visitor is the whole state: a run that is put into another one of the same case goes on with its bits.
//! The other one has gone its own way before, so that whatever is not shown is poisoned with what that left.

use bondwise::case::build::{Options, build};
use bondwise::case::model::Case;
use bondwise::case::read_text;
use bondwise::simulation::Simulation;
use bondwise::visit::Visitor;

/// A value that was shown.
#[derive(Debug, Clone, PartialEq)]
enum Shown {
    Doubles(Vec<f64>),
    Singles(Vec<f32>),
    Words(Vec<u16>),
    Indices(Vec<u32>),
    Number(f64),
    Count(u64),
}

/// Keeps what it is shown.
#[derive(Default)]
struct Save(Vec<(String, Shown)>);

impl Visitor for Save {
    fn doubles(&mut self, name: &str, values: &mut Vec<f64>) {
        self.0.push((name.into(), Shown::Doubles(values.clone())));
    }
    fn singles(&mut self, name: &str, values: &mut Vec<f32>) {
        self.0.push((name.into(), Shown::Singles(values.clone())));
    }
    fn words(&mut self, name: &str, values: &mut Vec<u16>) {
        self.0.push((name.into(), Shown::Words(values.clone())));
    }
    fn indices(&mut self, name: &str, values: &mut Vec<u32>) {
        self.0.push((name.into(), Shown::Indices(values.clone())));
    }
    fn number(&mut self, name: &str, value: &mut f64) {
        self.0.push((name.into(), Shown::Number(*value)));
    }
    fn count(&mut self, name: &str, value: &mut u64) {
        self.0.push((name.into(), Shown::Count(*value)));
    }
}

/// Puts back what was kept, in the same order.
struct Restore(std::vec::IntoIter<(String, Shown)>);

impl Restore {
    fn next(&mut self, name: &str) -> Shown {
        let (kept, value) = self.0.next().expect("as much is shown as was");
        assert_eq!(kept, name);
        value
    }
}

impl Visitor for Restore {
    fn doubles(&mut self, name: &str, values: &mut Vec<f64>) {
        let Shown::Doubles(kept) = self.next(name) else { panic!("{name} was of doubles") };
        *values = kept;
    }
    fn singles(&mut self, name: &str, values: &mut Vec<f32>) {
        let Shown::Singles(kept) = self.next(name) else { panic!("{name} was of singles") };
        *values = kept;
    }
    fn words(&mut self, name: &str, values: &mut Vec<u16>) {
        let Shown::Words(kept) = self.next(name) else { panic!("{name} was of words") };
        *values = kept;
    }
    fn indices(&mut self, name: &str, values: &mut Vec<u32>) {
        let Shown::Indices(kept) = self.next(name) else { panic!("{name} was of indices") };
        *values = kept;
    }
    fn number(&mut self, name: &str, value: &mut f64) {
        let Shown::Number(kept) = self.next(name) else { panic!("{name} was a number") };
        *value = kept;
    }
    fn count(&mut self, name: &str, value: &mut u64) {
        let Shown::Count(kept) = self.next(name) else { panic!("{name} was a count") };
        *value = kept;
    }
}

/// A glass plate with a crack that runs, between a grip that moves and a loaded edge.
fn plate(law: &str, discretization: &str, solver: &str, geometry: &str, load: &str) -> Simulation {
    let text = format!(
        r#"
        [case]
        title = "plate"
        dimension = 2
        [geometry]
        shape = {{ rectangle = {{ size = ["60 mm", "30 mm"] }} }}
        spacing = "1 mm"
        cracks = [{{ segment = {{ from = ["-30 mm", 0.0], to = ["-8 mm", 0.0] }} }}]
        {geometry}
        [sets]
        top = {{ where = "y > 0.014" }}
        bottom = {{ where = "y < -0.014" }}
        [discretization]
        horizon_ratio = 3
        {discretization}
        [physics.elasticity]
        law = {{ {law} }}
        failure = {{ critical_stretch = {{ stretch = 6e-4, no_fail = ["top", "bottom"] }} }}
        [[conditions]]
        on = "bottom"
        {load}
        [[conditions]]
        on = "top"
        load = {{ traction = {{ component = 1, value = "3e7*min(1, t/2e-6)" }} }}
        [solver.{solver}]
        end_time = "40 us"
        time_step = "80 ns"
        "#
    );
    let case = read_text::<Case>("case", &text, &[]).expect("a sound case");
    build(&case, &Options::default()).expect("a case that can be built")
}

const BONDS: &str = r#"bond_based = { young = "72 GPa", density = "2440 kg/m^3" }"#;
const SOLID: &str = r#"state_based = { young = "72 GPa", density = "2440 kg/m^3", poisson = 0.2 }"#;
const GRIP: &str = r#"prescribe = { velocity = { component = 1, value = "-2*cos(1e5*t)" } }"#;
const HELD: &str = r#"prescribe = { displacement = { component = 1, value = "-1e-6*sin(1e5*t)" } }"#;
const PULL: &str = r#"load = { traction = { component = 1, value = "-3e7*min(1, t/2e-6)" } }"#;

fn steps(simulation: &mut Simulation, n: u64) {
    for _ in 0..n {
        simulation.model.step(&simulation.solver, &mut simulation.clock).expect("a sound step");
    }
}

/// Bits of the state, and the books.
fn bits(simulation: &mut Simulation) -> (String, Vec<u64>, u64) {
    let columns = {
        let balance = simulation.model.balance();
        simulation.model.columns(&balance)
    };
    let books = columns.iter().map(|column| column.value.to_bits()).collect();
    (simulation.model.hash(), books, simulation.model.broken_pairs())
}

fn goes_on_with_its_bits(make: impl Fn() -> Simulation, before: u64, after: u64) {
    let [middle, end] = goes_on(make, before, after);
    assert!(end > middle && middle > 0, "bonds break before and after");
}

/// The same; how many pairs of points have parted before and after.
fn goes_on(make: impl Fn() -> Simulation, before: u64, after: u64) -> [u64; 2] {
    let mut run = make();
    run.model.start();
    steps(&mut run, before);
    let mut saved = Save::default();
    run.model.visit(&mut saved);
    let (clock, middle) = (run.clock, run.model.broken_pairs());
    steps(&mut run, after);
    let mut other = make();
    other.model.start();
    steps(&mut other, before / 3);
    let mut restore = Restore(saved.0.into_iter());
    other.model.visit(&mut restore);
    assert!(restore.0.next().is_none(), "all that was kept is put back");
    other.clock = clock;
    steps(&mut other, after);
    assert_eq!(bits(&mut run), bits(&mut other));
    [middle, run.model.broken_pairs()]
}

#[test]
fn bonds_on_lattices_and_clouds_in_every_precision() {
    for precision in ["double", "single", "mixed"] {
        let settings = format!("precision = \"{precision}\"");
        goes_on_with_its_bits(|| plate(BONDS, &settings, "velocity_verlet", "", GRIP), 150, 60);
        goes_on_with_its_bits(|| plate(BONDS, &settings, "velocity_verlet", "", PULL), 150, 60);
    }
    let cloud = "perturb = { amplitude = 0.2, seed = 1 }";
    goes_on_with_its_bits(|| plate(BONDS, "", "velocity_verlet", cloud, HELD), 150, 60);
}

#[test]
fn solvers_with_stages() {
    for load in [GRIP, HELD] {
        goes_on_with_its_bits(|| plate(BONDS, "", "runge_kutta", "", load), 150, 60);
    }
}

#[test]
fn state_based_solids() {
    for precision in ["double", "single", "mixed"] {
        let settings = format!("precision = \"{precision}\"");
        goes_on_with_its_bits(|| plate(SOLID, &settings, "velocity_verlet", "", GRIP), 150, 60);
    }
}

#[test]
fn hybrid_schemes_while_points_switch() {
    for (law, buffer) in [(BONDS, 1), (SOLID, 2)] {
        let scheme = format!("scheme = {{ hybrid = {{ buffer = {buffer} }} }}");
        for load in [GRIP, PULL] {
            goes_on_with_its_bits(|| plate(law, &scheme, "velocity_verlet", "", load), 150, 60);
        }
    }
}

/// Between a held layer and a source, around a pre-crack.
fn diffusing(geometry: &str, discretization: &str) -> Simulation {
    let text = format!(
        r#"
        [case]
        title = "square"
        dimension = 2
        [geometry]
        shape = {{ rectangle = {{ size = [1.0, 1.0] }} }}
        spacing = 0.025
        {geometry}
        [sets]
        layer = {{ where = "max(abs(x), abs(y)) > 0.5 - 0.1" }}
        [discretization]
        horizon_ratio = 4
        {discretization}
        [physics.diffusion]
        diffusivity = 1.0
        [[conditions]]
        on = "layer"
        prescribe = {{ concentration = {{ value = "x*cos(100*t)" }} }}
        [[conditions]]
        on = "all"
        load = {{ source = {{ value = "(1 + y)*sin(200*t)" }} }}
        [solver.forward_euler]
        end_time = 0.05
        time_step = 1e-4
        "#
    );
    let case = read_text::<Case>("case", &text, &[]).expect("a sound case");
    build(&case, &Options::default()).expect("a case that can be built")
}

#[test]
fn what_diffuses_on_lattices_and_clouds_by_bonds_and_rows() {
    let crack = "cracks = [{ segment = { from = [-0.1, 0.0], to = [0.2, 0.1] } }]";
    let cloud = "perturb = { amplitude = 0.2, seed = 1 }";
    let rows = "scheme = { collocation = { order = 2 } }";
    for (geometry, scheme) in [(crack, ""), (&*format!("{cloud}\n{crack}"), ""), ("", rows), (cloud, rows)] {
        assert_eq!(goes_on(|| diffusing(geometry, scheme), 150, 60), [0, 0]);
    }
}
