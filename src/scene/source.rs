//! What a scene is made of before it is one: meshes as their files give them, and where they are placed.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::corners::Corners;
use super::geometry::{Group, Object, SourceFile};
use super::material::Material;
use super::mover::Deformer;
use crate::motion::Motion;

/// Meshes and where they are placed, in document order; [`SceneBuilder::build`] makes a scene of them.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    /// The meshes, each in its own space.
    pub meshes: Vec<SourceMesh>,
    /// The places of the meshes, in document order.
    pub instances: Vec<SourceInstance>,
    /// What moves as one.
    pub groups: Vec<Group>,
    /// The materials.
    pub materials: Vec<Material>,
    /// The files that all of it was read from.
    pub files: Vec<SourceFile>,
}

/// A mesh as its file gives it.
#[derive(Clone, Debug, Default)]
pub struct SourceMesh {
    /// Vertices, metres. The vertices that triangles use must be finite.
    pub positions: Vec<[f32; 3]>,
    /// The triangles, by material.
    pub parts: Vec<SourcePart>,
}

/// Triangles of one material.
#[derive(Clone, Debug, Default)]
pub struct SourcePart {
    /// Indices into [`SourceMesh::positions`], which must be in bounds; counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`SceneBuilder::materials`].
    pub material: u32,
    /// The texture coordinates and colours of the triangles, three corners to each, if the material needs them.
    pub corners: Corners,
}

/// A mesh at a place.
#[derive(Clone, Debug, Default)]
pub struct SourceInstance {
    /// Index into [`SceneBuilder::meshes`].
    pub mesh: usize,
    /// Any affine map. A mirroring map keeps the fronts of triangles in front. Of a mesh that moves, it is the map at rest: where
    /// the mesh stands as long as no time is given.
    pub world_from_mesh: DAffine3,
    /// `world_from_mesh` over time, if the mesh moves or is hidden at times. Such a mesh is stored in its own space.
    pub motion: Option<Arc<Motion>>,
    /// The shape of the mesh over time, if it bends. Such a mesh is stored in its own space as well, in which it bends. It also moves
    /// there if it has a motion. The source mesh is its shape at rest.
    pub deformer: Option<Arc<Deformer>>,
    /// The object that the mesh is at this place.
    pub object: Object,
}

/// The reason why meshes and their places make no scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneBuildError {
    /// There is nothing to hit.
    #[error("the scene has no triangles")]
    Empty {
        /// The number of triangles that were left out because their area is zero.
        skipped: u64,
    },
    /// There are more triangles than 32-bit ids.
    #[error(
        "the scene has {count} triangles (each counted as often as it is placed), more than {}",
        u32::MAX
    )]
    TooManyTriangles {
        /// The number of triangles.
        count: u64,
    },
    /// A corner of a triangle is no vertex of its mesh.
    #[error(
        "triangle {triangle} of mesh {mesh} has the corner {vertex}, and the mesh has {vertices} vertices"
    )]
    NoVertex {
        /// The number of the mesh.
        mesh: usize,
        /// The number of the triangle in the mesh.
        triangle: usize,
        /// The index that is the triangle's corner.
        vertex: u32,
        /// The number of the mesh's vertices.
        vertices: usize,
    },
    /// A vertex lies at infinity, or further out than [`SceneBuilder::MAX_COORDINATE_M`].
    #[error(
        "a vertex lies at ({:e}, {:e}, {:e}) m, further than {:e} m from the middle",
        position.x, position.y, position.z,
        SceneBuilder::MAX_COORDINATE_M
    )]
    TooFar {
        /// Index into [`SceneBuilder::instances`].
        instance: usize,
        /// The vertex's position.
        position: DVec3,
    },
}

impl SourceInstance {
    /// Whether the mesh moves, hides or bends at this place.
    pub(super) fn changes(&self) -> bool {
        self.motion.is_some() || self.deformer.is_some()
    }
}

impl SceneBuilder {
    /// The largest coordinate, in the scene's space and in each mesh's own. The product of three such coordinates does not
    /// overflow f64, and the product of two (an area, which the BVH's builder compares) does not overflow f32.
    pub const MAX_COORDINATE_M: f64 = 1e12;

    /// Checks that a position is within [`SceneBuilder::MAX_COORDINATE_M`].
    pub(super) fn check_reach(position: DVec3, instance: usize) -> Result<(), SceneBuildError> {
        // The comparison is false for NaN.
        let in_reach = |c: f64| c.abs() <= Self::MAX_COORDINATE_M;
        if in_reach(position.x) && in_reach(position.y) && in_reach(position.z) {
            Ok(())
        } else {
            Err(SceneBuildError::TooFar { instance, position })
        }
    }
}
