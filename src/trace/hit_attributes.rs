//! The attributes of hits whose triangles are known: depth, barycentric weights, normal and ids. They are computed in f64 for
//! eight rays at a time, from leaf blocks that are still in the cache.

use glam::{DAffine3, DVec3};

use super::batch::{Batch, NearestHit, NearestHits, group_of};
use super::bvh::{Bvh8, LeafBlock, TriangleRef};
use super::exact::{self, Candidate, Corners, Facet, LocalRay, Xyz};
use super::maps::Maps;
use super::rays::{Hit, Origins};
use super::simd::{F32x8, F64x8, Mask8, U32x8};
use crate::scene::Placement;

/// The triangles of a scene: its placements, and the hierarchies of its meshes and, after them, of the shapes of meshes that bend.
#[derive(Clone, Copy)]
pub(super) struct Surfaces<'a> {
    pub placements: &'a [Placement],
    pub meshes: &'a [Bvh8],
    pub shapes: &'a [Bvh8],
}

impl<'a> Surfaces<'a> {
    /// The hierarchy of a placement's mesh.
    #[inline(always)]
    pub fn bvh(&self, placement: u32) -> &'a Bvh8 {
        self.bvh_of_mesh(self.placements[placement as usize].mesh)
    }

    /// The hierarchy of a mesh by its number in the scene.
    #[inline(always)]
    pub fn bvh_of_mesh(&self, mesh: u32) -> &'a Bvh8 {
        let mesh = mesh as usize;
        match self.meshes.get(mesh) {
            Some(bvh) => bvh,
            None => &self.shapes[mesh - self.meshes.len()],
        }
    }

    /// The part of a hit that decides its place in the order of hits.
    pub fn candidate(&self, hit: &NearestHit) -> Candidate {
        let block = LeafBlock::at(&self.bvh(hit.placement).blocks, hit.triangle.block_offset());
        Candidate { t: hit.t, placement: hit.placement, triangle: block.id(hit.triangle.lane()) }
    }

    /// The depth of a ray, which is given in the scene's space, in a triangle of a placement that it hits.
    #[inline(never)]
    pub fn depth(&self, ray: LocalRay, time_s: Option<f64>, placement: u32, triangle: TriangleRef) -> f64 {
        let local = ray.carried(&self.placements[placement as usize], time_s).unwrap_or(ray);
        let block = LeafBlock::at(&self.bvh(placement).blocks, triangle.block_offset());
        Corners::from_positions(block.positions(triangle.lane()), local.origin).depth(local.direction)
    }

    /// The hit of one ray, which is given in the scene's space, and the map by which it is carried to what it hits.
    pub fn hit(&self, ray: LocalRay, map: &DAffine3, hit: &NearestHit) -> Hit {
        let local = ray.carried_by(map);
        let block = LeafBlock::at(&self.bvh(hit.placement).blocks, hit.triangle.block_offset());
        let corners = Corners::from_positions(block.positions(hit.triangle.lane()), local.origin);
        self.candidate(hit).finish(&corners, local.direction, map)
    }

    /// Writes the hits of a batch of at most [`PACKET_RAYS`](super::batch::PACKET_RAYS) rays.
    #[inline(always)]
    pub fn write_hits<S: F32x8>(
        &self,
        rays: &Batch,
        nearest: &NearestHits,
        hits: &mut [Option<Hit>],
        maps: &mut Maps,
    ) {
        let (mut last, mut rows) = (None, [None, None]);
        let mut buffer = [DVec3::ZERO; 8];
        for (group, hits) in hits.chunks_mut(8).enumerate() {
            let found = nearest.hits_of_group(group) & ((1 << hits.len()) - 1);
            if found != (1 << hits.len()) - 1 {
                hits.fill(None);
            }
            if found == 0 {
                continue;
            }
            let directions = group_of(rays.directions, group, &mut buffer);
            if found == 0xff
                && (self.write_hits_of_one_triangle::<S>(rays, directions, nearest, group, hits, &mut last)
                    || self.write_hits_of_eight::<S>(
                        rays,
                        directions,
                        nearest,
                        group,
                        hits,
                        &mut rows[group % 2],
                    ))
            {
                continue;
            }
            self.write_hits_of_group::<S>(rays, nearest, (group, found), hits, maps);
        }
    }

    /// Writes the hits of a group of eight rays if all of them start at one point and hit the same triangle of placement 0;
    /// otherwise returns false. `last` is the triangle that the previous such group hit.
    #[inline(always)]
    fn write_hits_of_one_triangle<S: F32x8>(
        &self,
        rays: &Batch,
        directions: &[DVec3; 8],
        nearest: &NearestHits,
        group: usize,
        hits: &mut [Option<Hit>],
        last: &mut Option<SharedFacet>,
    ) -> bool {
        let Origins::Common(origin) = rays.origins else { return false };
        let (triangles, placements) = nearest.triangles_of_group(group);
        let shared = TriangleRef(triangles[0]);
        if *triangles != [shared.0; 8] || *placements != [0; 8] {
            return false;
        }
        let SharedFacet { facet, normal, id, .. } = match last {
            Some(last) if last.triangle == shared => last,
            _ => {
                let block = LeafBlock::at(&self.bvh(0).blocks, shared.block_offset());
                let facet = Facet::new(Corners::from_positions(block.positions(shared.lane()), origin).xyz());
                let Xyz(x, y, z) = facet.normal.normalized();
                last.insert(SharedFacet {
                    triangle: shared,
                    facet,
                    normal: DVec3::new(x, y, z),
                    id: block.id(shared.lane()),
                })
            }
        };
        let (normal, id) = (*normal, *id);
        write_hits_on::<S>(&Facet::splat(facet), directions, |_| (normal, id), hits)
    }

    /// Writes the hits of a group of eight rays if all of them hit placement 0; otherwise returns false. `last` are the triangles that
    /// such a group hit before. Rows of an image that are one above the other start at the same points if the sensor turns, and
    /// mostly hit the same triangles.
    #[inline(always)]
    fn write_hits_of_eight<S: F32x8>(
        &self,
        rays: &Batch,
        directions: &[DVec3; 8],
        nearest: &NearestHits,
        group: usize,
        hits: &mut [Option<Hit>],
        last: &mut Option<EightFacets<S::F64x8>>,
    ) -> bool {
        let (triangles, placements) = nearest.triangles_of_group(group);
        if *placements != [0; 8] {
            return false;
        }
        let mut buffer = [DVec3::ZERO; 8];
        let origins = match rays.origins {
            Origins::Common(origin) => [origin; 8],
            Origins::Each(origins) => *group_of(origins, group, &mut buffer),
        };
        let EightFacets { facet, normal, ids, .. } = match last {
            Some(last) if last.triangles == *triangles && bits(&last.origins) == bits(&origins) => last,
            _ => {
                let [x, y, z] = S::F64x8::load_xyz(&origins);
                let (corners, all_ids) =
                    LeafBlock::corners::<S>(&self.bvh(0).blocks, S::U32x8::load(triangles));
                let mut ids = [0; 8];
                all_ids.store(&mut ids);
                let origin = Xyz(x, y, z);
                let [a, b, c] = [in_f64(corners[0]), in_f64(corners[1]), in_f64(corners[2])];
                let facet = Facet::new([a.sub(origin), b.sub(origin), c.sub(origin)]);
                let normal = facet.normal.normalized();
                let normal = [store(normal.0), store(normal.1), store(normal.2)];
                last.insert(EightFacets { triangles: *triangles, origins, facet, normal, ids })
            }
        };
        let of = |k: usize| (DVec3::new(normal[0][k], normal[1][k], normal[2][k]), ids[k]);
        write_hits_on::<S>(facet, directions, of, hits)
    }

    /// Writes the hits of the rays of a group that have one (a bit each in `found`), placement by placement.
    #[inline(always)]
    fn write_hits_of_group<S: F32x8>(
        &self,
        rays: &Batch,
        nearest: &NearestHits,
        (group, found): (usize, u32),
        hits: &mut [Option<Hit>],
        maps: &mut Maps,
    ) {
        let (triangles, placements) = nearest.triangles_of_group(group);
        let first = found.trailing_zeros() as usize & 7;
        let mut others = 0;
        for k in 0..8 {
            others |= u32::from(placements[k] != placements[first]) << k;
        }
        if found & others != 0 {
            return self.write_hits_in_meshes::<S>(rays, nearest, (group, found), hits, maps);
        }
        let (scene_o, scene_d) = rays.group::<S>(group);
        let mut rest = found;
        while rest != 0 {
            let first = rest.trailing_zeros() as usize & 7;
            let placement = placements[first];
            let mut lanes = rest & (0..8).fold(0, |set, k| set | u32::from(placements[k] == placement) << k);
            let place = &self.placements[placement as usize];
            let (mut moved, mut map) = (DAffine3::IDENTITY, place.mesh_from_scene());
            if place.is_moving() {
                // Only rays of the same time are carried by the same map.
                let time = |k: usize| rays.time_s(group * 8 + k).unwrap_or(f64::NAN).to_bits();
                let same = |k: &usize| lanes >> k & 1 != 0 && time(*k) == time(first);
                lanes = (0..8).filter(same).fold(0, |set, k| set | 1 << k);
                moved = maps.of(placement, place, rays.time_s(group * 8 + first)).copied().unwrap_or(moved);
                map = &moved;
            }
            rest &= !lanes;
            // The lanes of other placements repeat the computation of the first lane, and their results are dropped.
            let refs = S::select(
                S::Mask8::from_bits(lanes),
                S::U32x8::load(triangles).bitcast(),
                S::U32x8::splat(triangles[first]).bitcast(),
            );
            let (mut d, mut o) = (scene_d, scene_o);
            if placement != 0 && *map != DAffine3::IDENTITY {
                d = exact::carried_direction(map, d);
                o = exact::carried_point(map, o);
            }
            let bvh = self.bvh(placement);
            let (corners, ids) = if *triangles == [triangles[first]; 8] {
                let triangle = TriangleRef(triangles[first]);
                let block = LeafBlock::at(&bvh.blocks, triangle.block_offset());
                let [a, b, c] = block.positions(triangle.lane());
                ([splat(a), splat(b), splat(c)], S::U32x8::splat(block.id(triangle.lane())))
            } else {
                LeafBlock::corners::<S>(&bvh.blocks, S::U32x8::bitcast_from(refs))
            };
            let [a, b, c] = [in_f64(corners[0]), in_f64(corners[1]), in_f64(corners[2])];
            let facet = Facet::new([a.sub(o), b.sub(o), c.sub(o)]);
            let (t, within) = facet.plane_depth(d);
            let (u, v) = facet.weights(d);
            let normal = exact::out_of(map, facet.normal).normalized();
            let (mut t, u, v) = (store(t), store(u), store(v));
            let (x, y, z) = (store(normal.0), store(normal.1), store(normal.2));
            let mut id = [0; 8];
            ids.store(&mut id);
            if lanes & !within != 0 {
                for k in (0..8).filter(|k| (lanes & !within) >> k & 1 != 0) {
                    let triangle = TriangleRef(triangles[k]);
                    let positions =
                        LeafBlock::at(&bvh.blocks, triangle.block_offset()).positions(triangle.lane());
                    let LocalRay { origin, direction } = rays.ray(group * 8 + k).carried_by(map);
                    t[k] = Corners::from_positions(positions, origin).depth(direction);
                }
            }
            for (k, hit) in hits.iter_mut().enumerate() {
                if lanes >> k & 1 != 0 {
                    let normal = DVec3::new(x[k], y[k], z[k]);
                    *hit = Some(Hit { t: t[k], u: u[k], v: v[k], normal, placement, triangle: id[k] });
                }
            }
        }
    }
}

impl Surfaces<'_> {
    /// Writes the hits of the rays of a group that have one, in different placements: each ray is carried to its own.
    #[inline(always)]
    fn write_hits_in_meshes<S: F32x8>(
        &self,
        rays: &Batch,
        nearest: &NearestHits,
        (group, found): (usize, u32),
        hits: &mut [Option<Hit>],
        maps: &mut Maps,
    ) {
        let (&triangles, placements) = nearest.triangles_of_group(group);
        let first = found.trailing_zeros() as usize & 7;
        let mut carried = [DAffine3::IDENTITY; 8];
        let (mut o, mut d, mut blocks) = ([DVec3::ZERO; 8], [DVec3::ZERO; 8], [&[][..]; 8]);
        let mut refs = [triangles[first]; 8];
        for k in 0..8 {
            // The lanes of rays without a hit repeat the computation of the first one, and their results are dropped.
            let lane = if found >> k & 1 != 0 { k } else { first };
            let (number, ray) = (placements[lane], group * 8 + lane);
            let map = maps.of(number, &self.placements[number as usize], rays.time_s(ray));
            carried[k] = map.copied().unwrap_or(DAffine3::IDENTITY);
            let local = rays.ray(ray).carried_by(&carried[k]);
            (o[k], d[k], refs[k]) = (local.origin, local.direction, triangles[lane]);
            blocks[k] = &self.bvh(number).blocks;
        }
        let (corners, ids) = LeafBlock::corners_in_meshes::<S>(blocks, &refs);
        let [[x, y, z], [dx, dy, dz]] = [S::F64x8::load_xyz(&o), S::F64x8::load_xyz(&d)];
        let (at, along) = (Xyz(x, y, z), Xyz(dx, dy, dz));
        let [a, b, c] = [in_f64(corners[0]), in_f64(corners[1]), in_f64(corners[2])];
        let facet = Facet::new([a.sub(at), b.sub(at), c.sub(at)]);
        let (t, within) = facet.plane_depth(along);
        let (u, v) = facet.weights(along);
        let (mut t, u, v) = (store(t), store(u), store(v));
        let (x, y, z) = (store(facet.normal.0), store(facet.normal.1), store(facet.normal.2));
        for (k, hit) in hits.iter_mut().enumerate().filter(|(k, _)| found >> k & 1 != 0) {
            if within >> k & 1 == 0 {
                let triangle = TriangleRef(refs[k]);
                let positions = LeafBlock::at(blocks[k], triangle.block_offset()).positions(triangle.lane());
                t[k] = Corners::from_positions(positions, o[k]).depth(d[k]);
            }
            let Xyz(x, y, z) = exact::out_of(&carried[k], Xyz(x[k], y[k], z[k])).normalized();
            let normal = DVec3::new(x, y, z);
            let (placement, triangle) = (placements[k], ids[k]);
            *hit = Some(Hit { t: t[k], u: u[k], v: v[k], normal, placement, triangle });
        }
    }
}

/// A triangle of placement 0 as seen from an origin that many rays share, kept for the next group that hits it.
struct SharedFacet {
    triangle: TriangleRef,
    facet: Facet<f64>,
    normal: DVec3,
    id: u32,
}

/// Triangles of placement 0, each as seen from the origin of one of eight rays, kept for the next eight that hit the same from there.
struct EightFacets<R> {
    triangles: [u32; 8],
    origins: [DVec3; 8],
    facet: Facet<R>,
    normal: [[f64; 8]; 3],
    ids: [u32; 8],
}

/// Writes the hits of eight rays on facets of placement 0, of which `of` gives the normal and the triangle, if all of their points are
/// within the bounds of these; otherwise returns false.
#[inline(always)]
fn write_hits_on<S: F32x8>(
    facet: &Facet<S::F64x8>,
    directions: &[DVec3; 8],
    of: impl Fn(usize) -> (DVec3, u32),
    hits: &mut [Option<Hit>],
) -> bool {
    let [x, y, z] = S::F64x8::load_xyz(directions);
    let d = Xyz(x, y, z);
    let (t, within) = facet.plane_depth(d);
    if within != 0xff {
        return false;
    }
    let (u, v) = facet.weights(d);
    let (t, u, v) = (store(t), store(u), store(v));
    for (k, hit) in hits.iter_mut().enumerate() {
        let (normal, triangle) = of(k);
        *hit = Some(Hit { t: t[k], u: u[k], v: v[k], normal, placement: 0, triangle });
    }
    true
}

/// The bits of points, by which 0 is not −0.
#[inline(always)]
fn bits(points: &[DVec3; 8]) -> [[u64; 3]; 8] {
    points.map(|p| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits()])
}

/// One corner in all lanes.
#[inline(always)]
fn splat<S: F32x8>([x, y, z]: [f32; 3]) -> [S; 3] {
    [S::splat(x), S::splat(y), S::splat(z)]
}

/// A corner of eight triangles, in f64.
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
