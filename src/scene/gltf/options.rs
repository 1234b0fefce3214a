//! The options of loading a glTF file.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::frame::UpAxis;

/// The options of loading a glTF file. The default is the file's default scene, with z up and without labels.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// The name of the scene to load. `None` means the file's default scene; if the file names none, its first scene; if it
    /// has no scenes, all of its nodes.
    pub scene_name: Option<&'a str>,
    /// The axis of the world that the file's y axis becomes.
    pub up: UpAxis,
    /// Semantic labels by the name of a node (for it and all below it) or of a material. A node's `extras.label` may name
    /// one of them too.
    pub labels: &'a BTreeMap<String, u32>,
    /// Folders besides the scene's own that its files may lie in, with all below them.
    pub allowed_folders: &'a [PathBuf],
}

impl Default for Options<'_> {
    fn default() -> Self {
        static NO_LABELS: BTreeMap<String, u32> = BTreeMap::new();
        Self { scene_name: None, up: UpAxis::default(), labels: &NO_LABELS, allowed_folders: &[] }
    }
}
