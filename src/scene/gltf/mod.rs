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
//! mesh       primitives, morph targets and skins to triangles
//! nodes      the hierarchy to instances and labels
//! materials  colours, and notes on what is not read
//! outline    what a file holds, by name
//! fault      errors
//! notices    what is to be known though it is no error
//! ```
//!
//! Files are treated as hostile: nothing outside the scene's folder is opened, nothing is allocated or iterated on the word
//! of the file alone, and every index is checked where it is used.

mod data;
mod document;
mod draco;
mod draco_primitive;
mod fault;
mod files;
mod materials;
mod mesh;
mod meshopt;
mod nodes;
mod notices;
mod options;
mod outline;
mod schema;
#[cfg(test)]
mod tests;
mod text;

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use data::Data;
use document::Document;
use fault::{Fault, quoted};
use files::Folders;
use nodes::{Hierarchy, PlacedMeshes};
use notices::Notices;

pub use options::Options;
pub use outline::{CameraOutline, MeshOutline, NodeOutline, Outline, SceneOutline};

use super::arrangement::Scene;
use super::material::Material;
use super::notice::Notice;
use super::source::{SceneBuildError, SceneBuilder};
use crate::error::SceneError;
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
}

impl Loaded {
    /// The notices as diagnostics about the scene's file.
    pub fn diagnostics<'s>(&'s self, path: &'s Path) -> impl Iterator<Item = Diagnostic> + 's {
        self.notices.iter().map(move |Notice { severity, place, message, help }| {
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
/// accessors, skins in the pose of their nodes, morph targets at their default weights, and the extensions
/// KHR_mesh_quantization, EXT_meshopt_compression, KHR_meshopt_compression, KHR_draco_mesh_compression,
/// EXT_mesh_gpu_instancing, KHR_node_visibility, CESIUM_RTC (its centre is a translation of all roots, in glTF's axes),
/// EXT_mesh_primitive_restart and KHR_mesh_primitive_restart. Points and lines are left out. Images and animations are not
/// read. Violations of glTF that leave no doubt where the geometry is are read, with a warning that names the element.
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
        .map_err(|Fault { element, problem, help, source }| SceneError {
            path: path.to_path_buf(),
            element,
            problem,
            help,
            source,
        })
}

fn read_and_build(path: &Path, display_name: &str, options: &Options) -> Result<Loaded, Fault> {
    let notices = Notices::default();
    let Read { builder, instance_elements } = read(path, display_name, options, &notices)?;
    let scene = builder.build().map_err(|error| match &error {
        SceneBuildError::TooFar { instance, .. } => {
            let element = instance_elements(*instance);
            Fault::new(element, error.to_string()).help("is a coordinate or a scale not in metres?")
        }
        SceneBuildError::Empty { skipped } => {
            let triangles = counted(*skipped, "triangle");
            Fault::new("", format!("the scene has nothing to hit: it has {triangles}, of no area"))
                .help("are vertices all in one place, or nodes scaled to zero?")
        }
        SceneBuildError::TooManyTriangles { .. } => Fault::new("", error.to_string()),
    })?;
    let mut notices = notices.into_list();
    notices.extend(scene.geometry.rounding.notices(&instance_elements));
    Ok(Loaded { scene, notices })
}

/// The content of a file, which no longer needs its bytes.
struct Read<F> {
    builder: SceneBuilder,
    /// Names the node of an instance.
    instance_elements: F,
}

fn read(
    path: &Path,
    display_name: &str,
    options: &Options,
    notices: &Notices,
) -> Result<Read<impl Fn(usize) -> String + use<>>, Fault> {
    let file = read_file(path, u64::MAX)?;
    let folders = Folders::of(path, options.allowed_folders)?;
    let (document, chunk) = parse(&file, notices)?;

    let data = Data::new(&document, chunk, &folders, file.len() as u64, notices);
    let scene = nodes::choose_scene(&document, options.scene_name, notices)?;
    let hierarchy = Hierarchy::new(&document, scene, notices)?;
    let placed = nodes::place(&document, &data, &hierarchy, options, notices)?;
    if placed.instances.is_empty() {
        return Err(nothing_to_hit(&document, scene, &placed));
    }
    warn_of_unknown_labels(&document, options.labels, notices);

    let mut materials = materials::read(&document, options, notices);
    if placed.uses_default_material {
        materials.push(Material::default());
    }
    materials::note_what_is_not_read(&document, notices);
    let mut sources = vec![files::source_file(display_name, &file)];
    sources.extend(data.into_files());
    let builder =
        SceneBuilder { meshes: placed.meshes, instances: placed.instances, materials, files: sources };
    let labels: BTreeMap<u32, String> =
        placed.nodes.iter().map(|&node| (node, document.node_label(node))).collect();
    let nodes = placed.nodes;
    let instance_elements = move |instance: usize| labels.get(&nodes[instance]).cloned().unwrap_or_default();
    Ok(Read { builder, instance_elements })
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

/// Warns of the job's labels that no node, material or `extras.label` has.
fn warn_of_unknown_labels(document: &Document, labels: &BTreeMap<String, u32>, notices: &Notices) {
    /// A suggestion looks at every name of the file, so that only so many are made.
    const MOST_SUGGESTIONS: usize = 10;
    if labels.is_empty() {
        return;
    }
    let nodes = document.nodes.iter().filter_map(|node| node.name.as_deref());
    let materials = document.materials.iter().filter_map(|material| material.name.given());
    let names: BTreeSet<&str> = nodes.chain(materials.map(String::as_str)).collect();
    // `extras.label` may name a label too.
    let extras = document.nodes.iter().filter_map(nodes::label_of_extras);
    let named: BTreeSet<String> = extras.filter_map(|label| label.as_str().map(str::to_owned)).collect();
    let unknown = labels.keys().filter(|name| !names.contains(name.as_str()) && !named.contains(*name));
    for (number, name) in unknown.enumerate() {
        let meant = if number < MOST_SUGGESTIONS { nearest(name, names.iter().copied()) } else { None };
        let meant = meant.map_or(String::new(), |meant| format!("; did you mean {}?", quoted(meant)));
        let problem = format!("no node or material is called {}{meant}", quoted(name));
        notices.warn(|| "labels".to_owned(), problem);
    }
}
