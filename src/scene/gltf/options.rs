//! The options of loading a glTF file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::frame::UpAxis;
use crate::motion::{Clock, Trajectory};
use crate::scene::Optics;

/// The options of loading a glTF file. The default is the file's default scene, with z up and without labels,
/// whose animations all play once.
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
    /// How surfaces send light back, by the name of a node (for it and all below it) or of a material or, where none has the name,
    /// of a label.
    pub optics: &'a [Optics],
    /// Folders besides the scene's own that its files may lie in, with all below them.
    pub allowed_folders: &'a [PathBuf],
    /// The animations that are played.
    pub clips: &'a Clips,
    /// What of the scene moves along a trajectory.
    pub actors: &'a [Actor<'a>],
    /// The nodes and cameras whose places are asked for: [`Loaded::places`](super::Loaded::places).
    pub places: &'a [Place<'a>],
    /// The time (seconds of the world) at which what moves is where [`Scene`](crate::scene::Scene) has it as long as no other
    /// time is given.
    pub start_s: f64,
}

/// The animations of a file that are played, and when.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clips {
    /// Their names. `None` means all of them.
    pub names: Option<Vec<String>>,
    /// Whether they begin again when they end. Otherwise they stand still before they begin and after their end.
    pub is_looped: bool,
    /// The time of the world, in seconds, at which they begin.
    pub start_s: f64,
}

impl Clips {
    /// The time of a clip of this length. A clip goes from its time 0 to its last keyframe, whenever its first is.
    pub(super) fn clock(&self, length_s: f64) -> Clock {
        Clock { start_s: self.start_s, speed: 1.0, length_s, is_looped: self.is_looped }
    }
}

/// Something that moves along a trajectory.
#[derive(Clone, Copy, Debug)]
pub struct Actor<'a> {
    /// Its name, which its objects have before their own: `car/wheel`.
    pub name: &'a str,
    /// What moves.
    pub model: Model<'a>,
    /// `world_from_actor` over time. An actor's own axes are those of its file in the world: x, y and z where the file's would be
    /// if the actor stood at the world's origin.
    pub trajectory: &'a Trajectory,
    /// The semantic label of all of it, in place of those of the file and of the job's labels.
    pub label: Option<u32>,
}

/// What an [`Actor`] is made of.
#[derive(Clone, Copy, Debug)]
pub enum Model<'a> {
    /// A file of its own.
    File {
        /// The path of the `.gltf` or `.glb` file.
        path: &'a Path,
        /// What [`Geometry::files`](crate::scene::Geometry::files) calls it.
        display_name: &'a str,
        /// The animations of it that are played.
        clips: &'a Clips,
    },
    /// The node with this name in the scene, with all below it. The trajectory takes the place of the node's own place and turn; its
    /// size stays.
    Node(&'a str),
}

/// A place in the scene by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place<'a> {
    /// A node.
    Node(&'a str),
    /// A camera, or a node with a camera.
    Camera(&'a str),
}

impl Options<'_> {
    /// The indices of the optics by their names; of several with one name, that of the first.
    pub(super) fn optics_by_name(&self) -> BTreeMap<&str, u32> {
        let mut found = BTreeMap::new();
        for (index, optics) in (0_u32..).zip(self.optics) {
            found.entry(optics.name.as_str()).or_insert(index);
        }
        found
    }
}

impl Default for Options<'_> {
    fn default() -> Self {
        static NO_LABELS: BTreeMap<String, u32> = BTreeMap::new();
        static ALL: Clips = Clips { names: None, is_looped: false, start_s: 0.0 };
        Self {
            scene_name: None,
            up: UpAxis::default(),
            labels: &NO_LABELS,
            optics: &[],
            allowed_folders: &[],
            clips: &ALL,
            actors: &[],
            places: &[],
            start_s: 0.0,
        }
    }
}
