//! The preparation of a packet: its axes, its rays as points on the plane w = 1, and the rectangles around them.

use glam::DVec3;

use crate::trace::batch::{Batch, NearestHits, PACKET_RAYS, RaySet, chunk, chunk_mut, group_of, rays_of};
use crate::trace::bvh::{Bvh8, TriangleRef};
use crate::trace::exact::Real;
use crate::trace::hit_attributes::Surfaces;
use crate::trace::rays::Origins;
use crate::trace::rounding::{TINY, U};
use crate::trace::simd::{F32x8, F32x16, F64x8};
use crate::trace::stats::TraversalStats;

/// Rays are computed with in groups of eight.
const GROUPS: usize = PACKET_RAYS / 8;

/// The hierarchy is traversed by bundles of two groups, so that eight bundles are tested against a box at a time.
pub(super) const BUNDLES: usize = GROUPS / 2;

/// The bound of |g_u| and |g_v| for the rays of a packet.
const STEEPEST: f64 = 8.0;

/// The largest direction of a packet along w, and the inverse of the least. Depths are multiplied by it, and its inverse is taken.
const LENGTHS: f64 = 1e30;

/// How far from their common point the origins of a packet may lie, in units of the largest |coordinate| of the mesh. Rays whose
/// origins lie farther apart have too little in common.
const SPREAD: f64 = 1.0 / 256.0;

/// How far the sides of a packet's rectangles are moved outwards, relative to their coordinate and, for coordinates that
/// underflow, absolutely. Rounding g to f32 costs u of the coordinate, moving a side another u, and multiplying it by a depth
/// another u. 4·10⁻⁷ is 6.7u, so it has room for twice these 3u.
const RECTANGLE_MARGIN: f32 = 4e-7;

/// Whether rays from these origins may make a packet. The first and the last of them tell whether they come from all over.
#[inline(always)]
pub(in crate::trace) fn may_be_packet(bvh: &Bvh8, origins: Origins) -> bool {
    match origins {
        Origins::Common(_) => true,
        Origins::Each(all) => {
            let (first, last) = (all[0], all[all.len() - 1]);
            (last - first).abs().max_element() <= f64::from(bvh.largest) * (2.0 * SPREAD)
        }
    }
}

/// The data of each ray of a packet. The memory is used again from packet to packet. (Sixteen rays are read at a time, from
/// whole cache lines.)
#[repr(align(64))]
pub(in crate::trace) struct RayData {
    /// g_u and g_v.
    pub(super) g: [[f32; PACKET_RAYS]; 2],
    /// s_u and s_v, if the origins differ.
    pub(super) offset: [[f32; PACKET_RAYS]; 2],
    /// Bounds of the depth along w of the nearest hit. They are −1 in lanes without a ray.
    pub(super) z_low: [f32; PACKET_RAYS],
    pub(super) z_high: [f32; PACKET_RAYS],
    /// The triangle of the nearest hit, for rays in [`RayPacket::here`].
    pub(super) triangle: [u32; PACKET_RAYS],
    /// The f64 depth of the nearest hit, for rays in [`RayPacket::known`].
    pub(super) t: [f64; PACKET_RAYS],
    /// The placement of the nearest hit, for rays that are not in [`RayPacket::here`].
    pub(super) foreign: [u32; PACKET_RAYS],
    /// The rays that are tested against a leaf.
    pub(super) active: ActiveRays,
}

impl RayData {
    /// The work that was done at leaves so far.
    pub fn stats(&self) -> TraversalStats {
        self.active.stats
    }
}

impl Default for RayData {
    fn default() -> Self {
        let none = [0.0; PACKET_RAYS];
        Self {
            g: [none; 2],
            offset: [none; 2],
            z_low: none,
            z_high: none,
            triangle: [0; PACKET_RAYS],
            t: [0.0; PACKET_RAYS],
            foreign: [0; PACKET_RAYS],
            active: ActiveRays::default(),
        }
    }
}

/// The rays of a packet that a leaf's box lets through, next to each other.
#[repr(align(64))]
pub(super) struct ActiveRays {
    /// g_u and g_v.
    pub g: [[f32; CAPACITY]; 2],
    /// As in [`RayData::offset`], if the origins differ.
    pub offset: [[f32; CAPACITY]; 2],
    /// Bounds of the depths of the nearest hits.
    pub z_low: [f32; CAPACITY],
    pub z_high: [f32; CAPACITY],
    /// The triangles of hits that are nearer than the rays' hits so far.
    pub triangle: [u32; CAPACITY],
    /// The triangles of the leaf that f32 leaves undecided for a ray, one bit each.
    pub undecided: [u32; CAPACITY],
    /// The bundles of the active rays, and which rays of each bundle are active, one bit each.
    pub bundles: [(u8, u16); BUNDLES],
    pub bundle_count: usize,
    pub stats: TraversalStats,
}

/// Active rays are written sixteen at a time, of which any number may count.
const CAPACITY: usize = PACKET_RAYS + 16;

impl Default for ActiveRays {
    fn default() -> Self {
        let none = [0.0; CAPACITY];
        Self {
            g: [none; 2],
            offset: [none; 2],
            z_low: none,
            z_high: none,
            triangle: [0; CAPACITY],
            undecided: [0; CAPACITY],
            bundles: [(0, 0); BUNDLES],
            bundle_count: 0,
            stats: TraversalStats::default(),
        }
    }
}

/// A packet of rays in the space of one mesh. `MULTI_ORIGIN` tells whether the rays' origins differ.
pub(in crate::trace) struct RayPacket<'a, const MULTI_ORIGIN: bool> {
    pub(super) bvh: &'a Bvh8,
    pub(super) placement: u32,
    pub(super) origins: Origins<'a>,
    pub(super) directions: &'a [DVec3],
    pub(super) t_min: f64,
    pub(super) t_max: f64,
    /// The axes among x, y, z that are u, v and w.
    pub(super) axes: [usize; 3],
    /// Whether w is reversed.
    pub(super) reversed: bool,
    /// The point o along u, v, w (reversed as w is), as the sum of two f32 numbers.
    pub(super) high: [f32; 3],
    pub(super) low: [f32; 3],
    /// The terms that make boxes relative to o, along u, v and w (w not reversed): the first is added to the negated lower
    /// planes, the second to the upper planes.
    pub(super) from: [[f32; 2]; 3],
    pub(super) rays: &'a mut RayData,
    /// The rays whose f64 depth is worked out, the rays with a hit, and the rays whose hit is in this mesh.
    pub(super) known: RaySet,
    pub(super) hit: RaySet,
    pub(super) here: RaySet,
    /// The rectangle of each bundle on the plane w = 1, moved outwards by [`RECTANGLE_MARGIN`]. Along u and v each has the
    /// negated upper sides of all bundles first, then the lower sides.
    pub(super) rectangle: [[f32; 2 * BUNDLES]; 2],
    /// The largest `z_high` of each bundle.
    pub(super) far: [f32; BUNDLES],
    /// The largest of `far`.
    pub(super) farthest: f32,
    /// Depths along w up to here may be below `t_min`.
    pub(super) near: f32,
    /// The bounds of |g_u| and |g_v|.
    pub(super) steep: [f32; 2],
    /// The bound G = 1 + max|g_u| + max|g_v|.
    pub(super) reach: f32,
    /// The bounds of |s_u| and |s_v|, or 0 if all rays start at one point.
    pub(super) offset: [f32; 2],
    /// The point o.
    pub(super) start: DVec3,
    /// Where the depths of hits in other meshes can be found, unless all of them are known.
    pub elsewhere: Option<Elsewhere<'a>>,
}

/// What tells the depths of a packet's hits in other meshes.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Elsewhere<'a> {
    pub surfaces: Surfaces<'a>,
    /// Rays in the scene's space.
    pub rays: &'a Batch<'a>,
    /// The number among these of each ray of the packet, if they are not the same rays.
    pub numbers: Option<&'a [u8]>,
}

impl Elsewhere<'_> {
    /// The f64 depth of a packet's ray in a triangle of a placement.
    pub fn depth(&self, ray: usize, placement: u32, triangle: TriangleRef) -> f64 {
        let number = self.numbers.map_or(ray, |numbers| usize::from(numbers[ray]));
        self.surfaces.depth(self.rays.ray(number), self.rays.time_s(number), placement, triangle)
    }
}

impl<'a, const MULTI_ORIGIN: bool> RayPacket<'a, MULTI_ORIGIN> {
    /// Prepares up to [`PACKET_RAYS`] rays for a mesh. Returns `None` if they are no narrow pyramid: if they are more than a
    /// right angle apart or nearly so, not finite, from places too far apart, or from so far away that f32 cannot resolve
    /// the mesh.
    #[inline(always)]
    pub fn new<S: F32x8>(
        bvh: &'a Bvh8,
        placement: u32,
        origins: Origins<'a>,
        directions: &'a [DVec3],
        (t_min, t_max): (f64, f64),
        nearest: &NearestHits,
        rays: &'a mut RayData,
    ) -> Option<Self> {
        debug_assert!(directions.len() <= PACKET_RAYS && MULTI_ORIGIN == matches!(origins, Origins::Each(_)));
        let last = directions.len() - 1;
        // The axis along which most of a few rays go. Whether all rays go along it is tested below.
        let sum = directions[0] + directions[last / 3] + directions[last - last / 3] + directions[last];
        let along = sum.abs();
        let w = if along.x >= along.y && along.x >= along.z {
            0
        } else if along.y >= along.z {
            1
        } else {
            2
        };
        let axes = [(w + 1) % 3, (w + 2) % 3, w];
        let reversed = sum[w] < 0.0;
        let side = if reversed { -1.0 } else { 1.0 };
        let origin = common_point::<S>(origins, w, side);
        let size = f64::from(bvh.largest).max(origin.abs().max_element());
        // The cubes of coordinates must stay within f32's range. (In this form NaN does not pass.)
        let is_in_range = size < 1e12;
        if !is_in_range {
            return None;
        }
        if nearest.hit != 0 {
            (rays.triangle, rays.t, rays.foreign) = (nearest.triangle, nearest.t, nearest.placement);
        }
        let mut packet = Self {
            bvh,
            placement,
            origins,
            directions,
            t_min,
            t_max,
            axes,
            reversed,
            high: [0.0; 3],
            low: [0.0; 3],
            from: [[0.0; 2]; 3],
            rays,
            known: !nearest.rough,
            hit: nearest.hit,
            here: 0,
            rectangle: [[0.0; 2 * BUNDLES]; 2],
            far: [-1.0; BUNDLES],
            farthest: -1.0,
            near: 0.0,
            steep: [0.0; 2],
            reach: 0.0,
            offset: [0.0; 2],
            start: origin,
            elsewhere: None,
        };
        let has_hits = nearest.hit != 0 || t_max.is_finite();
        let groups = directions.len().div_ceil(8);
        let zero = S::F64x8::splat(0.0);
        let (mut steepest, mut longest, mut latest) = ([zero; 2], zero, zero);
        // The bounds of s_u and s_v.
        let (mut least_s, mut most_s) =
            ([S::F64x8::splat(f64::INFINITY); 2], [S::F64x8::splat(f64::NEG_INFINITY); 2]);
        let sides = S::F64x8::splat(side);
        let mut buffer = [DVec3::ZERO; 8];
        for group in 0..groups {
            // The last group is filled up with copies of the last ray. Their far end of −1 lets them hit nothing.
            let [du, dv, dw] = in_order(S::F64x8::load_xyz(group_of(directions, group, &mut buffer)), w);
            let along = dw.mul(sides);
            let per_w = S::F64x8::splat(1.0).div(along);
            let (gu, gv) = (du.mul(per_w), dv.mul(per_w));
            let steep = [gu.abs(), gv.abs()];
            // In this form NaN, infinity and a wrong sign do not pass.
            let passes = S::F64x8::splat(1.0 / LENGTHS).le(along)
                & along.le(S::F64x8::splat(LENGTHS))
                & steep[0].le(S::F64x8::splat(STEEPEST))
                & steep[1].le(S::F64x8::splat(STEEPEST));
            if passes != 0xff {
                return None;
            }
            steepest = [steepest[0].max(steep[0]), steepest[1].max(steep[1])];
            longest = longest.max(along);
            let [all_u, all_v] = &mut packet.rays.g;
            gu.to_f32().store(chunk_mut(all_u, 8 * group));
            gv.to_f32().store(chunk_mut(all_v, 8 * group));
            let mut start = zero;
            if let (true, Origins::Each(all)) = (MULTI_ORIGIN, origins) {
                let points = S::F64x8::load_xyz(group_of(all, group, &mut buffer));
                let [ou, ov, ow] = in_order(points, w);
                start = ow.sub(S::F64x8::splat(origin[w])).mul(sides);
                latest = latest.max(start);
                let su = ou.sub(S::F64x8::splat(origin[axes[0]])).sub(gu.mul(start));
                let sv = ov.sub(S::F64x8::splat(origin[axes[1]])).sub(gv.mul(start));
                let [all_u, all_v] = &mut packet.rays.offset;
                su.to_f32().store(chunk_mut(all_u, 8 * group));
                sv.to_f32().store(chunk_mut(all_v, 8 * group));
                least_s = [least_s[0].min(su), least_s[1].min(sv)];
                most_s = [most_s[0].max(su), most_s[1].max(sv)];
            }
            if has_hits {
                let z = S::F64x8::load(chunk(&nearest.t, 8 * group)).mul(along).add(start).to_f32();
                let z_low = S::F64x8::load(chunk(&nearest.t_low, 8 * group)).mul(along).add(start).to_f32();
                bounds_of_eight(z_low).0.store(chunk_mut(&mut packet.rays.z_low, 8 * group));
                bounds_of_eight(z).1.store(chunk_mut(&mut packet.rays.z_high, 8 * group));
            }
        }
        let padded = groups * 8;
        if !has_hits {
            packet.rays.z_low[..padded].fill(f32::INFINITY);
            packet.rays.z_high[..padded].fill(f32::INFINITY);
        }
        if directions.len() < PACKET_RAYS {
            packet.rays.z_low[directions.len()..].fill(-1.0);
            packet.rays.z_high[directions.len()..].fill(-1.0);
        }
        let steepest = [most(steepest[0]), most(steepest[1])];
        packet.steep = steepest.map(|steep| steep as f32 * (1.0 + 2.0 * U));
        packet.reach = (1.0 + steepest[0] + steepest[1]) as f32 * (1.0 + 2.0 * U);
        let latest = most(latest);
        packet.near = bounds(t_min * most(longest) + latest).1;
        let mut grown = [[0.0_f32; 2]; 3];
        if MULTI_ORIGIN {
            let least_s = [least(least_s[0]), least(least_s[1])];
            let most_s = [most(most_s[0]), most(most_s[1])];
            let offset = [0, 1].map(|axis| least_s[axis].abs().max(most_s[axis].abs()));
            // In this form NaN does not pass.
            let farthest = f64::from(bvh.largest) * SPREAD;
            let is_near = offset[0] <= farthest && offset[1] <= farthest && latest <= farthest;
            if !is_near {
                return None;
            }
            packet.offset = offset.map(|offset| offset as f32 * (1.0 + 2.0 * U) + TINY);
            for axis in 0..2 {
                // Rounding s and adding it cost 2u of it.
                let margin = packet.offset[axis] * (4.0 * U);
                grown[axis] = [most_s[axis] as f32 + margin, least_s[axis] as f32 - margin];
            }
        }
        // The planes of boxes lose u of the origin three times: when it is rounded, when the slack is added here, and when it is
        // subtracted. (Boxes are padded for the u of their own size.)
        let slack = (origin.abs().max_element() as f32) * (8.0 * U) + TINY;
        for (k, &axis) in axes.iter().enumerate() {
            let high = origin[axis] as f32;
            let low = (origin[axis] - f64::from(high)) as f32;
            packet.from[k] = [high + (slack + grown[k][0]), -(high + (grown[k][1] - slack))];
            let turn = if k == 2 && reversed { -1.0 } else { 1.0 };
            (packet.high[k], packet.low[k]) = (high * turn, low * turn);
        }
        for (g, sides) in packet.rays.g.iter_mut().zip(&mut packet.rectangle) {
            // The groups past the last still hold rays of an earlier packet.
            let last: [f32; 8] = *chunk(g, 8 * (groups - 1));
            for group in groups..GROUPS {
                *chunk_mut(g, 8 * group) = last;
            }
            let (mut upper, mut lower) = ([S::splat(0.0); BUNDLES], [S::splat(0.0); BUNDLES]);
            for bundle in 0..BUNDLES {
                let (a, b) = (S::load(chunk(g, 16 * bundle)), S::load(chunk(g, 16 * bundle + 8)));
                (upper[bundle], lower[bundle]) = (a.max(b).neg(), a.min(b));
            }
            let (upper, lower) = (S::reduce_min_8(upper), S::reduce_min_8(lower));
            let margin = S::splat(-RECTANGLE_MARGIN);
            let upper = upper.add(upper.abs().mul_add(margin, margin));
            let lower = lower.add(lower.abs().mul_add(margin, margin));
            S::F32x16::from_halves(upper, lower).store(sides);
        }
        for bundle in 0..groups.div_ceil(2) {
            packet.far[bundle] = if has_hits { packet.farthest_of::<S>(bundle) } else { f32::INFINITY };
        }
        packet.farthest = S::load(&packet.far).reduce_max();
        Some(packet)
    }

    /// The origin of a ray.
    #[inline(always)]
    pub(super) fn origin(&self, ray: usize) -> DVec3 {
        self.origins.of(ray)
    }

    /// Takes over the depths of hits of some rays that were found in meshes since.
    #[inline(always)]
    pub fn update_depths<S: F32x8>(&mut self, nearest: &NearestHits, found: RaySet) {
        if found == 0 {
            return;
        }
        let whole_groups = self.directions.len() / 8;
        for group in 0..whole_groups {
            if found >> (8 * group) & 0xff != 0 {
                self.update_depths_of_group::<S>(nearest, group);
            }
        }
        for ray in rays_of(found & !(RaySet::MAX.checked_shr(128 - 8 * whole_groups as u32).unwrap_or(0))) {
            (self.rays.z_low[ray], self.rays.z_high[ray]) = self.along(ray, nearest.t[ray]);
        }
        self.update_far::<S>(found);
    }

    /// Takes over how far some rays reach.
    #[inline(always)]
    fn update_far<S: F32x8>(&mut self, which: RaySet) {
        for bundle in 0..BUNDLES {
            if which >> (16 * bundle) & 0xffff != 0 {
                self.far[bundle] = self.farthest_of::<S>(bundle);
            }
        }
        self.farthest = S::load(&self.far).reduce_max();
    }

    /// Ends the search of some rays.
    #[inline(always)]
    pub fn end<S: F32x8>(&mut self, which: RaySet) {
        for ray in rays_of(which) {
            // Boxes begin at 0 or behind it.
            (self.rays.z_low[ray], self.rays.z_high[ray]) = (-1.0, -1.0);
        }
        self.update_far::<S>(which);
    }

    /// Takes over the depths of eight rays' nearest hits.
    #[inline(always)]
    fn update_depths_of_group<S: F32x8>(&mut self, nearest: &NearestHits, group: usize) {
        let w = self.axes[2];
        let mut buffer = [DVec3::ZERO; 8];
        let along = S::F64x8::load_xyz(group_of(self.directions, group, &mut buffer))[w].abs();
        let z = S::F64x8::load(chunk(&nearest.t, 8 * group)).mul(along).add(self.starts::<S>(group));
        let (low, high) = bounds_of_eight(z.to_f32());
        low.store(chunk_mut(&mut self.rays.z_low, 8 * group));
        high.store(chunk_mut(&mut self.rays.z_high, 8 * group));
    }

    /// Writes the hits that were found in this mesh to `nearest`, with the bounds of their depths if `with_depths`. Returns the rays.
    #[inline(always)]
    pub fn write_hits<S: F32x8>(self, nearest: &mut NearestHits, with_depths: bool) -> RaySet {
        if self.here == RaySet::MAX {
            nearest.triangle = self.rays.triangle;
            nearest.placement = [self.placement; PACKET_RAYS];
        } else {
            for ray in rays_of(self.here) {
                nearest.triangle[ray] = self.rays.triangle[ray];
                nearest.placement[ray] = self.placement;
            }
        }
        if with_depths {
            self.write_depths::<S>(nearest);
        }
        nearest.hit |= self.here;
        self.here
    }

    /// Writes what is known of the depths of the hits in this mesh.
    #[inline(always)]
    fn write_depths<S: F32x8>(&self, nearest: &mut NearestHits) {
        let w = self.axes[2];
        let mut buffer = [DVec3::ZERO; 8];
        for group in 0..self.directions.len().div_ceil(8) {
            let here = (self.here >> (8 * group)) as u32 & 0xff;
            if here == 0 {
                continue;
            }
            // The difference of a bound and of where the ray starts, and the quotient, lose a few 2⁻⁵³ of both, for which 2⁻⁴⁸ are
            // given. The bounds hold the exact depth with room for millions of times the error of the f64 depth, so hits whose bounds
            // do not meet are in the order of their f64 depths, in whichever meshes they are.
            let along = S::F64x8::load_xyz(group_of(self.directions, group, &mut buffer))[w].abs();
            let start = self.starts::<S>(group);
            let loss = start.abs().mul(S::F64x8::splat(1.0 / (1_u64 << 48) as f64));
            let low = S::F64x8::from_f32(S::load(chunk(&self.rays.z_low, 8 * group)));
            let high = S::F64x8::from_f32(S::load(chunk(&self.rays.z_high, 8 * group)));
            let slack = 1.0 / (1_u64 << 48) as f64;
            let low = low.mul(S::F64x8::splat(1.0 - slack)).sub(start).sub(loss).div(along);
            let high = high.mul(S::F64x8::splat(1.0 + slack)).sub(start).add(loss).div(along);
            let (mut lows, mut highs) = ([0.0; 8], [0.0; 8]);
            low.store(&mut lows);
            high.store(&mut highs);
            for k in (0..8).filter(|k| here >> k & 1 != 0) {
                (nearest.t_low[8 * group + k], nearest.t[8 * group + k]) = (lows[k], highs[k]);
            }
        }
        let known = self.here & self.known;
        for ray in rays_of(known) {
            (nearest.t_low[ray], nearest.t[ray]) = (self.rays.t[ray], self.rays.t[ray]);
        }
        nearest.rough = nearest.rough & !self.here | self.here & !known;
    }

    /// Where the rays of a group start along w, counted from o.
    #[inline(always)]
    fn starts<S: F32x8>(&self, group: usize) -> S::F64x8 {
        let zero = S::F64x8::splat(0.0);
        let (true, Origins::Each(all)) = (MULTI_ORIGIN, self.origins) else { return zero };
        let mut buffer = [DVec3::ZERO; 8];
        let from = S::F64x8::load_xyz(group_of(all, group, &mut buffer))[self.axes[2]];
        let start = from.sub(S::F64x8::splat(self.start[self.axes[2]]));
        if self.reversed { zero.sub(start) } else { start }
    }

    /// The largest `z_high` of a bundle's rays.
    #[inline(always)]
    pub(super) fn farthest_of<S: F32x8>(&self, bundle: usize) -> f32 {
        let z_high = &self.rays.z_high;
        S::load(chunk(z_high, 16 * bundle)).max(S::load(chunk(z_high, 16 * bundle + 8))).reduce_max()
    }

    /// The f32 bounds of the depth along w, counted from o, of a depth along a ray.
    #[inline(always)]
    pub(super) fn along(&self, ray: usize, t: f64) -> (f32, f32) {
        let w = self.axes[2];
        let start = match (MULTI_ORIGIN, self.origins) {
            (true, Origins::Each(origins)) => {
                let from = origins[ray][w] - self.start[w];
                if self.reversed { -from } else { from }
            }
            _ => 0.0,
        };
        bounds(t * self.directions[ray][w].abs() + start)
    }
}

/// The point o of a packet: the origin that rays share, or a point near their origins such that none lies before it along w, and s is
/// small on both sides.
#[inline(always)]
fn common_point<S: F32x8>(origins: Origins, w: usize, side: f64) -> DVec3 {
    let all = match origins {
        Origins::Common(origin) => return origin,
        Origins::Each(all) => all,
    };
    let mut towards = [0.0; 3];
    towards[w] = side;
    let [tx, ty, tz] =
        [S::F64x8::splat(towards[0]), S::F64x8::splat(towards[1]), S::F64x8::splat(towards[2])];
    let mut first = S::F64x8::splat(f64::INFINITY);
    let mut buffer = [DVec3::ZERO; 8];
    for group in 0..all.len().div_ceil(8) {
        let [x, y, z] = S::F64x8::load_xyz(group_of(all, group, &mut buffer));
        first = first.min(x.mul(tx).add(y.mul(ty)).add(z.mul(tz)));
    }
    let mut origin = 0.5 * (all[0] + all[all.len() - 1]);
    origin[w] = side * least(first);
    origin
}

/// The f32 bounds of an f64 depth. Rounding the depth to f32 costs u of it, the margin and its sum another u, and the f64
/// arithmetic before next to nothing: 4u has room for twice that.
fn bounds(z: f64) -> (f32, f32) {
    let near = z as f32;
    let margin = near * (4.0 * U) + TINY;
    if near.is_finite() { (near - margin, near + margin) } else { (near, near) }
}

/// [`bounds`] of eight depths, given as they are rounded to f32.
#[inline(always)]
fn bounds_of_eight<S: F32x8>(z: S) -> (S, S) {
    let margin = z.mul_add(S::splat(4.0 * U), S::splat(TINY));
    let is_finite = S::splat(f32::MAX).ge(z);
    (S::select(is_finite, z.sub(margin), z), S::select(is_finite, z.add(margin), z))
}

/// Reorders (x, y, z) to (u, v, w).
#[inline(always)]
fn in_order<T>([x, y, z]: [T; 3], w: usize) -> [T; 3] {
    match w {
        0 => [y, z, x],
        1 => [z, x, y],
        _ => [x, y, z],
    }
}

/// The least of eight numbers.
#[inline(always)]
fn least<D: F64x8>(x: D) -> f64 {
    -most(D::splat(0.0).sub(x))
}

/// The largest of eight numbers.
#[inline(always)]
fn most<D: F64x8>(x: D) -> f64 {
    let mut all = [0.0; 8];
    x.store(&mut all);
    all.into_iter().fold(f64::NEG_INFINITY, f64::max)
}
