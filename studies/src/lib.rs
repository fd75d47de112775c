//! Proof: studies that compare the program with closed forms and published figures, each in one file.
//!
//! A study prints what is published or exact beside what was obtained, the difference, the tolerance and where the
//! tolerance comes from, and plots itself. `bondwise verify` runs them, and so does the gate; tests assert that the quickest pass.

pub mod bar;
mod constants;
mod convergence;
mod crack_branching;
mod delamination;
mod discrete_moduli;
mod dispersion;
mod double_cantilever;
mod energy_drift;
pub mod exact;
mod family_counts;
mod fracture_work;
mod hybrid_branching;
mod hybrid_example_1;
mod hybrid_example_2;
mod hybrid_wave;
mod inclusion;
mod joint;
mod kirsch;
mod l_panel;
mod navier;
mod precision;
mod pressed;
mod refined_branching;
mod surface_effect;
mod two_layers;
mod wave;
mod wave_interface;

use serde::Serialize;

use bondwise::case::{Case, Options, build, bundled, read_text};
use bondwise::error::{Error, Result};
use bondwise::output::picture::Image;
use bondwise::simulation::Simulation;

/// A verification study.
#[derive(Clone, Copy)]
pub struct Study {
    /// As on the command line, `crack-branching`.
    pub name: &'static str,
    /// What it shows, in one line.
    pub about: &'static str,
    /// Takes more than about a minute on two cores: run by name or with `--full` only.
    pub heavy: bool,
    /// `full`: the whole extent of the study rather than its quick form.
    pub run: fn(full: bool) -> Result<Outcome>,
}

/// All studies, in reading order.
pub const STUDIES: &[Study] = &[
    Study {
        name: "constants",
        about: "micromodulus and critical stretch of every hypothesis and influence function, by quadrature",
        heavy: false,
        run: constants::run,
    },
    Study {
        name: "navier",
        about: "the local limit is the Navier operator with the Poisson ratio of the theory",
        heavy: false,
        run: navier::run,
    },
    Study {
        name: "family-counts",
        about: "neighbours of a point, in 2D and 3D, with both partial-volume rules",
        heavy: false,
        run: family_counts::run,
    },
    Study {
        name: "discrete-moduli",
        about: "moduli and fracture energy of the scheme at finite spacing",
        heavy: false,
        run: discrete_moduli::run,
    },
    wave::WAVE_IN_BAR,
    dispersion::DISPERSION,
    energy_drift::ENERGY_DRIFT,
    Study {
        name: "crack-branching",
        about: "a crack that branches in glass: broken bonds, tip, branching point, symmetry, energies",
        heavy: false,
        run: crack_branching::run,
    },
    Study {
        name: "fracture-work",
        about: "a crack driven slowly through a strip takes the fracture energy for each new area",
        heavy: false,
        run: fracture_work::run,
    },
    precision::PRECISION,
    double_cantilever::STUDY,
    l_panel::STUDY,
    kirsch::STUDY,
    pressed::STUDY,
    joint::STUDY,
    inclusion::STUDY,
    delamination::STUDY,
    convergence::STUDY,
    wave_interface::STUDY,
    refined_branching::STUDY,
    surface_effect::STUDY,
    hybrid_example_1::STUDY,
    two_layers::STUDY,
    hybrid_example_2::STUDY,
    hybrid_branching::STUDY,
    hybrid_wave::STUDY,
    bar::SEVEN_NODES,
    bar::CONVERGENCE,
    bar::TABLE_1,
    bar::TABLE_2,
    bar::TABLE_3,
    bar::TABLE_4,
    bar::TABLE_5,
];

/// The study of that name.
pub fn find(name: &str) -> Option<&'static Study> {
    STUDIES.iter().find(|study| study.name == name)
}

impl Study {
    /// The study for one influence function alone, where it knows how to.
    pub fn with_influence(&self) -> Option<fn(full: bool, influence: bar::Micromodulus) -> Result<Outcome>> {
        bar::WITH_INFLUENCE.iter().find(|(name, _)| *name == self.name).map(|(_, run)| *run)
    }
}

/// What a study found.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    pub rows: Vec<Row>,
    /// File name without extension, and the picture.
    pub plots: Vec<(String, Image)>,
    /// File name without extension, and the pictures that it plays.
    pub animations: Vec<(String, Vec<Image>)>,
    /// Remarks for the reader: what a figure means, what cannot be reproduced and why.
    pub notes: Vec<String>,
}

/// One comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What is compared, with its unit.
    pub what: String,
    /// Published or exact value.
    pub expected: f64,
    pub obtained: f64,
    pub tolerance: f64,
    pub measure: Measure,
    /// Where the expected value comes from, and why the tolerance is what it is.
    pub origin: String,
}

/// How obtained and expected are compared with the tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// |obtained − expected| ≤ tolerance
    Absolute,
    /// |obtained − expected| ≤ tolerance |expected|
    Relative,
    /// obtained ≤ expected (tolerance unused)
    AtMost,
    /// obtained ≥ expected (tolerance unused)
    AtLeast,
    /// Published, printed for comparison, not judged: what it depends on is not published with it.
    Information,
}

impl Row {
    pub fn new(
        what: impl Into<String>,
        expected: f64,
        obtained: f64,
        tolerance: f64,
        measure: Measure,
        origin: impl Into<String>,
    ) -> Self {
        Row { what: what.into(), expected, obtained, tolerance, measure, origin: origin.into() }
    }

    /// Obtained less expected, divided by |expected| where the comparison is relative.
    pub fn difference(&self) -> f64 {
        let difference = self.obtained - self.expected;
        if self.measure == Measure::Relative { difference / self.expected.abs() } else { difference }
    }

    /// Not-a-number never passes.
    pub fn passes(&self) -> bool {
        match self.measure {
            Measure::Absolute | Measure::Relative => self.difference().abs() <= self.tolerance,
            Measure::AtMost => self.obtained <= self.expected,
            Measure::AtLeast => self.obtained >= self.expected,
            Measure::Information => !self.obtained.is_nan(),
        }
    }
}

impl Outcome {
    /// An outcome without a row that is judged has shown nothing and does not pass.
    pub fn passes(&self) -> bool {
        self.rows.iter().any(|row| row.measure != Measure::Information) && self.rows.iter().all(Row::passes)
    }
}

/// A case from its text, ready to be stepped; studies write no files.
fn simulation(name: &str, text: &str, overrides: &[(&str, &str)]) -> Result<Simulation> {
    let overrides: Vec<_> = overrides.iter().map(|(k, v)| ((*k).to_string(), (*v).to_string())).collect();
    let case = read_text::<Case>(name, text, &overrides).map_err(Error::Case)?;
    build(&case, &Options::default())
}

/// A bundled case with other values of some keys, ready to be stepped.
fn bundled_simulation(name: &str, overrides: &[(&str, &str)]) -> Result<Simulation> {
    let case = bundled::CASES.iter().find(|case| case.name == name);
    let case = case.ok_or_else(|| Error::Refused(format!("no bundled case is called `{name}`")))?;
    simulation(name, case.case, overrides)
}
