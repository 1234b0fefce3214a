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
        assert_eq!(rays.directions.len(), hits.len());
        for (run, origin) in rays.runs() {
            let directions = &rays.directions[run.clone()];
            self.cast_run(origin - self.0.centre, directions, (rays.t_min, rays.t_max), &mut hits[run]);
        }
    }
}

impl BruteForce<'_> {
    /// Rays of one origin, which is counted from the scene's centre.
    fn cast_run(
        &self,
        origin: DVec3,
        directions: &[DVec3],
        (t_min, t_max): (f64, f64),
        hits: &mut [Option<Hit>],
    ) {
        let scene = self.0;
        let mut nearest: Vec<Option<Candidate>> = vec![None; hits.len()];
        for (index, placement) in scene.placements.iter().enumerate() {
            let carried = |direction| LocalRay { origin, direction }.carried(placement);
            let local_origin = carried(DVec3::ZERO).origin; // wherever the ray goes
            let local: Vec<_> = directions
                .iter()
                .map(|&d| carried(d).direction)
                .map(|direction| (direction, direction.try_normalize().unwrap_or(DVec3::NAN)))
                .collect();
            let mesh = &scene.meshes[placement.mesh as usize];
            for triangle in 0..mesh.triangles.len() as u32 {
                let corners = Corners::of(mesh, triangle, local_origin);
                let sphere = Sphere::around(&corners);
                for (&(direction, unit), best) in local.iter().zip(&mut nearest) {
                    if sphere.is_clear_of(unit) || !corners.passes(direction) {
                        continue;
                    }
                    let t = corners.depth(direction);
                    let found = Candidate { t, placement: index as u32, triangle };
                    if (t_min..=t_max).contains(&t) && best.is_none_or(|known| found.beats(&known)) {
                        *best = Some(found);
                    }
                }
            }
        }
        for ((&direction, best), hit) in directions.iter().zip(nearest).zip(hits) {
            *hit = best.map(|found| {
                let placement = &scene.placements[found.placement as usize];
                let mesh = &scene.meshes[placement.mesh as usize];
                let local = LocalRay { origin, direction }.carried(placement);
                found.finish(&Corners::of(mesh, found.triangle, local.origin), local.direction, placement)
            });
        }
    }
}

/// A sphere around a triangle: a line that keeps clear of it needs no exact answer.
struct Sphere {
    middle: DVec3,
    /// |middle|² − radius², with room for rounding: a millionfold more than the few u·|middle|² that it takes.
    tangent_squared: f64,
}

impl Sphere {
    fn around(corners: &Corners) -> Self {
        let Corners { a, b, c } = *corners;
        let middle = (a + b + c) / 3.0;
        let radius_squared = [a, b, c].map(|p| (p - middle).length_squared()).into_iter().fold(0.0, f64::max);
        let tangent_squared = middle.length_squared() * (1.0 - 1e-9) - radius_squared * (1.0 + 1e-9);
        Self { middle, tangent_squared }
    }

    /// Whether the line from the origin along the unit vector d passes the middle m farther than the radius: at
    /// √(|m|² − (m·d)²). Never of a vector that is NaN.
    fn is_clear_of(&self, unit: DVec3) -> bool {
        let along = self.middle.dot(unit);
        along * along < self.tangent_squared
    }
}
