//! `beamcast selftest --datasheet`: scans what sensors' data sheets state, and holds the frames to the figures.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::interrupt::Interrupt;
use super::job::load_sensor_or_job;
use super::json;
use super::terminal::Terminal;
use crate::config::presets::BUILT_IN;
use crate::config::{self, Config, Job, SensorFile};
use crate::error::Error;
use crate::selftest::datasheet::{self, Figure, Measured, Outcome, Replay, Stated};
use crate::sensor::Sensor;
use crate::source::words::{on_one_line, runs};

/// A sensor that states figures.
struct Subject {
    name: String,
    sensor: Sensor,
    /// Whether the figures are those of `[nominal]`.
    is_nominal: bool,
    /// The publication that they are from, where the sensor's file says it.
    source: Option<String>,
}

/// Replays the figures of sensors: of built-in ones, of sensor files, or of jobs. Without any, of all built-in sensors that have
/// `[nominal]`.
///
/// # Errors
/// [`Error::Difference`] if a figure disagrees; [`Error::Config`] with everything that is wrong in a file; [`Error::Usage`] if a
/// sensor states nothing.
pub(super) fn run(paths: &[PathBuf], prints_json: bool, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    let subjects = subjects(paths, terminal)?;
    let rays = subjects.iter().map(|s| datasheet::rays(&s.sensor, &s.sensor.measurement)).sum();
    let replay = |s: &Subject| {
        datasheet::replay(&s.sensor, &s.sensor.measurement, interrupt.progress())
            .map_err(|e| Error::Usage(format!("{}: no plane can be set up for it: {e}", s.name)))
    };
    let replay_all = || subjects.iter().map(replay).collect::<Result<Option<Vec<Replay>>, Error>>();
    let replays = terminal.with_progress(rays, interrupt.progress(), replay_all)?;
    interrupt.check()?;
    let replays = replays.unwrap_or_default();
    let both = || subjects.iter().zip(&replays);
    if prints_json {
        let all: Vec<Value> = both().map(|(subject, replay)| as_json(subject, replay)).collect();
        terminal.json(&json::SELFTEST_DATASHEET.of(json!({ "sensors": all })))?;
    } else {
        let all: Vec<String> = both().map(|(subject, replay)| as_text(subject, replay)).collect();
        terminal.print(&all.join("\n"))?;
    }
    let failed: Vec<&str> =
        both().filter(|(_, replay)| !replay.passed()).map(|(subject, _)| subject.name.as_str()).collect();
    if failed.is_empty() { Ok(()) } else { Err(Error::Difference(format!("{} failed", failed.join(", ")))) }
}

fn subjects(paths: &[PathBuf], terminal: &Terminal) -> Result<Vec<Subject>, Error> {
    if paths.is_empty() {
        let mut subjects = Vec::new();
        for (name, _) in BUILT_IN {
            subjects.extend(of_file((*name).to_owned(), config::load_preset(name)?).ok());
        }
        return Ok(subjects);
    }
    let (mut subjects, mut problems, mut silent) = (Vec::new(), Vec::new(), Vec::new());
    for path in paths {
        match load_sensor_or_job(path) {
            Ok(Config::Sensor(file)) => {
                terminal.warn_of(&file.warnings);
                match of_file(path.to_string_lossy().into_owned(), *file) {
                    Ok(subject) => subjects.push(subject),
                    Err(message) => silent.push(message),
                }
            }
            Ok(Config::Job(job)) => {
                terminal.warn_of(&job.warnings);
                let before = subjects.len();
                let mut silent_here = Vec::new();
                for index in 0..job.sensors.len() {
                    match of_job(path, &job, index) {
                        Ok(subject) => subjects.push(subject),
                        Err(message) => silent_here.push(message),
                    }
                }
                // A rig may well have a camera beside its LiDARs.
                if subjects.len() > before {
                    silent_here.drain(..).for_each(|message| terminal.warn(message));
                }
                silent.extend(silent_here);
            }
            Err(Error::Config(found)) => problems.extend(found),
            Err(other) => return Err(other),
        }
    }
    match (problems.is_empty(), silent.is_empty()) {
        (false, _) => Err(Error::Config(problems)),
        (true, false) => Err(Error::Usage(silent.join("\n"))),
        (true, true) => Ok(subjects),
    }
}

/// The message that a sensor states nothing.
fn nothing_of(name: &str, nominal: &str) -> String {
    format!(
        "{name} has nothing to replay: it has no `[receiver]` with `range_pairs`, no `[noise]` with `range_floor_m` or \
         `bias_m`, and {nominal}"
    )
}

/// The sensor of a file as it stands or, if it states nothing so, with the figures of its `[nominal]`. Else a message.
fn of_file(name: String, file: SensorFile) -> Result<Subject, String> {
    let SensorFile { sensor, nominal, .. } = file;
    if datasheet::states_figures(&sensor.measurement) {
        return Ok(Subject { name, sensor, is_nominal: false, source: None });
    }
    match nominal {
        Some(nominal) if datasheet::states_figures(&nominal.measurement) => Ok(Subject {
            name,
            sensor: Sensor { measurement: nominal.measurement, ..sensor },
            is_nominal: true,
            source: Some(nominal.source),
        }),
        _ => Err(nothing_of(&name, "no `[nominal]` with them")),
    }
}

/// A sensor of a job as the job has it or, if it states nothing so, with `nominal = true`. Else a message.
fn of_job(path: &Path, job: &Job, index: usize) -> Result<Subject, String> {
    let mounted = &job.sensors[index];
    let name = format!("{} of {}", mounted.name, path.display());
    let subject = |sensor: &Sensor, is_nominal| Subject {
        name: name.clone(),
        sensor: sensor.clone(),
        is_nominal,
        source: None,
    };
    if datasheet::states_figures(&mounted.sensor.measurement) {
        return Ok(subject(&mounted.sensor, mounted.is_nominal));
    }
    // The job that says so is an error where the preset has no such figures.
    let asked = format!("sensor.{}.nominal=true", mounted.name);
    let nominal = config::load_job(path, &[asked]).ok();
    let of_nominal = nominal.as_ref().and_then(|job| job.sensors.get(index));
    match of_nominal.filter(|nominal| datasheet::states_figures(&nominal.sensor.measurement)) {
        Some(nominal) => Ok(subject(&nominal.sensor, true)),
        None => Err(nothing_of(
            &name,
            "`nominal = true` gives it none, as its preset has no `[nominal]` with them",
        )),
    }
}

fn as_text(subject: &Subject, replay: &Replay) -> String {
    let mut text = on_one_line(&subject.name).to_string();
    if subject.is_nominal {
        text += ", nominal";
    }
    if let Some(source) = &subject.source {
        let _ = write!(text, " ({})", on_one_line(source));
    }
    text += "\n";
    if let Some(fit) = replay.fit.filter(|_| replay.pairs > 1) {
        let _ = writeln!(
            text,
            "  {} range pairs: power falls with the range to the {:.2}, and the fit misses a pair's range by {:.1} % at most",
            replay.pairs,
            fit.exponent,
            100.0 * fit.misfit
        );
    }
    let [figure, plane, pulses, expected, found, allowed] =
        ["figure", "plane", "pulses", "expected", "found", "allowed"];
    let _ = writeln!(text, "  {figure:<13} {plane:<16} {pulses:>8} {expected:>11} {found:>11} {allowed:>12}");
    for Figure { stated, pulses, outcome } in &replay.figures {
        let name = stated.name().replace('_', " ");
        let plane = stated.plane().map_or_else(String::new, |(reflectance, range_m)| {
            format!("{} % at {range_m} m", tidy(100.0 * reflectance))
        });
        let _ = write!(text, "  {name:<13} {plane:<16} ");
        let _ = match outcome {
            Outcome::Measured(measured) => {
                let of_rows = rows_of(subject, stated)
                    .map_or_else(String::new, |rows| format!(" (rows {})", runs(rows)));
                let [expected, found, allowed] =
                    [measured.expected, measured.found, measured.allowed].map(|value| shown(stated, value));
                let verdict = if measured.agrees() { "" } else { ": WRONG" };
                writeln!(
                    text,
                    "{pulses:>8} {expected:>11} {found:>11} {:>12}{verdict}{of_rows}",
                    format!("±{allowed}")
                )
            }
            Outcome::Capped(limit_m) => {
                writeln!(text, "not replayed: it is capped at the sensor's largest range, {limit_m} m")
            }
            Outcome::TooNear(limit_m) => {
                writeln!(text, "not replayed: it is nearer than the sensor's least range, {limit_m} m")
            }
            Outcome::FewBeams(beams) => {
                writeln!(text, "not judged: a spread over so few beams ({beams}) says nothing")
            }
        };
    }
    text += if replay.passed() {
        "  passed\n"
    } else if replay.figures.iter().all(|figure| figure.outcome.measured().is_none()) {
        "  FAILED: nothing was measured\n"
    } else {
        "  FAILED\n"
    };
    text
}

/// The rows of the beams that a figure is stated of, if it is not of most of them.
fn rows_of<'s>(subject: &'s Subject, stated: &Stated) -> Option<&'s [usize]> {
    let Stated::Detection { beams: Some(beams), .. } = *stated else { return None };
    Some(&subject.sensor.measurement.receiver.as_ref()?.beams.get(beams)?.rows)
}

/// A number of percent without digits that floating point made.
fn tidy(percent: f64) -> f64 {
    (percent * 1e6).round() / 1e6
}

/// A value of a figure in the unit that it is told in.
fn shown(stated: &Stated, value: f64) -> String {
    match stated {
        Stated::Detection { .. } => format!("{:.2} %", 100.0 * value),
        Stated::RangeNoise { .. } | Stated::BeamBias => format!("{:.2} mm", 1e3 * value),
        Stated::FalseAlarms => format!("{value:.1}"),
    }
}

fn as_json(subject: &Subject, replay: &Replay) -> Value {
    let several = replay.fit.filter(|_| replay.pairs > 1);
    json!({
        "name": subject.name,
        "is_nominal": subject.is_nominal,
        "source": subject.source,
        "passed": replay.passed(),
        "exponent": several.map(|fit| fit.exponent),
        "misfit": several.map(|fit| fit.misfit),
        "figures": replay.figures.iter().map(|figure| figure_as_json(subject, figure)).collect::<Vec<_>>(),
    })
}

fn figure_as_json(subject: &Subject, figure: &Figure) -> Value {
    let Figure { stated, pulses, outcome } = figure;
    let measured = outcome.measured();
    let plane = stated.plane();
    let left_out = match outcome {
        Outcome::Measured(_) => None,
        Outcome::Capped(_) => Some("capped"),
        Outcome::TooNear(_) => Some("too_near"),
        Outcome::FewBeams(_) => Some("few_beams"),
    };
    json!({
        "figure": stated.name(),
        "reflectance": plane.map(|(reflectance, _)| reflectance),
        "range_m": plane.map(|(_, range_m)| range_m),
        "rows": rows_of(subject, stated),
        "pulses": pulses,
        "expected": measured.map(|m| m.expected),
        "found": measured.map(|m| m.found),
        "allowed": measured.map(|m| m.allowed),
        "agrees": measured.map(Measured::agrees),
        "left_out": left_out,
    })
}
