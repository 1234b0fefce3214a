//! The waveforms of a frame: the light of every pulse, as its receiver gets it.

use crate::physics::echo::{Part, Waveform};
use crate::sensor::Sensor;

/// The waveforms of all pixels of a frame, each the exact sum of Gaussian pulses by range, never cut into bins:
/// Σ A·exp(−(r − r₀)²/2σ²). They are what [`explain`](super::explain) tells of each pixel, bit by bit, with the beam's gain, and
/// without noise: they are the means of what a receiver gets.
///
/// Amplitudes are signal-to-noise ratios if the receiver's sensitivity is known, and else relative to a white plane at 1 m that takes
/// the whole beam.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Waveforms {
    sigma_m: f64,
    threshold: Option<f64>,
    /// The place in `parts` of the first part of each pixel, and at the end their number.
    first: Vec<usize>,
    parts: Vec<Part>,
}

impl Waveforms {
    /// The parts that a sub-ray has in estimates: light that passes an edge, a pane or a mirror has several, and most has one.
    const PARTS_A_SAMPLE: usize = 2;

    /// The parts that a pulse has in estimates besides those of its sub-rays: air and halos send them.
    const OTHER_PARTS: usize = 2;

    /// The number of parts of a sensor's pulse, by which memory is estimated.
    pub fn parts_a_pulse(sensor: &Sensor) -> usize {
        let samples = sensor.measurement.footprint.map_or(1, |footprint| footprint.samples.count());
        Self::PARTS_A_SAMPLE * samples + Self::OTHER_PARTS
    }

    /// The memory of a pixel's waveform in a frame of a sensor, in bytes, by estimate. As a frame is, waveforms are put together of
    /// parts of the image, which take as much again.
    pub fn bytes_a_pixel(sensor: &Sensor) -> usize {
        2 * (Self::parts_a_pulse(sensor) * size_of::<Part>() + size_of::<usize>())
    }

    /// Begins the waveforms of a frame, to which pixels are added row by row. Memory that is there is used again.
    pub(super) fn begin(&mut self, sigma_m: f64, threshold: Option<f64>) {
        (self.sigma_m, self.threshold) = (sigma_m, threshold);
        self.parts.clear();
        self.first.clear();
        self.first.push(0);
    }

    /// Adds the waveform of the next pixel.
    pub(super) fn add(&mut self, parts: &[Part]) {
        self.parts.extend_from_slice(parts);
        self.first.push(self.parts.len());
    }

    /// The standard deviation of every Gaussian in range, in metres: that of the sensor's pulse.
    pub fn sigma_m(&self) -> f64 {
        self.sigma_m
    }

    /// The height that a peak with its noise must exceed, if the receiver's sensitivity is known. The noise then has the standard
    /// deviation 1.
    pub fn threshold(&self) -> Option<f64> {
        self.threshold
    }

    /// The Gaussians of all pixels, row by row, and of a pixel the nearest first.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The place among [`Waveforms::parts`] of each pixel's first Gaussian, and at the end their number: pixels + 1 entries.
    pub fn first(&self) -> &[usize] {
        &self.first
    }

    /// The Gaussians of a pixel by its number, the nearest first. A pixel that sends no pulse, or to which no light comes back, has
    /// none.
    pub fn of_pixel(&self, pixel: usize) -> &[Part] {
        &self.parts[self.first[pixel]..self.first[pixel + 1]]
    }

    /// The waveform of a pixel by its number, which gives heights and peaks.
    pub fn waveform(&self, pixel: usize) -> Waveform<'_> {
        Waveform::new(self.of_pixel(pixel), self.sigma_m)
    }
}
