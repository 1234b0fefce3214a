//! Materials, of which the colour is read, and the notes on what else a file says that changes nothing here.

use super::document::{Document, GEOMETRY};
use super::fault::quoted;
use super::notices::Notices;
use super::options::Options;
use super::schema::{Lenient, MaterialJson, SpecularGlossiness};
use crate::scene::material::Material;
use crate::source::words::counted;

/// The file's materials. A material that is wrong has the default's values where it is.
pub(super) fn read(document: &Document, options: &Options, notices: &Notices) -> Vec<Material> {
    let optics = options.optics_by_name();
    (0_u32..)
        .zip(&document.materials)
        .map(|(index, material)| {
            let place = || document.material_label(index);
            let name = given(&material.name, "name", &place, notices).cloned().unwrap_or_default();
            Material {
                job_label: options.labels.get(&name).copied(),
                optics: optics.get(name.as_str()).copied(),
                name,
                base_color: base_color(material, &place, notices),
            }
        })
        .collect()
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
        note_of_material(material, &|| document.material_label(index), notices);
    }
    for (index, mesh) in (0_u32..).zip(&document.meshes) {
        let has_color = |name: &String| name.starts_with("COLOR_");
        if mesh.primitives.iter().any(|primitive| primitive.attributes.keys().any(has_color)) {
            let message = "vertex colours (COLOR_0) are not read: the material's colour alone counts";
            notices.note(|| document.mesh_label(index), message, None);
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
    const TOLD: [&str; 2] = ["KHR_materials_transmission", "KHR_materials_pbrSpecularGlossiness"];
    let is_read = |name: &&str| GEOMETRY.contains(name) || TOLD.contains(name);
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

fn note_of_material(material: &MaterialJson, place: &impl Fn() -> String, notices: &Notices) {
    match material.alpha_mode.given().map(String::as_str) {
        Some("MASK") => {
            let message = "alphaMode MASK is not read: beams hit the whole triangle, holes and all";
            notices.note(place, message, Some("cut the holes out as triangles if they matter"));
        }
        Some("BLEND") => {
            let message = "alphaMode BLEND is not read: beams take the surface as solid";
            notices.note(place, message, None);
        }
        _ => {}
    }
    let extensions = material.extensions.given();
    let lets_through = extensions.is_some_and(|extensions| {
        let transmission = extensions.transmission.given();
        let factor = transmission.and_then(|t| t.transmission_factor.given()).copied();
        factor.is_some_and(|factor| factor > 0.0) || extensions.diffuse_transmission.is_some()
    });
    if lets_through {
        let message = "transmission is not read: beams take the surface as solid";
        notices.note(place, message, None);
    }
    let older = extensions.and_then(|extensions| extensions.specular_glossiness.given());
    let pbr = material.pbr_metallic_roughness.given();
    let has_texture = pbr.is_some_and(|pbr| pbr.base_color_texture.is_some())
        || older.is_some_and(|older| older.diffuse_texture.is_some());
    if has_texture {
        let message = "the texture is not read: the reflectivity follows from the colour factor alone";
        notices.note(place, message, None);
    }
}
