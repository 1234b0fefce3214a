//! Pictures of the surfaces' own colours, in the light of a lamp at the sensor.

use std::sync::LazyLock;

use super::format::{Content, EncodeError, FormatSpec, Kind, field};
use super::options::Options;
use super::picture::{Picture, check_sides};
use super::sensor_frame::SensorFrame;

/// The colour of each pixel's first return, as the channels `color.R`, `color.G` and `color.B` have it, encoded as sRGB. A pixel
/// without a return is black.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "color",
    ending: "color.png",
    about: "pictures of base colours in the light of a lamp at the sensor",
    content: Content::Pixels(&[field("red, green, blue", "8-bit", "sRGB; black is nothing")]),
    read_by: "PIL, OpenCV 4 and 5",
    check: |sensor, _| check_sides(sensor),
    encoding_bytes_a_ray: |_, _| 2 * 3,
    file_bytes_a_ray: |_, _| 3,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

pub(super) fn encode(frame: &SensorFrame, _: &Options) -> Result<Vec<u8>, EncodeError> {
    let mut pixels = vec![0; 3 * frame.frame.pixels()];
    for (pixel, rgb) in pixels.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        if let Some(slot) = frame.frame.slot(pixel, 0) {
            *rgb = frame.color(slot).map(looked_up);
        }
    }
    Picture { width: frame.frame.columns(), height: frame.frame.rows(), pixels }.to_png()
}

/// The number [`encoded`] of a linear value, by a table.
fn looked_up(linear: f32) -> u8 {
    /// The bits of a value below those of its cell. A cell is so short that the number changes by at most 1 in it: it grows by less
    /// than 78 in an octave, 255·1.055·ln 2/2.4, and a cell is an octave's 128th part.
    const SHIFT: u32 = 16;
    /// Of each cell of values from 0 to 1 the number at its beginning, and the bits of the first value with the next number.
    static CELLS: LazyLock<Vec<(u8, u32)>> = LazyLock::new(|| {
        (0..=1.0_f32.to_bits() >> SHIFT)
            .map(|cell| {
                let (start, end) = (cell << SHIFT, (cell + 1) << SHIFT);
                let least = encoded(f32::from_bits(start));
                let (mut with_least, mut after) = (start, end);
                while after - with_least > 1 {
                    let middle = with_least.midpoint(after);
                    match encoded(f32::from_bits(middle)) == least {
                        true => with_least = middle,
                        false => after = middle,
                    }
                }
                (least, after)
            })
            .collect()
    });
    // What is no number is 0, as in the computation, and so is a negative zero.
    let bits = if linear > 0.0 { linear.min(1.0) } else { 0.0 }.to_bits();
    let (least, next) = CELLS[(bits >> SHIFT) as usize];
    least + u8::from(bits >= next)
}

/// The 8-bit number of a linear value in sRGB (IEC 61966-2-1).
fn encoded(linear: f32) -> u8 {
    let linear = f64::from(linear).clamp(0.0, 1.0);
    let value = match linear <= 0.003_130_8 {
        true => 12.92 * linear,
        false => 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055,
    };
    (255.0 * value).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table values of IEC 61966-2-1: the inverse of ((n/255 + 0.055)/1.055)^2.4.
    #[test]
    fn linear_values_are_encoded_as_srgb() {
        assert_eq!([0.0, 1.0, 2.0, -1.0].map(encoded), [0, 255, 255, 0]);
        for number in 0..=255_u8 {
            let value = f64::from(number) / 255.0;
            let linear = match value <= 0.04045 {
                true => value / 12.92,
                false => libm::pow((value + 0.055) / 1.055, 2.4),
            };
            assert_eq!(encoded(linear as f32), number);
        }
        // 1.055·0.5^(1/2.4) − 0.055 = 0.73536, of 255.
        assert_eq!(encoded(0.5), 188);
    }

    #[test]
    fn the_table_has_the_numbers_of_the_computation() {
        let all = (0..=1.0_f32.to_bits()).step_by(9973).map(f32::from_bits);
        let others = [-1.0, 2.0, f32::INFINITY, f32::NAN, -0.0, 1.0, f32::MIN_POSITIVE];
        for linear in all.chain(others) {
            assert_eq!(looked_up(linear), encoded(linear), "{linear}");
        }
        // On either side of each threshold.
        for number in 0..255_u8 {
            let (mut below, mut above) = (0, 1.0_f32.to_bits());
            while above - below > 1 {
                let middle = (below + above) / 2;
                if encoded(f32::from_bits(middle)) > number { above = middle } else { below = middle }
            }
            assert_eq!([below, above].map(|bits| looked_up(f32::from_bits(bits))), [number, number + 1]);
        }
    }
}
