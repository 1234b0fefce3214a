//! Calibrations as vendors' tools write them → sensor files.
//!
//! ```text
//! document     YAML and JSON: a tree whose values know where they were written
//! table        CSV
//! report       what is wrong with a file, each at its place
//! writer       the sensor file as text; lidar what it says of one
//! ouster  velodyne  hesai  robosense  camera  rays      one a format: which of its numbers mean what
//! ```
//!
//! Files are taken for hostile: no text makes a panic, and what it makes is no longer than a multiple of it. Nothing here
//! opens a file.

mod camera;
mod document;
mod hesai;
mod lidar;
mod ouster;
mod rays;
mod report;
mod robosense;
mod table;
mod velodyne;
mod writer;

use crate::source::Diagnostic;
use report::Report;
use writer::Toml;

/// Most bytes of a file that is imported.
pub const MAX_FILE_BYTES: u64 = 4 << 20;

/// A kind of file that can be imported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// An Ouster sensor's metadata: JSON, flat as firmware before 2.2 writes it, or nested.
    Ouster,
    /// The calibration of the ROS driver for Velodyne: YAML.
    Velodyne,
    /// Hesai's angle correction: CSV of channel, elevation, azimuth.
    Hesai,
    /// RoboSense's angles: CSV of elevation, azimuth, without a head.
    Robosense,
    /// A camera's intrinsics: ROS's camera_info or OpenCV's calibration, YAML.
    Camera,
    /// A ray a line: CSV.
    Rays,
}

impl Format {
    /// Every format.
    pub const ALL: [Self; 6] =
        [Self::Ouster, Self::Velodyne, Self::Hesai, Self::Robosense, Self::Camera, Self::Rays];

    /// What people call it.
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

    /// What a file is, by its content. `None` if it's nothing known.
    pub fn of(text: &str) -> Option<Self> {
        let text = text.trim_start_matches('\u{feff}').trim_start();
        if text.starts_with('{') {
            return Some(Self::Ouster);
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
        let first = table::rows(text).find(|row| !row.cells[0].text.starts_with('#'))?;
        let head: Vec<String> = first.cells.iter().map(|cell| cell.text.to_lowercase()).collect();
        if hesai::is_head(&head) {
            Some(Self::Hesai)
        } else if rays::is_head(&head) {
            Some(Self::Rays)
        } else if head.len() == 2 && head.iter().all(|cell| cell.parse::<f64>().is_ok()) {
            Some(Self::Robosense)
        } else {
            None
        }
    }
}

/// A file to import: its name, as messages and the sensor file tell it, and its text.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// The file's name as the user gave it.
    pub name: &'a str,
    /// The whole text.
    pub text: &'a str,
}

/// The sensor file that a calibration makes. `firetimes` is Hesai's firetime correction, if there is one.
///
/// # Errors
/// Everything that is wrong with the files, each at its place; at least one.
pub fn import(
    format: Format,
    file: Source<'_>,
    firetimes: Option<Source<'_>>,
) -> Result<String, Vec<Diagnostic>> {
    let report = Report::new(file.name, file.text);
    let mut toml = Toml::default();
    toml.line("#:schema sensor.schema.json");
    let made = match (format, firetimes) {
        (Format::Hesai, Some(firetimes)) => {
            let times = Report::new(firetimes.name, firetimes.text);
            let made = hesai::write(&report, Some(&times), &mut toml);
            let mut found = report.into_diagnostics();
            found.extend(times.into_diagnostics());
            return finish(made, toml, found);
        }
        (Format::Hesai, None) => hesai::write(&report, None, &mut toml),
        (_, Some(firetimes)) => {
            let message = format!("`{}` is of no use here", firetimes.name);
            report.error(
                0..0,
                message,
                "",
                format!("firetimes go with a Hesai angle correction; this is {}", format.name()),
            )
        }
        (Format::Ouster, None) => ouster::write(&report, &mut toml),
        (Format::Velodyne, None) => velodyne::write(&report, &mut toml),
        (Format::Robosense, None) => robosense::write(&report, &mut toml),
        (Format::Camera, None) => camera::write(&report, &mut toml),
        (Format::Rays, None) => rays::write(&report, &mut toml),
    };
    finish(made, toml, report.into_diagnostics())
}

fn finish(made: Option<()>, toml: Toml, found: Vec<Diagnostic>) -> Result<String, Vec<Diagnostic>> {
    match made {
        Some(()) if found.is_empty() => Ok(toml.into_text()),
        _ => Err(found),
    }
}

/// The last part of a path, for a comment: what a user's folders are called is no one's business.
fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}
