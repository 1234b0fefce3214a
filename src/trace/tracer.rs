//! The tracer: a hierarchy of placements over a hierarchy a mesh, walked by packets.

use std::cell::Cell;
use std::ops::Range;

use glam::{DAffine3, DVec3};

use super::bounds::Bounds;
use super::exact::{self, Candidate, Corners, LocalRay, Xyz};
use super::finish::eight;
use super::lanes::{self, Doubles, Lanes, Portable, Work};
use super::packet::{self, Nearest, PerRay, RAYS, Tile};
use super::single::{Single, Stack, Together};
use super::wide::{self, Block, Child, Slot, Wide};
use super::{Cast, Effort, Hit, Origins, Rays};
use crate::scene::{Mesh, Placement, Scene};

/// Finds the hits that [`BruteForce`](super::BruteForce) finds, bit for bit, and fast.
///
/// Rays are taken 128 at a time as they come: a batch's neighbours should be neighbours in space.
#[derive(Debug)]
pub struct Tracer<'s> {
    pub(super) scene: &'s Scene,
    /// One a mesh.
    pub(super) meshes: Vec<Wide>,
    /// Of each mesh, in its space.
    bounds: Vec<Bounds>,
    /// Over the placements; without nodes if all there is is mesh 0.
    pub(super) top: Wide,
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

impl<'s> Tracer<'s> {
    /// Builds the hierarchies over a scene.
    pub fn build(scene: &'s Scene) -> Self {
        let meshes = scene.meshes.iter().map(wide::build).collect();
        let bounds: Vec<_> = scene.meshes.iter().map(bounds_of).collect();
        let top = over_placements(scene, &bounds);
        Self { scene, meshes, bounds, top, instructions: Instructions::Best, packets: true }
    }

    /// A tracer of the same meshes placed otherwise: only the hierarchy over the placements is built again, in milliseconds
    /// for tens of thousands. `scene` has this one's meshes; its maps are no more skewed than
    /// [`SceneBuilder`](crate::scene::SceneBuilder) lets through.
    ///
    /// # Panics
    /// If the scenes' meshes differ in number or in how many triangles they have.
    pub fn moved<'t>(self, scene: &'t Scene) -> Tracer<'t> {
        let triangles = |scene: &Scene| scene.meshes.iter().map(|m| m.triangles.len()).collect::<Vec<_>>();
        assert_eq!(triangles(self.scene), triangles(scene), "only placements move");
        let top = over_placements(scene, &self.bounds);
        let Self { meshes, bounds, instructions, packets, .. } = self;
        Tracer { scene, meshes, bounds, top, instructions, packets }
    }

    /// The same with other instructions.
    pub fn with_instructions(self, instructions: Instructions) -> Self {
        Self { instructions, ..self }
    }

    /// The same without packets: each ray by itself.
    pub fn ray_by_ray(self) -> Self {
        Self { packets: false, ..self }
    }

    /// Bytes held beside the scene.
    pub fn bytes(&self) -> usize {
        self.top.bytes() + self.meshes.iter().map(Wide::bytes).sum::<usize>()
    }

    /// [`Cast::cast`], and what it took. (Nothing is counted of [`Instructions::Scalar`].)
    ///
    /// # Panics
    /// As [`Cast::cast`].
    pub fn cast_counted(&self, rays: &Rays, hits: &mut [Option<Hit>]) -> Effort {
        rays.check(hits.len());
        match self.with_lanes(All { tracer: self, rays, hits }) {
            Ok(effort) => effort,
            Err(all) => {
                self.cast_all_in_f64(all.rays, all.hits);
                Effort::default()
            }
        }
    }

    /// Does something with the best lanes that there are; gives it back if there are to be none.
    #[inline]
    fn with_lanes<W: Work>(&self, work: W) -> Result<W::Output, W> {
        Ok(match self.instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Best if lanes::has_avx512() => lanes::with_avx512(work),
            #[cfg(target_arch = "x86_64")]
            Instructions::Best | Instructions::Avx2 if lanes::has_avx2() => lanes::with_avx2(work),
            Instructions::Best | Instructions::Avx2 | Instructions::Portable => work.run::<Portable>(),
            Instructions::Scalar => return Err(work),
        })
    }

    /// The hits of rays, by any kind of lanes: packet by packet.
    #[inline(always)]
    fn cast_all<S: Lanes>(&self, rays: &Rays, hits: &mut [Option<Hit>]) -> Effort {
        let mut room = ROOM.take().unwrap_or_default();
        let before = room.effort();
        let mut origins = Vec::new();
        // Those in no packet, in one row as far as they go.
        let mut singles = 0..0;
        for start in (0..hits.len()).step_by(RAYS) {
            let end = (start + RAYS).min(hits.len());
            // Directions come from memory as often as not: ask for the next ones while these are at work.
            for line in (end..(end + RAYS).min(hits.len())).step_by(2) {
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
        let effort = room.effort() - before;
        ROOM.set(Some(room));
        effort
    }

    /// Some of the rays, in the scene's space; `room` is for their origins.
    #[inline(always)]
    fn batch<'r>(&self, rays: &Rays<'r>, range: Range<usize>, room: &'r mut Vec<DVec3>) -> Batch<'r> {
        let centre = self.scene.centre;
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

    /// The hits of those of up to [`RAYS`] rays that are packets; gives the others, a bit each.
    #[inline(always)]
    fn cast_batch<S: Lanes>(&self, batch: &Batch, hits: &mut [Option<Hit>], room: &mut Room) -> u128 {
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
            let least = if matches!(part.origins, Origins::Common(_)) { 4 } else { RAYS / 4 };
            if self.packets && to - from >= 4 && packet::may_be_packet(top, part.origins) {
                let mut nearest = Nearest::new(part.t_max);
                if self.cast_packet::<S>(&part, &mut nearest, room) {
                    self.finish_all::<S>(&part, &nearest, &mut hits[from..to]);
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
    fn cast_singles<S: Lanes>(
        &self,
        rays: &Rays,
        range: Range<usize>,
        hits: &mut [Option<Hit>],
        origins: &mut Vec<DVec3>,
        room: &mut SingleRoom,
    ) {
        if range.is_empty() {
            return;
        }
        let hits = &mut hits[range.clone()];
        let batch = self.batch(rays, range, origins);
        let mut nearest = Nearest::new(batch.t_max);
        let mut eights = 0..hits.len().div_ceil(8);
        while let Some(eight) = self.next_eight::<S>(&batch, false, &mut eights, &mut nearest, room) {
            let rays = 8 * eight..(8 * eight + 8).min(hits.len());
            self.finish_all::<S>(&batch.part(rays.clone()), &nearest, &mut hits[rays]);
        }
    }

    /// The nearest hits of up to [`RAYS`] rays; false if they are no narrow pyramid.
    #[inline(always)]
    fn cast_packet<S: Lanes>(&self, rays: &Batch, nearest: &mut Nearest, room: &mut Room) -> bool {
        match rays.origins {
            Origins::Common(_) => self.cast_tile::<S, false>(rays, nearest, room),
            Origins::Each(_) => self.cast_tile::<S, true>(rays, nearest, room),
        }
    }

    #[inline(always)]
    fn cast_tile<S: Lanes, const APART: bool>(
        &self,
        rays: &Batch,
        nearest: &mut Nearest,
        room: &mut Room,
    ) -> bool {
        let limits = (rays.t_min, rays.t_max);
        let Room {
            top: stack,
            mesh: mesh_stack,
            carried,
            carried_origins,
            single,
            rays: of_top,
            rays_of_mesh,
        } = room;
        if self.top.nodes.is_empty() {
            let wide = &self.meshes[0];
            let Some(mut packet) = Tile::<APART>::new::<S>(
                wide,
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
        let Some(mut top) =
            Tile::<APART>::new::<S>(&self.top, 0, rays.origins, rays.directions, limits, nearest, of_top)
        else {
            return false;
        };
        top.enter_root::<S>(stack);
        while let Some(leaf) = top.next_leaf::<S>(stack) {
            let index = leaf.number;
            let placement = &self.scene.placements[index as usize];
            let origins = exact::carry(placement, rays.origins, rays.directions, carried, carried_origins);
            let wide = &self.meshes[placement.mesh as usize];
            if let Some(mut packet) =
                Tile::<APART>::new::<S>(wide, index, origins, carried, limits, nearest, rays_of_mesh)
            {
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
    fn next_eight<S: Lanes>(
        &self,
        rays: &Batch,
        any: bool,
        eights: &mut Range<usize>,
        nearest: &mut Nearest,
        room: &mut SingleRoom,
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
        let (eight, mut rest) = room.together.next_eight::<S>(&self.meshes[0], rays, any, nearest)?;
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
    fn cast_single<S: Lanes>(
        &self,
        ray: LocalRay,
        limits: (f64, f64),
        any: bool,
        best: &mut Option<Best>,
        room: &mut SingleRoom,
    ) {
        let Some(mut top) = Single::new::<S>(ray, self.top.largest, limits) else {
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
    fn single_in<S: Lanes>(
        &self,
        placement: u32,
        ray: LocalRay,
        limits: (f64, f64),
        any: bool,
        best: &mut Option<Best>,
        stack: &mut Stack,
    ) {
        let ray = if placement == 0 { ray } else { ray.carried(&self.scene.placements[placement as usize]) };
        let wide = self.wide(placement);
        let Some(mut single) = Single::new::<S>(ray, wide.largest, limits) else {
            return self.nearest_in(placement, ray, limits, best, &mut Vec::new());
        };
        if let Some(best) = best {
            single.limit(best.t);
        }
        stack.start(wide);
        while let Some(granule) = single.next_leaf::<S>(wide, stack) {
            if single.test_leaf::<S>(wide, granule, placement, limits, best, &mut stack.effort) && any {
                return;
            }
        }
    }

    /// The hits of rays taken one by one, in f64.
    #[inline(never)]
    fn cast_all_in_f64(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        let mut room = ScalarRoom::default();
        for (ray, hit) in hits.iter_mut().enumerate() {
            let ray =
                LocalRay { origin: rays.origin(ray) - self.scene.centre, direction: rays.directions[ray] };
            let mut best: Option<Best> = None;
            self.cast_in_f64(ray, (rays.t_min, rays.t_max), &mut best, &mut room);
            *hit = best.map(|best| self.finish(ray, &best));
        }
    }

    /// The nearest hit of a ray, in f64.
    #[inline(never)]
    fn cast_in_f64(&self, ray: LocalRay, limits: (f64, f64), best: &mut Option<Best>, room: &mut ScalarRoom) {
        let ScalarRoom { top, mesh } = room;
        if self.top.nodes.is_empty() {
            return self.nearest_in(0, ray, limits, best, mesh);
        }
        self.top.visit(&ray, limits, top, |index| {
            let local = ray.carried(&self.scene.placements[index as usize]);
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
        best: &mut Option<Best>,
        stack: &mut Vec<(Child, f64)>,
    ) {
        let wide = self.wide(placement);
        let far = best.map_or(t_max, |b| b.t);
        wide.visit(&ray, (t_min, far), stack, |granule| {
            let block = Block::at(&wide.blocks, granule);
            for lane in 0..block.triangles {
                let corners = Corners::from_positions(block.positions(lane), ray.origin);
                if !corners.passes(ray.direction) {
                    continue;
                }
                let t = corners.depth(ray.direction);
                let found = Candidate { t, placement, triangle: block.id(lane) };
                if (t_min..=t_max).contains(&t) && best.is_none_or(|b| found.beats(&self.candidate(&b))) {
                    *best = Some(Best { t, placement, slot: Slot::new(granule, lane) });
                }
            }
            best.map_or(t_max, |b| b.t)
        });
    }

    pub(super) fn wide(&self, placement: u32) -> &Wide {
        &self.meshes[self.scene.placements[placement as usize].mesh as usize]
    }

    fn candidate(&self, best: &Best) -> Candidate {
        let block = Block::at(&self.wide(best.placement).blocks, best.slot.granule());
        Candidate { t: best.t, placement: best.placement, triangle: block.id(best.slot.lane()) }
    }

    /// The whole hit of a ray in the scene's space.
    fn finish(&self, ray: LocalRay, best: &Best) -> Hit {
        let placement = &self.scene.placements[best.placement as usize];
        let local = ray.carried(placement);
        let block = Block::at(&self.wide(best.placement).blocks, best.slot.granule());
        let corners = Corners::from_positions(block.positions(best.slot.lane()), local.origin);
        self.candidate(best).finish(&corners, local.direction, placement)
    }
}

impl Cast for Tracer<'_> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        self.cast_counted(rays, hits);
    }

    fn blocked(&self, rays: &Rays, blocked: &mut [bool]) {
        rays.check(blocked.len());
        if let Err(any) = self.with_lanes(Any { tracer: self, rays, blocked }) {
            any.run_in_f64();
        }
    }
}

/// [`Cast::cast`].
struct All<'a, 's, 'r> {
    tracer: &'a Tracer<'s>,
    rays: &'a Rays<'r>,
    hits: &'a mut [Option<Hit>],
}

impl Work for All<'_, '_, '_> {
    type Output = Effort;

    #[inline(always)]
    fn run<S: Lanes>(self) -> Effort {
        self.tracer.cast_all::<S>(self.rays, self.hits)
    }
}

/// [`Cast::blocked`].
struct Any<'a, 's, 'r> {
    tracer: &'a Tracer<'s>,
    rays: &'a Rays<'r>,
    blocked: &'a mut [bool],
}

impl Any<'_, '_, '_> {
    fn run_in_f64(self) {
        let Self { tracer, rays, blocked } = self;
        let mut room = ScalarRoom::default();
        for (ray, blocked) in blocked.iter_mut().enumerate() {
            let origin = rays.origin(ray) - tracer.scene.centre;
            let ray = LocalRay { origin, direction: rays.directions[ray] };
            let mut best = None;
            tracer.cast_in_f64(ray, (rays.t_min, rays.t_max), &mut best, &mut room);
            *blocked = best.is_some();
        }
    }
}

impl Work for Any<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self) {
        let Self { tracer, rays, blocked } = self;
        let mut room = ROOM.take().unwrap_or_default();
        let mut origins = Vec::new();
        let mut nearest = Nearest::new(rays.t_max);
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
        ROOM.set(Some(room));
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
    pub fn eight<S: Lanes>(&self, group: usize) -> (Xyz<S::Doubles>, Xyz<S::Doubles>) {
        let mut room = [DVec3::ZERO; 8];
        let [x, y, z] = S::Doubles::load_xyz(eight(self.directions, group, &mut room));
        let direction = Xyz(x, y, z);
        let origin = match self.origins {
            Origins::Common(origin) => Xyz::constant(origin),
            Origins::Each(origins) => {
                let [x, y, z] = S::Doubles::load_xyz(eight(origins, group, &mut room));
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
    u128::MAX >> (RAYS - count)
}

/// Where a ray's nearest hit lies.
#[derive(Clone, Copy)]
pub(super) struct Best {
    pub t: f64,
    pub placement: u32,
    pub slot: Slot,
}

thread_local! {
    /// A thread's room, unless it is in use: tens of kilobytes that need not be made for each call.
    static ROOM: Cell<Option<Box<Room>>> = const { Cell::new(None) };
}

/// Room to work in, kept from packet to packet and cast to cast.
#[derive(Default)]
struct Room {
    top: packet::Stack,
    mesh: packet::Stack,
    carried: Vec<DVec3>,
    carried_origins: Vec<DVec3>,
    rays: PerRay,
    rays_of_mesh: PerRay,
    single: SingleRoom,
}

impl Room {
    /// What was done in it so far.
    fn effort(&self) -> Effort {
        let mut effort = Effort { nodes: self.top.visited + self.mesh.visited, ..Effort::default() };
        for more in [
            self.rays.effort(),
            self.rays_of_mesh.effort(),
            self.single.top.effort,
            self.single.mesh.effort,
            self.single.together.effort(),
        ] {
            effort += more;
        }
        effort
    }
}

#[derive(Default)]
struct SingleRoom {
    top: Stack,
    mesh: Stack,
    together: Together,
    scalar: ScalarRoom,
}

#[derive(Default)]
struct ScalarRoom {
    top: Vec<(Child, f64)>,
    mesh: Vec<(Child, f64)>,
}

/// The hierarchy over a scene's placements; without nodes if there is one.
fn over_placements(scene: &Scene, bounds: &[Bounds]) -> Wide {
    let size = scene.placements.iter().map(|p| carried_bounds(&bounds[p.mesh as usize], p, 0.0));
    let size = size.filter(|b| b.low.x <= b.high.x).fold(Bounds::EMPTY, Bounds::union).largest();
    let boxes: Vec<_> = scene
        .placements
        .iter()
        .map(|p| match scene.meshes[p.mesh as usize].triangles.is_empty() {
            // An empty mesh 0 is placed all the same; its box is a point, where a ray finds nothing.
            true => Bounds { low: DVec3::ZERO, high: DVec3::ZERO },
            false => carried_bounds(&bounds[p.mesh as usize], p, size),
        })
        .collect();
    if boxes.len() > 1 { wide::build_over(&boxes) } else { Wide::default() }
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
    let map = &placement.mesh_from_scene;
    if *map == DAffine3::IDENTITY || mesh.low.x > mesh.high.x {
        return *mesh;
    }
    let m = &map.matrix3;
    let stretch = (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
    let pad = (mesh.largest() + map.translation.abs().max_element() + stretch * size) / f64::from(1 << 21);
    let (low, high) = (mesh.low - pad, mesh.high + pad);
    (0..8).fold(Bounds::EMPTY, |all, index| {
        let side = |axis: usize| if index >> axis & 1 == 0 { low[axis] } else { high[axis] };
        all.with(placement.scene_from_mesh.transform_point3(DVec3::new(side(0), side(1), side(2))))
    })
}
