//! Sensors as pure geometry: the pattern of a sensor yields pulses. This room reads no files and knows no scene.
//!
//! ```text
//! rotating raster mirror risley rays   the patterns of LiDARs, one file each
//! camera     the directions of a camera's pixels; lens: models of distortion; polynomial: where a model folds
//! orthographic  a camera of parallel rays
//! measurement  how a sensor measures: its beams' width, its receiver, its noise
//! spad       a receiver that counts photons
//! shutter    the times at which the rows of an image are exposed
//! capture    one frame of one sensor: the only door to pulses
//! row        the pulses of one row of a frame
//! sight      where a sensor looks
//! facts      what follows from a pattern: fields of view, steps, points a second
//! ```

mod camera;
mod capture;
mod depth;
pub mod facts;
mod lens;
mod measurement;
mod mirror;
mod orthographic;
mod polynomial;
mod published;
mod raster;
mod rays;
mod risley;
mod rotating;
mod row;
mod shutter;
mod sight;
mod spad;

use std::cmp::Ordering;

use glam::DVec3;

use crate::angle::Angle;

pub use camera::{Camera, CameraError, Registered};
#[cfg(test)]
pub(crate) use capture::tests::sensors_of_each_kind;
pub use capture::{Capture, NumberProblem};
pub use depth::{
    AnalyticDisparity, DepthSensing, Imager, Matching, Projector, SecondViewpoint, Stereo, StereoMethod,
    TimeOfFlight,
};
pub use lens::{BrownConrady, KannalaBrandt, Lens};
pub use measurement::{Blooming, DimmerBeams, Footprint, Measurement, Noise, Receiver, ReturnMode, Spad};
pub use mirror::{Axis, Mirror, MirrorError, Motion};
pub use orthographic::{Orthographic, OrthographicError};
pub use published::{Published, Quantity, StatedAt};
pub use raster::{Order, Raster, RasterError};
pub use rays::{RayTable, RayTableError};
pub use risley::{Prism, Ripple, Risley, RisleyError, Tilted, TurningMirror};
pub use rotating::{Beam, Phase, Rotating, RotatingError};
pub use row::PulseRow;
pub use shutter::{RowOrder, Shutter};
pub use sight::Sight;
pub use spad::{CountedPlane, Counter};

/// A LiDAR or a depth camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// The layout of the beams in space and time.
    pub pattern: Pattern,
    /// The ranges at which the sensor detects a surface.
    pub range: RangeLimits,
    /// The meaning of `ring` in a point cloud.
    pub ring: RingOrder,
    /// How the sensor measures.
    pub measurement: Measurement,
}

impl Sensor {
    /// A sensor with a pattern and no limits of range. Its rings are the rows of its image.
    pub fn new(pattern: Pattern) -> Self {
        Self {
            pattern,
            range: RangeLimits::default(),
            ring: RingOrder::default(),
            measurement: Measurement::default(),
        }
    }

    /// The largest number of returns of a pulse.
    pub fn most_returns(&self) -> usize {
        self.measurement.receiver.as_ref().map_or(1, |receiver| receiver.returns.most())
    }

    /// The time in seconds before and after a pulse's own time at which the sensor looks, too.
    pub(crate) fn half_exposure_s(&self) -> f64 {
        self.measurement.depth.as_ref().map_or(0.0, DepthSensing::half_exposure_s)
    }

    /// Whether the length of a ray alone says what the sensor reports of a hit: its range counts along the ray from the
    /// pulse's origin, and the limits are those of the range.
    pub(crate) fn judges_by_length(&self) -> bool {
        let counts_along = match &self.pattern {
            Pattern::Rotating(rotating) => rotating.ranging() == Ranging::default(),
            _ => true,
        };
        counts_along && self.range.of == Limited::Range
    }
}

/// The limits of what a sensor detects. Both limits are included. A surface nearer than the least range is not detected, but
/// it blocks the beam, so that nothing behind it is detected either: this is the sensor's dead zone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeLimits {
    /// The least range or depth in metres, 0 or more.
    pub min_m: f64,
    /// The largest range or depth in metres, infinite if the sensor has no limit.
    pub max_m: f64,
    /// The length that has these limits.
    pub of: Limited,
}

/// The length that a sensor's limits apply to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Limited {
    /// The range as the sensor reports it, along the ray.
    #[default]
    Range,
    /// The depth along a camera's optical axis. Data sheets of depth cameras state their limits so. A ray at a right angle
    /// to the axis or beyond has no depth above 0.
    Depth,
}

impl Default for RangeLimits {
    fn default() -> Self {
        Self { min_m: 0.0, max_m: f64::INFINITY, of: Limited::Range }
    }
}

impl RangeLimits {
    /// Where a surface lies whose range or depth, whichever is limited, is so many metres: `Less` is too near, `Equal` is
    /// within the limits, and `Greater` is too far.
    #[inline]
    pub fn place(&self, limited_m: f64) -> Ordering {
        if limited_m < self.min_m {
            Ordering::Less
        } else if limited_m <= self.max_m {
            Ordering::Equal
        } else {
            Ordering::Greater
        }
    }

    /// Where a surface lies, as [`Self::place`] has it, that a sensor reports at a range along a pulse's ray.
    #[inline]
    pub fn place_of(&self, pulse: &Pulse, range_m: f64) -> Ordering {
        self.place(match self.of {
            Limited::Range => range_m,
            // A camera looks along x of its body frame.
            Limited::Depth => range_m * pulse.direction.x,
        })
    }
}

/// The meaning of the field `ring` of a point cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RingOrder {
    /// The row of the image: 0 is the highest beam.
    #[default]
    Row,
    /// The count from below: 0 is the lowest beam, as in Velodyne's drivers.
    BottomUp,
    /// The index in the beam table of the sensor file.
    File,
}

/// The layout of a sensor's beams in space and time.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// Beams on a turning head.
    Rotating(Rotating),
    /// A grid of azimuths and elevations, for line scanners, flash LiDARs and spherical images.
    Raster(Raster),
    /// A beam on a mirror that moves about two axes.
    Mirror(Mirror),
    /// Beams through turning prisms, and off a turning mirror behind them if there is one.
    Risley(Risley),
    /// Rays that are listed in a table.
    Rays(RayTable),
    /// A camera with a lens.
    Camera(Camera),
    /// A camera of parallel rays.
    Orthographic(Orthographic),
}

/// One beam of one firing, or one pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// The point from which the light leaves, in the sensor's body frame, in metres.
    pub origin: DVec3,
    /// Unit direction in the sensor's body frame (x forward, y left, z up).
    pub direction: DVec3,
    /// The time in seconds from the frame's start. It is negative if a beam fires before the first column's own time.
    pub time_s: f64,
    /// How the sensor counts the range of a point on the ray.
    pub ranging: Ranging,
}

/// How a sensor counts the range of a point on a pulse's ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ranging {
    /// Along the ray, beginning so many metres before the pulse's origin. Ouster's range counts from the axis to the beam's
    /// origin and on along the beam.
    Along(f64),
    /// From the sensor's origin in a straight line. Hesai's range is the distance of the point from the centre of the head,
    /// though the light leaves beside it.
    FromOrigin,
}

impl Default for Ranging {
    fn default() -> Self {
        Self::Along(0.0)
    }
}

/// With t along the ray, o the pulse's origin and d its direction, a point's distance from the sensor's origin is r with
/// r² = |o + t·d|² = (t + o·d)² + |o × d|²: the ray passes the sensor's origin at the distance q = |o × d|, at t = −o·d. Both
/// directions of the formula are free of cancellation, so that a range and its length along the ray give each other to a few
/// ulps.
impl Pulse {
    /// A pulse whose range counts along the ray from its origin.
    pub fn new(origin: DVec3, direction: DVec3, time_s: f64) -> Self {
        Self { origin, direction, time_s, ranging: Ranging::default() }
    }

    /// The point at a range in metres as the sensor reports it, in the sensor's body frame.
    pub fn point(&self, range_m: f64) -> DVec3 {
        self.origin + self.direction * self.along_m(range_m)
    }

    /// The length along the ray, from the pulse's origin, at which the sensor reports a range, in metres. A range nearer than
    /// the ray comes to the sensor's origin has none; the length where it is nearest stands for it.
    pub fn along_m(&self, range_m: f64) -> f64 {
        match self.ranging {
            Ranging::Along(before) => range_m - before,
            Ranging::FromOrigin => self.along_from_origin_m(range_m),
        }
    }

    /// It is a call of its own, because the compiler would have its square roots taken for every pulse, and choose behind that.
    #[cold]
    #[inline(never)]
    fn along_from_origin_m(&self, range_m: f64) -> f64 {
        let nearest = self.origin.cross(self.direction).length();
        ((range_m - nearest).max(0.0) * (range_m + nearest)).sqrt() - self.origin.dot(self.direction)
    }

    /// The range that the sensor reports of a point so many metres along the ray from the pulse's origin.
    pub fn range_m(&self, along_m: f64) -> f64 {
        match self.ranging {
            Ranging::Along(before) => along_m + before,
            Ranging::FromOrigin => {
                let nearest = self.origin.cross(self.direction).length();
                libm::hypot(along_m + self.origin.dot(self.direction), nearest)
            }
        }
    }
}

/// The unit direction of an azimuth α and an elevation ε: (cos ε · cos α, cos ε · sin α, sin ε), in the sensor's body
/// frame.
pub fn direction(azimuth: Angle, elevation: Angle) -> DVec3 {
    let (sin_az, cos_az) = azimuth.sin_cos();
    let (sin_el, cos_el) = elevation.sin_cos();
    DVec3::new(cos_el * cos_az, cos_el * sin_az, sin_el)
}

/// The azimuth and the elevation of a direction of any length. The azimuth of a vertical direction is 0.
pub fn azimuth_elevation(d: DVec3) -> (Angle, Angle) {
    (Angle::rad(libm::atan2(d.y, d.x)), Angle::rad(libm::atan2(d.z, libm::hypot(d.x, d.y))))
}

/// The largest number of pulses that a beam may send in a frame.
const MAX_PULSES: f64 = 1e8;

/// The number of whole pulses that a beam sends in a frame: the pulse rate over the frame rate, rounded. `None` if that is
/// not a number from 1 to [`MAX_PULSES`].
fn pulses_a_frame(pulse_rate_hz: f64, rate_hz: f64) -> Option<usize> {
    let pulses = (pulse_rate_hz / rate_hz).round();
    let are_rates = pulse_rate_hz.is_finite() && rate_hz.is_finite() && rate_hz > 0.0;
    (are_rates && (1.0..=MAX_PULSES).contains(&pulses)).then_some(pulses as usize)
}

impl Pattern {
    /// Rows of the range image: the number of beams, or the height of a camera's image.
    pub fn rows(&self) -> usize {
        match self {
            Self::Rotating(p) => p.beams().len(),
            Self::Raster(p) => p.rows(),
            Self::Risley(p) => p.beams().len(),
            Self::Mirror(p) => p.beams().len(),
            Self::Rays(p) => p.rows(),
            Self::Camera(p) => p.height(),
            Self::Orthographic(p) => p.height(),
        }
    }

    /// Columns of the range image: the number of firings, or the width of a camera's image.
    pub fn columns(&self) -> usize {
        match self {
            Self::Rotating(p) => p.columns(),
            Self::Raster(p) => p.columns(),
            Self::Mirror(p) => p.columns(),
            Self::Risley(p) => p.columns(),
            Self::Rays(p) => p.columns(),
            Self::Camera(p) => p.width(),
            Self::Orthographic(p) => p.width(),
        }
    }

    /// Pixels of a frame, including the pixels without a ray.
    pub fn rays(&self) -> usize {
        self.rows() * self.columns()
    }

    /// The pulse of a pixel in the frame that starts `start_s` seconds after the sensor was switched on. The time of the
    /// pulse counts from the frame's start. Other rooms ask [`Capture::pulse`].
    #[inline]
    fn pulse(&self, row: usize, column: usize, start_s: f64) -> Option<Pulse> {
        match self {
            Self::Rotating(p) => p.pulse(row, column),
            Self::Raster(p) => Some(p.pulse(row, column)),
            Self::Mirror(p) => Some(p.pulse(row, column, start_s)),
            Self::Risley(p) => p.pulse(row, column, start_s),
            Self::Rays(p) => Some(p.pulse(row, column, start_s)),
            Self::Camera(p) => p.row(row).pulse(column),
            Self::Orthographic(p) => Some(p.pulse(row, column)),
        }
    }

    /// Whether the sensor is a camera. A camera's image has planar depth, and its points are given in the optical frame.
    pub fn is_camera(&self) -> bool {
        matches!(self, Self::Camera(_) | Self::Orthographic(_))
    }

    /// The image point of a point in a camera's optical frame, in pixels from the image's top left corner. It may lie outside of
    /// the image. `None` if the camera has no image of it, or if the sensor is no camera.
    pub fn project(&self, optical: DVec3) -> Option<(f64, f64)> {
        match self {
            Self::Camera(p) => p.project(optical),
            Self::Orthographic(p) => p.project(optical),
            _ => None,
        }
    }

    /// The shutter, if the rows are seen as wholes.
    pub fn shutter(&self) -> Option<&Shutter> {
        match self {
            Self::Camera(p) => Some(p.shutter()),
            Self::Orthographic(p) => Some(p.shutter()),
            Self::Raster(p) => p.shutter(),
            _ => None,
        }
    }

    /// Whether rows and columns are neighbours in space, so that the frame is a picture. In other patterns a row lists the
    /// pulses of a beam in the order of firing, whatever their directions are.
    pub fn is_image(&self) -> bool {
        matches!(self, Self::Rotating(_) | Self::Raster(_)) || self.is_camera()
    }

    /// The name of the pattern in a sensor file.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Rotating(_) => "rotating",
            Self::Raster(_) => "raster",
            Self::Mirror(_) => "mirror",
            Self::Risley(_) => "risley",
            Self::Rays(_) => "rays",
            Self::Camera(p) => match p.lens() {
                Lens::Ideal | Lens::BrownConrady(_) => "pinhole",
                Lens::KannalaBrandt(_) => "fisheye",
            },
            Self::Orthographic(_) => "orthographic",
        }
    }

    /// Frames a second, if the sensor file gives a rate.
    pub fn rate_hz(&self) -> Option<f64> {
        match self {
            Self::Rotating(p) => Some(p.rate_hz()),
            Self::Raster(p) => p.rate_hz(),
            Self::Mirror(p) => Some(p.rate_hz()),
            Self::Risley(p) => Some(p.rate_hz()),
            Self::Rays(p) => p.rate_hz(),
            Self::Camera(p) => p.rate_hz(),
            Self::Orthographic(p) => p.rate_hz(),
        }
    }

    /// The time of a frame's first pulse, in seconds from the frame's start. It is negative if the head fires some beams
    /// before a column's own time, and 0 in every other pattern.
    pub fn first_pulse_s(&self) -> f64 {
        match self {
            Self::Rotating(p) => p.pulse_times_s().0,
            _ => 0.0,
        }
    }

    /// The time of a frame's last pulse, in seconds from the frame's start.
    pub fn last_pulse_s(&self) -> f64 {
        match self {
            Self::Rotating(p) => p.pulse_times_s().1,
            Self::Raster(p) => p.last_pulse_s(),
            Self::Mirror(p) => p.last_pulse_s(),
            Self::Risley(p) => p.last_pulse_s(),
            Self::Rays(p) => p.last_pulse_s(),
            Self::Camera(p) => p.shutter().last_s(p.height()),
            Self::Orthographic(p) => p.shutter().last_s(p.height()),
        }
    }
}

impl Sensor {
    /// The value of `ring` for the points of an image row.
    pub fn ring(&self, row: usize) -> usize {
        match (self.ring, &self.pattern) {
            (RingOrder::BottomUp, pattern) => pattern.rows() - 1 - row,
            (RingOrder::File, Pattern::Rotating(p)) => p.beams()[row].file_index,
            _ => row,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A range and its length along the ray give each other, wherever the light leaves and wherever it goes.
    #[test]
    fn a_range_from_the_sensors_origin_is_a_distance_from_it() {
        let origins = [DVec3::ZERO, DVec3::new(0.0315, 0.013, 0.0), DVec3::new(-0.03, 0.004, 0.21)];
        for origin in origins {
            for (azimuth, elevation) in [(0.0, 0.0), (100.0, 15.0), (180.0, -25.0), (-77.0, 89.0)] {
                let direction = direction(Angle::deg(azimuth), Angle::deg(elevation));
                let pulse = Pulse { ranging: Ranging::FromOrigin, ..Pulse::new(origin, direction, 0.0) };
                for along in [0.0, 1e-3, 0.3, 7.25, 200.0, 1e6] {
                    let range = pulse.range_m(along);
                    let point = origin + direction * along;
                    let rounding = 4.0 * f64::EPSILON * (along + 1.0);
                    assert!((range - point.length()).abs() <= rounding, "{origin} {direction} {along}");
                    // Where the ray turns back towards the sensor's origin, two lengths have one range.
                    if along >= -origin.dot(direction) {
                        // A small length is known as well as the difference of the squares that gives it.
                        let slope = range / (along + origin.dot(direction)).max(1e-9);
                        assert!((pulse.along_m(range) - along).abs() <= rounding * slope.max(1.0));
                    }
                }
                assert!(pulse.point(10.0).length() - 10.0 < 1e-14);
            }
        }
        let beside = Pulse { ranging: Ranging::Along(0.25), ..Pulse::new(DVec3::Y, DVec3::X, 0.0) };
        assert_eq!((beside.range_m(1.0), beside.along_m(1.0)), (1.25, 0.75));
        assert_eq!(beside.point(1.0), DVec3::new(0.75, 1.0, 0.0));
    }
}
