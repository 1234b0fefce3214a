//! Frames to files: one writer a format, one trait; and back, in [`recorded`]. A miss is encoded here and nowhere else.

mod exr;
mod files;
mod image;
mod manifest;
pub mod plot;
mod ply;
mod png;
pub mod recorded;

use glam::{DQuat, DVec3};

use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::scan::Frame;
use crate::sensor::Sensor;

pub use files::{Destination, WrittenFile, write_file};
pub use image::{CHANNELS, Channel, Image, Samples};
pub use manifest::Manifest;

/// The range and depth (metres) of a pixel with no return. All its other channels are 0.
pub const NO_RETURN_M: f64 = f64::INFINITY;

/// A file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// OpenEXR range image, all channels.
    Exr,
    /// Binary PLY point cloud.
    Ply,
    /// Colour preview of the range.
    Png,
}

/// The frame that a cloud's points are given in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CloudFrame {
    /// The sensor's; a camera's optical frame.
    #[default]
    Sensor,
    /// The body that the sensor is mounted on.
    Body,
    /// The world.
    World,
}

/// A frame with all that a writer needs to know about where it came from.
#[derive(Clone, Copy, Debug)]
pub struct Capture<'a> {
    /// What was seen.
    pub frame: &'a Frame,
    /// By what.
    pub sensor: &'a Sensor,
    /// The sensor's name in the job.
    pub name: &'a str,
    /// Where the sensor sits on the body.
    pub body_from_sensor: Pose,
    /// Where the body was.
    pub world_from_body: Pose,
    /// The frame of the cloud's points.
    pub cloud_frame: CloudFrame,
}

/// A PNG of a picture of 8 bits a colour: red, green, blue, row by row.
///
/// # Errors
/// If a side is 0 or more than a PNG has room for.
pub fn encode_png(width: usize, height: usize, pixels: &[u8]) -> Result<Vec<u8>, EncodeError> {
    png::write(width, height, pixels).map_err(|e| EncodeError(format!("it can't be made a PNG: {e}")))
}

/// Why a frame can't be had in a format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct EncodeError(String);

/// What a format's file does: frames in, bytes out. The same capture gives the same bytes, whatever the number of threads.
trait Encoder {
    /// Whether the frames of `sensor` fit the format at all.
    fn check(&self, sensor: &Sensor) -> Result<(), EncodeError>;

    /// The memory that encoding takes for each ray, at most.
    fn bytes_per_ray(&self, sensor: &Sensor) -> u64;

    /// The whole file.
    fn encode(&self, capture: &Capture) -> Result<Vec<u8>, EncodeError>;
}

impl Format {
    /// The file name's extension, without a dot. It is also what a job calls the format.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Ply => "ply",
            Self::Png => "png",
        }
    }

    /// Whether the frames of `sensor` fit the format; to be asked before casting them.
    ///
    /// # Errors
    /// Says which number of the sensor the format has no room for.
    pub fn check(self, sensor: &Sensor) -> Result<(), EncodeError> {
        self.encoder().check(sensor)
    }

    /// An upper estimate of the memory that encoding takes, in bytes for each ray of `sensor`.
    pub fn bytes_per_ray(self, sensor: &Sensor) -> u64 {
        self.encoder().bytes_per_ray(sensor)
    }

    /// The file's whole content. The same capture gives the same bytes, on any thread count and platform.
    ///
    /// # Errors
    /// When the frame has a number that the format has no room for, such as a label above 2³¹ − 1 in a PLY.
    pub fn encode(self, capture: &Capture) -> Result<Vec<u8>, EncodeError> {
        self.encoder().encode(capture)
    }

    fn encoder(self) -> &'static dyn Encoder {
        match self {
            Self::Exr => &exr::RangeImage,
            Self::Ply => &ply::Cloud,
            Self::Png => &png::Preview,
        }
    }
}

impl Capture<'_> {
    /// Where the sensor's body frame was in the world.
    pub fn world_from_sensor(&self) -> Pose {
        self.world_from_body * self.body_from_sensor
    }

    /// The point of a return in the cloud's frame, in metres. `None` if the pixel has no pulse.
    pub fn point(&self, row: usize, column: usize, range: f64) -> Option<DVec3> {
        let pulse = self.sensor.pattern.pulse(row, column)?;
        Some(self.cloud_from_sensor().point(pulse.point(range)))
    }

    /// From the sensor's body frame to the cloud's.
    fn cloud_from_sensor(&self) -> Pose {
        match self.cloud_frame {
            CloudFrame::Sensor if self.sensor.pattern.is_camera() => BODY_FROM_OPTICAL.inverse(),
            CloudFrame::Sensor => Pose::IDENTITY,
            CloudFrame::Body => self.body_from_sensor,
            CloudFrame::World => self.world_from_sensor(),
        }
    }
}

/// A pose as a job writes it: an inline TOML table, every number with all its digits.
fn pose_as_toml(pose: &Pose) -> String {
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
