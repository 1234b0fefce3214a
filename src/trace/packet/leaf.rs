//! Triangles against a tile's rays: decisions in f32 where they are sure, in f64 and exactly where they are not.
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
//! u·G·L·S, and the longer sum another 12 of u·G·L·M: with the 52 above at most 68 of u·G·L·(M + S); [`EDGE_APART`] is 72. The error
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

use super::{GROUPS, Leaf, Rectangle, RelativeBox, TINY, Tile, U, bits, eight, eight_mut, meets, spread};
use crate::trace::exact::{Candidate, Corners};
use crate::trace::lanes::{Lanes, Mask, Triple, Words};
use crate::trace::wide::{Block, Slot};

/// Error of an edge function in units of u·G·L·M.
const EDGE: f32 = 56.0;
/// The same where origins differ, in units of u·G·L·(M + S).
const EDGE_APART: f32 = 72.0;
/// Error of a triangle's volume T in units of u·L²·M, or u·L²·(M + S).
const VOLUME: f32 = 64.0;
/// Error of the denominator of a depth in units of u·G·L².
const SLOPE: f32 = 24.0;

impl<const APART: bool> Tile<'_, APART> {
    /// Tests the triangles of a block against the rays of `groups` that its box lets through.
    #[inline(always)]
    pub(super) fn test_leaf<S: Lanes>(&mut self, leaf: &Leaf) {
        let Leaf { number: granule, bounds: ref b, groups } = *leaf;
        // M: the box is padded, so no corner is farther out.
        let largest = |side: [f32; 2]| side[0].abs().max(side[1].abs());
        let m = largest(b.u).max(largest(b.v)).max(largest(b.w));
        let mut alive = [0_u8; GROUPS];
        let mut rays = 0;
        let mut busy_groups = 0;
        // 2⁻²⁴ of |g|·w ≤ 8M is lost twice, in g and in the product.
        let room = 32.0 * U * m;
        let planes = RelativeBox::<S> {
            u: spread([b.u[0] - room, b.u[1] + room]),
            v: spread([b.v[0] - room, b.v[1] + room]),
            w: spread(b.w),
        };
        let begins = planes.w[0].max(S::splat(0.0));
        for group in bits(groups) {
            let (gu, gv) = (S::load(eight(&self.rays.g[0], group)), S::load(eight(&self.rays.g[1], group)));
            let far = S::load(eight(&self.rays.z_high, group));
            let met = meets(&Rectangle { u: [gu, gu], v: [gv, gv] }, &planes).and(far.ge(begins)).bits();
            alive[group] = met as u8;
            rays += met.count_ones();
            busy_groups += u32::from(met != 0);
        }
        if rays == 0 {
            return;
        }
        let block = Block::at(&self.wide.blocks, granule);
        let prepared = Prepared::<S, APART>::new(self, &block, m);
        if rays <= 2 + busy_groups * block.triangles as u32 {
            self.rays_against_triangles(granule, &prepared, &alive);
        } else {
            self.triangles_against_rays(granule, &prepared, &alive);
        }
        for group in bits(groups) {
            if alive[group] != 0 {
                self.far[group] = S::load(eight(&self.rays.z_high, group)).largest();
            }
        }
        self.farthest = S::load(&self.far).largest();
    }

    /// One ray at a time against all triangles: for few rays.
    #[inline(always)]
    fn rays_against_triangles<S: Lanes>(
        &mut self,
        granule: u32,
        p: &Prepared<S, APART>,
        alive: &[u8; GROUPS],
    ) {
        for (group, &alive) in alive.iter().enumerate() {
            for lane in bits(u32::from(alive)) {
                let ray = group * 8 + lane;
                let (gu, gv) = (S::splat(self.rays.g[0][ray]), S::splat(self.rays.g[1][ray]));
                let mut edges =
                    [p.edges[0].dot_ray(gu, gv), p.edges[1].dot_ray(gu, gv), p.edges[2].dot_ray(gu, gv)];
                let mut volume = S::load(&p.volume);
                if APART {
                    let m = Triple::splat([0, 1, 2].map(|k| self.rays.moment[k][ray]));
                    for (edge, side) in edges.iter_mut().zip(&p.sides) {
                        *edge = m.dot_onto(*side, *edge);
                    }
                    volume = p.normal.less_offset(m, volume);
                }
                let least = edges[0].min(edges[1]).min(edges[2]);
                let outer = S::splat(-p.edge_error);
                let mut maybe = least.ge(outer).bits() & p.oriented;
                if p.unoriented != 0 {
                    let most = edges[0].max(edges[1]).max(edges[2]);
                    maybe |= least.ge(outer).or(S::splat(p.edge_error).ge(most)).bits() & p.unoriented;
                }
                if maybe == 0 {
                    continue;
                }
                let slope = p.normal.dot_ray(gu, gv);
                let sure =
                    least.ge(S::splat(p.edge_error)).and(slope.ge(S::splat(4.0 * p.slope_error))).bits()
                        & p.oriented;
                let (z_low, z_high) = p.depths(slope, volume);
                let (mut low, mut high) = ([0.0; 8], [0.0; 8]);
                z_low.store(&mut low);
                z_high.store(&mut high);
                for lane in bits(maybe) {
                    if sure >> lane & 1 == 0 || low[lane] < self.near {
                        self.decide(ray, granule, lane);
                    } else if high[lane] < self.rays.z_low[ray] {
                        self.rays.z_low[ray] = low[lane];
                        self.rays.z_high[ray] = high[lane];
                        self.rays.slot[ray] = Slot::new(granule, lane).0;
                        self.replaced(1 << ray);
                    } else if low[lane] <= self.rays.z_high[ray] {
                        self.decide(ray, granule, lane);
                    }
                }
            }
        }
    }

    /// One triangle at a time against eight rays: for many rays.
    #[inline(always)]
    fn triangles_against_rays<S: Lanes>(
        &mut self,
        granule: u32,
        p: &Prepared<S, APART>,
        alive: &[u8; GROUPS],
    ) {
        let all = p.oriented | p.unoriented;
        let tables = [p.edges[0].store(), p.edges[1].store(), p.edges[2].store(), p.normal.store()];
        let side_tables = if APART { Some(p.sides.map(Triple::store)) } else { None };
        for lane in bits(all) {
            let a = Triple::<S>::spread_lane(&tables[0], lane);
            let b = Triple::<S>::spread_lane(&tables[1], lane);
            let c = Triple::<S>::spread_lane(&tables[2], lane);
            let is_oriented = p.oriented >> lane & 1 != 0;
            for (group, &alive) in alive.iter().enumerate() {
                if alive == 0 {
                    continue;
                }
                let (gu, gv) =
                    (S::load(eight(&self.rays.g[0], group)), S::load(eight(&self.rays.g[1], group)));
                let (mut ea, mut eb, mut ec) = (a.dot_ray(gu, gv), b.dot_ray(gu, gv), c.dot_ray(gu, gv));
                let mut volume = S::splat(p.volume[lane]);
                let m = if APART { self.moments(group) } else { Triple::splat([0.0; 3]) };
                if let (true, Some(sides)) = (APART, &side_tables) {
                    ea = m.dot_onto(Triple::spread_lane(&sides[0], lane), ea);
                    eb = m.dot_onto(Triple::spread_lane(&sides[1], lane), eb);
                    ec = m.dot_onto(Triple::spread_lane(&sides[2], lane), ec);
                }
                let least = ea.min(eb).min(ec);
                let mut maybe = least.ge(S::splat(-p.edge_error));
                if !is_oriented {
                    maybe = maybe.or(S::splat(p.edge_error).ge(ea.max(eb).max(ec)));
                }
                let maybe_bits = maybe.bits() & u32::from(alive);
                if maybe_bits == 0 {
                    continue;
                }
                if !is_oriented {
                    for k in bits(maybe_bits) {
                        self.decide(group * 8 + k, granule, lane);
                    }
                    continue;
                }
                let normal = Triple::<S>::spread_lane(&tables[3], lane);
                let slope = normal.dot_ray(gu, gv);
                if APART {
                    volume = normal.less_offset(m, volume);
                }
                let (z_low, z_high) = p.depths(slope, volume);
                let best_low = S::load(eight(&self.rays.z_low, group));
                let best_high = S::load(eight(&self.rays.z_high, group));
                let sure = least.ge(S::splat(p.edge_error)).and(slope.ge(S::splat(4.0 * p.slope_error)));
                let in_front = sure.and(z_low.ge(S::splat(self.near)));
                // Strictly before, and strictly behind.
                let nearer_bits = in_front.bits() & !z_high.ge(best_low).bits() & maybe_bits;
                let behind_bits = sure.bits() & !best_high.ge(z_low).bits();
                if nearer_bits != 0 {
                    let nearer = S::Mask::of_bits(nearer_bits);
                    S::select(nearer, z_low, best_low).store(eight_mut(&mut self.rays.z_low, group));
                    S::select(nearer, z_high, best_high).store(eight_mut(&mut self.rays.z_high, group));
                    let slots = eight_mut(&mut self.rays.slot, group);
                    let slot = S::Words::splat(Slot::new(granule, lane).0).as_floats();
                    let slot = S::select(nearer, slot, S::Words::load(slots).as_floats());
                    S::Words::of_floats(slot).store(slots);
                    self.replaced(u64::from(nearer_bits) << (group * 8));
                }
                for k in bits(maybe_bits & !nearer_bits & !behind_bits) {
                    self.decide(group * 8 + k, granule, lane);
                }
            }
        }
    }

    /// 2·m of eight rays.
    #[inline(always)]
    fn moments<S: Lanes>(&self, group: usize) -> Triple<S> {
        let [u, v, w] = &self.rays.moment;
        Triple(S::load(eight(u, group)), S::load(eight(v, group)), S::load(eight(w, group)))
    }

    /// Notes that these rays have a new best hit, here, whose f64 depth is not worked out.
    #[inline(always)]
    fn replaced(&mut self, rays: u64) {
        self.hit |= rays;
        self.here |= rays;
        self.known &= !rays;
    }

    /// Decides in f64 and, where that is not enough, exactly.
    #[cold]
    #[inline(never)]
    fn decide(&mut self, ray: usize, granule: u32, lane: usize) {
        let block = Block::at(&self.wide.blocks, granule);
        let direction = self.directions[ray];
        let corners = Corners::from_positions(block.positions(lane), self.origin(ray));
        if !corners.passes(direction) {
            return;
        }
        let t = corners.depth(direction);
        if !(self.t_min..=self.t_max).contains(&t) {
            return;
        }
        let found = Candidate { t, placement: self.placement, triangle: block.id(lane) };
        if self.hit >> ray & 1 != 0 {
            let best = Slot(self.rays.slot[ray]);
            let is_here = self.here >> ray & 1 != 0;
            let known = Candidate {
                t: self.depth_of_best(ray),
                placement: if is_here { self.placement } else { self.rays.foreign[ray] },
                triangle: if is_here {
                    Block::at(&self.wide.blocks, best.granule()).id(best.lane())
                } else {
                    0
                },
            };
            if !found.beats(&known) {
                return;
            }
        }
        (self.rays.z_low[ray], self.rays.z_high[ray]) = self.along(ray, t);
        self.rays.slot[ray] = Slot::new(granule, lane).0;
        self.replaced(1 << ray);
        self.rays.t[ray] = t;
        self.known |= 1 << ray;
    }

    /// The f64 depth of a ray's best hit, worked out once.
    pub(super) fn depth_of_best(&mut self, ray: usize) -> f64 {
        if self.known >> ray & 1 == 0 {
            let slot = Slot(self.rays.slot[ray]);
            let positions = Block::at(&self.wide.blocks, slot.granule()).positions(slot.lane());
            self.rays.t[ray] =
                Corners::from_positions(positions, self.origin(ray)).depth(self.directions[ray]);
            self.known |= 1 << ray;
        }
        self.rays.t[ray]
    }
}

/// A block's triangles, prepared for the tile's origin: turned so that rays that pass from the front of the pyramid have
/// positive edge functions and a positive denominator.
struct Prepared<S, const APART: bool> {
    /// E = g·edge of the three edges, those opposite a, b and c.
    edges: [Triple<S>; 3],
    /// Their vectors, turned as `edges` are; only if origins differ.
    sides: [Triple<S>; 3],
    normal: Triple<S>,
    /// |T|.
    volume: [f32; 8],
    /// Triangles whose orientation is known, and those whose is not, a bit each.
    oriented: u32,
    unoriented: u32,
    edge_error: f32,
    volume_error: f32,
    slope_error: f32,
}

impl<S: Lanes, const APART: bool> Prepared<S, APART> {
    #[inline(always)]
    fn new(tile: &Tile<APART>, block: &Block, m: f32) -> Self {
        let turn = S::splat(if tile.turned { -0.0 } else { 0.0 });
        let corners = [block.corner(0), block.corner(1), block.corner(2)];
        let [u, v, w] = tile.axes;
        let (u, v, w) = (
            block.coordinates(u, corners),
            block.coordinates(v, corners),
            block.coordinates::<S>(w, corners),
        );
        let a = Triple(u[0], v[0], w[0].xor(turn));
        let b = Triple(u[1], v[1], w[1].xor(turn));
        let c = Triple(u[2], v[2], w[2].xor(turn));
        let (ab, ac, bc) = (b.sub(a), c.sub(a), c.sub(b));
        let a = a.sub(Triple::splat(tile.high)).sub(Triple::splat(tile.low));
        let (b, c) = (a.add(ab), a.add(ac));
        let normal = ab.cross(ac);
        let volume = a.0.mul_add(normal.0, a.1.mul_add(normal.1, a.2.mul(normal.2)));

        let side = block.extent() * (1.0 + 4.0 * U) + 4.0 * U * m;
        let (edge, m) = if APART { (EDGE_APART, m + tile.offset) } else { (EDGE, m) };
        let edge_error = edge * U * tile.reach * side * m + TINY;
        let volume_error = VOLUME * U * side * side * m + TINY;
        let slope_error = SLOPE * U * tile.reach * side * side + TINY;

        // (c−b) × (c+b) is −2 b × c: positive inside for a triangle with T < 0.
        let against = volume.signs().neg();
        let edges = [
            bc.cross(b.add(c)).flip(against),
            ac.cross(c.add(a)).flip(volume.signs()),
            ab.cross(a.add(b)).flip(against),
        ];
        let sides = if APART {
            [bc.flip(against), ac.flip(volume.signs()), ab.flip(against)]
        } else {
            [Triple::splat([0.0; 3]); 3]
        };
        let size = volume.abs();
        // |s·N|, with room for the rounding of N and of this.
        let shift = if APART {
            normal.0.abs().add(normal.1.abs()).mul(S::splat(tile.offset * (1.0 + 32.0 * U)))
        } else {
            S::splat(0.0)
        };
        let least_volume = shift.add(S::splat(volume_error));
        let triangles = (1_u32 << block.triangles) - 1;
        let unoriented = least_volume.ge(size).bits() & triangles;
        // NaN, from overflow, is on neither side of anything.
        let known = size.ge(least_volume).bits() & triangles & !unoriented;
        let mut volumes = [0.0; 8];
        size.store(&mut volumes);
        Self {
            edges,
            sides,
            normal: normal.flip(volume.signs()),
            volume: volumes,
            oriented: known,
            unoriented: triangles & !known,
            edge_error,
            volume_error,
            slope_error,
        }
    }

    /// Bounds of z for denominators of at least four times their error.
    #[inline(always)]
    fn depths(&self, slope: S, volume: S) -> (S, S) {
        let (volume_error, slope_error) = (S::splat(self.volume_error), S::splat(self.slope_error));
        let low = volume.sub(volume_error).div(slope.add(slope_error));
        let high = volume.add(volume_error).div(slope.sub(slope_error));
        (low.mul(S::splat(1.0 - 16.0 * U)), high.mul(S::splat(1.0 + 16.0 * U)))
    }
}
