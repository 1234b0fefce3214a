//! Sunlight on surfaces, with its shadows.

use glam::DVec3;

use crate::physics::sun::ambient;
use crate::scene::{Scene, Sun};
use crate::trace::{Cast, Origins, Rays};

/// The distance of a shadow's ray from its surface, in metres along the surface's normal.
const CLEARANCE_M: f64 = 1e-3;

/// A place on a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// The point in the world, in metres.
    pub point: DVec3,
    /// The unit normal towards the viewer.
    pub normal: DVec3,
    /// The share of light that the surface scatters in all directions, 0 to 1.
    pub reflectance: f64,
    /// The time at which it is seen, in seconds on the clock of the scene.
    pub time_s: f64,
}

/// The sunlight that each place scatters to a viewer, relative to a white plane that faces a sun of 100 klx. It is 0 in shadow, and where
/// the sun is behind the surface.
pub(super) fn sunlight(scene: &Scene, tracer: &impl Cast, sun: &Sun, places: &[Place]) -> Vec<f64> {
    let is_towards = |place: &&Place| place.normal.dot(sun.direction) > 0.0;
    let origin = |place: &Place| place.point + place.normal * CLEARANCE_M;
    let origins: Vec<DVec3> = places.iter().filter(is_towards).map(origin).collect();
    let times_s: Vec<f64> = places.iter().filter(is_towards).map(|place| place.time_s).collect();
    let directions = vec![sun.direction; origins.len()];
    let rays = Rays {
        times_s: scene.arrangement.window.is_some().then_some(&times_s[..]),
        ..Rays::unlimited(Origins::Each(&origins), &directions)
    };
    let mut is_shaded = vec![false; origins.len()];
    tracer.blocked(&rays, &mut is_shaded);
    let mut is_shaded = is_shaded.into_iter();
    let light = |place: &Place| match is_towards(&place) && is_shaded.next() == Some(false) {
        true => ambient(place.reflectance, place.normal.dot(sun.direction)) * sun.klx / 100.0,
        false => 0.0,
    };
    places.iter().map(light).collect()
}
