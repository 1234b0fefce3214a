//! Textures of glTF files: where images are kept, how they lie on surfaces, and the warnings of images that can't be read.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use beamcast::rng::Rng;
use beamcast::scene::{Scene, Wrap};
use beamcast::source::Severity;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::cut_outs::{CELLS, is_there};
use crate::hostile_scenes::{open, open_in_time};

/// Gives the first mesh of a scene, whose positions are in the first bytes of its buffer, a texture of so many columns and rows in
/// a file of its own.
pub fn add_texture(scene: &Path, size: u32) {
    let mut random = Rng::new(1);
    // A photograph is about as dense.
    let texels: Vec<u8> = (0..3 * size * size).map(|_| random.below(16) as u8).collect();
    let file = std::fs::File::create(scene.with_file_name("photo.png")).unwrap();
    let mut encoder = png::Encoder::new(file, size, size);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&texels).unwrap();
    let mut json: Value = serde_json::from_slice(&std::fs::read(scene).unwrap()).unwrap();
    let length = json["bufferViews"][0]["byteLength"].clone();
    let push = |list: &mut Value, element: Value| {
        list.as_array_mut().unwrap().push(element);
        list.as_array().unwrap().len() - 1
    };
    let view = json!({ "buffer": 0, "byteLength": length, "byteStride": 12 });
    let view = push(&mut json["bufferViews"], view);
    let count = json["accessors"][0]["count"].clone();
    let accessor = json!({ "bufferView": view, "componentType": 5126, "count": count, "type": "VEC2" });
    let accessor = push(&mut json["accessors"], accessor);
    let primitive = &mut json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_0"] = json!(accessor);
    primitive["material"] = json!(0);
    json["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
    json["textures"] = json!([{ "source": 0 }]);
    json["images"] = json!([{ "uri": "photo.png" }]);
    std::fs::write(scene, json.to_string()).unwrap();
}

/// A PNG of a checkerboard, opaque and red where it is there.
fn png() -> Vec<u8> {
    let texel = |i: usize| [255, 0, 0, if is_there(i % CELLS, i / CELLS) { 255 } else { 0 }];
    let texels: Vec<u8> = (0..CELLS * CELLS).flat_map(texel).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, CELLS as u32, CELLS as u32);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(&texels).unwrap();
    bytes
}

/// A file with a card one metre wide, in glTF's axes, whose texture's image is as given. Its texture coordinates are bytes.
fn file(image: Value) -> Value {
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    bytes.extend([0, 255, 0, 0, 255, 255, 0, 0, 255, 0, 0, 0, 0, 0, 0, 0]);
    bytes.extend([0, 1, 2, 0, 2, 3]);
    let image_at = bytes.len();
    bytes.extend(png());
    json!({
        "asset": { "version": "2.0" },
        "buffers": [{
            "byteLength": bytes.len(),
            "uri": format!("data:;base64,{}", STANDARD.encode(&bytes)),
        }],
        "bufferViews": [
            { "buffer": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 16, "byteStride": 4 },
            { "buffer": 0, "byteOffset": 64, "byteLength": 6 },
            { "buffer": 0, "byteOffset": image_at, "byteLength": bytes.len() - image_at },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC2" },
            { "bufferView": 2, "componentType": 5121, "count": 6, "type": "SCALAR" },
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0 }] }],
        "nodes": [{ "mesh": 0 }],
        "materials": [{
            "name": "leaf", "alphaMode": "MASK",
            "pbrMetallicRoughness": { "baseColorFactor": [0.5, 1, 1, 1], "baseColorTexture": { "index": 0 } },
        }],
        "textures": [{ "source": 0, "sampler": 0 }],
        "samplers": [{ "magFilter": 9728, "wrapS": 33071, "wrapT": 33648 }],
        "images": [image],
    })
}

/// A folder with a scene and other files.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        std::fs::create_dir(folder.path("scene")).unwrap();
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Loads a scene, with its warnings.
    fn load(&self, json: &Value) -> (Scene, Vec<String>) {
        let path = self.path("scene/scene.gltf");
        std::fs::write(&path, json.to_string()).unwrap();
        let loaded = open_in_time(&path).unwrap();
        let warnings = loaded.notices.iter().filter(|notice| notice.severity == Severity::Warning);
        (loaded.scene.clone(), warnings.map(ToString::to_string).collect())
    }
}

/// The share of the card that is there, in cells from its upper left corner.
fn opacities(scene: &Scene) -> Vec<f32> {
    let at = |i: usize| (i as f64 + 0.5) / CELLS as f64;
    let opacity = |cell: usize| {
        // The corners of the triangles are the lower left, the lower right and the upper right one, and the first, the third and
        // the upper left one.
        let (x, y) = (at(cell % CELLS), 1.0 - at(cell / CELLS));
        if y < x { scene.opacity(0, 0, x - y, y) } else { scene.opacity(0, 1, x, y - x) }
    };
    (0..CELLS * CELLS).map(opacity).collect()
}

#[test]
fn images_are_read_wherever_they_are_kept() {
    let folder = Folder::new();
    std::fs::write(folder.path("scene/a leaf.png"), png()).unwrap();
    let data = format!("data:image/png;base64,{}", STANDARD.encode(png()));
    let expected: Vec<f32> =
        (0..CELLS * CELLS).map(|cell| f32::from(u8::from(is_there(cell % CELLS, cell / CELLS)))).collect();
    for (image, files) in [
        (json!({ "uri": "a%20leaf.png" }), 2),
        (json!({ "uri": data }), 1),
        (json!({ "bufferView": 3, "mimeType": "image/png" }), 1),
    ] {
        let (scene, warnings) = folder.load(&file(image));
        assert_eq!(warnings, [""; 0]);
        assert_eq!(opacities(&scene), expected);
        let look = scene.appearance(0, 0, 0.49, 0.01);
        assert_eq!(look.base_color[..3], [0.5, 0.0, 0.0]);
        assert!((look.reflectivity() - 0.1063).abs() < 1e-6);
        assert_eq!(scene.geometry.files.len(), files);
        if let Some(file) = scene.geometry.files.get(1) {
            assert_eq!((&file.name[..], file.bytes), ("a%20leaf.png", png().len() as u64));
        }
        let texture = scene.geometry.materials[0].base_color_texture.as_ref().unwrap();
        assert_eq!((texture.wrap, texture.is_nearest), ([Wrap::ClampToEdge, Wrap::MirroredRepeat], true));
    }
    // An image that many textures and materials name is decoded once.
    let mut json = file(json!({ "uri": "a%20leaf.png" }));
    json["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
    json["images"] = json!([{ "uri": "a%20leaf.png" }, { "uri": "a%20leaf.png" }]);
    json["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] = json!({ "index": 1 });
    let (scene, _) = folder.load(&json);
    let images: Vec<_> = scene.geometry.materials[0].textures().map(|texture| &texture.image).collect();
    assert!(images.len() == 2 && Arc::ptr_eq(images[0], images[1]));
    assert_eq!(scene.geometry.files.len(), 2);
}

#[test]
fn what_surfaces_look_like_is_read() {
    let folder = Folder::new();
    let mut json = file(json!({ "bufferView": 3 }));
    json["materials"] = json!([{
        "alphaMode": "BLEND",
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 0.5], "metallicFactor": 0.25, "roughnessFactor": 0.75 },
        "extensions": {
            "KHR_materials_transmission": { "transmissionFactor": 0.5 },
            "KHR_materials_clearcoat": { "clearcoatFactor": 0.125 },
            "KHR_materials_ior": { "ior": 1.25 },
            "KHR_materials_specular": { "specularFactor": 0.5, "specularColorFactor": [0.5, 0.5, 0.5] },
        },
    }]);
    let (scene, warnings) = folder.load(&json);
    assert_eq!(warnings, [""; 0]);
    let look = scene.appearance(0, 0, 0.25, 0.5);
    assert_eq!(look.base_color, [0.5; 4]);
    assert_eq!((look.metallic, look.roughness, look.transmission), (0.25, 0.75, 0.5));
    assert_eq!((look.clearcoat, look.ior, look.opacity), (0.125, 1.25, 0.25));
    assert!((look.specular - 0.25).abs() < 1e-6);
    assert!(scene.geometry.meshes[0].corners.is_empty(), "nothing needs texture coordinates");
    assert!(!scene.varies(0, 0) && scene.is_see_through());

    // Vertex colours, which are linear, multiply the factor.
    let mut colors: Vec<u8> = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255; 4]].concat();
    let uri = json["buffers"][0]["uri"].as_str().unwrap().split_once(',').unwrap().1;
    let mut bytes = STANDARD.decode(uri).unwrap();
    let offset = bytes.len();
    bytes.append(&mut colors);
    json["buffers"][0] = json!({
        "byteLength": bytes.len(), "uri": format!("data:;base64,{}", STANDARD.encode(&bytes)) });
    json["bufferViews"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": 16 }));
    json["accessors"].as_array_mut().unwrap().push(
        json!({ "bufferView": 4, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC4" }),
    );
    json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(3);
    let (scene, _) = folder.load(&json);
    let look = scene.appearance(0, 0, 0.25, 0.5);
    assert!(
        look.base_color.iter().zip([0.125, 0.125, 0.25, 0.5]).all(|(a, b)| (a - b).abs() < 1e-6),
        "{look:?}"
    );
    assert!(scene.varies(0, 0));
}

/// The transform of a texture moves the holes: half the image to the left is as many cells.
#[test]
fn transforms_move_holes() {
    let folder = Folder::new();
    let mut json = file(json!({ "bufferView": 3 }));
    let texture = &mut json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
    texture["extensions"] = json!({ "KHR_texture_transform": { "offset": [0.125, 0], "scale": [0.5, 0.5] } });
    json["extensionsUsed"] = json!(["KHR_texture_transform"]);
    let (scene, warnings) = folder.load(&json);
    assert_eq!(warnings, [""; 0]);
    let expected: Vec<f32> = (0..CELLS * CELLS)
        .map(|cell| f32::from(u8::from(is_there((cell % CELLS) / 2 + 1, cell / CELLS / 2))))
        .collect();
    assert_eq!(opacities(&scene), expected);
}

#[test]
fn broken_images_are_warned_of_and_count_as_white() {
    let folder = Folder::new();
    std::fs::write(folder.path("secret.png"), png()).unwrap();
    std::fs::write(folder.path("scene/short.png"), &png()[..60]).unwrap();
    std::fs::write(folder.path("scene/text.png"), "no image").unwrap();
    std::fs::write(folder.path("scene/empty.png"), "").unwrap();
    let mut giant = png();
    giant[16..24].copy_from_slice(&[0, 1, 0x86, 0xa0, 0, 1, 0x86, 0xa0]);
    // The checksum of the header, whose bytes say 100 000 twice.
    let crc = crc(&giant[12..29]);
    giant[29..33].copy_from_slice(&crc.to_be_bytes());
    std::fs::write(folder.path("scene/giant.png"), giant).unwrap();
    for (image, told) in [
        (json!({ "uri": "short.png" }), "the PNG is broken"),
        (json!({ "uri": "text.png" }), "its content is no PNG, no JPEG and no WebP"),
        (json!({ "uri": "empty.png" }), "its content is no PNG, no JPEG and no WebP"),
        (json!({ "uri": "giant.png" }), "the file's images would take"),
        (json!({ "uri": "gone.png" }), "gone.png"),
        (json!({ "uri": "../secret.png" }), "leaves the scene's folder"),
        (json!({ "uri": "/etc/passwd" }), "is not a relative path"),
        (json!({ "uri": "http://a/b.png" }), "is not a relative path"),
        (json!({ "uri": "." }), "the image can't be read"),
        (json!({ "uri": "data:image/png;base64,!" }), "base64"),
        (json!({ "bufferView": 99 }), "it does not exist"),
        (json!({}), "neither a uri nor a bufferView"),
        (json!({ "bufferView": 3, "mimeType": "image/jpeg" }), "its mimeType is not that of its content"),
    ] {
        let (scene, warnings) = folder.load(&file(image.clone()));
        assert!(warnings.len() == 1 && warnings[0].contains(told), "{image}: {warnings:?}");
        assert!(warnings[0].starts_with("image 0"), "{warnings:?}");
        if image.get("mimeType").is_none() {
            assert_eq!(scene.appearance(0, 0, 0.25, 0.5).base_color, [0.5, 1.0, 1.0, 1.0], "{image}");
            assert_eq!(
                scene.geometry.files.len(),
                1 + usize::from(
                    told.contains("content") || told.contains("PNG") || told.contains("would take")
                )
            );
        }
    }
    // Textures, samplers, coordinates and colours that do not exist keep no geometry from being read either.
    for (key, value) in [
        ("/textures/0/source", json!(9)),
        ("/textures/0/sampler", json!(9)),
        ("/textures", json!("none")),
        ("/images", json!(7)),
        ("/samplers", json!([7])),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": -1 })),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture/texCoord", json!(3)),
        ("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(0)),
        ("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(77)),
        ("/accessors/1/count", json!(1e9 as u64)),
        ("/accessors/1/normalized", json!(false)),
    ] {
        let mut json = file(json!({ "bufferView": 3 }));
        match json.pointer_mut(key) {
            Some(place) => *place = value,
            None => json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = value,
        }
        let (scene, warnings) = folder.load(&json);
        assert_eq!(scene.triangle_count(), 2, "{key}");
        assert!(!warnings.is_empty() || key.ends_with("sampler"), "{key}");
    }
}

/// With any value in a material, a texture or an attribute, the geometry is read or refused without a panic.
#[test]
fn every_value_of_a_textured_file_replaced() {
    let folder = Folder::new();
    let good = file(json!({ "bufferView": 3 }));
    let mut places = Vec::new();
    let mut pending: Vec<(String, &Value)> = vec![(String::new(), &good)];
    while let Some((place, value)) = pending.pop() {
        match value {
            Value::Object(map) => {
                pending.extend(map.iter().map(|(key, value)| (format!("{place}/{key}"), value)))
            }
            Value::Array(list) => {
                pending.extend(list.iter().enumerate().map(|(i, value)| (format!("{place}/{i}"), value)))
            }
            _ => {}
        }
        let is_data = place.is_empty() || place.starts_with("/buffers") || place.starts_with("/asset");
        if !is_data {
            places.push(place);
        }
    }
    let path = folder.path("scene/scene.gltf");
    for place in places {
        for value in
            [json!(null), json!(-1), json!(1e30), json!(7), json!("x"), json!([]), json!({}), json!(true)]
        {
            let mut json = good.clone();
            *json.pointer_mut(&place).unwrap() = value.clone();
            std::fs::write(&path, json.to_string()).unwrap();
            match open(&path) {
                Err(error) => {
                    assert!(!error.problem.contains("error in beamcast"), "{place} {value}: {error}")
                }
                Ok(loaded) => {
                    let look = loaded.scene.appearance(0, 0, 0.25, 0.5);
                    assert!((0.0..=1.0).contains(&look.opacity), "{place} {value}: {look:?}");
                }
            }
        }
    }
}

/// The checksum of a PNG's chunk, bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    !crc
}

/// The files of others that are about alpha and textures, if BEAMCAST_CORPUS names their folder.
#[test]
fn textures_of_others_are_read() {
    let Some(corpus) = std::env::var_os("BEAMCAST_CORPUS").map(PathBuf::from) else { return };
    for (name, textures) in [
        ("SampleAssets/Models/TextureTransformTest/glTF/TextureTransformTest.gltf", 9),
        ("SampleAssets/Models/MultiUVTest/glTF-Binary/MultiUVTest.glb", 1),
        ("trimesh/models/AlphaBlendModeTest.glb", 5),
    ] {
        let loaded = open(&corpus.join("valid").join(name)).unwrap();
        let warned: Vec<_> = loaded.notices.iter().filter(|n| n.severity == Severity::Warning).collect();
        assert!(warned.is_empty(), "{name}: {warned:?}");
        let materials = &loaded.scene.geometry.materials;
        let found = materials.iter().filter(|material| material.base_color_texture.is_some()).count();
        assert!(
            found >= textures.min(1)
                && !loaded.scene.geometry.meshes.iter().all(|mesh| mesh.corners.is_empty()),
            "{name}: {found}"
        );
    }
}
