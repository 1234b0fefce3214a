//! The tracer: a hierarchy over the placements, whose leaves are hierarchies over the meshes. Neighbouring rays traverse them in
//! packets, other rays in streams or alone.

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::batch::{Batch, NearestHit, NearestHits, PACKET_RAYS, RaySet};
use super::bvh::{self, Bvh8};
use super::exact::LocalRay;
use super::hit_attributes::Surfaces;
use super::maps::Maps;
use super::packet::{self, RayPacket};
use super::policy;
use super::rays::{Cast, Hit, Origins, Rays};
use super::scratch::{Scratch, SingleScratch};
use super::simd::{self, F32x8, SimdTask};
use super::stats::TraversalStats;
use super::stream::{RayStream, Targets};
use super::top::{Bounded, Top, bounds_of};
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
    /// The hierarchy over the placements has a tight box around each.
    tight: bool,
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
            meshes: bvh::build_all(meshes).into(),
            bounds: meshes.par_iter().map(bounds_of).collect::<Vec<_>>().into(),
            shapes: Arc::default(),
            top: Arc::default(),
            scene: scene.clone(),
            instructions: Instructions::Best,
            packets: true,
            tight: true,
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
        let hierarchies = hierarchies_of(shapes);
        let of_meshes = Bounded { bounds: &self.bounds, hierarchies: &self.meshes };
        let of_shapes = Bounded { bounds: &bounds, hierarchies: &hierarchies };
        Self {
            top: Arc::new(Top::new(&scene, of_meshes, of_shapes, self.tight)),
            shapes: hierarchies.into(),
            scene,
            ..self.clone()
        }
    }

    /// The same tracer with boxes around the placements that hold the whole box of the mesh.
    pub(super) fn with_loose_boxes(&self) -> Self {
        Self { tight: false, ..self.clone() }.with_scene(self.scene.clone())
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
            self.with_simd(NearestTask::<true> { tracer: self, rays, found: Found::Hits(&mut *hits) })
        } else {
            self.with_simd(NearestTask::<false> { tracer: self, rays, found: Found::Hits(&mut *hits) })
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
    fn cast_all<S: F32x8>(&self, rays: &Rays, mut found: Found, scratch: &mut Scratch) {
        scratch.begin(matches!(rays.origins, Origins::Each(_)));
        let count = rays.directions.len();
        let mut origins = Vec::new();
        // The pending run of consecutive rays that no packet accepted.
        let mut singles = 0..0;
        for start in (0..count).step_by(PACKET_RAYS) {
            let end = (start + PACKET_RAYS).min(count);
            // Directions often come from memory, so the next ones are prefetched while these are cast.
            for line in (end..(end + PACKET_RAYS).min(count)).step_by(2) {
                S::prefetch(rays.directions.as_ptr().wrapping_add(line).cast());
                if let Origins::Each(origins) = rays.origins {
                    S::prefetch(origins.as_ptr().wrapping_add(line).cast());
                }
            }
            let batch = self.batch(rays, start..end, &mut origins);
            let mut rejected = self.cast_packets::<S>(&batch, found.part(start..end), scratch);
            while rejected != 0 {
                let from = rejected.trailing_zeros() as usize;
                let to = from + (rejected >> from).trailing_ones() as usize;
                rejected &= !(ones(to - from) << from);
                if singles.end != start + from || singles.len() >= STREAM_RUN {
                    self.cast_rejected::<S>(rays, singles, &mut found, &mut origins, scratch);
                    singles = start + from..start + from;
                }
                singles.end = start + to;
            }
        }
        self.cast_rejected::<S>(rays, singles, &mut found, &mut origins, scratch);
    }

    /// Writes the hits of rays that are in no packet, and remembers what they cost.
    #[inline(always)]
    fn cast_rejected<S: F32x8>(
        &self,
        rays: &Rays,
        range: Range<usize>,
        found: &mut Found,
        origins: &mut Vec<DVec3>,
        scratch: &mut Scratch,
    ) {
        if range.is_empty() {
            return;
        }
        let (count, before) = (range.len(), scratch.single.stats());
        let carried = scratch.single.stream.carried();
        self.cast_singles::<S, false>(rays, range, found, origins, &mut scratch.single);
        let effort = scratch.single.stats() - before;
        scratch.policy.measured(count, effort, scratch.single.stream.carried() - carried);
    }

    /// Writes the hits of rays of which some must come after a given hit ([`Rays::after`]). These rays make no packets: a packet
    /// has one least depth for all its rays, and such rays have one each.
    #[inline(always)]
    fn cast_all_after<S: F32x8>(&self, rays: &Rays, mut found: Found, scratch: &mut SingleScratch) {
        let mut origins = Vec::new();
        let count = rays.directions.len();
        for start in (0..count).step_by(STREAM_RUN) {
            let run = start..(start + STREAM_RUN).min(count);
            self.cast_singles::<S, true>(rays, run, &mut found, &mut origins, scratch);
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
                    geometry.ray_origins(all, buffer);
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
    fn cast_packets<S: F32x8>(&self, batch: &Batch, mut found: Found, scratch: &mut Scratch) -> RaySet {
        let ray_count = batch.directions.len();
        if !self.packets || scratch.policy.begin_tile() == 0 {
            return ones(ray_count);
        }
        let mut pending = [(0, 0); 8];
        pending[0] = (0, ray_count);
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
                match self.cast_packet::<S>(&part, found.is_any(), &mut nearest, scratch) {
                    PacketEnd::Cast => {
                        let maps = &mut scratch.single.maps;
                        found.part(from..to).write::<S>(&self.surfaces(), &part, &nearest, maps);
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
        found: &mut Found,
        origins: &mut Vec<DVec3>,
        scratch: &mut SingleScratch,
    ) {
        if range.is_empty() {
            return;
        }
        let mut found = found.part(range.clone());
        let batch = self.batch(rays, range, origins);
        let mut nearest = NearestHits::new(batch.t_max);
        while let Some(group) = self.next_group::<S, AFTER>(&batch, found.is_any(), &mut nearest, scratch) {
            let rays = 8 * group..(8 * group + 8).min(batch.directions.len());
            let (part, maps) = (batch.part(rays.clone()), &mut scratch.maps);
            found.part(rays).write::<S>(&self.surfaces(), &part, &nearest, maps);
        }
    }

    /// Finds the nearest hits (any hits, if `any`) of up to [`PACKET_RAYS`] rays, unless they are better cast one by one.
    #[inline(always)]
    fn cast_packet<S: F32x8>(
        &self,
        rays: &Batch,
        any: bool,
        nearest: &mut NearestHits,
        scratch: &mut Scratch,
    ) -> PacketEnd {
        match rays.origins {
            Origins::Common(_) => self.cast_packet_of::<S, false>(rays, any, nearest, scratch),
            Origins::Each(_) => self.cast_packet_of::<S, true>(rays, any, nearest, scratch),
        }
    }

    #[inline(always)]
    fn cast_packet_of<S: F32x8, const MULTI_ORIGIN: bool>(
        &self,
        rays: &Batch,
        any: bool,
        nearest: &mut NearestHits,
        scratch: &mut Scratch,
    ) -> PacketEnd {
        if !self.top.bvh.nodes.is_empty() {
            return self.cast_packet_among::<S, MULTI_ORIGIN>(rays, any, nearest, scratch);
        }
        let Scratch { mesh: stack, mesh_rays, policy, .. } = scratch;
        let ray_count = rays.directions.len();
        let budget = policy.budget(ray_count);
        let Some(mut packet) = RayPacket::<MULTI_ORIGIN>::new::<S>(
            &self.meshes[0],
            0,
            rays.origins,
            rays.directions,
            (rays.t_min, rays.t_max),
            nearest,
            mesh_rays,
        ) else {
            return PacketEnd::NoPyramid;
        };
        let Some(work) = packet.traverse_mesh::<S>(stack, budget) else {
            policy.gave_up(ray_count);
            return PacketEnd::GivenUp;
        };
        packet.write_hits::<S>(nearest, false);
        policy.succeeded(ray_count, work);
        PacketEnd::Cast
    }

    /// Finds the nearest hits (any hits, if `any`) of eight more rays of a batch, and returns which group of eight it was.
    /// Groups come in any order.
    #[inline(always)]
    fn next_group<S: F32x8, const AFTER: bool>(
        &self,
        rays: &Batch,
        any: bool,
        nearest: &mut NearestHits,
        scratch: &mut SingleScratch,
    ) -> Option<usize> {
        let is_placed = !self.top.bvh.nodes.is_empty();
        let targets = Targets { top: &self.top, surfaces: self.surfaces() };
        let SingleScratch { stream, maps, .. } = scratch;
        let (group, mut rest) = if is_placed {
            S::run(NextGroup::<AFTER, true> { stream, targets, rays, any, nearest, maps })?
        } else {
            S::run(NextGroup::<AFTER, false> { stream, targets, rays, any, nearest, maps })?
        };
        while rest != 0 {
            let k = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let mut best = None;
            let ray = 8 * group + k;
            let limits = rays.limits::<AFTER>(ray);
            let alone = rays.ray(ray);
            if is_placed {
                self.cast_single::<S, AFTER>(alone, rays.time_s(ray), &limits, any, &mut best, scratch);
            } else {
                self.intersect_mesh::<S, AFTER>(0, alone, &limits, any, &mut best, &mut scratch.mesh);
            }
            nearest.set(k, best);
        }
        Some(group)
    }
}

/// [`RayStream::next_group`] as a task, to keep its code out of that for packets.
struct NextGroup<'a, 'r, const AFTER: bool, const PLACED: bool> {
    stream: &'a mut RayStream,
    targets: Targets<'a>,
    rays: &'a Batch<'r>,
    any: bool,
    nearest: &'a mut NearestHits,
    maps: &'a mut Maps,
}

impl<const AFTER: bool, const PLACED: bool> SimdTask for NextGroup<'_, '_, AFTER, PLACED> {
    type Output = Option<(usize, u32)>;

    #[inline(always)]
    fn run<S: F32x8>(self) -> Option<(usize, u32)> {
        let Self { stream, targets, rays, any, nearest, maps } = self;
        stream.next_group::<S, AFTER, PLACED>(&targets, rays, any, nearest, maps)
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
        let done = match rays.origins {
            _ if rays.after.is_some() => {
                self.with_simd(BlockedTask::<true> { tracer: self, rays, blocked: &mut *blocked })
            }
            // Rays from one point make packets.
            Origins::Common(_) => {
                let found = Found::Blocked(&mut *blocked);
                self.with_simd(NearestTask::<false> { tracer: self, rays, found }).map(|_| ())
            }
            Origins::Each(_) => {
                self.with_simd(BlockedTask::<false> { tracer: self, rays, blocked: &mut *blocked })
            }
        };
        done.unwrap_or_else(|| self.find_blocked_in_f64(rays, blocked));
    }
}

/// The answers about rays: their nearest hits, or whether they hit anything.
enum Found<'a> {
    Hits(&'a mut [Option<Hit>]),
    Blocked(&'a mut [bool]),
}

impl Found<'_> {
    /// Whether any hit will do.
    fn is_any(&self) -> bool {
        matches!(self, Self::Blocked(_))
    }

    /// The answers about some consecutive rays.
    fn part(&mut self, rays: Range<usize>) -> Found<'_> {
        match self {
            Self::Hits(hits) => Found::Hits(&mut hits[rays]),
            Self::Blocked(blocked) => Found::Blocked(&mut blocked[rays]),
        }
    }

    /// Writes what was found of a batch of at most [`PACKET_RAYS`] rays.
    #[inline(always)]
    fn write<S: F32x8>(self, surfaces: &Surfaces, rays: &Batch, nearest: &NearestHits, maps: &mut Maps) {
        match self {
            Self::Hits(hits) => surfaces.write_hits::<S>(rays, nearest, hits, maps),
            Self::Blocked(blocked) => {
                for (ray, blocked) in blocked.iter_mut().enumerate() {
                    *blocked = nearest.hit >> ray & 1 != 0;
                }
            }
        }
    }
}

/// [`Cast::cast`] as a task. `AFTER` tells whether [`Rays::after`] counts.
struct NearestTask<'a, 'r, const AFTER: bool> {
    tracer: &'a Tracer,
    rays: &'a Rays<'r>,
    found: Found<'a>,
}

impl<const AFTER: bool> SimdTask for NearestTask<'_, '_, AFTER> {
    type Output = TraversalStats;

    #[inline(always)]
    fn run<S: F32x8>(self) -> TraversalStats {
        let Self { tracer, rays, found } = self;
        let mut scratch = tracer.take_scratch();
        let before = scratch.stats();
        if AFTER {
            tracer.cast_all_after::<S>(rays, found, &mut scratch.single);
        } else {
            tracer.cast_all::<S>(rays, found, &mut scratch);
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
            while let Some(group) =
                tracer.next_group::<S, AFTER>(&batch, true, &mut nearest, &mut scratch.single)
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
pub(super) enum PacketEnd {
    /// Its rays have their hits.
    Cast,
    /// Its rays are no narrow pyramid.
    NoPyramid,
    /// It cost more than its rays are expected to cost one by one.
    GivenUp,
}
