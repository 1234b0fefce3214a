//! Encoding of OpenEXR range images; [`deep`] has a sample a return instead of a part a return.

mod attributes;
mod blocks;
pub(super) mod deep;
mod zip;

use exr::compression::Compression;
use exr::meta::attribute::{AttributeValue, SampleType, Text};
use exr::meta::header::LayerAttributes;
use exr::prelude::f16;

use self::attributes::{Value, attributes};
use self::blocks::{Part, PartChannel, compress};
use super::channel::{BYTES_A_VALUE, ChannelSpec, DEPTH_FOR_OPENCV, repeated_for_opencv};
use super::deflate::{FASTEST, LEVEL, level};
use super::format::{Content, EncodeError, FormatSpec, Kind};
use super::image::Samples;
use super::options::{OptionSpec, OptionValues, Options};
use super::places::Places;
use super::recorded;
use super::sensor_frame::SensorFrame;
use crate::sensor::Sensor;
use crate::source::words::joined;

/// The value of the attribute `beamcast:no_return`.
const NO_RETURN: &str = "+inf in range, Z and Y; 0 in all other channels except cause";

/// A range image with every channel, as scanlines of 32 bits a value. A frame with several returns a pixel has one part for each
/// return number.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "exr",
    ending: "exr",
    about: "OpenEXR range images of all channels",
    content: Content::Channels,
    read_by: "OpenEXR",
    options: &[COMPRESSION, LEVEL, HALF],
    check_options: |options| match (options.given(&LEVEL), options.text(&COMPRESSION)) {
        (None, _) | (_, "zip" | "zips") => Ok(()),
        (_, other) => Err(EncodeError::new(format!(
            "`level` is that of `zip` and `zips`, and the compression is `{other}`: leave out one of them"
        ))),
    },
    check,
    loses,
    encoding_bytes_a_ray: |sensor, options| {
        // This counts the compressed blocks and the file, under the assumption that compression saves nothing. The
        // channels of a few blocks are there at a time.
        2 * file_bytes_a_ray(sensor, options)
    },
    file_bytes_a_ray,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

const COMPRESSION: OptionSpec = OptionSpec {
    name: "compression",
    about: "How the pixels are compressed, which never changes a value: `zip` in blocks of 16 lines, `zips` line by line, which \
            lets programs read single lines, `piz` by wavelets, which suits noise, `rle` by runs of equal bytes, which is fast, or \
            `none`.",
    values: OptionValues::Word { words: &["zip", "zips", "piz", "rle", "none"], default: "zip" },
};

const HALF: OptionSpec = OptionSpec {
    name: "half",
    about: "Whether `intensity`, `normal`, `color` and `confidence` are half floats of 16 bits, which rounds them by at most 0.05 %. \
            Range, depth, time and all others keep 32 bits: near 100 m, half floats are 62 mm apart.",
    values: OptionValues::Flag { default: false },
};

/// Whether a channel becomes half floats: those whose values mean no more than a half float says.
///
/// A half float has 11 significant bits (IEEE 754 binary16), and so it is within 2⁻¹¹ (0.05 %) of the value, and equal to whole
/// numbers up to 2048, such as intensities on the scales of makers.
fn is_half(channel: &str, options: &Options) -> bool {
    const FEW_BITS: [&str; 4] = ["intensity", "normal.", "color.", "confidence"];
    options.is_set(&HALF) && FEW_BITS.iter().any(|start| channel.starts_with(start))
}

/// The half float nearest to a value. What is larger than all of them, as only an ideal intensity of a retroreflector could be,
/// becomes the largest.
fn half(value: f32) -> f16 {
    f16::from_f32(value.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()))
}

fn loses(sensor: &Sensor, options: &Options) -> Option<String> {
    let rounded = options.channels.of(sensor).filter(|channel| is_half(channel.name, options));
    let names: Vec<String> = rounded.map(|channel| channel.name.to_owned()).collect();
    (!names.is_empty()).then(|| {
        format!("half floats round {} by at most 0.05 %: half = false keeps 32 bits", joined(&names, "and"))
    })
}

fn file_bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    let repeated = repeated_for_opencv(sensor);
    let bytes = |name: &str| match name {
        name if is_half(name, options) => BYTES_A_VALUE / 2,
        name if name == repeated => 2 * BYTES_A_VALUE,
        _ => BYTES_A_VALUE,
    };
    let of_return = options.channels.of(sensor).map(|channel| bytes(channel.name)).sum::<u64>();
    of_return * sensor.most_returns() as u64
}

fn check(sensor: &Sensor, _: &Options) -> Result<(), EncodeError> {
    // OpenEXR keeps coordinates below 2³⁰ so that windows can be added without overflow.
    let limit = i32::MAX as usize / 2;
    let (rows, columns) = (sensor.pattern.rows(), sensor.pattern.columns());
    if rows >= limit || columns >= limit {
        return Err(EncodeError::new(format!(
            "an EXR image has fewer than {limit} rows and columns, not {rows} × {columns}"
        )));
    }
    Ok(())
}

fn encode(frame: &SensorFrame, options: &Options) -> Result<Vec<u8>, EncodeError> {
    let compression = match options.text(&COMPRESSION) {
        "zips" => Compression::ZIP1,
        "piz" => Compression::PIZ,
        "rle" => Compression::RLE,
        "none" => Compression::Uncompressed,
        _ => Compression::ZIP16,
    };
    // The parts of a multi-part file need names.
    let count = frame.frame.most_returns().max(1);
    let name = |number| (count > 1).then(|| Text::from(format!("return{number}").as_str()));
    let parts: Vec<Part> = (0..count).map(|number| part(frame, number, name(number), options)).collect();
    file(&parts, compression, level(options), frame.memory_of_file(FORMAT.name))
}

/// The image of the returns with a number, from 0.
fn part<'f>(frame: &'f SensorFrame<'f>, number: usize, name: Option<Text>, options: &Options) -> Part<'f> {
    let specs: Vec<(&ChannelSpec, bool)> =
        options.channels.of(frame.capture.sensor).map(|spec| (spec, is_half(spec.name, options))).collect();
    let channel = |(column, (spec, is_half)): (usize, &(&ChannelSpec, bool))| PartChannel {
        name: Text::from(spec.name),
        kind: match (is_half, spec.is_measurement()) {
            (true, _) => SampleType::F16,
            (_, true) => SampleType::F32,
            (_, false) => SampleType::U32,
        },
        column,
    };
    let channels = specs.iter().enumerate().map(channel).collect();
    let values = move |row: usize, columns: &mut [Vec<u32>]| {
        let places = Places::of_return(frame.frame, row, number);
        for ((spec, is_half), values) in specs.iter().zip(columns) {
            spec.add_row(frame, number, &places, values);
            if *is_half {
                values.iter_mut().for_each(|value| *value = half(f32::from_bits(*value)).to_bits().into());
            }
        }
    };
    Part {
        rows: frame.frame.rows(),
        columns: frame.frame.columns(),
        attributes: layer_attributes(frame, name),
        channels: with_depth_for_opencv(channels, &[repeated_for_opencv(frame.capture.sensor)]),
        values: Box::new(values),
    }
}

/// The file of a recorded image, compressed without loss. Attributes that are numbers are those, and all others are texts.
pub(super) fn of_parts(recorded: Vec<recorded::Part>) -> Result<Vec<u8>, EncodeError> {
    let count = recorded.len();
    let parts: Vec<Part> =
        recorded.iter().enumerate().map(|(number, part)| recorded_part(part, number, count)).collect();
    file(&parts, Compression::ZIP16, FASTEST, Vec::new())
}

fn recorded_part<'r>(recorded: &'r recorded::Part, number: usize, count: usize) -> Part<'r> {
    let recorded::Part { name, image, attributes } = recorded;
    let attributes = attributes.iter().map(|(name, value)| (ascii(name), recorded_value(value)));
    let name = match (count, name.as_str()) {
        (1, _) => None,
        (_, "") => Some(format!("return{number}")),
        (_, name) => Some(name.to_owned()),
    };
    let attributes = LayerAttributes {
        layer_name: name.map(|name| ascii(&name)),
        other: attributes.collect(),
        ..LayerAttributes::default()
    };
    let channels = image.channels.iter().enumerate().map(|(column, channel)| PartChannel {
        name: ascii(&channel.name),
        kind: match channel.samples {
            Samples::F32(_) => SampleType::F32,
            Samples::U32(_) => SampleType::U32,
        },
        column,
    });
    let values = |row: usize, columns: &mut [Vec<u32>]| {
        let pixels = row * image.columns..(row + 1) * image.columns;
        for (channel, values) in image.channels.iter().zip(columns) {
            match &channel.samples {
                Samples::F32(samples) => {
                    values.extend(samples[pixels.clone()].iter().map(|value| value.to_bits()))
                }
                Samples::U32(samples) => values.extend_from_slice(&samples[pixels.clone()]),
            }
        }
    };
    Part {
        rows: image.rows,
        columns: image.columns,
        attributes,
        channels: with_depth_for_opencv(channels.collect(), &["Z", "range"]),
        values: Box::new(values),
    }
}

/// The channels sorted by name, with the first of some depths that is among them once more under the name that OpenCV reads.
fn with_depth_for_opencv(mut channels: Vec<PartChannel>, depths: &[&str]) -> Vec<PartChannel> {
    let find = |name: &str| channels.iter().find(|channel| channel.name == *name);
    let depth = depths.iter().find_map(|name| find(name)).cloned();
    if let (Some(depth), None) = (depth, find(DEPTH_FOR_OPENCV)) {
        channels.push(PartChannel { name: Text::from(DEPTH_FOR_OPENCV), ..depth });
    }
    channels.sort_by(|a, b| a.name.cmp(&b.name));
    channels
}

/// The file of parts, with attributes in the order of their names, in memory that is empty.
fn file(
    parts: &[Part],
    compression: Compression,
    level: u8,
    memory: Vec<u8>,
) -> Result<Vec<u8>, EncodeError> {
    let file = compress(parts, compression, level, memory);
    let mut file = file.map_err(|e| EncodeError::new(format!("the EXR can't be encoded: {e}")))?;
    sort_attributes(&mut file, parts.len());
    Ok(file)
}

/// A recorded attribute: the number whose digits it is, or the text.
fn recorded_value(value: &str) -> AttributeValue {
    match value.parse::<f64>() {
        Ok(number) if number.is_finite() && number.to_string() == value => AttributeValue::F64(number),
        _ => AttributeValue::Text(ascii(value)),
    }
}

/// A text of one byte for each character, as EXR has them: what is not in ASCII is escaped.
fn ascii(text: &str) -> Text {
    let escaped: String = text
        .chars()
        .map(|c| if c.is_ascii() && c != '\0' { c.to_string() } else { c.escape_default().to_string() })
        .collect();
    Text::from(escaped.as_str())
}

fn layer_attributes(frame: &SensorFrame, name: Option<Text>) -> LayerAttributes {
    let value = |value| match value {
        // An attribute holds one byte for each character.
        Value::Text(text) => AttributeValue::Text(Text::from(text.as_str())),
        Value::Number(number) => AttributeValue::F64(number),
    };
    let other = attributes(frame, NO_RETURN).into_iter();
    LayerAttributes {
        layer_name: name,
        other: other.map(|(name, of)| (Text::from(name.as_str()), value(of))).collect(),
        ..LayerAttributes::default()
    }
}

/// Sorts the attributes of each part's header by name. The library keeps our attributes in a hash map and so writes them in
/// another order each time. Any order is valid, and the header's length stays the same.
fn sort_attributes(file: &mut [u8], parts: usize) {
    const MAGIC_AND_VERSION: usize = 8;
    const END: usize = 1;
    let mut start = MAGIC_AND_VERSION;
    for _ in 0..parts {
        let mut attributes: Vec<&[u8]> = Vec::new();
        let mut rest = &file[start..];
        while let Some(length) = attribute_length(rest) {
            let (attribute, after) = rest.split_at(length);
            attributes.push(attribute);
            rest = after;
        }
        // Names end in 0, so comparing whole attributes compares their names.
        attributes.sort_unstable();
        let sorted = attributes.concat();
        file[start..start + sorted.len()].copy_from_slice(&sorted);
        start += sorted.len() + END;
    }
}

/// The number of bytes of the attribute with which `header` begins: name, 0, type, 0, length (32 bits), value. `None` at
/// the end of the header.
fn attribute_length(header: &[u8]) -> Option<usize> {
    let name = header.iter().position(|&b| b == 0).filter(|&length| length > 0)?;
    let kind = header[name + 1..].iter().position(|&b| b == 0)?;
    let start = name + 1 + kind + 1;
    let length = u32::from_le_bytes(header.get(start..start + 4)?.try_into().ok()?) as usize;
    let end = start + 4 + length;
    (end <= header.len()).then_some(end)
}

#[cfg(test)]
mod tests {
    use super::super::options::OptionValue;
    use super::*;

    /// An attribute of type `int`, as bytes.
    fn attribute(name: &str, value: i32) -> Vec<u8> {
        [name.as_bytes(), b"\0int\0", &4_u32.to_le_bytes(), &value.to_le_bytes()].concat()
    }

    #[test]
    fn attributes_are_sorted_by_name_and_nothing_else_moves() {
        let parts = |order: [&[u8]; 3]| {
            let [a, b, c] = order;
            [b"magic+vs".as_slice(), a, b, c, b"\0", b"zz\0aa\0 pixels"].concat()
        };
        let (b, a, ab) = (attribute("b", 1), attribute("a", 2), attribute("ab", 3));
        let mut file = parts([&b, &ab, &a]);
        sort_attributes(&mut file, 1);
        assert_eq!(file, parts([&a, &ab, &b]));
        // The header of the second part follows the header of the first.
        let two = |[a, b]: [&[u8]; 2], [c, d]: [&[u8]; 2]| {
            [b"magic+vs".as_slice(), a, b, b"\0", c, d, b"\0\0 pixels"].concat()
        };
        let mut file = two([&b, &a], [&ab, &a]);
        sort_attributes(&mut file, 2);
        assert_eq!(file, two([&a, &b], [&a, &ab]));
    }

    #[test]
    fn a_level_is_that_of_deflate() {
        let mut options = Options::none(FORMAT.options);
        options.set(&LEVEL, 4.0);
        for word in ["zip", "zips"] {
            options.set(&COMPRESSION, OptionValue::Text(word));
            (FORMAT.check_options)(&options).unwrap();
        }
        options.set(&COMPRESSION, OptionValue::Text("rle"));
        let told = (FORMAT.check_options)(&options).unwrap_err().to_string();
        assert!(told.contains("`level`") && told.contains("`rle`"), "{told}");
        let mut deep = Options::none(deep::FORMAT.options);
        deep.set(&LEVEL, 4.0);
        (deep::FORMAT.check_options)(&deep).unwrap();
    }

    #[test]
    fn depth_is_repeated_for_opencv_and_channels_are_sorted() {
        let channels = |names: &[&str]| -> Vec<(String, usize)> {
            let channel = |(column, name): (usize, &&str)| PartChannel {
                name: Text::from(*name),
                kind: SampleType::F32,
                column,
            };
            let channels = names.iter().enumerate().map(channel).collect();
            let all = with_depth_for_opencv(channels, &["Z", "range"]).into_iter();
            all.map(|channel| (channel.name.to_string(), channel.column)).collect()
        };
        let named = |all: &[(&str, usize)]| -> Vec<(String, usize)> {
            all.iter().map(|(name, column)| ((*name).to_owned(), *column)).collect()
        };
        assert_eq!(channels(&["range", "a"]), named(&[("Y", 0), ("a", 1), ("range", 0)]));
        assert_eq!(channels(&["range", "Z"]), named(&[("Y", 1), ("Z", 1), ("range", 0)]));
        assert_eq!(channels(&["range", "Y"]), named(&[("Y", 1), ("range", 0)]));
        assert_eq!(channels(&["a"]), named(&[("a", 0)]));
    }

    #[test]
    fn an_attribute_ends_where_its_length_says() {
        let one = attribute("name", 7);
        assert_eq!(attribute_length(&[one.as_slice(), b"\0"].concat()), Some(one.len()));
        assert_eq!(attribute_length(b"\0rest"), None);
        assert_eq!(attribute_length(&one[..one.len() - 1]), None, "cut short");
    }
}
