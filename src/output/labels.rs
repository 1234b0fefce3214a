//! Images of labels and of objects as PNGs of one number a pixel, as tools for segmentation have them.

use super::channel::channel;
use super::format::{Content, EncodeError, FormatSpec, Kind, field};
use super::image::Image;
use super::options::{OptionSpec, OptionValue, OptionValues, Options};
use super::picture::{Pixels, check_sides, encode_numbers};
use super::sensor_frame::SensorFrame;

/// The semantic label of each pixel, 0 for none. Of several returns the first is written.
pub(super) static LABELS: FormatSpec = FormatSpec {
    name: "labels",
    ending: "labels.png",
    about: "images of semantic labels",
    content: Content::Pixels(&[field("id.semantic", "16- or 8-bit grey, or 8-bit palette", "0 is none")]),
    most_label: most_number,
    kind: Kind::File(|frame, options| encode(frame, "id.semantic", options)),
    ..NUMBERS
};

/// The id of the object in each pixel, 0 for nothing. Of several returns the first is written.
pub(super) static INSTANCES: FormatSpec = FormatSpec {
    name: "instances",
    ending: "instances.png",
    about: "images of the objects that are seen",
    content: Content::Pixels(&[field(
        "id.instance",
        "16- or 8-bit grey, or 8-bit palette",
        "from 1; 0 is nothing",
    )]),
    most_instance: most_number,
    kind: Kind::File(|frame, options| encode(frame, "id.instance", options)),
    ..NUMBERS
};

/// The fields that both formats have in common.
const NUMBERS: FormatSpec = FormatSpec {
    read_by: "PIL, OpenCV 4 and 5",
    options: &[BITS, PALETTE],
    check_options: |options| {
        if options.is_set(&PALETTE) && options.given(&BITS) == Some(OptionValue::Number(16.0)) {
            return Err(EncodeError::new("a palette has 8 bits: leave out `bits`"));
        }
        Ok(())
    },
    check: |sensor, _| check_sides(sensor),
    encoding_bytes_a_ray: |_, _| 4 + 2 * 2,
    file_bytes_a_ray: |_, options| if pixels(options) == Pixels::Grey16 { 2 } else { 1 },
    ..FormatSpec::PLAIN
};

const BITS: OptionSpec = OptionSpec {
    name: "bits",
    about: "The bits of a pixel, which decide how large its number can be: 8 hold up to 255, 16 up to 65535. A palette has 8.",
    values: OptionValues::OneOf { numbers: &[8, 16], default: 16 },
};

const PALETTE: OptionSpec = OptionSpec {
    name: "palette",
    about: "Whether each number has a colour of its own, so that people see it: an indexed PNG, whose pixels are the numbers \
            still. 0 is black.",
    values: OptionValues::Flag { default: false },
};

fn pixels(options: &Options) -> Pixels {
    if options.is_set(&PALETTE) {
        Pixels::Palette
    } else if options.number(&BITS) == 8.0 {
        Pixels::Grey8
    } else {
        Pixels::Grey16
    }
}

/// The largest number that a pixel can hold.
fn most_number(options: &Options) -> u32 {
    if pixels(options) == Pixels::Grey16 { u16::MAX.into() } else { u8::MAX.into() }
}

fn encode(frame: &SensorFrame, name: &str, options: &Options) -> Result<Vec<u8>, EncodeError> {
    let image = Image::with_channels(frame, 0, channel(name));
    let numbers = image.u32(name).unwrap_or_default();
    // A frame can have numbers that its scene did not tell of.
    let most = most_number(options);
    if let Some(number) = numbers.iter().find(|number| **number > most) {
        return Err(EncodeError::new(format!(
            "a pixel holds at most {most}, and one has the number {number}"
        )));
    }
    encode_numbers(
        image.columns,
        image.rows,
        numbers,
        pixels(options),
        &[("beamcast:channel", name.to_owned())],
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_palette_has_8_bits() {
        let mut options = Options::none(LABELS.options);
        assert_eq!((pixels(&options), most_number(&options)), (Pixels::Grey16, 65535));
        options.set(&PALETTE, 1.0);
        (LABELS.check_options)(&options).unwrap();
        assert_eq!((pixels(&options), most_number(&options)), (Pixels::Palette, 255));
        options.set(&BITS, 16.0);
        let told = (LABELS.check_options)(&options).unwrap_err().to_string();
        assert_eq!(told, "a palette has 8 bits: leave out `bits`");
    }
}
