//! The second viewpoint of a stereo camera: which surfaces it sees.

use glam::DVec3;

use super::sight::Sights;
use crate::scan::ideal::{Batch, Strip};
use crate::scan::strips::SensorPose;
use crate::scene::Scene;
use crate::sensor::Capture;
use crate::trace::Cast;

/// A viewpoint beside the camera's own, with the same axes.
pub(super) struct Second<'a, C> {
    pub scene: &'a Scene,
    pub tracer: &'a C,
    /// Its place in the sensor's body frame, in metres.
    pub place: DVec3,
    /// The camera's pose, if it stands still.
    fixed: Option<SensorPose>,
}

impl<'a, C: Cast> Second<'a, C> {
    /// The viewpoint so many metres to the right of a capture's camera, along the rows of the image.
    pub fn to_the_right(scene: &'a Scene, tracer: &'a C, capture: &Capture, right_m: f64) -> Self {
        // The body frame's y is to the left.
        let place = DVec3::new(0.0, -right_m, 0.0);
        let fixed = capture.fixed_world_from_sensor().map(SensorPose::new);
        Self { scene, tracer, place, fixed }
    }

    /// The camera's pose for a ray of a strip.
    pub fn pose<'p>(&'p self, batch: &'p Batch, ray: usize) -> &'p SensorPose {
        self.fixed.as_ref().unwrap_or_else(|| &batch.poses[ray])
    }

    /// The numbers, in an image of so many columns, of the strip's pixels whose surfaces are hidden from the second viewpoint, in the
    /// order of the rays.
    pub fn hidden(&self, strip: &Strip, batch: &Batch, columns: usize) -> Vec<u32> {
        let (mut seen, mut sights) = (Vec::new(), Sights::default());
        for (number, hit) in batch.hits.iter().enumerate() {
            let Some(hit) = hit else { continue };
            let ray = batch.rays.ray(number);
            let place = self.pose(batch, number).world_from_sensor.point(self.place);
            sights.push(place, ray.origin + ray.direction * hit.t, ray.time_s);
            seen.push(number);
        }
        let blocked = sights.are_blocked(self.scene, self.tracer);
        let is_blocked = seen.iter().zip(blocked).filter(|(_, is_blocked)| **is_blocked);
        is_blocked.map(|(&ray, _)| strip.pixel(batch, ray, columns)).collect()
    }
}
