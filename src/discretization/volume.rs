//! Partial volumes: which part of a neighbour's cell lies inside the horizon.
//!
//! One-point quadrature gives a bond the weight β V of the neighbour's cell. The cell is an
//! interval, a square or a cube of side h with its faces along the axes, and the sphere |ξ| = δ
//! cuts the outermost cells. How β follows the cut decides the accuracy of the scheme more than
//! anything else: counting the point at |ξ| = δ in full makes a bar with m = δ/h too stiff by 1/m.
//!
//! Every rule is symmetric to the bit under reflections and permutations of the axes, because a
//! symmetric problem has to stay symmetric, and every rule treats distances on its edges with
//! [`RIM_TOLERANCE`], because on a lattice points do lie on the edge and rounding must not choose.
//!
//! Deliberately absent: moving the quadrature point to the centroid of the part inside.

use std::ops::Range;
use std::sync::OnceLock;

use super::quadrature::gauss_legendre;

/// Relative distance within which a length counts as being on the edge of a rule.
///
/// Far above the rounding of a coordinate difference (about 1e-16 times domain size over horizon),
/// far below any spacing.
pub const RIM_TOLERANCE: f64 = 1e-9;

/// Rule for the volume fraction β of a neighbour's cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartialVolume {
    /// Full volume inside: β = 1 if |ξ| ≤ δ, else 0.
    None,
    /// Linear ramp over one spacing about the rim,
    ///
    /// ```text
    /// β = 1                        |ξ| ≤ δ − h/2
    ///   = (δ + h/2 − |ξ|)/h        between
    ///   = 0                        |ξ| ≥ δ + h/2
    /// ```
    ///
    /// Shojaei et al. 2022, eq. (28).
    Ramp,
    /// The exact part of the cell inside the ball; Seleson 2014 (there for the plane, "PA-AC").
    ///
    /// Closed form in 1D and 2D. In 3D some hundreds of closed-form slices a cut cell, so meant for
    /// shared stencils and for set-up, not for the inside of a loop.
    Exact,
}

impl PartialVolume {
    /// Every rule once.
    pub const ALL: [PartialVolume; 3] = [PartialVolume::None, PartialVolume::Ramp, PartialVolume::Exact];

    /// Name in case files and lists.
    pub fn name(&self) -> &'static str {
        match self {
            PartialVolume::None => "none",
            PartialVolume::Ramp => "ramp",
            PartialVolume::Exact => "exact",
        }
    }

    /// Distance beyond which no point contributes: δ, δ + h/2, δ + h √D/2.
    ///
    /// The radius of a neighbour search. Rounding at the edge is covered: `None` includes its
    /// tolerance, and the other two give β = 0 there. `spacing` is h, `horizon` is δ, both in m.
    pub fn reach<const D: usize>(&self, spacing: f64, horizon: f64) -> f64 {
        match self {
            PartialVolume::None => horizon * (1.0 + RIM_TOLERANCE),
            PartialVolume::Ramp => horizon + 0.5 * spacing,
            PartialVolume::Exact => horizon + 0.5 * spacing * (D as f64).sqrt(),
        }
    }

    /// Distances between which only [`touches`](Self::touches) knows whether β > 0: at less it is, beyond it is not.
    pub fn rim<const D: usize>(&self, spacing: f64, horizon: f64) -> Range<f64> {
        let start = match self {
            PartialVolume::None | PartialVolume::Exact => horizon,
            PartialVolume::Ramp => (horizon + 0.5 * spacing) * (1.0 - 2.0 * RIM_TOLERANCE),
        };
        start..self.reach::<D>(spacing, horizon)
    }

    /// Whether any of the cell lies inside the ball: β > 0, up to rounding, without the work for β itself.
    pub fn touches<const D: usize>(&self, xi: &[f64; D], spacing: f64, horizon: f64) -> bool {
        match self {
            PartialVolume::None | PartialVolume::Ramp => self.fraction(xi, spacing, horizon) > 0.0,
            PartialVolume::Exact => nearest(sorted(xi), spacing) < horizon * (1.0 - RIM_TOLERANCE),
        }
    }

    /// How far a cell at ξ lies beyond the edge of the rule, m: about 0 it is on it.
    pub fn beyond<const D: usize>(&self, xi: &[f64; D], spacing: f64, horizon: f64) -> f64 {
        match self {
            PartialVolume::None => norm(sorted(xi)) - horizon,
            PartialVolume::Ramp => norm(sorted(xi)) - (horizon + 0.5 * spacing),
            PartialVolume::Exact => nearest(sorted(xi), spacing) - horizon,
        }
    }

    /// Up to which of these it touches: a cell on the edge counts if cells count whole, and has nothing inside if not.
    pub fn edge<const D: usize>(&self, spacing: f64, horizon: f64) -> f64 {
        match self {
            PartialVolume::None => horizon * RIM_TOLERANCE,
            PartialVolume::Ramp => -(horizon + 0.5 * spacing) * RIM_TOLERANCE,
            PartialVolume::Exact => -horizon * RIM_TOLERANCE,
        }
    }

    /// β where it follows from |ξ| alone; else None.
    pub fn radial(&self, length: f64, spacing: f64, horizon: f64) -> Option<f64> {
        match self {
            PartialVolume::None => Some(if length <= horizon * (1.0 + RIM_TOLERANCE) { 1.0 } else { 0.0 }),
            PartialVolume::Ramp => Some(ramp(length, spacing, horizon)),
            PartialVolume::Exact => None,
        }
    }

    /// Volume fraction β of the cell of side `spacing` centred at `xi` from the source, for the
    /// ball of radius `horizon`.
    ///
    /// Between 0 and 1, without unit; the weight of the bond is β V. On a cloud without a lattice,
    /// `spacing` is the neighbour's V^(1/D).
    pub fn fraction<const D: usize>(&self, xi: &[f64; D], spacing: f64, horizon: f64) -> f64 {
        let distances = sorted(xi);
        let radial = self.radial(norm(distances), spacing, horizon);
        radial.unwrap_or_else(|| exact(distances, spacing, horizon))
    }
}

/// Absolute values in order: images under the symmetries of the lattice become the same numbers.
fn sorted<const D: usize>(xi: &[f64; D]) -> [f64; D] {
    let mut distances = xi.map(f64::abs);
    distances.sort_by(f64::total_cmp);
    distances
}

fn norm<const D: usize>(xi: [f64; D]) -> f64 {
    xi.iter().map(|x| x * x).sum::<f64>().sqrt()
}

pub(super) fn ramp(length: f64, spacing: f64, horizon: f64) -> f64 {
    let (inner, outer) = (horizon - 0.5 * spacing, horizon + 0.5 * spacing);
    if length <= inner * (1.0 + RIM_TOLERANCE) {
        1.0
    } else if length >= outer * (1.0 - RIM_TOLERANCE) {
        0.0
    } else {
        ((outer - length) / spacing).min(1.0)
    }
}

fn exact<const D: usize>(centre: [f64; D], spacing: f64, horizon: f64) -> f64 {
    let half = 0.5 * spacing;
    if norm(centre.map(|x| x + half)) <= horizon * (1.0 + RIM_TOLERANCE) {
        return 1.0;
    }
    if nearest(centre, spacing) >= horizon * (1.0 - RIM_TOLERANCE) {
        return 0.0;
    }
    let side = |i: usize| (centre[i] - half, centre[i] + half);
    let inside = match D {
        1 => interval_in_segment(side(0), horizon),
        2 => rectangle_in_disk(side(0), side(1), horizon),
        3 => box_in_ball(side(0), side(1), side(2), horizon),
        _ => unreachable!("space has one, two or three dimensions, got {D}"),
    };
    (inside / spacing.powi(D as i32)).clamp(0.0, 1.0)
}

/// Distance of the nearest point of a cell.
fn nearest<const D: usize>(centre: [f64; D], spacing: f64) -> f64 {
    norm(centre.map(|x| (x - 0.5 * spacing).max(0.0)))
}

/// Length of the interval inside [−δ, δ].
fn interval_in_segment((low, high): (f64, f64), radius: f64) -> f64 {
    (high.min(radius) - low.max(-radius)).max(0.0)
}

/// Area of a rectangle inside the disk about the origin, from the four rectangles that its corners
/// span with the centre.
fn rectangle_in_disk((x0, x1): (f64, f64), (y0, y1): (f64, f64), radius: f64) -> f64 {
    let corner = |x, y| corner_in_disk(x, y, radius);
    (corner(x1, y1) - corner(x0, y1)) - (corner(x1, y0) - corner(x0, y0))
}

/// Signed area of [0, x] × [0, y] inside the disk, odd in x and in y.
fn corner_in_disk(x: f64, y: f64, radius: f64) -> f64 {
    let (a, b) = (x.abs().min(radius), y.abs().min(radius));
    let area = if a * a + b * b <= radius * radius {
        a * b
    } else {
        // Under the edge y = b as far as it stays inside the disk, under the circle from there on.
        let leaves = half_chord(b, radius);
        b * leaves + under_circle(a, radius) - under_circle(leaves, radius)
    };
    area.copysign(x * y)
}

/// √(R² − x²), without cancellation near x = R.
fn half_chord(x: f64, radius: f64) -> f64 {
    ((radius - x) * (radius + x)).max(0.0).sqrt()
}

/// ∫₀ˣ √(R² − t²) dt; `atan2` rather than `asin`, which loses half the digits near x = R.
fn under_circle(x: f64, radius: f64) -> f64 {
    let y = half_chord(x, radius);
    0.5 * (x * y + radius * radius * x.atan2(y))
}

/// Volume of a box inside the ball about the origin: exact areas of its slices, integrated along z.
///
/// The area of a slice is smooth in z but for half-integer powers at the heights where the circle
/// of the slice starts to touch an edge or a corner of the rectangle. Between two such heights,
/// z = z₀ + (z₁ − z₀) sin²θ makes polynomials of the powers at both ends, whether or not the box
/// reaches them, so that [`SLICES`] Gauss points in θ suffice.
fn box_in_ball(x: (f64, f64), y: (f64, f64), z: (f64, f64), radius: f64) -> f64 {
    static RULE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    let rule = RULE.get_or_init(|| gauss_legendre(SLICES));

    let mut heights = [0.0; 18];
    let corners = [0.0, x.0, x.1].map(|a| [0.0, y.0, y.1].map(|b| (a, b)));
    for (i, (a, b)) in corners.into_iter().flatten().enumerate() {
        let height = (radius * radius - a * a - b * b).max(0.0).sqrt();
        (heights[2 * i], heights[2 * i + 1]) = (-height, height);
    }
    heights.sort_by(f64::total_cmp);

    let piece = |z0: f64, z1: f64| -> f64 {
        let angle = |height: f64| {
            let height = height.clamp(z0, z1);
            (height - z0).sqrt().atan2((z1 - height).sqrt())
        };
        let (from, to) = (angle(z.0), angle(z.1));
        if from >= to {
            return 0.0;
        }
        let slice = |theta: f64| {
            let height = z0 + (z1 - z0) * theta.sin().powi(2);
            (2.0 * theta).sin() * rectangle_in_disk(x, y, half_chord(height.abs(), radius))
        };
        let sum: f64 = rule.iter().map(|&(t, weight)| weight * slice(from + (to - from) * t)).sum();
        (z1 - z0) * (to - from) * sum
    };
    heights.windows(2).map(|pair| piece(pair[0], pair[1])).sum()
}

/// Gauss points between two heights. What error there is comes from pairs of heights that nearly
/// coincide and falls with the eighth power of this number; over 24 000 cells on and off a lattice
/// the largest was 7e-14 of the cell.
const SLICES: usize = 48;

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Σ β over the lattice, for h = 1.
    fn lattice_sum<const D: usize>(rule: PartialVolume, horizon: f64) -> f64 {
        let range = horizon as i32 + 2;
        let side = (2 * range + 1) as usize;
        (0..side.pow(D as u32))
            .map(|index| {
                let xi =
                    std::array::from_fn::<f64, D, _>(|i| f64::from((index / side.pow(i as u32) % side) as i32 - range));
                rule.fraction(&xi, 1.0, horizon)
            })
            .sum()
    }

    #[test]
    fn exact_fractions_tile_the_ball() {
        for m in [0.3, 0.5, 0.8, 1.0, 1.5, 2.0, 3.0, 3.015, 4.0, 5.0] {
            let sums = [
                (lattice_sum::<1>(PartialVolume::Exact, m), 2.0 * m),
                (lattice_sum::<2>(PartialVolume::Exact, m), PI * m.powi(2)),
                (lattice_sum::<3>(PartialVolume::Exact, m), 4.0 / 3.0 * PI * m.powi(3)),
            ];
            for (sum, ball) in sums {
                assert!((sum - ball).abs() < 1e-12 * ball, "m={m}: {sum} against {ball}");
            }
        }
    }

    #[test]
    fn exact_fractions_of_a_cell_agree_with_subdivision() {
        // A cell cut into n³ cells of the same kind: the sum of the parts does not know where the
        // cuts of the whole lie.
        // The last cell has faces almost through the source, the hardest of many tried.
        for (xi, horizon) in [
            ([0.3, 0.2, 2.9], 3.0),
            ([2.0, 2.0, 1.0], 3.0),
            ([0.0, 0.0, 3.0], 3.0),
            ([1.7, 1.7, 1.7], 3.0),
            ([0.0, 2.0, 2.2], 3.0),
            ([0.592011531, 0.492372886, 0.485106656], 0.7),
        ] {
            let whole = PartialVolume::Exact.fraction(&xi, 1.0, horizon);
            let n: i32 = 6;
            let mut sum = 0.0;
            for index in 0..n * n * n {
                let offset = |i: i32| (f64::from(index / n.pow(i as u32) % n) + 0.5) / f64::from(n) - 0.5;
                let part = [xi[0] + offset(0), xi[1] + offset(1), xi[2] + offset(2)];
                sum += PartialVolume::Exact.fraction(&part, 1.0 / f64::from(n), horizon);
            }
            let parts = sum / f64::from(n * n * n);
            assert!((whole - parts).abs() < 1e-12, "{xi:?}: {whole} against {parts}");
        }
    }

    #[test]
    fn exact_fractions_of_simple_cuts_are_known() {
        let exact = PartialVolume::Exact;
        // Cell centred on the rim of a ball so large that its surface is a plane to second order.
        assert!((exact.fraction(&[3.0], 1.0, 3.0) - 0.5).abs() < 1e-15);
        assert!((exact.fraction(&[0.0, 1e5], 1.0, 1e5) - 0.5).abs() < 1e-5);
        assert!((exact.fraction(&[0.0, 1e4, 0.0], 1.0, 1e4) - 0.5).abs() < 1e-4);
        // The ball inside its own cell, and one eighth of it.
        assert!((exact.fraction(&[0.0, 0.0], 1.0, 0.5) - PI / 4.0).abs() < 1e-15);
        assert!((exact.fraction(&[0.0; 3], 1.0, 0.5) - PI / 6.0).abs() < 1e-14);
        assert!((exact.fraction(&[0.5; 3], 1.0, 1.0) - PI / 6.0).abs() < 1e-14);
    }

    #[test]
    fn ramp_is_the_printed_formula() {
        let beta = |length: f64| PartialVolume::Ramp.fraction(&[length, 0.0], 0.1, 0.3);
        assert_eq!(beta(0.25), 1.0);
        assert!((beta(0.3) - 0.5).abs() < 1e-14);
        assert!((beta(0.34) - 0.1).abs() < 1e-13);
        assert_eq!(beta(0.35), 0.0);
    }

    #[test]
    fn rounding_at_an_edge_never_decides() {
        let edges = [(PartialVolume::None, 3.0, 1.0), (PartialVolume::Ramp, 2.5, 1.0), (PartialVolume::Ramp, 3.5, 0.0)];
        for (rule, edge, beta) in edges {
            for noise in [-1e-12, 0.0, 1e-12] {
                assert_eq!(rule.fraction(&[edge + noise, 0.0], 1.0, 3.0), beta, "{rule:?} {edge} {noise}");
            }
        }
        for noise in [-1e-12, 0.0, 1e-12] {
            assert_eq!(PartialVolume::Exact.fraction(&[2.5 + noise], 1.0, 3.0), 1.0);
            assert_eq!(PartialVolume::Exact.fraction(&[0.0, 3.5 + noise], 1.0, 3.0), 0.0);
        }
    }

    #[test]
    fn images_of_a_bond_have_the_same_fraction_to_the_bit() {
        let horizon = 3.1;
        for rule in PartialVolume::ALL {
            for step in 0..200 {
                let s = f64::from(step);
                let (x, y, z) = (2.2 * (0.7 * s).sin(), 2.4 * (1.3 * s).cos(), 2.0 * (2.1 * s).sin());
                let beta = rule.fraction(&[x, y, z], 0.9, horizon).to_bits();
                let flat = rule.fraction(&[x, y], 0.9, horizon).to_bits();
                for (a, b, c) in [(x, y, z), (y, x, z), (z, y, x), (y, z, x)] {
                    for sign in [[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0], [1.0, -1.0, 1.0]] {
                        let image = [sign[0] * a, sign[1] * b, sign[2] * c];
                        assert_eq!(rule.fraction(&image, 0.9, horizon).to_bits(), beta, "{rule:?} {image:?}");
                    }
                }
                assert_eq!(rule.fraction(&[-y, x], 0.9, horizon).to_bits(), flat, "{rule:?}");
            }
        }
    }

    #[test]
    fn a_cell_touches_the_ball_where_its_fraction_is_above_zero() {
        fn check<const D: usize>(rule: PartialVolume) {
            let (spacing, horizon) = (0.7, 2.3);
            let rim = rule.rim::<D>(spacing, horizon);
            let rule_at = |xi: &[f64; D]| {
                let beta = rule.fraction(xi, spacing, horizon);
                assert_eq!(rule.touches(xi, spacing, horizon), beta > 0.0, "{rule:?} {xi:?}");
                assert!(beta > 0.0 || norm(*xi) > rim.start, "{rule:?} {xi:?}");
                // `fraction` adds the squares in another order.
                assert!(beta == 0.0 || norm(*xi) <= rim.end * (1.0 + 4.0 * f64::EPSILON), "{rule:?} {xi:?}");
            };
            for step in 1..4000 {
                let s = f64::from(step);
                let xi: [f64; 3] = [3.0 * (0.7 * s).sin(), 3.0 * (1.3 * s).cos(), 3.0 * (2.1 * s).sin()];
                let xi: [f64; D] = std::array::from_fn(|d| xi[d]);
                rule_at(&xi);
                let to_edge = |r: f64| xi.map(|x| x * r / norm(xi));
                for edge in [horizon, rim.start, rim.end] {
                    for noise in [-1e-6, -1e-12, 0.0, 1e-12, 1e-6] {
                        rule_at(&to_edge(edge + noise));
                    }
                }
            }
        }
        for rule in PartialVolume::ALL {
            check::<1>(rule);
            check::<2>(rule);
        }
        check::<3>(PartialVolume::None);
        check::<3>(PartialVolume::Ramp);
    }

    #[test]
    fn nothing_contributes_beyond_reach() {
        fn check<const D: usize>(rule: PartialVolume, direction: [f64; D]) {
            let (spacing, horizon) = (0.7, 2.3);
            let length = norm(direction);
            let at = |r: f64| rule.fraction(&direction.map(|x| x * r / length), spacing, horizon);
            let reach = rule.reach::<D>(spacing, horizon);
            assert_eq!(at(reach * (1.0 + 1e-12) + 1e-8), 0.0, "{rule:?}");
            for step in 0..100 {
                assert_eq!(at(reach * (1.001 + 0.01 * f64::from(step))), 0.0, "{rule:?}");
            }
        }
        for rule in PartialVolume::ALL {
            check(rule, [1.0]);
            check(rule, [1.0, 1.0]);
            check(rule, [0.3, 1.0]);
            check(rule, [1.0, 1.0, 1.0]);
            check(rule, [0.2, 0.0, 1.0]);
        }
    }
}
