//! Legends: a title above a picture, and below it what its colours mean.

use super::picture::{CHARACTER, LINE_COLOUR, NO_RETURN_COLOUR, Picture, Rgb, TEXT_COLOUR, text_width};

/// A line of a legend.
pub enum Entry<'a> {
    /// A scale from numbers to colours.
    Ramp {
        /// The quantity with its unit.
        name: String,
        /// Numbers, each with its place on the scale from 0 to 1.
        ticks: Vec<(f64, String)>,
        /// The colour of a place on the scale.
        colour: &'a dyn Fn(f64) -> Rgb,
    },
    /// A colour with its meaning.
    Swatch(Rgb, String),
    /// A remark.
    Note(String),
}

/// Pixels between the parts of a legend, and around it.
const GAP: usize = 8;

/// The width of a ramp.
const RAMP_WIDTH: usize = 320;

/// The picture in a frame with a title and a legend, which is as wide as they need.
pub fn with_legend(picture: Picture, title: &str, entries: &[Entry]) -> Picture {
    // Text that is clear beside a small picture is tiny beside a large one.
    let size = if picture.width >= 1200 { 2 } else { 1 };
    let line = CHARACTER * size;
    let ramp = RAMP_WIDTH * size;
    let width_of = |entry: &Entry| match entry {
        // The first and the last number stand half outside.
        Entry::Ramp { name, .. } => text_width(name, size) + 8 * line + ramp,
        Entry::Swatch(_, text) => text_width(text, size) + line + GAP,
        Entry::Note(text) => text_width(text, size),
    };
    let height_of = |entry: &Entry| match entry {
        Entry::Ramp { .. } => 2 * line + 2 * GAP,
        Entry::Swatch(..) | Entry::Note(_) => line + GAP,
    };
    let widest = entries.iter().map(width_of).chain([text_width(title, size)]).max().unwrap_or(0);
    let width = picture.width.max(widest + 2 * GAP);
    let top = line + 2 * GAP;
    // Entries that are short share a line.
    let mut places = Vec::new();
    let (mut x, mut y, mut high) = (GAP, top + picture.height + GAP, 0);
    for entry in entries {
        if x > GAP && x + width_of(entry) + GAP > width {
            (x, y, high) = (GAP, y + high, 0);
        }
        places.push((x, y));
        x += width_of(entry) + 3 * GAP;
        high = high.max(height_of(entry));
    }
    let mut framed = Picture::new(width, y + high + GAP, NO_RETURN_COLOUR);
    framed.text((GAP as i64, GAP as i64), title, size, TEXT_COLOUR);
    framed.paste((0, top), &picture);
    drop(picture);
    for (entry, (x, y)) in entries.iter().zip(places) {
        let at = |dx: usize, dy: usize| ((x + dx) as i64, (y + dy) as i64);
        match entry {
            Entry::Note(text) => framed.text(at(0, 0), text, size, TEXT_COLOUR),
            Entry::Swatch(colour, text) => {
                framed.fill(at(0, 0), (line, line), LINE_COLOUR);
                framed.fill(at(1, 1), (line - 2, line - 2), *colour);
                framed.text(at(line + GAP, 0), text, size, TEXT_COLOUR);
            }
            Entry::Ramp { name, ticks, colour } => {
                framed.text(at(0, 0), name, size, TEXT_COLOUR);
                let start = text_width(name, size) + 4 * line;
                for step in 0..ramp {
                    framed.fill(at(start + step, 0), (1, line), colour(step as f64 / (ramp - 1) as f64));
                }
                for (part, number) in ticks {
                    let middle = start + (part.clamp(0.0, 1.0) * (ramp - 1) as f64).round() as usize;
                    framed.fill(at(middle, line), (1, GAP / 2), LINE_COLOUR);
                    let left = middle.saturating_sub(text_width(number, size) / 2);
                    framed.text(at(left, line + GAP / 2 + 2), number, size, TEXT_COLOUR);
                }
            }
        }
    }
    framed
}

/// Round numbers from `low` to `high`, at most about `most`, each with its place from 0 to 1: on a logarithmic scale 1, 2 and 5
/// times powers of ten.
pub fn ticks(low: f64, high: f64, is_log: bool, most: usize) -> Vec<(f64, String)> {
    let span = high - low;
    if !(span > 0.0 && span.is_finite() && low.is_finite()) || (is_log && low <= 0.0) {
        return vec![(0.5, shown(low))];
    }
    let mut found: Vec<f64> = Vec::new();
    if is_log {
        let first = libm::log10(low).floor() as i32;
        let last = libm::log10(high).ceil() as i32;
        for mantissas in [&[1.0, 2.0, 5.0][..], &[1.0]] {
            found = (first..=last)
                .flat_map(|e| mantissas.iter().map(move |m| m * libm::pow(10.0, f64::from(e))))
                .filter(|v| (low * (1.0 - 1e-9)..=high * (1.0 + 1e-9)).contains(v))
                .collect();
            if found.len() <= most {
                break;
            }
        }
        if found.len() < 2 {
            found = vec![low, high];
        }
        let log = libm::log(high / low);
        return found.into_iter().map(|v| (libm::log(v / low) / log, shown(v))).collect();
    }
    let step = round_step(span / most.max(1) as f64);
    let first = (low / step - 1e-9).ceil() as i64;
    for index in first..first + most as i64 + 2 {
        let value = index as f64 * step;
        if value <= high + 1e-9 * span {
            found.push(value);
        }
    }
    found.into_iter().map(|v| ((v - low) / span, shown(v))).collect()
}

/// The least of 1, 2 and 5 times a power of ten that is not less than a number.
pub fn round_step(least: f64) -> f64 {
    let power = libm::pow(10.0, libm::log10(least).floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().find(|m| m * power >= least * (1.0 - 1e-9));
    step.unwrap_or(10.0) * power
}

/// A number in at most four digits.
fn shown(value: f64) -> String {
    let digits = if value == 0.0 { 0 } else { (3 - libm::log10(value.abs()).floor() as i32).clamp(0, 6) };
    let text = format!("{value:.*}", digits as usize);
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_legend_is_below_its_picture_and_as_wide_as_its_words() {
        let picture = Picture::new(20, 10, [200, 0, 0]);
        let entries = [
            Entry::Ramp {
                name: "range, m".to_owned(),
                ticks: ticks(1.0, 100.0, true, 8),
                colour: &|part| [(part * 255.0) as u8, 0, 0],
            },
            Entry::Swatch([0, 200, 0], "no return".to_owned()),
            Entry::Note("a note that is long enough to need a line of its own, beside the swatch".to_owned()),
        ];
        let framed = with_legend(picture, "title", &entries);
        assert!(framed.width > 300 && framed.height > 60, "{} × {}", framed.width, framed.height);
        let at = |x: usize, y: usize| &framed.pixels[3 * (y * framed.width + x)..][..3];
        assert_eq!(at(19, CHARACTER + 2 * GAP + 9), [200, 0, 0], "the picture is whole");
        assert!(framed.pixels.chunks(3).any(|p| p == [0, 200, 0]));
        assert_eq!(framed.pixels.len(), 3 * framed.width * framed.height);
    }

    #[test]
    fn numbers_on_scales_are_round() {
        let words = |low, high, is_log, most| -> Vec<String> {
            ticks(low, high, is_log, most).into_iter().map(|(_, number)| number).collect()
        };
        assert_eq!(words(-15.0, 15.0, false, 7), ["-15", "-10", "-5", "0", "5", "10", "15"]);
        assert_eq!(words(0.9, 120.0, true, 8), ["1", "2", "5", "10", "20", "50", "100"]);
        assert_eq!(words(1e-3, 120.0, true, 6), ["0.001", "0.01", "0.1", "1", "10", "100"]);
        assert_eq!(words(3.1, 3.4, true, 6), ["3.1", "3.4"]);
        assert_eq!(words(5.0, 5.0, true, 6), ["5"]);
        assert_eq!(words(0.0, f64::INFINITY, true, 6), ["0"]);
        assert_eq!([0.03, 0.2, 0.21, 7.0, 5.0].map(round_step), [0.05, 0.2, 0.5, 10.0, 5.0]);
        let places = ticks(0.0, 10.0, false, 5);
        assert!(
            places.iter().all(|(part, number)| (part * 10.0 - number.parse::<f64>().unwrap()).abs() < 1e-9)
        );
    }
}
