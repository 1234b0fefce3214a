//! The registry of formats: one declaration each, in the format's own file.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::io::{self, Write};

use super::{SensorFrame, exr, ply, png};
use crate::sensor::Sensor;

/// Every format that a job can name, in the order in which lists show them.
pub static FORMATS: &[&FormatSpec] = &[&exr::FORMAT, &ply::FORMAT, &png::FORMAT];

/// The declaration of a format: all that the rest of the program knows of it.
pub struct FormatSpec {
    /// What a job calls the format; also the file name's extension.
    pub name: &'static str,
    /// What its files hold, in a few words for lists.
    pub about: &'static str,
    /// Whether the frames of a sensor fit the format at all. The error says which number of the sensor the format has no
    /// room for.
    pub check: fn(&Sensor) -> Result<(), EncodeError>,
    /// The memory that encoding takes for each ray of a sensor, at most, in bytes.
    pub encoding_bytes_a_ray: fn(&Sensor) -> u64,
    /// How large the file is for each ray that returns, before any compression, in bytes.
    pub file_bytes_a_ray: fn(&Sensor) -> u64,
    /// How frames become files.
    pub kind: Kind,
}

/// How frames become files. The same frames give the same bytes, on any number of threads and any platform.
pub enum Kind {
    /// A file a frame: the whole file's content.
    ///
    /// The error says which number of the frame the format has no room for, such as a label above 2³¹ − 1 in a PLY.
    File(fn(&SensorFrame) -> Result<Vec<u8>, EncodeError>),
    /// A file a run, into which all frames of all sensors go in their order: bags, and clouds of a whole drive.
    Stream(fn() -> Box<dyn Stream>),
}

/// A file that grows frame by frame. What it has written so far is not looked at before [`Stream::finish`].
pub trait Stream: Send {
    /// Adds a frame.
    ///
    /// # Errors
    /// When the frame has a number that the format has no room for, or the file takes no more.
    fn add(&mut self, frame: &SensorFrame, file: &mut dyn Write) -> Result<(), EncodeError>;

    /// Writes what comes after the last frame.
    ///
    /// # Errors
    /// When the file takes no more.
    fn finish(&mut self, file: &mut dyn Write) -> Result<(), EncodeError>;
}

/// Why a frame can't be had in a format.
#[derive(Debug, thiserror::Error)]
#[error("{problem}")]
pub struct EncodeError {
    problem: String,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl EncodeError {
    /// An error that says which number there is no room for, and what would fit.
    pub fn new(problem: impl Into<String>) -> Self {
        Self { problem: problem.into(), source: None }
    }
}

impl From<io::Error> for EncodeError {
    fn from(error: io::Error) -> Self {
        Self { problem: format!("it can't be written: {error}"), source: Some(Box::new(error)) }
    }
}

/// A format, by its declaration.
#[derive(Clone, Copy)]
pub struct Format(
    /// The declaration. Of two formats with the same name, a job can name one only.
    pub &'static FormatSpec,
);

impl Format {
    /// OpenEXR range images of all channels.
    pub const EXR: Self = Self(&exr::FORMAT);
    /// Binary PLY point clouds.
    pub const PLY: Self = Self(&ply::FORMAT);
    /// Colour previews of the range.
    pub const PNG: Self = Self(&png::FORMAT);

    /// Every format of the registry.
    pub fn all() -> impl Iterator<Item = Self> {
        FORMATS.iter().map(|spec| Self(spec))
    }

    /// The format that a job calls `name`.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().find(|format| format.name() == name)
    }

    /// What a job calls the format; also the file name's extension.
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// Whether the frames of `sensor` fit the format; to be asked before casting them.
    ///
    /// # Errors
    /// Says which number of the sensor the format has no room for.
    pub fn check(self, sensor: &Sensor) -> Result<(), EncodeError> {
        (self.0.check)(sensor)
    }

    /// An upper estimate of the memory that encoding takes, in bytes for each ray of `sensor`.
    pub fn encoding_bytes_a_ray(self, sensor: &Sensor) -> u64 {
        (self.0.encoding_bytes_a_ray)(sensor)
    }

    /// The whole content of the file of one frame.
    ///
    /// # Errors
    /// When the frame has a number that the format has no room for, such as a label above 2³¹ − 1 in a PLY. A format of one
    /// file a run has no file of one frame.
    pub fn encode(self, frame: &SensorFrame) -> Result<Vec<u8>, EncodeError> {
        match self.0.kind {
            Kind::File(encode) => encode(frame),
            Kind::Stream(_) => {
                Err(EncodeError::new(format!("{} is one file a run, and has none of one frame", self.name())))
            }
        }
    }
}

impl PartialEq for Format {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Format {}

impl Hash for Format {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.name().hash(state);
    }
}

impl fmt::Debug for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Format({:?})", self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_format_has_a_name_of_its_own_that_a_file_can_end_in() {
        let names: BTreeSet<_> = Format::all().map(Format::name).collect();
        assert_eq!(names.len(), FORMATS.len());
        assert!(names.iter().all(|name| name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit())));
        assert!(Format::all().all(|format| Format::named(format.name()) == Some(format)));
        assert_eq!(Format::named("EXR"), None);
    }
}
