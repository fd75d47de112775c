//! The crack tip: the damaged point farthest along a direction, and how fast it runs.

use rayon::prelude::*;

use super::source::{Source, scalar};
use crate::field::{dot, norm};

/// Points that a thread looks at at a time.
const CHUNK: usize = 16 * 1024;

/// Follows the farthest point with φ above a threshold.
///
/// Its speed at t is the slope of a straight line fitted to the tip's way over the last window, twenty times the
/// time that a bar wave needs to cross a horizon: the tip jumps from point to point, and a shorter window would
/// measure the jumps.
#[derive(Debug, Clone)]
pub struct CrackTip {
    along: [f64; 3],
    threshold: f64,
    /// s
    window: f64,
    way: Vec<(f64, f64)>,
    pub position: Option<[f64; 3]>,
    /// m/s
    pub speed: f64,
    pub largest_speed: f64,
}

impl CrackTip {
    /// `along` need not have length one.
    pub fn new(along: [f64; 3], threshold: f64, window: f64) -> Self {
        let length = norm(&along);
        CrackTip {
            along: along.map(|a| a / length),
            threshold,
            window,
            way: Vec::new(),
            position: None,
            speed: 0.0,
            largest_speed: 0.0,
        }
    }

    /// Looks at the damage now, t in s. Of points equally far, the first in point order is the tip.
    pub fn follow(&mut self, source: &mut dyn Source, t: f64) {
        let Some(damage) = source.field("damage") else { return };
        self.look(source.positions(), &scalar(damage, None), t);
    }

    /// As [`CrackTip::follow`], where the damage is at hand.
    pub fn look(&mut self, positions: &[[f64; 3]], damage: &[f64], t: f64) {
        let Some((s, point)) = self.farthest(positions, damage) else { return };
        self.position = Some(positions[point]);
        self.way.push((t, s));
        self.way.retain(|(when, _)| *when >= t - self.window);
        // Half a window is the least that a slope is taken from.
        let span = t - self.way[0].0;
        self.speed = if span >= 0.5 * self.window { slope(&self.way) } else { 0.0 };
        self.largest_speed = self.largest_speed.max(self.speed);
    }

    /// How far the farthest damaged point is along the direction, m, and which it is.
    fn farthest(&self, positions: &[[f64; 3]], damage: &[f64]) -> Option<(f64, usize)> {
        let farther = |best: Option<(f64, usize)>, (s, i): (f64, usize)| {
            if best.is_none_or(|(farthest, _)| s > farthest) { Some((s, i)) } else { best }
        };
        let in_chunk = |(chunk, (positions, damage)): (usize, (&[[f64; 3]], &[f64]))| {
            let damaged = damage.iter().enumerate().filter(|(_, d)| **d > self.threshold);
            damaged.map(|(i, _)| (dot(&positions[i], &self.along), chunk * CHUNK + i)).fold(None, farther)
        };
        let chunks = positions.par_chunks(CHUNK).zip(damage.par_chunks(CHUNK)).enumerate();
        let found: Vec<Option<(f64, usize)>> = chunks.map(in_chunk).collect();
        found.into_iter().flatten().fold(None, farther)
    }
}

/// Slope of the least-squares line.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let mean = points.iter().fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
    let (mut sxy, mut sxx) = (0.0, 0.0);
    for p in points {
        sxy += (p.0 - mean.0) * (p.1 - mean.1);
        sxx += (p.0 - mean.0).powi(2);
    }
    if sxx > 0.0 { sxy / sxx } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slope_of_a_line_is_exact() {
        let line: Vec<_> = (0..5).map(|k| (f64::from(k) * 1e-6, 3.0 + 1500.0 * f64::from(k) * 1e-6)).collect();
        assert!((slope(&line) - 1500.0).abs() < 1e-6);
        assert_eq!(slope(&line[..1]), 0.0);
    }

    #[test]
    fn of_points_equally_far_the_first_is_the_tip_whichever_thread_meets_it() {
        let n = 3 * CHUNK;
        let at = |i: usize| if i % CHUNK == 7 { 2.0 } else { 1.0 };
        let positions: Vec<[f64; 3]> = (0..n).map(|i| [at(i), i as f64, 0.0]).collect();
        let mut damage = vec![0.0; n];
        let mut tip = CrackTip::new([1.0, 0.0, 0.0], 0.35, 1.0);
        tip.look(&positions, &damage, 0.0);
        assert_eq!(tip.position, None);
        damage[CHUNK..].fill(1.0);
        tip.look(&positions, &damage, 0.0);
        assert_eq!(tip.position, Some(positions[CHUNK + 7]));
    }
}
