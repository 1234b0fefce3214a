//! Sensors as pure geometry: a pattern yields pulses. No files, no scene.

mod pinhole;
mod rotating;

use glam::DVec3;

pub use pinhole::{Pinhole, PinholeError};
pub use rotating::{Beam, Rotating, RotatingError};

/// A LiDAR or a depth camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Where its beams go, and when.
    pub pattern: Pattern,
    /// The ranges at which it sees something.
    pub range: RangeLimits,
    /// What a cloud's `ring` counts.
    pub ring: RingOrder,
}

/// The limits of a sensor's range, along the ray, inclusive. What is nearer than the least is not seen, and hides nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeLimits {
    /// The least range in metres, 0 or more.
    pub min_m: f64,
    /// The largest range in metres, infinite if the sensor has no limit.
    pub max_m: f64,
}

impl Default for RangeLimits {
    fn default() -> Self {
        Self { min_m: 0.0, max_m: f64::INFINITY }
    }
}

/// What the field `ring` of a point cloud counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RingOrder {
    /// The image's row: 0 is the highest beam.
    #[default]
    Row,
    /// 0 is the lowest beam, as Velodyne's drivers count.
    BottomUp,
    /// The order of the sensor file's beam table.
    File,
}

/// How a sensor's beams are laid out in space and time.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// Beams on a turning head.
    Rotating(Rotating),
    /// An ideal camera.
    Pinhole(Pinhole),
}

/// One beam of one firing, or one pixel. It leaves from the sensor's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// Unit direction in the sensor's body frame (x forward, y left, z up).
    pub direction: DVec3,
    /// Seconds from the frame's start.
    pub time_s: f64,
}

impl Pattern {
    /// Rows of the range image: beams, or the camera's height.
    pub fn rows(&self) -> usize {
        match self {
            Self::Rotating(p) => p.beams().len(),
            Self::Pinhole(p) => p.height(),
        }
    }

    /// Columns of the range image: firings, or the camera's width.
    pub fn columns(&self) -> usize {
        match self {
            Self::Rotating(p) => p.columns(),
            Self::Pinhole(p) => p.width(),
        }
    }

    /// Rays in a frame.
    pub fn rays(&self) -> usize {
        self.rows() * self.columns()
    }

    /// The pulse of a pixel of the range image: row 0 is the top, column 0 the first firing (or the left).
    pub fn pulse(&self, row: usize, column: usize) -> Pulse {
        match self {
            Self::Rotating(p) => p.pulse(row, column),
            Self::Pinhole(p) => Pulse { direction: p.direction(row, column), time_s: 0.0 },
        }
    }

    /// Whether the sensor is a camera: its image has planar depth, and its points live in the optical frame.
    pub fn is_camera(&self) -> bool {
        matches!(self, Self::Pinhole(_))
    }

    /// Frames a second, if the sensor file says so.
    pub fn rate_hz(&self) -> Option<f64> {
        match self {
            Self::Rotating(p) => Some(p.rate_hz()),
            Self::Pinhole(p) => p.rate_hz(),
        }
    }
}

impl Sensor {
    /// The `ring` of the points of an image row.
    pub fn ring(&self, row: usize) -> usize {
        match (self.ring, &self.pattern) {
            (RingOrder::BottomUp, pattern) => pattern.rows() - 1 - row,
            (RingOrder::File, Pattern::Rotating(p)) => p.beams()[row].file_index,
            _ => row,
        }
    }
}
