//! How surfaces send light back at the sensor's wavelength, as a job says it of materials, nodes and labels.

/// How a surface sends light back. Each value that is absent follows from the scene's file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Optics {
    /// The name of the entry: that of a material, a node or a label.
    pub name: String,
    /// The diffuse reflectance at the sensor's wavelength, 1 for white. It may be above 1, as data sheets count relative to white.
    pub reflectance: Option<f64>,
    /// The diffuse reflectance over the wavelength, which counts where `reflectance` is absent.
    pub spectrum: Option<Spectrum>,
    /// The way in which light goes on.
    pub kind: Option<SurfaceKind>,
    /// The share of the surface that a film of water covers, 0 to 1.
    pub wetness: f64,
}

impl Optics {
    /// The diffuse reflectance at a wavelength in metres, if the job says it.
    pub fn reflectance_at(&self, wavelength_m: f64) -> Option<f64> {
        self.reflectance.or_else(|| self.spectrum.map(|spectrum| spectrum.at(wavelength_m)))
    }
}

/// A reflectance over the wavelength: wavelengths in metres, in ascending order, each with the reflectance there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrum(pub [(f64, f64); 3]);

impl Spectrum {
    /// The reflectance at a wavelength in metres: linear between those that are known, and that of the nearest outside.
    pub fn at(&self, wavelength_m: f64) -> f64 {
        let [first, .., last] = self.0;
        for two in self.0.windows(2) {
            let ((from_m, from), (to_m, to)) = (two[0], two[1]);
            if (from_m..=to_m).contains(&wavelength_m) {
                return from + (to - from) * ((wavelength_m - from_m) / (to_m - from_m));
            }
        }
        if wavelength_m < first.0 { first.1 } else { last.1 }
    }
}

/// The way in which light goes on from a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SurfaceKind {
    /// Diffuse in all directions, by Lambert's law.
    Lambert,
    /// Diffuse below a glossy lobe, as glTF's materials.
    Ggx {
        /// glTF's roughness, 0 to 1.
        roughness: f64,
        /// The reflectance of the lobe at a right angle.
        f0: f64,
    },
    /// A mirror.
    Mirror {
        /// The reflectance, 0 to 1.
        reflectance: f64,
    },
    /// Glass. With a thickness each surface of the scene is a pane with both of its faces; without one it is a single face.
    Glass {
        /// The index of refraction.
        index: f64,
        /// The thickness of the pane in metres, or 0.
        thickness_m: f64,
    },
    /// A surface of water, which is a mirror, and dark where light goes in.
    Water,
    /// A retroreflector.
    Retroreflector {
        /// The coefficient of retroreflection R_A at a right angle and without an angle between the light and the eye, in
        /// cd/(lx·m²).
        r_a: f64,
        /// The angle between the light and the eye at which R_A has fallen to 1/e, in radians.
        lobe_rad: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reflectance_follows_the_wavelength() {
        let grass = Spectrum([(850e-9, 0.50), (905e-9, 0.51), (1550e-9, 0.24)]);
        for (nm, expected) in [(532.0, 0.50), (850.0, 0.50), (877.5, 0.505), (905.0, 0.51), (2000.0, 0.24)] {
            assert!((grass.at(nm * 1e-9) - expected).abs() < 1e-12, "{nm}: {}", grass.at(nm * 1e-9));
        }
        let like = Optics { spectrum: Some(grass), ..Optics::default() };
        assert_eq!(like.reflectance_at(905e-9), Some(grass.at(905e-9)));
        assert_eq!(Optics { reflectance: Some(0.3), ..like }.reflectance_at(905e-9), Some(0.3));
        assert_eq!(Optics::default().reflectance_at(905e-9), None);
    }
}
