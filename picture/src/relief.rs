//! How a drawn surface lies at each pixel, told from depths alone: how it slopes, and how deep in a cleft it is.
//! Deliberately not here: what is drawn, and light.

use std::ops::Range;

/// How near each pixel of a picture is to the viewer, with [`MARGIN`] pixels of nothing on all sides.
pub(super) struct DepthMap {
    pub columns: usize,
    pub rows: usize,
    depth: Vec<f32>,
}

/// As far as is looked around, in pixels.
pub(super) const MARGIN: usize = 60;
/// The depth where nothing is.
pub(super) const NOTHING: f32 = f32::NEG_INFINITY;

/// What the surroundings of each pixel of one row are like.
#[derive(Default)]
pub(super) struct Relief {
    /// How much nearer the surface comes per pixel to the right; NaN where that cannot be told.
    pub right: Vec<f64>,
    /// The same upwards.
    pub up: Vec<f64>,
    /// How much the surroundings stand out in front: 0 on a plane, up to 1 in a cleft.
    pub closed: Vec<f64>,
    /// How many slopes were taken.
    count: Vec<f64>,
}

impl Relief {
    /// Looks around some pixels of a row, where the points have this edge \[pixels\].
    pub fn look(&mut self, map: &DepthMap, row: usize, columns: Range<usize>, edge: f64) {
        for values in [&mut self.right, &mut self.up, &mut self.closed, &mut self.count] {
            values.resize(map.columns, 0.0);
        }
        let first = map.place(row, columns.start);
        let count = &mut self.count[columns.clone()];
        map.slopes(first, 1, edge, &mut self.right[columns.clone()], count);
        // Up is towards lower rows.
        map.slopes(first, -(map.stride() as isize), edge, &mut self.up[columns.clone()], count);
        map.closedness(first, edge, &mut self.closed[columns]);
    }
}

impl DepthMap {
    pub fn new(columns: usize, rows: usize) -> Self {
        Self { columns, rows, depth: vec![NOTHING; (columns + 2 * MARGIN) * (rows + 2 * MARGIN)] }
    }

    /// From one row to the next.
    pub fn stride(&self) -> usize {
        self.columns + 2 * MARGIN
    }

    pub fn row(&self, row: usize) -> &[f32] {
        &self.depth[self.place(row, 0)..][..self.columns]
    }

    /// All rows, each with its margins.
    pub fn rows_mut(&mut self) -> &mut [f32] {
        let stride = self.stride();
        &mut self.depth[MARGIN * stride..][..self.rows * stride]
    }

    fn place(&self, row: usize, column: usize) -> usize {
        (row + MARGIN) * self.stride() + column + MARGIN
    }

    /// The depths some way from each of `count` pixels from `first` on, and as far the other way.
    fn opposite(&self, first: usize, way: isize, count: usize) -> impl Iterator<Item = (f64, f64)> {
        let beside = |way: isize| self.depth[first.wrapping_add_signed(way)..][..count].iter();
        beside(way).zip(beside(-way)).map(|(a, b)| (f64::from(*a), f64::from(*b)))
    }

    /// How much nearer the surface comes per pixel along `way`, over a few points, so
    /// that the steps of a lattice do not hide the shape they follow; NaN where that
    /// cannot be told.
    fn slopes(&self, first: usize, way: isize, edge: f64, slopes: &mut [f64], count: &mut [f64]) {
        slopes.fill(0.0);
        count.fill(0.0);
        for reach in [0.7, 1.4, 2.1, 2.8] {
            let steps = (reach * edge).round().clamp(2.0, MARGIN as f64);
            let pairs = self.opposite(first, way * steps as isize, slopes.len());
            for ((sum, count), (a, b)) in slopes.iter_mut().zip(&mut *count).zip(pairs) {
                let slope = (a - b) / (2.0 * steps);
                // Steeper is not one surface but an edge with another one behind it, or
                // with nothing, which is infinitely far.
                let gentle = slope.abs() < 4.0;
                *sum += if gentle { slope } else { 0.0 };
                *count += if gentle { 1.0 } else { 0.0 };
            }
        }
        for (sum, count) in slopes.iter_mut().zip(count) {
            *sum /= *count;
        }
    }

    /// How much the surroundings stand out in front of each pixel.
    ///
    /// Opposite neighbours are taken together, so that a slope, where one is as
    /// much nearer as the other is farther, counts as a plane. Where one side is
    /// empty, infinitely far, a slope cannot be told: it is taken as level.
    fn closedness(&self, first: usize, edge: f64, closed: &mut [f64]) {
        const OFFSETS: [[isize; 2]; 8] = [[0, 2], [2, 0], [2, 2], [2, -2], [0, 6], [6, 0], [5, 5], [5, -5]];
        // Steps of one point are no clefts; and a far step is not darker than a near one.
        let full = (2.5 * edge).clamp(12.0, 60.0);
        closed.fill(0.0);
        for [down, along] in OFFSETS {
            let pairs = self.opposite(first, down * self.stride() as isize + along, closed.len());
            let here = &self.depth[first..][..closed.len()];
            for ((closed, here), (a, b)) in closed.iter_mut().zip(here).zip(pairs) {
                *closed += ((0.5 * (a + b) - f64::from(*here)) / full).clamp(0.0, 1.0);
            }
        }
        for closed in closed {
            *closed /= OFFSETS.len() as f64;
        }
    }
}
