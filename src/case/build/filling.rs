//! How well cells fill a shape: volume beside volume, and length beside length where faces are across an axis.

use super::Builder;
use crate::geometry::{Arrangement, Cloud, Shape};

/// Of the volume of the shape: what cells may be off by, whatever the shape.
const OFF: f64 = 0.03;
/// Of the root of the number of cells at the surface of a cube of as many cells: a smooth surface that runs anyhow takes or
/// gives a part of each cell that it goes through, by chance, so that they are off together by 0.3 roots of their number at
/// most.
const BY_CHANCE: f64 = 0.5;

impl<const D: usize> Builder<'_, D> {
    /// Warns of lengths and of a volume that the cells of a lattice do not have.
    pub(super) fn warn_of_filling(&self, shape: &Shape<D>, cloud: &Cloud<D>) {
        let Arrangement::Lattice(lattice) = &cloud.arrangement else { return };
        let ((low, high), spacing) = (shape.bounds(), cloud.spacing);
        for d in shape.axes_of_faces() {
            let cells = (high[d] - low[d]) / spacing;
            if (cells - lattice.counts[d] as f64).abs() > 1e-6 * cells {
                log::warn!(
                    "the spacing does not divide the body along {}: {} cells of {spacing} m stand for {} m",
                    ["x", "y", "z"][d],
                    lattice.counts[d],
                    high[d] - low[d]
                );
            }
        }
        let (n, cell) = (cloud.n_points() as f64, lattice.cell_volume());
        let volume = shape.volume();
        let at_the_surface = 2.0 * D as f64 * n.powf(1.0 - 1.0 / D as f64);
        let bearable = f64::max(OFF * volume, BY_CHANCE * at_the_surface.sqrt() * cell);
        // Of a box the lengths say all.
        if (n * cell - volume).abs() > bearable && !matches!(shape, Shape::Box { .. }) {
            let unit = ["m", "m^2", "m^3"][D - 1];
            let message = format!(
                "the cells do not fill the shape: {n} cells of {spacing} m are {:.4e} {unit} and stand for {volume:.4e} {unit}, \
                 {:+.1} %",
                n * cell,
                100.0 * (n * cell / volume - 1.0)
            );
            let help =
                "mass and stiffness are off by as much; a smaller spacing, or one that divides the thickness, fills it";
            log::warn!("{}", self.source().warning("geometry.spacing", message).help(help));
        }
    }
}
