//! The types of a glTF file's JSON: what of it says where the geometry is, and the little of the rest that is told to the user.
//!
//! Indices are as the file gives them, unchecked; readers look elements up with `get`. What says where the geometry is must
//! be as glTF asks for it. Everything else is [`Lenient`]: no mistake in a material, a camera or an animation keeps the
//! geometry from being read.

use std::collections::BTreeMap;

use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Deserializer};
use serde_json::Value;
use serde_json::value::RawValue;

/// A value that may be anything, though only a `T` is of use.
#[derive(Clone, Debug, Default)]
pub(super) enum Lenient<T> {
    /// It is not there.
    #[default]
    Absent,
    Given(T),
    /// It is something else.
    Wrong,
}

impl<T> Lenient<T> {
    pub fn given(&self) -> Option<&T> {
        match self {
            Self::Given(value) => Some(value),
            _ => None,
        }
    }
}

impl<'de, T: DeserializeOwned> Deserialize<'de> for Lenient<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let raw = Box::<RawValue>::deserialize(deserializer)?;
        Ok(match serde_json::from_str(raw.get()) {
            Ok(value) => Self::Given(value),
            Err(_) if raw.get() == "null" => Self::Absent,
            Err(_) => Self::Wrong,
        })
    }
}

/// A name. A number is a name too, and what is neither is none: names say nothing of where the geometry is.
fn name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    let raw = Box::<RawValue>::deserialize(deserializer)?;
    Ok(match serde_json::from_str(raw.get()) {
        Ok(Value::String(name)) => Some(name),
        Ok(Value::Number(number)) => Some(number.to_string()),
        _ => None,
    })
}

/// The whole file.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Root {
    pub asset: Asset,
    pub scene: Option<u32>,
    #[serde(default)]
    pub scenes: Vec<Scene>,
    #[serde(default)]
    pub nodes: Vec<Node>,
    #[serde(default)]
    pub meshes: Vec<Mesh>,
    #[serde(default)]
    pub materials: Lenient<Vec<Lenient<MaterialJson>>>,
    #[serde(default)]
    pub textures: Lenient<Vec<Lenient<TextureJson>>>,
    #[serde(default)]
    pub samplers: Lenient<Vec<Lenient<TextureSampler>>>,
    #[serde(default)]
    pub images: Lenient<Vec<Lenient<ImageJson>>>,
    #[serde(default)]
    pub skins: Vec<Skin>,
    #[serde(default)]
    pub accessors: Vec<Accessor>,
    #[serde(default)]
    pub buffer_views: Vec<BufferView>,
    #[serde(default)]
    pub buffers: Vec<Buffer>,
    #[serde(default)]
    pub cameras: Lenient<Vec<Lenient<Camera>>>,
    #[serde(default)]
    pub animations: Lenient<Vec<Lenient<Animation>>>,
    #[serde(default)]
    pub extensions_used: Vec<String>,
    #[serde(default)]
    pub extensions_required: Vec<String>,
    #[serde(default)]
    pub extensions: RootExtensions,
}

/// What a file of any version says of itself.
#[derive(Deserialize)]
pub(super) struct Head {
    pub asset: Option<Asset>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Asset {
    pub version: String,
    pub min_version: Option<String>,
}

#[derive(Default, Deserialize)]
pub(super) struct RootExtensions {
    #[serde(rename = "CESIUM_RTC")]
    pub cesium_rtc: Option<CesiumRtc>,
}

/// CESIUM_RTC: where the origin of the whole file is.
#[derive(Deserialize)]
pub(super) struct CesiumRtc {
    pub center: [f64; 3],
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    #[serde(deserialize_with = "name")]
    pub name: Option<String>,
    pub nodes: Vec<u32>,
}

/// A node. Its numbers are f64: f32 is half a metre at Web Mercator coordinates.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    #[serde(deserialize_with = "name")]
    pub name: Option<String>,
    pub children: Vec<u32>,
    pub mesh: Option<u32>,
    pub skin: Option<u32>,
    pub camera: Lenient<u32>,
    pub weights: Option<Vec<f64>>,
    pub matrix: Option<Box<[f64; 16]>>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    pub extensions: NodeExtensions,
    pub extras: Option<Box<RawValue>>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub instancing: Option<Instancing>,
    #[serde(rename = "KHR_node_visibility")]
    pub visibility: Option<Visibility>,
}

/// EXT_mesh_gpu_instancing of a node: accessors by attribute.
#[derive(Deserialize)]
pub(super) struct Instancing {
    pub attributes: BTreeMap<String, u32>,
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

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    #[serde(deserialize_with = "name")]
    pub name: Option<String>,
    pub primitives: Vec<Primitive>,
    pub weights: Vec<f64>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub attributes: BTreeMap<String, u32>,
    pub indices: Option<u32>,
    pub material: Option<u32>,
    pub mode: Option<u32>,
    pub targets: Vec<Target>,
    pub extensions: BTreeMap<String, Box<RawValue>>,
}

/// A morph target.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Target {
    #[serde(rename = "POSITION")]
    pub position: Option<u32>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Skin {
    pub name: Lenient<String>,
    pub inverse_bind_matrices: Option<u32>,
    pub joints: Vec<u32>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Accessor {
    pub buffer_view: Option<u32>,
    pub byte_offset: u64,
    pub component_type: u32,
    pub normalized: bool,
    pub count: Option<u64>,
    #[serde(rename = "type")]
    pub kind: String,
    pub max: Lenient<Vec<f64>>,
    pub sparse: Option<Sparse>,
}

/// The elements of an accessor that differ from its view.
#[derive(Deserialize)]
pub(super) struct Sparse {
    pub count: u64,
    pub indices: SparseIndices,
    pub values: SparseValues,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub buffer_view: u32,
    #[serde(default)]
    pub byte_offset: u64,
    pub component_type: u32,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub buffer_view: u32,
    #[serde(default)]
    pub byte_offset: u64,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct BufferView {
    pub buffer: Option<u32>,
    pub byte_offset: u64,
    pub byte_length: u64,
    pub byte_stride: Option<usize>,
    pub extensions: BTreeMap<String, Box<RawValue>>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Buffer {
    pub byte_length: u64,
    pub uri: Option<String>,
}

/// An animation: values over time (samplers), and what each of them moves (channels).
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Animation {
    pub name: Lenient<String>,
    pub channels: Lenient<Vec<Lenient<AnimationChannel>>>,
    pub samplers: Lenient<Vec<Lenient<Sampler>>>,
}

/// A sampler of an animation, and the property that it moves.
#[derive(Deserialize)]
pub(super) struct AnimationChannel {
    pub sampler: u32,
    pub target: ChannelTarget,
}

#[derive(Deserialize)]
pub(super) struct ChannelTarget {
    pub node: Option<u32>,
    pub path: String,
    #[serde(default)]
    pub extensions: ChannelExtensions,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct ChannelExtensions {
    #[serde(rename = "KHR_animation_pointer")]
    pub pointer: Option<AnimationPointer>,
}

/// KHR_animation_pointer: the property as a JSON pointer into the file.
#[derive(Deserialize)]
pub(super) struct AnimationPointer {
    pub pointer: String,
}

/// Values over time.
#[derive(Deserialize)]
pub(super) struct Sampler {
    /// The accessor of the times.
    pub input: u32,
    /// The accessor of the values.
    pub output: u32,
    pub interpolation: Option<String>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Camera {
    pub name: Lenient<String>,
    #[serde(rename = "type")]
    pub kind: Lenient<String>,
}

/// A material as it stands in the file.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct MaterialJson {
    pub name: Lenient<String>,
    pub alpha_mode: Lenient<String>,
    pub alpha_cutoff: Lenient<f64>,
    pub pbr_metallic_roughness: Lenient<MetallicRoughness>,
    pub extensions: Lenient<MaterialExtensions>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct MetallicRoughness {
    pub base_color_factor: Lenient<Vec<f64>>,
    pub base_color_texture: Lenient<TextureInfo>,
    pub metallic_factor: Lenient<f64>,
    pub roughness_factor: Lenient<f64>,
    pub metallic_roughness_texture: Lenient<TextureInfo>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub specular_glossiness: Lenient<SpecularGlossiness>,
    #[serde(rename = "KHR_materials_transmission")]
    pub transmission: Lenient<Transmission>,
    #[serde(rename = "KHR_materials_clearcoat")]
    pub clearcoat: Lenient<Clearcoat>,
    #[serde(rename = "KHR_materials_ior")]
    pub ior: Lenient<Ior>,
    #[serde(rename = "KHR_materials_specular")]
    pub specular: Lenient<Specular>,
    #[serde(rename = "KHR_materials_diffuse_transmission")]
    pub diffuse_transmission: Option<IgnoredAny>,
}

/// KHR_materials_pbrSpecularGlossiness, an older model. Where a material has it, its colour counts.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct SpecularGlossiness {
    pub diffuse_factor: Lenient<Vec<f64>>,
    pub diffuse_texture: Lenient<TextureInfo>,
    pub glossiness_factor: Lenient<f64>,
}

/// KHR_materials_transmission of a material.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Transmission {
    pub transmission_factor: Lenient<f64>,
    pub transmission_texture: Lenient<TextureInfo>,
}

/// KHR_materials_clearcoat of a material.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Clearcoat {
    pub clearcoat_factor: Lenient<f64>,
}

/// KHR_materials_ior of a material.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Ior {
    pub ior: Lenient<f64>,
}

/// KHR_materials_specular of a material.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Specular {
    pub specular_factor: Lenient<f64>,
    pub specular_color_factor: Lenient<[f64; 3]>,
}

/// The texture of a material, and the texture coordinates that it takes.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub index: u32,
    #[serde(default)]
    pub tex_coord: Lenient<u32>,
    #[serde(default)]
    pub extensions: Lenient<TextureInfoExtensions>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub transform: Lenient<TextureTransform>,
}

/// KHR_texture_transform of a texture of a material.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct TextureTransform {
    pub offset: Lenient<[f64; 2]>,
    pub rotation: Lenient<f64>,
    pub scale: Lenient<[f64; 2]>,
    pub tex_coord: Lenient<u32>,
}

/// A texture: an image, and how it is sampled.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureJson {
    pub sampler: Lenient<u32>,
    pub source: Lenient<u32>,
    pub extensions: Lenient<TextureExtensions>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureExtensions {
    #[serde(rename = "EXT_texture_webp")]
    pub webp: Lenient<TextureSource>,
    #[serde(rename = "KHR_texture_basisu")]
    pub basisu: Lenient<TextureSource>,
}

/// The image that an extension of a texture names.
#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureSource {
    pub source: Lenient<u32>,
}

/// How a texture is sampled.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct TextureSampler {
    pub mag_filter: Lenient<u32>,
    pub wrap_s: Lenient<u32>,
    pub wrap_t: Lenient<u32>,
}

/// An image as it stands in the file.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct ImageJson {
    pub name: Lenient<String>,
    pub uri: Lenient<String>,
    pub buffer_view: Lenient<u32>,
    pub mime_type: Lenient<String>,
}

/// What an accessor's elements are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar,
    Vec2,
    Vec3,
    Vec4,
    Mat2,
    Mat3,
    Mat4,
}

/// What the components of an accessor's elements are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Kind {
    const ALL: [(Self, &'static str, usize); 7] = [
        (Self::Scalar, "SCALAR", 1),
        (Self::Vec2, "VEC2", 2),
        (Self::Vec3, "VEC3", 3),
        (Self::Vec4, "VEC4", 4),
        (Self::Mat2, "MAT2", 4),
        (Self::Mat3, "MAT3", 9),
        (Self::Mat4, "MAT4", 16),
    ];

    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|row| row.1 == name).map(|row| row.0)
    }

    /// glTF's name.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    /// The number of components of an element.
    pub fn components(self) -> usize {
        Self::ALL[self as usize].2
    }
}

impl Component {
    const ALL: [(Self, u32, &'static str, usize); 6] = [
        (Self::I8, 5120, "BYTE", 1),
        (Self::U8, 5121, "UNSIGNED_BYTE", 1),
        (Self::I16, 5122, "SHORT", 2),
        (Self::U16, 5123, "UNSIGNED_SHORT", 2),
        (Self::U32, 5125, "UNSIGNED_INT", 4),
        (Self::F32, 5126, "FLOAT", 4),
    ];

    pub fn numbered(number: u32) -> Option<Self> {
        Self::ALL.iter().find(|row| row.1 == number).map(|row| row.0)
    }

    /// glTF's name.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].2
    }

    /// Its bytes.
    pub fn size(self) -> usize {
        Self::ALL[self as usize].3
    }
}
