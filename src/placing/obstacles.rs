//! The triangles of a scene, by where they are.
//!
//! Each mesh has a hierarchy of boxes in its own space, so that a mesh which is placed a thousand times costs no more than once. A
//! box that is asked about is carried into that space for the search alone: whether it meets a triangle is decided in the world.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};

use super::enclosure::is_inside;
use super::overlap::box_meets_triangle;
use crate::scene::bounds::Bounds;
use crate::scene::{Mesh, Placement, Scene};
use crate::trace::Tracer;
use crate::truth::OrientedBox;

/// Most triangles of a leaf.
const LEAF: usize = 8;

/// The triangles of snapshots of a scene.
#[derive(Debug)]
pub struct Obstacles<'s> {
    placed: Vec<Placed<'s>>,
    trees: Vec<Tree>,
    /// Over all of the first snapshot.
    tracer: Tracer,
}

/// A mesh where it is.
#[derive(Debug)]
struct Placed<'s> {
    scene: &'s Scene,
    placement: &'s Placement,
    /// In the world.
    bounds: Bounds,
    /// Index into the trees.
    tree: usize,
}

/// The triangles of a mesh, in its own space.
#[derive(Debug)]
struct Tree {
    triangles: Vec<u32>,
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// The range of its triangles.
    from: u32,
    to: u32,
    /// The second child, where the first one follows the node; 0 of a leaf.
    second: u32,
}

impl<'s> Obstacles<'s> {
    /// The triangles of snapshots of one scene, of meshes that come near a box, given by its lowest and its highest corner in the
    /// world, in metres. What stands still is taken once.
    ///
    /// # Panics
    /// If there is no snapshot.
    pub fn of(scenes: &'s [Scene], low: DVec3, high: DVec3) -> Self {
        let near = Bounds { low, high };
        let (mut placed, mut trees, mut known) = (Vec::new(), Vec::new(), BTreeMap::new());
        for (number, scene) in scenes.iter().enumerate() {
            for placement in &scene.arrangement.placements {
                if number > 0 && stands_still(&scenes[0], scene, placement) {
                    continue;
                }
                // A shape of a mesh that bends is that of one snapshot.
                let is_shape = placement.mesh as usize >= scene.geometry.meshes.len();
                let key = (if is_shape { number } else { 0 }, placement.mesh);
                let tree = *known.entry(key).or_insert_with(|| {
                    trees.push(Tree::of(scene.mesh(placement.mesh)));
                    trees.len() - 1
                });
                let Some(root) = trees[tree].nodes.first() else { continue }; // mesh 0 may be empty
                let world_from_mesh =
                    DAffine3::from_translation(scene.geometry.centre) * *placement.scene_from_mesh();
                let bounds = carried(&world_from_mesh, root.bounds.corners());
                if overlap(&near, &bounds) {
                    placed.push(Placed { scene, placement, bounds, tree });
                }
            }
        }
        Self { placed, trees, tracer: Tracer::build(&scenes[0]) }
    }

    /// Whether a box meets one of the triangles.
    pub fn meet(&self, oriented: &OrientedBox) -> bool {
        let corners = oriented.corners();
        let bounds = carried(&DAffine3::IDENTITY, corners.into_iter());
        self.placed.iter().filter(|placed| overlap(&placed.bounds, &bounds)).any(|placed| {
            let Placed { scene, placement, tree, .. } = placed;
            let in_scene = corners.into_iter().map(|corner| corner - scene.geometry.centre);
            let own = carried(placement.mesh_from_scene(), in_scene);
            self.trees[*tree].any(scene.mesh(placement.mesh), &own, |triangle| {
                box_meets_triangle(oriented, scene.triangle_at(placement, triangle as usize))
            })
        })
    }

    /// Whether a point, in the world and in metres, is inside of something that is there in the first snapshot: most of what can be
    /// seen from there is the back of a triangle.
    pub fn enclose(&self, point: DVec3) -> bool {
        is_inside(&self.tracer, point)
    }
}

impl Tree {
    fn of(mesh: &Mesh) -> Self {
        let middle = |triangle: u32| {
            let Bounds { low, high } = bounds(mesh, triangle);
            (triangle, ((low + high) / 2.0).as_vec3().to_array())
        };
        let mut middles: Vec<_> = (0..mesh.triangles.len() as u32).map(middle).collect();
        let mut nodes = Vec::new();
        if !middles.is_empty() {
            split(mesh, &mut middles, 0, &mut nodes);
        }
        Self { triangles: middles.into_iter().map(|(triangle, _)| triangle).collect(), nodes }
    }

    /// Whether a triangle whose bounds overlap a box is one that is looked for.
    fn any(&self, mesh: &Mesh, near: &Bounds, is_it: impl Fn(u32) -> bool) -> bool {
        let mut waiting = if self.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(index) = waiting.pop() {
            let node = &self.nodes[index];
            if !overlap(&node.bounds, near) {
                continue;
            }
            if node.second > 0 {
                waiting.extend([node.second as usize, index + 1]);
                continue;
            }
            let all = &self.triangles[node.from as usize..node.to as usize];
            if all.iter().any(|&triangle| overlap(&bounds(mesh, triangle), near) && is_it(triangle)) {
                return true;
            }
        }
        false
    }
}

/// The bounds of a triangle in its mesh's space.
fn bounds(mesh: &Mesh, triangle: u32) -> Bounds {
    let corners = mesh.triangles[triangle as usize].map(|vertex| mesh.positions[vertex as usize]);
    corners.into_iter().map(|p| DVec3::from_array(p.map(f64::from))).fold(Bounds::EMPTY, Bounds::with)
}

/// Adds the node of triangles, given with the middles of their bounds, that begin at an index of all, and those below it.
fn split(mesh: &Mesh, triangles: &mut [(u32, [f32; 3])], from: usize, nodes: &mut Vec<Node>) {
    let all = triangles.iter().fold(Bounds::EMPTY, |all, (triangle, _)| all.union(bounds(mesh, *triangle)));
    let own = nodes.len();
    let to = from + triangles.len();
    nodes.push(Node { bounds: all, from: from as u32, to: to as u32, second: 0 });
    if triangles.len() <= LEAF {
        return;
    }
    let size = all.high - all.low;
    let axis = (0..3).fold(0, |best, axis| if size[axis] > size[best] { axis } else { best });
    let half = triangles.len() / 2;
    triangles.select_nth_unstable_by(half, |a, b| a.1[axis].total_cmp(&b.1[axis]));
    let (first, second) = triangles.split_at_mut(half);
    split(mesh, first, from, nodes);
    nodes[own].second = nodes.len() as u32;
    split(mesh, second, from + half, nodes);
}

/// The bounds of points that a map carries somewhere, wider by more than rounding can be: the maps of placements have condition
/// numbers of at most 2¹², by which the last digits of an inverse may be off.
fn carried(map: &DAffine3, points: impl Iterator<Item = DVec3>) -> Bounds {
    const ROUNDING: f64 = 16.0 * 4096.0 * f64::EPSILON;
    let m = &map.matrix3;
    let stretch = (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
    let (mut bounds, mut largest) = (Bounds::EMPTY, 0.0_f64);
    for point in points {
        bounds = bounds.with(map.transform_point3(point));
        largest = largest.max(point.abs().max_element());
    }
    let margin = ROUNDING * (stretch * largest + map.translation.abs().max_element());
    Bounds { low: bounds.low - margin, high: bounds.high + margin }
}

/// Whether a placement of a later snapshot is in the first one, too.
fn stands_still(first: &Scene, scene: &Scene, placement: &Placement) -> bool {
    let placements = &first.arrangement.placements;
    let is_shape = placement.mesh as usize >= scene.geometry.meshes.len();
    // Placements rise by their first triangle; only an empty mesh shares its own with the next.
    let from = placements.partition_point(|other| other.first_triangle < placement.first_triangle);
    let mut same = placements[from..].iter().take_while(|p| p.first_triangle == placement.first_triangle);
    !is_shape && same.any(|other| other == placement)
}

fn overlap(a: &Bounds, b: &Bounds) -> bool {
    a.low.cmple(b.high).all() && b.low.cmple(a.high).all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::frame::Pose;
    use crate::rng::Rng;
    use crate::scene::{Material, SceneBuilder, SourceInstance, SourceMesh, SourcePart};

    fn any_map(rng: &mut Rng, spread_m: f64) -> Pose {
        let turn = [(); 3].map(|()| Angle::rad(3.0 * rng.signed()));
        Pose::from_rpy(spread_m * rng.point(), turn[0], turn[1], turn[2])
    }

    /// A soup of small triangles far from the world's origin, a part of it placed several times, turned, stretched and mirrored.
    #[test]
    fn the_search_finds_what_a_look_at_every_triangle_finds() {
        let mut rng = Rng::new(8);
        let far = DVec3::new(4e5, 5e6, 100.0);
        let soup = |rng: &mut Rng, count: u32| {
            let corner = |rng: &mut Rng, at: DVec3| (at + 0.5 * rng.point()).as_vec3().to_array();
            let positions = (0..count).flat_map(|_| {
                let at = 6.0 * rng.point();
                [(); 3].map(|()| corner(rng, at))
            });
            let positions: Vec<[f32; 3]> = positions.collect();
            let triangles = (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            SourceMesh {
                positions,
                parts: vec![SourcePart { triangles, material: 0, ..SourcePart::default() }],
            }
        };
        let meshes = vec![soup(&mut rng, 300), soup(&mut rng, 40)];
        let mut placed = |mesh: usize, scale: DVec3| {
            let Pose { rotation, translation } = any_map(&mut rng, 3.0);
            let map = DAffine3 { matrix3: rotation, translation: translation + far };
            let world_from_mesh = map * DAffine3::from_scale(scale);
            SourceInstance { mesh, world_from_mesh, ..SourceInstance::default() }
        };
        let scales = [[1.0, 1.0, 1.0], [-1.0, 1.0, 2.0], [0.3, 0.5, 1.5]].map(DVec3::from_array);
        let mut instances: Vec<SourceInstance> = scales.iter().map(|scale| placed(1, *scale)).collect();
        instances.push(placed(0, DVec3::ONE));
        let builder =
            SceneBuilder { meshes, instances, materials: vec![Material::default()], ..Default::default() };
        let scenes = [builder.build().unwrap()];
        let obstacles = Obstacles::of(&scenes, far - 10.0, far + 10.0);
        let scene = &scenes[0];
        let mut count = [0; 2];
        for _ in 0..2000 {
            let pose = any_map(&mut rng, 6.0);
            let world_from_box = Pose { translation: pose.translation + far, ..pose };
            let size_m = 2.0 * DVec3::new(rng.unit(), rng.unit(), rng.unit());
            let oriented = OrientedBox { world_from_box, size_m };
            let expected = scene.triangles_of(|_| true).into_iter().any(|(placement, mut run)| {
                run.any(|triangle| box_meets_triangle(&oriented, scene.triangle_at(placement, triangle)))
            });
            assert_eq!(obstacles.meet(&oriented), expected);
            count[usize::from(expected)] += 1;
        }
        assert!(count.iter().all(|count| *count > 300), "{count:?}");
    }
}
