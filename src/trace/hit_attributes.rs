//! The whole hits of rays whose nearest triangle is known: depth, weights, normal and ids, in f64 and eight rays side by side,
//! from the leaf that is still in the cache.

use std::array::from_fn;

use glam::{DAffine3, DVec3};

use super::bvh::{LeafBlock, TriangleRef};
use super::exact::{self, Corners, Facet, LocalRay, Xyz};
use super::packet::NearestHits;
use super::simd::{F32x8, F64x8, Mask8, U32x8};
use super::tracer::{Batch, Tracer};
use super::{Hit, Origins};

impl Tracer {
    /// The whole hits of a batch of at most a packet's rays.
    #[inline(always)]
    pub(super) fn write_hits<S: F32x8>(&self, rays: &Batch, nearest: &NearestHits, hits: &mut [Option<Hit>]) {
        let mut last = None;
        let mut room = [DVec3::ZERO; 8];
        for (group, hits) in hits.chunks_mut(8).enumerate() {
            let found = nearest.hits(group) & ((1 << hits.len()) - 1);
            if found != (1 << hits.len()) - 1 {
                hits.fill(None);
            }
            if found == 0 {
                continue;
            }
            let directions = eight(rays.directions, group, &mut room);
            if found == 0xff
                && self.write_hits_of_one_triangle::<S>(rays, directions, nearest, group, hits, &mut last)
            {
                continue;
            }
            self.write_hits_of_group::<S>(rays, nearest, (group, found), hits);
        }
    }

    /// The whole hits of a group of rays if all hit the same triangle of placement 0; false if they don't. `last` is the
    /// triangle of the previous ones.
    #[inline(always)]
    fn write_hits_of_one_triangle<S: F32x8>(
        &self,
        rays: &Batch,
        directions: &[DVec3; 8],
        nearest: &NearestHits,
        group: usize,
        hits: &mut [Option<Hit>],
        last: &mut Option<Seen>,
    ) -> bool {
        let Origins::Common(origin) = rays.origins else { return false };
        let (slots, placements) = nearest.places(group);
        let slot = TriangleRef(slots[0]);
        if *slots != [slot.0; 8] || *placements != [0; 8] {
            return false;
        }
        let Seen { facet, normal, triangle, .. } = match last {
            Some(seen) if seen.slot == slot => seen,
            _ => {
                let block = LeafBlock::at(&self.bvh(0).blocks, slot.block_offset());
                let facet = Facet::new(Corners::from_positions(block.positions(slot.lane()), origin).xyz());
                let Xyz(x, y, z) = facet.normal.normalized();
                last.insert(Seen {
                    slot,
                    facet,
                    normal: DVec3::new(x, y, z),
                    triangle: block.id(slot.lane()),
                })
            }
        };
        let (normal, triangle) = (*normal, *triangle);
        let facet = Facet::<S::F64x8>::splat(facet);
        let [x, y, z] = S::F64x8::load_xyz(directions);
        let d = Xyz(x, y, z);
        let (t, within) = facet.plane_depth(d);
        if within != 0xff {
            return false;
        }
        let (u, v) = facet.weights(d);
        let (t, u, v) = (store(t), store(u), store(v));
        for (k, hit) in hits.iter_mut().enumerate() {
            *hit = Some(Hit { t: t[k], u: u[k], v: v[k], normal, placement: 0, triangle });
        }
        true
    }

    /// The whole hits of the rays of a group that have one, a bit each in `found`, placement by placement.
    #[inline(always)]
    fn write_hits_of_group<S: F32x8>(
        &self,
        rays: &Batch,
        nearest: &NearestHits,
        (group, found): (usize, u32),
        hits: &mut [Option<Hit>],
    ) {
        let (slots, placements) = nearest.places(group);
        let (scene_o, scene_d) = rays.eight::<S>(group);
        let mut rest = found;
        while rest != 0 {
            let first = rest.trailing_zeros() as usize & 7;
            let placement = placements[first];
            let lanes = rest & (0..8).fold(0, |set, k| set | u32::from(placements[k] == placement) << k);
            rest &= !lanes;
            // In the lanes of others, the same is worked out as in the first, and dropped.
            let slot = S::select(
                S::Mask8::from_bits(lanes),
                S::U32x8::load(slots).bitcast(),
                S::U32x8::splat(slots[first]).bitcast(),
            );
            let place = &self.scene.arrangement.placements[placement as usize];
            let (mut d, mut o) = (scene_d, scene_o);
            if placement != 0 && *place.mesh_from_scene() != DAffine3::IDENTITY {
                d = exact::carried_direction(place.mesh_from_scene(), d);
                o = exact::carried_point(place.mesh_from_scene(), o);
            }
            let bvh = self.bvh(placement);
            let (corners, ids) = if *slots == [slots[first]; 8] {
                let slot = TriangleRef(slots[first]);
                let block = LeafBlock::at(&bvh.blocks, slot.block_offset());
                let [a, b, c] = block.positions(slot.lane());
                ([splat(a), splat(b), splat(c)], S::U32x8::splat(block.id(slot.lane())))
            } else {
                LeafBlock::corners::<S>(&bvh.blocks, S::U32x8::bitcast_from(slot))
            };
            let [a, b, c] = [in_f64(corners[0]), in_f64(corners[1]), in_f64(corners[2])];
            let facet = Facet::new([a.sub(o), b.sub(o), c.sub(o)]);
            let (t, within) = facet.plane_depth(d);
            let (u, v) = facet.weights(d);
            let normal = exact::out_of(place, facet.normal).normalized();
            let (mut t, u, v) = (store(t), store(u), store(v));
            let (x, y, z) = (store(normal.0), store(normal.1), store(normal.2));
            let mut triangles = [0; 8];
            ids.store(&mut triangles);
            if lanes & !within != 0 {
                for k in (0..8).filter(|k| (lanes & !within) >> k & 1 != 0) {
                    let slot = TriangleRef(slots[k]);
                    let positions = LeafBlock::at(&bvh.blocks, slot.block_offset()).positions(slot.lane());
                    let ray = rays.ray(group * 8 + k);
                    let LocalRay { origin, direction } = ray.carried(place);
                    t[k] = Corners::from_positions(positions, origin).depth(direction);
                }
            }
            for (k, hit) in hits.iter_mut().enumerate() {
                if lanes >> k & 1 != 0 {
                    let normal = DVec3::new(x[k], y[k], z[k]);
                    *hit = Some(Hit { t: t[k], u: u[k], v: v[k], normal, placement, triangle: triangles[k] });
                }
            }
        }
    }
}

/// A triangle of placement 0, as the last rays that hit it needed it.
struct Seen {
    slot: TriangleRef,
    facet: Facet<f64>,
    normal: DVec3,
    triangle: u32,
}

/// The points of a group, filled up with the last one; `room` is for them.
#[inline(always)]
pub(super) fn eight<'r>(points: &'r [DVec3], group: usize, room: &'r mut [DVec3; 8]) -> &'r [DVec3; 8] {
    let start = group * 8;
    if let Some(Ok(eight)) = points.get(start..start + 8).map(TryFrom::try_from) {
        return eight;
    }
    *room = from_fn(|k| points[(start + k).min(points.len() - 1)]);
    room
}

/// One corner for all.
#[inline(always)]
fn splat<S: F32x8>([x, y, z]: [f32; 3]) -> [S; 3] {
    [S::splat(x), S::splat(y), S::splat(z)]
}

/// A corner of eight triangles.
#[inline(always)]
pub(super) fn in_f64<S: F32x8>([x, y, z]: [S; 3]) -> Xyz<S::F64x8> {
    Xyz(S::F64x8::from_f32(x), S::F64x8::from_f32(y), S::F64x8::from_f32(z))
}

#[inline(always)]
fn store<D: F64x8>(x: D) -> [f64; 8] {
    let mut to = [0.0; 8];
    x.store(&mut to);
    to
}
