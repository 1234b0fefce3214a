//! The capture of one frame of one sensor, before any ray is cast. It is the only door to pulses and their times.

use glam::DVec3;
use rayon::prelude::*;

use super::{Lens, Pattern, Pulse, PulseRow, Sensor};
use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::motion::{AT_ORIGIN, Trajectory, Window};

/// One frame of a sensor that is mounted on a moving body. It says which pulses go out, at what time, and from which pose.
///
/// Every writer, check and page that needs a pulse asks the capture of its frame. A pattern that does not repeat sends other
/// pulses in each frame, so a pulse without a capture would belong to no frame at all.
#[derive(Clone, Copy, Debug)]
pub struct Capture<'a> {
    /// The sensor.
    pub sensor: &'a Sensor,
    /// The pose of the sensor on the body.
    pub body_from_sensor: Pose,
    /// The pose of the body over time.
    pub trajectory: &'a Trajectory,
    /// The frame's number, from 0.
    pub frame: u64,
    /// The time at which the frame starts, in seconds from the moment at which the sensor is switched on. The trajectory's
    /// time has the same zero.
    pub start_s: f64,
    /// Whether all pulses are cast at the frame's start, whatever their own times: nothing moves during the frame.
    pub is_frozen: bool,
    /// The seed of all random numbers.
    pub seed: u64,
    /// The number of the sensor in its rig, from 0. Sensors of a rig draw different random numbers.
    pub index: u32,
}

impl<'a> Capture<'a> {
    /// Frame number `frame` of a sensor. It starts at frame/rate seconds. Every frame of a sensor without a rate starts at
    /// 0.
    pub fn new(
        sensor: &'a Sensor,
        body_from_sensor: Pose,
        trajectory: &'a Trajectory,
        frame: u64,
        seed: u64,
    ) -> Self {
        let start_s = sensor.pattern.rate_hz().map_or(0.0, |rate_hz| frame as f64 / rate_hz);
        Self { sensor, body_from_sensor, trajectory, frame, start_s, is_frozen: false, seed, index: 0 }
    }

    /// The same frame in a sequence whose frame 0 starts at `start_s`.
    #[must_use]
    pub fn in_sequence(self, start_s: f64, is_frozen: bool) -> Self {
        Self { start_s: start_s + self.start_s, is_frozen, ..self }
    }

    /// The same frame of the sensor with this number in its rig.
    #[must_use]
    pub fn of_rig(self, index: u32) -> Self {
        Self { index, ..self }
    }

    /// The first frame of a sensor that stands at the world's origin, for questions about the sensor alone.
    pub fn at_origin(sensor: &'a Sensor) -> Self {
        Self::new(sensor, Pose::IDENTITY, &AT_ORIGIN, 0, 0)
    }

    /// The capture of another frame, with the same sensor, mount and motion.
    #[must_use]
    pub fn with_frame(self, frame: u64) -> Self {
        Self::new(self.sensor, self.body_from_sensor, self.trajectory, frame, self.seed).of_rig(self.index)
    }

    /// The capture of a camera so many metres to the right along the rows of this one's image, with the same axes.
    #[must_use]
    pub fn to_the_right(self, right_m: f64) -> Self {
        // The body frame's y is to the left.
        let aside = Pose { translation: DVec3::new(0.0, -right_m, 0.0), ..Pose::IDENTITY };
        Self { body_from_sensor: self.body_from_sensor * aside, ..self }
    }

    /// Rows of the frame's image.
    pub fn rows(&self) -> usize {
        self.sensor.pattern.rows()
    }

    /// Columns of the frame's image.
    pub fn columns(&self) -> usize {
        self.sensor.pattern.columns()
    }

    /// The pulse of a pixel of the range image, in the sensor's body frame at the pulse's own time. Row 0 is the top, and
    /// column 0 is the first firing (or the left).
    ///
    /// `None` if the pixel has no ray: the lens's model has none for it, a prism reflects the beam inward, or the beam does
    /// not fire in that column.
    #[inline]
    pub fn pulse(&self, row: usize, column: usize) -> Option<Pulse> {
        self.sensor.pattern.pulse(row, column, self.start_s)
    }

    /// The unit direction of a camera's ray through a place (u, v) of a pixel, in pixels from its centre to the right and down, in the
    /// sensor's body frame. `None` if the sensor is no camera, or if the pixel has no ray.
    pub fn direction_in_pixel(&self, row: usize, column: usize, place: [f64; 2]) -> Option<DVec3> {
        match &self.sensor.pattern {
            Pattern::Camera(camera) => {
                let optical = camera.optical_direction_in_pixel(row, column, place)?;
                Some(BODY_FROM_OPTICAL.direction(optical))
            }
            _ => None,
        }
    }

    /// The pulses of a row of the range image: those of [`Self::pulse`], for loops over many columns of a row.
    #[inline]
    pub fn row(&self, row: usize) -> PulseRow<'a> {
        PulseRow::of(&self.sensor.pattern, row, self.start_s)
    }

    /// The time of a pixel's pulse, in seconds from the frame's start. `None` as for [`Self::pulse`].
    #[inline]
    pub fn time_s(&self, row: usize, column: usize) -> Option<f64> {
        self.row(row).time_s(column)
    }

    /// The factor that turns a range along a pixel's ray into depth along the camera's optical axis. `None` if the sensor
    /// is no camera, or if the pixel has no ray.
    #[inline]
    pub fn depth_over_range(&self, row: usize, column: usize) -> Option<f64> {
        self.row(row).depth_over_range(column)
    }

    /// The sensor's pose at which a pulse is cast `time_s` seconds from the frame's start.
    pub fn world_from_sensor(&self, time_s: f64) -> Pose {
        self.trajectory.pose_at(self.cast_at_s(time_s)) * self.body_from_sensor
    }

    /// The time at which a pulse of `time_s` seconds from the frame's start is cast, on the clock of the trajectory and of the
    /// scene.
    pub fn cast_at_s(&self, time_s: f64) -> f64 {
        if self.is_frozen { self.start_s } else { self.start_s + time_s }
    }

    /// The times at which pulses are cast, from the first to the last, and those of their exposures before and after.
    pub fn window(&self) -> Window {
        let (pattern, half_s) = (&self.sensor.pattern, self.sensor.half_exposure_s());
        let [from_s, to_s] = [pattern.first_pulse_s() - half_s, pattern.last_pulse_s() + half_s]
            .map(|time_s| self.cast_at_s(time_s));
        Window { from_s, to_s }
    }

    /// The time from the frame's start to its end, in seconds: to the start of the sensor's next frame, or to the last pulse of
    /// a sensor without a rate.
    pub fn duration_s(&self) -> f64 {
        let pattern = &self.sensor.pattern;
        pattern.rate_hz().map_or_else(|| pattern.last_pulse_s(), |rate_hz| 1.0 / rate_hz)
    }

    /// The pose of the sensor for the whole frame, if the body stands still or the frame is frozen.
    pub fn fixed_world_from_sensor(&self) -> Option<Pose> {
        if self.is_frozen {
            return Some(self.world_from_sensor(0.0));
        }
        self.trajectory.fixed_pose().map(|world_from_body| world_from_body * self.body_from_sensor)
    }

    /// What about a sensor's pulses is no number that can be computed with, although the numbers that they follow from are:
    /// quotients and products overflow. It asks the middle and the edges of the image, and of a LiDAR each beam.
    pub fn problem_of_numbers(&self) -> Option<NumberProblem> {
        let (rows, columns) = (self.rows(), self.columns());
        // Some beams are silent in some columns.
        let ends = |count: usize| [0, 1, 2, 3, count / 2, count - 1].map(|i| i.min(count - 1));
        let every_beam = 0..if self.sensor.pattern.is_camera() { 0 } else { rows.min(MOST_BEAMS_TO_ASK) };
        for row in ends(rows).into_iter().chain(every_beam) {
            for column in ends(columns) {
                let Some(pulse) = self.pulse(row, column) else { continue };
                let off_unit_length = (pulse.direction.length_squared() - 1.0).abs();
                if off_unit_length.is_nan() || off_unit_length > 1e-6 {
                    return Some(NumberProblem::Direction);
                }
                // Outputs have 32 bits for a time and for a coordinate.
                if !(pulse.time_s as f32).is_finite() {
                    return Some(NumberProblem::Time);
                }
                if !pulse.origin.as_vec3().is_finite() {
                    return Some(NumberProblem::Origin);
                }
            }
        }
        let times = [self.sensor.pattern.last_pulse_s(), 1.0 / self.sensor.pattern.rate_hz().unwrap_or(1.0)];
        times.iter().any(|time| !(*time as f32).is_finite()).then_some(NumberProblem::Time)
    }

    /// The number of pixels of the frame that have no pulse. It asks each pixel, if the pattern can have pixels without a
    /// pulse. In frames of more than `most` pixels it asks about so many of them, evenly spaced, and estimates.
    pub fn blind_pixels(&self, most: usize) -> usize {
        let can_be_blind = match &self.sensor.pattern {
            Pattern::Rotating(rotating) => return rotating.silent_pixels(),
            Pattern::Camera(camera) => !matches!(camera.lens(), Lens::Ideal),
            Pattern::Risley(_) => true,
            _ => false,
        };
        let columns = self.columns();
        let pixels = self.rows() * columns;
        let step = pixels.div_ceil(most.max(1));
        let is_blind = |i: &usize| self.pulse(i * step / columns, i * step % columns).is_none();
        match can_be_blind {
            true => (0..pixels.div_ceil(step))
                .into_par_iter()
                .filter(is_blind)
                .count()
                .saturating_mul(step)
                .min(pixels),
            false => 0,
        }
    }

    /// Computes in parallel the inverse of a lens for each pixel, which takes long and is the same in every frame. A scan
    /// calls it before it casts. Without it, [`Self::pulse`] gives the same answer, but later.
    pub fn prepare(&self) {
        if let Pattern::Camera(camera) = &self.sensor.pattern {
            camera.invert_lens();
        }
    }
}

/// The number of beams up to which each is asked for its numbers.
const MOST_BEAMS_TO_ASK: usize = 1 << 16;

/// A number of a sensor's pulses that can't be computed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NumberProblem {
    /// A direction has no length.
    #[error("a ray of the sensor has no direction")]
    Direction,
    /// A time is infinite, or too large for the outputs.
    #[error("the time of a pulse is too large for a number")]
    Time,
    /// An origin is infinite, or too large for the outputs.
    #[error("the origin of a pulse is too far away for a number")]
    Origin,
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::sensor::{
        Beam, BrownConrady, Camera, Order, Orthographic, Phase, Prism, RangeLimits, Raster, RayTable,
        RingOrder, Ripple, Risley, Rotating, RowOrder, Shutter, Tilted,
    };
    use glam::DVec3;

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

    fn prism_sensor() -> Sensor {
        let prism = |rate_hz, wedge| Prism {
            rate_hz,
            wedge: Angle::deg(wedge),
            index: 1.5,
            phase: Angle::default(),
            tilted: Tilted::Exit,
            ripple: Ripple::default(),
        };
        let pattern = Risley::new(vec![prism(121.7, 18.0), prism(-77.3, 18.0)], &[DVec3::X], 1e4, 10.0);
        Sensor {
            pattern: Pattern::Risley(pattern.unwrap()),
            range: RangeLimits::default(),
            ring: RingOrder::default(),
            measurement: Default::default(),
        }
    }

    /// Frame 7 of a pattern that does not repeat goes on where frame 6 ended.
    #[test]
    fn frames_of_a_pattern_that_does_not_repeat_follow_each_other() {
        let sensor = prism_sensor();
        let first = Capture::at_origin(&sensor);
        let seventh = first.with_frame(7);
        assert_eq!((seventh.frame, seventh.start_s), (7, 0.7));
        assert_ne!(first.pulse(0, 0), seventh.pulse(0, 0));
        let last_of_sixth = first.with_frame(6).pulse(0, 999).unwrap();
        let [now, next] = [0, 1].map(|column| seventh.pulse(0, column).unwrap());
        let step = |a: Pulse, b: Pulse| (a.direction - b.direction).length();
        assert!((step(last_of_sixth, now) - step(now, next)).abs() < 0.1 * step(now, next));
        assert_eq!((now.time_s, seventh.time_s(0, 1)), (0.0, Some(next.time_s)));
    }

    #[test]
    fn the_pose_is_that_of_the_pulses_own_time() {
        let sensor = prism_sensor();
        let trajectory = Trajectory::Twist {
            start: Pose::IDENTITY,
            linear_m_s: DVec3::new(10.0, 0.0, 0.0),
            angular_rad_s: DVec3::ZERO,
        };
        let mount = Pose { translation: DVec3::new(0.0, 0.0, 2.0), ..Pose::IDENTITY };
        let capture = Capture::new(&sensor, mount, &trajectory, 3, 0);
        let at = capture.world_from_sensor(0.05).translation;
        assert!(at.abs_diff_eq(DVec3::new(3.5, 0.0, 2.0), 1e-14), "{at}");
        assert_eq!(capture.fixed_world_from_sensor(), None);
        assert_eq!(Capture::at_origin(&sensor).fixed_world_from_sensor(), Some(Pose::IDENTITY));
    }
}
