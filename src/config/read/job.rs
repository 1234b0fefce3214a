//! A job's tables → [`Job`].

use std::collections::BTreeMap;
use std::path::Path;

use super::super::job::{
    Actor, InputFile, Job, Length, MountedSensor, OutputSettings, Places, Sequence, TruthSettings,
};
use super::super::keys::job as keys;
use super::super::keys::limits::MAX_FRAMES;
use super::super::keys::motion;
use super::super::kinds::NumberOr;
use super::super::parse;
use super::super::plausibility;
use super::super::table::{Grammar, Reading, Table};
use super::pose_files::PoseFiles;
use super::preset::Laid;
use super::sensor_files::SensorFiles;
use super::{actors, expect, rig, surroundings, trajectory};
use crate::check::{Settings, Tolerance};
use crate::frame::{Pose, UpAxis};
use crate::motion::Trajectory;
use crate::output::{Channels, CloudTime, Format};
use crate::sensor::Capture;
use crate::source::tree::Entries;
use crate::source::words::{number, quoted};
use crate::source::{Place, Report, Span, portable};

/// What a job takes from other files than its own and its scene.
#[derive(Debug)]
pub(super) struct Files {
    pub presets: Laid,
    pub sensor_files: SensorFiles,
    pub pose_files: PoseFiles,
}

/// Reads a job that is complete: with its presets, and with what is drawn. `None` if the report has errors.
pub(super) fn from_entries(
    report: &Report,
    grammar: &Grammar,
    path: &Path,
    entries: &Entries,
    files: &Files,
) -> Option<Job> {
    let Files { presets, sensor_files, pose_files } = files;
    let folder = path.parent().unwrap_or(Path::new(""));
    let t = Table::new(Reading { report, grammar }, &keys::JOB, entries, Span::new(0, 0..0));
    let scene = t.read(&keys::SCENE);
    let scene_name = t.read(&keys::SCENE_NAME);
    let up = t.value(&keys::UP);
    let seed = t.value(&keys::SEED);
    let labels = t.read(&keys::LABELS).map_or(BTreeMap::new(), |labels| {
        labels.value.into_iter().map(|(name, label)| (name.to_owned(), label.value)).collect()
    });
    let materials = surroundings::materials(&t);
    let body = t.read(&keys::TRAJECTORY).filter(|t| !t.value.is_empty());
    let body = body.map(|t| trajectory::of_body(&t.value, pose_files));
    let body_at = body.as_ref().map(|body| body.span);
    let sequence = t.read(&keys::SEQUENCE).map_or(ONE_FRAME, |t| sequence(&t.value));
    let kernel = t.read(&keys::TRACE).and_then(|t| t.value.value(&keys::KERNEL));
    let output = t.read(&keys::OUTPUT).and_then(|t| output(&t.value, folder));
    let rig::Rig { sensors, places: sensors_at, tables: tables_at, from_scene, unposed } =
        rig::sensors(&t, sensor_files, presets, body_at);
    let environment = surroundings::environment(&t);
    check_rates(report, &sequence, &sensors, &tables_at);
    let truth = truth(&t);
    let frames_of = |mounted: &MountedSensor| sequence.frames_of(&mounted.sensor);
    let lengths: Vec<(String, u64)> =
        sensors.iter().map(|mounted| (mounted.name.clone(), frames_of(mounted))).collect();
    let check = t.read(&keys::CHECK).map(|t| settings(&t.value, &lengths));
    let (expectations, expectations_at) = expect::expectations(&t, &lengths);
    let (actors, actors_at) = actors::actors(&t, pose_files, folder);
    report_what_cannot_be_placed(&t, up, &actors, &actors_at);
    let animation = actors::animation(&t);
    for given in body.iter().chain(&actors_at) {
        check_times(report, &sequence, &sensors, given);
    }
    let of_body = body.as_ref().and_then(|body| body.asked_of_scene(report));
    let from_scene = of_body.into_iter().chain(from_scene).collect();
    if let Some(scene) = &scene
        && let Some(doubt) = plausibility::home_folder(keys::SCENE.name(), scene.value)
    {
        report.doubt(scene.span, doubt);
    }
    if let Some(table) = t.read(&keys::SEQUENCE)
        && let Some((output, _)) = &output
        && let Some(doubt) = plausibility::compensation_of_nothing(&sequence, output.cloud_frame)
    {
        report.doubt(table.value.span_of(&keys::CLOUD_TIME), doubt);
    }
    if let Some(table) = t.read(&keys::TRUTH)
        && truth.masks
        && truth.boxes.is_none()
    {
        report.doubt(table.value.span_of(&keys::MASKS), plausibility::masks_of_nothing());
    }
    if report.has_errors() {
        return None;
    }
    surroundings::warn_of_no_effect(&t, &environment, &sensors);
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
    let mut inputs = vec![InputFile::new(own_name, report.text(0).as_bytes())];
    inputs.extend(presets.inputs.iter().chain(sensor_files.inputs()).chain(&pose_files.inputs).cloned());
    Some(Job {
        path: path.to_path_buf(),
        scene_path: folder.join(scene?.value),
        scene_as_written: portable(scene?.value),
        scene_name: scene_name.map(|name| name.value.to_owned()),
        up,
        labels,
        materials,
        environment,
        seed,
        kernel,
        sensors,
        trajectory: body.map_or(Trajectory::Fixed(Pose::IDENTITY), |body| body.trajectory),
        actors,
        animation,
        from_scene,
        sequence,
        output,
        truth,
        check,
        expectations,
        inputs,
        resolved: resolved(entries),
        drawn: serde_json::Map::new(),
        frame: None,
        by_frame: None,
        places,
        warnings: Vec::new(), // the owner of the report has them
    })
}

/// Reports places that can't be drawn because of what else the job says.
fn report_what_cannot_be_placed(t: &Table<'_>, up: UpAxis, actors: &[Actor], at: &[trajectory::Given]) {
    let placed =
        || actors.iter().zip(at).filter_map(|(actor, at)| Some((actor, actor.placing.as_ref()?, at.span)));
    if up == UpAxis::Y && placed().next().is_some() {
        let message =
            "with `up = \"y\"` the scene does not stand upright, and a place is drawn for what does";
        let help = "leave `up` out: z is up in the world then".to_owned();
        t.report().error(t.span_of(&keys::UP), message, "expected \"z\"", Some(help));
    }
    let mut of_frame = None;
    for (actor, placing, span) in placed() {
        match of_frame {
            _ if !placing.is_of_run => of_frame = of_frame.or(Some(&actor.name)),
            None => {}
            Some(before) => {
                let message = format!(
                    "the place of {} is drawn once, and that of {} before it for each frame",
                    quoted(&actor.name),
                    quoted(before)
                );
                let help = "put the actors with `per = \"run\"` first: a place keeps clear of those that are drawn before it";
                t.report().error(span, message, "", Some(help.to_owned()));
                return;
            }
        }
    }
}

/// Where the table of each sensor is written.
fn tables(job: &Table<'_>) -> Vec<Place> {
    let Some(tables) = job.read(&keys::SENSORS) else { return Vec::new() };
    tables.value.iter().map(|table| job.report().place(table.span)).collect()
}

/// How far a frame may reach beyond the poses, in seconds: the decimals of times are rounded.
const TIMES_TO_S: f64 = 1e-9;

/// The times of a sensor's frames.
struct Frames<'s> {
    name: &'s str,
    count: u64,
    /// Seconds from the sequence's start to that of frame 0.
    lead_s: f64,
    /// Seconds from a frame's start to its last pulse.
    takes_s: f64,
    /// Seconds from one frame's start to the next one's; 0 of a sensor without a rate.
    step_s: f64,
}

/// Reports frames of a moving body that reach beyond the times at which its poses are known, with those that would not.
fn check_times(report: &Report, sequence: &Sequence, sensors: &[MountedSensor], given: &trajectory::Given) {
    let Some((first_s, last_s)) = given.trajectory.times() else { return };
    let frames = sensors.iter().map(|MountedSensor { name, sensor, body_from_sensor, trigger_s, .. }| {
        let [zero, one] = [0, 1].map(|frame| {
            let capture = Capture::new(sensor, *body_from_sensor, &given.trajectory, frame, 0);
            capture.in_sequence(*trigger_s, sequence.is_frozen)
        });
        Frames {
            name,
            count: sequence.frames_of(sensor),
            lead_s: zero.start_s,
            takes_s: zero.window().to_s - zero.start_s,
            step_s: one.start_s - zero.start_s,
        }
    });
    let frames: Vec<Frames<'_>> = frames.collect();
    let ends = |frames: &Frames<'_>| {
        let start = sequence.start_s + frames.lead_s;
        (start, start + frames.step_s * frames.count.saturating_sub(1) as f64 + frames.takes_s)
    };
    let is_outside = |frames: &&Frames<'_>| {
        let (start, end) = ends(frames);
        start < first_s - TIMES_TO_S || end > last_s + TIMES_TO_S
    };
    let Some(outside) = frames.iter().find(is_outside) else { return };
    let (from, to) = ends(outside);
    // Sums of decimals have digits that no one wrote.
    let shown = |time_s: f64| number((time_s * 1e6).round() / 1e6);
    let [from, to, first, last] = [from, to, first_s, last_s].map(shown);
    let name = quoted(outside.name);
    let message =
        format!("the frames of {name} go from {from} s to {to} s, and the poses from {first} s to {last} s");
    // The start that is given if there are poses for a frame from there, else the earliest one; then the frames that fit.
    let earliest = frames.iter().map(|frames| first_s - frames.lead_s).fold(f64::NEG_INFINITY, f64::max);
    let fitting = |start: f64| {
        let of_sensor =
            |frames: &Frames<'_>| match last_s + TIMES_TO_S - (start + frames.lead_s + frames.takes_s) {
                room if room < 0.0 => 0,
                room if frames.step_s > 0.0 => {
                    ((room / frames.step_s) as u64).saturating_add(1).min(frames.count)
                }
                _ => frames.count,
            };
        frames.iter().map(of_sensor).min().unwrap_or(0)
    };
    let starts = [sequence.start_s.max(earliest), earliest].map(|start| (start, fitting(start)));
    let help = match starts.into_iter().find(|(_, frames)| *frames > 0) {
        Some((start, frames)) => {
            format!("`[sequence]` with `start_s = {start:?}` and `frames = {frames}` would do")
        }
        None => {
            let takes = shown(frames.iter().map(|frames| frames.takes_s).fold(0.0, f64::max));
            format!("a frame takes {takes} s, for which there must be poses from its start to its end")
        }
    };
    report.error(given.span, message, "expected poses at all of these times", Some(help));
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
    let make_trajectory_portable = |trajectory: Option<&mut serde_json::Value>| {
        if let Some(trajectory) = trajectory {
            make_portable(trajectory.get_mut(motion::FILE.name()));
            make_portable(trajectory.get_mut(motion::TIMES.name()));
        }
    };
    make_trajectory_portable(job.get_mut(keys::TRAJECTORY.name()));
    let actors = job.get_mut(motion::ACTORS.name()).and_then(|actors| actors.as_array_mut());
    for actor in actors.into_iter().flatten() {
        make_portable(actor.get_mut(motion::ACTOR_SCENE.name()));
        make_trajectory_portable(actor.get_mut(motion::ACTOR_TRAJECTORY.name()));
    }
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
    let channels = channels.map_or(Channels::USUAL, |channels| Channels::named(channels.value));
    let terms = t.value(&keys::TERMS);
    let with_terms = |format: Format| if terms { format.with_terms() } else { format };
    let formats = formats.into_iter().map(|format| with_terms(format.with_channels(channels))).collect();
    let cloud_frame = t.value(&keys::CLOUD_FRAME);
    let legend = t.value(&keys::LEGEND);
    Some((OutputSettings { dir: folder.join(dir?.value), formats, cloud_frame, legend }, formats_at))
}

/// The sequence of a job that asks for none.
const ONE_FRAME: Sequence = Sequence {
    length: Length::Frames(1),
    start_s: 0.0,
    is_frozen: false,
    cloud_time: CloudTime::Raw,
    slice_s: None,
};

fn sequence(t: &Table<'_>) -> Sequence {
    let duration = t.read(&keys::DURATION);
    if let (true, Some(duration)) = (t.has(&keys::FRAMES), &duration) {
        let message = "a sequence has one length, and this has both `frames` and `duration_s`";
        t.report().error(
            t.report().later(duration.span, t.span_of(&keys::FRAMES)),
            message,
            "one too many",
            None,
        );
    }
    Sequence {
        length: duration
            .map_or(Length::Frames(t.value(&keys::FRAMES)), |given| Length::Duration(given.value)),
        start_s: t.value(&keys::START),
        is_frozen: t.value(&keys::MOTION),
        cloud_time: t.value(&keys::CLOUD_TIME),
        slice_s: t.read(&keys::SLICE).map(|slice| slice.value),
    }
}

/// Reports the sensors whose frames would have no times, or would be too many.
fn check_rates(report: &Report, sequence: &Sequence, sensors: &[MountedSensor], tables: &[Span]) {
    for (MountedSensor { name, sensor, .. }, &table) in sensors.iter().zip(tables) {
        let name = quoted(name);
        let slices = Capture::at_origin(sensor).window().slices(sequence.slice_s);
        if slices > keys::MAX_SLICES {
            let message = format!("a frame of sensor {name} would have {slices} slices");
            let label =
                format!("expected a `slice_s` in `[sequence]` that gives it at most {}", keys::MAX_SLICES);
            report.error(table, message, label, None);
        }
        let needed_for = match sequence.length {
            Length::Frames(1) => continue,
            Length::Frames(frames) => format!("{frames} frames"),
            Length::Duration(duration_s) => format!("{duration_s} s"),
        };
        if sensor.pattern.rate_hz().is_none() {
            let message =
                format!("sensor {name} has no rate, so a sequence of {needed_for} gives its frames no times");
            let help = "give its pattern `rate_hz = 10.0`, the frames a second".to_owned();
            report.error(table, message, "expected a key `rate_hz` in the table of its pattern", Some(help));
            continue;
        }
        let frames = sequence.frames_of(sensor);
        if frames > MAX_FRAMES {
            let message = format!("sensor {name} would have {frames} frames in {needed_for}");
            report.error(table, message, format!("expected at most {} frames", MAX_FRAMES), None);
        }
    }
}

/// The job's `[truth]`, which a job with a sequence has some of even without the table.
fn truth(job: &Table<'_>) -> TruthSettings {
    let is_sequence = job.has(&keys::SEQUENCE);
    let Some(t) = job.read(&keys::TRUTH) else {
        return TruthSettings { poses: is_sequence, ..TruthSettings::default() };
    };
    let t = t.value;
    TruthSettings {
        poses: t.read(&keys::POSES).map_or(is_sequence, |poses| poses.value),
        boxes: t.value(&keys::BOXES),
        masks: t.value(&keys::MASKS),
        visible: t.value(&keys::VISIBLE),
    }
}

/// The job's `[check]`. `lengths` are the names of the sensors, each with the number of its frames.
fn settings(t: &Table<'_>, lengths: &[(String, u64)]) -> Settings {
    let frames = t.read(&keys::COMPARED_FRAMES).map(|list| list.value);
    let longest = lengths.iter().map(|(_, frames)| *frames).max();
    for frame in frames.iter().flatten() {
        if let Some(longest) = longest.filter(|longest| frame.value >= *longest) {
            let message = format!("there is no frame {}", frame.value);
            let label = format!("expected a frame from 0 to {}", longest.saturating_sub(1));
            t.report().error(frame.span, message, label, None);
        }
    }
    let frames = frames.map(|list| list.into_iter().map(|frame| frame.value).collect());
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
    Settings { channels, tolerances, frames }
}
