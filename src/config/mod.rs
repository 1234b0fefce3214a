//! Jobs and sensor files: TOML → domain types. How the TOML is read stays private; every error points into the file.

mod check;
mod job;
pub mod presets;
mod rays;
mod schema;
mod section;
mod sensor;
mod tree;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::check::Settings;
use crate::check::expect::Expectation;
use crate::error::Error;
use crate::frame::{Pose, UpAxis};
use crate::motion::Trajectory;
use crate::output::{CloudFrame, Format};
use crate::sensor::Sensor;
use crate::source::suggest::{missing_file_help, quoted};
use crate::source::{Diagnostic, Layer, Report, Span, Unreadable};
use crate::trace::methods::Method;

pub use schema::{Document, schema};
use tree::Table;

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
    /// The method that decides what a beam hits; the exact definition if absent.
    pub kernel: Option<&'static Method>,
    /// The rig; at least one.
    pub sensors: Vec<MountedSensor>,
    /// Where the body is in the world over time.
    pub trajectory: Trajectory,
    /// What to write.
    pub output: OutputSettings,
    /// What of its frames is held to the baseline, and how closely: `None` if the job has no `[check]`.
    pub check: Option<Settings>,
    /// What its sensors should see.
    pub expectations: Vec<Expectation>,
    /// The job's own file, as it was read.
    pub file: InputFile,
    /// Sensor files that were read, each once: its name as the job writes it (an absolute path's last part), and its
    /// whole text.
    pub sensor_files: Vec<(String, String)>,
    /// Tables of rays that were read, each once.
    pub ray_files: Vec<InputFile>,
    /// The job with its sensors' files merged in, as the manifest tells it: what was given, without defaults, without
    /// the output's folder and without absolute paths.
    pub resolved: serde_json::Value,
    /// Problems that don't stop the job.
    pub warnings: Vec<Diagnostic>,
}

/// A file that was read, as a manifest lists it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputFile {
    /// Its name as the user wrote it (an absolute path's last part).
    pub name: String,
    /// Its length in bytes.
    pub bytes: u64,
    /// BLAKE3 of its content, in hexadecimal.
    pub blake3: String,
}

impl InputFile {
    /// The file of this name, which was read once and had this content.
    fn new(name: String, content: &str) -> Self {
        let blake3 = blake3::hash(content.as_bytes()).to_hex().to_string();
        Self { name, bytes: content.len() as u64, blake3 }
    }
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

/// A sensor file on its own.
#[derive(Clone, Debug)]
pub struct SensorFile {
    /// The file, as the user named it.
    pub path: PathBuf,
    /// The sensor.
    pub sensor: Sensor,
    /// What it is in each of its modes, by their names.
    pub modes: Vec<(String, Sensor)>,
    /// Problems that don't stop a job with it.
    pub warnings: Vec<Diagnostic>,
}

/// What a file turned out to be.
#[derive(Clone, Debug)]
pub enum Config {
    /// A job, with its sensor files.
    Job(Box<Job>),
    /// A sensor file.
    Sensor(Box<SensorFile>),
}

/// Reads a job with its sensor files. `overrides` are `key=value` pairs of `--set`, which win over the files: dotted keys
/// as in TOML, with an index or a sensor's name where the job has a list (`sensor.top.range.max_m=50`), and a TOML value
/// or a string without quotes.
///
/// # Errors
/// [`Error::Config`] with every problem of all the files, warnings too, file by file from top to bottom.
pub fn load_job(path: &Path, overrides: &[String]) -> Result<Job, Error> {
    let (report, table) = read(path)?;
    if is_sensor_file(&table) {
        let help = "a job is a TOML file that names it as the `preset` of a `[[sensor]]`".to_owned();
        return Err(misplaced(path, "this is a sensor file, not a job", help));
    }
    into_job(report, path, table, overrides)
}

/// Reads a sensor file on its own.
///
/// # Errors
/// [`Error::Config`] with every problem of the file, warnings too, from top to bottom.
pub fn load_sensor(path: &Path) -> Result<SensorFile, Error> {
    let (report, table) = read(path)?;
    into_sensor(report, path, table)
}

/// Reads a built-in sensor by its name, such as `ouster/os1-128`.
///
/// # Errors
/// [`Error::Config`] if there is none of that name; it says which are near.
pub fn load_preset(name: &str) -> Result<SensorFile, Error> {
    let path = Path::new(name);
    let Some(text) = presets::text(name) else {
        let message = format!("there is no built-in sensor {}", quoted(name));
        return Err(Error::Config(vec![Diagnostic::about_file(path, message, presets::near_name(name))]));
    };
    let mut report = Report::default();
    let source = report.add(path, text.to_owned(), Layer::Main);
    match tree::parse(&report, source) {
        Some(table) => into_sensor(report, path, table),
        None => Err(Error::Config(report.into_diagnostics())),
    }
}

/// Reads a job or a sensor file, whichever it is: a sensor file has a pattern, and no key of a job. A job is read with
/// `overrides` as [`load_job`] has them; a sensor file has none.
///
/// # Errors
/// [`Error::Config`] as for [`load_job`] and [`load_sensor`].
pub fn load(path: &Path, overrides: &[String]) -> Result<Config, Error> {
    let (report, table) = read(path)?;
    if is_sensor_file(&table) {
        into_sensor(report, path, table).map(|sensor| Config::Sensor(Box::new(sensor)))
    } else {
        into_job(report, path, table, overrides).map(|job| Config::Job(Box::new(job)))
    }
}

fn is_sensor_file(table: &Table) -> bool {
    let is_there = |key: &str| table.contains_key(key);
    sensor::pattern_names().any(is_there) && !section::JOB.keys.iter().any(|key| is_there(key))
}

/// A text as TOML writes it, with its quotes.
pub(crate) fn toml_string(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// A file that is fine, but not where it was given.
fn misplaced(path: &Path, message: &str, help: String) -> Error {
    Error::Config(vec![Diagnostic::about_file(path, message.to_owned(), Some(help))])
}

fn read(path: &Path) -> Result<(Report, Table), Error> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf")) {
        let help =
            "a job is a TOML file that names it as its `scene`, and the sensors that look at it".to_owned();
        return Err(misplaced(path, "this is a scene, not a job or a sensor file", help));
    }
    let mut report = Report::default();
    match report.open(path, Layer::Main) {
        Ok(source) => match tree::parse(&report, source) {
            Some(table) => Ok((report, table)),
            None => Err(Error::Config(report.into_diagnostics())),
        },
        Err(Unreadable::Reported) => Err(Error::Config(report.into_diagnostics())),
        Err(problem) => {
            let help = match problem {
                Unreadable::Missing => missing_file_help(&path.to_string_lossy(), path),
                _ => None,
            };
            Err(Error::Config(vec![Diagnostic::about_file(path, problem.to_string(), help)]))
        }
    }
}

fn into_job(mut report: Report, path: &Path, table: Table, overrides: &[String]) -> Result<Job, Error> {
    let job = job::job(&mut report, path, table, overrides);
    let found = report.into_diagnostics();
    job.map(|job| Job { warnings: found.clone(), ..job }).ok_or(Error::Config(found))
}

fn into_sensor(mut report: Report, path: &Path, mut table: Table) -> Result<SensorFile, Error> {
    let mut ray_files = rays::RayFiles::default();
    let mut all = vec![(None, table.clone())];
    presets::check_modes(&report, &table);
    for (name, mode) in presets::take_modes(&mut table) {
        let mut moded = table.clone();
        presets::lay_mode(&report, &mut moded, &mode);
        all.push((Some(name), moded));
    }
    for (_, table) in &all {
        ray_files.read(&mut report, table);
    }
    let span = Span::new(0, 0..0);
    let read = |table: &Table| {
        let section = section::Section::new(&report, &section::SENSOR_FILE, table, span);
        sensor::sensor(&report, &section, &ray_files, false)
    };
    let mut sensors =
        all.into_iter().map(|(name, table)| (name, read(&table))).collect::<Vec<_>>().into_iter();
    let sensor = sensors.next().and_then(|(_, sensor)| sensor).filter(|_| !report.has_errors());
    let modes = sensors.filter_map(|(name, sensor)| Some((name?, sensor?))).collect();
    let warnings = report.into_diagnostics();
    match sensor {
        Some(sensor) => Ok(SensorFile { path: path.to_path_buf(), sensor, modes, warnings }),
        None => Err(Error::Config(warnings)),
    }
}
