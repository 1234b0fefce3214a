//! Packets: up to 128 rays from one point, or nearly, walked through the hierarchy together.
//!
//! # The pyramid
//! All rays of a packet leave from o, so they are a pyramid. With w the axis along which they mostly go (turned over if they
//! go down it), a ray is g = (g_u, g_v, 1) = d / d_w: a point on a plane, and the packet a rectangle there. A box (relative to
//! o) is met by a ray of the rectangle only if, for some w in the box and in front of the origin, w·[u₀, u₁] meets the box's
//! u and w·[v₀, v₁] its v. Sides that bound from below are kept turned over, so that both are one operation: b₀ ≤ max(r₁·w)
//! and b₁ ≥ min(r₀·w) are one comparison of (−b₀, b₁) with min((−r₁, r₀)·w).
//!
//! # Origins that differ a little
//! A turning sensor on a moving body fires each column from a place of its own. The rays of a packet still start near one
//! point o, chosen such that none starts before it along w; the line of a ray crosses the plane through o (w = 0) at
//! s = (s_u, s_v, 0), and is s + w·g. Boxes grow by the bounds of s, once a packet. What triangles need more is in [`leaf`].
//!
//! How the hierarchy is walked is in [`traverse`], what happens at a leaf in [`leaf`].

mod leaf;
mod traverse;

use glam::DVec3;

use super::Origins;
use super::bvh::{Bvh8, TriangleRef};
use super::exact::Real;
use super::hit_attributes::eight as eight_points;
use super::simd::{F32x8, F32x16, F64x8};
use super::stats::TraversalStats;
use super::tracer::NearestHit;
use leaf::ActiveRays;
pub(super) use traverse::Stack;

/// Rays of a packet at most.
pub(super) const PACKET_RAYS: usize = 128;
/// Rays are computed with in groups of eight.
const GROUPS: usize = PACKET_RAYS / 8;
/// The hierarchy is walked with bundles of two groups: eight bundles against a box at a time.
const BUNDLES: usize = GROUPS / 2;
/// A bit a ray.
type Set = u128;

/// Unit roundoff of f32.
pub(super) const U: f32 = f32::EPSILON / 2.0;
/// What underflow may cost.
pub(super) const TINY: f32 = 1e-36;

/// The steepest ray of a packet: |g_u| and |g_v| stay below.
const STEEPEST: f64 = 8.0;

/// How far from their common point a packet's rays may start, for 1 as the mesh's largest coordinate. (Farther apart, they
/// would have too little in common.)
const SPREAD: f64 = 1.0 / 256.0;

/// The nearest hits of a packet's rays so far, over all placements.
pub(super) struct NearestHits {
    /// Depth; `t_max` where there is no hit.
    t: [f64; PACKET_RAYS],
    slot: [u32; PACKET_RAYS],
    placement: [u32; PACKET_RAYS],
    /// Bit a ray: there is a hit.
    hit: Set,
}

impl NearestHits {
    pub fn new(t_max: f64) -> Self {
        Self { t: [t_max; PACKET_RAYS], slot: [0; PACKET_RAYS], placement: [0; PACKET_RAYS], hit: 0 }
    }

    /// No hits.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.hit = 0;
    }

    #[inline(always)]
    pub fn get(&self, ray: usize) -> Option<NearestHit> {
        let best =
            NearestHit { t: self.t[ray], placement: self.placement[ray], slot: TriangleRef(self.slot[ray]) };
        (self.hit >> ray & 1 != 0).then_some(best)
    }

    /// Which rays of a group of eight have a hit, a bit each.
    #[inline(always)]
    pub fn hits(&self, group: usize) -> u32 {
        (self.hit >> (8 * group)) as u32 & 0xff
    }

    /// The slots and placements of a group's hits.
    #[inline(always)]
    pub fn places(&self, group: usize) -> (&[u32; 8], &[u32; 8]) {
        (at(&self.slot, 8 * group), at(&self.placement, 8 * group))
    }

    pub fn set(&mut self, ray: usize, best: Option<NearestHit>) {
        if let Some(best) = best {
            (self.t[ray], self.placement[ray], self.slot[ray]) = (best.t, best.placement, best.slot.0);
            self.hit |= 1 << ray;
        }
    }
}

/// Whether rays from these origins may be a packet: those that come from all over are told by a glance at two of them.
#[inline(always)]
pub(super) fn may_be_packet(bvh: &Bvh8, origins: Origins) -> bool {
    match origins {
        Origins::Common(_) => true,
        Origins::Each(all) => {
            let (first, last) = (all[0], all[all.len() - 1]);
            (last - first).abs().max_element() <= f64::from(bvh.largest) * (2.0 * SPREAD)
        }
    }
}

/// What a packet knows of each of its rays: room that is used again from packet to packet. (Sixteen are read at a time, from whole
/// cache lines.)
#[repr(align(64))]
pub(super) struct PerRay {
    /// g_u and g_v.
    g: [[f32; PACKET_RAYS]; 2],
    /// 2·m, m = g × s: (−2s_v, 2s_u, 2(g_u·s_v − g_v·s_u)), if origins differ.
    moment: [[f32; PACKET_RAYS]; 3],
    /// Bounds of the depth along w of the nearest hit; −1 for lanes without a ray.
    z_low: [f32; PACKET_RAYS],
    z_high: [f32; PACKET_RAYS],
    /// Where the nearest hit lies, for rays whose nearest hit is `here`.
    slot: [u32; PACKET_RAYS],
    /// Its depth, where `known`.
    t: [f64; PACKET_RAYS],
    /// In which placement it lies, for rays whose nearest hit is not `here`.
    foreign: [u32; PACKET_RAYS],
    /// Those that a leaf is tested against.
    active: ActiveRays,
}

impl PerRay {
    /// What leaves took so far.
    pub fn stats(&self) -> TraversalStats {
        self.active.stats
    }
}

impl Default for PerRay {
    fn default() -> Self {
        let none = [0.0; PACKET_RAYS];
        Self {
            g: [none; 2],
            moment: [none; 3],
            z_low: none,
            z_high: none,
            slot: [0; PACKET_RAYS],
            t: [0.0; PACKET_RAYS],
            foreign: [0; PACKET_RAYS],
            active: ActiveRays::default(),
        }
    }
}

/// A packet in the space of one mesh. `MULTI_ORIGIN` says whether its rays' origins differ.
pub(super) struct RayPacket<'a, const MULTI_ORIGIN: bool> {
    bvh: &'a Bvh8,
    placement: u32,
    origins: Origins<'a>,
    directions: &'a [DVec3],
    t_min: f64,
    t_max: f64,
    /// Which of x, y, z are u, v and w.
    axes: [usize; 3],
    /// Whether w is turned over.
    turned: bool,
    /// o along u, v, w (turned over as w is), in two parts.
    high: [f32; 3],
    low: [f32; 3],
    /// What is added to the lower planes of boxes, turned over, and to the upper ones, along u, v and w (w itself not turned
    /// over), for the box to be relative to o.
    from: [[f32; 2]; 3],
    rays: &'a mut PerRay,
    /// Rays whose hit's depth is worked out, rays with a hit, and those whose hit is in this mesh: a bit each.
    known: Set,
    hit: Set,
    here: Set,
    /// Of each bundle of rays its rectangle on the plane w = 1, with some room: along u and v the upper sides turned over,
    /// then the lower ones.
    rectangle: [[f32; 2 * BUNDLES]; 2],
    /// The largest `z_high` of each bundle.
    far: [f32; BUNDLES],
    /// The largest of `far`.
    farthest: f32,
    /// Depths along w that may be too near for the sensor end here.
    near: f32,
    /// G.
    reach: f32,
    /// The largest |s_u| or |s_v|; 0 if the origins are one.
    offset: f32,
    /// o along w (not turned over).
    start: f64,
}

impl<'a, const MULTI_ORIGIN: bool> RayPacket<'a, MULTI_ORIGIN> {
    /// Prepares up to [`PACKET_RAYS`] rays for a mesh. `None` if they are no narrow pyramid: more than a right angle apart or nearly
    /// so, not finite, from places too far apart, or from so far away that f32 can't tell.
    #[inline(always)]
    pub fn new<S: F32x8>(
        bvh: &'a Bvh8,
        placement: u32,
        origins: Origins<'a>,
        directions: &'a [DVec3],
        (t_min, t_max): (f64, f64),
        nearest: &NearestHits,
        rays: &'a mut PerRay,
    ) -> Option<Self> {
        debug_assert!(directions.len() <= PACKET_RAYS && MULTI_ORIGIN == matches!(origins, Origins::Each(_)));
        let last = directions.len() - 1;
        // The axis along which most of a few go; whether all do shows below.
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
        let turned = sum[w] < 0.0;
        let side = if turned { -1.0 } else { 1.0 };
        let mut origin = first_origin(origins);
        if let (true, Origins::Each(all)) = (MULTI_ORIGIN, origins) {
            // None starts before it along w.
            origin[w] = side * all.iter().map(|o| o[w] * side).fold(f64::INFINITY, f64::min);
        }
        let size = f64::from(bvh.largest).max(origin.abs().max_element());
        // Sizes whose cubes leave f32's range are not worth a packet.
        let is_in_range = size < 1e12;
        if !is_in_range {
            return None;
        }
        if nearest.hit != 0 {
            (rays.slot, rays.t, rays.foreign) = (nearest.slot, nearest.t, nearest.placement);
        }
        let mut packet = Self {
            bvh,
            placement,
            origins,
            directions,
            t_min,
            t_max,
            axes,
            turned,
            high: [0.0; 3],
            low: [0.0; 3],
            from: [[0.0; 2]; 3],
            rays,
            known: Set::MAX,
            hit: nearest.hit,
            here: 0,
            rectangle: [[0.0; 2 * BUNDLES]; 2],
            far: [-1.0; BUNDLES],
            farthest: -1.0,
            near: 0.0,
            reach: 0.0,
            offset: 0.0,
            start: origin[w],
        };
        let has_hits = nearest.hit != 0 || t_max.is_finite();
        let groups = directions.len().div_ceil(8);
        let zero = S::F64x8::splat(0.0);
        let (mut steepest, mut longest, mut latest) = (zero, zero, zero);
        // The bounds of s_u and s_v.
        let (mut least_s, mut most_s) =
            ([S::F64x8::splat(f64::INFINITY); 2], [S::F64x8::splat(f64::NEG_INFINITY); 2]);
        let sides = S::F64x8::splat(side);
        let mut room = [DVec3::ZERO; 8];
        for group in 0..groups {
            // Past the last ray, copies of it, which with a far end of −1 see nothing.
            let [du, dv, dw] = in_order(S::F64x8::load_xyz(eight_points(directions, group, &mut room)), w);
            let along = dw.mul(sides);
            let per_w = S::F64x8::splat(1.0).div(along);
            let (gu, gv) = (du.mul(per_w), dv.mul(per_w));
            let steep = gu.abs().max(gv.abs());
            // In this form NaN, infinity and a wrong sign don't pass.
            let passes = S::F64x8::splat(f64::MIN_POSITIVE).le(along)
                & along.le(S::F64x8::splat(f64::MAX))
                & gu.abs().le(S::F64x8::splat(STEEPEST))
                & gv.abs().le(S::F64x8::splat(STEEPEST));
            if passes != 0xff {
                return None;
            }
            steepest = steepest.max(steep);
            longest = longest.max(along);
            let [all_u, all_v] = &mut packet.rays.g;
            gu.to_f32().store(at_mut(all_u, 8 * group));
            gv.to_f32().store(at_mut(all_v, 8 * group));
            let mut start = zero;
            if let (true, Origins::Each(all)) = (MULTI_ORIGIN, origins) {
                let points = S::F64x8::load_xyz(eight_points(all, group, &mut room));
                let [ou, ov, ow] = in_order(points, w);
                start = ow.sub(S::F64x8::splat(origin[w])).mul(sides);
                latest = latest.max(start);
                let su = ou.sub(S::F64x8::splat(origin[axes[0]])).sub(gu.mul(start));
                let sv = ov.sub(S::F64x8::splat(origin[axes[1]])).sub(gv.mul(start));
                let two = S::F64x8::splat(2.0);
                let [m_u, m_v, m_w] = &mut packet.rays.moment;
                sv.mul(S::F64x8::splat(-2.0)).to_f32().store(at_mut(m_u, 8 * group));
                su.mul(two).to_f32().store(at_mut(m_v, 8 * group));
                gu.mul(sv).sub(gv.mul(su)).mul(two).to_f32().store(at_mut(m_w, 8 * group));
                least_s = [least_s[0].min(su), least_s[1].min(sv)];
                most_s = [most_s[0].max(su), most_s[1].max(sv)];
            }
            if has_hits {
                let z = S::F64x8::load(at(&nearest.t, 8 * group)).mul(along).add(start).to_f32();
                let room = z.mul_add(S::splat(4.0 * U), S::splat(TINY));
                let is_finite = S::splat(f32::MAX).ge(z);
                S::select(is_finite, z.sub(room), z).store(at_mut(&mut packet.rays.z_low, 8 * group));
                S::select(is_finite, z.add(room), z).store(at_mut(&mut packet.rays.z_high, 8 * group));
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
        packet.reach = (1.0 + 2.0 * most(steepest)) as f32 * (1.0 + 2.0 * U);
        let latest = most(latest);
        packet.near = bounds(t_min * most(longest) + latest).1;
        let mut grown = [[0.0_f32; 2]; 3];
        if MULTI_ORIGIN {
            let least_s = [least(least_s[0]), least(least_s[1])];
            let most_s = [most(most_s[0]), most(most_s[1])];
            let offset = least_s.into_iter().chain(most_s).fold(0.0, |a: f64, b| a.max(b.abs()));
            // (In this form NaN doesn't pass.)
            let is_near = offset.max(latest) <= f64::from(bvh.largest) * SPREAD;
            if !is_near {
                return None;
            }
            packet.offset = offset as f32 * (1.0 + 2.0 * U) + TINY;
            let room = packet.offset * (4.0 * U);
            for axis in 0..2 {
                grown[axis] = [most_s[axis] as f32 + room, least_s[axis] as f32 - room];
            }
        }
        // The planes of boxes lose 2⁻²⁴ of the origin a few times: in its rounding, here, and in the subtraction. (What they
        // lose of their own size is in their padding.)
        let slack = (origin.abs().max_element() as f32) * (8.0 * U) + TINY;
        for (k, &axis) in axes.iter().enumerate() {
            let high = origin[axis] as f32;
            let low = (origin[axis] - f64::from(high)) as f32;
            packet.from[k] = [high + (slack + grown[k][0]), -(high + (grown[k][1] - slack))];
            let turn = if k == 2 && turned { -1.0 } else { 1.0 };
            (packet.high[k], packet.low[k]) = (high * turn, low * turn);
        }
        for (g, sides) in packet.rays.g.iter_mut().zip(&mut packet.rectangle) {
            // Rays of an earlier packet are not this one's.
            let last: [f32; 8] = *at(g, 8 * (groups - 1));
            for group in groups..GROUPS {
                *at_mut(g, 8 * group) = last;
            }
            let (mut turned, mut upright) = ([S::splat(0.0); BUNDLES], [S::splat(0.0); BUNDLES]);
            for bundle in 0..BUNDLES {
                let (a, b) = (S::load(at(g, 16 * bundle)), S::load(at(g, 16 * bundle + 8)));
                (turned[bundle], upright[bundle]) = (a.max(b).neg(), a.min(b));
            }
            let (turned, upright) = (S::reduce_min_8(turned), S::reduce_min_8(upright));
            // Room for the rounding of g and of products with it.
            let (wider, part) = (S::splat(-4e-7), S::splat(-4e-7));
            let turned = turned.add(turned.abs().mul_add(part, wider));
            let upright = upright.add(upright.abs().mul_add(part, wider));
            S::F32x16::from_halves(turned, upright).store(sides);
        }
        for bundle in 0..groups.div_ceil(2) {
            packet.far[bundle] = if has_hits { packet.farthest_of::<S>(bundle) } else { f32::INFINITY };
        }
        packet.farthest = S::load(&packet.far).reduce_max();
        Some(packet)
    }

    /// Where a ray starts.
    #[inline(always)]
    fn origin(&self, ray: usize) -> DVec3 {
        match self.origins {
            Origins::Common(origin) => origin,
            Origins::Each(origins) => origins[ray],
        }
    }

    /// Takes over hits that were found elsewhere since.
    pub fn update(&mut self, nearest: &NearestHits) {
        for ray in 0..self.directions.len() {
            (self.rays.z_low[ray], self.rays.z_high[ray]) = self.along(ray, nearest.t[ray]);
        }
        for (far, rays) in self.far.iter_mut().zip(self.rays.z_high.chunks_exact(16)) {
            *far = rays.iter().copied().fold(-1.0, f32::max);
        }
        self.farthest = self.far.into_iter().fold(-1.0, f32::max);
    }

    /// Hands the hits found here to `nearest`, with their f64 depths if `with_depths`.
    #[inline(always)]
    pub fn leave(mut self, nearest: &mut NearestHits, with_depths: bool) {
        if self.here == Set::MAX && !with_depths {
            nearest.slot = self.rays.slot;
            nearest.placement = [self.placement; PACKET_RAYS];
        } else {
            let mut rest = self.here;
            while rest != 0 {
                let ray = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                if with_depths {
                    nearest.t[ray] = self.depth_of_best(ray);
                }
                nearest.slot[ray] = self.rays.slot[ray];
                nearest.placement[ray] = self.placement;
            }
        }
        nearest.hit |= self.here;
    }

    /// The largest `z_high` of a bundle's rays.
    #[inline(always)]
    fn farthest_of<S: F32x8>(&self, bundle: usize) -> f32 {
        let z_high = &self.rays.z_high;
        S::load(at(z_high, 16 * bundle)).max(S::load(at(z_high, 16 * bundle + 8))).reduce_max()
    }

    /// Bounds of the depth along w, from o, of a depth along a ray.
    #[inline(always)]
    fn along(&self, ray: usize, t: f64) -> (f32, f32) {
        let w = self.axes[2];
        let start = match (MULTI_ORIGIN, self.origins) {
            (true, Origins::Each(origins)) => {
                let from = origins[ray][w] - self.start;
                if self.turned { -from } else { from }
            }
            _ => 0.0,
        };
        bounds(t * self.directions[ray][w].abs() + start)
    }
}

fn first_origin(origins: Origins) -> DVec3 {
    match origins {
        Origins::Common(origin) => origin,
        Origins::Each(origins) => origins[0],
    }
}

/// f32 bounds of an f64 depth, with a few ulps of room.
fn bounds(z: f64) -> (f32, f32) {
    let near = z as f32;
    let room = near * (4.0 * U) + TINY;
    if near.is_finite() { (near - room, near + room) } else { (near, near) }
}

/// u, v and w of x, y and z.
#[inline(always)]
fn in_order<T>([x, y, z]: [T; 3], w: usize) -> [T; 3] {
    match w {
        0 => [y, z, x],
        1 => [z, x, y],
        _ => [x, y, z],
    }
}

#[inline(always)]
fn least<D: F64x8>(x: D) -> f64 {
    -most(D::splat(0.0).sub(x))
}

#[inline(always)]
fn most<D: F64x8>(x: D) -> f64 {
    let mut all = [0.0; 8];
    x.store(&mut all);
    all.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// The indices of the bits that are set, lowest first.
#[inline(always)]
fn bits(mut set: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (set != 0).then_some(set.trailing_zeros() as usize);
        set &= set.wrapping_sub(1);
        bit
    })
}

/// So many of a table's elements from `first` on.
#[inline(always)]
fn at<T, const LENGTH: usize, const N: usize>(values: &[T; LENGTH], first: usize) -> &[T; N] {
    values[first..first + N].try_into().unwrap()
}

#[inline(always)]
fn at_mut<T, const LENGTH: usize, const N: usize>(values: &mut [T; LENGTH], first: usize) -> &mut [T; N] {
    (&mut values[first..first + N]).try_into().unwrap()
}
