//! What a file holds, by name: the names that a job's labels can use, and all that stands in the file beside triangles.

use std::collections::BTreeSet;

use serde::Serialize;

use super::animation::target_of;
use super::document::Document;
use super::schema::{Animation, Lenient};

/// What a file holds, element by element. Indices are those of the file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outline {
    /// The index of the scene that is loaded by default.
    pub default_scene: Option<u32>,
    /// The scenes.
    pub scenes: Vec<SceneOutline>,
    /// The nodes.
    pub nodes: Vec<NodeOutline>,
    /// The meshes.
    pub meshes: Vec<MeshOutline>,
    /// The materials' names.
    pub materials: Vec<Option<String>>,
    /// The cameras.
    pub cameras: Vec<CameraOutline>,
    /// The animations.
    pub animations: Vec<AnimationOutline>,
    /// The skins.
    pub skins: Vec<SkinOutline>,
}

/// A scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SceneOutline {
    /// Its name.
    pub name: Option<String>,
    /// The nodes that it begins with.
    pub nodes: Vec<u32>,
}

/// A node.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NodeOutline {
    /// Its name.
    pub name: Option<String>,
    /// The nodes that it moves.
    pub children: Vec<u32>,
    /// The mesh that it places.
    pub mesh: Option<u32>,
    /// The camera that it places.
    pub camera: Option<u32>,
}

/// A mesh.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MeshOutline {
    /// Its name.
    pub name: Option<String>,
    /// The material of each of its primitives.
    pub materials: Vec<Option<u32>>,
}

/// A camera.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct CameraOutline {
    /// Its name.
    pub name: Option<String>,
    /// `perspective` or `orthographic`, as the file says it.
    pub kind: Option<String>,
    /// The nodes that place it.
    pub nodes: Vec<u32>,
}

/// An animation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AnimationOutline {
    /// Its name.
    pub name: Option<String>,
    /// The time of its last keyframe, in seconds, as the file says it.
    pub length_s: Option<f64>,
    /// The nodes that it moves, hides or bends, in ascending order.
    pub nodes: Vec<u32>,
}

/// A skin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SkinOutline {
    /// Its name.
    pub name: Option<String>,
    /// The nodes that are its joints.
    pub joints: Vec<u32>,
}

impl Outline {
    pub(super) fn of(document: Document) -> Self {
        let mut cameras: Vec<CameraOutline> = document
            .cameras
            .iter()
            .map(|camera| CameraOutline { name: text(&camera.name), kind: text(&camera.kind), nodes: vec![] })
            .collect();
        for (index, node) in (0_u32..).zip(&document.nodes) {
            let camera = node.camera.given().and_then(|&camera| cameras.get_mut(camera as usize));
            if let Some(camera) = camera {
                camera.nodes.push(index);
            }
        }
        let first = (!document.scenes.is_empty()).then_some(0);
        let is_there = |scene: &u32| (*scene as usize) < document.scenes.len();
        Self {
            default_scene: document.scene.filter(is_there).or(first),
            materials: document.materials.iter().map(|material| text(&material.name)).collect(),
            animations: document
                .animations
                .iter()
                .map(|animation| animation_outline(animation, &document))
                .collect(),
            skins: document
                .skins
                .iter()
                .map(|skin| SkinOutline { name: text(&skin.name), joints: skin.joints.clone() })
                .collect(),
            cameras,
            scenes: document
                .scenes
                .into_iter()
                .map(|scene| SceneOutline { name: scene.name, nodes: scene.nodes })
                .collect(),
            meshes: document
                .meshes
                .into_iter()
                .map(|mesh| MeshOutline {
                    name: mesh.name,
                    materials: mesh.primitives.iter().map(|primitive| primitive.material).collect(),
                })
                .collect(),
            nodes: document
                .nodes
                .into_iter()
                .map(|node| NodeOutline {
                    name: node.name,
                    children: node.children,
                    mesh: node.mesh,
                    camera: node.camera.given().copied(),
                })
                .collect(),
        }
    }

    /// The nodes that no node moves.
    pub fn roots(&self) -> Vec<u32> {
        let mut is_child = vec![false; self.nodes.len()];
        for &child in self.nodes.iter().flat_map(|node| &node.children) {
            if let Some(is_child) = is_child.get_mut(child as usize) {
                *is_child = true;
            }
        }
        (0_u32..).zip(is_child).filter(|(_, is_child)| !is_child).map(|(index, _)| index).collect()
    }
}

fn animation_outline(animation: &Animation, document: &Document) -> AnimationOutline {
    let channels = animation.channels.given().map_or(&[][..], |channels| channels);
    let samplers = animation.samplers.given().map_or(&[][..], |samplers| samplers);
    let mut nodes = BTreeSet::new();
    let mut length_s: Option<f64> = None;
    for channel in channels.iter().filter_map(Lenient::given) {
        let Some(node) = target_of(channel).and_then(|(node, _)| node) else { continue };
        nodes.insert(node);
        let sampler = samplers.get(channel.sampler as usize).and_then(Lenient::given);
        let input = sampler.and_then(|sampler| document.accessors.get(sampler.input as usize));
        let last = input.and_then(|input| input.max.given()?.first().copied());
        length_s = last.map_or(length_s, |last| Some(length_s.map_or(last, |length| length.max(last))));
    }
    AnimationOutline { name: text(&animation.name), length_s, nodes: nodes.into_iter().collect() }
}

fn text(value: &Lenient<String>) -> Option<String> {
    value.given().cloned()
}
