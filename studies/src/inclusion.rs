//! `inclusion`: a disc and a sphere in a body of other stiffness are strained evenly, and as much as Eshelby (1957) says.
//!
//! On the border of the body, in a layer of one horizon, displacements are those of an inclusion of radius R in an endless
//! body, so that its size does not matter. With n the stiffness of the inclusion over that of the body, and the Poisson ratio
//! of bonds in both (1/3 in plane stress, 1/4 in 3D), the strain inside over that far away is
//!
//! ```text
//! disc     3/(1 + 2n)          pulled evenly; and the same sheared
//! sphere   3.6/(2n + 1.6)      pulled evenly
//! ```
//!
//! which follows from u and σ_rr that are continuous at R: u = C r inside, A r + B/r^(D−1) outside; for shear from Muskhelishvili's
//! potentials A/z and −S z + A R²/z³. The strain inside is that of the linear field nearest to the displacements within R less
//! two horizons of the coarsest grid.

use super::{Measure, Outcome, Row, Study, simulation};
use bondwise::error::Result;
use bondwise::field::Values;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};

pub const STUDY: Study = Study {
    name: "inclusion",
    about: "a disc and a sphere, stiff and soft, against Eshelby's even strain, by spacing (finer with --full)",
    heavy: false,
    run,
};

/// R, of a body from −1 to 1.
const RADIUS: f64 = 0.5;

#[derive(Clone, Copy, PartialEq)]
enum Pull {
    Even,
    Shear,
}

/// The strain inside over that far away.
fn exact(dimension: usize, n: f64) -> f64 {
    if dimension == 2 { 3.0 / (1.0 + 2.0 * n) } else { 3.6 / (2.0 * n + 1.6) }
}

/// u of each component outside, with a strain of 1 far away, as formulas.
fn outside(dimension: usize, n: f64, pull: Pull) -> Vec<String> {
    let inside = exact(dimension, n);
    let square = RADIUS * RADIUS;
    let names = ["x", "y", "z"];
    if pull == Pull::Even {
        let b = (inside - 1.0) * RADIUS.powi(dimension as i32);
        let r = if dimension == 2 { "(x^2 + y^2)" } else { "(x^2 + y^2 + z^2)^1.5" };
        return names[..dimension].iter().map(|x| format!("{x}*(1 + {b}/{r})")).collect();
    }
    // 2μ u of S = 2μ (strain 1): with a = (1 − S_in/S) R² and S_in/S = n times the strain inside.
    let a = (1.0 - n * inside) * square;
    let kappa = 2.0;
    let r = "(x^2 + y^2)";
    vec![
        format!("{kappa}*{a}*x/{r} + {a}*(x^3 - 3*x*y^2)/{r}^2 + x - {a}*{square}*(x^3 - 3*x*y^2)/{r}^3"),
        format!("-{kappa}*{a}*y/{r} + {a}*(3*x^2*y - y^3)/{r}^2 - y - {a}*{square}*(3*x^2*y - y^3)/{r}^3"),
    ]
}

/// The strain inside of a body of `cells` cells along each side.
fn strain(dimension: usize, cells: usize, n: f64, pull: Pull) -> Result<f64> {
    let h = 2.0 / cells as f64;
    // A horizon of three cells beyond −1 and 1 is prescribed.
    let edge = 1.0 + 3.0 * h;
    let list = |value: f64| vec![value.to_string(); dimension].join(", ");
    let (low, high) = (list(-edge), list(edge));
    let r = ["", "", "x^2 + y^2", "x^2 + y^2 + z^2"][dimension];
    let beyond = ["", "", "max(abs(x), abs(y))", "max(abs(x), max(abs(y), abs(z)))"][dimension];
    let conditions: String = outside(dimension, n, pull)
        .iter()
        .enumerate()
        .map(|(d, u)| {
            format!("[[conditions]]\non = \"border\"\nprescribe = {{ displacement = {{ component = {d}, value = \"1e-3*({u})\" }} }}\n")
        })
        .collect();
    let text = format!(
        r#"
[case]
title = "Inclusion"
dimension = {dimension}
[geometry]
shape = {{ box = {{ low = [{low}], high = [{high}] }} }}
spacing = {h}
[sets]
inside = {{ where = "{r} < {RADIUS}^2" }}
outside = {{ where = "{r} >= {RADIUS}^2" }}
border = {{ where = "{beyond} > 1" }}
[discretization]
horizon_ratio = 3
influence = "linear"
[materials.inclusion]
young = {n}
density = 1
[materials.matrix]
young = 1
density = 1
[physics.elasticity]
law = {{ bond_based_linear = {{}} }}
materials = {{ inclusion = "inside", matrix = "outside" }}
{conditions}
[solver.static]
tolerance = 1e-7
"#
    );
    let mut simulation = simulation("inclusion", &text, &[])?;
    let model = &mut *simulation.model;
    model.start();
    model.step(&simulation.solver, &mut simulation.clock)?;
    let Some(Values::Vector(u)) = model.field("displacement").map(|field| field.values) else { return Ok(f64::NAN) };
    let (mut along, mut squares) = (0.0, 0.0);
    for (x, u) in model.positions().iter().zip(&u) {
        let square: f64 = x.iter().map(|x| x * x).sum();
        if square < (0.5 * RADIUS).powi(2) {
            along +=
                if pull == Pull::Even { x[0] * u[0] + x[1] * u[1] + x[2] * u[2] } else { x[0] * u[0] - x[1] * u[1] };
            squares += square;
        }
    }
    Ok(1e3 * along / squares)
}

fn run(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let mut series = Vec::new();
    let plane: &[usize] = if full { &[40, 80, 160, 320] } else { &[40, 80, 160] };
    let solid: &[usize] = if full { &[20, 40, 80] } else { &[20, 40] };
    for (dimension, pull, name, grids) in [
        (2, Pull::Even, "disc, pulled evenly", plane),
        (2, Pull::Shear, "disc, sheared", plane),
        (3, Pull::Even, "sphere, pulled evenly", solid),
    ] {
        for n in [10.0, 0.1] {
            let label = format!("{name}, {n} times as stiff");
            let expected = exact(dimension, n);
            let mut errors = Vec::new();
            for &cells in grids {
                let found = strain(dimension, cells, n, pull)?;
                errors.push((2.0 / cells as f64, (found / expected - 1.0).abs()));
                if cells == grids[grids.len() - 1] {
                    outcome.rows.push(Row::new(
                        format!("{label}, h = R/{}: strain inside over that far away", cells / 4),
                        expected,
                        found,
                        tolerance(dimension, full),
                        Measure::Relative,
                        "Eshelby 1957; bonds across the surface are springs in a row, and the surface is a staircase: both are \
                         errors of the order of h/R",
                    ));
                }
            }
            let [(coarse, first), .., (fine, last)] = errors[..] else { continue };
            // The moduli of the lattice at a finite m are cubic, and no closed form knows what that does to shear.
            let judged = if pull == Pull::Even { Measure::AtLeast } else { Measure::Information };
            outcome.rows.push(Row::new(
                format!("{label}: order of the error by spacing"),
                0.6,
                (first / last).ln() / (coarse / fine).ln(),
                0.0,
                judged,
                "first order; the staircase of a surface makes it uneven",
            ));
            series.push(Series { name: label, points: errors, style: Style::LineDots });
        }
    }
    let plot = Plot {
        title: "Strain of an inclusion: error by spacing".into(),
        x_label: "spacing over half the side of the body (-)".into(),
        y_label: "relative error (-)".into(),
        log_x: true,
        log_y: true,
        series,
        ..Plot::default()
    };
    outcome.plots.push(("error".into(), draw_plot(&plot, 1000, 650)));
    Ok(outcome)
}

/// Of the finest grid.
fn tolerance(dimension: usize, full: bool) -> f64 {
    match (dimension, full) {
        (2, false) => 0.02,
        (2, true) => 0.015,
        (_, false) => 0.06,
        _ => 0.03,
    }
}
