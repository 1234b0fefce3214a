//! `beamcast presets`: lists and shows the built-in sensors.

use std::path::PathBuf;

use clap::builder::StringValueParser;
use serde_json::{Value, json};

use super::facts::{grouped, tidy};
use super::json;
use super::shell::presets_or;
use super::terminal::Terminal;
use crate::config::{self, SensorFile, presets};
use crate::error::Error;
use crate::output::plot::{Dot, colour_of, scatter};
use crate::output::{Entry, check_file, ticks, with_legend, write_file};
use crate::run::facts::SensorSizes;
use crate::sensor::facts::SensorFacts;
use crate::sensor::{Capture, Sensor, azimuth_elevation};
use crate::source::words::counted;

/// The arguments of `beamcast presets`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: Option<What>,
    /// Print the file of this sensor, as `show` does
    #[arg(value_name = "NAME")]
    name: Option<String>,
    /// Print the list as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// List the built-in sensors [default]
    List {
        /// Print the list as JSON
        #[arg(long)]
        json: bool,
    },
    /// Print a sensor's file, or plot where its beams go
    Show {
        /// The sensor, such as ouster/os1-128
        #[arg(value_name = "NAME", value_parser = presets_or(StringValueParser::new()), hide_possible_values = true)]
        name: String,
        /// Plot the directions of its beams into this file: azimuth by elevation, coloured by time
        #[arg(long, value_name = "FILE")]
        png: Option<PathBuf>,
        /// Plot this many frames, one after the other; some patterns do not repeat
        #[arg(long, value_name = "N", default_value_t = 1, requires = "png",
              value_parser = clap::value_parser!(u32).range(1..=1000))]
        frames: u32,
        /// Plot the sensor in this mode
        #[arg(long, value_name = "MODE", requires = "png")]
        mode: Option<String>,
        /// Replace the file if it is there already
        #[arg(long, requires = "png")]
        overwrite: bool,
    },
}

/// The largest number of dots in a plot. More dots would only hide each other.
const MOST_DOTS: usize = 20_000_000;

/// Lists the built-in sensors, or shows one.
///
/// # Errors
/// [`Error::Config`] if there is no such sensor, [`Error::Usage`] if there is no such mode, [`Error::Output`] if the plot
/// can't be written.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    match &args.what {
        None => match &args.name {
            Some(name) => show(name, terminal),
            None => list(args.json, terminal),
        },
        Some(What::List { json }) => list(*json || args.json, terminal),
        Some(What::Show { name, png: None, .. }) => show(name, terminal),
        Some(What::Show { name, png: Some(path), frames, mode, overwrite }) => {
            let file = config::load_preset(name)?;
            let sensor = sensor_in(&file, name, mode.as_deref())?;
            let title = mode.as_ref().map_or_else(|| name.clone(), |mode| format!("{name}, mode {mode}"));
            let plot = plot(&title, sensor, *frames).map_err(|e| Error::output(path, e))?;
            check_file(path, *overwrite)?;
            write_file(path, &plot.0)?;
            terminal.say_lines(&plot.1);
            Ok(())
        }
    }
}

/// Prints a sensor's file.
fn show(name: &str, terminal: &Terminal) -> Result<(), Error> {
    config::load_preset(name)?;
    // A copy of this file has no schema two folders up. It may have one beside it, as an imported file has.
    let text = presets::text(name).unwrap_or_default();
    terminal.data(&text.replacen("#:schema ../../schema/sensor.json", "#:schema sensor.schema.json", 1))
}

fn sensor_in<'a>(file: &'a SensorFile, name: &str, mode: Option<&str>) -> Result<&'a Sensor, Error> {
    let Some(mode) = mode else { return Ok(&file.sensor) };
    let found = file.modes.iter().find(|(known, _)| known == mode).map(|(_, sensor)| sensor);
    found.ok_or_else(|| {
        let modes: Vec<&str> = file.modes.iter().map(|(mode, _)| mode.as_str()).collect();
        let modes = if modes.is_empty() { "none".to_owned() } else { modes.join(", ") };
        Error::Usage(format!("{name} has no mode {mode:?}; its modes: {modes}"))
    })
}

fn list(as_json: bool, terminal: &Terminal) -> Result<(), Error> {
    let mut files = Vec::new();
    for (name, _) in presets::BUILT_IN {
        files.push((*name, config::load_preset(name)?));
    }
    if as_json {
        let all: Vec<Value> = files.iter().map(|(name, file)| as_value(name, file)).collect();
        return terminal.json(&json::PRESETS.of(json!({ "presets": all })));
    }
    terminal.data(&as_table(&files))
}

fn as_value(name: &str, file: &SensorFile) -> Value {
    let mode = |(name, sensor): &(String, crate::sensor::Sensor)| json!({ "name": name, "sensor": SensorSizes::of(None, sensor, &[]) });
    json!({
        "name": name,
        "pattern": file.sensor.pattern.name(),
        "sensor": SensorSizes::of_file(file, &[]),
        "modes": file.modes.iter().map(mode).collect::<Vec<_>>(),
    })
}

/// A table of the sensors, with columns as wide as their contents.
fn as_table(files: &[(&str, SensorFile)]) -> String {
    let head = ["sensor", "pattern", "image", "field of view", "rate", "points/s", "range", "modes"];
    let mut rows = vec![head.map(str::to_owned)];
    for (name, file) in files {
        let facts = SensorFacts::of(&file.sensor);
        let [low, high] = facts.elevation_deg;
        let degrees = |x: f64| (x * 10.0).round() / 10.0;
        let modes: Vec<&str> = file.modes.iter().map(|(mode, _)| mode.as_str()).collect();
        rows.push([
            (*name).to_owned(),
            file.sensor.pattern.name().to_owned(),
            format!("{} × {}", facts.rows, facts.columns),
            format!(
                "{}° × {}° ({}° to {}°)",
                degrees(facts.horizontal_fov_deg),
                degrees(high - low),
                degrees(low),
                degrees(high)
            ),
            facts.rate_hz.map_or(String::new(), |rate| format!("{} Hz", tidy(rate))),
            facts.points_per_second.map_or(String::new(), |points| grouped(points.round() as u64)),
            match facts.max_range_m {
                Some(max) => format!("{} to {max} m", facts.min_range_m),
                None => "any".to_owned(),
            },
            modes.join(" "),
        ]);
    }
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let line = |row: &[String; 8]| {
        let cells = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

/// A picture of the directions of the pulses of `frames` frames with a legend, and a sentence about it.
fn plot(title: &str, sensor: &Sensor, frames: u32) -> Result<(Vec<u8>, String), String> {
    let pattern = &sensor.pattern;
    let (rays, columns) = (pattern.rays(), pattern.columns());
    let total = rays * frames as usize;
    if total > MOST_DOTS {
        return Err(format!("{total} directions are too many for a plot: at most {MOST_DOTS}"));
    }
    let period = pattern.rate_hz().map_or(0.0, |rate| 1.0 / rate);
    let end = period * f64::from(frames - 1) + pattern.last_pulse_s();
    // A camera without a shutter's time has all its pixels at once.
    let part = |time_s: f64| if end > 0.0 { time_s / end } else { 0.5 };
    let mut dots = Vec::with_capacity(total);
    for frame in 0..frames {
        let capture = Capture::at_origin(sensor).with_frame(frame.into());
        for index in 0..rays {
            let Some(pulse) = capture.pulse(index / columns, index % columns) else { continue };
            let (azimuth, elevation) = azimuth_elevation(pulse.direction);
            dots.push(Dot { azimuth, elevation, colour: colour_of(part(capture.start_s + pulse.time_s)) });
        }
    }
    let picture = scatter(&dots).map_err(|e| e.to_string())?;
    let title = format!("{title}: directions of {}", counted(frames as usize, "frame"));
    let mut entries =
        vec![Entry::Note("across: azimuth, left is positive; up: elevation; both in degrees".to_owned())];
    if end > 0.0 {
        let ticks = ticks(0.0, end * 1e3, false, 5);
        entries.insert(0, Entry::Ramp { name: "time, ms".to_owned(), ticks, colour: &colour_of });
    }
    let file = with_legend(picture, &title, &entries).to_png().map_err(|e| e.to_string())?;
    let extent = |of: fn(&Dot) -> f64| {
        let ends =
            dots.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        format!("{} to {}", tidy(ends.0), tidy(ends.1))
    };
    let said = format!(
        "{} directions {}; azimuth {}°, positive to the left, elevation {}°",
        grouped(dots.len() as u64),
        if end > 0.0 {
            format!("in {} ms, blue first and red last", tidy(end * 1e3))
        } else {
            "at the same time".to_owned()
        },
        extent(|dot| dot.azimuth.degrees()),
        extent(|dot| dot.elevation.degrees()),
    );
    Ok((file, said))
}
