//! The bag: which messages there are, and their order.

use std::io::Write;

use super::super::channel::channel;
use super::super::format::{EncodeError, Stream};
use super::super::image::Image;
use super::super::options::Options;
use super::super::sensor_frame::{CloudFrame, SensorFrame};
use super::body::{Body, Told};
use super::clouds::{Stamp, custom_message, point_cloud};
use super::mcap::Mcap;
use super::messages::{self, Detection, Transform};
use super::metadata::metadata;
use super::schemas::{self, Schema};
use super::settings::Settings;
use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::sensor::Pattern;

/// The quality of service of `/tf_static`, by which rosbag2 plays it so that late subscribers get it, too: reliable (1), transient
/// local (1), the last message (1).
const LATCHED: &str = "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:\n    sec: 0\n    nsec: 0\n  lifespan:\n    \
                       sec: 0\n    nsec: 0\n  liveliness: 1\n  liveliness_lease_duration:\n    sec: 0\n    nsec: 0\n  \
                       avoid_ros_namespace_conventions: false\n";

/// A bag that grows.
///
/// Frames come in the order of the times at which they start. Before the messages of a frame come those of the body up to the
/// frame's start, so that all messages are in the order of their log times. A frame's log time is its start, whatever its stamp.
#[derive(Debug)]
pub(super) struct Bag {
    settings: Settings,
    /// The name of the file in the bag's folder.
    file: &'static str,
    mcap: Mcap,
    body: Option<Body>,
    /// The poses on the body of all sensors so far, each with its sensor.
    fixed: Vec<(String, Transform)>,
    log_ns: u64,
}

impl Bag {
    /// A bag that is empty.
    pub fn new(options: &Options, file: &'static str) -> Self {
        let settings = Settings::of(options);
        let mcap = Mcap::new(settings.compression);
        Self { settings, file, mcap, body: None, fixed: Vec::new(), log_ns: 0 }
    }

    /// Checks that a time has a stamp, whose seconds have 32 bits.
    fn check_time(&self, time_s: f64) -> Result<(), EncodeError> {
        let stamp_s = self.settings.stamp_ns(time_s).div_euclid(1_000_000_000);
        if i32::try_from(stamp_s).is_ok() {
            return Ok(());
        }
        let most = i32::MAX;
        Err(EncodeError::new(format!(
            "a stamp has at most {most} s, and that of the time {time_s:?} s of the job has {stamp_s} s: a smaller start_stamp_s may fit"
        )))
    }

    /// Adds a message. Log times never fall, and begin at 0.
    fn write(
        &mut self,
        topic: &str,
        schema: Schema,
        log_ns: i64,
        message: &[u8],
        file: &mut dyn Write,
    ) -> Result<(), EncodeError> {
        let qos = if topic == "/tf_static" { LATCHED } else { "" };
        let channel = self.mcap.channel(topic, schema.name, schema.definition, qos);
        self.log_ns = self.log_ns.max(log_ns.max(0) as u64);
        Ok(self.mcap.add(channel, self.log_ns, message, file)?)
    }

    /// Writes what is to be told of the body up to a time, or to the end.
    fn tell(&mut self, until_s: Option<f64>, file: &mut dyn Write) -> Result<(), EncodeError> {
        let (world, own) = (self.settings.world_frame, self.settings.body_frame);
        while let Some(told) = self.body.as_mut().and_then(|body| body.next(until_s, &self.settings)) {
            match told {
                Told::Inertial(measured) => {
                    let message = messages::inertial(&measured, own);
                    self.write(self.settings.imu_topic, schemas::IMU, measured.stamp_ns, &message, file)?;
                }
                Told::State(state) => {
                    let stamp_ns = state.stamp_ns;
                    if self.settings.tf {
                        let (parent, child) = (world.to_owned(), own.to_owned());
                        let moved = Transform { stamp_ns, parent, child, pose: state.pose };
                        self.write(
                            "/tf",
                            schemas::TRANSFORMS,
                            stamp_ns,
                            &messages::transforms(&[moved]),
                            file,
                        )?;
                    }
                    let message = messages::odometry(&state, world, own);
                    self.write(self.settings.odom_topic, schemas::ODOMETRY, stamp_ns, &message, file)?;
                }
            }
        }
        Ok(())
    }

    /// Writes the poses of all sensors so far, if this one is new, or if the job has drawn another mount for it.
    fn mount(&mut self, seen: &SensorFrame, log_ns: i64, file: &mut dyn Write) -> Result<(), EncodeError> {
        let sensor = self.settings.sensor_frame(seen.name);
        let body = self.settings.body_frame.to_owned();
        let mut is_new = self.fix(seen, body, &sensor, seen.capture.body_from_sensor, log_ns)?;
        if seen.capture.sensor.pattern.is_camera() {
            let optical = self.settings.optical_frame(seen.name);
            is_new |= self.fix(seen, sensor, &optical, BODY_FROM_OPTICAL, log_ns)?;
        }
        if !is_new {
            return Ok(());
        }
        let transforms: Vec<Transform> = self.fixed.iter().map(|(_, fixed)| fixed.clone()).collect();
        self.write("/tf_static", schemas::TRANSFORMS, log_ns, &messages::transforms(&transforms), file)
    }

    /// Takes note of the pose of a sensor's frame. Returns whether it was another before.
    fn fix(
        &mut self,
        seen: &SensorFrame,
        parent: String,
        child: &str,
        pose: Pose,
        stamp_ns: i64,
    ) -> Result<bool, EncodeError> {
        if let Some((sensor, known)) = self.fixed.iter_mut().find(|(_, known)| known.child == child) {
            if sensor != seen.name {
                return Err(EncodeError::new(format!(
                    "the sensors {sensor:?} and {:?} have the same frame, {child:?}: sensor_frame = \"{{sensor}}\" gives each its own",
                    seen.name
                )));
            }
            let is_new = known.pose != pose;
            (known.pose, known.stamp_ns) = (pose, if is_new { stamp_ns } else { known.stamp_ns });
            return Ok(is_new);
        }
        let child = child.to_owned();
        self.fixed.push((seen.name.to_owned(), Transform { stamp_ns, parent, child, pose }));
        Ok(true)
    }

    /// Adds the boxes of a frame, if the job asks for them.
    fn add_boxes(
        &mut self,
        seen: &SensorFrame,
        log_ns: i64,
        file: &mut dyn Write,
    ) -> Result<(), EncodeError> {
        let Some(boxes) = seen.boxes else { return Ok(()) };
        let detections: Vec<Detection> = boxes
            .iter()
            .map(|truth| Detection {
                stamp_ns: self.settings.stamp_ns(truth.time_s),
                class: class_of(seen, truth.target.label),
                track: truth.target.track,
                world_from_box: truth.oriented.world_from_box,
                size_m: truth.oriented.size_m,
            })
            .collect();
        let stamp_ns = self.settings.stamp_ns(seen.capture.start_s);
        let message = messages::detections(stamp_ns, self.settings.world_frame, &detections);
        self.write(&self.settings.boxes_topic(seen.name), schemas::DETECTIONS, log_ns, &message, file)
    }

    fn add_cloud(
        &mut self,
        seen: &SensorFrame,
        log_ns: i64,
        file: &mut dyn Write,
    ) -> Result<(), EncodeError> {
        let settings = &self.settings;
        let frame_id = match seen.cloud_frame {
            CloudFrame::Sensor => settings.sensor_frame(seen.name),
            CloudFrame::Body => settings.body_frame.to_owned(),
            CloudFrame::World => settings.world_frame.to_owned(),
        };
        let from_start_s = seen.reference_s().unwrap_or_else(|| first_s(seen));
        let stamp = Stamp { ns: settings.stamp_ns(seen.capture.start_s + from_start_s), from_start_s };
        let topic = settings.points_topic(seen.name);
        let (schema, message) = match &settings.layout {
            Some(layout) => (schemas::POINT_CLOUD, point_cloud(seen, settings, layout, stamp, &frame_id)?),
            None => (schemas::LIVOX, custom_message(seen, stamp, &frame_id)?),
        };
        self.write(&topic, schema, log_ns, &message, file)
    }

    fn add_images(
        &mut self,
        seen: &SensorFrame,
        log_ns: i64,
        file: &mut dyn Write,
    ) -> Result<(), EncodeError> {
        let stamp_ns = self.settings.stamp_ns(seen.capture.start_s);
        let frame_id = self.settings.optical_frame(seen.name);
        let (of, size) = ((stamp_ns, frame_id.as_str()), (seen.frame.rows(), seen.frame.columns()));
        let topic = |bag: &Self, kind: &str| bag.settings.image_topic(seen.name, kind);
        let image = Image::with_channels(seen, 0, channel("Z"));
        let depths = image.f32("Z").unwrap_or_default();
        if let Some(message) = messages::depth_image(of, size, depths, self.settings.depth) {
            self.write(&topic(self, "depth"), schemas::IMAGE, log_ns, &message, file)?;
        }
        if self.settings.labels {
            let image = Image::with_channels(seen, 0, channel("id.semantic"));
            let labels = image.u32("id.semantic").unwrap_or_default();
            // A frame can have numbers that its scene did not tell of.
            if let Some(label) = labels.iter().find(|label| **label > u16::MAX.into()) {
                return Err(EncodeError::new(format!(
                    "an image's labels are at most 65535, and one is {label}"
                )));
            }
            let message = messages::image(of, size, ("mono16", 2), |bytes| {
                labels.iter().for_each(|label| bytes.extend((*label as u16).to_le_bytes()));
            });
            self.write(&topic(self, "labels"), schemas::IMAGE, log_ns, &message, file)?;
        }
        // ROS has no model of parallel rays.
        if let Pattern::Camera(camera) = &seen.capture.sensor.pattern {
            let message = messages::camera_info(of, camera);
            self.write(&topic(self, "camera_info"), schemas::CAMERA_INFO, log_ns, &message, file)?;
        }
        Ok(())
    }
}

/// The name of a label, or its number if it has none.
fn class_of(seen: &SensorFrame, label: u32) -> String {
    let named = seen.names.labels.into_iter().flatten().find(|(_, number)| **number == label);
    named.map_or_else(|| label.to_string(), |(name, _)| name.clone())
}

/// The time from a frame's start to its first moment: 0, or that of its first pulse if a beam fires before its column's time.
fn first_s(seen: &SensorFrame) -> f64 {
    seen.capture.sensor.pattern.first_pulse_s().min(0.0)
}

impl Stream for Bag {
    fn add(&mut self, seen: &SensorFrame, file: &mut dyn Write) -> Result<(), EncodeError> {
        let capture = &seen.capture;
        let first_s = capture.start_s + first_s(seen);
        let times_s = [first_s, capture.start_s, capture.start_s + capture.duration_s()];
        for time_s in times_s {
            self.check_time(time_s)?;
        }
        let new = || Body::new(capture.trajectory.clone(), capture.seed, first_s);
        let body = self.body.get_or_insert_with(new);
        body.frame(capture.trajectory, times_s, &self.settings);
        let log_ns = self.settings.stamp_ns(capture.start_s);
        self.tell(Some(capture.start_s), file)?;
        self.mount(seen, log_ns, file)?;
        match capture.sensor.pattern.is_camera() {
            true => self.add_images(seen, log_ns, file)?,
            false => self.add_cloud(seen, log_ns, file)?,
        }
        self.add_boxes(seen, log_ns, file)
    }

    fn finish(&mut self, file: &mut dyn Write) -> Result<(), EncodeError> {
        self.tell(None, file)?;
        Ok(self.mcap.finish(file)?)
    }

    fn beside(&self) -> Vec<Vec<u8>> {
        vec![metadata(&self.mcap, self.file).into_bytes()]
    }
}
