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
    /// Index into [`Geometry::optics`](super::Geometry::optics), if the job says of the material how surfaces send light back.
    pub optics: Option<u32>,
}

impl Default for Material {
    /// glTF's default material, which is white.
    fn default() -> Self {
        Self { name: String::new(), base_color: [1.0; 4], job_label: None, optics: None }
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
