//! Materials: the optical properties of surfaces.

use super::corners::CornerValues;
use super::texture::Texture;

/// The properties of a surface, and its name. Textures multiply the factors beside them.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The material's name as the file gives it, or empty.
    pub name: String,
    /// Linear red, green, blue and alpha.
    pub base_color: [f32; 4],
    /// The texture of the base colour.
    pub base_color_texture: Option<Texture>,
    /// The meaning of alpha.
    pub alpha: AlphaMode,
    /// The share of metal, 0 to 1.
    pub metallic: f32,
    /// The roughness, 0 to 1.
    pub roughness: f32,
    /// The texture of roughness (its green) and metal (its blue).
    pub metallic_roughness_texture: Option<Texture>,
    /// The share of light that passes, 0 to 1. It does not depend on the share of metal: glTF lets no light pass metal, but a surface
    /// of which nothing is said is metal there, and who asks for transmission means glass.
    pub transmission: f32,
    /// The texture of transmission (its red).
    pub transmission_texture: Option<Texture>,
    /// The strength of a clear coat, 0 to 1.
    pub clearcoat: f32,
    /// The strength of specular reflection where the surface is no metal, with the luminance of its colour. 1 is what the index of
    /// refraction gives.
    pub specular: f32,
    /// The index of refraction.
    pub ior: f32,
    /// The semantic label that the job's `[labels]` gives the material by name.
    pub job_label: Option<u32>,
    /// Index into [`Geometry::optics`](super::Geometry::optics), if the job says of the material how surfaces send light back.
    pub optics: Option<u32>,
}

/// The meaning of a surface's alpha.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha has no meaning, and the surface is solid.
    #[default]
    Opaque,
    /// The surface has a hole where alpha is less than the cutoff.
    Mask {
        /// The least alpha of a point that is there.
        cutoff: f32,
    },
    /// The surface covers this share.
    Blend,
}

/// The optical properties of a surface at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// Linear red, green, blue and alpha, with texture, factor and vertex colour, each 0 to 1.
    pub base_color: [f32; 4],
    /// The share of metal, 0 to 1.
    pub metallic: f32,
    /// The roughness, 0 to 1.
    pub roughness: f32,
    /// The share of light that passes through the part of the surface that alpha leaves, 0 to 1.
    pub transmission: f32,
    /// The strength of a clear coat, 0 to 1.
    pub clearcoat: f32,
    /// As in [`Material::specular`].
    pub specular: f32,
    /// The index of refraction.
    pub ior: f32,
    /// The share of the surface that is there, 0 in a hole and 1 where it covers everything.
    pub cover: f32,
    /// The share of the light that the surface keeps from passing: 0 in a hole, and 1 where it is solid. In between it is
    /// alpha · (1 − [`Appearance::transmission`]).
    pub opacity: f32,
}

impl Default for Material {
    /// glTF's default material, which is white.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [1.0; 4],
            base_color_texture: None,
            alpha: AlphaMode::Opaque,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            clearcoat: 0.0,
            specular: 1.0,
            ior: 1.5,
            job_label: None,
            optics: None,
        }
    }
}

/// The relative luminance of a linear colour (ITU-R BT.709).
pub(super) fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

impl Material {
    /// Lambertian reflectivity ρ at the sensor's wavelength, 0 to 1, as far as the factor of the base colour says.
    /// [`Appearance::reflectivity`] has the texture and vertex colours, too.
    pub fn reflectivity(&self) -> f32 {
        let [r, g, b, _] = self.base_color;
        luminance([r, g, b]).clamp(0.0, 1.0)
    }

    /// Whether light may pass somewhere: through holes, or because the surface is not solid.
    pub fn is_see_through(&self) -> bool {
        self.alpha != AlphaMode::Opaque || self.transmission > 0.0
    }

    /// Whether the material looks different from point to point.
    pub fn is_textured(&self) -> bool {
        self.textures().next().is_some()
    }

    /// The material's textures.
    pub fn textures(&self) -> impl Iterator<Item = &Texture> {
        [&self.base_color_texture, &self.metallic_roughness_texture, &self.transmission_texture]
            .into_iter()
            .flatten()
    }

    /// The appearance of the point that has these texture coordinates and this vertex colour.
    pub(super) fn at(&self, values: &CornerValues) -> Appearance {
        let uv = |texture: &Texture| values.uvs.get(texture.uv_set).copied().unwrap_or([f64::NAN; 2]);
        let of_texture =
            self.base_color_texture.as_ref().map_or([1.0; 4], |texture| texture.color(uv(texture)));
        let mut base_color = [0.0; 4];
        for (channel, value) in base_color.iter_mut().enumerate() {
            *value = (self.base_color[channel] * of_texture[channel] * values.color[channel]).clamp(0.0, 1.0);
        }
        let metal = self.metallic_roughness_texture.as_ref();
        let [_, roughness, metallic, _] = metal.map_or([1.0; 4], |texture| texture.values(uv(texture)));
        let metallic = (self.metallic * metallic).clamp(0.0, 1.0);
        let glass = self.transmission_texture.as_ref().filter(|_| self.transmission > 0.0);
        let [passes, ..] = glass.map_or([1.0; 4], |texture| texture.values(uv(texture)));
        let transmission = (self.transmission * passes).clamp(0.0, 1.0);
        let alpha = base_color[3];
        let cover = match self.alpha {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => f32::from(u8::from(alpha >= cutoff)),
            AlphaMode::Blend => alpha,
        };
        Appearance {
            base_color,
            metallic,
            roughness: (self.roughness * roughness).clamp(0.0, 1.0),
            transmission,
            clearcoat: self.clearcoat,
            specular: self.specular,
            ior: self.ior,
            cover,
            opacity: cover * (1.0 - transmission),
        }
    }
}

impl Appearance {
    /// Lambertian reflectivity ρ at the sensor's wavelength, 0 to 1. glTF has visible colours only, so the relative
    /// luminance of the linear base colour (ITU-R BT.709, 0.2126 R + 0.7152 G + 0.0722 B) stands for it.
    pub fn reflectivity(&self) -> f32 {
        let [r, g, b, _] = self.base_color;
        luminance([r, g, b]).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::scene::texture::Image;

    fn values(color: [f32; 4]) -> CornerValues {
        CornerValues { uvs: [[0.5; 2]; 8], color }
    }

    fn image(texel: [u8; 4]) -> Option<Texture> {
        Some(Texture::new(Arc::new(Image::new(1, 4, texel.to_vec()).unwrap())))
    }

    #[test]
    fn factors_textures_and_vertex_colours_multiply() {
        let material = Material {
            base_color: [0.5, 1.0, 0.25, 0.5],
            base_color_texture: image([255, 188, 255, 128]),
            metallic: 0.5,
            roughness: 0.5,
            metallic_roughness_texture: image([0, 51, 204, 0]),
            transmission: 0.5,
            transmission_texture: image([102, 0, 0, 0]),
            alpha: AlphaMode::Blend,
            ..Material::default()
        };
        let seen = material.at(&values([0.5, 0.5, 1.0, 0.5]));
        let expected = [0.25, 0.5 * 0.502_886_5, 0.25, 0.25 * 128.0 / 255.0];
        assert!(seen.base_color.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{seen:?}");
        let close = |a: f32, b: f32| assert!((a - b).abs() < 1e-6, "{a} is not {b}: {seen:?}");
        close(seen.roughness, 0.1);
        close(seen.metallic, 0.4);
        close(seen.transmission, 0.2);
        close(seen.opacity, seen.base_color[3] * 0.8);
        close(seen.reflectivity(), 0.2126 * 0.25 + 0.7152 * expected[1] + 0.0722 * 0.25);
    }

    #[test]
    fn alpha_means_what_the_mode_says() {
        let of = |alpha: AlphaMode, a: f32| {
            let material = Material { alpha, base_color: [1.0, 1.0, 1.0, a], ..Material::default() };
            material.at(&values([1.0; 4])).opacity
        };
        let mask = AlphaMode::Mask { cutoff: 0.5 };
        assert_eq!([of(AlphaMode::Opaque, 0.0), of(AlphaMode::Blend, 0.25)], [1.0, 0.25]);
        assert_eq!([of(mask, 0.5), of(mask, 0.4999)], [1.0, 0.0]);
        // A cutoff above 1 leaves nothing, and one of 0 leaves all.
        assert_eq!(of(AlphaMode::Mask { cutoff: 1.5 }, 1.0), 0.0);
        assert_eq!(of(AlphaMode::Mask { cutoff: 0.0 }, 0.0), 1.0);
    }
}
