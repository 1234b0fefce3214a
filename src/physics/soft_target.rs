//! The echo of fog and dust: a target that is soft, all along the beam.
//!
//! Source: M. Hahner, C. Sakaridis, D. Dai and L. Van Gool, "Fog simulation on real LiDAR point clouds for 3D object detection in
//! adverse weather" (ICCV 2021), in the units of this room, and for Gaussian pulses too.
//!
//! A layer of thickness dr at the range r has the power factor π·β·dr, as it scatters β = α/S per metre and steradian where a
//! white Lambert plane scatters 1/π per steradian. Its echo is π·β·ξ(r)·exp(−2αr)/r² dr, with the share ξ of the beam that the
//! receiver sees.

use std::f64::consts::PI;

use super::SPEED_OF_LIGHT_M_S;

/// The shape of a pulse in time. Its peak has the power 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PulseShape {
    /// exp(−t²/(2σ²)), with σ = FWHM/(2·√(2·ln 2)).
    Gaussian {
        /// The full width at half the peak's power, in seconds.
        fwhm_s: f64,
    },
    /// sin²(π·t/(2·FWHM)) from its beginning to its end, which lie two FWHM apart, as Hahner et al. have it.
    SineSquared {
        /// The full width at half the peak's power, in seconds.
        fwhm_s: f64,
    },
}

impl PulseShape {
    /// The power of the pulse at a distance in range from its peak. A range is half the way of light: c/2 times the time.
    pub fn power(self, distance_m: f64) -> f64 {
        match self {
            Self::Gaussian { fwhm_s } => {
                // exp(−t²/(2σ²)) = 2^(−4t²/FWHM²).
                let widths = 2.0 * distance_m / (SPEED_OF_LIGHT_M_S * fwhm_s);
                libm::exp2(-4.0 * widths * widths)
            }
            Self::SineSquared { fwhm_s } => {
                let widths = 2.0 * distance_m / (SPEED_OF_LIGHT_M_S * fwhm_s);
                if widths.abs() >= 1.0 {
                    return 0.0;
                }
                let amplitude = libm::cos(0.5 * PI * widths);
                amplitude * amplitude
            }
        }
    }

    /// The distance in range from the peak beyond which the pulse counts as 0. A Gaussian pulse is 2⁻³⁶ = 1.5e-11 at its own.
    fn half_length_m(self) -> f64 {
        let (Self::Gaussian { fwhm_s } | Self::SineSquared { fwhm_s }) = self;
        let width_m = 0.5 * SPEED_OF_LIGHT_M_S * fwhm_s;
        if matches!(self, Self::Gaussian { .. }) { 3.0 * width_m } else { width_m }
    }
}

/// Fog or dust along a beam, up to the target that ends it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftTarget {
    /// The extinction α per metre.
    pub extinction_per_m: f64,
    /// The lidar ratio S: extinction over backscatter, in steradians. See [`super::air`] for those of droplets and dust.
    pub lidar_ratio_sr: f64,
    /// The range in metres up to which the receiver sees nothing of the beam, more than 0.
    pub overlap_from_m: f64,
    /// The range in metres from which the receiver sees the whole beam, at least [`Self::overlap_from_m`]. The share that it
    /// sees, ξ, rises linearly between the two.
    pub overlap_to_m: f64,
    /// The range in metres of the surface that ends the beam.
    pub until_m: f64,
}

/// The largest value of an echo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// The range of the peak in metres, as a receiver finds it that places the peak of a hard target's echo at its range.
    pub range_m: f64,
    /// The echo at its peak. A white Lambert plane at 1 m in clear air has 1.
    pub echo: f64,
}

/// The share of the beam that the receiver sees at a range: it grows evenly from 0 to 1 over an interval of ranges.
pub fn overlap([from_m, to_m]: [f64; 2], range_m: f64) -> f64 {
    if range_m >= to_m {
        1.0
    } else if range_m <= from_m {
        0.0
    } else {
        (range_m - from_m) / (to_m - from_m)
    }
}

impl SoftTarget {
    /// The share of the beam that the receiver sees at a range: ξ(r).
    pub fn overlap(&self, range_m: f64) -> f64 {
        overlap([self.overlap_from_m, self.overlap_to_m], range_m)
    }

    /// π·β, the power factor per metre.
    pub fn power_factor_per_m(&self) -> f64 {
        PI * self.extinction_per_m / self.lidar_ratio_sr
    }

    /// The echo of the layer between two ranges, as one number: π·β·∫ξ(r)·exp(−2αr)/r² dr. It is the layer's energy, in units
    /// of that of a white Lambert plane at 1 m. Of `to_m` and [`Self::until_m`], one is finite.
    pub fn energy(&self, from_m: f64, to_m: f64) -> f64 {
        self.power_factor_per_m() * self.integral(from_m, to_m, |_| 1.0)
    }

    /// The echo over the range R: π·β·∫p(R − r)·ξ(r)·exp(−2αr)/r² dr, with the pulse p. A hard target at R0 has
    /// F·exp(−2α·R0)/R0²·p(R − R0) in the same units.
    pub fn echo(&self, pulse: PulseShape, range_m: f64) -> f64 {
        let half = pulse.half_length_m();
        self.power_factor_per_m()
            * self.integral(range_m - half, range_m + half, |r| pulse.power(range_m - r))
    }

    /// Hahner's integral in s/m², over the time t of the pulse: [`Self::echo`] over π·β·c/2.
    pub fn hahner_integral_s_m2(&self, pulse: PulseShape, range_m: f64) -> f64 {
        let half = pulse.half_length_m();
        2.0 / SPEED_OF_LIGHT_M_S * self.integral(range_m - half, range_m + half, |r| pulse.power(range_m - r))
    }

    /// The peak of [`Self::echo`].
    ///
    /// The echo has one peak: a function with one peak, smoothed by a pulse whose logarithm is concave, has one (I. A. Ibragimov
    /// 1956). The peak lies within the fog, and no farther behind the whole overlap than the pulse is long. The search narrows
    /// these bounds by the golden section, 50 times, to 4e-11 of their distance; rounding lets a peak's place be found to
    /// 1e-8 of its width.
    pub fn peak(&self, pulse: PulseShape) -> Peak {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let last = self.until_m.min(self.overlap_to_m + pulse.half_length_m());
        let (mut from, mut to) = (self.overlap_from_m.min(last), last);
        let at = |range_m| Peak { range_m, echo: self.echo(pulse, range_m) };
        let mut near = at(to - GOLDEN * (to - from));
        let mut far = at(from + GOLDEN * (to - from));
        for _ in 0..50 {
            if near.echo < far.echo {
                (from, near) = (near.range_m, far);
                far = at(from + GOLDEN * (to - from));
            } else {
                (to, far) = (far.range_m, near);
                near = at(to - GOLDEN * (to - from));
            }
        }
        if near.echo < far.echo { far } else { near }
    }

    /// The integral of weight(r)·ξ(r)·exp(−2αr)/r² over the part of the fog between two ranges.
    fn integral(&self, from_m: f64, to_m: f64, weight: impl Fn(f64) -> f64) -> f64 {
        let [from, to] = [from_m, to_m].map(|r| r.max(self.overlap_from_m).min(self.until_m));
        let kink = self.overlap_to_m.clamp(from, to.max(from));
        // With x = ln r, dr/r² is dx/r: steps in x are short where the integrand is steep, near the sensor.
        let over = |from: f64, to: f64| {
            if to <= from {
                return 0.0;
            }
            gauss(libm::log(from), libm::log(to), |x| {
                let r = libm::exp(x);
                weight(r) * self.overlap(r) * libm::exp(-2.0 * self.extinction_per_m * r) / r
            })
        };
        over(from, kink) + over(kink, to)
    }
}

/// The integral of a smooth function by the rule of Gauss with five points, on each of 24 panels.
fn gauss(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    // The places and weights in closed form are 0, ±√(5 ∓ 2√(10/7))/3 with 128/225 and (322 ± 13√70)/900.
    const PLACES: [f64; 2] = [0.538_469_310_105_683_1, 0.906_179_845_938_664];
    const WEIGHTS: [f64; 3] = [0.568_888_888_888_888_9, 0.478_628_670_499_366_47, 0.236_926_885_056_189_08];
    const PANELS: u32 = 24;
    let half = 0.5 * (to - from) / f64::from(PANELS);
    let panel = |i| {
        let middle = from + half * f64::from(2 * i + 1);
        let pair = |place: f64| f(middle - half * place) + f(middle + half * place);
        WEIGHTS[0] * f(middle) + WEIGHTS[1] * pair(PLACES[0]) + WEIGHTS[2] * pair(PLACES[1])
    };
    half * (0..PANELS).map(panel).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{agrees, close, midpoint};
    use super::super::{air, two_way_transmission};
    use super::*;

    /// Hahner's sensor, with a target at 50 m.
    fn fog(extinction_per_m: f64) -> SoftTarget {
        SoftTarget {
            extinction_per_m,
            lidar_ratio_sr: air::HAHNER_LIDAR_RATIO_SR,
            overlap_from_m: 0.9,
            overlap_to_m: 1.0,
            until_m: 50.0,
        }
    }
    const HAHNER: PulseShape = PulseShape::SineSquared { fwhm_s: 20e-9 };

    #[test]
    fn fog_returns_what_hahners_table_says() {
        // The integral is printed in ns/m² to three digits. The table's ranges lie on a grid of 14 mm, so that a peak may lie 7 mm
        // beside its figure, or half a millimetre more by rounding.
        for (alpha, range, integral) in [
            (0.005, 1.706, 4.568),
            (0.01, 1.706, 4.493),
            (0.03, 1.678, 4.206),
            (0.06, 1.650, 3.817),
            (0.1, 1.608, 3.362),
            (0.2, 1.524, 2.476),
        ] {
            let peak = fog(alpha).peak(HAHNER);
            agrees(1e9 * fog(alpha).hahner_integral_s_m2(HAHNER, peak.range_m), integral, 1e-3);
            agrees(peak.range_m, range, 0.015);
        }
        let short = PulseShape::SineSquared { fwhm_s: 10e-9 };
        let peak = fog(0.06).peak(short);
        agrees(1e9 * fog(0.06).hahner_integral_s_m2(short, peak.range_m), 3.091, 1e-3);
        agrees(peak.range_m, 1.442, 0.015);
    }

    #[test]
    fn hahners_integral_is_the_one_over_time() {
        // ∫ sin²(π·t/2τ)·exp(−2αr)·ξ(r)/r² dt over the pulse's 2τ, with r = R + c·(τ − t)/2 for a peak at R.
        let (target, tau) = (fog(0.06), 20e-9);
        for range in [0.95, 1.65, 3.0, 10.0, 49.0, 51.0] {
            let over_time = midpoint(0.0, 2.0 * tau, 400_000, |t| {
                let r = range + 0.5 * SPEED_OF_LIGHT_M_S * (tau - t);
                if r > 50.0 || r <= 0.9 {
                    return 0.0;
                }
                let sine = libm::sin(PI * t / (2.0 * tau));
                sine * sine * target.overlap(r) * libm::exp(-0.12 * r) / (r * r)
            });
            // The midpoint rule errs by a step in 400 000 at the kinks and the end, and less elsewhere.
            close(target.hahner_integral_s_m2(HAHNER, range), over_time, 3e-5);
        }
    }

    #[test]
    fn a_pulse_of_either_shape_has_its_width() {
        for pulse in [PulseShape::Gaussian { fwhm_s: 5e-9 }, HAHNER] {
            let (PulseShape::Gaussian { fwhm_s } | PulseShape::SineSquared { fwhm_s }) = pulse;
            assert_eq!(pulse.power(0.0), 1.0);
            let half = pulse.power(0.25 * SPEED_OF_LIGHT_M_S * fwhm_s);
            close(half, 0.5, 1e-14);
            assert!(pulse.power(pulse.half_length_m()) < 2e-11);
        }
        // Pulses of 5 ns have a standard deviation of .318275 m in range, where a Gaussian pulse is e^-½. A unit of the last
        // digit changes it by 3e-5.
        close(PulseShape::Gaussian { fwhm_s: 5e-9 }.power(0.318_275), libm::exp(-0.5), 3e-5);
    }

    #[test]
    fn the_echo_of_a_gaussian_pulse_is_the_sum_of_its_layers() {
        let (target, pulse) = (fog(0.03), PulseShape::Gaussian { fwhm_s: 5e-9 });
        for range in [0.95, 1.4, 3.0, 20.0, 50.2] {
            let layers: f64 = (0..49_100)
                .map(|i| {
                    let from = 0.9 + 0.001 * f64::from(i);
                    target.energy(from, from + 0.001) * pulse.power(range - from - 0.0005)
                })
                .sum();
            // A layer of 1 mm as one plane errs by (1 mm)² over the pulse's and the overlap's squares, 1e-4 at the overlap.
            close(target.echo(pulse, range), layers, 1e-4);
        }
    }

    #[test]
    fn the_peak_is_the_largest_value() {
        for pulse in [HAHNER, PulseShape::Gaussian { fwhm_s: 5e-9 }, PulseShape::Gaussian { fwhm_s: 1e-9 }] {
            for target in [
                fog(0.01),
                fog(0.2),
                SoftTarget { until_m: 0.97, ..fog(0.05) },
                SoftTarget { overlap_to_m: 6.0, ..fog(0.05) },
            ] {
                let peak = target.peak(pulse);
                for i in 0..4000 {
                    // The rule of 24 panels moves by as much as it errs, which is far less than 1e-9.
                    assert!(target.echo(pulse, 0.003 * f64::from(i)) <= peak.echo * (1.0 + 1e-9));
                }
            }
        }
    }

    #[test]
    fn a_thin_layer_is_a_hard_target() {
        // A layer of 1 cm at 20 m is a plane with the power factor π·β·.01.
        let target = fog(0.05);
        let hard = target.power_factor_per_m() * 0.01 * two_way_transmission(0.05, 20.0) / 400.0;
        // Its thickness changes the square of the range by (.005/20)² and the light left by (.1·.005)²/6.
        close(target.energy(19.995, 20.005), hard, 1e-6);
    }

    #[test]
    fn fog_never_returns_more_light_than_it_scatters() {
        // Without the fall with the square of the range, all layers together return π/(2S), however dense the fog.
        for alpha in [0.01, 0.1, 1.0] {
            let target =
                SoftTarget { overlap_from_m: 1e-3, overlap_to_m: 1e-3, until_m: 1000.0, ..fog(alpha) };
            let returned = target.power_factor_per_m() * target.integral(0.0, 1000.0, |r| r * r);
            assert!(returned <= PI / (2.0 * target.lidar_ratio_sr));
            // The light before 1 mm is missing, 2α·1e-3 of it.
            close(returned, PI / (2.0 * target.lidar_ratio_sr), 2.1e-3 * alpha + 1e-8);
        }
    }

    #[test]
    fn droplets_return_three_and_a_half_times_as_much_as_hahners() {
        let droplets = SoftTarget { lidar_ratio_sr: 19.0, ..fog(0.06) };
        let hahner = SoftTarget { lidar_ratio_sr: 65.0, ..fog(0.06) };
        // 65 over 19 is 3.4.
        agrees(droplets.peak(HAHNER).echo / hahner.peak(HAHNER).echo, 3.4, 0.1);
    }

    #[test]
    fn fog_that_nothing_is_seen_of_returns_nothing() {
        let hidden = SoftTarget { until_m: 0.5, ..fog(0.06) };
        assert_eq!(hidden.energy(0.0, 100.0), 0.0);
        assert_eq!(hidden.peak(HAHNER).echo, 0.0);
        assert_eq!(fog(0.06).echo(HAHNER, 60.0), 0.0);
        assert_eq!(fog(0.0).peak(HAHNER).echo, 0.0);
    }
}
