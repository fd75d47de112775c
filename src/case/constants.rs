//! The named constants of a case, and the texts that stand for a number.
//!
//! ```toml
//! [constants]
//! h = "0.5 mm"
//! delta = "3*h"
//! ```
//!
//! A constant may use constants written below it; a circle is a mistake. Constants carry no
//! dimension: they are SI numbers, and so is every expression of them.
//!
//! A number before a name is a number with a unit, and not a product. Where the name is that of a constant too, nobody can
//! tell which is meant: that is a mistake, unless both are the same, as of `mm = "1 mm"`.

use std::collections::{HashMap, HashSet};

use super::diagnostics::{Diagnostic, shorten};
use super::read::Source;
use super::tree::{Entry, Node, NodeValue, Origin, join};
use super::units::{Dimension, Unit, UnitError, split_quantity};
use crate::conditions::profile::VARIABLES;
use crate::expression::{Expression, ExpressionError, is_reserved, nearest};

/// More than any case needs; bounds the depth of a chain of constants.
const MOST_CONSTANTS: usize = 1000;

/// The constants of a case that could be computed, and the names of those that could not.
#[derive(Debug, Default)]
pub(super) struct Constants {
    pub known: Vec<(String, f64)>,
    pub failed: HashSet<String>,
}

/// Why a text is not the number that is wanted.
#[derive(Debug)]
pub(super) enum Mistake {
    /// The unit does not exist or cannot be read.
    Unit(UnitError),
    /// The unit measures something else.
    Dimension {
        found: Dimension,
        help: Option<String>,
    },
    Expression(ExpressionError),
    /// It follows from a mistake already reported.
    Echo,
}

impl Constants {
    /// The SI number behind `"72 GPa"` or `"2*h"`; any dimension is accepted if none is given.
    pub fn number(&self, text: &str, wanted: Option<Dimension>) -> Result<f64, Mistake> {
        if let Some(number) = self.quantity(text, wanted, &[]) {
            return number;
        }
        self.constant_expression(text)
    }

    /// The SI number behind a number with a unit; `None` if the text is not of that form.
    pub fn quantity(&self, text: &str, wanted: Option<Dimension>, variables: &[&str]) -> Option<Result<f64, Mistake>> {
        let (number, unit_text) = split_quantity(text)?;
        // `2t` is a product with its sign forgotten, and is explained as such.
        let word = names(unit_text).next().unwrap_or("");
        let parsed = Unit::parse(unit_text);
        let is_known = |(name, _): &(String, f64)| name == word;
        if parsed.is_err() && (variables.contains(&word) || self.known.iter().any(is_known)) {
            return None;
        }
        let both = if parsed.is_ok() { self.unit_and_constant(unit_text) } else { None };
        let is_right = |unit: &Unit| wanted.is_none_or(|wanted| wanted == unit.dimension);
        let mut others = names(unit_text).skip(1);
        if !parsed.as_ref().is_ok_and(is_right)
            && others.any(|name| variables.contains(&name) || self.known.iter().any(|(known, _)| known == name))
        {
            return Some(Err(unit_in_formula(0, text.len())));
        }
        if let Some(name) = both.filter(|_| parsed.as_ref().is_ok_and(is_right)) {
            return Some(Err(either_of_two(number, unit_text, name, text.len())));
        }
        let help =
            both.map(|name| format!("`{name}` is a constant of this case too: {}", the_product(number, unit_text)));
        let value = parsed.map_err(Mistake::Unit).and_then(|unit| {
            if wanted.is_some_and(|wanted| wanted != unit.dimension) {
                return Err(Mistake::Dimension { found: unit.dimension, help });
            }
            unit.to_si(number)
                .ok_or_else(|| Mistake::Unit(UnitError { message: "the number cannot be read".to_owned(), help: None }))
        });
        Some(value)
    }

    /// The first name of a unit that can be read as a product of constants too, with another value.
    fn unit_and_constant<'t>(&self, unit: &'t str) -> Option<&'t str> {
        let constant = |name: &str| self.known.iter().find(|(known, _)| known == name).map(|(_, value)| *value);
        let all = names(unit).all(|name| constant(name).is_some() || self.failed.contains(name));
        let differs = |name: &&str| {
            let of_unit = Unit::parse(name).ok().and_then(|unit| unit.to_si("1"));
            // Of a unit that is not a power of ten a rounding.
            of_unit.zip(constant(name)).is_none_or(|(a, b)| (a - b).abs() > 4.0 * f64::EPSILON * a.abs())
        };
        names(unit).find(differs).filter(|_| all)
    }

    /// Compiles a formula of the given variables.
    pub fn compile(&self, text: &str, variables: &[&str]) -> Result<Expression, Mistake> {
        Expression::compile(text, variables, &self.known).map_err(|error| {
            let part = split_quantity(text.get(error.start..error.end).unwrap_or(""));
            if names(text).any(|name| self.failed.contains(name)) {
                Mistake::Echo
            } else if part.is_some_and(|(_, unit)| {
                let is_name = variables.contains(&unit) || self.known.iter().any(|(known, _)| known == unit);
                !is_name && Unit::parse(unit).is_ok()
            }) {
                unit_in_formula(error.start, error.end)
            } else {
                Mistake::Expression(error)
            }
        })
    }

    fn constant_expression(&self, text: &str) -> Result<f64, Mistake> {
        let expression = self.compile(text, &[])?;
        expression.as_constant().ok_or_else(|| {
            Mistake::Expression(ExpressionError {
                message: "this is not a constant".to_owned(),
                start: 0,
                end: text.len(),
                help: None,
            })
        })
    }

    /// Computes the entries of `[constants]` in the order in which they need each other.
    pub fn evaluate(table: &Node, source: &Source) -> (Self, Vec<Diagnostic>) {
        let mut work = Evaluation {
            entries: table.entries(),
            by_name: HashMap::new(),
            state: vec![State::New; table.entries().len()],
            constants: Self::default(),
            source,
            diagnostics: Vec::new(),
        };
        if !matches!(table.value, NodeValue::Table(_)) {
            let message = format!("`constants` must be a table, not {}", table.kind());
            work.report(&table.origin, "", message, |d| {
                d.help("write `[constants]` and below it lines such as `h = \"0.5 mm\"`")
            });
        }
        if work.entries.len() > MOST_CONSTANTS {
            let message = format!("more than {MOST_CONSTANTS} named constants");
            work.report(&table.origin, "", message, |d| d);
            return (work.constants, work.diagnostics);
        }
        for (index, entry) in work.entries.iter().enumerate() {
            work.by_name.insert(&entry.key, index);
        }
        for index in 0..work.entries.len() {
            work.visit(index, &mut Vec::new());
        }
        (work.constants, work.diagnostics)
    }
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    New,
    Open,
    Done,
}

struct Evaluation<'a> {
    entries: &'a [Entry],
    by_name: HashMap<&'a str, usize>,
    state: Vec<State>,
    constants: Constants,
    source: &'a Source,
    diagnostics: Vec<Diagnostic>,
}

impl<'a> Evaluation<'a> {
    /// Computes a constant after those it needs; `chain` is how it was reached.
    fn visit(&mut self, index: usize, chain: &mut Vec<&'a str>) {
        let entry = &self.entries[index];
        match self.state[index] {
            State::Done => return,
            State::Open => {
                chain.push(&entry.key);
                let first = chain.iter().position(|name| *name == entry.key);
                let circle = chain[first.unwrap_or(0)..].join(" -> ");
                chain.pop();
                let message = format!("the constants need each other: {circle}");
                self.report(&entry.node.origin, &entry.key, message, |d| d);
                self.constants.failed.insert(entry.key.clone());
                return;
            }
            State::New => {}
        }
        self.state[index] = State::Open;
        chain.push(&entry.key);
        if let NodeValue::Text(text) = &entry.node.value {
            // `mm = "1 mm"` does not need itself.
            let is_quantity = split_quantity(text).is_some();
            for name in names(text).filter(|name| !is_quantity || *name != entry.key) {
                if let Some(&needed) = self.by_name.get(name) {
                    self.visit(needed, chain);
                }
            }
        }
        chain.pop();
        self.state[index] = State::Done;
        match self.compute(entry) {
            Some(value) if !self.constants.failed.contains(&entry.key) => {
                self.constants.known.push((entry.key.clone(), value));
            }
            _ => {
                self.constants.failed.insert(entry.key.clone());
            }
        }
    }

    fn compute(&mut self, entry: &'a Entry) -> Option<f64> {
        let name = entry.key.as_str();
        let is_start = |c: char| c.is_ascii_alphabetic() || c == '_';
        let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if !name.starts_with(is_start) || !name.chars().all(is_part) {
            let message = "the name of a constant has letters, digits and `_` only";
            self.report(&entry.key_origin, name, message.to_owned(), |d| d);
            return None;
        }
        if VARIABLES.contains(&name) || is_reserved(name) {
            let message = format!("`{name}` means something else in every expression");
            self.report(&entry.key_origin, name, message, |d| d.help("choose another name"));
            return None;
        }
        let value = match &entry.node.value {
            NodeValue::Integer(Some(value)) => Some(*value as f64),
            NodeValue::Float(value) => Some(*value),
            NodeValue::Text(text) => match self.constants.number(text, None) {
                Ok(value) => Some(value),
                Err(mistake) => {
                    let path = join("constants", name);
                    let found = self.source.found(&entry.node);
                    self.diagnostics.extend(mistake.diagnostic(self.source, &entry.node, &path, found, None));
                    return None;
                }
            },
            _ => None,
        };
        let found = self.source.found(&entry.node);
        match value {
            Some(value) if value.is_finite() => return Some(value),
            Some(_) => {
                let message = "must be finite".to_owned();
                self.report(&entry.node.origin, name, message, |d| d.found(found));
            }
            None => {
                let message = "must be a number, a number with a unit or an expression";
                self.report(&entry.node.origin, name, message.to_owned(), |d| d.found(found));
            }
        }
        None
    }

    fn report(&mut self, origin: &Origin, name: &str, message: String, more: impl FnOnce(Diagnostic) -> Diagnostic) {
        let path = if name.is_empty() { "constants".to_owned() } else { join("constants", name) };
        let place = self.source.place_of(origin);
        let diagnostic = Diagnostic::error(place, &path, message);
        self.diagnostics.push(more(diagnostic));
    }
}

/// `100 h` where h is a constant.
fn either_of_two(number: &str, unit: &str, name: &str, end: usize) -> Mistake {
    let message =
        format!("`{name}` is a constant of this case and a unit too: a number before it is read as one in that unit");
    let help = format!("{}; for the unit, give the constant another name", the_product(number, unit));
    Mistake::Expression(ExpressionError { message, start: 0, end, help: Some(help) })
}

fn the_product(number: &str, unit: &str) -> String {
    format!("write `{number}*{}` for the product", unit.split_whitespace().collect::<Vec<_>>().join("*"))
}

fn unit_in_formula(start: usize, end: usize) -> Mistake {
    let message = "a number with a unit cannot be a part of a formula".to_owned();
    let help = "write it in SI units without a unit, or name it in [constants]".to_owned();
    Mistake::Expression(ExpressionError { message, start, end, help: Some(help) })
}

impl Mistake {
    /// The remark about the text of `node`; nothing for an echo.
    pub fn diagnostic(
        self,
        source: &Source,
        node: &Node,
        path: &str,
        found: String,
        wanted: Option<(Dimension, &str)>,
    ) -> Option<Diagnostic> {
        let place = source.place_of(&node.origin);
        let allowed = wanted.map(|(_, allowed)| allowed.to_owned());
        let mut diagnostic = match self {
            Self::Echo => return None,
            Self::Unit(error) => {
                Diagnostic { help: error.help, allowed, ..Diagnostic::error(place, path, error.message) }
            }
            Self::Dimension { found, help } => {
                let wanted =
                    wanted.map_or_else(String::new, |(wanted, _)| format!(" where {} is wanted", wanted.name()));
                let message = format!("this is {}{wanted}", found.name());
                Diagnostic { allowed, help, ..Diagnostic::error(place, path, message) }
            }
            Self::Expression(error) => {
                let NodeValue::Text(text) = &node.value else {
                    return None;
                };
                let column = 1 + text.get(..error.start).map_or(0, |s| s.chars().count());
                Diagnostic {
                    help: error.help,
                    ..Diagnostic::error(
                        source.place_inside(node, error.start),
                        path,
                        format!("{} (character {column} of the text)", error.message),
                    )
                }
            }
        };
        diagnostic.found = Some(shorten(&found));
        Some(diagnostic)
    }
}

/// The names in an expression; `e5` of `1e5` is not one.
fn names(text: &str) -> impl Iterator<Item = &str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    text.split(move |c| !is_part(c)).filter(|word| word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_'))
}

/// The nearest of some names to a misspelt one, if it is near.
pub(super) fn did_you_mean<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // The cost grows with the square of the length; no key is this long.
    if name.len() > 64 {
        return None;
    }
    nearest(name, names)
}
