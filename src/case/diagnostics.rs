//! What is said to the user about a mistake in a case, and where.
//!
//! One mistake takes one to four lines:
//!
//! ```text
//! case.toml:14:9: error: physics.elasticity.law.bond_based.young: found "210 GPA"
//!     unknown unit `GPA`; allowed: a pressure in Pa, kPa, MPa, GPa, psi, bar, above 0
//!     help: did you mean `GPa`?
//! ```
//!
//! All mistakes of a case are collected and shown together, in the order of the file.

use std::fmt;

/// Names and values longer than this are cut when they are shown.
const LONGEST_SHOWN: usize = 60;

/// One remark about a case: where, which key, what was found, what is allowed, what to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    pub severity: Severity,
    pub place: Place,
    /// The key path, as in `conditions[1].value`; empty for a remark about the whole case.
    pub path: String,
    pub message: String,
    /// The value as it was written.
    pub found: Option<String>,
    pub allowed: Option<String>,
    pub help: Option<String>,
}

/// Whether a case with this remark may run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    Error,
    Warning,
}

/// Where a remark points.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// A character of the case file; line and column count from one, columns in characters.
    Text { file: String, line: usize, column: usize },
    /// The file as a whole.
    File { file: String },
    /// A value given on the command line, as in `--set mesh.spacing=2`.
    Override(String),
}

impl Diagnostic {
    /// An error with nothing but its place, key and message.
    pub fn error(place: Place, path: &str, message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            place,
            path: path.to_owned(),
            message: message.into(),
            found: None,
            allowed: None,
            help: None,
        }
    }

    /// A warning with nothing but its place, key and message.
    pub fn warning(place: Place, path: &str, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(place, path, message) }
    }

    /// Adds the value as it was written.
    #[must_use]
    pub fn found(mut self, found: impl AsRef<str>) -> Self {
        self.found = Some(shorten(found.as_ref()));
        self
    }

    /// Adds what would have been accepted.
    #[must_use]
    pub fn allowed(mut self, allowed: impl Into<String>) -> Self {
        self.allowed = Some(allowed.into());
        self
    }

    /// Adds what to do about it.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text { file, line, column } => write!(f, "{file}:{line}:{column}"),
            Self::File { file } => f.write_str(file),
            Self::Override(text) => f.write_str(text),
        }
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        write!(f, "{}: {severity}: ", self.place)?;
        if !self.path.is_empty() {
            write!(f, "{}: ", shorten(&self.path))?;
        }
        let allowed = self.allowed.as_ref().map(|text| format!("allowed: {text}"));
        match (&self.found, allowed) {
            (Some(found), Some(allowed)) => {
                write!(f, "found {found}\n    {}; {allowed}", self.message)?;
            }
            (Some(found), None) => write!(f, "found {found}\n    {}", self.message)?,
            (None, Some(allowed)) => write!(f, "{}\n    {allowed}", self.message)?,
            (None, None) => f.write_str(&self.message)?,
        }
        if let Some(help) = &self.help {
            write!(f, "\n    help: {}", help.replace('\n', "\n    "))?;
        }
        Ok(())
    }
}

/// All remarks about one case, in the order of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostics {
    /// The case file, for the closing line.
    pub file: String,
    pub list: Vec<Diagnostic>,
}

impl Diagnostics {
    /// The number of errors; warnings do not count.
    pub fn errors(&self) -> usize {
        let is_error = |diagnostic: &&Diagnostic| diagnostic.severity == Severity::Error;
        self.list.iter().filter(is_error).count()
    }
}

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for diagnostic in &self.list {
            writeln!(f, "{diagnostic}")?;
        }
        match self.errors() {
            0 => Ok(()),
            1 => write!(f, "1 mistake in {}; nothing was run", self.file),
            n => write!(f, "{n} mistakes in {}; nothing was run", self.file),
        }
    }
}

impl std::error::Error for Diagnostics {}

/// The text on one line, cut to what fits in a message.
pub fn shorten(text: &str) -> String {
    let mut shown = String::new();
    for (count, c) in text.chars().enumerate() {
        if count == LONGEST_SHOWN {
            shown.push_str("...");
            break;
        }
        // A control character of a hostile file must not reach the terminal.
        match c {
            c if c.is_control() => shown.extend(c.escape_default()),
            c => shown.push(c),
        }
    }
    shown
}
