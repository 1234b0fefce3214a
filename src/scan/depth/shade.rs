//! How surfaces look in the light of a depth camera and of the sun.

use glam::DVec3;

use crate::frame::Pose;
use crate::scan::frame::Return;
use crate::scan::optics::{Meeting, split};
use crate::scan::sunlight::Place;
use crate::scan::surface::LastSeen;
use crate::scene::{Scene, Surface};
use crate::trace::Hit;

/// The roughness below which a lobe is a mirror's: a pixel is some milliradians wide, and so is such a lobe.
const MIRROR_ROUGHNESS: f64 = 0.05;

/// The distance from a surface at which a ray from it begins, in metres along the surface's normal. The error of a hit is some
/// 10⁻¹⁵ of its depth, and seams of meshes are wider than that by far.
pub(super) const CLEARANCE_M: f64 = 1e-5;

/// A point of a surface, as it looks from one side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lit {
    /// The point in the world, in metres.
    pub point: DVec3,
    /// The unit normal towards the viewer.
    pub normal: DVec3,
    /// The object and the material.
    pub surface: Surface,
    /// The share of light that the surface scatters in all directions, 0 to 1.
    pub diffuse: f64,
    /// The light that comes back to a source beside the viewer, relative to a white Lambertian plane at a right angle.
    pub back: f64,
}

/// The surfaces of a scene, with the last triangle that was asked for.
pub(super) struct Shader<'a> {
    scene: &'a Scene,
    wavelength_m: f64,
    last: LastSeen<'a>,
}

/// The unit normal of the side of a surface that a ray hits.
#[inline]
pub(super) fn normal_towards_viewer(hit: &Hit, direction: DVec3) -> DVec3 {
    if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal }
}

impl<'a> Shader<'a> {
    pub fn new(scene: &'a Scene, wavelength_m: f64) -> Self {
        Self { scene, wavelength_m, last: LastSeen::default() }
    }

    /// The surface that a ray from `origin` hits, seen along the ray. `towards` is where the light comes from, or `None` if that is
    /// the viewer.
    pub fn light(&mut self, origin: DVec3, direction: DVec3, hit: &Hit, towards: Option<DVec3>) -> Lit {
        let (seen, optics, appearance) = self.last.at(self.scene, hit);
        let normal = normal_towards_viewer(hit, direction);
        let point = origin + direction * hit.t;
        let cosine = match towards {
            None => -normal.dot(direction),
            Some(source) => normal.dot((source - point).normalize_or_zero()),
        };
        let cosine = cosine.clamp(0.0, 1.0);
        let split = split(
            &appearance,
            optics,
            Meeting {
                cosine,
                length_m: hit.t,
                spacing_m: 0.0,
                wavelength_m: self.wavelength_m,
                mirror_roughness: MIRROR_ROUGHNESS,
            },
        );
        // A mirror and a pane have a reflectance, and scatter nothing.
        let diffuse =
            if cosine > 0.0 { split.reflectance.min(split.back / cosine) } else { split.reflectance };
        Lit { point, normal, surface: seen.surface(), diffuse: diffuse.clamp(0.0, 1.0), back: split.back }
    }

    /// The return of a hit as an ideal camera has it.
    pub fn receive(&mut self, sensor_from_world: &Pose, direction: DVec3, hit: &Hit) -> Return {
        self.last.at(self.scene, hit).0.receive(sensor_from_world, direction, hit, hit.t)
    }
}

impl Lit {
    /// The place, as it is seen at a time in seconds on the clock of the scene.
    pub fn place(&self, time_s: f64) -> Place {
        Place { point: self.point, normal: self.normal, reflectance: self.diffuse, time_s }
    }
}
