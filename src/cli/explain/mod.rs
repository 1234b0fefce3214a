//! `beamcast explain`: the story of one pulse in words.

mod document;
mod drawing;
mod plot;
mod told;
mod words;

use std::path::{Path, PathBuf};

use self::told::Told;
use super::interrupt::Interrupt;
use super::job::{JobArgs, load_scene};
use super::json;
use super::terminal::Terminal;
use super::threads;
use crate::config::{Job, MountedSensor};
use crate::error::Error;
use crate::output::{check_file, write_file};
use crate::run::{Bytes, Holding, Item, Plan, Selection, Session, Shard};
use crate::source::words::{list, quoted};

/// The arguments of `beamcast explain`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    job: JobArgs,
    /// The row of the pixel, from 0
    #[arg(value_name = "ROW")]
    row: usize,
    /// The column of the pixel, from 0
    #[arg(value_name = "COLUMN")]
    column: usize,
    /// The frame of the sequence, from 0
    #[arg(long, value_name = "K", default_value_t = 0)]
    frame: u64,
    /// The sensor [default: the job's only one]
    #[arg(long, value_name = "NAME")]
    sensor: Option<String>,
    /// Draw the waveform as a picture
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// Write the waveform as a table of ranges and heights
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Replace files that are there already
    #[arg(long)]
    overwrite: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Args {
    /// The threads to work on.
    pub fn threads(&self) -> threads::Args {
        self.job.threads
    }
}

/// Tells the story of a pixel's pulse on stdout.
///
/// # Errors
/// The errors of the job and the scene; [`Error::Usage`] if there is no such sensor, frame or pixel, or no waveform to write;
/// [`Error::Output`] if a file can't be written.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    for path in [&args.svg, &args.csv].into_iter().flatten() {
        check_file(path, args.overwrite)?;
    }
    let mut job = args.job.load(terminal)?;
    let item = Item { sensor: chosen(&job, args)?, frame: args.frame, outputs: Vec::new() };
    check(&job, &item, args)?;
    let frames = args.frame..args.frame.saturating_add(1);
    let plan = Plan::of(&job, &Selection { frames, shard: Shard::WHOLE }, Holding::Frame)?;
    let scene = load_scene(&mut job, &args.job.scenes, terminal)?.scene;
    interrupt.check()?;
    plan.check_scene(&scene)?;
    let session = Session::open(job, &scene);
    let session = session.of_frame(args.frame, &args.job.scenes.allowed_folders)?;
    let MountedSensor { name, sensor, .. } = session.sensor(&item);
    let Some(story) = session.explain(&item, args.row, args.column) else {
        return check(&session.job, &item, args);
    };
    interrupt.check()?;
    let told = Told {
        story: &story,
        scene: session.scene(),
        sensor,
        sensor_name: name,
        frame: args.frame,
        label_names: session.label_names(),
    };
    if let Some(signal) = &story.signal {
        let write = |path: &Path, content: String| -> Result<(), Error> {
            interrupt.uncut(|| write_file(path, content.as_bytes()))?;
            terminal.say(format_args!("wrote {} ({})", path.display(), Bytes(content.len() as u64)));
            Ok(())
        };
        if let Some(path) = &args.svg {
            write(path, drawing::svg(&told, signal))?;
        }
        if let Some(path) = &args.csv {
            write(path, drawing::csv(&told, signal))?;
        }
    }
    if args.json {
        return terminal.json(&json::EXPLAIN.of(document::of(&told)));
    }
    let mut text = words::title(&told) + "\n\n";
    for line in words::lines(&told) {
        text += &words::wrapped(&line);
        text.push('\n');
    }
    if let Some(signal) = &story.signal
        && signal.window_m().is_some()
    {
        text.push('\n');
        text += &plot::text(&told, signal);
    }
    terminal.print(&text)
}

/// The sensor that is asked for.
fn chosen(job: &Job, args: &Args) -> Result<usize, Error> {
    let names = || job.sensors.iter().map(|sensor| sensor.name.as_str());
    match &args.sensor {
        Some(name) => names().position(|one| one == name).ok_or_else(|| {
            let (name, plural) = (quoted(name), if job.sensors.len() == 1 { " is" } else { "s are" });
            Error::Usage(format!("the job has no sensor {name}: its sensor{plural} {}", list(names(), "and")))
        }),
        None if job.sensors.len() == 1 => Ok(0),
        None => {
            let names = list(names(), "or");
            Err(Error::Usage(format!("the job has several sensors: --sensor chooses {names}")))
        }
    }
}

/// Whether the frame of a sensor has the pixel that is asked for, and a waveform if one is to be written.
fn check(job: &Job, item: &Item, args: &Args) -> Result<(), Error> {
    let MountedSensor { name, sensor, .. } = &job.sensors[item.sensor];
    let name = quoted(name);
    let within = |what: &str, number: u64, count: u64| match number < count {
        true => Ok(()),
        false if count == 1 => {
            Err(Error::Usage(format!("sensor {name} has no {what} {number}: its only {what} is 0")))
        }
        false => {
            let last = count - 1;
            Err(Error::Usage(format!("sensor {name} has no {what} {number}: its {what}s are 0 to {last}")))
        }
    };
    within("frame", item.frame, job.sequence.frames_of(sensor))?;
    within("row", args.row as u64, sensor.pattern.rows() as u64)?;
    within("column", args.column as u64, sensor.pattern.columns() as u64)?;
    if sensor.measurement.is_ideal() && (args.svg.is_some() || args.csv.is_some()) {
        return Err(Error::Usage(format!(
            "sensor {name} is ideal and has no waveform to write: a table [sensor.receiver] or `nominal = true` gives it one"
        )));
    }
    Ok(())
}
