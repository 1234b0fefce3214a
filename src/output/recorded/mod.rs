//! Recorded frames: EXR range images, PLY clouds, and the folders that scans write, read back.
//!
//! Files are taken for hostile: no size is believed before it is held against the file's own, nothing outside a folder is
//! opened on the word of its manifest, and no file makes a panic.

mod error;
mod exr;
mod folder;
mod ply;

pub use error::ReadError;
pub use exr::{Part, read_exr};
pub use folder::{Folder, Recorded};
pub use ply::{Cloud, Field, read_ply};
