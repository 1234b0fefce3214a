//! The textures of materials: which image each has, where it lies on the surface, and how it goes on beyond its edges.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::data::Data;
use super::document::Document;
use super::fault::{Fault, missing};
use super::images;
use super::notices::Notices;
use super::schema::{ImageJson, Lenient, MaterialJson, TextureInfo, TextureJson, TextureTransform};
use crate::scene::texture::{Image, Texture, Wrap};

/// The numbers of OpenGL that glTF has for sampling.
const NEAREST: u32 = 9728;
const CLAMP_TO_EDGE: u32 = 33071;
const MIRRORED_REPEAT: u32 = 33648;

/// The textures of a material that are read.
pub(super) struct TexturesOf<'m> {
    pub base_color: Option<&'m TextureInfo>,
    pub metallic_roughness: Option<&'m TextureInfo>,
    pub transmission: Option<&'m TextureInfo>,
}

impl<'m> TexturesOf<'m> {
    /// Where a material has the older model of specular reflection and gloss, its colour counts.
    pub fn of(material: &'m MaterialJson) -> Self {
        let extensions = material.extensions.given();
        let older = extensions.and_then(|extensions| extensions.specular_glossiness.given());
        let pbr = material.pbr_metallic_roughness.given().filter(|_| older.is_none());
        let passes = extensions.and_then(|extensions| extensions.transmission.given());
        let passes = passes.filter(|passes| passes.transmission_factor.given().is_some_and(|&t| t > 0.0));
        Self {
            base_color: match older {
                Some(older) => older.diffuse_texture.given(),
                None => pbr.and_then(|pbr| pbr.base_color_texture.given()),
            },
            metallic_roughness: pbr.and_then(|pbr| pbr.metallic_roughness_texture.given()),
            transmission: passes.and_then(|passes| passes.transmission_texture.given()),
        }
    }

    fn iter(&self) -> impl Iterator<Item = &'m TextureInfo> {
        [self.base_color, self.metallic_roughness, self.transmission].into_iter().flatten()
    }
}

/// The numbers of the sets of texture coordinates that a material's textures take, in ascending order. The corners of triangles
/// have them in this order.
pub(super) fn uv_sets(material: &MaterialJson) -> Vec<u32> {
    let mut sets: Vec<u32> = TexturesOf::of(material).iter().map(set_of).collect();
    sets.sort_unstable();
    sets.dedup();
    sets
}

fn transform_of(info: &TextureInfo) -> Option<&TextureTransform> {
    info.extensions.given()?.transform.given()
}

/// The set of texture coordinates that a texture takes.
fn set_of(info: &TextureInfo) -> u32 {
    let of_transform = transform_of(info).and_then(|transform| transform.tex_coord.given());
    of_transform.or(info.tex_coord.given()).copied().unwrap_or(0)
}

/// The map from texture coordinates to those of the image: KHR_texture_transform scales, turns and moves, in this order.
fn image_from_uv(info: &TextureInfo) -> [[f64; 3]; 2] {
    let transform = transform_of(info);
    let pair = |of: fn(&TextureTransform) -> &Lenient<[f64; 2]>, default: f64| {
        transform.and_then(|transform| of(transform).given()).copied().unwrap_or([default; 2])
    };
    let [offset_u, offset_v] = pair(|transform| &transform.offset, 0.0);
    let [scale_u, scale_v] = pair(|transform| &transform.scale, 1.0);
    let rotation = transform.and_then(|transform| transform.rotation.given()).copied().unwrap_or(0.0);
    let (sin, cos) = libm::sincos(rotation);
    [[cos * scale_u, sin * scale_v, offset_u], [-sin * scale_u, cos * scale_v, offset_v]]
}

/// Where the bytes of an image are: its uri, and its bufferView.
type Place<'d> = (Option<&'d str>, Option<u32>);

/// Reads textures. Each image is decoded once.
pub(super) struct Textures<'d, 'a> {
    document: &'d Document,
    data: &'d Data<'a>,
    notices: &'d Notices,
    /// The images that were read or tried.
    images: BTreeMap<Place<'d>, Option<Arc<Image>>>,
}

impl<'d, 'a> Textures<'d, 'a> {
    pub fn new(document: &'d Document, data: &'d Data<'a>, notices: &'d Notices) -> Self {
        Self { document, data, notices, images: BTreeMap::new() }
    }

    /// A texture of a material whose textures take the sets of texture coordinates `sets`. `None` if it can't be read.
    pub fn read(&mut self, info: &TextureInfo, sets: &[u32], place: &impl Fn() -> String) -> Option<Texture> {
        let document = self.document;
        let texture = document.textures.get(info.index as usize).or_else(|| {
            let message = "a texture of it does not exist, and counts as white";
            self.notices.warn(place, message);
            None
        })?;
        let image = self.image(self.source(info.index, texture)?)?;
        let sampler = texture.sampler.given().and_then(|&index| document.samplers.get(index as usize));
        let wrap = |number: Option<&u32>| match number {
            Some(&CLAMP_TO_EDGE) => Wrap::ClampToEdge,
            Some(&MIRRORED_REPEAT) => Wrap::MirroredRepeat,
            _ => Wrap::Repeat,
        };
        Some(Texture {
            image,
            uv_set: sets.iter().position(|&set| set == set_of(info)).unwrap_or(0),
            image_from_uv: image_from_uv(info),
            wrap: [
                wrap(sampler.and_then(|sampler| sampler.wrap_s.given())),
                wrap(sampler.and_then(|sampler| sampler.wrap_t.given())),
            ],
            is_nearest: sampler.is_some_and(|sampler| sampler.mag_filter.given() == Some(&NEAREST)),
        })
    }

    /// The image of a texture. The extensions for other formats name an image besides the one for those who can't read them.
    fn source(&self, index: u32, texture: &TextureJson) -> Option<u32> {
        let place = || format!("texture {index}");
        let extensions = texture.extensions.given();
        let webp = extensions.and_then(|extensions| extensions.webp.given()?.source.given());
        let source = webp.or(texture.source.given()).copied();
        if source.is_none() {
            if extensions.is_some_and(|extensions| extensions.basisu.given().is_some()) {
                let message = "images of KHR_texture_basisu are not read: the texture counts as white";
                self.notices.note(place, message, Some("keep a PNG, JPEG or WebP beside it"));
            } else {
                self.notices.warn(place, "it names no image that is read, and counts as white");
            }
        }
        source
    }

    fn image(&mut self, index: u32) -> Option<Arc<Image>> {
        let document = self.document;
        let place = || document.image_label(index);
        let warn = |Fault { element, problem, .. }: Fault| {
            let separator = if element.is_empty() { "" } else { ": " };
            let message =
                format!("the image can't be read, and counts as white: {element}{separator}{problem}");
            self.notices.warn(place, message);
        };
        let Some(image) = document.images.get(index as usize) else {
            warn(missing("image", index, document.images.len()));
            return None;
        };
        let key = (image.uri.given().map(String::as_str), image.buffer_view.given().copied());
        if let Some(known) = self.images.get(&key) {
            return known.clone();
        }
        let decoded = self.decoded(image, &place).map_err(warn).ok().map(Arc::new);
        self.images.insert(key, decoded.clone());
        decoded
    }

    fn decoded(&self, image: &ImageJson, place: &dyn Fn() -> String) -> Result<Image, Fault> {
        let bytes = self.data.image(image)?;
        self.data.spend_on_image(bytes.len() as u64)?;
        let format = images::Format::of(&bytes)?;
        if let Some(given) = image.mime_type.given()
            && given != format.mime_type()
        {
            let message =
                format!("its mimeType is not that of its content, which is read as {}", format.name());
            self.notices.warn(place, message);
        }
        images::decode(&bytes, format, &|texels| {
            self.data.spend_on_image(texels.saturating_mul(size_of::<[u8; 4]>() as u64))
        })
        .map(|image| image.of_format(format.name()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(json: &str) -> TextureInfo {
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn transforms_scale_then_turn_then_move() {
        let plain = info(r#"{"index":0}"#);
        assert_eq!((image_from_uv(&plain), set_of(&plain)), ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 0));
        let turned = info(
            r#"{"index":0,"texCoord":2,"extensions":{"KHR_texture_transform":
            {"offset":[0.5,0.25],"rotation":1.5707963267948966,"scale":[2,3],"texCoord":1}}}"#,
        );
        assert_eq!(set_of(&turned), 1);
        let [x, y] = image_from_uv(&turned).map(|[u, v, offset]| u * 0.1 + v * 0.2 + offset);
        // A quarter turn to the left, seen with v downwards, takes (u, v) to (v, −u).
        assert!((x - (0.5 + 0.6)).abs() < 1e-12 && (y - (0.25 - 0.2)).abs() < 1e-12, "{x} {y}");
    }

    #[test]
    fn a_material_takes_each_set_of_coordinates_once() {
        let material: MaterialJson = serde_json::from_str(
            r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0,"texCoord":3},
                "metallicRoughnessTexture":{"index":1,"texCoord":1}},
                "extensions":{"KHR_materials_transmission":
                {"transmissionFactor":1,"transmissionTexture":{"index":2,"texCoord":3}}}}"#,
        )
        .unwrap();
        assert_eq!(uv_sets(&material), [1, 3]);
        assert_eq!(uv_sets(&MaterialJson::default()), [0; 0]);
    }
}
