//! A job's settings of its bag: the options and their values.

use super::super::format::EncodeError;
use super::super::options::{OptionSpec, OptionValues, Options};
use super::layouts::{LAYOUTS, Layout};
use super::mcap::Compression;

/// All options.
pub(super) const OPTIONS: &[OptionSpec] = &[
    LAYOUT,
    TIME_UNIT,
    ORGANISED,
    DEPTH,
    LABELS,
    START_STAMP,
    POINTS_TOPIC,
    IMAGE_TOPIC,
    BOXES_TOPIC,
    ODOM_TOPIC,
    IMU_TOPIC,
    WORLD_FRAME,
    BODY_FRAME,
    SENSOR_FRAME,
    TF,
    ODOM_HZ,
    IMU_HZ,
    GYRO_NOISE,
    ACCEL_NOISE,
    GYRO_WALK,
    ACCEL_WALK,
    COMPRESSION,
];

pub(super) const LAYOUT: OptionSpec = OptionSpec {
    name: "layout",
    about: "The fields of the points of LiDARs, as a driver or a program has them. `livox_custom` are messages of Livox's own \
            type.",
    values: OptionValues::Word { words: &LAYOUTS, default: "velodyne" },
};

pub(super) const TIME_UNIT: OptionSpec = OptionSpec {
    name: "time_unit",
    about: "The unit of `time` in the layout `fast_lio`, as its `timestamp_unit` says: floats, or a `t` of whole nanoseconds.",
    values: OptionValues::Word { words: &["s", "ms", "us", "ns"], default: "us" },
};

pub(super) const ORGANISED: OptionSpec = OptionSpec {
    name: "organised",
    about: "Whether clouds have a point for each pixel of the range image, in rows and columns, with NaN where nothing came back; \
            of several returns the first is there. Otherwise they have the returns alone, all of them, in the order of their times.",
    values: OptionValues::Flag { default: false },
};

pub(super) const DEPTH: OptionSpec = OptionSpec {
    name: "depth",
    about: "The images of depth along the axis of cameras (REP 118): `32FC1` are metres with NaN where nothing came back, `16UC1` \
            millimetres with 0 there and for depths above 65.535 m.",
    values: OptionValues::Word { words: &["32FC1", "16UC1", "none"], default: "32FC1" },
};

const LABELS: OptionSpec = OptionSpec {
    name: "labels",
    about: "Whether cameras have images of semantic labels besides, in `mono16`.",
    values: OptionValues::Flag { default: false },
};

pub(super) const START_STAMP: OptionSpec = OptionSpec {
    name: "start_stamp_s",
    about: "The stamp of the job's time 0, in seconds since 1970. No clock is read.",
    values: OptionValues::Number { least: 0.0, most: 2e9, default: 0.0 },
};

const POINTS_TOPIC: OptionSpec = text(
    "points_topic",
    "The topic of the clouds of LiDARs. `{sensor}` stands for the sensor's name.",
    "/{sensor}/points",
);
const IMAGE_TOPIC: OptionSpec = text(
    "image_topic",
    "The beginning of the topics of cameras, to which `/depth`, `/labels` and `/camera_info` are added.",
    "/{sensor}",
);
const BOXES_TOPIC: OptionSpec = text(
    "boxes_topic",
    "The topic of the boxes of objects, which are there if the job's `truth.boxes` asks for them.",
    "/{sensor}/boxes",
);
const ODOM_TOPIC: OptionSpec = text("odom_topic", "The topic of the body's true motion.", "/odom");
const IMU_TOPIC: OptionSpec = text("imu_topic", "The topic of the inertial sensor.", "/imu/data");
const WORLD_FRAME: OptionSpec = text("world_frame", "The name of the world's frame.", "world");
const BODY_FRAME: OptionSpec = text(
    "body_frame",
    "The name of the frame of the body that carries the sensors, in which the inertial sensor is, too.",
    "base_link",
);
const SENSOR_FRAME: OptionSpec = text(
    "sensor_frame",
    "The name of a sensor's frame (x forward). Images of cameras are in it with `_optical` added (z forward).",
    "{sensor}",
);

const fn text(name: &'static str, about: &'static str, default: &'static str) -> OptionSpec {
    OptionSpec { name, about, values: OptionValues::Text { default } }
}

const TF: OptionSpec = OptionSpec {
    name: "tf",
    about: "Whether `/tf` has the body's true pose in the world. Without it a program can publish its own estimate there.",
    values: OptionValues::Flag { default: true },
};

pub(super) const ODOM_HZ: OptionSpec = rate(
    "odom_hz",
    "How often the body's true motion and pose are told, a second. 0: when a frame starts, and when it ends.",
);
pub(super) const IMU_HZ: OptionSpec = rate(
    "imu_hz",
    "How often the inertial sensor measures, a second; 0: there is none. It has the exact derivatives of the trajectory. Where a \
     path goes on with another velocity at a pose, that is a jump, which no acceleration tells of: a twist and an animated node \
     of splines have none.",
);

const fn rate(name: &'static str, about: &'static str) -> OptionSpec {
    OptionSpec { name, about, values: OptionValues::Number { least: 0.0, most: 10_000.0, default: 0.0 } }
}

pub(super) const GYRO_NOISE: OptionSpec =
    noise("gyro_noise", "The density of white noise of angular velocities, in rad/s/√Hz.");
const ACCEL_NOISE: OptionSpec =
    noise("accel_noise", "The density of white noise of accelerations, in m/s²/√Hz.");
pub(super) const GYRO_WALK: OptionSpec = noise(
    "gyro_walk",
    "The random walk of the bias of angular velocities, in rad/s²/√Hz. The bias begins at 0.",
);
const ACCEL_WALK: OptionSpec =
    noise("accel_walk", "The random walk of the bias of accelerations, in m/s³/√Hz. The bias begins at 0.");

const fn noise(name: &'static str, about: &'static str) -> OptionSpec {
    OptionSpec { name, about, values: OptionValues::Number { least: 0.0, most: 100.0, default: 0.0 } }
}

const COMPRESSION: OptionSpec = OptionSpec {
    name: "compression",
    about: "The compression of the file's chunks. Zstandard takes about a third off clouds, and more off images.",
    values: OptionValues::Word { words: &["none", "zstd"], default: "none" },
};

/// The depth in images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Depth {
    /// Metres in floats.
    Metres,
    /// Whole millimetres in 16 bits.
    Millimetres,
    /// No image.
    None,
}

/// The values of all options.
#[derive(Clone, Debug)]
pub(super) struct Settings {
    /// The fields of points. `None`: messages of Livox's own type.
    pub layout: Option<Layout>,
    pub organised: bool,
    pub depth: Depth,
    pub labels: bool,
    /// The stamp of the job's time 0, in nanoseconds.
    pub start_ns: i64,
    points_topic: &'static str,
    image_topic: &'static str,
    boxes_topic: &'static str,
    pub odom_topic: &'static str,
    pub imu_topic: &'static str,
    pub world_frame: &'static str,
    pub body_frame: &'static str,
    sensor_frame: &'static str,
    pub tf: bool,
    pub odom_hz: f64,
    pub imu: ImuSettings,
    pub compression: Compression,
}

/// The inertial sensor.
#[derive(Clone, Copy, Debug)]
pub(super) struct ImuSettings {
    /// Measurements a second; 0: none.
    pub rate_hz: f64,
    /// The densities of white noise of angular velocity and of acceleration.
    pub noise: [f64; 2],
    /// The random walks of their biases.
    pub walk: [f64; 2],
}

impl Settings {
    /// The values of a job's options.
    pub fn of(options: &Options) -> Self {
        let start_s = options.number(&START_STAMP);
        // The whole seconds have no rounding.
        let start_ns = start_s.floor() as i64 * 1_000_000_000 + (start_s.fract() * 1e9).round() as i64;
        Self {
            layout: Layout::named(options.text(&LAYOUT), options.text(&TIME_UNIT)),
            organised: options.is_set(&ORGANISED),
            depth: match options.text(&DEPTH) {
                "32FC1" => Depth::Metres,
                "16UC1" => Depth::Millimetres,
                _ => Depth::None,
            },
            labels: options.is_set(&LABELS),
            start_ns,
            points_topic: options.text(&POINTS_TOPIC),
            image_topic: options.text(&IMAGE_TOPIC),
            boxes_topic: options.text(&BOXES_TOPIC),
            odom_topic: options.text(&ODOM_TOPIC),
            imu_topic: options.text(&IMU_TOPIC),
            world_frame: options.text(&WORLD_FRAME),
            body_frame: options.text(&BODY_FRAME),
            sensor_frame: options.text(&SENSOR_FRAME),
            tf: options.is_set(&TF),
            odom_hz: options.number(&ODOM_HZ),
            imu: ImuSettings {
                rate_hz: options.number(&IMU_HZ),
                noise: [&GYRO_NOISE, &ACCEL_NOISE].map(|option| options.number(option)),
                walk: [&GYRO_WALK, &ACCEL_WALK].map(|option| options.number(option)),
            },
            compression: match options.text(&COMPRESSION) {
                "zstd" => Compression::Zstd,
                _ => Compression::None,
            },
        }
    }

    /// The topic of a LiDAR's clouds.
    pub fn points_topic(&self, sensor: &str) -> String {
        of_sensor(self.points_topic, sensor)
    }

    /// The topic of a camera's images of one kind.
    pub fn image_topic(&self, sensor: &str, kind: &str) -> String {
        format!("{}/{kind}", of_sensor(self.image_topic, sensor))
    }

    /// The topic of the boxes that a sensor sees.
    pub fn boxes_topic(&self, sensor: &str) -> String {
        of_sensor(self.boxes_topic, sensor)
    }

    /// The name of a sensor's frame.
    pub fn sensor_frame(&self, sensor: &str) -> String {
        of_sensor(self.sensor_frame, sensor)
    }

    /// The name of the optical frame of a camera.
    pub fn optical_frame(&self, sensor: &str) -> String {
        format!("{}_optical", self.sensor_frame(sensor))
    }

    /// The stamp of a time of the job, in nanoseconds.
    pub fn stamp_ns(&self, time_s: f64) -> i64 {
        self.start_ns.saturating_add((time_s * 1e9).round() as i64)
    }
}

fn of_sensor(name: &str, sensor: &str) -> String {
    name.replace("{sensor}", sensor)
}

/// Checks that the options go together, and that names are names.
pub(super) fn check(options: &Options) -> Result<(), EncodeError> {
    let settings = Settings::of(options);
    let wrong = |problem: String| Err(EncodeError::new(problem));
    if options.given(&TIME_UNIT).is_some() && options.text(&LAYOUT) != "fast_lio" {
        return wrong(format!(
            "time_unit is of the layout \"fast_lio\", and the layout is {:?}: leave it out",
            options.text(&LAYOUT)
        ));
    }
    if settings.organised && settings.layout.is_none() {
        return wrong(
            "the layout \"livox_custom\" has no rows and columns: leave out `organised`".to_owned(),
        );
    }
    for option in [POINTS_TOPIC, IMAGE_TOPIC, BOXES_TOPIC, ODOM_TOPIC, IMU_TOPIC] {
        let topic = options.text(&option);
        if !topic.starts_with('/') || topic.ends_with('/') || topic.contains(char::is_whitespace) {
            return wrong(format!(
                "{} = {topic:?} is no topic, which begins with a slash, does not end in one and has no spaces, as {:?}",
                option.name,
                Options::none(OPTIONS).text(&option)
            ));
        }
    }
    for option in [WORLD_FRAME, BODY_FRAME, SENSOR_FRAME] {
        let frame = options.text(&option);
        if frame.is_empty() || frame.starts_with('/') || frame.contains(char::is_whitespace) {
            return wrong(format!(
                "{} = {frame:?} is no name of a frame, which has no slash before it and no spaces",
                option.name
            ));
        }
    }
    if settings.world_frame == settings.body_frame {
        return wrong(format!("world_frame and body_frame are both {:?}", settings.world_frame));
    }
    let noisy = [GYRO_NOISE, ACCEL_NOISE, GYRO_WALK, ACCEL_WALK].into_iter().find(|o| options.is_set(o));
    if let Some(option) = noisy.filter(|_| settings.imu.rate_hz == 0.0) {
        return wrong(format!(
            "{} is of the inertial sensor, and there is none: give imu_hz, too",
            option.name
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::super::options::OptionValue;
    use super::*;

    #[test]
    fn stamps_are_exact_to_the_nanosecond() {
        let mut options = Options::none(OPTIONS);
        options.set(&START_STAMP, 1_700_000_000.25);
        let settings = Settings::of(&options);
        assert_eq!(settings.stamp_ns(0.0), 1_700_000_000_250_000_000);
        assert_eq!(settings.stamp_ns(0.1), 1_700_000_000_350_000_000);
        assert_eq!(settings.stamp_ns(-1e-9), 1_700_000_000_249_999_999);
    }

    #[test]
    fn options_that_do_not_go_together_are_told_of() {
        let told = |values: &[(&OptionSpec, OptionValue)]| {
            let mut options = Options::none(OPTIONS);
            values.iter().for_each(|(option, value)| options.set(option, *value));
            check(&options).map_err(|e| e.to_string())
        };
        let text = OptionValue::Text;
        assert_eq!(told(&[(&LAYOUT, text("fast_lio")), (&TIME_UNIT, text("ns"))]), Ok(()));
        for (values, words) in [
            (vec![(&TIME_UNIT, text("ns"))], "of the layout \"fast_lio\""),
            (vec![(&LAYOUT, text("livox_custom")), (&ORGANISED, OptionValue::Number(1.0))], "no rows"),
            (vec![(&ODOM_TOPIC, text("odom"))], "odom_topic = \"odom\" is no topic"),
            (vec![(&POINTS_TOPIC, text("/a b"))], "as \"/{sensor}/points\""),
            (vec![(&BODY_FRAME, text(""))], "body_frame = \"\" is no name"),
            (vec![(&BODY_FRAME, text("world"))], "both \"world\""),
            (vec![(&GYRO_WALK, OptionValue::Number(0.1))], "give imu_hz, too"),
        ] {
            let problem = told(&values).unwrap_err();
            assert!(problem.contains(words), "{problem}");
        }
    }
}
