//! Three-dimensional clouds: each point a small cube, seen from afar.
//!
//! The projection is orthographic, so lengths can be compared. A depth per pixel
//! decides what is in front, whatever the order in which cubes are drawn; so each
//! thread draws a band of the picture. Cubes behind what is drawn already are found
//! by blocks of pixels and skipped, so that a body costs what its surface costs.
//! Faces are lit from the upper left, and pixels in clefts and behind edges are
//! darkened (after Boucheny, "Visualisation scientifique de grands volumes de
//! données", thesis, Grenoble 2009: eye-dome lighting), so that a shape reads even where the
//! field is constant.

use std::ops::Range;

use rayon::prelude::*;

use super::axes::Measure;
use super::canvas::{Align, Area, BLACK, Color, Image, WHITE};
use super::cubes::{Cube, Depths, Shown, Splat};
use super::picture::{CloudView, ColorScale, View};
use super::relief::{NOTHING, Relief};
use super::ticks::{drawable, quantity, round_step, span, widened};

/// The directions of a view: to the right and up on the screen, and towards the viewer.
pub(super) struct Sight {
    pub right: [f64; 3],
    pub up: [f64; 3],
    pub towards: [f64; 3],
}

/// The pixels that a cloud is drawn on.
pub(super) struct Screen {
    pub columns: usize,
    pub rows: usize,
    /// What is in the middle \[m\], to the right and up.
    pub centre: [f64; 2],
    /// Pixels per metre.
    pub per_length: f64,
}

impl Sight {
    pub fn new(view: View) -> Self {
        let angle = |degrees: f64| {
            if drawable(degrees) { degrees.to_radians() } else { 0.0 }
        };
        let (sin_a, cos_a) = angle(view.azimuth).sin_cos();
        let (sin_e, cos_e) = angle(view.elevation).sin_cos();
        Self {
            right: [-sin_a, cos_a, 0.0],
            up: [-sin_e * cos_a, -sin_e * sin_a, cos_e],
            towards: [cos_e * cos_a, cos_e * sin_a, sin_e],
        }
    }

    /// The height that [`draw_triad`] takes \[pixels\].
    pub fn triad_height(&self, measure: Measure) -> f64 {
        let (length, margin) = triad_sizes(measure);
        let [low, high] = span(self.up.into_iter().chain([0.0])).unwrap_or([0.0, 1.0]);
        (high - low) * length + 2.0 * margin
    }

    /// Ranges \[m\] to the right and up that the cloud, or the given box, covers.
    pub fn extent(&self, cloud: &CloudView<'_>, bounds: Option<[[f64; 3]; 2]>) -> [[f64; 2]; 2] {
        let directions = [self.right, self.up];
        let padded = |[low, high]: [f64; 2]| {
            let padding = 0.03 * (high - low);
            [low - padding, high + padding]
        };
        if let Some(corners) = bounds {
            return directions.map(|direction| {
                let corner = |i: usize| (0..3).map(|k| corners[(i >> k) & 1][k] * direction[k]).sum::<f64>();
                padded(widened(span((0..8).map(corner)).unwrap_or([0.0, 1.0])))
            });
        }
        directions.map(|direction| {
            // How far a cube of edge 1 reaches in this direction.
            let reach = 0.5 * direction.iter().map(|d| d.abs()).sum::<f64>();
            let ends =
                |sign: f64| span_of(cloud.positions, |i, x| dot(*x, direction) + sign * (reach * cloud.sizes.at(i)));
            let range = span([ends(-1.0), ends(1.0)].into_iter().flatten().flatten()).unwrap_or([0.0, 1.0]);
            padded(widened(range))
        })
    }
}

#[inline]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Draws the cubes; the pixels come row by row from the top, white where there is nothing.
pub(super) fn painted(sight: &Sight, screen: &Screen, cloud: &CloudView<'_>, scale: &ColorScale) -> Vec<Color> {
    let mut canvas = Depths::new(screen);
    let cube = Cube::new(sight);
    let parts = from_front_to_back(sight, screen, cloud);
    canvas.bands(rayon::current_num_threads()).into_par_iter().for_each(|mut band| {
        for slab in 0..SLABS {
            for splat in parts.iter().flat_map(|part| &part[slab]) {
                band.draw(splat, &cube);
            }
        }
    });
    drop(parts);
    shaded(&canvas, sight, screen, cloud, scale)
}

/// Points are drawn in slabs of equal depth range, the nearest first: what hides much is drawn early.
const SLABS: usize = 8 * RANKS;
/// Coarser slabs, by which faces at the same depth are ranked.
const RANKS: usize = 24;
/// Points that a thread projects at a time.
const CHUNK: usize = 1 << 16;

/// The points of each chunk in slabs, the nearest slab first.
fn from_front_to_back(sight: &Sight, screen: &Screen, cloud: &CloudView<'_>) -> Vec<Vec<Vec<Splat>>> {
    let middle = [0.5 * screen.columns as f64, 0.5 * screen.rows as f64];
    let [back, front] = widened(span_of(cloud.positions, |_, x| dot(*x, sight.towards)).unwrap_or([0.0, 1.0]));
    let projected = |(chunk, positions): (usize, &[[f64; 3]])| {
        let mut slabs: Vec<Vec<Splat>> = (0..SLABS).map(|_| Vec::new()).collect();
        for (i, position) in positions.iter().enumerate() {
            let i = chunk * CHUNK + i;
            let right = (dot(*position, sight.right) - screen.centre[0]) * screen.per_length;
            let up = (dot(*position, sight.up) - screen.centre[1]) * screen.per_length;
            let depth = dot(*position, sight.towards);
            if !(drawable(right) && drawable(up) && drawable(depth)) {
                continue;
            }
            // A pixel wider than the spacing, so that a stretched body stays closed;
            // a point without size still shows.
            let edge = (cloud.sizes.at(i) * screen.per_length + 1.0).min(1e5);
            let share = (front - depth) / (front - back);
            slabs[((share * SLABS as f64) as usize).min(SLABS - 1)].push(Splat {
                point: i as u32,
                rank: ((share * RANKS as f64) as usize).min(RANKS - 1) as u8,
                centre: [middle[0] + right, middle[1] - up],
                depth: (depth - back) * screen.per_length,
                edge,
            });
        }
        slabs
    };
    cloud.positions.par_chunks(CHUNK).enumerate().map(projected).collect()
}

/// The lowest and the highest value, of those that can be drawn, of a number of each point.
fn span_of(positions: &[[f64; 3]], value: impl Fn(usize, &[f64; 3]) -> f64 + Sync) -> Option<[f64; 2]> {
    let in_chunk = |(chunk, positions): (usize, &[[f64; 3]])| {
        span(positions.iter().enumerate().map(|(i, x)| value(chunk * CHUNK + i, x)))
    };
    let parts: Vec<_> = positions.par_chunks(CHUNK).enumerate().map(in_chunk).collect();
    span(parts.into_iter().flatten().flatten())
}

/// Where the light comes from, on the screen.
fn light() -> [f64; 3] {
    normalized([-0.45, 0.65, 0.75])
}

/// The brightness of a surface with this normal, as seen on the screen.
#[inline]
fn lit(normal: [f64; 3], light: [f64; 3]) -> f64 {
    0.6 + 0.4 * dot(normal, light).max(0.0)
}

#[inline]
fn normalized([x, y, z]: [f64; 3]) -> [f64; 3] {
    let length = dot([x, y, z], [x, y, z]).sqrt();
    [x / length, y / length, z / length]
}

/// The colours of what is drawn, lit from the upper left and darkened in clefts.
fn shaded(canvas: &Depths, sight: &Sight, screen: &Screen, cloud: &CloudView<'_>, scale: &ColorScale) -> Vec<Color> {
    let (columns, source) = (screen.columns, light());
    let faces: [f64; 3] = std::array::from_fn(|k| {
        let normal = [sight.right[k], sight.up[k], sight.towards[k]];
        // The face that is turned to the viewer.
        let sign = if sight.towards[k] < 0.0 { -1.0 } else { 1.0 };
        lit(normal.map(|c| sign * c), source)
    });
    let mut pixels = vec![WHITE; columns * screen.rows];
    let lines = pixels.par_chunks_mut(columns.max(1)).enumerate();
    lines.for_each_init(Relief::default, |relief, (row, line)| {
        let shown = &canvas.shown[row * columns..][..columns];
        let depth = canvas.map.row(row);
        let edge = |column: usize| cloud.sizes.at(shown[column].point as usize) * screen.per_length;
        for (run, edge) in runs((0..columns).filter(|&i| depth[i] != NOTHING).map(|i| (i, edge(i)))) {
            relief.look(&canvas.map, row, run, edge);
        }
        for column in (0..columns).filter(|&i| depth[i] != NOTHING) {
            let Shown { point, face, .. } = shown[column];
            let level = faces[usize::from(face)];
            let [right, up] = [relief.right[column], relief.up[column]];
            let told = !(right.is_nan() || up.is_nan());
            let smooth = if told { lit(normalized([-right, -up, 1.0]), source) } else { level };
            let light = 0.5 * (level + smooth) * (1.0 - 0.5 * relief.closed[column].sqrt());
            let full = scale.colors_of(cloud, point as usize);
            for k in 0..3 {
                line[column][k] = rounded(f64::from(full[k]) * light);
            }
        }
    });
    pixels
}

/// The ranges of columns, from the first to the last, over which a value stays the same.
fn runs(values: impl Iterator<Item = (usize, f64)>) -> Vec<(Range<usize>, f64)> {
    let mut runs: Vec<(Range<usize>, f64)> = Vec::new();
    for (column, value) in values {
        match runs.last_mut() {
            Some((run, same)) if *same == value => run.end = column + 1,
            _ => runs.push((column..column + 1, value)),
        }
    }
    runs
}

/// The nearest whole number to one from 0 to 255, halves up, without the call that `f64::round` is.
#[inline]
fn rounded(value: f64) -> u8 {
    let whole = value as u8;
    whole.saturating_add(u8::from(value - f64::from(whole) >= 0.5))
}

/// Draws x, y and z as they point on the screen, at the left end of `strip`.
pub(super) fn draw_triad(image: &mut Image, sight: &Sight, strip: Area, measure: Measure) {
    let (length, margin) = triad_sizes(measure);
    let most = |ends: [f64; 3]| length * ends.into_iter().fold(0.0, f64::max);
    let origin = [strip.left + margin + most(sight.right.map(|c| -c)), strip.top + margin + most(sight.up)];
    let all = Area { left: 0.0, top: 0.0, right: image.width as f64, bottom: image.height as f64 };
    let colors = [[200, 40, 40], [30, 140, 50], [40, 80, 200]];
    let lettering = measure.lettering(measure.number(), Align::Middle);
    let mut order = [0, 1, 2];
    // What points away from the viewer is drawn first.
    order.sort_by(|a, b| sight.towards[*a].total_cmp(&sight.towards[*b]));
    for k in order {
        let along = [sight.right[k], -sight.up[k]];
        let at = |reach: f64| [0, 1].map(|i| origin[i] + reach * along[i]);
        image.line(origin, at(length), 2.5 * measure.unit, colors[k], all);
        let shortened = along[0].hypot(along[1]);
        // No letter for an axis that points at the viewer.
        if shortened > 0.2 {
            let beyond = length + 0.6 * margin / shortened;
            image.text(at(beyond), ["x", "y", "z"][k], lettering);
        }
    }
}

/// The length of an axis of the triad, and the room for a letter beyond its end.
fn triad_sizes(measure: Measure) -> (f64, f64) {
    (38.0 * measure.unit, 1.2 * measure.number())
}

/// Draws a line of a round length at the right end of `strip`, and says how long it is.
pub(super) fn draw_length(image: &mut Image, strip: Area, per_length: f64, measure: Measure) {
    let length = round_step(0.12 * strip.width() / per_length);
    let pixels = length * per_length;
    if !(pixels.is_finite() && pixels < strip.width()) {
        return;
    }
    let right = strip.right - measure.gap();
    let bar = Area {
        left: right - pixels,
        top: strip.bottom - 1.5 * measure.gap(),
        right,
        bottom: strip.bottom - 1.5 * measure.gap() + 3.0 * measure.hairline(),
    };
    image.fill(bar, BLACK);
    let lettering = measure.lettering(measure.number(), Align::Middle);
    let at = [0.5 * (bar.left + bar.right), bar.top - measure.number()];
    image.text(at, &quantity(length, "m"), lettering);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::{Picture, Sizes, draw};

    /// A block of `n` points along each edge, spacing 1.
    fn block(n: usize) -> Vec<[f64; 3]> {
        (0..n * n * n).map(|i| [i % n, i / n % n, i / (n * n)].map(|c| c as f64)).collect()
    }

    /// A cloud drawn in so many bands.
    fn canvas(view: View, positions: &[[f64; 3]], size: f64, bands: usize) -> (Depths, Screen) {
        let cloud = CloudView { positions, sizes: Sizes::Same(size), values: &[], dimension: 3 };
        let sight = Sight::new(view);
        let shown = sight.extent(&cloud, None);
        let screen = Screen {
            columns: 200,
            rows: 200,
            centre: shown.map(|[low, high]| 0.5 * (low + high)),
            per_length: 200.0 / (shown[0][1] - shown[0][0]).max(shown[1][1] - shown[1][0]),
        };
        let mut depths = Depths::new(&screen);
        let cube = Cube::new(&sight);
        let parts = from_front_to_back(&sight, &screen, &cloud);
        for mut band in depths.bands(bands) {
            for slab in 0..SLABS {
                for splat in parts.iter().flat_map(|part| &part[slab]) {
                    band.draw(splat, &cube);
                }
            }
        }
        (depths, screen)
    }

    #[test]
    fn a_block_covers_the_area_of_its_three_faces_without_holes() {
        let n = 20;
        for (azimuth, elevation) in [(-60.0, 30.0), (0.0, 0.0), (17.0, 90.0), (200.0, -35.0)] {
            let view = View { azimuth, elevation };
            let (mut depths, screen) = canvas(view, &block(n), 1.0, 1);
            let covered = depths.map.rows_mut().iter().filter(|d| **d != NOTHING).count() as f64;
            let sight = Sight::new(view);
            // Each face appears with the cosine of its angle to the sight.
            let seen: f64 = sight.towards.iter().map(|c| c.abs()).sum();
            let expected = seen * (n as f64 * screen.per_length).powi(2);
            assert!((covered / expected - 1.0).abs() < 0.04, "{view:?}: {covered} {expected}");
            // No hole: in each row what is covered is one run.
            let stride = depths.map.stride();
            for row in depths.map.rows_mut().chunks(stride) {
                let changes = row.windows(2).filter(|p| (p[0] == NOTHING) != (p[1] == NOTHING));
                assert!(changes.count() <= 2, "{view:?}");
            }
        }
    }

    #[test]
    fn skipping_what_is_hidden_changes_no_pixel_nor_does_the_order_of_drawing() {
        let positions = block(14);
        let view = View::default();
        let cloud = CloudView { positions: &positions, sizes: Sizes::Same(1.0), values: &[], dimension: 3 };
        let sight = Sight::new(view);
        let (mut fast, screen) = canvas(view, &positions, 1.0, 1);
        let mut plain = Depths::new(&screen);
        let cube = Cube::new(&sight);
        for band in &mut plain.bands(1) {
            // From back to front, nothing skipped.
            for splat in from_front_to_back(&sight, &screen, &cloud).iter().flatten().flatten().rev() {
                let (columns, rows) = band.covered(splat, &cube);
                band.paint(splat, &cube, columns, rows);
            }
        }
        for (mut depths, what) in [(canvas(view, &positions, 1.0, 7).0, "bands"), (plain, "order")] {
            assert_eq!(fast.map.rows_mut(), depths.map.rows_mut(), "{what}");
            assert_eq!(fast.shown, depths.shown, "{what}");
        }
    }

    #[test]
    fn the_nearer_point_hides_the_farther_one_whatever_their_order() {
        let view = View { azimuth: 0.0, elevation: 0.0 };
        for positions in [[[0.0; 3], [5.0, 0.0, 0.0]], [[5.0, 0.0, 0.0], [0.0; 3]]] {
            let (depths, _) = canvas(view, &positions, 1.0, 1);
            let middle = depths.shown[100 * 200 + 100].point as usize;
            assert_eq!(positions[middle][0], 5.0);
        }
    }

    #[test]
    fn faces_are_told_apart_by_light_and_pictures_repeat_exactly() {
        let positions = block(12);
        let values = vec![0.0; positions.len()];
        let cloud = CloudView { positions: &positions, sizes: Sizes::Same(1.0), values: &values, dimension: 3 };
        let picture = Picture { width: 400, range: Some((0.0, 1.0)), ..Picture::default() };
        let image = draw(&picture, &cloud, None);
        assert_eq!(image, draw(&picture, &cloud, None));
        let mut counts = std::collections::HashMap::new();
        for pixel in &image.pixels {
            *counts.entry(*pixel).or_insert(0_usize) += 1;
        }
        counts.remove(&WHITE);
        let mut faces: Vec<u8> =
            counts.into_iter().filter(|(_, count)| *count > 1000).map(|(color, _)| color[2]).collect();
        faces.sort_unstable();
        // Rounding may give one face two shades.
        faces.dedup_by(|a, b| a.abs_diff(*b) <= 2);
        assert_eq!(faces.len(), 3, "{faces:?}");
    }
}
