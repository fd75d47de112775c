use std::f64::consts::PI;

use super::*;
use crate::discretization::quadrature::gauss_legendre;
use crate::discretization::standard;
use crate::geometry::Shape;

fn flux<const D: usize>(q: u32, horizon: f64) -> Flux {
    Flux::new::<D>(Influence::Constant, q, 1.0, horizon).unwrap()
}

/// A box of so many cells along each axis, its corner at 0.
fn lattice<const D: usize>(cells: [usize; D], spacing: f64, reach: usize) -> Cloud<D> {
    let high = cells.map(|n| n as f64 * spacing);
    Cloud::lattice(&Shape::Box { low: [0.0; D], high }, spacing, reach)
}

/// V-C4, the table of the paper's (25) and its like, K = 1: factor, power of π below, power of δ.
#[test]
fn micro_diffusivities_are_the_printed_ones() {
    let influences = [Influence::Constant, Influence::Linear, Influence::Inverted];
    // By influence, then q = 0, 1, 2, 3; None where the integral diverges.
    let line = [
        [Some(3.0), Some(2.0), Some(1.0), None],
        [Some(12.0), Some(6.0), Some(2.0), None],
        [Some(4.0), Some(3.0), Some(2.0), Some(1.0)],
    ];
    let plane = [[8.0, 6.0, 4.0, 2.0], [40.0, 24.0, 12.0, 4.0], [10.0, 8.0, 6.0, 4.0]];
    let space = [[7.5, 6.0, 4.5, 3.0], [45.0, 30.0, 18.0, 9.0], [9.0, 7.5, 6.0, 4.5]];
    let horizon: f64 = 0.7;
    for (k, influence) in influences.iter().enumerate() {
        for q in 0..4 {
            let near = |found: Result<f64>, factor: f64, power: i32| {
                let (found, expected) = (found.unwrap(), 3.5 * factor * horizon.powi(q - power));
                assert!(
                    (found - expected).abs() <= 1e-12 * expected,
                    "{} q = {q}: {found} {expected}",
                    influence.name()
                );
            };
            let found = micro_diffusivity::<1>(influence, f64::from(q), 3.5, horizon);
            match line[k][q as usize] {
                Some(factor) => near(found, factor, 3),
                None => assert!(found.unwrap_err().to_string().contains("no integral over squares in 1D")),
            }
            near(micro_diffusivity::<2>(influence, f64::from(q), 3.5, horizon), plane[k][q as usize] / PI, 4);
            near(micro_diffusivity::<3>(influence, f64::from(q), 3.5, horizon), space[k][q as usize] / PI, 5);
        }
    }
}

#[test]
fn the_second_moment_is_the_diffusivity_for_every_influence() {
    for influence in Influence::ALL {
        for q in [0.0, 0.5, 1.0, 2.0] {
            let kappa = micro_diffusivity::<3>(&influence, q, 1.0, 1.0).unwrap();
            let radial: f64 = gauss_legendre(40).iter().map(|(t, w)| w * influence.value(*t) * t.powf(4.0 - q)).sum();
            let found = 0.5 * kappa * 4.0 * PI / 3.0 * radial;
            // Gauss's rule of roots at the source.
            assert!((found - 1.0).abs() < 1e-8, "{} q = {q}: {found}", influence.name());
        }
    }
}

/// V-C5. What long waves find: K_eff/K by an independent script, four digits.
#[test]
fn discrete_diffusivities_are_the_tabulated_ones() {
    fn check<const D: usize>(m: usize, whole: [f64; 3], ramp: [f64; 3]) {
        let horizon = 0.3;
        for (rule, expected) in [(PartialVolume::None, whole), (PartialVolume::Ramp, ramp)] {
            let body = standard::body(lattice([2; D], horizon / m as f64, m + 1), horizon, rule);
            for q in 0..3 {
                let diffusion = Diffusion::standard(&body, &flux::<D>(q, horizon), rule);
                let found = diffusion.diffusivity(&body).unwrap();
                assert!((found - expected[q as usize]).abs() <= 1e-4, "{D}D m = {m} {rule:?} q = {q}: {found}");
                let calibrated = diffusion.calibrated(&body, 1.0).diffusivity(&body).unwrap();
                assert!((calibrated - 1.0).abs() < 1e-14);
            }
        }
    }
    check::<1>(3, [1.5556, 1.3333, 1.0000], [1.0556, 1.0000, 0.8333]);
    check::<1>(4, [1.4062, 1.2500, 1.0000], [1.0312, 1.0000, 0.8750]);
    check::<2>(3, [1.0689, 1.0409, 0.9903], [1.0572, 1.0201, 0.9687]);
    check::<2>(4, [0.9549, 0.9624, 0.9549], [1.0327, 1.0128, 0.9832]);
    check::<3>(3, [1.1593, 1.1208, 1.0787], [1.1042, 1.0622, 1.0244]);
    check::<3>(4, [0.9279, 0.9432, 0.9549], [1.0478, 1.0266, 1.0082]);
}

/// (2κ or κ) ∫ (1 − mean of cos kξ over directions) ω r^(D−1−q) dr: what e^(ikx) decays with, 1/s.
fn decay<const D: usize>(flux: &Flux, horizon: f64, k: f64) -> f64 {
    // J₀ by the trapezoidal rule over half a turn, which has all digits.
    let mean = |z: f64| match D {
        1 => z.cos(),
        2 => (0..32).map(|n| (z * (PI * (f64::from(n) + 0.5) / 32.0).sin()).cos() / 32.0).sum(),
        _ => z.sin() / z,
    };
    let sphere = [2.0, 2.0 * PI, 4.0 * PI][D - 1];
    let term = |r: f64| (1.0 - mean(k * r)) * r.powi(D as i32 - 1 - flux.q as i32);
    let sum: f64 = gauss_legendre(40).iter().map(|(t, w)| w * horizon * term(t * horizon)).sum();
    sphere * flux.micro_diffusivity * sum
}

#[test]
fn decay_rates_are_the_closed_forms() {
    let (horizon, k): (f64, f64) = (0.3, 7.0);
    let z = k * horizon;
    // Cin and Si by their series.
    let series = |start: i32| -> f64 {
        let mut term = if start == 1 { z } else { 0.5 * z * z };
        let (mut sum, mut n) = (0.0, start);
        for _ in 0..20 {
            sum += term / f64::from(n);
            term *= -z * z / f64::from((n + 1) * (n + 2));
            n += 2;
        }
        sum
    };
    let (si, cin) = (series(1), series(2));
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12 * expected, "{found} {expected}");
    near(decay::<1>(&flux::<1>(1, horizon), horizon, k), 4.0 / (horizon * horizon) * cin);
    near(decay::<1>(&flux::<1>(2, horizon), horizon, k), 2.0 / horizon * (k * si - (1.0 - z.cos()) / horizon));
    near(decay::<3>(&flux::<3>(2, horizon), horizon, k), 18.0 / horizon.powi(3) * (horizon - si / k));
}

/// V-S0-8: cos kx on a line between two mirrors decays as e^(−λt) with the nonlocal λ.
#[test]
fn a_wave_between_mirrors_decays_at_the_nonlocal_rate() {
    let (cells, m) = (200, 20);
    let (spacing, n) = (1.0 / cells as f64, cells + 2 * m);
    let horizon = m as f64 * spacing;
    for q in [1, 2] {
        let flux = flux::<1>(q, horizon);
        let body = standard::body(lattice([n], spacing, m + 1), horizon, PartialVolume::Ramp);
        let diffusion = Diffusion::standard(&body, &flux, PartialVolume::Ramp).calibrated(&body, 1.0);
        let mut exec = Exec::default();
        let slot = |i: usize| body.cloud.slots[i] as usize;
        for k in [PI, 2.0 * PI] {
            let lambda = decay::<1>(&flux, horizon, k);
            let (mut c, mut rate) = (vec![0.0; body.cloud.n_slots()], vec![0.0; body.cloud.n_slots()]);
            let x = |i: usize| (i as f64 + 0.5 - m as f64) * spacing;
            (m..m + cells).for_each(|i| c[slot(i)] = (k * x(i)).cos());
            // Each mode decays by (1 − λΔt)^n, e^(−λt) but for λΔt/2.
            let steps = 4000;
            let dt = 1.0 / (lambda * f64::from(steps));
            assert!(dt < diffusion.stable_step(&body));
            let whole = BondStates::whole(&body);
            for _ in 0..steps {
                for i in 0..m {
                    c[slot(m - 1 - i)] = c[slot(m + i)];
                    c[slot(m + cells + i)] = c[slot(m + cells - 1 - i)];
                }
                diffusion.rate(&body, &whole, &mut exec, &c, &mut rate);
                c.iter_mut().zip(&rate).for_each(|(c, rate)| *c += dt * rate);
            }
            for i in [m, m + cells / 3, m + cells - 1] {
                let expected = (k * x(i)).cos() * (-1.0f64).exp();
                let found = c[slot(i)];
                assert!((found - expected).abs() < 1e-3 * (-1.0f64).exp(), "q = {q} k = {k}: {found} {expected}");
            }
        }
    }
}

#[test]
fn waves_in_a_plane_decay_at_the_nonlocal_rate() {
    let (m, k) = (16, 2.5);
    let (horizon, spacing) = (1.0, 1.0 / 16.0);
    let flux = flux::<2>(2, horizon);
    let body = standard::body(lattice([2 * m + 1, 2 * m + 1], spacing, m + 1), horizon, PartialVolume::Ramp);
    let diffusion = Diffusion::standard(&body, &flux, PartialVolume::Ramp).calibrated(&body, 1.0);
    let middle = body.cloud.slots[2 * m * (m + 1)] as usize;
    let x0 = body.cloud.position(middle)[0];
    let (mut c, mut rate) = (vec![0.0; body.cloud.n_slots()], vec![0.0; body.cloud.n_slots()]);
    body.cloud.slots.iter().for_each(|&s| c[s as usize] = (k * (body.cloud.position(s as usize)[0] - x0)).cos());
    diffusion.rate(&body, &BondStates::whole(&body), &mut Exec::default(), &c, &mut rate);
    let (found, expected) = (-rate[middle], decay::<2>(&flux, horizon, k));
    assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
}

/// A pseudo-random field, the same every time.
fn noise(n: usize) -> Vec<f64> {
    (0..n).map(|i| ((i * 7919) % 1013) as f64 / 1013.0).collect()
}

/// Bonds give to one end what they take from the other: to rounding on lattices and clouds of points that are alike.
#[test]
fn mass_is_conserved() {
    fn check<const D: usize>(body: &Body<D>, q: u32) {
        let diffusion = Diffusion::standard(body, &flux::<D>(q, body.horizon), PartialVolume::Ramp);
        let mut exec = Exec::default();
        let (mut c, mut rate) = (noise(body.cloud.n_slots()), vec![0.0; body.cloud.n_slots()]);
        let before = mass(&body.cloud, &mut exec, &c);
        let dt = diffusion.stable_step(body);
        let spread = |c: &[f64]| {
            let values = || body.cloud.slots.iter().map(|&s| c[s as usize]);
            values().fold(0.0, f64::max) - values().fold(1.0, f64::min)
        };
        let (noisy, whole) = (spread(&c), BondStates::whole(body));
        for _ in 0..50 {
            diffusion.rate(body, &whole, &mut exec, &c, &mut rate);
            c.iter_mut().zip(&rate).for_each(|(c, rate)| *c += dt * rate);
        }
        let after = mass(&body.cloud, &mut exec, &c);
        assert!((after - before).abs() < 1e-13 * before, "{D}D q = {q}: {before} {after}");
        assert!(spread(&c) < 0.5 * noisy);
    }
    let horizon = 0.3;
    for q in 0..3 {
        let plane = || lattice([23, 17], 0.1, 4);
        check(&standard::body(plane(), horizon, PartialVolume::Ramp), q);
        check(&standard::body(plane().scatter(), horizon, PartialVolume::Ramp), q);
        check(&standard::body(lattice([9, 8, 7], 0.1, 4), horizon, PartialVolume::Ramp), q);
    }
}

/// Lattice, cloud and rows of a point are the same sum.
#[test]
fn lattices_and_clouds_agree() {
    let (horizon, spacing) = (0.4, 0.1);
    let cloud = || lattice([21, 19], spacing, 5);
    let fields = |body: &Body<2>, diffusion: &Diffusion| {
        let mut c = vec![0.0; body.cloud.n_slots()];
        let mut rate = c.clone();
        let values = noise(body.cloud.n_points());
        body.cloud.slots.iter().zip(values).for_each(|(&slot, value)| c[slot as usize] = value);
        diffusion.rate(body, &BondStates::whole(body), &mut Exec::default(), &c, &mut rate);
        body.cloud.slots.iter().map(|&slot| rate[slot as usize]).collect::<Vec<_>>()
    };
    for q in 0..4 {
        let flux = flux::<2>(q, horizon);
        let [on, off] = [cloud(), cloud().scatter()].map(|cloud| {
            let body = standard::body(cloud, horizon, PartialVolume::Ramp);
            let diffusion = Diffusion::standard(&body, &flux, PartialVolume::Ramp);
            (fields(&body, &diffusion), diffusion.stable_step(&body))
        });
        let largest = on.0.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        assert!(on.0.iter().zip(&off.0).all(|(a, b)| (a - b).abs() < 1e-12 * largest), "q = {q}");
        assert!((on.1 / off.1 - 1.0).abs() < 1e-12, "{} {}", on.1, off.1);
    }
    let flux = flux::<2>(2, horizon);
    let collocation = Collocation::new(2, 29);
    let (body, shared) = Diffusion::collocated(cloud(), horizon, &flux, &collocation, 0.0).unwrap();
    let on = fields(&body, &shared);
    assert!((shared.diffusivity(&body).unwrap() - 1.0).abs() < 1e-12);
    let body = standard::body(cloud().scatter(), horizon, PartialVolume::None);
    let whole = |x: [f64; 2]| (0..2).all(|d| x[d] > horizon && x[d] < [2.1, 1.9][d] - horizon);
    let inside = body.cloud.select(|x| whole(*x));
    let own = Diffusion::around(&body, &flux, &collocation, &inside).unwrap();
    let off = fields(&body, &own);
    let size = on.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let mut compared = 0;
    for (point, &slot) in body.cloud.slots.iter().enumerate() {
        if inside.contains(&slot) {
            assert!((on[point] - off[point]).abs() < 1e-9 * size, "{} {}", on[point], off[point]);
            compared += 1;
        } else {
            assert_eq!(off[point], 0.0);
        }
    }
    assert_eq!(compared, 13 * 11);
}

/// Of a line of n points whose neighbours alone interact: −4K/h² sin²(π/(2(n + 1))).
#[test]
fn the_slowest_decay_of_a_line_is_known() {
    let (spacing, n) = (0.1, 11);
    let flux = Flux::new::<1>(Influence::Constant, 2, 1.0, spacing).unwrap();
    let body = standard::body(lattice([n + 2], spacing, 2), spacing, PartialVolume::None);
    let diffusion = Diffusion::standard(&body, &flux, PartialVolume::None).calibrated(&body, 3.0);
    let found = diffusion.growth(&body, &mut Exec::default(), &body.cloud.slots[1..=n], 4000);
    let expected = -4.0 * 3.0 / (spacing * spacing) * (0.5 * PI / (n as f64 + 1.0)).sin().powi(2);
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = |error: Error| error.to_string();
    assert!(refused(Flux::new::<2>(Influence::Constant, 4, 1.0, 1.0).unwrap_err()).contains("got 4"));
    assert!(refused(Flux::new::<1>(Influence::Constant, 3, 1.0, 1.0).unwrap_err()).contains("no integral"));
    let (cloud, flux) = (|| lattice([9, 9], 0.25, 4), flux::<2>(2, 1.0));
    let collocated = |cloud, points| Diffusion::collocated(cloud, 1.0, &flux, &Collocation::new(4, points), 0.0);
    assert!(refused(collocated(cloud(), 49).unwrap_err()).contains("would grow in time: an eigenvalue of +32.08 K/δ²"));
    assert!(refused(collocated(cloud().scatter(), 49).unwrap_err()).contains("on lattices only"));
    let body = standard::body(cloud(), 1.0, PartialVolume::None);
    let around = Diffusion::around(&body, &flux, &Collocation::new(2, 29), &[]);
    assert!(refused(around.unwrap_err()).contains("share their row"));
}
