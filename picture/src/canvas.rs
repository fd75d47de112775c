//! A picture in memory and the few things drawn on it: rectangles, lines, discs, text.
//!
//! Everything is drawn by coverage, the share of a pixel that a shape fills, so
//! edges and letters are smooth. Coordinates are pixels, x to the right and y
//! downwards, and the centre of the first pixel is (0.5, 0.5). What falls outside
//! is cut off; nothing here fails.

use std::io;
use std::path::Path;
use std::sync::OnceLock;

use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};

use super::files::write_whole;

/// Red, green, blue, each from 0 to 255.
pub type Color = [u8; 3];

pub(super) const WHITE: Color = [255; 3];
pub(super) const BLACK: Color = [25; 3];
pub(super) const GREY: Color = [120; 3];
pub(super) const PALE: Color = [226; 3];

/// A picture: rows from top to bottom, eight bits per channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    pub width: usize,
    pub height: usize,
    /// `width * height` colours, row by row.
    pub pixels: Vec<Color>,
}

impl Image {
    /// This image and another one of the same width below it.
    pub fn above(mut self, below: Image) -> Image {
        assert_eq!(self.width, below.width, "images that are put together are equally wide");
        self.height += below.height;
        self.pixels.extend(below.pixels);
        self
    }
}

/// Writes an image as PNG.
///
/// The file appears under its name only when it is complete.
pub fn write_png(image: &Image, path: &Path) -> io::Result<()> {
    write_frames(std::slice::from_ref(image), path)
}

/// Writes images of one size as one PNG that plays them over and over, ten a second.
pub fn write_animation(images: &[Image], path: &Path) -> io::Result<()> {
    write_frames(images, path)
}

fn write_frames(images: &[Image], path: &Path) -> io::Result<()> {
    let size = |length: usize| u32::try_from(length).map_err(io::Error::other);
    let first = images.first().ok_or_else(|| io::Error::other("an animation has a frame at least"))?;
    write_whole(path, |file| {
        let mut encoder = png::Encoder::new(file, size(first.width)?, size(first.height)?);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        if images.len() > 1 {
            encoder.set_animated(size(images.len())?, 0)?;
            encoder.set_frame_delay(1, 10)?;
        }
        let mut writer = encoder.write_header()?;
        for image in images {
            writer.write_image_data(image.pixels.as_flattened())?;
        }
        writer.finish()?;
        Ok(())
    })
}

/// A rectangle in pixels, edges included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Area {
    pub fn width(&self) -> f64 {
        self.right - self.left
    }

    pub fn height(&self) -> f64 {
        self.bottom - self.top
    }
}

/// Where a text stands relative to the point it is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Align {
    Start,
    Middle,
    End,
}

/// How a text is written. `size` is the height of its letters' em square in pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lettering {
    pub size: f64,
    pub color: Color,
    pub align: Align,
}

impl Image {
    pub(super) fn white(width: usize, height: usize) -> Self {
        let pixels = vec![WHITE; width * height];
        Self { width, height, pixels }
    }

    /// Mixes a colour into a pixel, if that pixel exists.
    fn blend(&mut self, x: i64, y: i64, color: Color, coverage: f64) {
        let inside = (0..self.width as i64).contains(&x) && (0..self.height as i64).contains(&y);
        if !inside || coverage <= 0.0 {
            return;
        }
        let pixel = &mut self.pixels[y as usize * self.width + x as usize];
        let share = coverage.min(1.0);
        for (old, new) in pixel.iter_mut().zip(color) {
            let mixed = f64::from(*old) * (1.0 - share) + f64::from(new) * share;
            *old = mixed.round() as u8;
        }
    }

    /// Fills an area, its edges rounded to whole pixels.
    pub(super) fn fill(&mut self, area: Area, color: Color) {
        let column = |x: f64| (x.round().max(0.0) as usize).min(self.width);
        let row = |y: f64| (y.round().max(0.0) as usize).min(self.height);
        let (left, right) = (column(area.left), column(area.right));
        if left >= right {
            return;
        }
        for y in row(area.top)..row(area.bottom) {
            self.pixels[y * self.width..][left..right].fill(color);
        }
    }

    /// Draws the outline of an area, `width` pixels wide, centred on its edges.
    pub(super) fn outline(&mut self, area: Area, width: f64, color: Color) {
        let half = 0.5 * width;
        let Area { left, top, right, bottom } = area;
        for (left, top, right, bottom) in [
            (left, top, right, top),
            (left, bottom, right, bottom),
            (left, top, left, bottom),
            (right, top, right, bottom),
        ] {
            let side = Area { left: left - half, top: top - half, right: right + half, bottom: bottom + half };
            self.fill(side, color);
        }
    }

    /// Draws a straight line with round ends, of which only the part inside `clip` shows.
    pub(super) fn line(&mut self, from: [f64; 2], to: [f64; 2], width: f64, color: Color, clip: Area) {
        let Some([from, to]) = cut(from, to, clip, width) else {
            return;
        };
        let reach = 0.5 * width + 0.5;
        let along = [to[0] - from[0], to[1] - from[1]];
        let squared = along[0] * along[0] + along[1] * along[1];
        // Walk along the longer direction and look at the few pixels across it.
        let main = usize::from(along[1].abs() > along[0].abs());
        let slope = if along[main] == 0.0 { 0.0 } else { along[1 - main] / along[main] };
        // A line at 45 degrees is cut by a column sqrt(2) times its width.
        let across = reach * std::f64::consts::SQRT_2 + 1.0;
        let (start, end) = (from[main].min(to[main]), from[main].max(to[main]));
        for step in (start - reach).floor() as i64..=(end + reach).ceil() as i64 {
            let position = (step as f64 + 0.5).clamp(start, end);
            let centre = from[1 - main] + slope * (position - from[main]);
            for side in (centre - across).floor() as i64..=(centre + across).ceil() as i64 {
                let (x, y) = if main == 0 { (step, side) } else { (side, step) };
                let pixel = [x as f64 + 0.5, y as f64 + 0.5];
                let inside =
                    (clip.left..=clip.right).contains(&pixel[0]) && (clip.top..=clip.bottom).contains(&pixel[1]);
                if !inside {
                    continue;
                }
                let offset = [pixel[0] - from[0], pixel[1] - from[1]];
                let projection = offset[0] * along[0] + offset[1] * along[1];
                let share = if squared > 0.0 { (projection / squared).clamp(0.0, 1.0) } else { 0.0 };
                let distance = (offset[0] - share * along[0]).hypot(offset[1] - share * along[1]);
                self.blend(x, y, color, reach - distance);
            }
        }
    }

    /// Draws a filled disc.
    pub(super) fn disc(&mut self, centre: [f64; 2], radius: f64, color: Color) {
        let reach = radius + 1.0;
        let far = 1e7;
        if !centre.iter().all(|c| c.abs() < far) {
            return;
        }
        for y in (centre[1] - reach).floor() as i64..=(centre[1] + reach).ceil() as i64 {
            for x in (centre[0] - reach).floor() as i64..=(centre[0] + reach).ceil() as i64 {
                let distance = (x as f64 + 0.5 - centre[0]).hypot(y as f64 + 0.5 - centre[1]);
                self.blend(x, y, color, radius + 0.5 - distance);
            }
        }
    }

    /// Writes a text from left to right, its capitals centred on the height `at[1]`.
    pub(super) fn text(&mut self, at: [f64; 2], text: &str, lettering: Lettering) {
        self.letters(text, lettering, |x, y| (x + at[0].round() as i64, y + at[1].round() as i64));
    }

    /// Writes a text from bottom to top, its capitals centred on the column `at[0]`.
    pub(super) fn text_upwards(&mut self, at: [f64; 2], text: &str, lettering: Lettering) {
        self.letters(text, lettering, |x, y| (y + at[0].round() as i64, at[1].round() as i64 - x));
    }

    fn letters(&mut self, text: &str, lettering: Lettering, place: impl Fn(i64, i64) -> (i64, i64)) {
        let Some(font) = font() else { return };
        let (glyphs, width) = laid_out(font, text, lettering.size);
        let start = match lettering.align {
            Align::Start => 0.0,
            Align::Middle => -0.5 * width,
            Align::End => -width,
        };
        for mut glyph in glyphs {
            glyph.position.x += start as f32;
            let Some(outline) = font.outline_glyph(glyph) else {
                continue; // a space
            };
            let corner = outline.px_bounds().min;
            outline.draw(|x, y, coverage| {
                let x = corner.x as i64 + i64::from(x);
                let y = corner.y as i64 + i64::from(y);
                let (x, y) = place(x, y);
                self.blend(x, y, lettering.color, f64::from(coverage));
            });
        }
    }
}

/// The width of a text \[pixels\].
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    font().map_or(0.0, |font| laid_out(font, text, size).1)
}

/// The text, shortened with an ellipsis if it is wider than `width`.
pub(super) fn shortened(text: &str, size: f64, width: f64) -> String {
    if text_width(text, size) <= width {
        return text.to_owned();
    }
    let ends: Vec<usize> = text.char_indices().map(|(end, _)| end).collect();
    let short = |end: usize| format!("{}…", text[..end].trim_end());
    let fitting = ends.partition_point(|end| text_width(&short(*end), size) <= width);
    fitting.checked_sub(1).map_or_else(String::new, |i| short(ends[i]))
}

/// The text in lines that are no wider than `width`, broken between words.
pub(super) fn wrapped(text: &str, size: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), size) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.iter().map(|line| shortened(line, size, width)).collect()
}

/// The font lies in the program, so that pictures look the same on every machine.
fn font() -> Option<&'static FontRef<'static>> {
    static FONT: OnceLock<Option<FontRef<'static>>> = OnceLock::new();
    FONT.get_or_init(|| FontRef::try_from_slice(dejavu::sans::regular()).ok()).as_ref()
}

/// The letters of a text in place, from x = 0 and with the middle of capitals at y = 0; and its width.
fn laid_out(font: &FontRef<'static>, text: &str, size: f64) -> (Vec<Glyph>, f64) {
    let em = font.units_per_em().unwrap_or(2048.0);
    let scale = PxScale::from(size as f32 * font.height_unscaled() / em);
    let scaled = font.as_scaled(scale);
    // Capitals of DejaVu Sans are 1493 of 2048 units high.
    let baseline = (0.5 * 0.729 * size).round() as f32;
    let mut x = 0.0;
    let mut previous = None;
    let mut glyphs = Vec::with_capacity(text.len());
    for c in text.chars() {
        let id = font.glyph_id(c);
        x += previous.map_or(0.0, |before| scaled.kern(before, id));
        glyphs.push(id.with_scale_and_position(scale, point(x, baseline)));
        x += scaled.h_advance(id);
        previous = Some(id);
    }
    (glyphs, f64::from(x))
}

/// The part of a line that can be seen through `clip` widened by `margin` (Liang and Barsky, 1984).
///
/// Without it a line to a far point would be walked pixel by pixel.
fn cut(from: [f64; 2], to: [f64; 2], clip: Area, margin: f64) -> Option<[[f64; 2]; 2]> {
    if !from.iter().chain(&to).all(|c| c.is_finite()) {
        return None;
    }
    let low = [clip.left - margin, clip.top - margin];
    let high = [(clip.right + margin).max(low[0]), (clip.bottom + margin).max(low[1])];
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        let along = to[k] - from[k];
        if along == 0.0 {
            if from[k] < low[k] || from[k] > high[k] {
                return None;
            }
            continue;
        }
        let (a, b) = ((low[k] - from[k]) / along, (high[k] - from[k]) / along);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    // Differences of huge numbers may not be numbers; such a line is not drawn.
    if enter.is_nan() || leave.is_nan() || enter > leave {
        return None;
    }
    // Between huge numbers, rounding alone would leave the picture by far.
    let at = |share: f64| [0, 1].map(|k| (from[k] + share * (to[k] - from[k])).clamp(low[k], high[k]));
    let ends = [at(enter), at(leave)];
    ends.as_flattened().iter().all(|c| c.is_finite()).then_some(ends)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::tests::folder;
    use std::fs::{self, File};
    use std::io::BufReader;

    fn everywhere(image: &Image) -> Area {
        Area { left: 0.0, top: 0.0, right: image.width as f64, bottom: image.height as f64 }
    }

    fn dark(image: &Image) -> usize {
        image.pixels.iter().filter(|p| p[0] < 128).count()
    }

    #[test]
    fn a_png_decodes_to_the_same_pixels() {
        let mut image = Image::white(37, 19);
        let area = Area { left: 3.0, top: 4.0, right: 9.0, bottom: 6.0 };
        image.fill(area, [10, 200, 30]);
        let folder = folder("png");
        let path = folder.join("a.png");
        write_png(&image, &path).unwrap();
        let decoder = png::Decoder::new(BufReader::new(File::open(&path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        assert_eq!(bytes, image.pixels.as_flattened());
        assert_eq!(image.pixels[4 * 37 + 3], [10, 200, 30]);
        assert_eq!(image.pixels[6 * 37 + 3], WHITE);
        let missing = write_png(&image, &folder.join("no/b.png")).unwrap_err();
        assert!(missing.to_string().contains("b.png"));
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_line_is_as_long_and_as_wide_as_asked() {
        for to in [[90.0, 50.0], [50.0, 90.0], [80.0, 80.0], [80.0, 20.0]] {
            let mut image = Image::white(100, 100);
            let all = everywhere(&image);
            image.line([50.0, 50.0], to, 3.0, BLACK, all);
            let ink: f64 = image.pixels.iter().map(|p| (255.0 - f64::from(p[0])) / (255.0 - f64::from(BLACK[0]))).sum();
            let length = (to[0] - 50.0_f64).hypot(to[1] - 50.0);
            let expected = 3.0 * length + std::f64::consts::PI * 1.5 * 1.5;
            assert!((ink / expected - 1.0).abs() < 0.03, "{to:?}: {ink} {expected}");
        }
    }

    #[test]
    fn lines_and_discs_far_away_or_not_numbers_draw_nothing_and_end_soon() {
        let mut image = Image::white(50, 50);
        let all = everywhere(&image);
        for bad in [f64::NAN, f64::INFINITY, 1e300] {
            image.line([bad, 1.0], [bad, 30.0], 2.0, BLACK, all);
            image.disc([bad, 3.0], 4.0, BLACK);
        }
        assert_eq!(image, Image::white(50, 50));
        image.line([-1e12, 25.0], [1e12, 25.0], 2.0, BLACK, all);
        assert_eq!(dark(&image), 100);
        for huge in [1e12, 1e290, f64::MAX] {
            image.line([-huge, huge], [huge, -0.3 * huge], 2.0, BLACK, all);
        }
    }

    #[test]
    fn text_is_drawn_inside_its_measured_width() {
        let mut image = Image::white(300, 40);
        let lettering = Lettering { size: 20.0, color: BLACK, align: Align::Start };
        image.text([10.0, 20.0], "σ [MPa], t = 42.9 µs · 10⁻³", lettering);
        let columns = |image: &Image| {
            let inked = |x: &usize| (0..40).any(|y| image.pixels[y * 300 + x][0] < 200);
            let all: Vec<usize> = (0..300).filter(inked).collect();
            (*all.first().unwrap(), *all.last().unwrap())
        };
        let width = text_width("σ [MPa], t = 42.9 µs · 10⁻³", 20.0);
        let (first, last) = columns(&image);
        assert!((10..15).contains(&first), "{first}");
        assert!(last < (10.0 + width) as usize + 1 && last + 5 > (10.0 + width) as usize);
        assert_eq!(shortened("abc", 20.0, 1.0), "");
        assert!(shortened("a long sentence", 20.0, 80.0).ends_with('…'));
        assert_eq!(wrapped("one two three", 10.0, 45.0).len(), 2);
    }

    #[test]
    fn every_character_used_has_a_glyph() {
        let font = font().expect("the font in the program is a font");
        for c in "…−×·µ⁰¹²³⁴⁵⁶⁷⁸⁹⁻ΔδσρεΩ".chars() {
            assert_ne!(font.glyph_id(c).0, 0, "{c}");
        }
    }
}
