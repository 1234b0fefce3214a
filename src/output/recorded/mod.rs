//! Recorded frames: EXR range images, PLY clouds, and the folders that scans write, read back.
//!
//! Files are treated as hostile. Every size is checked against the length of the file before it is used, a manifest cannot
//! open a file outside its folder, and no file causes a panic.

mod error;
mod exr;
mod folder;
mod instances;
mod manifest;
mod ply;

pub use error::ReadError;
pub use exr::{Part, read_exr};
pub use folder::{Folder, Recorded};
pub use instances::InstanceNames;
pub use manifest::{Input, Output, RecordedJob, RecordedManifest, RecordedScene, RecordedSensor, Tool};
pub use ply::{Cloud, Field, read_ply};
