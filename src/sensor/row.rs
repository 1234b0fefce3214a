//! The pulses of one row of a frame's image, for loops over many pixels: the state that these share is looked up once.

use std::ops::Range;

use super::camera::CameraRow;
use super::rotating::RotatingRow;
use super::{Pattern, Pulse};

/// The pulses of a row, by the columns of the image. [`Capture::row`](super::Capture::row) gives it.
#[derive(Clone, Copy, Debug)]
pub struct PulseRow<'c> {
    pattern: &'c Pattern,
    row: usize,
    start_s: f64,
    shared: Shared<'c>,
}

/// The state that the pixels of a row share.
#[derive(Clone, Copy, Debug)]
enum Shared<'c> {
    Camera(CameraRow<'c>),
    Rotating(RotatingRow<'c>),
    /// Nothing that would make a pulse cheaper.
    Nothing,
}

impl<'c> PulseRow<'c> {
    /// A row of the frame that starts `start_s` seconds after the sensor was switched on.
    #[inline]
    pub(super) fn of(pattern: &'c Pattern, row: usize, start_s: f64) -> Self {
        let shared = match pattern {
            Pattern::Camera(camera) => Shared::Camera(camera.row(row)),
            Pattern::Rotating(rotating) => Shared::Rotating(rotating.row(row)),
            _ => Shared::Nothing,
        };
        Self { pattern, row, start_s, shared }
    }

    /// [`Capture::pulse`](super::Capture::pulse) of the pixel in a column.
    #[inline(always)]
    pub fn pulse(&self, column: usize) -> Option<Pulse> {
        match &self.shared {
            Shared::Camera(row) => row.pulse(column),
            Shared::Rotating(row) => row.pulse(column),
            Shared::Nothing => self.pattern.pulse(self.row, column, self.start_s),
        }
    }

    /// Appends the pulses of some columns, as [`Self::pulse`] gives them. What the row shares is told apart once for all of them.
    pub fn add_pulses(&self, columns: Range<usize>, pulses: &mut Vec<Option<Pulse>>) {
        match self.shared {
            Shared::Camera(row) => pulses.extend(columns.map(|column| row.pulse(column))),
            Shared::Rotating(row) => pulses.extend(columns.map(|column| row.pulse(column))),
            Shared::Nothing => {
                pulses.extend(columns.map(|column| self.pattern.pulse(self.row, column, self.start_s)));
            }
        }
    }

    /// The time of the pulse in a column, in seconds from the frame's start. `None` as for [`Self::pulse`].
    #[inline(always)]
    pub fn time_s(&self, column: usize) -> Option<f64> {
        match &self.shared {
            Shared::Camera(row) => row.time_s(column),
            Shared::Rotating(row) => row.time_s(column),
            Shared::Nothing => self.pattern.pulse(self.row, column, self.start_s).map(|pulse| pulse.time_s),
        }
    }

    /// The factor that turns a range along the ray in a column into depth along the camera's optical axis. `None` if the
    /// sensor is no camera, or if the pixel has no ray.
    #[inline(always)]
    pub fn depth_over_range(&self, column: usize) -> Option<f64> {
        match (&self.shared, self.pattern) {
            (Shared::Camera(row), _) => row.optical_direction(column).map(|direction| direction.z),
            (_, Pattern::Orthographic(_)) => Some(1.0),
            _ => None,
        }
    }

    /// [`Self::depth_over_range`] of the first columns, infinite where it is `None`. The compiler computes several at once.
    pub fn depths_over_ranges(&self, columns: usize) -> Vec<f64> {
        // Only columns of 32 bits become floats several at once.
        let columns = 0..columns as u32;
        columns.map(|column| self.depth_over_range(column as usize).unwrap_or(f64::INFINITY)).collect()
    }

    /// [`Self::time_s`] of the first columns, 0 where it is `None`.
    pub fn times_s(&self, columns: usize) -> Vec<f64> {
        (0..columns).map(|column| self.time_s(column).unwrap_or(0.0)).collect()
    }
}
