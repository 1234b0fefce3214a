//! The noise of an infrared camera's image.
//!
//! Source: M. J. Landau, B. Y. Choo and P. A. Beling, "Simulating Kinect infrared and depth images", IEEE Trans. Cybernetics 46(12),
//! 3018 (2016), with the figures that SAPIEN uses for a RealSense D435 (X. Zhang et al., "Close the optical sensing domain gap by
//! physics-grounded active stereo sensor simulation", 2022, and its source).

/// Noise in grey values from 0 to 255: the image times a gain with a gamma distribution, which stands for laser speckle, plus an offset
/// with a normal distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageNoise {
    /// The shape k of the gain's gamma distribution, 1 over the square of its coefficient of variation. At least 50.
    pub gain_shape: f64,
    /// Its scale θ: the mean gain is k·θ.
    pub gain_scale: f64,
    /// The mean of the offset in grey values.
    pub offset_mean: f64,
    /// The standard deviation of the offset in grey values.
    pub offset_sigma: f64,
}

impl ImageNoise {
    /// The noise of a Kinect's infrared image: a gain of 1.011 ± 5.0 %.
    pub const KINECT: Self =
        Self { gain_shape: 398.12, gain_scale: 0.00254, offset_mean: -0.231, offset_sigma: 0.83 };

    /// The gain of a standard normal deviate: k·θ·(1 − 1/(9k) + z/(3√k))³, which has nearly a gamma distribution (E. B. Wilson and
    /// M. M. Hilferty, "The distribution of chi-square", PNAS 17, 684, 1931).
    ///
    /// The gain is the true quantile of a deviate that differs from z, for k = 398.12, by less than 0.0005 for z up to ± 3 and by less
    /// than 0.0014 up to ± 4; for k = 50 by less than 0.0043 and 0.0121.
    pub fn gain(&self, normal: f64) -> f64 {
        let shape = self.gain_shape;
        let root = 1.0 - 1.0 / (9.0 * shape) + normal / (3.0 * shape.sqrt());
        shape * self.gain_scale * root * root * root
    }

    /// The noisy grey value of a noiseless one, before it is rounded, from two independent standard normal deviates.
    pub fn noisy(&self, gray: f64, [gain, offset]: [f64; 2]) -> f64 {
        gray * self.gain(gain) + self.offset_mean + self.offset_sigma * offset
    }
}

/// The nearest grey value that a byte has. Halves are rounded up, and no number is 0.
pub fn quantised(gray: f64) -> u8 {
    // A conversion to u8 cuts off, and ends at 0 and 255.
    (gray + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::super::testing::{agrees, midpoint};
    use super::*;
    use crate::rng::Rng;

    #[test]
    fn the_gain_has_a_gamma_distribution() {
        for (shape, within_3, within_4) in [(398.12, 0.0005, 0.0014), (50.0, 0.0043, 0.0121)] {
            let noise = ImageNoise { gain_shape: shape, gain_scale: 1.0, ..ImageNoise::KINECT };
            let log_gamma = libm::lgamma(shape);
            let density = |x: f64| libm::exp((shape - 1.0) * libm::log(x) - x - log_gamma);
            for eighth in -32..=32 {
                let z = f64::from(eighth) / 8.0;
                // All but 10⁻¹² of the distribution lies within 8 of its standard deviations.
                let below = midpoint((shape - 8.0 * shape.sqrt()).max(0.0), noise.gain(z), 20_000, density);
                let normal = 0.5 * libm::erfc(-z / std::f64::consts::SQRT_2);
                let normal_density = libm::exp(-0.5 * z * z) / std::f64::consts::TAU.sqrt();
                let error = (below - normal) / normal_density;
                let stated = if z.abs() <= 3.0 { within_3 } else { within_4 };
                assert!(error.abs() < stated, "{error} at {z} for a shape of {shape}");
            }
        }
    }

    #[test]
    fn images_get_the_mean_and_the_spread_that_are_stated() {
        let noise = ImageNoise::KINECT;
        let mean = noise.gain_shape * noise.gain_scale;
        agrees(mean, 1.011, 0.001);
        agrees(100.0 / noise.gain_shape.sqrt(), 5.0, 0.1);
        let (gray, count) = (100.0, 40_000);
        let mut rng = Rng::new(1);
        let values: Vec<f64> = (0..count).map(|_| noise.noisy(gray, [rng.normal(), rng.normal()])).collect();
        let average = values.iter().sum::<f64>() / f64::from(count);
        let variance = values.iter().map(|v| (v - average) * (v - average)).sum::<f64>() / f64::from(count);
        let expected = gray * gray * noise.gain_shape * noise.gain_scale * noise.gain_scale + 0.83 * 0.83;
        // Five standard errors: √(variance/n) of the mean, and a share √(2/n) of the variance.
        assert!((average - (gray * mean - 0.231)).abs() < 5.0 * (expected / f64::from(count)).sqrt());
        assert!((variance / expected - 1.0).abs() < 5.0 * (2.0 / f64::from(count)).sqrt());
    }

    #[test]
    fn bytes_are_the_nearest() {
        for (gray, byte) in [(-3.0, 0), (0.49, 0), (0.5, 1), (254.6, 255), (1e9, 255), (f64::NAN, 0)] {
            assert_eq!(quantised(gray), byte);
        }
    }
}
