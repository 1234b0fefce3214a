//! Detection: thresholds and false alarms, the sensitivity that the range limits of data sheets imply, and the noise of a range.
//!
//! A receiver filters the light for the shape of its pulse and compares the result with a threshold. Noise is Gaussian with the
//! standard deviation 1, so the height of a peak is its signal-to-noise ratio (SNR), and a peak of the mean height S passes the
//! threshold T with the probability Φ(S − T) (M. A. Richards, "Fundamentals of Radar Signal Processing", 2005, chapter 6).

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use libm::{exp, expm1, log, log1p, pow};

/// The probability Φ(x) that a normal deviate is at most x.
pub fn normal_below(x: f64) -> f64 {
    0.5 * libm::erfc(-x * FRAC_1_SQRT_2)
}

/// The deviate that a normal deviate exceeds with the probability `p`, in (0, 1): the x with 1 − Φ(x) = p, to a few ulps.
///
/// The start is formula 26.2.23 of M. Abramowitz and I. A. Stegun, "Handbook of Mathematical Functions" (1964), which errs by less
/// than 4.5·10⁻⁴; three of Halley's steps remove that.
pub fn normal_exceeded(p: f64) -> f64 {
    if p > 0.5 {
        return -normal_exceeded(1.0 - p);
    }
    let t = (-2.0 * log(p)).sqrt();
    let mut x = t
        - (2.515_517 + t * (0.802_853 + t * 0.010_328))
            / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)));
    for _ in 0..3 {
        let error = 0.5 * libm::erfc(x * FRAC_1_SQRT_2) - p;
        let density = exp(-0.5 * x * x) / (2.0 * PI).sqrt();
        let step = error / density;
        // f = 1 − Φ has f″/f′ = −x.
        x += step / (1.0 + 0.5 * x * step);
    }
    x
}

/// The threshold at which a pulse without any light gives a false alarm with the probability `false_alarm`, in (0, 1). There are
/// as many independent chances as pulse lengths in the range window, M = 2·R/(c·τ): 1 − Φ(T)^M is the probability.
pub fn threshold(false_alarm: f64, window_m: f64, pulse_fwhm_s: f64) -> f64 {
    let chances = (2.0 * window_m / (super::SPEED_OF_LIGHT_M_S * pulse_fwhm_s)).max(1.0);
    // 1 − Φ(T) = 1 − (1 − p)^(1/M), without cancellation.
    normal_exceeded(-expm1(log1p(-false_alarm) / chances))
}

/// A statement of a data sheet: a plane of this reflectivity, which the beam meets at a right angle, is detected up to this range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangePair {
    /// The reflectivity, 1 for a white Lambertian plane.
    pub reflectivity: f64,
    /// The range in metres.
    pub range_m: f64,
}

/// The sensitivity of a receiver: a plane of reflectivity ρ is at the limit of detection at the range R with ρ ∝ R^k.
///
/// An extended target returns power in proportion to ρ/R², so k is 2 by physics (G. W. Kamerman, "Laser Radar", in: The Infrared
/// and Electro-Optical Systems Handbook, volume 6, 1993). Data sheets imply from 1.9 to 3.7, because devices average and limit
/// in ways of their own. Such an exponent holds from the nearest range of the data sheet on; nearer, power falls with R².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity {
    /// The least power that is detected, relative to that of a white plane at 1 m.
    pub least_power: f64,
    /// The exponent k by which power falls with range.
    pub exponent: f64,
    /// The range from which on the exponent holds, in metres.
    pub from_m: f64,
    /// The largest relative error of the range that the fit gives for a pair of the data sheet.
    pub misfit: f64,
}

impl Sensitivity {
    /// The sensitivity that range pairs imply: by least squares of the logarithms, with k = 2 for a single pair, or for pairs of
    /// one range or one reflectivity. `None` if there is no pair.
    pub fn fit(pairs: &[RangePair]) -> Option<Self> {
        let count = pairs.len() as f64;
        let logs: Vec<_> = pairs.iter().map(|pair| (log(pair.range_m), log(pair.reflectivity))).collect();
        let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / count;
        let (x, y) = (mean(|l| l.0), mean(|l| l.1));
        let along = logs.iter().map(|l| (l.0 - x) * (l.0 - x)).sum::<f64>();
        let both = logs.iter().map(|l| (l.0 - x) * (l.1 - y)).sum::<f64>();
        // Ranges that differ by less than a thousandth say nothing about an exponent.
        let exponent = if along > 1e-6 && both > 0.0 { both / along } else { 2.0 };
        let from_m = pairs.iter().map(|pair| pair.range_m).reduce(f64::min)?;
        // ρ = P·R^k at the data sheet's ranges is ρ = P·from^(k−2)·fall(R).
        let least_power = exp(y - exponent * x + (exponent - 2.0) * log(from_m));
        let fitted = Self { least_power, exponent, from_m, misfit: 0.0 };
        let error = |pair: &RangePair| (fitted.range_m(pair.reflectivity) / pair.range_m - 1.0).abs();
        Some(Self { misfit: pairs.iter().map(error).fold(0.0, f64::max), ..fitted })
    }

    /// The factor on the power of a target with which other beams of the same sensor, whose pairs these are, are as sensitive as this:
    /// a plane of one of the pairs is at the limit where `factor`·ρ = P·fall(R). Of several pairs it is the geometric mean, the least
    /// squares of the logarithms. Beside it is the largest relative error of the range that it gives for a pair. `None` without a pair.
    pub fn power_of(&self, pairs: &[RangePair]) -> Option<(f64, f64)> {
        let of_pair = |pair: &RangePair| log(self.least_power * self.fall(pair.range_m) / pair.reflectivity);
        if pairs.is_empty() {
            return None;
        }
        let power = exp(pairs.iter().map(of_pair).sum::<f64>() / pairs.len() as f64);
        let error = |pair: &RangePair| (self.range_m(power * pair.reflectivity) / pair.range_m - 1.0).abs();
        Some((power, pairs.iter().map(error).fold(0.0, f64::max)))
    }

    /// The factor by which the power of a target is less than at 1 m, in clear air: R², or from [`Sensitivity::from_m`] on
    /// R²·(R/from)^(k−2).
    pub fn fall(&self, range_m: f64) -> f64 {
        let square = range_m * range_m;
        if range_m <= self.from_m || self.exponent == 2.0 {
            return square;
        }
        square * pow(range_m / self.from_m, self.exponent - 2.0)
    }

    /// The range at which a plane of reflectivity ρ is at the limit of detection, in clear air.
    pub fn range_m(&self, reflectivity: f64) -> f64 {
        let fall = reflectivity / self.least_power;
        let square = fall.sqrt();
        if square <= self.from_m || self.exponent == 2.0 {
            return square;
        }
        self.from_m * pow(square / self.from_m, 2.0 / self.exponent)
    }

    /// The ratio of the power of a target to the least that is detected, in clear air. `factor` is f·cos θ of the target
    /// relative to a white plane at a right angle.
    pub fn margin(&self, factor: f64, range_m: f64) -> f64 {
        factor / (self.least_power * self.fall(range_m))
    }
}

/// The standard deviation of a range: √(floor² + (a·SNR^−b)²), in metres. The exponent b is ½ where shot noise alone counts
/// (LISA: V. Kilic et al., 2021); data sheets with several figures imply some 0.6 (Ouster OS1, first generation: 10, 3 and 1.5 cm
/// at SNRs of 12, 100 and 250 give a = 0.47 m and b = 0.615).
pub fn range_sigma_m(floor_m: f64, a_m: f64, b: f64, snr: f64) -> f64 {
    let of_snr = if a_m > 0.0 && snr > 0.0 { a_m * pow(snr, -b) } else { 0.0 };
    (floor_m * floor_m + of_snr * of_snr).sqrt()
}

/// The walk of a fixed threshold: how much earlier than its peak a Gaussian pulse of the standard deviation σ passes it, in
/// metres, at an amplitude of `over` thresholds: σ·√(2 ln over). Devices correct it from the pulse's width.
pub fn walk_m(sigma_m: f64, over: f64) -> f64 {
    sigma_m * (2.0 * log(over.max(1.0))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_distribution_and_its_inverse_agree() {
        for (x, p) in [(0.0, 0.5), (1.0, 0.841_344_746_068_543), (-2.0, 0.022_750_131_948_179_2)] {
            assert!((normal_below(x) - p).abs() < 1e-15, "{x}");
        }
        for x in [-7.0, -3.0, -0.5, 0.0, 1e-3, 0.7, 2.0, 4.8, 7.9, 20.0] {
            let p = 0.5 * libm::erfc(x * FRAC_1_SQRT_2);
            // Near 1 the probability itself has lost the digits of a small tail.
            let lost = f64::EPSILON / exp(-0.5 * x * x).max(1e-300);
            let allowed = 4e-15 * (1.0 + f64::abs(x)) + if x < 0.0 { 3.0 * lost } else { 0.0 };
            assert!((normal_exceeded(p) - x).abs() <= allowed, "{x}: {}", normal_exceeded(p));
        }
    }

    /// R = 120 m and τ = 6 ns: M = 133, and p = 10⁻⁴ gives T = 4.81, so an SNR of 4.81 at 50 %, 6.09 at 90 % and 7.14 at 99 %.
    #[test]
    fn the_threshold_follows_from_the_rate_of_false_alarms() {
        let t = threshold(1e-4, 120.0, 6e-9);
        assert!((t - 4.8114).abs() < 1e-3, "{t}");
        let at = |pd: f64| t - normal_exceeded(pd);
        assert!((at(0.9) - 6.09).abs() < 5e-3 && (at(0.99) - 7.14).abs() < 5e-3, "{} {}", at(0.9), at(0.99));
        // By its meaning, M chances pass with the probability p.
        let chances = 2.0 * 120.0 / (299_792_458.0 * 6e-9);
        assert!((1.0 - pow(normal_below(t), chances) - 1e-4).abs() < 1e-12);
    }

    /// Detection of a plane at shares of the range at which it is detected half of the time.
    #[test]
    fn detection_falls_with_range_as_the_closed_form_says() {
        let t = threshold(1e-4, 120.0, 6e-9);
        for (share, detected) in [(0.8, 0.996_60), (0.9, 0.870_46), (1.0, 0.5), (1.1, 0.201_85)] {
            let snr = t / (share * share);
            assert!((normal_below(snr - t) - detected).abs() < 2e-5, "{share}: {}", normal_below(snr - t));
        }
    }

    #[test]
    fn range_pairs_give_power_and_exponent() {
        let pair = |reflectivity, range_m| RangePair { reflectivity, range_m };
        let one = Sensitivity::fit(&[pair(0.1, 90.0)]).unwrap();
        assert!(
            (one.least_power - 1.234_567_9e-5).abs() < 1e-12 && one.exponent == 2.0 && one.misfit < 1e-15
        );
        assert!((one.range_m(0.5) - 201.246).abs() < 5e-4 && (one.range_m(0.8) - 254.558).abs() < 5e-4);
        assert!((one.range_m(0.25) - 142.302).abs() < 5e-4, "60°");
        // Livox Mid-40: from the ends, k = ln 8/ln(260/90) = 1.96.
        let mid40 = Sensitivity::fit(&[pair(0.1, 90.0), pair(0.2, 130.0), pair(0.8, 260.0)]).unwrap();
        assert!((mid40.exponent - 1.96).abs() < 0.01 && mid40.misfit < 0.02, "{mid40:?}");
        let os2 = Sensitivity::fit(&[pair(0.8, 350.0), pair(0.1, 200.0)]).unwrap();
        assert!((os2.exponent - 3.72).abs() < 5e-3 && os2.misfit < 1e-12, "{os2:?}");
        assert!((os2.margin(0.1, 200.0) - 1.0).abs() < 1e-12 && (os2.margin(0.8, 350.0) - 1.0).abs() < 1e-12);
        // Nearer than the data sheet says, power falls with the square.
        assert!((os2.margin(0.1, 100.0) - 4.0).abs() < 1e-12 && (os2.range_m(0.025) - 100.0).abs() < 1e-9);
        assert_eq!(Sensitivity::fit(&[]), None);
    }

    /// Hesai's XT32: 10 % at 80 m, and at 50 m by its outer beams, which get (50/80)² of the power.
    #[test]
    fn pairs_of_other_beams_give_their_share_of_the_power() {
        let pair = |reflectivity, range_m| RangePair { reflectivity, range_m };
        let xt32 = Sensitivity::fit(&[pair(0.1, 80.0)]).unwrap();
        let (power, misfit) = xt32.power_of(&[pair(0.1, 50.0)]).unwrap();
        assert!((power - 0.390_625).abs() < 1e-15 && misfit < 1e-15, "{power} {misfit}");
        // With another exponent, too: P·R^k = 0.1 at 200 m and 0.8 at 350 m, which is k = ln 8/ln 1.75.
        let os2 = Sensitivity::fit(&[pair(0.8, 350.0), pair(0.1, 200.0)]).unwrap();
        let (power, _) = os2.power_of(&[pair(0.1, 300.0)]).unwrap();
        assert!((power - pow(1.5, log(8.0) / log(1.75))).abs() < 1e-12, "{power}");
        // Two pairs that don't agree are missed by as much each: 50 and 45 m by √(50/45).
        let (_, misfit) = xt32.power_of(&[pair(0.1, 50.0), pair(0.1, 45.0)]).unwrap();
        assert!((misfit - ((50.0_f64 / 45.0).sqrt() - 1.0)).abs() < 1e-12, "{misfit}");
        assert_eq!(xt32.power_of(&[]), None);
    }

    /// Ouster's OS1: 10, 3 and 1.5 cm at SNRs of 12, 100 and 250.
    #[test]
    fn the_noise_of_a_range_falls_with_the_signal() {
        for (snr, sigma) in [(12.0, 0.10), (100.0, 0.03), (250.0, 0.015)] {
            let told = range_sigma_m(0.0, 0.47, 0.615, snr);
            // Two numbers are fitted to three figures.
            assert!((told / sigma - 1.0).abs() < 0.1, "{snr}: {told}");
        }
        assert_eq!(range_sigma_m(0.01, 0.0, 0.6, 0.0), 0.01);
        assert_eq!(range_sigma_m(0.03, 0.04, 0.5, 1.0), 0.05);
    }

    #[test]
    fn a_threshold_walks_with_the_amplitude() {
        for (over, walk) in [(2.0, 1.177), (10.0, 2.146), (100.0, 3.035)] {
            assert!((walk_m(1.0, over) - walk).abs() < 5e-4);
        }
        assert_eq!(walk_m(1.0, 0.5), 0.0);
    }
}
