//! The triangles of a scene, by where they are.

use glam::DVec3;

use super::enclosure::is_inside;
use super::overlap::box_meets_triangle;
use crate::scene::bounds::Bounds;
use crate::scene::{Placement, Scene};
use crate::trace::Tracer;
use crate::truth::OrientedBox;

/// Most triangles of a leaf.
const LEAF: usize = 8;

/// The triangles of snapshots of a scene in a part of the world, in a hierarchy of boxes.
#[derive(Debug)]
pub struct Obstacles<'s> {
    scenes: &'s [Scene],
    triangles: Vec<Obstacle>,
    nodes: Vec<Node>,
    /// Over all of the first snapshot.
    tracer: Tracer,
}

#[derive(Clone, Copy, Debug)]
struct Obstacle {
    /// In the world.
    bounds: Bounds,
    scene: u32,
    placement: u32,
    triangle: u32,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// The range of its triangles.
    from: usize,
    to: usize,
    /// The second child, where the first one follows the node; 0 of a leaf.
    second: usize,
}

impl<'s> Obstacles<'s> {
    /// The triangles of snapshots of one scene that come near a box, given by its lowest and its highest corner in the world, in
    /// metres. What stands still is taken once.
    ///
    /// # Panics
    /// If there is no snapshot.
    pub fn of(scenes: &'s [Scene], low: DVec3, high: DVec3) -> Self {
        let near = Bounds { low, high };
        let mut triangles = Vec::new();
        for (number, scene) in scenes.iter().enumerate() {
            for (index, placement) in scene.arrangement.placements.iter().enumerate() {
                if number > 0 && stands_still(&scenes[0], scene, placement) {
                    continue;
                }
                let count = scene.mesh(placement.mesh).triangles.len();
                for triangle in 0..count {
                    let corners = scene.triangle_at(placement, triangle);
                    let bounds = corners.into_iter().fold(Bounds::EMPTY, Bounds::with);
                    if overlap(&near, &bounds) {
                        triangles.push(Obstacle {
                            bounds,
                            scene: number as u32,
                            placement: index as u32,
                            triangle: triangle as u32,
                        });
                    }
                }
            }
        }
        let mut nodes = Vec::new();
        if !triangles.is_empty() {
            split(&mut triangles, 0, &mut nodes);
        }
        Self { scenes, triangles, nodes, tracer: Tracer::build(&scenes[0]) }
    }

    /// Whether a box meets one of the triangles.
    pub fn meet(&self, oriented: &OrientedBox) -> bool {
        let bounds = oriented.corners().into_iter().fold(Bounds::EMPTY, Bounds::with);
        // The corners are rounded, by no more than a few times the last digit of the largest coordinate.
        let margin = 16.0 * f64::EPSILON * bounds.largest();
        let bounds = Bounds { low: bounds.low - margin, high: bounds.high + margin };
        let mut waiting = if self.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(index) = waiting.pop() {
            let node = &self.nodes[index];
            if !overlap(&node.bounds, &bounds) {
                continue;
            }
            if node.second > 0 {
                waiting.extend([node.second, index + 1]);
                continue;
            }
            let mut near = self.triangles[node.from..node.to].iter().filter(|t| overlap(&t.bounds, &bounds));
            if near.any(|triangle| self.is_met(triangle, oriented)) {
                return true;
            }
        }
        false
    }

    /// Whether a point, in the world and in metres, is inside of something that is there in the first snapshot: most of what can be
    /// seen from there is the back of a triangle.
    pub fn enclose(&self, point: DVec3) -> bool {
        is_inside(&self.tracer, point)
    }

    fn is_met(&self, obstacle: &Obstacle, oriented: &OrientedBox) -> bool {
        let scene = &self.scenes[obstacle.scene as usize];
        let placement = &scene.arrangement.placements[obstacle.placement as usize];
        box_meets_triangle(oriented, scene.triangle_at(placement, obstacle.triangle as usize))
    }
}

/// Whether a placement of a later snapshot is in the first one, too.
fn stands_still(first: &Scene, scene: &Scene, placement: &Placement) -> bool {
    let placements = &first.arrangement.placements;
    let is_shape = placement.mesh as usize >= scene.geometry.meshes.len();
    // Placements rise by their first triangle; only an empty mesh shares its own with the next.
    let from = placements.partition_point(|other| other.first_triangle < placement.first_triangle);
    !is_shape
        && placements[from..]
            .iter()
            .take_while(|other| other.first_triangle == placement.first_triangle)
            .any(|other| other == placement)
}

fn overlap(a: &Bounds, b: &Bounds) -> bool {
    a.low.cmple(b.high).all() && b.low.cmple(a.high).all()
}

/// Adds the node of triangles that begin at an index of all, and those below it.
fn split(triangles: &mut [Obstacle], from: usize, nodes: &mut Vec<Node>) {
    let bounds = triangles.iter().fold(Bounds::EMPTY, |all, one| all.union(one.bounds));
    let own = nodes.len();
    nodes.push(Node { bounds, from, to: from + triangles.len(), second: 0 });
    if triangles.len() <= LEAF {
        return;
    }
    let size = bounds.high - bounds.low;
    let axis = (0..3).fold(0, |best, axis| if size[axis] > size[best] { axis } else { best });
    let middle = |one: &Obstacle| one.bounds.low[axis] + one.bounds.high[axis];
    let half = triangles.len() / 2;
    triangles.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
    let (first, second) = triangles.split_at_mut(half);
    split(first, from, nodes);
    nodes[own].second = nodes.len();
    split(second, from + half, nodes);
}
