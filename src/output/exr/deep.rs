//! Encoding of deep OpenEXR images: a list of samples a pixel, one for each return.
//!
//! The layout is that of "OpenEXR File Layout" and "Interpreting Deep Pixels" of the OpenEXR project (openexr.com): a header of
//! attributes, a table of the places of the lines, and a chunk a line: the line's number, three lengths, the numbers of samples up
//! to and with each pixel, and the samples, channel by channel.

use std::borrow::Cow;

use rayon::prelude::*;

use super::attributes::{Value, attributes};
use crate::output::channel::{BYTES_A_VALUE, ChannelSpec, Place, Values, channel, repeated_for_opencv};
use crate::output::format::{Content, EncodeError, FormatSpec, Kind};
use crate::output::options::{OptionSpec, OptionValues, Options};
use crate::output::sensor_frame::SensorFrame;
use crate::sensor::Sensor;
use crate::source::words::joined;

/// The value of an attribute of deep images that says what a pixel without a return has.
const NO_RETURN: &str = "no sample";

/// The name by which programs for deep images find the depth of a sample.
const DEPTH: &str = "Z";

/// A deep image with the chosen channels and `Z`. The samples of a pixel are its returns in their order, so that sample k is return
/// k. Each is a point: there is no `ZBack`.
pub(in crate::output) static FORMAT: FormatSpec = FormatSpec {
    name: "deep",
    ending: "deep.exr",
    about: "deep OpenEXR images, a sample a return",
    content: Content::Channels,
    read_by: "OpenEXR",
    options: &[COMPRESSION],
    check: |sensor, options| (super::FORMAT.check)(sensor, options),
    loses,
    // This counts the raw lines, the compressed lines and the file.
    encoding_bytes_a_ray: |sensor, options| 3 * file_bytes_a_ray(sensor, options),
    file_bytes_a_ray,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

const COMPRESSION: OptionSpec = OptionSpec {
    name: "compression",
    about: "How the samples are compressed, which never changes a value: `zips` line by line, or `none`. OpenEXR has no other \
            for deep images that is as small.",
    values: OptionValues::Word { words: &["zips", "none"], default: "zips" },
};

fn file_bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    // The table of samples has a number for each pixel.
    let count = channels(sensor, options).len() as u64 * sensor.most_returns() as u64;
    BYTES_A_VALUE * (1 + count)
}

/// The images that a depth camera makes beside its returns have values where nothing came back, too.
fn loses(sensor: &Sensor, options: &Options) -> Option<String> {
    let names: Vec<String> = options
        .channels
        .of(sensor)
        .filter(|channel| matches!(channel.values, Values::Image(_)))
        .map(|channel| channel.name.to_owned())
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "a pixel without a return has no sample, and so no {}: exr has them",
            joined(&names, "and no")
        )
    })
}

/// The names of the channels that the file has, sorted, each with the channel whose values it holds. `Z` is always there: that of a
/// sensor without planar depth is the range.
fn channels(sensor: &Sensor, options: &Options) -> Vec<(&'static str, &'static ChannelSpec)> {
    let mut all: Vec<_> = options.channels.of(sensor).map(|channel| (channel.name, channel)).collect();
    if !all.iter().any(|(name, _)| *name == DEPTH) {
        all.extend(channel(repeated_for_opencv(sensor)).map(|depth| (DEPTH, depth)));
        all.sort_by_key(|(name, _)| *name);
    }
    all
}

fn encode(frame: &SensorFrame, options: &Options) -> Result<Vec<u8>, EncodeError> {
    let channels = channels(frame.capture.sensor, options);
    let is_compressed = options.text(&COMPRESSION) == "zips";
    let mut file = header(frame, &channels, is_compressed)?;
    let rows = 0..frame.frame.rows();
    let lines: Vec<Result<Vec<u8>, EncodeError>> =
        rows.into_par_iter().map(|row| line(frame, row, &channels, is_compressed)).collect();
    let lines = lines.into_iter().collect::<Result<Vec<_>, _>>()?;
    let mut place = file.len() + size_of::<u64>() * lines.len();
    file.reserve_exact(place - file.len() + lines.iter().map(Vec::len).sum::<usize>());
    for line in &lines {
        file.extend((place as u64).to_le_bytes());
        place += line.len();
    }
    lines.iter().for_each(|line| file.extend_from_slice(line));
    Ok(file)
}

/// The chunk of a line.
fn line(
    frame: &SensorFrame,
    row: usize,
    channels: &[(&str, &ChannelSpec)],
    is_compressed: bool,
) -> Result<Vec<u8>, EncodeError> {
    let columns = frame.frame.columns();
    let pixels = row * columns..(row + 1) * columns;
    let mut counts = Vec::with_capacity(size_of::<u32>() * columns);
    let mut samples = 0_u32;
    for pixel in pixels.clone() {
        samples += frame.frame.slots(pixel).len() as u32;
        counts.extend(samples.to_le_bytes());
    }
    let mut values = Vec::with_capacity(channels.len() * samples as usize * BYTES_A_VALUE as usize);
    for (_, channel) in channels {
        for pixel in pixels.clone() {
            for (number, slot) in frame.frame.slots(pixel).enumerate() {
                let at = Place { pixel, slot };
                let bytes = match channel.values {
                    Values::F32(value) => (value(frame, at) as f32).to_le_bytes(),
                    Values::Image(value) => (value(frame, pixel) as f32).to_le_bytes(),
                    Values::U32(id) => id(frame, at).to_le_bytes(),
                    Values::OfPixel { number: of_return, .. } => {
                        of_return(frame, pixel, number).to_le_bytes()
                    }
                };
                values.extend(bytes);
            }
        }
    }
    let compressed = |bytes| if is_compressed { zip(bytes) } else { Cow::Borrowed(bytes) };
    let (packed_counts, packed_values) = (compressed(&counts), compressed(&values));
    let mut chunk = int(row)?.to_le_bytes().to_vec();
    for length in [packed_counts.len(), packed_values.len(), values.len()] {
        chunk.extend((length as u64).to_le_bytes());
    }
    chunk.extend_from_slice(&packed_counts);
    chunk.extend_from_slice(&packed_values);
    Ok(chunk)
}

/// Compresses bytes as OpenEXR's ZIPS does: the bytes at even places come before those at odd places, each becomes its difference
/// from the one before it, plus 128, and deflate follows. What would not get smaller stays as it is, which readers tell by its
/// length.
fn zip(bytes: &[u8]) -> Cow<'_, [u8]> {
    /// It takes half the time of the usual 6, for some hundredths more of size.
    const LEVEL: u8 = 3;
    let even_then_odd = bytes.iter().step_by(2).chain(bytes.iter().skip(1).step_by(2));
    let mut before = None;
    let differences: Vec<u8> = even_then_odd
        .map(|&byte| match before.replace(byte) {
            Some(before) => byte.wrapping_sub(before).wrapping_add(128),
            None => byte,
        })
        .collect();
    let compressed = miniz_oxide::deflate::compress_to_vec_zlib(&differences, LEVEL);
    if compressed.len() < bytes.len() { Cow::Owned(compressed) } else { Cow::Borrowed(bytes) }
}

/// Everything before the table of lines.
fn header(
    frame: &SensorFrame,
    channels: &[(&str, &ChannelSpec)],
    is_compressed: bool,
) -> Result<Vec<u8>, EncodeError> {
    /// The file's magic number, and version 2 with the bit of data that is no flat image.
    const BEGINNING: [u8; 8] = [0x76, 0x2f, 0x31, 0x01, 2, 0x08, 0, 0];
    const NO_COMPRESSION: u8 = 0;
    const ZIPS: u8 = 2;
    let (rows, columns) = (frame.frame.rows(), frame.frame.columns());
    let window = [0, 0, int(columns)? - 1, int(rows)? - 1].map(i32::to_le_bytes).concat();
    let most = (0..frame.frame.pixels()).map(|pixel| frame.frame.slots(pixel).len()).max().unwrap_or(0);
    let one = 1.0_f32.to_le_bytes();
    let mut all: Vec<(String, &str, Vec<u8>)> = vec![
        ("channels".into(), "chlist", channel_list(channels)),
        ("chunkCount".into(), "int", int(rows)?.to_le_bytes().into()),
        ("compression".into(), "compression", vec![if is_compressed { ZIPS } else { NO_COMPRESSION }]),
        ("dataWindow".into(), "box2i", window.clone()),
        ("displayWindow".into(), "box2i", window),
        ("lineOrder".into(), "lineOrder", vec![0]), // increasing
        ("maxSamplesPerPixel".into(), "int", int(most)?.to_le_bytes().into()),
        ("pixelAspectRatio".into(), "float", one.into()),
        ("screenWindowCenter".into(), "v2f", vec![0; 8]),
        ("screenWindowWidth".into(), "float", one.into()),
        ("type".into(), "string", b"deepscanline".into()),
        ("version".into(), "int", 1_i32.to_le_bytes().into()),
    ];
    all.extend(attributes(frame, NO_RETURN).into_iter().map(|(name, value)| match value {
        Value::Text(text) => (name, "string", text.into_bytes()),
        Value::Number(number) => (name, "double", number.to_le_bytes().into()),
    }));
    all.sort();
    let mut header = BEGINNING.to_vec();
    for (name, kind, value) in all {
        header.extend([name.as_bytes(), b"\0", kind.as_bytes(), b"\0"].concat());
        header.extend(int(value.len())?.to_le_bytes());
        header.extend(value);
    }
    header.push(0);
    Ok(header)
}

/// The value of the attribute `channels`: each with its name, its type, and its samples beside each other.
fn channel_list(channels: &[(&str, &ChannelSpec)]) -> Vec<u8> {
    const UINT: u32 = 0;
    const FLOAT: u32 = 2;
    let mut list = Vec::new();
    for (name, channel) in channels {
        let kind = match channel.values {
            Values::F32(_) | Values::Image(_) => FLOAT,
            Values::U32(_) | Values::OfPixel { .. } => UINT,
        };
        list.extend(name.as_bytes());
        list.push(0);
        // The type, how it looks (which only lossy compression asks), and that each pixel has samples.
        list.extend([kind, 0, 1, 1].map(u32::to_le_bytes).as_flattened());
    }
    list.push(0);
    list
}

fn int(number: usize) -> Result<i32, EncodeError> {
    i32::try_from(number)
        .map_err(|_| EncodeError::new(format!("a deep EXR holds numbers up to {}, not {number}", i32::MAX)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Undoes [`zip`] by the definition.
    fn unzip(packed: &[u8], length: usize) -> Vec<u8> {
        if packed.len() == length {
            return packed.to_vec();
        }
        let mut bytes = miniz_oxide::inflate::decompress_to_vec_zlib(packed).unwrap();
        for i in 1..bytes.len() {
            bytes[i] = bytes[i - 1].wrapping_add(bytes[i]).wrapping_sub(128);
        }
        let (even, odd) = bytes.split_at(length.div_ceil(2));
        (0..length).map(|i| if i % 2 == 0 { even[i / 2] } else { odd[i / 2] }).collect()
    }

    #[test]
    fn compression_changes_nothing_and_never_makes_larger() {
        for length in [0, 1, 2, 3, 100, 1001] {
            let smooth: Vec<u8> = (0..length).map(|i| (i / 7) as u8).collect();
            let noise: Vec<u8> =
                (0..length as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
            for bytes in [smooth, noise] {
                let packed = zip(&bytes);
                assert!(packed.len() <= bytes.len());
                assert_eq!(unzip(&packed, bytes.len()), bytes);
            }
        }
        assert!(zip(&[7; 1000]).len() < 50);
    }
}
