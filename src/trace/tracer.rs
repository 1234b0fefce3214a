//! The tracer: a hierarchy of placements over a hierarchy a mesh, walked by packets.

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::bounds::Bounds;
use super::bvh::{self, Bvh8, Child, LeafBlock, TriangleRef};
use super::exact::{self, Candidate, Corners, LocalRay, Xyz};
use super::hit_attributes::eight;
use super::packet::{self, NearestHits, PACKET_RAYS, PerRay, RayPacket};
use super::simd::{self, F32x8, F64x8, PortableF32x8, SimdTask};
use super::single::{SingleRay, Stack};
use super::stream::RayStream;
use super::{Cast, Hit, Origins, Rays, TraversalStats};
use crate::scene::{Arrangement, Mesh, Placement, Scene};

/// Finds the hits that [`BruteForce`](super::BruteForce) finds, bit for bit, and fast.
///
/// A tracer owns all that it needs and shares it with its clones, so a clone costs four reference counts. Rays are taken 128
/// at a time as they come: a batch's neighbours should be neighbours in space.
#[derive(Clone, Debug)]
pub struct Tracer {
    pub(super) scene: Scene,
    /// The hierarchy over the triangles of each mesh.
    pub(super) meshes: Arc<[Bvh8]>,
    /// The bounds of each mesh in its own space.
    bounds: Arc<[Bounds]>,
    /// The hierarchy over the placements; without nodes if mesh 0 is the only mesh.
    pub(super) top: Arc<Bvh8>,
    instructions: Instructions,
    packets: bool,
}

/// How a [`Tracer`] computes. The hits are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// The best that the processor has.
    Best,
    /// AVX2 and FMA at most.
    Avx2,
    /// Those of any processor.
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
            top: Arc::new(over_placements(scene, &bounds)),
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
        Self { top: Arc::new(over_placements(&scene, &self.bounds)), scene, ..self.clone() }
    }

    /// The scene that rays are cast against.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The same with other instructions.
    pub fn with_instructions(self, instructions: Instructions) -> Self {
        Self { instructions, ..self }
    }

    /// The same without packets: each ray by itself.
    pub fn ray_by_ray(self) -> Self {
        Self { packets: false, ..self }
    }

    /// The bytes held in addition to the scene.
    pub fn bytes(&self) -> usize {
        self.top.bytes() + self.meshes.iter().map(Bvh8::bytes).sum::<usize>()
    }

    /// [`Cast::cast`], and what it took. (Nothing is counted of [`Instructions::Scalar`].)
    ///
    /// # Panics
    /// As [`Cast::cast`].
    pub fn cast_counted(&self, rays: &Rays, hits: &mut [Option<Hit>]) -> TraversalStats {
        rays.check(hits.len());
        match self.with_simd(All { tracer: self, rays, hits }) {
            Ok(stats) => stats,
            Err(all) => {
                self.cast_all_in_f64(all.rays, all.hits);
                TraversalStats::default()
            }
        }
    }

    /// Does something with the best lanes that there are; gives it back if there are to be none.
    #[inline]
    fn with_simd<W: SimdTask>(&self, work: W) -> Result<W::Output, W> {
        Ok(match self.instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Best if simd::has_avx512() => simd::run_with_avx512(work),
            #[cfg(target_arch = "x86_64")]
            Instructions::Best | Instructions::Avx2 if simd::has_avx2() => simd::run_with_avx2(work),
            Instructions::Best | Instructions::Avx2 | Instructions::Portable => work.run::<PortableF32x8>(),
            Instructions::Scalar => return Err(work),
        })
    }

    /// The hits of rays, by any kind of lanes: packet by packet.
    #[inline(always)]
    fn cast_all<S: F32x8>(&self, rays: &Rays, hits: &mut [Option<Hit>]) -> TraversalStats {
        let mut room = SCRATCH.take().unwrap_or_default();
        let before = room.stats();
        let mut origins = Vec::new();
        // Those in no packet, in one row as far as they go.
        let mut singles = 0..0;
        for start in (0..hits.len()).step_by(PACKET_RAYS) {
            let end = (start + PACKET_RAYS).min(hits.len());
            // Directions come from memory as often as not: ask for the next ones while these are at work.
            for line in (end..(end + PACKET_RAYS).min(hits.len())).step_by(2) {
                S::prefetch(rays.directions.as_ptr().wrapping_add(line).cast());
                if let Origins::Each(origins) = rays.origins {
                    S::prefetch(origins.as_ptr().wrapping_add(line).cast());
                }
            }
            let batch = self.batch(rays, start..end, &mut origins);
            let mut apart = self.cast_batch::<S>(&batch, &mut hits[start..end], &mut room);
            while apart != 0 {
                let from = apart.trailing_zeros() as usize;
                let to = from + (apart >> from).trailing_ones() as usize;
                apart &= !(ones(to - from) << from);
                if singles.end != start + from || singles.len() >= MANY {
                    self.cast_singles::<S>(rays, singles, hits, &mut origins, &mut room.single);
                    singles = start + from..start + from;
                }
                singles.end = start + to;
            }
        }
        self.cast_singles::<S>(rays, singles, hits, &mut origins, &mut room.single);
        let stats = room.stats() - before;
        SCRATCH.set(Some(room));
        stats
    }

    /// Some of the rays, in the scene's space; `room` is for their origins.
    #[inline(always)]
    fn batch<'r>(&self, rays: &Rays<'r>, range: Range<usize>, room: &'r mut Vec<DVec3>) -> Batch<'r> {
        let centre = self.scene.geometry.centre;
        let origins = match rays.origins {
            Origins::Common(origin) => Origins::Common(origin - centre),
            Origins::Each(all) => {
                let all = &all[range.clone()];
                if all.iter().all(|o| *o == all[0]) {
                    Origins::Common(all[0] - centre)
                } else {
                    room.clear();
                    room.extend(all.iter().map(|&origin| origin - centre));
                    Origins::Each(room)
                }
            }
        };
        Batch { origins, directions: &rays.directions[range], t_min: rays.t_min, t_max: rays.t_max }
    }

    /// The hits of those of up to [`PACKET_RAYS`] rays that are packets; gives the others, a bit each.
    #[inline(always)]
    fn cast_batch<S: F32x8>(&self, batch: &Batch, hits: &mut [Option<Hit>], room: &mut Scratch) -> u128 {
        let mut pending = [(0, 0); 8];
        pending[0] = (0, hits.len());
        let mut count = 1;
        let top = if self.top.nodes.is_empty() { &self.meshes[0] } else { &self.top };
        // Rays that are in no packet, a bit each.
        let mut apart = 0_u128;
        while count > 0 {
            count -= 1;
            let (from, to) = pending[count];
            let part = batch.part(from..to);
            // A packet takes as long as a few single rays; those that start apart and are no packet at once are seldom one
            // in pieces.
            let least = if matches!(part.origins, Origins::Common(_)) { 4 } else { PACKET_RAYS / 4 };
            if self.packets && to - from >= 4 && packet::may_be_packet(top, part.origins) {
                let mut nearest = NearestHits::new(part.t_max);
                if self.cast_packet::<S>(&part, &mut nearest, room) {
                    self.write_hits::<S>(&part, &nearest, &mut hits[from..to]);
                    continue;
                }
            }
            if self.packets && to - from > least {
                // No narrow pyramid; its halves may be.
                let middle = from + (to - from) / 2;
                (pending[count], pending[count + 1]) = ((middle, to), (from, middle));
                count += 2;
                continue;
            }
            apart |= ones(to - from) << from;
        }
        apart
    }

    /// The hits of rays that are in no packet.
    #[inline(always)]
    fn cast_singles<S: F32x8>(
        &self,
        rays: &Rays,
        range: Range<usize>,
        hits: &mut [Option<Hit>],
        origins: &mut Vec<DVec3>,
        room: &mut SingleScratch,
    ) {
        if range.is_empty() {
            return;
        }
        let hits = &mut hits[range.clone()];
        let batch = self.batch(rays, range, origins);
        let mut nearest = NearestHits::new(batch.t_max);
        let mut eights = 0..hits.len().div_ceil(8);
        while let Some(eight) = self.next_eight::<S>(&batch, false, &mut eights, &mut nearest, room) {
            let rays = 8 * eight..(8 * eight + 8).min(hits.len());
            self.write_hits::<S>(&batch.part(rays.clone()), &nearest, &mut hits[rays]);
        }
    }

    /// The nearest hits of up to [`PACKET_RAYS`] rays; false if they are no narrow pyramid.
    #[inline(always)]
    fn cast_packet<S: F32x8>(&self, rays: &Batch, nearest: &mut NearestHits, room: &mut Scratch) -> bool {
        match rays.origins {
            Origins::Common(_) => self.cast_packet_of::<S, false>(rays, nearest, room),
            Origins::Each(_) => self.cast_packet_of::<S, true>(rays, nearest, room),
        }
    }

    #[inline(always)]
    fn cast_packet_of<S: F32x8, const MULTI_ORIGIN: bool>(
        &self,
        rays: &Batch,
        nearest: &mut NearestHits,
        room: &mut Scratch,
    ) -> bool {
        let limits = (rays.t_min, rays.t_max);
        let Scratch {
            top: stack,
            mesh: mesh_stack,
            carried,
            carried_origins,
            single,
            rays: of_top,
            rays_of_mesh,
        } = room;
        if self.top.nodes.is_empty() {
            let bvh = &self.meshes[0];
            let Some(mut packet) = RayPacket::<MULTI_ORIGIN>::new::<S>(
                bvh,
                0,
                rays.origins,
                rays.directions,
                limits,
                nearest,
                rays_of_mesh,
            ) else {
                return false;
            };
            packet.walk_mesh::<S>(mesh_stack);
            packet.leave(nearest, false);
            return true;
        }
        let Some(mut top) = RayPacket::<MULTI_ORIGIN>::new::<S>(
            &self.top,
            0,
            rays.origins,
            rays.directions,
            limits,
            nearest,
            of_top,
        ) else {
            return false;
        };
        top.enter_root::<S>(stack);
        while let Some(leaf) = top.next_leaf::<S>(stack) {
            let index = leaf.number;
            let placement = &self.scene.arrangement.placements[index as usize];
            let origins = exact::carry(placement, rays.origins, rays.directions, carried, carried_origins);
            let bvh = &self.meshes[placement.mesh as usize];
            if let Some(mut packet) = RayPacket::<MULTI_ORIGIN>::new::<S>(
                bvh,
                index,
                origins,
                carried,
                limits,
                nearest,
                rays_of_mesh,
            ) {
                packet.walk_mesh::<S>(mesh_stack);
                packet.leave(nearest, true);
            } else {
                for ray in 0..rays.directions.len() {
                    let mut best = nearest.get(ray);
                    self.single_in::<S>(index, rays.ray(ray), limits, false, &mut best, &mut single.mesh);
                    nearest.set(ray, best);
                }
            }
            top.update(nearest);
        }
        true
    }

    /// The nearest hits, or with `any` hits, of eight more rays of a batch: which eight. `eights` are those to come where rays
    /// are taken one by one.
    #[inline(always)]
    fn next_eight<S: F32x8>(
        &self,
        rays: &Batch,
        any: bool,
        eights: &mut Range<usize>,
        nearest: &mut NearestHits,
        room: &mut SingleScratch,
    ) -> Option<usize> {
        let limits = (rays.t_min, rays.t_max);
        if !self.top.nodes.is_empty() {
            let eight = eights.next()?;
            nearest.clear();
            for k in 0..(rays.directions.len() - 8 * eight).min(8) {
                let mut best = None;
                self.cast_single::<S>(rays.ray(8 * eight + k), limits, any, &mut best, room);
                nearest.set(k, best);
            }
            return Some(eight);
        }
        let (eight, mut rest) = room.stream.next_eight::<S>(&self.meshes[0], rays, any, nearest)?;
        while rest != 0 {
            let k = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let mut best = None;
            self.single_in::<S>(0, rays.ray(8 * eight + k), limits, any, &mut best, &mut room.mesh);
            nearest.set(k, best);
        }
        Some(eight)
    }

    /// The nearest hit of one ray, or with `any` a hit, where there are placements.
    #[inline(always)]
    fn cast_single<S: F32x8>(
        &self,
        ray: LocalRay,
        limits: (f64, f64),
        any: bool,
        best: &mut Option<NearestHit>,
        room: &mut SingleScratch,
    ) {
        let Some(mut top) = SingleRay::new::<S>(ray, self.top.largest, limits) else {
            return self.cast_in_f64(ray, limits, best, &mut room.scalar);
        };
        room.top.start(&self.top);
        while let Some(index) = top.next_leaf::<S>(&self.top, &mut room.top) {
            self.single_in::<S>(index, ray, limits, any, best, &mut room.mesh);
            if let Some(best) = best {
                if any {
                    return;
                }
                top.limit(best.t);
            }
        }
    }

    /// Betters `best` by what one ray, of the scene's space, hits in a placement.
    #[inline(always)]
    fn single_in<S: F32x8>(
        &self,
        placement: u32,
        ray: LocalRay,
        limits: (f64, f64),
        any: bool,
        best: &mut Option<NearestHit>,
        stack: &mut Stack,
    ) {
        let ray = if placement == 0 {
            ray
        } else {
            ray.carried(&self.scene.arrangement.placements[placement as usize])
        };
        let bvh = self.bvh(placement);
        let Some(mut single) = SingleRay::new::<S>(ray, bvh.largest, limits) else {
            return self.nearest_in(placement, ray, limits, best, &mut Vec::new());
        };
        if let Some(best) = best {
            single.limit(best.t);
        }
        stack.start(bvh);
        while let Some(block_offset) = single.next_leaf::<S>(bvh, stack) {
            if single.test_leaf::<S>(bvh, block_offset, placement, limits, best, &mut stack.stats) && any {
                return;
            }
        }
    }

    /// The hits of rays taken one by one, in f64.
    #[inline(never)]
    fn cast_all_in_f64(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        let mut room = ScalarScratch::default();
        for (ray, hit) in hits.iter_mut().enumerate() {
            let ray = LocalRay {
                origin: rays.origin(ray) - self.scene.geometry.centre,
                direction: rays.directions[ray],
            };
            let mut best: Option<NearestHit> = None;
            self.cast_in_f64(ray, (rays.t_min, rays.t_max), &mut best, &mut room);
            *hit = best.map(|best| self.finish(ray, &best));
        }
    }

    /// The nearest hit of a ray, in f64.
    #[inline(never)]
    fn cast_in_f64(
        &self,
        ray: LocalRay,
        limits: (f64, f64),
        best: &mut Option<NearestHit>,
        room: &mut ScalarScratch,
    ) {
        let ScalarScratch { top, mesh } = room;
        if self.top.nodes.is_empty() {
            return self.nearest_in(0, ray, limits, best, mesh);
        }
        self.top.traverse(&ray, limits, top, |index| {
            let local = ray.carried(&self.scene.arrangement.placements[index as usize]);
            self.nearest_in(index, local, limits, best, mesh);
            best.map_or(limits.1, |b| b.t)
        });
    }

    /// Betters `best` by what one ray, in the placement's space, hits there; in f64.
    #[inline(never)]
    fn nearest_in(
        &self,
        placement: u32,
        ray: LocalRay,
        (t_min, t_max): (f64, f64),
        best: &mut Option<NearestHit>,
        stack: &mut Vec<(Child, f64)>,
    ) {
        let bvh = self.bvh(placement);
        let far = best.map_or(t_max, |b| b.t);
        bvh.traverse(&ray, (t_min, far), stack, |block_offset| {
            let block = LeafBlock::at(&bvh.blocks, block_offset);
            for lane in 0..block.triangles {
                let corners = Corners::from_positions(block.positions(lane), ray.origin);
                if !corners.passes(ray.direction) {
                    continue;
                }
                let t = corners.depth(ray.direction);
                let found = Candidate { t, placement, triangle: block.id(lane) };
                if (t_min..=t_max).contains(&t) && best.is_none_or(|b| found.beats(&self.candidate(&b))) {
                    *best = Some(NearestHit { t, placement, slot: TriangleRef::new(block_offset, lane) });
                }
            }
            best.map_or(t_max, |b| b.t)
        });
    }

    pub(super) fn bvh(&self, placement: u32) -> &Bvh8 {
        &self.meshes[self.scene.arrangement.placements[placement as usize].mesh as usize]
    }

    fn candidate(&self, best: &NearestHit) -> Candidate {
        let block = LeafBlock::at(&self.bvh(best.placement).blocks, best.slot.block_offset());
        Candidate { t: best.t, placement: best.placement, triangle: block.id(best.slot.lane()) }
    }

    /// The whole hit of a ray in the scene's space.
    fn finish(&self, ray: LocalRay, best: &NearestHit) -> Hit {
        let placement = &self.scene.arrangement.placements[best.placement as usize];
        let local = ray.carried(placement);
        let block = LeafBlock::at(&self.bvh(best.placement).blocks, best.slot.block_offset());
        let corners = Corners::from_positions(block.positions(best.slot.lane()), local.origin);
        self.candidate(best).finish(&corners, local.direction, placement)
    }
}

impl Cast for Tracer {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        self.cast_counted(rays, hits);
    }

    fn blocked(&self, rays: &Rays, blocked: &mut [bool]) {
        rays.check(blocked.len());
        if let Err(any) = self.with_simd(Any { tracer: self, rays, blocked }) {
            any.run_in_f64();
        }
    }
}

/// [`Cast::cast`].
struct All<'a, 'r> {
    tracer: &'a Tracer,
    rays: &'a Rays<'r>,
    hits: &'a mut [Option<Hit>],
}

impl SimdTask for All<'_, '_> {
    type Output = TraversalStats;

    #[inline(always)]
    fn run<S: F32x8>(self) -> TraversalStats {
        self.tracer.cast_all::<S>(self.rays, self.hits)
    }
}

/// [`Cast::blocked`].
struct Any<'a, 'r> {
    tracer: &'a Tracer,
    rays: &'a Rays<'r>,
    blocked: &'a mut [bool],
}

impl Any<'_, '_> {
    fn run_in_f64(self) {
        let Self { tracer, rays, blocked } = self;
        let mut room = ScalarScratch::default();
        for (ray, blocked) in blocked.iter_mut().enumerate() {
            let origin = rays.origin(ray) - tracer.scene.geometry.centre;
            let ray = LocalRay { origin, direction: rays.directions[ray] };
            let mut best = None;
            tracer.cast_in_f64(ray, (rays.t_min, rays.t_max), &mut best, &mut room);
            *blocked = best.is_some();
        }
    }
}

impl SimdTask for Any<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: F32x8>(self) {
        let Self { tracer, rays, blocked } = self;
        let mut room = SCRATCH.take().unwrap_or_default();
        let mut origins = Vec::new();
        let mut nearest = NearestHits::new(rays.t_max);
        for (start, blocked) in (0..).step_by(MANY).zip(blocked.chunks_mut(MANY)) {
            let batch = tracer.batch(rays, start..start + blocked.len(), &mut origins);
            let mut eights = 0..blocked.len().div_ceil(8);
            while let Some(eight) =
                tracer.next_eight::<S>(&batch, true, &mut eights, &mut nearest, &mut room.single)
            {
                for (k, blocked) in blocked[8 * eight..].iter_mut().take(8).enumerate() {
                    *blocked = nearest.get(k).is_some();
                }
            }
        }
        SCRATCH.set(Some(room));
    }
}

/// Rays of the scene's space.
#[derive(Clone, Copy)]
pub(super) struct Batch<'r> {
    pub origins: Origins<'r>,
    pub directions: &'r [DVec3],
    pub t_min: f64,
    pub t_max: f64,
}

impl Batch<'_> {
    #[inline(always)]
    pub fn origin(&self, ray: usize) -> DVec3 {
        match self.origins {
            Origins::Common(origin) => origin,
            Origins::Each(origins) => origins[ray],
        }
    }

    #[inline(always)]
    pub fn ray(&self, ray: usize) -> LocalRay {
        LocalRay { origin: self.origin(ray), direction: self.directions[ray] }
    }

    /// Origins and directions of a group of eight, filled up with the last one's.
    #[inline(always)]
    pub fn eight<S: F32x8>(&self, group: usize) -> (Xyz<S::F64x8>, Xyz<S::F64x8>) {
        let mut room = [DVec3::ZERO; 8];
        let [x, y, z] = S::F64x8::load_xyz(eight(self.directions, group, &mut room));
        let direction = Xyz(x, y, z);
        let origin = match self.origins {
            Origins::Common(origin) => Xyz::constant(origin),
            Origins::Each(origins) => {
                let [x, y, z] = S::F64x8::load_xyz(eight(origins, group, &mut room));
                Xyz(x, y, z)
            }
        };
        (origin, direction)
    }

    #[inline(always)]
    fn part(&self, range: Range<usize>) -> Self {
        let origins = match self.origins {
            Origins::Common(origin) => Origins::Common(origin),
            Origins::Each(origins) => Origins::Each(&origins[range.clone()]),
        };
        Self { origins, directions: &self.directions[range], ..*self }
    }
}

/// About how many rays in no packet are taken together: so many that few are left without company at the end, and that their
/// origins stay in the cache.
const MANY: usize = 512;

/// So many bits from the lowest on.
fn ones(count: usize) -> u128 {
    u128::MAX >> (PACKET_RAYS - count)
}

/// Where a ray's nearest hit lies.
#[derive(Clone, Copy)]
pub(super) struct NearestHit {
    pub t: f64,
    pub placement: u32,
    pub slot: TriangleRef,
}

thread_local! {
    /// A thread's room, unless it is in use: tens of kilobytes that need not be made for each call.
    static SCRATCH: Cell<Option<Box<Scratch>>> = const { Cell::new(None) };
}

/// Room to work in, kept from packet to packet and cast to cast.
#[derive(Default)]
struct Scratch {
    top: packet::Stack,
    mesh: packet::Stack,
    carried: Vec<DVec3>,
    carried_origins: Vec<DVec3>,
    rays: PerRay,
    rays_of_mesh: PerRay,
    single: SingleScratch,
}

impl Scratch {
    /// What was done in it so far.
    fn stats(&self) -> TraversalStats {
        let mut stats =
            TraversalStats { nodes: self.top.visited + self.mesh.visited, ..TraversalStats::default() };
        for more in [
            self.rays.stats(),
            self.rays_of_mesh.stats(),
            self.single.top.stats,
            self.single.mesh.stats,
            self.single.stream.stats(),
        ] {
            stats += more;
        }
        stats
    }
}

#[derive(Default)]
struct SingleScratch {
    top: Stack,
    mesh: Stack,
    stream: RayStream,
    scalar: ScalarScratch,
}

#[derive(Default)]
struct ScalarScratch {
    top: Vec<(Child, f64)>,
    mesh: Vec<(Child, f64)>,
}

/// The hierarchy over a scene's placements; without nodes if there is one.
fn over_placements(scene: &Scene, bounds: &[Bounds]) -> Bvh8 {
    let size = scene.arrangement.placements.iter().map(|p| carried_bounds(&bounds[p.mesh as usize], p, 0.0));
    let size = size.filter(|b| b.low.x <= b.high.x).fold(Bounds::EMPTY, Bounds::union).largest();
    let boxes: Vec<_> = scene
        .arrangement
        .placements
        .iter()
        .map(|p| match scene.geometry.meshes[p.mesh as usize].triangles.is_empty() {
            // An empty mesh 0 is placed all the same; its box is a point, where a ray finds nothing.
            true => Bounds { low: DVec3::ZERO, high: DVec3::ZERO },
            false => carried_bounds(&bounds[p.mesh as usize], p, size),
        })
        .collect();
    if boxes.len() > 1 { bvh::build_over(&boxes) } else { Bvh8::default() }
}

fn bounds_of(mesh: &Mesh) -> Bounds {
    let corners = mesh.triangles.iter().flatten().map(|&v| {
        let [x, y, z] = mesh.positions[v as usize];
        DVec3::new(f64::from(x), f64::from(y), f64::from(z))
    });
    corners.fold(Bounds::EMPTY, Bounds::with)
}

/// The bounds in the scene's space of everything that a ray, carried into the placement's space, may hit there.
///
/// Carrying costs a few 2⁻⁵³ of |M⁻¹|·|o| + |t| in the mesh's space, where M⁻¹ is the linear part and the origin lies
/// within some multiple of the scene's `size`; so the mesh's box grows by 2⁻²¹ of that before it is carried out, which is
/// enough for origins a million scene sizes away and for maps as skewed as [`SceneBuilder`](crate::scene::SceneBuilder)
/// lets through (their condition is at most 2¹²).
fn carried_bounds(mesh: &Bounds, placement: &Placement, size: f64) -> Bounds {
    let map = placement.mesh_from_scene();
    if *map == DAffine3::IDENTITY || mesh.low.x > mesh.high.x {
        return *mesh;
    }
    let m = &map.matrix3;
    let stretch = (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
    let pad = (mesh.largest() + map.translation.abs().max_element() + stretch * size) / f64::from(1 << 21);
    let (low, high) = (mesh.low - pad, mesh.high + pad);
    (0..8).fold(Bounds::EMPTY, |all, index| {
        let side = |axis: usize| if index >> axis & 1 == 0 { low[axis] } else { high[axis] };
        all.with(placement.scene_from_mesh().transform_point3(DVec3::new(side(0), side(1), side(2))))
    })
}
