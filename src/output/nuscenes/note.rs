//! The facts of a frame that the tables of nuScenes need.

use std::collections::{BTreeMap, BTreeSet};

use glam::DQuat;
use serde::{Deserialize, Serialize};

use super::super::format::{EncodeError, Note};
use super::super::kitti::intrinsics;
use super::super::options::Options;
use super::super::sensor_frame::{CloudFrame, SensorFrame};
use super::layout::{CLOUD, LABELS, LIDARSEG, PICTURE, ROOT, SCENE};
use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::scene::label_names;
use crate::truth::BoxTruth;

/// The note of a frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Noted {
    pub scene: String,
    pub sensor: String,
    pub frame: u64,
    /// The time at which the frame starts, by which frames are in order.
    pub start_s: f64,
    /// The time of the poses.
    pub time_us: i64,
    /// `world_from_body`.
    pub ego: Place,
    /// The pose of the points or of the picture on the body.
    pub mount: Place,
    pub camera: Option<Imager>,
    /// Whether the labels of points lie beside them.
    pub lidarseg: bool,
    /// The words for the labels that the frame shows.
    pub labels: BTreeMap<u32, String>,
    pub boxes: Vec<NotedBox>,
    /// The paths of the frame's files. They come with the note.
    #[serde(skip)]
    pub files: Vec<String>,
}

/// A pose as nuScenes has it: a translation in metres, and a rotation as a quaternion whose real part is first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Place {
    pub translation: [f64; 3],
    pub rotation: [f64; 4],
}

impl From<Pose> for Place {
    fn from(pose: Pose) -> Self {
        let [x, y, z, w] = DQuat::from_mat3(&pose.rotation).to_array();
        // Adding 0 makes a negative zero positive.
        Self {
            translation: pose.translation.to_array().map(|v| v + 0.0),
            rotation: [w, x, y, z].map(|v| v + 0.0),
        }
    }
}

/// The size of a camera's picture in pixels, and the matrix of its intrinsics, by which the centre of the first pixel is at 0.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Imager {
    pub width: usize,
    pub height: usize,
    pub intrinsic: [[f64; 3]; 3],
}

/// The box of an object.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct NotedBox {
    pub track: u32,
    pub label: u32,
    /// Width, length and height in metres.
    pub size: [f64; 3],
    /// `world_from_box`.
    pub place: Place,
    pub points: u64,
    pub pixels: u64,
    pub pixels_alone: u64,
}

impl Noted {
    pub fn of(frame: &SensorFrame, options: &Options) -> Self {
        let capture = &frame.capture;
        let cast_at_s = capture.cast_at_s(frame.reference_s().unwrap_or(0.0));
        let ego = capture.trajectory.pose_at(cast_at_s);
        let imager = intrinsics(capture.sensor).map(|[fx, fy, cx, cy]| Imager {
            width: capture.columns(),
            height: capture.rows(),
            intrinsic: [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
        });
        let mount = match frame.cloud_frame {
            _ if imager.is_some() => capture.body_from_sensor * BODY_FROM_OPTICAL,
            CloudFrame::Sensor => capture.body_from_sensor,
            CloudFrame::Body => Pose::IDENTITY,
            CloudFrame::World => ego.inverse(),
        };
        let boxes: Vec<NotedBox> = frame.boxes.unwrap_or_default().iter().map(box_of).collect();
        Self {
            scene: options.text(&SCENE).to_owned(),
            sensor: frame.name.to_owned(),
            frame: capture.frame,
            start_s: capture.start_s,
            time_us: (cast_at_s * 1e6).round() as i64,
            ego: ego.into(),
            mount: mount.into(),
            camera: imager,
            lidarseg: options.is_set(&LIDARSEG),
            labels: labels(frame, &boxes),
            boxes,
            files: Vec::new(),
        }
    }

    pub fn text(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }

    pub fn read(note: Note) -> Result<Self, EncodeError> {
        let read: Result<Self, _> = serde_json::from_str(&note.text);
        let damaged = |e| EncodeError::new(format!("the journal's note of a frame is damaged: {e}"));
        Ok(Self { files: note.files, ..read.map_err(damaged)? })
    }

    /// The path of the cloud or the picture, below the folder of the set.
    pub fn data_path(&self) -> &str {
        let is_data = |path: &&String| CLOUD.frame_of(path).or(PICTURE.frame_of(path)).is_some();
        self.below_root(self.files.iter().find(is_data))
    }

    /// The path of the labels of points.
    pub fn labels_path(&self) -> &str {
        self.below_root(self.files.iter().find(|path| LABELS.frame_of(path).is_some()))
    }

    fn below_root<'p>(&self, path: Option<&'p String>) -> &'p str {
        path.and_then(|path| path.strip_prefix(ROOT)).unwrap_or_default()
    }
}

fn box_of(found: &BoxTruth) -> NotedBox {
    let [length, width, height] = found.oriented.size_m.to_array();
    NotedBox {
        track: found.target.track,
        label: found.target.label,
        size: [width, length, height],
        place: found.oriented.world_from_box.into(),
        points: found.points,
        pixels: found.pixels,
        pixels_alone: found.pixels_alone,
    }
}

/// The words for the labels that a frame or its boxes show: the job's, of which the first in the alphabet counts, or those of the
/// scene's files.
fn labels(frame: &SensorFrame, boxes: &[NotedBox]) -> BTreeMap<u32, String> {
    let shown = (0..frame.frame.pixels())
        .flat_map(|pixel| frame.frame.slots(pixel))
        .map(|slot| frame.frame.returns().label[slot]);
    let shown: BTreeSet<u32> = shown.chain(boxes.iter().map(|found| found.label)).collect();
    let words = frame.names.labels.into_iter().flatten();
    let mut named: BTreeMap<u32, String> = BTreeMap::new();
    for (word, label) in words.filter(|(_, label)| shown.contains(label)) {
        named.entry(*label).or_insert_with(|| word.clone());
    }
    let is_open = |label: &u32| shown.contains(label) && !named.contains_key(label);
    let objects = frame.names.objects.iter();
    let of_files = objects.filter_map(|o| Some((o.name.as_str(), o.file_label.filter(is_open)?)));
    let of_files = label_names(std::iter::empty(), of_files);
    named.extend(of_files);
    shown.into_iter().map(|label| (label, named.remove(&label).unwrap_or_else(|| unnamed(label)))).collect()
}

/// The word for a label that has no name.
pub(super) fn unnamed(label: u32) -> String {
    if label == 0 { "unlabelled".to_owned() } else { format!("label {label}") }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A note of a LiDAR's frame.
    pub(in super::super) fn note(sensor: &str, frame: u64, start_s: f64) -> Noted {
        let place = Place { translation: [0.0; 3], rotation: [1.0, 0.0, 0.0, 0.0] };
        Noted {
            scene: "s".into(),
            sensor: sensor.into(),
            frame,
            start_s,
            time_us: (start_s * 1e6) as i64,
            ego: place,
            mount: place,
            camera: None,
            lidarseg: false,
            labels: BTreeMap::new(),
            boxes: Vec::new(),
            files: Vec::new(),
        }
    }

    #[test]
    fn a_note_is_read_as_it_was_written() {
        let files = ["top/000001.exr", "nuscenes/samples/top/000001.pcd.bin"].map(str::to_owned).to_vec();
        let mut written = note("top", 1, 0.1);
        written.ego.translation = [1.0 / 3.0, 4.5e6 + 0.1, -1e-300];
        let read = Noted::read(Note { text: written.text(), files }).unwrap();
        assert_eq!((read.ego, read.start_s.to_bits()), (written.ego, 0.1_f64.to_bits()));
        assert_eq!((read.data_path(), read.labels_path()), ("samples/top/000001.pcd.bin", ""));
        assert!(Noted::read(Note { text: "{}".into(), files: Vec::new() }).is_err());
    }
}
