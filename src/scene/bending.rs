//! What it costs that a mesh which bends keeps its shape for a slice of time.

use glam::DVec3;

use super::arrangement::Scene;
use crate::motion::Window;

/// How far a mesh that bends gets from the shape that it has for a slice of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slicing {
    /// The distance, in metres of the world.
    pub distance_m: f64,
    /// The object: an index into [`Geometry::objects`](super::Geometry::objects).
    pub object: u32,
}

/// The most slices of a window that are looked at.
const MOST_SLICES: usize = 8;

impl Scene {
    /// How far vertices of meshes that bend get from where [`Scene::during`] has them, at most: the largest distance between a
    /// vertex at the beginning or the end of a slice and in the slice's middle, whose shape counts for all of it. It is measured
    /// there and not in between, which a vertex that swings back within a slice would pass farther away. Of many slices eight are
    /// looked at. `None` if nothing bends.
    pub fn slicing(&self, window: Window, slice_s: Option<f64>) -> Option<Slicing> {
        let slices = window.slices(slice_s);
        let looked_at = slices.min(MOST_SLICES);
        let mut farthest: Option<Slicing> = None;
        for mover in &self.geometry.movers {
            let Some(deformer) = &mover.deformer else { continue };
            let mut distance_m = 0.0_f64;
            for number in 0..looked_at {
                let slice = number * slices / looked_at;
                let [from_s, to_s] = [slice, slice + 1].map(|end| window.end_of_slice(end, slices));
                let middle_s = from_s / 2.0 + to_s / 2.0;
                let Some(middle) = deformer.shape_at(middle_s) else { continue };
                let world_from_mesh = mover.motion.map_at(middle_s).matrix3;
                for end in [from_s, to_s].into_iter().filter_map(|time_s| deformer.shape_at(time_s)) {
                    for (a, b) in end.iter().zip(&middle) {
                        let moved = DVec3::from_array(a.map(f64::from)) - DVec3::from_array(b.map(f64::from));
                        // `max` leaves out what is no number.
                        distance_m = distance_m.max((world_from_mesh * moved).length());
                    }
                }
            }
            if farthest.is_none_or(|farthest| distance_m > farthest.distance_m) {
                farthest = Some(Slicing { distance_m, object: mover.object });
            }
        }
        farthest
    }
}
