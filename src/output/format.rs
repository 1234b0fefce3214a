//! The declaration of a format, which stands in the format's own file.

use std::io::{self, Write};

use super::sensor_frame::SensorFrame;
use crate::sensor::Sensor;

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
