//! Binary PLY point clouds.

use super::{Capture, CloudFrame, EncodeError, Encoder, pose_as_toml};
use crate::sensor::Sensor;

/// The fields in their order. Only `float` and `int`: Open3D silently drops fields of other integer types.
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

/// The points of a frame, row by row of the range image; misses are left out.
pub(super) struct Cloud;

impl Encoder for Cloud {
    fn check(&self, sensor: &Sensor) -> Result<(), EncodeError> {
        int("column", sensor.pattern.columns() as u64)?;
        int("ring", sensor.pattern.rows() as u64)?;
        nanoseconds(sensor.pattern.last_pulse_s())?;
        Ok(())
    }

    fn bytes_per_ray(&self, _sensor: &Sensor) -> u64 {
        BYTES_PER_POINT as u64
    }

    fn encode(&self, capture: &Capture) -> Result<Vec<u8>, EncodeError> {
        let Capture { frame, sensor, .. } = capture;
        let cloud_from_sensor = capture.cloud_from_sensor();
        let points = frame.returns.iter().flatten().count();
        let mut file = header(capture, points).into_bytes();
        file.reserve_exact(points * BYTES_PER_POINT);
        for row in 0..frame.rows {
            let ring = int("ring", sensor.ring(row) as u64)?;
            for column in 0..frame.columns {
                let Some(hit) = frame.get(row, column) else { continue };
                let Some(pulse) = sensor.pattern.pulse(row, column) else { continue };
                // f64 up to here; each coordinate is rounded once.
                for coordinate in cloud_from_sensor.point(pulse.point(hit.range)).as_vec3().to_array() {
                    file.extend(coordinate.to_le_bytes());
                }
                file.extend(hit.intensity.to_le_bytes());
                file.extend(ring.to_le_bytes());
                file.extend(int("column", column as u64)?.to_le_bytes());
                file.extend(nanoseconds(pulse.time_s)?.to_le_bytes());
                file.extend(int("instance", hit.instance.into())?.to_le_bytes());
                file.extend(int("label", hit.label.into())?.to_le_bytes());
                file.extend((hit.range as f32).to_le_bytes());
            }
        }
        Ok(file)
    }
}

fn header(capture: &Capture, points: usize) -> String {
    let camera = capture.sensor.pattern.is_camera();
    let frame = match capture.cloud_frame {
        CloudFrame::Sensor if camera => "the camera's optical frame (x right, y down, z forward)",
        CloudFrame::Sensor => "the sensor's frame (x forward, y left, z up)",
        CloudFrame::Body => "the body's frame (x forward, y left, z up)",
        CloudFrame::World => "the world",
    };
    let world_from_points = capture.world_from_sensor() * capture.cloud_from_sensor().inverse();
    let mut header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment frame: {frame}, metres\ncomment world_from_points = {}\n\
         comment t: nanoseconds from the frame's start\nelement vertex {points}\n",
        pose_as_toml(&world_from_points)
    );
    for (kind, name) in FIELDS {
        header += &format!("property {kind} {name}\n");
    }
    header + "end_header\n"
}

fn int(field: &str, value: u64) -> Result<i32, EncodeError> {
    i32::try_from(value)
        .map_err(|_| EncodeError(format!("a PLY's {field} is at most {}, and can't hold {value}", i32::MAX)))
}

fn nanoseconds(time_s: f64) -> Result<i32, EncodeError> {
    let rounded = (time_s * 1e9).round();
    if rounded.abs() <= f64::from(i32::MAX) {
        Ok(rounded as i32)
    } else {
        Err(EncodeError(format!(
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
        assert_eq!(nanoseconds(2.304e-6), Ok(2304));
        assert_eq!(nanoseconds(-1.6e-9), Ok(-2));
        assert_eq!(nanoseconds(2.147483647), Ok(i32::MAX));
    }

    #[test]
    fn a_turn_too_slow_for_its_field_is_refused_before_it_is_cast() {
        assert_eq!(Cloud.check(&at_rate(0.5)), Ok(()));
        let error = Cloud.check(&at_rate(0.1)).unwrap_err().to_string();
        assert!(error.contains("can't hold 9.9"), "{error}");
    }
}
