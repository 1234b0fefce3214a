//! The air between sensor and surfaces: what it takes of the light, and what it sends back.

use glam::DVec3;

use super::light::{Light, PARTICLES, Target};
use crate::physics::particles::{
    LEAST_DIAMETER_M, cone_volume_m3, drop_face_reflectance, particle_echo, range_in_cone_m,
    share_of_gaussian_beam,
};
use crate::physics::soft_target::overlap;
use crate::physics::{PulseShape, SizeDistribution, SoftTarget, two_way_transmission};
use crate::rng::{FrameStreams, Rng};
use crate::scan::Cause;
use crate::scan::effects::Effect;
use crate::scene::Weather;
use crate::sensor::{Footprint, Pulse, Receiver};

/// The index of refraction of water at 905 nm (G. M. Hale and M. R. Querry 1973).
const WATER_INDEX: f64 = 1.328;

/// The reflectance of a flake of snow that takes the whole beam (M. Hahner et al. 2022).
const FLAKE_REFLECTANCE: f64 = 0.9;

/// The density of snowflakes relative to water.
const FLAKE_DENSITY: f64 = 0.1;

/// How many standard deviations of noise below the threshold a particle's echo may be and still be drawn. Fainter ones are detected
/// less than once in 30,000 times.
const BELOW_THRESHOLD: f64 = 4.0;

/// Particles are drawn within so many 1/e² radii of the beam's axis, which hold all but 1.1 % of its light.
const RADII: f64 = 1.5;

/// The most particles that one beam is expected to meet between a range and twice that range. Where there would be more, the
/// smaller ones are left out.
const MOST_EXPECTED: f64 = 64.0;

/// The weather as a receiver feels it.
pub(super) struct Air {
    /// The extinction of all there is, a metre.
    pub extinction_per_m: f64,
    /// The echo of fog and dust: its range, its energy and its cause.
    soft: Option<(f64, f64, Cause)>,
    swarms: Vec<Swarm>,
    overlap_m: [f64; 2],
}

/// The way of a pulse through the air.
pub(super) struct AirRay<'p> {
    /// The number of its pixel.
    pub pixel: u32,
    /// Its number in its strip.
    pub number: u32,
    pub pulse: &'p Pulse,
    /// Where it leaves the sensor, in the world.
    pub origin: DVec3,
    /// Its direction in the world.
    pub direction: DVec3,
    /// The length of its way to the nearest surface, in metres.
    pub nearest_m: f64,
}

/// The particles of one kind.
struct Swarm {
    sizes: SizeDistribution,
    reflectance: f64,
    cause: Cause,
    effect: Effect,
    shells: Vec<Shell>,
    footprint: Footprint,
}

/// A part of a beam between two ranges.
struct Shell {
    from_m: f64,
    to_m: f64,
    /// The least diameter of a particle that may be detected there.
    least_m: f64,
    /// The mean number of such particles.
    expected: f64,
}

impl Air {
    /// The air of a weather. `white_at_1_m` is the energy of a white plane at 1 m that takes the whole beam, and `threshold` the
    /// energy that is detected; a receiver that detects anything has none, and sees no particles.
    pub fn new(
        weather: Option<&Weather>,
        receiver: &Receiver,
        footprint: Option<Footprint>,
        white_at_1_m: f64,
        threshold: Option<f64>,
    ) -> Self {
        let clear =
            Self { extinction_per_m: 0.0, soft: None, swarms: Vec::new(), overlap_m: receiver.overlap_m };
        let (Some(weather), Some(threshold)) = (weather, threshold) else { return clear };
        let rain = (weather.rain_mm_h > 0.0).then(|| SizeDistribution::marshall_palmer(weather.rain_mm_h));
        let snow = (weather.snow_mm_h > 0.0)
            .then(|| SizeDistribution::gunn_marshall(weather.snow_mm_h).of_flakes(FLAKE_DENSITY));
        let fog = weather
            .visibility_m
            .map_or(0.0, |visibility_m| weather.haze.extinction_per_m(visibility_m, receiver.wavelength_m));
        let dust = weather.dust_per_m;
        let of = |sizes: &Option<SizeDistribution>| sizes.map_or(0.0, |sizes| sizes.extinction_per_m());
        let extinction_per_m = fog + dust + of(&rain) + of(&snow);
        let [of_fog, of_dust] = [fog / weather.lidar_ratio, dust / weather.dust_lidar_ratio];
        let soft = (of_fog + of_dust > 0.0).then(|| {
            // The echo of the sum, with the extinction of everything.
            let target = SoftTarget {
                extinction_per_m,
                lidar_ratio_sr: extinction_per_m / (of_fog + of_dust),
                overlap_from_m: receiver.overlap_m[0],
                overlap_to_m: receiver.overlap_m[1],
                until_m: f64::INFINITY,
            };
            let peak = target.peak(PulseShape::Gaussian { fwhm_s: receiver.pulse_fwhm_s });
            (peak.range_m, white_at_1_m * peak.echo, if of_fog >= of_dust { Cause::Fog } else { Cause::Dust })
        });
        let mut swarms = Vec::new();
        if let Some(footprint) = footprint {
            let mut add = |sizes, reflectance: f64, cause, effect| {
                let least = (threshold - BELOW_THRESHOLD).max(0.1) / (white_at_1_m * reflectance);
                let shells = shells(&sizes, &footprint, receiver, least);
                swarms.push(Swarm { sizes, reflectance, cause, effect, shells, footprint });
            };
            if let Some(rain) = rain {
                let reflectance = weather.drop_gain * drop_face_reflectance(WATER_INDEX);
                add(rain, reflectance, Cause::Rain, Effect::Rain);
            }
            if let Some(snow) = snow {
                add(snow, FLAKE_REFLECTANCE, Cause::Snow, Effect::Snow);
            }
        }
        Self { extinction_per_m, soft, swarms, ..clear }
    }

    /// Adds the light that comes back from the air before the nearest surface.
    pub fn add(&self, streams: &FrameStreams, ray: &AirRay, white_at_1_m: f64, lights: &mut Vec<Light>) {
        let &AirRay { pixel, number, pulse, origin, direction, nearest_m } = ray;
        let mut light = |path: u32, length_m: f64, energy: f64, cause: Cause| {
            lights.push(Light {
                pulse: number,
                path,
                range_m: pulse.range_m(length_m),
                length_m,
                energy,
                clear_air: 1.0 / two_way_transmission(self.extinction_per_m, length_m),
                cause,
                target: Target {
                    point: origin + direction * length_m,
                    normal: -direction,
                    ..Target::NOTHING
                },
            });
        };
        if let Some((length_m, energy, cause)) = self.soft
            && length_m < nearest_m
        {
            light(PARTICLES - 1, length_m, energy, cause);
        }
        let mut path = PARTICLES;
        for swarm in &self.swarms {
            let mut stream = streams.stream(pixel, 0, swarm.effect as u32);
            for shell in &swarm.shells {
                for _ in 0..poisson(&mut stream, shell.expected) {
                    let length_m = range_in_cone_m(shell.from_m, shell.to_m, stream.unit());
                    let diameter_m = swarm.sizes.diameter_m(shell.least_m, stream.unit());
                    let (radius, angle) =
                        (RADII * stream.unit().sqrt(), std::f64::consts::TAU * stream.unit());
                    path += 1;
                    if length_m >= nearest_m {
                        continue;
                    }
                    let radii = radii_m(&swarm.footprint, length_m);
                    let (sin, cos) = libm::sincos(angle);
                    let offset = [radii[0] * radius * cos, radii[1] * radius * sin];
                    let share = share_of_gaussian_beam(diameter_m, radii, offset);
                    let echo = particle_echo(swarm.reflectance, share, self.extinction_per_m, length_m);
                    let energy = white_at_1_m * echo * overlap(self.overlap_m, length_m);
                    if energy > 0.0 {
                        light(path, length_m, energy, swarm.cause);
                    }
                }
            }
            path = PARTICLES + (path - PARTICLES).next_multiple_of(1 << 12);
        }
    }
}

/// The 1/e² radii of a beam at a distance, in metres.
fn radii_m(footprint: &Footprint, length_m: f64) -> [f64; 2] {
    footprint.half_divergence.map(|half| footprint.exit_radius_m + length_m * libm::tan(half.radians()))
}

/// The parts of a beam in which particles may be detected: each ends at twice the range of its start. A particle at the beam's
/// axis is detected if its share of the beam over the square of its range is more than `least`.
fn shells(sizes: &SizeDistribution, footprint: &Footprint, receiver: &Receiver, least: f64) -> Vec<Shell> {
    let mut shells = Vec::new();
    let mut from_m = receiver.overlap_m[0].max(0.01);
    loop {
        let to_m = 2.0 * from_m;
        let radii = radii_m(footprint, from_m);
        let share = least * from_m * from_m;
        if share >= 1.0 {
            return shells;
        }
        // The share at the axis is D²/(2·w²).
        let mut least_m = (2.0 * share * radii[0] * radii[1]).sqrt().max(LEAST_DIAMETER_M);
        // A cone through the beam's cross-section at the far end: with a beam that has a width at its exit, it is too narrow near the
        // sensor by less than that width.
        let full = [0, 1].map(|axis| 2.0 * libm::atan(RADII * radii_m(footprint, to_m)[axis] / to_m));
        let volume_m3 = cone_volume_m3(full, from_m, to_m);
        let mut expected = sizes.expected_number(least_m, volume_m3);
        if expected > MOST_EXPECTED {
            least_m += libm::log(expected / MOST_EXPECTED) / sizes.slope_per_m;
            expected = MOST_EXPECTED;
        }
        // Fewer than one in 10⁹ pulses meet a particle that large.
        if expected < 1e-9 && least_m > LEAST_DIAMETER_M {
            return shells;
        }
        shells.push(Shell { from_m, to_m, least_m, expected });
        from_m = to_m;
    }
}

/// A number from Poisson's distribution: how many exponential gaps fit into the mean.
fn poisson(stream: &mut Rng, mean: f64) -> u32 {
    let mut count = 0;
    let mut sum = -libm::log(1.0 - stream.unit());
    while sum < mean {
        count += 1;
        sum -= libm::log(1.0 - stream.unit());
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean and the variance of 10⁵ draws, each within four standard errors.
    #[test]
    fn numbers_of_particles_are_poissons() {
        for mean in [0.05, 1.0, 7.5, 60.0] {
            let mut stream = Rng::new(11);
            let draws: Vec<f64> = (0..100_000).map(|_| f64::from(poisson(&mut stream, mean))).collect();
            let count = draws.len() as f64;
            let average = draws.iter().sum::<f64>() / count;
            let variance = draws.iter().map(|d| (d - average) * (d - average)).sum::<f64>() / count;
            assert!((average - mean).abs() < 4.0 * (mean / count).sqrt(), "{mean}: {average}");
            let error = ((mean + 2.0 * mean * mean) / count).sqrt();
            assert!((variance - mean).abs() < 4.0 * error, "{mean}: {variance}");
        }
    }
}
