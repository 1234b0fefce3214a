//! Triangles against a packet's rays: decisions in f32 where they are sure, in f64 and exactly where they are not.
//!
//! # The decision in f32
//! For a triangle's corners a, b, c relative to o (rounded), the edge function of the edge b–c is
//! E = g·((c−b) × (c+b)) = −2 det(g, b, c): Segura and Feito's signed volumes, in the form that is precomputed for a common
//! origin, one dot product an edge and ray. A ray passes when the three have one sign. With u = 2⁻²⁴, L the triangle's
//! largest box side (plus 4uM, for what rounding the corners moves), M the largest |coordinate| of its corners relative to o
//! and G = 1 + max|g_u| + max|g_v|, Ê differs from E by at most (in units of u·G·L·M)
//!
//! | from | error |
//! |---|---|
//! | the side c−b, rounded once (relative u), in two products of 2LM each | 4 |
//! | c+b, with b = a + (b−a): a is off by 2uM (two subtractions, of the origin's high and low part), b−a by uL, the sums by uM and 2uM, so c+b by 8uM + 2uL ≤ 12uM; times L, twice | 24 |
//! | the cross product: two products and a difference (one rounding less when fused) | 8 |
//! | the dot product: three products and two sums of terms up to 4LM·|g| | 12 |
//! | rounding g_u and g_v, times 4LM | 4 |
//!
//! 52 in all; [`EDGE`] is 56, which leaves room for the terms in u², for the corners' own rounding to f64 in the definition
//! (2⁻⁵³M against L ≥ 4uM) and for the rounding of the bound itself. So Ê < −B (with the triangle's orientation known) is a
//! miss, all Ê ≥ B a hit, and what lies between is decided by [`exact`].
//!
//! The orientation is that of T = a·N, N = (b−a) × (c−a): off by at most 54·u·L²·M (N's components by 8uL², times |a|₁ ≤ 3M:
//! 24; a by 2uM times |N|₁ ≤ 6L²: 12; the dot product's roundings: 18); [`VOLUME`] is 64. Within that both orientations are
//! possible. Depth along w is z = T/(g·N), whose denominator is off by at most 18·u·G·L² (N: 8, g: 2, the dot product: 8);
//! [`SLOPE`] is 24. Where the denominator is at least four times its bound, z lies between the quotients of the ends.
//!
//! # Origins that differ
//! For a ray whose line crosses w = 0 at s, E becomes −2 det(g, b−s, c−s) = E + 2m·(c−b) with m = g × s (the line's moment,
//! as in Plücker's coordinates), and T becomes T − s·N. With S the largest |s_u|, |s_v|, |m| has components up to 2S·G in sum,
//! each off by at most 7u·S·G; the products with c−b (off by uL) and their sums add, to the error of E, 44 + 24 units of
//! u·G·L·S, and the longer sum another 12 of u·G·L·M: with the 52 above at most 68 of u·G·L·(M + S); [`EDGE_MULTI_ORIGIN`] is 72. The error
//! of T − s·N grows by 32 units of u·L²·S and 6 of u·L²·M, which [`VOLUME`] has room for; a triangle's side is known only if |T|
//! is larger than |s·N| as well.
//!
//! Everything has an absolute term of 10⁻³⁶ besides, for what underflows. Where numbers overflow, bounds become infinite and
//! everything is decided by `exact`: slow, and right.
//!
//! # Depth
//! The best hit of a ray is kept as an interval of z that holds the true one. A sure hit whose interval lies before it
//! replaces it, one behind is dropped, and where intervals overlap the f64 depths (and, if these are equal, the ids) decide.
//! A box or triangle is passed over only if it begins behind the upper end.

use super::traverse::{Leaf, RelativeBox};
use super::{BUNDLES, PACKET_RAYS, RayPacket, Set, TINY, U, at, at_mut, bits};
use crate::trace::bvh::{LeafBlock, TriangleRef};
use crate::trace::exact::{Candidate, Corners};
use crate::trace::simd::{F32x8, F32x16, Mask8, U32x8, Vec3x8};
use crate::trace::stats::TraversalStats;

/// Error of an edge function in units of u·G·L·M.
const EDGE: f32 = 56.0;
/// The same where origins differ, in units of u·G·L·(M + S).
const EDGE_MULTI_ORIGIN: f32 = 72.0;
/// Error of a triangle's volume T in units of u·L²·M, or u·L²·(M + S).
const VOLUME: f32 = 64.0;
/// Error of the denominator of a depth in units of u·G·L².
const SLOPE: f32 = 24.0;

/// The rays that a block's box lets through, side by side.
#[repr(align(64))]
pub(super) struct ActiveRays {
    /// g_u and g_v.
    g: [[f32; CAPACITY]; 2],
    /// As [`PerRay`](super::PerRay) has it, if origins differ.
    moment: [[f32; CAPACITY]; 3],
    /// Bounds of the nearest hits' depths.
    z_low: [f32; CAPACITY],
    z_high: [f32; CAPACITY],
    /// The slots of what is nearer than what was known.
    slot: [u32; CAPACITY],
    /// Which triangles of the block are undecided, a bit each.
    undecided: [u32; CAPACITY],
    /// The bundles that they are of, and which of each they are, a bit each.
    bundles: [(u8, u16); BUNDLES],
    bundle_count: usize,
    pub stats: TraversalStats,
}

/// Rays are written sixteen at a time, of which any number may count.
const CAPACITY: usize = PACKET_RAYS + 16;

impl Default for ActiveRays {
    fn default() -> Self {
        let none = [0.0; CAPACITY];
        Self {
            g: [none; 2],
            moment: [none; 3],
            z_low: none,
            z_high: none,
            slot: [0; CAPACITY],
            undecided: [0; CAPACITY],
            bundles: [(0, 0); BUNDLES],
            bundle_count: 0,
            stats: TraversalStats::default(),
        }
    }
}

/// What became of rays at a leaf.
#[derive(Clone, Copy, Default)]
struct Outcome {
    /// Something is nearer than what was known.
    nearer: bool,
    /// Something is undecided.
    undecided: bool,
}

impl<const MULTI_ORIGIN: bool> RayPacket<'_, MULTI_ORIGIN> {
    /// Tests the triangles of a block against the rays of its bundles that its box lets through.
    #[inline(always)]
    pub(super) fn test_leaf<S: F32x8>(&mut self, leaf: &Leaf) {
        let Leaf { number: block_offset, bounds: ref b, bundles } = *leaf;
        // M: the box is padded, so no corner is farther out.
        let side = |side: [f32; 2]| larger(side[0].abs(), side[1].abs());
        let m = larger(larger(side(b.u), side(b.v)), side(b.w));
        let count = self.gather_active::<S>(b, m, bundles);
        if count == 0 {
            return;
        }
        let block = LeafBlock::at(&self.bvh.blocks, block_offset);
        self.rays.active.stats.leaves += 1;
        self.rays.active.stats.tests += (count * block.triangles) as u64;
        let prepared = Prepared::<S, MULTI_ORIGIN>::new(self, &block, m);
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

    /// Sets the rays of `bundles` that may meet a box side by side; how many they are.
    #[inline(always)]
    fn gather_active<S: F32x8>(&mut self, b: &RelativeBox, m: f32, bundles: u32) -> usize {
        let super::PerRay { g, moment, z_low, z_high, active, .. } = &mut *self.rays;
        // 2⁻²⁴ of |g|·w ≤ 8M is lost twice, in g and in the product.
        let room = 32.0 * U * m;
        let begin = larger(-b.w[0], 0.0);
        let (near, end) = (S::F32x16::splat(begin), S::F32x16::splat(b.w[1]));
        let low = [S::F32x16::splat(-(b.u[0] + room)), S::F32x16::splat(-(b.v[0] + room))];
        let high = [S::F32x16::splat(b.u[1] + room), S::F32x16::splat(b.v[1] + room)];
        let mut count = 0;
        active.bundle_count = 0;
        for bundle in bits(bundles) {
            let bundle = bundle & (BUNDLES - 1);
            let (gu, gv) = (S::F32x16::load(at(&g[0], 16 * bundle)), S::F32x16::load(at(&g[1], 16 * bundle)));
            let far = S::F32x16::load(at(z_high, 16 * bundle));
            let (u, v) = ([gu.mul(near), gu.mul(end)], [gv.mul(near), gv.mul(end)]);
            let alive = high[0].ge(u[0].min(u[1]))
                & u[0].max(u[1]).ge(low[0])
                & high[1].ge(v[0].min(v[1]))
                & v[0].max(v[1]).ge(low[1])
                & far.ge(near);
            if alive == 0 {
                continue;
            }
            active.bundles[active.bundle_count & (BUNDLES - 1)] = (bundle as u8, alive as u16);
            active.bundle_count += 1;
            gu.compress_store(alive, at_mut(&mut active.g[0], count));
            gv.compress_store(alive, at_mut(&mut active.g[1], count));
            S::F32x16::load(at(z_low, 16 * bundle)).compress_store(alive, at_mut(&mut active.z_low, count));
            far.compress_store(alive, at_mut(&mut active.z_high, count));
            if MULTI_ORIGIN {
                for (from, to) in moment.iter().zip(&mut active.moment) {
                    S::F32x16::load(at(from, 16 * bundle)).compress_store(alive, at_mut(to, count));
                }
            }
            count += alive.count_ones() as usize;
        }
        count
    }

    /// Tests the active rays from number `first` on, at most eight, against a block's triangles: two rays and eight triangles
    /// at a time. What is sure goes to the rays' bounds and slots, what is not to `undecided`.
    #[inline(always)]
    fn rays_against_triangles<S: F32x8>(
        &mut self,
        block_offset: u32,
        p: &Prepared<S, MULTI_ORIGIN>,
        first: usize,
        count: usize,
        outcome: &mut Outcome,
    ) {
        let active = &mut self.rays.active;
        let (gu, gv) = (S::load(at(&active.g[0], first)), S::load(at(&active.g[1], first)));
        let m = if MULTI_ORIGIN {
            let [u, v, w] = &active.moment;
            Vec3x8(S::load(at(u, first)), S::load(at(v, first)), S::load(at(w, first)))
        } else {
            Vec3x8::splat([0.0; 3])
        };
        let (inner, outer) = (S::F32x16::splat(p.edge_error), S::F32x16::splat(-p.edge_error));
        // Which triangles a ray may pass, and passes for sure if they are oriented: a byte a ray, a bit a triangle.
        let (mut may, mut does, mut unsure) = (0_u64, 0_u64, 0_u64);
        for two in 0..4 {
            let (gu, gv) = (S::F32x16::broadcast_two(gu, 2 * two), S::F32x16::broadcast_two(gv, 2 * two));
            let [ea, eb, ec] = p.edges_of(gu, gv, m, 2 * two);
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
            S::U32x8::splat(0).store(at_mut(&mut active.undecided, first));
            return;
        }
        let mut best_low = S::load(at(&active.z_low, first));
        let mut best_high = S::load(at(&active.z_high, first));
        let mut slots = S::U32x8::splat(0);
        let mut undecided = S::U32x8::from_bytes(unsure);
        let does = S::U32x8::from_bytes(does);
        let mut left = S::U32x8::from_bytes(may);
        let (near, least_slope) = (S::splat(self.near), S::splat(4.0 * p.slope_error));
        let mut any_nearer = 0;
        // Each ray's next triangle.
        while may != 0 {
            let after = left.and(left.add(S::U32x8::splat(u32::MAX)));
            let bit = left.xor(after);
            left = after;
            let lane = bit.bit_index();
            let normal = Vec3x8(p.normal.0.permute(lane), p.normal.1.permute(lane), p.normal.2.permute(lane));
            let slope = normal.dot_ray(gu, gv);
            let mut volume = p.volume.permute(lane);
            if MULTI_ORIGIN {
                volume = normal.less_offset(m, volume);
            }
            let (z_low, z_high) = p.depths(slope, volume);
            let sure = does.test(bit).and(slope.ge(least_slope));
            // Strictly before, and strictly behind.
            let nearer = sure.and(z_low.ge(near)).and(best_low.gt(z_high));
            let behind = sure.and(z_low.gt(best_high));
            best_low = S::select(nearer, z_low, best_low);
            best_high = S::select(nearer, z_high, best_high);
            let slot = S::U32x8::splat(TriangleRef::new(block_offset, 0).0).add(lane);
            slots = S::U32x8::bitcast_from(S::select(nearer, slot.bitcast(), slots.bitcast()));
            let rest = S::select(nearer.or(behind), S::splat(0.0), bit.bitcast());
            undecided = undecided.or(S::U32x8::bitcast_from(rest));
            any_nearer |= nearer.bits();
            may = u64::from(left.test(S::U32x8::splat(u32::MAX)).bits());
        }
        outcome.nearer |= any_nearer != 0;
        outcome.undecided |= undecided.test(S::U32x8::splat(u32::MAX)).bits() != 0;
        undecided.store(at_mut(&mut active.undecided, first));
        best_low.store(at_mut(&mut active.z_low, first));
        best_high.store(at_mut(&mut active.z_high, first));
        slots.store(at_mut(&mut active.slot, first));
    }

    /// Takes back what the active rays have hit for sure.
    #[inline(always)]
    fn scatter_back<S: F32x8>(&mut self) {
        let super::PerRay { z_low, z_high, slot, active, .. } = &mut *self.rays;
        let (mut count, mut changed) = (0, 0);
        for &(bundle, alive) in &active.bundles[..active.bundle_count] {
            let bundle = usize::from(bundle) & (BUNDLES - 1);
            let alive = u32::from(alive);
            let old_high = S::F32x16::load(at(z_high, 16 * bundle));
            let high = old_high.expand_load(alive, at(&active.z_high, count));
            high.store(at_mut(z_high, 16 * bundle));
            let low = S::F32x16::load(at(z_low, 16 * bundle)).expand_load(alive, at(&active.z_low, count));
            low.store(at_mut(z_low, 16 * bundle));
            // Whoever has something new has it strictly before what it had.
            let nearer = alive & !high.ge(old_high);
            let old = S::F32x16::load_u32(at(slot, 16 * bundle));
            let new = old.expand_load_u32(alive, at(&active.slot, count));
            S::F32x16::select(nearer, new, old).store_u32(at_mut(slot, 16 * bundle));
            changed |= Set::from(nearer) << (16 * bundle);
            count += alive.count_ones() as usize;
        }
        self.replaced(changed);
    }

    /// Decides which triangles of a block the active rays hit, where that is undecided.
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

    /// Notes that these rays have a new best hit, here, whose f64 depth is not worked out.
    #[inline(always)]
    fn replaced(&mut self, rays: Set) {
        self.hit |= rays;
        self.here |= rays;
        self.known &= !rays;
    }

    /// Decides in f64 and, where that is not enough, exactly whether a triangle is a ray's new nearest hit.
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
            let best = TriangleRef(self.rays.slot[ray]);
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
        self.rays.slot[ray] = TriangleRef::new(block_offset, lane).0;
        self.replaced(1 << ray);
        self.rays.t[ray] = t;
        self.known |= 1 << ray;
    }

    /// The f64 depth of a ray's best hit, worked out once.
    pub(super) fn depth_of_best(&mut self, ray: usize) -> f64 {
        if self.known >> ray & 1 == 0 {
            let slot = TriangleRef(self.rays.slot[ray]);
            let positions = LeafBlock::at(&self.bvh.blocks, slot.block_offset()).positions(slot.lane());
            self.rays.t[ray] =
                Corners::from_positions(positions, self.origin(ray)).depth(self.directions[ray]);
            self.known |= 1 << ray;
        }
        self.rays.t[ray]
    }
}

/// A block's triangles, prepared for the packet's origin: turned so that rays that pass from the front of the pyramid have
/// positive edge functions and a positive denominator.
struct Prepared<S: F32x8, const MULTI_ORIGIN: bool> {
    /// E = g·edge of the three edges, those opposite a, b and c; for two rays.
    edges: [[S::F32x16; 3]; 3],
    /// Their vectors, turned as `edges` are; only if origins differ.
    sides: [[S::F32x16; 3]; 3],
    normal: Vec3x8<S>,
    /// |T|.
    volume: S,
    /// Triangles whose orientation is known, and those whose is not, a bit each.
    oriented: u32,
    unoriented: u32,
    edge_error: f32,
    volume_error: f32,
    slope_error: f32,
}

impl<S: F32x8, const MULTI_ORIGIN: bool> Prepared<S, MULTI_ORIGIN> {
    #[inline(always)]
    fn new(packet: &RayPacket<MULTI_ORIGIN>, block: &LeafBlock, m: f32) -> Self {
        let turn = S::splat(if packet.turned { -0.0 } else { 0.0 });
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
        let (edge, m) = if MULTI_ORIGIN { (EDGE_MULTI_ORIGIN, m + packet.offset) } else { (EDGE, m) };
        let edge_error = edge * U * packet.reach * side * m + TINY;
        let volume_error = VOLUME * U * side * side * m + TINY;
        let slope_error = SLOPE * U * packet.reach * side * side + TINY;

        // (c−b) × (c+b) is −2 b × c: positive inside for a triangle with T < 0.
        let against = volume.sign_bits().neg();
        let edges = [
            bc.cross(b.add(c)).flip_signs(against).in_both_halves(),
            ac.cross(c.add(a)).flip_signs(volume.sign_bits()).in_both_halves(),
            ab.cross(a.add(b)).flip_signs(against).in_both_halves(),
        ];
        let sides = if MULTI_ORIGIN {
            [
                bc.flip_signs(against).in_both_halves(),
                ac.flip_signs(volume.sign_bits()).in_both_halves(),
                ab.flip_signs(against).in_both_halves(),
            ]
        } else {
            [[S::F32x16::splat(0.0); 3]; 3]
        };
        let size = volume.abs();
        // |s·N|, with room for the rounding of N and of this.
        let shift = if MULTI_ORIGIN {
            normal.0.abs().add(normal.1.abs()).mul(S::splat(packet.offset * (1.0 + 32.0 * U)))
        } else {
            S::splat(0.0)
        };
        let least_volume = shift.add(S::splat(volume_error));
        let triangles = (1_u32 << block.triangles) - 1;
        let unoriented = least_volume.ge(size).bits() & triangles;
        // NaN, from overflow, is on neither side of anything.
        let known = size.ge(least_volume).bits() & triangles & !unoriented;
        Self {
            edges,
            sides,
            normal: normal.flip_signs(volume.sign_bits()),
            volume: size,
            oriented: known,
            unoriented: triangles & !known,
            edge_error,
            volume_error,
            slope_error,
        }
    }

    /// The edge functions of all triangles for two rays of these g, whose moments are those from number `first` on.
    #[inline(always)]
    fn edges_of(&self, gu: S::F32x16, gv: S::F32x16, m: Vec3x8<S>, first: usize) -> [S::F32x16; 3] {
        let [a, b, c] = self.edges;
        let mut edges = [dot_ray(a, gu, gv), dot_ray(b, gu, gv), dot_ray(c, gu, gv)];
        if MULTI_ORIGIN {
            let m = [
                S::F32x16::broadcast_two(m.0, first),
                S::F32x16::broadcast_two(m.1, first),
                S::F32x16::broadcast_two(m.2, first),
            ];
            let [a, b, c] = self.sides;
            edges = [dot_onto(a, m, edges[0]), dot_onto(b, m, edges[1]), dot_onto(c, m, edges[2])];
        }
        edges
    }

    /// Bounds of z = T/D for denominators D of at least four times their error δ, with one division: for x = δ/D ≤ ¼,
    /// 1/(D + δ) ≥ (1 − x)/D and 1/(D − δ) ≤ (1 + 4x/3)/D. What is rounded here is less than 8u, of which 16u are given.
    #[inline(always)]
    fn depths(&self, slope: S, volume: S) -> (S, S) {
        let per_slope = S::splat(1.0 - 16.0 * U).div(slope);
        let x = per_slope.mul(S::splat(self.slope_error));
        let error = S::splat(self.volume_error);
        let low = volume.sub(error).mul(per_slope);
        let high = volume.add(error).mul(per_slope);
        (low.mul_add(x.neg(), low), high.mul_add(x.mul(S::splat(1.334)), high).mul(S::splat(1.0 + 34.0 * U)))
    }
}

/// edge · (gu, gv, 1).
#[inline(always)]
fn dot_ray<P: F32x16>([u, v, w]: [P; 3], gu: P, gv: P) -> P {
    gu.mul_add(u, gv.mul_add(v, w))
}

/// moment · side + term.
#[inline(always)]
fn dot_onto<P: F32x16>([u, v, w]: [P; 3], [mu, mv, mw]: [P; 3], term: P) -> P {
    mu.mul_add(u, mv.mul_add(v, mw.mul_add(w, term)))
}

/// The larger; the second if one is NaN. (The library's makes sure that it is the other one, in three instructions.)
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
