//! Compares the tree of a case with the JSON schema of its types and makes plain JSON of it.
//!
//! The schema is the one `schemars` makes, with two extensions. `x-unit` gives the SI unit of the
//! numbers beneath; each of them may be written as a number, a number with a unit or an expression
//! of the named constants, and becomes the SI number. `x-expression` lists the variables of the
//! formulas beneath; those are compiled to find their mistakes and stay texts.

use serde_json::{Map, Value};

use super::constants::{Constants, Mistake, did_you_mean};
use super::diagnostics::{Diagnostic, Place, Severity, shorten};
use super::read::Source;
use super::schema::{Context, Layers, Variant};
use super::tree::{Entry, Node, NodeValue, Origin, join};

/// A file that is wrong all over is not worth more lines than this.
const MOST_MISTAKES: usize = 100;
/// How deep a value that takes the place of a wrong one may be nested: types may contain themselves.
const DEEPEST_STAND_IN: usize = 8;
/// Entries of one list whose places are remembered; a later one is found at its list.
const MOST_LOCATED: usize = 1000;

/// The JSON of the tree and all mistakes in it. Where there is a mistake, the JSON holds some value of the right kind in
/// its place, so that rules across keys can still look at the rest; it is null where that cannot be had.
pub(super) fn validate(
    root: &Node,
    schema: &Value,
    constants: &Constants,
    source: &mut Source,
) -> (Value, Vec<Diagnostic>) {
    let mut validator = Validator { schema, constants, source, mistakes: Vec::new() };
    let value = validator.check(root, schema, &Context::default(), "");
    let mut mistakes = validator.mistakes;
    if mistakes.len() >= MOST_MISTAKES {
        let place = Place::File { file: source.name.clone() };
        let message = format!("only {MOST_MISTAKES} mistakes are shown");
        mistakes.truncate(MOST_MISTAKES);
        mistakes.push(Diagnostic::warning(place, "", message));
    }
    (value.unwrap_or(Value::Null), mistakes)
}

struct Validator<'a> {
    schema: &'a Value,
    constants: &'a Constants,
    source: &'a mut Source,
    mistakes: Vec<Diagnostic>,
}

impl<'a> Validator<'a> {
    fn check(&mut self, node: &Node, schema: &'a Value, context: &Context<'a>, path: &str) -> Option<Value> {
        self.source.record(path, node);
        self.check_unrecorded(node, schema, context, path)
    }

    fn check_unrecorded(&mut self, node: &Node, schema: &'a Value, context: &Context<'a>, path: &str) -> Option<Value> {
        let layers = Layers::of(self.schema, schema);
        self.check_layers(node, &layers, context, path)
    }

    /// A value of the right kind, whatever it says: it takes the place of one that is wrong.
    fn stand_in_for(&self, schema: &'a Value) -> Option<Value> {
        self.stand_in(&Layers::of(self.schema, schema), 0)
    }

    fn stand_in(&self, layers: &Layers<'a>, depth: usize) -> Option<Value> {
        if depth > DEEPEST_STAND_IN {
            return None;
        }
        if let Some(variants) = layers.variants() {
            return variants.iter().find_map(|variant| match variant.data {
                None => Some(Value::from(variant.name)),
                Some(data) => {
                    let value = self.stand_in(&Layers::of(self.schema, data), depth + 1)?;
                    Some(Value::Object(Map::from_iter([(variant.name.to_owned(), value)])))
                }
            });
        }
        if let Some(union) = layers.alternatives() {
            return union.iter().find_map(|s| self.stand_in(&layers.clone().then(s), depth + 1));
        }
        let kinds = layers.kinds();
        let kind = if kinds.contains(&"null") { "null" } else { *kinds.first()? };
        match kind {
            "null" => Some(Value::Null),
            "number" => Some(Value::from(1.0)),
            "integer" => Some(Value::from(1)),
            "string" => Some(Value::from("")),
            "boolean" => Some(Value::from(false)),
            "array" => Some(Value::Array(Vec::new())),
            "object" => {
                let properties = layers.get("properties").and_then(Value::as_object);
                let required = layers.get("required").and_then(Value::as_array);
                let mut result = Map::new();
                for name in required.into_iter().flatten().filter_map(Value::as_str) {
                    let schema = properties?.get(name)?;
                    let value = self.stand_in(&Layers::of(self.schema, schema), depth + 1)?;
                    result.insert(name.to_owned(), value);
                }
                Some(Value::Object(result))
            }
            _ => None,
        }
    }

    fn check_layers(&mut self, node: &Node, layers: &Layers<'a>, context: &Context<'a>, path: &str) -> Option<Value> {
        if self.mistakes.len() >= MOST_MISTAKES {
            return None;
        }
        let context = &context.within(layers);
        if let Some(variants) = layers.variants() {
            return self.check_enum(node, layers, &variants, context, path);
        }
        let kinds = layers.kinds();
        let has = |kind: &str| kinds.contains(&kind);
        let union = layers.alternatives().unwrap_or_default();
        let union: Vec<_> = union.iter().map(|s| layers.clone().then(s)).collect();
        let choices: Vec<_> = union.iter().filter_map(Layers::variants).flatten().collect();
        if choices.is_empty()
            && has("number")
            && (has("string") || layers.get("x-expression").is_some())
            && let (Some(variables), NodeValue::Text(text)) = (&context.variables, &node.value)
        {
            return self.check_formula(node, text, variables, layers, context, path);
        }
        if !union.is_empty() {
            if let NodeValue::Text(text) = &node.value
                && let Some(name) = self.misspelt_choice(text, &choices, context)
            {
                let message = "there is no such choice".to_owned();
                let diagnostic = self.located(node, path, message);
                let allowed = layers.wanted(context);
                let help = format!("did you mean `{name}`?");
                return self.report(diagnostic.allowed(allowed).help(help));
            }
            // A table that names no choice is meant for the only alternative that is one by tables.
            let tables: Vec<_> = union.iter().filter(|l| l.variants().is_some()).collect();
            let meant = match (&node.value, &tables[..]) {
                (NodeValue::Table(_), [one]) => Some(*one),
                _ => None,
            };
            let meant = meant.filter(|_| !union.iter().any(|l| l.kinds() == ["object"]));
            return match union.iter().find(|l| l.fits(node)).or(meant) {
                Some(chosen) => self.check_layers(node, chosen, context, path),
                None => self.wrong_kind(node, layers, context, path),
            };
        }
        match &node.value {
            NodeValue::Table(entries) if has("object") => self.check_table(node, entries, layers, context, path),
            NodeValue::Array(items) if has("array") => self.check_list(node, items, layers, context, path),
            NodeValue::Boolean(value) if has("boolean") => Some(Value::from(*value)),
            NodeValue::Integer(_) | NodeValue::Float(_) if has("number") => {
                self.check_number(node, layers, context, path)
            }
            NodeValue::Integer(_) | NodeValue::Float(_) if has("integer") => {
                self.check_integer(node, layers, context, path)
            }
            NodeValue::Text(text) if has("string") => Some(Value::from(text.as_str())),
            NodeValue::Text(_) if has("number") => self.check_number(node, layers, context, path),
            _ if has("string") => match self.source.override_text(node) {
                // `--set name=5`: a shell takes the quotes away.
                Some(text) => Some(Value::from(text)),
                None => self.wrong_kind(node, layers, context, path),
            },
            _ if kinds.is_empty() => Some(raw(node)),
            _ => self.wrong_kind(node, layers, context, path),
        }
    }

    /// The choice of a union that a text is near to, unless it is one or means a number.
    fn misspelt_choice<'v>(&self, text: &str, choices: &'v [Variant<'a>], context: &Context<'a>) -> Option<&'v str> {
        let variables = context.variables.iter().flatten().copied();
        let constants = self.constants.known.iter().map(|(name, _)| name.as_str());
        let failed = self.constants.failed.iter().map(String::as_str);
        let names = || choices.iter().map(|choice| choice.name);
        let mut taken = variables.chain(constants).chain(failed).chain(names());
        if taken.any(|name| name == text) {
            return None;
        }
        did_you_mean(text, names())
    }

    fn check_table(
        &mut self,
        node: &Node,
        entries: &[Entry],
        layers: &Layers<'a>,
        context: &Context<'a>,
        path: &str,
    ) -> Option<Value> {
        let properties = layers.get("properties").and_then(Value::as_object);
        let others = layers.get("additionalProperties").filter(|s| s.is_object());
        let is_map = others.is_some() || properties.is_none_or(Map::is_empty);
        let is_map = is_map && layers.get("additionalProperties") != Some(&Value::Bool(false));
        let known = || properties.into_iter().flat_map(Map::keys);
        let required = layers.get("required").and_then(Value::as_array);
        let is_required = |key: &str| required.is_some_and(|names| names.iter().any(|name| name == key));
        let mut result = Map::new();
        let mut sound = true;
        // A required key that was misspelt is one mistake, not two.
        let mut meant = Vec::new();
        for entry in entries {
            if self.mistakes.len() >= MOST_MISTAKES {
                return None;
            }
            let child_path = join(path, &entry.key);
            let child = properties.and_then(|map| map.get(&entry.key)).or(others);
            let value = match child {
                Some(schema) => self.check(&entry.node, schema, context, &child_path),
                None if is_map => Some(raw(&entry.node)),
                None => {
                    let key = shorten(&entry.key);
                    let place = self.source.place_of(&entry.key_origin);
                    let message = format!("unknown key `{key}`");
                    let near = did_you_mean(&entry.key, known().map(String::as_str));
                    let mut diagnostic = Diagnostic::error(place, &child_path, message);
                    diagnostic.help = near.map(|name| format!("did you mean `{name}`?"));
                    diagnostic.allowed = Some(match known().count() {
                        0 => "no keys".to_owned(),
                        _ => known().cloned().collect::<Vec<_>>().join(", "),
                    });
                    meant.extend(near);
                    self.mistakes.push(diagnostic);
                    continue;
                }
            };
            // What may be missing is left out; what must be there, or has a name of the user's, gets a stand-in.
            let needed = properties.and_then(|map| map.get(&entry.key)).is_none() || is_required(&entry.key);
            match value.or_else(|| child.filter(|_| needed).and_then(|s| self.stand_in_for(s))) {
                Some(value) => {
                    result.insert(entry.key.clone(), value);
                }
                None => sound &= !needed,
            }
        }
        for name in required.into_iter().flatten().filter_map(Value::as_str) {
            if entries.iter().any(|entry| entry.key == name) {
                continue;
            }
            let schema = properties.and_then(|map| map.get(name));
            match schema.and_then(|schema| self.stand_in_for(schema)) {
                Some(value) => {
                    result.insert(name.to_owned(), value);
                }
                None => sound = false,
            }
            if meant.contains(&name) {
                continue;
            }
            let place = self.source.place_of(&node.origin);
            let message = format!("missing key `{name}`");
            let path = join(path, name);
            let line = schema.map(|schema| Layers::of(self.schema, schema).line(name, &path, context));
            let line = line.unwrap_or_default();
            self.mistakes.push(Diagnostic::error(place, &path, message).help(line));
        }
        sound.then_some(Value::Object(result))
    }

    fn check_list(
        &mut self,
        node: &Node,
        items: &[Node],
        layers: &Layers<'a>,
        context: &Context<'a>,
        path: &str,
    ) -> Option<Value> {
        let count = items.len() as u64;
        let least = layers.get("minItems").and_then(Value::as_u64).unwrap_or(0);
        let most = layers.get("maxItems").and_then(Value::as_u64);
        let most = most.unwrap_or(u64::MAX);
        if !(least..=most).contains(&count) {
            let wanted = if least == most {
                format!("{least} entries")
            } else if count < least {
                format!("at least {least} {}", if least == 1 { "entry" } else { "entries" })
            } else {
                format!("at most {most} {}", if most == 1 { "entry" } else { "entries" })
            };
            let message = format!("the list must have {wanted}, not {count}");
            return self.refuse(node, path, message, None);
        }
        let each = layers.get("prefixItems").and_then(Value::as_array);
        let rest = layers.get("items");
        let mut result = Vec::with_capacity(items.len());
        let mut sound = true;
        for (index, item) in items.iter().enumerate() {
            let schema = each.and_then(|each| each.get(index)).or(rest);
            let item_path = format!("{path}[{index}]");
            let value = match schema {
                Some(schema) if index < MOST_LOCATED => self.check(item, schema, context, &item_path),
                Some(schema) => self.check_unrecorded(item, schema, context, &item_path),
                None => Some(raw(item)),
            };
            match value.or_else(|| schema.and_then(|schema| self.stand_in_for(schema))) {
                Some(value) => result.push(value),
                None => sound = false,
            }
        }
        sound.then_some(Value::Array(result))
    }

    fn check_enum(
        &mut self,
        node: &Node,
        layers: &Layers<'a>,
        variants: &[Variant<'a>],
        context: &Context<'a>,
        path: &str,
    ) -> Option<Value> {
        let find = |name: &str| variants.iter().find(|variant| variant.name == name);
        let list = || {
            let shown = variants.iter().map(Variant::shown);
            shown.collect::<Vec<_>>().join(", ")
        };
        match &node.value {
            NodeValue::Text(text) => match find(text) {
                Some(Variant { data: None, .. }) => Some(Value::from(text.as_str())),
                Some(Variant { name, data: Some(data) }) => {
                    let example = Layers::of(self.schema, data).placeholder(context);
                    let message = format!("`{name}` needs data of its own");
                    let diagnostic = self.located(node, path, message);
                    self.report(diagnostic.help(format!("write `{{ {name} = {example} }}`")))
                }
                None => {
                    let message = "there is no such choice".to_owned();
                    let near = did_you_mean(text, variants.iter().map(|v| v.name));
                    let mut diagnostic = self.located(node, path, message).allowed(list());
                    diagnostic.help = near.map(|name| format!("did you mean `{name}`?"));
                    self.report(diagnostic)
                }
            },
            NodeValue::Table(entries) => {
                let mut known = 0;
                let mut result = None;
                for entry in entries {
                    let child_path = join(path, &entry.key);
                    let place = self.source.place_of(&entry.key_origin);
                    match find(&entry.key) {
                        Some(Variant { name, data: Some(data) }) => {
                            known += 1;
                            let value = self.check(&entry.node, data, context, &child_path);
                            let value = value.or_else(|| self.stand_in_for(data));
                            result = value.map(|value| Value::Object(Map::from_iter([((*name).to_owned(), value)])));
                        }
                        Some(Variant { name, data: None }) => {
                            let message = format!("`{name}` has no keys");
                            let help = format!("write it as the text `\"{name}\"`");
                            return self.report(Diagnostic::error(place, &child_path, message).help(help));
                        }
                        None => {
                            let message = format!("there is no choice `{}`", shorten(&entry.key));
                            let near = did_you_mean(&entry.key, variants.iter().map(|v| v.name));
                            let mut diagnostic = Diagnostic::error(place, &child_path, message).allowed(list());
                            diagnostic.help = near.map(|name| format!("did you mean `{name}`?"));
                            return self.report(diagnostic);
                        }
                    }
                }
                if known != 1 {
                    let names: Vec<_> = entries.iter().map(|e| format!("`{}`", e.key)).collect();
                    let message = match known {
                        0 => "a choice is missing".to_owned(),
                        _ => format!("only one of {} can be chosen", names.join(" and ")),
                    };
                    // The second one is what was added.
                    let origin = entries.get(1).map_or(&node.origin, |e| &e.key_origin);
                    let place = self.source.place_of(origin);
                    return self.report(Diagnostic::error(place, path, message).allowed(list()));
                }
                result
            }
            _ => self.wrong_kind(node, layers, context, path),
        }
    }

    fn check_number(&mut self, node: &Node, layers: &Layers<'a>, context: &Context<'a>, path: &str) -> Option<Value> {
        let number = match &node.value {
            NodeValue::Integer(Some(value)) => *value as f64,
            NodeValue::Integer(None) => {
                return self.refuse(node, path, "the number is too large", None);
            }
            NodeValue::Float(value) => *value,
            NodeValue::Text(text) => {
                let dimension = context.dimension();
                match self.constants.number(text, Some(dimension)) {
                    Ok(value) => value,
                    Err(mistake) => return self.mistake(mistake, node, layers, context, path),
                }
            }
            _ => return self.wrong_kind(node, layers, context, path),
        };
        self.in_range(node, number, layers, context, path)?;
        serde_json::Number::from_f64(number).map(Value::Number)
    }

    fn check_integer(&mut self, node: &Node, layers: &Layers<'a>, context: &Context<'a>, path: &str) -> Option<Value> {
        let whole = match &node.value {
            NodeValue::Integer(value) => *value,
            // 1e3 is a whole number to everybody but TOML; beyond 2^53 it is not an exact one.
            NodeValue::Float(value) if value.fract() == 0.0 && value.abs() <= 2f64.powi(53) => Some(*value as i64),
            NodeValue::Float(value) if value.is_finite() => {
                return self.refuse(node, path, "must be a whole number", layers.range());
            }
            NodeValue::Float(_) => {
                return self.refuse(node, path, "must be finite", layers.range());
            }
            _ => return self.wrong_kind(node, layers, context, path),
        };
        let Some(whole) = whole else {
            return self.refuse(node, path, "the number is too large", layers.range());
        };
        // Rust's own limits, which the schema gives as a format only.
        let (least, most) = match layers.get("format").and_then(Value::as_str) {
            Some("uint8") => (0, u8::MAX.into()),
            Some("uint16") => (0, u16::MAX.into()),
            Some("uint32") => (0, u32::MAX.into()),
            Some("int8") => (i8::MIN.into(), i8::MAX.into()),
            Some("int16") => (i16::MIN.into(), i16::MAX.into()),
            Some("int32") => (i32::MIN.into(), i32::MAX.into()),
            _ => (i64::MIN, i64::MAX),
        };
        self.in_range(node, whole as f64, layers, context, path)?;
        if whole < least || whole > most {
            let message = format!("must be between {least} and {most}");
            return self.refuse(node, path, message, None);
        }
        Some(Value::from(whole))
    }

    /// Reports a number that is not finite or not in the range of the schema.
    fn in_range(
        &mut self,
        node: &Node,
        number: f64,
        layers: &Layers<'a>,
        context: &Context<'a>,
        path: &str,
    ) -> Option<()> {
        let limit = |key: &str| layers.get(key).and_then(Value::as_f64);
        let range = layers.range();
        let allowed = |context: &Context<'a>| match context.unit {
            Some(_) if !context.dimension().is_one() => Some(context.quantity()),
            _ => None,
        };
        if !number.is_finite() {
            let message = match range {
                Some(range) => format!("must be finite and {range}"),
                None => "must be finite".to_owned(),
            };
            return self.refuse(node, path, message, allowed(context));
        }
        let inside = limit("minimum").is_none_or(|least| number >= least)
            && limit("maximum").is_none_or(|most| number <= most)
            && limit("exclusiveMinimum").is_none_or(|below| number > below)
            && limit("exclusiveMaximum").is_none_or(|above| number < above);
        match range {
            Some(range) if !inside => self.refuse(node, path, format!("must be {range}"), allowed(context)),
            _ => Some(()),
        }
    }

    fn check_formula(
        &mut self,
        node: &Node,
        text: &str,
        variables: &[&str],
        layers: &Layers<'a>,
        context: &Context<'a>,
        path: &str,
    ) -> Option<Value> {
        let number = match self.constants.quantity(text, Some(context.dimension()), variables) {
            Some(Ok(number)) => number,
            Some(Err(mistake)) => return self.mistake(mistake, node, layers, context, path),
            None => match self.constants.compile(text, variables) {
                Ok(expression) => match expression.as_constant() {
                    Some(number) => {
                        self.in_range(node, number, layers, context, path)?;
                        return Some(Value::from(text));
                    }
                    None => return Some(Value::from(text)),
                },
                Err(mistake) => return self.mistake(mistake, node, layers, context, path),
            },
        };
        self.in_range(node, number, layers, context, path)?;
        serde_json::Number::from_f64(number).map(Value::Number)
    }

    fn mistake<R>(
        &mut self,
        mistake: Mistake,
        node: &Node,
        layers: &Layers<'a>,
        context: &Context<'a>,
        path: &str,
    ) -> Option<R> {
        let found = self.source.found(node);
        let allowed = context.allowed(layers);
        let wanted = Some((context.dimension(), allowed.as_str()));
        match mistake.diagnostic(self.source, node, path, found, wanted) {
            Some(diagnostic) => self.report(diagnostic),
            None => None,
        }
    }

    fn wrong_kind<R>(&mut self, node: &Node, layers: &Layers<'a>, context: &Context<'a>, path: &str) -> Option<R> {
        let message = format!("must be {}", layers.wanted(context));
        self.refuse(node, path, message, None)
    }

    fn refuse<R>(&mut self, node: &Node, path: &str, message: impl Into<String>, allowed: Option<String>) -> Option<R> {
        let mut diagnostic = self.located(node, path, message.into());
        diagnostic.allowed = allowed;
        self.report(diagnostic)
    }

    fn located(&self, node: &Node, path: &str, message: String) -> Diagnostic {
        let place = self.source.place_of(&node.origin);
        Diagnostic::error(place, path, message).found(self.source.found(node))
    }

    /// Always `None`: what was reported has no value.
    fn report<R>(&mut self, diagnostic: Diagnostic) -> Option<R> {
        debug_assert_eq!(diagnostic.severity, Severity::Error);
        self.mistakes.push(diagnostic);
        None
    }
}

/// The value as it is, where the schema accepts anything.
fn raw(node: &Node) -> Value {
    match &node.value {
        NodeValue::Table(entries) => {
            let pairs = entries.iter().map(|e| (e.key.clone(), raw(&e.node)));
            Value::Object(pairs.collect())
        }
        NodeValue::Array(items) => items.iter().map(raw).collect(),
        NodeValue::Text(text) => Value::from(text.as_str()),
        NodeValue::Integer(value) => Value::from(*value),
        NodeValue::Float(value) => Value::from(*value),
        NodeValue::Boolean(value) => Value::from(*value),
        NodeValue::Date => Value::Null,
    }
}

impl Source {
    /// The text of a value given as a whole with `--set`.
    fn override_text(&self, node: &Node) -> Option<&str> {
        match &node.origin {
            Origin::Override { index, whole: true } => self.overrides.get(*index).map(|(_, text)| text.as_str()),
            _ => None,
        }
    }
}
