//! A job's `[[sensor]]` tables → [`MountedSensor`]s.

use std::collections::BTreeMap;

use super::super::job::{FromScene, InScene, MountedSensor, Owner};
use super::super::keys::job::{MODE, NAME, POSE, PRESET, SENSORS, TRAJECTORY, TRIGGER};
use super::super::keys::measurement::IS_NOMINAL;
use super::super::table::Table;
use super::nominal::report_absence;
use super::pose::{Placed, placed};
use super::preset::Laid;
use super::sensor;
use super::sensor_files::SensorFiles;
use crate::frame::Pose;
use crate::source::Span;
use crate::source::words::quoted;

/// Most beams of all sensors: a short file can ask for very many.
pub(super) const MAX_BEAMS: usize = 2_000_000;

/// The sensors of a job, and where they are said to stand.
#[derive(Default)]
pub(super) struct Rig {
    pub sensors: Vec<MountedSensor>,
    /// For each sensor what says where it stands: its pose, else that of the body, else its table.
    pub places: Vec<Span>,
    /// The table of each sensor.
    pub tables: Vec<Span>,
    /// The sensors whose place the scene decides.
    pub from_scene: Vec<FromScene>,
    /// The first sensor without any pose, its own or the body's.
    pub unposed: Option<Span>,
}

/// The rig. `body` is where the body's pose stands.
pub(super) fn sensors(job: &Table<'_>, files: &SensorFiles, presets: &Laid, body: Option<Span>) -> Rig {
    let Some(tables) = job.read(&SENSORS) else { return Rig::default() };
    let is_alone = tables.value.len() == 1;
    let mut taken = BTreeMap::new();
    let (mut mounted, mut places, mut spans) = (Vec::new(), Vec::new(), Vec::new());
    let mut from_scene = Vec::new();
    let mut beams = 0;
    let mut data_sheets = presets.data_sheets.iter().peekable();
    for t in &tables.value {
        // The preset is laid under this table already, in the mode that it asks for.
        t.read(&PRESET);
        t.read(&MODE);
        let is_nominal = t.value(&IS_NOMINAL);
        if is_nominal && !t.has(&PRESET) {
            report_absence(t.reading(), t.span_of(&IS_NOMINAL));
        }
        let name = name(t, is_alone, &mut taken);
        let placed = placed(t, &POSE);
        let trigger_s = t.value(&TRIGGER);
        let data_sheet = data_sheets.next_if(|(span, _)| *span == t.span).map(|(_, stated)| stated.clone());
        let sensor = sensor::sensor(t, files, presets.lost.contains(&t.span));
        if let Some(pattern) = sensor.as_ref().map(|sensor| &sensor.pattern).filter(|p| !p.is_camera()) {
            beams += pattern.rows();
            if beams > MAX_BEAMS {
                let message = format!("the job's sensors have more than {MAX_BEAMS} beams");
                job.report().error(t.span, message, "too many from here on", None);
                break;
            }
        }
        if let (Some(sensor), Some(name)) = (sensor, name) {
            let body_from_sensor = match placed {
                Placed::At(pose) => pose,
                Placed::AsCamera(camera) => {
                    if job.has(&TRAJECTORY) {
                        let message = "a camera of the scene stands in the world, and this sensor on a body";
                        let help = "write `pose = { camera = … }` in [trajectory], or leave [trajectory] out";
                        let label = "expected a pose on the body";
                        job.report().error(camera.span, message, label, Some(help.into()));
                    }
                    let place = job.report().place(camera.span);
                    let owner = Owner::Sensor(mounted.len());
                    from_scene.push(FromScene { owner, wanted: InScene::Camera(camera.value), place });
                    Pose::IDENTITY
                }
            };
            mounted.push(MountedSensor { name, sensor, is_nominal, data_sheet, body_from_sensor, trigger_s });
            spans.push(t.span);
            places.push(if t.has(&POSE) { t.span_of(&POSE) } else { body.unwrap_or(t.span) });
        }
    }
    let unposed = tables.value.iter().find(|t| !t.has(&POSE) && body.is_none()).map(|t| t.span);
    Rig { sensors: mounted, places, tables: spans, from_scene, unposed }
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
