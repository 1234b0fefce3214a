//! The ways of light from the sensor to what it meets, and back: through holes and panes, and by mirrors.

use glam::DVec3;

use super::light::{IDEAL_SAMPLE, Light, PATHS_A_SAMPLE, Target};
use super::receive::fall;
use crate::scan::optics::{Meeting, Split, split};
use crate::scan::ray_batch::{Ray, RayBatch};
use crate::scan::{Cause, surface::LastSeen, through::is_same_depth};
use crate::scene::{Scene, Surface};
use crate::sensor::{Pulse, Receiver};
use crate::trace::{Cast, Hit};

/// The share of light, both ways, below which a path is not followed.
const LEAST_SHARE: f64 = 1e-9;

/// The length of a way from which on power falls with its square, in metres. Nearer surfaces send back what one there does.
const LEAST_LENGTH_M: f64 = 1e-3;

/// The most surfaces that a path goes through.
const MOST_PASSES: u8 = 64;

/// The distance from a mirror at which a reflected ray begins, in metres along the ray, at a right angle to the mirror. It is far
/// above the error of the point where the ray meets the mirror (10⁻⁹ m at 200 m), so that the ray does not meet the mirror
/// again.
const CLEARANCE_M: f64 = 1e-6;

/// Rays that are cast as one batch, each with its way so far.
pub(super) type Wave = RayBatch<Way>;

/// The way of a ray so far.
#[derive(Clone, Copy)]
pub(super) struct Way {
    /// The number of the pulse in its strip.
    pub pulse: u32,
    /// The number of the sub-ray.
    pub sample: u16,
    /// The number of the surfaces that were met before.
    met: u8,
    bounces: u8,
    passes: u8,
    cause: Cause,
    /// The share of the light, both ways, that the surfaces on the way leave.
    share: f64,
    /// The length of the way to the ray's origin, in metres.
    length_m: f64,
    /// The depth and the surface of the hit that the ray went through last.
    through: Option<(f64, Surface)>,
}

impl Way {
    /// The way of a sub-ray that leaves the sensor.
    pub fn of(pulse: u32, sample: u16) -> Self {
        let (cause, share) = (Cause::Surface, 1.0);
        Self { pulse, sample, met: 0, bounces: 0, passes: 0, cause, share, length_m: 0.0, through: None }
    }
}

/// What the paths of a sensor's light have in common.
pub(super) struct Paths<'a, C> {
    pub scene: &'a Scene,
    pub tracer: &'a C,
    pub receiver: &'a Receiver,
    /// The energy of a white Lambertian plane at 1 m that takes a whole sub-ray, in clear air.
    pub white_at_1_m: f64,
    /// The extinction of the air, a metre.
    pub extinction_per_m: f64,
    /// The roughness below which a glossy lobe is narrower than the beam.
    pub mirror_roughness: f64,
}

/// What comes back from the pulses of a strip.
pub(super) struct Back<'m> {
    pub pulses: &'m [Pulse],
    /// The light, in the order in which it is found.
    pub lights: &'m mut Vec<Light>,
    /// The range of the ideal ray of each pulse, if it meets something.
    pub ideal: &'m mut [f64],
}

/// Where a ray meets a surface.
struct Arrival<'h> {
    way: Way,
    ray: Ray,
    hit: &'h Hit,
    surface: Surface,
    /// The surface's normal on the side of the light.
    normal: DVec3,
    /// The share of the surface that is there, by its texture's alpha.
    cover: f64,
}

/// The memory of waves, which is kept from strip to strip.
#[derive(Default)]
pub(super) struct Waves {
    /// The rays that leave the sensor, at first.
    pub first: Wave,
    next: Wave,
    hits: Vec<Option<Hit>>,
}

impl<'a, C: Cast> Paths<'a, C> {
    /// Follows the rays of the first wave, and those that surfaces make of them, until no light is left. Adds what comes back to
    /// `back`. Returns the number of rays.
    pub fn follow(&self, waves: &mut Waves, back: &mut Back) -> usize {
        let Waves { first: wave, next, hits } = waves;
        let mut rays = 0;
        while !wave.is_empty() {
            rays += wave.len();
            wave.cast(self.scene, self.tracer, hits);
            next.clear();
            let mut last = LastSeen::default();
            for (ray, (way, hit)) in wave.known().iter().zip(hits.iter()).enumerate() {
                if let Some(hit) = hit {
                    self.meet(*way, wave.ray(ray), hit, &mut last, back, next);
                }
            }
            std::mem::swap(wave, next);
        }
        rays
    }

    fn meet(&self, way: Way, ray: Ray, hit: &Hit, last: &mut LastSeen<'a>, back: &mut Back, next: &mut Wave) {
        let length_m = way.length_m + hit.t;
        let (seen, optics, appearance) = last.at(self.scene, hit);
        let surface = seen.surface();
        if way.through.is_some_and(|(depth, last)| last == surface && is_same_depth(depth, hit.t)) {
            // The ray passes an edge of a surface, and meets the triangles on both of its sides. It went through it before.
            next.push(way, ray, Some(*hit));
            return;
        }
        let along = hit.normal.dot(ray.direction);
        let normal = if along > 0.0 { -hit.normal } else { hit.normal };
        let cosine = along.abs().min(1.0);
        let at = Meeting {
            cosine,
            length_m,
            spacing_m: self.receiver.spacing_m,
            wavelength_m: self.receiver.wavelength_m,
            mirror_roughness: self.mirror_roughness,
        };
        let split = split(&appearance, optics, at);
        let cover = f64::from(appearance.cover);
        let returned = cover * split.back;
        let pulse = &back.pulses[way.pulse as usize];
        if way.sample == IDEAL_SAMPLE {
            let ideal_m = &mut back.ideal[way.pulse as usize];
            if returned > 0.0 && ideal_m.is_infinite() {
                *ideal_m = pulse.range_m(length_m);
            }
        } else if returned > 0.0 {
            let fall = fall(self.receiver, length_m.max(LEAST_LENGTH_M));
            let clear_air = match self.extinction_per_m > 0.0 {
                true => libm::exp(2.0 * self.extinction_per_m * length_m),
                false => 1.0,
            };
            let energy = way.share * returned * self.white_at_1_m / (fall * clear_air);
            // Through kilometres of fog no number is left of it.
            if energy > 0.0 {
                back.lights.push(Light {
                    pulse: way.pulse,
                    path: u32::from(way.sample) * PATHS_A_SAMPLE + u32::from(way.met),
                    range_m: pulse.range_m(length_m),
                    length_m,
                    energy,
                    clear_air,
                    cause: way.cause,
                    target: Target {
                        point: ray.origin + ray.direction * hit.t,
                        normal,
                        reflectance: split.reflectance as f32,
                        object: surface.object,
                        label: seen.label(),
                        triangle: seen.id(),
                    },
                });
            }
        }
        self.go_on(&Arrival { way, ray, hit, surface, normal, cover }, &split, next);
    }

    /// Adds the rays that go on from a surface to the next wave.
    fn go_on(&self, at: &Arrival, split: &Split, next: &mut Wave) {
        let &Arrival { way, ray, hit, surface, normal, cover } = at;
        let Ray { origin, direction, time_s } = ray;
        let met = way.met.saturating_add(1);
        let through = Some((hit.t, surface));
        let can_pass = way.passes < MOST_PASSES && way.met < u8::MAX - 1;
        // What is not covered lets light through as air does, both ways.
        let uncovered = (1.0 - cover) * (1.0 - cover);
        if uncovered > 0.0 && way.share * uncovered > LEAST_SHARE && can_pass {
            let on = Way { met, share: way.share * uncovered, passes: way.passes + 1, through, ..way };
            next.push(on, ray, Some(*hit));
        }
        if way.sample == IDEAL_SAMPLE && cover > 0.0 && split.back > 0.0 {
            return;
        }
        let passed = way.share * cover * split.passed;
        if passed > LEAST_SHARE && can_pass {
            let on = Way {
                met,
                share: passed,
                passes: way.passes + 1,
                cause: split.passed_cause.unwrap_or(way.cause),
                length_m: way.length_m + split.delay_m,
                through,
                ..way
            };
            // A pane moves the ray sideways, towards the normal that points away from the light.
            let aside = -normal - direction * direction.dot(-normal);
            let shift = if split.shift_m > 0.0 && aside.length_squared() > 1e-24 {
                aside.normalize() * split.shift_m
            } else {
                DVec3::ZERO
            };
            next.push(on, Ray { origin: origin + shift, ..ray }, Some(*hit));
        }
        let mirrored = way.share * cover * split.mirrored;
        if mirrored > LEAST_SHARE && u32::from(way.bounces) < self.receiver.bounces && way.met < u8::MAX - 1 {
            let reflected = direction - 2.0 * direction.dot(normal) * normal;
            let start_m = CLEARANCE_M / reflected.dot(normal).abs().max(1e-3);
            let on = Way {
                met,
                share: mirrored,
                bounces: way.bounces + 1,
                cause: split.mirrored_cause,
                length_m: way.length_m + hit.t + start_m,
                through: None,
                ..way
            };
            let start = origin + direction * hit.t + reflected * start_m;
            next.push(on, Ray { origin: start, direction: reflected, time_s }, None);
        }
    }
}
