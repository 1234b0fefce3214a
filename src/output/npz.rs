//! Range images as NumPy's NPZ: a ZIP of arrays with names.

use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::channel::{BYTES_A_VALUE, channel};
use super::deflate::{LEVEL, level};
use super::format::{Content, EncodeError, FormatSpec, Kind};
use super::image::{Channel, Image, Samples};
use super::json::json_ascii;
use super::npy;
use super::options::{OptionSpec, OptionValues, Options};
use super::recorded::Part;
use super::sensor_frame::{SensorFrame, pose_as_json};
use super::zip::{Member, zip};
use crate::sensor::Sensor;

/// An array a channel, under the channel's name. The three axes of the normal are one array, `normal`, if all are chosen. The
/// returns of a frame with several returns a pixel follow under `return1/range` and so on. `about` is text.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "npz",
    ending: "npz",
    about: "NumPy arrays of all channels",
    content: Content::Channels,
    read_by: "NumPy",
    options: &[COMPRESSED, LEVEL],
    check_options,
    check,
    // This counts the channels, the members and the file.
    encoding_bytes_a_ray: |sensor, options| 3 * file_bytes_a_ray(sensor, options),
    file_bytes_a_ray,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

pub(super) const COMPRESSED: OptionSpec = OptionSpec {
    name: "compressed",
    about: "Whether the arrays are compressed, which takes longer.",
    values: OptionValues::Flag { default: false },
};

/// Checks that a level is given for arrays that are compressed.
pub(super) fn check_options(options: &Options) -> Result<(), EncodeError> {
    match (options.given(&LEVEL), options.is_set(&COMPRESSED)) {
        (Some(_), false) => {
            Err(EncodeError::new("`level` is that of compressed arrays: set `compressed = true`"))
        }
        _ => Ok(()),
    }
}

/// The level of compressed arrays. `None` if they are not to be compressed.
pub(super) fn compression(options: &Options) -> Option<u8> {
    options.is_set(&COMPRESSED).then(|| level(options))
}

/// The channels that one array holds together, and its name.
const AXES: [&str; 3] = ["normal.X", "normal.Y", "normal.Z"];
const NORMAL: &str = "normal";

fn file_bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    BYTES_A_VALUE * options.channels.of(sensor).count() as u64 * sensor.most_returns() as u64
}

fn check(sensor: &Sensor, options: &Options) -> Result<(), EncodeError> {
    let (rows, columns) = (sensor.pattern.rows() as u64, sensor.pattern.columns() as u64);
    let bytes = rows.saturating_mul(columns).saturating_mul(file_bytes_a_ray(sensor, options));
    if bytes < u64::from(u32::MAX) {
        return Ok(());
    }
    Err(EncodeError::new(format!(
        "an NPZ has less than 4 GiB, and {rows} × {columns} pixels take {bytes} bytes"
    )))
}

/// An array: its name, its dtype as Python writes it, its shape and its bytes.
pub(super) struct Array {
    pub name: String,
    pub kind: String,
    pub shape: Vec<usize>,
    pub bytes: Vec<u8>,
}

impl Array {
    /// A text, as an array of one value: `arrays[name].item()` is its bytes.
    pub fn text(name: &str, about: &Value) -> Self {
        let text = json_ascii(about).into_bytes();
        Self { name: name.to_owned(), kind: format!("|S{}", text.len()), shape: Vec::new(), bytes: text }
    }

    /// What a description tells of the array, with the unit of its values.
    pub fn facts(&self, unit: &str) -> Value {
        json!({ "shape": self.shape, "dtype": self.kind, "unit": unit })
    }
}

/// The file that holds arrays, in their order, compressed at a level or not at all.
pub(super) fn archive(arrays: Vec<Array>, compression: Option<u8>) -> Result<Vec<u8>, EncodeError> {
    let member = |array: Array| {
        let mut content = npy::header(&format!("'{}'", array.kind), &array.shape)?;
        content.extend(array.bytes);
        let name = format!("{}.npy", array.name);
        Ok(match compression {
            Some(level) => Member::deflated(name, &content, level),
            None => Member::stored(name, content),
        })
    };
    let members: Vec<Result<Member, EncodeError>> = arrays.into_par_iter().map(member).collect();
    zip(&members.into_iter().collect::<Result<Vec<_>, _>>()?)
}

fn encode(frame: &SensorFrame, options: &Options) -> Result<Vec<u8>, EncodeError> {
    let mut arrays = Vec::new();
    for number in 0..frame.frame.most_returns().max(1) {
        let folder = if number == 0 { String::new() } else { format!("return{number}/") };
        arrays.extend(arrays_of(Image::with_channels(frame, number, options.channels.iter()), &folder));
    }
    arrays.push(about(frame, &arrays));
    archive(arrays, compression(options))
}

/// The file of a recorded image. Its attributes are in `about` under their own names, besides those that a scan writes there.
pub(super) fn of_parts(parts: Vec<Part>) -> Result<Vec<u8>, EncodeError> {
    let mut about = Map::new();
    if let Some(part) = parts.first() {
        for (name, value) in &part.attributes {
            let key = name.strip_prefix("beamcast:").filter(|key| ABOUT.contains(key));
            // Names and poses are tables.
            let read = serde_json::from_str(value).ok().filter(|value: &Value| value.is_object());
            match key {
                Some(key) => about.insert(key.to_owned(), read.unwrap_or_else(|| value.as_str().into())),
                None => continue,
            };
        }
        about.insert("attributes".to_owned(), json!(part.attributes));
    }
    let mut arrays = Vec::new();
    for (number, part) in parts.into_iter().enumerate() {
        let folder = if number == 0 { String::new() } else { format!("return{number}/") };
        let mut image = part.image.without_repeats();
        for channel in &mut image.channels {
            // A ZIP of ours has names in ASCII, and a stroke would begin another part.
            let is_taken = |c: char| c.is_ascii_graphic() && c != '/' && c != '\\';
            channel.name = channel.name.chars().map(|c| if is_taken(c) { c } else { '_' }).collect();
        }
        arrays.extend(arrays_of(image, &folder));
    }
    let unit = |array: &Array| (array.name.clone(), array.facts(unit_of(&array.name)));
    about.insert("arrays".to_owned(), Value::Object(arrays.iter().map(unit).collect()));
    arrays.push(Array::text("about", &Value::Object(about)));
    archive(arrays, None)
}

/// The keys of `about` that are attributes of an EXR, too.
const ABOUT: [&str; 6] = ["sensor", "pattern", "no_return", "world_from_sensor", "instances", "labels"];

/// The unit of an array's values, if it is a channel.
fn unit_of(array: &str) -> &'static str {
    let name = array.rsplit('/').next().unwrap_or_default();
    channel(name).map_or("", |channel| channel.unit)
}

fn arrays_of(image: Image, folder: &str) -> Vec<Array> {
    let sides = vec![image.rows, image.columns];
    let axes: Vec<&[f32]> = AXES.iter().filter_map(|axis| image.f32(axis)).collect();
    let normal = match axes[..] {
        [x, y, z] => {
            let each = x.iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z].map(|axis| axis.to_le_bytes()));
            Some(Array {
                name: format!("{folder}{NORMAL}"),
                kind: "<f4".to_owned(),
                shape: [&sides[..], &[3]].concat(),
                bytes: bytes(each.map(|axes| <[u8; 12]>::try_from(axes.as_flattened()).unwrap_or_default())),
            })
        }
        _ => None,
    };
    let is_alone = |channel: &Channel| normal.is_none() || !AXES.contains(&channel.name.as_str());
    let alone = image.channels.iter().filter(|channel| is_alone(channel)).map(|channel| {
        let (kind, bytes) = match &channel.samples {
            Samples::F32(values) => ("<f4", bytes(values.iter().map(|value| value.to_le_bytes()))),
            Samples::U32(values) => ("<u4", bytes(values.iter().map(|value| value.to_le_bytes()))),
        };
        let name = format!("{folder}{}", channel.name);
        Array { name, kind: kind.to_owned(), shape: sides.clone(), bytes }
    });
    let mut arrays: Vec<Array> = alone.collect();
    arrays.extend(normal);
    arrays.sort_by(|a, b| a.name.cmp(&b.name));
    arrays
}

/// Values one after the other, each of `N` bytes.
pub(super) fn bytes<const N: usize>(values: impl ExactSizeIterator<Item = [u8; N]>) -> Vec<u8> {
    let mut bytes = vec![0; N * values.len()];
    for (place, value) in bytes.chunks_exact_mut(N).zip(values) {
        place.copy_from_slice(&value);
    }
    bytes
}

/// A description of the arrays, as JSON in an array of one text: `json.loads(arrays["about"].item())`.
fn about(frame: &SensorFrame, arrays: &[Array]) -> Array {
    let unit = |array: &Array| (array.name.clone(), array.facts(unit_of(&array.name)));
    let arrays: Map<String, Value> = arrays.iter().map(unit).collect();
    let names = |named: super::names::Named| -> Map<String, Value> {
        let read = |(number, name): (u32, String)| {
            (number.to_string(), serde_json::from_str(&name).unwrap_or_default())
        };
        named.names.into_iter().map(read).collect()
    };
    let about = json!({
        "sensor": frame.name,
        "pattern": frame.capture.sensor.pattern.name(),
        "no_return": "+inf in range and Z; 0 in all other arrays except cause",
        "world_from_sensor": pose_as_json(&frame.world_from_sensor()),
        "instances": names(frame.names.instances(frame.frame)),
        "labels": names(frame.names.labels(frame.frame)),
        "arrays": arrays,
    });
    Array::text("about", &about)
}
