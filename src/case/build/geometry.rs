//! The body of a case: its shape, its points and their cells, its sets, and whether they fit.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::super::import;
use super::super::model::{
    self, Axis, Formula, GridTransition, HorizonRule, Precision, Refinement, Region, SurfaceCorrection,
};
use super::Builder;
use super::conditions::rounded;
use crate::conditions::profile::VARIABLES;
use crate::discretization::{BondWeighting, PartialVolume};
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::family::Rule;
use crate::field::Vector;
use crate::geometry::{Arrangement, Cloud, Crack, Shape, TIE};
use crate::physics::elasticity::{Adaptation, INDICATORS};
use crate::refinement::{Cells, Transition};

impl<const D: usize> Builder<'_, D> {
    pub(super) fn shape(&self) -> Result<Option<Shape<D>>> {
        let Some(shape) = &self.case.value.geometry.shape else { return Ok(None) };
        let shape = shape_of::<D>(shape);
        shape.validate().map_err(|e| self.refuse("geometry.shape", e, ""))?;
        Ok(Some(shape))
    }

    pub(super) fn cracks(&self) -> Result<Vec<Crack<D>>> {
        let mut cracks = Vec::new();
        for (k, crack) in self.case.value.geometry.cracks.iter().enumerate() {
            let pair = |v: &Vec<f64>| [v[0], v[1]];
            let triple = |v: &Vec<f64>| [v[0], v[1], v[2]];
            let crack = match crack {
                model::Crack::Point(x) => Crack::Point(*x),
                model::Crack::Segment { from, to } => Crack::Polyline(vec![pair(from), pair(to)]),
                model::Crack::Polyline { vertices } => Crack::Polyline(vertices.iter().map(pair).collect()),
                model::Crack::Polygon { vertices } => Crack::Polygon(vertices.iter().map(triple).collect()),
                model::Crack::Disc { center, normal, radius } => {
                    Crack::Disc { center: triple(center), normal: triple(normal), radius: *radius }
                }
            };
            crack.validate().map_err(|e| self.refuse(&format!("geometry.cracks[{k}]"), e, ""))?;
            cracks.push(crack);
        }
        Ok(cracks)
    }

    pub(super) fn cloud(&self, shape: Option<&Shape<D>>, rule: PartialVolume) -> Result<Cloud<D>> {
        let geometry = &self.case.value.geometry;
        if let (Some(shape), Some(spacing)) = (shape, geometry.spacing) {
            let reach = self.reach(spacing, rule)?;
            self.fits_into_memory(shape, spacing, reach)?;
            let cloud = Cloud::lattice(shape, spacing, reach.ceil() as usize);
            if cloud.n_points() == 0 {
                let message = format!("no cell of side {spacing} m has its centre inside the shape");
                return Err(self.refuse("geometry.spacing", message, "a smaller spacing fills it"));
            }
            self.warn_of_filling(shape, &cloud);
            let Arrangement::Lattice(lattice) = &cloud.arrangement else { return Ok(cloud) };
            return Ok(match &geometry.perturb {
                None => cloud,
                Some(perturb) => {
                    let mut random = ChaCha8Rng::seed_from_u64(perturb.seed);
                    let volume = lattice.cell_volume();
                    let mut positions: Vec<Vector<D>> = cloud
                        .slots
                        .iter()
                        .map(|&slot| {
                            cloud.position(slot as usize).map(|x| {
                                let unit = (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
                                x + perturb.amplitude * spacing * (2.0 * unit - 1.0)
                            })
                        })
                        .collect();
                    if perturb.shuffle {
                        for k in (1..positions.len()).rev() {
                            positions.swap(k, (random.next_u64() % (k as u64 + 1)) as usize);
                        }
                    }
                    let volumes = vec![volume; positions.len()];
                    Cloud::scattered(positions, volumes)
                }
            });
        }
        let Some(model::Points::Csv { file }) = &geometry.points else {
            return Err(Error::Refused("a case has a shape or points".into()));
        };
        let path = self.options.base.join(file);
        if !path.exists() {
            let help = "the path is relative to the folder of the case file";
            return Err(self.refuse("geometry.points.csv.file", format!("there is no file {}", path.display()), help));
        }
        let points = import::csv::read::<D>(&path)?;
        let mut cloud = Cloud::scattered(points.positions, points.volumes);
        self.cells_fit(&cloud)?;
        for (name, members) in points.sets {
            let slots = cloud.slots_of(&members);
            cloud.sets.insert(name, slots);
        }
        Ok(cloud)
    }

    /// The cells of a lattice, split as the zones want them, and how they follow the solution.
    pub(super) fn adaptation(
        &self,
        refinement: &Refinement,
        cloud: &Cloud<D>,
        shape: Option<&Shape<D>>,
        scaling: BondWeighting,
        cracks: &[Crack<D>],
    ) -> Result<Adaptation<D>> {
        let Arrangement::Lattice(lattice) = &cloud.arrangement else {
            return Err(self.refuse("refinement", "refinement splits the cells of a lattice", ""));
        };
        // Marks of the finest cells but one, over the whole box, before any cell is split.
        let cells = lattice.counts.iter().product::<usize>() as f64;
        self.refinement_fits(cells * f64::from(1u32 << D).powi(i32::from(refinement.levels) - 1))?;
        let compile = |formula: &Option<Formula>, default: &str| {
            let variables = [&VARIABLES[..], &INDICATORS].concat();
            let source = match formula {
                Some(Formula::Text(text)) => text.clone(),
                Some(Formula::Number(x)) => x.to_string(),
                None => default.to_string(),
            };
            Expression::compile(&source, &variables, &self.case.constants)
                .map_err(|e| Error::Refused(format!("{source}: {e}")))
        };
        let criteria = match &refinement.refine_where {
            None => None,
            wanted => Some([compile(wanted, "0")?, compile(&refinement.keep_where, "damage > 0")?]),
        };
        let regions = (refinement.zones.iter().enumerate())
            .map(|(k, zone)| {
                let path = format!("refinement.zones[{k}].region");
                // Cells of that level are meant.
                let tie = TIE * cloud.spacing / f64::from(1u32 << zone.level);
                Ok((self.region(&zone.region, shape, &path)?, zone.level, tie))
            })
            .collect::<Result<Vec<_>>>()?;
        let mut adaptation = Adaptation {
            cells: Cells::new(lattice, &cloud.slots, refinement.levels),
            scaling,
            rule: match refinement.rule {
                HorizonRule::Source => Rule::Source,
                HorizonRule::Average => Rule::Average,
                HorizonRule::Dual => Rule::Dual,
            },
            ratio: scaling.horizon / cloud.spacing,
            transition: match refinement.transition {
                GridTransition::Sudden => Transition::Sudden,
                GridTransition::Stepwise => Transition::Stepwise,
                GridTransition::Smooth { slope } => Transition::Smooth { slope },
            },
            buffer: refinement.buffer,
            floor: Vec::new(),
            criteria,
            every: refinement.every_steps,
            cracks: cracks.to_vec(),
            tolerance: 1e-9 * cloud.spacing / f64::from(1u32 << refinement.levels),
        };
        adaptation.prepare(|x| {
            let inside = regions.iter().filter(|(inside, _, tie)| inside(x, *tie));
            inside.map(|(_, level, _)| *level).max().unwrap_or(0)
        });
        let ball = [2.0, std::f64::consts::PI, 4.0 / 3.0 * std::f64::consts::PI][D - 1];
        // Neighbours, weights, fractions and bits; fields, sites, and the same again while points are replaced.
        let per_point = 15.0 * ball * (adaptation.ratio + 1.0).powi(D as i32) + 8.0 * (6 * D + 16) as f64;
        self.refinement_fits(2.0 * per_point * adaptation.cells.list().len() as f64)?;
        Ok(adaptation)
    }

    /// Refuses cells that do not fit into memory.
    pub(super) fn refinement_fits(&self, bytes: f64) -> Result<()> {
        let available = available_memory().unwrap_or(u64::MAX) as f64;
        if bytes <= available {
            return Ok(());
        }
        let [wanted, free] = [bytes, available].map(|bytes| bytes / 1073741824.0);
        let message = format!("cells as fine as this would take {wanted:.3e} GiB; {free:.1} GiB are free here");
        let diagnostic = self.source().error("refinement.levels", message).help("take fewer levels or smaller zones");
        Err(Error::TooLarge(diagnostic.to_string()))
    }

    /// Largest distance of a neighbour in cells, known before any point is made.
    pub(super) fn reach(&self, spacing: f64, rule: PartialVolume) -> Result<f64> {
        let d = &self.case.value.discretization;
        let ratio = d.horizon_ratio.or(d.horizon.map(|h| h / spacing)).unwrap_or(1.0);
        if ratio > 100.0 {
            let message = format!("the horizon is {ratio:.1} spacings; at most 100 are allowed");
            return Err(self.refuse("discretization.horizon", message, "a ratio of 3 to 5 is usual"));
        }
        Ok(rule.reach::<D>(spacing, ratio * spacing) / spacing + 1.0)
    }

    pub(super) fn horizon(&self, cloud: &Cloud<D>) -> Result<f64> {
        let d = &self.case.value.discretization;
        let horizon = d.horizon.unwrap_or_else(|| d.horizon_ratio.unwrap_or(3.0) * cloud.spacing);
        if horizon < cloud.spacing * (1.0 - 1e-9) {
            let message = format!("the horizon {horizon} m is smaller than the mean spacing {} m", cloud.spacing);
            return Err(self.refuse("discretization.horizon", message, "a ratio of 3 to 5 is usual"));
        }
        self.cells_are_seen(cloud, horizon);
        let (low, high) = cloud.bounds();
        let smallest = (0..D).map(|d| high[d] - low[d] + cloud.spacing).fold(f64::INFINITY, f64::min);
        if horizon > 0.5 * smallest {
            log::warn!("the horizon {horizon} m is more than half the smallest extent {smallest} m of the body");
        }
        Ok(horizon)
    }

    /// Refuses what cannot fit before anything is allocated.
    pub(super) fn fits_into_memory(&self, shape: &Shape<D>, spacing: f64, reach: f64) -> Result<()> {
        let (low, high) = shape.bounds();
        let mut points = 1.0;
        for d in 0..D {
            points *= ((high[d] - low[d]) / spacing).round().max(1.0) + self.imaged_ends(d) as f64 * reach;
        }
        let ball = [2.0, std::f64::consts::PI, 4.0 / 3.0 * std::f64::consts::PI][D - 1];
        let family = ball * (reach - 1.0).powi(D as i32);
        let number = if self.case.value.discretization.precision == Precision::Single { 4.0 } else { 8.0 };
        // Fields, slots and bonds, and what set-up and the books need for a while; for a cloud its records too.
        let fields = (3 * D + 1) as f64 * number + 4.0 + 16.0;
        let corrected = self.case.value.discretization.surface_correction != SurfaceCorrection::None;
        let per_point = if self.case.value.geometry.perturb.is_some() || corrected {
            let bond = if corrected { 15.0 } else { 5.0 };
            fields + (D + 1) as f64 * 8.0 + 48.0 + 4.0 * number + bond * family
        } else {
            fields + family / 8.0
        };
        let bytes = points * per_point;
        let available = available_memory().unwrap_or(u64::MAX) as f64;
        if points >= f64::from(u32::MAX) || bytes > available {
            let fit = (available / per_point).min(f64::from(u32::MAX));
            let coarser = spacing * (points / fit).powf(1.0 / D as f64);
            let message = format!(
                "{points:.3e} points with {:.3e} bonds would take {:.3e} GiB; {:.1} GiB are free here",
                points * family,
                bytes / 1073741824.0,
                available / 1073741824.0,
            );
            let help = format!("about {fit:.2e} points fit: a spacing of {:.3e} m", coarser * 1.05);
            let diagnostic = self.source().error("geometry.spacing", message).help(help);
            return Err(Error::TooLarge(diagnostic.to_string()));
        }
        Ok(())
    }

    pub(super) fn sets(&self, cloud: &mut Cloud<D>, shape: Option<&Shape<D>>) -> Result<()> {
        let all = cloud.select(|_| true);
        let mut found = BTreeMap::new();
        for (name, region) in &self.case.value.sets {
            let path = format!("sets.{name}");
            if cloud.sets.get(name).is_some() {
                return Err(self.refuse(&path, "the points' file has a set of this name too", "rename one of them"));
            }
            let inside = self.region(region, shape, &path)?;
            self.is_decided(region, cloud, &path)?;
            let slots = cloud.select_with_ties(|x, tie| inside(x, tie));
            if slots.is_empty() {
                let (low, high) = cloud.bounds();
                let message = format!(
                    "no point is in this set; the points of the body span {} to {} m",
                    rounded(&low),
                    rounded(&high)
                );
                return Err(self.refuse(&path, message, "move or enlarge the region"));
            }
            found.insert(name.clone(), slots);
        }
        for (name, slots) in found {
            cloud.sets.insert(name, slots);
        }
        cloud.sets.insert("all", all);
        self.surfaces(cloud, shape)
    }

    /// Refuses a formula that is not a number at a point, which then is neither in the set nor outside.
    fn is_decided(&self, region: &Region, cloud: &Cloud<D>, path: &str) -> Result<()> {
        match region {
            Region::Where(formula) => {
                let expression = self.expression(formula)?;
                let at = |slot: u32| {
                    let x = crate::field::embed(&cloud.position(slot as usize));
                    expression.evaluate(&[x[0], x[1], x[2], 0.0])
                };
                let Some(point) = cloud.slots.iter().position(|slot| at(*slot).is_nan()) else { return Ok(()) };
                let position = rounded(&cloud.position(cloud.slots[point] as usize));
                let message =
                    format!("the formula is NaN at point {point}, position {position} m: neither true nor false");
                Err(self.refuse(path, message, "keep it finite everywhere, as in `sqrt(max(x, 0)) > 0.1`"))
            }
            Region::All(regions) | Region::Any(regions) => {
                regions.iter().try_for_each(|region| self.is_decided(region, cloud, path))
            }
            Region::Not(region) => self.is_decided(region, cloud, path),
            Region::Box { .. } | Region::Inside(_) | Region::Layer { .. } => Ok(()),
        }
    }

    /// Whether a place is in a region, but for a tie, m.
    #[allow(clippy::type_complexity)] // a predicate over points
    pub(super) fn region<'s>(
        &self,
        region: &Region,
        shape: Option<&'s Shape<D>>,
        path: &str,
    ) -> Result<Box<dyn Fn(&Vector<D>, f64) -> bool + 's>> {
        Ok(match region {
            Region::Box { low, high } => {
                let (low, high) = (vector::<D>(low), vector::<D>(high));
                Box::new(move |x, tie| (0..D).all(|d| x[d] >= low[d] - tie && x[d] <= high[d] + tie))
            }
            Region::Inside(shape) => {
                let shape = shape_of::<D>(shape);
                shape.validate().map_err(|e| self.refuse(&format!("{path}.inside"), e, ""))?;
                Box::new(move |x, tie| shape.holds(x, tie))
            }
            Region::Where(formula) => {
                let expression = self.expression(formula)?;
                Box::new(move |x, _| {
                    let x = crate::field::embed(x);
                    expression.evaluate(&[x[0], x[1], x[2], 0.0]) != 0.0
                })
            }
            Region::Layer { thickness } => {
                let Some(shape) = shape else {
                    return Err(self.refuse(path, "a layer needs the surface of `geometry.shape`", "use `where`"));
                };
                let thickness = *thickness;
                Box::new(move |x, tie| shape.signed_distance(x) >= -thickness - tie)
            }
            Region::All(regions) => {
                let all = regions.iter().map(|r| self.region(r, shape, path)).collect::<Result<Vec<_>>>()?;
                Box::new(move |x, tie| all.iter().all(|inside| inside(x, tie)))
            }
            Region::Any(regions) => {
                let any = regions.iter().map(|r| self.region(r, shape, path)).collect::<Result<Vec<_>>>()?;
                Box::new(move |x, tie| any.iter().any(|inside| inside(x, tie)))
            }
            Region::Not(region) => {
                let inside = self.region(region, shape, path)?;
                Box::new(move |x, tie| !inside(x, tie))
            }
        })
    }
}

pub(super) fn vector<const D: usize>(v: &[f64]) -> Vector<D> {
    std::array::from_fn(|d| v.get(d).copied().unwrap_or(0.0))
}

/// A shape of the case as geometry. `check` has made sure that it fits the dimension.
pub(super) fn shape_of<const D: usize>(shape: &model::Shape) -> Shape<D> {
    let center = |c: &Option<Vec<f64>>| c.as_deref().map_or([0.0; D], vector::<D>);
    let sized = |size: &[f64], c: &Option<Vec<f64>>| {
        let (c, size) = (center(c), vector::<D>(size));
        Shape::Box {
            low: std::array::from_fn(|d| c[d] - 0.5 * size[d]),
            high: std::array::from_fn(|d| c[d] + 0.5 * size[d]),
        }
    };
    let axis = |axis: &Axis| match axis {
        Axis::X => 0,
        Axis::Y => 1,
        Axis::Z => 2,
    };
    let pairs = |vertices: &[Vec<f64>]| vertices.iter().map(|v| vector::<2>(v)).collect::<Vec<_>>();
    let shapes = |shapes: &[model::Shape]| shapes.iter().map(shape_of::<D>).collect::<Vec<_>>();
    match shape {
        model::Shape::Segment { low, high } => Shape::Box { low: [*low; D], high: [*high; D] },
        model::Shape::Rectangle { size, center } | model::Shape::Block { size, center } => sized(size, center),
        model::Shape::Box { low, high } => Shape::Box { low: vector(low), high: vector(high) },
        model::Shape::Disk { radius, center: c } | model::Shape::Sphere { radius, center: c } => {
            Shape::Ball { center: center(c), radius: *radius }
        }
        model::Shape::Ring { inner, outer, center: c } => {
            Shape::Ring { center: center(c), inner: *inner, outer: *outer }
        }
        model::Shape::Cylinder { radius, length, axis: a, center: c } => {
            Shape::Cylinder { center: center(c), axis: axis(a), radius: *radius, inner: 0.0, length: *length }
        }
        model::Shape::Tube { inner, outer, length, axis: a, center: c } => {
            Shape::Cylinder { center: center(c), axis: axis(a), radius: *outer, inner: *inner, length: *length }
        }
        model::Shape::Polygon { vertices } => Shape::Polygon { vertices: pairs(vertices) },
        model::Shape::Extrusion { vertices, low, high } => {
            Shape::Extrusion { vertices: pairs(vertices), low: *low, high: *high }
        }
        model::Shape::Union(members) => Shape::Union(shapes(members)),
        model::Shape::Intersection(members) => Shape::Intersection(shapes(members)),
        model::Shape::Difference { of, minus } => Shape::Difference(Box::new(shape_of(of)), shapes(minus)),
    }
}

/// Bytes that the system can still give, if it tells.
pub fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find(|l| l.starts_with("MemAvailable:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}
