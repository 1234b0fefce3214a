//! The appearance of a scene's surfaces where rays meet them.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::arrangement::Scene;
use super::material::{Appearance, Material};
use super::texture::Image;

impl Scene {
    /// The appearance of a triangle of the mesh at a placement, at the point with the barycentric weights `u` of the triangle's second
    /// corner and `v` of its third. A hit has these four numbers.
    pub fn appearance(&self, placement: u32, triangle: u32, u: f64, v: f64) -> Appearance {
        let mesh = self.mesh(self.arrangement.placements[placement as usize].mesh);
        self.material(placement, triangle).at(&mesh.corners.at(triangle, u, v))
    }

    /// [`Appearance::opacity`], which takes no time for a material that is not [see-through](Material::is_see_through).
    pub fn opacity(&self, placement: u32, triangle: u32, u: f64, v: f64) -> f32 {
        if self.material(placement, triangle).is_see_through() {
            self.appearance(placement, triangle, u, v).opacity
        } else {
            1.0
        }
    }

    /// Whether the [appearance](Scene::appearance) of a triangle differs from point to point.
    pub fn varies(&self, placement: u32, triangle: u32) -> bool {
        let mesh = self.mesh(self.arrangement.placements[placement as usize].mesh);
        !mesh.corners.is_empty()
            && (mesh.corners.has_colors(triangle) || self.material(placement, triangle).is_textured())
    }

    /// Whether light may pass through a surface of the scene.
    pub fn is_see_through(&self) -> bool {
        self.geometry.materials.iter().any(Material::is_see_through)
    }

    /// The bytes that images, texture coordinates and vertex colours take. An image that several materials share counts once.
    pub fn appearance_bytes(&self) -> u64 {
        let mut known = BTreeSet::new();
        let textures = self.geometry.materials.iter().flat_map(Material::textures);
        let images = textures.filter(|texture| known.insert(Arc::as_ptr(&texture.image)));
        let images = images.map(|texture| Image::bytes(&texture.image) as u64).sum::<u64>();
        images + self.geometry.meshes.iter().map(|mesh| mesh.corners.bytes() as u64).sum::<u64>()
    }

    fn material(&self, placement: u32, triangle: u32) -> &Material {
        &self.geometry.materials[self.surface(placement, triangle).material as usize]
    }
}
