//! What a crack costs: a straight crack, driven slowly, takes the fracture energy for each new area.
//!
//! A strip of glass is clamped along its long edges. The edges are moved apart by a wedge that travels along the strip
//! at 6 % of the Rayleigh speed, so that the crack follows it steadily and stays where the wedge gives it just what it
//! needs. Only bonds across the middle line may break. Energies are taken over the way of the crack, away from its
//! start and from the ends of the strip, as slopes of straight lines over the position of the tip.
//!
//! What was not put in: bonds know a critical stretch and nothing of areas or of G₀. The scheme's own value for the
//! energy of all bonds across a line, W, differs from G₀ at a finite spacing; the rest is that bonds pass the critical
//! stretch within a step, not at its end.

use super::{Measure, Outcome, Row, simulation};
use bondwise::discretization::{Influence, PartialVolume};
use bondwise::error::Result;
use bondwise::output::picture::{CloudView, Image, Picture, Sizes, draw};
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::output::source::{Source, deformed, scalar};
use bondwise::physics::elasticity::discrete::discrete_moduli;
use bondwise::physics::elasticity::moduli::Hypothesis;
use bondwise::simulation::Simulation;

pub(super) const CASE: &str = include_str!("fracture_work.toml");
/// G₀ of the case, J/m².
const FRACTURE_ENERGY: f64 = 3.8;
/// Where the tip is while slopes are taken, m.
const MEASURED: std::ops::RangeInclusive<f64> = -4e-3..=8e-3;
pub(super) const LOOK_EVERY: u64 = 20;

const GRIFFITH: &str = "Griffith: a crack takes G₀ for each new area, Shojaei et al. 2022, eq. (20); 10 % for the finite \
    spacing (W/G₀ is 0.929 with whole cells and 1.021 with the ramp at m = 4)";

/// One crack: which partial volumes, and whether bonds beside the middle line may break too.
struct Variant {
    rule: PartialVolume,
    free: bool,
    /// Speed of the wedge, m/s.
    speed: f64,
}

/// Energies (J/m) over the way of the tip (m).
#[derive(Default)]
pub(super) struct Way {
    pub tip: Vec<f64>,
    pub external: Vec<f64>,
    pub fracture: Vec<f64>,
    pub damped: Vec<f64>,
    /// Kinetic and strain energy.
    pub stored: Vec<f64>,
    pub imbalance: f64,
    /// Largest distance of a damaged point from the middle line, in horizons.
    pub width: f64,
}

pub fn run(full: bool) -> Result<Outcome> {
    let mut variants: Vec<Variant> =
        [PartialVolume::None, PartialVolume::Ramp].map(|rule| Variant { rule, free: false, speed: 200.0 }).into();
    if full {
        for rule in [PartialVolume::None, PartialVolume::Ramp] {
            variants.push(Variant { rule, free: true, speed: 200.0 });
            variants.push(Variant { rule, free: false, speed: 100.0 });
        }
    }
    let mut outcome = Outcome::default();
    let mut curves = Vec::new();
    for variant in &variants {
        let (way, picture) = march(variant)?;
        let label = variant.label();
        let discrete =
            discrete_moduli(Hypothesis::PlaneStress, &Influence::Constant, variant.rule, 4.0).fracture_energy;
        let per_area = |energies: &[f64]| way.slope(energies) / FRACTURE_ENERGY;
        let (fracture, damped) = (per_area(&way.fracture), per_area(&way.damped));
        let supplied = per_area(&way.external) - damped - per_area(&way.stored);
        outcome.rows.push(Row::new(
            format!("{label}: energy of broken bonds per new area, over G₀"),
            1.0,
            fracture,
            0.1,
            Measure::Absolute,
            GRIFFITH,
        ));
        outcome.rows.push(Row::new(
            format!("{label}: work of the wedge less what is stored and damped, per new area, over G₀"),
            1.0,
            supplied,
            0.1,
            Measure::Absolute,
            GRIFFITH,
        ));
        if !variant.free {
            outcome.rows.push(Row::new(
                format!("{label}: energy of broken bonds per new area, over G₀"),
                discrete,
                fracture,
                0.02,
                Measure::Relative,
                "energy of all bonds across a line at the critical stretch, lattice sum; 2 % because the tip moves by \
                 whole cells, flat bonds break behind it, and some bonds overshoot",
            ));
        }
        outcome.rows.push(Row::new(
            format!("{label}: largest energy defect over largest external work"),
            0.01,
            way.imbalance,
            0.0,
            Measure::AtMost,
            "what velocity Verlet at 90 % of the stable step and the trapezoidal rule for work and damping leave",
        ));
        if variant.free {
            outcome.rows.push(Row::new(
                format!("{label}: largest distance of damage from the middle line, in horizons"),
                1.0,
                way.width,
                0.0,
                Measure::AtMost,
                "nothing holds this crack on its path but the symmetry of strip and wedge; a straight crack damages the points whose bonds \
                 cross it",
            ));
        }
        outcome.notes.push(format!(
            "{label}: of the work per new area, {:.3} G₀, broken bonds take {fracture:.3} G₀, damping {damped:.3} G₀",
            per_area(&way.external)
        ));
        curves.push((variant, way));
        outcome.plots.push((format!("damage_{}", variant.file()), picture));
    }
    outcome.plots.insert(0, ("energy".into(), draw_plot(&plot(&curves), 1000, 650)));
    Ok(outcome)
}

fn march(variant: &Variant) -> Result<(Way, Image)> {
    let speed = format!("{} m/s", variant.speed);
    let within = if variant.free { "3.8 J/m^2" } else { "1e20 J/m^2" };
    let overrides = [
        ("discretization.partial_volumes", variant.rule.name()),
        ("constants.speed", speed.as_str()),
        ("constants.within", within),
    ];
    let mut run = simulation("fracture_work.toml", CASE, &overrides)?;
    let (way, damage) = follow(&mut run)?;
    let picture = picture(&mut *run.model, variant, &damage, run.clock.time());
    Ok((way, picture))
}

/// Runs a strip to its end; the way of its crack, and the damage at the end.
pub(super) fn follow(run: &mut Simulation) -> Result<(Way, Vec<f64>)> {
    let mut tip = run.history.tip.take();
    let model = &mut *run.model;
    let mut way = Way::default();
    let (mut defect, mut work) = (0.0f64, 0.0f64);
    model.start();
    while run.clock.step < run.n_steps {
        model.step(&run.solver, &mut run.clock)?;
        if !run.clock.step.is_multiple_of(LOOK_EVERY) {
            continue;
        }
        let energy = model.balance();
        defect = defect.max(energy.defect().abs());
        work = work.max(energy.external);
        if let Some(tip) = &mut tip {
            tip.follow(model, run.clock.time());
            if let Some(x) = tip.position {
                way.tip.push(x[0]);
                way.external.push(energy.external);
                way.fracture.push(energy.fracture);
                way.damped.push(energy.damped);
                way.stored.push(energy.kinetic + energy.strain);
            }
        }
    }
    way.imbalance = defect / work;
    let damage = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
    let horizon = model.facts().horizon;
    let damaged = model.positions().iter().zip(&damage).filter(|(_, d)| **d > 0.35);
    way.width = damaged.map(|(x, _)| x[1].abs() / horizon).fold(0.0, f64::max);
    Ok((way, damage))
}

fn picture(model: &mut dyn Source, variant: &Variant, damage: &[f64], time: f64) -> Image {
    let positions = deformed(model, 500.0);
    let sizes = Sizes::Same(model.facts().spacing);
    let cloud = CloudView { positions: &positions, sizes, values: damage, dimension: 2 };
    let picture = Picture {
        title: format!("{}, displacements × 500", variant.label()),
        label: "damage [-]".into(),
        ..Picture::default()
    };
    draw(&picture, &cloud, Some(time))
}

impl Variant {
    fn label(&self) -> String {
        let cells = if self.rule == PartialVolume::None { "whole cells" } else { "ramp" };
        let path = if self.free { "free path" } else { "straight path" };
        format!("{cells}, {path}, {} m/s", self.speed)
    }

    fn file(&self) -> String {
        format!("{}_{}_{}", self.rule.name(), if self.free { "free" } else { "straight" }, self.speed)
    }
}

impl Way {
    /// Slope of the least-squares line of `energies` over the position of the tip, J/m²; NaN if the tip was never
    /// where it is measured.
    pub(super) fn slope(&self, energies: &[f64]) -> f64 {
        let measured = || self.tip.iter().zip(energies).filter(|(x, _)| MEASURED.contains(*x));
        let n = measured().count() as f64;
        let mean = measured().fold((0.0, 0.0), |m, (x, e)| (m.0 + x / n, m.1 + e / n));
        let (mut sxy, mut sxx) = (0.0, 0.0);
        for (x, e) in measured() {
            sxy += (x - mean.0) * (e - mean.1);
            sxx += (x - mean.0).powi(2);
        }
        sxy / sxx
    }
}

fn plot(curves: &[(&Variant, Way)]) -> Plot {
    let mut series: Vec<Series> = curves
        .iter()
        .map(|(variant, way)| Series {
            name: variant.label(),
            points: way.tip.iter().copied().zip(way.fracture.iter().copied()).collect(),
            style: Style::Line,
        })
        .collect();
    let ends = [-8e-3, 8e-3];
    series.push(Series {
        name: "G₀ × crack length".into(),
        points: ends.iter().map(|x| (*x, FRACTURE_ENERGY * (x - ends[0]))).collect(),
        style: Style::Dashed,
    });
    Plot {
        title: "Energy that broken bonds took".into(),
        x_label: "position of the tip [m]".into(),
        y_label: "energy per thickness [J/m]".into(),
        series,
        ..Plot::default()
    }
}
