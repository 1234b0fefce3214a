//! How the points that a frame has returns of move: their velocities, and where they are when the next frame starts.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::scan::Frame;
use crate::scene::{Mover, Scene};
use crate::sensor::Capture;

/// The motion of the point of a surface that a pulse met, over the ground: along the world's axes, and without the motion of
/// the sensor. A surface that does not move has zeros.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceMotion {
    /// The velocity of the material point when the pulse meets it, in metres a second.
    pub velocity_m_s: DVec3,
    /// The displacement of the material point from there to where it is at the frame's end
    /// ([`Capture::duration_s`]), in metres.
    pub flow_m: DVec3,
}

/// Half of the time over which the velocity of a mesh that bends is measured: short against the motion of limbs, and long enough
/// for vertices of 32 bits, whose rounding (6·10⁻⁸ of a metre) it divides.
const HALF_STEP_S: f64 = 0.0005;

/// The motion of each return's surface point, by the slot of the return. Slots without a return have zeros. `scene` is the scene
/// that was cast, as it was arranged for the frame.
pub fn surface_motions(scene: &Scene, capture: &Capture, frame: &Frame) -> Vec<SurfaceMotion> {
    let mut motions = vec![SurfaceMotion::default(); frame.returns().range_m.len()];
    if scene.geometry.movers.is_empty() {
        return motions;
    }
    let end_s = capture.start_s + capture.duration_s();
    let window = capture.window();
    let middle_s = window.from_s / 2.0 + window.to_s / 2.0;
    let mut bending = BTreeMap::new();
    for pixel in 0..frame.pixels() {
        for slot in frame.slots(pixel) {
            let triangle = frame.returns().triangle[slot];
            let Some(mover) = mover_of(scene, triangle) else { continue };
            let (row, column) = (pixel / frame.columns(), pixel % frame.columns());
            let Some(pulse) = capture.pulse(row, column) else { continue };
            let time_s = capture.cast_at_s(pulse.time_s);
            let in_sensor = pulse.point(frame.returns().range_m[slot]);
            let point = capture.world_from_sensor(pulse.time_s).point(in_sensor);
            let map = mover.motion.map_at(time_s);
            let in_mesh = map.inverse().transform_point3(point);
            let (mut velocity_m_s, mut later) = (mover.motion.velocity(time_s, in_mesh), in_mesh);
            if mover.deformer.is_some() {
                let triangle = (triangle - mover.first_triangle) as usize;
                let bent = Bent::of(scene, mover, (time_s, middle_s, end_s), &mut bending);
                if let Some((rate, at_end)) = bent.and_then(|bent| bent.motion_of(triangle, in_mesh)) {
                    velocity_m_s += map.transform_vector3(rate);
                    later = at_end;
                }
            }
            let flow_m = mover.motion.map_at(end_s).transform_point3(later) - point;
            motions[slot] = SurfaceMotion { velocity_m_s, flow_m };
        }
    }
    motions
}

/// What moves the triangle with this id.
fn mover_of(scene: &Scene, triangle: u32) -> Option<&Mover> {
    let movers = &scene.geometry.movers;
    let after = movers.partition_point(|mover| mover.first_triangle <= triangle);
    let mover = movers.get(after.checked_sub(1)?)?;
    let count = scene.geometry.meshes[mover.mesh as usize].triangles.len();
    ((triangle - mover.first_triangle) as usize).lt(&count).then_some(mover)
}

/// The shape with which a mesh that bends was cast, and the same vertices a moment before and after and at the frame's end.
struct Bent<'s> {
    triangles: &'s [[u32; 3]],
    cast: &'s [[f32; 3]],
    before: Vec<[f32; 3]>,
    after: Vec<[f32; 3]>,
    end: Vec<[f32; 3]>,
}

impl<'s> Bent<'s> {
    /// The shapes for a pulse at a time, given the times of the frame's middle and its end. Pulses that met the same shape share
    /// them.
    fn of<'b>(
        scene: &'s Scene,
        mover: &Mover,
        (time_s, middle_s, end_s): (f64, f64, f64),
        known: &'b mut BTreeMap<u32, Option<Bent<'s>>>,
    ) -> Option<&'b Self> {
        let placements = &scene.arrangement.placements;
        let first = placements.partition_point(|p| p.first_triangle < mover.first_triangle);
        let of_mover = placements[first..].iter().take_while(|p| p.first_triangle == mover.first_triangle);
        let placement = of_mover
            .filter(|p| p.first_object == mover.object && p.mesh >= scene.geometry.regions)
            .find(|p| p.scene_from_mesh_at(time_s).is_some())?;
        let mesh = scene.mesh(placement.mesh);
        let shapes = known.entry(placement.mesh).or_insert_with(|| {
            let middle_s = scene.shape_time_s(placement).unwrap_or(middle_s);
            let [before, after, end] =
                [middle_s - HALF_STEP_S, middle_s + HALF_STEP_S, end_s].map(|time_s| mover.shape_at(time_s));
            Some(Bent {
                triangles: &mesh.triangles,
                cast: &mesh.positions,
                before: before?,
                after: after?,
                end: end?,
            })
        });
        shapes.as_ref()
    }

    /// The velocity in the mesh's space of a point of a triangle, and where it is at the frame's end: by the weights that the
    /// triangle's corners have at the point.
    fn motion_of(&self, triangle: usize, point: DVec3) -> Option<(DVec3, DVec3)> {
        let corners = *self.triangles.get(triangle)?;
        let of_shape = |shape: &[[f32; 3]]| {
            corners.map(|vertex| DVec3::from_array(shape[vertex as usize].map(f64::from)))
        };
        let weights = weights(of_shape(self.cast), point)?;
        let at = |shape: &[[f32; 3]]| {
            let [a, b, c] = of_shape(shape);
            a * weights[0] + b * weights[1] + c * weights[2]
        };
        Some(((at(&self.after) - at(&self.before)) / (2.0 * HALF_STEP_S), at(&self.end)))
    }
}

/// The barycentric weights of a point in the plane of a triangle. `None` if the triangle has no area.
pub(super) fn weights([a, b, c]: [DVec3; 3], point: DVec3) -> Option<[f64; 3]> {
    let normal = (b - a).cross(c - a);
    let squared = normal.length_squared();
    if squared <= 0.0 {
        return None;
    }
    let of = |p: DVec3, q: DVec3| (p - point).cross(q - point).dot(normal) / squared;
    let (first, second) = (of(b, c), of(c, a));
    Some([first, second, 1.0 - first - second])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_put_a_point_together_again() {
        let corners = [DVec3::new(1.0, 0.0, 2.0), DVec3::new(4.0, 1.0, 2.5), DVec3::new(0.0, 3.0, -1.0)];
        for expected in [[0.2, 0.3, 0.5], [1.0, 0.0, 0.0], [0.0, 0.5, 0.5]] {
            let point = corners[0] * expected[0] + corners[1] * expected[1] + corners[2] * expected[2];
            let found = weights(corners, point).unwrap();
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-14), "{found:?}");
        }
        assert_eq!(weights([DVec3::ONE; 3], DVec3::ONE), None);
    }
}
