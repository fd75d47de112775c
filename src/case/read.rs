//! From the text of a case to its data, or to a list of everything that is wrong with it.
//!
//! The types of the case say what is allowed: their JSON schema, made by `schemars`, is what the
//! text is compared with, and what an editor is given. Reading goes text, TOML tree, overrides of
//! the command line, named constants, comparison with the schema, data. Mistakes are collected, so
//! that a user sees all of them at once; only a text that is not TOML ends earlier.
//!
//! ```toml
//! [constants]
//! h = "0.5 mm"
//!
//! [material]
//! young = "72 GPa"
//! horizon = "3*h"
//! ```
//!
//! What needs more than one key to be judged is not judged here. [`Source`] leads from a key path
//! back to the text for those who do.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::constants::Constants;
use super::diagnostics::{Diagnostic, Diagnostics, Place, Severity, shorten};
use super::tree::{self, Node, NodeValue, Origin};
use super::validate;

/// Largest case file that is read, in bytes. Fields of numbers belong into files of their own.
const LARGEST: u64 = 16 << 20;

/// The data of a case and the text they came from.
#[derive(Debug, Clone)]
pub struct Located<T> {
    pub value: T,
    pub source: Source,
    /// The named constants in SI, for the formulas of the case.
    pub constants: Vec<(String, f64)>,
}

/// The text of a case, and where in it each key and value is written.
#[derive(Debug, Clone)]
pub struct Source {
    /// The file as the user named it.
    pub name: String,
    /// The text without a byte order mark.
    pub text: String,
    pub(super) overrides: Vec<(String, String)>,
    line_starts: Vec<usize>,
    spots: HashMap<String, Spot>,
}

/// Where one key path is written.
#[derive(Debug, Clone)]
struct Spot {
    origin: Origin,
    /// The value as it was written; `None` for a table or a long list, whose kind alone tells nothing.
    found: Option<String>,
}

/// Reads a case from a file. The overrides are pairs of key path and value, as in
/// `--set conditions.0.value=2`; for the rules see [`read_text_with`].
pub fn read_file<T: DeserializeOwned + JsonSchema>(
    path: &Path,
    overrides: &[(String, String)],
    rules: impl Fn(&Located<T>) -> Vec<Diagnostic>,
) -> Result<Located<T>, Diagnostics> {
    let name = path.display().to_string();
    let refuse = |place: Place, message: String| {
        let list = vec![Diagnostic::error(place, "", message)];
        Diagnostics { file: name.clone(), list }
    };
    let whole = || Place::File { file: name.clone() };
    let cannot = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::NotFound => refuse(whole(), "there is no such file".to_owned()),
        _ => refuse(whole(), format!("cannot be read: {e}")),
    };
    // Asked before the file is opened: opening a pipe waits for its other end.
    let metadata = fs::metadata(path).map_err(cannot)?;
    if !metadata.is_file() {
        return Err(refuse(whole(), "is not a regular file".to_owned()));
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(cannot)?;
    // The length can be wrong or grow; the reader is held to the limit as well.
    file.take(LARGEST + 1).read_to_end(&mut bytes).map_err(cannot)?;
    if bytes.len() as u64 > LARGEST {
        return Err(refuse(whole(), too_large()));
    }
    match String::from_utf8(bytes) {
        Ok(text) => read_text_with(&name, &text, overrides, rules),
        Err(error) => {
            let offset = error.utf8_error().valid_up_to();
            let before = String::from_utf8_lossy(&error.as_bytes()[..offset]).into_owned();
            let (line, column) = Source::new(&name, &before, &[]).position(before.len());
            let place = Place::Text { file: name.clone(), line, column };
            let byte = error.as_bytes()[offset];
            let message = format!("byte 0x{byte:02X} at offset {offset} is not UTF-8");
            Err(refuse(place, message))
        }
    }
}

fn too_large() -> String {
    format!("is larger than {} MiB; a table of points belongs into a CSV file", LARGEST >> 20)
}

/// Reads a case from a text; `name` stands for the file in messages.
pub fn read_text<T: DeserializeOwned + JsonSchema>(
    name: &str,
    text: &str,
    overrides: &[(String, String)],
) -> Result<Located<T>, Diagnostics> {
    read_text_with(name, text, overrides, |_| Vec::new())
}

/// Whether a remark of a rule across keys can be trusted, although the case has mistakes: it is about another table than
/// any of them, and none of them is about the case as a whole.
fn stands_alone(remark: &Diagnostic, mistakes: &[Diagnostic]) -> bool {
    let within = |path: &str, table: &str| {
        path.strip_prefix(table).is_some_and(|rest| table.is_empty() || rest.is_empty() || rest.starts_with(['.', '[']))
    };
    remark.severity == Severity::Error
        && mistakes.iter().all(|mistake| {
            let table = mistake.path.rfind(['.', '[']).map_or("", |end| &mistake.path[..end]);
            // What the first table says, such as the dimension, and constants are asked for everywhere.
            let everywhere = within(&mistake.path, "case") || within(&mistake.path, "constants");
            !everywhere && !within(&remark.path, table) && !within(&mistake.path, &remark.path)
        })
}

/// As [`read_text`]; if the text has mistakes, the rules across keys are asked too, about what is not touched by them.
pub fn read_text_with<T: DeserializeOwned + JsonSchema>(
    name: &str,
    text: &str,
    overrides: &[(String, String)],
    rules: impl Fn(&Located<T>) -> Vec<Diagnostic>,
) -> Result<Located<T>, Diagnostics> {
    let mut source = Source::new(name, text, overrides);
    if text.len() as u64 > LARGEST {
        let place = Place::File { file: name.to_owned() };
        return Err(source.refuse(vec![Diagnostic::error(place, "", too_large())]));
    }
    let (mut root, mut mistakes, readable) = tree::parse(&source);
    if !readable {
        return Err(source.refuse(mistakes));
    }
    mistakes.extend(tree::apply(&mut root, overrides, &source));
    let schema = plain_schema::<T>();
    if root.entries().is_empty() {
        if mistakes.is_empty() {
            mistakes.push(nothing_to_run(name, &schema));
        }
        return Err(source.refuse(mistakes));
    }
    let (constants, found) = take_constants(&mut root, &source);
    mistakes.extend(found);
    let (value, found) = validate::validate(&root, &schema, &constants, &mut source);
    mistakes.extend(found);
    if !mistakes.is_empty() {
        if let Ok(value) = serde_json::from_value(value) {
            let case = Located { value, source: source.clone(), constants: constants.known };
            let further = rules(&case).into_iter().filter(|remark| stands_alone(remark, &mistakes));
            let further: Vec<_> = further.collect();
            mistakes.extend(further);
        }
        return Err(source.refuse(mistakes));
    }
    match serde_json::from_value(value) {
        Ok(value) => Ok(Located { value, source, constants: constants.known }),
        // The types ask for more than their schema says.
        Err(error) => {
            let place = Place::File { file: name.to_owned() };
            Err(source.refuse(vec![Diagnostic::error(place, "", error.to_string())]))
        }
    }
}

/// The JSON schema of a case file for editors: every number may also be a text with a unit or an
/// expression, and `[constants]` is allowed.
pub fn schema_of<T: JsonSchema>() -> Value {
    let mut schema = plain_schema::<T>();
    allow_texts(&mut schema);
    if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
        let constants = json!({
            "description": "Named constants: a number, a number with a unit, or an expression.",
            "type": "object",
            "additionalProperties": { "type": ["number", "string"] },
        });
        properties.insert("constants".to_owned(), constants);
    }
    schema
}

fn plain_schema<T: JsonSchema>() -> Value {
    schemars::schema_for!(T).to_value()
}

/// Adds `"string"` to the type of every number of a schema.
fn allow_texts(schema: &mut Value) {
    let Some(map) = schema.as_object_mut() else {
        return;
    };
    match map.get_mut("type") {
        Some(Value::String(name)) if name == "number" => {
            map.insert("type".to_owned(), json!(["number", "string"]));
        }
        Some(Value::Array(names)) if names.contains(&json!("number")) && !names.contains(&json!("string")) => {
            names.push(json!("string"));
        }
        _ => {}
    }
    for (key, value) in map.iter_mut() {
        match (key.as_str(), value) {
            ("properties" | "$defs", Value::Object(children)) => {
                children.values_mut().for_each(allow_texts);
            }
            ("prefixItems" | "anyOf" | "oneOf" | "allOf", Value::Array(children)) => {
                children.iter_mut().for_each(allow_texts);
            }
            ("items" | "additionalProperties", child) => allow_texts(child),
            _ => {}
        }
    }
}

/// Removes `[constants]` from the tree and computes it.
fn take_constants(root: &mut Node, source: &Source) -> (Constants, Vec<Diagnostic>) {
    let NodeValue::Table(entries) = &mut root.value else {
        return (Constants::default(), Vec::new());
    };
    match entries.iter().position(|entry| entry.key == "constants") {
        Some(index) => Constants::evaluate(&entries.remove(index).node, source),
        None => (Constants::default(), Vec::new()),
    }
}

/// The remark about an empty case. The root type may carry its smallest case as the extension
/// `x-smallest`; the tables that are needed are listed otherwise.
fn nothing_to_run(name: &str, schema: &Value) -> Diagnostic {
    let place = Place::File { file: name.to_owned() };
    let diagnostic = Diagnostic::error(place, "", "nothing to run: the case is empty");
    if let Some(text) = schema.get("x-smallest").and_then(Value::as_str) {
        return diagnostic.help(format!("the smallest case is\n{}", text.trim_end()));
    }
    let needed = schema.get("required").and_then(Value::as_array);
    let names = needed.into_iter().flatten().filter_map(Value::as_str);
    let names: Vec<String> = names.map(|name| format!("`{name}`")).collect();
    match names.len() {
        0 => diagnostic,
        _ => diagnostic.help(format!("a case needs at least {}", names.join(", "))),
    }
}

impl Source {
    fn new(name: &str, text: &str, overrides: &[(String, String)]) -> Self {
        let text = text.strip_prefix('\u{FEFF}').unwrap_or(text).to_owned();
        let breaks = text.match_indices('\n').map(|(index, _)| index + 1);
        let line_starts = std::iter::once(0).chain(breaks).collect();
        Self { name: name.to_owned(), text, overrides: overrides.to_vec(), line_starts, spots: HashMap::new() }
    }

    /// The place of the value at a key path such as `conditions[1].value`, or of the nearest
    /// table above it that is written in the case.
    pub fn locate(&self, path: &str) -> Place {
        let mut path = path;
        loop {
            if let Some(spot) = self.spots.get(path) {
                return self.place_of(&spot.origin);
            }
            match path.rfind(['.', '[']) {
                Some(end) => path = &path[..end],
                None => {
                    return Place::File { file: self.name.clone() };
                }
            }
        }
    }

    /// The value at a key path as it was written; `None` if it is not written there or is a table.
    pub fn written(&self, path: &str) -> Option<&str> {
        self.spots.get(path)?.found.as_deref()
    }

    /// An error about the value at a key path, with its place and what was found there.
    pub fn error(&self, path: &str, message: impl Into<String>) -> Diagnostic {
        let mut diagnostic = Diagnostic::error(self.locate(path), path, message);
        diagnostic.found = self.written(path).map(str::to_owned);
        diagnostic
    }

    /// As [`Source::error`], but a warning.
    pub fn warning(&self, path: &str, message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, ..self.error(path, message) }
    }

    /// The remarks in the order of the file, those about overrides last.
    pub fn refuse(&self, mut list: Vec<Diagnostic>) -> Diagnostics {
        list.sort_by_key(|diagnostic| match &diagnostic.place {
            Place::File { .. } => (0, 0, 0),
            Place::Text { line, column, .. } => (1, *line, *column),
            Place::Override(_) => (2, 0, 0),
        });
        Diagnostics { file: self.name.clone(), list }
    }

    /// Line and column of a byte, both from one, columns in characters.
    pub(super) fn position(&self, byte: usize) -> (usize, usize) {
        let byte = self.text.floor_char_boundary(byte);
        let line = self.line_starts.partition_point(|&start| start <= byte);
        let start = self.line_starts[line - 1];
        (line, self.text[start..byte].chars().count() + 1)
    }

    /// The place of a byte inside a text value, or of the value if it is written with escapes.
    pub(super) fn place_inside(&self, node: &Node, byte: usize) -> Place {
        if let (Origin::Text(span), NodeValue::Text(text)) = (&node.origin, &node.value) {
            let start = span.start + 1;
            if self.text.get(start..span.end.saturating_sub(1)) == Some(text) {
                let at = start + byte;
                return self.place_of(&Origin::Text(at..at));
            }
        }
        self.place_of(&node.origin)
    }

    /// The value as it was written, or what it is if it is long.
    pub(super) fn found(&self, node: &Node) -> String {
        let raw = match (&node.value, &node.origin) {
            (NodeValue::Table(_), _) => return node.kind().to_owned(),
            (_, Origin::Text(span)) => self.text.get(span.clone()),
            (_, Origin::Override { index, whole: true }) => self.overrides.get(*index).map(|(_, value)| value.as_str()),
            _ => None,
        };
        match (raw, &node.value) {
            (Some(raw), NodeValue::Array(_)) if raw.len() > 60 || raw.starts_with("[[") => node.kind().to_owned(),
            (Some(raw), _) => shorten(raw),
            (None, NodeValue::Text(text)) => format!("\"{}\"", shorten(text)),
            (None, _) => node.kind().to_owned(),
        }
    }

    /// Remembers where a key path is written.
    pub(super) fn record(&mut self, path: &str, node: &Node) {
        let found = Some(self.found(node)).filter(|found| found != node.kind());
        let spot = Spot { origin: node.origin.clone(), found };
        self.spots.insert(path.to_owned(), spot);
    }
}
