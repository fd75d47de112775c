//! The text of a case as a tree of values that know where they were written.
//!
//! The tree is what TOML says, before anything is known about the case: tables keep the order of
//! the file, numbers keep what they are, and a value given with `--set` remembers that.

use std::ops::Range;

use toml::de::{DeTable, DeValue, Error as TomlError};

use super::diagnostics::{Diagnostic, Place, shorten};
use super::read::Source;

/// One value of the case.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub value: NodeValue,
    pub origin: Origin,
}

#[derive(Debug, Clone)]
pub(super) enum NodeValue {
    Table(Vec<Entry>),
    Array(Vec<Node>),
    Text(String),
    /// `None` for an integer outside 64 bits.
    Integer(Option<i64>),
    Float(f64),
    Boolean(bool),
    Date,
}

/// One `key = value` of a table.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub key: String,
    pub key_origin: Origin,
    pub node: Node,
}

/// Where a key or value was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Origin {
    /// Bytes of the text; of a table its header.
    Text(Range<usize>),
    /// The override of this index; `whole` if it is the value given and not a part of it.
    Override { index: usize, whole: bool },
}

impl Node {
    /// What it is, in plain words.
    pub fn kind(&self) -> &'static str {
        match &self.value {
            NodeValue::Table(_) => "a table",
            NodeValue::Array(_) => "a list",
            NodeValue::Text(_) => "a text",
            NodeValue::Integer(_) => "a whole number",
            NodeValue::Float(_) => "a number",
            NodeValue::Boolean(_) => "true or false",
            NodeValue::Date => "a date or time",
        }
    }

    /// The children of a table; none for any other value.
    pub fn entries(&self) -> &[Entry] {
        match &self.value {
            NodeValue::Table(entries) => entries,
            _ => &[],
        }
    }

    fn from_toml(value: &DeValue<'_>, origin: &dyn Fn(Range<usize>, bool) -> Origin) -> NodeValue {
        let child = |value: &DeValue<'_>, span: Range<usize>| Node {
            value: Self::from_toml(value, origin),
            origin: origin(span, false),
        };
        match value {
            DeValue::String(text) => NodeValue::Text(text.to_string()),
            DeValue::Integer(number) => NodeValue::Integer(i64::from_str_radix(number.as_str(), number.radix()).ok()),
            // "1e999" is read as infinite, which no key accepts.
            DeValue::Float(number) => NodeValue::Float(number.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Boolean(value) => NodeValue::Boolean(*value),
            DeValue::Datetime(_) => NodeValue::Date,
            DeValue::Array(items) => {
                NodeValue::Array(items.iter().map(|item| child(item.get_ref(), item.span())).collect())
            }
            DeValue::Table(table) => NodeValue::Table(entries(table, origin)),
        }
    }
}

/// The entries of a table in the order of the file; TOML's own table is sorted by name.
fn entries(table: &DeTable<'_>, origin: &dyn Fn(Range<usize>, bool) -> Origin) -> Vec<Entry> {
    let mut sorted: Vec<_> = table.iter().collect();
    sorted.sort_by_key(|(key, _)| key.span().start);
    sorted
        .into_iter()
        .map(|(key, value)| Entry {
            key: key.get_ref().to_string(),
            key_origin: origin(key.span(), true),
            node: Node { value: Node::from_toml(value.get_ref(), origin), origin: origin(value.span(), false) },
        })
        .collect()
}

/// Reads the text as TOML. The list holds the mistakes of syntax; the flag says whether the tree
/// is worth looking at in spite of them, as it is when keys are merely given twice.
pub(super) fn parse(source: &Source) -> (Node, Vec<Diagnostic>, bool) {
    let (table, errors) = DeTable::parse_recoverable(&source.text);
    let mut diagnostics: Vec<Diagnostic> = Vec::new();
    let mut last_line = 0;
    let mut readable = true;
    let start = |error: &TomlError| error.span().map_or(0, |span| span.start);
    let mut errors: Vec<&TomlError> = errors.iter().collect();
    errors.sort_by_key(|error| start(error));
    for error in errors {
        let line = source.position(start(error)).0;
        // The parser goes on after a mistake; the rest of the line is often an echo of it.
        if line == last_line {
            continue;
        }
        last_line = line;
        readable &= error.message() == DUPLICATE;
        diagnostics.push(syntax_diagnostic(source, error, start(error)));
        // Every line after a list that is not closed is an echo of that.
        let is_open = error.message().contains("array");
        if is_open || diagnostics.len() == MOST_SYNTAX_ERRORS {
            break;
        }
    }
    let root = Node {
        value: NodeValue::Table(entries(table.get_ref(), &|span, _| Origin::Text(span))),
        origin: Origin::Text(0..0),
    };
    (root, diagnostics, readable)
}

const DUPLICATE: &str = "duplicate key";
const MOST_SYNTAX_ERRORS: usize = 20;

fn syntax_diagnostic(source: &Source, error: &TomlError, start: usize) -> Diagnostic {
    let place = source.place_of(&Origin::Text(start..start));
    let message = error.message();
    if message.contains("recurs") {
        let deep = "nested deeper than 80 tables, lists or dots";
        return Diagnostic::error(place, "", deep);
    }
    if message != DUPLICATE {
        let line_after = source.text.get(start..).and_then(|rest| rest.lines().next()).map_or("", str::trim);
        let no_value = line_after.is_empty() || line_after.starts_with('#');
        if no_value && message.contains("must be quoted") {
            return Diagnostic::error(place, "", "a value is missing");
        }
        if message.contains("must be quoted") {
            let value = line_after.split(['#', ',', '}', ']']).next().unwrap_or("").trim_end();
            let diagnostic = Diagnostic::error(place, "", "a text, or a number with a unit, stands in quotes");
            let plain = !value.contains(['"', '\'', '\\']);
            return if plain { diagnostic.help(format!("write `\"{}\"`", shorten(value))) } else { diagnostic };
        }
        if message.starts_with("invalid basic string") {
            return Diagnostic::error(
                place,
                "",
                "this is not TOML: a text is not closed, or `\\` is not doubled in it",
            );
        }
        let text = format!("this is not TOML: {message}");
        if message.contains("between array") {
            let help = "is a list above this line not closed with `]`?";
            return Diagnostic::error(place, "", text).help(help);
        }
        return Diagnostic::error(place, "", text);
    }
    let key = error.span().and_then(|span| source.text.get(span));
    let key = shorten(key.unwrap_or(""));
    match first_definition(source, start) {
        Some(line) => {
            let message = format!("`{key}` is given twice, first in line {line}");
            Diagnostic::error(place, "", message).help("keep one of the two lines")
        }
        None => Diagnostic::error(place, "", format!("`{key}` is given twice")),
    }
}

/// The line that defines first what is defined again at byte `start`, found by comparing lines:
/// the parser does not tell.
fn first_definition(source: &Source, start: usize) -> Option<usize> {
    let squeeze = |line: &str| -> String {
        let line = line.split('#').next().unwrap_or("");
        let is_shown = |c: &char| !c.is_whitespace() && *c != '"' && *c != '\'';
        line.chars().filter(is_shown).collect()
    };
    let header = |line: &str| {
        let inside = line.strip_prefix('[')?.trim_start_matches('[');
        Some(inside.split(']').next().unwrap_or("").to_owned())
    };
    let line_of_error = source.position(start).0;
    let lines: Vec<String> = source.text.lines().take(line_of_error).map(squeeze).collect();
    let this = lines.last()?;
    let mut table = String::new();
    let mut definitions = Vec::new();
    for line in &lines {
        if let Some(path) = header(line) {
            table.clone_from(&path);
            definitions.push(path);
        } else {
            let key = line.split('=').next().unwrap_or("");
            let dot = if table.is_empty() { "" } else { "." };
            definitions.push(format!("{table}{dot}{key}"));
        }
    }
    let wanted = definitions.pop()?;
    let below = format!("{wanted}.");
    let clashes =
        |path: &String| *path == wanted || path.starts_with(&below) || wanted.starts_with(&format!("{path}."));
    let exact = definitions.iter().rposition(|path| *path == wanted);
    let is_header = this.starts_with('[');
    // A table may be opened after its parent or its children; only a key clashes with those.
    let near = || {
        let is_key = |line: usize| is_header != lines[line].starts_with('[');
        (0..definitions.len()).rfind(|&i| is_key(i) && clashes(&definitions[i]))
    };
    exact.or_else(near).map(|index| index + 1)
}

/// Puts the values of `--set key.path=value` into the tree.
pub(super) fn apply(root: &mut Node, overrides: &[(String, String)], source: &Source) -> Vec<Diagnostic> {
    let mut diagnostics = Vec::new();
    for (index, (path, text)) in overrides.iter().enumerate() {
        if let Err((message, help)) = apply_one(root, index, path, text) {
            let origin = Origin::Override { index, whole: true };
            let mut diagnostic = Diagnostic::error(source.place_of(&origin), path, message);
            diagnostic.help = help;
            diagnostics.push(diagnostic);
        }
    }
    diagnostics
}

/// The message and help of an override that fits nowhere.
type Misfit = (String, Option<String>);

fn apply_one(root: &mut Node, index: usize, path: &str, text: &str) -> Result<(), Misfit> {
    let origin = Origin::Override { index, whole: false };
    let segments = segments(path)?;
    let mut node = root;
    let mut walked = String::new();
    for segment in &segments {
        let kind = node.kind();
        node = match &mut node.value {
            NodeValue::Table(entries) => {
                let position = entries.iter().position(|entry| entry.key == *segment);
                let position = position.unwrap_or_else(|| {
                    entries.push(Entry {
                        key: segment.clone(),
                        key_origin: origin.clone(),
                        node: Node { value: NodeValue::Table(Vec::new()), origin: origin.clone() },
                    });
                    entries.len() - 1
                });
                &mut entries[position].node
            }
            NodeValue::Array(items) => {
                let count = items.len();
                let found = segment.parse().ok().and_then(|i: usize| items.get_mut(i));
                found.ok_or_else(|| {
                    let last = count.saturating_sub(1);
                    let message = format!("`{walked}` is a list and has no entry `{segment}`");
                    let help = match count {
                        0 => "the list is empty".to_owned(),
                        _ => format!("its entries are 0 to {last}"),
                    };
                    (message, Some(help))
                })?
            }
            _ => {
                let message = format!("`{walked}` is {kind} in the case, not a table");
                let help = format!("set all of it, as in `--set {walked}=...`");
                return Err((message, Some(help)));
            }
        };
        if !walked.is_empty() {
            walked.push('.');
        }
        walked.push_str(segment);
    }
    node.value = match DeValue::parse(text) {
        Ok(value) => Node::from_toml(value.get_ref(), &|_, _| origin.clone()),
        Err(_) => NodeValue::Text(text.to_owned()),
    };
    node.origin = Origin::Override { index, whole: true };
    Ok(())
}

/// `conditions.0.value` or `conditions[0].value` as a list of names.
fn segments(path: &str) -> Result<Vec<String>, Misfit> {
    let plain = path.replace('[', ".").replace("].", ".");
    let plain = plain.strip_suffix(']').unwrap_or(&plain);
    let segments: Vec<String> = plain.split('.').map(|s| s.trim().to_owned()).collect();
    if segments.iter().any(String::is_empty) {
        let message = format!("`{}` is not a key path", shorten(path));
        let help = "write it as in `--set conditions.0.value=2`".to_owned();
        return Err((message, Some(help)));
    }
    if segments.len() > 80 {
        return Err(("the key path is deeper than 80".to_owned(), None));
    }
    Ok(segments)
}

/// `path.key`, with quotes where the key needs them.
pub(super) fn join(path: &str, key: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let dot = if path.is_empty() { "" } else { "." };
    if !key.is_empty() && key.chars().all(is_bare) {
        format!("{path}{dot}{key}")
    } else {
        format!("{path}{dot}\"{}\"", key.escape_debug())
    }
}

impl Source {
    /// The place of a key or value.
    pub(super) fn place_of(&self, origin: &Origin) -> Place {
        match origin {
            Origin::Text(span) => {
                let (line, column) = self.position(span.start);
                Place::Text { file: self.name.clone(), line, column }
            }
            Origin::Override { index, .. } => {
                let (path, value) = &self.overrides[*index];
                Place::Override(format!("--set {path}={}", shorten(value)))
            }
        }
    }
}
