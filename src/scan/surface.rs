//! What is known of the triangle that a ray hits.

use glam::DVec3;

use super::Return;
use crate::frame::Pose;
use crate::scene::{Appearance, Optics, Scene, Surface};
use crate::trace::Hit;

/// The values that all returns of one triangle share.
pub(super) struct SeenTriangle {
    placement: u32,
    triangle: u32,
    /// The triangle's id in the scene.
    id: u32,
    surface: Surface,
    label: u32,
    reflectivity: f64,
    /// Whether the reflectivity differs from point to point.
    varies: bool,
}

impl SeenTriangle {
    pub fn of(hit: &Hit, scene: &Scene) -> Self {
        let Hit { placement, triangle, .. } = *hit;
        let surface = scene.surface(placement, triangle);
        Self {
            placement,
            triangle,
            id: scene.arrangement.placements[placement as usize].first_triangle + triangle,
            surface,
            label: scene.label(surface),
            reflectivity: f64::from(scene.geometry.materials[surface.material as usize].reflectivity()),
            varies: scene.varies(placement, triangle),
        }
    }

    /// Whether a hit is of this triangle.
    #[inline(always)]
    pub fn is_of(&self, hit: &Hit) -> bool {
        (self.placement, self.triangle) == (hit.placement, hit.triangle)
    }

    /// The object and the material.
    pub fn surface(&self) -> Surface {
        self.surface
    }

    /// The semantic label.
    pub fn label(&self) -> u32 {
        self.label
    }

    /// The triangle's id in the scene.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// The return of a hit as an ideal receiver measures it from a Lambertian surface: its intensity is ρ·cos θ.
    #[inline(always)]
    pub fn receive(&self, sensor_from_world: &Pose, direction: DVec3, hit: &Hit, range_m: f64) -> Return {
        let along = hit.normal.dot(direction);
        let towards_sensor = if along > 0.0 { -hit.normal } else { hit.normal };
        let normal = sensor_from_world.direction(towards_sensor);
        Return {
            range_m,
            normal: normal.as_vec3().to_array(),
            intensity: (self.reflectivity * along.abs().min(1.0)) as f32,
            instance: self.surface.object,
            label: self.label,
            triangle: self.id,
        }
    }
    /// Whether the surface looks different from point to point.
    pub fn varies(&self) -> bool {
        self.varies
    }

    /// The intensity of a hit that has this share of the pulse, of a surface that may look different from point to point.
    pub fn intensity(&self, direction: DVec3, hit: &Hit, scene: &Scene, share: f64) -> f32 {
        let reflectivity = if self.varies {
            f64::from(scene.appearance(hit.placement, hit.triangle, hit.u, hit.v).reflectivity())
        } else {
            self.reflectivity
        };
        (share * reflectivity * hit.normal.dot(direction).abs().min(1.0)) as f32
    }
}

/// The triangle that was hit last. Neighbouring rays often hit the same one.
#[derive(Default)]
pub(super) struct LastSeen<'a>(Option<Known<'a>>);

struct Known<'a> {
    seen: SeenTriangle,
    optics: Option<&'a Optics>,
    /// The appearance, if it is the same all over the triangle.
    appearance: Option<Appearance>,
}

impl<'a> LastSeen<'a> {
    /// The triangle of a hit, what the job says of its optics, and how it looks where it is hit.
    #[inline]
    pub fn at(&mut self, scene: &'a Scene, hit: &Hit) -> (&SeenTriangle, Option<&'a Optics>, Appearance) {
        let look = || scene.appearance(hit.placement, hit.triangle, hit.u, hit.v);
        if !self.0.as_ref().is_some_and(|known| known.seen.is_of(hit)) {
            self.0 = None;
        }
        let known = self.0.get_or_insert_with(|| {
            let seen = SeenTriangle::of(hit, scene);
            let optics = scene.optics(seen.surface());
            let appearance = (!seen.varies()).then(look);
            Known { seen, optics, appearance }
        });
        (&known.seen, known.optics, known.appearance.unwrap_or_else(look))
    }
}
