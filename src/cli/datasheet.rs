//! `beamcast selftest --datasheet`: scans what sensors' data sheets state, and holds the frames to the figures.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::depth_quality;
use super::facts::runs;
use super::interrupt::Interrupt;
use super::job::load_sensor_or_job;
use super::json;
use super::terminal::Terminal;
use crate::config::presets::BUILT_IN;
use crate::config::{self, Config, DataSheet, Job, SensorFile};
use crate::error::Error;
use crate::run::memory;
use crate::scan::Progress;
use crate::selftest::datasheet::{self, Figure, Measured, Outcome, Replay, Stated};
use crate::selftest::quality::{self, QualityReport};
use crate::sensor::{Measurement, Published, Sensor};
use crate::source::words::on_one_line;

/// A sensor that states figures, or a camera that finds depth.
struct Subject {
    name: String,
    sensor: Sensor,
    /// Whether the figures by which it measures are those of `[nominal]`.
    is_nominal: bool,
    /// The data sheet, if one is known and these figures are from it or it states bounds.
    data_sheet: Option<DataSheet>,
}

/// The findings about a sensor.
enum Found {
    /// Of a sensor with a receiver or with noise: the replay of its figures.
    Replay(Replay),
    /// Of a camera that finds depth: the quality of it.
    Quality(QualityReport),
}

impl Found {
    fn passed(&self) -> bool {
        match self {
            Self::Replay(replay) => replay.passed(),
            Self::Quality(report) => report.passed(),
        }
    }
}

impl Subject {
    /// The sensor as it measures without its `[nominal]`, or with it. The data sheet counts if its figures do, or if it states bounds.
    fn new(name: String, sensor: Sensor, is_nominal: bool, data_sheet: Option<DataSheet>) -> Self {
        let data_sheet = data_sheet.filter(|stated| is_nominal || !stated.published.is_empty());
        Self { name, sensor, is_nominal, data_sheet }
    }

    fn published(&self) -> &[Published] {
        self.data_sheet.as_ref().map_or(&[], |stated| &stated.published)
    }

    fn source(&self) -> Option<&str> {
        self.data_sheet.as_ref().map(|stated| stated.source.as_str())
    }

    fn rays(&self) -> u64 {
        match self.sensor.measurement.depth {
            Some(_) => quality::rays(&self.sensor, self.published()),
            None => datasheet::rays(&self.sensor, &self.sensor.measurement),
        }
    }

    fn find(&self, progress: &Progress) -> Result<Option<Found>, Error> {
        let found = match self.sensor.measurement.depth {
            Some(_) => {
                quality::measure(&self.sensor, self.published(), progress).map(|q| q.map(Found::Quality))
            }
            None => datasheet::replay(&self.sensor, &self.sensor.measurement, progress)
                .map(|replay| replay.map(Found::Replay)),
        };
        found.map_err(|e| Error::Usage(format!("{}: no plane can be set up for it: {e}", self.name)))
    }
}

/// Whether there is something to be measured of a sensor.
fn is_measurable(measurement: &Measurement) -> bool {
    measurement.depth.is_some() || datasheet::states_figures(measurement)
}

/// Replays the figures of sensors, and measures the quality of depth cameras: of built-in ones, of sensor files, or of jobs. Without
/// any, of all built-in sensors that state figures or find depth.
///
/// # Errors
/// [`Error::Difference`] if a figure disagrees or a promise is broken; [`Error::Config`] with everything that is wrong in a file;
/// [`Error::Usage`] if a sensor states nothing, or if a frame does not fit into the machine's memory.
pub(super) fn run(paths: &[PathBuf], prints_json: bool, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    let subjects = subjects(paths, terminal)?;
    for subject in subjects.iter().filter(|subject| subject.sensor.measurement.depth.is_some()) {
        memory::check(&format!("a frame of {}", subject.name), memory::of_frame(&subject.sensor))?;
    }
    let rays = subjects.iter().map(Subject::rays).sum();
    let find = |subject: &Subject| subject.find(interrupt.progress());
    let find_all = || subjects.iter().map(find).collect::<Result<Option<Vec<Found>>, Error>>();
    let found = terminal.with_progress(rays, interrupt.progress(), find_all)?;
    interrupt.check()?;
    let found = found.unwrap_or_default();
    let both = || subjects.iter().zip(&found);
    if prints_json {
        let all: Vec<Value> = both().map(|(subject, found)| as_json(subject, found)).collect();
        terminal.json(&json::SELFTEST_DATASHEET.of(json!({ "sensors": all })))?;
    } else {
        let all: Vec<String> = both().map(|(subject, found)| as_text(subject, found)).collect();
        terminal.print(&all.join("\n"))?;
    }
    let failed: Vec<&str> =
        both().filter(|(_, found)| !found.passed()).map(|(subject, _)| subject.name.as_str()).collect();
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
                // A rig may well have an ideal camera beside its LiDARs.
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
         `bias_m`, no `[stereo]`, `[structured_light]` or `[tof]`, and {nominal}"
    )
}

/// The sensor of a file as it stands or, if it states nothing so, with the figures of its `[nominal]`. Else a message.
fn of_file(name: String, file: SensorFile) -> Result<Subject, String> {
    let SensorFile { sensor, nominal, .. } = file;
    if is_measurable(&sensor.measurement) {
        return Ok(Subject::new(name, sensor, false, nominal.map(|nominal| nominal.data_sheet)));
    }
    match nominal {
        Some(nominal) if is_measurable(&nominal.measurement) => {
            let sensor = Sensor { measurement: nominal.measurement, ..sensor };
            Ok(Subject::new(name, sensor, true, Some(nominal.data_sheet)))
        }
        _ => Err(nothing_of(&name, "no `[nominal]` with them")),
    }
}

/// A sensor of a job as the job has it or, if it states nothing so, with `nominal = true`. Else a message.
fn of_job(path: &Path, job: &Job, index: usize) -> Result<Subject, String> {
    let mounted = &job.sensors[index];
    let name = format!("{} of {}", mounted.name, path.display());
    let subject = |sensor: &Sensor, is_nominal| {
        Subject::new(name.clone(), sensor.clone(), is_nominal, mounted.data_sheet.clone())
    };
    if is_measurable(&mounted.sensor.measurement) {
        return Ok(subject(&mounted.sensor, mounted.is_nominal));
    }
    // The job that says so is an error where the preset has no such figures.
    let asked = format!("sensor.{}.nominal=true", mounted.name);
    let nominal = config::load_job(path, &[asked]).ok();
    let of_nominal = nominal.as_ref().and_then(|job| job.sensors.get(index));
    match of_nominal.filter(|nominal| is_measurable(&nominal.sensor.measurement)) {
        Some(nominal) => Ok(subject(&nominal.sensor, true)),
        None => Err(nothing_of(
            &name,
            "`nominal = true` gives it none, as its preset has no `[nominal]` with them",
        )),
    }
}

fn as_text(subject: &Subject, found: &Found) -> String {
    let mut text = on_one_line(&subject.name).to_string();
    if subject.is_nominal {
        text += ", nominal";
    }
    if let Some(source) = subject.source() {
        let _ = write!(text, " ({})", on_one_line(source));
    }
    text += "\n";
    text += &match found {
        Found::Replay(replay) => replay_as_text(subject, replay),
        Found::Quality(report) => depth_quality::text(report),
    };
    text
}

fn replay_as_text(subject: &Subject, replay: &Replay) -> String {
    let mut text = String::new();
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

fn as_json(subject: &Subject, found: &Found) -> Value {
    let (replay, report) = match found {
        Found::Replay(replay) => (Some(replay), None),
        Found::Quality(report) => (None, Some(report)),
    };
    let several = replay.and_then(|replay| replay.fit.filter(|_| replay.pairs > 1));
    json!({
        "name": subject.name,
        "is_nominal": subject.is_nominal,
        "source": subject.source(),
        "passed": found.passed(),
        "exponent": several.map(|fit| fit.exponent),
        "misfit": several.map(|fit| fit.misfit),
        "figures": replay.map_or_else(Vec::new, |replay| replay.figures.iter().map(|figure| figure_as_json(subject, figure)).collect()),
        "walls": report.map_or_else(Vec::new, depth_quality::walls_as_json),
        "published": report.map_or_else(Vec::new, depth_quality::published_as_json),
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
