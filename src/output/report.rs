//! `report.json`: what a run was and how it ended. Its keys are a stable interface; `docs/report.md` explains each.

use std::path::Path;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::output::source::MaterialSummary;
use crate::physics::elasticity::surface::SurfaceEffect;
use crate::solver::statics::LoadStep;

/// The report of a run; SI units.
#[derive(Debug, Clone, Serialize, PartialEq)]
pub struct Report {
    pub title: String,
    /// Version of the program.
    pub version: String,
    /// `done`, `interrupted` or `stopped`.
    pub status: String,
    pub dimension: usize,
    pub points: usize,
    /// Directed bonds at the start, pre-cracks taken out.
    pub bonds: u64,
    /// Directed bonds that pre-cracks cut.
    pub cut_bonds: u64,
    /// m
    pub horizon: f64,
    pub spacing: f64,
    /// Of all cells, and of the shape that they fill (null of points from a file); m³, m² in 2D, m in 1D.
    pub volume: f64,
    pub shape_volume: Option<f64>,
    /// kg; null where nothing has a mass.
    pub mass: Option<f64>,
    /// Of a body of several materials; else empty.
    pub materials: Vec<MaterialSummary>,
    /// Of the first material: N/m⁶ in 3D, N/m⁵ in 2D, N/m⁴ in 1D. This and all that follows of elasticity is null of other physics.
    pub micromodulus: Option<f64>,
    /// The smallest of the body; null if bonds never break.
    pub critical_stretch: Option<f64>,
    pub surface: Option<SurfaceEffect>,
    /// Absent of other physics.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diffusion: Option<Diffusion>,
    pub steps: u64,
    /// s
    pub time_step: f64,
    pub stable_time_step: f64,
    pub end_time: f64,
    pub threads: usize,
    pub wall_seconds: WallSeconds,
    /// Directed bonds × steps over the seconds of stepping.
    pub bond_updates_per_second: f64,
    /// Null where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    pub energy: Option<Energy>,
    /// The books at the end, by the names that the physics gives them: the columns of the history.
    pub books: serde_json::Map<String, serde_json::Value>,
    /// Largest energy defect over the largest of external work and initial energy.
    pub energy_imbalance: Option<f64>,
    /// Largest momentum defect over the largest Σ ρ |v| V.
    pub momentum_error: Option<f64>,
    /// Pairs broken since the start.
    pub broken_bonds: Option<u64>,
    /// The largest stretch ratio of a whole bond in any row of the history; null if bonds never break or none was stretched.
    pub largest_stretch_ratio: Option<StretchRatio>,
    /// Points with φ > 0.35.
    pub damaged_points: Option<usize>,
    pub crack_tip: Option<Tip>,
    /// Null where cells do not follow the solution.
    pub refinement: Option<Refinement>,
    /// Null in the standard scheme.
    pub hybrid: Option<Hybrid>,
    /// Of static solvers, the one that was not finished included; empty for others.
    pub load_steps: Vec<LoadStep>,
    /// In the order of the outputs.
    pub probes: Vec<Probed>,
    pub state_hash: String,
}

/// Where a probe looks.
#[derive(Debug, Clone, Serialize, PartialEq)]
pub struct Probed {
    /// As the case says, m.
    pub at: Vec<f64>,
    /// The point nearest to that, and its position, m; at the end, where points are replaced.
    pub point: usize,
    pub position: Vec<f64>,
}

/// What diffused.
#[derive(Debug, Clone, Copy, Serialize, PartialEq)]
pub struct Diffusion {
    /// K, m²/s.
    pub diffusivity: f64,
    /// That which long waves find, m²/s; null of scattered points.
    pub found_diffusivity: Option<f64>,
    /// κ of the integral, m^(q−D)/s.
    pub micro_diffusivity: f64,
    /// q
    pub exponent: u32,
    /// Largest of |amount − initial amount − what came in| over the largest Σ |C| V.
    pub imbalance: f64,
}

/// What refinement has done.
#[derive(Debug, Clone, Copy, Serialize, PartialEq)]
pub struct Refinement {
    /// Times that points were replaced.
    pub events: u64,
    /// The most points at any time, and the mean over all looks.
    pub most_points: u64,
    pub mean_points: f64,
    /// Energy that came in by that, J, and the sum of its magnitudes.
    pub energy: f64,
    pub energy_turnover: f64,
    /// Fraction of all families, over all events.
    pub families_found_anew: f64,
    /// Points that saw, with a larger horizon, a place where finer cells were wanted: the most at any time.
    pub points_seen_by_coarser: usize,
}

/// What the hybrid scheme had to do.
#[derive(Debug, Clone, Copy, Serialize, PartialEq)]
pub struct Hybrid {
    /// Fraction of the points that summed their bonds, at the start and at the end.
    pub standard_fraction_at_start: f64,
    pub standard_fraction: f64,
    /// Bonds that were visited, all evaluations together, and points of rows.
    pub bond_evaluations: u64,
    pub row_evaluations: u64,
}

/// How near a bond came to breaking.
#[derive(Debug, Clone, Serialize, PartialEq)]
pub struct StretchRatio {
    /// Stretch over critical stretch.
    pub value: f64,
    /// The middle of the bond in the undeformed body, m.
    pub position: Vec<f64>,
    /// s
    pub time: f64,
}

/// Where the time went. The first three follow each other; writing goes on beside them.
#[derive(Debug, Clone, Copy, Serialize, PartialEq, Default)]
pub struct WallSeconds {
    pub setup: f64,
    pub stepping: f64,
    /// In which the run did not step: history rows, snapshots, waiting for the writer thread.
    pub output: f64,
    /// In which the writer thread was busy.
    pub writing: f64,
}

/// Energies at the end, J (2D: J/m).
#[derive(Debug, Clone, Copy, Serialize, PartialEq, Default)]
pub struct Energy {
    pub kinetic: f64,
    pub strain: f64,
    pub fracture: f64,
    pub external: f64,
    pub damped: f64,
    /// Came in when cells were split and merged.
    pub refined: f64,
    pub initial: f64,
}

/// The crack tip at the end.
#[derive(Debug, Clone, Serialize, PartialEq)]
pub struct Tip {
    /// m; null if nothing is damaged.
    pub position: Option<Vec<f64>>,
    /// m/s
    pub largest_speed: f64,
    /// c_R, m/s, which no crack in mode I passes; null in 1D.
    pub rayleigh_speed: Option<f64>,
}

impl Report {
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut text = serde_json::to_string_pretty(self).map_err(|e| Error::io(path, e.into()))?;
        text.push('\n');
        std::fs::write(path, text).map_err(|e| Error::io(path, e))
    }
}

/// Largest memory that this process has held, if the system tells.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}
