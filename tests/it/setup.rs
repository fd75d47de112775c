//! How long the set-up of a large scattered cloud takes, stage by stage. Printed, never asserted; run by hand:
//!
//! `RAYON_NUM_THREADS=1 cargo test --release --test setup -- --ignored --nocapture`

use std::time::Instant;

use bondwise::discretization::{Influence, Operator, PartialVolume, standard};
use bondwise::field::components_mut;
use bondwise::geometry::{Cloud, Shape};
use bondwise::physics::Physics;
use bondwise::physics::elasticity::laws::BondBased;
use bondwise::physics::elasticity::{Bonds, Elasticity};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

fn timed<T>(stage: &str, work: impl FnOnce() -> T) -> T {
    let begin = Instant::now();
    let result = work();
    println!("  {stage:<24}{:8.3} s", begin.elapsed().as_secs_f64());
    result
}

/// Peak of the resident memory in GiB, where the system tells.
fn peak() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1048576.0)
}

fn set_up(rule: PartialVolume, mut positions: Vec<[f64; 3]>, shuffle: bool) {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    if shuffle {
        for i in (1..positions.len()).rev() {
            positions.swap(i, (random.next_u64() % (i as u64 + 1)) as usize);
        }
    }
    let order = if shuffle { "shuffled" } else { "in rows" };
    println!(
        "{} points {order}, partial volumes {}, {} threads:",
        positions.len(),
        rule.name(),
        rayon::current_num_threads()
    );
    let volumes = vec![1.0; positions.len()];
    let cloud = timed("cloud", || Cloud::scattered(positions, volumes));
    let body = timed("families", || standard::body(cloud, 3.015, rule));
    let operator = timed("weights", || Operator::standard(&body, 1.0, Influence::Constant, rule));
    let mut physics: Elasticity<3> =
        timed("states and volumes", || Elasticity::new(body, operator, Box::new(Bonds::new(BondBased)), 1.0, None));
    std::hint::black_box(timed("stable step", || physics.stable_step()));
    let n = physics.body.cloud.n_slots();
    for slot in 0..n {
        let x = physics.body.cloud.position(slot);
        for (c, u) in components_mut::<3, _>(&mut physics.state.displacement).into_iter().zip(x) {
            c[slot] = 1e-3 * (0.1 * u).sin();
        }
    }
    timed("one sum of forces", || physics.evolve(0.0));
    timed("one sum of volumes", || physics.field("damage", 0..n));
    let bonds = physics.state.states.count();
    println!("  {} bonds a point, peak memory {:.2} GiB", bonds / n as u64, peak().unwrap_or(f64::NAN));
}

#[test]
#[ignore = "a million points, for timing only"]
fn set_up_of_a_million_scattered_points() {
    let shape = Shape::Box { low: [0.0; 3], high: [100.0; 3] };
    let lattice = Cloud::lattice(&shape, 1.0, 4);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut next = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
    let positions: Vec<[f64; 3]> =
        lattice.slots.iter().map(|&s| lattice.position(s as usize).map(|x| x + 0.2 * next())).collect();
    for (rule, shuffle) in [(PartialVolume::None, false), (PartialVolume::None, true), (PartialVolume::Ramp, false)] {
        set_up(rule, positions.clone(), shuffle);
    }
}
