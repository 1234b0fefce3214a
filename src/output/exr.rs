//! Encoding of OpenEXR range images.

use std::collections::HashMap;
use std::io::Cursor;

use exr::block::chunk::Chunk;
use exr::block::writer::ChunksWriter;
use exr::block::{UncompressedBlock, enumerate_ordered_header_block_indices};
use exr::image::write::layers::{LayersWriter, WritableLayers};
use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Layer, Layers};
use exr::meta::attribute::{AttributeValue, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use rayon::prelude::*;

use super::channel::{BYTES_A_VALUE, repeated_for_opencv};
use super::format::{Content, EncodeError, FormatSpec, Kind};
use super::image::{Image, Samples};
use super::options::Options;
use super::sensor_frame::{SensorFrame, pose_as_toml};
use crate::frame::BODY_FROM_OPTICAL;
use crate::scan::Cause;
use crate::sensor::{Pattern, Ranging, Sensor};

/// The value of the attribute `beamcast:no_return`.
const NO_RETURN: &str = "+inf in range, Z and Y; 0 in all other channels except cause";

/// A range image with every channel, as 32-bit scanlines, with ZIP compression in blocks of 16 lines. A frame with several
/// returns a pixel has one part for each return number.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "exr",
    ending: "exr",
    about: "OpenEXR range images of all channels",
    content: Content::Channels,
    read_by: "OpenEXR",
    check,
    encoding_bytes_a_ray: |sensor, options| {
        // This counts the channels, the compressed blocks and the file, under the assumption that compression saves
        // nothing.
        3 * file_bytes_a_ray(sensor, options)
    },
    file_bytes_a_ray,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

fn file_bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    let repeated = repeated_for_opencv(sensor);
    let times = |name: &str| if name == repeated { 2 } else { 1 };
    let of_return = options.channels.of(sensor).map(|channel| times(channel.name)).sum::<u64>();
    BYTES_A_VALUE * of_return * sensor.most_returns() as u64
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
    let layer = |number, name: Option<Text>| {
        let attributes = LayerAttributes { layer_name: name, ..attributes(frame) };
        Layer::new(
            size,
            attributes,
            Encoding::SMALL_LOSSLESS,
            channels(Image::for_opencv(frame, number, options.channels)),
        )
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

fn channels(image: Image) -> AnyChannels<FlatSamples> {
    let channels = image.channels.into_iter().map(|channel| {
        let samples = match channel.samples {
            Samples::F32(values) => FlatSamples::F32(values),
            Samples::U32(values) => FlatSamples::U32(values),
        };
        AnyChannel::new(channel.name.as_str(), samples)
    });
    AnyChannels::sort(channels.collect())
}

fn attributes(frame: &SensorFrame) -> LayerAttributes {
    let mut other = HashMap::new();
    let mut set = |name: &str, value| other.insert(Text::from(name), value);
    let text = |value: &str| AttributeValue::Text(Text::from(value));

    set("beamcast:no_return", text(NO_RETURN));
    let possible = if frame.frame.is_measured() { Cause::ALL } else { Cause::IDEAL };
    let causes: Vec<_> =
        possible.iter().map(|cause| format!("{} {}", cause.number(), cause.name())).collect();
    set("beamcast:cause", text(&causes.join(", ")));
    // An attribute holds one byte for each character.
    set("beamcast:sensor", text(&frame.name.escape_default().to_string()));
    set("beamcast:world_from_sensor", text(&pose_as_toml(&frame.world_from_sensor())));
    for (what, named) in
        [("instances", frame.names.instances(frame.frame)), ("labels", frame.names.labels(frame.frame))]
    {
        if let Some(names) = named.to_json() {
            set(&format!("beamcast:{what}"), text(&names));
        }
        if named.left_out > 0 {
            let said = format!("{}, which the manifest names", named.left_out);
            set(&format!("beamcast:{what}_left_out"), text(&said));
        }
    }
    let pattern = &frame.capture.sensor.pattern;
    set("beamcast:pattern", text(pattern.name()));
    set("beamcast:normal_frame", text(if pattern.is_camera() { "optical" } else { "sensor" }));
    match pattern {
        Pattern::Rotating(p) => {
            set("beamcast:layout", text(if p.is_destaggered() { "destaggered" } else { "staggered" }));
            let offset_m = match p.ranging() {
                Ranging::Along(before) => before,
                Ranging::FromOrigin => {
                    set("beamcast:range_from", text("origin"));
                    0.0
                }
            };
            set("beamcast:range_offset_m", AttributeValue::F64(offset_m));
        }
        Pattern::Camera(camera) => {
            let world_from_optical = frame.world_from_sensor() * BODY_FROM_OPTICAL;
            set("beamcast:world_from_optical", text(&pose_as_toml(&world_from_optical)));
            set("beamcast:fx_px", AttributeValue::F64(camera.focal_px().0));
            set("beamcast:fy_px", AttributeValue::F64(camera.focal_px().1));
            set("beamcast:cx_px", AttributeValue::F64(camera.principal_px().0));
            set("beamcast:cy_px", AttributeValue::F64(camera.principal_px().1));
            let numbers = camera.lens().coefficients().iter().map(f64::to_string).collect::<Vec<_>>();
            if !numbers.is_empty() {
                set("beamcast:distortion", text(&numbers.join(", ")));
            }
        }
        Pattern::Orthographic(camera) => {
            let world_from_optical = frame.world_from_sensor() * BODY_FROM_OPTICAL;
            set("beamcast:world_from_optical", text(&pose_as_toml(&world_from_optical)));
            set("beamcast:width_m", AttributeValue::F64(camera.size_m().0));
            set("beamcast:height_m", AttributeValue::F64(camera.size_m().1));
        }
        _ => {}
    }
    LayerAttributes { other, ..LayerAttributes::default() }
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
