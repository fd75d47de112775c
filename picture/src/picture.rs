//! Pictures of a point cloud, coloured by one field, without any viewer.
//!
//! In one dimension the field is drawn over the position. In two each point is a
//! square of its spacing, so that a lattice fills its shape and a crack shows as
//! a line or a gap. In three each point is a small cube, seen from where
//! [`View`] says. The same input gives the same pixels on every machine.

use super::axes::{BarPlace, Heading, Measure, Side, draw_axes, draw_color_bar, label_count};
use super::canvas::{Align, Area, WHITE};
use super::plot::{PIXELS, Plot, Series, Style, draw_plot};
use super::solid;
use super::ticks::{Axis, drawable, quantity, scaled_label, span, widened};

pub use super::canvas::{Color, Image, write_animation, write_png};

/// How a picture is to look.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width in pixels, from 120 to 4096; the height follows from the cloud.
    pub width: u32,
    pub title: String,
    /// What the colours mean, with the unit in brackets: "damage \[-\]".
    pub label: String,
    /// Values of the first and last colour; `None` takes those of the field.
    pub range: Option<(f64, f64)>,
    pub color_map: ColorMap,
    /// From where a three-dimensional cloud is seen.
    pub view: View,
    /// Low and high corner \[m\] of what is shown; `None` fits the cloud. Give it
    /// where pictures of several frames are to have one scale.
    pub bounds: Option<[[f64; 3]; 2]>,
}

impl Default for Picture {
    fn default() -> Self {
        Self {
            width: 1000,
            title: String::new(),
            label: String::new(),
            range: None,
            color_map: ColorMap::default(),
            view: View::default(),
            bounds: None,
        }
    }
}

/// A scale of colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorMap {
    #[default]
    Viridis,
    Turbo,
    Inferno,
    /// Blue, white, red, for fields with a sign: without a given range, white is zero.
    Diverging,
}

/// A direction of sight, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Of the viewer around the z axis, counted from the x axis.
    pub azimuth: f64,
    /// Of the viewer above the x-y plane.
    pub elevation: f64,
}

impl Default for View {
    fn default() -> Self {
        Self { azimuth: -60.0, elevation: 30.0 }
    }
}

/// What a picture shows.
#[derive(Clone, Copy, Debug)]
pub struct CloudView<'a> {
    /// \[m\], already deformed. Points that are not finite are left out.
    pub positions: &'a [[f64; 3]],
    pub sizes: Sizes<'a>,
    /// One per position; NaN, or a missing one, is drawn grey.
    pub values: &'a [f64],
    /// 1, 2 or 3.
    pub dimension: usize,
}

/// The edge \[m\] of the square or cube that stands for a point: its spacing.
#[derive(Clone, Copy, Debug)]
pub enum Sizes<'a> {
    Same(f64),
    Each(&'a [f64]),
}

impl Sizes<'_> {
    /// The size of one point; zero, which is drawn as one pixel, if none was given.
    pub(super) fn at(&self, i: usize) -> f64 {
        let size = match self {
            Self::Same(size) => *size,
            Self::Each(sizes) => sizes.get(i).copied().unwrap_or(0.0),
        };
        if drawable(size) { size.max(0.0) } else { 0.0 }
    }
}

/// Draws a cloud; `time` \[s\] is written beside the title.
pub fn draw(picture: &Picture, cloud: &CloudView<'_>, time: Option<f64>) -> Image {
    match cloud.dimension {
        0 | 1 => draw_line(picture, cloud, time),
        2 => draw_plane(picture, cloud, time),
        _ => draw_solid(picture, cloud, time),
    }
}

fn draw_line(picture: &Picture, cloud: &CloudView<'_>, time: Option<f64>) -> Image {
    let mut points: Vec<(f64, f64)> = cloud
        .positions
        .iter()
        .zip(cloud.values)
        .map(|(position, value)| (position[0], *value))
        .filter(|point| drawable(point.0))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let dots = points.len() <= 60;
    let plot = Plot {
        title: [picture.title.clone(), said(time)]
            .into_iter()
            .filter(|part| !part.is_empty())
            .collect::<Vec<_>>()
            .join(",  "),
        x_label: "x [m]".to_owned(),
        y_label: picture.label.clone(),
        x_range: picture.bounds.map(|[low, high]| (low[0], high[0])),
        y_range: picture.range,
        series: vec![Series { name: String::new(), points, style: if dots { Style::LineDots } else { Style::Line } }],
        ..Plot::default()
    };
    let width = width_of(picture) as usize;
    draw_plot(&plot, width, width / 2)
}

fn draw_plane(picture: &Picture, cloud: &CloudView<'_>, time: Option<f64>) -> Image {
    let scale = ColorScale::new(picture, cloud.values);
    let [low, high] = picture.bounds.and_then(ordered).unwrap_or_else(|| {
        let at = |k: usize, sign: f64| {
            let edge = move |(i, x): (usize, &[f64; 3])| x[k] + sign * 0.5 * cloud.sizes.at(i);
            span(cloud.positions.iter().enumerate().map(edge))
        };
        let range = |k: usize| match (at(k, -1.0), at(k, 1.0)) {
            (Some([low, _]), Some([_, high])) => [low, high],
            _ => [0.0, 1.0],
        };
        let [x, y] = [range(0), range(1)];
        let padding = 0.02 * (x[1] - x[0]).max(y[1] - y[0]);
        let ends = |sign: usize, shift: f64| [x[sign] + shift, y[sign] + shift, 0.0];
        [ends(0, -padding), ends(1, padding)]
    });
    let x_range = widened([low[0], high[0]]);
    let y_range = widened([low[1], high[1]]);
    let extent = [x_range[1] - x_range[0], y_range[1] - y_range[0]];

    let centre = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
    let size = centre[0].abs().max(centre[1].abs()) + 0.5 * extent[0].max(extent[1]);
    let laid_out = |beside: f64| {
        let measure = Measure::new(width_of(picture));
        let page = Page::new(picture, time, extent, &scale, beside, measure.below_axis());
        let side = |k: usize, name: &str, length: f64, room: f64| {
            let (label, factor) = scaled_label(&format!("{name} [m]"), size);
            let half = 0.5 * length / page.pixels_per_length;
            let axis = Axis::linear([centre[k] - half, centre[k] + half]);
            let ticks = axis.ticks(label_count(length, measure, room), factor);
            Side { axis, ticks, label }
        };
        let x = side(0, "x", page.area.width(), 80.0);
        let y = side(1, "y", page.area.height(), 45.0);
        (page, x, y)
    };
    // The numbers beside the axis take room, which changes the area and so the
    // numbers: the second round knows how wide they are.
    let (page, _, y) = laid_out(0.0);
    let (page, x, y) = laid_out(page.measure.beside_axis(&y.ticks));

    let mut image = Image::white(page.width, page.height);
    let squares = Squares {
        columns: 2 * page.area.width() as usize,
        rows: 2 * page.area.height() as usize,
        left: x.axis.low,
        top: y.axis.high,
        per_length: 2.0 * page.pixels_per_length,
    };
    paste_halved(&mut image, page.area, &squares.painted(cloud, &scale));
    draw_axes(&mut image, page.area, &x, &y, page.measure);
    page.say_if_empty(&mut image, cloud);
    page.draw_surroundings(&mut image, &scale);
    image
}

fn draw_solid(picture: &Picture, cloud: &CloudView<'_>, time: Option<f64>) -> Image {
    let scale = ColorScale::new(picture, cloud.values);
    let sight = solid::Sight::new(picture.view);
    let shown = sight.extent(cloud, picture.bounds.and_then(ordered));
    let extent = [shown[0][1] - shown[0][0], shown[1][1] - shown[1][0]];
    let below = sight.triad_height(Measure::new(width_of(picture)));
    let page = Page::new(picture, time, extent, &scale, 0.0, below);
    let mut image = Image::white(page.width, page.height);
    let screen = solid::Screen {
        columns: 2 * page.area.width() as usize,
        rows: 2 * page.area.height() as usize,
        centre: shown.map(|[low, high]| 0.5 * (low + high)),
        per_length: 2.0 * page.pixels_per_length,
    };
    let pixels = solid::painted(&sight, &screen, cloud, &scale);
    paste_halved(&mut image, page.area, &pixels);
    page.say_if_empty(&mut image, cloud);
    let strip = Area { top: page.area.bottom, bottom: page.area.bottom + below, ..page.area };
    solid::draw_triad(&mut image, &sight, strip, page.measure);
    solid::draw_length(&mut image, strip, page.pixels_per_length, page.measure);
    page.draw_surroundings(&mut image, &scale);
    image
}

/// Drawn at twice the resolution, with depths, this takes a gigabyte.
const WIDEST: usize = 4096;

fn width_of(picture: &Picture) -> f64 {
    (picture.width as usize).clamp(PIXELS.0, WIDEST) as f64
}

fn said(time: Option<f64>) -> String {
    time.map_or_else(String::new, |time| format!("t = {}", quantity(time, "s")))
}

/// The corners, low ones first; `None` if a coordinate cannot be drawn.
fn ordered([a, b]: [[f64; 3]; 2]) -> Option<[[f64; 3]; 2]> {
    let all = a.iter().chain(&b).all(|coordinate| drawable(*coordinate));
    let corner = |pick: fn(f64, f64) -> f64| std::array::from_fn(|k| pick(a[k], b[k]));
    all.then(|| [corner(f64::min), corner(f64::max)])
}

/// Where everything stands on the picture.
struct Page {
    width: usize,
    height: usize,
    measure: Measure,
    heading: Heading,
    /// Of the data.
    area: Area,
    pixels_per_length: f64,
    bar: Area,
    bar_place: BarPlace,
    bar_side: Side,
}

impl Page {
    /// * `extent`: width and height of the data \[m\].
    /// * `beside`, `below`: pixels left free for axes.
    fn new(
        picture: &Picture,
        time: Option<f64>,
        extent: [f64; 2],
        scale: &ColorScale,
        beside: f64,
        below: f64,
    ) -> Self {
        let width = width_of(picture);
        let measure = Measure::new(width);
        let margin = measure.margin();
        let heading = Heading::new(&picture.title, &said(time), width - 2.0 * margin, measure);
        let bar_side = scale.side(&picture.label);
        let thickness = 20.0 * measure.unit;
        // Beside a flat area an upright bar would be too short to read.
        let bar_place = if extent[0] > 2.6 * extent[1] { BarPlace::Below } else { BarPlace::Beside };
        let right = match bar_place {
            BarPlace::Below => 0.5 * measure.label(),
            BarPlace::Beside => thickness + 1.1 * thickness + measure.beside_axis(&bar_side.ticks),
        };
        let room = (width - 2.0 * margin - beside - right).max(0.2 * width);
        let tallest = 0.95 * width;
        let pixels_per_length = (room / extent[0]).min(tallest / extent[1]);
        let across = (extent[0] * pixels_per_length).clamp(0.3 * room, room).floor();
        let upright = (extent[1] * pixels_per_length).clamp(0.08 * width, tallest).floor();
        let left = (margin + beside + 0.5 * (room - across)).floor();
        let top = (margin + heading.height(measure)).floor();
        let area = Area { left, top, right: left + across, bottom: top + upright };
        let (bar, end) = match bar_place {
            BarPlace::Below => {
                let top = area.bottom + below + 1.2 * measure.label();
                let bar = Area {
                    left: (area.left + 0.15 * across).round(),
                    top: top.round(),
                    right: (area.right - 0.15 * across).round(),
                    bottom: (top + thickness).round(),
                };
                (bar, bar.bottom + measure.below_axis())
            }
            BarPlace::Beside => {
                let bar = Area {
                    left: (area.right + 1.1 * thickness).round(),
                    right: (area.right + 2.1 * thickness).round(),
                    ..area
                };
                (bar, area.bottom + below)
            }
        };
        Self {
            width: width as usize,
            height: (end + margin).ceil() as usize,
            measure,
            heading,
            area,
            pixels_per_length,
            bar,
            bar_place,
            bar_side,
        }
    }

    fn say_if_empty(&self, image: &mut Image, cloud: &CloudView<'_>) {
        if cloud.positions.is_empty() {
            let lettering = self.measure.lettering(self.measure.label(), Align::Middle);
            let area = self.area;
            let centre = [0.5 * (area.left + area.right), 0.5 * (area.top + area.bottom)];
            image.text(centre, "no points", lettering);
        }
    }

    fn draw_surroundings(&self, image: &mut Image, scale: &ColorScale) {
        let measure = self.measure;
        let right = self.width as f64 - measure.margin();
        self.heading.draw(image, measure.margin(), right, measure);
        let side = &self.bar_side;
        draw_color_bar(image, self.bar, self.bar_place, &scale.colors, side, measure);
    }
}

/// From values to colours.
pub(super) struct ColorScale {
    range: [f64; 2],
    /// From low to high, in steps too fine to see.
    colors: Vec<Color>,
}

const NO_VALUE: Color = [160; 3];

impl ColorScale {
    fn new(picture: &Picture, values: &[f64]) -> Self {
        let fit = || {
            let [low, high] = span(values.iter().copied()).unwrap_or([0.0, 1.0]);
            match picture.color_map {
                ColorMap::Diverging if low != high || low != 0.0 => {
                    let far = low.abs().max(high.abs());
                    [-far, far]
                }
                _ => [low, high],
            }
        };
        let given = picture.range.filter(|(a, b)| drawable(*a) && drawable(*b)).map(|(a, b)| [a.min(b), a.max(b)]);
        let gradient = match picture.color_map {
            ColorMap::Viridis => colorous::VIRIDIS,
            ColorMap::Turbo => colorous::TURBO,
            ColorMap::Inferno => colorous::INFERNO,
            ColorMap::Diverging => colorous::RED_BLUE,
        };
        let steps = 512;
        let mut colors: Vec<Color> = (0..steps).map(|i| gradient.eval_rational(i, steps).as_array()).collect();
        // The gradient runs from red to blue; high is red everywhere else.
        if picture.color_map == ColorMap::Diverging {
            colors.reverse();
        }
        Self { range: widened(given.unwrap_or_else(fit)), colors }
    }

    /// The colour of a value; those beyond the range take its first or last one.
    pub(super) fn color(&self, value: f64) -> Color {
        if value.is_nan() {
            return NO_VALUE;
        }
        let [low, high] = self.range;
        let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
        let last = self.colors.len() - 1;
        self.colors[((share * self.colors.len() as f64) as usize).min(last)]
    }

    /// Colour of each point of a cloud.
    pub(super) fn colors_of(&self, cloud: &CloudView<'_>, i: usize) -> Color {
        self.color(cloud.values.get(i).copied().unwrap_or(f64::NAN))
    }

    fn side(&self, label: &str) -> Side {
        let [low, high] = self.range;
        let (label, factor) = scaled_label(label, low.abs().max(high.abs()));
        let axis = Axis::linear(self.range);
        let ticks = axis.ticks(7, factor);
        Side { axis, ticks, label }
    }
}

/// The data area of a plane picture at twice its resolution.
struct Squares {
    columns: usize,
    rows: usize,
    /// Coordinates \[m\] of the upper left corner.
    left: f64,
    top: f64,
    per_length: f64,
}

impl Squares {
    fn painted(&self, cloud: &CloudView<'_>, scale: &ColorScale) -> Vec<Color> {
        let mut pixels = vec![WHITE; self.columns * self.rows];
        // Squares overlap by this many pixels: without, lattice neighbours whose
        // common edge falls on a rounding tie, or which strain has moved apart by
        // a fraction of a pixel, would let white through.
        let overlap = 0.5;
        for (i, position) in cloud.positions.iter().enumerate() {
            let centre = [(position[0] - self.left) * self.per_length, (self.top - position[1]) * self.per_length];
            if !centre.iter().all(|c| drawable(*c)) {
                continue;
            }
            let half = 0.5 * cloud.sizes.at(i) * self.per_length + 0.5 * overlap;
            let columns = rounded(centre[0], half, self.columns);
            let rows = rounded(centre[1], half, self.rows);
            if columns.is_empty() {
                continue;
            }
            let color = scale.colors_of(cloud, i);
            for row in rows {
                pixels[row * self.columns..][columns.clone()].fill(color);
            }
        }
        pixels
    }
}

/// The pixels from `centre - half` to `centre + half`: at least one, as far as they exist.
fn rounded(centre: f64, half: f64, count: usize) -> std::ops::Range<usize> {
    let first = (centre - half).round();
    let last = (centre + half).round().max(first + 1.0);
    // `as` takes what is below zero to zero.
    (first as usize).min(count)..(last as usize).min(count)
}

/// Puts pixels drawn at twice the resolution into an area, each four made one.
fn paste_halved(image: &mut Image, area: Area, pixels: &[Color]) {
    let (left, top) = (area.left as usize, area.top as usize);
    let (columns, rows) = (area.width() as usize, area.height() as usize);
    for row in 0..rows {
        for column in 0..columns {
            let at = |i: usize| pixels[(2 * row + i / 2) * 2 * columns + 2 * column + i % 2];
            let four = [at(0), at(1), at(2), at(3)];
            let mean = |k: usize| (four.iter().map(|c| u16::from(c[k])).sum::<u16>() + 2) / 4;
            let color = [0, 1, 2].map(|k| mean(k) as u8);
            image.pixels[(top + row) * image.width + left + column] = color;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::tests::folder;
    use std::fs::{self, File};
    use std::io::BufReader;

    /// A lattice of `n` by `m` points of spacing 0.1 mm and a value for each.
    fn lattice(n: usize, m: usize, value: impl Fn(usize, usize) -> f64) -> (Vec<[f64; 3]>, Vec<f64>) {
        let indices = || (0..n * m).map(|i| (i % n, i / n));
        let at = |i: usize| (i as f64 + 0.5) * 1e-4;
        (indices().map(|(i, j)| [at(i), at(j), 0.0]).collect(), indices().map(|(i, j)| value(i, j)).collect())
    }

    fn viridis(share: f64) -> Color {
        colorous::VIRIDIS.eval_continuous(share).as_array()
    }

    fn near(a: Color, b: Color) -> bool {
        a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 3)
    }

    /// The data area of a picture of this cloud.
    fn area(picture: &Picture, cloud: &CloudView<'_>) -> (Image, Vec<(usize, usize)>) {
        let image = draw(picture, cloud, Some(1e-6));
        let low = viridis(0.0);
        let found = (0..image.pixels.len())
            .filter(|i| near(image.pixels[*i], low))
            .map(|i| (i % image.width, i / image.width))
            .collect();
        (image, found)
    }

    #[test]
    fn a_lattice_of_one_value_is_one_rectangle_without_gaps() {
        // Shapes and widths by which edges of squares fall anywhere between pixels.
        for (n, m, width) in [(7, 5, 400), (64, 64, 500), (301, 120, 640), (700, 400, 333)] {
            let (positions, values) = lattice(n, m, |_, _| 0.0);
            let cloud = CloudView { positions: &positions, sizes: Sizes::Same(1e-4), values: &values, dimension: 2 };
            let picture = Picture { width, range: Some((0.0, 1.0)), ..Picture::default() };
            let (_, mut found) = area(&picture, &cloud);
            // The colour bar, at the right, begins with the same colour.
            let middle = found[found.len() / 2].1;
            let row: Vec<usize> = found.iter().filter(|p| p.1 == middle).map(|p| p.0).collect();
            let is_last = |x: &&usize| !row.contains(&(**x + 1));
            let end = *row.iter().find(is_last).unwrap() + 1;
            found.retain(|p| p.0 < end);
            let ends = |get: fn(&(usize, usize)) -> usize| {
                let all = || found.iter().map(get);
                (all().min().unwrap(), all().max().unwrap())
            };
            let (left, right) = ends(|p| p.0);
            let (top, bottom) = ends(|p| p.1);
            let (across, upright) = (right - left + 1, bottom - top + 1);
            assert_eq!(found.len(), across * upright, "{n} x {m} at {width}");
            let aspect = across as f64 / upright as f64;
            let expected = n as f64 / m as f64;
            assert!((aspect / expected - 1.0).abs() < 0.03, "{aspect} {expected}");
        }
    }

    #[test]
    fn each_point_has_the_colour_of_its_value_also_after_encoding() {
        let (positions, values) = lattice(4, 4, |i, j| match (i, j) {
            (0, 0) => 0.0,
            (3, 0) => 1.0,
            (0, 3) => f64::NAN,
            (3, 3) => 7.0,
            _ => 0.5,
        });
        let cloud = CloudView { positions: &positions, sizes: Sizes::Same(1e-4), values: &values, dimension: 2 };
        let picture = Picture { range: Some((0.0, 1.0)), label: "damage [-]".into(), ..Picture::default() };
        let folder = folder("picture");
        let path = folder.join("a.png");
        write_png(&draw(&picture, &cloud, None), &path).unwrap();
        let decoder = png::Decoder::new(BufReader::new(File::open(&path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        let (width, height) = (info.width as usize, info.height as usize);
        let pixel = |x: usize, y: usize| -> Color { bytes[3 * (y * width + x)..][..3].try_into().unwrap() };
        let page = Page::new(&picture, None, [4.16e-4, 4.16e-4], &ColorScale::new(&picture, &values), 60.0, 50.0);
        // Any picture of a square has its data in this band; look along a row through
        // the lowest points and one through the highest.
        let x_of = |i: usize| page.area.left + page.area.width() * (i as f64 + 0.58) / 4.16;
        let y_of = |j: usize| page.area.bottom - page.area.height() * (j as f64 + 0.58) / 4.16;
        let at = |i: usize, j: usize| pixel(x_of(i) as usize, y_of(j) as usize);
        assert!(near(at(0, 0), viridis(0.0)), "{:?}", at(0, 0));
        assert!(near(at(3, 0), viridis(1.0)));
        assert!(near(at(3, 3), viridis(1.0)), "beyond the range: its last colour");
        assert!(near(at(1, 2), viridis(0.5)));
        assert_eq!(at(0, 3), NO_VALUE);
        // The colour bar: somewhere right of the data a column runs through all colours.
        let has_all = |x: &usize| {
            [0.02, 0.3, 0.5, 0.7, 0.98].iter().all(|share| (0..height).any(|y| near(pixel(*x, y), viridis(*share))))
        };
        assert!((width * 3 / 4..width).any(|x| has_all(&x)));
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_diverging_map_puts_white_at_zero_and_red_above() {
        let picture = Picture { color_map: ColorMap::Diverging, ..Picture::default() };
        let scale = ColorScale::new(&picture, &[-1.0, 4.0]);
        assert!(scale.color(0.0).iter().all(|channel| *channel > 235));
        assert!(scale.color(4.0)[0] > scale.color(4.0)[2]);
        assert_eq!(scale.color(f64::NAN), NO_VALUE);
        assert_eq!(scale.color(f64::INFINITY), scale.color(4.0));
    }

    #[test]
    fn no_cloud_stops_a_picture_from_being_drawn() {
        let bad = [0.0, 1.0, -1e-300, f64::MAX, f64::NAN, f64::INFINITY];
        let all: Vec<[f64; 3]> = bad.iter().flat_map(|&a| bad.iter().map(move |&b| [a, b, a])).collect();
        let clouds: [&[[f64; 3]]; 4] = [&[], &all[..1], &all[7..9], &all];
        for dimension in 1..4 {
            for positions in clouds {
                for size in bad {
                    for (values, range) in [
                        (&bad[..0], None),
                        (&bad[..], Some((1.0, 0.0))),
                        (&bad[..], Some((f64::NAN, f64::MAX))),
                        (&[f64::NAN; 60][..], Some((2.0, 2.0))),
                    ] {
                        let picture = Picture {
                            width: 120,
                            range,
                            title: "title ".repeat(9),
                            label: "[[label]".repeat(7),
                            view: View { azimuth: size, elevation: 90.0 },
                            bounds: (size == 1.0).then_some([[0.0; 3], [size; 3]]),
                            ..Picture::default()
                        };
                        let sizes = if range.is_none() { Sizes::Each(&bad) } else { Sizes::Same(size) };
                        let cloud = CloudView { positions, sizes, values, dimension };
                        draw(&picture, &cloud, Some(size));
                    }
                }
            }
        }
    }

    #[test]
    fn given_bounds_keep_the_scale_while_the_body_moves() {
        let (mut positions, values) = lattice(40, 20, |_, _| 0.0);
        let picture = Picture { bounds: Some([[-1e-3, -1e-3, 0.0], [6e-3, 4e-3, 0.0]]), ..Picture::default() };
        let inked = |positions: &[[f64; 3]]| {
            let cloud = CloudView { positions, sizes: Sizes::Same(1e-4), values: &values, dimension: 2 };
            let (image, found) = area(&picture, &cloud);
            (image.width, image.height, found.len())
        };
        let before = inked(&positions);
        for position in &mut positions {
            position[0] += 1e-3;
        }
        let after = inked(&positions);
        assert_eq!((before.0, before.1), (after.0, after.1));
        assert!(before.2.abs_diff(after.2) < before.2 / 50, "{before:?} {after:?}");
    }
}
