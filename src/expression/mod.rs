//! User formulas: `1e-3*sin(2*pi*x)` in a case file becomes numbers at points.
//!
//! The language is closed and total. It has numbers, names, operators and a fixed list of
//! functions; it has no loops, no assignment, no text and no way to define or reach anything else,
//! so a formula from a stranger can cost a little time and nothing more. Length and nesting are
//! bounded, and every walk over a formula is a loop or a recursion bounded by the nesting.
//!
//! ```text
//! or         = and { ("or" | "||") and }
//! and        = not { ("and" | "&&") not }
//! not        = ("not" | "!") not | comparison
//! comparison = sum [ ("<" | "<=" | ">" | ">=" | "==" | "!=") sum ]
//! sum        = product { ("+" | "-") product }
//! product    = sign { ("*" | "/") sign }
//! sign       = ("-" | "+") sign | power
//! power      = value [ "^" sign ]
//! value      = number | name | function "(" or { "," or } ")" | "(" or ")"
//! ```
//!
//! So `-x^2` is `-(x^2)`, `2^3^2` is `2^(3^2)`, and `not a < b` is `not (a < b)`, also when it is
//! spelled `!`. A comparison gives 1 or 0; logic takes every value but 0 as true. The one built-in
//! name is `pi`. Functions: `sin cos tan asin acos atan atan2 sinh cosh tanh exp log log10 sqrt abs
//! sign floor ceil min max pow hypot step if clamp erf`, where `log` is the natural logarithm.
//!
//! Nothing is skipped at evaluation: `if(c, a, b)`, `and` and `or` compute all their operands and
//! then select. `if(x > 0, 1/x, 0)` is still 0 at `x = 0`, since the infinite branch is computed
//! and dropped.
//!
//! A source goes through three stages in [`Expression::compile`]: tokens, a flat list of nodes in
//! which constants are already folded, and a tape of instructions over a few registers. Absent on
//! purpose: shared sub-expressions are computed again, and no rule of algebra is applied that could
//! change a bit (`0*x` stays, as `x` may be infinite), except that `x^2` and `x^3` are products.

mod operations;
mod parser;
mod tape;
mod tokens;

use std::ops::Range;

use operations::*;
use parser::*;
use tape::*;
use tokens::*;

/// Longest source, in characters.
const LONGEST: usize = 4096;
/// Deepest nesting of parentheses, calls, signs and exponents.
const DEEPEST: usize = 64;
/// Registers of the tape. Operands that need most registers are computed first, so a formula that
/// needs `r` of them is at least as long as a balanced tree of height about `r`; 4096 characters
/// reach 14.
const REGISTERS: usize = 16;
/// Points per instruction in a batch: 16 registers of 256 numbers are 32 KiB, a first-level cache.
const BLOCK: usize = 256;

/// A formula of named variables, compiled once and evaluated at many points.
///
/// ```
/// use bondwise::expression::Expression;
///
/// let constants = [("amplitude".to_string(), 0.5)];
/// let ramp = Expression::compile("amplitude * min(t, 1) * x^2", &["x", "t"], &constants)?;
/// assert_eq!(ramp.evaluate(&[2.0, 3.0]), 2.0);
///
/// let error = Expression::compile("2x", &["x"], &[]).unwrap_err();
/// assert_eq!(error.message, "an operator is missing between `2` and `x`");
/// assert_eq!(error.help.as_deref(), Some("write `2*x`"));
/// # Ok::<(), bondwise::expression::ExpressionError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Expression {
    source: String,
    tape: Vec<Instruction>,
    result: Operand,
    used: Vec<Used>,
}

/// What is wrong with a formula, and where: bytes `start..end` of its source.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct ExpressionError {
    /// One line in plain words.
    pub message: String,
    /// First byte of the part at fault.
    pub start: usize,
    /// One past its last byte.
    pub end: usize,
    /// What to write instead, when that can be told.
    pub help: Option<String>,
}

impl Expression {
    /// Compiles a formula; the module header gives the grammar.
    ///
    /// `variables` are the names whose values are given at evaluation, in that order; `constants`
    /// are folded in. A variable hides a constant of the same name, and both hide `pi`. Names are
    /// ASCII letters, digits and `_`, not starting with a digit.
    ///
    /// # Errors
    ///
    /// The first mistake of syntax, an unknown name or function, a wrong number of arguments, or a
    /// source that is too long or nested too deep. A constant part without a finite value, such as
    /// `1/0`, `log(-1)` or `0^0`, is an error too, unless it is the branch that an `if` with a
    /// constant condition does not take.
    ///
    /// ```
    /// use bondwise::expression::Expression;
    ///
    /// let error = Expression::compile("3 + 1/0", &[], &[]).unwrap_err();
    /// assert_eq!((error.start, error.end), (4, 7));
    /// assert!(Expression::compile("if(1 > 2, 1/0, 3)", &[], &[]).is_ok());
    /// ```
    pub fn compile(source: &str, variables: &[&str], constants: &[(String, f64)]) -> Result<Self, ExpressionError> {
        if let Some((cut, _)) = source.char_indices().nth(LONGEST) {
            return Err(error(format!("the expression is longer than {LONGEST} characters"), cut..source.len()));
        }
        let mut parser = Parser {
            source,
            variables,
            constants,
            tokens: tokens(source)?,
            position: 0,
            depth: 0,
            nodes: Vec::new(),
            undefined: Vec::new(),
        };
        let root = parser.whole()?;
        if let Node::Undefined(index) = parser.nodes[root.node] {
            return Err(parser.undefined.swap_remove(index));
        }
        let (tape, result) = emit(&parser.nodes, root.node)
            .ok_or_else(|| error("the expression keeps too many intermediate values".into(), 0..source.len()))?;
        let mut indices: Vec<usize> = tape
            .iter()
            .flat_map(|instruction| instruction.operands)
            .chain([result])
            .filter_map(|operand| match operand {
                Operand::Variable(index) => Some(index),
                _ => None,
            })
            .collect();
        indices.sort_unstable();
        indices.dedup();
        let name = |index: usize| Used { index, name: variables[index].to_string() };
        Ok(Self { source: source.to_string(), tape, result, used: indices.into_iter().map(name).collect() })
    }

    /// The expression that has this value everywhere.
    pub fn constant(value: f64) -> Self {
        Self { source: format!("{value:?}"), tape: Vec::new(), result: Operand::Constant(value), used: Vec::new() }
    }

    /// The value of an expression that uses no variable.
    pub fn as_constant(&self) -> Option<f64> {
        match self.result {
            Operand::Constant(value) => Some(value),
            _ => None,
        }
    }

    /// Whether the value depends on `variable`, after folding: `if(0, x, 1)` does not use `x`.
    pub fn uses(&self, variable: &str) -> bool {
        self.used.iter().any(|used| used.name == variable)
    }

    /// The formula as it was written.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The value at one point; `values[k]` belongs to variable `k` of [`Expression::compile`].
    ///
    /// Where the formula is not defined the value is infinite or NaN, as in IEEE arithmetic; a NaN
    /// has always the bits of [`f64::NAN`].
    ///
    /// # Panics
    ///
    /// If a variable that is used has no value.
    pub fn evaluate(&self, values: &[f64]) -> f64 {
        if let Some(last) = self.used.last() {
            assert!(last.index < values.len(), "no value is given for variable `{}`", last.name);
        }
        let mut registers = [0.0; REGISTERS];
        for instruction in &self.tape {
            let operands = instruction.operands.map(|operand| operand.value(values, &registers));
            registers[instruction.target] = instruction.operation.apply(operands);
        }
        one_nan(self.result.value(values, &registers))
    }

    /// The values at many points, with the same bits as [`Expression::evaluate`] at each.
    ///
    /// `inputs[k]` is the column of variable `k`: as long as `out`, or of length 1 for the same
    /// value everywhere. Columns of variables that are not used may have any length.
    ///
    /// ```
    /// use bondwise::expression::Expression;
    ///
    /// let wave = Expression::compile("x * (1 - t)", &["x", "t"], &[])?;
    /// let mut out = [0.0; 3];
    /// wave.evaluate_batch(&[&[1.0, 2.0, 3.0], &[0.5]], &mut out);
    /// assert_eq!(out, [0.5, 1.0, 1.5]);
    /// # Ok::<(), bondwise::expression::ExpressionError>(())
    /// ```
    ///
    /// # Panics
    ///
    /// If the column of a variable that is used is missing or has another length.
    pub fn evaluate_batch(&self, inputs: &[&[f64]], out: &mut [f64]) {
        for used in &self.used {
            let length = inputs.get(used.index).map(|column| column.len());
            assert!(
                length == Some(1) || length == Some(out.len()),
                "the column of variable `{}` needs {} values or one, it has {length:?}",
                used.name,
                out.len()
            );
        }
        let mut registers = [[0.0; BLOCK]; REGISTERS];
        for (block, out) in out.chunks_mut(BLOCK).enumerate() {
            let (start, count) = (block * BLOCK, out.len());
            for instruction in &self.tape {
                let (before, rest) = registers.split_at_mut(instruction.target);
                let (target, after) = rest.split_at_mut(1);
                let operands = instruction.operands.map(|operand| match operand {
                    Operand::Constant(value) => Lane::Same(value),
                    Operand::Variable(index) => Lane::of_column(inputs[index], start, count),
                    // The target is never one of the operands, see `emit`.
                    Operand::Register(index) if index < before.len() => Lane::Each(&before[index][..count]),
                    Operand::Register(index) => Lane::Each(&after[index - before.len() - 1][..count]),
                });
                instruction.operation.with(Block { target: &mut target[0][..count], operands });
            }
            let result = match self.result {
                Operand::Constant(value) => Lane::Same(value),
                Operand::Variable(index) => Lane::of_column(inputs[index], start, count),
                Operand::Register(index) => Lane::Each(&registers[index][..count]),
            };
            fill(out, result, one_nan);
        }
    }
}

/// Whether a name means something in every formula: a function, `pi`, or a word of logic.
pub fn is_reserved(name: &str) -> bool {
    ["pi", "and", "or", "not"].contains(&name) || FUNCTIONS.iter().any(|function| function.name == name)
}

/// The candidate nearest to a name that is probably misspelled, `None` if all are too far.
///
/// The distance counts letters inserted, dropped, replaced, and neighbours swapped; upper and lower
/// case are the same. Allowed are 1 in words of up to 4 letters, 2 up to 8, then a third of the
/// length; a single letter is never replaced by another. Of equally near candidates the first wins.
///
/// ```
/// use bondwise::expression::nearest;
///
/// assert_eq!(nearest("horzion", ["points", "horizon"]), Some("horizon"));
/// assert_eq!(nearest("colour", ["points", "horizon"]), None);
/// ```
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = |text: &str| text.chars().flat_map(char::to_lowercase).collect::<Vec<char>>();
    let name = lower(name);
    let mut best = None;
    for candidate in candidates {
        let letters = lower(candidate);
        let longest = name.len().max(letters.len());
        let allowed = match longest {
            0 | 1 => 0,
            2..=4 => 1,
            5..=8 => 2,
            length => length / 3,
        };
        if name.len().abs_diff(letters.len()) > allowed {
            continue;
        }
        let distance = edit_distance(&name, &letters);
        if distance <= allowed && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

/// Damerau-Levenshtein distance in its restricted form: no letter is edited twice.
fn edit_distance(a: &[char], b: &[char]) -> usize {
    let mut before_last = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    let mut row = last.clone();
    for i in 1..=a.len() {
        row[0] = i;
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replaced.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before_last[j - 2] + 1);
            }
        }
        std::mem::swap(&mut before_last, &mut last);
        std::mem::swap(&mut last, &mut row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests;
