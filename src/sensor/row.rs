//! The pulses of one row of a frame's image, for loops over many pixels: what the pixels of a row share is looked up once.

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

/// What the pixels of a row share.
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

    /// Appends the pulses of some columns, as [`Self::pulse`] gives them. That takes half the time of asking for one after the other,
    /// because what the row shares is told apart once.
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

    /// [`Self::depth_over_range`] of the first columns, infinite where it is `None`. The compiler computes several at once, which
    /// halves the time of an ideal lens.
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

#[cfg(test)]
pub(crate) mod tests {
    use glam::DVec3;

    use super::super::{
        Beam, BrownConrady, Camera, Capture, Lens, Order, Orthographic, Phase, Raster, RayTable, RowOrder,
        Sensor, Shutter,
    };
    use super::*;
    use crate::angle::Angle;
    use crate::sensor::Rotating;

    /// Sensors of few pixels: rotating ones with one phase and with several, moved rows and silent beams, cameras with and
    /// without a lens that distorts, some pixels of which have no ray, and patterns whose rows share nothing.
    pub(crate) fn sensors_of_each_kind() -> Vec<Sensor> {
        let beam = |i: usize| Beam {
            elevation: Angle::deg(12.0 - 7.0 * i as f64),
            azimuth_offset: Angle::deg(if i.is_multiple_of(2) { 3.1 } else { -4.2 }),
            time_s: 1.5e-6 * i as f64,
            file_index: 0,
        };
        let turn = (Angle::deg(180.0), Angle::deg(-180.0));
        let rotating = || Rotating::new((0..4).map(beam).collect(), 12, turn, 10.0).unwrap();
        let cycle = [
            Phase { times_s: None, silent: vec![1] },
            Phase { times_s: Some(vec![1e-6, 2e-6, 3e-6, 4e-6]), silent: vec![0, 3] },
        ];
        let origins = [0.0, 0.25, 0.5, 0.75].map(|x| DVec3::new(x, 0.125, -x));
        let special = rotating().with_origins(&origins).unwrap().with_cycle(&cycle).unwrap();
        let special = special.turning_while_firing().with_shifts(&[3, 0, 11, 5]).unwrap();

        let camera = || Camera::from_hfov((9, 7), Angle::deg(90.0), Some(10.0)).unwrap();
        let rolling = || Shutter::rolling(1e-3, RowOrder::BottomUp).unwrap();
        let barrel = BrownConrady::new([-0.4, 0.0, 1e-3, -2e-3, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let bent = || camera().with_lens(Lens::BrownConrady(barrel.clone())).with_shutter(rolling());
        let inverted = bent();
        inverted.invert_lens();

        let angles = |angles: &[f64]| angles.iter().map(|&a| Angle::deg(a)).collect::<Vec<_>>();
        let (across, down) = (angles(&[20.0, 5.0, -10.0]), angles(&[4.0, -4.0]));
        let raster = Raster::new(&across, &down, Order::BackAndForth, 1e4, Some(10.0)).unwrap();
        let pulses = (0..6).map(|i| {
            let direction = DVec3::new(1.0, 0.1 * f64::from(i), -0.2);
            Pulse::new(DVec3::new(0.0, 0.0, 0.1), direction, 1e-4 * f64::from(i))
        });
        [
            Pattern::Rotating(rotating()),
            Pattern::Rotating(special.with_ranges_from_origin()),
            Pattern::Camera(camera()),
            Pattern::Camera(bent()),
            Pattern::Camera(inverted),
            Pattern::Orthographic(Orthographic::new((5, 4), (4.0, 1.5), None).unwrap()),
            Pattern::Raster(raster),
            Pattern::Rays(RayTable::new(pulses.collect(), None).unwrap()),
        ]
        .map(Sensor::new)
        .into()
    }

    /// A row tells of each pixel what the pixel's own pulse says: a camera looks along x of its body frame.
    #[test]
    fn a_row_has_the_pulses_of_its_pixels() {
        let (mut pulses, mut without) = (0, 0);
        for sensor in sensors_of_each_kind() {
            let capture = Capture::at_origin(&sensor).with_frame(3);
            for row in 0..capture.rows() {
                let of_row = capture.row(row);
                let depths = of_row.depths_over_ranges(capture.columns());
                let mut pulses_of_row = Vec::new();
                of_row.add_pulses(1..capture.columns(), &mut pulses_of_row);
                let times_s = of_row.times_s(capture.columns());
                for column in 0..capture.columns() {
                    let pulse = capture.pulse(row, column);
                    assert_eq!(of_row.pulse(column), pulse, "{} {row} {column}", sensor.pattern.name());
                    assert_eq!(of_row.time_s(column), pulse.map(|pulse| pulse.time_s));
                    let depth = pulse.filter(|_| sensor.pattern.is_camera()).map(|pulse| pulse.direction.x);
                    assert_eq!(of_row.depth_over_range(column), depth);
                    assert_eq!(pulses_of_row.get(column.wrapping_sub(1)), (column > 0).then_some(&pulse));
                    assert_eq!(times_s[column], pulse.map_or(0.0, |pulse| pulse.time_s));
                    assert_eq!(depths[column], depth.unwrap_or(f64::INFINITY));
                    pulses += usize::from(pulse.is_some());
                    without += usize::from(pulse.is_none());
                }
            }
        }
        assert!(pulses > 200 && without > 20, "{pulses} {without}");
    }
}
