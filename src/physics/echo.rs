//! Pulses that add up to a waveform, and the peaks of it.
//!
//! A pulse is Gaussian in time, so the light from one distance is a Gaussian of the standard deviation σ = c·FWHM/(2·2.3548) in
//! range: half of what light travels, because it goes there and back. A waveform is the sum of such Gaussians, kept as the pairs
//! (range, energy) and never cut into bins, so a peak has no step of quantisation. The energy of a part is the height of its peak
//! if it comes back alone.
//!
//! Two parts of equal energy have one peak up to a distance of 2σ and two beyond it. (The second derivative of the sum at the
//! middle changes its sign there.)

use std::f64::consts::TAU;
use std::ops::Range;

use libm::exp;

use super::SPEED_OF_LIGHT_M_S;
use super::footprint::FWHM_IN_SIGMA;

/// The standard deviation in range of a pulse whose full width at half maximum is so many seconds, in metres.
pub fn pulse_sigma_m(fwhm_s: f64) -> f64 {
    SPEED_OF_LIGHT_M_S * fwhm_s / (2.0 * FWHM_IN_SIGMA)
}

/// The height of a pulse at z standard deviations from its peak: exp(−z²/2), to a few ulps. Within half a standard deviation, where
/// nearly all light of a surface lies, the first ten terms of the series do, in a third of the time: the next is at most
/// 0.125¹⁰/10! = 3·10⁻¹⁶.
#[inline]
fn pulse_height(z: f64) -> f64 {
    let x = 0.5 * z * z;
    if x > 0.125 {
        return exp(-x);
    }
    // Horner's scheme for Σ (−x)ⁿ/n!.
    let mut sum = 1.0;
    for n in [9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0] {
        sum = 1.0 - x * (1.0 / n) * sum;
    }
    sum
}

/// Light that comes back from one distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// The range in metres.
    pub range_m: f64,
    /// The energy, above 0, in any unit.
    pub energy: f64,
}

/// A maximum of a waveform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// The range in metres.
    pub range_m: f64,
    /// The height, in the unit of the parts' energies.
    pub height: f64,
    /// The standard deviation of the Gaussian that has the peak's height and curvature, in metres. It is σ for parts at one
    /// range, and √(σ² + v) for parts that are spread over a Gaussian of the variance v, as on a slanted plane.
    pub sigma_m: f64,
}

/// The distance in σ beyond which a pulse is less than 2⁻⁵³ of its peak, so that it is left out: √(2·53·ln 2).
const REACH: f64 = 8.572;

/// The steps of a waveform whose values are computed together.
const BLOCK: usize = 32;

/// A waveform: its parts in the order of their ranges.
#[derive(Clone, Copy, Debug)]
pub struct Waveform<'p> {
    parts: &'p [Part],
    sigma_m: f64,
}

/// The sum of pulses with its first two derivatives, at a range.
#[derive(Clone, Copy)]
struct Value {
    sum: f64,
    slope: f64,
    curvature: f64,
}

impl Value {
    /// The value without any pulse.
    const NONE: Self = Self { sum: 0.0, slope: 0.0, curvature: 0.0 };
}

impl<'p> Waveform<'p> {
    /// The waveform of parts that are sorted by range, with a pulse of the standard deviation `sigma_m` above 0.
    pub fn new(parts: &'p [Part], sigma_m: f64) -> Self {
        debug_assert!(parts.is_sorted_by(|a, b| a.range_m <= b.range_m));
        Self { parts, sigma_m }
    }

    /// The height of the waveform at a range.
    pub fn height(&self, range_m: f64) -> f64 {
        self.value(range_m).sum
    }

    /// The indices of the parts whose pulses reach a range.
    pub fn near(&self, range_m: f64) -> Range<usize> {
        let reach = REACH * self.sigma_m;
        let first = self.parts.partition_point(|part| part.range_m < range_m - reach);
        let end = self.parts.partition_point(|part| part.range_m <= range_m + reach);
        first..end.max(first)
    }

    /// The share of a part in the height of the waveform at a range: its energy × exp(−(r − r₀)²/2σ²).
    pub fn share(&self, part: &Part, range_m: f64) -> f64 {
        let z = (range_m - part.range_m) / self.sigma_m;
        part.energy * pulse_height(z)
    }

    /// The derivatives are by the range in units of σ.
    fn value(&self, range_m: f64) -> Value {
        let mut value = Value::NONE;
        for part in &self.parts[self.near(range_m)] {
            let z = (range_m - part.range_m) / self.sigma_m;
            let pulse = part.energy * pulse_height(z);
            value.sum += pulse;
            value.slope -= z * pulse;
            value.curvature += (z * z - 1.0) * pulse;
        }
        value
    }

    /// Writes the energy that arrives in each of some bins of range, side by side from `from_m` on, so that a part has its energy in
    /// all bins together.
    ///
    /// A bin is cut into steps of at most σ/2. The integral of a function f over a step δ is δ·(f + δ²f″/24) at its middle, but for
    /// δ⁴f⁗/1920: of a pulse at most 3·.5⁴/1920 = 10⁻⁴ of its height.
    pub fn energies(&self, from_m: f64, bin_m: f64, energies: &mut [f64]) {
        let in_bin = libm::ceil(bin_m / (0.5 * self.sigma_m)).max(1.0) as usize;
        let step_m = bin_m / in_bin as f64;
        let step = step_m / self.sigma_m;
        let mut values = [Value::NONE; BLOCK];
        let steps = in_bin * energies.len();
        energies.fill(0.0);
        for first in (0..steps).step_by(BLOCK) {
            let values = &mut values[..BLOCK.min(steps - first)];
            self.tabulate(from_m + step_m * (first as f64 + 0.5), step_m, values);
            for (at, value) in (first..).zip(&*values) {
                let mean = value.sum + step * step / 24.0 * value.curvature;
                energies[at / in_bin] += step / TAU.sqrt() * mean;
            }
        }
    }

    /// All maxima, in the order of their ranges.
    ///
    /// Parts closer together than σ have one maximum between them: each pulse is concave within σ of its own peak. Wider groups
    /// are searched in steps of σ/2 for changes of the slope's sign, and steps in which the slope turns for such changes between
    /// their ends.
    pub fn peaks(&self, peaks: &mut Vec<Peak>) {
        peaks.clear();
        let mut rest = self.parts;
        while let [first, ..] = rest {
            // Twice the reach apart, no pulse of one group is felt at a peak of the other.
            let is_gap = |pair: &[Part]| pair[1].range_m - pair[0].range_m > REACH * self.sigma_m;
            let (group, after) =
                rest.split_at(rest.windows(2).position(is_gap).map_or(rest.len(), |at| at + 1));
            rest = after;
            let last = group[group.len() - 1];
            let energy: f64 = group.iter().map(|part| part.energy).sum();
            if last.range_m - first.range_m <= self.sigma_m {
                // The mean is the peak but for the third power of the spread over σ.
                let mean = group.iter().map(|part| part.energy * (part.range_m - first.range_m)).sum::<f64>();
                let start_m = first.range_m + mean / energy;
                peaks.push(self.peak_between(first.range_m, last.range_m, start_m));
            } else {
                self.search(first.range_m, last.range_m, energy, peaks);
            }
        }
    }

    /// Adds the maxima of a group of this energy between the ranges of its first and its last part. No pulse falls at the first,
    /// and none rises at the last.
    fn search(&self, from_m: f64, to_m: f64, energy: f64, peaks: &mut Vec<Peak>) {
        let steps = libm::ceil((to_m - from_m) / (0.5 * self.sigma_m)) as usize;
        let at = |step: usize| from_m + (to_m - from_m) * step as f64 / steps as f64;
        let rises = |value: &Value, step: usize| step == 0 || (step < steps && value.slope > 0.0);
        let mut values = [Value::NONE; BLOCK];
        let mut before = Value::NONE;
        for step in 0..=steps {
            if step % BLOCK == 0 {
                let step_m = (to_m - from_m) / steps as f64;
                self.tabulate(at(step), step_m, &mut values[..BLOCK.min(steps + 1 - step)]);
            }
            let here = values[step % BLOCK];
            if step > 0 {
                let (low, high) = (at(step - 1), at(step));
                match (rises(&before, step - 1), rises(&here, step)) {
                    (true, false) => {
                        let start_m = low + (high - low) * before.slope / (before.slope - here.slope);
                        peaks.push(self.peak_between(low, high, start_m));
                    }
                    (false, true) => {}
                    // The slope may have both signs and the same at both ends: it is least where the curvature grows through 0, and
                    // largest where it falls through 0.
                    (true, true) if before.curvature < 0.0 && here.curvature > 0.0 => {
                        if let Some(turn) = self.turn_between(low, high, -1.0, energy) {
                            peaks.push(self.peak_between(low, turn, low + 0.5 * (turn - low)));
                        }
                    }
                    (false, false) if before.curvature > 0.0 && here.curvature < 0.0 => {
                        if let Some(turn) = self.turn_between(low, high, 1.0, energy) {
                            peaks.push(self.peak_between(turn, high, turn + 0.5 * (high - turn)));
                        }
                    }
                    _ => {}
                }
            }
            before = here;
        }
    }

    /// Writes the values at so many ranges, the first of which is `from_m`, in steps of `step_m` of at most σ/2.
    ///
    /// A pulse at the next step follows from that at this one: exp(−(z + h)²/2) = exp(−z²/2)·exp(−zh − h²/2), and the second
    /// factor falls from step to step by exp(−h²). So a part takes two exponentials a block, and not one a step. A block is 16σ
    /// long, so no exponent is beyond (16 + REACH)²/2 = 302, and the values have a relative error of some 10⁻¹³. They only say
    /// between which steps a maximum lies.
    fn tabulate(&self, from_m: f64, step_m: f64, values: &mut [Value]) {
        values.fill(Value::NONE);
        let reach_m = REACH * self.sigma_m;
        let to_m = from_m + step_m * (values.len() - 1) as f64;
        let first = self.parts.partition_point(|part| part.range_m < from_m - reach_m);
        let step = step_m / self.sigma_m;
        let fall = exp(-step * step);
        for part in self.parts[first..].iter().take_while(|part| part.range_m <= to_m + reach_m) {
            let mut z = (from_m - part.range_m) / self.sigma_m;
            let mut pulse = part.energy * pulse_height(z);
            let mut factor = exp(-step * (z + 0.5 * step));
            for value in &mut *values {
                value.sum += pulse;
                value.slope -= z * pulse;
                value.curvature += (z * z - 1.0) * pulse;
                z += step;
                pulse *= factor;
                factor *= fall;
            }
        }
    }

    /// A range between two others at which the slope has the sign of `sign`, if there is one. It has the other sign at both, and
    /// the curvature changes its sign between them, where the slope comes nearest to `sign`. `energy` is that of the group.
    ///
    /// The curvature is halved down to its change of sign, until a slope has the sign, or none can have it: the curvature is 0 at
    /// the turn, and the third derivative of a pulse is at most 1.381 of its energy (at z² = 3 − √6), so over the distance w the
    /// slope differs from that of the turn by less than 1.381·w²/2 of the energy.
    fn turn_between(&self, from_m: f64, to_m: f64, sign: f64, energy: f64) -> Option<f64> {
        let (mut low, mut high) = (from_m, to_m);
        for _ in 0..30 {
            let middle = low + 0.5 * (high - low);
            let value = self.value(middle);
            if value.slope * sign > 0.0 {
                return Some(middle);
            }
            let half = (middle - low) / self.sigma_m;
            if value.slope.abs() > 0.6905 * half * half * energy {
                return None;
            }
            // The slope moves towards the sign up to the turn, and away from it behind.
            if value.curvature * sign > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        None
    }

    /// The maximum between two ranges, at the first of which the slope is not negative, and at the second not positive. Newton's
    /// method finds it from `start_m`, or bisection where that leaves the interval, to the last digits of the slope.
    fn peak_between(&self, from_m: f64, to_m: f64, start_m: f64) -> Peak {
        let sigma_m = self.sigma_m;
        let (mut low, mut high) = (from_m, to_m);
        // A mean of energies beyond all numbers is none.
        let mut range_m = if start_m >= low && start_m <= high { start_m } else { low + 0.5 * (high - low) };
        let mut value = self.value(range_m);
        for _ in 0..60 {
            if value.slope > 0.0 {
                low = range_m;
            } else {
                high = range_m;
            }
            let newton = range_m - sigma_m * value.slope / value.curvature;
            let next = match value.curvature < 0.0 && newton >= low && newton <= high {
                true => newton,
                false => low + 0.5 * (high - low),
            };
            let step = (next - range_m).abs();
            range_m = next;
            // Newton's error falls with the square of the step: from a step of 10⁻⁷ σ to 10⁻¹⁴ σ. The height grows by half of the slope
            // times the step, and nothing else changes in 53 bits.
            if step <= 1e-7 * sigma_m && value.curvature < 0.0 {
                value.sum += 0.5 * value.slope.abs() * (step / sigma_m);
                break;
            }
            value = self.value(range_m);
            // A step of 10⁻¹³ σ is below the rounding of a range of metres.
            if step <= 1e-13 * sigma_m {
                break;
            }
        }
        let spread = if value.curvature < 0.0 { -value.sum / value.curvature } else { 1.0 };
        Peak { range_m, height: value.sum, sigma_m: sigma_m * spread.sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peaks(parts: &[(f64, f64)], sigma_m: f64) -> Vec<Peak> {
        let mut parts: Vec<_> = parts.iter().map(|&(range_m, energy)| Part { range_m, energy }).collect();
        parts.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        let mut peaks = Vec::new();
        Waveform::new(&parts, sigma_m).peaks(&mut peaks);
        peaks
    }

    #[test]
    fn the_series_of_a_pulse_is_its_exponential() {
        for step in -1000..=1000 {
            let z = f64::from(step) * 1e-3;
            let exact = exp(-0.5 * z * z);
            assert!((pulse_height(z) / exact - 1.0).abs() < 8.0 * f64::EPSILON, "{z}");
        }
    }

    #[test]
    fn a_pulse_of_5_ns_is_32_cm_wide() {
        assert!((pulse_sigma_m(5e-9) - 0.318_28).abs() < 5e-6, "{}", pulse_sigma_m(5e-9));
    }

    /// Where two echoes merge, in σ, for their ratios of energy. The sum has a horizontal point of inflection there: with the
    /// ratio q and the distance d there is an x with x·e^(−x²/2) = q·(d − x)·e^(−(d−x)²/2) and (x² − 1)·e^(−x²/2) =
    /// q·(1 − (d−x)²)·e^(−(d−x)²/2), so (x² − 1)·(d − x) = x·(1 − (d − x)²), which gives x(d − x) = 1.
    #[test]
    fn two_echoes_merge_where_the_closed_form_says() {
        for (ratio, distance) in [(1.0, 2.0), (0.5, 2.628), (0.25, 2.981), (0.1, 3.354), (0.03, 3.763)] {
            // The table has three digits, and near the merger a maximum is flat.
            let count = |d: f64| peaks(&[(10.0, 1.0), (10.0 + d * 0.3, ratio)], 0.3).len();
            assert_eq!((count(distance - 0.006), count(distance + 0.02)), (1, 2), "{ratio}");
        }
        for (ratio, told) in [(0.5, 2.628), (0.1, 3.354)] {
            // The closed form: x(d − x) = 1, and q = x/(d − x)·exp(((d − x)² − x²)/2).
            let d: f64 = told;
            let y = (d + (d * d - 4.0).sqrt()) / 2.0;
            let x = d - y;
            let q = y / x * exp((x * x - y * y) / 2.0);
            assert!((q - ratio).abs() < 2e-3, "{told}: {q}");
        }
    }

    /// Half a beam on each of two walls.
    #[test]
    fn halves_of_a_beam_are_one_return_at_60_cm_and_two_at_70() {
        let sigma = pulse_sigma_m(5e-9);
        let one = peaks(&[(20.0, 0.5), (20.6, 0.5)], sigma);
        assert_eq!(one.len(), 1);
        assert!((one[0].range_m - 20.3).abs() < 1e-9);
        let two = peaks(&[(20.0, 0.5), (20.7, 0.5)], sigma);
        assert_eq!(two.len(), 2);
        assert!(two[0].range_m > 20.0 && two[1].range_m < 20.7, "each is pulled inwards: {two:?}");
        assert!((two[0].range_m + two[1].range_m - 40.7).abs() < 1e-9);
    }

    /// The part of a pulse in a bin is a difference of the normal distribution's.
    #[test]
    fn bins_share_the_energy_of_a_pulse() {
        let sigma = 0.3;
        let parts = [Part { range_m: 10.04, energy: 2.0 }, Part { range_m: 30.0, energy: 1.0 }];
        for bin_m in [0.02, 0.15, 0.5, 3.0] {
            let mut energies = vec![0.0; (40.0 / bin_m) as usize];
            Waveform::new(&parts, sigma).energies(0.0, bin_m, &mut energies);
            for (bin, energy) in energies.iter().enumerate() {
                let below = |range_m: f64, part: &Part| {
                    part.energy * super::super::detection::normal_below((range_m - part.range_m) / sigma)
                };
                let edge = |bin: usize| parts.iter().map(|part| below(bin as f64 * bin_m, part)).sum::<f64>();
                // The error of a step is 10⁻⁴ of its height, and a height of 1 over σ√(2π) is an energy of 1.
                assert!(
                    (energy - (edge(bin + 1) - edge(bin))).abs() < 1e-4 * (bin_m / sigma),
                    "{bin_m} {bin}"
                );
            }
            assert!((energies.iter().sum::<f64>() - 3.0).abs() < 1e-6, "{bin_m}");
        }
    }

    #[test]
    fn parts_at_exactly_the_same_range_add_up() {
        let found = peaks(&[(7.0, 0.25); 4], 0.3);
        assert_eq!(found.len(), 1);
        assert!((found[0].range_m - 7.0).abs() < 1e-15 && (found[0].height - 1.0).abs() < 1e-15);
        assert!((found[0].sigma_m - 0.3).abs() < 1e-12);
    }

    /// 3 mrad at 50 m over a plane at 60°: the ranges spread by 65 mm, and the echo widens to √(.3183² + .065²) = .3249 m.
    #[test]
    fn a_slanted_plane_widens_the_echo() {
        let sigma = pulse_sigma_m(5e-9);
        let slant = 0.075 / 2.0 * libm::tan(60_f64.to_radians());
        assert!((slant - 0.065).abs() < 5e-5);
        let places = super::super::footprint::Samples::ThirtySeven.places();
        let parts: Vec<_> = places.iter().map(|[x, _]| (50.0 + 2.0 * slant * x, 1.0 / 37.0)).collect();
        let found = peaks(&parts, sigma);
        // The rings have the beam's second moment, and another fourth: the width differs by some tenths of a millimetre.
        assert_eq!(found.len(), 1);
        assert!((found[0].range_m - 50.0).abs() < 1e-3, "{found:?}");
        assert!((found[0].sigma_m - (sigma * sigma + slant * slant).sqrt()).abs() < 2e-4, "{found:?}");
    }

    /// The peaks of random waveforms are all the maxima that a fine table of heights has: of parts of like energies, and of energies
    /// over fifteen decades, spread over less than a step of the search up to several blocks.
    ///
    /// Below 10⁻¹² of the greatest height the table shows where a pulse is left out at its reach, 10⁻¹⁶ of its own height, as a
    /// maximum. So both pass over maxima as low as that.
    #[test]
    fn no_peak_is_missed_and_none_is_made_up() {
        let mut rng = crate::rng::Rng::new(3);
        let mut several = 0;
        for round in 0..600 {
            let count = 1 + rng.below(40);
            let reach = 0.1 + 9.0 * rng.unit() * rng.unit();
            let decades = if round % 2 == 0 { 0.0 } else { 15.0 };
            let mut part = || Part {
                range_m: 5.0 + reach * rng.unit(),
                energy: (0.01 + rng.unit()) * libm::pow(10.0, -decades * rng.unit()),
            };
            let mut parts: Vec<_> = (0..count).map(|_| part()).collect();
            parts.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
            let waveform = Waveform::new(&parts, 0.2);
            let mut found = Vec::new();
            waveform.peaks(&mut found);
            let at = |i: usize| 4.9 + i as f64 * 0.002;
            let steps = ((reach + 0.2) / 0.002) as usize + 2;
            let heights: Vec<_> = (0..steps).map(|i| waveform.height(at(i))).collect();
            let least = 1e-12 * heights.iter().copied().fold(0.0, f64::max);
            let maxima: Vec<f64> = (1..steps - 1)
                .filter(|&i| heights[i] > heights[i - 1] && heights[i] >= heights[i + 1])
                .filter(|&i| heights[i] > least)
                .map(at)
                .collect();
            found.retain(|peak| peak.height > least);
            assert_eq!(found.len(), maxima.len(), "{parts:?}");
            several += usize::from(found.len() > 1);
            for (peak, table) in found.iter().zip(maxima) {
                assert!((peak.range_m - table).abs() <= 0.0021, "{peak:?} {table}");
                assert!((peak.height - waveform.height(peak.range_m)).abs() < 1e-12 * peak.height);
            }
        }
        assert!(several > 200, "{several}");
    }
}
