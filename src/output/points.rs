//! The returns of a frame as points, for the formats of clouds.

use std::ops::Range;

use glam::DVec3;

use super::channel::BYTES_A_VALUE;
use super::format::EncodeError;
use super::options::{OptionSpec, OptionValues, Options};
use super::sensor_frame::SensorFrame;
use crate::frame::Pose;
use crate::scan::Return;
use crate::sensor::{Pulse, Sensor};
use crate::truth::SurfaceMotion;

/// A return as a point of a cloud.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// The position in the cloud's frame in metres. The computation is in f64, so each coordinate is rounded once.
    pub position_m: [f32; 3],
    /// The same position before it is rounded.
    pub exact_m: DVec3,
    /// The row of the range image.
    pub row: usize,
    /// The number of the beam, as the sensor's maker counts.
    pub ring: usize,
    /// The column of the range image.
    pub column: usize,
    /// The time of the pulse from the frame's start in seconds.
    pub time_s: f64,
    /// The return.
    pub hit: Return,
    /// The slot of the return.
    pub slot: usize,
    /// The number of the return in its pixel, from 0.
    pub number: usize,
    /// The number of points of its pixel.
    pub of: usize,
}

/// The option of clouds that adds [`TERM_FIELDS`].
pub(super) const TERMS: OptionSpec = OptionSpec {
    name: "terms",
    about: "Whether each point of a sensor that is not ideal has, after its other fields, `ideal` (the exact range in metres) and the \
            terms of its range's error, which add up to the range: `angle`, `footprint`, `walk`, `noise`, `bias` and `rounding`.",
    values: OptionValues::Flag { default: false },
};

/// The names of the fields that the option [`TERMS`] adds: floats of 32 bits.
pub(super) const TERM_FIELDS: [&str; 7] =
    ["ideal", "angle", "footprint", "walk", "noise", "bias", "rounding"];

/// The names of the fields that points of sensors have which are not ideal: two integers, then floats of 32 bits.
pub(super) const MEASURED_FIELDS: [&str; 4] = ["return", "cause", "snr", "echo_width"];

/// The fields that a sensor's points have after those of the format: each with its name, and whether it is an integer.
pub(super) fn more_fields(sensor: &Sensor, options: &Options) -> Vec<(&'static str, bool)> {
    let is_measured = !sensor.measurement.is_ideal();
    let measured = MEASURED_FIELDS.iter().filter(|_| is_measured);
    let terms = TERM_FIELDS.iter().filter(|_| is_measured && options.is_set(&TERMS));
    let motion = MOTION_FIELDS.iter().filter(|_| options.is_set(&MOTION));
    measured
        .chain(terms)
        .chain(motion)
        .map(|&name| (name, ["return", "cause", "track"].contains(&name)))
        .collect()
}

/// The bytes of [`more_fields`].
pub(super) fn more_bytes(sensor: &Sensor, options: &Options) -> u64 {
    BYTES_A_VALUE * more_fields(sensor, options).len() as u64
}

/// The option of clouds that adds [`MOTION_FIELDS`].
pub(super) const MOTION: OptionSpec = OptionSpec {
    name: "motion",
    about: "Whether each point has, after its other fields, `track` (the object's number in boxes.jsonl, 0 for none), \
            `velocity_x`, `velocity_y` and `velocity_z` (m/s) of the surface, and `flow_x`, `flow_y` and `flow_z` (m), by which the \
            surface's own point moves on until the next frame starts: over the ground, along the axes of the cloud.",
    values: OptionValues::Flag { default: false },
};

/// The names of the fields that the option [`MOTION`] adds: an integer, then floats of 32 bits.
pub(super) const MOTION_FIELDS: [&str; 7] =
    ["track", "velocity_x", "velocity_y", "velocity_z", "flow_x", "flow_y", "flow_z"];

/// The whole number nearest to a value, the one farther from 0 of two. `None` if it is not within ±(2³¹ − 1).
///
/// `f64::round` would be a call of the C library, for each point and field.
#[inline(always)]
pub(super) fn rounded(value: f64) -> Option<i32> {
    let whole = value as i32;
    let rest = value - f64::from(whole);
    let fits = value.abs() < f64::from(i32::MAX) + 0.5;
    fits.then(|| whole + i32::from(rest >= 0.5) - i32::from(rest <= -0.5))
}

impl SensorFrame<'_> {
    /// Appends the values of [`more_fields`] of a point.
    pub(super) fn add_more(&self, point: &Point, options: &Options, file: &mut Vec<u8>) {
        if let Some(echo) = self.frame.echo(point.slot) {
            file.extend_from_slice(&(point.number as u32).to_le_bytes());
            file.extend_from_slice(&echo.cause.number().to_le_bytes());
            file.extend_from_slice([echo.snr, echo.width_m].map(f32::to_le_bytes).as_flattened());
            if options.is_set(&TERMS) {
                file.extend_from_slice(&(echo.terms.ideal_m as f32).to_le_bytes());
                let errors = echo.terms.errors_m().map(|error_m| (error_m as f32).to_le_bytes());
                file.extend_from_slice(errors.as_flattened());
            }
        }
        if options.is_set(&MOTION) {
            file.extend_from_slice(self.motion_of(point).as_flattened());
        }
    }

    /// The values of the [`MOTION_FIELDS`] of a point. A track has no more bits than an integer of the format.
    fn motion_of(&self, point: &Point) -> [[u8; 4]; 7] {
        let world_from_cloud =
            self.world_from_sensor_at(point.time_s) * self.cloud_from_sensor(point.time_s).inverse();
        let along = |in_world: DVec3| world_from_cloud.rotation.transpose() * in_world;
        let SurfaceMotion { velocity_m_s, flow_m } = self.motion(point.slot);
        let [v, f] =
            [velocity_m_s, flow_m].map(|in_world| along(in_world).as_vec3().to_array().map(f32::to_le_bytes));
        [self.track(point.slot).to_le_bytes(), v[0], v[1], v[2], f[0], f[1], f[2]]
    }

    fn world_from_sensor_at(&self, time_s: f64) -> Pose {
        self.capture.world_from_sensor(time_s)
    }

    /// Calls `write` with each return, row by row of the range image. The returns of a pixel follow each other.
    ///
    /// # Errors
    /// The first error of `write`.
    pub fn each_point(
        &self,
        mut write: impl FnMut(&Point) -> Result<(), EncodeError>,
    ) -> Result<(), EncodeError> {
        /// Columns whose pulses are computed at once, which the nearest cache holds.
        const BLOCK: usize = 128;
        let (frame, fixed) = (self.frame, self.fixed_cloud_from_sensor());
        let mut pulses = Vec::with_capacity(BLOCK);
        for row in 0..frame.rows() {
            let (ring, of_row) = (self.capture.sensor.ring(row), self.capture.row(row));
            for first in (0..frame.columns()).step_by(BLOCK) {
                let block = first..frame.columns().min(first + BLOCK);
                pulses.clear();
                of_row.add_pulses(block.clone(), &mut pulses);
                for (column, pulse) in block.zip(&pulses) {
                    let slots = frame.slots(row * frame.columns() + column);
                    if let (Some(pulse), false) = (pulse, slots.is_empty()) {
                        let at = (row, column, ring);
                        self.points_of_pulse(at, pulse, slots, fixed.as_ref(), &mut write)?;
                    }
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
        let at = (row, column, self.capture.sensor.ring(row));
        self.points_of_pulse(at, &pulse, slots, fixed.as_ref(), write)
    }

    /// [`Self::points_of_pixel`], of a pixel whose row, column and ring are known, and its pulse.
    #[inline(always)]
    fn points_of_pulse(
        &self,
        (row, column, ring): (usize, usize, usize),
        pulse: &Pulse,
        slots: Range<usize>,
        fixed: Option<&Pose>,
        write: &mut impl FnMut(&Point) -> Result<(), EncodeError>,
    ) -> Result<(), EncodeError> {
        let own;
        let cloud_from_sensor = match fixed {
            Some(fixed) => fixed,
            None => {
                own = self.cloud_from_sensor(pulse.time_s);
                &own
            }
        };
        let (first, of) = (slots.start, slots.len());
        for slot in slots {
            let hit = self.frame.returns().get(slot);
            let exact_m = cloud_from_sensor.point(pulse.point(hit.range_m));
            write(&Point {
                position_m: exact_m.as_vec3().to_array(),
                exact_m,
                row,
                ring,
                column,
                time_s: pulse.time_s,
                hit,
                slot,
                number: slot - first,
                of,
            })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::scan::{Cause, Frame};
    use crate::sensor::{Camera, Capture, Pattern, sensors_of_each_kind};

    /// Points follow each other as the pixels do, and each lies where the pulse of its own pixel meets it, in images that are
    /// narrower and wider than a block of pulses.
    #[test]
    fn points_are_those_of_their_pixels() {
        let wide = Camera::from_hfov((300, 3), Angle::deg(60.0), None).unwrap();
        let wide = [Sensor::new(Pattern::Camera(wide))];
        for sensor in sensors_of_each_kind().into_iter().chain(wide) {
            let capture = Capture::at_origin(&sensor);
            let (rows, columns) = (capture.rows(), capture.columns());
            let pixel = |i: usize| {
                let has_return = i % 7 != 3 && capture.pulse(i / columns, i % columns).is_some();
                let one = Return { range_m: 2.0 + i as f64, triangle: i as u32, ..Return::default() };
                (if has_return { Cause::Surface } else { Cause::Nothing }, one)
            };
            let pixels: Vec<_> = (0..rows * columns).map(pixel).collect();
            let frame = Frame::of_own_slots(rows, columns, &pixels);
            let seen = SensorFrame::new(capture, &frame, "top");
            let mut pixels = (0..rows * columns).filter(|&i| pixels[i].0 == Cause::Surface);
            seen.each_point(|point| {
                let pixel = pixels.next().unwrap();
                let (row, column) = (pixel / columns, pixel % columns);
                assert_eq!((point.row, point.column, point.slot), (row, column, pixel));
                assert_eq!((point.ring, point.number, point.of), (sensor.ring(row), 0, 1));
                assert_eq!(point.hit, frame.returns().get(pixel));
                assert_eq!(Some(point.exact_m), seen.point(row, column, point.hit.range_m));
                assert_eq!(Some(point.time_s), capture.time_s(row, column));
                Ok(())
            })
            .unwrap();
            assert_eq!(pixels.next(), None);
        }
    }

    #[test]
    fn values_are_rounded_as_round_does() {
        let most = f64::from(i32::MAX);
        let below_half = 0.499_999_999_999_999_94;
        for value in [0.0, 0.5, below_half, 1.4, 1.5, 2.5, 1e6 + 0.5, most, most + 0.25, most - 0.5] {
            for value in [value, -value] {
                assert_eq!(rounded(value).map(f64::from), Some(value.round() + 0.0), "{value}");
            }
        }
        let others = [most + 0.5, -most - 0.5, 1e300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
        assert_eq!(others.map(rounded), [None; 6]);
    }
}
