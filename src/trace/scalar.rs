//! The tracer's rays in f64, one after the other: what [`Instructions::Scalar`](super::Instructions::Scalar) casts, and the rays that
//! f32 cannot serve.

use super::batch::NearestHit;
use super::bvh::{Child, LeafBlock, TriangleRef};
use super::exact::{Candidate, Corners, Limits, LocalRay};
use super::rays::{Hit, Rays};
use super::scratch::ScalarScratch;
use super::tracer::Tracer;

impl Tracer {
    /// Writes the hits of rays, one ray after the other, in f64.
    #[inline(never)]
    pub(super) fn cast_all_in_f64(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        let mut scratch = ScalarScratch::default();
        for (index, hit) in hits.iter_mut().enumerate() {
            let origin = self.scene.geometry.ray_origin(rays.origin(index));
            let ray = LocalRay { origin, direction: rays.directions[index] };
            let mut best = None;
            self.cast_in_f64(ray, rays.time_s(index), &Limits::of(rays, index), &mut best, &mut scratch);
            *hit = best.and_then(|best| self.whole_hit(ray, rays.time_s(index), &best));
        }
    }

    /// Writes whether rays hit anything, one ray after the other, in f64.
    #[inline(never)]
    pub(super) fn find_blocked_in_f64(&self, rays: &Rays, blocked: &mut [bool]) {
        let mut scratch = ScalarScratch::default();
        for (index, blocked) in blocked.iter_mut().enumerate() {
            let origin = self.scene.geometry.ray_origin(rays.origin(index));
            let ray = LocalRay { origin, direction: rays.directions[index] };
            let mut best = None;
            self.cast_in_f64(ray, rays.time_s(index), &Limits::of(rays, index), &mut best, &mut scratch);
            *blocked = best.is_some();
        }
    }

    /// Finds the nearest hit of a ray, in f64.
    #[inline(never)]
    pub(super) fn cast_in_f64(
        &self,
        ray: LocalRay,
        time_s: Option<f64>,
        limits: &Limits,
        best: &mut Option<NearestHit>,
        scratch: &mut ScalarScratch,
    ) {
        let ScalarScratch { top, mesh } = scratch;
        if self.top.bvh.nodes.is_empty() {
            return self.intersect_placement_in_f64(0, ray, limits, best, mesh);
        }
        self.top.bvh.traverse(&ray, (limits.t_min, limits.t_max), top, |index| {
            if let Some(local) = ray.carried(&self.scene.arrangement.placements[index as usize], time_s) {
                let count = if limits.after.is_some() { usize::MAX } else { 1 };
                for copy in self.top.with_copies(index).take(count) {
                    self.intersect_placement_in_f64(copy, local, limits, best, mesh);
                }
            }
            best.map_or(limits.t_max, |b| b.t)
        });
    }

    /// Replaces `best` by the nearest hit of one ray in one placement, if that is nearer, in f64. The ray is given in the
    /// placement's space.
    #[inline(never)]
    pub(super) fn intersect_placement_in_f64(
        &self,
        placement: u32,
        ray: LocalRay,
        limits: &Limits,
        best: &mut Option<NearestHit>,
        stack: &mut Vec<(Child, f64)>,
    ) {
        let surfaces = self.surfaces();
        let bvh = surfaces.bvh(placement);
        let far = best.map_or(limits.t_max, |b| b.t);
        bvh.traverse(&ray, (limits.t_min, far), stack, |block_offset| {
            let block = LeafBlock::at(&bvh.blocks, block_offset);
            for lane in 0..block.triangles {
                let corners = Corners::from_positions(block.positions(lane), ray.origin);
                if !corners.passes(ray.direction) {
                    continue;
                }
                let t = corners.depth(ray.direction);
                let found = Candidate { t, placement, triangle: block.id(lane) };
                if limits.admits(&found) && best.is_none_or(|b| found.beats(&surfaces.candidate(&b))) {
                    *best = Some(NearestHit { t, placement, triangle: TriangleRef::new(block_offset, lane) });
                }
            }
            best.map_or(limits.t_max, |b| b.t)
        });
    }
}
