//! Three-dimensional clouds: each point a small cube, seen from afar.
//!
//! The projection is orthographic, so lengths can be compared. A depth per pixel
//! decides what is in front. Cubes behind what is drawn already are found by
//! blocks of pixels and skipped, so that a body costs what its surface costs.
//! Faces are lit from the upper left, and pixels in clefts and behind edges are
//! darkened (after Boucheny, "Visualisation scientifique de grands volumes de
//! données", thesis, Grenoble 2009: eye-dome lighting), so that a shape reads even where the
//! field is constant.

use rayon::prelude::*;

use super::axes::Measure;
use super::canvas::{Align, Area, BLACK, Color, Image, WHITE};
use super::picture::{CloudView, ColorScale, View};
use super::ticks::{drawable, quantity, round_step, span, widened};

/// The directions of a view: to the right and up on the screen, and towards the viewer.
pub(super) struct Sight {
    right: [f64; 3],
    up: [f64; 3],
    towards: [f64; 3],
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
            let ends = cloud.positions.iter().enumerate().flat_map(|(i, x)| {
                let centre = dot(*x, direction);
                let half = reach * cloud.sizes.at(i);
                [centre - half, centre + half]
            });
            padded(widened(span(ends).unwrap_or([0.0, 1.0])))
        })
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Draws the cubes; the pixels come row by row from the top, white where there is nothing.
pub(super) fn painted(sight: &Sight, screen: &Screen, cloud: &CloudView<'_>, scale: &ColorScale) -> Vec<Color> {
    let mut canvas = Depths::new(screen);
    let cube = Cube::new(sight);
    let slabs = from_front_to_back(sight, screen, cloud);
    for slab in slabs {
        for splat in slab {
            canvas.draw(&splat, &cube);
        }
        canvas.close_blocks();
    }
    canvas.shaded(&cube, cloud, scale)
}

/// One point on the screen, in pixels.
struct Splat {
    point: u32,
    centre: [f64; 2],
    depth: f64,
    edge: f64,
}

/// The points in slabs of equal depth range, the nearest slab first.
fn from_front_to_back(sight: &Sight, screen: &Screen, cloud: &CloudView<'_>) -> Vec<Vec<Splat>> {
    const SLABS: usize = 24;
    let middle = [0.5 * screen.columns as f64, 0.5 * screen.rows as f64];
    let depths = || cloud.positions.iter().map(|x| dot(*x, sight.towards));
    let [back, front] = widened(span(depths()).unwrap_or([0.0, 1.0]));
    let mut slabs: Vec<Vec<Splat>> = (0..SLABS).map(|_| Vec::new()).collect();
    for (i, (position, depth)) in cloud.positions.iter().zip(depths()).enumerate() {
        let right = (dot(*position, sight.right) - screen.centre[0]) * screen.per_length;
        let up = (dot(*position, sight.up) - screen.centre[1]) * screen.per_length;
        if !(drawable(right) && drawable(up) && drawable(depth)) {
            continue;
        }
        // A pixel wider than the spacing, so that a stretched body stays closed;
        // a point without size still shows.
        let edge = (cloud.sizes.at(i) * screen.per_length + 1.0).min(1e5);
        let slab = ((front - depth) / (front - back) * SLABS as f64) as usize;
        slabs[slab.min(SLABS - 1)].push(Splat {
            point: i as u32,
            centre: [middle[0] + right, middle[1] - up],
            depth: (depth - back) * screen.per_length,
            edge,
        });
    }
    slabs
}

/// A cube of edge 1 seen along the sight: which face a ray meets, and where.
///
/// The ray through the screen point `(x, y)` from the centre leaves the slab
/// between the two faces normal to axis `k` at the height `0.5 / |d| - across · (x, y)`
/// towards the viewer, where `d` is the component of the sight along the axis.
/// It leaves the cube where it leaves the first slab, if by then it has entered all.
struct Cube {
    across: [[f64; 2]; 3],
    thickness: [f64; 3],
    light: [f64; 3],
    /// Half the width of the cube on the screen, to the right and up.
    reach: [f64; 2],
    /// How far its nearest corner stands out towards the viewer.
    stand_out: f64,
}

impl Cube {
    fn new(sight: &Sight) -> Self {
        // Faces seen edge-on: a slab of finite thickness instead of a division by zero.
        let component = |k: usize| sight.towards[k].abs().max(1e-6);
        let sign = |k: usize| if sight.towards[k] < 0.0 { -1.0 } else { 1.0 };
        let axes = [0, 1, 2];
        Self {
            across: axes.map(|k| [sight.right[k], sight.up[k]].map(|part| sign(k) * part / component(k))),
            thickness: axes.map(|k| 1.0 / component(k)),
            light: axes.map(|k| {
                let normal = [sight.right[k], sight.up[k], sight.towards[k]];
                lit(normal.map(|c| sign(k) * c))
            }),
            reach: [sight.right, sight.up].map(|d| 0.5 * d.iter().map(|c| c.abs()).sum::<f64>()),
            stand_out: 0.5 * sight.towards.iter().map(|c| c.abs()).sum::<f64>(),
        }
    }

    /// Depth above the centre, and face, where the ray at `(x, y)` leaves a cube of this edge.
    #[inline]
    fn hit(&self, x: f64, y: f64, edge: f64) -> Option<(f64, u32)> {
        let (mut leave, mut enter, mut face) = (f64::MAX, f64::MIN, 0);
        for k in 0..3 {
            let across = self.across[k][0] * x + self.across[k][1] * y;
            let half = 0.5 * edge * self.thickness[k];
            if half - across < leave {
                leave = half - across;
                face = k as u32;
            }
            enter = enter.max(-half - across);
        }
        (leave >= enter).then_some((leave, face))
    }
}

/// The brightness of a surface with this normal, as seen on the screen.
fn lit(normal: [f64; 3]) -> f64 {
    let source = normalized([-0.45, 0.65, 0.75]);
    0.6 + 0.4 * dot(normal, source).max(0.0)
}

fn normalized(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    v.map(|c| c / length)
}

/// What each pixel shows: how near it is, and which face of which point.
struct Depths {
    columns: usize,
    rows: usize,
    depth: Vec<f32>,
    shown: Vec<(u32, u8)>,
    /// The farthest depth in each block of pixels; nothing behind it can be seen.
    blocks: Vec<f32>,
    block_columns: usize,
    /// Pixels per metre.
    per_length: f64,
}

/// Pixels along the edge of a block.
const BLOCK: usize = 8;
const NOTHING: f32 = f32::NEG_INFINITY;

impl Depths {
    fn new(screen: &Screen) -> Self {
        let (columns, rows) = (screen.columns, screen.rows);
        let block_columns = columns.div_ceil(BLOCK);
        Self {
            columns,
            rows,
            depth: vec![NOTHING; columns * rows],
            shown: vec![(0, 0); columns * rows],
            blocks: vec![NOTHING; block_columns * rows.div_ceil(BLOCK)],
            block_columns,
            per_length: screen.per_length,
        }
    }

    fn draw(&mut self, splat: &Splat, cube: &Cube) {
        let columns = self.touched(splat.centre[0], cube.reach[0] * splat.edge, self.columns);
        let rows = self.touched(splat.centre[1], cube.reach[1] * splat.edge, self.rows);
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let nearest = (splat.depth + cube.stand_out * splat.edge) as f32;
        if self.is_hidden(&columns, &rows, nearest) {
            return;
        }
        for row in rows {
            let y = splat.centre[1] - (row as f64 + 0.5);
            for column in columns.clone() {
                let x = column as f64 + 0.5 - splat.centre[0];
                let Some((height, face)) = cube.hit(x, y, splat.edge) else {
                    continue;
                };
                let depth = (splat.depth + height) as f32;
                let pixel = row * self.columns + column;
                if depth > self.depth[pixel] {
                    self.depth[pixel] = depth;
                    self.shown[pixel] = (splat.point, face as u8);
                }
            }
        }
    }

    /// The pixels whose centres lie within `reach` of `centre`.
    fn touched(&self, centre: f64, reach: f64, count: usize) -> std::ops::Range<usize> {
        let first = (centre - reach - 0.5).ceil();
        let last = (centre + reach - 0.5).floor() + 1.0;
        // `as` takes what is below zero to zero.
        (first as usize).min(count)..(last as usize).min(count)
    }

    fn is_hidden(&self, columns: &std::ops::Range<usize>, rows: &std::ops::Range<usize>, nearest: f32) -> bool {
        (rows.start / BLOCK..=(rows.end - 1) / BLOCK).all(|row| {
            (columns.start / BLOCK..=(columns.end - 1) / BLOCK)
                .all(|column| self.blocks[row * self.block_columns + column] >= nearest)
        })
    }

    fn close_blocks(&mut self) {
        let Self { columns, rows, depth, blocks, block_columns, .. } = self;
        blocks.par_chunks_mut((*block_columns).max(1)).enumerate().for_each(|(block_row, farthest)| {
            farthest.fill(f32::INFINITY);
            for row in block_row * BLOCK..((block_row + 1) * BLOCK).min(*rows) {
                let line = &depth[row * *columns..][..*columns];
                for (far, part) in farthest.iter_mut().zip(line.chunks(BLOCK)) {
                    *far = part.iter().fold(*far, |a, b| a.min(*b));
                }
            }
        });
    }

    fn shaded(&self, cube: &Cube, cloud: &CloudView<'_>, scale: &ColorScale) -> Vec<Color> {
        let mut pixels = vec![WHITE; self.columns * self.rows];
        pixels.par_chunks_mut(self.columns.max(1)).enumerate().for_each(|(row, line)| {
            for (column, color) in line.iter_mut().enumerate() {
                let pixel = row * self.columns + column;
                if self.depth[pixel] == NOTHING {
                    continue;
                }
                let (point, face) = self.shown[pixel];
                let edge = cloud.sizes.at(point as usize) * self.per_length;
                let level = cube.light[face as usize];
                let smooth =
                    self.slope(row, column, edge).map_or(level, |[right, up]| lit(normalized([-right, -up, 1.0])));
                let light = 0.5 * (level + smooth) * self.openness(row, column, edge);
                let full = scale.colors_of(cloud, point as usize);
                *color = full.map(|channel| (f64::from(channel) * light).round() as u8);
            }
        });
        pixels
    }

    /// The depth at a pixel some steps away, if something is drawn there.
    fn beside(&self, row: usize, column: usize, [down, along]: [isize; 2]) -> Option<f64> {
        let row = row.checked_add_signed(down).filter(|r| *r < self.rows)?;
        let column = column.checked_add_signed(along).filter(|c| *c < self.columns)?;
        let depth = self.depth[row * self.columns + column];
        (depth != NOTHING).then_some(f64::from(depth))
    }

    /// How much nearer the surface comes per pixel to the right and up, over a few
    /// points, so that the steps of a lattice do not hide the shape they follow.
    fn slope(&self, row: usize, column: usize, edge: f64) -> Option<[f64; 2]> {
        let along = |direction: [isize; 2]| {
            let slopes = [0.7, 1.4, 2.1, 2.8].into_iter().filter_map(|reach| {
                let steps = (reach * edge).round().clamp(2.0, 60.0) as isize;
                let a = self.beside(row, column, direction.map(|d| d * steps))?;
                let b = self.beside(row, column, direction.map(|d| -d * steps))?;
                let slope = (a - b) / (2 * steps) as f64;
                // Steeper is not one surface but an edge with another one behind it.
                (slope.abs() < 4.0).then_some(slope)
            });
            let (sum, count) = slopes.fold((0.0, 0), |(sum, n), slope| (sum + slope, n + 1));
            (count > 0).then(|| sum / f64::from(count))
        };
        Some([along([0, 1])?, along([-1, 0])?])
    }

    /// How little the surroundings stand out in front of a pixel: 1 on a plane, less in a cleft.
    ///
    /// Opposite neighbours are taken together, so that a slope, where one is as
    /// much nearer as the other is farther, counts as a plane.
    fn openness(&self, row: usize, column: usize, edge: f64) -> f64 {
        const OFFSETS: [[isize; 2]; 8] = [[0, 2], [2, 0], [2, 2], [2, -2], [0, 6], [6, 0], [5, 5], [5, -5]];
        let here = f64::from(self.depth[row * self.columns + column]);
        // Steps of one point are no clefts; and a far step is not darker than a near one.
        let full = (2.5 * edge).clamp(12.0, 60.0);
        let mut closed = 0.0;
        for offset in OFFSETS {
            let a = self.beside(row, column, offset);
            let b = self.beside(row, column, offset.map(|d| -d));
            // Where one side is empty, a slope cannot be told: taken as level.
            if let (Some(a), Some(b)) = (a, b) {
                closed += ((0.5 * (a + b) - here) / full).clamp(0.0, 1.0);
            }
        }
        1.0 - 0.5 * (closed / OFFSETS.len() as f64).sqrt()
    }
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
    use crate::output::picture::{Picture, Sizes, draw};

    /// A block of `n` points along each edge, spacing 1.
    fn block(n: usize) -> Vec<[f64; 3]> {
        (0..n * n * n).map(|i| [i % n, i / n % n, i / (n * n)].map(|c| c as f64)).collect()
    }

    fn canvas(view: View, positions: &[[f64; 3]], size: f64) -> (Depths, Screen) {
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
        for slab in from_front_to_back(&sight, &screen, &cloud) {
            for splat in slab {
                depths.draw(&splat, &cube);
            }
            depths.close_blocks();
        }
        (depths, screen)
    }

    #[test]
    fn a_block_covers_the_area_of_its_three_faces_without_holes() {
        let n = 20;
        for (azimuth, elevation) in [(-60.0, 30.0), (0.0, 0.0), (17.0, 90.0), (200.0, -35.0)] {
            let view = View { azimuth, elevation };
            let (depths, screen) = canvas(view, &block(n), 1.0);
            let covered = depths.depth.iter().filter(|d| **d != NOTHING).count() as f64;
            let sight = Sight::new(view);
            // Each face appears with the cosine of its angle to the sight.
            let seen: f64 = sight.towards.iter().map(|c| c.abs()).sum();
            let expected = seen * (n as f64 * screen.per_length).powi(2);
            assert!((covered / expected - 1.0).abs() < 0.04, "{view:?}: {covered} {expected}");
            // No hole: in each row what is covered is one run.
            for row in depths.depth.chunks(depths.columns) {
                let changes = row.windows(2).filter(|p| (p[0] == NOTHING) != (p[1] == NOTHING));
                assert!(changes.count() <= 2, "{view:?}");
            }
        }
    }

    #[test]
    fn skipping_what_is_hidden_changes_no_pixel() {
        let positions = block(14);
        let view = View::default();
        let (fast, screen) = canvas(view, &positions, 1.0);
        let cloud = CloudView { positions: &positions, sizes: Sizes::Same(1.0), values: &[], dimension: 3 };
        let sight = Sight::new(view);
        let mut plain = Depths::new(&screen);
        let cube = Cube::new(&sight);
        for splat in from_front_to_back(&sight, &screen, &cloud).iter().flatten() {
            plain.draw(splat, &cube); // blocks are never closed: nothing is skipped
        }
        assert_eq!(fast.depth, plain.depth);
        assert_eq!(fast.shown, plain.shown);
    }

    #[test]
    fn the_nearer_point_hides_the_farther_one_whatever_their_order() {
        let view = View { azimuth: 0.0, elevation: 0.0 };
        for positions in [[[0.0; 3], [5.0, 0.0, 0.0]], [[5.0, 0.0, 0.0], [0.0; 3]]] {
            let (depths, _) = canvas(view, &positions, 1.0);
            let middle = depths.shown[100 * 200 + 100].0 as usize;
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
