//! The messages about the body that carries the sensors, in the order of time: its true motion, and its inertial sensor's measurements.

use std::collections::BTreeMap;

use glam::DVec3;

use super::messages::{BodyState, Inertial};
use super::settings::{ImuSettings, Settings};
use crate::motion::Trajectory;
use crate::rng::Rng;

/// The acceleration of gravity in the world, in m/s²: the standard one (3rd CGPM, 1901).
const GRAVITY_M_S2: DVec3 = DVec3::new(0.0, 0.0, -9.80665);

/// Something that is told of the body.
#[derive(Clone, Copy, Debug)]
pub(super) enum Told {
    /// Its true motion.
    State(BodyState),
    /// A measurement of its inertial sensor.
    Inertial(Inertial),
}

/// A body whose motion is told as far as frames have come.
#[derive(Debug)]
pub(super) struct Body {
    trajectory: Trajectory,
    seed: u64,
    /// The times at which the first frame starts and the last one ends so far.
    start_s: f64,
    end_s: f64,
    /// The times at which the motion is to be told, by their stamps.
    waiting: BTreeMap<i64, f64>,
    /// The stamp of the last motion that was told.
    told_ns: Option<i64>,
    /// The number of the next measurement, and the biases that it has.
    next_sample: u64,
    bias: [DVec3; 2],
    /// The number of the next state, if states have a rate of their own.
    next_state: u64,
}

impl Body {
    /// A body of whose frames the first starts at `start_s`.
    pub fn new(trajectory: Trajectory, seed: u64, start_s: f64) -> Self {
        Self {
            trajectory,
            seed,
            start_s,
            end_s: start_s,
            waiting: BTreeMap::new(),
            told_ns: None,
            next_sample: 0,
            bias: [DVec3::ZERO; 2],
            next_state: 0,
        }
    }

    /// Takes note of a frame with the times at which its motion is to be told: of its messages' stamp, its start and its end. The
    /// trajectory is another one only if the job draws it for each frame.
    pub fn frame(&mut self, trajectory: &Trajectory, times_s: [f64; 3], settings: &Settings) {
        self.trajectory = trajectory.clone();
        for time_s in times_s {
            self.end_s = self.end_s.max(time_s);
            let stamp_ns = settings.stamp_ns(time_s);
            if settings.odom_hz == 0.0 && self.told_ns.is_none_or(|told| stamp_ns > told) {
                self.waiting.insert(stamp_ns, time_s);
            }
        }
    }

    /// The next thing that is to be told up to `until_s`, or up to the end of the last frame, in the order of time. Of a state and
    /// a measurement of one moment the state comes first.
    pub fn next(&mut self, until_s: Option<f64>, settings: &Settings) -> Option<Told> {
        let until_ns = settings.stamp_ns(until_s.unwrap_or(self.end_s).min(self.end_s));
        let state = match settings.odom_hz > 0.0 {
            true => self.sample(self.next_state, settings.odom_hz, until_ns, settings),
            false => self.waiting.first_key_value().map(|(stamp_ns, time_s)| (*stamp_ns, *time_s)),
        };
        let state = state.filter(|(stamp_ns, _)| *stamp_ns <= until_ns);
        let measurement = match settings.imu.rate_hz > 0.0 {
            true => self.sample(self.next_sample, settings.imu.rate_hz, until_ns, settings),
            false => None,
        };
        match (state, measurement) {
            (Some((stamp_ns, time_s)), other) if other.is_none_or(|(other_ns, _)| stamp_ns <= other_ns) => {
                self.waiting.remove(&stamp_ns);
                self.next_state += 1;
                self.told_ns = Some(stamp_ns);
                Some(Told::State(self.state(stamp_ns, time_s)))
            }
            (_, Some((stamp_ns, time_s))) => {
                let measured = self.measure(stamp_ns, time_s, &settings.imu);
                self.next_sample += 1;
                Some(Told::Inertial(measured))
            }
            (_, None) => None,
        }
    }

    /// The stamp and the time of sample number `number` of a rate, if it is not after `until_ns`.
    fn sample(&self, number: u64, rate_hz: f64, until_ns: i64, settings: &Settings) -> Option<(i64, f64)> {
        let time_s = self.start_s + number as f64 / rate_hz;
        let stamp_ns = settings.stamp_ns(time_s);
        (stamp_ns <= until_ns).then_some((stamp_ns, time_s))
    }

    /// A time, or the end of the trajectory that has the same stamp: beyond it, by however little, the body would stand.
    fn known(&self, time_s: f64) -> f64 {
        let mut ends = self.trajectory.times().into_iter().flat_map(|(first_s, last_s)| [first_s, last_s]);
        ends.find(|end_s| (time_s - end_s).abs() < 1e-9).unwrap_or(time_s)
    }

    fn state(&self, stamp_ns: i64, time_s: f64) -> BodyState {
        let time_s = self.known(time_s);
        let (pose, velocity) = (self.trajectory.pose_at(time_s), self.trajectory.velocity(time_s));
        let own = |in_world: DVec3| pose.rotation.transpose() * in_world;
        BodyState {
            stamp_ns,
            pose,
            linear_m_s: own(velocity.linear_m_s),
            angular_rad_s: own(velocity.angular_rad_s),
        }
    }

    /// The next measurement: specific force Rᵀ·(a − g) and angular velocity Rᵀ·ω, each with its bias and its white noise.
    ///
    /// Sampled at a rate f, white noise of the density σ has the standard deviation σ·√f, and a bias of the random walk σ_b takes a
    /// step of σ_b/√f between samples (J. L. Crassidis, "Sigma-Point Kalman Filtering for Integrated GPS and Inertial Navigation",
    /// 2006, §III). The first sample has no bias.
    fn measure(&mut self, stamp_ns: i64, time_s: f64, imu: &ImuSettings) -> Inertial {
        let state = self.state(stamp_ns, time_s);
        let acceleration = self.trajectory.acceleration(self.known(time_s));
        let force_m_s2 = state.pose.rotation.transpose() * (acceleration - GRAVITY_M_S2);
        let root = imu.rate_hz.sqrt();
        let mut measured = [state.angular_rad_s, force_m_s2];
        let is_noisy = imu.noise.iter().chain(&imu.walk).any(|density| *density > 0.0);
        if is_noisy {
            let mut rng = Rng::named(self.seed, self.next_sample, "imu");
            let mut normals = || DVec3::from_array([(); 3].map(|()| rng.normal()));
            let densities = imu.noise.into_iter().zip(imu.walk);
            for ((own, bias), (noise, walk)) in measured.iter_mut().zip(&mut self.bias).zip(densities) {
                let (white, step) = (normals(), normals());
                *own += *bias + white * (noise * root);
                *bias += step * (walk / root);
            }
        }
        Inertial {
            stamp_ns,
            pose: state.pose,
            angular_rad_s: measured[0],
            force_m_s2: measured[1],
            variances: imu.noise.map(|density| density * density * imu.rate_hz),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::super::options::Options;
    use super::super::settings::{GYRO_NOISE, GYRO_WALK, IMU_HZ, ODOM_HZ, OPTIONS};
    use super::*;
    use crate::angle::Angle;
    use crate::frame::Pose;
    use crate::motion::{Interpolation, Path};

    fn settings(values: &[(&crate::output::OptionSpec, f64)]) -> Settings {
        let mut options = Options::none(OPTIONS);
        values.iter().for_each(|(option, value)| options.set(option, *value));
        Settings::of(&options)
    }

    /// A body that drives round a circle: 15 m/s and 0.5 rad/s.
    fn circle() -> Trajectory {
        Trajectory::Twist {
            start: Pose::IDENTITY,
            linear_m_s: DVec3::new(15.0, 0.0, 0.0),
            angular_rad_s: DVec3::new(0.0, 0.0, 0.5),
        }
    }

    fn told(trajectory: &Trajectory, settings: &Settings, frames: u32) -> Vec<Told> {
        let mut body = Body::new(trajectory.clone(), 3, 0.0);
        let mut all = Vec::new();
        for frame in 0..frames {
            let [start_s, end_s] = [frame, frame + 1].map(|frame| f64::from(frame) / 10.0);
            body.frame(trajectory, [start_s, start_s, end_s], settings);
            all.extend(std::iter::from_fn(|| body.next(Some(start_s), settings)));
        }
        all.extend(std::iter::from_fn(|| body.next(None, settings)));
        all
    }

    fn measured(told: &[Told]) -> Vec<Inertial> {
        let inertial = |told: &Told| match told {
            Told::Inertial(measured) => Some(*measured),
            Told::State(_) => None,
        };
        told.iter().filter_map(inertial).collect()
    }

    #[test]
    fn a_circle_has_its_centripetal_force_and_gravity() {
        let told = told(&circle(), &settings(&[(&IMU_HZ, 200.0)]), 3);
        let measured = measured(&told);
        // Both ends of 0.3 s are there.
        assert_eq!(measured.len(), 61);
        for (number, one) in (0_i64..).zip(measured) {
            assert_eq!(one.stamp_ns, number * 5_000_000);
            assert!(one.angular_rad_s.abs_diff_eq(DVec3::new(0.0, 0.0, 0.5), 1e-15));
            // v·ω to the left, the weight upwards. Turning there and back costs some ulps of it.
            assert!(one.force_m_s2.abs_diff_eq(DVec3::new(0.0, 7.5, 9.80665), 1e-14), "{}", one.force_m_s2);
        }
        let states: Vec<BodyState> = told
            .iter()
            .filter_map(|told| match told {
                Told::State(state) => Some(*state),
                Told::Inertial(_) => None,
            })
            .collect();
        let stamps: Vec<i64> = states.iter().map(|state| state.stamp_ns).collect();
        assert_eq!(stamps, [0, 100_000_000, 200_000_000, 300_000_000]);
        assert!(states.iter().all(|state| state.linear_m_s.abs_diff_eq(DVec3::new(15.0, 0.0, 0.0), 1e-14)));
        assert_eq!(states[3].pose, circle().pose_at(0.3));
    }

    #[test]
    fn a_standing_body_feels_the_ground_alone() {
        // It lies on its left side, so that its y axis points down.
        let lying = Pose::from_rpy(DVec3::X, Angle::deg(-90.0), Angle::default(), Angle::deg(20.0));
        let told = told(&Trajectory::Fixed(lying), &settings(&[(&IMU_HZ, 50.0)]), 1);
        for one in measured(&told) {
            assert_eq!(one.angular_rad_s, DVec3::ZERO);
            assert!(one.force_m_s2.abs_diff_eq(DVec3::new(0.0, -9.80665, 0.0), 1e-14), "{}", one.force_m_s2);
        }
    }

    #[test]
    fn everything_is_told_once_and_in_the_order_of_time() {
        for odom_hz in [0.0, 37.0] {
            let told = told(&circle(), &settings(&[(&IMU_HZ, 123.0), (&ODOM_HZ, odom_hz)]), 7);
            let stamps: Vec<(i64, bool)> = told
                .iter()
                .map(|told| match told {
                    Told::State(state) => (state.stamp_ns, true),
                    Told::Inertial(measured) => (measured.stamp_ns, false),
                })
                .collect();
            assert!(stamps.windows(2).all(|pair| pair[0].0 <= pair[1].0));
            for is_state in [true, false] {
                let own: Vec<i64> =
                    stamps.iter().filter(|(_, is)| *is == is_state).map(|(ns, _)| *ns).collect();
                assert!(own.windows(2).all(|pair| pair[0] < pair[1]), "{own:?}");
                // floor(0.7 s · rate) samples after the first.
                let expected = match (is_state, odom_hz > 0.0) {
                    (true, false) => 8,
                    (true, true) => 26,
                    (false, _) => 87,
                };
                assert_eq!((own.len(), own[0]), (expected, 0));
            }
        }
    }

    /// White noise of a density σ has the standard deviation σ·√rate, and a random walk σ_b grows to σ_b·√t.
    #[test]
    fn noise_is_as_dense_as_told_and_the_same_each_time() {
        let still = Trajectory::Fixed(Pose::IDENTITY);
        let white = settings(&[(&IMU_HZ, 100.0), (&GYRO_NOISE, 0.02)]);
        let found = measured(&told(&still, &white, 1000));
        assert_eq!(found.len(), 10_001);
        assert!(found.iter().all(|one| one.force_m_s2 == DVec3::new(0.0, 0.0, 9.80665)));
        assert!(found.iter().all(|one| (one.variances[0] - 0.04).abs() < 1e-16 && one.variances[1] == 0.0));
        let numbers: Vec<f64> = found.iter().flat_map(|one| one.angular_rad_s.to_array()).collect();
        let count = numbers.len() as f64;
        let (mean, square) = (
            numbers.iter().sum::<f64>() / count,
            numbers.iter().map(|number| number * number).sum::<f64>() / count,
        );
        // The mean of n numbers of deviation 0.2 deviates by 0.2/√n, their mean square by 0.04·√(2/n): five times that.
        assert!(mean.abs() < 5.0 * 0.2 / count.sqrt(), "{mean}");
        assert!((square - 0.04).abs() < 5.0 * 0.04 * (2.0 / count).sqrt(), "{square}");
        let again = measured(&told(&still, &white, 3));
        assert!(again.iter().zip(&found).all(|(a, b)| a.angular_rad_s == b.angular_rad_s));

        // The steps of a walk of 0.5 deviate by 0.5/√100 = 0.05.
        let walk = settings(&[(&IMU_HZ, 100.0), (&GYRO_WALK, 0.5)]);
        let found = measured(&told(&still, &walk, 1000));
        assert_eq!(found[0].angular_rad_s, DVec3::ZERO);
        let steps = found.windows(2).map(|pair| pair[1].angular_rad_s - pair[0].angular_rad_s);
        let square = steps.map(|step| step.length_squared()).sum::<f64>() / (count - 3.0);
        assert!((square - 0.0025).abs() < 5.0 * 0.0025 * (2.0 / count).sqrt(), "{square}");
    }
    /// A path that ends with the last frame still moves there, although 3·0.1 is more than 0.3.
    #[test]
    fn a_path_moves_up_to_its_end() {
        let poses = [0.0, 0.3].map(|time_s| circle().pose_at(time_s)).to_vec();
        let path = Path::new(vec![0.0, 0.3], poses, Interpolation::Screw).unwrap();
        let path = Trajectory::Path(Arc::new(path));
        let settings = settings(&[(&IMU_HZ, 10.0)]);
        let mut body = Body::new(path.clone(), 0, 0.0);
        body.frame(&path, [0.0, 0.0, 3.0 * 0.1], &settings);
        let told: Vec<Told> = std::iter::from_fn(|| body.next(None, &settings)).collect();
        let Some(Told::State(last)) = told.iter().rfind(|told| matches!(told, Told::State(_))) else {
            panic!("{told:?}")
        };
        // The logarithm of the one pose seen from the other has the twist to some ulps.
        assert!(last.linear_m_s.abs_diff_eq(DVec3::new(15.0, 0.0, 0.0), 1e-12), "{last:?}");
        let measured = measured(&told);
        assert_eq!(measured.len(), 4);
        let force = DVec3::new(0.0, 7.5, 9.80665);
        assert!(measured.iter().all(|one| one.force_m_s2.abs_diff_eq(force, 1e-12)), "{measured:?}");
    }
}
