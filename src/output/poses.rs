//! Where a sensor was, as rows of CSV: one for each frame in a table of the run, and one for each column in a file of the frame.

use glam::DQuat;

use super::format::{Content, EncodeError, Field, FormatSpec, Kind, field};
use super::options::Options;
use super::sensor_frame::SensorFrame;
use crate::frame::Pose;

/// The table of a run that has the pose of each frame's start: its name in the output folder, and its first line.
pub const POSES: (&str, &str) = (
    "poses.csv",
    "frame,sensor,t_s,x_m,y_m,z_m,qx,qy,qz,qw,body_x_m,body_y_m,body_z_m,body_qx,body_qy,body_qz,body_qw",
);

static FIELDS: [Field; 9] = [
    field("line", "integer", "the column of the range image, a camera's row; from 0"),
    field("t_s", "float64", "s on the clock of the trajectory, when the first pulse of the line is cast"),
    field("x_m", "float64", "m, of the sensor in the world"),
    field("y_m", "float64", "m"),
    field("z_m", "float64", "m"),
    field("qx", "float64", "of the unit quaternion that turns the sensor's axes into the world's"),
    field("qy", "float64", ""),
    field("qz", "float64", ""),
    field("qw", "float64", "its real part"),
];

/// The pose of the sensor for each column of a LiDAR's range image, or for each row of a camera's. A line in which no pulse
/// goes out is left out. Drivers that keep a pose a column (Ouster's) have the same table.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "poses",
    ending: "poses.csv",
    about: "the sensor's pose at each column, a camera's at each row",
    content: Content::Lines(&FIELDS),
    read_by: "Python's csv",
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

fn encode(frame: &SensorFrame, _: &Options) -> Result<Vec<u8>, EncodeError> {
    let capture = &frame.capture;
    let (rows, columns) = (capture.rows(), capture.columns());
    let is_camera = capture.sensor.pattern.is_camera();
    let (lines, length) = if is_camera { (rows, columns) } else { (columns, rows) };
    let mut text = FIELDS.map(|field| field.name).join(",") + "\n";
    for line in 0..lines {
        let time_at = |along| {
            let (row, column) = if is_camera { (line, along) } else { (along, line) };
            capture.time_s(row, column)
        };
        let Some(time_s) = (0..length).filter_map(time_at).reduce(f64::min) else { continue };
        let pose = numbers(&capture.world_from_sensor(time_s));
        text += &format!("{line},{},{pose}\n", number(capture.cast_at_s(time_s)));
    }
    Ok(text.into_bytes())
}

/// The row of a frame in the table [`POSES`]: `world_from_sensor` and `world_from_body` at the frame's start, every number with
/// all its digits.
pub fn pose_row(frame: &SensorFrame) -> String {
    let capture = &frame.capture;
    let start_s = capture.cast_at_s(0.0);
    let (sensor, body) = (capture.world_from_sensor(0.0), capture.trajectory.pose_at(start_s));
    format!("{},{},{},{},{}", capture.frame, frame.name, number(start_s), numbers(&sensor), numbers(&body))
}

/// Position and quaternion of a pose.
fn numbers(pose: &Pose) -> String {
    let quaternion = DQuat::from_mat3(&pose.rotation).to_array();
    let all = pose.translation.to_array().into_iter().chain(quaternion);
    all.map(number).collect::<Vec<_>>().join(",")
}

/// The shortest text that is read back as the same number. Adding 0 makes a negative zero positive.
fn number(value: f64) -> String {
    format!("{:?}", value + 0.0)
}
