//! Extinction by haze, fog, rain and dust, and the way there and back through them.
//!
//! Extinctions of several kinds add up. A *lidar ratio* S is extinction over backscatter, in steradians.
//!
//! Sources: P. W. Kruse, L. D. McGlauchlin and R. B. McQuistan, "Elements of Infrared Technology" (1962); I. I. Kim,
//! B. McArthur and E. Korevaar, "Comparison of laser beam propagation at 785 nm and 1550 nm in fog and haze for optical wireless
//! communications" (2001); C. W. Ulbrich and D. Atlas, "Extinction of visible and infrared radiation in rain" (1985).

/// The lidar ratio of fog's and clouds' droplets at 905 nm, in steradians: E. J. O'Connor, A. J. Illingworth and R. J. Hogan, "A
/// technique for autocalibration of cloud lidar" (2004), who measured 18.8 ± .8.
pub const DROPLET_LIDAR_RATIO_SR: f64 = 18.8;

/// The lidar ratio in steradians that follows from the backscatter of .046/MOR in M. Hahner, C. Sakaridis, D. Dai and
/// L. Van Gool, "Fog simulation on real LiDAR point clouds" (2021): ln 20/.046 = 65.1.
pub const HAHNER_LIDAR_RATIO_SR: f64 = 65.124_614;

/// The lidar ratio of dust in steradians. Measurements lie between 30 and 60, so it is uncertain.
pub const DUST_LIDAR_RATIO_SR: f64 = 40.0;

/// The formula by which haze and fog depend on the wavelength.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Haze {
    /// Kruse: q = .585·V^⅓ up to a visibility of 6 km. It was fitted to haze.
    Kruse,
    /// Kim: q falls to 0 in dense fog, which is grey.
    Kim,
}

impl Haze {
    /// The extinction per metre at a visibility: 3.912/V·(λ/.55 µm)^−q, where 3.912 = −ln .02.
    ///
    /// `visibility_m` is V, the distance at which a black object keeps 2 % of its contrast at .55 µm. `wavelength_m` is λ. V counts
    /// in kilometres in the exponent q, which is 1.6 above 50 km, 1.3 above 6 km, and below that .585·V^⅓ (Kruse), or
    /// .16·V + .34 above 1 km, V − .5 above .5 km and 0 below (Kim).
    pub fn extinction_per_m(self, visibility_m: f64, wavelength_m: f64) -> f64 {
        let km = visibility_m / 1000.0;
        let q = match self {
            _ if km > 50.0 => 1.6,
            _ if km > 6.0 => 1.3,
            Self::Kruse => 0.585 * libm::cbrt(km),
            Self::Kim if km > 1.0 => 0.16 * km + 0.34,
            Self::Kim if km > 0.5 => km - 0.5,
            Self::Kim => 0.0,
        };
        3.912 / visibility_m * libm::pow(wavelength_m / 0.55e-6, -q)
    }
}

/// The extinction per metre at a meteorological optical range (MOR): ln 20/MOR. At that distance 5 % of light is left.
pub fn extinction_of_optical_range_per_m(optical_range_m: f64) -> f64 {
    libm::log(20.0) / optical_range_m
}

/// The extinction of rain per metre by Ulbrich and Atlas: 1.45·Rr^.64 dB/km, with the rate Rr in mm/h. It is that of one way.
///
/// See [`super::SizeDistribution::marshall_palmer`] for the extinction that belongs to a distribution of drops, which is within 10 %.
pub fn rain_extinction_per_m(rate_mm_h: f64) -> f64 {
    // A decibel is ln(10)/10 of extinction.
    1.45e-3 * libm::pow(rate_mm_h, 0.64) * libm::log(10.0) / 10.0
}

/// The share of light that is left there and back: exp(−2αR).
pub fn two_way_transmission(extinction_per_m: f64, range_m: f64) -> f64 {
    libm::exp(-2.0 * extinction_per_m * range_m)
}

/// The backscatter per metre and steradian: β = α/S, with the extinction α and the lidar ratio S.
pub fn backscatter_per_m_sr(extinction_per_m: f64, lidar_ratio_sr: f64) -> f64 {
    extinction_per_m / lidar_ratio_sr
}

#[cfg(test)]
mod tests {
    use super::super::SizeDistribution;
    use super::super::testing::{agrees, close};
    use super::*;

    #[test]
    fn extinction_of_haze_is_as_computed_apart_from_this_code() {
        // Per kilometre, at 905 nm: visibility in metres, Kruse and Kim, and the last printed digit.
        for (visibility, kruse, kim, digit) in [
            (10_000.0, 0.2048, 0.2048, 1e-4),
            (2000.0, 1.355, 1.408, 1e-3),
            (1000.0, 2.923, 3.050, 1e-3),
            (200.0, 16.50, 19.56, 1e-2),
        ] {
            agrees(1000.0 * Haze::Kruse.extinction_per_m(visibility, 905e-9), kruse, digit);
            agrees(1000.0 * Haze::Kim.extinction_per_m(visibility, 905e-9), kim, digit);
        }
        agrees(1000.0 * Haze::Kim.extinction_per_m(10_000.0, 1550e-9), 0.1017, 1e-4);
        agrees(1000.0 * Haze::Kim.extinction_per_m(200.0, 1550e-9), 19.56, 1e-2);
    }

    #[test]
    fn a_black_object_keeps_two_percent_of_its_contrast_at_the_visibility() {
        // 3.912 is −ln .02 to four digits, so the share is off by e^(2e-5).
        close(libm::exp(-800.0 * Haze::Kim.extinction_per_m(800.0, 0.55e-6)), 0.02, 3e-5);
        close(libm::exp(-800.0 * extinction_of_optical_range_per_m(800.0)), 0.05, 1e-14);
    }

    #[test]
    fn kims_exponent_has_no_steps_below_six_kilometres() {
        for (km, q) in [(1.0, 0.5), (0.5, 0.0)] {
            for side in [-1e-9, 1e-9] {
                let extinction = Haze::Kim.extinction_per_m(1000.0 * km * (1.0 + side), 905e-9);
                close(extinction, 3.912e-3 / km * libm::pow(0.905 / 0.55, -q), 1e-8);
            }
        }
    }

    #[test]
    fn rain_is_as_thick_as_ulbrich_and_atlas_say() {
        // The figures have three, four and three digits.
        for (rate, printed, digit) in [(1.0, 3.34e-4, 1e-6), (10.0, 1.457e-3, 1e-6), (50.0, 4.08e-3, 1e-5)] {
            agrees(rain_extinction_per_m(rate), printed, digit);
            close(
                rain_extinction_per_m(rate),
                SizeDistribution::marshall_palmer(rate).extinction_per_m(),
                0.1,
            );
        }
    }

    #[test]
    fn hahners_backscatter_is_a_lidar_ratio_of_65() {
        let (alpha, mor) = (extinction_of_optical_range_per_m(100.0), 100.0);
        close(backscatter_per_m_sr(alpha, HAHNER_LIDAR_RATIO_SR), 0.046 / mor, 1e-7);
        // Droplets have .159/MOR, 3.5 times Hahner's.
        agrees(backscatter_per_m_sr(alpha, DROPLET_LIDAR_RATIO_SR) * mor, 0.159, 1e-3);
        agrees(HAHNER_LIDAR_RATIO_SR / DROPLET_LIDAR_RATIO_SR, 3.5, 0.1);
    }

    #[test]
    fn fog_and_rain_shorten_the_range_of_a_known_scene() {
        // A plane of 50 % is at the limit of 90 m at 10 % where ρ·exp(−2αR)/R² is .1/90². Ranges are printed to 1 mm, and a range
        // moves the logarithm of the echo by at least 2/R: the share is 2·(half a millimetre)·(1/R + α).
        let fog = Haze::Kim.extinction_per_m(1000.0, 905e-9);
        // The scene's extinction of rain is Marshall and Palmer's at 10 mm/h, rounded to five digits.
        let rain = 1.5556e-3;
        agrees(SizeDistribution::marshall_palmer(10.0).extinction_per_m(), rain, 1e-7);
        for (alpha, range) in [(fog, 133.813), (rain, 157.512)] {
            let echo = 0.5 * two_way_transmission(alpha, range) / (range * range);
            close(echo, 0.1 / 8100.0, 1e-3 * (1.0 / range + alpha));
        }
    }
}
