//! Pictures of the surfaces' own colours, in the light of a lamp at the sensor.

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
    let color = |pixel: usize| frame.frame.slot(pixel, 0).map_or([0.0; 3], |slot| frame.color(slot));
    let pixels = (0..frame.frame.pixels()).flat_map(|pixel| color(pixel).map(encoded)).collect();
    Picture { width: frame.frame.columns(), height: frame.frame.rows(), pixels }.to_png()
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
}
