//! The replay of a data sheet: the figures that a sensor states are measured by the real scan, and held to what they say.
//!
//! The pulses go along x of the sensor's frame, at walls across x. They are a table of rays with a row for each of the sensor's
//! beams, because a beam's bias and gain belong to its row. The sensor's own directions would add nothing: a plane that every
//! beam meets at a right angle is another plane for each of them, and the figures do not depend on where that plane is. Beams that
//! have range pairs of their own are replayed apart; noise, biases and false alarms are those of the beams that come first.
//!
//! What no figure states is left out, so that each expectation has a closed form: the errors of directions, the walk of the
//! threshold, blooming (the pulses have one direction, so that all would lie in each other's halo), crosstalk and interference. All returns
//! of a pulse are asked for, so that a false alarm does not take the place of a plane's return.
//!
//! A beam's gain is e^(γz) with a normal deviate z, which the seed fixes. Where γ is not 0, expectations are means over z, and the
//! allowed deviations count both the beams and the pulses: of B beams with the variance V between beams and the mean variance
//! W of a pulse, n pulses have the mean's variance V/B + W/n.

use glam::{DAffine3, DVec3};

use crate::angle::Angle;
use crate::frame::Pose;
use crate::motion::Trajectory;
use crate::physics::detection::{RangePair, Sensitivity, normal_below};
use crate::scan::{Cause, Frame, Progress, scan};
use crate::scene::{
    Material, Optics, Scene, SceneBuildError, SceneBuilder, SourceInstance, SourceMesh, SourcePart,
    SurfaceKind,
};
use crate::sensor::{
    Capture, Counter, DimmerBeams, Limited, Measurement, Noise, Pattern, Pulse, RangeLimits, RayTable,
    Receiver, ReturnMode, Sensor,
};
use crate::trace::Tracer;

/// The least number of pulses at a plane, and the pulses of each frame of an empty scene.
const PULSES: usize = 10_000;

/// The frames of an empty scene: with [`PULSES`] each they are 10⁶ pulses.
const EMPTY_FRAMES: u64 = 100;

/// The seed of every replay. A figure that agrees once agrees each time.
const SEED: u64 = 1;

/// The allowed deviations, in standard deviations. A right figure of a normal distribution is further off once in 16,000 seeds.
const DEVIATIONS: f64 = 4.0;

/// The most beams that a replay has. A camera's rows count as beams, and would be hundreds.
const MOST_BEAMS: usize = 128;

/// The least number of beams over which a spread is judged. The deviation of 16 is known to 18 %.
const LEAST_BEAMS: usize = 16;

/// The part of the largest range at which the farthest wall stands. The edge of a beam's footprint is farther than its axis by θ²/2,
/// so that at the limit itself it is out of range; a thousandth is that of a half angle of 44 mrad.
const NEAR_LIMIT: f64 = 0.999;

/// The ranges in metres at which the noise of ranges is measured, as data sheets and `lint` tell it.
const NOISE_RANGES_M: [f64; 3] = [10.0, 50.0, 100.0];

/// The reflectance of the wall at which noise and biases are measured.
const BRIGHT: f64 = 0.8;

/// The result of a replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    /// The sensitivity that the range pairs imply; `None` if there are none.
    pub fit: Option<Sensitivity>,
    /// The number of the receiver's own range pairs, without those of some beams. One is met exactly, and several to the [misfit](Sensitivity::misfit) of their fit.
    pub pairs: usize,
    /// The figures, in the order of the data sheet's tables.
    pub figures: Vec<Figure>,
}

impl Replay {
    /// Whether no figure disagrees, and at least one was measured.
    pub fn passed(&self) -> bool {
        let measured = self.figures.iter().filter_map(|figure| figure.outcome.measured());
        let all: Vec<bool> = measured.map(Measured::agrees).collect();
        !all.is_empty() && all.iter().all(|agrees| *agrees)
    }
}

/// A figure of the data sheet, and what the scan made of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// The stated quantity.
    pub stated: Stated,
    /// The number of pulses that were cast for it.
    pub pulses: u64,
    /// The result.
    pub outcome: Outcome,
}

/// A quantity that data sheets state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stated {
    /// The share of pulses in which a plane is detected.
    Detection {
        /// The reflectance of the plane.
        reflectance: f64,
        /// Its range in metres.
        range_m: f64,
        /// The index in [`Receiver::beams`] of the beams that it is stated of; `None`: of all others.
        beams: Option<usize>,
    },
    /// The standard deviation of the range of a plane in metres, about each beam's own mean.
    RangeNoise {
        /// The reflectance of the plane.
        reflectance: f64,
        /// Its range in metres.
        range_m: f64,
    },
    /// The number of false alarms in an empty scene.
    FalseAlarms,
    /// The standard deviation of the beams' mean ranges, in metres.
    BeamBias,
}

impl Stated {
    /// The name in reports.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Detection { .. } => "detection",
            Self::RangeNoise { .. } => "range_noise",
            Self::FalseAlarms => "false_alarms",
            Self::BeamBias => "beam_bias",
        }
    }

    /// The reflectance and the range in metres of the plane that the figure is about.
    pub fn plane(&self) -> Option<(f64, f64)> {
        match *self {
            Self::Detection { reflectance, range_m, .. } | Self::RangeNoise { reflectance, range_m } => {
                Some((reflectance, range_m))
            }
            Self::FalseAlarms | Self::BeamBias => None,
        }
    }
}

/// What became of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It was measured.
    Measured(Measured),
    /// Its range is beyond the largest that the sensor reports, in metres, which caps it.
    Capped(f64),
    /// Its range is nearer than the least that the sensor reports, in metres.
    TooNear(f64),
    /// The sensor has only so many beams, of which a spread says nothing.
    FewBeams(usize),
}

impl Outcome {
    /// The measurement, if there is one.
    pub fn measured(&self) -> Option<&Measured> {
        match self {
            Self::Measured(measured) => Some(measured),
            _ => None,
        }
    }
}

/// A figure that was measured, in the unit of what is [`Stated`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The value that follows from the data sheet.
    pub expected: f64,
    /// The value in the frames.
    pub found: f64,
    /// The largest difference that chance explains: four standard deviations.
    pub allowed: f64,
}

impl Measured {
    /// Whether chance explains the difference. It explains no NaN.
    pub fn agrees(&self) -> bool {
        (self.found - self.expected).abs() <= self.allowed
    }
}

/// Whether a measurement states a figure that can be replayed.
pub fn states_figures(stated: &Measurement) -> bool {
    let receiver = stated.receiver.as_ref();
    let noise = stated.noise.unwrap_or_default();
    receiver.is_some_and(|receiver| !receiver.range_pairs.is_empty())
        || noise.range_floor_m > 0.0
        || noise.bias_m > 0.0
}

/// The number of rays that [`replay`] casts for a sensor.
pub fn rays(sensor: &Sensor, stated: &Measurement) -> u64 {
    let bench = Bench::new(sensor, stated);
    let samples = sensor.measurement.footprint.map_or(1, |footprint| footprint.samples.count());
    let of_frame = |group: &Group| (pulses_of(group.rows.len()) * samples) as u64;
    let of_pairs: u64 = bench.groups.iter().map(|group| group.pairs.len() as u64 * of_frame(group)).sum();
    let of_noise = bench.noise_ranges_m().len() as u64 * of_frame(&bench.groups[0]);
    let empty = if bench.alarms() > 0.0 { EMPTY_FRAMES * PULSES as u64 } else { 0 };
    of_pairs + of_noise + empty
}

/// Casts a sensor at the planes that `stated` tells of, and at nothing, and holds it to those figures. `stated` is the sensor's own
/// measurement, unless another one is put to the test. `None` if `progress` was cancelled.
///
/// # Errors
/// If a plane is so far away that it can't be stored.
pub fn replay(
    sensor: &Sensor,
    stated: &Measurement,
    progress: &Progress,
) -> Result<Option<Replay>, SceneBuildError> {
    let bench = Bench::new(sensor, stated);
    let mut figures = Vec::new();
    // Each wall is a frame of its own, so that all draws are new.
    let mut frames = EMPTY_FRAMES..;
    let pairs = bench.groups.iter().flat_map(|group| group.pairs.iter().map(move |pair| (group, pair)));
    for ((group, pair), frame) in pairs.zip(&mut frames) {
        let Some(figure) = bench.detection(group, pair, frame, progress)? else { return Ok(None) };
        figures.push(figure);
    }
    let mut spread = None;
    for (range_m, frame) in bench.noise_ranges_m().into_iter().zip(&mut frames) {
        let Some([noise, bias]) = bench.noise(range_m, frame, progress)? else { return Ok(None) };
        figures.extend(noise);
        // The nearest wall has the least noise.
        spread = spread.or(bias);
    }
    if bench.alarms() > 0.0 {
        let Some(figure) = bench.false_alarms(progress)? else { return Ok(None) };
        figures.push(figure);
    }
    figures.extend(spread);
    let pairs = stated.receiver.as_ref().map_or(0, |receiver| receiver.range_pairs.len());
    Ok(Some(Replay { fit: bench.fit, pairs, figures }))
}

/// Beams of which the same pairs are stated.
struct Group<'a> {
    /// The index in [`Receiver::beams`]; `None`: all others.
    beams: Option<usize>,
    pairs: &'a [RangePair],
    /// The stated factor on their power.
    power: f64,
    /// The rows of the sensor's own pattern, at most [`MOST_BEAMS`].
    rows: Vec<usize>,
    /// The number of all such rows.
    count: usize,
}

impl<'a> Group<'a> {
    /// The groups of a sensor of so many rows. There is at least one.
    fn all(rows: usize, stated: Option<&'a Receiver>) -> Vec<Self> {
        let group = |beams, pairs, power, all: &mut dyn Iterator<Item = usize>| {
            let rows: Vec<usize> = all.take(MOST_BEAMS).collect();
            let count = rows.len() + all.count();
            Self { beams, pairs, power, rows, count }
        };
        let dimmer = stated.map_or(&[][..], |receiver| &receiver.beams);
        let is_other = |row: &usize| !dimmer.iter().any(|beams| beams.rows.contains(row));
        let pairs = stated.map_or(&[][..], |receiver| &receiver.range_pairs);
        let others = group(None, pairs, 1.0, &mut (0..rows.max(1)).filter(is_other));
        let of = |(index, beams): (usize, &'a DimmerBeams)| {
            let rows = &mut beams.rows.iter().copied().filter(|row| *row < rows);
            group(Some(index), &beams.range_pairs, beams.power, rows)
        };
        let all = std::iter::once(others).chain(dimmer.iter().enumerate().map(of));
        all.filter(|group| !group.rows.is_empty()).collect()
    }
}

/// The pulses of a frame of so many beams: at least [`PULSES`], and as many of each.
fn pulses_of(beams: usize) -> usize {
    beams * PULSES.div_ceil(beams)
}

/// A sensor that is put to the test.
struct Bench<'a> {
    /// The sensor without what no figure states.
    sensor: Sensor,
    stated: &'a Measurement,
    noise: Noise,
    limits: RangeLimits,
    /// The sensitivity by the stated pairs, whatever the sensor's own is.
    fit: Option<Sensitivity>,
    /// What counts the light, if the stated receiver counts photons.
    counter: Option<Counter>,
    groups: Vec<Group<'a>>,
}

impl<'a> Bench<'a> {
    fn new(sensor: &Sensor, stated: &'a Measurement) -> Self {
        let Measurement { footprint, receiver, noise, .. } = sensor.measurement.clone();
        let receiver = receiver.map(|receiver| Receiver {
            returns: ReturnMode::Several(4),
            separation_m: 0.0,
            walk_residual: 0.0,
            interference_hz: 0.0,
            crosstalk: 0.0,
            ..receiver
        });
        let still = Angle::default();
        let noise = noise.map(|noise| Noise { angle: still, beam_angle: still, ..noise });
        let limits = RangeLimits { of: Limited::Range, ..sensor.range };
        let pairs = stated.receiver.as_ref().map_or(&[][..], |receiver| &receiver.range_pairs);
        Self {
            sensor: Sensor {
                range: limits,
                measurement: Measurement { footprint, receiver, noise, ..Measurement::default() },
                ..sensor.clone()
            },
            stated,
            noise: stated.noise.unwrap_or_default(),
            limits,
            fit: Sensitivity::fit(pairs),
            groups: Group::all(sensor.pattern.rows(), stated.receiver.as_ref()),
            counter: stated.receiver.as_ref().and_then(|receiver| receiver.counter(limits.max_m, 1.0)),
        }
    }

    /// How the sensor measures in these rows of its own, which are the rows of a replay.
    fn measurement_of(&self, rows: &[usize]) -> Measurement {
        let mut measurement = self.sensor.measurement.clone();
        if let Some(receiver) = &mut measurement.receiver {
            let own = std::mem::take(receiver);
            let of_row = |(row, own_row): (usize, &usize)| DimmerBeams {
                rows: vec![row],
                range_pairs: Vec::new(),
                power: own.power(*own_row),
                misfit: 0.0,
            };
            let beams = rows.iter().enumerate().map(of_row).filter(|beams| beams.power != 1.0).collect();
            *receiver = Receiver { beams, ..own };
        }
        measurement
    }

    /// The stated probability of a false alarm. A receiver without pairs has no threshold, and so no false alarms.
    fn alarms(&self) -> f64 {
        let of = |receiver: &Receiver| if self.fit.is_some() { receiver.false_alarm } else { 0.0 };
        self.stated.receiver.as_ref().map_or(0.0, of)
    }

    /// The signal-to-noise ratio of a plane at a right angle by the stated pairs, and the threshold; infinite without pairs.
    fn snr(&self, group: &Group, reflectance: f64, range_m: f64) -> (f64, f64) {
        match (&self.stated.receiver, &self.fit) {
            (Some(receiver), Some(fit)) => (
                receiver.limit_snr(self.limits.max_m) * fit.margin(group.power * reflectance, range_m),
                receiver.threshold(self.limits.max_m),
            ),
            _ => (f64::INFINITY, 0.0),
        }
    }

    /// The ranges at which noise and biases are measured: those of [`NOISE_RANGES_M`] at which the bright wall is detected at least
    /// as often as a range pair's plane. A sensor that reaches none of them is measured halfway to its end. Without a stated noise
    /// or bias there are none.
    fn noise_ranges_m(&self) -> Vec<f64> {
        let Noise { range_floor_m, range_a_m, bias_m, .. } = self.noise;
        if range_floor_m == 0.0 && range_a_m == 0.0 && bias_m == 0.0 {
            return Vec::new();
        }
        let end_m = self
            .fit
            .map_or(f64::INFINITY, |fit| fit.range_m(self.groups[0].power * BRIGHT))
            .min(self.limits.max_m);
        let inside: Vec<f64> =
            NOISE_RANGES_M.into_iter().filter(|m| (self.limits.min_m..=end_m).contains(m)).collect();
        match inside.is_empty() && end_m.is_finite() {
            true => vec![0.5 * (self.limits.min_m + end_m)],
            false => inside,
        }
    }

    /// The range at which a wall stands that is to be at `range_m`.
    fn place_m(&self, range_m: f64) -> f64 {
        range_m.min(NEAR_LIMIT * self.limits.max_m)
    }

    /// The mean over the beams' gains of a quantity at the gain's factor, and the variance between beams.
    fn over_gains(&self, of: impl Fn(f64) -> f64) -> (f64, f64) {
        if self.noise.gain == 0.0 {
            return (of(1.0), 0.0);
        }
        // The trapezoidal rule of a smooth function that vanishes at both ends errs by less than any power of the step.
        let (mut weights, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for step in -400..=400 {
            let z = 0.02 * f64::from(step);
            let weight = libm::exp(-0.5 * z * z);
            let value = of(libm::exp(self.noise.gain * z));
            weights += weight;
            sum += weight * value;
            squares += weight * value * value;
        }
        let mean = sum / weights;
        (mean, (squares / weights - mean * mean).max(0.0))
    }

    /// A frame of at least [`PULSES`] pulses along x, of so many beams. `None` if `progress` was cancelled.
    fn cast(
        &self,
        scene: &Scene,
        measurement: Measurement,
        beams: usize,
        frame: u64,
        progress: &Progress,
    ) -> Option<Frame> {
        let pulses = vec![Pulse::new(DVec3::ZERO, DVec3::X, 0.0); pulses_of(beams)];
        let table = RayTable::new(pulses, None).and_then(|table| table.with_lines(beams));
        let pattern = Pattern::Rays(table.ok()?);
        let sensor = Sensor { pattern, measurement, ..self.sensor.clone() };
        let trajectory = Trajectory::Fixed(Pose::IDENTITY);
        let capture = Capture::new(&sensor, Pose::IDENTITY, &trajectory, frame, SEED);
        scan(scene, &Tracer::build(scene), &capture, progress)
    }

    /// The share of pulses in which a pair's plane is detected, against Φ(S − T). With one pair S − T is what gives the stated
    /// probability; with several it is the fit's.
    fn detection(
        &self,
        group: &Group,
        pair: &RangePair,
        frame: u64,
        progress: &Progress,
    ) -> Result<Option<Figure>, SceneBuildError> {
        let &RangePair { reflectivity, range_m } = pair;
        let stated = Stated::Detection { reflectance: reflectivity, range_m, beams: group.beams };
        if range_m > self.limits.max_m {
            let outcome = Outcome::Capped(self.limits.max_m);
            return Ok(Some(Figure { stated, pulses: 0, outcome }));
        }
        if range_m < self.limits.min_m {
            let outcome = Outcome::TooNear(self.limits.min_m);
            return Ok(Some(Figure { stated, pulses: 0, outcome }));
        }
        let wall_m = self.place_m(range_m);
        let (beams, measurement) = (group.rows.len(), self.measurement_of(&group.rows));
        let Some(frame) = self.cast(&wall(wall_m, reflectivity)?, measurement, beams, frame, progress) else {
            return Ok(None);
        };
        let pulses = frame.pixels() as f64;
        let found = (0..frame.pixels()).filter(|&pixel| of_wall(&frame, pixel).is_some()).count() as f64;
        let (snr, threshold) = self.snr(group, reflectivity, wall_m);
        let counted = |counter: &Counter, gain: f64| {
            counter.plane(group.power * gain * reflectivity, wall_m).map_or(0.0, |plane| plane.detection)
        };
        let detected = |gain: f64| match &self.counter {
            Some(counter) => counted(counter, gain),
            None => normal_below(gain * snr - threshold),
        };
        let (expected, between) = self.over_gains(detected);
        let (within, _) = self.over_gains(|gain| detected(gain) * (1.0 - detected(gain)));
        let sigma = (between / beams as f64 + within / pulses).sqrt();
        // A count is a whole number, so that one more or less says nothing where almost all pulses are detected, or almost none.
        let allowed = DEVIATIONS * sigma + 1.0 / pulses;
        let outcome = Outcome::Measured(Measured { expected, found: found / pulses, allowed });
        Ok(Some(Figure { stated, pulses: frame.pixels() as u64, outcome }))
    }

    /// The noise of ranges at a bright wall, and the spread of the beams' biases there, if they are stated.
    ///
    /// A beam's bias is the same in all of its pulses, so that deviations count about the beam's own mean: the sum of their squares
    /// over the pulses less the beams is the variance. Rounding to a unit u adds u²/12 (W. F. Sheppard 1898), if the noise is at
    /// least as wide as the unit: what that leaves out falls with e^(−2π²σ²/u²), 3·10⁻⁹. Of less noise the rounded deviation depends
    /// on where between two units the wall stands, and the ranges before they are rounded are judged.
    ///
    /// The variance v of n normal deviates in B beams is known to 2v²/(n − B), so the deviation to √v/√(2(n − B)).
    fn noise(
        &self,
        range_m: f64,
        frame: u64,
        progress: &Progress,
    ) -> Result<Option<[Option<Figure>; 2]>, SceneBuildError> {
        let wall_m = self.place_m(range_m);
        let group = &self.groups[0];
        let (beams, measurement) = (group.rows.len(), self.measurement_of(&group.rows));
        let Some(frame) = self.cast(&wall(wall_m, BRIGHT)?, measurement, beams, frame, progress) else {
            return Ok(None);
        };
        let (snr, _) = self.snr(group, BRIGHT, wall_m);
        let unit_m = self.noise.range_unit_m;
        let is_rounded = self.noise.range_sigma_m(snr) >= unit_m;
        let rounding = if is_rounded { unit_m * unit_m / 12.0 } else { 0.0 };
        let variance = |gain: f64| {
            let sigma_m = self.noise.range_sigma_m(gain * snr);
            let of_counts_m = match &self.counter {
                Some(counter) => counter.plane(gain * BRIGHT, wall_m).map_or(0.0, |plane| plane.sigma_m),
                None => 0.0,
            };
            sigma_m * sigma_m + of_counts_m * of_counts_m + rounding
        };
        let range_of = |slot: usize| match frame.echo(slot) {
            Some(echo) if !is_rounded => echo.terms.unrounded_m(),
            _ => frame.returns().range_m[slot],
        };
        let columns = frame.columns();
        let (mut means, mut squares, mut count) = (Vec::new(), 0.0, 0_usize);
        for beam in 0..frame.rows() {
            let pixels = beam * columns..(beam + 1) * columns;
            let ranges: Vec<f64> = pixels.filter_map(|pixel| of_wall(&frame, pixel)).map(range_of).collect();
            if ranges.is_empty() {
                continue;
            }
            // Deviations from the wall are small, so that their sums lose no digits.
            let mean = ranges.iter().map(|m| m - wall_m).sum::<f64>() / ranges.len() as f64;
            squares += ranges.iter().map(|m| (m - wall_m - mean) * (m - wall_m - mean)).sum::<f64>();
            count += ranges.len();
            means.push(mean);
        }
        let beams = means.len() as f64;
        let pulses = frame.pixels() as u64;
        let (expected, between) = self.over_gains(variance);
        let (fourth, _) = self.over_gains(|gain| variance(gain) * variance(gain));
        let free = count as f64 - beams;
        let noise = (self.noise.range_floor_m > 0.0 || self.noise.range_a_m > 0.0).then(|| {
            // Half of the relative error of a variance is that of its root.
            let error = (between / beams + 2.0 * fourth / free).sqrt() / (2.0 * expected.sqrt());
            let measured = Measured {
                expected: expected.sqrt(),
                found: (squares / free).sqrt(),
                allowed: DEVIATIONS * error,
            };
            let stated = Stated::RangeNoise { reflectance: BRIGHT, range_m };
            Figure { stated, pulses, outcome: Outcome::Measured(measured) }
        });
        let bias = (self.noise.bias_m > 0.0).then(|| {
            let outcome = match group.count < LEAST_BEAMS {
                true => Outcome::FewBeams(group.count),
                false => {
                    // The mean of a beam's pulses has its bias, and the noise that so many pulses leave.
                    let of_mean = expected / (count as f64 / beams);
                    let spread = (self.noise.bias_m * self.noise.bias_m + of_mean).sqrt();
                    let mean = means.iter().sum::<f64>() / beams;
                    let sum = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>();
                    Outcome::Measured(Measured {
                        expected: spread,
                        found: (sum / (beams - 1.0)).sqrt(),
                        allowed: DEVIATIONS * spread / (2.0 * (beams - 1.0)).sqrt(),
                    })
                }
            };
            Figure { stated: Stated::BeamBias, pulses, outcome }
        });
        Ok(Some([noise, bias]))
    }

    /// The false alarms of 10⁶ pulses at nothing. They are anywhere up to the largest range, and those in the dead zone are not
    /// reported. The number is nearly Poisson's, whose variance is its mean.
    fn false_alarms(&self, progress: &Progress) -> Result<Option<Figure>, SceneBuildError> {
        // No light comes back whose width or range could matter, so beams have neither here.
        let receiver = self.measurement_of(&self.groups[0].rows[..1]).receiver;
        let measurement = Measurement { receiver, ..Measurement::default() };
        let behind = wall(-1.0, 1.0)?;
        let (mut found, mut pulses) = (0, 0);
        for number in 0..EMPTY_FRAMES {
            let Some(frame) = self.cast(&behind, measurement.clone(), 1, number, progress) else {
                return Ok(None);
            };
            pulses += frame.pixels() as u64;
            let causes = (0..frame.pixels()).flat_map(|pixel| frame.slots(pixel));
            let is_alarm =
                |slot: &usize| frame.echo(*slot).is_some_and(|echo| echo.cause == Cause::FalseAlarm);
            found += causes.filter(is_alarm).count();
        }
        let reported = 1.0 - self.limits.min_m / self.limits.max_m;
        let expected = self.alarms() * reported * pulses as f64;
        let measured = Measured { expected, found: found as f64, allowed: DEVIATIONS * expected.sqrt() };
        let outcome = Outcome::Measured(measured);
        Ok(Some(Figure { stated: Stated::FalseAlarms, pulses, outcome }))
    }
}

/// The slot of a pixel's return from the wall, which is the only object.
fn of_wall(frame: &Frame, pixel: usize) -> Option<usize> {
    frame.slots(pixel).find(|&slot| frame.returns().instance[slot] == 0)
}

/// A scene of one wall across x, which sends light back by Lambert's law: at a right angle exactly the reflectance, relative to
/// white.
fn wall(x_m: f64, reflectance: f64) -> Result<Scene, SceneBuildError> {
    // A beam is narrower than its range by far.
    let half_m = x_m.abs() as f32 + 1.0;
    let corner = |y: f32, z: f32| [x_m as f32, half_m * y, half_m * z];
    let part = SourcePart { triangles: vec![[0, 1, 2], [0, 2, 3]], material: 0, ..SourcePart::default() };
    let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let instance =
        SourceInstance { mesh: 0, world_from_mesh: DAffine3::IDENTITY, ..SourceInstance::default() };
    let builder = SceneBuilder {
        meshes: vec![SourceMesh { positions, parts: vec![part] }],
        instances: vec![instance],
        materials: vec![Material { optics: Some(0), ..Material::default() }],
        files: vec![],
        groups: vec![],
    };
    let mut scene = builder.build()?;
    let optics =
        Optics { reflectance: Some(reflectance), kind: Some(SurfaceKind::Lambert), ..Optics::default() };
    std::sync::Arc::make_mut(&mut scene.geometry).optics = vec![optics];
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of e^(γz) is e^(γ²/2), and its variance e^(2γ²) − e^(γ²).
    #[test]
    fn means_over_gains_are_those_of_the_log_normal_distribution() {
        let stated =
            Measurement { noise: Some(Noise { gain: 0.3, ..Noise::default() }), ..Measurement::default() };
        let pulse = Pulse::new(DVec3::ZERO, DVec3::X, 0.0);
        let sensor = Sensor::new(Pattern::Rays(RayTable::new(vec![pulse], None).unwrap()));
        let (mean, variance) = Bench::new(&sensor, &stated).over_gains(|gain| gain);
        assert!((mean - libm::exp(0.045)).abs() < 1e-12, "{mean}");
        assert!((variance - (libm::exp(0.18) - libm::exp(0.09))).abs() < 1e-12, "{variance}");
    }
}
