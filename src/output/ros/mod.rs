//! ROS 2 bags: a run as a folder that rosbag2 plays, with one MCAP of the profile `ros2`.
//!
//! ```text
//! cdr        the encoding of messages
//! schemas    the types of messages, with their definitions
//! mcap       the container; zstd: its compression; metadata: the file beside it, by which rosbag2 knows it
//! layouts    the layouts of points
//! settings   the options
//! messages   transforms, motion, inertial measurements, images
//! clouds     clouds of points
//! body       what is told of the body, in the order of time
//! bag        the messages in their order
//! ```

mod bag;
mod body;
mod cdr;
mod clouds;
mod layouts;
mod mcap;
mod messages;
mod metadata;
mod schemas;
mod settings;
mod zstd;

use super::format::{Content, EncodeError, FormatSpec, Kind};
use super::options::Options;
use crate::sensor::{Limited, Sensor};
use layouts::tables;
use settings::{Depth, OPTIONS, Settings};

/// The files of a run.
const FILES: [&str; 2] = ["bag/bag_0.mcap", "bag/metadata.yaml"];

/// A bag with the clouds of LiDARs, the images of depth cameras, the true motion of the body, and its inertial sensor.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "mcap",
    ending: "mcap",
    about: "ROS 2 bags of a whole run: a folder with an MCAP, for SLAM",
    content: Content::Messages(page),
    read_by: "rosbags, mcap with mcap-ros2-support",
    options: OPTIONS,
    check_options: settings::check,
    check,
    loses,
    most_label: |options| if Settings::of(options).labels { u16::MAX.into() } else { u32::MAX },
    // The message, the chunk that holds it, which grows by doubling, and what is compressed; the order of the pixels.
    encoding_bytes_a_ray: |sensor, options| 4 * file_bytes_a_ray(sensor, options) + 24,
    file_bytes_a_ray,
    stream_files: &FILES,
    kind: Kind::Stream(|_, options| Box::new(bag::Bag::new(options, "bag_0.mcap"))),
    ..FormatSpec::PLAIN
};

fn check(sensor: &Sensor, options: &Options) -> Result<(), EncodeError> {
    match sensor.pattern.is_camera() {
        true => Ok(()),
        false => clouds::check(sensor, &Settings::of(options)),
    }
}

fn loses(sensor: &Sensor, options: &Options) -> Option<String> {
    let settings = Settings::of(options);
    if !sensor.pattern.is_camera() {
        let loses_returns = settings.organised && sensor.most_returns() > 1;
        return loses_returns.then(|| {
            "an organised cloud has the first return of each pixel alone: without `organised` it has all"
                .to_owned()
        });
    }
    // A depth is at most the range.
    let far_m = sensor.range.max_m;
    let most_m = f64::from(u16::MAX) / 1000.0;
    if settings.depth != Depth::Millimetres || far_m <= most_m {
        return None;
    }
    let what = if sensor.range.of == Limited::Depth { "depths" } else { "depths along the axis" };
    let sees = if far_m.is_finite() { format!("up to {far_m} m") } else { "without a limit".to_owned() };
    Some(format!(
        "it sees {sees}, and {what} above {most_m} m are written as 0, as if nothing were there: depth = \"32FC1\" holds all of \
         them"
    ))
}

fn file_bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    let settings = Settings::of(options);
    if sensor.pattern.is_camera() {
        let of_depth = match settings.depth {
            Depth::Metres => 4,
            Depth::Millimetres => 2,
            Depth::None => 0,
        };
        return of_depth + if settings.labels { 2 } else { 0 };
    }
    let returns = if settings.organised { 1 } else { sensor.most_returns() as u64 };
    settings.layout.map_or(20, |layout| layout.step as u64) * returns
}

/// The part of the page of formats.
fn page() -> String {
    format!("{}{}", PAGE, tables())
}

const PAGE: &str = "\
A run is one bag, the folder `bag`, which `ros2 bag play` takes; `bag/bag_0.mcap` has the profile `ros2`, embedded definitions
of the messages, chunks and an index. The job's time 0 has the stamp `start_stamp_s`, and no clock is read. All frames go into one
file, so such a run can be neither parted nor resumed.

| topic | type | |
|---|---|---|
| `/SENSOR/points` | `sensor_msgs/PointCloud2` | of a LiDAR, in one of the layouts below, or `livox_ros_driver2/CustomMsg` |
| `/SENSOR/depth`, `/SENSOR/labels` | `sensor_msgs/Image` | of a camera; depth along the axis, and labels if asked for |
| `/SENSOR/camera_info` | `sensor_msgs/CameraInfo` | the same stamps; none of a camera with parallel rays |
| `/tf_static` | `tf2_msgs/TFMessage` | the sensors on the body, and the optical frames of cameras |
| `/tf` | `tf2_msgs/TFMessage` | the body's true pose in the world |
| `/odom` | `nav_msgs/Odometry` | the body's true pose and, along its own axes, its velocities; truth has no variance |
| `/SENSOR/boxes` | `vision_msgs/Detection3DArray` | with `truth.boxes`: the objects in the world, each at its box's own time; the class is the label's name, the id the track |
| `/imu/data` | `sensor_msgs/Imu` | at the body's origin, if `imu_hz` is given: true attitude, angular velocity, specific force |

A frame's stamp is its start, or its first pulse if a beam fires before its column's time, or the time that `cloud_time` compensates
the points to; times of points count from it. Messages are logged at the start of their frame. Intensities are 0 to 255: those of
sensors with a maker's scale as they are, others times 255, and no more than 255. Depth that nothing came back from is NaN or 0.

A standing inertial sensor measures 9.80665 m/s² upwards. Its noise is drawn by the number of the measurement, so that it is the
same whatever else a run has. The biases of a random walk begin at 0.

`info`, `view`, `diff` and `convert` read PointCloud2, CustomMsg and depth images, of bags of others, too: the messages of a topic count
from 0, in the order of the file.

LIO-SAM takes the layout `velodyne` with `imu_hz = 200` or more, FAST-LIO's `lidar_type: 2` the layout `fast_lio` with the unit
that its `timestamp_unit` says. With `tf = false` either can publish its own pose of the body.

```sh
ros2 bag play out/bag                                  # with rosbag2's plug-in for MCAP
kiss_icp_pipeline out/bag --topic /top/points          # without ROS
```
";
