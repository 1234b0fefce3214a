//! Quaternions of files as rotations.

use glam::DQuat;

use super::fault::Fault;
use super::notices::Notices;

/// The largest deviation of a quaternion's length from 1 that causes no warning. The four components of a quaternion in 8-bit
/// integers are each off by at most 1/254, so its length is off by at most √4 / 254 = 0.008.
pub(super) const QUATERNION_TOLERANCE: f64 = 0.01;

/// The quaternion, normalised. One of zeros is no rotation.
pub(super) fn unit(xyzw: [f64; 4], place: &impl Fn() -> String, notices: &Notices) -> Result<DQuat, Fault> {
    let q = DQuat::from_array(xyzw);
    let length = q.length();
    if xyzw == [0.0; 4] {
        notices.warn(place, "its quaternion is zero, and read as no rotation");
        return Ok(DQuat::IDENTITY);
    }
    if !(length.is_finite() && length > 0.0) {
        let problem = format!("its rotation {xyzw:?} is no rotation");
        return Err(Fault::new("", problem).help("a quaternion [x, y, z, w] of length 1"));
    }
    if (length - 1.0).abs() > QUATERNION_TOLERANCE {
        notices.warn(place, "the length of its quaternion is not 1; it was normalised");
    }
    Ok(normalised(q))
}

/// The quaternion of length 1. One that has that length, such as [0, 0, 0, 1], stays exact.
pub(super) fn normalised(rotation: DQuat) -> DQuat {
    let length = rotation.length();
    if length == 1.0 { rotation } else { rotation / length }
}
