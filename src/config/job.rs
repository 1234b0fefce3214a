//! A job's tables → [`Job`], its sensors' files laid under what the job says about them.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;

use super::presets;
use super::rays::RayFiles;
use super::section::{self, Section};
use super::tree::{self, Entry, Node, Table, Value};
use super::{InputFile, Job, MountedSensor, OutputSettings, check, sensor};
use crate::angle::Angle;
use crate::frame::{Pose, UpAxis};
use crate::motion::Trajectory;
use crate::output::{CloudFrame, Format};
use crate::source::suggest::{missing_file_help, quoted};
use crate::source::{Layer, Report, Span, Spanned, Unreadable, portable};
use crate::trace::methods::{METHODS, Method};

/// Most sensors of a rig.
const MAX_SENSORS: usize = 64;

/// Most beams of all sensors: a short file can ask for very many.
const MAX_BEAMS: usize = 2_000_000;

/// Most text that a job's sensors take from their files, each counted as often as it is used.
const MAX_PRESET_BYTES: usize = 8 << 20;

/// A sensor file that was read.
struct Preset {
    as_written: String,
    source: u32,
    table: Table,
}

/// Reads the job in `table`. `None` if the report has errors.
pub(super) fn job(report: &mut Report, path: &Path, mut table: Table, overrides: &[String]) -> Option<Job> {
    for pair in overrides {
        let source = report.add(Path::new("--set"), pair.clone(), Layer::Override);
        if let Some(over) = tree::parse_override(report, source) {
            name_lone_sensor(&mut table, &over);
            tree::lay_over(report, &mut table, over);
        }
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let (presets, lost) = lay_presets_under(report, &mut table, folder);
    let mut ray_files = RayFiles::default();
    if let Some(Value::Array(sensors)) = table.get("sensor").map(|entry| &entry.node.value) {
        for sensor in sensors.iter().take(MAX_SENSORS) {
            if let Value::Table(sensor) = &sensor.value {
                ray_files.read(report, sensor);
            }
        }
    }
    let report = &*report;

    let root = Span::new(0, 0..0);
    let top = Section::new(report, &section::JOB, &table, root);
    top.need("scene", "`scene = \"../scenes/room.glb\"`, a glTF file");
    top.need("sensor", "a `[[sensor]]`");
    top.need("output", "`[output]` with `dir = \"../out\"`");
    let scene = top.text("scene");
    let scene_name = top.text("scene_name");
    let up = top.choice("up", &[("z", UpAxis::Z), ("y", UpAxis::Y)]);
    let seed = top.integer("seed", 0, u64::MAX);
    let labels = labels(report, &top);
    let world_from_body = top
        .section("trajectory", &section::TRAJECTORY)
        .map_or(Pose::IDENTITY, |trajectory| pose(report, &trajectory));
    let trajectory = Trajectory::Fixed(world_from_body);
    let kernel = top.section("trace", &section::TRACE).and_then(|s| kernel(&s));
    let output = top.section("output", &section::OUTPUT).and_then(|s| output(&s, folder));
    let sensors = sensors(report, &top, &ray_files, &lost);
    let check = check::settings(report, &top);
    let names: Vec<String> = sensors.iter().map(|sensor| sensor.name.clone()).collect();
    let expectations = check::expectations(report, &top, &names);
    if report.has_errors() {
        return None;
    }
    let scene_as_written = portable(scene?.value);
    Some(Job {
        path: path.to_path_buf(),
        scene_path: folder.join(scene?.value),
        scene_as_written,
        scene_name: scene_name.map(|name| name.value.to_owned()),
        up: up.unwrap_or_default(),
        labels,
        seed: seed.map_or(0, |seed| seed.value),
        kernel,
        sensors,
        trajectory,
        output: output?,
        check,
        expectations,
        file: InputFile::new(
            path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            report.text(0),
        ),
        sensor_files: presets
            .into_iter()
            .map(|p| (portable(&p.as_written), report.text(p.source).to_owned()))
            .collect(),
        ray_files: ray_files.files,
        resolved: resolved(&table),
        warnings: Vec::new(), // the report's owner has them
    })
}

/// The merged job as JSON: what it does, and not where on this machine its files are.
fn resolved(table: &Table) -> serde_json::Value {
    let mut job = tree::to_json(table);
    let make_portable = |value: Option<&mut serde_json::Value>| {
        if let Some(serde_json::Value::String(path)) = value {
            *path = portable(path);
        }
    };
    make_portable(job.get_mut("scene"));
    for sensor in job.get_mut("sensor").and_then(|s| s.as_array_mut()).into_iter().flatten() {
        make_portable(sensor.get_mut("preset"));
    }
    if let Some(output) = job.get_mut("output").and_then(|o| o.as_object_mut()) {
        output.shift_remove("dir");
    }
    job
}

/// Writes down the name of a sensor that needs none, if an override addresses it by that.
fn name_lone_sensor(table: &mut Table, over: &Table) {
    let addressed = matches!(over.get("sensor").map(|s| &s.node.value),
        Some(Value::Table(s)) if s.contains_key(LONE_NAME));
    if let Some(entry) = table.get_mut("sensor").filter(|_| addressed)
        && let Value::Array(sensors) = &mut entry.node.value
        && let [Node { span, value: Value::Table(sensor) }] = sensors.as_mut_slice()
        && !sensor.contains_key("name")
    {
        let name = Node { span: *span, value: Value::String(LONE_NAME.to_owned()) };
        sensor.insert("name".to_owned(), Entry { key: *span, node: name });
    }
}

/// What the only sensor of a job is called if it has no name.
const LONE_NAME: &str = "sensor";

/// Lays every sensor over the file that it names as its preset. Returns the files, in the job's order, each once, and the
/// indices of the sensors that lack what a file should have given.
fn lay_presets_under(report: &mut Report, job: &mut Table, folder: &Path) -> (Vec<Preset>, Vec<usize>) {
    let mut presets: Vec<Preset> = Vec::new();
    let mut lost = Vec::new();
    let mut bytes = 0;
    let Some(Value::Array(sensors)) = job.get_mut("sensor").map(|entry| &mut entry.node.value) else {
        return (presets, lost);
    };
    for (index, node) in sensors.iter_mut().enumerate().take(MAX_SENSORS) {
        let Value::Table(sensor) = &mut node.value else { continue };
        let Some(Entry { node: Node { span, value }, .. }) = sensor.get("preset") else { continue };
        let preset = match value {
            Value::String(as_written) => open_preset(report, &mut presets, folder, as_written, *span),
            _ => None, // reported when it's read
        };
        let Some(preset) = preset else {
            lost.push(index);
            continue;
        };
        let used = bytes;
        bytes += report.text(preset.source).len();
        if bytes > MAX_PRESET_BYTES {
            if used <= MAX_PRESET_BYTES {
                let message =
                    format!("the job's sensors take more than {MAX_PRESET_BYTES} bytes from their files");
                report.error(*span, message, "too much from here on", None);
            }
            lost.push(index);
            continue;
        }
        let mut merged = preset.table.clone();
        for key in MOUNTING {
            merged.remove(*key);
        }
        let modes = presets::take_modes(&mut merged);
        if let Some(mode) = sensor.get("mode") {
            presets::choose_mode(report, &mut merged, modes, &mode.node);
        }
        tree::lay_over(report, &mut merged, std::mem::take(sensor));
        *sensor = merged;
    }
    for index in &lost {
        if let Value::Table(sensor) = &mut sensors[*index].value {
            // Half a pattern would only be reported for what the file may well have.
            sensor.retain(|key, _| !sensor::pattern_names().any(|name| name == key));
        }
    }
    (presets, lost)
}

/// The sensor file that a job calls `as_written` at `span`, read now or before.
fn open_preset<'a>(
    report: &mut Report,
    presets: &'a mut Vec<Preset>,
    folder: &Path,
    as_written: &str,
    span: Span,
) -> Option<&'a Preset> {
    if as_written.is_empty() {
        return None; // reported when it's read
    }
    if let Some(known) = presets.iter().position(|preset| preset.as_written == as_written) {
        return presets.get(known);
    }
    let path = folder.join(as_written);
    let opened = if presets::is_file(as_written) {
        report.open(&path, Layer::Preset)
    } else {
        match presets::text(as_written) {
            Some(text) => Ok(report.add(Path::new(as_written), text.to_owned(), Layer::Preset)),
            None => {
                presets::report_unknown(report, as_written, span, &path);
                return None;
            }
        }
    };
    match opened {
        Ok(source) => {
            let table = tree::parse(report, source)?;
            refuse_mounting(report, &table);
            presets::check_modes(report, &table);
            presets.push(Preset { as_written: as_written.to_owned(), source, table });
            presets.last()
        }
        Err(Unreadable::Reported) => None,
        Err(problem) => {
            let help = match problem {
                Unreadable::Missing => missing_file_help(as_written, &path),
                _ => None,
            };
            let message = format!("the sensor file {} can't be used", quoted(as_written));
            report.error(span, message, problem.to_string(), help);
            None
        }
    }
}

/// Keys of a job's `[[sensor]]` that say where it is, not what it is.
const MOUNTING: &[&str] = &["name", "preset", "mode", "pose"];

fn refuse_mounting(report: &Report, sensor_file: &Table) {
    for key in MOUNTING {
        if let Some(entry) = sensor_file.get(*key) {
            let message = format!("unknown key `{key}` in a sensor file");
            report.error(entry.key, message, "", Some(format!("`{key}` belongs in the job's `[[sensor]]`")));
        }
    }
}

fn labels(report: &Report, top: &Section<'_>) -> BTreeMap<String, u32> {
    let mut labels = BTreeMap::new();
    match top.get("labels") {
        Some(Node { value: Value::Table(table), .. }) => {
            for (name, entry) in table {
                let label = section::integer(report, name, &entry.node, 0, u64::from(u32::MAX));
                if let Some(label) = label.and_then(|label| u32::try_from(label.value).ok()) {
                    labels.insert(name.clone(), label);
                }
            }
        }
        Some(node) => {
            let message = format!("`labels` is {}", section::describe(&node.value));
            let label = "expected a table of node or material names, each with a whole number";
            report.error(node.span, message, label, Some("such as `[labels]`, then `wall = 3`".into()));
        }
        None => {}
    }
    labels
}

/// The `pose` of a table, or the identity.
fn pose(report: &Report, table: &Section<'_>) -> Pose {
    let Some(s) = table.section("pose", &section::POSE) else {
        return Pose::IDENTITY;
    };
    let position = s.vector::<3>("position_m", "x, y, z");
    let rpy = s.vector::<3>("rpy_deg", "roll, pitch, yaw");
    let quaternion = s.vector::<4>("quaternion_xyzw", "x, y, z, w");
    let translation = position.map_or(DVec3::ZERO, |p| DVec3::from_array(p.value));
    if let (Some(rpy), Some(quaternion)) = (rpy, quaternion) {
        let message = "a pose has one rotation, and this has both `rpy_deg` and `quaternion_xyzw`";
        report.error(report.later(quaternion.span, rpy.span), message, "one too many", None);
    }
    if let Some(q) = quaternion {
        return quaternion_pose(report, translation, q).unwrap_or(Pose::IDENTITY);
    }
    let [roll, pitch, yaw] = rpy.map_or([0.0; 3], |rpy| rpy.value).map(Angle::deg);
    Pose::from_rpy(translation, roll, pitch, yaw)
}

fn quaternion_pose(report: &Report, translation: DVec3, q: Spanned<[f64; 4]>) -> Option<Pose> {
    let made = Pose::from_quaternion(translation, q.value);
    let length = q.value.iter().map(|x| x * x).sum::<f64>().sqrt();
    if made.is_none() {
        let message = format!("a quaternion of length {length} is no rotation");
        let help = "`[0.0, 0.0, 0.0, 1.0]` turns by nothing";
        report.error(q.span, message, "expected x, y, z, w of length 1", Some(help.into()));
    } else if (length - 1.0).abs() > 1e-3 {
        let message = format!("a quaternion of length {length:.6}, which is normalised");
        report.warning(q.span, message, "expected x, y, z, w of length 1", None);
    }
    made
}

/// The published method that is to decide; the exact definition goes by a name of its own.
fn kernel(s: &Section<'_>) -> Option<&'static Method> {
    let methods = METHODS.iter().map(|method| (method.about.name, Some(method)));
    let all: Vec<_> = [("exact", None)].into_iter().chain(methods).collect();
    s.choice("kernel", &all).flatten()
}

fn output(s: &Section<'_>, folder: &Path) -> Option<OutputSettings> {
    s.need("dir", "`dir = \"../out\"`, the folder to write to");
    let dir = s.text("dir");
    let all: Vec<_> = Format::all().map(|format| (format.name(), format)).collect();
    let formats = s.choices("formats", &all);
    let frames = [("sensor", CloudFrame::Sensor), ("body", CloudFrame::Body), ("world", CloudFrame::World)];
    let cloud_frame = s.choice("frame", &frames).unwrap_or_default();
    Some(OutputSettings {
        dir: folder.join(dir?.value),
        formats: formats.unwrap_or_else(|| Format::all().collect()),
        cloud_frame,
    })
}

/// The rig; the patterns of those in `lost` are in files that were reported.
fn sensors(report: &Report, top: &Section<'_>, ray_files: &RayFiles, lost: &[usize]) -> Vec<MountedSensor> {
    let help = || Some("write `[[sensor]]`, with two brackets, before each sensor's keys".to_owned());
    let nodes = match top.get("sensor") {
        None => return Vec::new(),
        Some(Node { value: Value::Array(nodes), .. }) => nodes,
        Some(node) => {
            let message = format!("`sensor` is {}", section::describe(&node.value));
            report.error(node.span, message, "expected a list of tables", help());
            return Vec::new();
        }
    };
    if let Some(node) = nodes.get(MAX_SENSORS) {
        let message = format!("the job has {} sensors", nodes.len());
        report.error(node.span, message, format!("expected at most {MAX_SENSORS}"), None);
        return Vec::new();
    } else if nodes.is_empty()
        && let Some(node) = top.get("sensor")
    {
        report.error(node.span, "the job has no sensors", "expected at least one", help());
    }
    let mut taken = BTreeMap::new();
    let mut mounted = Vec::new();
    let mut beams = 0;
    for (index, node) in nodes.iter().enumerate() {
        let Value::Table(table) = &node.value else {
            let message = format!("a sensor is {}", section::describe(&node.value));
            report.error(node.span, message, "expected a table", help());
            continue;
        };
        let s = Section::new(report, &section::SENSOR, table, node.span);
        s.text("preset");
        let name = sensor_name(report, &s, nodes.len() == 1, &mut taken);
        let body_from_sensor = pose(report, &s);
        s.text("mode");
        let sensor = sensor::sensor(report, &s, ray_files, lost.contains(&index));
        if let Some(pattern) = sensor.as_ref().map(|sensor| &sensor.pattern).filter(|p| !p.is_camera()) {
            beams += pattern.rows();
            if beams > MAX_BEAMS {
                let message = format!("the job's sensors have more than {MAX_BEAMS} beams");
                report.error(node.span, message, "too many from here on", None);
                break;
            }
        }
        if let (Some(sensor), Some(name)) = (sensor, name) {
            mounted.push(MountedSensor { name, sensor, body_from_sensor });
        }
    }
    mounted
}

/// A sensor's name, which is fit to name a folder on any system. `taken` has those of the sensors before it, in lower
/// case.
fn sensor_name(
    report: &Report,
    s: &Section<'_>,
    is_alone: bool,
    taken: &mut BTreeMap<String, String>,
) -> Option<String> {
    if is_alone && s.get("name").is_none() {
        return Some(LONE_NAME.to_owned());
    }
    s.need("name", "`name = \"top\"`: each of several sensors needs one, for its output folder");
    let name = s.text("name")?;
    let complain = |message: String, label: &str| {
        report.error(name.span, message, label, None);
        None
    };
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    if !name.value.chars().all(allowed) || name.value.starts_with('.') || name.value.ends_with('.') {
        return complain(
            format!("{} can't name a sensor's output folder", quoted(name.value)),
            "expected letters, digits, `-`, `_` and inner `.`",
        );
    }
    if name.value.len() > 64 {
        return complain(
            format!("a sensor's name has {} characters", name.value.len()),
            "expected at most 64",
        );
    }
    let lower = name.value.to_lowercase();
    let device = lower.split('.').next().unwrap_or("");
    let numbered = device.strip_prefix("com").or(device.strip_prefix("lpt"));
    if matches!(device, "con" | "prn" | "aux" | "nul")
        || numbered.is_some_and(|n| n.len() == 1 && n.bytes().all(|b| b.is_ascii_digit()))
    {
        return complain(
            format!("{} can't name a sensor's output folder", quoted(name.value)),
            "Windows keeps this name for a device",
        );
    }
    if let Some(before) = taken.insert(lower, name.value.to_owned()) {
        let message = if before == name.value {
            format!("two sensors are called {}", quoted(name.value))
        } else {
            format!("two sensors are called {} and {}", quoted(&before), quoted(name.value))
        };
        return complain(message, "expected a name that differs in more than upper and lower case");
    }
    Some(name.value.to_owned())
}
