//! The flat triangle that a return comes from, as the axis of its pulse meets it.

use glam::{DMat3, DVec3};

use crate::scene::{Placement, Scene};
use crate::sensor::{Capture, Pulse};

/// A triangle with the axis of a pulse, both in the space of the triangle's mesh. Lengths along the axis count in metres of the world
/// there, too, because an affine map keeps them.
pub(super) struct Facet {
    /// The corners.
    pub corners: [DVec3; 3],
    /// The point from which the light leaves.
    pub origin: DVec3,
    /// The direction of the pulse.
    pub direction: DVec3,
    /// The linear part of the map from the sensor's frame at the pulse's own time to the mesh's space.
    mesh_from_sensor: DMat3,
}

impl Facet {
    /// The triangle of this number in a placement's mesh, at the pulse's own time. `None` if the placement is hidden then.
    pub fn of(
        scene: &Scene,
        placement: u32,
        triangle: u32,
        capture: &Capture,
        pulse: &Pulse,
    ) -> Option<Self> {
        let placement = &scene.arrangement.placements[placement as usize];
        let mesh_from_scene = placement.mesh_from_scene_at(capture.cast_at_s(pulse.time_s))?;
        let world_from_sensor = capture.world_from_sensor(pulse.time_s);
        let origin = world_from_sensor.point(pulse.origin) - scene.geometry.centre;
        let mesh = scene.mesh(placement.mesh);
        let corners = mesh.triangles[triangle as usize]
            .map(|vertex| DVec3::from_array(mesh.positions[vertex as usize].map(f64::from)));
        Some(Self {
            corners,
            origin: mesh_from_scene.transform_point3(origin),
            direction: mesh_from_scene.transform_vector3(world_from_sensor.direction(pulse.direction)),
            mesh_from_sensor: mesh_from_scene.matrix3 * world_from_sensor.rotation,
        })
    }

    /// A normal of any length, in the mesh's space.
    fn normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    /// The length in metres from the pulse's origin along its axis to the triangle's plane. It is not finite if the axis lies in the
    /// plane or beside it.
    pub fn along_m(&self) -> f64 {
        let normal = self.normal();
        normal.dot(self.corners[0] - self.origin) / normal.dot(self.direction)
    }

    /// The point at a length along the axis, in the mesh's space.
    pub fn point(&self, along_m: f64) -> DVec3 {
        self.origin + self.direction * along_m
    }

    /// The unit normal in the sensor's frame at the pulse's own time, on either side of the triangle. Normals go by the transpose of
    /// the inverse map: n·x is the same in both spaces. `None` if the triangle has no area.
    pub fn normal_in_sensor(&self) -> Option<DVec3> {
        (self.mesh_from_sensor.transpose() * self.normal()).try_normalize()
    }
}

/// The placement of the triangle with this id, and its number in the placement's mesh. Of the shapes that a mesh has one after the
/// other it is that of the time, or any if the mesh is hidden then: a sensor may have seen it at another time of its exposure.
pub(super) fn placement_of(scene: &Scene, triangle: u32, time_s: f64) -> Option<(u32, u32)> {
    let placements = &scene.arrangement.placements;
    let end = placements.partition_point(|placement| placement.first_triangle <= triangle);
    let first_triangle = placements[..end].last()?.first_triangle;
    let local = triangle - first_triangle;
    let has_it = |placement: &Placement| (local as usize) < scene.mesh(placement.mesh).triangles.len();
    let candidates =
        || (0..end).rev().take_while(|&number| placements[number].first_triangle == first_triangle);
    let of_time = |&number: &usize| placements[number].mesh_from_scene_at(time_s).is_some();
    let found = candidates().filter(|&number| has_it(&placements[number]));
    let number = found.clone().find(of_time).or_else(|| found.clone().next())?;
    Some((number as u32, local))
}
