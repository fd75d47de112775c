//! Line plots for studies: a quantity over time, an error over the spacing.
//!
//! A plot is a value; drawing it gives an [`Image`]. The legend stands between
//! title and axes, where it never covers data. Absent on purpose: second axes,
//! fits, error bars.

use super::axes::{Heading, Measure, Side, draw_axes, draw_grid, label_count};
use super::canvas::{Align, Area, Color, GREY, Image, WHITE, shortened, text_width, wrapped};
use super::ticks::{Axis, drawable, scaled_label, span, widened};

pub use super::canvas::write_png;

/// A plot of one or more series over common axes.
///
/// ```
/// use bondwise_picture::plot::{Plot, Series, Style, draw_plot};
/// let plot = Plot {
///     title: "Convergence".into(),
///     x_label: "spacing [m]".into(),
///     y_label: "error [-]".into(),
///     log_x: true,
///     log_y: true,
///     series: vec![Series {
///         name: "standard".into(),
///         points: vec![(1e-2, 3e-2), (5e-3, 1.4e-2), (2.5e-3, 7e-3)],
///         style: Style::LineDots,
///     }],
///     ..Plot::default()
/// };
/// let image = draw_plot(&plot, 900, 600);
/// assert_eq!((image.width, image.height), (900, 600));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plot {
    pub title: String,
    /// A unit in brackets takes SI prefixes: "x \[m\]" may be drawn as "x \[mm\]".
    pub x_label: String,
    pub y_label: String,
    /// Values that are not positive are left out on a logarithmic axis.
    pub log_x: bool,
    pub log_y: bool,
    /// Lowest and highest value of the axis; `None` fits the data.
    pub x_range: Option<(f64, f64)>,
    pub y_range: Option<(f64, f64)>,
    pub series: Vec<Series>,
    /// Lines of small text below the axes.
    pub notes: Vec<String>,
}

/// Points that belong together. A point with NaN interrupts the line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Stands in the legend, unless it is empty.
    pub name: String,
    pub points: Vec<(f64, f64)>,
    pub style: Style,
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    #[default]
    Line,
    Dots,
    LineDots,
    Dashed,
}

/// Colours of the series in their order: Okabe and Ito, "Color universal design"
/// (2008), which people with any colour vision tell apart; without its yellow,
/// too pale on white.
const PALETTE: [Color; 7] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [230, 159, 0], [86, 180, 233], [40, 40, 40]];

/// The size of an image is brought into this range: smaller ones hold no text,
/// larger ones exhaust the memory.
pub(super) const PIXELS: (usize, usize) = (120, 8192);

/// Draws a plot of `width` by `height` pixels (each from 120 to 8192).
pub fn draw_plot(plot: &Plot, width: usize, height: usize) -> Image {
    let width = width.clamp(PIXELS.0, PIXELS.1);
    let height = height.clamp(PIXELS.0, PIXELS.1);
    let mut image = Image::white(width, height);
    let (width, height) = (width as f64, height as f64);
    let measure = Measure::new(width.min(1.5 * height));
    let text_width = width - 2.0 * measure.margin();

    let heading = Heading::new(&plot.title, "", text_width, measure);
    let legend = Legend::new(plot, text_width, measure);
    let notes: Vec<String> = plot.notes.iter().flat_map(|note| wrapped(note, measure.number(), text_width)).collect();
    let note_line = 1.45 * measure.number();

    let top = measure.margin() + heading.height(measure) + legend.height(measure);
    let foot = measure.margin() + notes.len() as f64 * note_line;
    let below = foot + measure.below_axis() + if notes.is_empty() { 0.0 } else { 1.5 * measure.gap() };
    let bottom = (height - below).max(top + 0.2 * height).min(height - 1.0);
    let top = top.min(bottom - 1.0);

    let y_count = label_count(bottom - top, measure, 60.0);
    let y = side(&plot.y_label, y_values(plot), plot.log_y, plot.y_range, y_count);
    let left = measure.margin() + measure.beside_axis(&y.ticks);
    let left = left.min(0.6 * width);
    let right = width - measure.margin() - 0.5 * measure.label();
    let x_count = label_count(right - left, measure, 90.0);
    let x = side(&plot.x_label, x_values(plot), plot.log_x, plot.x_range, x_count);
    let area = Area { left: left.round(), top: top.round(), right: right.round(), bottom: bottom.round() };

    draw_grid(&mut image, area, &x, &y, measure);
    for (number, series) in plot.series.iter().enumerate() {
        let place = |&(a, b): &(f64, f64)| {
            let (a, b) = (x.axis.share(a), y.axis.share(b));
            let at = [area.left + a * area.width(), area.bottom - b * area.height()];
            // Not finite: NaN, or not positive on a logarithmic axis.
            at.iter().all(|c| c.is_finite()).then_some(at)
        };
        let points: Vec<Option<[f64; 2]>> = series.points.iter().map(place).collect();
        draw_series(&mut image, &points, area, number, series.style, measure);
    }
    draw_axes(&mut image, area, &x, &y, measure);
    heading.draw(&mut image, measure.margin(), width - measure.margin(), measure);
    legend.draw(&mut image, measure.margin() + heading.height(measure), measure);
    let mut lettering = measure.lettering(measure.number(), Align::Start);
    lettering.color = GREY;
    for (i, note) in notes.iter().enumerate() {
        let row = height - foot + (i as f64 + 0.5) * note_line;
        image.text([measure.margin(), row], note, lettering);
    }
    image
}

fn x_values(plot: &Plot) -> impl Iterator<Item = f64> {
    drawn_points(plot).map(|point| point.0)
}

fn y_values(plot: &Plot) -> impl Iterator<Item = f64> {
    drawn_points(plot).map(|point| point.1)
}

/// A point of which one number cannot be drawn says nothing about the other axis either.
fn drawn_points(plot: &Plot) -> impl Iterator<Item = (f64, f64)> {
    let fits = |value: f64, logarithmic: bool| drawable(value) && !(logarithmic && value <= 0.0);
    plot.series
        .iter()
        .flat_map(|series| series.points.iter().copied())
        .filter(move |point| fits(point.0, plot.log_x) && fits(point.1, plot.log_y))
}

fn side(
    label: &str,
    values: impl Iterator<Item = f64>,
    logarithmic: bool,
    range: Option<(f64, f64)>,
    count: usize,
) -> Side {
    let fixed = range
        .map(|(a, b)| [a.min(b), a.max(b)])
        .filter(|[low, high]| drawable(*low) && drawable(*high) && low < high)
        .filter(|[low, _]| !logarithmic || *low > 0.0);
    if logarithmic {
        let axis = logarithmic_axis(fixed, values);
        let ticks = axis.ticks(count, 1.0);
        let label = label.to_owned();
        return Side { axis, ticks, label };
    }
    let [low, high] = fixed.unwrap_or_else(|| {
        let [low, high] = widened(span(values).unwrap_or([0.0, 1.0]));
        let padding = 0.04 * (high - low);
        [low - padding, high + padding]
    });
    let (label, factor) = scaled_label(label, low.abs().max(high.abs()));
    let axis = Axis::linear([low, high]);
    let ticks = axis.ticks(count, factor);
    Side { axis, ticks, label }
}

fn logarithmic_axis(fixed: Option<[f64; 2]>, values: impl Iterator<Item = f64>) -> Axis {
    let [low, high] = fixed.unwrap_or_else(|| {
        // Floor and ceiling keep the padded ends and their powers of ten within f64.
        let [low, high] = span(values).unwrap_or([1.0, 10.0]).map(|v| v.clamp(1e-280, 1e280));
        let padding = (0.05 * (high / low).log10()).max(0.1);
        [low * 10_f64.powf(-padding), high * 10_f64.powf(padding)]
    });
    Axis { low, high, logarithmic: true }
}

fn draw_series(
    image: &mut Image,
    points: &[Option<[f64; 2]>],
    area: Area,
    number: usize,
    style: Style,
    measure: Measure,
) {
    let color = PALETTE[number % PALETTE.len()];
    let width = 2.4 * measure.unit;
    let segments = points.windows(2).filter_map(|pair| Some([pair[0]?, pair[1]?]));
    match style {
        Style::Line | Style::LineDots => {
            for [from, to] in segments {
                image.line(from, to, width, color, area);
            }
        }
        Style::Dashed => {
            let mut walked = 0.0;
            for [from, to] in segments {
                walked = dash(image, [from, to], walked, color, area, measure);
            }
        }
        Style::Dots => {}
    }
    let alone = |i: usize| {
        let missing = |j: Option<usize>| j.and_then(|j| *points.get(j)?).is_none();
        missing(i.checked_sub(1)) && missing(Some(i + 1))
    };
    let slack = 0.5; // pixels, for points on the edge of the area
    for (i, point) in points.iter().enumerate() {
        let Some(at) = *point else { continue };
        let inside = (area.left - slack..=area.right + slack).contains(&at[0])
            && (area.top - slack..=area.bottom + slack).contains(&at[1]);
        // A single point has no line to show it.
        if inside && (matches!(style, Style::Dots | Style::LineDots) || alone(i)) {
            draw_marker(image, at, number, measure);
        }
    }
}

/// Full and hollow discs by turns, so that neighbours in the palette differ in shape too.
fn draw_marker(image: &mut Image, at: [f64; 2], number: usize, measure: Measure) {
    image.disc(at, 5.0 * measure.unit, PALETTE[number % PALETTE.len()]);
    if number % 2 == 1 {
        image.disc(at, 2.6 * measure.unit, WHITE);
    }
}

/// Draws the dashes of one segment; `walked` is the length of line before it, after it on return.
fn dash(image: &mut Image, [from, to]: [[f64; 2]; 2], walked: f64, color: Color, area: Area, measure: Measure) -> f64 {
    let (on, off) = (9.0 * measure.unit, 7.0 * measure.unit);
    let period = on + off;
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    // A segment that leaves the picture by far would be walked for very long.
    if !(length > 0.0 && length < 1e5) {
        image.line(from, to, measure.unit, color, area);
        return walked;
    }
    let at = |share: f64| [0, 1].map(|k| from[k] + share.clamp(0.0, 1.0) * (to[k] - from[k]));
    let mut start = -(walked % period);
    while start < length {
        if start + on > 0.0 {
            let ends = [at(start / length), at((start + on) / length)];
            image.line(ends[0], ends[1], 2.0 * measure.unit, color, area);
        }
        start += period;
    }
    (walked + length) % period
}

/// Names of the series in rows, each after a sample of its line.
struct Legend {
    /// Row, left end, name, number of the series, style.
    entries: Vec<(usize, f64, String, usize, Style)>,
}

impl Legend {
    fn new(plot: &Plot, width: f64, measure: Measure) -> Self {
        let size = measure.number();
        let (mut row, mut left) = (0, 0.0);
        let mut entries = Vec::new();
        for (number, series) in plot.series.iter().enumerate() {
            if series.name.trim().is_empty() {
                continue;
            }
            let sample = Self::sample(measure) + measure.gap();
            let name = shortened(&series.name, size, width - sample);
            let taken = sample + text_width(&name, size);
            if left > 0.0 && left + taken > width {
                row += 1;
                left = 0.0;
            }
            entries.push((row, left, name, number, series.style));
            left += taken + 24.0 * measure.unit;
        }
        Self { entries }
    }

    fn sample(measure: Measure) -> f64 {
        34.0 * measure.unit
    }

    fn row_height(measure: Measure) -> f64 {
        1.6 * measure.number()
    }

    fn height(&self, measure: Measure) -> f64 {
        let rows = self.entries.last().map_or(0, |entry| entry.0 + 1);
        rows as f64 * Self::row_height(measure) + if rows > 0 { measure.gap() } else { 0.0 }
    }

    fn draw(&self, image: &mut Image, top: f64, measure: Measure) {
        let all = Area { left: 0.0, top: 0.0, right: image.width as f64, bottom: image.height as f64 };
        let lettering = measure.lettering(measure.number(), Align::Start);
        for (row, left, name, number, style) in &self.entries {
            let left = measure.margin() + left;
            let right = left + Self::sample(measure);
            let height = top + (*row as f64 + 0.5) * Self::row_height(measure);
            match style {
                Style::Dots => {}
                _ => {
                    let ends = [Some([left, height]), Some([right, height])];
                    let line = if *style == Style::Dashed { *style } else { Style::Line };
                    draw_series(image, &ends, all, *number, line, measure);
                }
            }
            if matches!(style, Style::Dots | Style::LineDots) {
                draw_marker(image, [0.5 * (left + right), height], *number, measure);
            }
            image.text([right + measure.gap(), height], name, lettering);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(points: Vec<(f64, f64)>, style: Style) -> Plot {
        Plot {
            x_label: "x".into(),
            y_label: "y".into(),
            series: vec![Series { points, style, ..Series::default() }],
            ..Plot::default()
        }
    }

    /// Pixels that are rather this colour than white.
    fn count(image: &Image, color: Color) -> usize {
        let far = |pixel: &Color| -> u32 {
            let each = pixel.iter().zip(color);
            each.map(|(a, b)| u32::from(a.abs_diff(b))).sum()
        };
        image.pixels.iter().filter(|pixel| far(pixel) < 120).count()
    }

    #[test]
    fn no_data_and_no_size_stop_a_plot_from_being_drawn() {
        let bad =
            [0.0, -0.0, 1.0, -1.0, 5e-324, 1e-300, f64::MAX, f64::MIN, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        let all: Vec<_> = bad.iter().flat_map(|&a| bad.map(|b| (a, b))).collect();
        let one_each = all.iter().step_by(3).map(|point| vec![*point]);
        let cases = one_each.chain([vec![], all.clone(), vec![(1.0, 1.0); 3]]);
        for (i, points) in cases.enumerate() {
            for log in [false, true] {
                let style = [Style::Line, Style::Dots, Style::LineDots, Style::Dashed][i % 4];
                let mut plot = plot(points.clone(), style);
                (plot.log_x, plot.log_y) = (log, log);
                draw_plot(&plot, 200, 140);
            }
        }
        for range in [(f64::NAN, 1.0), (1.0, 0.0), (2.0, 2.0), (-1.0, f64::MAX)] {
            let mut plot = plot(all.clone(), Style::Dashed);
            plot.x_range = Some(range);
            plot.y_range = Some(range);
            plot.log_y = true;
            plot.title = "a very long title ".repeat(40);
            plot.notes = vec!["note ".repeat(300); 9];
            plot.series[0].name = "name".repeat(100);
            draw_plot(&plot, 200, 140);
        }
        assert_eq!(draw_plot(&Plot::default(), 0, 0).width, PIXELS.0);
    }

    #[test]
    fn a_point_in_the_middle_of_its_ranges_is_drawn_in_the_middle_of_the_axes() {
        for (log, range, middle) in [(false, (0.0, 2.0), 1.0), (true, (1e-4, 1e4), 1.0)] {
            let mut plot = plot(vec![(middle, middle)], Style::Dots);
            (plot.log_x, plot.log_y) = (log, log);
            (plot.x_range, plot.y_range) = (Some(range), Some(range));
            let image = draw_plot(&plot, 600, 400);
            let is_ink = |i: &usize| image.pixels[*i] == PALETTE[0];
            let ink: Vec<usize> = (0..600 * 400).filter(is_ink).collect();
            let centre_x = ink.iter().map(|i| i % 600).sum::<usize>() as f64 / ink.len() as f64;
            // The frame: the longest run of dark pixels in the row of the point.
            let row = ink[ink.len() / 2] / 600;
            let dark: Vec<usize> = (0..600).filter(|x| image.pixels[row * 600 + x] == crate::canvas::BLACK).collect();
            let (left, right) = (dark[dark.len() - 2], dark[dark.len() - 1]);
            let centre = 0.5 * (left + right) as f64;
            assert!((centre_x - centre).abs() < 2.0, "{centre_x} {left} {right}");
        }
    }

    #[test]
    fn nan_interrupts_a_line_and_a_dashed_line_has_less_ink() {
        let line: Vec<_> = (0..=100).map(|i| (f64::from(i), 1.0)).collect();
        let whole = count(&draw_plot(&plot(line.clone(), Style::Line), 600, 400), PALETTE[0]);
        let dashed = count(&draw_plot(&plot(line.clone(), Style::Dashed), 600, 400), PALETTE[0]);
        let mut broken = line;
        for point in &mut broken[30..70] {
            point.1 = f64::NAN;
        }
        let broken = count(&draw_plot(&plot(broken, Style::Line), 600, 400), PALETTE[0]);
        assert!(broken < whole * 7 / 10 && broken > whole / 2, "{broken} of {whole}");
        assert!(dashed < whole * 8 / 10 && dashed > 0, "{dashed} of {whole}");
    }

    #[test]
    fn series_have_different_colours() {
        let mut plot = plot(vec![(0.0, 0.0), (1.0, 0.0)], Style::Line);
        plot.series.push(Series { points: vec![(0.0, 1.0), (1.0, 1.0)], ..Series::default() });
        let image = draw_plot(&plot, 600, 400);
        assert!(count(&image, PALETTE[0]) > 100 && count(&image, PALETTE[1]) > 100);
    }
}
