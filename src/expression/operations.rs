//! What a formula can do: operators and functions, at one point and in blocks.

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Operation {
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

pub(super) struct Function {
    pub(super) name: &'static str,
    pub(super) form: &'static str,
    pub(super) operation: Operation,
}

pub(super) const fn function(name: &'static str, form: &'static str, operation: Operation) -> Function {
    Function { name, form, operation }
}

pub(super) const FUNCTIONS: &[Function] = &[
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
pub(super) const ELSEWHERE: &[(&str, &str)] = &[
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
pub(super) trait Action {
    type Output;
    fn unary(self, f: impl Fn(f64) -> f64) -> Self::Output;
    fn binary(self, f: impl Fn(f64, f64) -> f64) -> Self::Output;
    fn ternary(self, f: impl Fn(f64, f64, f64) -> f64) -> Self::Output;
}

impl Operation {
    #[inline]
    pub(super) fn with<A: Action>(self, action: A) -> A::Output {
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
    pub(super) fn apply(self, operands: [f64; 3]) -> f64 {
        self.with(Point(operands))
    }

    pub(super) fn arity(self) -> usize {
        self.with(Arity)
    }
}

pub(super) struct Arity;

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

pub(super) struct Point(pub(super) [f64; 3]);

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

pub(super) struct Block<'a> {
    pub(super) target: &'a mut [f64],
    pub(super) operands: [Lane<'a>; 3],
}

/// The values of one operand along a block.
#[derive(Clone, Copy)]
pub(super) enum Lane<'a> {
    Same(f64),
    Each(&'a [f64]),
}

impl<'a> Lane<'a> {
    pub(super) fn of_column(column: &'a [f64], start: usize, count: usize) -> Self {
        match column {
            &[value] => Self::Same(value),
            _ => Self::Each(&column[start..start + count]),
        }
    }

    #[inline]
    pub(super) fn at(self, index: usize) -> f64 {
        match self {
            Self::Same(value) => value,
            Self::Each(values) => values[index],
        }
    }
}

#[inline]
pub(super) fn fill(target: &mut [f64], lane: Lane, f: impl Fn(f64) -> f64) {
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
pub(super) fn smaller(a: f64, b: f64) -> f64 {
    if a < b || a.is_nan() { a } else { b }
}

pub(super) fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

pub(super) fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x
    }
}

/// The compiler may swap the operands of a sum, and with them the bits of a NaN.
pub(super) fn one_nan(value: f64) -> f64 {
    if value.is_nan() { f64::NAN } else { value }
}

/// Error function `2/√π ∫₀ˣ exp(-s²) ds`, with a relative error below 1e-15.
///
/// Below 2 the series `2/√π exp(-x²) Σ 2ⁿ x²ⁿ⁺¹ / (2n+1)!!`, whose terms have one sign
/// (Abramowitz and Stegun, 7.1.6); above, one minus the continued fraction of `erfc` (7.1.14).
pub(super) fn erf(x: f64) -> f64 {
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
