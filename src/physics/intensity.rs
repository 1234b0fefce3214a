//! The scales of intensity of LiDAR makers.
//!
//! Makers print where diffuse surfaces end and retroreflectors begin, and not how retroreflectors are spread over the rest. The
//! logarithm and its upper end, [`TOP_GAIN`], are this room's own choice.

use std::f64::consts::PI;

use super::retro;

/// The gain over white that has the largest value of the scales for retroreflectors: π·250 = 785, that of new white sheeting of
/// type III at .2° (ASTM D4956). It is this room's choice; makers print none.
pub const TOP_GAIN: f64 = 250.0 * PI;

/// A scale of intensity.
///
/// A scale turns a *calibrated reflectivity* into a value: the power factor that the sensor infers by correcting its received power
/// for range and air. It is 1 for a white Lambert plane at normal incidence, and more than 1 for retroreflectors and for shiny
/// surfaces seen head-on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntensityScale {
    /// The reflectivity itself, without an upper end.
    Ideal,
    /// The reflectivity in percent, without an upper end.
    Percent,
    /// Velodyne's VLP-16: 0 to 100 for diffuse surfaces of 0 to 100 %, and 101 to 255 for retroreflectors (VLP-16
    /// manual).
    Velodyne,
    /// Velodyne's VLS-128: 0 to 110 for diffuse surfaces, and 111 to 255 for retroreflectors (VLS-128 manual). The manual does
    /// not say how 110 values stand for 100 %; here they do so evenly, which is uncertain.
    Vls128,
    /// Livox: 0 to 150 for diffuse surfaces of 0 to 100 %, and 151 to 255 for total reflection (Livox wiki).
    Livox,
    /// Hesai: 0 to 255 for 0 to 255 %, evenly. Its sensors can be set to a table that is not even, which this is not.
    Hesai,
    /// Ouster's `reflectivity` of 8 bits: 0 to 100 for 0 to 100 %, evenly, and logarithmic above. The upper part is uncertain.
    OusterReflectivity,
}

impl IntensityScale {
    /// The value of a calibrated reflectivity, before it is rounded.
    ///
    /// The value never falls as the reflectivity grows, is 0 for none or less, and stays at [`Self::top`] above the scale's upper
    /// end. Retroreflectors have d + (255 − d)·ln ρ/ln [`TOP_GAIN`], where d is the value of white, 1 ≤ ρ ≤ [`TOP_GAIN`]. A
    /// reflectivity that is not a number has the value 0.
    pub fn value(self, calibrated_reflectivity: f64) -> f64 {
        // The larger of a number and NaN is the number.
        let reflectivity = calibrated_reflectivity.max(0.0);
        let (white, top) = (self.white(), self.top());
        if reflectivity <= 1.0 || !self.is_logarithmic() {
            return (white * reflectivity).min(top);
        }
        (white + (top - white) * libm::log(reflectivity) / libm::log(TOP_GAIN)).min(top)
    }

    /// The value of white at normal incidence.
    pub fn white(self) -> f64 {
        match self {
            Self::Ideal => 1.0,
            Self::Percent | Self::Velodyne | Self::Hesai | Self::OusterReflectivity => 100.0,
            Self::Vls128 => 110.0,
            Self::Livox => 150.0,
        }
    }

    /// The largest value, infinite where the scale has no upper end.
    pub fn top(self) -> f64 {
        match self {
            Self::Ideal | Self::Percent => f64::INFINITY,
            Self::Velodyne | Self::Vls128 | Self::Livox | Self::Hesai | Self::OusterReflectivity => 255.0,
        }
    }

    /// Whether values above white's are logarithmic.
    fn is_logarithmic(self) -> bool {
        matches!(self, Self::Velodyne | Self::Vls128 | Self::Livox | Self::OusterReflectivity)
    }
}

/// The calibrated reflectivity of sheeting with the coefficient of retroreflection R_A in cd/(lx·m²), head-on: π·R_A.
pub fn reflectivity_of_sheeting(coefficient: f64) -> f64 {
    retro::gain(coefficient)
}

#[cfg(test)]
mod tests {
    use super::super::testing::close;
    use super::IntensityScale::*;
    use super::*;

    const ALL: [IntensityScale; 7] = [Ideal, Percent, Velodyne, Vls128, Livox, Hesai, OusterReflectivity];

    #[test]
    fn diffuse_surfaces_have_the_makers_values() {
        for (scale, half, white) in
            [(Velodyne, 50.0, 100.0), (Vls128, 55.0, 110.0), (Livox, 75.0, 150.0), (Hesai, 50.0, 100.0)]
        {
            close(scale.value(0.5), half, 1e-15);
            close(scale.value(1.0), white, 1e-15);
        }
        assert_eq!(Ideal.value(2.5), 2.5);
        assert_eq!(Percent.value(3.0), 300.0);
        assert_eq!(Hesai.value(2.0), 200.0);
    }

    #[test]
    fn retroreflectors_fill_the_rest_of_the_scale() {
        for scale in [Velodyne, Vls128, Livox, OusterReflectivity] {
            // The first value of retroreflectors is reached soon after white, and the last one by type III.
            assert!(scale.value(1.1).round() > scale.white());
            close(scale.value(reflectivity_of_sheeting(250.0)), 255.0, 1e-14);
            assert!(scale.value(reflectivity_of_sheeting(140.0)) < 250.0);
            close(scale.value(TOP_GAIN.sqrt()), 0.5 * (scale.white() + 255.0), 1e-14);
        }
        close(TOP_GAIN, 785.0, 0.5 / 785.0);
    }

    #[test]
    fn every_scale_rises_to_its_top_and_stays() {
        for scale in ALL {
            let mut last = -1.0;
            for i in 0..4000 {
                let value = scale.value(libm::exp(0.005 * f64::from(i) - 10.0));
                assert!(value >= last && value <= scale.top());
                last = value;
            }
            assert_eq!(scale.value(f64::INFINITY), scale.top());
            for nothing in [0.0, -1.0, f64::NAN] {
                assert_eq!(scale.value(nothing), 0.0);
            }
        }
    }

    #[test]
    fn no_scale_jumps_at_white() {
        for scale in ALL {
            // The slope is 150 at most.
            assert!((scale.value(1.0 + 1e-9) - scale.value(1.0 - 1e-9)).abs() < 1e-6);
        }
    }
}
