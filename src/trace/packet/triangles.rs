//! The triangles of a leaf, prepared for a packet: their edge functions and depths in f32, with the bounds of their errors.
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

use super::prepare::RayPacket;
use super::traverse::{RelativeBox, larger};
use crate::trace::bvh::{LeafBlock, WIDTH};
use crate::trace::rounding::{TINY, U};
use crate::trace::simd::{F32Lanes, F32x8, F32x16, Mask8, Vec3Lanes};

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
    pub const NONE: Self =
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

/// Rays as edge functions take them: g, or g′ where they are aimed, and 2·m for the moment m, where that is needed.
pub(super) struct Lines<L> {
    g: [L; 2],
    moment: Vec3Lanes<L>,
}

/// The triangles of a block, prepared for the packet's origin. They are oriented such that a ray that passes through a triangle
/// has positive edge functions and a positive denominator.
pub(super) struct PreparedTriangles<S: F32x8, const MULTI_ORIGIN: bool> {
    /// The vectors (c−b) × (c+b) of the edges opposite a, b and c: an edge function is g·edge.
    edges: [Vec3Lanes<S>; 3],
    /// The vectors of the edges themselves, oriented as `edges` are, if the edge functions take the moments of rays.
    sides: Option<[Vec3Lanes<S>; 3]>,
    /// k, if rays from different origins are aimed at the middle of the leaf.
    pub aimed: Option<f32>,
    pub normal: Vec3Lanes<S>,
    /// |T|.
    pub volume: S,
    /// The triangles whose orientation is known, one bit each.
    pub oriented: u32,
    /// The triangles whose orientation is not known, one bit each.
    pub unoriented: u32,
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
        let a = Vec3Lanes(u[0], v[0], w[0].xor(turn));
        let b = Vec3Lanes(u[1], v[1], w[1].xor(turn));
        let c = Vec3Lanes(u[2], v[2], w[2].xor(turn));
        let (ab, ac, bc) = (b.sub(a), c.sub(a), c.sub(b));
        let a = a.sub(Vec3Lanes::splat(packet.high)).sub(Vec3Lanes::splat(packet.low));
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
            bc.cross(b.add(c)).flip_signs(against),
            ac.cross(c.add(a)).flip_signs(volume.sign_bits()),
            ab.cross(a.add(b)).flip_signs(against),
        ];
        let sides = if MULTI_ORIGIN && aimed.is_none() {
            Some([bc.flip_signs(against), ac.flip_signs(volume.sign_bits()), ab.flip_signs(against)])
        } else {
            None
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

    /// The numbers by which the edge functions know rays that are given by g and s.
    #[inline(always)]
    pub fn lines<L: F32Lanes>(&self, g: [L; 2], [su, sv]: [L; 2]) -> Lines<L> {
        let none = Vec3Lanes::splat([0.0; 3]);
        if !MULTI_ORIGIN {
            return Lines { g, moment: none };
        }
        let [gu, gv] = g;
        if let Some(per_depth) = self.aimed {
            let per_depth = L::splat(per_depth);
            return Lines { g: [su.mul_add(per_depth, gu), sv.mul_add(per_depth, gv)], moment: none };
        }
        let moment =
            Vec3Lanes(L::splat(0.0).sub(sv.add(sv)), su.add(su), gu.add(gu).mul_sub(sv, gv.add(gv).mul(su)));
        Lines { g, moment }
    }

    /// The triangles for tests of two rays at a time.
    #[inline(always)]
    pub fn for_pairs(&self) -> PairedTriangles<S> {
        let [a, b, c] = self.edges;
        let edges = [a.in_both_halves(), b.in_both_halves(), c.in_both_halves()];
        let mut sides = None;
        if let Some([a, b, c]) = self.sides {
            sides = Some([a.in_both_halves(), b.in_both_halves(), c.in_both_halves()]);
        }
        PairedTriangles { edges, sides }
    }

    /// The triangles for tests of one triangle at a time.
    #[inline(always)]
    pub fn one_by_one(&self) -> StoredTriangles {
        let [a, b, c] = self.edges;
        let edges = [stored(a), stored(b), stored(c)];
        let mut sides = None;
        if let Some([a, b, c]) = self.sides {
            sides = Some([stored(a), stored(b), stored(c)]);
        }
        let mut volume = [0.0; WIDTH];
        self.volume.store(&mut volume);
        StoredTriangles { edges, sides, normal: stored(self.normal), volume }
    }

    /// Bounds of z = T/D for a denominator D of at least four times its error δ, with one division: for x = δ/D ≤ ¼,
    /// 1/(D + δ) ≥ (1 − x)/D and 1/(D − δ) ≤ (1 + 4x/3)/D. The roundings here add up to less than 8u, for which 16u are given.
    #[inline(always)]
    pub fn depths<L: F32Lanes>(&self, slope: L, volume: L) -> (L, L) {
        let per_slope = L::splat(1.0 - 16.0 * U).div(slope);
        let x = per_slope.mul(L::splat(self.slope_error));
        let error = L::splat(self.volume_error);
        let low = volume.sub(error).mul(per_slope);
        let high = volume.add(error).mul(per_slope);
        let less = L::splat(0.0).sub(x);
        (low.mul_add(less, low), high.mul_add(x.mul(L::splat(1.334)), high).mul(L::splat(1.0 + 34.0 * U)))
    }
}

/// The triangles of a block for tests of two rays at a time: each vector in both halves.
pub(super) struct PairedTriangles<S: F32x8> {
    edges: [Vec3Lanes<S::F32x16>; 3],
    sides: Option<[Vec3Lanes<S::F32x16>; 3]>,
}

impl<S: F32x8> PairedTriangles<S> {
    /// The edge functions of all triangles for two of these rays, `first` and `first` + 1.
    #[inline(always)]
    pub fn edges_of(&self, lines: &Lines<S>, first: usize) -> [S::F32x16; 3] {
        let [a, b, c] = self.edges;
        let g = [S::F32x16::broadcast_two(lines.g[0], first), S::F32x16::broadcast_two(lines.g[1], first)];
        let edges = [a.dot_ray(g), b.dot_ray(g), c.dot_ray(g)];
        let Some([a, b, c]) = self.sides else { return edges };
        let moment = Vec3Lanes(
            S::F32x16::broadcast_two(lines.moment.0, first),
            S::F32x16::broadcast_two(lines.moment.1, first),
            S::F32x16::broadcast_two(lines.moment.2, first),
        );
        [moment.dot_onto(a, edges[0]), moment.dot_onto(b, edges[1]), moment.dot_onto(c, edges[2])]
    }
}

/// The triangles of a block for tests of one triangle at a time. They are in memory, from where a number is broadcast to all lanes
/// in the instruction that computes with it.
pub(super) struct StoredTriangles {
    edges: [[[f32; WIDTH]; 3]; 3],
    sides: Option<[[[f32; WIDTH]; 3]; 3]>,
    normal: [[f32; WIDTH]; 3],
    volume: [f32; WIDTH],
}

impl StoredTriangles {
    /// The edge functions of one triangle for rays.
    #[inline(always)]
    pub fn edges_of<L: F32Lanes>(&self, triangle: usize, lines: &Lines<L>) -> [L; 3] {
        let [a, b, c] = &self.edges;
        let (a, b, c) = (in_all(a, triangle), in_all(b, triangle), in_all(c, triangle));
        let edges = [a.dot_ray(lines.g), b.dot_ray(lines.g), c.dot_ray(lines.g)];
        let Some([a, b, c]) = &self.sides else { return edges };
        let (a, b, c) = (in_all(a, triangle), in_all(b, triangle), in_all(c, triangle));
        let moment = lines.moment;
        [moment.dot_onto(a, edges[0]), moment.dot_onto(b, edges[1]), moment.dot_onto(c, edges[2])]
    }

    /// The normal and |T| of one triangle, in all lanes.
    #[inline(always)]
    pub fn plane<L: F32Lanes>(&self, triangle: usize) -> (Vec3Lanes<L>, L) {
        (in_all(&self.normal, triangle), L::splat(self.volume[triangle & (WIDTH - 1)]))
    }
}

/// The vectors of a block's triangles in memory, coordinate by coordinate.
#[inline(always)]
fn stored<S: F32x8>(v: Vec3Lanes<S>) -> [[f32; WIDTH]; 3] {
    let mut to = [[0.0; WIDTH]; 3];
    v.0.store(&mut to[0]);
    v.1.store(&mut to[1]);
    v.2.store(&mut to[2]);
    to
}

/// One of these vectors in all lanes.
#[inline(always)]
fn in_all<L: F32Lanes>(v: &[[f32; WIDTH]; 3], triangle: usize) -> Vec3Lanes<L> {
    let lane = triangle & (WIDTH - 1);
    Vec3Lanes::splat([v[0][lane], v[1][lane], v[2][lane]])
}
