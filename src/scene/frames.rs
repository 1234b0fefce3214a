//! The scene at a time and during a frame.
//!
//! At one time a [`Mover`] is a placement like any other, or none if it is hidden. During a frame it is a placement whose map depends
//! on the time of each ray. A mesh that bends has a shape for each slice of the frame, and a placement for each of them, which
//! is seen only by rays of its slice; so all slices of a frame are one scene, and are cast together.

use std::sync::Arc;

use glam::DAffine3;
use rayon::prelude::*;

use super::arrangement::{Arrangement, Placement, Scene};
use super::geometry::Mesh;
use super::mover::{Mover, reach};
use super::moving::{Moving, placed};
use super::source::SceneBuilder;
use crate::motion::Window;

impl Scene {
    /// Whether anything in the scene changes over time.
    pub fn has_movers(&self) -> bool {
        !self.geometry.movers.is_empty()
    }

    /// The scene as it is at one time: a snapshot, in which nothing moves.
    pub fn at(&self, time_s: f64) -> Self {
        self.arranged(None, |mover, arrangement| {
            let Some(shape) = self.shape(mover, time_s) else { return };
            let (mesh, reach) = self.number(shape, arrangement);
            let maps = placed(&mover.motion, time_s, self.geometry.centre, reach);
            arrangement.placements.extend(maps.map(|maps| placement(mover, mesh, maps)));
        })
    }

    /// The scene during a frame, for rays that each have a time in the window
    /// ([`Rays::times_s`](crate::trace::Rays::times_s)). Meshes that move are where they are at each ray's own time. Meshes that bend have
    /// the shape of the middle of a slice of the window; a slice is no longer than `slice_s`, and is the whole window without that.
    ///
    /// Each slice costs a copy of the mesh, and a hierarchy of its own in the tracer, so the caller sees to it that there are few.
    pub fn during(&self, window: Window, slice_s: Option<f64>) -> Self {
        self.arranged(Some(window), |mover, arrangement| {
            let slices = if mover.deformer.is_some() { window.slices(slice_s) } else { 1 };
            // Both neighbours compute the end of a slice in the same way, so no time lies between them.
            let ends_of = |slice| [slice, slice + 1].map(|end| window.end_of_slice(end, slices));
            let middle_of = |slice| {
                let [from_s, to_s] = ends_of(slice);
                from_s / 2.0 + to_s / 2.0
            };
            let posed = |slice| {
                let [from_s, to_s] = ends_of(slice);
                if !mover.motion.is_visible_in(from_s, to_s) {
                    return None;
                }
                Some((slice, self.shape(mover, middle_of(slice))?))
            };
            let shapes: Vec<(usize, Shape)> = match slices {
                // There may be thousands of movers of one slice, for which threads are not worth waking.
                1 => posed(0).into_iter().collect(),
                _ => (0..slices).into_par_iter().filter_map(posed).collect(),
            };
            for (slice, shape) in shapes {
                let ([from_s, to_s], middle_s) = (ends_of(slice), middle_of(slice));
                let (mesh, reach) = self.number(shape, arrangement);
                let moving = Moving {
                    motion: mover.motion.clone(),
                    centre: self.geometry.centre,
                    from_s: if slice == 0 { f64::NEG_INFINITY } else { from_s },
                    until_s: if slice + 1 == slices { f64::INFINITY } else { to_s },
                    reach,
                };
                let maps = [middle_s, from_s, to_s].iter().find_map(|&time_s| moving.maps_at(time_s));
                let is_still = slices == 1 && mover.motion.fixed().is_some();
                if is_still && maps.is_none() {
                    continue;
                }
                let mut placed = placement(mover, mesh, maps.unwrap_or_default());
                placed.moving = (!is_still).then(|| Arc::new(moving));
                arrangement.placements.push(placed);
            }
        })
    }

    /// The scene with other placements of what moves, which `place` adds mover by mover.
    fn arranged(&self, window: Option<Window>, place: impl Fn(&Mover, &mut Arrangement)) -> Self {
        let movers = &self.geometry.movers;
        let is_mover = |p: &Placement| {
            let same = movers.binary_search_by_key(&p.first_triangle, |mover| mover.first_triangle);
            p.mesh >= self.geometry.regions && same.is_ok()
        };
        let mut arrangement = Arrangement {
            placements: Vec::with_capacity(self.arrangement.placements.len() + movers.len()),
            ..Arrangement::default()
        };
        let mut next = movers.iter().peekable();
        for placement in &self.arrangement.placements {
            if is_mover(placement) {
                continue;
            }
            while let Some(mover) = next.next_if(|mover| mover.first_triangle < placement.first_triangle) {
                place(mover, &mut arrangement);
            }
            arrangement.placements.push(placement.clone());
        }
        next.for_each(|mover| place(mover, &mut arrangement));
        arrangement.window = window.filter(|_| arrangement.placements.iter().any(Placement::is_moving));
        Self {
            geometry: self.geometry.clone(),
            arrangement: Arc::new(arrangement),
            environment: self.environment,
        }
    }

    /// The mesh of a mover at a time. `None` if it has no shape then, or one with a vertex that is not finite or farther than
    /// [`SceneBuilder::MAX_COORDINATE_M`].
    fn shape(&self, mover: &Mover, time_s: f64) -> Option<Shape> {
        let Some(deformer) = &mover.deformer else {
            return Some(Shape::AtRest { mesh: mover.mesh, reach: mover.reach });
        };
        let rest = &self.geometry.meshes[mover.mesh as usize];
        let all = deformer.shape_at(time_s)?;
        let positions: Vec<_> =
            mover.vertices.iter().map(|&v| all.get(v as usize).copied()).collect::<Option<_>>()?;
        let reach = reach(&positions);
        // False for NaN.
        let is_near = reach <= SceneBuilder::MAX_COORDINATE_M;
        is_near.then(|| {
            let Mesh { triangles, parts, corners, .. } = rest;
            let (triangles, parts, corners) = (triangles.clone(), parts.clone(), corners.clone());
            let mesh = Mesh { positions, triangles, parts, corners };
            Shape::Bent { mesh, reach }
        })
    }

    /// The number of a mover's mesh in the scene, and its largest |coordinate|. A new shape is added to those of the arrangement.
    fn number(&self, shape: Shape, arrangement: &mut Arrangement) -> (u32, f64) {
        match shape {
            Shape::AtRest { mesh, reach } => (mesh, reach),
            Shape::Bent { mesh, reach } => {
                arrangement.shapes.push(mesh);
                ((self.geometry.meshes.len() + arrangement.shapes.len() - 1) as u32, reach)
            }
        }
    }
}

/// The mesh of a mover at a time, with its largest |coordinate|.
enum Shape {
    /// The mesh of this number, as it is stored.
    AtRest { mesh: u32, reach: f64 },
    /// A shape of a mesh that bends.
    Bent { mesh: Mesh, reach: f64 },
}

/// A placement of a mover's mesh, or of a shape of it, given the maps to and from the scene's space.
fn placement(
    mover: &Mover,
    mesh: u32,
    (scene_from_mesh, mesh_from_scene): (DAffine3, DAffine3),
) -> Placement {
    Placement {
        mesh,
        first_triangle: mover.first_triangle,
        first_object: mover.object,
        scene_from_mesh,
        mesh_from_scene,
        moving: None,
    }
}
