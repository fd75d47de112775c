//! `convergence`: the three kinds of convergence of bodies at rest, in 1D, 2D and 3D, against a manufactured solution.
//!
//! u* = a cos(k·x + φ). A linear bond-based operator answers a plane wave with a plane wave, so the load under which u*
//! rests is b = M a cos(k·x + φ), with the symbol M of whichever operator u* shall solve:
//!
//! ```text
//! M = ∫ ω c (ξ ⊗ ξ)/|ξ|³ (1 − cos k·ξ) dV                      nonlocal
//! M = Σ ω c (ξ ⊗ ξ)/|ξ|³ (1 − cos k·ξ) β V                      the scheme on an endless lattice
//! Mᵢᵢ = C₁₁ kᵢ² + C₁₂ (|k|² − kᵢ²),   Mᵢⱼ = 2 C₁₂ kᵢ kⱼ          local; cubic, of which isotropy is C₁₁ = 3 C₁₂
//! ```
//!
//! The body is a cube; u* is prescribed in a layer around it as thick as the horizon and a cell.

use super::bar::rate;
use super::navier::directions;
use super::{Measure, Outcome, Row, Study, simulation};
use bondwise::discretization::quadrature::gauss_legendre;
use bondwise::discretization::{Influence, PartialVolume};
use bondwise::error::{Error, Result};
use bondwise::field::Values;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::physics::elasticity::discrete::{discrete_moduli, lattice_points};
use bondwise::physics::elasticity::moduli::{Hypothesis, Stiffness, micromodulus};

pub const STUDY: Study = Study {
    name: "convergence",
    about: "m-, δ- and (δm)-convergence of bodies at rest in 1D, 2D and 3D (finer with --full)",
    heavy: false,
    run,
};

/// Forces are balanced to this share of the reactions.
const BALANCE: f64 = 1e-10;

type Matrix<const D: usize> = [[f64; D]; D];

/// u* = a cos(k·x + φ), in m; E = 1 Pa.
#[derive(Clone, Copy)]
struct Wave<const D: usize> {
    k: [f64; D],
    a: [f64; D],
    phase: f64,
}

impl<const D: usize> Wave<D> {
    /// Along no axis and no diagonal of the lattice, neither longitudinal nor transversal; no symmetry about the middle.
    fn oblique(k: f64) -> Self {
        let take = |v: [f64; 3]| std::array::from_fn(|d| v[d]);
        Wave { k: take([k, 0.25 * k, 0.125 * k]), a: take([1.0, 0.5, -0.5]), phase: 0.4 }
    }

    fn at(&self, x: &[f64; 3]) -> f64 {
        ((0..D).map(|d| self.k[d] * x[d]).sum::<f64>() + self.phase).cos()
    }

    /// Of the formula language, with an amplitude.
    fn formula(&self, amplitude: f64) -> String {
        let terms: Vec<String> = (0..D).map(|d| format!("({:e})*{}", self.k[d], AXES[d])).collect();
        format!("({amplitude:e})*cos({} + {:e})", terms.join(" + "), self.phase)
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// A cube and its scheme; lengths in m.
#[derive(Clone, Copy)]
struct Body {
    /// Half the side of its inside, a multiple of the spacing.
    half: f64,
    horizon: f64,
    m: u32,
    influence: Influence,
    rule: PartialVolume,
}

/// u − u* inside.
struct Found<const D: usize> {
    /// Root mean square over that of u*.
    mean: f64,
    /// Largest over the largest |u*|.
    largest: f64,
    /// How much of the wave is in each component of u, over how much of it is in u*: by projection on the period in the
    /// middle of the first axis, near that axis.
    amplitude: [f64; D],
}

fn hypothesis<const D: usize>() -> Hypothesis {
    [Hypothesis::Bar, Hypothesis::PlaneStress, Hypothesis::Solid][D - 1]
}

/// The nonlocal symbol times δ², k in 1/δ.
///
/// By quadrature, to round-off for |k| ≤ 5: the series of cos 5 ends there at the 40th power.
fn nonlocal<const D: usize>(influence: &Influence, k: [f64; D]) -> Matrix<D> {
    let c = micromodulus(hypothesis::<D>(), influence, 1.0, 1.0);
    let directions = directions::<D>(48);
    let bonds = gauss_legendre(24).into_iter().flat_map(|(t, radial)| {
        let weight = radial * t.powi(D as i32 - 1) * influence.value(t);
        directions.iter().map(move |(n, angular)| (n.map(|n| t * n), weight * angular)).collect::<Vec<_>>()
    });
    symbol(bonds.map(|(xi, weight)| (xi, c * weight)), k)
}

/// The symbol of the scheme times δ², k in 1/δ.
fn lattice<const D: usize>(body: &Body, k: [f64; D]) -> Matrix<D> {
    let m = f64::from(body.m);
    let c = micromodulus(hypothesis::<D>(), &body.influence, 1.0, m);
    let bonds = lattice_points::<D>(body.rule, m).filter(|(xi, _)| xi.iter().any(|x| *x != 0.0)).map(|(xi, beta)| {
        let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
        (xi, c * beta * body.influence.quadrature_value(length / m))
    });
    symbol(bonds, k.map(|k| k / m)).map(|row| row.map(|x| x * m * m))
}

/// Σ weight (ξ ⊗ ξ)/|ξ|³ (1 − cos k·ξ)
fn symbol<const D: usize>(bonds: impl Iterator<Item = ([f64; D], f64)>, k: [f64; D]) -> Matrix<D> {
    let mut sum = [[0.0; D]; D];
    for (xi, weight) in bonds {
        let length = xi.iter().map(|x| x * x).sum::<f64>().sqrt();
        let phase: f64 = (0..D).map(|d| k[d] * xi[d]).sum();
        let share = weight * 2.0 * (0.5 * phase).sin().powi(2) / length.powi(3);
        for (row, x) in sum.iter_mut().zip(xi) {
            for (entry, y) in row.iter_mut().zip(xi) {
                *entry += share * x * y;
            }
        }
    }
    sum
}

/// The symbol of the Navier operator of a cubic body.
fn local<const D: usize>(Stiffness { c11, c12 }: Stiffness, k: [f64; D]) -> Matrix<D> {
    let square: f64 = k.iter().map(|k| k * k).sum();
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            if i == j { c11 * k[i] * k[i] + c12 * (square - k[i] * k[i]) } else { 2.0 * c12 * k[i] * k[j] }
        })
    })
}

fn times<const D: usize>(matrix: &Matrix<D>, a: [f64; D]) -> [f64; D] {
    matrix.map(|row| row.iter().zip(a).map(|(x, a)| x * a).sum())
}

/// x of M x = b, M symmetric and positive.
fn solved<const D: usize>(mut matrix: Matrix<D>, mut b: [f64; D]) -> [f64; D] {
    for i in 0..D {
        let (pivot, value) = (matrix[i], b[i]);
        for r in (0..D).filter(|r| *r != i) {
            let share = matrix[r][i] / pivot[i];
            b[r] -= share * value;
            for (entry, p) in matrix[r].iter_mut().zip(pivot) {
                *entry -= share * p;
            }
        }
    }
    std::array::from_fn(|i| b[i] / matrix[i][i])
}

/// |x − y|/|y|
fn distance<const D: usize>(x: [f64; D], y: [f64; D]) -> f64 {
    let square = |f: &dyn Fn(usize) -> f64| (0..D).map(|d| f(d).powi(2)).sum::<f64>();
    (square(&|d| x[d] - y[d]) / square(&|d| y[d])).sqrt()
}

impl Body {
    fn spacing(&self) -> f64 {
        self.horizon / f64::from(self.m)
    }

    /// What the wave with amplitude `layer` around the body and the load with amplitude `b` make of it.
    fn at_rest<const D: usize>(&self, wave: &Wave<D>, layer: [f64; D], b: [f64; D]) -> Result<Found<D>> {
        let outer = self.half + f64::from(self.m + 1) * self.spacing();
        let shape = match D {
            1 => format!("segment = {{ low = {:e}, high = {outer:e} }}", -outer),
            2 => format!("rectangle = {{ size = [{0:e}, {0:e}] }}", 2.0 * outer),
            _ => format!("block = {{ size = [{0:e}, {0:e}, {0:e}] }}", 2.0 * outer),
        };
        let far = ["abs(x)", "max(abs(x), abs(y))", "max(max(abs(x), abs(y)), abs(z))"][D - 1];
        let mut text = format!(
            r#"
[case]
title = "Plane wave at rest"
dimension = {D}
[geometry]
shape = {{ {shape} }}
spacing = {spacing:e}
[sets]
inside = {{ where = "{far} < {half:e}" }}
layer = {{ where = "{far} > {half:e}" }}
[discretization]
horizon = {horizon:e}
influence = "{influence}"
partial_volumes = "{rule}"
[physics.elasticity]
law = {{ bond_based_linear = {{ young = 1.0, density = 1.0 }} }}
[solver.static]
tolerance = {BALANCE:e}
"#,
            spacing = self.spacing(),
            half = self.half,
            horizon = self.horizon,
            influence = self.influence.name(),
            rule = self.rule.name(),
        );
        for c in 0..D {
            let (u, b) = (wave.formula(layer[c]), wave.formula(b[c]));
            text += &format!(
                "[[conditions]]\non = \"layer\"\nprescribe = {{ displacement = {{ component = {c}, value = \"{u}\" }} }}\n\
                 [[conditions]]\non = \"inside\"\nload = {{ body_force = {{ component = {c}, value = \"{b}\" }} }}\n"
            );
        }
        let mut simulation = simulation("convergence", &text, &[])?;
        let model = &mut *simulation.model;
        model.start();
        model.step(&simulation.solver, &mut simulation.clock)?;
        let Some(Values::Vector(u)) = model.field("displacement").map(|field| field.values) else {
            return Err(Error::Refused("a body at rest has displacements".into()));
        };
        let (mut off, mut size, mut largest, mut top) = (0.0, 0.0, 0.0_f64, 0.0_f64);
        let (mut shares, mut squares) = ([0.0; D], 0.0);
        let within = |x: &[f64; 3], half: f64| x.iter().all(|x| x.abs() < half);
        for (x, u) in model.positions().iter().zip(&u).filter(|(x, _)| within(x, self.half)) {
            let wave_here = wave.at(x);
            let exact = wave.a.map(|a| a * wave_here);
            let difference = (0..D).map(|d| (u[d] - exact[d]).powi(2)).sum::<f64>();
            let square = exact.iter().map(|u| u * u).sum::<f64>();
            (off, size) = (off + difference, size + square);
            (largest, top) = (largest.max(difference.sqrt()), top.max(square.sqrt()));
            if x[0].abs() < self.half / 1.5 && within(&[0.0, x[1], x[2]], self.half / 6.0) {
                squares += wave_here * wave_here;
                for d in 0..D {
                    shares[d] += wave_here * u[d] / wave.a[d];
                }
            }
        }
        let amplitude = shares.map(|share| share / squares);
        Ok(Found { mean: (off / size).sqrt(), largest: largest / top, amplitude })
    }
}

fn run(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    at_fixed_horizon(full, &mut outcome)?;
    at_fixed_ratio(full, &mut outcome)?;
    both(full, &mut outcome)?;
    outcome.notes.push(
        "Ramp volumes do not converge smoothly: β follows |ξ| and not the cell, so what the rim adds is the noise of counting \
         lattice points in a ball, m^−(D+1)/2, if little of it. With exact volumes the rim adds m^−(D+3)/2, below what the \
         one-point rule leaves in every cell, m^−2. In 1D both rules are the trapezoidal one."
            .into(),
    );
    Ok(outcome)
}

/// `ratios`, with `--full` those of `finer` too.
fn extended(full: bool, ratios: &[u32], finer: &[u32]) -> Vec<u32> {
    ratios.iter().chain(finer.iter().filter(|_| full)).copied().collect()
}

/// Errors over m or over n of one series of bodies.
#[derive(Default)]
struct Errors {
    mean: Vec<(f64, f64)>,
    largest: Vec<(f64, f64)>,
}

impl Errors {
    fn push<const D: usize>(&mut self, x: u32, found: &Found<D>) {
        self.mean.push((f64::from(x), found.mean));
        self.largest.push((f64::from(x), found.largest));
    }

    /// The order from the two finest.
    fn rows(&self, what: &str, expected: f64, tolerance: f64, origin: &str, outcome: &mut Outcome) {
        for (errors, norm) in [(&self.mean, "mean error"), (&self.largest, "largest error")] {
            let last = &errors[errors.len() - 2..];
            let what = format!("{what}, order of the {norm}, {} to {}", last[0].0, last[1].0);
            outcome.rows.push(Row::new(what, expected, rate(last), tolerance, Measure::Absolute, origin));
        }
    }

    fn series(self, name: String) -> Series {
        Series { name, points: self.mean, style: Style::LineDots }
    }
}

/// δ fixed, m → ∞: u* rests under the load of the nonlocal operator.
fn at_fixed_horizon(full: bool, outcome: &mut Outcome) -> Result<()> {
    let mut series = Vec::new();
    let bar = "the trapezoidal rule; the next term is h² of it";
    m_rows::<1>(Influence::Constant, &[4, 8, 16, 32, 64], (0.01, bar), outcome, &mut series)?;
    m_rows::<1>(Influence::Linear, &[4, 8, 16, 32, 64], (0.01, bar), outcome, &mut series)?;
    let plane = "one point in the middle of every cell; the corner of the integrand at ξ = 0 adds h³, which takes 0.2 at m = 16, \
                 0.1 at 32";
    m_rows::<2>(Influence::Constant, &extended(full, &[4, 8, 12, 16], &[32]), (0.25, plane), outcome, &mut series)?;
    let space = "one point in the middle of every cell; the noise of the rim is of order 3";
    m_rows::<3>(Influence::Constant, &extended(full, &[3, 4, 5, 6], &[8]), (0.15, space), outcome, &mut series)?;
    series.push(slope(&[4.0, 64.0], 0.6, -2));
    plot(outcome, "m", "m-convergence at δ = 1: to the nonlocal solution", "m = δ/h [-]", series);
    Ok(())
}

fn m_rows<const D: usize>(
    influence: Influence,
    ratios: &[u32],
    (tolerance, origin): (f64, &str),
    outcome: &mut Outcome,
    series: &mut Vec<Series>,
) -> Result<()> {
    let wave = Wave::<D>::oblique(4.0);
    let b = times(&nonlocal(&influence, wave.k), wave.a);
    // In a bar the ramp is exact.
    let rules = if D == 1 { &[PartialVolume::Exact][..] } else { &[PartialVolume::Exact, PartialVolume::Ramp] };
    for &rule in rules {
        let body = |m| Body { half: 1.0, horizon: 1.0, m, influence, rule };
        let name = format!("{D}D, {}, {}", influence.name(), rule.name());
        let mut errors = Errors::default();
        for &m in ratios {
            errors.push(m, &body(m).at_rest(&wave, wave.a, b)?);
        }
        if rule == PartialVolume::Exact {
            errors.rows(&format!("m-convergence, {name}"), 2.0, tolerance, origin, outcome);
        } else {
            let finest = if D == 2 { 64 } else { 16 };
            let off = |m| (f64::from(m), distance(times(&lattice(&body(m), wave.k), wave.a), b));
            let errors: Vec<_> = (finest / 8 + 2..=finest).map(off).collect();
            outcome.rows.push(Row::new(
                format!("m-convergence, {name}: order of the error of M a, fit over m = {} to {finest}", errors[0].0),
                0.5 * (D as f64 + 1.0),
                rate(&errors),
                0.3,
                Measure::Absolute,
                "the noise of counting lattice points in a ball, (D + 1)/2; it moves by a factor of two about its trend, a fit \
                 over a factor of four to eight in m by 0.3",
            ));
        }
        series.push(errors.series(name.clone()));
        let body = body(ratios[1]);
        let own = Wave { a: solved(lattice(&body, wave.k), b), ..wave };
        outcome.rows.push(Row::new(
            format!("m = {}, {name}: largest error against the wave of the lattice", body.m),
            1e-9,
            body.at_rest(&own, own.a, b)?.largest,
            0.0,
            Measure::AtMost,
            "the same load and the symbol summed over the lattice, with its own wave in the layer: exact, but for forces \
             balanced to 1e-10",
        ));
    }
    Ok(())
}

/// By how much the order from δ and δ/2 is above 2 in a body of side 1 that is held in a layer: its errors are those of a
/// body up to δ longer, of order δ² (1 + δ)².
fn longer(horizon: f64) -> f64 {
    2.0 * ((1.0 + horizon) / (1.0 + 0.5 * horizon)).log2()
}

const LONGER: &str =
    "the nonlocal part is of order (kδ)²; the body, held in a layer, bends as one that is up to δ longer: δ² (1 + δ)²";

/// m fixed, δ → 0: the local solution of a cubic body with the moduli of the lattice, and no other.
fn at_fixed_ratio(full: bool, outcome: &mut Outcome) -> Result<()> {
    let mut series = Vec::new();
    delta_rows::<1>(Influence::Linear, &[12, 24, 48, 96, 192], outcome, &mut series)?;
    delta_rows::<2>(Influence::Constant, &extended(full, &[12, 24, 48, 96], &[192]), outcome, &mut series)?;
    delta_rows::<3>(Influence::Constant, &extended(full, &[6, 12, 24], &[48]), outcome, &mut series)?;
    series.push(slope(&[6.0, 192.0], 0.5, -2));
    plot(
        outcome,
        "delta",
        "δ-convergence at m = 3: to the local solution",
        "spacings to the side of the body [-]",
        series,
    );
    Ok(())
}

fn delta_rows<const D: usize>(
    influence: Influence,
    cells: &[u32],
    outcome: &mut Outcome,
    series: &mut Vec<Series>,
) -> Result<()> {
    let (m, rule) = (3, PartialVolume::Ramp);
    let name = format!("{D}D, {}, m = {m}", influence.name());
    let exact = hypothesis::<D>().stiffness(1.0);
    let ratio = discrete_moduli(hypothesis::<D>(), &influence, rule, f64::from(m));
    let discrete = Stiffness { c11: exact.c11 * ratio.c11, c12: exact.c12 * ratio.c12.unwrap_or(0.0) };
    let body = |n: u32| Body { half: 0.5, horizon: f64::from(m) / f64::from(n), m, influence, rule };
    let wave = Wave::<D>::oblique(2.0);
    let (mut raw, mut corrected) = (Errors::default(), Errors::default());
    for &n in cells {
        let with = |moduli| body(n).at_rest(&wave, wave.a, times(&local(moduli, wave.k), wave.a));
        raw.push(n, &with(exact)?);
        corrected.push(n, &with(discrete)?);
    }
    corrected.rows(
        &format!("δ-convergence, {name}, moduli of the lattice"),
        2.0,
        longer(body(cells[cells.len() - 2]).horizon),
        LONGER,
        outcome,
    );
    series.push(raw.series(format!("{D}D, {}", influence.name())));
    series.push(corrected.series(format!("{D}D, {}, moduli of the lattice", influence.name())));

    // Along an axis, zero at both ends of the inside, so that a wave of another amplitude fits there as well.
    let k = std::array::from_fn(|d| if d == 0 { 3.0 * std::f64::consts::PI } else { 0.0 });
    let wave = Wave::<D> { k, a: [1.0; D], phase: 0.0 };
    let [.., coarse, fine] = *cells else { unreachable!("there are two bodies at least") };
    let b = times(&local(exact, wave.k), wave.a);
    let amplitude = |n| -> Result<[f64; D]> { Ok(body(n).at_rest(&wave, wave.a, b)?.amplitude) };
    let of_lattice = |n: u32| -> [f64; D] {
        let h = body(n).horizon;
        let symbol = lattice(&body(n), wave.k.map(|k| k * h));
        std::array::from_fn(|d| b[d] * h * h / symbol[d][d])
    };
    let (found, expected) = ([amplitude(coarse)?, amplitude(fine)?], [of_lattice(coarse), of_lattice(fine)]);
    let limit = |[coarse, fine]: &[[f64; D]; 2], d: usize| (4.0 * fine[d] - coarse[d]) / 3.0;
    // (1 + ky (λ + μ)/(λ + 3μ)) e^(−ky) at a distance y from a side with other values; λ = μ, y = 5/12.
    let ky = 1.25 * std::f64::consts::PI;
    let sides = 2.0 * (D as f64 - 1.0) * (1.0 + 0.5 * ky) * (-ky).exp();
    let waves = [("longitudinal", "C₁₁", Some(ratio.c11)), ("transversal", "C₁₂", ratio.c12)];
    for (d, (kind, modulus, ratio)) in waves.into_iter().enumerate() {
        let Some(ratio) = ratio else { continue };
        let held = (sides + body(fine).horizon) * (1.0 / ratio - 1.0).abs();
        outcome.rows.push(Row::new(
            format!("{name}: {kind} wave under the load of the exact moduli, n = {fine}, amplitude over that of u*"),
            expected[1][d],
            found[1][d],
            held,
            Measure::Absolute,
            "local over lattice symbol; the layer holds u*, felt from each side as (1 + ky/2) e^(−ky), from the ends as δ",
        ));
        outcome.rows.push(Row::new(
            format!("δ-convergence, {name}: the same to δ = 0 from n = {coarse} and {fine}"),
            1.0 / ratio,
            limit(&found, d),
            held + (limit(&expected, d) - 1.0 / ratio).abs(),
            Measure::Absolute,
            format!(
                "exact over discrete {modulus}: to another solution; as before, and (kδ)⁴ as the lattice symbol has it"
            ),
        ));
    }
    Ok(())
}

/// δ → 0 with m = 1/δ: the local solution.
fn both(full: bool, outcome: &mut Outcome) -> Result<()> {
    let mut series = Vec::new();
    both_rows::<1>(&[4, 8, 16, 32], 0.0, outcome, &mut series)?;
    both_rows::<2>(&extended(full, &[3, 4, 6, 8, 12], &[16]), 0.1, outcome, &mut series)?;
    both_rows::<3>(&extended(full, &[2, 3, 4], &[5, 6]), 0.1, outcome, &mut series)?;
    series.push(slope(&[3.0, 32.0], 0.5, -2));
    plot(outcome, "delta-m", "(δm)-convergence, m = 1/δ: to the local solution", "m = 1/δ [-]", series);
    Ok(())
}

fn both_rows<const D: usize>(
    ratios: &[u32],
    rule_alone: f64,
    outcome: &mut Outcome,
    series: &mut Vec<Series>,
) -> Result<()> {
    let (influence, rule) = (Influence::Constant, PartialVolume::Exact);
    let wave = Wave::<D>::oblique(6.0);
    let b = times(&local(hypothesis::<D>().stiffness(1.0), wave.k), wave.a);
    let mut errors = Errors::default();
    for &m in ratios {
        let body = Body { half: 0.5, horizon: 1.0 / f64::from(m), m, influence, rule };
        errors.push(m, &body.at_rest(&wave, wave.a, b)?);
    }
    errors.rows(
        &format!("(δm)-convergence, {D}D, m = 1/δ"),
        2.0,
        longer(1.0 / f64::from(ratios[ratios.len() - 2])) + rule_alone,
        "both parts, (kδ)² of the nonlocal operator and m^−2 of the rule, are of order δ²; held in a layer, see above; at \
         small m the rule in 2D and 3D is better than its order",
        outcome,
    );
    series.push(errors.series(format!("{D}D")));
    Ok(())
}

/// A line of slope `power`, `factor` times x to that power.
fn slope(ends: &[f64], factor: f64, power: i32) -> Series {
    let points = ends.iter().map(|x| (*x, factor * x.powi(power))).collect();
    Series { name: format!("slope {power}"), points, style: Style::Dashed }
}

fn plot(outcome: &mut Outcome, name: &str, title: &str, x_label: &str, series: Vec<Series>) {
    let plot = Plot {
        title: title.into(),
        x_label: x_label.into(),
        y_label: "root mean square error over that of u* [-]".into(),
        log_x: true,
        log_y: true,
        series,
        ..Plot::default()
    };
    outcome.plots.push((name.into(), draw_plot(&plot, 1000, 700)));
}

#[cfg(test)]
mod tests {
    use super::super::exact::bar_dispersion;
    use super::*;

    #[test]
    fn the_symbol_of_a_bar_has_its_closed_form() {
        for influence in [Influence::Constant, Influence::Linear, Influence::Inverted] {
            for z in [0.5, 2.0, 5.0] {
                let [[symbol]] = nonlocal(&influence, [z]);
                let closed = z * z * bar_dispersion(&influence, z).unwrap();
                assert!((symbol / closed - 1.0).abs() < 1e-13, "{} {z}: {symbol} against {closed}", influence.name());
            }
        }
    }

    fn long_waves<const D: usize>() {
        let near = |a: &Matrix<D>, b: &Matrix<D>, tolerance: f64| {
            a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() < tolerance)
        };
        let size: f64 = 1e-3;
        let k = std::array::from_fn(|d| size * [2.0, 1.0, -0.5][d]);
        let exact = hypothesis::<D>().stiffness(1.0);
        // What is left out is below |k|⁴/24 times a modulus near 1.2; |k|² is 5 size².
        let tolerance = 2.0 * size.powi(4);
        assert!(near(&nonlocal(&Influence::Linear, k), &local(exact, k), tolerance), "{D}D, nonlocal");
        for rule in PartialVolume::ALL {
            let body = Body { half: 1.0, horizon: 1.0, m: 3, influence: Influence::Linear, rule };
            let ratio = discrete_moduli(hypothesis::<D>(), &body.influence, rule, 3.0);
            let found = Stiffness { c11: exact.c11 * ratio.c11, c12: exact.c12 * ratio.c12.unwrap_or(0.0) };
            assert!(near(&lattice(&body, k), &local(found, k), tolerance), "{D}D, {}", rule.name());
        }
    }

    #[test]
    fn long_waves_see_the_moduli() {
        long_waves::<1>();
        long_waves::<2>();
        long_waves::<3>();
    }

    #[test]
    fn a_system_of_three_is_solved() {
        let matrix = [[4.0, 1.0, -0.5], [1.0, 3.0, 0.25], [-0.5, 0.25, 2.0]];
        let x = solved(matrix, times(&matrix, [1.0, -2.0, 3.0]));
        assert!(x.iter().zip([1.0, -2.0, 3.0]).all(|(x, y)| (x - y).abs() < 1e-14), "{x:?}");
    }
}
