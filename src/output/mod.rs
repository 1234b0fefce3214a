//! Frames to files: one writer a format, one trait. A miss is encoded here and nowhere else.

use glam::DVec3;

use crate::frame::Pose;
use crate::scan::Frame;
use crate::sensor::Sensor;

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

impl Capture<'_> {
    /// The point of a return in the cloud's frame, in metres.
    pub fn point(&self, _row: usize, _column: usize, _range: f64) -> DVec3 {
        todo!("helper: output")
    }
}
