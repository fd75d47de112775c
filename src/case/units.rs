//! Numbers with a unit, as in `"72 GPa"` or `"2.7 g/cm^3"`, turned into SI.
//!
//! A unit is a product, quotient or power of symbols with an SI prefix: `J/m^2`, `MPa*m^0.5`,
//! `W/(m*K)`. Powers of ten are added to the exponent of the number before it is read, so that
//! `"90 us"` is the double nearest to 90e-6.
//!
//! Temperatures in degrees Celsius are deliberately absent: a difference and a temperature
//! would be written alike and mean different things.

use std::f64::consts::PI;

use crate::expression::nearest;

/// Twice the exponents of metre, kilogram, second, kelvin, mole and ampere. Twice, because a
/// fracture toughness is in Pa m^1/2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dimension([i16; 6]);

/// A unit: `factor * 10^tens` of the SI unit of its dimension.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    pub dimension: Dimension,
    factor: f64,
    /// Twice the power of ten.
    twice_tens: i32,
}

/// Why a text is not a number with a unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnitError {
    pub message: String,
    pub help: Option<String>,
}

const BASE: [&str; 6] = ["m", "kg", "s", "K", "mol", "A"];

/// Symbol, its base dimension (not doubled), factor, power of ten, whether prefixes are used.
type Symbol = (&'static str, [i16; 6], f64, i32, bool);

const SYMBOLS: [Symbol; 24] = [
    ("m", [1, 0, 0, 0, 0, 0], 1.0, 0, true),
    ("g", [0, 1, 0, 0, 0, 0], 1.0, -3, true),
    ("s", [0, 0, 1, 0, 0, 0], 1.0, 0, true),
    ("K", [0, 0, 0, 1, 0, 0], 1.0, 0, true),
    ("mol", [0, 0, 0, 0, 1, 0], 1.0, 0, true),
    ("A", [0, 0, 0, 0, 0, 1], 1.0, 0, true),
    ("N", [1, 1, -2, 0, 0, 0], 1.0, 0, true),
    ("Pa", [-1, 1, -2, 0, 0, 0], 1.0, 0, true),
    ("J", [2, 1, -2, 0, 0, 0], 1.0, 0, true),
    ("W", [2, 1, -3, 0, 0, 0], 1.0, 0, true),
    ("Hz", [0, 0, -1, 0, 0, 0], 1.0, 0, true),
    ("bar", [-1, 1, -2, 0, 0, 0], 1.0, 5, true),
    ("min", [0, 0, 1, 0, 0, 0], 60.0, 0, false),
    ("h", [0, 0, 1, 0, 0, 0], 3600.0, 0, false),
    ("in", [1, 0, 0, 0, 0, 0], 254.0, -4, false),
    ("ft", [1, 0, 0, 0, 0, 0], 3048.0, -4, false),
    // 1 lbf/in^2 = 0.45359237 kg * 9.80665 m/s^2 / (0.0254 m)^2.
    ("psi", [-1, 1, -2, 0, 0, 0], 6894.757293168361, 0, false),
    ("ksi", [-1, 1, -2, 0, 0, 0], 6894.757293168361, 3, false),
    ("atm", [-1, 1, -2, 0, 0, 0], 101325.0, 0, false),
    ("%", [0; 6], 1.0, -2, false),
    ("rad", [0; 6], 1.0, 0, false),
    ("deg", [0; 6], PI / 180.0, 0, false),
    ("°", [0; 6], PI / 180.0, 0, false),
    ("1", [0; 6], 1.0, 0, false),
];

const PREFIXES: [(&str, i32); 15] = [
    ("T", 12),
    ("G", 9),
    ("M", 6),
    ("k", 3),
    ("h", 2),
    ("da", 1),
    ("d", -1),
    ("c", -2),
    ("m", -3),
    ("u", -6),
    ("µ", -6), // U+00B5, the micro sign
    ("μ", -6), // U+03BC, the Greek letter
    ("n", -9),
    ("p", -12),
    ("f", -15),
];

/// The quantities that have a name, with the SI unit and the units to propose.
const QUANTITIES: [(&str, &str, &str); 23] = [
    ("a length", "m", "m, mm, um, nm, cm, km, in, ft"),
    ("a mass", "kg", "kg, g, mg"),
    ("a time", "s", "s, ms, us, ns, min, h"),
    ("a temperature", "K", "K"),
    ("an amount of substance", "mol", "mol, mmol, kmol"),
    ("an electric current", "A", "A, mA"),
    ("an area", "m^2", "m^2, mm^2, cm^2"),
    ("a volume", "m^3", "m^3, mm^3, cm^3"),
    ("a velocity", "m/s", "m/s, mm/s, km/h"),
    ("an acceleration", "m/s^2", "m/s^2, mm/s^2"),
    ("a force", "N", "N, kN, MN"),
    ("a pressure", "Pa", "Pa, kPa, MPa, GPa, psi, bar"),
    ("an energy", "J", "J, mJ, kJ, N*m"),
    ("a power", "W", "W, mW, kW"),
    ("a density", "kg/m^3", "kg/m^3, g/cm^3"),
    ("a frequency", "1/s", "1/s, Hz, kHz, MHz"),
    ("an energy per area", "J/m^2", "J/m^2, kJ/m^2, N/m, N/mm"),
    ("a force per volume", "N/m^3", "N/m^3, kN/m^3, N/mm^3, MPa/mm"),
    ("a fracture toughness", "Pa*m^0.5", "Pa*m^0.5, MPa*m^0.5, N/mm^1.5"),
    ("a dynamic viscosity", "Pa*s", "Pa*s, mPa*s"),
    ("a diffusivity", "m^2/s", "m^2/s, mm^2/s"),
    ("a thermal expansion", "1/K", "1/K"),
    ("a plain number", "1", "%, deg"),
];

/// Splits `"72 GPa"` into the number and its unit; `None` if the text is not of that form, as
/// `"2*h"` and `"72"` are not.
pub fn split_quantity(text: &str) -> Option<(&str, &str)> {
    let text = text.trim();
    let number = number_length(text)?;
    let (number, rest) = text.split_at(number);
    let unit = rest.trim_start();
    let starts_unit = unit.starts_with(|c: char| c.is_alphabetic() || "%°(".contains(c))
        || (unit.len() < rest.len() && unit.starts_with("1/"));
    (starts_unit && !unit.starts_with('(')).then_some((number, unit))
}

/// The number of bytes of the decimal number at the start of the text.
fn number_length(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let digits = |from: usize| {
        let count = bytes[from..].iter().take_while(|b| b.is_ascii_digit());
        from + count.count()
    };
    let start = usize::from(text.starts_with(['+', '-']));
    let mut end = digits(start);
    let mut found = end - start;
    if bytes.get(end) == Some(&b'.') {
        let fraction = digits(end + 1);
        found += fraction - end - 1;
        end = fraction;
    }
    if found == 0 {
        return None;
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits(end + 1 + sign);
        if exponent > end + 1 + sign {
            end = exponent;
        }
    }
    Some(end)
}

impl Unit {
    /// Reads a unit such as `GPa`, `kg/m^3` or `W/(m*K)`; the empty text is the number one.
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        // Longer than any unit in use; bounds the depth of brackets too.
        if text.len() > 64 {
            return Err(UnitError::new("the unit is longer than 64 characters"));
        }
        let mut rest = text.trim();
        if rest.is_empty() {
            return Ok(Self::one());
        }
        let unit = product(&mut rest)?;
        if !rest.is_empty() {
            return Err(UnitError::new(format!("the unit `{text}` cannot be read at `{rest}`")));
        }
        Ok(unit)
    }

    /// The SI value of a decimal number in this unit.
    pub fn to_si(self, number: &str) -> Option<f64> {
        let (mantissa, exponent) = match number.split_once(['e', 'E']) {
            Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
            None => (number, 0),
        };
        let tens = exponent.checked_add(self.twice_tens.div_euclid(2))?;
        let root = if self.twice_tens.rem_euclid(2) == 1 { 10f64.sqrt() } else { 1.0 };
        let factor = self.factor * root;
        // The power of ten comes last, in decimal: an inch is 254 ten-thousandths of a metre.
        if factor == 1.0 {
            format!("{mantissa}e{tens}").parse().ok()
        } else {
            let product = mantissa.parse::<f64>().ok()? * factor;
            format!("{product}e{tens}").parse().ok()
        }
    }

    fn one() -> Self {
        Self { dimension: Dimension::default(), factor: 1.0, twice_tens: 0 }
    }

    /// `self * other^(twice/2)`.
    fn times(mut self, other: Self, twice: i16) -> Self {
        for (sum, exponent) in self.dimension.0.iter_mut().zip(other.dimension.0) {
            *sum += exponent * twice / 2;
        }
        self.factor *= other.factor.powf(f64::from(twice) / 2.0);
        self.twice_tens += other.twice_tens * i32::from(twice) / 2;
        self
    }
}

impl UnitError {
    fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), help: None }
    }
}

/// `power (('*' | '/' | ' ') power)*`, from left to right.
fn product(rest: &mut &str) -> Result<Unit, UnitError> {
    let mut unit = power(rest, Unit::one(), 1)?;
    loop {
        *rest = rest.trim_start();
        let sign = match rest.chars().next() {
            None | Some(')') => return Ok(unit),
            Some(c @ ('*' | '·' | '/')) => {
                *rest = rest[c.len_utf8()..].trim_start();
                if c == '/' { -1 } else { 1 }
            }
            Some(_) => 1,
        };
        unit = power(rest, unit, sign)?;
    }
}

/// Multiplies `unit` by `(symbol | '(' product ')') ['^' number]`.
fn power(rest: &mut &str, unit: Unit, sign: i16) -> Result<Unit, UnitError> {
    let base = if let Some(inside) = rest.strip_prefix('(') {
        *rest = inside;
        let inner = product(rest)?;
        *rest = rest.strip_prefix(')').ok_or_else(|| UnitError::new("the unit has a bracket that is not closed"))?;
        inner
    } else {
        let end = rest.find(|c: char| !(c.is_alphabetic() || "%°1".contains(c))).unwrap_or(rest.len());
        let (name, after) = rest.split_at(end);
        if name.is_empty() {
            if rest.is_empty() {
                return Err(UnitError::new("the unit ends too early"));
            }
            return Err(UnitError {
                message: format!("a unit cannot start with `{rest}`"),
                help: Some("a unit follows a single number; name it in [constants]".to_owned()),
            });
        }
        *rest = after;
        symbol(name)?
    };
    let (exponent, length) = if let Some(text) = rest.strip_prefix('^') {
        let length = number_length(text).unwrap_or(0);
        (text[..length].parse().unwrap_or(f64::NAN), 1 + length)
    } else if rest.starts_with('²') {
        (2.0, '²'.len_utf8())
    } else if rest.starts_with('³') {
        (3.0, '³'.len_utf8())
    } else {
        (1.0, 0)
    };
    *rest = &rest[length..];
    let twice = 2.0 * exponent;
    if twice.fract() != 0.0 || !(-24.0..=24.0).contains(&twice) {
        return Err(UnitError::new("a unit's power must be a whole or half number such as `^2`, `^-1` or `^0.5`"));
    }
    // A power of a power of a half power has no exact exponent here; nobody writes one.
    let exact = |n: i32| n * (twice as i32) % 2 == 0;
    if !exact(base.twice_tens) || base.dimension.0.iter().any(|&n| !exact(n.into())) {
        return Err(UnitError::new("only half powers of a unit can be read"));
    }
    let largest = base.dimension.0.iter().map(|n| n.abs()).max().unwrap_or(0);
    if largest > 200 || base.twice_tens.abs() > 2000 {
        return Err(UnitError::new("the unit's power is too large"));
    }
    Ok(unit.times(base, sign * twice as i16))
}

/// One symbol with or without a prefix.
fn symbol(name: &str) -> Result<Unit, UnitError> {
    let unit = |(_, dimension, factor, tens, _): Symbol, prefix: i32| Unit {
        dimension: Dimension(dimension.map(|n| 2 * n)),
        factor,
        twice_tens: 2 * (tens + prefix),
    };
    if let Some(&found) = SYMBOLS.iter().find(|entry| entry.0 == name) {
        return Ok(unit(found, 0));
    }
    for (prefix, tens) in PREFIXES {
        let base = name.strip_prefix(prefix);
        let of_base = |entry: &&Symbol| entry.4 && Some(entry.0) == base;
        if let Some(&found) = SYMBOLS.iter().find(of_base) {
            return Ok(unit(found, tens));
        }
    }
    let help = match name {
        "C" | "degC" | "°C" | "F" | "degF" | "°F" => Some("give the temperature in K".to_owned()),
        _ => suggestion(name).map(|unit| format!("did you mean `{unit}`?")),
    };
    Err(UnitError { message: format!("unknown unit `{name}`"), help })
}

/// The unit proposed for a misspelt one; one that differs in case only is preferred.
fn suggestion(name: &str) -> Option<&'static str> {
    let mut proposed: Vec<&'static str> = QUANTITIES
        .iter()
        .flat_map(|&(_, _, units)| units.split(", "))
        .filter(|unit| unit.chars().all(char::is_alphabetic))
        .collect();
    proposed.dedup();
    let same = |unit: &&&str| unit.eq_ignore_ascii_case(name);
    match proposed.iter().find(same) {
        Some(unit) => Some(unit),
        None => nearest(name, proposed.iter().copied()),
    }
}

impl Dimension {
    /// Whether this is a plain number.
    pub fn is_one(self) -> bool {
        self == Self::default()
    }

    /// The dimension of a unit given by the program itself; an unreadable one is our mistake.
    pub fn of(unit: &str) -> Self {
        match Unit::parse(unit) {
            Ok(unit) => unit.dimension,
            Err(error) => panic!("unit `{unit}` of a case key: {}", error.message),
        }
    }

    /// What it is called: `a pressure`, or `a quantity in m^2 kg s^-1` where there is no name.
    pub fn name(self) -> String {
        let named = QUANTITIES.iter().find(|entry| Self::of(entry.1) == self);
        named.map_or_else(|| format!("a quantity in {}", self.in_base_units()), |entry| entry.0.to_owned())
    }

    /// The units to propose: `Pa, kPa, MPa`.
    pub fn units(self) -> String {
        let named = QUANTITIES.iter().find(|entry| Self::of(entry.1) == self);
        named.map_or_else(|| self.in_base_units(), |entry| entry.2.to_owned())
    }

    fn in_base_units(self) -> String {
        let parts = BASE.iter().zip(self.0).filter(|&(_, twice)| twice != 0);
        let part = |(base, twice): (&&str, i16)| match twice {
            2 => (*base).to_owned(),
            _ => format!("{base}^{}", f64::from(twice) / 2.0),
        };
        parts.map(part).collect::<Vec<_>>().join(" ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn si(text: &str) -> Result<f64, UnitError> {
        let (number, unit) = split_quantity(text).expect(text);
        Ok(Unit::parse(unit)?.to_si(number).expect(text))
    }

    #[test]
    fn a_number_with_a_unit_is_the_nearest_si_double() {
        let table = [
            ("72 GPa", 72e9),
            ("72GPa", 72e9),
            ("0.5 mm", 0.5e-3),
            ("4.3e-5 s", 4.3e-5),
            ("90 us", 90e-6),
            ("90 µs", 90e-6),
            ("90 μs", 90e-6),
            ("2.7 g/cm^3", 2700.0),
            ("1 kg/m³", 1.0),
            ("135 J/m^2", 135.0),
            ("3 N/mm", 3000.0),
            ("9.81 m/s^2", 9.81),
            ("5 1/s", 5.0),
            ("5 1/ms", 5000.0),
            ("36 km/h", 10.0),
            ("2 W/(m*K)", 2.0),
            ("2 W/m/K", 2.0),
            ("15 %", 0.15),
            ("180 deg", PI),
            ("-1 in", -0.0254),
            ("3 min", 180.0),
            ("1 atm", 101325.0),
            ("1 ksi", 6894757.293168361),
            ("1.5 MPa*m^0.5", 1.5e6),
            ("1 MPa mm^0.5", 31622.776601683792),
        ];
        for (text, expected) in table {
            let value = si(text).expect(text);
            // Units that are powers of ten are exact, the others are one product away.
            let allowed = 4.0 * f64::EPSILON * expected.abs();
            assert!((value - expected).abs() <= allowed, "{text}: {value}");
        }
        assert_eq!(si("90 us"), Ok(90e-6));
        assert_eq!(si("72 GPa"), Ok(72e9));
    }

    #[test]
    fn an_expression_is_not_a_number_with_a_unit() {
        for text in ["2*h", "delta/4", "sigma", "5e-5", "1/0.5", "", "-", "3 (m)", "1/s"] {
            assert_eq!(split_quantity(text), None, "{text}");
        }
    }

    #[test]
    fn unreadable_units_are_explained() {
        let table = [
            ("furlong", "unknown unit `furlong`", None),
            ("GPA", "unknown unit `GPA`", Some("did you mean `GPa`?")),
            ("degC", "unknown unit `degC`", Some("give the temperature in K")),
            ("m^", "a unit's power must be", None),
            ("m^0.3", "a unit's power must be", None),
            ("(m", "bracket", None),
            ("m)", "cannot be read at `)`", None),
            ("m/", "ends too early", None),
            ("((m^12)^12)^12", "too large", None),
            ("GPa/2", "a unit cannot start with `2`", Some("a unit follows a single number; name it in [constants]")),
        ];
        for (text, message, help) in table {
            let error = Unit::parse(text).expect_err(text);
            assert!(error.message.contains(message), "{text}: {}", error.message);
            assert_eq!(error.help.as_deref(), help, "{text}");
        }
    }

    #[test]
    fn quantities_have_names() {
        assert_eq!(Dimension::of("J/m^2").name(), "an energy per area");
        assert_eq!(Dimension::of("1").name(), "a plain number");
        assert_eq!(Dimension::of("N/m^6").name(), "a quantity in m^-5 kg s^-2");
    }
}
