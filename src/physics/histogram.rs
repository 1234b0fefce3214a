//! Histograms of a single-photon avalanche diode (SPAD): when it counts, over the cycles of a laser.
//!
//! In each cycle the detector is armed when the pulse leaves. A bin of time with the mean number λ of counts, by light and by
//! background, fires an armed detector with the probability 1 − exp(−λ), and it stays blind for a dead time of D bins. A cycle fires
//! in at most one of any D + 1 bins, so the detector is blind in bin k with the probability of a count in the D bins before, and
//!
//! P_k = (1 − exp(−λ_k))·(1 − Σ_{k−D ≤ j < k} P_j).
//!
//! With a dead time that outlasts the cycle this is the first count, [`first_counts`](super::spad::first_counts): A. Gupta,
//! A. Ingle, A. Velten and M. Gupta, "Photon-flooded single-photon 3D cameras" (CVPR 2019) derive from it what sunlight and bright
//! targets do to a histogram, and their "Asynchronous single-photon 3D imaging" (ICCV 2019) what dead times do. The counts of
//! neighbouring bins over N cycles are multinomial with these probabilities, because no cycle counts twice in them.
//!
//! An echo is where the histogram, filtered for the shape of the pulse, has its maximum. It is detected if a gate of the pulse's
//! width around it has more counts than background alone reaches but with the probability of a false alarm.

use std::ops::Range;

use libm::{exp, expm1, log};

use super::binomial::{at_least, least_reached};
use super::echo::{Part, Waveform};
use super::footprint::FWHM_IN_SIGMA;

/// How a detector counts. Distances stand for the time that light takes there and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counting {
    /// The cycles of a histogram, at least 1.
    pub cycles: u32,
    /// The width of a bin in metres.
    pub bin_m: f64,
    /// The dead time in metres, at least [`Counting::LEAST_DEAD`] σ; infinite if it outlasts the cycle.
    pub dead_m: f64,
    /// The mean number of background counts of an armed detector, a metre.
    pub background_per_m: f64,
}

impl Counting {
    /// The least dead time in standard deviations of the pulse: no cycle counts twice in an echo.
    pub const LEAST_DEAD: f64 = 2.0 * AROUND + 1.0;
}

/// How far around the maximum of an echo its counts are drawn, in σ: a pulse has 99.7 % there.
const AROUND: f64 = 3.0;

/// How much nearer than its pulse an echo is looked for, in σ: a pulse of 10¹¹ counts a cycle has its first there.
const EARLIER: f64 = 7.0;

/// The histogram of a detector, of which the background is known.
#[derive(Clone, Debug)]
pub struct Histogram {
    counting: Counting,
    sigma_m: f64,
    dead_bins: usize,
    /// The number of bins of the gate.
    gate: usize,
    /// The height of the pulse so many bins beside its middle, out to 2·[`AROUND`] σ.
    shape: Vec<f64>,
    /// The probability of a count in each bin without light.
    dark: Vec<f64>,
    /// Their sums: the probability of a count before each bin, and at the end in all.
    dark_before: Vec<f64>,
    /// The least number of counts that is detected, by the gate's first bin.
    least: Vec<u32>,
}

/// The light of one histogram, in memory that is used again.
#[derive(Clone, Debug, Default)]
pub struct Exposure {
    /// The first bin with light.
    first: usize,
    /// The mean number of counts by light, from this bin on.
    light: Vec<f64>,
    /// The probability of a count, from this bin on.
    chances: Vec<f64>,
    excess: Vec<f64>,
}

/// An echo, by the means of its histogram.
#[derive(Clone, Debug, PartialEq)]
pub struct CountEcho {
    /// The range of the maximum of the filtered histogram, in metres.
    pub range_m: f64,
    /// The mean number of counts in the gate.
    pub counts: f64,
    /// The mean number that background alone has there.
    pub background: f64,
    /// The least number that is detected.
    pub least: u32,
    gate: Range<usize>,
    drawn: Range<usize>,
}

impl Histogram {
    /// The histogram up to `end_m` of a pulse with the standard deviation `sigma_m`. Without light it has a false alarm in a range
    /// window of `window_m` with the probability `false_alarm`, in (0, 1): there are as many chances as gates in the window.
    pub fn new(counting: Counting, window_m: f64, end_m: f64, sigma_m: f64, false_alarm: f64) -> Self {
        let bins = Self::bins(counting.bin_m, end_m + AROUND * sigma_m);
        let chances = Self::bins(counting.bin_m, window_m + AROUND * sigma_m);
        let gate = ((FWHM_IN_SIGMA * sigma_m / counting.bin_m).round() as usize).clamp(1, bins);
        let dead_bins = (counting.dead_m / counting.bin_m).round().min(bins as f64) as usize;
        let beside = (2.0 * AROUND * sigma_m / counting.bin_m) as usize;
        let shape = (0..=beside.min(bins))
            .map(|bin| {
                let z = bin as f64 * counting.bin_m / sigma_m;
                exp(-0.5 * z * z)
            })
            .collect();
        let (dark, dark_before, least) = (Vec::new(), vec![0.0], Vec::new());
        let mut one = Self { counting, sigma_m, dead_bins, gate, shape, dark, dark_before, least };
        let mut dark = Vec::with_capacity(bins);
        one.count(0, &vec![0.0; bins], &mut dark);
        one.dark = dark;
        for bin in 0..bins {
            one.dark_before.push(one.dark_before[bin] + one.dark[bin]);
        }
        // 1 − (1 − p)^(1/M), without cancellation.
        let most = -expm1(libm::log1p(-false_alarm) * gate as f64 / chances as f64);
        let mut known = (f64::NAN, 0);
        for first in 0..=bins - gate {
            let chance = one.dark_between(first..first + gate);
            let least = match known {
                (same, least) if same == chance => least,
                // The background falls slowly with the range, and its least count with it.
                (last, least) if chance < last => (0..=least)
                    .rev()
                    .find(|&k| k == 0 || at_least(counting.cycles, chance, k - 1) > most)
                    .unwrap_or(0),
                _ => least_reached(counting.cycles, chance, most),
            };
            known = (chance, least);
            one.least.push(least);
        }
        one
    }

    /// The number of bins of a range window.
    pub fn bins(bin_m: f64, window_m: f64) -> usize {
        libm::ceil(window_m / bin_m).max(1.0) as usize
    }

    /// Appends the probabilities of a count in the bins from `first` on, which have so much light.
    fn count(&self, first: usize, light: &[f64], chances: &mut Vec<f64>) {
        let background = self.counting.background_per_m * self.counting.bin_m;
        let mut blind =
            if first == 0 { 0.0 } else { self.dark_between(first.saturating_sub(self.dead_bins)..first) };
        let start = chances.len();
        for (bin, &light) in (first..).zip(light) {
            let chance = -expm1(-(background + light)) * (1.0 - blind).max(0.0);
            chances.push(chance);
            blind += chance;
            if let Some(over) = bin.checked_sub(self.dead_bins) {
                blind -= if over < first { self.dark[over] } else { chances[start + over - first] };
            }
        }
    }

    fn dark_between(&self, bins: Range<usize>) -> f64 {
        self.dark_before[bins.end] - self.dark_before[bins.start]
    }

    /// Exposes the histogram to light: parts that are sorted by range, each with its energy, which counts so many times a cycle.
    pub fn expose(&self, parts: &[Part], counts_per_energy: f64, exposure: &mut Exposure) {
        let Exposure { first, light, chances, .. } = exposure;
        light.clear();
        chances.clear();
        *first = 0;
        let [Some(nearest), Some(farthest)] = [parts.first(), parts.last()] else { return };
        let reach_m = (EARLIER + 2.0 * AROUND) * self.sigma_m;
        let lit = self.bins_between([nearest.range_m - reach_m, farthest.range_m + reach_m]);
        *first = lit.start;
        light.resize(lit.len(), 0.0);
        Waveform::new(parts, self.sigma_m).energies(
            self.counting.bin_m * lit.start as f64,
            self.counting.bin_m,
            light,
        );
        light.iter_mut().for_each(|light| *light *= counts_per_energy);
        self.count(*first, light, chances);
    }

    /// The bins of the histogram that lie between two ranges, or have one of them.
    fn bins_between(&self, [from_m, to_m]: [f64; 2]) -> Range<usize> {
        let bin = |range_m: f64| (range_m / self.counting.bin_m).max(0.0) as usize;
        let end = (bin(to_m) + 1).min(self.dark.len());
        bin(from_m).min(end)..end
    }

    /// The echo of the light around a peak of its waveform, between two ranges. `None` if the histogram ends before.
    pub fn echo(&self, exposure: &mut Exposure, peak_m: f64, between_m: [f64; 2]) -> Option<CountEcho> {
        let near = [peak_m - EARLIER * self.sigma_m, peak_m + AROUND * self.sigma_m];
        let searched = self.bins_between([near[0].max(between_m[0]), near[1].min(between_m[1])]);
        if searched.is_empty() {
            return None;
        }
        let cycles = f64::from(self.counting.cycles);
        let mut excess = std::mem::take(&mut exposure.excess);
        excess.clear();
        excess.extend(searched.clone().map(|bin| cycles * (self.chance(exposure, bin) - self.dark[bin])));
        let range_m = self.maximum(searched.start, &excess).unwrap_or(peak_m);
        exposure.excess = excess;
        let half = 0.5 * self.gate as f64;
        let start = (range_m / self.counting.bin_m - half).round().max(0.0) as usize;
        let start = start.min(self.dark.len() - self.gate);
        let gate = start..start + self.gate;
        let around_m = AROUND * self.sigma_m;
        let drawn = self.bins_between([range_m - around_m, range_m + around_m]);
        let drawn = drawn.start.min(gate.start)..drawn.end.max(gate.end);
        let chance: f64 = gate.clone().map(|bin| self.chance(exposure, bin)).sum();
        Some(CountEcho {
            range_m,
            counts: cycles * chance,
            background: cycles * self.dark_between(gate.clone()),
            least: self.least[gate.start],
            gate,
            drawn,
        })
    }

    fn chance(&self, exposure: &Exposure, bin: usize) -> f64 {
        let lit = bin.checked_sub(exposure.first).and_then(|at| exposure.chances.get(at));
        lit.copied().unwrap_or(self.dark[bin])
    }

    fn middle_m(&self, bin: usize) -> f64 {
        (bin as f64 + 0.5) * self.counting.bin_m
    }

    /// The range at which counts over the background, bin by bin from `first` on, have the maximum of their sum with a pulse's
    /// shape. `None` if there are none over the background.
    ///
    /// Between the bins it is the vertex of the parabola through the logarithms of three sums, which is exact for the sums of
    /// Gaussian counts, because they are a Gaussian.
    fn maximum(&self, first: usize, excess: &[f64]) -> Option<f64> {
        let shape = |beside: usize| self.shape.get(beside).copied().unwrap_or(0.0);
        let sum = |bin: usize| -> f64 {
            excess.iter().enumerate().map(|(other, counts)| counts * shape(other.abs_diff(bin))).sum()
        };
        let sums: Vec<f64> = (0..excess.len()).map(sum).collect();
        let (best, most) = sums
            .iter()
            .enumerate()
            .fold((0, 0.0), |best, (bin, &sum)| if sum > best.1 { (bin, sum) } else { best });
        if most <= 0.0 {
            return None;
        }
        let mut offset = 0.0;
        if best > 0
            && let (before, Some(&after)) = (sums[best - 1], sums.get(best + 1))
            && before > 0.0
            && after > 0.0
        {
            let [before, at, after] = [before, most, after].map(log);
            let bend = before - 2.0 * at + after;
            offset = if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        }
        Some(self.middle_m(first + best) + offset * self.counting.bin_m)
    }

    /// The probability that an echo is detected: its counts are a binomial number.
    pub fn detection(&self, echo: &CountEcho) -> f64 {
        let cycles = self.counting.cycles;
        at_least(cycles, echo.counts / f64::from(cycles), echo.least)
    }

    /// The standard deviation of an echo's range in metres, to first order. The slope of the filtered counts h_k is Σ h_k·s′(x_k) with
    /// the pulse's shape s, so that the maximum moves by the slope's deviation over the curvature of the mean. Counts are multinomial.
    pub fn range_sigma_m(&self, exposure: &Exposure, echo: &CountEcho) -> f64 {
        let (mut slope, mut square, mut curvature) = (0.0, 0.0, 0.0);
        for bin in echo.drawn.clone() {
            let z = (self.middle_m(bin) - echo.range_m) / self.sigma_m;
            let shape = exp(-0.5 * z * z);
            let chance = self.chance(exposure, bin);
            slope += chance * z * shape;
            square += chance * z * z * shape * shape;
            curvature += (chance - self.dark[bin]) * (z * z - 1.0) * shape;
        }
        if curvature >= 0.0 {
            return 0.0;
        }
        let variance = (square - slope * slope).max(0.0) / f64::from(self.counting.cycles);
        -variance.sqrt() / curvature * self.sigma_m
    }

    /// The counts in the gate of an echo, and the range of its maximum, in one histogram. `binomial` draws the number of successes in so
    /// many trials with a probability.
    ///
    /// The counts of the bins around the echo are drawn one after the other: of the cycles that have not counted in them yet, a bin
    /// has its share of the probability that is left.
    pub fn draw(
        &self,
        exposure: &mut Exposure,
        echo: &CountEcho,
        mut binomial: impl FnMut(u32, f64) -> u32,
    ) -> (u32, f64) {
        let cycles = self.counting.cycles;
        let (mut cycles_left, mut chance_left, mut in_gate) = (cycles, 1.0, 0);
        let mut excess = std::mem::take(&mut exposure.excess);
        excess.clear();
        for bin in echo.drawn.clone() {
            let chance = self.chance(exposure, bin);
            let share = if chance_left > 0.0 { (chance / chance_left).min(1.0) } else { 1.0 };
            let counts = binomial(cycles_left, share);
            cycles_left -= counts;
            chance_left -= chance;
            if echo.gate.contains(&bin) {
                in_gate += counts;
            }
            excess.push(f64::from(counts) - f64::from(cycles) * self.dark[bin]);
        }
        let range_m = self.maximum(echo.drawn.start, &excess).unwrap_or(echo.range_m);
        exposure.excess = excess;
        (in_gate, range_m)
    }

    /// The mean number of counts a cycle that a pulse has, from the counts in its gate, as long as pile-up is small.
    pub fn light_of(&self, echo: &CountEcho, counts: f64) -> f64 {
        let armed = 1.0 - self.dark_between(echo.gate.start.saturating_sub(self.dead_bins)..echo.gate.start);
        let background = exp(-self.counting.background_per_m * self.counting.bin_m);
        (counts - echo.background)
            / (f64::from(self.counting.cycles) * self.gate_share() * armed.max(1e-12) * background)
    }

    /// The share of a pulse that a gate around its middle has.
    pub fn gate_share(&self) -> f64 {
        let z = 0.5 * self.gate as f64 * self.counting.bin_m / self.sigma_m;
        libm::erf(z * std::f64::consts::FRAC_1_SQRT_2)
    }

    /// The probability that background has blinded the detector at a range.
    pub fn blind(&self, range_m: f64) -> f64 {
        let bin = ((range_m / self.counting.bin_m) as usize).min(self.dark.len());
        self.dark_between(bin.saturating_sub(self.dead_bins)..bin)
    }

    /// The cycles of the histogram.
    pub fn cycles(&self) -> u32 {
        self.counting.cycles
    }

    /// The echo of a pulse that comes back whole from a range, with so many counts a cycle on average.
    pub fn echo_of(&self, range_m: f64, counts: f64, exposure: &mut Exposure) -> Option<CountEcho> {
        self.expose(&[Part { range_m, energy: 1.0 }], counts, exposure);
        self.echo(exposure, range_m, [0.0, f64::INFINITY])
    }

    /// The mean number of counts a cycle with which a pulse from a range is detected with this probability. `None` if no light is
    /// detected so often, because too few cycles are armed there, or if the histogram ends before.
    pub fn light_for(&self, range_m: f64, detection: f64) -> Option<f64> {
        /// The counts between which the answer lies, by their logarithms.
        const BETWEEN: [f64; 2] = [-30.0, 12.0];
        let mut exposure = Exposure::default();
        let mut is_enough = |log_counts: f64| {
            let echo = self.echo_of(range_m, exp(log_counts), &mut exposure);
            echo.is_some_and(|echo| self.detection(&echo) >= detection)
        };
        let [mut low, mut high] = BETWEEN;
        if !is_enough(high) {
            return None;
        }
        // 52 halvings of 42 leave 10⁻¹⁴ of the counts.
        for _ in 0..52 {
            let middle = low + 0.5 * (high - low);
            if is_enough(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some(exp(high))
    }
}

#[cfg(test)]
mod tests {
    use super::super::spad::{first_counts, survival};
    use super::super::testing::close;
    use super::*;
    use crate::rng::Rng;

    const SIGMA_M: f64 = 0.32;

    fn echo_of(one: &Histogram, range_m: f64, counts: f64) -> CountEcho {
        one.echo_of(range_m, counts, &mut Exposure::default()).unwrap()
    }

    fn counting() -> Counting {
        Counting { cycles: 500, bin_m: 0.15, dead_m: f64::INFINITY, background_per_m: 0.005 }
    }

    fn histogram(counting: Counting) -> Histogram {
        Histogram::new(counting, 120.0, 120.0, SIGMA_M, 1e-4)
    }

    #[test]
    fn a_dead_time_beyond_the_cycle_leaves_first_counts() {
        let one = histogram(counting());
        let mut exposure = Exposure::default();
        one.expose(
            &[Part { range_m: 30.0, energy: 1.0 }, Part { range_m: 50.0, energy: 1.0 }],
            0.7,
            &mut exposure,
        );
        let mut means = vec![0.005 * 0.15; one.dark.len()];
        for (mean, light) in means[exposure.first..].iter_mut().zip(&exposure.light) {
            *mean += light;
        }
        for (bin, chance) in first_counts(&means).into_iter().enumerate() {
            assert!(
                (one.chance(&exposure, bin) - chance).abs() < 1e-13
                    || bin >= exposure.first + exposure.light.len()
            );
        }
        // Before the light, of the rate b a cycle counts before a range R with the probability 1 − exp(−b·R).
        close(1.0 - one.dark_before[400], survival(0.005 * 60.0), 1e-12);
    }

    /// Cycles one by one, in continuous time: counts come as a Poisson process, and each blinds the detector for the dead time. The
    /// counts of each bin agree with the closed form within 5 standard deviations: 250 bins fail by chance once in 7000 seeds.
    #[test]
    fn cycles_count_as_the_closed_form_says() {
        for dead_m in [f64::INFINITY, 4.5] {
            let counting = Counting { dead_m, background_per_m: 0.03, ..counting() };
            let one = Histogram::new(counting, 37.0, 37.0, SIGMA_M, 1e-4);
            let pulses = [(12.0, 0.4), (20.03, 2.0), (20.9, 0.7)];
            let parts = pulses.map(|(range_m, energy)| Part { range_m, energy });
            let mut exposure = Exposure::default();
            one.expose(&parts, 1.0, &mut exposure);
            let mut rng = Rng::new(8);
            let (cycles, mut counts) = (60_000, vec![0_u32; one.dark.len()]);
            for _ in 0..cycles {
                let mut arrivals = Vec::new();
                let mut at_m = 0.0;
                loop {
                    at_m -= libm::log(1.0 - rng.unit()) / 0.03;
                    if at_m > 60.0 {
                        break;
                    }
                    arrivals.push(at_m);
                }
                for (range_m, mean) in pulses {
                    let mut left = -libm::log(1.0 - rng.unit());
                    while left < mean {
                        arrivals.push(range_m + SIGMA_M * rng.normal());
                        left -= libm::log(1.0 - rng.unit());
                    }
                }
                arrivals.sort_by(f64::total_cmp);
                let mut blind_to = 0;
                for bin in arrivals.iter().map(|at_m| (at_m / 0.15) as usize) {
                    if bin >= blind_to && bin < counts.len() {
                        counts[bin] += 1;
                        // The dead time counts in bins, as an electronic gate that opens with a bin does.
                        blind_to = if dead_m.is_finite() { bin + 1 + one.dead_bins } else { usize::MAX };
                    }
                }
            }
            // Behind the light it is not told how the detector recovers.
            for (bin, &count) in counts[..exposure.first + exposure.light.len()].iter().enumerate() {
                let chance = one.chance(&exposure, bin);
                let sigma = (f64::from(cycles) * chance * (1.0 - chance)).sqrt();
                let off = f64::from(count) - f64::from(cycles) * chance;
                assert!(
                    off.abs() <= 5.0 * sigma + 1.0,
                    "{dead_m} {bin}: {count} {}",
                    f64::from(cycles) * chance
                );
            }
        }
    }

    /// Draws of an echo have its mean, its rate of detection and its deviation, at faint, middling and bright light. 4000 draws: each
    /// within 4 standard deviations; the first order of the range's deviation is good to a tenth from 100 counts on.
    #[test]
    fn draws_are_as_the_echo_says() {
        let one = histogram(Counting { background_per_m: 0.02, ..counting() });
        let mut rng = Rng::new(4);
        for counts in [0.02, 0.05, 0.3, 3.0] {
            let mut exposure = Exposure::default();
            one.expose(&[Part { range_m: 40.06, energy: 1.0 }], counts, &mut exposure);
            let echo = one.echo(&mut exposure, 40.06, [0.0, f64::INFINITY]).unwrap();
            let draws = 4000;
            let (mut seen, mut sum, mut range, mut square) = (0.0, 0.0, 0.0, 0.0);
            for _ in 0..draws {
                let (counts, range_m) = one.draw(&mut exposure, &echo, |n, p| rng.binomial(n, p));
                seen += f64::from(u8::from(counts >= echo.least));
                sum += f64::from(counts);
                range += range_m - echo.range_m;
                square += (range_m - echo.range_m) * (range_m - echo.range_m);
            }
            let n = f64::from(draws);
            let chance = echo.counts / 500.0;
            let within = |found: f64, mean: f64, variance: f64| {
                assert!(
                    (found / n - mean).abs() < 4.0 * (variance / n).sqrt() + 1e-3,
                    "{counts}: {} {mean}",
                    found / n
                );
            };
            within(sum, echo.counts, 500.0 * chance * (1.0 - chance));
            let detection = one.detection(&echo);
            within(seen, detection, detection * (1.0 - detection));
            if counts > 0.2 {
                let told_m = one.range_sigma_m(&exposure, &echo);
                let sigma_m = (square / n - (range / n) * (range / n)).sqrt();
                assert!((sigma_m / told_m - 1.0).abs() < 0.1, "{counts}: {sigma_m} {told_m}");
                assert!((range / n).abs() < 0.1 * told_m, "{counts}: {}", range / n);
            }
        }
    }

    /// A faint echo lies where its light does, whatever its place in a bin, and a bright one nearer. Of s counts a cycle, the first
    /// has the density s·φ(z)·exp(−s·Φ(z)), whose mean over z follows by a sum; the filter's maximum is that of its sum with φ.
    #[test]
    fn pile_up_shifts_bright_echoes_nearer() {
        let one = histogram(Counting { bin_m: 0.04, background_per_m: 0.0, ..counting() });
        for i in 0..10 {
            let range_m = 20.0 + 0.0137 * f64::from(i);
            let echo = echo_of(&one, range_m, 1e-6);
            // The mean of a bin of an eighth of σ is Gaussian but for the part at 3σ that is not seen.
            assert!((echo.range_m - range_m).abs() < 2e-4, "{range_m}: {}", echo.range_m);
        }
        let mut last = 0.0;
        for counts in [0.1, 1.0, 10.0, 100.0, 1e4] {
            let found = echo_of(&one, 20.0, counts).range_m - 20.0;
            let step = 1e-3;
            let z = |i: i32| -7.0 + step * f64::from(i);
            let density =
                |z: f64| counts * exp(-0.5 * z * z) * exp(-counts * super::super::detection::normal_below(z));
            let filtered = |at: f64| -> f64 {
                (0..10_000).map(|i| density(z(i)) * exp(-0.5 * (z(i) - at) * (z(i) - at))).sum()
            };
            let (mut low, mut high) = (-7.0, 3.0);
            while high - low > 1e-4 {
                let third = (high - low) / 3.0;
                if filtered(low + third) < filtered(high - third) { low += third } else { high -= third }
            }
            assert!((found / SIGMA_M - low).abs() < 0.02, "{counts}: {} {low}", found / SIGMA_M);
            assert!(found < last, "{counts}: {found}");
            last = found;
        }
    }

    /// More background takes cycles away before they reach a target, and adds counts that hide it.
    #[test]
    fn background_lowers_the_detection_of_far_targets() {
        let at = |background_per_m: f64, range_m: f64| {
            let one = histogram(Counting { background_per_m, ..counting() });
            let echo = echo_of(&one, range_m, 0.1);
            (one.detection(&echo), echo.counts - echo.background)
        };
        for background in [0.01, 0.03] {
            let (near, far) = (at(background, 5.1), at(background, 100.05));
            assert!(near.0 > far.0 + 1e-3, "{near:?} {far:?}");
            // 633 bins lie between them, and each shares the cycles that it finds among its light and its background alike.
            close(far.1 / near.1, survival(background * 94.95), 1e-9);
        }
    }

    #[test]
    fn the_light_for_a_detection_gives_it() {
        for (range_m, detection) in [(90.0, 0.5), (30.03, 0.9), (119.0, 0.99)] {
            let one = histogram(Counting { background_per_m: 0.01, ..counting() });
            let light = one.light_for(range_m, detection).unwrap();
            let echo = echo_of(&one, range_m, light);
            assert!((one.detection(&echo) - detection).abs() < 1e-6, "{echo:?}");
            assert!((one.light_of(&echo, echo.counts) / light - 1.0).abs() < 0.1);
        }
        // Without background one count is enough: 1 − (1 − p)^N with p the light in the gate.
        let dark = histogram(Counting { background_per_m: 0.0, ..counting() });
        let light = dark.light_for(90.0, 0.5).unwrap();
        let echo = echo_of(&dark, 90.0, light);
        assert_eq!((echo.least, echo.background), (1, 0.0));
        close(1.0 - libm::pow(1.0 - echo.counts / 500.0, 500.0), 0.5, 1e-9);
        // Where background takes all the cycles nothing is seen.
        assert_eq!(histogram(Counting { background_per_m: 1.0, ..counting() }).light_for(100.0, 0.5), None);
        assert_eq!(one_beyond(), None);
    }

    fn one_beyond() -> Option<f64> {
        histogram(counting()).light_for(130.0, 0.5)
    }

    /// The false alarms of all gates of the window together are as rare as they shall be.
    #[test]
    fn background_alone_is_as_rare_as_a_false_alarm() {
        for background_per_m in [0.0, 0.001, 0.05] {
            let one = histogram(Counting { background_per_m, ..counting() });
            let mut none = 1.0;
            for first in (0..=one.dark.len() - one.gate).step_by(one.gate) {
                let chance = one.dark_between(first..first + one.gate);
                none *= 1.0 - at_least(500, chance, one.least[first]);
                assert_eq!(
                    one.least[first],
                    least_reached(500, chance, 1e-4 * one.gate as f64 / one.dark.len() as f64)
                );
            }
            assert!(1.0 - none <= 1e-4, "{background_per_m}: {}", 1.0 - none);
        }
    }
}
