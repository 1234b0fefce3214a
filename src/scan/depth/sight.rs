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

/// Lines of sight. The memory is kept from batch to batch.
pub(super) struct Sights {
    /// Each with its number. Its direction reaches from one point to the other.
    rays: RayBatch<u32>,
    hits: Vec<Option<Hit>>,
    through: Through,
    blocked: Vec<bool>,
}

impl Default for Sights {
    fn default() -> Self {
        Self {
            rays: RayBatch::limited_to(NEARLY_ALL),
            hits: vec![],
            through: Through::default(),
            blocked: vec![],
        }
    }
}

impl Sights {
    /// Forgets all lines.
    pub fn clear(&mut self) {
        self.rays.clear();
    }

    /// Adds a line of sight at a time on the scene's clock.
    pub fn push(&mut self, from: DVec3, to: DVec3, time_s: f64) {
        // Between two points that are one there is nothing: a direction of length 0 hits nothing.
        self.rays.push(self.rays.len() as u32, Ray { origin: from, direction: to - from, time_s }, None);
    }

    /// Whether something blocks each line, in the order in which they were added. Holes do not, and panes that take less than half of
    /// the light do not: the surface behind them has the larger part.
    pub fn are_blocked(&mut self, scene: &Scene, tracer: &impl Cast) -> &[bool] {
        let Self { rays, hits, through, blocked } = self;
        rays.cast(scene, tracer, hits);
        through.clear();
        if scene.is_see_through() {
            through.look(scene, tracer, rays, hits, |_, _| Ordering::Equal);
        }
        blocked.clear();
        blocked.resize(hits.len(), false);
        for (ray, (hit, &number)) in hits.iter().zip(rays.known()).enumerate() {
            blocked[number as usize] = hit.is_some() && through.share(ray) >= 0.5;
        }
        blocked
    }

    /// Sorts lines from one point by their directions, so that the tracer can take neighbours together.
    pub fn sort(&mut self) {
        self.rays.sort_by_direction(6);
    }
}
