//! `bondwise list`: what there is, from the same types and tables that the rest of the program uses.

use std::process::ExitCode;

use bondwise::Result;
use bondwise::case::library::{LibraryMaterial, Values};
use bondwise::case::{Case, bundled, schema_of};
use bondwise_studies::STUDIES;
use serde_json::Value;

use crate::bench::PROBLEMS;
use crate::say;

/// What can be listed.
pub const TOPICS: [&str; 18] = [
    "cases",
    "shapes",
    "regions",
    "cracks",
    "laws",
    "materials",
    "failures",
    "influence",
    "volumes",
    "corrections",
    "schemes",
    "conditions",
    "solvers",
    "outputs",
    "fields",
    "studies",
    "problems",
    "schema",
];

/// Topic, and the name of its type in the schema.
const TYPES: [(&str, &str); 13] = [
    ("shapes", "Shape"),
    ("regions", "Region"),
    ("cracks", "Crack"),
    ("laws", "Law"),
    ("failures", "Failure"),
    ("influence", "InfluenceFunction"),
    ("volumes", "PartialVolumes"),
    ("corrections", "SurfaceCorrection"),
    ("schemes", "Scheme"),
    ("conditions", "Condition"),
    ("solvers", "Solver"),
    ("outputs", "Output"),
    ("fields", "FieldName"),
];

pub fn list(topic: Option<&str>) -> Result<ExitCode> {
    if topic == Some("schema") {
        say!("{:#}", schema_of::<Case>());
        return Ok(ExitCode::SUCCESS);
    }
    let schema = schema_of::<Case>();
    for name in TOPICS {
        if topic.is_some_and(|t| t != name) || name == "schema" {
            continue;
        }
        if topic.is_none() {
            say!("{name}:");
        }
        for (item, about) in items(name, &schema) {
            say!("  {item:<24} {about}");
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn items(topic: &str, schema: &Value) -> Vec<(String, String)> {
    let plain = |pair: (&str, &str)| (pair.0.to_string(), pair.1.to_string());
    match topic {
        "cases" => bundled::CASES.iter().map(|c| plain((c.name, c.about))).collect(),
        "materials" => {
            let about = |material: &LibraryMaterial| {
                let Values { young, density, poisson, fracture_energy, source } = material.values();
                let energy = fracture_energy.map_or(String::new(), |energy| format!(", G₀ = {energy} J/m²"));
                let about = format!("E = {} GPa, ρ = {density} kg/m³, ν = {poisson}{energy} ({source})", 1e-9 * young);
                (material.name().to_string(), about)
            };
            LibraryMaterial::ALL.iter().map(about).collect()
        }
        "studies" => STUDIES.iter().map(|s| plain((s.name, s.about))).collect(),
        "problems" => PROBLEMS.iter().map(|p| plain((p.name, p.about))).collect(),
        "conditions" => {
            let mut all = Vec::new();
            for (key, name) in [("initial", "Motion"), ("prescribe", "Motion"), ("load", "Load")] {
                for (item, about) in variants(&schema["$defs"][name]) {
                    all.push((format!("{key}.{item}"), about));
                }
            }
            for (key, name) in [("mirror", "Mirror"), ("periodic", "Periodic")] {
                all.push((key.to_string(), first_line(&schema["$defs"][name])));
            }
            all
        }
        _ => TYPES.iter().find(|(t, _)| *t == topic).map_or(Vec::new(), |(_, name)| variants(&schema["$defs"][name])),
    }
}

/// The first paragraph of the documentation of a type in the schema.
fn first_line(node: &Value) -> String {
    let text = node["description"].as_str().unwrap_or_default();
    text.split('\n').take_while(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Names and first lines of documentation of the variants of an enum in the schema.
fn variants(schema: &Value) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let about = first_line;
    for variant in ["oneOf", "anyOf"].iter().filter_map(|k| schema[*k].as_array()).flatten() {
        if let Some(name) = variant["const"].as_str() {
            found.push((name.to_string(), about(variant)));
        }
        for name in variant["enum"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            found.push((name.to_string(), about(variant)));
        }
        for name in variant["properties"].as_object().into_iter().flat_map(|p| p.keys()) {
            found.push((name.clone(), about(variant)));
        }
    }
    for name in schema["enum"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        found.push((name.to_string(), String::new()));
    }
    found
}
