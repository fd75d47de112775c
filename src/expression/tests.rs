//! The language against the standard library, its errors with their places, and hostile texts.

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
        let source: String = (0..count).map(|_| pieces[(random(&mut state) >> 20) as usize % pieces.len()]).collect();
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
