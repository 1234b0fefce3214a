//! Packets among things that move: rays of different times are carried by different maps.

use glam::DVec3;

use super::batch::{Batch, NearestHits, RaySet};
use super::exact::LocalRay;
use super::packet::{PacketStack, RayData, RayPacket};
use super::policy::MOVING_RAY;
use super::rays::Origins;
use super::scratch::SingleScratch;
use super::simd::{F32x8, SimdTask};
use super::tracer::{Tracer, ones};

impl Tracer {
    /// Replaces the hits of a packet's rays, which have different times, by those in a placement that moves, where these are nearer.
    /// `single_work` is the work of a single ray. Returns the work that was done, or `None` if that was more than `budget`.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the state of a packet's traversal")]
    pub(super) fn visit_moving<S: F32x8>(
        &self,
        index: u32,
        rays: &Batch,
        budget: u64,
        nearest: &mut NearestHits,
        (stack, mesh_rays): (&mut PacketStack, &mut RayData),
        local: [&mut Vec<DVec3>; 2],
        single: &mut SingleScratch,
        single_work: u64,
    ) -> Option<u64> {
        S::run(MovingVisit {
            tracer: self,
            index,
            rays,
            budget,
            nearest,
            stack,
            mesh_rays,
            local,
            single,
            single_work,
        })
    }
}

/// A packet's visit to a placement that moves, for rays of different times: each is carried by the map of its own time, so their
/// origins differ in the placement's space. It is a task of its own to keep its code out of that for placements that do not move.
struct MovingVisit<'a, 'r> {
    tracer: &'a Tracer,
    index: u32,
    rays: &'a Batch<'r>,
    budget: u64,
    nearest: &'a mut NearestHits,
    stack: &'a mut PacketStack,
    mesh_rays: &'a mut RayData,
    /// Memory for directions and origins in the placement's space.
    local: [&'a mut Vec<DVec3>; 2],
    single: &'a mut SingleScratch,
    /// The work of a single ray.
    single_work: u64,
}

impl SimdTask for MovingVisit<'_, '_> {
    type Output = Option<u64>;

    #[inline(always)]
    fn run<S: F32x8>(self) -> Option<u64> {
        let Self { tracer, index, rays, budget, nearest, stack, mesh_rays, local, single, single_work } =
            self;
        let [directions, origins] = local;
        let placement = &tracer.scene.arrangement.placements[index as usize];
        let count = rays.directions.len();
        directions.clear();
        origins.clear();
        let mut present: RaySet = 0;
        for ray in 0..count {
            let map = single.maps.of(index, placement, rays.time_s(ray));
            let local = map.map(|map| rays.ray(ray).carried_by(map));
            present |= RaySet::from(local.is_some()) << ray;
            let LocalRay { origin, direction } = local.unwrap_or(rays.ray(ray));
            origins.push(origin);
            directions.push(direction);
        }
        let mut work = MOVING_RAY * count as u64;
        if present == 0 {
            return Some(work);
        }
        let bvh = tracer.surfaces().bvh_of_mesh(placement.mesh);
        if present == ones(count)
            && let Some(mut packet) = RayPacket::<true>::new::<S>(
                bvh,
                index,
                Origins::Each(origins),
                directions,
                (rays.t_min, rays.t_max),
                nearest,
                mesh_rays,
            )
        {
            work += packet.traverse_mesh::<S>(stack, budget)?;
            packet.write_hits::<S>(nearest, true);
            return Some(work);
        }
        for ray in (0..count).filter(|ray| present >> ray & 1 != 0) {
            let mut best = nearest.get(ray);
            let limits = rays.limits::<false>(ray);
            let local = LocalRay { origin: origins[ray], direction: directions[ray] };
            tracer.intersect_mesh::<S, false>(index, local, &limits, false, &mut best, &mut single.mesh);
            nearest.set(ray, best);
            work += single_work;
        }
        Some(work)
    }
}
