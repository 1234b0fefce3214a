//! Reads nodes as instances of meshes: the hierarchy and its transforms, visibility and labels.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::json::accessor::{ComponentType, Type};

use super::data::{Data, Layout};
use super::document::{Document, Node};
use super::fault::{Fault, counted, missing, quoted};
use super::mesh::{LeftOut, MeshReader, Pose, SkinPose};
use super::options::Options;
use crate::scene::arrangement::{crushes_to_a_line, is_invertible};
use crate::scene::geometry::Object;
use crate::scene::notice::Notice;
use crate::scene::source::{SourceInstance, SourceMesh};
use crate::source::suggest::nearest;

use ComponentType::{F32, I8, I16};

const TRANSLATION: Layout = Layout { purpose: "TRANSLATION", kind: Type::Vec3, components: &[(F32, false)] };
const ROTATION: Layout =
    Layout { purpose: "ROTATION", kind: Type::Vec4, components: &[(F32, false), (I8, true), (I16, true)] };
const SCALE: Layout = Layout { purpose: "SCALE", ..TRANSLATION };

/// The largest deviation of a quaternion's length from 1 that causes no warning. The four components of a quaternion in 8-bit
/// integers are each off by at most 1/254, so its length is off by at most √4 / 254 = 0.008.
const QUATERNION_TOLERANCE: f64 = 0.01;

/// The parents and the places of all nodes.
pub(super) struct Hierarchy {
    /// The parent of each node; roots have none.
    parents: Vec<Option<u32>>,
    /// The map of each node to the world, in glTF's axes.
    pub world_from_node: Vec<DAffine3>,
}

impl Hierarchy {
    /// Checks that the nodes form trees and composes their transforms. It takes time in proportion to the number of nodes,
    /// however deep the trees are.
    pub fn new(document: &Document, notices: &mut Vec<Notice>) -> Result<Self, Fault> {
        let nodes = &document.nodes;
        let mut parents: Vec<Option<u32>> = vec![None; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            for &child in &node.children {
                let fault = |problem: String| Fault::new(document.node_label(index as u32), problem);
                match parents.get_mut(child as usize) {
                    None => {
                        let problem =
                            format!("its child {child} does not exist: the last node is {}", nodes.len() - 1);
                        return Err(fault(problem));
                    }
                    Some(Some(other)) => {
                        let problem = format!(
                            "its child {} is a child of {} already",
                            document.node_label(child),
                            document.node_label(*other)
                        );
                        return Err(fault(problem).help("a node has one parent; two nodes may share a mesh"));
                    }
                    Some(parent) => *parent = Some(index as u32),
                }
            }
        }

        let mut hierarchy = Self { parents, world_from_node: vec![DAffine3::NAN; nodes.len()] };
        let mut reached = vec![false; nodes.len()];
        let mut odd_rotations = 0;
        let mut stack: Vec<u32> = hierarchy.roots().collect();
        while let Some(index) = stack.pop() {
            let at = index as usize;
            let node = &nodes[at];
            reached[at] = true;
            let local = local_transform(node, &mut odd_rotations)
                .map_err(|fault| fault.within(document.node_label(index)))?;
            let world_from_parent = hierarchy.parents[at]
                .map_or(DAffine3::IDENTITY, |parent| hierarchy.world_from_node[parent as usize]);
            hierarchy.world_from_node[at] = world_from_parent * local;
            stack.extend(&node.children);
        }
        if let Some(index) = reached.iter().position(|reached| !reached) {
            // The node has a parent, which has a parent, and so on, so the way up from it ends in a cycle.
            let mut seen = BTreeSet::new();
            let mut at = index as u32;
            while let Some(parent) = hierarchy.parents[at as usize].filter(|_| seen.insert(at)) {
                at = parent;
            }
            let problem = "it is among its own descendants";
            return Err(Fault::new(document.node_label(at), problem).help("nodes form trees"));
        }
        if odd_rotations > 0 {
            notices.push(Notice::warning(
                "",
                format!(
                    "the length of the quaternion of {} is not 1; it was normalised",
                    counted(odd_rotations, "rotation")
                ),
            ));
        }
        Ok(hierarchy)
    }

    fn roots(&self) -> impl Iterator<Item = u32> + '_ {
        (0_u32..).zip(&self.parents).filter(|(_, parent)| parent.is_none()).map(|(index, _)| index)
    }
}

fn local_transform(node: &Node, odd_rotations: &mut u64) -> Result<DAffine3, Fault> {
    if let Some(m) = &node.matrix {
        // A valid file has no matrix beside a translation, rotation or scale. Where a file has both, the matrix counts.
        if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
            let problem = format!("the last row of its matrix is {:?}", [m[3], m[7], m[11], m[15]]);
            return Err(Fault::new("", problem).help("[0, 0, 0, 1]; matrices are written column by column"));
        }
        let column = |at: usize| DVec3::new(m[at], m[at + 1], m[at + 2]);
        return Ok(DAffine3 {
            matrix3: DMat3::from_cols(column(0), column(4), column(8)),
            translation: column(12),
        });
    }
    let rotation = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let (rotation, is_odd) = unit(rotation)?;
    *odd_rotations += u64::from(is_odd);
    Ok(DAffine3::from_scale_rotation_translation(
        node.scale.map_or(DVec3::ONE, DVec3::from_array),
        rotation,
        node.translation.map_or(DVec3::ZERO, DVec3::from_array),
    ))
}

/// The quaternion, normalised, and whether its length was far from 1.
fn unit(xyzw: [f64; 4]) -> Result<(DQuat, bool), Fault> {
    let q = DQuat::from_array(xyzw);
    let length = q.length();
    if !(length.is_finite() && length > 0.0) {
        let problem = format!("its rotation {xyzw:?} is no rotation");
        return Err(Fault::new("", problem).help("a quaternion [x, y, z, w] of length 1"));
    }
    // A quaternion of length 1, such as [0, 0, 0, 1], stays exact.
    let exact = if length == 1.0 { q } else { q / length };
    Ok((exact, (length - 1.0).abs() > QUATERNION_TOLERANCE))
}

/// The index of the scene called `name`, or of the default scene; `None` if the file has no scenes.
pub(super) fn choose_scene(document: &Document, name: Option<&str>) -> Result<Option<u32>, Fault> {
    let scenes = &document.scenes;
    let Some(name) = name else {
        return match document.scene {
            Some(index) if index as usize >= scenes.len() => {
                Err(missing("scene", index, scenes.len()).within("the default scene"))
            }
            Some(index) => Ok(Some(index)),
            None => Ok((!scenes.is_empty()).then_some(0)),
        };
    };
    if let Some(index) = scenes.iter().position(|scene| scene.name.as_deref() == Some(name)) {
        return Ok(Some(index as u32));
    }
    const LISTED: usize = 20;
    let names: Vec<_> = scenes.iter().filter_map(|scene| scene.name.as_deref()).collect();
    let fault = Fault::new("scenes", format!("there is no scene {}", quoted(name)));
    if names.is_empty() {
        let count = counted(scenes.len() as u64, "scene");
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
    notices: &'d mut Vec<Notice>,
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

/// Reads the meshes of the nodes below the roots of `scene`, and places them in document order.
pub(super) fn place(
    document: &Document,
    data: &Data,
    hierarchy: &Hierarchy,
    scene: Option<u32>,
    options: &Options,
    notices: &mut Vec<Notice>,
) -> Result<PlacedMeshes, Fault> {
    let mut traversal = Traversal {
        document,
        data,
        hierarchy,
        options,
        notices,
        reader: MeshReader::new(document, data),
        meshes: Vec::new(),
        instances: Vec::new(),
        nodes: Vec::new(),
        visited: 0,
        strange_labels: BTreeSet::new(),
        known: BTreeMap::new(),
    };
    traversal.run(scene)?;
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
    fn run(&mut self, scene: Option<u32>) -> Result<(), Fault> {
        let roots = match scene {
            None => self.hierarchy.roots().collect(),
            Some(index) => self.scene_roots(index).map_err(|f| f.within(self.document.scene_label(index)))?,
        };
        let mut hidden = 0;
        let mut stack: Vec<_> = roots.iter().rev().map(|&root| (root, Labels::default())).collect();
        while let Some((index, inherited)) = stack.pop() {
            self.visited += 1;
            let node = &self.document.nodes[index as usize];
            if node.extensions.visibility.as_ref().is_some_and(|visibility| !visibility.visible) {
                hidden += 1;
                continue;
            }
            let labels = self.labels(index, node, inherited);
            if let Some(mesh) = node.mesh {
                self.place(index, node, mesh, labels)
                    .map_err(|fault| fault.within(self.document.node_label(index)))?;
            }
            stack.extend(node.children.iter().rev().map(|&child| (child, labels)));
        }
        if hidden > 0 {
            let nodes = counted(hidden, "node");
            self.notices.push(Notice::note(
                "",
                format!(
                    "KHR_node_visibility hides {nodes}; a hidden node and all nodes below it are left out"
                ),
            ));
        }
        Ok(())
    }

    fn scene_roots(&self, index: u32) -> Result<Vec<u32>, Fault> {
        let roots = &self.document.scenes[index as usize].nodes;
        let mut seen = BTreeSet::new();
        for &root in roots {
            let problem = match self.hierarchy.parents.get(root as usize) {
                None => format!("node {root} does not exist"),
                Some(Some(parent)) => {
                    let parent = self.document.node_label(*parent);
                    format!("{} is no root: it is a child of {parent}", self.document.node_label(root))
                }
                Some(None) if !seen.insert(root) => {
                    format!("{} is listed twice", self.document.node_label(root))
                }
                Some(None) => continue,
            };
            return Err(Fault::new("", problem));
        }
        Ok(roots.clone())
    }

    fn labels(&mut self, index: u32, node: &Node, inherited: Labels) -> Labels {
        let by_name = node.name.as_deref().and_then(|name| self.options.labels.get(name)).copied();
        Labels { job: by_name.or(inherited.job), file: self.extras_label(index, node).or(inherited.file) }
    }

    /// `extras.label` of a node: an integer, or a name that the job maps to one.
    fn extras_label(&mut self, index: u32, node: &Node) -> Option<u32> {
        // Most extras hold other keys, and are not worth parsing.
        let extras = node.extras.as_ref().filter(|extras| extras.get().contains("\"label\""))?;
        let extras: serde_json::Value = serde_json::from_str(extras.get()).ok()?;
        let label = extras.get("label")?;
        let found = match label {
            serde_json::Value::String(name) => self.options.labels.get(name).copied(),
            _ => label.as_u64().and_then(|label| u32::try_from(label).ok()),
        };
        if found.is_none() && self.strange_labels.insert(label.to_string()) {
            let node = self.document.node_label(index);
            let problem = match label.as_str() {
                Some(name) => format!("extras.label {} is not among the job's labels", quoted(name)),
                None => format!(
                    "extras.label {} is ignored: a label is an integer from 0 to {}, or a name in the job's \
                     labels",
                    quoted(&label.to_string()),
                    u32::MAX
                ),
            };
            self.notices.push(Notice::warning(node, problem));
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
            self.meshes.push(self.reader.read(mesh, &Pose { weights, skin: Some(&pose) })?);
            let gltf_from_mesh = DAffine3::from_translation(pose.origin);
            return self.add(index, self.meshes.len() - 1, gltf_from_mesh, object);
        }

        let weights = node.weights.as_deref();
        let key = (mesh, weights.map(|weights| weights.iter().map(|weight| weight.to_bits()).collect()));
        let source = match self.known.get(&key) {
            Some(&source) => source,
            None => {
                self.meshes.push(self.reader.read(mesh, &Pose { weights, skin: None })?);
                *self.known.entry(key).or_insert(self.meshes.len() - 1)
            }
        };
        let Some(instancing) = &node.extensions.instancing else {
            return self.add(index, source, world_from_node, object);
        };
        let transforms = instances(self.data, &instancing.attributes)
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

/// The transforms of the instances of EXT_mesh_gpu_instancing, in order.
fn instances<'b>(
    data: &'b Data,
    attributes: &BTreeMap<String, u32>,
) -> Result<impl Iterator<Item = Result<DAffine3, Fault>> + use<'b>, Fault> {
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
        let (rotation, _) = unit(rotation).map_err(|fault| fault.within(format!("instance {at}")))?;
        Ok(DAffine3::from_scale_rotation_translation(
            scales.map_or(DVec3::ONE, |scales| DVec3::from_array(scales.get(at))),
            rotation,
            translations.map_or(DVec3::ZERO, |translations| DVec3::from_array(translations.get(at))),
        ))
    }))
}
