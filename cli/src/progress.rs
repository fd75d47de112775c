//! The progress line: live on a terminal, a plain line now and then elsewhere.

use std::time::{Duration, Instant};

use bondwise::simulation::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::say;

/// Shows step, time, rate, time left, imbalance and, where bonds can break, how many have and how near the others are to it.
pub struct Line {
    bar: Option<ProgressBar>,
    quiet: bool,
    last: Instant,
    last_tenth: u64,
}

impl Line {
    pub fn new(quiet: bool) -> Self {
        let terminal = std::io::IsTerminal::is_terminal(&std::io::stderr());
        let bar = (terminal && !quiet).then(|| {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template("[{elapsed_precise}] {bar:30} {msg}") {
                bar.set_style(style);
            }
            bar
        });
        Line { bar, quiet, last: Instant::now(), last_tenth: 0 }
    }

    pub fn show(&mut self, p: &Progress) {
        if self.quiet {
            return;
        }
        let tenth = 10 * p.step / p.n_steps.max(1);
        match &self.bar {
            // Ten times a second is as fast as anybody reads.
            Some(bar) if self.last.elapsed() > Duration::from_millis(100) || p.step == p.n_steps => {
                self.last = Instant::now();
                bar.set_length(p.n_steps);
                bar.set_position(p.step);
                bar.set_message(text(p));
            }
            // In a file: every tenth of the way, and at least every minute.
            None if tenth > self.last_tenth || self.last.elapsed() > Duration::from_secs(60) => {
                self.last = Instant::now();
                self.last_tenth = tenth;
                say!("{}", text(p));
            }
            _ => {}
        }
    }

    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

fn text(p: &Progress) -> String {
    let rate = p.step as f64 / p.seconds.max(1e-9);
    let broken = p.broken_bonds.map_or(String::new(), |broken| format!("  broken {broken}"));
    let left = (p.n_steps - p.step) as f64 / rate.max(1e-9);
    if let Some((iterations, imbalance)) = p.within {
        return format!(
            "step {}/{}  t {:.4e} s  iteration {iterations} of the next, forces out of balance by {imbalance:.1e}{broken}",
            p.step, p.n_steps, p.time
        );
    }
    let stretched = p.stretch_ratio.map_or(String::new(), |ratio| format!("  stretch {ratio:.2} of critical"));
    format!(
        "step {}/{}  t {:.4e} s  {:.0} steps/s  {} left  imbalance {:.1e}{broken}{stretched}",
        p.step,
        p.n_steps,
        p.time,
        rate,
        clock(left),
        p.imbalance
    )
}

fn clock(seconds: f64) -> String {
    let s = seconds.round() as u64;
    if s < 3600 {
        format!("{}:{:02}", s / 60, s % 60)
    } else {
        format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
    }
}
