//! Single rays of any origin: bounces, shadow tests, whatever is no packet. One ray against eight boxes or eight triangles,
//! and up to 64 rays side by side ([`together`]).
//!
//! # Boxes
//! With w the axis along which a ray mostly goes, depth is counted along it: z = t·|d_w|. A ray enters a box at the largest
//! of three z and leaves it at the least, each a plane times d_w/d_k less a constant of the ray (Kay and Kajiya, "Ray Tracing
//! Complex Scenes", 1986). The planes' rounding is in the boxes' padding; that of the origin, here and in the constant, takes
//! a few 2⁻²⁴ of it, for which boxes grow by [`Prepared`]'s slack; what is left is relative, and the far end gives way for it
//! (Ize, "Robust BVH Ray Traversal", 2013). A ray that hardly moves along an axis is taken to move a little: by 2⁻⁶⁰ of its
//! way, which is far less than the padding. Which plane it enters by is a matter of its direction's sign, and planes are read
//! from where those lie.
//!
//! The nearest child comes next, the others in any order: that is for speed only. They are kept with where their boxes begin
//! as it was computed, and dropped if that is beyond the nearest hit's depth, rounded up. (Only the numbers that tell which
//! child is nearest lose three bits, to the child's own number.)
//!
//! # Triangles
//! Seen along the ray, x′ = x − g_u·z and y′ = y − g_v·z (Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection",
//! 2013), the edge b–c has E = x′_b·y′_c − y′_b·x′_c = det(g, b, c). With u = 2⁻²⁴, s = |o|∞ + the largest |coordinate| of the
//! mesh, and X the largest |x′|, |y′| of a triangle, a corner's x′ is off by (in units of u·s)
//!
//! | from | error |
//! |---|---|
//! | the origin's rounding and the subtraction, in x and, times \|g\| ≤ 1, in z | 4 |
//! | the rounding of g, times \|z\| | 1 |
//! | the product and the difference, of size 2s at most | 3 |
//!
//! δ = 8u·s in all. E is then off by at most 4δX + 2δ² + 4u·X² (two products and a difference), and X ≤ 2s + δ: by
//! 40u·s·X and terms in u²s², 128 of the first kind. [`EDGE`] and [`EDGE_SQUARED`] leave room. All three E beyond the bound on
//! one side are a hit, two on different sides are a miss, and what lies between is decided by [`exact`](super::exact). Depths
//! are those of [`exact`](super::exact), by the same code, so nothing is decided by any that is rounded otherwise.

use std::hint::select_unpredictable;

use super::bvh::{Bvh8, Child, LeafBlock, Node, TriangleRef, WIDTH};
use super::exact::{Candidate, Corners, LocalRay, Real, Xyz};
use super::packet::{TINY, U};
use super::simd::{F32x8, F32x16, F64x8, Mask8, U32x8};
use super::stats::TraversalStats;
use super::tracer::NearestHit;

/// Error of an edge function in units of u·s·X, and in units of u²·s².
const EDGE: f32 = 48.0;
const EDGE_SQUARED: f32 = 256.0;

/// u, v and w for each w.
const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// Rays in the space of a mesh (or of the scene), prepared.
pub(super) struct Prepared<const N: usize> {
    /// Of each of x, y, z: |d_w|/d_k, and what is added to planes times that, to those where the ray enters and those where it
    /// leaves.
    inverse: [[f32; N]; 3],
    from_near: [[f32; N]; 3],
    from_far: [[f32; N]; 3],
    /// Where in a node's planes those begin where the ray enters: 0, or [`WIDTH`] if it goes down the axis.
    near: [[u32; N]; 3],
    /// Depths along w that hits may have.
    z_min: [f32; N],
    pub(super) z_max: [f32; N],
    /// Which axis is w.
    pub(super) w: [u32; N],
    /// d_u/d_w and d_v/d_w.
    g: [[f32; N]; 2],
    /// The origin, in the order u, v, w.
    origin: [[f32; N]; 3],
    /// The bound of an edge function's error: times X, and alone.
    bound: [[f32; N]; 2],
    /// |d_w|: what depths are times, to be along w.
    stretch: [f64; N],
}

impl<const N: usize> Prepared<N> {
    pub(super) const NONE: Self = Self {
        inverse: [[0.0; N]; 3],
        from_near: [[0.0; N]; 3],
        from_far: [[0.0; N]; 3],
        near: [[0; N]; 3],
        z_min: [0.0; N],
        z_max: [0.0; N],
        w: [0; N],
        g: [[0.0; N]; 2],
        origin: [[0.0; N]; 3],
        bound: [[0.0; N]; 2],
        stretch: [0.0; N],
    };

    /// Prepares the eight rays of a group for hits from `t_min` to `t_max`. Gives a bit each for those that f32 is of use
    /// for: finite, and of sizes whose cubes don't leave f32's range.
    #[inline(always)]
    pub(super) fn prepare<S: F32x8>(
        &mut self,
        group: usize,
        o: Xyz<S::F64x8>,
        d: Xyz<S::F64x8>,
        largest: f32,
        (t_min, t_max): (f64, f64),
    ) -> u32 {
        let constant = S::F64x8::splat;
        let along = Xyz(d.0.abs(), d.1.abs(), d.2.abs());
        let away = Xyz(o.0.abs(), o.1.abs(), o.2.abs());
        let farthest = away.0.max(away.1).max(away.2);
        let stretch = along.0.max(along.1).max(along.2);
        // (In this form NaN doesn't pass.)
        let near_by = constant(1e12 - f64::from(largest));
        let in_range = away.0.le(near_by) & away.1.le(near_by) & away.2.le(near_by);
        let in_range = in_range & constant(1e-30).le(stretch) & stretch.le(constant(1e30));
        let in_range = in_range & along.0.add(along.1).add(along.2).le(constant(1e31));

        let is_x = S::Mask8::from_bits(along.1.le(along.0) & along.2.le(along.0));
        let is_y = S::Mask8::from_bits(along.2.le(along.1));
        let numbers = |k: u32| S::splat(f32::from_bits(k));
        let w = S::select(is_x, numbers(0), S::select(is_y, numbers(1), numbers(2)));
        S::U32x8::bitcast_from(w).store(part(&mut self.w, group));

        let per_stretch = constant(1.0).div(stretch);
        let parts =
            [d.0.mul(per_stretch).to_f32(), d.1.mul(per_stretch).to_f32(), d.2.mul(per_stretch).to_f32()];
        let at = [o.0.to_f32(), o.1.to_f32(), o.2.to_f32()];
        let slack = farthest.to_f32().mul_add(S::splat(8.0 * U), S::splat(TINY));
        for axis in 0..3 {
            let signs = parts[axis].sign_bits();
            let least = S::splat(1.0 / (1_u64 << 60) as f32);
            let moves = parts[axis].abs().max(least).xor(signs);
            let inverse = S::splat(1.0).div(moves);
            // Boxes grow on both sides: a lower plane is the nearer by the slack, an upper one the farther.
            let slack = slack.xor(signs);
            let minus = inverse.neg();
            inverse.store(part(&mut self.inverse[axis], group));
            at[axis].add(slack).mul(minus).store(part(&mut self.from_near[axis], group));
            at[axis].sub(slack).mul(minus).store(part(&mut self.from_far[axis], group));
            let eights = S::U32x8::bitcast_from(signs).shift_right(S::U32x8::splat(28));
            eights.store(part(&mut self.near[axis], group));
        }
        let signs = S::select(is_x, parts[0], S::select(is_y, parts[1], parts[2])).sign_bits();
        let gu = S::select(is_x, parts[1], S::select(is_y, parts[2], parts[0]));
        let gv = S::select(is_x, parts[2], S::select(is_y, parts[0], parts[1]));
        gu.xor(signs).store(part(&mut self.g[0], group));
        gv.xor(signs).store(part(&mut self.g[1], group));
        let u = S::select(is_x, at[1], S::select(is_y, at[2], at[0]));
        let v = S::select(is_x, at[2], S::select(is_y, at[0], at[1]));
        let w = S::select(is_x, at[0], S::select(is_y, at[1], at[2]));
        u.store(part(&mut self.origin[0], group));
        v.store(part(&mut self.origin[1], group));
        w.store(part(&mut self.origin[2], group));

        let size = farthest.add(constant(f64::from(largest))).to_f32();
        let unit = size.mul(S::splat(U * (1.0 + 4.0 * U)));
        unit.mul(S::splat(EDGE)).store(part(&mut self.bound[0], group));
        unit.mul(unit).mul_add(S::splat(EDGE_SQUARED), S::splat(TINY)).store(part(&mut self.bound[1], group));
        let z_min = constant(t_min).mul(stretch).to_f32().mul(S::splat(1.0 - 4.0 * U));
        z_min.store(part(&mut self.z_min, group));
        let z_max = constant(t_max).mul(stretch).to_f32().mul_add(S::splat(1.0 + 8.0 * U), S::splat(TINY));
        z_max.min(S::splat(f32::MAX)).store(part(&mut self.z_max, group));
        stretch.store(part(&mut self.stretch, group));
        in_range
    }

    /// Hits of a ray beyond this depth are of no more use.
    #[inline(always)]
    pub(super) fn limit(&mut self, ray: usize, t: f64) {
        let z_max = (t * self.stretch[ray]) as f32 * (1.0 + 8.0 * U) + TINY;
        self.z_max[ray] = z_max.min(f32::MAX);
    }

    /// Visits a node: gives the nearest child that the ray may meet, or if there is none, what is next on the stack; and the
    /// stack's top, below which the other children are now.
    #[inline(always)]
    pub(super) fn step<S: F32x8>(
        &self,
        ray: usize,
        node: &Node,
        stack: &mut StackSlices,
        top: usize,
    ) -> (Child, usize) {
        let (x, y, z) =
            (self.slab::<S>(ray, node, 0), self.slab::<S>(ray, node, 1), self.slab::<S>(ray, node, 2));
        let z_max = S::splat(self.z_max[ray]);
        let near = x[0].max(y[0]).max(z[0].max(S::splat(self.z_min[ray])));
        let far = x[1].min(y[1]).min(z[1]).mul(S::splat(1.0 + 8.0 * U)).min(z_max);
        let is_met = far.ge(near);
        let met = is_met.bits();
        // Nothing predicts which child is nearest, nor whether there is any, so there are no branches on it. The nearest has
        // the least of numbers that end in the lanes' own.
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

    /// Where a ray enters and leaves the boxes' slabs along one axis.
    #[inline(always)]
    fn slab<S: F32x8>(&self, ray: usize, node: &Node, axis: usize) -> [S; 2] {
        let inverse = S::splat(self.inverse[axis][ray]);
        // Found by address rather than branched on: directions come in any order.
        let start = self.near[axis][ray] as usize & WIDTH;
        let planes = &node.planes[axis];
        let near = S::load(planes[start..start + WIDTH].try_into().unwrap());
        let start = start ^ WIDTH;
        let far = S::load(planes[start..start + WIDTH].try_into().unwrap());
        [
            near.mul_add(inverse, S::splat(self.from_near[axis][ray])),
            far.mul_add(inverse, S::splat(self.from_far[axis][ray])),
        ]
    }

    /// x′ and y′ of vertices, and the larger |x′| or |y′|.
    #[inline(always)]
    fn sheared<S: F32x8>(&self, ray: usize, [u, v, w]: [S::F32x16; 3]) -> [S::F32x16; 3] {
        let splat = S::F32x16::splat;
        let z = w.sub(splat(self.origin[2][ray]));
        let x = splat(-self.g[0][ray]).mul_add(z, u.sub(splat(self.origin[0][ray])));
        let y = splat(-self.g[1][ray]).mul_add(z, v.sub(splat(self.origin[1][ray])));
        [x, y, x.abs().max(y.abs())]
    }

    /// The triangles of a block that a ray may hit, a bit each, and those of them that it surely does.
    #[inline(always)]
    pub(super) fn test_leaf<S: F32x8>(&self, ray: usize, block: &LeafBlock) -> (u32, u32) {
        let corners = block.corner_vertices::<S>();
        let [u, v, w] = AXES[self.w[ray] as usize % 3];
        let (u, v, w) = (block.coordinates::<S>(u), block.coordinates::<S>(v), block.coordinates::<S>(w));
        let first = self.sheared::<S>(ray, [u.0, v.0, w.0]);
        let (x, y, reach) = if let (Some(u), Some(v), Some(w)) = (u.1, v.1, w.1) {
            let more = self.sheared::<S>(
                ray,
                [S::F32x16::from_halves(u, u), S::F32x16::from_halves(v, v), S::F32x16::from_halves(w, w)],
            );
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
        let (least, most) = (ea.min(eb).min(ec), ea.max(eb).max(ec));
        let reach = reach[0].max(reach[1]).max(reach[2]);
        let bound = reach.mul_add(S::splat(self.bound[0][ray]), S::splat(self.bound[1][ray]));
        let outer = bound.neg();
        // In this form nothing that isn't a number passes for a miss.
        let miss = most.ge(bound).and(outer.ge(least)).bits();
        let maybe = !miss & ((1 << block.triangles) - 1);
        (maybe, least.ge(bound).or(outer.ge(most)).bits())
    }
}

/// Lanes' numbers, as bits.
const LANES: [f32; 8] = {
    let mut lanes = [0.0; 8];
    let mut lane = 0;
    while lane < 8 {
        lanes[lane] = f32::from_bits(lane as u32);
        lane += 1;
    }
    lanes
};

/// A group's part of what there is of rays.
#[inline(always)]
fn part<T, const N: usize>(of_rays: &mut [T; N], group: usize) -> &mut [T; 8] {
    (&mut of_rays[8 * group..8 * group + 8]).try_into().unwrap()
}

/// Room for what is to be visited, the next at the top: children, and where their boxes begin along w. Below [`BOTTOM`], the
/// first of all, is what ends the walk, and is never too far.
pub(super) struct StackSlices<'s> {
    pub(super) nears: &'s mut [f32],
    pub(super) children: &'s mut [u32],
}

/// Where an empty stack's top is: there are always eight to look at below.
pub(super) const BOTTOM: usize = 8;

impl StackSlices<'_> {
    /// Makes it an empty stack.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        (self.nears[BOTTOM - 1], self.children[BOTTOM - 1]) = (f32::NEG_INFINITY, Child::node(0).bits());
    }

    /// Puts those of a node's children on the stack whose bit is set. (Writes eight.)
    #[inline(always)]
    fn push<S: F32x8>(&mut self, nears: S, children: S::U32x8, which: u32, top: usize) {
        let children = S::U32x8::bitcast_from(children.bitcast().compress_by_bits(which));
        nears.compress_by_bits(which).store((&mut self.nears[top..top + 8]).try_into().unwrap());
        children.store((&mut self.children[top..top + 8]).try_into().unwrap());
    }

    /// Takes the next that is not too far, and gives the top where it was.
    #[inline(always)]
    pub(super) fn pop<S: F32x8>(&self, z_max: S, top: usize) -> (Child, usize) {
        self.pop_if::<S>(true, z_max, top)
    }

    /// The same; anything if it isn't needed.
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

/// A ray by itself.
pub(super) struct SingleRay {
    ray: LocalRay,
    /// Eight times the same.
    prepared: Prepared<8>,
}

/// What a ray by itself is to visit.
#[derive(Default)]
pub(super) struct Stack {
    nears: Vec<f32>,
    children: Vec<u32>,
    top: usize,
    pub stats: TraversalStats,
}

impl Stack {
    /// Puts the root on an empty stack.
    #[inline(always)]
    pub fn start(&mut self, bvh: &Bvh8) {
        self.make_room(BOTTOM);
        self.stacked().clear();
        self.top = BOTTOM;
        if !bvh.nodes.is_empty() {
            (self.nears[BOTTOM], self.children[BOTTOM]) = (f32::NEG_INFINITY, Child::node(0).bits());
            self.top += 1;
        }
    }

    #[inline(always)]
    fn stacked(&mut self) -> StackSlices<'_> {
        StackSlices { nears: &mut self.nears, children: &mut self.children }
    }

    /// Makes room for a node's children.
    #[inline(always)]
    fn make_room(&mut self, top: usize) {
        if top + WIDTH > self.nears.len() {
            self.lengthen();
        }
    }

    #[cold]
    #[inline(never)]
    fn lengthen(&mut self) {
        let length = (self.nears.len() * 2).max(128);
        self.nears.resize(length, 0.0);
        self.children.resize(length, 0);
    }
}

impl SingleRay {
    /// Prepares a ray for hits from `t_min` to `t_max`. `None` if f32 is no use for it: not finite, or of sizes whose cubes
    /// leave f32's range.
    #[inline(always)]
    pub fn new<S: F32x8>(ray: LocalRay, largest: f32, limits: (f64, f64)) -> Option<Self> {
        let mut prepared = Prepared::NONE;
        let (o, d) = (Xyz::constant(ray.origin), Xyz::constant(ray.direction));
        let in_range = prepared.prepare::<S>(0, o, d, largest, limits);
        (in_range != 0).then_some(Self { ray, prepared })
    }

    /// Hits beyond this depth are of no more use.
    #[inline(always)]
    pub fn limit(&mut self, t: f64) {
        self.prepared.limit(0, t);
    }

    /// Calls for every leaf whose box the ray may meet come from here: the next one, nearer boxes first.
    #[inline(always)]
    pub fn next_leaf<S: F32x8>(&self, bvh: &Bvh8, stack: &mut Stack) -> Option<u32> {
        let z_max = S::splat(self.prepared.z_max[0]);
        let mut top = stack.top;
        let mut child;
        (child, top) = stack.stacked().pop::<S>(z_max, top);
        while top >= BOTTOM {
            match child.get() {
                Ok(leaf) => {
                    stack.top = top;
                    return Some(leaf);
                }
                Err(node) => {
                    stack.stats.nodes += 1;
                    stack.make_room(top);
                    let before = top;
                    (child, top) =
                        self.prepared.step::<S>(0, &bvh.nodes[node as usize], &mut stack.stacked(), top);
                    for pushed in before..top {
                        bvh.prefetch::<S>(Child::from_bits(stack.children[pushed]));
                    }
                }
            }
        }
        stack.top = BOTTOM;
        None
    }

    /// Betters `best` by the triangles of a block; true if it did.
    #[inline(always)]
    pub fn test_leaf<S: F32x8>(
        &mut self,
        bvh: &Bvh8,
        block_offset: u32,
        placement: u32,
        limits: (f64, f64),
        best: &mut Option<NearestHit>,
        stats: &mut TraversalStats,
    ) -> bool {
        let (t_min, t_max) = limits;
        let block = LeafBlock::at(&bvh.blocks, block_offset);
        let (mut maybe, sure) = self.prepared.test_leaf::<S>(0, &block);
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
                // The triangle matters only if it is of this placement.
                let triangle = if known.placement == placement { id(bvh, known.slot) } else { 0 };
                found.beats(&Candidate { t: known.t, placement: known.placement, triangle })
            };
            if (t_min..=t_max).contains(&t) && best.as_ref().is_none_or(beats) {
                *best = Some(NearestHit { t, placement, slot: TriangleRef::new(block_offset, lane) });
                self.limit(t);
                found_any = true;
            }
        }
        found_any
    }
}

/// A triangle's id in its mesh.
#[inline(always)]
pub(super) fn id(bvh: &Bvh8, slot: TriangleRef) -> u32 {
    LeafBlock::at(&bvh.blocks, slot.block_offset()).id(slot.lane())
}

/// Those of some triangles of a block that a ray passes through, a bit each. StoredPixels out of the loop: few come so close to an
/// edge.
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
