//! The engine beside the oracle: bars with cells, horizons, micromoduli and rules of all kinds, and the figures of the
//! studies.

use super::super::engine::EngineBar;
use super::super::grid::{Grid, Layout};
use super::super::micromodulus::Micromodulus;
use super::super::model::{Bar, Cover, Model, Motion, Rule};
use super::super::{following, placement, pulse};
use super::Bonds;
use crate::Outcome;

/// Cells of three sizes, horizons that differ within them, in every combination of layout, micromodulus, rule and cover.
fn each(mut check: impl FnMut(&Bar, &str)) {
    for layout in [Layout::Centred, Layout::Vertex] {
        for micromodulus in Micromodulus::ALL {
            for rule in Rule::ALL {
                for cover in [Cover::Exact, Cover::Whole] {
                    let grid = Grid::zones(layout, -1.0, &[(-0.3, 7), (0.2, 20), (0.5, 3), (1.1, 17)]);
                    let horizon = grid.at.iter().map(|x| if *x < 0.0 { 0.31 } else { 0.23 + 0.05 * x }).collect();
                    let bar = Bar { grid, horizon, micromodulus, rule, cover };
                    check(&bar, &format!("{layout:?}, {micromodulus:?}, {rule:?}, {cover:?}"));
                }
            }
        }
    }
}

fn wave(bar: &Bar) -> Vec<f64> {
    bar.grid.at.iter().map(|x| (3.0 * x).sin()).collect()
}

/// Largest difference over the largest value.
fn off(a: &[f64], b: &[f64]) -> f64 {
    let largest = b.iter().fold(0.0, |most: f64, b| most.max(b.abs()));
    a.iter().zip(b).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) / largest
}

#[test]
fn entries_of_the_matrix_are_the_same() {
    each(|bar, label| {
        let [engine, oracle] = [EngineBar::new(bar).matrix().concat(), Bonds::new(bar).matrix().concat()];
        assert!(off(&engine, &oracle) < 1e-14, "{label}: {}", off(&engine, &oracle));
        // Nothing of the one is nothing of the other: the families are the same.
        let same = engine.iter().zip(&oracle).all(|(a, b)| (a.abs() > 1e-9) == (b.abs() > 1e-9));
        assert!(same, "{label}");
    });
}

#[test]
fn forces_and_energies_are_the_same() {
    each(|bar, label| {
        let (mut engine, mut oracle, u) = (EngineBar::new(bar), Bonds::new(bar), wave(bar));
        let [mut a, mut b] = [vec![0.0; u.len()], vec![0.0; u.len()]];
        engine.force(&u, &mut a);
        oracle.force(&u, &mut b);
        assert!(off(&a, &b) < 1e-13, "forces, {label}: {}", off(&a, &b));
        engine.energy(&u, &mut a);
        oracle.energy(&u, &mut b);
        assert!(off(&a, &b) < 1e-13, "energies, {label}: {}", off(&a, &b));
    });
}

#[test]
fn equilibria_are_the_same_also_of_loads_and_reactions_that_nothing_balances() {
    each(|bar, label| {
        let mut load = vec![0.0; bar.grid.count()];
        (load[3], load[20], load[30]) = (1.0, -2.5, 0.7);
        let [engine, oracle] = [EngineBar::new(bar).solve(&load), Bonds::new(bar).solve(&load)];
        // The condition of these matrices is some hundreds.
        assert!(off(&engine, &oracle) < 1e-11, "{label}: {}", off(&engine, &oracle));
    });
}

#[test]
fn motions_are_the_same() {
    fn march<M: Model>(bar: &Bar) -> Motion {
        let (mut model, mut motion) = (M::new(bar), Motion::released(wave(bar)));
        for _ in 0..100 {
            model.step(&mut motion, 0.01);
        }
        motion
    }
    each(|bar, label| {
        let [engine, oracle] = [march::<EngineBar>(bar), march::<Bonds>(bar)];
        assert!(off(&engine.u, &oracle.u) < 1e-11, "{label}: {}", off(&engine.u, &oracle.u));
        assert!(off(&engine.v, &oracle.v) < 1e-11, "{label}: {}", off(&engine.v, &oracle.v));
    });
}

/// Every figure of a study, and every note.
fn same_figures(engine: &Outcome, oracle: &Outcome, tolerance: f64) {
    assert_eq!(engine.rows.len(), oracle.rows.len());
    for (engine, oracle) in engine.rows.iter().zip(&oracle.rows) {
        assert_eq!(engine.what, oracle.what);
        for [a, b] in [[engine.expected, oracle.expected], [engine.obtained, oracle.obtained]] {
            // What should vanish is rounding in both.
            let near = (a - b).abs() <= tolerance * b.abs() || a.abs().max(b.abs()) < 1e-10;
            assert!(near, "{}: {a} beside {b}", engine.what);
        }
    }
    assert_eq!(engine.notes, oracle.notes);
}

#[test]
fn tables_1_and_2_have_the_same_figures() {
    // The errors in percent are differences of displacements near 1, of which rounding and condition leave 1e-12.
    same_figures(&placement::table_1::<EngineBar>(), &placement::table_1::<Bonds>(), 1e-8);
    same_figures(&placement::table_2::<EngineBar>(), &placement::table_2::<Bonds>(), 1e-8);
}

#[test]
fn tables_3_and_4_have_the_same_figures() {
    // What is reflected is 1e-2 of the pulse, in which rounding leaves 1e-13.
    same_figures(&pulse::table_3::<EngineBar>(), &pulse::table_3::<Bonds>(), 1e-9);
    for micromodulus in [Micromodulus::Triangular, Micromodulus::Constant] {
        same_figures(&pulse::table_4::<EngineBar>(micromodulus), &pulse::table_4::<Bonds>(micromodulus), 1e-9);
    }
}

/// The first row of the table, in all three readings.
#[test]
fn table_5_has_the_same_figures() {
    same_figures(&following::table_5::<EngineBar>(1), &following::table_5::<Bonds>(1), 1e-9);
}
