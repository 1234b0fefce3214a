//! Encoding of PLY point clouds.

use std::ops::Range;

use super::format::{Content, EncodeError, Field, FormatSpec, Kind, field};
use super::id::id_of;
use super::options::{OptionSpec, OptionValues, Options};
use super::points::{MOTION, Point, TERMS, more_bytes, more_fields, rounded};
use super::sensor_frame::{SensorFrame, pose_as_toml};
use crate::sensor::Sensor;

/// The fields in their order. Only `float` and `int` are used, because Open3D silently drops fields of other integer types.
static FIELDS: [Field; 10] = [
    field("x", "float", "m"),
    field("y", "float", "m"),
    field("z", "float", "m"),
    field("intensity", "float", "0 to 1"),
    field("ring", "int", "from 0"),
    field("column", "int", "from 0"),
    field("t", "int", "ns from the frame's start"),
    field("instance", "int", "from 1"),
    field("label", "int", "0 is none"),
    field("range", "float", "m"),
];
const BYTES_PER_POINT: usize = 4 * FIELDS.len();

/// The points of a frame, row by row of the range image. The returns of a pixel follow each other, and misses are left out.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "ply",
    ending: "ply",
    about: "PLY point clouds, binary or text",
    content: Content::Points(&FIELDS),
    read_by: "Open3D, plyfile",
    check,
    most_label: |_| i32::MAX as u32,
    most_instance: |_| i32::MAX as u32,
    options: &[FLAVOUR, ASCII, MOTION, TERMS],
    encoding_bytes_a_ray: |sensor, options| {
        // A text is made of the bytes.
        bytes_a_ray(sensor, options)
            + if options.is_set(&ASCII) { file_bytes_a_ray(sensor, options) } else { 0 }
    },
    file_bytes_a_ray,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

const FLAVOUR: OptionSpec = OptionSpec {
    name: "flavour",
    about: "The names of the fields after x, y and z: `plain`, or those of `cloudcompare`, whose scalar fields begin with `scalar_`, \
            such as `scalar_intensity`.",
    values: OptionValues::Word { words: &["plain", CLOUDCOMPARE], default: "plain" },
};
const CLOUDCOMPARE: &str = "cloudcompare";

const ASCII: OptionSpec = OptionSpec {
    name: "ascii",
    about: "Whether the points are text, a line each, with the fewest digits that give the same numbers again.",
    values: OptionValues::Flag { default: false },
};

fn file_bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    /// The longest values are -123456780000000.0 and -0.0000012345678, before a space.
    const LONGEST_WORD: u64 = 19;
    const BYTES_A_VALUE: u64 = 4;
    let bytes = bytes_a_ray(sensor, options);
    if options.is_set(&ASCII) { bytes / BYTES_A_VALUE * LONGEST_WORD } else { bytes }
}

/// The bytes of the binary points of a ray.
pub(super) fn bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    (BYTES_PER_POINT as u64 + more_bytes(sensor, options)) * sensor.most_returns() as u64
}

fn check(sensor: &Sensor, _: &Options) -> Result<(), EncodeError> {
    int("column", sensor.pattern.columns() as u64)?;
    int("ring", sensor.pattern.rows() as u64)?;
    nanoseconds(sensor.pattern.first_pulse_s())?;
    nanoseconds(sensor.pattern.last_pulse_s())?;
    Ok(())
}

fn encode(cloud: &SensorFrame, options: &Options) -> Result<Vec<u8>, EncodeError> {
    let properties = properties(cloud.capture.sensor, options);
    let mut file = cloud.memory_of_file(FORMAT.name);
    file.extend_from_slice(header(cloud, &properties, options).as_bytes());
    if options.is_set(&ASCII) {
        let mut points = Vec::new();
        add_points(cloud, options, &mut points)?;
        let kinds: Vec<&str> = properties.iter().map(|(kind, _)| *kind).collect();
        add_text(&points, &kinds, &mut file);
    } else {
        add_points(cloud, options, &mut file)?;
    }
    Ok(file)
}

/// Adds points as text, of their bytes: values of 4 bytes and of these kinds.
fn add_text(points: &[u8], kinds: &[&str], file: &mut Vec<u8>) {
    /// Most values are no longer, and a space follows each.
    const USUAL_WORD: usize = 10;
    // Whether a column has integers, its last value, and the place of its word. Neighbours have much in common.
    let mut columns: Vec<(bool, [u8; 4], Range<usize>)> =
        kinds.iter().map(|kind| (*kind == "int", [0; 4], 0..0)).collect();
    let (values, _) = points.as_chunks::<4>();
    file.reserve(values.len() * USUAL_WORD);
    for point in values.chunks_exact(kinds.len().max(1)) {
        for (bytes, (is_integer, last, word)) in point.iter().zip(&mut columns) {
            let start = file.len();
            if bytes == last && word.start < word.end {
                file.extend_from_within(word.clone());
            } else if *is_integer {
                add_integer(i32::from_le_bytes(*bytes), file);
            } else {
                // The digits are the fewest that give the same number again, with an exponent where that is shorter.
                let number = f32::from_le_bytes(*bytes);
                file.extend_from_slice(zmij::Buffer::new().format(number).as_bytes());
            }
            (*last, *word) = (*bytes, start..file.len());
            file.push(b' ');
        }
        if let Some(end) = file.last_mut() {
            *end = b'\n';
        }
    }
}

/// Adds the digits of a whole number.
fn add_integer(number: i32, file: &mut Vec<u8>) {
    const MOST_DIGITS: usize = 10;
    let (mut digits, mut first, mut left) = ([0; MOST_DIGITS], MOST_DIGITS, number.unsigned_abs());
    loop {
        first -= 1;
        digits[first] = b'0' + (left % 10) as u8;
        left /= 10;
        if left == 0 {
            break;
        }
    }
    if number < 0 {
        file.push(b'-');
    }
    file.extend_from_slice(&digits[first..]);
}

/// The kinds and the names of the fields, in their order.
fn properties(sensor: &Sensor, options: &Options) -> Vec<(&'static str, String)> {
    let is_scalar = |name: &str| options.text(&FLAVOUR) == CLOUDCOMPARE && !["x", "y", "z"].contains(&name);
    let named = |name: &str| if is_scalar(name) { format!("scalar_{name}") } else { name.to_owned() };
    let more = more_fields(sensor, options).into_iter();
    let more = more.map(|(name, is_integer)| (if is_integer { "int" } else { "float" }, name));
    FIELDS
        .iter()
        .map(|field| (field.kind, field.name))
        .chain(more)
        .map(|(kind, name)| (kind, named(name)))
        .collect()
}

/// Adds the points of a cloud, each with its [`FIELDS`] in 4 bytes, and with [`more_fields`].
pub(super) fn add_points(
    cloud: &SensorFrame,
    options: &Options,
    file: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    let more = more_bytes(cloud.capture.sensor, options) as usize;
    file.reserve_exact(cloud.frame.return_count() * (BYTES_PER_POINT + more));
    cloud.each_point(|point| {
        let Point { position_m: [x, y, z], ring, column, time_s, hit, .. } = point;
        let (instance, label) = (id_of(hit.instance), hit.label);
        let nanoseconds = rounded(*time_s * 1e9);
        // One comparison tells whether none of the numbers has more bits than an `int`.
        let numbers = *ring as u64 | *column as u64 | u64::from(instance | label);
        let (Some(t), true) = (nanoseconds, numbers <= i32::MAX as u64) else {
            return check_point(point);
        };
        let fields = [
            x.to_le_bytes(),
            y.to_le_bytes(),
            z.to_le_bytes(),
            hit.intensity.to_le_bytes(),
            (*ring as u32).to_le_bytes(),
            (*column as u32).to_le_bytes(),
            t.to_le_bytes(),
            instance.to_le_bytes(),
            label.to_le_bytes(),
            (hit.range_m as f32).to_le_bytes(),
        ];
        file.extend_from_slice(fields.as_flattened());
        if more > 0 {
            cloud.add_more(point, options, file);
        }
        Ok(())
    })
}

/// The error of a point of which a number has no room in its field.
#[cold]
fn check_point(point: &Point) -> Result<(), EncodeError> {
    int("ring", point.ring as u64)?;
    int("column", point.column as u64)?;
    nanoseconds(point.time_s)?;
    int("instance", id_of(point.hit.instance).into())?;
    int("label", point.hit.label.into())?;
    Ok(())
}

fn header(cloud: &SensorFrame, properties: &[(&str, String)], options: &Options) -> String {
    let encoding = if options.is_set(&ASCII) { "ascii" } else { "binary_little_endian" };
    let mut header = format!(
        "ply\nformat {encoding} 1.0\ncomment frame: {}, metres\ncomment world_from_points = {}\n\
         comment t: nanoseconds from the frame's start\n",
        cloud.cloud_frame_in_words(),
        pose_as_toml(&cloud.world_from_points())
    );
    if let Some(compensation) = cloud.compensation() {
        header += &format!("comment {compensation}\n");
    }
    for (what, named) in
        [("instance", cloud.names.instances(cloud.frame)), ("label", cloud.names.labels(cloud.frame))]
    {
        for (number, name) in named.names {
            header += &format!("comment {what} {number} = {name}\n");
        }
        if named.left_out > 0 {
            header += &format!("comment {} more {what}s are named in the manifest\n", named.left_out);
        }
    }
    header += &format!("element vertex {}\n", cloud.frame.return_count());
    for (kind, name) in properties {
        header += &format!("property {kind} {name}\n");
    }
    header + "end_header\n"
}

fn int(field: &str, value: u64) -> Result<i32, EncodeError> {
    i32::try_from(value).map_err(|_| {
        EncodeError::new(format!("a PLY's {field} is at most {}, and can't hold {value}", i32::MAX))
    })
}

fn nanoseconds(time_s: f64) -> Result<i32, EncodeError> {
    rounded(time_s * 1e9).ok_or_else(|| {
        EncodeError::new(format!(
            "a PLY's t counts nanoseconds up to {} (2.1 s), and can't hold {time_s} s: a frame must be shorter",
            i32::MAX
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::sensor::{Beam, Pattern, RangeLimits, RingOrder, Rotating};

    fn at_rate(rate_hz: f64) -> Sensor {
        let beam = Beam {
            elevation: Angle::default(),
            azimuth_offset: Angle::default(),
            time_s: 0.0,
            file_index: 0,
        };
        let turn = (Angle::deg(180.0), Angle::deg(-180.0));
        let pattern = Rotating::new(vec![beam], 100, turn, rate_hz).unwrap();
        Sensor {
            pattern: Pattern::Rotating(pattern),
            range: RangeLimits::default(),
            ring: RingOrder::default(),
            measurement: Default::default(),
        }
    }

    #[test]
    fn text_has_the_numbers_of_the_bytes() {
        let integers = [0, 7, -10, 1_234_567_890, i32::MAX, i32::MIN];
        let floats = [
            0.1_f32,
            -0.0,
            16.0,
            1.0 / 3.0,
            1e-7,
            -123_456_780_000_000.0,
            -0.000_001_234_567_8,
            1e30,
            f32::MAX,
        ];
        let points: Vec<u8> = integers
            .iter()
            .flat_map(|integer| floats.iter().map(move |float| [integer.to_le_bytes(), float.to_le_bytes()]))
            .flatten()
            .flatten()
            .collect();
        let mut file = Vec::new();
        add_text(&points, &["int", "float"], &mut file);
        let text = String::from_utf8(file).unwrap();
        let mut lines = text.lines();
        for integer in integers {
            for float in floats {
                let (first, second) = lines.next().unwrap().split_once(' ').unwrap();
                assert_eq!(first, integer.to_string());
                assert_eq!(second.parse::<f32>().unwrap().to_bits(), float.to_bits(), "{second}");
                assert!(first.len().max(second.len()) < 19, "{second}");
            }
        }
        assert_eq!((lines.next(), text.ends_with('\n')), (None, true));
    }

    #[test]
    fn times_are_rounded_to_nanoseconds() {
        assert_eq!(nanoseconds(2.304e-6).unwrap(), 2304);
        assert_eq!(nanoseconds(-1.6e-9).unwrap(), -2);
        assert_eq!(nanoseconds(2.147483647).unwrap(), i32::MAX);
        assert_eq!(nanoseconds(-2.147483647).unwrap(), -i32::MAX);
        assert!(nanoseconds(2.147483648).is_err() && nanoseconds(f64::NAN).is_err());
        assert_eq!(
            [0.4e-9, 1.4e-9, 1.6e-9, -1.4e-9].map(|time_s| nanoseconds(time_s).unwrap()),
            [0, 1, 2, -1]
        );
    }

    #[test]
    fn a_turn_too_slow_for_its_field_is_refused_before_it_is_cast() {
        check(&at_rate(0.5), &Options::none(&[])).unwrap();
        let error = check(&at_rate(0.1), &Options::none(&[])).unwrap_err().to_string();
        assert!(error.contains("can't hold 9.9"), "{error}");
    }
}
