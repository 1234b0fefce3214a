//! The messages beside clouds, each as CDR.

use glam::{DQuat, DVec3};

use super::cdr::Message;
use super::settings::Depth;
use crate::frame::Pose;
use crate::sensor::{Camera, Lens};

/// Adds a `std_msgs/Header`.
pub(super) fn header(message: &mut Message, stamp_ns: i64, frame_id: &str) {
    const SECOND: i64 = 1_000_000_000;
    message.i32(stamp_ns.div_euclid(SECOND) as i32);
    message.u32(stamp_ns.rem_euclid(SECOND) as u32);
    message.text(frame_id);
}

fn vector(message: &mut Message, v: DVec3) {
    message.f64s(v.to_array());
}

fn quaternion(message: &mut Message, pose: &Pose) {
    message.f64s(DQuat::from_mat3(&pose.rotation).to_array());
}

/// A `geometry_msgs/Pose` or a `geometry_msgs/Transform`.
fn place(message: &mut Message, pose: &Pose) {
    vector(message, pose.translation);
    quaternion(message, pose);
}

/// A pose of one frame in another.
#[derive(Clone, Debug)]
pub(super) struct Transform {
    /// The stamp in nanoseconds.
    pub stamp_ns: i64,
    /// The frame in which the pose is.
    pub parent: String,
    /// The frame whose pose it is.
    pub child: String,
    /// `parent_from_child`.
    pub pose: Pose,
}

/// A `tf2_msgs/TFMessage`.
pub(super) fn transforms(transforms: &[Transform]) -> Vec<u8> {
    let mut message = Message::with_capacity(256 * transforms.len());
    message.length(transforms.len());
    for Transform { stamp_ns, parent, child, pose } in transforms {
        header(&mut message, *stamp_ns, parent);
        message.text(child);
        place(&mut message, pose);
    }
    message.into_bytes()
}

/// The motion of a body at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyState {
    /// The stamp in nanoseconds.
    pub stamp_ns: i64,
    /// `world_from_body`.
    pub pose: Pose,
    /// The velocities along and about the body's own axes, in m/s and rad/s.
    pub linear_m_s: DVec3,
    pub angular_rad_s: DVec3,
}

/// A `nav_msgs/Odometry`. Truth has no variance.
pub(super) fn odometry(state: &BodyState, world: &str, body: &str) -> Vec<u8> {
    let mut message = Message::with_capacity(800);
    header(&mut message, state.stamp_ns, world);
    message.text(body);
    place(&mut message, &state.pose);
    message.f64s([0.0; 36]);
    vector(&mut message, state.linear_m_s);
    vector(&mut message, state.angular_rad_s);
    message.f64s([0.0; 36]);
    message.into_bytes()
}

/// What an inertial sensor measures at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inertial {
    /// The stamp in nanoseconds.
    pub stamp_ns: i64,
    /// `world_from_body`.
    pub pose: Pose,
    /// The angular velocity about the body's axes in rad/s.
    pub angular_rad_s: DVec3,
    /// The specific force along the body's axes in m/s².
    pub force_m_s2: DVec3,
    /// The variances of one measurement of each, by white noise.
    pub variances: [f64; 2],
}

/// A `sensor_msgs/Imu`.
pub(super) fn inertial(measured: &Inertial, body: &str) -> Vec<u8> {
    let diagonal = |variance: f64| (0..9).map(move |i| if i % 4 == 0 { variance } else { 0.0 });
    let mut message = Message::with_capacity(400);
    header(&mut message, measured.stamp_ns, body);
    quaternion(&mut message, &measured.pose);
    message.f64s(diagonal(0.0));
    vector(&mut message, measured.angular_rad_s);
    message.f64s(diagonal(measured.variances[0]));
    vector(&mut message, measured.force_m_s2);
    message.f64s(diagonal(measured.variances[1]));
    message.into_bytes()
}

/// A true object as a detection.
#[derive(Clone, Debug)]
pub(super) struct Detection {
    /// The stamp of the moment of the box, in nanoseconds.
    pub stamp_ns: i64,
    /// The name of its label.
    pub class: String,
    /// Its track, from 1.
    pub track: u32,
    /// The pose of the box's centre: x along the length, y along the width, z along the height.
    pub world_from_box: Pose,
    /// Length, width and height in metres.
    pub size_m: DVec3,
}

/// A `vision_msgs/Detection3DArray` of version 4, as of ROS 2 Humble.
pub(super) fn detections(stamp_ns: i64, world: &str, detections: &[Detection]) -> Vec<u8> {
    let mut message = Message::with_capacity(64 + 640 * detections.len());
    header(&mut message, stamp_ns, world);
    message.length(detections.len());
    for Detection { stamp_ns, class, track, world_from_box, size_m } in detections {
        header(&mut message, *stamp_ns, world);
        // One hypothesis, which is certain.
        message.length(1);
        message.text(class);
        message.f64s([1.0]);
        place(&mut message, world_from_box);
        message.f64s([0.0; 36]);
        place(&mut message, world_from_box);
        vector(&mut message, *size_m);
        message.text(&track.to_string());
    }
    message.into_bytes()
}

/// A `sensor_msgs/Image` of so many rows and columns, whose pixels `write` appends.
pub(super) fn image(
    (stamp_ns, frame_id): (i64, &str),
    (rows, columns): (usize, usize),
    (encoding, bytes_a_pixel): (&str, usize),
    write: impl FnOnce(&mut Vec<u8>),
) -> Vec<u8> {
    let mut message = Message::with_capacity(rows * columns * bytes_a_pixel + 256);
    header(&mut message, stamp_ns, frame_id);
    message.u32(rows as u32);
    message.u32(columns as u32);
    message.text(encoding);
    message.u8(0);
    message.u32((columns * bytes_a_pixel) as u32);
    message.bytes_of(write);
    message.into_bytes()
}

/// An image of depths, which are infinite where nothing came back.
pub(super) fn depth_image(
    of: (i64, &str),
    size: (usize, usize),
    depths_m: &[f32],
    depth: Depth,
) -> Option<Vec<u8>> {
    match depth {
        Depth::None => None,
        Depth::Metres => Some(image(of, size, ("32FC1", 4), |bytes| {
            for depth_m in depths_m {
                let told = if depth_m.is_finite() { *depth_m } else { f32::NAN };
                bytes.extend(told.to_le_bytes());
            }
        })),
        Depth::Millimetres => Some(image(of, size, ("16UC1", 2), |bytes| {
            for depth_m in depths_m {
                bytes.extend(millimetres(*depth_m).unwrap_or(0).to_le_bytes());
            }
        })),
    }
}

/// A depth in whole millimetres. `None` if 16 bits can't hold it, or if there is none.
pub(super) fn millimetres(depth_m: f32) -> Option<u16> {
    let number = (f64::from(depth_m) * 1000.0).round();
    (number >= 1.0 && number <= f64::from(u16::MAX)).then_some(number as u16)
}

/// A `sensor_msgs/CameraInfo`. Its pixels count from the centre of the top left one, so the principal point is half a pixel less
/// than the camera's own.
pub(super) fn camera_info((stamp_ns, frame_id): (i64, &str), camera: &Camera) -> Vec<u8> {
    let ((fx, fy), (cx, cy)) = (camera.focal_px(), camera.principal_px());
    let (cx, cy) = (cx - 0.5, cy - 0.5);
    let (model, coefficients) = distortion(camera.lens());
    let mut message = Message::with_capacity(600);
    header(&mut message, stamp_ns, frame_id);
    message.u32(camera.height() as u32);
    message.u32(camera.width() as u32);
    message.text(model);
    message.length(coefficients.len());
    message.f64s(coefficients);
    message.f64s([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
    message.f64s([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    message.f64s([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
    // No binning, and the region of interest that stands for the whole image.
    (0..6).for_each(|_| message.u32(0));
    message.bool(false);
    message.into_bytes()
}

/// The name of a lens's model in ROS (`sensor_msgs/distortion_models.hpp`) and its coefficients.
fn distortion(lens: &Lens) -> (&'static str, Vec<f64>) {
    let mut coefficients = lens.coefficients();
    match lens {
        Lens::Ideal => ("plumb_bob", vec![0.0; 5]),
        Lens::KannalaBrandt(_) => ("equidistant", coefficients),
        Lens::BrownConrady(_) if coefficients[5..].iter().all(|k| *k == 0.0) => {
            coefficients.truncate(5);
            ("plumb_bob", coefficients)
        }
        Lens::BrownConrady(_) => ("rational_polynomial", coefficients),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{BrownConrady, KannalaBrandt};

    #[test]
    fn stamps_before_0_have_nanoseconds_that_count_upwards() {
        let mut message = Message::with_capacity(0);
        header(&mut message, -40_000, "a");
        let bytes = message.into_bytes();
        assert_eq!(bytes[4..8], (-1_i32).to_le_bytes());
        assert_eq!(bytes[8..12], 999_960_000_u32.to_le_bytes());
    }

    #[test]
    fn millimetres_are_rounded_and_those_that_do_not_fit_are_none() {
        assert_eq!(
            [0.0006, 1.0, 2.0004, 65.535].map(millimetres),
            [Some(1), Some(1000), Some(2000), Some(65535)]
        );
        assert_eq!([0.0004, 65.536, f32::INFINITY, f32::NAN, -1.0].map(millimetres), [None; 5]);
    }

    /// ROS tells a lens by its model's name and by as many coefficients as the model has.
    #[test]
    fn lenses_have_the_model_of_their_formula() {
        let brown = |k4| BrownConrady::new([0.1, 0.01, 1e-3, 2e-3, 3e-3, k4, 0.0, 0.0]).unwrap();
        let fisheye = KannalaBrandt::new([0.1, 0.02, 0.03, 0.04]).unwrap();
        for (lens, name, count) in [
            (Lens::Ideal, "plumb_bob", 5),
            (Lens::BrownConrady(brown(0.0)), "plumb_bob", 5),
            (Lens::BrownConrady(brown(0.2)), "rational_polynomial", 8),
            (Lens::KannalaBrandt(fisheye), "equidistant", 4),
        ] {
            let (model, coefficients) = distortion(&lens);
            assert_eq!((model, coefficients.len()), (name, count));
            let own = lens.coefficients();
            assert!(coefficients.iter().zip(&own).all(|(a, b)| a == b), "{coefficients:?}");
        }
    }
}
