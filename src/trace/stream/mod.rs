//! Streams: many rays that take turns in one hierarchy.
//!
//! A ray that is traced alone mostly waits, for memory and for branches that go either way equally often. So the rays of a stream
//! take turns of one step each and prefetch a round ahead. Groups of eight rays enter and leave the stream together: when the eight
//! rays of a group are done, the next group takes its places, so there are always enough rays to wait in turn. (Sixteen,
//! thirty-two and sixty-four rays are ever faster, a hundred and twenty-eight are not.) Nodes and leaves have loops of their own,
//! and the next child, or the next entry of the stack, is selected without a branch. A ray that passes through a triangle waits
//! until there are eight such triangles, whose depths are computed together.

use glam::DVec3;

use super::batch::{Batch, NearestHit, NearestHits};
use super::bvh::{Bvh8, Child, LeafBlock, TriangleRef, WIDTH};
use super::exact::{Candidate, Corners, Facet, LocalRay, Xyz};
use super::hit_attributes::in_f64;
use super::simd::{F32x8, F64x8, U32x8};
use super::single::{BOTTOM, PreparedRays, StackSlices, id, passing};
use super::stats::TraversalStats;

/// The most rays that take turns.
const STREAM_RAYS: usize = 64;

/// Rays enter and leave the stream in groups of eight.
const GROUPS: usize = STREAM_RAYS / 8;

/// The length of a ray's traversal stack. (A ray that needs more is left to be traced alone. A hierarchy eight wide over a
/// thousand million triangles is some ten levels deep, and each level pushes at most seven children.)
const DEPTH: usize = 120;

/// The capacity of the list of crossed triangles: eight for the leaf of each ray, up to seven of an earlier round, and one vector.
const CROSSINGS: usize = (STREAM_RAYS + 2) * WIDTH;

/// The memory of a stream. (It is allocated at the first use, as it takes some 70 KiB.)
#[derive(Default)]
pub(super) struct RayStream {
    state: Option<Box<StreamState>>,
}

struct StreamState {
    /// The group of the batch that is in each group's places; the places that are taken (a byte of ones each); the next group.
    groups: [usize; GROUPS],
    taken: u64,
    next_group: usize,
    prepared: PreparedRays<STREAM_RAYS>,
    /// The next child that each ray visits, its traversal stack, and the top of that.
    next: [Child; STREAM_RAYS],
    top: [u32; STREAM_RAYS],
    nears: [[f32; DEPTH]; STREAM_RAYS],
    children: [[u32; DEPTH]; STREAM_RAYS],
    /// The depth of the nearest hit, or the largest depth asked for; the triangle of the hit; and the rays with a hit.
    t: [f64; STREAM_RAYS],
    triangle: [u32; STREAM_RAYS],
    hit: u64,
    /// The triangles that rays pass through and whose depths are still to be computed, the rays, and the number of pairs.
    crossed: [u32; CROSSINGS],
    crossed_by: [u8; CROSSINGS],
    crossing_count: usize,
    /// The rays whose next child is a node, the rays whose next child is a leaf, and the rays that wait for the depth of a
    /// crossing.
    at_node: u64,
    at_leaf: u64,
    waits: u64,
    /// The rays that have to be traced alone.
    rejected: u64,
    stats: TraversalStats,
}

impl Default for StreamState {
    fn default() -> Self {
        Self {
            groups: [0; GROUPS],
            taken: 0,
            next_group: 0,
            prepared: PreparedRays::NONE,
            next: [Child::NONE; STREAM_RAYS],
            top: [0; STREAM_RAYS],
            nears: [[0.0; DEPTH]; STREAM_RAYS],
            children: [[0; DEPTH]; STREAM_RAYS],
            t: [0.0; STREAM_RAYS],
            triangle: [0; STREAM_RAYS],
            hit: 0,
            crossed: [0; CROSSINGS],
            crossed_by: [0; CROSSINGS],
            crossing_count: 0,
            at_node: 0,
            at_leaf: 0,
            waits: 0,
            rejected: 0,
            stats: TraversalStats::default(),
        }
    }
}

impl RayStream {
    /// The work that was done so far.
    pub fn stats(&self) -> TraversalStats {
        self.state.as_ref().map_or(TraversalStats::default(), |state| state.stats)
    }

    /// Finds the nearest hits (any hits, if `any`) of eight more rays of a batch in mesh 0, which is given with the rays in its
    /// space. Returns the group of eight, whose hits are the first of `nearest`, and one bit for each ray of it that has to be
    /// traced alone. Groups come in any order, and the last group of the batch may have fewer rays. Returns `None` when the
    /// batch is done; only then may another batch follow. `AFTER` tells whether [`Batch::after`] counts.
    #[inline(always)]
    pub fn next_group<S: F32x8, const AFTER: bool>(
        &mut self,
        bvh: &Bvh8,
        rays: &Batch,
        any: bool,
        nearest: &mut NearestHits,
    ) -> Option<(usize, u32)> {
        let state = self.state.get_or_insert_with(StreamState::boxed);
        loop {
            let done = state.taken & !whole_bytes(state.at_node | state.at_leaf | state.waits);
            if done != 0 {
                let group = done.trailing_zeros() as usize / 8;
                state.taken &= !(0xff << (8 * group));
                return Some(state.finish_group(group, nearest));
            }
            while state.taken != u64::MAX && state.next_group * 8 < rays.directions.len() {
                let group = (!state.taken).trailing_zeros() as usize / 8;
                state.start_group::<S, AFTER>(group, bvh, rays);
            }
            if state.taken == 0 {
                // No ray is left, so another batch may begin.
                state.next_group = 0;
                return None;
            }
            // Rays that reach a leaf in this round test it in the next, when it has been prefetched.
            let at_leaf = std::mem::take(&mut state.at_leaf);
            state.visit_nodes::<S>(bvh);
            state.visit_leaves::<S, AFTER>(bvh, rays, any, at_leaf);
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
    fn start_group<S: F32x8, const AFTER: bool>(&mut self, group: usize, bvh: &Bvh8, rays: &Batch) {
        let batch_group = self.next_group;
        self.next_group += 1;
        self.groups[group] = batch_group;
        let places = 0xff << (8 * group);
        self.taken |= places;
        let (o, d) = rays.group::<S>(batch_group);
        let limits = (rays.t_min_of_group::<S, AFTER>(batch_group), rays.t_max);
        let in_range = self.prepared.prepare::<S>(group, o, d, bvh.largest, limits);
        let all = 0xff_u32 >> (8 - (rays.directions.len() - 8 * batch_group).min(8));
        self.rejected = self.rejected & !places | u64::from(all & !in_range) << (8 * group);
        if !bvh.nodes.is_empty() {
            self.at_node |= u64::from(all & in_range) << (8 * group);
        }
        self.hit &= !places;
        for place in 8 * group..8 * group + 8 {
            self.stack(place).clear();
            (self.next[place], self.top[place], self.t[place]) = (Child::node(0), BOTTOM as u32, rays.t_max);
        }
    }

    /// Writes the hits of a finished group. Returns which group of the batch it was, and its rays that have to be traced alone.
    #[inline(always)]
    fn finish_group(&self, group: usize, nearest: &mut NearestHits) -> (usize, u32) {
        let rejected = (self.rejected >> (8 * group)) as u32 & 0xff;
        nearest.clear();
        for k in 0..8 {
            let place = 8 * group + k;
            if (self.hit & !self.rejected) >> place & 1 != 0 {
                let (t, triangle) = (self.t[place], TriangleRef(self.triangle[place]));
                nearest.set(k, Some(NearestHit { t, placement: 0, triangle }));
            }
        }
        (self.groups[group], rejected)
    }

    /// The ray of the batch that is in a place.
    #[inline(always)]
    fn ray(&self, place: usize) -> usize {
        8 * self.groups[place / 8] + place % 8
    }

    #[inline(always)]
    fn stack(&mut self, place: usize) -> StackSlices<'_> {
        StackSlices { nears: &mut self.nears[place], children: &mut self.children[place] }
    }

    /// Sends a ray to its next child, which is prefetched, or ends its traversal if its stack is empty. Returns the ray's bit in
    /// the set of rays at a node and in that of rays at a leaf.
    #[inline(always)]
    fn go_to<S: F32x8>(&mut self, bvh: &Bvh8, ray: usize, child: Child, top: usize) -> [u64; 2] {
        (self.next[ray], self.top[ray]) = (child, top as u32);
        let goes_on = u64::from(top >= BOTTOM) << ray;
        let to_leaf = u64::from(child.bits() >> 31) << ray;
        bvh.prefetch::<S>(child);
        [goes_on & !to_leaf, goes_on & to_leaf]
    }

    /// Takes all rays that are at a node one step further.
    #[inline(always)]
    fn visit_nodes<S: F32x8>(&mut self, bvh: &Bvh8) {
        let mut rest = self.at_node;
        let [mut to_node, mut to_leaf] = [0, self.at_leaf];
        self.stats.nodes += u64::from(rest.count_ones());
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (STREAM_RAYS - 1);
            rest &= rest - 1;
            let top = self.top[ray] as usize;
            if top > DEPTH - WIDTH {
                self.rejected |= 1 << ray;
                continue;
            }
            let node = &bvh.nodes[self.next[ray].bits() as usize];
            let mut stack = StackSlices { nears: &mut self.nears[ray], children: &mut self.children[ray] };
            let (child, top) = self.prepared.visit_node::<S>(ray, node, &mut stack, top);
            let [node, leaf] = self.go_to::<S>(bvh, ray, child, top);
            (to_node, to_leaf) = (to_node | node, to_leaf | leaf);
        }
        (self.at_node, self.at_leaf) = (to_node, to_leaf);
    }

    /// Takes all rays of a set, which are at a leaf, one step further, or lets them wait for the depth of a crossing.
    #[inline(always)]
    fn visit_leaves<S: F32x8, const AFTER: bool>(
        &mut self,
        bvh: &Bvh8,
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
            let block = LeafBlock::at(&bvh.blocks, block_offset);
            let (mut maybe, sure) = self.prepared.test_leaf::<S>(ray, &block);
            tests += block.triangles as u64;
            if maybe & !sure != 0 {
                maybe =
                    maybe & sure | passing(block, maybe & !sure, rays.ray(self.ray(ray)), &mut self.stats);
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
        let mut start = 0;
        while count - start >= WIDTH || (count > start && self.at_node | self.at_leaf | goes_on == 0) {
            let some = (count - start).min(WIDTH);
            let of = self.update_hits::<S, AFTER>(bvh, rays, any, start, some);
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
        let (mut to_node, mut to_leaf) = (self.at_node, self.at_leaf);
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (STREAM_RAYS - 1);
            rest &= rest - 1;
            let z_max = S::splat(self.prepared.z_max[ray]);
            let top = self.top[ray] as usize;
            let (child, top) = self.stack(ray).pop::<S>(z_max, top);
            let [node, leaf] = self.go_to::<S>(bvh, ray, child, top);
            (to_node, to_leaf) = (to_node | node, to_leaf | leaf);
        }
        (self.at_node, self.at_leaf) = (to_node, to_leaf);
    }

    /// Computes the depths of up to eight crossings and replaces the hits that they beat. Returns the rays, one bit each.
    #[inline(always)]
    fn update_hits<S: F32x8, const AFTER: bool>(
        &mut self,
        bvh: &Bvh8,
        rays: &Batch,
        any: bool,
        start: usize,
        count: usize,
    ) -> u64 {
        let mut crossed: [u32; WIDTH] = self.crossed[start..start + WIDTH].try_into().unwrap();
        let crossed_by: [u8; WIDTH] = self.crossed_by[start..start + WIDTH].try_into().unwrap();
        let (mut origins, mut directions) = ([DVec3::ZERO; WIDTH], [DVec3::ZERO; WIDTH]);
        let mut of = 0;
        for k in 0..count {
            let place = usize::from(crossed_by[k]) % STREAM_RAYS;
            of |= 1 << place;
            let LocalRay { origin, direction } = rays.ray(self.ray(place));
            (origins[k], directions[k]) = (origin, direction);
        }
        // The results of the lanes past the last crossing are not used.
        let first = crossed[0];
        crossed[count..].fill(first);
        let (corners, ids) = LeafBlock::corners::<S>(&bvh.blocks, S::U32x8::load(&crossed));
        let [[x, y, z], [dx, dy, dz]] = [S::F64x8::load_xyz(&origins), S::F64x8::load_xyz(&directions)];
        let o = Xyz(x, y, z);
        let [a, b, c] = [in_f64(corners[0]), in_f64(corners[1]), in_f64(corners[2])];
        let facet = Facet::new([a.sub(o), b.sub(o), c.sub(o)]);
        let (depth, within) = facet.plane_depth(Xyz(dx, dy, dz));
        let (mut t, mut triangles) = ([0.0; WIDTH], [0; WIDTH]);
        depth.store(&mut t);
        ids.store(&mut triangles);
        for k in 0..count {
            let (ray, crossed) = (usize::from(crossed_by[k]) % STREAM_RAYS, crossed[k]);
            if within >> k & 1 == 0 {
                t[k] = depth_in_box(bvh, TriangleRef(crossed), rays.ray(self.ray(ray)));
            }
            let (t, known) = (t[k], self.t[ray]);
            let is_first = self.hit >> ray & 1 == 0;
            let beats = t < known
                || (t == known && (is_first || triangles[k] < id(bvh, TriangleRef(self.triangle[ray]))));
            let is_admitted = if AFTER {
                let found = Candidate { t, placement: 0, triangle: triangles[k] };
                rays.limits::<AFTER>(self.ray(ray)).admits(&found)
            } else {
                t >= rays.t_min
            };
            if beats && is_admitted {
                (self.t[ray], self.triangle[ray]) = (t, crossed);
                self.hit |= 1 << ray;
                self.prepared.limit(ray, t);
                if any {
                    // There is nothing more to visit.
                    self.top[ray] = BOTTOM as u32;
                }
            }
        }
        of
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
            let bvh = nested(count);
            let (mut stream, mut nearest) = (RayStream::default(), NearestHits::new(rays.t_max));
            let mut seen = Vec::new();
            while let Some((eight, left_out)) =
                stream.next_group::<PortableF32x8, false>(&bvh, &rays, false, &mut nearest)
            {
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
