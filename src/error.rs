//! What can go wrong, by stage, with the numbers in the message.

use std::path::PathBuf;

use crate::case::Diagnostics;

/// Every failure of the library. The variants follow the stages of a run, and the program's exit codes follow them.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The case file is refused: every mistake found in it, in file order.
    #[error("{0}")]
    Case(Diagnostics),
    /// A builder refuses what the case asks for, without a place in the file.
    #[error("{0}")]
    Refused(String),
    /// The run stopped on numbers.
    #[error("{0}")]
    Numbers(Box<NumericalStop>),
    /// Reading or writing failed.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// The run would not fit into this machine.
    #[error("{0}")]
    TooLarge(String),
}

/// Where and why a run stopped on numbers.
#[derive(Debug, Clone)]
pub struct NumericalStop {
    pub step: u64,
    /// s
    pub time: f64,
    pub field: &'static str,
    pub value: f64,
    /// Index of the worst point in point order, and its reference position (m), when one point is to blame.
    pub point: Option<(usize, Vec<f64>)>,
    pub cause: String,
}

impl std::fmt::Display for NumericalStop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "stopped at step {}, time {:.6e} s: {} is {}", self.step, self.time, self.field, self.value)?;
        if let Some((point, position)) = &self.point {
            write!(f, " at point {point}, position (")?;
            for (k, x) in position.iter().enumerate() {
                write!(f, "{}{x:.6e}", if k > 0 { ", " } else { "" })?;
            }
            write!(f, ") m")?;
        }
        write!(f, "\n    likely cause: {}", self.cause)
    }
}

impl Error {
    /// An I/O failure with the path it happened at.
    pub fn io(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Error::Io { path: path.into(), source }
    }

    /// The exit code of the program: 3 input refused, 4 stopped on numbers, 5 I/O, 6 too large.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Case(_) | Error::Refused(_) => 3,
            Error::Numbers(_) => 4,
            Error::Io { .. } => 5,
            Error::TooLarge(_) => 6,
        }
    }
}

pub type Result<T, E = Error> = std::result::Result<T, E>;
