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

use std::ops::Range;

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

// ---- operations --------------------------------------------------------------------------------

#[derive(Debug, Clone, Copy, PartialEq)]
enum Operation {
    Negate,
    Not,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Square,
    Cube,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Equal,
    NotEqual,
    And,
    Or,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Atan2,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Log,
    Log10,
    Sqrt,
    Abs,
    Sign,
    Floor,
    Ceil,
    Min,
    Max,
    Hypot,
    Step,
    If,
    Clamp,
    Erf,
}

struct Function {
    name: &'static str,
    form: &'static str,
    operation: Operation,
}

const fn function(name: &'static str, form: &'static str, operation: Operation) -> Function {
    Function { name, form, operation }
}

const FUNCTIONS: &[Function] = &[
    function("sin", "sin(x)", Operation::Sin),
    function("cos", "cos(x)", Operation::Cos),
    function("tan", "tan(x)", Operation::Tan),
    function("asin", "asin(x)", Operation::Asin),
    function("acos", "acos(x)", Operation::Acos),
    function("atan", "atan(x)", Operation::Atan),
    function("atan2", "atan2(y, x)", Operation::Atan2),
    function("sinh", "sinh(x)", Operation::Sinh),
    function("cosh", "cosh(x)", Operation::Cosh),
    function("tanh", "tanh(x)", Operation::Tanh),
    function("exp", "exp(x)", Operation::Exp),
    function("log", "log(x)", Operation::Log),
    function("log10", "log10(x)", Operation::Log10),
    function("sqrt", "sqrt(x)", Operation::Sqrt),
    function("abs", "abs(x)", Operation::Abs),
    function("sign", "sign(x)", Operation::Sign),
    function("floor", "floor(x)", Operation::Floor),
    function("ceil", "ceil(x)", Operation::Ceil),
    function("min", "min(a, b)", Operation::Min),
    function("max", "max(a, b)", Operation::Max),
    function("pow", "pow(a, b)", Operation::Power),
    function("hypot", "hypot(a, b)", Operation::Hypot),
    function("step", "step(x)", Operation::Step),
    function("if", "if(condition, then, otherwise)", Operation::If),
    function("clamp", "clamp(x, low, high)", Operation::Clamp),
    function("erf", "erf(x)", Operation::Erf),
];

/// What people write who come from another language, and what to write here.
const ELSEWHERE: &[(&str, &str)] = &[
    ("ln", "log(x)"),
    ("arcsin", "asin(x)"),
    ("arccos", "acos(x)"),
    ("arctan", "atan(x)"),
    ("arctan2", "atan2(y, x)"),
    ("fabs", "abs(x)"),
    ("sgn", "sign(x)"),
    ("heaviside", "step(x)"),
    ("power", "pow(a, b)"),
    ("where", "if(condition, then, otherwise)"),
    ("select", "if(condition, then, otherwise)"),
    ("erfc", "1 - erf(x)"),
    ("e", "exp(1)"),
    ("tau", "2*pi"),
    ("true", "1"),
    ("false", "0"),
];

/// Something to do with the function behind an [`Operation`]: call it once, or along a block.
///
/// One list of functions then serves folding, points and batches, which is why their bits agree.
trait Action {
    type Output;
    fn unary(self, f: impl Fn(f64) -> f64) -> Self::Output;
    fn binary(self, f: impl Fn(f64, f64) -> f64) -> Self::Output;
    fn ternary(self, f: impl Fn(f64, f64, f64) -> f64) -> Self::Output;
}

impl Operation {
    #[inline]
    fn with<A: Action>(self, action: A) -> A::Output {
        match self {
            Self::Negate => action.unary(|x| -x),
            Self::Not => action.unary(|x| f64::from(x == 0.0)),
            Self::Add => action.binary(|a, b| a + b),
            Self::Subtract => action.binary(|a, b| a - b),
            Self::Multiply => action.binary(|a, b| a * b),
            Self::Divide => action.binary(|a, b| a / b),
            Self::Power => action.binary(f64::powf),
            Self::Square => action.unary(|x| x * x),
            Self::Cube => action.unary(|x| x * x * x),
            Self::Less => action.binary(|a, b| f64::from(a < b)),
            Self::LessEqual => action.binary(|a, b| f64::from(a <= b)),
            Self::Greater => action.binary(|a, b| f64::from(a > b)),
            Self::GreaterEqual => action.binary(|a, b| f64::from(a >= b)),
            Self::Equal => action.binary(|a, b| f64::from(a == b)),
            Self::NotEqual => action.binary(|a, b| f64::from(a != b)),
            Self::And => action.binary(|a, b| f64::from(a != 0.0 && b != 0.0)),
            Self::Or => action.binary(|a, b| f64::from(a != 0.0 || b != 0.0)),
            Self::Sin => action.unary(f64::sin),
            Self::Cos => action.unary(f64::cos),
            Self::Tan => action.unary(f64::tan),
            Self::Asin => action.unary(f64::asin),
            Self::Acos => action.unary(f64::acos),
            Self::Atan => action.unary(f64::atan),
            Self::Atan2 => action.binary(f64::atan2),
            Self::Sinh => action.unary(f64::sinh),
            Self::Cosh => action.unary(f64::cosh),
            Self::Tanh => action.unary(f64::tanh),
            Self::Exp => action.unary(f64::exp),
            Self::Log => action.unary(f64::ln),
            Self::Log10 => action.unary(f64::log10),
            Self::Sqrt => action.unary(f64::sqrt),
            Self::Abs => action.unary(f64::abs),
            Self::Sign => action.unary(sign),
            Self::Floor => action.unary(f64::floor),
            Self::Ceil => action.unary(f64::ceil),
            Self::Min => action.binary(smaller),
            Self::Max => action.binary(larger),
            Self::Hypot => action.binary(f64::hypot),
            Self::Step => action.unary(|x| f64::from(x >= 0.0)),
            Self::If => action.ternary(|c, a, b| if c != 0.0 { a } else { b }),
            Self::Clamp => action.ternary(|x, low, high| smaller(larger(x, low), high)),
            Self::Erf => action.unary(erf),
        }
    }

    #[inline]
    fn apply(self, operands: [f64; 3]) -> f64 {
        self.with(Point(operands))
    }

    fn arity(self) -> usize {
        self.with(Arity)
    }
}

struct Arity;

impl Action for Arity {
    type Output = usize;

    fn unary(self, _: impl Fn(f64) -> f64) -> usize {
        1
    }

    fn binary(self, _: impl Fn(f64, f64) -> f64) -> usize {
        2
    }

    fn ternary(self, _: impl Fn(f64, f64, f64) -> f64) -> usize {
        3
    }
}

struct Point([f64; 3]);

impl Action for Point {
    type Output = f64;

    #[inline]
    fn unary(self, f: impl Fn(f64) -> f64) -> f64 {
        f(self.0[0])
    }

    #[inline]
    fn binary(self, f: impl Fn(f64, f64) -> f64) -> f64 {
        f(self.0[0], self.0[1])
    }

    #[inline]
    fn ternary(self, f: impl Fn(f64, f64, f64) -> f64) -> f64 {
        f(self.0[0], self.0[1], self.0[2])
    }
}

struct Block<'a> {
    target: &'a mut [f64],
    operands: [Lane<'a>; 3],
}

/// The values of one operand along a block.
#[derive(Clone, Copy)]
enum Lane<'a> {
    Same(f64),
    Each(&'a [f64]),
}

impl<'a> Lane<'a> {
    fn of_column(column: &'a [f64], start: usize, count: usize) -> Self {
        match column {
            &[value] => Self::Same(value),
            _ => Self::Each(&column[start..start + count]),
        }
    }

    #[inline]
    fn at(self, index: usize) -> f64 {
        match self {
            Self::Same(value) => value,
            Self::Each(values) => values[index],
        }
    }
}

#[inline]
fn fill(target: &mut [f64], lane: Lane, f: impl Fn(f64) -> f64) {
    match lane {
        Lane::Same(value) => target.fill(f(value)),
        Lane::Each(values) => {
            for (target, &value) in target.iter_mut().zip(values) {
                *target = f(value);
            }
        }
    }
}

impl Action for Block<'_> {
    type Output = ();

    #[inline]
    fn unary(self, f: impl Fn(f64) -> f64) {
        fill(self.target, self.operands[0], f);
    }

    #[inline]
    fn binary(self, f: impl Fn(f64, f64) -> f64) {
        match (self.operands[0], self.operands[1]) {
            (Lane::Same(a), b) => fill(self.target, b, |b| f(a, b)),
            (a, Lane::Same(b)) => fill(self.target, a, |a| f(a, b)),
            (Lane::Each(a), Lane::Each(b)) => {
                for ((target, &a), &b) in self.target.iter_mut().zip(a).zip(b) {
                    *target = f(a, b);
                }
            }
        }
    }

    #[inline]
    fn ternary(self, f: impl Fn(f64, f64, f64) -> f64) {
        let [a, b, c] = self.operands;
        for (index, target) in self.target.iter_mut().enumerate() {
            *target = f(a.at(index), b.at(index), c.at(index));
        }
    }
}

/// Minimum that passes NaN on. `f64::min` drops it, and leaves open which zero it returns.
fn smaller(a: f64, b: f64) -> f64 {
    if a < b || a.is_nan() { a } else { b }
}

fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x
    }
}

/// The compiler may swap the operands of a sum, and with them the bits of a NaN.
fn one_nan(value: f64) -> f64 {
    if value.is_nan() { f64::NAN } else { value }
}

/// Error function `2/√π ∫₀ˣ exp(-s²) ds`, with a relative error below 1e-15.
///
/// Below 2 the series `2/√π exp(-x²) Σ 2ⁿ x²ⁿ⁺¹ / (2n+1)!!`, whose terms have one sign
/// (Abramowitz and Stegun, 7.1.6); above, one minus the continued fraction of `erfc` (7.1.14).
fn erf(x: f64) -> f64 {
    let size = x.abs();
    if size < 2.0 {
        // 48 terms leave a remainder below 1e-20 at x = 2.
        let (mut term, mut sum) = (x, x);
        for n in 1..48 {
            term *= 2.0 * x * x / f64::from(2 * n + 1);
            sum += term;
            if term.abs() <= 1e-18 * sum.abs() {
                break;
            }
        }
        std::f64::consts::FRAC_2_SQRT_PI * (-x * x).exp() * sum
    } else if size < 6.0 {
        // 40 levels: the error at x = 2 is below the rounding of 1 - erfc(x).
        let fraction = (1..=40).rev().fold(size, |tail, n| size + 0.5 * f64::from(n) / tail);
        let complement = 0.5 * std::f64::consts::FRAC_2_SQRT_PI * (-x * x).exp() / fraction;
        (1.0 - complement).copysign(x)
    } else if size.is_nan() {
        x
    } else {
        // erfc(6) is 2e-17, less than half a unit in the last place of 1.
        1.0_f64.copysign(x)
    }
}

// ---- tape --------------------------------------------------------------------------------------

#[derive(Debug, Clone)]
struct Used {
    index: usize,
    name: String,
}

#[derive(Debug, Clone, Copy)]
enum Operand {
    Constant(f64),
    Variable(usize),
    Register(usize),
}

impl Operand {
    #[inline]
    fn value(self, values: &[f64], registers: &[f64; REGISTERS]) -> f64 {
        match self {
            Self::Constant(value) => value,
            Self::Variable(index) => values[index],
            Self::Register(index) => registers[index],
        }
    }
}

/// `target = operation(operands)`; operands beyond the arity are constants nobody reads.
#[derive(Debug, Clone, Copy)]
struct Instruction {
    operation: Operation,
    operands: [Operand; 3],
    target: usize,
}

/// A node of the folded formula. Operands stand before the nodes that use them.
#[derive(Clone, Copy)]
enum Node {
    Constant(f64),
    Variable(usize),
    Operation(Operation, [usize; 3]),
    /// Constant without a finite value; the index is into `Parser::undefined`.
    Undefined(usize),
}

/// The tape that computes `root`, and where its value is found; `None` if registers run out.
///
/// Each node computes first the operand that needs most registers, as it then waits for the others
/// in one (Sethi and Ullman 1970). A target is taken before the operands are given back, so that a
/// batch never reads and writes the same register in one instruction.
fn emit(nodes: &[Node], root: usize) -> Option<(Vec<Instruction>, Operand)> {
    let mut needs = vec![0; nodes.len()];
    let heaviest_first = |needs: &[usize], operation: Operation, operands: [usize; 3]| {
        let mut order = operands[..operation.arity()].to_vec();
        order.sort_by_key(|&operand| std::cmp::Reverse(needs[operand]));
        order
    };
    for (index, node) in nodes.iter().enumerate() {
        if let &Node::Operation(operation, operands) = node {
            let mut waiting = 0;
            for operand in heaviest_first(&needs, operation, operands) {
                needs[index] = needs[index].max(needs[operand] + waiting);
                waiting += usize::from(needs[operand] > 0);
            }
            needs[index] = needs[index].max(waiting + 1);
        }
    }

    // Nodes before their operands, last operand first: the reverse of the order of computation.
    let mut backwards = Vec::new();
    let mut open = vec![root];
    while let Some(index) = open.pop() {
        backwards.push(index);
        if let Node::Operation(operation, operands) = nodes[index] {
            open.extend(heaviest_first(&needs, operation, operands));
        }
    }

    let mut places = vec![Operand::Constant(0.0); nodes.len()];
    let mut free = [true; REGISTERS];
    let mut tape = Vec::new();
    for &index in backwards.iter().rev() {
        places[index] = match nodes[index] {
            Node::Constant(value) => Operand::Constant(value),
            Node::Variable(variable) => Operand::Variable(variable),
            Node::Operation(operation, children) => {
                let target = free.iter().position(|&free| free)?;
                free[target] = false;
                let mut operands = [Operand::Constant(0.0); 3];
                for (operand, &child) in operands.iter_mut().zip(&children[..operation.arity()]) {
                    *operand = places[child];
                    if let Operand::Register(register) = *operand {
                        free[register] = true;
                    }
                }
                tape.push(Instruction { operation, operands, target });
                Operand::Register(target)
            }
            // An undefined operand makes its user undefined, up to the root.
            Node::Undefined(_) => unreachable!("an undefined node stands below a defined root"),
        };
    }
    Some((tape, places[root]))
}

// ---- tokens ------------------------------------------------------------------------------------

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Number(f64),
    Name,
    Plus,
    Minus,
    Times,
    Divide,
    Power,
    Compare(Operation),
    And,
    Or,
    Not,
    Open,
    Close,
    Comma,
    End,
}

#[derive(Debug, Clone, Copy)]
struct Token {
    kind: Kind,
    start: usize,
    end: usize,
}

/// Longer symbols stand before those they begin with.
const SYMBOLS: &[(&str, Kind)] = &[
    ("<=", Kind::Compare(Operation::LessEqual)),
    (">=", Kind::Compare(Operation::GreaterEqual)),
    ("==", Kind::Compare(Operation::Equal)),
    ("!=", Kind::Compare(Operation::NotEqual)),
    ("&&", Kind::And),
    ("||", Kind::Or),
    ("<", Kind::Compare(Operation::Less)),
    (">", Kind::Compare(Operation::Greater)),
    ("!", Kind::Not),
    ("+", Kind::Plus),
    ("-", Kind::Minus),
    ("*", Kind::Times),
    ("/", Kind::Divide),
    ("^", Kind::Power),
    ("(", Kind::Open),
    (")", Kind::Close),
    (",", Kind::Comma),
];

/// Characters that are not of the language, and what is probably meant.
const LOOKALIKES: &[(char, &str)] = &[
    ('=', "=="),
    ('&', "and"),
    ('|', "or"),
    ('?', "if(condition, then, otherwise)"),
    ('[', "("),
    (']', ")"),
    ('{', "("),
    ('}', ")"),
    ('×', "*"),
    ('·', "*"),
    ('÷', "/"),
    ('−', "-"),
    ('–', "-"),
    ('²', "^2"),
    ('³', "^3"),
    ('√', "sqrt(x)"),
    ('π', "pi"),
    ('≤', "<="),
    ('≥', ">="),
    ('≠', "!="),
];

fn tokens(source: &str) -> Result<Vec<Token>, ExpressionError> {
    let bytes = source.as_bytes();
    let run =
        |from: usize, belongs: fn(&u8) -> bool| from + bytes[from..].iter().take_while(|byte| belongs(byte)).count();
    let mut tokens = Vec::new();
    let mut start = 0;
    while let Some(first) = source[start..].chars().next() {
        let rest = &source[start..];
        let (kind, end) = if first.is_ascii_whitespace() {
            start += 1;
            continue;
        } else if first.is_ascii_alphabetic() || first == '_' {
            let end = run(start, |byte| byte.is_ascii_alphanumeric() || *byte == b'_');
            match &source[start..end] {
                "and" => (Kind::And, end),
                "or" => (Kind::Or, end),
                "not" => (Kind::Not, end),
                _ => (Kind::Name, end),
            }
        } else if number_starts(rest) {
            let mut end = run(start, u8::is_ascii_digit);
            if bytes.get(end) == Some(&b'.') {
                end = run(end + 1, u8::is_ascii_digit);
            }
            if matches!(bytes.get(end), Some(b'e' | b'E')) {
                let signed = matches!(bytes.get(end + 1), Some(b'+' | b'-'));
                let digits = end + 1 + usize::from(signed);
                if bytes.get(digits).is_some_and(u8::is_ascii_digit) {
                    end = run(digits, u8::is_ascii_digit);
                }
            }
            (Kind::Number(number(source, start, end)?), end)
        } else if let Some(&(text, kind)) = SYMBOLS.iter().find(|(text, _)| rest.starts_with(text)) {
            (kind, start + text.len())
        } else {
            let range = start..start + first.len_utf8();
            let shown = if first.is_control() { first.escape_debug().to_string() } else { first.to_string() };
            let found = error(format!("unexpected character `{shown}`"), range);
            let meant = LOOKALIKES.iter().find(|(character, _)| *character == first);
            return Err(match meant {
                Some((_, meant)) => found.with_help(format!("write `{meant}`")),
                None => found,
            });
        };
        tokens.push(Token { kind, start, end });
        start = end;
    }
    tokens.push(Token { kind: Kind::End, start, end: start });
    Ok(tokens)
}

fn number_starts(rest: &str) -> bool {
    let digits = rest.strip_prefix('.').unwrap_or(rest);
    digits.starts_with(|first: char| first.is_ascii_digit())
}

fn number(source: &str, start: usize, end: usize) -> Result<f64, ExpressionError> {
    let text = &source[start..end];
    let tail = source[end..].bytes().take_while(|byte| byte.is_ascii_digit() || matches!(byte, b'.' | b'_')).count();
    match text.parse::<f64>() {
        Ok(value) if tail == 0 && value.is_finite() => Ok(value),
        Ok(_) if tail == 0 => Err(error(format!("the number {} is too large", quote(text)), start..end)),
        _ => {
            let range = start..end + tail;
            let text = quote(&source[range.clone()]);
            Err(error(format!("{text} is not a number"), range)
                .with_help("numbers look like `12`, `2.5` or `1e-3`".into()))
        }
    }
}

// ---- parser ------------------------------------------------------------------------------------

/// A parsed part of the source, parentheses included in its range.
#[derive(Clone, Copy)]
struct Part {
    node: usize,
    start: usize,
    end: usize,
}

struct Parser<'a> {
    source: &'a str,
    variables: &'a [&'a str],
    constants: &'a [(String, f64)],
    tokens: Vec<Token>,
    position: usize,
    depth: usize,
    nodes: Vec<Node>,
    /// Parts without a finite value. They are errors only if the value of the formula needs them.
    undefined: Vec<ExpressionError>,
}

impl Parser<'_> {
    fn whole(&mut self) -> Result<Part, ExpressionError> {
        if self.peek().kind == Kind::End {
            return Err(error("the expression is empty".into(), 0..self.source.len()));
        }
        let part = self.or()?;
        match self.peek().kind {
            Kind::End => Ok(part),
            _ => Err(self.operator_missing()),
        }
    }

    fn or(&mut self) -> Result<Part, ExpressionError> {
        let mut left = self.and()?;
        while self.take(Kind::Or).is_some() {
            let right = self.and()?;
            left = self.binary(Operation::Or, left, right);
        }
        Ok(left)
    }

    fn and(&mut self) -> Result<Part, ExpressionError> {
        let mut left = self.not()?;
        while self.take(Kind::And).is_some() {
            let right = self.not()?;
            left = self.binary(Operation::And, left, right);
        }
        Ok(left)
    }

    fn not(&mut self) -> Result<Part, ExpressionError> {
        let Some(not) = self.take(Kind::Not) else {
            return self.comparison();
        };
        let part = self.nested(not, Self::not)?;
        Ok(self.operation(Operation::Not, &[part], not.start..part.end))
    }

    fn comparison(&mut self) -> Result<Part, ExpressionError> {
        let left = self.sum()?;
        let Kind::Compare(operation) = self.peek().kind else {
            return Ok(left);
        };
        self.position += 1;
        let right = self.sum()?;
        let next = self.peek();
        if let Kind::Compare(_) = next.kind {
            let range = left.start..next.end;
            return Err(
                error("comparisons cannot be chained".into(), range).with_help("write `a < b and b < c`".into())
            );
        }
        Ok(self.binary(operation, left, right))
    }

    fn sum(&mut self) -> Result<Part, ExpressionError> {
        let mut left = self.product()?;
        loop {
            let operation = match self.peek().kind {
                Kind::Plus => Operation::Add,
                Kind::Minus => Operation::Subtract,
                _ => return Ok(left),
            };
            self.position += 1;
            let right = self.product()?;
            left = self.binary(operation, left, right);
        }
    }

    fn product(&mut self) -> Result<Part, ExpressionError> {
        let mut left = self.sign()?;
        loop {
            let operation = match self.peek().kind {
                Kind::Times => Operation::Multiply,
                Kind::Divide => Operation::Divide,
                _ => return Ok(left),
            };
            self.position += 1;
            let right = self.sign()?;
            left = self.binary(operation, left, right);
        }
    }

    fn sign(&mut self) -> Result<Part, ExpressionError> {
        if let Some(minus) = self.take(Kind::Minus) {
            let part = self.nested(minus, Self::sign)?;
            Ok(self.operation(Operation::Negate, &[part], minus.start..part.end))
        } else if let Some(plus) = self.take(Kind::Plus) {
            let part = self.nested(plus, Self::sign)?;
            Ok(Part { start: plus.start, ..part })
        } else {
            self.power()
        }
    }

    fn power(&mut self) -> Result<Part, ExpressionError> {
        let base = self.value()?;
        let Some(power) = self.take(Kind::Power) else {
            return Ok(base);
        };
        let exponent = self.nested(power, Self::sign)?;
        Ok(self.binary(Operation::Power, base, exponent))
    }

    fn value(&mut self) -> Result<Part, ExpressionError> {
        let token = self.peek();
        let node = match token.kind {
            Kind::Number(value) => Node::Constant(value),
            Kind::Name if self.tokens[self.position + 1].kind == Kind::Open => {
                return self.call(token);
            }
            Kind::Name => self.name(token)?,
            Kind::Open => {
                self.position += 1;
                if self.peek().kind == Kind::End {
                    return Err(never_closed(token));
                }
                let inner = self.nested(token, Self::or)?;
                let close = self.close(token)?;
                return Ok(Part { start: token.start, end: close.end, ..inner });
            }
            _ => return Err(self.value_missing()),
        };
        self.position += 1;
        Ok(self.push(node, token.start..token.end))
    }

    fn call(&mut self, name: Token) -> Result<Part, ExpressionError> {
        let text = self.text(name);
        let Some(function) = FUNCTIONS.iter().find(|function| function.name == text) else {
            return Err(self.unknown_function(name));
        };
        let open = self.tokens[self.position + 1];
        self.position += 2;
        let mut arguments = Vec::new();
        if self.peek().kind != Kind::Close {
            if self.peek().kind == Kind::End {
                return Err(never_closed(open));
            }
            arguments.push(self.nested(open, Self::or)?);
            while self.take(Kind::Comma).is_some() {
                arguments.push(self.nested(open, Self::or)?);
            }
        }
        let close = self.close(open)?;
        let range = name.start..close.end;
        let (expected, given) = (function.operation.arity(), arguments.len());
        if given != expected {
            let plural = if expected == 1 { "" } else { "s" };
            let message = format!("`{}` takes {expected} argument{plural}, {given} given", function.name);
            return Err(error(message, range).with_help(format!("write `{}`", function.form)));
        }
        Ok(self.operation(function.operation, &arguments, range))
    }

    fn name(&mut self, token: Token) -> Result<Node, ExpressionError> {
        let text = self.text(token);
        if let Some(index) = self.variables.iter().position(|&variable| variable == text) {
            return Ok(Node::Variable(index));
        }
        if let Some(&(_, value)) = self.constants.iter().find(|(name, _)| name == text) {
            if value.is_finite() {
                return Ok(Node::Constant(value));
            }
            let message = format!("the constant {} has no finite value", quote(text));
            let undefined = error(message, token.start..token.end);
            return Ok(self.undefined(undefined));
        }
        if text == "pi" {
            return Ok(Node::Constant(std::f64::consts::PI));
        }
        Err(self.unknown_name(token))
    }

    fn binary(&mut self, operation: Operation, left: Part, right: Part) -> Part {
        self.operation(operation, &[left, right], left.start..right.end)
    }

    /// Adds an operation, or what it folds to.
    fn operation(&mut self, operation: Operation, parts: &[Part], range: Range<usize>) -> Part {
        let node = |part: &Part| self.nodes[part.node];
        if operation == Operation::If
            && let Node::Constant(condition) = node(&parts[0])
        {
            let taken = if condition != 0.0 { parts[1] } else { parts[2] };
            return Part { node: taken.node, start: range.start, end: range.end };
        }
        let undefined = |part: &Part| matches!(node(part), Node::Undefined(_));
        if let Some(part) = parts.iter().find(|part| undefined(part)) {
            return Part { node: part.node, start: range.start, end: range.end };
        }

        let mut children = [0; 3];
        let mut values = [0.0; 3];
        let mut constants = 0;
        for (index, part) in parts.iter().enumerate() {
            children[index] = part.node;
            if let Node::Constant(value) = node(part) {
                values[index] = value;
                constants += 1;
            }
        }
        let folded = if constants == parts.len() {
            let value = operation.apply(values);
            let zero_to_zero = operation == Operation::Power && values[..2] == [0.0, 0.0];
            if value.is_finite() && !zero_to_zero {
                Node::Constant(value)
            } else {
                let text = quote(&self.source[range.clone()]);
                let error = no_finite_value(operation, values, &text, range.clone());
                self.undefined(error)
            }
        } else {
            match (operation, parts.get(1).map(node)) {
                (Operation::Power, Some(Node::Constant(2.0))) => Node::Operation(Operation::Square, children),
                (Operation::Power, Some(Node::Constant(3.0))) => Node::Operation(Operation::Cube, children),
                _ => Node::Operation(operation, children),
            }
        };
        self.push(folded, range)
    }

    fn undefined(&mut self, error: ExpressionError) -> Node {
        self.undefined.push(error);
        Node::Undefined(self.undefined.len() - 1)
    }

    fn push(&mut self, node: Node, range: Range<usize>) -> Part {
        self.nodes.push(node);
        Part { node: self.nodes.len() - 1, start: range.start, end: range.end }
    }

    fn peek(&self) -> Token {
        self.tokens[self.position]
    }

    fn take(&mut self, kind: Kind) -> Option<Token> {
        let token = self.peek();
        (token.kind == kind).then(|| {
            self.position += 1;
            token
        })
    }

    fn text(&self, token: Token) -> &str {
        &self.source[token.start..token.end]
    }

    /// Every recursion of the grammar passes here, so that none outgrows the stack.
    fn nested(
        &mut self,
        cause: Token,
        rule: fn(&mut Self) -> Result<Part, ExpressionError>,
    ) -> Result<Part, ExpressionError> {
        if self.depth == DEEPEST {
            let message = format!("the expression is nested deeper than {DEEPEST}");
            return Err(error(message, cause.start..cause.end));
        }
        self.depth += 1;
        let part = rule(self)?;
        self.depth -= 1;
        Ok(part)
    }

    fn close(&mut self, open: Token) -> Result<Token, ExpressionError> {
        match self.peek().kind {
            Kind::End => Err(never_closed(open)),
            _ => self.take(Kind::Close).ok_or_else(|| self.operator_missing()),
        }
    }

    /// A value is complete, and what follows can neither continue it nor end it.
    fn operator_missing(&self) -> ExpressionError {
        let (left, right) = (self.tokens[self.position - 1], self.peek());
        match right.kind {
            Kind::Close => error("`)` has no matching `(`".into(), right.start..right.end),
            Kind::Comma => {
                let message = "`,` outside the arguments of a function";
                error(message.into(), right.start..right.end)
                    .with_help("decimals are written with a point, `1.5`".into())
            }
            Kind::Name => match self.misspelled_logic(self.text(right)) {
                Some(meant) => {
                    let message = format!("{} is not an operator", quote(self.text(right)));
                    error(message, right.start..right.end).with_help(format!("did you mean `{meant}`?"))
                }
                None => self.product_missing(left, right),
            },
            _ => self.product_missing(left, right),
        }
    }

    /// `adn` for `and`; one letter alone, as in `2 r`, is rather a factor.
    fn misspelled_logic(&self, text: &str) -> Option<&'static str> {
        let function = FUNCTIONS.iter().any(|function| function.name == text);
        if text.len() < 2 || function || self.is_value(text) {
            return None;
        }
        nearest(text, ["and", "or"])
    }

    fn is_value(&self, text: &str) -> bool {
        text == "pi" || self.variables.contains(&text) || self.constants.iter().any(|(name, _)| name == text)
    }

    fn product_missing(&self, left: Token, right: Token) -> ExpressionError {
        let message =
            format!("an operator is missing between {} and {}", quote(self.text(left)), quote(self.text(right)));
        let before = if left.kind == Kind::Close { "(...)" } else { self.text(left) };
        let after = match right.kind {
            Kind::Open => "(...)".to_string(),
            Kind::Name if self.tokens[self.position + 1].kind == Kind::Open => {
                format!("{}(...)", self.text(right))
            }
            _ => self.text(right).to_string(),
        };
        error(message, left.start..right.end).with_help(format!("write {}", quote(&format!("{before}*{after}"))))
    }

    /// An operator, `)`, `,` or the end stands where a value should.
    fn value_missing(&self) -> ExpressionError {
        let next = self.peek();
        let name = quote(self.text(next));
        let before = self.position.checked_sub(1).map(|position| self.tokens[position]);
        match (before, next.kind) {
            (_, Kind::Not) => error(format!("{name} needs parentheses here"), next.start..next.end)
                .with_help("write `(not ...)`".into()),
            (None, Kind::Close) => error("`)` has no matching `(`".into(), next.start..next.end),
            (None, _) => error(format!("a value is missing before {name}"), next.start..next.end),
            (Some(before), Kind::End) => {
                error(format!("a value is missing after {}", quote(self.text(before))), before.start..before.end)
            }
            (Some(Token { kind: Kind::Open, start, .. }), Kind::Close) => {
                error("the parentheses are empty".into(), start..next.end)
            }
            (Some(before), kind) => {
                let message = format!("a value is missing between {} and {name}", quote(self.text(before)));
                let error = error(message, before.start..next.end);
                if before.kind == Kind::Times && kind == Kind::Times {
                    error.with_help("a power is written `x^2`".into())
                } else {
                    error
                }
            }
        }
    }

    fn unknown_name(&self, token: Token) -> ExpressionError {
        let (text, range) = (self.text(token), token.start..token.end);
        if let Some(function) = FUNCTIONS.iter().find(|function| function.name == text) {
            let message = format!("the function `{text}` needs its arguments in parentheses");
            return error(message, range).with_help(format!("write `{}`", function.form));
        }
        let names = || {
            let constants = self.constants.iter().map(|(name, _)| name.as_str());
            self.variables.iter().copied().chain(constants).chain(["pi"])
        };
        // A case may define hundreds of constants; the message stays readable.
        let shown: Vec<&str> = names().take(20).collect();
        let more = if names().nth(20).is_some() { ", ..." } else { "" };
        let accepted = format!("names accepted: {}{more}", shown.join(", "));
        let help = match (nearest(text, names()), elsewhere(text)) {
            (Some(name), _) => format!("did you mean `{name}`? {accepted}"),
            (None, Some(form)) => format!("write `{form}`; {accepted}"),
            (None, None) => accepted,
        };
        error(format!("unknown name {}", quote(text)), range).with_help(help)
    }

    fn unknown_function(&self, token: Token) -> ExpressionError {
        let (text, range) = (self.text(token), token.start..token.end);
        if self.is_value(text) {
            return self.product_missing(token, self.tokens[self.position + 1]);
        }
        let names = FUNCTIONS.iter().map(|function| function.name);
        let help = match (elsewhere(text), nearest(text, names.clone())) {
            (Some(form), _) => format!("write `{form}`"),
            (None, Some(name)) => format!("did you mean `{name}`?"),
            (None, None) => {
                format!("functions accepted: {}", names.collect::<Vec<_>>().join(", "))
            }
        };
        error(format!("unknown function {}", quote(text)), range).with_help(help)
    }
}

fn elsewhere(name: &str) -> Option<&'static str> {
    ELSEWHERE.iter().find(|(other, _)| *other == name).map(|&(_, form)| form)
}

fn never_closed(open: Token) -> ExpressionError {
    error("`(` is never closed".into(), open.start..open.end)
}

fn no_finite_value(operation: Operation, [a, b, _]: [f64; 3], text: &str, range: Range<usize>) -> ExpressionError {
    let help = match operation {
        Operation::Power if a == 0.0 && b == 0.0 => {
            return error(format!("{text}: 0^0 is not defined"), range);
        }
        Operation::Power if a == 0.0 => "zero to a negative power divides by zero".into(),
        Operation::Power if a < 0.0 && b.fract() != 0.0 => {
            format!("the base {a} is negative and the exponent {b} is not an integer")
        }
        Operation::Divide if b == 0.0 => "the divisor is zero".into(),
        Operation::Log | Operation::Log10 if a <= 0.0 => {
            format!("a logarithm needs a positive argument, this one is {a}")
        }
        Operation::Sqrt => {
            format!("a square root needs an argument of at least 0, this one is {a}")
        }
        Operation::Asin | Operation::Acos => {
            format!("the argument must be between -1 and 1, it is {a}")
        }
        _ => "the value is too large".into(),
    };
    error(format!("{text} has no finite value"), range).with_help(help)
}

fn error(message: String, range: Range<usize>) -> ExpressionError {
    ExpressionError { message, start: range.start, end: range.end, help: None }
}

impl ExpressionError {
    fn with_help(self, help: String) -> Self {
        Self { help: Some(help), ..self }
    }
}

/// A piece of the source on one line of a message, shortened.
fn quote(text: &str) -> String {
    let mut words = text.split_ascii_whitespace().collect::<Vec<_>>().join(" ");
    if let Some((cut, _)) = words.char_indices().nth(40) {
        words.truncate(cut);
        words.push_str("...");
    }
    format!("`{words}`")
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: &[&str] = &["x", "y", "z", "t"];
    const AT: [f64; 4] = [0.7, -1.3, 2.25, 0.01];

    fn value(source: &str) -> f64 {
        Expression::compile(source, NAMES, &[("width".to_string(), 4.0)])
            .unwrap_or_else(|error| panic!("{source}: {error:?}"))
            .evaluate(&AT)
    }

    fn failure(source: &str) -> ExpressionError {
        let error = Expression::compile(source, NAMES, &[]).expect_err(source);
        assert!(error.start <= error.end && error.end <= source.len(), "{error:?}");
        assert!(source.is_char_boundary(error.start) && source.is_char_boundary(error.end));
        error
    }

    /// Xorshift: enough for test inputs, and the same on every run.
    fn random(state: &mut u64) -> u64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        *state
    }

    #[test]
    fn each_function_has_the_value_of_the_standard_library() {
        let [x, y, z, _] = AT;
        for (source, expected) in [
            ("sin(x)", x.sin()),
            ("cos(x)", x.cos()),
            ("tan(x)", x.tan()),
            ("asin(x)", x.asin()),
            ("acos(x)", x.acos()),
            ("atan(x)", x.atan()),
            ("atan2(y, x)", y.atan2(x)),
            ("sinh(x)", x.sinh()),
            ("cosh(x)", x.cosh()),
            ("tanh(x)", x.tanh()),
            ("exp(x)", x.exp()),
            ("log(x)", x.ln()),
            ("log10(x)", x.log10()),
            ("sqrt(x)", x.sqrt()),
            ("abs(y)", 1.3),
            ("sign(y)", -1.0),
            ("sign(0*x)", 0.0),
            ("floor(y)", -2.0),
            ("ceil(y)", -1.0),
            ("min(x, y)", y),
            ("max(x, y)", x),
            ("pow(x, y)", x.powf(y)),
            ("hypot(x, y)", x.hypot(y)),
            ("step(x)", 1.0),
            ("step(y)", 0.0),
            ("step(0*x)", 1.0),
            ("if(x, y, z)", y),
            ("if(x < y, y, z)", z),
            ("clamp(y, 0, 1)", 0.0),
            ("clamp(x, 0, 1)", x),
            ("clamp(z, 0, 1)", 1.0),
            ("erf(x)", erf(x)),
            ("pi*x", std::f64::consts::PI * x),
        ] {
            assert_eq!(value(source).to_bits(), expected.to_bits(), "{source}");
        }
        for function in FUNCTIONS {
            assert!(function.form.starts_with(function.name));
        }
    }

    #[test]
    fn operators_bind_as_the_grammar_says() {
        let [x, y, z, t] = AT;
        for (source, expected) in [
            ("-2^2", -4.0),
            ("-x^2", -(x * x)),
            ("2^3^2", 512.0),
            ("2^-1", 0.5),
            ("2^-x^2", 2.0_f64.powf(-(x * x))),
            ("x^3", x * x * x),
            ("8/4/2", 1.0),
            ("8-4-2", 2.0),
            ("1+2*3", 7.0),
            ("(1+2)*3", 9.0),
            ("2*-3", -6.0),
            ("- - 2", 2.0),
            ("+x", x),
            ("1 - -1", 2.0),
            ("1 < 2", 1.0),
            ("1 >= 2", 0.0),
            ("1 + 1 == 2", 1.0),
            ("1 != 1", 0.0),
            ("x <= y", 0.0),
            ("x > y", 1.0),
            ("1 or 0 and 0", 1.0),
            ("(1 || 0) && 0", 0.0),
            ("not 1 > 2", 1.0),
            ("!1 > 2", 1.0),
            ("not not 3", 1.0),
            ("not 0 and 0", 0.0),
            ("2 and 3", 1.0),
            ("x > 0 and y > 0 or z > 0", 1.0),
            (".5 + 1. + 1e-3 + 2.5E+1", 0.5 + 1.0 + 1e-3 + 25.0),
            ("width*t", 4.0 * t),
            ("x\n+\ty", x + y),
            ("x + y*z", x + y * z),
        ] {
            assert_eq!(value(source).to_bits(), expected.to_bits(), "{source}");
        }
    }

    #[test]
    fn erf_agrees_with_known_values() {
        // Computed with mpmath at 30 digits.
        for (x, expected) in [
            (1e-10, 1.128_379_167_095_512_6e-10),
            (0.1, 0.112_462_916_018_284_9),
            (0.5, 0.520_499_877_813_046_5),
            (1.0, 0.842_700_792_949_714_9),
            (1.5, 0.966_105_146_475_310_7),
            (1.9999, 0.995_320_197_907_029_4),
            (2.0, 0.995_322_265_018_952_7),
            (2.5, 0.999_593_047_982_555),
            (3.0, 0.999_977_909_503_001_4),
            (4.0, 0.999_999_984_582_742_1),
            (5.0, 0.999_999_999_998_462_5),
            (6.0, 1.0),
            (f64::INFINITY, 1.0),
        ] {
            // A few roundings: the sum, the exponential of a rounded square, two products. The largest
            // error found over 16 000 arguments against 30 digits is 8.7e-16.
            assert!((erf(x) - expected).abs() <= 1e-15 * expected, "{x}: {:e}", erf(x));
            assert_eq!(erf(-x), -erf(x));
        }
        assert!(erf(f64::NAN).is_nan());
        assert!(erf(-0.0).is_sign_negative());
    }

    #[test]
    fn each_mistake_is_named_with_its_place_and_a_remedy() {
        for (source, message, range, help) in [
            ("", "the expression is empty", 0..0, None),
            (" \n ", "the expression is empty", 0..3, None),
            ("2x", "an operator is missing between `2` and `x`", 0..2, Some("write `2*x`")),
            ("1 + 2 r", "an operator is missing between `2` and `r`", 4..7, Some("write `2*r`")),
            ("2sin(x)", "an operator is missing between `2` and `sin`", 0..4, Some("write `2*sin(...)`")),
            ("x(1)", "an operator is missing between `x` and `(`", 0..2, Some("write `x*(...)`")),
            ("(x)(y)", "an operator is missing between `)` and `(`", 2..4, Some("write `(...)*(...)`")),
            ("x adn y", "`adn` is not an operator", 2..5, Some("did you mean `and`?")),
            ("(x", "`(` is never closed", 0..1, None),
            ("1 + sin(x", "`(` is never closed", 7..8, None),
            ("(", "`(` is never closed", 0..1, None),
            ("x)", "`)` has no matching `(`", 1..2, None),
            (")", "`)` has no matching `(`", 0..1, None),
            ("()", "the parentheses are empty", 0..2, None),
            ("x +", "a value is missing after `+`", 2..3, None),
            ("* x", "a value is missing before `*`", 0..1, None),
            ("x / / y", "a value is missing between `/` and `/`", 2..5, None),
            ("x**2", "a value is missing between `*` and `*`", 1..3, Some("a power is written `x^2`")),
            ("sin(x,)", "a value is missing between `,` and `)`", 5..7, None),
            ("2 * not x", "`not` needs parentheses here", 4..7, Some("write `(not ...)`")),
            ("0 < x < 1", "comparisons cannot be chained", 0..7, Some("write `a < b and b < c`")),
            ("1,5", "`,` outside the arguments of a function", 1..2, Some("decimals are written with a point, `1.5`")),
            ("atan2(x)", "`atan2` takes 2 arguments, 1 given", 0..8, Some("write `atan2(y, x)`")),
            ("1+sin()", "`sin` takes 1 argument, 0 given", 2..7, Some("write `sin(x)`")),
            ("min(x, y, z)", "`min` takes 2 arguments, 3 given", 0..12, Some("write `min(a, b)`")),
            ("sqr(x)", "unknown function `sqr`", 0..3, Some("did you mean `sqrt`?")),
            ("ln(x)", "unknown function `ln`", 0..2, Some("write `log(x)`")),
            ("1 + sin", "the function `sin` needs its arguments in parentheses", 4..7, Some("write `sin(x)`")),
            ("2*X", "unknown name `X`", 2..3, Some("did you mean `x`? names accepted: x, y, z, t, pi")),
            ("q", "unknown name `q`", 0..1, Some("names accepted: x, y, z, t, pi")),
            ("e^x", "unknown name `e`", 0..1, Some("write `exp(1)`; names accepted: x, y, z, t, pi")),
            ("1.2.3", "`1.2.3` is not a number", 0..5, Some("numbers look like `12`, `2.5` or `1e-3`")),
            ("1_000", "`1_000` is not a number", 0..5, Some("numbers look like `12`, `2.5` or `1e-3`")),
            ("x + 1e999", "the number `1e999` is too large", 4..9, None),
            ("x = 1", "unexpected character `=`", 2..3, Some("write `==`")),
            ("x # y", "unexpected character `#`", 2..3, None),
            ("`ls`", "unexpected character ```", 0..1, None),
            ("system(\"rm\")", "unexpected character `\"`", 7..8, None),
            ("x; y", "unexpected character `;`", 1..2, None),
            ("x.y", "unexpected character `.`", 1..2, None),
            ("2×x", "unexpected character `×`", 1..3, Some("write `*`")),
            ("x\0", "unexpected character `\\0`", 1..2, None),
        ] {
            let error = failure(source);
            assert_eq!(error.message, message, "{source}");
            assert_eq!(error.start..error.end, range, "{source}");
            assert_eq!(error.help.as_deref(), help, "{source}");
            assert_eq!(error.to_string(), error.message);
        }
        let help = failure("zzzzzz(x)").help.unwrap_or_default();
        assert!(FUNCTIONS.iter().all(|function| help.contains(function.name)), "{help}");
    }

    #[test]
    fn a_constant_part_without_a_value_is_named() {
        for (source, part, range) in [
            ("1/0", "`1/0` has no finite value", 0..3),
            ("x + 1 / (2-2)", "`1 / (2-2)` has no finite value", 4..13),
            ("x * sin(3 + log(-1))", "`log(-1)` has no finite value", 12..19),
            ("sqrt(-2)*x", "`sqrt(-2)` has no finite value", 0..8),
            ("x + 0^0", "`0^0`: 0^0 is not defined", 4..7),
            ("pow(0, 0)", "`pow(0, 0)`: 0^0 is not defined", 0..9),
            ("0^-1", "`0^-1` has no finite value", 0..4),
            ("(-8)^(1/3)", "`(-8)^(1/3)` has no finite value", 0..10),
            ("asin(2)", "`asin(2)` has no finite value", 0..7),
            ("1e308*10", "`1e308*10` has no finite value", 0..8),
            ("if(x > 0, 1/0, 2)", "`1/0` has no finite value", 10..13),
            ("if(1/0, 1, 2)", "`1/0` has no finite value", 3..6),
            ("if(1, 1/0, 2) + 1", "`1/0` has no finite value", 6..9),
        ] {
            let error = failure(source);
            assert_eq!((error.message.as_str(), error.start..error.end), (part, range), "{source}");
        }
        let constants = [("k".to_string(), f64::INFINITY)];
        let error = Expression::compile("2*k", &[], &constants).unwrap_err();
        assert_eq!(error.message, "the constant `k` has no finite value");
        assert_eq!((error.start, error.end), (2, 3));
    }

    #[test]
    fn a_branch_that_is_not_taken_raises_nothing() {
        for (source, expected) in [
            ("if(0, 1/0, 2)", 2.0),
            ("if(1 > 2, log(-1) + x, 3)", 3.0),
            ("if(width == 4, x, 1/(width - 4))", AT[0]),
            ("if(0*x, 1/(0*x), 5)", 5.0),
        ] {
            assert_eq!(value(source), expected, "{source}");
        }
    }

    #[test]
    fn folding_tells_constants_and_the_variables_used() {
        let constants = [("width".to_string(), 4.0), ("x".to_string(), 9.0)];
        let compile = |source| Expression::compile(source, NAMES, &constants).unwrap();
        assert_eq!(compile("2*pi*width^0.5").as_constant(), Some(4.0 * std::f64::consts::PI));
        assert_eq!(compile("if(0, x, 1)").as_constant(), Some(1.0));
        assert_eq!(compile("0*x").as_constant(), None);
        let formula = compile("if(1, y, z) + x");
        assert_eq!(NAMES.iter().map(|name| formula.uses(name)).collect::<Vec<_>>(), [true, true, false, false]);
        assert!(!formula.uses("width"));
        assert_eq!(formula.source(), "if(1, y, z) + x");
        assert_eq!(formula.evaluate(&[1.0, 2.0]), 3.0);

        let constant = Expression::constant(-2.5);
        assert_eq!((constant.as_constant(), constant.source()), (Some(-2.5), "-2.5"));
        assert_eq!(constant.evaluate(&[]), -2.5);
        let mut out = [0.0; 600];
        constant.evaluate_batch(&[], &mut out);
        assert!(out.iter().all(|&value| value == -2.5));
    }

    #[test]
    fn a_batch_has_the_bits_of_its_points() {
        let mut sources: Vec<String> = FUNCTIONS
            .iter()
            .map(|function| match function.operation.arity() {
                1 => format!("{0}(x) + 2*{0}(y - t)", function.name),
                2 => format!("{0}(x, y) - {0}(2, z)*{0}(x*y, 0.5) + {0}(t, x)", function.name),
                _ => format!("{0}(x, y, z) + {0}(x*y, t, 1) + {0}(t, -1, y + z)", function.name),
            })
            .collect();
        for source in [
            "x",
            "t",
            "3",
            "-x",
            "x^2 + y^3 - z^t",
            "x/y",
            "x < y",
            "x <= t and not y == z",
            "x >= y or z != t",
            "x > y",
            "t*t",
            "(x+y)*(z-t)/((x-y)*(z+t))",
        ] {
            sources.push(source.to_string());
        }
        let special = [0.0, -0.0, 1.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, -f64::NAN, 5e-324];
        let mut state = 0x9e37_79b9_7f4a_7c15;
        let mut column = |count: usize| -> Vec<f64> {
            (0..count)
                .map(|_| match random(&mut state) {
                    bits if bits % 5 == 0 => special[(bits >> 32) as usize % special.len()],
                    bits => (bits >> 11) as f64 / (1_u64 << 51) as f64 - 2.0,
                })
                .collect()
        };
        for count in [0, 1, 2, 255, 256, 257, 1000] {
            let (x, y, z, t) = (column(count), column(count), column(count), column(1));
            for source in &sources {
                let formula = Expression::compile(source, NAMES, &[]).unwrap();
                let mut out = vec![0.0; count];
                formula.evaluate_batch(&[&x, &y, &z, &t], &mut out);
                for index in 0..count {
                    let point = formula.evaluate(&[x[index], y[index], z[index], t[0]]);
                    assert_eq!(out[index].to_bits(), point.to_bits(), "{source} at {index}");
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "the column of variable `y` needs 3 values or one")]
    fn a_column_of_another_length_is_refused() {
        let formula = Expression::compile("x + y", NAMES, &[]).unwrap();
        formula.evaluate_batch(&[&[1.0; 3], &[1.0; 2]], &mut [0.0; 3]);
    }

    #[test]
    fn hostile_input_is_refused_at_once() {
        for piece in ["(", "-", "!", "not ", "2^", "sin(", "if(1,", "x+", "[", "é", "\0", "("] {
            let error = failure(&piece.repeat(200_000));
            assert_eq!(error.message, "the expression is longer than 4096 characters");
            assert_eq!(error.start, piece.repeat(4096).chars().take(4096).map(char::len_utf8).sum::<usize>());
        }
        for piece in ["(", "-", "+", "!", "not ", "2^", "2^-", "sin(", "if(1,", "clamp(x, 0, ", "1+("] {
            let error = failure(&format!("{}x", piece.repeat(4095 / piece.len())));
            assert_eq!(error.message, "the expression is nested deeper than 64", "{piece}");
        }
        let nested = |levels| format!("{}x{}", "(".repeat(levels), ")".repeat(levels));
        assert_eq!(value(&nested(64)), AT[0]);
        let error = failure(&nested(65));
        assert_eq!((error.start, error.end), (64, 65));
    }

    #[test]
    fn the_longest_formulas_compile_on_a_small_stack() {
        fn balanced(levels: usize, form: &dyn Fn(&str) -> String) -> String {
            (0..levels).fold("-x".to_string(), |inner, _| form(&inner))
        }
        let longest = vec![
            vec!["x"; 2048].join("+"),
            vec!["1"; 2048].join("/"),
            format!("min(x, {}){}", "min(x, ".repeat(60) + "x", ")".repeat(60)),
            // Deepest recursion per level: each operator waits for a tighter one.
            format!("{}x{}", "0 or 0 and 0 < 0 + 0 * (".repeat(64), ")".repeat(64)),
            balanced(9, &|inner| format!("({inner}+{inner})")),
            balanced(6, &|inner| format!("if({inner},{inner},{inner})")),
        ];
        let small = std::thread::Builder::new().stack_size(1 << 20);
        let run = move || {
            for source in longest {
                assert!(source.len() <= LONGEST, "{}", source.len());
                let formula = Expression::compile(&source, NAMES, &[]).unwrap();
                let mut out = [0.0];
                formula.evaluate_batch(&[&[0.7]], &mut out);
                assert_eq!(out[0].to_bits(), formula.evaluate(&AT).to_bits());
            }
        };
        small.spawn(run).unwrap().join().unwrap();
    }

    #[test]
    fn no_text_makes_the_compiler_panic() {
        let pieces = [
            "x", "y", "pi", "2", "1e", ".5", ".", "1e-3", "+", "-", "*", "/", "^", "(", ")", ",", "<", "<=", "==", "!",
            "!=", "and ", "or ", "not ", "&&", "|", "sin(", "if(", "min(", " ", "\n", "é", "\"", "`", "0", "erf", "q",
        ];
        let mut state = 0x2545_f491_4f6c_dd1d;
        let mut accepted = 0;
        for _ in 0..100_000 {
            let count = random(&mut state) % 12;
            let source: String =
                (0..count).map(|_| pieces[(random(&mut state) >> 20) as usize % pieces.len()]).collect();
            match Expression::compile(&source, NAMES, &[]) {
                Ok(formula) => {
                    accepted += 1;
                    let mut out = [0.0];
                    formula.evaluate_batch(&[&[0.7], &[-1.3], &[2.25], &[0.01]], &mut out);
                    assert_eq!(out[0].to_bits(), formula.evaluate(&AT).to_bits(), "{source}");
                }
                Err(error) => {
                    assert!(error.start <= error.end && error.end <= source.len(), "{source}");
                    assert!(source.get(error.start..error.end).is_some(), "{source}");
                }
            }
        }
        assert!(accepted > 1000, "{accepted}");
    }

    #[test]
    fn the_nearest_name_forgives_typos_and_nothing_more() {
        let words = ["horizon", "points", "time", "density", "bond-based", "critical_stretch", "x"];
        for (typo, meant) in [
            ("horizn", Some("horizon")),
            ("horziont", Some("horizon")),
            ("hroizno", Some("horizon")),
            ("tiem", Some("time")),
            ("tim", Some("time")),
            ("Density", Some("density")),
            ("densitty", Some("density")),
            ("bond_based", Some("bond-based")),
            ("critcal_strech", Some("critical_stretch")),
            ("X", Some("x")),
            ("time", Some("time")),
            ("q", None),
            ("tax", None),
            ("", None),
            ("viscosity", None),
        ] {
            assert_eq!(nearest(typo, words), meant, "{typo}");
        }
    }
}
