//! Encoding of binary PLY point clouds.

use super::format::{EncodeError, FormatSpec, Kind};
use super::id::id_of;
use super::sensor_frame::{CloudFrame, SensorFrame, pose_as_toml};
use crate::sensor::Sensor;

/// The fields in their order. Only `float` and `int` are used, because Open3D silently drops fields of other integer types.
const FIELDS: [(&str, &str); 10] = [
    ("float", "x"),
    ("float", "y"),
    ("float", "z"),
    ("float", "intensity"),
    ("int", "ring"),
    ("int", "column"),
    ("int", "t"),
    ("int", "instance"),
    ("int", "label"),
    ("float", "range"),
];
const BYTES_PER_POINT: usize = 4 * FIELDS.len();

/// The points of a frame, row by row of the range image. The returns of a pixel follow each other, and misses are left out.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "ply",
    about: "binary PLY point clouds",
    check,
    most_label: i32::MAX as u32,
    encoding_bytes_a_ray: |_| BYTES_PER_POINT as u64,
    file_bytes_a_ray: |_| BYTES_PER_POINT as u64,
    kind: Kind::File(encode),
};

fn check(sensor: &Sensor) -> Result<(), EncodeError> {
    int("column", sensor.pattern.columns() as u64)?;
    int("ring", sensor.pattern.rows() as u64)?;
    nanoseconds(sensor.pattern.first_pulse_s())?;
    nanoseconds(sensor.pattern.last_pulse_s())?;
    Ok(())
}

fn encode(cloud: &SensorFrame) -> Result<Vec<u8>, EncodeError> {
    let SensorFrame { capture, frame, .. } = cloud;
    let fixed = cloud.fixed_cloud_from_sensor();
    let points = frame.return_count();
    let mut file = header(cloud, points).into_bytes();
    file.reserve_exact(points * BYTES_PER_POINT);
    for row in 0..frame.rows() {
        let ring = int("ring", capture.sensor.ring(row) as u64)?;
        for column in 0..frame.columns() {
            let slots = frame.slots(row * frame.columns() + column);
            if slots.is_empty() {
                continue;
            }
            let Some(pulse) = capture.pulse(row, column) else { continue };
            let cloud_from_sensor = fixed.unwrap_or_else(|| cloud.cloud_from_sensor(pulse.time_s));
            for slot in slots {
                let hit = frame.returns().get(slot);
                // The computation is in f64 up to here, so each coordinate is rounded once.
                for coordinate in cloud_from_sensor.point(pulse.point(hit.range_m)).as_vec3().to_array() {
                    file.extend(coordinate.to_le_bytes());
                }
                file.extend(hit.intensity.to_le_bytes());
                file.extend(ring.to_le_bytes());
                file.extend(int("column", column as u64)?.to_le_bytes());
                file.extend(nanoseconds(pulse.time_s)?.to_le_bytes());
                file.extend(int("instance", id_of(hit.instance).into())?.to_le_bytes());
                file.extend(int("label", hit.label.into())?.to_le_bytes());
                file.extend((hit.range_m as f32).to_le_bytes());
            }
        }
    }
    Ok(file)
}

fn header(cloud: &SensorFrame, points: usize) -> String {
    let camera = cloud.capture.sensor.pattern.is_camera();
    let frame = match cloud.cloud_frame {
        CloudFrame::Sensor if camera => "the camera's optical frame (x right, y down, z forward)",
        CloudFrame::Sensor => "the sensor's frame (x forward, y left, z up)",
        CloudFrame::Body => "the body's frame (x forward, y left, z up)",
        CloudFrame::World => "the world",
    };
    let world_from_points = cloud.world_from_sensor() * cloud.cloud_from_sensor(0.0).inverse();
    let mut header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment frame: {frame}, metres\ncomment world_from_points = {}\n\
         comment t: nanoseconds from the frame's start\n",
        pose_as_toml(&world_from_points)
    );
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
    for (kind, name) in FIELDS {
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
        check(&at_rate(0.5)).unwrap();
        let error = check(&at_rate(0.1)).unwrap_err().to_string();
        assert!(error.contains("can't hold 9.9"), "{error}");
    }
}
