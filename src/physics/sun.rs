//! Sunlight: its irradiance near the wavelengths of LiDARs, the power that it adds to a receiver, and the ambient channel.
//!
//! Source: ASTM G173-03, global irradiance on a tilted plane. The sun stands 48.2° from the zenith there, and the plane faces it
//! within 11°.

use std::f64::consts::PI;

use super::SPEED_OF_LIGHT_M_S;
use super::sun_spectrum::{FIRST_NM, GLOBAL_TILT};

/// Planck's constant in joule seconds, exact by the definition of the kilogram.
pub const PLANCK_J_S: f64 = 6.626_070_15e-34;

/// The spectral irradiance of the sun in W/(m²·nm) at a wavelength from 800 nm to 1600 nm, and none outside. It is linear between
/// whole nanometres.
pub fn spectral_irradiance_w_m2_nm(wavelength_m: f64) -> Option<f64> {
    let at = 1e9 * wavelength_m - FIRST_NM;
    let last = GLOBAL_TILT.len() - 1;
    if !(0.0..=last as f64).contains(&at) {
        return None;
    }
    let index = (at as usize).min(last - 1);
    let share = at - index as f64;
    Some(GLOBAL_TILT[index] + share * (GLOBAL_TILT[index + 1] - GLOBAL_TILT[index]))
}

/// The irradiance of the sun in W/m² within a band: the integral of [`spectral_irradiance_w_m2_nm`] over it. There is none if the
/// band reaches beyond 800 nm or 1600 nm.
///
/// `centre_m` and `width_m` are the middle and the full width of the band, that of a receiver's filter.
pub fn band_irradiance_w_m2(centre_m: f64, width_m: f64) -> Option<f64> {
    let [from, to] = [-0.5, 0.5].map(|side| centre_m + side * width_m);
    let ends = [spectral_irradiance_w_m2_nm(from)?, spectral_irradiance_w_m2_nm(to)?];
    // The trapezoids between the ends and the whole nanometres between them.
    let [from, to] = [from, to].map(|wavelength| 1e9 * wavelength - FIRST_NM);
    let (mut at, mut value, mut sum) = (from, ends[0], 0.0);
    for (index, &next) in GLOBAL_TILT.iter().enumerate().skip(from.floor() as usize + 1) {
        let place = index as f64;
        if place >= to {
            break;
        }
        sum += 0.5 * (value + next) * (place - at);
        (at, value) = (place, next);
    }
    Some(sum + 0.5 * (value + ends[1]) * (to - at))
}

/// A receiver, as sunlight sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// The middle of the filter's band in metres.
    pub wavelength_m: f64,
    /// The full width of the filter's band in metres.
    pub filter_width_m: f64,
    /// The area of the aperture in square metres.
    pub aperture_m2: f64,
    /// The solid angle of the field of view in steradians.
    pub field_of_view_sr: f64,
    /// The share of the light on the aperture that counts: that of the optics, times that of the detector if photons are to be
    /// those detected.
    pub efficiency: f64,
}

impl Receiver {
    /// The power in watts that sunlight adds by way of a Lambert surface that fills the field of view:
    /// P_b = E·(ρ/π)·cosθs·Ω·A·η, with the band's irradiance E. It does not depend on the range. There is none if the filter
    /// lies outside 800 nm to 1600 nm.
    ///
    /// `reflectance` is ρ, and `sun_cosine` is cosθs, the cosine between the sun's direction and the surface's normal.
    pub fn background_power_w(&self, reflectance: f64, sun_cosine: f64) -> Option<f64> {
        let irradiance = band_irradiance_w_m2(self.wavelength_m, self.filter_width_m)?;
        let radiance = irradiance * ambient(reflectance, sun_cosine) / PI;
        Some(radiance * self.field_of_view_sr * self.aperture_m2 * self.efficiency)
    }
}

/// The mean number of photons of a power within a gate: P·t·λ/(h·c).
pub fn photons(power_w: f64, gate_s: f64, wavelength_m: f64) -> f64 {
    power_w * gate_s * wavelength_m / (PLANCK_J_S * SPEED_OF_LIGHT_M_S)
}

/// The ambient (near-infrared) signal of a Lambert surface in the sun, relative to a white one that the sun meets at normal
/// incidence: ρ·cosθs. It depends neither on the range nor on the direction of view. In shadow it is 0 here: the sky's own light,
/// 5 to 9 % of all from 1550 nm to 850 nm, is left out.
pub fn ambient(reflectance: f64, sun_cosine: f64) -> f64 {
    reflectance * sun_cosine.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{agrees, close};
    use super::*;

    /// The receiver of the examples: 20 nm, 2 cm, 3 × 1.5 mrad, .5.
    fn receiver(wavelength_m: f64) -> Receiver {
        Receiver {
            wavelength_m,
            filter_width_m: 20e-9,
            aperture_m2: PI * 0.01 * 0.01,
            field_of_view_sr: 3e-3 * 1.5e-3,
            efficiency: 0.5,
        }
    }

    #[test]
    fn the_table_has_the_means_of_another_reading() {
        // The means of the 21 figures within 10 nm were computed from another copy of the table, with three digits.
        for (nm, printed) in
            [(850, 0.977), (865, 0.960), (905, 0.693), (940, 0.303), (1064, 0.625), (1550, 0.270)]
        {
            let mean = GLOBAL_TILT[nm - 810..=nm - 790].iter().sum::<f64>() / 21.0;
            agrees(mean, printed, 1e-3);
            // The band's mean counts both ends half. The figures at the ends differ from the mean by less than a quarter.
            let band = band_irradiance_w_m2(nm as f64 * 1e-9, 20e-9).unwrap() / 20.0;
            close(band, mean, 0.5 / 21.0 * 0.25);
        }
        // The figure at one wavelength can differ from the mean around it.
        agrees(spectral_irradiance_w_m2_nm(903e-9).unwrap(), 0.689, 1e-3);
        agrees(band_irradiance_w_m2(903e-9, 20e-9).unwrap() / 20.0, 0.711, 1e-3);
    }

    #[test]
    fn bands_add_up() {
        let whole = band_irradiance_w_m2(1200e-9, 780e-9).unwrap();
        let part = |i| band_irradiance_w_m2((811.25 + 2.5 * f64::from(i)) * 1e-9, 2.5e-9).unwrap();
        let parts: f64 = (0..312).map(part).sum();
        // Wavelengths in metres are off by 1e-16 of themselves, 1e-13 of a nanometre, and so are the seams of the bands.
        close(parts, whole, 1e-11);
        let narrow = band_irradiance_w_m2(905.3e-9, 1e-12).unwrap();
        // The width of a picometre is the difference of two wavelengths that are rounded to 1e-13 nm.
        close(narrow / 1e-3, spectral_irradiance_w_m2_nm(905.3e-9).unwrap(), 1e-8);
    }

    #[test]
    fn there_is_no_figure_outside_the_table() {
        for nm in [799.9, 1600.1, -5.0, f64::NAN] {
            assert_eq!(spectral_irradiance_w_m2_nm(nm * 1e-9), None);
        }
        assert_eq!(band_irradiance_w_m2(805e-9, 20e-9), None);
        assert_eq!(receiver(532e-9).background_power_w(0.5, 1.0), None);
        assert_eq!(spectral_irradiance_w_m2_nm(800e-9), Some(1.0725));
    }

    #[test]
    fn sunlight_adds_36_photons_or_fewer_in_5_ns() {
        let [near, far] =
            [905e-9, 1550e-9].map(|wavelength| receiver(wavelength).background_power_w(0.5, 1.0).unwrap());
        // By hand, with means of .690 and .270 W/(m²·nm): 13.8 W/m²·(.5/π)·4.5e-6 sr·π·1e-4 m²·.5 is 1.553 nW.
        agrees(1e9 * near, 1.55, 0.01);
        agrees(1e9 * far, 0.61, 0.01);
        // A photon has hc/λ, 2.195e-19 J and 1.282e-19 J.
        agrees(photons(near, 5e-9, 905e-9), 35.4, 0.1);
        agrees(photons(far, 5e-9, 1550e-9), 24.0, 1.0);
    }

    #[test]
    fn a_photon_at_1550_nm_has_four_fifths_of_an_electronvolt() {
        close(photons(1.602_176_634e-19, 1.0, 1.239_841_984e-6), 1.0, 1e-9);
    }

    #[test]
    fn ambient_light_follows_the_sun_alone() {
        assert_eq!(ambient(0.5, 1.0), 0.5);
        assert_eq!(ambient(0.5, 0.5), 0.25);
        assert_eq!(ambient(0.5, -0.3), 0.0);
    }

    #[test]
    fn a_white_surface_returns_the_suns_light_to_a_hemisphere() {
        // A receiver of 1 m² that looks into all directions, weighted by the cosine, has π steradians and takes it all.
        let all = Receiver { aperture_m2: 1.0, field_of_view_sr: PI, efficiency: 1.0, ..receiver(905e-9) };
        close(all.background_power_w(1.0, 1.0).unwrap(), band_irradiance_w_m2(905e-9, 20e-9).unwrap(), 1e-15);
    }
}
