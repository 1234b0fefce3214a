//! How a depth camera finds the depth of its pixels: by the disparity of a second viewpoint, or by the time of flight of modulated
//! light.

use std::sync::Arc;

use super::Camera;
use crate::angle::Angle;
use crate::matching::Settings;
use crate::physics::disparity::StereoPair;
use crate::physics::dots::{Dots, Field, Projected};
use crate::physics::phasor::{Phasor, range_m as range_of_phase_m};
use crate::rng::Rng;

/// How a depth camera finds depth. Without it a camera is ideal: its depth is exact.
#[derive(Clone, Debug, PartialEq)]
pub enum DepthSensing {
    /// By the disparity between two viewpoints.
    Stereo(Stereo),
    /// By the phase of light whose intensity is modulated.
    TimeOfFlight(TimeOfFlight),
}

impl DepthSensing {
    /// The time in seconds before and after a pixel's own time in which it gathers light, too.
    pub fn half_exposure_s(&self) -> f64 {
        match self {
            Self::Stereo(_) => 0.0,
            Self::TimeOfFlight(sensing) => 0.5 * sensing.exposure_s,
        }
    }
}

/// A camera that sees, or lights, the scene from two viewpoints a baseline apart, and finds depth by the disparity between them. Its
/// images are rectified: both viewpoints have the same intrinsics and axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Stereo {
    /// What is at the second viewpoint.
    pub second: SecondViewpoint,
    /// The distance from the camera to the second viewpoint along the image's rows, in metres: positive to the right, negative to the
    /// left, and not 0.
    pub baseline_m: f64,
    /// The least disparity that is searched, in pixels.
    pub first_disparity_px: u32,
    /// The number of whole disparities that are searched.
    pub disparities: u32,
    /// The unit of the disparities that are reported, in pixels; 0: they are not rounded.
    pub unit_px: f64,
    /// How disparities are found.
    pub method: StereoMethod,
}

/// What is at the second viewpoint of a stereo camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SecondViewpoint {
    /// An imager with the camera's own intrinsics.
    Imager,
    /// The projector of structured light, whose pattern covers the camera's image.
    Projector,
}

/// How a stereo camera finds disparities.
#[derive(Clone, Debug, PartialEq)]
pub enum StereoMethod {
    /// From the exact depth, with noise, holes and rounding.
    Analytic(AnalyticDisparity),
    /// By matching the images that the camera's two imagers see.
    Match(Matching),
}

/// Disparities that are found from the exact depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalyticDisparity {
    /// The standard deviation of a disparity, in pixels.
    pub sigma_px: f64,
    /// The side of the window in which a pixel's neighbours have to have nearly its disparity, in pixels; 1: no window is looked at.
    pub window_px: u32,
    /// The difference of disparities within the window that counts as the same surface, in pixels.
    pub inlier_px: f64,
    /// The share of the window's pixels that have to be of the same surface, 0 to 1.
    pub inlier_share: f64,
}

/// The images of a stereo camera, and how they are matched.
#[derive(Clone, Debug, PartialEq)]
pub struct Matching {
    /// The pattern projector; `None`: the camera is passive.
    pub projector: Option<Projector>,
    /// The imagers.
    pub imager: Imager,
    /// The settings of the matcher. The disparities that are searched are those of [`Stereo`].
    pub settings: Settings,
}

/// A projector of a pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct Projector {
    /// The distance from the camera to the projector along the image's rows to the right, in metres.
    pub offset_m: f64,
    /// The rectangle that the pattern lights.
    pub field: Field,
    /// The pattern. Of its irradiance only the ratio to the mean counts.
    pub pattern: Arc<Projected>,
    /// The share of the light that is spread evenly over the field, 0 to 1.
    pub flood: f64,
}

/// The imagers of a stereo camera. Grey values are 0 to 255.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imager {
    /// The wavelength in metres.
    pub wavelength_m: f64,
    /// The mean grey value to which the exposure brings the image of the camera's own viewpoint. `None`: the exposure is fixed.
    pub auto_level: Option<f64>,
    /// The mean grey value that the projector's light gives a white plane at 1 m, before the exposure is set.
    pub projected_at_1_m: f64,
    /// The grey value that ambient light gives a white plane, before the exposure is set.
    pub ambient: f64,
    /// The grey value that sunlight of 100 klx gives a white plane that faces it, before the exposure is set.
    pub sun: f64,
    /// The factor on the noise of the images; 1 is that which was measured of the Kinect's imager.
    pub noise: f64,
}

impl Projector {
    /// The field of a pattern that has these full angles, horizontal and vertical, each less than 180°.
    pub fn field_of(full: [Angle; 2]) -> Field {
        let [half_width, half_height] = full.map(|angle| libm::tan(0.5 * angle.radians()));
        Field { half_width, half_height }
    }

    /// About so many dots at places that follow from a seed, each of this full width at half of its maximum.
    pub fn dots(field: Field, count: u32, width: Angle, seed: u64) -> Projected {
        /// The part of a cell of the dots' grid that a dot's centre may lie in: dots keep a distance of a third of the cell.
        const SPREAD: f64 = 0.67;
        // The irradiance of a Gaussian beam falls to half at √(ln 2/2) of the radius at 1/e².
        let radius = 0.5 * libm::tan(width.radians()) / (0.5 * std::f64::consts::LN_2).sqrt();
        let mut stream = Rng::new(seed);
        Projected::Dots(Dots::scattered(field, radius, count as usize, SPREAD, || stream.unit()))
    }

    /// Whether a place is in the field: the tangents to the right and up.
    pub fn lights(&self, [right, up]: [f64; 2]) -> bool {
        let Field { half_width, half_height } = self.field;
        right.abs() <= half_width && up.abs() <= half_height
    }
}

impl Stereo {
    /// The geometry of the two viewpoints of a camera, by which depth and disparity follow from each other.
    pub fn pair(&self, camera: &Camera) -> StereoPair {
        StereoPair { focal_px: camera.focal_px().0, baseline_m: self.baseline_m.abs() }
    }

    /// The disparities that are searched, in pixels: from the first, which is among them, to the second, which is not.
    pub fn searched_px(&self) -> [f64; 2] {
        let first = f64::from(self.first_disparity_px);
        [first, first + f64::from(self.disparities)]
    }

    /// The standard deviation of a disparity that the camera is told to have, in pixels; `None` if it matches images, so that the
    /// scene decides.
    pub fn sigma_px(&self) -> Option<f64> {
        match &self.method {
            StereoMethod::Analytic(analytic) => Some(analytic.sigma_px),
            StereoMethod::Match(_) => None,
        }
    }
}

/// A camera that lights the scene with light of modulated intensity, and finds depth by the phase in which it comes back.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeOfFlight {
    /// The frequencies of modulation in hertz, one to three.
    pub frequencies_hz: Vec<f64>,
    /// The wavelength in metres.
    pub wavelength_m: f64,
    /// The electrons that the camera's own light from a white plane at 1 m frees in a pixel, in all taps of one frequency.
    pub electrons_at_1_m: f64,
    /// The contrast of demodulation, 0 to 1.
    pub contrast: f64,
    /// The electrons that sunlight of 100 klx on a white plane frees in a pixel, in all taps of one frequency.
    pub sun_electrons: f64,
    /// The standard deviation of the noise of reading a tap, in electrons.
    pub read_noise: f64,
    /// The electrons that a tap holds; infinite if it never saturates.
    pub full_well: f64,
    /// The taps of a pixel at each frequency, 3 or more, spread evenly over a period.
    pub taps: u32,
    /// The side of the square of sub-rays of a pixel.
    pub samples: u32,
    /// The rays for indirect light of each sub-ray's hit; 0: there is only direct light.
    pub indirect_rays: u32,
    /// The most surfaces that indirect light comes by before the one that the pixel sees, 1 or more.
    pub bounces: u32,
    /// The amplitude of the third harmonic of the modulation over that of the first, which makes ranges wiggle.
    pub third_harmonic: f64,
    /// The least amplitude of a pixel with depth, in electrons.
    pub least_amplitude: f64,
    /// The time in seconds over which a pixel gathers light, about its own time; 0: it gathers all light at once.
    pub exposure_s: f64,
    /// The largest disagreement between the depths of the frequencies, in metres; infinite if they may disagree.
    pub disagreement_m: f64,
}

impl TimeOfFlight {
    /// The standard deviation in metres of the range of one surface at `range_m`, whose light frees so many electrons in all taps of
    /// a frequency, without other light and as long as its phases are unwrapped rightly.
    ///
    /// Of N electrons in all n taps, σ_φ = √(2·(N + n·r²))/(m·N) with the contrast m and the read noise r
    /// ([`phase_sigma`](crate::physics::phasor::Demodulated::phase_sigma)). Three taps multiply the variance by
    /// k = 1 − m·N/(2·(N + n·r²))·cos 3φ. The frequencies' ranges are averaged with the weights w = 1/σ² that leave k out, so that the
    /// variance of the mean is Σw·k/(Σw)².
    pub fn range_sigma_m(&self, electrons: f64, range_m: f64) -> f64 {
        let counted = electrons + f64::from(self.taps) * self.read_noise * self.read_noise;
        let phase_sigma = (2.0 * counted).sqrt() / (self.contrast * electrons);
        let (mut weights, mut variance) = (0.0, 0.0);
        for &frequency_hz in &self.frequencies_hz {
            let sigma_m = range_of_phase_m(phase_sigma, frequency_hz);
            let weight = 1.0 / (sigma_m * sigma_m);
            let of_taps = if self.taps == 3 {
                let cos = Phasor::of_path(1.0, 2.0 * range_m, frequency_hz).re;
                let cos_of_triple = cos * (4.0 * cos * cos - 3.0);
                1.0 - 0.5 * self.contrast * electrons / counted * cos_of_triple
            } else {
                1.0
            };
            weights += weight;
            variance += weight * of_taps;
        }
        variance.sqrt() / weights
    }

    /// The time of a sub-ray from the pixel's own time, in seconds. The sub-rays of the square are numbered row by row.
    ///
    /// The exposure has as many equal parts as there are sub-rays, and each sub-ray is cast in the middle of one. The parts are dealt out
    /// by a Latin square: with n sub-rays a side, the n of each n-th of the exposure lie in n rows and n columns, so that what
    /// moves in any direction is seen in all places at all times, as far as n² sub-rays can.
    pub fn time_of_sample_s(&self, sample: usize) -> f64 {
        let side = self.samples as usize;
        let (row, column) = (sample / side, sample % side);
        let part = (row + column) % side * side + column;
        self.exposure_s * ((part as f64 + 0.5) / (side * side) as f64 - 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each part of the exposure has one sub-ray, its mean is the pixel's own time, and an n-th of it sees all rows and all columns.
    #[test]
    fn each_part_of_an_exposure_has_a_sub_ray_and_each_nth_all_rows_and_columns() {
        for side in 1..=8_usize {
            let sensing = TimeOfFlight {
                frequencies_hz: vec![1e8],
                wavelength_m: 850e-9,
                electrons_at_1_m: 1e6,
                contrast: 1.0,
                sun_electrons: 0.0,
                read_noise: 0.0,
                full_well: f64::INFINITY,
                taps: 4,
                samples: side as u32,
                indirect_rays: 0,
                bounces: 1,
                third_harmonic: 0.0,
                least_amplitude: 0.0,
                exposure_s: 2.0,
                disagreement_m: f64::INFINITY,
            };
            let count = side * side;
            let part = |sample: usize| {
                (((sensing.time_of_sample_s(sample) / 2.0 + 0.5) * count as f64 - 0.5).round()) as usize
            };
            let mut by_part: Vec<usize> = (0..count).collect();
            by_part.sort_by_key(|&sample| part(sample));
            assert!((0..count).all(|number| part(by_part[number]) == number));
            for nth in by_part.chunks(side) {
                for of in [|i: usize, side: usize| i / side, |i, side| i % side] {
                    let mut lines: Vec<usize> = nth.iter().map(|&sample| of(sample, side)).collect();
                    lines.sort_unstable();
                    assert_eq!(lines, (0..side).collect::<Vec<_>>());
                }
            }
        }
    }
}
