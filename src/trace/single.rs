//! Single rays of any origin and direction: bounces, shadow rays, and all others that make no packet. One ray is tested against
//! eight boxes or eight triangles at a time; [`stream`](super::stream) lets many rays take turns.
//!
//! # Boxes
//! Let w be the axis along which a ray mostly goes. Depth is counted along it: z = t·|d_w|. A ray enters a box at the largest of
//! three z and leaves it at the least of three, each of which is a plane times |d_w|/d_k, less a constant of the ray (Kay and
//! Kajiya, "Ray Tracing Complex Scenes", 1986). The boxes' padding holds the rounding of the planes. The rounding of the origin,
//! here and in the constant, costs a few 2⁻²⁴ of it, for which boxes grow by the slack in [`PreparedRay::prepare`]. The remaining
//! error is relative, and the far end grows by it (Ize, "Robust BVH Ray Traversal", 2013). A ray that hardly moves along an axis is
//! taken to move a little, by 2⁻⁶⁰ of its way, which is far less than the padding. The sign of the direction decides through
//! which of the two planes of an axis a ray enters, so it is the offset at which planes are loaded.
//!
//! A ray visits the nearest child next and the others in any order; only speed depends on that. Children are pushed with the
//! depth at which their boxes begin, and are dropped if that is beyond the depth of the nearest hit, rounded up. (To tell which
//! child is nearest, three bits of these depths are replaced by the child's lane.)
//!
//! # Triangles
//! Sheared along the ray, x′ = x − g_u·z and y′ = y − g_v·z (Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", 2013), the
//! edge b–c has the edge function E = x′_b·y′_c − y′_b·x′_c = det(g, b, c). Let u = 2⁻²⁴, s = |o|∞ + the largest |coordinate| of the
//! mesh, and X the largest |x′| or |y′| of a triangle. The x′ of a corner is off by (in units of u·s)
//!
//! | source | error |
//! |---|---|
//! | the origin is rounded and subtracted, in x and, times \|g\| ≤ 1, in z | 4 |
//! | g is rounded, times \|z\| | 1 |
//! | the product and the difference are at most 2s | 3 |
//!
//! The sum is δ = 8u·s. E is then off by at most 4δX + 2δ² + 4u·X² (two products and a difference), and X ≤ 2s + δ: by 40u·s·X
//! and terms in u²s², 128 of the first kind. [`EDGE`] and [`EDGE_SQUARED`] leave room. Three E beyond the bound on one side are
//! a hit, two on different sides are a miss, and [`exact`](super::exact) decides everything in between. Depths are computed by
//! the code of [`exact`](super::exact), so no other rounding reaches a result.

use std::hint::select_unpredictable;

use super::batch::NearestHit;
use super::bvh::{Bvh8, Child, LeafBlock, Node, TriangleRef, WIDTH};
use super::exact::{Candidate, Corners, Limits, LocalRay, Real, Xyz};
use super::rounding::{TINY, U};
use super::simd::{F32Lanes, F32x8, F32x16, F64x8, Mask8, U32x8};
use super::stats::TraversalStats;

/// The error of an edge function, in units of u·s·X.
const EDGE: f32 = 48.0;
/// The further error of an edge function, in units of u²·s².
const EDGE_SQUARED: f32 = 256.0;

/// The axes u, v and w for each w.
const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// A ray in the space of a mesh or of the scene, prepared for tests: those of boxes take its first cache line, those of triangles the next.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct PreparedRay {
    /// For each of x, y and z |d_w|/d_k, and then the term that is added to a plane times that where the ray enters; then the limits of
    /// the depth along w.
    enter: [f32; 8],
    /// For each of x, y and z the term that is added to a plane where the ray leaves, and then as bits the offset in a node's planes of
    /// those where the ray enters: 0, or [`WIDTH`] if it goes down the axis.
    leave: [f32; 8],
    /// d_u/d_w and d_v/d_w; the origin, in the order u, v, w; the error bound of an edge function, a factor of X and a constant; the axis
    /// w as bits.
    triangle: [f32; 8],
    /// |d_w|, the factor from depths along the ray to depths along w.
    stretch: f64,
}

/// The place in [`PreparedRay::enter`] of the limits of the depth along w.
const Z_MIN: usize = 6;
const Z_MAX: usize = 7;

impl PreparedRay {
    pub(super) const NONE: Self = Self { enter: [0.0; 8], leave: [0.0; 8], triangle: [0.0; 8], stretch: 0.0 };

    /// Prepares eight rays for hits from `t_min` to `t_max` in meshes whose largest |coordinates| are given, and writes them to these
    /// places among `rays`. Returns one bit for each ray that f32 can serve: it is finite, and the cubes of its coordinates stay within
    /// f32's range.
    #[inline(always)]
    pub(super) fn prepare<S: F32x8>(
        rays: &mut [Self],
        places: [usize; 8],
        o: Xyz<S::F64x8>,
        d: Xyz<S::F64x8>,
        largest: S::F64x8,
        (t_min, t_max): (S::F64x8, S::F64x8),
    ) -> u32 {
        let constant = S::F64x8::splat;
        let along = Xyz(d.0.abs(), d.1.abs(), d.2.abs());
        let away = Xyz(o.0.abs(), o.1.abs(), o.2.abs());
        let farthest = away.0.max(away.1).max(away.2);
        let stretch = along.0.max(along.1).max(along.2);
        // In this form NaN does not pass.
        let near_by = constant(1e12).sub(largest);
        let in_range = away.0.le(near_by) & away.1.le(near_by) & away.2.le(near_by);
        let in_range = in_range & constant(1e-30).le(stretch) & stretch.le(constant(1e30));
        let in_range = in_range & along.0.add(along.1).add(along.2).le(constant(1e31));

        let is_x = S::Mask8::from_bits(along.1.le(along.0) & along.2.le(along.0));
        let is_y = S::Mask8::from_bits(along.2.le(along.1));
        let per_stretch = constant(1.0).div(stretch);
        let parts =
            [d.0.mul(per_stretch).to_f32(), d.1.mul(per_stretch).to_f32(), d.2.mul(per_stretch).to_f32()];
        let at = [o.0.to_f32(), o.1.to_f32(), o.2.to_f32()];
        let slack = farthest.to_f32().mul_add(S::splat(8.0 * U), S::splat(TINY));
        let z_min = t_min.mul(stretch).to_f32().mul(S::splat(1.0 - 4.0 * U));
        let z_max = t_max.mul(stretch).to_f32().mul_add(S::splat(1.0 + 8.0 * U), S::splat(TINY));
        let zero = S::splat(0.0);
        let mut enter = [zero, zero, zero, zero, zero, zero, z_min, z_max.min(S::splat(f32::MAX))];
        let mut leave = [zero; 8];
        for axis in 0..3 {
            let signs = parts[axis].sign_bits();
            let least = S::splat(1.0 / (1_u64 << 60) as f32);
            let moves = parts[axis].abs().max(least).xor(signs);
            let inverse = S::splat(1.0).div(moves);
            // Boxes grow on both sides: the slack moves lower planes down and upper planes up.
            let slack = slack.xor(signs);
            let minus = inverse.neg();
            enter[axis] = inverse;
            enter[3 + axis] = at[axis].add(slack).mul(minus);
            leave[axis] = at[axis].sub(slack).mul(minus);
            leave[3 + axis] = S::U32x8::bitcast_from(signs).shift_right(S::U32x8::splat(28)).bitcast();
        }
        let signs = S::select(is_x, parts[0], S::select(is_y, parts[1], parts[2])).sign_bits();
        let gu = S::select(is_x, parts[1], S::select(is_y, parts[2], parts[0]));
        let gv = S::select(is_x, parts[2], S::select(is_y, parts[0], parts[1]));
        let size = farthest.add(largest).to_f32();
        let unit = size.mul(S::splat(U * (1.0 + 4.0 * U)));
        let number = |axis: u32| S::splat(f32::from_bits(axis));
        let triangle = [
            gu.xor(signs),
            gv.xor(signs),
            S::select(is_x, at[1], S::select(is_y, at[2], at[0])),
            S::select(is_x, at[2], S::select(is_y, at[0], at[1])),
            S::select(is_x, at[0], S::select(is_y, at[1], at[2])),
            unit.mul(S::splat(EDGE)),
            unit.mul(unit).mul_add(S::splat(EDGE_SQUARED), S::splat(TINY)),
            S::select(is_x, number(0), S::select(is_y, number(1), number(2))),
        ];
        let (enter, leave, triangle) = (S::transposed(enter), S::transposed(leave), S::transposed(triangle));
        let mut stretches = [0.0; 8];
        stretch.store(&mut stretches);
        for k in 0..8 {
            let ray = &mut rays[places[k]];
            enter[k].store(&mut ray.enter);
            leave[k].store(&mut ray.leave);
            triangle[k].store(&mut ray.triangle);
            ray.stretch = stretches[k];
        }
        in_range
    }

    /// The largest depth along w.
    #[inline(always)]
    pub(super) fn z_max(&self) -> f32 {
        self.enter[Z_MAX]
    }

    /// Ends the search at the depth of the nearest hit.
    #[inline(always)]
    pub(super) fn limit(&mut self, t: f64) {
        let z_max = (t * self.stretch) as f32 * (1.0 + 8.0 * U) + TINY;
        self.enter[Z_MAX] = z_max.min(f32::MAX);
    }

    /// Visits a node. Returns the nearest child that the ray may meet, or the next entry of the stack if it meets none, and the
    /// new top of the stack, onto which the other children are pushed.
    #[inline(always)]
    pub(super) fn visit_node<S: F32x8>(
        &self,
        node: &Node,
        stack: &mut StackSlices,
        top: usize,
    ) -> (Child, usize) {
        let (x, y, z) = (self.slab::<S>(node, 0), self.slab::<S>(node, 1), self.slab::<S>(node, 2));
        let z_max = S::splat(self.z_max());
        let near = x[0].max(y[0]).max(z[0].max(S::splat(self.enter[Z_MIN])));
        let far = x[1].min(y[1]).min(z[1]).mul(S::splat(1.0 + 8.0 * U)).min(z_max);
        let is_met = far.ge(near);
        let met = is_met.bits();
        // No branch depends on which child is nearest, or on whether there is any: both are unpredictable. The depths are
        // tagged with their lanes in the last three bits, so that the least one names its lane.
        let numbered = near.and(S::splat(f32::from_bits(!7))).xor(S::load(&LANES));
        let least = S::select(is_met, numbered, S::splat(f32::INFINITY)).reduce_min();
        let lane = (least.to_bits() & 7) as usize;
        let others = met & !(1 << lane);
        let (popped, popped_top) = stack.pop_if::<S>(met == 0, z_max, top);
        stack.push::<S>(near, node.children::<S>(), others, top);
        (
            select_unpredictable(met != 0, node.child[lane], popped),
            select_unpredictable(met != 0, top + others.count_ones() as usize, popped_top),
        )
    }

    /// The depths along w at which a ray enters and leaves the slabs of eight boxes along one axis.
    #[inline(always)]
    fn slab<S: F32x8>(&self, node: &Node, axis: usize) -> [S; 2] {
        let inverse = S::splat(self.enter[axis]);
        // The sign of the direction selects by address rather than by a branch, because directions come in any order.
        let start = self.leave[3 + axis].to_bits() as usize & WIDTH;
        let planes = &node.planes[axis];
        let near = S::load(planes[start..start + WIDTH].try_into().unwrap());
        let start = start ^ WIDTH;
        let far = S::load(planes[start..start + WIDTH].try_into().unwrap());
        [
            near.mul_add(inverse, S::splat(self.enter[3 + axis])),
            far.mul_add(inverse, S::splat(self.leave[axis])),
        ]
    }

    /// The x′ and y′ of vertices, and the larger of |x′| and |y′|.
    #[inline(always)]
    fn sheared<S: F32x8>(&self, [u, v, w]: [S::F32x16; 3]) -> [S::F32x16; 3] {
        let splat = S::F32x16::splat;
        let [gu, gv, ou, ov, ow, ..] = self.triangle;
        let z = w.sub(splat(ow));
        let x = splat(-gu).mul_add(z, u.sub(splat(ou)));
        let y = splat(-gv).mul_add(z, v.sub(splat(ov)));
        [x, y, x.abs().max(y.abs())]
    }

    /// The three edge functions of a ray for the triangles of a block, and the bound of their errors.
    #[inline(always)]
    fn edge_functions<S: F32x8>(&self, block: &LeafBlock) -> ([S; 3], S) {
        let corners = block.corner_vertices::<S>();
        let [.., factor, constant, w] = self.triangle;
        let [u, v, w] = AXES[w.to_bits() as usize % 3];
        let (u, v, w) = (block.coordinates::<S>(u), block.coordinates::<S>(v), block.coordinates::<S>(w));
        let first = self.sheared::<S>([u.0, v.0, w.0]);
        let (x, y, reach) = if let (Some(u), Some(v), Some(w)) = (u.1, v.1, w.1) {
            let more = self.sheared::<S>([
                S::F32x16::from_halves(u, u),
                S::F32x16::from_halves(v, v),
                S::F32x16::from_halves(w, w),
            ]);
            (
                S::lookup(first[0], Some(more[0].halves().0), corners),
                S::lookup(first[1], Some(more[1].halves().0), corners),
                S::lookup(first[2], Some(more[2].halves().0), corners),
            )
        } else {
            (
                S::lookup(first[0], None, corners),
                S::lookup(first[1], None, corners),
                S::lookup(first[2], None, corners),
            )
        };
        let ea = x[1].mul_sub(y[2], y[1].mul(x[2]));
        let eb = x[2].mul_sub(y[0], y[2].mul(x[0]));
        let ec = x[0].mul_sub(y[1], y[0].mul(x[1]));
        let reach = reach[0].max(reach[1]).max(reach[2]);
        ([ea, eb, ec], reach.mul_add(S::splat(factor), S::splat(constant)))
    }

    /// The triangles of a block that a ray may hit, one bit each, and those that it certainly hits.
    #[inline(always)]
    pub(super) fn test_leaf<S: F32x8>(&self, block: &LeafBlock) -> (u32, u32) {
        let ([ea, eb, ec], bound) = self.edge_functions::<S>(block);
        let (least, most) = (ea.min(eb).min(ec), ea.max(eb).max(ec));
        let outer = bound.neg();
        // In this form a NaN is no miss.
        let miss = most.ge(bound).and(outer.ge(least)).bits();
        let maybe = !miss & ((1 << block.triangles) - 1);
        (maybe, least.ge(bound).or(outer.ge(most)).bits())
    }
}

/// The lanes 0 to 7 as the bits of f32 numbers.
const LANES: [f32; 8] = {
    let mut lanes = [0.0; 8];
    let mut lane = 0;
    while lane < 8 {
        lanes[lane] = f32::from_bits(lane as u32);
        lane += 1;
    }
    lanes
};

/// The memory of a traversal stack, the next entry on top: children, and the depths along w at which their boxes begin. The entry
/// below [`BOTTOM`] ends the traversal, and is never too far.
pub(super) struct StackSlices<'s> {
    pub(super) nears: &'s mut [f32],
    pub(super) children: &'s mut [u32],
}

/// The top of an empty stack. There are always eight entries below the top to look at.
pub(super) const BOTTOM: usize = 8;

impl StackSlices<'_> {
    /// Makes this an empty stack.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        (self.nears[BOTTOM - 1], self.children[BOTTOM - 1]) = (f32::NEG_INFINITY, Child::node(0).bits());
    }

    /// Pushes the children of a node whose bit is set. (Writes eight entries.)
    #[inline(always)]
    fn push<S: F32x8>(&mut self, nears: S, children: S::U32x8, which: u32, top: usize) {
        let children = S::U32x8::bitcast_from(children.bitcast().compress_by_bits(which));
        nears.compress_by_bits(which).store((&mut self.nears[top..top + 8]).try_into().unwrap());
        children.store((&mut self.children[top..top + 8]).try_into().unwrap());
    }

    /// Pops the next child that is not too far, and returns it with the new top.
    #[inline(always)]
    pub(super) fn pop<S: F32x8>(&self, z_max: S, top: usize) -> (Child, usize) {
        self.pop_if::<S>(true, z_max, top)
    }

    /// [`StackSlices::pop`], or any child and top if none is needed.
    #[inline(always)]
    fn pop_if<S: F32x8>(&self, is_needed: bool, z_max: S, top: usize) -> (Child, usize) {
        let mut start = top - 8;
        let mut within = z_max.ge(S::load(self.nears[start..top].try_into().unwrap())).bits();
        while is_needed && within == 0 {
            start -= 8;
            within = z_max.ge(S::load(self.nears[start..start + 8].try_into().unwrap())).bits();
        }
        let at = start + 7 - ((within | 1) << 24).leading_zeros() as usize;
        (Child::from_bits(self.children[at]), at)
    }
}

/// A ray that is traced alone.
pub(super) struct SingleRay {
    ray: LocalRay,
    prepared: PreparedRay,
}

/// The traversal stack of a ray that is traced alone.
#[derive(Default)]
pub(super) struct RayStack {
    nears: Vec<f32>,
    children: Vec<u32>,
    top: usize,
    pub stats: TraversalStats,
}

impl RayStack {
    /// Pushes the root of a hierarchy onto an empty stack.
    #[inline(always)]
    pub fn push_root(&mut self, bvh: &Bvh8) {
        self.reserve(BOTTOM);
        self.slices().clear();
        self.top = BOTTOM;
        if !bvh.nodes.is_empty() {
            (self.nears[BOTTOM], self.children[BOTTOM]) = (f32::NEG_INFINITY, Child::node(0).bits());
            self.top += 1;
        }
    }

    #[inline(always)]
    fn slices(&mut self) -> StackSlices<'_> {
        StackSlices { nears: &mut self.nears, children: &mut self.children }
    }

    /// Reserves the memory for the children of a node.
    #[inline(always)]
    fn reserve(&mut self, top: usize) {
        if top + WIDTH > self.nears.len() {
            self.grow();
        }
    }

    #[cold]
    #[inline(never)]
    fn grow(&mut self) {
        let length = (self.nears.len() * 2).max(128);
        self.nears.resize(length, 0.0);
        self.children.resize(length, 0);
    }
}

impl SingleRay {
    /// Prepares a ray for hits within limits on its depth, in a mesh whose largest |coordinate| is `largest`. Returns `None` if
    /// the ray is not finite or cubes of its coordinates leave f32's range.
    #[inline(always)]
    pub fn new<S: F32x8>(ray: LocalRay, largest: f32, limits: &Limits) -> Option<Self> {
        let mut prepared = PreparedRay::NONE;
        let limits = (S::F64x8::splat(limits.t_min), S::F64x8::splat(limits.t_max));
        let (o, d) = (Xyz::constant(ray.origin), Xyz::constant(ray.direction));
        let largest = S::F64x8::splat(largest.into());
        let in_range =
            PreparedRay::prepare::<S>(std::slice::from_mut(&mut prepared), [0; 8], o, d, largest, limits);
        (in_range != 0).then_some(Self { ray, prepared })
    }

    /// Ends the search at the depth of the nearest hit.
    #[inline(always)]
    pub fn limit(&mut self, t: f64) {
        self.prepared.limit(t);
    }

    /// The next leaf whose box the ray may meet, nearer boxes first.
    #[inline(always)]
    pub fn next_leaf<S: F32x8>(&self, bvh: &Bvh8, stack: &mut RayStack) -> Option<u32> {
        let z_max = S::splat(self.prepared.z_max());
        let mut top = stack.top;
        let mut child;
        (child, top) = stack.slices().pop::<S>(z_max, top);
        while top >= BOTTOM {
            match child.get() {
                Ok(leaf) => {
                    stack.top = top;
                    return Some(leaf);
                }
                Err(node) => {
                    stack.stats.nodes += 1;
                    stack.reserve(top);
                    let before = top;
                    (child, top) =
                        self.prepared.visit_node::<S>(&bvh.nodes[node as usize], &mut stack.slices(), top);
                    for pushed in before..top {
                        bvh.prefetch::<S>(Child::from_bits(stack.children[pushed]));
                    }
                }
            }
        }
        stack.top = BOTTOM;
        None
    }

    /// Replaces `best` by the nearest hit in a block, if that is nearer, and returns whether it did. `AFTER` tells whether
    /// [`Limits::after`] counts.
    #[inline(always)]
    pub fn test_leaf<S: F32x8, const AFTER: bool>(
        &mut self,
        bvh: &Bvh8,
        block_offset: u32,
        placement: u32,
        limits: &Limits,
        best: &mut Option<NearestHit>,
        stats: &mut TraversalStats,
    ) -> bool {
        let block = LeafBlock::at(&bvh.blocks, block_offset);
        let (mut maybe, sure) = self.prepared.test_leaf::<S>(&block);
        stats.leaves += 1;
        stats.tests += block.triangles as u64;
        if maybe & !sure != 0 {
            maybe = maybe & sure | passing(block, maybe & !sure, self.ray, stats);
        }
        let mut found_any = false;
        while maybe != 0 {
            let lane = maybe.trailing_zeros() as usize;
            maybe &= maybe - 1;
            let corners = Corners::from_positions(block.positions(lane), self.ray.origin);
            let t = corners.depth(self.ray.direction);
            let found = Candidate { t, placement, triangle: block.id(lane) };
            let beats = |known: &NearestHit| {
                // The triangle's id decides only within a placement.
                let triangle = if known.placement == placement { id(bvh, known.triangle) } else { 0 };
                found.beats(&Candidate { t: known.t, placement: known.placement, triangle })
            };
            if limits.admits_for::<AFTER>(&found) && best.as_ref().is_none_or(beats) {
                *best = Some(NearestHit { t, placement, triangle: TriangleRef::new(block_offset, lane) });
                self.limit(t);
                found_any = true;
            }
        }
        found_any
    }
}

/// The id of a triangle in its mesh.
#[inline(always)]
pub(super) fn id(bvh: &Bvh8, triangle: TriangleRef) -> u32 {
    LeafBlock::at(&bvh.blocks, triangle.block_offset()).id(triangle.lane())
}

/// Decides in f64, and exactly where that does not suffice, which of some triangles of a block a ray passes through, one bit each.
/// This is kept out of the loop, because few rays come so close to an edge.
#[cold]
#[inline(never)]
pub(super) fn passing(block: LeafBlock, mut maybe: u32, ray: LocalRay, stats: &mut TraversalStats) -> u32 {
    let mut passed = maybe;
    while maybe != 0 {
        let lane = maybe.trailing_zeros() as usize;
        maybe &= maybe - 1;
        let corners = Corners::from_positions(block.positions(lane), ray.origin);
        if !corners.passes_counted(ray.direction, stats) {
            passed &= !(1 << lane);
        }
    }
    passed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;
    use crate::trace::adversary::Case;
    use crate::trace::bvh;
    use crate::trace::dyadic::{Dyadic, determinant, difference};
    use crate::trace::simd::{self, PortableF32x8, SimdTask};
    use glam::DVec3;

    /// Measures the largest error of an edge function in units of which the bound has [`EDGE`], and the number of tests.
    struct Measure;

    impl SimdTask for Measure {
        type Output = (f64, usize);

        #[inline(always)]
        fn run<S: F32x8>(self) -> (f64, usize) {
            let mut rng = Rng::new(2);
            let (mut largest, mut tests) = (0.0_f64, 0);
            for _ in 0..1500 {
                let case = Case::new(&mut rng, 1.0);
                let bvh = bvh::build(&case.mesh);
                for (&origin, &direction) in case.origins.iter().zip(&case.directions) {
                    let ray = LocalRay { origin, direction };
                    let limits = Limits { t_min: 0.0, t_max: f64::INFINITY, after: None };
                    let Some(single) = SingleRay::new::<S>(ray, bvh.largest, &limits) else { continue };
                    let mut stack = RayStack::default();
                    stack.push_root(&bvh);
                    while let Some(offset) = single.next_leaf::<S>(&bvh, &mut stack) {
                        let block = LeafBlock::at(&bvh.blocks, offset);
                        largest = largest.max(error_of::<S>(&single, &block));
                        tests += block.triangles;
                    }
                }
            }
            (largest, tests)
        }
    }

    #[inline(always)]
    fn error_of<S: F32x8>(single: &SingleRay, block: &LeafBlock) -> f64 {
        let (edges, bound) = single.prepared.edge_functions::<S>(block);
        let stored = |x: S| {
            let mut to = [0.0; 8];
            x.store(&mut to);
            to
        };
        let (edges, bound) = (edges.map(stored), stored(bound));
        let axes = AXES[single.prepared.triangle[7].to_bits() as usize];
        let in_axes = |p: DVec3| axes.map(|axis| Dyadic::of(p[axis]));
        // With the ray's direction d in place of g, everything is d_w times as large.
        let (o, d) = (in_axes(single.ray.origin), in_axes(single.ray.direction));
        let mut largest = 0.0_f64;
        for lane in 0..block.triangles {
            let corners = block.positions(lane).map(|p| in_axes(DVec3::from(p.map(f64::from))));
            let [a, b, c] = [0, 1, 2].map(|k| difference(&corners[k], &o));
            let exact = [determinant(&d, &b, &c), determinant(&d, &c, &a), determinant(&d, &a, &b)];
            for (found, exact) in edges.iter().zip(exact) {
                let error = Dyadic::of(found[lane].into()) * d[2].clone() - exact;
                let error = error.abs().to_f64() / d[2].to_f64().abs();
                largest = largest.max(error / f64::from(bound[lane]) * f64::from(EDGE));
            }
        }
        largest
    }

    /// The largest error seen was 4.1 of [`EDGE`]. [`EDGE_SQUARED`] matters only for triangles that the ray sees smaller than the
    /// rounding of their coordinates.
    #[test]
    fn the_bound_of_edge_functions_holds() {
        let (mut largest, mut tests) = Measure.run::<PortableF32x8>();
        #[cfg(target_arch = "x86_64")]
        {
            let mut more = Vec::new();
            more.extend(simd::has_avx2().then(|| simd::run_with_avx2(Measure)));
            more.extend(simd::has_avx512().then(|| simd::run_with_avx512(Measure)));
            for (error, count) in more {
                (largest, tests) = (largest.max(error), tests + count);
            }
        }
        assert!(tests > 10_000, "{tests}");
        assert!(largest <= f64::from(EDGE), "{largest}");
    }
}
