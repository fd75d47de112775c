//! When something is due.

use crate::solver::Clock;

/// The instants at which a writer acts. The time step is never changed for it: it acts at the first step at or after.
#[derive(Debug, Clone, PartialEq)]
pub enum Schedule {
    /// Every n steps.
    Steps(u64),
    /// Every so many seconds.
    Every(f64),
    /// At these times, s, ascending.
    At(Vec<f64>),
    /// The first and the last instant only.
    LoadEnds,
    /// The last instant only.
    End,
}

impl Schedule {
    /// Whether it is due at this clock, having been asked at every step before. At the last instant all are.
    pub fn is_due(&self, clock: &Clock) -> bool {
        // A step belongs to the instant that it is nearest to from above, up to rounding of the product step × Δt.
        let slack = 1e-6 * clock.dt;
        let (now, before) = (clock.time() + slack, clock.time() - clock.dt + slack);
        match self {
            Schedule::Steps(n) => clock.step.is_multiple_of(*n),
            Schedule::Every(period) => (now / period).floor() > (before / period).floor(),
            Schedule::At(times) => times.iter().any(|&t| t <= now && t > before),
            Schedule::LoadEnds => clock.step == 0,
            Schedule::End => false,
        }
    }

    /// How many times it will be due in a run.
    pub fn count(&self, steps: u64, dt: f64) -> u64 {
        match self {
            Schedule::Steps(n) => steps / n + 1,
            Schedule::Every(period) => ((steps as f64 * dt / period) as u64 + 1).min(steps + 1),
            Schedule::At(times) => times.len() as u64,
            Schedule::LoadEnds | Schedule::End => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_period_is_met_once() {
        let schedule = Schedule::Every(1e-6);
        let due: Vec<u64> = (0..=100).filter(|&step| schedule.is_due(&Clock::at(step, 1e-7))).collect();
        assert_eq!(due, (0..=10).map(|k| 10 * k).collect::<Vec<_>>());
        let due = (0..=100).filter(|&step| schedule.is_due(&Clock::at(step, 0.7e-7))).count();
        assert_eq!(due, 1 + 7);
        let at = Schedule::At(vec![0.0, 3.5e-7]);
        let due: Vec<u64> = (0..10).filter(|&step| at.is_due(&Clock::at(step, 1e-7))).collect();
        assert_eq!(due, [0, 4]);
    }
}
