//! Encoding of OpenEXR range images; [`deep`] has a sample a return instead of a part a return.

mod attributes;
pub(super) mod deep;

use std::io::Cursor;

use exr::block::chunk::Chunk;
use exr::block::writer::ChunksWriter;
use exr::block::{UncompressedBlock, enumerate_ordered_header_block_indices};
use exr::compression::Compression;
use exr::image::write::layers::{LayersWriter, WritableLayers};
use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Layer, Layers};
use exr::meta::attribute::{AttributeValue, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::f16;
use rayon::prelude::*;

use self::attributes::{Value, attributes};
use super::channel::{BYTES_A_VALUE, DEPTH_FOR_OPENCV, repeated_for_opencv};
use super::format::{Content, EncodeError, FormatSpec, Kind};
use super::image::{Channel, Image, Samples};
use super::options::{OptionSpec, OptionValues, Options};
use super::recorded::Part;
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
    options: &[COMPRESSION, HALF],
    check,
    loses,
    encoding_bytes_a_ray: |sensor, options| {
        // This counts the channels, the compressed blocks and the file, under the assumption that compression saves
        // nothing.
        3 * file_bytes_a_ray(sensor, options)
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
    let size = (frame.frame.columns(), frame.frame.rows());
    let compression = match options.text(&COMPRESSION) {
        "zips" => Compression::ZIP1,
        "piz" => Compression::PIZ,
        "rle" => Compression::RLE,
        "none" => Compression::Uncompressed,
        _ => Compression::ZIP16,
    };
    let encoding = Encoding { compression, ..Encoding::SMALL_LOSSLESS };
    let layer = |number, name: Option<Text>| {
        let image = Image::for_opencv(frame, number, options.channels);
        Layer::new(size, layer_attributes(frame, name), encoding, channels(image, options))
    };
    // The parts of a multi-part file need names.
    let parts = frame.frame.most_returns().max(1);
    let file = if parts == 1 {
        compress(&exr::image::Image::from_layer(layer(0, None)))
    } else {
        let named = |number| layer(number, Some(Text::from(format!("return{number}").as_str())));
        let layers: Layers<_> = (0..parts).map(named).collect();
        compress(&exr::image::Image::from_layers(ImageAttributes::with_size(size), layers))
    };
    let mut file = file.map_err(|e| EncodeError::new(format!("the EXR can't be encoded: {e}")))?;
    sort_attributes(&mut file, parts);
    Ok(file)
}

/// The file of a recorded image, compressed without loss. Attributes that are numbers are those, and all others are texts.
pub(super) fn of_parts(parts: Vec<Part>) -> Result<Vec<u8>, EncodeError> {
    let (count, mut layers) = (parts.len(), Layers::new());
    for (number, part) in parts.into_iter().enumerate() {
        let Part { name, mut image, attributes } = part;
        add_depth_for_opencv(&mut image);
        let size = (image.columns, image.rows);
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
        let channels = image.channels.into_iter().map(|channel| {
            let samples = match channel.samples {
                Samples::F32(values) => FlatSamples::F32(values),
                Samples::U32(values) => FlatSamples::U32(values),
            };
            AnyChannel::new(ascii(&channel.name), samples)
        });
        let channels = AnyChannels::sort(channels.collect());
        let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::SMALL_LOSSLESS };
        layers.push(Layer::new(size, attributes, encoding, channels));
    }
    let file = match layers.len() {
        1 => compress(&exr::image::Image::from_layer(layers.remove(0))),
        _ => {
            let size = layers.first().map_or((1, 1), |layer| (layer.size.width(), layer.size.height()));
            compress(&exr::image::Image::from_layers(ImageAttributes::with_size(size), layers))
        }
    };
    let mut file = file.map_err(|e| EncodeError::new(format!("the EXR can't be encoded: {e}")))?;
    sort_attributes(&mut file, count);
    Ok(file)
}

/// Repeats the depth under the name that OpenCV reads, as every image of a scan does.
fn add_depth_for_opencv(image: &mut Image) {
    let depth = ["Z", "range"].into_iter().find_map(|name| image.channel(name).cloned());
    if let (Some(samples), None) = (depth, image.channel(DEPTH_FOR_OPENCV)) {
        image.channels.push(Channel { name: DEPTH_FOR_OPENCV.to_owned(), samples });
        image.channels.sort_by(|a, b| a.name.cmp(&b.name));
    }
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

/// Compresses the blocks in rayon's current thread pool, and not in a pool of the library, so that `--threads` holds.
fn compress<'i, L: WritableLayers<'i>>(image: &'i exr::image::Image<L>) -> exr::error::Result<Vec<u8>> {
    let headers = image.layer_data.infer_headers(&image.attributes);
    let layers = image.layer_data.create_writer(&headers);
    let mut file = Vec::new();
    exr::block::write(Cursor::new(&mut file), headers, true, |meta, writer| {
        let blocks: Vec<_> = enumerate_ordered_header_block_indices(&meta.headers).collect();
        let chunks: Vec<exr::error::Result<Chunk>> = blocks
            .par_iter()
            .map(|&(_, index)| {
                let data = layers.extract_uncompressed_block(&meta.headers, index);
                UncompressedBlock { index, data }.compress_to_chunk(&meta.headers)
            })
            .collect();
        for ((place, _), chunk) in blocks.iter().zip(chunks) {
            writer.write_chunk(*place, chunk?)?;
        }
        Ok(())
    })?;
    Ok(file)
}

fn channels(image: Image, options: &Options) -> AnyChannels<FlatSamples> {
    let channels = image.channels.into_iter().map(|channel| {
        let samples = match channel.samples {
            Samples::F32(values) if is_half(&channel.name, options) => {
                FlatSamples::F16(values.into_iter().map(half).collect())
            }
            Samples::F32(values) => FlatSamples::F32(values),
            Samples::U32(values) => FlatSamples::U32(values),
        };
        AnyChannel::new(channel.name.as_str(), samples)
    });
    AnyChannels::sort(channels.collect())
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
    fn an_attribute_ends_where_its_length_says() {
        let one = attribute("name", 7);
        assert_eq!(attribute_length(&[one.as_slice(), b"\0"].concat()), Some(one.len()));
        assert_eq!(attribute_length(b"\0rest"), None);
        assert_eq!(attribute_length(&one[..one.len() - 1]), None, "cut short");
    }
}
