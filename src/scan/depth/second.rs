//! The second viewpoint of a stereo camera: which surfaces it sees.

use glam::DVec3;

use crate::scan::through::Through;
use crate::scan::{Batch, SensorPose, Strip};
use crate::scene::Scene;
use crate::sensor::Capture;
use crate::trace::{Cast, Origins, Rays};

/// The share of the way to a surface at which a line of sight ends, so that the surface does not block the sight of itself: it ends
/// 0.1 mm before a surface at 10 m. The hits of two rays at one point of a triangle differ by 10⁻¹⁵ of their depths.
const NEARLY_ALL: f64 = 1.0 - 1e-5;

/// A viewpoint beside the camera's own, with the same axes.
pub(super) struct Second<'a, C> {
    pub scene: &'a Scene,
    pub tracer: &'a C,
    /// Its place in the sensor's body frame, in metres.
    pub place: DVec3,
    /// The camera's pose, if it stands still.
    pub fixed: Option<SensorPose>,
}

impl<'a, C: Cast> Second<'a, C> {
    /// The viewpoint so many metres to the right of a capture's camera, along the rows of the image.
    pub fn to_the_right(scene: &'a Scene, tracer: &'a C, capture: &Capture, right_m: f64) -> Self {
        // The body frame's y is to the left.
        let place = DVec3::new(0.0, -right_m, 0.0);
        let fixed = capture.fixed_world_from_sensor().map(SensorPose::new);
        Self { scene, tracer, place, fixed }
    }

    /// The numbers, in an image of so many columns, of the strip's pixels whose surfaces are hidden from the second viewpoint.
    pub fn hidden(&self, strip: &Strip, batch: &Batch, columns: usize) -> Vec<u32> {
        let (mut rays, mut origins, mut directions, mut times_s) = (vec![], vec![], vec![], vec![]);
        let place_at = |ray: usize| {
            let pose = self.fixed.as_ref().unwrap_or_else(|| &batch.poses[ray]);
            pose.world_from_sensor.point(self.place)
        };
        for (ray, hit) in batch.hits.iter().enumerate() {
            let Some(hit) = hit else { continue };
            let (from, to) = (place_at(ray), batch.origins[ray] + batch.directions[ray] * hit.t);
            rays.push(ray);
            origins.push(from);
            directions.push(to - from);
            times_s.extend(batch.times_s.get(ray));
        }
        let common = origins.first().copied().filter(|first| origins.iter().all(|o| o == first));
        let sights = Rays {
            origins: common.map_or(Origins::Each(&origins), Origins::Common),
            directions: &directions,
            t_min: 0.0,
            t_max: NEARLY_ALL,
            after: None,
            times_s: (!times_s.is_empty()).then_some(&times_s[..]),
        };
        let blocked = self.blocked(&sights);
        let is_blocked = rays.iter().zip(blocked).filter(|(_, is_blocked)| *is_blocked);
        is_blocked.map(|(&ray, _)| strip.pixel(batch, ray, columns)).collect()
    }

    /// Whether something blocks each line of sight. Holes and thin panes do not.
    pub fn blocked(&self, sights: &Rays) -> Vec<bool> {
        let mut blocked = vec![false; sights.directions.len()];
        if !self.scene.is_see_through() {
            self.tracer.blocked(sights, &mut blocked);
            return blocked;
        }
        let mut hits = vec![None; blocked.len()];
        self.tracer.cast(sights, &mut hits);
        let mut through = Through::default();
        through.look(self.scene, self.tracer, sights, &mut hits, |_, _| std::cmp::Ordering::Equal);
        for (ray, hit) in hits.iter().enumerate() {
            // A pane that takes less than half of the light leaves the surface behind it the larger part.
            blocked[ray] = hit.is_some() && through.share(ray) >= 0.5;
        }
        blocked
    }
}
