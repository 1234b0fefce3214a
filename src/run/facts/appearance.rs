//! What the surfaces of a scene look like: where alpha lets light pass, and the images of textures.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;

use crate::scene::{AlphaMode, Geometry, Image, Material};

/// A material whose alpha may let light pass.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AlphaFacts {
    /// The material's name as the file gives it, or empty.
    pub material: String,
    /// The alphaMode: `MASK` or `BLEND`.
    pub mode: &'static str,
    /// Of a mask, the least alpha of a point that is there.
    pub cutoff: Option<f32>,
}

/// An image that textures show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageFacts {
    /// `PNG`, `JPEG` or `WebP`, if it is from a file.
    pub format: Option<&'static str>,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The number of materials whose textures show it.
    pub materials: usize,
}

impl AlphaFacts {
    /// The materials of a scene whose alpha has a meaning, in the order of the scene.
    pub(super) fn all(geometry: &Geometry) -> Vec<Self> {
        let of = |material: &Material| {
            let (mode, cutoff) = match material.alpha {
                AlphaMode::Opaque => return None,
                AlphaMode::Mask { cutoff } => ("MASK", Some(cutoff)),
                AlphaMode::Blend => ("BLEND", None),
            };
            Some(Self { material: material.name.clone(), mode, cutoff })
        };
        geometry.materials.iter().filter_map(of).collect()
    }
}

impl ImageFacts {
    /// The images of a scene, in the order in which its materials name them first.
    pub(super) fn all(geometry: &Geometry) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        let mut known: BTreeMap<*const Image, usize> = BTreeMap::new();
        for material in &geometry.materials {
            let mut own: Vec<usize> = Vec::new();
            for texture in material.textures() {
                let image = &texture.image;
                let index = *known.entry(Arc::as_ptr(image)).or_insert_with(|| {
                    let [width, height] = image.size();
                    all.push(Self { format: image.format(), width, height, materials: 0 });
                    all.len() - 1
                });
                if !own.contains(&index) {
                    all[index].materials += 1;
                    own.push(index);
                }
            }
        }
        all
    }
}
