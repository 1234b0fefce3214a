//! The vehicle that carries a rig, as far as the scene has it.

use glam::DVec3;

use super::expect::Target;
use crate::frame::Pose;
use crate::scene::Scene;

/// The surface of a vehicle in the body's frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vehicle {
    /// The corners of its triangles, in metres. Of very many, every second, third, … is kept.
    pub triangles: Vec<[[f32; 3]; 3]>,
}

/// Most triangles that are kept.
pub const MOST_TRIANGLES: usize = 20_000;

impl Vehicle {
    /// The vehicle that `body` names in a scene. `None` if nothing goes by that name.
    pub fn find(scene: &Scene, body: &Target, world_from_body: &Pose) -> Option<Self> {
        let runs = scene.triangles_of(|surface| {
            body.is_of(&scene.geometry.objects[surface.object as usize].name, scene.label(surface))
        });
        let count: usize = runs.iter().map(|(_, triangles)| triangles.len()).sum();
        let step = count.div_ceil(MOST_TRIANGLES).max(1);
        let body_from_world = world_from_body.inverse();
        let mut triangles = Vec::new();
        for (placement, run) in runs {
            let mesh = scene.mesh(placement.mesh);
            let corner = |vertex: u32| {
                let p = DVec3::from_array(mesh.positions[vertex as usize].map(f64::from));
                let in_world = placement.scene_from_mesh().transform_point3(p) + scene.geometry.centre;
                body_from_world.point(in_world).as_vec3().to_array()
            };
            triangles.extend(run.step_by(step).map(|triangle| mesh.triangles[triangle].map(corner)));
        }
        (count > 0).then_some(Self { triangles })
    }

    /// The outline seen from above: the convex hull of x and y, counter-clockwise.
    pub fn outline(&self) -> Vec<[f64; 2]> {
        let corners = self.triangles.iter().flatten();
        let mut points: Vec<[f64; 2]> = corners.map(|p| [f64::from(p[0]), f64::from(p[1])]).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        points.dedup();
        // The monotone chain (A. M. Andrew, 1979): the lower half from left to right, then the upper half back.
        let turns_left = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
        };
        let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
            let mut hull: Vec<[f64; 2]> = Vec::new();
            for point in points {
                while let [.., a, b] = hull[..]
                    && !turns_left(a, b, point)
                {
                    hull.pop();
                }
                hull.push(point);
            }
            hull.pop();
            hull
        };
        let mut hull = half(&mut points.iter().copied());
        hull.extend(half(&mut points.iter().rev().copied()));
        hull
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outline_is_the_hull_from_above() {
        let triangles = vec![
            [[-1.0, -0.5, 0.0], [2.0, 0.5, 1.5], [-1.0, 0.5, 2.0]],
            [[2.0, -0.5, 0.0], [-1.0, -0.5, 1.0], [0.0, 0.5, 0.0]],
            [[0.0, 0.0, 0.0], [0.5, 0.1, 3.0], [2.5, 0.0, 1.0]],
        ];
        let outline = Vehicle { triangles }.outline();
        assert_eq!(outline, [[-1.0, -0.5], [2.0, -0.5], [2.5, 0.0], [2.0, 0.5], [-1.0, 0.5]]);
        assert!(Vehicle::default().outline().is_empty());
        let flat = Vehicle { triangles: vec![[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 2.0]]] };
        assert!(flat.outline().len() <= 2);
    }
}
