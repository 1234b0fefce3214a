//! The changes between two runs of a job: of its keys, its beams, its scene and the version of the tool.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use super::baseline::{Baseline, SensorRecord};
use super::outcome::Change;

/// The largest number of changed elements of a list that are reported one by one.
const MOST_ELEMENTS: usize = 4;

/// Changes, sorted by the sensors that they concern.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// The changes that concern one sensor, by its name.
    pub of_sensor: BTreeMap<String, Vec<Change>>,
    /// The changes that concern every sensor, such as those of the scene, the labels and the trajectory.
    pub of_job: Vec<Change>,
}

impl Changes {
    /// The changes from a baseline to a run.
    pub fn between(old: &Baseline, new: &Baseline) -> Self {
        let mut changes = Self::default();
        let (old_sensors, new_sensors) = (sensors(&old.job), sensors(&new.job));
        for (name, sensor) in &new_sensors {
            let Some(before) = old_sensors.get(name) else { continue };
            let mut found = beam_changes(record(old, name), record(new, name));
            let mut keys = Vec::new();
            key_changes("", before, sensor, &mut keys);
            // The change of a beam says more than the change of an element in the list from which the beam is read.
            let is_of_beams = |change: &Change| BEAM_KEYS.iter().any(|key| change.what.starts_with(key));
            if !found.is_empty() {
                keys.retain(|change| !is_of_beams(change));
            }
            found.extend(keys);
            found.iter_mut().for_each(|change| change.sensor = Some(name.clone()));
            if !found.is_empty() {
                changes.of_sensor.insert(name.clone(), found);
            }
        }
        let rest = |job: &Value| match job {
            Value::Object(keys) => {
                Value::Object(keys.clone().into_iter().filter(|(key, _)| key != "sensor").collect())
            }
            other => other.clone(),
        };
        key_changes("", &rest(&old.job), &rest(&new.job), &mut changes.of_job);
        scene_changes(old, new, &mut changes.of_job);
        if old.tool != new.tool {
            changes.of_job.push(Change {
                sensor: None,
                what: "beamcast".into(),
                old: Some(old.tool.clone()),
                new: Some(new.tool.clone()),
            });
        }
        changes
    }

    /// All changes. Those of single sensors come first.
    pub fn all(&self) -> Vec<Change> {
        self.of_sensor.values().flatten().chain(&self.of_job).cloned().collect()
    }
}

/// The keys of the lists of beams.
const BEAM_KEYS: [&str; 3] =
    ["rotating.elevations_deg", "rotating.azimuth_offsets_deg", "rotating.beam_times_us"];

/// A job's sensors by name. A single sensor without a name is called `sensor`.
fn sensors(job: &Value) -> BTreeMap<String, Value> {
    let list = job.get("sensor").and_then(Value::as_array);
    let named = list.into_iter().flatten().map(|sensor| {
        let name = sensor.get("name").and_then(Value::as_str).unwrap_or("sensor");
        (name.to_owned(), sensor.clone())
    });
    named.collect()
}

fn record<'a>(baseline: &'a Baseline, sensor: &str) -> Option<&'a SensorRecord> {
    baseline.sensors.iter().find(|record| record.name == sensor)
}

/// The changes of single beams, if the number of beams is unchanged.
fn beam_changes(old: Option<&SensorRecord>, new: Option<&SensorRecord>) -> Vec<Change> {
    let (Some(old), Some(new)) = (old, new) else { return Vec::new() };
    if old.beams.len() != new.beams.len() {
        return Vec::new();
    }
    let mut changes = Vec::new();
    for (index, (what, unit)) in
        [("elevation", "°"), ("azimuth offset", "°"), ("time", " µs")].iter().enumerate()
    {
        let changed: Vec<usize> =
            (0..old.beams.len()).filter(|&row| old.beams[row][index] != new.beams[row][index]).collect();
        let shown = |row: usize, beams: &[[f64; 3]]| Some(format!("{}{unit}", number(beams[row][index])));
        if changed.len() > MOST_ELEMENTS {
            let by: Vec<f64> = changed.iter().map(|&r| new.beams[r][index] - old.beams[r][index]).collect();
            let (least, most) =
                by.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), d| (l.min(*d), m.max(*d)));
            let by = if most - least < 1e-8 {
                format!("all by {}{unit}", number(most))
            } else {
                format!("by {} to {}{unit}", number(least), number(most))
            };
            let what = format!("{what} of {} of {} beams, {by}", changed.len(), old.beams.len());
            changes.push(Change { sensor: None, what, old: None, new: None });
            continue;
        }
        for row in changed {
            changes.push(Change {
                sensor: None,
                what: format!("beam (row {row}) {what}"),
                old: shown(row, &old.beams),
                new: shown(row, &new.beams),
            });
        }
    }
    changes
}

/// A number with a real minus sign and without rounding noise in its last digits.
fn number(value: f64) -> String {
    let rounded = (value * 1e9).round() / 1e9;
    // Adding 0 makes a negative zero positive.
    (rounded + 0.0).to_string().replace('-', "−")
}

/// Finds the keys that differ between two values, and reports each with its path.
fn key_changes(path: &str, old: &Value, new: &Value, found: &mut Vec<Change>) {
    if are_equal(old, new) {
        return;
    }
    match (old, new) {
        (Value::Object(a), Value::Object(b)) => {
            let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
            for key in keys {
                let deeper = join(path, key);
                match (a.get(key), b.get(key)) {
                    (Some(old), Some(new)) => key_changes(&deeper, old, new, found),
                    (old, new) => added_or_removed(&deeper, old, new, found),
                }
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let changed: Vec<usize> = (0..a.len()).filter(|&i| !are_equal(&a[i], &b[i])).collect();
            if changed.len() > MOST_ELEMENTS {
                let what = format!("{path}: {} of {} values", changed.len(), a.len());
                found.push(Change { sensor: None, what, old: None, new: None });
                return;
            }
            for index in changed {
                key_changes(&format!("{path}[{index}]"), &a[index], &b[index], found);
            }
        }
        _ => added_or_removed(path, Some(old), Some(new), found),
    }
}

/// Reports a value that was added, removed or became another kind of value. For a table that was added or removed, it
/// reports each key.
fn added_or_removed(path: &str, old: Option<&Value>, new: Option<&Value>, found: &mut Vec<Change>) {
    let empty = Value::Object(Map::new());
    match (old, new) {
        (Some(table @ Value::Object(keys)), None) if !keys.is_empty() => {
            key_changes(path, table, &empty, found)
        }
        (None, Some(table @ Value::Object(keys))) if !keys.is_empty() => {
            key_changes(path, &empty, table, found)
        }
        _ => {
            let what = path.to_owned();
            found.push(Change { sensor: None, what, old: old.map(shown), new: new.map(shown) });
        }
    }
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// Whether two values are equal. An integer equals the float of the same value.
fn are_equal(a: &Value, b: &Value) -> bool {
    match (a.as_f64(), b.as_f64()) {
        (Some(a), Some(b)) => a == b,
        _ => a == b,
    }
}

fn shown(value: &Value) -> String {
    const LONGEST: usize = 60;
    let text = match value {
        Value::Number(n) => n.to_string().replace('-', "−"),
        Value::Array(values) => format!("[{}]", values.iter().map(shown).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    };
    match text.char_indices().nth(LONGEST) {
        Some((at, _)) => format!("{}…", &text[..at]),
        None => text,
    }
}

fn scene_changes(old: &Baseline, new: &Baseline, found: &mut Vec<Change>) {
    let (a, b) = (&old.scene, &new.scene);
    let short = |hash: &String| format!("BLAKE3 {}…", hash.get(..12).unwrap_or(hash));
    let names = a.files.keys().chain(b.files.keys().filter(|name| !a.files.contains_key(*name)));
    for name in names {
        let (old, new) = (a.files.get(name), b.files.get(name));
        if old != new {
            let what = name.clone();
            found.push(Change { sensor: None, what, old: old.map(short), new: new.map(short) });
        }
    }
    if a.triangles != b.triangles {
        found.push(Change {
            sensor: None,
            what: "triangles of the scene".into(),
            old: Some(a.triangles.to_string()),
            new: Some(b.triangles.to_string()),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn between(old: Value, new: Value) -> Vec<String> {
        let mut found = Vec::new();
        key_changes("", &old, &new, &mut found);
        found.iter().map(Change::to_string).collect()
    }

    #[test]
    fn keys_are_told_with_their_old_and_new_values() {
        let old =
            json!({ "seed": 1, "labels": { "wall": 3 }, "pose": { "rpy_deg": [0, 0, 0.0] }, "up": "z" });
        let new = json!({ "seed": 1.0, "pose": { "rpy_deg": [0.0, 0, -0.1] }, "up": "y", "trace": { "kernel": "a" } });
        assert_eq!(
            between(old, new),
            [
                "labels.wall 3 → unset",
                "pose.rpy_deg[2] 0.0 → −0.1",
                "up \"z\" → \"y\"",
                "trace.kernel unset → \"a\""
            ]
        );
        let many = |n: f64| json!({ "list": (0..9).map(|i| f64::from(i) * n).collect::<Vec<_>>() });
        assert_eq!(between(many(1.0), many(2.0)), ["list: 8 of 9 values"]);
    }
}
