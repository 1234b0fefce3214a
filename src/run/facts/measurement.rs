//! How far and how precisely a sensor measures, from its receiver and its noise.

use serde::Serialize;

use crate::sensor::{DimmerBeams, Measurement, RangeLimits};

/// The facts about how a sensor measures, by the range pairs of its receiver.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasurementFacts {
    /// Whether the figures are those of the data sheet, from `[nominal]`.
    pub is_nominal: bool,
    /// The range in metres, within the sensor's limits, up to which a plane of 10 % reflectance is detected.
    pub range_10_m: f64,
    /// The same of a plane of 80 %.
    pub range_80_m: f64,
    /// The rows whose beams see less far, if there are any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub beams: Vec<BeamsFacts>,
    /// The probability of detection at these ranges.
    pub detection: f64,
    /// The exponent by which power falls with the range, which is 2 by physics.
    pub exponent: f64,
    /// The largest relative error of the range that the fit gives for a pair.
    pub misfit: f64,
    /// The number of false alarms to expect in a frame.
    pub false_alarms_per_frame: f64,
    /// The standard deviations of ranges to a plane of 80 %, at those of 10, 50 and 100 m at which it is detected.
    pub range_sigmas: Vec<RangeSigma>,
    /// The facts about a receiver that counts photons; `None` of one that measures power.
    pub spad: Option<SpadFacts>,
}

/// The facts about a receiver that counts photons, under the sunlight of its range pairs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpadFacts {
    /// The cycles of a histogram.
    pub cycles: u32,
    /// The width of a bin in metres.
    pub bin_m: f64,
    /// The least number of counts in a gate that is detected at the range up to which a plane of 80 % is.
    pub least_counts: u32,
    /// The share of the cycles in which background has blinded the detector before that range.
    pub blind: f64,
    /// How much nearer planes of 80 % seem by pile-up, at those of 5, 20 and 50 m at which one is detected.
    pub shifts: Vec<RangeShift>,
}

/// The shift of a range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RangeShift {
    /// The range in metres.
    pub range_m: f64,
    /// Its shift in metres, which is negative.
    pub shift_m: f64,
}

/// How far some of a sensor's beams see.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeamsFacts {
    /// The rows of the image, from 0.
    pub rows: Vec<usize>,
    /// The range in metres, within the sensor's limits, up to which a plane of 10 % reflectance is detected.
    pub range_10_m: f64,
    /// The same of a plane of 80 %.
    pub range_80_m: f64,
    /// The largest relative error of the range for a pair of theirs.
    pub misfit: f64,
}

/// The standard deviation of a range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RangeSigma {
    /// The range in metres.
    pub range_m: f64,
    /// Its standard deviation in metres.
    pub sigma_m: f64,
}

impl MeasurementFacts {
    /// The facts about a measurement in frames of so many rays. `None` if there are no range pairs.
    pub fn of(measurement: &Measurement, range: RangeLimits, rays: u64, is_nominal: bool) -> Option<Self> {
        let receiver = measurement.receiver.as_ref()?;
        let sensitivity = receiver.sensitivity?;
        let counter = receiver.counter(range.max_m, 1.0);
        let reach = |reflectance: f64| match &counter {
            Some(counter) => counter.range_m(reflectance, receiver.detection, range.max_m),
            None => sensitivity.range_m(reflectance).min(range.max_m),
        };
        let range_80_m = reach(0.8);
        let noise = measurement.noise.unwrap_or_default();
        let plane = |range_m: f64| counter.as_ref().and_then(|counter| counter.plane(0.8, range_m));
        let sigma = |range_m: f64| {
            let own_m = noise.range_sigma_m(receiver.snr(0.8, range_m, range.max_m));
            let of_counts_m = plane(range_m).map_or(0.0, |plane| plane.sigma_m);
            let both_m = (own_m * own_m + of_counts_m * of_counts_m).sqrt();
            RangeSigma { range_m, sigma_m: if counter.is_some() { both_m } else { own_m } }
        };
        let of_beams = |DimmerBeams { rows, power, misfit, .. }: &DimmerBeams| BeamsFacts {
            rows: rows.clone(),
            range_10_m: reach(power * 0.1),
            range_80_m: reach(power * 0.8),
            misfit: *misfit,
        };
        let is_detected = |range_m: &f64| (range.min_m..=range_80_m).contains(range_m);
        let spad = receiver.spad.zip(plane(range_80_m)).map(|(spad, farthest)| SpadFacts {
            cycles: spad.cycles,
            bin_m: spad.bin_m(),
            least_counts: farthest.least,
            blind: farthest.blind,
            shifts: [5.0, 20.0, 50.0]
                .into_iter()
                .filter(is_detected)
                .filter_map(|range_m| Some(RangeShift { range_m, shift_m: plane(range_m)?.shift_m }))
                .collect(),
        });
        Some(Self {
            is_nominal,
            range_10_m: reach(0.1),
            range_80_m,
            beams: receiver.beams.iter().map(of_beams).collect(),
            detection: receiver.detection,
            exponent: sensitivity.exponent,
            misfit: sensitivity.misfit,
            false_alarms_per_frame: receiver.false_alarm * rays as f64,
            range_sigmas: [10.0, 50.0, 100.0].into_iter().filter(is_detected).map(sigma).collect(),
            spad,
        })
    }
}
