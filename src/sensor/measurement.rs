//! How a sensor measures: the width of its beams, its receiver, its noise. A sensor without any of it is ideal.

use super::DepthSensing;
use crate::angle::Angle;
use crate::physics::IntensityScale;
use crate::physics::detection::{RangePair, Sensitivity, normal_exceeded, range_sigma_m, threshold};
use crate::physics::footprint::Samples;

/// How a sensor measures. Each part that is absent is ideal, and a sensor without any part reports exact ranges.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurement {
    /// The width of the beams; `None`: rays without width.
    pub footprint: Option<Footprint>,
    /// The receiver; `None`: it detects the first surface on each ray, whatever the power.
    pub receiver: Option<Receiver>,
    /// The errors of ranges and directions; `None`: there are none.
    pub noise: Option<Noise>,
    /// The light that bright returns spread over neighbouring beams; `None`: there is none.
    pub blooming: Option<Blooming>,
    /// How a depth camera finds depth; `None`: its depth is exact. It excludes the other parts, which are a LiDAR's.
    pub depth: Option<DepthSensing>,
}

impl Measurement {
    /// Whether the sensor is ideal: it reports the exact range of one surface a pulse.
    pub fn is_ideal(&self) -> bool {
        self == &Self::default()
    }
}

/// The cross-section of a beam: a Gaussian profile, elliptical, whose horizontal axis is at a right angle to the beam and to the
/// sensor's z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Half of the full divergence at 1/e² of the irradiance, horizontally and vertically.
    pub half_divergence: [Angle; 2],
    /// The radius at 1/e² where the beam leaves the sensor, in metres, in both axes.
    pub exit_radius_m: f64,
    /// The number of sub-rays.
    pub samples: Samples,
}

/// A receiver: its sensitivity and how it turns light into returns.
#[derive(Clone, Debug, PartialEq)]
pub struct Receiver {
    /// The wavelength in metres.
    pub wavelength_m: f64,
    /// The ranges at which data sheets say that planes are detected; empty: the receiver detects any power.
    pub range_pairs: Vec<RangePair>,
    /// The sensitivity that follows from the pairs.
    pub sensitivity: Option<Sensitivity>,
    /// The rows of the image whose beams see less far than the pairs say; all others see as far.
    pub beams: Vec<DimmerBeams>,
    /// The probability of detection at the pairs, in (0, 1).
    pub detection: f64,
    /// The probability of a false alarm a pulse; 0: there are none, and the threshold is that of
    /// [`Receiver::FALSE_ALARM_OF_THRESHOLD`].
    pub false_alarm: f64,
    /// The full width at half maximum of a pulse, in seconds.
    pub pulse_fwhm_s: f64,
    /// The returns that are reported.
    pub returns: ReturnMode,
    /// The least distance between two returns of a pulse, in metres.
    pub separation_m: f64,
    /// The scale of intensities.
    pub intensity: IntensityScale,
    /// The distance between the transmitter's and the receiver's optical axes, in metres.
    pub spacing_m: f64,
    /// How far the light is followed through mirrors and panes: the number of reflections.
    pub bounces: u32,
    /// The share of a fixed threshold's range walk that is left after correction, 0 to 1.
    pub walk_residual: f64,
    /// The signal-to-noise ratio above which the receiver saturates; infinite if it never does.
    pub saturation_snr: f64,
    /// The share of the noise's variance that sunlight makes under the conditions of the range pairs, 0 to 1.
    pub sun_share: f64,
    /// The illuminance of the range pairs, in kilolux.
    pub sun_klx: f64,
    /// Foreign pulses that arrive, on average a second.
    pub interference_hz: f64,
    /// The mean signal-to-noise ratio of a foreign pulse.
    pub interference_snr: f64,
    /// The share of each return's energy that the other channels receive which fire at the same time; 0: none.
    pub crosstalk: f64,
    /// The interval of ranges, in metres, over which the fields of view of transmitter and receiver come to overlap. Near air is
    /// not seen before it.
    pub overlap_m: [f64; 2],
    /// How the receiver counts photons; `None`: it measures power, with noise of its own. [`Receiver::counting`] sets it.
    pub spad: Option<Spad>,
    /// The mean number of counts a cycle of a plane at the range of the nearest pair, if the receiver counts.
    pub limit_counts: f64,
}

/// Rows of the image whose beams see less far than most of their sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct DimmerBeams {
    /// The rows, from 0.
    pub rows: Vec<usize>,
    /// The ranges at which planes are detected by these beams.
    pub range_pairs: Vec<RangePair>,
    /// The factor on the power that these beams get, which follows from the pairs: above 0, and at most 1.
    pub power: f64,
    /// The largest relative error of the range that the factor gives for a pair.
    pub misfit: f64,
}

impl Receiver {
    /// The rate of false alarms that the threshold has where none are asked for.
    pub const FALSE_ALARM_OF_THRESHOLD: f64 = 1e-4;

    /// The threshold in standard deviations of the noise, which keeps false alarms as rare as they shall be in a range window
    /// of so many metres. Of a window without an end, the range at which a white plane is detected is the end.
    pub fn threshold(&self, window_m: f64) -> f64 {
        let end_m = match (window_m.is_finite(), &self.sensitivity) {
            (true, _) => window_m,
            (false, Some(sensitivity)) => sensitivity.range_m(1.0),
            (false, None) => 0.0,
        };
        threshold(self.false_alarm_of_threshold(), end_m, self.pulse_fwhm_s)
    }

    /// The probability of a false alarm that the threshold is made for.
    pub fn false_alarm_of_threshold(&self) -> f64 {
        if self.false_alarm > 0.0 { self.false_alarm } else { Self::FALSE_ALARM_OF_THRESHOLD }
    }

    /// The background in a scene with so many times the sunlight of the range pairs, relative to theirs.
    pub fn background(&self, sun: f64) -> f64 {
        1.0 - self.sun_share + self.sun_share * sun
    }

    /// The factor on the power that the beam of a row gets, relative to that of the range pairs.
    pub fn power(&self, row: usize) -> f64 {
        self.beams.iter().find(|beams| beams.rows.contains(&row)).map_or(1.0, |beams| beams.power)
    }

    /// The signal-to-noise ratio at a range pair: the threshold, and so much more that the stated share of pulses is detected.
    pub fn limit_snr(&self, window_m: f64) -> f64 {
        // Φ⁻¹(p) is the deviate that is exceeded with the probability 1 − p, so −normal_exceeded(p).
        self.threshold(window_m) - normal_exceeded(self.detection)
    }

    /// The signal-to-noise ratio of a target that fills the beam, in clear air. `factor` is the power that comes back from it,
    /// f·cos θ, relative to a white plane at a right angle, times the [power](Self::power) of the beam. It is infinite without range pairs, as such a receiver detects any
    /// power.
    ///
    /// At the range of a pair, the ratio exceeds the threshold by so much that the pair's probability of detection results.
    pub fn snr(&self, factor: f64, range_m: f64, window_m: f64) -> f64 {
        let Some(sensitivity) = &self.sensitivity else { return f64::INFINITY };
        self.limit_snr(window_m) * sensitivity.margin(factor, range_m)
    }
}

impl Default for Receiver {
    fn default() -> Self {
        Self {
            wavelength_m: 905e-9,
            range_pairs: Vec::new(),
            sensitivity: None,
            beams: Vec::new(),
            detection: 0.5,
            false_alarm: 0.0,
            pulse_fwhm_s: 5e-9,
            returns: ReturnMode::Strongest,
            separation_m: 0.0,
            intensity: IntensityScale::Ideal,
            spacing_m: 0.0,
            bounces: 3,
            walk_residual: 0.0,
            saturation_snr: f64::INFINITY,
            sun_share: 0.0,
            sun_klx: 100.0,
            interference_hz: 0.0,
            interference_snr: 20.0,
            crosstalk: 0.0,
            overlap_m: [0.9, 1.0],
            spad: None,
            limit_counts: 0.0,
        }
    }
}

/// How a receiver counts photons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spad {
    /// The cycles of a histogram: those of the laser times the diodes that look at the same place.
    pub cycles: u32,
    /// The width of a bin in seconds.
    pub bin_s: f64,
    /// The time for which a diode is blind after a count, in seconds; infinite: until the next cycle.
    pub dead_s: f64,
    /// The counts a second without the pulse, of sunlight and in the dark, under the conditions of the range pairs.
    pub background_hz: f64,
}

/// The returns that a receiver reports of a pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReturnMode {
    /// The one with the highest peak.
    Strongest,
    /// The nearest.
    First,
    /// The farthest.
    Last,
    /// The strongest, then the last; if that is the same one, the second strongest takes the last's place (Velodyne's rule).
    Dual,
    /// So many of the strongest, nearest first.
    Several(u32),
}

impl ReturnMode {
    /// The largest number of returns of a pulse.
    pub fn most(self) -> usize {
        match self {
            Self::Strongest | Self::First | Self::Last => 1,
            Self::Dual => 2,
            Self::Several(count) => count as usize,
        }
    }
}

/// The errors of ranges and directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// The standard deviation that a range has at any signal, in metres.
    pub range_floor_m: f64,
    /// The standard deviation that a range would have at a signal-to-noise ratio of 1, in metres. It adds to the floor in squares.
    pub range_a_m: f64,
    /// The exponent by which that falls with the signal-to-noise ratio.
    pub range_b: f64,
    /// The standard deviation of the beams' range biases, which are fixed by the seed, in metres.
    pub bias_m: f64,
    /// The standard deviation of the logarithm of the beams' gains, which are fixed by the seed.
    pub gain: f64,
    /// The standard deviation of the direction of each pulse, along each of two axes.
    pub angle: Angle,
    /// The standard deviation of the beams' directions, which are fixed by the seed, along each of two axes.
    pub beam_angle: Angle,
    /// The unit of ranges in metres, to a multiple of which they are rounded; 0: they are not.
    pub range_unit_m: f64,
}

impl Noise {
    /// The standard deviation of a range at a signal-to-noise ratio, in metres, without biases.
    pub fn range_sigma_m(&self, snr: f64) -> f64 {
        range_sigma_m(self.range_floor_m, self.range_a_m, self.range_b, snr)
    }
}

impl Default for Noise {
    fn default() -> Self {
        Self {
            range_floor_m: 0.0,
            range_a_m: 0.0,
            range_b: 0.6,
            bias_m: 0.0,
            gain: 0.0,
            angle: Angle::default(),
            beam_angle: Angle::default(),
            range_unit_m: 0.0,
        }
    }
}

/// The halo of a bright return in the directions beside it: h(Δ) = exp(−Δ²/2σ²) + A/(1 + (Δ/θ)²)^p, relative to the return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blooming {
    /// The standard deviation σ of the core.
    pub core: Angle,
    /// The height A of the halo.
    pub halo: f64,
    /// The width θ of the halo.
    pub halo_angle: Angle,
    /// The exponent p of the halo.
    pub exponent: f64,
    /// The angle beyond which the halo is left out.
    pub reach: Angle,
}

impl Blooming {
    /// The share of a return's energy that a receiver sees which looks at the angle Δ beside it, in radians.
    pub fn share(&self, angle_rad: f64) -> f64 {
        let core = angle_rad / self.core.radians();
        let halo = angle_rad / self.halo_angle.radians();
        let of_core = if self.core.radians() > 0.0 { libm::exp(-0.5 * core * core) } else { 0.0 };
        of_core + self.halo / libm::pow(1.0 + halo * halo, self.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At a pair's range the detection is the pair's; T = 4.81 is that of the formula's own test.
    #[test]
    fn the_ratio_at_a_pairs_range_gives_its_detection() {
        let pairs = vec![RangePair { reflectivity: 0.1, range_m: 90.0 }];
        let receiver = Receiver {
            sensitivity: Sensitivity::fit(&pairs),
            range_pairs: pairs,
            detection: 0.9,
            pulse_fwhm_s: 6e-9,
            ..Receiver::default()
        };
        let t = receiver.threshold(120.0);
        assert!((t - 4.8114).abs() < 1e-3, "{t}");
        let snr = receiver.snr(0.1, 90.0, 120.0);
        assert!((snr - 6.09).abs() < 5e-3, "{snr}");
        assert!((receiver.snr(0.1, 45.0, 120.0) / snr - 4.0).abs() < 1e-12);
        // A window without an end ends where a white plane does.
        let white_m = 90.0 * 10_f64.sqrt();
        assert!((receiver.threshold(f64::INFINITY) - receiver.threshold(white_m)).abs() < 1e-12);
        let any = Receiver::default();
        assert!(any.threshold(f64::INFINITY).is_finite() && any.snr(0.1, 10.0, 50.0) == f64::INFINITY);
    }
}
