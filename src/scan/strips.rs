//! The parts of the image that are cast at a time, and the sensor's pose.

use crate::frame::Pose;
use crate::trace::PACKET_RAYS;

/// The rows and columns of a tile of the image. Its rays are as many as a packet of the tracer takes, and they are neighbours
/// so that they span a narrow pyramid.
pub(super) const TILE: (usize, usize) = (8, 16);
const _: () = assert!(TILE.0 * TILE.1 == PACKET_RAYS);

/// The number of columns of a strip, which is cast as one batch, tile by tile.
pub(super) const STRIP: usize = 16 * TILE.1;

/// A sensor's pose and its inverse.
#[derive(Clone, Copy)]
pub(super) struct SensorPose {
    pub world_from_sensor: Pose,
    pub sensor_from_world: Pose,
}

impl SensorPose {
    pub fn new(world_from_sensor: Pose) -> Self {
        Self { world_from_sensor, sensor_from_world: world_from_sensor.inverse() }
    }
}
