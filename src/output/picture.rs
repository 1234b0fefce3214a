//! Pictures with 8 bits for each colour channel: drawing on them, and writing them as PNG files.

use font8x8::legacy::{BASIC_LEGACY, LATIN_LEGACY};

use super::format::EncodeError;
use crate::sensor::Sensor;

/// Red, green and blue.
pub type Rgb = [u8; 3];

/// The colour of a pixel without a return.
pub const NO_RETURN_COLOUR: Rgb = [0x10, 0x10, 0x14];

/// The colour of a pixel whose beam is blocked nearer than the sensor's least range.
pub(super) const TOO_NEAR_COLOUR: Rgb = [0x4a, 0x0a, 0x14];

/// The colour of text on [`NO_RETURN_COLOUR`].
pub const TEXT_COLOUR: Rgb = [0xe0, 0xe0, 0xe6];

/// The colour of lines on [`NO_RETURN_COLOUR`] that are less important than text.
pub const LINE_COLOUR: Rgb = [0x70, 0x70, 0x7a];

/// The height and the width of a character at size 1, in pixels.
pub const CHARACTER: usize = 8;

/// A picture with 8 bits for each colour channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// The width in pixels.
    pub width: usize,
    /// The height in pixels.
    pub height: usize,
    /// The pixels as red, green and blue, row by row.
    pub pixels: Vec<u8>,
}

impl Picture {
    /// A picture of one colour.
    pub fn new(width: usize, height: usize, colour: Rgb) -> Self {
        Self { width, height, pixels: colour.repeat(width * height) }
    }

    /// Sets a pixel. A position outside of the picture is passed over.
    pub fn set(&mut self, x: i64, y: i64, colour: Rgb) {
        let side = |at: i64, size: usize| usize::try_from(at).ok().filter(|at| *at < size);
        if let (Some(x), Some(y)) = (side(x, self.width), side(y, self.height)) {
            let at = 3 * (y * self.width + x);
            self.pixels[at..at + 3].copy_from_slice(&colour);
        }
    }

    /// Fills a rectangle.
    pub fn fill(&mut self, (x, y): (i64, i64), (width, height): (usize, usize), colour: Rgb) {
        // Only what is inside takes time.
        let inside = |from: i64, size: usize, all: usize| {
            from.clamp(0, all as i64)..from.saturating_add_unsigned(size as u64).clamp(0, all as i64)
        };
        for y in inside(y, height, self.height) {
            for x in inside(x, width, self.width) {
                self.set(x, y, colour);
            }
        }
    }

    /// Draws a line, both ends included.
    pub fn line(&mut self, (x0, y0): (i64, i64), (x1, y1): (i64, i64), colour: Rgb) {
        let steps = (x1 - x0).abs().max((y1 - y0).abs()).max(1);
        // A line that leads far out of the picture takes no more time than the picture is large.
        if steps > 4 * (self.width + self.height) as i64 {
            return;
        }
        for step in 0..=steps {
            let at = |a: i64, b: i64| a + ((b - a) * step + (b - a).signum() * steps / 2) / steps;
            self.set(at(x0, x1), at(y0, y1), colour);
        }
    }

    /// Draws another picture with its upper left corner at a position.
    pub fn paste(&mut self, (x, y): (usize, usize), other: &Self) {
        let width = other.width.min(self.width.saturating_sub(x));
        for row in 0..other.height.min(self.height.saturating_sub(y)) {
            let (from, to) = (3 * row * other.width, 3 * ((y + row) * self.width + x));
            self.pixels[to..to + 3 * width].copy_from_slice(&other.pixels[from..from + 3 * width]);
        }
    }

    /// Writes text with its upper left corner at a position. `size` is the number of pixels each way for a pixel of the font.
    pub fn text(&mut self, (x, y): (i64, i64), text: &str, size: usize, colour: Rgb) {
        for (index, c) in text.chars().enumerate() {
            let left = x + (index * CHARACTER * size) as i64;
            for (row, bits) in glyph(c).into_iter().enumerate() {
                for column in (0..CHARACTER).filter(|column| bits >> column & 1 == 1) {
                    let at = (left + (column * size) as i64, y + (row * size) as i64);
                    self.fill(at, (size, size), colour);
                }
            }
        }
    }
}

/// The width of a text in pixels.
pub fn text_width(text: &str, size: usize) -> usize {
    text.chars().count() * CHARACTER * size
}

/// The rows of a character; the lowest bit of a row is on the left. A character that the font lacks is a question mark.
fn glyph(c: char) -> [u8; 8] {
    let known = match c {
        '−' | '–' => '-',
        '“' | '”' => '"',
        '’' => '\'',
        c => c,
    };
    match u32::from(known) as usize {
        code @ 0x20..0x7f => BASIC_LEGACY[code],
        code @ 0xa0..=0xff => LATIN_LEGACY[code - 0xa0],
        _ => BASIC_LEGACY['?' as usize],
    }
}

impl Picture {
    /// The picture as a PNG.
    ///
    /// # Errors
    /// An error if a side is 0 or larger than a PNG allows.
    pub fn to_png(&self) -> Result<Vec<u8>, EncodeError> {
        let Self { width, height, pixels } = self;
        let file = write(*width, *height, Layout::RGB, &[], pixels);
        file.map_err(|e| EncodeError::new(format!("the PNG can't be encoded: {e}")))
    }
}

/// Checks that a PNG can have the rows and columns of a sensor's frame.
pub(super) fn check_sides(sensor: &Sensor) -> Result<(), EncodeError> {
    let (rows, columns) = (sensor.pattern.rows(), sensor.pattern.columns());
    if rows.max(columns) <= i32::MAX as usize {
        return Ok(());
    }
    Err(EncodeError::new(format!("a PNG can't hold {rows} × {columns} pixels")))
}

/// The layout of a PNG's pixels.
struct Layout {
    colour: png::ColorType,
    depth: png::BitDepth,
    palette: Option<Vec<u8>>,
}

impl Layout {
    const RGB: Self = Self { colour: png::ColorType::Rgb, depth: png::BitDepth::Eight, palette: None };
}

impl From<Pixels> for Layout {
    fn from(pixels: Pixels) -> Self {
        let (colour, depth) = match pixels {
            Pixels::Grey8 => (png::ColorType::Grayscale, png::BitDepth::Eight),
            Pixels::Grey16 => (png::ColorType::Grayscale, png::BitDepth::Sixteen),
            Pixels::Palette => (png::ColorType::Indexed, png::BitDepth::Eight),
        };
        let palette = (pixels == Pixels::Palette).then(|| (0..=255).flat_map(colour_of).collect());
        Self { colour, depth, palette }
    }
}

/// The colour of a number in a palette: black for 0, and for the others colours that differ from each other. The bits of a
/// number are dealt to red, green and blue in turn, the lowest first and to the highest bit of the colour, so that neighbours
/// are far apart.
fn colour_of(number: u8) -> [u8; 3] {
    let bit = |of: u8| (number >> of) & 1;
    let colour = |first: u8| {
        let bits = [first, first + 3, first + 6].map(|of| if of < 8 { bit(of) } else { 0 });
        bits[0] << 7 | bits[1] << 6 | bits[2] << 5
    };
    [colour(0), colour(1), colour(2)]
}

/// A PNG of one number a pixel, row by row. Each number is cut to the bits that a pixel has. The header has the texts, each under
/// its keyword.
pub(super) fn encode_numbers(
    width: usize,
    height: usize,
    numbers: &[u32],
    pixels: Pixels,
    texts: &[(&str, String)],
) -> Result<Vec<u8>, EncodeError> {
    let bytes: Vec<u8> = match pixels {
        Pixels::Grey16 => numbers.iter().flat_map(|number| (*number as u16).to_be_bytes()).collect(),
        Pixels::Grey8 | Pixels::Palette => numbers.iter().map(|number| *number as u8).collect(),
    };
    let file = write(width, height, pixels.into(), texts, &bytes);
    file.map_err(|e| EncodeError::new(format!("the PNG can't be encoded: {e}")))
}

/// The pixels of a PNG of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pixels {
    /// Grey of 8 bits.
    Grey8,
    /// Grey of 16 bits.
    Grey16,
    /// 8 bits, with a colour for each number. 0 is black.
    Palette,
}

fn write(
    width: usize,
    height: usize,
    layout: Layout,
    texts: &[(&str, String)],
    pixels: &[u8],
) -> Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::new();
    let side = |n: usize| u32::try_from(n).unwrap_or(0); // the encoder refuses a side of 0
    let mut encoder = png::Encoder::new(&mut file, side(width), side(height));
    encoder.set_color(layout.colour);
    encoder.set_depth(layout.depth);
    // It takes a tenth of the time of the usual compression, for files of depths and colours that are 10 to 30 % larger.
    encoder.set_compression(png::Compression::Fast);
    if let Some(palette) = layout.palette {
        encoder.set_palette(palette);
    }
    for (keyword, text) in texts {
        encoder.add_text_chunk((*keyword).to_owned(), text.clone())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    const INK: Rgb = [255; 3];

    fn lit(picture: &Picture) -> Vec<(usize, usize)> {
        let all = (0..picture.width * picture.height).filter(|i| picture.pixels[3 * i] == 255);
        all.map(|i| (i % picture.width, i / picture.width)).collect()
    }

    #[test]
    fn what_is_drawn_outside_is_left_out() {
        let mut picture = Picture::new(4, 3, [0; 3]);
        picture.set(-1, 0, INK);
        picture.set(0, 3, INK);
        picture.fill((-5, 2), (6, usize::MAX / 2), INK);
        picture.line((3, -2), (3, 0), INK);
        picture.line((0, 0), (i64::MAX / 4, 0), INK);
        picture.paste((3, 2), &Picture::new(9, 9, INK));
        picture.text((-100, -100), "out", 3, INK);
        assert_eq!(lit(&picture), [(3, 0), (0, 2), (3, 2)]);
    }

    #[test]
    fn text_is_as_wide_as_it_says_and_has_the_signs_of_units() {
        for text in ["0", "−12.5 °", "µs × ³ é"] {
            let width = text_width(text, 2);
            let mut picture = Picture::new(width, 16, [0; 3]);
            picture.text((0, 0), text, 2, INK);
            assert!(lit(&picture).iter().any(|(x, _)| *x >= width - 2 * CHARACTER), "{text}");
        }
        assert_eq!(glyph('−'), glyph('-'));
        assert_eq!(glyph('漢'), glyph('?'));
        assert_ne!(glyph('°'), glyph('?'));
    }

    #[test]
    fn a_palette_has_a_colour_for_each_number_and_black_for_0() {
        let colours: BTreeSet<_> = (0..=255).map(colour_of).collect();
        assert_eq!(colours.len(), 256);
        assert_eq!(
            [0, 1, 2, 4, 255].map(colour_of),
            [[0; 3], [128, 0, 0], [0, 128, 0], [0, 0, 128], [224, 224, 192]]
        );
    }
}
