//! Encoding of deep OpenEXR images: a list of samples a pixel, one for each return.
//!
//! The layout is that of "OpenEXR File Layout" and "Interpreting Deep Pixels" of the OpenEXR project (openexr.com): a header of
//! attributes, a table of the places of the lines, and a chunk a line: the line's number, three lengths, the numbers of samples up
//! to and with each pixel, and the samples, channel by channel.

use rayon::prelude::*;

use super::attributes::{Value, attributes};
use super::zip::{Segment, Zip, add_raw};
use crate::output::channel::{BYTES_A_VALUE, ChannelSpec, Values, bits_of, channel, repeated_for_opencv};
use crate::output::deflate::{LEVEL, level};
use crate::output::format::{Content, EncodeError, FormatSpec, Kind};
use crate::output::options::{OptionSpec, OptionValues, Options};
use crate::output::places::{Place, Places};
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
    options: &[COMPRESSION, LEVEL],
    check_options: |options| match (options.given(&LEVEL), is_compressed(options)) {
        (Some(_), false) => Err(EncodeError::new(
            "`level` is that of `zips`, and the compression is `none`: leave out one of them",
        )),
        _ => Ok(()),
    },
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

fn is_compressed(options: &Options) -> bool {
    options.text(&COMPRESSION) == "zips"
}

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
    let level = is_compressed(options).then(|| level(options));
    let mut file = header(frame, &channels, level.is_some())?;
    let rows = 0..frame.frame.rows();
    let lines: Vec<Result<Vec<u8>, EncodeError>> = rows
        .into_par_iter()
        .map_init(Zip::default, |zip, row| line(frame, row, &channels, level.map(|level| (zip, level))))
        .collect();
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

/// The chunk of a line, which a compressor compresses at a level.
fn line(
    frame: &SensorFrame,
    row: usize,
    channels: &[(&str, &ChannelSpec)],
    compressor: Option<(&mut Zip, u8)>,
) -> Result<Vec<u8>, EncodeError> {
    let columns = frame.frame.columns();
    let pixels = row * columns..(row + 1) * columns;
    let mut counts = Vec::with_capacity(columns);
    // Each sample: its pixel, the number of its return, and its place.
    let mut samples = Vec::with_capacity(columns);
    for (column, pixel) in (0..).zip(pixels) {
        let slots = frame.frame.slots(pixel).enumerate();
        samples.extend(slots.map(|(number, slot)| (pixel, number, Place { row: row as u32, column, slot })));
        counts.push(samples.len() as u32);
    }
    let mut values = Vec::with_capacity(channels.len() * samples.len());
    let places = Places::listed(row, samples.iter().map(|(_, _, at)| *at).collect());
    for (_, channel) in channels {
        let samples = samples.iter();
        match channel.values {
            Values::Image(value) => values.extend(samples.map(|(pixel, ..)| bits_of(value(frame, *pixel)))),
            Values::OfPixel { numbers, .. } => samples
                .for_each(|(pixel, number, _)| numbers(frame, *pixel..*pixel + 1, *number, &mut values)),
            _ => channel.add_returns(frame, &places, &mut values),
        }
    }
    let [of_counts, of_values] = [&counts, &values].map(|values| [Segment { values, is_half: false }]);
    let [packed_counts, packed_values] = match compressor {
        Some((zip, level)) => [of_counts, of_values].map(|segments| zip.pack(&segments, level)),
        None => [of_counts, of_values].map(|segments| {
            let mut bytes = Vec::new();
            add_raw(&segments, &mut bytes);
            bytes
        }),
    };
    let mut chunk = int(row)?.to_le_bytes().to_vec();
    for length in [packed_counts.len(), packed_values.len(), of_values[0].bytes()] {
        chunk.extend((length as u64).to_le_bytes());
    }
    chunk.extend_from_slice(&packed_counts);
    chunk.extend_from_slice(&packed_values);
    Ok(chunk)
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
        let kind = if channel.is_measurement() { FLOAT } else { UINT };
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
