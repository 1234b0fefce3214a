//! A batch of rays in the scene's space, and the nearest hits that are known of up to a packet of rays.

use std::array::from_fn;
use std::ops::Range;

use glam::DVec3;

use super::bvh::TriangleRef;
use super::exact::{Limits, LocalRay, Real, Xyz};
use super::rays::{Hit, Origins};
use super::simd::{F32x8, F64x8};

/// The most rays of one packet. Callers that order their rays should make each run of so many rays neighbours in space.
pub const PACKET_RAYS: usize = 128;

/// A set of a packet's rays, one bit each.
pub(super) type RaySet = u128;

/// The rays of a set, in order.
#[inline(always)]
pub(super) fn rays_of(mut set: RaySet) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let ray = (set != 0).then_some(set.trailing_zeros() as usize);
        set &= set.wrapping_sub(1);
        ray
    })
}

/// Rays in the scene's space, or in that of a mesh.
#[derive(Clone, Copy)]
pub(super) struct Batch<'r> {
    pub origins: Origins<'r>,
    pub directions: &'r [DVec3],
    pub t_min: f64,
    pub t_max: f64,
    /// As in [`Rays::after`](super::rays::Rays::after).
    pub after: Option<&'r [Option<Hit>]>,
    /// As in [`Rays::times_s`](super::rays::Rays::times_s).
    pub times_s: Option<&'r [f64]>,
}

impl Batch<'_> {
    #[inline(always)]
    pub fn ray(&self, ray: usize) -> LocalRay {
        LocalRay { origin: self.origins.of(ray), direction: self.directions[ray] }
    }

    /// The time of one ray.
    #[inline(always)]
    pub fn time_s(&self, ray: usize) -> Option<f64> {
        self.times_s.map(|times_s| times_s[ray])
    }

    /// Whether all rays are cast at the same time.
    #[inline(always)]
    pub fn are_of_one_time(&self) -> bool {
        self.times_s.is_none_or(|times_s| times_s.iter().all(|time_s| time_s == &times_s[0]))
    }

    /// The limits on one ray's hits. `AFTER` tells whether [`Batch::after`] counts.
    #[inline(always)]
    pub fn limits<const AFTER: bool>(&self, ray: usize) -> Limits {
        Limits::new(
            self.t_min,
            self.t_max,
            if AFTER { self.after.and_then(|after| after[ray]) } else { None },
        )
    }

    /// The least depths of the rays of a group of eight. The last ray's fills up the group.
    #[inline(always)]
    pub fn t_min_of_group<S: F32x8, const AFTER: bool>(&self, group: usize) -> S::F64x8 {
        if !AFTER {
            return S::F64x8::splat(self.t_min);
        }
        let last = self.directions.len() - 1;
        S::F64x8::load(&from_fn(|k| self.limits::<AFTER>((8 * group + k).min(last)).t_min))
    }

    /// The origins and directions of a group of eight rays. The last ray fills up the group.
    #[inline(always)]
    pub fn group<S: F32x8>(&self, group: usize) -> (Xyz<S::F64x8>, Xyz<S::F64x8>) {
        let mut buffer = [DVec3::ZERO; 8];
        let [x, y, z] = S::F64x8::load_xyz(group_of(self.directions, group, &mut buffer));
        let direction = Xyz(x, y, z);
        let origin = match self.origins {
            Origins::Common(origin) => Xyz::constant(origin),
            Origins::Each(origins) => {
                let [x, y, z] = S::F64x8::load_xyz(group_of(origins, group, &mut buffer));
                Xyz(x, y, z)
            }
        };
        (origin, direction)
    }

    /// Some consecutive rays of the batch.
    #[inline(always)]
    pub fn part(&self, range: Range<usize>) -> Self {
        let origins = match self.origins {
            Origins::Common(origin) => Origins::Common(origin),
            Origins::Each(origins) => Origins::Each(&origins[range.clone()]),
        };
        let after = self.after.map(|after| &after[range.clone()]);
        let times_s = self.times_s.map(|times_s| &times_s[range.clone()]);
        Self { origins, directions: &self.directions[range], after, times_s, ..*self }
    }
}

/// The points of a group of eight. The last point fills up the group, which then lies in `buffer`.
#[inline(always)]
pub(super) fn group_of<'r>(points: &'r [DVec3], group: usize, buffer: &'r mut [DVec3; 8]) -> &'r [DVec3; 8] {
    let start = group * 8;
    if let Some(Ok(eight)) = points.get(start..start + 8).map(TryFrom::try_from) {
        return eight;
    }
    *buffer = from_fn(|k| points[(start + k).min(points.len() - 1)]);
    buffer
}

/// The nearest hit of a ray, before its attributes are worked out.
#[derive(Clone, Copy)]
pub(super) struct NearestHit {
    pub t: f64,
    pub placement: u32,
    pub triangle: TriangleRef,
}

/// The nearest hits of up to [`PACKET_RAYS`] rays, over all placements.
pub(super) struct NearestHits {
    /// The depth, or `t_max` for a ray without a hit. For a ray in `rough` it is the upper bound of the depth.
    pub t: [f64; PACKET_RAYS],
    /// The lower bound of the depth: the same number, but for the rays in `rough`.
    pub t_low: [f64; PACKET_RAYS],
    /// [`TriangleRef`]s, as numbers.
    pub triangle: [u32; PACKET_RAYS],
    pub placement: [u32; PACKET_RAYS],
    /// The rays that have a hit.
    pub hit: RaySet,
    /// The rays for whose hits only bounds of the depth are known. Most of them are never compared more closely.
    pub rough: RaySet,
}

impl NearestHits {
    /// No hits.
    pub fn new(t_max: f64) -> Self {
        Self {
            t: [t_max; PACKET_RAYS],
            t_low: [t_max; PACKET_RAYS],
            triangle: [0; PACKET_RAYS],
            placement: [0; PACKET_RAYS],
            hit: 0,
            rough: 0,
        }
    }

    /// Forgets all hits. (The depths keep their values, which count only for a ray with a hit.)
    #[inline(always)]
    pub fn clear(&mut self) {
        self.hit = 0;
    }

    #[inline(always)]
    pub fn get(&self, ray: usize) -> Option<NearestHit> {
        let hit = NearestHit {
            t: self.t[ray],
            placement: self.placement[ray],
            triangle: TriangleRef(self.triangle[ray]),
        };
        (self.hit >> ray & 1 != 0).then_some(hit)
    }

    /// The rays of a group of eight that have a hit, one bit each.
    #[inline(always)]
    pub fn hits_of_group(&self, group: usize) -> u32 {
        (self.hit >> (8 * group)) as u32 & 0xff
    }

    /// The triangles and placements that a group of eight rays hits.
    #[inline(always)]
    pub fn triangles_of_group(&self, group: usize) -> (&[u32; 8], &[u32; 8]) {
        (chunk(&self.triangle, 8 * group), chunk(&self.placement, 8 * group))
    }

    pub fn set(&mut self, ray: usize, hit: Option<NearestHit>) {
        if let Some(hit) = hit {
            (self.t[ray], self.placement[ray], self.triangle[ray]) = (hit.t, hit.placement, hit.triangle.0);
            self.t_low[ray] = hit.t;
            self.hit |= 1 << ray;
            self.rough &= !(1 << ray);
        }
    }
}

/// `N` consecutive elements of a table, from element `first` on.
#[inline(always)]
pub(super) fn chunk<T, const LENGTH: usize, const N: usize>(values: &[T; LENGTH], first: usize) -> &[T; N] {
    values[first..first + N].try_into().unwrap()
}

/// [`chunk`], to be written to.
#[inline(always)]
pub(super) fn chunk_mut<T, const LENGTH: usize, const N: usize>(
    values: &mut [T; LENGTH],
    first: usize,
) -> &mut [T; N] {
    (&mut values[first..first + N]).try_into().unwrap()
}
