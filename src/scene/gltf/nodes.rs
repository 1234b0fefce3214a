//! Reads nodes as instances of meshes: where they are and how they move, visibility and labels.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::animation::rest;
use super::chains::Chains;
use super::data::{Data, Layout};
use super::document::Document;
use super::fault::{Fault, quoted};
use super::mesh::{LeftOut, MeshReader, Pose};
use super::notices::Notices;
use super::options::{Actor, Options};
use super::rotation::unit;
use super::schema::Component::{F32, I8, I16};
use super::schema::{Kind, Node};
use super::shape::{BendingSkin, Shape};
use super::skin::SkinSource;
use crate::motion::{Channel, Link, Motion};
use crate::scene::Deformer;
use crate::scene::arrangement::{crushes_to_a_line, is_invertible};
use crate::scene::geometry::{Group, Object};
use crate::scene::source::{SourceInstance, SourceMesh};

const TRANSLATION: Layout = Layout { purpose: "TRANSLATION", kind: Kind::Vec3, components: &[(F32, false)] };
const ROTATION: Layout =
    Layout { purpose: "ROTATION", kind: Kind::Vec4, components: &[(F32, false), (I8, true), (I16, true)] };
const SCALE: Layout = Layout { purpose: "SCALE", ..TRANSLATION };

/// The meshes and instances that the traversal of a scene's nodes finds.
pub(super) struct PlacedMeshes {
    pub meshes: Vec<SourceMesh>,
    pub instances: Vec<SourceInstance>,
    /// The node of each instance.
    pub nodes: Vec<u32>,
    /// What moves as one.
    pub groups: Vec<Group>,
    /// The number of nodes that were visited, visible or not.
    pub visited: u64,
    /// The primitives that were left out.
    pub left_out: LeftOut,
    /// Whether a primitive has no material.
    pub uses_default_material: bool,
}

/// The labels and the optics that a node inherits.
#[derive(Clone, Copy, Default)]
struct Labels {
    job: Option<u32>,
    file: Option<u32>,
    optics: Option<u32>,
}

/// Where a mesh is placed.
#[derive(Default)]
struct Spot {
    /// The node in whose space it is; `None` is glTF's world.
    anchor: Option<u32>,
    /// Where it is there.
    anchor_from_mesh: DAffine3,
    /// The node whose movement it takes part in, if it moves.
    group: Option<u32>,
    deformer: Option<Arc<Deformer>>,
}

/// Traverses the nodes of a scene (of the file, if it has no scenes) depth first and reads their meshes.
struct Traversal<'d, 'a, 'o> {
    document: &'d Document,
    data: &'d Data<'a>,
    chains: &'d Chains<'d, 'a>,
    /// The actors that are nodes.
    drivers: &'d BTreeMap<u32, &'o Actor<'o>>,
    options: &'d Options<'o>,
    /// The indices of the job's optics by the names of nodes.
    optics: BTreeMap<&'d str, u32>,
    notices: &'d Notices,
    reader: MeshReader<'d, 'a>,
    meshes: Vec<SourceMesh>,
    instances: Vec<SourceInstance>,
    nodes: Vec<u32>,
    visited: u64,
    /// The values of `extras.label` that were warned of.
    strange_labels: BTreeSet<String>,
    /// The meshes that were read, by index and the bits of the morph weights, if those are not the mesh's own.
    known: BTreeMap<(u32, Option<Vec<u64>>), usize>,
    /// The objects that move with a node.
    groups: BTreeMap<u32, Vec<u32>>,
    /// The labels of nodes that move.
    labels_of: BTreeMap<u32, Labels>,
}

/// Reads the meshes of the nodes below the roots of the scene, and places them in document order. `drivers` are the actors among
/// the nodes.
pub(super) fn place<'o>(
    chains: &Chains,
    drivers: &BTreeMap<u32, &'o Actor<'o>>,
    options: &Options<'o>,
    notices: &Notices,
) -> Result<PlacedMeshes, Fault> {
    let &Chains { document, data, .. } = chains;
    let mut traversal = Traversal {
        document,
        data,
        chains,
        drivers,
        options,
        optics: options.optics_by_name(),
        notices,
        reader: MeshReader::new(document, data, notices),
        meshes: Vec::new(),
        instances: Vec::new(),
        nodes: Vec::new(),
        visited: 0,
        strange_labels: BTreeSet::new(),
        known: BTreeMap::new(),
        groups: BTreeMap::new(),
        labels_of: BTreeMap::new(),
    };
    traversal.run()?;
    let groups = traversal.groups()?;
    Ok(PlacedMeshes {
        meshes: traversal.meshes,
        instances: traversal.instances,
        nodes: traversal.nodes,
        groups,
        visited: traversal.visited,
        left_out: traversal.reader.left_out,
        uses_default_material: traversal.reader.uses_default_material,
    })
}

impl Traversal<'_, '_, '_> {
    fn run(&mut self) -> Result<(), Fault> {
        let roots = &self.chains.hierarchy.roots;
        let mut stack: Vec<_> = roots.iter().rev().map(|&root| (root, Labels::default())).collect();
        // A root that the file lists as a child too is not placed a second time.
        let mut is_placed = vec![false; self.document.nodes.len()];
        while let Some((index, inherited)) = stack.pop() {
            if std::mem::replace(&mut is_placed[index as usize], true) {
                continue;
            }
            self.visited += 1;
            let node = &self.document.nodes[index as usize];
            if !self.is_visible(index, node) {
                let message = "KHR_node_visibility hides it: it and all nodes below it are left out";
                self.notices.note(|| self.document.node_label(index), message, None);
                continue;
            }
            let labels = self.labels(index, node, inherited);
            if self.chains.any_move() {
                self.labels_of.insert(index, labels);
            }
            if let Some(mesh) = node.mesh {
                self.place(index, node, mesh, labels)
                    .map_err(|fault| fault.within(self.document.node_label(index)))?;
            }
            stack.extend(node.children.iter().rev().map(|&child| (child, labels)));
        }
        Ok(())
    }

    /// Whether a node is visible, at times at least.
    fn is_visible(&self, index: u32, node: &Node) -> bool {
        let channel = self.chains.animations.of(index).and_then(|moves| moves.is_visible.as_ref());
        match channel {
            Some(channel) => !channel.is_rest() || *channel.held_at(0.0),
            None => node.extensions.visibility.as_ref().is_none_or(|visibility| visibility.visible),
        }
    }

    /// What moves as one, in the order of the nodes.
    fn groups(&mut self) -> Result<Vec<Group>, Fault> {
        let gltf_from_world = self.chains.world_from_gltf.inverse();
        let mut groups = Vec::with_capacity(self.groups.len());
        for (node, objects) in std::mem::take(&mut self.groups) {
            let of_first = &self.instances[objects[0] as usize].object;
            let labels = self.labels_of.get(&node).copied().unwrap_or_default();
            let actor = self.drivers.get(&node);
            let own = self.document.nodes[node as usize].name.clone().filter(|name| !name.is_empty());
            let label = labels.job.or(labels.file).or(of_first.job_label).or(of_first.file_label);
            groups.push(Group {
                name: actor
                    .map(|actor| actor.name.to_owned())
                    .or(own)
                    .unwrap_or_else(|| format!("node {node}")),
                label: actor.and_then(|actor| actor.label).or(label),
                world_from_group: Arc::new(self.chains.seen_place(node, Some(node), gltf_from_world)?),
                objects,
            });
        }
        Ok(groups)
    }

    fn labels(&mut self, index: u32, node: &Node, inherited: Labels) -> Labels {
        let by_name = node.name.as_deref().and_then(|name| self.options.labels.get(name)).copied();
        let optics = node.name.as_deref().and_then(|name| self.optics.get(name)).copied();
        Labels {
            job: by_name.or(inherited.job),
            file: self.extras_label(index, node).or(inherited.file),
            optics: optics.or(inherited.optics),
        }
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
        let meshes = &self.document.meshes;
        let name = [node.name.as_deref(), meshes.get(mesh as usize).and_then(|mesh| mesh.name.as_deref())];
        let name = name.into_iter().flatten().find(|name| !name.is_empty()).unwrap_or_default();
        let Labels { job, file, optics } = labels;
        let object = Object { name: name.to_owned(), job_label: job, optics, file_label: file };
        let channel = self.chains.animations.of(index).and_then(|moves| moves.weights.clone());
        let still = rest(&channel);
        let weights = still.as_deref().or(node.weights.as_deref());
        let moving_weights = channel.filter(|channel| !channel.is_rest());

        if let Some(skin) = node.skin {
            if node.extensions.instancing.is_some() {
                return Err(Fault::new("", "it has a skin and EXT_mesh_gpu_instancing")
                    .help("glTF does not say what that would mean: use one of them"));
            }
            let (mesh, spot) = self.skinned(index, mesh, skin, weights, moving_weights)?;
            self.meshes.push(mesh);
            return self.add(index, self.meshes.len() - 1, spot, object);
        }

        let mut group = self.chains.top(index);
        let mut deformer = None;
        let source = if moving_weights.is_some() {
            let (read, bends) = self.reader.read_bending(mesh, &Pose { weights: None, skin: None })?;
            group = group.or(Some(index));
            let (read, shape) =
                self.bending(read, |rest| Shape { rest, bends, weights: moving_weights, skin: None });
            deformer = Some(shape);
            self.meshes.push(read);
            self.meshes.len() - 1
        } else {
            let bits = |weights: &[f64]| weights.iter().map(|weight| weight.to_bits()).collect();
            let key = (mesh, weights.map(bits));
            match self.known.get(&key) {
                Some(&source) => source,
                None => {
                    self.meshes.push(self.reader.read(mesh, &Pose { weights, skin: None })?);
                    *self.known.entry(key).or_insert(self.meshes.len() - 1)
                }
            }
        };
        let spot = |anchor_from_mesh| Spot {
            anchor: Some(index),
            anchor_from_mesh,
            group,
            deformer: deformer.clone(),
        };
        let Some(instancing) = &node.extensions.instancing else {
            return self.add(index, source, spot(DAffine3::IDENTITY), object);
        };
        let document = self.document;
        let place = || format!("{}, EXT_mesh_gpu_instancing", document.node_label(index));
        let transforms = instances(self.data, &instancing.attributes, place, self.notices)
            .map_err(|fault| fault.within("EXT_mesh_gpu_instancing"))?;
        for node_from_instance in transforms {
            self.add(index, source, spot(node_from_instance?), object.clone())?;
        }
        Ok(())
    }

    /// A mesh that bends, in its shape at the start, and its shape over time.
    fn bending(
        &self,
        mesh: SourceMesh,
        shape: impl FnOnce(Vec<[f32; 3]>) -> Shape,
    ) -> (SourceMesh, Arc<Deformer>) {
        let shape = shape(mesh.positions);
        let mesh = SourceMesh { positions: shape.at(self.options.start_s), parts: mesh.parts };
        (mesh, Arc::new(Deformer::new(move |time_s| Some(shape.at(time_s)))))
    }

    /// The mesh of a node that has a skin, and where it is.
    ///
    /// Joints that move are seen from the lowest node that is above all of them: what moves that node moves the mesh as a whole, and
    /// only what the joints do below it bends the mesh.
    fn skinned(
        &mut self,
        index: u32,
        mesh: u32,
        skin: u32,
        weights: Option<&[f64]>,
        moving_weights: Option<Channel<Vec<f64>>>,
    ) -> Result<(SourceMesh, Spot), Fault> {
        let source = SkinSource::new(self.document, self.data, skin)?;
        let mut asked = source.joints.to_vec();
        if self.reader.stands_in_part(mesh)? {
            asked.push(index);
        }
        let moves = asked.iter().any(|&node| self.chains.top(node).is_some());
        if !moves && moving_weights.is_none() {
            let world_from_node = &self.chains.hierarchy.world_from_node;
            let joints = source.joints.iter().map(|&joint| world_from_node[joint as usize]);
            let pose = source.posed(joints, world_from_node[index as usize]);
            let read = self.reader.read(mesh, &Pose { weights, skin: Some(&pose) })?;
            let anchor_from_mesh = DAffine3::from_translation(pose.origin);
            return Ok((read, Spot { anchor_from_mesh, ..Spot::default() }));
        }
        let bones = self.chains.bones(&asked)?;
        let maps = bones.maps_at(self.options.start_s);
        let (joints, stand) = maps.split_at(source.joints.len());
        let pose = source.posed(joints.iter().copied(), stand.first().copied().unwrap_or_default());
        let spot = Spot {
            anchor: bones.anchor,
            anchor_from_mesh: DAffine3::from_translation(pose.origin),
            group: bones.anchor.map(|anchor| self.chains.top(anchor).unwrap_or(anchor)).or(Some(index)),
            deformer: None,
        };
        if !bones.bend() && moving_weights.is_none() {
            return Ok((self.reader.read(mesh, &Pose { weights, skin: Some(&pose) })?, spot));
        }
        let own = self.document.meshes.get(mesh as usize).map(|mesh| &mesh.weights[..]);
        let weights = if moving_weights.is_some() { None } else { weights.or(own) };
        let (read, bends) = self.reader.read_bending(mesh, &Pose { weights, skin: Some(&pose) })?;
        let mut bone_from_mesh = source.joint_from_mesh;
        bone_from_mesh.resize(asked.len(), DAffine3::IDENTITY);
        let skin = BendingSkin { bones, bone_from_mesh, origin: pose.origin };
        let (read, deformer) =
            self.bending(read, |rest| Shape { rest, bends, weights: moving_weights, skin: Some(skin) });
        Ok((read, Spot { deformer: Some(deformer), ..spot }))
    }

    fn add(&mut self, node: u32, mesh: usize, spot: Spot, mut object: Object) -> Result<(), Fault> {
        let Spot { anchor, anchor_from_mesh, group, deformer } = spot;
        let chains = self.chains;
        let is_moved = anchor.is_some_and(|anchor| chains.top(anchor).is_some()) || chains.blinks(node);
        let (world_from_mesh, motion) = if is_moved {
            let motion = chains.seen_place(node, anchor, anchor_from_mesh)?;
            let is_fixed = motion.links.iter().all(Link::is_fixed);
            (motion.map_at(self.options.start_s), Some(motion).filter(|_| !is_fixed))
        } else {
            let gltf_from_anchor = anchor.map(|anchor| chains.hierarchy.world_from_node[anchor as usize]);
            let gltf_from_mesh = match gltf_from_anchor {
                // Multiplied by 1, zeros could change their signs.
                Some(map) if anchor_from_mesh == DAffine3::IDENTITY => map,
                Some(map) => map * anchor_from_mesh,
                None => anchor_from_mesh,
            };
            (chains.world_from_gltf * gltf_from_mesh, None)
        };
        if !world_from_mesh.is_finite() {
            return Err(Fault::new("", "its place in the world is not finite")
                .help("the transforms of it and its ancestors multiply to more than f64 can hold"));
        }
        // The instance, and its object, which stays in the scene.
        self.data.spend(1, 2 * size_of::<SourceInstance>() + object.name.len())?;
        let source = &self.meshes[mesh];
        if source.parts.is_empty() {
            return Ok(());
        }
        let moves = motion.is_some() || deformer.is_some();
        if !moves && !is_invertible(&world_from_mesh) && !crushes_to_a_line(&world_from_mesh) {
            // The builder cannot share the mesh, so it stores the mesh for each such instance.
            let triangles = source.parts.iter().map(|part| part.triangles.len()).sum();
            self.data.spend(source.positions.len(), size_of::<[f32; 3]>())?;
            self.data.spend(triangles, size_of::<[u32; 3]>())?;
        }
        if let Some(group) = group {
            let label = self.drivers.get(&group).and_then(|actor| actor.label);
            object.job_label = label.or(object.job_label);
            self.groups.entry(group).or_default().push(self.instances.len() as u32);
        }
        let motion: Option<Arc<Motion>> = motion.map(Arc::new);
        self.instances.push(SourceInstance { mesh, world_from_mesh, motion, deformer, object });
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
