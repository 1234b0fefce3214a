//! What the imagers of a stereo camera see: surfaces in the light of the projector, of ambient light and of the sun.

use glam::DVec3;

use super::second::Second;
use super::shade::{Lit, Shader};
use crate::scan::Progress;
use crate::scan::frame::Frame;
use crate::scan::ideal::{Batch, Strip, scan_ideal};
use crate::scan::ray_batch::Ray;
use crate::scan::strips::SensorPose;
use crate::scan::sunlight::{Place, sunlight};
use crate::scene::Scene;
use crate::sensor::{Capture, Imager, Projector};
use crate::trace::Cast;

/// A lit pixel.
struct Seen {
    /// The pixel's number.
    pixel: u32,
    /// The grey value before the exposure is set.
    grey: f32,
}

/// The light of a stereo camera's scene.
pub(super) struct Light<'a, C> {
    pub scene: &'a Scene,
    pub tracer: &'a C,
    pub imager: &'a Imager,
    pub projector: Option<&'a Projector>,
}

impl<C: Cast> Light<'_, C> {
    /// The grey values that an imager sees before the exposure is set, row by row, and its ideal frame. `capture` is the imager's own,
    /// which is `right_m` metres to the right of the camera's. `None` if `progress.cancelled` was set before the end.
    pub fn seen(
        &self,
        capture: &Capture,
        right_m: f64,
        ideal: &mut Frame,
        progress: &Progress,
    ) -> Option<Vec<f32>> {
        let offset_m = self.projector.map_or(0.0, |projector| projector.offset_m - right_m);
        let source = Second::to_the_right(self.scene, self.tracer, capture, offset_m);
        let columns = capture.columns();
        let strips = scan_ideal(ideal, self.scene, self.tracer, capture, progress, |strip, batch| {
            self.of_strip(capture, strip, batch, &source)
        })?;
        let mut grey = vec![0.0; capture.rows() * columns];
        for Seen { pixel, grey: value } in strips.into_iter().flatten() {
            grey[pixel as usize] = value;
        }
        Some(grey)
    }

    fn of_strip(&self, capture: &Capture, strip: &Strip, batch: &Batch, source: &Second<C>) -> Vec<Seen> {
        let columns = capture.columns();
        let mut shader = Shader::new(self.scene, self.imager.wavelength_m);
        let mut seen = Vec::new();
        let mut lit: Vec<Lit> = Vec::new();
        let mut rays = Vec::new();
        for (ray, hit) in batch.hits.iter().enumerate() {
            let Some(hit) = hit else { continue };
            let place = source.pose(batch, ray).world_from_sensor.point(source.place);
            let Ray { origin, direction, .. } = batch.rays.ray(ray);
            let one = shader.light(origin, direction, hit, Some(place));
            seen.push(Seen {
                pixel: strip.pixel(batch, ray, columns),
                grey: (self.imager.ambient * one.diffuse * batch.through.share(ray)) as f32,
            });
            lit.push(one);
            rays.push(ray);
        }
        if self.imager.sun > 0.0
            && let Some(sun) = self.scene.environment.sun
        {
            let place = |(lit, &ray): (&Lit, &usize)| lit.place(batch.rays.ray(ray).time_s);
            let places: Vec<Place> = lit.iter().zip(&rays).map(place).collect();
            let of_sun = sunlight(self.scene, self.tracer, &sun, &places);
            for (seen, share) in seen.iter_mut().zip(of_sun) {
                seen.grey += (self.imager.sun * share) as f32;
            }
        }
        if let Some(projector) = self.projector {
            let hidden = source.hidden(strip, batch, columns);
            let mut hidden = hidden.into_iter().peekable();
            for ((seen, lit), &ray) in seen.iter_mut().zip(&lit).zip(&rays) {
                // Both lists have the order of the rays.
                if hidden.next_if_eq(&seen.pixel).is_some() || lit.back <= 0.0 {
                    continue;
                }
                let pose = source.pose(batch, ray);
                let (row, column) = (seen.pixel as usize / columns, seen.pixel as usize % columns);
                let pixel = SeenPixel { capture, row, column, origin: batch.rays.ray(ray).origin, pose };
                let irradiance = self.pattern(&pixel, lit, source, projector);
                seen.grey +=
                    (self.imager.projected_at_1_m * lit.back * irradiance * batch.through.share(ray)) as f32;
            }
        }
        seen
    }

    /// The projector's light on a pixel, over its mean at 1 m: the mean of the pattern over what the pixel sees of it, by the square of
    /// the distance.
    ///
    /// On a plane the inverse of depth is linear in the image, and so is its place in the projector's: the image of a pixel there is a
    /// parallelogram between two lines along the rows. It is taken for the rectangle between the middles of its slanted sides, whose
    /// slope is b/Z times the tangent of the surface's tilt: a hundredth, as a rule.
    fn pattern(&self, pixel: &SeenPixel, lit: &Lit, source: &Second<C>, projector: &Projector) -> f64 {
        let SeenPixel { capture, row, column, origin, pose } = *pixel;
        let depth = lit.normal.dot(lit.point - origin);
        let corner = |place: [f64; 2]| {
            let direction = pose.world_from_sensor.direction(capture.direction_in_pixel(row, column, place)?);
            let t = depth / lit.normal.dot(direction);
            let point = pose.sensor_from_world.point(origin + direction * t) - source.place;
            // The body's y is to the left, and its z is up.
            (t > 0.0 && point.x > 0.0).then(|| [-point.y / point.x, point.z / point.x])
        };
        let from_projector = pose.sensor_from_world.point(lit.point) - source.place;
        let corners = [[-0.5, 0.0], [0.5, 0.0], [0.0, 0.5], [0.0, -0.5]].map(corner);
        let [Some(left), Some(right), Some(bottom), Some(top)] = corners else { return 0.0 };
        let (lower, upper) = ([left[0].min(right[0]), bottom[1]], [left[0].max(right[0]), top[1]]);
        if !(lower[0] < upper[0] && lower[1] < upper[1]) || from_projector.x <= 0.0 {
            return 0.0; // the surface is seen edge-on
        }
        let [x, y] = [0, 1].map(|axis| 0.5 * (lower[axis] + upper[axis]));
        let flood = if projector.lights([x, y]) { projector.flood } else { 0.0 };
        let pattern = &projector.pattern;
        let pattern = pattern.irradiance_over(lower, upper) / pattern.mean();
        (flood + (1.0 - projector.flood) * pattern) / from_projector.length_squared()
    }
}

/// A pixel whose ray hits a surface.
#[derive(Clone, Copy)]
struct SeenPixel<'a> {
    capture: &'a Capture<'a>,
    row: usize,
    column: usize,
    /// Where its ray begins, in the world.
    origin: DVec3,
    pose: &'a SensorPose,
}
