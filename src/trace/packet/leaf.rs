//! The test of a leaf's triangles against a packet's rays: decisions in f32 where they are certain, in f64 and exactly elsewhere.
//!
//! # The decision in f32
//! Let a, b, c be the corners of a triangle relative to o, rounded. The edge function of the edge b–c is
//! E = g·((c−b) × (c+b)) = −2 det(g, b, c). These are Segura and Feito's signed volumes, in the form that is precomputed for a
//! common origin and costs one dot product an edge and ray. A ray passes through the triangle when the three edge functions
//! have one sign. With u = 2⁻²⁴, L the largest side of the triangle's box (plus 4uM for the rounding of the corners), M the
//! largest |coordinate| of the corners relative to o, and G = 1 + max|g_u| + max|g_v|, the computed Ê differs from E by at most
//! (in units of u·G·L·M)
//!
//! | source | error |
//! |---|---|
//! | the side c−b is rounded once (relative u) and goes into two products of 2LM each | 4 |
//! | c+b, with b = a + (b−a): a is off by 2uM (the high and the low part of the origin are subtracted), b−a by uL, the sums by uM and 2uM, so c+b by 8uM + 2uL ≤ 12uM; this is multiplied by L, twice | 24 |
//! | the cross product has two products and a difference (one rounding less if fused) | 8 |
//! | the dot product has three products and two sums of terms up to 4LM·\|g\| | 12 |
//! | g_u and g_v are rounded and multiplied by 4LM | 4 |
//!
//! The sum is 52. [`EDGE`] is 56, which leaves room for the terms in u², for the rounding of the corners to f64 in the definition
//! of a hit (2⁻⁵³M against L ≥ 4uM), and for the rounding of the bound itself. So for a triangle of known orientation, an
//! Ê < −B is a miss, and three Ê ≥ B are a hit. [`exact`](crate::trace::exact) decides everything in between.
//!
//! The orientation is the sign of T = a·N, N = (b−a) × (c−a), which is off by at most 54·u·L²·M: the components of N are off by
//! 8uL², times |a|₁ ≤ 3M: 24; a is off by 2uM, times |N|₁ ≤ 6L²: 12; the roundings of the dot product: 18. [`VOLUME`] is 64. Within
//! that bound both orientations are possible. The depth along w is z = T/(g·N). Its denominator is off by at most
//! 18·u·G·L² (N: 8, g: 2, the dot product: 8); [`SLOPE`] is 24. Where the denominator is at least four times its bound, z lies
//! between the quotients of the ends of the two intervals.
//!
//! # Origins that differ
//! For a ray whose line crosses w = 0 at s = (s_u, s_v, 0), E becomes −2 det(g, b−s, c−s) = E + 2m·(c−b) with m = g × s (the moment of
//! the line, as in Plücker coordinates), and T becomes T − s·N. Let S be the largest |s_u| or |s_v|. The components of m add up to at
//! most 2S·G, and each is off by at most 7u·S·G. Their products with c−b (off by uL) and the sums of these add 44 + 24 units of
//! u·G·L·S to the error of E, and the longer sum adds another 12 of u·G·L·M: with the 52 above at most 68 of u·G·L·(M + S).
//! [`EDGE_MULTI_ORIGIN`] is 72. The error of T − s·N grows by 32 units of u·L²·S and 6 of u·L²·M, for which [`VOLUME`] has room.
//! The side from which rays see a triangle is known only if |T| is larger than |s·N| as well.
//!
//! # Aims
//! A moment takes five products an edge in place of two, and most leaves are so small that none is needed. Let the middle of the leaf's
//! box be at the depth 1/k. There the ray is at P = s + g/k, which is seen from o along g′ = g + k·s. So the ray is tested as if it
//! came from o along g′, which is right in the middle of the box, and not far off elsewhere: the ray's own edge function is that of
//! g′ plus 2k·det(s, b−P, c−b). (Replace s by P in det(g, b−s, c−s), which moves b and c along the ray, and g by g′ − k·s.) Let the
//! corners be at most h before or behind the middle, let W be the box's sides, |e| ≤ min(W, L) those of c−b, and S_u and S_v the bounds
//! of |s|. A ray that meets the box is within B = W + S + |g|·h of every corner at the depth of the middle, along u and v. So the
//! determinant is at most S_u·(B_v·|e_w| + h·|e_v|) + S_v·(h·|e_u| + B_u·|e_w|). What lies flat along the rays has a small W in one
//! axis, so this is small where the edge functions are. Where it is not ([`AIMED`]), too many tests would be left to
//! [`exact`](crate::trace::exact), and moments are computed.
//!
//! The rounding of g′ (that of g, s, the product and the sum) is at most three times that of g, so the error of Ê becomes 60 units of
//! u·G′·L·M, with G′ = G + k·(S_u + S_v). [`EDGE_AIMED`] is 64.
//!
//! Every bound has the absolute term [`TINY`] besides. Where numbers overflow, the bounds become infinite and everything is
//! decided by [`exact`](crate::trace::exact): slowly, and right.
//!
//! # Depth
//! The best hit of a ray is kept as an interval of z that holds the true depth. A certain hit whose interval lies before it
//! replaces it, and one whose interval lies behind it is dropped. Where the intervals overlap, the f64 depths decide, and if
//! these are equal the ids do. A box or a triangle is skipped only if it begins behind the upper end of the interval.

use super::prepare::{BUNDLES, RayData, RayPacket};
use super::traverse::{Leaf, RelativeBox, larger};
use crate::trace::batch::{RaySet, chunk, chunk_mut};
use crate::trace::bvh::{LeafBlock, TriangleRef};
use crate::trace::exact::{Candidate, Corners};
use crate::trace::rounding::{TINY, U};
use crate::trace::simd::{F32x8, F32x16, Mask8, U32x8, Vec3x8};

/// The error of an edge function, in units of u·G·L·M.
pub(super) const EDGE: f32 = 56.0;
/// The error of an edge function where origins differ, in units of u·G·L·(M + S).
pub(super) const EDGE_MULTI_ORIGIN: f32 = 72.0;
/// The error of the edge function of g′, in units of u·G′·L·M.
pub(super) const EDGE_AIMED: f32 = 64.0;
/// Rays are aimed at the middle of a leaf if that changes edge functions by no more than this share of the area B_u·B_v that the leaf
/// takes up as seen from o: about one test in fifty is then left undecided by it, which costs less than moments do.
const AIMED: f32 = 1.0 / 1024.0;
/// The error of a triangle's volume T, in units of u·L²·M, or of u·L²·(M + S) where origins differ.
pub(super) const VOLUME: f32 = 64.0;
/// The error of the denominator of a depth, in units of u·G·L².
pub(super) const SLOPE: f32 = 24.0;

/// The effect of a leaf's tests, over all rays.
#[derive(Clone, Copy, Default)]
struct Outcome {
    /// A ray has a nearer hit than before.
    nearer: bool,
    /// A test is undecided.
    undecided: bool,
}

impl<const MULTI_ORIGIN: bool> RayPacket<'_, MULTI_ORIGIN> {
    /// Tests the triangles of a leaf against the rays of its bundles that its box lets through.
    #[inline(always)]
    pub(super) fn test_leaf<S: F32x8>(&mut self, leaf: &Leaf) {
        let Leaf { number: block_offset, bounds: ref b, bundles } = *leaf;
        let m = b.largest_coordinate();
        let middle = if MULTI_ORIGIN { Middle::of(self, b, m) } else { Middle::NONE };
        let count = self.gather_active::<S>(b, m, bundles);
        if count == 0 {
            return;
        }
        let block = LeafBlock::at(&self.bvh.blocks, block_offset);
        self.rays.active.stats.leaves += 1;
        self.rays.active.stats.tests += (count * block.triangles) as u64;
        let prepared = PreparedTriangles::<S, MULTI_ORIGIN>::new(self, &block, m, &middle);
        let mut outcome = Outcome::default();
        for first in (0..count).step_by(8) {
            self.rays_against_triangles::<S>(block_offset, &prepared, first, count, &mut outcome);
        }
        if outcome.nearer {
            self.scatter_back::<S>();
        }
        if outcome.undecided {
            self.decide_all(block_offset);
        }
        if outcome.nearer || outcome.undecided {
            for bundle in bits(bundles) {
                let bundle = bundle & (BUNDLES - 1);
                self.far[bundle] = self.farthest_of::<S>(bundle);
            }
            self.farthest = S::load(&self.far).reduce_max();
        }
    }

    /// The rays of the packet in the scene's space that may meet a leaf's box before their nearest hits.
    #[inline(always)]
    pub fn rays_in<S: F32x8>(&self, leaf: &Leaf) -> RaySet {
        let box_test = BoxTest::new(&leaf.bounds, leaf.bounds.largest_coordinate());
        let mut found = 0;
        for bundle in bits(leaf.bundles) {
            let bundle = bundle & (BUNDLES - 1);
            found |= RaySet::from(box_test.rays_in::<S>(self.rays, bundle)) << (16 * bundle);
        }
        found
    }

    /// Compresses the rays of `bundles` that may meet a box into [`ActiveRays`](super::prepare::ActiveRays), and returns their number.
    #[inline(always)]
    fn gather_active<S: F32x8>(&mut self, b: &RelativeBox, m: f32, bundles: u32) -> usize {
        let RayData { g, offset, z_low, z_high, active, .. } = &mut *self.rays;
        let box_test = BoxTest::new(b, m);
        let mut count = 0;
        active.bundle_count = 0;
        for bundle in bits(bundles) {
            let bundle = bundle & (BUNDLES - 1);
            let (gu, gv) =
                (S::F32x16::load(chunk(&g[0], 16 * bundle)), S::F32x16::load(chunk(&g[1], 16 * bundle)));
            let far = S::F32x16::load(chunk(z_high, 16 * bundle));
            let alive = box_test.rays_of::<S>(gu, gv, far);
            if alive == 0 {
                continue;
            }
            active.bundles[active.bundle_count & (BUNDLES - 1)] = (bundle as u8, alive as u16);
            active.bundle_count += 1;
            gu.compress_store(alive, chunk_mut(&mut active.g[0], count));
            gv.compress_store(alive, chunk_mut(&mut active.g[1], count));
            S::F32x16::load(chunk(z_low, 16 * bundle))
                .compress_store(alive, chunk_mut(&mut active.z_low, count));
            far.compress_store(alive, chunk_mut(&mut active.z_high, count));
            if MULTI_ORIGIN {
                for (from, to) in offset.iter().zip(&mut active.offset) {
                    S::F32x16::load(chunk(from, 16 * bundle)).compress_store(alive, chunk_mut(to, count));
                }
            }
            count += alive.count_ones() as usize;
        }
        count
    }

    /// Tests up to eight active rays, from number `first` on, against the triangles of a block, two rays and eight triangles at a
    /// time. Certain hits go to the bounds and triangles of the rays, other possible hits to `undecided`.
    #[inline(always)]
    fn rays_against_triangles<S: F32x8>(
        &mut self,
        block_offset: u32,
        p: &PreparedTriangles<S, MULTI_ORIGIN>,
        first: usize,
        count: usize,
        outcome: &mut Outcome,
    ) {
        let active = &mut self.rays.active;
        let (gu, gv) = (S::load(chunk(&active.g[0], first)), S::load(chunk(&active.g[1], first)));
        let [su, sv] = if MULTI_ORIGIN {
            [S::load(chunk(&active.offset[0], first)), S::load(chunk(&active.offset[1], first))]
        } else {
            [S::splat(0.0); 2]
        };
        let lines = p.lines([gu, gv], [su, sv]);
        let (inner, outer) = (S::F32x16::splat(p.edge_error), S::F32x16::splat(-p.edge_error));
        // The triangles that a ray may pass through, and those that it certainly passes through if their orientation is known.
        // Each ray has a byte, each triangle a bit.
        let (mut may, mut does, mut unsure) = (0_u64, 0_u64, 0_u64);
        for two in 0..4 {
            let [ea, eb, ec] = p.edges_of(&lines, 2 * two);
            let least = ea.min(eb).min(ec);
            may |= u64::from(least.ge(outer)) << (16 * two);
            does |= u64::from(least.ge(inner)) << (16 * two);
            if p.unoriented != 0 {
                unsure |= u64::from(inner.ge(ea.max(eb).max(ec))) << (16 * two);
            }
        }
        let present = u64::MAX >> (64 - 8 * (count - first).min(8));
        let of_each = 0x0101_0101_0101_0101 & present;
        unsure = (unsure | may) & (of_each * u64::from(p.unoriented));
        may &= of_each * u64::from(p.oriented);
        if may | unsure == 0 {
            S::U32x8::splat(0).store(chunk_mut(&mut active.undecided, first));
            return;
        }
        let mut best_low = S::load(chunk(&active.z_low, first));
        let mut best_high = S::load(chunk(&active.z_high, first));
        let mut triangles = S::U32x8::splat(0);
        let mut undecided = S::U32x8::from_bytes(unsure);
        let does = S::U32x8::from_bytes(does);
        let mut left = S::U32x8::from_bytes(may);
        let (near, least_slope) = (S::splat(self.near), S::splat(4.0 * p.slope_error));
        let mut any_nearer = 0;
        // In each round every ray takes its next triangle.
        while may != 0 {
            let after = left.and(left.add(S::U32x8::splat(u32::MAX)));
            let bit = left.xor(after);
            left = after;
            let lane = bit.bit_index();
            let normal = Vec3x8(p.normal.0.permute(lane), p.normal.1.permute(lane), p.normal.2.permute(lane));
            let slope = normal.dot_ray(gu, gv);
            let mut volume = p.volume.permute(lane);
            if MULTI_ORIGIN {
                volume = normal.less_offset(su, sv, volume);
            }
            let (z_low, z_high) = p.depths(slope, volume);
            let sure = does.test(bit).and(slope.ge(least_slope));
            // The interval of the depth lies strictly before that of the best hit, or strictly behind it.
            let nearer = sure.and(z_low.ge(near)).and(best_low.gt(z_high));
            let behind = sure.and(z_low.gt(best_high));
            best_low = S::select(nearer, z_low, best_low);
            best_high = S::select(nearer, z_high, best_high);
            let triangle = S::U32x8::splat(TriangleRef::new(block_offset, 0).0).add(lane);
            triangles = S::U32x8::bitcast_from(S::select(nearer, triangle.bitcast(), triangles.bitcast()));
            let rest = S::select(nearer.or(behind), S::splat(0.0), bit.bitcast());
            undecided = undecided.or(S::U32x8::bitcast_from(rest));
            any_nearer |= nearer.bits();
            may = u64::from(left.test(S::U32x8::splat(u32::MAX)).bits());
        }
        outcome.nearer |= any_nearer != 0;
        outcome.undecided |= undecided.test(S::U32x8::splat(u32::MAX)).bits() != 0;
        undecided.store(chunk_mut(&mut active.undecided, first));
        best_low.store(chunk_mut(&mut active.z_low, first));
        best_high.store(chunk_mut(&mut active.z_high, first));
        triangles.store(chunk_mut(&mut active.triangle, first));
    }

    /// Expands the certain hits of the active rays back into the packet's data.
    #[inline(always)]
    fn scatter_back<S: F32x8>(&mut self) {
        let RayData { z_low, z_high, triangle, active, .. } = &mut *self.rays;
        let (mut count, mut changed) = (0, 0);
        for &(bundle, alive) in &active.bundles[..active.bundle_count] {
            let bundle = usize::from(bundle) & (BUNDLES - 1);
            let alive = u32::from(alive);
            let old_high = S::F32x16::load(chunk(z_high, 16 * bundle));
            let high = old_high.expand_load(alive, chunk(&active.z_high, count));
            high.store(chunk_mut(z_high, 16 * bundle));
            let low =
                S::F32x16::load(chunk(z_low, 16 * bundle)).expand_load(alive, chunk(&active.z_low, count));
            low.store(chunk_mut(z_low, 16 * bundle));
            // A new hit lies strictly before the old one.
            let nearer = alive & !high.ge(old_high);
            let old = S::F32x16::load_u32(chunk(triangle, 16 * bundle));
            let new = old.expand_load_u32(alive, chunk(&active.triangle, count));
            S::F32x16::select(nearer, new, old).store_u32(chunk_mut(triangle, 16 * bundle));
            changed |= RaySet::from(nearer) << (16 * bundle);
            count += alive.count_ones() as usize;
        }
        self.replaced(changed);
    }

    /// Decides the undecided tests of the active rays against the triangles of a block.
    #[cold]
    #[inline(never)]
    fn decide_all(&mut self, block_offset: u32) {
        let mut k = 0;
        for index in 0..self.rays.active.bundle_count {
            let (bundle, alive) = self.rays.active.bundles[index];
            for lane in bits(u32::from(alive)) {
                for triangle in bits(self.rays.active.undecided[k]) {
                    self.decide(16 * usize::from(bundle) + lane, block_offset, triangle);
                }
                k += 1;
            }
        }
    }

    /// Notes that these rays have a new best hit in this mesh, whose f64 depth is not worked out yet.
    #[inline(always)]
    fn replaced(&mut self, rays: RaySet) {
        self.hit |= rays;
        self.here |= rays;
        self.known &= !rays;
    }

    /// Decides in f64 and, where that does not suffice, exactly whether a triangle is a ray's new nearest hit.
    fn decide(&mut self, ray: usize, block_offset: u32, lane: usize) {
        let block = LeafBlock::at(&self.bvh.blocks, block_offset);
        let direction = self.directions[ray];
        let corners = Corners::from_positions(block.positions(lane), self.origin(ray));
        if !corners.passes_counted(direction, &mut self.rays.active.stats) {
            return;
        }
        let t = corners.depth(direction);
        if !(self.t_min..=self.t_max).contains(&t) {
            return;
        }
        let found = Candidate { t, placement: self.placement, triangle: block.id(lane) };
        if self.hit >> ray & 1 != 0 {
            let best = TriangleRef(self.rays.triangle[ray]);
            let is_here = self.here >> ray & 1 != 0;
            let known = Candidate {
                t: self.depth_of_best(ray),
                placement: if is_here { self.placement } else { self.rays.foreign[ray] },
                triangle: if is_here {
                    LeafBlock::at(&self.bvh.blocks, best.block_offset()).id(best.lane())
                } else {
                    0
                },
            };
            if !found.beats(&known) {
                return;
            }
        }
        (self.rays.z_low[ray], self.rays.z_high[ray]) = self.along(ray, t);
        self.rays.triangle[ray] = TriangleRef::new(block_offset, lane).0;
        self.replaced(1 << ray);
        self.rays.t[ray] = t;
        self.known |= 1 << ray;
    }

    /// The f64 depth of a ray's best hit, which is worked out at most once.
    pub(super) fn depth_of_best(&mut self, ray: usize) -> f64 {
        if self.known >> ray & 1 == 0 {
            let triangle = TriangleRef(self.rays.triangle[ray]);
            self.rays.t[ray] = match &self.elsewhere {
                Some(elsewhere) if self.here >> ray & 1 == 0 => {
                    elsewhere.depth(ray, self.rays.foreign[ray], triangle)
                }
                _ => {
                    let block = LeafBlock::at(&self.bvh.blocks, triangle.block_offset());
                    let corners = Corners::from_positions(block.positions(triangle.lane()), self.origin(ray));
                    corners.depth(self.directions[ray])
                }
            };
            self.known |= 1 << ray;
        }
        self.rays.t[ray]
    }
}

/// The test of a box against the rays of a packet.
struct BoxTest {
    begin: f32,
    end: f32,
    /// The negated lower sides and the upper sides along u and v.
    low: [f32; 2],
    high: [f32; 2],
}

impl BoxTest {
    /// The test of a box whose largest |coordinate| is `m`.
    #[inline(always)]
    fn new(b: &RelativeBox, m: f32) -> Self {
        // Rounding g and the product g·w costs u of |g|·w ≤ 8M each, 16uM in all, of which this is twice.
        let margin = 32.0 * U * m;
        Self {
            begin: larger(-b.w[0], 0.0),
            end: b.w[1],
            low: [-(b.u[0] + margin), -(b.v[0] + margin)],
            high: [b.u[1] + margin, b.v[1] + margin],
        }
    }

    /// The rays of a bundle that may meet the box before their nearest hits, one bit each.
    #[inline(always)]
    fn rays_in<S: F32x8>(&self, rays: &RayData, bundle: usize) -> u32 {
        let [gu, gv] = &rays.g;
        let (gu, gv) = (S::F32x16::load(chunk(gu, 16 * bundle)), S::F32x16::load(chunk(gv, 16 * bundle)));
        self.rays_of::<S>(gu, gv, S::F32x16::load(chunk(&rays.z_high, 16 * bundle)))
    }

    /// The rays that may meet the box, one bit each, given g and the depths of their nearest hits.
    #[inline(always)]
    fn rays_of<S: F32x8>(&self, gu: S::F32x16, gv: S::F32x16, far: S::F32x16) -> u32 {
        let (near, end) = (S::F32x16::splat(self.begin), S::F32x16::splat(self.end));
        let (u, v) = ([gu.mul(near), gu.mul(end)], [gv.mul(near), gv.mul(end)]);
        S::F32x16::splat(self.high[0]).ge(u[0].min(u[1]))
            & u[0].max(u[1]).ge(S::F32x16::splat(self.low[0]))
            & S::F32x16::splat(self.high[1]).ge(v[0].min(v[1]))
            & v[0].max(v[1]).ge(S::F32x16::splat(self.low[1]))
            & far.ge(near)
    }
}

/// The middle of a leaf's box, where rays from different origins are aimed at.
pub(super) struct Middle {
    /// k, the inverse of its depth along w.
    pub per_depth: f32,
    /// 2k·S_u and 2k·S_v.
    offset: [f32; 2],
    /// The sides W of the box, and the bounds B_u and B_v of b−P.
    sides: [f32; 3],
    bounds: [f32; 2],
    /// The bound h.
    half: f32,
}

impl Middle {
    /// For rays that share their origin.
    const NONE: Self =
        Self { per_depth: 0.0, offset: [0.0; 2], sides: [0.0; 3], bounds: [0.0; 2], half: 0.0 };

    /// The middle of a box whose largest |coordinate| is `m`. All bounds have `m`·2⁻¹⁸ of room for their own roundings, and for those of
    /// the box's test.
    #[inline(always)]
    pub fn of<const MULTI_ORIGIN: bool>(packet: &RayPacket<MULTI_ORIGIN>, b: &RelativeBox, m: f32) -> Self {
        let room = 64.0 * U * m;
        let [su, sv] = packet.offset;
        // A box that reaches back to o has no direction, and k must not overflow.
        let least = (m + larger(su, sv)) * (1.0 / 1024.0);
        let depth = larger(0.5 * (larger(-b.w[0], 0.0) + b.w[1]), least);
        let half = larger(b.w[1] - depth, depth + b.w[0]) + room + 8.0 * U * depth;
        let per_depth = 1.0 / depth;
        let sides = [b.u, b.v, b.w].map(|[lower, upper]| lower + upper + room);
        let bound = |k: usize| sides[k] + packet.offset[k] + packet.steep[k] * half + room;
        Self {
            per_depth,
            offset: [2.0 * per_depth * su, 2.0 * per_depth * sv],
            sides,
            bounds: [bound(0), bound(1)],
            half,
        }
    }

    /// The area B_u·B_v.
    #[inline(always)]
    fn area(&self) -> f32 {
        self.bounds[0] * self.bounds[1]
    }

    /// The bound of 2k·|det(s, b−P, c−b)| for sides c−b no longer than `side` along any axis.
    #[inline(always)]
    pub fn edge_error(&self, side: f32) -> f32 {
        let [eu, ev, ew] = self.sides.map(|most| if side < most { side } else { most });
        let ([bu, bv], h) = (self.bounds, self.half);
        let error = self.offset[0] * (bv * ew + h * ev) + self.offset[1] * (h * eu + bu * ew);
        error * (1.0 + 32.0 * U)
    }
}

/// Eight rays as edge functions take them: g, or g′ where they are aimed, and 2·m for the moment m, where that is needed.
pub(super) struct Lines<S> {
    g: [S; 2],
    moment: Vec3x8<S>,
}

/// The triangles of a block, prepared for the packet's origin. They are oriented such that a ray that passes through a triangle
/// has positive edge functions and a positive denominator.
pub(super) struct PreparedTriangles<S: F32x8, const MULTI_ORIGIN: bool> {
    /// The vectors (c−b) × (c+b) of the edges opposite a, b and c, for two rays: an edge function is g·edge.
    edges: [[S::F32x16; 3]; 3],
    /// The vectors of the edges themselves, oriented as `edges` are, for moments.
    sides: [[S::F32x16; 3]; 3],
    /// k, if rays from different origins are aimed at the middle of the leaf.
    pub aimed: Option<f32>,
    pub normal: Vec3x8<S>,
    /// |T|.
    pub volume: S,
    /// The triangles whose orientation is known, one bit each.
    pub oriented: u32,
    /// The triangles whose orientation is not known, one bit each.
    unoriented: u32,
    pub edge_error: f32,
    pub volume_error: f32,
    pub slope_error: f32,
}

impl<S: F32x8, const MULTI_ORIGIN: bool> PreparedTriangles<S, MULTI_ORIGIN> {
    /// Prepares the triangles of a block whose largest |coordinate| relative to o is `m`, and whose box has this middle.
    #[inline(always)]
    pub fn new(packet: &RayPacket<MULTI_ORIGIN>, block: &LeafBlock, m: f32, middle: &Middle) -> Self {
        let turn = S::splat(if packet.reversed { -0.0 } else { 0.0 });
        let corners = block.corner_vertices::<S>();
        let [u, v, w] = packet.axes;
        let (u, v, w) = (block.coordinates::<S>(u), block.coordinates::<S>(v), block.coordinates::<S>(w));
        let (u, v, w) =
            (S::lookup(u.0, u.1, corners), S::lookup(v.0, v.1, corners), S::lookup(w.0, w.1, corners));
        let a = Vec3x8(u[0], v[0], w[0].xor(turn));
        let b = Vec3x8(u[1], v[1], w[1].xor(turn));
        let c = Vec3x8(u[2], v[2], w[2].xor(turn));
        let (ab, ac, bc) = (b.sub(a), c.sub(a), c.sub(b));
        let a = a.sub(Vec3x8::splat(packet.high)).sub(Vec3x8::splat(packet.low));
        let (b, c) = (a.add(ab), a.add(ac));
        let normal = ab.cross(ac);
        let volume = a.0.mul_add(normal.0, a.1.mul_add(normal.1, a.2.mul(normal.2)));

        let side = block.extent() * (1.0 + 4.0 * U) + 4.0 * U * m;
        let [su, sv] = packet.offset;
        let (mut edge_error, mut aimed) = (EDGE * U * packet.reach * side * m + TINY, None);
        if MULTI_ORIGIN {
            let off = middle.edge_error(side);
            if off <= AIMED * middle.area() {
                let reach = packet.reach + middle.per_depth * (su + sv);
                edge_error = EDGE_AIMED * U * reach * side * m + off + TINY;
                aimed = Some(middle.per_depth);
            } else {
                edge_error = EDGE_MULTI_ORIGIN * U * packet.reach * side * (m + larger(su, sv)) + TINY;
            }
        }
        let volume_error = VOLUME * U * side * side * (m + larger(su, sv)) + TINY;
        let slope_error = SLOPE * U * packet.reach * side * side + TINY;

        // (c−b) × (c+b) is −2 b × c, so for a triangle with T < 0 the edge functions are positive inside.
        let against = volume.sign_bits().neg();
        let edges = [
            bc.cross(b.add(c)).flip_signs(against).in_both_halves(),
            ac.cross(c.add(a)).flip_signs(volume.sign_bits()).in_both_halves(),
            ab.cross(a.add(b)).flip_signs(against).in_both_halves(),
        ];
        let sides = if MULTI_ORIGIN && aimed.is_none() {
            [
                bc.flip_signs(against).in_both_halves(),
                ac.flip_signs(volume.sign_bits()).in_both_halves(),
                ab.flip_signs(against).in_both_halves(),
            ]
        } else {
            [[S::F32x16::splat(0.0); 3]; 3]
        };
        let size = volume.abs();
        // |s·N|. The factor covers the rounding of N and of this sum.
        let shift = if MULTI_ORIGIN {
            let (u, v) = (S::splat(su * (1.0 + 32.0 * U)), S::splat(sv * (1.0 + 32.0 * U)));
            normal.0.abs().mul_add(u, normal.1.abs().mul(v))
        } else {
            S::splat(0.0)
        };
        let least_volume = shift.add(S::splat(volume_error));
        let triangles = (1_u32 << block.triangles) - 1;
        let unoriented = least_volume.ge(size).bits() & triangles;
        // A NaN, from overflow, compares as neither.
        let known = size.ge(least_volume).bits() & triangles & !unoriented;
        Self {
            edges,
            sides,
            aimed,
            normal: normal.flip_signs(volume.sign_bits()),
            volume: size,
            oriented: known,
            unoriented: triangles & !known,
            edge_error,
            volume_error,
            slope_error,
        }
    }

    /// What the edge functions take of eight rays, which are given by g and s.
    #[inline(always)]
    pub fn lines(&self, g: [S; 2], [su, sv]: [S; 2]) -> Lines<S> {
        let none = Vec3x8::splat([0.0; 3]);
        if !MULTI_ORIGIN {
            return Lines { g, moment: none };
        }
        let [gu, gv] = g;
        if let Some(per_depth) = self.aimed {
            let per_depth = S::splat(per_depth);
            return Lines { g: [su.mul_add(per_depth, gu), sv.mul_add(per_depth, gv)], moment: none };
        }
        let (u, v) = (sv.add(sv).neg(), su.add(su));
        Lines { g, moment: Vec3x8(u, v, gu.add(gu).mul_sub(sv, gv.mul(v))) }
    }

    /// The edge functions of all triangles for two of these rays, `first` and `first` + 1.
    #[inline(always)]
    pub fn edges_of(&self, lines: &Lines<S>, first: usize) -> [S::F32x16; 3] {
        let [a, b, c] = self.edges;
        let gu = S::F32x16::broadcast_two(lines.g[0], first);
        let gv = S::F32x16::broadcast_two(lines.g[1], first);
        let edges = [dot_ray(a, gu, gv), dot_ray(b, gu, gv), dot_ray(c, gu, gv)];
        if !MULTI_ORIGIN || self.aimed.is_some() {
            return edges;
        }
        let m = [
            S::F32x16::broadcast_two(lines.moment.0, first),
            S::F32x16::broadcast_two(lines.moment.1, first),
            S::F32x16::broadcast_two(lines.moment.2, first),
        ];
        let [a, b, c] = self.sides;
        [dot_onto(a, m, edges[0]), dot_onto(b, m, edges[1]), dot_onto(c, m, edges[2])]
    }

    /// Bounds of z = T/D for a denominator D of at least four times its error δ, with one division: for x = δ/D ≤ ¼,
    /// 1/(D + δ) ≥ (1 − x)/D and 1/(D − δ) ≤ (1 + 4x/3)/D. The roundings here add up to less than 8u, for which 16u are given.
    #[inline(always)]
    pub fn depths(&self, slope: S, volume: S) -> (S, S) {
        let per_slope = S::splat(1.0 - 16.0 * U).div(slope);
        let x = per_slope.mul(S::splat(self.slope_error));
        let error = S::splat(self.volume_error);
        let low = volume.sub(error).mul(per_slope);
        let high = volume.add(error).mul(per_slope);
        (low.mul_add(x.neg(), low), high.mul_add(x.mul(S::splat(1.334)), high).mul(S::splat(1.0 + 34.0 * U)))
    }
}

/// The dot product edge · (gu, gv, 1).
#[inline(always)]
fn dot_ray<P: F32x16>([u, v, w]: [P; 3], gu: P, gv: P) -> P {
    gu.mul_add(u, gv.mul_add(v, w))
}

/// The sum moment · side + term.
#[inline(always)]
fn dot_onto<P: F32x16>([u, v, w]: [P; 3], [mu, mv, mw]: [P; 3], term: P) -> P {
    mu.mul_add(u, mv.mul_add(v, mw.mul_add(w, term)))
}

/// The indices of the bits that are set, the lowest first.
#[inline(always)]
fn bits(mut set: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (set != 0).then_some(set.trailing_zeros() as usize);
        set &= set.wrapping_sub(1);
        bit
    })
}
