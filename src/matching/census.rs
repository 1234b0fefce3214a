//! The census transform: which neighbours of a pixel are darker than it. Changes of brightness between the images leave it as it is.

use rayon::prelude::*;

use super::{Gray, Settings};

/// The census of each pixel of an image. Its bits lie in planes of a byte for each pixel of a row, so that neighbouring pixels are
/// compared side by side.
pub struct Census {
    pub width: usize,
    pub height: usize,
    /// The planes of a row: one for each 8 bits.
    pub planes: usize,
    /// The bytes of all rows, each plane by plane.
    bytes: Vec<u8>,
}

impl Census {
    /// The census of an image. Beyond its border the image goes on as its outermost pixels.
    pub fn of(image: &Gray, settings: &Settings) -> Self {
        let planes = settings.bits().div_ceil(8);
        let padded = Padded::of(image, settings.census);
        let mut bytes = vec![0; image.pixels.len() * planes];
        bytes.par_chunks_mut(image.width * planes).enumerate().for_each(|(row, bytes)| {
            let centre = padded.centre(row);
            for (bit, neighbour) in padded.neighbours(row).enumerate() {
                let plane = &mut bytes[bit / 8 * image.width..][..image.width];
                for ((byte, neighbour), centre) in plane.iter_mut().zip(neighbour).zip(centre) {
                    *byte |= u8::from(neighbour < centre) << (bit % 8);
                }
            }
        });
        Self { width: image.width, height: image.height, planes, bytes }
    }

    /// The same with each row from the right to the left.
    pub fn mirrored(mut self) -> Self {
        self.bytes.par_chunks_mut(self.width).for_each(<[u8]>::reverse);
        self
    }

    /// The planes of a row, one after the other.
    pub fn row(&self, row: usize) -> &[u8] {
        let length = self.width * self.planes;
        &self.bytes[row * length..][..length]
    }
}

/// Whether each pixel's census window has the texture that the settings ask for.
pub fn textured(image: &Gray, settings: &Settings) -> Vec<bool> {
    let texture = settings.texture;
    let padded = Padded::of(image, settings.census);
    let mut textured = vec![true; image.pixels.len()];
    textured.par_chunks_mut(image.width).enumerate().for_each(|(row, textured)| {
        let centre = padded.centre(row);
        let mut counts = vec![0_u8; image.width];
        for neighbour in padded.neighbours(row) {
            for ((count, neighbour), centre) in counts.iter_mut().zip(neighbour).zip(centre) {
                *count += u8::from(neighbour.abs_diff(*centre) >= texture.difference);
            }
        }
        for (textured, count) in textured.iter_mut().zip(counts) {
            *textured = count >= texture.count;
        }
    });
    textured
}

/// An image with a margin in which its outermost pixels are repeated, as wide as a window reaches.
struct Padded {
    /// The columns and rows of the window.
    window: (usize, usize),
    width: usize,
    stride: usize,
    pixels: Vec<u8>,
}

impl Padded {
    fn of(image: &Gray, window: (usize, usize)) -> Self {
        let (margin_x, margin_y) = (window.0 / 2, window.1 / 2);
        let stride = image.width + 2 * margin_x;
        let mut pixels = Vec::with_capacity(stride * (image.height + 2 * margin_y));
        for row in 0..image.height + 2 * margin_y {
            let row = row.saturating_sub(margin_y).min(image.height - 1);
            let line = &image.pixels[row * image.width..][..image.width];
            pixels.extend(std::iter::repeat_n(line[0], margin_x));
            pixels.extend(line);
            pixels.extend(std::iter::repeat_n(line[image.width - 1], margin_x));
        }
        Self { window, width: image.width, stride, pixels }
    }

    /// The pixels of the image's row, each moved by so many columns and rows less half of the window.
    fn moved(&self, row: usize, columns: usize, rows: usize) -> &[u8] {
        &self.pixels[(row + rows) * self.stride + columns..][..self.width]
    }

    fn centre(&self, row: usize) -> &[u8] {
        self.moved(row, self.window.0 / 2, self.window.1 / 2)
    }

    /// The image's row as seen from each pixel of the window but the centre.
    fn neighbours(&self, row: usize) -> impl Iterator<Item = &[u8]> {
        let (columns, rows) = self.window;
        let all = (0..columns * rows).filter(move |&at| at != columns * rows / 2);
        all.map(move |at| self.moved(row, at % columns, at / columns))
    }
}
