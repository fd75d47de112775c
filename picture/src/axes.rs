//! What surrounds the data in pictures and plots: axes with ticks, the colour bar, the heading.

use super::canvas::{Align, Area, BLACK, Color, GREY, Image, Lettering, PALE, shortened, text_width, wrapped};
use super::ticks::{Axis, Ticks};

/// Sizes of everything that is not data, in pixels, in proportion to the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measure {
    pub unit: f64,
}

impl Measure {
    /// For a picture of this width. At 1000 pixels the unit is one; below, letters
    /// shrink less than the picture, to stay readable.
    pub fn new(width: f64) -> Self {
        Self { unit: 0.35 + 0.65e-3 * width }
    }

    pub fn title(self) -> f64 {
        21.0 * self.unit
    }

    pub fn label(self) -> f64 {
        18.0 * self.unit
    }

    pub fn number(self) -> f64 {
        15.5 * self.unit
    }

    /// Free space at the edge of the picture.
    pub fn margin(self) -> f64 {
        18.0 * self.unit
    }

    pub fn tick(self) -> f64 {
        6.0 * self.unit
    }

    /// Between an axis and its numbers, and between numbers and label.
    pub fn gap(self) -> f64 {
        9.0 * self.unit
    }

    pub fn hairline(self) -> f64 {
        (1.2 * self.unit).round().max(1.0)
    }

    /// The height below an axis that its numbers and label take.
    pub fn below_axis(self) -> f64 {
        self.tick() + 0.6 * self.gap() + self.number() + 0.6 * self.gap() + self.label()
    }

    /// The width beside an axis that its numbers and label take.
    pub fn beside_axis(self, ticks: &Ticks) -> f64 {
        self.tick() + self.gap() + widest(ticks, self.number()) + self.gap() + self.label()
    }

    pub fn lettering(self, size: f64, align: Align) -> Lettering {
        Lettering { size, color: BLACK, align }
    }
}

fn widest(ticks: &Ticks, size: f64) -> f64 {
    ticks.labels.iter().map(|(_, label)| text_width(label, size)).fold(0.0, f64::max)
}

/// How many labels fit beside an axis of this length without crowding.
pub(super) fn label_count(length: f64, measure: Measure, room: f64) -> usize {
    ((length / (room * measure.unit)) as usize).clamp(2, 9)
}

/// One axis: its values, its ticks, its label.
pub(super) struct Side {
    pub axis: Axis,
    pub ticks: Ticks,
    pub label: String,
}

impl Side {
    /// Labels that would run into each other are left out, every second or third one.
    fn spaced_labels(&self, length: f64, measure: Measure) -> Vec<&(f64, String)> {
        let labels = &self.ticks.labels;
        let need = widest(&self.ticks, measure.number()) + 14.0 * measure.unit;
        let distance = match labels.as_slice() {
            [first, .., last] => {
                let share = self.axis.share(last.0) - self.axis.share(first.0);
                share.abs() * length / (labels.len() - 1) as f64
            }
            _ => length,
        };
        let every = (need / distance.max(1.0)).ceil().max(1.0) as usize;
        labels.iter().step_by(every).collect()
    }
}

/// Draws pale lines through the data area at the labelled ticks.
pub(super) fn draw_grid(image: &mut Image, area: Area, x: &Side, y: &Side, measure: Measure) {
    let width = measure.hairline();
    for (value, _) in &x.ticks.labels {
        let at = (area.left + x.axis.share(*value) * area.width()).round();
        image.line([at, area.top], [at, area.bottom], width, PALE, area);
    }
    for (value, _) in &y.ticks.labels {
        let at = (area.bottom - y.axis.share(*value) * area.height()).round();
        image.line([area.left, at], [area.right, at], width, PALE, area);
    }
}

/// Draws the outline of the data area with ticks, numbers and labels at its left and lower edge.
pub(super) fn draw_axes(image: &mut Image, area: Area, x: &Side, y: &Side, measure: Measure) {
    draw_lower_axis(image, area, x, measure);
    let half = 0.5 * measure.hairline();
    let height_of = |value: f64| (area.bottom - y.axis.share(value) * area.height()).round();
    let mut mark = |at: f64, length: f64| {
        let tick = Area { left: area.left - length, top: at - half, right: area.left, bottom: at + half };
        image.fill(tick, BLACK);
    };
    for value in &y.ticks.minor {
        mark(height_of(*value), 0.5 * measure.tick());
    }
    for (value, _) in &y.ticks.labels {
        mark(height_of(*value), measure.tick());
    }
    let number = measure.lettering(measure.number(), Align::End);
    let right = area.left - measure.tick() - 0.6 * measure.gap();
    for (value, label) in &y.ticks.labels {
        image.text([right, height_of(*value)], label, number);
    }
    let column = area.left - measure.beside_axis(&y.ticks) + 0.5 * measure.label();
    write_upwards(image, column, area, &y.label, measure);
    image.outline(area, measure.hairline(), BLACK);
}

fn draw_lower_axis(image: &mut Image, area: Area, x: &Side, measure: Measure) {
    let half = 0.5 * measure.hairline();
    let column_of = |value: f64| (area.left + x.axis.share(value) * area.width()).round();
    let mut mark = |at: f64, length: f64| {
        let tick = Area { left: at - half, top: area.bottom, right: at + half, bottom: area.bottom + length };
        image.fill(tick, BLACK);
    };
    for value in &x.ticks.minor {
        mark(column_of(*value), 0.5 * measure.tick());
    }
    let labels = x.spaced_labels(area.width(), measure);
    for (value, _) in &labels {
        mark(column_of(*value), measure.tick());
    }
    let number = measure.lettering(measure.number(), Align::Middle);
    let row = area.bottom + measure.tick() + 0.6 * measure.gap() + 0.5 * measure.number();
    for (value, label) in labels {
        image.text([column_of(*value), row], label, number);
    }
    let row = area.bottom + measure.below_axis() - 0.5 * measure.label();
    let label = shortened(&x.label, measure.label(), image.width as f64);
    let half_width = 0.5 * text_width(&label, measure.label());
    let centre = kept_inside(0.5 * (area.left + area.right), half_width, image.width as f64);
    let lettering = measure.lettering(measure.label(), Align::Middle);
    image.text([centre, row], &label, lettering);
}

fn write_upwards(image: &mut Image, column: f64, area: Area, text: &str, measure: Measure) {
    let height = image.height as f64;
    let text = shortened(text, measure.label(), height);
    let half = 0.5 * text_width(&text, measure.label());
    let centre = kept_inside(0.5 * (area.top + area.bottom), half, height);
    let lettering = measure.lettering(measure.label(), Align::Middle);
    image.text_upwards([column, centre], &text, lettering);
}

/// The centre, moved so that something of this half width stays within `0..length`.
fn kept_inside(centre: f64, half: f64, length: f64) -> f64 {
    centre.min(length - half).max(half)
}

/// Where a colour bar stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BarPlace {
    /// Upright, its numbers to the right.
    Beside,
    /// Lying, its numbers below.
    Below,
}

/// Draws a colour bar: `colors` from low to high along `area`, with numbers and label.
pub(super) fn draw_color_bar(
    image: &mut Image,
    area: Area,
    place: BarPlace,
    colors: &[Color],
    side: &Side,
    measure: Measure,
) {
    let color_at = |share: f64| {
        let i = (share * colors.len() as f64) as usize;
        colors.get(i).or(colors.last()).copied().unwrap_or(GREY)
    };
    match place {
        BarPlace::Below => {
            let columns = area.width().round() as usize;
            for i in 0..columns {
                let left = area.left.round() + i as f64;
                let strip = Area { left, right: left + 1.0, ..area };
                image.fill(strip, color_at((i as f64 + 0.5) / columns as f64));
            }
            draw_lower_axis(image, area, side, measure);
        }
        BarPlace::Beside => {
            let rows = area.height().round() as usize;
            for i in 0..rows {
                let top = area.top.round() + i as f64;
                let strip = Area { top, bottom: top + 1.0, ..area };
                image.fill(strip, color_at(1.0 - (i as f64 + 0.5) / rows as f64));
            }
            let half = 0.5 * measure.hairline();
            let number = measure.lettering(measure.number(), Align::Start);
            for (value, label) in &side.ticks.labels {
                let at = (area.bottom - side.axis.share(*value) * area.height()).round();
                let tick =
                    Area { left: area.right, top: at - half, right: area.right + measure.tick(), bottom: at + half };
                image.fill(tick, BLACK);
                let left = tick.right + 0.6 * measure.gap();
                image.text([left, at], label, number);
            }
            let column = area.right + measure.beside_axis(&side.ticks) - 0.5 * measure.label();
            write_upwards(image, column, area, &side.label, measure);
        }
    }
    image.outline(area, measure.hairline(), BLACK);
}

/// A title in as many lines as it needs (two at most), and a word such as the time at its right.
pub(super) struct Heading {
    lines: Vec<String>,
    corner: String,
}

impl Heading {
    pub fn new(title: &str, corner: &str, width: f64, measure: Measure) -> Self {
        let size = measure.title();
        let corner = shortened(corner, size, width);
        let beside = text_width(&corner, size) + if corner.is_empty() { 0.0 } else { 1.5 * size };
        let room = (width - beside).max(0.4 * width);
        let mut lines = wrapped(title, size, room);
        if lines.len() > 2 {
            let rest = lines.split_off(1).join(" ");
            lines.push(shortened(&rest, size, room));
        }
        Self { lines, corner }
    }

    pub fn height(&self, measure: Measure) -> f64 {
        let lines = self.lines.len().max(usize::from(!self.corner.is_empty()));
        lines as f64 * 1.35 * measure.title() + if lines > 0 { measure.gap() } else { 0.0 }
    }

    pub fn draw(&self, image: &mut Image, left: f64, right: f64, measure: Measure) {
        let size = measure.title();
        let row = |line: f64| measure.margin() + (0.55 + 1.35 * line) * size;
        for (i, line) in self.lines.iter().enumerate() {
            let lettering = measure.lettering(size, Align::Start);
            image.text([left, row(i as f64)], line, lettering);
        }
        let lettering = measure.lettering(size, Align::End);
        image.text([right, row(0.0)], &self.corner, lettering);
    }
}
