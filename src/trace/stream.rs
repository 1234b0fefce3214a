//! Many rays side by side.
//!
//! Most of what a ray by itself takes is waiting: for memory, and for branches that go either way as often. So rays take turns,
//! a step each, and ask for what they visit next a round ahead. Where eight are done, the next eight take their places: of many
//! rays there are always enough to wait in turn. (Sixteen, thirty-two, sixty-four side by side are ever quicker; a hundred and
//! twenty-eight are not.) Nodes and leaves have loops of their own, and which child is next, or whether it is
//! something from the stack, is computed without a branch. A ray that passes through a triangle waits until there are eight
//! such triangles, and their depths are worked out together.

use glam::DVec3;

use super::single::{BOTTOM, Prepared, StackSlices, id, passing};
use crate::trace::bvh::{Bvh8, Child, LeafBlock, TriangleRef, WIDTH};
use crate::trace::exact::{Corners, Facet, LocalRay, Xyz};
use crate::trace::hit_attributes::in_f64;
use crate::trace::packet::NearestHits;
use crate::trace::simd::{F32x8, F64x8, U32x8};
use crate::trace::stats::TraversalStats;
use crate::trace::tracer::{Batch, NearestHit};

/// Rays that are walked side by side at most.
const STREAM_RAYS: usize = 64;

/// They come and go in groups of eight.
const GROUPS: usize = STREAM_RAYS / 8;

/// The length of a ray's stack where there are many. (A ray that needs more is taken by itself: eight wide, a hierarchy over a
/// thousand million triangles is some ten deep, and a level leaves seven children.)
const DEPTH: usize = 120;

/// Room for triangles that rays pass through: eight of each ray's leaf, up to seven of an earlier round, and one vector.
const PASSED: usize = (STREAM_RAYS + 2) * WIDTH;

/// Room for rays, walked side by side. (Nothing until there are any: it is some 70 KiB.)
#[derive(Default)]
pub(in crate::trace) struct RayStream {
    state: Option<Box<StreamState>>,
}

struct StreamState {
    /// Which eight rays of the batch are in each group's places, and whose places are taken (a byte of ones each); the next
    /// eight to come.
    eights: [usize; GROUPS],
    taken: u64,
    next_eight: usize,
    prepared: Prepared<STREAM_RAYS>,
    /// What each visits next, and its stack with the top.
    next: [Child; STREAM_RAYS],
    top: [u32; STREAM_RAYS],
    nears: [[f32; DEPTH]; STREAM_RAYS],
    children: [[u32; DEPTH]; STREAM_RAYS],
    /// The depth of each one's nearest hit, or how far it goes, and where that is, if there is one (a bit each).
    t: [f64; STREAM_RAYS],
    slot: [u32; STREAM_RAYS],
    hit: u64,
    /// Triangles that rays pass through, whose depths are still to be worked out: where they are, and whose. Their number.
    passed: [u32; PASSED],
    passed_by: [u8; PASSED],
    waiting: usize,
    /// A bit each: whose next is a node, whose is a leaf, and who waits for such a depth.
    at_node: u64,
    at_leaf: u64,
    waits: u64,
    /// A bit each: who has to be taken by itself.
    left_out: u64,
    stats: TraversalStats,
}

impl Default for StreamState {
    fn default() -> Self {
        Self {
            eights: [0; GROUPS],
            taken: 0,
            next_eight: 0,
            prepared: Prepared::NONE,
            next: [Child::NONE; STREAM_RAYS],
            top: [0; STREAM_RAYS],
            nears: [[0.0; DEPTH]; STREAM_RAYS],
            children: [[0; DEPTH]; STREAM_RAYS],
            t: [0.0; STREAM_RAYS],
            slot: [0; STREAM_RAYS],
            hit: 0,
            passed: [0; PASSED],
            passed_by: [0; PASSED],
            waiting: 0,
            at_node: 0,
            at_leaf: 0,
            waits: 0,
            left_out: 0,
            stats: TraversalStats::default(),
        }
    }
}

impl RayStream {
    /// What walking took so far.
    pub fn stats(&self) -> TraversalStats {
        self.state.as_ref().map_or(TraversalStats::default(), |state| state.stats)
    }

    /// Finds the nearest hits (with `any`, a hit) of eight more rays of a batch in mesh 0, in its space: which eight (their
    /// hits are the first of `nearest`), and those of them that have to be taken one by one, a bit each. Eights come in any
    /// order; the batch's last may be fewer. `None` if there are no more, and only then another batch may follow.
    #[inline(always)]
    pub fn next_eight<S: F32x8>(
        &mut self,
        bvh: &Bvh8,
        rays: &Batch,
        any: bool,
        nearest: &mut NearestHits,
    ) -> Option<(usize, u32)> {
        let state = self.state.get_or_insert_default();
        loop {
            let done = state.taken & !whole_bytes(state.at_node | state.at_leaf | state.waits);
            if done != 0 {
                let group = done.trailing_zeros() as usize / 8;
                state.taken &= !(0xff << (8 * group));
                return Some(state.leave(group, nearest));
            }
            while state.taken != u64::MAX && state.next_eight * 8 < rays.directions.len() {
                let group = (!state.taken).trailing_zeros() as usize / 8;
                state.enter::<S>(group, bvh, rays);
            }
            if state.taken == 0 {
                // Nobody is left: another batch may begin.
                state.next_eight = 0;
                return None;
            }
            // Those that come to a leaf now get there next time, when it has been asked for.
            let at_leaf = std::mem::take(&mut state.at_leaf);
            state.visit_nodes::<S>(bvh);
            state.visit_leaves::<S>(bvh, rays, any, at_leaf);
        }
    }
}

impl StreamState {
    /// Prepares the next eight rays and puts them at the root.
    #[inline(always)]
    fn enter<S: F32x8>(&mut self, group: usize, bvh: &Bvh8, rays: &Batch) {
        let eight_rays = self.next_eight;
        self.next_eight += 1;
        self.eights[group] = eight_rays;
        let places = 0xff << (8 * group);
        self.taken |= places;
        let (o, d) = rays.eight::<S>(eight_rays);
        let in_range = self.prepared.prepare::<S>(group, o, d, bvh.largest, (rays.t_min, rays.t_max));
        let all = 0xff_u32 >> (8 - (rays.directions.len() - 8 * eight_rays).min(8));
        self.left_out = self.left_out & !places | u64::from(all & !in_range) << (8 * group);
        if !bvh.nodes.is_empty() {
            self.at_node |= u64::from(all & in_range) << (8 * group);
        }
        self.hit &= !places;
        for place in 8 * group..8 * group + 8 {
            self.stacked(place).clear();
            (self.next[place], self.top[place], self.t[place]) = (Child::node(0), BOTTOM as u32, rays.t_max);
        }
    }

    /// Gives up a group's places: which eight rays they were, and those that have to be taken by themselves.
    #[inline(always)]
    fn leave(&self, group: usize, nearest: &mut NearestHits) -> (usize, u32) {
        let left_out = (self.left_out >> (8 * group)) as u32 & 0xff;
        nearest.clear();
        for k in 0..8 {
            let place = 8 * group + k;
            if (self.hit & !self.left_out) >> place & 1 != 0 {
                let (t, slot) = (self.t[place], TriangleRef(self.slot[place]));
                nearest.set(k, Some(NearestHit { t, placement: 0, slot }));
            }
        }
        (self.eights[group], left_out)
    }

    /// Which ray of the batch is in a place.
    #[inline(always)]
    fn ray(&self, place: usize) -> usize {
        8 * self.eights[place / 8] + place % 8
    }

    #[inline(always)]
    fn stacked(&mut self, ray: usize) -> StackSlices<'_> {
        StackSlices { nears: &mut self.nears[ray], children: &mut self.children[ray] }
    }

    /// Notes where a ray goes next, and asks for it; nowhere if its stack is empty.
    #[inline(always)]
    fn go<S: F32x8>(&mut self, bvh: &Bvh8, ray: usize, child: Child, top: usize) -> [u64; 2] {
        (self.next[ray], self.top[ray]) = (child, top as u32);
        let goes_on = u64::from(top >= BOTTOM) << ray;
        let to_leaf = u64::from(child.bits() >> 31) << ray;
        bvh.prefetch::<S>(child);
        [goes_on & !to_leaf, goes_on & to_leaf]
    }

    /// Takes all rays that are at a node a step further.
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
                self.left_out |= 1 << ray;
                continue;
            }
            let node = &bvh.nodes[self.next[ray].bits() as usize];
            let mut stacked = StackSlices { nears: &mut self.nears[ray], children: &mut self.children[ray] };
            let (child, top) = self.prepared.step::<S>(ray, node, &mut stacked, top);
            let [node, leaf] = self.go::<S>(bvh, ray, child, top);
            (to_node, to_leaf) = (to_node | node, to_leaf | leaf);
        }
        (self.at_node, self.at_leaf) = (to_node, to_leaf);
    }

    /// Takes all rays of a set, which are at a leaf, a step further; or lets them wait.
    #[inline(always)]
    fn visit_leaves<S: F32x8>(&mut self, bvh: &Bvh8, rays: &Batch, any: bool, at_leaf: u64) {
        let (mut rest, mut count, mut goes_on) = (at_leaf, self.waiting, 0);
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
            // Whether it is none or one is hard to tell beforehand: no branch. More are rare.
            loop {
                let lane = (maybe | 1 << 7).trailing_zeros() as usize;
                self.passed[count % PASSED] = TriangleRef::new(block_offset, lane).0;
                self.passed_by[count % PASSED] = ray as u8;
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
        // Fewer than eight only if nobody else has anything to do.
        let mut start = 0;
        while count - start >= WIDTH || (count > start && self.at_node | self.at_leaf | goes_on == 0) {
            let some = (count - start).min(WIDTH);
            let of = self.better::<S>(bvh, rays, any, start, some);
            start += some;
            // Whoever has another in the next eight goes on after that: its place is not to be given to someone else before.
            let next = u64::from(start < count) << (self.passed_by[start] as usize % STREAM_RAYS);
            goes_on |= of & !next;
            self.waits &= !goes_on;
        }
        self.waiting = count - start;
        self.passed.copy_within(start..start + WIDTH, 0);
        self.passed_by.copy_within(start..start + WIDTH, 0);
        let mut rest = goes_on;
        let (mut to_node, mut to_leaf) = (self.at_node, self.at_leaf);
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (STREAM_RAYS - 1);
            rest &= rest - 1;
            let z_max = S::splat(self.prepared.z_max[ray]);
            let top = self.top[ray] as usize;
            let (child, top) = self.stacked(ray).pop::<S>(z_max, top);
            let [node, leaf] = self.go::<S>(bvh, ray, child, top);
            (to_node, to_leaf) = (to_node | node, to_leaf | leaf);
        }
        (self.at_node, self.at_leaf) = (to_node, to_leaf);
    }

    /// Betters rays' hits by up to eight triangles that they pass through. Gives the rays, a bit each.
    #[inline(always)]
    fn better<S: F32x8>(&mut self, bvh: &Bvh8, rays: &Batch, any: bool, start: usize, count: usize) -> u64 {
        let mut slots: [u32; WIDTH] = self.passed[start..start + WIDTH].try_into().unwrap();
        let passed_by: [u8; WIDTH] = self.passed_by[start..start + WIDTH].try_into().unwrap();
        let (mut origins, mut directions) = ([DVec3::ZERO; WIDTH], [DVec3::ZERO; WIDTH]);
        let mut of = 0;
        for k in 0..count {
            let place = usize::from(passed_by[k]) % STREAM_RAYS;
            of |= 1 << place;
            let LocalRay { origin, direction } = rays.ray(self.ray(place));
            (origins[k], directions[k]) = (origin, direction);
        }
        // What is worked out for lanes past the last is not used.
        let first = slots[0];
        slots[count..].fill(first);
        let (corners, ids) = LeafBlock::corners::<S>(&bvh.blocks, S::U32x8::load(&slots));
        let [[x, y, z], [dx, dy, dz]] = [S::F64x8::load_xyz(&origins), S::F64x8::load_xyz(&directions)];
        let o = Xyz(x, y, z);
        let [a, b, c] = [in_f64(corners[0]), in_f64(corners[1]), in_f64(corners[2])];
        let facet = Facet::new([a.sub(o), b.sub(o), c.sub(o)]);
        let (depth, within) = facet.plane_depth(Xyz(dx, dy, dz));
        let (mut t, mut triangles) = ([0.0; WIDTH], [0; WIDTH]);
        depth.store(&mut t);
        ids.store(&mut triangles);
        for k in 0..count {
            let (ray, slot) = (usize::from(passed_by[k]) % STREAM_RAYS, slots[k]);
            if within >> k & 1 == 0 {
                t[k] = depth_in_box(bvh, TriangleRef(slot), rays.ray(self.ray(ray)));
            }
            let (t, known) = (t[k], self.t[ray]);
            let is_first = self.hit >> ray & 1 == 0;
            let beats = t < known
                || (t == known && (is_first || triangles[k] < id(bvh, TriangleRef(self.slot[ray]))));
            if beats && t >= rays.t_min {
                (self.t[ray], self.slot[ray]) = (t, slot);
                self.hit |= 1 << ray;
                self.prepared.limit(ray, t);
                if any {
                    // Nothing more to visit.
                    self.top[ray] = BOTTOM as u32;
                }
            }
        }
        of
    }
}

/// The depth of a triangle that is seen so edge-on that it isn't that of its plane. StoredPixels out of the loop, as it is rare.
#[cold]
#[inline(never)]
fn depth_in_box(bvh: &Bvh8, slot: TriangleRef, ray: LocalRay) -> f64 {
    let positions = LeafBlock::at(&bvh.blocks, slot.block_offset()).positions(slot.lane());
    Corners::from_positions(positions, ray.origin).depth(ray.direction)
}

/// All ones in the bytes that aren't 0.
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
    use crate::trace::Origins;
    use crate::trace::bvh;
    use crate::trace::simd::PortableF32x8;

    /// One triangle in front of the other, the nearer the smaller: each level leaves all but the nearest of a node's children.
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
        let rays = Batch { origins, directions: &directions, t_min: 0.0, t_max: f64::INFINITY };
        for (count, is_deep) in [(10, false), (1300, true)] {
            let bvh = nested(count);
            let (mut stream, mut nearest) = (RayStream::default(), NearestHits::new(rays.t_max));
            let mut seen = Vec::new();
            while let Some((eight, left_out)) =
                stream.next_eight::<PortableF32x8>(&bvh, &rays, false, &mut nearest)
            {
                let present = if eight == 2 { 0x0f } else { 0xff };
                assert_eq!(left_out, if is_deep { present } else { 0 }, "{count} triangles, eight {eight}");
                assert_eq!(nearest.hits(0), present & !left_out);
                seen.push(eight);
            }
            seen.sort();
            assert_eq!(seen, [0, 1, 2]);
        }
    }
}
