//! Jobs and sensor files: TOML → domain types. How the TOML is read stays private; every error points into the file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::error::{Diagnostic, Error};
use crate::frame::{Pose, UpAxis};
use crate::output::{CloudFrame, Format};
use crate::sensor::Sensor;

/// A job: a rig of sensors, a scene, and what to write.
#[derive(Clone, Debug)]
pub struct Job {
    /// The job's file, as the user named it.
    pub path: PathBuf,
    /// The scene's file, resolved against the job's folder.
    pub scene_path: PathBuf,
    /// The scene's file as the job writes it.
    pub scene_as_written: String,
    /// Which of the file's scenes, by name; its default scene if absent.
    pub scene_name: Option<String>,
    /// Which axis of the scene's file is up.
    pub up: UpAxis,
    /// Semantic labels by node or material name.
    pub labels: BTreeMap<String, u32>,
    /// Seed of everything random.
    pub seed: u64,
    /// The rig; at least one.
    pub sensors: Vec<MountedSensor>,
    /// Where the body stands in the world.
    pub world_from_body: Pose,
    /// What to write.
    pub output: OutputSettings,
    /// Sensor files that were read, as the job writes them, with their whole text.
    pub sensor_files: Vec<(String, String)>,
    /// The job with its sensors' files merged in, as the manifest tells it.
    pub resolved: serde_json::Value,
    /// Problems that don't stop the job.
    pub warnings: Vec<Diagnostic>,
}

/// A sensor of the rig.
#[derive(Clone, Debug)]
pub struct MountedSensor {
    /// Names the output folder; unique in the job.
    pub name: String,
    /// The sensor.
    pub sensor: Sensor,
    /// Where it sits on the body.
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
}

/// Reads a job with its sensor files. `overrides` are `key=value` pairs of `--set`, which win over the file.
///
/// # Errors
/// [`Error::Config`] with every problem of all the files.
pub fn load_job(_path: &Path, _overrides: &[String]) -> Result<Job, Error> {
    todo!("helper: config")
}
