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

use std::marker::PhantomData;

use super::walk::{Leaf, RelativeBox};
use super::{BUNDLES, GROUPS, RAYS, Set, TINY, Tile, U, bits, eight, eight_mut};
use crate::trace::effort::Effort;
use crate::trace::exact::{Candidate, Corners};
use crate::trace::lanes::{Lanes, Mask, Pair, Triple, Words};
use crate::trace::wide::{Block, Slot};

/// Error of an edge function in units of u·G·L·M.
const EDGE: f32 = 56.0;
/// The same where origins differ, in units of u·G·L·(M + S).
const EDGE_APART: f32 = 72.0;
/// Error of a triangle's volume T in units of u·L²·M, or u·L²·(M + S).
const VOLUME: f32 = 64.0;
/// Error of the denominator of a depth in units of u·G·L².
const SLOPE: f32 = 24.0;

/// The rays that a block's box lets through, side by side.
pub(super) struct Chosen {
    /// g_u and g_v.
    g: [[f32; ROOM]; 2],
    /// As [`PerRay`](super::PerRay) has it, if origins differ.
    moment: [[f32; ROOM]; 3],
    /// Bounds of the nearest hits' depths, and their slots.
    z_low: [f32; ROOM],
    z_high: [f32; ROOM],
    slot: [u32; ROOM],
    /// Which ray it is.
    ray: [u32; ROOM],
    /// Of each eight, which a triangle of the block leaves undecided: a bit each of a byte a triangle.
    undecided: [[u8; 8]; GROUPS],
    /// The groups that they are of, and which of each group they are, a bit each.
    groups: [(u8, u8); GROUPS],
    group_count: usize,
    pub effort: Effort,
}

/// Rays are written eight at a time, of which any number may count.
const ROOM: usize = RAYS + 8;

impl Default for Chosen {
    fn default() -> Self {
        let none = [0.0; ROOM];
        Self {
            g: [none; 2],
            moment: [none; 3],
            z_low: none,
            z_high: none,
            slot: [0; ROOM],
            ray: [0; ROOM],
            undecided: [[0; 8]; GROUPS],
            groups: [(0, 0); GROUPS],
            group_count: 0,
            effort: Effort::default(),
        }
    }
}

/// Numbers of the rays of the first group.
const NUMBERS: [u32; 8] = [0, 1, 2, 3, 4, 5, 6, 7];

impl<const APART: bool> Tile<'_, APART> {
    /// Tests the triangles of a block against the rays of its bundles that its box lets through.
    #[inline(always)]
    pub(super) fn test_leaf<S: Lanes>(&mut self, leaf: &Leaf) {
        let Leaf { number: granule, bounds: ref b, bundles } = *leaf;
        // M: the box is padded, so no corner is farther out.
        let side = |side: [f32; 2]| larger(side[0].abs(), side[1].abs());
        let m = larger(larger(side(b.u), side(b.v)), side(b.w));
        let count = self.choose::<S>(b, m, bundles);
        if count == 0 {
            return;
        }
        let block = Block::at(&self.wide.blocks, granule);
        self.rays.chosen.effort.leaves += 1;
        self.rays.chosen.effort.tests += (count * block.triangles) as u64;
        let prepared = Prepared::<S, APART>::new(self, &block, m);
        let mut undecided = 0;
        for first in (0..count).step_by(8) {
            undecided |= self.triangles_against_rays::<S>(granule, &prepared, first, count);
        }
        self.take_back::<S>();
        if undecided != 0 {
            self.decide_all(granule, block.triangles, count);
        }
        for bundle in bits(bundles) {
            let bundle = bundle & (BUNDLES - 1);
            self.far[bundle] = self.farthest_of::<S>(bundle);
        }
        self.farthest = S::load(&self.far).largest();
    }

    /// Sets the rays of `bundles` that may meet a box side by side; how many they are.
    #[inline(always)]
    fn choose<S: Lanes>(&mut self, b: &RelativeBox, m: f32, bundles: u32) -> usize {
        let super::PerRay { g, moment, z_low, z_high, slot, chosen, .. } = &mut *self.rays;
        // 2⁻²⁴ of |g|·w ≤ 8M is lost twice, in g and in the product.
        let room = 32.0 * U * m;
        let begin = larger(-b.w[0], 0.0);
        let (near, end) = (S::Pair::splat(begin), S::Pair::splat(b.w[1]));
        let u = S::Pair::of(S::splat(b.u[0] + room), S::splat(b.u[1] + room));
        let v = S::Pair::of(S::splat(b.v[0] + room), S::splat(b.v[1] + room));
        let numbers = S::Words::load(&NUMBERS);
        let mut count = 0;
        chosen.group_count = 0;
        for bundle in bits(bundles) {
            let bundle = bundle & (BUNDLES - 1);
            for group in [2 * bundle, 2 * bundle + 1] {
                let (gu, gv) = (S::Pair::load(&g[0][group]), S::Pair::load(&g[1][group]));
                let high = S::load(eight(z_high, group));
                let least = [gu.mul(near).min(gu.mul(end)), gv.mul(near).min(gv.mul(end))];
                let mask = S::Pair::all_ge([u, v], least).and(high.ge(S::splat(begin)));
                if mask.bits() == 0 {
                    continue;
                }
                chosen.groups[chosen.group_count & (GROUPS - 1)] = (group as u8, mask.bits() as u8);
                chosen.group_count += 1;
                gu.halves().1.compress(mask).store(at_mut(&mut chosen.g[0], count));
                gv.halves().1.compress(mask).store(at_mut(&mut chosen.g[1], count));
                S::load(eight(z_low, group)).compress(mask).store(at_mut(&mut chosen.z_low, count));
                high.compress(mask).store(at_mut(&mut chosen.z_high, count));
                let slots = S::Words::load(eight(slot, group)).as_floats().compress(mask);
                S::Words::of_floats(slots).store(at_mut(&mut chosen.slot, count));
                let number = numbers.add(S::Words::splat(8 * group as u32));
                S::Words::of_floats(number.as_floats().compress(mask)).store(at_mut(&mut chosen.ray, count));
                if APART {
                    for (from, to) in moment.iter().zip(&mut chosen.moment) {
                        S::load(eight(from, group)).compress(mask).store(at_mut(to, count));
                    }
                }
                count += mask.bits().count_ones() as usize;
            }
        }
        count
    }

    /// Tests a block's triangles against the chosen rays from number `first` on, at most eight. What is sure goes to the rays'
    /// bounds and slots, what is not to `undecided`; gives whether there is any, as bits that are not 0.
    #[inline(always)]
    fn triangles_against_rays<S: Lanes>(
        &mut self,
        granule: u32,
        p: &Prepared<S, APART>,
        first: usize,
        count: usize,
    ) -> u32 {
        let present = S::Mask::of_bits(((1_u64 << (count - first).min(8)) - 1) as u32);
        let chosen = &mut self.rays.chosen;
        let (gu, gv) = (S::load(at(&chosen.g[0], first)), S::load(at(&chosen.g[1], first)));
        let m = if APART {
            let [u, v, w] = &chosen.moment;
            Triple(S::load(at(u, first)), S::load(at(v, first)), S::load(at(w, first)))
        } else {
            Triple::splat([0.0; 3])
        };
        let mut best_low = S::load(at(&chosen.z_low, first));
        let mut best_high = S::load(at(&chosen.z_high, first));
        let mut slots = S::Words::load(at(&chosen.slot, first));
        let (inner, outer) = (S::splat(p.edge_error), S::splat(-p.edge_error));
        let (near, least_slope) = (S::splat(self.near), S::splat(4.0 * p.slope_error));
        let undecided = &mut chosen.undecided[first / 8];
        *undecided = [0; 8];
        let mut any = 0;
        for lane in bits(p.oriented) {
            let lane = lane & 7;
            let [ea, eb, ec] = p.edges_of(lane, gu, gv, m);
            let least = ea.min(eb).min(ec);
            let maybe = least.ge(outer).and(present);
            if maybe.bits() == 0 {
                continue;
            }
            let normal = Triple::spread_lane(&p.normal, lane);
            let slope = normal.dot_ray(gu, gv);
            let mut volume = S::splat(p.volume[lane]);
            if APART {
                volume = normal.less_offset(m, volume);
            }
            let (z_low, z_high) = p.depths(slope, volume);
            let sure = least.ge(inner).and(slope.ge(least_slope)).and(present);
            // Strictly before, and strictly behind.
            let nearer = sure.and(z_low.ge(near)).and(best_low.gt(z_high));
            let behind = sure.and(z_low.gt(best_high));
            best_low = S::select(nearer, z_low, best_low);
            best_high = S::select(nearer, z_high, best_high);
            let slot = S::Words::splat(Slot::new(granule, lane).0).as_floats();
            slots = S::Words::of_floats(S::select(nearer, slot, slots.as_floats()));
            let rest = maybe.bits() & !nearer.or(behind).bits();
            undecided[lane] = rest as u8;
            any |= rest;
        }
        for lane in bits(p.unoriented) {
            let lane = lane & 7;
            let [ea, eb, ec] = p.edges_of(lane, gu, gv, m);
            let one_side = ea.min(eb).min(ec).ge(outer);
            let other_side = inner.ge(ea.max(eb).max(ec));
            let rest = one_side.or(other_side).and(present).bits();
            undecided[lane] = rest as u8;
            any |= rest;
        }
        best_low.store(at_mut(&mut chosen.z_low, first));
        best_high.store(at_mut(&mut chosen.z_high, first));
        slots.store(at_mut(&mut chosen.slot, first));
        any
    }

    /// Takes back what the chosen have hit for sure.
    #[inline(always)]
    fn take_back<S: Lanes>(&mut self) {
        let super::PerRay { z_low, z_high, slot, chosen, .. } = &mut *self.rays;
        let (mut count, mut changed) = (0, 0);
        for &(group, alive) in &chosen.groups[..chosen.group_count] {
            let group = usize::from(group) & (GROUPS - 1);
            let mask = S::Mask::of_bits(u32::from(alive));
            let old_high = S::load(eight(z_high, group));
            let high = S::load(at(&chosen.z_high, count)).expand(mask, old_high);
            high.store(eight_mut(z_high, group));
            let low = S::load(at(&chosen.z_low, count)).expand(mask, S::load(eight(z_low, group)));
            low.store(eight_mut(z_low, group));
            let old_slots = S::Words::load(eight(slot, group)).as_floats();
            let slots = S::Words::load(at(&chosen.slot, count)).as_floats().expand(mask, old_slots);
            S::Words::of_floats(slots).store(eight_mut(slot, group));
            // Whoever has something new has it strictly before what it had.
            changed |= Set::from(old_high.gt(high).bits()) << (8 * group);
            count += alive.count_ones() as usize;
        }
        self.replaced(changed);
    }

    /// Decides what triangles of a block left undecided for the `count` chosen rays.
    #[cold]
    #[inline(never)]
    fn decide_all(&mut self, granule: u32, triangles: usize, count: usize) {
        for first in (0..count).step_by(8) {
            for lane in 0..triangles {
                for k in bits(u32::from(self.rays.chosen.undecided[first / 8][lane])) {
                    self.decide(self.rays.chosen.ray[first + k] as usize, granule, lane);
                }
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
    fn decide(&mut self, ray: usize, granule: u32, lane: usize) {
        let block = Block::at(&self.wide.blocks, granule);
        let direction = self.directions[ray];
        let corners = Corners::from_positions(block.positions(lane), self.origin(ray));
        if !corners.passes_counted(direction, &mut self.rays.chosen.effort) {
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
    lanes: PhantomData<S>,
    /// E = g·edge of the three edges, those opposite a, b and c.
    edges: [[[f32; 8]; 3]; 3],
    /// Their vectors, turned as `edges` are; only if origins differ.
    sides: [[[f32; 8]; 3]; 3],
    normal: [[f32; 8]; 3],
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
            bc.cross(b.add(c)).flip(against).store(),
            ac.cross(c.add(a)).flip(volume.signs()).store(),
            ab.cross(a.add(b)).flip(against).store(),
        ];
        let sides = if APART {
            [bc.flip(against).store(), ac.flip(volume.signs()).store(), ab.flip(against).store()]
        } else {
            [[[0.0; 8]; 3]; 3]
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
            lanes: PhantomData,
            edges,
            sides,
            normal: normal.flip(volume.signs()).store(),
            volume: volumes,
            oriented: known,
            unoriented: triangles & !known,
            edge_error,
            volume_error,
            slope_error,
        }
    }

    /// The edge functions of one triangle, for rays of these g and moments.
    #[inline(always)]
    fn edges_of(&self, lane: usize, gu: S, gv: S, m: Triple<S>) -> [S; 3] {
        let mut edges = [
            Triple::spread_lane(&self.edges[0], lane).dot_ray(gu, gv),
            Triple::spread_lane(&self.edges[1], lane).dot_ray(gu, gv),
            Triple::spread_lane(&self.edges[2], lane).dot_ray(gu, gv),
        ];
        if APART {
            edges = [
                m.dot_onto(Triple::spread_lane(&self.sides[0], lane), edges[0]),
                m.dot_onto(Triple::spread_lane(&self.sides[1], lane), edges[1]),
                m.dot_onto(Triple::spread_lane(&self.sides[2], lane), edges[2]),
            ];
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

/// The larger; the second if one is NaN. (The library's makes sure that it is the other one, in three instructions.)
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Eight of the chosen.
#[inline(always)]
fn at<T>(values: &[T; ROOM], first: usize) -> &[T; 8] {
    values[first..first + 8].try_into().unwrap()
}

#[inline(always)]
fn at_mut<T>(values: &mut [T; ROOM], first: usize) -> &mut [T; 8] {
    (&mut values[first..first + 8]).try_into().unwrap()
}
