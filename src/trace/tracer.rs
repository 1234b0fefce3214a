//! The tracer: a hierarchy of placements over a hierarchy a mesh, walked by packets.

use glam::{DAffine3, DVec3};

use super::bounds::Bounds;
use super::exact::{self, Candidate, Corners, Facet, LocalRay, Xyz};
use super::lanes::{self, Doubles, Lanes, Portable, Work};
use super::packet::{Nearest, RAYS, Tile, Visit};
use super::wide::{self, Block, Child, Slot, Wide};
use super::{Cast, Hit, Origins, Rays};
use crate::scene::{Mesh, Placement, Scene};

/// Finds the hits that [`BruteForce`](super::BruteForce) finds, bit for bit, and fast.
///
/// Rays are taken 64 at a time as they come: a batch's neighbours should be neighbours in space.
#[derive(Debug)]
pub struct Tracer<'s> {
    pub(super) scene: &'s Scene,
    /// One a mesh.
    pub(super) meshes: Vec<Wide>,
    /// Over the placements; without nodes if all there is is mesh 0.
    pub(super) top: Wide,
    instructions: Instructions,
}

/// How a [`Tracer`] computes. The hits are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// The best that the processor has.
    Best,
    /// Packets in portable code.
    Portable,
    /// One ray at a time, in f64.
    SingleRays,
}

impl<'s> Tracer<'s> {
    /// Builds the hierarchies over a scene.
    pub fn build(scene: &'s Scene) -> Self {
        let meshes = scene.meshes.iter().map(wide::build).collect();
        let bounds: Vec<_> = scene.meshes.iter().map(bounds_of).collect();
        let size = scene.placements.iter().map(|p| carried_bounds(&bounds[p.mesh as usize], p, 0.0));
        let size = size.filter(|b| b.low.x <= b.high.x).fold(Bounds::EMPTY, Bounds::union).largest();
        let boxes: Vec<_> = scene
            .placements
            .iter()
            .map(|p| match scene.meshes[p.mesh as usize].triangles.is_empty() {
                // An empty mesh 0 is placed all the same; its box is a point, where a ray finds nothing.
                true => Bounds { low: DVec3::ZERO, high: DVec3::ZERO },
                false => carried_bounds(&bounds[p.mesh as usize], p, size),
            })
            .collect();
        let top = if boxes.len() > 1 { wide::build_over(&boxes) } else { Wide::default() };
        Self { scene, meshes, top, instructions: Instructions::Best }
    }

    /// The same with other instructions.
    pub fn with_instructions(self, instructions: Instructions) -> Self {
        Self { instructions, ..self }
    }

    /// Bytes held beside the scene.
    pub fn bytes(&self) -> usize {
        self.top.bytes() + self.meshes.iter().map(Wide::bytes).sum::<usize>()
    }

    /// The hits of a batch, by packets of any kind of lanes.
    #[inline(always)]
    fn cast_packets<S: Lanes>(&self, rays: &Batch, hits: &mut [Option<Hit>]) {
        let mut room = Room::default();
        let mut pending: Vec<(usize, usize)> = Vec::new();
        for start in (0..rays.directions.len()).step_by(RAYS) {
            pending.push((start, (start + RAYS).min(rays.directions.len())));
            while let Some((from, to)) = pending.pop() {
                let tile = Batch { directions: &rays.directions[from..to], ..*rays };
                let hits = &mut hits[from..to];
                if self.cast_tile::<S>(&tile, hits, &mut room) {
                    continue;
                }
                if to - from == 1 {
                    self.cast_singly(&tile, hits, &mut room);
                } else {
                    // No narrow pyramid; its halves may be.
                    let middle = from + (to - from) / 2;
                    pending.extend([(middle, to), (from, middle)]);
                }
            }
        }
    }

    /// The hits of up to [`RAYS`] rays; false if they are no narrow pyramid.
    #[inline(always)]
    fn cast_tile<S: Lanes>(&self, tile: &Batch, hits: &mut [Option<Hit>], room: &mut Room) -> bool {
        let mut nearest = Nearest::new(tile.t_max);
        let limits = (tile.t_min, tile.t_max);
        if self.top.nodes.is_empty() {
            let Some(mut packet) =
                Tile::new::<S>(&self.meshes[0], 0, tile.origin, tile.directions, limits, &nearest)
            else {
                return false;
            };
            packet.walk_mesh::<S>(&mut room.mesh);
            packet.leave(&mut nearest, false);
        } else {
            let Some(mut top) = Tile::new::<S>(&self.top, 0, tile.origin, tile.directions, limits, &nearest)
            else {
                return false;
            };
            let Room { top: stack, mesh: mesh_stack, carried, single } = room;
            top.enter_root::<S>(stack);
            while let Some(leaf) = top.next_leaf::<S>(stack) {
                let index = leaf.number;
                let placement = &self.scene.placements[index as usize];
                let origin = exact::carry(placement, tile.origin, tile.directions, carried);
                let wide = &self.meshes[placement.mesh as usize];
                if let Some(mut packet) = Tile::new::<S>(wide, index, origin, carried, limits, &nearest) {
                    packet.walk_mesh::<S>(mesh_stack);
                    packet.leave(&mut nearest, true);
                } else {
                    for (ray, &direction) in carried.iter().enumerate() {
                        let mut best = nearest.get(ray);
                        self.nearest_in(
                            index,
                            LocalRay { origin, direction },
                            limits,
                            &mut best,
                            &mut single.mesh,
                        );
                        nearest.set(ray, best);
                    }
                }
                top.update(&nearest);
            }
        }
        let mut last = None;
        for (four, hits) in hits.chunks_mut(4).enumerate() {
            if !self.finish_alike::<S::Doubles>(tile, &nearest, four * 4, hits, &mut last) {
                self.finish_four::<S::Doubles>(tile, &nearest, four * 4, hits);
            }
        }
        true
    }

    /// The whole hits of four rays from number `first` on that all hit the same triangle of placement 0; false if they don't.
    /// `last` is the triangle of the previous ones.
    #[inline(always)]
    fn finish_alike<D: Doubles>(
        &self,
        tile: &Batch,
        nearest: &Nearest,
        first: usize,
        hits: &mut [Option<Hit>],
        last: &mut Option<Seen>,
    ) -> bool {
        let Some(slot) = nearest.all_in(first, 0) else { return false };
        let (Ok(hits), Some(directions)) =
            (<&mut [_; 4]>::try_from(hits), tile.directions.get(first..first + 4))
        else {
            return false;
        };
        let Seen { facet, normal, triangle, .. } = match last {
            Some(seen) if seen.slot == slot => seen,
            _ => {
                let block = Block::at(&self.wide(0).blocks, slot.granule());
                let facet =
                    Facet::new(Corners::from_positions(block.positions(slot.lane()), tile.origin).xyz());
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
        let facet = Facet::<D>::splat(facet);
        let d = Xyz(
            D::load(&[directions[0].x, directions[1].x, directions[2].x, directions[3].x]),
            D::load(&[directions[0].y, directions[1].y, directions[2].y, directions[3].y]),
            D::load(&[directions[0].z, directions[1].z, directions[2].z, directions[3].z]),
        );
        let (t, within) = facet.plane_depth(d);
        if within != 0b1111 {
            return false;
        }
        let (u, v) = facet.weights(d);
        let (mut ts, mut us, mut vs) = ([0.0; 4], [0.0; 4], [0.0; 4]);
        t.store(&mut ts);
        u.store(&mut us);
        v.store(&mut vs);
        for (k, hit) in hits.iter_mut().enumerate() {
            *hit = Some(Hit { t: ts[k], u: us[k], v: vs[k], normal, placement: 0, triangle });
        }
        true
    }

    /// The whole hits of up to four rays from number `first` on: [`Candidate::finish`] and the depth, side by side.
    #[inline(always)]
    fn finish_four<D: Doubles>(
        &self,
        tile: &Batch,
        nearest: &Nearest,
        first: usize,
        hits: &mut [Option<Hit>],
    ) {
        let mut origins = [[0.0; 4]; 3];
        let mut directions = [[1.0; 4]; 3];
        let mut positions = [[[1.0; 4]; 3]; 3];
        let mut triangles = [0; 4];
        let mut any = false;
        for (k, hit) in hits.iter_mut().enumerate() {
            *hit = None;
            let Some(best) = nearest.get(first + k) else { continue };
            any = true;
            let mut ray = LocalRay { origin: tile.origin, direction: tile.directions[first + k] };
            if best.placement != 0 {
                ray = ray.carried(&self.scene.placements[best.placement as usize]);
            }
            let block = Block::at(&self.wide(best.placement).blocks, best.slot.granule());
            triangles[k] = block.id(best.slot.lane());
            let corners = block.positions(best.slot.lane());
            for axis in 0..3 {
                origins[axis][k] = ray.origin[axis];
                directions[axis][k] = ray.direction[axis];
                positions[0][axis][k] = f64::from(corners[0][axis]);
                positions[1][axis][k] = f64::from(corners[1][axis]);
                positions[2][axis][k] = f64::from(corners[2][axis]);
            }
        }
        if !any {
            return;
        }
        let load = load_xyz::<D>;
        let origin = load(&origins);
        let d = load(&directions);
        let corners = [
            load(&positions[0]).sub(origin),
            load(&positions[1]).sub(origin),
            load(&positions[2]).sub(origin),
        ];
        let facet = Facet::new(corners);
        let (t, within) = facet.plane_depth(d);
        let (u, v) = facet.weights(d);
        let mut normals = store_xyz(facet.normal);
        if !self.top.nodes.is_empty() {
            let [x, y, z] = &mut normals;
            for (k, ((x, y), z)) in x.iter_mut().zip(y).zip(z).enumerate().take(hits.len()) {
                if let Some(best) = nearest.get(first + k) {
                    let placement = &self.scene.placements[best.placement as usize];
                    Xyz(*x, *y, *z) = exact::out_of(placement, Xyz(*x, *y, *z));
                }
            }
        }
        let normals = store_xyz(load(&normals).normalized());
        let (mut ts, mut us, mut vs) = ([0.0; 4], [0.0; 4], [0.0; 4]);
        t.store(&mut ts);
        u.store(&mut us);
        v.store(&mut vs);
        for (k, hit) in hits.iter_mut().enumerate() {
            let Some(best) = nearest.get(first + k) else { continue };
            if within >> k & 1 == 0 {
                let at = |xyz: &[[f64; 4]; 3]| DVec3::new(xyz[0][k], xyz[1][k], xyz[2][k]);
                let [a, b, c] = [0, 1, 2].map(|corner| at(&positions[corner]) - at(&origins));
                ts[k] = Corners { a, b, c }.depth(at(&directions));
            }
            *hit = Some(Hit {
                t: ts[k],
                u: us[k],
                v: vs[k],
                normal: DVec3::new(normals[0][k], normals[1][k], normals[2][k]),
                placement: best.placement,
                triangle: triangles[k],
            });
        }
    }

    /// The hits of rays taken one by one.
    #[inline(never)]
    fn cast_singly(&self, rays: &Batch, hits: &mut [Option<Hit>], room: &mut Room) {
        let limits = (rays.t_min, rays.t_max);
        let SingleRoom { top, mesh } = &mut room.single;
        for (&direction, hit) in rays.directions.iter().zip(hits) {
            let ray = LocalRay { origin: rays.origin, direction };
            let mut best: Option<Best> = None;
            if self.top.nodes.is_empty() {
                self.nearest_in(0, ray, limits, &mut best, mesh);
            } else {
                self.top.visit(&ray, limits, top, |index| {
                    let local = ray.carried(&self.scene.placements[index as usize]);
                    self.nearest_in(index, local, limits, &mut best, mesh);
                    best.map_or(limits.1, |b| b.t)
                });
            }
            *hit = best.map(|best| self.finish(ray, &best));
        }
    }

    /// Betters `best` by what one ray, in the placement's space, hits there.
    fn nearest_in(
        &self,
        placement: u32,
        ray: LocalRay,
        (t_min, t_max): (f64, f64),
        best: &mut Option<Best>,
        stack: &mut Vec<(Child, f64)>,
    ) {
        let wide = self.wide(placement);
        let far = best.map_or(t_max, |b| b.t);
        wide.visit(&ray, (t_min, far), stack, |granule| {
            let block = Block::at(&wide.blocks, granule);
            for lane in 0..block.triangles {
                let corners = Corners::from_positions(block.positions(lane), ray.origin);
                if !corners.passes(ray.direction) {
                    continue;
                }
                let t = corners.depth(ray.direction);
                let found = Candidate { t, placement, triangle: block.id(lane) };
                if (t_min..=t_max).contains(&t) && best.is_none_or(|b| found.beats(&self.candidate(&b))) {
                    *best = Some(Best { t, placement, slot: Slot::new(granule, lane) });
                }
            }
            best.map_or(t_max, |b| b.t)
        });
    }

    fn wide(&self, placement: u32) -> &Wide {
        &self.meshes[self.scene.placements[placement as usize].mesh as usize]
    }

    fn candidate(&self, best: &Best) -> Candidate {
        let block = Block::at(&self.wide(best.placement).blocks, best.slot.granule());
        Candidate { t: best.t, placement: best.placement, triangle: block.id(best.slot.lane()) }
    }

    /// The whole hit of a ray in the scene's space.
    fn finish(&self, ray: LocalRay, best: &Best) -> Hit {
        let placement = &self.scene.placements[best.placement as usize];
        let local = ray.carried(placement);
        let block = Block::at(&self.wide(best.placement).blocks, best.slot.granule());
        let corners = Corners::from_positions(block.positions(best.slot.lane()), local.origin);
        self.candidate(best).finish(&corners, local.direction, placement)
    }
}

impl Cast for Tracer<'_> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        assert_eq!(rays.directions.len(), hits.len());
        if let Origins::Each(origins) = rays.origins {
            assert_eq!(origins.len(), hits.len());
        }
        for (run, origin) in rays.runs() {
            let rays = Batch {
                origin: origin - self.scene.centre,
                directions: &rays.directions[run.clone()],
                t_min: rays.t_min,
                t_max: rays.t_max,
            };
            let hits = &mut hits[run];
            let packets = Packets { tracer: self, rays, hits };
            match self.instructions {
                #[cfg(target_arch = "x86_64")]
                Instructions::Best if lanes::has_avx2() => lanes::with_avx2(packets),
                Instructions::Best | Instructions::Portable => packets.run::<Portable>(),
                Instructions::SingleRays => {
                    self.cast_singly(&packets.rays, packets.hits, &mut Room::default())
                }
            }
        }
    }
}

struct Packets<'a, 's, 'r> {
    tracer: &'a Tracer<'s>,
    rays: Batch<'r>,
    hits: &'a mut [Option<Hit>],
}

impl Work for Packets<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Lanes>(self) {
        self.tracer.cast_packets::<S>(&self.rays, self.hits);
    }
}

#[inline(always)]
fn load_xyz<D: Doubles>(x: &[[f64; 4]; 3]) -> Xyz<D> {
    Xyz(D::load(&x[0]), D::load(&x[1]), D::load(&x[2]))
}

#[inline(always)]
fn store_xyz<D: Doubles>(x: Xyz<D>) -> [[f64; 4]; 3] {
    let mut to = [[0.0; 4]; 3];
    x.0.store(&mut to[0]);
    x.1.store(&mut to[1]);
    x.2.store(&mut to[2]);
    to
}

/// Rays of one origin, in the scene's space.
#[derive(Clone, Copy)]
struct Batch<'r> {
    origin: DVec3,
    directions: &'r [DVec3],
    t_min: f64,
    t_max: f64,
}

/// Where a ray's nearest hit lies.
#[derive(Clone, Copy)]
pub(super) struct Best {
    pub t: f64,
    pub placement: u32,
    pub slot: Slot,
}

/// A triangle of placement 0, as the last rays that hit it needed it.
struct Seen {
    slot: Slot,
    facet: Facet<f64>,
    normal: DVec3,
    triangle: u32,
}

/// Room to work in, kept from tile to tile.
#[derive(Default)]
struct Room {
    top: Vec<Visit>,
    mesh: Vec<Visit>,
    carried: Vec<DVec3>,
    single: SingleRoom,
}

#[derive(Default)]
struct SingleRoom {
    top: Vec<(Child, f64)>,
    mesh: Vec<(Child, f64)>,
}

fn bounds_of(mesh: &Mesh) -> Bounds {
    let corners = mesh.triangles.iter().flatten().map(|&v| {
        let [x, y, z] = mesh.positions[v as usize];
        DVec3::new(f64::from(x), f64::from(y), f64::from(z))
    });
    corners.fold(Bounds::EMPTY, Bounds::with)
}

/// The bounds in the scene's space of everything that a ray, carried into the placement's space, may hit there.
///
/// Carrying costs a few 2⁻⁵³ of |M⁻¹|·|o| + |t| in the mesh's space, where M⁻¹ is the linear part and the origin lies
/// within some multiple of the scene's `size`; so the mesh's box grows by 2⁻²¹ of that before it is carried out, which is
/// enough for origins a million scene sizes away and for maps as skewed as [`SceneBuilder`](crate::scene::SceneBuilder)
/// lets through (their condition is at most 2¹²).
fn carried_bounds(mesh: &Bounds, placement: &Placement, size: f64) -> Bounds {
    let map = &placement.mesh_from_scene;
    if *map == DAffine3::IDENTITY || mesh.low.x > mesh.high.x {
        return *mesh;
    }
    let m = &map.matrix3;
    let stretch = (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
    let pad = (mesh.largest() + map.translation.abs().max_element() + stretch * size) / f64::from(1 << 21);
    let (low, high) = (mesh.low - pad, mesh.high + pad);
    (0..8).fold(Bounds::EMPTY, |all, index| {
        let side = |axis: usize| if index >> axis & 1 == 0 { low[axis] } else { high[axis] };
        all.with(placement.scene_from_mesh.transform_point3(DVec3::new(side(0), side(1), side(2))))
    })
}
