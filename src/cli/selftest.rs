//! `beamcast selftest`: casts a sensor's own pattern at shapes of known range.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::builder::PathBufValueParser;
use glam::DVec3;
use serde_json::{Value, json};

use super::datasheet;
use super::interrupt::Interrupt;
use super::job::load_sensor_or_job;
use super::json;
use super::shell::presets_or;
use super::terminal::Terminal;
use crate::angle::Angle;
use crate::config::{self, Config};
use crate::error::Error;
use crate::frame::Pose;
use crate::run::memory;
use crate::selftest::{self, CASTS, Check, SelftestReport, ShapeResult, Wrong};
use crate::sensor::Sensor;
use crate::source::words::on_one_line;
use crate::trace::methods::Method;

/// The arguments of `beamcast selftest`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Built-in sensors, sensor files, or jobs, whose sensors are tested where they stand [default: one built-in sensor of
    /// each kind]
    #[arg(value_name = "SENSOR|JOB", value_parser = presets_or(PathBufValueParser::new()), hide_possible_values = true)]
    paths: Vec<PathBuf>,
    /// Replay the sensors' own figures instead: scan planes at the stated ranges, and nothing, and hold detection, noise,
    /// biases and false alarms to what they state; of depth cameras, measure Z accuracy, plane-fit and sub-pixel RMS, fill
    /// rate and noise over distance, and hold them to what the data sheet promises. Of sensors that state nothing, the figures of
    /// `[nominal]` count [default: all built-in sensors that have some]
    #[arg(long)]
    datasheet: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The sensors that are tested if none is named.
const ONE_OF_EACH: &[&str] =
    &["velodyne/vlp-16", "ouster/os1-32", "livox/mid-40", "kinect/v2", "ideal/camera"];

/// A sensor to be tested, and the place and the method of the test.
struct Subject {
    name: String,
    sensor: Sensor,
    world_from_sensor: Pose,
    method: Option<&'static Method>,
}

/// Casts the patterns of sensors at planes, a box, a wedge and a ball, and reports the errors against closed forms.
///
/// # Errors
/// [`Error::Difference`] if a sensor fails; [`Error::Config`] with everything that is wrong in a file; [`Error::Usage`] if a
/// frame does not fit into the machine's memory, or if a sensor states nothing that could be replayed.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    if args.datasheet {
        return datasheet::run(&args.paths, args.json, terminal);
    }
    let interrupt = Interrupt::watch()?;
    let subjects = subjects(&args.paths, terminal)?;
    for subject in &subjects {
        memory::check(&format!("a frame of {}", subject.name), memory::of_frame(&subject.sensor))?;
    }
    let rays: u64 = subjects.iter().map(|s| s.sensor.pattern.rays() as u64 * CASTS).sum();
    let test = |s: &Subject| {
        selftest::selftest(&s.sensor, &s.world_from_sensor, s.method, interrupt.progress())
            .map_err(|e| Error::Usage(format!("{}: no shape can be set up for it: {e}", s.name)))
    };
    let test_all = || subjects.iter().map(test).collect::<Result<Option<Vec<SelftestReport>>, Error>>();
    let reports = terminal.with_progress(rays, interrupt.progress(), test_all)?;
    interrupt.check()?;
    let reports = reports.unwrap_or_default();

    if args.json {
        let all: Vec<Value> = subjects.iter().zip(&reports).map(|(s, r)| as_json(s, r)).collect();
        terminal.json(&json::SELFTEST.of(json!({ "sensors": all })))?;
    } else {
        let all: Vec<String> = subjects.iter().zip(&reports).map(|(s, r)| as_text(s, r)).collect();
        terminal.print(&all.join("\n"))?;
    }
    let failed: Vec<&str> = subjects
        .iter()
        .zip(&reports)
        .filter(|(_, report)| !report.passed())
        .map(|(subject, _)| subject.name.as_str())
        .collect();
    if failed.is_empty() { Ok(()) } else { Err(Error::Difference(format!("{} failed", failed.join(", ")))) }
}

fn subjects(paths: &[PathBuf], terminal: &Terminal) -> Result<Vec<Subject>, Error> {
    let of_sensor = |name: String, sensor: Sensor| {
        // The sensor is neither level nor at the origin, so that nothing comes out right by chance.
        let position = DVec3::new(12.5, -7.25, 1.8);
        let world_from_sensor = Pose::from_rpy(position, Angle::deg(3.0), Angle::deg(-5.0), Angle::deg(40.0));
        Subject { name, sensor, world_from_sensor, method: None }
    };
    if paths.is_empty() {
        let read =
            |&name: &&str| config::load_preset(name).map(|file| of_sensor(name.to_owned(), file.sensor));
        return ONE_OF_EACH.iter().map(read).collect();
    }
    let mut subjects = Vec::new();
    let mut problems = Vec::new();
    for path in paths {
        match load_sensor_or_job(path) {
            Ok(Config::Sensor(file)) => {
                terminal.warn_of(&file.warnings);
                subjects.push(of_sensor(path.to_string_lossy().into_owned(), file.sensor));
            }
            Ok(Config::Job(job)) => {
                terminal.warn_of(&job.warnings);
                subjects.extend(job.sensors.into_iter().map(|mounted| Subject {
                    name: format!("{} of {}", mounted.name, path.display()),
                    sensor: mounted.sensor,
                    world_from_sensor: job.trajectory.pose_at(0.0) * mounted.body_from_sensor,
                    method: job.kernel,
                }));
            }
            Err(Error::Config(found)) => problems.extend(found),
            Err(other) => return Err(other),
        }
    }
    if problems.is_empty() { Ok(subjects) } else { Err(Error::Config(problems)) }
}

fn as_text(subject: &Subject, report: &SelftestReport) -> String {
    let pattern = &subject.sensor.pattern;
    let name = on_one_line(&subject.name);
    let mut text = format!("{name}: {} × {} rays", pattern.rows(), pattern.columns());
    if let Some(method) = subject.method {
        let _ = write!(text, ", by the method {}", method.about.name);
    }
    let [shape, at, hits, misses, edges, wrong] = ["shape", "at, m", "hits", "misses", "edges", "wrong"];
    let _ = writeln!(
        text,
        "\n  {shape:<18} {at:>8} {hits:>8} {misses:>8} {edges:>6} {wrong:>6}   facet, m: max      RMS   \
         ideal, m: max      RMS  of allowed"
    );
    for s in &report.shapes {
        let _ = write!(
            text,
            "  {:<18} {:>8} {:>8} {:>8} {:>6} {:>6}       {:>9.1e} {:>8.1e}",
            s.shape,
            short(s.distance_m),
            s.hits,
            s.misses,
            s.edges,
            s.wrong,
            s.facet_error.max_m,
            s.facet_error.rms_m
        );
        let within = match s.wrong {
            0 => "between its sphere and the ball inside its facets",
            _ => "a ball: judged by its sphere and the ball inside its facets",
        };
        let percent = 100.0 * s.allowance_used;
        let _ = match s.tessellated {
            true => writeln!(text, "   {within}"),
            false => writeln!(
                text,
                "       {:>9.1e} {:>8.1e}  {percent:>8.0} %",
                s.ideal_error.max_m, s.ideal_error.rms_m
            ),
        };
        if let Some(wrong) = &s.first_wrong {
            let _ = writeln!(text, "    {}", describe(wrong));
        }
    }
    for check in &report.geometry {
        let Check { name, unit, worst, allowed, at: (row, column) } = check;
        let verdict = if check.passed() { "" } else { ": WRONG" };
        let _ = match allowed.is_finite() {
            true => write!(text, "  {name}: {worst:.1e} {unit} at most, {allowed:.1e} allowed{verdict}"),
            false => write!(text, "  {name}: {worst:.1e} {unit} at most{verdict}"),
        };
        text += &if check.passed() { "\n".to_owned() } else { format!(" at row {row}, column {column}\n") };
    }
    let hits: usize = report.shapes.iter().map(|s| s.hits).sum();
    text += if report.passed() {
        "  passed\n"
    } else if hits == 0 {
        "  FAILED: nothing was hit, so nothing was tested\n"
    } else {
        "  FAILED\n"
    };
    text
}

/// Writes metres with three figures.
fn short(metres: f64) -> String {
    let decimals =
        if metres >= 100.0 { 0 } else { 3 - usize::from(metres >= 1.0) - usize::from(metres >= 10.0) };
    format!("{metres:.decimals$}")
}

fn describe(wrong: &Wrong) -> String {
    let found = wrong.found_m.map_or_else(|| "nothing".to_owned(), |t| format!("{t:?} m"));
    let expected = wrong
        .expected_m
        .map_or_else(|| "nothing".to_owned(), |(low, high)| format!("a range from {low:?} to {high:?} m"));
    format!(
        "first wrong: row {}, column {}: {found}, where the formula says {expected}",
        wrong.row, wrong.column
    )
}

fn as_json(subject: &Subject, report: &SelftestReport) -> Value {
    let pattern = &subject.sensor.pattern;
    json!({
        "name": subject.name,
        "rows": pattern.rows(),
        "columns": pattern.columns(),
        "passed": report.passed(),
        "shapes": report.shapes.iter().map(shape_as_json).collect::<Vec<_>>(),
        "geometry": report.geometry.iter().map(|c| json!({
            "name": c.name,
            "unit": c.unit,
            "worst": c.worst,
            "allowed": c.allowed,
            "row": c.at.0,
            "column": c.at.1,
            "passed": c.passed(),
        })).collect::<Vec<_>>(),
    })
}

fn shape_as_json(s: &ShapeResult) -> Value {
    let range = |(low, high): (f64, f64)| json!([low, high]);
    json!({
        "shape": s.shape,
        "tessellated": s.tessellated,
        "distance_m": s.distance_m,
        "hits": s.hits,
        "misses": s.misses,
        "edges": s.edges,
        "wrong": s.wrong,
        "facet_error_max_m": s.facet_error.max_m,
        "facet_error_rms_m": s.facet_error.rms_m,
        "ideal_error_max_m": s.ideal_error.max_m,
        "ideal_error_rms_m": s.ideal_error.rms_m,
        "allowance_used": s.allowance_used,
        "first_wrong": s.first_wrong.map(|w| json!({
            "row": w.row,
            "column": w.column,
            "found_m": w.found_m,
            "expected_m": w.expected_m.map(range),
        })),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_figures() {
        let shown = [0.0475, 0.475, 8.0083, 13.45, 135.0].map(short);
        assert_eq!(shown, ["0.048", "0.475", "8.01", "13.4", "135"]);
    }
}
