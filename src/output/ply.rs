//! Encoding of binary PLY point clouds.

use super::format::{Content, EncodeError, Field, FormatSpec, Kind, field};
use super::id::id_of;
use super::options::Options;
use super::points::{MOTION, Point, TERMS, more_bytes, more_fields};
use super::sensor_frame::{CloudFrame, SensorFrame, pose_as_toml};
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
    about: "binary PLY point clouds",
    content: Content::Points(&FIELDS),
    read_by: "Open3D, plyfile",
    check,
    most_label: |_| i32::MAX as u32,
    most_instance: |_| i32::MAX as u32,
    options: &[MOTION, TERMS],
    encoding_bytes_a_ray: bytes_a_ray,
    file_bytes_a_ray: bytes_a_ray,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

fn bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
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
    let mut file = header(cloud, cloud.frame.return_count(), options).into_bytes();
    add_points(cloud, options, &mut file)?;
    Ok(file)
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
        let fields = [
            x.to_le_bytes(),
            y.to_le_bytes(),
            z.to_le_bytes(),
            hit.intensity.to_le_bytes(),
            int("ring", *ring as u64)?.to_le_bytes(),
            int("column", *column as u64)?.to_le_bytes(),
            nanoseconds(*time_s)?.to_le_bytes(),
            int("instance", id_of(hit.instance).into())?.to_le_bytes(),
            int("label", hit.label.into())?.to_le_bytes(),
            (hit.range_m as f32).to_le_bytes(),
        ];
        file.extend_from_slice(fields.as_flattened());
        if more > 0 {
            cloud.add_more(point, options, file);
        }
        Ok(())
    })
}

fn header(cloud: &SensorFrame, points: usize, options: &Options) -> String {
    let camera = cloud.capture.sensor.pattern.is_camera();
    let frame = match cloud.cloud_frame {
        CloudFrame::Sensor if camera => "the camera's optical frame (x right, y down, z forward)",
        CloudFrame::Sensor => "the sensor's frame (x forward, y left, z up)",
        CloudFrame::Body => "the body's frame (x forward, y left, z up)",
        CloudFrame::World => "the world",
    };
    let mut header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment frame: {frame}, metres\ncomment world_from_points = {}\n\
         comment t: nanoseconds from the frame's start\n",
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
    header += &format!("element vertex {points}\n");
    for Field { name, kind, .. } in &FIELDS {
        header += &format!("property {kind} {name}\n");
    }
    for (name, is_integer) in more_fields(cloud.capture.sensor, options) {
        let kind = if is_integer { "int" } else { "float" };
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
    let rounded = (time_s * 1e9).round();
    if rounded.abs() <= f64::from(i32::MAX) {
        Ok(rounded as i32)
    } else {
        Err(EncodeError::new(format!(
            "a PLY's t counts nanoseconds up to {} (2.1 s), and can't hold {time_s} s: a frame must be shorter",
            i32::MAX
        )))
    }
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
    fn times_are_rounded_to_nanoseconds() {
        assert_eq!(nanoseconds(2.304e-6).unwrap(), 2304);
        assert_eq!(nanoseconds(-1.6e-9).unwrap(), -2);
        assert_eq!(nanoseconds(2.147483647).unwrap(), i32::MAX);
    }

    #[test]
    fn a_turn_too_slow_for_its_field_is_refused_before_it_is_cast() {
        check(&at_rate(0.5), &Options::none(&[])).unwrap();
        let error = check(&at_rate(0.1), &Options::none(&[])).unwrap_err().to_string();
        assert!(error.contains("can't hold 9.9"), "{error}");
    }
}
