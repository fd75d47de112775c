//! `bondwise check`: the preflight.

use std::process::ExitCode;

use bondwise::Result;
use bondwise::case::build::{Options, available_memory, load};
use bondwise::output::source::{DiffusiveSummary, ElasticSummary, LoadSummary, MaterialSummary, PhysicsSummary};

use crate::{CaseArgs, on_threads, say};

pub fn check(args: &CaseArgs) -> Result<ExitCode> {
    on_threads(args.threads, || -> Result<ExitCode> {
        let simulation = load(&args.case, &args.overrides, &Options::default())?;
        let facts = simulation.model.facts();
        let families = simulation.model.family_sizes();
        say!("{}", simulation.title);
        say!("points            {}", facts.points);
        say!("bonds (directed)  {}, of which pre-cracks cut {}", facts.bonds, facts.cut_bonds);
        say!("spacing           {:.6e} m", facts.spacing);
        let unit = ["m", "m^2", "m^3"][facts.dimension.clamp(1, 3) - 1];
        match facts.shape_volume {
            Some(shape) => say!(
                "volume            {:.6e} {unit} of cells, {shape:.6e} {unit} of the shape: {:+.2} %",
                facts.volume,
                // Adding 0 makes one zero of the two.
                (1e4 * (facts.volume / shape - 1.0)).round() / 100.0 + 0.0
            ),
            None => say!("volume            {:.6e} {unit}", facts.volume),
        }
        if let Some(mass) = facts.mass {
            say!("mass              {mass:.6e} {}", ["kg/m^2", "kg/m", "kg"][facts.dimension.clamp(1, 3) - 1]);
        }
        say!("horizon           {:.6e} m, ratio {:.4}", facts.horizon, facts.horizon / facts.spacing);
        match &facts.physics {
            PhysicsSummary::Elastic(facts) => elastic(facts),
            PhysicsSummary::Diffusive(facts) => diffusive(facts),
        }
        say!("stable step       {:.6e} s", simulation.solver.largest_step(facts.stable_step));
        let steps = simulation.stages_to_come.front().map_or(simulation.n_steps, |leg| leg.first);
        let end = simulation.clock.end();
        say!("steps             {steps} of {:.6e} s, to t = {end:.6e} s", simulation.clock.dt);
        for leg in &simulation.stages_to_come {
            say!("then              {} of {:.6e} s, to t = {:.6e} s", leg.n_steps, leg.dt, leg.ends);
        }
        loads(&simulation.loads, facts.dimension);
        let mib = |bytes: u64| bytes as f64 / 1048576.0;
        say!("memory            {:.1} MiB for fields and bonds", mib(facts.memory));
        if let Some(free) = available_memory() {
            say!("free memory       {:.1} MiB", mib(free));
        }
        say!("neighbours of a point (bonds that hold at the start):");
        let alone = match &facts.physics {
            PhysicsSummary::Elastic(_) => "they fly free",
            PhysicsSummary::Diffusive(_) => "nothing reaches them",
        };
        histogram(&families, alone);
        Ok(ExitCode::SUCCESS)
    })?
}

/// What each load adds up to.
fn loads(list: &[LoadSummary], dimension: usize) {
    for load in list {
        let on = if load.on.is_empty() { String::new() } else { format!(" on `{}`", load.on) };
        let area =
            load.area.map_or(String::new(), |area| format!(", area {area:.6e} {}", ["", "m", "m^2"][dimension - 1]));
        if load.kind == "flux" || load.kind == "source" {
            say!(
                "{} (condition {}){on}{area}: {:.6e} enter in a second at t = {} s",
                load.kind,
                load.condition,
                load.force[0],
                load.time
            );
            continue;
        }
        let list = |x: &[f64]| x.iter().map(|x| format!("{x:.6e}")).collect::<Vec<_>>().join(", ");
        let (force, about) = (list(&load.force[..dimension]), [0..0, 2..3, 0..3][dimension - 1].clone());
        let moment =
            if about.is_empty() { String::new() } else { format!(", moment ({}) N m", list(&load.moment[about])) };
        say!(
            "{} (condition {}){on}{area}: force ({force}) N{moment} at t = {} s",
            load.kind,
            load.condition,
            load.time
        );
    }
}

/// A table of materials, if there are several.
fn materials(list: &[MaterialSummary]) {
    if list.is_empty() {
        return;
    }
    let width = list.iter().map(|material| material.name.len()).max().unwrap_or(0).max(8);
    say!(
        "{:<width$} {:>9} {:>11} {:>8} {:>8} {:>8} {:>8} {:>11} {:>11}",
        "material",
        "points",
        "volume",
        "bar m/s",
        "long.",
        "shear",
        "Rayleigh",
        "step s",
        "stretch"
    );
    let speed = |speed: Option<f64>| speed.map_or("-".into(), |speed| format!("{speed:.0}"));
    for m in list {
        say!(
            "{:<width$} {:>9} {:>11.4e} {:>8.0} {:>8.0} {:>8} {:>8} {:>11.4e} {:>11}",
            m.name,
            m.points,
            m.volume,
            m.bar_speed,
            m.longitudinal_speed,
            speed(m.shear_speed),
            speed(m.rayleigh_speed),
            m.stable_step,
            m.critical_stretch.map_or("never".into(), |stretch| format!("{stretch:.4e}"))
        );
    }
}

fn elastic(facts: &ElasticSummary) {
    say!("micromodulus      {:.6e}", facts.micromodulus);
    match facts.critical_stretch {
        Some(s) => say!("critical stretch  {s:.6e}"),
        None => say!("critical stretch  none: bonds never break"),
    }
    let surface = &facts.surface;
    say!(
        "surface effect    {:.1} % of the points off by more than 1 %; softest {:.3}; body {:.2} % too soft",
        100.0 * surface.points_affected,
        surface.softest,
        100.0 * surface.mean_deficit
    );
    say!("bar wave speed    {:.1} m/s", facts.bar_speed);
    if let Some(speed) = facts.rayleigh_speed {
        say!("Rayleigh speed    {speed:.1} m/s");
    }
    materials(&facts.materials);
}

fn diffusive(facts: &DiffusiveSummary) {
    say!("diffusivity       {:.6e} m^2/s", facts.diffusivity);
    match facts.found_diffusivity {
        Some(found) => say!("found by waves    {found:.6e} m^2/s, ratio {:.4}", found / facts.diffusivity),
        None => say!("found by waves    not known of scattered points"),
    }
    say!("micro-diffusivity {:.6e}, flux by 1/distance^{}", facts.micro_diffusivity, facts.exponent);
    let width = facts.materials.iter().map(|material| material.name.len()).max().unwrap_or(0).max(8);
    if !facts.materials.is_empty() {
        say!("{:<width$} {:>9} {:>11} {:>14}", "material", "points", "volume", "m^2/s");
    }
    for material in &facts.materials {
        let (points, volume) = (material.points, material.volume);
        say!("{:<width$} {points:>9} {volume:>11.4e} {:>14.6e}", material.name, material.diffusivity);
    }
}

/// At most twelve bars of equal width. `alone`: what becomes of points without a bond.
fn histogram(sizes: &[u32], alone: &str) {
    let (Some(&least), Some(&most)) = (sizes.iter().min(), sizes.iter().max()) else { return };
    let mean = sizes.iter().map(|&n| f64::from(n)).sum::<f64>() / sizes.len() as f64;
    let width = (most - least) / 12 + 1;
    let mut bars = vec![0usize; ((most - least) / width + 1) as usize];
    for n in sizes {
        bars[((n - least) / width) as usize] += 1;
    }
    let tallest = bars.iter().copied().max().unwrap_or(1);
    for (k, &count) in bars.iter().enumerate().filter(|(_, count)| **count > 0) {
        let low = least + k as u32 * width;
        let high = (low + width - 1).min(most);
        let label = if low == high { format!("{low}") } else { format!("{low}-{high}") };
        say!("{label:>9} {count:>10} {}", "#".repeat((50 * count).div_ceil(tallest)));
    }
    say!("fewest {least}, mean {mean:.1}, most {most}");
    let lonely = sizes.iter().filter(|&&n| n == 0).count();
    if lonely > 0 {
        say!("warning: {lonely} points have no bond at all; {alone}");
    }
}
