//! What a JSON schema made from types says about one value of a case.
//!
//! Understood are objects, maps, lists, tuples, numbers, integers, texts, booleans, `Option`,
//! references, externally tagged enums, and unions that can be told apart by the kind of value.
//! The sentences about what is wanted are made here as well, from the same words of the schema.

use serde_json::{Map, Value};

use super::tree::{Node, NodeValue};
use super::units::Dimension;

/// What a schema says about the values beneath it.
#[derive(Clone, Default)]
pub(super) struct Context<'a> {
    pub unit: Option<&'a str>,
    pub variables: Option<Vec<&'a str>>,
}

/// A schema and what it refers to, from the outside in; the outermost word counts.
#[derive(Clone)]
pub(super) struct Layers<'a> {
    root: &'a Value,
    list: Vec<&'a Map<String, Value>>,
}

/// One variant of an enum: its name and, if it has any, the schema of its data.
pub(super) struct Variant<'a> {
    pub name: &'a str,
    pub data: Option<&'a Value>,
}

impl<'a> Context<'a> {
    /// The context of what lies beneath these layers.
    pub fn within(&self, layers: &Layers<'a>) -> Self {
        let unit = layers.get("x-unit").and_then(Value::as_str).or(self.unit);
        let names = layers.get("x-expression").and_then(Value::as_array);
        let own = names.map(|names| names.iter().filter_map(Value::as_str).collect());
        Self { unit, variables: own.or_else(|| self.variables.clone()) }
    }

    pub fn dimension(&self) -> Dimension {
        self.unit.map_or_else(Dimension::default, Dimension::of)
    }

    /// `a pressure in Pa, kPa, MPa, above 0`.
    pub fn allowed(&self, layers: &Layers<'_>) -> String {
        let range = layers.range().map_or_else(String::new, |r| format!(", {r}"));
        format!("{}{range}", self.quantity())
    }

    /// `a pressure in Pa, kPa, MPa`.
    pub fn quantity(&self) -> String {
        let dimension = self.dimension();
        let name = dimension.name();
        match name.split_once(" in ") {
            None if !dimension.is_one() => format!("{name} in {}", dimension.units()),
            _ => name,
        }
    }
}

impl<'a> Layers<'a> {
    /// The layers of one schema in the document `root`.
    pub fn of(root: &'a Value, schema: &'a Value) -> Self {
        let list = Vec::new();
        Self { root, list }.then(schema)
    }

    /// Follows references, `allOf` of one and `Option` to the schema that says something.
    pub fn then(mut self, schema: &'a Value) -> Self {
        let mut schema = schema;
        // A schema made from types has a few references in a row at most.
        for _ in 0..32 {
            let Some(map) = schema.as_object() else {
                break;
            };
            self.list.push(map);
            let only = |key: &str| {
                let list = map.get(key)?.as_array()?;
                let mut list = list.iter().filter(|s| !is_null(s));
                list.next().filter(|_| list.next().is_none())
            };
            let next = if let Some(Value::String(reference)) = map.get("$ref") {
                self.root.pointer(reference.trim_start_matches('#'))
            } else if let Some(inner) = only("allOf") {
                Some(inner)
            } else {
                // An enum with one variant with data is a list of one too.
                only("anyOf").or_else(|| only("oneOf").filter(|s| variant_names(s).is_none()))
            };
            match next {
                Some(next) => schema = next,
                None => break,
            }
        }
        self
    }

    pub fn get(&self, key: &str) -> Option<&'a Value> {
        self.list.iter().find_map(|layer| layer.get(key))
    }

    /// The alternatives of a union, `null` left out; only of the innermost layer, as the outer
    /// ones have been chosen from.
    pub fn alternatives(&self) -> Option<Vec<&'a Value>> {
        let last = self.list.last()?;
        let list = last.get("oneOf").or_else(|| last.get("anyOf"))?.as_array()?;
        Some(list.iter().filter(|s| s.is_object() && !is_null(s)).collect())
    }

    /// The range of a number in words that follow "must be".
    pub fn range(&self) -> Option<String> {
        let limit = |key: &str| self.get(key).and_then(Value::as_f64);
        let (least, most) = (limit("minimum"), limit("maximum"));
        // Of two limits on one side the stricter one is shown.
        let above = limit("exclusiveMinimum").filter(|above| least.is_none_or(|l| l <= *above));
        let below = limit("exclusiveMaximum").filter(|below| most.is_none_or(|m| m >= *below));
        let low = match (above, least) {
            (Some(above), _) => Some(format!("above {above}")),
            (None, Some(least)) => Some(format!("{least} or more")),
            (None, None) => None,
        };
        let high = match (below, most) {
            (Some(below), _) => Some(format!("below {below}")),
            (None, Some(most)) => Some(format!("{most} or less")),
            (None, None) => None,
        };
        match (low, high, least, most) {
            (Some(_), Some(_), Some(l), Some(m)) if above.is_none() && below.is_none() => {
                Some(format!("between {l} and {m}"))
            }
            (Some(low), Some(high), ..) => Some(format!("{low} and {high}")),
            (low, high, ..) => low.or(high),
        }
    }

    /// The variants if the schema is an externally tagged enum.
    pub fn variants(&self) -> Option<Vec<Variant<'a>>> {
        let last = *self.list.last()?;
        if last.contains_key("enum") || last.contains_key("const") {
            return names_of(last).map(|names| {
                let unit = |name| Variant { name, data: None };
                names.into_iter().map(unit).collect()
            });
        }
        let mut variants = Vec::new();
        for alternative in self.alternatives()? {
            let resolved = Self::of(self.root, alternative);
            let map = *resolved.list.last()?;
            if let Some(names) = names_of(map) {
                let unit = |name| Variant { name, data: None };
                variants.extend(names.into_iter().map(unit));
            } else {
                variants.push(data_variant(map)?);
            }
        }
        Some(variants)
    }

    /// The JSON types a schema accepts, also through a union; none means all.
    pub fn kinds(&self) -> Vec<&'a str> {
        if self.variants().is_some() {
            return vec!["string", "object"];
        }
        if let Some(union) = self.alternatives() {
            let all = union.iter().map(|s| Self::of(self.root, s));
            return all.flat_map(|l| l.kinds()).collect();
        }
        match self.list.last().and_then(|last| last.get("type")) {
            Some(Value::String(kind)) => vec![kind],
            Some(Value::Array(list)) => {
                let names = list.iter().filter_map(Value::as_str);
                names.filter(|kind| *kind != "null").collect()
            }
            _ => Vec::new(),
        }
    }

    /// Whether a value is of the kind that one alternative of a union accepts.
    pub fn fits(&self, node: &Node) -> bool {
        if let Some(variants) = self.variants() {
            return match &node.value {
                NodeValue::Text(text) => variants.iter().any(|variant| variant.name == text),
                NodeValue::Table(entries) => {
                    entries.iter().any(|entry| variants.iter().any(|variant| variant.name == entry.key))
                }
                _ => false,
            };
        }
        let wanted: &[&str] = match &node.value {
            NodeValue::Table(_) => &["object"],
            NodeValue::Array(_) => &["array"],
            NodeValue::Text(_) => &["string", "number"],
            NodeValue::Integer(_) | NodeValue::Float(_) => &["number", "integer"],
            NodeValue::Boolean(_) => &["boolean"],
            NodeValue::Date => &[],
        };
        self.kinds().iter().any(|kind| wanted.contains(kind))
    }

    /// What a schema wants, in plain words: `a number in Pa, e.g. 2.5 or "2.5 kPa"`.
    pub fn wanted(&self, context: &Context<'a>) -> String {
        if let Some(variants) = self.variants() {
            let names: Vec<_> = variants.iter().map(Variant::shown).collect();
            return match names.as_slice() {
                [one] => one.clone(),
                _ => format!("one of {}", names.join(", ")),
            };
        }
        if let Some(union) = self.alternatives() {
            let all = union.iter().map(|s| self.clone().then(s));
            let texts: Vec<_> = all.map(|l| l.wanted(&context.within(&l))).collect();
            return texts.join(", or ");
        }
        self.wanted_plainly(context)
    }

    fn wanted_plainly(&self, context: &Context<'a>) -> String {
        let kinds = self.kinds();
        let has = |kind: &str| kinds.contains(&kind);
        let range = self.range().map_or_else(String::new, |r| format!(" {r}"));
        if has("number") {
            let dimension = context.dimension();
            let unit = context.unit.unwrap_or("");
            let formula = match &context.variables {
                Some(variables) if has("string") => {
                    format!(" or a formula of {}", variables.join(", "))
                }
                _ => String::new(),
            };
            if dimension.is_one() {
                return format!("a number{range}{formula}");
            }
            let units = dimension.units();
            let example = units.split(", ").nth(1).unwrap_or(unit);
            let name = dimension.name();
            let name = name.split_once(' ').map_or("", |(_, noun)| noun);
            return format!("a number with a unit of {name} ({unit}){range}, e.g. 2.5 or \"2.5 {example}\"{formula}");
        }
        if has("integer") {
            return format!("a whole number{range}");
        }
        if has("string") {
            return "a text in quotes".to_owned();
        }
        if has("boolean") {
            return "true or false".to_owned();
        }
        if has("array") {
            let least = self.get("minItems").and_then(Value::as_u64);
            let most = self.get("maxItems").and_then(Value::as_u64);
            return match (least, most) {
                (Some(least), Some(most)) if least == most => format!("a list of {least}"),
                _ if self.get("items").is_some_and(|items| Self::of(self.root, items).kinds().contains(&"object")) => {
                    "a list of tables, each under a heading in double brackets, `[[...]]`".to_owned()
                }
                _ => "a list, e.g. [1, 2]".to_owned(),
            };
        }
        let properties = self.get("properties").and_then(Value::as_object);
        match properties.map(|map| map.keys().cloned().collect::<Vec<_>>()) {
            Some(keys) if !keys.is_empty() => format!("a table with the keys {}", keys.join(", ")),
            _ => "a table".to_owned(),
        }
    }

    /// The line to add for a missing key, with the first sentence of its description.
    pub fn line(&self, name: &str, path: &str, context: &Context<'a>) -> String {
        let line = match self.variants() {
            None if self.kinds() == ["object"] => format!("add a table `[{path}]`"),
            _ => format!("add `{name} = {}`", self.placeholder(context)),
        };
        let description = self.get("description").and_then(Value::as_str);
        match description.and_then(|text| text.split(['\n', '.']).next()) {
            Some(sentence) if !sentence.is_empty() => format!("{line}: {sentence}"),
            _ => line,
        }
    }

    /// A stand-in for a value, such as `<number, Pa>`.
    pub fn placeholder(&self, context: &Context<'a>) -> String {
        let context = &context.within(self);
        if let Some(variants) = self.variants() {
            let names: Vec<_> = variants.iter().map(Variant::shown).collect();
            return match names.as_slice() {
                [one] => one.clone(),
                _ => format!("<{}>", names.join(" or ")),
            };
        }
        if let Some(union) = self.alternatives() {
            let all = union.iter().map(|s| Self::of(self.root, s).placeholder(context));
            return all.collect::<Vec<_>>().join(" or ");
        }
        let kinds = self.kinds();
        let has = |kind: &str| kinds.contains(&kind);
        if has("number") {
            return match context.unit {
                Some(unit) if !context.dimension().is_one() => format!("<number, {unit}>"),
                _ => "<number>".to_owned(),
            };
        }
        if has("array") {
            let count = self.get("minItems").and_then(Value::as_u64);
            let item = self
                .get("items")
                .map_or_else(|| "...".to_owned(), |item| Self::of(self.root, item).placeholder(context));
            return match count {
                Some(count @ 2..=3) => format!("[{}]", vec![item; count as usize].join(", ")),
                _ => format!("[{item}, ...]"),
            };
        }
        if has("object") {
            let required = self.get("required").and_then(Value::as_array);
            let names = required.into_iter().flatten().filter_map(Value::as_str);
            let keys: Vec<_> = names.map(|name| format!("{name} = ...")).collect();
            return match keys.len() {
                0 => "{ ... }".to_owned(),
                _ => format!("{{ {} }}", keys.join(", ")),
            };
        }
        let plain = [("integer", "<whole number>"), ("string", "\"<text>\""), ("boolean", "<true or false>")];
        let found = plain.iter().find(|(kind, _)| has(kind));
        found.map_or("...", |(_, text)| text).to_owned()
    }
}

impl Variant<'_> {
    /// `constant` or `{ gaussian = ... }`.
    pub fn shown(&self) -> String {
        match self.data {
            None => format!("\"{}\"", self.name),
            Some(_) => format!("{{ {} = ... }}", self.name),
        }
    }
}

fn is_null(schema: &Value) -> bool {
    schema.get("type").and_then(Value::as_str) == Some("null")
}

fn variant_names(schema: &Value) -> Option<()> {
    let map = schema.as_object()?;
    let is_variant = names_of(map).is_some() || data_variant(map).is_some();
    is_variant.then_some(())
}

fn names_of(map: &Map<String, Value>) -> Option<Vec<&str>> {
    if let Some(name) = map.get("const") {
        return name.as_str().map(|name| vec![name]);
    }
    let names = map.get("enum")?.as_array()?;
    names.iter().filter(|n| !n.is_null()).map(Value::as_str).collect()
}

/// An object of one property that is required is a variant with data.
fn data_variant(map: &Map<String, Value>) -> Option<Variant<'_>> {
    let properties = map.get("properties")?.as_object()?;
    let required = map.get("required")?.as_array()?;
    let (name, data) = properties.iter().next()?;
    let alone = properties.len() == 1 && required.len() == 1;
    (alone && required[0] == name.as_str()).then_some(Variant { name, data: Some(data) })
}
