//! The tracer: a hierarchy over the placements, whose leaves are hierarchies over the meshes. Neighbouring rays traverse them in
//! packets, other rays in streams or alone.

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use super::batch::{Batch, NearestHit, NearestHits, PACKET_RAYS, RaySet};
use super::bvh::{self, Bvh8, Child, LeafBlock, TriangleRef};
use super::exact::{self, Candidate, Corners, Limits, LocalRay};
use super::hit_attributes::Surfaces;
use super::packet::{self, RayPacket};
use super::policy::{self, PACKET_NODE, PACKET_RAY};
use super::rays::{Cast, Hit, Origins, Rays};
use super::scratch::{ScalarScratch, Scratch, SingleScratch};
use super::simd::{self, F32x8, SimdTask};
use super::single::{RayStack, SingleRay};
use super::stats::TraversalStats;
use super::top::{Top, bounds_of};
use crate::scene::bounds::Bounds;
use crate::scene::{Arrangement, Scene};

/// Finds the hits that [`BruteForce`](super::BruteForce) finds, bit for bit, and fast.
///
/// A tracer owns all that it needs and shares it with its clones, so a clone costs four reference counts. Rays are taken in
/// their order, [`PACKET_RAYS`] at a time, so neighbours in a batch should be neighbours in space.
#[derive(Clone, Debug)]
pub struct Tracer {
    pub(super) scene: Scene,
    /// The hierarchy over the triangles of each mesh.
    pub(super) meshes: Arc<[Bvh8]>,
    /// The bounds of each mesh in its own space.
    bounds: Arc<[Bounds]>,
    /// The hierarchy over the placements.
    pub(super) top: Arc<Top>,
    instructions: Instructions,
    packets: bool,
}

/// The instructions that a [`Tracer`] computes with. They do not change its hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// The widest that the processor has.
    Best,
    /// At most AVX2 and FMA.
    Avx2,
    /// The instructions that every processor has.
    Portable,
    /// One ray, box and triangle at a time, in f64.
    Scalar,
}

impl Tracer {
    /// Builds the hierarchies over a scene.
    pub fn build(scene: &Scene) -> Self {
        let meshes = &scene.geometry.meshes;
        let bounds: Arc<[Bounds]> = meshes.iter().map(bounds_of).collect();
        Self {
            meshes: meshes.iter().map(bvh::build).collect(),
            top: Arc::new(Top::new(scene, &bounds)),
            bounds,
            scene: scene.clone(),
            instructions: Instructions::Best,
            packets: true,
        }
    }

    /// A tracer of the same geometry, arranged otherwise. Only the hierarchy over the placements is built again, which takes
    /// milliseconds for tens of thousands of them; the meshes and their hierarchies are shared with this tracer.
    ///
    /// # Panics
    /// If the arrangement is not one of the scene's geometry: see [`Scene::rearranged`].
    pub fn rearranged(&self, arrangement: Arc<Arrangement>) -> Self {
        let scene = self.scene.rearranged(arrangement);
        Self { top: Arc::new(Top::new(&scene, &self.bounds)), scene, ..self.clone() }
    }

    /// The scene that rays are cast against.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The same tracer with other instructions.
    pub fn with_instructions(self, instructions: Instructions) -> Self {
        Self { instructions, ..self }
    }

    /// The same tracer without packets.
    pub fn ray_by_ray(self) -> Self {
        Self { packets: false, ..self }
    }

    /// The bytes that the tracer holds beside the scene.
    pub fn bytes(&self) -> usize {
        self.top.bytes() + self.meshes.iter().map(Bvh8::bytes).sum::<usize>()
    }

    /// [`Cast::cast`], and the work that it took. ([`Instructions::Scalar`] counts nothing.)
    ///
    /// # Panics
    /// As [`Cast::cast`] does.
    pub fn cast_counted(&self, rays: &Rays, hits: &mut [Option<Hit>]) -> TraversalStats {
        rays.check(hits.len());
        let stats = if rays.after.is_some() {
            self.with_simd(NearestTask::<true> { tracer: self, rays, hits: &mut *hits })
        } else {
            self.with_simd(NearestTask::<false> { tracer: self, rays, hits: &mut *hits })
        };
        stats.unwrap_or_else(|| {
            self.cast_all_in_f64(rays, hits);
            TraversalStats::default()
        })
    }

    /// Dispatches to the widest instruction set that is available and allowed. Returns `None`, and does nothing, when scalar mode is
    /// forced.
    #[inline]
    fn with_simd<T: SimdTask>(&self, task: T) -> Option<T::Output> {
        Some(match self.instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Best if simd::has_avx512() => simd::run_with_avx512(task),
            #[cfg(target_arch = "x86_64")]
            Instructions::Best | Instructions::Avx2 if simd::has_avx2() => simd::run_with_avx2(task),
            Instructions::Best | Instructions::Avx2 | Instructions::Portable => simd::run_portably(task),
            Instructions::Scalar => return None,
        })
    }

    #[inline(always)]
    fn surfaces(&self) -> Surfaces<'_> {
        Surfaces { placements: &self.scene.arrangement.placements, bvhs: &self.meshes }
    }

    /// Writes the hits of rays: packet by packet, and in streams where rays make no packet.
    #[inline(always)]
    fn cast_all<S: F32x8>(&self, rays: &Rays, hits: &mut [Option<Hit>], scratch: &mut Scratch) {
        let mut origins = Vec::new();
        // The pending run of consecutive rays that no packet accepted.
        let mut singles = 0..0;
        for start in (0..hits.len()).step_by(PACKET_RAYS) {
            let end = (start + PACKET_RAYS).min(hits.len());
            // Directions often come from memory, so the next ones are prefetched while these are cast.
            for line in (end..(end + PACKET_RAYS).min(hits.len())).step_by(2) {
                S::prefetch(rays.directions.as_ptr().wrapping_add(line).cast());
                if let Origins::Each(origins) = rays.origins {
                    S::prefetch(origins.as_ptr().wrapping_add(line).cast());
                }
            }
            let batch = self.batch(rays, start..end, &mut origins);
            let mut rejected = self.cast_packets::<S>(&batch, &mut hits[start..end], scratch);
            while rejected != 0 {
                let from = rejected.trailing_zeros() as usize;
                let to = from + (rejected >> from).trailing_ones() as usize;
                rejected &= !(ones(to - from) << from);
                if singles.end != start + from || singles.len() >= STREAM_RUN {
                    self.cast_rejected::<S>(rays, singles, hits, &mut origins, scratch);
                    singles = start + from..start + from;
                }
                singles.end = start + to;
            }
        }
        self.cast_rejected::<S>(rays, singles, hits, &mut origins, scratch);
    }

    /// Writes the hits of rays that are in no packet, and remembers what they cost.
    #[inline(always)]
    fn cast_rejected<S: F32x8>(
        &self,
        rays: &Rays,
        range: Range<usize>,
        hits: &mut [Option<Hit>],
        origins: &mut Vec<DVec3>,
        scratch: &mut Scratch,
    ) {
        if range.is_empty() {
            return;
        }
        let (count, before) = (range.len(), scratch.single.stats());
        self.cast_singles::<S, false>(rays, range, hits, origins, &mut scratch.single);
        let effort = scratch.single.stats() - before;
        scratch.policy.measured(count, effort, self.top.bvh.nodes.is_empty());
    }

    /// Writes the hits of rays of which some must come after a given hit ([`Rays::after`]). These rays make no packets: a packet
    /// has one least depth for all its rays, and such rays have one each.
    #[inline(always)]
    fn cast_all_after<S: F32x8>(&self, rays: &Rays, hits: &mut [Option<Hit>], scratch: &mut SingleScratch) {
        let mut origins = Vec::new();
        for start in (0..hits.len()).step_by(STREAM_RUN) {
            let run = start..(start + STREAM_RUN).min(hits.len());
            self.cast_singles::<S, true>(rays, run, hits, &mut origins, scratch);
        }
    }

    /// Some of the rays in the scene's space. Their origins go to `buffer` if they differ.
    #[inline(always)]
    fn batch<'r>(&self, rays: &Rays<'r>, range: Range<usize>, buffer: &'r mut Vec<DVec3>) -> Batch<'r> {
        let geometry = &*self.scene.geometry;
        let origins = match rays.origins {
            Origins::Common(origin) => Origins::Common(geometry.ray_origin(origin)),
            Origins::Each(all) => {
                let all = &all[range.clone()];
                if all.iter().all(|o| *o == all[0]) {
                    Origins::Common(geometry.ray_origin(all[0]))
                } else {
                    buffer.clear();
                    buffer.extend(all.iter().map(|&origin| geometry.ray_origin(origin)));
                    Origins::Each(buffer)
                }
            }
        };
        let after = rays.after.map(|after| &after[range.clone()]);
        Batch { origins, directions: &rays.directions[range], t_min: rays.t_min, t_max: rays.t_max, after }
    }

    /// Writes the hits of the packets among up to [`PACKET_RAYS`] rays, and returns the rays that are in no packet.
    #[inline(always)]
    fn cast_packets<S: F32x8>(
        &self,
        batch: &Batch,
        hits: &mut [Option<Hit>],
        scratch: &mut Scratch,
    ) -> RaySet {
        if !self.packets || scratch.policy.begin_tile() == 0 {
            return ones(hits.len());
        }
        let mut pending = [(0, 0); 8];
        pending[0] = (0, hits.len());
        let mut count = 1;
        let top = if self.top.bvh.nodes.is_empty() { &self.meshes[0] } else { &self.top.bvh };
        let mut rejected: RaySet = 0;
        while count > 0 {
            count -= 1;
            let (from, to) = pending[count];
            let part = batch.part(from..to);
            // Rays with origins of their own that do not make a packet together seldom make one in pieces.
            let least =
                if matches!(part.origins, Origins::Common(_)) { policy::LEAST } else { PACKET_RAYS / 4 };
            let most = scratch.policy.most();
            if to - from <= most && to - from >= 4 && packet::may_be_packet(top, part.origins) {
                let mut nearest = NearestHits::new(part.t_max);
                match self.cast_packet::<S>(&part, &mut nearest, scratch) {
                    PacketEnd::Cast => {
                        self.surfaces().write_hits::<S>(&part, &nearest, &mut hits[from..to]);
                        continue;
                    }
                    PacketEnd::GivenUp => {
                        rejected |= ones(to - from) << from;
                        continue;
                    }
                    PacketEnd::NoPyramid => {}
                }
            }
            if to - from > least && most > 0 {
                // The rays are no narrow pyramid, or too many, but their halves may do.
                let middle = from + (to - from) / 2;
                (pending[count], pending[count + 1]) = ((middle, to), (from, middle));
                count += 2;
                continue;
            }
            rejected |= ones(to - from) << from;
        }
        rejected
    }

    /// Writes the hits of rays that are in no packet.
    #[inline(always)]
    fn cast_singles<S: F32x8, const AFTER: bool>(
        &self,
        rays: &Rays,
        range: Range<usize>,
        hits: &mut [Option<Hit>],
        origins: &mut Vec<DVec3>,
        scratch: &mut SingleScratch,
    ) {
        if range.is_empty() {
            return;
        }
        let hits = &mut hits[range.clone()];
        let batch = self.batch(rays, range, origins);
        let mut nearest = NearestHits::new(batch.t_max);
        let mut groups = 0..hits.len().div_ceil(8);
        while let Some(group) = self.next_group::<S, AFTER>(&batch, false, &mut groups, &mut nearest, scratch)
        {
            let rays = 8 * group..(8 * group + 8).min(hits.len());
            self.surfaces().write_hits::<S>(&batch.part(rays.clone()), &nearest, &mut hits[rays]);
        }
    }

    /// Finds the nearest hits of up to [`PACKET_RAYS`] rays, unless they are better cast one by one.
    #[inline(always)]
    fn cast_packet<S: F32x8>(
        &self,
        rays: &Batch,
        nearest: &mut NearestHits,
        scratch: &mut Scratch,
    ) -> PacketEnd {
        match rays.origins {
            Origins::Common(_) => self.cast_packet_of::<S, false>(rays, nearest, scratch),
            Origins::Each(_) => self.cast_packet_of::<S, true>(rays, nearest, scratch),
        }
    }

    #[inline(always)]
    fn cast_packet_of<S: F32x8, const MULTI_ORIGIN: bool>(
        &self,
        rays: &Batch,
        nearest: &mut NearestHits,
        scratch: &mut Scratch,
    ) -> PacketEnd {
        let limits = (rays.t_min, rays.t_max);
        let Scratch {
            top: stack,
            mesh: mesh_stack,
            directions,
            origins: origin_buffer,
            single,
            rays: top_rays,
            mesh_rays,
            policy,
        } = scratch;
        let ray_count = rays.directions.len();
        let budget = policy.budget(ray_count);
        if self.top.bvh.nodes.is_empty() {
            let bvh = &self.meshes[0];
            let Some(mut packet) = RayPacket::<MULTI_ORIGIN>::new::<S>(
                bvh,
                0,
                rays.origins,
                rays.directions,
                limits,
                nearest,
                mesh_rays,
            ) else {
                return PacketEnd::NoPyramid;
            };
            let Some(work) = packet.traverse_mesh::<S>(mesh_stack, budget) else {
                policy.gave_up(ray_count);
                return PacketEnd::GivenUp;
            };
            packet.write_hits(nearest, false);
            policy.succeeded(ray_count, work);
            return PacketEnd::Cast;
        }
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
        // The work of the placements so far, and of the nodes above them.
        let (mut work, visited) = (0, stack.visited);
        top.push_root::<S>(stack);
        while let Some(leaf) = top.next_leaf::<S>(stack) {
            let done = work + PACKET_NODE * (stack.visited - visited);
            if done > budget {
                policy.gave_up(ray_count);
                return PacketEnd::GivenUp;
            }
            work += PACKET_RAY * ray_count as u64;
            let index = leaf.number;
            let placement = &self.scene.arrangement.placements[index as usize];
            let origins = exact::carry(placement, rays.origins, rays.directions, directions, origin_buffer);
            let bvh = &self.meshes[placement.mesh as usize];
            if let Some(mut packet) = RayPacket::<MULTI_ORIGIN>::new::<S>(
                bvh, index, origins, directions, limits, nearest, mesh_rays,
            ) {
                let Some(more) = packet.traverse_mesh::<S>(mesh_stack, budget - done) else {
                    policy.gave_up(ray_count);
                    return PacketEnd::GivenUp;
                };
                work += more;
                packet.write_hits(nearest, true);
            } else {
                work += policy.single_work(ray_count);
                for ray in 0..rays.directions.len() {
                    let mut best = nearest.get(ray);
                    let limits = rays.limits::<false>(ray);
                    let ray_stack = &mut single.mesh;
                    self.intersect_placement::<S, false>(
                        index,
                        rays.ray(ray),
                        &limits,
                        false,
                        &mut best,
                        ray_stack,
                    );
                    nearest.set(ray, best);
                }
            }
            top.update_depths(nearest);
        }
        policy.succeeded(ray_count, work + PACKET_NODE * (stack.visited - visited));
        PacketEnd::Cast
    }

    /// Finds the nearest hits (any hits, if `any`) of eight more rays of a batch, and returns which group of eight it was.
    /// Groups come in any order. `groups` are the groups to come where rays are cast one by one.
    #[inline(always)]
    fn next_group<S: F32x8, const AFTER: bool>(
        &self,
        rays: &Batch,
        any: bool,
        groups: &mut Range<usize>,
        nearest: &mut NearestHits,
        scratch: &mut SingleScratch,
    ) -> Option<usize> {
        if !self.top.bvh.nodes.is_empty() {
            let group = groups.next()?;
            nearest.clear();
            for k in 0..(rays.directions.len() - 8 * group).min(8) {
                let mut best = None;
                let ray = 8 * group + k;
                let limits = rays.limits::<AFTER>(ray);
                self.cast_single::<S, AFTER>(rays.ray(ray), &limits, any, &mut best, scratch);
                nearest.set(k, best);
            }
            return Some(group);
        }
        let (group, mut rest) = scratch.stream.next_group::<S, AFTER>(&self.meshes[0], rays, any, nearest)?;
        while rest != 0 {
            let k = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let mut best = None;
            let ray = 8 * group + k;
            let limits = rays.limits::<AFTER>(ray);
            self.intersect_placement::<S, AFTER>(
                0,
                rays.ray(ray),
                &limits,
                any,
                &mut best,
                &mut scratch.mesh,
            );
            nearest.set(k, best);
        }
        Some(group)
    }

    /// Finds the nearest hit of one ray (any hit, if `any`) in a scene with a hierarchy over placements.
    #[inline(always)]
    fn cast_single<S: F32x8, const AFTER: bool>(
        &self,
        ray: LocalRay,
        limits: &Limits,
        any: bool,
        best: &mut Option<NearestHit>,
        scratch: &mut SingleScratch,
    ) {
        let Some(mut top) = SingleRay::new::<S>(ray, self.top.bvh.largest, limits) else {
            return self.cast_in_f64(ray, limits, best, &mut scratch.scalar);
        };
        scratch.top.push_root(&self.top.bvh);
        while let Some(index) = top.next_leaf::<S>(&self.top.bvh, &mut scratch.top) {
            if AFTER {
                for copy in self.top.with_copies(index) {
                    self.intersect_placement::<S, AFTER>(copy, ray, limits, any, best, &mut scratch.mesh);
                }
            } else {
                self.intersect_placement::<S, AFTER>(index, ray, limits, any, best, &mut scratch.mesh);
            }
            if let Some(best) = best {
                if any {
                    return;
                }
                top.limit(best.t);
            }
        }
    }

    /// Replaces `best` by the nearest hit of one ray in one placement, if that is nearer. The ray is given in the scene's space.
    #[inline(always)]
    fn intersect_placement<S: F32x8, const AFTER: bool>(
        &self,
        placement: u32,
        ray: LocalRay,
        limits: &Limits,
        any: bool,
        best: &mut Option<NearestHit>,
        stack: &mut RayStack,
    ) {
        let ray = if placement == 0 {
            ray
        } else {
            ray.carried(&self.scene.arrangement.placements[placement as usize])
        };
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

    /// Writes the hits of rays, one ray after the other, in f64.
    #[inline(never)]
    fn cast_all_in_f64(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        let mut scratch = ScalarScratch::default();
        for (index, hit) in hits.iter_mut().enumerate() {
            let origin = self.scene.geometry.ray_origin(rays.origin(index));
            let ray = LocalRay { origin, direction: rays.directions[index] };
            let mut best = None;
            self.cast_in_f64(ray, &Limits::of(rays, index), &mut best, &mut scratch);
            *hit = best.map(|best| self.surfaces().hit(ray, &best));
        }
    }

    /// Writes whether rays hit anything, one ray after the other, in f64.
    #[inline(never)]
    fn find_blocked_in_f64(&self, rays: &Rays, blocked: &mut [bool]) {
        let mut scratch = ScalarScratch::default();
        for (index, blocked) in blocked.iter_mut().enumerate() {
            let origin = self.scene.geometry.ray_origin(rays.origin(index));
            let ray = LocalRay { origin, direction: rays.directions[index] };
            let mut best = None;
            self.cast_in_f64(ray, &Limits::of(rays, index), &mut best, &mut scratch);
            *blocked = best.is_some();
        }
    }

    /// Finds the nearest hit of a ray, in f64.
    #[inline(never)]
    fn cast_in_f64(
        &self,
        ray: LocalRay,
        limits: &Limits,
        best: &mut Option<NearestHit>,
        scratch: &mut ScalarScratch,
    ) {
        let ScalarScratch { top, mesh } = scratch;
        if self.top.bvh.nodes.is_empty() {
            return self.intersect_placement_in_f64(0, ray, limits, best, mesh);
        }
        self.top.bvh.traverse(&ray, (limits.t_min, limits.t_max), top, |index| {
            let local = ray.carried(&self.scene.arrangement.placements[index as usize]);
            let count = if limits.after.is_some() { usize::MAX } else { 1 };
            for copy in self.top.with_copies(index).take(count) {
                self.intersect_placement_in_f64(copy, local, limits, best, mesh);
            }
            best.map_or(limits.t_max, |b| b.t)
        });
    }

    /// Replaces `best` by the nearest hit of one ray in one placement, if that is nearer, in f64. The ray is given in the
    /// placement's space.
    #[inline(never)]
    fn intersect_placement_in_f64(
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

impl Cast for Tracer {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        self.cast_counted(rays, hits);
    }

    fn blocked(&self, rays: &Rays, blocked: &mut [bool]) {
        rays.check(blocked.len());
        let done = if rays.after.is_some() {
            self.with_simd(BlockedTask::<true> { tracer: self, rays, blocked: &mut *blocked })
        } else {
            self.with_simd(BlockedTask::<false> { tracer: self, rays, blocked: &mut *blocked })
        };
        done.unwrap_or_else(|| self.find_blocked_in_f64(rays, blocked));
    }
}

/// [`Cast::cast`] as a task. `AFTER` tells whether [`Rays::after`] counts.
struct NearestTask<'a, 'r, const AFTER: bool> {
    tracer: &'a Tracer,
    rays: &'a Rays<'r>,
    hits: &'a mut [Option<Hit>],
}

impl<const AFTER: bool> SimdTask for NearestTask<'_, '_, AFTER> {
    type Output = TraversalStats;

    #[inline(always)]
    fn run<S: F32x8>(self) -> TraversalStats {
        let Self { tracer, rays, hits } = self;
        let mut scratch = SCRATCH.take().unwrap_or_else(Scratch::boxed);
        let before = scratch.stats();
        if AFTER {
            tracer.cast_all_after::<S>(rays, hits, &mut scratch.single);
        } else {
            tracer.cast_all::<S>(rays, hits, &mut scratch);
        }
        let stats = scratch.stats() - before;
        SCRATCH.set(Some(scratch));
        stats
    }
}

/// [`Cast::blocked`] as a task. `AFTER` tells whether [`Rays::after`] counts.
struct BlockedTask<'a, 'r, const AFTER: bool> {
    tracer: &'a Tracer,
    rays: &'a Rays<'r>,
    blocked: &'a mut [bool],
}

impl<const AFTER: bool> SimdTask for BlockedTask<'_, '_, AFTER> {
    type Output = ();

    #[inline(always)]
    fn run<S: F32x8>(self) {
        let Self { tracer, rays, blocked } = self;
        let mut scratch = SCRATCH.take().unwrap_or_else(Scratch::boxed);
        let mut origins = Vec::new();
        let mut nearest = NearestHits::new(rays.t_max);
        for (start, blocked) in (0..).step_by(STREAM_RUN).zip(blocked.chunks_mut(STREAM_RUN)) {
            let batch = tracer.batch(rays, start..start + blocked.len(), &mut origins);
            let mut groups = 0..blocked.len().div_ceil(8);
            while let Some(group) =
                tracer.next_group::<S, AFTER>(&batch, true, &mut groups, &mut nearest, &mut scratch.single)
            {
                for (k, blocked) in blocked[8 * group..].iter_mut().take(8).enumerate() {
                    *blocked = nearest.get(k).is_some();
                }
            }
        }
        SCRATCH.set(Some(scratch));
    }
}

/// About how many rays that are in no packet make one run of a stream: enough that few of them are left at the end with too few
/// others to take turns with, and few enough that their origins stay in the cache.
const STREAM_RUN: usize = 512;

/// The set of the first `count` rays.
fn ones(count: usize) -> RaySet {
    RaySet::MAX >> (PACKET_RAYS - count)
}

thread_local! {
    /// The scratch memory of a thread unless it is in use: tens of kilobytes that need not be allocated in each call.
    static SCRATCH: Cell<Option<Box<Scratch>>> = const { Cell::new(None) };
}

/// How an attempt at a packet ended.
enum PacketEnd {
    /// Its rays have their hits.
    Cast,
    /// Its rays are no narrow pyramid.
    NoPyramid,
    /// It cost more than its rays are expected to cost one by one.
    GivenUp,
}
