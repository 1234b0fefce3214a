//! The declaration of a format, which stands in the format's own file.

use std::io::{self, Write};

use super::options::{OptionSpec, Options};
use super::sensor_frame::SensorFrame;
use crate::sensor::Sensor;

/// The declaration of a format. The rest of the program knows nothing else about the format.
///
/// A declaration names what is special about a format, and takes the rest from [`FormatSpec::PLAIN`].
pub struct FormatSpec {
    /// The name in a job.
    pub name: &'static str,
    /// The end of the names of the files, after the frame's number and a dot. It is unlike that of every other format, so that
    /// two formats of one kind, such as PNGs of depth and PNGs of labels, can lie beside each other.
    pub ending: &'static str,
    /// The content of the files, in a few words for lists.
    pub about: &'static str,
    /// The meaning of the numbers in the files.
    pub content: Content,
    /// The programs that the files were read back with, exactly; for the page of formats.
    pub read_by: &'static str,
    /// The options that a job can give.
    pub options: &'static [OptionSpec],
    /// Checks that the options that are given go together.
    pub check_options: fn(&Options) -> Result<(), EncodeError>,
    /// Checks that the frames of a sensor fit the format at all. The error names the number of the sensor that the format
    /// cannot represent.
    pub check: fn(&Sensor, &Options) -> Result<(), EncodeError>,
    /// A sentence about what frames of a sensor may have and the format would lose, with what would hold it.
    pub loses: fn(&Sensor, &Options) -> Option<String>,
    /// The number of a frame's values that the file lost.
    pub lost: fn(&SensorFrame, &Options) -> u64,
    /// The largest label of a surface that the files can hold.
    pub most_label: fn(&Options) -> u32,
    /// The largest id of an object that the files can hold.
    pub most_instance: fn(&Options) -> u32,
    /// The greatest memory that encoding takes for each ray of a sensor, in bytes.
    pub encoding_bytes_a_ray: fn(&Sensor, &Options) -> u64,
    /// The size of the file for each ray that returns, before any compression, in bytes.
    pub file_bytes_a_ray: fn(&Sensor, &Options) -> u64,
    /// Whether the steps of points' coordinates do not grow with the distance from the origin, as those of 32-bit floats do.
    pub has_even_steps: bool,
    /// Whether a file of a whole run has the points of all frames in one cloud.
    pub merges_clouds: bool,
    /// The way in which frames become files.
    pub kind: Kind,
}

impl FormatSpec {
    /// The fields that most formats have in common: no options, nothing that does not fit, and nothing that is lost. The fields
    /// that each format sets itself are empty here.
    pub const PLAIN: Self = Self {
        name: "",
        ending: "",
        about: "",
        content: Content::Pixels(&[]),
        read_by: "",
        options: &[],
        check_options: |_| Ok(()),
        check: |_, _| Ok(()),
        loses: |_, _| None,
        lost: |_, _| 0,
        most_label: |_| u32::MAX,
        most_instance: |_| u32::MAX,
        encoding_bytes_a_ray: |_, _| 0,
        file_bytes_a_ray: |_, _| 0,
        has_even_steps: false,
        merges_clouds: false,
        kind: Kind::File(|_, _| Ok(Vec::new())),
    };
}

/// The meaning of the numbers in the files of a format.
#[derive(Clone, Copy, Debug)]
pub enum Content {
    /// The channels that the job chooses, each an array of rows and columns.
    Channels,
    /// Points, each with these fields.
    Points(&'static [Field]),
    /// Pixels of rows and columns, each with these values.
    Pixels(&'static [Field]),
    /// Lines of text, each with these values.
    Lines(&'static [Field]),
    /// Arrays of their own shapes, one for each of these.
    Arrays(&'static [Field]),
}

/// A field of a point, or a value of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// The name.
    pub name: &'static str,
    /// The type, in the format's own words.
    pub kind: &'static str,
    /// The unit, or the meaning of a number without one.
    pub unit: &'static str,
}

/// Declares a field.
pub(super) const fn field(name: &'static str, kind: &'static str, unit: &'static str) -> Field {
    Field { name, kind, unit }
}

/// The way in which frames become files. The same frames give the same bytes, on any number of threads and any platform.
#[derive(Clone, Copy)]
pub enum Kind {
    /// One file for each frame. The function returns the content of the whole file.
    ///
    /// The error names the number of the frame that the format cannot represent, such as a label above 2³¹ − 1 in a PLY.
    File(fn(&SensorFrame, &Options) -> Result<Vec<u8>, EncodeError>),
    /// One file for each run, to which all frames of all sensors are added in order, as in bags and in clouds of a whole
    /// drive. The function is told of all the sensors.
    Stream(fn(&[&Sensor], &Options) -> Box<dyn Stream>),
    /// One of the other kinds, as the options say.
    Chosen(fn(&Options) -> Kind),
}

/// A file that grows frame by frame. The written part is not used before [`Stream::finish`].
pub trait Stream: Send {
    /// Adds a frame.
    ///
    /// # Errors
    /// An error if the frame has a number that the format cannot represent, or if the file cannot be written.
    fn add(&mut self, frame: &SensorFrame, file: &mut dyn Write) -> Result<(), EncodeError>;

    /// Writes the part of the file that follows the last frame.
    ///
    /// # Errors
    /// An error if the file cannot be written.
    fn finish(&mut self, file: &mut dyn Write) -> Result<(), EncodeError>;

    /// The bytes that replace the first ones of the finished file, where the beginning of a file tells what follows. Most
    /// formats have none.
    fn head(&self) -> Vec<u8> {
        Vec::new()
    }
}

/// The reason why a frame cannot be encoded in a format.
#[derive(Debug, thiserror::Error)]
#[error("{problem}")]
pub struct EncodeError {
    problem: String,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl EncodeError {
    /// An error that says which number the format cannot represent, and which would fit.
    pub fn new(problem: impl Into<String>) -> Self {
        Self { problem: problem.into(), source: None }
    }
}

impl From<io::Error> for EncodeError {
    fn from(error: io::Error) -> Self {
        Self { problem: format!("it can't be written: {error}"), source: Some(Box::new(error)) }
    }
}
