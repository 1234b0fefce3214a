//! A job's tables → [`Job`].

use std::collections::BTreeMap;
use std::path::Path;

use super::super::job::{InputFile, Job, OutputSettings, Places};
use super::super::keys::job as keys;
use super::super::kinds::NumberOr;
use super::super::overlay;
use super::super::parse;
use super::super::plausibility;
use super::super::table::{Grammar, Reading, Table};
use super::preset::{lay_presets_under, name_lone_sensor};
use super::rays::RayFiles;
use super::{expect, rig};
use crate::check::{Settings, Tolerance};
use crate::frame::Pose;
use crate::motion::Trajectory;
use crate::output::{Channels, Format};
use crate::source::tree::{Entries, Value};
use crate::source::{Layer, Place, Report, Span, portable};

/// Reads the job in `entries`, which is the first text of the report, with its presets and tables of rays. `None` if the
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
    let mut ray_files = RayFiles::default();
    if let Some(Value::Array(sensors)) = entries.get(keys::SENSORS.name()).map(|entry| &entry.node.value) {
        for sensor in sensors.iter().take(keys::MAX_SENSORS) {
            if let Value::Table(sensor) = &sensor.value {
                ray_files.read(report, sensor);
            }
        }
    }
    let report = &*report;

    let t = Table::new(Reading { report, grammar }, &keys::JOB, &entries, Span::new(0, 0..0));
    let scene = t.read(&keys::SCENE);
    let scene_name = t.read(&keys::SCENE_NAME);
    let up = t.value(&keys::UP);
    let seed = t.value(&keys::SEED);
    let labels = t.read(&keys::LABELS).map_or(BTreeMap::new(), |labels| {
        labels.value.into_iter().map(|(name, label)| (name.to_owned(), label.value)).collect()
    });
    let trajectory = t.read(&keys::TRAJECTORY);
    let body_at = trajectory
        .as_ref()
        .filter(|t| t.value.has(&keys::BODY_POSE))
        .map(|t| t.value.span_of(&keys::BODY_POSE));
    let world_from_body = trajectory.map_or(Pose::IDENTITY, |t| rig::pose(&t.value, &keys::BODY_POSE));
    let kernel = t.read(&keys::TRACE).and_then(|t| t.value.value(&keys::KERNEL));
    let output = t.read(&keys::OUTPUT).and_then(|t| output(&t.value, folder));
    let rig::Rig { sensors, places: sensors_at, unposed } =
        rig::sensors(&t, &ray_files, &presets.lost, body_at);
    let check = t.read(&keys::CHECK).map(|t| settings(&t.value));
    let names: Vec<String> = sensors.iter().map(|sensor| sensor.name.clone()).collect();
    let (expectations, expectations_at) = expect::expectations(&t, &names);
    if let Some(scene) = &scene
        && let Some(doubt) = plausibility::home_folder(keys::SCENE.name(), scene.value)
    {
        report.doubt(scene.span, doubt);
    }
    if report.has_errors() {
        return None;
    }
    if let Some(span) = unposed {
        report.doubt(span, plausibility::no_pose());
    }
    let (output, formats_at) = output?;
    let at = |spans: Vec<Span>| spans.into_iter().map(|span| report.place(span)).collect();
    let places = Places {
        scene: scene.as_ref().map(|scene| report.place(scene.span)).unwrap_or_default(),
        sensors: at(sensors_at),
        tables: tables(&t),
        formats: at(formats_at),
        expectations: at(expectations_at),
    };
    let own_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut inputs = vec![InputFile::new(own_name, report.text(0))];
    inputs.extend(presets.inputs);
    inputs.extend(ray_files.inputs);
    Some(Job {
        path: path.to_path_buf(),
        scene_path: folder.join(scene?.value),
        scene_as_written: portable(scene?.value),
        scene_name: scene_name.map(|name| name.value.to_owned()),
        up,
        labels,
        seed,
        kernel,
        sensors,
        trajectory: Trajectory::Fixed(world_from_body),
        output,
        check,
        expectations,
        inputs,
        resolved: resolved(&entries),
        places,
        warnings: Vec::new(), // the owner of the report has them
    })
}

/// Where the table of each sensor is written.
fn tables(job: &Table<'_>) -> Vec<Place> {
    let Some(tables) = job.read(&keys::SENSORS) else { return Vec::new() };
    tables.value.iter().map(|table| job.report().place(table.span)).collect()
}

/// The merged job as JSON, without the places on this machine where its files are.
fn resolved(entries: &Entries) -> serde_json::Value {
    let mut job = parse::to_json(entries);
    let make_portable = |value: Option<&mut serde_json::Value>| {
        if let Some(serde_json::Value::String(path)) = value {
            *path = portable(path);
        }
    };
    make_portable(job.get_mut(keys::SCENE.name()));
    let sensors = job.get_mut(keys::SENSORS.name()).and_then(|sensors| sensors.as_array_mut());
    for sensor in sensors.into_iter().flatten() {
        make_portable(sensor.get_mut(keys::PRESET.name()));
    }
    if let Some(output) = job.get_mut(keys::OUTPUT.name()).and_then(|output| output.as_object_mut()) {
        output.shift_remove(keys::DIR.name());
    }
    job
}

fn output(t: &Table<'_>, folder: &Path) -> Option<(OutputSettings, Vec<Span>)> {
    let dir = t.read(&keys::DIR);
    if let Some(dir) = &dir
        && let Some(doubt) = plausibility::home_folder(keys::DIR.name(), dir.value)
    {
        t.report().doubt(dir.span, doubt);
    }
    let (formats, formats_at): (Vec<Format>, Vec<Span>) =
        t.value(&keys::FORMATS).into_iter().map(|format| (format.value, format.span)).unzip();
    // A default stands nowhere in the job.
    let formats_at = if t.has(&keys::FORMATS) { formats_at } else { vec![t.span; formats.len()] };
    let channels = t.read(&keys::CHANNELS);
    if let Some(channels) = &channels
        && t.has(&keys::FORMATS)
        && !formats.iter().any(|format| format.holds_channels())
    {
        t.report().doubt(channels.span, plausibility::channels_of_nothing());
    }
    let channels = channels.map_or(Channels::ALL, |channels| Channels::named(channels.value));
    let formats = formats.into_iter().map(|format| format.with_channels(channels)).collect();
    let cloud_frame = t.value(&keys::CLOUD_FRAME);
    let legend = t.value(&keys::LEGEND);
    Some((OutputSettings { dir: folder.join(dir?.value), formats, cloud_frame, legend }, formats_at))
}

/// The job's `[check]`.
fn settings(t: &Table<'_>) -> Settings {
    let channels = t.read(&keys::COMPARED);
    let channels = channels.map(|list| list.value.into_iter().map(str::to_owned).collect());
    let tolerance = |given: &NumberOr<'_>| match given {
        NumberOr::Number(absolute) => Tolerance { absolute: *absolute, ..Tolerance::default() },
        NumberOr::Table(t) => Tolerance {
            absolute: t.value(&keys::ABSOLUTE),
            relative: t.value(&keys::RELATIVE),
            pixels: t.value(&keys::PIXELS),
        },
    };
    let tolerances = t.read(&keys::TOLERANCES).map_or(BTreeMap::new(), |by_channel| {
        by_channel.value.iter().map(|(name, given)| ((*name).to_owned(), tolerance(&given.value))).collect()
    });
    Settings { channels, tolerances }
}
