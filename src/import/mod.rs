//! Calibrations as vendors' tools write them → sensor files.
//!
//! ```text
//! file         a vendor's file, as a tree of YAML or JSON or as the rows of a CSV, and the report of its problems
//! fields       a table of YAML or JSON that is being read
//! ouster  velodyne  hesai  robosense  camera  rays      one a format: the meaning of its numbers
//! lidar        the keys of a rotating LiDAR, which four of the formats come to
//! writer       the sensor file as text
//! ```
//!
//! Every file may be hostile: no text makes a panic, and the sensor file's length is bounded by a multiple of the text's.
//! Nothing here opens a file.

mod camera;
mod fields;
mod file;
mod hesai;
mod lidar;
mod ouster;
mod rays;
mod robosense;
mod velodyne;
mod writer;

use crate::config;
use crate::source::csv::rows;
use crate::source::words::quoted;
use crate::source::{Diagnostic, FileKind, Layer, MAX_TEXT_BYTES, Report, Unit};
use file::File;
use writer::Toml;

/// The most bytes that are read of a file to import, unless it is a table of rays.
pub const MAX_FILE_BYTES: u64 = MAX_TEXT_BYTES;

/// The most bytes that are read of a table of rays, of which only the lines are counted.
pub const MAX_TABLE_BYTES: u64 = 256 << 20;

/// A kind of file that can be imported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// An Ouster sensor's metadata: JSON, flat as firmware before 2.2 writes it, or nested.
    Ouster,
    /// The calibration of the ROS driver for Velodyne: YAML.
    Velodyne,
    /// Hesai's angle correction: CSV of channel, elevation, azimuth.
    Hesai,
    /// RoboSense's angles: CSV of elevation, azimuth, without a header.
    Robosense,
    /// A camera's intrinsics: ROS's camera_info, OpenCV's calibration or Kalibr's, YAML, or Open3D's or librealsense's, JSON.
    Camera,
    /// A table of rays, Livox's pattern tables among them: CSV with one ray a line.
    Rays,
}

impl Format {
    /// Every format.
    pub const ALL: [Self; 6] =
        [Self::Ouster, Self::Velodyne, Self::Hesai, Self::Robosense, Self::Camera, Self::Rays];

    /// The format's name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ouster => "Ouster metadata",
            Self::Velodyne => "a Velodyne calibration",
            Self::Hesai => "a Hesai angle correction",
            Self::Robosense => "RoboSense angles",
            Self::Camera => "camera intrinsics",
            Self::Rays => "a table of rays",
        }
    }

    /// The format of a file, by its content. `None` if no format is recognised.
    pub fn of(text: &str) -> Option<Self> {
        let text = text.trim_start_matches('\u{feff}').trim_start();
        match FileKind::of(text.as_bytes(), text.len() as u64) {
            FileKind::Calibration(Unit::Ouster) => return Some(Self::Ouster),
            FileKind::Calibration(Unit::Camera) => return Some(Self::Camera),
            // Streams by their names, or a matrix within what holds it: no key of the outermost table is a camera's.
            _ if text.starts_with('{') => return camera::is_nested(text).then_some(Self::Camera),
            _ => {}
        }
        let has_key = |key: &str| {
            text.lines().any(|line| {
                line.trim_start().strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with(':'))
            })
        };
        if has_key("lasers") {
            return Some(Self::Velodyne);
        }
        if text.starts_with("%YAML") || camera::KEYS.iter().any(|key| has_key(key)) {
            return Some(Self::Camera);
        }
        let first = rows(text, 0).find(|row| !row.is_comment() && !row.is_empty())?;
        let header = first.lowercase();
        if hesai::is_header(&header) {
            Some(Self::Hesai)
        } else if rays::is_header(&header) {
            Some(Self::Rays)
        } else if header.len() <= 3 && header.iter().all(|cell| cell.parse::<f64>().is_ok()) {
            Some(Self::Robosense)
        } else {
            None
        }
    }
}

/// A file to import: its name in messages and in the sensor file's comments, and its text.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// The file's name as the user gave it.
    pub name: &'a str,
    /// The whole text.
    pub text: &'a str,
}

/// Makes a sensor file of a calibration. `firetimes` is Hesai's firetime correction, if there is one.
///
/// # Errors
/// Every problem of the files, each with its place; at least one.
pub fn import(
    format: Format,
    file: Source<'_>,
    firetimes: Option<Source<'_>>,
) -> Result<String, Vec<Diagnostic>> {
    convert(format, file, firetimes, None)
}

/// Makes a sensor file of one camera of a calibration, by its name in the file, such as `cam1`.
///
/// # Errors
/// Every problem of the file, each with its place; at least one.
pub fn import_camera(file: Source<'_>, camera: &str) -> Result<String, Vec<Diagnostic>> {
    convert(Format::Camera, file, None, Some(camera))
}

fn convert(
    format: Format,
    file: Source<'_>,
    firetimes: Option<Source<'_>>,
    camera: Option<&str>,
) -> Result<String, Vec<Diagnostic>> {
    let mut report = Report::default();
    let mut add = |file: Source<'_>| report.add(file.name, file.text.to_owned(), Layer::Main);
    let source = add(file);
    let of_firetimes = firetimes.map(|firetimes| (firetimes.name, add(firetimes)));
    let file = File { report: &report, source, name: file.name };
    let firetimes = of_firetimes.map(|(name, source)| File { report: &report, source, name });

    let mut toml = Toml::default();
    toml.line("#:schema sensor.schema.json");
    let most = if format == Format::Rays { MAX_TABLE_BYTES } else { MAX_FILE_BYTES };
    if report.text(source).len() as u64 > most {
        let message = format!("the file has {} bytes, more than any calibration", report.text(source).len());
        report.error(file.whole(), message, format!("expected at most {most}"), None);
        return Err(report.into_diagnostics());
    }
    let made = match (format, firetimes) {
        (Format::Hesai, firetimes) => hesai::write(file, firetimes, &mut toml),
        (_, Some(firetimes)) => {
            let message = format!("{} does not go with {}", quoted(firetimes.name), format.name());
            let help = "firing times go with a Hesai angle correction".to_owned();
            file.fail(file.whole(), message, "", help)
        }
        (Format::Ouster, None) => ouster::write(file, &mut toml),
        (Format::Velodyne, None) => velodyne::write(file, &mut toml),
        (Format::Robosense, None) => robosense::write(file, &mut toml),
        (Format::Camera, None) => camera::write(file, camera, &mut toml),
        (Format::Rays, None) => rays::write(file, &mut toml),
    };
    let text = toml.into_text();
    if made.is_some() && text.len() as u64 > MAX_TEXT_BYTES {
        let bytes = text.len();
        let message =
            format!("the sensor file would have {bytes} bytes, and at most {MAX_TEXT_BYTES} are read");
        let help = "no sensor has so many beams: is this the right file?".to_owned();
        report.error(file.whole(), message, "", Some(help));
    }
    // Rays are read from their own file when the sensor file is.
    if made.is_some()
        && !report.has_errors()
        && format != Format::Rays
        && let Some(problem) = config::problem_of_sensor(&text)
    {
        let message = format!("the sensor file of this calibration would be refused: {problem}");
        report.error(file.whole(), message, "", None);
    }
    let found = report.into_diagnostics();
    match made {
        Some(()) if found.is_empty() => Ok(text),
        _ => Err(found),
    }
}
