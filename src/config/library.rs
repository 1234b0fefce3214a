//! Surfaces whose reflectance was measured, by names that a job's `[materials]` can refer to.
//!
//! Reflectances are at normal incidence and relative to white. They are nominal, as surfaces of one name differ much. The library
//! has only what its sources state; what they leave out is left out here.

use crate::scene::{Spectrum, SurfaceKind};

/// The figures that were measured of a surface.
#[derive(Clone, Copy)]
pub(crate) enum Measured {
    /// The diffuse reflectance at 850, 905 and 1550 nm.
    Diffuse([f64; 3]),
    /// The coefficients of retroreflection at angles of 0.2° and 0.5° between light and eye, in cd/(lx·m²).
    Retroreflector([f64; 2]),
}

use Measured::{Diffuse, Retroreflector};

/// A diffuse surface that was measured in the near infrared as a whole.
const fn grey(reflectance: f64) -> Measured {
    Diffuse([reflectance; 3])
}

/// The surfaces, by their names.
pub(super) static LIBRARY: [(&str, Measured); 18] = [
    // Spectra of Johns Hopkins University in the ASTER spectral library (A. M. Baldridge et al., 2009), as HELIOS++ ships them,
    // interpolated.
    ("asphalt", Diffuse([0.27, 0.28, 0.36])), // asphaltic concrete, an old and pale sample
    ("grass", Diffuse([0.50, 0.51, 0.24])),
    ("dry grass", Diffuse([0.57, 0.60, 0.57])),
    ("conifer", Diffuse([0.52, 0.52, 0.19])),
    ("deciduous", Diffuse([0.55, 0.55, 0.25])),
    ("grey shingle", Diffuse([0.19, 0.19, 0.17])),
    ("red shingle", Diffuse([0.07, 0.07, 0.07])),
    ("wood", Diffuse([0.92, 0.92, 0.57])), // planed
    ("aluminium", Diffuse([0.54, 0.60, 0.81])),
    ("copper", Diffuse([0.51, 0.55, 0.78])),
    // The table of the manual of SICK's LD-LRS, for the near infrared and relative to white. It says nothing about 1550 nm.
    ("tyre", grey(0.02)),
    ("black foam rubber", grey(0.024)),
    ("grey cardboard", grey(0.20)),
    ("white paper", grey(0.80)),
    ("plaster", grey(1.00)),
    // ASTM D4956: the least R_A of white sheeting at an entrance angle of −4°.
    ("retro sheet type I", Retroreflector([70.0, 30.0])),
    ("retro sheet type II", Retroreflector([140.0, 50.0])),
    ("retro sheet type III", Retroreflector([250.0, 95.0])),
];

impl Measured {
    /// The diffuse reflectance over the wavelength, if it was measured.
    pub fn spectrum(self) -> Option<Spectrum> {
        match self {
            Diffuse([at_850, at_905, at_1550]) => {
                Some(Spectrum([(850e-9, at_850), (905e-9, at_905), (1550e-9, at_1550)]))
            }
            Retroreflector(_) => None,
        }
    }

    /// The way in which light goes on, if the measurement says it. Of a diffuse surface the scene's file does.
    pub fn kind(self) -> Option<SurfaceKind> {
        match self {
            Diffuse(_) => None,
            // R_A falls with the angle δ by exp(−(δ/δ₀)²), so the two figures say what δ₀ and the value at 0 are: of type III
            // 0.466° and 301 cd/(lx·m²).
            Retroreflector([nearer, farther]) => {
                let [near, far] = [0.2_f64, 0.5].map(|angle| angle.to_radians() * angle.to_radians());
                let lobe_squared = (far - near) / libm::log(nearer / farther);
                Some(SurfaceKind::Retroreflector {
                    r_a: nearer * libm::exp(near / lobe_squared),
                    lobe_rad: lobe_squared.sqrt(),
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheets_have_the_figures_that_they_were_made_of() {
        for (name, surface) in LIBRARY {
            let (Retroreflector(figures), Some(SurfaceKind::Retroreflector { r_a, lobe_rad })) =
                (surface, surface.kind())
            else {
                continue;
            };
            for (figure, degrees) in figures.into_iter().zip([0.2_f64, 0.5]) {
                let part = degrees.to_radians() / lobe_rad;
                let told = r_a * libm::exp(-part * part);
                assert!((told / figure - 1.0).abs() < 1e-12, "{name}: {told}");
            }
        }
        let Some(SurfaceKind::Retroreflector { r_a, lobe_rad }) = Retroreflector([250.0, 95.0]).kind() else {
            panic!("a retroreflector is one");
        };
        assert!((r_a - 300.6).abs() < 0.1 && (lobe_rad.to_degrees() - 0.4659).abs() < 1e-4);
    }
}
