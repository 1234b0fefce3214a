//! Packets and single rays among placements: what is carried to which of them.
//!
//! A packet visits a placement only with the rays that may meet its box before their nearest hits. If these are most of the packet,
//! all of it is carried there; if they are few, each goes alone; otherwise they make a packet of their own for this visit.

use glam::{DAffine3, DVec3};

use super::batch::{Batch, NearestHit, NearestHits, RaySet, rays_of};
use super::exact::{self, Limits, LocalRay};
use super::packet::{Elsewhere, PacketStack, RayData, RayPacket};
use super::policy::{PACKET_LEAF, PACKET_NODE, PACKET_RAY, PacketPolicy};
use super::rays::Origins;
use super::scratch::{PartScratch, Scratch, SingleScratch};
use super::simd::F32x8;
use super::single::{RayStack, SingleRay};
use super::tracer::{PacketEnd, Tracer, ones};

/// So many rays, or fewer, go to a placement alone.
const FEW: u32 = 4;

/// The memory and the state of a packet's visits.
struct Visits<'a, 'r> {
    rays: &'a Batch<'r>,
    nearest: &'a mut NearestHits,
    stack: &'a mut PacketStack,
    mesh_rays: &'a mut RayData,
    directions: &'a mut Vec<DVec3>,
    origins: &'a mut Vec<DVec3>,
    part: &'a mut PartScratch,
}

impl Tracer {
    /// Finds the nearest hits (any hits, if `any`) of up to [`PACKET_RAYS`](super::batch::PACKET_RAYS) rays in a scene with a hierarchy
    /// over placements, unless they are better cast one by one.
    #[inline(always)]
    pub(super) fn cast_packet_among<S: F32x8, const MULTI_ORIGIN: bool>(
        &self,
        rays: &Batch,
        any: bool,
        nearest: &mut NearestHits,
        scratch: &mut Scratch,
    ) -> PacketEnd {
        let Scratch {
            top: stack,
            mesh,
            directions,
            origins,
            single,
            rays: top_rays,
            mesh_rays,
            policy,
            part,
            ..
        } = scratch;
        let ray_count = rays.directions.len();
        let budget = policy.budget(ray_count);
        let limits = (rays.t_min, rays.t_max);
        let Some(mut top) = RayPacket::<MULTI_ORIGIN>::new::<S>(
            &self.top.bvh,
            0,
            rays.origins,
            rays.directions,
            limits,
            nearest,
            top_rays,
        ) else {
            return PacketEnd::NoPyramid;
        };
        let is_of_one_time = rays.are_of_one_time();
        let mut visits = Visits { rays, nearest, stack: mesh, mesh_rays, directions, origins, part };
        // The work of the placements so far, and of the nodes above them.
        let (mut work, visited) = (0, stack.visited);
        top.push_root::<S>(stack);
        while let Some(leaf) = top.next_leaf::<S>(stack) {
            let done = work + PACKET_NODE * (stack.visited - visited);
            if done > budget {
                policy.gave_up(ray_count);
                return PacketEnd::GivenUp;
            }
            work += PACKET_LEAF;
            let met = top.rays_in::<S>(&leaf);
            if met == 0 {
                continue;
            }
            let index = leaf.number;
            let placement = &self.scene.arrangement.placements[index as usize];
            let visit = if placement.is_moving() && !is_of_one_time {
                self.know_depths(rays, visits.nearest, ones(ray_count));
                let Visits { nearest, stack, mesh_rays, directions, origins, .. } = &mut visits;
                let more = self.visit_moving::<S>(
                    index,
                    rays,
                    budget - done,
                    nearest,
                    (stack, mesh_rays),
                    [directions, origins],
                    single,
                    policy.single_work(1),
                );
                more.map(|more| (more, ones(ray_count)))
            } else {
                let moved;
                let mut map = placement.mesh_from_scene();
                if placement.is_moving() {
                    let Some(at) = single.maps.of(index, placement, rays.time_s(0)) else { continue };
                    moved = *at;
                    map = &moved;
                }
                work += PACKET_RAY * u64::from(met.count_ones());
                let left = budget - done;
                self.visit::<S, MULTI_ORIGIN>(index, met, map, left, &mut visits, &mut single.mesh, policy)
            };
            let Some((more, found)) = visit else {
                policy.gave_up(ray_count);
                return PacketEnd::GivenUp;
            };
            work += more;
            if any {
                top.end::<S>(found & visits.nearest.hit);
            } else {
                top.update_depths::<S>(visits.nearest, found);
            }
        }
        policy.succeeded(ray_count, work + PACKET_NODE * (stack.visited - visited));
        PacketEnd::Cast
    }

    /// Replaces the hits of some of a packet's rays by those in a placement, whose map is given, where these are nearer. Returns the work
    /// that was done and the rays with new hits (others may be among them), or `None` if that was more than `budget`.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the state of a packet's traversal")]
    fn visit<S: F32x8, const MULTI_ORIGIN: bool>(
        &self,
        placement: u32,
        met: RaySet,
        map: &DAffine3,
        budget: u64,
        visits: &mut Visits,
        ray_stack: &mut RayStack,
        policy: &PacketPolicy,
    ) -> Option<(u64, RaySet)> {
        let Visits { rays, nearest, stack, mesh_rays, directions, origins, part } = visits;
        let count = met.count_ones();
        if count > FEW {
            let bvh = self.surfaces().bvh(placement);
            let limits = (rays.t_min, rays.t_max);
            let is_part = 4 * count as usize <= 3 * rays.directions.len();
            let (picked_origins, picked, numbers, known) = if is_part {
                part.pick(rays, nearest, met);
                let picked_origins = match rays.origins {
                    Origins::Common(_) => rays.origins,
                    Origins::Each(_) => Origins::Each(&part.origins),
                };
                (picked_origins, &part.directions[..], Some(&part.numbers[..]), &mut part.nearest)
            } else {
                (rays.origins, rays.directions, None, &mut **nearest)
            };
            let carried = exact::carry(map, picked_origins, picked, directions, origins);
            let packet = RayPacket::<MULTI_ORIGIN>::new::<S>(
                bvh, placement, carried, directions, limits, known, mesh_rays,
            );
            if let Some(mut packet) = packet {
                packet.elsewhere = Some(Elsewhere { surfaces: self.surfaces(), rays, numbers });
                let work = packet.traverse_mesh::<S>(stack, budget)?;
                let mut found = packet.write_hits::<S>(known, true);
                if is_part {
                    found = nearest.put(&part.nearest, met, found);
                }
                return Some((work, found));
            }
        }
        self.know_depths(rays, nearest, met);
        for ray in rays_of(met) {
            let mut best = nearest.get(ray);
            let limits = rays.limits::<false>(ray);
            let local = rays.ray(ray).carried_by(map);
            self.intersect_mesh::<S, false>(placement, local, &limits, false, &mut best, ray_stack);
            nearest.set(ray, best);
        }
        Some((policy.single_work(count as usize), met & nearest.hit))
    }

    /// Works out the depths of the hits of some rays of a packet.
    #[inline(always)]
    fn know_depths(&self, rays: &Batch, nearest: &mut NearestHits, which: RaySet) {
        for ray in rays_of(nearest.rough & which) {
            if let Some(mut hit) = nearest.get(ray) {
                hit.t = self.surfaces().depth(rays.ray(ray), rays.time_s(ray), hit.placement, hit.triangle);
                nearest.set(ray, Some(hit));
            }
        }
    }

    /// Finds the nearest hit of one ray (any hit, if `any`) in a scene with a hierarchy over placements.
    #[inline(always)]
    pub(super) fn cast_single<S: F32x8, const AFTER: bool>(
        &self,
        ray: LocalRay,
        time_s: Option<f64>,
        limits: &Limits,
        any: bool,
        best: &mut Option<NearestHit>,
        scratch: &mut SingleScratch,
    ) {
        let Some(mut top) = SingleRay::new::<S>(ray, self.top.bvh.largest, limits) else {
            return self.cast_in_f64(ray, time_s, limits, best, &mut scratch.scalar);
        };
        scratch.top.push_root(&self.top.bvh);
        while let Some(index) = top.next_leaf::<S>(&self.top.bvh, &mut scratch.top) {
            let placement = &self.scene.arrangement.placements[index as usize];
            let Some(map) = scratch.maps.of(index, placement, time_s) else { continue };
            let local = ray.carried_by(map);
            let copies = if AFTER { usize::MAX } else { 1 };
            for copy in self.top.with_copies(index).take(copies) {
                self.intersect_mesh::<S, AFTER>(copy, local, limits, any, best, &mut scratch.mesh);
            }
            if let Some(best) = best {
                if any {
                    return;
                }
                top.limit(best.t);
            }
        }
    }

    /// Replaces `best` by the nearest hit of one ray in one placement, if that is nearer. The ray is given in the
    /// placement's space.
    #[inline(always)]
    pub(super) fn intersect_mesh<S: F32x8, const AFTER: bool>(
        &self,
        placement: u32,
        ray: LocalRay,
        limits: &Limits,
        any: bool,
        best: &mut Option<NearestHit>,
        stack: &mut RayStack,
    ) {
        let bvh = self.surfaces().bvh(placement);
        let Some(mut single) = SingleRay::new::<S>(ray, bvh.largest, limits) else {
            return self.intersect_placement_in_f64(placement, ray, limits, best, &mut Vec::new());
        };
        if let Some(best) = best {
            single.limit(best.t);
        }
        stack.push_root(bvh);
        while let Some(block_offset) = single.next_leaf::<S>(bvh, stack) {
            let found =
                single.test_leaf::<S, AFTER>(bvh, block_offset, placement, limits, best, &mut stack.stats);
            if found && any {
                return;
            }
        }
    }
}

impl PartScratch {
    /// Takes some rays of a packet, and their hits.
    #[inline(always)]
    fn pick(&mut self, rays: &Batch, nearest: &NearestHits, which: RaySet) {
        self.directions.clear();
        self.origins.clear();
        self.numbers.clear();
        (self.nearest.hit, self.nearest.rough) = (0, 0);
        for (k, ray) in rays_of(which).enumerate() {
            self.directions.push(rays.directions[ray]);
            if let Origins::Each(origins) = rays.origins {
                self.origins.push(origins[ray]);
            }
            self.numbers.push(ray as u8);
            (self.nearest.t[k], self.nearest.t_low[k]) = (nearest.t[ray], nearest.t_low[ray]);
            self.nearest.triangle[k] = nearest.triangle[ray];
            self.nearest.placement[k] = nearest.placement[ray];
            self.nearest.hit |= (nearest.hit >> ray & 1) << k;
            self.nearest.rough |= (nearest.rough >> ray & 1) << k;
        }
    }
}

impl NearestHits {
    /// Puts back the hits in `found` of those rays of a packet that are `which` of its rays. Returns them as rays of the packet.
    #[inline(always)]
    fn put(&mut self, part: &Self, which: RaySet, found: RaySet) -> RaySet {
        let (mut changed, mut rough) = (0, 0);
        for (k, ray) in rays_of(which).enumerate() {
            if found >> k & 1 != 0 {
                (self.t[ray], self.t_low[ray]) = (part.t[k], part.t_low[k]);
                rough |= (part.rough >> k & 1) << ray;
                (self.triangle[ray], self.placement[ray]) = (part.triangle[k], part.placement[k]);
                changed |= 1 << ray;
            }
        }
        self.hit |= changed;
        self.rough = self.rough & !changed | rough;
        changed
    }
}
