//! `beamcast import`: makes a sensor file of a unit's calibration.

use std::path::{Path, PathBuf};

use super::terminal::Terminal;
use crate::error::Error;
use crate::import::{self, Format, MAX_TABLE_BYTES, Source};
use crate::output::{check_file, write_file};
use crate::run::paths::seen_from;
use crate::source::{FileKind, Wanted, read_file, recognise};

/// The arguments of `beamcast import`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The calibration
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Write the sensor file here instead of to stdout
    #[arg(short, long, visible_alias = "out", value_name = "SENSOR.toml")]
    output: Option<PathBuf>,
    /// The format of the file, if it is not recognised by its content
    #[arg(long = "as", value_enum, value_name = "FORMAT")]
    format: Option<As>,
    /// The unit's firetime correction (Hesai)
    #[arg(long, value_name = "FILE")]
    firetimes: Option<PathBuf>,
    /// The camera to take of a file with several, such as cam1
    #[arg(long, value_name = "NAME", conflicts_with = "firetimes")]
    camera: Option<String>,
    /// Replace the sensor file if it is there already
    #[arg(long, requires = "output")]
    overwrite: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum As {
    /// An Ouster sensor's metadata, JSON
    Ouster,
    /// The calibration of the ROS driver for Velodyne, YAML
    Velodyne,
    /// Hesai's angle correction, CSV
    Hesai,
    /// RoboSense's angles, CSV
    Robosense,
    /// A camera's intrinsics: ROS, OpenCV, Kalibr, Open3D, librealsense
    Camera,
    /// A table of rays, such as Livox's pattern tables, CSV
    Rays,
}

impl From<As> for Format {
    fn from(format: As) -> Self {
        match format {
            As::Ouster => Self::Ouster,
            As::Velodyne => Self::Velodyne,
            As::Hesai => Self::Hesai,
            As::Robosense => Self::Robosense,
            As::Camera => Self::Camera,
            As::Rays => Self::Rays,
        }
    }
}

/// Writes the sensor file.
///
/// # Errors
/// [`Error::Config`] with every problem of the calibration, [`Error::Input`] if it can't be read or is of no known format,
/// [`Error::Output`] if the sensor file is there already or can't be written.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    if let Some(output) = &args.output {
        check_file(output, args.overwrite)?;
    }
    let text = read(&args.file)?;
    let format = match args.format {
        Some(format) => format.into(),
        None => Format::of(&text).ok_or_else(|| Error::input(&args.file, no_calibration(&text)))?,
    };
    // The sensor file names the table of rays by its path as seen from the sensor file.
    let name = match (&args.output, format) {
        (Some(output), Format::Rays) => seen_from(output.parent().unwrap_or(Path::new("")), &args.file),
        _ => args.file.to_string_lossy().into_owned(),
    };
    let firetimes = match &args.firetimes {
        Some(path) => Some((path.to_string_lossy(), read(path)?)),
        None => None,
    };
    let firetimes = firetimes.as_ref().map(|(name, text)| Source { name, text });
    let source = Source { name: &name, text: &text };
    let sensor = match &args.camera {
        Some(camera) if format == Format::Camera => import::import_camera(source, camera),
        Some(_) => {
            let problem =
                format!("this is {}, which has no cameras for --camera to choose from", format.name());
            return Err(Error::input(&args.file, problem));
        }
        None => import::import(format, source, firetimes),
    }
    .map_err(Error::Config)?;
    terminal.say(format_args!("{}: {}", args.file.display(), format.name()));
    let Some(output) = &args.output else { return terminal.data(&sensor) };
    write_file(output, sensor.as_bytes())?;
    terminal.say(format_args!(
        "wrote {}; its first comment says which values of the calibration are used",
        output.display()
    ));
    Ok(())
}

/// The sentence about a text that is of no format that can be imported.
fn no_calibration(text: &str) -> String {
    let known: Vec<_> = Format::ALL.map(Format::name).into();
    let known = format!("known are {}; --as gives the format", known.join(", "));
    let kind = FileKind::of(text.as_bytes(), text.len() as u64);
    if kind.is_unknown() {
        return format!("this is no known calibration ({known})");
    }
    let (problem, help) = kind.instead_of(Wanted::Calibration);
    format!("{problem} ({})", help.unwrap_or(known))
}

/// Reads a file as a text. Tables of rays are longer than calibrations, which [`import::import`] limits.
fn read(path: &Path) -> Result<String, Error> {
    let bytes = read_file(path, MAX_TABLE_BYTES);
    // What is no text, or too large for a calibration, is probably another kind of file.
    let is_text = bytes.as_ref().is_ok_and(|bytes| std::str::from_utf8(bytes).is_ok());
    if !is_text
        && let Ok(kind) = recognise(path)
        && !kind.is_unknown()
    {
        return Err(Error::input(path, kind.text_instead_of(Wanted::Calibration)));
    }
    String::from_utf8(bytes.map_err(|e| Error::input(path, e))?).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        let line = e.as_bytes()[..at].iter().filter(|b| **b == b'\n').count() + 1;
        Error::input(path, format!("this is not UTF-8 text: byte 0x{:02x} in line {line}", e.as_bytes()[at]))
    })
}
