//! Recorded frames: range images (EXR, NPZ), clouds (PLY, PCD, NPY, LAS, LAZ, E57), the clouds and depth images of recordings (MCAP), previews,
//! and the folders that scans write, read back.
//!
//! Files are treated as hostile. Every size is checked against the length of the file before it is used, a manifest cannot
//! open a file outside its folder, and no file causes a panic.

mod bag;
mod cloud;
mod e57;
mod error;
mod exr;
mod folder;
mod frame_key;
mod instances;
mod las;
mod laszip;
mod manifest;
mod mcap;
mod npy;
mod npz;
mod number;
mod pcd;
mod ply;
mod preview;
mod python;
mod ros;
mod tables;
mod zip;

pub use bag::{Bag, TopicFrames, Wanted};
pub use cloud::{Cloud, Field};
pub use e57::read_e57;
pub use error::ReadError;
pub use exr::{Part, read_exr};
pub use folder::{CLOUD_ENDINGS, Folder, IMAGE_ENDINGS, Recorded};
pub use frame_key::FrameKey;
pub use instances::InstanceNames;
pub(in crate::output) use las::WKT;
pub use las::read_las;
pub use manifest::{
    Input, Output, RecordedJob, RecordedManifest, RecordedScene, RecordedSensor, Tool, read_manifest,
};
pub use mcap::{Source, Topic};
pub use npy::read_npy;
pub use npz::read_npz;
pub(in crate::output) use number::Number;
pub use pcd::read_pcd;
pub use ply::read_ply;
pub use preview::read_preview;
pub use ros::{Content, Message};
pub use tables::{BoxRow, PoseRow, read_boxes, read_poses};
