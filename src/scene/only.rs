//! A part of a scene: some of its objects, hit as they are in the whole.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use super::arrangement::{Arrangement, Placement, Scene, Surface};
use super::corners::MeshCorners;
use super::geometry::{Geometry, Mesh, Part};
use super::mover::Mover;

impl Scene {
    /// The scene without the triangles of objects that are not meant. The others are where they were, to the last bit, and move as
    /// they did, so a ray that meets nothing else meets them at the same depth. Objects and materials keep their ids; triangles of
    /// meshes that are placed once do not.
    pub fn only(&self, is_meant: impl Fn(u32) -> bool) -> Self {
        let Geometry { regions, movers, .. } = &*self.geometry;
        let (fixed, placed) = self.arrangement.placements.split_at(*regions as usize);
        let mut meshes: Vec<Mesh> = fixed
            .iter()
            .map(|placement| {
                let mesh = &self.geometry.meshes[placement.mesh as usize];
                part_of(mesh, |part| is_meant(placement.first_object + part.object))
            })
            .collect();
        let mut numbers = BTreeMap::new();
        let mut kept = |mesh: u32| -> u32 {
            *numbers.entry(mesh).or_insert_with(|| {
                meshes.push(self.geometry.meshes[mesh as usize].clone());
                (meshes.len() - 1) as u32
            })
        };
        let of_movers: Vec<Mover> = movers
            .iter()
            .filter(|mover| is_meant(mover.object))
            .map(|mover| Mover { mesh: kept(mover.mesh), ..mover.clone() })
            .collect();
        // What moves is placed anew for each frame; until then it is where it was, but for shapes of a frame.
        let is_shape = |placement: &Placement| placement.mesh as usize >= self.geometry.meshes.len();
        let of_placed: Vec<Placement> = placed
            .iter()
            .filter(|placement| is_meant(placement.first_object) && !is_shape(placement))
            .map(|placement| Placement { mesh: kept(placement.mesh), ..placement.clone() })
            .collect();
        let geometry = Geometry {
            meshes,
            movers: of_movers,
            centre: self.geometry.centre,
            regions: *regions,
            origin_step_m: self.geometry.origin_step_m,
            rounding: self.geometry.rounding,
            objects: self.geometry.objects.clone(),
            materials: self.geometry.materials.clone(),
            optics: self.geometry.optics.clone(),
            optics_of_labels: self.geometry.optics_of_labels.clone(),
            triangle_ids: self.geometry.triangle_ids,
            ..Geometry::default()
        };
        let placements = fixed.iter().cloned().chain(of_placed).collect();
        let arrangement = Arrangement { placements, ..Arrangement::default() };
        Self {
            geometry: Arc::new(geometry),
            arrangement: Arc::new(arrangement),
            environment: self.environment,
        }
    }

    /// The corners in the world of all triangles of an object, where the scene has it.
    pub fn corners_of(&self, object: u32) -> Vec<DVec3> {
        let runs = self.triangles_of(|surface| surface.object == object);
        runs.into_iter().flat_map(|(placement, triangles)| self.corners_at(placement, triangles)).collect()
    }

    /// The corners of [`Scene::corners_of`] for each object that has triangles, by its id. The corners of one object are in memory
    /// at a time.
    pub fn corners_by_object(&self) -> impl Iterator<Item = (u32, Vec<DVec3>)> {
        let mut runs = Vec::new();
        for placement in &self.arrangement.placements {
            let mesh = self.mesh(placement.mesh);
            let ends = mesh.parts.iter().skip(1).map(|next| next.first_triangle as usize);
            for (part, end) in mesh.parts.iter().zip(ends.chain([mesh.triangles.len()])) {
                let triangles = part.first_triangle as usize..end;
                runs.push((placement.first_object + part.object, placement, triangles));
            }
        }
        runs.sort_by_key(|(object, ..)| *object);
        let mut runs = runs.into_iter().peekable();
        std::iter::from_fn(move || {
            let (object, placement, triangles) = runs.next()?;
            let mut corners = self.corners_at(placement, triangles);
            while let Some((_, placement, triangles)) = runs.next_if(|(next, ..)| *next == object) {
                corners.extend(self.corners_at(placement, triangles));
            }
            Some((object, corners))
        })
    }

    fn corners_at(&self, placement: &Placement, triangles: Range<usize>) -> Vec<DVec3> {
        triangles.flat_map(|triangle| self.triangle_at(placement, triangle)).collect()
    }

    /// The corners in the world, in metres, of a triangle of the mesh at a placement, where the scene has it.
    pub fn triangle_at(&self, placement: &Placement, triangle: usize) -> [DVec3; 3] {
        let mesh = self.mesh(placement.mesh);
        mesh.triangles[triangle].map(|vertex| {
            let position = DVec3::from_array(mesh.positions[vertex as usize].map(f64::from));
            placement.scene_from_mesh().transform_point3(position) + self.geometry.centre
        })
    }

    /// The time whose shape a mesh that bends has at a placement of a frame's arrangement: the middle of its slice.
    pub fn shape_time_s(&self, placement: &Placement) -> Option<f64> {
        Some(placement.moving.as_ref()?.middle_s(self.arrangement.window?))
    }

    /// The label of each object, by its id: of the first of its surfaces that has one besides 0.
    pub fn labels_of_objects(&self) -> Vec<u32> {
        let mut labels = vec![0; self.geometry.objects.len()];
        let placed = self.arrangement.placements.iter().map(|p| (p.mesh, p.first_object));
        let moved = self.geometry.movers.iter().map(|mover| (mover.mesh, mover.object));
        for (mesh, first_object) in placed.chain(moved) {
            for part in &self.mesh(mesh).parts {
                let object = first_object + part.object;
                let known = &mut labels[object as usize];
                if *known == 0 {
                    *known = self.label(Surface { object, material: part.material });
                }
            }
        }
        labels
    }
}

impl Mover {
    /// The positions of the mesh's vertices in the world at a time. `None` while it is hidden or has no shape.
    pub fn positions_at(&self, geometry: &Geometry, time_s: f64) -> Option<Vec<DVec3>> {
        let world_from_mesh = self.motion.at(time_s)?;
        let in_world = |p: &[f32; 3]| world_from_mesh.transform_point3(DVec3::from_array(p.map(f64::from)));
        match &self.deformer {
            None => Some(geometry.meshes[self.mesh as usize].positions.iter().map(in_world).collect()),
            Some(_) => Some(self.shape_at(time_s)?.iter().map(in_world).collect()),
        }
    }

    /// The positions of the stored mesh's vertices in the mesh's own space at a time, if the mesh bends and has a shape then.
    pub fn shape_at(&self, time_s: f64) -> Option<Vec<[f32; 3]>> {
        let all = self.deformer.as_ref()?.shape_at(time_s)?;
        self.vertices.iter().map(|&vertex| all.get(vertex as usize).copied()).collect()
    }
}

/// A mesh without the triangles of other parts, and without the vertices that are no longer used.
fn part_of(mesh: &Mesh, is_meant: impl Fn(&Part) -> bool) -> Mesh {
    let mut some = Mesh::default();
    let mut corners = MeshCorners::default();
    let mut numbers = BTreeMap::new();
    let ends = mesh.parts.iter().skip(1).map(|next| next.first_triangle as usize);
    for (part, end) in mesh.parts.iter().zip(ends.chain([mesh.triangles.len()])) {
        if !is_meant(part) {
            continue;
        }
        let first_triangle = some.triangles.len() as u32;
        for index in part.first_triangle as usize..end {
            let renumbered = mesh.triangles[index].map(|vertex| {
                *numbers.entry(vertex).or_insert_with(|| {
                    some.positions.push(mesh.positions[vertex as usize]);
                    (some.positions.len() - 1) as u32
                })
            });
            corners.push_of(some.triangles.len(), &mesh.corners, index);
            some.triangles.push(renumbered);
        }
        some.parts.push(Part { first_triangle, ..*part });
    }
    some.corners = Arc::new(corners);
    some
}
