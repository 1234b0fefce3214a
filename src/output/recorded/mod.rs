//! Recorded frames: EXR range images, PLY clouds, previews, and the folders that scans write, read back.
//!
//! Files are treated as hostile. Every size is checked against the length of the file before it is used, a manifest cannot
//! open a file outside its folder, and no file causes a panic.

mod error;
mod exr;
mod folder;
mod frame_key;
mod instances;
mod manifest;
mod ply;
mod preview;
mod tables;

pub use error::ReadError;
pub use exr::{Part, read_exr};
pub use folder::{Folder, Recorded};
pub use frame_key::FrameKey;
pub use instances::InstanceNames;
pub use manifest::{
    Input, Output, RecordedJob, RecordedManifest, RecordedScene, RecordedSensor, Tool, read_manifest,
};
pub use ply::{Cloud, Field, read_ply};
pub use preview::read_preview;
pub use tables::{BoxRow, PoseRow, read_boxes, read_poses};
