//! The kinds of files, in the words of messages: what a file is, what was wanted, and what mends it.

use crate::source::words::{list, quoted};

/// The kind of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A file without a byte.
    Empty,
    /// glTF 2.0, as JSON or binary.
    Gltf,
    /// glTF 1.0, as JSON or binary.
    Gltf1,
    /// A job: TOML that names a scene, sensors or an output.
    Job,
    /// Other TOML: a sensor file, if anything of beamcast's.
    Toml,
    /// A job or a sensor file that is written as YAML or JSON.
    ForeignConfig(&'static str),
    /// An OpenEXR image.
    Exr,
    /// A PLY: a cloud or a mesh.
    Ply,
    /// A PCD cloud.
    Pcd,
    /// A LAS cloud, or a LAZ, which is one whose points are compressed.
    Las,
    /// An E57 cloud.
    E57,
    /// An array of NumPy.
    Npy,
    /// Arrays of NumPy in a ZIP.
    Npz,
    /// The manifest of a scan.
    Manifest,
    /// A baseline of `beamcast check`.
    Baseline,
    /// The calibration of one unit by its vendor or a driver, which `beamcast import` reads.
    Calibration(Unit),
    /// A stand-in for a file, or a container of one: the name, and the command that gets the file.
    Wrapped(&'static str, &'static str),
    /// A mesh or a scene of another format: the name, and what makes glTF of it.
    Mesh(&'static str, &'static str),
    /// A point cloud of another format.
    Cloud(&'static str),
    /// An MCAP, which holds recordings such as ROS 2 bags.
    Mcap,
    /// A recording of sensors or robots.
    Recording(&'static str),
    /// Something else that has a name.
    Other(&'static str),
    /// XML with this outermost element.
    Xml(String),
    /// JSON or YAML, its name and its outermost keys.
    Keys(&'static str, Vec<String>),
    /// A text of which nothing is known.
    Text,
    /// Bytes of which nothing is known.
    Unknown,
}

/// The units whose calibrations are recognised by their keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// An Ouster sensor: its metadata.
    Ouster,
    /// A Velodyne sensor: the calibration of its ROS driver.
    Velodyne,
    /// A camera: its intrinsics.
    Camera,
    /// A Hesai unit with mirrors on its rotor, such as AT128: its angle correction, which is binary and is not read.
    HesaiMirrors,
}

/// The use that a command has for a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// A scene.
    Scene,
    /// A job or a sensor file.
    Config,
    /// A file for `lint`.
    Linted,
    /// A file for `info`.
    Shown,
    /// Frames for `view` and `diff`.
    Frames,
    /// A calibration for `import`.
    Calibration,
}

impl Wanted {
    fn words(self) -> &'static str {
        match self {
            Self::Scene => "a glTF scene",
            Self::Config => "a job or a sensor file",
            Self::Linted => "a job, a sensor file or a scene",
            Self::Shown => {
                "a job, a sensor file, a scene, a range image (EXR, NPZ), a cloud (PLY, PCD, NPY, LAS, LAZ, E57), a recording (MCAP) or a folder that a scan wrote"
            }
            Self::Frames => {
                "a range image (EXR, NPZ), a cloud (PLY, PCD, NPY, LAS, LAZ, E57), a recording (MCAP), a folder that a scan wrote or a job"
            }
            Self::Calibration => "a calibration",
        }
    }
}

impl FileKind {
    /// Whether the file is glTF, of any version.
    pub fn is_scene(&self) -> bool {
        matches!(self, Self::Gltf | Self::Gltf1)
    }

    /// Whether the file is read as TOML, and so gets the messages about TOML: it is TOML, or a text that may be meant as it.
    pub fn is_config(&self) -> bool {
        matches!(self, Self::Job | Self::Toml | Self::Text)
    }

    /// Whether `info`, `view` and `diff` read the file.
    pub fn is_recorded(&self) -> bool {
        matches!(
            self,
            Self::Exr
                | Self::Ply
                | Self::Pcd
                | Self::Las
                | Self::E57
                | Self::Npy
                | Self::Npz
                | Self::Mcap
                | Self::Manifest
        )
    }

    /// Whether nothing is known of the file that its reader doesn't know better.
    pub fn is_unknown(&self) -> bool {
        matches!(self, Self::Text | Self::Unknown)
    }

    /// The kind with its article: `a Git LFS pointer`.
    pub fn name(&self) -> String {
        match self {
            Self::Empty => "an empty file".to_owned(),
            Self::Gltf => "a glTF scene".to_owned(),
            Self::Gltf1 => "a glTF 1.0 scene".to_owned(),
            Self::Job => "a job".to_owned(),
            Self::Toml => "TOML".to_owned(),
            Self::ForeignConfig(syntax) => format!("a job or a sensor file in {syntax}"),
            Self::Exr => "an EXR image".to_owned(),
            Self::Ply => "a PLY file".to_owned(),
            Self::Pcd => "a PCD cloud".to_owned(),
            Self::Las => "a LAS or LAZ cloud".to_owned(),
            Self::E57 => "an E57 cloud".to_owned(),
            Self::Mcap => "an MCAP recording".to_owned(),
            Self::Npy => "a NumPy array (npy)".to_owned(),
            Self::Npz => "NumPy arrays (npz)".to_owned(),
            Self::Manifest => "the manifest of a scan".to_owned(),
            Self::Baseline => "a baseline of `beamcast check`".to_owned(),
            Self::Xml(root) => format!("XML of {}", quoted(root)),
            Self::Keys(syntax, keys) => {
                let more = if keys.len() > MOST_KEYS { ", …" } else { "" };
                match keys.as_slice() {
                    [] => format!("{syntax} without keys"),
                    [key] => format!("{syntax} with the key {}", quoted(key)),
                    _ => {
                        let shown = list(keys.iter().take(MOST_KEYS).map(String::as_str), "and");
                        format!("{syntax} with the keys {shown}{more}")
                    }
                }
            }
            Self::Calibration(Unit::Ouster) => "Ouster metadata".to_owned(),
            Self::Calibration(Unit::Velodyne) => "a Velodyne calibration".to_owned(),
            Self::Calibration(Unit::Camera) => "a camera's intrinsics".to_owned(),
            Self::Calibration(Unit::HesaiMirrors) => {
                "a binary angle correction of a Hesai unit (.dat)".to_owned()
            }
            Self::Wrapped(name, _)
            | Self::Mesh(name, _)
            | Self::Cloud(name)
            | Self::Recording(name)
            | Self::Other(name) => (*name).to_owned(),
            Self::Text => "a text".to_owned(),
            Self::Unknown => "of an unknown kind".to_owned(),
        }
    }

    /// The sentence that says what the file is instead of what is wanted, and what mends it.
    pub fn instead_of(&self, wanted: Wanted) -> (String, Option<String>) {
        let words = wanted.words();
        let message = match self {
            Self::Empty => "the file is empty".to_owned(),
            Self::Text | Self::Unknown => format!("this is not {words}"),
            Self::Gltf1 if wanted == Wanted::Scene => {
                format!("this is {}, and glTF 2.0 is read", self.name())
            }
            Self::Calibration(Unit::HesaiMirrors) => format!("this is {}, which is not read", self.name()),
            _ => format!("this is {}, not {words}", self.name()),
        };
        (message, self.mend(wanted))
    }

    /// The same as one text, with what mends it in parentheses.
    pub fn text_instead_of(&self, wanted: Wanted) -> String {
        let (message, help) = self.instead_of(wanted);
        help.map_or(message.clone(), |help| format!("{message} ({help})"))
    }

    /// The step that makes the file useful, in a sentence.
    fn mend(&self, wanted: Wanted) -> Option<String> {
        let wants_scene = wanted == Wanted::Scene;
        Some(match self {
            Self::Empty => "was the file written, copied or downloaded whole?".to_owned(),
            Self::Gltf => "a job is a TOML file that names it as its `scene`, and the sensors that look at it".to_owned(),
            Self::Gltf1 => "`gltf-pipeline -i OLD -o NEW.glb` makes glTF 2.0 of it".to_owned(),
            Self::Job if wants_scene => "the `scene` of a job is a glTF file, .glb or .gltf".to_owned(),
            Self::Job => "`beamcast scan` runs a job, `beamcast lint` checks it".to_owned(),
            Self::Toml if wants_scene => "a scene is glTF, .glb or .gltf".to_owned(),
            Self::Toml => "a job names it as the `preset` of a `[[sensor]]`, if it is a sensor file".to_owned(),
            Self::ForeignConfig(_) => {
                "beamcast's jobs and sensor files are TOML, such as `scene = \"a.glb\"`; `beamcast init` writes one"
                    .to_owned()
            }
            Self::Ply if wants_scene => {
                "beams hit triangles: Blender, or `assimp export FILE scene.glb`, makes glTF of a mesh; a cloud has to be \
                 made a mesh first"
                    .to_owned()
            }
            Self::Pcd | Self::Las | Self::E57 if wants_scene => MESH_OF_CLOUD.to_owned(),
            Self::Exr | Self::Ply | Self::Pcd | Self::Las | Self::E57 | Self::Npy | Self::Npz | Self::Mcap => "`beamcast info`, `view` and `diff` read it".to_owned(),
            Self::Manifest => "`beamcast info`, `view` and `diff` read it and its folder".to_owned(),
            Self::Baseline => "`beamcast check` reads it: name the job that it belongs to".to_owned(),
            Self::Calibration(Unit::HesaiMirrors) => {
                "it corrects each of the unit's mirrors by itself, which no sensor file can say; its angles as CSV, with the \
                 columns Channel, Elevation, Azimuth, are read"
                    .to_owned()
            }
            Self::Calibration(_) => "`beamcast import FILE -o sensor.toml` makes a sensor file of it".to_owned(),
            Self::Wrapped(_, mend) => (*mend).to_owned(),
            Self::Mesh(_, mend) => format!("beamcast reads glTF 2.0: {mend}"),
            Self::Cloud(_) if wants_scene => MESH_OF_CLOUD.to_owned(),
            Self::Cloud(_) => "of clouds, beamcast reads PLY, PCD, NPY, LAS and LAZ: CloudCompare, Open3D or PDAL convert it".to_owned(),
            Self::Recording(_) => {
                "beamcast reads no recordings: the unit's calibration, which is a file of its own, goes to `beamcast import`"
                    .to_owned()
            }
            Self::Text | Self::Unknown if wants_scene => {
                "beamcast reads glTF 2.0: a .gltf file (JSON) or a .glb file (binary)".to_owned()
            }
            Self::Other(_) | Self::Xml(_) | Self::Keys(..) if wants_scene => {
                "a scene is glTF 2.0: a .gltf file (JSON) or a .glb file (binary)".to_owned()
            }
            Self::Other(_) | Self::Xml(_) | Self::Keys(..) | Self::Text | Self::Unknown => return None,
        })
    }
}

/// What makes a scene of a cloud.
const MESH_OF_CLOUD: &str =
    "beams hit triangles: make a mesh of the cloud first, with CloudCompare or Open3D, and export it as glTF";

/// Most keys of a file that a message lists.
const MOST_KEYS: usize = 6;
