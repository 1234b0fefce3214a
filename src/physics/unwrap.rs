//! Unwrapping: the range that phases at several frequencies tell together, and whether it can be relied upon.
//!
//! A phase at the frequency f repeats with the range c/(2f). Phases at several frequencies repeat together with c/(2g), where g
//! is the greatest common divisor of the frequencies. The range is the one that fits all phases best, by least squares with the
//! weights 1/σ² (A. P. P. Jongenelen et al., "Analysis of errors in ToF range imaging with dual-frequency modulation", IEEE Trans.
//! Instrum. Meas. 60, 1861 (2011), for two frequencies).

use std::f64::consts::TAU;

use super::SPEED_OF_LIGHT_M_S;
use super::phasor::{Demodulated, range_m};

/// The most frequencies that are unwrapped together.
pub const MOST_FREQUENCIES: usize = 4;

/// The most wraps of all frequencies together within the unambiguous range.
const MOST_WRAPS: f64 = 10_000.0;

/// The range within which phases at these frequencies tell ranges apart: c/(2g), in metres, with the greatest common divisor g.
/// The frequencies are whole numbers of hertz.
pub fn unambiguous_range_m(frequencies_hz: &[f64]) -> f64 {
    SPEED_OF_LIGHT_M_S / (2.0 * common_divisor(frequencies_hz))
}

/// Euclid's algorithm; the remainders of whole numbers are exact.
fn common_divisor(frequencies_hz: &[f64]) -> f64 {
    frequencies_hz.iter().fold(0.0, |mut divisor, &frequency| {
        let mut rest = frequency;
        while rest > 0.0 {
            (divisor, rest) = (rest, divisor % rest);
        }
        divisor
    })
}

/// The frequencies of a camera, and what unwrapping needs to know of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Unwrapper {
    frequencies_hz: Vec<f64>,
    /// The number of wraps of each frequency within the unambiguous range.
    wraps: Vec<usize>,
    range_m: f64,
}

/// The range that phases tell together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unwrapped {
    /// The range in metres: the mean of all frequencies with the weights 1/σ².
    pub range_m: f64,
    /// Its standard deviation in metres, if the wraps are right: 1/√(Σ 1/σ²).
    pub sigma_m: f64,
    /// χ² of the frequencies' ranges about it, Σ ((r − `range_m`)/σ)². With k frequencies of one surface it has k − 1 degrees of
    /// freedom.
    pub residual: f64,
    /// χ² of the next best set of wraps among those that are nearest to some range, infinite if there is none. The best set is
    /// exp((`runner_up` − `residual`)/2) times as likely as it.
    pub runner_up: f64,
    /// The largest difference of two frequencies' ranges in metres, 0 for a single frequency. Surfaces at several ranges in one
    /// pixel, and indirect light, make frequencies disagree.
    pub spread_m: f64,
}

impl Unwrapper {
    /// The unwrapper of 1 to [`MOST_FREQUENCIES`] frequencies in hertz, whole positive numbers. `None` for others, and if their
    /// greatest common divisor is so small that there are more than 10,000 wraps to compare.
    pub fn new(frequencies_hz: &[f64]) -> Option<Self> {
        let whole = |f: &f64| f.is_finite() && *f >= 1.0 && f.fract() == 0.0;
        let divisor = common_divisor(frequencies_hz);
        if !(1..=MOST_FREQUENCIES).contains(&frequencies_hz.len())
            || !frequencies_hz.iter().all(whole)
            || frequencies_hz.iter().sum::<f64>() / divisor > MOST_WRAPS
        {
            return None;
        }
        Some(Self {
            frequencies_hz: frequencies_hz.to_vec(),
            wraps: frequencies_hz.iter().map(|f| (f / divisor) as usize).collect(),
            range_m: unambiguous_range_m(frequencies_hz),
        })
    }

    /// The frequencies in hertz.
    pub fn frequencies_hz(&self) -> &[f64] {
        &self.frequencies_hz
    }

    /// The unambiguous range in metres.
    pub fn range_m(&self) -> f64 {
        self.range_m
    }

    /// The range from `from_m` to `from_m` + the unambiguous range that the phases tell, given their standard deviations; all are
    /// in radians and in the order of the frequencies. A frequency with an infinite deviation says nothing, and `None` is
    /// returned if all are so. A surface that noise moves nearer than `from_m` is told as one that lies the unambiguous range farther.
    ///
    /// The search is exact. With a range d, the best wrap of a frequency is the one nearest to d, so the best set of all only
    /// changes where d passes the middle between two wraps of a frequency. These middles split the unambiguous range into as many
    /// cells as there are wraps in it, 9 at 20, 60 and 100 MHz and 27 at 16, 80 and 120 MHz, and each cell is tried.
    ///
    /// Without noise the residual is 0, and the runner-up is D², the squared distance to the nearest wrong wraps in deviations.
    /// Noise prefers those, on either side, with the probability 2Φ(−D/2), which is the rate of wrong wraps if they are few.
    pub fn unwrap(&self, phases: &[f64], sigmas: &[f64], from_m: f64) -> Option<Unwrapped> {
        let mut ladders = [Ladder::default(); MOST_FREQUENCIES];
        let (mut used, mut cells) = (0, 0);
        for (i, &frequency) in self.frequencies_hz.iter().enumerate() {
            let sigma_m = range_m(sigmas[i], frequency);
            let weight = 1.0 / (sigma_m * sigma_m);
            if weight > 0.0 && weight.is_finite() {
                ladders[used] = Ladder::new(phases[i], frequency, weight, from_m);
                used += 1;
                cells += self.wraps[i];
            }
        }
        let ladders = &mut ladders[..used];
        let weight: f64 = ladders.iter().map(|ladder| ladder.weight).sum();
        let (best, runner_up) = match ladders {
            [a] => Fit::best_two([*a], weight, cells),
            [a, b] => Fit::best_two([*a, *b], weight, cells),
            [a, b, c] => Fit::best_two([*a, *b, *c], weight, cells),
            [a, b, c, d] => Fit::best_two([*a, *b, *c, *d], weight, cells),
            _ => return None,
        };
        // The first and the last cell reach beyond the ends, where ranges repeat.
        let periods = ((best.mean - from_m) / self.range_m).floor();
        let ranges = ladders.iter().map(|ladder| ladder.nearest(best.mean));
        let (low, high) = ranges.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), r| (r.min(l), r.max(h)));
        Some(Unwrapped {
            range_m: best.mean - periods * self.range_m,
            sigma_m: 1.0 / weight.sqrt(),
            residual: best.residual,
            runner_up,
            spread_m: high - low,
        })
    }
}

/// The ranges of a phase, `first` + n·`step`, and a place among them.
#[derive(Clone, Copy, Default)]
struct Ladder {
    first: f64,
    step: f64,
    weight: f64,
    wrap: f64,
    /// The range at that place.
    range: f64,
    /// Where the next range becomes the nearest.
    end: f64,
}

impl Ladder {
    /// The ladder at its range nearest to `from`.
    fn new(phase: f64, frequency: f64, weight: f64, from: f64) -> Self {
        let (first, step) = (range_m(phase, frequency), range_m(TAU, frequency));
        let ladder = Self { first, step, weight, ..Self::default() };
        ladder.at(ladder.wrap_near(from))
    }

    fn wrap_near(&self, range: f64) -> f64 {
        ((range - self.first) / self.step + 0.5).floor()
    }

    fn nearest(&self, range: f64) -> f64 {
        self.first + self.wrap_near(range) * self.step
    }

    fn at(self, wrap: f64) -> Self {
        Self {
            wrap,
            range: self.first + wrap * self.step,
            end: self.first + (wrap + 0.5) * self.step,
            ..self
        }
    }

    /// Moves on the ladder whose range is the first to be no longer the nearest. All ladders are set again, without a branch and without
    /// memory in between, which takes half as long as setting the one.
    #[inline(always)]
    fn climb_next<const N: usize>(ladders: &mut [Self; N]) {
        let (mut next, mut end) = (0, ladders[0].end);
        for (i, ladder) in ladders.iter().enumerate().skip(1) {
            (next, end) = if ladder.end < end { (i, ladder.end) } else { (next, end) };
        }
        for (i, ladder) in ladders.iter_mut().enumerate() {
            *ladder = ladder.at(ladder.wrap + if i == next { 1.0 } else { 0.0 });
        }
    }
}

/// The room that a bound of a residual leaves for roundings, relative to it.
const ROOM: f64 = 1e-9;

/// How well the ranges of a set of wraps agree.
#[derive(Clone, Copy)]
struct Fit {
    mean: f64,
    residual: f64,
}

impl Fit {
    /// The best fit in so many cells, from these places of the ladders on, and the residual of the next best one. `weight` is the sum
    /// of the ladders' weights.
    ///
    /// The residual of two ladders alone, with the weights a and b, is their gap squared over 1/a + 1/b, and others only add to it.
    /// Where that is more than the residual of the next best fit so far, the fit is neither, and is not worked out. Both are rounded by
    /// some 2⁻⁵⁰ of themselves, which is far less than [`ROOM`].
    fn best_two<const N: usize>(mut ladders: [Ladder; N], weight: f64, cells: usize) -> (Self, f64) {
        let (mut best, mut runner_up) = (Self::of(&ladders, weight), f64::INFINITY);
        let per_gap = (1.0 - ROOM) / (1.0 / ladders[0].weight + 1.0 / ladders[N - 1].weight);
        for _ in 1..cells {
            Ladder::climb_next(&mut ladders);
            let gap = ladders[N - 1].range - ladders[0].range;
            if per_gap * gap * gap > runner_up {
                continue;
            }
            let fit = Self::of(&ladders, weight);
            if fit.residual < best.residual {
                (best, runner_up) = (fit, best.residual);
            } else {
                runner_up = runner_up.min(fit.residual);
            }
        }
        (best, runner_up)
    }

    /// The fit of the ladders' places; `weight` is the sum of their weights.
    #[inline(always)]
    fn of(ladders: &[Ladder], weight: f64) -> Self {
        let mean = ladders.iter().map(|l| l.weight * l.range).sum::<f64>() / weight;
        let residual = ladders.iter().map(|l| l.weight * (l.range - mean) * (l.range - mean)).sum();
        Self { mean, residual }
    }
}

/// Why a pixel's range is dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unreliable {
    /// A tap was full.
    Saturated,
    /// A frequency came back with too small an amplitude.
    LowSignal,
    /// The frequencies tell ranges too far apart: light of several surfaces, or indirect light.
    Disagreement,
    /// Another set of wraps fits nearly as well.
    Ambiguous,
}

/// What a camera takes for reliable. Zeros and infinities turn a limit off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reliable {
    /// The least amplitude A of a tap at each frequency, in electrons.
    pub least_amplitude: f64,
    /// The largest difference between the ranges of two frequencies, in metres.
    pub most_spread_m: f64,
    /// How much larger χ² of the next best set of wraps is at least.
    pub least_margin: f64,
}

impl Reliable {
    /// The range that a pixel tells, or why it is dropped: the first reason in the order of [`Unreliable`]. The range is unwrapped only
    /// if its light is enough. One that cannot be unwrapped at all has too little signal.
    pub fn judge(
        &self,
        measured: &[Demodulated],
        unwrap: impl FnOnce() -> Option<Unwrapped>,
    ) -> Result<Unwrapped, Unreliable> {
        if measured.iter().any(|m| m.saturated) {
            return Err(Unreliable::Saturated);
        }
        if measured.iter().any(|m| m.phasor.amplitude() < self.least_amplitude) {
            return Err(Unreliable::LowSignal);
        }
        let unwrapped = unwrap().ok_or(Unreliable::LowSignal)?;
        if unwrapped.spread_m > self.most_spread_m {
            return Err(Unreliable::Disagreement);
        }
        if unwrapped.runner_up - unwrapped.residual < self.least_margin {
            return Err(Unreliable::Ambiguous);
        }
        Ok(unwrapped)
    }
}

#[cfg(test)]
mod tests {
    use super::super::detection::normal_below;
    use super::super::phasor::{ModulatedLight, TofPixel};
    use super::super::testing::{agrees, close};
    use super::*;
    use crate::rng::Rng;

    fn unwrapper(frequencies_mhz: &[f64]) -> Unwrapper {
        let hz: Vec<_> = frequencies_mhz.iter().map(|f| f * 1e6).collect();
        Unwrapper::new(&hz).unwrap()
    }

    /// The phases of a range.
    fn phases(unwrapper: &Unwrapper, range: f64) -> Vec<f64> {
        let turns = unwrapper.frequencies_hz().iter().map(|f| 2.0 * f * range / SPEED_OF_LIGHT_M_S);
        turns.map(|turns| TAU * (turns - turns.floor())).collect()
    }

    #[test]
    fn the_common_divisor_sets_the_range() {
        for (frequencies, range, wraps) in [
            (&[20.0, 60.0, 100.0][..], 7.49, 9),
            (&[16.0, 80.0, 120.0], 18.74, 27),
            (&[190.0, 194.0, 200.0], 74.95, 292),
            (&[50.0], 3.00, 1),
        ] {
            let unwrapper = unwrapper(frequencies);
            agrees(unwrapper.range_m(), range, 0.01);
            assert_eq!(unwrapper.wraps.iter().sum::<usize>(), wraps);
        }
        for wrong in
            [&[][..], &[0.0], &[-2e7], &[f64::NAN], &[2.5], &[2e7, 3e7, 4e7, 5e7, 6e7], &[1e8, 100_000_001.0]]
        {
            assert_eq!(Unwrapper::new(wrong), None, "{wrong:?}");
        }
    }

    /// Ranges of 0 to 15 m without noise, modulo the unambiguous range. Phases round to 2⁻⁵² of a turn and their cycles to as much
    /// of 20, which is far from any wrong wrap.
    #[test]
    fn exact_phases_tell_exact_ranges() {
        for frequencies in
            [&[20.0, 60.0, 100.0][..], &[16.0, 80.0, 120.0], &[190.0, 194.0, 200.0], &[60.0, 100.0], &[15.0]]
        {
            let unwrapper = unwrapper(frequencies);
            let sigmas = vec![0.0177; frequencies.len()];
            for i in 0..=3000 {
                let range = f64::from(i) * 0.005;
                let told = unwrapper.unwrap(&phases(&unwrapper, range), &sigmas, -0.002).unwrap();
                let expected = range - ((range + 0.002) / unwrapper.range_m()).floor() * unwrapper.range_m();
                assert!((told.range_m - expected).abs() < 1e-11, "{frequencies:?} {range}: {told:?}");
                assert!(told.residual < 1e-15 && told.spread_m < 1e-11, "{frequencies:?} {range}: {told:?}");
                assert!(told.runner_up > 100.0 || frequencies.len() == 1 && told.runner_up.is_infinite());
            }
        }
    }

    /// Sets of wraps within the unambiguous range on either side of 0, each with its mean and its residual for these phases: all
    /// whose ranges differ from the first frequency's, the lowest, by at most two of its steps. Others have residuals beyond any
    /// noise, as they differ by two turns and more.
    fn all_sets(unwrapper: &Unwrapper, phases: &[f64], sigmas: &[f64]) -> Vec<(Vec<i64>, f64, f64)> {
        let step = |i: usize| range_m(TAU, unwrapper.frequencies_hz[i]);
        let mut sets = vec![Vec::new()];
        for (i, &wraps) in unwrapper.wraps.iter().enumerate() {
            let reach = wraps as i64;
            let near = |set: &[i64], n: i64| {
                set.first()
                    .is_none_or(|&first| (first as f64 * step(0) - n as f64 * step(i)).abs() <= 2.0 * step(0))
            };
            sets = sets
                .iter()
                .flat_map(|set: &Vec<i64>| {
                    (-reach..=reach).filter(|&n| near(set, n)).map(|n| [&set[..], &[n]].concat())
                })
                .collect();
        }
        let with_fit = |set: Vec<i64>| {
            let ladders: Vec<_> = (0..set.len())
                .map(|i| {
                    let frequency = unwrapper.frequencies_hz[i];
                    let sigma = range_m(sigmas[i], frequency);
                    Ladder::new(phases[i], frequency, 1.0 / (sigma * sigma), 0.0).at(set[i] as f64)
                })
                .collect();
            let fit = Fit::of(&ladders, ladders.iter().map(|l| l.weight).sum());
            (set, fit.mean, fit.residual)
        };
        sets.into_iter().map(with_fit).collect()
    }

    /// The residuals of the sets of wraps that are nearest to some range in [0, the unambiguous range), one set for each piece
    /// between two middles of wraps; the first and the last piece are one, on either side of where ranges repeat.
    fn nearest_sets(unwrapper: &Unwrapper, phases: &[f64], sigmas: &[f64]) -> Vec<f64> {
        let rungs = |i: usize| {
            let (first, step) =
                (range_m(phases[i], unwrapper.frequencies_hz[i]), range_m(TAU, unwrapper.frequencies_hz[i]));
            let reach = unwrapper.wraps[i] as i32 + 2;
            (-reach..=reach).map(move |n| (first + f64::from(n) * step, first + (f64::from(n) + 0.5) * step))
        };
        let weights: Vec<_> = (0..phases.len())
            .map(|i| range_m(sigmas[i], unwrapper.frequencies_hz[i]))
            .map(|s| 1.0 / (s * s))
            .collect();
        let all = (0..phases.len()).flat_map(rungs).map(|(_, middle)| middle);
        let mut middles: Vec<_> = all.filter(|m| (0.0..unwrapper.range_m()).contains(m)).collect();
        middles.sort_by(f64::total_cmp);
        let residual = |range: f64| {
            let nearest = |i: usize| {
                let distance = |r: f64| (r - range).abs();
                rungs(i).map(|(r, _)| r).min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap()
            };
            let ranges: Vec<_> = (0..phases.len()).map(nearest).collect();
            let sum =
                |of: &dyn Fn(f64) -> f64| ranges.iter().zip(&weights).map(|(r, w)| w * of(*r)).sum::<f64>();
            let mean = sum(&|r| r) / weights.iter().sum::<f64>();
            sum(&|r| (r - mean) * (r - mean))
        };
        middles.windows(2).map(|pair| residual(0.5 * (pair[0] + pair[1]))).chain([residual(0.0)]).collect()
    }

    /// Any phases, such as noise makes at its worst: no set of wraps fits better than the one that is found.
    #[test]
    fn no_set_of_wraps_fits_better() {
        let mut rng = Rng::new(23);
        for frequencies in
            [&[20.0, 60.0, 100.0][..], &[16.0, 80.0, 120.0], &[30.0, 50.0], &[40.0, 60.0, 70.0]]
        {
            let unwrapper = unwrapper(frequencies);
            // There are some 3000 sets for each draw at 16, 80 and 120 MHz, and 11 to 90 times fewer at the others.
            let draws = if frequencies[0] == 16.0 { 40 } else { 500 };
            for _ in 0..draws {
                let phases: Vec<_> = frequencies.iter().map(|_| TAU * rng.unit()).collect();
                let sigmas: Vec<_> = frequencies.iter().map(|_| 0.05 + rng.unit()).collect();
                let told = unwrapper.unwrap(&phases, &sigmas, 0.0).unwrap();
                let sets = all_sets(&unwrapper, &phases, &sigmas);
                let best = sets.iter().map(|set| set.2).fold(f64::INFINITY, f64::min);
                close(told.residual, best, 1e-10);
                let apart = |mean: f64| ((mean - told.range_m) / unwrapper.range_m()).rem_euclid(1.0);
                let same = |mean: f64| apart(mean) < 1e-9 || apart(mean) > 1.0 - 1e-9;
                assert!(sets.iter().all(|set| set.2 > best * (1.0 + 1e-10) || same(set.1)));
                let mut residuals = nearest_sets(&unwrapper, &phases, &sigmas);
                residuals.sort_by(f64::total_cmp);
                close(told.residual, residuals[0], 1e-10);
                close(told.runner_up, residuals[1], 1e-10);
            }
        }
    }

    /// The rate of wrong wraps, with normal phases: at least 2Φ(−D/2) for the nearest wrong wraps, which lie on both sides, and at
    /// most the sum of Φ(−D/2) over all. Each is held to within four standard errors of 20,000 draws over 0.5 to 15 m.
    #[test]
    fn noise_takes_wrong_wraps_as_often_as_it_must() {
        let mut rng = Rng::new(29);
        for (frequencies, sigma, least) in [
            (&[20.0, 60.0, 100.0][..], 0.5, 0.005),
            (&[16.0, 80.0, 120.0], 0.4, 0.01),
            (&[190.0, 194.0, 200.0], 0.05, 0.01),
            (&[60.0, 100.0], 0.5, 0.005),
        ] {
            let unwrapper = unwrapper(frequencies);
            let sigmas = vec![sigma; frequencies.len()];
            let zeros = vec![0.0; frequencies.len()];
            let at_zero = unwrapper.unwrap(&zeros, &sigmas, -1.0).unwrap();
            let lower = 2.0 * normal_below(-0.5 * at_zero.runner_up.sqrt());
            // Sets that repeat with the unambiguous range count once: those whose mean is in one period about 0.
            let half = 0.5 * unwrapper.range_m();
            let sets = all_sets(&unwrapper, &zeros, &sigmas);
            let wrong = sets.iter().filter(|set| set.1.abs() <= half && set.0.iter().any(|&n| n != 0));
            let upper: f64 = wrong.map(|set| normal_below(-0.5 * set.2.sqrt())).sum();
            assert!(lower > least, "{frequencies:?}: {lower}");
            let (draws, mut wrong) = (20_000, 0);
            for _ in 0..draws {
                let range = 0.5 + 14.5 * rng.unit();
                let noisy: Vec<_> =
                    phases(&unwrapper, range).iter().map(|p| p + sigma * rng.normal()).collect();
                let told = unwrapper.unwrap(&noisy, &sigmas, 0.0).unwrap();
                let turns = (told.range_m - range) / unwrapper.range_m();
                let error = (turns - turns.round()) * unwrapper.range_m();
                // With the right wraps the error is the weighted mean of the noise.
                let weights: f64 = frequencies.iter().map(|f| f * f).sum();
                let right: f64 = (0..frequencies.len())
                    .map(|i| {
                        let turned = (noisy[i] - phases(&unwrapper, range)[i]) * frequencies[i];
                        turned * range_m(1.0, 1e6) / weights
                    })
                    .sum();
                wrong += u32::from((error - right).abs() > 1e-6);
            }
            let rate = f64::from(wrong) / f64::from(draws);
            let allowed = |p: f64| 4.0 * (p / f64::from(draws)).sqrt();
            assert!(rate > lower - allowed(lower), "{frequencies:?}: {rate} {lower} {upper}");
            assert!(rate < upper + allowed(upper), "{frequencies:?}: {rate} {lower} {upper}");
        }
    }

    /// 10⁴ electrons a frequency at the contrast .8: D/2 is 6.5 at 190, 194 and 200 MHz, and larger at the others, so one in 10¹⁰
    /// wraps would be wrong, and none of 3000 is. The ranges scatter by the sigma that is told: χ² to four standard errors.
    #[test]
    fn wraps_are_right_with_light_enough() {
        let pixel =
            TofPixel { contrast: 0.8, third_harmonic: 0.0, read_noise: 0.0, full_well: f64::INFINITY };
        let mut rng = Rng::new(41);
        for frequencies in [&[20.0, 60.0, 100.0][..], &[16.0, 80.0, 120.0], &[190.0, 194.0, 200.0]] {
            let unwrapper = unwrapper(frequencies);
            let (draws, mut square, mut residual) = (3000, 0.0, 0.0);
            for i in 0..draws {
                let range = 0.1 + 14.9 * f64::from(i) / f64::from(draws);
                let measured: Vec<Demodulated> = unwrapper
                    .frequencies_hz()
                    .iter()
                    .map(|&f| {
                        let mut light = ModulatedLight::default();
                        light.add_path(1e4, 2.0 * range, f);
                        let taps: [f64; 4] =
                            std::array::from_fn(|k| pixel.tap(k, 4, &light, || rng.normal()));
                        pixel.demodulate(&taps)
                    })
                    .collect();
                let phases: Vec<_> = measured.iter().map(|m| m.phasor.phase()).collect();
                let sigmas: Vec<_> = measured.iter().map(|m| m.phase_sigma(0.0)).collect();
                let told = unwrapper.unwrap(&phases, &sigmas, 0.0).unwrap();
                let turns = (told.range_m - range) / unwrapper.range_m();
                let error = (turns - turns.round()) * unwrapper.range_m() / told.sigma_m;
                assert!(error.abs() < 6.0, "{frequencies:?} {range}: {told:?}");
                square += error * error / f64::from(draws);
                residual += told.residual / f64::from(draws);
            }
            // The electrons that are counted make the deviations scatter by 1 %, which is 10⁻⁴ in the mean.
            let allowed = |freedom: f64| 4.0 * (2.0 * freedom / f64::from(draws)).sqrt();
            assert!((square - 1.0).abs() < allowed(1.0), "{frequencies:?}: {square}");
            assert!((residual - 2.0).abs() < allowed(2.0), "{frequencies:?}: {residual}");
        }
    }

    #[test]
    fn a_frequency_without_light_says_nothing() {
        let all = unwrapper(&[20.0, 60.0, 100.0]);
        let told = all.unwrap(&phases(&all, 3.3), &[f64::INFINITY, 0.01, 0.01], 0.0).unwrap();
        assert!((told.range_m - 3.3).abs() < 1e-11);
        // The other two have the same common divisor, so nothing is ambiguous.
        assert!(told.runner_up > 100.0);
        // 60 MHz alone repeats three times, so another set is as good.
        let told = all.unwrap(&phases(&all, 1.3), &[f64::INFINITY, 0.01, f64::INFINITY], 0.0).unwrap();
        let turns = (told.range_m - 1.3) / range_m(TAU, 60e6);
        assert!((turns - turns.round()).abs() < 1e-11 && told.runner_up < 1e-15, "{told:?}");
        assert_eq!(all.unwrap(&[0.0; 3], &[f64::INFINITY; 3], 0.0), None);
    }

    fn measured(electrons: f64, saturated: bool) -> Demodulated {
        let pixel =
            TofPixel { contrast: 0.8, third_harmonic: 0.0, read_noise: 0.0, full_well: f64::INFINITY };
        let mut light = ModulatedLight::default();
        light.add_path(electrons, 2.0, 2e7);
        let taps: [f64; 4] = std::array::from_fn(|k| pixel.mean_tap(k, 4, &light));
        Demodulated { saturated, ..pixel.demodulate(&taps) }
    }

    #[test]
    fn reasons_come_in_their_order() {
        let limits = Reliable { least_amplitude: 10.0, most_spread_m: 0.05, least_margin: 9.0 };
        let good = Unwrapped { range_m: 1.0, sigma_m: 0.01, residual: 1.0, runner_up: 40.0, spread_m: 0.02 };
        let bright = measured(1000.0, false);
        assert_eq!(limits.judge(&[bright; 3], || Some(good)), Ok(good));
        let full = measured(1000.0, true);
        // The range of a pixel without enough light is not asked for.
        let unasked = || unreachable!("the light is judged first");
        assert_eq!(limits.judge(&[bright, full], unasked), Err(Unreliable::Saturated));
        assert_eq!(limits.judge(&[bright, measured(49.0, false)], unasked), Err(Unreliable::LowSignal));
        assert_eq!(limits.judge(&[bright; 3], || None), Err(Unreliable::LowSignal));
        let apart = Unwrapped { spread_m: 0.06, runner_up: 2.0, ..good };
        assert_eq!(limits.judge(&[bright; 3], || Some(apart)), Err(Unreliable::Disagreement));
        let close = Unwrapped { runner_up: 9.9, ..good };
        assert_eq!(limits.judge(&[bright; 3], || Some(close)), Err(Unreliable::Ambiguous));
        let off = Reliable { least_amplitude: 0.0, most_spread_m: f64::INFINITY, least_margin: 0.0 };
        let odd = Unwrapped { spread_m: 9.0, ..close };
        assert_eq!(off.judge(&[bright; 3], || Some(odd)), Ok(odd));
    }

    /// A pixel of two surfaces at 1 and 2 m: the frequencies disagree by centimetres, which one surface does not do.
    #[test]
    fn flying_pixels_are_told_by_the_disagreement() {
        let pixel =
            TofPixel { contrast: 0.8, third_harmonic: 0.0, read_noise: 0.0, full_well: f64::INFINITY };
        let unwrapper = unwrapper(&[20.0, 60.0, 100.0]);
        let spread = |q: f64| {
            let told: Vec<Demodulated> = unwrapper
                .frequencies_hz()
                .iter()
                .map(|&f| {
                    let mut light = ModulatedLight::default();
                    light.add_path(1e5 * q, 2.0, f);
                    light.add_path(1e5 * (1.0 - q) / 4.0, 4.0, f);
                    let taps: [f64; 4] = std::array::from_fn(|k| pixel.mean_tap(k, 4, &light));
                    pixel.demodulate(&taps)
                })
                .collect();
            let phases: Vec<_> = told.iter().map(|m| m.phasor.phase()).collect();
            let sigmas: Vec<_> = told.iter().map(|m| m.phase_sigma(0.0)).collect();
            unwrapper.unwrap(&phases, &sigmas, 0.0).unwrap().spread_m
        };
        assert!(spread(0.0) < 1e-12 && spread(1.0) < 1e-12);
        for (q, least) in [(0.25, 1.4242 - 1.3349), (0.5, 1.1884 - 1.0723), (0.75, 1.0699 - 1.0208)] {
            // 20 and 60 MHz differ by what was computed for them, and 100 MHz lies farther off still.
            assert!(spread(q) > least - 1e-4, "{q}: {}", spread(q));
        }
    }
}
