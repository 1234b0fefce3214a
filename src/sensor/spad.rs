//! A receiver that counts photons: a single-photon avalanche diode (SPAD), and the histogram that it makes.

use super::measurement::{Receiver, Spad};
use crate::physics::SPEED_OF_LIGHT_M_S;
use crate::physics::detection::{RangePair, Sensitivity};
use crate::physics::echo::pulse_sigma_m;
use crate::physics::histogram::{Counting, Exposure, Histogram};

/// What a plane sends back to a receiver that counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CountedPlane {
    /// The mean number of counts in the gate of the echo.
    pub counts: f64,
    /// The mean number that background alone has there.
    pub background: f64,
    /// The least number that is detected.
    pub least: u32,
    /// The probability of detection.
    pub detection: f64,
    /// The share of the cycles in which background has blinded the detector before.
    pub blind: f64,
    /// How much nearer the echo lies by pile-up, as a negative number of metres.
    pub shift_m: f64,
    /// The standard deviation of the range, in metres, to first order.
    pub sigma_m: f64,
}

/// A receiver's histogram, and the light that it counts.
#[derive(Clone, Debug)]
pub struct Counter {
    /// The histogram.
    pub histogram: Histogram,
    /// The mean number of counts a cycle of a plane at the range of the nearest pair.
    limit_counts: f64,
    /// By this a plane's light falls with its range.
    sensitivity: Sensitivity,
}

impl Spad {
    /// The most bins of a histogram.
    pub const MOST_BINS: usize = 1 << 16;

    /// The width of a bin in metres of range.
    pub fn bin_m(&self) -> f64 {
        0.5 * SPEED_OF_LIGHT_M_S * self.bin_s
    }

    /// The histogram of a receiver in a range window, up to a range, with so many times the background.
    fn histogram(&self, receiver: &Receiver, window_m: f64, end_m: f64, background: f64) -> Histogram {
        let half = 0.5 * SPEED_OF_LIGHT_M_S;
        let counting = Counting {
            cycles: self.cycles,
            bin_m: self.bin_m(),
            dead_m: self.dead_s * half,
            background_per_m: self.background_hz * background / half,
        };
        let sigma_m = pulse_sigma_m(receiver.pulse_fwhm_s);
        Histogram::new(counting, window_m, end_m, sigma_m, receiver.false_alarm_of_threshold())
    }

    /// The least time, in seconds, for which a diode must be blind so that no cycle counts twice in the echo of a pulse.
    pub fn least_dead_s(pulse_fwhm_s: f64) -> f64 {
        Counting::LEAST_DEAD * pulse_sigma_m(pulse_fwhm_s) * 2.0 / SPEED_OF_LIGHT_M_S
    }
}

impl Receiver {
    /// Lets the receiver count photons, in a range window of so many metres. Planes at the range pairs have as much light as it takes
    /// for their detection, and in between light falls by the power of the range that fits them, now without what background does.
    ///
    /// # Errors
    ///
    /// The first pair at which no light is detected so often.
    pub fn counting(mut self, spad: Spad, window_m: f64) -> Result<Self, RangePair> {
        // A job may shorten the range of a sensor, and its pairs say as much as before.
        let end_m = self.range_pairs.iter().map(|pair| pair.range_m).fold(window_m, f64::max);
        let histogram = spad.histogram(&self, window_m, end_m, 1.0);
        let lights: Vec<f64> = self
            .range_pairs
            .iter()
            .map(|pair| histogram.light_for(pair.range_m, self.detection).ok_or(*pair))
            .collect::<Result<_, _>>()?;
        let nearest = (0..lights.len())
            .min_by(|&a, &b| self.range_pairs[a].range_m.total_cmp(&self.range_pairs[b].range_m));
        if let Some(nearest) = nearest {
            self.limit_counts = lights[nearest];
            // A plane that needs twice the light of the nearest is as good as one of half of its reflectivity that needs the same.
            let same: Vec<RangePair> = self
                .range_pairs
                .iter()
                .zip(&lights)
                .map(|(pair, light)| RangePair {
                    reflectivity: pair.reflectivity * lights[nearest] / light,
                    ..*pair
                })
                .collect();
            self.sensitivity = Sensitivity::fit(&same);
        }
        self.spad = Some(spad);
        Ok(self)
    }

    /// What counts the light in a range window, with so many times the background of the range pairs; `None` if the receiver counts
    /// none.
    pub fn counter(&self, window_m: f64, background: f64) -> Option<Counter> {
        let (spad, sensitivity) = (self.spad?, self.sensitivity?);
        let histogram = spad.histogram(self, window_m, window_m, background);
        Some(Counter { histogram, limit_counts: self.limit_counts, sensitivity })
    }
}

impl Counter {
    /// The mean number of counts a cycle of a plane at the limit of detection.
    pub fn limit_counts(&self) -> f64 {
        self.limit_counts
    }

    /// What a plane sends back from a range, in clear air. `factor` is its power relative to a white plane. `None` if the histogram
    /// ends before.
    pub fn plane(&self, factor: f64, range_m: f64) -> Option<CountedPlane> {
        let mut exposure = Exposure::default();
        let counts = self.limit_counts * self.sensitivity.margin(factor, range_m);
        let echo = self.histogram.echo_of(range_m, counts, &mut exposure)?;
        Some(CountedPlane {
            counts: echo.counts,
            background: echo.background,
            least: echo.least,
            detection: self.histogram.detection(&echo),
            blind: self.histogram.blind(range_m),
            shift_m: echo.range_m - range_m,
            sigma_m: self.histogram.range_sigma_m(&exposure, &echo),
        })
    }

    /// The range up to which a plane is detected with this probability, within the window, to a millimetre.
    ///
    /// The least number of counts that is detected falls with the background by whole counts, at each of which the detection
    /// rises a little. So there may be several such ranges, a few percent apart, and this is one of them.
    pub fn range_m(&self, factor: f64, detection: f64, window_m: f64) -> f64 {
        let is_seen = |range_m: f64| {
            self.plane(factor, range_m).is_some_and(|plane| plane.detection >= detection * (1.0 - 1e-9))
        };
        if is_seen(window_m) {
            return window_m;
        }
        let (mut low, mut high) = (0.0, window_m);
        while high - low > 1e-3 {
            let middle = 0.5 * (low + high);
            if is_seen(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        // Rounded to the millimetre that it is known to.
        (high * 1e3).round() / 1e3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn receiver(pairs: &[(f64, f64)]) -> Receiver {
        let range_pairs: Vec<RangePair> =
            pairs.iter().map(|&(reflectivity, range_m)| RangePair { reflectivity, range_m }).collect();
        Receiver {
            sensitivity: Sensitivity::fit(&range_pairs),
            range_pairs,
            false_alarm: 1e-4,
            pulse_fwhm_s: 5e-9,
            ..Receiver::default()
        }
    }

    fn spad(background_hz: f64) -> Spad {
        Spad { cycles: 400, bin_s: 1e-9, dead_s: f64::INFINITY, background_hz }
    }

    /// Planes at the pairs are detected as stated, whatever the background takes on the way to each.
    #[test]
    fn range_pairs_hold_with_any_background() {
        for background_hz in [0.0, 1e5, 2e6] {
            for pairs in [&[(0.1, 60.0)][..], &[(0.1, 60.0), (0.8, 150.0)]] {
                let receiver = receiver(pairs).counting(spad(background_hz), 200.0).unwrap();
                let counter = receiver.counter(200.0, 1.0).unwrap();
                for &(reflectivity, range_m) in pairs {
                    let plane = counter.plane(reflectivity, range_m).unwrap();
                    // Halving finds the light to 10⁻¹⁴; the fit's logarithms and powers keep 10⁻¹² of it.
                    assert!((plane.detection - 0.5).abs() < 1e-9, "{background_hz} {range_m}: {plane:?}");
                    let told_m = counter.range_m(reflectivity, 0.5, 200.0);
                    // The gate moves by whole bins of 15 cm, and the least number falls by whole counts with the background: one count
                    // is so much of the light, which falls at least with the square of the range.
                    let count = 0.5 / (f64::from(plane.least) - plane.background);
                    let allowed_m = 0.3 + if background_hz > 0.0 { count * range_m } else { 0.0 };
                    assert!((told_m - range_m).abs() < allowed_m, "{background_hz} {range_m}: {told_m}");
                }
            }
        }
    }

    /// Five times the sunlight leaves fewer cycles for far planes than for near ones.
    #[test]
    fn sunlight_takes_the_far_range() {
        let receiver = receiver(&[(0.1, 60.0)]).counting(spad(5e5), 200.0).unwrap();
        let reach = |sun: f64| receiver.counter(200.0, sun).unwrap().range_m(0.8, 0.5, 200.0);
        let (dim, stated, bright) = (reach(0.2), reach(1.0), reach(5.0));
        assert!(dim > stated + 5.0 && stated > bright + 5.0, "{dim} {stated} {bright}");
        let white = receiver.counter(200.0, 1.0).unwrap().plane(1.0, 2.0).unwrap();
        assert!(white.shift_m < -0.1 && white.sigma_m > 0.0 && white.sigma_m < 0.01, "{white:?}");
    }

    #[test]
    fn what_no_light_is_enough_for_is_refused() {
        let blind = receiver(&[(0.1, 60.0)]).counting(spad(1e8), 200.0).unwrap_err();
        assert_eq!(blind.range_m, 60.0);
        // 7σ are 7·5 ns/2.3548.
        assert!((Spad::least_dead_s(5e-9) - 14.86e-9).abs() < 1e-11);
    }
}
