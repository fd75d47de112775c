//! A writer and when it acts. Writers run on the writer thread: they see snapshots, never the model itself.

use super::schedule::Schedule;
use super::snapshot::{FieldRequest, Snapshot};
use crate::error::Result;
use crate::solver::Clock;

/// Writes snapshots into files.
pub trait Writer: Send {
    /// What its snapshots are to hold; the same for all of a run.
    fn wants(&self) -> FieldRequest;
    /// Called once for each due instant, in the order of time.
    fn write(&mut self, snapshot: &Snapshot) -> Result<()>;
}

/// An output of a run: a writer and its schedule.
pub struct Output {
    pub schedule: Schedule,
    pub writer: Box<dyn Writer>,
}

/// When a writer is to be handed what: the part of an output that stays on the stepping thread.
pub struct ScheduledRequest {
    schedule: Schedule,
    pub wants: FieldRequest,
    last_step: Option<u64>,
}

impl Output {
    pub fn split(self) -> (ScheduledRequest, Box<dyn Writer>) {
        (ScheduledRequest { schedule: self.schedule, wants: self.writer.wants(), last_step: None }, self.writer)
    }
}

impl ScheduledRequest {
    /// Whether it is due now, at most once an instant; `last` at the end of the run.
    pub fn is_due(&mut self, clock: &Clock, last: bool) -> bool {
        let due = self.last_step != Some(clock.step) && (last || self.schedule.is_due(clock));
        if due {
            self.last_step = Some(clock.step);
        }
        due
    }
}
