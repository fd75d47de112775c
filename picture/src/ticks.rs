//! Numbers a reader likes to see on an axis: round steps, few digits, SI prefixes.

/// Ticks of an axis: where labels stand, what they say, and the small ticks between.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Ticks {
    pub labels: Vec<(f64, String)>,
    pub minor: Vec<f64>,
}

/// A range of values along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub low: f64,
    pub high: f64,
    pub logarithmic: bool,
}

impl Axis {
    pub fn linear([low, high]: [f64; 2]) -> Self {
        Self { low, high, logarithmic: false }
    }

    /// How far along the axis a value stands, 0 at the low end and 1 at the high one.
    pub fn share(&self, value: f64) -> f64 {
        if self.logarithmic {
            (value.log10() - self.low.log10()) / (self.high.log10() - self.low.log10())
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// About `count` ticks, the labels in units of `1 / factor`.
    pub fn ticks(&self, count: usize, factor: f64) -> Ticks {
        if self.logarithmic {
            logarithmic_ticks(self.low, self.high, count)
        } else {
            // One label alone does not tell the scale.
            [count, 2 * count, 4 * count]
                .map(|count| linear_ticks(self.low, self.high, count, factor))
                .into_iter()
                .find(|ticks| ticks.labels.len() > 1)
                .unwrap_or_default()
        }
    }
}

/// Beyond this a number is treated like infinity: differences and factors would overflow.
const LARGEST: f64 = 1e290;

/// Whether a value can be drawn on an axis.
pub(super) fn drawable(value: f64) -> bool {
    value.abs() < LARGEST
}

/// The range of the drawable values, `None` if there are none.
pub(super) fn span(values: impl IntoIterator<Item = f64>) -> Option<[f64; 2]> {
    values.into_iter().filter(|value| drawable(*value)).fold(None, |range, value| {
        let [low, high] = range.unwrap_or([value, value]);
        Some([value.min(low), value.max(high)])
    })
}

/// The range, made wide enough to be drawn if its ends coincide or nearly do.
pub(super) fn widened([low, high]: [f64; 2]) -> [f64; 2] {
    let size = low.abs().max(high.abs());
    if size < 1.0 / LARGEST {
        return [0.0, 1.0];
    }
    // Narrower than this, tick labels would need more digits than f64 has.
    if high - low > 1e-9 * size {
        return [low, high];
    }
    [low - 0.05 * size, high + 0.05 * size]
}

fn linear_ticks(low: f64, high: f64, count: usize, factor: f64) -> Ticks {
    let (low, high) = (low * factor, high * factor);
    let step = round_step((high - low) / count.max(1) as f64);
    let tolerance = 1e-9; // of a step, for ends that are ticks but for rounding
    let first = (low / step - tolerance).ceil();
    let last = (high / step + tolerance).floor();
    let number = last - first;
    if number.is_nan() || number > 4.0 * count as f64 + 4.0 {
        return Ticks::default();
    }
    let steps = (last - first).max(-1.0) as i64;
    // The steps with 2.5 have one digit more than their power of ten.
    let power = (step.log10() + tolerance).floor();
    let more = f64::from((step / 10.0_f64.powf(power) - 2.5).abs() < 0.1);
    let digits = (more - power).clamp(0.0, 15.0) as usize;
    let largest = low.abs().max(high.abs());
    let label = |value: f64| {
        if !(1e-6..1e7).contains(&largest) {
            let decimals = (largest.log10().floor() - power + more).clamp(0.0, 15.0);
            // Rounded, then written without the zeros at the end.
            let rounded = format!("{value:.*e}", decimals as usize);
            let rounded: f64 = rounded.parse().unwrap_or(value);
            powers_written(&format!("{rounded:e}"))
        } else {
            minus_written(&format!("{value:.digits$}"))
        }
    };
    // Adding 0.0 turns a negative zero into zero.
    let labels =
        (0..=steps).map(|i| (first + i as f64) * step + 0.0).map(|value| (value / factor, label(value))).collect();
    Ticks { labels, minor: Vec::new() }
}

/// The smallest of 1, 2, 2.5, 5 times a power of ten that is not below `step`.
pub(super) fn round_step(step: f64) -> f64 {
    let power = 10.0_f64.powf(step.log10().floor());
    let tolerance = 1.0 + 1e-9;
    [1.0, 2.0, 2.5, 5.0, 10.0].into_iter().find(|round| round * power * tolerance >= step).unwrap_or(10.0) * power
}

/// Powers of ten, thinned out if there are many; 1, 2, 5 if there are few; round steps if still fewer.
fn logarithmic_ticks(low: f64, high: f64, count: usize) -> Ticks {
    if low.is_nan() || low <= 0.0 {
        return Ticks::default();
    }
    // All powers that f64 has lie within; the bounds only keep a wrong range from looping.
    let (first, last) = (low.log10().floor().max(-330.0) as i32, high.log10().ceil().min(310.0) as i32);
    let tolerance = 1e-9;
    let inside = |value: &f64| (low * (1.0 - tolerance)..=high * (1.0 + tolerance)).contains(value);
    let at = |digits: &[i32], every: i32| -> Vec<f64> {
        (first..=last)
            .filter(|power| power.rem_euclid(every) == 0)
            .flat_map(|power| digits.iter().map(move |&d| f64::from(d) * power_of_ten(power)))
            .filter(inside)
            .collect()
    };
    let decades = high.log10() - low.log10();
    let every = ((decades / count.max(1) as f64).ceil() as i32).max(1);
    let mut labelled = at(&[1], every);
    let mut minor = if every == 1 { at(&[2, 3, 4, 5, 6, 7, 8, 9], 1) } else { at(&[1], 1) };
    if labelled.len() < 3 && every == 1 {
        let some = at(&[1, 2, 5], 1);
        if some.len() <= count.max(3) {
            labelled = some;
        }
    }
    if labelled.len() < 2 {
        return linear_ticks(low, high, count, 1.0);
    }
    minor.retain(|value| !labelled.contains(value));
    // One way of writing on one axis: plain numbers, unless the powers are far from 1.
    let plain = labelled.iter().all(|value| (0.99e-3..1.01e4).contains(value));
    let label = |value: f64| {
        if plain { format!("{}", (value * 1e6).round() / 1e6) } else { powers_written(&format!("{value:.0e}")) }
    };
    Ticks { labels: labelled.into_iter().map(|value| (value, label(value))).collect(), minor }
}

/// Parsed, because `powi` is off by rounding and 1e-3 must be the same number as in the data.
fn power_of_ten(power: i32) -> f64 {
    format!("1e{power}").parse().unwrap_or(1.0)
}

/// "3e-5" as "3×10⁻⁵", "1e-5" as "10⁻⁵".
fn powers_written(text: &str) -> String {
    let Some((digits, power)) = text.split_once('e') else {
        return text.to_owned();
    };
    let is_zero = digits.chars().all(|c| matches!(c, '0' | '.' | '-'));
    match (digits, power) {
        _ if is_zero => "0".to_owned(),
        (_, "0") => minus_written(digits),
        ("1", _) => format!("10{}", raised(power)),
        _ => format!("{}×10{}", minus_written(digits), raised(power)),
    }
}

fn raised(power: &str) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    power.chars().map(|c| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize])).collect()
}

fn minus_written(text: &str) -> String {
    text.replace('-', "−")
}

const PREFIXES: [(i32, &str); 11] = [
    (-15, "f"),
    (-12, "p"),
    (-9, "n"),
    (-6, "µ"),
    (-3, "m"),
    (0, ""),
    (3, "k"),
    (6, "M"),
    (9, "G"),
    (12, "T"),
    (15, "P"),
];

/// The SI prefix that brings `size` between 1 and 1000, and the factor that goes with it.
pub(super) fn prefix(size: f64) -> (f64, &'static str) {
    let power = thousands(size);
    PREFIXES
        .into_iter()
        .find(|(p, _)| *p == power.clamp(-15, 15))
        .map_or((1.0, ""), |(p, name)| (power_of_ten(-p), name))
}

/// The multiple of three that `size` has as power of ten, zero for zero.
fn thousands(size: f64) -> i32 {
    if size > 0.0 && size.is_finite() {
        // The tolerance lets 1e-3, which may come as 9.999…e-4, be one milli.
        let power = (size.log10() + 1e-9).floor() as i32;
        power.div_euclid(3) * 3
    } else {
        0
    }
}

/// A quantity with prefix and unit, at four digits: "42.9 µs".
pub(super) fn quantity(value: f64, unit: &str) -> String {
    if !value.is_finite() {
        return format!("{value} {unit}");
    }
    // Rounded first, so that 999.99 µs becomes 1 ms and not 1000 µs.
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    let (factor, name) = prefix(rounded.abs());
    let scaled = rounded * factor;
    if scaled != 0.0 && !(0.01..1e5).contains(&scaled.abs()) {
        return format!("{} {unit}", powers_written(&format!("{rounded:e}")));
    }
    // Six decimals hold four digits of anything above 0.01; this drops zeros at the end.
    let scaled = (scaled * 1e6).round() / 1e6;
    format!("{} {name}{unit}", minus_written(&scaled.to_string()))
}

/// A label such as "stress \[Pa\]" for values up to `size`, and the factor its numbers take.
///
/// With a unit that takes a prefix: "stress \[MPa\]" and 1e-6. Otherwise a power
/// of ten, if the numbers would be long without: "damage \[10⁻³\]" and 1e3.
pub(super) fn scaled_label(label: &str, size: f64) -> (String, f64) {
    let unit = label.rsplit_once('[').and_then(|(words, rest)| {
        let unit = rest.trim_end().strip_suffix(']')?;
        Some((words, unit))
    });
    if let Some((words, unit)) = unit {
        let first = unit.split(['/', '·', ' ', '*']).next().unwrap_or("");
        if ["m", "s", "Pa", "N", "J", "W", "V", "A", "Hz"].contains(&first) {
            let (factor, name) = prefix(size);
            // Numbers of four digits read well without a prefix.
            if (1.0..1e4).contains(&size) {
                return (label.to_owned(), 1.0);
            }
            if (1.0..1e4).contains(&(size * factor * (1.0 + 1e-9))) {
                return (format!("{words}[{name}{unit}]"), factor);
            }
        }
    }
    let power = thousands(size);
    if (0.0099..1.01e4).contains(&size) || power == 0 {
        return (label.to_owned(), 1.0);
    }
    let ten = format!("10{}", raised(&power.to_string()));
    let label = match unit {
        Some((words, "-" | "")) => format!("{words}[{ten}]"),
        Some((words, unit)) => format!("{words}[{ten} {unit}]"),
        None => format!("{label} [{ten}]"),
    };
    (label, power_of_ten(-power))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(ticks: &Ticks) -> Vec<&str> {
        ticks.labels.iter().map(|(_, label)| &**label).collect()
    }

    #[test]
    fn linear_ticks_are_round_and_inside() {
        let ticks = |low, high| Axis::linear([low, high]).ticks(5, 1.0);
        assert_eq!(words(&ticks(0.0, 1.0)), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(words(&ticks(-3.1, 4.9)), ["−2", "0", "2", "4"]);
        assert_eq!(words(&ticks(0.0, 2e8))[1], "5×10⁷");
        let milli = Axis::linear([0.0, 0.1]).ticks(5, 1e3);
        assert_eq!(words(&milli), ["0", "20", "40", "60", "80", "100"]);
        assert!((milli.labels[1].0 - 0.02).abs() < 1e-15);
    }

    #[test]
    fn no_range_gives_more_than_a_few_ticks_or_hangs() {
        let ends = [0.0, -0.0, 1.0, 1.0 + 1e-15, -1e-300, 1e289, -1e289, 5e-324, f64::NAN];
        for low in ends {
            for high in ends {
                for logarithmic in [false, true] {
                    let axis = Axis { low, high, logarithmic };
                    assert!(axis.ticks(6, 1.0).labels.len() < 40, "{axis:?}");
                }
                let [low, high] = widened([low.min(high), high.max(low)]);
                assert!(low < high || low.is_nan(), "{low} {high}");
            }
        }
    }

    #[test]
    fn logarithmic_ticks_are_powers_or_one_two_five() {
        let ticks = |low, high| Axis { low, high, logarithmic: true }.ticks(6, 1.0);
        assert_eq!(words(&ticks(1e-6, 1e-2)), ["10⁻⁶", "10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²"]);
        assert_eq!(words(&ticks(0.09, 1.1)), ["0.1", "0.2", "0.5", "1"]);
        assert_eq!(words(&ticks(1e-20, 1.0)).len(), 6);
        assert!(ticks(1.11, 1.29).labels.len() >= 2);
        assert_eq!(ticks(1.0, 100.0).minor.len(), 16);
    }

    #[test]
    fn quantities_take_the_prefix_that_keeps_them_short() {
        for (value, said) in [
            (0.0, "0 s"),
            (42.9e-6, "42.9 µs"),
            (1e-3, "1 ms"),
            (999.99e-6, "1 ms"),
            (-2.5, "−2.5 s"),
            (123456.0, "123.5 ks"),
            (1e-30, "10⁻³⁰ s"),
        ] {
            assert_eq!(quantity(value, "s"), said);
        }
    }

    #[test]
    fn labels_scale_units_that_take_prefixes_and_write_powers_for_others() {
        let scaled = |label, size| scaled_label(label, size).0;
        assert_eq!(scaled("stress [Pa]", 3e8), "stress [MPa]");
        assert_eq!(scaled("velocity [m/s]", 0.02), "velocity [mm/s]");
        assert_eq!(scaled("damage [-]", 1.0), "damage [-]");
        assert_eq!(scaled("damage [-]", 2e-4), "damage [10⁻⁶]");
        assert_eq!(scaled("energy density [kg/m³]", 2e6), "energy density [10⁶ kg/m³]");
        assert_eq!(scaled("error", 2e-5), "error [10⁻⁶]");
        assert_eq!(scaled_label("u [m]", 2e-5), ("u [µm]".to_owned(), 1e6));
    }
}
