//! Tests every ray against every triangle: the reference.

use glam::DVec3;

use super::exact::{Candidate, Corners, Limits, LocalRay};
use super::rays::{Cast, Hit, Rays};
use crate::scene::Scene;

/// Applies the definition of a hit to every triangle that is not plainly far from the ray. It is slow, and right by
/// construction; every other tracer is compared with it.
#[derive(Clone, Copy, Debug)]
pub struct BruteForce<'s>(
    /// The scene that rays are cast against.
    pub &'s Scene,
);

impl Cast for BruteForce<'_> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        let scene = self.0;
        rays.check(hits.len(), &scene.arrangement);
        let all: Vec<LocalRay> = rays
            .directions
            .iter()
            .enumerate()
            .map(|(ray, &direction)| LocalRay {
                origin: scene.geometry.ray_origin(rays.origin(ray)),
                direction,
            })
            .collect();
        let limits: Vec<_> = (0..hits.len()).map(|ray| Limits::of(rays, ray)).collect();
        let mut nearest: Vec<Option<Candidate>> = vec![None; hits.len()];
        for (index, placement) in scene.arrangement.placements.iter().enumerate() {
            // The rays in the mesh's space, each with its number. A ray is left out if the mesh is nowhere at its time.
            let carried =
                |number: usize| Some((number, all[number].carried(placement, rays.time_s(number))?));
            let local = (0..all.len()).filter_map(carried);
            let local: Vec<_> = local.map(|(number, ray)| (number, ray, unit(ray.direction))).collect();
            let farthest = local.iter().map(|(_, ray, _)| ray.origin.abs().max_element()).fold(0.0, f64::max);
            let mesh = scene.mesh(placement.mesh);
            for triangle in 0..mesh.triangles.len() as u32 {
                let sphere = Sphere::around(&Corners::of(mesh, triangle, DVec3::ZERO), farthest);
                for &(number, ray, unit) in &local {
                    let (limits, best) = (&limits[number], &mut nearest[number]);
                    if sphere.is_clear_of(ray.origin, unit) {
                        continue;
                    }
                    let corners = Corners::of(mesh, triangle, ray.origin);
                    if !corners.passes(ray.direction) {
                        continue;
                    }
                    let t = corners.depth(ray.direction);
                    let found = Candidate { t, placement: index as u32, triangle };
                    if limits.admits(&found) && best.is_none_or(|known| found.beats(&known)) {
                        *best = Some(found);
                    }
                }
            }
        }
        for (number, (best, hit)) in nearest.into_iter().zip(hits).enumerate() {
            *hit = best.and_then(|found| {
                let placement = &scene.arrangement.placements[found.placement as usize];
                let map = match rays.time_s(number) {
                    Some(time_s) => placement.mesh_from_scene_at(time_s)?,
                    None => *placement.mesh_from_scene(),
                };
                let local = all[number].carried_by(&map);
                let corners = Corners::of(scene.mesh(placement.mesh), found.triangle, local.origin);
                Some(found.finish(&corners, local.direction, &map))
            });
        }
    }
}

/// The margin of the squares that [`Sphere::is_clear_of`] compares, relative to |m|². A dot product of
/// three terms is off by at most 5u of |m|², u = 2⁻⁵³, and d is of unit length within 3u; so |m|² is off by 5u and (m·d)² by
/// 17u of |m|², less than 3·10⁻¹⁵ in all. The margin is three hundred thousand times that: a larger sphere only costs time.
const SQUARES: f64 = 1e-9;

/// The margin of a sphere's radius, relative to the largest coordinates of its middle and of the rays' origins. Corners and
/// the middle as seen from an origin are each rounded by at most √3·2u of these coordinates, 4·10⁻¹⁶. The margin is more than
/// a hundred thousand times that.
const POSITIONS: f64 = 1e-10;

/// The direction in unit length; NaN for none. It is scaled to about 1 first, so that the square of its length does not underflow.
fn unit(direction: DVec3) -> DVec3 {
    let scaled = direction / direction.abs().max_element();
    scaled.try_normalize().unwrap_or(DVec3::NAN)
}

/// A sphere around a triangle. A line that keeps clear of it misses the triangle, and needs no exact answer.
struct Sphere {
    middle: DVec3,
    radius_squared: f64,
}

impl Sphere {
    /// A sphere for rays from origins whose coordinates are at most `farthest`.
    fn around(corners: &Corners, farthest: f64) -> Self {
        let Corners { a, b, c } = *corners;
        let middle = (a + b + c) / 3.0;
        let radius = [a, b, c].map(|p| (p - middle).length()).into_iter().fold(0.0, f64::max);
        let radius = radius * (1.0 + SQUARES) + (middle.abs().max_element() + farthest) * POSITIONS;
        Self { middle, radius_squared: radius * radius }
    }

    /// Whether the line along the unit vector d passes the middle m, as seen from the origin, at a distance of more than the
    /// radius. The distance is √(|m|² − (m·d)²). False if a coordinate is NaN.
    fn is_clear_of(&self, origin: DVec3, unit: DVec3) -> bool {
        let middle = self.middle - origin;
        let along = middle.dot(unit);
        along * along < middle.length_squared() * (1.0 - SQUARES) - self.radius_squared
    }
}
