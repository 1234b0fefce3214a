//! Reads nodes as instances of meshes: the hierarchy and its transforms, visibility and labels.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::data::{Data, Layout};
use super::document::Document;
use super::fault::{Fault, quoted};
use super::mesh::{LeftOut, MeshReader, Pose, SkinPose};
use super::notices::Notices;
use super::options::Options;
use super::schema::Component::{F32, I8, I16};
use super::schema::{Kind, Node};
use crate::scene::arrangement::{crushes_to_a_line, is_invertible};
use crate::scene::geometry::Object;
use crate::scene::source::{SourceInstance, SourceMesh};
use crate::source::suggest::nearest;
use crate::source::words::counted;

const TRANSLATION: Layout = Layout { purpose: "TRANSLATION", kind: Kind::Vec3, components: &[(F32, false)] };
const ROTATION: Layout =
    Layout { purpose: "ROTATION", kind: Kind::Vec4, components: &[(F32, false), (I8, true), (I16, true)] };
const SCALE: Layout = Layout { purpose: "SCALE", ..TRANSLATION };

/// The largest deviation of a quaternion's length from 1 that causes no warning. The four components of a quaternion in 8-bit
/// integers are each off by at most 1/254, so its length is off by at most √4 / 254 = 0.008.
const QUATERNION_TOLERANCE: f64 = 0.01;

/// The largest deviation of the last row of a matrix from [0, 0, 0, 1] that is read as that row. Exporters that invert or
/// multiply matrices in f32 leave a few units in the last place there, of numbers of the size of a scene.
const LAST_ROW_TOLERANCE: f64 = 1e-3;

/// The parents and the places of all nodes, and the nodes that a scene begins with.
pub(super) struct Hierarchy {
    /// The nodes that the scene begins with, in the order of the file.
    roots: Vec<u32>,
    /// The map of each node to the world, in glTF's axes.
    pub world_from_node: Vec<DAffine3>,
}

impl Hierarchy {
    /// Checks that the nodes form trees and composes their transforms, as they are seen from `scene` (from the whole file, if it
    /// has no scenes). It takes time in proportion to the number of nodes, however deep the trees are.
    pub fn new(document: &Document, scene: Option<u32>, notices: &Notices) -> Result<Self, Fault> {
        let nodes = &document.nodes;
        let mut parents = parents(document, notices)?;
        let tops: Vec<u32> =
            (0_u32..).zip(&parents).filter(|(_, parent)| parent.is_none()).map(|(index, _)| index).collect();
        let mut stack = tops.clone();
        let mut is_reached = vec![false; nodes.len()];
        let mut order = Vec::with_capacity(nodes.len());
        while let Some(index) = stack.pop() {
            if !std::mem::replace(&mut is_reached[index as usize], true) {
                order.push(index);
                stack.extend(&nodes[index as usize].children);
            }
        }
        if let Some(lost) = is_reached.iter().position(|reached| !reached) {
            return Err(cycle(document, &parents, lost as u32));
        }

        let roots = match scene {
            None => tops,
            Some(index) => scene_roots(document, index, &order, &mut parents, notices)?,
        };
        let origin = DAffine3::from_translation(DVec3::from_array(document.origin));
        let mut world_from_node = vec![DAffine3::NAN; nodes.len()];
        // Parents come before their children.
        for index in order {
            let at = index as usize;
            let place = || document.node_label(index);
            let local =
                local_transform(&nodes[at], &place, notices).map_err(|fault| fault.within(place()))?;
            let world_from_parent = parents[at].map_or(origin, |parent| world_from_node[parent as usize]);
            world_from_node[at] = world_from_parent * local;
        }
        Ok(Self { roots, world_from_node })
    }
}

/// The parent of each node.
fn parents(document: &Document, notices: &Notices) -> Result<Vec<Option<u32>>, Fault> {
    let nodes = &document.nodes;
    let mut parents: Vec<Option<u32>> = vec![None; nodes.len()];
    for (index, node) in (0_u32..).zip(nodes) {
        for &child in &node.children {
            let fault = |problem: String| Fault::new(document.node_label(index), problem);
            match parents.get_mut(child as usize) {
                None => {
                    let problem =
                        format!("its child {child} does not exist: the last node is {}", nodes.len() - 1);
                    return Err(fault(problem));
                }
                Some(Some(parent)) if *parent == index => {
                    let message = "a child is listed twice; it is placed once";
                    notices.warn(|| document.node_label(index), message);
                }
                Some(Some(other)) => {
                    let problem = format!(
                        "its child {} is a child of {} already",
                        document.node_label(child),
                        document.node_label(*other)
                    );
                    return Err(fault(problem).help("a node has one parent; two nodes may share a mesh"));
                }
                Some(parent) => *parent = Some(index),
            }
        }
    }
    Ok(parents)
}

/// The error that a node hangs below itself. `lost` has a parent, which has a parent, and so on, so the way up from it ends in
/// a cycle.
fn cycle(document: &Document, parents: &[Option<u32>], lost: u32) -> Fault {
    let mut seen = BTreeSet::new();
    let mut at = lost;
    while let Some(parent) = parents[at as usize].filter(|_| seen.insert(at)) {
        at = parent;
    }
    Fault::new(document.node_label(at), "it is among its own descendants").help("nodes form trees")
}

/// The nodes that a scene begins with. A root that has a parent in the scene is placed by that parent, once. A root whose
/// parent is not in the scene begins the scene all the same: its parent, which the scene leaves out, does not move it.
fn scene_roots(
    document: &Document,
    scene: u32,
    order: &[u32],
    parents: &mut [Option<u32>],
    notices: &Notices,
) -> Result<Vec<u32>, Fault> {
    let place = || document.scene_label(scene);
    let mut is_listed = vec![false; parents.len()];
    let mut roots = Vec::new();
    for &root in &document.scenes[scene as usize].nodes {
        match is_listed.get_mut(root as usize) {
            None => return Err(Fault::new(place(), format!("node {root} does not exist"))),
            Some(true) => notices.warn(
                || format!("{}, {}", place(), document.node_label(root)),
                "it is listed twice among the scene's nodes; it is placed once",
            ),
            Some(is_listed) => {
                *is_listed = true;
                roots.push(root);
            }
        }
    }
    // Whether a node is below a listed one, parents before children.
    let mut is_below = vec![false; parents.len()];
    for &index in order {
        if let Some(parent) = parents[index as usize] {
            is_below[index as usize] = is_listed[parent as usize] || is_below[parent as usize];
        }
    }
    roots.retain(|&root| {
        if parents[root as usize].is_none() {
            return true;
        }
        let place = || format!("{}, {}", place(), document.node_label(root));
        if is_below[root as usize] {
            notices.warn(place, "it is listed among the scene's nodes, but has a parent there, which places it");
            return false;
        }
        notices.warn(
            place,
            "it is listed among the scene's nodes, but has a parent, which the scene leaves out: the parent does \
             not move it",
        );
        true
    });
    for &root in &roots {
        parents[root as usize] = None;
    }
    Ok(roots)
}

fn local_transform(node: &Node, place: &impl Fn() -> String, notices: &Notices) -> Result<DAffine3, Fault> {
    if let Some(m) = &node.matrix {
        // A valid file has no matrix beside a translation, rotation or scale. Where a file has both, the matrix counts.
        let row = [m[3], m[7], m[11], m[15]];
        let right = [0.0, 0.0, 0.0, 1.0];
        if row != right {
            if row.iter().zip(right).any(|(found, right)| (found - right).abs() > LAST_ROW_TOLERANCE) {
                let problem = format!("the last row of its matrix is {row:?}");
                return Err(Fault::new("", problem)
                    .help("it is [0, 0, 0, 1] in glTF, whose matrices are written column by column"));
            }
            notices.warn(place, "the last row of its matrix is nearly, and taken as, [0, 0, 0, 1]");
        }
        let column = |at: usize| DVec3::new(m[at], m[at + 1], m[at + 2]);
        return Ok(DAffine3 {
            matrix3: DMat3::from_cols(column(0), column(4), column(8)),
            translation: column(12),
        });
    }
    let rotation = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    Ok(DAffine3::from_scale_rotation_translation(
        node.scale.map_or(DVec3::ONE, DVec3::from_array),
        unit(rotation, place, notices)?,
        node.translation.map_or(DVec3::ZERO, DVec3::from_array),
    ))
}

/// The quaternion, normalised. One of zeros is no rotation.
fn unit(xyzw: [f64; 4], place: &impl Fn() -> String, notices: &Notices) -> Result<DQuat, Fault> {
    let q = DQuat::from_array(xyzw);
    let length = q.length();
    if xyzw == [0.0; 4] {
        notices.warn(place, "its quaternion is zero, and read as no rotation");
        return Ok(DQuat::IDENTITY);
    }
    if !(length.is_finite() && length > 0.0) {
        let problem = format!("its rotation {xyzw:?} is no rotation");
        return Err(Fault::new("", problem).help("a quaternion [x, y, z, w] of length 1"));
    }
    if (length - 1.0).abs() > QUATERNION_TOLERANCE {
        notices.warn(place, "the length of its quaternion is not 1; it was normalised");
    }
    // A quaternion of length 1, such as [0, 0, 0, 1], stays exact.
    Ok(if length == 1.0 { q } else { q / length })
}

/// The index of the scene called `name`, or of the default scene; `None` if the file has no scenes.
pub(super) fn choose_scene(
    document: &Document,
    name: Option<&str>,
    notices: &Notices,
) -> Result<Option<u32>, Fault> {
    let scenes = &document.scenes;
    let Some(name) = name else {
        let first = (!scenes.is_empty()).then_some(0);
        return match document.scene {
            Some(index) if index as usize >= scenes.len() => {
                let instead = if first.is_some() { "its first scene is" } else { "all of its nodes are" };
                let message = format!("the file's default scene does not exist; {instead} read");
                notices.warn(|| format!("scene {index}"), message);
                Ok(first)
            }
            Some(index) => Ok(Some(index)),
            None => Ok(first),
        };
    };
    if let Some(index) = scenes.iter().position(|scene| scene.name.as_deref() == Some(name)) {
        return Ok(Some(index as u32));
    }
    const LISTED: usize = 20;
    let names: Vec<_> = scenes.iter().filter_map(|scene| scene.name.as_deref()).collect();
    let fault = Fault::new("scenes", format!("there is no scene {}", quoted(name)));
    if names.is_empty() {
        let count = counted(scenes.len(), "scene");
        return Err(fault.help(format!("the file has {count}, none with a name; leave the name out")));
    }
    let shown: Vec<_> = names.iter().take(LISTED).map(|name| quoted(name)).collect();
    let more = if names.len() > LISTED { ", …" } else { "" };
    let meant = nearest(name, names.iter().copied())
        .map_or(String::new(), |name| format!("did you mean {}? ", quoted(name)));
    Err(fault.help(format!("{meant}the file has {}{more}", shown.join(", "))))
}

/// The meshes and instances that the traversal of a scene's nodes finds.
pub(super) struct PlacedMeshes {
    pub meshes: Vec<SourceMesh>,
    pub instances: Vec<SourceInstance>,
    /// The node of each instance.
    pub nodes: Vec<u32>,
    /// The number of nodes that were visited, visible or not.
    pub visited: u64,
    /// The primitives that were left out.
    pub left_out: LeftOut,
    /// Whether a primitive has no material.
    pub uses_default_material: bool,
}

/// The labels that a node inherits.
#[derive(Clone, Copy, Default)]
struct Labels {
    job: Option<u32>,
    file: Option<u32>,
}

/// Traverses the nodes of a scene (of the file, if it has no scenes) depth first and reads their meshes.
struct Traversal<'d, 'a, 'o> {
    document: &'d Document,
    data: &'d Data<'a>,
    hierarchy: &'d Hierarchy,
    options: &'d Options<'o>,
    notices: &'d Notices,
    reader: MeshReader<'d, 'a>,
    meshes: Vec<SourceMesh>,
    instances: Vec<SourceInstance>,
    nodes: Vec<u32>,
    visited: u64,
    /// The values of `extras.label` that were warned of.
    strange_labels: BTreeSet<String>,
    /// The meshes that were read, by index and the bits of the node's own morph weights.
    known: BTreeMap<(u32, Option<Vec<u64>>), usize>,
}

/// Reads the meshes of the nodes below the roots of the scene, and places them in document order.
pub(super) fn place(
    document: &Document,
    data: &Data,
    hierarchy: &Hierarchy,
    options: &Options,
    notices: &Notices,
) -> Result<PlacedMeshes, Fault> {
    let mut traversal = Traversal {
        document,
        data,
        hierarchy,
        options,
        notices,
        reader: MeshReader::new(document, data, notices),
        meshes: Vec::new(),
        instances: Vec::new(),
        nodes: Vec::new(),
        visited: 0,
        strange_labels: BTreeSet::new(),
        known: BTreeMap::new(),
    };
    traversal.run()?;
    Ok(PlacedMeshes {
        meshes: traversal.meshes,
        instances: traversal.instances,
        nodes: traversal.nodes,
        visited: traversal.visited,
        left_out: traversal.reader.left_out,
        uses_default_material: traversal.reader.uses_default_material,
    })
}

impl Traversal<'_, '_, '_> {
    fn run(&mut self) -> Result<(), Fault> {
        let roots = &self.hierarchy.roots;
        let mut stack: Vec<_> = roots.iter().rev().map(|&root| (root, Labels::default())).collect();
        // A root that the file lists as a child too is not placed a second time.
        let mut is_placed = vec![false; self.document.nodes.len()];
        while let Some((index, inherited)) = stack.pop() {
            if std::mem::replace(&mut is_placed[index as usize], true) {
                continue;
            }
            self.visited += 1;
            let node = &self.document.nodes[index as usize];
            if node.extensions.visibility.as_ref().is_some_and(|visibility| !visibility.visible) {
                let message = "KHR_node_visibility hides it: it and all nodes below it are left out";
                self.notices.note(|| self.document.node_label(index), message, None);
                continue;
            }
            let labels = self.labels(index, node, inherited);
            if let Some(mesh) = node.mesh {
                self.place(index, node, mesh, labels)
                    .map_err(|fault| fault.within(self.document.node_label(index)))?;
            }
            stack.extend(node.children.iter().rev().map(|&child| (child, labels)));
        }
        Ok(())
    }

    fn labels(&mut self, index: u32, node: &Node, inherited: Labels) -> Labels {
        let by_name = node.name.as_deref().and_then(|name| self.options.labels.get(name)).copied();
        Labels { job: by_name.or(inherited.job), file: self.extras_label(index, node).or(inherited.file) }
    }

    /// `extras.label` of a node: an integer, or a name that the job maps to one.
    fn extras_label(&mut self, index: u32, node: &Node) -> Option<u32> {
        let label = label_of_extras(node)?;
        let found = match &label {
            serde_json::Value::String(name) => self.options.labels.get(name).copied(),
            _ => label.as_u64().and_then(|label| u32::try_from(label).ok()),
        };
        if found.is_none() && self.strange_labels.insert(label.to_string()) {
            let problem = match label.as_str() {
                Some(name) => format!("extras.label {} is not among the job's labels", quoted(name)),
                None => format!(
                    "extras.label {} is ignored: a label is an integer from 0 to {}, or a name in the job's \
                     labels",
                    quoted(&label.to_string()),
                    u32::MAX
                ),
            };
            self.notices.warn(|| self.document.node_label(index), problem);
        }
        found
    }

    fn place(&mut self, index: u32, node: &Node, mesh: u32, labels: Labels) -> Result<(), Fault> {
        let world_from_node = self.hierarchy.world_from_node[index as usize];
        let meshes = &self.document.meshes;
        let name = [node.name.as_deref(), meshes.get(mesh as usize).and_then(|mesh| mesh.name.as_deref())];
        let name = name.into_iter().flatten().find(|name| !name.is_empty()).unwrap_or_default();
        let object = Object { name: name.to_owned(), job_label: labels.job, file_label: labels.file };

        if let Some(skin) = node.skin {
            if node.extensions.instancing.is_some() {
                return Err(Fault::new("", "it has a skin and EXT_mesh_gpu_instancing")
                    .help("glTF does not say what that would mean: use one of them"));
            }
            let pose = SkinPose::new(self.document, self.data, skin, &self.hierarchy.world_from_node)?;
            let weights = node.weights.as_deref();
            self.meshes.push(self.reader.read(mesh, &Pose { weights, skin: Some(&pose), world_from_node })?);
            let gltf_from_mesh = DAffine3::from_translation(pose.origin);
            return self.add(index, self.meshes.len() - 1, gltf_from_mesh, object);
        }

        let weights = node.weights.as_deref();
        let key = (mesh, weights.map(|weights| weights.iter().map(|weight| weight.to_bits()).collect()));
        let source = match self.known.get(&key) {
            Some(&source) => source,
            None => {
                self.meshes.push(self.reader.read(mesh, &Pose { weights, skin: None, world_from_node })?);
                *self.known.entry(key).or_insert(self.meshes.len() - 1)
            }
        };
        let Some(instancing) = &node.extensions.instancing else {
            return self.add(index, source, world_from_node, object);
        };
        let place = || format!("{}, EXT_mesh_gpu_instancing", self.document.node_label(index));
        let transforms = instances(self.data, &instancing.attributes, place, self.notices)
            .map_err(|fault| fault.within("EXT_mesh_gpu_instancing"))?;
        for node_from_instance in transforms {
            self.add(index, source, world_from_node * node_from_instance?, object.clone())?;
        }
        Ok(())
    }

    fn add(&mut self, node: u32, mesh: usize, gltf_from_mesh: DAffine3, object: Object) -> Result<(), Fault> {
        if !gltf_from_mesh.is_finite() {
            return Err(Fault::new("", "its place in the world is not finite")
                .help("the transforms of it and its ancestors multiply to more than f64 can hold"));
        }
        // The instance, and its object, which stays in the scene.
        self.data.spend(1, 2 * size_of::<SourceInstance>() + object.name.len())?;
        let source = &self.meshes[mesh];
        if source.parts.is_empty() {
            return Ok(());
        }
        if !is_invertible(&gltf_from_mesh) && !crushes_to_a_line(&gltf_from_mesh) {
            // The builder cannot share the mesh, so it stores the mesh for each such instance.
            let triangles = source.parts.iter().map(|part| part.triangles.len()).sum();
            self.data.spend(source.positions.len(), size_of::<[f32; 3]>())?;
            self.data.spend(triangles, size_of::<[u32; 3]>())?;
        }
        let world_from_gltf = DAffine3::from_mat3(self.options.up.world_from_gltf());
        self.instances.push(SourceInstance {
            mesh,
            world_from_mesh: world_from_gltf * gltf_from_mesh,
            object,
        });
        self.nodes.push(node);
        Ok(())
    }
}

/// The value of a node's `extras.label`.
pub(super) fn label_of_extras(node: &Node) -> Option<serde_json::Value> {
    // Most extras hold other keys, and are not worth parsing.
    let extras = node.extras.as_ref().filter(|extras| extras.get().contains("\"label\""))?;
    let mut extras: serde_json::Value = serde_json::from_str(extras.get()).ok()?;
    extras.get_mut("label").map(serde_json::Value::take)
}

/// The transforms of the instances of EXT_mesh_gpu_instancing, in order.
fn instances<'b, P: Fn() -> String>(
    data: &'b Data,
    attributes: &BTreeMap<String, u32>,
    place: P,
    notices: &'b Notices,
) -> Result<impl Iterator<Item = Result<DAffine3, Fault>> + use<'b, P>, Fault> {
    let mut count = None;
    let mut elements = |layout: &Layout| match attributes.get(layout.purpose) {
        None => Ok::<_, Fault>(None),
        Some(&accessor) => {
            let elements =
                data.elements(accessor, layout, count).map_err(|fault| fault.within(layout.purpose))?;
            count = Some(elements.len());
            Ok(Some(elements))
        }
    };
    let translations = elements(&TRANSLATION)?;
    let rotations = elements(&ROTATION)?;
    let scales = elements(&SCALE)?;
    let Some(count) = count else {
        let problem = "it has none of TRANSLATION, ROTATION and SCALE";
        return Err(Fault::new("", problem).help("they say how many instances there are"));
    };
    Ok((0..count).map(move |at| {
        let rotation = rotations.map_or([0.0, 0.0, 0.0, 1.0], |rotations| rotations.get(at));
        let place = || format!("{}, instance {at}", place());
        let rotation =
            unit(rotation, &place, notices).map_err(|fault| fault.within(format!("instance {at}")))?;
        Ok(DAffine3::from_scale_rotation_translation(
            scales.map_or(DVec3::ONE, |scales| DVec3::from_array(scales.get(at))),
            rotation,
            translations.map_or(DVec3::ZERO, |translations| DVec3::from_array(translations.get(at))),
        ))
    }))
}
