//! A receiver that counts photons: from the light of a pulse to the counts of its echoes.

use crate::physics::echo::{Part, Peak};
use crate::physics::histogram::Exposure;
use crate::rng::Rng;
use crate::scan::Counts;
use crate::sensor::{Counter, Receiver};

/// What counts the light of a frame.
pub(super) struct Gauge {
    counter: Counter,
    counts_per_energy: f64,
}

/// The counts of an echo in one histogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Counted {
    pub counts: Counts,
    /// The energy that so many counts stand for while pile-up is small.
    pub light: f64,
    /// The range of the mean histogram's echo less that of the light's peak: pile-up, in metres.
    pub shift_m: f64,
    /// The range of this histogram's echo less that of the mean one, in metres.
    pub noise_m: f64,
}

impl Gauge {
    /// What counts the light of a receiver in a range window under so much sun, relative to that of the range pairs. `None` if the
    /// receiver measures power.
    pub fn new(receiver: &Receiver, window_m: f64, sun: f64) -> Option<Self> {
        let counter = receiver.counter(window_m, receiver.background(sun))?;
        let counts_per_energy = counter.limit_counts() / receiver.limit_snr(window_m);
        Some(Self { counter, counts_per_energy })
    }

    /// Exposes a histogram to light, which is sorted by range.
    pub fn expose(&self, parts: &[Part], exposure: &mut Exposure) {
        self.counter.histogram.expose(parts, self.counts_per_energy, exposure);
    }

    /// The mean number of counts in the gate of an echo of this energy, if no count blinded the detector for others.
    pub fn counts_of(&self, energy: f64) -> f64 {
        let histogram = &self.counter.histogram;
        f64::from(histogram.cycles()) * histogram.gate_share() * self.counts_per_energy * energy
    }

    /// Counts the echo of peak number `number` of the light. `None` if the histogram ends before.
    pub fn count(
        &self,
        exposure: &mut Exposure,
        peaks: &[Peak],
        number: usize,
        mut stream: Rng,
    ) -> Option<Counted> {
        let histogram = &self.counter.histogram;
        let peak_m = peaks[number].range_m;
        // An echo ends halfway to the next.
        let middle = |other: &Peak| 0.5 * (other.range_m + peak_m);
        let from_m = number.checked_sub(1).map_or(0.0, |before| middle(&peaks[before]));
        let to_m = peaks.get(number + 1).map_or(f64::INFINITY, middle);
        let echo = histogram.echo(exposure, peak_m, [from_m, to_m])?;
        let (drawn, range_m) =
            histogram.draw(exposure, &echo, |trials, chance| stream.binomial(trials, chance));
        let counts = Counts { drawn, mean: echo.counts, background: echo.background, least: echo.least };
        Some(Counted {
            counts,
            light: histogram.light_of(&echo, f64::from(drawn)) / self.counts_per_energy,
            shift_m: echo.range_m - peak_m,
            noise_m: range_m - echo.range_m,
        })
    }
}

impl Counted {
    /// The mean height of the echo, and that of this histogram, in the unit in which the least number of counts that is detected is
    /// just above the threshold, and background has 0. If there are many counts, the unit is the background's standard deviation.
    pub fn heights(&self, threshold: f64) -> [f64; 2] {
        let Counts { drawn, mean, background, least } = self.counts;
        let unit = (f64::from(least) - 0.5 - background) / threshold;
        [mean, f64::from(drawn)].map(|counts| (counts - background) / unit)
    }
}
