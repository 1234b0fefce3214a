//! Lines of sight from one point of a scene to another.

use std::cmp::Ordering;

use glam::DVec3;

use crate::scan::ray_batch::{Ray, RayBatch};
use crate::scan::through::Through;
use crate::scene::Scene;
use crate::trace::{Cast, Hit};

/// The share of the way at which a line of sight ends, so that the surface that it leads to does not block it: 0.1 mm before one at
/// 10 m. The hits of two rays at one point of a triangle differ by 10⁻¹⁵ of their depths.
const NEARLY_ALL: f64 = 1.0 - 1e-5;

/// Lines of sight.
#[derive(Default)]
pub(super) struct Sights {
    /// Each with its number and its length in metres.
    rays: RayBatch<(u32, f64)>,
    hits: Vec<Option<Hit>>,
    through: Through,
}

impl Sights {
    /// Adds a line of sight at a time on the scene's clock.
    pub fn push(&mut self, from: DVec3, to: DVec3, time_s: f64) {
        let way = to - from;
        let length_m = way.length();
        // Between two points that are one there is nothing, whatever the direction.
        let direction = if length_m > 0.0 { way / length_m } else { DVec3::X };
        let number = self.rays.len() as u32;
        self.rays.push((number, length_m), Ray { origin: from, direction, time_s }, None);
    }

    /// Whether something blocks each line, in the order in which they were added. Holes do not, and panes that take less than half of
    /// the light do not: the surface behind them has the larger part.
    pub fn are_blocked(&mut self, scene: &Scene, tracer: &impl Cast) -> Vec<bool> {
        let Self { rays, hits, through } = self;
        rays.cast(scene, tracer, hits);
        through.clear();
        if scene.is_see_through() {
            through.look(scene, tracer, rays, hits, |_, _| Ordering::Equal);
        }
        let mut blocked = vec![false; hits.len()];
        for (ray, (hit, &(number, length_m))) in hits.iter().zip(rays.known()).enumerate() {
            let is_near = hit.as_ref().is_some_and(|hit| hit.t < NEARLY_ALL * length_m);
            blocked[number as usize] = is_near && through.share(ray) >= 0.5;
        }
        blocked
    }

    /// Sorts lines from one point by their directions, so that the tracer can take neighbours together.
    pub fn sort(&mut self) {
        self.rays.sort_by_direction(6);
    }
}
