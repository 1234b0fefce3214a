//! What is told of the body that carries the sensors, in the order of time: its true motion, and its inertial sensor's measurements.

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
    next: u64,
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
            next: 0,
            bias: [DVec3::ZERO; 2],
            next_state: 0,
        }
    }

    /// Takes note of a frame with the times at which its motion is to be told: of its messages' stamp, its start and its end.
    pub fn frame(&mut self, times_s: [f64; 3], settings: &Settings) {
        for time_s in times_s {
            self.end_s = self.end_s.max(time_s);
            let stamp_ns = settings.stamp_ns(time_s);
            if settings.odom_hz == 0.0 && self.told_ns.is_none_or(|told| stamp_ns > told) {
                self.waiting.insert(stamp_ns, time_s);
            }
        }
    }

    /// What is to be told up to `until_s`, or up to the end of the last frame, in the order of time.
    pub fn told(&mut self, until_s: Option<f64>, settings: &Settings) -> Vec<Told> {
        let until_s = until_s.unwrap_or(self.end_s).min(self.end_s);
        let until_ns = settings.stamp_ns(until_s);
        if settings.odom_hz > 0.0 {
            while let Some((stamp_ns, time_s)) =
                self.sample(self.next_state, settings.odom_hz, until_ns, settings)
            {
                self.waiting.insert(stamp_ns, time_s);
                self.next_state += 1;
            }
        }
        let mut told: Vec<(i64, Told)> = Vec::new();
        while let Some(entry) = self.waiting.first_entry().filter(|entry| *entry.key() <= until_ns) {
            let (stamp_ns, time_s) = entry.remove_entry();
            self.told_ns = Some(stamp_ns);
            told.push((stamp_ns, Told::State(self.state(stamp_ns, time_s))));
        }
        if settings.imu.rate_hz > 0.0 {
            while let Some((stamp_ns, time_s)) =
                self.sample(self.next, settings.imu.rate_hz, until_ns, settings)
            {
                let measured = self.measure(stamp_ns, time_s, &settings.imu);
                told.push((stamp_ns, Told::Inertial(measured)));
                self.next += 1;
            }
        }
        // The order of states and measurements of one moment stays.
        told.sort_by_key(|(stamp_ns, _)| *stamp_ns);
        told.into_iter().map(|(_, told)| told).collect()
    }

    /// The stamp and the time of sample number `number` of a rate, if it is not after `until_ns`.
    fn sample(&self, number: u64, rate_hz: f64, until_ns: i64, settings: &Settings) -> Option<(i64, f64)> {
        let time_s = self.start_s + number as f64 / rate_hz;
        let stamp_ns = settings.stamp_ns(time_s);
        (stamp_ns <= until_ns).then_some((stamp_ns, time_s))
    }

    fn state(&self, stamp_ns: i64, time_s: f64) -> BodyState {
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
        let acceleration = self.trajectory.acceleration(time_s);
        let force_m_s2 = state.pose.rotation.transpose() * (acceleration - GRAVITY_M_S2);
        let root = imu.rate_hz.sqrt();
        let mut measured = [state.angular_rad_s, force_m_s2];
        let is_noisy = imu.noise.iter().chain(&imu.walk).any(|density| *density > 0.0);
        if is_noisy {
            let mut rng = Rng::named(self.seed, self.next, "imu");
            let mut normals = || DVec3::from_array([(); 3].map(|()| rng.normal()));
            for quantity in 0..2 {
                let (white, step) = (normals(), normals());
                measured[quantity] += self.bias[quantity] + white * (imu.noise[quantity] * root);
                self.bias[quantity] += step * (imu.walk[quantity] / root);
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
