//! Screw motions: a rigid motion with constant velocities in its own frame, and the way back from a rigid motion to it.

use glam::{DMat3, DQuat, DVec3};

use crate::frame::Pose;

/// A displacement along a screw, in the axes of the frame that moves: metres along it, and radians about it, both done at the
/// same time. Per second, it is a twist.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Screw {
    pub linear: DVec3,
    pub angular: DVec3,
}

impl Screw {
    pub fn times(self, factor: f64) -> Self {
        Self { linear: self.linear * factor, angular: self.angular * factor }
    }

    /// How far, and which way, a point that is given in the moving frame goes, to first order. Along the whole of a screw motion
    /// the length of it stays the same.
    pub fn moves(self, point: DVec3) -> DVec3 {
        self.linear + self.angular.cross(point)
    }

    /// The exponential: the pose that is reached from the identity.
    ///
    /// With θ = |angular| and K = the cross product matrix of `angular`, the rotation is I + A·K + B·K² and the translation is
    /// (I + B·K + C·K²)·linear, where A = sin θ/θ, B = (1 − cos θ)/θ², C = (θ − sin θ)/θ³ (R. M. Murray, Z. Li, S. S. Sastry,
    /// "A Mathematical Introduction to Robotic Manipulation", 1994, §2.3).
    pub fn exp(self) -> Pose {
        let squared = self.angular.length_squared();
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
        let cross = cross_matrix(self.angular);
        let cross_squared = cross * cross;
        let rotation = DMat3::IDENTITY + cross * a + cross_squared * b;
        let translation = self.linear + cross * self.linear * b + cross_squared * self.linear * c;
        Pose { rotation, translation }
    }

    /// The logarithm: the screw that reaches `pose` from the identity, with a turn of at most π. Of the two that turn by π
    /// exactly, it is the one whose axis has its largest coordinate positive.
    ///
    /// The rotation vector is that of the unit quaternion (v, w): 2·atan2(|v|, w) along v, which loses digits neither for small
    /// turns nor near π. The linear part is V⁻¹ times the translation, V⁻¹ = I − K/2 + D·K², D = (1 − (θ/2)·cot(θ/2))/θ²
    /// (ibidem, appendix A).
    pub fn log(pose: Pose) -> Self {
        let mut q = DQuat::from_mat3(&pose.rotation).normalize();
        if q.w < 0.0 {
            q = -q;
        }
        let v = q.xyz();
        let sine = v.length();
        let angular = v * if sine > 0.0 { 2.0 * libm::atan2(sine, q.w) / sine } else { 2.0 };
        let squared = angular.length_squared();
        // The first term that the series leaves out, θ⁸/47,900,160 relative to 1/12, is 3e-15 there, and D is multiplied by
        // θ² = 0.01.
        const SMALL: f64 = 0.1;
        let d = if squared < SMALL * SMALL {
            1.0 / 12.0 + squared / 720.0 * (1.0 + squared / 42.0 * (1.0 + squared / 40.0))
        } else {
            let half = 0.5 * squared.sqrt();
            (1.0 - half * libm::cos(half) / libm::sin(half)) / squared
        };
        let once = angular.cross(pose.translation);
        let linear = pose.translation - 0.5 * once + d * angular.cross(once);
        Self { linear, angular }
    }
}

/// The matrix that multiplies by the cross product with `v` from the left.
pub(super) fn cross_matrix(v: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, v.z, -v.y), DVec3::new(-v.z, 0.0, v.x), DVec3::new(v.y, -v.x, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn vector(most: f64) -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-most..most).prop_map(DVec3::from)
    }

    proptest! {
        /// The logarithm undoes the exponential up to half a turn, from turns of 1e-12 radians on.
        #[test]
        fn log_undoes_exp(linear in vector(100.0), axis in vector(1.0), exponent in -12.0..0.0_f64, near_pi in any::<bool>()) {
            let Some(axis) = axis.try_normalize() else { return Ok(()) };
            let small = libm::pow(10.0, exponent);
            let angle = if near_pi { PI - small } else { PI * small };
            let screw = Screw { linear, angular: axis * angle };
            let back = Screw::log(screw.exp());
            // A rotation of 1e-16 more turns the translation by as much. Near half a turn, θ/2·cot(θ/2) and the axis follow from
            // a quaternion whose error is an ulp of 1.
            let error = (back.angular - screw.angular).length();
            prop_assert!(error < 4e-15, "{screw:?} {back:?}");
            prop_assert!((back.linear - linear).length() < 100.0 * 2e-14, "{screw:?} {back:?}");
            let pose = back.exp();
            let again = screw.exp();
            prop_assert!(pose.translation.abs_diff_eq(again.translation, 1e-12));
        }
    }

    #[test]
    fn half_turns_and_none() {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.0, 0.8)] {
            let half = DMat3::from_quat(DQuat::from_xyzw(axis.x, axis.y, axis.z, 0.0));
            let pose = Pose { rotation: half, translation: DVec3::new(1.0, 2.0, 3.0) };
            let screw = Screw::log(pose);
            assert!((screw.angular.length() - PI).abs() < 1e-15);
            assert!(screw.angular.dot(axis) > 3.0);
            assert!(screw.exp().translation.abs_diff_eq(pose.translation, 1e-14));
        }
        let straight = Pose { translation: DVec3::new(1.0, 2.0, 3.0), ..Pose::IDENTITY };
        assert_eq!(Screw::log(straight), Screw { linear: straight.translation, angular: DVec3::ZERO });
    }
}
