//! What a file holds, by name: the names that a job's labels can use, and all that stands in the file beside triangles.

use serde::Serialize;

use super::document::Document;
use super::schema::Lenient;

/// What a file holds, element by element. Indices are those of the file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
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
    /// The animations' names.
    pub animations: Vec<Option<String>>,
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
            animations: document.animations.iter().map(|animation| text(&animation.name)).collect(),
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

fn text(value: &Lenient<String>) -> Option<String> {
    value.given().cloned()
}
