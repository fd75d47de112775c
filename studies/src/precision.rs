//! `precision`: the same fracture in double, single and mixed precision, bond by bond.
//!
//! The runs of a case take the same steps side by side; after each step the bits of all bonds are compared with those of
//! the run in double precision. A bond whose stretch passes s₀ by less than rounding breaks a step earlier or later. What
//! that is worth is seen beside a run in double precision whose time step is longer by 10⁻⁵: no input is known to five
//! digits.

use std::cmp::Ordering;
use std::collections::HashMap;

use super::{Measure, Outcome, Row, Study, bundled_simulation};
use bondwise::error::Result;
use bondwise::field::{Values, difference, norm};
use bondwise::output::crack_tip::CrackTip;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::output::source::scalar;
use bondwise::problem::Balance;
use bondwise::simulation::Simulation;

pub const PRECISION: Study = Study {
    name: "precision",
    about: "fracture in double, single and mixed precision, bond by bond (3D with --full)",
    heavy: false,
    run,
};

/// A bundled case, and what of it is changed.
struct Case {
    name: &'static str,
    overrides: &'static [(&'static str, &'static str)],
    /// Axis along which the case follows its crack tip.
    along: Option<usize>,
    full: bool,
}

const CASES: [Case; 4] = [
    Case { name: "crack_branching", overrides: &[], along: Some(0), full: false },
    Case { name: "kalthoff_winkler", overrides: &[], along: Some(1), full: false },
    Case {
        name: "kalthoff_winkler_3d",
        // Half as fine, the notches between two layers of points as before.
        overrides: &[("constants.h", "0.2/152"), ("constants.delta", "4 mm"), ("constants.thickness", "7*0.2/152")],
        along: Some(1),
        full: true,
    },
    Case {
        name: "fragmenting_cylinder",
        overrides: &[("solver.velocity_verlet.end_time", "50 us")],
        along: None,
        full: true,
    },
];

/// Name, precision, and relative change of the time step; the first is what the others are compared with.
const RUNS: [(&str, &str, f64); 4] = [
    ("double", "double", 0.0),
    ("single", "single", 0.0),
    ("mixed", "mixed", 0.0),
    ("double, Δt × 1.00001", "double", 1e-5),
];
const SAME: &str = "the run in double precision; 2 % of broken bonds and energies and one horizon, as in crack-branching, \
                    where single bonds may break a step earlier or later";
const FEW: &str = "the run in double precision whose time step is longer by 1e-5: no input is known to five digits; or a \
                   thousandth of the broken bonds, if that is more: stretches in error by 1e-5 that grow by 1 % in a step \
                   pass s₀ in another step so often";
const PATH: &str = "farther than a horizon from every bond that broke in both runs: cracks run along the same path";
/// Steps between looks at damage and tip.
const LOOK_EVERY: u64 = 10;

/// A run, and when its bonds broke.
struct Run {
    simulation: Simulation,
    tip: Option<CrackTip>,
    words: Vec<u16>,
    /// Bit and step of each directed bond that broke.
    breaks: Vec<(usize, u64)>,
}

/// How a run differs from the one in double precision. Bonds are counted once, not at each end.
#[derive(Debug, Default)]
struct Differences {
    /// Bonds that differ, over time in s.
    curve: Vec<(f64, f64)>,
    first: Option<u64>,
    largest: u64,
    at_end: u64,
    /// Bonds that broke in both, but not in the same step; the longest delay in steps.
    shifted: u64,
    longest_shift: u64,
    /// Bonds that differ at the end, more than a horizon from any that broke in both.
    stray: u64,
    /// Largest difference of the tip's position along its axis, m.
    tip: f64,
    /// Largest difference of damage at a point.
    damage: f64,
}

fn run(full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for case in CASES.iter().filter(|case| full || !case.full) {
        compare(case, &mut outcome)?;
    }
    Ok(outcome)
}

impl Run {
    fn new(case: &Case, precision: &str) -> Result<Run> {
        let mut overrides = case.overrides.to_vec();
        overrides.push(("discretization.precision", precision));
        let mut simulation = bundled_simulation(case.name, &overrides)?;
        simulation.model.start();
        let (tip, words) = (simulation.history.tip.take(), simulation.model.bond_words().to_vec());
        Ok(Run { simulation, tip, words, breaks: Vec::new() })
    }

    fn step(&mut self) -> Result<()> {
        let Simulation { model, solver, clock, .. } = &mut self.simulation;
        model.step(solver, clock)?;
        for (k, (before, now)) in self.words.iter_mut().zip(model.bond_words()).enumerate() {
            let broken = *before & !now;
            self.breaks.extend((0..16).filter(|bit| broken >> bit & 1 == 1).map(|bit| (16 * k + bit, clock.step)));
            *before = *now;
        }
        Ok(())
    }

    /// Damage, and the position of the tip along an axis.
    fn look(&mut self, along: Option<usize>) -> (Vec<f64>, f64) {
        let (model, t) = (&mut *self.simulation.model, self.simulation.clock.time());
        let damage = model.field("damage").map_or(Vec::new(), |field| scalar(field, None));
        let tip = self.tip.as_mut().and_then(|tip| {
            tip.look(model.positions(), &damage, t);
            tip.position
        });
        (damage, along.zip(tip).map_or(f64::NAN, |(axis, x)| x[axis]))
    }

    fn middle(&self, bit: usize) -> [f64; 3] {
        let [a, b] = self.simulation.model.bond_ends(bit);
        std::array::from_fn(|d| 0.5 * (a[d] + b[d]))
    }

    fn displacement(&mut self) -> Vec<[f64; 3]> {
        match self.simulation.model.field("displacement").map(|field| field.values) {
            Some(Values::Vector(u)) => u,
            _ => unreachable!("every model has this field"),
        }
    }
}

fn compare(case: &Case, outcome: &mut Outcome) -> Result<()> {
    let mut runs = RUNS.iter().map(|(_, precision, _)| Run::new(case, precision)).collect::<Result<Vec<_>>>()?;
    let (dt, n_steps) = (runs[0].simulation.clock.dt, runs[0].simulation.n_steps);
    for (run, (_, _, change)) in runs.iter_mut().zip(RUNS) {
        run.simulation.clock.dt = dt * (1.0 + change);
    }
    let mut found: Vec<Differences> = RUNS[1..].iter().map(|_| Differences::default()).collect();
    let mut broken = Vec::new();
    for step in 1..=n_steps {
        let t = step as f64 * dt;
        runs.iter_mut().try_for_each(Run::step)?;
        broken.push((t, runs[0].simulation.model.broken_pairs() as f64));
        let looks: Vec<_> = if step.is_multiple_of(LOOK_EVERY) || step == n_steps {
            runs.iter_mut().map(|run| run.look(case.along)).collect()
        } else {
            Vec::new()
        };
        for (k, found) in found.iter_mut().enumerate() {
            found.bonds(&runs[0].words, &runs[k + 1].words, step, t);
            if let Some((double, other)) = looks.first().zip(looks.get(k + 1)) {
                found.fields(double, other);
            }
        }
    }
    for run in &mut runs {
        run.breaks.sort_unstable();
    }
    for (k, found) in found.iter_mut().enumerate() {
        found.shifts(&runs[0], &runs[k + 1]);
    }
    judge(case, &mut runs, &found, outcome);
    outcome.plots.push((case.name.into(), draw_plot(&plot(case, broken, &found), 1000, 650)));
    Ok(())
}

impl Differences {
    fn bonds(&mut self, double: &[u16], other: &[u16], step: u64, t: f64) {
        let directed: u64 = double.iter().zip(other).map(|(a, b)| u64::from((a ^ b).count_ones())).sum();
        self.at_end = directed / 2;
        self.largest = self.largest.max(self.at_end);
        self.curve.push((t, self.at_end as f64));
        if directed > 0 {
            self.first.get_or_insert(step);
        }
    }

    fn fields(&mut self, (damage, tip): &(Vec<f64>, f64), (other_damage, other_tip): &(Vec<f64>, f64)) {
        self.damage = damage.iter().zip(other_damage).map(|(a, b)| (a - b).abs()).fold(self.damage, f64::max);
        // Not a number while there is no tip, which `max` leaves out.
        self.tip = self.tip.max((tip - other_tip).abs());
    }

    /// One line for the reader; `energies` are differences of kinetic, strain and fracture energy.
    fn note(&self, run: &str, energies: [f64; 3], displacement: f64) -> String {
        let first = self.first.map_or("never".into(), |step| format!("from step {step}"));
        let [kinetic, strain, fracture] = energies;
        format!(
            "{run}: bonds differ {first}, {} at most, {} at the end; {} broke in both runs at different steps, up to {} \
             apart; largest difference of damage {:.1e}, of displacement {displacement:.1e} of the largest; of kinetic, \
             strain and fracture energy {kinetic:.1e}, {strain:.1e}, {fracture:.1e}",
            self.largest, self.at_end, self.shifted, self.longest_shift, self.damage,
        )
    }

    /// Compares the steps at which bonds broke, sorted by bond.
    fn shifts(&mut self, double: &Run, other: &Run) {
        let (mut a, mut b) = (double.breaks.iter().peekable(), other.breaks.iter().peekable());
        let (mut both, mut one) = (Vec::new(), Vec::new());
        let mut shifted = 0;
        while let Some(order) = match (a.peek(), b.peek()) {
            (Some(x), Some(y)) => Some(x.0.cmp(&y.0)),
            (Some(_), None) => Some(Ordering::Less),
            (None, Some(_)) => Some(Ordering::Greater),
            (None, None) => None,
        } {
            let (x, y) = (a.next_if(|_| order.is_le()), b.next_if(|_| order.is_ge()));
            match (x, y) {
                (Some(x), Some(y)) => {
                    both.push(double.middle(x.0));
                    shifted += u64::from(x.1 != y.1);
                    self.longest_shift = self.longest_shift.max(x.1.abs_diff(y.1));
                }
                (x, y) => one.extend(x.or(y).map(|bond| double.middle(bond.0))),
            }
        }
        self.shifted = shifted / 2;
        let horizon = double.simulation.model.facts().horizon;
        let cell = |x: &[f64; 3]| x.map(|x| (x / horizon).floor() as i64);
        let mut cells: HashMap<[i64; 3], Vec<[f64; 3]>> = HashMap::new();
        for x in both {
            cells.entry(cell(&x)).or_default().push(x);
        }
        let near = |x: &[f64; 3]| {
            let around = (0..27).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]);
            let mut found = around.filter_map(|step| {
                let at = cell(x);
                cells.get(&std::array::from_fn(|d| at[d] + step[d]))
            });
            found.any(|bonds| bonds.iter().any(|y| norm(&difference(x, y)) <= horizon))
        };
        self.stray = one.iter().filter(|x| !near(x)).count() as u64 / 2;
    }
}

/// Adds the rows of the precisions, and a note for each run.
fn judge(case: &Case, runs: &mut [Run], found: &[Differences], outcome: &mut Outcome) {
    let model = &mut runs[0].simulation.model;
    let (horizon, broken, energy) = (model.facts().horizon, model.broken_pairs() as f64, model.balance());
    outcome.notes.push(format!(
        "{}: {} points, {} bonds, {} steps, {broken} bonds broken in double precision",
        case.name,
        model.facts().points,
        model.facts().bonds / 2,
        runs[0].simulation.n_steps
    ));
    let u = runs[0].displacement();
    let largest = u.iter().map(norm).fold(0.0, f64::max);
    let control = found[found.len() - 1].at_end as f64;
    for ((k, run), differences) in runs.iter_mut().enumerate().skip(1).zip(found) {
        let (name, precision, _) = RUNS[k];
        let (other, other_energy) = (run.simulation.model.broken_pairs() as f64, run.simulation.model.balance());
        let of_energy = |part: fn(&Balance) -> f64| (part(&other_energy) / part(&energy) - 1.0).abs();
        let energies = [of_energy(|b| b.kinetic), of_energy(|b| b.strain), of_energy(|b| b.fracture)];
        let apart = u.iter().zip(run.displacement()).map(|(a, b)| norm(&difference(a, &b))).fold(0.0, f64::max);
        outcome.notes.push(differences.note(&format!("{}, {name}", case.name), energies, apart / largest));
        if precision == RUNS[0].1 {
            continue;
        }
        let mut row = |what: &str, expected: f64, obtained: f64, tolerance: f64, measure: Measure, origin: &str| {
            outcome.rows.push(Row::new(
                format!("{}, {name}: {what}", case.name),
                expected,
                obtained,
                tolerance,
                measure,
                origin,
            ));
        };
        row("broken bonds", broken, other, 0.02, Measure::Relative, SAME);
        let (most, at_end) = (control.max(1e-3 * broken), differences.at_end as f64);
        row("bonds that differ at the end", most, at_end, 0.0, Measure::AtMost, FEW);
        row("of these, off the crack", 0.0, differences.stray as f64, 0.0, Measure::AtMost, PATH);
        if case.along.is_some() {
            row("tip, distance in horizons", 1.0, differences.tip / horizon, 0.0, Measure::AtMost, SAME);
        }
        let worst = energies.into_iter().fold(0.0, f64::max);
        row("largest difference of an energy", 0.02, worst, 0.0, Measure::AtMost, SAME);
    }
}

fn plot(case: &Case, broken: Vec<(f64, f64)>, found: &[Differences]) -> Plot {
    let mut series = vec![Series { name: "broken, in double".into(), points: broken, style: Style::Dashed }];
    series.extend(RUNS[1..].iter().zip(found).map(|((name, _, _), found)| Series {
        name: format!("differ: {name}"),
        points: found.curve.clone(),
        style: Style::Line,
    }));
    Plot {
        title: format!("Bonds that differ from double precision: {}", case.name),
        x_label: "time [s]".into(),
        y_label: "bonds (-)".into(),
        log_y: true,
        series,
        notes: vec!["A run is not drawn while none of its bonds differs.".into()],
        ..Plot::default()
    }
}
