//! A job's text with everything that is laid over and under it, and with what is drawn in it.

use std::path::Path;

use super::super::job::Job;
use super::super::keys::job as keys;
use super::super::keys::motion;
use super::super::keys::random::RANDOM;
use super::super::overlay;
use super::super::table::{Grammar, Reading, Table};
use super::drawn::{Source, drawn};
use super::job::{Files, from_entries};
use super::pose_files::PoseFiles;
use super::preset::{lay_presets_under, name_lone_sensor};
use super::random;
use super::sensor_files::SensorFiles;
use crate::source::tree::{Entries, Value};
use crate::source::{Layer, Report, Span};

/// Reads the job in `entries`, which is the first text of the report, with its presets and the files that its sensors name. `None` if the
/// report has errors.
pub(in super::super) fn job(
    report: &mut Report,
    grammar: &Grammar,
    path: &Path,
    mut entries: Entries,
    overrides: &[String],
) -> Option<Job> {
    for pair in overrides {
        let source = report.add(Path::new("--set"), overlay::with_dots(pair), Layer::Override);
        if let Some(mut over) = overlay::parse_override(report, source) {
            overlay::address_lone_sensor(report, &entries, &mut over);
            name_lone_sensor(grammar, &mut entries, &over);
            overlay::lay_over(Reading { report, grammar }, &mut entries, over);
        }
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let presets = lay_presets_under(report, grammar, &mut entries, folder);
    let mut sensor_files = SensorFiles::default();
    if let Some(Value::Array(sensors)) = entries.get(keys::SENSORS.name()).map(|entry| &entry.node.value) {
        for sensor in sensors.iter().take(keys::MAX_SENSORS) {
            if let Value::Table(sensor) = &sensor.value {
                sensor_files.read(report, sensor);
            }
        }
    }
    let mut pose_files = PoseFiles::default();
    for trajectory in trajectories(&entries) {
        pose_files.read(report, trajectory);
    }
    let (report, files) = (&*report, Files { presets, sensor_files, pose_files });
    if !entries.contains_key(RANDOM.name()) {
        return from_entries(report, grammar, path, &entries, &files);
    }

    let draws = {
        let t = Table::new(Reading { report, grammar }, &keys::JOB, &entries, Span::new(0, 0..0));
        random::distributions(&t, &entries)
    };
    let base = from_entries(report, grammar, path, &entries, &files)?;
    let source = Source { entries, path: path.to_path_buf(), files, texts: report.texts() };
    drawn(report, base, source, draws)
}

/// The tables of trajectories of a job, before its keys are checked: the body's, then those of actors.
fn trajectories(job: &Entries) -> impl Iterator<Item = &Entries> {
    let actors = match job.get(motion::ACTORS.name()).map(|entry| &entry.node.value) {
        Some(Value::Array(actors)) => actors.as_slice(),
        _ => &[],
    };
    let actors = actors.iter().filter_map(|actor| match &actor.value {
        Value::Table(actor) => actor.get(motion::ACTOR_TRAJECTORY.name()),
        _ => None,
    });
    let all = job.get(keys::TRAJECTORY.name()).into_iter().chain(actors);
    all.filter_map(|entry| match &entry.node.value {
        Value::Table(trajectory) => Some(trajectory),
        _ => None,
    })
}
