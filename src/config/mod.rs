//! Jobs and sensor files: TOML → domain types. The TOML itself stays private, and every error points into the file.
//!
//! ```text
//! parse       TOML as a tree of values with spans
//! table       a key's declaration, and the reading of a table by its keys
//! kinds       the kinds of values that keys have
//! foreign     keys that people bring from other programs, and the answer to each
//! keys/       every key, each declared once
//! overlay     layers: a preset, the job over it, `--set` over both
//! read/       tables → jobs and sensors
//! plausibility  values that are valid and probably not what was meant
//! job         jobs and sensor files as they are read
//! draw        values that are drawn at random
//! presets     the built-in sensors; library: surfaces whose reflectance was measured
//! schema      the keys as JSON Schema; reference: as a page of Markdown; starter: as a commented job
//! drive       a complete drive to start from, with its scenes
//! ```

mod draw;
mod drive;
mod foreign;
mod job;
pub(crate) mod keys;
mod kinds;
mod library;
mod overlay;
mod parse;
mod plausibility;
pub mod presets;
mod read;
mod reference;
mod schema;
mod starter;
mod table;
#[cfg(test)]
mod tests;

use std::path::Path;

use crate::error::Error;
use crate::source::tree::Entries;
use crate::source::words::{harmless_json, quoted};
use crate::source::{Diagnostic, FileKind, Layer, Report, Severity, Unreadable, Wanted, recognise};

pub use drive::{DRIVE_JOB, starter_drive};
pub use job::{
    Actor, ActorBody, Animation, Config, DataSheet, FromScene, InScene, InputFile, Job, Length,
    MountedSensor, Nominal, OutputSettings, Owner, Places, Placing, SensorFile, Sequence, SurfaceName,
    TruthSettings,
};
use keys::GRAMMAR;
use keys::job::JOB;
use keys::sensor::SENSOR_FILE;
pub(crate) use starter::comment;

/// Reads a job with its sensor files. `overrides` are `key=value` pairs of `--set`, which win over the files: dotted keys
/// as in TOML, with an index or a sensor's name where the job has a list (`sensor.top.range.max_m=50`), and a TOML value
/// or a string without quotes.
///
/// # Errors
/// [`Error::Config`] with every problem of all the files, warnings too, file by file from top to bottom.
pub fn load_job(path: &Path, overrides: &[String]) -> Result<Job, Error> {
    let (report, entries) = open(path)?;
    if is_sensor_file(&entries) {
        let help = "a job is a TOML file that names it as the `preset` of a `[[sensor]]`".to_owned();
        return Err(misplaced(path, "this is a sensor file, not a job", help));
    }
    into_job(report, path, entries, overrides)
}

/// Reads a sensor file on its own.
///
/// # Errors
/// [`Error::Config`] with every problem of the file, warnings too, from top to bottom.
pub fn load_sensor(path: &Path) -> Result<SensorFile, Error> {
    let (report, entries) = open(path)?;
    into_sensor(report, path, entries)
}

/// Reads a built-in sensor by its name, such as `ouster/os1-128`.
///
/// # Errors
/// [`Error::Config`] if there is none of that name; the error suggests near names.
pub fn load_preset(name: &str) -> Result<SensorFile, Error> {
    let path = Path::new(name);
    let Some(text) = presets::text(name) else {
        let message = format!("there is no built-in sensor {}", quoted(name));
        return Err(Error::Config(vec![Diagnostic::about_file(path, message, presets::near_name(name))]));
    };
    let mut report = Report::default();
    let source = report.add(path, text.to_owned(), Layer::Main);
    match parse::parse(&report, source) {
        Some(entries) => into_sensor(report, path, entries),
        None => Err(Error::Config(report.into_diagnostics())),
    }
}

/// The first reason why a sensor file of this text would be refused. `None` if it would be read. The text must name no other
/// file.
pub(crate) fn problem_of_sensor(text: &str) -> Option<String> {
    sensor_of_text(text).err().map(problem_in)
}

/// The sensor of a text that names no other file.
fn sensor_of_text(text: &str) -> Result<SensorFile, Error> {
    let path = Path::new("sensor.toml");
    let mut report = Report::default();
    let source = report.add(path, text.to_owned(), Layer::Main);
    match parse::parse(&report, source) {
        Some(entries) => into_sensor(report, path, entries),
        None => Err(Error::Config(report.into_diagnostics())),
    }
}

/// The sensor of a manifest's job, a table with the keys of `[[sensor]]` and those of the sensor's file. Anybody may have written it,
/// and no file is opened because of it.
///
/// # Errors
/// A sentence about the first problem.
pub(crate) fn recorded_sensor(table: &serde_json::Value) -> Result<SensorFile, String> {
    fn names_file(value: &serde_json::Value) -> bool {
        match value {
            serde_json::Value::Object(table) => {
                table.iter().any(|(key, value)| key == "file" || names_file(value))
            }
            serde_json::Value::Array(values) => values.iter().any(names_file),
            _ => false,
        }
    }
    let table = table.as_object().ok_or("it is no table")?;
    // What they lead to is in the other keys.
    let is_settled = |key: &str| ["modes", "nominal"].contains(&key);
    let is_of_file = |key: &str| !is_settled(key) && SENSOR_FILE.names().any(|name| name == key);
    let of_file = table.iter().filter(|(key, _)| is_of_file(key));
    let of_file: serde_json::Map<String, serde_json::Value> =
        of_file.map(|(key, value)| (key.clone(), value.clone())).collect();
    let of_file = serde_json::Value::from(of_file);
    if names_file(&of_file) {
        return Err("it is of a table in a file, which the manifest does not have".to_owned());
    }
    let text = toml::to_string(&of_file).map_err(|e| e.to_string())?;
    sensor_of_text(&text).map_err(problem_in)
}

/// The first problem of a text, in words.
fn problem_in(error: Error) -> String {
    match error {
        Error::Config(found) => {
            let error = found.iter().find(|d| d.severity == Severity::Error).or(found.first());
            error.map_or_else(String::new, |error| error.message.clone())
        }
        other => other.to_string(),
    }
}

/// Reads a job or a sensor file, whichever the file is: a sensor file has a pattern, and no key of a job. A job is read
/// with `overrides` as [`load_job`] has them; a sensor file has none.
///
/// # Errors
/// [`Error::Config`] as for [`load_job`] and [`load_sensor`].
pub fn load(path: &Path, overrides: &[String]) -> Result<Config, Error> {
    let (report, entries) = open(path)?;
    if is_sensor_file(&entries) {
        into_sensor(report, path, entries).map(|sensor| Config::Sensor(Box::new(sensor)))
    } else {
        into_job(report, path, entries, overrides).map(|job| Config::Job(Box::new(job)))
    }
}

/// A kind of file that has a schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Document {
    /// A job.
    Job,
    /// A sensor file.
    Sensor,
}

/// The JSON Schema (draft-07) of a kind of file.
pub fn schema(document: Document) -> serde_json::Value {
    match document {
        Document::Job => schema::document("beamcast job", &JOB),
        Document::Sensor => schema::document("beamcast sensor file", &SENSOR_FILE),
    }
}

/// The reference page of all keys of jobs and sensor files, in Markdown.
pub fn reference() -> String {
    reference::page(&GRAMMAR, reference::INTRODUCTION)
}

/// A commented job to start from, which casts the beams of a preset at a scene. Both are named as the job shall name them.
pub fn starter_job(scene: &str, preset: &str) -> String {
    let values = [(keys::job::SCENE.name(), scene), (keys::job::PRESET.name(), preset)];
    let values = values.map(|(name, text)| (name, toml_string(text)));
    let values = values.each_ref().map(|(name, value)| (*name, value.as_str()));
    format!("{}{}", starter::INTRODUCTION, starter::text(&JOB, &values))
}

/// A text as TOML writes it, with its quotes, on one line.
pub(crate) fn toml_string(text: &str) -> String {
    // The escapes of JSON are TOML's.
    harmless_json(&serde_json::Value::from(text).to_string())
}

fn is_sensor_file(entries: &Entries) -> bool {
    entries.keys().any(|key| read::is_pattern(key)) && !JOB.names().any(|key| entries.contains_key(key))
}

/// An error about a file that is fine, but not where it was given.
fn misplaced(path: &Path, message: &str, help: String) -> Error {
    Error::Config(vec![Diagnostic::about_file(path, message.to_owned(), Some(help))])
}

fn open(path: &Path) -> Result<(Report, Entries), Error> {
    let mut report = Report::default();
    match report.open(path, Layer::Main) {
        Ok(source) => match parse::parse(&report, source) {
            Some(entries) if !entries.is_empty() => Ok((report, entries)),
            parsed => {
                let text = report.text(source);
                match (other_kind(FileKind::of(text.as_bytes(), text.len() as u64), path), parsed) {
                    (Some(error), _) => Err(error),
                    (None, Some(entries)) => Ok((report, entries)),
                    (None, None) => Err(Error::Config(report.into_diagnostics())),
                }
            }
        },
        Err(problem) => {
            // A file that is no text, or too large for a job, is probably of another kind.
            if let Some(error) = recognise(path).ok().and_then(|kind| other_kind(kind, path)) {
                return Err(error);
            }
            if matches!(problem, Unreadable::Reported) {
                return Err(Error::Config(report.into_diagnostics()));
            }
            let help = problem.help(&path.to_string_lossy(), path);
            Err(Error::Config(vec![Diagnostic::about_file(path, problem.to_string(), help)]))
        }
    }
}

/// The error that a file is of another kind than TOML, if its content says of which.
fn other_kind(kind: FileKind, path: &Path) -> Option<Error> {
    let is_known = !kind.is_config() && !kind.is_unknown();
    is_known.then(|| {
        let (message, help) = kind.instead_of(Wanted::Config);
        Error::Config(vec![Diagnostic::about_file(path, message, help)])
    })
}

fn into_job(mut report: Report, path: &Path, entries: Entries, overrides: &[String]) -> Result<Job, Error> {
    let job = read::layers::job(&mut report, &GRAMMAR, path, entries, overrides);
    let found = report.into_diagnostics();
    job.map(|job| Job { warnings: found.clone(), ..job }).ok_or(Error::Config(found))
}

fn into_sensor(mut report: Report, path: &Path, entries: Entries) -> Result<SensorFile, Error> {
    let file = read::sensor_file::sensor_file(&mut report, &GRAMMAR, path, entries);
    let found = report.into_diagnostics();
    file.map(|file| SensorFile { warnings: found.clone(), ..file }).ok_or(Error::Config(found))
}
