//! Every ray against every triangle: the reference.

use glam::DVec3;

use super::exact::{Candidate, Corners, LocalRay};
use super::{Cast, Hit, Rays};
use crate::scene::Scene;

/// Applies the definition to all triangles but those that are plainly far from the ray. Slow, and right by construction:
/// what every other tracer is compared with.
#[derive(Clone, Copy, Debug)]
pub struct BruteForce<'s>(
    /// What to cast against.
    pub &'s Scene,
);

impl Cast for BruteForce<'_> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        rays.check(hits.len());
        let scene = self.0;
        let all: Vec<LocalRay> = rays
            .directions
            .iter()
            .enumerate()
            .map(|(ray, &direction)| LocalRay { origin: rays.origin(ray) - scene.geometry.centre, direction })
            .collect();
        let mut nearest: Vec<Option<Candidate>> = vec![None; hits.len()];
        for (index, placement) in scene.arrangement.placements.iter().enumerate() {
            let local: Vec<_> = all
                .iter()
                .map(|ray| ray.carried(placement))
                .map(|ray| (ray, ray.direction.try_normalize().unwrap_or(DVec3::NAN)))
                .collect();
            let farthest = local.iter().map(|(ray, _)| ray.origin.abs().max_element()).fold(0.0, f64::max);
            let mesh = &scene.geometry.meshes[placement.mesh as usize];
            for triangle in 0..mesh.triangles.len() as u32 {
                let sphere = Sphere::around(&Corners::of(mesh, triangle, DVec3::ZERO), farthest);
                for (&(ray, unit), best) in local.iter().zip(&mut nearest) {
                    if sphere.is_clear_of(ray.origin, unit) {
                        continue;
                    }
                    let corners = Corners::of(mesh, triangle, ray.origin);
                    if !corners.passes(ray.direction) {
                        continue;
                    }
                    let t = corners.depth(ray.direction);
                    let found = Candidate { t, placement: index as u32, triangle };
                    if (rays.t_min..=rays.t_max).contains(&t) && best.is_none_or(|known| found.beats(&known))
                    {
                        *best = Some(found);
                    }
                }
            }
        }
        for ((ray, best), hit) in all.into_iter().zip(nearest).zip(hits) {
            *hit = best.map(|found| {
                let placement = &scene.arrangement.placements[found.placement as usize];
                let mesh = &scene.geometry.meshes[placement.mesh as usize];
                let local = ray.carried(placement);
                found.finish(&Corners::of(mesh, found.triangle, local.origin), local.direction, placement)
            });
        }
    }
}

/// A sphere around a triangle: a line that keeps clear of it needs no exact answer.
struct Sphere {
    middle: DVec3,
    radius_squared: f64,
}

impl Sphere {
    /// Large enough for rays from origins whose coordinates are at most `farthest`: a millionfold what rounding takes.
    fn around(corners: &Corners, farthest: f64) -> Self {
        let Corners { a, b, c } = *corners;
        let middle = (a + b + c) / 3.0;
        let radius = [a, b, c].map(|p| (p - middle).length()).into_iter().fold(0.0, f64::max);
        let radius = radius * (1.0 + 1e-9) + (middle.abs().max_element() + farthest) * 1e-10;
        Self { middle, radius_squared: radius * radius }
    }

    /// Whether the line along the unit vector d passes the middle m, seen from the origin, farther than the radius: at
    /// √(|m|² − (m·d)²). Never of a vector that is NaN.
    fn is_clear_of(&self, origin: DVec3, unit: DVec3) -> bool {
        let middle = self.middle - origin;
        let along = middle.dot(unit);
        // Of the difference of squares 10⁻⁹ is more than rounding takes.
        along * along < middle.length_squared() * (1.0 - 1e-9) - self.radius_squared
    }
}
