//! Materials: the optical properties of surfaces.

/// The properties of a surface, and its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The material's name as the file gives it, or empty.
    pub name: String,
    /// Linear red, green, blue and alpha.
    pub base_color: [f32; 4],
    /// The semantic label that the job's `[labels]` gives the material by name.
    pub job_label: Option<u32>,
}

impl Default for Material {
    /// glTF's default material, which is white.
    fn default() -> Self {
        Self { name: String::new(), base_color: [1.0; 4], job_label: None }
    }
}

impl Material {
    /// Lambertian reflectivity ρ at the sensor's wavelength, 0 to 1. glTF has visible colours only, so the relative
    /// luminance of the linear base colour (ITU-R BT.709, 0.2126 R + 0.7152 G + 0.0722 B) stands for it.
    pub fn reflectivity(&self) -> f32 {
        let [r, g, b, _] = self.base_color;
        (0.2126 * r + 0.7152 * g + 0.0722 * b).clamp(0.0, 1.0)
    }
}

/// What a surface is like at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// Linear red, green, blue and alpha.
    pub base_color: [f32; 4],
    /// The share of metal, 0 to 1.
    pub metallic: f32,
    /// The roughness, 0 to 1.
    pub roughness: f32,
    /// The share of light that passes.
    pub transmission: f32,
    /// The strength of a clear coat, 0 to 1.
    pub clearcoat: f32,
    /// As in [`Material::specular`].
    pub specular: f32,
    /// The index of refraction.
    pub ior: f32,
    /// cover
    pub cover: f32,
}
impl Appearance {
    /// rho
    pub fn reflectivity(&self) -> f32 {
        let [r, g, b, _] = self.base_color;
        (0.2126 * r + 0.7152 * g + 0.0722 * b).clamp(0.0, 1.0)
    }
}
impl super::Scene {
    /// stub
    pub fn appearance(&self, placement: u32, triangle: u32, _u: f64, _v: f64) -> Appearance {
        let m = &self.geometry.materials[self.surface(placement, triangle).material as usize];
        Appearance {
            base_color: m.base_color,
            metallic: 0.0,
            roughness: 1.0,
            transmission: 0.0,
            clearcoat: 0.0,
            specular: 1.0,
            ior: 1.5,
            cover: 1.0,
        }
    }
    /// stub
    pub fn varies(&self, _p: u32, _t: u32) -> bool {
        false
    }
    /// stub
    pub fn optics(&self, _s: super::Surface) -> Option<&super::Optics> {
        None
    }
}
