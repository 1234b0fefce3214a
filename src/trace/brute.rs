//! Every ray against every triangle: the reference.

use super::exact::{Candidate, Corners, LocalRay};
use super::{Cast, Hit, Rays};
use crate::scene::Scene;

/// Applies the definition to all triangles. Slow, and right by construction: what every other tracer is compared with.
#[derive(Clone, Copy, Debug)]
pub struct BruteForce<'s>(
    /// What to cast against.
    pub &'s Scene,
);

impl Cast for BruteForce<'_> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        assert_eq!(rays.directions.len(), hits.len());
        let scene = self.0;
        for (&direction, hit) in rays.directions.iter().zip(hits) {
            let ray = LocalRay { origin: rays.origin - scene.centre, direction };
            let mut best: Option<(Candidate, LocalRay)> = None;
            for (index, placement) in scene.placements.iter().enumerate() {
                let local = ray.carried(placement);
                let mesh = &scene.meshes[placement.mesh as usize];
                for triangle in 0..mesh.triangles.len() as u32 {
                    let corners = Corners::of(mesh, triangle, local.origin);
                    if !corners.passes(local.direction) {
                        continue;
                    }
                    let t = corners.depth(local.direction);
                    let found = Candidate { t, placement: index as u32, triangle };
                    if (rays.t_min..=rays.t_max).contains(&t)
                        && best.is_none_or(|(known, _)| found.beats(&known))
                    {
                        best = Some((found, local));
                    }
                }
            }
            *hit = best.map(|(found, local)| {
                let placement = &scene.placements[found.placement as usize];
                let mesh = &scene.meshes[placement.mesh as usize];
                found.finish(&Corners::of(mesh, found.triangle, local.origin), local.direction, placement)
            });
        }
    }
}
