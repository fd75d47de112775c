//! The cases that the program carries: examples, tests and benchmark inputs at once.

/// A case of the folder `cases/`.
#[derive(Debug, Clone, Copy)]
pub struct Bundled {
    pub name: &'static str,
    /// What it shows, in one line.
    pub about: &'static str,
    pub case: &'static str,
    pub readme: &'static str,
}

/// All of them, in the order in which a newcomer may look at them.
pub const CASES: [Bundled; 1] = [Bundled {
    name: "crack_branching",
    about: "2D: a crack runs through glass and branches; the main example",
    case: include_str!("../../cases/crack_branching/case.toml"),
    readme: include_str!("../../cases/crack_branching/README.md"),
}];
