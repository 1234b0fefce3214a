//! Surfaces whose reflectance was measured, by names that a job's `[materials]` can refer to.
//!
//! Reflectances are at normal incidence and relative to white. They are nominal: asphalt differs from asphalt by a factor of
//! three. The library has only what its sources state; what they leave out is left out here.

use crate::scene::{Spectrum, SurfaceKind};

/// An entry of the library.
pub(super) struct Entry {
    /// The name.
    pub name: &'static str,
    /// How it sends light back.
    pub surface: Measured,
}

/// What was measured of a surface.
#[derive(Clone, Copy)]
pub(super) enum Measured {
    /// The diffuse reflectance at 850, 905 and 1550 nm.
    Diffuse([f64; 3]),
    /// The coefficients of retroreflection at angles of 0.2° and 0.5° between light and eye, in cd/(lx·m²).
    Retroreflector([f64; 2]),
}

use Measured::{Diffuse, Retroreflector};

/// A diffuse surface that was measured in the near infrared as a whole.
const fn grey(name: &'static str, reflectance: f64) -> Entry {
    Entry { name, surface: Diffuse([reflectance; 3]) }
}

const fn spectrum(name: &'static str, reflectances: [f64; 3]) -> Entry {
    Entry { name, surface: Diffuse(reflectances) }
}

/// The entries.
pub(super) const LIBRARY: &[Entry] = &[
    // Spectra of Johns Hopkins University in the ASTER spectral library (A. M. Baldridge et al., 2009), interpolated.
    spectrum("asphalt", [0.27, 0.28, 0.36]), // asphaltic concrete, an old and pale sample
    spectrum("grass", [0.50, 0.51, 0.24]),
    spectrum("dry grass", [0.57, 0.60, 0.57]),
    spectrum("conifer", [0.52, 0.52, 0.19]),
    spectrum("deciduous", [0.55, 0.55, 0.25]),
    spectrum("grey shingle", [0.19, 0.19, 0.17]),
    spectrum("red shingle", [0.07, 0.07, 0.07]),
    spectrum("wood", [0.92, 0.92, 0.57]), // planed
    spectrum("aluminium", [0.54, 0.60, 0.81]),
    spectrum("copper", [0.51, 0.55, 0.78]),
    // The table of the manual of SICK's LD-LRS, for the near infrared and relative to white. It says nothing about 1550 nm.
    grey("tyre", 0.02),
    grey("black foam rubber", 0.024),
    grey("grey cardboard", 0.20),
    grey("white paper", 0.80),
    grey("plaster", 1.00),
    // ASTM D4956: the least R_A of white sheeting at an entrance angle of −4°.
    Entry { name: "retro sheet type I", surface: Retroreflector([70.0, 30.0]) },
    Entry { name: "retro sheet type II", surface: Retroreflector([140.0, 50.0]) },
    Entry { name: "retro sheet type III", surface: Retroreflector([250.0, 95.0]) },
];

/// The names of the entries.
pub(super) fn names() -> impl Iterator<Item = &'static str> + Clone {
    LIBRARY.iter().map(|entry| entry.name)
}

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

    /// The way in which light goes on.
    pub fn kind(self) -> SurfaceKind {
        match self {
            Diffuse(_) => SurfaceKind::Lambert,
            // R_A falls with the angle δ by exp(−(δ/δ₀)²), so the two figures say what δ₀ and the value at 0 are: of type III
            // 0.466° and 301 cd/(lx·m²).
            Retroreflector([nearer, farther]) => {
                let [near, far] = [0.2_f64, 0.5].map(|angle| angle.to_radians() * angle.to_radians());
                let lobe_squared = (far - near) / libm::log(nearer / farther);
                SurfaceKind::Retroreflector {
                    r_a: nearer * libm::exp(near / lobe_squared),
                    lobe_rad: lobe_squared.sqrt(),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheets_have_the_figures_that_they_were_made_of() {
        for entry in LIBRARY {
            let (Retroreflector(figures), SurfaceKind::Retroreflector { r_a, lobe_rad }) =
                (entry.surface, entry.surface.kind())
            else {
                continue;
            };
            for (figure, degrees) in figures.into_iter().zip([0.2_f64, 0.5]) {
                let part = degrees.to_radians() / lobe_rad;
                let told = r_a * libm::exp(-part * part);
                assert!((told / figure - 1.0).abs() < 1e-12, "{}: {told}", entry.name);
            }
        }
        let SurfaceKind::Retroreflector { r_a, lobe_rad } = Retroreflector([250.0, 95.0]).kind() else {
            panic!("a retroreflector is one");
        };
        assert!((r_a - 300.6).abs() < 0.1 && (lobe_rad.to_degrees() - 0.4659).abs() < 1e-4);
    }
}
