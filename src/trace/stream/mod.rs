//! Streams: many rays that take turns in the hierarchies of a scene.
//!
//! A ray that is traced alone mostly waits, for memory and for branches that go either way equally often. So the rays of a stream
//! take turns of one step each and prefetch a round ahead. Groups of eight rays enter and leave the stream together: when the eight
//! rays of a group are done, the next group takes its places, so there are always enough rays to wait in turn. (Sixteen,
//! thirty-two and sixty-four rays are ever faster, a hundred and twenty-eight are not.) Nodes and leaves have loops of their own,
//! and the next child, or the next entry of the stack, is selected without a branch. A ray that passes through a triangle waits
//! until there are eight such triangles, whose depths are computed together.
//!
//! # Placements
//! In a scene with placements a ray begins in the hierarchy over these, in the scene's space. Where it comes to a placement, it waits
//! until eight rays do, which are then carried into the spaces of their meshes and prepared together. Placement 0 is mesh 0 in the
//! scene's space, where a ray goes on at once as it is. Its stack goes on above a mark that is never too far: when the ray comes to
//! that, it is done with the placement, and back in the scene's space. Depths are the same numbers in all spaces, so a hit ends the
//! search in both.

mod placed;

use glam::DVec3;

use super::batch::{Batch, NearestHit, NearestHits};
use super::bvh::{Bvh8, Child, LeafBlock, TriangleRef, WIDTH};
use super::exact::{Candidate, Corners, Facet, LocalRay, Real, Xyz};
use super::hit_attributes::{Surfaces, in_f64};
use super::maps::Maps;
use super::simd::{F32x8, F64x8, U32x8};
use super::single::{BOTTOM, PreparedRay, StackSlices, id, passing};
use super::stats::TraversalStats;
use super::top::Top;

/// The most rays that take turns.
const STREAM_RAYS: usize = 64;

/// Rays enter and leave the stream in groups of eight.
const GROUPS: usize = STREAM_RAYS / 8;

/// The length of a ray's traversal stack. (A ray that needs more is left to be traced alone. A hierarchy eight wide over a
/// thousand million triangles is some ten levels deep, and each level pushes at most seven children.)
const DEPTH: usize = 120;

/// The capacity of the list of crossed triangles: eight for the leaf of each ray, up to seven of an earlier round, and one vector.
const CROSSINGS: usize = (STREAM_RAYS + 2) * WIDTH;

/// The mark in a stack below which it belongs to the hierarchy over placements.
const BACK: Child = Child::NONE;

/// Placement 0: mesh 0 as it stands, in the scene's space.
const FIXED: Child = Child::leaf(0);

/// What a stream's rays are cast at: the hierarchy over the placements, if there are several, and the meshes.
#[derive(Clone, Copy)]
pub(super) struct Targets<'a> {
    pub top: &'a Top,
    pub surfaces: Surfaces<'a>,
}

/// The memory of a stream. (It is allocated at the first use, as it takes some 90 KiB.)
#[derive(Default)]
pub(super) struct RayStream {
    state: Option<Box<StreamState>>,
}

struct StreamState {
    /// The group of the batch that is in each group's places; the places that are taken (a byte of ones each); the next group.
    groups: [usize; GROUPS],
    taken: u64,
    next_group: usize,
    /// The rays in the scene's space, in a scene with placements.
    above: [PreparedRay; STREAM_RAYS],
    /// The rays in the space of the placement that they are at, or were at last.
    local: [PreparedRay; STREAM_RAYS],
    /// In a scene with placements: that placement, its mesh, and each ray in its space.
    placement: [u32; STREAM_RAYS],
    mesh: [u32; STREAM_RAYS],
    origins: [DVec3; STREAM_RAYS],
    directions: [DVec3; STREAM_RAYS],
    /// The next child that each ray visits, its traversal stack, and the top of that.
    next: [Child; STREAM_RAYS],
    top: [u32; STREAM_RAYS],
    nears: [[f32; DEPTH]; STREAM_RAYS],
    children: [[u32; DEPTH]; STREAM_RAYS],
    /// The depth of the nearest hit, or the largest depth asked for; the triangle of the hit and its placement; and the rays with
    /// a hit.
    t: [f64; STREAM_RAYS],
    triangle: [u32; STREAM_RAYS],
    hit_placement: [u32; STREAM_RAYS],
    hit: u64,
    /// The triangles that rays pass through and whose depths are still to be computed, the rays, and the number of pairs.
    crossed: [u32; CROSSINGS],
    crossed_by: [u8; CROSSINGS],
    crossing_count: usize,
    /// The rays whose next child is a node of the hierarchy over placements, and those whose next child is a placement.
    above_node: u64,
    at_placement: u64,
    /// The rays whose next child is [`FIXED`].
    at_fixed: u64,
    /// The rays whose next child is a node, the rays whose next child is a leaf, and the rays that wait for the depth of a
    /// crossing.
    at_node: u64,
    at_leaf: u64,
    waits: u64,
    /// The rays that have to be traced alone.
    rejected: u64,
    stats: TraversalStats,
    /// The number of times that a ray was carried to a placement.
    carried: u64,
}

impl Default for StreamState {
    fn default() -> Self {
        Self {
            groups: [0; GROUPS],
            taken: 0,
            next_group: 0,
            above: [PreparedRay::NONE; STREAM_RAYS],
            local: [PreparedRay::NONE; STREAM_RAYS],
            placement: [0; STREAM_RAYS],
            mesh: [0; STREAM_RAYS],
            origins: [DVec3::ZERO; STREAM_RAYS],
            directions: [DVec3::ZERO; STREAM_RAYS],
            next: [Child::NONE; STREAM_RAYS],
            top: [0; STREAM_RAYS],
            nears: [[0.0; DEPTH]; STREAM_RAYS],
            children: [[0; DEPTH]; STREAM_RAYS],
            t: [0.0; STREAM_RAYS],
            triangle: [0; STREAM_RAYS],
            hit_placement: [0; STREAM_RAYS],
            hit: 0,
            crossed: [0; CROSSINGS],
            crossed_by: [0; CROSSINGS],
            crossing_count: 0,
            above_node: 0,
            at_placement: 0,
            at_fixed: 0,
            at_node: 0,
            at_leaf: 0,
            waits: 0,
            rejected: 0,
            stats: TraversalStats::default(),
            carried: 0,
        }
    }
}

impl RayStream {
    /// The work that was done so far.
    pub fn stats(&self) -> TraversalStats {
        self.state.as_ref().map_or(TraversalStats::default(), |state| state.stats)
    }

    /// The number of times that a ray was carried to a placement so far.
    pub fn carried(&self) -> u64 {
        self.state.as_ref().map_or(0, |state| state.carried)
    }

    /// Finds the nearest hits (any hits, if `any`) of eight more rays of a batch, which is given in the scene's space. Returns the
    /// group of eight, whose hits are the first of `nearest`, and one bit for each ray of it that has to be traced alone. Groups come
    /// in any order, and the last group of the batch may have fewer rays. Returns `None` when the batch is done; only then may
    /// another batch follow. `AFTER` tells whether [`Batch::after`] counts, and `PLACED` whether there is a hierarchy over placements.
    #[inline(always)]
    pub fn next_group<S: F32x8, const AFTER: bool, const PLACED: bool>(
        &mut self,
        targets: &Targets,
        rays: &Batch,
        any: bool,
        nearest: &mut NearestHits,
        maps: &mut Maps,
    ) -> Option<(usize, u32)> {
        let state = self.state.get_or_insert_with(StreamState::boxed);
        loop {
            let done = state.taken & !whole_bytes(state.visits() | state.waits);
            if done != 0 {
                let group = done.trailing_zeros() as usize / 8;
                state.taken &= !(0xff << (8 * group));
                return Some(state.finish_group::<PLACED>(group, nearest));
            }
            while state.taken != u64::MAX && state.next_group * 8 < rays.directions.len() {
                let group = (!state.taken).trailing_zeros() as usize / 8;
                state.start_group::<S, AFTER, PLACED>(group, targets, rays);
            }
            if state.taken == 0 {
                // No ray is left, so another batch may begin.
                state.next_group = 0;
                return None;
            }
            // Rays that reach a leaf or a placement in this round go on in the next, when it has been prefetched.
            let at_leaf = std::mem::take(&mut state.at_leaf);
            if PLACED {
                let at_placement = state.at_placement;
                state.visit_nodes_above::<S>(targets);
                state.enter_fixed::<S>(targets, rays);
                state.visit_placements::<S, AFTER>(targets, rays, maps, at_placement);
            }
            state.visit_nodes::<S, PLACED>(targets);
            state.visit_leaves::<S, AFTER, PLACED>(targets, rays, any, at_leaf);
        }
    }
}

impl StreamState {
    /// A new state. This is kept out of the traversal, so that its temporary copy is not on the stack of that.
    #[cold]
    #[inline(never)]
    fn boxed() -> Box<Self> {
        Box::default()
    }

    /// Prepares the next eight rays of the batch and puts them at the root.
    #[inline(always)]
    fn start_group<S: F32x8, const AFTER: bool, const PLACED: bool>(
        &mut self,
        group: usize,
        targets: &Targets,
        rays: &Batch,
    ) {
        let batch_group = self.next_group;
        self.next_group += 1;
        self.groups[group] = batch_group;
        let places = 0xff << (8 * group);
        self.taken |= places;
        let (o, d) = rays.group::<S>(batch_group);
        let limits = (rays.t_min_of_group::<S, AFTER>(batch_group), S::F64x8::splat(rays.t_max));
        let mesh_0 = &targets.surfaces.meshes[0];
        let (bvh, prepared, at_root) = if PLACED {
            (&targets.top.bvh, &mut self.above, &mut self.above_node)
        } else {
            (mesh_0, &mut self.local, &mut self.at_node)
        };
        let numbers = std::array::from_fn(|k| 8 * group + k);
        // A ray that is prepared for the scene's space goes on in mesh 0 as it is.
        let largest = S::F64x8::splat(bvh.largest.max(mesh_0.largest).into());
        let in_range = PreparedRay::prepare::<S>(prepared, numbers, o, d, largest, limits);
        let all = 0xff_u32 >> (8 - (rays.directions.len() - 8 * batch_group).min(8));
        if !bvh.nodes.is_empty() {
            *at_root |= u64::from(all & in_range) << (8 * group);
        }
        self.rejected = self.rejected & !places | u64::from(all & !in_range) << (8 * group);
        self.hit &= !places;
        for place in 8 * group..8 * group + 8 {
            self.stack(place).clear();
            (self.next[place], self.top[place], self.t[place]) = (Child::node(0), BOTTOM as u32, rays.t_max);
        }
    }

    /// Writes the hits of a finished group. Returns which group of the batch it was, and its rays that have to be traced alone.
    #[inline(always)]
    fn finish_group<const PLACED: bool>(&self, group: usize, nearest: &mut NearestHits) -> (usize, u32) {
        let rejected = (self.rejected >> (8 * group)) as u32 & 0xff;
        nearest.clear();
        for k in 0..8 {
            let place = 8 * group + k;
            if (self.hit & !self.rejected) >> place & 1 != 0 {
                let (t, triangle) = (self.t[place], TriangleRef(self.triangle[place]));
                let placement = if PLACED { self.hit_placement[place] } else { 0 };
                nearest.set(k, Some(NearestHit { t, placement, triangle }));
            }
        }
        (self.groups[group], rejected)
    }

    /// The rays that have something to visit.
    #[inline(always)]
    fn visits(&self) -> u64 {
        self.above_node | self.at_placement | self.at_fixed | self.at_node | self.at_leaf
    }

    /// The ray of the batch that is in a place.
    #[inline(always)]
    fn ray(&self, place: usize) -> usize {
        8 * self.groups[place / 8] + place % 8
    }

    /// The ray in a place, in the space of the mesh that it is at.
    #[inline(always)]
    fn local_ray<const PLACED: bool>(&self, rays: &Batch, place: usize) -> LocalRay {
        if PLACED {
            LocalRay { origin: self.origins[place], direction: self.directions[place] }
        } else {
            rays.ray(self.ray(place))
        }
    }

    /// The hierarchy of the mesh that the ray in a place is at.
    #[inline(always)]
    fn bvh<'a, const PLACED: bool>(&self, targets: &Targets<'a>, place: usize) -> &'a Bvh8 {
        if PLACED { targets.surfaces.bvh_of_mesh(self.mesh[place]) } else { &targets.surfaces.meshes[0] }
    }

    #[inline(always)]
    fn stack(&mut self, place: usize) -> StackSlices<'_> {
        StackSlices { nears: &mut self.nears[place], children: &mut self.children[place] }
    }

    /// Sends a ray to its next child, which is prefetched, or ends its traversal if its stack is empty. Returns the ray's bit in
    /// the set of rays at a node, in that of rays at a leaf, and in that of rays that are done with a placement.
    #[inline(always)]
    fn go_to<S: F32x8, const PLACED: bool>(
        &mut self,
        bvh: &Bvh8,
        ray: usize,
        child: Child,
        top: usize,
    ) -> [u64; 3] {
        (self.next[ray], self.top[ray]) = (child, top as u32);
        let goes_on = u64::from(top >= BOTTOM) << ray;
        let to_leaf = u64::from(child.bits() >> 31) << ray;
        bvh.prefetch::<S>(child);
        let back = if PLACED { goes_on & u64::from(child == BACK) << ray } else { 0 };
        [goes_on & !to_leaf, goes_on & to_leaf & !back, back]
    }

    /// Takes all rays that are at a node of a mesh one step further.
    #[inline(always)]
    fn visit_nodes<S: F32x8, const PLACED: bool>(&mut self, targets: &Targets) {
        let mut rest = self.at_node;
        let [mut to_node, mut to_leaf, mut to_back] = [0, self.at_leaf, 0];
        self.stats.nodes += u64::from(rest.count_ones());
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (STREAM_RAYS - 1);
            rest &= rest - 1;
            let top = self.top[ray] as usize;
            if top > DEPTH - WIDTH {
                self.rejected |= 1 << ray;
                continue;
            }
            let bvh = self.bvh::<PLACED>(targets, ray);
            let node = &bvh.nodes[self.next[ray].bits() as usize];
            let mut stack = StackSlices { nears: &mut self.nears[ray], children: &mut self.children[ray] };
            let (child, top) = self.local[ray].visit_node::<S>(node, &mut stack, top);
            let [node, leaf, back] = self.go_to::<S, PLACED>(bvh, ray, child, top);
            (to_node, to_leaf, to_back) = (to_node | node, to_leaf | leaf, to_back | back);
        }
        (self.at_node, self.at_leaf) = (to_node, to_leaf);
        if PLACED {
            self.leave_placements::<S>(targets, to_back);
        }
    }

    /// Takes all rays of a set, which are at a leaf, one step further, or lets them wait for the depth of a crossing.
    #[inline(always)]
    fn visit_leaves<S: F32x8, const AFTER: bool, const PLACED: bool>(
        &mut self,
        targets: &Targets,
        rays: &Batch,
        any: bool,
        at_leaf: u64,
    ) {
        let (mut rest, mut count, mut goes_on) = (at_leaf, self.crossing_count, 0);
        let mut tests = 0;
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (STREAM_RAYS - 1);
            rest &= rest - 1;
            let block_offset = self.next[ray].bits() & !(1 << 31);
            let block = LeafBlock::at(&self.bvh::<PLACED>(targets, ray).blocks, block_offset);
            let (mut maybe, sure) = self.local[ray].test_leaf::<S>(&block);
            tests += block.triangles as u64;
            if maybe & !sure != 0 {
                let local = self.local_ray::<PLACED>(rays, ray);
                maybe = maybe & sure | passing(block, maybe & !sure, local, &mut self.stats);
            }
            goes_on |= u64::from(maybe == 0) << ray;
            // Whether a ray crosses no triangle or one is unpredictable, so there is no branch on it. More are rare.
            loop {
                let lane = (maybe | 1 << 7).trailing_zeros() as usize;
                self.crossed[count % CROSSINGS] = TriangleRef::new(block_offset, lane).0;
                self.crossed_by[count % CROSSINGS] = ray as u8;
                count += usize::from(maybe != 0);
                maybe &= maybe.wrapping_sub(1);
                if maybe == 0 {
                    break;
                }
            }
        }
        self.stats.leaves += u64::from(at_leaf.count_ones());
        self.stats.tests += tests;
        self.waits |= at_leaf & !goes_on;
        // Fewer than eight crossings are taken only if no ray has anything else to do.
        let others = self.visits();
        let mut start = 0;
        while count - start >= WIDTH || (count > start && others | goes_on == 0) {
            let some = (count - start).min(WIDTH);
            let of = self.update_hits::<S, AFTER, PLACED>(targets, rays, any, start, some);
            start += some;
            // A ray with another crossing in the next eight goes on only after that, lest its place is given away before.
            let next = u64::from(start < count) << (self.crossed_by[start] as usize % STREAM_RAYS);
            goes_on |= of & !next;
            self.waits &= !goes_on;
        }
        self.crossing_count = count - start;
        self.crossed.copy_within(start..start + WIDTH, 0);
        self.crossed_by.copy_within(start..start + WIDTH, 0);
        let mut rest = goes_on;
        let (mut to_node, mut to_leaf, mut to_back) = (self.at_node, self.at_leaf, 0);
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (STREAM_RAYS - 1);
            rest &= rest - 1;
            let z_max = S::splat(self.local[ray].z_max());
            let top = self.top[ray] as usize;
            let (child, top) = self.stack(ray).pop::<S>(z_max, top);
            let bvh = self.bvh::<PLACED>(targets, ray);
            let [node, leaf, back] = self.go_to::<S, PLACED>(bvh, ray, child, top);
            (to_node, to_leaf, to_back) = (to_node | node, to_leaf | leaf, to_back | back);
        }
        (self.at_node, self.at_leaf) = (to_node, to_leaf);
        if PLACED {
            self.leave_placements::<S>(targets, to_back);
        }
    }

    /// Computes the depths of up to eight crossings and replaces the hits that they beat. Returns the rays, one bit each.
    #[inline(always)]
    fn update_hits<S: F32x8, const AFTER: bool, const PLACED: bool>(
        &mut self,
        targets: &Targets,
        rays: &Batch,
        any: bool,
        start: usize,
        count: usize,
    ) -> u64 {
        let mut crossed: [u32; WIDTH] = self.crossed[start..start + WIDTH].try_into().unwrap();
        let mut crossed_by: [u8; WIDTH] = self.crossed_by[start..start + WIDTH].try_into().unwrap();
        // The results of the lanes past the last crossing are not used.
        let (first, first_by) = (crossed[0], crossed_by[0]);
        crossed[count..].fill(first);
        crossed_by[count..].fill(first_by);
        let (mut origins, mut directions) = ([DVec3::ZERO; WIDTH], [DVec3::ZERO; WIDTH]);
        let mut of = 0;
        for k in 0..WIDTH {
            let place = usize::from(crossed_by[k]) % STREAM_RAYS;
            of |= 1 << place;
            let LocalRay { origin, direction } = self.local_ray::<PLACED>(rays, place);
            (origins[k], directions[k]) = (origin, direction);
        }
        let (corners, ids) = self.corners::<S, PLACED>(targets, &crossed, &crossed_by);
        let [[x, y, z], [dx, dy, dz]] = [S::F64x8::load_xyz(&origins), S::F64x8::load_xyz(&directions)];
        let o = Xyz(x, y, z);
        let [a, b, c] = [in_f64(corners[0]), in_f64(corners[1]), in_f64(corners[2])];
        let facet = Facet::new([a.sub(o), b.sub(o), c.sub(o)]);
        let (depth, within) = facet.plane_depth(Xyz(dx, dy, dz));
        let mut t = [0.0; WIDTH];
        depth.store(&mut t);
        for k in 0..count {
            let ray = usize::from(crossed_by[k]) % STREAM_RAYS;
            if within >> k & 1 == 0 {
                let bvh = self.bvh::<PLACED>(targets, ray);
                t[k] = depth_in_box(bvh, TriangleRef(crossed[k]), self.local_ray::<PLACED>(rays, ray));
            }
            let placement = if PLACED { self.placement[ray] } else { 0 };
            let mut found = Candidate { t: t[k], placement, triangle: ids[k] };
            if AFTER && PLACED {
                // The copies of a placement have hits at the same depths, and higher ids.
                for copy in targets.top.with_copies(placement) {
                    found.placement = copy;
                    self.update_hit::<AFTER, PLACED>(targets, rays, any, (ray, crossed[k]), &found);
                }
            } else {
                self.update_hit::<AFTER, PLACED>(targets, rays, any, (ray, crossed[k]), &found);
            }
        }
        of
    }

    /// Replaces the hit of the ray in a place by another one if that beats it.
    #[inline(always)]
    fn update_hit<const AFTER: bool, const PLACED: bool>(
        &mut self,
        targets: &Targets,
        rays: &Batch,
        any: bool,
        (ray, crossed): (usize, u32),
        found: &Candidate,
    ) {
        let (t, known) = (found.t, self.t[ray]);
        let is_first = self.hit >> ray & 1 == 0;
        let beats =
            t < known || (t == known && (is_first || found.beats(&self.known::<PLACED>(targets, ray))));
        let is_admitted =
            if AFTER { rays.limits::<AFTER>(self.ray(ray)).admits(found) } else { t >= rays.t_min };
        if beats && is_admitted {
            (self.t[ray], self.triangle[ray]) = (t, crossed);
            self.hit |= 1 << ray;
            self.local[ray].limit(t);
            if PLACED {
                self.hit_placement[ray] = found.placement;
                self.above[ray].limit(t);
            }
            if any {
                // There is nothing more to visit.
                self.top[ray] = BOTTOM as u32;
            }
        }
    }

    /// The hit of the ray in a place, which has one.
    fn known<const PLACED: bool>(&self, targets: &Targets, ray: usize) -> Candidate {
        let placement = if PLACED { self.hit_placement[ray] } else { 0 };
        let bvh = if PLACED { targets.surfaces.bvh(placement) } else { &targets.surfaces.meshes[0] };
        Candidate { t: self.t[ray], placement, triangle: id(bvh, TriangleRef(self.triangle[ray])) }
    }

    /// The corners of eight crossed triangles, and their ids.
    #[inline(always)]
    fn corners<S: F32x8, const PLACED: bool>(
        &self,
        targets: &Targets,
        crossed: &[u32; WIDTH],
        crossed_by: &[u8; WIDTH],
    ) -> ([[S; 3]; 3], [u32; WIDTH]) {
        if PLACED {
            let mut blocks = [&[][..]; WIDTH];
            for (blocks, &place) in blocks.iter_mut().zip(crossed_by) {
                *blocks = &self.bvh::<PLACED>(targets, usize::from(place) % STREAM_RAYS).blocks;
            }
            return LeafBlock::corners_in_meshes(blocks, crossed);
        }
        let blocks = &targets.surfaces.meshes[0].blocks;
        let (corners, of_triangles) = LeafBlock::corners::<S>(blocks, S::U32x8::load(crossed));
        let mut ids = [0; WIDTH];
        of_triangles.store(&mut ids);
        (corners, ids)
    }
}

/// The depth of a triangle that is seen so edge-on that its depth is not that of its plane. Kept out of the loop, as it is rare.
#[cold]
#[inline(never)]
fn depth_in_box(bvh: &Bvh8, triangle: TriangleRef, ray: LocalRay) -> f64 {
    let positions = LeafBlock::at(&bvh.blocks, triangle.block_offset()).positions(triangle.lane());
    Corners::from_positions(positions, ray.origin).depth(ray.direction)
}

/// All ones in every byte that is not 0.
#[inline(always)]
fn whole_bytes(x: u64) -> u64 {
    const LOW: u64 = 0x7f7f_7f7f_7f7f_7f7f;
    let high = (((x & LOW) + LOW) | x) & !LOW;
    (high >> 7) * 0xff
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;
    use crate::trace::bvh;
    use crate::trace::rays::Origins;
    use crate::trace::simd::PortableF32x8;

    /// Each triangle lies in front of the next, which is larger, so each level pushes all but the nearest child of a node.
    #[test]
    fn rays_that_need_a_longer_stack_are_told() {
        let nested = |count: u32| {
            let mut mesh = Mesh::default();
            for i in 0..count {
                let size = libm::powf(1.02, i as f32);
                mesh.positions.extend([
                    [-size, -size, size],
                    [3.0 * size, -size, size],
                    [-size, 3.0 * size, size],
                ]);
                mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
            }
            bvh::build(&mesh)
        };
        let directions: Vec<_> = (0..20).map(|k| DVec3::new(f64::from(k) * 1e-3, 0.0, 1.0)).collect();
        let origins = Origins::Common(DVec3::new(0.0, 0.0, -1.0));
        let rays = Batch {
            origins,
            directions: &directions,
            t_min: 0.0,
            t_max: f64::INFINITY,
            after: None,
            times_s: None,
        };
        for (count, is_deep) in [(10, false), (1300, true)] {
            let (top, meshes) = (Top::default(), [nested(count)]);
            let surfaces = Surfaces { placements: &[], meshes: &meshes, shapes: &[] };
            let targets = Targets { top: &top, surfaces };
            let (mut stream, mut maps) = (RayStream::default(), Maps::default());
            let mut nearest = NearestHits::new(rays.t_max);
            let mut seen = Vec::new();
            while let Some((eight, left_out)) = stream.next_group::<PortableF32x8, false, false>(
                &targets,
                &rays,
                false,
                &mut nearest,
                &mut maps,
            ) {
                let present = if eight == 2 { 0x0f } else { 0xff };
                assert_eq!(left_out, if is_deep { present } else { 0 }, "{count} triangles, eight {eight}");
                assert_eq!(nearest.hits_of_group(0), present & !left_out);
                seen.push(eight);
            }
            seen.sort();
            assert_eq!(seen, [0, 1, 2]);
        }
    }
}
