//! The keys of poses.

use super::super::kinds::{Choice, Matrix, Text, Vector};
use super::super::table::{Key, TableKeys, key, table};

/// The axes of the source of a pose, and which way it leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Convention {
    /// From the body's or sensor's frame: x forward, y left, z up.
    Body,
    /// To a camera's frame: x right, y down, z forward.
    OpenCv,
    /// From a camera's frame: x right, y up, z backwards.
    OpenGl,
}

pub(crate) static POSE_KEYS: TableKeys =
    table("`pose`", &[&POSITION, &RPY, &QUATERNION, &LOOK_AT, &UPWARD, &MATRIX, &CONVENTION, &CAMERA]);
pub(crate) static POSITION: Key<Vector<3>> =
    key("position_m", Vector("x, y, z"), "x (forward), y (left), z (up) in metres.")
        .or("[0.0, 0.0, 0.0]")
        .replaces(&["matrix", "camera"]);
pub(crate) static RPY: Key<Vector<3>> = key(
    "rpy_deg",
    Vector("roll, pitch, yaw"),
    "Roll, pitch, yaw in degrees: R = Rz(yaw) Ry(pitch) Rx(roll); a positive pitch looks down.",
)
.or("[0.0, 0.0, 0.0]")
.replaces(&["quaternion_xyzw", "look_at_m", "up", "matrix", "camera"]);
pub(crate) static QUATERNION: Key<Vector<4>> =
    key("quaternion_xyzw", Vector("x, y, z, w"), "The rotation as a unit quaternion, instead of rpy_deg.")
        .replaces(&["rpy_deg", "look_at_m", "up", "matrix", "camera"]);
pub(crate) static LOOK_AT: Key<Vector<3>> =
    key("look_at_m", Vector("x, y, z"), "The point that the x axis points at, instead of a rotation.")
        .replaces(&["rpy_deg", "quaternion_xyzw", "matrix", "camera"]);
pub(crate) static UPWARD: Key<Vector<3>> =
    key("up", Vector("x, y, z"), "With look_at_m, the direction that is above.").or("[0.0, 0.0, 1.0]");
pub(crate) static MATRIX: Key<Matrix> = key(
    "matrix",
    Matrix,
    "Rotation and position as a rigid 4 × 4 matrix, row by row, whose last column has the position in metres; instead of all of these.",
)
.replaces(&["position_m", "rpy_deg", "quaternion_xyzw", "look_at_m", "up", "camera"]);
pub(crate) static CONVENTION: Key<Choice<Convention>> = key(
    "convention",
    Choice(&[("body", Convention::Body), ("opencv", Convention::OpenCv), ("opengl", Convention::OpenGl)]),
    "The pose that is given: \"body\" is world_from_body with x forward, y left, z up; \"opencv\" is camera_from_world, x right, y down, z forward; \"opengl\" is world_from_camera, x right, y up, z backwards.",
)
.or("\"body\"");
pub(crate) static CAMERA: Key<Text> = key(
    "camera",
    Text,
    "The pose of the scene's camera of this name, instead of all others; of a sensor, if the job has no [trajectory].",
)
.replaces(&["position_m", "rpy_deg", "quaternion_xyzw", "look_at_m", "up", "matrix", "convention"]);
