//! glTF 2.0 files to scenes. The only place that knows glTF.
//!
//! ```text
//! files     what may be opened; GLB; URIs
//! document  the JSON; versions and extensions
//! data      buffers, views, accessors, every size checked       meshopt  compressed views
//! mesh      primitives to triangles; morph targets; skins
//! nodes     the hierarchy to placements and labels
//! ```
//!
//! Files are taken for hostile: nothing outside the scene's folder is opened, nothing is allocated or walked through on
//! the word of the file alone, and every index is checked where it is used.

mod data;
mod document;
mod fault;
mod files;
mod mesh;
mod meshopt;
mod nodes;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use data::Data;
use document::Document;
use fault::{Fault, counted, quoted};
use nodes::{Hierarchy, Placements};

use super::{Material, Scene, SceneBuildError, SceneBuilder};
use crate::error::SceneError;
use crate::frame::UpAxis;

/// What to make of a file.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Which of the file's scenes, by name. `None`: its default scene; the first, if it names none; all of its nodes, if
    /// it has no scenes.
    pub scene_name: Option<&'a str>,
    /// Which of the file's axes is up in the world.
    pub up: UpAxis,
    /// Semantic labels by name of a node (and all below it) or of a material. A node's `extras.label` may name one too.
    pub labels: &'a BTreeMap<String, u32>,
}

/// A scene, and what the user should know about how it was read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// One sentence each. Nothing in them keeps the scene from being used.
    pub warnings: Vec<String>,
}

/// Loads a `.gltf` or `.glb` file with the buffers it names. `display_name` is what [`Geometry::files`](super::Geometry::files) calls it.
///
/// Geometry is as glTF 2.0 defines it: all triangle modes, node transforms (composed in f64), sparse and normalised
/// accessors, skins at the pose of their nodes, morph targets at their default weights, and the extensions
/// KHR_mesh_quantization, EXT_meshopt_compression, KHR_meshopt_compression, EXT_mesh_gpu_instancing and
/// KHR_node_visibility. Points and lines are left out. Images are not read.
///
/// # Errors
/// A [`SceneError`] about `path` that names the element: the file can't be read, is no glTF 2.0, needs an extension
/// that is unknown, contradicts itself, or has no triangles. No file causes a panic, and none makes this function open
/// anything outside the folder of `path`.
pub fn load(path: &Path, display_name: &str, options: &Options) -> Result<Loaded, SceneError> {
    // The last line of defence, not the first: nothing in here is known to panic.
    catch_unwind(AssertUnwindSafe(|| read_and_build(path, display_name, options)))
        .unwrap_or_else(|_| Err(Fault::new("", "the reader failed on it; this is an error in beamcast")))
        .map_err(|Fault { element, problem, help }| SceneError {
            path: path.to_path_buf(),
            element,
            problem,
            help,
        })
}

fn read_and_build(path: &Path, display_name: &str, options: &Options) -> Result<Loaded, Fault> {
    let mut warnings = Vec::new();
    let Read { builder, instance_elements, left_out } = read(path, display_name, options, &mut warnings)?;
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
    warnings.extend(left_out);
    Ok(Loaded { scene, warnings })
}

/// A file's content, its bytes no longer needed.
struct Read<F> {
    builder: SceneBuilder,
    /// Names the node of an instance.
    instance_elements: F,
    /// Warnings about what was left out.
    left_out: Vec<String>,
}

fn read(
    path: &Path,
    display_name: &str,
    options: &Options,
    warnings: &mut Vec<String>,
) -> Result<Read<impl Fn(usize) -> String + use<>>, Fault> {
    let file = files::read_whole(path).map_err(|problem| Fault::new("", problem))?;
    let folder = path.canonicalize().ok().and_then(|path| path.parent().map(Path::to_path_buf));
    let folder = folder.ok_or_else(|| Fault::new("", "its folder can't be found"))?;
    if file.is_empty() {
        return Err(Fault::new("", "the file is empty"));
    }
    let (text, chunk) = files::split_glb(&file, warnings)?.unwrap_or((&file, None));
    let document = Document::parse(text)?;

    let data = Data::new(&document, chunk, &folder, file.len() as u64);
    let hierarchy = Hierarchy::new(&document, warnings)?;
    let scene = nodes::choose_scene(&document, options.scene_name)?;
    let placements = nodes::place(&document, &data, &hierarchy, scene, options, warnings)?;
    if placements.instances.is_empty() {
        return Err(nothing_to_hit(&document, scene, &placements));
    }
    warn_of_unknown_labels(&document, options.labels, warnings);

    let mut materials: Vec<_> = document.materials.iter().map(|m| material(m, options)).collect();
    if placements.uses_default_material {
        materials.push(Material::default());
    }
    let left_out = placements.left_out.warnings();
    let mut sources = vec![files::source_file(display_name, &file)];
    sources.extend(data.into_files());
    let builder = SceneBuilder {
        meshes: placements.meshes,
        instances: placements.instances,
        materials,
        files: sources,
    };
    let labels: BTreeMap<u32, String> =
        placements.nodes.iter().map(|&node| (node, document.node_label(node))).collect();
    let nodes = placements.nodes;
    let instance_elements = move |instance: usize| labels.get(&nodes[instance]).cloned().unwrap_or_default();
    Ok(Read { builder, instance_elements, left_out })
}

fn material(material: &document::Material, options: &Options) -> Material {
    let name = material.name.clone().unwrap_or_default();
    let color = match &material.extensions.specular_glossiness {
        Some(older) => older.diffuse_factor,
        None => material.pbr_metallic_roughness.base_color_factor,
    };
    Material {
        job_label: options.labels.get(&name).copied(),
        name,
        base_color: color.unwrap_or([1.0; 4]).map(|c| c.clamp(0.0, 1.0)),
    }
}

fn nothing_to_hit(document: &Document, scene: Option<u32>, placements: &Placements) -> Fault {
    let element = scene.map_or(String::new(), |index| document.scene_label(index));
    let place = if scene.is_some() { "the scene" } else { "the file" };
    let Placements { left_out, visited, .. } = placements;
    let found = if left_out.points_and_lines > 0 {
        "has only points and lines".to_owned()
    } else if left_out.without_positions > 0 {
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

fn warn_of_unknown_labels(document: &Document, labels: &BTreeMap<String, u32>, warnings: &mut Vec<String>) {
    let nodes = document.nodes.iter().filter_map(|node| node.name.as_deref());
    let names: BTreeSet<&str> =
        nodes.chain(document.materials.iter().filter_map(|material| material.name.as_deref())).collect();
    // `extras.label` may name a label too.
    let extras: Vec<&str> =
        document.nodes.iter().filter_map(|node| node.extras.as_ref()).map(|extras| extras.get()).collect();
    for name in labels.keys() {
        let quoted_name = serde_json::Value::from(name.as_str()).to_string();
        if names.contains(name.as_str()) || extras.iter().any(|extras| extras.contains(&quoted_name)) {
            continue;
        }
        let meant = nodes::similar(name, names.iter().copied());
        let meant = meant.map_or(String::new(), |meant| format!("; did you mean {}?", quoted(meant)));
        warnings.push(format!("labels: no node or material is called {}{meant}", quoted(name)));
    }
}
