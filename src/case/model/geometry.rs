//! Tables of the geometry and of named sets: where matter is, and which points are meant.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Formula;

/// Where matter is.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Geometry {
    /// The body's shape, filled with cubic cells of side `spacing`. Either this or `points`.
    pub shape: Option<Shape>,
    /// Grid spacing Δx. Required with `shape`.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
    pub spacing: Option<f64>,
    /// Moves each point of the lattice at random, which makes it a scattered cloud.
    pub perturb: Option<Perturb>,
    /// Points from a file. Either this or `shape`.
    pub points: Option<Points>,
    /// Pre-cracks: every bond that crosses one is broken at the start.
    #[serde(default)]
    pub cracks: Vec<Crack>,
}

/// A random shift of lattice points.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Perturb {
    /// Largest shift along each axis, as a fraction of the spacing.
    #[schemars(range(min = 0, max = 0.5))]
    pub amplitude: f64,
    /// The same seed gives the same points.
    #[serde(default)]
    pub seed: u64,
    /// Numbers the points in random order, as points from elsewhere may be.
    #[serde(default)]
    pub shuffle: bool,
}

/// Points from a file.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Points {
    /// A table with columns `x`, `y`, `z` (as many as the dimension), `volume` and optionally `sets` (names joined by
    /// `+`), in SI units.
    Csv {
        /// Path, relative to the case file.
        file: String,
    },
}

/// A body of matter.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// 1D, between two coordinates.
    Segment {
        #[schemars(extend("x-unit" = "m"))]
        low: f64,
        #[schemars(extend("x-unit" = "m"))]
        high: f64,
    },
    /// 2D, by its size, centred on `center` (the origin if not given).
    Rectangle {
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        size: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        center: Option<Vec<f64>>,
    },
    /// 3D, by its size, centred on `center` (the origin if not given).
    Block {
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        size: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        center: Option<Vec<f64>>,
    },
    /// Any dimension, by two opposite corners.
    Box {
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        low: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        high: Vec<f64>,
    },
    /// 2D.
    Disk {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        radius: f64,
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        center: Option<Vec<f64>>,
    },
    /// 3D.
    Sphere {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        radius: f64,
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        center: Option<Vec<f64>>,
    },
    /// 2D, between two circles.
    Ring {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        inner: f64,
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        outer: f64,
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        center: Option<Vec<f64>>,
    },
    /// 3D, solid, along an axis.
    Cylinder {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        radius: f64,
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        length: f64,
        #[serde(default)]
        axis: Axis,
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        center: Option<Vec<f64>>,
    },
    /// 3D, hollow, along an axis.
    Tube {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        inner: f64,
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        outer: f64,
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        length: f64,
        #[serde(default)]
        axis: Axis,
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        center: Option<Vec<f64>>,
    },
    /// 2D, simple, by its corners in either sense.
    Polygon {
        #[schemars(extend("x-unit" = "m"), length(min = 3))]
        vertices: Vec<Vec<f64>>,
    },
    /// 3D, a polygon in x and y between two heights.
    Extrusion {
        #[schemars(extend("x-unit" = "m"), length(min = 3))]
        vertices: Vec<Vec<f64>>,
        #[schemars(extend("x-unit" = "m"))]
        low: f64,
        #[schemars(extend("x-unit" = "m"))]
        high: f64,
    },
    /// All of these together.
    Union(#[schemars(length(min = 1))] Vec<Shape>),
    /// What all of these share.
    Intersection(#[schemars(length(min = 1))] Vec<Shape>),
    /// The first without the others.
    Difference {
        of: std::boxed::Box<Shape>,
        #[schemars(length(min = 1))]
        minus: Vec<Shape>,
    },
}

/// An axis of the coordinate system.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    X,
    Y,
    #[default]
    Z,
}

/// Which points belong to a set.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// Points between two corners, those on the border included; nothing that is nearer than a fortieth of a cell is outside.
    Box {
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        low: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        high: Vec<f64>,
    },
    /// Points in a shape, those on its border included, as of a box.
    Inside(Shape),
    /// Points where a formula of the reference position is true (not zero), such as `"y > 0.02 - h"`.
    Where(#[schemars(extend("x-expression" = ["x", "y", "z"]))] Formula),
    /// Points of the body within `thickness` of its surface, that distance included, as of a box.
    Layer {
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        thickness: f64,
    },
    /// Points in all of these.
    All(#[schemars(length(min = 1))] Vec<Region>),
    /// Points in any of these.
    Any(#[schemars(length(min = 1))] Vec<Region>),
    /// All other points.
    Not(std::boxed::Box<Region>),
}

/// Which part of the surface of the body is meant.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SurfacePart {
    /// Where a formula of place and outward normal is true (not zero), such as `"ny > 0.5 and x > 0"`.
    Where(#[schemars(extend("x-expression" = ["x", "y", "z", "nx", "ny", "nz"]))] Formula),
    /// What of it lies between two corners, those included.
    Box {
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        low: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 1, max = 3))]
        high: Vec<f64>,
    },
    /// What of it lies in a shape, or on its border.
    Inside(Shape),
    /// What is in all of these.
    All(#[schemars(length(min = 1))] Vec<SurfacePart>),
    /// What is in any of these.
    Any(#[schemars(length(min = 1))] Vec<SurfacePart>),
    /// The rest of the surface.
    Not(std::boxed::Box<SurfacePart>),
}

/// A pre-crack.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Crack {
    /// 1D: cuts every bond that spans this coordinate.
    Point(#[schemars(extend("x-unit" = "m"))] f64),
    /// 2D, straight.
    Segment {
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        from: Vec<f64>,
        #[schemars(extend("x-unit" = "m"), length(min = 2, max = 2))]
        to: Vec<f64>,
    },
    /// 2D, from corner to corner.
    Polyline {
        #[schemars(extend("x-unit" = "m"), length(min = 2))]
        vertices: Vec<Vec<f64>>,
    },
    /// 3D, a plane polygon by its corners.
    Polygon {
        #[schemars(extend("x-unit" = "m"), length(min = 3))]
        vertices: Vec<Vec<f64>>,
    },
    /// 3D, penny-shaped.
    Disc {
        #[schemars(extend("x-unit" = "m"), length(min = 3, max = 3))]
        center: Vec<f64>,
        #[schemars(length(min = 3, max = 3))]
        normal: Vec<f64>,
        #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
        radius: f64,
    },
}
