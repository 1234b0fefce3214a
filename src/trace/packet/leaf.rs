//! The test of a leaf's triangles against a packet's rays: decisions in f32 where they are [certain](super::triangles), in f64 and
//! exactly elsewhere.
//!
//! # Many rays or few
//! A leaf's box lets some of the rays of each bundle through, the active ones. Where they are few, they are set next to each other, and
//! two at a time are tested against eight triangles. Lanes are then wasted on triangles that the leaf does not have. Where they are
//! many, each bundle of sixteen is tested as it is against one triangle after the other. Lanes are then wasted on rays that are not
//! active. Both decide by the same numbers, with the same bounds. [`is_dense`] chooses in small meshes. In large ones few rays of a packet
//! meet the same triangle, and there the second way is left out of the code.
//!
//! # Depth
//! The best hit of a ray is kept as an interval of z that holds the true depth. A certain hit whose interval lies before it
//! replaces it, and one whose interval lies behind it is dropped. Where the intervals overlap, the f64 depths decide, and if
//! these are equal the ids do. A box or a triangle is skipped only if it begins behind the upper end of the interval.

use std::ops::Range;

use super::prepare::{BUNDLES, RayData, RayPacket};
use super::traverse::{Leaf, RelativeBox, larger};
use super::triangles::{Middle, PairedTriangles, PreparedTriangles, StoredTriangles};
use crate::trace::batch::{RaySet, chunk, chunk_mut};
use crate::trace::bvh::{LeafBlock, TriangleRef, WIDTH};
use crate::trace::exact::{Candidate, Corners};
use crate::trace::rounding::U;
use crate::trace::simd::{F32Lanes, F32x8, F32x16, Mask8, U32x8};

/// The effect of a leaf's tests, over all rays.
#[derive(Clone, Copy, Default)]
struct Outcome {
    /// A ray has a nearer hit than before.
    nearer: bool,
    /// A test is undecided.
    undecided: bool,
}

impl<const MULTI_ORIGIN: bool> RayPacket<'_, MULTI_ORIGIN> {
    /// Tests the triangles of a leaf against the rays of its bundles that its box lets through. `IN_SMALL_MESH` tells whether many rays may
    /// meet each triangle.
    #[inline(always)]
    pub(super) fn test_leaf<S: F32x8, const IN_SMALL_MESH: bool>(&mut self, leaf: &Leaf) {
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
        let changed = if IN_SMALL_MESH && is_dense(count, self.rays.active.bundle_count, block.triangles) {
            self.test_bundles::<S>((block_offset, block.triangles), &prepared)
        } else {
            self.test_active::<S>(block_offset, &prepared, count)
        };
        if changed {
            for index in 0..self.rays.active.bundle_count {
                let bundle = usize::from(self.rays.active.bundles[index & (BUNDLES - 1)].0) & (BUNDLES - 1);
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

    /// Tests the active rays against the triangles of a block. Returns whether a ray has a nearer hit than before, or may have one.
    #[inline(always)]
    fn test_active<S: F32x8>(
        &mut self,
        block_offset: u32,
        p: &PreparedTriangles<S, MULTI_ORIGIN>,
        count: usize,
    ) -> bool {
        let pairs = p.for_pairs();
        let mut outcome = Outcome::default();
        for first in (0..count).step_by(8) {
            self.rays_against_triangles::<S>(block_offset, p, &pairs, first..count, &mut outcome);
        }
        if outcome.nearer {
            self.scatter_back::<S>();
        }
        if outcome.undecided {
            self.decide_all(block_offset);
        }
        outcome.nearer || outcome.undecided
    }

    /// Tests up to eight active rays, from number `first` on, against the triangles of a block, two rays and eight triangles at a
    /// time. Certain hits go to the bounds and triangles of the rays, other possible hits to `undecided`.
    #[inline(always)]
    fn rays_against_triangles<S: F32x8>(
        &mut self,
        block_offset: u32,
        p: &PreparedTriangles<S, MULTI_ORIGIN>,
        pairs: &PairedTriangles<S>,
        Range { start: first, end: count }: Range<usize>,
        outcome: &mut Outcome,
    ) {
        let active = &mut self.rays.active;
        let (gu, gv) = (S::load(chunk(&active.g[0], first)), S::load(chunk(&active.g[1], first)));
        let g = [gu, gv];
        let offset = if MULTI_ORIGIN {
            [S::load(chunk(&active.offset[0], first)), S::load(chunk(&active.offset[1], first))]
        } else {
            [S::splat(0.0); 2]
        };
        let lines = p.lines(g, offset);
        let (inner, outer) = (S::F32x16::splat(p.edge_error), S::F32x16::splat(-p.edge_error));
        // The triangles that a ray may pass through, and those that it certainly passes through if their orientation is known.
        // Each ray has a byte, each triangle a bit.
        let (mut may, mut does, mut unsure) = (0_u64, 0_u64, 0_u64);
        for two in 0..4 {
            let [ea, eb, ec] = pairs.edges_of(&lines, 2 * two);
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
            let normal = p.normal.permute(lane);
            let slope = normal.dot_ray(g);
            let mut volume = p.volume.permute(lane);
            if MULTI_ORIGIN {
                volume = normal.less_offset(offset, volume);
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

    /// Tests bundles as they are against the triangles of a block. Returns whether a ray has a nearer hit than before, or may have one.
    #[inline(always)]
    fn test_bundles<S: F32x8>(&mut self, leaf: (u32, usize), p: &PreparedTriangles<S, MULTI_ORIGIN>) -> bool {
        let triangles = p.one_by_one();
        let mut changed = false;
        for index in 0..self.rays.active.bundle_count {
            let (bundle, alive) = self.rays.active.bundles[index & (BUNDLES - 1)];
            let rays = (usize::from(bundle) & (BUNDLES - 1), u32::from(alive));
            changed |= self.bundle_against_triangles::<S>(leaf, p, &triangles, rays);
        }
        changed
    }

    /// Tests some rays of a bundle, one bit each in `alive`, against the triangles of a block, one after the other.
    #[inline(always)]
    fn bundle_against_triangles<S: F32x8>(
        &mut self,
        (block_offset, triangle_count): (u32, usize),
        p: &PreparedTriangles<S, MULTI_ORIGIN>,
        triangles: &StoredTriangles,
        (bundle, alive): (usize, u32),
    ) -> bool {
        let RayData { g, offset, z_low, z_high, triangle, .. } = &mut *self.rays;
        let first = 16 * bundle;
        let g = [S::F32x16::load(chunk(&g[0], first)), S::F32x16::load(chunk(&g[1], first))];
        let offset = if MULTI_ORIGIN {
            [S::F32x16::load(chunk(&offset[0], first)), S::F32x16::load(chunk(&offset[1], first))]
        } else {
            [S::F32x16::splat(0.0); 2]
        };
        let lines = p.lines(g, offset);
        let mut best_low = S::F32x16::load(chunk(z_low, first));
        let mut best_high = S::F32x16::load(chunk(z_high, first));
        let mut best = S::F32x16::load_u32(chunk(triangle, first));
        let (inner, outer) = (S::F32x16::splat(p.edge_error), S::F32x16::splat(-p.edge_error));
        let (near, least_slope) = (S::F32x16::splat(self.near), S::F32x16::splat(4.0 * p.slope_error));
        let mut undecided = [0_u16; WIDTH];
        let (mut replaced, mut open) = (0, 0);
        for k in 0..triangle_count {
            let [ea, eb, ec] = triangles.edges_of(k, &lines);
            let least = ea.min(eb).min(ec);
            let may = least.ge(outer) & alive;
            if p.unoriented >> k & 1 != 0 {
                let unsure = may | inner.ge(ea.max(eb).max(ec)) & alive;
                undecided[k & (WIDTH - 1)] = unsure as u16;
                open |= unsure;
                continue;
            }
            if may == 0 {
                continue;
            }
            let (normal, mut volume) = triangles.plane(k);
            let slope = normal.dot_ray(g);
            if MULTI_ORIGIN {
                volume = normal.less_offset(offset, volume);
            }
            let (z_low, z_high) = p.depths(slope, volume);
            let sure = may & least.ge(inner) & slope.ge(least_slope);
            // As for the active rays: strictly before the best hit, or strictly behind it.
            let nearer = sure & z_low.ge(near) & best_low.gt(z_high);
            let behind = sure & z_low.gt(best_high);
            best_low = S::F32x16::select(nearer, z_low, best_low);
            best_high = S::F32x16::select(nearer, z_high, best_high);
            let this = S::F32x16::splat(f32::from_bits(TriangleRef::new(block_offset, k).0));
            best = S::F32x16::select(nearer, this, best);
            replaced |= nearer;
            let unsure = may & !(nearer | behind);
            undecided[k & (WIDTH - 1)] = unsure as u16;
            open |= unsure;
        }
        if replaced != 0 {
            best_low.store(chunk_mut(z_low, first));
            best_high.store(chunk_mut(z_high, first));
            best.store_u32(chunk_mut(triangle, first));
            self.replaced(RaySet::from(replaced) << first);
        }
        if open != 0 {
            self.decide_bundle(block_offset, first, &undecided);
        }
        replaced | open != 0
    }

    /// Decides the undecided tests of the rays of a bundle, whose first ray is `first`, against the triangles of a block.
    #[cold]
    #[inline(never)]
    fn decide_bundle(&mut self, block_offset: u32, first: usize, undecided: &[u16; WIDTH]) {
        for (triangle, &rays) in undecided.iter().enumerate() {
            for lane in bits(rays.into()) {
                self.decide(first + lane, block_offset, triangle);
            }
        }
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

/// Whether so many active rays of so many bundles are tested bundle by bundle. A triangle takes a bundle about 13 instructions of sixteen
/// lanes, and a bundle about as many besides as one and a half triangles; an active ray takes about 9, and its copies.
#[inline(always)]
fn is_dense(rays: usize, bundles: usize, triangles: usize) -> bool {
    2 * rays >= (4 + 3 * triangles) * bundles
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

/// The indices of the bits that are set, the lowest first.
#[inline(always)]
fn bits(mut set: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (set != 0).then_some(set.trailing_zeros() as usize);
        set &= set.wrapping_sub(1);
        bit
    })
}
