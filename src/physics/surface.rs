//! Lambert's law and the materials of glTF, as power factors of surfaces that are seen from where they are lit.
//!
//! Sources: Khronos, "glTF 2.0 Specification", appendix B, and its extensions KHR_materials_ior, KHR_materials_specular,
//! KHR_materials_clearcoat and KHR_materials_transmission, for the terms and their mixture; B. Walter, S. R. Marschner, H. Li
//! and K. E. Torrance, "Microfacet models for refraction through rough surfaces" (2007), for GGX; E. Heitz, "Understanding the
//! masking-shadowing function in microfacet-based BRDFs" (2014), for the masking of both directions together.
//!
//! A surface with the distribution f of reflected light (BRDF, per steradian) has the power factor F = π·f·cosθ. The beam comes
//! back the way it went, so that the half vector is the direction itself: Fresnel's term is that of normal incidence at every
//! angle of the surface.

/// The reflectance of glTF's clear coat at normal incidence, for its index of 1.5.
pub const COAT_F0: f64 = 0.04;

/// The power factor of a Lambert surface: ρ·cosθ, and 0 for a surface that faces away.
pub fn lambert(reflectance: f64, cosine: f64) -> f64 {
    reflectance * cosine.max(0.0)
}

/// The reflectance at normal incidence of a dielectric in glTF: min(((n − 1)/(n + 1))²·colour, 1)·specular
/// (KHR_materials_ior and KHR_materials_specular).
///
/// `index` is n, 1.5 by default; `specular` is specularFactor and `specular_colour` is specularColorFactor at the wavelength of
/// the LiDAR, 1 by default.
pub fn dielectric_f0(index: f64, specular: f64, specular_colour: f64) -> f64 {
    let amplitude = (index - 1.0) / (index + 1.0);
    (amplitude * amplitude * specular_colour).min(1.0) * specular
}

/// The power factor of a GGX lobe: π·F0·D·G2/(4·cosθ), with a = roughness²,
/// D = a²/(π·(cos²θ·(a² − 1) + 1)²) and G2 = 1/√(1 + a²·tan²θ). It is F0/(4a²) at normal incidence, and F0/4 at every angle
/// for a roughness of 1.
///
/// `f0` is the reflectance at normal incidence. A roughness of 0 is a mirror, which has no lobe: the factor is 0. See
/// [`mirror_roughness`] for the roughness below which a lobe counts as a mirror.
pub fn ggx_lobe(f0: f64, roughness: f64, cosine: f64) -> f64 {
    if roughness <= 0.0 || cosine <= 0.0 {
        return 0.0;
    }
    let a2 = roughness * roughness * roughness * roughness;
    let (cos2, sin2) = (cosine * cosine, (1.0 - cosine * cosine).max(0.0));
    // cos²θ·(a² − 1) + 1 and cosθ·√(1 + a²·tan²θ), in forms that neither cancel nor divide by 0.
    let (spread, masked) = (a2 * cos2 + sin2, (cos2 + a2 * sin2).sqrt());
    f0 * a2 / (4.0 * spread * spread * masked)
}

/// The roughness at which a = roughness² is half the beam's full divergence: √(divergence/2). Half the lobe's height lies at
/// .644·a, so below that roughness the lobe is narrower than the beam, and the surface is to be taken as a mirror: the beam's
/// samples would miss the lobe or count it too often.
pub fn mirror_roughness(divergence_rad: f64) -> f64 {
    (0.5 * divergence_rad).sqrt()
}

/// A material of glTF at the wavelength of a LiDAR.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetallicRoughness {
    /// The base colour at the LiDAR's wavelength, 0 to 1: the diffuse reflectance of a dielectric, or the reflectance of a metal
    /// at normal incidence.
    pub base_reflectance: f64,
    /// The share of metal, 0 to 1.
    pub metallic: f64,
    /// The roughness, 0 to 1. The lobe's width is its square.
    pub roughness: f64,
    /// The reflectance of the dielectric at normal incidence; see [`dielectric_f0`]. glTF's default is .04.
    pub f0: f64,
    /// The share of the clear coat, 0 to 1.
    pub clearcoat: f64,
    /// The roughness of the clear coat, 0 to 1.
    pub clearcoat_roughness: f64,
    /// The share of light that enters the dielectric and passes it instead of being scattered, 0 to 1.
    pub transmission: f64,
}

impl MetallicRoughness {
    /// A dielectric that is rough, uncoated and opaque, with glTF's default of .04 at normal incidence.
    pub fn rough(base_reflectance: f64) -> Self {
        Self {
            base_reflectance,
            metallic: 0.0,
            roughness: 1.0,
            f0: 0.04,
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            transmission: 0.0,
        }
    }

    /// The power factor of the scattering below the surface, without the coat:
    /// (1 − metallic)·(1 − F0)·(1 − transmission)·ρ·cosθ.
    pub fn diffuse(&self, cosine: f64) -> f64 {
        (1.0 - self.metallic)
            * (1.0 - self.f0)
            * (1.0 - self.transmission)
            * lambert(self.base_reflectance, cosine)
    }

    /// The reflectance of the surface at normal incidence, without the coat: F0 of the dielectric and ρ of the metal, mixed.
    pub fn normal_reflectance(&self) -> f64 {
        self.f0 + (self.base_reflectance - self.f0) * self.metallic
    }

    /// The power factor of the surface's lobe, without the coat: [`ggx_lobe`] of [`Self::normal_reflectance`].
    pub fn specular(&self, cosine: f64) -> f64 {
        ggx_lobe(self.normal_reflectance(), self.roughness, cosine)
    }

    /// The power factor of the clear coat's lobe: clearcoat·[`ggx_lobe`] with F0 = .04.
    pub fn coat(&self, cosine: f64) -> f64 {
        self.clearcoat * ggx_lobe(COAT_F0, self.clearcoat_roughness, cosine)
    }

    /// The share of light that passes the coat, one way: 1 − clearcoat·F(θ), with Schlick's
    /// F(θ) = .04 + .96·(1 − cosθ)⁵ of KHR_materials_clearcoat. It is 1 − .04·clearcoat at normal incidence.
    pub fn coat_transmission(&self, cosine: f64) -> f64 {
        1.0 - self.clearcoat * schlick(COAT_F0, cosine)
    }

    /// The power factor of the material: the coat's lobe, and below the coat, which light passes twice, the surface's lobe and
    /// the scattering. Lobes whose roughness is less than [`mirror_roughness`] are not for this function: set their share of
    /// light as a mirror's, with [`super::fresnel`].
    pub fn power_factor(&self, cosine: f64) -> f64 {
        let passed = self.coat_transmission(cosine);
        self.coat(cosine) + passed * passed * (self.specular(cosine) + self.diffuse(cosine))
    }

    /// The share of light that goes on through a thin surface, one way:
    /// (1 − metallic)·transmission·ρ·(1 − F(θ))·[`Self::coat_transmission`], with Schlick's F. The factor on the echo of a target
    /// behind it is the square. A pane of two faces is [`super::Pane`].
    pub fn passed(&self, cosine: f64) -> f64 {
        (1.0 - self.metallic)
            * self.transmission
            * self.base_reflectance
            * (1.0 - schlick(self.f0, cosine))
            * self.coat_transmission(cosine)
    }
}

/// Schlick's approximation of Fresnel's reflectance: F0 + (1 − F0)·(1 − cosθ)⁵.
pub fn schlick(f0: f64, cosine: f64) -> f64 {
    let rest = 1.0 - cosine.clamp(0.0, 1.0);
    let squared = rest * rest;
    f0 + (1.0 - f0) * squared * squared * rest
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::testing::{agrees, close, midpoint};
    use super::*;

    fn cosine_deg(degrees: f64) -> f64 {
        libm::cos(degrees * PI / 180.0)
    }

    /// GGX's distribution of normals, per steradian.
    fn distribution(a: f64, cosine: f64) -> f64 {
        let below = cosine * cosine * (a * a - 1.0) + 1.0;
        a * a / (PI * below * below)
    }

    /// Smith's auxiliary function for GGX.
    fn smith(a: f64, cosine: f64) -> f64 {
        let tan2 = (1.0 - cosine * cosine) / (cosine * cosine);
        ((1.0 + a * a * tan2).sqrt() - 1.0) / 2.0
    }

    /// The distribution of reflected light of a GGX surface that absorbs nothing, from one direction to another.
    fn bistatic(a: f64, to_light: [f64; 3], to_eye: [f64; 3]) -> f64 {
        let sum = [0, 1, 2].map(|i| to_light[i] + to_eye[i]);
        let length = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt();
        let masking = 1.0 / (1.0 + smith(a, to_light[2]) + smith(a, to_eye[2]));
        distribution(a, sum[2] / length) * masking / (4.0 * to_light[2] * to_eye[2])
    }

    fn direction(cosine: f64, azimuth: f64) -> [f64; 3] {
        let sine = (1.0 - cosine * cosine).sqrt();
        [sine * libm::cos(azimuth), sine * libm::sin(azimuth), cosine]
    }

    #[test]
    fn lobes_are_as_high_as_computed_apart_from_this_code() {
        // At normal incidence F0/(4a²) is exact but for a few roundings of 1.1e-16.
        close(ggx_lobe(0.04, 0.1, 1.0), 100.0, 1e-14);
        close(ggx_lobe(0.04, 0.5, 1.0), 0.16, 1e-14);
        for degrees in [0.0, 30.0, 60.0, 90.0] {
            close(ggx_lobe(0.04, 1.0, cosine_deg(degrees)), 0.01, 1e-14);
        }
        // These figures have 3, 4 and 4 digits after the point.
        agrees(ggx_lobe(0.04, 0.3, 1.0), 1.235, 1e-3);
        agrees(ggx_lobe(0.04, 0.3, cosine_deg(2.0)), 0.9355, 1e-4);
        agrees(ggx_lobe(0.04, 0.3, cosine_deg(10.0)), 0.0569, 1e-4);
    }

    #[test]
    fn a_lobe_is_the_bistatic_model_seen_from_the_light() {
        for roughness in [0.2, 0.5, 0.9] {
            for degrees in [0.0, 15.0, 40.0, 75.0] {
                let d = direction(cosine_deg(degrees), 0.3);
                let expected = PI * 0.04 * bistatic(roughness * roughness, d, d) * d[2];
                // The distribution cancels near the peak of a narrow lobe: 1.1e-16/a², 7e-14 at the least roughness.
                close(ggx_lobe(0.04, roughness, d[2]), expected, 1e-12);
            }
        }
    }

    #[test]
    fn the_normals_of_a_lobe_cover_the_surface_once() {
        for a in [0.05, 0.3, 1.0] {
            let covered = midpoint(0.0, 1.0, 200_000, |c| TAU_COSINE * c * distribution(a, c));
            // The narrowest peak is a²/2 = 1.25e-3 wide in the cosine, 250 steps: the midpoint rule errs by about 250⁻².
            close(covered, 1.0, 2e-5);
        }
    }
    const TAU_COSINE: f64 = 2.0 * PI;

    #[test]
    fn a_surface_that_absorbs_nothing_returns_no_more_than_it_gets() {
        let albedo = |a, degrees| {
            let to_light = direction(cosine_deg(degrees), 0.0);
            midpoint(0.0, 1.0, 400, |c| {
                midpoint(0.0, 2.0 * PI, 400, |azimuth| bistatic(a, to_light, direction(c, azimuth)) * c)
            })
        };
        for a in [0.2, 0.5, 1.0] {
            for degrees in [0.0, 45.0, 80.0] {
                // Light that would be reflected twice is lost by the model, so the sum is less than 1. The grid of 400 by 400
                // resolves a lobe of width .2 with 40 steps, and errs by less than 40⁻².
                assert!(albedo(a, degrees) < 1.0 + 7e-4);
            }
        }
        // The roughest surface has ∫ c·dc/(1 + c) = 1 − ln 2 at normal incidence, and the midpoint rule errs by 400⁻².
        close(albedo(1.0, 0.0), 1.0 - std::f64::consts::LN_2, 1e-5);
    }

    #[test]
    fn half_the_height_of_a_lobe_lies_at_two_thirds_of_its_width() {
        let roughness = mirror_roughness(3e-3);
        close(roughness * roughness, 1.5e-3, 1e-15);
        let half = roughness * roughness * (libm::sqrt(2.0) - 1.0).sqrt();
        // The peak is 1/(1 + θ²/a²)² for small angles; the next order is θ², 1e-6.
        close(ggx_lobe(1.0, roughness, libm::cos(half)), 0.5 * ggx_lobe(1.0, roughness, 1.0), 1e-5);
        agrees(half / 1.5e-3, 0.644, 1e-3);
    }

    #[test]
    fn a_dielectric_has_the_reflectance_of_its_index() {
        close(dielectric_f0(1.5, 1.0, 1.0), 0.04, 1e-15);
        close(dielectric_f0(1.5, 0.5, 1.0), 0.02, 1e-15);
        assert_eq!(dielectric_f0(1.5, 0.5, 100.0), 0.5);
        // Fresnel's exact formula agrees at normal incidence.
        let fresnel = super::super::fresnel::dielectric_reflectance(1.0, 1.33).unpolarised();
        close(dielectric_f0(1.33, 1.0, 1.0), fresnel, 1e-14);
    }

    #[test]
    fn the_terms_of_a_material_mix_as_gltf_says() {
        let plastic = MetallicRoughness { roughness: 0.5, ..MetallicRoughness::rough(0.5) };
        close(plastic.power_factor(1.0), 0.96 * 0.5 + 0.16, 1e-14);
        let metal = MetallicRoughness { metallic: 1.0, ..plastic };
        close(metal.power_factor(1.0), 0.5 / (4.0 * 0.0625), 1e-14);
        let coated = MetallicRoughness { clearcoat: 1.0, clearcoat_roughness: 0.1, ..plastic };
        // At normal incidence the coat scales the base by (1 − .04c)².
        close(coated.power_factor(1.0), 100.0 + 0.96 * 0.96 * (0.48 + 0.16), 1e-14);
        let glass = MetallicRoughness { transmission: 1.0, ..MetallicRoughness::rough(1.0) };
        assert_eq!(glass.diffuse(0.7), 0.0);
        assert!(glass.specular(0.7) > 0.0);
        close(glass.passed(1.0), 0.96, 1e-15);
        assert_eq!(lambert(0.5, -0.2), 0.0);
        assert_eq!(ggx_lobe(1.0, 0.0, 1.0), 0.0);
        assert_eq!(ggx_lobe(1.0, 0.5, 0.0), 0.0);
    }

    #[test]
    fn an_oblique_coat_passes_less() {
        let coated = MetallicRoughness { clearcoat: 1.0, ..MetallicRoughness::rough(0.5) };
        // By hand at 60°: .04 + .96/32 = .07.
        close(coated.coat_transmission(0.5), 0.93, 1e-15);
        assert_eq!(coated.coat_transmission(0.0), 0.0);
    }
}
