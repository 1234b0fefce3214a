//! The declaration of a format, which stands in the format's own file.

use std::io::{self, Write};

use super::sensor_frame::SensorFrame;
use crate::sensor::Sensor;

/// The declaration of a format. The rest of the program knows nothing else about the format.
pub struct FormatSpec {
    /// The name in a job, which is also the extension of the files.
    pub name: &'static str,
    /// The content of the files, in a few words for lists.
    pub about: &'static str,
    /// Checks that the frames of a sensor fit the format at all. The error names the number of the sensor that the format
    /// cannot represent.
    pub check: fn(&Sensor) -> Result<(), EncodeError>,
    /// The largest id or label of a surface that the files can hold.
    pub most_label: u32,
    /// The greatest memory that encoding takes for each ray of a sensor, in bytes.
    pub encoding_bytes_a_ray: fn(&Sensor) -> u64,
    /// The size of the file for each ray that returns, before any compression, in bytes.
    pub file_bytes_a_ray: fn(&Sensor) -> u64,
    /// The way in which frames become files.
    pub kind: Kind,
}

/// The way in which frames become files. The same frames give the same bytes, on any number of threads and any platform.
pub enum Kind {
    /// One file for each frame. The function returns the content of the whole file.
    ///
    /// The error names the number of the frame that the format cannot represent, such as a label above 2³¹ − 1 in a PLY.
    File(fn(&SensorFrame) -> Result<Vec<u8>, EncodeError>),
    /// One file for each run, to which all frames of all sensors are added in order, as in bags and in clouds of a whole
    /// drive.
    Stream(fn() -> Box<dyn Stream>),
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
