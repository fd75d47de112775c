//! Sets are decided by geometry, not by rounding: mirrored sets are mirrored, and hold what integers say, in any unit of length
//! and with any number of digits, as long as rounding is below 1 % of the spacing.

use std::f64::consts::PI;

use super::super::model::{self, Region};
use super::{Builder, Options};
use crate::case::{Case, read_text};
use crate::field::Vector;
use crate::geometry::{Cloud, Shape};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

struct Random(ChaCha8Rng);

impl Random {
    fn below(&mut self, n: u64) -> i64 {
        (self.0.next_u64() % n) as i64
    }
    /// In [0, 1).
    fn share(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// With so many digits that rounding is below 1 % of the spacing, or more; or with what doubles have.
fn printed(x: f64, spacing: f64, more: i64) -> f64 {
    // Half of the last place is less than 1 % of the spacing.
    let place = 10f64.powf((0.02 * spacing).log10().floor());
    match more {
        0..6 => (x / place * 10f64.powi(more as i32)).round() / 10f64.powi(more as i32) * place,
        _ => x,
    }
}

fn smallest() -> crate::case::Located<Case> {
    read_text::<Case>("smallest.toml", include_str!("../smallest.toml"), &[]).expect("a bundled case")
}

/// A plate of cells about the origin: a lattice, or a cloud of printed positions.
fn plate(counts: [i64; 2], spacing: f64, digits: Option<i64>) -> Cloud<2> {
    let high: Vector<2> = counts.map(|n| 0.5 * n as f64 * spacing);
    let shape = Shape::Box { low: high.map(|x| -x), high };
    let cloud = Cloud::lattice(&shape, spacing, 4);
    let Some(digits) = digits else { return cloud };
    let (mut positions, volumes): (Vec<_>, Vec<_>) =
        cloud.slots.iter().map(|&slot| (cloud.position(slot as usize), spacing * spacing)).unzip();
    positions.iter_mut().flatten().for_each(|x| *x = printed(*x, spacing, digits));
    Cloud::scattered(positions, volumes)
}

/// Of each point whether it is in a region, in rows along x.
fn members(cloud: &Cloud<2>, region: &Region, shape: &Shape<2>, builder: &Builder<'_, 2>) -> Vec<bool> {
    let inside = builder.region(region, Some(shape), "sets.tried").expect("a good region");
    let found = cloud.select_with_ties(|x, tie| inside(x, tie));
    cloud.slots.iter().map(|slot| found.binary_search(slot).is_ok()).collect()
}

fn mirrored(of: &[bool], [n, m]: [i64; 2]) -> Vec<bool> {
    (0..m).flat_map(|j| (0..n).map(move |i| of[(j * n + n - 1 - i) as usize])).collect()
}

#[test]
fn ten_thousand_sets_and_their_mirror_images() {
    let case = smallest();
    let options = Options::default();
    let builder = Builder::<2> { case: &case, options: &options, loads: Default::default() };
    let mut random = Random(ChaCha8Rng::seed_from_u64(7));
    for round in 0..10_000 {
        let unit = [1.0, 1e-3, 1e-9, 1e4, 0.3048, 1.0 / 3.0][random.below(6) as usize];
        let spacing = unit * [1.0, 0.1, 10.0 / 7.0, 2.5, 0.3 + random.share()][random.below(5) as usize];
        let counts = [6 + random.below(25), 6 + random.below(9)];
        let digits = random.below(8);
        let cloud = plate(counts, spacing, (round % 2 == 1).then_some(digits));
        let high: Vector<2> = counts.map(|n| 0.5 * n as f64 * spacing);
        let body = Shape::Box { low: high.map(|x| -x), high };
        let print = |x: f64| printed(x, spacing, digits);
        // In halves of a cell from the middle: points are at odd ones if their number is even.
        let half = |k: i64| 0.5 * k as f64 * spacing;
        let place = |k: i64, d: usize| 2 * k + 1 - counts[d];
        let all = || (0..counts[1]).flat_map(|j| (0..counts[0]).map(move |i| (place(i, 0), place(j, 1))));
        let (region, image, expected): (Region, Region, Vec<bool>) = match random.below(4) {
            0 => {
                let [a, b] = [0, 1].map(|_| random.below(counts[0] as u64 * 2) - counts[0]);
                let (a, b) = (a.min(b), a.max(b));
                let (c, d) = (-random.below(counts[1] as u64), random.below(counts[1] as u64));
                let make = |a: i64, b: i64| Region::Box {
                    low: vec![print(half(a)), print(half(c))],
                    high: vec![print(half(b)), print(half(d))],
                };
                let expected = all().map(|(x, y)| a <= x && x <= b && c <= y && y <= d).collect();
                (make(a, b), make(-b, -a), expected)
            }
            1 => {
                let thick = 1 + random.below(8);
                let make = || Region::Layer { thickness: print(half(thick)) };
                let depth = |x: i64, y: i64| (counts[0] - x.abs()).min(counts[1] - y.abs());
                (make(), make(), all().map(|(x, y)| depth(x, y) <= thick).collect())
            }
            2 => {
                // A disc whose rim passes through points, among others those of 3, 4, 5. Of larger ones, points are so near the
                // rim that coarse rounding may make them ties: 1² + 5² is beyond 5² by 5 % of a cell, 1² + 10² by 2.5 %.
                let (k, r) = (random.below(5), 2 + random.below(if digits > 0 { 4 } else { 3 }));
                let make = |k: i64| {
                    let center = Some(vec![print(half(k)), 0.0]);
                    Region::Inside(model::Shape::Disk { radius: print(half(r)), center })
                };
                let expected = all().map(|(x, y)| (x - k).pow(2) + y * y <= r * r).collect();
                (make(k), make(-k), expected)
            }
            _ => {
                // A square on its corner, cut out.
                let (k, r) = (random.below(5), 2 + random.below(9));
                let make = |k: i64| {
                    let corner = |x: i64, y: i64| vec![print(half(x)), print(half(y))];
                    let vertices = vec![corner(k - r, 0), corner(k, -r), corner(k + r, 0), corner(k, r)];
                    Region::Not(Box::new(Region::Inside(model::Shape::Polygon { vertices })))
                };
                let expected = all().map(|(x, y)| (x - k).abs() + y.abs() > r).collect();
                (make(k), make(-k), expected)
            }
        };
        let found = members(&cloud, &region, &body, &builder);
        let about = || format!("round {round}: {counts:?} cells of {spacing} m, {digits} digits more, {region:?}");
        assert_eq!(found, expected, "{}", about());
        let image = members(&cloud, &image, &body, &builder);
        assert_eq!(mirrored(&found, counts), image, "{}", about());
    }
}

#[test]
fn shapes_take_the_cells_on_their_border_on_every_side() {
    for unit in [1.0, 1e-3, 1e-9, 0.3048] {
        let h = 10.0 / 7.0 * unit;
        // 21 cells across: centres lie on the rim where 3, 4, 5 and its kin say so.
        let cloud = Cloud::<2>::lattice(&Shape::Ball { center: [0.0; 2], radius: printed(10.5 * h, h, 0) }, h, 3);
        let within = |(i, j): (i64, i64)| (i * i + j * j) as f64 <= 10.5 * 10.5;
        let expected = (-11..=11).flat_map(|i| (-11..=11).map(move |j| (i, j))).filter(|&at| within(at)).count();
        assert_eq!(cloud.n_points(), expected, "{unit}");
        let turned = (0..4).map(|k| {
            let angle = 0.5 * PI * f64::from(k);
            [angle.cos(), angle.sin()].map(|x| printed(10.0 * h * x, h, 1))
        });
        let square = Shape::Polygon { vertices: turned.collect() };
        // The box of 20 cells has its points at odd halves: |i| + |j| ≤ 20 in halves.
        let cloud = Cloud::<2>::lattice(&square, h, 3);
        let odd = || (-10i64..10).map(|i| 2 * i + 1);
        let expected = odd().flat_map(|i| odd().map(move |j| i.abs() + j.abs())).filter(|&sum| sum <= 20).count();
        assert_eq!(cloud.n_points(), expected, "{unit}");
    }
}
