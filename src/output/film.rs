//! Pictures of many frames: animated PNGs, and contact sheets.

use std::collections::BTreeSet;

use super::format::EncodeError;
use super::picture::{NO_RETURN_COLOUR, Picture, Rgb};

impl Picture {
    /// The picture with another width and its own proportions. A pixel is the one that lies at its middle, so that no colour
    /// appears that was not there.
    #[must_use]
    pub fn scaled_to(&self, width: usize) -> Self {
        if width == self.width || self.width == 0 || self.height == 0 {
            return self.clone();
        }
        let height = ((self.height * width + self.width / 2) / self.width).max(1);
        let middle = |at: usize, size: usize, of: usize| ((2 * at + 1) * of / (2 * size)).min(of - 1);
        let mut pixels = Vec::with_capacity(3 * width * height);
        for y in 0..height {
            let row = 3 * self.width * middle(y, height, self.height);
            for x in 0..width {
                let at = row + 3 * middle(x, width, self.width);
                pixels.extend_from_slice(&self.pixels[at..at + 3]);
            }
        }
        Self { width, height, pixels }
    }

    /// Pictures below each other, with a line between two.
    #[must_use]
    pub fn stacked(pictures: &[Self]) -> Self {
        Self::grid(pictures, 1)
    }

    /// Pictures side by side, `columns` in a row, with a line between two.
    #[must_use]
    pub fn grid(pictures: &[Self], columns: usize) -> Self {
        let columns = columns.clamp(1, pictures.len().max(1));
        let wide = pictures.iter().map(|p| p.width).max().unwrap_or(0);
        let width = columns * wide + (columns - 1) * GAP;
        let heights: Vec<usize> =
            pictures.chunks(columns).map(|row| row.iter().map(|p| p.height).max().unwrap_or(0)).collect();
        let height = heights.iter().sum::<usize>() + heights.len().saturating_sub(1) * GAP;
        let mut grid = Self::new(width, height, NO_RETURN_COLOUR);
        let mut y = 0;
        for (row, height) in pictures.chunks(columns).zip(heights) {
            for (column, picture) in row.iter().enumerate() {
                grid.paste((column * (wide + GAP), y), picture);
            }
            y += height + GAP;
        }
        grid
    }

    fn colours(&self) -> impl Iterator<Item = Rgb> + '_ {
        self.pixels.chunks_exact(3).map(|p| [p[0], p[1], p[2]])
    }
}

/// Pixels between two pictures of one.
const GAP: usize = 4;

/// The colours of pictures, as long as a palette can hold them.
#[derive(Clone, Debug, Default)]
pub struct Palette(BTreeSet<Rgb>);

/// The most colours of a palette.
const MOST_COLOURS: usize = 256;

impl Palette {
    /// Adds the colours of a picture.
    pub fn add(&mut self, picture: &Picture) {
        if self.0.len() <= MOST_COLOURS {
            self.0.extend(picture.colours());
        }
    }

    /// The colours in order, if they are few enough.
    fn colours(&self) -> Option<Vec<Rgb>> {
        (self.0.len() <= MOST_COLOURS).then(|| self.0.iter().copied().collect())
    }
}

/// A PNG that shows `frames` pictures of one size, `rate_hz` a second, over and over; of one picture a plain PNG. The pictures'
/// colours are those of the palette, if it can hold them. A program that knows plain PNGs only shows the first picture.
///
/// # Errors
/// The first error of `frame`, or an [`EncodeError`] if pictures differ in size or are larger than a PNG allows.
pub fn film<E: From<EncodeError>>(
    frames: u32,
    rate_hz: f64,
    palette: &Palette,
    mut frame: impl FnMut(u32) -> Result<Picture, E>,
) -> Result<Vec<u8>, E> {
    let wrong = |e: png::EncodingError| EncodeError::new(format!("the PNG can't be encoded: {e}"));
    let mut picture = frame(0)?;
    let size = (picture.width, picture.height);
    let colours = palette.colours();
    let mut file = Vec::new();
    let side = |n: usize| u32::try_from(n).unwrap_or(0); // the encoder refuses a side of 0
    let mut encoder = png::Encoder::new(&mut file, side(size.0), side(size.1));
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    match &colours {
        Some(colours) => {
            encoder.set_color(png::ColorType::Indexed);
            encoder.set_palette(colours.concat());
            // Numbers of a palette are no quantities whose differences are small.
            encoder.set_filter(png::Filter::NoFilter);
        }
        None => encoder.set_color(png::ColorType::Rgb),
    }
    if frames > 1 {
        let (numerator, denominator) = delay(rate_hz);
        encoder.set_animated(frames, 0).map_err(wrong)?;
        encoder.set_frame_delay(numerator, denominator).map_err(wrong)?;
    }
    let mut writer = encoder.write_header().map_err(wrong)?;
    for number in 0..frames {
        if number > 0 {
            picture = frame(number)?;
        }
        if (picture.width, picture.height) != size {
            let (width, height) = (picture.width, picture.height);
            let problem = format!(
                "picture {number} has {width} × {height} pixels, and the first {} × {}",
                size.0, size.1
            );
            return Err(EncodeError::new(problem).into());
        }
        match &colours {
            Some(colours) => {
                let index = |colour: Rgb| colours.binary_search(&colour).unwrap_or_default() as u8;
                let pixels: Vec<u8> = picture.colours().map(index).collect();
                writer.write_image_data(&pixels).map_err(wrong)?;
            }
            None => writer.write_image_data(&picture.pixels).map_err(wrong)?,
        }
    }
    writer.finish().map_err(wrong)?;
    Ok(file)
}

/// The seconds that a picture is shown, as a fraction.
fn delay(rate_hz: f64) -> (u16, u16) {
    let milliseconds = (1000.0 / rate_hz).round().clamp(1.0, f64::from(u16::MAX));
    (milliseconds as u16, 1000)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn picture(width: usize, height: usize, colour: impl Fn(usize, usize) -> Rgb) -> Picture {
        let pixels = (0..width * height).flat_map(|i| colour(i % width, i / width)).collect();
        Picture { width, height, pixels }
    }

    /// The frames of an animated PNG as red, green and blue, and the time that each is shown.
    fn decoded(file: &[u8]) -> (Vec<Vec<u8>>, Vec<(u16, u16)>) {
        let mut decoder = png::Decoder::new(Cursor::new(file));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let count = reader.info().animation_control().map_or(1, |control| control.num_frames);
        let (mut frames, mut delays) = (vec![], vec![]);
        for _ in 0..count {
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            delays
                .extend(reader.info().frame_control().map(|control| (control.delay_num, control.delay_den)));
            frames.push(pixels);
        }
        (frames, delays)
    }

    /// With few colours in a palette, and with many without one.
    #[test]
    fn a_film_has_the_pixels_of_its_pictures() {
        let few =
            |n: u32| picture(20, 9, move |x, y| [(40 * (x / 7) + n as usize) as u8, 200, (y / 5) as u8]);
        let many = |n: u32| picture(40, 30, move |x, y| [6 * x as u8, 8 * y as u8, n as u8]);
        for (is_indexed, made) in [(true, &few as &dyn Fn(u32) -> Picture), (false, &many)] {
            let mut palette = Palette::default();
            (0..3).for_each(|n| palette.add(&made(n)));
            let file = film::<EncodeError>(3, 10.0, &palette, |n| Ok(made(n))).unwrap();
            let (frames, delays) = decoded(&file);
            assert_eq!(frames, (0..3).map(|n| made(n).pixels).collect::<Vec<_>>());
            assert_eq!(delays, [(100, 1000); 3]);
            assert_eq!(file[25] == 3, is_indexed, "the colour type, of which 3 is a palette");
        }
    }

    #[test]
    fn one_picture_is_a_plain_png() {
        let one = picture(5, 4, |x, y| [x as u8, y as u8, 7]);
        let mut palette = Palette::default();
        palette.add(&one);
        let file = film::<EncodeError>(1, 10.0, &palette, |_| Ok(one.clone())).unwrap();
        assert!(!file.windows(4).any(|w| w == b"acTL"));
        assert_eq!(decoded(&file), (vec![one.pixels], vec![]));
    }

    #[test]
    fn pictures_of_different_sizes_are_no_film() {
        let made = |n: u32| Ok::<_, EncodeError>(Picture::new(4 + n as usize, 4, [0; 3]));
        let problem = film(2, 10.0, &Palette::default(), made).unwrap_err().to_string();
        assert_eq!(problem, "picture 1 has 5 × 4 pixels, and the first 4 × 4");
    }

    #[test]
    fn a_scaled_picture_has_its_proportions_and_no_new_colour() {
        let large = picture(12, 6, |x, y| [x as u8, y as u8, 0]);
        let half = large.scaled_to(6);
        assert_eq!((half.width, half.height), (6, 3));
        assert_eq!(half.colours().next(), Some([1, 1, 0]));
        assert!(half.colours().all(|colour| large.colours().any(|other| other == colour)));
        assert_eq!(half.scaled_to(12).scaled_to(6), half);
        assert_eq!(large.scaled_to(1).height, 1);
    }

    #[test]
    fn a_grid_has_every_picture_at_its_place() {
        let pictures: Vec<_> = (1..=5).map(|n| Picture::new(3, 2, [n; 3])).collect();
        let grid = Picture::grid(&pictures, 2);
        assert_eq!((grid.width, grid.height), (2 * 3 + GAP, 3 * 2 + 2 * GAP));
        let at = |x: usize, y: usize| grid.pixels[3 * (y * grid.width + x)];
        assert_eq!([at(0, 0), at(3 + GAP, 0), at(0, 2 + GAP), at(2, 4 + 2 * GAP)], [1, 2, 3, 5]);
        assert_eq!(at(3 + GAP, 4 + 2 * GAP), NO_RETURN_COLOUR[0]);
        assert_eq!(Picture::stacked(&pictures), Picture::grid(&pictures, 1));
    }

    #[test]
    fn a_rate_becomes_a_time() {
        assert_eq!([10.0, 30.0, 1e-9, 1e9].map(delay), [(100, 1000), (33, 1000), (65535, 1000), (1, 1000)]);
    }
}
