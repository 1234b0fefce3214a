//! Rigid motion over time: where the body that carries the sensors is at each moment.

use glam::{DMat3, DVec3};

use crate::frame::Pose;

/// The pose `world_from_body` as a function of time, in seconds from the job's own zero.
#[derive(Clone, Debug, PartialEq)]
pub enum Trajectory {
    /// The body stands still.
    Fixed(Pose),
    /// The body moves with constant velocities, both given in its own frame: a screw motion from `start`.
    Twist {
        /// `world_from_body` at time 0.
        start: Pose,
        /// Linear velocity of the body's origin, in metres a second along the body's own axes.
        linear_m_s: DVec3,
        /// Angular velocity, in radians a second about the body's own axes.
        angular_rad_s: DVec3,
    },
}

/// The trajectory of a body that stays at the world's origin.
pub static AT_ORIGIN: Trajectory = Trajectory::Fixed(Pose::IDENTITY);

impl Trajectory {
    /// `world_from_body` at `time_s`.
    pub fn pose_at(&self, time_s: f64) -> Pose {
        match self {
            Self::Fixed(pose) => *pose,
            Self::Twist { start, linear_m_s, angular_rad_s } => {
                *start * twisted(*linear_m_s * time_s, *angular_rad_s * time_s)
            }
        }
    }

    /// The one pose of a body that stands still; `None` of a body that moves.
    pub fn fixed_pose(&self) -> Option<Pose> {
        match self {
            Self::Fixed(pose) => Some(*pose),
            Self::Twist { .. } => None,
        }
    }
}

/// The exponential of a twist: the pose that is reached from the identity by moving along `linear` and turning about
/// `angular` (radians) at the same time, both constant in the moving frame.
///
/// With θ = |angular| and K = the cross product matrix of `angular`, the rotation is I + A·K + B·K² and the translation is
/// (I + B·K + C·K²)·linear, where A = sin θ/θ, B = (1 − cos θ)/θ², C = (θ − sin θ)/θ³ (R. M. Murray, Z. Li, S. S. Sastry,
/// "A Mathematical Introduction to Robotic Manipulation", 1994, §2.3).
fn twisted(linear: DVec3, angular: DVec3) -> Pose {
    let squared = angular.length_squared();
    let angle = squared.sqrt();
    // Below this angle the closed forms of B and C lose digits to cancellation. The series' first term that is left out,
    // θ⁶/9! of C relative to 1/6, is 2e-17 there.
    const SMALL: f64 = 0.01;
    let (a, b, c) = if angle < SMALL {
        (
            1.0 - squared / 6.0 * (1.0 - squared / 20.0 * (1.0 - squared / 42.0)),
            0.5 - squared / 24.0 * (1.0 - squared / 30.0 * (1.0 - squared / 56.0)),
            1.0 / 6.0 - squared / 120.0 * (1.0 - squared / 42.0 * (1.0 - squared / 72.0)),
        )
    } else {
        let sine = libm::sin(angle);
        let half_sine = libm::sin(0.5 * angle);
        (sine / angle, 2.0 * half_sine * half_sine / squared, (angle - sine) / (squared * angle))
    };
    let cross = DMat3::from_cols(
        DVec3::new(0.0, angular.z, -angular.y),
        DVec3::new(-angular.z, 0.0, angular.x),
        DVec3::new(angular.y, -angular.x, 0.0),
    );
    let cross_squared = cross * cross;
    let rotation = DMat3::IDENTITY + cross * a + cross_squared * b;
    let translation = linear + cross * linear * b + cross_squared * linear * c;
    Pose { rotation, translation }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;

    fn twist(linear: [f64; 3], angular: [f64; 3]) -> Trajectory {
        Trajectory::Twist { start: Pose::IDENTITY, linear_m_s: linear.into(), angular_rad_s: angular.into() }
    }

    /// Driving forward while turning left is a circle of radius v/ω.
    #[test]
    fn a_constant_turn_is_a_circle() {
        let (speed, rate) = (15.0, 0.5);
        let trajectory = twist([speed, 0.0, 0.0], [0.0, 0.0, rate]);
        for time in [-3.0, 0.0, 1e-6, 0.019, 0.021, 0.1, 2.0, 40.0] {
            let pose = trajectory.pose_at(time);
            let (sin, cos) = libm::sincos(rate * time);
            let expected = DVec3::new(speed / rate * sin, speed / rate * (1.0 - cos), 0.0);
            // 1 − cos loses digits here, by up to an ulp of 1, times the radius.
            assert!(pose.translation.abs_diff_eq(expected, 1e-13 * (1.0 + speed * time.abs())), "{time}");
            let yaw =
                Pose::from_rpy(DVec3::ZERO, Angle::default(), Angle::default(), Angle::rad(rate * time));
            assert!((pose.rotation - yaw.rotation).to_cols_array().iter().all(|e| e.abs() < 1e-15), "{time}");
        }
    }

    /// Moving for a time and again for the same time is moving for twice the time, at small angles and large ones.
    #[test]
    fn motions_follow_each_other() {
        let trajectory = twist([3.0, -2.0, 0.5], [0.3, -0.2, 0.9]);
        for time in [1e-5, 5e-3, 0.0101, 0.3, 2.5] {
            let (once, twice) = (trajectory.pose_at(time), trajectory.pose_at(2.0 * time));
            let product = once * once;
            assert!(product.translation.abs_diff_eq(twice.translation, 1e-14 * (1.0 + time)), "{time}");
            let off = product.rotation - twice.rotation;
            assert!(off.to_cols_array().iter().all(|e| e.abs() < 1e-15 * (1.0 + time) * 4.0), "{time}");
        }
    }

    #[test]
    fn a_body_without_rotation_goes_straight_and_a_fixed_one_stays() {
        let straight = twist([3.0, -2.0, 0.5], [0.0; 3]).pose_at(2.0);
        assert_eq!(straight, Pose { translation: DVec3::new(6.0, -4.0, 1.0), ..Pose::IDENTITY });
        let pose = Pose { translation: DVec3::new(1.0, 2.0, 3.0), ..Pose::IDENTITY };
        assert_eq!(Trajectory::Fixed(pose).pose_at(7.0), pose);
        assert_eq!(Trajectory::Fixed(pose).fixed_pose(), Some(pose));
        assert_eq!(twist([1.0, 0.0, 0.0], [0.0; 3]).fixed_pose(), None);
    }
}
