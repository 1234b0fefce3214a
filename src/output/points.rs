//! The returns of a frame as points, for the formats of clouds.

use std::ops::Range;

use super::format::EncodeError;
use super::sensor_frame::SensorFrame;
use crate::frame::Pose;
use crate::scan::Return;

/// A return as a point of a cloud.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// The position in the cloud's frame in metres. The computation is in f64, so each coordinate is rounded once.
    pub position_m: [f32; 3],
    /// The number of the beam, as the sensor's maker counts.
    pub ring: usize,
    /// The column of the range image.
    pub column: usize,
    /// The time of the pulse from the frame's start in seconds.
    pub time_s: f64,
    /// The return.
    pub hit: Return,
}

impl SensorFrame<'_> {
    /// Calls `write` with each return, row by row of the range image. The returns of a pixel follow each other.
    ///
    /// # Errors
    /// The first error of `write`.
    pub(super) fn each_point(
        &self,
        mut write: impl FnMut(&Point) -> Result<(), EncodeError>,
    ) -> Result<(), EncodeError> {
        let fixed = self.fixed_cloud_from_sensor();
        for row in 0..self.frame.rows() {
            for column in 0..self.frame.columns() {
                let slots = self.frame.slots(row * self.frame.columns() + column);
                if !slots.is_empty() {
                    self.points_of_pixel((row, column), slots, fixed, &mut write)?;
                }
            }
        }
        Ok(())
    }

    /// Calls `write` with the returns of a pixel in some of its slots. `fixed` is [`Self::fixed_cloud_from_sensor`].
    ///
    /// # Errors
    /// The first error of `write`.
    pub(super) fn points_of_pixel(
        &self,
        (row, column): (usize, usize),
        slots: Range<usize>,
        fixed: Option<Pose>,
        write: &mut impl FnMut(&Point) -> Result<(), EncodeError>,
    ) -> Result<(), EncodeError> {
        let Some(pulse) = self.capture.pulse(row, column) else { return Ok(()) };
        let cloud_from_sensor = fixed.unwrap_or_else(|| self.cloud_from_sensor(pulse.time_s));
        let ring = self.capture.sensor.ring(row);
        for slot in slots {
            let hit = self.frame.returns().get(slot);
            let position_m = cloud_from_sensor.point(pulse.point(hit.range_m)).as_vec3().to_array();
            write(&Point { position_m, ring, column, time_s: pulse.time_s, hit })?;
        }
        Ok(())
    }
}
