//! The quick verification studies pass, and a comparison that fails is seen to fail. Those that take more than some seconds are
//! left to `bondwise verify`, which the gate runs with all others.

use bondwise_studies::{Measure, Outcome, Row, STUDIES, find};

/// Runs a study and names every row that does not pass.
fn passes(name: &str) {
    let study = find(name).expect("a study of that name");
    let outcome = (study.run)(false).expect("the study runs");
    let failed: Vec<_> = outcome
        .rows
        .iter()
        .filter(|row| !row.passes())
        .map(|row| format!("{}: {} against {}", row.what, row.obtained, row.expected))
        .collect();
    assert!(failed.is_empty(), "{name}: {failed:#?}");
    assert!(outcome.passes(), "{name}: no rows");
}

#[test]
fn constants_are_the_integrals_that_define_them() {
    passes("constants");
}

#[test]
fn the_local_limit_is_the_navier_operator() {
    passes("navier");
}

#[test]
fn families_have_the_counted_sizes() {
    passes("family-counts");
}

#[test]
fn the_scheme_has_the_tabulated_moduli_and_fracture_energies() {
    passes("discrete-moduli");
}

#[test]
fn a_pulse_runs_along_a_bar_at_its_speed() {
    passes("wave-in-bar");
}

#[test]
fn plane_waves_disperse_as_the_integral_says() {
    passes("dispersion");
}

#[test]
fn energy_does_not_drift() {
    passes("energy-drift");
}

#[test]
fn a_crack_branches_as_in_the_reference_run() {
    passes("crack-branching");
}

#[test]
#[ignore = "takes seconds: the gate runs `bondwise verify`"]
fn a_crack_takes_the_fracture_energy_for_each_new_area() {
    passes("fracture-work");
}

#[test]
#[ignore = "takes seconds: the gate runs `bondwise verify`"]
fn precisions_break_the_same_bonds() {
    passes("precision");
}

#[test]
#[ignore = "takes seconds: the gate runs `bondwise verify`"]
fn a_crack_that_grows_in_equilibrium_takes_the_fracture_energy() {
    passes("double-cantilever");
}

#[test]
fn a_plate_with_a_hole_is_strained_as_kirsch_says() {
    passes("kirsch");
}

#[test]
#[ignore = "takes seconds: the gate runs `bondwise verify`"]
fn waves_at_rest_converge_in_all_three_ways() {
    passes("convergence");
}

#[test]
#[ignore = "takes seconds: the gate runs `bondwise verify`"]
fn corrected_bars_are_as_long_as_they_should_be() {
    passes("surface-effect");
}

#[test]
fn a_bar_at_rest_by_sums_and_by_collocation_has_the_stated_errors() {
    passes("hybrid-example-1");
}

#[test]
#[ignore = "takes seconds: the gate runs `bondwise verify`"]
fn diffusion_in_a_square_has_the_stated_errors_and_what_would_grow_is_refused() {
    passes("hybrid-example-2");
}

#[test]
#[ignore = "takes seconds: the gate runs `bondwise verify`"]
fn a_crack_through_rows_and_bonds_is_that_through_bonds() {
    passes("hybrid-branching");
}

#[test]
#[ignore = "takes seconds: the gate runs `bondwise verify`"]
fn waves_pass_from_rows_into_bonds_and_do_not_grow() {
    passes("hybrid-wave");
}

#[test]
fn the_seven_nodes_have_the_printed_matrix() {
    passes("bar-7-nodes");
}

#[test]
fn a_bar_converges_in_all_three_ways() {
    passes("convergence-1d");
}

#[test]
fn where_the_refined_zone_lies_matters_as_stated() {
    passes("table-1");
}

#[test]
fn uniform_and_refined_bars_have_the_stated_errors() {
    passes("table-2");
}

#[test]
fn a_change_of_spacing_reflects_as_much_as_published() {
    passes("table-3");
}

#[test]
fn a_pulse_arrives_at_the_printed_times() {
    passes("table-4");
}

#[test]
#[ignore = "takes seconds: the gate runs `bondwise verify`"]
fn an_adaptive_grid_has_smaller_errors_than_a_uniform_one() {
    passes("table-5");
}

#[test]
fn names_of_studies_are_distinct_and_written_as_on_the_command_line() {
    for (k, study) in STUDIES.iter().enumerate() {
        assert!(study.name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-'), "{}", study.name);
        assert!(STUDIES[..k].iter().all(|other| other.name != study.name), "{}", study.name);
    }
}

/// The canary: what must not pass, does not.
#[test]
fn a_row_outside_its_tolerance_or_not_a_number_fails() {
    let row = |expected, obtained, tolerance, measure| Row::new("canary", expected, obtained, tolerance, measure, "");
    let all = [Measure::Absolute, Measure::Relative, Measure::AtMost, Measure::AtLeast];
    for measure in all {
        assert!(row(2.0, 2.0, 1e-12, measure).passes(), "{measure:?}");
        assert!(!row(2.0, f64::NAN, f64::INFINITY, measure).passes(), "{measure:?}");
        assert!(!row(f64::NAN, 2.0, f64::INFINITY, measure).passes(), "{measure:?}");
    }
    assert!(!row(2.0, 2.2, 0.1, Measure::Absolute).passes());
    assert!(!row(2.0, 1.8, 0.1, Measure::Absolute).passes());
    assert!(!row(200.0, 203.0, 0.01, Measure::Relative).passes());
    assert!(!row(-200.0, -203.0, 0.01, Measure::Relative).passes());
    assert!(!row(0.0, 1.0, 0.01, Measure::Relative).passes());
    assert!(!row(2.0, 2.1, 9.0, Measure::AtMost).passes());
    assert!(!row(2.0, 1.9, 9.0, Measure::AtLeast).passes());
    assert!(!row(2.0, 2.0, f64::NAN, Measure::Absolute).passes());

    let information = row(2.0, 9.0, 0.0, Measure::Information);
    assert!(information.passes() && !row(2.0, f64::NAN, 0.0, Measure::Information).passes());
    assert!(!Outcome { rows: vec![information], ..Outcome::default() }.passes(), "nothing was judged");

    let good = row(2.0, 2.0, 0.0, Measure::Absolute);
    let bad = row(2.0, f64::NAN, 0.0, Measure::Absolute);
    assert!(Outcome { rows: vec![good.clone()], ..Outcome::default() }.passes());
    assert!(!Outcome { rows: vec![good, bad], ..Outcome::default() }.passes());
    assert!(!Outcome::default().passes(), "nothing was compared");
}
