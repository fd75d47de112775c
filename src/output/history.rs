//! The history of a run: energies, momenta, broken bonds, crack tip, reactions and the most stretched bond, a row at a time.
//!
//! The rows are made on the stepping thread, which alone has the forces; what puts them into the file is a
//! [`Table`] like any other.

use std::path::PathBuf;

use super::crack_tip::CrackTip;
use super::snapshot::FieldCache;
use super::source::Source;
use super::table::Table;
use crate::field::Values;
use crate::physics::{Balance, StretchedBond};
use crate::solver::Clock;

/// Makes the rows of `history.csv` and keeps the extremes that the report needs.
pub struct History {
    path: PathBuf,
    every: u64,
    last_step: Option<u64>,
    pub tip: Option<CrackTip>,
    pub balance: Balance,
    /// The stretch ratio of the last row; None where no bond can break.
    pub stretch_ratio: Option<f64>,
    /// The largest of all rows, and when it was, s; None until a bond was stretched.
    pub most_stretched: Option<(StretchedBond, f64)>,
    largest_defect: f64,
    largest_scale: f64,
    largest_momentum_defect: f64,
    largest_momentum_scale: f64,
}

impl History {
    pub fn new(path: PathBuf, every: u64, tip: Option<CrackTip>) -> Self {
        History {
            path,
            every,
            last_step: None,
            tip,
            balance: Balance::default(),
            stretch_ratio: None,
            most_stretched: None,
            largest_defect: 0.0,
            largest_scale: 0.0,
            largest_momentum_defect: 0.0,
            largest_momentum_scale: 0.0,
        }
    }

    /// Largest energy defect so far over the largest of the external work and the initial energy so far.
    pub fn imbalance(&self) -> f64 {
        if self.largest_scale > 0.0 { self.largest_defect / self.largest_scale } else { 0.0 }
    }

    /// Largest momentum defect so far over the largest Σ ρ |v| V so far.
    pub fn momentum_error(&self) -> f64 {
        if self.largest_momentum_scale > 0.0 { self.largest_momentum_defect / self.largest_momentum_scale } else { 0.0 }
    }

    /// The table that the rows go into.
    pub fn table(&self, source: &mut dyn Source) -> Table {
        let dimension = source.facts().dimension;
        let axes = &["x", "y", "z"][..dimension];
        let mut columns: Vec<String> = vec!["step".into(), "time".into()];
        columns.extend(source.columns(&Balance::default()).into_iter().map(|column| column.name));
        if self.tip.is_some() {
            columns.extend(axes.iter().map(|a| format!("crack_tip_{a}")));
            columns.push("crack_tip_speed".into());
        }
        if source.adapted().is_some() {
            columns.extend(["points", "refined"].map(String::from));
        }
        if source.hybrid().is_some() {
            let names = ["standard_fraction", "bond_evaluations", "row_evaluations", "momentum_drift"];
            columns.extend(names.map(String::from));
        }
        columns.extend(source.reactions().iter().map(|(name, _)| format!("reaction_{name}")));
        if source.facts().physics.elastic().is_some_and(|elastic| elastic.critical_stretch.is_some()) {
            columns.push("largest_stretch_ratio".into());
        }
        Table::new(&self.path, columns)
    }

    /// A row if one is due.
    pub fn row(&mut self, look: &mut FieldCache<'_>, clock: &Clock, last: bool) -> Option<Vec<f64>> {
        let due = last || clock.step.is_multiple_of(self.every);
        if !due || self.last_step == Some(clock.step) {
            return None;
        }
        self.last_step = Some(clock.step);
        let b = look.source.balance();
        self.balance = b;
        let [defect, scale] = look.source.defect(&b);
        self.largest_defect = self.largest_defect.max(defect.abs());
        self.largest_scale = self.largest_scale.max(scale);
        self.largest_momentum_defect = self.largest_momentum_defect.max(b.momentum_defect);
        self.largest_momentum_scale = self.largest_momentum_scale.max(b.momentum_scale);
        if let Some(tip) = &mut self.tip
            && let Some(damage) = look.field("damage")
            && let Values::Scalar(damage) = &damage.values
        {
            tip.look(look.source.positions(), damage, clock.time());
        }
        let dimension = look.source.facts().dimension;
        let mut row = vec![clock.step as f64, clock.time()];
        row.extend(look.source.columns(&b).into_iter().map(|column| column.value));
        if let Some(tip) = &self.tip {
            row.extend(&tip.position.unwrap_or([f64::NAN; 3])[..dimension]);
            row.push(tip.speed);
        }
        if look.source.adapted().is_some() {
            row.extend([look.source.facts().points as f64, b.refined]);
        }
        if let Some(work) = look.source.hybrid() {
            row.extend([work.standard[0], work.bonds as f64, work.nodes as f64, b.momentum_defect]);
        }
        row.extend(look.source.reactions().iter().map(|(_, value)| value));
        if look.source.facts().physics.elastic().is_some_and(|elastic| elastic.critical_stretch.is_some()) {
            row.push(self.look_at_stretches(look.source, clock.time()));
        }
        Some(row)
    }

    /// The largest stretch ratio now, at time `t`; 0 where no bond is stretched.
    fn look_at_stretches(&mut self, source: &mut dyn Source, t: f64) -> f64 {
        let now = source.most_stretched();
        let ratio = now.map_or(0.0, |bond| bond.ratio);
        self.stretch_ratio = Some(ratio);
        let before = self.most_stretched.map_or(0.0, |(bond, _)| bond.ratio);
        if let Some(bond) = now.filter(|bond| bond.ratio > before) {
            self.most_stretched = Some((bond, t));
        }
        ratio
    }
}
