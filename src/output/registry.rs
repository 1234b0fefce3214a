//! The registry of formats.

use std::fmt;
use std::hash::{Hash, Hasher};

use super::format::{EncodeError, FormatSpec, Kind};
use super::sensor_frame::SensorFrame;
use super::{exr, ply, png};
use crate::sensor::Sensor;

/// Every format that a job can name, in the order in which lists show them.
pub static FORMATS: &[&FormatSpec] = &[&exr::FORMAT, &ply::FORMAT, &png::FORMAT];

/// A format, identified by its declaration.
#[derive(Clone, Copy)]
pub struct Format(
    /// The declaration. If two formats have the same name, a job can name only one of them.
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

    /// The name in a job, which is also the extension of the files.
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// Checks that the frames of `sensor` fit the format. It is meant to be asked before casting.
    ///
    /// # Errors
    /// An error that names the number of the sensor that the format cannot represent.
    pub fn check(self, sensor: &Sensor) -> Result<(), EncodeError> {
        (self.0.check)(sensor)
    }

    /// Checks that a surface's id or label fits the format. It is meant to be asked before casting.
    ///
    /// # Errors
    /// An error that names the label and the largest that the format can hold.
    pub fn check_label(self, label: u32) -> Result<(), EncodeError> {
        let most = self.0.most_label;
        if label <= most {
            return Ok(());
        }
        Err(EncodeError::new(format!("its labels are at most {most}, and a surface has the label {label}")))
    }

    /// An upper estimate of the memory that encoding takes, in bytes for each ray of `sensor`.
    pub fn encoding_bytes_a_ray(self, sensor: &Sensor) -> u64 {
        (self.0.encoding_bytes_a_ray)(sensor)
    }

    /// The whole content of the file of one frame.
    ///
    /// # Errors
    /// An error if the frame has a number that the format cannot represent, such as a label above 2³¹ − 1 in a PLY, or if
    /// the format has one file for each run and so none for a single frame.
    pub fn encode(self, frame: &SensorFrame) -> Result<Vec<u8>, EncodeError> {
        match self.0.kind {
            Kind::File(encode) => encode(frame),
            Kind::Stream(_) => Err(EncodeError::new(format!(
                "{} has one file for each run, and none for a single frame",
                self.name()
            ))),
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
