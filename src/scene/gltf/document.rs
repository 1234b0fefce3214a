//! The JSON of a glTF file, parsed, and the checks that do not need its binary data.

use std::collections::BTreeSet;

use super::fault::{Fault, quoted};
use super::notices::Notices;
use super::schema::{
    Accessor, Animation, Asset, Buffer, BufferView, Camera, Head, ImageJson, Lenient, MaterialJson, Mesh,
    Node, Root, Scene, Skin, TextureJson, TextureSampler,
};
use super::text::{mended, place_of};

/// The part of a glTF file's JSON that is about geometry, and the little of the rest that is told to the user.
pub(super) struct Document {
    /// The default scene.
    pub scene: Option<u32>,
    pub scenes: Vec<Scene>,
    pub nodes: Vec<Node>,
    pub meshes: Vec<Mesh>,
    pub materials: Vec<MaterialJson>,
    pub textures: Vec<TextureJson>,
    pub samplers: Vec<TextureSampler>,
    pub images: Vec<ImageJson>,
    pub skins: Vec<Skin>,
    pub accessors: Vec<Accessor>,
    pub buffer_views: Vec<BufferView>,
    pub buffers: Vec<Buffer>,
    pub cameras: Vec<Camera>,
    pub animations: Vec<Animation>,
    /// The extensions that the file says that it uses or requires.
    pub extensions: BTreeSet<String>,
    /// Whether positions may be integers: KHR_mesh_quantization.
    pub is_quantized: bool,
    /// Whether the largest integer among indices restarts a strip or a fan: EXT_mesh_primitive_restart.
    pub restarts: bool,
    /// The place of the whole file's origin: CESIUM_RTC.
    pub origin: [f64; 3],
}

/// An extension that compresses a primitive as a whole.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// The extensions that change the geometry and are read.
pub(super) const GEOMETRY: [&str; 10] = [
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "EXT_meshopt_compression",
    "EXT_mesh_gpu_instancing",
    "KHR_node_visibility",
    "KHR_animation_pointer",
    "CESIUM_RTC",
    "EXT_mesh_primitive_restart",
    "KHR_mesh_primitive_restart",
    DRACO,
];

/// The extensions of materials and textures that are read.
pub(super) const APPEARANCE: [&str; 7] = [
    "KHR_materials_clearcoat",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_texture_transform",
    "EXT_texture_webp",
];

/// Extensions that leave the geometry alone: they say how it behaves later, or catalogue it.
const HARMLESS: [&str; 10] = [
    "KHR_interactivity",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_techniques_webgl",
    "CESIUM_primitive_outline",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "MSFT_lod",
];

/// The second words of the names of extensions that leave the geometry alone, whoever made them.
const HARMLESS_SUBJECTS: [&str; 7] =
    ["animation", "audio", "lights", "materials", "packing", "texture", "xmp"];

/// Whether an extension that is not read leaves the geometry alone.
pub(super) fn is_harmless(extension: &str) -> bool {
    HARMLESS.contains(&extension)
        || extension.split('_').nth(1).is_some_and(|subject| HARMLESS_SUBJECTS.contains(&subject))
}

/// The help for a file whose JSON, past white space, does not start with `{`.
const NOT_JSON_HELP: &str = "beamcast reads glTF 2.0: a .gltf file (JSON) or a .glb file (binary)";

impl Document {
    /// Parses the JSON and checks that its version and its required extensions are known. Lines and columns of a text that
    /// lies in a binary file (`is_binary`) are told to nobody, who could not look there.
    pub fn parse(text: &[u8], is_binary: bool, notices: &Notices) -> Result<Self, Fault> {
        if text.starts_with(b"\xff\xfe") || text.starts_with(b"\xfe\xff") {
            return Err(Fault::new("", "the JSON is UTF-16").help("glTF's JSON is UTF-8"));
        }
        let text = mended(text, notices);
        if text.is_empty() {
            return Err(Fault::new("", "the JSON is empty"));
        }
        if !text.trim_ascii_start().starts_with(b"{") {
            return Err(Fault::new("", "this is not glTF").help(NOT_JSON_HELP));
        }
        let root: Root = serde_json::from_slice(&text).map_err(|error| {
            // A file of another version has other types, and its version is what is wrong with it.
            let head = serde_json::from_slice(&text).ok().and_then(|Head { asset }| asset);
            match head.map(|asset| check_version(&asset)) {
                Some(Err(fault)) => fault,
                _ => syntax_fault(&text, &error, is_binary),
            }
        })?;
        check_version(&root.asset)?;
        check_required(&root.extensions_required)?;
        Ok(Self::of(root, notices))
    }

    fn of(root: Root, notices: &Notices) -> Self {
        let mut extensions: BTreeSet<String> = root.extensions_used.into_iter().collect();
        extensions.extend(root.extensions_required);
        let has = |name: &str| extensions.contains(name);
        Self {
            is_quantized: has("KHR_mesh_quantization"),
            restarts: has("EXT_mesh_primitive_restart") || has("KHR_mesh_primitive_restart"),
            extensions,
            scene: root.scene,
            scenes: root.scenes,
            nodes: root.nodes,
            meshes: root.meshes,
            materials: elements(root.materials, "material", notices),
            textures: elements(root.textures, "texture", notices),
            samplers: elements(root.samplers, "sampler", notices),
            images: elements(root.images, "image", notices),
            skins: root.skins,
            accessors: root.accessors,
            buffer_views: root.buffer_views,
            buffers: root.buffers,
            cameras: elements(root.cameras, "camera", notices),
            animations: elements(root.animations, "animation", notices),
            origin: root.extensions.cesium_rtc.map_or([0.0; 3], |rtc| rtc.center),
        }
    }

    /// The label of a node in messages, such as `node 3 "wall"`.
    pub fn node_label(&self, index: u32) -> String {
        let name = self.nodes.get(index as usize).and_then(|node| node.name.as_deref());
        label("node", index, name)
    }

    /// The label of a mesh in messages, such as `mesh 3 "wall"`.
    pub fn mesh_label(&self, index: u32) -> String {
        let name = self.meshes.get(index as usize).and_then(|mesh| mesh.name.as_deref());
        label("mesh", index, name)
    }

    /// The label of a scene in messages, such as `scene 3 "street"`.
    pub fn scene_label(&self, index: u32) -> String {
        let name = self.scenes.get(index as usize).and_then(|scene| scene.name.as_deref());
        label("scene", index, name)
    }

    /// The label of an animation in messages, such as `animation 3 "walk"`.
    pub fn animation_label(&self, index: u32) -> String {
        let name = self.animations.get(index as usize).and_then(|animation| animation.name.given());
        label("animation", index, name.map(String::as_str))
    }

    /// The label of a material in messages, such as `material 3 "paint"`.
    pub fn material_label(&self, index: u32) -> String {
        let name = self.materials.get(index as usize).and_then(|material| material.name.given());
        label("material", index, name.map(String::as_str))
    }

    /// The label of an image in messages, such as `image 3 "bark"`.
    pub fn image_label(&self, index: u32) -> String {
        let image = self.images.get(index as usize);
        let name = image.and_then(|image| image.name.given().or(image.uri.given()));
        label("image", index, name.map(String::as_str).filter(|name| !name.starts_with("data:")))
    }
}

/// The label of an element in messages, such as `camera 0 "front"`.
pub(super) fn label(kind: &str, index: u32, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} {index} {}", quoted(name)),
        _ => format!("{kind} {index}"),
    }
}

/// The elements of a list that is of no use to the geometry. Where they are wrong, they are as if the file said nothing of
/// them.
fn elements<T: Default>(list: Lenient<Vec<Lenient<T>>>, kind: &str, notices: &Notices) -> Vec<T> {
    let list = match list {
        Lenient::Given(list) => list,
        Lenient::Absent => Vec::new(),
        Lenient::Wrong => {
            notices.warn(|| format!("{kind}s"), "this is no list of objects, and is not read");
            Vec::new()
        }
    };
    let element = |(index, element)| match element {
        Lenient::Given(element) => element,
        Lenient::Absent | Lenient::Wrong => {
            notices.warn(|| format!("{kind} {index}"), "it is not what glTF asks for, and is not read");
            T::default()
        }
    };
    list.into_iter().enumerate().map(element).collect()
}

fn check_version(asset: &Asset) -> Result<(), Fault> {
    const HELP: &str = "beamcast reads glTF 2.0; convert the file or export it again";
    let parse = |key: &str, version: &str| {
        let mut numbers = version.split('.').map(|number| number.parse::<u32>().ok());
        let numbers = numbers.next().flatten().zip(numbers.next().flatten());
        numbers.ok_or_else(|| {
            Fault::new(key, format!("{} is not a version", quoted(version))).help("such as \"2.0\"")
        })
    };
    let version = &asset.version;
    if parse("asset.version", version)?.0 != 2 {
        return Err(Fault::new("asset.version", format!("the file is glTF {}", quoted(version))).help(HELP));
    }
    if let Some(least) = &asset.min_version
        && parse("asset.minVersion", least)? > (2, 0)
    {
        let problem = format!("the file asks for a reader of glTF {} or later", quoted(least));
        return Err(Fault::new("asset.minVersion", problem).help(HELP));
    }
    Ok(())
}

fn check_required(required: &[String]) -> Result<(), Fault> {
    let is_known = |name: &str| GEOMETRY.contains(&name) || is_harmless(name);
    let unknown: Vec<_> = required.iter().filter(|name| !is_known(name)).map(|n| quoted(n)).collect();
    if unknown.is_empty() {
        return Ok(());
    }
    let problem = format!("the file requires {}, which beamcast does not read", unknown.join(", "));
    Err(Fault::new("extensionsRequired", problem).help("export the file without it"))
}

/// The error that the parser stopped at, with the element and the text that it stopped at.
fn syntax_fault(text: &[u8], error: &serde_json::Error, is_binary: bool) -> Fault {
    let lines = text.split_inclusive(|&byte| byte == b'\n');
    let line_start: usize = lines.take(error.line().saturating_sub(1)).map(<[u8]>::len).sum();
    let byte = (line_start + error.column().saturating_sub(1)).min(text.len());
    let (place, token) = place_of(text, byte);
    let mut reason = error.to_string();
    let position = format!(" at line {} column {}", error.line(), error.column());
    if is_binary {
        reason = reason.trim_end_matches(&position).to_owned();
    }
    if token == b"\"\"" {
        reason = format!("there is no number where one is wanted (inf and NaN are none): {reason}");
    }
    let problem = format!("the JSON is not what glTF asks for: {reason}");
    if error.is_eof() {
        return Fault::new(place, problem).help("the file seems to be cut short");
    }
    let problem = if is_binary || error.is_syntax() {
        format!("{problem}, at {}", excerpt(text, byte))
    } else {
        problem
    };
    Fault::new(place, problem)
}

/// The text around a byte, quoted, with a mark before what is there.
fn excerpt(text: &[u8], byte: usize) -> String {
    const BEFORE: usize = 40;
    const AFTER: usize = 20;
    let part = |from: usize, to: usize| {
        let part = String::from_utf8_lossy(&text[from..to]).replace('\u{fffd}', "");
        part.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let (from, to) = (byte.saturating_sub(BEFORE), (byte + AFTER).min(text.len()));
    let first = if from > 0 { "…" } else { "" };
    let last = if to < text.len() { "…" } else { "" };
    let whole = format!("{}▸{}", part(from, byte), part(byte, to));
    let whole: String = whole.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    format!("`{first}{whole}{last}`")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &[u8]) -> Result<Document, Fault> {
        Document::parse(text, false, &Notices::default())
    }

    fn error(text: &[u8]) -> String {
        parse(text).err().expect("an error").to_string()
    }

    #[test]
    fn versions() {
        let of = |asset: &str| parse(format!(r#"{{"asset":{{{asset}}}}}"#).as_bytes()).is_ok();
        assert!(of(r#""version":"2.0""#));
        assert!(of(r#""version":"2.1""#));
        assert!(of(r#""version":"2.1","minVersion":"2.0""#));
        assert!(!of(r#""version":"2.1","minVersion":"2.1""#));
        assert!(!of(r#""version":"1.0""#));
        assert!(!of(r#""version":"3.0""#));
        assert!(!of(r#""version":"two""#));
        assert!(!of(r#""version":2"#));
        assert_eq!(
            error(br#"{"asset":{"version":"1.0"}}"#),
            "asset.version: the file is glTF \"1.0\" (beamcast reads glTF 2.0; convert the file or export it again)"
        );
    }

    #[test]
    fn extensions_that_change_geometry_must_be_known() {
        let of = |name: &str| {
            let text = format!(r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["{name}"]}}"#);
            parse(text.as_bytes()).map(|_| ()).map_err(|fault| fault.to_string())
        };
        assert_eq!(of("KHR_materials_unlit"), Ok(()));
        assert_eq!(of("GOOGLE_texture_basis"), Ok(()));
        assert_eq!(of("KHR_mesh_quantization"), Ok(()));
        assert_eq!(
            of("KHR_gaussian_splatting").unwrap_err(),
            "extensionsRequired: the file requires \"KHR_gaussian_splatting\", which beamcast does not read \
             (export the file without it)"
        );
    }

    #[test]
    fn what_is_not_json_is_told_apart() {
        assert_eq!(error(b" \n"), "the JSON is empty");
        assert!(error(b"solid cube\n").starts_with("this is not glTF"));
        assert!(error(b"\xff\xfe{\0").contains("UTF-16"));
        assert!(error(br#"{"asset":{"version":"2.0"},"nodes":[{"#).contains("cut short"));
        assert!(error(b"{\n\"asset\":{\"version\":\"2.0\"},\n\"nodes\":7}").contains("line 3 column 9"));
        assert!(parse(b"\xef\xbb\xbf {\"asset\":{\"version\":\"2.0\"}}").is_ok());
    }

    #[test]
    fn deep_nesting_is_an_error_and_not_a_stack_overflow() {
        for (open, close) in [("[", "]"), (r#"{"a":"#, "}")] {
            for key in ["extras", "extensions", "nodes", "unknown"] {
                let deep = format!("{}1{}", open.repeat(200_000), close.repeat(200_000));
                let text = format!(r#"{{"asset":{{"version":"2.0"}},"{key}":{deep}}}"#);
                let _ = parse(text.as_bytes());
                let node = format!(
                    r#"{{"asset":{{"version":"2.0"}},"meshes":[{{"primitives":[],"{key}":{deep}}}]}}"#
                );
                let _ = parse(node.as_bytes());
            }
        }
        let deep = format!("{}1{}", "[".repeat(200), "]".repeat(200));
        let text = format!(r#"{{"asset":{{"version":"2.0"}},"accessors":{deep}}}"#);
        assert!(error(text.as_bytes()).contains("JSON"));
    }
}
