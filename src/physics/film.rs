//! Diffuse ground under a film of water.
//!
//! Source: J. Lekner and M. C. Dorf, "Why some things are darker when wet", Appl. Opt. 27, 1278 (1988), here for light that
//! leaves in the direction it came from.

use super::fresnel::{dielectric_reflectance, diffuse_inner_reflectance};

/// A Lambert surface under a film of a liquid that absorbs nothing, such as asphalt in the rain.
///
/// Light passes the film's face, is scattered to all sides below, is thrown back from below by the face, again and again, and
/// leaves through the face. Water absorbs 1 mm deep less than 2 % of light at 905 nm, there and back, but most of it at 1550 nm:
/// there the model holds for films of some hundredths of a millimetre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WetDiffuse {
    /// The reflectance of the dry surface, 0 to 1.
    pub reflectance: f64,
    /// The refractive index of the film relative to air, more than 1. Water has 1.33.
    pub index: f64,
}

impl WetDiffuse {
    /// The factor of the wet surface's echo to the dry one's at the same angle: T²/(n²·(1 − r·ρ)), with Fresnel's
    /// T = 1 − R for unpolarised light, and with the film's reflectance r for diffuse light from within.
    ///
    /// T counts once for the way in and once for the way out, whose light the surface has scrambled. Light that leaves the film
    /// spreads over a solid angle n² times larger.
    pub fn factor_to_dry(&self, cosine: f64) -> f64 {
        let passed = 1.0 - self.film_reflectance(cosine);
        passed * passed
            / (self.index * self.index * (1.0 - diffuse_inner_reflectance(self.index) * self.reflectance))
    }

    /// The power factor of the wet surface: ρ·cosθ·[`Self::factor_to_dry`].
    pub fn power_factor(&self, cosine: f64) -> f64 {
        self.reflectance * cosine * self.factor_to_dry(cosine)
    }

    /// The share of light that the film's face reflects as a mirror. It makes ghosts of objects, seen by way of the ground.
    pub fn film_reflectance(&self, cosine: f64) -> f64 {
        dielectric_reflectance(cosine, self.index).unpolarised()
    }

    /// The share of light that leaves the wet surface to all sides, without the film's mirror: T·ρ·(1 − r)/(1 − r·ρ), with
    /// the symbols of [`Self::factor_to_dry`].
    pub fn diffuse_albedo(&self, cosine: f64) -> f64 {
        let inner = diffuse_inner_reflectance(self.index);
        (1.0 - self.film_reflectance(cosine)) * self.reflectance * (1.0 - inner)
            / (1.0 - inner * self.reflectance)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::testing::{agrees, close, midpoint};
    use super::*;

    const WET: WetDiffuse = WetDiffuse { reflectance: 0.2, index: 1.33 };

    #[test]
    fn wet_ground_is_darker_most_of_all_at_grazing_incidence() {
        // The figures, computed apart from this code, have two digits.
        for (degrees, printed) in [(0.0, 0.60), (60.0, 0.55), (80.0, 0.27)] {
            agrees(WET.factor_to_dry(libm::cos(degrees * PI / 180.0)), printed, 0.01);
        }
    }

    #[test]
    fn the_way_out_to_all_sides_adds_up_to_the_albedo() {
        // The radiance that leaves toward cosine c is that of the way in, times T(c)/n²: the power factor's bistatic form.
        for cosine in [1.0, 0.5, 0.1] {
            let into = 1.0 - WET.film_reflectance(cosine);
            let within =
                into * WET.reflectance / (1.0 - diffuse_inner_reflectance(WET.index) * WET.reflectance);
            let out = midpoint(0.0, 1.0, 10_000, |c| {
                2.0 * c * within * (1.0 - WET.film_reflectance(c)) / (WET.index * WET.index)
            });
            // The midpoint rule with 10⁴ steps errs by about 1e-8.
            close(out, WET.diffuse_albedo(cosine), 1e-6);
        }
    }

    #[test]
    fn a_white_surface_under_a_film_returns_all_light() {
        let white = WetDiffuse { reflectance: 1.0, index: 1.33 };
        for i in 0..=100 {
            let cosine = f64::from(i) / 100.0;
            close(white.diffuse_albedo(cosine) + white.film_reflectance(cosine), 1.0, 1e-14);
            assert!(WET.diffuse_albedo(cosine) + WET.film_reflectance(cosine) <= 1.0);
        }
    }
}
