//! The JSON of a glTF file: its types, and the checks that do not need its binary data.

use gltf::json;
use serde::Deserialize;

use super::fault::{Fault, quoted};

/// The part of a glTF file's JSON that is about geometry. Textures, animations, cameras and lights are not parsed, so no
/// mistake in them keeps the geometry from loading.
///
/// Indices are as the file gives them, unchecked; readers look elements up with `get`.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document {
    pub asset: json::Asset,
    pub scene: Option<u32>,
    #[serde(default)]
    pub scenes: Vec<Scene>,
    #[serde(default)]
    pub nodes: Vec<Node>,
    #[serde(default)]
    pub meshes: Vec<json::Mesh>,
    #[serde(default)]
    pub materials: Vec<Material>,
    #[serde(default)]
    pub skins: Vec<json::Skin>,
    #[serde(default)]
    pub accessors: Vec<json::Accessor>,
    #[serde(default)]
    pub buffer_views: Vec<json::buffer::View>,
    #[serde(default)]
    pub buffers: Vec<json::Buffer>,
    #[serde(default)]
    pub extensions_used: Vec<String>,
    #[serde(default)]
    pub extensions_required: Vec<String>,
}

/// A scene. The type of the crate gltf refuses a scene without nodes, which glTF allows.
#[derive(Deserialize)]
pub(super) struct Scene {
    pub name: Option<String>,
    #[serde(default)]
    pub nodes: Vec<u32>,
}

/// A node. The type of the crate gltf rounds transforms to f32, which is half a metre at Web Mercator coordinates.
#[derive(Deserialize)]
pub(super) struct Node {
    pub name: Option<String>,
    #[serde(default)]
    pub children: Vec<u32>,
    pub mesh: Option<u32>,
    pub skin: Option<u32>,
    pub weights: Option<Vec<f64>>,
    pub matrix: Option<Box<[f64; 16]>>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    #[serde(default)]
    pub extensions: NodeExtensions,
    #[serde(default)]
    pub extras: json::Extras,
}

/// A material's name and colour. The type of the crate gltf also refuses materials whose textures or blending are wrong.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Material {
    pub name: Option<String>,
    #[serde(default)]
    pub pbr_metallic_roughness: MetallicRoughness,
    #[serde(default)]
    pub extensions: MaterialExtensions,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MetallicRoughness {
    pub base_color_factor: Option<[f32; 4]>,
}

#[derive(Default, Deserialize)]
pub(super) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub specular_glossiness: Option<SpecularGlossiness>,
}

/// KHR_materials_pbrSpecularGlossiness, an older model. Where a material has it, its colour counts.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SpecularGlossiness {
    pub diffuse_factor: Option<[f32; 4]>,
}

#[derive(Default, Deserialize)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub instancing: Option<Instancing>,
    #[serde(rename = "KHR_node_visibility")]
    pub visibility: Option<Visibility>,
}

/// EXT_mesh_gpu_instancing of a node: accessors by attribute.
#[derive(Deserialize)]
pub(super) struct Instancing {
    pub attributes: std::collections::BTreeMap<String, u32>,
}

/// KHR_node_visibility of a node.
#[derive(Deserialize)]
pub(super) struct Visibility {
    #[serde(default = "yes")]
    pub visible: bool,
}

fn yes() -> bool {
    true
}

/// The extensions that change the geometry and are read.
const GEOMETRY: [&str; 5] = [
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "EXT_meshopt_compression",
    "EXT_mesh_gpu_instancing",
    "KHR_node_visibility",
];

/// Extensions that leave the geometry alone: they say how it behaves later, or catalogue it.
const HARMLESS: [&str; 9] = [
    "KHR_interactivity",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_techniques_webgl",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "MSFT_lod",
];

/// The second words of the names of extensions that leave the geometry alone, whoever made them.
const HARMLESS_SUBJECTS: [&str; 7] =
    ["animation", "audio", "lights", "materials", "packing", "texture", "xmp"];

/// The help for a file whose JSON, past white space, does not start with `{`.
const NOT_JSON_HELP: &str = "beamcast reads glTF 2.0: a .gltf file (JSON) or a .glb file (binary)";

impl Document {
    /// Parses the JSON and checks that its version and its required extensions are known.
    pub fn parse(text: &[u8]) -> Result<Self, Fault> {
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        if text.starts_with(b"\xff\xfe") || text.starts_with(b"\xfe\xff") {
            return Err(Fault::new("", "the JSON is UTF-16").help("glTF's JSON is UTF-8"));
        }
        if text.trim_ascii().is_empty() {
            return Err(Fault::new("", "the JSON is empty"));
        }
        if !text.trim_ascii_start().starts_with(b"{") {
            return Err(Fault::new("", "this is not glTF").help(NOT_JSON_HELP));
        }
        let document: Self = serde_json::from_slice(text).map_err(|error| {
            let problem = format!("the JSON is not what glTF asks for: {error}");
            let fault = Fault::new("", problem);
            if error.is_eof() { fault.help("the file seems to be cut short") } else { fault }
        })?;
        document.check_version()?;
        document.check_extensions()?;
        Ok(document)
    }

    fn check_version(&self) -> Result<(), Fault> {
        const HELP: &str = "beamcast reads glTF 2.0; convert the file or export it again";
        let parse = |key: &str, version: &str| {
            let numbers = version
                .split_once('.')
                .and_then(|(major, minor)| Some((major.parse::<u32>().ok()?, minor.parse::<u32>().ok()?)));
            numbers.ok_or_else(|| {
                Fault::new(key, format!("{} is not a version", quoted(version))).help("such as \"2.0\"")
            })
        };
        let version = &self.asset.version;
        if parse("asset.version", version)?.0 != 2 {
            return Err(
                Fault::new("asset.version", format!("the file is glTF {}", quoted(version))).help(HELP)
            );
        }
        if let Some(least) = &self.asset.min_version
            && parse("asset.minVersion", least)? > (2, 0)
        {
            let problem = format!("the file asks for a reader of glTF {} or later", quoted(least));
            return Err(Fault::new("asset.minVersion", problem).help(HELP));
        }
        Ok(())
    }

    fn check_extensions(&self) -> Result<(), Fault> {
        let known = |name: &str| {
            GEOMETRY.contains(&name)
                || HARMLESS.contains(&name)
                || name.split('_').nth(1).is_some_and(|subject| HARMLESS_SUBJECTS.contains(&subject))
                // A primitive that uses it is refused when it is read.
                || name == DRACO
        };
        let unknown: Vec<_> =
            self.extensions_required.iter().filter(|name| !known(name)).map(|n| quoted(n)).collect();
        if unknown.is_empty() {
            return Ok(());
        }
        let problem = format!("the file requires {}, which beamcast does not read", unknown.join(", "));
        Err(Fault::new("extensionsRequired", problem).help("export the file without it"))
    }

    /// Whether the file says that it uses an extension.
    pub fn uses(&self, extension: &str) -> bool {
        self.requires(extension) || self.extensions_used.iter().any(|name| name == extension)
    }

    /// Whether the file says that it cannot be read without an extension.
    pub fn requires(&self, extension: &str) -> bool {
        self.extensions_required.iter().any(|name| name == extension)
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
}

/// An extension whose data only its own large decoder reads, so that it is refused.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

fn label(kind: &str, index: u32, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} {index} {}", quoted(name)),
        _ => format!("{kind} {index}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &[u8]) -> String {
        Document::parse(text).err().expect("an error").to_string()
    }

    #[test]
    fn versions() {
        let of = |asset: &str| Document::parse(format!(r#"{{"asset":{{{asset}}}}}"#).as_bytes()).is_ok();
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
            Document::parse(text.as_bytes()).map(|_| ()).map_err(|fault| fault.to_string())
        };
        assert_eq!(of("KHR_materials_unlit"), Ok(()));
        assert_eq!(of("GOOGLE_texture_basis"), Ok(()));
        assert_eq!(of("KHR_mesh_quantization"), Ok(()));
        assert_eq!(
            of("CESIUM_RTC").unwrap_err(),
            "extensionsRequired: the file requires \"CESIUM_RTC\", which beamcast does not read \
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
        assert!(Document::parse(b"\xef\xbb\xbf {\"asset\":{\"version\":\"2.0\"}}").is_ok());
    }

    #[test]
    fn deep_nesting_is_an_error_and_not_a_stack_overflow() {
        for (open, close) in [("[", "]"), (r#"{"a":"#, "}")] {
            for key in ["extras", "extensions", "nodes", "unknown"] {
                let deep = format!("{}1{}", open.repeat(200_000), close.repeat(200_000));
                let text = format!(r#"{{"asset":{{"version":"2.0"}},"{key}":{deep}}}"#);
                let _ = Document::parse(text.as_bytes());
                let node = format!(
                    r#"{{"asset":{{"version":"2.0"}},"meshes":[{{"primitives":[],"{key}":{deep}}}]}}"#
                );
                let _ = Document::parse(node.as_bytes());
            }
        }
        let deep = format!("{}1{}", "[".repeat(200), "]".repeat(200));
        let text = format!(r#"{{"asset":{{"version":"2.0"}},"nodes":{deep}}}"#);
        assert!(error(text.as_bytes()).contains("JSON"));
    }
}
