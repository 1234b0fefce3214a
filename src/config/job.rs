//! Jobs and sensor files as they are read.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::check::Settings;
use crate::check::expect::Expectation;
use crate::frame::{Pose, UpAxis};
use crate::motion::Trajectory;
use crate::output::{CloudFrame, Format};
use crate::sensor::Sensor;
use crate::source::{Diagnostic, Place};
use crate::trace::methods::Method;

/// A job: a rig of sensors, a scene, and the outputs to write.
#[derive(Clone, Debug)]
pub struct Job {
    /// The job's file, as the user named it.
    pub path: PathBuf,
    /// The scene's file, resolved against the job's folder.
    pub scene_path: PathBuf,
    /// The scene's file as the job writes it; the last part of an absolute path.
    pub scene_as_written: String,
    /// The name of one of the file's scenes; its default scene if absent.
    pub scene_name: Option<String>,
    /// The upward axis of the scene's file.
    pub up: UpAxis,
    /// Semantic labels by the names of nodes or materials.
    pub labels: BTreeMap<String, u32>,
    /// The seed of all random numbers.
    pub seed: u64,
    /// The method that decides what a beam hits; the exact definition if absent.
    pub kernel: Option<&'static Method>,
    /// The rig; at least one sensor.
    pub sensors: Vec<MountedSensor>,
    /// The pose of the body in the world over time.
    pub trajectory: Trajectory,
    /// The outputs to write.
    pub output: OutputSettings,
    /// The channels that are held to the baseline, and how closely: `None` if the job has no `[check]`.
    pub check: Option<Settings>,
    /// The expectations of what the sensors see.
    pub expectations: Vec<Expectation>,
    /// The files that the job was read from, each once: the job's own, then sensor files, then tables of rays.
    pub inputs: Vec<InputFile>,
    /// The job with its sensors' files merged in, as the manifest tells it: the keys that were given, without defaults,
    /// without the output's folder and without absolute paths.
    pub resolved: serde_json::Value,
    /// Where the values stand in the job's files, for what is found out about them later.
    pub places: Places,
    /// Problems that don't stop the job.
    pub warnings: Vec<Diagnostic>,
}

/// Where the values of a job stand in its files.
#[derive(Clone, Debug, Default)]
pub struct Places {
    /// The scene's name.
    pub scene: Place,
    /// For each sensor what says where it stands: its pose, else the body's, else the sensor's table.
    pub sensors: Vec<Place>,
    /// The table of each sensor.
    pub tables: Vec<Place>,
    /// The formats.
    pub formats: Vec<Place>,
    /// The expectations.
    pub expectations: Vec<Place>,
}

/// A file that a job was read from, as a manifest lists it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputFile {
    /// The name as the user wrote it; the last part of an absolute path, and of the job's own path.
    pub name: String,
    /// The length of the content that was read, in bytes.
    pub bytes: u64,
    /// BLAKE3 of the content that was read, in hexadecimal.
    pub blake3: String,
}

impl InputFile {
    /// The file of this name, which was read once and had this content.
    pub(super) fn new(name: String, content: &str) -> Self {
        let blake3 = blake3::hash(content.as_bytes()).to_hex().to_string();
        Self { name, bytes: content.len() as u64, blake3 }
    }
}

/// A sensor of the rig.
#[derive(Clone, Debug)]
pub struct MountedSensor {
    /// The name of the output folder; unique in the job.
    pub name: String,
    /// The sensor.
    pub sensor: Sensor,
    /// The pose of the sensor on the body.
    pub body_from_sensor: Pose,
}

/// The job's `[output]`.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputSettings {
    /// The folder, resolved against the job's.
    pub dir: PathBuf,
    /// The formats, each once, in the job's order.
    pub formats: Vec<Format>,
    /// The frame of the clouds.
    pub cloud_frame: CloudFrame,
    /// Whether PNG previews have a legend.
    pub legend: bool,
}

/// A sensor file on its own.
#[derive(Clone, Debug)]
pub struct SensorFile {
    /// The file, as the user named it.
    pub path: PathBuf,
    /// The sensor.
    pub sensor: Sensor,
    /// The sensor in each of its modes, by their names.
    pub modes: Vec<(String, Sensor)>,
    /// Problems that don't stop a job with it.
    pub warnings: Vec<Diagnostic>,
}

/// A file, by its content.
#[derive(Clone, Debug)]
pub enum Config {
    /// A job, with its sensor files.
    Job(Box<Job>),
    /// A sensor file.
    Sensor(Box<SensorFile>),
}
