//! One measurement: what follows from it, as a line of the table and as an object of JSON.

use bondwise::execution::machine::Limits;
use serde_json::{Value, json};

use super::counts::Work;
use super::problems::Problem;

/// One measurement.
pub struct Row {
    pub problem: &'static Problem,
    pub precision: String,
    pub points: usize,
    /// Directed, less those that pre-cracks cut.
    pub bonds: u64,
    /// Pairs that broke while it was timed.
    pub broken_pairs: u64,
    pub setup_seconds: f64,
    /// Median over the steps.
    pub step_seconds: f64,
    pub best_step_seconds: f64,
    pub bytes_per_point: f64,
    pub work: Work,
    pub limits: Limits,
}

impl Row {
    /// Of one thread: a step's time × threads over its bonds.
    fn ns_per_bond(&self, step_seconds: f64) -> f64 {
        1e9 * step_seconds * self.limits.threads as f64 / self.bonds as f64
    }
    fn bond_updates_per_second(&self) -> f64 {
        self.bonds as f64 / self.step_seconds
    }
    fn setup_steps(&self) -> f64 {
        self.setup_seconds / self.step_seconds
    }
    fn flops(&self) -> f64 {
        self.work.operations / self.step_seconds
    }
    fn bandwidth(&self) -> f64 {
        self.work.bytes / self.step_seconds
    }
    /// Bonds of mixed precision are computed in single precision.
    fn peak(&self) -> f64 {
        if self.precision == "double" { self.limits.peak_double } else { self.limits.peak_single }
    }
    fn fraction_of_peak_flops(&self) -> f64 {
        self.flops() / self.peak()
    }
    fn fraction_of_bandwidth(&self) -> f64 {
        self.bandwidth() / self.limits.bandwidth
    }
    /// The limit that is nearer.
    fn binds(&self) -> &'static str {
        if self.fraction_of_peak_flops() >= self.fraction_of_bandwidth() { "flops" } else { "memory" }
    }

    pub fn json(&self) -> Value {
        json!({
            "problem": self.problem.name,
            "path": self.problem.path.name(),
            "precision": self.precision,
            "points": self.points,
            "bonds": self.bonds,
            "broken_pairs": self.broken_pairs,
            "threads": self.limits.threads,
            "setup_seconds": self.setup_seconds,
            "setup_steps": self.setup_steps(),
            "step_seconds": self.step_seconds,
            "best_step_seconds": self.best_step_seconds,
            "ns_per_bond": self.ns_per_bond(self.step_seconds),
            "best_ns_per_bond": self.ns_per_bond(self.best_step_seconds),
            "bond_updates_per_second": self.bond_updates_per_second(),
            "points_per_second": self.points as f64 / self.step_seconds,
            "bytes_per_point": self.bytes_per_point,
            "gigabytes_per_second": 1e-9 * self.bandwidth(),
            "gigaflops": 1e-9 * self.flops(),
            "fraction_of_peak_flops": self.fraction_of_peak_flops(),
            "fraction_of_bandwidth": self.fraction_of_bandwidth(),
            "binds": self.binds(),
            "machine": {
                "gigabytes_per_second": 1e-9 * self.limits.bandwidth,
                "gigaflops": 1e-9 * self.peak(),
            },
        })
    }

    pub fn heading() -> String {
        format!(
            "{:<23} {:<7} {:<6} {:>8} {:>7} {:>7} {:>7} {:>8} {:>7} {:>8} {:>5} {:>6} {:>6} {:>6} {}",
            "problem",
            "path",
            "prec.",
            "points",
            "threads",
            "ns/bond",
            "best",
            "Mbond/s",
            "set-up",
            "B/point",
            "GB/s",
            "GF/s",
            "%peak",
            "%memory",
            "binds"
        )
    }

    pub fn line(&self) -> String {
        format!(
            "{:<23} {:<7} {:<6} {:>8} {:>7} {:>7.3} {:>7.3} {:>8.1} {:>7.1} {:>8.0} {:>5.1} {:>6.1} {:>6.1} {:>7.1} {}",
            self.problem.name,
            self.problem.path.name(),
            self.precision,
            self.points,
            self.limits.threads,
            self.ns_per_bond(self.step_seconds),
            self.ns_per_bond(self.best_step_seconds),
            1e-6 * self.bond_updates_per_second(),
            self.setup_steps(),
            self.bytes_per_point,
            1e-9 * self.bandwidth(),
            1e-9 * self.flops(),
            100.0 * self.fraction_of_peak_flops(),
            100.0 * self.fraction_of_bandwidth(),
            self.binds()
        )
    }
}
