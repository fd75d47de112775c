//! From characters to tokens.

use super::*;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
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
pub(super) struct Token {
    pub(super) kind: Kind,
    pub(super) start: usize,
    pub(super) end: usize,
}

/// Longer symbols stand before those they begin with.
pub(super) const SYMBOLS: &[(&str, Kind)] = &[
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
pub(super) const LOOKALIKES: &[(char, &str)] = &[
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

pub(super) fn tokens(source: &str) -> Result<Vec<Token>, ExpressionError> {
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

pub(super) fn number_starts(rest: &str) -> bool {
    let digits = rest.strip_prefix('.').unwrap_or(rest);
    digits.starts_with(|first: char| first.is_ascii_digit())
}

pub(super) fn number(source: &str, start: usize, end: usize) -> Result<f64, ExpressionError> {
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
