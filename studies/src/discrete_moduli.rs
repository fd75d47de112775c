//! Moduli and fracture energy of the standard scheme at finite spacing, from the program's own bond sums.
//!
//! A block of cells is strained uniformly and its energy density read at the middle; the bonds across a plane, with the
//! weights that a run uses, are summed at the critical stretch. Both against the tables of the lattice sums.

use super::family_counts::block;
use super::{Measure, Outcome, Row};
use bondwise::discretization::{Influence, Operator, PartialVolume};
use bondwise::error::Result;
use bondwise::family::Families;
use bondwise::output::plot::{Plot, Series, Style, draw_plot};
use bondwise::physics::elasticity::discrete::{TABLE, discrete_moduli};
use bondwise::physics::elasticity::laws::BondBasedLinear;
use bondwise::physics::elasticity::moduli::{Hypothesis, critical_stretch, micromodulus};
use bondwise::physics::elasticity::{Bonds, Elasticity};

const ORIGIN: &str = "lattice sums of an independent script, four digits printed; the tolerance is the last of them";

pub fn run(_full: bool) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    for (hypothesis, m, full, ramp) in TABLE {
        for (rule, expected) in [(PartialVolume::None, full), (PartialVolume::Ramp, ramp)] {
            let found = match hypothesis.dimension() {
                2 => from_bond_sums::<2>(hypothesis, rule, m),
                _ => from_bond_sums::<3>(hypothesis, rule, m),
            };
            for (name, (expected, found)) in ["C₁₁", "C₁₂", "W/G₀"].iter().zip(expected.into_iter().zip(found))
            {
                let what = format!("{}, m = {m}, {}: {name}, discrete over exact", hypothesis.name(), rule.name());
                outcome.rows.push(Row::new(what, expected, found, 1e-4, Measure::Absolute, ORIGIN));
            }
        }
    }
    outcome.notes.push(
        "constant influence; W is the energy of all bonds across a lattice plane, each at the critical stretch: the \
         energy that a straight crack takes in the scheme, of which G₀ is the limit"
            .into(),
    );
    outcome.plots.push(("fracture_energy".into(), draw_plot(&plot(), 1000, 650)));
    Ok(outcome)
}

/// C₁₁, C₁₂ and W/G₀ over their exact values; E = G₀ = h = 1.
fn from_bond_sums<const D: usize>(hypothesis: Hypothesis, rule: PartialVolume, m: f64) -> [f64; 3] {
    let influence = Influence::Constant;
    let (body, middle) = block::<D>(rule, m);
    let strength = micromodulus(hypothesis, &influence, 1.0, m);
    let operator = Operator::standard(&body, strength, influence, rule);
    let mut elasticity = Elasticity::<D>::new(body, operator, Box::new(Bonds::new(BondBasedLinear)), 1.0, None);
    let mut energy = |strain: [f64; 2]| {
        let Elasticity { body, state, .. } = &mut elasticity;
        let n = body.cloud.n_slots();
        for &slot in &body.cloud.slots {
            let x = body.cloud.position(slot as usize);
            for d in 0..2 {
                state.displacement[d * n + slot as usize] = strain[d] * x[d];
            }
        }
        let here = body.cloud.slots[middle] as usize;
        elasticity.energy_density()[here]
    };
    // W = ½ C₁₁ ε₁² + C₁₂ ε₁ ε₂ + ½ C₁₁ ε₂²
    let c11 = 2.0 * energy([1.0, 0.0]);
    let c12 = energy([1.0, 1.0]) - c11;
    let exact = hypothesis.stiffness(1.0);
    let s0 = critical_stretch(hypothesis, &influence, strength, 1.0, m);
    let mut plane = 0.0;
    if let Families::Lattice(families) = &elasticity.body.families {
        // A bond of ξ₁ = i h > 0 across the plane starts from i columns.
        let bonds = families.offsets.iter().zip(&elasticity.operator.weights.by_offset);
        let across = bonds.filter(|(offset, _)| offset.step[0] > 0);
        plane = across.map(|(offset, w)| 0.5 * w * s0 * s0 * offset.length * offset.xi[0]).sum();
    }
    [c11 / exact.c11, c12 / exact.c12, plane]
}

/// W/G₀ over m, from integer and other horizon ratios.
fn plot() -> Plot {
    let series = PartialVolume::ALL.map(|rule| Series {
        name: format!("partial volumes: {}", rule.name()),
        points: (0..=160)
            .map(|k| 2.0 + 0.05 * f64::from(k))
            .map(|m| {
                let found = discrete_moduli(Hypothesis::PlaneStress, &Influence::Constant, rule, m);
                (m, found.fracture_energy)
            })
            .collect(),
        style: Style::Line,
    });
    let table = |name: &str, pick: fn(&([f64; 3], [f64; 3])) -> f64| Series {
        name: name.into(),
        points: TABLE
            .iter()
            .filter(|(hypothesis, ..)| *hypothesis == Hypothesis::PlaneStress)
            .map(|(_, m, full, ramp)| (*m, pick(&(*full, *ramp))))
            .collect(),
        style: Style::Dots,
    };
    let tables = [table("table, none", |(full, _)| full[2]), table("table, ramp", |(_, ramp)| ramp[2])];
    Plot {
        title: "Energy of the bonds across a plane, plane stress".into(),
        x_label: "horizon over spacing, m [-]".into(),
        y_label: "W/G₀ [-]".into(),
        series: series.into_iter().chain(tables).collect(),
        ..Plot::default()
    }
}
