//! Scenes: triangles, where they are placed, what they are made of and what they are called.
//!
//! The scene's space is the world moved (in f64) so that the scene's own centre is near its origin; only then are
//! vertices rounded to f32. What is placed once is stored in that space ([`Scene::meshes`]`[0]`); a mesh placed more
//! than once is stored once, in its own space, with one [`Placement`] each time.

mod build;
pub mod gltf;

use glam::{DAffine3, DVec3};

pub use build::{Placed, SceneBuildError, SceneBuilder, SourceMesh, SourcePart};

/// A scene, ready to be traced.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The world position (metres) of the scene space's origin.
    pub centre: DVec3,
    /// Mesh 0 holds everything that is placed once, in the scene's space; it may be empty. The others are in their own
    /// space.
    pub meshes: Vec<Mesh>,
    /// Placement 0 is mesh 0 as it stands. Triangle ids count placement by placement.
    pub placements: Vec<Placement>,
    /// One for each time that a mesh is placed, in document order. An instance's id is its index.
    pub instances: Vec<Instance>,
    /// A material's id is its index.
    pub materials: Vec<Material>,
    /// Zero-area triangles that were left out.
    pub skipped_triangles: u64,
    /// Every file that was read: what the scene is made of.
    pub files: Vec<SourceFile>,
}

/// Triangles that share a space.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertices, metres.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices, counter-clockwise seen from the front. None has zero area.
    pub triangles: Vec<[u32; 3]>,
    /// Runs of triangles of one material (and, in mesh 0, one instance), in order and without gaps.
    pub parts: Vec<Part>,
}

/// A run of triangles, up to the next part's first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// The run's first triangle in its mesh.
    pub first_triangle: u32,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Added to the placement's [`Placement::first_instance`]: 0 but in mesh 0.
    pub instance: u32,
}

/// A mesh put somewhere.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// From the mesh's space to the scene's. The identity for placement 0.
    pub scene_from_mesh: DAffine3,
    /// The other way.
    pub mesh_from_scene: DAffine3,
    /// The id of the mesh's first triangle, here.
    pub first_triangle: u32,
    /// The id of the instance of the mesh's part with `instance` 0, here.
    pub first_instance: u32,
}

/// A mesh's presence at a node of the scene's file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Instance {
    /// The node's name as the file gives it, or empty. Never used as a file name.
    pub name: String,
    /// The semantic label that the job's `[labels]` gives the node or one of its ancestors by name.
    pub job_label: Option<u32>,
    /// The label of the file: `extras.label` of the node, else of its nearest ancestor that has one.
    pub file_label: Option<u32>,
}

/// What a surface is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The material's name as the file gives it, or empty.
    pub name: String,
    /// Linear red, green, blue and alpha.
    pub base_color: [f32; 4],
    /// The semantic label that the job's `[labels]` gives it by name.
    pub job_label: Option<u32>,
}

impl Default for Material {
    /// glTF's default material: white.
    fn default() -> Self {
        Self { name: String::new(), base_color: [1.0; 4], job_label: None }
    }
}

impl Material {
    /// Lambertian reflectivity ρ at the sensor's wavelength, 0 to 1. glTF knows visible colours only: the relative
    /// luminance of the linear base colour (ITU-R BT.709, 0.2126 R + 0.7152 G + 0.0722 B) stands for it.
    pub fn reflectivity(&self) -> f32 {
        let [r, g, b, _] = self.base_color;
        (0.2126 * r + 0.7152 * g + 0.0722 * b).clamp(0.0, 1.0)
    }
}

/// A file that the scene was read from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFile {
    /// As the user or the scene named it, never made absolute.
    pub name: String,
    /// Its length in bytes.
    pub bytes: u64,
    /// BLAKE3 of its content, in hexadecimal.
    pub blake3: String,
}

/// What a triangle belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Index into [`Scene::materials`].
    pub material: u32,
}

impl Scene {
    /// Triangles, each counted as often as it is placed: one more than the largest triangle id.
    pub fn triangle_count(&self) -> u64 {
        self.placements.iter().map(|p| self.meshes[p.mesh as usize].triangles.len() as u64).sum()
    }

    /// Triangles held in memory.
    pub fn stored_triangle_count(&self) -> u64 {
        self.meshes.iter().map(|m| m.triangles.len() as u64).sum()
    }

    /// What triangle `triangle` of the mesh at `placement` belongs to.
    pub fn surface(&self, placement: u32, triangle: u32) -> Surface {
        let placement = &self.placements[placement as usize];
        let parts = &self.meshes[placement.mesh as usize].parts;
        let part = parts[parts.partition_point(|p| p.first_triangle <= triangle) - 1];
        Surface { instance: placement.first_instance + part.instance, material: part.material }
    }

    /// The semantic label of a surface: the job's word for the node, else the job's for the material, else the file's,
    /// else 0.
    pub fn label(&self, surface: Surface) -> u32 {
        let instance = &self.instances[surface.instance as usize];
        let material = &self.materials[surface.material as usize];
        instance.job_label.or(material.job_label).or(instance.file_label).unwrap_or(0)
    }
}
