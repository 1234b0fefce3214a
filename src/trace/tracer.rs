//! The tracer: a hierarchy over the placements, whose leaves are hierarchies over the meshes. Neighbouring rays traverse them in
//! packets, other rays in streams or alone.

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::batch::{Batch, NearestHit, NearestHits, PACKET_RAYS, RaySet};
use super::bvh::{self, Bvh8};
use super::exact::{self, Limits, LocalRay};
use super::hit_attributes::Surfaces;
use super::packet::{self, RayPacket};
use super::policy::{self, PACKET_NODE, PACKET_RAY};
use super::rays::{Cast, Hit, Origins, Rays};
use super::scratch::{Scratch, SingleScratch};
use super::simd::{self, F32x8, SimdTask};
use super::single::{RayStack, SingleRay};
use super::stats::TraversalStats;
use super::top::{Top, bounds_of};
use crate::scene::bounds::Bounds;
use crate::scene::{Arrangement, Mesh, Scene};

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
    /// The hierarchies of the shapes of meshes that bend, which follow those of the meshes.
    shapes: Arc<[Bvh8]>,
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
        let unarranged = Self {
            meshes: meshes.iter().map(bvh::build).collect(),
            bounds: meshes.iter().map(bounds_of).collect(),
            shapes: Arc::default(),
            top: Arc::default(),
            scene: scene.clone(),
            instructions: Instructions::Best,
            packets: true,
        };
        unarranged.with_scene(scene.clone())
    }

    /// A tracer of the same geometry, arranged otherwise, such as for another frame ([`Scene::during`]). Only the hierarchy over the
    /// placements is built again, which takes milliseconds for tens of thousands of them, and those of [`Arrangement::shapes`]; the
    /// meshes and their hierarchies are shared with this tracer.
    ///
    /// # Panics
    /// If the arrangement is not one of the scene's geometry: see [`Scene::rearranged`].
    pub fn rearranged(&self, arrangement: Arc<Arrangement>) -> Self {
        self.with_scene(self.scene.rearranged(arrangement))
    }

    /// A tracer of a scene of the same geometry.
    fn with_scene(&self, scene: Scene) -> Self {
        let shapes = &scene.arrangement.shapes;
        let bounds: Vec<Bounds> = shapes.par_iter().map(bounds_of).collect();
        Self {
            top: Arc::new(Top::new(&scene, &self.bounds, &bounds)),
            shapes: hierarchies_of(shapes).into(),
            scene,
            ..self.clone()
        }
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
        let hierarchies = self.meshes.iter().chain(&*self.shapes);
        self.top.bytes() + hierarchies.map(Bvh8::bytes).sum::<usize>()
    }

    /// [`Cast::cast`], and the work that it took. ([`Instructions::Scalar`] counts nothing.)
    ///
    /// # Panics
    /// As [`Cast::cast`] does.
    pub fn cast_counted(&self, rays: &Rays, hits: &mut [Option<Hit>]) -> TraversalStats {
        rays.check(hits.len(), &self.scene.arrangement);
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

    /// The thread's scratch memory, ready for rays in the tracer's scene.
    fn take_scratch(&self) -> Box<Scratch> {
        let mut scratch = SCRATCH.take().unwrap_or_else(Scratch::boxed);
        if self.scene.arrangement.window.is_some() {
            scratch.single.maps.clear();
        }
        scratch
    }

    /// The whole hit of a ray in the scene's space. `None` if what it hits were nowhere at its time.
    pub(super) fn whole_hit(&self, ray: LocalRay, time_s: Option<f64>, hit: &NearestHit) -> Option<Hit> {
        let placement = &self.scene.arrangement.placements[hit.placement as usize];
        let map = if placement.is_moving() {
            placement.mesh_from_scene_at(time_s?)?
        } else {
            *placement.mesh_from_scene()
        };
        Some(self.surfaces().hit(ray, &map, hit))
    }

    #[inline(always)]
    pub(super) fn surfaces(&self) -> Surfaces<'_> {
        Surfaces {
            placements: &self.scene.arrangement.placements,
            meshes: &self.meshes,
            shapes: &self.shapes,
        }
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
        Batch {
            origins,
            directions: &rays.directions[range.clone()],
            t_min: rays.t_min,
            t_max: rays.t_max,
            after: rays.after.map(|after| &after[range.clone()]),
            times_s: rays.times_s.map(|times_s| &times_s[range]),
        }
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
                        let maps = &mut scratch.single.maps;
                        self.surfaces().write_hits::<S>(&part, &nearest, &mut hits[from..to], maps);
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
            let (part, maps) = (batch.part(rays.clone()), &mut scratch.maps);
            self.surfaces().write_hits::<S>(&part, &nearest, &mut hits[rays], maps);
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
            let mut map = placement.mesh_from_scene();
            let moved;
            if placement.is_moving() {
                if rays.are_of_one_time() {
                    let Some(at) = single.maps.of(index, placement, rays.time_s(0)) else { continue };
                    moved = *at;
                    map = &moved;
                } else {
                    let more = self.visit_moving::<S>(
                        index,
                        rays,
                        budget - done,
                        nearest,
                        (mesh_stack, mesh_rays),
                        [directions, origin_buffer],
                        single,
                        policy.single_work(1),
                    );
                    let Some(more) = more else {
                        policy.gave_up(ray_count);
                        return PacketEnd::GivenUp;
                    };
                    work += more;
                    top.update_depths(nearest);
                    continue;
                }
            }
            let origins = exact::carry(map, rays.origins, rays.directions, directions, origin_buffer);
            let bvh = self.surfaces().bvh_of_mesh(placement.mesh);
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
                    let (local, ray_stack) = (rays.ray(ray).carried_by(map), &mut single.mesh);
                    self.intersect_mesh::<S, false>(index, local, &limits, false, &mut best, ray_stack);
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
                let time_s = rays.time_s(ray);
                self.cast_single::<S, AFTER>(rays.ray(ray), time_s, &limits, any, &mut best, scratch);
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
            let (alone, stack) = (rays.ray(ray), &mut scratch.mesh);
            self.intersect_mesh::<S, AFTER>(0, alone, &limits, any, &mut best, stack);
            nearest.set(k, best);
        }
        Some(group)
    }

    /// Finds the nearest hit of one ray (any hit, if `any`) in a scene with a hierarchy over placements.
    #[inline(always)]
    fn cast_single<S: F32x8, const AFTER: bool>(
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
            let local = if index == 0 {
                ray
            } else {
                let placement = &self.scene.arrangement.placements[index as usize];
                let Some(map) = scratch.maps.of(index, placement, time_s) else { continue };
                ray.carried_by(map)
            };
            let stack = &mut scratch.mesh;
            if AFTER {
                for copy in self.top.with_copies(index) {
                    self.intersect_mesh::<S, AFTER>(copy, local, limits, any, best, stack);
                }
            } else {
                self.intersect_mesh::<S, AFTER>(index, local, limits, any, best, stack);
            }
            if let Some(best) = best {
                if any {
                    return;
                }
                top.limit(best.t);
            }
        }
    }

    /// Replaces `best` by the nearest hit of one ray in one placement, if that is nearer. The ray is given in the placement's space.
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

/// The hierarchies of shapes. Shapes of one mesh follow each other, and have the same triangles: a tree is sought for one of them,
/// and fitted to the others, which costs a fraction of that.
fn hierarchies_of(shapes: &[Mesh]) -> Vec<Bvh8> {
    let of_mesh = |shapes: &[Mesh]| -> Vec<Bvh8> {
        let middle = shapes.len() / 2;
        let built = bvh::build(&shapes[middle]);
        let (before, after) = (&shapes[..middle], &shapes[middle + 1..]);
        let [before, after]: [Vec<Bvh8>; 2] =
            [before, after].map(|some| some.par_iter().map(|shape| built.refitted(shape)).collect());
        before.into_iter().chain([built]).chain(after).collect()
    };
    shapes.par_chunk_by(|a, b| a.triangles == b.triangles).flat_map(of_mesh).collect()
}

impl Cast for Tracer {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        self.cast_counted(rays, hits);
    }

    fn blocked(&self, rays: &Rays, blocked: &mut [bool]) {
        rays.check(blocked.len(), &self.scene.arrangement);
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
        let mut scratch = tracer.take_scratch();
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
        let mut scratch = tracer.take_scratch();
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
pub(super) fn ones(count: usize) -> RaySet {
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
