//! Files and folders of recorded frames, recognised by their content.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use super::bag::Bag;
use super::cloud::Cloud;
use super::e57::read_e57;
use super::error::ReadError;
use super::exr::{Part, read_exr};
use super::las::read_las;
use super::manifest::RecordedManifest;
use super::npy::read_npy;
use super::npz::read_npz;
use super::pcd::read_pcd;
use super::ply::read_ply;
use super::ros::Content;
use crate::error::Error;
use crate::output::manifest::Manifest;
use crate::source::{FileKind, Wanted, read_file, recognise};

/// The endings of a scan's files that are read as range images, the one that tells the most last.
pub const IMAGE_ENDINGS: [&str; 2] = ["npz", "exr"];

/// The endings of a scan's files that are read as clouds, the one that tells the most last.
pub const CLOUD_ENDINGS: [&str; 6] = ["laz", "las", "npy", "e57", "pcd", "ply"];

/// A file or a folder of recorded frames.
#[derive(Debug)]
pub enum Recorded {
    /// The parts of an EXR or an NPZ, at least one. The first part is the main one.
    Images(Vec<Part>),
    /// A point cloud from a PLY, a PCD, an NPY, a LAS, a LAZ or an E57.
    Cloud(Cloud),
    /// A recording of many messages, from an MCAP.
    Bag(Box<Bag>),
    /// The output folder of a scan.
    Folder(Box<Folder>),
}

impl Recorded {
    /// Opens a range image (EXR, NPZ), a cloud (PLY, PCD, NPY, LAS, LAZ, E57), a recording (MCAP) or the folder of one that rosbag2 plays, the output
    /// folder of a scan, or that folder's manifest. The content decides which it is, and not the name. The numbers of a file, or of a message,
    /// may take `memory` bytes.
    ///
    /// # Errors
    /// [`Error::Input`] if the path is none of these, if the file is broken, or if its numbers take more memory.
    pub fn open(path: &Path, memory: u64) -> Result<Self, Error> {
        let folder = |path: &Path| Folder::open(path).map(|folder| Self::Folder(Box::new(folder)));
        if path.is_dir() {
            return match only_mcap(path) {
                Some(mcap) => Self::open_bag(&mcap, memory),
                None => folder(path),
            };
        }
        if path.file_name().is_some_and(|name| name == Manifest::NAME) {
            return folder(path.parent().unwrap_or(Path::new("")));
        }
        let kind = recognise(path).map_err(|e| Error::input(path, e))?;
        let bytes = || read(path, MAX_FILE_BYTES.min(memory));
        let read = match kind {
            FileKind::Manifest => {
                return folder(path.parent().unwrap_or(Path::new("")));
            }
            FileKind::Mcap => return Self::open_bag(path, memory),
            FileKind::Exr => read_exr(&bytes()?, memory).map(Self::Images),
            FileKind::Npz => read_npz(&bytes()?, memory).map(Self::Images),
            FileKind::Ply => read_ply(&bytes()?, memory).map(Self::Cloud),
            FileKind::Pcd => read_pcd(&bytes()?, memory).map(Self::Cloud),
            FileKind::Las => read_las(&bytes()?, memory).map(Self::Cloud),
            FileKind::E57 => read_e57(&bytes()?, memory).map(Self::Cloud),
            FileKind::Npy => read_npy(&bytes()?, memory).map(Self::Cloud),
            other => Err(ReadError::new(other.text_instead_of(Wanted::Frames))),
        };
        read.map_err(|e| Error::input(path, e))
    }

    fn open_bag(path: &Path, memory: u64) -> Result<Self, Error> {
        let file = File::open(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
        let bag = Bag::open(file, memory).map_err(|e| Error::input(path, e))?;
        Ok(Self::Bag(Box::new(bag)))
    }

    /// Bytes of memory that the numbers take.
    pub fn memory(&self) -> u64 {
        match self {
            Self::Images(parts) => parts.iter().map(|part| part.image.memory()).sum(),
            Self::Cloud(cloud) => cloud.memory(),
            Self::Bag(_) | Self::Folder(_) => 0,
        }
    }
}

impl From<Content> for Recorded {
    fn from(content: Content) -> Self {
        match content {
            Content::Cloud(cloud) => Self::Cloud(cloud),
            Content::Depth(part) => Self::Images(vec![part]),
        }
    }
}

/// The recording of a folder that rosbag2 plays: the only MCAP in it, if no scan wrote the folder.
fn only_mcap(folder: &Path) -> Option<PathBuf> {
    if folder.join(Manifest::NAME).exists() || !folder.join("metadata.yaml").is_file() {
        return None;
    }
    let entries = fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    let mut files =
        entries.filter(|path| path.is_file() && path.extension().is_some_and(|end| end == "mcap"));
    files.next().filter(|_| files.next().is_none())
}

/// A folder that a scan wrote.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    /// The content of the manifest.
    pub manifest: RecordedManifest,
}

impl Folder {
    /// Reads the manifest of a folder.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no manifest, if it cannot be read, or if it lists a file outside the folder or one file
    /// twice.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let name = path.join(Manifest::NAME);
        if !name.exists() {
            let problem =
                format!("has no {}, so no scan wrote it, or none that came to its end", Manifest::NAME);
            return Err(Error::input(path, problem));
        }
        let manifest = RecordedManifest::decode(&read(&name, MAX_MANIFEST_BYTES)?);
        let manifest = manifest.map_err(|e| Error::input(&name, e))?;
        Ok(Self { path: path.to_path_buf(), manifest })
    }

    /// The outputs that the manifest lists, as paths in the folder with forward slashes.
    pub fn outputs(&self) -> impl Iterator<Item = &str> {
        self.manifest.outputs.iter().map(|output| output.path.as_str())
    }

    /// The path with which the folder was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads one of [`Folder::outputs`], whose numbers may take `memory` bytes.
    ///
    /// # Errors
    /// [`Error::Input`] if the output cannot be read, does not match its name, or is a link that leads out of the folder.
    pub fn read(&self, output: &str, memory: u64) -> Result<Recorded, Error> {
        Recorded::open(&self.path_inside(output)?, memory)
    }

    /// The bytes of one of [`Folder::outputs`], which may be as many as `limit`.
    ///
    /// # Errors
    /// [`Error::Input`] if the output cannot be read, is larger, or is a link that leads out of the folder.
    pub fn read_bytes(&self, output: &str, limit: u64) -> Result<Vec<u8>, Error> {
        read(&self.path_inside(output)?, limit)
    }

    fn path_inside(&self, output: &str) -> Result<PathBuf, Error> {
        let path = self.path.join(output);
        let inside =
            fs::canonicalize(&path).and_then(|file| Ok(file.starts_with(fs::canonicalize(&self.path)?)));
        match inside {
            Ok(true) => Ok(path),
            Ok(false) => Err(Error::input(path, "is a link that leads out of the folder")),
            Err(e) => Err(Error::input(path, format!("can't be read: {e}"))),
        }
    }
}

impl Folder {
    /// Reads a table of the run, such as `poses.csv`, if the manifest lists it.
    ///
    /// # Errors
    /// [`Error::Input`] if it can't be read, is larger than a table may be, or is no text.
    pub fn table(&self, name: &str) -> Result<Option<String>, Error> {
        if !self.outputs().any(|output| output == name) {
            return Ok(None);
        }
        let text = String::from_utf8(self.read_bytes(name, MAX_TABLE_BYTES)?);
        text.map(Some).map_err(|e| Error::input(self.path.join(name), format!("is no text: {e}")))
    }
}

/// The largest table of a run that is read: of a million frames, poses take 200 MB.
const MAX_TABLE_BYTES: u64 = 256 << 20;

/// The largest file of numbers that is read.
const MAX_FILE_BYTES: u64 = 8 << 30;

/// The largest manifest that is read. That of a scene of a hundred thousand instances has 12 MB.
const MAX_MANIFEST_BYTES: u64 = 64 << 20;

fn read(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    read_file(path, limit).map_err(|e| Error::input(path, e))
}
