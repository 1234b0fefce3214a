//! A job's `[[sensor]]` tables → [`MountedSensor`]s, and poses.

use std::collections::BTreeMap;

use glam::DVec3;

use super::super::job::MountedSensor;
use super::super::keys::job::{MODE, NAME, POSE, POSITION, PRESET, QUATERNION, RPY, SENSORS};
use super::super::kinds::Nested;
use super::super::plausibility;
use super::super::table::{Key, Table};
use super::rays::RayFiles;
use super::sensor;
use crate::angle::Angle;
use crate::frame::Pose;
use crate::source::words::quoted;
use crate::source::{Doubt, Report, Span, Spanned};

/// Most beams of all sensors: a short file can ask for very many.
pub(super) const MAX_BEAMS: usize = 2_000_000;

/// The sensors of a job, and where they are said to stand.
#[derive(Default)]
pub(super) struct Rig {
    pub sensors: Vec<MountedSensor>,
    /// For each sensor what says where it stands: its pose, else that of the body, else its table.
    pub places: Vec<Span>,
    /// The first sensor without any pose, its own or the body's.
    pub unposed: Option<Span>,
}

/// The rig. `body` is where the body's pose stands. The patterns of the sensors in `lost` are in files that were reported.
pub(super) fn sensors(job: &Table<'_>, ray_files: &RayFiles, lost: &[Span], body: Option<Span>) -> Rig {
    let Some(tables) = job.read(&SENSORS) else { return Rig::default() };
    let is_alone = tables.value.len() == 1;
    let mut taken = BTreeMap::new();
    let (mut mounted, mut places) = (Vec::new(), Vec::new());
    let mut beams = 0;
    for t in &tables.value {
        // The preset is laid under this table already, in the mode that it asks for.
        t.read(&PRESET);
        t.read(&MODE);
        let name = name(t, is_alone, &mut taken);
        let body_from_sensor = pose(t, &POSE);
        let sensor = sensor::sensor(t, ray_files, lost.contains(&t.span));
        if let Some(pattern) = sensor.as_ref().map(|sensor| &sensor.pattern).filter(|p| !p.is_camera()) {
            beams += pattern.rows();
            if beams > MAX_BEAMS {
                let message = format!("the job's sensors have more than {MAX_BEAMS} beams");
                job.report().error(t.span, message, "too many from here on", None);
                break;
            }
        }
        if let (Some(sensor), Some(name)) = (sensor, name) {
            mounted.push(MountedSensor { name, sensor, body_from_sensor });
            places.push(if t.has(&POSE) { t.span_of(&POSE) } else { body.unwrap_or(t.span) });
        }
    }
    let unposed = tables.value.iter().find(|t| !t.has(&POSE) && body.is_none()).map(|t| t.span);
    Rig { sensors: mounted, places, unposed }
}

/// A sensor's name. `taken` has those of the sensors before it, by their lower case.
fn name(t: &Table<'_>, is_alone: bool, taken: &mut BTreeMap<String, String>) -> Option<String> {
    if is_alone && !t.has(&NAME) {
        return Some(t.value(&NAME).to_owned());
    }
    t.need(&NAME, "`name = \"top\"`: each of several sensors needs one, for its output folder");
    let name = t.read(&NAME)?;
    if let Some(before) = taken.insert(name.value.to_lowercase(), name.value.to_owned()) {
        let message = if before == name.value {
            format!("two sensors are called {}", quoted(name.value))
        } else {
            format!("two sensors are called {} and {}", quoted(&before), quoted(name.value))
        };
        let label = "expected a name that differs in more than upper and lower case";
        t.report().error(name.span, message, label, None);
        return None;
    }
    Some(name.value.to_owned())
}

/// The pose of a table, or the identity.
pub(super) fn pose(t: &Table<'_>, key: &Key<Nested>) -> Pose {
    let Some(t) = t.read(key).map(|pose| pose.value) else { return Pose::IDENTITY };
    let translation = DVec3::from_array(t.value(&POSITION));
    let quaternion = t.read(&QUATERNION);
    let [roll, pitch, yaw] = t.value(&RPY).map(Angle::deg);
    if let (true, Some(quaternion)) = (t.has(&RPY), quaternion) {
        let message = "a pose has one rotation, and this has both `rpy_deg` and `quaternion_xyzw`";
        let span = t.report().later(quaternion.span, t.span_of(&RPY));
        t.report().error(span, message, "one too many", None);
    }
    let angles = t.has(&RPY).then(|| t.value(&RPY)).and_then(|rpy| plausibility::rpy(RPY.name(), rpy));
    if let Some(doubt) = angles {
        t.report().doubt(t.span_of(&RPY), doubt);
    }
    if let Some(q) = quaternion
        && let Some(doubt) = plausibility::quaternion(QUATERNION.name(), q.value)
    {
        t.report().doubt(q.span, doubt);
    }
    match quaternion {
        Some(q) => quaternion_pose(t.report(), translation, q).unwrap_or(Pose::IDENTITY),
        None => Pose::from_rpy(translation, roll, pitch, yaw),
    }
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
        let doubt = Doubt::new("quaternion-length", QUATERNION.name(), message);
        report.doubt(q.span, doubt.label("expected x, y, z, w of length 1"));
    }
    made
}
