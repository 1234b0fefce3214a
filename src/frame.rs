//! Coordinate frames and the rigid motions between them.
//!
//! - **World**: right-handed, z up, metres.
//! - **Body** and **sensor**: x forward, y left, z up (ROS REP-103). Azimuth is counted from +x toward +y, elevation from
//!   the xy plane toward +z.
//! - **Optical** (of a camera): x right, y down, z forward.
//!
//! A pose is named `target_from_source`, so that adjacent names match in a product:
//! `world_from_sensor = world_from_body * body_from_sensor`.

use std::ops::Mul;

use glam::{DMat3, DVec3};

use crate::angle::Angle;

/// A rigid motion `target_from_source`: a rotation, then a translation in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rotation from the source's axes to the target's. Orthonormal, determinant +1.
    pub rotation: DMat3,
    /// Position of the source's origin in the target frame, in metres.
    pub translation: DVec3,
}

impl Pose {
    /// The frame itself.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// A pose from roll, pitch and yaw: intrinsic rotations about z, then y, then x, so that R =
    /// Rz(yaw)·Ry(pitch)·Rx(roll).
    ///
    /// A positive pitch points the nose (+x) down, as in REP-103.
    pub fn from_rpy(translation: DVec3, roll: Angle, pitch: Angle, yaw: Angle) -> Self {
        let (sr, cr) = roll.sin_cos();
        let (sp, cp) = pitch.sin_cos();
        let (sy, cy) = yaw.sin_cos();
        let rotation = DMat3::from_cols(
            DVec3::new(cy * cp, sy * cp, -sp),
            DVec3::new(cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
            DVec3::new(cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
        );
        Self { rotation, translation }
    }

    /// A pose from a quaternion (x, y, z, w), which is normalised here. `None` if its length is zero or not finite.
    pub fn from_quaternion(translation: DVec3, xyzw: [f64; 4]) -> Option<Self> {
        let q = glam::DQuat::from_array(xyzw);
        let length = q.length();
        if !(length.is_finite() && length > 0.0) {
            return None;
        }
        Some(Self { rotation: DMat3::from_quat(q / length), translation })
    }

    /// Transforms a point from the source frame to the target frame.
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.rotation * p + self.translation
    }

    /// Transforms a direction from the source frame to the target frame. Only the rotation applies.
    pub fn direction(&self, d: DVec3) -> DVec3 {
        self.rotation * d
    }

    /// The inverse motion, `source_from_target`.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }
}

impl Mul for Pose {
    type Output = Self;
    /// The product `a_from_b * b_from_c` is `a_from_c`.
    fn mul(self, other: Self) -> Self {
        Self { rotation: self.rotation * other.rotation, translation: self.point(other.translation) }
    }
}

/// The pose of a camera's optical frame (x right, y down, z forward) in its body frame (x forward, y left, z up).
pub const BODY_FROM_OPTICAL: Pose =
    Pose { rotation: DMat3::from_cols(DVec3::NEG_Y, DVec3::NEG_Z, DVec3::X), translation: DVec3::ZERO };

/// The axis of a glTF file that points up in the world in which beams are cast.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// glTF's y becomes the world's z: (x, y, z)_world = (x, −z, y)_glTF, as Blender and Cesium do.
    #[default]
    Z,
    /// glTF's own axes are kept.
    Y,
}

impl UpAxis {
    /// The rotation `world_from_gltf`. It is exact, because it only swaps and negates coordinates.
    pub fn world_from_gltf(self) -> DMat3 {
        match self {
            UpAxis::Z => DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
            UpAxis::Y => DMat3::IDENTITY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gltf_y_up_becomes_z_up() {
        let v = UpAxis::Z.world_from_gltf() * DVec3::new(1.0, 2.0, 3.0);
        assert_eq!(v, DVec3::new(1.0, -3.0, 2.0));
        assert_eq!(UpAxis::Z.world_from_gltf().determinant(), 1.0);
    }

    #[test]
    fn rpy_is_yaw_then_pitch_then_roll() {
        let (r, p, y) = (Angle::deg(20.0), Angle::deg(-35.0), Angle::deg(110.0));
        let zero = Angle::default();
        let at = |r, p, y| Pose::from_rpy(DVec3::ZERO, r, p, y);
        let product = at(zero, zero, y) * at(zero, p, zero) * at(r, zero, zero);
        let whole = at(r, p, y);
        assert!((product.rotation - whole.rotation).to_cols_array().iter().all(|e| e.abs() < 1e-15));
        // The signs: yaw turns forward to the left, a positive pitch turns forward down, a positive roll lowers the right.
        let quarter = Angle::deg(90.0);
        assert!(at(zero, zero, quarter).direction(DVec3::X).abs_diff_eq(DVec3::Y, 1e-15));
        assert!(at(zero, quarter, zero).direction(DVec3::X).abs_diff_eq(DVec3::NEG_Z, 1e-15));
        assert!(at(quarter, zero, zero).direction(DVec3::Y).abs_diff_eq(DVec3::Z, 1e-15));
    }

    #[test]
    fn quaternion_and_rpy_agree() {
        let yaw = Angle::deg(30.0);
        let (s, c) = Angle::deg(15.0).sin_cos();
        // The quaternion is three times too long, so it has to be normalised.
        let q = Pose::from_quaternion(DVec3::ONE, [0.0, 0.0, 3.0 * s, 3.0 * c]).unwrap();
        let e = Pose::from_rpy(DVec3::ONE, Angle::default(), Angle::default(), yaw);
        assert!((q.rotation - e.rotation).to_cols_array().iter().all(|x| x.abs() < 1e-15));
        assert_eq!(Pose::from_quaternion(DVec3::ZERO, [0.0; 4]), None);
    }

    #[test]
    fn inverse_undoes() {
        let pose =
            Pose::from_rpy(DVec3::new(1.0, -2.0, 3.0), Angle::deg(5.0), Angle::deg(6.0), Angle::deg(7.0));
        let p = DVec3::new(0.3, 0.2, -0.1);
        assert!((pose.inverse() * pose).point(p).abs_diff_eq(p, 1e-15));
    }

    #[test]
    fn optical_axes() {
        assert_eq!(BODY_FROM_OPTICAL.direction(DVec3::Z), DVec3::X);
        assert_eq!(BODY_FROM_OPTICAL.direction(DVec3::X), DVec3::NEG_Y);
        assert_eq!(BODY_FROM_OPTICAL.direction(DVec3::Y), DVec3::NEG_Z);
        assert_eq!(BODY_FROM_OPTICAL.rotation.determinant(), 1.0);
    }
}
