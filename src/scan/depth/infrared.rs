//! What the imagers of a stereo camera see: surfaces in the light of the projector, of ambient light and of the sun.

use glam::DVec3;

use super::second::Second;
use super::shade::{Lit, Shader, sunlight};
use crate::physics::dots::Dots;
use crate::scan::frame::Frame;
use crate::scan::{Batch, Progress, SensorPose, Strip, scan_ideal};
use crate::scene::Scene;
use crate::sensor::{Capture, Imager, Projector};
use crate::trace::Cast;

/// The side of the square of points of a pixel at which the projector's pattern is looked up: dots are smaller than pixels.
const POINTS: usize = 3;

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
    pub projector: Option<(&'a Projector, &'a Dots)>,
}

impl<C: Cast> Light<'_, C> {
    /// The grey values that an imager `right_m` metres to the right of a capture's camera sees, before the exposure is set, row by
    /// row, and its ideal frame. `also` is asked of each strip. `None` if `progress.cancelled` was set before the end.
    pub fn seen<T: Send>(
        &self,
        capture: &Capture,
        right_m: f64,
        ideal: &mut Frame,
        progress: &Progress,
        also: impl Fn(&Strip, &Batch) -> T + Sync,
    ) -> Option<(Vec<f32>, Vec<T>)> {
        let offset_m = self.projector.map_or(0.0, |(projector, _)| projector.offset_m - right_m);
        let source = Second::to_the_right(self.scene, self.tracer, capture, offset_m);
        let columns = capture.columns();
        let strips = scan_ideal(ideal, self.scene, self.tracer, capture, progress, |strip, batch| {
            (self.of_strip(capture, strip, batch, &source), also(strip, batch))
        })?;
        let mut grey = vec![0.0; capture.rows() * columns];
        let mut answers = Vec::with_capacity(strips.len());
        for (seen, answer) in strips {
            for Seen { pixel, grey: value } in seen {
                grey[pixel as usize] = value;
            }
            answers.push(answer);
        }
        Some((grey, answers))
    }

    fn of_strip(&self, capture: &Capture, strip: &Strip, batch: &Batch, source: &Second<C>) -> Vec<Seen> {
        let mut shader = Shader::new(self.scene, self.imager.wavelength_m);
        let mut seen = Vec::new();
        let mut lit: Vec<Lit> = Vec::new();
        let mut rays = Vec::new();
        for (ray, hit) in batch.hits.iter().enumerate() {
            let Some(hit) = hit else { continue };
            let pose = source.fixed.as_ref().unwrap_or_else(|| &batch.poses[ray]);
            let place = pose.world_from_sensor.point(source.place);
            let one = shader.light(batch.origins[ray], batch.directions[ray], hit, Some(place));
            seen.push(Seen {
                pixel: strip.pixel(batch, ray, capture.columns()),
                grey: (self.imager.ambient * one.diffuse * batch.through.share(ray)) as f32,
            });
            lit.push(one);
            rays.push(ray);
        }
        if self.imager.sun > 0.0
            && let Some(sun) = self.scene.environment.sun
        {
            let times_s: Vec<f64> = rays.iter().filter_map(|&ray| batch.times_s.get(ray).copied()).collect();
            for (seen, share) in seen.iter_mut().zip(sunlight(self.tracer, &sun, &lit, &times_s)) {
                seen.grey += (self.imager.sun * share) as f32;
            }
        }
        if let Some((projector, dots)) = self.projector {
            let hidden = source.hidden(strip, batch, capture.columns());
            let mut hidden = hidden.into_iter().peekable();
            for ((seen, lit), &ray) in seen.iter_mut().zip(&lit).zip(&rays) {
                // Both lists have the order of the rays.
                if hidden.next_if_eq(&seen.pixel).is_some() || lit.back <= 0.0 {
                    continue;
                }
                let pose = source.fixed.as_ref().unwrap_or_else(|| &batch.poses[ray]);
                let irradiance = self.pattern(capture, strip, batch, ray, lit, pose, (projector, dots, source));
                seen.grey += (self.imager.projected_at_1_m * lit.back * irradiance * batch.through.share(ray)) as f32;
            }
        }
        seen
    }

    /// The projector's light on a pixel over that of its mean at 1 m: the pattern at points of the pixel, on the plane of the surface
    /// that its ray hits, by the square of the distance.
    #[expect(clippy::too_many_arguments, reason = "they name one pixel and one projector")]
    fn pattern(
        &self,
        capture: &Capture,
        strip: &Strip,
        batch: &Batch,
        ray: usize,
        lit: &Lit,
        pose: &SensorPose,
        (projector, dots, source): (&Projector, &Dots, &Second<C>),
    ) -> f64 {
        let pixel = strip.pixel(batch, ray, capture.columns()) as usize;
        let (row, column) = (pixel / capture.columns(), pixel % capture.columns());
        let origin = batch.origins[ray];
        let depth = lit.normal.dot(lit.point - origin);
        let place = |index: usize| (index as f64 + 0.5) / POINTS as f64 - 0.5;
        let mut sum = 0.0;
        for v in 0..POINTS {
            for u in 0..POINTS {
                let direction = capture.direction_in_pixel(row, column, [place(u), place(v)]);
                let along = direction.map(|d| pose.world_from_sensor.direction(d)).and_then(|direction| {
                    let t = depth / lit.normal.dot(direction);
                    (t > 0.0 && t.is_finite()).then(|| origin + direction * t)
                });
                // A surface that is seen edge-on ends within the pixel.
                let point = along.unwrap_or(lit.point);
                let from_projector = pose.sensor_from_world.point(point) - source.place;
                sum += relative_irradiance(projector, dots, from_projector);
            }
        }
        sum / (POINTS * POINTS) as f64
    }
}

/// The irradiance of a plane at a right angle to the projector's light, over the mean at 1 m. `from_projector` is the way to it in the
/// sensor's body frame, in metres.
fn relative_irradiance(projector: &Projector, dots: &Dots, from_projector: DVec3) -> f64 {
    let DVec3 { x, y, z } = from_projector;
    if x <= 0.0 {
        return 0.0;
    }
    // The body's y is to the left, and its z is up.
    let pattern = dots.relative(-y / x, -z / x);
    (projector.flood * dots.inside(-y / x, -z / x) + (1.0 - projector.flood) * pattern) / from_projector.length_squared()
}
