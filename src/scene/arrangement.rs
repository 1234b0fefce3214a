//! The half of a scene that time changes, which says where its meshes are; and the scene, which is a geometry so arranged.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::geometry::{Geometry, Part};

/// A geometry, arranged: ready to be traced, and cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Everything that no time changes.
    pub geometry: Arc<Geometry>,
    /// Where the meshes are.
    pub arrangement: Arc<Arrangement>,
}

/// The object and the material that a triangle belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Index into [`Geometry::objects`].
    pub object: u32,
    /// Index into [`Geometry::materials`].
    pub material: u32,
}

/// Where the meshes of a [`Geometry`] are at one time: the value of an animation at that time. Meshes that are nowhere at
/// that time have no placement.
#[derive(Clone, Debug, Default)]
pub struct Arrangement {
    /// The first placements are the [regions](Geometry::regions), in order, which do not move: placement 0 is mesh 0 as it
    /// stands. The ids of triangles rise from placement to placement.
    pub placements: Vec<Placement>,
}

/// A mesh at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Index into [`Geometry::meshes`](Geometry::meshes).
    pub mesh: u32,
    /// The id of the mesh's first triangle at this placement.
    pub first_triangle: u32,
    /// The id of the object of the mesh's part with `object` 0 at this placement.
    pub first_object: u32,
    scene_from_mesh: DAffine3,
    mesh_from_scene: DAffine3,
}

impl Scene {
    /// The same geometry, arranged otherwise.
    ///
    /// # Panics
    /// If the arrangement is not one of this geometry: it does not begin with the placements of the regions as they are, or a
    /// mesh or an object does not exist, or the ids of triangles do not rise from placement to placement.
    pub fn rearranged(&self, arrangement: Arc<Arrangement>) -> Self {
        let placements = &arrangement.placements;
        let regions = self.geometry.regions as usize;
        let fixed = &self.arrangement.placements[..regions];
        assert_eq!(placements.get(..regions), Some(fixed), "the regions stay where they are");
        let mut next_triangle = 0_u64;
        for (index, placement) in placements.iter().enumerate() {
            let mesh = self.geometry.meshes.get(placement.mesh as usize);
            let mesh = mesh.unwrap_or_else(|| panic!("placement {index} is of a mesh that does not exist"));
            let objects =
                mesh.parts.iter().map(|part| placement.first_object as usize + part.object as usize);
            assert!(objects.max() < Some(self.geometry.objects.len()), "placement {index} has no object");
            assert!(
                u64::from(placement.first_triangle) >= next_triangle,
                "the ids of placement {index} do not rise"
            );
            next_triangle = u64::from(placement.first_triangle) + mesh.triangles.len() as u64;
        }
        Self { geometry: self.geometry.clone(), arrangement }
    }

    /// The number of triangles, each counted as often as it is placed: one more than the largest triangle id.
    pub fn triangle_count(&self) -> u64 {
        let meshes = self.arrangement.placements.iter().map(|p| &self.geometry.meshes[p.mesh as usize]);
        meshes.map(|mesh| mesh.triangles.len() as u64).sum()
    }

    /// The surface that triangle `triangle` of the mesh at placement `placement` is part of.
    pub fn surface(&self, placement: u32, triangle: u32) -> Surface {
        let placement = &self.arrangement.placements[placement as usize];
        let parts = &self.geometry.meshes[placement.mesh as usize].parts;
        let part = parts[parts.partition_point(|p| p.first_triangle <= triangle) - 1];
        placement.surface(&part)
    }

    /// The triangles whose surface is meant: for each run of them the placement, and their range in its mesh.
    pub fn triangles_of(&self, is_meant: impl Fn(Surface) -> bool) -> Vec<(&Placement, Range<usize>)> {
        let mut found = Vec::new();
        for placement in &self.arrangement.placements {
            let mesh = &self.geometry.meshes[placement.mesh as usize];
            let ends = mesh.parts.iter().skip(1).map(|next| next.first_triangle as usize);
            for (part, end) in mesh.parts.iter().zip(ends.chain([mesh.triangles.len()])) {
                if is_meant(placement.surface(part)) {
                    found.push((placement, part.first_triangle as usize..end));
                }
            }
        }
        found
    }

    /// The semantic label of a surface: the job's label of the object, else the job's label of the material, else the
    /// file's label of the object, else 0.
    pub fn label(&self, surface: Surface) -> u32 {
        let object = &self.geometry.objects[surface.object as usize];
        let material = &self.geometry.materials[surface.material as usize];
        object.job_label.or(material.job_label).or(object.file_label).unwrap_or(0)
    }

    /// Every label that a surface has, in ascending order.
    pub fn labels(&self) -> Vec<u32> {
        let Geometry { meshes, objects, .. } = &*self.geometry;
        let is_one_object: Vec<bool> =
            meshes.iter().map(|mesh| mesh.parts.iter().all(|part| part.object == 0)).collect();
        let (mut labels, mut seen) = (BTreeSet::new(), BTreeSet::new());
        for placement in &self.arrangement.placements {
            let mesh = placement.mesh as usize;
            // A mesh of many parts may be placed very often, and nearly always with the same labels.
            if let Some(object) = objects.get(placement.first_object as usize)
                && is_one_object[mesh]
                && !seen.insert((mesh, object.job_label, object.file_label))
            {
                continue;
            }
            labels.extend(meshes[mesh].parts.iter().map(|part| self.label(placement.surface(part))));
        }
        labels.into_iter().collect()
    }
}

impl Placement {
    /// The surface of a part of the mesh.
    fn surface(&self, part: &Part) -> Surface {
        Surface { object: self.first_object + part.object, material: part.material }
    }

    /// Mesh 0 as it stands, in the scene's space: placement 0 of every arrangement. (The placements of other regions are made by
    /// the [`SceneBuilder`](super::SceneBuilder).)
    pub const FIXED: Self = Self {
        mesh: 0,
        first_triangle: 0,
        first_object: 0,
        scene_from_mesh: DAffine3::IDENTITY,
        mesh_from_scene: DAffine3::IDENTITY,
    };

    pub(super) fn new(mesh: u32, first_triangle: u32, first_object: u32, scene_from_mesh: DAffine3) -> Self {
        let mesh_from_scene = scene_from_mesh.inverse();
        Self { mesh, first_triangle, first_object, scene_from_mesh, mesh_from_scene }
    }

    /// The same mesh, with the same ids, at another place. `None` if rays cannot be carried into the mesh's space with
    /// their precision: the map must have a finite inverse, and be no more skewed than a condition number of 2¹² allows.
    pub fn at(&self, scene_from_mesh: DAffine3) -> Option<Self> {
        is_invertible(&scene_from_mesh)
            .then(|| Self::new(self.mesh, self.first_triangle, self.first_object, scene_from_mesh))
    }

    /// The map from the mesh's space to the scene's: the identity for placement 0.
    #[inline]
    pub fn scene_from_mesh(&self) -> &DAffine3 {
        &self.scene_from_mesh
    }

    /// The inverse of [`Placement::scene_from_mesh`].
    #[inline]
    pub fn mesh_from_scene(&self) -> &DAffine3 {
        &self.mesh_from_scene
    }
}

/// Whether rays can be carried into the mesh's space and keep their precision: the condition number of the linear part
/// (in the largest-row-sum norm) is at most 2¹², which holds for every map that does not crush the mesh almost flat.
pub(super) fn is_invertible(map: &DAffine3) -> bool {
    let norm = |m: DMat3| (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
    norm(map.matrix3) * norm(map.matrix3.inverse()) <= 4096.0 && map.inverse().is_finite()
}

/// Whether the map leaves no triangle an area: it scales by zero along two axes or all three.
pub(super) fn crushes_to_a_line(map: &DAffine3) -> bool {
    let [x, y, z] = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis];
    [x.cross(y), y.cross(z), z.cross(x)] == [DVec3::ZERO; 3]
}
