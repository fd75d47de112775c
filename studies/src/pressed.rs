//! `pressed`: bodies under pressure at rest. Forces are those of the surface, to rounding; displacements are printed beside the
//! closed forms, which bodies with families that end at their surface do not reach.

use std::f64::consts::PI;

use super::{Measure, Outcome, Row, Study, simulation};
use bondwise::error::Result;
use bondwise::field::Values;

pub const STUDY: Study = Study {
    name: "pressed",
    about: "disc, ring, cube and sphere under pressure: force on the surface, and displacement beside closed forms",
    heavy: false,
    run,
};

/// p/E of all bodies.
const STRAIN: f64 = 1e-4;

struct Body {
    name: &'static str,
    dimension: usize,
    shape: &'static str,
    spacing: f64,
    /// Part of the surface that is pressed, and its area: m² (2D: m).
    pressed: &'static str,
    area: f64,
    /// From where to where points are looked at, and which of their coordinates: their distance from the origin, or x.
    between: [f64; 2],
    round: bool,
    /// u E/p of the coordinate.
    exact: fn(f64) -> f64,
}

/// Plane stress, ν = 1/3: u = −(1 − ν) p r/E.
fn disc(r: f64) -> f64 {
    -2.0 / 3.0 * r
}

/// Lamé's ring from 8 to 20 mm under inner pressure, plane stress: u = p a²/(E (b² − a²)) ((1 − ν) r + (1 + ν) b²/r).
fn ring(r: f64) -> f64 {
    let [a, b]: [f64; 2] = [8e-3, 20e-3];
    a * a / (b * b - a * a) * (2.0 / 3.0 * r + 4.0 / 3.0 * b * b / r)
}

/// On all sides, ν = 1/4: u = −(1 − 2ν) p r/E.
fn solid(r: f64) -> f64 {
    -0.5 * r
}

const BODIES: &[Body] = &[
    Body {
        name: "disc",
        dimension: 2,
        shape: "{ disk = { radius = 20e-3 } }",
        spacing: 1e-3,
        pressed: "1",
        area: 2.0 * PI * 20e-3,
        between: [5e-3, 15e-3],
        round: true,
        exact: disc,
    },
    Body {
        name: "ring, pressed from within",
        dimension: 2,
        shape: "{ ring = { inner = 8e-3, outer = 20e-3 } }",
        spacing: 1e-3,
        pressed: "hypot(x, y) < 14e-3",
        area: 2.0 * PI * 8e-3,
        between: [12e-3, 16e-3],
        round: true,
        exact: ring,
    },
    Body {
        name: "cube",
        dimension: 3,
        shape: "{ block = { size = [12e-3, 12e-3, 12e-3] } }",
        spacing: 1e-3,
        pressed: "1",
        area: 6.0 * 144e-6,
        between: [2e-3, 4e-3],
        round: false,
        exact: solid,
    },
    Body {
        name: "sphere",
        dimension: 3,
        shape: "{ sphere = { radius = 7e-3 } }",
        spacing: 1e-3,
        pressed: "1",
        area: 4.0 * PI * 49e-6,
        between: [2e-3, 5e-3],
        round: true,
        exact: solid,
    },
];

fn case(body: &Body) -> String {
    let Body { name, dimension, shape, spacing, pressed, .. } = body;
    format!(
        r#"
[case]
title = "{name} under pressure"
dimension = {dimension}
[geometry]
shape = {shape}
spacing = {spacing}
[surfaces]
pressed = {{ where = "{pressed}" }}
[discretization]
horizon_ratio = 3
[physics.elasticity]
law = {{ bond_based_linear = {{ young = "100 GPa", density = "2000 kg/m^3" }} }}
[[conditions]]
on = "pressed"
load = {{ pressure = {{ value = "{STRAIN}*100e9" }} }}
[solver.static]
"#
    )
}

fn run(_: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for body in BODIES {
        let mut simulation = simulation("pressed", &case(body), &[])?;
        let load = &simulation.loads[0];
        let force = STRAIN * 100e9 * body.area;
        let off = load.force.iter().chain(&load.moment).fold(0.0, |most: f64, x| most.max(x.abs()));
        let origin = "sums over the pieces of the surface; area of the closed form";
        outcome.rows.push(Row::new(
            format!("{}: pressed area", body.name),
            body.area,
            load.area.unwrap_or(f64::NAN),
            1e-12,
            Measure::Relative,
            origin,
        ));
        let what = format!("{}: largest component of force and moment over pressure times area", body.name);
        outcome.rows.push(Row::new(what, 0.0, off / force, 1e-12, Measure::Absolute, "a closed surface is in balance"));
        let model = &mut *simulation.model;
        model.start();
        model.step(&simulation.solver, &mut simulation.clock)?;
        let Some(Values::Vector(u)) = model.field("displacement").map(|field| field.values) else { continue };
        let ratios: Vec<f64> = model
            .positions()
            .iter()
            .zip(&u)
            .filter_map(|(x, u)| {
                let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
                let along = x.iter().zip(u).map(|(x, u)| x * u).sum::<f64>() / r;
                let (at, u) = if body.round { (r, along) } else { (x[0], u[0]) };
                let [from, to] = body.between;
                (from < at && at < to).then(|| u / (STRAIN * (body.exact)(at)))
            })
            .collect();
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        outcome.rows.push(Row::new(
            format!("{}: mean displacement inside, over the closed form", body.name),
            1.0,
            mean,
            0.0,
            Measure::Information,
            "Lamé's, of an elastic body; families that end at the surface make it soft there, which no load mends",
        ));
    }
    Ok(outcome)
}
