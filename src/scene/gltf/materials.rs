//! Materials, and the notes on the parts of a file that are not read.

use std::collections::BTreeSet;

use super::data::Data;
use super::document::{APPEARANCE, Document, GEOMETRY};
use super::fault::quoted;
use super::notices::Notices;
use super::options::Options;
use super::schema::{Lenient, MaterialJson, SpecularGlossiness, TextureInfo};
use super::textures::{Textures, TexturesOf, uv_sets};
use crate::scene::material::{AlphaMode, Material, luminance};
use crate::source::words::counted;

/// The file's materials. A material that is wrong has the default's values where it is. Only those in `used` have textures.
pub(super) fn read(
    document: &Document,
    data: &Data,
    used: &BTreeSet<u32>,
    options: &Options,
    notices: &Notices,
) -> Vec<Material> {
    let optics = options.optics_by_name();
    let mut textures = Textures::new(document, data, notices);
    let materials: Vec<Material> = (0_u32..)
        .zip(&document.materials)
        .map(|(index, json)| {
            let place = || document.material_label(index);
            let mut material = factors(json, &place, notices);
            if used.contains(&index) {
                let sets = uv_sets(json);
                let mut read = |info: Option<&TextureInfo>| textures.read(info?, &sets, &place);
                let TexturesOf { base_color, metallic_roughness, transmission } = TexturesOf::of(json);
                material.base_color_texture = read(base_color);
                material.metallic_roughness_texture = read(metallic_roughness);
                material.transmission_texture = read(transmission);
            }
            material.job_label = options.labels.get(&material.name).copied();
            material.optics = optics.get(material.name.as_str()).copied();
            material
        })
        .collect();
    if materials.iter().any(|material| material.base_color_texture.is_some()) {
        let message = "reflectivity follows from the textures' visible colours: in the near infrared, where most LiDARs \
                       measure, a surface may reflect more or less";
        notices.note(String::new, message, None);
    }
    materials
}

/// A material without its textures.
fn factors(json: &MaterialJson, place: &impl Fn() -> String, notices: &Notices) -> Material {
    let name = given(&json.name, "name", place, notices).cloned().unwrap_or_default();
    let number = |value: Option<&Lenient<f64>>, key: &str, default: f32| {
        let value = value.and_then(|value| given(value, key, place, notices));
        value.map_or(default, |value| value.clamp(0.0, 1e6) as f32)
    };
    let share =
        |value: Option<&Lenient<f64>>, key: &str, default: f32| number(value, key, default).clamp(0.0, 1.0);
    let pbr = json.pbr_metallic_roughness.given();
    let default = Material { base_color: base_color(json, place, notices), name, ..Material::default() };
    let alpha = match given(&json.alpha_mode, "alphaMode", place, notices).map(String::as_str) {
        Some("MASK") => AlphaMode::Mask { cutoff: number(Some(&json.alpha_cutoff), "alphaCutoff", 0.5) },
        Some("BLEND") => AlphaMode::Blend,
        Some("OPAQUE") | None => AlphaMode::Opaque,
        Some(_) => {
            notices.warn(place, "its alphaMode is none that glTF knows: it counts as OPAQUE");
            AlphaMode::Opaque
        }
    };
    let base_color_texture = pbr.map(|pbr| &pbr.base_color_texture);
    base_color_texture.map(|info| given(info, "baseColorTexture", place, notices));
    let metal = pbr.map(|pbr| &pbr.metallic_roughness_texture);
    metal.map(|info| given(info, "metallicRoughnessTexture", place, notices));
    let material = Material {
        alpha,
        metallic: share(pbr.map(|pbr| &pbr.metallic_factor), "metallicFactor", 1.0),
        roughness: share(pbr.map(|pbr| &pbr.roughness_factor), "roughnessFactor", 1.0),
        ..default
    };
    let Some(extensions) = json.extensions.given() else { return material };
    let transmission = given(&extensions.transmission, "KHR_materials_transmission", place, notices);
    transmission.map(|glass| given(&glass.transmission_texture, "transmissionTexture", place, notices));
    let clearcoat = given(&extensions.clearcoat, "KHR_materials_clearcoat", place, notices);
    let ior = given(&extensions.ior, "KHR_materials_ior", place, notices);
    let specular = given(&extensions.specular, "KHR_materials_specular", place, notices);
    let tint = specular
        .and_then(|specular| given(&specular.specular_color_factor, "specularColorFactor", place, notices));
    let tint = tint.map_or(1.0, |tint| luminance(tint.map(|c| c.clamp(0.0, 1e6) as f32)));
    let strength = share(specular.map(|specular| &specular.specular_factor), "specularFactor", 1.0);
    let material = Material {
        transmission: share(transmission.map(|glass| &glass.transmission_factor), "transmissionFactor", 0.0),
        clearcoat: share(clearcoat.map(|coat| &coat.clearcoat_factor), "clearcoatFactor", 0.0),
        specular: strength * tint,
        ior: number(ior.map(|ior| &ior.ior), "ior", 1.5),
        ..material
    };
    // The older model has no metal, and gloss in place of roughness.
    match extensions.specular_glossiness.given() {
        None => material,
        Some(older) => {
            given(&older.diffuse_texture, "diffuseTexture", place, notices);
            let gloss = share(Some(&older.glossiness_factor), "glossinessFactor", 1.0);
            Material { metallic: 0.0, roughness: 1.0 - gloss, ..material }
        }
    }
}

/// A value that is given, with a warning if it is not what glTF asks for.
fn given<'m, T>(
    value: &'m Lenient<T>,
    key: &str,
    place: &impl Fn() -> String,
    notices: &Notices,
) -> Option<&'m T> {
    if matches!(value, Lenient::Wrong) {
        notices.warn(place, format!("its {key} is not what glTF asks for, and is not read"));
    }
    value.given()
}

fn base_color(material: &MaterialJson, place: &impl Fn() -> String, notices: &Notices) -> [f32; 4] {
    let older = given(&material.extensions, "extensions", place, notices)
        .and_then(|extensions| {
            given(&extensions.specular_glossiness, "KHR_materials_pbrSpecularGlossiness", place, notices)
        })
        .map(|SpecularGlossiness { diffuse_factor, .. }| (diffuse_factor, "diffuseFactor"));
    let (factor, key) = match older {
        Some(factor) => factor,
        None => match given(&material.pbr_metallic_roughness, "pbrMetallicRoughness", place, notices) {
            Some(pbr) => (&pbr.base_color_factor, "baseColorFactor"),
            None => return [1.0; 4],
        },
    };
    let color = match given(factor, key, place, notices).map(Vec::as_slice) {
        None => [1.0; 4],
        Some(&[r, g, b, a]) => [r, g, b, a],
        Some(&[r, g, b]) => {
            notices.warn(place, format!("its {key} has three numbers, not four; its alpha is taken as 1"));
            [r, g, b, 1.0]
        }
        Some(_) => {
            notices.warn(place, format!("its {key} does not have four numbers, and is not read"));
            [1.0; 4]
        }
    };
    color.map(|c| c.clamp(0.0, 1.0) as f32)
}

/// Notes what the file says that would change what a beam meets or returns, and that is not read.
pub(super) fn note_what_is_not_read(document: &Document, notices: &Notices) {
    for (index, material) in (0_u32..).zip(&document.materials) {
        let extensions = material.extensions.given();
        if extensions.is_some_and(|extensions| extensions.diffuse_transmission.is_some()) {
            let message = "diffuse transmission is not read: beams take the surface as solid";
            notices.note(|| document.material_label(index), message, None);
        }
    }
    for (index, node) in (0_u32..).zip(&document.nodes) {
        if node.camera.given().is_some() {
            let message = "cameras of the file are not used: a job places its own sensors";
            notices.note(|| document.node_label(index), message, Some("`beamcast info` lists cameras"));
        }
    }
    note_of_extensions(document, notices);
}

/// One note names all extensions that are not read. Those of materials that matter are told material by material.
fn note_of_extensions(document: &Document, notices: &Notices) {
    const MOST_NAMES: usize = 20;
    let is_read = |name: &&str| GEOMETRY.contains(name) || APPEARANCE.contains(name);
    let others = || document.extensions.iter().map(String::as_str).filter(|name| !is_read(name));
    let count = others().count();
    if count == 0 {
        return;
    }
    let names: Vec<String> = others().take(MOST_NAMES).map(quoted).collect();
    let more = if count > names.len() { ", …" } else { "" };
    let (are, names) = (if count == 1 { "is" } else { "are" }, names.join(", "));
    let message = format!("{} {are} not read: {names}{more}", counted(count, "extension"));
    notices.note(|| "extensionsUsed".to_owned(), message, None);
}
