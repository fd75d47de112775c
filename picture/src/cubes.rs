//! Cubes on pixels: which face of which cube is in front. Deliberately not here: clouds, colours and light.

use std::ops::Range;

use super::relief::{DepthMap, MARGIN, NOTHING};
use super::solid::{Screen, Sight};

/// One point on the screen, in pixels.
pub(super) struct Splat {
    pub point: u32,
    /// Of faces at the same depth, that of the lower rank shows, then that of the lower point.
    pub rank: u8,
    pub centre: [f64; 2],
    pub depth: f64,
    pub edge: f64,
}

/// A cube of edge 1 seen along the sight: which face a ray meets, and where.
///
/// The ray through the screen point `(x, y)` from the centre leaves the slab
/// between the two faces normal to axis `k` at the height `0.5 / |d| - across · (x, y)`
/// towards the viewer, where `d` is the component of the sight along the axis.
/// It leaves the cube where it leaves the first slab, if by then it has entered all.
pub(super) struct Cube {
    across: [[f64; 2]; 3],
    thickness: [f64; 3],
    /// Half the width of the cube on the screen, to the right and up.
    reach: [f64; 2],
    /// How far its nearest corner stands out towards the viewer.
    stand_out: f64,
}

impl Cube {
    pub fn new(sight: &Sight) -> Self {
        // Faces seen edge-on: a slab of finite thickness instead of a division by zero.
        let component = |k: usize| sight.towards[k].abs().max(1e-6);
        let sign = |k: usize| if sight.towards[k] < 0.0 { -1.0 } else { 1.0 };
        let axes = [0, 1, 2];
        Self {
            across: axes.map(|k| [sight.right[k], sight.up[k]].map(|part| sign(k) * part / component(k))),
            thickness: axes.map(|k| 1.0 / component(k)),
            reach: [sight.right, sight.up].map(|d| 0.5 * d.iter().map(|c| c.abs()).sum::<f64>()),
            stand_out: 0.5 * sight.towards.iter().map(|c| c.abs()).sum::<f64>(),
        }
    }

    /// Depths above the centre where rays leave a cube, NaN for those that miss it: rays at `x`, `x + 1`, ….
    ///
    /// * `across`: what `y` adds to the heights of the slabs.
    /// * `half`: half the thickness of the slabs.
    #[inline]
    fn heights(&self, x: impl Fn(i32) -> f64, across: &[f64; 3], half: &[f64; 3], heights: &mut [f64]) {
        for (i, height) in heights.iter_mut().enumerate() {
            let x = x(i as i32);
            let (mut leave, mut enter) = (f64::MAX, f64::MIN);
            for k in 0..3 {
                let across = self.across[k][0] * x + across[k];
                let (high, low) = (half[k] - across, -half[k] - across);
                leave = if high < leave { high } else { leave };
                enter = if low > enter { low } else { enter };
            }
            *height = if leave >= enter { leave } else { f64::NAN };
        }
    }

    /// The face by which the ray at `x` leaves.
    #[inline]
    fn face(&self, x: f64, across: &[f64; 3], half: &[f64; 3]) -> u8 {
        let high = |k: usize| half[k] - (self.across[k][0] * x + across[k]);
        let [a, b, c] = [high(0), high(1), high(2)];
        if b < a { if c < b { 2 } else { 1 } } else { if c < a { 2 } else { 0 } }
    }
}

/// What each pixel shows: how near it is, and which face of which point.
pub(super) struct Depths {
    pub map: DepthMap,
    pub shown: Vec<Shown>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Shown {
    pub point: u32,
    pub rank: u8,
    pub face: u8,
}

/// Some rows of a picture, which one thread draws.
pub(super) struct Band<'a> {
    rows: Range<usize>,
    columns: usize,
    /// The rows with their margins.
    depth: &'a mut [f32],
    shown: &'a mut [Shown],
    blocks: Vec<Block>,
}

/// A square of pixels.
#[derive(Clone, Copy)]
struct Block {
    /// No pixel is farther than this; nothing behind it can be seen.
    farthest: f32,
    /// Pixels have come nearer since that was found.
    stale: bool,
}

/// Pixels along the edge of a block.
const BLOCK: usize = 8;
/// Pixels that rays are sent through at a time.
const RAYS: usize = 32;

impl Depths {
    pub fn new(screen: &Screen) -> Self {
        let (columns, rows) = (screen.columns, screen.rows);
        let shown = vec![Shown::default(); columns * rows];
        Self { map: DepthMap::new(columns, rows), shown }
    }

    /// About `count` bands that make up the picture.
    pub fn bands(&mut self, count: usize) -> Vec<Band<'_>> {
        let (columns, rows, stride) = (self.map.columns, self.map.rows, self.map.stride());
        if columns == 0 || rows == 0 {
            return Vec::new();
        }
        let height = rows.div_ceil(count.max(1)).next_multiple_of(BLOCK);
        let parts =
            self.map.rows_mut().chunks_mut(height * stride).zip(self.shown.chunks_mut(height * columns)).enumerate();
        let nothing = Block { farthest: NOTHING, stale: false };
        parts
            .map(|(k, (depth, shown))| Band {
                rows: k * height..(k * height + height).min(rows),
                columns,
                depth,
                shown,
                blocks: vec![nothing; columns.div_ceil(BLOCK) * height / BLOCK],
            })
            .collect()
    }
}

impl Band<'_> {
    /// Draws a cube, unless it is hidden.
    pub fn draw(&mut self, splat: &Splat, cube: &Cube) {
        let (columns, rows) = self.covered(splat, cube);
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let nearest = (splat.depth + cube.stand_out * splat.edge) as f32;
        if !self.is_hidden(&columns, &rows, nearest) {
            self.paint(splat, cube, columns, rows);
        }
    }

    /// The columns and rows of the band that a cube may cover.
    pub fn covered(&self, splat: &Splat, cube: &Cube) -> (Range<usize>, Range<usize>) {
        let [right, up] = cube.reach.map(|reach| reach * splat.edge);
        (touched(splat.centre[0], right, 0..self.columns), touched(splat.centre[1], up, self.rows.clone()))
    }

    /// Draws a cube where it is in front, looking at these pixels.
    pub fn paint(&mut self, splat: &Splat, cube: &Cube, columns: Range<usize>, rows: Range<usize>) {
        let (mut half, mut across) = ([0.0; 3], [0.0; 3]);
        for k in 0..3 {
            half[k] = 0.5 * splat.edge * cube.thickness[k];
        }
        for row in rows.clone() {
            let y = splat.centre[1] - (row as f64 + 0.5);
            for k in 0..3 {
                across[k] = cube.across[k][1] * y;
            }
            let row = row - self.rows.start;
            let depths = &mut self.depth[row * (self.columns + 2 * MARGIN) + MARGIN..][columns.clone()];
            let shown = &mut self.shown[row * self.columns..][columns.clone()];
            let parts = depths.chunks_mut(RAYS).zip(shown.chunks_mut(RAYS));
            for (part, (depths, shown)) in parts.enumerate() {
                let start = (columns.start + part * RAYS) as f64;
                let x = |i: i32| start + f64::from(i) + 0.5 - splat.centre[0];
                let heights = &mut [0.0; RAYS][..depths.len()];
                cube.heights(x, &across, &half, heights);
                for (i, height) in heights.iter().enumerate() {
                    let depth = (splat.depth + height) as f32;
                    let first = || (splat.rank, splat.point) < (shown[i].rank, shown[i].point);
                    if depth > depths[i] || (depth == depths[i] && first()) {
                        depths[i] = depth;
                        let face = cube.face(x(i as i32), &across, &half);
                        shown[i] = Shown { point: splat.point, rank: splat.rank, face };
                    }
                }
            }
        }
        let (rows, columns) = self.blocks_of(&rows, &columns);
        for row in rows {
            for block in &mut self.blocks[row * self.columns.div_ceil(BLOCK)..][columns.clone()] {
                block.stale = true;
            }
        }
    }

    /// The blocks that these pixels are in.
    fn blocks_of(&self, rows: &Range<usize>, columns: &Range<usize>) -> (Range<usize>, Range<usize>) {
        let first = self.rows.start;
        (
            (rows.start - first) / BLOCK..(rows.end - 1 - first) / BLOCK + 1,
            columns.start / BLOCK..(columns.end - 1) / BLOCK + 1,
        )
    }

    fn is_hidden(&mut self, columns: &Range<usize>, rows: &Range<usize>, nearest: f32) -> bool {
        let (rows, columns) = self.blocks_of(rows, columns);
        for row in rows {
            for column in columns.clone() {
                let block = row * self.columns.div_ceil(BLOCK) + column;
                if self.blocks[block].farthest <= nearest {
                    if self.blocks[block].stale {
                        self.blocks[block] = Block { farthest: self.farthest(row, column), stale: false };
                    }
                    if self.blocks[block].farthest <= nearest {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// The depth of the farthest pixel of a block.
    fn farthest(&self, row: usize, column: usize) -> f32 {
        let stride = self.columns + 2 * MARGIN;
        let columns = column * BLOCK..(column * BLOCK + BLOCK).min(self.columns);
        let rows = row * BLOCK..(row * BLOCK + BLOCK).min(self.rows.len());
        let lines = rows.map(|row| &self.depth[row * stride + MARGIN..][columns.clone()]);
        lines.flatten().fold(f32::INFINITY, |a, b| a.min(*b))
    }
}

/// The pixels of a range whose centres lie within `reach` of `centre`.
fn touched(centre: f64, reach: f64, range: Range<usize>) -> Range<usize> {
    let (low, high) = (centre - reach - 0.5, centre + reach - 0.5);
    // Up to the next whole number, and down plus one, without the calls that `ceil` and `floor` are. `as` takes what is
    // below zero to zero.
    let (first, last) = (low as usize, high as usize);
    let (first, last) = (first + usize::from((first as f64) < low), last + usize::from(high >= 0.0));
    first.clamp(range.start, range.end)..last.clamp(range.start, range.end)
}
