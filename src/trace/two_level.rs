//! The tracer: a hierarchy of placements over a hierarchy a mesh.

use glam::DVec3;

use super::bvh::{Bounds, Bvh};
use super::exact::{Candidate, Corners, LocalRay};
use super::{Cast, Hit, Rays};
use crate::scene::{Mesh, Placement, Scene};

/// Finds the hits that [`BruteForce`](super::BruteForce) finds, bit for bit, in logarithmic time.
#[derive(Debug)]
pub struct Tracer<'s> {
    scene: &'s Scene,
    /// One a mesh.
    meshes: Vec<Bvh>,
    /// Over the placements.
    top: Bvh,
}

impl<'s> Tracer<'s> {
    /// Builds the hierarchies over a scene.
    pub fn build(scene: &'s Scene) -> Self {
        let meshes = scene
            .meshes
            .iter()
            .map(|mesh| Bvh::build(mesh.triangles.len() as u32, |triangle| triangle_bounds(mesh, triangle)));
        let meshes: Vec<_> = meshes.collect();
        let mesh_bounds: Vec<_> = scene.meshes.iter().map(bounds_of).collect();
        // An empty mesh 0 is placed all the same, and has no box.
        let full = |p: &Placement| !scene.meshes[p.mesh as usize].triangles.is_empty();
        let extent = scene.placements.iter().filter(|p| full(p));
        let extent = extent
            .fold(Bounds::EMPTY, |all, p| all.union(carried_bounds(&mesh_bounds[p.mesh as usize], p, 0.0)));
        let size = extent.largest();
        let top = Bvh::build(scene.placements.len() as u32, |index| {
            let placement = &scene.placements[index as usize];
            if full(placement) {
                carried_bounds(&mesh_bounds[placement.mesh as usize], placement, size)
            } else {
                Bounds { low: extent.low, high: extent.low }
            }
        });
        Self { scene, meshes, top }
    }

    /// Bytes held beside the scene.
    pub fn bytes(&self) -> usize {
        self.top.bytes() + self.meshes.iter().map(Bvh::bytes).sum::<usize>()
    }

    fn nearest(&self, ray: LocalRay, (t_min, t_max): (f64, f64), room: &mut Room) -> Option<Hit> {
        let mut best: Option<(Candidate, LocalRay)> = None;
        self.top.visit(&ray, (t_min, t_max), &mut room.top, |index| {
            let placement = &self.scene.placements[index as usize];
            let local = ray.carried(placement);
            let mesh = &self.scene.meshes[placement.mesh as usize];
            let far = best.map_or(t_max, |(known, _)| known.t);
            self.meshes[placement.mesh as usize].visit(&local, (t_min, far), &mut room.mesh, |triangle| {
                let corners = Corners::of(mesh, triangle, local.origin);
                if corners.passes(local.direction) {
                    let t = corners.depth(local.direction);
                    let found = Candidate { t, placement: index, triangle };
                    if (t_min..=t_max).contains(&t) && best.is_none_or(|(known, _)| found.beats(&known)) {
                        best = Some((found, local));
                    }
                }
                best.map_or(t_max, |(known, _)| known.t)
            });
            best.map_or(t_max, |(known, _)| known.t)
        });
        best.map(|(found, local)| {
            let placement = &self.scene.placements[found.placement as usize];
            found.finish(&local, &self.scene.meshes[placement.mesh as usize], placement)
        })
    }
}

/// Stacks, kept from ray to ray.
#[derive(Default)]
struct Room {
    top: Vec<(u32, f64)>,
    mesh: Vec<(u32, f64)>,
}

impl Cast for Tracer<'_> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        assert_eq!(rays.directions.len(), hits.len());
        let origin = rays.origin - self.scene.centre;
        let mut room = Room::default();
        for (&direction, hit) in rays.directions.iter().zip(hits) {
            *hit = self.nearest(LocalRay { origin, direction }, (rays.t_min, rays.t_max), &mut room);
        }
    }
}

fn corner(mesh: &Mesh, vertex: u32) -> DVec3 {
    let [x, y, z] = mesh.positions[vertex as usize];
    DVec3::new(f64::from(x), f64::from(y), f64::from(z))
}

fn triangle_bounds(mesh: &Mesh, triangle: u32) -> Bounds {
    let corners = mesh.triangles[triangle as usize].map(|v| corner(mesh, v));
    corners.into_iter().fold(Bounds::EMPTY, Bounds::with)
}

fn bounds_of(mesh: &Mesh) -> Bounds {
    let corners = mesh.triangles.iter().flatten().map(|&v| corner(mesh, v));
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
    if *map == glam::DAffine3::IDENTITY {
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
