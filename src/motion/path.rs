//! Rigid motion through given poses.

use glam::DVec3;

use super::screw::Screw;
use crate::frame::Pose;

/// How a body moves from one given pose to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Along a screw: the velocities in the body's own frame are constant, as of a car that drives round a bend. It is the
    /// exponential of the part `u` of the logarithm of the one pose seen from the other.
    #[default]
    Screw,
    /// The origin goes straight at constant speed, while the body turns at a constant rate (slerp).
    Linear,
}

/// A motion through poses at given times. It has exactly the given pose at each of its times.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    times_s: Vec<f64>,
    poses: Vec<Pose>,
    interpolation: Interpolation,
    /// How the body moves from each pose to the next, in its own axes. Of linear interpolation, the linear part is the
    /// difference of the positions, in the target's axes.
    steps: Vec<Screw>,
}

/// Why poses are no [`Path`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PathProblem {
    /// There is no pose.
    #[error("there are no poses")]
    Empty,
    /// There are not as many times as poses.
    #[error("there are {times} times for {poses} poses")]
    Counts {
        /// The times.
        times: usize,
        /// The poses.
        poses: usize,
    },
    /// The time with this index is not greater than the one before, or not finite.
    #[error("the time of pose {0} is not greater than that of the pose before")]
    Times(usize),
    /// The pose with this index has a number that is not finite.
    #[error("pose {0} is not finite")]
    NotFinite(usize),
}

/// What a motion may do between its poses, that they do not tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// The largest distance, in metres.
    pub most_m: f64,
    /// The index of the pose after which it is.
    pub after: usize,
}

impl Path {
    /// A motion through these poses at these times.
    ///
    /// # Errors
    /// [`PathProblem`] if there is no pose, if the times do not rise or are not as many, or if a number is not finite.
    pub fn new(
        times_s: Vec<f64>,
        poses: Vec<Pose>,
        interpolation: Interpolation,
    ) -> Result<Self, PathProblem> {
        if poses.is_empty() {
            return Err(PathProblem::Empty);
        }
        if times_s.len() != poses.len() {
            return Err(PathProblem::Counts { times: times_s.len(), poses: poses.len() });
        }
        let rises = |i: usize| times_s[i].is_finite() && (i == 0 || times_s[i - 1] < times_s[i]);
        if let Some(index) = (0..times_s.len()).find(|i| !rises(*i)) {
            return Err(PathProblem::Times(index));
        }
        if let Some(index) = poses.iter().position(|p| !(p.translation.is_finite() && p.rotation.is_finite()))
        {
            return Err(PathProblem::NotFinite(index));
        }
        let steps = poses.windows(2).map(|pair| {
            let step = Screw::log(pair[0].inverse() * pair[1]);
            match interpolation {
                Interpolation::Screw => step,
                Interpolation::Linear => Screw { linear: pair[1].translation - pair[0].translation, ..step },
            }
        });
        let steps = steps.collect();
        Ok(Self { times_s, poses, interpolation, steps })
    }

    /// The times of the poses, which rise.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// The poses.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The way from pose to pose.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// The pose at a time; before the first and after the last pose, that one.
    pub fn at(&self, time_s: f64) -> Pose {
        let next = self.times_s.partition_point(|time| *time <= time_s);
        if next == 0 || next == self.poses.len() {
            return self.poses[next.saturating_sub(1)];
        }
        let (before, after) = (self.times_s[next - 1], self.times_s[next]);
        let done = (time_s - before) / (after - before);
        // Counted from the nearer pose, the motion is continuous at both ends.
        if done <= 0.5 {
            self.along(next - 1, next - 1, done)
        } else {
            self.along(next - 1, next, (time_s - after) / (after - before))
        }
    }

    /// The pose at the part `part` of a step, counted from the pose number `from`, which is one of its ends.
    fn along(&self, step: usize, from: usize, part: f64) -> Pose {
        let (pose, way) = (self.poses[from], self.steps[step].times(part));
        if part == 0.0 {
            return pose;
        }
        match self.interpolation {
            Interpolation::Screw => pose * way.exp(),
            Interpolation::Linear => Pose {
                rotation: pose.rotation * Screw { linear: DVec3::ZERO, ..way }.exp().rotation,
                translation: pose.translation + way.linear,
            },
        }
    }

    /// The velocities at a time, by which the pose there goes on: of the origin in the target's axes, in metres a second, and
    /// about the body's own axes, in radians a second. At a pose they are those of the step that follows; before the first
    /// and after the last pose they are 0, and at the last they are those of the step that ends.
    pub(super) fn velocity(&self, time_s: f64) -> (DVec3, DVec3) {
        let (first, last) = self.span_s();
        if self.steps.is_empty() || !(first..=last).contains(&time_s) {
            return (DVec3::ZERO, DVec3::ZERO);
        }
        let step = (self.times_s.partition_point(|time| *time <= time_s) - 1).min(self.steps.len() - 1);
        let rate = self.rate(step);
        match self.interpolation {
            Interpolation::Screw => (self.at(time_s).direction(rate.linear), rate.angular),
            Interpolation::Linear => (rate.linear, rate.angular),
        }
    }

    /// The acceleration of the origin at a time, in the target's axes and metres a second squared, by which the velocity there goes
    /// on: along a screw the velocity in the body's own axes is constant, so that its direction alone changes.
    pub(super) fn acceleration(&self, time_s: f64) -> DVec3 {
        match self.interpolation {
            Interpolation::Linear => DVec3::ZERO,
            Interpolation::Screw => {
                let (linear, angular) = self.velocity(time_s);
                self.at(time_s).direction(angular).cross(linear)
            }
        }
    }

    /// A step, a second.
    fn rate(&self, step: usize) -> Screw {
        self.steps[step].times(1.0 / (self.times_s[step + 1] - self.times_s[step]))
    }

    /// The times of the first and the last pose.
    pub fn span_s(&self) -> (f64, f64) {
        (self.times_s[0], self.times_s[self.times_s.len() - 1])
    }

    /// The largest speed that one of these points of the body has at a time of a closed span, and the largest angular speed.
    pub(super) fn most_speed(&self, from_s: f64, to_s: f64, points: &[DVec3]) -> (f64, f64) {
        let (mut speed, mut turn) = (0.0_f64, 0.0_f64);
        let first = self.times_s.partition_point(|time| *time <= from_s).saturating_sub(1);
        let end = self.times_s.partition_point(|time| *time < to_s).min(self.steps.len());
        for step in first..end {
            let rate = self.rate(step);
            turn = turn.max(rate.angular.length());
            for point in points {
                speed = speed.max(match self.interpolation {
                    Interpolation::Screw => rate.moves(*point).length(),
                    Interpolation::Linear => rate.linear.length() + rate.angular.cross(*point).length(),
                });
            }
        }
        (speed, turn)
    }

    /// How far a body that moves smoothly may get from this path between two poses, in metres; `None` of one pose.
    ///
    /// A motion whose acceleration is at most a deviates by at most a·h²/8 from what joins two of its points that are h seconds
    /// apart at constant velocity (the error of linear interpolation). Going straight, the joined motion lacks the acceleration
    /// v·ω of a body that turns as it goes: v·ω·h²/8. Along a screw that is no error, and what may be lacking is that the
    /// velocities in the body's own axes change from one step to the next: the difference, over the time from the middle of
    /// the one to that of the other, is the acceleration.
    pub fn deviation(&self) -> Option<Deviation> {
        let span = |step: usize| self.times_s[step + 1] - self.times_s[step];
        let of_step = |step: usize| {
            let acceleration = match self.interpolation {
                Interpolation::Linear => self.rate(step).linear.length() * self.rate(step).angular.length(),
                Interpolation::Screw => {
                    let neighbours =
                        [step.checked_sub(1), Some(step + 1).filter(|next| *next < self.steps.len())];
                    let change = |other: usize| {
                        let change = (self.rate(step).linear - self.rate(other).linear).length();
                        change / (0.5 * (span(step) + span(other)))
                    };
                    neighbours.into_iter().flatten().map(change).fold(0.0, f64::max)
                }
            };
            Deviation { most_m: acceleration * span(step) * span(step) / 8.0, after: step }
        };
        (0..self.steps.len()).map(of_step).reduce(|a, b| if b.most_m > a.most_m { b } else { a })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use proptest::prelude::*;

    fn screw(v: [f64; 6]) -> Screw {
        Screw { linear: DVec3::new(v[0], v[1], v[2]) * 20.0, angular: DVec3::new(v[3], v[4], v[5]) }
    }

    proptest! {
        /// The given poses are kept to the bit, the path is continuous, and its velocities are its derivatives.
        #[test]
        fn paths_pass_through_their_poses(
            steps in prop::collection::vec((0.01..1.0_f64, prop::array::uniform6(-1.7..1.7_f64)), 1..6),
            is_linear in any::<bool>(),
            u in 0.001..0.999_f64,
        ) {
            let (mut times, mut poses) = (vec![-0.7], vec![screw([0.3; 6]).exp()]);
            for (span, step) in steps {
                times.push(times[times.len() - 1] + span);
                poses.push(poses[poses.len() - 1] * screw(step).exp());
            }
            let interpolation = if is_linear { Interpolation::Linear } else { Interpolation::Screw };
            let path = Path::new(times.clone(), poses.clone(), interpolation).unwrap();
            for (time, pose) in times.iter().zip(&poses) {
                prop_assert_eq!(path.at(*time), *pose);
            }
            let near = |a: Pose, b: Pose, tolerance: f64| {
                a.translation.abs_diff_eq(b.translation, tolerance * 100.0)
                    && (a.rotation - b.rotation).to_cols_array().iter().all(|e| e.abs() < tolerance)
            };
            for i in 0..poses.len() - 1 {
                let (from, to) = (times[i], times[i + 1]);
                // A moment before or after a pose the body is where its speed, at most 51 m and 3 rad in 0.01 s, takes it.
                let moment = 1e-9 * (to - from);
                prop_assert!(near(path.at(from + moment), poses[i], 1e-8), "{i}");
                prop_assert!(near(path.at(to - moment), poses[i + 1], 1e-8), "{i}");
                // Counted from either end, the middle is the same place.
                let middle = [path.along(i, i, 0.5), path.along(i, i + 1, -0.5)];
                prop_assert!(near(middle[0], middle[1], 1e-13), "{i} {:?}", middle);
                // The central difference of a motion with turns of at most 3 rad a step errs by (3·1e-4)²/6 of the speed.
                let (at, step) = (from + u * (to - from), 1e-4 * (to - from) * u.min(1.0 - u));
                let (before, after) = (path.at(at - step), path.at(at + step));
                let (linear, angular) = path.velocity(at);
                let change = (after.translation - before.translation) / (2.0 * step);
                prop_assert!(change.abs_diff_eq(linear, 1e-6 * linear.length() + 1e-11 / step));
                let turned = Screw::log(before.inverse() * after).angular / (2.0 * step);
                prop_assert!(turned.abs_diff_eq(angular, 1e-6 * angular.length() + 1e-12 / step));
            }
        }

        /// Samples of a constant twist, at any spacing, give it back at every time between them.
        #[test]
        fn a_constant_twist_is_reproduced(
            twist in prop::array::uniform6(-1.0..1.0_f64),
            spans in prop::collection::vec(1e-4..1.5_f64, 1..8),
            u in 0.0..1.0_f64,
        ) {
            let twist = screw(twist);
            let times: Vec<f64> = spans.iter().scan(0.0, |t, span| { *t += span; Some(*t) }).collect();
            let poses = times.iter().map(|time| twist.times(*time).exp()).collect();
            let (first, last) = (times[0], times[times.len() - 1]);
            let path = Path::new(times, poses, Interpolation::Screw).unwrap();
            let time = first + u * (last - first);
            let (pose, truth) = (path.at(time), twist.times(time).exp());
            // At most 35 m/s for 12 s: positions to 420 m, in which an ulp is 6e-14.
            prop_assert!((pose.translation - truth.translation).length() < 1e-12, "{}", (pose.translation - truth.translation).length());
            prop_assert!((pose.rotation - truth.rotation).to_cols_array().iter().all(|e| e.abs() < 1e-14));
        }
    }

    fn drive(h: f64, interpolation: Interpolation) -> Path {
        let twist = Screw { linear: DVec3::new(15.0, 0.0, 0.0), angular: DVec3::new(0.0, 0.0, 0.5) };
        let times: Vec<f64> = (0..=20).map(|i| f64::from(i) * h).collect();
        let poses = times.iter().map(|time| twist.times(*time).exp()).collect();
        Path::new(times, poses, interpolation).unwrap()
    }

    /// 15 m/s and 0.5 rad/s at 10 Hz: going straight between poses is wrong by 9.4 mm, and no more than that.
    #[test]
    fn going_straight_errs_as_the_bound_says() {
        for h in [0.1, 0.01] {
            let (straight, round) = (drive(h, Interpolation::Linear), drive(h, Interpolation::Screw));
            let deviation = straight.deviation().unwrap().most_m;
            // The chord is shorter than the arc by (ωh)²/24.
            assert!((deviation / (15.0 * 0.5 * h * h / 8.0) - 1.0).abs() < 1.1e-4);
            assert!(round.deviation().unwrap().most_m < 1e-12);
            let off = |time: f64| (straight.at(time).translation - round.at(time).translation).length();
            let most = (0..2000).map(|i| off(f64::from(i) * h / 100.0)).fold(0.0, f64::max);
            // The sagitta of an arc is v·ω·h²/8·(1 − (ωh)²/48).
            assert!(most < deviation * 1.0002 && most > deviation * 0.999, "{most} {deviation}");
        }
    }

    /// A body that speeds up steadily: the screw's deviation is a·h²/8, which is also what it is.
    #[test]
    fn speeding_up_deviates_as_told() {
        let (a, h) = (3.0, 0.1);
        let at = |t: f64| DVec3::new(0.5 * a * t * t, 0.0, 0.0);
        let times: Vec<f64> = (0..=10).map(|i| f64::from(i) * h).collect();
        let poses = times.iter().map(|t| Pose { translation: at(*t), ..Pose::IDENTITY }).collect();
        let path = Path::new(times, poses, Interpolation::Screw).unwrap();
        let deviation = path.deviation().unwrap();
        assert!((deviation.most_m - a * h * h / 8.0).abs() < 1e-12);
        let off = |time: f64| (path.at(time).translation - at(time)).length();
        let most = (0..1000).map(|i| off(f64::from(i) * 1e-3)).fold(0.0, f64::max);
        assert!((most - deviation.most_m).abs() < 1e-12, "{most}");
    }

    #[test]
    fn what_is_no_path_is_refused() {
        let new = |times: &[f64], poses: usize| {
            Path::new(times.to_vec(), vec![Pose::IDENTITY; poses], Interpolation::Screw).unwrap_err()
        };
        assert_eq!(new(&[], 0), PathProblem::Empty);
        assert_eq!(new(&[0.0], 2), PathProblem::Counts { times: 1, poses: 2 });
        assert_eq!(new(&[0.0, 1.0, 1.0], 3), PathProblem::Times(2));
        assert_eq!(new(&[f64::NAN], 1), PathProblem::Times(0));
        let far = Pose { translation: DVec3::INFINITY, ..Pose::IDENTITY };
        assert_eq!(Path::new(vec![0.0], vec![far], Interpolation::Screw), Err(PathProblem::NotFinite(0)));
        let one = Path::new(vec![3.0], vec![Pose::IDENTITY], Interpolation::Screw).unwrap();
        assert_eq!((one.at(-1.0), one.at(9.0), one.deviation()), (Pose::IDENTITY, Pose::IDENTITY, None));
    }

    /// Between two poses that look opposite ways, the path is still one of the two turns, and ends where it shall.
    #[test]
    fn half_a_turn_between_poses() {
        let turned = Pose::from_rpy(DVec3::X, Angle::default(), Angle::default(), Angle::deg(180.0));
        let path = Path::new(vec![0.0, 1.0], vec![Pose::IDENTITY, turned], Interpolation::Screw).unwrap();
        let quarter = path.at(0.5);
        assert!(quarter.direction(DVec3::X).abs_diff_eq(DVec3::Y, 1e-15));
        assert_eq!(path.at(1.0), turned);
    }
}
