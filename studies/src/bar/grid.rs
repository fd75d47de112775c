//! Nodes on a line, each with its cell.

/// Where the node of a cell stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// In the centre of its own cell.
    Centred,
    /// At the ends of intervals; a cell reaches half way to both neighbours, the end cells are halves. Where the
    /// spacing changes, the node is off the centre of its cell.
    Vertex,
}

/// Nodes in ascending order and the limits of their cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    pub at: Vec<f64>,
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

impl Grid {
    /// `intervals` equal intervals from `start` to `end`: as many nodes, one more for [`Layout::Vertex`].
    pub fn uniform(layout: Layout, start: f64, end: f64, intervals: usize) -> Self {
        Self::zones(layout, start, &[(end, intervals)])
    }

    /// Zones from left to right, each with its end and its number of equal intervals.
    pub fn zones(layout: Layout, start: f64, zones: &[(f64, usize)]) -> Self {
        let mut edges = vec![start];
        for &(end, intervals) in zones {
            let begin = edges[edges.len() - 1];
            edges.extend((1..=intervals).map(|k| begin + (end - begin) * k as f64 / intervals as f64));
        }
        match layout {
            Layout::Vertex => Self::vertices(edges),
            Layout::Centred => Self {
                at: edges.windows(2).map(|e| 0.5 * (e[0] + e[1])).collect(),
                low: edges[..edges.len() - 1].to_vec(),
                high: edges[1..].to_vec(),
            },
        }
    }

    /// Vertex nodes at these places.
    pub fn vertices(at: Vec<f64>) -> Self {
        let middle: Vec<f64> = at.windows(2).map(|x| 0.5 * (x[0] + x[1])).collect();
        let low = [&at[..1], &middle].concat();
        let high = [&middle, &at[at.len() - 1..]].concat();
        Self { at, low, high }
    }

    /// Number of nodes.
    pub fn count(&self) -> usize {
        self.at.len()
    }

    /// Volume of a cell, A = 1.
    pub fn volume(&self, i: usize) -> f64 {
        self.high[i] - self.low[i]
    }

    /// Σ V f
    pub fn sum(&self, values: &[f64]) -> f64 {
        values.iter().enumerate().map(|(i, value)| self.volume(i) * value).sum()
    }

    /// Σ V u/Σ V
    pub fn mean(&self, values: &[f64]) -> f64 {
        self.sum(values) / (self.high[self.count() - 1] - self.low[0])
    }

    /// The node next to x.
    pub fn nearest(&self, x: f64) -> usize {
        let after = self.at.partition_point(|&at| at < x).clamp(1, self.count() - 1);
        if x - self.at[after - 1] < self.at[after] - x { after - 1 } else { after }
    }

    /// The linear interpolant of nodal values at x.
    pub fn interpolate(&self, values: &[f64], x: f64) -> f64 {
        let after = self.at.partition_point(|&at| at < x).clamp(1, self.count() - 1);
        let share = (x - self.at[after - 1]) / (self.at[after] - self.at[after - 1]);
        values[after - 1] + share * (values[after] - values[after - 1])
    }
}
