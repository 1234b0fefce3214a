//! Scatter plots of directions as the sensor sees them: azimuth grows to the left, elevation grows upward.

use super::format::EncodeError;
use super::picture::{NO_RETURN_COLOUR, Picture, Rgb};
use crate::angle::Angle;

/// A direction and its colour.
#[derive(Clone, Copy, Debug)]
pub struct Dot {
    /// The azimuth, positive to the left.
    pub azimuth: Angle,
    /// The elevation, positive upward.
    pub elevation: Angle,
    /// The colour.
    pub colour: Rgb,
}

/// The largest size of a plot in pixels, without its margins.
const LARGEST: (f64, f64) = (1500.0, 800.0);

/// Pixels to the left of the plot and below it, for the labels of the axes.
const MARGIN: (usize, usize) = (44, 24);

/// Pixels to the right of the plot and above it.
const EDGE: usize = 16;

const INK: Rgb = [0xb0, 0xb0, 0xb8];
const GRID: Rgb = [0x2c, 0x2c, 0x34];

/// The colour of a fraction of a scale, 0 to 1, in the Turbo colour map from blue to red.
pub fn colour_of(part: f64) -> Rgb {
    let colour = colorous::TURBO.eval_continuous(0.06 + 0.86 * part.clamp(0.0, 1.0));
    [colour.r, colour.g, colour.b]
}

/// A picture of `dots` with degrees at its axes. A degree is as tall as it is wide. Later dots cover earlier ones.
///
/// # Errors
/// An error if there are no dots.
pub fn scatter(dots: &[Dot]) -> Result<Picture, EncodeError> {
    let span = |of: &dyn Fn(&Dot) -> f64| {
        dots.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
    };
    let azimuth = span(&|dot| dot.azimuth.degrees());
    let elevation = span(&|dot| dot.elevation.degrees());
    if dots.is_empty() || !(azimuth.0.is_finite() && elevation.0.is_finite()) {
        return Err(EncodeError::new("there are no directions to plot"));
    }
    let wide = |(low, high): (f64, f64)| (high - low).max(1e-3);
    let scale = (LARGEST.0 / wide(azimuth)).min(LARGEST.1 / wide(elevation));
    let side = |range| (wide(range) * scale).round() as usize + 1;
    let mut canvas = Canvas::new(side(azimuth), side(elevation));
    let x = |degrees: f64| ((azimuth.1 - degrees) * scale).round() as usize;
    let y = |degrees: f64| ((elevation.1 - degrees) * scale).round() as usize;
    for tick in ticks(azimuth, scale) {
        canvas.vertical(x(tick));
        canvas.label(&label(tick), MARGIN.0 + x(tick), canvas.picture.height - MARGIN.1 + 8, Align::Middle);
    }
    for tick in ticks(elevation, scale) {
        canvas.horizontal(y(tick));
        canvas.label(&label(tick), MARGIN.0 - 6, EDGE + y(tick) - 5, Align::Right);
    }
    // Dots of a single pixel would be invisible if there are few of them.
    let size = if dots.len() < 50_000 { 2 } else { 1 };
    for dot in dots {
        canvas.dot(x(dot.azimuth.degrees()), y(dot.elevation.degrees()), size, dot.colour);
    }
    Ok(canvas.picture)
}

/// Round numbers of degrees in a range, at least 40 pixels apart.
fn ticks((low, high): (f64, f64), scale: f64) -> Vec<f64> {
    const STEPS: [f64; 15] =
        [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0];
    let step = STEPS.into_iter().find(|step| step * scale >= 40.0).unwrap_or(45.0);
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    (first..=last).map(|i| i as f64 * step).collect()
}

/// The degrees of a tick, without trailing zeros.
fn label(degrees: f64) -> String {
    let rounded = (degrees * 1e3).round() / 1e3;
    if rounded == 0.0 { "0".to_owned() } else { rounded.to_string() }
}

enum Align {
    Middle,
    Right,
}

struct Canvas {
    picture: Picture,
}

impl Canvas {
    /// An empty canvas for a plot of `columns` by `rows` pixels and its margins.
    fn new(columns: usize, rows: usize) -> Self {
        let (width, height) = (columns + MARGIN.0 + EDGE, rows + MARGIN.1 + EDGE);
        Self { picture: Picture::new(width, height, NO_RETURN_COLOUR) }
    }

    fn set(&mut self, x: usize, y: usize, colour: Rgb) {
        self.picture.set(x as i64, y as i64, colour);
    }

    /// Draws a dot of `size` by `size` pixels at a position of the plot.
    fn dot(&mut self, x: usize, y: usize, size: usize, colour: Rgb) {
        for (dx, dy) in (0..size).flat_map(|dx| (0..size).map(move |dy| (dx, dy))) {
            self.set(MARGIN.0 + x + dx, EDGE + y + dy, colour);
        }
    }

    fn vertical(&mut self, x: usize) {
        (EDGE..self.picture.height - MARGIN.1).for_each(|y| self.set(MARGIN.0 + x, y, GRID));
    }

    fn horizontal(&mut self, y: usize) {
        (MARGIN.0..self.picture.width - EDGE).for_each(|x| self.set(x, EDGE + y, GRID));
    }

    /// Writes a number, with two pixels of the canvas for each pixel of the font. (x, y) is the top of the text, at its
    /// middle or its right end.
    fn label(&mut self, text: &str, x: usize, y: usize, align: Align) {
        const PITCH: usize = 8;
        let width = text.len() * PITCH - 2;
        let start = x.saturating_sub(match align {
            Align::Middle => width / 2,
            Align::Right => width,
        });
        for (index, character) in text.bytes().enumerate() {
            let glyph = FONT.iter().find(|(c, _)| *c == character).map_or([0; 5], |(_, rows)| *rows);
            for (row, bits) in glyph.into_iter().enumerate() {
                for column in (0..3).filter(|column| bits >> (2 - column) & 1 == 1) {
                    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                        self.set(start + index * PITCH + 2 * column + dx, y + 2 * row + dy, INK);
                    }
                }
            }
        }
    }
}

/// The digits in 3 × 5 pixels: five rows of three bits each.
const FONT: [(u8, [u8; 5]); 12] = [
    (b'0', [0b111, 0b101, 0b101, 0b101, 0b111]),
    (b'1', [0b010, 0b110, 0b010, 0b010, 0b111]),
    (b'2', [0b111, 0b001, 0b111, 0b100, 0b111]),
    (b'3', [0b111, 0b001, 0b111, 0b001, 0b111]),
    (b'4', [0b101, 0b101, 0b111, 0b001, 0b001]),
    (b'5', [0b111, 0b100, 0b111, 0b001, 0b111]),
    (b'6', [0b111, 0b100, 0b111, 0b101, 0b111]),
    (b'7', [0b111, 0b001, 0b001, 0b010, 0b010]),
    (b'8', [0b111, 0b101, 0b111, 0b101, 0b111]),
    (b'9', [0b111, 0b101, 0b111, 0b001, 0b111]),
    (b'-', [0b000, 0b000, 0b111, 0b000, 0b000]),
    (b'.', [0b000, 0b000, 0b000, 0b000, 0b010]),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_degree_is_as_tall_as_wide_and_left_is_left() {
        let dot = |azimuth, elevation, colour| Dot {
            azimuth: Angle::deg(azimuth),
            elevation: Angle::deg(elevation),
            colour,
        };
        let dots = [dot(20.0, 5.0, [1, 0, 0]), dot(-20.0, -5.0, [2, 0, 0])];
        let Picture { width, height, pixels } = scatter(&dots).unwrap();
        // 40° take 1500 pixels, so 10° take 375.
        assert_eq!((width, height), (1501 + MARGIN.0 + EDGE, 376 + MARGIN.1 + EDGE));
        let at = |x: usize, y: usize| pixels[3 * (y * width + x)];
        assert_eq!((at(MARGIN.0, EDGE), at(MARGIN.0 + 1500, EDGE + 375)), (1, 2));
        assert!(scatter(&[]).is_err());
        // A single direction has an extent of zero.
        scatter(&dots[..1]).unwrap();
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(ticks((-12.0, 31.0), 5.0), [-10.0, 0.0, 10.0, 20.0, 30.0]);
        assert_eq!([-0.0, 0.1 * 3.0, -45.0].map(label), ["0", "0.3", "-45"]);
    }
}
