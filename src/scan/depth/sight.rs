//! Lines of sight from one point of a scene to another.

use std::cmp::Ordering;

use glam::DVec3;

use crate::scan::ray_batch::{DirectionOrder, Ray, RayBatch, TOGETHER};
use crate::scan::through::Through;
use crate::scene::Scene;
use crate::trace::{Cast, Hit};

/// The share of the way at which a line of sight ends, so that the surface that it leads to does not block it: 0.1 mm before one at
/// 10 m. The hits of two rays at one point of a triangle differ by 10⁻¹⁵ of their depths.
const NEARLY_ALL: f64 = 1.0 - 1e-5;

/// Lines of sight. The memory is kept from batch to batch.
pub(super) struct Sights {
    /// The direction of a line reaches from one point to the other.
    rays: RayBatch<()>,
    /// The order in which the lines are cast, if it is not their own.
    order: DirectionOrder,
    some: RayBatch<()>,
    of_some: Vec<bool>,
    hits: Vec<Option<Hit>>,
    through: Through,
    blocked: Vec<bool>,
}

impl Default for Sights {
    fn default() -> Self {
        Self {
            rays: RayBatch::limited_to(NEARLY_ALL),
            order: DirectionOrder::default(),
            some: RayBatch::limited_to(NEARLY_ALL),
            of_some: vec![],
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
        self.rays.push((), Ray { origin: from, direction: to - from, time_s }, None);
    }

    /// Whether something blocks each line, in the order in which they were added, which is that of neighbours. Holes do not, and panes
    /// that take less than half of the light do not: the surface behind them has the larger part.
    pub fn are_blocked(&mut self, scene: &Scene, tracer: &impl Cast) -> &[bool] {
        let Self { rays, hits, through, blocked, .. } = self;
        find_blocked(rays, scene, tracer, (hits, through), blocked);
        blocked
    }

    /// [`Sights::are_blocked`] for lines from one point in any order. They are cast in the order of their directions, so that the tracer
    /// can take neighbours together.
    pub fn are_blocked_in_any_order(&mut self, scene: &Scene, tracer: &impl Cast) -> &[bool] {
        let Self { rays, order, some, of_some, hits, through, blocked } = self;
        blocked.clear();
        blocked.resize(rays.len(), false);
        for numbers in order.of(rays, 6).chunks(TOGETHER) {
            some.take(rays, numbers);
            find_blocked(some, scene, tracer, (hits, through), of_some);
            for (&number, &is_blocked) in numbers.iter().zip(&*of_some) {
                blocked[number as usize] = is_blocked;
            }
        }
        blocked
    }
}

/// Writes whether something blocks each line.
fn find_blocked(
    rays: &RayBatch<()>,
    scene: &Scene,
    tracer: &impl Cast,
    (hits, through): (&mut Vec<Option<Hit>>, &mut Through),
    blocked: &mut Vec<bool>,
) {
    if !scene.is_see_through() {
        return rays.find_blocked(scene, tracer, blocked);
    }
    rays.cast(scene, tracer, hits);
    through.look(scene, tracer, rays, hits, |_, _| Ordering::Equal);
    blocked.clear();
    blocked.extend(hits.iter().enumerate().map(|(ray, hit)| hit.is_some() && through.share(ray) >= 0.5));
}
