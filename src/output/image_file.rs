//! Recorded range images as files of another format.

use super::exr;
use super::format::EncodeError;
use super::npz;
use super::recorded::Part;

/// A format of range images that recorded ones are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// OpenEXR.
    Exr,
    /// NumPy's NPZ.
    Npz,
}

impl ImageFormat {
    /// Every format with its ending.
    pub const ALL: [(Self, &'static str); 2] = [(Self::Exr, "exr"), (Self::Npz, "npz")];

    /// The format of an ending.
    pub fn of_ending(ending: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|(_, known)| *known == ending).map(|(format, _)| format)
    }

    /// The file of the parts of an image, with every channel, value and attribute that was read. A depth under the name `Y` is there
    /// in an EXR, and not in an NPZ.
    ///
    /// # Errors
    /// An [`EncodeError`] if the image is larger than the format allows.
    pub fn encode(self, parts: Vec<Part>) -> Result<Vec<u8>, EncodeError> {
        match self {
            Self::Exr => exr::of_parts(parts),
            Self::Npz => npz::of_parts(parts),
        }
    }
}
