//! Continuous-wave time of flight: light whose power is modulated at a frequency f comes back with a phase, which a pixel measures
//! by several taps that are each sensitive at another phase of the modulation.
//!
//! Light over a path of the full length L, there and back, has the phase φ = 2π·f·L/c. Paths add as phasors, z = Σ a·e^{jφ}, whose
//! amplitudes are electrons, so the light of two surfaces in one pixel and light that was reflected twice need no model of their
//! own. The range is half the path: c·φ/(4πf), modulo c/(2f).
//!
//! Tap k of n counts B + A·cos(φ + 2πk/n) electrons in the mean. Of N electrons in all taps, with the contrast m of the
//! modulation, B is N/n, and A is m·|z|/n. Sunlight adds to N and not to |z|. Source: R. Lange and P. Seitz, "Solid-state
//! time-of-flight range camera", IEEE J. Quantum Electron. 37, 390 (2001), for four taps.

use std::f64::consts::{PI, TAU};
use std::ops::{Add, AddAssign};

use libm::{atan2, exp, sincos};

use super::SPEED_OF_LIGHT_M_S;
use super::detection::normal_below;

/// A complex amplitude: `re` + j·`im`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Phasor {
    /// The real part: the amplitude times the cosine of the phase.
    pub re: f64,
    /// The imaginary part: the amplitude times the sine of the phase.
    pub im: f64,
}

impl Phasor {
    /// The phasor of a path of the full length `path_m`, there and back, at a frequency: amplitude·e^{jφ} with φ = 2π·f·L/c.
    pub fn of_path(amplitude: f64, path_m: f64, frequency_hz: f64) -> Self {
        // Whole cycles leave before the angle is rounded.
        let cycles = frequency_hz * path_m / SPEED_OF_LIGHT_M_S;
        let (sin, cos) = sincos(TAU * (cycles - cycles.floor()));
        Self { re: amplitude * cos, im: amplitude * sin }
    }

    /// The absolute value.
    pub fn amplitude(self) -> f64 {
        (self.re * self.re + self.im * self.im).sqrt()
    }

    /// The phase in [0, 2π), 0 for the phasor 0.
    pub fn phase(self) -> f64 {
        let phase = atan2(self.im, self.re);
        if phase >= 0.0 {
            return phase;
        }
        // A tiny negative phase rounds to a whole turn, which is phase 0.
        let turned = phase + TAU;
        if turned < TAU { turned } else { 0.0 }
    }

    fn times(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl Add for Phasor {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

/// The range of a phase: c·φ/(4πf), in metres. Ranges that differ by multiples of c/(2f) have the same phase.
pub fn range_m(phase: f64, frequency_hz: f64) -> f64 {
    SPEED_OF_LIGHT_M_S * phase / (4.0 * PI * frequency_hz)
}

/// The light of one pixel during the exposure at one frequency, in electrons of all taps together. It starts dark, and paths,
/// sub-samples and moments of the exposure add up in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModulatedLight {
    /// The electrons of modulated light.
    pub signal: f64,
    /// The electrons of other light, such as sunlight, and of the dark current.
    pub ambient: f64,
    /// Σ a·e^{jφ}: the modulated light at the frequency itself.
    pub first: Phasor,
    /// Σ a·e^{3jφ}: the same paths at three times the frequency.
    pub third: Phasor,
}

impl ModulatedLight {
    /// Adds a path of the full length `path_m`, there and back, whose light makes this many electrons.
    pub fn add_path(&mut self, electrons: f64, path_m: f64, frequency_hz: f64) {
        let unit = Phasor::of_path(1.0, path_m, frequency_hz);
        let cube = unit.times(unit).times(unit);
        let scaled = |p: Phasor| Phasor { re: electrons * p.re, im: electrons * p.im };
        *self += Self { signal: electrons, ambient: 0.0, first: scaled(unit), third: scaled(cube) };
    }
}

impl AddAssign for ModulatedLight {
    fn add_assign(&mut self, other: Self) {
        self.signal += other.signal;
        self.ambient += other.ambient;
        self.first = self.first + other.first;
        self.third = self.third + other.third;
    }
}

/// A pixel that demodulates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TofPixel {
    /// The contrast m of the modulation, in (0, 1]: the amplitude of a tap over its mean, in the light of one path without
    /// ambient light.
    pub contrast: f64,
    /// The third harmonic of the correlation over the first, r₃. It is 0 for a sinusoidal modulation and 1/9 for light and taps
    /// that both switch as square waves, whose correlation is a triangle. Four taps take the third harmonic for the first,
    /// which makes the error of range −c/(4πf)·r₃·sin 4φ to the first order in r₃: the wiggling of such cameras.
    pub third_harmonic: f64,
    /// The standard deviation of the read noise of one tap, in electrons.
    pub read_noise: f64,
    /// The electrons at which a tap is full; infinite for a pixel that is never full.
    pub full_well: f64,
}

impl TofPixel {
    /// The mean electrons of tap `tap` of `taps`: B + A·cos(φ + θ) with θ = 2π·`tap`/`taps`, and with the third harmonic
    /// B + A·[cos(φ + θ) + r₃·cos 3(φ + θ)]. A full well does not matter here.
    pub fn mean_tap(&self, tap: usize, taps: usize, light: &ModulatedLight) -> f64 {
        let turn = unit_turn(tap, taps);
        let cube = turn.times(turn).times(turn);
        let modulated = light.first.times(turn).re + self.third_harmonic * light.third.times(cube).re;
        ((light.signal + light.ambient + self.contrast * modulated) / taps as f64).max(0.0)
    }

    /// The electrons that tap `tap` of `taps` reads: shot noise by [`electrons`], the full well, then read noise. `normal` gives
    /// standard normal deviates: the tap takes one, and a second one if there is read noise.
    pub fn tap(
        &self,
        tap: usize,
        taps: usize,
        light: &ModulatedLight,
        mut normal: impl FnMut() -> f64,
    ) -> f64 {
        let count = electrons(self.mean_tap(tap, taps, light), normal()).min(self.full_well);
        if self.read_noise > 0.0 { count + self.read_noise * normal() } else { count }
    }

    /// What the taps of one frequency tell, in their order. Three taps or more are needed.
    pub fn demodulate(&self, taps: &[f64]) -> Demodulated {
        let count = taps.len();
        let mut sum = Phasor::default();
        for (k, &tap) in taps.iter().enumerate() {
            // Tap k holds the phasor turned by 2πk/n; turning it back adds all of them in step.
            let turn = unit_turn(k, count);
            sum = sum + Phasor { re: tap * turn.re, im: -tap * turn.im };
        }
        let scale = 2.0 / count as f64;
        // Read noise moves the reading of a full tap, so a tap counts as full from three of its deviations below.
        let full = self.full_well - 3.0 * self.read_noise;
        Demodulated {
            phasor: Phasor { re: scale * sum.re, im: scale * sum.im },
            mean: taps.iter().sum::<f64>() / count as f64,
            taps: count,
            saturated: taps.iter().any(|&tap| tap >= full),
        }
    }
}

/// What the taps of one frequency tell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demodulated {
    /// A·e^{jφ}, with the amplitude A of a tap in electrons.
    pub phasor: Phasor,
    /// The mean B of the taps, in electrons.
    pub mean: f64,
    /// The number n of taps.
    pub taps: usize,
    /// Whether a tap was full, so that its electrons were not all counted.
    pub saturated: bool,
}

impl Demodulated {
    /// The standard deviation of the phase: √(2·(B + r²)/n)/A, with the read noise r of a tap in electrons; infinite without
    /// amplitude. Without read noise it is √(2/N)/m of N electrons in all taps.
    ///
    /// Derived: each part of the phasor sums n taps with the weights 2/n·cos and 2/n·sin, so its variance is 2·(B + r²)/n, and
    /// across the phasor's direction it moves the phase by 1/A. The counts of single taps vary with the phase, which cancels
    /// with four taps or more; with three it changes the variance by the factor 1 − A/(2B)·cos 3φ. Terms of the order of the
    /// fourth power of the deviation are left out.
    pub fn phase_sigma(&self, read_noise: f64) -> f64 {
        let variance = 2.0 * (self.mean.max(0.0) + read_noise * read_noise) / self.taps as f64;
        let amplitude = self.phasor.amplitude();
        if amplitude > 0.0 { variance.sqrt() / amplitude } else { f64::INFINITY }
    }

    /// The electrons of ambient light in all taps: n·(B − A/m). Light of several paths counts as ambient as far as their phases
    /// cancel.
    pub fn ambient(&self, contrast: f64) -> f64 {
        self.taps as f64 * (self.mean - self.phasor.amplitude() / contrast)
    }
}

/// The mean from which on shot noise is drawn as normal.
const MANY_ELECTRONS: f64 = 64.0;

/// A number of electrons with this mean, from one standard normal deviate x.
///
/// Below a mean of 64, it is Poisson's quantile of Φ(x), so the distribution is Poisson's. From there on it is the normal
/// μ + √μ·x, with the exact mean and variance. Its distribution function errs by at most .0665/√μ + .1995/√μ, .034 at 64:
/// the first term is Edgeworth's of the skewness 1/√μ, (x² − 1)·φ(x)/(6√μ), and the second is half a step of whole numbers,
/// φ(x)/(2√μ), each with its largest value φ(0) = .399.
pub fn electrons(mean: f64, deviate: f64) -> f64 {
    if mean >= MANY_ELECTRONS {
        return (mean + mean.sqrt() * deviate).max(0.0);
    }
    let below = normal_below(deviate);
    let (mut count, mut share) = (0.0, exp(-mean));
    let mut sum = share;
    // Behind the mean, shares that no longer change the sum never reach a probability of 1.
    while sum < below && (count < mean || sum + share > sum) {
        count += 1.0;
        share *= mean / count;
        sum += share;
    }
    count
}

/// e^{j·2πk/n}. Quarter turns are exact.
#[inline]
fn unit_turn(k: usize, n: usize) -> Phasor {
    const QUARTERS: [(f64, f64); 4] = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];
    let (re, im) = match (4 * k).checked_rem(n) {
        // Most cameras have four taps, for which nothing is divided.
        _ if n == 4 => QUARTERS[k % 4],
        Some(0) => QUARTERS[4 * k / n % 4],
        _ => {
            let (sin, cos) = sincos(TAU * k as f64 / n as f64);
            (cos, sin)
        }
    };
    Phasor { re, im }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{agrees, close, midpoint};
    use super::*;
    use crate::rng::Rng;

    const MHZ: f64 = 1e6;

    impl Demodulated {
        /// The range in metres, in [0, c/(2f)), and its standard deviation σ_d = c·σ_φ/(4πf).
        fn range_and_sigma_m(&self, frequency_hz: f64, read_noise: f64) -> (f64, f64) {
            let [range, sigma] =
                [self.phasor.phase(), self.phase_sigma(read_noise)].map(|phase| range_m(phase, frequency_hz));
            (range, sigma)
        }
    }

    /// The irradiance at a point p from a small patch q that is lit: K = (ρ/π)·E_q·cos α·cos β/d²·dA, for Lambert's reflection of the
    /// reflectance ρ at q.
    ///
    /// `irradiance` is E_q, in any unit, which the result has too. `cos_out` is cos α between the patch's normal and the way to p,
    /// and `cos_in` is cos β between p's normal and the way to q; 0 is right where one of them looks away. `distance_m` is d, and
    /// `area_m2` is dA. The light of that path is longer than the direct light at p by r_q + d − r_p, with the ranges r from the source.
    ///
    /// The integral over all patches is the one over directions from p, with the density cos β/π: the mean of ρ·E_q of what n such
    /// directions meet estimates it without a kernel.
    fn one_bounce(
        reflectance: f64,
        irradiance: f64,
        cos_out: f64,
        cos_in: f64,
        distance_m: f64,
        area_m2: f64,
    ) -> f64 {
        reflectance / PI * irradiance * cos_out.max(0.0) * cos_in.max(0.0) / (distance_m * distance_m)
            * area_m2
    }

    fn pixel(contrast: f64) -> TofPixel {
        TofPixel { contrast, third_harmonic: 0.0, read_noise: 0.0, full_well: f64::INFINITY }
    }

    fn path(electrons: f64, range: f64, frequency: f64) -> ModulatedLight {
        let mut light = ModulatedLight::default();
        light.add_path(electrons, 2.0 * range, frequency);
        light
    }

    /// What taps without noise tell.
    fn noiseless(pixel: &TofPixel, light: &ModulatedLight, taps: usize) -> Demodulated {
        let means: Vec<_> = (0..taps).map(|k| pixel.mean_tap(k, taps, light)).collect();
        pixel.demodulate(&means)
    }

    fn noisy(pixel: &TofPixel, light: &ModulatedLight, taps: usize, rng: &mut Rng) -> Demodulated {
        let read: Vec<_> = (0..taps).map(|k| pixel.tap(k, taps, light, || rng.normal())).collect();
        pixel.demodulate(&read)
    }

    #[test]
    fn taps_give_back_amplitude_phase_and_ambient() {
        for taps in [3, 4, 5, 8] {
            for (range, f) in [(0.0, 20.0), (0.3, 20.0), (1.7, 50.0), (7.1, 100.0), (0.749, 200.0)] {
                let mut light = path(8000.0, range, f * MHZ);
                light.ambient = 3000.0;
                let told = noiseless(&pixel(0.7), &light, taps);
                let n = taps as f64;
                // Sums of n numbers up to 11,000 round to 1e-12 each.
                close(told.phasor.amplitude(), 0.7 * 8000.0 / n, 1e-14 * n);
                close(told.mean, 11_000.0 / n, 1e-14 * n);
                close(told.ambient(0.7), 3000.0, 1e-13 * n);
                let step = SPEED_OF_LIGHT_M_S / (2.0 * f * MHZ);
                let error = (told.range_and_sigma_m(f * MHZ, 0.0).0 - range) / step;
                assert!((error - error.round()).abs() < 1e-14 * n, "{taps} {range} {f}: {error}");
            }
        }
    }

    #[test]
    fn quarter_turns_of_four_taps_are_those_of_more() {
        for k in 0..8 {
            assert_eq!(unit_turn(k, 4), unit_turn(2 * k, 8));
            assert_eq!(unit_turn(k, 4), unit_turn(3 * k, 12));
        }
    }

    #[test]
    fn phases_are_in_one_turn() {
        for (re, im, phase) in
            [(1.0, 0.0, 0.0), (0.0, 1.0, 0.5 * PI), (-1.0, -0.0, PI), (0.0, -2.0, 1.5 * PI)]
        {
            assert_eq!(Phasor { re, im }.phase(), phase);
        }
        assert_eq!(Phasor { re: 1.0, im: -1e-20 }.phase(), 0.0);
        assert_eq!(Phasor::default().phase(), 0.0);
        // A kilometre at 200 MHz is 667 cycles; the rest is as exact as their product.
        let cycles = 200.0 * MHZ * 1000.0 / SPEED_OF_LIGHT_M_S;
        close(Phasor::of_path(1.0, 1000.0, 200.0 * MHZ).phase(), TAU * (cycles - 667.0), 1e-12);
    }

    /// The square wave's wiggling: exact, its size, and its first order.
    #[test]
    fn the_third_harmonic_makes_ranges_wiggle() {
        let (f, third) = (80.0 * MHZ, 1.0 / 9.0);
        let square = TofPixel { third_harmonic: third, ..pixel(0.6) };
        let mut largest = 0.0_f64;
        for i in 0..400 {
            let range = 1.0 + f64::from(i) * 0.005;
            let told = noiseless(&square, &path(1e4, range, f), 4);
            let phase = 4.0 * PI * f * range / SPEED_OF_LIGHT_M_S;
            let (sin, cos) = sincos(4.0 * phase);
            // The third harmonic, taken for the first, is the mirror image e^{−3jφ}: z = A·e^{jφ}·(1 + r₃·e^{−4jφ}).
            let exact = -range_m(atan2(third * sin, 1.0 + third * cos), f);
            let step = SPEED_OF_LIGHT_M_S / (2.0 * f);
            let error = (told.range_and_sigma_m(f, 0.0).0 - range) / step;
            let error = (error - error.round()) * step;
            assert!((error - exact).abs() < 1e-12, "{range}: {error} {exact}");
            // The next terms of the series are r²/2·sin 8φ and r³/3·sin 12φ, 1.08·r²/2 with all that follow.
            let first = -range_m(third * sin, f);
            assert!((error - first).abs() <= range_m(0.54 * third * third, f), "{range}");
            largest = largest.max(error.abs());
        }
        close(largest, range_m(libm::asin(third), f), 1e-3);
        // Eight taps tell the third harmonic from the first.
        let told = noiseless(&square, &path(1e4, 1.3, f), 8);
        assert!((told.range_and_sigma_m(f, 0.0).0 - 1.3).abs() < 1e-13);
        // A triangle's harmonics fall with the square of their number.
        let triangle = |k: f64| midpoint(0.0, PI, 2000, |x| (1.0 - 2.0 * x / PI) * libm::cos(k * x));
        close(triangle(3.0) / triangle(1.0), third, 1e-5);
    }

    /// Figures computed for 10⁴ electrons and the contrast .8: 21.1, 5.27 and 4.22 mm.
    #[test]
    fn the_law_of_noise_has_its_figures() {
        for (f, sigma_mm, digit) in [(20.0, 21.1, 0.1), (80.0, 5.27, 0.01), (100.0, 4.22, 0.01)] {
            let told = noiseless(&pixel(0.8), &path(1e4, 1.0, f * MHZ), 4);
            agrees(1e3 * told.range_and_sigma_m(f * MHZ, 0.0).1, sigma_mm, digit);
        }
        // Twice as much sunlight as signal, and read noise of 20 electrons in each of four taps.
        let mut light = path(1e4, 1.0, 20.0 * MHZ);
        light.ambient = 2e4;
        let sigma = noiseless(&pixel(0.8), &light, 4).phase_sigma(20.0);
        close(sigma, (2.0 * (3e4 + 4.0 * 400.0_f64)).sqrt() / (0.8 * 1e4), 1e-13);
        assert_eq!(noiseless(&pixel(0.8), &ModulatedLight::default(), 4).phase_sigma(1.0), f64::INFINITY);
    }

    /// σ_d over electrons, frequencies, sunlight and read noise: 20,000 draws each. Their variance over σ² is χ²/n with the
    /// standard error √(2/n), and its fourth-order terms are below 2σ_φ². The mean has the standard error σ/√n, and its
    /// fourth-order terms vanish by symmetry.
    #[test]
    fn drawn_ranges_scatter_by_the_law() {
        let mut rng = Rng::new(31);
        let draws = 20_000;
        for (electrons, ambient, read) in [
            (2e3, 0.0, 0.0),
            (1e4, 0.0, 0.0),
            (1e4, 3e4, 0.0),
            (1e4, 2e3, 25.0),
            (1e5, 0.0, 0.0),
            (1e6, 0.0, 9.0),
        ] {
            for (f, range) in [(20.0, 1.234), (80.0, 0.777), (120.0, 0.6)] {
                for taps in [4, 5] {
                    let pixel = TofPixel { read_noise: read, ..pixel(0.8) };
                    let light = ModulatedLight { ambient, ..path(electrons, range, f * MHZ) };
                    let law = noiseless(&pixel, &light, taps);
                    let sigma = law.range_and_sigma_m(f * MHZ, read).1;
                    let mut sums = [0.0; 2];
                    for _ in 0..draws {
                        let told = noisy(&pixel, &light, taps, &mut rng);
                        let error = (told.range_and_sigma_m(f * MHZ, read).0 - range) / sigma;
                        sums = [sums[0] + error, sums[1] + error * error];
                    }
                    let [mean, square] = sums.map(|sum| sum / f64::from(draws));
                    let standard = (1.0 / f64::from(draws)).sqrt();
                    assert!(mean.abs() < 4.0 * standard, "{electrons} {f} {taps}: {mean}");
                    let phase = law.phase_sigma(read);
                    let allowed = 4.0 * standard * 2.0_f64.sqrt() + 2.0 * phase * phase;
                    assert!(
                        (square - 1.0).abs() < allowed,
                        "{electrons} {ambient} {read} {f} {taps}: {square}"
                    );
                }
            }
        }
    }

    /// With three taps the variance follows 1 − A/(2B)·cos 3φ.
    #[test]
    fn three_taps_scatter_with_the_phase() {
        let (mut rng, draws, f) = (Rng::new(5), 20_000, 50.0 * MHZ);
        for turn in [0.0, 0.2, 1.0 / 3.0, 0.5] {
            let range = (turn + 1.0) * SPEED_OF_LIGHT_M_S / (2.0 * f);
            let light = path(4e4, range, f);
            let (mean, sigma) = noiseless(&pixel(0.9), &light, 3).range_and_sigma_m(f, 0.0);
            let step = SPEED_OF_LIGHT_M_S / (2.0 * f);
            let mut square = 0.0;
            for _ in 0..draws {
                let error =
                    (noisy(&pixel(0.9), &light, 3, &mut rng).range_and_sigma_m(f, 0.0).0 - mean) / step;
                let error = (error - error.round()) * step / sigma;
                square += error * error / f64::from(draws);
            }
            let factor = 1.0 - 0.45 * libm::cos(6.0 * PI * turn);
            let allowed = 4.0 * (2.0 / f64::from(draws)).sqrt();
            assert!((square / factor - 1.0).abs() < allowed, "{turn}: {square} {factor}");
        }
    }

    /// Few electrons are Poisson's: Pearson's χ² of 10⁵ draws over 0 … 15 and more, at most its 15 degrees of freedom and four
    /// of its standard deviations √30. From 64 on, the distribution function errs by no more than its bound.
    #[test]
    fn electrons_are_poissons() {
        let mut rng = Rng::new(17);
        for mean in [0.3, 2.0, 7.5] {
            let draws = 100_000;
            let mut counts = [0_u32; 16];
            for _ in 0..draws {
                counts[(electrons(mean, rng.normal()) as usize).min(15)] += 1;
            }
            let (mut share, mut rest, mut chi) = (exp(-mean), 1.0, 0.0);
            for (k, &count) in counts.iter().enumerate() {
                let expected = f64::from(draws) * if k == 15 { rest } else { share };
                // Cells without an expected draw have none, but for one in 10³ such tests.
                if expected > 1e-3 {
                    chi += (f64::from(count) - expected) * (f64::from(count) - expected) / expected.max(1.0);
                } else {
                    assert_eq!(count, 0, "{mean} {k}");
                }
                rest -= share;
                share *= mean / (k as f64 + 1.0);
            }
            assert!(chi < 15.0 + 4.0 * 30.0_f64.sqrt(), "{mean}: {chi}");
        }
        for mean in [64.0, 400.0] {
            let (mut share, mut below, mut worst) = (exp(-mean), 0.0, 0.0_f64);
            for k in 0..2000 {
                below += share;
                let normal = normal_below((f64::from(k) - mean) / f64::sqrt(mean));
                worst = worst.max((normal - below).abs());
                share *= mean / (f64::from(k) + 1.0);
            }
            assert!(worst < (0.0665 + 0.1995) / f64::sqrt(mean), "{mean}: {worst}");
            assert!(worst > 0.1995 / f64::sqrt(mean), "{mean}: {worst}");
        }
        for deviate in [-8.6, 0.0, 8.6] {
            assert_eq!(electrons(0.0, deviate), 0.0);
            assert!((0.0..200.0).contains(&electrons(63.9, deviate)));
            assert!(electrons(64.0, deviate) >= 0.0);
        }
    }

    #[test]
    fn a_full_tap_is_told() {
        let light = path(4e4, 0.0, 20.0 * MHZ);
        let small = TofPixel { full_well: 1.5e4, read_noise: 10.0, ..pixel(0.8) };
        let told = noisy(&small, &light, 4, &mut Rng::new(1));
        assert!(told.saturated && told.phasor.re < 0.9 * 8e3, "{told:?}");
        let large = TofPixel { full_well: 2e4, ..small };
        assert!(!noisy(&large, &light, 4, &mut Rng::new(1)).saturated);
    }

    /// Two surfaces of one reflectance at 1 and 2 m, which take q and 1 − q of a pixel: their light is as q and (1 − q)/4.
    #[test]
    fn a_flying_pixel_lies_between_and_by_the_frequency() {
        for (q, at_20, at_60, energy) in
            [(0.25, 1.4242, 1.3349, 1.4286), (0.5, 1.1884, 1.0723, 1.2), (0.75, 1.0699, 1.0208, 1.0769)]
        {
            for (f, expected) in [(20.0, at_20), (60.0, at_60), (0.01, energy)] {
                let mut light = path(1e4 * q, 1.0, f * MHZ);
                light.add_path(1e4 * (1.0 - q) / 4.0, 4.0, f * MHZ);
                let told = noiseless(&pixel(0.8), &light, 4);
                agrees(told.range_and_sigma_m(f * MHZ, 0.0).0, expected, 1e-4);
            }
        }
    }

    /// A corner of two walls of 1 × 1 m that a camera with an isotropic source beside it sees from 1.5 m on the diagonal.
    struct Corner {
        reflectance: f64,
        /// The distance of the point on the wall y = 0 from the edge.
        s: f64,
    }

    impl Corner {
        const EYE: [f64; 3] =
            [1.5 * std::f64::consts::FRAC_1_SQRT_2, 1.5 * std::f64::consts::FRAC_1_SQRT_2, 0.0];

        /// The distance of a point from the source, and the irradiance there by the cosine of a wall whose distance from the
        /// source along its normal is `height`.
        fn lit(point: [f64; 3], height: f64) -> (f64, f64) {
            let r = distance(point, Self::EYE);
            (r, height / (r * r * r))
        }

        fn p(&self) -> [f64; 3] {
            [self.s, 0.0, 0.0]
        }

        /// The irradiance at p by the patch of the wall x = 0 at y and z, and how much longer its path is than the direct one.
        fn bounce(&self, y: f64, z: f64, area: f64) -> (f64, f64) {
            let (p, q) = (self.p(), [0.0, y, z]);
            let (direct, _) = Self::lit(p, Self::EYE[1]);
            let (out, irradiance) = Self::lit(q, Self::EYE[0]);
            let d = distance(p, q);
            let light = one_bounce(self.reflectance, irradiance, self.s / d, y / d, d, area);
            (light, out + d - direct)
        }

        /// Calls `f` with the light and the detour of each cell of a grid that is fine near p: y = u³ and z = v³/2. Both halves of
        /// the wall, above and below p, have the same light, so one of them counts twice.
        fn quadrature(&self, steps: u32, mut f: impl FnMut(f64, f64)) {
            let h = 1.0 / f64::from(steps);
            for i in 0..steps {
                let u = (f64::from(i) + 0.5) * h;
                for k in 0..steps {
                    let v = (f64::from(k) + 0.5) * h;
                    let area = 2.0 * (3.0 * u * u * h) * (1.5 * v * v * h);
                    let (light, detour) = self.bounce(u * u * u, 0.5 * v * v * v, area);
                    f(light, detour);
                }
            }
        }

        /// The error of range by the light that `paths` hands on, in mm, at each frequency.
        fn errors_mm(
            &self,
            frequencies: &[f64; 5],
            mut paths: impl FnMut(&mut dyn FnMut(f64, f64)),
        ) -> [f64; 5] {
            let direct = Self::lit(self.p(), Self::EYE[1]).1;
            let mut sums = [Phasor { re: direct, im: 0.0 }; 5];
            paths(&mut |light, detour| {
                for (sum, f) in sums.iter_mut().zip(frequencies) {
                    *sum = *sum + Phasor::of_path(light, detour, *f);
                }
            });
            std::array::from_fn(|i| {
                let phase = atan2(sums[i].im, sums[i].re);
                1e3 * range_m(phase, frequencies[i])
            })
        }
    }

    fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
        (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>().sqrt()
    }

    const CORNER_FREQUENCIES: [f64; 5] = [20.0 * MHZ, 50.0 * MHZ, 100.0 * MHZ, 120.0 * MHZ, 200.0 * MHZ];

    /// Indirect over direct light, and the errors in mm at [`CORNER_FREQUENCIES`].
    const CORNERS: [(f64, f64, f64, [f64; 5]); 5] = [
        (0.8, 0.05, 0.4126, [21.07, 20.90, 20.33, 20.00, 18.29]),
        (0.8, 0.1, 0.3870, [34.09, 33.76, 32.59, 31.91, 28.18]),
        (0.8, 0.3, 0.2419, [53.95, 52.35, 46.48, 42.91, 21.76]),
        (0.8, 0.5, 0.1367, [48.64, 45.00, 31.98, 24.63, -4.78]),
        (0.5, 0.3, 0.1512, [36.32, 34.98, 30.23, 27.47, 12.88]),
    ];

    /// Printed to .01 mm; a grid of 160 steps errs by less than .001 mm, which half as many steps confirm.
    #[test]
    fn light_by_way_of_the_other_wall_lengthens_ranges() {
        for (reflectance, s, ratio, errors) in CORNERS {
            let corner = Corner { reflectance, s };
            let mut indirect = 0.0;
            corner.quadrature(160, |light, _| indirect += light);
            agrees(indirect / Corner::lit(corner.p(), Corner::EYE[1]).1, ratio, 1.2e-4);
            let at = |steps| corner.errors_mm(&CORNER_FREQUENCIES, |f| corner.quadrature(steps, f));
            let (fine, coarse) = (at(160), at(80));
            for i in 0..5 {
                agrees(fine[i], errors[i], 0.012);
                assert!((fine[i] - coarse[i]).abs() < 4e-3, "{s} {i}: {} {}", fine[i], coarse[i]);
            }
        }
    }

    /// Directions from p with the density cos β/π: of 4000 × 16 of them, the mean of ρ·E_q gives the same errors. The standard
    /// error is that of 16 batches, and three of it are allowed, with Student's t for 15 degrees of freedom: 3.6.
    #[test]
    fn sampled_directions_agree_with_the_kernel() {
        let mut rng = Rng::new(8);
        for (reflectance, s, _, errors) in CORNERS {
            let corner = Corner { reflectance, s };
            let mut batches = Vec::new();
            for _ in 0..16 {
                batches.push(corner.errors_mm(&CORNER_FREQUENCIES, |f| {
                    for _ in 0..4000 {
                        // About the normal +y: a uniform disk in x and z, lifted onto the hemisphere.
                        let (radius, (sin, cos)) = (rng.unit().sqrt(), sincos(TAU * rng.unit()));
                        let (x, z) = (radius * cos, radius * sin);
                        let reach = -s / x;
                        let (y, z) = ((1.0 - radius * radius).sqrt() * reach, z * reach);
                        if x < 0.0 && y < 1.0 && z.abs() < 0.5 {
                            let (out, irradiance) = Corner::lit([0.0, y, z], Corner::EYE[0]);
                            let direct = Corner::lit(corner.p(), Corner::EYE[1]).0;
                            f(reflectance * irradiance / 4000.0, out + reach - direct);
                        }
                    }
                }));
            }
            for i in 0..5 {
                let mean = batches.iter().map(|b| b[i]).sum::<f64>() / 16.0;
                let variance = batches.iter().map(|b| (b[i] - mean) * (b[i] - mean)).sum::<f64>() / 15.0;
                let allowed = 3.6 * (variance / 16.0).sqrt();
                assert!((mean - errors[i]).abs() < allowed, "{s} {i}: {mean} {} {allowed}", errors[i]);
            }
        }
    }

    #[test]
    fn light_that_looks_away_bounces_nowhere() {
        assert_eq!(one_bounce(0.8, 1.0, -0.1, 0.5, 1.0, 1.0), 0.0);
        assert_eq!(one_bounce(0.8, 1.0, 0.1, -0.5, 1.0, 1.0), 0.0);
        // A white patch of π cm² at 1 m that looks at p, and p at it, gives 10⁻⁴ of its irradiance.
        close(one_bounce(1.0, 3.0, 1.0, 1.0, 1.0, PI * 1e-4), 3e-4, 1e-15);
    }
}
