//! From tokens to a formula, with the constants folded, or to what is wrong with it and where.

use super::*;

/// A parsed part of the source, parentheses included in its range.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub(super) node: usize,
    pub(super) start: usize,
    pub(super) end: usize,
}

pub(super) struct Parser<'a> {
    pub(super) source: &'a str,
    pub(super) variables: &'a [&'a str],
    pub(super) constants: &'a [(String, f64)],
    pub(super) tokens: Vec<Token>,
    pub(super) position: usize,
    pub(super) depth: usize,
    pub(super) nodes: Vec<Node>,
    /// Parts without a finite value. They are errors only if the value of the formula needs them.
    pub(super) undefined: Vec<ExpressionError>,
}

impl Parser<'_> {
    pub(super) fn whole(&mut self) -> Result<Part, ExpressionError> {
        if self.peek().kind == Kind::End {
            return Err(error("the expression is empty".into(), 0..self.source.len()));
        }
        let part = self.or()?;
        match self.peek().kind {
            Kind::End => Ok(part),
            _ => Err(self.operator_missing()),
        }
    }

    pub(super) fn or(&mut self) -> Result<Part, ExpressionError> {
        let mut left = self.and()?;
        while self.take(Kind::Or).is_some() {
            let right = self.and()?;
            left = self.binary(Operation::Or, left, right);
        }
        Ok(left)
    }

    pub(super) fn and(&mut self) -> Result<Part, ExpressionError> {
        let mut left = self.not()?;
        while self.take(Kind::And).is_some() {
            let right = self.not()?;
            left = self.binary(Operation::And, left, right);
        }
        Ok(left)
    }

    pub(super) fn not(&mut self) -> Result<Part, ExpressionError> {
        let Some(not) = self.take(Kind::Not) else {
            return self.comparison();
        };
        let part = self.nested(not, Self::not)?;
        Ok(self.operation(Operation::Not, &[part], not.start..part.end))
    }

    pub(super) fn comparison(&mut self) -> Result<Part, ExpressionError> {
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

    pub(super) fn sum(&mut self) -> Result<Part, ExpressionError> {
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

    pub(super) fn product(&mut self) -> Result<Part, ExpressionError> {
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

    pub(super) fn sign(&mut self) -> Result<Part, ExpressionError> {
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

    pub(super) fn power(&mut self) -> Result<Part, ExpressionError> {
        let base = self.value()?;
        let Some(power) = self.take(Kind::Power) else {
            return Ok(base);
        };
        let exponent = self.nested(power, Self::sign)?;
        Ok(self.binary(Operation::Power, base, exponent))
    }

    pub(super) fn value(&mut self) -> Result<Part, ExpressionError> {
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

    pub(super) fn call(&mut self, name: Token) -> Result<Part, ExpressionError> {
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

    pub(super) fn name(&mut self, token: Token) -> Result<Node, ExpressionError> {
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

    pub(super) fn binary(&mut self, operation: Operation, left: Part, right: Part) -> Part {
        self.operation(operation, &[left, right], left.start..right.end)
    }

    /// Adds an operation, or what it folds to.
    pub(super) fn operation(&mut self, operation: Operation, parts: &[Part], range: Range<usize>) -> Part {
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

    pub(super) fn undefined(&mut self, error: ExpressionError) -> Node {
        self.undefined.push(error);
        Node::Undefined(self.undefined.len() - 1)
    }

    pub(super) fn push(&mut self, node: Node, range: Range<usize>) -> Part {
        self.nodes.push(node);
        Part { node: self.nodes.len() - 1, start: range.start, end: range.end }
    }

    pub(super) fn peek(&self) -> Token {
        self.tokens[self.position]
    }

    pub(super) fn take(&mut self, kind: Kind) -> Option<Token> {
        let token = self.peek();
        (token.kind == kind).then(|| {
            self.position += 1;
            token
        })
    }

    pub(super) fn text(&self, token: Token) -> &str {
        &self.source[token.start..token.end]
    }

    /// Every recursion of the grammar passes here, so that none outgrows the stack.
    pub(super) fn nested(
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

    pub(super) fn close(&mut self, open: Token) -> Result<Token, ExpressionError> {
        match self.peek().kind {
            Kind::End => Err(never_closed(open)),
            _ => self.take(Kind::Close).ok_or_else(|| self.operator_missing()),
        }
    }

    /// A value is complete, and what follows can neither continue it nor end it.
    pub(super) fn operator_missing(&self) -> ExpressionError {
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
    pub(super) fn misspelled_logic(&self, text: &str) -> Option<&'static str> {
        let function = FUNCTIONS.iter().any(|function| function.name == text);
        if text.len() < 2 || function || self.is_value(text) {
            return None;
        }
        nearest(text, ["and", "or"])
    }

    pub(super) fn is_value(&self, text: &str) -> bool {
        text == "pi" || self.variables.contains(&text) || self.constants.iter().any(|(name, _)| name == text)
    }

    pub(super) fn product_missing(&self, left: Token, right: Token) -> ExpressionError {
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
    pub(super) fn value_missing(&self) -> ExpressionError {
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

    pub(super) fn unknown_name(&self, token: Token) -> ExpressionError {
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

    pub(super) fn unknown_function(&self, token: Token) -> ExpressionError {
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

pub(super) fn elsewhere(name: &str) -> Option<&'static str> {
    ELSEWHERE.iter().find(|(other, _)| *other == name).map(|&(_, form)| form)
}

pub(super) fn never_closed(open: Token) -> ExpressionError {
    error("`(` is never closed".into(), open.start..open.end)
}

pub(super) fn no_finite_value(
    operation: Operation,
    [a, b, _]: [f64; 3],
    text: &str,
    range: Range<usize>,
) -> ExpressionError {
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

pub(super) fn error(message: String, range: Range<usize>) -> ExpressionError {
    ExpressionError { message, start: range.start, end: range.end, help: None }
}

impl ExpressionError {
    pub(super) fn with_help(self, help: String) -> Self {
        Self { help: Some(help), ..self }
    }
}

/// A piece of the source on one line of a message, shortened.
pub(super) fn quote(text: &str) -> String {
    let mut words = text.split_ascii_whitespace().collect::<Vec<_>>().join(" ");
    if let Some((cut, _)) = words.char_indices().nth(40) {
        words.truncate(cut);
        words.push_str("...");
    }
    format!("`{words}`")
}
