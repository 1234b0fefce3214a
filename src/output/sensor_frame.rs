//! A sensor's frame with all facts that a writer needs about its origin.

use glam::{DQuat, DVec3};

use super::names::Names;
use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::scan::Frame;
use crate::sensor::Capture;

/// The coordinate frame of a cloud's points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CloudFrame {
    /// The sensor's body frame, or a camera's optical frame.
    #[default]
    Sensor,
    /// The body that the sensor is mounted on.
    Body,
    /// The world.
    World,
}

/// A sensor's frame with all facts that a writer needs about its origin.
#[derive(Clone, Copy, Debug)]
pub struct SensorFrame<'a> {
    /// The capture: the sensor, its pose and time, and its pulses.
    pub capture: Capture<'a>,
    /// The returns of the capture.
    pub frame: &'a Frame,
    /// The sensor's name in the job.
    pub name: &'a str,
    /// The frame of the cloud's points.
    pub cloud_frame: CloudFrame,
    /// The names behind the frame's ids.
    pub names: Names<'a>,
    /// Whether previews have a legend.
    pub legend: bool,
}

impl SensorFrame<'_> {
    /// The pose of the sensor's body frame in the world when the frame started.
    pub fn world_from_sensor(&self) -> Pose {
        self.capture.world_from_sensor(0.0)
    }

    /// The point at a range in metres along a pixel's ray, in the cloud's frame, in metres. `None` if the pixel has no
    /// pulse.
    pub fn point(&self, row: usize, column: usize, range_m: f64) -> Option<DVec3> {
        let pulse = self.capture.pulse(row, column)?;
        Some(self.cloud_from_sensor(pulse.time_s).point(pulse.point(range_m)))
    }

    /// The motion from the sensor's body frame at `time_s` after the frame's start to the cloud's frame.
    pub(super) fn cloud_from_sensor(&self, time_s: f64) -> Pose {
        match self.cloud_frame {
            CloudFrame::Sensor if self.capture.sensor.pattern.is_camera() => BODY_FROM_OPTICAL.inverse(),
            CloudFrame::Sensor => Pose::IDENTITY,
            CloudFrame::Body => self.capture.body_from_sensor,
            CloudFrame::World => self.capture.world_from_sensor(time_s),
        }
    }

    /// The pose of the cloud's frame in the world when the frame started.
    pub(super) fn world_from_points(&self) -> Pose {
        self.world_from_sensor() * self.cloud_from_sensor(0.0).inverse()
    }

    /// The motion of [`Self::cloud_from_sensor`], if it is the same for the whole frame.
    pub(super) fn fixed_cloud_from_sensor(&self) -> Option<Pose> {
        match self.cloud_frame {
            CloudFrame::World => self.capture.fixed_world_from_sensor(),
            CloudFrame::Sensor | CloudFrame::Body => Some(self.cloud_from_sensor(0.0)),
        }
    }
}

/// A pose as JSON, with the keys of a job.
pub(super) fn pose_as_json(pose: &Pose) -> serde_json::Value {
    // Adding 0 makes a negative zero positive.
    let position_m = pose.translation.to_array().map(|v| v + 0.0);
    let quaternion_xyzw = DQuat::from_mat3(&pose.rotation).to_array().map(|v| v + 0.0);
    serde_json::json!({ "position_m": position_m, "quaternion_xyzw": quaternion_xyzw })
}

/// A pose as a job writes it: an inline TOML table in which every number has all its digits.
pub(super) fn pose_as_toml(pose: &Pose) -> String {
    let numbers = |values: &[f64]| {
        // Adding 0 makes a negative zero positive.
        values.iter().map(|v| format!("{:?}", v + 0.0)).collect::<Vec<_>>().join(", ")
    };
    let position = numbers(&pose.translation.to_array());
    let quaternion = numbers(&DQuat::from_mat3(&pose.rotation).to_array());
    format!("{{ position_m = [{position}], quaternion_xyzw = [{quaternion}] }}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;

    #[test]
    fn a_pose_is_written_as_a_job_would_write_it() {
        let quarter = Pose::from_rpy(
            DVec3::new(1.5, -0.0, 4.5e6),
            Angle::default(),
            Angle::default(),
            Angle::deg(90.0),
        );
        let text = pose_as_toml(&quarter);
        let table: toml::Table = format!("pose = {text}").parse().unwrap();
        let numbers = |key: &str| -> Vec<f64> {
            table["pose"][key].as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect()
        };
        assert_eq!(numbers("position_m"), [1.5, 0.0, 4.5e6]);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let q = numbers("quaternion_xyzw");
        assert!(q.iter().zip([0.0, 0.0, half, half]).all(|(a, b)| (a - b).abs() < 1e-15), "{q:?}");
        assert!(!text.contains("-0.0"), "{text}");
    }
}
