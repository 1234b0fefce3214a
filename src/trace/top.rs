//! The hierarchy over the placements of a scene.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::bvh::{self, Bvh8, Child, WIDTH};
use crate::scene::bounds::Bounds;
use crate::scene::{Mesh, Placement, Scene};

/// The hierarchy over the placements of a scene.
#[derive(Debug, Default)]
pub(super) struct Top {
    /// It has no nodes if there is only one placement. The number of a leaf is that of a placement.
    pub bvh: Bvh8,
    /// For each placement that does not move the next one of the same mesh in the very same place, or [`Top::LAST`]; empty if there are none. Such
    /// copies are hit at the same depths, to the bit, and the first has the lowest ids. So only the first is in the hierarchy, and
    /// the others are looked at only for the hits that come after another. (Exporters stack copies by the thousand.)
    copies: Vec<u32>,
}

impl Top {
    const LAST: u32 = u32::MAX;

    /// The hierarchy over the placements of a scene, given its meshes and its shapes in their own spaces. Its boxes may be `tight`.
    pub fn new(scene: &Scene, meshes: Bounded, shapes: Bounded, tight: bool) -> Self {
        let placements = &scene.arrangement.placements;
        if placements.len() < 2 {
            return Self::default();
        }
        let own = |p: &Placement| {
            meshes.get(p.mesh as usize).or_else(|| shapes.get(p.mesh as usize - meshes.len()))
        };
        let own = |p: &Placement| own(p).expect("a placement is of a mesh that exists");
        let window = scene.arrangement.window;
        // What each placement that moves reaches, and what the origin of its space reaches.
        let reached = |p: &Placement| {
            let (own, _) = own(p);
            let of_mesh = p.bounds_of(own, window);
            if own.contains(DVec3::ZERO) {
                return (of_mesh, of_mesh);
            }
            (of_mesh, p.bounds_of(&Bounds::EMPTY.with(DVec3::ZERO), window))
        };
        let of_moving: Vec<_> = placements.par_iter().filter(|p| p.is_moving()).map(reached).collect();
        let of_still = placements.iter().filter(|p| !p.is_moving()).map(|p| {
            let (bounds, _) = own(p);
            carried_bounds(bounds, bounds.largest(), p, 0.0)
        });
        let all = of_still.chain(of_moving.iter().map(|(of_mesh, _)| *of_mesh)).filter(|b| !b.is_empty());
        let size = all.fold(Bounds::EMPTY, Bounds::union).largest();
        let mut of_moving = of_moving.into_iter();
        let (copies, is_copy) = copies(placements);
        let mut boxes = Vec::with_capacity(placements.len());
        for (placement, number) in placements.iter().zip(0..) {
            if is_copy.get(number as usize).copied().unwrap_or(false) {
                continue;
            }
            let (own, bvh) = own(placement);
            let moving = if placement.is_moving() { of_moving.next() } else { None };
            let bounds = match moving {
                Some((of_mesh, _)) if of_mesh.is_empty() => continue,
                // An empty mesh 0 has a placement too. Its box is a point, where a ray finds nothing.
                _ if own.is_empty() => Bounds { low: DVec3::ZERO, high: DVec3::ZERO },
                Some((of_mesh, of_origin)) => padded(&of_mesh, &of_origin, size, scene.geometry.centre),
                None if tight => tight_bounds(bvh, own.largest(), placement, size),
                None => carried_bounds(own, own.largest(), placement, size),
            };
            boxes.push((bounds, number));
        }
        Self { bvh: bvh::build_over(&boxes), copies }
    }

    /// The bytes that it holds.
    pub fn bytes(&self) -> usize {
        self.bvh.bytes() + self.copies.capacity() * size_of::<u32>()
    }

    /// A placement and the copies of it that come after it.
    pub fn with_copies(&self, placement: u32) -> impl Iterator<Item = u32> {
        let next =
            |&placement: &u32| self.copies.get(placement as usize).copied().filter(|&n| n != Self::LAST);
        std::iter::successors(Some(placement), next)
    }
}

/// Meshes with their bounds and hierarchies.
#[derive(Clone, Copy)]
pub(super) struct Bounded<'a> {
    pub bounds: &'a [Bounds],
    pub hierarchies: &'a [Bvh8],
}

impl<'a> Bounded<'a> {
    fn len(&self) -> usize {
        self.bounds.len()
    }

    fn get(&self, number: usize) -> Option<(&'a Bounds, &'a Bvh8)> {
        Some((self.bounds.get(number)?, self.hierarchies.get(number)?))
    }
}

/// The box in the scene's space around the boxes of the children of a mesh's root, at a placement that does not move. If the mesh is
/// turned, it is smaller than the box around the mesh's box.
fn tight_bounds(bvh: &Bvh8, largest: f64, placement: &Placement, size: f64) -> Bounds {
    let root = &bvh.nodes[0];
    let present = (0..WIDTH).filter(|&lane| root.child[lane] != Child::NONE);
    let boxes = present.map(|lane| {
        let plane = |lane: usize| DVec3::from([0, 1, 2].map(|axis| f64::from(root.planes[axis][lane])));
        let child = Bounds { low: plane(lane), high: plane(WIDTH + lane) };
        carried_bounds(&child, largest, placement, size)
    });
    boxes.fold(Bounds::EMPTY, Bounds::union)
}

/// For each placement the next that is the same, or [`Top::LAST`], and whether there is one before it. Both are empty if no two
/// are the same.
fn copies(placements: &[Placement]) -> (Vec<u32>, Vec<bool>) {
    let place = |p: &Placement| (p.mesh, p.scene_from_mesh().to_cols_array().map(f64::to_bits));
    // Equal places have equal hashes, so they are neighbours when sorted by these, and in order.
    let hash = |p: &Placement| {
        let (mesh, bits) = place(p);
        let mix = |hash: u64, bits: u64| (hash.rotate_left(5) ^ bits).wrapping_mul(0x517c_c1b7_2722_0a95);
        bits.into_iter().fold(u64::from(mesh), mix)
    };
    let mut order: Vec<(u64, u32)> = placements.iter().map(hash).zip(0..).collect();
    order.sort_unstable();
    let (mut next, mut is_copy) = (Vec::new(), Vec::new());
    for pair in order.windows(2) {
        let [(_, before), (_, after)] = [pair[0], pair[1]];
        let (p, q) = (&placements[before as usize], &placements[after as usize]);
        if pair[0].0 == pair[1].0 && place(p) == place(q) && !p.is_moving() && !q.is_moving() {
            next.resize(placements.len(), Top::LAST);
            is_copy.resize(placements.len(), false);
            next[before as usize] = after;
            is_copy[after as usize] = true;
        }
    }
    (next, is_copy)
}

/// The bounds of a mesh in its own space.
pub(super) fn bounds_of(mesh: &Mesh) -> Bounds {
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
/// lets through (their condition is at most 2¹²). The same holds for a part of the mesh, whose box is `part` and whose mesh has the
/// largest |coordinate| `largest`.
fn carried_bounds(part: &Bounds, largest: f64, placement: &Placement, size: f64) -> Bounds {
    let map = placement.mesh_from_scene();
    if *map == DAffine3::IDENTITY || part.is_empty() {
        return *part;
    }
    let m = &map.matrix3;
    let stretch = (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
    let pad = (largest + map.translation.abs().max_element() + stretch * size) / f64::from(1 << 21);
    let (low, high) = (part.low - pad, part.high + pad);
    let corners = Bounds { low, high }.corners();
    corners.map(|p| placement.scene_from_mesh().transform_point3(p)).fold(Bounds::EMPTY, Bounds::with)
}

/// The bounds in the scene's space of everything that a ray, carried into the space of a placement that moves, may hit there during the
/// frame. `reached` is what the mesh reaches during the frame, and `origin` what the origin of its space reaches.
///
/// Let S be the map into the scene's space at the ray's time, with linear part L and translation s, A = L⁻¹, |·| the largest
/// |component| and ‖·‖ the largest row sum, and κ = ‖L‖·‖A‖ ≤ 2¹² (no ray is carried where it is more). With u = 2⁻⁵³, carrying a ray
/// from o along d costs 4u·(‖A‖·|o| + |A·s|) of its origin and 3u·‖A‖·|d| of its direction. At the depth t of a hit, whose point p lies
/// in the mesh's own bounds, t·|d| ≤ ‖L‖·(|p| + |A·(o − s)|) to first order. So the point o + t·d, where boxes have to be, is off
/// from S·p by ‖L‖ times these errors, at most 7u·κ²·(|o| + |s| + |S·p − s|) ≤ 7u·κ²·(|o| + 3B), where B is the largest |coordinate|
/// of the two bounds. Inverting S costs a few u·κ²·B more. The box grows by 2⁻¹⁵·(B + `size`), so there is room for origins a thousand
/// scene sizes away where κ is 2⁶, as of a mesh that is scaled by 64 along one axis, and a million where it is 2⁴ or less; at the
/// extreme of 2¹² there is room for origins in the scene. Maps into the world are rounded at world coordinates, which costs some u
/// of the scene's `centre`.
fn padded(reached: &Bounds, origin: &Bounds, size: f64, centre: DVec3) -> Bounds {
    let largest = reached.largest().max(origin.largest());
    let pad = (largest + size) / f64::from(1 << 15) + centre.abs().max_element() / f64::from(1 << 30);
    Bounds { low: reached.low - pad, high: reached.high + pad }
}
