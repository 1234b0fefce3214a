//! Loads glTF 2.0 files as scenes. No other module knows glTF.
//!
//! ```text
//! options    which scene of a file to load, and how
//! files      which files may be opened; GLB; URIs
//! text       the JSON's text: what is mended in it, and which element a byte belongs to
//! schema     the JSON's types
//! document   the JSON; versions and extensions
//! data       buffers, views and accessors, with every size checked
//! meshopt    compressed views
//! draco      streams of Draco; draco_primitive: primitives that get their elements from one
//! mesh       primitives, morph targets and skins to triangles; vertices: their data
//! skin       joints, and what they do to vertices
//! animation  which properties of nodes change over time, and how
//! hierarchy  the trees of nodes, at rest; rotation: quaternions
//! chains     how nodes move: the links from the world to a node
//! shape      the shape over time of a mesh that a skin or morph targets bend
//! nodes      the nodes of a scene to instances and labels
//! places     nodes and cameras by their names
//! actors     files of their own, merged into the scene
//! materials  the optical properties of surfaces, and notes on what is not read
//! textures   the images of materials, and how they lie on surfaces; images: decoding them
//! outline    what a file holds, by name
//! fault      errors
//! notices    what is to be known though it is no error
//! ```
//!
//! Files are treated as hostile: nothing outside the scene's folder is opened, nothing is allocated or iterated on the word
//! of the file alone, and every index is checked where it is used.

mod actors;
mod animation;
mod chains;
mod data;
mod document;
mod draco;
mod draco_primitive;
mod fault;
mod files;
mod hierarchy;
mod images;
mod materials;
mod mesh;
mod meshopt;
mod nodes;
mod notices;
mod options;
mod outline;
mod places;
mod rotation;
mod schema;
mod shape;
mod skin;
#[cfg(test)]
mod tests;
mod text;
mod textures;
mod vertices;

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DAffine3;

use actors::Casts;
use animation::Animations;
use chains::Chains;
use data::Data;
use document::Document;
use fault::{Fault, quoted};
use files::Folders;
use hierarchy::Hierarchy;
use nodes::PlacedMeshes;
use notices::Notices;

pub use options::{Actor, Clips, Model, Options, Place};
pub use outline::{
    AnimationOutline, CameraOutline, MeshOutline, NodeOutline, Outline, SceneOutline, SkinOutline,
};

use super::arrangement::Scene;
use super::material::Material;
use super::notice::Notice;
use super::source::{SceneBuildError, SceneBuilder};
use crate::error::SceneError;
use crate::motion::Motion;
use crate::source::suggest::nearest;
use crate::source::words::counted;
use crate::source::{Diagnostic, FileKind, Wanted, read_file};

/// A scene, and what is to be known about how it was read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// Everything that its user should know. The scene can be used in spite of it.
    pub notices: Vec<Notice>,
    /// The same of the files of actors, each with its path.
    pub of_actors: Vec<(PathBuf, Notice)>,
    /// The maps to the world from the places that the options ask for, over time.
    pub places: Vec<Motion>,
}

impl Loaded {
    /// The notices as diagnostics about the scene's file and those of actors.
    pub fn diagnostics<'s>(&'s self, path: &'s Path) -> impl Iterator<Item = Diagnostic> + 's {
        let of_scene = self.notices.iter().map(move |notice| (path, notice));
        let of_actors = self.of_actors.iter().map(|(path, notice)| (path.as_path(), notice));
        of_scene.chain(of_actors).map(|(path, Notice { severity, place, message, help })| {
            let separator = if place.is_empty() { "" } else { ": " };
            let message = format!("{place}{separator}{message}");
            Diagnostic { severity: *severity, ..Diagnostic::about_file(path, message, help.clone()) }
        })
    }
}

/// Loads a `.gltf` or `.glb` file with the buffers that it names. [`Geometry::files`](super::Geometry::files) calls the file
/// `display_name`.
///
/// The geometry is as glTF 2.0 defines it: all triangle modes, node transforms (composed in f64), sparse and normalised
/// accessors, skins, morph targets, animations (with KHR_animation_pointer of nodes), and the extensions KHR_mesh_quantization, EXT_meshopt_compression, KHR_meshopt_compression, KHR_draco_mesh_compression,
/// EXT_mesh_gpu_instancing, KHR_node_visibility, CESIUM_RTC (its centre is a translation of all roots, in glTF's axes),
/// EXT_mesh_primitive_restart and KHR_mesh_primitive_restart. Points and lines are left out.
///
/// Surfaces look as their base colour, its texture (PNG, JPEG or WebP), vertex colours and alpha say, and let light pass as
/// KHR_materials_transmission says. An image that can't be read counts as white, with a warning.
///
/// Violations of glTF that leave no doubt where the geometry is are read, with a warning that names the element.
///
/// # Errors
/// A [`SceneError`] about `path` that names the element: the file cannot be read, is no glTF 2.0, needs an unknown
/// extension, contradicts itself, or has no triangles. No file causes a panic, and no file makes this function open
/// anything outside the folder of `path`, the store that `path` is a link into, and the folders that the options allow.
pub fn load(path: &Path, display_name: &str, options: &Options) -> Result<Loaded, SceneError> {
    guarded(path, || read_and_build(path, display_name, options))
}

/// What a `.gltf` or `.glb` file holds, by name. Its buffers are not read.
///
/// # Errors
/// As [`load`], as far as the file's JSON is concerned.
pub fn outline(path: &Path) -> Result<Outline, SceneError> {
    guarded(path, || {
        let file = read_file(path, u64::MAX)?;
        let (document, _) = parse(&file, &Notices::default())?;
        Ok(Outline::of(document))
    })
}

/// Does the work, and makes of its faults errors about the file at `path`.
fn guarded<T>(path: &Path, work: impl FnOnce() -> Result<T, Fault>) -> Result<T, SceneError> {
    // Nothing in here is known to panic. This is the last line of defence, not the first.
    catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err(Fault::new("", "the reader failed on it; this is an error in beamcast")))
        .map_err(|Fault { file, element, problem, help, source }| SceneError {
            path: file.unwrap_or_else(|| path.to_path_buf()),
            element,
            problem,
            help,
            source,
        })
}

fn read_and_build(path: &Path, display_name: &str, options: &Options) -> Result<Loaded, Fault> {
    let notices = Notices::default();
    let Contents { mut builder, elements, places, mut names } = read(path, display_name, options, &notices)?;
    let mut elements = vec![(0, elements)];
    let mut casts = Casts::default();
    let mut of_actors = Vec::new();
    for actor in options.actors {
        let Model::File { path, display_name, clips } = actor.model else { continue };
        let cast = match casts.find(path, clips) {
            Some(cast) => cast,
            None => {
                let own = Notices::default();
                let options = Options { scene_name: None, clips, actors: &[], places: &[], ..*options };
                let contents = read(path, display_name, &options, &own);
                let contents = contents.map_err(|fault| Fault { file: Some(path.to_path_buf()), ..fault })?;
                names.extend(&contents.names);
                let notices = own.into_list().into_iter().map(|notice| (path.to_path_buf(), notice));
                of_actors.extend(notices.filter(|notice| !of_actors.contains(notice)).collect::<Vec<_>>());
                casts.add(path, clips, contents.builder, &mut builder)
            }
        };
        elements.push((builder.instances.len(), Elements::of_actor(actor.name)));
        casts.place(cast, actor, options.start_s, &mut builder);
    }
    names.warn_of_unknown(options, &notices);
    let element = |instance: usize| {
        let of_file = elements.iter().rev().find(|(first, _)| *first <= instance);
        of_file.map_or(String::new(), |(first, elements)| elements.of(instance - first))
    };
    let mut scene = builder.build().map_err(|error| match &error {
        SceneBuildError::TooFar { instance, .. } => Fault::new(element(*instance), error.to_string())
            .help("is a coordinate or a scale not in metres?"),
        SceneBuildError::Empty { skipped } => {
            let triangles = counted(*skipped, "triangle");
            Fault::new("", format!("the scene has nothing to hit: it has {triangles}, of no area"))
                .help("are vertices all in one place, or nodes scaled to zero?")
        }
        SceneBuildError::TooManyTriangles { .. } | SceneBuildError::NoVertex { .. } => {
            Fault::new("", error.to_string())
        }
    })?;
    if !options.optics.is_empty() {
        let geometry = Arc::make_mut(&mut scene.geometry);
        geometry.optics = options.optics.to_vec();
        geometry.optics_of_labels = names.optics_of_labels(options);
    }
    let mut notices = notices.into_list();
    notices.extend(scene.geometry.rounding.notices(element));
    Ok(Loaded { scene, notices, of_actors, places })
}

/// The content of a file, which no longer needs its bytes.
struct Contents {
    builder: SceneBuilder,
    elements: Elements,
    places: Vec<Motion>,
    names: Names,
}

/// The nodes of instances, for messages.
enum Elements {
    OfFile { nodes: Vec<u32>, labels: BTreeMap<u32, String> },
    OfActor(String),
}

impl Elements {
    fn of_actor(name: &str) -> Self {
        Self::OfActor(format!("actor {}", quoted(name)))
    }

    fn of(&self, instance: usize) -> String {
        match self {
            Self::OfActor(label) => label.clone(),
            Self::OfFile { nodes, labels } => {
                nodes.get(instance).and_then(|node| labels.get(node)).cloned().unwrap_or_default()
            }
        }
    }
}

fn read(path: &Path, display_name: &str, options: &Options, notices: &Notices) -> Result<Contents, Fault> {
    let file = read_file(path, u64::MAX)?;
    let folders = Folders::of(path, options.allowed_folders)?;
    let (document, chunk) = parse(&file, notices)?;

    let data = Data::new(&document, chunk, &folders, file.len() as u64, notices);
    let scene = hierarchy::choose_scene(&document, options.scene_name, notices)?;
    let animations = Animations::read(&document, &data, options.clips, notices)?;
    let hierarchy = Hierarchy::new(&document, scene, &animations, notices)?;
    let world_from_gltf = DAffine3::from_mat3(options.up.world_from_gltf());
    let mut chains = Chains::new(&document, &data, &hierarchy, &animations, world_from_gltf);
    let mut drivers = BTreeMap::new();
    for actor in options.actors {
        let Model::Node(name) = actor.model else { continue };
        let place = || format!("actor {}", quoted(actor.name));
        let node = chains.node_named(name).map_err(|fault| fault.within(place()))?;
        if drivers.insert(node, actor).is_some() {
            return Err(
                Fault::new(place(), "another actor is the same node").help("a node follows one trajectory")
            );
        }
        chains.drive(node, actor.trajectory);
    }
    let places = options.places.iter().map(|&place| chains.find(place)).collect::<Result<_, _>>()?;
    let placed = nodes::place(&chains, &drivers, options, notices)?;
    if placed.instances.is_empty() {
        return Err(nothing_to_hit(&document, scene, &placed));
    }

    let used = placed.meshes.iter().flat_map(|mesh| mesh.parts.iter().map(|part| part.material)).collect();
    let mut materials = materials::read(&document, &data, &used, options, notices);
    if placed.uses_default_material {
        materials.push(Material::default());
    }
    materials::note_what_is_not_read(&document, notices);
    let mut sources = vec![files::source_file(display_name, &file)];
    let labels = placed.nodes.iter().map(|&node| (node, document.node_label(node))).collect();
    let elements = Elements::OfFile { nodes: placed.nodes, labels };
    let asks_for_names = !(options.labels.is_empty() && options.optics.is_empty());
    let names = if asks_for_names { Names::of(&document) } else { Names::default() };
    sources.extend(data.into_files());
    let builder = SceneBuilder {
        meshes: placed.meshes,
        instances: placed.instances,
        groups: placed.groups,
        materials,
        files: sources,
    };
    Ok(Contents { builder, elements, places, names })
}

/// The fault of a file that is no glTF 2.0, if its content says what it is.
fn other_kind(file: &[u8]) -> Option<Fault> {
    let kind = FileKind::of(file, file.len() as u64);
    if kind == FileKind::Gltf || kind.is_unknown() {
        return None;
    }
    let (problem, help) = kind.instead_of(Wanted::Scene);
    Some(Fault { help, ..Fault::new("", problem) })
}

/// The document of a file, and the binary chunk beside it.
fn parse<'f>(file: &'f [u8], notices: &Notices) -> Result<(Document, Option<&'f [u8]>), Fault> {
    // Only what cannot be read is looked at more closely: what it is instead says more than where reading it failed.
    let or_other_kind = |fault| other_kind(file).unwrap_or(fault);
    let chunks = files::split_glb(file, notices).map_err(or_other_kind)?;
    let is_binary = chunks.is_some();
    let (text, chunk) = chunks.unwrap_or((file, None));
    let document = Document::parse(text, is_binary, notices).map_err(or_other_kind)?;
    Ok((document, chunk))
}

/// The error that the scene has no mesh with triangles.
fn nothing_to_hit(document: &Document, scene: Option<u32>, placed: &PlacedMeshes) -> Fault {
    let element = scene.map_or(String::new(), |index| document.scene_label(index));
    let place = if scene.is_some() { "the scene" } else { "the file" };
    let PlacedMeshes { left_out, visited, .. } = placed;
    let found = if left_out.points_and_lines {
        "has only points and lines".to_owned()
    } else if left_out.without_positions {
        "has only primitives without positions".to_owned()
    } else if *visited == 0 && document.meshes.is_empty() {
        "has no nodes".to_owned()
    } else if *visited == 0 {
        "has no nodes that would place the file's meshes".to_owned()
    } else {
        format!("has {}, but no mesh with triangles", counted(*visited, "node"))
    };
    let others: Vec<_> = (0..document.scenes.len() as u32)
        .filter(|&other| Some(other) != scene)
        .map(|other| document.scene_label(other))
        .take(10)
        .collect();
    let help = if others.is_empty() {
        "beams hit triangles: export meshes".to_owned()
    } else {
        format!("beams hit triangles; the file also has {}", others.join(", "))
    };
    Fault::new(element, format!("{place} {found}")).help(help)
}

/// The names that a job's labels can use.
#[derive(Default)]
struct Names {
    /// Of nodes and materials.
    own: BTreeSet<String>,
    /// Those that `extras.label` names.
    extras: BTreeSet<String>,
}

impl Names {
    fn of(document: &Document) -> Self {
        let nodes = document.nodes.iter().filter_map(|node| node.name.clone());
        let materials = document.materials.iter().filter_map(|material| material.name.given().cloned());
        let extras = document.nodes.iter().filter_map(nodes::label_of_extras);
        Self {
            own: nodes.chain(materials).collect(),
            extras: extras.filter_map(|label| label.as_str().map(str::to_owned)).collect(),
        }
    }

    /// Adds the names of another file.
    fn extend(&mut self, other: &Self) {
        self.own.extend(other.own.iter().cloned());
        self.extras.extend(other.extras.iter().cloned());
    }

    /// The labels whose surfaces have optics by the label's name: no node and no material has the name. Of several names of a label
    /// the first counts.
    fn optics_of_labels(&self, options: &Options) -> BTreeMap<u32, u32> {
        let mut found = BTreeMap::new();
        for (index, optics) in (0_u32..).zip(options.optics) {
            if let Some(label) = options.labels.get(&optics.name)
                && !self.own.contains(&optics.name)
            {
                found.entry(*label).or_insert(index);
            }
        }
        found
    }

    /// Warns of the job's labels that no node, material or `extras.label` has, and of its optics that no node, material or label has.
    fn warn_of_unknown(&self, options: &Options, notices: &Notices) {
        /// A suggestion looks at every name of the file, so that only so many are made.
        const MOST_SUGGESTIONS: usize = 10;
        let warn = |number: usize, name: &str, place: &str, of: &str| {
            let names = self.own.iter().map(String::as_str);
            let meant = if number < MOST_SUGGESTIONS { nearest(name, names) } else { None };
            let meant = meant.map_or(String::new(), |meant| format!("; did you mean {}?", quoted(meant)));
            notices.warn(|| place.to_owned(), format!("no {of} is called {}{meant}", quoted(name)));
        };
        let labels = options.labels.keys();
        let unknown = labels.filter(|name| !self.own.contains(*name) && !self.extras.contains(*name));
        for (number, name) in unknown.enumerate() {
            warn(number, name, "labels", "node or material");
        }
        let optics = options.optics.iter().map(|optics| &optics.name);
        let unknown = optics.filter(|name| !self.own.contains(*name) && !options.labels.contains_key(*name));
        for (number, name) in unknown.enumerate() {
            warn(number, name, "materials", "node, material or label");
        }
    }
}
