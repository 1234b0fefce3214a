//! The receiver: from the light of a pulse to its returns.

use std::cmp::Ordering;

use super::beams::Beam;
use super::counts::{Counted, Gauge};
use super::light::{Light, Target};
use crate::physics::detection::walk_m;
use crate::physics::echo::{Part, Peak, Waveform, pulse_sigma_m};
use crate::physics::histogram::Exposure;
use crate::physics::{IntensityScale, SPEED_OF_LIGHT_M_S};
use crate::rng::FrameStreams;
use crate::scan::effects::Effect;
use crate::scan::{Cause, Echo, Return, Terms};
use crate::sensor::{Noise, Pulse, RangeLimits, Receiver, ReturnMode};

/// The share of a return's light from other surfaces than the main one, from which on the return counts as mixed.
const MIXED_SHARE: f64 = 0.1;

/// A receiver, ready to receive.
pub(super) struct Detector<'a> {
    pub receiver: &'a Receiver,
    pub noise: Noise,
    pub limits: RangeLimits,
    streams: FrameStreams,
    sigma_m: f64,
    /// The threshold in standard deviations of the noise, if the receiver's sensitivity is known.
    threshold: Option<f64>,
    /// The distance over which pulses are looked for.
    window_m: f64,
    /// The energy of a white Lambertian plane at 1 m that takes the whole beam.
    pub white_at_1_m: f64,
    /// What counts the light, if the receiver does not measure power.
    pub gauge: Option<Gauge>,
}

/// The memory of [`Detector::receive`].
#[derive(Default)]
pub(super) struct Scratch {
    parts: Vec<Part>,
    peaks: Vec<Peak>,
    candidates: Vec<Candidate>,
    exposure: Exposure,
    by_object: Vec<(u32, f64)>,
    shares: Vec<f64>,
}

/// What is told of light and of the fates of peaks. The frames of a scan need none of it, so that `()` is told it in vain, which
/// costs nothing.
pub(super) trait Watch {
    /// The light of a pulse arrives, sorted by range, and makes a waveform with a part for each light, in the same order.
    fn light(&mut self, _lights: &[Light], _parts: &[Part]) {}

    /// A peak is not detected, or lies outside of the limits of the sensor's range.
    fn lose(&mut self, _candidate: &Candidate, _cause: Cause) {}

    /// All that is detected, sorted by range.
    fn detect(&mut self, _candidates: &[Candidate]) {}

    /// What of it the receiver reports, in the order of the returns.
    fn choose(&mut self, _chosen: &[Candidate]) {}
}

impl Watch for () {}

/// Waveforms of one pulse after the other.
impl Watch for Vec<Part> {
    fn light(&mut self, _: &[Light], parts: &[Part]) {
        self.extend_from_slice(parts);
    }
}

/// A peak that may become a return.
#[derive(Clone, Copy)]
pub(super) struct Candidate {
    pub range_m: f64,
    /// The mean height.
    pub snr: f64,
    /// The height with this pulse's noise.
    pub amplitude: f64,
    /// The energy that the receiver takes the light for.
    light: f64,
    pub sigma_m: f64,
    pub cause: Cause,
    /// The path that random numbers follow from.
    pub path: u32,
    /// What the receiver counts, if it counts.
    pub counted: Option<Counted>,
    ideal_m: f64,
    length_m: f64,
    target: Target,
}

/// What becomes of a pulse.
#[derive(Default)]
pub(super) struct Received {
    pub cause: Cause,
    pub returns: Vec<(Return, Echo)>,
    /// The target of each return.
    pub targets: Vec<Target>,
}

/// The pulse of a pixel, at its receiver.
pub(super) struct Reception<'p> {
    /// The pixel's number.
    pub pixel: u32,
    pub pulse: &'p Pulse,
    pub beam: &'p Beam,
    /// The range of the ideal ray, infinite without a hit, if the pulse goes elsewhere than the sensor believes.
    pub ideal_m: Option<f64>,
    /// The map from directions in the world to those in the sensor's body frame.
    pub sensor_from_world: glam::DMat3,
}

impl<'a> Detector<'a> {
    pub fn new(
        receiver: &'a Receiver,
        noise: Noise,
        limits: RangeLimits,
        streams: FrameStreams,
        sun: f64,
    ) -> Self {
        let window_m = if limits.max_m.is_finite() { limits.max_m } else { 0.0 };
        let sigma_m = pulse_sigma_m(receiver.pulse_fwhm_s);
        let threshold = receiver.sensitivity.map(|_| receiver.threshold(limits.max_m));
        let gauge = Gauge::new(receiver, limits.max_m, sun);
        // Sunlight beyond that of the data sheet adds to the variance of the noise. What counts, counts it.
        let noise_sigma = if gauge.is_some() { 1.0 } else { receiver.background(sun).sqrt() };
        let white_at_1_m = match (receiver.sensitivity, threshold) {
            (Some(sensitivity), Some(_)) => {
                receiver.limit_snr(limits.max_m) / (sensitivity.least_power * noise_sigma)
            }
            _ => 1.0,
        };
        Self { receiver, noise, limits, streams, sigma_m, threshold, window_m, white_at_1_m, gauge }
    }

    /// The standard deviation of a pulse in range, in metres.
    pub fn sigma_m(&self) -> f64 {
        self.sigma_m
    }

    /// The energy that is detected, if the receiver's sensitivity is known.
    pub fn threshold(&self) -> Option<f64> {
        self.threshold
    }

    /// Makes returns of a pulse's light, which is sorted by range. `watch` is told what becomes of each peak.
    pub fn receive(
        &self,
        at: &Reception,
        lights: &[Light],
        scratch: &mut Scratch,
        received: &mut Received,
        watch: &mut impl Watch,
    ) {
        received.returns.clear();
        received.targets.clear();
        let Scratch { parts, peaks, candidates, exposure, by_object, shares } = scratch;
        parts.clear();
        parts.extend(
            lights.iter().map(|light| Part { range_m: light.range_m, energy: light.energy * at.beam.gain }),
        );
        watch.light(lights, parts);
        let waveform = Waveform::new(parts, self.sigma_m);
        waveform.peaks(peaks);
        candidates.clear();
        let mut fate = Fate::default();
        if let Some(gauge) = &self.gauge {
            gauge.expose(parts, exposure);
        }
        for (number, peak) in peaks.iter().enumerate() {
            let mut candidate = self.candidate(at, peak, lights, parts, &waveform, by_object, shares);
            if let (Some(gauge), Some(threshold)) = (&self.gauge, self.threshold) {
                let counts = self.stream(at, candidate.path, Effect::Counts);
                candidate.counted = gauge.count(exposure, peaks, number, counts);
                if let Some(counted) = &candidate.counted {
                    [candidate.snr, candidate.amplitude] = counted.heights(threshold);
                    candidate.light = counted.light;
                }
            }
            match self.judge(at, &candidate, lights) {
                Ok(()) => candidates.push(candidate),
                Err(cause) => {
                    fate.add(cause, &candidate);
                    watch.lose(&candidate, cause);
                }
            }
        }
        self.add_false_alarm(at, candidates);
        self.add_interference(at, candidates);
        candidates.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        watch.detect(candidates);
        self.choose(candidates);
        watch.choose(candidates);
        received.cause = match candidates.first() {
            Some(first) => first.cause,
            None => fate.cause(),
        };
        for candidate in candidates.iter() {
            received.returns.push(self.report(at, candidate));
            received.targets.push(candidate.target);
        }
        // The surface that blocks the beam is known, though it is no return.
        if let (Cause::TooNear, Some(blocker)) = (received.cause, fate.best) {
            received.returns.push(self.report(at, &blocker));
            received.targets.push(blocker.target);
        }
    }

    #[expect(clippy::too_many_arguments, reason = "a pulse's light in several forms, and memory")]
    fn candidate(
        &self,
        at: &Reception,
        peak: &Peak,
        lights: &[Light],
        parts: &[Part],
        waveform: &Waveform,
        by_object: &mut Vec<(u32, f64)>,
        shares: &mut Vec<f64>,
    ) -> Candidate {
        let near = waveform.near(peak.range_m);
        let lights = &lights[near.clone()];
        shares.clear();
        shares.extend(parts[near].iter().map(|part| waveform.share(part, peak.range_m)));
        // The object with the most light, and its brightest part.
        by_object.clear();
        for (&share, light) in shares.iter().zip(lights) {
            match by_object.iter_mut().find(|(object, _)| *object == light.target.object) {
                Some((_, sum)) => *sum += share,
                None => by_object.push((light.target.object, share)),
            }
        }
        let mut most = by_object[0];
        by_object.iter().for_each(|one| {
            if one.1 > most.1 {
                most = *one
            }
        });
        let mut main: Option<(f64, &Light)> = None;
        for (&share, light) in shares.iter().zip(lights) {
            if light.target.object == most.0 && main.is_none_or(|(best, _)| share > best) {
                main = Some((share, light));
            }
        }
        let main = main.map_or(&lights[0], |(_, light)| light);
        let is_other = |(share, light): (&f64, &Light)| (!is_of_one_surface(main, light)).then_some(*share);
        let others: f64 = shares.iter().zip(lights).filter_map(is_other).sum();
        let cause = if others >= MIXED_SHARE * peak.height { Cause::Mixed } else { main.cause };
        // Light far out on the pulse's flank is no part of the return.
        let is_part = |light: &&Light| (light.range_m - peak.range_m).abs() <= 2.0 * self.sigma_m;
        let axis = lights.iter().filter(|light| light.is_of_axis()).find(is_part);
        let ideal_m = axis.map_or(main.range_m, |light| light.range_m);
        let noise = match self.threshold {
            Some(_) if self.gauge.is_none() => self.stream(at, main.path, Effect::Detection).normal(),
            _ => 0.0,
        };
        Candidate {
            range_m: peak.range_m,
            snr: peak.height,
            amplitude: peak.height + noise,
            light: peak.height + noise,
            sigma_m: peak.sigma_m,
            cause,
            path: main.path,
            counted: None,
            ideal_m,
            length_m: main.length_m,
            target: main.target,
        }
    }

    /// Whether a peak is detected, within the limits of the sensor's range. Else the cause that it isn't.
    fn judge(&self, at: &Reception, candidate: &Candidate, lights: &[Light]) -> Result<(), Cause> {
        if let Some(threshold) = self.threshold
            && candidate.amplitude <= threshold
        {
            if candidate.snr > threshold {
                return Err(Cause::Dropped);
            }
            let clear_air =
                lights.iter().find(|light| light.path == candidate.path).map_or(1.0, |light| light.clear_air);
            return Err(if candidate.snr * clear_air > threshold {
                Cause::Absorbed
            } else {
                Cause::BelowThreshold
            });
        }
        match self.limits.place_of(at.pulse, candidate.range_m) {
            Ordering::Less => Err(Cause::TooNear),
            // The histogram ends with the range, even where depth is limited.
            Ordering::Equal if self.gauge.is_some() && candidate.counted.is_none() => Err(Cause::OutOfRange),
            Ordering::Equal => Ok(()),
            Ordering::Greater => Err(Cause::OutOfRange),
        }
    }

    fn add_false_alarm(&self, at: &Reception, candidates: &mut Vec<Candidate>) {
        let (probability, Some(threshold)) = (self.receiver.false_alarm, self.threshold) else { return };
        if probability == 0.0 {
            return;
        }
        let mut stream = self.stream(at, 0, Effect::FalseAlarm);
        let (chance, place, height) = (stream.unit(), stream.unit(), stream.unit());
        if chance < probability {
            // Above a threshold T, the excess of a normal deviate is nearly exponential with the mean 1/T.
            let amplitude = threshold - libm::log(1.0 - height) / threshold;
            self.add_foreign(at, place * self.window_m, amplitude, Cause::FalseAlarm, candidates);
        }
    }

    fn add_interference(&self, at: &Reception, candidates: &mut Vec<Candidate>) {
        let rate_hz = self.receiver.interference_hz;
        if rate_hz == 0.0 {
            return;
        }
        let mut stream = self.stream(at, 0, Effect::Interference);
        // Arrivals of a Poisson process are exponentially apart.
        let mean_apart_m = SPEED_OF_LIGHT_M_S / (2.0 * rate_hz);
        let mut range_m = 0.0;
        loop {
            range_m -= mean_apart_m * libm::log(1.0 - stream.unit());
            let amplitude = -self.receiver.interference_snr * libm::log(1.0 - stream.unit());
            if range_m >= self.window_m {
                return;
            }
            if self.threshold.is_none_or(|threshold| amplitude > threshold) {
                self.add_foreign(at, range_m, amplitude, Cause::Interference, candidates);
            }
        }
    }

    /// Adds a candidate that none of the pulse's own light makes, if the sensor reports ranges there.
    fn add_foreign(
        &self,
        at: &Reception,
        range_m: f64,
        amplitude: f64,
        cause: Cause,
        candidates: &mut Vec<Candidate>,
    ) {
        if !self.limits.place_of(at.pulse, range_m).is_eq() {
            return;
        }
        candidates.push(Candidate {
            range_m,
            snr: 0.0,
            amplitude,
            light: amplitude,
            sigma_m: self.sigma_m,
            cause,
            path: 0,
            counted: None,
            ideal_m: range_m,
            length_m: at.pulse.along_m(range_m),
            target: Target::NOTHING,
        });
    }

    /// Keeps the candidates that the receiver reports, in the order in which it reports them. They are sorted by range before.
    fn choose(&self, candidates: &mut Vec<Candidate>) {
        let most = self.receiver.returns.most();
        if candidates.len() <= 1 {
            return;
        }
        let by_strength = |a: &Candidate, b: &Candidate| b.amplitude.total_cmp(&a.amplitude);
        match self.receiver.returns {
            ReturnMode::First => candidates.truncate(1),
            ReturnMode::Last => {
                candidates.drain(..candidates.len() - 1);
            }
            ReturnMode::Strongest => {
                candidates.sort_by(by_strength);
                candidates.truncate(1);
            }
            ReturnMode::Dual => {
                let last = candidates[candidates.len() - 1];
                candidates.sort_by(by_strength);
                let strongest = candidates[0];
                let is_apart =
                    |c: &Candidate| (c.range_m - strongest.range_m).abs() >= self.receiver.separation_m;
                // The last return, if it is another one; else the second strongest.
                let second = match last.path == strongest.path && last.range_m == strongest.range_m {
                    false if is_apart(&last) => Some(last),
                    _ => candidates[1..].iter().copied().find(is_apart),
                };
                candidates.truncate(1);
                candidates.extend(second);
            }
            ReturnMode::Several(_) => {
                candidates.sort_by(by_strength);
                let mut kept = 0;
                for i in 0..candidates.len() {
                    let one = candidates[i];
                    let is_apart = candidates[..kept]
                        .iter()
                        .all(|k| (k.range_m - one.range_m).abs() >= self.receiver.separation_m);
                    if is_apart && kept < most {
                        candidates[kept] = one;
                        kept += 1;
                    }
                }
                candidates.truncate(kept);
                candidates.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
            }
        }
    }

    /// A candidate as the sensor reports it.
    fn report(&self, at: &Reception, candidate: &Candidate) -> (Return, Echo) {
        let is_of_light = candidate.snr > 0.0;
        let mut terms = Terms { ideal_m: candidate.ideal_m, ..Terms::default() };
        if is_of_light {
            terms.footprint_m = candidate.range_m - candidate.ideal_m;
            // The ideal ray may meet something else than the pulse does, or nothing; then the error is none of its direction.
            if let Some(ideal_m) = at.ideal_m.filter(|ideal_m| (ideal_m - candidate.ideal_m).abs() < 1.0) {
                terms.angle_m = candidate.ideal_m - ideal_m;
                terms.ideal_m = ideal_m;
            }
            match (candidate.counted, self.threshold) {
                (Some(counted), _) => terms.walk_m = counted.shift_m,
                (None, Some(threshold)) => {
                    let over = candidate.snr.min(self.receiver.saturation_snr) / threshold;
                    terms.walk_m = -self.receiver.walk_residual * walk_m(candidate.sigma_m, over);
                }
                (None, None) => {}
            }
            let sigma = self.noise.range_sigma_m(candidate.snr);
            if sigma > 0.0 {
                terms.noise_m = sigma * self.stream(at, candidate.path, Effect::RangeNoise).normal();
            }
            if let Some(counted) = candidate.counted {
                terms.noise_m += counted.noise_m;
            }
            terms.bias_m = at.beam.bias_m;
        }
        let unrounded_m = terms.unrounded_m().max(0.0);
        let unit = self.noise.range_unit_m;
        let range_m = if unit > 0.0 { (unrounded_m / unit).round() * unit } else { unrounded_m };
        terms.rounding_m = range_m - terms.unrounded_m();
        let light = candidate.light.min(self.receiver.saturation_snr);
        let fall = fall(self.receiver, candidate.length_m);
        let reflectivity = light * fall / (self.white_at_1_m * at.beam.power);
        let value = self.receiver.intensity.value(reflectivity);
        let target = &candidate.target;
        let normal = at.sensor_from_world * target.normal;
        let one = Return {
            range_m,
            normal: normal.as_vec3().to_array(),
            intensity: match self.receiver.intensity {
                IntensityScale::Ideal | IntensityScale::Percent => value as f32,
                // Makers' scales are whole numbers.
                _ => value.round() as f32,
            },
            instance: target.object,
            label: target.label,
            triangle: target.triangle,
        };
        let echo = Echo {
            cause: candidate.cause,
            snr: candidate.snr as f32,
            width_m: candidate.sigma_m as f32,
            ambient: 0.0,
            terms,
        };
        (one, echo)
    }

    fn stream(&self, at: &Reception, path: u32, effect: Effect) -> crate::rng::Rng {
        self.streams.stream(at.pixel, path, effect as u32)
    }
}

/// The factor by which energy is less than at 1 m, in clear air.
pub(super) fn fall(receiver: &Receiver, length_m: f64) -> f64 {
    receiver.sensitivity.map_or(length_m * length_m, |sensitivity| sensitivity.fall(length_m))
}

/// Whether light comes from the same surface as the main light of a return: by the same kind of way, and from within 30° of the
/// main surface's plane there. Curved surfaces are one surface therefore, and edges are two.
fn is_of_one_surface(main: &Light, light: &Light) -> bool {
    let apart = light.target.point - main.target.point;
    main.cause == light.cause && apart.dot(main.target.normal).abs() <= 0.5 * apart.length() + 1e-3
}

/// The fate of a pulse without returns: the cause of its highest peak.
#[derive(Default)]
struct Fate {
    best: Option<Candidate>,
    cause: Option<Cause>,
}

impl Fate {
    fn add(&mut self, cause: Cause, candidate: &Candidate) {
        if self.best.is_none_or(|best| candidate.snr > best.snr) {
            (self.best, self.cause) = (Some(*candidate), Some(cause));
        }
    }

    fn cause(&self) -> Cause {
        self.cause.unwrap_or(Cause::Nothing)
    }
}
