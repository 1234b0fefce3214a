//! A sensor's frame with all facts that a writer needs about its origin.

use glam::{DMat3, DQuat, DVec3};

use super::file_memory::FileMemory;
use super::names::Names;
use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::scan::Frame;
use crate::sensor::Capture;
use crate::truth::{BoxTruth, SurfaceMotion, Targets};

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

/// The time whose pose a cloud's points are given in, where the sensor moves during the frame.
///
/// All but [`CloudTime::Raw`] compensate the motion of the sensor (deskewing), and nothing else: a point on an object that
/// moves by itself stays where the pulse met it at the pulse's own time. Points in the world's frame are at their own time
/// always, and need no compensation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CloudTime {
    /// Each point is in the sensor's frame at the time of its own pulse, as drivers give it.
    #[default]
    Raw,
    /// All points are in the sensor's frame as it was when the frame started.
    Start,
    /// All points are in the sensor's frame as it was in the middle between the frame's start and its end.
    Middle,
    /// All points are in the sensor's frame as it was at the frame's end, which is the start of the next frame.
    End,
}

impl CloudTime {
    /// Every choice with its name in a job.
    pub const NAMED: [(&'static str, Self); 4] =
        [("raw", Self::Raw), ("start", Self::Start), ("middle", Self::Middle), ("end", Self::End)];

    /// The name in a job.
    pub fn name(self) -> &'static str {
        Self::NAMED.iter().find(|(_, time)| *time == self).map_or("", |(name, _)| name)
    }

    /// The time in seconds from the frame's start. `None` if each point has its own.
    pub fn of_frame(self, capture: &Capture) -> Option<f64> {
        match self {
            Self::Raw => None,
            Self::Start => Some(0.0),
            Self::Middle => Some(0.5 * capture.duration_s()),
            Self::End => Some(capture.duration_s()),
        }
    }
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
    /// The time whose frame that is.
    pub cloud_time: CloudTime,
    /// The names behind the frame's ids.
    pub names: Names<'a>,
    /// Whether previews have a legend.
    pub legend: bool,
    /// How the surface of each return moves, by the return's slot. It may be empty: then nothing moves.
    pub motions: &'a [SurfaceMotion],
    /// The linear red, green and blue of each return's surface, by the return's slot. It may be empty: then all are black.
    pub colors: &'a [[f32; 3]],
    /// The boxes of the objects that the frame sees, in ascending order of their tracks. `None` if nobody asks for them.
    pub boxes: Option<&'a [BoxTruth<'a>]>,
    /// The objects that have tracks.
    pub targets: Option<&'a Targets>,
    /// The memory of files that are written. `None` if each file is to have its own.
    pub file_memory: Option<&'a FileMemory>,
}

impl<'a> SensorFrame<'a> {
    /// A frame whose clouds are in the sensor's frame, each point at its own time. It has no names.
    pub fn new(capture: Capture<'a>, frame: &'a Frame, name: &'a str) -> Self {
        Self {
            capture,
            frame,
            name,
            cloud_frame: CloudFrame::default(),
            cloud_time: CloudTime::default(),
            names: Names::default(),
            legend: false,
            motions: &[],
            colors: &[],
            boxes: None,
            targets: None,
            file_memory: None,
        }
    }

    /// Empty memory for a file of a format.
    pub(super) fn memory_of_file(&self, format: &'static str) -> Vec<u8> {
        self.file_memory.map_or_else(Vec::new, |memory| memory.take(format))
    }

    /// How the surface of the return in a slot moves, along the world's axes.
    pub(super) fn motion(&self, slot: usize) -> SurfaceMotion {
        self.motions.get(slot).copied().unwrap_or_default()
    }

    /// The linear red, green and blue of the surface of the return in a slot.
    pub(super) fn color(&self, slot: usize) -> [f32; 3] {
        self.colors.get(slot).copied().unwrap_or_default()
    }

    /// The track of the object of the return in a slot; 0 if it has none.
    pub(super) fn track(&self, slot: usize) -> u32 {
        let object = self.frame.returns().instance[slot];
        self.targets.and_then(|targets| targets.track_of(object)).unwrap_or(0)
    }

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

    /// The time in seconds from the frame's start to whose pose the sensor's own motion is compensated. `None` if there is
    /// nothing to compensate: the points are raw or in the world, or the sensor stands still during the frame.
    pub(super) fn reference_s(&self) -> Option<f64> {
        match self.cloud_frame {
            CloudFrame::World => None,
            CloudFrame::Sensor | CloudFrame::Body if self.capture.fixed_world_from_sensor().is_some() => None,
            CloudFrame::Sensor | CloudFrame::Body => self.cloud_time.of_frame(&self.capture),
        }
    }

    /// The motion from the sensor's body frame at `time_s` after the frame's start to the cloud's frame.
    pub(super) fn cloud_from_sensor(&self, time_s: f64) -> Pose {
        let own = match self.cloud_frame {
            CloudFrame::World => return self.capture.world_from_sensor(time_s),
            CloudFrame::Sensor if self.capture.sensor.pattern.is_camera() => BODY_FROM_OPTICAL.inverse(),
            CloudFrame::Sensor => Pose::IDENTITY,
            CloudFrame::Body => self.capture.body_from_sensor,
        };
        match self.reference_s() {
            Some(reference_s) => {
                let [reference, pulse] =
                    [reference_s, time_s].map(|time| self.capture.world_from_sensor(time));
                own * (reference.inverse() * pulse)
            }
            None => own,
        }
    }

    /// The pose of the cloud's frame in the world: at the time that the points are compensated to, else when the frame started.
    pub(super) fn world_from_points(&self) -> Pose {
        let time_s = self.reference_s().unwrap_or(0.0);
        self.capture.world_from_sensor(time_s) * self.cloud_from_sensor(time_s).inverse()
    }

    /// The motion of [`Self::cloud_from_sensor`], if it is the same for the whole frame.
    pub(super) fn fixed_cloud_from_sensor(&self) -> Option<Pose> {
        match self.cloud_frame {
            CloudFrame::World => self.capture.fixed_world_from_sensor(),
            CloudFrame::Sensor | CloudFrame::Body => {
                self.reference_s().is_none().then(|| self.cloud_from_sensor(0.0))
            }
        }
    }

    /// The cloud's frame in words, for the headers of clouds.
    pub(super) fn cloud_frame_in_words(&self) -> &'static str {
        match self.cloud_frame {
            CloudFrame::Sensor if self.capture.sensor.pattern.is_camera() => {
                "the camera's optical frame (x right, y down, z forward)"
            }
            CloudFrame::Sensor => "the sensor's frame (x forward, y left, z up)",
            CloudFrame::Body => "the body's frame (x forward, y left, z up)",
            CloudFrame::World => "the world",
        }
    }

    /// A sentence about the compensation of the sensor's motion, for the headers of clouds. `None` if there is none.
    pub(super) fn compensation(&self) -> Option<String> {
        let reference_s = self.reference_s()?;
        let moment = match self.cloud_time {
            CloudTime::Raw | CloudTime::Start => "start",
            CloudTime::Middle => "middle",
            CloudTime::End => "end",
        };
        let whose = if self.cloud_frame == CloudFrame::Body { "body" } else { "sensor" };
        Some(format!(
            "cloud_time: {}, the {whose}'s motion is compensated to the frame's {moment}, {reference_s:?} s after its start",
            self.cloud_time.name()
        ))
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

/// The pose of a text as jobs and the attributes of images have it: an inline TOML table. `None` if the text is none.
pub fn pose_of_toml(text: &str) -> Option<Pose> {
    // With its keys in quotes and colons behind them it is JSON.
    let key = |text: &str, key: &str| text.replacen(&format!("{key} ="), &format!("\"{key}\":"), 1);
    let json: serde_json::Value =
        serde_json::from_str(&key(&key(text, "position_m"), "quaternion_xyzw")).ok()?;
    let numbers = |key: &str| -> Option<Vec<f64>> {
        json.get(key)?.as_array()?.iter().map(serde_json::Value::as_f64).collect()
    };
    let translation = DVec3::from_array(numbers("position_m")?.try_into().ok()?);
    let rotation = DQuat::from_array(numbers("quaternion_xyzw")?.try_into().ok()?);
    // A header is a text that anybody may have written.
    let is_rotation = (rotation.length() - 1.0).abs() < 1e-6 && translation.is_finite();
    is_rotation.then(|| Pose { rotation: DMat3::from_quat(rotation.normalize()), translation })
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
        let again = pose_of_toml(&text).unwrap();
        assert_eq!(again.translation, DVec3::new(1.5, 0.0, 4.5e6));
        assert!(again.rotation.abs_diff_eq(quarter.rotation, 1e-15));
        for broken in
            ["", "{}", "{ position_m = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 2] }", "position_m = [0]"]
        {
            assert!(pose_of_toml(broken).is_none(), "{broken}");
        }
        assert_eq!(numbers("position_m"), [1.5, 0.0, 4.5e6]);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let q = numbers("quaternion_xyzw");
        assert!(q.iter().zip([0.0, 0.0, half, half]).all(|(a, b)| (a - b).abs() < 1e-15), "{q:?}");
        assert!(!text.contains("-0.0"), "{text}");
    }
}
