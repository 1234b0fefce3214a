//! The half of a scene that time changes, which says where its meshes are; and the scene, which is a geometry so arranged.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::bounds::Bounds;
use super::environment::Environment;
use super::geometry::{Geometry, Mesh, Part};
use super::moving::{Moving, inverted};
use super::optics::Optics;
use crate::motion::Window;

/// A geometry, arranged: ready to be traced, and cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Everything that no time changes.
    pub geometry: Arc<Geometry>,
    /// Where the meshes are.
    pub arrangement: Arc<Arrangement>,
    /// The air and the sun.
    pub environment: Environment,
}

/// The object and the material that a triangle belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Index into [`Geometry::objects`].
    pub object: u32,
    /// Index into [`Geometry::materials`].
    pub material: u32,
}

/// Where the meshes of a [`Geometry`] are at one time or during a frame. Meshes that are nowhere then have no placement.
#[derive(Clone, Debug, Default)]
pub struct Arrangement {
    /// The first placements are the [regions](Geometry::regions), in order, which do not move: placement 0 is mesh 0 as it
    /// stands. The ids of triangles rise from placement to placement. Only the shapes that a mesh has one after the other have
    /// the same ids.
    pub placements: Vec<Placement>,
    /// The shapes of meshes that bend. Their indices follow those of [`Geometry::meshes`]: see [`Scene::mesh`].
    pub shapes: Vec<Mesh>,
    /// The times for which the arrangement holds, if a placement moves: rays need times in this window then.
    pub window: Option<Window>,
}

/// A mesh at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// The number of the mesh in [`Scene::mesh`].
    pub mesh: u32,
    /// The id of the mesh's first triangle at this placement.
    pub first_triangle: u32,
    /// The id of the object of the mesh's part with `object` 0 at this placement.
    pub first_object: u32,
    pub(super) scene_from_mesh: DAffine3,
    pub(super) mesh_from_scene: DAffine3,
    pub(super) moving: Option<Arc<Moving>>,
}

impl Scene {
    /// A mesh by its number: one of [`Geometry::meshes`], or after these one of [`Arrangement::shapes`].
    #[inline]
    pub fn mesh(&self, number: u32) -> &Mesh {
        let meshes = &self.geometry.meshes;
        let number = number as usize;
        meshes.get(number).unwrap_or_else(|| &self.arrangement.shapes[number - meshes.len()])
    }

    /// The same geometry, arranged otherwise.
    ///
    /// # Panics
    /// If the arrangement is not one of this geometry: it does not begin with the placements of the regions as they are, or a
    /// mesh or an object does not exist, or the ids of triangles do not rise from placement to placement (but for the shapes that
    /// a mesh has one after the other), or a placement moves and the arrangement has no window.
    pub fn rearranged(&self, arrangement: Arc<Arrangement>) -> Self {
        let placements = &arrangement.placements;
        let regions = self.geometry.regions as usize;
        let fixed = &self.arrangement.placements[..regions];
        assert_eq!(placements.get(..regions), Some(fixed), "the regions stay where they are");
        let mut next_triangle = 0_u64;
        let meshes = self.geometry.meshes.iter().chain(&arrangement.shapes).collect::<Vec<_>>();
        for (index, placement) in placements.iter().enumerate() {
            assert!(
                !placement.is_moving() || arrangement.window.is_some(),
                "placement {index} moves without a time"
            );
            let mesh = meshes.get(placement.mesh as usize);
            let mesh = mesh.unwrap_or_else(|| panic!("placement {index} is of a mesh that does not exist"));
            let objects =
                mesh.parts.iter().map(|part| placement.first_object as usize + part.object as usize);
            assert!(objects.max() < Some(self.geometry.objects.len()), "placement {index} has no object");
            let is_next_shape = index > 0 && placement.follows(&placements[index - 1]);
            assert!(
                u64::from(placement.first_triangle) >= next_triangle || is_next_shape,
                "the ids of placement {index} do not rise"
            );
            next_triangle = u64::from(placement.first_triangle) + mesh.triangles.len() as u64;
        }
        Self { geometry: self.geometry.clone(), arrangement, environment: self.environment }
    }

    /// The number of triangles, each counted as often as it is placed: one more than the largest triangle id. What is hidden at
    /// times counts.
    pub fn triangle_count(&self) -> u64 {
        u64::from(self.geometry.triangle_ids)
    }

    /// The surface that triangle `triangle` of the mesh at placement `placement` is part of.
    pub fn surface(&self, placement: u32, triangle: u32) -> Surface {
        let placement = &self.arrangement.placements[placement as usize];
        let parts = &self.mesh(placement.mesh).parts;
        let part = parts[parts.partition_point(|p| p.first_triangle <= triangle) - 1];
        part.surface(placement.first_object)
    }

    /// The triangles whose surface is meant: for each run of them the placement, and their range in its mesh.
    pub fn triangles_of(&self, mut is_meant: impl FnMut(Surface) -> bool) -> Vec<(&Placement, Range<usize>)> {
        let mut found = Vec::new();
        for placement in &self.arrangement.placements {
            let mesh = self.mesh(placement.mesh);
            let ends = mesh.parts.iter().skip(1).map(|next| next.first_triangle as usize);
            for (part, end) in mesh.parts.iter().zip(ends.chain([mesh.triangles.len()])) {
                if is_meant(part.surface(placement.first_object)) {
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

    /// How a surface sends light back, as the job says it of its object, else of its material, else of its label.
    pub fn optics(&self, surface: Surface) -> Option<&Optics> {
        let Geometry { objects, materials, optics, optics_of_labels, .. } = &*self.geometry;
        if optics.is_empty() {
            return None;
        }
        let of_object = objects.get(surface.object as usize).and_then(|object| object.optics);
        let of_material = || materials.get(surface.material as usize).and_then(|material| material.optics);
        let of_label = || optics_of_labels.get(&self.label(surface)).copied();
        let index = of_object.or_else(of_material).or_else(of_label)?;
        optics.get(index as usize)
    }

    /// Every label that a surface has, in ascending order. What is hidden now counts.
    pub fn labels(&self) -> Vec<u32> {
        let Geometry { objects, movers, .. } = &*self.geometry;
        let placed = self.arrangement.placements.iter().map(|p| (p.mesh, p.first_object));
        let moved = movers.iter().map(|mover| (mover.mesh, mover.object));
        let mut is_one_object = BTreeMap::new();
        let (mut labels, mut seen) = (BTreeSet::new(), BTreeSet::new());
        for (mesh, first_object) in placed.chain(moved) {
            let parts = &self.mesh(mesh).parts;
            let is_one_object =
                *is_one_object.entry(mesh).or_insert_with(|| parts.iter().all(|part| part.object == 0));
            // A mesh of many parts may be placed very often, and nearly always with the same labels.
            if let Some(object) = objects.get(first_object as usize)
                && is_one_object
                && !seen.insert((mesh, object.job_label, object.file_label))
            {
                continue;
            }
            labels.extend(parts.iter().map(|part| self.label(part.surface(first_object))));
        }
        labels.into_iter().collect()
    }
}

impl Part {
    /// The surface of the part at a placement whose object is given.
    fn surface(&self, first_object: u32) -> Surface {
        Surface { object: first_object + self.object, material: self.material }
    }
}

impl Placement {
    /// Mesh 0 as it stands, in the scene's space: placement 0 of every arrangement. (The placements of other regions are made by
    /// the [`SceneBuilder`](super::SceneBuilder).)
    pub const FIXED: Self = Self {
        mesh: 0,
        first_triangle: 0,
        first_object: 0,
        scene_from_mesh: DAffine3::IDENTITY,
        mesh_from_scene: DAffine3::IDENTITY,
        moving: None,
    };

    pub(super) fn new(mesh: u32, first_triangle: u32, first_object: u32, scene_from_mesh: DAffine3) -> Self {
        let mesh_from_scene = scene_from_mesh.inverse();
        Self { mesh, first_triangle, first_object, scene_from_mesh, mesh_from_scene, moving: None }
    }

    /// The same mesh, with the same ids, at another place. `None` if rays cannot be carried into the mesh's space with
    /// their precision: the map must have a finite inverse, and be no more skewed than a condition number of 2¹² allows.
    pub fn at(&self, scene_from_mesh: DAffine3) -> Option<Self> {
        is_invertible(&scene_from_mesh)
            .then(|| Self::new(self.mesh, self.first_triangle, self.first_object, scene_from_mesh))
    }

    /// The map from the mesh's space to the scene's: the identity for placement 0. Of a placement that moves it is the map at one
    /// time of the frame.
    #[inline]
    pub fn scene_from_mesh(&self) -> &DAffine3 {
        &self.scene_from_mesh
    }

    /// The inverse of [`Placement::scene_from_mesh`].
    #[inline]
    pub fn mesh_from_scene(&self) -> &DAffine3 {
        &self.mesh_from_scene
    }

    /// Whether the map depends on time.
    #[inline]
    pub fn is_moving(&self) -> bool {
        self.moving.is_some()
    }

    /// [`Placement::scene_from_mesh`] at a time of the frame. `None` if no ray of that time meets the mesh: it is hidden, it has
    /// another shape, it reaches farther than [`SceneBuilder::MAX_COORDINATE_M`](super::SceneBuilder::MAX_COORDINATE_M), or the map
    /// has no precise inverse (see [`Placement::at`]).
    pub fn scene_from_mesh_at(&self, time_s: f64) -> Option<DAffine3> {
        match &self.moving {
            None => Some(self.scene_from_mesh),
            Some(moving) => Some(moving.maps_at(time_s)?.0),
        }
    }

    /// The inverse of [`Placement::scene_from_mesh_at`].
    #[inline]
    pub fn mesh_from_scene_at(&self, time_s: f64) -> Option<DAffine3> {
        match &self.moving {
            None => Some(self.mesh_from_scene),
            Some(moving) => Some(moving.maps_at(time_s)?.1),
        }
    }

    /// Whether this is the next shape of the mesh whose earlier shape is `before`: their times do not overlap.
    fn follows(&self, before: &Self) -> bool {
        let of_one = |p: &Self| (p.first_triangle, p.first_object);
        let (Some(moving), Some(earlier)) = (&self.moving, &before.moving) else { return false };
        of_one(self) == of_one(before) && earlier.is_before(moving)
    }

    /// The bounds in the scene's space of a box in the mesh's, over all times of the frame if the placement moves.
    pub(crate) fn bounds_of(&self, own: &Bounds, window: Option<Window>) -> Bounds {
        match (&self.moving, window) {
            (Some(moving), Some(window)) => moving.bounds(own, window),
            _ => own
                .corners()
                .map(|p| self.scene_from_mesh.transform_point3(p))
                .fold(Bounds::EMPTY, Bounds::with),
        }
    }
}

/// Whether a map has an [inverse](inverted) that rays can be carried by.
pub(super) fn is_invertible(map: &DAffine3) -> bool {
    inverted(map).is_some()
}

/// Whether the map leaves no triangle an area: it scales by zero along two axes or all three.
pub(super) fn crushes_to_a_line(map: &DAffine3) -> bool {
    let [x, y, z] = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis];
    [x.cross(y), y.cross(z), z.cross(x)] == [DVec3::ZERO; 3]
}
