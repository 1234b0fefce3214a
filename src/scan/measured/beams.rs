//! The rays of a pulse: the sub-rays of its footprint, in the direction that the pulse really takes.

use glam::DVec3;

use crate::rng::FrameStreams;
use crate::scan::effects::{EVERY_FRAME, Effect};
use crate::sensor::{Capture, Footprint, Pulse};

/// The constants of one beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beam {
    /// The bias of its ranges in metres.
    pub bias_m: f64,
    /// The factor on the power that it receives: its own [`power`](Self::power), and the gain that the sensor doesn't know of.
    pub gain: f64,
    /// The factor on its power by the data sheet, which the sensor's intensities count in.
    pub power: f64,
    /// The error of its direction: the slopes along the two axes of [`axes`].
    offset: [f64; 2],
}

/// The beams and the footprint of a sensor, and the random numbers of one frame.
pub(super) struct Beams<'c> {
    capture: &'c Capture<'c>,
    pub streams: FrameStreams,
    /// One a row of the image, or one for all rows.
    beams: Vec<Beam>,
    /// The standard deviation of a pulse's slopes.
    pulse_sigma: f64,
    /// The slopes and the offsets at the exit of the sub-rays, along the two axes of [`axes`], the beam's axis first.
    sub_rays: Vec<SubRay>,
}

struct SubRay {
    slope: [f64; 2],
    exit_m: [f64; 2],
}

/// A ray that leaves the sensor, in its body frame.
pub(super) struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
}

impl<'c> Beams<'c> {
    pub fn new(capture: &'c Capture<'c>) -> Self {
        let measurement = &capture.sensor.measurement;
        let noise = measurement.noise.unwrap_or_default();
        let of_beams = FrameStreams::new(capture.seed, capture.index, EVERY_FRAME);
        let receiver = measurement.receiver.as_ref();
        let is_dimmer = receiver.is_some_and(|receiver| !receiver.beams.is_empty());
        let differs = is_dimmer || noise.bias_m > 0.0 || noise.gain > 0.0 || noise.beam_angle.radians() > 0.0;
        let beam = |row: usize| {
            let stream = |effect: Effect| of_beams.stream(row as u32, 0, effect as u32);
            let mut angle = stream(Effect::BeamAngle);
            let slope = libm::tan(noise.beam_angle.radians());
            let power = receiver.map_or(1.0, |receiver| receiver.power(row));
            Beam {
                bias_m: noise.bias_m * stream(Effect::BeamBias).normal(),
                gain: power * libm::exp(noise.gain * stream(Effect::BeamGain).normal()),
                power,
                offset: [slope * angle.normal(), slope * angle.normal()],
            }
        };
        let beams = match differs {
            true => (0..capture.rows()).map(beam).collect(),
            false => vec![Beam { bias_m: 0.0, gain: 1.0, power: 1.0, offset: [0.0; 2] }],
        };
        let axis_alone = || vec![SubRay { slope: [0.0; 2], exit_m: [0.0; 2] }];
        Self {
            capture,
            streams: FrameStreams::new(capture.seed, capture.index, capture.frame),
            beams,
            pulse_sigma: libm::tan(noise.angle.radians()),
            sub_rays: measurement.footprint.as_ref().map_or_else(axis_alone, sub_rays),
        }
    }

    /// The number of sub-rays of a pulse.
    pub fn samples(&self) -> usize {
        self.sub_rays.len()
    }

    /// Whether pulses go elsewhere than the sensor believes, so that the ideal ray is another than the axis.
    pub fn are_off(&self) -> bool {
        self.pulse_sigma > 0.0 || self.beams.iter().any(|beam| beam.offset != [0.0; 2])
    }

    /// The constants of the beam of a row.
    pub fn beam(&self, row: usize) -> &Beam {
        self.beams.get(row).unwrap_or(&self.beams[0])
    }

    /// The sub-rays of a pixel's pulse. The first is the beam's axis.
    pub fn rays(&self, row: usize, column: usize, pulse: &Pulse) -> impl Iterator<Item = Ray> {
        let [mut x, mut y] = self.beam(row).offset;
        if self.pulse_sigma > 0.0 {
            let pixel = (row * self.capture.columns() + column) as u32;
            let mut stream = self.streams.stream(pixel, 0, Effect::PulseAngle as u32);
            x += self.pulse_sigma * stream.normal();
            y += self.pulse_sigma * stream.normal();
        }
        let &Pulse { origin, direction, .. } = pulse;
        let is_axis_alone = self.sub_rays.len() == 1 && [x, y] == [0.0; 2];
        let [h, v] = if is_axis_alone { [DVec3::ZERO; 2] } else { axes(direction) };
        self.sub_rays.iter().map(move |SubRay { slope, exit_m }| {
            if is_axis_alone {
                return Ray { origin, direction };
            }
            let slope = [x + slope[0], y + slope[1]];
            Ray {
                origin: origin + h * exit_m[0] + v * exit_m[1],
                direction: (direction + h * slope[0] + v * slope[1]).normalize(),
            }
        })
    }
}

fn sub_rays(footprint: &Footprint) -> Vec<SubRay> {
    let slope = footprint.half_divergence.map(|half| libm::tan(half.radians()));
    let exit_m = footprint.exit_radius_m;
    let of_place =
        |[x, y]: [f64; 2]| SubRay { slope: [x * slope[0], y * slope[1]], exit_m: [x * exit_m, y * exit_m] };
    footprint.samples.places().into_iter().map(of_place).collect()
}

/// The axes of a beam's cross-section: horizontally to the left, at right angles to the beam and to the sensor's z, and upwards. A
/// beam along z has the sensor's y for the first.
fn axes(direction: DVec3) -> [DVec3; 2] {
    let across = DVec3::Z.cross(direction);
    let h = if across.length_squared() < 1e-18 { DVec3::Y } else { across.normalize() };
    [h, direction.cross(h)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axes_of_a_beam_are_to_the_left_and_upwards() {
        assert_eq!(axes(DVec3::X), [DVec3::Y, DVec3::Z]);
        for direction in [DVec3::new(0.6, -0.48, 0.64), DVec3::Z, DVec3::NEG_Z, DVec3::new(1e-12, 0.0, 1.0)] {
            let [h, v] = axes(direction);
            assert!((h.length() - 1.0).abs() < 1e-12 && (v.length() - 1.0).abs() < 1e-12);
            assert!(h.dot(direction).abs() < 1e-12 && h.dot(v).abs() < 1e-12);
        }
    }
}
